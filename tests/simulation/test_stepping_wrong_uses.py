"""A hundred wrong uses of hybrid.Simulation: an error in words, and it goes on as if nothing had been asked."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from math import inf, nan
from typing import Any

import numpy as np
import pytest

import hybrid

TIMES = [None, "x", nan, inf, -1.0, 0.0, [], [1], {}, object(), True, 1e300, b"a", 1 + 2j, np.zeros(3), "1.0"]
VECTORS = ["abc", nan, [1, 2], [1, 2, 3, 4], [1, nan, 3], [1, 2, "x"], {}, object(), np.zeros((3, 3)), [[1], [2], [3]],
           [None] * 3, [inf, 0, 0], 1.0, [1j, 0, 0], [True, {}, 0]]  # fmt: skip
FRAMES = ["x", nan, np.zeros((3, 3)), -np.eye(3), 2 * np.eye(3), np.full((3, 3), nan), np.eye(2), [1, 2, 3], object(),
          np.diag([1, 1, -1]), {}]  # fmt: skip
NO_ENDS = ["middle", 0, None, 1, "START", [], object(), b"end"]


def simulation(cells: int = 10) -> hybrid.Simulation:
    tables: dict[str, Any] = {
        "cable": {"sections": [{"length": 10, "mass": 1, "axial_stiffness": 1e5, "bending_stiffness": 5}]},
        "ends": {"start": {"kind": "clamped", "position": [0, 0, 0], "tangent": [1, 0, 0]}, "end": "free"},
        "initial": "equilibrium", "model": "rod", "mesh": {"cells": cells}, "time": {"duration": 2, "step": 0.05},
    }  # fmt: skip
    return hybrid.Simulation(tables)


def uses(other: Any) -> Iterator[Callable[[hybrid.Simulation], Any]]:
    """Wrong calls; other: what `save` of another Simulation has returned."""
    place = [0.0, 0.0, 0.0]
    for x in TIMES:
        yield lambda s, x=x: s.advance(x)
    for x in NO_ENDS:
        yield lambda s, x=x: s.set_end(x, place)
        yield lambda s, x=x: s.set_force(x, place)
        yield lambda s, x=x: s.release(x)
    for x in VECTORS:
        yield lambda s, x=x: s.set_end("start", x)
        yield lambda s, x=x: s.set_end("start", place, x)
        yield lambda s, x=x: s.set_force("end", x)
        yield lambda s, x=x: s.set_force("end", [9.0, 0.0, 0.0], x)
    for x in FRAMES:
        yield lambda s, x=x: s.set_end("start", place, frame=x)
    for x in (None, 1, "x", {}, object(), other):
        yield lambda s, x=x: s.restore(x)
    yield lambda s: s.set_end("end", place)
    yield lambda s: s.set_force("start", place)
    yield lambda s: s.release("end")


def test_wrong_uses_are_errors_in_words_and_change_nothing() -> None:
    with simulation() as plain:
        plain.advance(0.5)
        expected = plain.state.position
    with simulation(7) as other, simulation() as asked:
        wrong = list(uses(other.save()))
        assert len(wrong) > 100
        asked.step()
        for use in wrong:
            with pytest.raises(ValueError, match=r"\w+.*\w+"):
                use(asked)
            assert asked.t == 0.05
        asked.advance(0.5)
        assert np.array_equal(asked.state.position, expected)


def test_a_closed_simulation_says_so() -> None:
    with simulation() as closed:
        saved = closed.save()
    for use in (closed.step, closed.save, lambda: closed.restore(saved), lambda: closed.advance(1.0),
                lambda: closed.set_force("end", [0, 0, 1]), lambda: closed.release("start")):  # fmt: skip
        with pytest.raises(ValueError, match="the simulation is over"):
            use()
    closed.close()


def test_two_threads_in_one_simulation_are_told_apart() -> None:
    with simulation(400) as cable:
        before, refused = cable.t, []
        busy = threading.Thread(target=lambda: cable.advance(2.0))
        busy.start()
        while busy.is_alive():
            for use in (cable.save, lambda: cable.state, cable.forces, lambda: cable.advance(2.0)):
                try:
                    use()
                except ValueError as error:
                    refused.append(str(error))
        busy.join()
        assert before == 0.0 and cable.t == pytest.approx(2.0)
        assert any("another thread" in text for text in refused)
    with simulation(400) as alone:
        alone.advance(2.0)
        assert np.array_equal(alone.state.position, cable.state.position)
