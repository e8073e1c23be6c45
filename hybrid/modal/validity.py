"""Where the motion of a line is too large for a response that is linear: every such place is told."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import pairwise, product
from typing import Any

import numpy as np
from scipy import sparse
from scipy.spatial import cKDTree
from scipy.special import ndtr

from hybrid.kernels.algebra.block_elimination import SIZE
from hybrid.kernels.contact.self_contact_law import OUTER
from hybrid.kernels.contact.self_contact_pairs import WINDOW
from hybrid.kernels.laws.axial_law import DYNAMIC, FIRST, STRAIN, TENSION
from hybrid.kernels.laws.bending_law import EACH, FIRST_A, FIRST_B, PER_TENSION, STIFF, TABLE_MOMENT
from hybrid.kernels.laws.bending_law import TABLE_MOMENT as SLIPS_AT
from hybrid.kernels.laws.obstacles import distances, thinner_nodes
from hybrid.kernels.laws.seabed import (
    DEPTH,
    PRESSES,
    STEEP,
    SUCTION,
    normal_forces,
    planes_under,
    soil_at_rest,
)
from hybrid.kernels.state.report import BODIES, FRICTION, OBSTACLES, SEABED, SOIL, SURFACE
from hybrid.kernels.state.state import Floats
from hybrid.linear.loaded_line import STRAIGHT, LoadedLine, LoadedMembers, current_at
from hybrid.linear.matrices import LinearNetwork, pulls
from hybrid.linear.response_results import ADDED, OF_LARGEST, LineResponse, shape_of_drag
from hybrid.linear.touching import Rest, Touch
from hybrid.simulation.lines_contact import diameters

# Parts of the motion beyond which the line is not linear.
SLACK_SHARE = 1e-3  # of the time, in which it would be slack
TURN = 0.2  # rad, standard deviation of the turn of a chord
STRETCH = 0.25  # of the standard deviation of tension: mean tension by the stretch of swinging
LIFTS = 0.02  # of the length, that lifts off or touches down
# Of the change of a body's buoyancy by two standard deviations, and of all of it, how much is not linear.
NOT_LINEAR, OF_BUOYANCY = 0.25, 0.02
# Part by which a stiffness changes at a point of a table, beyond which it is no small one.
KINK = 0.1
# Step, of the length, by which distances to obstacles are differentiated.
NEAR = 1e-7
# Part of a motion by which buoyancy is differentiated.
SMALL = 1e-4
# Parts that what is left out may add to a deviation to the first order, where this is no small part of the largest
# along the line, before a quantity is not valid at all; curvature is not resolved where it is more than ADDED.
# Part by which the law of drag, known to the first order, may change the deviation of the size of curvature.
MOST_ADDED, SHAPE = ADDED | {"curvature": 0.1}, 0.1
# That of tension of a line whose ends move, where 1.2 of it comes true: 3 % (bench/test_bench_response.py).
OF_MOVED = 0.025
# That where free points, bodies or heavy floats with drag move it, of which up to three times as much comes true near a
# resonance that only this damps: 3 % (test_resonance of bench/test_bench_response.py).
OF_DRAGGED = 0.01
# Part from which on it is only told that it is more: the linear deviation may be none at all.
MANY = 10.0
# Part of a line on which curvature has to be known at least.
FEW_PLACES = 0.05


def doubts_of(x: LoadedLine, found: LineResponse) -> Iterator[str]:
    """Each place where the motion of a line is not small, in words."""
    contact = _soil, _touchdown, _on_bed, _on_obstacles, _at_surface
    for doubt in (_slack, _swing, _kinks, _layers, *contact, _left_out, _shape, _hardly_known):
        yield from doubt(x, found)


def _slack(x: LoadedLine, found: LineResponse) -> Iterator[str]:
    """Where tension would be below zero, or of a rod that is compressed at rest above."""
    tension, deviation = found.mean_tension, found.deviation("tension")
    if x.phases is None:
        slack = ndtr(-np.abs(tension) / np.maximum(deviation, 1e-300))
    else:  # a sum of few harmonics has no tails
        slack = (np.sign(tension) * (tension + (x.phases @ found.tension).real) < 0.0).mean(axis=0)
    k = int(slack.argmax())
    if slack[k] > SLACK_SHARE:
        side = "below" if tension[k] >= 0.0 else "above"
        yield (
            f"at s = {found.middle[k]:.4g} m the tension of {tension[k]:.4g} N has a standard deviation of "
            f"{deviation[k]:.4g} N: it would be {side} zero for {100.0 * slack[k]:.2g} % of the time"
        )


def _swing(x: LoadedLine, found: LineResponse) -> Iterator[str]:
    """Where chords turn so far that their squares count: by themselves, and by the length that they take."""
    d = x.linear.state.e / np.linalg.norm(x.linear.state.e, axis=1)[:, None]
    l = np.linalg.norm(x.linear.state.e, axis=1)
    de = np.diff(found.position, axis=1)
    de = de - np.einsum("fni,ni->fn", de, d)[:, :, None] * d
    square = 0.5 * (np.abs(de) ** 2).sum(axis=(0, 2)) / l**2
    k = int(square.argmax())
    if square[k] > TURN**2:
        yield f"at s = {found.middle[k]:.4g} m the line turns by {math.sqrt(square[k]):.2g} rad (standard deviation)"
    compliance = float((x.line.h * x.line.ck).sum())
    deviation = found.deviation("tension")
    held = all(x.x.joints[k] >= 0 or x.x.ends.held[k] for k in (0, 1))  # a free end gives way
    if held and compliance > 0.0:
        pull = 0.5 * float((square * l).sum()) / compliance
        varies = deviation >= OF_LARGEST * deviation.max()  # friction may hold the rest
        at = int(np.where(varies, deviation, np.inf).argmin())
        if pull > STRETCH * deviation[at]:
            yield (
                f"swinging alone stretches the line, which would take {pull:.3g} N in the mean where the standard "
                f"deviation of the tension is {deviation[at]:.3g} N (s = {found.middle[at]:.4g} m)"
            )


def _kinks(x: LoadedLine, found: LineResponse) -> Iterator[str]:
    """Where a line whose law is straight between points goes to and fro over one of them, within two deviations."""
    line = x.line
    tables = (
        ("tension", line.law, line.law_table[:, [TENSION, STRAIN]], found.mean_tension, found.middle, "N", (FIRST,)),
        (
            *("curvature", line.bend_law, line.bend_table[:, : TABLE_MOMENT + 1], found.mean_curvature, found.s, "1/m"),
            (FIRST_A, FIRST_B),
        ),
    )
    for name, law, table, mean, places, unit, columns in tables:
        deviation = found.deviation(name)
        for i, k in product(range(len(law)), columns):
            first, last = int(law[i, k]), int(law[i, k + 1])
            if last - first < 3 or (name == "tension" and law[i, DYNAMIC] > 0.0):
                continue
            at, value = table[first:last].T
            slopes = np.diff(value) / np.diff(at)
            bends = np.abs(slopes[1:] / slopes[:-1] - 1.0) > KINK
            if (bends & (np.abs(at[1:-1] - mean[i]) < 2.0 * deviation[i])).any():
                yield (
                    f"{name} at s = {places[i]:.4g} m, {mean[i]:.4g} {unit} in the mean with a standard deviation of "
                    f"{deviation[i]:.3g} {unit}, passes over a point of its table, where the stiffness changes"
                )
                break


def _layers(x: LoadedLine, found: LineResponse) -> Iterator[str]:
    """Where layers slip that a response has sticking, or lock, within two deviations."""
    line, deviation, T = x.line, found.deviation("curvature"), pulls(found.mean_tension)
    for j in range(0, line.slip_law.shape[1] if line.slip_law.size else 0, EACH):
        law = line.slip_law[:, j : j + EACH]
        K = line.slip_now[:, j + STIFF]
        most = law[:, SLIPS_AT] + law[:, PER_TENSION] * T
        locks = most < 0.0
        at = np.divide(-most, np.abs(K), out=np.full(most.shape, np.inf), where=locks)
        crosses = np.flatnonzero(np.abs(at - found.mean_curvature) < 2.0 * deviation)
        if crosses.size:
            k = int(crosses[0])
            yield (
                f"curvature at s = {found.s[k]:.4g} m, {found.mean_curvature[k]:.4g} 1/m in the mean with a standard "
                f"deviation of {deviation[k]:.3g} 1/m, passes over {at[k]:.4g} 1/m, where the stiffness changes"
            )
            return
        over = np.where((K > 0.0) & ~locks, 2.0 * deviation * K - most, -1.0)
        k = int(over.argmax())
        if over[k] > 0.0:
            yield (
                f"curvature at s = {found.s[k]:.4g} m has a standard deviation of {deviation[k]:.3g} 1/m: layers slip "
                f"beyond {most[k] / K[k]:.3g} 1/m to either side, and the line is softer than this response has it"
            )
            return


def _soil(x: LoadedLine, found: LineResponse) -> Iterator[str]:
    """Where soil is softer than to small motions, between turning points of two deviations."""
    if not x.line.bits & SOIL:
        return
    normals, _ = planes_under(x.sea, found.mean_position)
    way = np.einsum("fni,ni->fn", found.position, normals)
    soil, width, remembered = x.sea.soil, x.line.bed_width, x.linear.state.soil
    for k in np.flatnonzero(remembered[:, DEPTH] > 0.0):
        borne, steep = remembered[k, PRESSES], soil[STEEP] / width[k]
        ultimate = borne * (1.0 + 1.0 / (remembered[k, DEPTH] * steep))
        least = min(borne + soil[SUCTION] * ultimate, ultimate - borne)
        range_ = 4.0 * math.sqrt(0.5 * float((np.abs(way[:, k]) ** 2).sum())) * ultimate * steep
        if range_ > KINK * least:
            yield (
                f"at s = {found.s[k]:.4g} m the line moves so far in the soil that its stiffness falls by "
                f"{100.0 * range_ / (range_ + least):.2g} %: tension and curvature near the touchdown are doubtful"
            )
            return


def _touchdown(x: LoadedLine, found: LineResponse) -> Iterator[str]:
    """What of the line lifts off the bed or comes down on it."""
    if not x.line.bits & SEABED or not x.sea.stiffness > 0.0:
        return
    normals, depths = planes_under(x.sea, found.mean_position)
    way = np.einsum("fni,ni->fn", found.position, normals)
    yield from _crossing(x, 0.5 * x.sea.onset - depths, way, "the bed")


def _on_bed(x: LoadedLine, found: LineResponse) -> Iterator[str]:
    """What of the line slides on the bed, where friction sticks in the response."""
    line, r = x.linear.line, found.mean_position
    if not (line.bits & SEABED and line.bits & FRICTION and x.sea.friction.any()):
        return
    force = np.zeros(len(r))
    if line.bits & SOIL:
        soil_at_rest(line, x.sea, r, np.zeros_like(x.linear.state.soil), force, np.zeros((len(r), 2)))
    else:
        normal_forces(line, x.sea, r, force)
    n, _ = planes_under(x.sea, r)
    way = found.position - np.einsum("fni,ni->fn", found.position, n)[:, :, None] * n
    parts = np.sqrt(2.0 * (np.abs(way) ** 2).sum(axis=(0, 2))) / x.sea.slip_length
    # what friction would have to bear, over what it can: the part of the contact that slides before the rest bears it
    share = float(force @ parts / max(float(force.sum()), 1e-300))
    if share > OPENS and (parts[force > 0.0] > 1.0).any():
        yield _slides("the line and the bed", min(share, 1.0))


def _slides(name: str, share: float) -> str:
    return (
        f"contact of {name} slides where {100.0 * share:.0f} % of its force are borne, and sticks here; "
        "without friction (--smooth) it slides freely, hybrid run has both"
    )


def _on_obstacles(x: LoadedLine, found: LineResponse) -> Iterator[str]:
    """What of the line lifts off an obstacle or comes down on it."""
    if not x.line.bits & OBSTACLES:
        return
    r = found.mean_position
    step = NEAR * float(x.line.s[-1])
    sides = [(distances(x.sea, r + d) - distances(x.sea, r - d)) / (2.0 * step) for d in step * np.eye(3)]
    gaps = distances(x.sea, r) + thinner_nodes(x.sea.obstacles, x.line.s)
    for k, (name, gap, n) in enumerate(zip(x.obstacles, gaps, np.stack(sides, axis=-1), strict=True)):
        way, kind = (found.position - x.carried[k], "body") if k in x.carried else (found.position, "obstacle")
        yield from _crossing(x, gap, np.einsum("fni,ni->fn", way, n), f"{kind} {name}")


def _at_surface(x: LoadedLine, found: LineResponse) -> Iterator[str]:
    """Bodies at nodes that come out of the water, or go under, so far that their buoyancy is not linear."""
    line = x.linear.line
    if not (line.bits & SURFACE and line.bits & BODIES):
        return
    for i in np.flatnonzero(line.point_buoy > 0.0):
        rise = np.abs(x.rise[:, i] - found.position[:, i, 2])
        way = min(2.0 * math.sqrt(0.5 * float((rise**2).sum())), float(rise.sum()))
        at = (x.sea.surface - found.mean_position[i, 2]) / line.point_height[i] + 0.5
        wet = np.clip(at + way / line.point_height[i] * np.array([0.0, -1.0, 1.0, -SMALL, SMALL]), 0.0, 1.0)
        wet = wet if line.point_upright[i] else wet * wet * (3.0 - 2.0 * wet)
        linear = 0.5 * (wet[4] - wet[3]) / SMALL
        off = float(np.abs(wet[1:3] - wet[0] - linear * np.array([-1.0, 1.0])).max())
        if off > max(NOT_LINEAR * linear, OF_BUOYANCY):
            yield (
                f"the surface goes up and down by {way:.3g} m at the body at s = "
                f"{found.s[i]:.4g} m, which is {100.0 * wet[0]:.3g} % wet at rest: its buoyancy changes by up to "
                f"{100.0 * off:.2g} % of it otherwise"
            )


def _crossing(x: LoadedLine, gap: Floats, way: Floats, what: str) -> Iterator[str]:
    """Where a motion (F, N+1) m along the normal of what is touched crosses it; gap: (N+1,) m, at rest."""
    up = np.sqrt(0.5 * (np.abs(way) ** 2).sum(axis=0))
    share = 0.5 * (np.append(x.line.h, 0.0) + np.append(0.0, x.line.h))
    # the length over which a motion of two standard deviations crosses it
    crosses = float(share[2.0 * up > np.abs(gap)].sum())
    if crosses > LIFTS * float(x.line.s[-1]):
        yield (
            f"about {crosses:.3g} m of line lift off {what} and come down on it, which contact as it is at rest does "
            "not show: tension and curvature there are doubtful"
        )


def _left_out(x: LoadedLine, found: LineResponse) -> Iterator[str]:
    """Where what a linear response leaves out adds to a deviation."""
    for name, places, unit in (("tension", found.middle, "N"), ("curvature", found.s, "1/m")):
        deviation, part = found.deviation(name), found.left_out[name]
        added = np.where(deviation >= OF_LARGEST * deviation.max(), part, 0.0)
        k = int(added.argmax())
        moved = x.shifts.any() or x.turns.any() or max(x.x.joints) >= 0
        of_moved = OF_DRAGGED if x.by_drag else OF_MOVED
        if added[k] > (of_moved if (moved or x.by_drag) and name == "tension" else MOST_ADDED[name]):
            more = f"up to {100.0 * part[k]:.2g}" if part[k] < MANY else f"more than {100.0 * MANY:g}"
            what, remedy = ", of points, floats and bodies too,", "; near a resonance it is more: run it in time"
            yield (
                f"{name} at s = {places[k]:.4g} m: the rest of quadratic drag{what if x.by_drag else ''} and the "
                f"stretch by swinging would add {more} % to its standard deviation of "
                f"{deviation[k]:.3g} {unit}{remedy if x.by_drag else ''}"
            )


def _shape(x: LoadedLine, found: LineResponse) -> Iterator[str]:
    """Where bends that straighten and turn over make the deviation of their size a matter of the law of drag."""
    deviation = found.deviation("curvature")
    change = np.where(deviation >= OF_LARGEST * deviation.max(), np.abs(found.shape), 0.0)
    k = int(change.argmax())
    if change[k] > SHAPE:
        yield (
            f"curvature at s = {found.s[k]:.4g} m, of {found.mean_curvature[k]:.3g} 1/m in the mean, turns over: that "
            f"drag is not normal changes its standard deviation of {deviation[k]:.3g} 1/m by {100.0 * change[k]:.2g} %"
        )


def _hardly_known(x: LoadedLine, found: LineResponse) -> Iterator[str]:
    """Whether curvature is known hardly anywhere, or not where it varies most."""
    deviation, known = found.deviation("curvature"), found.resolved("curvature")
    k = int(deviation.argmax())
    if deviation[k] > STRAIGHT and not (known[k] and known.mean() >= FEW_PLACES):
        yield (
            f"curvature at s = {found.s[k]:.4g} m, where it varies most, is {'' if known[k] else 'not '}known; along "
            f"{100.0 * (1.0 - known.mean()):.3g} % of the line it is not, as it varies by less than a fifth of that or "
            f"more than {100.0 * ADDED['curvature']:.2g} % of it are left out"
        )


# Where motion opens, closes or slides what touches at rest, so that a response that is linear does not hold.

# Part of the force of a contact that is borne where it opens, or slides, within two standard deviations, beyond which
# it is told; of the length, how much may come to lie on what is touched already.
OPENS, CLOSES = 0.25, 0.02
# Cells from a common joint within which lines do not touch (docs/points.md).
BESIDE = 4


def name_of(touch: Touch, rest: Rest) -> str:
    """What touches, for people."""
    a, b = touch.of
    line = f"line {rest.names[a]}" if len(rest.names) > 1 else "the line"
    if touch.obstacle:
        return f"{line} and {obstacle_of(touch, rest)}"
    return f"{line} with itself" if a == b else f"lines {rest.names[a]} and {rest.names[b]}"


def obstacle_of(touch: Touch, rest: Rest) -> str:
    """The obstacle, or the body that carries it, for people."""
    line, k = touch.of
    rides = rest.solver.lines[line].rides
    return f"{'body' if rides.size and rides[k] >= 0 else 'obstacle'} {rest.models[line].sea.names[k]}"


def touching_doubts(touch: Touch, name: str, moved: Any) -> Iterator[str]:
    """Whether a contact opens or slides in a motion (unknowns, F)."""
    opens = touch.depth < 2.0 * _deviation(touch.apart @ moved)
    share = float(touch.force[opens].sum() / touch.force.sum())
    if share > OPENS:
        yield (
            f"contact of {name} opens and closes: where {100.0 * share:.0f} % of its force are borne the motion is "
            "more than it is pressed together at rest (two standard deviations)"
        )
    if touch.slides.shape[0]:
        ways = _deviation(touch.slides @ moved).reshape(-1, 3)
        slides = touch.travel < 2.0 * np.linalg.norm(ways, axis=1)
        share = float(touch.force[slides].sum() / touch.force.sum())
        if share > OPENS:
            yield _slides(name, share)


def _deviation(amplitudes: Any) -> Floats:
    """Standard deviations (n,) of amplitudes (n, F)."""
    return np.asarray(np.sqrt(0.5 * (np.abs(amplitudes) ** 2).sum(axis=1)))


def closing_doubts(rest: Rest, found: Mapping[str, LineResponse]) -> Iterator[str]:
    """Lines that may touch each other, do not do so at rest, and come to it in the motion."""
    for a, b in rest.may_touch.pairs if rest.may_touch is not None else ():
        one, two = (found[rest.names[k]] for k in (a, b))
        wide = [diameters(rest.models[k]) for k in (a, b)]
        cells = _cells_near(one, two, OUTER * max(float(x.max()) for x in wide))
        cells = cells[~_beside_joint(rest, (a, b), cells)]
        i, j = cells.T
        u, v, away = _nearest(one.mean_position, two.mean_position, i, j)
        distance = np.linalg.norm(away, axis=1)
        gap = distance - 0.5 * OUTER * (wide[0][i] + wide[1][j])
        n = away / np.maximum(distance, 1e-300)[:, None]
        apart = np.einsum("fni,ni->nf", _between(one.position, i, u) - _between(two.position, j, v), n)
        closes = (gap > 0.0) & (gap < 2.0 * _deviation(apart))
        touch = bool((gap <= 0.0).any())
        length = float(np.diff(one.s)[np.unique(i[closes])].sum())
        if closes.any() and not (touch and length <= CLOSES * float(one.s[-1])):
            k = int(np.flatnonzero(closes)[gap[closes].argmin()])
            first, second = rest.names[a], rest.names[b]
            yield (
                f"lines {first} and {second} come to touch each other{' elsewhere' * touch}: {gap[k]:.3g} m apart at "
                f"rest at s = {one.s[i[k]]:.4g} m of {first}, {two.s[j[k]]:.4g} m of {second}"
            )


def _cells_near(one: LineResponse, two: LineResponse, reach: float) -> np.ndarray:
    """(n, 2) cells of two lines that may come nearer than a distance, m, in the motion."""
    moves = sum(2.0 * float(_deviation(np.abs(x.position).max(axis=(1, 2))[None])[0]) for x in (one, two))
    ends = [x.mean_position for x in (one, two)]
    trees = [cKDTree(0.5 * (r[1:] + r[:-1])) for r in ends]
    half = sum(0.5 * float(np.linalg.norm(np.diff(r, axis=0), axis=1).max()) for r in ends)
    near = trees[0].query_ball_tree(trees[1], reach + half + 2.0 * moves)
    return np.array([(i, j) for i, row in enumerate(near) for j in row], int).reshape(-1, 2)


def _beside_joint(rest: Rest, pair: tuple[int, int], cells: np.ndarray) -> np.ndarray:
    """Which of the cells (n, 2) of two lines are beside what both are joined to, where they do not touch."""
    assert rest.may_touch is not None
    out = np.zeros(len(cells), bool)
    joined = [rest.may_touch.joined[rest.may_touch.lines.index(k)] for k in pair]
    for e in (0, 1):
        for f in (0, 1):
            if joined[0][e] != joined[1][f]:
                continue
            near = np.ones(len(cells), bool)
            for k, end, each in zip(pair, (e, f), cells.T, strict=True):
                s, wide = rest.models[k].line.s, float(diameters(rest.models[k]).max())
                from_end = each if end == 0 else s.size - 2 - each
                away = s[each] - s[0] if end == 0 else s[-1] - s[each + 1]
                near &= (from_end < BESIDE) | (away < WINDOW * wide)
            out |= near
    return out


def _nearest(one: Floats, two: Floats, i: np.ndarray, j: np.ndarray) -> tuple[Floats, Floats, Floats]:
    """Where (n,), 0 to 1, cells i of nodes `one` and j of `two` are nearest, and the ways (n, 3) m from j to i."""
    d, e, r = one[i + 1] - one[i], two[j + 1] - two[j], one[i] - two[j]
    dd, ee, de, dr, er = (np.einsum("ni,ni->n", x, y) for x, y in ((d, d), (e, e), (d, e), (d, r), (e, r)))
    across = dd * ee - de**2
    u = np.clip(np.where(across > 1e-12 * dd * ee, (de * er - dr * ee) / np.maximum(across, 1e-300), 0.5), 0.0, 1.0)
    v = np.clip((de * u + er) / ee, 0.0, 1.0)
    u = np.clip((de * v - dr) / dd, 0.0, 1.0)
    return u, v, r + u[:, None] * d - v[:, None] * e


def _between(motion: Floats, cell: np.ndarray, part: Floats) -> Floats:
    """Motions (F, n, 3) at parts (n,) of cells, of those (F, N+1, 3) of nodes."""
    return np.asarray((1.0 - part)[:, None] * motion[:, cell] + part[:, None] * motion[:, cell + 1])


# What a linear response leaves out: the rest of quadratic drag of lines and members, and the stretch by swinging.
#
# Both are taken from the linear motion, at times of a stretch of sea, as loads that the linear network then answers:
#
#     on half cells and pieces of members   f(U + u) - mean - B u,        of cells   a length of -|de|^2/2l across,
#
# with B the linear drag of a velocity u relative to the water.  To the first order it is what quadratic drag and large
# turns change, harmonics and all; what they change in turn is left out.  docs/theory.md, 21.

PARTS = 4  # spans of time: of fewer, results scatter with the phases by more than a quarter
TIMES = 256  # samples of each
TO_A_PERIOD = 8.2  # samples of the shortest period that counts
POWER = 0.01  # part of the power beyond which periods do not count, and loads are left out
# Times of each part where free points, bodies or heavy floats have drag, which alone may damp them: parts must outlast
# many such decays, else their windows spread what drag leaves out over more frequencies than the resonance answers to.
RESONANT = 1024
# Multiplications from which a product of matrices is shared among threads, whose waiting takes more processor time than
# products of this size.
SHARED = 2**18
# Amplitudes q of exp(-i w t) that the network answers to those of loads (q,), at w, 1/s.
Answer = Callable[[float, Any], Any]


def left_out(
    network: LinearNetwork, lines: Sequence[LoadedLine], members: Mapping[int, LoadedMembers], answer: Answer
) -> list[LineResponse]:
    """The response of each line, with the neglected parts of standard deviations and the law of curvature.

    Parts of those of tension (N,) and curvature (N+1,); the motion is known at all frequencies.  members: of bodies, by
    their numbers.
    """
    omegas, step = lines[0].omegas, _step([*lines, *members.values()])
    times = RESONANT if any(x.by_drag for x in lines) else TIMES
    t = step * np.arange(PARTS * times)
    turned = np.hstack([np.cos(np.outer(t, omegas)), np.sin(np.outer(t, omegas))])  # (M, 2F)
    window = np.hanning(times + 1)[:-1]  # so that no end of a part excites what hardly anything damps
    loads = network.place.T @ np.concatenate([_loads(x, turned) for x in lines])  # (q, M)
    for b, each in members.items():
        first = network.size + 6 * (b - network.bodies)
        loads[first : first + 6] += _loads_of_members(each, turned)
    there = np.fft.rfft(loads.reshape(network.size, PARTS, times) * window, axis=2) / times
    nu = 2.0 * np.pi * np.fft.rfftfreq(times, step)
    power = np.cumsum((np.abs(there[:, :, 1:]) ** 2).sum(axis=(0, 1)))
    last = 2 + int(np.searchsorted(power, (1.0 - POWER) * power[-1])) if power[-1] > 0.0 else 1
    numbers = np.arange(1, min(last, nu.size))
    q = np.zeros((network.size, numbers.size, PARTS), complex)
    for row, k in enumerate(numbers):
        q[:, row] = answer(nu[k], there[:, :, k].conj())
    whole = network.place @ q.reshape(network.size, numbers.size * PARTS)
    part = PARTS * float(np.mean(window**2))
    vectors = q.reshape(network.size, -1).T
    return [_changes(x, whole[a:b], vectors, part) for x, (a, b) in zip(lines, pairwise(network.at), strict=True)]


def _step(loaded: Sequence[LoadedLine | LoadedMembers]) -> float:
    """s, between times that show the loads."""
    omegas = loaded[0].omegas
    every = np.arange(omegas.size)
    power = sum((np.abs(x.relative(every)) ** 2).sum(axis=(1, 2)) for x in loaded)
    part = np.cumsum(power) / max(float(np.sum(power)), 1e-300)
    shortest = omegas[min(int(np.searchsorted(part, 1.0 - POWER)), omegas.size - 1)]
    return float(2.0 * np.pi / shortest / TO_A_PERIOD)


def _at_times(turned: Floats, amplitudes: Floats) -> Floats:
    """(..., M) of amplitudes (F, ...)."""
    flat = amplitudes.reshape(len(amplitudes), -1)
    both = np.ascontiguousarray(np.vstack([flat.real, flat.imag]).T)
    size = max(math.isqrt(SHARED // both.shape[1]), 1)
    out = np.empty((len(both), len(turned)))
    for rows, columns in product(range(0, len(both), size), range(0, len(turned), size)):
        here = slice(rows, rows + size), slice(columns, columns + size)
        np.matmul(both[here[0]], turned[here[1]].T, out=out[here])
    return out.reshape(*amplitudes.shape[1:], len(turned))


def _loads(x: LoadedLine, turned: Floats) -> Floats:
    """(5 (N+1), M): what is left out at each time, less its mean."""
    n, count = x.line.s.size, len(turned)
    u = _at_times(turned, x.relative(np.arange(x.omegas.size)))  # (N+1, 3, M)
    used = np.flatnonzero((x.cn > 0.0) | (x.ct > 0.0))
    drag = _of_cylinders(x.d[used], (x.cn[used], x.ct[used]), u[x.node[used]] + x.current[used][:, :, None])
    gathered = sparse.csr_array((np.ones(used.size), (x.node[used], np.arange(used.size))), shape=(n, used.size))
    force = (gathered @ drag.reshape(used.size, 3 * count)).reshape(n, 3, count)
    at = np.flatnonzero(x.point_drag)
    speed = u[at] + current_at(x.line, x.sea, x.linear.r[at])[:, :, None]
    force[at] += x.point_drag[at][:, None, None] * np.sqrt((speed**2).sum(axis=1))[:, None] * speed
    out = np.zeros((n, SIZE, count))
    out[:, 1:4] = force - x.blocks @ u
    l = np.linalg.norm(x.linear.state.e, axis=1)
    direction = (x.linear.state.e / l[:, None])[:, :, None]
    de = np.diff(_at_times(turned, x.q[:, :, 1:4]), axis=0)
    square = (de**2).sum(axis=1) - (de * direction).sum(axis=1) ** 2
    out[1:, 0] = -square / (2.0 * l)[:, None]
    out -= out.mean(axis=2)[:, :, None]
    return np.asarray(out.reshape(n * SIZE, count))


def _loads_of_members(x: LoadedMembers, turned: Floats) -> Floats:
    """(6, M) N, N m on the body: what is left out of the drag of its members at each time, less its mean."""
    u = _at_times(turned, x.relative(np.arange(x.omegas.size)))  # (n, 3, M)
    rest = _of_cylinders(x.d, (x.cn, x.ct), u + x.current[:, :, None]) - x.blocks @ u
    out = np.einsum("nia,nim->am", x.T, rest)
    return np.asarray(out - out.mean(axis=1)[:, None])


def _of_cylinders(d: Floats, drag: tuple[Floats, Floats], speed: Floats) -> Floats:
    """Quadratic drag (H, 3, M) N of cylinders along d (H, 3) in water at a speed (H, 3, M) m/s, which it overwrites.

    drag: across and along, (H,) N s^2/m^2.
    """
    d = d[:, :, None]
    along = (speed * d).sum(axis=1)[:, None]
    speed -= d * along
    speed *= drag[0][:, None, None] * np.sqrt((speed**2).sum(axis=1))[:, None]
    speed += d * (drag[1][:, None, None] * np.abs(along) * along)
    return speed


def _changes(x: LoadedLine, whole: Any, vectors: Any, part: float) -> LineResponse:
    """By the amplitudes (5 (N+1), K) of what is added, in parts whose windows have mean squares of this sum.

    vectors: (K, q), the same of the network.
    """
    n, count = x.line.s.size, whole.shape[1]
    moved = np.moveaxis(whole.reshape(n, SIZE, count), 2, 0)
    added, linear = (
        x.response_to(moved, x.turned_with(vectors, np.zeros((count, 2, 3), complex)), np.zeros(count)),
        x.result(),
    )
    own, more = linear.covariance, added.covariance
    # of the size of curvature, by where the bend points: fast bends across hide nothing of the plane of the bend
    points = own.copy()
    points[:, 0, 0] += linear.mean_curvature**2
    pairs = {
        "tension": [(np.abs(of.tension) ** 2).sum(axis=0) for of in (added, linear)],
        "curvature": [(points * of).sum(axis=(1, 2)) for of in (more, own)],
        "in plane": [of[:, 0, 0] for of in (more, own)],
    }
    out = {k: np.sqrt(1.0 + 4.0 / part * m / np.maximum(alone, 1e-300)) - 1.0 for k, (m, alone) in pairs.items()}
    in_plane = out.pop("in plane")
    return replace(linear, left_out=out, shape=_shape_left_out(x, linear, in_plane))


def _shape_left_out(x: LoadedLine, linear: LineResponse, part: Floats) -> Floats:
    """(N+1,): by which the deviation of the size of curvature changes as that in the plane of the bend is not normal.

    part: (N+1,) that what is left out adds to the deviation in that plane.

    A string bends against the load: by drag of the water that comes from inside the bend less.
    """
    if x.phases is not None or not (x.cn.any() and linear.mean_curvature.any()):
        return np.zeros(part.size)
    inwards = x.bend[2][:, 0]
    u = np.einsum("fni,ni->fn", x.relative(np.arange(x.omegas.size)), inwards)
    flow = -np.einsum("ni,ni->n", current_at(x.line, x.sea, x.linear.r), inwards)
    deviation = np.stack([np.sqrt(linear.spectrum(name).moment(0)) for name in ("curvature", "curvature_across")])
    spread = np.sqrt(0.5 * (np.abs(u) ** 2).sum(axis=0))
    return shape_of_drag(linear.mean_curvature, deviation, part, flow / np.maximum(spread, 1e-300))
