"""Criteria: every ratio against a calculation by hand, on states made for it; and what no ratio may depend on.

    bend     EI kappa/T over the tolerance                    clamp          sqrt(EI/T) x angle over the tolerance
    slack    (EI w^2)^(1/3) over the tension, now or ahead    point, edge    half of that angle; EI w/(2 T^2)
    torsion  M^2/(4 EI T) over a half

The angle between two chords is measured by 2 sin(angle/2), the distance of their unit vectors.
"""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
import pytest
from adapt_cases import GRAVITY, X, Y, Z, along, cable, even, layout, on, polygon, state_on, still, untwisted, weighed
from problems import pinned

from hybrid.kernels.mesh.cell_errors import CURVATURE
from hybrid.kernels.mesh.zone_criteria import BEND, CLAMP, CONTACT, CRITERIA, EDGE, FORESEEN, POINT, SLACK, TORSION
from hybrid.kernels.mesh.zone_step import LONGEST_LOOKAHEAD, LOOKAHEAD, REJECT_RATIO
from hybrid.kernels.state.report import (
    AXIS,
    CARRIED,
    MOVES,
    OBSTACLE,
    OBSTACLES,
    RADIUS,
    SEABED,
    SPEED,
    STRAND,
    TURNED,
)
from hybrid.kernels.state.state import no_sea
from hybrid.model.material import TENSION_FLOOR, Material
from hybrid.zones.manager import Allowed, DomainManager, Times, wanted
from tests.scenes import clamped_at, pinned_at

EI, GJ, W = 2.0, 1.5, 1.0 * GRAVITY  # of `cable()`
FLOORED = TENSION_FLOOR * (EI * W**2) ** (1 / 3)  # N
TOL = 1e-2  # m
ROUND = 1e-11


def of_nodes(ratio, zones):
    """The largest of a ratio at nodes (N+1,) in each base cell, its two ends included."""
    first = zones.first
    return np.array([ratio[a : b + 1].max() for a, b in itertools.pairwise(first)])


def sharp(turn, hn):
    """What the turns at inner nodes have beyond the smaller curvature beside them."""
    kappa = turn / hn
    beside = np.minimum(np.append(np.inf, kappa[:-1]), np.append(kappa[1:], np.inf))
    return np.maximum(turn - beside * hn, 0.0)


def least(T):
    """The smaller tension of the two cells at every node."""
    return np.minimum(np.append(T, T[-1]), np.append(T[0], T))


# --- by hand --------------------------------------------------------------------------------------------


def test_straight_and_taut_asks_for_nothing_but_its_tension():
    zones = even(10, "C" * 10)
    state = state_on(on(cable(), zones), along((1, 2, 2)), 50.0)
    ratios = weighed(cable(), zones, state)
    assert ratios[SLACK] == pytest.approx(FLOORED / 50.0, rel=ROUND)
    assert np.abs(np.delete(ratios, SLACK, axis=0)).max() < 1e-12


@pytest.mark.parametrize("flags", ["CCCCCCCC", "CCRRRCCC", "RRRRRRRR"])
def test_bend_node_by_node(flags):
    """Any turns, any tensions, uneven cells: the sharpest and the smaller tension count; a base cell sees both its ends."""
    base = np.concatenate([[0.0], np.cumsum([1.0, 0.5, 1.5, 1.0, 1.0, 2.0, 0.7, 1.3])])
    zones = layout(base, 3, flags)
    what = cable(float(base[-1]))
    line = on(what, zones)
    rng = np.random.default_rng(3)
    angle, T = rng.uniform(0.01, 0.2, line.h.size - 1), rng.uniform(30, 60, line.h.size)
    state = state_on(line, polygon(line.h, angle), 50.0)
    state.T[:] = T
    turn, T = 2 * np.sin(angle / 2), least(T)[1:-1]
    joint = line.spin[1:] != line.spin[:-1]  # a kink, as a point load
    bend, point = np.zeros((2, line.s.size))
    bend[1:-1] = np.where(joint, 0.0, EI * turn / line.hn[1:-1] / T / TOL)
    point[1:-1] = np.where(joint, 0.5 * np.sqrt(EI / T) * sharp(turn, line.hn[1:-1]) / TOL, 0.0)
    ratios = weighed(what, zones, state, tolerance=TOL)
    assert ratios[BEND] == pytest.approx(of_nodes(bend, zones), rel=ROUND)
    assert ratios[POINT] == pytest.approx(of_nodes(point, zones), rel=ROUND)
    assert ratios[SLACK] == pytest.approx(of_nodes(FLOORED / least(state.T), zones), rel=ROUND)


def test_bend_counts_no_tension_below_the_floor():
    """Where a cable is slack, EI kappa/T says nothing: the floor stands for the tension."""
    zones = even(10, "C" * 10)
    line = on(cable(), zones)
    state = state_on(line, polygon(line.h, np.full(9, 0.05)), 0.1 * FLOORED)
    ratio = weighed(cable(), zones, state, tolerance=TOL)
    assert ratio[BEND] == pytest.approx(EI * 2 * np.sin(0.025) / 1.0 / FLOORED / TOL, rel=ROUND)
    assert ratio[SLACK] == pytest.approx(10.0, rel=ROUND)


@pytest.mark.parametrize("tension", [0.0, -1e-3, -50.0])
def test_no_tension_asks_always(tension):
    zones = even(10, "C" * 10)
    state = state_on(on(cable(), zones), along(), 50.0)
    state.T[6] = tension
    asks = weighed(cable(), zones, state)[SLACK] > 1.0
    assert asks.tolist() == [j in (5, 6, 7) for j in range(10)]


@pytest.mark.parametrize("dt, steps", [(0.1, None), (0.5, None), (0.01, 2.0)])
def test_falling_tension_is_seen_ahead(dt, steps):
    """T + (horizon/dt)(T - T before), but at most twice the change."""
    dwell, zones = 0.5, even(10, "C" * 10)
    line = on(cable(), zones)
    before, now = (state_on(line, along(), T) for T in (40.0, 36.0))
    now.T[7:] = 41.0  # this part rises: no better than it is
    ratio = weighed(cable(), zones, now, before=before, dt=dt, dwell=dwell)[SLACK]
    a = min(LOOKAHEAD * dwell / dt, LONGEST_LOOKAHEAD)
    assert steps is None or a == steps
    assert ratio[:6] == pytest.approx(FLOORED / (36.0 - 4.0 * a), rel=ROUND)
    assert ratio[8:] == pytest.approx(FLOORED / 41.0, rel=ROUND)


def test_tension_that_will_be_gone_asks_now():
    zones = even(10, "C" * 10)
    line = on(cable(), zones)
    before, now = (state_on(line, along(), T) for T in (60.0, 10.0))
    ratio = weighed(cable(), zones, now, before=before, dt=0.2, dwell=0.5)[SLACK]
    assert (ratio == FORESEEN).all()  # 10 - 0.3125 x 50 < 0: asks for rod, and takes no step back
    assert 1.0 < FORESEEN < REJECT_RATIO


def clamp(angle, end=0):
    """Ends whose tangent at one end is turned by an angle from x in the plane x, z."""
    t = np.cos(angle) * X + np.sin(angle) * Z
    frames = np.stack([np.column_stack([Y, Z, X])] * 2)
    frames[end] = np.column_stack([Y, np.cross(t, Y), t])
    return still(frames)


def clamped_cable(end):
    ends = [{"kind": "clamped", "position": (0, 0, 0), "tangent": (1, 0, 0)}, {"kind": "free"}]
    if end:
        ends = [pinned_at(0, 0, 0), clamped_at((10, 0, 0), (1, 0, 0))]
    return cable(start=ends[0], end=ends[1])


@pytest.mark.parametrize("kind", ["rod", "catenary"])
@pytest.mark.parametrize("end", [0, 1])
def test_clamp_angle(end, kind):
    """A taut cable leaves a clamp at 0.2 rad: sqrt(EI/T) 2 sin(0.1)/tolerance in the cell beside it, 0 elsewhere.

    Whether it is a rod there or a catenary: a catenary must ask to become a rod when the clamp turns.
    """
    what, zones = clamped_cable(end), even(10, ("R" if kind == "rod" else "C") * 10)
    state = state_on(on(what, zones), along(), 50.0)
    ratio = weighed(what, zones, state, ends=clamp(0.2, end), tolerance=TOL)[CLAMP]
    expected = np.zeros(10)
    expected[-end] = np.sqrt(EI / 50.0) * 2 * np.sin(0.1) / TOL
    assert ratio == pytest.approx(expected, rel=ROUND, abs=1e-5)


def test_a_pinned_end_is_no_clamp():
    zones = even(10, "R" * 10)
    state = state_on(on(cable(), zones), along(), 50.0)
    assert not weighed(cable(), zones, state, ends=clamp(0.2))[CLAMP].any()


def test_kink_at_a_point_load():
    what, zones = cable(attachments=[{"kind": "clump", "at": 4.0, "mass": 2.0}]), even(10, "C" * 10)
    line = on(what, zones)
    angle = np.full(9, 0.02)
    angle[3] = 0.3
    state = state_on(line, polygon(line.h, angle), 50.0)
    ratio = weighed(what, zones, state, tolerance=TOL)
    expected = np.zeros(10)
    expected[3:5] = np.sqrt(EI / 50.0) * (np.sin(0.15) - np.sin(0.01)) / TOL  # less the smooth curvature
    assert ratio[POINT] == pytest.approx(expected, rel=ROUND)
    # at the clump itself there is no curvature to speak of: bend is that of the nodes beside it
    assert ratio[BEND] == pytest.approx(EI * 2 * np.sin(0.01) / 50.0 / TOL, rel=ROUND)


def test_jump_of_stiffness():
    """Where two sections meet, the larger EI counts, and it is the curvature of a smooth cable; elsewhere each its own."""
    what = cable(sections=[{"length": 6.0}, {"length": 4.0, "bending_stiffness": 8.0}])
    zones = even(10, "C" * 10)
    line = on(what, zones)
    state = state_on(line, polygon(line.h, np.full(9, 0.04)), 50.0)
    ratio = weighed(what, zones, state, tolerance=TOL)
    expected = np.zeros(10)
    expected[5:7] = 8.0 * 2 * np.sin(0.02) / 50.0 / TOL
    assert ratio[POINT] == pytest.approx(expected, rel=ROUND)
    bend = 2 * np.sin(0.02) / 50.0 / TOL * np.array([2.0] * 6 + [8.0] * 4)
    assert ratio[BEND] == pytest.approx(bend, rel=ROUND)
    slack = (
        TENSION_FLOOR * np.cbrt(np.array([2.0] * 5 + [8.0] * 5) * W**2) / 50.0
    )  # the node in between has the stiffer floor
    assert ratio[SLACK] == pytest.approx(slack, rel=ROUND)


def bed(line, normal=Z, offset=0.0, onset=0.0):
    return no_sea(line.h.size)._replace(normal=np.asarray(normal, float), offset=offset, onset=onset, stiffness=1e3)


@pytest.mark.parametrize("begins", ["at the start", "at the end", "in the middle"])
def test_edge_of_contact(begins):
    """Between the last node on the bed and the first above it: EI w/(2 T^2) in that cell, whichever side the bed is on."""
    zones = even(12, "C" * 12)
    what = cable()
    line = on(what, zones, SEABED)
    touches = {
        "at the start": np.arange(13) < 5, "at the end": np.arange(13) >= 5,
        "in the middle": (np.arange(13) > 3) & (np.arange(13) < 9),
    }[begins]  # fmt: skip
    state = state_on(line, along(), 50.0)
    state.r[:, 2] = np.where(touches, -0.01, 0.01)
    ratio = weighed(what, zones, state, tolerance=TOL, sea=bed(line), bits=SEABED)[EDGE]
    crossed = np.flatnonzero(touches[:-1] != touches[1:])
    assert ratio[crossed] == pytest.approx(0.5 * EI * W / 50.0**2 / TOL, rel=ROUND)
    near = np.unique(np.concatenate([crossed - 1, crossed, crossed + 1]))
    assert not np.delete(ratio, near).any()


@pytest.mark.parametrize(
    ("speed", "of_plane", "ahead"), [(0.0, 0.0, 0.0), (-1.0, 0.0, 1.0), (1.0, 0.0, 0.0), (0.0, 1.0, 1.0)]
)
def test_an_obstacle_is_as_near_as_it_will_be_an_eighth_of_a_hold_time_ahead(speed, of_plane, ahead):
    """2 D/(gap + D) of a strand of D = 0.2 m whose surface is 0.3 m above a plane, which may come to it as well."""
    zones, dwell, gap, D = even(10, "C" * 10), 0.5, 0.3, 0.2
    line = on(cable(), zones, OBSTACLES)._replace(moved=np.array([MOVES] if of_plane else [], np.int8))
    rows, carried = np.zeros((1, OBSTACLE)), np.zeros((1, CARRIED))
    rows[0, AXIS : AXIS + 3], rows[0, RADIUS], rows[0, STRAND] = Z, 0.5 * D, 0.5 * D
    carried[0, SPEED : SPEED + 3], carried[0, TURNED : TURNED + 9] = of_plane * Z, np.eye(3).ravel()
    sea = no_sea(line.h.size)._replace(obstacles=rows, carried=carried)
    state = state_on(line, lambda s: np.column_stack([s, 0 * s, 0 * s + gap + 0.5 * D]), 50.0)
    state.v[:, 2] = speed
    ratios = weighed(cable(), zones, state, sea=sea, bits=OBSTACLES, dwell=dwell, line=line)
    assert ratios[CONTACT] == pytest.approx(2 * D / (gap - ahead * LOOKAHEAD * dwell + D), rel=ROUND)


def test_contact_begins_half_an_onset_above_the_bed():
    zones, what = even(12, "C" * 12), cable()
    line = on(what, zones, SEABED)
    state = state_on(line, along(), 50.0)
    for z, seen in ((0.04, True), (0.06, False)):
        state.r[:6, 2], state.r[6:, 2] = z, 1.0
        assert weighed(what, zones, state, sea=bed(line, onset=0.1), bits=SEABED)[EDGE].any() == seen


@pytest.mark.parametrize("twist", [0.3, -0.3])
def test_torque_of_a_twisted_rod(twist):
    """A straight rod twisted by 0.3 rad/m between its cells: M = GJ twist, and M^2/(4 EI T)/0.5."""
    zones, what = even(10, "CCRRRRRRCC"), cable()
    line = on(what, zones)
    state = state_on(line, along((1, 1, 0)), 50.0)
    angle = twist * 0.5 * (line.s[1:] + line.s[:-1])
    d = state.e / np.linalg.norm(state.e, axis=1)[:, None]
    state.a1[:] = np.cos(angle)[:, None] * state.a1 + np.sin(angle)[:, None] * np.cross(d, state.a1)
    ratio = weighed(what, zones, state)[TORSION]
    expected = np.where(zones.rod, (GJ * twist) ** 2 / (4 * EI * 50.0) / 0.5, 0.0)
    assert ratio == pytest.approx(expected, rel=ROUND)


def test_twist_without_stress_is_no_torque():
    zones, what = even(10, "R" * 10), cable(intrinsic_curvature=(0.0, 0.0, 0.4))
    line = on(what, zones)
    state = state_on(line, along(), 50.0)
    angle = 0.4 * 0.5 * (line.s[1:] + line.s[:-1])
    state.a1[:] = np.cos(angle)[:, None] * state.a1 + np.sin(angle)[:, None] * np.cross(X, state.a1)
    assert weighed(what, zones, state)[TORSION].max() < 1e-20


# --- what no ratio may depend on ------------------------------------------------------------------------


def whole_case(seed):
    """A state that has something of everything: a bed under a part, a clump, two sections, clamps, twist, bends."""
    rng = np.random.default_rng(seed)
    n = 14
    flags = rng.random(n) < 0.5
    flags[[0, -1]] = True  # a rod at both clamps
    base = np.concatenate([[0.0], np.cumsum(rng.uniform(0.5, 1.0, n))])
    base *= 10.0 / base[-1]
    base[6], base[9] = 4.0 + 0.2 * rng.random(), 6.5
    base.sort()
    parts = rng.integers(2, 5, n)
    sections = [{"length": 6.5}, {"length": 3.5, "bending_stiffness": 6.0}]
    at = float(base[6])
    ends = [clamped_at((0, 0, 0), (1, 0, 0)), clamped_at((10, 0, 0), (1, 0, 0))]
    what = cable(start=ends[0], end=ends[1], sections=sections, attachments=[{"kind": "clump", "at": at, "mass": 2.0}])
    zones = layout(base, parts.tolist(), flags)
    N = int(zones.counts.sum())
    d = X + 0.3 * rng.uniform(-1, 1, (N, 3))
    d /= np.linalg.norm(d, axis=1)[:, None]
    e = np.diff(zones.nodes)[:, None] * d
    r = np.vstack([np.zeros(3), np.cumsum(e, axis=0)])
    spin = np.cumsum(rng.uniform(-0.3, 0.3, N))
    a1 = untwisted(e)
    a1 = np.cos(spin)[:, None] * a1 + np.sin(spin)[:, None] * np.cross(d, a1)
    T, before = rng.uniform(5, 50, N), rng.uniform(5, 50, N)
    tangents = X + 0.2 * rng.uniform(-1, 1, (2, 3))
    tangents /= np.linalg.norm(tangents, axis=1)[:, None]
    offset = float(np.median(r[:, 2]))
    return what, zones, r, e, a1, T, before, tangents, offset


def ratios_of(case, turn=None, shift=None):
    what, zones, r, e, a1, T, before, tangents, offset = case
    turn, shift = np.eye(3) if turn is None else turn, np.zeros(3) if shift is None else shift
    line = on(what, zones, SEABED)
    states = []
    for tension in (before, T):
        state = state_on(line, along(), 1.0)
        state.r[:], state.e[:], state.a1[:], state.T[:] = r @ turn.T + shift, e @ turn.T, a1 @ turn.T, tension
        states.append(state)
    frames = np.zeros((2, 3, 3))
    frames[:, :, 2] = tangents @ turn.T
    sea = bed(line, turn @ Z, offset + float(turn @ Z @ shift), 1e-3)
    return weighed(
        what, zones, states[1], before=states[0], dt=0.3, ends=still(frames), sea=sea, bits=SEABED, tolerance=TOL
    )


@pytest.mark.parametrize("seed", range(8))
def test_turned_and_moved(seed):
    """The whole scene turned and moved, the plane of the bed with it: the same ratios.  Round-off over angle^2."""
    case = whole_case(seed)
    turn, _ = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))
    turn *= np.sign(np.linalg.det(turn))
    was = ratios_of(case)
    assert (was[[BEND, SLACK, CLAMP, POINT, EDGE, TORSION]].max(axis=1) > 0).all()
    assert ratios_of(case, turn, np.array([30.0, -20.0, 7.0])) == pytest.approx(was, rel=1e-9)


# --- NaN, givens ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("where", ["T", "e", "a1"])
def test_a_state_that_is_not_a_number_is_never_calm(where):
    """A base cell with a NaN in it has a ratio that is NaN or above 1: max() and min() must not hide it."""
    zones, what = even(10, "R" * 10, parts=2), cable()
    state = state_on(on(what, zones), along(), 50.0)
    getattr(state, where)[9] = np.nan
    assert not (weighed(what, zones, state)[:, 4] <= 1.0).all()


@pytest.mark.parametrize("rod", [True, False])
def test_a_ratio_that_is_not_a_number_asks_for_rod(rod):
    for k in range(len(CRITERIA)):
        ratios = np.zeros((len(CRITERIA), 3))
        ratios[k, 1] = np.nan
        assert wanted(ratios, np.full(3, rod)).tolist() == [False, True, False], CRITERIA[k].name


def test_force_catenary_wins():
    """What the scene says is catenary stays so, however slack; all else becomes rod."""
    zones, what = even(12, "C" * 12), cable()
    state = state_on(on(what, zones), along(), 1e-3 * FLOORED)  # slack everywhere
    given = np.array([0, 0, 0, 1, 1, 1, -1, -1, -1, 0, 0, 0])
    manager = DomainManager(what, zones, given, 1.0, Allowed(TOL), Times(0.5))
    manager.evaluate_criteria(on(what, zones), no_sea(12), still(), state, 0.0)
    change = manager.review(0.0, state)
    assert change is not None and change.rod.tolist() == (given >= 0).tolist()


def lacks_at_pin(what: Material, tension: Any) -> float:
    """What the criterion of a pin lacks of curvature, as a part of that, of an arc of 0.1 1/m whose ends are pins."""
    zones = even(100, "C" * 100, parts=1)
    manager = DomainManager(what, zones, np.zeros(100, int), 1.0, Allowed(TOL), Times(0.5))
    manager.zones.asked[CURVATURE] = 0.1
    line = on(what, zones)
    state = state_on(
        line, lambda s: np.column_stack([10.0 * np.sin(0.1 * s), 0.0 * s, 10.0 * np.cos(0.1 * s)]), tension
    )
    manager.evaluate_criteria(line, no_sea(100), still(), state, 0.0)
    return float(manager.ratios[CLAMP, 0] * manager.zones.shares[CURVATURE] / 0.1)


def test_a_pin_asks_for_rod_where_results_cannot_know_its_layer():
    """Of 2 N m2 and 50 N it fades over 0.2 m: not on a plain line; where EI changes at 0.4 m, e^-2 of it is missing."""
    assert lacks_at_pin(cable(end=pinned(10, 0, 0)), 50.0) == 0.0
    stiff_at_first = cable(end=pinned(10, 0, 0), sections=({"length": 0.4}, {"length": 9.6, "bending_stiffness": 1.0}))
    assert lacks_at_pin(stiff_at_first, 50.0) == pytest.approx(np.exp(-2.0), rel=0.05)
    heavier = cable(end=pinned(10, 0, 0), sections=({"length": 0.4}, {"length": 9.6, "mass": 2.0}))
    assert lacks_at_pin(heavier, 50.0) == 0.0  # another section, the same stiffness
    assert 0.02 < lacks_at_pin(cable(end=pinned(10, 0, 0)), lambda s: 50.0 + 100.0 * s) < 0.15
    moved = cable(end=pinned(10, 0, 0))
    moved.hinged = (False, True)  # as of an end with a moment
    assert lacks_at_pin(moved, 50.0) == pytest.approx(1.0, rel=0.02)  # all of it is missing
