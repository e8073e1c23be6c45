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
from typing import Any, NamedTuple

import numba
import numpy as np
import pytest
from numba import types
from numba.core.errors import NumbaError
from numba.core.registry import cpu_target
from numpy.typing import NDArray

from hybrid.kernels.machine import compiler
from hybrid.kernels.machine.binding import Packed, Room, Table
from hybrid.kernels.machine.compile import inner, kernel
from hybrid.kernels.machine.references import NamedNumbers, key_of, reader
from hybrid.kernels.state.state import Floats

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
    """Functions with more than one signature; those told first for which kind of line they are have one for each.

    One that takes joined lines in place of a line has one more.
    """

    def kinds(name: str) -> int:
        room, function = name.rsplit(".", 1)
        takes = [*signature(getattr(import_module(room), function).py_func).parameters]
        return (2 if takes and takes[0] in ("plane", "space") else 1) + ({"line", "lines"} <= {*takes})

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


# --- The table of addresses that a kernel gets its arguments by ---


class Pair(NamedTuple):
    a: Floats
    b: Floats


class Example(NamedTuple):
    pair: Pair


def test_what_was_bound_before_a_failure_is_bound_anew() -> None:
    """Nothing is bound where a value fails half-way; what was there before can be bound again."""
    good = Pair(np.zeros(2), np.ones(2))
    table = Table(Example(good))
    numbers = table.numbers.copy()
    with pytest.raises(TypeError, match="contiguous"):
        table.bind(pair=Pair(np.zeros(3), np.ones(4)[::2]))
    table.bind(pair=good)
    assert np.array_equal(table.numbers, numbers)


def test_a_function_that_makes_the_example_is_called_once() -> None:
    """Tables of one kernel, of which a run makes tens, do not each find out what it takes."""
    made = []

    def blank() -> Example:
        made.append(Example(Pair(np.zeros(2), np.ones(2))))
        return made[-1]

    one, other = Table(blank), Table(blank, np.zeros(4, np.int64))
    assert len(made) == 1 and np.array_equal(one.numbers, other.numbers) and one.numbers is not other.numbers
    one.bind(pair=Pair(np.zeros(3), np.ones(3)))
    assert np.array_equal(other.numbers, Table(made[0]).numbers)
    with pytest.raises(TypeError, match="contiguous"):
        other.bind(pair=Pair(np.zeros(3), np.ones(4)[::2]))


# --- Numbers with names: the same in Python and in kernels, and nothing else in their place ---


class Times(NamedNumbers):
    now: float
    step: float


class Steps(NamedNumbers, number=np.int64):
    taken: int
    wasted: int


class Job(NamedTuple):
    times: Times
    more: NDArray[np.float64]
    steps: Steps


read = reader(Job(Times(), np.zeros(1), Steps()))


@inner
def go_on(times, steps):
    times.now += times.step
    steps.taken += 1


@kernel
def take(table, times):
    job = read(table)
    for _ in range(3):
        go_on(job.times, job.steps)
    go_on(times, job.steps)
    job.steps.wasted = int(job.more[0])
    for k in range(job.times.plain.shape[0]):
        times.plain[k] += 0.5 * job.times.plain[k]
    return job.times.now


def test_kernels_and_python_see_the_same_numbers() -> None:
    times, steps, others = Times(now=1.0, step=0.5), Steps(taken=5), Times(step=2.0)
    table = Table(Job(times, np.array([7.0]), steps))
    assert take(table.numbers, others) == 2.5
    assert times.plain.tolist() == [2.5, 0.5] and others.plain.tolist() == [3.25, 2.25]
    assert (steps.taken, steps.wasted) == (9, 7) and steps.plain.dtype == np.int64


def test_numbers_of_one_class_are_not_those_of_another() -> None:
    table = Table(Job(Times(), np.zeros(1), Steps()))
    for wrong in (np.zeros(2), Steps()):
        with pytest.raises(TypeError, match="times"):
            table.bind(times=wrong)
    with pytest.raises(TypeError, match="Times: shape"):
        key_of(Times()[:1])
    with pytest.raises(ValueError, match="expected 2 numbers of Times"):
        Times.of(np.zeros(3))
    assert Times.of(np.array([3.0, 4.0])).step == 4.0


def test_names_are_those_of_the_class_and_of_nothing_else() -> None:
    with pytest.raises(TypeError, match="Times has no later"):
        Times(later=1.0)
    with pytest.raises(TypeError, match=r"Wrong\.flags"):
        type("Wrong", (NamedNumbers,), {"__annotations__": {"flags": "float"}})


def test_packed_numbers_keep_their_names() -> None:
    class Parts(NamedTuple):
        values: NDArray[np.float64]
        times: Times

    packed = Packed(lambda n: Parts(np.zeros(n), Times()))
    for made in (packed(4), Room(packed, 6).view(4)):
        assert isinstance(made.times, Times)
        made.times.step = 3.0
        assert made.times.plain.tolist() == [0.0, 3.0] and made.values.size == 4
