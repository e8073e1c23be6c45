"""How often a run hands over what it has: by what making and writing it take."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import hybrid
from hybrid.simulation import run as run_module
from hybrid.simulation.line_result import LineResult
from hybrid.store import writer
from hybrid.store.format import Header, MemoryTarget
from tests.scenes import line_between, network_scene

GIVEN = Header(np.zeros(1), (), (), {})


@pytest.fixture(params=["memory", "file"])
def recorder(request: pytest.FixtureRequest, tmp_path: Path, now: list[float]) -> Iterator[Any]:
    target = MemoryTarget() if request.param == "memory" else tmp_path / "x.h5"
    with writer.Recorder(target, GIVEN) as recorder:
        yield recorder


@pytest.fixture
def now(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """A clock that stands still, s."""
    time = [100.0]
    monkeypatch.setattr(writer, "monotonic", lambda: time[0])
    return time


def test_what_is_dear_to_make_waits_ten_times_as_long(recorder: Any, now: list[float]) -> None:
    for made, pause in ((0.0, 0.2), (0.01, 0.2), (1.0, 10.0)):
        recorder.flush(made)
        now[0] += 0.99 * pause
        assert not recorder.due
        now[0] += 0.02 * pause
        assert recorder.due


def test_outputs_of_lines_are_made_together(monkeypatch: pytest.MonkeyPatch) -> None:
    """Whether the clock says so or not: the results are the same.

    The clock is asked between compiled steps: here after five outputs, or all of the run would wait in their buffer.
    """
    monkeypatch.setattr(run_module, "ROWS", 5)
    rope = {"length": 101.0, "mass": 5.0, "diameter": 0.03, "axial_stiffness": 1e6}
    points = {"a": {"position": [0, 0, 0]}, "b": {"position": [100, 0, 0]}}
    points["b"]["motion"] = {"heave": {"amplitude": 0.5, "period": 5.0}, "ramp": 10.0}
    scene = network_scene(points, {"l": line_between("a", "b", rope, mesh=10)}, time=(1.0, 0.05), output=(0.05, 5))
    calls: list[int] = []
    write_down = LineResult.write_down

    def counted(line: LineResult) -> None:
        calls.append(sum(len(batch.t) for batch in line._waiting))
        write_down(line)

    monkeypatch.setattr(LineResult, "write_down", counted)
    found = []
    for pause in (0.0, 100.0):
        monkeypatch.setattr(writer, "pause", lambda _, pause=pause: pause)
        calls.clear()
        with hybrid.run(scene) as result:
            found.append(
                {name: np.array(result.lines["l"][name]) for name in ("position", "tension", "energy/kinetic")}
            )
        assert (max(calls) > 15) == (pause > 0.0)
    for name, x in found[0].items():
        np.testing.assert_array_equal(x, found[1][name])
