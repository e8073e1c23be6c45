"""Events of an accepted step: steps that were cut, an error that is not known, a line that comes near itself."""

from __future__ import annotations

from typing import TYPE_CHECKING

from hybrid.kernels.contact.self_distance import HIDES, MEETS, NEARS, PARTS
from hybrid.kernels.state import books as b
from hybrid.kernels.state.books import Clock, Counts
from hybrid.kernels.step.accept import MANY
from hybrid.simulation.collapse import COLLAPSE, ERROR, GAIN, GIVE_UP, NEWTON, TOUCHES_ITSELF, TURN, collapse_text
from hybrid.simulation.contact_start import comes_near
from hybrid.simulation.events import Sink, energy_gains_text, slack_steps_text, steps_cut_text
from hybrid.simulation.run_sample import NOT_ESTIMATED

if TYPE_CHECKING:
    from hybrid.simulation.transient import Transient

# What cuts steps, and where the tries are counted.
CUTS = {GAIN: "cut_by_gain", TURN: "cut_by_turn", NEWTON: "cut_by_newton", ERROR: "cut_by_error"}  # of Counts
# What a look at the line finds (kernels.contact.self_distance), as flags of a step.
ITSELF = {MEETS: b.MEETS_ITSELF, NEARS: b.NEARS_ITSELF, PARTS: b.PARTS_ITSELF, HIDES: b.HIDES_ITSELF}


def note_cut(clock: Clock, most: float, length: float, sink: Sink, told: bool) -> None:
    """An end turns too far in a fixed step, which was cut: an event for the first.

    most: rad in a step; length: m, of the line; told: whether nothing is to be said of it.
    """
    if not told:
        text = steps_cut_text(float(clock.cut_angle), float(clock.cut_step), most)
        sink.event(float(clock.previous), 0.0, length, "steps cut", text)
    clock.mute_cuts = 1.0


def note_slack(clock: Clock, waves: float, s: float, sink: Sink) -> None:
    """A catenary was slack at s (m) in a step too long for its waves, and not in shorter ones: an event for the first.

    waves: s, in which one passes a cell.
    """
    text = slack_steps_text(float(clock.slack_step), float(clock.last_dt), waves)
    sink.event(float(clock.now), s, s, "steps cut", text)
    clock.mute_slack = 1.0


def note_iterations(clock: Clock, count: Counts, length: float, sink: Sink) -> None:
    """A step was taken in all the Newton iterations that it may take though these had not converged: the first."""
    most = int(count.most_iterations)
    left = "though the next would still have" if most > 1 else "which"  # from one alone the next is not known
    text = (
        f"a step was taken after {most} Newton iterations, {left} changed it by {float(clock.correction):.2g} "
        f"(relative), and so are others like it: most_iterations bounds their cost; "
        f"steps/correction has what each left out; a shorter time.step or more iterations leave less"
    )
    sink.event(float(clock.now), 0.0, length, "iterations cut", text, threshold=float(most))


def count_iterations(clock: Clock, count: Counts, length: float, sink: Sink) -> None:
    """How many steps were taken so: an event with their number, at the end of the run."""
    short, most = int(count.cut_short), int(count.most_iterations)
    if short:
        text = f"{short} of {int(count.steps)} steps were taken after {most} Newton iterations that had not converged"
        now = float(clock.now)
        sink.event(now, 0.0, length, "iterations cut", text, value=float(short), threshold=float(most))


def count_energy_gains(moving: Transient) -> None:
    """How many tries of steps were repeated because contact created energy: an event with their number, at the end."""
    contact = moving.run.contact
    if contact is not None and contact.given_up:
        text = energy_gains_text(contact.given_up)
        moving.events.event(moving.t, 0.0, moving.model.length, "steps cut", text, value=float(contact.given_up))


def note_unknown_error(moving: Transient) -> None:
    """The error of neglecting bending could not be followed through the last step: an event, once in a while."""
    assert moving.correction is not None
    if moving.t > moving.beyond:
        s_a, s_b, text = moving.correction.unknown(moving.model.zones)
        moving.events.event(moving.t, s_a, s_b, NOT_ESTIMATED, text)
        moving.beyond = moving.t + moving.model.time_scale  # that it takes the whole line to move


def look_at_itself(moving: Transient, flags: int) -> None:
    """The line has become so bent that it could come near itself, is near, or meets itself: an event.

    flags: of kernels.state.books.
    """
    watch = moving.itself
    assert watch is not None
    found = sum(bit for bit, flag in ITSELF.items() if flags & flag) or watch.look(moving.run)
    moving.parts_itself = bool(found & PARTS)
    if found & HIDES and moving.envelope is not None:
        watch.tell_hidden(moving.t, moving.model, moving.state, moving.events.event)
    elif found & HIDES and not moving.touches:
        comes_near(moving)
    if found & NEARS:
        moving.nears_itself = comes_near(moving)  # contact begins after the outputs of this step
        if found & MEETS:
            watch.itself.found.told = 0.0
    elif found & MEETS and moving.envelope is not None:
        watch.tell(moving.t, float(moving.run.clock.last_dt), moving.events.event)


def note_collapse(moving: Transient) -> bool:
    """Steps have become so short that the run may not end: an event; whether a run to compare with has to stop."""
    clock, count = moving.run.clock, moving.run.count
    steps, dt, node = int(count.tiny_steps), float(clock.last_dt), int(count.cut_at)
    s = float(moving.model.line.s[min(max(node, 0), moving.model.line.s.size - 1)])
    cuts = {cause: int(getattr(count, name)) for cause, name in CUTS.items()}
    contact = TOUCHES_ITSELF if moving.run.contact is not None and moving.run.contact.touches else ""
    text = collapse_text(steps, dt, float(clock.longest), cuts, s, contact)
    if steps == MANY:
        moving.events.event(moving.t, s, s, COLLAPSE, text, value=dt)
    moving.collapse = text
    return moving.envelope is None and steps >= GIVE_UP
