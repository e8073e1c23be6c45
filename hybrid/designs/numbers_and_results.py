"""Numbers of a scene by their keys, and results by their names: what derivatives are of, and by what.

A number is read and changed where its key stands.  Results are named at rest `tension@end`, `max curvature`; in motion
`last tension@end`, `t=12.5 tension@100`; of lines with names `east/tension@end`, `max hose/curvature`.  Statistics of
their histories have arrays (outputs, places); an extreme over time is the largest of its peaks, each with when and
where it is.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple, TypeVar, cast

import numpy as np
from numpy.typing import NDArray

from hybrid.errors import Complaint, SceneError
from hybrid.kernels.state.state import Floats
from hybrid.model.sections import SAME_PLACE
from hybrid.outputs.probes import PROBES
from hybrid.scene.base import Invalid, Table, unit_of
from hybrid.scene.read import read_text, scene_text, text_of
from hybrid.scene.root import Scene
from hybrid.scene.yaml_source import Node, Unreadable, from_text

AnyScene = TypeVar("AnyScene", bound=Scene)
PART = re.compile(r"[^.\[\]]+")
# Part of a number by which lines are differentiated; one that is 0 is changed by this, in its own unit.
# Lengths are changed by less: a place that is at a node would see the cell to one side of it as much as that to the
# other.  So are diameters, on which it depends how deep a line lies in obstacles.
OF_NUMBER = 1e-4
OF_LENGTH = 1e-5  # of a length or diameter
LENGTH = re.compile(r"\b(length|diameter)$")
# Coordinates: what they are depends on where the origin is.  Where the bed and obstacles are counts in parts of how
# deep a line lies in them: they are changed by this part, coordinates by this part of the longest line.
PLACE = re.compile(r"(position\[\d\]|centre\[\d\]|\.z|\.surface|\.at\[\d\]|\.depth\[\d+\]\[\d+\])$")
TOUCHED = re.compile(
    r"^(obstacles|environment\.seabed|bodies\.[^.]+\.shape)\.(?!.*(stiffness|damping|friction|soil))|\.surface$"
)
OF_TOUCHED = 3e-8  # of the number, or of the longest line for a coordinate
# What runs, and equilibria far apart, differ by parts of: of coordinates this part of the longest line, of angles (deg)
# at least a radian.
PART_OF_LENGTH, RADIAN = 0.1, math.degrees(1.0)
# Of an output what is at arc lengths; part of the length within which one is at the end.
OF_OUTPUT = ("points", "history")
# Tables of how a scene is computed and written, and of what has names of its own.
COMPUTING = ("time", "output", "mesh", "accuracy", "model", "resolution")
NAMED = ("lines", "points", "bodies", "obstacles")


def number_of(scene: Scene, key: str) -> float:
    """The value of a key such as `cable.sections[0].length`; SceneError: it has no number."""
    return number_in(scene.written, key)


def number_in(tables: Table, key: str) -> float:
    """The same of tables, whatever form they have."""
    value: Any = tables
    for part in PART.findall(key):
        try:
            if isinstance(value, Table):
                value = {name: getattr(value, name) for name in type(value).model_fields}
            elif isinstance(value, list | tuple):
                value = {str(k): x for k, x in enumerate(value)}
            value = value[part]
        except (KeyError, IndexError, TypeError):
            expected = "a key of the scene that has a number"
            raise SceneError([Complaint("by", key, expected, "cable.sections[0].length, for example")]) from None
    if not isinstance(value, float):
        refuse_computing(key)
        kind = "a number that may change by a little" if isinstance(value, int) else "a number"
        raise SceneError([Complaint("by", key, f"{kind}, which {key} is not in this scene", "another key")])
    return float(value)


def computing(key: str) -> str:
    """The part of a key by which it is of how a scene is computed; "": of what is there."""
    parts = PART.findall(key)
    return next((x for x in (parts[2:] if parts[0] in NAMED else parts) if x in COMPUTING), "")


def refuse_computing(key: str) -> None:
    """SceneError: a number of how the scene is computed, on which results depend by their errors alone."""
    if computing(key):
        expected = "a number of what is computed: of the cable, its ends, what is around it"
        raise SceneError([Complaint("by", key, expected, "cable.sections[0].length, for example")])


def at_a_bound(key: str, number: float) -> SceneError:
    """A number that may not be a little more, or less."""
    fix = f"another number than {number:g}, which is the least or the largest that it may be"
    return SceneError([Complaint("by", key, "a number that may be a little more, and less", fix)])


def size_of(asked: Scene, key: str, number: float) -> float:
    """What runs differ by parts of; SceneError: a number of how the scene is computed, which has no derivative."""
    refuse_computing(key)
    if PLACE.search(key):
        return PART_OF_LENGTH * asked.length
    if unit_of_key(asked, key) == "deg":
        return max(abs(number), RADIAN)
    return abs(number) or 1.0


def scale_of(asked: Scene, quantity: str, value: float) -> float:
    """What differences from a value are parts of: of coordinates, which go by the origin, of no more than a line."""
    size = abs(value)
    return min(size, asked.length) if quantity.split(".")[0].endswith("position") else size


def unit_of_key(scene: Scene, key: str) -> str:
    """The unit that the reference of scenes has for a key; "": none."""
    value, unit = cast(Any, scene.written), ""
    for part in PART.findall(key):
        if isinstance(value, Table):
            unit, value = unit_of(type(value).model_fields.get(part)), getattr(value, part)
        else:
            value = value[part] if isinstance(value, Mapping) else value[int(part)]
    return unit


def step_at_rest(scene: Scene, key: str, number: float) -> float:
    """By how much lines at rest with more and with less of a number differ from the scene."""
    if TOUCHED.search(key):
        return OF_TOUCHED * (scene.length if PLACE.search(key) else abs(number) or 1.0)
    return (OF_LENGTH if LENGTH.search(key) else OF_NUMBER) * (abs(number) or 1.0)


def changed_scene(scene: AnyScene, key: str, value: float) -> AnyScene:
    """The scene with another number at a key, read and checked as a file is; SceneError: it may not be that."""
    output = _with_table(scene, key, value).get("output")
    moved = [f"output.{x}={json.dumps(getattr(output, x))}" for x in OF_OUTPUT] if output is not None else []
    found, _ = read_text(scene_text(scene), overrides=[f"{key}={float(value)!r}", *moved])
    assert type(found) is type(scene)
    return found


def with_number(scene: AnyScene, key: str, value: float) -> AnyScene:
    """The scene with another number at a key, not `allowed` as yet: tables beside it are those of the scene itself."""
    return scene.model_copy(update=_with_table(scene, key, value))


def _with_table(scene: Scene, key: str, value: float) -> dict[str, Any]:
    """Tables of a scene that are others with another number at a key.

    Output points and histories at the end of a line stay there, and those beyond it go there.
    """
    first, *rest = PART.findall(key)
    tables: Any = scene.written if first in type(scene.written).model_fields else scene
    made = _put(getattr(tables, first), rest, float(value))
    lengths = {"": (tables.cable.length, made.length)} if first == "cable" else {}
    if first == "lines":
        lengths = {name: (tables.lines[name].cable.length, x.cable.length) for name, x in made.items()}
    changed = {name for name, (old, new) in lengths.items() if old != new}
    update = {}
    for places in OF_OUTPUT if changed else ():
        kept = getattr(tables.output, places)
        if isinstance(kept, Mapping):
            update[places] = {k: _on_line(x, *lengths[k]) if k in changed else x for k, x in kept.items()}
        elif "" in changed:
            update[places] = _on_line(kept, *lengths[""])
    more = {"output": tables.output.model_copy(update=update)} if update else {}
    return {first: made} | more


def _on_line(places: Any, old: float, new: float) -> Any:
    """Arc lengths, m, on a line of another length; a number of places, or none, stays."""
    if not isinstance(places, tuple):
        return places
    return tuple(sorted({new if x > new or abs(x - old) <= SAME_PLACE * old else x for x in places}))


def allowed(scene: AnyScene) -> AnyScene:
    """A scene that was made by `with_number`; Invalid: it is none that could be read."""
    scene.model_validate(scene.model_dump(mode="python"))
    return scene


def scene_with(scene: AnyScene, keys: Sequence[tuple[str, ...]], x: Floats) -> AnyScene:
    """A scene with values at keys of each unknown; SceneError: it may not have these."""
    given = [(key, float(value)) for group, value in zip(keys, x, strict=True) for key in group]
    changed = scene
    with suppress(Invalid):
        for key, value in given:
            changed = with_number(changed, key, value)
        return allowed(changed)
    for key, value in given:
        scene = changed_scene(scene, key, value)
    return scene


def _put(value: Any, parts: list[str], number: float) -> Any:
    if not parts:
        return number
    first, rest = parts[0], parts[1:]
    if isinstance(value, Table):
        return value.model_copy(update={first: _put(getattr(value, first), rest, number)})
    if isinstance(value, Mapping):
        return {**value, first: _put(value[first], rest, number)}
    place = int(first)
    return type(value)([_put(x, rest, number) if k == place else x for k, x in enumerate(value)])


# The text of a scene with other numbers: that of its file, with all that is written in it, where that can be.


def text_of_found(
    scene: Scene,
    file: str,
    keys: Mapping[str, Sequence[str]],
    numbers: Mapping[str, float],
    folder: str | Path | None = None,
) -> str:
    """The scene as YAML.  file: what it was read from, "": nothing; folder: where the text is to go, None: anywhere.

    The text of the file, with its comments, stays where every number stands in it once, and names of other files mean
    the same in the folder.
    """
    whole = scene_text(scene)
    if not file:
        return whole
    text = text_of(file)
    for name, group in keys.items():
        for key in group:
            changed = _replaced(text, key, numbers[name])
            if changed is None:
                return whole
            text = changed
    try:
        place = str(Path(folder).absolute() / "scene.yaml") if folder is not None else ""
        return text if read_text(text, place)[0] == scene else whole
    except SceneError:
        return whole


def _replaced(text: str, key: str, number: float) -> str | None:
    """The text with another number at a key; None: it does not stand there as a number of its own."""
    try:
        node: Node = from_text(text)[0]
    except Unreadable:
        return None
    for part in PART.findall(key):
        inside = node.value
        if isinstance(inside, list) and part.isdecimal() and int(part) < len(inside):
            node = inside[int(part)]
        elif isinstance(inside, dict) and part in inside:
            node = inside[part]
        else:
            return None
    lines = text.splitlines(keepends=True)
    if node.place is None or not isinstance(node.value, int | float) or node.place[0] > len(lines):
        return None
    row, column = node.place[0] - 1, node.place[1] - 1
    line = lines[row]
    if not line[column:].startswith(node.written):
        return None
    lines[row] = line[:column] + repr(number) + line[column + len(node.written) :]
    return "".join(lines)


# --- results -----------------------------------------------------------------------------------

NAME = re.compile(r"^(?:(max|min|mean|std|last|t=\S+) )?(?:([^/@]+)/)?([a-z_]\w*)(?:\.([xyz]))?(?:@(.+))?$")
OF_SECTION = re.compile(r"^sections\[(\d+)\]$")
AXES = "xyz"
# Part of an extreme within which other peaks stand beside it, and so many at most.
BESIDE, MOST = 0.1, 12


class Wanted(NamedTuple):
    """A result in parts.

    over: at rest `max` or `min` along the line or "", in motion `max`, `min`, `mean`, `std`, `last` or `t` over time;
    line: "" of the one without a name; axis: its component or ""; at: m, infinity: the end, wherever that is, None: no
    place, or all of them, or those of a section; time: s, at which it is wanted (over: "t"), between outputs by the
    straight line.
    """

    over: str
    line: str
    name: str
    axis: str
    at: float | None
    section: int | None = None
    time: float = math.nan

    @property
    def place(self) -> Wanted:
        """Whose history it is of."""
        return self._replace(over="", time=0.0)

    def component(self, value: Floats) -> Floats:
        """The component of a vector that is wanted, or its size; what is no vector itself."""
        if self.name not in PROBES or PROBES[self.name].dims[-1:] != ("xyz",):
            return value
        return np.asarray(value[..., AXES.index(self.axis)] if self.axis else np.linalg.norm(value, axis=-1))


def of_line(name: str) -> str:
    """What results of a line begin with; nothing for a line without a name."""
    return f"{name}/" if name else ""


def parse_wanted(asked: Scene, text: str, moves: bool) -> Wanted:
    """The parts of a result, of a run (moves) or of its equilibrium.  SceneError: it is none."""
    found, first = NAME.match(text), next(iter(asked.asked_lines))
    over, line, name, axis, at = found.groups() if found is not None else ("", "", "", "", "")
    known = bool(over) if moves else over in (None, "max", "min")
    if found is None or not known or (line or "") not in asked.asked_lines:
        of, example = of_line(first and "LINE"), f"{'max ' * moves}{of_line(first)}tension@end"
        ways = f"max, min, mean, std, last or t=TIME, and {of}NAME@S" if moves else f"{of}NAME@S, max or min {of}NAME"
        expected = f"{ways}{' of ' if first else ''}{', '.join(asked.asked_lines)}, such as {example}"
        raise SceneError([Complaint("of", text, expected, example)])
    time = math.nan
    if (over or "").startswith("t="):
        over, time = "t", _time_of(asked, text, over.removeprefix("t="))
    cable, section = asked.asked_lines[line or ""].cable, OF_SECTION.match(at or "")
    if section is not None and int(section[1]) >= len(cable.sections):
        expected = f"a section of the line, which has {len(cable.sections)}, counted from 0"
        raise SceneError([Complaint("of", text, expected, f"sections[{len(cable.sections) - 1}]")])
    s = None if section is not None else _place_of(text, at, cable.length)
    refuse_parts(name, axis or "", "" if moves else over or "", s if section is None else 0.0)
    if s is None and name in PROBES and "s" in PROBES[name].dims and over not in ("max", "min"):
        fix = f"{text}@end" if moves else f"{name}@0, max {name}"
        raise SceneError([Complaint("of", text, "a place" if moves else "a place or an extreme", fix)])
    of_section = None if section is None else int(section[1])
    return Wanted(over or "", line or "", name, axis or "", np.inf if s == cable.length else s, of_section, time)


def at_end(asked: Scene, text: str) -> str:
    """A result of an equilibrium; what is at the end of its line in this scene is so with any length."""
    end = parse_wanted(asked, text, moves=False).at == np.inf
    return f"{text.partition('@')[0]}@end" if end else text


def _place_of(text: str, at: str | None, length: float) -> float | None:
    """The place of a result, m; None: it has none.  SceneError: it is not on the line."""
    if at is None:
        return None
    try:
        s = {"start": 0.0, "end": length}[at] if at in ("start", "end") else float(at)
    except ValueError:
        raise SceneError([Complaint("of", text, "a number of metres behind @", "tension@0")]) from None
    if not 0.0 <= s <= length:
        raise SceneError([Complaint("of", text, f"an arc length between 0 and {length:g} m", f"tension@{length:g}")])
    return s


def _time_of(asked: Scene, text: str, number: str) -> float:
    """The time of a result, s; SceneError: it is none, or beyond the run."""
    duration = asked.require_time().duration
    try:
        time = float(number)
    except ValueError:
        time = math.nan
    if not 0.0 <= time <= duration:
        expected = f"a time between 0 and {duration:g} s"
        raise SceneError([Complaint("of", text, expected, f"t={0.5 * duration:g} tension@end")])
    return time


def refuse_parts(name: str, axis: str, extreme: str, at: float | None) -> None:
    """SceneError: a component of what is no vector, an extreme along the line or a place of what has one value."""
    if name not in PROBES:
        return
    dims, whole = PROBES[name].dims, f"{name}.{axis}" if axis else name
    if axis and dims[-1:] != ("xyz",):
        raise SceneError([Complaint("of", whole, f"{name}, which has no components", name)])
    if (extreme or at is not None) and "s" not in dims:
        place = "" if at is None else f"@{'end' if np.isinf(at) else f'{at:g}'}"
        expected = f"{whole} alone, which has one value for the whole line"
        raise SceneError([Complaint("of", f"{extreme} {whole}{place}".lstrip(), expected, whole)])


def over_time(history: Floats, over: str, where: Any) -> tuple[float, Any]:
    """The statistic of a history, and when and where an extreme is; where: None: not known yet."""
    if over in ("max", "min"):
        if where is None:
            flat = np.nanargmax(history) if over == "max" else np.nanargmin(history)
            where = np.unravel_index(int(flat), history.shape)
        return float(history[where]), where
    x = history[:, 0]
    return float({"mean": x.mean(), "std": x.std(), "last": x[-1]}[over]), None


def peaks(history: Floats, over: str, where: Any) -> list[Any]:
    """When and where peaks are that stand beside an extreme, from the largest on, behind the extreme itself.

    They are the largest of each place over time, as the place of an extreme goes along a line, and of each peak over
    time and place.
    """
    if over not in ("max", "min"):
        return [where]
    high = np.pad(np.nan_to_num(history if over == "max" else -history, nan=-np.inf), 1, constant_values=-np.inf)
    inside, (n, m) = high[1:-1, 1:-1], history.shape
    peak = np.isfinite(inside)
    for i, k in np.argwhere(np.ones((3, 3))) - 1:
        if (i, k) != (0, 0):  # of equal neighbours the first
            beside = high[1 + i : 1 + i + n, 1 + k : 1 + k + m]
            peak &= (inside > beside) if (i, k) < (0, 0) else (inside >= beside)
    peak[np.argmax(inside, axis=0), np.arange(m)] = True
    top = inside[where]
    near = [(int(i), int(k)) for i, k in np.argwhere(peak & (inside >= top - BESIDE * abs(top)))]
    near.sort(key=lambda x: -float(inside[x]))
    first = (int(where[0]), int(where[1]))
    return [first, *[x for x in near if x != first][: MOST - 1]]


def smoothed(history: Floats, over: str, cut: NDArray[np.bool_]) -> Floats:
    """Extremes of parabolas through every output and place and its neighbours.

    In time and place, but for these places (places,), where a value may be two.
    Outputs and places count as evenly spaced there.  The largest of all changes evenly, as an extreme goes from one to
    the next: between two it is that of either parabola.
    """
    side, out = 1.0 if over == "max" else -1.0, history.copy()
    for axis in (0, 1):
        x, table = np.moveaxis(history, axis, 0), np.moveaxis(out, axis, 0)
        if x.shape[0] < 3:
            continue
        before, here, after = x[:-2], x[1:-1], x[2:]
        bent = after - 2.0 * here + before
        hill = (side * bent < 0.0) & (np.abs(after - before) < 2.0 * np.abs(bent))  # it is between the neighbours
        if axis == 1:
            hill &= ~(cut[:-2] | cut[1:-1] | cut[2:])[:, None]
        table[1:-1][hill] -= (after - before)[hill] ** 2 / (8.0 * bent[hill])
    return out
