"""From a result to the numbers that the page draws: lines in space, what is along them, and what is around."""

from __future__ import annotations

import math
from itertools import cycle
from typing import Any

import numpy as np

from hybrid.store.reader import Result
from hybrid.view.along import along
from hybrid.view.decimate import even
from hybrid.view.figure import BED, BODY, INK, colour_of
from hybrid.view.lines import LINE_COLOURS, AllLines, arms_of, bodies_of, points_of
from hybrid.view.obstacles import rings
from hybrid.view.projections import bed_heights, whole_zones
from hybrid.view.scenery import box_and_planes
from hybrid.view.summary import facts_of

DIGITS = 7  # of the largest number of a curve: more than a screen shows apart
MOST_NODES = 1201  # of a line whose cells are marked: more would be one grey bar


def around(result: Result) -> dict[str, Any]:
    """The box that is drawn, m, seabed and still water in it, and what is too far to be drawn."""
    every = AllLines(result).as_result if result.lines else result
    box, planes, far = box_and_planes(every, moving=False)
    return {"box": _plain(box.T), "planes": [plane for plane in planes if plane], "far": far}


def heads(result: Result) -> list[dict[str, Any]]:
    """What stays the same of each line: its name, colour and length (m)."""
    named = dict(zip(result.lines, cycle(LINE_COLOURS), strict=False))
    return [
        {"name": name, "colour": named.get(name, ""), "length": float(np.ptp(line.s))}
        for name, line in result.each_line()
    ]


def frames(result: Result, outputs: list[int], most: int) -> list[dict[str, Any]]:
    """Each line, point and body at some outputs; most: points along a line.

    Of a line: s, x, y, z (m), `along` (quantity -> [s, values]), zones, nodes (m).
    """
    lines = [_along_line(line, outputs, most) for _, line in result.each_line()]
    marks = _marks(result, outputs)
    one = next(x for _, x in result.each_line())
    moved = [[_plain(x) for x in rings(one, i)] for i in outputs]
    times = result.times[outputs]
    return [
        {"t": float(t), "lines": [line[k] for line in lines], "marks": marks[k], "arms": _arms(result, i) + moved[k]}
        for k, (i, t) in enumerate(zip(outputs, times, strict=True))
    ]


def facts(result: Result) -> list[dict[str, Any]]:
    """What to know first, as the report has it."""
    return [{"key": x.key, "title": x.title, "text": x.text, "weight": x.weight, "s": x.s} for x in facts_of(result)]


def _along_line(line: Result, outputs: list[int], most: int) -> list[dict[str, Any]]:
    """A line at some outputs."""
    kept = even(len(line.s), most)
    position = line.position[np.ix_(np.array(outputs, int), kept)]
    curves = {}
    for name in ("tension", "bending_moment", "curvature"):
        if name in line:
            found = along(line, name)
            s, values = found.curve(found.values[outputs])
            some = np.union1d(even(len(s), 2 * most), np.flatnonzero(np.isnan(values).any(axis=0)))
            curves[name] = s[some], values[:, some]
    out = []
    for k, i in enumerate(outputs):
        own = {name: [_plain(s), _plain(values[k])] for name, (s, values) in curves.items()}
        clearance = _clearance(line, position[k])
        if clearance is not None:
            own["clearance"] = [_plain(line.s[kept]), _plain(clearance)]
        nodes = line.mesh[i].s if "mesh/s" in line else np.zeros(0)
        out.append({
            "s": _plain(line.s[kept]), **{axis: _plain(position[k, :, j]) for j, axis in enumerate("xyz")},
            "along": own, "zones": [[z.kind, z.s_a, z.s_b, colour_of(z.kind)] for z in whole_zones(line.zones[i])],
            "nodes": _plain(nodes) if len(nodes) <= MOST_NODES else [], "cells": max(len(nodes) - 1, 0),
        })  # fmt: skip
    return out


def _clearance(line: Result, position: np.ndarray) -> np.ndarray | None:
    """Distance of places (n, 3) from the seabed, m: of a bed of depths the height above it; None without a seabed."""
    if "seabed_height" in line:
        return np.asarray(position[:, 2] - bed_heights(line, position[:, 0], position[:, 1]))
    if "seabed" in line:
        *normal, offset = line["seabed"].tolist()
        return np.asarray((position @ np.array(normal) - offset) / np.linalg.norm(normal))
    return None


def _marks(result: Result, outputs: list[int]) -> list[list[dict[str, Any]]]:
    """Points that are marked, at each output: ends, attachments and touchdown of a cable; points and bodies."""
    out: list[list[dict[str, Any]]] = [[] for _ in outputs]

    def mark(name: str, symbol: str, colour: str, places: np.ndarray) -> None:
        """places: (outputs, n, 3)"""
        for k, at in enumerate(places):
            at = at[np.isfinite(at).all(axis=1)]
            if len(at):
                out[k].append({"name": name, "symbol": symbol, "colour": colour, "at": _plain(at)})

    if result.lines:
        for name in points_of(result):
            mark(f"point {name}", "circle", INK, result[f"points/{name}/position"][outputs][:, None])
        for name in bodies_of(result):
            mark(f"body {name}", "square", BODY, result[f"bodies/{name}/position"][outputs][:, None])
        return out
    s, position = result.s, result.position[outputs]
    if "attached" in result and len(s) > 1:
        where = np.clip(result["attached"], s[0], s[-1])
        mark("float, clump, body", "circle", BODY, result.at(s=where, names=["position"])["position"][outputs])
    if "touchdown_position" in result:
        places, edges = result["touchdown_position"][outputs].copy(), result["touchdown"][outputs]
        places[np.abs(edges - s[[0, -1]]) <= 0.005 * (s[-1] - s[0])] = np.nan
        mark("touchdown", "diamond", BED, places)
    mark("start (s = 0)", "square", INK, position[:, :1])
    mark("end", "diamond", INK, position[:, -1:])
    return out


def _arms(result: Result, output: int) -> list[Any]:
    """From each body to its fairleads, as curves with gaps."""
    return [_plain(arms_of(result, name, np.array([output]))[0]) for name in bodies_of(result)]


def _plain(values: Any) -> Any:
    """Numbers as lists, rounded to what a screen shows of the largest; null for those that are not defined."""
    array = np.asarray(values, float)
    known = np.isfinite(array)
    peak = float(np.abs(array[known]).max(initial=0.0))
    if peak > 0.0:
        array = np.round(array, min(DIGITS - 1 - math.floor(math.log10(peak)), 300))
    if known.all():
        return array.tolist()
    gaps = array.astype(object)
    gaps[~known] = None
    return gaps.tolist()
