"""The result of a cable and that of the same cable as a network of one line, dataset by dataset."""

from __future__ import annotations

from collections import Counter
from typing import Any, NamedTuple

import numpy as np
import yaml

import hybrid
from hybrid import Result, Scene
from hybrid.scene.read import as_scene
from hybrid.scene.root import LINE, in_full

SAME = 1e-9  # of the scale of a dataset: round-off that a motion of some hundred steps lets grow
# What says how Newton's method went, and clocks: no quantity of the line.
NUMERICS = ("steps/cpu", "steps/correction", "steps/residual", "steps/error", "steps/iterations")
# Instants of extremes: of values that are equal to round-off, as at rest, either is right.
INSTANTS = ("_t_max", "_t_min", "_at_max", "_at_min", "_t", "times")
# Sizes below which a dataset is held against these: what Newton's method leaves of a velocity near rest, and of forces,
# moments and energies, is round-off of the largest forces, F, and of these times the length, FL.
SLOW = 0.05  # m/s or rad/s
SMALL = 1e-3  # of F, or of FL
UNITS_OF_WORK = ("J", "W", "N m")
GRAVITY = 9.81  # m/s2


class Difference(NamedTuple):
    """A dataset that is not the same."""

    name: str
    by: float  # of the scale; infinite: of another size, or known in one of the two alone

    def __str__(self) -> str:
        return f"{self.name} {self.by:.1e}"


def exact_scene(tables: dict[str, Any], dimension: int = 3) -> Scene:
    """The scene of these tables, in space or in a plane, with steps that end at outputs."""
    tables = {key: x for key, x in tables.items() if key != "solver"} | {"dimension": dimension}
    return as_scene(tables | {"output": tables.get("output", {}) | {"exact": True}})


def both(tables: dict[str, Any], rest: bool = False) -> tuple[Result, Result]:
    """The results of a cable and of its network; rest: of their equilibria."""
    scene = exact_scene(tables)
    compute = hybrid.static if rest else hybrid.run
    return compute(scene), compute(in_full(scene))


def differences(cable: Result, network: Result, same: float = SAME) -> list[Difference]:
    """Datasets that differ by more than `same` of their scale, the worst first, and events."""
    line, found = dict(network.lines).get(LINE, network), list[Difference]()
    sections = yaml.safe_load(cable.scene_text)["cable"]["sections"]
    weight = GRAVITY * sum(x["mass"] * x["length"] for x in sections)
    force = max(float(np.abs(cable["tension"]).max()), weight)  # a line that falls has hardly any tension
    length = float(cable["mesh/s"][-1])
    for name in sorted({*cable.names} & {*line.names}):
        if name in NUMERICS or name.endswith(INSTANTS) or name.startswith("events/"):
            continue
        a, b = np.asarray(cable[name]), np.asarray(line[name])
        if a.dtype.kind not in "fiu" or not a.size:
            continue
        if a.shape != b.shape or not np.array_equal(np.isfinite(a), np.isfinite(b)):
            found.append(Difference(name, np.inf))
            continue
        known = np.isfinite(a)
        if known.any():
            scale = max(float(np.abs(a[known]).max()), _least(name, cable, force, length)) or 1.0
            by = float(np.abs(a.astype(float) - b)[known].max()) / scale
            found += [Difference(name, by)] if by > same else []
    return sorted(found, key=lambda x: -x.by)


def _least(name: str, cable: Result, force: float, length: float) -> float:
    unit = cable.units[name]
    if unit in ("m/s", "rad/s", "1/s"):
        return SLOW
    if unit in ("N", "m"):
        return SMALL * (force if unit == "N" else length)
    if unit in ("1/m", "rad/m"):
        return SMALL / length
    return SMALL * force * length if unit in UNITS_OF_WORK else SMALL if unit in ("rad", "deg") else 0.0


def events_differ(cable: Result, network: Result) -> list[str]:
    """Kinds of events that one of the two alone has, or has otherwise often."""
    one, two = (Counter(x.kind for x in each.events) for each in (cable, network))
    return [f"{kind} {one[kind]}:{two[kind]}" for kind in sorted({*one, *two}) if one[kind] != two[kind]]
