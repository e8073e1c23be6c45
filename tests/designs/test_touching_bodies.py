"""Derivatives of equilibria of lines on free bodies, sheaves and obstacles, against differences of such equilibria."""

from __future__ import annotations

from typing import Any

import pytest

from tests.designs.differences import agree
from tests.modal.test_on_obstacles import drum, over_sheave

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
    agree(*SCENES[what], 1e-5)
