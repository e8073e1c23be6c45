"""Lines of a system that touch themselves: what their equilibrium must be like."""

from __future__ import annotations

import math

from hybrid.errors import Complaint, SceneError
from hybrid.kernels.forces import SELF_CONTACT
from hybrid.model.system import SystemModel
from hybrid.simulation.contact_equilibrium import contact_of
from hybrid.simulation.self_watch import deepest_text
from hybrid.solve.contact_statics import contact_energy
from hybrid.solve.system_statics import SystemEquilibrium


def refuse_within_itself(system: SystemModel, found: SystemEquilibrium, moves: bool) -> None:
    """SceneError: a line for which contact is asked is within itself in the equilibrium without contact of the system,

    and so in every start from which a damped motion with contact could lead to another one.
    moves: whether a motion begins there, which may begin in contact; an equilibrium alone must be apart.
    """
    if found.settled:
        return
    for name, model, x, state in zip(system.names, system.models, found.solver.lines, found.state.lines, strict=True):
        if not model.line.bits & SELF_CONTACT:
            continue
        contact = contact_of(model)
        energy = contact_energy(x.line, x.sea, x.ends, state, contact)
        if energy == 0.0 or (moves and math.isfinite(energy)):
            continue
        given = f"self: true, and in the equilibrium, which is found without contact, {deepest_text(contact, model)}"
        expected = "a first shape in which the line is apart, for a damped motion with contact to lead to rest"
        fix = f"lines.{name}.initial: {{points: [...]}}, such as a wide U, a smaller diameter, or leave contact out"
        raise SceneError([Complaint(f"lines.{name}.contact", given, expected, fix)])
