"""The checkpoint of several lines in motion: what the next steps depend on, and how they go on from it."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from hybrid.kernels.junctions.bodies import SPRING
from hybrid.kernels.state.books import WORKS
from hybrid.kernels.state.report import REPORT_SIZE
from hybrid.kernels.state.state import OPTIONAL_STATE
from hybrid.model.failure import weaknesses
from hybrid.scene.base import Table
from hybrid.simulation.restart import (
    FIRST_REPORT,
    FIRST_WORKS,
    as_of_line,
    is_of_cable,
    of_line,
    program,
    refused,
    resolution_tree,
)
from hybrid.simulation.run_of_lines import RunOfLines
from hybrid.solve.network_steps import no_extremes
from hybrid.store.checkpoint import digest_of, read_checkpoint
from hybrid.store.hdf5_file import opened
from hybrid.store.integrity import matched
from hybrid.zones.criteria import UserCriterion

REFERENCES = "first_places", "first_turns"  # of outputs of a line


# Kept of parts that a run does not have.
WITHOUT: Mapping[str, Any] = {"zones": {}, "planes": {}}


class KeptRun(RunOfLines, Protocol):
    """A run with all that its checkpoint keeps."""

    criterion: UserCriterion | None
    leg: tuple[float, int]
    cpu: float  # s

    @property
    def interval(self) -> float: ...

    def evaluate_forces(self, after: str) -> None: ...

    def stand_at(self, t: float, steps: int, last_step: float, last_rho: float, interval: float) -> None: ...


def checkpoint(run: KeptRun) -> dict[str, Any]:
    """What the next steps depend on, between two steps, with no output waiting: named arrays and plain values."""
    lines = {
        line.name: line.checkpoint(work, run.t) | {"state": state._asdict(), "rho": float(line.books.clock.last_rho)}
        for line, work, state in zip(run.lines, run.solver.work, run.state.lines, strict=True)
    }
    found: dict[str, Any] = {
        "t": run.t, "steps": run.steps, "last": run.last_step, "rho": run.last_rho, "loaded": run.loaded,
        "interval": run.interval, "worked": run.loop.worked[1, :, :SPRING],
        "leg": [*run.leg], "cpu": run.cpu, "bodies": run.state.bodies, "body_work": run.solver.body_work[:, :SPRING],
        "lines": lines, "rest": run.rest, "control": run.loop.control(), "cuts": run.loop.cuts(),
        **WITHOUT,
    }  # fmt: skip
    for part in run.parts:
        found |= part.checkpoint()
    return found


def restore(run: KeptRun, saved: Mapping[str, Any]) -> None:
    """Go on as `checkpoint` has written, with a run that was made for it.  ValueError: that cannot be."""
    if is_of_cable(saved):
        saved = as_of_line(saved, run.lines[0].name, run.model.models[0], weaknesses(run.network))
    given, saved = saved, _of_today(run, saved)
    joined = [part.restore_joints(saved) for part in reversed(run.parts)]
    if any([*(part.restore_cells(saved) for part in reversed(run.parts)), *joined]):
        run.make_solver()
    template = checkpoint(run) | {"control": None, "planes": None}
    for part in run.parts:
        template |= dict.fromkeys(() if part.is_of_form else part.checkpoint())
    saved["lines"] = lines_of_today(saved.get("lines"), template["lines"], saved["rho"])
    for line in template["lines"].values():
        line["envelope"] = None  # of other meshes as well, and of files of 0.6
        line |= {x: np.full_like(line[x], np.nan) for x in REFERENCES if x in line}
        line["report"] = np.full_like(line["report"], np.inf)  # it may have numbers that are not finite
        line["before"]["report"] = line["report"]
        if "self_contact" in line:
            line["self_contact"] = None  # as many places of friction as there are
    found = matched(saved, template)
    if not (0.0 <= found["leg"][0] <= found["t"] and found["leg"][1] >= 0 and found["steps"] >= 0):
        raise ValueError(f"leg: a time up to {found['t']:g} s was expected")
    run.start_from(found["rest"])
    run.make_solver()
    set_state(run, found)
    if any("report" not in of_line(given, line.name) for line in run.lines):  # nor in one of 0.6, of a cable
        run.evaluate_forces("where the checkpoint is")
        for line in run.lines:  # whose envelope is of the steps to come
            line.books.extremes[:] = no_extremes(line.books.extremes.shape[2])
    for line in run.lines:
        if "imposed" not in of_line(given, line.name).get("before", ()):  # not in files of an earlier program
            line.impose_now()


def _of_today(run: KeptRun, saved: Mapping[str, Any]) -> dict[str, Any]:
    """A checkpoint with what files of an earlier program, or of a cable, do not have.

    It took the added mass of members as at the first guess.
    """
    older: dict[str, Any] = {"rest": run.rest, "control": [], "cuts": run.loop.cuts(), "interval": 0.0}
    older |= {"rho": run.network.require_time().rho_inf, "worked": run.loop.worked[1, :, :SPRING]}
    older |= {"bodies": run.state.bodies, "body_work": run.solver.body_work[:, :SPRING], **WITHOUT}
    found = older | dict(saved)
    for part in run.parts:
        found |= part.of_today(saved)
    return found


def lines_of_today(lines: Any, template: Mapping[str, Any], rho: float) -> Any:
    """Lines of a checkpoint with what earlier programs did not have.

    Mean tensions, the end of a report, answers to torques, what diagnostics remember, and a spectral radius of their
    own; rho: that of all lines.
    """
    if not (isinstance(lines, dict) and all(isinstance(x, dict) for x in lines.values())):
        return lines
    found = {}
    for name, saved in lines.items():
        line = {key: x for key, x in saved.items() if key != "correction"}  # of what leaving bending out did, in 1.0
        mine, state, report = template.get(name), line.get("state"), line.get("report")
        if mine is not None and isinstance(state, dict):
            empty = {x: mine["state"][x] for x in OPTIONAL_STATE if x in mine["state"] and not mine["state"][x].size}
            line = line | {"state": {**empty, **state}}
        work = line.get("work")
        if isinstance(work, np.ndarray) and work.ndim == 1 and FIRST_WORKS <= work.size < WORKS:
            line = line | {"work": np.pad(work, (0, WORKS - work.size))}
        if isinstance(report, np.ndarray) and report.ndim == 1 and FIRST_REPORT <= report.size < REPORT_SIZE:
            line = line | {"report": np.pad(report, (0, REPORT_SIZE - report.size))}
        if mine is not None and "torsion" in mine:
            line = {"torsion": mine["torsion"]} | line
        if mine is not None:
            before = line.get("before", {})
            older = {"rho": rho, "report": mine["report"]} | {x: mine[x] for x in REFERENCES if x in mine}
            line = older | line | {"before": mine["before"] | before if isinstance(before, dict) else before}
        if mine is not None and isinstance(line.get("noted"), dict):
            line = line | {"noted": mine["noted"] | line["noted"]}
        found[name] = line
    return found


def set_state(run: KeptRun, found: Mapping[str, Any]) -> None:
    """Be as when `checkpoint` was called, of a run with the same things broken, without a look at its form."""
    run.stand_at(found["t"], found["steps"], found["last"], found["rho"], found["interval"])
    run.loaded, run.leg, run.cpu = found["loaded"], (found["leg"][0], found["leg"][1]), found["cpu"]
    longest = max(max(x.step, x.later) for x in run.resolution.lines.values())
    run.loop.restore_control(found["control"], longest)
    run.loop.restore_cuts(found["cuts"])
    run.state.bodies[:], run.solver.body_work[:, :SPRING] = found["bodies"], found["body_work"]
    run.loop.worked[0], run.loop.worked[1, :, :SPRING] = run.solver.body_work, found["worked"]
    for line, x, work, state in zip(run.lines, run.solver.lines, run.solver.work, run.state.lines, strict=True):
        mine = found["lines"][line.name]
        for name, values in mine["state"].items():
            getattr(state, name)[:] = values
        line.books.clock.last_rho = mine["rho"]
        line.restore(mine, work, run.t, x.joints)
    for part in run.parts:
        part.restore(found)


def content(run: KeptRun) -> dict[str, Any]:
    """What the writer keeps of a checkpoint."""
    resolution = {name: resolution_tree(x) for name, x in run.resolution.lines.items()}
    asks = run.criterion is not None
    return {"program": program(), "asks": asks, "resolution": resolution, "state": checkpoint(run)}


def kept_changes(source: Path, most: int) -> int:
    """How many changes of loads were made up to the checkpoint of a result; ResultError: more than `most`."""
    with opened(source) as file, refused(source):
        state = read_checkpoint(file).state
        made = int(state.get("changes", 0)) if isinstance(state, Mapping) else 0  # not in files of an earlier program
        if not 0 <= made <= most:
            raise ValueError(f"changes: up to {most} were expected")
        return made


def files_of(scene: Table) -> dict[str, str]:
    """Digests of the files that a scene reads, by path."""
    return {path: digest_of(Path(path)) for path in scene.named_files()}
