"""Lines, rods, motions and answers of other programs whose end is known: every case ends as it must."""

from __future__ import annotations

import pytest
from every import CASES, parameters


@pytest.mark.long
@pytest.mark.parametrize("case", parameters(CASES))
def test_extremes(case, assert_honest):
    assert_honest(case)
