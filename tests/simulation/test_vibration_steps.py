"""Steps that show a vibration along the line while it lasts, and longer ones once it has died out."""

from __future__ import annotations

from functools import partial
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from bits import Stopping, differences, went_on
from test_stepping import driven, heave, touchdown

import hybrid
from hybrid.accuracy import free_vibrations as f
from hybrid.errors import ComputationError, Outcome
from hybrid.kernels.state import books as b
from hybrid.linear.touching import rest_of
from hybrid.model.build import build
from hybrid.model.network import NetworkResolution
from hybrid.model.resolution import first_resolution
from hybrid.scene.read import as_scene, one_line
from hybrid.scene.root import LINE
from hybrid.simulation.events import EventLog
from hybrid.simulation.run_steps import VibrationsOfLines, VibrationSteps
from hybrid.simulation.watches import FIRST_MOMENTS, GAIN_NOTED, SchemeWatch
from tests.said import line_of, said
from tests.scenes import cable_scene, clamped_at, line_between, network_scene, pinned_at

PERIOD = 4.0 * 12.0 * (2.0 / 1e5) ** 0.5


def sag(ramp=1.0, accuracy="3%", duration=10.0, period=2.0):
    """A line that sags between two pins, one of which heaves; a short ramp sets off a vibration along it."""
    section = {
        "length": 12.0, "diameter": 0.03, "mass": 2.0, "axial_stiffness": 1e5, "bending_stiffness": 20.0,
        "drag": {"normal": 1.2}, "added_mass": {"normal": 1.0},
    }  # fmt: skip
    motion = {"heave": {"amplitude": 0.3, "period": period}, "ramp": ramp}
    return hybrid.validate_scene(cable_scene(
        section, pinned_at(0, 0, -5), pinned_at(10, 0, -5, motion=motion), fluid={"density": 1025}, model="rod",
        time={"duration": duration}, accuracy=accuracy, output=(0.1, 25)
    ))  # fmt: skip


def watched(scene=None):
    """Of a scene, at t = 0: the clock of its run and what chooses its longest step."""
    scene = scene or sag()
    resolution, clock = first_resolution(scene), b.Clock()
    clock.largest = clock.next_dt = resolution.step
    steps = VibrationSteps(scene, resolution)
    VibrationsOfLines({"line": steps}, clock).begin_leg()
    return resolution, clock, steps


def look(steps, clock, amplitude):
    """Go to the next look, with so large a vibration (N) of the second end beside a force that changes slowly."""
    t = np.linspace(steps.look - 2.0 * PERIOD, steps.look, 97)[1:]
    force = 100.0 + 30.0 * np.sin(np.pi * t + 0.3) + amplitude * np.cos(2.0 * np.pi * t / PERIOD + 1.0)
    steps.log(np.column_stack([t, np.full_like(t, 50.0), force]))
    found = steps.amplitude()
    clock.now = steps.look
    VibrationsOfLines({"line": steps}, clock).begin_leg()
    return found


def test_resolutions_have_both_steps():
    found = first_resolution(sag())
    assert found.step == pytest.approx(PERIOD / 48.0) and found.later == pytest.approx(1.0 / 12.0)
    coarse = found.coarser(2.0, 2.0)
    assert (coarse.step, coarse.later, coarse.still) == (2.0 * found.step, 2.0 * found.later, found.still)
    assert first_resolution(sag(ramp=4.0)).later == 0.0  # an ordinary ramp shakes nothing that matters


def test_steps_are_short_until_a_period_of_the_motion_has_shown_little():
    """Which begins where the ramp ends, and again where something has been seen."""
    resolution, clock, steps = watched()
    assert clock.largest == resolution.step and steps.begins == [0.0, 1.0]
    assert look(steps, clock, 20.0) == pytest.approx(20.0, rel=0.05)
    clock.now = 1.0
    VibrationsOfLines({"line": steps}, clock).begin_leg()  # the ramp ends
    seen = 0.0
    while steps.look < np.inf:
        assert clock.largest == resolution.step
        seen = steps.look if abs(steps.look - 2.3) < PERIOD else seen
        look(steps, clock, 3.0 * resolution.still if abs(steps.look - 2.3) < PERIOD else 0.0)
    assert clock.largest == resolution.later and 0.0 <= clock.now - seen - 2.0 <= 2.0 * PERIOD


def test_a_vibration_that_stays_or_is_not_seen_keeps_steps_short():
    resolution, clock, steps = watched()
    for _ in range(40):
        look(steps, clock, 0.7 * resolution.still)
    assert clock.largest == resolution.step and steps.look < np.inf
    _, clock, steps = watched()
    for _ in range(40):
        assert steps.amplitude() == np.inf  # no steps
        steps.judge()
    assert steps.look < np.inf


def test_a_checkpoint_goes_on_and_a_forged_one_does_not():
    _, clock, steps = watched()
    look(steps, clock, 20.0)
    steps.log(np.array([[clock.now + 0.01, 1.0, 2.0]]))
    again = watched()[2]
    again.restore(steps.checkpoint(), clock.now)
    assert {k: np.array(x).tolist() for k, x in again.checkpoint().items()} == {
        k: np.array(x).tolist() for k, x in steps.checkpoint().items()
    }
    for wrong in ({"look": 1e6}, {"rows": np.zeros((2, 2))}, {"from": "now"}):
        with pytest.raises(ValueError, match="vibration"):
            again.restore(steps.checkpoint() | wrong, clock.now)
    again.restore(None, clock.now)  # a file from before
    assert again.look > clock.now


@pytest.mark.long
def test_steps_are_longer_where_it_has_died_out_and_forces_stay_right():
    """Of 40 s with short steps throughout there were 8949 (docs/evidence/accuracy.md); drag stops the vibration in 2 s."""
    whole = hybrid.run(said(sag(), network=True))
    result = line_of(whole)
    t, step = np.array(result.steps["t"]), first_resolution(sag()).step
    dt = np.diff(t)
    assert dt[t[1:] < 3.0].max() <= 1.001 * step
    assert np.median(dt[t[1:] > 6.0]) > 4.0 * step
    fixed = sag().model_dump(exclude_none=True) | {"time": {"duration": 10.0, "step": 2e-3}, "mesh": {"cells": 80}}
    del fixed["accuracy"]
    truth = hybrid.run(fixed)
    ends = ("reaction_start", "reaction_end")
    off = max(float(np.linalg.norm(result[x] - truth[x], axis=1).max()) for x in ends)
    assert off <= 0.03 * max(float(np.linalg.norm(truth[x], axis=1).max()) for x in ends)
    assert 0.7 <= result.attributes["error_total_end_force"] / off <= 3.0


def test_drag_that_sets_it_off_again_in_every_period_keeps_steps_short():
    """At 1 %: steps that follow the motion alone damp 1.4 N of it in every period, which no run would show."""
    dt = np.diff(line_of(hybrid.run(said(sag(accuracy="1%", duration=8.0), network=True))).steps["t"])
    assert dt.max() <= 1.001 * PERIOD / 48.0


@pytest.mark.long
def test_a_stopped_run_goes_on_bit_for_bit(tmp_path, monkeypatch):
    scene, stopping = said(sag(duration=6.0, accuracy="10%", ramp=0.5), network=True), Stopping(monkeypatch)
    hybrid.run(scene, tmp_path / "whole.h5", progress=stopping).close()
    heard = stopping.heard
    assert went_on(scene, tmp_path / "run.h5", stopping, [round(0.6 * heard), heard // 5, heard // 10]) == 3
    assert differences(tmp_path / "whole.h5", tmp_path / "run.h5") == []


# --- Free vibrations that ramps leave, and what steps make of them: what is foretold, and what a run says of it ---


def cantilever(**more):
    """56 Hz, shaken with 20 Hz: the forced motion is of order 2, and hides what its ramp leaves."""
    motion = {"heave": {"amplitude": 0.01, "period": 0.05}, "ramp": 0.1}
    section, start = (
        {"length": 1.0, "mass": 1.0, "bending_stiffness": 1e4},
        clamped_at([0, 0, 0], [1, 0, 0], motion=motion),
    )
    return cable_scene(section, start, "free", time=1.0, output=(0.01, 26)) | more


def taut(**more):
    """Of 10 m, pulled by 100 N, 1 kg/m: waves of 10 m/s."""
    travel = {"travel": {"by": [0, 0, 0.1], "over": 1.5, "begin": 0.2}}
    section = {"length": 10.0 / 1.01, "mass": 1.01, "axial_stiffness": 1e4}
    ends = pinned_at(0, 0, 0), pinned_at(10, 0, 0, motion=travel)
    return cable_scene(section, *ends, gravity=0, model="catenary", time=10.0) | more


def at_rest(scene):
    """The line about its equilibrium on its first mesh."""
    return rest_of(scene, NetworkResolution({LINE: first_resolution(scene)}))


def lost(scene, steps):
    """What a run in equal steps makes of its free vibrations."""
    times = np.arange(1, steps + 1) * scene.time.duration / steps
    return f.lost_vibrations(scene, lambda: at_rest(scene), times).get("cable", {})


def test_frequencies():
    w = f.Vibrations(at_rest(hybrid.validate_scene(cantilever()))).w
    assert w[[0, 1]] == pytest.approx(3.516 * 100.0, rel=0.001)  # in both planes
    assert w[2] == pytest.approx(22.03 * 100.0, rel=0.001)
    w = f.Vibrations(at_rest(hybrid.validate_scene(taut()))).w
    assert w[[0, 2, 4]] == pytest.approx(np.pi * np.array([1.0, 2.0, 3.0]), rel=0.001)


def test_the_bed_and_the_water_have_their_part_in_them():
    """A string of w_n^2 = (n pi)^2 on k N/m^2 in water of the added mass m_a: w^2 = (m w_n^2 + k)/(m + m_a)."""
    section = {"length": 10.0 / 1.01, "mass": 1.01, "axial_stiffness": 1e4, "diameter": 0.03}
    section |= {"added_mass": {"normal": 1.0}}
    environment = {"gravity": 0.5, "fluid": {"density": 1025}, "seabed": {"z": 0.0, "stiffness": 200.0}}
    w = f.Vibrations(at_rest(hybrid.validate_scene(taut(environment=environment, cable={"sections": [section]})))).w
    m, added, w1 = 1.01, 1025 * np.pi * 0.03**2 / 4, np.pi
    free, held = w1 * np.sqrt(m / (m + added)), np.sqrt((m * w1**2 + 200.0) / (m + added))
    assert w[0] == pytest.approx(free, rel=0.01)  # sideways, without friction
    assert np.abs(w / held - 1.0).min() < 0.01


def test_the_longest_period_is_among_them_whatever_the_shortest_is():
    """A body of 200 t that sinks with 4.9 kN: of few cells all modes along the wire are found as well."""
    travel = {"travel": {"by": [40, 0, 0], "over": 60}}
    section = {"length": 200.0, "mass": 5.5, "diameter": 0.03, "axial_stiffness": 1.4e8}
    body = {"kind": "body", "mass": 2e5, "volume": 199.5, "initial_guess": [0, 0, -200]}
    periods = []
    for cells in (5, 20):
        scene = hybrid.validate_scene(cable_scene(
            section, pinned_at(0, 0, 0, motion=travel), body, model="catenary", mesh=cells, fluid={"density": 1000},
            dimension=3, time=(3000.0, 10.0)
        ))  # fmt: skip
        periods.append(2.0 * np.pi / f.Vibrations(at_rest(scene)).w[0])
        assert lost(scene, 300)["position"].amplitude > 30.0
    assert periods[0] == pytest.approx(periods[1], rel=0.01)


def test_what_a_move_leaves():
    """Against the same oscillators, integrated in short steps; at its end a string drives mode n by sqrt(2 m L)/(n pi)."""
    found = f.Vibrations(at_rest(hybrid.validate_scene(taut())))
    size = found._amplitudes([0.0, 0.2], 1.7, 10.0, found.w > 0.0)
    t = np.linspace(0.0, 1.7, 100_001)
    x = np.clip((t - 0.2) / 1.5, 0.0, 1.0)
    second = 0.1 / 1.5**2 * (60.0 * x - 180.0 * x**2 + 120.0 * x**3)  # of 10 x^3 - 15 x^4 + 6 x^5
    for n in (1, 2):
        k = slice(2 * n - 2, 2 * n)  # both planes
        drive = np.linalg.norm(found.drive[0, 1, 2, k])
        assert drive == pytest.approx(np.sqrt(2.0 * 10.0) / (n * np.pi), rel=1e-3)
        truth = drive * abs((second * np.exp(-1j * n * np.pi * t)).sum() * (t[1] - t[0])) / (n * np.pi)
        assert np.linalg.norm(size[k]) == pytest.approx(truth, rel=2e-3)
    assert size.max() > 1e-3


def apart(tables, line=None):
    """By how much (m) a run in steps of 0.1 s is off a finer one after the move, and how much was foretold."""
    runs = [hybrid.run(tables | {"time": {"duration": 10.0, "step": h}, "output": {"every": 0.1}}) for h in (0.1, 0.01)]
    late = runs[0].times > 1.7
    rough, fine = (run.lines[line].position if line else run.position for run in runs)
    asked, times = as_scene(tables), np.arange(1, 101) * 0.1
    rest = partial(rest_of, asked, NetworkResolution.first(asked)) if line else partial(at_rest, asked)
    found = f.lost_vibrations(asked, rest, times)[line or "cable"]["position"]
    return float(np.linalg.norm(rough - fine, axis=2)[late].max()), found


@pytest.mark.parametrize("where", ["air", "water", "two lines"])
def test_what_is_foretold_is_what_steps_lose(where):
    if where == "two lines":
        section = {"length": 5.0 / 1.01, "mass": 1.01, "axial_stiffness": 1e4}
        points = {
            "a": {"position": [0, 0, 0]}, "b": {"kind": "free", "mass": 5.0, "initial_guess": [5, 0, 0]},
            "c": {"position": [10, 0, 0], "motion": taut()["ends"]["end"]["motion"]},
        }  # fmt: skip
        lines = {name: line_between(*ends, section, model="catenary") for name, ends in (("one", "ab"), ("two", "bc"))}
        is_, found = apart(network_scene(points, lines, gravity=0, time=10.0), "two")
        assert found.period == pytest.approx(1.0, rel=0.01)  # of the halves, on either side of the mass
    elif where == "water":
        section = {"length": 10.0 / 1.01, "mass": 1.01, "axial_stiffness": 1e4, "diameter": 0.03}
        section |= {"drag": {"normal": 1.2}, "added_mass": {"normal": 1.0}}
        water = {"gravity": 0, "fluid": {"density": 1025}}
        is_, found = apart(taut(environment=water, cable={"sections": [section]}))
        assert found.error < 0.1 * found.amplitude  # it dies before steps make it late
    else:
        is_, found = apart(taut())
        assert found.error > 0.3 * found.amplitude
    assert 0.7 < found.error / is_ < 1.3


def test_steps_of_the_trapezoidal_rule():
    """Its radius is 1: it loses nothing, and turns by 2 atan(w dt/2)."""
    angle = np.array([0.01, 0.1, 1.0, 3.0])
    found = f.Factors(1.0).of(angle)
    assert np.abs(found.real).max() < 1e-9
    assert found.imag == pytest.approx(2.0 * np.arctan(0.5 * angle) - angle, rel=1e-3)
    assert f.Factors(0.0).of(np.array([100.0])).real[0] < -3.0  # lost in a step


def test_long_runs_are_looked_at_in_parts(monkeypatch):
    w, t = np.array([1.0, 3.0]), np.cumsum(np.concatenate([[0.0], np.linspace(0.01, 0.1, 1000)]))
    whole, times = f.Factors(0.5).drift(w, t)
    assert np.array_equal(times, t)
    monkeypatch.setattr(f, "ROWS", 100)
    monkeypatch.setattr(f, "BLOCK", 7)
    some, times = f.Factors(0.5).drift(w, t)
    assert len(times) <= 102
    assert some == pytest.approx(whole[np.searchsorted(t, times)], rel=1e-9)


@pytest.mark.long
def test_a_vibration_that_all_runs_have_lost_is_said():
    """Asked for 2 % of the moment it was 8 % off and said 1.6 %."""
    result = hybrid.run(cantilever(accuracy={"bending_moment": "2%"}))
    (text,) = [e.text for e in result.events if e.kind == "error uncertain"]
    assert "bending moment" in text
    assert "0.018 s" in text
    step = float(text.split("time.step: ")[1].split()[0])
    shown = hybrid.run(
        cantilever(time={"duration": 1.0, "step": step}, output={"every": 0.01, "points": 26, "errors": True})
    )
    assert "error uncertain" not in {e.kind for e in shown.events}


def test_nothing_is_said_where_the_figure_shows_it():
    result = hybrid.run(taut(accuracy={"position": "0.3%"}))
    assert "error uncertain" not in {e.kind for e in result.events}


def test_what_more_steps_show():
    scene = hybrid.validate_scene(taut())
    found = lost(scene, 20)
    assert set(found) == {"position", "tension", "end_force_start", "end_force_end"}
    assert found["position"].error > 0.5 * found["position"].amplitude
    assert lost(scene, 4000)["position"].error < 0.1 * found["position"].error


@pytest.mark.parametrize(
    "more",
    [
        {"ends": {"start": {"kind": "pinned", "position": [0, 0, 0]}, "end": {"kind": "pinned", "position": [10, 0, 0]}}},
        {"environment": {"fluid": {"density": 1025, "surface": 5.0, "waves": {
            "kind": "regular", "height": 0.1, "period": 3.0, "depth": 100.0, "ramp": 6.0}}}},
    ],
    ids=["nothing moves", "waves"],
)  # fmt: skip
def test_where_it_is_not_known_nothing_is_said(more):
    cable = {"sections": [{"length": 10.0 / 1.01, "mass": 1.01, "axial_stiffness": 1e4, "diameter": 0.03}]}
    assert lost(hybrid.validate_scene(taut(cable=cable)), 20)
    assert not lost(hybrid.validate_scene(taut(cable=cable, **more)), 20)


# --- Steps in real time: never more Newton iterations than allowed; what was cut short is said, counted and right
# soon ---

PINNED = "ends.end={kind: pinned, position: [205, 0, 0]}"
LONG = "time={duration: 20, step: 0.2}"


def stepped(most: int | None, model: str = "rod") -> tuple[np.ndarray, hybrid.Result, int]:
    forces = []
    with hybrid.Simulation(touchdown(f"model={model}", PINNED, LONG), most_iterations=most) as cable:
        for k in range(100):
            cable.set_end("end", *heave(0.2 * (k + 1)))
            cable.step()
            forces.append(cable.forces().end)
        count = cable.cut_short
        return np.array(forces), cable.result(), count


@pytest.mark.parametrize("model", ["rod", "catenary"])
def test_no_step_takes_more_and_the_motion_is_nearly_the_same(model: str) -> None:
    full, reference, none = stepped(None, model)
    assert none == 0 and reference["steps/iterations"].max() > 3
    assert not [e for e in reference.events if e.kind == "iterations cut"]
    off = []
    for most in (1, 2, 3):
        forces, result, count = stepped(most, model)
        assert result["steps/iterations"].max() == most and count > 0
        told = [e for e in result.events if e.kind == "iterations cut"]
        assert [e.value for e in told[1:]] == [count] and told[0].value is None
        assert f"after {most} Newton iterations" in told[0].text and f"{count} of 100 steps" in told[1].text
        assert float(told[0].text.split("changed it by ")[1].split()[0]) > 0.0
        off.append(np.abs(forces - full).max() / np.abs(full).max())
    assert off[2] < 0.2 * off[1] < 0.04 * off[0] < 0.04 * 0.1


def test_what_needs_no_more_has_the_same_bits() -> None:
    full, _, _ = stepped(None)
    bounded, result, count = stepped(20)
    assert count == 0 and np.array_equal(full, bounded)
    assert "iterations cut" not in {e.kind for e in result.events}


@pytest.mark.parametrize("model", ["rod", "{kind: adaptive, tolerance: 2.0e-5}"])
def test_what_is_taken_back_is_not_counted(model: str) -> None:
    with hybrid.Simulation(touchdown(f"model={model}", PINNED, LONG), most_iterations=1) as cable:
        saved = cable.save()
        cable.set_end("end", *heave(0.2))
        for _ in range(3):
            cable.restore(saved)
            for k in range(10):
                cable.set_end("end", *heave(0.2 * (k + 1)))
                cable.step()
            count = cable.cut_short
        assert 0 < count <= 10
        result = cable.result()
    assert [e.value for e in result.events if e.kind == "iterations cut"][1:] == [count]


def test_a_step_that_is_refused_says_that_its_iterations_are_used_up() -> None:
    with hybrid.Simulation(touchdown("model=catenary", PINNED), most_iterations=3) as cable:
        saved = cable.save()
        cable.set_end("end", [150.0, 0.0, 0.0])
        with pytest.raises(hybrid.ComputationError, match="the 3 iterations that a step may take are used up"):
            cable.step()
        cable.restore(saved)
        driven(cable, 2)
        assert cable.t == pytest.approx(0.1)


@pytest.mark.parametrize("most", [0, -1, 2.5, "3", True, np.nan, [2]])
def test_a_number_that_is_none_is_refused(most: Any) -> None:
    with pytest.raises(ValueError, match="most_iterations: expected a whole number of at least 1"):
        hybrid.Simulation(touchdown("model=catenary", PINNED), most_iterations=most)


# --- Energy that a time scheme creates is held against all that is put in, not against what the first moments have
# put in ---

MODEL = build(one_line(hybrid.validate_scene(cable_scene(
    {"length": 10, "mass": 1.0}, pinned_at(0, 0, 0), "free", model="catenary", mesh=10
))))  # fmt: skip


def watched_created(
    gained: list[float], work: list[float], strain: float = 0.0, batches: int = 1
) -> tuple[list[Any], Any]:
    """Events (t, kind, text) and what stopped a run whose scheme has created and whose ends have put in so much, J.

    Outputs follow each other by a second; strain: J, energy that is there from the start.
    """
    log = EventLog()
    watch, stop, t = SchemeWatch(MODEL, log), None, np.arange(float(len(gained)))
    for k, part in enumerate(np.array_split(np.arange(t.size), batches)):
        if k:  # as a run that is resumed
            before = watch
            watch = SchemeWatch(MODEL, log)
            for name in ("_created", "_put_in", "_potential", "_alive", "_gain", "_loss"):
                setattr(watch, name, getattr(before, name))
        batch = SimpleNamespace(t=t[part], work=np.array(work)[part, None], v=np.zeros((part.size, 11, 3)))
        values = {
            "work/scheme": np.array(gained)[part], "energy/potential": np.zeros(part.size),
            "energy/stretch": np.full(part.size, strain),
        }  # fmt: skip
        stop = stop or watch.judge(MODEL, batch, values)  # type: ignore[arg-type]
    watch.finish()
    return [(x[0], x[3], x[4]) for x in log.waiting()], stop


def test_the_first_moments_of_a_run_do_not_decide() -> None:
    """22 J of 280 J a moment after the motion begins, 1.1 kJ of 9.4 MJ at the end: as of an array that turns."""
    gained, work = [0.0, 22.4, 40.0, 800.0, 1100.0], [0.0, 24.0, 900.0, 4e6, 9.4e6]
    assert watched_created(gained, work, 256.0) == ([], None)
    (event,), stop = watched_created(gained[:2], work[:2], 256.0)  # had it ended there
    assert event[:2] == (1.0, "gains energy") and "22.4 J, 8 % of" in event[2] and stop is None


@pytest.mark.parametrize("part", [0.04, 0.06, 0.5, 0.99])
def test_what_is_created_steadily_is_noted_as_a_part_of_what_is_put_in(part: float) -> None:
    work = [100.0 * k for k in range(8)]
    for batches in (1, 3):
        found, stop = watched_created([part * x for x in work], work, batches=batches)
        assert bool(found) == (part > GAIN_NOTED) and stop is None
        assert not found or (found[0][0] == 7.0 and f"{100 * part:.0f} % of" in found[0][2])


def test_a_burst_in_the_run_is_noted_although_the_rest_is_sound() -> None:
    """60 J of 1 kJ, half a run before its end: it is 6 % when it comes and 3 % at the end."""
    found, _ = watched_created([0.0, 0.0, 60.0, 60.0, 60.0], [0.0, 500.0, 1000.0, 1500.0, 2000.0])
    assert [x[:2] for x in found] == [(2.0, "gains energy")] and "6 %" in found[0][2]


@pytest.mark.parametrize("later", [1e-3, 1e9], ids=["to the end", "before much is put in"])
def test_as_much_as_was_put_in_stops_a_run_wherever_it_comes(later: float) -> None:
    _, stop = watched_created([0.0, 101.0, 101.0], [0.0, 100.0, later])
    assert stop is not None and stop[0] is Outcome.GAINS_ENERGY


def test_the_first_moments_are_held_against_a_part_of_all() -> None:
    """Beyond GAIN_NOTED of FIRST_MOMENTS of all that is put in, energy of the first moments is noted, too."""
    share = GAIN_NOTED * FIRST_MOMENTS * 1e5  # J, which is 10 % of the 5 kJ that are put in then
    for part, noted in ((0.99, False), (1.01, True)):
        gained = part * share
        found, _ = watched_created([0.0, gained, gained], [0.0, 5e3, 1e5])
        assert bool(found) == noted


@pytest.mark.parametrize("kind", ["obstacle", "seabed"])
def test_a_rope_that_bounces_higher_than_it_fell_stops_the_run(kind: str) -> None:
    """10 mm above a floor without damping and friction: 2.94 J, of which steps of 5 ms make 22 J; not those of 1 ms."""
    floor = {"obstacles": {"floor": {"kind": "plane", "at": [0, 0, 0], "normal": [0, 0, 1]}}}
    bed = {"environment": {"seabed": {"z": -0.02, "stiffness": 1e5}}}
    line = {"length": 5.0, "mass": 2.0, "diameter": 0.04, "axial_stiffness": 1e6, "bending_stiffness": 5.0}
    scene = (floor if kind == "obstacle" else bed) | {
        "cable": {"sections": [line]}, "ends": {"start": "free", "end": "free"}, "model": "rod",
        "initial": {"kind": "straight", "origin": [0, 0, 0.03], "direction": [1, 0, 0]}, "mesh": {"cells": 20},
    }  # fmt: skip
    with pytest.raises(ComputationError) as stopped:
        hybrid.run(scene | {"time": {"duration": 2.0, "step": 0.02 if kind == "seabed" else 0.005}})
    assert stopped.value.outcome == Outcome.GAINS_ENERGY
    stopped.value.snapshot.unlink()
    with hybrid.run(scene | {"time": {"duration": 0.5, "step": 0.0005}}) as fine:
        assert "gains energy" not in {x.kind for x in fine.events}
        assert fine.position[:, :, 2].max() < 0.0301
