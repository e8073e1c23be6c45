"""Inputs and outputs of a design as a component: names, units, rows of results, bounds."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from hybrid.designs.equilibria import AnyScene
from hybrid.designs.numbers import unit_of_key
from hybrid.designs.problem import Problem
from hybrid.outputs.probes import PROBES
from hybrid.scene.base import Finding
from hybrid.scene.design import NAMED, Design, OfEquilibrium
from hybrid.scene.read import TaskFile

# Arithmetic of a design whose results are wanted and nothing is minimised; the output that has what is.
NOTHING, MINIMISED = "0", "minimised"


class Output(NamedTuple):
    """An output: rows of results (k,), its unit in our words, what it is, bounds and scale where it is a limit.

    low, high: equal for a target, infinite for none.
    """

    rows: np.ndarray
    unit: str
    text: str
    low: float = -np.inf
    high: float = np.inf
    scale: float = 1.0


class Input(NamedTuple):
    """An input: where it begins, its unit in our words, its keys, bounds."""

    start: float
    unit: str
    text: str
    low: float
    high: float


def refuse_ports(task: TaskFile[Design]) -> None:
    """SceneError: what was measured is no output, and OpenMDAO has names without dots, each once."""
    asked, found = task.asked, []
    if asked.measured is not None:
        found.append(Finding(("measured",), "results, limits or minimise: an identification has no outputs"))
    tables = ("unknowns", "results", "targets", "limits")
    taken = [MINIMISED]
    for table in tables:
        for name in getattr(asked, table):
            if not name.isidentifier():
                found.append(Finding((table, name), NAMED, f"length: {{key: {name}}}" if table == "unknowns" else ""))
            elif name in taken:
                found.append(Finding((table, name), f"a name of its own, none of {', '.join(taken)}"))
            taken.append(name)
    if found:
        raise task.refusal(found)


def inputs_of(problem: Problem, scene: AnyScene) -> dict[str, Input]:
    space, keys = problem.space, problem.equilibria.keys
    rows = zip(space.names, space.start.tolist(), keys, space.low.tolist(), space.high.tolist(), strict=True)
    return {
        name: Input(start, unit_of_key(scene, group[0]), ", ".join(group), low, high)
        for name, start, group, low, high in rows
    }


def outputs_of(problem: Problem, task: TaskFile[Design], scene: AnyScene) -> dict[str, Output]:
    """Outputs by name, in the order of the design."""
    out: dict[str, Output] = {}
    results = problem.objective.results if problem.objective is not None else {}
    for name, each in task.asked.results.items():
        out[name] = _output(problem, np.array([results[name]]), scene, each.quantity)
    bounded: Mapping[str, OfEquilibrium] = {**task.asked.targets, **task.asked.limits}
    for name, limit in bounded.items():
        own = [c for c in problem.constraints if c.name == name]
        rows = np.array([*dict.fromkeys(c.row for c in own)])
        low = max((c.bound for c in own if c.side <= 0), default=-np.inf)
        high = min((c.bound for c in own if c.side >= 0), default=np.inf)
        bare = _output(problem, rows, scene, limit.quantity)
        out[name] = bare._replace(low=low, high=high, scale=max(c.scale for c in own) or 1.0)
    return out


def _output(problem: Problem, rows: np.ndarray, scene: AnyScene, quantity: str) -> Output:
    wanted = [problem.equilibria.wanted[k] for k in rows]
    text = "; ".join(f"{result} ({case})" if case else result for case, result in wanted)
    return Output(rows, unit_of_quantity(scene, quantity.split(".")[0]), text)


def unit_of_quantity(scene: AnyScene, name: str) -> str:
    """The unit of a quantity that is recorded of a scene, or of one of its own `output.quantities`."""
    if name in PROBES:
        return PROBES[name].unit
    own = scene.output.quantities or {}
    return own[name].unit if name in own else ""
