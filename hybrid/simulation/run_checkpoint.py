"""The checkpoint of several lines in motion: what the next steps depend on, and how they go on from it."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from hybrid.adapt.zone_rules import UserCriterion
from hybrid.kernels.junctions.bodies import SPRING
from hybrid.kernels.state.books import WORKS
from hybrid.kernels.state.report import REPORT_SIZE
from hybrid.kernels.state.state import OPTIONAL_STATE
from hybrid.scene.root import Scene
from hybrid.simulation.lines_contact_start import touch_each_other
from hybrid.simulation.lone_planes import LonePlanes
from hybrid.simulation.old_checkpoints import FIRST_REPORT, FIRST_WORKS, as_of_line, is_of_cable, zoning_of_today
from hybrid.simulation.restore import program, refused, resolution_tree
from hybrid.simulation.run_contact import evaluate_forces, let_touch
from hybrid.simulation.run_failures import Failures
from hybrid.simulation.run_of_lines import RunOfLines
from hybrid.simulation.run_points import Rotations
from hybrid.simulation.run_quantities import RunQuantities
from hybrid.simulation.run_zones import RunZones
from hybrid.simulation.vibration_steps import VibrationsOfLines
from hybrid.solve.run import no_extremes
from hybrid.store.checkpoint import digest_of, read_checkpoint
from hybrid.store.hdf5_file import opened
from hybrid.store.named_arrays import matched

if TYPE_CHECKING:  # what a run without winches does not load
    from hybrid.simulation.run_payout import RunPayout


REFERENCES = "first_places", "first_turns"  # of outputs of a line


class KeptRun(RunOfLines, Protocol):
    """A run with all that its checkpoint keeps."""

    failures: Failures
    quantities: RunQuantities
    rotations: Rotations
    vibrations: VibrationsOfLines
    criterion: UserCriterion | None
    leg: tuple[float, int]
    cpu: float  # s
    changed: int
    dry: set[str]
    overlaps: set[str]
    under: dict[str, float]

    @property
    def zones(self) -> RunZones | None: ...
    @property
    def planes(self) -> LonePlanes | None: ...

    @property
    def payout(self) -> RunPayout | None: ...

    @property
    def interval(self) -> float: ...

    def stand_at(self, t: float, steps: int, last_step: float, last_rho: float, interval: float) -> None: ...


def checkpoint(run: KeptRun) -> dict[str, Any]:
    """What the next steps depend on, between two steps, with no output waiting: named arrays and plain values."""
    lines = {
        line.name: line.checkpoint(work, run.t) | {"state": state._asdict(), "rho": float(line.books.clock.last_rho)}
        for line, work, state in zip(run.lines, run.solver.work, run.state.lines, strict=True)
    }
    body_work = run.solver.body_work[:, :SPRING]
    return {
        "t": run.t, "steps": run.steps, "last": run.last_step, "rho": run.last_rho, "loaded": run.loaded,
        "interval": run.interval, "worked": run.loop.worked[1, :, :SPRING],
        "leg": [*run.leg], "cpu": run.cpu, "dry": sorted(run.dry), "under": dict(run.under),
        "overlaps": sorted(run.overlaps),
        "bodies": run.state.bodies, "body_work": body_work,
        "lines": lines, "broken": [*run.failures.broken], "rest": run.rest,
        "control": run.loop.control(), "cuts": run.loop.cuts(), "vibrations": run.vibrations.checkpoint(),
        "changes": run.changed,
        "quantities": run.quantities.checkpoint(), "rotations": run.rotations.last.copy(),
        "zones": run.zones.checkpoint() if run.zones is not None else {},
        "planes": run.planes.checkpoint() if run.planes is not None else {},
        "passed": sorted(list(x) for x in run.passed), "met": sorted(list(x) for x in run.met),
        "let_pass": sorted(list(x) for x in run.let_pass), "between": _begun(run),
        **({} if run.payout is None else {"payout": run.payout.checkpoint()}),
        **({} if run.shared is None else {"contact": run.shared.checkpoint(run.t)}),
    }  # fmt: skip


def restore(run: KeptRun, saved: Mapping[str, Any]) -> None:
    """Go on as `checkpoint` has written, with a run that was made for it.  ValueError: that cannot be."""
    if is_of_cable(saved):
        saved = as_of_line(saved, run.lines[0].name, run.model.models[0], run.failures.all)
    if "broken" in saved:  # not in files of an earlier program
        if not isinstance(saved["broken"], list):
            raise ValueError("broken: numbers of what has broken were expected")
        run.failures.again(saved["broken"])
    # It took members as at the first guess, and rotations were within half a turn of 0.
    older: dict[str, Any] = {"broken": [], "rest": run.rest, "control": [], "zones": {}, "planes": {}, "changes": 0}
    older |= {"cuts": run.loop.cuts(), "vibrations": {}, "rotations": run.rotations.last}
    older |= {key: [] for key in ("passed", "met", "let_pass", "between")}
    older |= {"rho": run.system.require_time().rho_inf, "interval": 0.0, "worked": run.loop.worked[1, :, :SPRING]}
    older |= {"bodies": run.state.bodies, "body_work": run.solver.body_work[:, :SPRING]}  # nor has a cable
    given, saved = saved, older | dict(saved)
    saved["zones"] = zones_of_today(saved["zones"])
    near = [x.number for x in run.lines if "self_contact" in _of(saved, x.name) and not x.touches]
    let_touch(run, near)
    between = _pairs(saved["between"])
    if between:
        touch_each_other(run, between)
    if run.zones is not None:
        run.zones.take_rods(saved["zones"])
    if run.payout is not None:
        run.payout.restore(saved["payout"])
    if run.zones is not None or run.payout is not None or near or between:
        run.make_solver()
    unbounded = "dry", "overlaps", "under", "broken", "control", "vibrations", "planes"
    template = checkpoint(run) | dict.fromkeys(unbounded)
    as_there_are = "contact", "between", "let_pass", "met", "passed", "payout"
    template |= dict.fromkeys(name for name in as_there_are if name in template)
    saved = {"quantities": run.quantities.unknown(), "under": {}, "overlaps": [], **saved}  # nor did it keep ranges
    saved["quantities"] = run.quantities.of_today(saved["quantities"])
    saved["lines"] = of_today(saved.get("lines"), template["lines"], saved["rho"])
    for line in template["lines"].values():
        line["envelope"] = None  # of other meshes as well, and of files of 0.6
        line |= {x: np.full_like(line[x], np.nan) for x in REFERENCES if x in line}
        line["report"] = np.full_like(line["report"], np.inf)  # it may have numbers that are not finite
        line["before"]["report"] = line["report"]
        if "self_contact" in line:
            line["self_contact"] = None  # as many places of friction as there are
    found = matched(dict(saved), template)
    _check_names(run, found)
    run.start_from(found["rest"])
    if run.planes is not None:
        run.planes.restore_planes(found["planes"])
    run.make_solver()
    set_state(run, found)
    if any("report" not in _of(given, line.name) for line in run.lines):  # nor in one of 0.6, of a cable
        evaluate_forces(run, "where the checkpoint is")
        for line in run.lines:  # whose envelope is of the steps to come
            line.books.extremes[:] = no_extremes(line.books.extremes.shape[2])
    for line in run.lines:
        if "imposed" not in _of(given, line.name).get("before", ()):  # not in files of an earlier program
            line.impose_now()


def _check_names(run: KeptRun, found: Mapping[str, Any]) -> None:
    """ValueError: what has been told of names that the run does not have, or equal steps that cannot be."""
    if not (isinstance(found["dry"], list) and set(found["dry"]) <= set(run.system.bodies)):
        raise ValueError("dry: names of bodies were expected")
    if not (isinstance(found["overlaps"], list) and all(isinstance(x, str) for x in found["overlaps"])):
        raise ValueError("overlaps: what is in each other was expected")
    if not (isinstance(found["under"], dict) and set(found["under"]) <= set(run.system.points)):
        raise ValueError("under: names of points were expected")
    if not (0.0 <= found["leg"][0] <= found["t"] and found["leg"][1] >= 0 and found["steps"] >= 0):
        raise ValueError(f"leg: a time up to {found['t']:g} s was expected")


def _begun(run: KeptRun) -> list[list[int]]:
    """Lines that touch each other because they have come near, two each."""
    touching = run.model.touching if run.system.contact is None else None
    return [list(x) for x in touching.pairs] if touching is not None else []


def _pairs(saved: Any) -> set[tuple[int, int]]:
    """Numbers of lines, two each.  ValueError: that cannot be."""
    if not (isinstance(saved, list) and all(isinstance(x, list) and len(x) == 2 for x in saved)):
        raise ValueError("passed, met, between: pairs of numbers of lines were expected")
    return {(int(a), int(b)) for a, b in saved}


def _of(saved: Mapping[str, Any], name: str) -> Mapping[str, Any]:
    """What is saved of a line, whatever it is worth."""
    lines = saved.get("lines")
    line = lines.get(name) if isinstance(lines, Mapping) else None
    return line if isinstance(line, Mapping) else {}


def of_today(lines: Any, template: Mapping[str, Any], rho: float) -> Any:
    """Lines of a checkpoint with what earlier programs did not have: mean tensions, the end of a report, answers to

    torques, what diagnostics remember, and a spectral radius of their own; rho: that of all lines.
    """
    if not (isinstance(lines, dict) and all(isinstance(x, dict) for x in lines.values())):
        return lines
    found = {}
    for name, line in lines.items():
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
        if mine is not None and "correction" in mine and isinstance(line.get("correction", {}), dict):
            line = line | {"correction": mine["correction"] | line.get("correction", {})}
        if mine is not None:
            before = line.get("before", {})
            older = {"rho": rho, "report": mine["report"]} | {x: mine[x] for x in REFERENCES if x in mine}
            line = older | line | {"before": mine["before"] | before if isinstance(before, dict) else before}
        if mine is not None and isinstance(line.get("noted"), dict):
            line = line | {"noted": mine["noted"] | line["noted"]}
        found[name] = line
    return found


def zones_of_today(zones: Any) -> Any:
    """Zones of lines of a checkpoint with what earlier programs did not have."""
    if not (isinstance(zones, dict) and all(isinstance(x, dict) for x in zones.values())):
        return zones
    return {
        name: {"here": None} | x | {"switching": zoning_of_today(x["switching"])}
        if isinstance(x.get("switching"), dict) else x
        for name, x in zones.items()
    }  # fmt: skip


def set_state(run: KeptRun, found: Mapping[str, Any]) -> None:
    """Be as when `checkpoint` was called, of a run with the same things broken, without a look at its form."""
    run.stand_at(found["t"], found["steps"], found["last"], found["rho"], found["interval"])
    run.loaded = found["loaded"]
    run.leg, run.dry, run.cpu = (found["leg"][0], found["leg"][1]), set(found["dry"]), found["cpu"]
    run.overlaps = set(found["overlaps"])
    run.under = {name: float(depth) for name, depth in found["under"].items()}
    longest = max(max(x.step, x.later) for x in run.resolution.lines.values())
    run.loop.take_control(found["control"], longest)
    run.vibrations.restore(found["vibrations"], run.loop.clock)
    run.loop.restore_cuts(found["cuts"])
    run.passed, run.met, run.let_pass = (_pairs(found[name]) for name in ("passed", "met", "let_pass"))
    if len(run.lines) > 1:
        run.watch_lines()  # what has met since has not
    if run.shared is not None:
        run.shared.restore(found["contact"], run.t)
    run.state.bodies[:], run.solver.body_work[:, :SPRING] = found["bodies"], found["body_work"]
    run.loop.worked[0], run.loop.worked[1, :, :SPRING] = run.solver.body_work, found["worked"]
    run.quantities.restore(found["quantities"])
    run.rotations.last[:] = found["rotations"]
    for line, x, work, state in zip(run.lines, run.solver.lines, run.solver.work, run.state.lines, strict=True):
        mine = found["lines"][line.name]
        for name, values in mine["state"].items():
            getattr(state, name)[:] = values
        line.books.clock.last_rho = mine["rho"]
        line.restore(mine, work, run.t, x.joints)
    if run.planes is not None:
        run.planes.restore_pushes(found["planes"])
    if run.zones is not None:
        run.zones.restore(found["zones"])
    if run.payout is not None:
        run.payout.lengthen()


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


def files_of(scene: Scene) -> dict[str, str]:
    """Digests of the files that a scene reads, by path."""
    return {path: digest_of(Path(path)) for path in scene.named_files()}
