"""Equilibria that settle with friction on the seabed: pulled tight from where the line would lie without tension."""

from __future__ import annotations

import math
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from random_scenes import random_network

import hybrid
from hybrid.errors import Outcome
from hybrid.scene.analysis import RodModel
from hybrid.scene.root import in_full
from hybrid.solve.stepper import LineFailed
from tests.scenes import cable_scene, line_between, network_scene, pinned_at

EXAMPLES = Path(__file__).parents[2] / "examples"
DEFECTS = Path(__file__).parents[1] / "data" / "defects"
MU, WEIGHT, EA = 0.8, 1000.0, 6.0e8
NEGLECTED = {"kind": "equilibrium", "friction": "neglected"}


def chain(length: float = 700.0, stiffness: float = EA, cells: int = 1400, **changes: Any) -> dict[str, Any]:
    """A plain chain from an anchor over the bed to a point above it; WEIGHT N per m in water."""
    diameter = 0.15
    mass = WEIGHT / 9.81 + 1000.0 * math.pi * diameter**2 / 4.0
    section = {"length": length, "mass": mass, "diameter": diameter, "axial_stiffness": stiffness}
    return cable_scene(
        section, pinned_at(0, 0, 0), pinned_at(0.936 * length, 0, 88.0), gravity=9.81,
        fluid={"density": 1000.0, "surface": 100.0}, seabed={"z": 0.0, "stiffness": 5.0e4, "friction": MU},
        initial={"kind": "equilibrium", "friction": "settled"}, mesh=cells, model="catenary",
        output={"errors": False, "points": 701}, time={"duration": 10.0}
    ) | changes  # fmt: skip


def static(scene: dict[str, Any]) -> hybrid.Result:
    return hybrid.static(hybrid.validate_scene(scene))


def test_tension_falls_as_friction_that_sticks_says() -> None:
    """Where the travel is below its largest, T'' = (mu w/EA l) T: T falls by e over sqrt(EA l/(mu w)), l = D/100."""
    result = static(chain())
    T = np.ravel(result.tension)
    s = result.s
    fall = math.sqrt(EA * 0.0015 / (MU * WEIGHT))
    middle = (s > 380.0) & (s < 480.0)
    slope = np.polyfit(s[middle], np.log(T[middle]), 1)[0]
    assert slope == pytest.approx(1.0 / fall, rel=5e-3)
    assert T.min() < 1e-3 * T.max()


def test_tension_falls_by_mu_w_where_the_line_slides() -> None:
    """A soft line slides over most of the way to touchdown: T' = mu w there."""
    result = static(chain(stiffness=5.0e6))
    T, s = np.ravel(result.tension), result.s
    slides = (s > 535.0) & (s < 562.0)  # touchdown is at 572 m
    assert np.polyfit(s[slides], T[slides], 1)[0] == pytest.approx(MU * WEIGHT, rel=1e-6)
    assert abs(T[300]) < 1e-3  # friction holds what lies farther in: no tension, and no compression


def test_lateral_place_is_that_of_the_equilibrium_without_friction() -> None:
    """What does not stretch has no travel: settled and neglected friction give the same line."""
    settled = static(chain(stiffness=None, cells=200))
    plain = static(chain(stiffness=None, cells=200, initial=NEGLECTED))
    assert np.abs(settled.position - plain.position).max() < 1e-9
    assert settled.tension == pytest.approx(plain.tension, rel=1e-9)


def test_a_stretch_between_two_hanging_ones_keeps_its_middle() -> None:
    """A line whose two ends hang lies on the bed between: tension falls towards the middle from both sides."""
    scene = chain(length=1000.0, cells=1000)
    scene["ends"] = {"start": pinned_at(0, 0, 88.0), "end": pinned_at(900, 0, 88.0)}
    result = static(scene)
    T = np.ravel(result.tension)
    assert T[500 * 701 // 1001 :][::-1] == pytest.approx(T[: T.size - 500 * 701 // 1001], rel=1e-5, abs=0.1)
    assert T.min() < 1e-3 * T.max()


def test_compression_that_friction_holds_is_told_and_does_not_stop_the_run() -> None:
    """The anchor is pushed towards the line: what lies there is compressed, by less than friction bears."""
    scene = chain(cells=140)
    scene["ends"]["start"]["motion"] = {"surge": [{"amplitude": 5e-5, "period": 10.0}], "ramp": 2.0}
    result = hybrid.run(hybrid.validate_scene(scene))
    told = [event for event in result.events if event.kind == "slack"]
    assert told and "friction holds it on the seabed" in told[0].text
    assert -MU * WEIGHT * 5.0 < result.tension.min() < 0.0


@pytest.mark.parametrize(("friction", "bending"), [(0.8, "null"), (0.3, "null"), (0.8, "2.0e+4")])
def test_a_chain_finds_its_settled_friction(friction: float, bending: str) -> None:
    """The chain for which 0.5.0 found none; what lies beside the anchor bears its weight."""
    settings = ["initial={kind: equilibrium, friction: settled}", f"environment.seabed.friction={friction}"]
    settings.append(f"cable.sections[0].bending_stiffness={bending}")
    result = hybrid.static(hybrid.load_scene(DEFECTS / "chain_friction_settled.yaml", settings))
    assert np.ravel(result["contact_force"])[1:20] == pytest.approx(1203.0, rel=0.01)  # N/m


def with_a_limit(**changes: Any) -> dict[str, Any]:
    """A short chain of few cells whose tension may be far more than it is, with errors."""
    scene = chain(length=430.0, cells=60, stiffness=5e6, time={"duration": 0.2, "step": 0.05}, **changes)
    scene["cable"]["sections"][0]["max_tension"] = 1e8
    scene["output"] = {"every": 0.1, "points": 41, "errors": True}
    return scene


def verdicts(result: hybrid.Result) -> list[tuple[str, str]]:
    return [(x.verdict, x.why) for x in result.verdicts().limits]


def test_a_run_is_as_doubtful_as_the_equilibrium_that_it_starts_from() -> None:
    """Friction is missing in both, or in neither; a chain that hangs free misses none."""
    neglected = with_a_limit(initial=NEGLECTED)
    doubt = [("not verified", "static friction neglected")]
    assert verdicts(static(neglected)) == verdicts(hybrid.run(hybrid.validate_scene(neglected))) == doubt
    settled = with_a_limit()
    for result in (static(settled), hybrid.run(hybrid.validate_scene(settled))):
        assert not any("friction" in why for _, why in verdicts(result))
    hangs = with_a_limit(initial=NEGLECTED)
    hangs["environment"]["seabed"]["z"] = -200.0
    hangs["cable"]["sections"][0]["axial_stiffness"] = EA
    found = static(hangs)
    assert verdicts(found) == [("within", "")] and not any("friction" in x.kind for x in found.events)


def test_the_friction_of_several_lines_settles_by_the_key_that_is_named() -> None:
    line = hybrid.static(in_full(hybrid.validate_scene(with_a_limit(initial=NEGLECTED)))).lines["cable"]
    (event,) = [x for x in line.events if x.kind == "static friction neglected"]
    assert "say `lines.cable.initial: {kind: equilibrium, friction: settled}`" in event.text
    (limit,) = line.verdicts().limits
    assert limit.verdict == "not verified" and limit.remedy.startswith("lines.cable.initial: {")


@pytest.mark.parametrize("model", ["catenary", "adaptive"])
def test_a_motion_has_the_friction_of_the_equilibrium_that_it_begins_with(model: str) -> None:
    """Zones that move come to rest with friction from the rod's."""
    scene = chain(cells=100, time={"duration": 1.0, "step": 0.05}, output={"every": 0.5, "points": 141, "exact": True})
    scene["ends"]["end"]["motion"] = {"heave": {"amplitude": 1.0, "period": 6.0}, "ramp": 3.0}
    if model == "adaptive":
        scene["model"] = {"kind": "adaptive", "hold_time": 0.5}
        scene["cable"]["sections"][0]["bending_stiffness"] = 1e4
    found = hybrid.run(hybrid.validate_scene(scene))
    assert "friction" in found.attributes["static_path"] and found.tension[0].min() < 1e-2 * found.tension[0].max()
    assert "static friction neglected" not in {event.kind for event in found.events}


def buoy(friction: str | None) -> dict[str, Any]:
    """A buoy on three soft legs of chain; friction: None leaves it to the program."""
    (section,) = chain(length=430.0, stiffness=5e6)["cable"]["sections"]
    feet = {f"foot{k}": {"position": [400 * math.cos(2.1 * k), 400 * math.sin(2.1 * k), 0]} for k in range(3)}
    buoy = {"initial_guess": [0, 0, 85], "mass": 2e5, "volume": 560.0, "drag_area": 20, "force": [3e4, 0, 0]}
    initial = {"kind": "equilibrium"} | ({"friction": friction} if friction else {})
    line = {"end": "buoy", "sections": [section], "mesh": {"cells": 100}, "model": "catenary", "initial": initial}
    return network_scene(
        feet | {"buoy": buoy}, {f"leg{k}": line | {"start": foot} for k, foot in enumerate(feet)},
        environment=chain()["environment"], time=(10.0, 0.1), output=(5.0, 101)
    )  # fmt: skip


def test_a_buoy_on_lines_with_settled_friction_stays_where_it_is() -> None:
    """Soft lines slide: tension falls by mu w along the bed, to nothing at the anchors; without friction it does not."""
    found = hybrid.run(buoy(None))
    place = found["points/buoy/position"]
    assert np.abs(place - place[0]).max() < 1e-7
    for leg in found.lines.values():
        assert np.abs(leg.position - leg.position[0]).max() < 1e-6
        low, high = np.searchsorted(leg.tension[0], [0.1 * leg.tension[0].max(), 0.3 * leg.tension[0].max()])
        slope = np.diff(leg.tension[0][low:high]) / np.diff(leg.s[low:high])
        assert leg.tension[0, 0] < 1e-3 * leg.tension[0].max() and slope == pytest.approx(MU * WEIGHT, rel=1e-4)
    assert min(leg.tension[-1].min() for leg in hybrid.static(buoy("neglected")).lines.values()) > 5e4


def anchored(friction: str | None, **changes: Any) -> dict[str, Any]:
    """A chain of 430 m at an anchor; friction: None leaves it to the program."""
    scene = chain(length=430.0, cells=86, output={"every": 20.0, "points": 87}, **changes)
    scene["initial"] = {"kind": "equilibrium"} | ({"friction": friction} if friction else {})
    return scene


def test_friction_settles_where_a_scene_says_nothing_of_it() -> None:
    """To the bit as where it is asked for; a limit is judged."""
    silent = anchored(None)
    silent["cable"]["sections"][0]["max_tension"] = 1e7
    found, other = static(anchored("settled")), static(silent)
    np.testing.assert_array_equal(other.tension, found.tension)
    assert other.tension[0, 0] < 0.1 * other.tension[0, -1] and not other.events
    assert [x.verdict for x in other.verdicts().limits] == ["within"]


@pytest.mark.long
def test_a_chain_that_is_pulled_out_comes_to_its_settled_friction() -> None:
    """From slack on the bed, in 300 s; without friction the anchor has fifteen times as much (docs/theory.md, 6)."""
    settled, neglected = (np.ravel(static(anchored(x)).tension) for x in (None, "neglected"))
    scene = anchored(None, time={"duration": 320.0, "step": 0.2})
    scene["environment"]["seabed"]["damping"] = 1e3
    scene["cable"]["sections"][0]["drag"] = {"normal": 1.2, "tangential": 0.1}
    end = scene["ends"]["end"]
    end["position"][0] -= 12.0
    end["motion"] = {"travel": {"by": [12.0, 0, 0], "over": 300}}
    pulled = hybrid.run(hybrid.validate_scene(scene)).tension[-1]
    assert settled == pytest.approx(pulled, rel=0.03) and settled[-1] == pytest.approx(pulled[-1], rel=1e-5)
    assert neglected[0] > 15.0 * pulled[0]


@pytest.mark.long
def test_a_chain_that_a_winch_lays_under_tension_keeps_it() -> None:
    """100 m of it, with the tension at the top that the whole has there without friction: nothing slides."""
    neglected = np.ravel(static(anchored("neglected")).tension)
    scene = anchored(None, time={"duration": 300.0, "step": 0.1})
    scene["environment"]["seabed"]["damping"] = 1e3
    (section,), end = scene["cable"]["sections"], scene["ends"]["end"]
    section["length"], scene["mesh"]["cells"] = 430.0 - 100.0 / (1.0 + neglected[0] / EA), 66
    end["position"][0] = 0.936 * 430.0 - 100.0
    end["motion"] = {"travel": {"by": [100.0, 0, 0], "over": 250}}
    winch = {"tension": float(neglected[-1]), "inertia": 3000.0, "damping": 3000.0, "max_rate": 3.0, "ramp": 5.0}
    end["payout"] = {"longest": 431.0, "winch": winch}
    laid = hybrid.run(hybrid.validate_scene(scene)).tension[-1]
    assert laid[0] == pytest.approx(neglected[0], rel=0.01)


@pytest.mark.parametrize("several", [False, True])
def test_friction_that_cannot_settle_is_neglected_with_a_word(several: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """No equilibrium is found where a pull leads: of a cable, and of legs of a buoy, it is that without friction."""

    def fails(*_: Any) -> Any:
        raise LineFailed(0, Outcome.NOT_CONVERGED, None, 0.0, "")

    of = (lambda x: next(iter(hybrid.static(buoy(x)).lines.values()))) if several else (lambda x: static(anchored(x)))
    plain = of("neglected")
    monkeypatch.setattr("hybrid.simulation.equilibrium.settled_with_friction", fails)
    found = of(None)
    np.testing.assert_array_equal(found.tension, plain.tension)
    (event,) = [x for x in found.events if x.kind == "static friction neglected"]
    assert "none was found that is pulled tight" in event.text and "did not converge" in event.text


def test_what_is_paid_out_was_laid_under_tension() -> None:
    scene = anchored(None)
    scene["ends"]["end"]["payout"] = {"longest": 440.0, "rate": 0.1, "ramp": 5.0}
    found = static(scene)
    assert found.tension.min() > 0.5 * found.tension.max()
    (event,) = [x for x in found.events if x.kind == "static friction neglected"]
    assert "paid out" in event.text


def test_zones_that_move_keep_the_travel_since_a_line_was_laid() -> None:
    """Travel is of the size of strains, which other cells lose: the anchor had 178 N, for 56 with rods everywhere."""
    scene = hybrid.load_scene(
        EXAMPLES / "irregular_sea.yaml", ["initial={kind: equilibrium, friction: settled}", "mesh.cells=400"]
    )
    zones, rods = hybrid.static(scene), hybrid.static(scene.model_copy(update={"model": RodModel(kind="rod")}))
    assert zones.tension[0, 0] == pytest.approx(rods.tension[0, 0], rel=0.02)


PIPE = {"kind": "cylinder", "axis": [0, 1, 0], "at": [18, 0, 6.5], "radius": 0.5, "friction": 0.3}


@pytest.mark.parametrize(
    ("length", "changes", "bed", "where"),
    [
        (30.5, {}, None, "on obstacles:"),
        (30.5, {"friction": 0.0}, None, ""),
        (30.5, {"at": [12, 0, -50.0]}, None, ""),
        (30.5, {"friction": 0.0}, -9.0, ""),  # of the bed, which is far below
        (29.2, {"at": [12, 0, -50.0]}, 0.0, ""),  # taut: nothing lies there but the anchor
        (33.0, {"at": [12, 0, -50.0]}, 0.0, "on the seabed:"),
        (33.0, {"at": [18, 0, 2.5]}, 0.0, "on the seabed and on obstacles:"),
    ],
)
def test_friction_is_neglected_where_something_lies_that_has_some(
    length: float, changes: dict[str, Any], bed: float | None, where: str
) -> None:
    section = {"length": length, "mass": 2, "diameter": 0.03, "axial_stiffness": 1e6}
    ends = {"start": pinned_at(0, 0, 0), "end": pinned_at(25, 0, 15)}
    scene: dict[str, Any] = {"cable": {"sections": [section]}, "ends": ends, "obstacles": {"pipe": PIPE | changes}}
    scene |= {"initial": NEGLECTED, "model": "catenary", "mesh": {"cells": 120}}
    if bed is not None:
        scene["environment"] = {"seabed": {"z": bed, "stiffness": 1e4, "friction": 0.5}}
    found = hybrid.static(hybrid.validate_scene(scene))
    told = [event.text for event in found.events if event.kind == "static friction neglected"]
    assert len(told) == bool(where) and all(where in text for text in told)


# --- in a current: what lies on the bed stays where it was laid in still water ---

Tables = dict[str, Any]
CHAIN = {
    "length": 90.0, "mass": 40.0, "diameter": 0.08, "axial_stiffness": 1.7e8, "drag": {"normal": 1.33, "tangential": 0.2},
    "added_mass": {"normal": 1.0}, "damping": {"mass": 0.3},
}  # fmt: skip
ANCHOR, TOP, GRIP = [75.0, 0.0, -35.0], [0.0, 0.0, -13.0], 0.5
WET = (40.0 - 1025.0 * np.pi * 0.04**2) * 9.80665  # N/m in water
DRAG = 0.5 * 1025.0 * 1.33 * 0.08 * 0.8**2  # N/m on what lies across the current


def sea(ramp: float = 0.0) -> Tables:
    current = {"velocity": [0, 0.8, 0], "ramp": ramp} if ramp else [0, 0.8, 0]
    bed = {"z": -35, "stiffness": 5e3, "damping": 5e2, "friction": GRIP}
    return {"fluid": {"density": 1025, "current": current}, "seabed": bed}


def across(friction: str = "settled", **more: Any) -> Tables:
    """A chain along x, most of it on the bed, in a current along y."""
    return cable_scene(
        CHAIN, {"kind": "pinned", "position": ANCHOR}, {"kind": "pinned", "position": TOP}, environment=sea(),
        model="catenary", mesh=90, initial={"kind": "equilibrium", "friction": friction}, output={"points": 91}
    ) | more  # fmt: skip


def test_a_chain_across_a_current_lies_where_it_was_laid() -> None:
    """As where the current comes up in time; without friction it is swept ten times as far."""
    settled, swept = hybrid.static(across()), hybrid.static(across("neglected"))
    grown = hybrid.run(
        across("neglected", environment=sea(ramp=60.0), time={"duration": 200.0, "step": 0.25}, output={"every": 50, "points": 91})
    )  # fmt: skip
    lies = settled.position[0, :, 2] < -34.99
    assert DRAG < 0.3 * GRIP * WET  # friction holds what lies
    bow, like, free = (np.abs(x.position[-1, :, 1]).max() for x in (settled, grown, swept))
    assert free > 8.0 * bow
    assert bow == pytest.approx(like, rel=0.08)
    assert np.abs(settled.position[0, lies, 1]).max() < 0.4 * bow
    assert float(settled.tension[0, -1]) == pytest.approx(float(grown.tension[-1, -1]), rel=0.01)
    assert "against friction from where it lay without tension in still water" in settled.attributes["static_path"]


def test_still_water_changes_nothing_where_no_current_acts() -> None:
    calm = sea()
    del calm["fluid"]["current"]
    one = hybrid.static(across(environment=calm))
    assert "still water" not in one.attributes["static_path"]
    assert np.abs(one.position[0, :, 1]).max() < 1e-9


@pytest.mark.long
def test_a_network_is_found_that_friction_keeps_where_it_comes_to_rest() -> None:
    """Two lines, too long for where they hang from a buoy: no way without friction leads to an equilibrium."""
    found = hybrid.static(random_network(479)[1])
    assert "settled with friction from" in found.attributes["static_path"]
    largest = max(float(line.tension.max()) for line in found.lines.values())
    assert found.attributes["static_residual"] < 1e-6 * largest
    assert "unresolved bend" in {event.kind for event in found.lines["l0"].events}


def test_friction_of_a_network_settles_while_its_current_grows() -> None:
    """A row of knots, buoys and lines that no step of the growing current led through at once."""
    found = hybrid.static(random_network(60)[1])
    assert not [event for event in found.events if event.kind == "static friction neglected"]


def test_compression_that_friction_holds_is_told_at_rest() -> None:
    """Leg 1 of random network 516 lies in compression on the bed, by less than the friction of a cell."""
    leg = hybrid.static(random_network(516)[1]).lines["leg1"]
    assert leg.tension.min() < -0.01 * leg.tension.max()
    (told,) = [event for event in leg.events if event.kind == "slack"]
    lowest = float(leg.s[int(np.argmin(leg.tension))])
    assert "friction holds it on the seabed" in told.text and abs(told.s_a - lowest) < 3.0


# --- lines that are joined on the bed --------------------------------------------------------------

LINKS = {"mass": 10, "diameter": 0.05, "axial_stiffness": 1e7}
LEVEL = {"z": -5, "stiffness": 1e5, "friction": 0.5}
CUTS = (0, 10, 20, 30, 65)


@pytest.mark.parametrize("order", [1, -1])
@pytest.mark.parametrize("mass", [0, 500])
def test_a_chain_in_pieces_settles_as_one(mass: float, order: int) -> None:
    """Pieces were laid as between two anchors: 1649 N at the anchor, which are 138 N in one piece."""
    clumps = [{"kind": "clump", "at": x, "mass": mass} for x in (20, 30)] if mass else None
    ends, like = (pinned_at(0, 0, -5), pinned_at(60, 0, 8)), {"model": "catenary", "seabed": LEVEL}
    one = hybrid.static(cable_scene(LINKS | {"length": 65}, *ends, mesh=65, attachments=clumps, **like))
    points: dict[str, Any] = {"k0": {"position": [0, 0, -5]}, "k4": {"position": [60, 0, 8]}}
    points |= {f"k{i}": {"initial_guess": [CUTS[i], 0, -5], "mass": mass if i > 1 else 0} for i in (1, 2, 3)}
    lines = {}
    for i, (a, b) in enumerate(pairwise(CUTS)):
        names = [f"k{i}", f"k{i + 1}"][:: -1 if i == 1 else 1]
        lines[f"l{i}"] = line_between(*names, LINKS | {"length": b - a}, model="catenary", mesh=b - a)
    many = hybrid.static(network_scene(points, dict([*lines.items()][::order]), seabed=LEVEL))
    for point, own in (("k0", one["reaction_start"]), ("k4", one["reaction_end"])):
        assert many[f"points/{point}/force"][-1] == pytest.approx(-own[-1], abs=0.1)


@pytest.mark.parametrize("order", [1, -1])
def test_a_clump_where_one_line_alone_lies_is_held_in_any_order(order: int) -> None:
    points: dict[str, Any] = {"a": {"position": [0, 0, -5]}, "d": {"position": [40, 0, 10]}}
    points["k"] = {"initial_guess": [20, 0, -5], "mass": 5000}
    lines = {
        f"l{x}": line_between(x, "k", LINKS | {"length": length}, model="catenary", mesh=20)
        for x, length in (("a", 20), ("d", 25.05))
    }
    found = hybrid.static(network_scene(points, dict([*lines.items()][::order]), seabed=LEVEL))
    assert abs(found["points/a/force"][-1, 0]) < 100.0
    assert "static friction neglected" not in [x.kind for x in found.events]


@pytest.mark.parametrize("order", [1, -1])
def test_a_bridle_on_the_bed_is_not_laid_one_of_many_ways(order: int) -> None:
    points = {"a": {"position": [0, -5, -5]}, "b": {"position": [0, 5, -5]}, "d": {"position": [60, 0, 5]}}
    points["k"] = {"initial_guess": [19, 0, -5], "mass": 50}
    chain = LINKS | {"length": 20}
    lines = {name: line_between(name, "k", chain, model="catenary", mesh=20) for name in "ab"}
    lines["d"] = line_between("k", "d", LINKS | {"length": 43}, model="catenary", mesh=40)
    tables = network_scene(points, dict([*lines.items()][::order]), seabed={"z": -5, "stiffness": 1e4})
    assert "laid one way" not in [x.kind for x in hybrid.static(tables).events]
