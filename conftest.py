"""How tests run: in two processes (pytest-xdist), with kernels that are compiled once.

Before the two processes start, the kernels are compiled if they are not yet, one process for the plane and one for
space.  What times something (-m bench), shows figures (-s) or writes a page of the manual runs in one process.
"""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

COMPILE = """
import hybrid
section = {"length": 20, "mass": 2, "diameter": 0.03, "axial_stiffness": 1e6, "bending_stiffness": 20}
section |= {"drag": {"normal": 1.2}, "added_mass": {"normal": 1}}
hybrid.run({
    "environment": {"fluid": {"density": 1025}, "seabed": {"z": -9, "stiffness": 1e3}},
    "cable": {"sections": [section]},
    "ends": {
        "start": {"kind": "pinned", "position": [0, 0, -9]},
        "end": {
            "kind": "pinned", "position": [14, 0, 0], "motion": {"heave": {"amplitude": 0.1, "period": 4}, "ramp": 4},
        },
    },
    "initial": "equilibrium", "mesh": {"cells": 12}, "time": {"duration": 0.2, "step": 0.1}, "dimension": DIMENSION,
}, progress=False)
"""


# Python keeps what it compiles of the package and of tests, also where the user asks it not to: some hundred processes
# are started, and reading the sources takes each of them a second.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
sys.dont_write_bytecode = False


@pytest.hookimpl(tryfirst=True)
def pytest_cmdline_main(config: pytest.Config) -> None:
    option = config.option
    alone = option.capture == "no" or "bench" in option.markexpr.replace("not bench", "")
    writes = getattr(option, "write_validation", False) or getattr(option, "write_extremes", False)
    if alone or writes or option.collectonly:
        option.numprocesses, option.dist, option.tx = 0, "no", []


def pytest_sessionstart(session: pytest.Session) -> None:
    if getattr(session.config.option, "numprocesses", 0) and not hasattr(session.config, "workerinput"):
        commands = ([sys.executable, "-c", COMPILE.replace("DIMENSION", n)] for n in "23")
        for process in [subprocess.Popen(command, stdout=subprocess.DEVNULL) for command in commands]:
            process.wait()  # what fails here fails again, with words, in a test
