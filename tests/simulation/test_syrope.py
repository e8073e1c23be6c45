"""Polyester rope whose tension over strain depends on the highest mean tension that it has had (Syrope).

A bar of light cells under a force that is given has the tension of that force, so its length is the law itself:
theta' = (T - theta)/tau, strain = s(theta; highest theta) + (T - theta)/(a + b theta), solved here by itself.
"""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp
from scipy.optimize import brentq
from test_axial_law import assert_cut_is_whole, bar

import hybrid

OWC = [[0, 0], [0.01, 1000], [0.02, 1900], [0.03, 3000], [0.05, 5000]]
TAU, A, B = 3.0, 4e5, 20.0
DYNAMIC = {"constant": A, "per_tension": B, "relaxation_time": TAU}
HIGHEST = 2500.0
SHAPES: dict[str, dict[str, Any]] = {
    "linear": {"working": "linear", "k1": 0.4},
    "stiffness": {"working": "linear", "k1": 1.6e5},
    "quadratic": {"working": "quadratic", "k1": 0.3, "k2": 1.0},
    "exponential": {"working": "exponential", "k1": 0.2, "k2": 1.5},
}


def rope(which: str, **more: Any) -> dict[str, Any]:
    return {"syrope": {"curve": OWC, "highest_tension": HIGHEST} | SHAPES[which] | more, "dynamic_stiffness": DYNAMIC}


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
        scene = bar(rope(which), [[0, T, 0, 0], [1, T, 0, 0]], model=kind, dimension=dimension)
        found = hybrid.static(scene)
        assert found.position[-1, -1, 0] == pytest.approx(10 * (1 + at_rest(which, T, HIGHEST)), rel=1e-9)
        top = max(T, HIGHEST)
        strains = [at_rest(which, x, top) for x in (1e-9, T)]
        stored = T * strains[1] - quad(lambda x, top=top: at_rest(which, x, top), 0, T, epsabs=1e-9)[0]
        assert found["energy/stretch"][-1] == pytest.approx(10 * stored, rel=1e-4)


# Past the highest tension, below it, past it once more.
HISTORY = [
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
    times, force = np.array(HISTORY)[:, 0], np.array(HISTORY)[:, 1]
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
    found = hybrid.run(bar(rope(which), HISTORY, model=kind))
    strain = solved(which, found.t)
    calm = np.array([not any(abs(t - x[0]) < 0.4 for x in HISTORY[1:-1]) for t in found.t])
    assert np.abs(found.position[:, -1, 0] - 10 * (1 + strain))[calm].max() < 2e-5
    again = calm & (found.t > 11.0) & (found.t < 13.0)  # 900 N, as a rope would bear them without its past
    assert (strain[again] > 1.3 * original(900.0)).all()


def swing(which: str, step: float) -> dict[str, Any]:
    """A heavy bar that rings along itself, pulled past its highest tension and let go."""
    history = [
        [0.0, 2000, 0, 0],
        [0.2, 2000, 0, 0],
        [0.7, 4200, 0, 0],
        [2, 4200, 0, 0],
        [2.5, 1200, 0, 0],
        [4, 1200, 0, 0],
    ]
    section = {"mass": 20.0} | rope(which) | {"dynamic_stiffness": DYNAMIC | {"relaxation_time": 1.0}}
    return bar(section, history, time={"duration": 4.0, "step": step, "rho_inf": 1.0})


@pytest.mark.parametrize("which", ["quadratic", "exponential"])
def test_energy_balances_and_nothing_is_gained(which: str) -> None:
    off = []
    for step in (4e-3, 2e-3):
        found = hybrid.run(swing(which, step))
        off.append(np.abs(found["work/scheme"]).max())
        lost = np.diff(found["work/hysteresis"])
        assert (lost <= 1e-9).all() and lost.sum() < -20.0  # J
        assert np.abs(found["work/stiffness_damping"]).max() < 1e-4 and np.abs(found["work/scheme"]).max() < 0.05
    print(f"energy that no work accounts for: {off} J")
    assert off[1] < 0.35 * off[0]


SECTION = {
    "syrope": {"curve": [[x, 3 * T] for x, T in OWC], "highest_tension": 2700.0, **SHAPES["exponential"]},
    "dynamic_stiffness": {"constant": 9e5, "per_tension": 15, "relaxation_time": 2},
}


def test_a_rope_that_is_cut_is_the_same_rope() -> None:
    assert_cut_is_whole(SECTION, heave=0.6)


@pytest.mark.parametrize(
    ("section", "expected"),
    [
        ({"dynamic_stiffness": None}, "a table, because syrope remembers"),
        ({"axial_stiffness": 1e5}, "because syrope says how it stretches"),
        ({"max_strain": 0.2}, "at most the strain of the last row"),
        ({"dynamic_stiffness": DYNAMIC | {"constant": 1.2e5, "per_tension": 0}}, "more: the static stiffness is"),
        (rope("linear", k2=1.0), "linear working curves have one number"),
        (rope("quadratic", k2=1.5), "at most 1"),
        (rope("exponential", k2=None), "a number, of exponential working curves"),
        (rope("exponential", k1=1.0), "a part below 1"),
        (rope("stiffness", k1=9e4), "working curves begin at strains from 0 on"),
        (rope("linear", highest_tension=6e3), "at most the tension of the last row"),
        (
            rope("linear", k1=0.0, curve=[[0, 0], [0.02, 1e3], [0.03, 5e3]]) | {"dynamic_stiffness": DYNAMIC | {"constant": 1e6}},
            "give back more than it took up",
        ),
        (rope("linear", curve=[[0, 0]]), "at least two rows"),
    ],
)  # fmt: skip
def test_what_cannot_be_is_refused(section: dict[str, Any], expected: str) -> None:
    with pytest.raises(hybrid.SceneError, match=expected):
        hybrid.validate_scene(bar(rope("exponential") | section, HISTORY))
