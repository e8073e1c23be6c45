"""The localised loop of a twisted rod: its formulas against the equations of the rod, and published constants."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import hybrid
from hybrid.cli.plan_tables import plan_rows
from hybrid.store.capacity import formation_tension, kink_torque, pop_out, strand_distance
from tests.scenes import cable_scene, clamped_at


def loop(m: float, s: np.ndarray) -> np.ndarray:
    """Places (n, 3) of the loop in sqrt(EI/T)."""
    k = np.sqrt(1.0 - m * m)
    w = 2.0 * k / np.cosh(k * s) * np.exp(1j * m * s)
    return np.column_stack([w.real, w.imag, s - 2.0 * k * np.tanh(k * s)])


@pytest.mark.parametrize("m", [0.1, 0.3, 0.5])
def test_the_loop_is_an_equilibrium_of_a_rod(m: float) -> None:
    """t x t'' + 2 m t' + t x n = constant, with the tension n = e_z: moments of a rod with EI = T = 1 (differences)."""
    s = np.linspace(-6.0, 6.0, 24001)
    r, h = loop(m, s), s[1] - s[0]
    t = np.gradient(r, h, axis=0)
    np.testing.assert_allclose(np.linalg.norm(t, axis=1)[2:-2], 1.0, atol=1e-6)
    bend = np.cross(t, np.gradient(t, h, axis=0))
    moment = bend + 2.0 * m * t + np.cross(r, [0.0, 0.0, 1.0])  # about the origin: it is the same everywhere
    np.testing.assert_allclose(moment[4:-4] - moment[12000], 0.0, atol=2e-5)


@pytest.mark.parametrize("m", [0.05, 0.3, 0.55])
def test_distance_of_the_strands(m: float) -> None:
    """Against all pairs of places on the two strands."""
    s = np.linspace(0.5, 4.0, 701)
    a, b = loop(m, s), loop(m, -s)
    apart = np.linalg.norm(a[:, None] - b[None], axis=2)
    inner = apart[1:-1, 1:-1]
    least = min(
        inner[i, j]
        for i, j in np.argwhere(
            (inner <= apart[:-2, 1:-1])
            & (inner <= apart[2:, 1:-1])
            & (inner <= apart[1:-1, :-2])
            & (inner <= apart[1:-1, 2:])
        )
    )
    assert strand_distance(m) == pytest.approx(least, rel=5e-4)  # of the grid of pairs


def test_constants_of_the_distance() -> None:
    expected = [0.221, 0.446, 0.677, 0.917, 1.169]
    np.testing.assert_allclose([strand_distance(m) for m in (0.1, 0.2, 0.3, 0.4, 0.5)], expected, atol=1e-3)
    assert np.isnan(strand_distance(0.6))


@pytest.mark.parametrize("q", [1e-6, 0.01, 0.2, 1.0, 1.5])
def test_pop_out(q: float) -> None:
    """T = 1.105 (M/D)(1 + 0.053 q), and the radius at the crown is half the inverse of its curvature 2 k."""
    EI, D = 3.0, 0.02
    M = q * EI / D
    found = pop_out(M, EI, D)
    assert found is not None and found.tension == pytest.approx(1.105 * M / D * (1.0 + 0.053 * q), rel=1e-2)  # a fit
    m = M / (2.0 * np.sqrt(EI * found.tension))
    assert strand_distance(m) * np.sqrt(EI / found.tension) == pytest.approx(
        D, rel=2e-3
    )  # between entries of the table
    assert found.radius == pytest.approx(np.sqrt(EI / found.tension) / (2.0 * np.sqrt(1.0 - m * m)), rel=1e-9)


def test_torque_from_which_on_a_loop_kinks() -> None:
    """0.227 EI D/R^2 for radii that are many diameters; it is the torque at which the loop that pops out has R."""
    EI, D = 3.0, 0.02
    for R in (0.03, 0.1, 0.5, 50.0):
        torque = kink_torque(EI, D, R)
        found = pop_out(torque, EI, D)
        assert found is not None and found.radius == pytest.approx(R, rel=2e-3)
    assert kink_torque(EI, D, 0.5) == pytest.approx(0.227 * EI * D / 0.25, rel=5e-3)
    assert kink_torque(EI, D, 0.1 * D) == np.inf


def test_nothing_to_say() -> None:
    assert pop_out(0.0, 1.0, 0.1) is None and pop_out(100.0, 1.0, 0.1) is None and pop_out(1.0, 0.0, 0.1) is None
    np.testing.assert_allclose(
        formation_tension(np.array([2.0, -2.0, 1.0]), np.array([1.0, 1.0, 0.0])), [1.0, 1.0, 0.0]
    )


def test_the_plan_names_the_torque_from_which_a_hanging_line_can_throw_a_loop() -> None:
    """2 sqrt(EI H) of an inextensible catenary in its lowest cell; H from its equation alone."""
    length, span, weight, EI = 60.0, 50.0, 2.0 * 9.81, 10.0
    a, b = 0.1, 1e3  # m, H/w between them: the arc 2 c sinh(span/(2 c)) has the length of the line
    for _ in range(200):
        c = 0.5 * (a + b)
        a, b = (c, b) if 2.0 * c * np.sinh(min(span / (2.0 * c), 300.0)) > length else (a, c)
    section = {"length": length, "mass": 2.0, "diameter": 0.02, "bending_stiffness": EI, "torsional_stiffness": 8.0}
    clamp = {"kind": "clamped", "tangent": [1.0, 0.0, -1.0], "position": [0.0] * 3, "normal": [0.0, 1.0, 0.0]}
    end = {"kind": "clamped", "tangent": [1.0, 0.0, 1.0], "position": [span, 0.0, 0.0], "normal": [0.0, 1.0, 0.0]}
    scene = cable_scene(section, clamp, end, model="rod", mesh=200, time=(1.0, 0.02))
    critical = hybrid.plan(hybrid.validate_scene(scene)).critical_torque
    assert critical is not None
    assert critical.torque == pytest.approx(2.0 * np.sqrt(EI * c * weight), rel=1e-3)
    assert critical.s == pytest.approx(0.5 * length, abs=length / 200)
    for radius, text in ((0.3, "a loop kinks from"), (1e-6, "no torque makes a loop kink")):
        section["min_bend_radius"] = radius
        checked = hybrid.validate_scene(scene)
        told = " ".join(" ".join(plan_rows(checked, hybrid.plan(checked))).split())
        assert text in told
        kink = kink_torque(EI, 0.02, radius)
        assert f"kinks from {kink:.3g} N m on" in told or not np.isfinite(kink)
    scene["cable"]["attachments"] = [{"kind": "swivel", "at": 10.0}]  # there is no torque
    assert hybrid.plan(hybrid.validate_scene(scene)).critical_torque is None


def test_the_plan_of_a_line_with_a_load_that_is_held_against_turning() -> None:
    """Clamped above, guided below: 2 sqrt(EI F) in its lowest cell; its torque is c times the mean tension."""
    plan = hybrid.plan(Path(__file__).parents[2] / "examples" / "armoured_cable.yaml")
    critical = plan.critical_torque
    assert critical is not None and critical.s == pytest.approx(249.5)
    weight = (2.0 - 1025.0 * np.pi * 0.025**2 / 4.0) * 9.80665  # N/m
    assert critical.torque == pytest.approx(2.0 * np.sqrt(4.0 * (6000.0 + 0.5 * weight)), rel=1e-6)
    assert critical.of_tension == pytest.approx(0.004 * (6000.0 + 125.0 * weight), rel=1e-4)


def test_the_plan_knows_the_bed_and_the_stretch() -> None:
    """As of the equilibrium, where that is computed: tensions of a line between clamps, part of it on the bed."""
    section = {"length": 60.0, "mass": 5.0, "diameter": 0.05, "bending_stiffness": 200.0, "axial_stiffness": 1e6,
               "torsional_stiffness": 150.0}  # fmt: skip
    y = [0.0, 1.0, 0.0]
    ends = clamped_at([0.0] * 3, [1.0, 0.0, 0.0], normal=y), clamped_at([40.0, 0.0, 35.0], [0.3, 0.0, 1.0], normal=y)
    bed = {"z": 0.0, "stiffness": 1e4}
    scene = cable_scene(section, *ends, seabed=bed, model="rod", mesh=120, time=(1.0, 0.02))
    rest = hybrid.static(scene)
    measured, tables = hybrid.plan(scene).critical_torque, hybrid.plan(scene, measure=False).critical_torque
    assert measured is not None and tables is not None and tables.rough and not measured.rough
    least = float(rest.tension.min())
    assert measured.torque == pytest.approx(2.0 * np.sqrt(200.0 * least), rel=0.01)
    told = " ".join(" ".join(plan_rows(hybrid.validate_scene(scene), hybrid.plan(scene, measure=False))).split())
    assert "a loop can form from about" in told and "hybrid static" in told
