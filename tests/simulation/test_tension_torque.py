"""Torque of tension (`tension_torque`): closed forms of straight and hanging lines, energy, zones against rods."""

from functools import cache
from typing import Any

import numpy as np
import pytest

import hybrid
from tests.inside import OnlyLine
from tests.scenes import cable_scene

C, EA, GJ, L, G = 2e-3, 1e5, 20.0, 200.0, 9.81
W = 2.0 * G  # N/m
ZONES = {"kind": "zones", "zones": [{"rod": 50.0}, {"catenary": 100.0}, {"rod": 50.0}]}
DOWN = {"tangent": [0, 0, -1], "normal": [1, 0, 0]}


def section(**more):
    return {
        "length": L, "mass": 2.0, "diameter": 0.03, "axial_stiffness": EA, "max_strain": 0.2, "bending_stiffness": 50.0,
        "torsional_stiffness": GJ, "tension_torque": C,
    } | more  # fmt: skip


def hanging(model, end, force, **more):
    sections = more.pop("sections", [section()])
    return hybrid.validate_scene(
        cable_scene(sections, {"kind": "clamped", "position": [0, 0, 0], **DOWN},
                     {"kind": end, "force": [0, 0, -force], **(DOWN if end == "guided" else {})},
                     gravity=more.pop("gravity", G), model=model, mesh=200, output={"points": 41}) | more
    )  # fmt: skip


@pytest.mark.parametrize("model", ["rod", "catenary", ZONES], ids=["rod", "catenary", "zones"])
def test_a_line_that_is_held_has_the_torque_of_its_mean_tension(model):
    found = hybrid.static(hanging(model, "guided", 500.0))
    mean = 500.0 + 0.5 * W * L
    np.testing.assert_allclose(found["torque"][0], C * mean, rtol=1e-9)
    assert -found["position"][0, -1, 2] == pytest.approx(L * (1.0 + mean / EA), rel=1e-12)
    s = found["s"]
    turn = (C * mean * s - C * (500.0 * s + W * (L * s - 0.5 * s * s))) / GJ  # a parabola
    if model == "rod":
        twist = found["twist"][0]
        np.testing.assert_allclose(np.gradient(turn, s, edge_order=2), twist, atol=1e-9)


@pytest.mark.parametrize("model", ["rod", "catenary", ZONES], ids=["rod", "catenary", "zones"])
def test_a_line_that_turns_freely_has_none_and_is_softer(model):
    found = hybrid.static(hanging(model, "free", 500.0))
    mean = 500.0 + 0.5 * W * L
    assert -found["position"][0, -1, 2] == pytest.approx(L * (1.0 + mean * (1.0 / EA + C * C / GJ)), rel=1e-12)
    if model == "rod":
        assert np.abs(found["torque"][0]).max() < 1e-9 * C * mean
        T = 500.0 + W * (L - found["s"])
        np.testing.assert_allclose(found["twist"][0], -C * T / GJ, rtol=1e-9)
        turns = np.trapezoid(found["twist"][0], found["s"]) / (2.0 * np.pi)
        assert turns == pytest.approx(-C * mean * L / GJ / (2.0 * np.pi), rel=1e-9)


def test_it_is_left_out_where_nothing_has_it():
    plain = section()
    plain.pop("tension_torque")
    none = hybrid.static(hanging("rod", "guided", 500.0, sections=[plain]))
    assert np.abs(none["torque"][0]).max() < 1e-12


@pytest.mark.parametrize(
    ("change", "where"),
    [
        ({"axial_stiffness": None}, "axial_stiffness"),
        ({"torsional_stiffness": None}, "torsional_stiffness"),
        ({"tension_torque": 2.0}, "tension_torque"),
        ({}, "tension_torque"),  # in a plane
    ],
)
def test_what_it_needs(change, where):
    given = {key: value for key, value in (section() | change).items() if value is not None}
    with pytest.raises(hybrid.SceneError, match=where):
        hanging("rod", "guided", 500.0, sections=[given], **({} if change else {"dimension": 2}))


@pytest.mark.long
def test_cells_that_follow_the_curvature_carry_it():
    """A sagging tether that is moved: torque of 400 rods, on cells that change, and positions as near as without it."""
    clamp = {"kind": "clamped", "position": [0, 0, 0], "tangent": [1, 0, -1], "normal": [0, 1, 0]}
    far = clamp | {"position": [20, 0, 4], "tangent": [1, 0, 1.2],
                   "motion": {"travel": {"by": [3, 2, 1], "over": 2.0}}}  # fmt: skip
    follows = {"kind": "adaptive", "curvature_error": 0.02}

    def run(model, cells, torque):
        tether = section(length=30.0, mass=3.0, bending_stiffness=40.0, tension_torque=torque, damping={"mass": 0.2})
        return hybrid.run(cable_scene(
            tether, clamp, far, gravity=G, contact={"self": False}, model=model, mesh=cells, time=(3.0, 0.02),
            output=(0.5, 31)
        ))  # fmt: skip

    fine, plain = run("rod", 400, 5e-3), run("rod", 400, 0.0)
    found, without = run(follows, 40, 5e-3), run(follows, 40, 0.0)
    largest, stays = np.abs(fine["torque"]).max(), run({"kind": "adaptive"}, 100, 5e-3)
    off, of_others = (np.abs(x["torque"] - fine["torque"]).max() for x in (found, stays))
    assert off < 1.2 * of_others < 0.05 * largest  # as near as zones on cells that stay
    assert np.abs(plain["torque"]).max() < 0.1 * largest
    apart, apart_without = (np.abs(x.position - y.position).max() for x, y in ((found, fine), (without, plain)))
    assert apart < 1.2 * apart_without < 1e-2
    changes, of_plain = (abs(x["work/zones"][-1]) for x in (found, without))
    assert changes < 1.2 * of_plain < 1.0


# --- torques that are saved ---


def test_answers_serve_for_steps_of_the_same_length():
    """Round-off of the times of steps is no other length: answers were found anew in every step."""
    section = {"length": 6.0, "mass": 0.6, "diameter": 0.02, "bending_stiffness": 10.0, "torsional_stiffness": 8.0}
    sway = {"motion": {"sway": {"amplitude": 0.5, "period": 4.0}, "ramp": 1.0}}
    clamp = {"kind": "clamped", "normal": [0, 1, 0]}
    scene = hybrid.validate_scene(cable_scene(
        section | {"damping": {"mass": 0.2}}, clamp | {"position": [0, 0, 0], "tangent": [0.75, 0, -0.66]},
        clamp | {"position": [5.5, 0, 0], "tangent": [0.75, 0, 0.66], "turns": 2.0} | sway, gravity=9.81,
        time=(5.0, 0.01), output=1.0,
        model={"kind": "zones",
               "zones": [{"rod": 1.5, "cells": 6}, {"catenary": 3, "cells": 12}, {"rod": 1.5, "cells": 6}]}
    ))  # fmt: skip
    simulation, served = hybrid.Simulation(scene), []
    simulation.advance(0.5)
    for _ in range(12):
        simulation.advance(simulation.t + 0.01)
        served.append(int(OnlyLine(simulation).work.torsion.known[1]))
    assert max(served) > 10, f"iterations that answers served: {served}"


# --- Torque of tension beside tables of tension over strain, fibre ropes, polyester and creep ---
# With F the energy of the law, W = F(eps + c tau) + GJ tau^2/2 per length: T is that of the law at eps + c tau, Q = GJ tau + c T.

C_BY_LAW, EA_BY_LAW, GJ_BY_LAW, L_BY_LAW = 5e-3, 5e4, 8.0, 60.0
TABLE = [[0, 0], [0.002, 100], [0.004, 240], [0.02, 2500]]
DYNAMIC = {"constant": 2e5, "per_tension": 20.0, "relaxation_time": 2.0}
PER, LOADED, HIGHEST, K1 = 5e-4, 1.0, 260.0, 0.4
LAWS: dict[str, dict[str, Any]] = {
    "stiffness": {"axial_stiffness": EA_BY_LAW},
    "table": {"tension_strain": TABLE},
    "rope": {"axial_stiffness": EA_BY_LAW, "dynamic_stiffness": DYNAMIC},
    "rope by a table": {"tension_strain": TABLE, "dynamic_stiffness": DYNAMIC},
    "polyester": {
        "syrope": {"curve": TABLE, "working": "linear", "k1": K1, "highest_tension": HIGHEST},
        "dynamic_stiffness": DYNAMIC | {"constant": 6e5},
    },
    "creep": {"axial_stiffness": EA_BY_LAW, "creep": {"per_decade": PER, "loaded": LOADED}},
}  # fmt: skip
STRAIGHT = {"tension_strain": [[0, 0], [0.001, 50], [0.005, 250], [0.1, 5000]]}  # EA
ZONES_BY_LAW = {"kind": "zones", "zones": [{"rod": 12.0}, {"catenary": 36.0}, {"rod": 12.0}]}
MODELS = {"rod": "rod", "catenary": "catenary", "zones": ZONES_BY_LAW}
ALONG = {"tangent": [1, 0, 0], "normal": [0, 1, 0]}


def section_by_law(law: dict[str, Any], **more: Any) -> dict[str, Any]:
    return {
        "length": L_BY_LAW, "mass": 0.6, "diameter": 0.02, "bending_stiffness": 2.0, "torsional_stiffness": GJ_BY_LAW,
        "tension_torque": C_BY_LAW, "max_strain": 0.02,
    } | law | more  # fmt: skip


def at_rest(name: str, T: float) -> float:
    """Strain of a law at rest under T."""
    strain, tension = np.array(TABLE, float).T
    if name in ("stiffness", "rope", "creep"):
        return T / EA_BY_LAW
    if name == "polyester" and T < HIGHEST:
        top = float(np.interp(HIGHEST, tension, strain))
        return top * (K1 + (1.0 - K1) * T / HIGHEST)
    return float(np.interp(T, tension, strain))


def stored_at_rest(name: str, T: float) -> float:
    """Energy per length, J/m: the integral of tension over strain, of polyester over that of its working line."""
    if name == "polyester":
        top = max(T, HIGHEST)
        return 0.5 * (1.0 - K1) * float(np.interp(top, *np.array(TABLE, float).T[::-1])) * T * T / top
    at = np.linspace(0.0, T, 20001)
    x = np.array([at_rest(name, y) for y in at])
    return float(np.sum(0.5 * (at[1:] + at[:-1]) * np.diff(x)))


def pulled(law: dict[str, Any], model: Any, end: str, force: Any, turns: float = 0.0, **more: Any) -> dict[str, Any]:
    """A straight line without weight that is pulled along x, and twisted."""
    far = {"kind": end, "force": force if isinstance(force, dict) else [force, 0, 0]}
    far |= ALONG | {"turns": turns} if end == "guided" else {}
    return cable_scene(
        more.pop("sections", [section_by_law(law)]), {"kind": "clamped", "position": [0, 0, 0], **ALONG}, far, gravity=0,
        initial={"kind": "equilibrium", "guess": "straight", "direction": [1, 0, 0]}, model=model, mesh=30,
        output={"points": 21}
    ) | more  # fmt: skip


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("name", LAWS)
@pytest.mark.long  # 5 s of 15 cases
def test_a_straight_line_that_is_pulled_and_twisted(name: str, model: str) -> None:
    """Held: tau = 2 pi turns/L, Q = GJ tau + c T, eps = s(T) - c tau.  Free: tau = -c T/GJ, eps = s(T) + c^2 T/GJ."""
    for T, turns in ((150.0, 1.0), (220.0, -2.0), (700.0, 3.0)):
        found = hybrid.static(pulled(LAWS[name], MODELS[model], "guided", T, turns))
        tau = 2.0 * np.pi * turns / L_BY_LAW
        assert found.position[0, -1, 0] == pytest.approx(
            L_BY_LAW * (1.0 + at_rest(name, T) - C_BY_LAW * tau), rel=1e-11
        )
        np.testing.assert_allclose(found["torque"][0], GJ_BY_LAW * tau + C_BY_LAW * T, rtol=1e-8)
        np.testing.assert_allclose(found["tension"][0], T, rtol=1e-8)
        energy = strain_energy(found)
        assert energy == pytest.approx(L_BY_LAW * (stored_at_rest(name, T) + 0.5 * GJ_BY_LAW * tau * tau), rel=1e-6)
        found = hybrid.static(pulled(LAWS[name], MODELS[model], "free", T))
        longer = at_rest(name, T) + C_BY_LAW * C_BY_LAW * T / GJ_BY_LAW
        assert found.position[0, -1, 0] == pytest.approx(L_BY_LAW * (1.0 + longer), rel=1e-11)
        energy = strain_energy(found)
        assert energy == pytest.approx(
            L_BY_LAW * (stored_at_rest(name, T) + 0.5 * (C_BY_LAW * T) ** 2 / GJ_BY_LAW), rel=1e-6
        )


def test_two_laws_laid_against_each_other() -> None:
    """A table and a stiffness in series share the twist by their compliances, and each stretches by its own law."""
    soft, T = 3.0, 400.0
    sections = [
        section_by_law(LAWS["table"], length=20.0),
        section_by_law(LAWS["stiffness"], tension_torque=-2e-3, torsional_stiffness=soft),
    ]
    found = hybrid.static(pulled({}, "rod", "guided", T, sections=sections, mesh={"cells": 40}))
    torque = T * (20.0 * C_BY_LAW / GJ_BY_LAW - L_BY_LAW * 2e-3 / soft) / (20.0 / GJ_BY_LAW + L_BY_LAW / soft)
    np.testing.assert_allclose(found["torque"][0], torque, rtol=1e-8)
    first, second = (torque - C_BY_LAW * T) / GJ_BY_LAW, (torque + 2e-3 * T) / soft
    x = 20.0 * (1.0 + at_rest("table", T) - C_BY_LAW * first) + L_BY_LAW * (1.0 + T / EA_BY_LAW + 2e-3 * second)
    assert found.position[0, -1, 0] == pytest.approx(x, rel=1e-11)


def strain_energy(found: hybrid.Result) -> float:
    """At rest, J; of a catenary that turns freely all is of stretch."""
    return float(sum(found[x][0] for x in ("energy/stretch", "energy/torsion") if x in found))


FORCES = [[0.0, 150], [1.0, 150], [1.5, 420], [4.0, 420], [4.5, 90], [7.0, 90], [7.5, 500], [10.0, 500]]


def light(name: str, end: str, c: float) -> hybrid.Result:
    """A light line under a force that changes: its length is the law's own history."""
    force = {"history": [[t, F, 0, 0] for t, F in FORCES]}
    bar = section_by_law(LAWS[name], length=10.0, mass=2e-3, tension_torque=c)
    del bar["diameter"]
    return hybrid.run(
        pulled({}, "rod", end, force, sections=[bar], mesh={"cells": 5},
               time={"duration": 10.0, "step": 0.05}, output={"every": 0.5, "points": 6})
    )  # fmt: skip


@pytest.mark.parametrize("name", LAWS)
def test_the_history_of_a_law_is_that_of_its_tension(name: str) -> None:
    """Held against turning it is the line without torque; where it turns freely it is longer by c^2 T/GJ."""
    held, plain = light(name, "guided", C_BY_LAW), light(name, "guided", 0.0)
    t = plain.t
    T = np.interp(t, *np.array(FORCES).T)
    calm = np.array([not any(abs(x - y[0]) < 0.4 for y in FORCES[1:-1]) for x in t])
    assert calm.sum() > 8
    apart = np.abs(held.position - plain.position)[calm].max()
    assert apart < 1e-7
    np.testing.assert_allclose(held["torque"][calm, 2], C_BY_LAW * T[calm], rtol=1e-4)
    free, plain = light(name, "free", C_BY_LAW), light(name, "free", 0.0)
    longer = free.position[:, -1, 0] - plain.position[:, -1, 0]
    assert np.abs(longer - 10.0 * C_BY_LAW * C_BY_LAW * T / GJ_BY_LAW)[calm].max() < 1e-6
    assert np.ptp(longer) > 1e-2


def test_a_twisted_rope_creeps() -> None:
    """Under a constant pull, held with turns: eps = T/EA + creep - c tau, the same torque; the pull's work is lost."""
    pull, turns = 300.0, 2.0
    bar = section_by_law(LAWS["creep"], damping=1.0)
    found = hybrid.run(
        pulled({}, "rod", "guided", pull, turns, sections=[bar], time={"duration": 60.0, "step": 0.1},
               output={"every": 5.0, "points": 6})
    )  # fmt: skip
    tau, crept = 2.0 * np.pi * turns / L_BY_LAW, PER * np.log10(1.0 + found.t / LOADED)
    assert np.abs(found.position[:, -1, 0] - L_BY_LAW * (1.0 + pull / EA_BY_LAW + crept - C_BY_LAW * tau)).max() < 5e-5
    np.testing.assert_allclose(found["torque"][:], GJ_BY_LAW * tau + C_BY_LAW * pull, rtol=1e-4)
    assert float(found["work/hysteresis"][-1]) == pytest.approx(-pull * L_BY_LAW * crept[-1], rel=1e-3)


def sag_by_law(law: dict[str, Any], model: Any = "rod", step: float = 0.01, **more: Any) -> dict[str, Any]:
    """60 m between clamps, the second of which swings."""
    swing = {"sway": {"amplitude": 1.5, "period": 6.0}, "surge": {"amplitude": 0.5, "period": 4.0}, "ramp": 4.0}
    ends = [{"kind": "clamped", "tangent": [0.6, 0, z], "normal": [0, 1, 0]} for z in (-0.8, 0.8)]
    damping = {"damping": {"stiffness": more.pop("damped")}} if "damped" in more else {}
    turns = more.pop("turns", 0.0)
    return (
        cable_scene(section_by_law(law, **damping), {**ends[0], "position": [0, 0, 0]},
                    {**ends[1], "position": [52, 0, 0], "motion": swing, "turns": turns}, gravity=9.81, model=model,
                    mesh=120, time=(6.0, step, 0.9), output=(0.5, 61)) | more
    )  # fmt: skip


TAU = 0.01  # s, of damping
ALIKE = ("position", "tension", "torque")


@pytest.mark.parametrize("damped", [0.0, TAU], ids=["undamped", "damped"])
@pytest.mark.parametrize("model", ["rod", "zones"])
def test_a_straight_table_is_a_stiffness(model: str, damped: float) -> None:
    more = {"damped": damped} if damped else {}
    one, other = (hybrid.run(sag_by_law(law, MODELS[model], 0.02, **more)) for law in (LAWS["stiffness"], STRAIGHT))
    for name in ALIKE if damped else (*ALIKE, "energy/stretch", "energy/torsion"):
        assert np.abs(other[name] - one[name]).max() < 1e-9 * np.abs(one[name]).max(), name


@cache
def swung(name: str, step: float, damped: float) -> hybrid.Result:
    """A run of rods, once."""
    return hybrid.run(sag_by_law(LAWS[name], "rod", step, **({"damped": damped} if damped else {})))


@pytest.mark.parametrize("damped", [0.0, TAU], ids=["undamped", "damped"])
@pytest.mark.parametrize("name", LAWS)
def test_energy_balances(name: str, damped: float) -> None:
    """To second order in the step; damped, all the same: better than that of a constant stiffness, whose energy is told
    apart cell by cell."""
    coarse, fine = (swung(name, step, damped) for step in (0.02, 0.01))
    left = [float(np.abs(x["work/scheme"]).max()) for x in (coarse, fine)]
    put_in = float(np.abs(fine["work/end"]).max())
    print(f"{name}: {left} J of {put_in:.3f} J")
    assert left[1] < 2e-4 * put_in
    assert left[0] > 2.5 * left[1] or (damped and name == "stiffness")
    if damped:
        assert (np.diff(fine["work/stiffness_damping"]) <= 1e-9).all()
        plain = float(np.abs(swung("stiffness", 0.01, damped)["work/scheme"]).max())
        assert left[1] < 1.5 * plain


@cache
def apart(name: str, damped: float) -> float:
    """How far the torque of zones is from that of rods, of its largest."""
    rods = swung(name, 0.01, damped)
    mixed = hybrid.run(sag_by_law(LAWS[name], ZONES_BY_LAW, 0.01, **({"damped": damped} if damped else {})))
    return float(np.abs(mixed["torque"][:, 30] - rods["torque"][:, 30]).max() / np.abs(rods["torque"][:, 30]).max())


@pytest.mark.parametrize("damped", [0.0, TAU], ids=["undamped", "damped"])
@pytest.mark.parametrize("name", LAWS)
def test_zones_are_rods(name: str, damped: float) -> None:
    off = apart(name, damped)
    print(f"{name}, damped {damped}: {off:.3g}")
    assert off < (1e-3 if not damped else 1.5 * apart("stiffness", damped))


@pytest.mark.parametrize("name", ["stiffness", "table", "polyester"])
def test_zones_that_move(name: str) -> None:
    """Cells that come and go keep the torque of the tension: against rods with the same tension."""
    found = hybrid.run(sag_by_law(LAWS[name], {"kind": "adaptive", "force_rod": [[20, 30]]}, 0.02, turns=1.5))
    rods = hybrid.run(sag_by_law(LAWS[name], "rod", 0.02, turns=1.5))
    tension = found["tension"][:].mean(axis=1) - rods["tension"][:].mean(axis=1)
    torque = found["torque"][:, 30] - rods["torque"][:, 30]
    assert np.abs(torque - C_BY_LAW * tension).max() < 1e-3 * np.abs(rods["torque"][:]).max()
    assert np.abs(found["turns/link"][:] - found["turns/link"][0]).max() < 0.3
