"""Error against cost: models at several accuracies on one scene, each run compared with a converged rod.

Every finished run is kept in the folder, so that a second call computes only what is missing.
docs/trade.md
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from hybrid.errors import Complaint, SceneError
from hybrid.model.resolution import RequestedAccuracy, requested_accuracy
from hybrid.scene.accuracy import amount
from hybrid.scene.analysis import LEAST_DAMPED
from hybrid.scene.read import SceneLike, as_scene, one_line
from hybrid.scene.schema import LineScene
from hybrid.simulation.progress import interrupts
from hybrid.store.tradeoff_table import CHECK, FAILED, REFERENCE, Row, TradeTable, judged
from hybrid.studies.runs import (
    COMPARED,
    FINENESS,
    RunSpec,
    RunStore,
    StudyProgress,
    model_kinds,
    run_spec,
    scene_data,
)
from hybrid.view.study_report import plot_trade

ACCURACIES = ("10%", "3%", "1%", "0.3%", "0.1%")
# The reference: a third of the finest default accuracy.  Finer accuracies need a finer reference: errors below half of
# its accuracy would be its own.
REFERENCE_ACCURACY, LEAST_FINER = "0.03%", 0.5
CHECK_COARSER = 3.0  # the run that shows how converged the reference is: asked for so many times its error
ROUGHEST_PART = 0.1  # of what `accuracy` takes
END_FORCES = COMPARED[1:]
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
    ComputationError when the reference fails.
    KeyboardInterrupt leaves a table of the finished runs.
    """
    target, progress = _renamed(former, target, progress)
    tables = one_line(as_scene(scene))
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
    with interrupts() as stopped:
        store = RunStore(Path(folder), progress, 2 + len(specs), stopped)
        best, reference_values = store.get(run_spec(tables, rod, goal), required=True)
        rows = [replace(best, status=REFERENCE)]
        limits: list[tuple[float | None, float | None]] = [(None, None)]
        largest = _largest_end_force(reference_values)
        try:
            check, _ = _compared(store, run_spec(tables, rod, _coarser(goal)), reference_values, tables.length)
            rows.append(replace(check, status=CHECK) if check.status != FAILED else check)
            limits.append((None, None))
            for spec, want in zip(specs, [x for x in checks for _ in kinds], strict=True):
                rows.append(_compared(store, spec, reference_values, tables.length)[0])
                limits.append(_bounds(want, largest))
        finally:
            position, end_force = _bounds(wanted, largest)
            table = TradeTable(
                tables.title, target, tables.length, largest, position, end_force, tuple(rows), tuple(notes),
                (*store.facts, *_measured(store, repeat, command)), store.total - len(rows),
            )  # fmt: skip
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


def _refusal(scene: LineScene, kind: str, accuracy: str) -> str:
    return run_spec(scene, kind, accuracy).refused


def _models(scene: LineScene, wanted: Sequence[str] | None) -> dict[str, str]:
    """Kinds of models, and why the scene does not admit them, "" if it does."""
    known = model_kinds()
    for name in wanted or ():
        if name not in known:
            raise SceneError([Complaint("models", name, f"some of: {', '.join(known)}", f"--models {known[0]}")])
    return {kind: _refusal(scene, kind, ACCURACIES[0]) for kind in wanted or known}


def _notes(scene: LineScene, models: Mapping[str, str], chosen: bool) -> list[str]:
    """Keys of the scene that the study ignores, and models that the scene does not admit."""
    time = scene.require_time()
    dropped = [f"time.{x}" for x in ("step", "tolerance") if getattr(time, x) is not None]
    dropped += ["time.rho_inf"] if time.rho_inf > LEAST_DAMPED else []
    dropped += [name for name in ("mesh", "accuracy") if getattr(scene, name) is not None]
    dropped += [f"output.{x}" for x in ("errors", "criteria") if x in scene.output.model_fields_set]
    given = scene.model.model_dump(exclude_none=True)
    dropped += [f"model.{x}" for x in FINENESS[1:] if x in given]
    notes = [f"The study chooses mesh, steps and tolerance: it ignores these keys of the scene: {', '.join(dropped)}."]
    kept = [x for x in sorted(scene.model.model_fields_set) if x not in FINENESS]
    if kept:
        notes.append(f"Of the scene's model it uses {', '.join(kept)}, for runs of that kind ({scene.model.kind}).")
    if chosen:
        notes += [f"Not admitted by the scene: {kind} ({why})." for kind, why in models.items() if why]
    return notes if dropped else notes[1:]


def _asked(scene: LineScene, accuracy: str, where: str) -> RequestedAccuracy:
    """An accuracy in numbers; SceneError if it is none."""
    try:
        found = requested_accuracy(one_line(as_scene(scene_data(scene, scene.model.kind, accuracy))))
    except SceneError as error:
        bad = [c for c in error.complaints if c.where.startswith("accuracy")] or error.complaints
        raise SceneError([replace(c, where=where, line=None, column=None) for c in bad[:1]]) from None
    assert found is not None
    return found


def _finer(scene: LineScene, accuracies: Sequence[str]) -> str:
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


def _compared(
    store: RunStore, spec: RunSpec, reference: Mapping[str, np.ndarray], length: float
) -> tuple[Row, dict[str, np.ndarray]]:
    row, values = store.get(spec)
    return (with_errors(row, values, reference, length) if values else row), values


def with_errors(row: Row, values: Mapping[str, np.ndarray], reference: Mapping[str, np.ndarray], length: float) -> Row:
    """The row with its errors: outputs (nt, ...) of the run and of the reference, at the same times and places."""
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


def _largest_end_force(reference: Mapping[str, np.ndarray]) -> float | None:
    """N; None: no end is held."""
    return (
        max(
            (float(np.linalg.norm(reference[x], axis=-1).max()) for x in END_FORCES if x in reference),
            default=None,
        )
        or None
    )


def _measured(store: RunStore, repeat: int, command: str) -> list[tuple[str, str]]:
    """How costs were measured, for the heading."""
    count = "one run each" if repeat == 1 else f"median of {repeat} runs"
    made = "all computed now" if store.computed == store.done else f"{store.computed} of {store.done} computed now"
    rows = [("command", f"`{command}`")] if command else []
    return [*rows, ("CPU time", f"of the process, kernels loaded beforehand; {count}; {made}")]
