"""Equilibria of lines that touch themselves: whether one does, and the damped motion with contact that leads to it."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np

from hybrid.errors import Complaint, ComputationError, SceneError
from hybrid.kernels.junctions.carried_frames import TURNS
from hybrid.kernels.laws.obstacles import cells_met, depths_in_obstacles
from hybrid.kernels.march.link import LINK, holds_twist, link_of
from hybrid.kernels.state.report import OBSTACLES, SELF_CONTACT
from hybrid.kernels.state.state import Floats, State
from hybrid.model.build import Model
from hybrid.model.initial_shape import GIVEN
from hybrid.model.self_reach import touching
from hybrid.simulation.self_watch import diameters, least_bending
from hybrid.solve.contact_statics import settled_system
from hybrid.solve.joined import JoinedLine, LineFailed, NetworkState
from hybrid.solve.network_solver import NO_BODIES
from hybrid.solve.self_contact import SelfContact
from hybrid.solve.statics import Equilibrium

# Parts of a straight way between two shapes, and by how much the Gauss integral of two lines jumps where one passes
# through the other: by 1, and by far less in a part of a way on which none does.
PARTS, JUMP = 48, 0.5
FLAT = 1e-9  # volume, over the lengths, of chords that lie in one plane but for round-off, as neighbours do
MOST_NODES = 300  # of a line that is looked at for whether it passes through itself
KEPT = 1e-3  # turns by which the link of a line between two clamps may change


def gauss_integral(a: Floats, b: Floats) -> float:
    """Gauss integral of two polylines (n, 3) m and (m, 3) m: half the sum of their signed crossings over all views."""
    p, q = a[:-1, None], a[1:, None]
    r, s = b[None, :-1], b[None, 1:]
    pr, ps, qr, qs = (y - x for x, y in ((p, r), (p, s), (q, r), (q, s)))
    normals = [np.cross(x, y) for x, y in ((pr, ps), (ps, qs), (qs, qr), (qr, pr))]
    n = [x / np.maximum(np.linalg.norm(x, axis=-1, keepdims=True), 1e-300) for x in normals]
    angles = [np.arcsin(np.clip(np.einsum("ijk,ijk->ij", n[i], n[(i + 1) % 4]), -1.0, 1.0)) for i in range(4)]
    volume = np.einsum("ijk,ijk->ij", np.cross(s - r, q - p), pr)
    largest = np.prod([np.linalg.norm(x, axis=-1) for x in np.broadcast_arrays(s - r, q - p, pr)], axis=0)
    side = np.where(np.abs(volume) > FLAT * largest, np.sign(volume), 0.0)
    return float((side * sum(angles)).sum() / (4.0 * math.pi))


def jumps(a: Floats, b: Floats) -> float:
    """Largest jump of the Gauss integral of two polylines (2, n, 3) and (2, m, 3) m, first and last, on the straight

    way between these.
    """
    parts = np.linspace(0.0, 1.0, PARTS + 1)
    found = [gauss_integral((1.0 - x) * a[0] + x * a[1], (1.0 - x) * b[0] + x * b[1]) for x in parts]
    return float(np.abs(np.diff(found)).max())


def passes_itself(model: Model, state: State) -> bool:
    """Whether a line whose first shape the scene gives would pass through itself on the straight way from there.

    Where it does not, no knot or loop of that shape is lost in the state.  Where it does, one may be, or not.
    """
    if model.start_shape != GIVEN:
        return False
    kept = np.unique(np.linspace(0, model.cells, min(model.cells, MOST_NODES) + 1).round().astype(int))
    way = np.stack([model.start.r[kept], state.r[kept]])
    return jumps(way, way) > 2.0 * JUMP  # every pair of places counts twice


def contact_of(model: Model) -> SelfContact:
    """Contact without friction of the line of a model with itself."""
    return SelfContact(model.line, diameters(model), least_bending(model), model.tension_scale)


def nearness(model: Model, t: float, state: State) -> Floats:
    """How near nodes (N+1,) of a line at rest are to other parts of it: above 1, nearer than two diameters."""
    contact = contact_of(model)
    near = contact.look_ahead(1.0)
    contact.energy_of(model.line, model.ends.at(t), state)
    return near


def settled_from(model: Model, t: float, start: State, near: bool = False) -> Equilibrium:
    """The equilibrium with contact of one line that a damped motion reaches from a start that is apart.

    t: s, of its loads; near: that start is next to an equilibrium, which Newton's method with contact is asked for
    before anything moves.  ComputationError: the motion does not come to rest, has lost turns, or ends with a catenary
    that is not taut.
    """
    line = touching(model.line, 0.0)
    scales = model.length, model.tension_scale, model.slack_floor
    x, first = JoinedLine(line, model.sea.at(t), model.ends.at(t), *scales, (-1, -1)), NetworkState([start])
    keeps = keeps_turns([x], first, KEPT)
    try:
        found = settled_system([x], 0, NO_BODIES, first, lambda: ([contact_of(model)], None), keeps, near)
    except LineFailed as failed:
        raise ComputationError(failed.outcome, None, failed.s, failed.detail) from None
    how = found.path, found.iterations, found.residual
    return Equilibrium(found.state.lines[0], *how, False, touches=True, unjudged=found.unjudged)


def is_apart(model: Model, t: float, state: State) -> bool:
    """Whether no part of a line at rest is in another one."""
    return math.isfinite(contact_of(model).energy_of(model.line, model.ends.at(t), state))


def keeps_turns(
    lines: Sequence[JoinedLine], start: NetworkState, within: float
) -> Callable[[NetworkState], tuple[int, str]]:
    """What tells of the first line whose link in a state is not that of the start."""
    asked = {k: _link(x, start.lines[k]) for k, x in enumerate(lines) if _holds_turns(x)}

    def lost(states: NetworkState) -> tuple[int, str]:
        for k, link in asked.items():
            has = _link(lines[k], states.lines[k])
            if abs(has - link) > within:
                why = "it has gone around a clamp, or its cells are too long for its loops"
                return k, f"the start has a link of {link:.6g} turns, the line in contact {has:.6g}: {why}"
        return -1, ""

    return lost


def _holds_turns(x: JoinedLine) -> bool:
    """Whether the turns of a line cannot change: contact is asked for, and what holds its twist does not turn."""
    return bool(x.line.bits & SELF_CONTACT) and holds_twist(x.line) and not x.seats[:, TURNS].any()


def _link(x: JoinedLine, state: State) -> float:
    return float(link_of(x.line, x.ends, state.r, state.e, state.a1, state.turn)[LINK])


def refuse_start_in_obstacles(model: Model, state: State, key: str = "initial") -> None:
    """SceneError: a line that begins where the scene has it is deep in an obstacle; key: of its start."""
    line, sea = model.line, model.sea.at(0.0)
    if not line.bits & OBSTACLES:
        return
    met = cells_met(sea.carried, line.s) if sea.carried.size else None
    within = depths_in_obstacles(sea, state.r, line.s, met)
    which, node = (int(x) for x in np.unravel_index(np.argmax(within), within.shape))
    if within[which, node] > 1.0:
        given = f"a shape that is in obstacle {model.sea.names[which]} at s = {line.s[node]:.6g} m"
        raise SceneError([Complaint(key, given, "a start outside of obstacles", "move it, or the obstacle")])
