"""Writes into a result how wrong it may be, how finely it was computed, and what that took."""

from __future__ import annotations

import io
import json
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from hybrid.accuracy.error_control import ErrorController
from hybrid.accuracy.error_order import Errors, summary
from hybrid.accuracy.extreme_errors import figures as extreme_figures
from hybrid.accuracy.line_errors import LineErrors
from hybrid.accuracy.refinement import END_FORCE, asked_quantities, asked_text, figures, not_asked_text, sizes_of
from hybrid.errors import ZONE_EVENTS
from hybrid.model.plan import output_times
from hybrid.scene.schema import AdaptiveModel, LineScene
from hybrid.simulation.case import Case
from hybrid.simulation.result_checks import damped_jolts, undersampled_end_forces
from hybrid.simulation.run_sample import END_FORCES, RunSample, at_all_points, is_along
from hybrid.store.amend import NOTHING_MORE, Block, Happened, Part, amend
from hybrid.store.copying import GROUP
from hybrid.store.format import Field
from hybrid.store.limits import EXTREME_ERRORS
from hybrid.store.named_arrays import Tree
from hybrid.store.records import not_converged_attribute
from hybrid.store.whole_file import LateFile

if TYPE_CHECKING:
    from hybrid.accuracy.free_vibrations import LostBy

UNITS = {
    "position": "m", "tension": "N", "curvature": "1/m", "bending_moment": "N m",
    "right_tension": "N", "right_curvature": "1/m", "right_bending_moment": "N m",
    "end_force_start": "N", "end_force_end": "N",
}  # fmt: skip
CAUSES = {
    "mesh": "error by the mesh", "time": "error by the time step", "model": "error by neglected bending",
    "total": "error by all causes",
}  # fmt: skip


Attributes = Mapping[str, str | float | int]


def write_errors(
    target: Path | io.BytesIO | LateFile, case: Case, control: ErrorController, cpu: float,
    before: Tree | None = NOTHING_MORE,
) -> None:  # fmt: skip
    """Add errors, attributes and events of all lines to the complete result of a case.

    cpu: s, of all passes; before: as of `amend`.
    """

    @cache
    def lost() -> Mapping[str, LostBy]:
        from hybrid.accuracy.free_vibrations import lost_by_lines

        return lost_by_lines(case.scene, control.standing)

    found = {
        name: _of_line(case, control, name, cpu, lambda name=name: lost().get(name, {}))  # type: ignore[misc]
        for name in control.standing
    }

    def of_all(_: Happened) -> tuple[Attributes, list[tuple[str, str]]]:
        known = [x.attributes for x in found.values()]
        keys = {x for each in known for x in each if x.startswith("error_")}
        largest: dict[str, str | float | int] = {x: max(float(each[x]) for each in known if x in each) for x in keys}
        largest |= {"effort_runs": len(control.runs), "effort_cpu": cpu}
        largest |= not_converged_attribute(control.lines[name].diverging for name in found)
        events = [(kind, f"line {name}: {text}") for name, x in found.items() for kind, text in x.events]
        return largest, [*control.notes, *events]

    parts = list[Part]()
    for name, x in found.items():
        called = case.names[name]  # a line without a name is the result itself
        parts.append(x.part(f"{GROUP}/{called}", ()) if called else x.part("", control.notes))
    amend(target, parts if "" in case.names.values() else [*parts, Part("", (), (), of_all)], before)


@dataclass
class Report:
    """What is added to the result of a line; attributes and events: once its errors are written."""

    fields: list[Field]
    blocks: Iterable[Block]
    others: Callable[[Happened], tuple[dict[str, str | float | int], list[tuple[str, str]]]]
    attributes: Attributes = field(default_factory=dict)
    events: Sequence[tuple[str, str]] = ()

    def part(self, group: str, notes: Sequence[tuple[str, str]]) -> Part:
        """As part of a result; notes: events beside those of the line."""

        def others(happened: Happened) -> tuple[Attributes, list[tuple[str, str]]]:
            self.attributes, self.events = self.others(happened)
            return self.attributes, [*self.events, *notes]

        return Part(group, self.fields, self.blocks, others)


def _of_line(case: Case, control: ErrorController, name: str, cpu: float, vibrations: Callable[[], LostBy]) -> Report:
    """What is added to the result of a line; cpu: s, of all passes; vibrations: as of `known`."""
    line, result, scene = control.lines[name], control.standing[name], case.lines[name]
    errors = line.estimate.errors if line.estimate is not None else None
    attributes = effort(scene, line, result, cpu)
    fields = error_fields(result, errors) if errors is not None else []
    names = {x.name for x in fields}

    def blocks() -> Iterator[Block]:
        for cause, quantity, begin, values in errors.blocks() if errors is not None else ():
            full = f"errors/{cause}/{quantity}"
            if full in names:
                along = result.places.size and is_along(quantity)
                yield full, begin, at_all_points(values, result.places) if along else values

    def others(happened: Happened) -> tuple[dict[str, str | float | int], list[tuple[str, str]]]:
        found, notes = known(scene, line, result, errors, happened, vibrations)
        if line.asked is not None:
            found["accuracy_verdicts"] = accuracy_figures(line, result, errors)
        return attributes | found, notes

    return Report(fields, blocks(), others)


def accuracy_figures(control: LineErrors, result: RunSample, errors: Errors | None) -> str:
    """What is asked of each quantity and its error, as the attribute of a result; errors: None: they are not known."""
    assert control.asked is not None
    of = [x.errors for x in control.statistics.values()] if control.irregular else [errors]
    known = [x for x in of if x is not None]
    return json.dumps(figures(control.asked, known, result, control.scattered, control.extremes))


def effort(scene: LineScene, control: LineErrors, result: RunSample, cpu: float) -> dict[str, str | float | int]:
    """What was spent on a result, and what was asked, as its attributes; cpu: s, of all passes."""
    resolution = result.resolution
    attributes: dict[str, str | float | int] = {
        "effort_fineness": resolution.fineness, "effort_runs": len(control.runs),
        "effort_cpu": cpu, "effort_step": resolution.step,
    }  # fmt: skip
    if resolution.local is not None:
        attributes["effort_step_error"] = resolution.local
    if isinstance(scene.model, AdaptiveModel):
        attributes["effort_zones"] = resolution.zones
    if control.asked is not None:
        attributes["accuracy_asked"] = asked_text(control.asked, result)
        attributes["accuracy_quantities"] = asked_quantities(control.asked, result)
    return attributes


def known(
    scene: LineScene, control: LineErrors, result: RunSample, errors: Errors | None, happened: Happened,
    vibrations: Callable[[], LostBy],
) -> tuple[dict[str, float | str], list[tuple[str, str]]]:  # fmt: skip
    """The largest errors, as attributes, and events of a result; happened: its events until now; vibrations: finds what

    steps lose of free ones, by quantity.
    """
    undersampled: list[tuple[str, str]] = []
    if errors is not None and control.moves:
        largest = {name: errors.largest("total", name) for name in errors.fields.get("total", {})}
        changes = [t for t, kind in happened if kind in ZONE_EVENTS]
        undersampled = undersampled_end_forces(np.array([0.0, *output_times(scene)]), result, largest, changes)
        if control.asked is None or control.asked.asks(END_FORCE):
            error = max(largest.get(name, 0.0) for name in END_FORCES.values())
            undersampled += damped_jolts(scene, result, error, control.allowed_force)
        if not control.irregular:
            from hybrid.accuracy.free_vibrations import uncertain_by_vibrations

            bounds = None if control.asked is None else sizes_of(control.asked, result)
            undersampled += uncertain_by_vibrations(vibrations(), result, largest, bounds)
    found: dict[str, float | str] = {**summary(errors)} if errors is not None else {}
    if control.extremes is not None:
        found[EXTREME_ERRORS] = extreme_figures(control.extremes.run.extremes, control.extremes.errors)
    found |= not_converged_attribute([control.diverging])
    if errors is not None and control.asked is not None:
        beside = not_asked_text(control.asked, errors, result)
        found |= {"accuracy_not_asked": beside} if beside else {}
        found["accuracy_used"] = control.verdict(control.asked).ratio
    if control.irregular:
        each = [summary(estimate.errors) for estimate in control.statistics.values()]
        for name in each[0] if each else ():
            found[name.replace("error_", "error_extremes_", 1)] = max(x[name] for x in each)
    return found, [*dict(reversed(control.notes)).items(), *undersampled]


def error_fields(result: RunSample, errors: Errors) -> list[Field]:
    """Errors by cause and quantity."""
    return [
        Field(
            f"errors/{cause}/{name}", UNITS[name], f"{CAUSES[cause]} of {_words(name)}, estimated",
            (result.places[-1] + 1,) if result.places.size and is_along(name) else shape[1:],
            ("right/s" if name.startswith("right_") else "s",) if len(shape) == 2 else (),
        )
        for cause, quantities in errors.fields.items()
        for name, shape in quantities.items()
    ]  # fmt: skip


def _words(name: str) -> str:
    """A quantity in words."""
    after = " just after the point" if name.startswith("right_") else ""
    return name.removeprefix("right_").replace("_", " ") + after
