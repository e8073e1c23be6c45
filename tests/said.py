"""A scene of one cable, or the same said as a network of one line: for tests that run both by the same line."""

from __future__ import annotations

from copy import deepcopy
from typing import Any

import pytest
import yaml

import hybrid
from hybrid.scene.read import scene_text
from tests.combinations.pairs import as_system

# Whether the scene is said as a network.
both_ways = pytest.mark.parametrize("network", [False, True], ids=["cable", "network"])
ONE = "one"  # the name of the line


def said(scene: hybrid.Scene | dict[str, Any], network: bool, first: list[float] | None = None) -> dict[str, Any]:
    """The tables of a scene in space, as of a cable or of a network; first: m, place where a free end is looked for."""
    known = scene if isinstance(scene, hybrid.Scene) else hybrid.validate_scene(deepcopy(scene))
    tables: dict[str, Any] = yaml.safe_load(scene_text(known)) | {"dimension": 3}
    tables = {"contact": {}, "initial": "equilibrium", "model": "rod"} | tables
    if not network:
        return tables
    found = as_system(tables)
    assert found is not None, "a network has no key for what the scene has"
    for point in found["points"].values():
        if first is not None and point["kind"] == "free":
            point["initial_guess"] = first
    return found


def line_of(result: Any) -> Any:
    """The result of the only line, of a network as of a cable."""
    return result.lines[ONE] if result.lines else result
