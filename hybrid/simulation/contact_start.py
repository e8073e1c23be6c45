"""From when on contact of a line with itself is computed, and until when, where the scene does not ask for it."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from hybrid.errors import IN_SPACE, Complaint, Outcome, SceneError
from hybrid.kernels.laws.obstacles import cells_met, depths_in_obstacles
from hybrid.kernels.state.forces import MAY_TOUCH, OBSTACLES
from hybrid.kernels.state.state import State
from hybrid.model.self_reach import touching, touching_no_more
from hybrid.simulation.self_watch import deepest_text, within_itself
from hybrid.solve.self_contact import SelfContact

if TYPE_CHECKING:
    from hybrid.model.build import Model
    from hybrid.simulation.transient import Transient

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


def comes_near(moving: Transient) -> bool:
    """The line has come near itself: whether contact begins; where it does not, nobody watches from now on."""
    assert moving.itself is not None
    moving.came_near_itself = True
    if not moving.touches:
        moving.itself.rest(moving.run)
    return moving.touches


def begin_contact(moving: Transient) -> None:
    """Contact is computed from now on, in space; where the line is within itself it goes on without."""
    watch, model, state, monitor = moving.itself, moving.model, moving.state.copy(), moving.plane_monitor
    assert watch is not None
    if model.plane is not None:
        text = f"the line comes near itself: {IN_SPACE}, where it may touch itself"
        moving.events.event(moving.t, 0.0, model.length, "out of plane", text)
        model = monitor.leave(model, moving.run, state)
    monitor.comes_back = False
    model = replace(model, line=touching(model.line, moving.scene.contact.friction))
    moving.set_model(model, state)
    moving.stepper.work.u[:] = 0.0
    assert moving.run.contact is not None
    within = within_itself(moving.run.contact, model)
    watch.begins(moving.t, model, None if within or moving.envelope is None else moving.events.event)
    if within:
        end_contact(moving)
        watch.waits()
        if moving.envelope is not None and moving.steps:
            watch.tell_again(moving.t, float(moving.run.clock.last_dt), moving.events.event)


def end_contact(moving: Transient) -> None:
    """Contact is computed no longer, until the line comes near itself again."""
    model = moving.model
    moving.set_model(replace(model, line=touching_no_more(model.line)), moving.state.copy())
    moving.plane_monitor.comes_back = moving.may_come_back


def gives_up_contact(moving: Transient) -> bool:
    """No step leads on: whether contact that nobody asked for is there, and is given up, to try it again.

    It begins anew when what touches now has come apart.
    """
    contact, outcome = moving.run.contact, moving.run.tried.outcome
    may = contact is not None and contact.touches and bool(moving.model.line.bits & MAY_TOUCH)
    if not may or outcome in (Outcome.SLACK, Outcome.WINCH_AT_END):
        return False
    assert contact is not None and moving.itself is not None
    dt = float(moving.run.clock.try_end) - moving.t
    s, other, text = given_up(contact, moving.model, dt)
    moving.events.event(moving.t, s, other, GIVEN_UP, text)
    end_contact(moving)
    moving.itself.waits()
    return True


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
