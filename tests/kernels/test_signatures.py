"""Every kernel is compiled for one signature, whatever the scene: a second one would double the wait of a first run."""

from __future__ import annotations

import itertools
import json
import math
import operator
import subprocess
import sys
from importlib import import_module
from inspect import signature
from typing import Any

import numba
import pytest
from numba import types
from numba.core.errors import NumbaError
from numba.core.registry import cpu_target

from hybrid.kernels.machine import compiler
from hybrid.kernels.machine.compile import inner

# No other process compiles beside it, of which this one would read nothing.  Garbage, of which numba leaves much, is not
# looked for.
ALONE = "import gc, os; gc.disable(); os.cpu_count = lambda: 1"

# Prints the signatures of all that this process has compiled or loaded.
ALL_SIGNATURES = """
import importlib, json, pkgutil
import hybrid.kernels
from hybrid.kernels.machine.compile import Entry, Inner

found = {}
rooms = [x.name for x in pkgutil.walk_packages(hybrid.kernels.__path__, "hybrid.kernels.")]
for room in rooms:
    for name, f in vars(importlib.import_module(room)).items():
        if isinstance(f, Entry | Inner) and f.__module__ == room:
            read = f.made.signatures if isinstance(f, Inner) else max(f.signatures, f.part.signatures, key=len)
            found[f"{room}.{name}"] = [str(x) for x in read]
print(json.dumps(found))
"""

# A line in a plane with a zone of each kind; in space; its equilibrium; zones that move over a seabed with friction;
# a catenary and the rods that it is compared with.
SCRIPT = """
import hybrid

cable = {"length": 20.0, "diameter": 0.05, "mass": 4.0, "axial_stiffness": 1e7, "bending_stiffness": 50.0,
         "torsional_stiffness": 40.0, "drag": {"normal": 1.2}, "added_mass": {"normal": 1.0},
         "damping": {"mass": 0.1, "stiffness": 0.01}}
time = {"duration": 0.2, "step": 0.1}
held = {"start": {"kind": "pinned", "position": [0, 0, 0]}, "end": {"kind": "pinned", "position": [15, 0, 0]}}
sea = {"fluid": {"density": 1000.0, "current": [0.5, 0, 0], "surface": 5.0,
                 "waves": {"kind": "regular", "height": 1.0, "period": 6.0}}}
bed = {"fluid": {"density": 1000.0}, "seabed": {"z": -4.0, "stiffness": 1e4, "damping": 100.0, "friction": 0.5}}
zones = {"kind": "zones", "zones": [{"catenary": 12.0}, {"rod": 8.0}]}


def scene(**more):
    base = {"cable": {"sections": [cable]}, "ends": held, "initial": "equilibrium", "model": zones,
            "mesh": {"cells": 20}, "time": time}
    return hybrid.validate_scene({**base, **more})


hybrid.run(scene(environment=sea))
across = {"fluid": {**sea["fluid"], "current": [0.3, 0.4, 0]}}
hybrid.run(scene(environment=across))
hybrid.static(scene(environment=bed))
hybrid.run(scene(environment=bed, model="adaptive"))
hybrid.run(scene(environment=bed, model="catenary", output={"errors": True}))
"""


def too_many(found: dict[str, list[str]]) -> dict[str, list[str]]:
    """Functions with more than one signature; those told first for which kind of line they are have one for each."""

    def kinds(name: str) -> int:
        room, function = name.rsplit(".", 1)
        first = next(iter(signature(getattr(import_module(room), function).py_func).parameters), "")
        return 2 if first in ("plane", "space") else 1

    return {name: x for name, x in found.items() if len(x) > 1 and len(x) > kinds(name)}


@pytest.mark.long
def test_kernels_have_one_signature() -> None:
    """Kernels; what they inline is seen where they are compiled (tests/test_extend.py)."""
    done = subprocess.run([sys.executable, "-c", SCRIPT + ALL_SIGNATURES], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout.splitlines()[-1])
    assert sum(map(bool, found.values())) >= 10, found
    assert too_many(found) == {}


def test_what_kernels_inline_cannot_be_called_from_python() -> None:
    """numba alone would jump to address 0 once it is compiled, and end the process."""

    @inner
    def half(x):
        return 0.5 * x

    with pytest.raises(TypeError, match=r"half.*@kernel"):
        half(3.0)
    assert numba.njit(lambda x: half(half(x)))(3.0) == 0.75
    with pytest.raises(TypeError, match=r"half.*@kernel"):
        half(3.0)


@pytest.mark.parametrize("called", [operator.add, operator.truediv, operator.lt, operator.and_, math.sqrt, max])
def test_a_rule_of_numba_that_is_kept_is_the_one_it_finds(called: Any) -> None:
    """For whole numbers, numbers and truth values, in either order, twice: also what it refuses."""
    context = cpu_target.typing_context
    context.refresh()
    function = context.resolve_value_type(called)
    kinds = [types.int64, types.float64, types.boolean, types.IntegerLiteral(2)]
    for args in itertools.product(kinds, repeat=1 if called is math.sqrt else 2):
        answers = []
        for find in (compiler._rule_of, compiler._rule_of, compiler._find_rule):
            try:
                answers.append(str(find(function, context, args, {})))
            except NumbaError:
                answers.append("refused")
        assert len(set(answers)) == 1, answers


@pytest.mark.long
def test_functions_of_users_are_compiled_as_ever() -> None:
    """Generators, and functions of Python's objects: of those numba asks more than of kernels."""
    assert compiler.compile_entry  # imported, it has changed how numba reads functions

    def squares(n):  # type: ignore[no-untyped-def]
        for k in range(n):
            yield k * k

    def count(text):  # type: ignore[no-untyped-def]
        return {text: len(text)} if text else None

    assert list(numba.njit(squares)(4)) == [0, 1, 4, 9]
    assert numba.jit(forceobj=True, looplift=False)(count)("line") == {"line": 4}
