"""Scenes that tests compute, and what they come to: the corpus in which each constant is tried.

As a plugin of pytest it writes down what tests ask of the package, and which constants lines read that are run:

    HYBRID_RECORD=folder pytest -p constant_scenes tests/simulation
"""

from __future__ import annotations

import ast
import contextlib
import dataclasses
import os
import pickle
import sys
import time as clock
from collections import defaultdict
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from types import FrameType
from typing import Any, NamedTuple

import numpy as np
from test_bench_digests import digest

import hybrid
from hybrid.errors import HybridError

FUNCTIONS = ("run", "static", "plan", "stiffness", "offsets", "modes", "response", "validate_scene")
LONGEST = float(os.environ.get("HYBRID_BENCH_LONGEST", "1.5"))  # s of CPU time: what takes longer is left out
Read = set[tuple[str, str]]  # file, and a name that a line of it reads


class Asked(NamedTuple):
    """What a test asked of the package."""

    function: str
    scene: Any
    args: tuple[Any, ...]  # and these, of plain values
    more: dict[str, Any]
    file: bool  # whether a result was written
    test: str
    cpu: float  # s
    read: Read


class Facts(NamedTuple):
    """What it came to."""

    error: str
    digest: dict[str, list[float]]
    words: list[Any]  # events, warnings, numbers beside quantities


def inside(file: str) -> str:
    """Path of a file within the package."""
    return file.rpartition("/hybrid/")[2]


@cache
def _names_in(file: str) -> dict[int, set[str]]:
    """By line of a file, names in capitals that it reads."""
    found = defaultdict[int, set[str]](set)
    for node in ast.walk(ast.parse(Path(file).read_text(encoding="utf-8"))):
        if isinstance(node, ast.Name) and node.id.isupper():
            found[node.lineno].add(node.id)
    return dict(found)


@contextlib.contextmanager
def seen() -> Iterator[Read]:
    """Names in capitals that lines of the package read which are run within."""
    read, lines = Read(), dict[Any, dict[int, set[str]]]()

    def of_line(frame: FrameType, event: str, _: Any) -> Any:
        if event == "line":
            for name in lines[frame.f_code].pop(frame.f_lineno, ()):
                read.add((inside(frame.f_code.co_filename), name))
        return of_line if lines[frame.f_code] else None

    def called(frame: FrameType, event: str, _: Any) -> Any:
        code = frame.f_code
        if code not in lines:
            lines[code] = {}
            if "/hybrid/" in code.co_filename and any(x.isupper() for x in code.co_names):
                own = {line for *_, line in code.co_lines() if line is not None}
                lines[code] = {k: {*x} for k, x in _names_in(code.co_filename).items() if k in own}
        return of_line if lines[code] else None

    before = sys.gettrace()
    sys.settrace(called)
    try:
        yield read
    finally:
        sys.settrace(before)


# --- while tests run ----------------------------------------------------------------------------


def _recording(name: str, compute: Callable[..., Any], kept: Callable[[Asked], None]) -> Callable[..., Any]:
    def wrapped(scene: Any, *args: Any, **more: Any) -> Any:
        file = name in ("run", "static") and bool(args or more.get("output"))
        plain = () if file else args
        simple = all(isinstance(x, int | float | str | list | tuple | None) for x in (*plain, *more.values()))
        begin, cwd = clock.process_time(), Path.cwd()
        with seen() as read:
            try:
                return compute(scene, *args, **more)
            finally:
                cpu = clock.process_time() - begin
                if simple and cpu < LONGEST and cwd == Path.cwd():
                    more = {k: x for k, x in more.items() if k not in ("output", "progress", "overwrite")}
                    test = os.environ.get("PYTEST_CURRENT_TEST", "").split(" (")[0]
                    kept(Asked(name, scene, plain, more, file, test, cpu, read))

    return wrapped


def pytest_configure(config: Any) -> None:
    """Puts functions that write down what they are asked in the place of those of the package."""
    folder = os.environ.get("HYBRID_RECORD")
    if not folder:
        return
    path = Path(folder) / f"{os.getpid()}.pkl"
    path.parent.mkdir(parents=True, exist_ok=True)

    def kept(asked: Asked) -> None:
        with contextlib.suppress(Exception), path.open("ab") as file:
            file.write(pickle.dumps(asked))

    for name in FUNCTIONS:
        setattr(hybrid, name, _recording(name, getattr(hybrid, name), kept))


def recorded(folder: Path) -> list[Asked]:
    """What tests asked, each scene once, the quickest first."""
    found = dict[Any, Asked]()
    for path in sorted(folder.glob("*.pkl")):
        with path.open("rb") as file, contextlib.suppress(EOFError):
            while True:
                x = pickle.load(file)
                key = (x.function, repr(x.scene), repr(x.args), repr(x.more), x.file)
                if "pytest-of-" in repr(x.scene):  # a file that is gone
                    continue
                if key not in found or x.cpu < found[key].cpu:
                    found[key] = x
    return sorted(found.values(), key=lambda x: x.cpu)


# --- again --------------------------------------------------------------------------------------


def again(asked: Asked, folder: Path) -> Facts:
    """What it comes to now."""
    more = dict(asked.more) | ({"measure": False} if asked.function == "plan" else {})
    if asked.file:
        more |= {"output": folder / "again.h5", "overwrite": True}
    try:
        result = getattr(hybrid, asked.function)(asked.scene, *asked.args, **more)
    except HybridError as error:
        return Facts(str(error), {}, [])
    if isinstance(result, hybrid.Result):
        with result:
            return _of_result(result)
    digests = dict[str, list[float]]()
    words = list[Any]()
    _gather("", result, digests, words, 0)
    return Facts("", digests, words)


def _of_result(result: hybrid.Result) -> Facts:
    """Of lines too; without clocks."""
    clocks = ("cpu", "seconds", "duration", "version", "created", "elapsed")
    words: list[Any] = [
        (k, f"{x:.9g}" if isinstance(x, float) else str(x))
        for k, x in sorted(result.attributes.items())
        if not any(y in k for y in clocks)
    ]
    words += sorted((x.kind, round(x.t, 6), str(x)) for x in result.events)
    return Facts("", digest(result), words)


def _gather(name: str, x: Any, digests: dict[str, list[float]], words: list[Any], depth: int) -> None:
    """Numbers and words of what is no result, field by field."""
    if depth > 5:
        return
    if isinstance(x, np.ndarray) and x.dtype.kind in "fiuc" and x.size:
        flat = np.nan_to_num(np.abs(x.astype(complex)).ravel(), nan=0.0, posinf=1e300)
        weights = np.random.default_rng(flat.size).uniform(-1.0, 1.0, flat.size)
        digests[name] = [float(flat.size), float(np.sqrt(np.mean(flat**2))), float(weights @ flat)]
    elif isinstance(x, float):
        words.append((name, f"{x:.9g}"))
    elif isinstance(x, str | int | None):
        words.append((name, x))
    elif isinstance(x, dict):
        for key, y in x.items():
            _gather(f"{name}.{key}", y, digests, words, depth + 1)
    elif isinstance(x, list | tuple):
        for k, y in enumerate(x):
            _gather(f"{name}.{k}", y, digests, words, depth + 1)
    elif dataclasses.is_dataclass(x):
        for field in dataclasses.fields(x):
            _gather(f"{name}.{field.name}", getattr(x, field.name), digests, words, depth + 1)
