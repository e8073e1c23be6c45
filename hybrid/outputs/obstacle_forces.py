"""Forces of a line on obstacles, energy stored in them, and where those are that move, of a batch of outputs.

The law of kernels.laws.obstacles at the positions and velocities of outputs: without friction, and of obstacles that
move without damping, whose velocities outputs do not have.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hybrid.kernels.contact.self_contact_law import FIRST, INNER, LAST, OUTER, WITHIN
from hybrid.kernels.contact.self_contact_pairs import WINDOW, Contact
from hybrid.kernels.contact.self_distance import NEIGHBOURS
from hybrid.kernels.laws.obstacles import put_obstacles
from hybrid.kernels.state.report import DAMPING, FIXED, SEEN_FORCE, SEEN_MOMENT, SEEN_TURN
from hybrid.kernels.state.state import Floats
from hybrid.kernels.watch.observed_outputs import ON_OBSTACLE
from hybrid.model.bodies import angles_of
from hybrid.outputs.observation import Observation
from hybrid.store.format import Field

Integers = NDArray[np.int64]


def obstacle_force_fields(names: Sequence[str]) -> list[Field]:
    """What is recorded of each obstacle."""
    found = []
    for name in names:
        at, of = f"obstacles/{name}", f"obstacle {name}, without friction"
        text = f"resultant of the normal forces of the line on {of}"
        found.append(Field(f"{at}/normal_force", "N", text, (3,), ("xyz",), "inertial"))
        found.append(Field(f"{at}/contact_force", "N", f"sum of the normal forces of the line on {of}"))
        found.append(Field(f"{at}/contact", "N/m", f"largest normal force per length of the line on {of}"))
        found.append(Field(f"{at}/energy", "J", f"energy stored in the contact with obstacle {name}"))
    return found


def obstacle_force_values(names: Sequence[str], seen: Observation) -> dict[str, Floats]:
    """Their values (nb, ...)."""
    found: dict[str, Floats] = {}
    if not names:
        return found
    sea, moved, places = seen.sea, seen.line.moved, seen.batch.obstacles
    rows = sea.obstacles.copy()
    if moved.size:
        rows[moved != FIXED, DAMPING] = 0.0
    out = np.empty((seen.batch.t.size, len(names), ON_OBSTACLE))
    if not places.size:
        seen.press_obstacles(sea._replace(obstacles=rows), slice(None), out)
    for k in range(len(places) if places.size else 0):
        put_obstacles(rows, sea.carried, places[k])
        seen.press_obstacles(sea._replace(obstacles=rows), slice(k, k + 1), out)
    for k, name in enumerate(names):
        found[f"obstacles/{name}/normal_force"] = out[:, k, :3].copy()
        for at, key in enumerate(("contact_force", "contact", "energy")):
            found[f"obstacles/{name}/{key}"] = out[:, k, 3 + at].copy()
    return found


def obstacle_fields(names: Sequence[str]) -> list[Field]:
    """Place and rotation of all obstacles, force and moment on them."""
    texts = {
        "position": ("m", "place of obstacle {}"),
        "rotation": ("deg", "rotation of obstacle {} since t = 0: roll, pitch, yaw, about x, then y, then z"),
        "force": ("N", "force of the line on obstacle {}"),
        "moment": ("N m", "moment of the line on obstacle {} about its place"),
    }
    return [
        Field(f"obstacles/{name}/{key}", unit, text.format(name), (3,), ("xyz",), "inertial")
        for name in names
        for key, (unit, text) in texts.items()
    ]


def obstacle_values(names: Sequence[str], seen: Floats) -> dict[str, Floats]:
    """Their values (nb, 3); seen: (nb, M, SEEN) of kernels.state.report."""
    found = {}
    for k, name in enumerate(names):
        x = seen[:, k]
        turned = x[:, SEEN_TURN:SEEN_FORCE].reshape(-1, 3, 3)
        found[f"obstacles/{name}/position"] = x[:, :SEEN_TURN].copy()
        found[f"obstacles/{name}/rotation"] = angles_of(turned)
        found[f"obstacles/{name}/force"] = x[:, SEEN_FORCE:SEEN_MOMENT].copy()
        found[f"obstacles/{name}/moment"] = x[:, SEEN_MOMENT:].copy()
    return found


# What two lines that touch press on each other with, and a line on itself: of one output of all of them.
#
# A run has the force per length of all contact at every node, with the size that its law has there
# (kernels.contact.self_contact_pairs).  Here the same points of contact are found at the positions of an output, with a
# law of size 1, and their forces scaled so that those of all partners add up to what nodes bear.  Friction is not in
# it.

# Points up to so many diameters apart, beyond where the law begins, count by FAINT of it: within a step positions and
# forces lie on different curves, and what a node bears may have no point at which strands touch.
BEYOND, FAINT = 1.15, 1e-6
HALVINGS = 45  # of a piece, to find the foot of a point on it
KEYS = ("force", "contact_force", "contact")


class Lines(NamedTuple):
    """Lines that may touch, their nodes one behind the other."""

    contact: Contact
    s: Floats  # (N+1,) m, of all nodes, as kernels.contact has them

    @property
    def lengths(self) -> Floats:
        """(N+1,) m that the force of a node lies on."""
        kind, s = self.contact.kind, self.s
        nodes = np.arange(s.size)
        return 0.5 * (s[nodes + (kind != LAST)] - s[nodes - (kind != FIRST)])


class Points(NamedTuple):
    """Points of contact: pieces p and q, weights of their nodes, direction of the force on p, its size."""

    p: Integers
    q: Integers
    wp: Floats  # (n, 3)
    wq: Floats  # (n, 3)
    normal: Floats  # (n, 3)
    force: Floats  # (n,)


def pair_fields(pairs: list[tuple[str, str]]) -> list[Field]:
    """What is recorded of pairs of lines, and of lines with themselves, by their names."""
    found = []
    for a, b in pairs:
        at, of = f"contacts/{a}/{b}", f"line {b} on line {a}" if a != b else f"line {a} on itself"
        if a != b:
            text = f"resultant of the forces of {of}, without friction"
            found.append(Field(f"{at}/force", "N", text, (3,), ("xyz",), "inertial"))
        found.append(Field(f"{at}/contact_force", "N", f"sum of the forces of {of} at all places, without friction"))
        found.append(Field(f"{at}/contact", "N/m", f"largest force per length of {of}, without friction"))
    return found


def pair_forces(lines: Lines, r: Floats, touch: Floats) -> dict[tuple[int, int], tuple[Floats, float, float]]:
    """By numbers of two lines, a <= b: resultant (3,) N on a, sum N, largest force per length N/m; of those that touch.

    r: (N+1, 3) m; touch: (N+1,) N/m, of all contact, at the nodes.
    """
    of, lengths, points = lines.contact.of, lines.lengths, points_of(lines, r, touch)
    if not points.p.size:
        return {}
    at = np.concatenate([points.p[:, None] + (-1, 0, 1), points.q[:, None] + (-1, 0, 1)], axis=1)  # (n, 6) nodes
    weights = np.concatenate([points.wp, points.wq], axis=1)
    whole = np.bincount(at.ravel(), (weights * points.force[:, None]).ravel(), of.size)
    share = np.divide(touch * lengths, whole, out=np.zeros(of.size), where=whole > 0.0)
    force = points.force * 0.5 * (weights * share[at]).sum(axis=1)
    a, b = np.minimum(of[points.p], of[points.q]), np.maximum(of[points.p], of[points.q])
    sign, found = np.where(of[points.p] == a, 1.0, -1.0), {}
    for pair in sorted(set(zip(a.tolist(), b.tolist(), strict=True))):
        mine = (a == pair[0]) & (b == pair[1])
        nodes = np.bincount(at[mine].ravel(), (weights[mine] * force[mine, None]).ravel(), of.size)
        resultant = ((sign * force)[mine, None] * points.normal[mine]).sum(axis=0) * (pair[0] != pair[1])
        found[pair] = resultant, float(force[mine].sum()), float((nodes / lengths).max())
    return found


def points_of(lines: Lines, r: Floats, touch: Floats) -> Points:
    """Points of contact of pieces whose nodes bear a force, as kernels.contact finds them, with a law of 1 N."""
    contact = lines.contact
    kind, samples, width = contact.kind, contact.samples, contact.width
    bears = touch > 0.0
    pieces = 1 + np.flatnonzero((kind[1:-1] == WITHIN) & bears[:-2] & bears[1:-1] & bears[2:])
    sample = np.repeat(pieces, samples[pieces])
    first = np.repeat(np.cumsum(samples[pieces]) - samples[pieces], samples[pieces])
    u = (np.arange(sample.size) - first + 0.5) / samples[sample]
    wp = _weights(kind, sample, u)
    x = np.einsum("nj,njk->nk", wp, r[sample[:, None] + (-1, 0, 1)])
    size = np.maximum(*(np.linalg.norm(r[pieces + j] - r[pieces], axis=1) for j in (-1, 1)))
    reach = size + BEYOND * 0.5 * (width[pieces] + width.max())
    which, to = _near(x, r[pieces], reach)
    may = _may_touch(lines, sample[which], pieces[to])
    which, q = which[may], pieces[to[may]]
    p, x, u, wp = sample[which], x[which], u[which], wp[which]
    v, within = _feet(kind, r, q, x)
    wq = _weights(kind, q, v)
    away = x - np.einsum("nj,njk->nk", wq, r[q[:, None] + (-1, 0, 1)])
    d, wide = np.linalg.norm(away, axis=1), 0.5 * (width[p] + width[q])
    near = within & (d < BEYOND * wide)
    a, b = _end_factors(kind, p)
    h = np.diff(lines.s)
    length = 0.5 * ((1.0 - u) * a * h[p - 1] + u * b * h[p]) / samples[p]
    force = length * _push(d, wide)
    return Points(p[near], q[near], wp[near], wq[near], (away / d[:, None])[near], force[near])


def _near(x: Floats, middles: Floats, reach: Floats) -> tuple[Integers, Integers]:
    """Numbers of points x (n, 3) and of middles (m, 3) of pieces that are within reach (m,) of each other, m."""
    from scipy.spatial import cKDTree

    if not len(middles):
        return np.zeros(0, np.int64), np.zeros(0, np.int64)
    found = cKDTree(middles).query_ball_point(x, float(reach.max()), return_sorted=True)
    which = np.repeat(np.arange(len(x)), [len(each) for each in found])
    to = np.concatenate([np.asarray(each, np.int64) for each in found])
    near = np.linalg.norm(x[which] - middles[to], axis=1) < reach[to]
    return which[near], to[near]


def _end_factors(kind: Integers, p: Integers) -> tuple[Floats, Floats]:
    return np.where(kind[p - 1] == FIRST, 2.0, 1.0), np.where(kind[p + 1] == LAST, 2.0, 1.0)


def _weights(kind: Integers, p: Integers, u: Floats) -> Floats:
    """Weights (n, 3) of the nodes of pieces p at u."""
    a, b = _end_factors(kind, p)
    before, after = 0.5 * a * (1.0 - u) ** 2, 0.5 * b * u**2
    return np.stack([before, 1.0 - before - after, after], axis=1)


def _may_touch(lines: Lines, p: Integers, q: Integers) -> NDArray[np.bool_]:
    """Whether pieces are no neighbours, along a line or where lines are joined, and their lines touch."""
    contact, s = lines.contact, lines.s
    a, b, window = contact.of[p], contact.of[q], WINDOW * 0.5 * (contact.width[p] + contact.width[q])
    found = (contact.meets[a, b] != 0) & ((a != b) | ((np.abs(p - q) > NEIGHBOURS) & (np.abs(s[p] - s[q]) > window)))
    for j in (0, 1):
        for k in (0, 1):
            m, n = contact.tips[a, j], contact.tips[b, k]
            joined = (contact.joined[a, j] >= 0) & (contact.joined[a, j] == contact.joined[b, k])
            joined &= (a != b) | (j != k)  # the way along a line goes from one end to the other
            way, between = np.abs(s[p] - s[m]) + np.abs(s[q] - s[n]), np.abs(p - m) + np.abs(q - n)
            found &= ~(joined & ~((between > NEIGHBOURS) & (way > window)))
    return found


def _feet(kind: Integers, r: Floats, q: Integers, x: Floats) -> tuple[Floats, NDArray[np.bool_]]:
    """Where points x (n, 3) are nearest to pieces q, and whether that is no end of one from which the line goes on."""
    a, b = _end_factors(kind, q)
    before, after = a[:, None] * (r[q] - r[q - 1]), b[:, None] * (r[q + 1] - r[q])
    first, bend = r[q] - 0.5 * before - x, after - before

    def slope(v: Floats) -> Floats:
        """Half the derivative of the squared distance."""
        away, along = first + v[:, None] * before + 0.5 * v[:, None] ** 2 * bend, before + v[:, None] * bend
        return np.einsum("nk,nk->n", away, along)

    low, high = np.zeros(len(q)), np.ones(len(q))
    begins, ends = slope(low) >= 0.0, slope(high) < 0.0
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        below = slope(middle) < 0.0
        low, high = np.where(below, middle, low), np.where(below, high, middle)
    v = np.where(begins, 0.0, np.where(ends, 1.0, 0.5 * (low + high)))
    return v, ~((begins & (kind[q - 1] == WITHIN)) | (~begins & ends & (kind[q + 1] == WITHIN)))


def _push(d: Floats, width: Floats) -> Floats:
    """Force per length, of a law of the size 1 N, at distances d (m) of strands of a mean diameter (m)."""
    inverse = 1.0 / ((OUTER - INNER) * width)
    x = np.maximum((d - INNER * width) * inverse, FAINT)
    y = np.minimum(x - 1.0, 0.0)
    return np.asarray(inverse * (2.0 * y * np.log(x) + y * y / x + FAINT * np.maximum(BEYOND - d / width, 0.0)))
