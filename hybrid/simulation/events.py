"""Events of a run on their way to its file: what computes notes them, what writes fetches them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from math import nan
from typing import Any, Protocol

from hybrid.kernels.state.books import Clock, Counts
from hybrid.kernels.step.accept import MANY, TINY


class Sink(Protocol):
    """What events are written to."""

    @property
    def event(self) -> Callable[..., None]: ...


class EventLog:
    """Events in the order in which they happened, until they are written."""

    def __init__(self) -> None:
        self._waiting: list[tuple[tuple[float, float, float, str, str], dict[str, Any]]] = []

    def event(
        self, t: float, s_a: float, s_b: float, kind: str, text: str, *, criterion: str = "", value: float = nan,
        threshold: float = nan, energy: float = nan,
    ) -> None:  # fmt: skip
        """Something happened at time t (s) on s_a <= s <= s_b (m); the rest: as of `Recorder.event`."""
        more = {"criterion": criterion, "value": value, "threshold": threshold, "energy": energy}
        self._waiting.append(((t, s_a, s_b, kind, text), more))

    def waiting(self) -> list[tuple[float, float, float, str, str]]:
        """Those that wait: t (s), s_a, s_b (m), kind, text."""
        return [event for event, _ in self._waiting]

    def write_to(self, sink: Sink, words: Callable[[str], str]) -> None:
        """Write all that wait; words: what makes texts of the scene of those of its network."""
        for (*where, text), more in self._waiting:
            sink.event(*where, words(text), **more)
        self._waiting.clear()


def steps_cut_text(angle: float, step: float, most: float) -> str:
    """Text of the event of fixed steps, s, in which an end turns by more than `most`, rad."""
    return (
        f"an end turns by {angle:.3g} rad in a step of {step:.4g} s: this step and others like it are cut, so that it "
        f"turns by at most {most:g} rad in each and no turn is lost; time.step: {0.3 * step / angle:.2g} follows it"
    )


def energy_gains_text(tries: int) -> str:
    """Text of the event of steps that were repeated because contact created energy in them."""
    return (
        f"{tries} tries of steps in contact of lines were repeated with half the length, because the time "
        f"scheme would have created energy in them; a shorter time.step needs fewer"
    )


def slack_steps_text(tried: float, taken: float, waves: float) -> str:
    """Text of the event of a catenary that is slack in a step of `tried`, and not in one of `taken`.

    s; waves: the time in which a wave passes its shortest cell, s.
    """
    return (
        f"a catenary loses its tension here in a step of {tried:.4g} s, and keeps it in one of {taken:.4g} s: the step "
        f"is too long for waves, which pass a cell in {waves:.2g} s; this step and others like it are "
        f"cut; time.step: {taken:.2g} follows them"
    )


# Steps that have become so short that a run may not end: since when, what cuts them, and where.

# Kind of the event.
COLLAPSE = "steps collapse"
# Steps so short, one after the other, after which a run that is only to be compared with is given up.
GIVE_UP = 10 * MANY
# What shortened a step.
GAIN = "gain"
TURN = "turn"
NEWTON = "newton"
ERROR = "error"
# What cuts steps, and what to do about it.
CAUSES = {
    GAIN: ("energy that contact puts in", "shorter cells there"),
    TURN: ("cells that turn by more than a step allows", "cells as long as the bend there, or damping"),
    NEWTON: ("Newton's method, which does not converge", "more cells where the cable bends, or damping"),
    ERROR: ("the error that a step makes", "a larger accuracy or time.tolerance, or damping of what is fast there"),
}
TOUCHES_ITSELF = "; the line touches itself there, and contact: {self: false} leaves that out"
TOUCH_EACH_OTHER = "; lines touch each other there, and contact: {between: []} leaves that out"


def collapse_text(steps: int, dt: float, longest: float, cuts: Mapping[str, int], s: float, contact: str) -> str:
    """Text of the event of so many steps in a row, the last of dt (s), the longest of the run before.

    cuts: tries that were given up, by cause; s: m, where the last was; contact: what touches now, TOUCHES_ITSELF or
    TOUCH_EACH_OTHER; empty: nothing.
    """
    text = (
        f"the last {steps} steps were shorter than {TINY:g} of the longest, {longest:.3g} s; the last took {dt:.3g} s"
    )
    most = max(cuts, key=lambda cause: cuts[cause], default="")
    if not most or not cuts[most]:
        return f"{text}; they grow no faster{contact}"
    given = ", ".join(f"{CAUSES[x][0]} ({n})" for x, n in sorted(cuts.items(), key=lambda each: -each[1]) if n)
    return f"{text}; tries were cut by {given}, last at s = {s:.6g} m: {CAUSES[most][1]}{contact}"


# Events of an accepted step: steps that were cut, an error that is not known, a line that comes near itself.

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
