"""Where motion opens, closes or slides what touches at rest, so that a response that is linear does not hold."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from hybrid.kernels.contact.self_contact_law import OUTER
from hybrid.kernels.contact.self_contact_pairs import WINDOW
from hybrid.kernels.state.state import Floats
from hybrid.linear.response_results import LineResponse
from hybrid.linear.rest import Rest
from hybrid.linear.touching import Touch
from hybrid.simulation.self_watch import diameters

# Part of the force of a contact that is borne where it opens, or slides, within two standard deviations, beyond which
# it is told; of the length, how much may come to lie on what is touched already.
OPENS, LIFTS = 0.25, 0.02
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
            yield (
                f"contact of {name} slides where {100.0 * share:.0f} % of its force are borne, and sticks here; "
                "without friction (--smooth) it slides freely, hybrid run has both"
            )


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
        if closes.any() and not (touch and length <= LIFTS * float(one.s[-1])):
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
