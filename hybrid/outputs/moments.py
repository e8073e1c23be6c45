"""Tangents and torques at the nodes of an observation, where moments are known."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from hybrid.kernels.march.zone_torque import TORQUE
from hybrid.kernels.state.state import Floats
from hybrid.outputs.vectors import dot, size

if TYPE_CHECKING:
    from hybrid.outputs.observation import Observation


def node_tangents(view: Observation) -> Floats:
    """(N+1, 3, nb), halfway between the cells; at an end that of its holder, or of its cell where none holds it."""
    d = view.d
    t = np.concatenate([d[:1], d[1:] + d[:-1], d[-1:]])
    for k in (0, 1):
        held = np.asarray(view.has_element(k))
        view.put_at_end(t, k, np.where(held, view.batch.frame[:, k, 2::3].T, view.at_end(d, k)))
    return np.asarray(t / np.maximum(size(t), 1e-12)[:, None])


def node_torques(view: Observation) -> Floats:
    """(N+1, nb) N m: of the twist of elements; at ends of the moment there."""
    line, nodes = view.line, slice(None)
    strain = view.element_strains[:, 2] - view.of_line("k0", nodes)[:, 2]
    if line.tension_twist.size:
        by_tension = view.of_line("tension_twist", nodes) * view.T
        strain = strain + np.pad(by_tension, ((0, 1), (0, 0))) + np.pad(by_tension, ((1, 0), (0, 0)))
    torque = np.where(line.element[:, None], view.stiffness(nodes)[:, 2] * strain, 0.0)
    for k in (0, 1):
        moment, tangent = view.at_end(view.node_moment, k), view.at_end(view.node_tangent, k)
        view.put_at_end(torque, k, (moment * tangent).sum(axis=0))
    return torque


def passed_torques(view: Observation) -> Floats:
    """Torque (n sides, nb) N m that catenary zones pass on, on their nodes and the joints of rods beside them."""
    out = np.zeros((len(view.grid.side_nodes), view.batch.t.size))
    for z, (first, last) in enumerate(view.line.torsion[:, :2].astype(int)):
        for a, b, o in view.grid.spans:
            low, high = max(a, first), min(b, last)
            if low <= high:
                out[o + low - a : o + high - a + 1] = view.batch.turn[:, z, TORQUE]
    return out


def across(moment: Floats, tangent: Floats) -> Floats:
    """Of moments (n, 3, nb) N m what bends: the part across the tangent."""
    return np.asarray(moment - dot(moment, tangent)[:, None] * tangent)
