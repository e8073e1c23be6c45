"""A scene as a co-simulation unit: what it holds, that it steps as `hybrid.Simulation`, and what is refused."""

from __future__ import annotations

import runpy
import zipfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from math import inf, nan
from pathlib import Path
from typing import Any

import extras
import numpy as np
import pytest

pytestmark = extras.of_file("fmpy", "pythonfmu3")

import fmpy
from fmpy.fmi3 import FMU3Slave
from typer.testing import CliRunner

import hybrid
from hybrid.cli.commands import app
from hybrid.scene.root import in_full

EXAMPLES = Path(__file__).parents[2] / "examples"
SCENE = """
cable: {sections: [{length: 12.0, mass: 2.0, axial_stiffness: 1e5, diameter: 0.02}]}
ends: {start: {kind: pinned, position: [0, 0, 0]}, end: {kind: pinned, position: [10, 0, 0]}}
initial: equilibrium
model: catenary
mesh: {cells: 10}
time: {duration: 2, step: 0.05}
"""
# A scene in the short form and with names for its points and its line.
FORMS = pytest.mark.parametrize("form", [lambda scene: scene, in_full], ids=["cable", "network"])
ROD = SCENE.replace("diameter: 0.02", "diameter: 0.02, bending_stiffness: 20, torsional_stiffness: 15").replace(
    "model: catenary", "model: rod").replace("start: {kind: pinned", "start: {kind: clamped, tangent: [1, 0, -1]")  # fmt: skip


@contextmanager
def running(
    unit: Path, folder: Path, said: list[str] | None = None, **parameters: str | bool
) -> Iterator[tuple[FMU3Slave, dict[str, int]]]:
    """An FMU that has been started, and the numbers of its variables; said: where its messages go."""
    fmpy.extract(unit, folder)
    description = fmpy.read_model_description(folder)
    number = {x.name: x.valueReference for x in description.modelVariables}
    name = description.coSimulation.modelIdentifier
    cable = FMU3Slave(guid=description.guid, unzipDirectory=str(folder), modelIdentifier=name, instanceName="line")
    log = None if said is None else lambda _, status, category, message: said.append(message.decode())
    cable.instantiate(loggingOn=said is not None, logMessage=log)
    for key, value in parameters.items():
        (cable.setBoolean if isinstance(value, bool) else cable.setString)([number[key]], [value])
    cable.enterInitializationMode()
    cable.exitInitializationMode()
    try:
        yield cable, number
    finally:
        cable.terminate()
        cable.freeInstance()


def step(cable: FMU3Slave, k: int, dt: float = 0.05) -> None:
    cable.doStep(currentCommunicationPoint=k * dt, communicationStepSize=dt)


@pytest.fixture
def unit(tmp_path: Path) -> Path:
    return hybrid.export_fmu(hybrid.parse_scene(SCENE), tmp_path / "line.fmu")


def test_a_master_in_ten_lines_gets_the_forces_of_a_simulation() -> None:
    assert runpy.run_path(str(EXAMPLES / "10_fmu_master.py"))["main"]() < 1e-7 * 3e4


LINES = """
environment: {fluid: {density: 1025}}
points:
  foot: {position: [-40, 0, -30]}
  ship: {position: [40, 0, 0]}
  tug: {position: [0, 30, 0], motion: {heave: {amplitude: 0.2, period: 4}, ramp: 2}}
  buoy: {initial_guess: [0, 0, -2], mass: 300, volume: 0.5, drag_area: 1}
lines:
  leg: {start: foot, end: buoy, sections: [&rope {length: 50, mass: 5, diameter: 0.05, axial_stiffness: 1e6}], mesh: {cells: 8}}
  hose: {start: ship, end: buoy, sections: [{<<: *rope, length: 42}], mesh: {cells: 8}}
  tow: {start: tug, end: buoy, sections: [{<<: *rope, length: 35}], mesh: {cells: 8}}
time: {duration: 2, step: 0.05}
"""


def test_several_lines_are_a_unit_whose_points_are_set(tmp_path: Path) -> None:
    """Forces, places and tensions are those of `hybrid.Simulation`; steps are taken again from a saved state."""
    (tmp_path / "lines.yaml").write_text(LINES)
    unit = hybrid.export_fmu(tmp_path / "lines.yaml", tmp_path / "lines.fmu")
    same = hybrid.Simulation(tmp_path / "lines.yaml")
    assert isinstance(same, hybrid.Simulation)
    with running(unit, tmp_path / "open") as (lines, number):
        inputs = {x.rsplit(".", 1)[0] for x in number if x.endswith(".position.x") and ".node_" not in x}
        assert inputs == {"foot.position", "ship.position"}

        def go(k: int, height: float) -> list[float]:
            lines.setFloat64([number["ship.position.z"], number["ship.velocity.z"]], [height, 0.04 * k])
            step(lines, k)
            names = [
                *(f"ship.force.{x}" for x in "xyz"),
                *(f"buoy.node_position.{x}" for x in "xyz"),
                "tow.tension_max",
            ]
            return list(lines.getFloat64([number[x] for x in names]))

        for k in range(6):
            there = go(k, 0.001 * k**2)
            same.set_point("ship", [40, 0, 0.001 * k**2], [0, 0, 0.04 * k])
            same.set_point("foot", [-40, 0, -30])
            same.advance(0.05 * (k + 1))
        ship, buoy = same.point("ship"), same.point("buoy")
        assert there == pytest.approx([*ship.force, *buoy.position, same.tension("tow").max()], rel=1e-12)
        saved = lines.getFMUState()
        one, _ = go(6, 0.03), lines.setFMUState(saved)
        two, _ = go(6, 0.02), lines.setFMUState(saved)
        assert go(6, 0.03) == one != two
        lines.freeFMUState(saved)
    tow = same.tension("tow").max()
    result = same.result()
    assert result.times[-1] == pytest.approx(0.3) and tow == pytest.approx(
        result.lines["tow"].tension[-1].max(), rel=1e-12
    )


@FORMS
def test_a_frame_turns_by_a_rotation_vector(tmp_path: Path, form: Callable[[hybrid.Scene], hybrid.Scene]) -> None:
    scene = form(hybrid.parse_scene(ROD))
    unit = hybrid.export_fmu(scene, tmp_path / "rod.fmu")
    turns = np.linspace(0.0, 0.5, 11)[1:]
    with running(unit, tmp_path / "open") as (cable, number):
        for k, turn in enumerate(turns):
            cable.setFloat64([number["start.rotation.y"]], [turn])
            step(cable, k)
        moment = cable.getFloat64([number[f"start.moment.{x}"] for x in "xyz"])
    with hybrid.Simulation(scene) as same:
        frame = same.point("start").frame
        for turn in turns:
            c, s = np.cos(turn), np.sin(turn)
            same.set_point("start", [0, 0, 0], frame=np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]]) @ frame)
            same.set_point("end", [10, 0, 0])
            same.step()
        assert np.array_equal(same.point("start").moment, same.forces().moment_start)
        for end, frame in zip(("start", "end"), same.frames(), strict=True):
            assert np.array_equal(frame, same.point(end).frame, equal_nan=True)
        assert moment == pytest.approx(same.forces().moment_start, abs=1e-7 * np.abs(same.forces().moment_start).max())


def test_what_may_be_set_of_each_end() -> None:
    with hybrid.Simulation(hybrid.parse_scene(ROD)) as cable:
        assert cable.settable("start") == {"position", "frame"}
        assert cable.settable("end") == {"position"}
        assert np.isnan(cable.frames()[1]).all()
    free = SCENE.replace("end: {kind: pinned, position: [10, 0, 0]}", "end: free")
    with hybrid.Simulation(hybrid.parse_scene(free)) as cable:
        assert cable.settable("end") == {"force"}
    heave = SCENE.replace("[10, 0, 0]}", "[10, 0, 0], motion: {heave: {amplitude: 0.1, period: 3}, ramp: 1}}")
    with hybrid.Simulation(hybrid.parse_scene(heave)) as cable:
        assert not cable.settable("end")


def test_places_at_the_begin_of_a_step_go_on_with_their_velocity(unit: Path, tmp_path: Path) -> None:
    with running(unit, tmp_path / "open") as (cable, number):
        cable.setFloat64([number["end.position.z"], number["end.velocity.z"]], [0.0, 0.4])
        step(cable, 0)
        assert cable.getFloat64([number["end.node_position.z"]]) == [0.0]
    with running(unit, tmp_path / "again", inputs_at_begin=True) as (cable, number):
        cable.setFloat64([number["end.velocity.z"]], [0.4])
        step(cable, 0)
        assert cable.getFloat64([number["end.node_position.z"]]) == pytest.approx([0.02])


def test_the_result_is_written_where_a_parameter_says(unit: Path, tmp_path: Path) -> None:
    file = tmp_path / "run.h5"
    with running(unit, tmp_path / "open", output_file=str(file)) as (cable, _):
        for k in range(40):
            step(cable, k)
    with hybrid.open(file) as result:
        assert result.status == "complete"
        assert result.times[-1] == pytest.approx(2.0)


def test_files_that_a_scene_names_come_along(tmp_path: Path) -> None:
    motion = tmp_path / "heave.csv"
    motion.write_text(
        "t,x,y,z\n" + "\n".join(f"{t:.2f},10,0,{0.1 * t**3 * (t - 3) ** 2:.9f}" for t in np.arange(0, 3.01, 0.1))
    )
    moved = SCENE.replace("[10, 0, 0]}", f"[10, 0, 0], motion: {{file: {motion}}}}}")
    unit = hybrid.export_fmu(hybrid.parse_scene(moved), tmp_path / "line.fmu")
    motion.unlink()
    with running(unit, tmp_path / "open") as (cable, number):
        assert "end.position.x" not in number
        step(cable, 0)
        assert cable.getFloat64([number["end.node_position.z"]])[0] != 0.0


@pytest.mark.parametrize(
    ("at", "size", "why"),
    [(0.5, 0.05, "the cable is at"), (0.0, -0.05, "expected a time after"), (0.0, 5.0, "up to time.duration")],
)
def test_a_wrong_step_is_an_error_in_words_and_the_next_one_works(
    unit: Path, tmp_path: Path, at: float, size: float, why: str
) -> None:
    said: list[str] = []
    with running(unit, tmp_path / "open", said) as (cable, _):
        with pytest.raises(Exception, match="fmi3DoStep"):
            cable.doStep(currentCommunicationPoint=at, communicationStepSize=size)
        assert any(why in text for text in said), said
        step(cable, 0)


def test_a_hundred_wrong_uses(unit: Path, tmp_path: Path) -> None:
    """Times, sizes, inputs that are no numbers, after each of them a step as if nothing had been asked; then closed."""
    said: list[str] = []
    with running(unit, tmp_path / "open", said) as (cable, number):

        def wrong(t: float, step: float, inputs: dict[str, float] | None = None) -> None:
            before = len(said)
            for key, value in (inputs or {}).items():
                cable.setFloat64([number[key]], [value])
            with pytest.raises(Exception, match="fmi3DoStep"):
                cable.doStep(currentCommunicationPoint=t, communicationStepSize=step)
            assert any(len(text) > 20 for text in said[before:]), (t, step, inputs)
            for key in inputs or {}:
                cable.setFloat64([number[key]], [10.0 if key == "end.position.x" else 0.0])

        bad = (nan, inf, -inf)
        count = 0
        for k in range(4):
            t = 0.05 * k
            uses: list[tuple[Any, ...]] = [(at, 0.05) for at in (*bad, -1.0, t + 0.1, t - 0.05, 1e300, 2.0)]
            uses += [(t, size) for size in (*bad, -0.05, 0.0, 5.0, 1e300, -1e300)]
            keys = [f"{end}.{what}.{x}" for end in ("start", "end") for what in ("position", "velocity") for x in "xyz"]
            uses += [(t, 0.05, {key: bad[(j + k) % 3]}) for j, key in enumerate(keys)]
            for use in uses:
                wrong(*use)
            count += len(uses)
            cable.doStep(currentCommunicationPoint=t, communicationStepSize=0.05)
        force = cable.getFloat64([number["end.force.x"], number["end.force.z"]])
        saved = cable.getFMUState()
        wrong(0.2, 0.05, {"end.position.x": 30.0})  # the step fails, and goes on from the saved state
        wrong(0.2, 0.05)
        cable.setFMUState(saved)
        assert cable.getFloat64([number["end.force.x"], number["end.force.z"]]) == force
        cable.doStep(currentCommunicationPoint=0.2, communicationStepSize=0.05)
        print(f"{count + 2} wrong uses of an FMU")
        assert count + 2 > 100
    with hybrid.Simulation(hybrid.parse_scene(SCENE)) as same:
        same.set_end("start", [0, 0, 0])
        same.set_end("end", [10, 0, 0])
        same.advance(0.05)
        same.advance(0.1)
        same.advance(0.15)
        same.advance(0.2)
        assert force == pytest.approx([same.forces().end[0], same.forces().end[2]], rel=1e-9)


def test_two_units_run_in_one_process(unit: Path, tmp_path: Path) -> None:
    other = hybrid.export_fmu(hybrid.parse_scene(SCENE.replace("mass: 2.0", "mass: 4.0")), tmp_path / "heavy.fmu")
    with running(unit, tmp_path / "a") as (a, one), running(other, tmp_path / "b") as (b, two):
        step(a, 0)
        step(b, 0)
        light, heavy = (x.getFloat64([n["end.force.z"]])[0] for x, n in ((a, one), (b, two)))
    assert heavy == pytest.approx(2.0 * light, rel=1e-3)


def test_the_command_writes_one(tmp_path: Path) -> None:
    scene, unit = tmp_path / "line.yaml", tmp_path / "line.fmu"
    scene.write_text(SCENE)
    done = CliRunner().invoke(app, ["export", str(scene), "-o", str(unit), "--set", "time.duration=1"])
    assert done.exit_code == 0, done.output
    assert fmpy.read_model_description(unit).defaultExperiment.stopTime == "1.0"
    assert CliRunner().invoke(app, ["export", str(scene), "-o", str(unit)]).exit_code == 0  # replaces its own
    assert "--names" in CliRunner().invoke(app, ["export", str(scene), "-o", str(unit), "--names", "tension"]).output


def test_what_is_no_unit_is_not_replaced(tmp_path: Path) -> None:
    taken = tmp_path / "mine.fmu"
    with zipfile.ZipFile(taken, "w") as archive:
        archive.writestr("modelDescription.xml", "<fmiModelDescription/>")
    with pytest.raises(hybrid.ResultError, match="was not exported by hybrid"):
        hybrid.export_fmu(hybrid.parse_scene(SCENE), taken)
    with pytest.raises(hybrid.ResultError, match=r"ends in \.fmu"):
        hybrid.export_fmu(hybrid.parse_scene(SCENE), tmp_path / "line.zip")
    with pytest.raises(hybrid.SceneError):
        hybrid.export_fmu(hybrid.parse_scene(SCENE.replace("time: {duration: 2, step: 0.05}", "")), tmp_path / "a.fmu")
    assert not (tmp_path / "a.fmu").exists()


@FORMS
def test_a_winch_is_an_input(tmp_path: Path, form: Callable[[hybrid.Scene], hybrid.Scene]) -> None:
    scene = SCENE.replace("[10, 0, 0]}", "[10, 0, 0], payout: {longest: 14}}").replace(", axial_stiffness: 1e5", "")
    scene = form(hybrid.parse_scene(scene))
    unit, of = hybrid.export_fmu(scene, tmp_path / "winch.fmu"), "" if "" in scene.asked_lines else "cable."
    with running(unit, tmp_path / "open") as (cable, number):
        for k in range(40):
            cable.setFloat64([number[f"{of}payout_rate"]], [0.5 * (k + 1) / 40.0])
            step(cable, k)
        assert cable.getFloat64([number[f"{of}length"]]) == pytest.approx([12.5])


def test_tensions_are_those_of_the_result_ends_included(tmp_path: Path) -> None:
    unit, file = hybrid.export_fmu(hybrid.parse_scene(SCENE), tmp_path / "line.fmu"), tmp_path / "run.h5"
    found = []
    with running(unit, tmp_path / "open", output_file=str(file)) as (cable, number):
        saved = cable.getFMUState()
        for height in (1e-4, 2e-4):  # the second from the state before
            cable.setFMUState(saved)
            cable.setFloat64([number["end.position.z"], number["end.velocity.z"]], [height, 0.0])
            step(cable, 0)
            found.append(cable.getFloat64([number["tension_max"], number["tension_min"]]))
        cable.freeFMUState(saved)
    with hybrid.Simulation(hybrid.parse_scene(SCENE + "output: {every: 0.05}")) as same:
        same.set_end("end", [10, 0, 2e-4])
        same.step()
        cells = same.state.tension
        expected = same.tension()
        written = same.result().tension[1]
    assert expected == pytest.approx(written, rel=1e-12)
    assert found[1] == pytest.approx([written.max(), written.min()], rel=1e-9)
    assert found[0] != found[1] and written.max() > cells.max()


def test_after_a_step_that_failed_there_are_no_forces_and_no_state_until_the_return(unit: Path, tmp_path: Path) -> None:
    """They were those of the step that had failed, 1e11 N; and asking for the state lost the last good one."""
    with running(unit, tmp_path / "open") as (cable, number):
        force, tension = [number[f"end.force.{x}"] for x in "xyz"], [number["tension_max"], number["tension_min"]]
        step(cable, 0)
        good, before = cable.getFMUState(), cable.getFloat64(force)
        cable.setFloat64([number["end.position.x"]], [1e6])
        with pytest.raises(Exception, match="fmi3DoStep"):
            step(cable, 1)
        assert np.isnan(cable.getFloat64(force)).all() and np.isnan(cable.getFloat64(tension)).all()
        cable.freeFMUState(cable.getFMUState())
        cable.setFMUState(good)
        assert cable.getFloat64(force) == before and np.isfinite(cable.getFloat64(tension)).all()
        cable.setFloat64([number["end.position.x"]], [10.0])
        step(cable, 1)
        assert np.isfinite(cable.getFloat64(force)).all()
        cable.freeFMUState(good)
