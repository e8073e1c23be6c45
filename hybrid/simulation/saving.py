"""Several lines in motion kept in memory, to come back to: for steps that are computed several times over."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from time import monotonic
from typing import Any, NamedTuple

import numpy as np

from hybrid.kernels.state.state import Floats
from hybrid.model.ends import DrivenEnd
from hybrid.model.network import NetworkModel
from hybrid.simulation.network_run import NetworkRun
from hybrid.simulation.run_checkpoint import checkpoint, set_state
from hybrid.simulation.stepped import Course
from hybrid.solve.joined import NetworkState
from hybrid.store.recorder import Mark, Rows
from hybrid.store.writer import Recorder

# Outputs and events, of which no more may be taken back: they are in memory.
MOST_WAITING = 1000


class Saved(NamedTuple):
    """What `Simulation.save` returns."""

    owner: object  # what tells one simulation from another
    number: int  # of the state that was final then
    run: Mapping[str, Any]  # arrays and plain values, as of a checkpoint
    model: NetworkModel  # with what had broken by then
    waiting: tuple[Any, ...]  # rows of each line that are not recorded yet
    marks: tuple[Mark, ...]  # of the recorders
    stops: tuple[float, ...]  # s, that are still to come
    before: NetworkState  # the state before the last step
    stood: tuple[tuple[Floats, Floats], ...]  # positions (2, 3) m and frames (2, 9) of the ends of each line
    loads: tuple[Any, ...]  # of these ends
    driven: Mapping[str, list[DrivenEnd]]  # what moves points that are set from outside, for each end there
    paths: Mapping[str, list[Floats]]  # on which they are
    next: Mapping[str, Course]  # where points are to be at the end of the next step
    obstacles: Any  # what is set of them
    wound: Mapping[int, tuple[float | None, float]]  # length (m) and rate (m/s) that lines are to have then


def recorders(run: NetworkRun) -> list[Rows]:
    """Those of the system and of its lines."""
    found = dict.fromkeys((run.recorder, *(line.recorder for line in run.lines)))  # that of a cable is the only one
    return [x for x in found if isinstance(x, Rows)]


def marks_of(run: NetworkRun) -> tuple[Mark, ...]:
    """Where all recorders stand."""
    return tuple(x.mark() for x in recorders(run))


def is_full(run: NetworkRun, marks: Sequence[Mark]) -> bool:
    """Whether too much came after these marks."""
    return any(x.since(mark) > MOST_WAITING for x, mark in zip(recorders(run), marks, strict=True))


def commit(run: NetworkRun) -> None:
    """What has been recorded until now is final; it is written where that is due.

    LineFailed where an output says that going on would make no sense.
    """
    assert isinstance(run.recorder, Recorder)
    due, begin = run.recorder.due, monotonic()
    run.record_samples()
    run.write_log()
    if due:
        for line in run.lines:
            line.write_down()
            line.write_envelope(run.t)
        run.recorder.replace(run.file.quantities.range_values())
    run.gather_events()
    if due:
        run.recorder.flush(monotonic() - begin)


def kept(run: NetworkRun) -> dict[str, Any]:
    """What a run depends on, in copies: fields of `Saved`."""
    run.record_samples()
    run.write_log()
    run.ends_of_now()
    run.gather_events()
    return {
        "run": copied(checkpoint(run)), "model": run.model, "waiting": tuple(line.waiting() for line in run.lines),
        "marks": marks_of(run), "before": run.other.copy(),
        "stood": tuple((x.ends.values.position.copy(), x.ends.values.frame.copy()) for x in run.model.models),
        "loads": tuple(model.ends.keep_loads() for model in run.model.models),
    }  # fmt: skip


def bring_back(run: NetworkRun, saved: Saved) -> None:
    """Be as when `kept` was called; ends that are set from outside must be on their paths of then."""
    run.gather_events()
    for recorder, mark in zip(recorders(run), saved.marks, strict=True):
        recorder.back_to(mark)
    # Something has broken since, or contact has begun, or zones or lengths have changed, or what changes is under way.
    moving = {k for part in run.parts for k in part.changed}
    if run.model is not saved.model or moving:
        run.model = saved.model
        for k, (line, model, rows) in enumerate(zip(run.lines, saved.model.models, saved.waiting, strict=True)):
            line.wait_again(rows._replace(outputs=(), ratios=(), aside=(), log=()))
            if k not in moving:
                line.follow(model)
        for part in reversed(run.parts):
            part.restore_cells(saved.run)
        if moving:
            run.renew_other()
        run.make_solver()
    for model, loads in zip(run.model.models, saved.loads, strict=True):
        model.ends.bring_back_loads(loads, saved.run["t"])
    set_state(run, saved.run)
    for old, then in zip(run.other.lines, saved.before.lines, strict=True):
        for x, value in zip(old, then, strict=True):
            x[:] = value
    for line, rows in zip(run.lines, saved.waiting, strict=True):
        line.wait_again(rows)
        line.model.sea.at(run.t)
    run.model.load_bodies(run.t, run.solver.bodies, run.loaded)


def copied(x: Any) -> Any:
    """Named arrays and plain values, as they are once they have been in a file."""
    if isinstance(x, np.ndarray):
        return x.copy()
    if isinstance(x, dict):
        return {name: copied(value) for name, value in x.items()}
    if isinstance(x, list | tuple):
        return [copied(value) for value in x]
    return x.item() if isinstance(x, np.generic) else x
