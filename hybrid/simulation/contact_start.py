"""From when on contact of a line with itself is computed, and until when, where the scene does not ask for it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from hybrid.errors import Complaint, SceneError
from hybrid.kernels.laws.obstacles import cells_met, depths_in_obstacles
from hybrid.kernels.state.forces import OBSTACLES
from hybrid.kernels.state.state import State
from hybrid.simulation.self_watch import deepest_text
from hybrid.solve.self_contact import SelfContact

if TYPE_CHECKING:
    from hybrid.model.build import Model

# Kind of the event of contact that is given up because no step leads on with it.
GIVEN_UP = "contact given up"


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


def given_up(contact: SelfContact, model: Model, dt: float) -> tuple[float, float, str]:
    """Where, between two arc lengths (m), contact lets no step of dt (s) lead on, and the text of the event."""
    p, q = contact.deepest
    s, other = sorted((float(model.line.s[p]), float(model.line.s[q])))
    nodes = model.line.s[[p, q]]
    cells = float(model.cable.bending_length(1e-9 * model.tension_scale / model.length)[model.cable.piece(nodes)].min())
    if not cells > 0.0:
        cells = 0.5 * float(min(model.line.h[min(p, model.cells - 1)], model.line.h[min(q, model.cells - 1)]))
    where = deepest_text(contact, model) if contact.least_distance < float("inf") else ""
    text = (
        f"no step leads on with contact of the line with itself, down to {dt:.3g} s: {where}; it is not computed until "
        f"these are apart, and they may pass through each other; cells of at most {cells:.2g} m there would do"
    )
    return s, other, text
