"""Error against cost: a ladder of models and accuracies on one scene, each run compared with a converged rod.

Every finished run is kept in the folder, so that a second call does only what is missing.
docs/trade.md
"""

from __future__ import annotations

import hashlib
import json
import time as clock
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, replace
from importlib.metadata import version
from pathlib import Path
from statistics import median
from typing import Any, get_args

import numpy as np

import hybrid.peers as others
from hybrid.errors import Complaint, ComputationError, SceneError
from hybrid.machine import facts_of_machine
from hybrid.model.effort import Asked, asked
from hybrid.model.plan import output_times
from hybrid.results.read import Result
from hybrid.results.tradeplot import plot_trade
from hybrid.results.tradetable import CHECK, DONE, FAILED, MISSED, OURS, REFERENCE, Row, TradeTable, judged
from hybrid.scene.accuracy import amount
from hybrid.scene.read import scene_text, validate_scene
from hybrid.scene.schema import Model, Scene
from hybrid.scene.table import Kinds
from hybrid.scene.task import LEAST_DAMPED
from hybrid.simulate import Progress, run

ACCURACIES = ("10%", "3%", "1%", "0.3%", "0.1%")
# The reference: a third of the finest accuracy on the usual ladder.  A finer ladder needs a finer reference: errors
# below half of what it is asked for would be its own.
REFERENCE_ACCURACY, LEAST_FINER = "0.03%", 0.5
CHECK_COARSER = 3.0  # the run that shows how converged the reference is: asked for so many times its error
ROUGHEST_PART = 0.1  # of what `accuracy` takes
# Part of the duration that a run takes to load the kernels before anything is timed: they are the same for all of it.
WARM_PART = 0.02
# Keys of a model that say how finely, not what: the ladder decides these.
FINENESS = ("kind", "tolerance", "rod_cell", "dwell")
COMPARED = ("position", "reaction_start", "reaction_end")
PULLS = COMPARED[1:]
# Files of the package that change no answer, only how it is shown or ranked.
SHOWS = frozenset(("__init__", "cli", "live", "ladder", "machine", "look", "views", "panels", "plot", "zoneplot")) | {
    "tradetable",
    "tradeplot",
}


@dataclass(frozen=True)
class Doing:
    """Where a ladder is: how many runs are done, of how many, which one runs, and how far that one is (0 to 1)."""

    done: int
    total: int
    what: str
    part: float


@dataclass(frozen=True)
class _Rung:
    """A run to be made."""

    model: str
    accuracy: str
    scene: Scene | None  # None: refused
    refused: str = ""
    times: int = 1  # it is made, of which the median cost counts

    @property
    def name(self) -> str:
        return f"{self.model} {self.accuracy}"


def trade(
    scene: Scene,
    folder: str | Path,
    *,
    models: Sequence[str] | None = None,
    accuracies: Sequence[str] = ACCURACIES,
    reference: str | None = None,
    asked_for: str = "1%",
    repeat: int = 1,
    peers: bool = False,
    told: Callable[[Doing], None] | None = None,
    command: str = "",
) -> TradeTable:
    """Compute a scene with every model at every accuracy, compare with a converged rod, and write table and picture.

    folder: gets trade.csv, trade.md, trade.png and, in runs/, what each run has found; a second call does what is
    missing.  models: kinds of `model`, None: all that the scene admits; accuracies, reference, asked_for: as the
    scene's `accuracy`; repeat: of so many runs the median CPU time counts; peers: other programs as well, those that
    are installed; told: called with what is being done; command: for the heading of the page.

    Raises SceneError when scene or ladder are refused, ComputationError when the reference fails.  KeyboardInterrupt
    leaves a table of what is done.
    """
    scene.require_time()
    names = _models(scene, models)
    goal = reference or _finer(scene, accuracies)
    checks = [_asked(scene, x, "accuracies") for x in accuracies]
    wanted = _asked(scene, asked_for, "for")
    _must_be_finer(_asked(scene, goal, "reference"), goal, checks)
    if repeat < 1:
        raise SceneError([Complaint("repeat", str(repeat), "1 or more runs, of which the median counts")])
    notes = _notes(scene, names, models is None)
    kinds = [kind for kind, reason in names.items() if not reason or models is not None]
    rod = "rod" if _refusal(scene, "rod", goal) == "" else kinds[0]
    ladder = [replace(_rung(scene, kind, x), times=repeat) for x in accuracies for kind in kinds]
    guests = others.ladder(scene) if peers else []
    desk = _Desk(Path(folder), told, 2 + len(ladder) + len(guests))

    best, truth = desk.kept(_rung(scene, rod, goal), must=True)
    check, _ = _compared(desk, _rung(scene, rod, _coarser(goal)), truth, scene.length)
    rows = [replace(best, status=REFERENCE), replace(check, status=CHECK) if check.status != FAILED else check]
    limits: list[tuple[float | None, float | None]] = [(None, None), (None, None)]
    largest = _largest_pull(truth)
    try:
        for rung, want in zip(ladder, [x for x in checks for _ in kinds], strict=True):
            rows.append(_compared(desk, rung, truth, scene.length)[0])
            limits.append(_bounds(want, largest))
        for guest in guests:
            rows.append(_of_guest(desk, guest, repeat, scene, truth))
            limits.append((None, None))
    finally:
        position, pull = _bounds(wanted, largest)
        found = judged(rows, limits)
        found.sort(key=lambda row: _order(row, kinds))
        table = TradeTable(
            scene.title, asked_for, scene.length, largest, position, pull, tuple(found), tuple(notes),
            (*desk.facts, *_measured(desk, repeat, command, guests)), desk.total - len(rows),
        )  # fmt: skip
        table.write(desk.folder, "trade.png")
        plot_trade(table, desk.folder / "trade.png")
    return table


def _order(row: Row, kinds: Sequence[str]) -> int:
    """Reference and check first, then model by model, then other programs."""
    if row.status in (REFERENCE, CHECK):
        return -1
    return kinds.index(row.model) if row.code == OURS and row.model in kinds else len(kinds)


# --- the ladder ---------------------------------------------------------------------------------


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


def _rung(scene: Scene, kind: str, accuracy: str) -> _Rung:
    try:
        return _Rung(kind, accuracy, validate_scene(rung_data(scene, kind, accuracy)))
    except SceneError as error:
        return _Rung(kind, accuracy, None, _in_short(error))


def _in_short(error: SceneError) -> str:
    first = error.complaints[0]
    if first.value == "nothing":
        return f"it gives no {first.where}"
    return f"refused: {first.where}: given {first.value}, expected {first.expected}"


def _refusal(scene: Scene, kind: str, accuracy: str) -> str:
    return _rung(scene, kind, accuracy).refused


def _models(scene: Scene, wanted: Sequence[str] | None) -> dict[str, str]:
    """Kinds of models, and why the scene does not admit them, "" if it does."""
    known = kinds_of_models()
    for name in wanted or ():
        if name not in known:
            raise SceneError([Complaint("models", name, f"some of: {', '.join(known)}")])
    return {kind: _refusal(scene, kind, ACCURACIES[0]) for kind in wanted or known}


def _notes(scene: Scene, models: Mapping[str, str], chosen: bool) -> list[str]:
    """What of the scene the ladder does not keep, and which models it has left out."""
    time = scene.require_time()
    dropped = [f"time.{x}" for x in ("step", "tolerance") if getattr(time, x) is not None]
    dropped += ["time.rho_inf"] if time.rho_inf > LEAST_DAMPED else []
    dropped += [name for name in ("mesh", "accuracy") if getattr(scene, name) is not None]
    dropped += [f"output.{x}" for x in ("errors", "criteria") if x in scene.output.model_fields_set]
    dropped += ["solver"] if scene.solver != "elimination" else []
    given = scene.model.model_dump(exclude_none=True)
    dropped += [f"model.{x}" for x in FINENESS[1:] if x in given]
    notes = [f"The ladder chooses mesh, steps and tolerance: of the scene it leaves out {', '.join(dropped)}."]
    kept = [x for x in sorted(scene.model.model_fields_set) if x not in FINENESS]
    if kept:
        notes.append(f"Of the scene's model it keeps {', '.join(kept)}, for runs of that kind ({scene.model.kind}).")
    if chosen:
        notes += [f"Not admitted by the scene: {kind} ({why})." for kind, why in models.items() if why]
    return notes if dropped else notes[1:]


def _asked(scene: Scene, accuracy: str, where: str) -> Asked:
    """An accuracy in numbers; SceneError if it is none."""
    try:
        found = asked(validate_scene(rung_data(scene, scene.model.kind, accuracy)))
    except SceneError as error:
        bad = [c for c in error.complaints if c.where.startswith("accuracy")] or error.complaints
        raise SceneError([replace(c, where=where, line=None, column=None) for c in bad]) from None
    assert found is not None
    return found


def _finer(scene: Scene, accuracies: Sequence[str]) -> str:
    """An accuracy for the reference: the usual one, or a third of the finest of the ladder."""
    parts = [amount(x)[1] for x in accuracies if _asked(scene, x, "accuracies") and amount(x)[0] == "part"]
    return f"{100 * min([amount(REFERENCE_ACCURACY)[1], *(x / CHECK_COARSER for x in parts)]):.3g}%"


def _coarser(accuracy: str) -> str:
    """The same, asked for three times the error."""
    what, size = amount(accuracy)
    size *= CHECK_COARSER
    return (
        f"{100 * min(size, ROUGHEST_PART):.3g}%"
        if what == "part"
        else f"{size:.3g} {'m' if what == 'position' else 'N'}"
    )


def _must_be_finer(goal: Asked, text: str, ladder: Sequence[Asked]) -> None:
    for name in ("position", "tension", "of_pull"):
        finest = min((x for x in (getattr(each, name) for each in ladder) if x is not None), default=None)
        mine = getattr(goal, name)
        if finest is not None and mine is not None and mine > LEAST_FINER * finest:
            fix = "a finer reference, or coarser accuracies"
            raise SceneError([Complaint("reference", text, "at most half of the finest accuracy of the ladder", fix)])


def _bounds(want: Asked, largest: float | None) -> tuple[float | None, float | None]:
    """What is asked for in m and N; the tighter one of two for the pull."""
    pulls = [want.tension] if want.tension is not None else []
    pulls += [want.of_pull * largest] if want.of_pull is not None and largest else []
    return want.position, min(pulls, default=None)


# --- runs ---------------------------------------------------------------------------------------


class _Desk:
    """Makes runs, keeps what they find in the folder, and says how far it is."""

    def __init__(self, folder: Path, told: Callable[[Doing], None] | None, total: int) -> None:
        self.folder, self.total = folder, total
        self.done, self.made, self._told, self._warm = 0, 0, told, set[str]()
        self.facts = facts_of_machine()  # now: the load is that before the first run
        (folder / "runs").mkdir(parents=True, exist_ok=True)

    def say(self, what: str, part: float) -> None:
        if self._told is not None:
            self._told(Doing(self.done, self.total, what, part))

    def kept(self, rung: _Rung, must: bool = False) -> tuple[Row, dict[str, np.ndarray]]:
        """The run as it was kept, else made and kept now; must: a failure is raised, not kept."""
        row = Row(OURS, rung.model, rung.accuracy, FAILED, rung.refused)
        if rung.scene is None:
            if must:
                raise SceneError([Complaint("reference", rung.name, "a model that the scene admits", rung.refused)])
            self.done += 1
            return row, {}
        key = _key(rung.scene, rung.times)
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

    def _made(self, row: Row, rung: _Rung, scene: Scene, must: bool) -> tuple[Row, dict[str, np.ndarray]]:
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
            self.say(what, progress.t / progress.duration)

        return follow

    def _warm_up(self, rung: _Rung, scene: Scene) -> None:
        """Have the kernels of a model compiled and loaded; whether it goes well does not matter."""
        if rung.model in self._warm:
            return
        self._warm.add(rung.model)
        self.say(f"loading the kernels of {rung.model}", 0.0)
        data = rung_data(scene, rung.model, ACCURACIES[0])
        data["time"]["duration"] *= WARM_PART
        data["output"].pop("every", None)
        with suppress(ComputationError, SceneError, ArithmeticError, ValueError, LookupError):
            run(validate_scene(data))


def _key(scene: Scene, repeat: int, also: str = "") -> str:
    """Of all that decides what a run finds: the scene, files it reads, the package, how often it is timed."""
    digest = hashlib.sha256(f"{version('hybrid-cable')} {repeat}{also}\n{scene_text(scene)}".encode())
    for end in (scene.ends.start, scene.ends.end):
        file = getattr(getattr(end, "motion", None), "file", None)
        if file is not None:
            digest.update(Path(file).read_bytes())
    package = Path(__file__).parent
    for source in sorted(package.rglob("*.py")):
        place = source.relative_to(package)
        if place.stem not in SHOWS and place.parts[0] != "peers":
            digest.update(place.as_posix().encode() + source.read_bytes())
    return digest.hexdigest()[:16]


def _told_by(result: Result, row: Row) -> Row:
    """What a result says of itself."""
    said = result.attributes
    missed = next((event.text for event in result.events if event.kind == "accuracy missed"), "")
    return replace(
        row, status=MISSED if missed else DONE, cause=missed, cells=said.get("cells"),
        steps=len(result["steps/t"]), runs=said.get("effort_runs"), effort_cpu=said.get("effort_cpu"),
        estimate_position=said.get("error_total_position"), estimate_pull=said.get("error_total_pull"),
    )  # fmt: skip


def _compared(
    desk: _Desk, rung: _Rung, truth: Mapping[str, np.ndarray], length: float
) -> tuple[Row, dict[str, np.ndarray]]:
    row, values = desk.kept(rung)
    return (against(row, values, truth, length) if values else row), values


def against(row: Row, values: Mapping[str, np.ndarray], truth: Mapping[str, np.ndarray], length: float) -> Row:
    """The row with its errors: outputs (nt, ...) of the run and of the reference, at the same times and places."""
    position = float(np.linalg.norm(values["position"] - truth["position"], axis=-1).max())
    pulls = [float(_apart(values[x], truth[x]).max()) for x in PULLS if x in values and x in truth]
    row = replace(row, position=position, position_part=position / length)
    largest = _largest_pull(truth)
    if not pulls or not largest:
        return row
    return replace(row, pull=max(pulls), pull_part=max(pulls) / largest)


def _apart(force: np.ndarray, truth: np.ndarray) -> np.ndarray:
    """Difference (nt,) of two forces (nt, 3), N; of their sizes, where only that is known (nt, 1)."""
    if force.shape[-1] == 1:
        return np.asarray(np.abs(np.abs(force[:, 0]) - np.linalg.norm(truth, axis=-1)))
    return np.asarray(np.linalg.norm(force - truth, axis=-1))


def _largest_pull(truth: Mapping[str, np.ndarray]) -> float | None:
    """N; None: no end is held."""
    return max((float(np.linalg.norm(truth[x], axis=-1).max()) for x in PULLS if x in truth), default=None) or None


# --- other programs -----------------------------------------------------------------------------


def _of_guest(desk: _Desk, guest: others.Guest, repeat: int, scene: Scene, truth: Mapping[str, np.ndarray]) -> Row:
    """The row of another program, kept as ours are."""
    row = Row(
        guest.code,
        guest.model,
        guest.told,
        FAILED,
        guest.cannot,
        key=_key(scene, repeat, others.driver(guest)) + guest.tag,
    )
    if guest.cannot:
        desk.done += 1
        return replace(row, status=others.CANNOT)
    found = desk.found(row.key)
    if found is None:
        desk.say(guest.name, 0.0)
        try:
            answers = [others.answer(guest, scene) for _ in range(repeat)]
        except others.Failed as error:
            found = desk.keep(replace(row, cause=str(error)), {})
        else:
            values = answers[-1].values
            row = replace(row, status=DONE, cells=guest.elements, steps=answers[-1].steps)
            found = desk.keep(replace(row, cpu=median(x.cpu for x in answers)), values)
            desk.made += 1
    desk.done += 1
    if not found[1]:
        return found[0]
    pulls = np.max([_apart(found[1][x], truth[x]) for x in PULLS], axis=0)
    # A jolt at the start, or one blow, is another matter than an error that lasts.
    worst, usual = [0.0, *output_times(scene)][int(pulls.argmax())], float(np.median(pulls))
    cause = f"its pull is furthest off at t = {worst:g} s, usually by {usual:.3g} N"
    return against(replace(found[0], cause=cause), found[1], truth, scene.length)


def _measured(desk: _Desk, repeat: int, command: str, guests: Sequence[others.Guest]) -> list[tuple[str, str]]:
    """How costs were measured, for the heading."""
    count = "one run each" if repeat == 1 else f"median of {repeat} runs"
    made = "all made by this call" if desk.made == desk.done else f"{desk.made} of {desk.done} made by this call"
    said = [("other programs", found)] if (found := others.versions(guests)) else []
    said += [("command", f"`{command}`")] if command else []
    return [*said, ("CPU time", f"of the process, kernels loaded beforehand; {count}; {made}")]
