"""Sections whose tension is no multiple of strain: a table of tension over strain, and fibre ropes that answer stiffer
to what is fast.

A bar of light cells under a force that is given has the tension of that force, so its length is the law itself:
theta' = (T - theta)/tau, strain = s(theta) + (T - theta)/(a + b theta), solved here by itself.
"""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from scipy.integrate import quad, solve_ivp
from scipy.optimize import brentq

import hybrid
from hybrid.errors import SceneError
from hybrid.model.build import build
from hybrid.scene.read import one_line
from hybrid.solve.stability import is_stable
from tests.inside import OnlyLine
from tests.scenes import cable_scene, clamped_at, network_scene, pinned_at

TABLE = [[0, 0], [0.01, 1000], [0.02, 3000], [0.03, 9000]]
DYNAMIC = {"constant": 4e5, "per_tension": 20.0, "relaxation_time": 3.0}
KINDS = ("catenary", "rod")
DEFECTS = Path(__file__).parent.parent / "data" / "defects"


def strain_at_rest(T: Any) -> Any:
    x, y = np.array(TABLE, float).T
    return np.interp(T, y, x)


def bar(section: dict[str, Any], history: list[list[float]], **tables: Any) -> dict[str, Any]:
    """A bar of 10 m along x, under a force along it that changes."""
    kind = tables.pop("model", "catenary")
    stiff = {"bending_stiffness": 1.0} if kind == "rod" else {}
    return cable_scene(
        {"length": 10, "mass": 1e-4} | stiff | section, pinned_at(0, 0, 0),
        {"kind": "free", "force": {"history": history}}, gravity=0,
        initial={"kind": "equilibrium", "guess": "straight", "direction": [1, 0, 0]}, model=kind, mesh=5,
        time=(history[-1][0], 0.05), output=0.5
    ) | tables  # fmt: skip


HISTORY = [
    [0.0, 1500, 0, 0],
    [2.0, 1500, 0, 0],
    [2.5, 4000, 0, 0],
    [6.0, 4000, 0, 0],
    [7.0, 800, 0, 0],
    [10.0, 800, 0, 0],
]


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("dimension", [2, 3])
def test_a_bar_at_rest_has_the_strain_of_its_table(kind: str, dimension: int) -> None:
    for T in (400.0, 2000.0, 7000.0):
        scene = bar({"tension_strain": TABLE}, [[0, T, 0, 0], [1, T, 0, 0]], model=kind, dimension=dimension)
        found = hybrid.static(scene)
        assert found.position[-1, -1, 0] == pytest.approx(10 * (1 + strain_at_rest(T)), rel=1e-12)
        stored, _ = quad(lambda e: np.interp(e, *np.array(TABLE, float).T), 0, strain_at_rest(T), points=[0.01, 0.02])
        assert found["energy/stretch"][-1] == pytest.approx(10 * stored, rel=1e-9)


@pytest.mark.parametrize("kind", KINDS)
def test_a_bar_follows_its_table_in_motion(kind: str) -> None:
    found = hybrid.run(bar({"tension_strain": TABLE}, HISTORY, model=kind))
    times, force = np.array(HISTORY)[:, 0], np.array(HISTORY)[:, 1]
    calm = (found.t < 1.9) | ((found.t > 4.0) & (found.t < 5.9)) | (found.t > 8.5)
    expected = 10 * (1 + strain_at_rest(np.interp(found.t, times, force)))
    assert np.abs(found.position[:, -1, 0] - expected)[calm].max() < 1e-6


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("static", [{"tension_strain": TABLE}, {"axial_stiffness": 1.5e5}], ids=["table", "constant"])
def test_a_fibre_rope_is_stiff_when_fast_and_soft_when_slow(kind: str, static: dict[str, Any]) -> None:
    """The step is 0.05 s, the motion of the light bar is over at once: its strain is the law's own history."""
    dynamic = DYNAMIC | ({"constant": 7e5} if "tension_strain" in static else {})
    rope = static | {"dynamic_stiffness": dynamic, "max_strain": 0.1}
    found = hybrid.run(bar(rope, HISTORY, model=kind))
    times, force = np.array(HISTORY)[:, 0], np.array(HISTORY)[:, 1]
    tau, a, b = dynamic["relaxation_time"], dynamic["constant"], dynamic["per_tension"]
    mean = np.full(found.t.shape, 1500.0)
    for begin, end in pairwise(times):
        on = (found.t > begin) & (found.t <= end)
        start = mean[found.t <= begin][-1]
        slow = solve_ivp(
            lambda t, y: (np.interp(t, times, force) - y) / tau, (begin, end), [start], t_eval=found.t[on],
            rtol=1e-11, atol=1e-8,
        )  # fmt: skip
        mean[on] = slow.y[0]
    T = np.interp(found.t, times, force)
    at_rest = strain_at_rest if "tension_strain" in static else lambda T: T / 1.5e5
    expected = 10 * (1 + at_rest(mean) + (T - mean) / (a + b * mean))
    calm = np.array([not any(abs(t - x) < 0.4 for x in times[1:-1]) for t in found.t])
    assert np.abs(found.position[:, -1, 0] - expected)[calm].max() < 2e-6
    assert np.abs(expected - 10 * (1 + at_rest(T)))[calm].max() > 2e-2  # what it would be without the fast spring


POLYESTER_LETS_GO = [[0.0, 2000], [0.2, 2000], [0.7, 4200], [2, 4200], [2.5, 1200], [4, 1200]]
TABLE_LETS_GO = [[0.0, 3500], [0.5, 3500], [1.0, 2200], [3.0, 2200]]
# Ropes, force over time, and which work takes at least so much energy, J.
ROPES: dict[str, tuple[dict[str, Any], list[list[float]], str, float]] = {
    "table": ({"tension_strain": TABLE, "damping": {"stiffness": 2e-3}}, TABLE_LETS_GO, "work/stiffness_damping", 0.5),
    "rope": ({"tension_strain": TABLE, "dynamic_stiffness": DYNAMIC | {"constant": 7e5}}, TABLE_LETS_GO,
             "work/stiffness_damping", 0.5),
    "damped rope": ({"axial_stiffness": 1e5, "dynamic_stiffness": DYNAMIC, "damping": {"stiffness": 2e-3}},
                    TABLE_LETS_GO, "work/stiffness_damping", 0.5),
    **{name: ({"dynamic_stiffness": DYNAMIC | {"relaxation_time": 1.0}}, POLYESTER_LETS_GO, "work/hysteresis", 20.0)
       for name in ("quadratic", "exponential")},
}  # fmt: skip


@pytest.mark.parametrize("which", list(ROPES))
def test_energy_balances_and_nothing_is_gained(which: str) -> None:
    """A heavy bar whose end is let go from a force, polyester from beyond its highest tension, rings along itself."""
    law, history, work, least = ROPES[which]
    law = rope_polyester(which) | law if which in SHAPES else law
    off = []
    for step in (4e-3, 2e-3):
        rows = [[t, force, 0, 0] for t, force in history]
        found = hybrid.run(
            bar({"mass": 20.0} | law, rows, time={"duration": rows[-1][0], "step": step, "rho_inf": 1.0})
        )
        off.append(np.abs(found["work/scheme"]).max())
        lost = np.diff(found[work])
        assert (lost <= 1e-9).all() and lost.sum() < -least
        if which in SHAPES:
            assert np.abs(found["work/stiffness_damping"]).max() < 1e-4 and off[-1] < 0.05
    print(f"energy that no work accounts for: {off} J")
    assert off[1] < 0.35 * off[0]


def test_a_hanging_rope_has_the_length_of_its_table() -> None:
    """Under its own weight: the strain of the tension above, integrated along it."""
    scene: dict[str, Any] = cable_scene(
        {"length": 100, "mass": 6, "tension_strain": TABLE}, pinned_at(0, 0, 0),
        {"kind": "free", "force": [0, 0, -900]}, model="catenary", mesh=400
    )  # fmt: skip
    found = hybrid.static(scene)
    weight = 6 * 9.81
    longer, _ = quad(lambda s: strain_at_rest(900 + weight * (100 - s)), 0, 100, points=[63, 97], epsabs=1e-10)
    assert found.position[-1, -1, 2] == pytest.approx(-100 - longer, abs=2e-5)


def two_lines(section: dict[str, Any], cut: bool, heave: float = 0.3) -> dict[str, Any]:
    """A rope from an anchor to a vessel that heaves, in one piece or in two."""
    points: dict[str, Any] = {
        "anchor": {"position": [0, 0, -60]},
        "vessel": {"position": [40, 0, 0], "motion": {"heave": {"amplitude": heave, "period": 6}, "ramp": 3}},
    }
    rope = {"mass": 4.0, "diameter": 0.08, "drag": {"normal": 1.2}} | section
    lines = {"rope": {"start": "anchor", "end": "vessel", "sections": [rope | {"length": 70}], "mesh": {"cells": 40}}}
    if cut:
        points["knot"] = {"initial_guess": [20, 0, -30]}
        half = {"sections": [rope | {"length": 35.0}], "mesh": {"cells": 20}}
        lines = {
            "rope": {"start": "anchor", "end": "knot"} | half,
            "upper": {"start": "vessel", "end": "knot"} | half,
        }  # fmt: skip
    return network_scene(points, lines, fluid={"density": 1025, "current": [0.5, 0, 0]}, time=(6, 0.05), output=0.5)


SOFT = {"tension_strain": [[0, 0], [0.01, 800], [0.03, 6000], [0.2, 9e4]]}


@pytest.mark.parametrize("which", ["table", "rope", "polyester"])
def test_a_rope_that_is_cut_is_the_same_rope(which: str) -> None:
    """A rope moves as it does in two pieces that meet at a knot."""
    fibre = {"dynamic_stiffness": {"constant": 8e5, "per_tension": 15, "relaxation_time": 5}}
    section = SECTION if which == "polyester" else SOFT | (fibre if which == "rope" else {})
    heave = 0.6 if which == "polyester" else 0.3
    one, two = (hybrid.run(two_lines(section, cut, heave)) for cut in (False, True))
    whole, lower = one.lines["rope"], two.lines["rope"]
    halfway = np.array([[np.interp(35.0, whole.s, x[:, k]) for k in range(3)] for x in whole.position])
    assert np.abs(halfway - lower.position[:, -1]).max() < 1e-7
    top, cut = whole.tension[:, -1], two.lines["upper"].tension[:, 0]
    assert np.abs(top - cut).max() < 1e-6 * np.abs(top).max()
    assert np.ptp(top) > 0.1 * top.max()


@pytest.mark.long
@pytest.mark.parametrize("name", ["polyester_on_depths", "table_with_turns"])
def test_a_rod_that_is_judged_at_rest_may_have_a_law_of_stretch(name: str) -> None:
    """Both rest compressed or twisted at the start, where their stability is judged from the outputs."""
    found = hybrid.run(
        yaml.safe_load((DEFECTS / f"{name}.yaml").read_text()) | {"time": {"duration": 0.5, "step": 0.1}}
    )
    assert found.status == "complete"


def test_judging_stability_leaves_the_law_of_stretch_of_a_line_alone() -> None:
    model = build(one_line(hybrid.validate_scene(bar({"tension_strain": TABLE}, HISTORY, model="rod"))))
    line, ends = model.line, model.ends.at_time(0.0)
    line.ck[:] = 1e-7
    law = line.law.copy()
    assert is_stable(line, model.sea.at_time(0.0), ends, model.start, model.length, model.tension_scale)
    assert (line.ck == 1e-7).all()
    assert np.array_equal(line.law, law)


ZONES = ("adaptive", {"kind": "adaptive", "curvature_error": 0.1})


def heaved(law: dict[str, Any], model: Any) -> dict[str, Any]:
    """60 m of rope between a clamp and a vessel that heaves."""
    wet = {"drag": {"normal": 1.2}, "added_mass": {"normal": 1.0}}
    section = {"length": 60, "diameter": 0.03, "mass": 1.5, "bending_stiffness": 60} | wet | law
    heave = {"heave": {"amplitude": 1.5, "period": 3}, "ramp": 1}
    return cable_scene(
        section,
        clamped_at([0, 0, -40], [0, 0, 1]),
        pinned_at(30, 0, -3, motion=heave),
        fluid={"density": 1025, "surface": 0},
        model=model,
        mesh=20,
        time=(2.0, 0.02),
        output=0.1,
    )


@pytest.mark.parametrize("model", ZONES, ids=["zones", "cells"])
def test_a_straight_table_is_a_stiffness_where_zones_move(model: Any) -> None:
    table = {"tension_strain": [[0, 0], [0.01, 2000], [0.2, 4e4]]}
    plain, law = (hybrid.run(heaved(x, model)) for x in ({"axial_stiffness": 2e5}, table))
    assert len(plain.events) == len(law.events) > 0
    assert np.abs(law.position - plain.position).max() < 1e-6
    assert np.abs(law.tension - plain.tension).max() < 1e-5 * plain.tension.max()


OLD = {
    "slow": SOFT | {"dynamic_stiffness": {"constant": 6e5, "per_tension": 0, "relaxation_time": 1e9}},
    "peak": {
        "syrope": {"curve": [[0, 0], [0.01, 1600], [0.03, 4800], [0.2, 3.2e4]], "working": "linear", "k1": 0.5,
                   "highest_tension": 200.0},
        "dynamic_stiffness": {"constant": 9e5, "relaxation_time": 1e9},
    },
}  # fmt: skip


@pytest.mark.parametrize("field", OLD)
@pytest.mark.parametrize("model", ZONES, ids=["zones", "cells"])
def test_mean_and_highest_tensions_go_along_where_zones_move(model: Any, field: str) -> None:
    """Of a rope that remembers for ever they stay, on whatever cells, what they are at rest."""

    def means(simulation: hybrid.Simulation) -> tuple[Any, Any]:
        run = OnlyLine(simulation)
        s = run.model.line.s
        return 0.5 * (s[1:] + s[:-1]), getattr(run.state, field).copy()

    with hybrid.Simulation(heaved(OLD[field], model)) as simulation:
        s, first = means(simulation)
        simulation.advance(2.0)
        then, last = means(simulation)
    assert np.array_equal(s, then) == (model == "adaptive")  # kinds change, and cells stay
    inside = (then >= s[0]) & (then <= s[-1])  # beyond, np.interp goes on level
    assert np.abs(last - np.interp(then, s, first))[inside].max() < 0.02 * first.max()
    assert np.ptp(first) > (0.5 if field == "slow" else 1.0 / 3.0) * first.max() > 0.0
    assert field == "slow" or first.min() == 200.0


def touching(law: dict[str, Any], model: Any, cells: int, step: float = 0.05) -> dict[str, Any]:
    """100 m over 80 m that touch the seabed, in a plane, from a clamp that heaves by 1 m in 4 s."""
    section = {"length": 100, "mass": 5, "diameter": 0.05, "bending_stiffness": 500} | law
    heave = {"heave": {"amplitude": 1, "period": 4}, "ramp": 4}
    return cable_scene(
        section,
        pinned_at(0, 0, 0),
        clamped_at([80, 0, 0], [1, 0, 0.5], motion=heave),
        dimension=2,
        seabed={"z": -18, "stiffness": 5e3, "damping": 5e2},
        model=model,
        mesh=cells,
        time=(6.0, step),
        output=(0.5, 41),
    )


def zones(tolerance: float) -> dict[str, Any]:
    return {"kind": "adaptive", "tolerance": tolerance, "hold_time": 1}


MOVED: dict[str, dict[str, Any]] = {
    "table": SOFT,
    "rope": SOFT | {"dynamic_stiffness": {"constant": 6e5, "per_tension": 15, "relaxation_time": 1}},
}


@pytest.mark.parametrize("which", MOVED)
def test_zones_that_move_converge_to_rods(which: str) -> None:
    """Of finer cells and a tighter tolerance: places and tensions come closer to those of fine rods everywhere."""
    rods = hybrid.run(touching(MOVED[which], "rod", 160))
    off = []
    for tolerance, cells in ((4e-3, 25), (1e-3, 50), (2.5e-4, 100)):
        found = hybrid.run(touching(MOVED[which], zones(tolerance), cells))
        apart = found.tension - rods.tension
        off.append((np.abs(found.position - rods.position).max(), np.sqrt(np.mean(apart**2))))
    print(f"{which}: off in place (m) and tension (N, root of the mean square): {off}")
    assert sum(x.kind == "grow" for x in found.events) > 3
    for coarse, fine in pairwise(off):
        assert fine[0] < 0.5 * coarse[0]
        assert fine[1] < 0.5 * coarse[1]
    assert off[-1][0] < 1e-3 * 100
    assert off[-1][1] < 5e-3 * rods.tension.max()


@pytest.mark.parametrize("which", MOVED)
def test_energy_balances_where_zones_move(which: str) -> None:
    """What no work accounts for is what it is of rods, and falls with the square of the step."""
    off = []
    for step in (0.05, 0.025):
        found, rods = (hybrid.run(touching(MOVED[which], x, 100, step)) for x in (zones(2.5e-4), "rod"))
        off.append(np.abs(found["work/scheme"]).max())
        assert np.abs(found["work/zones"]).max() > 0.5  # J
        assert off[-1] < 1.02 * np.abs(rods["work/scheme"]).max()
    assert off[1] < 0.3 * off[0]


# --- creep ---

EA, LENGTH, PER, LOADED = 1e6, 10.0, 0.002, 60.0
CREEP = {"axial_stiffness": EA, "creep": {"per_decade": PER, "loaded": LOADED}}


def rope(end: Any, step: float, over: float, **section: Any) -> dict[str, Any]:
    return cable_scene(
        {"length": LENGTH, "mass": 1.0, "damping": 20.0} | CREEP | section, pinned_at(0, 0, 0), end, gravity=0,
        model="catenary", mesh=10, time=(over, step), output=(10.0, 11)
    )  # fmt: skip


def crept(t: Any) -> Any:
    return PER * np.log10(1.0 + t / LOADED)


@pytest.mark.parametrize("dimension", [2, 3])
def test_under_a_constant_pull_it_grows_with_the_logarithm_of_time(dimension: int) -> None:
    """Strain F/EA + c log10(1 + t/t0), and the pull does its work: all of it is lost."""
    pull = 2e4
    found = hybrid.run(rope({"kind": "free", "force": [pull, 0, 0]}, 0.5, 600.0) | {"dimension": dimension})
    strain = found.position[:, -1, 0] / LENGTH - 1.0
    assert strain[0] == pytest.approx(pull / EA, rel=1e-9)
    np.testing.assert_allclose(strain - strain[0], crept(found.t), atol=2e-6)  # it goes on, against mass and damping
    lost, done = float(found["work/hysteresis"][-1]), pull * LENGTH * (strain[-1] - strain[0])
    print(f"{-lost:.3f} J lost of {done:.3f} J done")
    assert lost == pytest.approx(-pull * LENGTH * crept(600.0), rel=1e-3)
    assert lost == pytest.approx(-done, rel=5e-3)


def test_between_two_ends_it_relaxes() -> None:
    """EA (strain - c log10(1 + t/t0)): tension falls by a straight line over the logarithm of time."""
    held = {"kind": "pinned", "position": [LENGTH * 1.02, 0, 0]}
    found = hybrid.run(rope(held, 1.0, 600.0))
    np.testing.assert_allclose(found.tension[:, 5], EA * (0.02 - crept(found.t)), rtol=1e-5)
    stored = found["energy/stretch"]
    assert float(found["work/hysteresis"][-1]) == pytest.approx(float(stored[-1] - stored[0]), rel=1e-3)
    assert abs(float(found["work/scheme"][-1])) < 1e-3 * abs(float(stored[-1] - stored[0]))


def test_a_table_and_a_dynamic_stiffness_creep_as_well() -> None:
    held = {"kind": "pinned", "position": [LENGTH * 1.02, 0, 0]}
    table = {"axial_stiffness": None, "tension_strain": [[0, 0], [0.015, 1.2e4], [0.05, 6e4]]}
    for law in (table, {"dynamic_stiffness": {"constant": 3e6, "relaxation_time": 5.0}}):
        given = {k: x for k, x in (CREEP | law).items() if x is not None}
        tables = rope(held, 1.0, 600.0)
        tables["cable"]["sections"][0] = {"length": LENGTH, "mass": 1.0, "damping": 20.0} | given
        found = hybrid.run(tables)
        left = 0.02 - crept(600.0)
        rest = np.interp(left, *np.array(table["tension_strain"], float).T) if law is table else EA * left
        assert found.tension[-1, 5] == pytest.approx(rest, rel=1e-3)


def test_what_is_refused() -> None:
    with pytest.raises(SceneError, match="does not stretch does not creep"):
        hybrid.validate_scene({"cable": {"sections": [{"length": 1.0, "mass": 1.0, "creep": CREEP["creep"]}]}})


# --- Polyester rope whose tension over strain depends on the highest mean tension that it has had (Syrope) ---
# A bar of light cells under a force that is given has the tension of that force, so its length is the law itself:
# theta' = (T - theta)/tau, strain = s(theta; highest theta) + (T - theta)/(a + b theta), solved here by itself.

OWC = [[0, 0], [0.01, 1000], [0.02, 1900], [0.03, 3000], [0.05, 5000]]
TAU, A, B = 3.0, 4e5, 20.0
HIGHEST = 2500.0
SHAPES: dict[str, dict[str, Any]] = {
    "linear": {"working": "linear", "k1": 0.4},
    "stiffness": {"working": "linear", "k1": 1.6e5},
    "quadratic": {"working": "quadratic", "k1": 0.3, "k2": 1.0},
    "exponential": {"working": "exponential", "k1": 0.2, "k2": 1.5},
}


def rope_polyester(which: str, **more: Any) -> dict[str, Any]:
    return {
        "syrope": {"curve": OWC, "highest_tension": HIGHEST} | SHAPES[which] | more,
        "dynamic_stiffness": DYNAMIC,
    }


def original(T: float) -> float:
    x, y = np.array(OWC, float).T
    return float(np.interp(T, y, x))


def at_rest(which: str, T: float, highest: float) -> float:
    """Strain of the published formulas, solved for it."""
    if highest <= T:
        return original(T)
    shape, top = SHAPES[which], original(highest)
    k1, k2 = shape["k1"], shape.get("k2", 0.0)
    slack = top - highest / k1 if k1 >= 1.0 else k1 * top

    def tension(strain: float) -> float:
        x = (strain - slack) / (top - slack)
        if which == "quadratic":
            return highest * x * (k2 * x + 1.0 - k2)
        return highest * ((1.0 - np.exp(k2 * x)) / (1.0 - np.exp(k2)) if which == "exponential" else x)

    return float(brentq(lambda strain: tension(strain) - T, slack, top, xtol=1e-15))


@pytest.mark.parametrize("which", SHAPES)
def test_a_bar_at_rest_lies_on_the_curve_of_its_past(which: str) -> None:
    for k, T in enumerate((600.0, 1900.0, 2400.0, 4200.0)):
        kind, dimension = ("catenary", "rod")[k % 2], 2 + k // 2
        scene = bar(rope_polyester(which), [[0, T, 0, 0], [1, T, 0, 0]], model=kind, dimension=dimension)
        found = hybrid.static(scene)
        assert found.position[-1, -1, 0] == pytest.approx(10 * (1 + at_rest(which, T, HIGHEST)), rel=1e-9)
        top = max(T, HIGHEST)
        strains = [at_rest(which, x, top) for x in (1e-9, T)]
        stored = T * strains[1] - quad(lambda x, top=top: at_rest(which, x, top), 0, T, epsabs=1e-9)[0]
        assert found["energy/stretch"][-1] == pytest.approx(10 * stored, rel=1e-4)


# Past the highest tension, below it, past it once more.
HISTORY_POLYESTER = [
    [0.0, 1500, 0, 0],
    [2.0, 1500, 0, 0],
    [3.0, 4600, 0, 0],
    [7.0, 4600, 0, 0],
    [8.0, 900, 0, 0],
    [13.0, 900, 0, 0],
    [14.0, 4900, 0, 0],
    [20.0, 4900, 0, 0],
]


def solved(which: str, t: np.ndarray) -> np.ndarray:
    """Strains at times t (s) of HISTORY."""
    times, force = np.array(HISTORY_POLYESTER)[:, 0], np.array(HISTORY_POLYESTER)[:, 1]
    mean, highest = [force[0]], [HIGHEST]
    fine = [0.0]
    for begin, end in pairwise(times):
        at = np.linspace(begin, end, round(500 * (end - begin)) + 1)[1:]
        slow = solve_ivp(
            lambda t, y: (np.interp(t, times, force) - y) / TAU, (begin, end), [mean[-1]], t_eval=at, rtol=1e-11,
            atol=1e-8,
        ).y[0]  # fmt: skip
        fine, mean = [*fine, *at], [*mean, *slow]
    highest = np.maximum.accumulate(np.maximum(mean, HIGHEST))
    pick = np.searchsorted(fine, t - 1e-9)
    rest = np.array([at_rest(which, mean[k], highest[k]) for k in pick])
    slow = np.array(mean)[pick]
    return np.asarray(rest + (np.interp(t, times, force) - slow) / (A + B * slow))


@pytest.mark.parametrize(
    ("which", "kind"),
    [("linear", "catenary"), ("stiffness", "rod"), ("quadratic", "rod"), ("exponential", "catenary")],
)
def test_a_bar_remembers_its_highest_mean_tension(which: str, kind: str) -> None:
    """The motion of the light bar is over at once: its strain is the law's own history."""
    found = hybrid.run(bar(rope_polyester(which), HISTORY_POLYESTER, model=kind))
    strain = solved(which, found.t)
    calm = np.array([not any(abs(t - x[0]) < 0.4 for x in HISTORY_POLYESTER[1:-1]) for t in found.t])
    assert np.abs(found.position[:, -1, 0] - 10 * (1 + strain))[calm].max() < 2e-5
    again = calm & (found.t > 11.0) & (found.t < 13.0)  # 900 N, as a rope would bear them without its past
    assert (strain[again] > 1.3 * original(900.0)).all()


SECTION = {
    "syrope": {"curve": [[x, 3 * T] for x, T in OWC], "highest_tension": 2700.0, **SHAPES["exponential"]},
    "dynamic_stiffness": {"constant": 9e5, "per_tension": 15, "relaxation_time": 2},
}


@pytest.mark.parametrize(
    ("section", "expected"),
    [
        ({"dynamic_stiffness": None}, "a table, because syrope remembers"),
        ({"axial_stiffness": 1e5}, "because syrope says how it stretches"),
        ({"max_strain": 0.2}, "at most the strain of the last row"),
        ({"dynamic_stiffness": DYNAMIC | {"constant": 1.2e5, "per_tension": 0}}, "more: the static stiffness is"),
        (rope_polyester("linear", k2=1.0), "linear working curves have one number"),
        (rope_polyester("quadratic", k2=1.5), "at most 1"),
        (rope_polyester("exponential", k2=None), "a number, of exponential working curves"),
        (rope_polyester("exponential", k1=1.0), "a part below 1"),
        (rope_polyester("stiffness", k1=9e4), "working curves begin at strains from 0 on"),
        (rope_polyester("linear", highest_tension=6e3), "at most the tension of the last row"),
        (
            rope_polyester("linear", k1=0.0, curve=[[0, 0], [0.02, 1e3], [0.03, 5e3]]) | {"dynamic_stiffness": DYNAMIC | {"constant": 1e6}},
            "give back more than it took up",
        ),
        (rope_polyester("linear", curve=[[0, 0]]), "at least two rows"),
    ],
)  # fmt: skip
def test_what_cannot_be_is_refused(section: dict[str, Any], expected: str) -> None:
    with pytest.raises(hybrid.SceneError, match=expected):
        hybrid.validate_scene(bar(rope_polyester("exponential") | section, HISTORY_POLYESTER))
