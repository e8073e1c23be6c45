"""Contradictions between a line that is paid out and the rest of its scene, and what cannot be computed of it yet."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from hybrid.scene.accuracy import Accuracy
from hybrid.scene.analysis import (
    AdaptiveModel,
    CorrectedModel,
    CorrectedZone,
    Model,
    Output,
    Resolution,
    Time,
    ZonesModel,
)
from hybrid.scene.base import Finding, Place
from hybrid.scene.cable import Cable, Contact, Section
from hybrid.scene.ends import Clamped, Ends, Pinned

AT: tuple[str, ...] = ("ends", "end", "payout")
LEAVE_OUT = "leave it out, or ends.end.payout"


def _payout(end: Any) -> bool:
    return isinstance(end, Pinned | Clamped) and end.payout is not None


def payout_at_the_end(ends: Ends, cable: Cable) -> Iterator[Finding]:
    """Line is paid out at the end alone, of straight undamped sections, and the end is not let go."""
    if _payout(ends.start):
        fix = "exchange start and end, with the order of the sections: s counts from the end that is not at the winch"
        yield Finding(("ends", "start", "payout"), "nothing, because line is paid out at ends.end", fix)
    end = ends.end
    if not isinstance(end, Pinned | Clamped) or end.payout is None:
        return
    if isinstance(end, Clamped) and end.payout.winch is not None:
        fix = "write kind: pinned, or give the rate"
        yield Finding((*AT, "winch"), "nothing, because a winch holds a tension at a pinned end alone", fix)
    if end.release_at is not None:
        yield Finding(("ends", "end", "release_at"), "nothing, because line is paid out there", LEAVE_OUT)
    places: list[tuple[Place, Section]] = [(("cable", "sections", i), x) for i, x in enumerate(cable.sections)]
    places += [((*AT, "reel", i), x) for i, x in enumerate(end.payout.reel or ())]
    for at, section in places:
        if section.damping is not None and section.damping.stiffness:
            expected = (
                "nothing, because a line that is paid out (ends.end.payout) has no stiffness-proportional damping"
            )
            yield Finding((*at, "damping", "stiffness"), expected, "leave it out; damping.mass can stay")


def payout_stands_alone(
    ends: Ends, cable: Cable, model: Model, contact: Contact, solver: str, resolution: Resolution | None
) -> Iterator[Finding]:
    """Of zones that stay, without contact with itself, by elimination."""
    if not _payout(ends.end):
        return
    moving = isinstance(model, AdaptiveModel | CorrectedModel)
    if moving or (isinstance(model, ZonesModel) and any(isinstance(x, CorrectedZone) for x in model.zones)):
        expected = "catenary, rod, or zones of both that stay, because line is paid out (ends.end.payout)"
        yield Finding(("model",), expected, "write `model: catenary`, or `model: rod`", f"kind: {model.kind}")
    for i, item in enumerate(cable.attachments):
        if item.kind == "swivel":
            expected = "no swivel, because line is paid out (ends.end.payout)"
            yield Finding(("cable", "attachments", i, "kind"), expected, "leave it out: a pinned end turns freely")
    if contact.self:
        yield Finding(("contact", "self"), "false, because line is paid out (ends.end.payout)", LEAVE_OUT)
    if solver == "shooting":
        yield Finding(("solver",), "elimination, because line is paid out (ends.end.payout)", "leave solver out")
    if resolution is not None:
        expected = "nothing, because line is paid out (ends.end.payout), and its cells are given"
        yield Finding(("resolution",), expected, "place cells by `mesh`")


def payout_has_fixed_steps(
    ends: Ends, time: Time | None, accuracy: Accuracy | None, output: Output
) -> Iterator[Finding]:
    """With steps that are given, and no run to compare with."""
    if not _payout(ends.end) or time is None:
        return
    because = "because line is paid out (ends.end.payout), of which no error is estimated"
    if time.controlled:
        fix = "add `step: ...` (s)" if time.step is None else "leave tolerance out"
        yield Finding(("time", "step" if time.step is None else "tolerance"), f"a fixed step, in s, {because}", fix)
    if accuracy is not None:
        yield Finding(("accuracy",), f"nothing, {because}", "leave it out; halve time.step to see its error")
    if output.errors:
        yield Finding(("output", "errors"), f"false, {because}", "leave it out")
