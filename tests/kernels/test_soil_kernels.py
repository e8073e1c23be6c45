"""Soil that remembers: its branches against their closed forms, their slopes, what no branch exceeds, loops that lose."""

from __future__ import annotations

from math import log1p, sqrt
from types import FunctionType, SimpleNamespace
from typing import Any

import numpy as np
import pytest

from hybrid.kernels.laws import seabed
from hybrid.kernels.state.report import SOIL
from hybrid.kernels.state.state import no_sea


def plain() -> SimpleNamespace:
    """The laws as Python, which kernels take in where they are called."""
    names: dict[str, Any] = dict(vars(seabed))
    for name, x in vars(seabed).items():
        if hasattr(x, "py_func"):
            names[name] = FunctionType(x.py_func.__code__, names)
    return SimpleNamespace(**names)


law = plain()
D = 0.2  # m
CLAY = np.array([2000.0, 1500.0, 6.0, 0.25, 200.0, 0.6, 1.0, 5000.0, 0.5, 0.5, 0.4, 0.1])
EVEN = np.array([2000.0, 0.0, 6.0, 0.0, 200.0, 0.6, *np.zeros(6)])  # one ultimate resistance below a tenth of D


def along(soil: np.ndarray, depths: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """P at depths that a node goes through one after the other, and what it remembers behind the last."""
    past, out = np.zeros((1, 6)), []
    for z in depths:
        P, _, way, z0, P0 = law.soil_pressure(soil, D, past, 0, z)
        past[0, :5] = max(z, 0.0), P, z0, P0, way
        out.append(P)
    return np.array(out), past


def test_first_penetration_is_the_published_example() -> None:
    """D 0.2 m, su 2000 Pa + 1500 Pa/m, z 0.05 m: Pu 1760.70 N/m, P 1726.17 N/m; above z/D = 0.1 as the root."""
    assert law.bearing(CLAY, D, 0.05)[0] == pytest.approx(1760.70, abs=0.005)
    assert law.first_penetration(CLAY, D, 0.05)[0] == pytest.approx(1726.17, abs=0.005)
    shallow = 6.0 * 0.1**0.25 * sqrt(10 * 0.005 / D) * (2000 + 1500 * 0.005) * D
    assert law.bearing(CLAY, D, 0.005)[0] == pytest.approx(shallow, rel=1e-12)


def test_uplift_and_repenetration_are_hyperbolas_from_where_the_way_turns() -> None:
    """Of even soil in closed form: towards -f Pu, then from there towards Pu, each begun with K Pu/D."""
    most, f, steep = 6.0 * 2000.0 * D, 0.6, 200.0 / D
    z0, z1 = 0.1, 0.08
    down = np.linspace(0.0, z0, 400)[1:]
    up = np.linspace(z0, z1, 200)[1:]
    again = np.linspace(z1, 0.099, 200)[1:]
    P, past = along(EVEN, np.concatenate([down, up, again]))
    P0 = most * z0 * steep / (1.0 + z0 * steep)
    x = most * steep * (z0 - up)
    Q = P0 + f * most
    uplift = P0 - Q * x / (Q + x)
    np.testing.assert_allclose(P[399 : 399 + up.size], uplift, rtol=1e-12)
    assert uplift[-1] < -0.4 * most and past[0, law.BRANCH] == law.DOWN
    x, R = most * steep * (again - z1), most - uplift[-1]
    np.testing.assert_allclose(P[-again.size :], uplift[-1] + R * x / (R + x), rtol=1e-12)


def test_work_of_a_cycle_is_its_closed_form() -> None:
    """In even soil between two depths: a hyperbola B x/(B + x) over the way s has the integral B s - B^2 ln(1 + x/B)/c."""
    most, steep = 6.0 * 2000.0 * D, 200.0 / D
    z0, z1, n = 0.1, 0.09, 4000
    P, _ = along(EVEN, np.concatenate([[z0], np.linspace(z0, z1, n)[1:], np.linspace(z1, z0, n)[1:]]))
    z = np.concatenate([[z0], np.linspace(z0, z1, n)[1:], np.linspace(z1, z0, n)[1:]])
    work = float(np.sum(0.5 * (P[1:] + P[:-1]) * np.diff(z)))

    def area(B: float, way: float) -> float:
        c = most * steep
        return B * way - B * B * log1p(c * way / B) / c

    way, P0 = z0 - z1, most * z0 * steep / (1.0 + z0 * steep)
    Q = P0 + 0.6 * most
    P1 = P0 - Q * most * steep * way / (Q + most * steep * way)
    lost = (P1 * way + area(most - P1, way)) - (P0 * way - area(Q, way))
    print(f"{lost:.4f} J/m a cycle, {work:.4f} by steps")
    assert work == pytest.approx(lost, rel=1e-5) and lost > 0.0


@pytest.mark.parametrize("soil", [CLAY, EVEN], ids=["clay", "even"])
def test_slopes_are_those_of_the_branches(soil: np.ndarray) -> None:
    """Against differences, at depths on all branches and on both sides of every kink."""
    rng = np.random.default_rng(3)
    worst = 0.0
    for _ in range(300):
        depths = np.cumsum(rng.normal(0.0, 0.01, 12)) + 0.05
        _, past = along(soil, depths)
        for z in depths[-1] + rng.normal(0.0, 0.01, 4):
            if min(abs(z), abs(z - past[0, law.DEPTH]), abs(z - 0.1 * D)) < 1e-5:
                continue
            _, slope, way, _, _ = law.soil_pressure(soil, D, past, 0, z)
            a, _, way_a, _, _ = law.soil_pressure(soil, D, past, 0, z - 1e-8)
            b, _, way_b, _, _ = law.soil_pressure(soil, D, past, 0, z + 1e-8)
            if way == way_a == way_b:
                worst = max(worst, abs((b - a) / 2e-8 - slope) / (200.0 * 12000.0))
            assert abs(b - a) < 2e-8 * 2.5 * 200.0 * 3e4  # no jump
    print(f"slopes off by {worst:.1e} of the stiffness of unloading")
    assert worst < 1e-6


@pytest.mark.long
def test_no_history_exceeds_first_penetration_or_suction_and_none_gives_energy() -> None:
    """Of random ways: between -f Pu and first penetration; every closed way takes work up."""
    rng = np.random.default_rng(5)
    for _ in range(100):
        turns = np.abs(rng.normal(0.04, 0.03, 8))
        z = np.concatenate([np.linspace(a, b, 60)[1:] for a, b in zip(turns, [*turns[1:], turns[0]], strict=True)])
        P, _ = along(CLAY, np.concatenate([z, z, z]))
        way = np.concatenate([z, z, z])
        bound = np.array([law.bearing(CLAY, D, x)[0] if x > 0.0 else 0.0 for x in way])
        first = np.array([law.first_penetration(CLAY, D, x)[0] if x > 0.0 else 0.0 for x in way])
        assert (first * (1 + 1e-12) >= P).all() and (-0.6 * bound * (1 + 1e-12) - 1e-9 <= P).all()
        k = 2 * z.size
        assert np.sum(0.5 * (P[k:] + P[k - 1 : -1]) * np.diff(way)[k - 1 :]) > 0.0


def test_sideways_is_the_clay_of_piles_on_the_height_that_lies_in_it() -> None:
    """min(3 su + gamma z + J su z/D, 9 su) min(z, D), and its slope."""
    for z in (0.05, 0.15, 0.4, 3.0):
        su = 2000.0 + 1500.0 * z
        wedge = 3.0 * su + 5000.0 * z + 0.5 * su * z / D
        value, slope = law.sideways(CLAY, D, z)
        assert value == pytest.approx(min(wedge, 9.0 * su) * min(z, D), rel=1e-12)
        step = law.sideways(CLAY, D, z + 1e-7)[0] - law.sideways(CLAY, D, z - 1e-7)[0]
        assert slope == pytest.approx(step / 2e-7, rel=1e-5)


@pytest.mark.parametrize("way", [[0.02, 0.05, 0.045], [0.02, 0.05, 0.04, 0.043]], ids=["up", "down"])
def test_a_state_that_is_looked_at_again_remembers_the_same(way: list[float]) -> None:
    """As where loads change in mid-motion: the branch goes on as if nothing had looked."""
    more = np.array([way[-1] - 0.001 if len(way) == 3 else way[-1] + 0.001])
    once, _ = along(CLAY, np.array([*way, *more]))
    again, past = along(CLAY, np.array([*way, way[-1], way[-1]]))
    assert again[-1] == again[-3] and past[0, 4] in (law.UP, law.DOWN)
    after, _ = along(CLAY, np.array([*way, way[-1], way[-1], *more]))
    assert after[-1] == once[-1]


@pytest.mark.parametrize("P", [1.0, 50.0, 900.0, 6000.0])
def test_the_depth_under_a_pressure_is_the_inverse_of_first_penetration(P: float) -> None:
    z = seabed.depth_under(CLAY, D, P)
    assert law.first_penetration(CLAY, D, z)[0] == pytest.approx(P, rel=1e-12)


def lies(depths: np.ndarray, past: np.ndarray) -> np.ndarray:
    """What nodes at depths remember that have always been there, by what stood in past."""
    n = len(depths)
    line = SimpleNamespace(bits=SOIL, bed_width=np.full(n, D))
    sea = no_sea(n)._replace(normal=np.array([0.0, 0.0, 1.0]), offset=0.0, onset=0.0, soil=CLAY)
    out = past.copy()
    law.lie_in_soil(line, sea, np.column_stack([np.zeros(n), np.zeros(n), -depths]), out)
    return out


def walked(seed: int, nodes: int = 40) -> tuple[np.ndarray, np.ndarray]:
    """Depths (nodes,) and memories (nodes, 6) behind random ways."""
    random = np.random.default_rng(seed)
    ways = np.cumsum(random.normal(0.003, 0.01, (nodes, 30)), axis=1)
    return ways[:, -1], np.vstack([along(CLAY, way)[1] for way in ways])


def test_nodes_that_stay_where_they_were_remember_the_same() -> None:
    depths, past = walked(1)
    assert {*past[:, law.BRANCH]} == {law.UP, law.FIRST, law.DOWN}
    np.testing.assert_array_equal(lies(depths, past), past)


def test_a_node_between_others_is_on_the_branch_of_the_nearer_at_its_own_depth() -> None:
    """Its pressure is on that branch, or where it would be beyond it turns there; none exceeds first penetration."""
    depths, past = walked(2)
    for i, part in [(k, x) for k in range(39) for x in (0.2, 0.5, 0.8)]:
        new, near = np.zeros((1, 6)), i if part < 0.5 else i + 1
        law.remember_between(past, new, 0, i, i + 1, part)
        assert new[0, law.BRANCH] == past[near, law.BRANCH]
        z = (1.0 - part) * depths[i] + part * depths[i + 1] + 1e-3
        (row,) = lies(np.array([z]), new)
        if z <= 0.0:
            assert not row[: law.SLID].any()
            continue
        most, _ = law.first_penetration(CLAY, D, z)
        assert row[law.DEPTH] == z and row[law.PRESSES] <= most
        # soil that is looked at there again says the same
        P, _, way, z0, P0 = law.soil_pressure(CLAY, D, row[None], 0, z)
        assert [P, z0, P0, way] == [row[law.PRESSES], row[law.TURN], row[law.TURN_P], row[law.BRANCH]]
        assert row[law.SLID] == pytest.approx((1.0 - part) * past[i, law.SLID] + part * past[i + 1, law.SLID])
