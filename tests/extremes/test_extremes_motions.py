"""Motions with an exact or an independent solution: every case ends as it must."""

from __future__ import annotations

import pytest
from every import parameters
from motions import CASES


@pytest.mark.parametrize("case", parameters(CASES))
def test_motions(case, honest):
    honest(case)
