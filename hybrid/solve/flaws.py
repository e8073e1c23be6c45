"""Why a state in which all forces balance is no equilibrium of a line: without tension, buried, folded."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from hybrid.errors import Outcome
from hybrid.kernels.laws.obstacles import cells_met, depths_in_obstacles, distances, half_thickness
from hybrid.kernels.laws.seabed import LATERAL, planes_under
from hybrid.kernels.march.resolution_checks import lowest, lowest_not_held
from hybrid.kernels.state.report import (
    AXIS,
    BODIES,
    FLAT,
    FRICTION,
    HALF_LENGTH,
    KIND,
    MESH,
    MU,
    OBSTACLES,
    PLACE,
    RADIUS,
    RIDES,
    RING,
    ROUND,
    SEABED,
    SHEAVE,
    STRAND,
    TORUS,
)
from hybrid.kernels.state.state import Floats, Line, Sea, State
from hybrid.solve.stability import Stability, is_judged
from hybrid.solve.stepper import JoinedLine, NetworkState

LEAST_TENSION = 1e-3  # of the slack floor of a motion, with the opposite sign: what a catenary needs more of at rest
# A line that lies this part of its length, and this many onsets of contact, under the bed has gone through it.
BURIED, BURIED_ONSETS = 0.02, 100.0
# Chords that turn by more than this from one cell to the next, rad, are a fold, whose bend is within the cells.  Where
# both cells pull, the line hangs in the fold as in a tight sag: each pulls by less than the load of one cell, and the
# shape is right to a cell, as the diagnostics say.  A rod that presses on the fold by more than that load, and than the
# EI/h^2 that its bend there bears, stands on it, which no bend of its true size lets it.
FOLDED = 0.5 * np.pi
LIES_SLACK = 1e-9  # of the largest tension: what round-off leaves in a line that lies slack
HARDLY = 1e-3  # of the tension scale: a catenary that is compressed by less is slack
RESOLVED = 0.3  # rad from one cell to the next, of a bend that cells show
# From how near an obstacle on a line counts as on it, as a part of how deep it may lie.
TOUCHING = 0.01
# Of its radius squared: how far a line is on the other side of an obstacle than the straight span of its ends.
BEHIND = 0.05
# Product of mean normals from which on two places of an obstacle are on opposite sides; of its radius, for differences.
OPPOSITE, NORMAL_STEP = 0.25, 1e-5
PASSED = 0.8  # of half the thickness of an obstacle: depth that the straight way of a place has which passed through it
SECTIONS = 24  # golden sections of that way
PLACES = 4  # that are looked at in a cell


def lowest_tension(line: Line, sea: Sea, state: State) -> tuple[float, int]:
    """Lowest tension of a catenary cell that does not lie slack, or held by friction, on the bed, N, and the cell."""
    if line.bits & FRICTION:
        return lowest_not_held(line, sea, state.T)
    lies = lies_slack(line, sea, state)
    return lowest(line, np.where(lies, np.inf, state.T) if lies.any() else state.T)


def lies_slack(line: Line, sea: Sea, state: State) -> np.ndarray:
    """Cells (N,) of a catenary that lie, or come down, on the bed without tension: they carry nothing, in any shape."""
    if not line.bits & SEABED:
        return np.zeros(line.h.size, bool)
    nothing = LIES_SLACK * float(np.abs(state.T).max())
    rests = planes_under(sea, state.r)[1] > 0.0
    rests[[0, -1]] |= rests[[1, -2]]  # an end at the height of the bed
    return np.asarray((line.spin == 0) & (np.abs(state.T) <= nothing) & (rests[:-1] | rests[1:]))


def flaw_of_line(line: Line, sea: Sea, state: State, length: float, floor: float) -> tuple[Outcome, int]:
    """What makes a state no equilibrium of a line, or OK, and the cell or node.

    SLACK: a catenary is not under a tension of more than `floor` (N).  BURIED: deep in the bed or an obstacle.
    FOLDED: a rod stands on a fold.
    """
    tension, cell = lowest_tension(line, sea, state)
    if not tension > floor:
        return Outcome.SLACK, int(cell)
    if line.bits & SEABED:
        deep = planes_under(sea, state.r)[1] - 0.5 * sea.onset
        if deep.max() > max(BURIED * length, BURIED_ONSETS * sea.onset):
            return Outcome.BURIED, int(np.argmax(deep))
    if line.bits & OBSTACLES:
        met = cells_met(sea.carried, line.s) if sea.carried.size else None
        within = depths_in_obstacles(sea, state.r, line.s, met).max(axis=0)
        if within.max() > 1.0:
            return Outcome.BURIED, int(np.argmax(within))
    turns = np.where(_pressed(line, state), folds(line, state), 0.0)
    if turns.max() > FOLDED:
        return Outcome.FOLDED, int(np.argmax(turns))
    return Outcome.OK, -1


def _pressed(line: Line, state: State) -> np.ndarray:
    """Nodes (N+1,) of rods that a cell presses on by more than their load and their stiffness, EI/h^2, bear."""
    low = np.minimum(np.append(state.T, np.inf), np.append(np.inf, state.T))
    return np.asarray(-low > np.linalg.norm(line.force, axis=1) + line.kb[:, :2].max(axis=1) / line.hn)


def folds(line: Line, state: State) -> Floats:
    """Angle (N+1,), rad, by which chords turn from one cell to the next; 0 where no rod without a point load bends."""
    d = state.e / np.linalg.norm(state.e, axis=1)[:, None]
    turn = np.zeros(line.s.size)
    turn[1:-1] = np.arctan2(np.linalg.norm(np.cross(d[:-1], d[1:]), axis=1), np.einsum("ij,ij->i", d[:-1], d[1:]))
    turn[line.element == 0] = 0.0
    # beside a point load a line bends within sqrt(EI/T), however long its cells are
    turn[(line.point_mass > 0.0) | (line.point_lift != 0.0)] = 0.0
    if line.bits & BODIES:
        turn[line.point_buoy != 0.0] = 0.0
    return turn


def overstretched_cell(line: Line, state: State, borne: Floats) -> int:
    """The cell that is stretched or compressed most, of those that are beyond the strain that they bear; -1: none is.

    borne: (N,).  A line can be in balance on the wrong side of an obstacle, stretched round it.
    """
    part = np.abs(np.linalg.norm(state.e, axis=1) / line.h - 1.0) / borne
    return int(np.argmax(part)) if part.max() > 1.0 else -1


def on_obstacles(line: Line, sea: Sea, state: State) -> np.ndarray:
    """Which nodes (M, N+1) of a line, or the cells after them, lie on each obstacle."""
    met = cells_met(sea.carried, line.s) if sea.carried.size else None
    return depths_in_obstacles(sea, state.r, line.s, met) > -TOUCHING


ON_BED = "on the seabed"


def rubs_on(line: Line, sea: Sea, held: np.ndarray, state: State) -> list[str]:
    """On what with friction a line lies, in words.

    At other nodes than ends (2,) that are held, which no friction moves.
    """
    free, found = np.ones(line.s.size, bool), []
    free[[0, -1]] = held == 0
    bed = line.bits & SEABED and (sea.friction.any() or (sea.soil.size and sea.soil[LATERAL] > 0.0))
    if bed and (planes_under(sea, state.r)[1][free] > 0.0).any():
        found.append(ON_BED)
    if line.bits & OBSTACLES and on_obstacles(line, sea, state)[sea.obstacles[:, MU] > 0.0][:, free].any():
        found.append("on obstacles")
    return found


def behind_obstacles(line: Line, sea: Sea, state: State) -> Iterator[tuple[int, int]]:
    """Obstacles that a line touches on the side that is away from the straight span of its ends, and a node there.

    A line that hangs through an obstacle is begun on the side of the span.
    """
    rows, way, touched = sea.obstacles, state.r[-1] - state.r[0], on_obstacles(line, sea, state)
    for which, (row, nodes) in enumerate(zip(rows, touched, strict=True)):
        axis, place, r = row[AXIS : AXIS + 3], row[PLACE : PLACE + 3], state.r[nodes]
        if row[KIND] == TORUS:  # in the hole of a ring a line lies on any side
            r = r[np.linalg.norm(np.cross(r - place, axis), axis=1) > row[RING]]
        if row[KIND] in (FLAT, MESH) or not r.size:
            continue
        half = row[HALF_LENGTH] if row[KIND] == ROUND else 0.0
        along = np.clip((r - place) @ axis, -half, half)
        middle = place + along.mean() * axis
        part = np.clip((middle - state.r[0]) @ way / (way @ way), 0.0, 1.0) if way.any() else 0.0
        span, side = state.r[0] + part * way - middle, (r - middle).mean(axis=0)
        if half > 0.0 or row[KIND] == SHEAVE:  # of a cylinder or sheave what counts is across its axis
            span, side = span - (span @ axis) * axis, side - (side @ axis) * axis
        if span @ side < -BEHIND * row[RADIUS] ** 2:
            yield which, int(np.flatnonzero(nodes)[0])


def obstacles_left(line: Line, sea: Sea, start: State, state: State) -> Iterator[tuple[int, int, bool]]:
    """Obstacles that a line touches at its start, and in a state not, or on the other side.

    With the node that is nearest at the start, and whether it touches the other side.
    """
    rows, touched = sea.obstacles, on_obstacles(line, sea, state)
    gaps = distances(sea, start.r)
    for which, gap in enumerate(gaps):
        near = gap < BEHIND * rows[which, RADIUS]
        if rows[which, KIND] == FLAT or not near.any():
            continue
        node = int(np.argmin(gap))
        if not touched[which].any():
            yield which, node, False
            continue
        before, now = (_mean_normal(sea, which, r) for r in (start.r[near], state.r[touched[which]]))
        if before @ now < -OPPOSITE:
            yield which, node, True


def passed_obstacles(sea: Sea, start: Floats, end: Floats) -> Iterator[tuple[int, int]]:
    """Obstacles that a line has passed through on the straight way between two shapes outside of them; the node there.

    start, end: (N+1, 3) m.  A line that has slid off the end of an obstacle, or over its brim, may count as well.
    What a free body carries is left out: it has moved, too.
    """
    x = np.linspace(0.0, 1.0, PLACES, endpoint=False)[:, None, None]
    a, b = (((1.0 - x) * r[:-1] + x * r[1:]).transpose(1, 0, 2).reshape(-1, 3) for r in (start, end))
    thick, golden = half_thickness(sea.obstacles), 0.5 * (np.sqrt(5.0) - 1.0)
    rides = sea.carried[:, RIDES] if sea.carried.size else np.zeros(len(thick))
    for which, (row, *gaps) in enumerate(zip(sea.obstacles, distances(sea, a), distances(sea, b), strict=True)):
        if row[KIND] in (FLAT, TORUS) or rides[which] or min(x.min() for x in gaps) < -row[STRAND]:
            continue
        low, high = np.zeros((len(a), 1)), np.ones((len(a), 1))
        for _ in range(SECTIONS):  # the distance to what is convex is so along a straight way
            p, q = high - golden * (high - low), low + golden * (high - low)
            left = (distances(sea, a + p * (b - a)) < distances(sea, a + q * (b - a)))[which, :, None]
            low, high = np.where(left, low, p), np.where(left, q, high)
        least = distances(sea, a + 0.5 * (low + high) * (b - a))[which]
        if least.min() < -PASSED * thick[which]:
            yield which, int(least.argmin()) // PLACES


def _mean_normal(sea: Sea, which: int, r: Floats) -> Floats:
    """Mean (3,) of the outward normals of an obstacle at places r (n, 3) m, by differences of its distance."""
    step = NORMAL_STEP * max(float(sea.obstacles[which, RADIUS]), NORMAL_STEP)
    slopes = [distances(sea, r + step * axis)[which] - distances(sea, r - step * axis)[which] for axis in np.eye(3)]
    return np.asarray(np.mean(slopes, axis=1) / (2.0 * step))


def fold_text(line: Line, state: State, node: int) -> str:
    """How sharp the fold at a node is, and the cells that show a bend in its place."""
    turn = float(folds(line, state)[node])
    cell = RESOLVED * line.hn[node] / turn
    return f"{np.degrees(turn):.0f} deg from one cell to the next; cells of {cell:.2g} m would show the bend"


def slack_text(line: Line, state: State, scale: float) -> str:
    """How much of a catenary that is not all under tension is compressed, or slack; scale: its tension scale, N."""
    T, h, hardly = state.T[line.spin == 0], line.h[line.spin == 0], HARDLY * scale
    if T.min() < -hardly:
        return f"{h[T < 0.0].sum():.3g} m are compressed, by {-T.min():.3g} N at most"
    return f"{h[hardly > T].sum():.3g} m are slack, under less than {hardly:.2g} N: a catenary has no shape there"


def at_rest(x: JoinedLine) -> float:
    """Tension, N, that a catenary of a line has more of at rest."""
    return LEAST_TENSION * abs(x.floor) if np.isfinite(x.floor) else x.floor


def slack_cell(x: JoinedLine, state: State) -> int:
    """The cell of a catenary with the lowest tension where a line at rest is slack; -1: it is not."""
    tension, cell = lowest_tension(x.line, x.sea, state)
    return -1 if tension > at_rest(x) else int(cell)


def flaw_of_lines(lines: Sequence[JoinedLine], states: NetworkState) -> tuple[Outcome, int, int]:
    """The outcome (OK: there is none), the line, and its node or cell, as `flaw_of_line` finds them."""
    for k, (x, state) in enumerate(zip(lines, states.lines, strict=True)):
        outcome, where = flaw_of_line(x.line, x.sea, state, x.length, at_rest(x))
        if outcome == Outcome.OK and x.borne.size and (cell := overstretched_cell(x.line, state, x.borne)) >= 0:
            outcome, where = Outcome.OVERSTRETCHED, cell
        if outcome != Outcome.OK:
            return outcome, k, where
    return Outcome.OK, -1, -1


def buckling_line(lines: Sequence[JoinedLine], states: NetworkState, blurred: set[int]) -> int:
    """The first line that would buckle between what its ends are joined to, held where it is; -1: none.

    blurred: gets the numbers of lines of which round-off hides it.
    """
    for k, (x, state) in enumerate(zip(lines, states.lines, strict=True)):
        ends = x.ends._replace(held=np.minimum(x.ends.held, 1))
        if is_judged(x.line, ends, x.length):
            stability = Stability(x.line, x.sea, x.length, x.scale)
            if not stability.holds(ends, state):
                return k
            if stability.blurred:
                blurred.add(k)
    return -1
