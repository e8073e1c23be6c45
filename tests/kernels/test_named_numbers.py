"""Numbers with names: the same in Python and in kernels, and nothing else in their place."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pytest
from numpy.typing import NDArray

from hybrid.kernels.machine.binding import Packed, Room, Table
from hybrid.kernels.machine.compile import inner, kernel
from hybrid.kernels.machine.references import NamedNumbers, key_of, reader


class Times(NamedNumbers):
    now: float
    step: float


class Steps(NamedNumbers, number=np.int64):
    taken: int
    wasted: int


class Job(NamedTuple):
    times: Times
    more: NDArray[np.float64]
    steps: Steps


read = reader(Job(Times(), np.zeros(1), Steps()))


@inner
def go_on(times, steps):
    times.now += times.step
    steps.taken += 1


@kernel
def take(table, times):
    job = read(table)
    for _ in range(3):
        go_on(job.times, job.steps)
    go_on(times, job.steps)
    job.steps.wasted = int(job.more[0])
    for k in range(job.times.plain.shape[0]):
        times.plain[k] += 0.5 * job.times.plain[k]
    return job.times.now


def test_kernels_and_python_see_the_same_numbers() -> None:
    times, steps, others = Times(now=1.0, step=0.5), Steps(taken=5), Times(step=2.0)
    table = Table(Job(times, np.array([7.0]), steps))
    assert take(table.numbers, others) == 2.5
    assert times.plain.tolist() == [2.5, 0.5] and others.plain.tolist() == [3.25, 2.25]
    assert (steps.taken, steps.wasted) == (9, 7) and steps.plain.dtype == np.int64


def test_numbers_of_one_class_are_not_those_of_another() -> None:
    table = Table(Job(Times(), np.zeros(1), Steps()))
    for wrong in (np.zeros(2), Steps()):
        with pytest.raises(TypeError, match="times"):
            table.bind(times=wrong)
    with pytest.raises(TypeError, match="Times: shape"):
        key_of(Times()[:1])
    with pytest.raises(ValueError, match="expected 2 numbers of Times"):
        Times.of(np.zeros(3))
    assert Times.of(np.array([3.0, 4.0])).step == 4.0


def test_names_are_those_of_the_class_and_of_nothing_else() -> None:
    with pytest.raises(TypeError, match="Times has no later"):
        Times(later=1.0)
    with pytest.raises(TypeError, match=r"Wrong\.flags"):
        type("Wrong", (NamedNumbers,), {"__annotations__": {"flags": "float"}})


def test_packed_numbers_keep_their_names() -> None:
    class Parts(NamedTuple):
        values: NDArray[np.float64]
        times: Times

    packed = Packed(lambda n: Parts(np.zeros(n), Times()))
    for made in (packed(4), Room(packed, 6).view(4)):
        assert isinstance(made.times, Times)
        made.times.step = 3.0
        assert made.times.plain.tolist() == [0.0, 3.0] and made.values.size == 4
