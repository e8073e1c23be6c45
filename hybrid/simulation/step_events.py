"""Events of an accepted step: steps that were cut, an error that is not known, a line that comes near itself."""

from __future__ import annotations

from hybrid.kernels.state.books import Clock, Counts
from hybrid.simulation.collapse import ERROR, GAIN, NEWTON, TURN
from hybrid.simulation.events import Sink, slack_steps_text, steps_cut_text

# What cuts steps, and where the tries are counted.
CUTS = {GAIN: "cut_by_gain", TURN: "cut_by_turn", NEWTON: "cut_by_newton", ERROR: "cut_by_error"}  # of Counts


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
