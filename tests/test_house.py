"""The house rules that a machine can check: which way imports run, who prints, what a bare import costs."""

from __future__ import annotations

import ast
import json
import statistics
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

import hybrid

PACKAGE = Path(hybrid.__file__).parent
FILES = sorted(PACKAGE.rglob("*.py"))

# Which rooms and files a room may import, most special place first.  `scene` alone means a file or a room.
# Only model/{build,effort,properties,start,ledger,material,plan,plane,reasons,sea} see the scene; solve and adapt never meet; plots read files.
SEES_SCENE = ("errors", "physics", "model", "scene")
ALLOWED: dict[str, tuple[str, ...]] = {
    "errors": (),
    "compiled": (),
    "scene": ("errors", "scene"),
    "physics": ("compiled", "physics"),
    "model/build": SEES_SCENE,
    "model/properties": SEES_SCENE,
    "model/start": SEES_SCENE,
    "model/ledger": (*SEES_SCENE, "adapt/table"),
    "model/plan": SEES_SCENE,
    "model/sea": SEES_SCENE,
    "model/reasons": SEES_SCENE,
    "model/material": SEES_SCENE,
    "model/effort": SEES_SCENE,
    "model/plane": SEES_SCENE,
    "model": ("errors", "physics", "model"),
    "solve/shooting": ("errors", "scene", "solve/shooting"),  # the arbiter shares nothing with production but the scene
    "solve": ("errors", "compiled", "physics", "model/state", "solve"),
    "adapt/table": (),
    "adapt/blend": ("compiled",),
    "adapt/criteria": ("compiled", "physics", "adapt/table"),
    "adapt/plan": ("compiled", "model/state", "adapt/table"),
    "adapt": ("errors", "physics", "model", "adapt"),
    "zoning": ("errors", "correction", "physics", "model", "solve", "adapt"),
    "correction": ("model", "solve", "adapt"),
    # the last three for `to_xarray`, and notebooks
    "results/read": ("errors", "results/intact", "results/part", "results/labelled", "results/card"),
    "results/part": ("errors", "results/read"),
    "results/labelled": ("errors", "results/part"),
    "results/vtk": ("errors", "results/part"),
    "results/fatigue": ("errors", "results/part"),
    "results/intact": ("errors",),
    "results/look": ("errors", "results/read"),
    "results/views": ("errors", "results/read"),
    "results/panels": ("errors", "results/read", "results/look", "results/views"),
    "results/plot": ("errors", "results/read", "results/look", "results/views", "results/panels"),
    "results/zoneplot": ("errors", "results/read", "results/look", "results/views"),
    "results/tradetable": (),
    "results/tradeplot": ("errors", "results/look", "results/tradetable"),
    "results/facts": ("errors", "results/read", "results/look", "results/views"),
    "results/thin": ("results/read",),
    "results/figures": ("results/read", "results/look", "results/views", "results/thin"),
    "results/scenery": (
        "results/read",
        "results/look",
        "results/views",
        "results/thin",
        "results/figures",
        "results/zoneplot",
    ),
    "results/zonemap": (
        "errors",
        "results/read",
        "results/look",
        "results/views",
        "results/thin",
        "results/figures",
        "results/scenery",
        "results/zoneplot",
    ),
    "results/card": ("results/read", "results/look", "results/views", "results/thin", "results/facts"),
    "results/report": (
        "errors",
        "results/read",
        "results/look",
        "results/thin",
        "results/facts",
        "results/figures",
        "results/scenery",
        "results/zonemap",
        "results/card",
    ),
    "results/animate": (
        "errors",
        "results/read",
        "results/look",
        "results/views",
        "results/thin",
        "results/panels",
        "results/scenery",
    ),
    "results/export": (
        "errors",
        "results/read",
        "results/part",
        "results/labelled",
        "results/vtk",
        "results/fatigue",
    ),
    "results/checkpoint": ("errors",),
    "results/room": ("errors",),
    "results/format": ("errors", "results/read"),
    "results/record": (
        "errors",
        "results/intact",
        "results/read",
        "results/checkpoint",
        "results/format",
        "results/room",
    ),
    "results/notebook": ("errors",),
    "results/grid": ("model",),
    "results/touchdown": ("model",),
    "results/probes": ("errors", "physics", "model", "solve", "results/format", "results/grid", "results/touchdown"),
    "watch": ("errors", "physics", "model", "solve", "results"),
    "flat": ("errors", "scene", "model", "solve"),
    "freeze": ("errors", "compiled", ""),
    "between": ("errors", "results/read"),
    "remainder": ("errors", "freeze", "accuracy", "scene", "model", "results"),
    "motion": (
        "errors",
        "freeze",
        "flat",
        "watch",
        "zoning",
        "correction",
        "scene",
        "physics",
        "model",
        "solve",
        "adapt",
        "results",
    ),
    "accuracy": ("errors", "model"),
    "rest": ("errors", "zoning", "scene", "physics", "model", "solve", "adapt"),
    "job": (
        "errors",
        "freeze",
        "remainder",
        "accuracy",
        "correction",
        "rest",
        "motion",
        "watch",
        "zoning",
        "scene",
        "physics",
        "model",
        "solve",
        "adapt",
        "results",
    ),
    "simulate": (
        "errors",
        "between",
        "freeze",
        "remainder",
        "accuracy",
        "job",
        "motion",
        "scene",
        "model",
        "adapt",
        "results",
        "arbitrate",
        "live",
    ),
    "arbitrate": ("errors", "scene", "model", "solve/shooting", "results"),
    "peers": ("scene", "model", "results/probes", "peers"),
    "machine": (),
    "rungs": ("errors", "scene", "results", "simulate", "machine"),
    "ladder": ("errors", "scene", "model", "results", "peers", "rungs"),
    "live": ("errors", "compiled", "results", "model", "simulate", ""),
    "said": ("errors", "scene", "model", "results", "live"),
    "cli": ("errors", "scene", "model", "results", "remainder", "simulate", "ladder", "live", "said", "compiled", ""),
    "__init__": ("errors", "scene", "model", "results", "simulate", "ladder"),
}

# Packages from outside that only these places may import.  A scene has no arrays; its motions and the records
# they are read from are functions of time and need some.
ONLY = {
    "numpy": (
        "physics",
        "model",
        "solve",
        "adapt",
        "results",
        "motion",
        "accuracy",
        "watch",
        "zoning",
        "flat",
        "correction",
        "job",
        "rest",
        "simulate",
        "ladder",
        "rungs",
        "between",
        "remainder",
        "peers",
        "arbitrate",
        "scene/motion",
        "scene/record",
    ),
    "scipy": ("between", "model", "solve", "adapt", "results", "peers", "scene/motion", "scene/record"),
    "numba": ("compiled",),
    "h5py": ("results/record", "results/format", "results/checkpoint", "results/read", "results/part", "results/vtk"),
    "matplotlib": (
        "results/look",
        "results/panels",
        "results/plot",
        "results/zoneplot",
        "results/tradeplot",
        "results/animate",
    ),
    "plotly": ("results/report",),
    "pydantic": ("scene",),
    "ruamel": ("scene",),
    "typer": ("cli",),
    "rich": ("said", "live"),
    "pickle": ("freeze",),
    "filelock": ("results/checkpoint",),
}


def place(file: Path) -> str:
    """ "model/build" for hybrid/model/build.py, "scene" for a room's __init__."""
    name = file.relative_to(PACKAGE).with_suffix("").as_posix()
    return name.removesuffix("/__init__")


def within(place: str, room: str) -> bool:
    return place == room or place.startswith(room + "/") or (room == "" and place == "")


def imports(file: Path) -> Iterator[tuple[str, int]]:
    """Absolute names of all modules a file imports, with their line; those for type checkers alone do not count."""
    tree = ast.parse(file.read_text(encoding="utf-8"))
    for_types = {
        inner
        for node in ast.walk(tree)
        if isinstance(node, ast.If) and isinstance(node.test, ast.Name) and node.test.id == "TYPE_CHECKING"
        for inner in ast.walk(node)
    }
    package = ["hybrid", *file.relative_to(PACKAGE).parent.parts]
    for node in ast.walk(tree):
        if node in for_types:
            continue
        if isinstance(node, ast.Import):
            yield from ((alias.name, node.lineno) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = package[: len(package) - node.level + 1] if node.level else []
            yield ".".join([*base, *([node.module] if node.module else [])]), node.lineno


def rule(place: str) -> tuple[str, ...]:
    """What a file may import: the rule of the nearest room that has one."""
    rooms = [room for room in ALLOWED if within(place, room)]
    assert rooms, f"no rule for hybrid/{place}.py: add one to ALLOWED"
    return ALLOWED[max(rooms, key=len)]


@pytest.mark.parametrize("file", FILES, ids=lambda f: place(f) or "hybrid")
def test_imports_run_one_way(file: Path) -> None:
    here = place(file) if file != PACKAGE / "__init__.py" else "__init__"
    wrong = []
    for name, line in imports(file):
        head, _, rest = name.partition(".")
        if head == "hybrid":
            there = rest.replace(".", "/")
            if not any(within(there, room) for room in rule(here)):
                wrong.append(f"line {line} imports {name}; allowed: {', '.join(rule(here)) or 'nothing'}")
            if within(there, "solve/shooting") and not (within(here, "solve/shooting") or here == "arbitrate"):
                wrong.append(f"line {line} imports the arbiter")
        elif head in ONLY and not any(within(here, room) for room in ONLY[head]):
            wrong.append(f"line {line} imports {name}; that is for {', '.join(ONLY[head])}")
    assert not wrong, f"hybrid/{here}.py: " + "; ".join(wrong)


def test_every_rule_is_about_something() -> None:
    """Rooms that a later issue will fill may be missing; rules for files that were renamed may not."""
    known = {place(f) for f in FILES} | {"__init__"}
    later: set[str] = set()
    assert {room for room in ALLOWED if not any(within(p, room) for p in known)} <= later


def test_only_the_command_line_prints() -> None:
    found = [
        f"{place(file)}.py:{node.lineno}"
        for file in FILES
        if place(file) != "cli"
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8")))
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "print"
    ]
    assert not found


def loaded(code: str) -> set[str]:
    """Top-level packages in memory after `code`."""
    script = f"{code}\nimport sys, json\nprint(json.dumps(sorted({{m.partition('.')[0] for m in sys.modules}})))"
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    return set(json.loads(done.stdout.splitlines()[-1]))


def test_a_bare_import_loads_no_heavy_package() -> None:
    assert not loaded("import hybrid") & {"numpy", "numba", "matplotlib", "h5py", "scipy", "pydantic", "rich"}


def test_a_scene_is_read_without_kernels_or_plots() -> None:
    code = "import hybrid; hybrid.parse_scene('cable: {sections: [{length: 1.0, mass: 1.0}]}\\nends: "
    code += "{start: {kind: pinned, position: [0, 0, 0]}, end: free}\\ninitial: equilibrium\\nmodel: catenary')"
    assert not loaded(code) & {"numba", "matplotlib", "h5py"}


def test_a_result_is_read_without_kernels_or_plots() -> None:
    assert not loaded("import hybrid; hybrid.open, hybrid.Result") & {"numba", "matplotlib", "pydantic"}


def test_importing_costs_at_most_0_4_s() -> None:
    """Against a bare interpreter, median of five: the difference is ours."""

    def seconds(code: str) -> float:
        begin = time.perf_counter()
        subprocess.run([sys.executable, "-c", code], check=True)
        return time.perf_counter() - begin

    pairs = [(seconds("import hybrid"), seconds("pass")) for _ in range(5)]
    assert statistics.median(ours - bare for ours, bare in pairs) <= 0.4


def test_importing_all_public_names_works() -> None:
    for name in hybrid.__all__:
        assert getattr(hybrid, name) is not None
    assert set(hybrid.__all__) <= set(dir(hybrid))
