"""Every kernel is compiled for one signature, whatever the scene: a second one would double the wait of a first run."""

from __future__ import annotations

import json
import subprocess
import sys
from importlib import import_module
from inspect import signature

import numba
import pytest

from hybrid.kernels.machine.compile import inner

# A line in a plane with a zone of each kind; in space; its equilibrium; zones that move over a seabed with friction;
# the effect of bending followed along.  Prints the signatures of all that was compiled or loaded.
SCRIPT = """
import importlib, json, pkgutil, sys
import hybrid, hybrid.kernels
from hybrid.kernels.machine.compile import Entry, Inner
from hybrid.kernels.machine.reference_types import type_for

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

found = {}
rooms = [x.name for x in pkgutil.walk_packages(hybrid.kernels.__path__, "hybrid.kernels.")] + ["hybrid.adapt.zone_rules"]
named = [(room, *x) for room in rooms for x in vars(importlib.import_module(room)).items()]
if sys.argv[1:]:  # numba reads all that was called once more, with what it inlines; no machine code is made
    for room, name, f in named:
        for sig in f.signatures if isinstance(f, Entry) and f.__module__ == room else ():
            f.part.compile(tuple(map(type_for, sig)))
for room, name, f in named:
    if isinstance(f, Entry | Inner) and f.__module__ == room:
        found[f"{room}.{name}"] = [str(x) for x in (f if isinstance(f, Entry) else f.made).signatures]
print(json.dumps(found))
"""


def signatures(*inlined: str) -> dict[str, list[str]]:
    done = subprocess.run([sys.executable, "-c", SCRIPT, *inlined], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout.splitlines()[-1])


def too_many(found: dict[str, list[str]]) -> dict[str, list[str]]:
    """Functions with more than one signature; those told first for which kind of line they are have one for each."""

    def kinds(name: str) -> int:
        room, function = name.rsplit(".", 1)
        first = next(iter(signature(getattr(import_module(room), function).py_func).parameters), "")
        return 2 if first in ("plane", "space") else 1

    return {name: x for name, x in found.items() if len(x) > 1 and len(x) > kinds(name)}


@pytest.mark.long
def test_kernels_have_one_signature() -> None:
    found = signatures()
    used = [name for name, all_of_it in found.items() if all_of_it]
    assert len(used) >= 10, used
    assert too_many(found) == {}


@pytest.mark.slow
def test_what_kernels_inline_has_one_signature() -> None:
    found = signatures("inlined")
    assert sum(map(bool, found.values())) > 200, "or nothing was read"
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
