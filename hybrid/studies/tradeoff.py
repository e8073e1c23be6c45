"""Error against cost: a ladder of models and accuracies on one scene, each run compared with a converged rod.

Every finished run is kept in the folder, so that a second call does only what is missing.
docs/trade.md
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from statistics import median

import numpy as np

import hybrid.studies.peers as others
from hybrid.errors import Complaint, SceneError
from hybrid.model.plan import output_times
from hybrid.model.resolution import RequestedAccuracy, requested_accuracy
from hybrid.scene.accuracy import amount
from hybrid.scene.analysis import LEAST_DAMPED
from hybrid.scene.read import SceneLike, as_scene, validate_scene
from hybrid.scene.schema import Scene
from hybrid.store.tradeoff_table import CHECK, DONE, FAILED, OURS, REFERENCE, Row, TradeTable, judged
from hybrid.studies.runs import COMPARED, FINENESS, Desk, Doing, Rung, key_of, kinds_of_models, rung_data, rung_of
from hybrid.view.tradeoff import plot_trade

ACCURACIES = ("10%", "3%", "1%", "0.3%", "0.1%")
# The reference: a third of the finest accuracy on the usual ladder.  A finer ladder needs a finer reference: errors
# below half of what it is asked for would be its own.
REFERENCE_ACCURACY, LEAST_FINER = "0.03%", 0.5
CHECK_COARSER = 3.0  # the run that shows how converged the reference is: asked for so many times its error
ROUGHEST_PART = 0.1  # of what `accuracy` takes
PULLS = COMPARED[1:]


def trade(
    scene: SceneLike,
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
    scene = as_scene(scene)
    scene.require_time()
    names = _models(scene, models)
    goal = reference or _finer(scene, accuracies)
    checks = [_asked(scene, x, "accuracies") for x in accuracies]
    wanted = _asked(scene, asked_for, "for")
    _must_be_finer(_asked(scene, goal, "reference"), goal, checks)
    if repeat < 1:
        raise SceneError([Complaint("repeat", str(repeat), "1 or more runs, of which the median counts", "--repeat 3")])
    notes = _notes(scene, names, models is None)
    kinds = [kind for kind, reason in names.items() if not reason or models is not None]
    rod = "rod" if _refusal(scene, "rod", goal) == "" else kinds[0]
    ladder = [replace(rung_of(scene, kind, x), times=repeat) for x in accuracies for kind in kinds]
    guests = others.ladder(scene) if peers else []
    desk = Desk(Path(folder), told, 2 + len(ladder) + len(guests))

    best, truth = desk.kept(rung_of(scene, rod, goal), must=True)
    check, _ = _compared(desk, rung_of(scene, rod, _coarser(goal)), truth, scene.length)
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
        table = TradeTable(
            scene.title, asked_for, scene.length, largest, position, pull, tuple(rows), tuple(notes),
            (*desk.facts, *_measured(desk, repeat, command, guests)), desk.total - len(rows),
        )  # fmt: skip
        table = judged(table, limits)
        table = replace(table, rows=tuple(sorted(table.rows, key=lambda row: _order(row, kinds))))
        table.write(desk.folder, "trade.png")
        plot_trade(table, desk.folder / "trade.png", overwrite=True)  # the folder is of this program
    return table


def _order(row: Row, kinds: Sequence[str]) -> int:
    """Reference and check first, then model by model, then other programs."""
    if row.status in (REFERENCE, CHECK):
        return -1
    return kinds.index(row.model) if row.code == OURS and row.model in kinds else len(kinds)


# --- what is asked ------------------------------------------------------------------------------


def _refusal(scene: Scene, kind: str, accuracy: str) -> str:
    return rung_of(scene, kind, accuracy).refused


def _models(scene: Scene, wanted: Sequence[str] | None) -> dict[str, str]:
    """Kinds of models, and why the scene does not admit them, "" if it does."""
    known = kinds_of_models()
    for name in wanted or ():
        if name not in known:
            raise SceneError([Complaint("models", name, f"some of: {', '.join(known)}", f"--models {known[0]}")])
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


def _asked(scene: Scene, accuracy: str, where: str) -> RequestedAccuracy:
    """An accuracy in numbers; SceneError if it is none."""
    try:
        found = requested_accuracy(validate_scene(rung_data(scene, scene.model.kind, accuracy)))
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


def _must_be_finer(goal: RequestedAccuracy, text: str, ladder: Sequence[RequestedAccuracy]) -> None:
    for name in ("position", "tension", "of_end_force"):
        finest = min((x for x in (getattr(each, name) for each in ladder) if x is not None), default=None)
        mine = getattr(goal, name)
        if finest is not None and mine is not None and mine > LEAST_FINER * finest:
            fix = "a finer reference, or coarser accuracies"
            raise SceneError([Complaint("reference", text, "at most half of the finest accuracy of the ladder", fix)])


def _bounds(want: RequestedAccuracy, largest: float | None) -> tuple[float | None, float | None]:
    """What is asked for in m and N; the tighter one of two for the pull."""
    pulls = [want.tension] if want.tension is not None else []
    pulls += [want.of_end_force * largest] if want.of_end_force is not None and largest else []
    return want.position, min(pulls, default=None)


# --- errors -------------------------------------------------------------------------------------


def _compared(
    desk: Desk, rung: Rung, truth: Mapping[str, np.ndarray], length: float
) -> tuple[Row, dict[str, np.ndarray]]:
    row, values = desk.kept(rung)
    return (against(row, values, truth, length) if values else row), values


def against(row: Row, values: Mapping[str, np.ndarray], truth: Mapping[str, np.ndarray], length: float) -> Row:
    """The row with its errors: outputs (nt, ...) of the run and of the reference, at the same times and places."""
    position = float(np.linalg.norm(values["position"] - truth["position"], axis=-1).max())
    pulls = [float(_apart(values[x], truth[x]).max()) for x in PULLS if x in values and x in truth]
    row = replace(row, position=position, position_part=position / length)
    largest = _largest_pull(truth)
    if pulls and largest:
        row = replace(row, pull=max(pulls), pull_part=max(pulls) / largest)
    if max(row.position_part or 0.0, row.pull_part or 0.0) > 1.0:
        return replace(row, status=FAILED, cause="it blew up: it is wrong by more than there is")
    return row


def _apart(force: np.ndarray, truth: np.ndarray) -> np.ndarray:
    """Difference (nt,) of two forces (nt, 3), N; of their sizes, where only that is known (nt, 1)."""
    if force.shape[-1] == 1:
        return np.asarray(np.abs(np.abs(force[:, 0]) - np.linalg.norm(truth, axis=-1)))
    return np.asarray(np.linalg.norm(force - truth, axis=-1))


def _largest_pull(truth: Mapping[str, np.ndarray]) -> float | None:
    """N; None: no end is held."""
    return max((float(np.linalg.norm(truth[x], axis=-1).max()) for x in PULLS if x in truth), default=None) or None


# --- other programs -----------------------------------------------------------------------------


def _of_guest(desk: Desk, guest: others.Guest, repeat: int, scene: Scene, truth: Mapping[str, np.ndarray]) -> Row:
    """The row of another program, kept as ours are."""
    row = Row(
        guest.code,
        guest.model,
        guest.told,
        FAILED,
        guest.cannot,
        key=key_of(scene, repeat, others.driver(guest)) + guest.tag,
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


def _measured(desk: Desk, repeat: int, command: str, guests: Sequence[others.Guest]) -> list[tuple[str, str]]:
    """How costs were measured, for the heading."""
    count = "one run each" if repeat == 1 else f"median of {repeat} runs"
    made = "all made by this call" if desk.made == desk.done else f"{desk.made} of {desk.done} made by this call"
    said = [("other programs", found)] if (found := others.versions(guests)) else []
    said += [("command", f"`{command}`")] if command else []
    return [*said, ("CPU time", f"of the process, kernels loaded beforehand; {count}; {made}")]
