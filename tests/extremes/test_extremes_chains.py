"""Answers of other programs: every case ends as it must."""

from __future__ import annotations

import pytest
from every import parameters
from chains import CASES


@pytest.mark.parametrize("case", parameters(CASES))
def test_chains(case, honest):
    honest(case)
