"""Forces of a line on obstacles, energy stored in them, and where those are that move, of a batch of outputs.

The law of kernels.laws.obstacles at the positions and velocities of outputs: without friction, and of obstacles that
move without damping, whose velocities outputs do not have.  Arrays lie along the nodes of all outputs, one line behind
the other, with a cell of no length between two.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hybrid.kernels.laws.obstacles import cells_met, distances, put_obstacles, thinner_cells
from hybrid.kernels.laws.seabed import G1, G2
from hybrid.kernels.state.obstacle_rows import (
    DAMPING,
    FIXED,
    ONSET_OF,
    SEEN_FORCE,
    SEEN_MOMENT,
    SEEN_TURN,
    STIFFNESS,
    STRAND,
)
from hybrid.kernels.state.state import Floats, Sea
from hybrid.model.bodies import angles_of
from hybrid.outputs.joined_lines import JoinedObservation
from hybrid.outputs.observation import Observation
from hybrid.store.format import Field

# Of the radius of the strand: by which a place is shifted for the normal, whose error goes by the square of it.
SHIFT = 1e-4
Integers = NDArray[np.int64]


class Nodes(NamedTuple):
    """Nodes (n,) of nb outputs one behind the other, and the cells (n-1,) between them."""

    r: Floats  # (n, 3) m
    v: Floats  # (n, 3) m/s
    s: Floats  # (n,) m
    h: Floats  # (n-1,) m; 0 between two outputs
    begin: Integers  # (nb+1,) nodes before each output

    def of(self, nodes: Integers) -> Integers:
        """The outputs that nodes are of."""
        return np.searchsorted(self.begin, nodes, "right") - 1


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
    nodes, sea, moves = nodes_of(seen), seen.sea, bool(seen.line.moved.size)
    depth = 0.5 * sea.obstacles[:, ONSET_OF, None] - _distances(sea, nodes, seen.batch.obstacles)
    thin = thinner_cells(sea.obstacles, nodes.s)
    met = cells_met(sea.carried, nodes.s) if moves else np.ones((len(names), nodes.h.size))
    for k, name in enumerate(names):
        here = (met[k] > 0.0) & (nodes.h > 0.0) & (np.maximum(depth[k, :-1], depth[k, 1:]) > thin)
        damping = 0.0 if moves and seen.line.moved[k] != FIXED else float(sea.obstacles[k, DAMPING])
        values = _pressed(sea, k, damping, nodes, seen.batch.obstacles, (depth[k], thin), np.flatnonzero(here))
        keys = ("normal_force", "contact_force", "contact", "energy")
        found |= {f"obstacles/{name}/{key}": x for key, x in zip(keys, values, strict=True)}
    return found


def nodes_of(seen: Observation) -> Nodes:
    """The nodes of all outputs of a batch."""
    batch = seen.batch
    if isinstance(seen, JoinedObservation):
        return Nodes(batch.r[0], batch.v[0], seen.line.s, seen.line.h, seen.begin)
    nb, count, _ = batch.r.shape
    s = np.broadcast_to(seen.of_line("s", slice(None)).T, (nb, count))
    h = np.pad(np.broadcast_to(seen.cell_lengths.T, (nb, count - 1)), ((0, 0), (0, 1)))
    begin = count * np.arange(nb + 1)
    return Nodes(batch.r.reshape(-1, 3), batch.v.reshape(-1, 3), s.ravel(), h.ravel()[:-1], begin)


def _seas(sea: Sea, seen: Floats) -> list[Sea]:
    """The sea with obstacles where they are in each output; seen: (nb, M, SEEN), or empty: none moves, one for all."""
    if not seen.size:
        return [sea]
    found = []
    for each in seen:
        rows = sea.obstacles.copy()
        put_obstacles(rows, sea.carried, each)
        found.append(sea._replace(obstacles=rows))
    return found


def _distances(sea: Sea, nodes: Nodes, seen: Floats) -> Floats:
    """Distances (M, n) m of nodes to the surfaces, moved out by the radius of the strand."""
    seas = _seas(sea, seen)
    if len(seas) == 1:
        return distances(seas[0], nodes.r)
    parts = zip(seas, np.split(nodes.r, nodes.begin[1:-1]), strict=True)
    return np.concatenate([distances(each, r) for each, r in parts], axis=1)


def _pressed(
    sea: Sea, k: int, damping: float, nodes: Nodes, seen: Floats, depths: tuple[Floats, Floats], cells: Integers
) -> tuple[Floats, Floats, Floats, Floats]:
    """Resultant (nb, 3) N, sum (nb,) N, largest force per length (nb,) N/m, energy (nb,) J of what cells press on k.

    damping: N s/m per m; depths: (n,) m of nodes below where contact begins, (n-1,) m by which cells are thinner.
    """
    nb, count, (depth, thin) = len(nodes.begin) - 1, len(nodes.r), depths
    if not cells.size:
        return np.zeros((nb, 3)), np.zeros(nb), np.zeros(nb), np.zeros(nb)
    law = float(sea.obstacles[k, STIFFNESS]), damping, float(sea.obstacles[k, ONSET_OF])
    which = np.unique(np.concatenate([cells, cells + 1]))
    normal, rate = np.zeros((count, 3)), np.zeros(count)
    normal[which] = _normals(sea, k, nodes, seen, which)
    rate[which] = -np.einsum("ni,ni->n", normal[which], nodes.v[which])
    p0, p1, v0, v1 = depth[cells] - thin[cells], depth[cells + 1] - thin[cells], rate[cells], rate[cells + 1]
    before, after, energy = half_cells(p0, p1, v0, v1, nodes.h[cells], law)
    force = _sums(cells, before, count) + _sums(cells + 1, after, count)
    of, force = nodes.of(which), force[which]
    length = np.append(nodes.h, 0.0)[which] + np.append(0.0, nodes.h)[which]
    most = np.zeros(nb)
    np.maximum.at(most, of, 2.0 * force / length)
    whole = np.stack([_sums(of, -force * normal[which, j], nb) for j in range(3)], axis=1)
    return whole, _sums(of, force, nb), most, _sums(nodes.of(cells), energy, nb)


def _sums(places: Integers, values: Floats, count: int) -> Floats:
    """Sums (count,) of values by their places."""
    return np.asarray(np.bincount(places, values, count), float)


def _normals(sea: Sea, k: int, nodes: Nodes, seen: Floats, which: Integers) -> Floats:
    """Outward normals (m, 3) of obstacle k at nodes: differences of its distance."""
    step = SHIFT * sea.obstacles[k, STRAND]
    shifts = step * np.concatenate([np.eye(3), -np.eye(3)])
    points = (nodes.r[which] + shifts[:, None]).reshape(-1, 3)
    seas, of = _seas(sea, seen), nodes.of(which)
    found = np.empty(len(points))
    for j, each in enumerate(seas):
        mine = np.tile(of == j, 6) if len(seas) > 1 else np.ones(len(points), bool)
        if mine.any():
            found[mine] = distances(each, points[mine])[k]
    x = found.reshape(6, -1)
    n = np.stack([x[j] - x[3 + j] for j in range(3)], axis=1) / (2.0 * step)
    return np.asarray(n / np.linalg.norm(n, axis=1, keepdims=True))


def half_cells(
    p0: Floats, p1: Floats, v0: Floats, v1: Floats, h: Floats, law: tuple[float, float, float]
) -> tuple[Floats, Floats, Floats]:
    """Forces (n,) N on both nodes of cells, and the energy (n,) J that these store: kernels.laws.seabed, of many.

    p0, p1: m, penetration at the nodes; v0, v1: m/s, its rates; h: m; law: stiffness N/m per m, damping, onset m.
    """
    k, c, o = law
    dp = np.where(p1 == p0, 1.0, p1 - p0)
    edges = np.sort(np.clip([np.where(p1 == p0, 1.0, (x - p0) / dp) for x in (0.0, o)], 0.0, 1.0), axis=0)
    ends = [np.zeros_like(p0), edges[0], edges[1], np.ones_like(p0)]
    first, second, energy = (np.zeros_like(p0) for _ in range(3))
    for a, b in pairwise(ends):
        middle = p0 + 0.5 * (a + b) * (p1 - p0)
        slope, shift = np.where(middle < o, 0.5, 1.0), np.where(middle < o, 0.0, 0.5 * o)
        fa, fb = (k * (slope * (p0 + x * (p1 - p0)) - shift) + c * (v0 + x * (v1 - v0)) for x in (a, b))
        cut = np.where(fa * fb < 0.0, a - fa / np.where(fa == fb, 1.0, fb - fa) * (b - a), b)  # damping lets go
        for x0, x1 in ((a, cut), (cut, b)):
            for g in (G1, G2):
                x, w = x0 + g * (x1 - x0), 0.5 * h * (x1 - x0)
                p, v = p0 + x * (p1 - p0), v0 + x * (v1 - v0)
                q = np.where(p < o, (0.5 * k * p + c * v) * p / o, k * (p - 0.5 * o) + c * v)
                q = np.where(p > 0.0, np.maximum(q, 0.0), 0.0)
                first += w * (1.0 - x) * q
                second += w * x * q
        for g in (G1, G2):
            p, w = p0 + (a + g * (b - a)) * (p1 - p0), 0.5 * h * (b - a)
            stored = np.where(p < o, p * p * p / (6.0 * o), 0.5 * p * (p - o) + o * o / 6.0)
            energy += w * k * np.where(p > 0.0, stored, 0.0)
    return first, second, energy


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
    """Their values (nb, 3); seen: (nb, M, SEEN) of kernels.state.obstacle_rows."""
    found = {}
    for k, name in enumerate(names):
        x = seen[:, k]
        turned = x[:, SEEN_TURN:SEEN_FORCE].reshape(-1, 3, 3)
        found[f"obstacles/{name}/position"] = x[:, :SEEN_TURN].copy()
        found[f"obstacles/{name}/rotation"] = angles_of(turned)
        found[f"obstacles/{name}/force"] = x[:, SEEN_FORCE:SEEN_MOMENT].copy()
        found[f"obstacles/{name}/moment"] = x[:, SEEN_MOMENT:].copy()
    return found
