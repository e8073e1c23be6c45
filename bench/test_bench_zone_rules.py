"""What each named number of the domain manager buys: each is doubled and halved alone, in scenes whose zones move.

    pytest bench/test_bench_zone_rules.py -m bench -n 0 -s
    HYBRID_BENCH_ONLY="BUFFER,off of bend" HYBRID_BENCH_ENOUGH=0.5 HYBRID_BENCH_WRITE=rules.jsonl pytest bench/test_bench_zone_rules.py -m bench -n 0 -s

Each variant is a copy of the package with one number changed and a copy of the compiled kernels, in a process of its
own, so that only what reads the number is compiled again.  It has five figures of each scene: the largest difference of
position (of the length) and of tension (of the largest) to rods everywhere, the mean number of rod cells, changes of
zones, and repeated steps.  Rods are on the same cells; where cells follow the curvature they are on many.
ENOUGH: a number is not halved where doubling moves errors or rod cells by more than this part; absent: each is.
WRITE: a file for all figures.
"""

from __future__ import annotations

import ast
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest

import hybrid
from hybrid.errors import ZONE_EVENTS
from hybrid.kernels.machine.cache import cache_folder
from tests.scenes import cable_scene, clamped_at, pinned_at

pytestmark = pytest.mark.bench
ROOT = Path(__file__).parents[1]
FILES = (
    "zones/manager.py", "zones/change.py", "kernels/mesh/zone_criteria.py", "kernels/mesh/zone_plan.py",
    "kernels/mesh/zone_step.py", "kernels/mesh/zone_transfer.py", "kernels/mesh/cell_lengths.py",
    "kernels/mesh/cell_errors.py",
)  # fmt: skip
ONLY = [x for x in os.environ.get("HYBRID_BENCH_ONLY", "").split(",") if x]
ENOUGH = float(os.environ.get("HYBRID_BENCH_ENOUGH", "inf"))
WRITE = os.environ.get("HYBRID_BENCH_WRITE", "")
UNIT = re.compile(r"#\s*(?:of )?(rad|m|s|N/m|steps?|cells|base cells|nodes|ramp times|hold times|l0|W)\b")
FACTORS = (2.0, 0.5)
FIGURES = ("position", "tension", "rod cells", "changes", "retries")
LEAST = (1e-5, 1e-3, 1.0, 1.0, 1.0)  # what a part is taken of at least, of each figure
SAME = 1e-9  # of a figure
FINE = 500  # rod cells, of the reference of cells that follow
Tables = dict[str, Any]


class Constant(NamedTuple):
    """A number with a name in a file of the package, and the columns of its line where it is written."""

    file: str
    name: str
    value: float | tuple[float, ...]
    unit: str
    line: int
    begin: int
    end: int


def numbers_of(node: ast.expr) -> Any:
    """The number or numbers that an expression of literals is; None: it is another thing."""
    kinds = (ast.Constant, ast.Tuple, ast.BinOp, ast.UnaryOp, ast.operator, ast.unaryop, ast.Load)
    if not all(isinstance(x, kinds) for x in ast.walk(node)):
        return None
    value = eval(ast.unparse(node))  # literals alone
    parts = value if isinstance(value, tuple) else (value,)
    return value if all(type(x) in (int, float) for x in parts) else None


def constants() -> list[Constant]:
    """Those of FILES, with the `off` of each criterion.

    Integers in successive statements one of which is 0 or a range are codes or columns, and are left out.
    """
    found: list[Constant] = []
    for file in FILES:
        text = (ROOT / "hybrid" / file).read_text(encoding="utf-8")
        lines, group = text.splitlines(), list[tuple[ast.expr, ast.expr]]()
        codes, numbers = False, list[tuple[str, ast.expr]]()
        for node in [*ast.parse(text).body, ast.Pass()]:
            target = node.targets[0] if isinstance(node, ast.Assign) else None
            value = numbers_of(node.value) if isinstance(node, ast.Assign) else None
            ranged = isinstance(node, ast.Assign) and ast.unparse(node.value).startswith("range(")
            if not (ranged or type(value) is int):
                numbers += [] if codes else [(x.id, y) for x, y in group if isinstance(x, ast.Name)]
                group, codes = [], False
            codes = codes or ranged or (value == 0 and type(value) is int)
            if isinstance(node, ast.Assign) and isinstance(target, ast.Tuple) and isinstance(node.value, ast.Tuple):
                numbers += [(ast.unparse(x), y) for x, y in zip(target.elts, node.value.elts, strict=True)]
            elif isinstance(node, ast.Assign) and target is not None and value is not None:
                group.append((target, node.value))
            elif isinstance(node, ast.AnnAssign) and ast.unparse(node.target) == "CRITERIA":
                calls = [x for x in ast.walk(node) if isinstance(x, ast.Call)]
                numbers += [(f"off of {ast.literal_eval(x.args[0])}", x.args[-1]) for x in calls]
            if not (ranged or type(value) is int):
                numbers += [(x.id, y) for x, y in group if isinstance(x, ast.Name)]
                group = []
        for name, at in numbers:
            value = numbers_of(at)
            if (value is not None and name.isupper()) or name.startswith("off of"):
                unit = UNIT.search(lines[at.lineno - 1])
                end = at.end_col_offset or 0
                found.append(Constant(file, name, value, unit.group(1) if unit else "", at.lineno, at.col_offset, end))
    return found


# --- scenes ----------------------------------------------------------------------------------------


def example(name: str, *settings: str) -> Tables:
    """An example with other settings."""
    path = ROOT / "examples" / f"{name}.yaml"
    found: Tables = hybrid.load_scene(path, list(settings)).model_dump(exclude_none=True)
    return found


WAVES = "environment.fluid={density: 1025, surface: 5, current: [0, 0.3, 0], waves: {kind: regular, height: 4, period: 8, ramp: 8}}"
CALM = "environment.fluid={density: 1025, surface: 5, waves: {kind: regular, height: 0.5, period: 5, ramp: 5}}"
BED = "environment.seabed={z: -100, stiffness: 5.0e+3, damping: 5.0e+2, friction: 0.5}"
FOLLOWS = "model={kind: adaptive, curvature_error: 0.03}"
LIMP = {"length": 10.0, "mass": 1.0, "diameter": 0.02, "axial_stiffness": 1e5, "bending_stiffness": 0.64, "torsional_stiffness": 0.5,
        "damping": {"mass": 3.0}}  # fmt: skip
CLUMP = [{"kind": "clump", "at": 5.0, "mass": 1.0}]
PIPE = {"kind": "cylinder", "at": [4, 0, -4.6], "axis": [0.1, 1, 0.05], "radius": 0.8, "friction": 0.3}
MOVES = {"kind": "adaptive", "tolerance": 1e-3, "hold_time": 0.5, "always_move": True}
TIMES: Tables = {"time": (6.0, 0.02), "output": (0.1, 51), "contact": {"self": False}, "mesh": 50}


def to_and_fro(by: list[float], over: float) -> Tables:
    """A motion that begins and ends at rest."""
    return {"motion": {"travel": {"by": by, "over": over}}}


def limp(start: Any, end: Any, tolerance: float = 1e-3, model: Tables = MOVES, **more: Any) -> Tables:
    """10 m of a limp line between two ends."""
    section = LIMP | more.pop("section", {})
    return cable_scene(section, start, end, **TIMES | {"model": model | {"tolerance": tolerance}} | more)


def paid_out(model: Tables, rate: float = 0.8) -> Tables:
    """100 m that touch the bed, paid out at a clamp that heaves."""
    section = {"length": 100.0, "mass": 5.0, "diameter": 0.05, "axial_stiffness": 2e6, "bending_stiffness": 500.0,
               "torsional_stiffness": 400.0}  # fmt: skip
    winch = clamped_at([80, 0, 0], [1, 0, 0.5], payout={"rate": rate, "ramp": 4.0, "longest": 120.0},
                       motion={"heave": {"amplitude": 1.0, "period": 4.0}, "ramp": 4.0})  # fmt: skip
    return cable_scene(section, pinned_at(0, 0, 0), winch, seabed={"z": -18, "stiffness": 5e3, "damping": 5e2}, model=model,
                       mesh=40, time=(8.0, 0.05), output=(0.25, 51))  # fmt: skip


def scenes() -> dict[str, Tables]:
    """Tables by name."""
    shown = "output={every: 0.4, points: 126}"
    nods = {"yaw": {"amplitude": 20.0, "period": 5.0}, "surge": {"amplitude": 0.3, "period": 3.0}, "ramp": 2.0}
    turns = clamped_at([10.002, 0, 0], [1, 0, 0], motion={"roll": {"amplitude": 720.0, "period": 12.0}, "ramp": 2.0})
    level = clamped_at([0, 0, 0], [1, 0, 0])
    moved = PIPE | to_and_fro([0.0, 0.3, 2.2], 4.0)
    whip = {"length": 300, "diameter": 0.05, "mass": 10, "axial_stiffness": 2e8, "bending_stiffness": 2e4}
    return {
        "touchdown": example("touchdown", WAVES, BED, "time.duration=32", shown),
        "touchdown, curvature": example("touchdown", WAVES, BED, "time.duration=24", shown, "accuracy={line_tension: 5%, curvature: 10%, bending_moment: 10%}", "time.step=0.1"),
        "touchdown, hold time": example("touchdown", "time.duration=32", shown, "model.hold_time=2"),
        "touchdown, short hold time": example("touchdown", "time.duration=32", shown, "model.hold_time=1"),
        "touchdown, eases": example("touchdown", CALM, "ends.end.motion={travel: {by: [-12, 0, 0], over: 8}}", "time.duration=60", shown),
        "touchdown, own steps": example("touchdown", "time.duration=24", shown, "accuracy={position: 0.1%}", "time.step=null"),
        "s tether": example("s_tether", "time.duration=20", "output={every: 0.25, points: 61}"),
        "slack loop": limp(pinned_at(0, 0, 0), pinned_at(9, 0, 0, **to_and_fro([-8.0, 0, 0], 4.0))),
        "light line": limp(pinned_at(0, 0, 0), pinned_at(10.01, 0, 0, **to_and_fro([-0.6, 0, 0], 4.0)), dimension=2, section={"mass": 0.322, "drag": {"normal": 1.2}}, fluid={"density": 1025}),
        "meets itself": limp(pinned_at(0, 0, 0), pinned_at(4, 0.05, 0, **to_and_fro([-6.5, 0, 0], 5.0)), contact={"self": True}),
        "clamps, clump": limp(clamped_at([0, 0, 0], [1, 0, -0.3], motion=nods), clamped_at([9.5, 0, 0], [1, 0, 0.3]), 5e-4, attachments=CLUMP),
        "pipe that moves": limp(pinned_at(0, 0, 0), pinned_at(7.5, 0, 0), obstacles={"pipe": moved}),
        "held twist": limp(level, turns, section={"mass": 0.1, "torsional_stiffness": 12.8}),
        "paid out": paid_out(MOVES | {"hold_time": 1.0}),
        "paid out fast": paid_out(MOVES | {"hold_time": 1.0}, 2.5),
        "paid out, follows": paid_out({"kind": "adaptive", "tolerance": 1e-3, "hold_time": 1.0, "curvature_error": 0.05, "rod_cell": 1.0}),
        "follows": example("touchdown", FOLLOWS, "time.duration=16", shown, "mesh={cells: 24}"),
        "follows, zones": example("touchdown", WAVES, BED, "model={kind: adaptive, curvature_error: 0.05, hold_time: 2.0}", "time.duration=16", shown, "mesh={cells: 24}"),
        "whip": cable_scene(whip, pinned_at(0, 0, 0, **to_and_fro([6.0, 0, 0], 1.0)), "free", dimension=2, mesh=24, time=(8.0, 0.02), output=(0.2, 121),
                            model={"kind": "adaptive", "curvature_error": 0.02, "force_rod": [[0, 300]]}),
    }  # fmt: skip


def rods(tables: Tables) -> Tables:
    """Rods everywhere: on the same cells, or on many where cells follow the curvature."""
    follows = "curvature_error" in tables["model"]
    return tables | {"model": "rod"} | ({"mesh": {"cells": FINE}} if follows else {})


def figures(result: hybrid.Result, r: np.ndarray, T: np.ndarray) -> list[float]:
    """FIGURES of a result; r, T: position and tension of rods."""
    far = np.nanmax(np.linalg.norm(result.position - r, axis=2)) / result.s[-1]
    tension = np.nanmax(np.abs(result.tension - T)) / np.nanmax(np.abs(T))
    cells = np.mean([(mesh.kinds == "rod").sum() for mesh in result.mesh])
    changes = [x.kind for x in result.events if x.kind in ZONE_EVENTS]
    return [float(far), float(tension), float(cells), float(len(changes)), float(changes.count("retry"))]


def measured(references: Path) -> dict[str, list[float] | str]:
    """Figures of all scenes by the package that is imported, or why a run fails."""
    found: dict[str, list[float] | str] = {}
    with np.load(references) as file:
        for name, tables in scenes().items():
            try:
                found[name] = figures(hybrid.run(tables), file[f"{name}/r"], file[f"{name}/T"])
            except Exception as error:
                found[name] = f"{type(error).__name__}: {error!s:.80}"
    return found


# --- variants --------------------------------------------------------------------------------------


def scaled(value: float | tuple[float, ...], factor: float) -> float | tuple[float, ...]:
    """Integers stay such, of at least 1."""
    if isinstance(value, tuple):
        return tuple(factor * x for x in value)
    return max(round(factor * value), 1) if isinstance(value, int) else factor * value


def variant(constant: Constant, factor: float, references: Path) -> dict[str, list[float] | str]:
    """Figures of all scenes with one number changed."""
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        shutil.copytree(ROOT / "hybrid", folder / "hybrid", ignore=shutil.ignore_patterns("__pycache__"))
        shutil.copytree(cache_folder().parents[1], folder / "cache")
        file = folder / "hybrid" / constant.file
        lines = file.read_text(encoding="utf-8").split("\n")
        text = lines[constant.line - 1]
        lines[constant.line - 1] = text[: constant.begin] + repr(scaled(constant.value, factor)) + text[constant.end :]
        file.write_text("\n".join(lines), encoding="utf-8")
        return in_process(folder, references)


def in_process(folder: Path, references: Path) -> dict[str, list[float] | str]:
    """What `measured` says of the package in a folder; its cache is beside it."""
    paths = os.pathsep.join([str(folder), str(ROOT)])
    variables = os.environ | {"PYTHONPATH": paths, "HYBRID_CACHE_DIR": str(folder / "cache")}
    command = [sys.executable, "-W", "ignore", str(Path(__file__)), str(references)]
    done = subprocess.run(command, env=variables, cwd=folder, capture_output=True, text=True, check=False)
    if done.returncode:
        return dict.fromkeys(scenes(), done.stderr.strip().splitlines()[-1][:100])
    found: dict[str, list[float] | str] = json.loads(done.stdout.splitlines()[-1])
    return found


def moved(before: dict[str, Any], after: dict[str, Any]) -> list[str]:
    """For each figure how it moves in the scene where it moves most, and runs that fail; "": it moves nowhere."""
    said = []
    both = {name: (x, after[name]) for name, x in before.items() if not isinstance(after[name], str)}
    for k, least in enumerate(LEAST):
        by = {name: (y[k] - x[k]) / max(x[k], least) for name, (x, y) in both.items()}
        name = max(by, key=lambda x: abs(by[x]))
        old, new = (x[k] for x in both[name])
        much = f"{old:.0f} -> {new:.0f}" if k > 2 else f"{100 * by[name]:+.2g} %"
        said.append(f"{much} ({name})" if abs(by[name]) > SAME else "")
    return [*said, ", ".join(f"{name}: {x}" for name, x in after.items() if isinstance(x, str))]


def largest_part(before: dict[str, Any], after: dict[str, Any]) -> float:
    """By how much errors and rod cells move at most, of today's."""
    found = [(after[name], x) for name, x in before.items() if not isinstance(after[name], str)]
    return max(abs(y[k] - x[k]) / max(x[k], LEAST[k]) for y, x in found for k in range(3))


def test_what_each_number_buys(tmp_path: Path) -> None:
    references, known = tmp_path / "rods.npz", dict[str, Any]()
    for name, tables in scenes().items():
        with hybrid.run(rods(tables)) as result:
            known[f"{name}/r"], known[f"{name}/T"] = result.position, result.tension
    np.savez(references, **known)
    measured(references)  # compiles
    before = measured(references)
    for name, x in before.items():
        print(f"{name:22s} {x if isinstance(x, str) else '  '.join(f'{y:8.3g}' for y in x)}")
    nothing = []
    for constant in constants():
        if ONLY and not {constant.name, f"{Path(constant.file).stem}.{constant.name}"} & {*ONLY}:
            continue
        any_moves = False
        for factor in FACTORS:
            after = variant(constant, factor, references)
            said = moved(before, after)
            any_moves = any_moves or any(said)
            text = "; ".join(f"{what} {x}" for what, x in zip((*FIGURES, "fails"), said, strict=True) if x)
            print(f"{constant.file} {constant.name} = {constant.value} {constant.unit}", end=" ")
            print(f"x{factor:g}: {text or 'nothing'}", flush=True)
            if WRITE:
                with Path(WRITE).open("a", encoding="utf-8") as file:
                    file.write(json.dumps([*constant[:4], factor, said, after]) + "\n")
            if largest_part(before, after) > ENOUGH:
                break
        if not any_moves:
            nothing.append(constant.name)
    print(f"\nmoves nothing in these scenes: {', '.join(nothing)}")
    assert not any(isinstance(x, str) for x in before.values())


if __name__ == "__main__":
    print(json.dumps(measured(Path(sys.argv[1]))))
