"""Quantities that a scene asks for by name: against closed forms, geometry and balances of their own."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from problems_sea import grounded_catenary

import hybrid
from hybrid.kernels.state.report import REPORT_SIZE
from hybrid.kernels.state.state import no_sea
from hybrid.kernels.watch import named_quantities as k
from hybrid.model.sea import surroundings
from hybrid.outputs.probes import PROBES
from hybrid.outputs.quantities import chords_of, nothing
from hybrid.scene.quantities import TAKEN
from hybrid.scene.read import one_line, read_text
from hybrid.store.limits import held_of
from hybrid.view.summary import facts_of
from tests.scenes import cable_scene, pinned_at

MASS, DIAMETER, DEPTH, LENGTH, SPAN = 141.0, 0.151, 88.0, 700.0, 655.0
W = (MASS - 1025.0 * math.pi / 4 * DIAMETER**2) * 9.81  # N/m


def chain(quantities: dict[str, Any], **changes: Any) -> hybrid.Result:
    """A chain from an anchor to a fairlead that lies 40 degrees off the x axis, at rest on a hard bed."""
    x, y = SPAN * math.cos(math.radians(40.0)), SPAN * math.sin(math.radians(40.0))
    data: dict[str, Any] = cable_scene(
        {"length": LENGTH, "mass": MASS, "diameter": DIAMETER, "axial_stiffness": 1e12}, pinned_at(0, 0, -100),
        pinned_at(x, y, -12), fluid={"density": 1025, "surface": 0}, seabed={"z": -100, "stiffness": 1e6},
        model="catenary", mesh=700, output={"points": 11, "quantities": quantities}
    )  # fmt: skip
    return hybrid.static(data | changes)


def closed_form() -> tuple[float, float, float]:
    """Horizontal force N, suspended length m and its horizontal reach m, of an inextensible chain on a rigid bed."""
    h, suspended, _ = grounded_catenary(DEPTH, LENGTH, SPAN, W, None)
    return h, suspended, h / W * math.asinh(suspended / (h / W))


def test_forces_angles_touchdown_and_layback_of_a_catenary() -> None:
    ends = {"end": "end"}
    result = chain({
        "horizontal": {"kind": "horizontal_force", **ends}, "vertical": {"kind": "vertical_force", **ends},
        "along": {"kind": "force_along", "direction": [2, 0, 0], **ends}, "declination": {"kind": "declination", **ends},
        "azimuth": {"kind": "azimuth", **ends}, "anchor_azimuth": {"kind": "azimuth", "end": "start"},
        "hang_off": {"kind": "end_angle", "direction": [0, 0, -3], **ends}, "lift": {"kind": "uplift", "end": "start"},
        "lift_angle": {"kind": "uplift_angle", "end": "start"}, "tdp": {"kind": "touchdown", **ends},
        "layback": {"kind": "layback", **ends}, "reach": {"kind": "layback", "to": "end", **ends},
        "moved": {"kind": "touchdown_excursion", "reference": [0, 0], **ends},
    })  # fmt: skip
    h, suspended, reach = closed_form()
    angle = math.degrees(math.atan2(h, W * suspended))
    assert result.horizontal[0] == pytest.approx(h, rel=2e-3)
    assert result.vertical[0] == pytest.approx(-W * suspended, rel=1e-3)
    assert result.along[0] == pytest.approx(-h * math.cos(math.radians(40.0)), rel=2e-3)
    assert result.hang_off[0] == pytest.approx(angle, abs=0.05)
    assert result.declination[0] == pytest.approx(180.0 - angle, abs=0.05)
    assert result.azimuth[0] == pytest.approx(-140.0, abs=1e-6)
    assert result.anchor_azimuth[0] == pytest.approx(40.0, abs=1e-6)
    assert result.tdp[0] == pytest.approx(LENGTH - suspended, abs=1.5)  # a bed of 1 MN/m per m takes it up over 0.4 m
    assert result.layback[0] == pytest.approx(reach, abs=1.5)
    assert result.reach[0] == pytest.approx(SPAN, abs=1e-9)
    assert result.moved[0] == pytest.approx(result.tdp[0], abs=0.05)
    assert result.lift[0] == 0.0 and result.lift_angle[0] == 0.0
    assert [result.units[x] for x in ("horizontal", "hang_off", "tdp", "layback")] == ["N", "deg", "m", "m"]


def test_uplift_is_that_of_the_method_of_results() -> None:
    x = 658.5
    taut = chain(
        {"lift": {"kind": "uplift", "end": "start"}, "angle": {"kind": "uplift_angle", "end": "start"}},
        cable={"sections": [{"length": 655.0, "mass": MASS, "diameter": DIAMETER, "axial_stiffness": 6e8}]},
        ends={"start": pinned_at(0, 0, -100), "end": pinned_at(x, 0, -12)},
    )
    force, angle = taut.uplift("start")
    assert force[0] > 1e4
    assert taut.lift[0] == pytest.approx(force[0], rel=1e-12) and taut["angle"][0] == pytest.approx(angle[0], rel=1e-12)


def test_clearances_of_a_straight_line() -> None:
    """A taut line along x without weight: distances are those of the axis less both radii."""
    scene = cable_scene(
        {"length": 10, "mass": 1, "diameter": 0.02, "axial_stiffness": 1e5}, pinned_at(0, 0, 0),
        pinned_at(10.001, 0, 0), gravity=0.0, model="catenary", mesh=7,
        output={"points": 3,
                "quantities": {"point": {"kind": "clearance", "point": [4.0, 3.0, 4.0], "diameter": 1.0},
                               "beyond": {"kind": "clearance", "point": [14.001, 3.0, 0.0]},
                               "wall": {"kind": "clearance", "point": [13.001, 0, 0], "normal": [-2, 0, 0]},
                               "path": {"kind": "clearance", "path": [[2, -5, 1], [2, 5, 1], [2, 5, 9]],
                                        "diameter": 0.2},
                               "part": {"kind": "clearance", "point": [0, 1, 0], "range": [5, 10]}}}
    )  # fmt: skip
    result = hybrid.static(scene)
    assert result.point[0] == pytest.approx(5.0 - 0.5 - 0.01, abs=1e-9)
    assert result.point_at[0] == pytest.approx(4.0 / 1.0001, rel=1e-9)
    assert result.beyond[0] == pytest.approx(5.0 - 0.01, abs=1e-9) and result.beyond_at[0] == 10.0
    assert result.wall[0] == pytest.approx(3.0 - 0.01, abs=1e-9) and result.wall_at[0] == 10.0
    assert result.path[0] == pytest.approx(1.0 - 0.1 - 0.01, abs=1e-9)
    begin = 10.001 * 5 / 10  # within a cell
    assert result.part[0] == pytest.approx(math.hypot(begin, 1.0) - 0.01, abs=1e-6)


def distances(a: np.ndarray, b: np.ndarray, ra: np.ndarray, rb: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Clearances (nb,) m of lines a (nb, n+1, 3) m and b (nb, m+1, 3) m, and places on a, in chords from its first on."""
    nb, n = len(a), a.shape[1] - 1
    asked, found = np.zeros(k.ASKED), np.empty((2, nb))
    asked[k.KIND], asked[k.PATH_END], asked[k.FIRST] = k.CLEARANCE, b.shape[1] - 1, np.nan
    radii, held, s = np.stack([np.arange(1.0, n + 1), ra], axis=1), np.zeros((nb, 2), np.int8), np.arange(n + 1.0)[None]
    report = np.zeros((nb, REPORT_SIZE))
    seen = k.Seen(s, a, np.diff(a, axis=1), no_sea(n), held, held[0], report, radii, chords_of(b, rb))
    k.observe_quantity(seen, asked, nothing(1)[0], found)
    return found[0], found[1]


def test_distances_of_chords() -> None:
    """Never more than between any two of many points of them, and attained; many pairs give what all give."""
    rng = np.random.default_rng(1)
    a0, a1, b0, b1 = rng.normal(size=(4, 200, 3))
    b1[:20] = b0[:20] + (a1 - a0)[:20]  # parallel
    b1[20:30] = b0[20:30]  # points
    a1[30:35] = a0[30:35]
    distance, part = distances(np.stack([a0, a1], axis=1), np.stack([b0, b1], axis=1), np.zeros(1), np.zeros(1))
    x = np.linspace(0.0, 1.0, 101)
    first, second = (p[:, None] + x[:, None] * (q - p)[:, None] for p, q in ((a0, a1), (b0, b1)))
    sampled = np.linalg.norm(first[:, :, None] - second[:, None], axis=3)
    least = sampled.min(axis=(1, 2))
    assert (distance <= least + 1e-12).all() and distance == pytest.approx(least, abs=0.03)
    there = a0 + part[:, None] * (a1 - a0)
    assert np.linalg.norm(there[:, None] - second, axis=2).min(axis=1) == pytest.approx(distance, abs=0.02)
    a, b = (np.cumsum(rng.normal(size=(150, 3)), axis=0) + shift for shift in (0.0, 15.0))
    ra, rb = rng.uniform(0.0, 0.3, 149), rng.uniform(0.0, 0.3, 149)
    i, j = (k.ravel() for k in np.indices((149, 149)))
    pairs = np.stack([a[i], a[i + 1]], axis=1), np.stack([b[j], b[j + 1]], axis=1)
    apart, parts = distances(*pairs, np.zeros(1), np.zeros(1))
    every, (found, place) = apart - ra[i] - rb[j], distances(a[None], b[None], ra, rb)
    nearest = every.argmin()
    assert found == pytest.approx(every[nearest], rel=1e-12)
    assert place == pytest.approx(i[nearest] + parts[nearest], abs=1e-12)


# --- pipes ---------------------------------------------------------------------------------------------

OUTER, WALL = 0.4, 0.02
INNER = OUTER - 2 * WALL
STEEL_AREA, BORE = math.pi / 4 * (OUTER**2 - INNER**2), math.pi / 4 * INNER**2
CONTENT, PRESSURE = 800.0, 2e7


def hanging_pipe(length: float, *bare: float) -> hybrid.Result:
    """A closed pipe of steel, full of oil, that hangs from z = -20 m into the sea; below it lengths that are no pipe."""
    mass = 7850.0 * STEEL_AREA + CONTENT * BORE
    pipe = {"wall": WALL, "pressure": PRESSURE, "pressure_z": 5.0, "content_density": CONTENT, "max_stress": 2e8}
    section = {"mass": mass, "diameter": OUTER, "axial_stiffness": 1e12, "pipe": pipe}
    return hybrid.static(cable_scene(
        [section | {"length": length}, *(section | {"length": x, "pipe": None} for x in bare)], pinned_at(0, 0, -20), "free",
        fluid={"density": 1025, "surface": 0}, model="catenary", mesh=100, output={"points": 51}
    ))  # fmt: skip


def test_wall_tension_balances_a_pipe_cut_open() -> None:
    """Weight of the wall below, less the pressure outside and more the pressure inside on the cap that closes it."""
    result = hanging_pipe(500)
    s, bottom = result.s, -520.0
    inside, outside = PRESSURE + CONTENT * 9.81 * (5.0 - bottom), -1025.0 * 9.81 * bottom
    cap = inside * BORE - outside * math.pi / 4 * OUTER**2
    wall = 7850.0 * STEEL_AREA * 9.81 * (500.0 - s) + cap
    assert result.wall_tension[0] == pytest.approx(wall, rel=1e-6)


def test_a_section_without_pipe_has_no_stress_and_the_limit_is_judged() -> None:
    result = hanging_pipe(300, 200)
    assert np.isnan(result.von_mises[0, result.s > 300.0]).all() and np.isfinite(result.von_mises[0, :31]).all()
    at = int(np.flatnonzero(result["right/s"] == 300.0)[0])
    assert np.isnan(result["right/von_mises"][0, at])
    (held,) = held_of(result)
    k = int(np.nanargmax(result.von_mises[0]))
    assert (held.limit, held.value, held.s) == ("max_stress", result.von_mises[0, k], result.s[k])
    assert held.broken == (held.value > 2e8) and held.allowed == 2e8


def stress(**given: float) -> float:
    """Largest stress, Pa, of the pipe of above under pressures, a force in the wall, curvature and torque."""
    values = {"outside": 0.0, "inside": 0.0, "force": 0.0, "curvature": 0.0, "torque": 0.0} | given
    wall, one, found = np.zeros((1, k.WALL)), np.ones((1, 1)), np.empty((2, 1, 1))
    wall[0, [k.OUTER, k.INNER, k.MODULUS, k.INSIDE]] = OUTER, INNER, 2e11, values["inside"]
    wall[0, [k.WATER, k.SURFACE]] = values["outside"], 1.0
    T = values["force"] - values["inside"] * BORE + values["outside"] * (BORE + STEEL_AREA)
    bend = np.array([values["curvature"], values["torque"], 0.0, 0.0, 0.0]).reshape(5, 1, 1)
    k.observe_pipes(wall, np.zeros((1, 1), np.int64), 0.0 * one, T * one, bend, *found)
    assert found[0, 0, 0] == pytest.approx(values["force"], abs=1e-8)
    return float(found[1, 0, 0])


def test_von_mises_of_single_loads() -> None:
    """Tension, bending, torque, pressure alone: the formulas of the books."""
    assert stress(force=1e6) == pytest.approx(1e6 / STEEL_AREA, rel=1e-12)
    assert stress(curvature=1e-3) == pytest.approx(2e11 * 1e-3 * OUTER / 2, rel=1e-12)
    polar = math.pi / 32 * (OUTER**4 - INNER**4)
    assert stress(torque=1e5) == pytest.approx(math.sqrt(3.0) * 1e5 * OUTER / 2 / polar, rel=1e-12)
    closed = stress(inside=1e7, force=1e7 * BORE)  # Lame, closed ends, at the bore
    assert closed == pytest.approx(math.sqrt(3.0) * 1e7 * OUTER**2 / (OUTER**2 - INNER**2), rel=1e-12)
    deep = stress(inside=1e7, outside=1e7, force=-1e7 * STEEL_AREA)  # the same pressure on all sides
    assert deep == pytest.approx(0.0, abs=1.0)
    assert stress(force=1e6, curvature=1e-3) == pytest.approx(1e6 / STEEL_AREA + 4e7, rel=1e-12)


# --- where else they are ---------------------------------------------------------------------------------

SWINGING = """
environment: {seabed: {z: -20, stiffness: 1.0e4}}
cable: {sections: [{length: 60, mass: 5, axial_stiffness: 1.0e6, diameter: 0.05, damping: 0.5}]}
ends:
  start: {kind: pinned, position: [0, 0, -20]}
  end: {kind: pinned, position: [50, 0, 0], motion: {surge: {amplitude: 0.5, period: 4.0}, ramp: 4.0}}
initial: equilibrium
model: catenary
mesh: {cells: 30}
time: {duration: 4, step: 0.1}
output:
  every: 0.2
  quantities:
    moved: {kind: touchdown_excursion, end: end}
    gap: {kind: clearance, point: [30, 0, -5], smallest: 4}
    hang_off: {kind: end_angle, end: end, direction: [0, 0, -1], largest: 90}
"""


def test_in_files_statistics_tables_and_after_a_resume(tmp_path: Path) -> None:
    scene = hybrid.parse_scene(SWINGING)
    result = hybrid.run(scene, tmp_path / "all.h5")
    listed = {x.name: x for x in hybrid.listed_outputs(scene)}
    over_time = {x for x in result.names if result.dims(x)[:1] in (("t",), ("steps/t",)) and "right/" not in x}
    assert set(listed) == over_time - {"t"} | {"steps/t"}
    assert all(x.unit == result.units[name] for name, x in listed.items())
    assert result.moved[0] == 0.0 and result.moved.max() > 0.2
    found = result.statistics(["gap"])["gap"]
    assert found.minimum == result.gap.min()
    table = hybrid.export(result, tmp_path / "gap.csv", names=["gap", "hang_off"]).files[0].read_text()
    assert "gap (m)" in table and "hang_off (deg)" in table
    held = {x.name: x for x in held_of(result)}
    least, most = result["extremes/gap"][0], result["extremes/hang_off"][1]  # of every step, half of which are outputs
    assert held["gap"].value == least < result.gap.min() and held["gap"].broken == (least < 4.0)
    assert held["hang_off"].value == most and not held["hang_off"].broken
    assert most >= result.hang_off.max() * (1.0 - 1e-14)  # in the last step: kernel and output differ by round-off
    half = hybrid.parse_scene(SWINGING.replace("duration: 4", "duration: 2"))
    hybrid.run(half, tmp_path / "half.h5").close()
    gone_on = hybrid.resume(tmp_path / "half.h5", tmp_path / "rest.h5", until=4.0)
    assert np.array_equal(gone_on.moved, result.moved) and np.array_equal(gone_on.gap, result.gap)


SYSTEM = """
environment: {gravity: 0.0}
points:
  a: {kind: fixed, position: [0, 0, 0]}
  b: {kind: fixed, position: [10.01, 0, 0]}
  c: {kind: fixed, position: [3, -5, 2]}
  d: {kind: fixed, position: [3, 5.01, 2], motion: {travel: {by: [0, 0, -1.0], over: 2.0}}}
lines:
  one: {start: a, end: b, sections: [{length: 10, mass: 1, axial_stiffness: 1.0e5, diameter: 0.2}]}
  two: {start: c, end: d, sections: [{length: 10, mass: 1, axial_stiffness: 1.0e5, diameter: 0.1}]}
output:
  every: 0.5
  quantities:
    gap: {kind: clearance, line: one, other: two, smallest: 1.9}
    pull: {kind: horizontal_force, line: two, end: start}
"""


def test_a_limit_of_what_never_had_a_value_is_not_judged() -> None:
    """The chain lies above the bed: it has no touchdown point."""
    asked = {"td": {"kind": "touchdown", "end": "end", "smallest": 10}}
    bed = {"fluid": {"density": 1025, "surface": 0}, "seabed": {"z": -1000, "stiffness": 1e6}}
    result = chain(asked, environment=bed)
    (held,) = held_of(result)
    assert not held.broken and held.when == ""
    assert held.text == "td had no value at any time: not judged by the 10 m allowed at least"
    (fact,) = [fact for fact in facts_of(result) if fact.key == "quantity"]
    assert fact.weight == "note" and fact.text.startswith(f"{held.text}; not verified: it had no value")
    assert fact.values["value"] is None


LINKED = SYSTEM.replace(
    "output:", "  three: {start: b, end: c, sections: [{length: 30, mass: 1, axial_stiffness: 1.0e5}]}\noutput:"
)


def test_clearance_of_two_lines(tmp_path: Path) -> None:
    still = hybrid.static(_network(SYSTEM))
    assert still.gap[0] == pytest.approx(2.0 - 0.15, abs=1e-9) and still.gap_at[0] == pytest.approx(3 / 1.001, rel=1e-6)
    assert still.pull[0] == pytest.approx(1e5 * 0.001, rel=1e-6)
    assert [x.broken for x in held_of(still)] == [True]
    moving = _network(SYSTEM + "time: {duration: 2, step: 0.05}\n")
    result = hybrid.run(moving, tmp_path / "two.h5")
    one, two = result.lines["one"], result.lines["two"]
    for at in (1, len(result.times) - 1):
        i, j = (x.ravel() for x in np.indices((100, 100)))
        a, b = one.position[at], two.position[at]
        pairs = np.stack([a[i], a[i + 1]], axis=1), np.stack([b[j], b[j + 1]], axis=1)
        every, _ = distances(*pairs, np.zeros(1), np.zeros(1))
        assert result.gap[at] == pytest.approx(every.min() - 0.15, abs=5e-4)
    assert {x.name for x in hybrid.listed_outputs(moving)} >= {"gap", "gap_at", "pull", "lines/one/tension"}


def _network(text: str) -> hybrid.Scene:
    found, _ = read_text(text)
    assert isinstance(found, hybrid.Scene)
    return found


@pytest.mark.parametrize(("change", "match"), [
    ("{kind: end_angle, end: end}", "direction(.|\n)*needs it"),
    ("{kind: uplift}", "end(.|\n)*start or end"),
    ("{kind: layback, end: end, direction: [1, 0, 0]}", "has no direction"),
    ("{kind: clearance}", "one of point, path and other"),
    ("{kind: clearance, point: [0, 0, 0], other: two}", "one of point, path and other"),
    ("{kind: clearance, other: two}", "the scene has one line"),
    ("{kind: clearance, path: [[0, 0, 0], [1, 0, 0]], normal: [0, 0, 1]}", "without a point"),
    ("{kind: clearance, point: [0, 0, 0], range: [10, 70]}", "length of the line, 60 m"),
    ("{kind: declination, end: end, line: one}", "the scene has one line"),
    ("{kind: declination, end: end, smallest: 3, largest: 2}", "at most largest"),
])  # fmt: skip
def test_refused(change: str, match: str) -> None:
    text = SWINGING[: SWINGING.index("    moved:")] + f"    moved: {change}\n"
    with pytest.raises(hybrid.SceneError, match=match):
        hybrid.parse_scene(text)


def test_names_and_seabed_that_are_refused() -> None:
    with pytest.raises(hybrid.SceneError, match=r"quantities\.tension(.|\n)*results do not have already"):
        hybrid.parse_scene(SWINGING.replace("    moved:", "    tension:"))
    with pytest.raises(hybrid.SceneError, match="without a seabed"):
        hybrid.parse_scene(SWINGING.replace("environment: {seabed: {z: -20, stiffness: 1.0e4}}", ""))
    with pytest.raises(hybrid.SceneError, match="gap_at is the arc length"):
        hybrid.parse_scene(SWINGING.replace("    moved:", "    gap_at:"))


def test_names_of_results_are_taken() -> None:
    result = hybrid.run(hybrid.parse_scene(SWINGING))
    own = {"moved", "gap", "gap_at", "hang_off"}
    assert {x.partition("/")[0] for x in PROBES} <= set(TAKEN)
    assert {x.partition("/")[0] for x in result.names} - own <= set(TAKEN)


@pytest.mark.parametrize(("change", "match"), [
    ("{kind: clearance, line: one, other: too}", "one, two"),
    ("{kind: clearance, line: one, other: one}", "a line other than"),
    ("{kind: declination, end: end}", "line(.|\n)*name of a line"),
    ("{kind: touchdown, line: one, end: end}", "without a seabed"),
    ("{kind: clearance, line: one, other: three}", r"leaves out point b, where it meets three(.|\n)*range: \[1, 9\]"),
])  # fmt: skip
def test_refused_of_several_lines(change: str, match: str) -> None:
    with pytest.raises(hybrid.SceneError, match=match):
        _network(LINKED[: LINKED.index("    gap:")] + f"    gap: {change}\n")


# --- The elevation of the sea as an output: of a regular wave by its formula, of many components by their sum ---

PLACES = [[0.0, 0.0], [30.0, 10.0], [-12.5, 4.0]]
LINE = """
environment: {{fluid: {{density: 1025, surface: 0, waves: {waves}}}}}
cable: {{sections: [{{length: 12, mass: 2, axial_stiffness: 1e6, diameter: 0.02}}]}}
ends: {{start: {{kind: pinned, position: [0, 0, -40]}}, end: {{kind: pinned, position: [10, 0, -40]}}}}
initial: equilibrium
model: catenary
mesh: {{cells: 8}}
time: {{duration: 6, step: 0.1}}
output: {{every: 0.25, elevation: {places}}}
"""


def test_a_regular_wave() -> None:
    waves = "{kind: regular, height: 2.0, period: 7.0, direction: 30.0, phase: 90.0, ramp: 4.0}"
    result = hybrid.run(hybrid.parse_scene(LINE.format(waves=waves, places=PLACES)))
    w = 2.0 * np.pi / 7.0
    k, t = w**2 / 9.81, result.times[:, None]
    along = np.array(PLACES) @ [np.cos(np.pi / 6.0), np.sin(np.pi / 6.0)]
    part = np.clip(t / 4.0, 0.0, 1.0)
    grown = part**3 * (10.0 - 15.0 * part + 6.0 * part**2)
    assert result.elevation == pytest.approx(grown * np.cos(k * along - w * t + 0.5 * np.pi), abs=1e-9)
    assert result.elevation_at.tolist() == PLACES
    assert result.units["elevation"] == "m"


def test_many_components_and_the_same_after_a_resume(tmp_path: Path) -> None:
    waves = "{kind: jonswap, significant_height: 3.0, peak_period: 9.0, components: 40, depth: 60}"
    scene = hybrid.parse_scene(LINE.format(waves=waves, places=PLACES))
    file = tmp_path / "run.h5"
    hybrid.run(scene, file)
    sea = surroundings(one_line(scene), 8)
    with hybrid.open(file) as result:
        expected = [[sea.elevation(x, y, float(t))[0] for x, y in PLACES] for t in result.times]
        assert result.elevation == pytest.approx(np.array(expected), abs=1e-9)
        table = hybrid.export(result, tmp_path / "run.csv", names=["elevation"]).files[0].read_text()
    rows = [line for line in table.splitlines() if not line.startswith("#")]
    assert len(rows[0].split(",")) == 1 + len(PLACES)
    assert float(rows[-1].split(",")[1]) == pytest.approx(expected[-1][0], abs=1e-6)


def test_the_equilibrium_has_still_water() -> None:
    waves = "{kind: regular, height: 2.0, period: 7.0}"
    assert not hybrid.static(hybrid.parse_scene(LINE.format(waves=waves, places=PLACES))).elevation.any()


def test_no_elevation_without_waves() -> None:
    with pytest.raises(hybrid.SceneError, match=r"output\.elevation(.|\n)*no waves"):
        hybrid.parse_scene(LINE.format(waves="null", places=PLACES).replace(", waves: null", ""))


def test_a_range_begins_and_ends_within_cells() -> None:
    clear = {"kind": "clearance", "point": [14, 1, 0]}
    asked = {"to": clear | {"range": [0, 14]}, "off": clear | {"range": [16, 100]}}
    line = {"length": 100, "mass": 1, "diameter": 0.02, "axial_stiffness": 1e7}
    found = [
        hybrid.static(cable_scene(
            line, pinned_at(0, 0, 0), pinned_at(100.5, 0, 0), model="catenary", mesh=cells, output={"quantities": asked}
        )) for cells in (10, 100)
    ]  # fmt: skip
    for name in asked:
        assert abs(found[0][name][0] - found[1][name][0]) < 2e-3  # 4.07 and 1.00 m by the nearest nodes
