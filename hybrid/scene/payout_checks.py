"""Contradictions between a line that is paid out and the rest of its scene, and what cannot be computed of it yet."""

from __future__ import annotations

from collections.abc import Iterator

from hybrid.errors import Complaint, SceneError
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
from hybrid.scene.payout import Payout

LEAVE_OUT = "leave it out, or ends.{0}.payout"


def _winch(ends: Ends) -> tuple[str, Pinned | Clamped, Payout] | None:
    """The end at which line is paid out, by name, and how; the last one of two."""
    found = None
    for name, end in ends.named().items():
        if isinstance(end, Pinned | Clamped) and end.payout is not None:
            found = name, end, end.payout
    return found


def payout_at_an_end(ends: Ends, cable: Cable) -> Iterator[Finding]:
    """Line is paid out at one end alone, of straight undamped sections, and that end is not let go."""
    found = _winch(ends)
    if found is None:
        return
    name, end, payout = found
    at: Place = ("ends", name, "payout")
    if name == "end" and getattr(ends.start, "payout", None) is not None:
        yield Finding(("ends", "start", "payout"), "nothing, because line is paid out at ends.end", "leave one out")
    if end.release_at is not None:
        expected = "nothing, because line is paid out there"
        yield Finding(("ends", name, "release_at"), expected, LEAVE_OUT.format(name))
    places: list[tuple[Place, Section]] = [(("cable", "sections", i), x) for i, x in enumerate(cable.sections)]
    places += [((*at, "reel", i), x) for i, x in enumerate(payout.reel or ())]
    for at, section in places:
        if section.damping is not None and section.damping.stiffness:
            expected = (
                f"nothing, because a line that is paid out (ends.{name}.payout) has no stiffness-proportional damping"
            )
            yield Finding((*at, "damping", "stiffness"), expected, "leave it out; damping.mass can stay")


def payout_stands_alone(
    ends: Ends, cable: Cable, model: Model, contact: Contact, solver: str, resolution: Resolution | None
) -> Iterator[Finding]:
    """By elimination, of models that nodes can enter; contact with itself knows the diameters on the reel."""
    found = _winch(ends)
    if found is None:
        return
    name, because = found[0], f"because line is paid out (ends.{found[0]}.payout)"
    corrected = isinstance(model, ZonesModel) and any(isinstance(x, CorrectedZone) for x in model.zones)
    if corrected or isinstance(model, CorrectedModel):
        expected = f"adaptive, catenary, rod, or zones of catenary and rod, {because}"
        yield Finding(("model",), expected, "write `model: adaptive`, or `model: catenary`", f"kind: {model.kind}")
    if isinstance(model, AdaptiveModel):
        if model.joint == "curvature":
            yield Finding(("model", "joint"), f"spherical, {because}", "leave it out")
        if model.correct:
            yield Finding(("model", "correct"), f"false, {because}", "leave it out, and make model.tolerance smaller")
    for i, item in enumerate(cable.attachments):
        if item.kind == "swivel":
            expected = f"no swivel, {because}"
            yield Finding(("cable", "attachments", i, "kind"), expected, "leave it out: a pinned end turns freely")
    if contact.self:
        for i, section in enumerate(getattr(ends, name).payout.reel or ()):
            if section.diameter is None:
                expected = "a number > 0, in m, which parts of the cable keep apart (contact.self)"
                yield Finding(("ends", name, "payout", "reel", i, "diameter"), expected, "add `diameter: ...` (m)")
    if solver == "shooting":
        yield Finding(("solver",), f"elimination, {because}", "leave solver out")
    if resolution is not None:
        expected = f"nothing, {because}, and its cells are given"
        yield Finding(("resolution",), expected, "place cells by `mesh`")


def check_fixed_step(ends: Ends, time: Time) -> None:
    """SceneError where a motion is to be computed whose line is paid out, and whose step is not given.

    An equilibrium, and a plan, need none.
    """
    found = _winch(ends)
    if found is not None and time.step is None:
        expected = f"a fixed step, in s, because line is paid out (ends.{found[0]}.payout): no error is estimated"
        fix = "add `step: ...` (s) to time, and halve it to see its error; the equilibrium alone: hybrid static FILE"
        raise SceneError([Complaint("time.step", "nothing", expected, fix)])


def payout_has_fixed_steps(
    ends: Ends, time: Time | None, accuracy: Accuracy | None, output: Output
) -> Iterator[Finding]:
    """With steps that are given, and no run to compare with."""
    found = _winch(ends)
    if found is None or time is None:
        return
    because = f"because line is paid out (ends.{found[0]}.payout), of which no error is estimated"
    if time.tolerance is not None:
        yield Finding(("time", "tolerance"), f"nothing, and a fixed step, {because}", "give time.step (s) instead")
    if accuracy is not None:
        yield Finding(("accuracy",), f"nothing, {because}", "leave it out; halve time.step to see its error")
    if output.errors:
        yield Finding(("output", "errors"), f"false, {because}", "leave it out")
