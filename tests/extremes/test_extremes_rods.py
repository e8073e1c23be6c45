"""Rods with a closed form or an independent solution: every case ends as it must."""

from __future__ import annotations

import pytest
from every import parameters
from rods import CASES


@pytest.mark.parametrize("case", parameters(CASES))
def test_rods(case, honest):
    honest(case)
