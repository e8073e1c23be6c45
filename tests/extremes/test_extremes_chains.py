"""Answers of other programs: every case ends as it must."""

from __future__ import annotations

import pytest
from chains import CASES
from every import parameters


@pytest.mark.parametrize("case", parameters(CASES))
def test_chains(case, honest):
    honest(case)
