"""A scene of one cable, or the same said as a network of one line: for tests that run both by the same line."""

from __future__ import annotations

from copy import deepcopy
from typing import Any

import pytest
import yaml

import hybrid
from hybrid.scene.read import scene_text
from hybrid.scene.root import LINE
from tests.combinations.pairs import as_network

# Whether the scene is said as a network.
both_ways = pytest.mark.parametrize("network", [False, True], ids=["cable", "network"])
ONE = LINE  # the name of the line


def said(scene: hybrid.Scene | dict[str, Any], network: bool) -> dict[str, Any]:
    """The tables of a scene in space, as of a cable or of a network."""
    known = scene if isinstance(scene, hybrid.Scene) else hybrid.validate_scene(deepcopy(scene))
    tables: dict[str, Any] = yaml.safe_load(scene_text(known)) | {"dimension": 3}
    return as_network(tables) if network else tables


def line_of(result: Any) -> Any:
    """The result of the only line, of a network as of a cable."""
    return result.lines[ONE] if result.lines else result
