"""What a run that begins as its scene says starts with, and errors that name their line."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from hybrid.errors import ComputationError, Outcome
from hybrid.kernels.state.state import State
from hybrid.model.build import Model
from hybrid.model.network import NetworkModel
from hybrid.scene.bodies import FixedBody
from hybrid.scene.end_loads import Triple
from hybrid.scene.motion import motion_record
from hybrid.scene.motion_tables import Motion
from hybrid.scene.network import Network
from hybrid.scene.points import FixedPoint
from hybrid.scene.schema import LineScene, Points
from hybrid.simulation.contact_equilibrium import refuse_start_in_obstacles
from hybrid.simulation.events import EventLog
from hybrid.simulation.slack_bends import slack_remedy
from hybrid.solve.joined import LineFailed, NetworkState, joined_ends
from hybrid.solve.stepper import Stepper


def begin_as_placed(
    model: NetworkModel, scenes: Sequence[LineScene], state: NetworkState, events: Sequence[EventLog]
) -> None:
    """Make a start that is no equilibrium ready, line by line.

    Clamps that its shape does not fit are reached smoothly, what is drawn is noted, and what lies still on the seabed
    has the friction that keeps it there.
    """
    each = zip(model.names, model.models, model.joints, scenes, state.lines, events, strict=True)
    for name, x, joints, scene, one, log in each:
        refuse_start_in_obstacles(x, one, f"lines.{name}.initial")
        note_drawn(scene, log)
        rotate_ends_in(scene, x, one, log, (joints[0] < 0, joints[1] < 0))
        stepper = Stepper(x.line, x.length, x.tension_scale)
        stepper.static_friction(x.sea.at(0.0), joined_ends(x.ends.at(0.0), joints), one)


def blended_of_lines(system: Network) -> Iterator[tuple[str, str]]:
    """Points and bodies of lines, and texts of `note_blended`; empty ones of what has no file."""
    for name, point in system.points.items():
        if isinstance(point, FixedPoint):
            yield name, blended_text(f"points.{name}", point.motion, point.position, bool(system.clamped_at(name)))
    for name, body in system.bodies.items():
        if isinstance(body, FixedBody):
            yield "", blended_text(f"bodies.{name}", body.motion, body.position, True)


def named(failed: LineFailed, model: NetworkModel, first: str = "", left: Path | None = None) -> ComputationError:
    """The same with the name of the line in its detail; first: to try before the usual remedy; left: a snapshot."""
    where = f"line {model.names[failed.line]}" if failed.line >= 0 else "the points"
    detail = f"{where}; {failed.detail}" if failed.detail else where
    if failed.outcome == Outcome.STOPPED:  # by what names itself
        detail = failed.detail
    name = model.names[failed.line] if failed.line >= 0 else ""
    first = first or failed.first
    if not first and failed.line >= 0:
        first = slack_remedy(model.models[failed.line], failed.outcome, failed.s)
    return ComputationError(failed.outcome, failed.t, failed.s, detail, left, first, name)


# What an end does that the start of a cable does not fit: blended in, with an event that says how.
#
# Motion files that do not start at rest where the end is, and tangents that the initial shape does not have; and what
# the
# line itself does not fit: points that are further apart, or nearer to each other, than it is long.

AT_REST = 1e-9  # m, deg, m/s or deg/s, below which a record starts at rest
# Of the strain that a section bears, the part beyond which a line along points starts stretched: 0.1 % of wire.
DRAWN = 0.02


def blended_text(where: str, motion: Motion | None, position: Triple | None, turns: bool) -> str:
    """How the file of a motion begins, and until when it is blended in; empty: it has no file or no ramp.

    position: m, of what moves; turns: whether it holds a direction.
    """
    if motion is None or motion.file is None or motion.ramp is None:
        return ""
    record, parts = motion_record(motion, position, turns), []
    bases = (np.array(position or (0.0, 0.0, 0.0)), np.zeros(3))
    for values, base, units in ((record.shift, bases[0], "m"), (record.rotation, bases[1], "deg")):
        if values is None:
            continue
        first = np.array([np.interp(0.0, record.times, column) for column in values.T])
        i = max(int(np.searchsorted(record.times, 0.0, side="right")) - 1, 0)
        speed = np.linalg.norm((values[i + 1] - values[i]) / (record.times[i + 1] - record.times[i]))
        for size, unit in ((float(np.linalg.norm(first - base)), units), (float(speed), f"{units}/s")):
            parts += [f"{size:.4g} {unit}"] if size > AT_REST else []
    begins = f"begins with {', '.join(parts)}" if parts else "begins at rest where it is held"
    return (
        f"the motion of {where} in {record.name} {begins}: it is blended in over {motion.ramp:g} s (ramp), and "
        "followed exactly from then on"
    )


def note_drawn(scene: LineScene, events: EventLog) -> None:
    """An event for a line that starts stretched, or compressed, as its points are drawn and its ends do not ask for."""
    initial, cable, held = scene.initial, scene.cable, scene.ends.held()
    if not isinstance(initial, Points) or initial.arc_lengths is not None or cable.inextensible:
        return
    fits = max(cable.length, math.dist(held["start"], held["end"]) if len(held) == 2 else 0.0)
    drawn = initial.knots[-1]
    if abs(drawn - fits) > DRAWN * cable.length * min(x.strain_limit for x in cable.sections):
        strain = drawn / cable.length - 1.0
        how = "stretched" if strain > 0.0 else "compressed"
        text = (
            f"a line of {cable.length:.6g} m that starts along {drawn:.6g} m of points, {how} by {abs(strain):.2%}: "
            f"initial.points: expected {fits:.6g} m in all: move the points; or write `kind: equilibrium`, "
            "and it starts at rest; where it is meant, give initial.arc_lengths"
        )
        events.event(0.0, 0.0, cable.length, "implausible", text)


def rotate_ends_in(
    scene: LineScene, model: Model, state: State, events: EventLog, held: tuple[bool, bool] = (True, True)
) -> None:
    """Tangents that the initial shape does not have are reached smoothly, and an event says so.

    held: whether the start and the end are held, and not on what moves by the lines.
    """
    e = state.e
    d = (e[0] / np.linalg.norm(e[0]), e[-1] / np.linalg.norm(e[-1]))
    which = [bool(model.line.element[-k]) and held[k] for k in (0, 1)]
    duration = min(model.time_scale, 0.5 * scene.require_time().duration)
    for k, angle in model.ends.bring_in(d, which, duration):
        s = float(model.line.s[-k])
        text = (
            f"the initial shape misses the tangent prescribed at s = {s:g} m by {np.degrees(angle):.3g} deg: "
            f"it is rotated to it, and a force there grows, over the first {duration:.3g} s; "
            f"start from an equilibrium to avoid this"
        )
        events.event(0.0, s, s, "end rotated in", text)
