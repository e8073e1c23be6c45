"""A line that meets itself is told of, with both places, the time and the distance; one that does not is not."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import hybrid
from hybrid.simulation.watches import Knot, crossings_of_knot, note_knot
from tests.scenes import cable_scene, line_between, network_scene, pinned_at

KEYS = [f"self_distance/{name}" for name in ("clearance", "distance", "s_a", "s_b", "time")]


def hanging(end: list[float], diameter: float | None = 0.02, **more: Any) -> dict[str, Any]:
    """A line of 4 m from the origin to an end (m)."""
    section = {"length": 4.0, "mass": 0.4, "axial_stiffness": 1e4, "bending_stiffness": 1e-3, "damping": {"mass": 1.0}}
    if diameter is not None:
        section["diameter"] = diameter
    return (
        cable_scene(section, pinned_at(0, 0, 0), {"kind": "pinned", "position": end}, model="catenary", mesh=60) | more
    )


def meetings(result: hybrid.Result) -> list[Any]:
    return [event for event in result.events if event.kind == "line meets itself"]


def test_an_end_that_is_led_through_the_line() -> None:
    scene = hanging(
        [0.6, 0, -1.0], model="rod", time={"duration": 4.0, "step": 0.02}, output={"every": 0.02, "points": 101},
        contact={"self": False},
    )  # fmt: skip
    scene["ends"]["end"]["motion"] = {"travel": {"by": [-1.2, 0, 0], "over": 4.0}}
    result = hybrid.run(scene)
    first = meetings(result)[0]
    assert first.s_a < 1.4 and first.s_b > 3.9  # the end, and the leg of the start, which hangs 1 m deep there
    assert first.value < first.threshold == pytest.approx(0.02)
    near = np.linalg.norm(result["position"][:, 20:31] - result["position"][:, -1:], axis=2).min(axis=1)
    assert abs(result.times[np.argmin(near)] - first.t) < 0.2
    clearance, distance, s, other, t = (float(result[key]) for key in KEYS)
    assert clearance == pytest.approx(distance - 0.02) and distance <= first.value
    assert (s, other) == pytest.approx((first.s_a, first.s_b), abs=0.3) and abs(t - first.t) < 0.5


def test_a_line_that_hangs_is_not_told_of() -> None:
    result = hybrid.run(hanging([3.0, 0, 0], time={"duration": 0.2, "step": 0.1}))
    assert not meetings(result)
    assert all(np.isnan(result[key]) for key in KEYS)


def test_legs_of_an_equilibrium_that_are_in_each_other() -> None:
    assert not meetings(hybrid.static(hanging([0.1, 0, -0.5], diameter=0.02)))
    found = meetings(hybrid.static(hanging([0.1, 0, -0.5], diameter=0.09)))
    assert len(found) == 1 and found[0].value < 0.09


def test_without_a_diameter_there_is_nothing_to_look_for() -> None:
    result = hybrid.static(hanging([0.1, 0, -0.5], diameter=None))
    assert not meetings(result) and not any(key in result for key in KEYS)


# --- a line of several ---

HOSE = {
    "length": 50, "mass": 3.0, "diameter": 0.03, "axial_stiffness": 1e6, "bending_stiffness": 10,
    "drag": {"normal": 1.2, "tangential": 0.05}, "added_mass": {"normal": 1.0},
}  # fmt: skip
SEA = {"fluid": {"density": 1025}}
TRAVEL = {"travel": {"by": [0, 0, -45], "over": 20}}
TIME = {"duration": 22.0, "step": 0.1}
LOWER, UPPER = [0, 0, -49.9], [0.5, 0, 0]


def lowered(duration: float = TIME["duration"]) -> dict[str, Any]:
    """A hose whose upper end is lowered until it lies across itself, and a rope beside it that stays straight."""
    rope = {"start": "deck", "end": "ground", "sections": [{"length": 49, "mass": 1.0, "diameter": 0.02}]}
    return network_scene(
        {"low": {"position": LOWER}, "high": {"position": UPPER, "motion": TRAVEL}, "deck": {"position": [9, 0, 0]},
         "ground": {"position": [9, 0, -49.9]}},
        {"hose": line_between("low", "high", HOSE, model="rod", mesh=40, contact={"self": False}),
         "rope": rope | {"mesh": {"cells": 10}, "sections": [rope["sections"][0] | {"axial_stiffness": 1e5}]}},
        environment=SEA, time=TIME | {"duration": duration}, output=1.0
    )  # fmt: skip


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("itself") / "hose.h5"
    hybrid.run(lowered(), path, progress=False).close()
    return path


def test_a_line_that_meets_itself_says_so(file: Path) -> None:
    with hybrid.open(file) as result:
        met = [[x for x in line.events if x.kind == "line meets itself"] for line in result.lines.values()]
        assert met[0] and not met[1] and float(result.lines["hose"]["self_distance/clearance"]) < 0.0


@pytest.mark.long
def test_a_run_that_goes_on_knows_of_it(file: Path, tmp_path: Path) -> None:
    """The least clearance, and that it has been told, are in the checkpoint."""
    with hybrid.open(file) as whole:
        (first, *_) = [event.t for event in whole.lines["hose"].events if event.kind == "line meets itself"]
        middle = round(0.5 * (first + 22.0), 1)
        hybrid.run(lowered(middle), tmp_path / "part.h5", progress=False).close()
        with hybrid.resume(tmp_path / "part.h5", until=22.0) as more:
            for name in ("clearance", "s_a", "s_b", "time"):
                one, other = (x.lines["hose"][f"self_distance/{name}"] for x in (whole, more))
                assert float(one) == pytest.approx(float(other), rel=1e-9)
            counts = [sum(event.kind == "line meets itself" for event in x.lines["hose"].events) for x in (whole, more)]
            assert counts[0] == counts[1]


# --- knots, and lines that leave a sheave ---

Floats = NDArray[np.float64]
ROUND = np.linspace(0.0, 2.0 * np.pi, 300, endpoint=False)


def of_torus(p: int, q: int) -> Floats:
    """A closed curve p times around an axis and q times around a ring about it."""
    out = 2.0 + np.cos(q * ROUND)
    return np.column_stack([out * np.cos(p * ROUND), out * np.sin(p * ROUND), np.sin(q * ROUND)])


def opened(closed: Floats) -> Floats:
    """A closed curve, cut open where it is farthest out, both ends led away there."""
    out = closed - closed.mean(axis=0)
    at = int(np.argmax(np.linalg.norm(out, axis=1)))
    away = out[at] / np.linalg.norm(out[at])
    turned = np.roll(closed, -at, axis=0)
    aside = np.cross(away, [0.1, 0.2, 1.0])
    aside *= np.sign((turned[1] - turned[-1]) @ aside)
    return np.vstack([turned[0] + 20 * away + 3 * aside, turned, turned[-1] + 20 * away - 3 * aside])


EIGHT = (2.0 + np.cos(2 * ROUND)) * np.array([np.cos(3 * ROUND), np.sin(3 * ROUND)])


@pytest.mark.parametrize(
    ("curve", "expected"),
    [
        (of_torus(2, 3), 3),
        (np.column_stack([*EIGHT, np.sin(4 * ROUND)]), 4),  # figure eight
        (of_torus(2, 5), 5),
        (of_torus(2, 7), 7),
        (of_torus(3, 4), 8),
        (of_torus(1, 5), 0),
        (of_torus(5, 1), 0),
    ],
    ids=["trefoil", "figure eight", "cinquefoil", "seven", "eight", "coil", "turns of a coil"],
)
def test_crossings_are_those_of_the_table_of_knots(curve: Floats, expected: int) -> None:
    line = opened(curve)
    turn, _ = np.linalg.qr(np.random.default_rng(3).normal(size=(3, 3)))
    assert crossings_of_knot(line) == expected
    assert crossings_of_knot(line[::-1] @ turn) == expected


def drawn(size: float) -> tuple[Floats, Floats]:
    """Arc lengths (n,) and nodes (n, 3), m, of a line of 10 m with a trefoil in its middle, `size` times as large."""
    t = np.linspace(-2.05, 2.05, 60)
    knot = size * np.column_stack([t**3 - 3 * t, -(t**4 - 4 * t**2), (t**5 - 10 * t) / 20])
    out = [(a - b) / np.linalg.norm(a - b) for a, b in ((knot[0], knot[1]), (knot[-1], knot[-2]))]
    inside = np.linalg.norm(np.diff(knot, axis=0), axis=1).sum()
    ways = np.linspace(0.5 * (10.0 - inside), 0.02, 20)[:, None]
    r = np.vstack([knot[0] + ways * out[0], knot, knot[-1] + ways[::-1] * out[1]])
    return np.append(0.0, np.cumsum(np.linalg.norm(np.diff(r, axis=0), axis=1))), r


def test_a_knot_that_tightens_is_told_at_every_half_with_its_place() -> None:
    told: list[tuple[Any, ...]] = []

    def event(*which: Any, **more: Any) -> None:
        told.append((*which, more))

    known, sizes = Knot(), [0.2, 0.13, 0.09, 0.07, 0.04]
    for k, size in enumerate(sizes):
        s, r = drawn(size)
        known = note_knot(float(k), s, r, np.where(np.abs(s - 5.0) < 9.0 * size, 1.0, 0.0), known, event)
    assert [(t, kind) for t, _, _, kind, *_ in told] == [(2.0, "knot tightens"), (4.0, "knot tightens")]
    for t, first, last, _, text, more in told:
        assert first < 5.0 < last and more["value"] == pytest.approx(last - first)
        assert more["value"] < more["threshold"] and "of 3 crossings" in text
        assert 10.0 * sizes[int(t)] < last - first < 20.0 * sizes[int(t)]


def test_a_line_that_only_rises_along_its_course_has_no_knot() -> None:
    told: list[tuple[Any, ...]] = []
    s, r = drawn(0.2)
    r[:, 2] = 0.1 * s
    known = Knot()
    for size in (1.0, 0.3):
        known = note_knot(0.0, s, size * r, np.ones(len(s)), known, lambda *x, **_: told.append(x))
    assert not known.crossings and not told


def over_a_sheave(**more: Any) -> dict[str, Any]:
    """A rope of 4.02 m whose span a sheave lifts, goes down from, and comes back to, twice in 8 s."""
    section = {"length": 4.02, "mass": 1.0, "diameter": 0.02, "axial_stiffness": 1e5, "bending_stiffness": 0.5}
    sheave = {"kind": "sheave", "at": [0, 0, -0.3], "axis": [0, 1, 0], "radius": 0.3, "groove": 0.03, "rim": 0.02}
    sheave["motion"] = {"heave": {"amplitude": 0.3, "period": 4.0}, "ramp": 1.0}
    return cable_scene(
        section | {"damping": {"mass": 1.0}}, pinned_at(-2, 0, 0), pinned_at(2, 0, 0), obstacles={"wheel": sheave},
        initial={"kind": "equilibrium",
                 "points": [[-2, 0, 0], [-0.2, 0, -0.05], [0, 0, 0.02], [0.2, 0, -0.05], [2, 0, 0]]},
        model="rod", mesh=80, time=(8.0, 0.01), output=(0.05, 161)
    ) | more  # fmt: skip


def departures(result: Any) -> list[Any]:
    return [e for e in result.events if e.kind == "line leaves the sheave"]


@pytest.mark.long
def test_a_line_leaves_a_sheave_and_comes_back() -> None:
    result = hybrid.run(over_a_sheave())
    place = result["obstacles/wheel/position"]
    out = np.linalg.norm((result.position - place[:, None])[:, :, [0, 2]], axis=2).min(axis=1)
    off = out > 0.3 + 0.03 + 0.02 + 1e-9  # beyond the rims
    lies = out < 0.3 + 0.011
    expected, on = [], False
    for t, lying, gone in zip(result.times, lies, off, strict=True):
        if on and gone:
            expected.append(t)
        on = lying or (on and not gone)
    found = departures(result)
    assert len(expected) == 2
    assert [e.t for e in found] == pytest.approx(expected)
    assert all(abs(e.s_a - 2.01) < 0.2 and "leaves wheel" in e.text and "farther out" in e.text for e in found)


def test_a_run_that_is_resumed_knows_where_the_line_lay(tmp_path: Any) -> None:
    whole = departures(hybrid.run(over_a_sheave()))
    simulation = hybrid.Simulation(hybrid.validate_scene(over_a_sheave()), tmp_path / "run.h5")
    simulation.advance(whole[0].t - 0.12)
    kept = simulation.save()
    simulation.advance(whole[0].t + 0.2)
    simulation.restore(kept)
    simulation.advance(whole[0].t + 0.2)
    found = departures(simulation.result())
    assert [(e.t, e.s_a, e.text) for e in found] == [(whole[0].t, whole[0].s_a, whole[0].text)]
