"""Scenes to be harmed: the examples, the gallery of problems and the texts of the reader's tests, made short.

Short: little time, few cells, few outputs, so that two thousand of them take minutes.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

from ruamel.yaml import YAML

import hybrid

TESTS = Path(__file__).parents[1]
sys.path[:0] = [str(TESTS), str(TESTS / "scene")]

import problems as known
import problems_sea as sea
from scene_texts import AT_REST, EVERYTHING, EVERYTHING_ELSE, OCEAN, SEAS

CELLS, STEPS, OUTPUTS, POINTS = 16, 16, 4, 9


@cache
def all_scenes() -> dict[str, dict[str, Any]]:
    """Name -> plain data of a scene that is accepted; not to be changed."""
    found = {name: _short(data) for name, data in _whole()}
    for data in found.values():
        hybrid.validate_scene(data)
    return found


def _whole() -> Iterator[tuple[str, dict[str, Any]]]:
    for path in sorted((TESTS.parent / "examples").glob("*.yaml")):
        text = path.read_text(encoding="utf-8")
        yield path.stem, _read(re.sub(r"\bfile: (\w+\.csv)", rf"file: {path.parent}/\1", text))
    texts = {
        "everything": EVERYTHING,
        "everything else": EVERYTHING_ELSE.replace("4.0, 10.0]}", "5.0, 10.0]}"),
        "ocean": OCEAN,
        "at rest": AT_REST,
    } | SEAS
    for name, text in texts.items():
        yield name, _read(text)
    for name, scene in _gallery():
        yield name, scene.model_dump(mode="json", exclude_unset=True)


def _gallery() -> Iterator[tuple[str, hybrid.Scene]]:
    n = CELLS
    yield "sagging line", known.sagging_line(1e4, n)
    yield "taut string", known.taut_string(1e-3, 1e5, n)
    yield "along a current", known.line_along_current(1.0, n)
    yield "across a current", known.line_across_current(1.0, n)
    yield "suspension in zones", known.suspension(1.5, n)
    yield "end-loaded cantilever", known.end_loaded_cantilever([0.0, 1.0, 0.0], n)
    yield "stretched rod", known.stretched_rod(1.0, 1e3, n)
    yield "twisted taut rod", known.twisted_taut_rod(0.5, n)
    yield "hanging chain", known.hanging_chain(1, n)[0]
    yield "swinging cantilever", known.cantilever(1, n)[0]
    yield "folded chain", known.folded_chain(25, 1e-3, 0.1)
    yield "whip", known.whip(n, 1e-3, 0.1, 0.5, 0.01)
    yield "spaghetti", known.spaghetti(n, 0.01, 0.2)
    yield "sinking rod", known.sinking_rod([1.0, 0.0, 0.0], 1.0, 1.0, 0.01)
    yield "resting line", sea.resting_line(n, 1e4)
    yield "in the air", sea.in_the_air(0.1)
    yield "body in a current", sea.body_in_current(n)
    yield "floating cable", sea.floating_cable(0.5, 0.0, "catenary")
    yield "floating buoy", sea.floating_buoy("catenary")[0]
    yield "towed line", sea.towed_line(1.0, n, True)[0]
    yield "heaving body", sea.heaving_body(10.0)[0]
    yield "riding body", sea.riding_body(8.0)[0]
    yield "taut pile", sea.taut_pile(n)
    yield "dropped", sea.dropped(1e4, 100.0, 0.01)
    yield "touchdown in zones", sea.touchdown([{"catenary": 60}, {"rod": 60}, {"catenary": 130}], 0.1, bending=True)
    yield "everything at sea", sea.everything("rod", True)[0]


def _read(text: str) -> dict[str, Any]:
    return dict(YAML(typ="safe", pure=True).load(text))


def _short(data: dict[str, Any]) -> dict[str, Any]:
    """The scene with few cells, steps and outputs."""
    data = dict(data)
    model = data.get("model")
    zones = model.get("zones") if isinstance(model, dict) else None
    if zones:
        few = [{k: v for k, v in zone.items() if k not in ("cells", "ratio")} | {"cells": 6} for zone in zones]
        data["model"] = model | {"zones": few}
        data.pop("mesh", None)
    elif "nodes" not in (data.get("mesh") or {}):
        data["mesh"] = (data.get("mesh") or {}) | {"cells": CELLS}
    output = dict(data.get("output") or {})
    if "time" in data:
        time = dict(data["time"])
        time["duration"] = float(f"{time['step'] * STEPS:.6g}") if time.get("step") else time["duration"]
        data["time"] = time
        output["every"] = float(f"{time['duration'] / OUTPUTS:.6g}")
    if not isinstance(output.get("points"), list):
        output["points"] = POINTS
    return data | {"output": output}
