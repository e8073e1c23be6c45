"""Lines with a closed form: every case ends as it must."""

from __future__ import annotations

import pytest
from every import parameters
from lines import CASES


@pytest.mark.parametrize("case", parameters(CASES))
def test_lines(case, honest):
    honest(case)
