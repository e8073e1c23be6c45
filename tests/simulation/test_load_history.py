"""Forces and moments at ends as histories: impulse, work, files, resumed runs, and what is refused."""

from __future__ import annotations

import json
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from bits import Stopping, differences
from test_system_saving import clamped, mooring, spar

import hybrid
from hybrid.errors import SceneError
from hybrid.scene.read import one_line, scene_text
from hybrid.simulation.run_sample import jolts
from tests.problems import tables_with
from tests.scenes import cable_scene, pinned_at

ROWS: list[list[float]] = [[0, 0, 0, 0], [0.5, 3, 0, -1], [0.7, -2, 0, 0], [1.4, 1, 0, 0]]


def scene(force: object, step: float = 0.01, **changes: object) -> hybrid.Scene:
    data = cable_scene(
        {"length": 2.0, "mass": 0.5, "axial_stiffness": 2e3, "bending_stiffness": 0.4}, {"kind": "free"},
        {"kind": "free", "force": force}, gravity=0.0,
        initial={"kind": "straight", "direction": [0, 0, 1], "origin": [0, 0, 0]}, model="rod", mesh=16,
        time=(2.0, step), output=(0.1, 17)
    )  # fmt: skip
    return hybrid.validate_scene(data | changes)


def table(path: Path, header: str = "y,t,x,z") -> str:
    """ROWS as a file, columns in another order."""
    rows = np.array(ROWS, float)
    np.savetxt(path, rows[:, [2, 0, 1, 3]], delimiter=",", header=header, comments="", fmt="%.17g")
    return str(path)


def impulse(t: float) -> np.ndarray:
    """The integral of ROWS from 0 to t, exact: Simpson's rule between rows."""
    rows = np.array(ROWS, float)
    times = np.unique(np.append(rows[rows[:, 0] < t, 0], t))
    values = np.stack([np.interp(times, rows[:, 0], column) for column in rows[:, 1:].T], axis=1)
    return np.asarray((0.5 * (values[1:] + values[:-1]) * np.diff(times)[:, None]).sum(axis=0))


def off_by(step: float, **time: float) -> np.ndarray:
    """By how much the momentum of a cable that nothing else acts on differs from the impulse (n, 3) N s."""
    mass = np.full(17, 0.5 * 2.0 / 16)
    mass[[0, -1]] *= 0.5
    with hybrid.run(scene({"history": ROWS}, step, **({"time": {"duration": 2.0, **time}} if time else {}))) as result:
        return np.array([mass @ v - impulse(t) for t, v in zip(result.t, result.velocity[()], strict=True)])


def test_momentum_is_the_impulse_to_second_order() -> None:
    """1.4 N/s^2 dt^2 where the slope has just turned, and nothing when the force has ended where it began to turn."""
    coarse, fine = off_by(0.01), off_by(0.005)
    assert np.abs(coarse).max() < 1.5 * 0.01**2
    np.testing.assert_allclose(fine[:15], coarse[:15] / 4, rtol=0, atol=1e-9)
    assert np.abs(coarse[15:]).max() < 1e-12


def test_steps_that_follow_the_motion_end_where_a_history_turns() -> None:
    """A blow of 2 ms between steps of 20 ms and more is not missed: its impulse is 0.01 N s."""
    rows = [[0.999, 0, 0, 0], [1.0, 10, 0, 0], [1.001, 0, 0, 0]]
    time = {"duration": 2.0, "tolerance": 1e-6}
    with hybrid.run(scene({"history": rows}, time=time)) as result:
        mass = np.full(17, 0.5 * 2.0 / 16)
        mass[[0, -1]] *= 0.5
        assert {0.999, 1.0, 1.001} <= set(result.steps["t"].tolist())
        assert mass @ result.velocity[-1] == pytest.approx([0.01, 0.0, 0.0], rel=0.05)


def test_the_work_of_a_history_is_booked() -> None:
    """Energy is the work of the force and what the scheme loses, which is of second order in the step."""
    lost = []
    for step in (0.01, 0.005):
        with hybrid.run(scene({"history": ROWS}, step)) as result:
            total = sum(result.energy.values())
            assert np.abs(total - total[0] - sum(result.work.values())).max() < 1e-12
            lost.append(float(np.abs(result.work["scheme"]).max() / total.max()))
    assert lost[0] < 0.005 and lost[1] < 0.3 * lost[0], lost


def test_a_constant_history_is_a_constant_force() -> None:
    rows = [[0.0, 1.0, 0.5, 2.0], [1.0, 1.0, 0.5, 2.0]]
    with hybrid.run(scene({"history": rows})) as one, hybrid.run(scene([1.0, 0.5, 2.0])) as other:
        np.testing.assert_allclose(one.position, other.position, rtol=0, atol=1e-10)


def test_a_file_is_the_list_in_any_order_of_columns(tmp_path: Path) -> None:
    with hybrid.run(scene({"file": table(tmp_path / "f.csv")})) as one, hybrid.run(scene({"history": ROWS})) as other:
        assert one.position[()].tolist() == other.position[()].tolist()


def test_a_file_is_relative_to_its_scene(tmp_path: Path) -> None:
    table(tmp_path / "f.csv")
    text = scene_text(scene({"value": [0.0, 0.0, 1.0]}))
    (tmp_path / "a.yaml").write_text(text.replace("value: [0.0, 0.0, 1.0]", "file: f.csv"))
    found = hybrid.load_scene(tmp_path / "a.yaml")
    assert found.ends.end.loads[0].at_time(0.6) == pytest.approx((0.5, 0.0, -0.5))
    assert found.named_files() == [str(tmp_path / "f.csv")]  # which must not change before a run is resumed


def test_an_equilibrium_takes_the_load_at_the_start() -> None:
    ends = {"start": pinned_at(0, 0, 0), "end": {"kind": "free", "force": {"history": [[0, 0, 0, -7], [1, 9, 0, -7]]}}}
    with hybrid.static(scene([0, 0, 0], ends=ends, initial="equilibrium")) as result:
        np.testing.assert_allclose(result.reaction_start[-1], [0, 0, 7], atol=1e-6)


REFUSED = {
    "nothing": ({"ramp": 1.0}, "value, history or file"),
    "two": ({"value": [0, 0, 1], "history": ROWS}, "because value already gives the load"),
    "order": ({"history": [ROWS[1], ROWS[0]]}, "a time after that of the row before, 0.5 s"),
    "one row": ({"history": ROWS[:1]}, "2"),
    "three numbers": ({"history": [[0, 1, 2], [1, 1, 2]]}, r"four numbers \[t, x, y, z\]"),
    "no file": ({"file": "nowhere.csv"}, "which does not exist"),
    "missed": ({"history": [[0, 0, 0, 0], [0.104, 0, 0, 0], [0.105, 9, 0, 0], [0.106, 0, 0, 0]]}, r"turns at t = 0\.105 s"),
}  # fmt: skip


@pytest.mark.parametrize("name", REFUSED)
def test_what_cannot_be_is_refused(name: str) -> None:
    force, text = REFUSED[name]
    with pytest.raises(hybrid.SceneError, match=text):
        hybrid.run(scene(force))


@pytest.mark.parametrize(
    ("rows", "text"),
    [("t,x,y\n0,1,2\n1,1,2\n", "columns t,x,y,z"), ("t,x,y,z\n0,1,2,3\n", "at least 2 rows"),
     ("t,x,y,z\n0,1,2,3\n0,1,2,4\n", "line 3: t = 0 after t = 0"), ("t,x,y,z\n0,1,2,3\n1,1,nan,4\n", "line 3: y is no")],
)  # fmt: skip
def test_a_bad_file_is_refused_with_its_line(tmp_path: Path, rows: str, text: str) -> None:
    (tmp_path / "f.csv").write_text(rows)
    with pytest.raises(hybrid.SceneError, match=text):
        hybrid.run(scene({"file": str(tmp_path / "f.csv")}))


def test_a_force_out_of_the_plane_is_refused_in_two_dimensions() -> None:
    rows = [[0, 1, 0, 0], [1, 0, 1, 0]]
    with pytest.raises(hybrid.SceneError, match=r"ends\.end\.force\.history"):
        hybrid.run(scene({"history": rows}, dimension=2))


def pulled(time: dict[str, float], **changes: object) -> hybrid.Scene:
    """A bar of 2 m, EA 2 kN, held at its start; its pull grows by 10 N/s for 0.3 s: L/c = 0.0316 s."""
    history = [[0, 0, 0, 10], [0.1, 0, 0, 10], [0.4, 0, 0, 13], [1, 0, 0, 13]]
    ends = {"start": {"kind": "pinned", "position": [0, 0, 0]}, "end": {"kind": "free", "force": {"history": history}}}
    more = {"ends": ends, "initial": "equilibrium", "time": time, "output": {"every": 0.002, "points": 5}}
    return hybrid.validate_scene(scene([0, 0, 1]).model_dump(exclude_none=True) | more | changes)


def test_a_slope_that_jumps_shakes_the_line_by_as_much_as_is_said() -> None:
    made = pulled({"duration": 0.35, "step": 2e-4})
    travel = 2.0 * np.sqrt(0.5 / 2e3)
    assert [x for x, _, _ in jolts(one_line(made))] == [0.1, 0.4, 1.0]
    _, size, period = jolts(one_line(made))[0]
    assert (size, period) == pytest.approx((10.0 * travel, 4.0 * travel))
    with hybrid.run(made) as result:
        slow = 10.0 + 10.0 * np.clip(result.t - 0.1, 0.0, 0.3)
        shake = np.abs(np.linalg.norm(result["reaction_start"][()], axis=1) - slow)[result.t > 0.1]
        assert shake.max() == pytest.approx(size, rel=0.1)
        assert "error uncertain" not in {x.kind for x in result.events}


def test_a_shake_that_steps_damp_makes_the_figure_uncertain() -> None:
    """The figure of 0.1 % does not see 0.3 N of 13: runs of all steps damp it."""
    asked = pulled({"duration": 1.2}, accuracy={"tension": "1%"}, mesh=None, output={"every": 0.05, "points": 5})
    with hybrid.run(asked) as result:
        texts = [x.text for x in result.events if x.kind == "error uncertain"]
        steps = np.diff(result.steps["t"])
    assert steps.max() > 0.01
    assert any("slope of a force" in x and "0.32 N" in x for x in texts), texts


# --- Other loads and motions in mid-run of several lines, as `hybrid resume --set` asks for ---

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
    stopping.stop(heard // 4, hybrid.resume, begun, until=2.0, settings=CURRENT, start=1.0)
    hybrid.resume(begun, progress=stopping).close()
    with hybrid.open(long) as without, hybrid.open(anew) as one, hybrid.open(begun) as other:
        assert [x.kind for x in one.events].count("loads change") == 1
        for name in one.lines or [""]:  # a cable has none
            a, b, c = (x.lines[name].position if name else x.position for x in (one, other, without))
            assert a.shape == b.shape and np.array_equal(a, b), np.abs(a - b).max()
            assert np.array_equal(a[:3], c[:3]) and np.abs(a[3:] - c[3:]).max() > 1e-5
    stopping.stop(heard // 2, hybrid.resume, long, tmp_path / "again.h5", settings=CURRENT, start=1.0)
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
