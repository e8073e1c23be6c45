"""The suspension of Goyal & Perkins (Table 1): rod and hybrid against an independent solution (problems.suspension)."""

from __future__ import annotations

import numpy as np
import pytest
from problems import MOVED_JOINTS, SUSPENSION, order, suspension

import hybrid

SOURCE = "solve_bvp at 1e-10 (Goyal & Perkins, Table 1)"
CASES = {
    "rod": (None, "rod", "rod_end_bending_moment"),
    "hybrid": (1.5, "hybrid_joint_at_1.5", "hybrid_end_bending_moment"),
}
both = pytest.mark.parametrize("case", CASES)


def solved(case: str, cells: int, **mesh: float) -> tuple[hybrid.Result, np.ndarray]:
    """Equilibrium at the points of the reference table, and the table: s, x, z, angle, T, V, M."""
    joint, table, _ = CASES[case]
    rows = np.array(SUSPENSION[table])
    return hybrid.static(suspension(joint, cells, output={"points": rows[:, 0].tolist()}, **mesh)), rows


def distance(result: hybrid.Result, rows: np.ndarray) -> float:
    return float(np.linalg.norm(result.position[-1][:, [0, 2]] - rows[:, 1:3], axis=1).max())


@both
def test_suspension_shape(case, report):
    errors = [distance(*solved(case, n)) for n in (40, 80, 160)]
    p = order(errors)
    report(
        f"Suspension, {case}: shape with 40/80/160 cells",
        SOURCE,
        f"{errors[0]:.2e}, {errors[1]:.2e}, {errors[2]:.2e} m, order {p[0]:.2f}, {p[1]:.2f}",
        "discretisation: 3e-3 m at 40, 2e-4 m at 160, order 2.0 +- 0.15",
    )
    assert errors[0] <= 3e-3
    assert errors[2] <= 2e-4
    assert np.abs(p - 2.0).max() <= 0.15


@both
def test_suspension_graded(case, report):
    mesh = {"ratio": 0.1} if case == "rod" else {"ratio": 0.1, "rod_part": 0.5}
    error = distance(*solved(case, 160, **mesh))
    report(
        f"Suspension, {case}: shape, 160 cells graded to the clamp", SOURCE, f"{error:.2e} m", "discretisation: 3e-5 m"
    )
    assert error <= 3e-5


@both
def test_suspension_end_moment(case, report):
    exact = abs(SUSPENSION[CASES[case][2]])
    errors = [np.linalg.norm(solved(case, n)[0].moment_end[-1]) / exact - 1 for n in (40, 80, 160)]
    p = order(errors)
    report(
        f"Suspension, {case}: moment at the clamp, 80 cells",
        SOURCE,
        f"{100 * errors[1]:+.3f} %, order {p[1]:.2f}",
        "discretisation: 0.5 %, order 2.0 +- 0.15",
    )
    assert abs(errors[1]) <= 5e-3
    assert np.abs(p - 2.0).max() <= 0.15


@both
def test_suspension_tension_shear_moment(case, report):
    """The curves along s.  The joint itself is left out: there the table shows one side and the output the other."""
    exact = {"tension": 4, "shear": 5, "bending_moment": 6}
    errors = {name: [] for name in exact}
    for n in (80, 160, 320):
        result, rows = solved(case, n)
        away = np.abs(rows[:, 0] - 1.5) > 1e-9
        for name, column in exact.items():
            wanted = rows[:, column]
            if case == "hybrid" and name != "tension":
                wanted = np.where(rows[:, 0] < 1.5, 0.0, wanted)
            found = result[name][-1]
            errors[name].append(np.abs(found - (wanted if name == "tension" else np.abs(wanted)))[away].max())
    for name, bound in {"tension": 5e-5, "shear": 1e-4, "bending_moment": 1e-6}.items():
        e, p = errors[name], order(errors[name])
        report(
            f"Suspension, {case}: {name.replace('_', ' ')} along s, 160 cells",
            SOURCE,
            f"{e[1]:.1e}, order {p[1]:.2f}",
            f"discretisation: {bound:.0e} (N, N m), order 2.0 +- 0.2 from 160 to 320",
        )
        assert e[1] <= bound
        assert abs(p[1] - 2.0) <= 0.2


def test_suspension_joint_angles(report):
    """Tangents on the two sides of the joint; a point on a joint shows the side before it."""
    points = (1.5, 1.5 + 1e-8)
    result = hybrid.static(suspension(1.5, 640, ratio=0.1, rod_part=0.5, output={"points": points}))
    catenary, rod = (abs(90.0 - np.degrees(x)) for x in result.theta[-1])
    report(
        "Suspension, hybrid: tangents at the joint",
        SOURCE,
        f"{catenary:.3f} and {rod:.3f} deg",
        "published: 43.92 and 39.73 deg",
    )
    assert catenary == pytest.approx(43.92, abs=0.005)
    assert rod == pytest.approx(39.73, abs=0.005)


def test_suspension_joint_moved(report):
    """Largest distance of the hybrid to the all-rod shape, wherever the joint is."""
    points = {"points": np.linspace(0, 2, 201).tolist()}
    whole = hybrid.static(suspension(None, 640, ratio=0.1, output=points)).position[-1]
    worst = []
    for joint, published in MOVED_JOINTS.items():
        moved = hybrid.static(suspension(joint, 640, ratio=0.1, rod_part=0.6, output=points)).position[-1]
        apart = float(np.linalg.norm(moved - whole, axis=1).max())
        report(
            f"Suspension, joint at {joint} m: largest distance to the rod",
            "published",
            f"{100 * apart:.3f} cm",
            f"published: {100 * published:.2f} cm",
        )
        worst.append(abs(apart - published))
    assert max(worst) <= 0.5e-4


@both
def test_suspension_relaxes_to_its_equilibrium(case, report):
    """20 s of motion from straight with damping 2 1/s: what is left is exp(-20) of 2 m, and Newton's tolerance."""
    joint = CASES[case][0]
    moved = hybrid.run(suspension(joint, 80, time={"duration": 20.0, "step": 0.01}, output={"every": 20.0}))
    still = hybrid.static(suspension(joint, 80))
    apart = float(np.linalg.norm(moved.position[-1] - still.position[-1], axis=1).max())
    report(
        f"Suspension, {case}: 20 s of damped motion from straight, against the static solution",
        "own statics",
        f"{apart:.1e} m",
        "1e-5 m",
    )
    assert apart <= 1e-5
