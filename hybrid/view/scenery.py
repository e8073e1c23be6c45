"""Lines in space for a report: frames of their shapes, what colours them, and what is around.

Numbers only; the page turns them into a picture that moves.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from hybrid.store.reader import Result
from hybrid.view.curves import Kept, Store
from hybrid.view.figure import BED, BODY, INK, LEVEL, SAND, TOUCHDOWN, WATER, colour_of, prefix, short
from hybrid.view.lines import AllLines, arms_of, bodies_of, points_of
from hybrid.view.plotly_backend import colour_scale
from hybrid.view.projections import STILL, bed_heights, surfaces
from hybrid.view.zones import COLOURS, span_of

# Pale shades would be lost on white: of nine, those from here on.
_FROM_SHADE = 2
_THIN = 0.12  # of the largest extent: the least depth of the box around a flat cable, so that planes in it are visible
_OPEN = 0.45  # of the largest extent: what a thin direction is opened to where axes are stretched
PATCHES = 40  # of an uneven seabed, along x and along y
_NEAR = 1.0  # of the largest extent: a seabed or a surface farther from the cable is not drawn


def scenery(result: Result, every: AllLines, shown: dict[str, Kept], store: Store) -> dict[str, Any]:
    """Everything the moving picture needs: all lines and arms of bodies as one curve with gaps; {} without outputs."""
    frames = next(iter(shown.values())).frames
    if not len(frames):
        return {}
    box, planes, far = box_and_planes(every.as_result)
    factors = np.maximum(_OPEN * np.ptp(box, axis=0).max() / np.ptp(box, axis=0), 1.0)
    arms = [arms_of(result, name, frames) for name in bodies_of(result)]
    lines = {name: every.lines[name].position[np.ix_(frames, shown[name].points)] for name in every.colours}
    places = _with_gaps([*lines.values(), *arms])
    along = [every.lines[name].s[None, shown[name].points] for name in lines]
    s = _with_gaps(along + [np.full((1, x.shape[1]), np.nan) for x in arms])
    return {
        "times": [float(t) for t in every.times[frames]],
        "s": store.add(s[0]),
        **{axis: store.add(places[..., k]) for k, axis in enumerate("xyz")},
        "colours": _colours(every, store, shown, [x.shape[1] for x in arms]),
        "marks": _marks(result, every, store, frames),
        "planes": planes,
        "far": far,
        "box": box.T.tolist(),
        "factors": factors.tolist(),
        "ink": INK,
        "speed": speed_of(every.as_result),
    }


def _with_gaps(pieces: list[np.ndarray], between: float = np.nan) -> np.ndarray:
    """Arrays (frames, points, ...) one behind the other along their points, with a gap between them."""
    gap = np.full_like(pieces[0][:, :1], between)
    return np.concatenate([x for piece in pieces for x in (gap, piece)][1:], axis=1)


def box_and_planes(result: Result, moving: bool | None = None) -> tuple[np.ndarray, list[dict[str, Any]], list[str]]:
    """The box (2, 3) m that is drawn, the planes and obstacles in it, and texts on those that are far.

    moving: of obstacles those that move, or those that do not; None: all, where they are at last.
    """
    position = result.position
    box = np.array([position.min(axis=(0, 1)), position.max(axis=(0, 1))])
    planes = [*_planes(result, box), *({"far": False, "made": x} for x in surfaces(result, box, moving))]
    extent = np.ptp(box, axis=0)
    size = float(extent.max()) or 1.0
    room = np.maximum(0.5 * (_THIN * size - extent), 0.03 * size)  # thin directions get some depth, others a margin
    box += np.array([-room, room])
    return box, [_plane(plane, box) for plane in planes], [plane["text"] for plane in planes if plane["far"]]


def speed_of(result: Result, seconds: float = 12.0) -> float:
    """How much faster than real time the motion is played: a round number near so many seconds for all of it."""
    span = float(np.ptp(result.times)) if len(result.times) > 1 else 0.0
    if span == 0.0:
        return 1.0
    power = 10.0 ** np.floor(np.log10(span / seconds))
    return float(f"{short(max(m * power for m in (1, 2, 5) if m * power <= span / seconds * (1 + 1e-9)), 6)}")


# ---- colours --------------------------------------------------------------------------------------


def _colours(every: AllLines, store: Store, shown: dict[str, Kept], arms: list[int]) -> list[dict[str, Any]]:
    """Ways to colour the curve: by zone, tension and curvature of a line alone, else by line and tension.

    arms: points of each body's arms, behind the lines.
    """

    def along(values: list[np.ndarray], beyond: float = 0.0) -> np.ndarray:
        """Values of the lines in their order, and one for the arms."""
        rows = len(values[0])
        return _with_gaps([*values, *(np.full((rows, n), beyond, values[0].dtype) for n in arms)], beyond)

    if every.alone is not None:
        return _colours_of(every.alone, store, next(iter(shown.values())), along)
    frames = next(iter(shown.values())).frames
    named = [(every.label(name), colour) for name, colour in every.colours.items()] + [("bodies", INK)] * bool(arms)
    numbers = [np.full((len(frames), len(shown[name].points)), k) for k, name in enumerate(every.colours)]
    by_line = _by_kind("line", along(numbers, len(every.lines)), named, store)
    by_line["legend"] = [list(x) for x in dict.fromkeys(named)]
    tensions = [every.lines[name].tension[np.ix_(frames, shown[name].points)] for name in every.colours]
    tension = np.nan_to_num(along(tensions))
    factor, unit = prefix("N", float(np.abs(tension).max()))
    low, high = float(tension.min() * factor), float(tension.max() * factor)
    by_tension = {"key": "tension", "label": f"tension ({unit})", "values": store.add(tension * factor), "unit": unit}
    shades = colour_scale(COLOURS["catenary"][_FROM_SHADE:])
    return [by_line, by_tension | {"scale": shades, "low": low, "high": high or 1.0, "log": False}]


def _by_kind(key: str, numbers: np.ndarray, named: list[tuple[str, str]], store: Store) -> dict[str, Any]:
    """A way to colour the curve by the number of a name with its colour."""
    count = len(named)
    steps = [[(k + d) / count, colour] for k, (_, colour) in enumerate(named) for d in (0, 1)]
    look = {"key": key, "label": key, "values": store.add(numbers, "u1"), "scale": steps}
    return look | {"legend": [list(x) for x in named], "low": -0.5, "high": count - 0.5}


def _colours_of(
    line: Result, store: Store, shown: Kept, along: Callable[[list[np.ndarray]], np.ndarray]
) -> list[dict[str, Any]]:
    """Those of a line alone; along: values on the curve from those on the line."""
    rows = np.ix_(shown.frames, shown.points)
    kinds = list(dict.fromkeys(zone.kind for zones in line.zones for zone in zones))
    out: list[dict[str, Any]] = []
    if kinds:
        of = np.array([_kinds(line.zones[i], kinds, line.s[shown.points]) for i in shown.frames])
        out.append(_by_kind("zone", along([of]), [(kind, colour_of(kind)) for kind in kinds], store))
    straight = STILL / (float(np.ptp(line.s)) or 1.0)
    for name, shades in (("tension", COLOURS["catenary"]), ("curvature", COLOURS["rod"])):
        if name not in line:
            continue
        values = line[name]
        factor, unit = prefix(line.units[name], float(np.abs(values).max()))
        low, high, log = span_of(values * factor, bends=name == "curvature", straight=straight * factor)
        on_curve = store.add(along([values[rows] * factor]))
        out.append(
            {"key": name, "label": f"{name} ({unit})", "values": on_curve, "unit": unit}
            | {"scale": colour_scale(shades[_FROM_SHADE:]), "low": low, "high": high, "log": log}
        )
    return out


def _kinds(zones: list[Any], kinds: list[str], s: np.ndarray) -> np.ndarray:
    """Number of the kind of the zone at every point; on a joint that before it."""
    ends = np.array([zone.s_b for zone in zones[:-1]])
    order = np.array([kinds.index(zone.kind) for zone in zones])
    return order[np.searchsorted(ends + 1e-9 * s[-1], s)] if len(order) else np.zeros(len(s), int)


# ---- what is on the cable, and around it ----------------------------------------------------------


def marked_on(line: Result, outputs: Any) -> tuple[np.ndarray | None, np.ndarray | None]:
    """Places (outputs, n, 3) of what is attached to a line, and of its touchdown (nan at its ends); None: none."""
    s, attached, touchdown = line.s, None, None
    if "attached" in line and len(s) > 1:
        where = np.clip(line["attached"], s[0], s[-1])  # output points may cover a part of the cable
        attached = line.at(s=where, names=["position"])["position"][outputs]
    if "touchdown_position" in line:
        touchdown, edges = line["touchdown_position"][outputs].copy(), line["touchdown"][outputs]
        touchdown[np.abs(edges - s[[0, -1]]) <= 0.005 * (s[-1] - s[0])] = np.nan  # ends have marks of their own
    return attached, touchdown


def _marks(result: Result, every: AllLines, store: Store, frames: np.ndarray) -> list[dict[str, Any]]:
    """Points that move: bodies, what is attached to a line alone, touchdown; then points, or the ends of that line.

    The page lists all but the last two in its legend.
    """

    def mark(name: str, places: np.ndarray, symbol: str, colour: str, size: float) -> dict[str, Any]:
        moves = {axis: store.add(places[..., k]) for k, axis in enumerate("xyz")}
        return {"name": name, "symbol": symbol, "colour": colour, "size": size} | moves

    places_of = {name: result[f"bodies/{name}/position"][frames][:, None] for name in bodies_of(result)}
    marks = [mark(f"body {name}", places, "square", BODY, 6) for name, places in places_of.items()]
    if every.alone is None:
        places = np.stack([result[f"points/{n}/position"][frames] for n in points_of(result)], axis=1)
        return [*marks, mark("points", places, "circle", INK, 3), mark("", places[:, :0], "circle", INK, 1)]
    position, (attached, touchdown) = every.alone.position[frames], marked_on(every.alone, frames)
    if attached is not None:
        marks.append(mark("float, clump, body", attached, "circle", BODY, 10))
    if touchdown is not None and np.isfinite(touchdown).any():
        marks.append(mark("touchdown", touchdown, "diamond", TOUCHDOWN, 5))
    ends = mark("start", position[:, :1], "square", INK, 5), mark("end", position[:, -1:], "diamond", INK, 4)
    return [*marks, *ends]  # the ends come last, over a body that they carry


def _planes(result: Result, box: np.ndarray) -> list[dict[str, Any]]:
    """Seabed and still water; the box (2, 3) grows to hold those that are near."""
    size = float(np.ptp(box, axis=0).max()) or 1.0
    uneven = "seabed_height" in result
    found = [("seabed", result["seabed"].tolist(), SAND, BED, 0.85)] if "seabed" in result and not uneven else []
    if "surface" in result:
        found.append(("still water", [0.0, 0.0, 1.0, float(result["surface"])], WATER, LEVEL, 0.45))
    planes: list[dict[str, Any]] = [
        {"name": name, "normal": plane[:3], "offset": plane[3], "fill": fill, "line": line, "solid": solid}
        for name, plane, fill, line, solid in found
    ]
    for plane in planes:
        normal, offset = plane["normal"], plane["offset"]
        corners = [(offset - normal[0] * x - normal[1] * y) / normal[2] for x in box[:, 0] for y in box[:, 1]]
        low, high = min(corners), max(corners)
        gap = max(box[0, 2] - high, low - box[1, 2], 0.0)
        plane["far"] = gap > _NEAR * size
        plane["text"] = f"{plane['name']} at z = {short(offset / normal[2], 4)} m"
    for plane in (x for x in planes if not x["far"] and x["normal"][:2] == [0.0, 0.0]):
        level = plane["offset"] / plane["normal"][2]
        box[:, 2] = min(box[0, 2], level), max(box[1, 2], level)
    return [_uneven(result, box, size), *planes] if uneven else planes


def _uneven(result: Result, box: np.ndarray, size: float) -> dict[str, Any]:
    """A seabed of depths over the box, which grows to hold it if it is near."""
    x, y = (np.linspace(box[0, k], box[1, k], PATCHES + 1) for k in (0, 1))
    X, Y = (a.ravel() for a in np.meshgrid(x, y, indexing="ij"))
    z = bed_heights(result, X, Y)
    low, high = float(z.min()), float(z.max())
    far = max(box[0, 2] - high, low - box[1, 2], 0.0) > _NEAR * size
    if not far:
        box[:, 2] = min(box[0, 2], low), max(box[1, 2], high)
    text = f"seabed, z from {short(low, 4)} to {short(high, 4)} m"
    return {"name": "seabed", "far": far, "text": text, "surface": (X, Y, z), "fill": SAND, "line": BED, "solid": 0.85}


def _triangles() -> dict[str, list[int]]:
    """Corners of the triangles of a surface of PATCHES x PATCHES cells, and the way around its rim."""
    n = PATCHES + 1
    k = (np.arange(PATCHES)[:, None] * n + np.arange(PATCHES)).ravel()
    sides = {"i": [*k, *k], "j": [*(k + 1), *(k + n + 1)], "k": [*(k + n + 1), *(k + n)]}
    last = n * n - 1
    rim = [*range(n), *range(2 * n - 1, last + 1, n), *range(last - 1, last - n, -1), *range(last - 2 * n + 1, -1, -n)]
    return {name: [int(x) for x in value] for name, value in (sides | {"rim": rim}).items()}


def _plane(plane: dict[str, Any], box: np.ndarray) -> dict[str, Any]:
    """Its four corners in the box, and how it looks."""
    if plane["far"]:
        return {}
    if "made" in plane:
        return dict(plane["made"])
    if "surface" in plane:
        x, y, z = plane["surface"]
        look = {key: plane[key] for key in ("name", "fill", "line", "solid", "text")}
        return look | {"x": x.tolist(), "y": y.tolist(), "z": z.tolist()} | _triangles()
    normal, offset = plane["normal"], plane["offset"]
    x, y = box[[0, 1, 1, 0], 0], box[[0, 0, 1, 1], 1]
    z = (offset - normal[0] * x - normal[1] * y) / normal[2]
    look = {key: plane[key] for key in ("name", "fill", "line", "solid", "text")}
    return look | {"x": x.tolist(), "y": y.tolist(), "z": z.tolist()}
