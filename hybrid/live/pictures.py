"""What a text of a scene comes to: its equilibrium as numbers to draw and what it would compute, or what is wrong."""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import suppress
from itertools import cycle
from typing import Any

import numpy as np

from hybrid.errors import Complaint, ComputationError, HybridError, SceneError
from hybrid.kernels.machine.compile import is_warm
from hybrid.model.network import NetworkResolution
from hybrid.model.plan import plan
from hybrid.model.resolution import model_is_free
from hybrid.scene.read import located_in, read_text
from hybrid.scene.root import Scene
from hybrid.simulation.case import CaseAtRest
from hybrid.simulation.first_use import compile_beside, kernels_of
from hybrid.store.format import MemoryTarget
from hybrid.store.reader import Result, written_result
from hybrid.view.curves import along, even
from hybrid.view.figure import BED, BODY, INK, colour_of
from hybrid.view.lines import LINE_COLOURS, AllLines, arms_of, bodies_of, box_and_planes, marked_on, points_of
from hybrid.view.projections import bed_heights, rings, whole_zones
from hybrid.view.summary import facts_of, length_of

# Points along a line in a picture: one for each cell, as far as a screen shows them apart.
LEAST_POINTS, MOST_POINTS = 101, 401


def picture_of(text: str, file: str, compiling: Callable[[], None]) -> tuple[dict[str, Any], Result | None]:
    """What the page shows for a text, and the result of its equilibrium.

    file: the name of the scene file, in whose folder motion files are looked for.  compiling: called before kernels
    are compiled, which takes long.  A refused text, or one without an equilibrium, has `problems` and no `frame`.
    """
    out: dict[str, Any] = {"problems": [], "notes": []}
    try:
        scene, renamed = read_text(text, file)
        out["notes"] = [{"line": key.line, "title": "renamed", "text": str(key)} for key in renamed]
        out["title"], out["moves"] = scene.title or "", scene.time is not None
        made = plan(scene)
        out["plan"] = _plan_rows(scene, made)
        if not is_warm(kernels_of(scene, True)):  # what an equilibrium calls is compiled once on a machine
            compiling()
            compile_beside(scene, static=True)
        result = equilibrium(scene, made)
    except SceneError as error:
        out["problems"] = [_refused(complaint) for complaint in located_in(error, text, file).complaints]
        return out, None
    except ComputationError as error:
        out["problems"] = [_failed(error, text, file)]
        return out, None
    except HybridError as error:
        out["problems"] = [{"line": None, "where": "scene", "text": str(error)}]
        return out, None
    points = LEAST_POINTS if len(result.lines) > 10 else MOST_POINTS
    out |= around(result)
    out |= {"heads": heads(result), "frame": frames(result, [0], points)[0]}
    return out | {"facts": facts(result)}, result


def equilibrium(scene: Scene, made: Any) -> Result:
    """The equilibrium with the cells of a first run: no coarser ones to estimate its error, no pre-run for its mesh.

    It is looked for as `hybrid static` does, from the scene alone: from the last picture Newton's method might find
    another one, where there are several.
    """
    update: dict[str, Any] = {"errors": False}
    if isinstance(scene.output.points, int):
        cells = max(sum(line.cells) for _, line in made.each_line())
        update["points"] = min(max(cells + 1, LEAST_POINTS), MOST_POINTS)
    case = CaseAtRest(scene.model_copy(update={"output": scene.output.model_copy(update=update)}))
    case.scene = case.with_models({name: "rod" for name, x in case.lines.items() if model_is_free(x, moves=False)})
    target = MemoryTarget()
    case.record(NetworkResolution.of(case.lines), target)
    return written_result(target)


def _refused(complaint: Complaint) -> dict[str, Any]:
    """A complaint as the page shows it."""
    text = f"expected: {complaint.expected}" + (f"\ntry: {complaint.fix}" if complaint.fix else "")
    found = {"line": complaint.line, "column": complaint.column, "where": complaint.where}
    return found | {"given": complaint.value, "text": text}


def _failed(error: ComputationError, text: str, file: str) -> dict[str, Any]:
    """An equilibrium that was not found, at the line of `initial`, or of several lines at that of `lines`."""
    for where in ("initial", "lines"):
        place = located_in(SceneError([Complaint(where, "", "")]), text, file).complaints[0]
        if place.line is not None and text.splitlines()[place.line - 1].lstrip().startswith(f"{where}:"):
            break
    s = "" if error.s is None else f" (s = {error.s:.6g} m)"
    what = f"no equilibrium: {error.outcome.cause}{s}"
    detail = error.detail.strip().splitlines()
    remedy = str(error).splitlines()[-1].strip()
    lines = [*(f"detail: {x.strip()}" for x in detail[:1]), remedy]
    return {"line": place.line, "column": place.column, "where": "equilibrium", "given": what, "text": "\n".join(lines)}


def _plan_rows(scene: Any, made: Any) -> list[list[str]]:
    """What a run would compute, as rows of a name and a text."""
    rows: list[list[str]] = []
    for name, line in made.each_line():
        if name:
            kinds = ", ".join(dict.fromkeys(zone.kind for zone in line.zones))
            rows.append([f"line {name}", f"{kinds}, {sum(line.cells)} cells"])
        else:
            chosen = [["model", "the cheapest, by a pre-run: " + ", ".join(kind for kind, _ in line.choice)]]
            rows += chosen * bool(line.choice) + _zone_rows(line)
    if name:
        rows.append(["in all", f"{made.cells} cells, {made.unknowns} unknowns"])
    if scene.time is None:
        rows.append(["time", "no motion (no table `time`)"])
    else:
        rows.append(["time", f"{scene.time.duration:.6g} s, {made.steps} steps; about {made.seconds:.2g} s to compute"])
    return rows


def _zone_rows(made: Any) -> list[list[str]]:
    cells = sum(made.cells)
    if made.base_cells is not None:
        rows = [["zones", "adaptive: rod where a criterion asks for it, catenary elsewhere"]]
        rows.append(["cells", f"{made.base_cells} as catenary, {cells} if all is rod ({made.unknowns} unknowns)"])
        return rows
    rows = [
        [zone.kind, f"s = {zone.s_a:.6g} to {zone.s_b:.6g} m, {n} cells"]
        for zone, n in list(zip(made.zones, made.cells, strict=True))[:6]
    ]
    if len(made.zones) > 6:
        rows.append(["..", f"and {len(made.zones) - 6} more zones"])
    rows.append(["cells", f"{cells} ({made.unknowns} unknowns)"])
    return rows


# From a result to the numbers that the page draws: lines in space, what is along them, and what is around.

DIGITS = 7  # of the largest number of a curve: more than a screen shows apart
MOST_NODES = 1201  # of a line whose cells are marked: more would be one grey bar


def around(result: Result) -> dict[str, Any]:
    """The box that is drawn, m, seabed and still water in it, and what is too far to be drawn."""
    box, planes, far = box_and_planes(AllLines(result).as_result, moving=False)
    return {"box": _plain(box.T), "planes": [plane for plane in planes if plane], "far": far}


def heads(result: Result) -> list[dict[str, Any]]:
    """What stays the same of each line: its name, colour and from and to which arc length (m) it is drawn."""
    named = dict(zip(result.lines, cycle(LINE_COLOURS), strict=False))
    return [
        {
            "name": name,
            "colour": named.get(name, ""),
            "begin": min(float(line.s[0]), 0.0),
            "length": max(float(line.s[-1]), length_of(line)),
        }
        for name, line in result.each_line()
    ]


def frames(result: Result, outputs: list[int], most: int) -> list[dict[str, Any]]:
    """Each line, point and body at some outputs; most: points along a line.

    Of a line: s, x, y, z (m), `along` (quantity -> [s, values]), zones, nodes (m).
    """
    lines = [_along_line(line, outputs, most) for _, line in result.each_line()]
    marks = _marks(result, outputs)
    one = next(x for _, x in result.each_line())
    arms = [arms_of(result, name, np.array(outputs, int)) for name in bodies_of(result)]
    curves = [[_plain(x) for x in (*(arm[k] for arm in arms), *rings(one, i))] for k, i in enumerate(outputs)]
    return [
        {"t": float(t), "lines": [line[k] for line in lines], "marks": marks[k], "arms": curves[k]}
        for k, t in enumerate(result.times[outputs])
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
    out, meshes = [], None
    with suppress(KeyError):  # it is of an earlier program
        meshes = line.mesh
    for k, i in enumerate(outputs):
        own = {name: [_plain(s), _plain(values[k])] for name, (s, values) in curves.items()}
        clearance = _clearance(line, position[k])
        if clearance is not None:
            own["clearance"] = [_plain(line.s[kept]), _plain(clearance)]
        nodes = meshes[i].s if meshes is not None else np.zeros(0)
        shape = {"s": _plain(line.s[kept])} | {x: _plain(position[k, :, j]) for j, x in enumerate("xyz")}
        zones = [[z.kind, z.s_a, z.s_b, colour_of(z.kind)] for z in whole_zones(line.zones[i])]
        mesh = {"nodes": _plain(nodes) if len(nodes) <= MOST_NODES else [], "cells": max(len(nodes) - 1, 0)}
        out.append(shape | {"along": own, "zones": zones} | mesh)
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
    """Points and bodies, at each output; attachments and touchdown of a line alone, and its ends without points."""
    out: list[list[dict[str, Any]]] = [[] for _ in outputs]

    def mark(name: str, symbol: str, colour: str, places: np.ndarray) -> None:
        """Add markers of a name at places (outputs, n, 3)."""
        for k, at in enumerate(places):
            at = at[np.isfinite(at).all(axis=1)]
            if len(at):
                out[k].append({"name": name, "symbol": symbol, "colour": colour, "at": _plain(at)})

    points = points_of(result)
    for name in points:
        mark(f"point {name}", "circle", INK, result[f"points/{name}/position"][outputs][:, None])
    for name in bodies_of(result):
        mark(f"body {name}", "square", BODY, result[f"bodies/{name}/position"][outputs][:, None])
    line, *others = (x for _, x in result.each_line())
    if others:
        return out
    position, (attached, touchdown) = line.position[outputs], marked_on(line, outputs)
    if attached is not None:
        mark("float, clump, body", "circle", BODY, attached)
    if touchdown is not None:
        mark("touchdown", "diamond", BED, touchdown)
    zones = line.zones[outputs[0]]
    if not points and line.s[0] <= zones[0].s_a:
        mark("start (s = 0)", "square", INK, position[:, :1])
    if not points and line.s[-1] >= zones[-1].s_b * (1.0 - 1e-9):
        mark("end", "diamond", INK, position[:, -1:])
    return out


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
