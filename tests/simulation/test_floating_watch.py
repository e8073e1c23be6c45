"""What is watched in a run and told: a buoy that its lines pull under water, a torque that can throw a loop."""

from __future__ import annotations

import re
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bits import resumed
from numpy.typing import NDArray

import hybrid
from hybrid.model.build import build
from hybrid.scene.read import one_line
from hybrid.simulation.watches import Knot, Loops, crossings_of_knot, note_hockling, note_knot, note_loops
from tests.said import of_kind, texts_of
from tests.scenes import cable_scene, network_scene, pinned_at

HEIGHT = 2.0  # m


def two_chains(volume: float, **more: Any) -> dict[str, Any]:
    """A buoy of 2.5 t between two slack chains of 60 m in deep water."""
    chain = {"length": 60, "mass": 40, "diameter": 0.08, "axial_stiffness": 1.7e8, "drag": {"normal": 1.3}}
    line = {"end": "buoy", "sections": [chain], "mesh": {"cells": 20}}
    buoy = {"mass": 2500, "volume": volume, "height": HEIGHT, "shape": "cylinder"} | more
    return network_scene(
        {"east": {"position": [20, 0, -35]}, "west": {"position": [-20, 0, -35]},
         "buoy": {"initial_guess": [0, 0, 0], "drag_area": 3, "added_mass": 3000} | buoy},
        {"east": {"start": "east"} | line, "west": {"start": "west"} | line}, fluid={"density": 1025, "surface": 0},
        time=(2.0, 0.1), output=0.5
    )  # fmt: skip


def test_the_volume_that_is_named_floats_the_lines_and_a_smaller_one_does_not() -> None:
    few = hybrid.static(two_chains(3.5))
    (text,) = texts_of(few, "pulled under")
    depth = -few["points/buoy/position"][0, 2] - 0.5 * HEIGHT
    assert f"its top is {depth:.3g} m below the surface" in text and depth > 1.0
    net = 9.81 * (1025 * 3.5 - 2500)
    assert f"less its weight is {net:.4g} N at most" in text
    volume = float(re.search(r"a volume of (\S+) m\^3 would float them", text)[1])  # type: ignore[index]
    assert volume > 3.5
    floats = hybrid.static(two_chains(1.02 * volume))
    assert not texts_of(floats, "pulled under") and -0.5 * HEIGHT < floats["points/buoy/position"][0, 2] < 0.0
    assert texts_of(hybrid.static(two_chains(0.98 * volume)), "pulled under")


def test_what_is_to_stay_in_the_depth_is_not_told() -> None:
    """Without height, and first put below the surface, as a buoy of a mooring that is submerged."""
    scene = two_chains(3.5, initial_guess=[0, 0, -15], height=None)
    del scene["points"]["buoy"]["height"]
    assert not texts_of(hybrid.static(scene), "pulled under")


@pytest.mark.long  # 1.0 s
def test_a_buoy_is_told_once_in_waves_that_pass_over_it_and_again_where_it_is_much_deeper(tmp_path: Path) -> None:
    """A crest of 1 m stands over a buoy that its taut chains hold; the run that goes on does not tell it again."""
    scene = two_chains(4.0)
    scene["environment"]["fluid"]["waves"] = {"kind": "regular", "height": 2.0, "period": 8.0}
    whole = hybrid.run(scene)
    told = texts_of(whole, "pulled under")
    assert told and "and its lines pull it down by" in told[0]
    tops = [float(re.search(r"top is (\S+) m", x)[1]) for x in told]  # type: ignore[index]
    assert all(b > 3.0 * a for a, b in pairwise(tops))
    file = tmp_path / "half.h5"
    scene["time"]["duration"] = 1.0
    hybrid.run(scene, file)
    assert texts_of(hybrid.resume(file, until=2.0), "pulled under") == told


# --- torques that can throw a loop ---

EI, GJ, DIAMETER = 0.5, 0.4, 0.02


CATENARY = {"kind": "zones", "zones": [{"catenary": 4.0, "cells": 80}]}


def twisted(turns: float, over: float = 0.0, model: Any = "rod", away: float = 0.1) -> hybrid.Scene:
    """A taut cable whose clamps are twisted against each other; in a time `over`, s, its end gives way by `away`, m."""
    section = {
        "length": 4.0, "mass": 0.4, "diameter": DIAMETER, "axial_stiffness": 1e5, "bending_stiffness": EI,
        "damping": {"mass": 2.0}, "torsional_stiffness": GJ,
    }  # fmt: skip
    clamp = {"kind": "clamped", "tangent": [1, 0, 0], "normal": [0, 0, 1]}
    end = clamp | {"position": [3.995, 0, 0], "turns": turns}
    time = {}
    if over:
        end["motion"] = {"travel": {"by": [-away, 0, 0], "over": over}}
        time = {"time": {"duration": over + 2.0, "step": 0.02}, "output": {"every": 0.2, "points": 41}}
    mesh = {} if isinstance(model, dict) else {"mesh": {"cells": 80}}
    return hybrid.validate_scene(
        cable_scene(section, clamp | {"position": [0, 0, 0]}, end, gravity=2.0, model=model) | mesh | time
    )


def margins(result: hybrid.Result) -> np.ndarray:
    """(nt, ns) formation margins."""
    return np.asarray(4.0 * EI * np.maximum(result["tension"], 1e-9) / result["torque"] ** 2)


def test_an_equilibrium_with_too_much_torque() -> None:
    few, many = hybrid.static(twisted(3.0, model=CATENARY)), hybrid.static(twisted(12.0, model=CATENARY))
    assert margins(few).min() > 1.0 and not of_kind(few, "loop can form")
    (event,) = of_kind(many, "loop can form")
    assert event.value == pytest.approx(margins(many).min(), rel=1e-9) and event.value < 1.0
    assert event.s_a == pytest.approx(many.s[margins(many)[0].argmin()])
    assert event.threshold == 1.0
    for part in ("N m", "M^2/(4 EI)", "opens", "friction"):
        assert part in event.text


@pytest.mark.parametrize(("model", "over"), [("rod", 0.5), (CATENARY, 6.0)], ids=["rod", "catenary"])
def test_a_run_that_slackens(model: Any, over: float) -> None:
    """The first event is soon after the first output with a margin below 1, others follow at a third of it."""
    result = hybrid.run(twisted(5.0, over, model))
    least = margins(result).min(axis=1)
    assert least[0] > 1.0 > least.min()
    events = of_kind(result, "loop can form")
    first = int(np.argmax(least < 1.0))
    at = int(np.argmin(np.abs(result.times - events[0].t)))
    assert 0 <= at - first <= 2  # the stretch must be long enough
    assert events[0].value == pytest.approx(least[at], rel=1e-6)
    assert all(b.value <= a.value / 3.0 for a, b in pairwise(events))
    assert len(events) < 12
    assert not of_kind(hybrid.run(twisted(0.5, over, model)), "loop can form")


def test_a_loop_that_forms() -> None:
    """Slowly, a rod follows its loop with a margin above 1: the writhe says that there is one, and where."""
    result = hybrid.run(twisted(6.0, 6.0, away=0.8))
    found = [event for event in result.events if event.kind == "loop formed"]
    writhe = np.abs(result["turns/writhe"] - result["turns/writhe"][0])
    first = int(np.argmax(writhe > 0.75))
    assert writhe.max() > 0.75 and found[0].t == pytest.approx(result.times[first])
    assert found[0].s_a == pytest.approx(result.s[result["curvature"][first].argmax()])
    assert len(found) < 5
    lost = 6.0 - result["turns/link"][:]  # two turns wherever it passes through itself, to round-off
    np.testing.assert_allclose(lost, 2.0 * np.round(0.5 * lost), atol=1e-9)
    assert bool(np.round(lost).any()) == any(event.kind == "line meets itself" for event in result.events)
    assert not [event for event in hybrid.run(twisted(0.5, 6.0)).events if event.kind == "loop formed"]


FIXED, ZONES = {"duration": 5.0, "step": 0.02}, [{"rod": 3.0, "cells": 60}, {"catenary": 1.0, "cells": 10}]


@pytest.mark.parametrize(
    ("model", "time"),
    [("rod", FIXED), ("rod", {"duration": 5.0}), ({"kind": "zones", "zones": ZONES}, FIXED), ("adaptive", FIXED)],
    ids=["rod", "rod whose steps follow", "zones", "zones that move"],
)
def test_a_loop_that_forms_slowly_is_foreseen(model: Any, time: dict[str, float]) -> None:
    """The straight line is left at a margin below 1 in an ever shorter stretch: no output of it was long enough."""
    tables = twisted(6.0, 6.0, model if isinstance(model, dict) else "rod", away=0.8)
    data = tables.model_dump(mode="python", exclude_unset=True) | {"model": model, "time": time}
    result = hybrid.run(data)
    (formed, *_) = [event for event in result.events if event.kind == "loop formed"]
    first, least = of_kind(result, "loop can form")[0], margins(result).min(axis=1)
    assert 0.9 < first.value < 1.0 and first.t < formed.t - 1.5
    assert first.t <= result.times[int(np.argmax(least < 1.0))] + 0.45  # the stretch must be long enough


def test_a_stretch_that_the_torque_alone_cannot_bend_is_too_short() -> None:
    """Greenhill: a pinned line without tension, of length l, is bent by M = 2 pi EI/l."""
    model, s = build(one_line(twisted(0.0))), np.linspace(0.0, 4.0, 401)
    torque, found = np.full((1, 401), 6.0), []
    for length in (0.95, 1.05):
        tension = np.full((1, 401), 20.0)  # needed: 18 N
        tension[0, np.abs(s - 2.0) < 0.5 * length * 2.0 * np.pi * EI / 6.0 - 0.01] = 17.9
        values = {"torque": torque, "tension": tension}
        note_hockling(model, np.zeros(1), values, s, 1.0, lambda *x, **y: found.append((x[0], y["value"])))
        assert len(found) == (length > 1.0)
    assert found[0][1] == pytest.approx(17.9 / 18.0)


def told_of(writhe: list[float], bends: list[float], batches: int = 1) -> list[tuple[float, str, str]]:
    """Times, kinds and texts of the events of a line of 3 points, whose middle bends, in batches of outputs."""
    found: list[tuple[float, str, str]] = []
    t, s, known = np.arange(float(len(writhe))), np.array([0.0, 1.0, 2.0]), Loops()
    curvature = np.outer(bends, [0.0, 1.0, 0.5])
    tension = 10.0 * (1.0 + t[:, None]) + s  # N, largest at the end
    for part in np.array_split(np.arange(t.size), batches):
        values = {"turns/writhe": np.array(writhe)[part], "curvature": curvature[part], "tension": tension[part]}

        def event(t: float, a: float, b: float, kind: str, text: str, **more: float) -> None:
            found.append((t, kind, text))

        known = note_loops(t[part], values, s, known, event)
    return found


def test_a_loop_that_opens_is_told_with_its_pull_and_its_least_radius() -> None:
    """It forms at 2 s, is bent to 1/8 m at 3 s and open at 5 s, and another forms; in batches as at once."""
    writhe = [0.0, 0.5, 1.0, 1.0, 0.5, 0.1, 0.6, 0.9]
    bends = [1.0, 2.0, 4.0, 8.0, 6.0, 1.0, 2.0, 3.0]
    found = told_of(writhe, bends)
    assert [(t, kind) for t, kind, _ in found] == [(2.0, "loop formed"), (5.0, "loop opened"), (7.0, "loop formed")]
    assert "radius of 0.125 m" in found[1][2] and "tension along the line is 62 N" in found[1][2]
    assert found == told_of(writhe, bends, 3) == told_of(writhe, bends, 8)
    assert not told_of([0.0, 0.5, 0.7, 0.1], [1.0] * 4)


def test_a_loop_that_is_there_from_the_start_opens_and_another_forms() -> None:
    found = told_of([1.0, 0.9, 0.1, 0.2, 1.0], [1.0] * 5)
    assert [(t, kind) for t, kind, _ in found] == [(2.0, "loop opened"), (4.0, "loop formed")]


def test_a_run_that_is_resumed_in_a_loop_tells_that_it_opens(tmp_path: Path) -> None:
    """The end comes back: the writhe is that of the start again, from one output on, and the event says so once."""
    times = np.arange(0.0, 14.05, 0.1)
    away = 0.4 * (1.0 - np.cos(np.pi * np.clip(np.minimum(times, 12.0 - times), 0.0, 5.0) / 5.0))
    rows = [f"{t},{x},0,0\n" for t, x in zip(times, 3.995 - away, strict=True)]
    (tmp_path / "away.csv").write_text("t,x,y,z\n" + "".join(rows))
    scene = twisted(6.0, 6.0, away=0.8)
    tables = scene.model_dump(mode="python", exclude_unset=True)
    tables["ends"]["end"]["motion"] = {"file": str(tmp_path / "away.csv")}
    tables["time"]["duration"] = 7.0
    hybrid.run(tables, tmp_path / "loop.h5")
    whole = hybrid.resume(tmp_path / "loop.h5", until=14.0)
    writhe = np.abs(whole["turns/writhe"] - whole["turns/writhe"][0])
    formed, opened = ([x for x in whole.events if x.kind == f"loop {word}"] for word in ("formed", "opened"))
    assert writhe.max() > 0.75 and formed[0].t < 7.0 and len(opened) == 1
    k = int(np.flatnonzero(whole.times > formed[-1].t)[np.argmax(writhe[whole.times > formed[-1].t] < 0.375)])
    assert opened[0].t == pytest.approx(whole.times[k]) and opened[0].value == pytest.approx(whole["tension"][k].max())
    since = (whole.times >= formed[0].t) & (whole.times <= whole.times[k])
    assert f"radius of {1.0 / whole['curvature'][since].max():.3g} m" in opened[0].text


# --- A line that meets itself is told of, with both places, the time and the distance; one that does not is not ---

KEYS = [f"self_distance/{name}" for name in ("clearance", "distance", "s_a", "s_b", "time")]


def hanging(end: list[float], diameter: float | None = 0.02, **more: Any) -> dict[str, Any]:
    """A line of 4 m from the origin to an end (m)."""
    section = {"length": 4.0, "mass": 0.4, "axial_stiffness": 1e4, "bending_stiffness": 1e-3, "damping": {"mass": 1.0}}
    if diameter is not None:
        section["diameter"] = diameter
    return (
        cable_scene(section, pinned_at(0, 0, 0), {"kind": "pinned", "position": end}, model="catenary", mesh=60) | more
    )


def test_an_end_that_is_led_through_the_line(tmp_path: Path) -> None:
    """A run that is stopped after it has been said goes on with the least clearance, and does not say it again."""
    scene = hanging(
        [0.6, 0, -1.0], model="rod", time={"duration": 4.0, "step": 0.02}, output={"every": 0.02, "points": 101},
        contact={"self": False},
    )  # fmt: skip
    scene["ends"]["end"]["motion"] = {"travel": {"by": [-1.2, 0, 0], "over": 4.0}}
    result = resumed(scene, tmp_path, 3.0)
    first = of_kind(result, "line meets itself")[0]
    assert first.s_a < 1.4 and first.s_b > 3.9  # the end, and the leg of the start, which hangs 1 m deep there
    assert first.value < first.threshold == pytest.approx(0.02)
    near = np.linalg.norm(result["position"][:, 20:31] - result["position"][:, -1:], axis=2).min(axis=1)
    assert abs(result.times[np.argmin(near)] - first.t) < 0.2
    clearance, distance, s, other, t = (float(result[key]) for key in KEYS)
    assert clearance == pytest.approx(distance - 0.02) and distance <= first.value
    assert (s, other) == pytest.approx((first.s_a, first.s_b), abs=0.3) and abs(t - first.t) < 0.5


def test_a_line_that_hangs_is_not_told_of() -> None:
    result = hybrid.run(hanging([3.0, 0, 0], time={"duration": 0.2, "step": 0.1}))
    assert not of_kind(result, "line meets itself")
    assert all(np.isnan(result[key]) for key in KEYS)


def test_legs_of_an_equilibrium_that_are_in_each_other() -> None:
    assert not of_kind(hybrid.static(hanging([0.1, 0, -0.5], diameter=0.02)), "line meets itself")
    found = of_kind(hybrid.static(hanging([0.1, 0, -0.5], diameter=0.09)), "line meets itself")
    assert len(found) == 1 and found[0].value < 0.09


def test_without_a_diameter_there_is_nothing_to_look_for() -> None:
    result = hybrid.static(hanging([0.1, 0, -0.5], diameter=None))
    assert not of_kind(result, "line meets itself") and not any(key in result for key in KEYS)


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


@pytest.mark.parametrize("away", [(-0.3, -0.2, 0.5), (0.3, 0.4, 0.7), (0.0, 0.0, 0.6)])
def test_a_knot_is_one_where_an_end_goes_back_into_its_middle(away: tuple[float, ...]) -> None:
    """The end goes straight on from there, away from the middle: far enough that it is not left within the knot."""
    t = np.linspace(-2.05, 2.05, 60)
    knot = np.column_stack([t**3 - 3 * t, -(t**4 - 4 * t**2), (t**5 - 10 * t) / 20])
    pulled = knot[-1] + 30.0 * (knot[-1] - knot[-2])
    assert crossings_of_knot(np.vstack([knot, pulled, knot.mean(axis=0) + away])) == 3


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
    found = of_kind(result, "line leaves the sheave")
    assert len(expected) == 2
    assert [e.t for e in found] == pytest.approx(expected)
    assert all(abs(e.s_a - 2.01) < 0.2 and "leaves wheel" in e.text and "farther out" in e.text for e in found)


def test_a_run_that_is_resumed_knows_where_the_line_lay(tmp_path: Any) -> None:
    whole = of_kind(hybrid.run(over_a_sheave()), "line leaves the sheave")
    simulation = hybrid.Simulation(over_a_sheave(), tmp_path / "run.h5")
    simulation.advance(whole[0].t - 0.12)
    kept = simulation.save()
    simulation.advance(whole[0].t + 0.2)
    simulation.restore(kept)
    simulation.advance(whole[0].t + 0.2)
    found = of_kind(simulation.result(), "line leaves the sheave")
    assert [(e.t, e.s_a, e.text) for e in found] == [(whole[0].t, whole[0].s_a, whole[0].text)]
