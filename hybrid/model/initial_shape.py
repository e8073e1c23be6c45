"""Where a cable starts: first positions, frames without twist, and what its ends impose."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from hybrid.errors import Complaint, SceneError
from hybrid.kernels.laws.obstacles import distances
from hybrid.kernels.laws.water import body, half_cell, split
from hybrid.kernels.state.report import BODIES, DRAG, FLOW, OBSTACLES, SURFACE
from hybrid.kernels.state.state import Floats, Line, Sea, State, state_for
from hybrid.model.catenary_guess import Hanging, hang, laid, moored, trail
from hybrid.model.ends import EndConditions, EndLoad, Motion, end_load, first_director, transported
from hybrid.model.material import Material, nodes_at
from hybrid.model.sea import Surroundings
from hybrid.model.sections import SAME_PLACE, net_weight
from hybrid.scene.analysis import Equilibrium, Points, RodZone, Straight, ZonesModel
from hybrid.scene.ends import Body, Free
from hybrid.scene.motion import EndMotion
from hybrid.scene.schema import LineScene
from hybrid.scene.sea import Seabed

# A line that is longer than taut by less than this part of its length is not called slack.
HARDLY = 1e-3
DRAG_ROUNDS = 4  # of the first shape: drag follows the shape, half of it first
GIVEN = "the polyline given"  # name of a first shape that the scene gives
WAYS_OUT = 100  # places to which a node that is in an obstacle may be moved


def initial_nodes(scene: LineScene, s: Floats) -> tuple[Floats, str]:
    """First positions of the nodes (N+1, 3), m, and the shape's name; what hangs is refined by `hung`."""
    start, end = (end.held_position for end in scene.ends.both)
    initial, length = scene.initial, scene.length
    if isinstance(initial, Points):
        return along_polyline(np.array(initial.points, float), s, np.array(initial.knots)), GIVEN
    if isinstance(initial, Straight):
        direction = np.array(initial.direction, float) / np.linalg.norm(initial.direction)
        origin = initial.origin or start
        first = np.array(origin, float) if origin else np.array(end, float) - length * direction
        return first + s[:, None] * direction, "the straight line given"
    assert isinstance(initial, Equilibrium)
    if initial.points is not None:
        return along_polyline(np.array(initial.points, float), s), GIVEN
    down = net_weight(scene) >= 0.0  # a line lighter than water hangs upwards
    start, end = (end.first_position for end in scene.ends.both)
    if start and end and initial.guess == "span":
        return np.array(start) + (s / length)[:, None] * np.subtract(end, start), "the straight span"
    if start and end and initial.guess != "straight":
        return _arc(np.array(start, float), np.array(end, float), s, -1.0 if down else 1.0), "an arc"
    if initial.direction is not None:
        direction = np.array(initial.direction, float)
    else:
        tangent = scene.ends.start.held_tangent or scene.ends.end.held_tangent
        hanging = -1.0 if down == bool(start) else 1.0
        place, bed = start or end or (0.0, 0.0, 0.0), scene.environment.seabed
        lies = bed is not None and down and place[2] - bed.height(place[0], place[1]) < 1e-3 * length
        if tangent:
            direction = np.array(tangent, float)
        else:  # what is held on the bed lies on it, level
            direction = _along_bed(scene, place) if lies else np.array([0.0, 0.0, hanging])
    direction /= np.linalg.norm(direction)
    first = np.array(start, float) if start else np.array(end, float) - length * direction
    return first + s[:, None] * direction, "a straight line"


def spare_shapes(scene: LineScene, s: Floats) -> Iterator[tuple[str, Floats]]:
    """Shapes to start from where an elastic catenary leads nowhere: an arc and the straight span of two held ends."""
    start, end = (end.held_position for end in scene.ends.both)
    if start and end:
        first, span = np.array(start, float), np.subtract(end, start)
        yield "an arc", _arc(first, np.array(end, float), s, -1.0 if net_weight(scene) >= 0.0 else 1.0)
        if float(np.linalg.norm(span)) > SAME_PLACE * scene.length:
            yield "the straight span", first + (s / s[-1])[:, None] * span


def from_joint(scene: LineScene, s: Floats) -> Iterator[tuple[str, Floats]]:
    """A shape to start from where a line is clamped at one end alone: its first rod straight, the rest hanging."""
    start, end = (end.held_position for end in scene.ends.both)
    initial = scene.initial
    zones = scene.model.zones if isinstance(scene.model, ZonesModel) else ()
    tangent = (scene.ends.start if start else scene.ends.end).held_tangent
    asked = isinstance(initial, Equilibrium) and initial.guess == "auto" and not (initial.points or initial.direction)
    if not asked or bool(start) == bool(end) or not tangent or len(zones) < 2:
        return
    outer = zones[0] if start else zones[-1]
    stiff = outer.rod if isinstance(outer, RodZone) else 0.0
    outward = np.array(tangent, float) * (1.0 if start else -1.0) / np.linalg.norm(tangent)
    far = s if start else s[-1] - s
    hanging = np.array([0.0, 0.0, -1.0 if net_weight(scene) >= 0.0 else 1.0])
    along, below = np.minimum(far, stiff), np.maximum(far - stiff, 0.0)
    r = np.array(start or end, float) + along[:, None] * outward + below[:, None] * hanging
    yield "a line that hangs from its first joint", r


def _along_bed(scene: LineScene, place: Sequence[float]) -> Floats:
    """A direction along the seabed at a place, across its slope."""
    bed = scene.environment.seabed
    rise = bed.rise(place[0], place[1]) if bed is not None else (0.0, 0.0)
    if not any(rise):
        return np.array([1.0, 0.0, 0.0])
    return np.array([-rise[1], rise[0], 0.0])


def along_polyline(points: Floats, s: Floats, knots: Floats | None = None) -> Floats:
    """Nodes (N+1, 3) m over a polyline (K, 3) m, in proportion to its knots (K,), by default its own lengths."""
    if knots is None:
        knots = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    return np.column_stack([np.interp(s * knots[-1] / s[-1], knots, points[:, k]) for k in range(3)])


def dead_loads(line: Line) -> Floats:
    """Weight and full buoyancy (N+1, 3) N on the nodes of a line, which do not change as it moves."""
    loads = line.force.copy()
    if line.bits & SURFACE:
        loads[:-1, 2] += line.buoy
        loads[1:, 2] += line.buoy
        if line.bits & BODIES:
            loads[:, 2] += line.point_buoy
    return loads


def _heights_of(bed: Seabed) -> Callable[..., Any]:
    """Heights (n,) m of the bed at places x, y (n,) m."""
    return bed.height if bed.depths is None else np.vectorize(bed.height, otypes=[float])


def hung(scene: LineScene, line: Line, sea: Sea, clamp_leads: bool = True) -> Hanging | None:
    """The elastic catenary that a search for equilibrium starts from; None where it does not apply or stays slack.

    clamp_leads: whether a line that is clamped at one end and free at the other has none.

    All loads but contact and bending: weight, full buoyancy, attachments, end forces, and the drag of the
    current on the shape found so far.
    """
    initial = scene.initial
    if not isinstance(initial, Equilibrium) or initial.points or initial.guess not in ("auto", "catenary"):
        return None
    if initial.direction is not None:
        return None
    places = [end.held_position for end in scene.ends.both]
    stiff = any(end.held_tangent for end in scene.ends.both)
    if not any(places) or (
        clamp_leads and stiff and not all(places)
    ):  # what is clamped at one end starts along its clamp
        return None
    loads = dead_loads(line)
    floating = _floating_end(scene, line)
    if floating is not None:
        loads[floating, 2] -= line.point_buoy[floating]
    for k, end in ((0, scene.ends.start), (-1, scene.ends.end)):
        for load in end.loads:
            if load.what == "force":
                loads[k] += load.value
    drag = np.zeros_like(loads)
    found = None
    for _ in range(1 + DRAG_ROUNDS * bool(line.bits & FLOW)):
        if found is not None:
            drag = 0.5 * (drag + current_drag(line, sea, found.r))
        if all(places):
            first = np.array(places[0], float)
            slack = None if drag.any() or line.spin.any() else slack_on_bed(scene, line)
            found = slack or hang(loads + drag, line.h, line.ck, first, np.array(places[1], float) - first)
        else:
            held = 0 if places[0] else 1
            place, bed = np.array(places[held], float), scene.environment.seabed
            on_bed = bed is not None and place[2] - bed.height(place[0], place[1]) < 1e-3 * scene.length
            if floating is None and (bed is None or on_bed):
                found = trail(loads + drag, line.h, line.ck, held, place, on_bed)
            elif floating is None:
                assert bed is not None
                found = laid(loads + drag, line.h, line.ck, held, place, _heights_of(bed))
            else:
                lift = float(line.point_buoy[floating])
                found = moored(loads + drag, lift, sea.surface, line.h, line.ck, held, place, on_bed)
        if found is None or not _has_directions(found.r):
            return None
    if found is not None and line.bits & OBSTACLES and all(places):
        found = found._replace(r=beside_obstacles(found.r, line.s, sea))
        return found if _has_directions(found.r) else None
    return found


def beside_obstacles(r: Floats, s: Floats, sea: Sea) -> Floats:
    """Nodes (N+1, 3) m of a first shape, those in an obstacle moved out of it towards the straight span of the ends.

    A line that is pulled taut comes to the span on the side of an obstacle on which it lies; a node whose place on the
    span is in an obstacle as well stays where it is.
    """
    way = r[0] + (s / s[-1])[:, None] * (r[-1] - r[0]) - r
    inside = np.flatnonzero(distances(sea, r).min(axis=0) < 0.0)
    part = np.linspace(0.0, 1.0, 1 + WAYS_OUT)[:, None, None]
    tried = r[inside] + part * way[inside]
    free = (distances(sea, tried.reshape(-1, 3)).min(axis=0) >= 0.0).reshape(tried.shape[:2])
    first = np.where(free.any(axis=0), free.argmax(axis=0), 0)
    found = r.copy()
    found[inside] = tried[first, np.arange(inside.size)]
    return found


def _has_directions(r: Floats) -> bool:
    """Whether every cell between nodes (N+1, 3) has a length: a line of hardly any stiffness falls into a point."""
    return bool((np.linalg.norm(np.diff(r, axis=0), axis=1) > 0.0).all())  # False for what is not finite, too


def _floating_end(scene: LineScene, line: Line) -> int | None:
    """The node of a free end whose body may float at the surface."""
    if not (line.bits & SURFACE and line.bits & BODIES):
        return None
    for node, end in ((0, scene.ends.start), (-1, scene.ends.end)):
        if isinstance(end, Body) and line.point_buoy[node] > 0.0:
            return node
    return None


def current_drag(line: Line, sea: Sea, r: Floats) -> Floats:
    """Drag of the current (N+1, 3) N on a line at rest with nodes r."""
    e = np.diff(r, axis=0)
    d = tuple((e / np.linalg.norm(e, axis=1)[:, None]).T)
    u = [-np.interp(r[:, 2], sea.z, sea.current[:, k]) for k in range(3)]  # of the line relative to the water
    f = np.zeros_like(r)
    if line.bits & DRAG:
        n = line.h.size
        for side in (slice(0, n), slice(1, n + 1)):
            ut, un, square = split.py_func([x[side] for x in u], d)
            force, _, _ = half_cell.py_func(ut, un, np.abs(ut), np.sqrt(square), d, line.drag_n, line.drag_t)
            f[side] += np.column_stack(force)
    if line.bits & BODIES:
        f += np.column_stack(body.py_func(u, np.sqrt(u[0] ** 2 + u[1] ** 2 + u[2] ** 2), line.point_drag)[0])
    return f


def slack_on_bed(scene: LineScene, line: Line) -> Hanging | None:
    """A catenary that is longer than along a level bed and straight up: it hangs straight down, the rest lies slack.

    What lies carries nothing, on an arc beside the span of the ends, in chords as long as its cells.  None: the line is
    shorter, or kept in a plane.
    """
    bed, (start, end) = scene.environment.seabed, (np.array(x.held_position or (), float) for x in scene.ends.both)
    weight = -dead_loads(line)[:, 2]
    if bed is None or not bed.is_level or weight[1:-1].min() <= 0.0 or scene.dimension == 2:
        return None
    s, h, span = line.s, line.h, (end - start)[:2]
    over = s[-1] - sum(max(x[2] - bed.z, 0.0) for x in (start, end)) - float(np.hypot(*span))
    if over <= HARDLY * s[-1]:
        return None
    sunk = bed.z - np.r_[0.0, 2.0 * weight[1:-1] / (h[1:] + h[:-1]), 0.0] / bed.spring
    z = np.maximum(sunk, np.maximum(start[2] - s, end[2] - (s[-1] - s)))
    z[[0, -1]] = start[2], end[2]
    straight = (z > sunk)[:-1] & (z > sunk)[1:]
    level = np.where(straight, 0.0, np.sqrt(np.maximum(h**2 - np.diff(z) ** 2, 0.0)))
    if not level.any():  # it sinks in by more than it is too long
        return None
    r = np.column_stack([_polygon(level, span) + start[:2], z])
    r[-1] = end
    low = int(np.argmin(np.append(straight, False)))  # what hangs from the start is above it
    hung = np.where(straight, weight[1:], 0.0)
    T = np.where(np.arange(h.size) < low, hung[:low].sum() - np.cumsum(hung) + hung, np.cumsum(hung) - hung[:low].sum())
    return Hanging(r, np.where(straight, T, 0.0))


def _polygon(l: Floats, span: Floats) -> Floats:
    """Corners (N+1, 2) m on a circle from 0 to `span` (2,), m, shorter than all sides l (N,) m together."""
    low, high = 0.0, 1.0 / float(l.max())  # 1/m, half of the curvature
    across = float(np.hypot(*span))
    while low < (c := 0.5 * (low + high)) < high:
        turn = float(np.arcsin(c * l).sum())
        low, high = (low, c) if turn > np.pi or np.sin(turn) < c * across else (c, high)
    turns = 2.0 * np.arcsin(low * l)
    way = 0.5 * turns.sum() - np.cumsum(turns) + 0.5 * turns + np.arctan2(span[1], span[0])
    return np.vstack([np.zeros(2), np.cumsum(l[:, None] * np.column_stack([np.cos(way), np.sin(way)]), axis=0)])


def _arc(start: Floats, end: Floats, s: Floats, side: float) -> Floats:
    """Nodes on a circular arc of the cable's length from start to end, bulging down (side -1) or up (+1).

    A straight line when the ends are farther apart than the cable is long; a whole circle
    when they coincide.  A collinear first shape of a cable that is too long for its ends
    would leave Newton without a direction to go.
    """
    length, chord = float(s[-1]), end - start
    span = float(np.linalg.norm(chord))
    along = chord / span if span > 0.0 else np.array([1.0, 0.0, 0.0])
    bulge = np.array([0.0, 0.0, side]) - side * along[2] * along
    if np.linalg.norm(bulge) < 1e-6:  # a vertical chord: any direction across will do
        bulge = first_director(tuple(along))
    bulge /= np.linalg.norm(bulge)
    if span >= length:
        return np.asarray(start + (s / length)[:, None] * chord)
    part = min(span / length, 1.0 - 1e-12)
    half = _half_angle(part)
    radius = 0.5 * length / half
    angle = half * (2.0 * s / length - 1.0)
    x = radius * (np.sin(angle) + np.sin(half))
    y = radius * (np.cos(angle) - np.cos(half))
    return np.asarray(start + x[:, None] * along + y[:, None] * bulge)


def _half_angle(part: float) -> float:
    """Half the angle of an arc whose chord is a part of its length, rad: sin(x)/x = part, by bisection to round-off."""
    low, high = 0.0, math.pi  # a full circle when the ends coincide
    while low < (x := 0.5 * (low + high)) < high:
        low, high = (x, high) if math.sin(x) > part * x else (low, x)
    return high


def corners(scene: LineScene) -> list[float]:
    """Arc lengths at which the initial polyline turns."""
    if not isinstance(scene.initial, Points):
        return []
    knots = np.array(scene.initial.knots)
    return [float(x) for x in knots[1:-1] * scene.length / knots[-1]]


def softness(line: Line, cable: Material) -> Floats:
    """How much cells (N,) with chords of length 1 twist under a torque, against that which resists most.

    Where some resist and some do not, these take all of the twist.
    """
    stiff = cable.B[cable.piece(0.5 * (line.s[:-1] + line.s[1:])), 2]
    if not stiff.all():
        return np.asarray(stiff == 0.0, float)
    return np.asarray(stiff.max() / stiff)


def frames(scene: LineScene, e: Floats, line: Line, cable: Material) -> tuple[Floats, Floats]:
    """First directors (N+2, 3) of the start, all cells and the end, and turns (K,) rad.

    Directors are carried without twist from the start; turns are of catenary zones that a torque passes through.
    An end whose `normal` is given fixes the material frame there; a clamp without one holds the twist that the initial
    shape has.  Where both ends fix it, and a torque passes from one to the other, there is a twist to close, less than
    half a turn; it is spread over the line as one torque spreads it, and so are the `turns` by which one end is twisted
    against the other.
    """
    l = np.linalg.norm(e, axis=1)
    d = e / l[:, None]
    start, end = scene.ends.start, scene.ends.end
    first = first_director(start.held_tangent or tuple(d[0]), start.held_normal)
    tangents = np.vstack([start.held_tangent or d[0], d, end.held_tangent or d[-1]])
    carried = transported(first, tangents)
    closing, zones, turns = 0.0, line.torsion[:, :2].astype(int), np.zeros(len(line.torsion))  # turns
    t = tangents / np.linalg.norm(tangents, axis=1)[:, None]
    if end.held_tangent is not None and end.held_normal is not None:
        wanted = first_director(end.held_tangent, end.held_normal)
        closing = float(np.arctan2(np.dot(np.cross(carried[-1], wanted), t[-1]), np.dot(carried[-1], wanted)))
        closing /= 2.0 * np.pi
    if closing or start.held_turns or end.held_turns:
        n, soft = l.size, l * softness(line, cable)
        part = np.concatenate([[0.0], (np.cumsum(soft) - 0.5 * soft) / soft.sum(), [1.0]])
        rod = line.spin == 1
        turning = [i for i in nodes_at(cable.swivels, line.s) if line.element[i]]
        if turning:  # what lies beyond the last swivel takes it
            part = np.ones(n + 2)
            part[: turning[-1] + 1] = 0.0
        elif not (rod.all() or line.torsion.size):
            part = np.ones(n + 2)  # the rod at the end takes it; joints let the rest be
            part[: n - int(np.argmin(rod[::-1])) + 1] = 0.0
        whole = part if start.fixes_frame else np.ones(n + 2)  # the whole line takes the end's orientation
        turned = start.held_turns + part * scene.ends.turns + whole * closing
        turns = 2.0 * np.pi * (turned[zones[:, 1] + 1] - turned[zones[:, 0]])
        angle = 2.0 * np.pi * (turned - np.round(turned))[:, None]  # so that a full turn is none, to the last digit
        carried = carried * np.cos(angle) + np.cross(t, carried) * np.sin(angle)
    return carried, turns


def twist_by_tension(line: Line, cable: Material, state: State) -> None:
    """Turn the directors of a state, and its zones, by what its tensions make of the twist (`tension_torque`).

    Both ends hold the twist: it adds up to nothing between them; else it is that of a line without torque, from the end
    that holds it, beyond a swivel or a joint from the other one.
    """
    if not line.tension_twist.size:
        return
    soft = line.h / np.maximum(cable.B[cable.piece(0.5 * (line.s[:-1] + line.s[1:])), 2], 1e-300)
    turns = -2.0 * line.tension_twist * state.T
    holds = [held and tangent for held, tangent in zip(cable.held_twist, cable.held_tangent, strict=True)]
    swivels = [i for i in nodes_at(cable.swivels, line.s).tolist() if line.element[i]]
    loose = np.zeros(0, int) if line.torsion.size else np.flatnonzero(line.spin == 0)
    breaks = sorted([*swivels, *loose.tolist()])
    if all(holds) and not breaks:
        turns = turns - soft * turns.sum() / soft.sum()
    angle = np.cumsum(turns) - 0.5 * turns
    if breaks or (holds[1] and not holds[0]):
        angle[breaks[-1] if breaks else 0 :] -= turns.sum()
    d = state.e / np.linalg.norm(state.e, axis=1)[:, None]
    state.a1[:] = state.a1 * np.cos(angle)[:, None] + np.cross(d, state.a1) * np.sin(angle)[:, None]
    edges = np.concatenate([[0.0], angle, [0.0]])
    for z, (a, b) in enumerate(line.torsion[:, :2].astype(int)):
        state.turn[z, 0] += edges[b + 1] - edges[a]


def end_conditions(
    scene: LineScene, directors: tuple[Floats, Floats], chords: Floats, around: Surroundings
) -> EndConditions:
    """The ends of a line; directors, chords: first directors, and directions of the chords (2, 3), at start and end."""
    position, frame = np.zeros((2, 3)), np.zeros((2, 9))
    loads: list[EndLoad] = []
    motions: dict[int, Motion] = {}
    for k, end in enumerate(scene.ends.both):
        t = np.array(end.held_tangent or chords[k], float)
        t = t / np.linalg.norm(t)
        base = np.column_stack([directors[k], np.cross(t, directors[k]), t])
        frame[k] = base.ravel()
        position[k] = end.held_position or (0.0, 0.0, 0.0)
        loads += [end_load(x, k) for x in end.loads]
        motion = end.prescribed_motion
        if motion is not None:
            waves = around.waves_of_vessels, float(around.values.ramps[1]), end.held_tangent is not None
            try:
                motions[k] = EndMotion(motion, end.held_position, base, around.elevation, waves)
            except SceneError as error:  # of a table of the motion, which does not know whose it is
                where = f"ends.{('start', 'end')[k]}"
                raise SceneError([replace(x, where=f"{where}.{x.where}") for x in error.complaints]) from None
    held = [end.held_position is not None for end in scene.ends.both]
    return EndConditions(held, position, frame, loads, motions)


# Why a scene may have no equilibrium, or none that a flexible line can hold: for messages of a failed search.


def end_laid_anywhere(scene: LineScene) -> str:
    """The end that lies on a level bed in any direction as well, because nothing in the scene says which; "": none."""
    bed, fluid, initial, ends = scene.environment.seabed, scene.environment.fluid, scene.initial, scene.ends
    said = not isinstance(initial, Equilibrium) or initial.points is not None or initial.direction is not None
    if bed is None or not bed.is_level or said or len(ends.held()) != 1 or (fluid is not None and fluid.flows()):
        return ""
    (held,) = ends.held()
    other = "end" if held == "start" else "start"
    tangent = ends.named()[held].held_tangent
    pulled = any(any(x.value[:2]) for x in ends.named()[other].loads if x.what == "force")
    return "" if pulled or (tangent is not None and any(tangent[:2])) else other


def reasons_against(scene: LineScene, rod_ends: tuple[bool, bool], flexible: float = 0.0) -> list[str]:
    """Reasons against an equilibrium of the scene, in sentences; empty when nothing is known.

    rod_ends: whether the line begins and ends with a rod.  flexible: its longest cell of a catenary, m.
    """
    weight, bed = net_weight(scene), scene.environment.seabed
    on_bed = _reasons_on_bed(scene, bed, weight, rod_ends) if bed is not None else ()
    return [*on_bed, *_reasons_between_ends(scene, weight, flexible)]


def _reasons_on_bed(scene: LineScene, bed: Seabed, weight: float, rod_ends: tuple[bool, bool]) -> Iterator[str]:
    """Reasons of a line on the seabed; weight: N, in water."""
    held = scene.ends.held()
    if weight > 0.0 and len(held) == 2:
        (xa, ya, za), (xb, yb, zb) = held["start"], held["end"]
        # the longest way that can be taut: straight up from the bed, and along it
        heights = [z - bed.height(x, y) for x, y, z in (held["start"], held["end"])]
        along = math.dist((xa, ya, za - heights[0]), (xb, yb, zb - heights[1]))
        over = scene.length - along - sum(max(h, 0.0) for h in heights)
        if over > HARDLY * scene.length:
            yield (
                f"the cable is {over:.4g} m longer than from end to end along the seabed and straight up: "
                f"that much lies slack on it, where only bending and friction give it a shape"
            )
    if weight > 0.0:
        for name, end, rod in zip(("start", "end"), (scene.ends.start, scene.ends.end), rod_ends, strict=True):
            x, y, z = next(iter(held.values()), (0.0, 0.0, 0.0))
            reaches = z - bed.height(x, y) < scene.length
            if reaches and not rod and isinstance(end, Free) and end.force is None and held and not bed.friction:
                yield (
                    f"the {name} lies free on a seabed without friction: nothing keeps the cable there taut, "
                    f"and a flexible line without tension has no shape: make it a rod there"
                )
    fluid = scene.environment.fluid
    still = fluid is None or not fluid.flows()
    if bed.is_level and len(held) == 1 and still and not all(rod_ends):
        forces = [x for end in scene.ends.both for x in end.loads if x.what == "force"]
        if not any(any(x.value[:2]) for x in forces):
            yield (
                "nothing pulls the line along the seabed: what lies there has no tension, and a flexible line without "
                "tension has no shape: make it a rod there, or give a current"
            )
    if not held and not all(rod_ends):
        yield "nothing holds the cable: on the bed it has no tension, and a flexible line then has no shape"
    if not held and bed.slope is not None:
        slope = math.hypot(*bed.slope)
        least = min(bed.friction.axial, bed.friction.lateral) if bed.friction else 0.0
        if slope > least:
            yield (
                f"the seabed slopes by {math.degrees(math.atan(slope)):.3g} deg and friction holds up to "
                f"{math.degrees(math.atan(least)):.3g} deg: nothing else keeps the cable from sliding"
            )


def _reasons_between_ends(scene: LineScene, weight: float, flexible: float) -> Iterator[str]:
    """Reasons of a line that two ends hold and nothing bears between them."""
    bed, held = scene.environment.seabed, scene.ends.held()
    if weight and bed is None and len(held) == 2:
        across = math.dist(held["start"][:2], held["end"][:2])
        if across < flexible:
            yield (
                f"the ends are {across:.3g} m apart across gravity, and cells of the catenary {flexible:.3g} m long: "
                f"it folds within a cell, where it has no tension; a rod (bending_stiffness) rounds the fold, and more "
                f"cells or some axial_stiffness may help"
            )
    if not weight and not any(isinstance(x, Body) for x in (scene.ends.start, scene.ends.end)) and len(held) == 2:
        apart = math.dist(held["start"], held["end"])
        if scene.length > apart * (1.0 + HARDLY):
            yield (
                f"the cable has no weight in its surroundings and is {scene.length - apart:.4g} m longer than its "
                f"span: nothing tautens it"
            )


# The state that a computation begins with: from the first shape of a scene, or one that was found otherwise.

HUNG = "an elastic catenary under all loads"  # a first shape that has the tensions of an equilibrium, but for bending
SHARPEST_START = np.radians(150.0)


def first_state(
    scene: LineScene, line: Line, cable: Material, sea: Surroundings, scale: float, shape: Hanging | None
) -> tuple[State, str, EndConditions]:
    """The state that a computation begins with, the name of its shape, and the ends.

    scale: N, its tensions where nothing is known of them; shape: an elastic catenary, None: the first nodes of the
    scene.
    """
    start = state_for(line)
    if shape is not None:
        shape_name = HUNG
        start.r[:], start.T[:] = shape
    else:
        start.r[:], shape_name = initial_nodes(scene, line.s)
        start.T[:] = scale
    start.e[:] = np.diff(start.r, axis=0)
    if isinstance(scene.initial, Points):
        _exact_lengths(start, line.h, line.ck == 0.0, scene)
        _refuse_folds(start.e, line.s, line.spin == 1)
    if isinstance(scene.initial, Straight):  # exact chords: no round-off of the positions in the strain
        start.e[:] = line.h[:, None] * np.array(scene.initial.direction) / np.linalg.norm(scene.initial.direction)
        start.v[:] = scene.initial.velocity or (0.0, 0.0, 0.0)
    directors, chords = _put_frames(scene, start, line, cable), start.e[[0, -1]]
    ends = end_conditions(scene, directors, chords / np.linalg.norm(chords, axis=1)[:, None], sea)
    if isinstance(scene.initial, Equilibrium):  # what is not at rest begins without tension
        twist_by_tension(line, cable, start)
    return start, shape_name, ends


def other_state(scene: LineScene, r: Floats, line: Line, cable: Material, scale: float) -> State:
    """Another shape to find the equilibrium from: nodes r (N+1, 3) m, tensions of the scale (N)."""
    spare = state_for(line)
    spare.r[:], spare.T[:] = r, scale
    spare.e[:] = np.diff(r, axis=0)
    _put_frames(scene, spare, line, cable)
    if isinstance(scene.initial, Equilibrium):
        twist_by_tension(line, cable, spare)
    return spare


def _put_frames(scene: LineScene, state: State, line: Line, cable: Material) -> tuple[Floats, Floats]:
    """Give a state the directors and turns that its chords make; the directors at both ends."""
    directors, state.turn[:, 0] = frames(scene, state.e, line, cable)
    state.a1[:] = directors[1:-1]
    return directors[0], directors[-1]


def _exact_lengths(start: State, h: Floats, stiff: np.ndarray, scene: LineScene) -> None:
    """Give inextensible cells exactly their length: points carry round-off, which would be an impact at the first step.

    The gap this leaves at a held end is closed by small shifts of all chords, until both are met.
    """
    to = scene.ends.end.held_position if scene.ends.start.held_position else None
    for _ in range(50 if to else 1):
        if to:
            gap = np.array(to, float) - start.r[0] - start.e.sum(axis=0)
            start.e[:] += gap * (h / h.sum())[:, None]
        lengths = np.linalg.norm(start.e, axis=1)
        start.e[stiff] *= (h / lengths)[stiff, None]
    start.r[1:] = start.r[0] + np.cumsum(start.e, axis=0)


def _refuse_folds(chords: Floats, s: Floats, rod: np.ndarray) -> None:
    """A rod cannot start folded back onto itself: its bend has no direction there."""
    d = chords / np.linalg.norm(chords, axis=1)[:, None]
    cosine = np.einsum("ij,ij->i", d[:-1], d[1:])
    folded = np.flatnonzero((cosine < np.cos(SHARPEST_START)) & rod[:-1] & rod[1:])
    if folded.size:
        angle = np.degrees(np.arccos(cosine[folded[0]]))
        given = f"a corner of {angle:.0f} deg at s = {s[folded[0] + 1]:g} m in a rod zone"
        fix = "round it with a few points, or make the zone a catenary if it stays taut"
        raise SceneError([Complaint("initial.points", given, "corners below 150 deg, because a rod bends", fix)])
