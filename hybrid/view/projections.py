"""What to look at: planes of view, and obstacles in them.

Planes suit a cable's shape; so do its surroundings, and the times and points that are shown.  Obstacles are outlines in
a plane of view and surfaces in space, and may move.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from hybrid.errors import ResultError
from hybrid.store.obstacle_surfaces import (
    AROUND,
    MESH,
    PLANE,
    ROUND,
    TORUS,
    Body,
    across,
    moves_ever,
    obstacles_at,
    surface_rings,
    triangles_of,
)
from hybrid.store.reader import Result
from hybrid.store.records import Zone
from hybrid.view.curves import even
from hybrid.view.figure import STONE, STONE_EDGE, Area, Item, Line, short

Numbers = Sequence[float] | np.ndarray
STILL = 1e-6  # of the cable's extent: motion and deflection below this are round-off
_SHAPES = 9  # earlier shapes on a page; more become a blur
_NEAR = 0.4  # of the height of a shape: a seabed or a surface so close to it is shown with it, an obstacle is so far
ALONG = 0.999  # cosine of an axis with the direction of view, from which on an endless pipe is seen from its end


class View(NamedTuple):
    """A plane to look at: two unit vectors (inertial) and what to write on the axes."""

    across: np.ndarray
    up: np.ndarray
    across_label: str
    up_label: str

    def project(self, position: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return position @ self.across, position @ self.up

    @property
    def upright(self) -> bool:
        return bool(self.up[2] == 1.0)


def views_of(result: Result) -> list[View]:
    """One plane if the cable stays in one, else two projections: of a line across x and y, along it and across."""
    x, y, z = extents = np.ptp(result.position, axis=(0, 1))
    normal = min((1, 0, 2), key=lambda k: extents[k])
    if _is_flat(result.position, np.eye(3)[normal]):
        return [view_named("xyz".replace("xyz"[normal], ""))]
    level = result.position[..., :2].reshape(-1, 2)
    ahead = np.linalg.eigh(np.cov(level.T))[1][:, 1]  # the direction of the largest horizontal extent
    ahead *= math.copysign(1.0, ahead[np.argmax(np.abs(ahead))])
    sideways, angle = np.array([-ahead[1], ahead[0], 0.0]), math.degrees(math.atan2(ahead[1], ahead[0]))
    along = View(np.array([*ahead, 0.0]), np.eye(3)[2], f"horizontal, {short(angle, 3)}° from x", "z")
    if _is_flat(result.position, sideways):
        return [along]
    if z >= max(x, y) and not touches_bed(result):
        return [view_named("xz"), view_named("yz")]
    if np.ptp(level @ sideways[:2]) < 0.08 * min(x, y):  # in x-y it would be a mere line
        return [along, along._replace(up=sideways, up_label="across")]
    return [view_named("xz" if x >= y else "yz"), view_named("xy")]  # y over x is a view from below


def _is_flat(position: np.ndarray, normal: np.ndarray) -> bool:
    """Whether what leaves the plane is below 2 % of the extent, and little beside the sag and the motion in it."""
    out = position @ normal
    inside = (position - out[..., None] * normal).reshape(-1, 3)
    across = np.ptp(inside @ np.linalg.eigh(np.cov(inside.T))[1][:, 1])  # of three axes: normal, across, along
    largest, moves = np.ptp(inside, axis=0).max(), np.ptp(position, axis=0).max()
    flat, still = (max(x, STILL * largest) for x in (min(0.02 * largest, 0.1 * across), 0.2 * moves))
    return bool(np.ptp(out) <= flat and np.ptp(out, axis=0).max() <= still)


def view_named(plane: str) -> View:
    if len(plane) != 2 or not set(plane) <= set("xyz") or plane[0] == plane[1]:
        raise ResultError(f"view '{plane}' is not a plane\n    expected: two of the letters x, y, z, such as 'xz'")
    return View(*(np.eye(3)["xyz".index(c)] for c in plane), *plane)


def whole_zones(zones: list[Zone]) -> list[Zone]:
    """Zones with neighbours of one kind made one, since nothing happens between them."""
    whole: list[Zone] = []
    for zone in zones:
        if whole and whole[-1].kind == zone.kind:
            zone = zone._replace(s_a=whole.pop().s_a)
        whole.append(zone)
    return whole


def pieces_of(result: Result, output: int) -> list[tuple[str, np.ndarray]]:
    """Kinds of the zones at an output, and arc lengths along each (m): its ends and the points of the grid in it."""
    s = result.s
    zones = whole_zones(result.zones[output]) or [Zone("cable", float(s[0]), float(s[-1]))]
    return [(kind, np.array([s_a, *s[(s > s_a) & (s < s_b)], s_b])) for kind, s_a, s_b in zones]


def touches_bed(result: Result) -> bool:
    """Whether the cable ever touches a seabed."""
    return "contact" in result and "touchdown" in result and bool(np.isfinite(result["touchdown"]).any())


def free_edges(result: Result) -> list[int]:
    """First and last contact with a seabed, 0 and 1: those that there ever are, and not only where the cable ends."""
    edges, s = result["touchdown"] if "touchdown" in result else np.full((0, 2), np.nan), result.s
    known = np.isfinite(edges).all(axis=1)
    if not known.any():
        return []
    held = np.abs(edges[known] - s[[0, -1]]).max(axis=0) < 0.005 * (s[-1] - s[0])  # lies to its very end
    return [0, 1] if held.all() else [int(k) for k in np.flatnonzero(~held)]


def bed_heights(result: Result, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Heights of a seabed of depths under places x, y (n,), m: linear between the points of its grid, for pictures."""
    knots, z = (result["seabed_x"], result["seabed_y"]), result["seabed_height"]
    at, part = [], []
    for k, place in zip(knots, (x, y), strict=True):
        i = np.clip(np.searchsorted(k, place, "right") - 1, 0, len(k) - 2)
        at.append(i)
        part.append((place - k[i]) / (k[i + 1] - k[i]))
    (i, j), (a, b) = at, part
    low, high = (1.0 - b) * z[i, j] + b * z[i, j + 1], (1.0 - b) * z[i + 1, j] + b * z[i + 1, j + 1]
    return np.asarray((1.0 - a) * low + a * high)


def bed_profile(view: View, result: Result) -> np.ndarray | None:
    """A seabed of depths under the cable, in an upright view: (n, 2) across and height, with as many points beyond."""
    if "seabed_height" not in result or not view.upright:
        return None
    place = result.position[-1]
    across = place @ view.across
    order = np.argsort(across)
    place, span = place[order], max(float(np.ptp(across)), 1e-9)
    if float(np.ptp(across)) < 1e-6 * (1.0 + float(np.abs(across).max())):
        place = place[[0, -1]]
    beyond = span * np.linspace(0.0, 1.0, 31)[1:, None] * view.across
    path = np.vstack([place[0] - beyond[::-1], place, place[-1] + beyond])
    return np.column_stack([path @ view.across, bed_heights(result, path[:, 0], path[:, 1])])


def bed_in(view: View, result: Result) -> tuple[float, float] | None:
    """The seabed in an upright view, where the cable lies: height at the origin, and rise per metre across."""
    if "seabed" not in result or not view.upright:
        return None
    *normal, offset = result["seabed"]
    out, last = np.cross(view.across, view.up), result.position[-1]
    lying = result["contact"][-1] > 0.0 if "contact" in result else np.zeros(len(last), bool)
    depth = float((last[lying] if lying.any() else last).mean(axis=0) @ out)  # of the bed, behind the paper
    return (offset - depth * (normal @ out)) / normal[2], -(normal @ view.across) / normal[2]


def extent_in(view: View, result: Result) -> np.ndarray:
    """What is in view, low and high, across and up (2, 2): the cable, and what is near to it.

    These are obstacles and bodies where they are at some outputs, a seabed, a surface.
    """
    box = line_extent_in(view, result)
    room, out = _NEAR * float(np.ptp(box, axis=1).max()), np.cross(view.across, view.up)
    far = box + room * np.array([[-1.0, 1.0]])
    for body in (x for k in even(len(result.position), _SHAPES) for x in obstacles_at(result, int(k))):
        endless = not np.isfinite(body.half) and abs(float(body.axis @ out)) < ALONG
        if body.kind == PLANE or endless:
            continue
        points = body.points if body.kind == MESH else surface_rings(body, 0.0, 0.0).reshape(-1, 3)
        seen = np.array([[x.min(), x.max()] for x in view.project(points)])
        if (seen[:, 1] > far[:, 0]).all() and (seen[:, 0] < far[:, 1]).all():
            seen = np.clip(seen, far[:, :1], far[:, 1:])
            box = np.column_stack([np.minimum(box[:, 0], seen[:, 0]), np.maximum(box[:, 1], seen[:, 1])])
    return box


def line_extent_in(view: View, result: Result) -> np.ndarray:
    """The same of the cable, and a seabed or a surface near to it, alone."""
    across, up = view.project(result.position)
    box = np.array([[across.min(), across.max()], [up.min(), up.max()]])
    room = _NEAR * max(np.ptp(box[1]), 0.3 * np.ptp(box[0]))
    bed = bed_in(view, result)
    if bed is not None and np.min(up - bed[0] - bed[1] * across) < room:
        box[1, 0] = min(box[1, 0], max(bed[0] + min(bed[1] * box[0]), box[1, 0] - room)) - 0.1 * room  # a strip of sand
    if "surface" in result and view.upright and box[1, 0] < float(result["surface"]) < box[1, 1] + room:
        box[1, 1] = max(box[1, 1], float(result["surface"]) + 0.1 * room)  # and of air
    return box


def magnification(view: View, result: Result) -> tuple[float, float]:
    """Factors across and up: 1, but a round number that opens the smaller one where it would be a mere line."""
    across, up = np.ptp(extent_in(view, result), axis=1).tolist()
    ratio = min(across, up) / max(across, up, 1e-300)
    if not STILL < ratio < 0.08:  # straighter than that is straight; less straight needs no help
        return 1.0, 1.0
    most = 0.32 / ratio  # about the shape of the flattest panel
    power = 10.0 ** math.floor(math.log10(most))
    factor = power * max(m for m in (1, 1.5, 2, 3, 4, 5, 7) if m * power <= most)
    return (1.0, factor) if up < across else (factor, 1.0)


# Nodes between which crossings of a shape in a picture are looked for: pairs of these are a million.
_CROSSING_POINTS = 1000


def not_to_scale(view: View, result: Result) -> str:
    """What a picture that opens one direction does to shapes, in words; "" where it has equal scales.

    A line that turns back, such as an S, then looks like a loop where it is none: whether it crosses itself in this
    plane is said.
    """
    factors = magnification(view, result)
    if factors == (1.0, 1.0):
        return ""
    wide = factors[0] > 1.0
    label, other = (view.across_label, view.up_label)[:: 1 if wide else -1]
    text = f"not to scale: {label.split(',')[0]} is drawn {max(factors):g} times as large as {other.split(',')[0]}"
    along = view.project(result.position[-1])[1 if wide else 0]
    back = np.diff(along)[np.sign(np.diff(along)) == -np.sign(along[-1] - along[0])]
    if abs(float(back.sum())) <= STILL * max(float(np.ptp(along)), 1e-300):
        return text
    crosses = _crosses_itself(np.column_stack(view.project(result.position[-1])))
    return f"{text}; the line turns back and {'crosses' if crosses else 'does not cross'} itself in this view"


def _crosses_itself(shape: np.ndarray) -> bool:
    """Whether a polyline (n, 2) crosses itself."""
    p = shape[even(len(shape), _CROSSING_POINTS)]
    step = np.diff(p, axis=0)

    def side(a: np.ndarray, along: np.ndarray, b: np.ndarray) -> np.ndarray:
        return np.sign(along[..., 0] * (b - a)[..., 1] - along[..., 1] * (b - a)[..., 0])

    begin, way = p[:-1, None], step[:, None]
    apart = side(begin, way, p[None, :-1]) * side(begin, way, p[None, 1:]) < 0.0  # of each chord, ends of the others
    k = np.arange(len(step))
    return bool((apart & apart.T & (np.abs(k[:, None] - k) > 1)).any())


def aspect_of(views: list[View], result: Result) -> float:
    """Width over height as drawn; the geometric mean of the views; of a straight line, something large or small."""
    sizes = np.array([np.ptp(extent_in(v, result), axis=1) * magnification(v, result) for v in views])
    sizes += 1e-9 * sizes.max() + 1e-300
    return float(np.exp(np.mean(np.log(sizes[:, 0] / sizes[:, 1]))))


def telling_times(result: Result) -> np.ndarray:
    """Times of the earlier shapes that show the motion: the first, then always the one farthest from all taken.

    Even steps of time show nothing of a quick relaxation, and even steps of time or of
    distance travelled fall on the same phases of a periodic motion; this finds its extremes.
    """
    if len(result.times) < 2:
        return np.zeros(0)
    position = result.position[:, :: 1 + len(result.s) // 50]  # 50 points tell shapes apart
    least = STILL * float(np.max(np.ptp(position.reshape(-1, 3), axis=0)))
    away = np.linalg.norm(position - position[-1], axis=2).max(axis=1)
    taken: list[int] = []
    while len(taken) < _SHAPES and away.max() > least:
        taken.append(int(away.argmax()) if taken else 0)
        away = np.minimum(away, np.linalg.norm(position - position[taken[-1]], axis=2).max(axis=1))
    return np.sort(result.times[taken])


def history_points(result: Result, history: Numbers | None) -> np.ndarray:
    """By default the middle and the ends, or where an end is held the quarter point beside it; on a seabed the ends."""
    moves = np.ptp(result.position, axis=0).max(axis=1)
    start, end = (bool(m <= 1e-3 * moves.max()) and not touches_bed(result) for m in moves[[0, -1]])  # held
    quarters = np.linspace(result.s[0], result.s[-1], 5)[[start, 2, 4 - end]]
    given = result["history"] if history is None and "history" in result else history
    points = np.asarray(quarters if given is None else given, dtype=float)
    if points.ndim != 1 or len(points) == 0:
        raise ResultError(f"history = {history!r} is no list of arc lengths\n    try:      history=[0.0]")
    return points


# Beyond the picture, in sizes of that, endless obstacles go on.
BEYOND = 0.2
MANY = 5000  # triangles of a mesh that is drawn as its hull in a plane


def outlines(result: Result, view: View, output: int, moving: bool | None = None) -> list[Item]:
    """Obstacles in a plane of view: filled outlines of round ones, and what is behind planes seen from the side."""
    items: list[Item] = []
    box = line_extent_in(view, result)
    size = float(np.ptp(box, axis=1).max()) or 1.0
    for body in obstacles_at(result, output, moving):
        if body.kind == PLANE:
            corners = _half_plane(body, view, box, size)
        elif body.kind == MESH and len(body.triangles) <= MANY:
            x = np.column_stack(view.project(body.points))
            front, around = turned_to_eye(x, body.triangles)
            items.append(Area(x[body.triangles[front]], STONE, "obstacle"))
            gaps = np.array([[*x[[a, b]], [np.nan, np.nan]] for a, b in around]).reshape(-1, 2)
            items.append(Line(gaps[:, 0], gaps[:, 1], colour=STONE_EDGE, width=0.8))
            continue
        elif body.kind == MESH:
            corners = hull(np.column_stack(view.project(body.points)))
        else:
            at = float((result.position[output].mean(axis=0) - body.place) @ body.axis)
            rings = surface_rings(body, at - 3.0 * size, at + 3.0 * size)
            x, y = view.project(rings.reshape(-1, 3))
            if body.kind == TORUS:  # what is seen through its hole stays
                flat = np.stack([x, y], axis=-1).reshape(len(rings), AROUND, 2)
                after = np.roll(flat, -1, axis=1)
                faces = np.stack([flat[:-1], after[:-1], after[1:], flat[1:]], axis=2)
                items.append(Area(faces.reshape(-1, 4, 2), STONE, "obstacle"))
                continue
            corners = hull(np.column_stack([x, y]))
        if corners is not None:
            items.append(Area(corners[None], STONE, "obstacle"))
            edge = corners if body.kind != PLANE else corners[:2]
            closed = np.vstack([edge, edge[:1]]) if body.kind != PLANE else edge
            items.append(Line(closed[:, 0], closed[:, 1], colour=STONE_EDGE, width=0.8))
    return items


def _half_plane(body: Body, view: View, box: np.ndarray, size: float) -> np.ndarray | None:
    """Corners (4, 2) of what is behind a plane, its edge first; None: it is not seen from the side."""
    out = np.cross(view.across, view.up)
    if abs(float(body.axis @ out)) > 0.05:
        return None
    normal = np.array(view.project(body.axis))
    normal /= np.linalg.norm(normal)
    at, along = np.array(view.project(body.place)), np.array([-normal[1], normal[0]])
    at = at + ((box.mean(axis=1) - at) @ along) * along
    ends = at + 30.0 * size * np.array([-along, along])
    return np.vstack([ends, ends[::-1] - 30.0 * size * normal])


def hull(points: np.ndarray) -> np.ndarray:
    """The convex hull (m, 2) of points (n, 2), counter-clockwise; of points on one line the ends.

    By its own lines: ConvexHull of scipy refuses points on one line, as of a flat surface seen from its edge.
    """
    order = points[np.lexsort(points.T[::-1])]

    def chain(rows: np.ndarray) -> list[np.ndarray]:
        kept: list[np.ndarray] = []
        for p in rows:
            while len(kept) > 1 and _left(kept[-2], kept[-1], p) <= 0.0:
                kept.pop()
            kept.append(p)
        return kept[:-1]

    return np.array(chain(order) + chain(order[::-1]))


def _left(a: np.ndarray, b: np.ndarray, c: np.ndarray) -> float:
    return float((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]))


# ---- in space -----------------------------------------------------------------------------------------


def rings(result: Result, output: int) -> list[np.ndarray]:
    """Curves (n, 3) m on the obstacles that move, where they are at an output: along them, and around their ends."""
    found = []
    size = float(np.ptp(result.position[output], axis=0).max()) or 1.0
    for body in obstacles_at(result, output, moving=True):
        if body.kind == PLANE:
            p, q = across(body.axis)
            found.append(body.place + size * np.array([-p - q, p - q, p + q, q - p, -p - q]))
            continue
        if body.kind == MESH:
            found += [body.points[list(pair)] for pair in sharp_edges(body.points, body.triangles)]
            continue
        at = float((result.position[output].mean(axis=0) - body.place) @ body.axis)
        x = surface_rings(body, at - size, at + size)
        found += [*(np.vstack([ring, ring[:1]]) for ring in (x[0], x[len(x) // 2 - 1], x[len(x) // 2], x[-1]))]
        found += [x[:, k] for k in range(0, AROUND, AROUND // 8)]
    return found


def surfaces(result: Result, box: np.ndarray, moving: bool | None = None, output: int = -1) -> list[dict[str, Any]]:
    """Triangles of obstacles for a picture in space whose box (2, 3) m grows to hold those that are near."""
    found = obstacles_at(result, output, moving)
    size = float(np.ptp(box, axis=0).max()) or 1.0
    for body in found:
        if body.kind > ROUND:
            x = body.points if body.kind == MESH else surface_rings(body, 0.0, 0.0).reshape(-1, 3)
            low, high = x.min(axis=0), x.max(axis=0)
        elif body.kind == ROUND:
            p = np.clip(body.place, *box) if not np.isfinite(body.half) else body.place
            reach = body.radius + (body.half if np.isfinite(body.half) else 0.0)
            if np.isfinite(body.half):
                low, high = p - reach, p + reach
            else:
                wide = body.radius * np.sqrt(1.0 - body.axis**2)
                low, high = body.place - wide, body.place + wide
                low, high = (np.where(np.abs(body.axis) > 0.9, p, x) for x in (low, high))
        if body.kind != PLANE and np.all(high > box[0] - size) and np.all(low < box[1] + size):
            box[0], box[1] = np.minimum(box[0], low), np.maximum(box[1], high)
    when = f" at t = {short(float(result.times[output]), 4)} s"
    return [_triangles(body, box, when if moves_ever(result, body.name) else "") for body in found]


def _triangles(body: Body, box: np.ndarray, when: str) -> dict[str, Any]:
    """The surface of an obstacle as triangles, as pictures in space take planes."""
    x, triangles = triangles_of(body, box)
    look = {"name": body.name, "fill": STONE, "line": STONE_EDGE, "solid": 0.7, "text": f"obstacle {body.name}{when}"}
    look |= {axis: x[:, k].tolist() for k, axis in enumerate("xyz")}
    if body.kind == PLANE:
        return look
    n = len(x) // AROUND
    circles = [[*range(at, at + AROUND), at] for at in (0, n // 2 * AROUND, (n - 1) * AROUND)]
    rim: list[int | None] = [k for circle in circles for k in circle]
    if body.kind == MESH:  # edges, with a gap behind each
        rim = [k for pair in sharp_edges(x, triangles) for k in (*pair, None)]
    return look | {name: triangles[:, k].tolist() for k, name in enumerate("ijk")} | {"rim": rim}


# Edges of surfaces of triangles, for pictures: those that are sharp, those between what is seen and what is not.

# Cosine of how far a surface turns at an edge that is drawn.
SHARP = np.cos(np.radians(30.0))

Edge = tuple[int, int]


def edges_of(triangles: np.ndarray) -> list[tuple[Edge, int, int]]:
    """Edges of a closed surface (m, 3): numbers of both corners, and of the triangles beside them."""
    at: dict[Edge, int] = {}
    for k, (a, b, c) in enumerate(triangles.tolist()):
        at |= {(a, b): k, (b, c): k, (c, a): k}
    return [((a, b), k, at[b, a]) for (a, b), k in at.items() if a < b and (b, a) in at]


def turned_to_eye(x: np.ndarray, triangles: np.ndarray) -> tuple[np.ndarray, list[Edge]]:
    """Which triangles (m,) of corners x (n, 2) in a plane of view are seen from in front, and the edges around them."""
    a, b, c = (x[triangles[:, k]] for k in range(3))
    front = (b - a)[:, 0] * (c - a)[:, 1] > (b - a)[:, 1] * (c - a)[:, 0]
    return front, [pair for pair, first, second in edges_of(triangles) if front[first] != front[second]]


def sharp_edges(points: np.ndarray, triangles: np.ndarray) -> list[Edge]:
    """Edges at which a surface of corners (n, 3) turns much."""
    a, b, c = (points[triangles[:, k]] for k in range(3))
    n = np.cross(b - a, c - a)
    n /= np.linalg.norm(n, axis=1)[:, None]
    return [pair for pair, first, second in edges_of(triangles) if n[first] @ n[second] < SHARP]
