"""What each constant of models, runs and accuracy moves: doubled and halved, until an answer changes.

    pytest bench/test_bench_constants.py -m bench -n 0 -s

Scenes are those that tests compute (constant_scenes.py), those of the digests with error figures, and examples and
defects that ask for an accuracy, the quickest first.  In each, all constants that a line reads which is run, and that have
moved nothing yet, are changed at once; where the answer is another, halves of them, until one is found that alone moves
it.  Constants of compiled kernels, and those that other constants are made of, are not tried here.  A constant that
moves nothing is a guard that none of these scenes needs, a price of time or memory, or one that buys nothing:
docs/evidence/constants.md.

HYBRID_RECORDED: a folder of scenes that tests have been seen to compute; else they are run first.
HYBRID_BENCH_ONLY: names of constants, module.NAME or NAME; `open`: those that the page calls so.
HYBRID_BENCH_LONGEST: s, of the longest scene (1.5).  HYBRID_BENCH_PART: 0/2: each second scene.
HYBRID_BENCH_WRITE: a file for what was found, a row of JSON each.
"""

from __future__ import annotations

import ast
import faulthandler
import importlib
import json
import math
import os
import re
import signal
import subprocess
import sys
import time as clock
from collections import defaultdict
from collections.abc import Iterator, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple

import pytest
import yaml
from constant_scenes import LONGEST, Asked, Facts, Read, again, inside, recorded, seen
from digest_scenes import DEFECTS, EXAMPLES, at_rest, changed, moving
from test_bench_digests import difference

pytestmark = pytest.mark.bench
ROOT = Path(__file__).parents[1]
ROOMS = ("accuracy", "model", "simulation")
FOLDERS = (
    "combinations",
    "simulation",
    "validation",
    "model",
    "outputs",
    "solve",
    "modal",
    "designs",
    "zones",
    "scene",
    "statistics",
    "store",
    "exports",
    "interop",
    "studies",
    "couple",
    "view",
)
SAME = 1e-12  # of the root mean square
TOO_LONG = 20.0  # times the usual time, beyond which a computation is stopped
# Examples and defects that are asked for an accuracy, without steps, mesh and model of their own.
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


class Place(NamedTuple):
    """Where a module has a constant: under a name of its own."""

    module: str
    name: str


class StoppedError(BaseException):
    """A computation took too long."""


def constants() -> list[Constant]:
    """Numbers with a name in the rooms; counters and codes too."""
    found = []
    for path in (x for room in ROOMS for x in sorted((ROOT / "hybrid" / room).glob("*.py"))):
        name = f"hybrid.{path.parent.name}.{path.stem}".removesuffix(".__init__")
        module = importlib.import_module(name)
        for node in ast.parse(path.read_text(encoding="utf-8")).body:
            targets = node.targets if isinstance(node, ast.Assign) else []
            for target in targets:
                for x in target.elts if isinstance(target, ast.Tuple) else [target]:
                    if isinstance(x, ast.Name) and x.id.isupper():
                        value = getattr(module, x.id)
                        if isinstance(value, int | float) and not isinstance(value, bool):
                            found.append(Constant(name, x.id, value))
    return found


def asked_for() -> list[Constant]:
    """Constants that are to be tried."""
    only = os.environ.get("HYBRID_BENCH_ONLY", "")
    names = {*only.split(",")} - {""}
    if only == "open":
        page = (ROOT / "docs" / "evidence" / "constants.md").read_text(encoding="utf-8")
        rows = re.findall(r"^\| `(\w+)` \| (.*) \|.*: open \|$", page, re.M)
        names = {f"{module}.{name}" for module, row in rows for name in re.findall(r"`(\w+)` =", row)}
    return [x for x in constants() if not names or names & {x.name, f"{x.module.split('.')[-1]}.{x.name}"}]


def places_of() -> dict[tuple[str, str], list[Place]]:
    """By module and name of a constant, all modules that have it, its own among them."""
    found = defaultdict[tuple[str, str], list[Place]](list)
    for name, module in [*sys.modules.items()]:
        if not name.startswith("hybrid.") or not module.__file__:
            continue
        for node in ast.walk(ast.parse(Path(module.__file__).read_text(encoding="utf-8"))):
            if isinstance(node, ast.ImportFrom) and node.module:
                for x in node.names:
                    found[node.module, x.name].append(Place(name, x.asname or x.name))
    for x in constants():
        found[x.module, x.name].append(Place(x.module, x.name))
    return found


def own_scenes() -> Iterator[Asked]:
    """Scenes of the digests with error figures, and examples and defects that ask for an accuracy."""
    scenes = [("run", name, changed(data, {"output.errors": True})) for name, data in moving().items()]
    scenes += [("static", name, data) for name, data in at_rest().items()]
    free = {"time.step": None, "mesh": None, "model": None}
    for path in [
        *(EXAMPLES / f"{name}.yaml" for name in EXAMPLES_FREE),
        *(DEFECTS / f"{x}.yaml" for x in DEFECTS_FREE),
    ]:
        data = yaml.safe_load(path.read_text(encoding="utf-8"))
        scenes.append(("run", f"{path.stem}, 5 %", changed(data, free | {"accuracy": "5%"})))
    for function, name, data in scenes:
        asked = Asked(function, data, (), {}, False, name, 0.0, set())
        again(asked, Path())  # compiles
        begin = clock.process_time()
        with seen() as read:
            again(asked, Path())
        yield asked._replace(cpu=clock.process_time() - begin, read=read)


def corpus(folder: Path) -> list[Asked]:
    """Scenes, the quickest first."""
    known = os.environ.get("HYBRID_RECORDED")
    if not known:
        command = [sys.executable, "-m", "pytest", "-q", "-p", "constant_scenes"]
        paths = {"HYBRID_RECORD": str(folder / "asked"), "PYTHONPATH": f"{ROOT}{os.pathsep}{ROOT / 'bench'}"}
        subprocess.run(
            [*command, *(f"tests/{x}" for x in FOLDERS)], cwd=ROOT, env=os.environ | paths, check=False, timeout=7200
        )
    found = recorded(Path(known) if known else folder / "asked") + [x for x in own_scenes() if x.cpu < 2 * LONGEST]
    part, parts = (int(x) for x in os.environ.get("HYBRID_BENCH_PART", "0/1").split("/"))
    return sorted(found, key=lambda x: x.cpu)[part::parts]


def forget() -> None:
    """Values that functions of the package keep."""
    for name, module in [*sys.modules.items()]:
        if name.startswith("hybrid.") and not name.startswith("hybrid.kernels"):
            for x in [*vars(module).values()]:
                if hasattr(x, "cache_clear"):
                    with suppress(Exception):
                        x.cache_clear()


def computed(asked: Asked, folder: Path, limit: float) -> Facts:
    """What it comes to; limit: s."""

    def stop(*_: Any) -> None:
        raise StoppedError

    forget()
    signal.signal(signal.SIGALRM, stop)
    signal.setitimer(signal.ITIMER_REAL, limit)
    try:
        return again(asked, folder)
    except StoppedError:
        return Facts(f"takes {TOO_LONG:g} times as long", {}, [])
    except Exception as error:
        return Facts(type(error).__name__, {}, [])
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)


def moved(old: Facts, new: Facts) -> str:
    """What is another now; empty: nothing."""
    if old.error != new.error:
        return f"refused otherwise: {new.error[:60]!r}" if new.error else "no longer refused"
    by, what = difference(old.digest, new.digest)
    if by > SAME:
        return f"{what} by {100 * by:.2g} %" if math.isfinite(by) else what
    for a, b in zip(old.words, new.words, strict=False):
        if a != b:
            return f"{a[0]}: other words"
    return "" if len(old.words) == len(new.words) else "events"


class Trials:
    """Scenes, what each comes to, and what constants move in them."""

    def __init__(self, folder: Path) -> None:
        self._folder, self._scenes, self._places = folder, corpus(folder), places_of()
        self._known = dict[int, Facts | None]()

    def _usual(self, number: int) -> Facts | None:
        """What a scene comes to; None: not the same each time."""
        if number not in self._known:
            one, two = (computed(self._scenes[number], self._folder, 60.0) for _ in range(2))
            self._known[number] = None if moved(one, two) else one
        return self._known[number]

    def _with(self, group: Sequence[Constant], factor: float, number: int) -> Facts:
        found = [(sys.modules[x.module], x.name, c.value) for c in group for x in self._places[c.module, c.name]]
        for module, name, value in found:
            setattr(module, name, type(value)(value * factor))
        try:
            scene = self._scenes[number]
            return computed(scene, self._folder, TOO_LONG * max(scene.cpu, 0.2))
        finally:
            for module, name, value in found:
                setattr(module, name, value)

    def _one(self, group: Sequence[Constant], factor: float, number: int, usual: Facts) -> tuple[Constant, str] | None:
        """A constant of a group that alone moves a scene, and what; None: they do so together alone."""
        if len(group) == 1:
            what = moved(usual, self._with(group, factor, number))
            return (group[0], what) if what else None
        for part in (group[: len(group) // 2], group[len(group) // 2 :]):
            if len(part) == 1 or moved(usual, self._with(part, factor, number)):
                found = self._one(part, factor, number, usual)
                if found is not None:
                    return found
        return None

    def __iter__(self) -> Iterator[dict[str, Any]]:
        """What each constant was first seen to move; then those that moved nothing, with how many scenes read them."""
        left = {x: 0 for x in asked_for()}
        for k, scene in enumerate(self._scenes):
            which = [x for x in left if self._read(x) & scene.read]
            usual = self._usual(k) if which else None
            if usual is None:
                continue
            for x in which:
                left[x] += 1
            for factor in (2, 0.5):
                group = [x for x in which if x in left and type(x.value)(x.value * factor) != x.value]
                while group and moved(usual, self._with(group, factor, k)):
                    found = self._one(group, factor, k, usual)
                    if found is None:
                        break
                    constant, what = found
                    group.remove(constant)
                    tried = left.pop(constant)
                    yield _row(constant, tried) | {"what": what, "factor": factor, "test": scene.test}
        for constant, tried in left.items():
            yield _row(constant, tried) | {"what": ""}

    def _read(self, constant: Constant) -> Read:
        places = self._places[constant.module, constant.name]
        return {(inside(str(sys.modules[x.module].__file__)), x.name) for x in places}


def _row(constant: Constant, tried: int) -> dict[str, Any]:
    return {"module": constant.module, "name": constant.name, "value": constant.value, "tried": tried}


def test_what_constants_move(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.chdir(EXAMPLES)  # files that scenes name
    faulthandler.cancel_dump_traceback_later()  # no other test takes so long
    write, nothing, scenes = os.environ.get("HYBRID_BENCH_WRITE"), 0, 0
    for found in Trials(tmp_path):
        nothing, scenes = nothing + (not found["what"]), max(scenes, found["tried"])
        what = f"{found['test']}: {found['what']}" if found["what"] else f"nothing in {found['tried']} scenes"
        print(f"{found['module'].removeprefix('hybrid.')}.{found['name']} = {found['value']:g}: {what}", flush=True)
        if write:
            with Path(write).open("a", encoding="utf-8") as file:
                file.write(json.dumps(found) + "\n")
    print(f"nothing moves with {nothing}")
    assert scenes  # else nothing was recorded, or what was asked for is read nowhere
