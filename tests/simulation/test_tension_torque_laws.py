"""Torque of tension beside tables of tension over strain, fibre ropes, polyester and creep.

With F the energy of the law, W = F(eps + c tau) + GJ tau^2/2 per length: T is that of the law at eps + c tau, Q = GJ tau + c T.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest

import hybrid
from tests.scenes import cable_scene

C, EA, GJ, L = 5e-3, 5e4, 8.0, 60.0
TABLE = [[0, 0], [0.002, 100], [0.004, 240], [0.02, 2500]]
DYNAMIC = {"constant": 2e5, "per_tension": 20.0, "relaxation_time": 2.0}
PER, LOADED, HIGHEST, K1 = 5e-4, 1.0, 260.0, 0.4
LAWS: dict[str, dict[str, Any]] = {
    "table": {"tension_strain": TABLE},
    "rope": {"axial_stiffness": EA, "dynamic_stiffness": DYNAMIC},
    "rope by a table": {"tension_strain": TABLE, "dynamic_stiffness": DYNAMIC},
    "polyester": {
        "syrope": {"curve": TABLE, "working": "linear", "k1": K1, "highest_tension": HIGHEST},
        "dynamic_stiffness": DYNAMIC | {"constant": 6e5},
    },
    "creep": {"axial_stiffness": EA, "creep": {"per_decade": PER, "loaded": LOADED}},
}  # fmt: skip
STIFF = {"axial_stiffness": EA}
STRAIGHT = {"tension_strain": [[0, 0], [0.001, 50], [0.005, 250], [0.1, 5000]]}  # EA
ZONES = {"kind": "zones", "zones": [{"rod": 12.0}, {"catenary": 36.0}, {"rod": 12.0}]}
MODELS = {"rod": "rod", "catenary": "catenary", "zones": ZONES}
ALONG = {"tangent": [1, 0, 0], "normal": [0, 1, 0]}


def section(law: dict[str, Any], **more: Any) -> dict[str, Any]:
    return {
        "length": L, "mass": 0.6, "diameter": 0.02, "bending_stiffness": 2.0, "torsional_stiffness": GJ,
        "tension_torque": C, "max_strain": 0.02,
    } | law | more  # fmt: skip


def at_rest(name: str, T: float) -> float:
    """Strain of a law at rest under T."""
    strain, tension = np.array(TABLE, float).T
    if name in ("rope", "creep"):
        return T / EA
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
        more.pop("sections", [section(law)]), {"kind": "clamped", "position": [0, 0, 0], **ALONG}, far, gravity=0,
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
        tau = 2.0 * np.pi * turns / L
        assert found.position[0, -1, 0] == pytest.approx(L * (1.0 + at_rest(name, T) - C * tau), rel=1e-11)
        np.testing.assert_allclose(found["torque"][0], GJ * tau + C * T, rtol=1e-8)
        np.testing.assert_allclose(found["tension"][0], T, rtol=1e-8)
        energy = strain_energy(found)
        assert energy == pytest.approx(L * (stored_at_rest(name, T) + 0.5 * GJ * tau * tau), rel=1e-6)
        found = hybrid.static(pulled(LAWS[name], MODELS[model], "free", T))
        longer = at_rest(name, T) + C * C * T / GJ
        assert found.position[0, -1, 0] == pytest.approx(L * (1.0 + longer), rel=1e-11)
        energy = strain_energy(found)
        assert energy == pytest.approx(L * (stored_at_rest(name, T) + 0.5 * (C * T) ** 2 / GJ), rel=1e-6)


def test_two_laws_laid_against_each_other() -> None:
    """A table and a stiffness in series share the twist by their compliances, and each stretches by its own law."""
    soft, T = 3.0, 400.0
    sections = [section(LAWS["table"], length=20.0), section(STIFF, tension_torque=-2e-3, torsional_stiffness=soft)]
    found = hybrid.static(pulled({}, "rod", "guided", T, sections=sections, mesh={"cells": 40}))
    torque = T * (20.0 * C / GJ - L * 2e-3 / soft) / (20.0 / GJ + L / soft)
    np.testing.assert_allclose(found["torque"][0], torque, rtol=1e-8)
    first, second = (torque - C * T) / GJ, (torque + 2e-3 * T) / soft
    x = 20.0 * (1.0 + at_rest("table", T) - C * first) + L * (1.0 + T / EA + 2e-3 * second)
    assert found.position[0, -1, 0] == pytest.approx(x, rel=1e-11)


def strain_energy(found: hybrid.Result) -> float:
    """At rest, J; of a catenary that turns freely all is of stretch."""
    return float(sum(found[x][0] for x in ("energy/stretch", "energy/torsion") if x in found))


FORCES = [[0.0, 150], [1.0, 150], [1.5, 420], [4.0, 420], [4.5, 90], [7.0, 90], [7.5, 500], [10.0, 500]]


def light(name: str, end: str, c: float) -> hybrid.Result:
    """A light line under a force that changes: its length is the law's own history."""
    force = {"history": [[t, F, 0, 0] for t, F in FORCES]}
    bar = section(LAWS[name], length=10.0, mass=2e-3, tension_torque=c)
    del bar["diameter"]
    return hybrid.run(
        pulled({}, "rod", end, force, sections=[bar], mesh={"cells": 5},
               time={"duration": 10.0, "step": 0.05}, output={"every": 0.5, "points": 6})
    )  # fmt: skip


@pytest.mark.parametrize("name", LAWS)
def test_the_history_of_a_law_is_that_of_its_tension(name: str) -> None:
    """Held against turning it is the line without torque; where it turns freely it is longer by c^2 T/GJ."""
    held, plain = light(name, "guided", C), light(name, "guided", 0.0)
    t = plain.t
    T = np.interp(t, *np.array(FORCES).T)
    calm = np.array([not any(abs(x - y[0]) < 0.4 for y in FORCES[1:-1]) for x in t])
    assert calm.sum() > 8
    apart = np.abs(held.position - plain.position)[calm].max()
    assert apart < 1e-7
    np.testing.assert_allclose(held["torque"][calm, 2], C * T[calm], rtol=1e-4)
    free, plain = light(name, "free", C), light(name, "free", 0.0)
    longer = free.position[:, -1, 0] - plain.position[:, -1, 0]
    assert np.abs(longer - 10.0 * C * C * T / GJ)[calm].max() < 1e-6
    assert np.ptp(longer) > 1e-2


def test_a_twisted_rope_creeps() -> None:
    """Under a constant pull, held with turns: eps = T/EA + creep - c tau, the same torque; the pull's work is lost."""
    pull, turns = 300.0, 2.0
    bar = section(LAWS["creep"], damping=1.0)
    found = hybrid.run(
        pulled({}, "rod", "guided", pull, turns, sections=[bar], time={"duration": 60.0, "step": 0.1},
               output={"every": 5.0, "points": 6})
    )  # fmt: skip
    tau, crept = 2.0 * np.pi * turns / L, PER * np.log10(1.0 + found.t / LOADED)
    assert np.abs(found.position[:, -1, 0] - L * (1.0 + pull / EA + crept - C * tau)).max() < 5e-5
    np.testing.assert_allclose(found["torque"][:], GJ * tau + C * pull, rtol=1e-4)
    assert float(found["work/hysteresis"][-1]) == pytest.approx(-pull * L * crept[-1], rel=1e-3)


def sag(law: dict[str, Any], model: Any = "rod", step: float = 0.01, **more: Any) -> dict[str, Any]:
    """60 m between clamps, the second of which swings."""
    swing = {"sway": {"amplitude": 1.5, "period": 6.0}, "surge": {"amplitude": 0.5, "period": 4.0}, "ramp": 4.0}
    ends = [{"kind": "clamped", "tangent": [0.6, 0, z], "normal": [0, 1, 0]} for z in (-0.8, 0.8)]
    damping = {"damping": {"stiffness": more.pop("damped")}} if "damped" in more else {}
    turns = more.pop("turns", 0.0)
    return (
        cable_scene(section(law, **damping), {**ends[0], "position": [0, 0, 0]},
                    {**ends[1], "position": [52, 0, 0], "motion": swing, "turns": turns}, gravity=9.81, model=model,
                    mesh=120, time=(6.0, step, 0.9), output=(0.5, 61)) | more
    )  # fmt: skip


TAU = 0.01  # s, of damping
ALIKE = ("position", "tension", "torque")


@pytest.mark.parametrize("damped", [0.0, TAU], ids=["undamped", "damped"])
@pytest.mark.parametrize("model", ["rod", "zones"])
def test_a_straight_table_is_a_stiffness(model: str, damped: float) -> None:
    more = {"damped": damped} if damped else {}
    one, other = (hybrid.run(sag(law, MODELS[model], 0.02, **more)) for law in (STIFF, STRAIGHT))
    for name in ALIKE if damped else (*ALIKE, "energy/stretch", "energy/torsion"):
        assert np.abs(other[name] - one[name]).max() < 1e-9 * np.abs(one[name]).max(), name


def law_of(name: str) -> dict[str, Any]:
    return STIFF if name == "stiffness" else LAWS[name]


@cache
def swung(name: str, step: float, damped: float) -> hybrid.Result:
    """A run of rods, once."""
    return hybrid.run(sag(law_of(name), "rod", step, **({"damped": damped} if damped else {})))


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
    assert left[0] > 2.5 * left[1]
    if damped:
        assert (np.diff(fine["work/stiffness_damping"]) <= 1e-9).all()
        plain = float(np.abs(swung("stiffness", 0.01, damped)["work/scheme"]).max())
        assert left[1] < 1.5 * plain


@cache
def apart(name: str, damped: float) -> float:
    """How far the torque of zones is from that of rods, of its largest."""
    rods = swung(name, 0.01, damped)
    mixed = hybrid.run(sag(law_of(name), ZONES, 0.01, **({"damped": damped} if damped else {})))
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
    found = hybrid.run(sag(law_of(name), {"kind": "adaptive", "force_rod": [[20, 30]]}, 0.02, turns=1.5))
    rods = hybrid.run(sag(law_of(name), "rod", 0.02, turns=1.5))
    tension = found["tension"][:].mean(axis=1) - rods["tension"][:].mean(axis=1)
    torque = found["torque"][:, 30] - rods["torque"][:, 30]
    assert np.abs(torque - C * tension).max() < 1e-3 * np.abs(rods["torque"][:]).max()
    assert np.abs(found["turns/link"][:] - found["turns/link"][0]).max() < 0.3
