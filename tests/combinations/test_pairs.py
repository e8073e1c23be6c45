"""Every two features are read together, or refused by the table of what does not combine and by nothing else."""

from __future__ import annotations

import re
from collections.abc import Callable

import pytest

from hybrid.errors import SceneError
from hybrid.scene.combinations import REFUSALS
from hybrid.scene.read import as_scene_or_system
from tests.combinations.pairs import (
    FEATURES,
    Tables,
    as_system,
    exchanged,
    pairs,
    scene_of,
    seen_by,
    turned_and_mirrored,
)

NAMES = [*((name,) for name in FEATURES), *pairs()]
REASONS = [re.escape(x.why).replace(r"\{key\}", r"[\w.\[\]]+") for x in REFUSALS]
# What one of the two asks of the other, and what is not a matter of two features that can be computed.
ASKED = (
    "tension_torque lengthens a cable that turns",  # so it has a stiffness that is a number
    "this end of the line is a catenary, which has no moment",
)


def refusal(tables: Tables) -> str:
    """Why a scene is refused; empty: it is not.  Fails where that is in no table."""
    try:
        as_scene_or_system(tables)
    except SceneError as error:
        for told in error.complaints:
            known = any(re.search(f"because {x}$", told.expected) for x in REASONS)
            assert known or any(x in told.expected for x in ASKED), error
        return str(error)
    return ""


def turned(tables: Tables) -> Tables:
    return exchanged(seen_by(turned_and_mirrored(), tables))


@pytest.mark.parametrize("said", [turned, as_system])
def test_every_pair_is_read_or_refused_by_the_table(said: Callable[[Tables], Tables | None]) -> None:
    """Also turned, mirrored and with its ends exchanged: refused so where it is as it stands, and only there."""
    read = 0
    for names in NAMES:
        scene = scene_of(*names)
        why, other = refusal(scene), said(scene)
        read += not why
        if other is not None:
            again = refusal(other)
            assert bool(why) == bool(again) or said is as_system, (names, why, again)
            assert not why or again, (names, why)  # several lines are refused what one cable is
    assert read > 0.9 * len(NAMES)
