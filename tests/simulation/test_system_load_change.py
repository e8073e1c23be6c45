"""Other loads and motions in mid-run of several lines, as `hybrid resume --set` asks for."""

from __future__ import annotations

import json
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from bits import Stopping, differences
from test_system_resume import clamped, mooring, spar

import hybrid
from hybrid.errors import SceneError
from tests.problems import tables_with

EXAMPLES = Path(__file__).parents[2] / "examples"
CURRENT = ["environment.fluid.current=[0.9, -0.3, 0]"]


def adrift() -> dict[str, Any]:
    """The mooring, whose hose has zones that move, and whose east leg breaks before the change."""
    return dict(
        tables_with(mooring(), {"lines.hose.model": "adaptive", "lines.east.break_at": {"time": 0.4, "end": "end"}})
    )


@pytest.mark.long
@pytest.mark.parametrize("model", ["rod", "adaptive"])
def test_a_load_that_ends_is_a_load_that_is_changed(model: str, tmp_path: Path) -> None:
    """A force on a float until 1 s, and the same force taken off by resuming at 1 s: one motion."""
    whole = tables_with(mooring(), {"lines.hose.model": model, "time.duration": 2.0, "output": {"every": 0.25}})
    force = whole["points"]["float"]["force"]
    pulled = tables_with(whole, {"points.float.force": force["value"], "time.duration": 1.0})
    until = hybrid.run(tables_with(whole, {"points.float.force": force | {"until": 1.0}}))
    path = tmp_path / "pulled.h5"
    hybrid.run(pulled, path).close()
    with hybrid.resume(path, until=2.0, settings=["points.float.force=null"]) as other:
        assert (other.times == until.times).all()
        at, there = (x["points/float/position"] for x in (until, other))
        assert np.abs(at - there).max() < 1e-11
        for name, line in until.lines.items():
            assert np.abs(line.position - other.lines[name].position).max() < 1e-11
        assert json.loads(other.changes_text)[0]["t"] == 1.0
        assert "loads change" in {x.kind for x in other.events}
        assert np.ptp(at[:, 0]) > 1e-3


@pytest.mark.parametrize("start", [1.0, 2.0])
def test_a_force_on_a_body_that_has_ended_stays_ended(start: float, tmp_path: Path) -> None:
    """A body that swings after it was pulled for 1 s: another force until then, given at 1 s or later, never acts."""
    section = {"length": 10, "mass": 2, "diameter": 0.05, "axial_stiffness": 1e6, "damping": {"mass": 0.2}}
    scene = {
        "points": {"top": {"position": [0, 0, 0]}, "eye": {"body": "lump", "place": [0, 0, 0]}},
        "bodies": {"lump": {"initial_guess": [0, 0, -10], "mass": 500, "inertia": [10, 10, 10],
                            "force": {"value": [800, 0, 0], "until": 1.0}}},
        "lines": {"rope": {"start": "top", "end": "eye", "sections": [section], "model": "catenary", "mesh": {"cells": 8}}},
        "time": {"duration": 3.0, "step": 0.02}, "output": {"every": 0.5},
    }  # fmt: skip
    hybrid.run(scene, tmp_path / "whole.h5").close()
    settings = ["bodies.lump.force.value=[0, 3000, 0]"]
    with (
        hybrid.open(tmp_path / "whole.h5") as whole,
        hybrid.resume(tmp_path / "whole.h5", tmp_path / "other.h5", settings=settings, start=start) as other,
    ):
        at, there = (x["bodies/lump/position"] for x in (whole, other))
        assert np.abs(at - there).max() < 1e-4  # steps begin anew at 2 s
        assert np.ptp(at[2:, 0]) > 0.05


def example(name: str) -> dict[str, Any]:
    return yaml.safe_load((EXAMPLES / f"{name}.yaml").read_text()) | {"dimension": 3}


SCENES = {"spar": spar, "clamped": clamped, "adrift": adrift} | {
    name: partial(example, name) for name in ("slack_on_seabed", "touchdown", "laying")
}


@pytest.mark.long
@pytest.mark.parametrize("name", SCENES)
def test_changes_are_made_at_their_time_however_often_it_is_stopped(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Another current from 1 s on: computed anew, from a checkpoint at 1 s, and stopped on the way; one motion."""
    scene = tables_with(SCENES[name](), {"time.duration": 2.0, "output.every": 0.5})
    long, anew, begun = (tmp_path / f"{x}.h5" for x in ("long", "anew", "begun"))
    hybrid.run(scene, long).close()
    stopping = Stopping(monkeypatch)
    hybrid.resume(long, anew, settings=CURRENT, start=1.0, progress=stopping).close()
    heard = stopping.heard
    hybrid.run(tables_with(scene, {"time.duration": 1.0}), begun).close()
    stopping.left = heard // 4
    with pytest.raises(KeyboardInterrupt):
        hybrid.resume(begun, until=2.0, settings=CURRENT, start=1.0, progress=stopping)
    hybrid.resume(begun, progress=stopping).close()
    with hybrid.open(long) as without, hybrid.open(anew) as one, hybrid.open(begun) as other:
        assert [x.kind for x in one.events].count("loads change") == 1
        for name in one.lines or [""]:  # a cable has none
            a, b, c = (x.lines[name].position if name else x.position for x in (one, other, without))
            assert a.shape == b.shape and np.array_equal(a, b), np.abs(a - b).max()
            assert np.array_equal(a[:3], c[:3]) and np.abs(a[3:] - c[3:]).max() > 1e-5
    stopping.left = heard // 2
    with pytest.raises(KeyboardInterrupt):
        hybrid.resume(long, tmp_path / "again.h5", settings=CURRENT, start=1.0, progress=stopping)
    hybrid.resume(tmp_path / "again.h5", progress=stopping).close()
    assert differences(anew, tmp_path / "again.h5") == []


@pytest.mark.long
def test_errors_are_of_the_motion_with_its_changes(tmp_path: Path) -> None:
    scene = tables_with(
        mooring(), {"time.duration": 1.0, "output": {"every": 0.25, "errors": True}, "lines.hose.model": "catenary"}
    )
    hybrid.run(scene, tmp_path / "a.h5").close()
    with hybrid.resume(tmp_path / "a.h5", tmp_path / "b.h5", settings=CURRENT, start=0.5) as result:
        for name, line in result.lines.items():
            assert np.isfinite(line["errors/total/position"]).all(), name
            assert line["errors/total/position"].max() < 0.02 * np.ptp(line.position)


@pytest.mark.parametrize(
    ("setting", "told"),
    [
        ("lines.west.sections[0].mass=4", "points.NAME.motion"),
        ("points.west.position=[-111, 0, -100]", "a run in progress keeps the rest"),
        ("points.vessel.motion.heave.amplitude=2.5", "points.vessel.motion(.|\n)*jumps by"),
    ],
)
def test_what_cannot_change_is_refused(setting: str, told: str, tmp_path: Path) -> None:
    path = tmp_path / "a.h5"
    hybrid.run(tables_with(mooring(), {"time.duration": 1.0, "output": {"every": 0.5}}), path).close()
    with pytest.raises(SceneError, match=told):
        hybrid.resume(path, tmp_path / "b.h5", settings=[setting], start=0.5)
