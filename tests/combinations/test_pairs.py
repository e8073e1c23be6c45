"""Every two features are read together, or refused by the table of what does not combine and by nothing else.

What is read is computed as it stands, and turned, mirrored and with its ends exchanged: the same answer.  Written down as
a network of one line it is the network that is computed.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Sequence
from functools import lru_cache

import numpy as np
import pytest
from pydantic import ValidationError

import hybrid
from hybrid.errors import ComputationError, SceneError
from hybrid.kernels.step.line_step import TOLERANCE
from hybrid.scene.combinations import REFUSALS
from hybrid.scene.read import _readable_tables, as_scene
from hybrid.scene.root import LINE, Scene, in_full
from hybrid.scene.schema import CableScene
from tests.combinations.pairs import (
    FEATURES,
    LENGTH,
    Tables,
    as_network,
    exchanged,
    pairs,
    scene_of,
    seen_by,
    turned_and_mirrored,
)

NAMES = [*((name,) for name in FEATURES), *pairs()]
REASONS = [re.escape(x.why).replace(r"\{key\}", r"[\w.\[\]]+") for x in REFUSALS]
# What one of the two asks of the other, and what is not a matter of two features that can be computed.
ASKED = ("this end of the line is a catenary, which has no moment",)


def refusal(tables: Tables) -> str:
    """Why a scene is refused; empty: it is not.  Fails where that is in no table."""
    try:
        as_scene(tables)
    except SceneError as error:
        for told in error.complaints:
            known = any(re.search(f"because {x}$", told.expected) for x in REASONS)
            assert known or any(x in told.expected for x in ASKED), error
        return str(error)
    return ""


def turned(tables: Tables) -> Tables:
    return exchanged(seen_by(turned_and_mirrored(), tables))


@pytest.mark.long
def test_every_pair_is_read_or_refused_by_the_table() -> None:
    """Also turned, mirrored and with its ends exchanged: refused so where it is as it stands, and only there."""
    read = 0
    for names in NAMES:
        scene = scene_of(*names)
        why = refusal(scene)
        read += not why
        again = refusal(turned(scene))
        assert bool(why) == bool(again), (names, why, again)
        if not why:
            assert as_scene(as_network(scene)) == in_full(as_scene(scene)), names
        elif refused_as_cable(scene):
            with pytest.raises(ValidationError):  # several lines are refused what one cable is
                Scene.model_validate(unchecked(scene))
    assert read > 0.9 * len(NAMES)


def unchecked(tables: Tables) -> CableScene:
    """The tables of a scene, each of which can be read, without what contradicts between them."""
    return CableScene.model_construct(None, **_readable_tables(tables))


def refused_as_cable(tables: Tables) -> bool:
    """Whether its tables can be read one by one: what they refuse together is asked of a network, too."""
    return {*_readable_tables(tables)} == {*CableScene.model_fields}


# --- computed ------------------------------------------------------------------------------------

# Of the energy of stretch, with soil: Newton's method converges linearly where a node turns from one branch of it to the
# other, to its tolerance and not far below. Over steps that is 7e-9 of the length, as little as positions may differ by.
IN_SOIL = 5e-6
# Of the length, at rest: Newton's method converges linearly where friction holds, and ends as at round-off.  These ways to
# say it were 2.1e-9 apart on one kind of processor and less than 1e-9 on another.
BY_FRICTION = {("waves", "seabed"): 5e-9}
# m, where cells to a layer are placed by a coarse run: what that is computed otherwise by moves nodes.
BY_CELLS = 1e-4


def answer(tables: Tables) -> hybrid.Result | str:
    """The motion of a scene, whose steps end at outputs, of a network that of its line; why it cannot be computed."""
    try:
        found = hybrid.run(tables | {"output": tables["output"] | {"exact": True}})
    except (SceneError, ComputationError) as error:
        return f"{type(error).__name__} {getattr(error, 'outcome', '')}"
    return found.lines[LINE] if found.lines else found


@lru_cache(maxsize=1)
def as_it_stands(names: tuple[str, ...]) -> hybrid.Result | str:
    """The answer of a scene with these features, which it is compared with however it is said."""
    return answer(scene_of(*names))


# Phases that begin at the start of a line and grow along it: with its ends exchanged they are others.
ONE_WAY = "vortices"
# Vortices begin by what phase the first motions have, of which Newton's tolerance is a part where a rod has a direction.
BY_TOLERANCE = {("vortices", "two stiffnesses"), ("vortices", "curved")}


def differ(names: Sequence[str], said: Callable[[Tables], Tables]) -> str:
    """How a scene said otherwise has another answer; empty: it has the same."""
    scene = scene_of(*names)
    if refusal(scene) or (said is turned and ONE_WAY in names) or tuple(names) in BY_TOLERANCE:
        return ""
    other = said(scene)
    one, two = as_it_stands(tuple(names)), answer(other)
    if isinstance(one, str) or isinstance(two, str):
        told = [x if isinstance(x, str) else "computed" for x in (one, two)]
        return "" if told[0] == told[1] else f"{names}: {told}"
    there = one.position
    if said is turned:
        there = (there @ turned_and_mirrored().T)[:, ::-1]
    apart = np.abs(two.position - there).max(axis=(1, 2)) / LENGTH
    energy = np.abs(two["energy/stretch"] - one["energy/stretch"]).max() / one["energy/stretch"].max()
    placed = "layers" in names
    rest = BY_CELLS / LENGTH if placed else BY_FRICTION.get(tuple(names), 1e-9)
    allowed = (BY_CELLS if placed else 20.0 * TOLERANCE * LENGTH) / LENGTH
    loose, in_soil = placed or "torque of tension" in names, "soil" in names
    stretch = 1e-4 if loose else IN_SOIL if in_soil else 1e-6
    shown = max(apart_by(one, two, name, said is turned) for name in SHOWN)
    good = (
        apart[0] < rest
        and apart.max() < allowed
        and energy < stretch
        and shown < (5e-2 if placed else 3e-3 if loose else 2e-5)
    )
    far = f"{apart[0]:.2g}, {apart.max():.2g} of the length, {energy:.2g} of the energy, {shown:.2g} of what is shown"
    return "" if good else f"{names}: {far}"


# What a file has of moments and extremes, which no turned axes change.
SHOWN = (
    "bending_moment",
    *(f"envelope/{x}" for x in ("tension_max", "tension_min", "bending_moment_max", "contact_max")),
)


def apart_by(one: hybrid.Result, two: hybrid.Result, name: str, exchanged: bool) -> float:
    """The largest difference of a field, as a part of its largest size; 0 where one has none."""
    if name not in one.names or name not in two.names:
        return 0.0
    a, b = one[name], two[name]
    return float(np.abs((a[..., ::-1] if exchanged else a) - b).max() / max(np.abs(a).max(), 1e-9))


def differences(names: Iterable[tuple[str, ...]], ways: Sequence[Callable[[Tables], Tables]]) -> list[str]:
    return [x for each in names for said in ways if (x := differ(each, said))]


@pytest.mark.long
def test_a_feature_computed_otherwise_is_the_same() -> None:
    assert not differences([(name,) for name in FEATURES], (turned,))


@pytest.mark.slow
@pytest.mark.parametrize("part", range(4))
def test_a_pair_computed_otherwise_is_the_same(part: int) -> None:
    """All pairs that are not refused: motion, at rest to 1e-9 of the length, energy, moments and extremes."""
    assert not differences([*pairs()][part::4], (turned,))
