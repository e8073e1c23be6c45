"""Derivatives of equilibria of lines on free bodies, sheaves and obstacles, against differences of such equilibria."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from hybrid.designs.network_at_rest import at_rest
from hybrid.designs.numbers import changed_scene
from hybrid.scene.read import as_scene
from tests.modal.test_touching import drum, over_sheave

Tables = dict[str, Any]
ROPE = "lines.rope.sections[0]."


def two_over_sheave() -> Tables:
    """A heavier rope beside it: the sheave is as hard as both ask for."""
    tables = over_sheave(0.3, 0.5)
    rope = tables["lines"]["rope"]
    beside = [[x, y + 0.5, z] for x, y, z in rope["initial"]["points"]]
    tables["points"] |= {"c": {"position": beside[0]}, "d": {"position": beside[-1]}}
    section = rope["sections"][0] | {"mass": 3.0}
    other = rope | {"start": "c", "end": "d", "sections": [section], "initial": {"points": beside}}
    return tables | {"lines": {"rope": rope, "other": other}, "contact": {"between": []}}


SCENES: dict[str, tuple[Tables, list[str], list[str]]] = {
    "a body": (
        drum(0.3), ["rope/tension@0", "rope/position.z@3.0", "one/tension@end"],
        ["bodies.drum.mass", "bodies.drum.shape.radius", f"{ROPE}diameter"],
    ),
    "a sheave": (
        two_over_sheave(), ["rope/tension@0", "other/tension@end"],
        [f"{ROPE}mass", "obstacles.pipe.at[2]", "obstacles.pipe.radius"],
    ),
}  # fmt: skip


@pytest.mark.long
@pytest.mark.parametrize("what", SCENES)
def test_differences_of_equilibria(what: str) -> None:
    tables, of, keys = SCENES[what]
    made = as_scene(tables)
    rest = at_rest(made, of)
    for key, ours in zip(keys, rest.by(keys), strict=True):
        number = rest.number(key)
        more, less = (
            at_rest(changed_scene(made, key, number * (1.0 + x)), of, 1.0, rest.places).values for x in (1e-5, -1e-5)
        )
        theirs = (more - less) / (2e-5 * number)
        least = 1e-3 * np.abs(rest.values / number)
        assert (np.abs(ours - theirs) < 1e-5 * np.maximum(np.abs(theirs), least)).all(), (key, ours, theirs)
