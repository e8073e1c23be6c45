"""Steps of several lines in compiled code: lines that meet nothing, and what is heard between calls."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from test_system_resume import spar

import hybrid
from hybrid.kernels.state import books
from hybrid.model.plan import SAME_STOP, falls_on
from hybrid.simulation import progress
from hybrid.simulation import run as run_module
from tests.scenes import line_between, network_scene

ROPE = {"mass": 20.0, "diameter": 0.06, "axial_stiffness": 2e7, "drag": {"normal": 1.2}}
HEAVE = {"heave": {"amplitude": 1.0, "period": 4.0}, "ramp": 4}
MEETING = {
    "points": {
        "west": {"position": [-60, 0, -50]},
        "east": {"position": [60, 5, -50], "motion": HEAVE},
        "float": {"initial_guess": [0, 0, -10], "mass": 300, "volume": 1.2},
    },
    "lines": {
        "first": {"start": "west", "end": "float", "sections": [ROPE | {"length": 75}], "mesh": {"cells": 12}},
        "last": {"start": "float", "end": "east", "sections": [ROPE | {"length": 75}], "mesh": {"cells": 12}},
    },
}
# With a motion of its own that is gentler, and an anchor that moves too.
ALONE = {
    "points": {
        "anchor": {"position": [0, 100, -50], "motion": {"sway": {"amplitude": 0.4, "period": 3.0}, "ramp": 3}},
        "ship": {"position": [40, 100, 0], "motion": HEAVE},
    },
    "lines": {"middle": {"start": "anchor", "end": "ship", "sections": [ROPE | {"length": 70}], "mesh": {"cells": 15}}},
}


def scene(*parts: dict[str, Any], **tables: Any) -> dict[str, Any]:
    """Systems side by side in water; lines stand in the order of their names' places in `MEETING` and `ALONE`."""
    points = {name: point for part in parts for name, point in part["points"].items()}
    lines = {name: line for part in parts for name, line in part["lines"].items()}
    order = [name for name in ("first", "middle", "last") if name in lines]
    water = {"fluid": {"density": 1025, "current": [0.3, 0.1, 0]}}
    time = {"time": {"duration": 2.0, "step": 0.05}, "output": {"every": 0.1, "points": 7}}
    return {"environment": water, "points": points, "lines": {name: lines[name] for name in order}, **time} | tables


def test_lines_that_meet_nothing_are_as_in_a_system_of_their_own() -> None:
    """Between two lines that are joined, in the order of the scene, with books, extremes and the log of steps."""
    both, meeting, alone = (hybrid.run(x) for x in (scene(MEETING, ALONE), scene(MEETING), scene(ALONE)))
    for name, line in both.lines.items():
        other = (alone if name == "middle" else meeting).lines[name]
        for key in (
            "position",
            "velocity",
            "tension",
            "energy/kinetic",
            "work/drag",
            "work/end",
            "steps/end_force_end",
        ):
            scale = np.abs(other[key]).max()
            assert scale > 0.0 and np.abs(line[key] - other[key]).max() <= 1e-9 * scale, (name, key)
        for key, values in other.envelope.items():
            scale = np.nanmax(np.abs(values))
            assert np.allclose(line.envelope[key], values, rtol=1e-9, atol=1e-9 * scale, equal_nan=True), (name, key)
        assert [x.kind for x in line.events] == [x.kind for x in other.events]


def test_a_line_that_meets_nothing_and_fails_is_named(tmp_path: Path) -> None:
    """A slack catenary between lines that go on: the line, the time and the place are those of it alone."""
    slack = scene(ALONE)["lines"]["middle"] | {"model": "catenary", "sections": [ROPE | {"length": 52}]}
    t = np.linspace(0.0, 3.0, 601)
    rows = np.column_stack([t, 10.0 + 0.0 * t, 100.0 + 0.0 * t, 12.0 * np.sin(2.0 * np.pi * t / 1.5) ** 3])
    np.savetxt(tmp_path / "plunge.csv", rows, delimiter=",", header="t,x,y,z", comments="")
    plunge = {"file": str(tmp_path / "plunge.csv")}
    points = ALONE["points"] | {"ship": {"position": [10, 100, 0], "motion": plunge}}
    part = {"points": points, "lines": {"middle": slack}}
    found = []
    for given in (scene(part), scene(MEETING, part)):
        with pytest.raises(hybrid.ComputationError) as failed:
            hybrid.run(given)
        assert "middle" in str(failed.value)
        found.append((failed.value.outcome, failed.value.t, failed.value.s))
    assert found[0] == pytest.approx(found[1], rel=1e-6)


def test_progress_is_told_whenever_outputs_are_written_down(monkeypatch: pytest.MonkeyPatch) -> None:
    """However few steps there are between two outputs, which may cost more than steps: Ctrl-C is heard there too."""
    monkeypatch.setattr(progress, "REPORT_EVERY", 0.0)
    monkeypatch.setattr(run_module, "WAITING", 4)
    told: list[float] = []
    every = scene(MEETING, output={"every": 0.05, "points": 7})
    hybrid.run(every, progress=lambda x: told.append(x.t)).close()
    assert np.diff([0.0, *np.unique(told)]).max() < 5.5 * 0.05 and max(told) == pytest.approx(2.0)


def test_progress_is_told_between_outputs_where_python_looks_at_every_step(monkeypatch: pytest.MonkeyPatch) -> None:
    """As where something may break: every so many steps, though each of them returns."""
    monkeypatch.setattr(progress, "REPORT_EVERY", 0.0)
    told: list[int] = []
    part = MEETING | {"lines": {name: x | {"break_at": {"tension": 1e9}} for name, x in MEETING["lines"].items()}}
    hybrid.run(scene(part, output={"every": 2.0, "points": 7}), progress=lambda x: told.append(x.step)).close()
    inside = [x for x in np.unique(told) if 0 < x < 40]
    assert inside and np.diff([0, *inside, 40]).max() <= run_module.LOOK


# A ship that moves and turns, with a line that is clamped to it and one that turns freely, and a buoy that is loaded by
# a force that grows until it stops, and by a moment that follows a table.
TOWED = network_scene(
    {"foot": {"position": [-60, 0, -50]}, "bow": {"body": "ship", "place": [3, 1, -2]},
     "stern": {"body": "ship", "place": [-20, 0.5, -3]}, "top": {"body": "buoy", "place": [0, 0, 1]},
     "anchor": {"position": [-20, 10, -60]}},
    {"first": line_between("foot", "top", ROPE | {"length": 75}, mesh=8),
     "last": line_between("top", "bow", ROPE | {"length": 72}, mesh=8),
     "hose": line_between("anchor", "stern", ROPE | {"length": 85, "bending_stiffness": 2e4},
                          connections={"end": {"tangent": [0.6, 0, 0.8]}}, mesh=10)},
    fluid={"density": 1025, "current": [0.3, 0.1, 0]},
    bodies={"ship": {"position": [60, 5, 0], "rotation": [5, 0, 30],
                     "motion": {"heave": {"amplitude": 1.0, "period": 4.0}, "surge": {"amplitude": 0.4, "period": 5.0},
                                "pitch": {"amplitude": 3.0, "period": 4.5}, "yaw": {"amplitude": 5.0, "period": 6.0},
                                "ramp": 2}},
            "buoy": {"initial_guess": [0, 0, -10], "mass": 300, "volume": 1.2, "inertia": [200, 200, 200],
                     "force": {"value": [300, 200, 0], "ramp": 1.0, "until": 1.5},
                     "moment": {"history": [[0, 0, 0, 0], [0.7, 80, 20, 0], [3, -50, 0, 30]]}}},
    time=(2.0, 0.05), output=(0.1, 7)
)  # fmt: skip


def in_waves() -> dict[str, Any]:
    """A body with a member through the surface, which current and waves move."""
    scene = spar()
    waves = {"kind": "regular", "height": 3, "period": 8, "ramp": 2}
    scene["environment"]["fluid"] = scene["environment"]["fluid"] | {"waves": waves}
    return scene | {"time": {"duration": 4.0, "step": 0.1}}


@pytest.mark.long
@pytest.mark.parametrize("scene, body", [(TOWED, "buoy"), (in_waves(), "spar")])
def test_bodies_are_moved_and_loaded_in_compiled_steps(
    scene: dict[str, Any], body: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As where Python moves and loads them, and stirs the water around their members, before every try."""
    prepared: list[float] = []
    prepare, attach = run_module.Run._prepare, run_module.Run._attach

    def note(run: Any, t: float) -> None:
        prepared.append(t)
        prepare(run, t)

    def ask(run: Any) -> None:
        attach(run)
        run.loop.counts.asks |= books.ASK_BEFORE

    monkeypatch.setattr(run_module.Run, "_prepare", note)
    compiled = hybrid.run(scene)
    assert not prepared
    monkeypatch.setattr(run_module.Run, "_attach", ask)
    asked = hybrid.run(scene)
    assert len(prepared) >= 40
    for key in ("position", "rotation"):
        here, there = (x[f"bodies/{body}/{key}"] for x in (compiled, asked))
        assert np.ptp(there, axis=0).max() > 0.01 and np.abs(here - there).max() <= 1e-9 * np.abs(there).max(), key
    for name, line in compiled.lines.items():
        for key in ("position", "velocity", "tension", "work/end"):
            other = asked.lines[name][key]
            assert np.abs(line[key] - other).max() <= 1e-9 * np.abs(other).max() > 0.0, (name, key)


# --- stops, and what is due at them ---

STEP = 0.05


class Counted(list[float]):
    """Times that count how often one is read."""

    reads = 0

    def __getitem__(self, k):
        self.reads += 1
        return super().__getitem__(k)

    def __iter__(self):
        for k in range(len(self)):
            yield self[k]


def test_a_stop_is_a_time_but_for_round_off() -> None:
    times, near = [0.1, 0.2, 0.3], SAME_STOP * STEP
    assert all(falls_on(x + d, times, STEP) for x in times for d in (0.0, 0.9 * near, -0.9 * near))
    assert not any(falls_on(x + d, times, STEP) for x in times for d in (1.1 * near, -1.1 * near, 0.05))
    assert not falls_on(0.1, [], STEP)


def test_many_times_are_not_all_read_at_every_stop() -> None:
    """A run of hours has 100 000 outputs: what it does at each must not grow with their number."""
    times = Counted([0.1 * k for k in range(100_000)])
    assert falls_on(7654.3, times, STEP) and times.reads < 30
