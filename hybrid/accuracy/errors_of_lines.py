"""How wrong a run of several lines is, by its mesh and its steps: two coarser runs to compare with, in memory.

One has half the cells of every line, the other steps twice as long.  The scheme is of second order in both, so that a
third of what each changes is the error by that cause; errors by all causes add with their signs.  Whether the order is
seen, two runs that are coarser again tell: where they change a quantity by less than four times as much, its error is
a larger part, up to all of it.
"""

from __future__ import annotations

import io
from collections.abc import Callable, Mapping
from itertools import pairwise
from pathlib import Path

import numpy as np

from hybrid.accuracy.error_report import CAUSES, UNITS
from hybrid.accuracy.extreme_errors import errors_by_cause, figures
from hybrid.accuracy.samples_of_lines import extremes_of, touch_unasked
from hybrid.errors import AS_MUCH, ComputationError, SceneError
from hybrid.kernels.state.state import Floats
from hybrid.model.lines_contact import passing_each_other
from hybrid.model.network import NetworkResolution, build_system
from hybrid.model.sections import section_changes
from hybrid.model.self_reach import system_without_contact
from hybrid.outputs.edge_errors import EDGE_ERRORS
from hybrid.scene.base import Invalid
from hybrid.scene.network_scene import System
from hybrid.store.amend import amend_lines
from hybrid.store.array_recorder import MemoryTarget
from hybrid.store.format import Field
from hybrid.store.limits import EXTREME_ERRORS
from hybrid.store.reader import Result, open_result, written_result
from hybrid.store.records import not_converged_attribute

# What is compared, and under which names errors of it are kept; of vectors the size.
COMPARED = {
    "position": "position", "tension": "tension", "curvature": "curvature", "bending_moment": "bending_moment",
    "reaction_start": "end_force_start", "reaction_end": "end_force_end",
}  # fmt: skip
# Of what a run with cells or steps of twice the size changes: the error of the finer one, of second order.
PART = 1.0 / 3.0
# By how many times less a change than of second order an error is called uncertain: the order is below one.
DOUBTFUL = 2.0
# Of a quantity: errors below this part of it are not worth a doubt.
NOTHING = 1e-4
FAILED = "no error figure"

Compute = Callable[[System, MemoryTarget], None]
# Why there is no coarser run to compare with, by its cause.
TOO_COARSE = {
    "mesh": "line {1} has too few cells for a run with half of them to compare with; mesh: at least 8 to a section",
    "time": "too few steps for a run with longer ones to compare with; time.step: at most a quarter of the duration",
}


def coarser(system: System, resolution: NetworkResolution | None = None) -> System:
    """The same with half the cells of every line; nodes at changes of section, at what is attached, and where zones
    meet stay.  resolution: how finely it was computed; None: as its meshes say.
    """
    model, lines = build_system(system, resolution), {}
    for name, x in zip(model.names, model.models, strict=True):
        s, zones = x.line.s, x.zones
        given = [*section_changes(system.scene_of(name)), *x.attached, *(z.s_b for z in zones)]
        fixed = np.unique([0, s.size - 1, *(int(np.abs(s - at).argmin()) for at in given)])
        kept = [k for a, b in pairwise(fixed) for k in range(a, b, 2) if b - k > 1 or k == a]
        lines[name] = {"nodes": s[[*kept, s.size - 1]].tolist()}
    data = system.model_dump(mode="json", exclude_none=True)
    for name, mesh in lines.items():
        data["lines"][name]["mesh"] = mesh
    return System.model_validate(data)


def longer_steps(system: System) -> System:
    """The same with steps twice as long and half the outputs, which end steps."""
    data = system.model_dump(mode="json", exclude_none=True)
    data["time"]["step"] = 2.0 * (system.require_time().step or 0.0)
    data.setdefault("output", {})["every"] = 2.0 * system.output_interval
    return System.model_validate(data)


def write_system_errors(
    system: System, target: Path | io.BytesIO, compute: Compute, resolution: NetworkResolution
) -> None:
    """Add errors to a complete result, of every line; compute: makes a run to compare with.

    resolution: of the result.  Where such a run fails, an event says so.
    """
    given = passing_each_other(system)  # as they do where errors are estimated
    given = given.model_copy(update={"output": system.output.model_copy(update={"errors": None})})
    with open_result(target) as result:
        if not touch_unasked(system, result):  # coarser cells would meet where those of the result do not
            given = system_without_contact(given)
    found, failed = dict[str, Result](), ""
    try:
        for cause, make in (("mesh", coarser), ("time", longer_steps)):
            other = given
            for again in ("", " again"):
                first = cause == "mesh" and not again
                try:
                    other, memory = coarser(other, resolution) if first else make(other), MemoryTarget()
                    compute(other, memory)
                except (ComputationError, Invalid, SceneError):
                    if not again:
                        raise
                    break
                found[cause + again] = written_result(memory)
    except ComputationError as error:
        failed = f"a coarser run to compare with stopped: {str(error).splitlines()[0]}"
    except Invalid as error:  # half of few cells, or twice a long step, is no scene
        failed = TOO_COARSE[cause].format(*error.errors()[0]["loc"])
    except SceneError as error:  # nor are few cells enough for a line that is paid out
        failed = TOO_COARSE["mesh"].format(*error.complaints[0].where.split("."))
    errors, doubts, extremes = {}, dict[str, list[str]](), dict[str, str]()
    if not failed:
        with open_result(target) as result:
            for name, line in result.lines.items():
                others = {cause: x.lines[name] for cause, x in found.items()}
                errors[name], doubts[name] = _errors_of(line, others)
                runs = {"": result} | found
                extremes[name] = _errors_of_extremes({x: extremes_of(system, run, name) for x, run in runs.items()})
    fields = {name: [_field(full, x) for full, x in each.items()] for name, each in errors.items()}
    sizes = {name: _summary(each) for name, each in errors.items()}
    largest = {key: max(x[key] for x in sizes.values()) for key in next(iter(sizes.values()), {})}
    attributes: dict[str, dict[str, str | float | int]] = {
        name: {**each, **not_converged_attribute([doubts[name]])} for name, each in sizes.items()
    }
    for name, found_extremes in extremes.items():
        attributes[name][EXTREME_ERRORS] = found_extremes
    of_all: dict[str, str | float | int] = {**largest, **not_converged_attribute(doubts.values())}
    notes = [(FAILED, failed)] if failed else []
    doubtful = [f"{x.replace('_', ' ')} of line {name}" for name, each in doubts.items() for x in each]
    if doubtful:
        text = f"{AS_MUCH}: the error may be larger than its figure"
        notes.append(("error uncertain", f"{', '.join(doubtful)}: {text}; a finer mesh or a shorter step tells"))
    amend_lines(target, fields, errors, attributes, of_all, notes)


def _errors_of(line: Result, others: Mapping[str, Result]) -> tuple[dict[str, Floats], list[str]]:
    """Errors of a line by cause and quantity, by the name of their field; and which are doubtful."""
    out: dict[str, Floats] = {}
    doubts: list[str] = []
    for name, called in COMPARED.items():
        if name not in line:
            continue
        values, changed, sizes = line[name], dict[str, Floats](), dict[str, float]()
        for cause in ("mesh", "time"):
            change = _change(line, others[cause], name)
            part, once = PART, float(np.abs(change).max())
            if f"{cause} again" in others:
                twice = float(np.abs(_change(others[cause], others[f"{cause} again"], name)).max())
                grown = max(twice / once, DOUBTFUL) if once > 0.0 else 4.0
                part = max(PART, 1.0 / (grown - 1.0))
                sizes[cause] = part * once if twice < DOUBTFUL * once else 0.0
            changed[cause] = part * change
        changed["total"] = sum(changed.values(), np.zeros(values.shape))
        worst = float(np.abs(changed["total"]).max())
        if max(sizes.values(), default=0.0) > 0.5 * worst and worst > NOTHING * float(np.abs(values).max()):
            doubts.append(called)
        vector = name == "position" or name.startswith("reaction")
        for cause, change in changed.items():
            out[f"errors/{cause}/{called}"] = np.linalg.norm(change, axis=-1) if vector else np.abs(change)
        if EDGE_ERRORS + name in line:
            for full in (f"errors/mesh/{called}", f"errors/total/{called}"):
                out[full] = np.maximum(out[full], line[EDGE_ERRORS + name])
    return out, doubts


def _errors_of_extremes(found: Mapping[str, Mapping[str, Floats]]) -> str:
    """Errors of what limits of a line are held against in runs by their cause, "" the result, as its attribute."""
    errors = errors_by_cause(found[""], [(found[x], found.get(f"{x} again")) for x in ("mesh", "time")])
    return figures(found[""], errors)


def _change(fine: Result, coarse: Result, name: str) -> Floats:
    """What a quantity of a finer run is more than that of a coarser one, at the outputs of the finer one."""
    times = fine.times
    at = np.array([int(np.abs(times - t).argmin()) for t in coarse.times])
    return _at_times(times, times[at], fine[name][at] - coarse[name])


def _at_times(t: Floats, known: Floats, values: Floats) -> Floats:
    """Values (n, ...) at known times (n,) s at all outputs (nt,), linear between."""
    flat = values.reshape(len(known), -1)
    out = np.stack([np.interp(t, known, flat[:, k]) for k in range(flat.shape[1])], axis=1)
    return out.reshape(len(t), *values.shape[1:])


def _field(full: str, values: Floats) -> Field:
    _, cause, name = full.split("/")
    text = f"{CAUSES[cause]} of {name.replace('_', ' ')}, estimated"
    return Field(full, UNITS[name], text, values.shape[1:], ("s",) if values.ndim == 2 else ())


def _summary(errors: Mapping[str, Floats]) -> dict[str, float]:
    """The largest errors of position (m) and of the end forces (N), by cause."""
    out = {}
    for cause in ("mesh", "time", "total"):
        out[f"error_{cause}_position"] = float(errors[f"errors/{cause}/position"].max())
        ends = (errors[f"errors/{cause}/end_force_{end}"] for end in ("start", "end"))
        out[f"error_{cause}_end_force"] = max(float(x.max()) for x in ends)
    return out
