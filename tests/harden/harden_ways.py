"""Ways to harm a scene, by chance that a seed fixes.  Each changes the tree and names the entries it has touched."""

from __future__ import annotations

import copy
import random
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from harden_tree import Box, Entry, Leaf, Row, to_tree, walk

Done = tuple[str, list[Any]]  # what was done, and the entries (or tables) where it can be seen
Way = Callable[[random.Random, Box], Done | None]


@dataclass(frozen=True)
class Harm:
    """The way a scene was harmed, in words, and the entries (or tables) where it can be seen."""

    way: str
    what: str
    touched: list[Any]


NOT_NUMBERS = [".nan", ".inf", "-.inf", "1e400", "-1e400", "9" * 400, "0x", "1e", "--1", "0o1x", "190:20:30"]
EXTREMES = ["0", "-1", "-0.0", "1e-320", "1e-300", "1e-30", "-1e-30", "1e-12", "1e-6", "1e6", "1e9", "1e12", "-1e12",
            "1e30", "1e150", "1e300", "1.7e308", "12345678901234567890", "0.1", "3"]  # fmt: skip
WORDS = ["nonsense", "true", "no", "null", "~", "''", "2001-01-01", "2001-12-14t21:59:43.10-05:00", "0.5.1", "None",
         '"5"', "5 m", "!!str 5", "!!binary aGk=", "!!python/object:os.system x", "=", "<<"]  # fmt: skip
ODD = ["é", "日本", "😀", "\u202e5", "５", "1\u00a0000", "\u22125", "\u200b7", "1\u2009e3", "a\u0301", "µ", "5°", "½",
       "\ufeff5", '"\\u0000"', '"\\ud800"', '"a\\nb"', '"\\x1b[31mred"', "x" * 300]  # fmt: skip
UNITS = [" m", " mm", " km", " kg/m", " N", " kN", " s", " ms", " min", " %", " ft", " deg", "m", " N m^2", " Hz"]
SCALES = [1e-3, 1e-2, 1e2, 1e3, 1e6, 1e-6, 9.81, 0.3048, 57.29577951]
ALIENS = ["foo", "EA", "EI", "cd", "waves", "current", "force", "tangent", "tension", "kind", "file", "ramp", "cells",
          "Length", "mass ", "stiffness", "zones", "step", "colour"]  # fmt: skip
TASKS: dict[str, list[tuple[str, list[str]]]] = {
    "time": [
        ("duration", ["0", "1e-9", "1e-3", "1e4", "1e9", "1e15", "1e300"]),
        ("step", ["1e-15", "1e-9", "1e-6", "1", "10", "1e9", "null"]),
        ("tolerance", ["1e-18", "1e-9", "1e-6", "1e-3", "1", "1e9"]),
        ("rho_inf", ["0", "0.9", "0.95", "1", "1.0000001", "-0.1"]),
    ],
    "output": [
        ("every", ["1e-12", "1e-9", "1e-6", "1e-4", "1e-3", "1e3", "1e12"]),
        ("points", ["1", "2", "3", "1000", "100000", "1000000000", "1000000000000", "[]", "[0]", "[0, 0]", "[1, 0]", "2.5"]),
        ("history", ["[]", "[0]", "[0, 0]", "[1e9]", "0", "[0.1, 0.2, 0.3, 0.4, 0.5]"]),
        ("criteria", ["true", "yes", "1"]),
        ("errors", ["true", "false", "null"]),
    ],
    "mesh": [
        ("cells", ["1", "2", "3", "200", "1000000000", "1000000000000", "2.5", "-4"]),
        ("ratio", ["0", "1e-9", "1e-300", "0.1", "10", "1000", "1e9", "1e300"]),
        ("nodes", ["[0, 1]", "[0, 1, 2]", "[0, 0, 1]", "[2, 1, 0]", "[]"]),
    ],
}  # fmt: skip
WHOLE: dict[str, list[Any]] = {
    "model": ["rod", "catenary", "adaptive", "zones",
              {"kind": "adaptive", "tolerance": 1e-9}, {"kind": "adaptive", "curvature_error": 0.1, "rod_cell": 1e-9},
              {"kind": "adaptive", "curvature_error": 0.1, "rod_cell": 1e9}, {"kind": "adaptive", "rod_cell": 1.0},
              {"kind": "adaptive", "force_rod": [[0, 1e-9]]},
              {"kind": "adaptive", "force_rod": [[0, 1]], "force_catenary": [[0.5, 2]]},
              {"kind": "adaptive", "hold_time": 1e-9}, {"kind": "catenary", "slack": "warn"},
              {"kind": "zones", "zones": []}, {"zones": [{"rod": 1}, {"catenary": 1}]},
              {"kind": "zones", "zones": [{"rod": 1, "catenary": 1}]}],
    "dimension": [2, 3, 1, 2.0, "2"],
    "accuracy": ["1%", "3 cm", "50 N", "0.0001%", "1000%", "0%", "-1%", "1e-30 m", "3 parsec", 0.01, {"position": "1%"},
                 {"tension": "1 m"}, {}, "100 km", "1e9 N", "0.1%"],
    "initial": ["equilibrium", "straight", {"kind": "straight", "direction": [1, 0, 0]}, {"kind": "equilibrium", "guess": "arc"},
                {"kind": "straight", "direction": [0, 0, 0]}, {"kind": "points", "points": [[0, 0, 0], [0, 0, 0]]},
                {"kind": "points", "points": [[0, 0, 0], [1, 0, 0], [0, 0, 0]]},
                {"kind": "straight", "direction": [0, 0, 1], "velocity": [1e3, 0, 0]},
                {"kind": "equilibrium", "friction": "settled"}, {"kind": "equilibrium", "guess": "span"},
                {"kind": "equilibrium", "guess": "straight", "direction": [0, 0, 1]}],
    "environment": [{}, {"gravity": 0}, {"gravity": -9.81}, {"gravity": 1e6}, {"fluid": {"density": 1e9}},
                    {"fluid": {"density": 1025, "surface": 0, "waves": {"kind": "regular", "height": 20, "period": 3}}},
                    {"fluid": {"density": 1000, "current": [1e3, 0, 0]}},
                    {"fluid": {"density": 1025, "surface": 0, "waves": {"kind": "jonswap", "significant_height": 3, "peak_period": 1e-3}}},
                    {"seabed": {"z": 0, "stiffness": 1e12}}, {"seabed": {"z": 1e3, "stiffness": 1e3}},
                    {"seabed": {"z": -1, "stiffness": 1e3, "friction": 100}}],
    "title": ["", "x" * 1000, "\u202e", "{}", "%s", "[bold red]x[/nope]"],
}  # fmt: skip
ENDS = ["free", {"kind": "free"}, {"kind": "pinned", "position": [0, 0, 0]}, {"kind": "pinned"},
        {"kind": "clamped", "position": [0, 0, 0], "tangent": [0, 0, 1]}, {"kind": "clamped", "position": [0, 0, 0]},
        {"kind": "guided", "tangent": [1, 0, 0]}, {"kind": "body", "mass": 10}, {"kind": "body", "mass": 0},
        {"kind": "body", "mass": 1e9, "volume": 1e6, "drag_area": 1e6}, {"kind": "free", "force": [1e9, 0, 0]},
        {"kind": "free", "moment": [0, 1e3, 0]}, {"kind": "free", "force": {"value": [1, 0, 0], "until": 1e-9}},
        {"kind": "clamped", "position": [0, 0, 0], "tangent": [0, 0, 0]}, {"kind": "free", "position": [0, 0, 0]},
        {"kind": "clamped", "position": [0, 0, 0], "tangent": [1, 0, 0], "normal": [1, 0, 0]}]  # fmt: skip
MOTIONS = [{"heave": {"amplitude": 1, "period": 1}}, {"heave": {"amplitude": 1e6, "period": 8}, "ramp": 16},
           {"surge": {"amplitude": 0.1, "period": 1e-9}, "ramp": 1}, {"sway": {"amplitude": 1, "period": 8}, "ramp": 1e-9},
           {"travel": {"by": [1e6, 0, 0], "over": 1}}, {"travel": {"by": [0, 0, 0], "over": 1e-9}}, {"follow": "waves"},
           {"velocity": [1e3, 0, 0]}, {"velocity": [0.1, 0, 0], "ramp": 1}, {"file": "absent.csv"}, {"file": "."}, {},
           {"pitch": {"amplitude": 1e3, "period": 1}, "ramp": 1}, {"heave": [], "ramp": 1},
           {"heave": {"amplitude": 1, "period": 8, "phase": 90}}]  # fmt: skip


def _pick(rng: random.Random, tree: Box, keep: Callable[[Entry], bool] = lambda e: True) -> Any:
    found = [(inside, entry) for inside, entry in walk(tree) if keep(entry)]
    return rng.choice(found) if found else None


def _numbers(value: Any) -> list[Leaf]:
    """The leaves of a value that are numbers."""
    if isinstance(value, Row):
        return [leaf for each in value.entries for leaf in _numbers(each)]
    try:
        return [value] if isinstance(value, Leaf) and float(value.text) == float(value.text) else []
    except ValueError:
        return []


def _number(rng: random.Random, tree: Box) -> Any:
    """An entry with a number in it, and the number; None if there is none."""
    found = _pick(rng, tree, lambda e: bool(_numbers(e.value)))
    return (found[1], rng.choice(_numbers(found[1].value))) if found else None


def forgotten(rng: random.Random, tree: Box) -> Done | None:
    inside, entry = _pick(rng, tree) or (None, None)
    if entry is None:
        return None
    inside[-1].entries.remove(entry)
    return f"{entry.key} forgotten", list(inside)


def misspelt(rng: random.Random, tree: Box) -> Done | None:
    inside, entry = _pick(rng, tree) or (None, None)
    if entry is None:
        return None
    key, i = entry.key, rng.randrange(len(entry.key))
    entry.key = rng.choice(
        [key[:i] + key[i + 1 :] or "x", key[:i] + key[i] + key[i:], key.upper(), key.replace("_", "-") + "s",
         key[:i] + rng.choice("aeioux_ é") + key[i + 1 :], f'"{key} "', key[::-1]]
    )  # fmt: skip
    return f"{key} written {entry.key}", [entry, *inside]


def alien(rng: random.Random, tree: Box) -> Done | None:
    inside, entry = _pick(rng, tree) or (None, None)
    if entry is None:
        return None
    new = Entry(rng.choice(ALIENS), Leaf(rng.choice(["1", "[1, 0, 0]", "{}", "rod", "1.5e3"])))
    inside[-1].entries.insert(rng.randint(0, len(inside[-1].entries)), new)
    return f"{new.key} added", [new, *inside]


def other_type(rng: random.Random, tree: Box) -> Done | None:
    inside, entry = _pick(rng, tree) or (None, None)
    if entry is None:
        return None
    new = rng.choice(["[]", "{}", "", "[[1]]", "{a: 1}", "[1, 2, 3]", "5", "-", "[1, {}]", *WORDS])
    entry.value = Leaf(new)
    return f"{entry.key}: {new}", [entry, *inside]


def odd_text(rng: random.Random, tree: Box) -> Done | None:
    inside, entry = _pick(rng, tree) or (None, None)
    if entry is None:
        return None
    text = rng.choice(ODD)
    if rng.random() < 0.3:
        entry.key = text
    else:
        entry.value = Leaf(text)
    return f"{entry.key} has odd text", [entry, *inside]


def not_a_number(rng: random.Random, tree: Box) -> Done | None:
    entry, leaf = _number(rng, tree) or (None, None)
    if entry is None:
        return None
    leaf.text = rng.choice(NOT_NUMBERS)
    return f"{entry.key}: {leaf.text[:12]}", [entry]


def extreme(rng: random.Random, tree: Box) -> Done | None:
    entry, leaf = _number(rng, tree) or (None, None)
    if entry is None:
        return None
    leaf.text = rng.choice(EXTREMES)
    return f"{entry.key}: {leaf.text}", [entry]


def scaled(rng: random.Random, tree: Box) -> Done | None:
    entry, leaf = _number(rng, tree) or (None, None)
    if entry is None:
        return None
    by = rng.choice([*SCALES, -1.0, 10 ** rng.uniform(-8, 8)])
    leaf.text = f"{float(leaf.text) * by:.8g}"
    return f"{entry.key} times {by:.3g}", [entry]


def with_unit(rng: random.Random, tree: Box) -> Done | None:
    entry, leaf = _number(rng, tree) or (None, None)
    if entry is None:
        return None
    leaf.text = leaf.text.replace(".", ",") if rng.random() < 0.25 else leaf.text + rng.choice(UNITS)
    return f"{entry.key}: {leaf.text}", [entry]


def twice(rng: random.Random, tree: Box) -> Done | None:
    inside, entry = _pick(rng, tree) or (None, None)
    if entry is None:
        return None
    new = copy.deepcopy(entry)
    inside[-1].entries.insert(rng.randint(0, len(inside[-1].entries)), new)
    return f"{entry.key} twice", [entry, new, *inside]


def misplaced(rng: random.Random, tree: Box) -> Done | None:
    """A key in another table, its value in a list, or its keys one level up."""
    inside, entry = _pick(rng, tree) or (None, None)
    if entry is None:
        return None
    what = rng.randrange(4)
    if what == 0:
        inside[-1].entries.remove(entry)
        others = [e.value for _, e in walk(tree) if isinstance(e.value, Box)]
        rng.choice([tree, *others]).entries.append(entry)
    elif what == 1:
        entry.value = Row([entry.value])
    elif what == 2 and isinstance(entry.value, Box):
        at = inside[-1].entries.index(entry)
        inside[-1].entries[at : at + 1] = entry.value.entries
        return f"{entry.key} flattened", [*inside, *entry.value.entries]
    elif isinstance(entry.value, Row) and entry.value.entries:
        entry.value = entry.value.entries[0]
    else:
        entry.value = Box([Entry(entry.key, entry.value)])
    return f"{entry.key} misplaced", [entry, *inside]


def emptied(rng: random.Random, tree: Box) -> Done | None:
    inside, entry = _pick(rng, tree, lambda e: not isinstance(e.value, Leaf)) or (None, None)
    if entry is None:
        return None
    entry.value = rng.choice([Box(), Row(), Leaf(""), Leaf("{}"), Leaf("[]"), Leaf("null")])
    return f"{entry.key} emptied", [entry, *inside]


def other_task(rng: random.Random, tree: Box) -> Done | None:
    table = rng.choice(list(TASKS))
    key, values = rng.choice(TASKS[table])
    box = tree.get(table)
    if not isinstance(box, Box):
        box = tree.put(table, Box()).value
    entry = box.put(key, Leaf(rng.choice(values)))
    return f"{table}.{key}: {entry.value.text}", [entry, box]


def other_whole(rng: random.Random, tree: Box) -> Done | None:
    key = rng.choice(list(WHOLE))
    entry = tree.put(key, to_tree(rng.choice(WHOLE[key])))
    return f"another {key}", [entry]


def other_end(rng: random.Random, tree: Box) -> Done | None:
    ends = tree.get("ends")
    if not isinstance(ends, Box):
        return None
    entry = ends.put(rng.choice(["start", "end"]), to_tree(rng.choice(ENDS)))
    return f"another {entry.key}", [entry]


def swapped(rng: random.Random, tree: Box) -> Done | None:
    """The ends swapped, without what belongs to them."""
    ends = tree.get("ends")
    if not isinstance(ends, Box) or len(ends.entries) < 2:
        return None
    a, b = ends.entries[:2]
    a.value, b.value = b.value, a.value
    return "ends swapped", [a, b]


def other_motion(rng: random.Random, tree: Box) -> Done | None:
    end = tree.get("ends", rng.choice(["start", "end"]))
    if not isinstance(end, Box):
        return None
    entry = end.put("motion", to_tree(rng.choice(MOTIONS)))
    return "another motion", [entry]


def coinciding(rng: random.Random, tree: Box) -> Done | None:
    a, b = tree.get("ends", "start", "position"), tree.get("ends", "end", "position")
    if not (isinstance(a, Row) and isinstance(b, Row)):
        return None
    near = [
        float(x.text) + d
        for x, d in zip(_numbers(a), rng.choice([[0, 0, 0], [1e-12, 0, 0], [0, 0, -1e-3]]), strict=False)
    ]
    end = tree.get("ends", "end")
    return "ends coincide", [end.put("position", to_tree(near))]


def another_length(rng: random.Random, tree: Box) -> Done | None:
    sections = tree.get("cable", "sections")
    boxes = [x for x in sections.entries if isinstance(x, Box)] if isinstance(sections, Row) else []
    by = rng.choice([1e-3, 0.5, 0.9, 0.99, 0.999, 1.001, 1.1, 2.0, 100.0])
    touched = []
    for box in boxes:
        for leaf in _numbers(box.get("length")):
            leaf.text = f"{float(leaf.text) * by:.10g}"
            touched.append(box.find("length"))
    return (f"length times {by:g}", touched) if touched else None


def massless(rng: random.Random, tree: Box) -> Done | None:
    _, entry = _pick(rng, tree, lambda e: e.key in ("mass", "stiffness", "axial_stiffness", "density")) or (None, None)
    if entry is None:
        return None
    entry.value = Leaf(rng.choice(["0", "0.0", "-0.0", "1e-30", "1e-12", "1e-9", "-1"]))
    return f"{entry.key}: {entry.value.text}", [entry]


WAYS: tuple[Way, ...] = (
    forgotten, misspelt, alien, other_type, odd_text, not_a_number, extreme, scaled, with_unit, twice, misplaced,
    emptied, other_task, other_whole, other_end, swapped, other_motion, coinciding, another_length, massless,
)  # fmt: skip
# What only the physics can judge comes four times as often: the reader refuses most of the rest before it is computed.
PHYSICAL = (extreme, scaled, other_task, other_whole, other_end, other_motion, another_length, massless)
WEIGHTS = [4 if way in PHYSICAL else 1 for way in WAYS]
# Ways that harm one key alone, so that a refusal has to point at it: others make contradictions, seen from both sides.
EXPECTED_AT_KEY = {
    "misspelt", "alien", "other_type", "odd_text", "not_a_number", "with_unit", "twice", "emptied", "forgotten",
}  # fmt: skip


def harmed(seed: int, scenes: dict[str, Any]) -> tuple[str, Box, list[Harm]]:
    """Name of the scene, its tree after one to three harms, and these."""
    rng = random.Random(seed)
    name = rng.choice(sorted(scenes))
    tree = to_tree(scenes[name])
    done: list[Harm] = []
    for _ in range(rng.choices([1, 2, 3], [6, 3, 1])[0]):
        for way in rng.choices(WAYS, WEIGHTS, k=10):
            harm = way(rng, tree)
            if harm is not None:
                done.append(Harm(way.__name__, *harm))
                break
    return name, tree, done
