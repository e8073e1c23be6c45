"""The table of addresses that a kernel gets its arguments by."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pytest

from hybrid.kernels.machine.binding import Table
from hybrid.kernels.state.state import Floats


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


def test_a_function_that_makes_the_example_is_called_once() -> None:
    """Tables of one kernel, of which a run makes tens, do not each find out what it takes."""
    made = []

    def blank() -> Example:
        made.append(Example(Pair(np.zeros(2), np.ones(2))))
        return made[-1]

    one, other = Table(blank), Table(blank, np.zeros(4, np.int64))
    assert len(made) == 1 and np.array_equal(one.numbers, other.numbers) and one.numbers is not other.numbers
    one.bind(pair=Pair(np.zeros(3), np.ones(3)))
    assert np.array_equal(other.numbers, Table(made[0]).numbers)
    with pytest.raises(TypeError, match="contiguous"):
        other.bind(pair=Pair(np.zeros(3), np.ones(4)[::2]))
