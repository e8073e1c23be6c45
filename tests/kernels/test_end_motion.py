"""What ends impose, compiled: as in Python at all times; the turn of an end is the length of its way."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

import hybrid
from hybrid.kernels.laws import end_motion
from hybrid.kernels.machine.compile import kernel
from hybrid.kernels.state.state import Ends, no_sea
from hybrid.model.bodies import FairleadMotion, KnownMotion
from hybrid.model.ends import EndConditions, EndLoad
from hybrid.model.sea import Surroundings
from hybrid.scene.bodies import FixedBody
from hybrid.scene.motion import EndMotion
from hybrid.scene.motion_tables import Harmonic, Motion, Travel
from hybrid.scene.read import one_line

ROUND_OFF = 1e-14  # of the size of what is compared
TIMES = (-2.0, 0.0, 0.3, 1.7, 4.0, 5.5, 7.99, 10.0, 12.5, 19.9, 25.0, 33.3, 60.0, 1e4)
BASES = [np.linalg.qr(np.array(m, float))[0] for m in ([[1, 2, 3], [0.5, -1, 2], [2, 0.3, -1]],
                                                      [[0, 1, 0.2], [1, 0.1, 0], [0.3, 0, 2]])]  # fmt: skip
PLACES = np.array([[1.0, -2.0, 3.0], [40.0, 5.0, -6.0]])
# amplitude, frequency, kx, ky, phase, k
WAVES = np.array([[1.2, 1.0, 0.08, 0.06, 0.4, 0.1], [0.4, 1.7, -0.2, 0.2, 1.1, 0.29]])


@kernel
def ends_of(t, moves, sea, ends, velocity):
    end_motion.ends_at(t, moves, sea, ends, velocity)


@kernel
def sea_of(t, sea):
    end_motion.sea_at(t, sea)


@kernel
def turn_of(a, b, moves):
    return end_motion.turn_between(a, b, moves)


def tone(amplitude: float, period: float, phase: float = 0.0) -> Harmonic:
    return Harmonic(amplitude=amplitude, period=period, phase=phase)


def csv(folder: Path, name: str, shift: bool, turn: bool, begin: float = 0.0) -> str:
    """A smooth record over 30 s that starts from rest at t = 0 where the first end is."""
    t = np.arange(begin, 30.1, 0.25)
    x = np.clip(t / 16.0, 0.0, 1.0)
    grown = x**3 * (10.0 - 15.0 * x + 6.0 * x**2)
    path = np.stack([a * grown * np.sin(w * t + p) for a, w, p in ((1, 0.8, 0.1), (2, 0.6, 1), (0.5, 1.0, 2))], axis=1)
    columns, names = [t[:, None]], ["t"]
    if shift:
        columns, names = [*columns, PLACES[0] + path], [*names, "x", "y", "z"]
    if turn:
        columns, names = [*columns, 400.0 * path], [*names, "rx", "ry", "rz"]
    np.savetxt(folder / name, np.hstack(columns), delimiter=",", header=",".join(names), comments="", fmt="%.14g")
    return str(folder / name)


KINDS = {
    "at rest": None,
    "harmonics": Motion(surge=tone(1, 5, 20), sway=tone(-0.5, 3), heave=tone(2, 8, 90), roll=tone(40, 6, -60),
                        pitch=tone(70, 7), yaw=tone(200, 9, 45), ramp=10.0),
    "lists": Motion(heave=(tone(1, 9), tone(0.3, 4, -70)), yaw=(tone(720, 60), tone(20, 5)), ramp=4.0),
    "no ramp": Motion(roll=tone(30, 5)),
    "velocity": Motion(velocity=(0.5, -0.3, 0.1), ramp=10.0),
    "travel": Motion(travel=Travel(by=(20.0, 5.0, -3.0), over=8.0, begin=4.0)),
    "waves": Motion(follow="waves"),
    "everything": Motion(surge=(tone(1, 9, 20), tone(0.3, 4)), velocity=(0.5, -0.3, 0.1), follow="waves", ramp=10.0,
                         travel=Travel(by=(20.0, 5.0, -3.0), over=10.0, begin=4.0), pitch=tone(15, 6)),
}  # fmt: skip


def conditions(
    first: Motion | None, second: Motion | None, around: Surroundings, held=(True, True), loads=()
) -> EndConditions:
    motions = {
        k: EndMotion(motion, PLACES[k] if held[k] else None, BASES[k], around.elevation)
        for k, motion in enumerate((first, second))
        if motion is not None
    }
    frame = np.array([base.ravel() for base in BASES])
    return EndConditions(held, PLACES * np.array(held)[:, None], frame, loads, motions)


def waters(ramps=(0.0, 12.0)) -> Surroundings:
    return Surroundings(no_sea(3)._replace(waves=WAVES, depth=30.0, surface=0.0, ramps=np.array(ramps)))


def check(ends: EndConditions, around: Surroundings, times=TIMES) -> None:
    """Compiled and in Python, to round-off of the largest number of each kind."""
    for t in times:
        # what was there before must not stay
        found = Ends(ends.values.held, *(np.full_like(x, np.nan) for x in ends.values[1:]))
        velocity = np.full((2, 3), np.nan)
        ends_of(t, ends.moves(), around.values, found, velocity)
        wanted = ends.at_time(t)
        for name, a, b in zip(Ends._fields, found, wanted, strict=True):
            size = max(1.0, float(np.abs(b).max()))
            np.testing.assert_allclose(a, b, rtol=0, atol=5 * ROUND_OFF * size, err_msg=f"{name} at {t}")
        size = max(1.0, float(np.abs(ends.velocity).max()))
        np.testing.assert_allclose(velocity, ends.velocity, rtol=0, atol=ROUND_OFF * size, err_msg=f"velocity at {t}")


@pytest.mark.long
@pytest.mark.parametrize("first", KINDS)
def test_compiled_is_python(first: str) -> None:
    around = waters()
    check(conditions(KINDS[first], KINDS["everything"], around), around, (*TIMES, math.inf))
    check(conditions(None, KINDS[first], around), around, (*TIMES, math.inf))


@pytest.mark.parametrize("name", [*KINDS, "file"])
def test_ends_on_a_body_that_moves_compiled_are_python(tmp_path: Path, name: str) -> None:
    """One end turns freely, and one with the body."""
    around = waters()
    motion = KINDS.get(name) or Motion(file=csv(tmp_path, "a.csv", True, True))
    body = FixedBody(kind="fixed", position=tuple(PLACES[0]), rotation=(10.0, -20.0, 130.0), motion=motion)
    known, seat = KnownMotion(body, around), np.append(BASES[0].ravel(), 1.0)
    ends = conditions(None, None, around)
    ends.motions |= {0: FairleadMotion(known, (1.0, 2.0, -3.0)), 1: FairleadMotion(known, (-4.0, 0.5, 1.0), seat)}
    check(ends, around, (*TIMES, math.inf))
    assert (
        np.abs(ends.at_time(13.1).position[1] - PLACES[0] - known.axes @ (-4.0, 0.5, 1.0)).max() > 0.05
        or name == "at rest"
    )


@pytest.mark.long
@pytest.mark.parametrize("begin", [0.0, -5.0])
@pytest.mark.parametrize(("shift", "turn"), [(True, True), (True, False), (False, True)])
def test_files_compiled_are_python(tmp_path: Path, shift: bool, turn: bool, begin: float) -> None:
    """Before their begin, between all rows, and beyond their end, at one end and at both."""
    record = Motion(file=csv(tmp_path, "a.csv", shift, turn, begin))
    other = Motion(file=csv(tmp_path, "b.csv", False, True))
    times = (*TIMES, *np.linspace(-6.0, 31.0, 150), 29.75, 30.0)
    around = waters()
    blended = Motion(file=record.file, ramp=7.0)
    for pair in (
        (record, other),
        (blended, other),
        (None, blended),
        (other, record),
        (None, record),
        (record, KINDS["lists"]),
    ):
        check(conditions(*pair, around), around, times)


LOADS = (
    EndLoad("force", 0, np.array([1e3, -20.0, 3.0]), math.inf, None),
    EndLoad("moment", 1, np.array([1.0, 2.0, 3.0]), 9.0, 5.0),
    EndLoad("force", 1, np.array([0.0, 7.0, 3.0]), 4.0, None),
    EndLoad("force", 1, np.array([5.0, 7.0, 3.0]), math.inf, 20.0),
    EndLoad(
        "force",
        0,
        np.ones(3),
        math.inf,
        3.0,
        np.array([[0.3, 1, 2, 3], [1.7, 2, 2, 0], [12, -9, 2, 0], [20, 1, 1, 1.0]]),
    ),
    EndLoad("moment", 1, np.ones(3), 9.0, None, np.array([[-1.0, 1, 2, 3], [5.5, 2, 2, 0]])),
)


@pytest.mark.parametrize("motion", ["at rest", "harmonics"])
def test_loads_and_tangents_brought_in_compiled_are_python(motion: str) -> None:
    around = waters()
    ends = conditions(KINDS["no ramp"], None, around, held=(False, True), loads=LOADS)
    for since in (0.0, 4.0, 9.0):
        ends.set_loads(since)
        assert ends.moves().loads.shape[0] == {0.0: 6, 4.0: 5, 9.0: 3}[since]
        check(ends, around, (*TIMES, math.inf))
    ends = conditions(KINDS[motion], None, around, loads=LOADS)
    chords = (np.array([0.0, 0.6, 0.8]), np.array([1.0, 0.0, 0.0]))
    assert len(ends.bring_in(chords, (True, True), 12.0)) == 2
    check(ends, around, (*TIMES, math.inf))
    later = conditions(None, KINDS["lists"], around, loads=LOADS)
    later.go_on_from(ends, 6.0)
    check(later, around)


@pytest.mark.parametrize("ramps", [(0.0, 0.0), (7.0, 0.0), (0.0, 12.0), (5.0, 20.0)])
def test_growth_of_the_sea_compiled_is_python(ramps: tuple[float, float]) -> None:
    around, compiled = waters(ramps), waters(ramps).values
    for t in (*TIMES, math.inf):
        compiled.now[:] = np.nan
        sea_of(t, compiled)
        np.testing.assert_allclose(compiled.now, around.at_time(t).now, rtol=ROUND_OFF, atol=ROUND_OFF)


# --- how far an end turns ------------------------------------------------------------------------


def way(ends: EndConditions, a: float, b: float) -> float:
    """The integral of the angular speed of the faster end, by Simpson's rule on a fine grid."""
    speeds = np.array([np.linalg.norm(ends.at_time(t).spin, axis=1) for t in np.linspace(a, b, 2001)])
    weights = np.tile([2.0, 4.0], 1000)
    weights[0] = 1.0
    return float((np.append(weights, 1.0) @ speeds).max() * (b - a) / 6000.0)


@pytest.mark.long
@pytest.mark.parametrize("name", ["harmonics", "lists", "no ramp", "everything", "file", "blended file"])
def test_turn_is_an_upper_bound_within_a_factor(tmp_path: Path, name: str) -> None:
    """No less than the integral of the angular speed (its error: 1e-5); axes that add up, and a ramp that counts with
    its largest value, make it up to 7 times more over the first third of a ramp, and up to 3 times later."""
    around = waters()
    blend = 6.0 if name == "blended file" else None
    motion = KINDS.get(name) or Motion(file=csv(tmp_path, "a.csv", False, True), ramp=blend)
    ends = conditions(motion, None, around)
    moves = ends.moves()
    for a, b in ((0.0, 3.0), (1.0, 1.5), (2.0, 11.0), (5.0, 29.0), (8.0, 100.0)):
        exact = way(ends, a, b)
        bound = turn_of(a, b, moves)
        assert exact * (1.0 - 1e-5) <= bound <= (3.0 if a >= 2.0 and blend is None else 7.0) * exact
    if name == "no ramp":  # one axis: 4 amplitudes in a period
        assert turn_of(0.7, 5.7, moves) == pytest.approx(4.0 * math.radians(30.0), rel=1e-12)
    assert turn_of(3.0, 3.0, moves) == 0.0


def test_a_full_turn_counts_though_the_frame_is_the_same(tmp_path: Path) -> None:
    t = np.arange(0.0, 101.0)
    x = t / 100.0
    table = np.column_stack([t, 0 * t, 0 * t, 720.0 * x**3 * (10.0 - 15.0 * x + 6.0 * x**2)])
    np.savetxt(tmp_path / "two.csv", table, delimiter=",", header="t,rx,ry,rz", comments="")
    around = waters()
    moves = conditions(Motion(file=str(tmp_path / "two.csv")), None, around).moves()
    assert turn_of(0.0, 100.0, moves) == pytest.approx(4.0 * math.pi, rel=1e-6)
    assert turn_of(100.0, 300.0, moves) == 0.0
    parts = [turn_of(a, a + 2.5, moves) for a in np.arange(0.0, 100.0, 2.5)]
    assert sum(parts) == pytest.approx(4.0 * math.pi, rel=1e-6)


def test_a_tangent_brought_in_counts() -> None:
    ends = conditions(None, None, waters())
    ((_, angle),) = ends.bring_in((BASES[0] @ [0.6, 0.0, 0.8], BASES[1][:, 2]), (True, True), 12.0)
    assert turn_of(0.0, 20.0, ends.moves()) == pytest.approx(angle, rel=1e-12)


def test_a_scene_gives_arrays_of_one_type() -> None:
    """With nothing that moves and with everything: one signature of the kernel."""
    cable = {"sections": [{"length": 30.0, "mass": 1.0}]}
    still = {"start": {"kind": "pinned", "position": [0, 0, 0]}, "end": "free"}
    scene = hybrid.validate_scene({"cable": cable, "ends": still, "initial": "equilibrium", "model": "catenary"})
    from hybrid.model.build import build

    model = build(one_line(scene))
    check(model.ends, model.sea)
    check(conditions(KINDS["everything"], None, waters()), waters())
    assert len(ends_of.signatures) == 1
