"""Equilibria of lines that touch themselves: whether one does, and the damped motion with contact that leads to it."""

from __future__ import annotations

import math

from hybrid.kernels.forces import SELF_CONTACT
from hybrid.kernels.link import holds_twist, link_of
from hybrid.kernels.state import State
from hybrid.model.build import Model
from hybrid.simulation.self_watch import deepest_text, diameters, least_bending
from hybrid.solve.contact_statics import contact_energy, settled
from hybrid.solve.self_contact import SelfContact
from hybrid.solve.statics import Equilibrium

LINK, KEPT = 2, 1e-3  # place in what link_of gives; turns by which the link of a line between two clamps may change


def with_contact(model: Model, t: float, found: Equilibrium | None) -> Equilibrium | None:
    """The equilibrium with the loads of time t of a line that contact is asked for; None: there is none to be had.

    found: without contact, which is taken where nothing touches; None: none was found.  None comes back for zones, and
    where the starting shape, from which a damped motion leads to rest, is within itself.  ComputationError: that
    motion does not come to rest, or has lost turns.
    """
    if not model.line.bits & SELF_CONTACT or model.layout is not None or not model.line.spin.all():
        return None
    contact = SelfContact(model.line, diameters(model), least_bending(model), model.tension_scale)
    sea, ends = model.sea.at(t), model.ends.at(t)
    if found is not None and contact_energy(model.line, sea, ends, found.state, contact) == 0.0:
        return found
    if not math.isfinite(contact_energy(model.line, sea, ends, model.start, contact)):
        return None
    asked = link(model, model.start)

    def keeps_turns(state: State) -> str:
        has = link(model, state)
        if abs(has - asked) < KEPT:
            return ""
        why = "it has gone around a clamp, or its cells are too long for its loops"
        return f"the starting shape has a link of {asked:.6g} turns, the line in contact {has:.6g}: {why}"

    return settled(model.line, sea, ends, model.start, model.length, model.tension_scale, contact, keeps_turns)


def why_not(model: Model, t: float) -> tuple[str, str]:
    """Why `with_contact` has nothing to give of a line that contact is asked for: what it takes, and what to do."""
    if model.layout is not None or not model.line.spin.all():
        takes = "a line of rods: statics make no damped motion with contact of a line with catenary zones"
        return takes, "`model: rod`, or `hybrid run` from a start that is apart"
    contact = SelfContact(model.line, diameters(model), least_bending(model), model.tension_scale)
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
