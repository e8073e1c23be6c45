"""From when on contact of a line with itself is computed, where the scene does not ask for it from the start."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from hybrid.errors import IN_SPACE
from hybrid.kernels import books as b
from hybrid.model.self_reach import touching
from hybrid.simulation.self_watch import within_itself

if TYPE_CHECKING:
    from hybrid.simulation.transient import Transient


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
    alone = model.line.bits
    model = replace(model, line=touching(model.line, moving.scene.contact.friction))
    moving.set_model(model, state)
    moving.stepper.work.u[:] = 0.0
    assert moving.run.contact is not None
    if within_itself(moving.run.contact, model):
        moving.set_model(replace(model, line=model.line._replace(bits=alone)), state)
        if moving.envelope is not None and moving.steps:
            watch.tell_again(moving.t, float(moving.run.clock[b.LAST_DT]), moving.events.event)
