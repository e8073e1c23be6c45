"""Whether contact of a line with itself is computed: as the scene asks, else wherever the line can reach itself."""

from __future__ import annotations

import math
from typing import NamedTuple

from hybrid.kernels.state.report import MAY_TOUCH, SELF_CONTACT, SELF_FRICTION
from hybrid.kernels.state.state import Line
from hybrid.scene.payout import Payout
from hybrid.scene.schema import CatenaryModel, LineScene

# Diameters of slack of the smallest loop: WINDOW of contact.self_contact_pairs less OUTER of contact.self_contact_law,
# which a plan does not import.
LOOP = 2.7 - 1.05


# Of a reason why a line touches itself: that it does where it comes near itself.
WHERE_NEAR = "from where it comes near itself"
# By runs with and without contact of plectonemes, loops and hoses: 1.7 to 21 times.
COST = "its steps take 2 to 20 times as long, and may be shorter; contact: {self: false} switches it off"


class Reach(NamedTuple):
    """asked: computed from the start; may: from when the line comes near itself; why: which, or why neither."""

    asked: bool
    may: bool
    why: str


def self_reach(scene: LineScene) -> Reach:
    """Whether contact of the line with itself is computed, by the scene alone."""
    asked = scene.contact.self
    if asked is not None:
        return Reach(asked, False, f"contact.self: {str(asked).lower()}")
    model = scene.model
    sections = [*scene.cable.sections, *(x for paid in payouts(scene) for x in paid.reel or ())]
    off = {
        "a section has no diameter": any(x.diameter is None for x in sections),
        "catenaries that stay touch each other with contact: {self: true} alone": isinstance(model, CatenaryModel),
        "dimension: 2, where contact: {self: true} alone computes it": scene.dimension == 2 or scene.contact.in_plane,
    }
    why = next((text for text, holds in off.items() if holds), "")
    if why:
        return Reach(False, False, why)
    slack, least = slack_of(scene), least_slack(scene)
    if slack <= least:
        return Reach(False, False, f"the slack of {max(slack, 0.0):.3g} m is less than {least:.3g} m, of a loop")
    much = "whatever its ends do" if math.isinf(slack) else f"a slack of {slack:.3g} m, and a loop takes {least:.3g} m"
    return Reach(False, True, f"{WHERE_NEAR}: {much}; {COST}")


def no_contact(scene: LineScene) -> str:
    """Why a line may be within itself in a run of a scene."""
    reach = self_reach(scene)
    return "parts are in each other, and contact begins where they are apart" if reach.may else reach.why


def payouts(scene: LineScene) -> list[Payout]:
    """How line is paid out, at the ends at which it is."""
    found = [getattr(end, "payout", None) for end in scene.ends.both]
    return [x for x in found if x is not None]


def slack_of(scene: LineScene) -> float:
    """Length, m, by which the line is longer than its ends are apart; infinite where an end moves or may, is set from

    outside, breaks or is let go, or it is paid out.
    """
    a, b = (end.held_position for end in scene.ends.both)
    if a is None or b is None or payouts(scene) or scene.contact.ends_are_set:
        return math.inf
    if any(x.prescribed_motion or x.release or not x.is_placed for x in scene.ends.both):
        return math.inf
    return scene.length - math.dist(a, b)


def least_slack(scene: LineScene) -> float:
    """The slack, m, that two points take to meet which are no neighbours along the line: that of the smallest loop."""
    return LOOP * min(x.diameter or math.inf for x in scene.cable.sections)


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
