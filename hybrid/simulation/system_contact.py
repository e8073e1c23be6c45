"""Lines of a system that touch themselves: what their equilibrium must be like, which knows no contact."""

from __future__ import annotations

import math
from collections.abc import Iterable

from hybrid.errors import Complaint, SceneError
from hybrid.kernels.forces import SELF_CONTACT
from hybrid.kernels.state import State
from hybrid.simulation.self_watch import deepest_text, diameters, least_bending
from hybrid.simulation.system_lines import LineResult
from hybrid.solve.contact_statics import contact_energy
from hybrid.solve.self_contact import SelfContact
from hybrid.solve.system import JoinedLine


def refuse_within_itself(lines: Iterable[tuple[LineResult, JoinedLine, State]], moves: bool) -> None:
    """SceneError: a line for which contact is asked is within itself in the equilibrium of the system.

    moves: whether a motion begins there, which may begin in contact; an equilibrium alone must be apart.
    """
    for line, x, state in lines:
        model = line.model
        if not model.line.bits & SELF_CONTACT:
            continue
        contact = SelfContact(model.line, diameters(model), least_bending(model), model.tension_scale)
        energy = contact_energy(x.line, x.sea, x.ends, state, contact)
        if energy == 0.0 or (moves and math.isfinite(energy)):
            continue
        given = f"self: true, and in the equilibrium, which is found without contact, {deepest_text(contact, model)}"
        if moves:
            expected = "an equilibrium in which the line is not within itself, for a motion with contact to begin from"
            fix = "points or lengths with which it is apart, a smaller diameter, or leave contact out"
        else:
            expected = "an equilibrium in which the line is apart: of several lines none is found in contact"
            fix = "`hybrid run` from points with which it is apart, with damping, or leave contact out"
        raise SceneError([Complaint(f"lines.{line.name}.contact", given, expected, fix)])
