"""The process that compiles beside the first run."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

import hybrid
from hybrid.kernels.machine.kept_code import KeptCode
from hybrid.kernels.reel import node_changes, payout, payout_nodes
from hybrid.scene.read import as_scene
from hybrid.simulation import first_use


@pytest.mark.parametrize("name", ["hybrid", "numpy", "signal"])
def test_files_of_the_present_folder_are_not_run(name: str, tmp_path: Path) -> None:
    """A user's numpy.py beside the scene is no module of the second process."""
    (tmp_path / f"{name}.py").write_text("open('run', 'w').close()\nraise SystemExit(3)\n")
    done = subprocess.run(first_use.command_to_compile([]), cwd=tmp_path, capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "") and not (tmp_path / "run").exists()


@pytest.mark.parametrize("frozen", [False, True])
def test_a_frozen_application_does_not_start_itself(frozen: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    started: list[Any] = []

    class Started:
        def __init__(self, **arguments: Any) -> None:
            started.append(arguments)

        def start(self) -> None:
            pass

    monkeypatch.setattr(sys, "frozen", frozen, raising=False)
    monkeypatch.setattr(first_use, "is_ready", lambda _: False)
    monkeypatch.setattr("os.cpu_count", lambda: 2)
    monkeypatch.setattr(first_use, "Thread", Started)
    first_use.compile_beside(hybrid.validate_scene(first_use.SAMPLE))
    assert len(started) == (not frozen)


def test_kernels_of_a_line_that_is_paid_out_are_compiled_beside() -> None:
    """All entries that take a table, of which none is forgotten, but for what joined lines and a release ask for."""
    others = {"end_payout", "iterate_with_others"}
    entry = type(node_changes.plan_node)
    used = {
        x.__qualname__
        for module in (payout, payout_nodes, node_changes)
        for x in vars(module).values()
        if isinstance(x, entry) and list(x.py_func.__code__.co_varnames[: x.py_func.__code__.co_argcount]) == ["table"]
    }
    assert used - others <= {x.__qualname__ for x in first_use.payout_kernels()}
    ends = {"start": {"kind": "free"}, "end": {"kind": "pinned", "position": [0, 0, 0], "payout": {"longest": 60}}}
    scene = hybrid.validate_scene({
        "cable": {"sections": [{"length": 40.0, "mass": 2.0}]}, "ends": ends, "initial": "equilibrium",
        "model": "catenary", "mesh": {"cells": 20}, "time": {"duration": 10, "step": 0.05},
    })  # fmt: skip
    paid = first_use.PAYOUT_OF_LINES[0]
    assert paid in first_use.kernels_of(scene)
    assert paid not in first_use.kernels_of(scene, static=True)


ROPE = {"length": 12, "mass": 2.0, "diameter": 0.02, "axial_stiffness": 1e5}
WIRE = ROPE | {"bending_stiffness": 5.0}
POINTS = {"a": {"position": [0, 0, 0]}, "b": {"position": [10, 0, 0]}, "c": {"position": [10, 5, 0]}}
TIME = {"time": {"duration": 0.1, "step": 0.05}}


def one(section: dict[str, Any], model: str, **more: Any) -> dict[str, Any]:
    ends = {name: {"kind": "pinned", "position": POINTS[at]["position"]} for name, at in (("start", "a"), ("end", "b"))}
    return {
        "cable": {"sections": [section]}, "ends": ends, "initial": "equilibrium", "model": model, "mesh": {"cells": 12},
        "contact": {"self": False},
    } | TIME | more  # fmt: skip


def named(section: dict[str, Any], model: str, **more: Any) -> dict[str, Any]:
    """The same line with a name."""
    line = {"sections": [section], "model": model, "mesh": {"cells": 12}, "start": "a", "end": "b"}
    line |= {key: more.pop(key) for key in [*more] if key == "contact"}
    return {"points": {x: POINTS[x] for x in "ab"}, "lines": {"one": {"contact": {"self": False}} | line}} | TIME | more


def two(section: dict[str, Any] = ROPE, line: dict[str, Any] | None = None, **more: Any) -> dict[str, Any]:
    lines = {x: {"sections": [section], "mesh": {"cells": 12}, "start": "a", "end": x} for x in "bc"}
    lines["b"] |= line or {}
    return {"points": POINTS, "lines": lines} | TIME | more


WINCH = {"connections": {"end": {"payout": {"rate": 0.1, "ramp": 0.1}}}}
ALONE: dict[str, tuple[dict[str, Any], str, dict[str, Any]]] = {
    "catenary": (ROPE, "catenary", {}),
    "rod in a plane": (WIRE, "rod", {}),
    "rod in space": (WIRE, "rod", {"dimension": 3}),
    "zones that move": (WIRE, "adaptive", {}),
    "error of bending": (WIRE, "catenary", {"output": {"errors": True}}),
    "contact with itself": (WIRE, "rod", {"contact": {"self": True}}),
    "on a floor": (WIRE, "rod", {"obstacles": {"floor": {"kind": "plane", "at": [0, 0, -1], "normal": [0, 0, 1]}}}),
}
KINDS = {
    **{name: one(section, model, **more) for name, (section, model, more) in ALONE.items()},
    **{f"{name}, with a name": named(section, model, **more) for name, (section, model, more) in ALONE.items()},
    "two lines": two(),
    "two lines that touch": two(contact={"friction": 0.2}),
    "two lines whose zones move": two(WIRE, {"model": "adaptive"}),
    "two lines and a winch": two(line=WINCH),
}


@pytest.mark.parametrize("static", [True, False])
@pytest.mark.parametrize("kind", KINDS)
def test_what_a_scene_calls_is_known_beforehand(kind: str, static: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of the kernels that take long to compile: else a machine would be said to be ready while they compile."""
    called: set[str] = set()
    taking = KeptCode.taking
    monkeypatch.setattr(KeptCode, "taking", lambda self, args: (called.add(self._name), taking(self, args))[1])
    scene = as_scene(KINDS[kind])
    known = first_use.kernels_of(scene, static)
    hybrid.static(scene) if static else hybrid.run(scene)
    texts = [x for value in vars(first_use).values() for x in (value if isinstance(value, tuple) else (value,))]
    large = {x for x in texts if isinstance(x, str) and x.count(".") == 2}
    assert {"run.entry.in_space", "run.network.begin_line"} < large
    before = {first_use.ZONES: first_use.CRITERIA, first_use.STEPS_OF_LINES: first_use.REST_OF_LINES}
    stood_for = {before[name] for name in known if name in before}  # compiled before those, by the same calls
    if "zones" in kind:
        stood_for.add(first_use.STABILITY)  # zones may come out without a rod: nobody knows before
    assert not (called & large) - set(known) - stood_for


@pytest.mark.long
def test_an_equilibrium_in_a_plane_asks_for_no_solver_in_space() -> None:
    """Whose compilation takes longest; in a process of its own, where nothing is compiled or loaded yet."""
    code = "import hybrid, json, sys; from hybrid.kernels.run import entry; hybrid.static(json.loads(sys.argv[1])); "
    code += "print(len(entry.in_plane.signatures), len(entry.in_space.signatures))"
    done = subprocess.run(
        [sys.executable, "-c", code, json.dumps(KINDS["rod in a plane"])], capture_output=True, text=True, check=True
    )
    assert done.stdout.split() == ["1", "0"]


@pytest.mark.parametrize("kind", [x for x in KINDS if x.startswith(("rod in", "zones that move"))])
def test_a_line_that_is_joined_to_nothing_asks_for_no_solver_of_joined_ones(
    kind: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Nor one in a plane for that in space: together they take longer to compile than all else."""
    called: set[str] = set()
    taking = KeptCode.taking
    monkeypatch.setattr(KeptCode, "taking", lambda self, args: (called.add(self._name), taking(self, args))[1])
    hybrid.run(KINDS[kind])
    assert not called & {"run.network.solve_system", "junctions.junctions.join_lines"}
    assert ("run.entry.in_space" in called) == kind.startswith("rod in space")
