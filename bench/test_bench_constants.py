"""What each constant of models, runs and accuracy moves: each is doubled and halved alone, until a scene changes.

    pytest bench/test_bench_constants.py -m bench -n 0 -s

Scenes are those of the digests, with error figures, and examples and defects that ask for an accuracy.  A constant is
tried in scenes that call a function which reads it, as seen by the interpreter, the quickest first.  Constants of
compiled kernels, and those that other constants are made of, are not tried here.  A constant that moves nothing is a guard
that none of these scenes needs, a price of time or memory, or one that buys nothing: docs/evidence/accuracy.md.
"""

from __future__ import annotations

import ast
import faulthandler
import math
import sys
import time as clock
from collections import defaultdict
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from types import ModuleType
from typing import Any, NamedTuple

import numpy as np
import pytest
import yaml
from digest_scenes import DEFECTS, EXAMPLES, at_rest, changed, moving
from test_bench_digests import difference, digest

import hybrid
from hybrid.errors import HybridError

pytestmark = pytest.mark.bench
ROOMS = ("accuracy", "model", "simulation")
# Limits beyond which a scene is said to be implausible: they refuse, and change no number.
REFUSALS = ("hybrid.model.plausibility",)
SAME = 1e-12  # of the root mean square
LONGEST = 2.0  # s of CPU time: scenes that take longer are left out
# Scenes that are asked for an accuracy, without steps, mesh and model of their own.
EXAMPLES_FREE = (
    "01_hanging_chain", "02_suspension", "05_cantilever", "06_whip", "07_forced_taut_cable", "rov_tether", "s_tether",
    "slack_on_seabed", "touchdown", "laying",
)  # fmt: skip
DEFECTS_FREE = (
    "error_at_rest",
    "error_figure_12",
    "false_within",
    "float_pack_tension",
    "long_s_tether",
    "short_hose_rings",
)


class Constant(NamedTuple):
    """A number with a name in a module."""

    module: str
    name: str
    value: float


class Uses(NamedTuple):
    """Where a module has a constant: under a name of its own."""

    module: str
    name: str


def constants() -> list[Constant]:
    """Numbers with a name in the rooms, as they are when the package is loaded; counters and codes too."""
    found = []
    for name, module in sorted(sys.modules.items()):
        if not name.startswith("hybrid.") or name in REFUSALS:
            continue
        if name.split(".")[1] not in ROOMS or not module.__file__:
            continue
        for node in ast.parse(Path(module.__file__).read_text(encoding="utf-8")).body:
            targets = node.targets if isinstance(node, ast.Assign) else []
            for target in targets:
                for x in target.elts if isinstance(target, ast.Tuple) else [target]:
                    if isinstance(x, ast.Name) and x.id.isupper():
                        value = getattr(module, x.id)
                        if isinstance(value, int | float) and not isinstance(value, bool):
                            found.append(Constant(name, x.id, value))
    return found


def uses_of() -> dict[tuple[str, str], list[Uses]]:
    """By module and name of a constant, all modules that have it, its own among them."""
    found = defaultdict[tuple[str, str], list[Uses]](list)
    for name, module in [*sys.modules.items()]:
        if not name.startswith("hybrid.") or not module.__file__:
            continue
        for node in ast.walk(ast.parse(Path(module.__file__).read_text(encoding="utf-8"))):
            if isinstance(node, ast.ImportFrom) and node.module:
                for x in node.names:
                    found[node.module, x.name].append(Uses(name, x.asname or x.name))
    return found


class Seen:
    """What code of the package was called."""

    def __init__(self) -> None:
        self.read = set[tuple[str, str]]()  # file, and a name that a function of it reads
        self._codes = set[Any]()

    def __enter__(self) -> Seen:
        sys.setprofile(self._called)
        return self

    def _called(self, frame: Any, event: str, _: Any) -> None:
        code = frame.f_code
        if event == "call" and code not in self._codes:
            self._codes.add(code)
            if "/hybrid/" in code.co_filename:
                self.read |= {(code.co_filename, name) for name in code.co_names}

    def __exit__(self, *_: Any) -> None:
        sys.setprofile(None)


def scenes() -> Iterator[tuple[str, dict[str, Any], bool]]:
    """Name, tables, and whether it is at rest."""
    for name, data in moving().items():
        yield name, changed(data, {"output.errors": True}), False
    yield from ((name, data, True) for name, data in at_rest().items())
    free = {"time.step": None, "mesh": None, "model": None}
    for path in [
        *(EXAMPLES / f"{name}.yaml" for name in EXAMPLES_FREE),
        *(DEFECTS / f"{x}.yaml" for x in DEFECTS_FREE),
    ]:
        data = yaml.safe_load(path.read_text(encoding="utf-8"))
        yield f"{path.stem}, 5 %", changed(data, free | {"accuracy": "5%"}), False


def facts(data: dict[str, Any], rest: bool) -> Any:
    """What a run comes to: its digest, numbers beside it, and events, or why there is none."""
    for module in [*sys.modules.values()]:
        if getattr(module, "__name__", "").startswith("hybrid.") and not module.__name__.startswith("hybrid.kernels"):
            for x in [*vars(module).values()]:
                with suppress(Exception):
                    x.cache_clear()
    try:
        result = hybrid.static(data) if rest else hybrid.run(data)
    except HybridError as error:
        return str(error), {}, []
    with result:
        numbers = {k: v for k, v in result.attributes.items() if k.startswith("error_") or k == "cells"}
        return digest(result), numbers, sorted((x.kind, round(x.t, 6)) for x in result.events)


def moved(old: Any, new: Any) -> str:
    """What is another now; empty: nothing."""
    if isinstance(old[0], str) or isinstance(new[0], str):
        return "" if old[0] == new[0] else "fails, or no longer"
    by, what = difference(old[0], new[0])
    if by > SAME:
        return f"{what} by {100 * by:.2g} %" if math.isfinite(by) else what
    for name in old[1].keys() | new[1].keys():
        a, b = old[1].get(name), new[1].get(name)
        if a is None or b is None or not np.isclose(a, b, rtol=1e-9, equal_nan=True):
            return name
    return "events" if old[2] != new[2] else ""


def tried(constant: Constant, uses: list[Uses], value: float, data: dict[str, Any], rest: bool) -> Any:
    """Facts with another value of a constant; None: a run cannot be made with it."""
    found: list[tuple[ModuleType, str]] = [(sys.modules[x.module], x.name) for x in uses]
    found.append((sys.modules[constant.module], constant.name))
    for module, name in found:
        setattr(module, name, value)
    try:
        return facts(data, rest)
    except Exception as error:
        return f"{type(error).__name__}", {}, []
    finally:
        for module, name in found:
            setattr(module, name, constant.value)


def test_what_constants_move(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(EXAMPLES)  # files that scenes name
    faulthandler.cancel_dump_traceback_later()  # no other test takes so long
    known = []
    for name, data, rest in scenes():
        facts(data, rest)  # compiles
        begin = clock.process_time()
        before = facts(data, rest)
        cpu = clock.process_time() - begin
        if cpu > LONGEST or moved(before, facts(data, rest)):
            print(f"left out: {name}, {cpu:.1f} s{'' if cpu > LONGEST else ', which is not the same again'}")
            continue
        with Seen() as seen:
            facts(data, rest)
        known.append((cpu, name, data, rest, before, seen.read))
    known.sort(key=lambda x: x[0])
    uses = uses_of()
    nothing, unread = [], []
    for constant in constants():
        at = [*uses[constant.module, constant.name], Uses(constant.module, constant.name)]
        places = {(str(sys.modules[x.module].__file__), x.name) for x in at}
        which = [x for x in known if places & x[-1]]
        what = ""
        for _cpu, name, data, rest, before, _ in which:
            for factor in (2, 0.5):
                value = type(constant.value)(constant.value * factor)
                what = what or moved(before, tried(constant, at, value, data, rest))
            if what:
                print(f"{constant.module}.{constant.name} = {constant.value:g}: {name}: {what}", flush=True)
                break
        if not what:
            (nothing if which else unread).append(constant)
            print(f"{constant.module}.{constant.name} = {constant.value:g}: nothing in {len(which)} scenes", flush=True)
    print(f"\nnothing moves with {len(nothing)}: {', '.join(f'{x.module}.{x.name}' for x in nothing)}")
    print(f"no scene reads {len(unread)}: {', '.join(f'{x.module}.{x.name}' for x in unread)}")
    assert known
