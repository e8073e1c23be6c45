"""123 power cables: what they are, their equilibria, and what these are held to (test_bench_power_cables.py, board).

`power_cables.json` holds their data: the statics matrix of CableDyn 0.3.0
(https://github.com/SMI-Lab-Inha/CableDyn, Apache-2.0).
"""

from __future__ import annotations

import json
import time
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

import hybrid
from hybrid.errors import ComputationError

DATA = Path(__file__).with_name("power_cables.json")
ROOT, REFERENCE, SHORT = 0.15, 0.01, 0.05
MOVED, FINER, AT_REST = 1e-6, 5e-3, 1e-5
REST = {"duration": 1.0, "step": 0.05}
PARENTS = ("twin_of", "mesh_of", "rest_of")


class Answer(NamedTuple):
    """Tension at the start (N; of a motion at all times), cells, events, refusal, CPU time (s).

    held: N, of the weight in water what the ends hold; least: N, the least tension.
    """

    tension: Any
    cells: int
    events: tuple[str, ...]
    refused: str
    cpu: float
    held: float = np.nan
    least: float = np.nan


def rows() -> dict[str, dict[str, Any]]:
    """The cases by id, each with all that it has from the case that it is a twin of."""
    whole = dict[str, dict[str, Any]]()
    given = {row["id"]: row for row in json.loads(DATA.read_text(encoding="utf-8"))["cases"]}

    def of(name: str) -> dict[str, Any]:
        row = given[name]
        parent = next((row[key] for key in PARENTS if row.get(key)), None)
        kept = {k: v for k, v in of(parent).items() if k not in (*PARENTS, "expect")} if parent else {}
        return kept | row

    for name in given:
        whole[name] = of(name)
    return whole


def scene_of(row: dict[str, Any], cells: int | None = None) -> dict[str, Any]:
    """The scene of a case; a bed of so many N/m per m^2 has that times the diameter per metre of cable."""
    sections = []
    for kind, length, _ in row["sections"]:
        diameter, mass, EA, EI, drag_n, drag_t, added = row["types"][kind]
        sections.append({
            "length": length, "diameter": diameter, "mass": mass, "axial_stiffness": EA, "drag": {"normal": drag_n, "tangential": drag_t}, "added_mass": {"normal": added},
            **({"bending_stiffness": EI} if EI else {}),
        })  # fmt: skip
    ends = {}
    for name, place, clamp in (("start", "start", "clamp_a"), ("end", "end", "clamp_b")):
        ends[name] = {"kind": "pinned", "position": row[place]}
        if row.get(clamp):
            stiffness, tangent = row[clamp]
            ends[name] |= {"kind": "clamped", "tangent": tangent}
            ends[name] |= {} if stiffness is None else {"bend_stiffness": stiffness}
    environment: dict[str, Any] = {
        "gravity": 9.80665, "fluid": {"density": 1025.0, "surface": 0.0, "current": row.get("current", [0, 0, 0])},
    }  # fmt: skip
    bed = row["bed"]
    if bed:
        x, y, depth = bed.get("grid", (None, None, None))
        environment["seabed"] = {
            "z": 0.0 if x else -bed["depth"], "stiffness": bed["stiffness"] * sections[0]["diameter"],
            **({"depths": {"x": x, "y": y, "depth": depth}} if x else {"slope": [bed.get("slope", 0.0), 0.0]}),
            **({"friction": bed["friction"]} if bed.get("friction") else {}),
        }  # fmt: skip
    return {
        "environment": environment, "cable": {"sections": sections}, "ends": ends, "initial": "equilibrium",
        **({"mesh": {"cells": cells}} if cells else {}),
        **({"time": REST} if row.get("rest_of") else {}),
    }  # fmt: skip


def answer_of(scene: dict[str, Any]) -> Answer:
    begin = time.process_time()
    try:
        found = hybrid.run(scene, None) if "time" in scene else hybrid.static(scene)
    except ComputationError as error:
        return Answer(np.nan, 0, (), str(error).splitlines()[0], time.process_time() - begin)
    cpu = time.process_time() - begin
    tension = np.linalg.norm(found.reaction_start, axis=1)
    held, least = found.reaction_start[-1, 2] + found.reaction_end[-1, 2], found.tension[-1].min()
    events = tuple(sorted({x.kind for x in found.events}))
    return Answer(tension, found.mesh[0].s.size - 1, events, "", cpu, float(held), float(least))


def bound_of(row: dict[str, Any], tension: float) -> tuple[float, float]:
    """How far a tension (N) is from what it is compared with, as a part of that, and how far it may be; nan: nothing."""
    if row.get("reference"):
        return abs(tension / row["reference"] - 1.0), REFERENCE
    if row["roots"]:
        off = min(abs(tension / root - 1.0) for root in row["roots"])
        return off, ROOT if row["bending_length"] < SHORT else np.inf
    return np.nan, np.inf


def by_friction(row: dict[str, Any], answer: Answer) -> float:
    """What the friction of a bed may change of the tension at the start, as a part of it: that of all that lies there."""
    friction = (row["bed"] or {}).get("friction", 0.0)
    if not friction or not answer.cells:
        return 0.0
    weight = 0.0
    for kind, length, _ in row["sections"]:
        diameter, mass = row["types"][kind][:2]
        weight += 9.80665 * length * (mass - 1025.0 * np.pi / 4.0 * diameter**2)
    return float(friction * max(weight - answer.held, 0.0) / answer.tension[-1])


def twin_bound(row: dict[str, Any]) -> tuple[str, float]:
    """The case that a case is a twin of, and how far it may be from that without friction; "": none.

    A bed of depths may differ from a plane one: they are as near.
    """
    for key, bound in zip(PARENTS, (MOVED, FINER, AT_REST), strict=True):
        if row.get(key):
            return row[key], bound
    return "", np.inf


def twin_answer(row: dict[str, Any], parent: Answer) -> tuple[Answer, Answer]:
    """The answer of a twin, and that which it is compared with.

    A motion from rest has as many equal cells as its parent has, which may be graded: it is compared with the
    equilibrium on its own mesh.
    """
    if not row.get("rest_of") or not parent.cells:
        cells = row["finer"] * parent.cells if row.get("mesh_of") else None
        return answer_of(scene_of(row, cells)), parent
    scene = scene_of(row, parent.cells)
    return answer_of(scene), answer_of({key: value for key, value in scene.items() if key != "time"})


class Solved(NamedTuple):
    """What came of one case: its answer, tension at the start (N), distances to what it is compared with, verdict.

    off: from a root or a value of OrcaFlex, apart: from its twin, as parts; nan: nothing to compare with.
    """

    row: dict[str, Any]
    answer: Answer
    tension: float
    off: float
    apart: float
    good: bool

    @property
    def admissible(self) -> bool:
        """Whether it has to be solved; the mesh of the deck is not that of ours."""
        return self.row["expect"] in ("admissible", "fine_mesh")

    @property
    def silent(self) -> bool:
        """Whether a line in compression was solved without a word; with friction another program's may be where ours is not."""
        return not self.admissible and self.answer.least < 0.0 and not self.answer.events

    @property
    def judged_by_root(self) -> bool:
        """Whether a catenary between the same ends says what its tension is."""
        return bool(self.row["roots"]) and self.row["bending_length"] < SHORT and bool(self.answer.cells)


def solve_all() -> dict[str, Solved]:
    """Every case by its id."""
    cases, found = rows(), dict[str, Solved]()
    for name, row in cases.items():
        parent, bound = twin_bound(row)
        if parent:
            answer, other = twin_answer(row, found[parent].answer)
        else:
            answer, other = answer_of(scene_of(row)), None
        tension = float(answer.tension[-1]) if answer.cells else np.nan
        off, most = bound_of(row, tension)
        apart, good = np.nan, bool(answer.cells) and not off > most
        if other is not None and answer.cells and other.cells:
            twin, held = answer, by_friction(row, answer)
            if held and row.get(
                "twin_of"
            ):  # a twin of a line without friction, and as near to it as friction lets it be
                twin = answer_of(scene_of(row) | {"initial": {"kind": "equilibrium", "friction": "neglected"}})
                good &= not abs(answer.tension[-1] / twin.tension[-1] - 1.0) > held
            apart = float(np.abs(twin.tension / other.tension[-1] - 1.0).max())
            good &= not apart > bound
        found[name] = Solved(row, answer, tension, off, apart, good)
    return found
