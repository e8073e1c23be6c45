"""Error against cost: models at several accuracies and levels of demand.

Each run is compared with a converged rod, and kept in the folder, so that a second call computes only what is
missing.

Levels of demand are position and tension; bending moments as well; curvature as well.  A run asks for the accuracy of
its level, and is compared with a rod everywhere of a third of that error (docs/trade.md).
"""

from __future__ import annotations

import csv
import io
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, fields, replace
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from hybrid.errors import Complaint, SceneError
from hybrid.model.resolution import RequestedAccuracy, requested_accuracy
from hybrid.scene.analysis import LEAST_DAMPED, amount
from hybrid.scene.base import dotted
from hybrid.scene.read import SceneLike, as_scene
from hybrid.scene.root import Scene
from hybrid.simulation.progress import interrupts
from hybrid.store.tables import CHECK, FAILED, REFERENCE, Row, TradeTable, judged
from hybrid.studies.runs import (
    COMPARED,
    FINENESS,
    RunSpec,
    RunStore,
    StudyProgress,
    model_kinds,
    of_line,
    run_spec,
    scene_data,
)
from hybrid.view.several_runs import plot_trade

ACCURACIES = ("10%", "3%", "1%", "0.3%", "0.1%")
# The reference: a third of the finest default accuracy.  Finer accuracies need a finer reference: errors below half of
# its accuracy would be its own.
REFERENCE_ACCURACY, LEAST_FINER = "0.03%", 0.5
CHECK_COARSER = 3.0  # the run that shows how converged the reference is: asked for so many times its error
ROUGHEST_PART = 0.1  # of what `accuracy` takes
END_FORCES = COMPARED[1:]
OF_LEVELS = (*COMPARED, "bending_moment", "curvature")
Values = Mapping[str, np.ndarray]  # outputs of a run
# Said to those who ask for other programs.
PEERS_ARE = "other programs are compared by a bench now: in bench of the sources, python -m peers.trade SCENE.yaml"


def trade(
    scene: SceneLike,
    folder: str | Path,
    *,
    models: Sequence[str] | None = None,
    accuracies: Sequence[str] = ACCURACIES,
    reference: str | None = None,
    target: str = "1%",
    repeat: int = 1,
    progress: Callable[[StudyProgress], None] | None = None,
    command: str = "",
    **former: Any,
) -> TradeTable:
    """Compute a scene with every model at every accuracy, compare with a converged rod, and write table and picture.

    folder: gets trade.csv, trade.md, trade.png and, in runs/, what each run has found; a second call does what is
    missing.  models: kinds of `model`, None: all that the scene admits; accuracies, reference, target: as the
    scene's `accuracy`; repeat: of so many runs the median CPU time counts; progress: called with a StudyProgress;
    command: for the heading of the page.

    Raises SceneError when the scene or an argument is refused, ResultError when the folder cannot be written to,
    ComputationError when the reference fails.  KeyboardInterrupt leaves a table of the finished runs.
    """
    target, progress = _renamed(former, target, progress)
    tables = as_scene(scene)
    tables.require_time()
    names = _models(tables, models)
    goal = reference or _finer(tables, accuracies)
    checks = [_asked(tables, x, "accuracies") for x in accuracies]
    wanted = _asked(tables, target, "for")
    _must_be_finer(_asked(tables, goal, "reference"), goal, checks)
    if repeat < 1:
        raise SceneError([Complaint("repeat", str(repeat), "1 or more runs, of which the median counts", "--repeat 3")])
    notes = _notes(tables, names, models is None)
    kinds = [kind for kind, reason in names.items() if not reason or models is not None]
    rod = "rod" if _refusal(tables, "rod", goal) == "" else kinds[0]
    specs = [replace(run_spec(tables, kind, x), times=repeat) for x in accuracies for kind in kinds]
    notes += [f"Not admitted by {x}, which keeps its model: {y}." for x, y in _unchanged(specs).items()]
    with interrupts() as stopped:
        store = RunStore(Path(folder), progress, 2 + len(specs), stopped)
        best, reference_values = store.get(run_spec(tables, rod, goal), required=True)
        rows = [replace(best, status=REFERENCE)]
        limits: list[tuple[float | None, float | None]] = [(None, None)]
        largest, lengths = _largest_end_force(reference_values), _lengths(tables)
        if not largest and wanted.position is None:
            raise SceneError([Complaint("for", target, "an error of position: no end is held", '--for "3 cm"')])
        try:
            check = _compared(store, run_spec(tables, rod, _coarser(goal)), reference_values, lengths)
            rows.append(replace(check, status=CHECK) if check.status != FAILED else check)
            limits.append((None, None))
            for spec, want in zip(specs, [x for x in checks for _ in kinds], strict=True):
                rows.append(_compared(store, spec, reference_values, lengths))
                limits.append(_bounds(want, largest))
        finally:
            position, end_force = _bounds(wanted, largest)
            facts, asked = (*store.facts, *_measured(store, repeat, command)), (largest, position, end_force)
            left, found = store.total - len(rows), (tuple(rows), tuple(notes), facts)
            table = TradeTable(_title(tables), target, tables.length, *(*asked, *found), left)
            table = _written(judged(table, limits), kinds, store.folder)
    return table


def _written(table: TradeTable, kinds: Sequence[str], folder: Path) -> TradeTable:
    """The table with its rows in order, as it is written into the folder of a study."""
    table = replace(table, rows=tuple(sorted(table.rows, key=lambda row: _order(row, kinds))))
    table.write(folder, "trade.png")
    plot_trade(table, folder / "trade.png", overwrite=True)  # the folder is of this program
    return table


def refuse_peers(given: Mapping[str, Any]) -> None:
    """TypeError if other programs are asked for, as 0.6 took them."""
    if "peers" in given:
        raise TypeError(f"peers: {PEERS_ARE}")


def _renamed(former: dict[str, Any], target: str, progress: Any) -> tuple[str, Any]:
    """Arguments of `trade` under their names of 0.5."""
    refuse_peers(former)
    now = {"asked_for": "target", "told": "progress"}
    for name in former:
        if name not in now:
            raise TypeError(f"trade() got an unexpected keyword argument {name!r}")
        warnings.warn(f"trade({name}=...) is now trade({now[name]}=...)", DeprecationWarning, stacklevel=3)
    return former.get("asked_for", target), former.get("told", progress)


def _order(row: Row, kinds: Sequence[str]) -> int:
    """Reference and check first, then model by model."""
    if row.status in (REFERENCE, CHECK):
        return -1
    return kinds.index(row.model) if row.model in kinds else len(kinds)


# --- what is asked ------------------------------------------------------------------------------


def _title(scene: Scene) -> str:
    """The title, else the names that its lines have."""
    return scene.title or ", ".join(scene.asked_lines)


def _lengths(scene: Scene) -> dict[str, float]:
    """Of every line by its name, "" of one that has none, m."""
    return {name: x.length for name, x in scene.asked_scenes.items()}


def _unchanged(specs: Sequence[RunSpec]) -> dict[str, str]:
    """Lines that keep their model while others change, and which they do not admit."""
    found: dict[str, dict[str, None]] = {}
    for spec in specs:
        for line, why in spec.unchanged.items():
            found.setdefault(line, {})[f"{spec.model} ({why})"] = None
    return {line: ", ".join(each) for line, each in found.items()}


def _refusal(scene: Scene, kind: str, accuracy: str) -> str:
    return run_spec(scene, kind, accuracy).refused


def _models(scene: Scene, wanted: Sequence[str] | None) -> dict[str, str]:
    """Kinds of models, and why the scene does not admit them, "" if it does."""
    known = model_kinds()
    for name in wanted or ():
        if name not in known:
            raise SceneError([Complaint("models", name, f"some of: {', '.join(known)}", f"--models {known[0]}")])
    return {kind: _refusal(scene, kind, ACCURACIES[0]) for kind in wanted or known}


def _notes(scene: Scene, models: Mapping[str, str], chosen: bool) -> list[str]:
    """Keys of the scene that the study ignores, and models that the scene does not admit."""
    time, output, lines = scene.require_time(), scene.written.output, scene.lines
    called = {name: lambda key, name=name: dotted(scene.form.place(("lines", name, key))) for name in lines}
    given = {name: scene.asked_scene(name).model for name in lines}
    dropped = [f"time.{x}" for x in ("step", "tolerance") if getattr(time, x) is not None]
    dropped += ["time.rho_inf"] if time.rho_inf > LEAST_DAMPED else []
    dropped += [called[name]("mesh") for name, x in lines.items() if x.mesh is not None]
    dropped += ["accuracy"] if scene.accuracy is not None else []
    dropped += [called[name]("accuracy") for name, x in lines.items() if x.accuracy is not None]
    dropped += [f"output.{x}" for x in ("errors", "criteria") if x in output.model_fields_set]
    for name, model in given.items():
        dropped += [f"{called[name]('model')}.{x}" for x in FINENESS[1:] if getattr(model, x, None) is not None]
    notes = [f"The study chooses mesh, steps and tolerance: it ignores these keys of the scene: {', '.join(dropped)}."]
    for name, model in given.items():
        kept, what = [x for x in sorted(model.model_fields_set) if x not in FINENESS], called[name]("model")
        if kept:
            notes.append(f"Of the scene's {what} it uses {', '.join(kept)}, for runs of that kind ({model.kind}).")
    if chosen:
        notes += [f"Not admitted by the scene: {kind} ({why})." for kind, why in models.items() if why]
    return notes if dropped else notes[1:]


def _asked(scene: Scene, accuracy: str, where: str) -> RequestedAccuracy:
    """An accuracy in numbers, parts of the longest line's length; SceneError if it is none."""
    try:
        lines = as_scene(scene_data(scene, "", accuracy, lines=())).asked_scenes.values()
    except SceneError as error:
        bad = [c for c in error.complaints if c.where.startswith("accuracy")] or error.complaints
        raise SceneError([replace(c, where=where, line=None, column=None) for c in bad[:1]]) from None
    found = requested_accuracy(max(lines, key=lambda line: line.length))
    assert found is not None
    return found


def _finer(scene: Scene, accuracies: Sequence[str]) -> str:
    """An accuracy for the reference: the usual one, or a third of the finest accuracy."""
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


def _must_be_finer(goal: RequestedAccuracy, text: str, specs: Sequence[RequestedAccuracy]) -> None:
    for name in ("position", "tension", "of_end_force"):
        finest = min((x for x in (getattr(each, name) for each in specs) if x is not None), default=None)
        mine = getattr(goal, name)
        if finest is not None and mine is not None and mine > LEAST_FINER * finest:
            fix = "a finer reference, or coarser accuracies"
            raise SceneError([Complaint("reference", text, "at most half of the finest accuracy of the study", fix)])


def _bounds(want: RequestedAccuracy, largest: float | None) -> tuple[float | None, float | None]:
    """What is asked for in m and N; the smaller of the two for the end force."""
    forces = [want.tension] if want.tension is not None else []
    forces += [want.of_end_force * largest] if want.of_end_force is not None and largest else []
    return want.position, min(forces, default=None)


# --- errors -------------------------------------------------------------------------------------


AnyRow = TypeVar("AnyRow", Row, "LevelRow")


def _worst(each: Sequence[AnyRow], *names: str) -> AnyRow:
    """Of the rows of a run for each line one with their largest figures of these names."""
    said = next((x for x in each if x.status == FAILED), each[0])
    known = {name: [x for x in (getattr(row, name) for row in each) if x is not None] for name in names}
    worst: dict[str, Any] = {name: max(found, default=None) for name, found in known.items()}
    return replace(said, **worst)


def _compared(store: RunStore, spec: RunSpec, reference: Values, lengths: Mapping[str, float]) -> Row:
    """The row of a run with its errors, the largest of all lines."""
    row, values = store.get(spec)
    if not values:
        return row
    each = [with_errors(row, of_line(values, x), of_line(reference, x), length) for x, length in lengths.items()]
    return _worst(each, "position", "position_part", "end_force", "end_force_part")


def with_errors(row: Row, values: Values, reference: Values, length: float) -> Row:
    """The row with the errors of a line; outputs (nt, ...) are of the same times and places."""
    position = float(np.linalg.norm(values["position"] - reference["position"], axis=-1).max())
    forces = [
        float(force_difference(values[x], reference[x]).max()) for x in END_FORCES if x in values and x in reference
    ]
    row = replace(row, position=position, position_part=position / length)
    largest = _largest_end_force(reference)
    if forces and largest:
        row = replace(row, end_force=max(forces), end_force_part=max(forces) / largest)
    if max(row.position_part or 0.0, row.end_force_part or 0.0) > 1.0:
        return replace(row, status=FAILED, cause="diverged: the error exceeds the length or the largest end force")
    return row


def force_difference(force: np.ndarray, reference: np.ndarray) -> np.ndarray:
    """Difference (nt,) of two forces (nt, 3), N; of their sizes, where only that is known (nt, 1)."""
    if force.shape[-1] == 1:
        return np.asarray(np.abs(np.abs(force[:, 0]) - np.linalg.norm(reference, axis=-1)))
    return np.asarray(np.linalg.norm(force - reference, axis=-1))


def _largest_end_force(reference: Values) -> float | None:
    """N, of all lines; None: no end is held."""
    forces = [x for key, x in reference.items() if key.endswith(END_FORCES)]
    return max((float(np.linalg.norm(x, axis=-1).max()) for x in forces), default=None) or None


def _measured(store: RunStore, repeat: int, command: str) -> list[tuple[str, str]]:
    """How costs were measured, for the heading."""
    count = "one run each" if repeat == 1 else f"median of {repeat} runs"
    made = "all computed now" if store.computed == store.done else f"{store.computed} of {store.done} computed now"
    rows = [("command", f"`{command}`")] if command else []
    return [*rows, ("CPU time", f"of the process, kernels loaded beforehand; {count}; {made}")]


# Errors that the levels allow.
POSITION = 1e-3  # of the length
TENSION = 0.01  # of the largest end force
ALONG = 0.05  # of the largest moment and curvature
LEVELS = {
    "A": {"position": "0.1%", "tension": "1%"},
    "B": {"position": "0.1%", "tension": "1%", "bending_moment": "5%"},
    "C": {"position": "0.1%", "tension": "1%", "bending_moment": "5%", "curvature": "5%"},
}
MEANS = {
    "A": "position within 0.1 % of the length, end forces within 1 % of the largest",
    "B": "the same, and the largest bending moment of every output within 5 %",
    "C": "the same, and curvature at every point and output within 5 % of the largest",
}
REFERENCE_OF_LEVELS = {"position": "0.03%", "tension": "0.3%", "bending_moment": "1.5%", "curvature": "1.5%"}
# Models that are tried: kinds of `model`, and zones that move whose rods have cells that follow the curvature.
FOLLOWING = "following"
MODELS = "rod", "catenary", "adaptive", FOLLOWING


@dataclass(frozen=True)
class LevelRow:
    """A run of a level; errors are parts as of MEANS, None: there is no such figure.  worst: over what is asked."""

    level: str
    model: str
    status: str
    cause: str
    position: float | None = None
    end_force: float | None = None
    moment: float | None = None
    curvature: float | None = None
    worst: float | None = None
    cells: int | None = None
    steps: int | None = None
    runs: int | None = None
    cpu: float | None = None  # s, of everything

    @property
    def meets(self) -> bool:
        """Whether every error that the level asks for is met."""
        return self.worst is not None and self.worst <= 1.0


@dataclass(frozen=True)
class LevelTable:
    """All rows, and the reference that they are compared with."""

    title: str
    reference: Row
    rows: tuple[LevelRow, ...]
    facts: tuple[tuple[str, str], ...]

    def cheapest(self, level: str) -> LevelRow | None:
        """Of our runs that meet a level the one that costs least."""
        good = [x for x in self.rows if x.level == level and x.meets and x.model in MODELS and x.cpu is not None]
        return min(good, key=lambda row: row.cpu or 0.0, default=None)

    def sentences(self) -> list[str]:
        """For every level the model to take, and what a rod everywhere costs."""
        out = []
        for level in LEVELS:
            best = self.cheapest(level)
            if best is None:
                out.append(f"Level {level} ({MEANS[level]}): no run met it.")
                continue
            rod = next((x for x in self.rows if (x.level, x.model) == (level, "rod") and x.meets), None)
            more = ""
            if rod is not None and rod.cpu and best.cpu and rod != best:
                more = f", {rod.cpu / best.cpu:.2g} times less than a rod everywhere"
            out.append(f"Level {level} ({MEANS[level]}): {best.model}, {best.cpu:.3g} s of CPU time{more}.")
        return out

    def csv(self) -> str:
        """All rows, SI units."""
        out = io.StringIO()
        writer = csv.writer(out, lineterminator="\n")
        writer.writerow([x.name for x in fields(LevelRow)])
        for row in self.rows:
            writer.writerow(["" if x is None else x for x in asdict(row).values()])
        return out.getvalue()

    def write(self, folder: Path) -> None:
        """levels.csv and levels.md in the folder."""
        for name, text in (("levels.csv", self.csv()), ("levels.md", self.markdown())):
            (folder / name).write_text(text, encoding="utf-8")

    def markdown(self, level: int = 1) -> str:
        """The page."""
        lines = [f"{'#' * level} {self.title or 'A cable'}: what each level costs", ""]
        lines += [*(f"- {text}" for text in self.sentences()), ""]
        head = "position", "end force", "moment", "curvature", "cells", "steps", "runs", "CPU"
        lines += [f"| level, model | status | {' | '.join(head)} | |"]
        lines += ["|---|---|" + "---:|" * 8 + "---|"]
        for row in self.rows:
            mark = "**cheapest**" if row == self.cheapest(row.level) else ""
            parts = [percent(x) for x in (row.position, row.end_force, row.moment, row.curvature)]
            counts = ["" if x is None else str(x) for x in (row.cells, row.steps, row.runs)]
            cpu = "" if row.cpu is None else f"{row.cpu:.3g} s"
            cells = [f"{row.level} {row.model}", status_of(row), *parts, *counts, cpu, mark]
            lines.append("| " + " | ".join(x.replace("|", "\\|") for x in cells) + " |")
        estimates = f"{self.reference.cells} cells, {self.reference.steps} steps"
        lines += ["", f"Reference: a rod everywhere asked for a third of these errors, {estimates}.", ""]
        lines += ["| measured with | |", "|---|---|", *(f"| {what} | {text} |" for what, text in self.facts), ""]
        return "\n".join(lines)


def status_of(row: LevelRow) -> str:
    """Whether a run meets its level, else by what factor it misses, or why it failed."""
    if row.worst is None:
        return f"{row.status}: {row.cause}"
    text = "meets it" if row.meets else f"error {row.worst:.2g} times what is asked"
    return f"{text}; reports: {row.cause}" if row.cause else text


def trade_levels(
    scene: SceneLike,
    folder: str | Path,
    *,
    repeat: int = 1,
    progress: Callable[[StudyProgress], None] | None = None,
    command: str = "",
    **former: Any,
) -> LevelTable:
    """Compute a scene at the three LEVELS with every model that it admits; what meets each at least cost.

    folder: gets levels.md, levels.csv and, in runs/, what each run has found; a second call does what is missing.
    repeat: of so many runs the median CPU time counts; progress, command: as of `trade`.

    Raises SceneError when the scene is refused, ComputationError when the reference fails.
    """
    refuse_peers(former)
    for name in former:
        raise TypeError(f"trade_levels() got an unexpected keyword argument {name!r}")
    tables = as_scene(scene)
    tables.require_time()
    specs = []
    for level, asked in LEVELS.items():
        for model in MODELS:
            if model == FOLLOWING and level == "A":
                continue  # what it follows is not asked
            more = {"curvature_error": ALONG} if model == FOLLOWING else {}
            kind = "adaptive" if model == FOLLOWING else model
            specs.append((level, model, run_spec(tables, kind, asked, f"level {level}", more, OF_LEVELS)))
    with interrupts() as stopped:
        store = RunStore(Path(folder), progress, 1 + len(specs), stopped)
        goal = run_spec(tables, "rod", REFERENCE_OF_LEVELS, "reference", kept=OF_LEVELS)
        (best, exact), lengths, rows = store.get(goal, required=True), _lengths(tables), []
        for level, model, spec in specs:
            row, values = store.get(replace(spec, times=repeat))
            each = [
                level_row(level, model, row, of_line(values, x), of_line(exact, x), length)
                for x, length in lengths.items()
            ]
            rows.append(_worst(each, "position", "end_force", "moment", "curvature", "worst"))
    unchanged = _unchanged([goal, *(spec for *_, spec in specs)])
    facts = (*store.facts, *([("command", f"`{command}`")] if command else []))
    facts += tuple((f"not admitted by {x}, which keeps its model", y) for x, y in unchanged.items())
    table = LevelTable(_title(tables), best, tuple(rows), facts)
    table.write(store.folder)
    return table


def level_row(level: str, model: str, row: Row, values: Values, exact: Values, length: float) -> LevelRow:
    """The row of a run with the errors of a line."""
    out = LevelRow(level, model, row.status, row.cause, cells=row.cells, steps=row.steps, runs=row.runs, cpu=row.cpu)
    if not values:
        return out
    found = with_errors(row, values, exact, length)
    peak, field = (_relative(values, exact, *x) for x in (("bending_moment", True), ("curvature", False)))
    out = replace(out, position=found.position_part, end_force=found.end_force_part, moment=peak, curvature=field)
    asked = [(out.position, POSITION), (out.end_force, TENSION)]
    asked += [(out.moment, ALONG)] if level in ("B", "C") else []
    asked += [(out.curvature, ALONG)] if level == "C" else []
    return replace(out, worst=max((x / bound for x, bound in asked if x is not None), default=None))


def _relative(values: Values, exact: Values, name: str, peaks: bool) -> float | None:
    """Largest error of a quantity (nt, ns) over its largest value; peaks: of the largest of every output."""
    if name not in values or name not in exact:
        return None
    one, other = values[name], exact[name]
    most = float(np.abs(other).max())
    if not most > 0.0:
        return None
    if peaks:
        one, other = np.abs(one).max(axis=1), np.abs(other).max(axis=1)
    return float(np.abs(one - other).max()) / most


def percent(value: float | None) -> str:
    """A part in per cent; empty where there is none."""
    return "" if value is None else f"{100.0 * value:.2g} %"
