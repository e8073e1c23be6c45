"""A run of a ladder: its scene, how it is made and timed, and how it is kept for the next call."""

from __future__ import annotations

import hashlib
import json
import time as clock
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import asdict, dataclass, replace
from importlib.metadata import version
from pathlib import Path
from statistics import median
from typing import Any, get_args

import numpy as np

from hybrid.errors import Complaint, ComputationError, SceneError
from hybrid.scene.analysis import LEAST_DAMPED
from hybrid.scene.base import Kinds
from hybrid.scene.read import scene_text, validate_scene
from hybrid.scene.schema import Model, Scene
from hybrid.simulation.api import run
from hybrid.simulation.progress import Progress
from hybrid.store.reader import Result
from hybrid.store.tradeoff_table import DONE, FAILED, MISSED, OURS, Row
from hybrid.studies.machine import facts_of_machine

# What a run takes to load the kernels before anything is timed, of accuracy and of the duration: they are the same for
# all of it.
ROUGH = "10%"
WARM_PART = 0.02
# Keys of a model that say how finely, not what: the ladder decides these.
FINENESS = ("kind", "tolerance", "rod_cell", "hold_time")
COMPARED = ("position", "reaction_start", "reaction_end")
# Files of the package that change no answer, only how it is shown or ranked.
SHOWS = ("cli", "view", "exports", "interop")


@dataclass(frozen=True)
class Doing:
    """Where a ladder is: how many runs are done, of how many, which one runs, and how far that one is (0 to 1)."""

    done: int
    total: int
    what: str
    part: float


@dataclass(frozen=True)
class Rung:
    """A run to be made."""

    model: str
    accuracy: str
    scene: Scene | None  # None: refused
    refused: str = ""
    times: int = 1  # it is made, of which the median cost counts

    @property
    def name(self) -> str:
        return f"{self.model} {self.accuracy}"


def kinds_of_models() -> tuple[str, ...]:
    """The kinds of `model` that scenes know."""
    return next(part.names for part in get_args(Model) if isinstance(part, Kinds))


def rung_data(scene: Scene, kind: str, accuracy: str) -> dict[str, Any]:
    """The scene with this model at this accuracy, and nothing in it that says how finely; as data."""
    data = scene.model_dump(mode="json", exclude_none=True)
    for name in ("mesh", "solver"):
        data.pop(name, None)
    time, output = data["time"], data.get("output", {})
    for name in ("step", "tolerance"):
        time.pop(name, None)
    if time["rho_inf"] > LEAST_DAMPED:
        time.pop("rho_inf")
    for name in ("errors", "criteria"):
        output.pop(name, None)
    given = data["model"] if data["model"]["kind"] == kind else {}
    said = {name: value for name, value in given.items() if name not in FINENESS}
    if "zones" in said:
        said["zones"] = [{k: x for k, x in zone.items() if k not in ("cells", "ratio")} for zone in said["zones"]]
    return data | {"model": {"kind": kind} | said, "accuracy": accuracy}


def rung_of(scene: Scene, kind: str, accuracy: str) -> Rung:
    try:
        return Rung(kind, accuracy, validate_scene(rung_data(scene, kind, accuracy)))
    except SceneError as error:
        return Rung(kind, accuracy, None, _in_short(error))


def _in_short(error: SceneError) -> str:
    first = error.complaints[0]
    if first.value == "nothing":
        return f"it gives no {first.where}"
    return f"refused: {first.where}: given {first.value}, expected {first.expected}"


class Desk:
    """Makes runs, keeps what they find in the folder, and says how far it is."""

    def __init__(self, folder: Path, told: Callable[[Doing], None] | None, total: int) -> None:
        self.folder, self.total = folder, total
        self.done, self.made, self._told, self._warm = 0, 0, told, set[str]()
        self.facts = facts_of_machine()  # now: the load is that before the first run
        (folder / "runs").mkdir(parents=True, exist_ok=True)

    def say(self, what: str, part: float) -> None:
        if self._told is not None:
            self._told(Doing(self.done, self.total, what, part))

    def kept(self, rung: Rung, must: bool = False) -> tuple[Row, dict[str, np.ndarray]]:
        """The run as it was kept, else made and kept now; must: a failure is raised, not kept."""
        row = Row(OURS, rung.model, rung.accuracy, FAILED, rung.refused)
        if rung.scene is None:
            if must:
                raise SceneError([Complaint("reference", rung.name, "a model that the scene admits", rung.refused)])
            self.done += 1
            return row, {}
        key = key_of(rung.scene, rung.times)
        found = self.found(key)
        if found is None:
            found = self._made(replace(row, key=key), rung, rung.scene, must)
        self.done += 1
        return found

    def found(self, key: str) -> tuple[Row, dict[str, np.ndarray]] | None:
        """A run that was kept."""
        try:
            row = Row(**json.loads((self.folder / "runs" / f"{key}.json").read_text(encoding="utf-8")))
            if row.status == FAILED:
                return row, {}
            with np.load(self.folder / "runs" / f"{key}.npz") as file:
                return row, {name: file[name] for name in file.files}
        except (OSError, ValueError, TypeError):  # absent, or of another version: it is made again
            return None

    def keep(self, row: Row, values: Mapping[str, np.ndarray]) -> tuple[Row, dict[str, np.ndarray]]:
        """Keep a run, and return it as a later call will find it.  Its JSON comes last and at once, so that what is
        there is whole; seven digits are enough for errors of a ten-thousandth, and half the room.
        """
        runs = self.folder / "runs"
        half = {name: np.asarray(x, dtype=np.float32) for name, x in values.items()}
        if half:
            with (runs / f"{row.key}.npz").open("wb") as file:
                np.savez_compressed(file, **half)  # type: ignore[arg-type]
        draft = runs / f"{row.key}.part"
        draft.write_text(json.dumps(asdict(row), indent=1) + "\n", encoding="utf-8")
        draft.replace(runs / f"{row.key}.json")
        return row, half

    def _made(self, row: Row, rung: Rung, scene: Scene, must: bool) -> tuple[Row, dict[str, np.ndarray]]:
        spent, result = [], None
        try:
            self._warm_up(rung, scene)
            for k in range(rung.times):
                what = rung.name + (f", {k + 1} of {rung.times}" if rung.times > 1 else "")
                self.say(what, 0.0)
                begin = clock.process_time()
                result = run(scene, progress=self._follow(what))
                spent.append(clock.process_time() - begin)
        except ComputationError as error:
            if must:
                detail = f"this was the reference, {rung.name}, without which nothing can be compared; {error.detail}"
                raise ComputationError(error.outcome, error.t, error.s, detail.rstrip("; ")) from None
            return self.keep(replace(row, cause=str(error).splitlines()[0]), {})
        except (ArithmeticError, ValueError, LookupError, TypeError, AssertionError) as error:
            if must:
                raise
            return replace(row, cause=f"a bug: {type(error).__name__}: {error}"), {}
        assert result is not None
        values = {name: np.array(result[name]) for name in COMPARED if name in result}
        row = replace(_told_by(result, row), cpu=median(spent))
        self.made += 1
        return self.keep(row, values)

    def _follow(self, what: str) -> Callable[[Progress], None]:
        def follow(progress: Progress) -> None:
            self.say(what, progress.fraction)

        return follow

    def _warm_up(self, rung: Rung, scene: Scene) -> None:
        """Have the kernels of a model compiled and loaded; whether it goes well does not matter."""
        if rung.model in self._warm:
            return
        self._warm.add(rung.model)
        self.say(f"loading the kernels of {rung.model}", 0.0)
        data = rung_data(scene, rung.model, ROUGH)
        data["time"]["duration"] *= WARM_PART
        data["output"].pop("every", None)
        with suppress(ComputationError, SceneError, ArithmeticError, ValueError, LookupError):
            run(validate_scene(data))


def key_of(scene: Scene, repeat: int, also: str = "") -> str:
    """Of all that decides what a run finds: the scene, files it reads, the package, how often it is timed."""
    digest = hashlib.sha256(f"{version('hybrid-cable')} {repeat}{also}\n{scene_text(scene)}".encode())
    for end in scene.ends.both:
        if end.prescribed_motion is not None and end.prescribed_motion.file is not None:
            digest.update(Path(end.prescribed_motion.file).read_bytes())
    package = Path(__file__).parents[1]
    for source in sorted(package.rglob("*.py")):
        place = source.relative_to(package)
        if place.parts[0] not in SHOWS and "peers" not in place.parts:
            digest.update(place.as_posix().encode() + source.read_bytes())
    return digest.hexdigest()[:16]


def _told_by(result: Result, row: Row) -> Row:
    """What a result says of itself."""
    said = result.attributes
    missed = next((event.text for event in result.events if event.kind == "accuracy missed"), "")
    return replace(
        row, status=MISSED if missed else DONE, cause=missed, cells=said.get("cells"),
        steps=len(result["steps/t"]), runs=said.get("effort_runs"), effort_cpu=said.get("effort_cpu"),
        estimate_position=said.get("error_total_position"), estimate_pull=said.get("error_total_end_force"),
    )  # fmt: skip
