"""Equilibria of lines that touch themselves: whether one does, and the damped motion with contact that leads to it."""

from __future__ import annotations

import math

import numpy as np

from hybrid.kernels.march.link import holds_twist, link_of
from hybrid.kernels.state.forces import SELF_CONTACT
from hybrid.kernels.state.state import Floats, State
from hybrid.model.build import Model
from hybrid.model.initial_shape import GIVEN
from hybrid.simulation.self_watch import deepest_text, diameters, least_bending
from hybrid.solve.contact_statics import contact_energy, settled
from hybrid.solve.self_contact import SelfContact
from hybrid.solve.statics import Equilibrium

# Parts of a straight way between two shapes, and by how much the Gauss integral of two lines jumps where one passes
# through the other: by 1, and by far less in a part of a way on which none does.
PARTS, JUMP = 48, 0.5
FLAT = 1e-9  # volume, over the lengths, of chords that lie in one plane but for round-off, as neighbours do
MOST_NODES = 300  # of a line that is looked at for whether it passes through itself
LINK, KEPT = 2, 1e-3  # place in what link_of gives; turns by which the link of a line between two clamps may change


def with_contact(model: Model, t: float, found: Equilibrium | None) -> Equilibrium | None:
    """The equilibrium with the loads of time t of a line that contact is asked for; None: there is none to be had.

    found: without contact, which is taken where nothing touches, unless the line would pass through itself on the
    straight way there from a shape that the scene gives; None: none was found.  A damped motion leads to rest from the
    starting shape, or, where that is within itself, from `found`; None comes back where both are.
    ComputationError: as of `settled_from`.
    """
    if not model.line.bits & SELF_CONTACT:
        return None
    contact = contact_of(model)
    sea, ends = model.sea.at(t), model.ends.at(t)
    energy = math.inf
    if found is not None:
        energy = contact_energy(model.line, sea, ends, found.state, contact)
        if energy == 0.0 and not passes_itself(model, found.state):
            return found
    if math.isfinite(contact_energy(model.line, sea, ends, model.start, contact)):
        return settled_from(model, t, model.start)
    return settled_from(model, t, found.state) if found is not None and math.isfinite(energy) else None


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


def settled_from(model: Model, t: float, start: State, near: bool = False) -> Equilibrium:
    """The equilibrium with contact, with the loads of time t, that a damped motion reaches from a start that is apart.

    near: that start is next to an equilibrium, which Newton's method with contact is asked for before anything moves.
    ComputationError: the motion does not come to rest, has lost turns, or ends with a catenary that is not taut.
    """
    asked = link(model, start)

    def keeps_turns(state: State) -> str:
        has = link(model, state)
        if abs(has - asked) < KEPT:
            return ""
        why = "it has gone around a clamp, or its cells are too long for its loops"
        return f"the starting shape has a link of {asked:.6g} turns, the line in contact {has:.6g}: {why}"

    scales = model.length, model.tension_scale, model.slack_floor
    sea, ends = model.sea.at(t), model.ends.at(t)
    return settled(model.line, sea, ends, start, scales, contact_of(model), keeps_turns, near)


def nearness(model: Model, t: float, state: State) -> Floats:
    """How near nodes (N+1,) of a line at rest are to other parts of it: above 1, nearer than two diameters."""
    contact = contact_of(model)
    near = contact.look_ahead(1.0)
    contact_energy(model.line, model.sea.at(t), model.ends.at(t), state, contact)
    return near


def within_itself(model: Model, t: float, state: State) -> str:
    """Where parts of a line at rest are in each other; empty: nowhere."""
    contact = contact_of(model)
    energy = contact_energy(model.line, model.sea.at(t), model.ends.at(t), state, contact)
    return deepest_text(contact, model) if math.isinf(energy) else ""


def why_not(model: Model, t: float) -> tuple[str, str]:
    """Why `with_contact` has nothing to give of a line that contact is asked for: what it takes, and what to do."""
    contact = contact_of(model)
    contact_energy(model.line, model.sea.at(t), model.ends.at(t), model.start, contact)
    where = deepest_text(contact, model)
    takes = f"a starting shape that is apart, for a damped motion with contact to lead to rest; in this one {where}"
    return takes, "another `initial_guess`, or `hybrid run` from a start that is apart"


def link(model: Model, state: State) -> float:
    """Link, in turns, of a line between ends that hold its twist; 0 where they do not."""
    line, ends = model.line, model.ends.values
    if not holds_twist(line):
        return 0.0
    return float(link_of(line, ends, state.r, state.e, state.a1, state.turn)[LINK])
