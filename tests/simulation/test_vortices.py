"""Vortex-induced vibration: a cylinder on springs against its own equations, risers that were measured, and what stays."""

from __future__ import annotations

from math import pi, sqrt
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import hybrid
from hybrid.errors import SceneError
from tests.scenes import cable_scene, pinned_at

# A cylinder of 1 m: kg, N/m, m; kg/m3; coefficients of the model.
MASS, SPRING, D, RHO, DRAG = 16.79, 1218.0, 0.1, 1000.0, 1.2
LIFT, CENTER, LOW, HIGH = 1.2, 0.144, 0.08, 0.206


def on_springs(U: float, step: float = 0.02, **more: Any) -> dict[str, Any]:
    """50 m of the cylinder in the middle of a taut string of two cells, which is its spring in both directions."""
    half, pull = 50.0, SPRING * 50.0**2 / 2
    stiffness = pull / 0.004
    length = half / (1 + pull / stiffness)
    section = {
        "length": 2 * length, "mass": MASS * half / length, "diameter": D, "axial_stiffness": stiffness,
        "max_strain": 0.2, "drag": {"normal": DRAG}, "added_mass": {"normal": 1.0},
        "vortices": {"lift": LIFT, "center": CENTER, "low": LOW, "high": HIGH},
    }  # fmt: skip
    return cable_scene(
        section, pinned_at(0, 0, 0), pinned_at(2 * half, 0, 0), gravity=0, fluid={"density": RHO, "current": [0, U, 0]},
        model="catenary", mesh=2, time=(40, step, 1.0), output={"every": 0.04, "points": 3, "exact": True}
    ) | more  # fmt: skip


def frequency(t: Any, x: Any) -> float:
    """Of crossings of the mean upwards, Hz."""
    x = x - x.mean()
    k = np.flatnonzero((x[1:] > 0) & (x[:-1] <= 0))
    return float(1.0 / np.diff(t[k] - x[k] * np.diff(t)[k] / (x[k + 1] - x[k])).mean())


def amplitude(x: Any) -> float:
    """sqrt(2) times the standard deviation, over the diameter of the cylinder."""
    return float(sqrt(2.0) * np.std(x) / D)


def by_equations(U: float) -> tuple[float, float]:
    """Amplitude and frequency of the cylinder, from its two motions, the phase and the two means, in continuous time."""
    inertia = MASS + RHO * pi / 4 * D**2

    def rate(t: float, y: Any) -> list[float]:
        x, z, vx, vz, phase, mean_v, mean_a = y
        u, w = U - vx, -vz  # of the water against the cylinder
        speed = sqrt(u * u + w * w)
        ex, ez = w / speed, -u / speed  # across it
        lift = 0.5 * RHO * D * LIFT * speed**2 * np.cos(phase)
        drag = 0.5 * RHO * D * DRAG * speed
        ax = (-SPRING * x + drag * u + lift * ex) / inertia
        az = (-SPRING * z + drag * w + lift * ez) / inertia
        v, a = vx * ex + vz * ez, ax * ex + az * ez
        S = np.sin(np.arctan2(-a / sqrt(mean_a), v / sqrt(mean_v)) - phase)
        f = CENTER + S * ((HIGH - CENTER) if S > 0 else (CENTER - LOW))
        decay = 0.17 * speed / (8 * D)
        return [vx, vz, ax, az, 2 * pi * f * speed / D, decay * (v * v - mean_v), decay * (a * a - mean_a)]

    start = [0.5 * RHO * D * DRAG * U**2 / SPRING, 0, 0, 0.01, pi, 1e-4, 1e-3]
    found = solve_ivp(rate, (0, 60), start, t_eval=np.arange(30, 60, 0.01), rtol=1e-8, atol=1e-10)
    return amplitude(found.y[1]), frequency(found.t, found.y[1])


@pytest.mark.long
@pytest.mark.parametrize("U", [0.45, 0.65])
def test_a_cylinder_on_springs_moves_as_its_equations_say(U: float) -> None:
    """In 50 steps a period; within the range of frequencies it locks in to."""
    found = hybrid.run(on_springs(U))
    late = found.t > 20.0
    size, f = amplitude(found.position[late, 1, 2]), frequency(found.t[late], found.position[late, 1, 2])
    expected, expected_f = by_equations(U)
    assert size == pytest.approx(expected, rel=2e-2)
    assert f == pytest.approx(expected_f, rel=5e-3)
    assert LOW < f * D / U < 1.05 * HIGH  # |u| is more than U where the cylinder moves
    if U == 0.65:  # published beside the model, of a cylinder that moves across the flow alone
        assert (size, f) == pytest.approx((0.89135, 1.11867), rel=2e-2)


@pytest.mark.long
def test_lock_in_has_a_range() -> None:
    """Beside the natural frequency, 1.12 Hz in water, the cylinder moves by most of a diameter; far from it hardly."""
    sizes = []
    for U in (0.25, 0.6, 2.5):
        found = hybrid.run(on_springs(U, 0.01 if U > 1 else 0.02))
        sizes.append(amplitude(found.position[found.t > 20.0, 1, 2]) / min(U, 1.0))
    assert sizes[1] > 1.2 and sizes[0] < 0.35 * sizes[1]
    assert sizes[2] / 2.5 < 0.6 * sizes[1]


def test_there_is_no_lift_at_rest() -> None:
    scene = on_springs(0.65)
    with_lift = hybrid.static(scene)
    del scene["cable"]["sections"][0]["vortices"]
    assert np.abs(with_lift.position - hybrid.static(scene).position).max() < 1e-9


def stepped_current(**vortices: float) -> dict[str, Any]:
    """Case 1 of F. Huera-Huarte's thesis (2006): a riser of 13.12 m, the lowest 45 % in 0.31 m/s."""
    L, wide = 13.12, 0.028
    area = pi / 4 * wide**2
    mass, stiffness = 3 * RHO * area, 1e5
    pull = 1175 - (mass - RHO * area) * 9.81 * L / 2
    length = L / (1 + pull / stiffness)
    flow = [(0.0, 0.31), (0.45 * L - 0.05, 0.31), (0.45 * L + 0.05, 0.0), (L, 0.0)]
    section = {
        "length": length, "mass": mass * L / length, "diameter": wide, "axial_stiffness": stiffness,
        "bending_stiffness": 29.88, "drag": {"normal": 1.2}, "added_mass": {"normal": 1.0}, "vortices": vortices,
    }  # fmt: skip
    return cable_scene(
        section, pinned_at(0, 0, 0), pinned_at(0, 0, L),
        fluid={"density": RHO, "current": [{"z": z, "velocity": [u, 0, 0]} for z, u in flow]}, model="rod", mesh=30,
        contact={"self": False}, time=(30, 0.025), output={"every": 0.05, "points": 51, "exact": True}
    )  # fmt: skip


@pytest.mark.long
@pytest.mark.parametrize(
    ("vortices", "beam_f", "beam_size"),
    [({}, 1.63, 0.85), ({"lift": 0.7, "center": 0.18, "low": 0.1, "high": 0.26}, 1.67, 0.52)],
    ids=["script", "MoorDyn"],
)
def test_a_riser_in_a_stepped_current(vortices: dict[str, float], beam_f: float, beam_size: float) -> None:
    """Measured: the second mode across the flow at 1.66 Hz; a linear beam with this model has beam_f and beam_size."""
    found = hybrid.run(stepped_current(**vortices))
    late = found.t > 15.0
    y = found.position[late][:, :, 1]
    sizes = sqrt(2.0) * y.std(axis=0) / 0.028
    at = int(sizes.argmax())
    f = frequency(found.t[late], y[:, at])
    assert f == pytest.approx(1.66, rel=0.05)
    assert (f, sizes[at]) == pytest.approx((beam_f, beam_size), rel=0.05)
    middle = sizes[(found.s > 6.0) & (found.s < 7.2)].min()
    assert middle < 0.35 * sizes[at]  # two half waves
    assert np.corrcoef(y[:, 13], y[:, 38])[0, 1] < -0.8


def catenary(model: Any = "rod", duration: float = 60.0, **more: Any) -> dict[str, Any]:
    """The riser that MoorDyn's test of its vortices has, after Thorsen's."""
    section = {
        "length": 23.71, "mass": 0.69, "diameter": 0.024, "axial_stiffness": 6.66e5, "bending_stiffness": 10.5,
        "drag": {"normal": 1.2, "tangential": 0.08}, "added_mass": {"normal": 2.0},
        "vortices": {"lift": 0.7, "center": 0.18, "low": 0.1, "high": 0.26},
    }  # fmt: skip
    return cable_scene(
        section, pinned_at(-21.0425, 0, -10), pinned_at(0, 0, -1), gravity=9.80665,
        fluid={"density": 1000, "current": [0.2, 0, 0]}, model=model, mesh=40, contact={"self": False},
        time=(duration, 0.04), output={"every": 0.08, "points": 51, "exact": True}
    ) | more  # fmt: skip


@pytest.mark.long
def test_a_catenary_riser_shakes_as_in_moordyn() -> None:
    """MoorDyn 2.7.2: 1.0497 Hz and 0.326 diameters at 0.66 of the length (its target 1.04 Hz), 20 to 60 s."""
    found = hybrid.run(catenary())
    late, at = found.t >= 20.0, int(np.argmin(np.abs(found.s - 0.66 * 23.71)))
    y = found.position[late, at, 1]
    assert frequency(found.t[late], y) == pytest.approx(1.0497, rel=0.15)
    assert sqrt(2.0) * y.std() / 0.024 == pytest.approx(0.326, rel=0.15)
    drag, potential = found["work/drag"], found["energy/potential"]
    lost = np.abs(found["work/scheme"]).max()
    assert np.ptp(drag) > 0.0 and lost < 0.05 * np.ptp(potential) + 0.2 * found["energy/kinetic"].max()


@pytest.mark.long
@pytest.mark.parametrize("model", ["adaptive", {"kind": "adaptive", "curvature_error": 0.05}], ids=["zones", "cells"])
def test_phases_go_along_where_zones_move(model: Any) -> None:
    """The amplitude of a riser whose cells and kinds change is that of rods everywhere."""
    sizes = []
    for x in ("rod", model):
        heave = {"heave": {"amplitude": 0.3, "period": 8}, "ramp": 8}
        scene = catenary(x, 30.0)
        scene["ends"]["end"]["motion"] = heave
        scene["mesh"] = {"cells": 20 if isinstance(x, dict) else 40}
        found = hybrid.run(scene)
        late = found.t > 15.0
        sizes.append(sqrt(2.0) * found.position[late][:, 5:-5, 1].std(axis=0).mean() / 0.024)
    assert sizes[0] > 0.15
    assert sizes[1] == pytest.approx(sizes[0], rel=0.2)


@pytest.mark.long
def test_a_shaking_riser_that_is_turned_is_the_same() -> None:
    one = hybrid.run(catenary(duration=8.0))
    turned = catenary(duration=8.0)
    turned["environment"]["fluid"]["current"] = [0, 0.2, 0]
    turned["ends"]["start"]["position"] = [0, -21.0425, -10]
    other = hybrid.run(turned)
    back = np.stack([other.position[..., 1], -other.position[..., 0], other.position[..., 2]], axis=-1)
    assert np.abs(back - one.position).max() < 1e-7 * 23.71


def test_frequencies_are_in_order() -> None:
    scene = on_springs(0.5)
    scene["cable"]["sections"][0]["vortices"] = {"low": 0.3}
    with pytest.raises(SceneError, match=r"between low, 0\.3, and high"):
        hybrid.validate_scene(scene)
