"""Events of a run on their way to its file: what computes notes them, what writes fetches them."""

from __future__ import annotations

from collections.abc import Callable
from math import nan
from typing import Any, Protocol


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

    def write_to(self, sink: Sink) -> None:
        """Write all that wait."""
        for event, more in self._waiting:
            sink.event(*event, **more)
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
    """Text of the event of a catenary that is slack in a step of `tried`, and not in one of `taken`; waves: the time

    in which a wave passes its shortest cell, s.
    """
    return (
        f"a catenary loses its tension here in a step of {tried:.4g} s, and keeps it in one of {taken:.4g} s: the step "
        f"is too long for waves, which pass a cell in {waves:.2g} s; this step and others like it are "
        f"cut; time.step: {taken:.2g} follows them"
    )
