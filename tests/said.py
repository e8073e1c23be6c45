"""A scene of one cable, or the same said as a network of one line: for tests that run both by the same line; and results."""

from __future__ import annotations

from copy import deepcopy
from typing import Any

import numpy as np
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


def kinds(result: Any) -> set[str]:
    """Kinds of all events."""
    return {event.kind for event in result.events}


def of_kind(result: Any, kind: str) -> list[Any]:
    """Events of a kind."""
    return [event for event in result.events if event.kind == kind]


def texts_of(result: Any, kind: str) -> list[str]:
    """What events of a kind say."""
    return [event.text for event in of_kind(result, kind)]


def work_put_in(result: Any) -> float:
    """The largest work of each kind, together, J."""
    names = (x for x in result.names if x.startswith("work/") and x != "work/scheme")
    return float(sum(abs(result[x]).max() for x in names))


def assert_same_results(mine: Any, its: Any) -> None:
    """All that two open results have is the same, clocks aside."""
    assert (mine.names, mine._groups) == (its.names, its._groups)
    for name in its.names:
        assert (mine[name].dtype, mine[name].shape) == (its[name].dtype, its[name].shape), name
        if name != "steps/cpu":
            np.testing.assert_array_equal(mine[name], its[name], name)
        assert (mine.dims(name), mine.units[name], mine.label(name)) == (
            its.dims(name),
            its.units[name],
            its.label(name),
        )
    for name in (*its.names, *{x.split("/")[0] for x in its.names if "/" in x}):
        assert mine.describe(name) == its.describe(name)
    one, other = ({k: v for k, v in x.attributes.items() if k != "created"} for x in (mine, its))
    assert one == other and {type(x) for x in one.values()} == {type(x) for x in other.values()}
    assert set(mine.attributes) == set(its.attributes)
    assert (mine.scene_text, mine.changes_text) == (its.scene_text, its.changes_text)
    assert (mine.events, mine.zones[:], repr(mine.mesh[0])) == (its.events, its.zones[:], repr(its.mesh[0]))
