"""Simulation goes back: what is taken back leaves nothing, a failed step is undone, a strong coupling converges."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bits import Stopping

import hybrid
import hybrid.simulation.run_record
import hybrid.simulation.stepped
import hybrid.store.writer
from hybrid.errors import Outcome
from tests.scenes import each_line, line_between, network_scene

# --- A run of several lines that was stopped, however often, is the run that was not: bit for bit ---

WAVES = {"kind": "regular", "height": 1.0, "period": 7.0, "ramp": 5.0}
SEA = {"fluid": {"density": 1025, "current": [0.4, 0.1, 0], "surface": 0.0, "waves": WAVES}}
LEG = {"length": 140, "mass": 3.0, "diameter": 0.04, "axial_stiffness": 2e6, "drag": {"normal": 1.2}}
HOSE = {
    "length": 100,
    "mass": 6,
    "diameter": 0.08,
    "axial_stiffness": 5e6,
    "bending_stiffness": 300,
    "max_tension": 800,
}


def mooring(**tables: Any) -> dict[str, Any]:
    """Two legs with friction on the bed, a float with a force that stops, and a rod to a vessel that heaves."""
    heave = {"heave": {"amplitude": 1.5, "period": 8}, "ramp": 6}
    force = {"value": [200, 0, 0], "until": 3.1}
    return network_scene(
        {"west": {"position": [-110, 0, -100]}, "east": {"position": [110, 10, -100]},
         "float": {"kind": "free", "initial_guess": [0, 0, -20], "mass": 900, "volume": 6, "drag_area": 3,
                   "force": force},
         "vessel": {"position": [70, 0, 2], "motion": heave}},
        {"west": line_between("west", "float", LEG, mesh=30), "east": line_between("float", "east", LEG, mesh=30),
         "hose": line_between("float", "vessel", HOSE, mesh=30)},
        title="float", environment=SEA | {"seabed": {"z": -100, "stiffness": 5000, "friction": 0.5}}, time=(8.0, 0.05)
    ) | tables  # fmt: skip


def spar() -> dict[str, Any]:
    """A body that floats and one that is moved, between lines."""
    line = {
        "sections": [LEG | {"length": 425, "mass": 80, "diameter": 0.1, "axial_stiffness": 4e8}],
        "mesh": {"cells": 20},
    }
    places = {"east": (400, 0), "north": (-200, 346), "south": (-200, -346)}
    return network_scene(
        {name: {"position": [x, y, -150]} for name, (x, y) in places.items()} | {
            f"to_{name}": {"body": "spar", "place": [x / 80, y / 80, -20]} for name, (x, y) in places.items()},
        {name: {"start": name, "end": f"to_{name}"} | line for name in places},
        fluid={"density": 1025, "current": [0.4, 0, 0], "surface": 0.0},
        bodies={"spar": {"initial_guess": [0, 0, 9], "mass": 3e6, "centre": [0, 0, -25], "inertia": [8e8, 8e8, 4e7],
                         "added_mass": [2.6e6, 2.6e6, 3e5, 1.5e9, 1.5e9, 0], "damping": [2e5, 2e5, 1e5, 2e7, 2e7, 1e7],
                         "hydrostatics": {"heave": 7.8e5, "roll": 1.2e8, "pitch": 1.2e8},
                         "force": {"value": [3e5, 0, 0], "until": 5},
                         "members": [{"start": [0, 0, -50], "end": [0, 0, 20], "diameter": 8, "drag": 1,
                                      "added_mass": 1}]}},
        time=(7, 0.1)
    )  # fmt: skip


def clamped() -> dict[str, Any]:
    """Rods clamped to a free point, to a body that is moved and to one that is free, one of them by a spring."""
    pipe = {"mass": 3.0, "diameter": 0.04, "axial_stiffness": 2e6, "bending_stiffness": 300, "drag": {"normal": 1.2}}
    turns = {"roll": {"amplitude": 4, "period": 5}, "heave": {"amplitude": 0.3, "period": 4}, "ramp": 4}
    up = {"tangent": [0, 0, 1]}
    return network_scene(
        {"foot": {"position": [0, 0, -40]}, "tee": {"initial_guess": [1, 0, -21], "mass": 20, "volume": 0.2},
         "lug": {"body": "ship", "place": [1, 0, -4]}, "eye": {"body": "float", "place": [0, 0, -1]}},
        {"low": line_between("foot", "tee", pipe | {"length": 20}, connections={"start": up, "end": up}, mesh=20),
         "high": line_between("lug", "tee", pipe | {"length": 19.5}, mesh=20,
                              connections={"start": {"tangent": [0, 0, -1], "bend_stiffness": 5e3},
                                           "end": {"tangent": [0, 0, -1]}}),
         "branch": line_between("tee", "eye", pipe | {"length": 12},
                                connections={"start": {"tangent": [1, 0, 0]}, "end": up}, mesh=20)},
        environment=SEA,
        bodies={"ship": {"position": [1, 0, 2], "motion": turns},
                "float": {"initial_guess": [9, 0, -14], "mass": 200, "volume": 0.4, "inertia": [90, 90, 60]}},
        time=(2.0, 0.05)
    )  # fmt: skip


@pytest.fixture
def stopping(monkeypatch: pytest.MonkeyPatch) -> Stopping:
    """Hears of every step, with a checkpoint every few and where the run is stopped."""
    return Stopping(monkeypatch)


def test_rotations_go_on_beyond_half_a_turn(tmp_path: Path) -> None:
    """The yaw of a body that is turned, through 180 deg and across a resume, is that of its motion."""
    turns = {"yaw": {"amplitude": 20.0, "period": 2.0}, "ramp": 1.0}
    scene = network_scene(
        {"foot": {"position": [0, 0, -30]}, "lug": {"body": "ship", "place": [0.1, 0, -1]}},
        {"leg": line_between("foot", "lug", LEG | {"length": 32}, mesh=6)}, environment=SEA,
        bodies={"ship": {"position": [1, 0, 0], "rotation": [0, 0, 180], "motion": turns}}, time=(1.3, 0.1), output=0.1
    )  # fmt: skip
    path = tmp_path / "run.h5"
    hybrid.run(scene, path).close()
    with hybrid.resume(path, until=4.0) as result:
        yaw = result["bodies/ship/rotation"][:, 2]
    assert yaw.min() < 165.0 and yaw.max() > 195.0 and np.abs(np.diff(yaw)).max() < 10.0


@pytest.mark.long
def test_a_running_result_shows_all_lines(tmp_path: Path, stopping: Stopping, monkeypatch: pytest.MonkeyPatch) -> None:
    """Every line has an output as soon as the points have it; extremes are those up to now."""
    monkeypatch.setattr(hybrid.simulation.run_record, "WORK", 0)  # the file is written whenever the run looks
    monkeypatch.setattr(hybrid.simulation.progress, "REPORT_EVERY", 0.0)
    path, seen = tmp_path / "run.h5", []

    def look(progress: Any) -> None:
        if progress.step >= 80 and not seen:
            with hybrid.open(path) as result:
                lines = result.lines.values()
                seen.append((result.status, len(result.times), [len(x.times) for x in lines]))
                assert all(np.isfinite(x.envelope["tension_max"]).all() for x in lines)
                assert all(x.status == "running" for x in lines)

    hybrid.run(mooring(), path, progress=look).close()
    ((status, outputs, of_lines),) = seen
    assert status == "running" and 40 <= outputs < 101 and of_lines == 3 * [outputs]


STEP = 0.05
VESSEL = np.array([70.0, 0.0, 2.0])


def scene(**tables: Any) -> dict[str, Any]:
    """Two legs with friction and a float in waves, whose force stops at 0.31 s, and a rod to a point that is set."""
    data = mooring(**tables)
    data["points"]["vessel"] = {"position": VESSEL.tolist()}
    data["points"]["float"]["force"] = {"value": [200, 0, 0], "until": 0.31}
    return each_line(data, mesh=12) | {"time": {"duration": 1.0, "step": STEP}, "output": {"every": 0.1}}


def heave(t: float, scale: float = 1.0) -> tuple[Any, Any]:
    """Place and velocity of the vessel."""
    w = 2.0
    return VESSEL + np.array([0, 0, 0.2 * scale * (1.0 - np.cos(w * t))]), np.array(
        [0, 0, 0.2 * scale * w * np.sin(w * t)]
    )


def step(lines: hybrid.Simulation, scale: float = 1.0) -> None:
    until = STEP * (round(lines.t / STEP) + 1)
    lines.set_point("vessel", *heave(until, scale))
    lines.advance(until)


def assert_same(a: hybrid.Result, b: hybrid.Result) -> None:
    """All outputs, steps, extremes and events of two results, but for the processor time of steps."""
    for x, y in [(a, b), *((a.lines[name], b.lines[name]) for name in a.lines)]:
        assert x.names == y.names and x.status == y.status
        for name in [n for n in x.names if n != "steps/cpu"]:
            assert np.array_equal(x[name], y[name], equal_nan=x[name].dtype.kind == "f"), name
        assert sorted((e.t, e.kind, e.text) for e in x.events) == sorted((e.t, e.kind, e.text) for e in y.events)


def plain(data: dict[str, Any], steps: int = 20) -> hybrid.Result:
    with hybrid.Simulation(data) as lines:
        for _ in range(steps):
            step(lines)
        return lines.result()


def test_a_file_grows_while_it_is_stepped(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(hybrid.store.writer, "pause", lambda _: 0.0)
    monkeypatch.setattr(hybrid.store.writer, "_PART", 0.0)
    with hybrid.Simulation(scene(), tmp_path / "run.h5") as lines:
        for _ in range(6):
            step(lines)
        with hybrid.open(tmp_path / "run.h5") as part:
            assert part.times[-1] == pytest.approx(0.3)
            assert {len(x.times) for x in part.lines.values()} == {len(part.times)}


@pytest.mark.long
def test_too_much_after_a_save_makes_it_final(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(hybrid.simulation.stepped, "MOST_WAITING", 3)
    with hybrid.Simulation(scene()) as lines:
        saved = lines.save()
        for _ in range(12):
            step(lines)
        with pytest.raises(ValueError, match="too much"):
            lines.restore(saved)
        for _ in range(8):
            step(lines)
        result = lines.result()
    assert_same(result, plain(scene()))


def test_what_was_set_before_a_save_is_set_after_restore() -> None:
    with hybrid.Simulation(scene()) as lines:
        lines.set_point("vessel", *heave(STEP))
        saved, places = lines.save(), []
        for _ in range(2):
            lines.advance(STEP)
            places.append(lines.line("hose").position)
            lines.restore(saved)
        assert np.array_equal(*places)
        assert places[0][-1] == pytest.approx(heave(STEP)[0], abs=1e-12)


def test_what_cannot_be_restored_is_refused() -> None:
    with hybrid.Simulation(scene()) as lines, hybrid.Simulation(scene()) as other:
        first, foreign = lines.save(), other.save()
        step(lines)
        for wrong in (foreign, None, "x", {}, object()):
            with pytest.raises(ValueError, match="of this Simulation"):
                lines.restore(wrong)
        lines.save()
        with pytest.raises(ValueError, match="later save"):
            lines.restore(first)
        assert lines.t == pytest.approx(STEP)


OUTCOMES = {"strain": Outcome.OVERSTRETCHED, "slack": Outcome.SLACK}
FAILING = {"strain": [HOSE | {"max_strain": 0.05}], "slack": [LEG | {"length": 100}]}


@pytest.mark.long
@pytest.mark.parametrize("hose", FAILING)
def test_a_failed_step_is_taken_back_and_a_smaller_one_goes_on(hose: str) -> None:
    """The hose is torn, or pushed together, within two steps; without that, the run afterwards is the same to the bit.

    Too much strain is found at the next output only, slackness in the solution of the step.
    """
    data = scene()
    data["lines"]["hose"]["sections"] = FAILING[hose]
    far = VESSEL + np.array([300.0 if hose == "strain" else -80.0, 0, 0])
    expected = plain(data, 10)
    with hybrid.Simulation(data) as lines:
        for k in range(10):
            if k in (0, 5):
                saved, place = lines.save(), lines.point("vessel").position
                lines.set_point("vessel", far)
                with pytest.raises(hybrid.ComputationError) as caught:
                    lines.advance(lines.t + 2 * STEP)
                assert caught.value.outcome == OUTCOMES[hose]
                for ask in (
                    lines.step,
                    lines.save,
                    lambda: lines.point("vessel"),
                    lambda: lines.forces("hose"),
                    lambda: lines.tension("hose"),
                    lambda: lines.stiffness("vessel"),
                ):
                    with pytest.raises(ValueError, match="a step has failed"):
                        ask()
                lines.restore(saved)
                assert lines.t == pytest.approx(STEP * k)
                lines.advance(lines.t + 0.5 * STEP)  # the point is not set again: it stays
                assert lines.point("vessel").position == pytest.approx(place, abs=1e-12)
                lines.restore(saved)
            step(lines)
        result = lines.result()
    assert_same(result, expected)


def test_a_body_that_is_coupled_strongly_converges() -> None:
    """A mass on a spring holds the hose; its trapezoidal rule and the lines agree on every step by repetition.

    The force that moves it is then that of the lines at its new place: the balance at the end of each step holds to
    1e-9 of the force, which a staggered coupling does not reach.
    """
    m, stiffness = 2.0e4, 2.0e4  # kg, N/m
    tries = []
    with hybrid.Simulation(scene()) as lines:
        rest = lines.point("vessel").force
        x, v, a = np.zeros(3), np.array([0.0, 0.0, 0.2]), np.zeros(3)
        for _ in range(10):
            saved, guess, delayed = lines.save(), a, lines.point("vessel").force
            for k in range(30):
                speed = v + 0.5 * STEP * (a + guess)
                place = x + 0.5 * STEP * (v + speed)
                if k:
                    lines.restore(saved)
                lines.set_point("vessel", VESSEL + place, speed)
                lines.advance(STEP * (round(lines.t / STEP) + 1))
                force = lines.point("vessel").force
                found = (force - rest - stiffness * place) / m
                change, guess = np.abs(found - guess).max(), found
                if m * change < 1e-9 * np.abs(force).max():
                    break
            else:
                pytest.fail(f"no agreement: {m * change:.3g} N are left")
            assert np.abs(force - delayed).max() > 1e-4 * np.abs(force).max()
            x, v, a = place, speed, found
            tries.append(k + 1)
        result = lines.result()
    print(f"{np.mean(tries):.1f} tries of a step")
    assert min(tries) >= 2 and max(tries) < 15
    assert len(result.lines["hose"]["steps/t"]) == 11  # one more where a load stops
