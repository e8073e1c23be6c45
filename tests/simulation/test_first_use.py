"""The process that compiles beside the first run."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

import hybrid
from hybrid.kernels.reel import payout, payout_nodes
from hybrid.kernels.run import payout_run
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
    monkeypatch.setattr(first_use, "is_warm", lambda _: False)
    monkeypatch.setattr("os.cpu_count", lambda: 2)
    monkeypatch.setattr(first_use, "Thread", Started)
    first_use.compile_beside(hybrid.validate_scene(first_use.SAMPLE))
    assert len(started) == (not frozen)


def test_kernels_of_a_line_that_is_paid_out_are_compiled_beside() -> None:
    """All entries that take a table, of which none is forgotten, but for what a line of several and a release ask for."""
    others = {"stand_among", "end_payout"}
    entry = type(payout_run.go_on)
    used = {
        x.__qualname__
        for module in (payout, payout_nodes, payout_run)
        for x in vars(module).values()
        if isinstance(x, entry) and list(x.py_func.__code__.co_varnames[: x.py_func.__code__.co_argcount]) == ["table"]
    }
    assert used - others <= {x.__qualname__ for x in first_use.payout_kernels()}
    ends = {"start": {"kind": "free"}, "end": {"kind": "pinned", "position": [0, 0, 0], "payout": {"longest": 60}}}
    scene = hybrid.validate_scene({
        "cable": {"sections": [{"length": 40.0, "mass": 2.0}]}, "ends": ends, "initial": "equilibrium",
        "model": "catenary", "mesh": {"cells": 20}, "time": {"duration": 10, "step": 0.05},
    })  # fmt: skip
    assert first_use.PAYOUT in first_use.kernels_of(scene)
    assert first_use.PAYOUT not in first_use.kernels_of(scene, static=True)
