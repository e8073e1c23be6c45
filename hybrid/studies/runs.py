"""Runs of a tradeoff study: their scenes, their computation and timing, and the store that a second call reads."""

from __future__ import annotations

import hashlib
import json
import os
import platform
import subprocess
import time as clock
from collections.abc import Callable, Collection, Mapping
from contextlib import suppress
from dataclasses import asdict, dataclass, field, replace
from datetime import datetime
from importlib.metadata import version
from pathlib import Path
from posixpath import join, split
from statistics import median
from typing import Any

import numpy as np

from hybrid.accuracy.passes import run
from hybrid.errors import Complaint, ComputationError, ResultError, SceneError
from hybrid.scene.analysis import LEAST_DAMPED, Model, of_length
from hybrid.scene.base import by_kinds, dotted
from hybrid.scene.read import as_scene, scene_text
from hybrid.scene.root import Scene
from hybrid.simulation.progress import Progress
from hybrid.store.reader import Result
from hybrid.store.tables import DONE, FAILED, MISSED, OURS, Row

# Accuracy, and part of the duration, of the run that loads the kernels before anything is timed.
ROUGH = "10%"
WARM_PART = 0.02  # of the duration
# Keys of a model that set the resolution: the study chooses these.
FINENESS = ("kind", "tolerance", "rod_cell", "hold_time")
COMPARED = ("position", "reaction_start", "reaction_end")
# Files of the package that change no answer, only how it is shown or ranked.
SHOWS = ("cli", "view", "exports", "interop")


@dataclass(frozen=True)
class StudyProgress:
    """Progress of a study: runs done, runs in total, the present one, and the part of it that is done (0 to 1)."""

    done: int
    total: int
    what: str
    part: float


@dataclass(frozen=True)
class RunSpec:
    """A run to be made; unchanged: lines that do not admit the model and keep theirs, and why."""

    model: str
    accuracy: str
    scene: Scene | None  # None: refused
    refused: str = ""
    times: int = 1  # repetitions; the median of their CPU times counts
    kept: tuple[str, ...] = COMPARED  # outputs that are compared
    unchanged: Mapping[str, str] = field(default_factory=dict)

    @property
    def name(self) -> str:
        return f"{self.model} {self.accuracy}"


def model_kinds() -> tuple[str, ...]:
    """The kinds of `model` that scenes know."""
    return tuple(by_kinds(Model))


def scene_data(
    scene: Scene,
    kind: str,
    accuracy: str | Mapping[str, str],
    lines: Collection[str] | None = None,
    more: Mapping[str, float] | None = None,
) -> dict[str, Any]:
    """The scene with a model at an accuracy, without keys that set the resolution; as data.

    A part is one of the length and of the end forces, by which runs are compared.  lines: of the network, those that
    get the model, None: all; the others keep theirs.  more: keys of the model.
    """
    data = scene.model_dump(mode="json", exclude_none=True)
    time, output = data["time"], data.get("output", {})
    for name in ("step", "tolerance"):
        time.pop(name, None)
    if time["rho_inf"] > LEAST_DAMPED:
        time.pop("rho_inf")
    for name in ("errors", "criteria"):
        output.pop(name, None)
    for line in scene.lines:
        model = scene.asked_scene(line).model.model_dump(mode="json", exclude_none=True)
        table: Any = data
        for key in scene.form.place(("lines", line, "model"))[:-1]:
            table = table[key]
        table.pop("mesh", None)
        table.pop("accuracy", None)
        if lines is None or line in lines:
            table["model"] = _without_fineness(model, kind) | dict(more or {})
            continue
        if "model" in table:
            table["model"] = _without_fineness(model, model["kind"])
        if model["kind"] == "catenary" and not isinstance(accuracy, str):  # which has no moment that could be asked
            table["accuracy"] = {name: x for name, x in accuracy.items() if name in ("position", "tension")}
    return data | {"accuracy": of_length(accuracy) if isinstance(accuracy, str) else dict(accuracy)}


def _without_fineness(given: Mapping[str, Any], kind: str) -> dict[str, Any]:
    """A model of a kind with what the scene says of that kind, but for the resolution."""
    kept = {name: x for name, x in given.items() if name not in FINENESS} if given["kind"] == kind else {}
    if kind == "adaptive":  # zones that move are one of the models that are compared
        kept |= {"always_move": True}
    if "zones" in kept:
        kept["zones"] = [{k: x for k, x in zone.items() if k not in ("cells", "ratio")} for zone in kept["zones"]]
    return {"kind": kind} | kept


def run_spec(
    scene: Scene,
    kind: str,
    accuracy: str | Mapping[str, str],
    name: str = "",
    more: Mapping[str, float] | None = None,
    kept: tuple[str, ...] = COMPARED,
) -> RunSpec:
    """A run with a model on all lines that admit it; name: of an accuracy with several parts; more: of the model."""
    found, lines, why = None, list[str](), dict[str, str]()
    for line in scene.lines:
        try:
            found = as_scene(scene_data(scene, kind, accuracy, [*lines, line], more))
            lines.append(line)
        except SceneError as error:
            why[dotted(scene.form.place(("lines", line)))] = _in_short(error)
    asked = name or str(accuracy)
    if found is None:
        return RunSpec(kind, asked, None, next(iter(why.values())), kept=kept)
    return RunSpec(kind, asked, found, kept=kept, unchanged=why)


def _in_short(error: SceneError) -> str:
    first = error.complaints[0]
    if first.value == "nothing":
        return f"{first.where} is missing"
    return f"refused: {first.where}: given {first.value}, expected {first.expected}"


class RunStore:
    """Computes runs, stores their results in the folder, and reports progress."""

    def __init__(
        self, folder: Path, progress: Callable[[StudyProgress], None] | None, total: int, stopped: Callable[[], bool]
    ) -> None:
        """stopped: whether to end before the next run, with KeyboardInterrupt."""
        self.folder, self.total, self._stopped = folder, total, stopped
        self.done, self.computed, self._progress, self._warm = 0, 0, progress, set[str]()
        self.facts = facts_of_machine()  # now: the load is that before the first run
        try:
            (folder / "runs").mkdir(parents=True, exist_ok=True)
        except OSError as error:
            text = f"{folder} is no folder for a study\n    detail:   {error}"
            raise ResultError(f"{text}\n    try:      -o with a folder that can be made or written to") from None

    def report(self, what: str, part: float) -> None:
        if self._stopped():
            raise KeyboardInterrupt
        if self._progress is not None:
            self._progress(StudyProgress(self.done, self.total, what, part))

    def get(self, spec: RunSpec, required: bool = False) -> tuple[Row, dict[str, np.ndarray]]:
        """The stored run, else computed and stored now; required: a failure is raised, not stored."""
        row = Row(OURS, spec.model, spec.accuracy, FAILED, spec.refused)
        if spec.scene is None:
            if required:
                raise SceneError([Complaint("reference", spec.name, "a model that the scene admits", spec.refused)])
            self.done += 1
            return row, {}
        key = key_of(spec.scene, spec.times, "" if spec.kept == COMPARED else " ".join(spec.kept))
        found = self.load(key)
        if found is None:
            found = self._compute(replace(row, key=key), spec, spec.scene, required)
        self.done += 1
        return found

    def load(self, key: str) -> tuple[Row, dict[str, np.ndarray]] | None:
        """A stored run; None: there is none."""
        try:
            row = Row(**json.loads((self.folder / "runs" / f"{key}.json").read_text(encoding="utf-8")))
            if row.status == FAILED:
                return row, {}
            with np.load(self.folder / "runs" / f"{key}.npz") as file:
                return row, {name: file[name] for name in file.files}
        except (OSError, ValueError, TypeError):  # absent, or of another version: it is made again
            return None

    def save(self, row: Row, values: Mapping[str, np.ndarray]) -> tuple[Row, dict[str, np.ndarray]]:
        """Store a run, and return it as a later call reads it.

        Its JSON is written last, by renaming, so that a stored run is complete.
        """
        runs = self.folder / "runs"
        if values:
            with (runs / f"{row.key}.npz").open("wb") as file:
                np.savez_compressed(file, **values)  # type: ignore[arg-type]
        draft = runs / f"{row.key}.part"
        draft.write_text(json.dumps(asdict(row), indent=1) + "\n", encoding="utf-8")
        draft.replace(runs / f"{row.key}.json")
        return row, dict(values)

    def _compute(self, row: Row, spec: RunSpec, scene: Scene, required: bool) -> tuple[Row, dict[str, np.ndarray]]:
        spent, result = [], None
        try:
            self._warm_up(spec, scene)
            for k in range(spec.times):
                what = spec.name + (f", {k + 1} of {spec.times}" if spec.times > 1 else "")
                self.report(what, 0.0)
                begin = clock.process_time()
                result = run(scene, progress=self._reporter(what))
                spent.append(clock.process_time() - begin)
        except ComputationError as error:
            if required:
                detail = f"the reference run, {spec.name}, failed: nothing can be compared; {error.detail}"
                raise ComputationError(error.outcome, error.t, error.s, detail.rstrip("; ")) from None
            return self.save(replace(row, cause=str(error).splitlines()[0]), {})
        except (ArithmeticError, ValueError, LookupError, TypeError, AssertionError, ResultError) as error:
            if required:
                raise
            return replace(row, cause=f"a bug: {type(error).__name__}: {error}"), {}
        assert result is not None
        values = {
            join(line, name): np.array(each[name])
            for line, each in result.each_line()
            for name in spec.kept
            if name in each
        }
        row = replace(_figures_of(result, row), cpu=median(spent))
        self.computed += 1
        return self.save(row, values)

    def _reporter(self, what: str) -> Callable[[Progress], None]:
        return lambda progress: self.report(what, progress.fraction)

    def _warm_up(self, spec: RunSpec, scene: Scene) -> None:
        """Compile and load the kernels of a model; the result of this run is not used."""
        if spec.model in self._warm:
            return
        self._warm.add(spec.model)
        self.report(f"loading the kernels of {spec.model}", 0.0)
        data = scene.model_dump(mode="json", exclude_none=True) | {"accuracy": ROUGH}
        data["time"]["duration"] *= WARM_PART
        data["output"].pop("every", None)
        with suppress(ComputationError, SceneError, ArithmeticError, ValueError, LookupError):
            run(as_scene(data))


def of_line(values: Mapping[str, np.ndarray], line: str) -> dict[str, np.ndarray]:
    """Of the outputs of a run those of a line, "" of one without a name."""
    return {split(key)[1]: x for key, x in values.items() if split(key)[0] == line}


def key_of(scene: Scene, repeat: int, also: str = "") -> str:
    """Hash of all that decides the result of a run: scene, files it reads, package, repetitions."""
    digest = hashlib.sha256(f"{version('hybrid-cable')} {repeat}{also}\n{scene_text(scene)}".encode())
    for path in scene.named_files():
        digest.update(Path(path).read_bytes())
    package = Path(__file__).parents[1]
    for source in sorted(package.rglob("*.py")):
        place = source.relative_to(package)
        if place.parts[0] not in SHOWS:
            digest.update(place.as_posix().encode() + source.read_bytes())
    return digest.hexdigest()[:16]


def _figures_of(result: Result, row: Row) -> Row:
    """Status, cost and estimates of a result."""
    attributes, steps = result.attributes, max(len(line["steps/t"]) for _, line in result.each_line())
    missed = next((event.text for event in result.events if event.kind == "accuracy missed"), "")
    known = {"cells": "cells", "runs": "effort_runs", "effort_cpu": "effort_cpu"}
    known |= {"estimate_position": "error_total_position", "estimate_end_force": "error_total_end_force"}
    figures: dict[str, Any] = {key: attributes.get(name) for key, name in known.items()}
    return replace(row, status=MISSED if missed else DONE, cause=missed, steps=steps, **figures)


# Where something was measured: machine, date, versions, commit; as lines for the heading of a page.


def facts_of_machine() -> list[tuple[str, str]]:
    """What a reader has to know before comparing a time with another machine's."""
    load = f", load {os.getloadavg()[0]:.1f} at the beginning" if hasattr(os, "getloadavg") else ""
    used = ", ".join(f"{name} {version(name)}" for name in ("hybrid-cable", "numpy", "numba"))
    facts = [("machine", f"{_processor()}, {os.cpu_count()} cores{load}")]
    facts += [("date", datetime.now().astimezone().strftime("%Y-%m-%d %H:%M %Z"))]
    facts += [("versions", f"{used}, Python {platform.python_version()}")]
    commit = _commit()
    return [*facts, ("commit", commit)] if commit else facts


def _processor() -> str:
    """The model of the processor, as well as the system knows it."""
    with suppress(OSError):
        for line in Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor() or platform.machine()


def _commit() -> str:
    """Of the checkout that the package is in; "" if it is in none."""
    root = Path(__file__).parents[2]
    if not (root / ".git").exists():
        return ""
    with suppress(OSError, subprocess.CalledProcessError):
        ask = {"cwd": root, "capture_output": True, "text": True, "check": True}
        commit = subprocess.run(["git", "rev-parse", "--short", "HEAD"], **ask).stdout.strip()  # type: ignore[call-overload]
        changed = subprocess.run(["git", "status", "--porcelain", "hybrid"], **ask).stdout.strip()  # type: ignore[call-overload]
        return f"{commit}, with changes" if changed else str(commit)
    return ""
