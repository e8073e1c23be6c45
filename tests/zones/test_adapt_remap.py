"""From old zones to new ones: what stays to the last bit, what is kept to round-off, and how smooth the new is.

Round-off here is 1e-12 of the quantity: sums of a hundred terms, each rounded at 1e-16.
Rates are measured on shapes of unit speed, where points of the curve at the arc length of the new nodes are the truth.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from adapt_cases import (
    AXIAL,
    X,
    along,
    cable,
    carried,
    chords,
    drifting,
    even,
    hanging,
    helix,
    layout,
    moved,
    on,
    state_on,
    turns,
    twists,
    untwisted,
)
from hypothesis import given, settings
from hypothesis import strategies as st
from problems import order

from hybrid.kernels.machine.compile import kernel
from hybrid.kernels.mesh import zone_transfer
from hybrid.model.mesh import edges

ROUND = 1e-12
SHAPES = {"hanging": hanging(), "helix": helix()}
NODAL, CELLS = ("r", "v", "a", "vd", "slip"), ("e", "T", "a1", "w", "wa", "wd")


@kernel
def tension_at(s, T, single, at):
    return zone_transfer.tension_at(s, T, single, 1, at)


@pytest.mark.parametrize(("tension", "beside"), [(1.0, 1.0), (6.0, 4.4)])
def test_no_slack_comes_out_of_a_tension_that_falls_towards_an_end(tension: float, beside: float) -> None:
    """10 N in the cell before, 0.4 m behind the middle of the last cell: a straight line, unless it is slack at the end."""
    found = tension_at(np.arange(3.0), np.array([10.0, tension]), np.array([1, 0, 1], np.int8), 1.9)
    assert found == pytest.approx(beside)


# --- random layouts ------------------------------------------------------------------------------------


@st.composite
def switches(draw):
    """(base, parts, old flags, new flags, state seed, clump node or None, EA or None) of a cable of 2 to 12 base cells."""
    n = draw(st.integers(2, 12))
    lengths = np.array(draw(st.lists(st.floats(0.3, 1.5), min_size=n, max_size=n)))
    base = np.concatenate([[0.0], np.cumsum(lengths)])
    flags = st.lists(st.booleans(), min_size=n, max_size=n)
    parts = draw(st.lists(st.integers(2, 5), min_size=n, max_size=n))
    clump = draw(st.none() | st.integers(1, n - 1))
    return base, parts, draw(flags), draw(flags), draw(st.integers(0, 99)), clump, draw(st.sampled_from([None, AXIAL]))


def made(switch):
    """Material, old layout and a random state on it whose chords turn by less than a right angle."""
    base, parts, old, _, seed, clump, stiff = switch
    attachments = None if clump is None else [{"kind": "clump", "at": float(base[clump]), "mass": 3.0}]
    what = cable(float(base[-1]), axial_stiffness=stiff, attachments=attachments)
    zones = layout(base, parts, old)
    line = on(what, zones)
    rng = np.random.default_rng(seed)
    state = state_on(line, along(), 50.0)
    d = X + 0.4 * rng.uniform(-1, 1, (line.h.size, 3))
    state.e[:] = line.h[:, None] * d / np.linalg.norm(d, axis=1)[:, None]
    state.r[:] = np.vstack([rng.uniform(-1, 1, 3), np.zeros((line.h.size, 3))])
    state.r[1:] = state.r[0] + np.cumsum(state.e, axis=0)
    state.a1[:] = untwisted(state.e)
    spin = rng.uniform(-1, 1, line.h.size)
    state.a1[:] = np.cos(spin)[:, None] * state.a1 + np.sin(spin)[:, None] * np.cross(chords(state), state.a1)
    state.T[:] = rng.uniform(20, 80, line.h.size)
    for x in (state.v, state.a, state.vd, state.slip):
        x[:] = rng.uniform(-1, 1, x.shape)
    for x in (state.w, state.wa, state.wd):
        x[:] = rng.uniform(-1, 1, x.shape) * line.spin
    return what, zones, line, state


def stays(old, new):
    """Numbers of the old and new cells, and of the old and new nodes, of the base cells that do not change."""
    same = np.flatnonzero(old.rod == new.rod)
    empty = np.zeros(0, int)
    cells = [np.concatenate([empty, *(np.arange(z.first[j], z.first[j + 1]) for j in same)]) for z in (old, new)]
    nodes = [np.unique(np.concatenate([c, c + 1])) for c in cells]
    return *cells, *nodes


@given(switches())
@settings(max_examples=60, deadline=None, derandomize=True)
def test_what_stays_stays_to_the_last_bit(switch):
    """Base nodes do not move; nodes and cells of base cells that do not change keep everything.

    Velocities of kept nodes are an exception, and a documented one, where a stretch that changes has no inner nodes to
    take up the momentum: all then move together, and that shift is the same for all.
    """
    what, old, line, state = made(switch)
    new, target, out = carried(what, old, switch[3], state)
    new_ = out.state
    assert (new_.r[new.first] == state.r[old.first]).all()
    for name in ("a", "vd", "slip"):
        assert (getattr(new_, name)[new.first] == getattr(state, name)[old.first]).all(), name
    cells, new_cells, nodes, new_nodes = stays(old, new)
    for name in set(CELLS) - {"a1"}:
        assert (getattr(new_, name)[new_cells] == getattr(state, name)[cells]).all(), name
    within = np.flatnonzero((np.diff(cells) == 1) & line.spin[cells[:-1]] & line.spin[cells[1:]])
    spun = twists(new_)[new_cells[within]] - twists(state)[cells[within]]  # rods that meet may be, each as a whole
    assert np.abs(np.angle(np.exp(1j * spun))).max(initial=0.0) < 1e-9
    for name in set(NODAL) - {"v"}:
        assert (getattr(new_, name)[new_nodes] == getattr(state, name)[nodes]).all(), name
    assert (out.lengths[new_cells] == line.h[cells]).all()
    cuts = edges(old.rod == new.rod)
    inner = all(old.rod[a] == new.rod[a] or new.first[b] - new.first[a] > 1 for a, b in pairwise(cuts))
    shift = new_.v[new_nodes] - state.v[nodes]
    if inner:
        assert not shift.any()
    elif shift.size:
        free_ = (new_nodes > 0) & (new_nodes < target.h.size)
        assert not shift[~free_].any()
        assert np.ptp(shift[free_], axis=0).max(initial=0.0) <= 1e-15


@given(switches())
@settings(max_examples=60, deadline=None, derandomize=True)
def test_mass_and_momentum_are_kept(switch):
    what, old, line, state = made(switch)
    _, target, out = carried(what, old, switch[3], state)
    assert target.mass.sum() == pytest.approx(line.mass.sum(), rel=ROUND)
    scale = line.mass @ np.abs(state.v)
    assert (np.abs(moved(target, out.state) - moved(line, state)) <= ROUND * scale).all()


@given(switches())
@settings(max_examples=40, deadline=None, derandomize=True)
def test_new_cells_have_the_tension_that_was_there(switch):
    """Tension is the old one, linear between the middles of old cells, and the lengths returned are those it implies.

    T = (l/h - 1)/ck is the law of a cell; an inextensible one has the length of its chord.
    """
    what, old, line, state = made(switch)
    line.h[:] *= np.random.default_rng(1).uniform(0.99, 1.01, line.h.size)  # cells that are still being let go
    new, target, out = carried(what, old, switch[3], state, line)
    middle = 0.5 * (line.s[:-1] + line.s[1:])
    fresh = np.repeat(old.rod != new.rod, new.counts)
    new_middle = 0.5 * (target.s[:-1] + target.s[1:])
    kinks = what.at.size
    between = fresh & (new_middle > middle[0]) & (new_middle < middle[-1])  # beyond, on the same line
    if not kinks:
        assert out.state.T[between] == pytest.approx(np.interp(new_middle, middle, state.T)[between], rel=ROUND)
    assert (out.state.T > 0.0).all()
    l = np.linalg.norm(np.diff(out.state.r, axis=0), axis=1)
    if switch[-1] is None:
        assert out.lengths[fresh] == pytest.approx(l[fresh], rel=ROUND)
    else:  # l/h - 1 is 1e-3 to 1e-4: 1e-16 in it is 1e-12 of the tension
        assert ((l / out.lengths - 1) * AXIAL)[fresh] == pytest.approx(out.state.T[fresh], rel=1e-11)


@given(switches())
@settings(max_examples=40, deadline=None, derandomize=True)
def test_new_frames_are_unit_and_normal(switch):
    what, old, _, state = made(switch)
    new, _, out = carried(what, old, switch[3], state)
    rod = new.rod_cells
    a1, d = out.state.a1[rod], chords(out.state)[rod]
    assert np.abs(np.einsum("ij,ij->i", a1, a1) - 1).max(initial=0.0) <= 1e-14
    assert np.abs(np.einsum("ij,ij->i", a1, d)).max(initial=0.0) <= 1e-14
    fresh = np.repeat(old.rod != new.rod, new.counts)
    assert not out.state.w[fresh].any() and not out.state.wa[fresh].any() and not out.state.wd[fresh].any()
    assert np.abs(out.state.e[fresh] - np.diff(out.state.r, axis=0)[fresh]).max(initial=0.0) <= 1e-15


@given(switches())
@settings(max_examples=40, deadline=None, derandomize=True)
def test_there_and_back(switch):
    """Split and then merge: base nodes are where they were, and move as they did."""
    what, old, line, state = made((*switch[:2], [False] * len(switch[1]), *switch[3:]))
    new, target, out = carried(what, old, switch[3], state)
    back_layout, again, back = carried(what, new, old.rod, out.state, target)
    assert (back_layout.nodes == old.nodes).all() and (again.h == line.h).all()
    assert (back.state.r == state.r).all()
    assert (
        (back.state.a == state.a).all() and (back.state.vd == state.vd).all() and (back.state.slip == state.slip).all()
    )
    assert np.abs(back.state.v - state.v).max() <= ROUND * np.abs(state.v).max() * line.mass.sum() / line.mass.min()


def test_momentum_is_kept_stretch_by_stretch():
    """Two stretches far from each other change at once: neither pays for the other.

    A stretch with its edges at rest moves up, the other down: what one lacks must not come from the other.
    """
    what, old = cable(), even(12, "C" * 12)
    line = on(what, old)
    shape, _, _ = hanging()
    state = state_on(line, shape)
    state.v[2, 2], state.v[9, 2] = 1.0, -3.0
    _, target, out = carried(what, old, "CRRRCCCCRRRC", state)
    for a, b in ((1, 4), (8, 11)):
        was = line.mass[a : b + 1] @ state.v[a : b + 1]
        # half cells beyond the edges belong to neither, but their nodes have not changed speed
        here = (target.s >= old.base[a] - 1e-9) & (target.s <= old.base[b] + 1e-9)
        assert np.abs(target.mass[here] @ out.state.v[here] - was).max() <= 1e-12


# --- smoothness ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("graded", [False, True], ids=["even", "uneven"])
@pytest.mark.parametrize("name", SHAPES)
def test_new_nodes_converge_to_a_smooth_shape(name, graded):
    """Positions (and velocities) of order 3 in the base cell, tangents 2, curvature at nodes 1.

    The cubic has the slopes of parabolas through three nodes, which are of order 2: times the cell, that is 3.  Base
    cells are even, or alternate as 1 : 1.5.  The curvature of the cubic is off by the third derivative times the cell.
    """
    shape, tangent, curvature = SHAPES[name]
    errors: dict[str, list[float]] = {"place": [], "velocity": [], "tangent": [], "turn": []}
    for n in (16, 32, 64):
        h = np.where(np.arange(n) % 2, 1.5, 1.0) if graded else np.ones(n)
        base = np.concatenate([[0.0], np.cumsum(h)]) * 10.0 / h.sum()
        old = layout(base, 5, "C" * n)
        what = cable()
        state = state_on(on(what, old), shape, 50.0, drifting)
        state.v[:] = shape(state.r[:, 0] * 0 + old.base)  # as smooth as the shape
        _, target, out = carried(what, old, "R" * n, state)
        out.state.v[1:-1] -= (out.state.v - shape(target.s))[1:-1].mean(axis=0)  # the shift that keeps momentum
        middle = 0.5 * (target.s[:-1] + target.s[1:])
        away = (target.s[1:-1] > old.base[1]) & (target.s[1:-1] < old.base[-2])
        errors["place"].append(np.abs(out.state.r - shape(target.s)).max())
        errors["velocity"].append(np.abs(out.state.v - shape(target.s))[1:-1].max())
        errors["tangent"].append(np.abs(chords(out.state) - tangent(middle)).max())
        ratio = turns(chords(out.state)) / (curvature(target.s[1:-1]) * target.hn[1:-1])
        errors["turn"].append(np.abs(ratio - 1)[away].max())
    rates = {k: order(x) for k, x in errors.items()}
    print(name, errors, rates)
    for k, low, high in (("place", 2.7, 3.4), ("velocity", 2.5, 3.5), ("tangent", 1.7, 2.4), ("turn", 0.7, 2.3)):
        assert low < rates[k][-1] < high, (k, errors[k])
    assert errors["turn"][1] < 0.1


@pytest.mark.parametrize("name", SHAPES)
def test_a_rod_that_grows_has_no_kink_where_it_grows(name):
    """A rod joined by cells that were catenary: at the old joint, too, fine chords turn as the curve does.

    The slope at the joint is from a fine and a coarse chord; the turn there is off by a part of the smooth turn
    that falls with the base cell.
    """
    shape, _, curvature = SHAPES[name]
    worst = []
    for n in (12, 24, 48):
        what, old = cable(), even(n, "C" * (n // 3) + "R" * (n // 3) + "C" * (n // 3))
        state = state_on(on(what, old), shape)
        grow = n // 6
        flags = "C" * (n // 3 - grow) + "R" * (n // 3 + 2 * grow) + "C" * (n // 3 - grow)
        _new, target, out = carried(what, old, flags, state)
        inside = target.element[1:-1] == 1
        ratio = turns(chords(out.state)) / (curvature(target.s[1:-1]) * target.hn[1:-1])
        worst.append(np.abs(ratio - 1)[inside].max())
    print(name, worst)
    assert worst[1] < 0.15
    assert (order(worst) > 0.7).all() and (order(worst) < 2.3).all()


def test_unresolved_stay_sharp():
    """A clump hangs in the middle: a corner of 60 deg stays one, and the arms bend as they did, not more.

    Without knowing of the corner, a cubic would round it over two base cells and overshoot beyond.
    """
    n = 24
    what = cable(attachments=[{"kind": "clump", "at": 5.0, "mass": 4.0}])
    old = even(n, "C" * n)
    arm, half = 8.0, np.radians(30.0)  # radius of the arms, half of the corner

    def shape(s):
        x = np.abs(s - 5.0)
        angle = half + x / arm
        return np.column_stack(
            [np.sign(s - 5.0) * arm * (np.sin(angle) - np.sin(half)), 0 * s, -arm * (np.cos(angle) - np.cos(half))]
        )

    state = state_on(on(what, old), shape)
    _new, target, out = carried(what, old, "R" * n, state)
    angle = turns(chords(out.state))
    at = int(np.argmin(np.abs(target.s - 5.0))) - 1
    smooth = target.hn[1:-1] / arm
    # the chords beside the corner lean by half a fine cell each; what is left is the error of a slope, of order 2
    assert angle[at] == pytest.approx(2 * half + smooth[at], abs=2e-3)
    others = np.delete(angle / smooth, at)
    assert others.max() < 1.05 and others.min() > 0.95
    assert np.abs(out.state.r - shape(target.s)).max() < 1e-4


def test_a_linear_tension_stays_linear():
    """A hanging line: T = 20 + 5 s in old cells and in new ones, up to both its ends."""
    what, old = cable(), even(10, "CCCCRRCCCC")
    state = state_on(on(what, old), along((0, 0, 1)), lambda s: 20.0 + 5.0 * s)
    for flags in ("RRRRRRRRRR", "CRRCRRCRRC", "CCCCCCCCCC"):
        _, target, out = carried(what, old, flags, state)
        middle = 0.5 * (target.s[:-1] + target.s[1:])
        assert pytest.approx(20.0 + 5.0 * middle, rel=ROUND) == out.state.T, flags


def test_tension_jumps_at_a_point_load():
    """A clump of 40 N on a vertical cable: above it the tension is 40 N more, in new cells as well.

    A cell that is given the mean of both sides is stretched by what it should not feel, and lets go at once.
    """
    n = 10
    what = cable(attachments=[{"kind": "clump", "at": 5.0, "mass": 4.0}], mass=1e-3)
    old = even(n, "C" * n)
    state = state_on(on(what, old), along((0, 0, -1)), lambda s: np.where(s < 5.0, 60.0, 20.0))
    _, target, out = carried(what, old, "CCCRRRRCCC", state)
    middle = 0.5 * (target.s[:-1] + target.s[1:])
    assert pytest.approx(np.where(middle < 5.0, 60.0, 20.0), rel=ROUND) == out.state.T


# --- frames --------------------------------------------------------------------------------------------


def test_frames_do_not_twist():
    """A new rod's frames are carried from chord to chord without twist; those of a rod that was there stay."""
    n = 12
    shape, _, _ = SHAPES["helix"]
    what, old = cable(), even(n, "CCCCRRRCCCCC")
    state = state_on(on(what, old), shape)
    new, _target, out = carried(what, old, "CRRRRRRRRCCC", state)
    rod = new.rod_cells
    twist = twists(out.state)
    inside = rod[:-1] & rod[1:]
    assert np.abs(twist[inside]).max() < 1e-13
    kept = np.flatnonzero(np.repeat(old.rod, new.counts))
    assert (out.state.a1[kept] == state.a1[old.rod_cells]).all()


@pytest.mark.parametrize("angle", [0.0, 0.5, -2.0, 3.0])
def test_closing_twist_is_spread_evenly(angle):
    """Two rods that meet, turned about each other, of a line that is held: every element between takes an equal part."""
    shape, _, _ = SHAPES["helix"]
    what, old = cable(), even(12, "CRRRCCCCRRRC")
    state = state_on(on(what, old), shape)
    new, _target, clean = carried(what, old, "CRRRRRRRRRRC", state)
    state.a1[:] = untwisted(state.e)
    # what parallel transport over the new chords gives at the second rod, turned by `angle`
    carried_a1 = untwisted(clean.state.e[1:], state.a1[1])  # from the first cell of the first rod
    second = int(old.first[8])
    d = chords(state)[second]
    start = int(new.first[8])
    turned = np.cos(angle) * carried_a1[start - 1] + np.sin(angle) * np.cross(d, carried_a1[start - 1])
    frames = untwisted(state.e[second:], turned)
    state.a1[second:] = frames
    state.a1[1:second] = untwisted(state.e[1:second], state.a1[1])
    _, _, out = carried(what, old, "CRRRRRRRRRRC", state, held=True)
    twist = twists(out.state)
    gap = np.arange(int(new.first[4]) - 1, int(new.first[8]))  # elements between the rods: one more than new cells
    assert twist[gap] == pytest.approx(angle / gap.size, abs=1e-12)
    rest = np.flatnonzero(new.rod_cells[:-1] & new.rod_cells[1:])
    assert np.abs(twist[np.setdiff1d(rest, gap)]).max() < 1e-12
    _, _, loose = carried(what, old, "CRRRRRRRRRRC", state)  # nothing holds either rod: they meet without twist
    assert np.abs(twists(loose.state)[rest]).max() < 1e-12
