"""Layers that slip as a line bends: Masing's rule and its loops, two axes against rates integrated otherwise, energy."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

import hybrid
from hybrid.errors import SceneError
from tests.scenes import cable_scene, clamped_at

Floats = NDArray[np.float64]
EI, STUCK, SLIP = 9.67e3, 87.2e3, 872.0  # N m2, N m2, N m: it slips at 0.01 1/m
ONE = {"bending_stiffness": EI, "bending_slip": [{"stiffness": STUCK, "moment": SLIP}]}
FIRST = [[0, 0], [0.01, 968.7], [0.03, 1500.0], [0.05, 1700.0]]  # two layers, and 10 kN m2 beyond
LENGTH, CELLS, PERIOD = 2.0, 8, 40.0


def bent(moments: list[list[float]], step: float, mass: float = 0.1, **section: Any) -> dict[str, Any]:
    """A cantilever without weight under a moment at its end, rows [t, x, y, z]: bent evenly, and slowly."""
    return cable_scene(
        {"length": LENGTH, "mass": mass, "axial_stiffness": 1e8, "damping": 20.0} | section,
        clamped_at([0, 0, 0], [1, 0, 0], normal=[0, 1, 0]), {"kind": "free", "moment": {"history": moments}}, gravity=0,
        initial={"kind": "straight", "origin": [0, 0, 0], "direction": [1, 0, 0]}, model="rod", contact={"self": False},
        mesh=CELLS, time=(moments[-1][0], step), output={"every": step, "points": CELLS + 1, "exact": True}
    )  # fmt: skip


def cycled(most: float, dimension: int, **section: Any) -> hybrid.Result:
    """Two and a quarter cycles between +-most N m."""
    times = PERIOD * (0.25 + 0.5 * np.arange(5))
    rows = [[0.0, 0.0, 0.0, 0.0], *([float(t), 0.0, -most * (-1) ** k, 0.0] for k, t in enumerate(times))]
    return hybrid.run(bent(rows, PERIOD / 400, **section) | {"dimension": dimension})


def of_first_loading(kappa: Floats, table: list[list[float]]) -> Floats:
    """Moment of a first loading."""
    x, M = np.array(table, float).T
    beyond = np.maximum(np.abs(kappa) - x[-1], 0.0) * (M[-1] - M[-2]) / (x[-1] - x[-2])
    return np.asarray(np.sign(kappa) * (np.interp(np.abs(kappa), x, M) + beyond))


def masing(kappa: Floats, table: list[list[float]]) -> Floats:
    """Moment along a history between curvatures that turn at +-kappa_a: branches are twice the first loading."""
    out, turned, M_turned, way = np.zeros(kappa.size), 0.0, 0.0, 1.0
    for k in range(1, kappa.size):
        if (kappa[k] - kappa[k - 1]) * way < 0.0:
            turned, M_turned, way = kappa[k - 1], out[k - 1], -way
        half = 0.5 * (kappa[k] - turned)
        out[k] = M_turned + 2.0 * of_first_loading(half, table) if turned else of_first_loading(kappa[k], table)
    return out


@pytest.mark.long
@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize(
    ("section", "table", "most"),
    [
        (ONE, [[0, 0], [0.01, 968.7], [0.05, 1355.5]], 1355.5),
        ({"moment_curvature": FIRST, "first_loading": True}, FIRST, 1600.0),
    ],
    ids=["layer", "first loading"],
)
def test_cycles_follow_masings_rule(section: Any, table: Any, most: float, dimension: int) -> None:
    """Moment over curvature of every node and step to 1e-6, and what a cycle loses to 1e-3: 139.52 J/m of the layer."""
    found = cycled(most, dimension, **section)
    z = found.position[:, :, 2]
    for node in (2, CELLS // 2, CELLS - 2):
        side = np.sign(z[:, node - 1] - 2.0 * z[:, node] + z[:, node + 1])
        kappa, M = side * found.curvature[:, node], found.bending_moment[:, node]
        assert np.abs(np.abs(masing(kappa, table)) - M).max() < 1e-6 * M.max()
    a = float(np.abs(kappa[[100, 300, 500]]).mean())
    x, top = np.array(table, float).T
    slope = np.diff(top) / np.diff(x)
    area = 4.0 * sum(k * x_s * (a - x_s) for k, x_s in zip(slope[:-1] - slope[1:], x[1:-1], strict=True))
    if len(table) == 3:
        assert a == pytest.approx(0.05, rel=1e-3) and area == pytest.approx(139.52, rel=2e-3)
    lost, bends = -found["work/hysteresis"], LENGTH * (1.0 - 0.5 / CELLS)  # no element in the last half cell
    assert lost[500] - lost[100] == pytest.approx(bends * area, rel=1e-3)
    assert (np.diff(lost) >= -1e-12).all()
    off = found["work/scheme"]  # of what it costs that stiffness and rates jump where layers slip and stick
    print(f"energy that no work accounts for, J, of {lost[-1]:.1f} lost: {off.min():.3f} to {off.max():.3f}")
    assert off.max() < 1e-3 * lost[-1] and off.min() > -2e-3 * lost[-1]


def test_two_axes_are_those_of_rates_and_of_returns_integrated_otherwise() -> None:
    """A small moment that goes round: curvature (2) against rates, with order 1 in the step.

    It is held against small steps of its own, too, that return in closed form.
    """
    most, slip, over, turns = 12.0, 0.01 * SLIP, 10.0, 1.5

    def moment(t: float) -> Floats:
        return most * np.array([np.cos(2.0 * np.pi * turns * t / over), np.sin(2.0 * np.pi * turns * t / over)])

    def rate(t: float, p: Floats) -> Floats:
        """p' of a layer that always slips, from M = EI kappa + K (kappa - p)."""
        dM = 2.0 * np.pi * turns / over * np.array([-moment(t)[1], moment(t)[0]])
        nu = moment(t) - EI * p
        nu /= np.hypot(*nu)
        return np.asarray(max(float(nu @ dM), 0.0) / EI * nu)

    def returned(step: float) -> Floats:
        """Curvatures (5, 2), by returns: kappa - p lies along M - EI p."""
        p, out = np.zeros(2), []
        for t in np.arange(round(over / step) + 1) * step:
            q = moment(t) - EI * p
            if np.hypot(*q) * STUCK / (EI + STUCK) <= slip:
                out.append((moment(t) + STUCK * p) / (EI + STUCK))
                continue
            nu = q / np.hypot(*q)
            out.append(p + (q - slip * nu) / EI)
            p = out[-1] - slip / STUCK * nu
        return np.array(out)[:: len(out) // 4]

    first = np.array([(most - slip) / EI - slip / STUCK, 0.0])
    times = np.linspace(0.0, over, 5)
    slipped = solve_ivp(rate, (0.0, over), first, rtol=1e-10, atol=1e-14, t_eval=times).y.T
    exact = (np.array([moment(t) for t in times]) + STUCK * slipped) / (EI + STUCK)
    off, size = [], np.abs(exact).max()
    rows = [[0.0] * 4, *([5.0 + t, 0.0, *moment(t).tolist()] for t in np.linspace(0.0, over, 2001))]
    for step in (0.02, 0.01):
        layers = {"bending_stiffness": EI, "bending_slip": [{"stiffness": STUCK, "moment": slip}]}
        scene = bent(rows, step, 1e-2, **layers)
        scene["output"] |= {"every": 2.5}
        tip = hybrid.run(scene).position[2:, -1] * 2.0 / LENGTH**2  # curvature about y bends it down, about z along y
        kappa = np.column_stack([-tip[:, 2], tip[:, 1]])
        assert np.abs(kappa - returned(step)).max() < 1e-4 * size
        off.append(np.abs(kappa - exact).max() / size)
    print(f"curvature against rates, over the largest: {off}")
    assert off[1] < 7e-3 and 1.8 < off[0] / off[1] < 2.2


def test_a_slip_moment_grows_with_tension() -> None:
    """At rest, under its tension there: what the layer has is its slip moment, where it has slipped."""
    section = {"length": 4, "mass": 1, "bending_stiffness": EI, "axial_stiffness": 1e8,
               "bending_slip": [{"stiffness": STUCK, "moment": 100.0, "per_tension": 2e-3}]}  # fmt: skip
    scene = bent([[0, 0, 0, 0], [1, 0, 0, 0]], 0.1) | {"initial": "equilibrium", "mesh": {"cells": 40}}
    scene["cable"] = {"sections": [section]}
    scene["ends"]["end"] = {"kind": "free", "force": [2e4, 0, 3e3]}
    scene["output"] = {"points": 41}
    for dimension in (2, 3):
        found = hybrid.static(scene | {"dimension": dimension})
        kappa, M, T = found.curvature[0, 1:-1], found.bending_moment[0, 1:-1], found.tension[0, 1:-1]
        most = 100.0 + 2e-3 * T
        slipped = STUCK * kappa > most
        assert slipped[0] and not slipped[-1]
        assert np.abs(M - EI * kappa - np.minimum(STUCK * kappa, most)).max() < 1e-6 * M.max()


CABLE = {
    "length": 12, "mass": 2.0, "axial_stiffness": 1e5, "torsional_stiffness": 15, "bending_stiffness": 6.0,
    "bending_slip": [{"stiffness": 20.0, "moment": 0.4, "per_tension": 1e-3}, {"stiffness": 10.0, "moment": 0.5}],
}  # fmt: skip


def swung(step: float, *sections: dict[str, Any], **tables: Any) -> dict[str, Any]:
    """A clamped cable that falls from a straight line, without damping, and bends across what it has slipped to."""
    return cable_scene(
        list(sections) or [CABLE],
        clamped_at([0, 0, 0], [1, 0.3, 0], motion={"sway": {"amplitude": 0.4, "period": 0.8}, "ramp": 0.4}), "free",
        initial={"kind": "straight", "origin": [0, 0, 0], "direction": [1, 0.3, 0]}, model="rod",
        contact={"self": False}, mesh=24, time=(1.0, step, 1.0), output={"every": 0.04, "exact": True}
    ) | tables  # fmt: skip


def test_energy_is_kept_or_booked() -> None:
    """What no work accounts for falls with the square of the step, also beside a section without layers."""
    plain = {key: x for key, x in CABLE.items() if key != "bending_slip"} | {"length": 5}
    for sections in ((CABLE,), (CABLE | {"length": 7}, plain)):
        off = []
        for step in (8e-3, 4e-3):
            found = hybrid.run(swung(step, *sections))
            off.append(np.abs(found["work/scheme"]).max() / found["energy/kinetic"].max())
            lost = np.diff(found["work/hysteresis"])
            assert (lost <= 1e-12).all() and lost.sum() < -1.0
        print(f"energy that no work accounts for, over the largest kinetic energy: {off}")
        assert off[0] < 1e-3 and off[1] < 0.35 * off[0]


@pytest.mark.parametrize(
    ("given", "expected"),
    [
        ({"bending_slip": [{"stiffness": 1, "moment": 0}]}, "does nothing"),
        ({"bending_slip": [{"stiffness": 1, "moment": 1}], "bending_stiffness": None}, "what is left when all layers"),
        (ONE | {"torsional_stiffness": 0}, "a direction about the axis"),
        ({"first_loading": True}, "because first_loading is true"),
        ({"first_loading": True, "moment_curvature": [[0, 0], [1, 1]], "bending_stiffness": None}, "three rows"),
        (
            {"first_loading": True, "moment_curvature": [[0, 0], [1, 1], [2, 3]], "bending_stiffness": None},
            "below the one before",
        ),
    ],
)
def test_what_slips_by_no_layer_is_refused(given: dict[str, Any], expected: str) -> None:
    section = {"length": 8, "mass": 1, "bending_stiffness": 1e4} | given
    scene = swung(0.1, {key: x for key, x in section.items() if x is not None})
    with pytest.raises(SceneError, match=expected):
        hybrid.validate_scene(scene)
