"""Pictures of several lines: shapes in one frame with points and bodies, what is along each, over time, and in space.

A panel of shapes asks the functions for one cable for its frame, with all lines as one set of places.
In space there are frames of their shapes, what colours them, and what is around: numbers only, which the page of a
report turns into a picture that moves.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from functools import cached_property
from itertools import cycle
from typing import Any, cast

import numpy as np

from hybrid.store.reader import Result
from hybrid.view.curves import Kept, Store, along, even, worst, worst_first
from hybrid.view.figure import (
    BED,
    BODY,
    INK,
    LEVEL,
    SAND,
    TOUCHDOWN,
    WATER,
    Axis,
    Band,
    Item,
    Line,
    Marks,
    Page,
    Panel,
    Text,
    colour_of,
    earlier_grey,
    prefix,
    short,
)
from hybrid.view.panels import framed, page_of, sea
from hybrid.view.plotly_backend import colour_scale
from hybrid.view.projections import (
    STILL,
    Numbers,
    View,
    aspect_of,
    bed_heights,
    outlines,
    surfaces,
    telling_times,
    view_named,
    views_of,
)
from hybrid.view.zones import COLOURS, span_of

LINE_COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#8C6D31", "#000000", "#7F7F7F")
OTHERS = "#9FB1BB"  # of lines without a colour of their own
MOST_NAMED = 12  # lines in a legend: more would hide the picture
WORST = 6  # of more lines: so many, the worst, have a colour and a name
BARS = 20  # lines whose range of tension is drawn: more have no room for their names
MOST_TEXTS = 60  # lines that are named in a plan: names of more lie on each other
NAME_AT = (0.5, 0.35, 0.65, 0.2, 0.8)  # parts of a line at which its name may stand
AT_REST = 1e-6  # of the longest line: steps are solved to no less, and a motion below it is round-off
NAME_ROOM = 0.13  # of the range of a panel, for a name in its legend
# Part of the plan of a line that a picture has to show, and of its length that is level, so that it has a plan at all.
SEEN, LEVEL_PART = 0.25, 0.05
_EARLIER = 4  # shapes of the motion behind the last one


class AllLines:
    """The lines of a result as one cable, for what asks only where it is and what is around."""

    def __init__(self, result: Result) -> None:
        self.lines = dict(result.each_line())
        self._around, *others = self.lines.values()
        self.alone = None if others else self._around  # the only line: it is shown in detail, by its zones
        self.outputs = min(len(result.times), *(len(line.times) for line in self.lines.values()))
        self.times = result.times[: self.outputs]
        self._result = result

    @cached_property
    def position(self) -> np.ndarray:
        """Places of all points (nt, n, 3), m; of a line alone no copy, which may be large."""
        each = [x.position[: self.outputs] for x in self.lines.values()]
        return each[0] if len(each) == 1 else np.concatenate(each, axis=1)

    @property
    def s(self) -> np.ndarray:
        """Numbers of the points, in place of arc lengths."""
        return np.arange(self.position.shape[1], dtype=float)

    @cached_property
    def worst(self) -> list[str]:
        """Names of lines, of many the worst first."""
        return worst_first(self._result) if len(self.lines) > MOST_NAMED else list(self.lines)

    @property
    def named(self) -> list[str]:
        """Names of the lines with a colour and graphs of their own: of many the worst."""
        return self.worst if len(self.lines) <= MOST_NAMED else self.worst[:WORST]

    @cached_property
    def colours(self) -> dict[str, str]:
        """A colour for every line, in the order of drawing; of many lines the worst have their own, and come last."""
        others = dict.fromkeys((x for x in self.worst if x not in self.named), OTHERS)
        return others | dict(zip(self.named, cycle(LINE_COLOURS), strict=False))

    def label(self, name: str) -> str:
        """What a line is called in a legend: by its name, or as one of those without a colour of their own."""
        return name if name in self.named else f"{len(self.lines) - WORST} other lines"

    def __contains__(self, name: str) -> bool:
        return name.startswith(("seabed", "surface", "obstacles/")) and name in self._around

    def __getitem__(self, name: str) -> Any:
        return self._around[name]

    @property
    def names(self) -> list[str]:
        """Of what is around."""
        return [name for name in self._around.names if name in self]

    @property
    def as_result(self) -> Result:
        """Itself, for functions of a result that ask no more."""
        return cast(Result, self)


def views_of_lines(every: AllLines) -> list[View]:
    """Planes in which all lines are seen: those of `views_of`, but beside a plan the clearest upright one."""
    first, *others = views_of(every.as_result)
    plan = len(others) == 1 and not others[0].upright
    return [clearest_view(every), *others] if plan and first.across_label in "xy" else [first, *others]


def clearest_view(every: AllLines) -> View:
    """The upright plane in which the lines, as they are last, are longest, and none is seen from its end.

    Planes along x, y and that of the lines come before turned ones, which are taken where they alone show each line.
    """

    def seen(view: View) -> tuple[bool, float]:
        """Whether all lines show, and the length of all of them."""
        parts, total = [1.0], 0.0
        for line in every.lines.values():
            steps = np.diff(line.position[-1], axis=0)
            shown = float(np.hypot(*view.project(steps)).sum())
            level, whole = float(np.abs(steps @ view.across).sum()), float(np.hypot(steps[:, 0], steps[:, 1]).sum())
            total += shown
            if whole > LEVEL_PART * float(np.linalg.norm(steps, axis=1).sum()):
                parts.append(level / whole)
        return min(parts) >= SEEN, total

    usual = [views_of(every.as_result)[0], view_named("xz"), view_named("yz")]
    turned = [
        View(np.array([np.cos(angle), np.sin(angle), 0.0]), np.eye(3)[2], f"horizontal, {degrees}° from x", "z")
        for degrees in (30, 45, 60, 120, 135, 150)
        for angle in [np.radians(degrees)]
    ]
    return max(
        [view for view in usual if seen(view)[0]] or [view for view in turned if seen(view)[0]] or usual, key=seen
    )


def bodies_of(result: Result) -> list[str]:
    """Names of the bodies of a result."""
    return [n.split("/")[1] for n in result.names if n.startswith("bodies/") and n.endswith("/position")]


def points_of(result: Result) -> list[str]:
    """Names of the points of a result."""
    return [n.split("/")[1] for n in result.names if n.startswith("points/") and n.endswith("/position")]


def fairleads_of(result: Result) -> dict[str, str]:
    """The body of each point that is on one."""
    return dict(json.loads(str(result.attributes.get("fairleads", "{}"))))


def shapes(result: Result, every: AllLines, view: View, output: int = -1) -> list[Item]:
    """The lines at an output, each in its colour, points and bodies with arms to their fairleads."""
    items: list[Item] = outlines(every.as_result, view, output, moving=True)
    for name, colour in every.colours.items():
        width = 1.0 if colour == OTHERS else 1.8
        items.append(Line(*view.project(every.lines[name].position[output]), every.label(name), colour, width))
    points = np.array([result[f"points/{name}/position"][output] for name in points_of(result)])
    items.append(Marks(*view.project(points), "o", "points", size=3.5))
    return items + bodies_in(result, view, output)


def bodies_in(result: Result, view: View, output: int) -> list[Item]:
    """Bodies at an output, with arms to their fairleads; none of a cable."""
    names = bodies_of(result)
    items: list[Item] = [Line(*view.project(arms_of(result, name, [output])[0]), "", INK, 0.9) for name in names]
    for name in names:
        at = result[f"bodies/{name}/position"][[output]]
        items.append(Marks(*view.project(at), "s", "origins of bodies", BODY, size=8.0))
    return items


def names_in(every: AllLines, view: View) -> list[Item]:
    """Names beside the lines as they are last, each at the part of its line that is farthest from other names."""
    if len(every.lines) > MOST_TEXTS:
        return []
    size = float(np.ptp(every.position[-1] @ np.column_stack([view.across, view.up]), axis=0).max())
    taken, items = np.full((1, 2), np.inf), list[Item]()
    for name, colour in reversed(every.colours.items()):  # the worst first
        line = np.column_stack(view.project(every.lines[name].position[-1]))
        places = line[(np.array(NAME_AT) * (len(line) - 1)).astype(int)]
        room = np.linalg.norm(places[:, None] - taken[None], axis=2).min(axis=1)
        best = int((room >= min(0.08 * size, float(room.max()))).argmax())  # the first that has room
        taken = np.vstack([taken, places[best]])
        (x, y), ink, size_of = places[best].tolist(), INK if colour == OTHERS else colour, 5.5 + (colour != OTHERS)
        items.append(Text(x, y, name, ink, (1.5, 1.5), size=size_of))
    return items


def arms_of(result: Result, body: str, outputs: Numbers) -> np.ndarray:
    """From the origin of a body to each of its fairleads and back (n, points, 3) m, at outputs (n,)."""
    at = result[f"bodies/{body}/position"][outputs]
    ends = [result[f"points/{p}/position"][outputs] for p, b in fairleads_of(result).items() if b == body]
    return np.stack([x for end in ends for x in (at, end)] + [at], axis=1)


def shape(result: Result, every: AllLines, view: View) -> Panel:
    """The last shapes over some earlier ones, in grey."""
    items = sea(every.as_result, view)
    times = telling_times(every.as_result)
    times = times[even(len(times), _EARLIER)]
    for k, t in enumerate(times):
        output = int(np.abs(every.times - t).argmin())
        label = "earlier shapes (later: darker)"
        for line in every.lines.values():
            items.append(Line(*view.project(line.position[output]), label, earlier_grey(k, len(times)), 0.6))
    items += shapes(result, every, view)
    if not view.upright and len(every.lines) > MOST_NAMED:
        items += names_in(every, view)
    when = f" at t = {short(every.times[-1], 4)} s" if every.outputs > 1 else ""
    return framed(every.as_result, view, items, when)


def tensions(every: AllLines, output: int | None = None) -> Panel:
    """Tension along every line: the last one over the range of all times; output: that one, without ranges."""
    title = "tension along the lines" + ", and its range over all times" * (every.outputs > 1 and output is None)
    return _along_lines(every, "tension", "tension", "N", title, output)


def tension_ranges(every: AllLines) -> Panel:
    """From the smallest to the largest tension of the worst lines, one below the other."""
    names = every.worst[:BARS]
    found = [[worst(every.lines[x], "tension", lowest=low).value for low in (True, False)] for x in names]
    peak = float(np.abs(found).max())
    factor, unit = prefix("N", peak)
    items: list[Item] = [
        Line(factor * np.array(ends), np.full(2, -float(k)), "", every.colours[name], 3.0)
        for k, (name, ends) in enumerate(zip(names, found, strict=True))
    ]
    places = tuple(-float(k) for k in range(len(names)))
    y = Axis("", "", 0.7 - len(names), 0.7, ticks=places, names=tuple(names))
    title = f"tension ranges, worst {len(names)} of {len(every.lines)}"
    caption = "From the smallest to the largest of every step; the worst line is at the top."
    return Panel("ranked", title, Axis("tension", unit, peak=peak * factor), y, items, caption=caption)


def moments(every: AllLines) -> Panel | None:
    """The same of the bending moment; None: no line has any."""
    bent = any("bending_moment" in x and np.abs(x["bending_moment"]).max() > 0.0 for x in every.lines.values())
    title = "bending moment along the lines" + ", and its range" * (every.outputs > 1)
    return _along_lines(every, "bending_moment", "moment", "N m", title, None) if bent else None


def _along_lines(every: AllLines, name: str, word: str, unit: str, title: str, output: int | None) -> Panel:
    """A quantity along the lines that have it; word: for its axis."""
    lines = {x: line for x, line in every.lines.items() if name in line}
    peak = max(float(np.abs(line[name]).max()) for line in lines.values())
    factor, unit = prefix(unit, peak)
    items: list[Item] = []
    for label, colour in every.colours.items():
        if label not in lines:
            continue
        found = along(lines[label], name)
        values = found.values * factor
        if len(values) > 1 and output is None and colour != OTHERS:
            items.append(Band(found.s, values.min(axis=0), values.max(axis=0), colour=colour, opacity=0.15))
        width = 0.6 if colour == OTHERS else 1.2
        last = values[-1 if output is None else output]
        items.append(Line(*found.curve(last), every.label(label), colour, width))
    return Panel(name, title, Axis("s", "m"), Axis(word, unit, peak=peak * factor), items)


def largest_tensions(every: AllLines) -> Panel:
    """The largest tension of every line over time."""
    found = {name: line.tension[: every.outputs].max(axis=1) for name, line in every.lines.items()}
    peak = max(float(np.abs(x).max()) for x in found.values())
    factor, unit = prefix("N", peak)
    items: list[Item] = [
        Line(every.times, found[name] * factor, every.label(name), colour, 0.6 if colour == OTHERS else 1.3)
        for name, colour in every.colours.items()
    ]
    y = Axis("tension", unit, peak=peak * factor)
    caption = "The largest along each line, at outputs; the tables have those of all steps."
    return Panel("over-time", "largest tension of each line", Axis("t", "s"), y, items, caption=caption, cursor=True)


def motions(result: Result, every: AllLines) -> list[tuple[float, Panel]]:
    """How bodies and points leave their first places: a panel for each direction with motion, and its size, m.

    Of less than AT_REST of the longest line it is drawn flat: it is below what a step is solved to.
    """
    named = {f"body {name}": result[f"bodies/{name}/position"] for name in bodies_of(result)}
    held = fairleads_of(result)
    named |= {f"point {x}": result[f"points/{x}/position"] for x in points_of(result) if x not in held}
    moved = {name: at[: every.outputs] - at[0] for name, at in named.items() if np.ptp(at, axis=0).max() > 0.0}
    panels, least = [], _least(every)
    for k, axis in enumerate("xyz"):
        peak = max((float(np.abs(x[:, k]).max()) for x in moved.values()), default=0.0)
        if peak > 0.0 and every.outputs > 1:
            rests = peak < least
            factor, unit = prefix("m", max(peak, least))
            bound = least * factor
            y = Axis(axis, unit, -bound, bound) if rests else Axis(axis, unit, peak=peak * factor)
            title = f"motion along {axis}, from the first place"
            if rests:
                title = f"motion along {axis}: at rest, to {short(bound, 2)} {unit}"
            shown = {name: x for name, x in moved.items() if rests or np.ptp(x, axis=0).max() >= least}
            curves = {name: x[:, k] * factor for name, x in shown.items()}
            panels.append((peak, _over_time(f"motion-{axis}", title, y, every, curves)))
    return panels


def rotations(result: Result, every: AllLines) -> list[tuple[float, Panel]]:
    """How bodies turn from their first attitude: a panel for each angle that moves a fairlead, and by how much, m.

    Of less than AT_REST of the longest line, at the fairlead that is farthest from the origin, there is none.
    """
    arms, turned = {}, {}
    for name in bodies_of(result):
        arms[f"body {name}"] = float(np.ptp(arms_of(result, name, np.zeros(1, int))[0], axis=0).max())
        angles = result[f"bodies/{name}/rotation"][: every.outputs]
        turned[f"body {name}"] = angles - angles[0]
    panels = []
    for k, angle in enumerate(("roll", "pitch", "yaw")):
        curves = {name: x[:, k] for name, x in turned.items()}
        peak = max((float(np.abs(x).max()) for x in curves.values()), default=0.0)
        way = max((arms[name] * float(np.radians(np.abs(x).max())) for name, x in curves.items()), default=0.0)
        if way > _least(every) and every.outputs > 1:
            title = f"{angle}, from the first attitude"
            panels.append((way, _over_time(f"rotation-{angle}", title, Axis(angle, "deg", peak=peak), every, curves)))
    return panels


def _least(every: AllLines) -> float:
    """Motion, m, below which there is only round-off."""
    return AT_REST * max(float(np.ptp(line.s)) for line in every.lines.values())


def _over_time(key: str, title: str, y: Axis, every: AllLines, curves: dict[str, np.ndarray]) -> Panel:
    """Curves by name over time, of many those that move most; room is left above them for their names."""
    if len(curves) > MOST_NAMED:
        largest = sorted(curves, key=lambda name: -float(np.ptp(curves[name])))
        others = f"{len(curves) - WORST} that move less"
        items: list[Item] = [Line(every.times, curves[name], others, OTHERS, 0.6) for name in largest[WORST:]]
        curves = {name: curves[name] for name in largest[:WORST]}
    else:
        items = []
    items += [Line(every.times, x, name, c) for (name, x), c in zip(curves.items(), cycle(LINE_COLOURS), strict=False)]
    if y.low is None:
        low, high = min(float(x.min()) for x in curves.values()), max(float(x.max()) for x in curves.values())
        room = (0.14 + NAME_ROOM * min(len(curves), 5)) * (high - low)
        y = y._replace(low=low - 0.1 * (high - low), high=high + room)
    return Panel(key, title, Axis("t", "s"), y, items, legend=True, cursor=True)


# ---- pages ----------------------------------------------------------------------------------------


def facts_line(result: Result, every: AllLines) -> list[str]:
    """What a page says of the lines, below its title."""
    several = f"{len(every.lines)} line{'s' * (len(every.lines) != 1)}"
    bodies = bodies_of(result)
    return [several + (f", {len(bodies)} bod{'ies' if len(bodies) != 1 else 'y'}" if bodies else "")]


def page(result: Result) -> Page:
    """One page of several lines: shapes from two sides, tension along the lines, and over time what moves."""
    if not len(result.times):
        return page_of(result, [])
    every = AllLines(result)
    views = views_of_lines(every)
    names = ["s", "S"][: len(views)]
    panels = {name: shape(result, every, view) for name, view in zip(names, views, strict=True)}
    many = len(every.named) < len(every.lines)
    panels["p"] = tension_ranges(every) if many else tensions(every)
    if every.outputs > 1:
        panels["h"] = largest_tensions(every)
        moved = sorted([*motions(result, every), *rotations(result, every)], key=lambda x: -x[0])
        panels |= dict(zip("mn", [panel for _, panel in moved], strict=False))
    if many:
        return _page_of_many(result, every, views, panels)
    if (bent := moments(every)) is not None:
        panels["b"] = bent
    below = [name for name in "pbhmn" if name in panels][:4]
    panels = {name: x for name, x in panels.items() if name in (*names, *below)}
    rows = [names] if aspect_of(views, every.as_result) < 3.0 else [[name] for name in names]
    wide = max(2 if len(below) > 1 else 1, len(rows[0]))
    rows = [[name for name in row for _ in range(wide // len(row) or 1)] for row in rows]
    grid = [below[k : k + wide] for k in range(0, len(below), wide)]
    rows += [row + [row[-1]] * (wide - len(row)) for row in grid]
    heights = [1.6 if set(row) <= {"s", "S"} else 1.0 for row in rows]
    even, facts = [1.0] * len(rows[0]), facts_line(result, every)
    return page_of(result, facts, panels=panels, mosaic=rows, widths=even, heights=heights, legend=["s"])


def _page_of_many(result: Result, every: AllLines, views: list[View], panels: dict[str, Panel]) -> Page:
    """The page of more lines than a legend names: a large plan with their names beside a list of the worst."""
    plan = next((name for name, view in zip(("s", "S"), views, strict=False) if not view.upright), "s")
    others = [name for name in ("s", "S", "h", "m", "n") if name in panels and name != plan]
    rows = [[plan, plan, "p"]] + [[name] * 3 for name in others[:1]]
    rows += [[name, name, name] for name in others[1:3]]
    shown = {x for row in rows for x in row}
    panels = {x: panel for x, panel in panels.items() if x in shown}
    heights, facts = [3.2, *[1.0] * (len(rows) - 1)], facts_line(result, every)
    return page_of(result, facts, panels=panels, mosaic=rows, heights=heights, size=(8.0, 10.0), legend=["s"])


# --- in space ----------------------------------------------------------------------------------

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
