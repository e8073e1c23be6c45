"""The table of addresses that a kernel gets its arguments by."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pytest

from hybrid.kernels.binding import Table
from hybrid.kernels.state import Floats


class Pair(NamedTuple):
    a: Floats
    b: Floats


class Example(NamedTuple):
    pair: Pair


def test_what_was_bound_before_a_failure_is_bound_anew() -> None:
    """Nothing is bound where a value fails half-way; what was there before can be bound again."""
    good = Pair(np.zeros(2), np.ones(2))
    table = Table(Example(good))
    numbers = table.numbers.copy()
    with pytest.raises(TypeError, match="contiguous"):
        table.bind(pair=Pair(np.zeros(3), np.ones(4)[::2]))
    table.bind(pair=good)
    assert np.array_equal(table.numbers, numbers)
