"""What a scene switches on and by which key, and which lines may touch.

What is off is named with what would switch it on.  Contact of a line with itself is computed as the scene asks, else
wherever the line can reach itself.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from math import inf
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hybrid.errors import OF_AN_END
from hybrid.kernels.march.zone_torque import FIRST, LAST
from hybrid.kernels.mesh.zone_criteria import CRITERIA
from hybrid.kernels.state.report import (
    BENDING_LAW,
    BENDING_SLIP,
    DRAG,
    FORCES,
    MAY_TOUCH,
    SELF_CONTACT,
    SELF_FRICTION,
    STIFFNESS,
    VORTICES,
)
from hybrid.kernels.state.state import Floats, Line
from hybrid.model.mesh import Zone
from hybrid.model.obstacles import obstacle_rows
from hybrid.model.plausibility import implausible
from hybrid.model.resolution import (
    Reach,
    first_resolution,
    follows_curvature,
    mesh_is_free,
    requested_accuracy,
    wants_errors,
    wants_survey,
)
from hybrid.model.sections import swivels
from hybrid.scene.analysis import USUAL, AdaptiveModel, CatenaryModel
from hybrid.scene.bodies import Carried, FreeBody
from hybrid.scene.ends import Clamped, End, Fairlead, FreePoint, GuidedPoint, LinesContact, Payout, Pinned
from hybrid.scene.network import Network, SomeScene
from hybrid.scene.schema import LineScene, reachable_obstacles
from hybrid.scene.waves import RecordedWaves, StreamFunctionWaves

# Diameters of slack of the smallest loop: WINDOW of contact.self_contact_pairs less OUTER of contact.self_contact_law,
# which a plan does not import.
LOOP = 2.7 - 1.05


# Of a reason why a line touches itself: that it does where it comes near itself.
WHERE_NEAR = "from where it comes near itself"
# By runs with and without contact of plectonemes, loops and hoses: 1.7 to 21 times.
COST = "its steps take 2 to 20 times as long, and may be shorter; contact: {self: false} switches it off"


class SelfReach(NamedTuple):
    """asked: computed from the start; may: from when the line comes near itself; why: which, or why neither."""

    asked: bool
    may: bool
    why: str


def self_reach(scene: LineScene) -> SelfReach:
    """Whether contact of the line with itself is computed, by the scene alone."""
    asked = scene.contact.self
    if asked is not None:
        return SelfReach(asked, False, f"contact.self: {str(asked).lower()}")
    model = scene.model
    sections = [*scene.cable.sections, *(x for paid in payouts(scene) for x in paid.reel or ())]
    off = {
        "a section has no diameter": any(x.diameter is None for x in sections),
        "catenaries that stay touch each other with contact: {self: true} alone": isinstance(model, CatenaryModel),
        "dimension: 2, where contact: {self: true} alone computes it": scene.dimension == 2
        or scene.contact.around.in_plane,
    }
    why = next((text for text, holds in off.items() if holds), "")
    if why:
        return SelfReach(False, False, why)
    slack, least = slack_of(scene), LOOP * min(x.diameter or math.inf for x in scene.cable.sections)
    if slack <= least:
        return SelfReach(False, False, f"the slack of {max(slack, 0.0):.3g} m is less than {least:.3g} m, of a loop")
    much = "whatever its ends do" if math.isinf(slack) else f"a slack of {slack:.3g} m, and a loop takes {least:.3g} m"
    return SelfReach(False, True, f"{WHERE_NEAR}: {much}; {COST}")


def no_contact(scene: LineScene) -> str:
    """Why a line may be within itself in a run of a scene."""
    reach = self_reach(scene)
    return "parts are in each other, and contact begins where they are apart" if reach.may else reach.why


def payouts(scene: LineScene) -> list[Payout]:
    """How line is paid out, at the ends at which it is."""
    found = [getattr(end, "payout", None) for end in scene.ends.both]
    return [x for x in found if x is not None]


def slack_of(scene: LineScene) -> float:
    """Length, m, by which the line is longer than its ends are apart.

    Infinite where an end moves or may, is set from outside, breaks or is let go, or the line is paid out.
    """
    a, b = (end.held_position for end in scene.ends.both)
    if a is None or b is None or payouts(scene) or scene.contact.around.ends_are_set:
        return math.inf
    if any(x.prescribed_motion or x.release or not x.is_placed for x in scene.ends.both):
        return math.inf
    return scene.length - math.dist(a, b)


def contact_bits(scene: LineScene) -> int:
    """Bits of kernels.state.report for the start of a run."""
    reach = self_reach(scene)
    if reach.asked:
        return SELF_CONTACT | (SELF_FRICTION if scene.contact.friction else 0)
    return MAY_TOUCH if reach.may else 0


def touching_no_more(line: Line) -> Line:
    """The line, of which contact with itself is computed no longer."""
    return line._replace(bits=line.bits & ~(SELF_CONTACT | SELF_FRICTION))


def touching(line: Line, friction: float) -> Line:
    """The line, of which contact with itself is computed from now on."""
    return line._replace(bits=line.bits | SELF_CONTACT | (SELF_FRICTION if friction else 0))


# Part of the variance of a record that is round-off.
LOST = 1e-6
# What the entry of the accuracy that is asked is called.
ACCURACY = "accuracy"


@dataclass(frozen=True)
class Entry:
    """A part of a model: what, on or off, and which key asks for it (or would switch it on)."""

    what: str
    on: bool
    why: str
    event: str = ""  # kind of event that a result gets for it: "ignored", "implausible"
    s: tuple[float, float] | None = None  # the stretch of line (m) that it is about; None: all of it


def _watched(scene: LineScene) -> Iterator[Entry]:
    """The criteria by which zones move, with their thresholds."""
    assert isinstance(scene.model, AdaptiveModel)
    why = "model.tolerance x length" if scene.model.tolerance else "1e-3 of the length, or a part of what accuracy asks"
    yield Entry(f"zones that move; tolerance {first_resolution(scene).zones * scene.length:.3g} m", True, why)
    for x in CRITERIA:
        forced = scene.model.force_rod or scene.model.force_catenary
        reach = self_reach(scene)
        asked = {"given": forced, "contact": reach.asked or reach.may}.get(x.name, True)
        yield Entry(f"criterion {x.name}: rod above 1, catenary below {x.off:g}", bool(asked), x.ratio)


def _fixed(zones: Sequence[Zone]) -> Iterator[Entry]:
    """Zones that stay what they are."""
    kinds = {z.kind for z in zones}
    for kind, what in (
        ("catenary", "catenary cells (6th order)"),
        ("rod", "rod cells: bending, torsion (12th order)"),
    ):
        yield Entry(what, kind in kinds, "model" if kind in kinds else f"no {kind} zone in model")
    joints = sum(a.kind != b.kind for a, b in pairwise(zones))
    why = "a rod zone meets a catenary zone" if joints else "rod and catenary do not meet"
    yield Entry(f"spherical joints: {joints}", joints > 0, why)


def _moving(model: AdaptiveModel) -> Iterator[Entry]:
    """Zones that come and go."""
    yield Entry("rod cells: bending, torsion (12th order)", True, "model; where a criterion asks for them")
    yield Entry("catenary cells (6th order)", True, "model; where none does")
    yield Entry("joints that carry no moment", True, "where rod and catenary meet")


def accuracy_entry(scene: LineScene, reach: Reach | None = None) -> Entry:
    """What is asked of the result; reach: how far the line moves, where that is known."""
    want = requested_accuracy(scene)
    if want is None:
        return Entry(ACCURACY, False, "not asked for: `accuracy: 1%`, `3 cm` or `50 N`")
    why = "accuracy" if scene.accuracy else f"no time.step, so {USUAL}"
    return Entry(ACCURACY, True, f"{why}: {want.describe(reach, rests=scene.time is None)}")


def with_accuracy(contents: Sequence[Entry], scene: LineScene, reach: Reach | None = None) -> tuple[Entry, ...]:
    """The same contents with what a scene itself asks, where they are those of a model that is chosen for it."""
    asked = accuracy_entry(scene, reach)
    return tuple(asked if x.what == asked.what else x for x in contents)


def _accuracy(scene: LineScene) -> Iterator[Entry]:
    """What is asked of the result, and what it sets."""
    resolution, time = first_resolution(scene), scene.time
    yield accuracy_entry(scene)
    if time is not None and resolution.local is not None:
        why = (
            f"error of a step {resolution.local:.2g} m at most, by {'time.tolerance' if time.tolerance else 'accuracy'}"
        )
        yield Entry("steps that follow the motion", True, f"{why}; {resolution.step:.3g} s at most")
    elif time is not None:
        yield Entry("steps that follow the motion", False, "time.step fixes them")
    graded = wants_survey(scene)
    why = "no accuracy is asked for" if mesh_is_free(scene) else "the scene places the cells"
    why = "they follow the curvature" if follows_curvature(scene) else why
    by = "accuracy" if scene.resolution is None else "resolution.cells_per_layer"
    yield Entry("cells graded by bends", graded, f"{by}; as a first, coarse run shows them" if graded else why)
    wants = wants_errors(scene)
    by = "output.errors" if scene.output.errors is not None else "accuracy"
    why = f"{by}; several coarser runs beside it" if wants else "output.errors: true, or accuracy"
    yield Entry("error figure, by coarser runs", wants, why)


def _parts(scene: LineScene, line: Line, rods: bool, flat: Entry) -> Iterator[Entry]:
    """Parts of the model of the cable itself: dimension, torsion, sections with axes of their own, attachments."""
    yield flat
    why = "rod cells" if rods else "no rod zone in model"
    yield Entry("torsion", rods and not flat.on, "nothing twists in a plane" if rods and flat.on else why)
    if line.torsion.size:
        why = "nothing twists in a plane" if flat.on else "both ends hold the twist"
        yield Entry(f"torque through {len(line.torsion)} catenary zones", not flat.on, why)
    sections = scene.cable.sections
    differ = any(x.anisotropic for x in sections)
    yield Entry("bending that differs in two directions", differ, "sections[].bending_stiffness of two numbers")
    curled = any(x.intrinsic_curvature is not None and any(x.intrinsic_curvature) for x in sections)
    yield Entry("curvature without load", curled, "sections[].intrinsic_curvature")
    armoured = any(x.tension_torque for x in sections)
    yield Entry("torque of tension", armoured, "sections[].tension_torque")
    free = swivels(scene)
    if free:
        yield Entry(f"swivels: {len(free)}", True, "cable.attachments of kind swivel: no torque passes")
    attached = len(scene.cable.attachments) + len(scene.ends.bodies())
    yield Entry(f"attachments: {attached}", attached > 0, "cable.attachments, ends of kind body")


def _swivel_holds(scene: LineScene, end: End, cell: int) -> bool:
    """Whether the section at a clamp with a swivel has a direction, which the element there then holds."""
    section = scene.cable.sections[cell]
    curved = section.intrinsic_curvature is not None and any(section.intrinsic_curvature)
    return end.kind == "clamped" and not end.holds_twist and (section.anisotropic or curved)


def _by_first_harmonic(scene: LineScene, end: End) -> bool:
    """Whether a vessel moves an end by an RAO in a wave of finite height."""
    fluid, vessel = scene.environment.fluid, getattr(end.prescribed_motion, "vessel", None)
    finite = fluid is not None and isinstance(fluid.waves, StreamFunctionWaves)
    return finite and vessel is not None and vessel.rao is not None


def model_error(scene: LineScene, zones: Sequence[Zone]) -> Entry:
    """Whether what leaving bending out changes is estimated."""
    what = "model error (bending left out)"
    if not wants_errors(scene):
        return Entry(what, False, "output.errors: true")
    if not isinstance(scene.model, AdaptiveModel) and all(z.kind == "rod" for z in zones):
        return Entry(what, False, "rod everywhere: nothing is left out")
    if not any(x.weakest_bending for x in scene.cable.sections):
        return Entry(what, False, "no bending stiffness: there is nothing to leave out")
    return Entry(what, True, "error figure; by a coarser run with rods in place of catenaries")


def _force(scene: LineScene, line: Line, name: str, bit: int, needs: str) -> Entry:
    """Whether a force acts, or may: contact of the line with itself begins where it comes near itself."""
    if bit == SELF_CONTACT:
        return Entry(name, bool(line.bits & (bit | MAY_TOUCH)), self_reach(scene).why)
    if bit == SELF_FRICTION and line.bits & MAY_TOUCH:
        return Entry(name, scene.contact.friction > 0.0, needs)
    return Entry(name, bool(line.bits & bit), needs)


def _let_go(scene: LineScene, name: str) -> str:
    """When an end is let go, by time; a run that ends before can be continued."""
    release = scene.ends.named()[name].release
    if release is None or release.time is None or scene.time is None:
        return ""
    late = f", after the end of this run, {scene.time.duration:g} s" * (release.time >= scene.time.duration)
    return f", let go at {release.time:g} s{late}"


IDLE = "the current acts on nothing"


def _idle(scene: LineScene, line: Line) -> Iterator[Entry]:
    """That there is a current, but nothing of this line has drag."""
    fluid, carried = scene.environment.fluid, (*scene.cable.attachments, *scene.ends.bodies().values())
    flows = fluid is not None and fluid.flows()
    if flows and not line.bits & (DRAG | VORTICES) and not any(getattr(x, "drag_area", 0.0) for x in carried):
        why = "no section, body or member has drag: add `drag: {normal: 1.2}` to a section, or `drag_area`"
        yield Entry(IDLE, False, f"{why} to what it carries", event="ignored")


def _left_out(scene: LineScene) -> Iterator[Entry]:
    """What of a measured elevation is in no wave."""
    waves = scene.environment.waves
    if isinstance(waves, RecordedWaves) and (waves.recorded.lost > LOST or waves.recorded.has_mean):
        x = waves.recorded
        why = (
            f"{100.0 * x.lost:.3g} % of its variance, in periods other than {x.shortest:.4g} to {x.longest:.4g} s, and "
            f"its mean, {x.mean:.4g} m"
        )
        yield Entry("a part of the record of the sea (environment.fluid.waves)", False, why, event="ignored")


def obstacle_entries(scene: LineScene, rows: Floats) -> Iterator[Entry]:
    """Each obstacle of a scene, with how stiff it is; rows: (M, OBSTACLE) of them."""
    touched = reachable_obstacles(scene)
    for (name, x), row in zip(scene.obstacles.items(), rows, strict=True):
        why = "given" if x.stiffness else "so that it lies at most a twentieth of its diameter deep at rest"
        text = f"obstacle {name}: {x.kind}, {row[STIFFNESS]:.3g} N/m per m, friction {x.friction:g}"
        text += ", set from outside" * x.from_outside + ", moves" * (x.moves and not x.from_outside)
        key = f"bodies.{name}.shape" if isinstance(x, Carried) else f"obstacles.{name}"
        why = f"{key}; stiffness: {why}" if name in touched else f"{key}; the line is too short to reach it"
        yield Entry(text, name in touched, why)


def _torque_at_winch(scene: LineScene, line: Line) -> Iterator[Entry]:
    """A torque through a catenary whose length a winch changes: its compliance changes where nodes enter and leave."""
    if not line.torsion.size:
        return
    for name, end, reaches, cell in (
        ("start", scene.ends.start, line.torsion[0, FIRST] == 0.0, 0),
        ("end", scene.ends.end, line.torsion[-1, LAST] == line.h.size, -1),
    ):
        if isinstance(end, Pinned | Clamped) and end.payout is not None and reaches:
            most = 100.0 * line.h[cell] / line.s[-1]
            why = (
                f"of ends.{name}.payout is that of the length when the last node entered or left, up to {most:.2g} % "
                "wrong between, and a run that is resumed there differs by as much; a rod zone there, or shorter cells"
            )
            yield Entry("torque through the catenary at the winch", False, why, event="torque neglected")


def contents_of(scene: LineScene, line: Line, zones: Sequence[Zone], flat: Entry) -> tuple[Entry, ...]:
    """What is on and by which key, what is off and what would switch it on; flat: whether it is in a plane."""
    has_rods = any(z.kind == "rod" for z in zones)
    entries = list(_moving(scene.model) if isinstance(scene.model, AdaptiveModel) else _fixed(zones))
    entries += (*_parts(scene, line, has_rods, flat), *_laws(scene, line))
    if has_rods:
        entries += _assumed_torsion(scene)
    entries += [Entry(x.what, True, x.why, "implausible", x.s) for x in implausible(scene)]
    entries.append(model_error(scene, zones))
    if isinstance(scene.model, AdaptiveModel):
        entries += _watched(scene)
        entries.append(Entry("criteria as fields", scene.output.criteria, "output.criteria"))
    else:
        entries.append(Entry("zones that move", False, "model: adaptive"))
        if scene.output.criteria:
            entries.append(Entry("criteria as fields", False, "only zones that move have criteria", event="ignored"))
    entries += _accuracy(scene)
    entries.append(Entry("gravity", scene.environment.gravity != 0, "environment.gravity"))
    entries.append(Entry("buoyancy", scene.environment.fluid is not None, "environment.fluid"))
    entries += (*_idle(scene, line), *_left_out(scene))
    entries += [_force(scene, line, name, bit, needs) for name, (bit, needs) in FORCES.items()]
    if isinstance(scene.model, AdaptiveModel) and not any(x.turns for x in scene.cable.sections):
        why = "rods that come and go have what sections[].rotary_inertia gives; fixed zones and `model: rod` any"
        entries = [replace(x, why=why) if x.what == "rotary inertia" else x for x in entries]
    entries += (*_twisted_ends(scene, line, zones), *_torque_at_winch(scene, line))
    entries += (*obstacle_entries(scene, obstacle_rows(scene)), *_of_ends(scene, line))
    return tuple(entries)


def _laws(scene: LineScene, line: Line) -> Iterator[Entry]:
    """Laws of sections: of tension over strain, and of moment over curvature."""
    sections = scene.cable.sections
    yield Entry("axial compliance", any(x.stiffness is not None for x in sections), "sections[].axial_stiffness")
    if any(x.tension_strain is not None for x in sections):
        yield Entry("tension over strain by a table", True, "sections[].tension_strain")
    if any(x.syrope is not None for x in sections):
        yield Entry("tension over strain by the highest mean tension", True, "sections[].syrope")
    if line.bits & BENDING_LAW:
        why = "sections[].moment_curvature, cable.attachments of kind bend_restrictor"
        yield Entry("moment over curvature by a table", True, why)
    if line.bits & BENDING_SLIP:
        if any(x.bending_slip or x.first_loading for x in sections):
            why = "sections[].bending_slip, first_loading; in equilibria as on first loading from straight"
            yield Entry("layers that slip as the line bends", True, why)
        if any(x.stiffness_per_tension for x in sections):
            yield Entry("bending stiffness that grows with tension", True, "sections[].stiffness_per_tension")
    if any(x.creep is not None for x in sections):
        yield Entry("strain that grows with the logarithm of time", True, "sections[].creep")
    if any(x.dynamic_stiffness is not None for x in sections):
        yield Entry("stiffness that depends on speed and mean tension", True, "sections[].dynamic_stiffness")


def _assumed_torsion(scene: LineScene) -> Iterator[Entry]:
    """Sections that bend and give no torsional stiffness."""
    sections = scene.cable.sections
    assumed = [i for i, x in enumerate(sections) if x.torsional_stiffness is None and x.initial_bending]
    if assumed:
        which = ", ".join(f"sections[{i}]" for i in assumed)
        why = f"assumed (solid round section): {which} gives none"
        yield Entry("torsional stiffness = bending stiffness / 1.3", True, why)


def _twisted_ends(scene: LineScene, line: Line, zones: Sequence[Zone]) -> Iterator[Entry]:
    """Twist by turns of the ends, and what keeps it from acting."""
    if not scene.ends.turns:
        return
    free = swivels(scene)
    loose = next((z for z in zones if z.kind != "rod" and not line.torsion.size and not free), None)
    what, why = f"twist by {scene.ends.turns:g} turns of the ends", "ends.*.turns"
    if free:
        why = f"no torque: the swivel at s = {free[0]:g} m lets it turn back"
    elif loose is not None:
        why = f"no effect: the catenary zone s = {loose.s_a:g} to {loose.s_b:g} m passes no torque on; a rod does"
    yield Entry(what, loose is None and not free, why, event="torque neglected" if loose else "")


def _of_ends(scene: LineScene, line: Line) -> Iterator[Entry]:
    """How both ends are held, and what has no effect there."""
    for name, end, cell in (("start", scene.ends.start, 0), ("end", scene.ends.end, -1)):
        moving = end.prescribed_motion is not None
        spring = f", by a spring of {end.spring:g} N m/rad" if end.spring < inf else ""
        if moving and _by_first_harmonic(scene, end):
            why = "an RAO is of linear waves: the vessel moves by the first harmonic (waves.kind: stream_function)"
            yield Entry(f"higher harmonics of the waves in the motion of ends.{name}", False, why)
        if _swivel_holds(scene, end, cell) and (line.spin[cell] or isinstance(scene.model, AdaptiveModel)):
            why = "its twist counts as bend there, by two bending stiffnesses or an intrinsic_curvature"
            yield Entry(f"free turning at the swivel of ends.{name}", False, why, event="ignored")
        text = f"ends.{name}: {end.kind}{spring}{', moving' if moving else ''}{_let_go(scene, name)}"
        yield Entry(text, True, f"ends.{name}")
        if not line.spin[cell] and end.acts_by_moment:
            why = "the cable ends in a catenary zone, which transmits no bending moment"
            yield Entry(f"{OF_AN_END}{name}", False, why, event="ignored")


@dataclass(frozen=True)
class Touching:
    """Which lines of a network may touch, K of them."""

    lines: tuple[int, ...]  # their numbers, in order
    meets: NDArray[np.int64]  # (K, K) whether two of them may touch, or one itself
    friction: Floats  # (K, K) coefficients
    joined: NDArray[np.int64]  # (K, 2) what ends are joined to: those of one number are beside each other
    points: NDArray[np.int64]  # (K, 2) numbers of their points

    def partners(self, number: int) -> tuple[int, ...]:
        """Numbers of the other lines that a line may touch; none where it is not among these."""
        if number not in self.lines:
            return ()
        mine = self.lines.index(number)
        return tuple(k for j, k in enumerate(self.lines) if j != mine and self.meets[mine, j])

    @property
    def pairs(self) -> list[tuple[int, int]]:
        """Numbers of lines that may touch each other, two each, in order."""
        return [(self.lines[j], self.lines[k]) for j, k in np.argwhere(np.triu(self.meets, 1)).tolist()]

    def bits(self, line: Line) -> Line:
        """The line with the bits of one that is in contact from the start."""
        more = SELF_CONTACT | (SELF_FRICTION if self.friction.any() else 0)
        return line._replace(bits=(line.bits & ~(MAY_TOUCH | SELF_FRICTION)) | more)


def touching_among(
    network: Network, scenes: Mapping[str, LineScene], pairs: Iterable[tuple[int, int]]
) -> Touching | None:
    """Lines of which these pairs, by number, touch each other; None: there is no pair.

    scenes: of the lines by name.  What is held, or moved, is one thing: ends there are beside each other.
    """
    names, found = list(network.lines), np.array([*pairs], np.int64).reshape(-1, 2)
    if not len(found):
        return None
    lines, rubs = np.unique(found).tolist(), 0.0 if network.contact is None else network.contact.friction
    meets, friction = np.zeros((len(lines), len(lines)), np.int64), np.zeros((len(lines), len(lines)))
    meets[tuple(np.searchsorted(lines, found).T)] = 1
    meets |= meets.T
    friction[meets > 0] = rubs
    for j, k in enumerate(lines):
        line, scene = network.lines[names[k]], scenes[names[k]]
        reach = self_reach(scene)
        if reach.asked or reach.may:
            meets[j, j], friction[j, j] = 1, line.contact.friction
    return Touching(tuple(lines), meets, friction, joined_ends_of(network)[lines], points_of_ends(network)[lines])


# Of the contents of a line that may come to touch others.
OTHERS = "contact with other lines"
MEETS = Entry(OTHERS, True, "from where they come near each other; contact: {between: []} switches it off")


def that_may_meet(network: Network, scenes: Mapping[str, LineScene]) -> tuple[int, ...]:
    """Numbers of the lines that touch each other from where they come near, because a scene says nothing of contact.

    scenes: of the lines by name.  They have diameters, steps are given, and no error is estimated (scene.combinations).
    """
    time = network.time
    if network.contact is not None or network.dimension == 2 or time is None or not (time.step or time.tolerance):
        return ()
    found = tuple(k for k, x in enumerate(scenes.values()) if _may_meet(x))
    return found if len(found) > 1 else ()


def passing_each_other(scene: SomeScene) -> SomeScene:
    """The same, of which no line touches another one unless the scene asks for it."""
    if len(scene.lines) == 1 or scene.contact is not None:
        return scene
    return scene.model_copy(update={"contact": LinesContact(between=())})


def _may_meet(scene: LineScene) -> bool:
    sections = [*scene.cable.sections, *(x for paid in payouts(scene) for x in paid.reel or ())]
    return scene.accuracy is None and not scene.output.errors and all(x.diameter is not None for x in sections)


def points_of_ends(network: Network) -> NDArray[np.int64]:
    """(L, 2) numbers of the points that ends of lines are at in the scene."""
    names = [*network.points]
    return np.array([[names.index(x.start), names.index(x.end)] for x in network.lines.values()], np.int64)


def joined_ends_of(network: Network) -> NDArray[np.int64]:
    """(L, 2) what the ends of lines are joined to, a free point or body by number; 0: what is held or moved."""
    free = {name: 1 + k for k, name in enumerate((*network.points, *network.bodies))}
    joined = np.zeros((len(network.lines), 2), np.int64)
    for k, line in enumerate(network.lines.values()):
        for end, point in enumerate((line.start, line.end)):
            found = network.points[point]
            if isinstance(found, FreePoint | GuidedPoint):
                joined[k, end] = free[point]
            elif isinstance(found, Fairlead) and isinstance(network.bodies[found.body], FreeBody):
                joined[k, end] = free[found.body]
    return joined
