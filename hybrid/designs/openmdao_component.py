"""The class of `hybrid.openmdao_component`: it is imported where OpenMDAO is there."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from openmdao.api import AnalysisError, ExplicitComponent
from openmdao.utils.units import valid_units

from hybrid.designs.case_results import Point
from hybrid.designs.problem import MINIMISED, NOTHING, Input, Objective, Output, Problem
from hybrid.errors import ComputationError, SceneError


class DesignComponent(ExplicitComponent):
    """Equilibria and motions of a design, with their derivatives."""

    def __init__(
        self, problem: Problem, inputs: Mapping[str, Input], outputs: Mapping[str, Output], driven: bool
    ) -> None:
        """driven: it states design variables, constraints and an objective of its own."""
        super().__init__()
        self._design, self._of_inputs, self._of_outputs, self._driven = problem, dict(inputs), dict(outputs), driven

    @property
    def _objective(self) -> Objective | None:
        found = self._design.objective
        return found if found is not None and found.text != NOTHING else None

    def setup(self) -> None:
        start = self._design.equilibria.point_of(self._design.space.start)
        sizes = self._design.space.sizes(self._design.space.start)
        for (name, x), size in zip(self._of_inputs.items(), sizes, strict=True):
            self.add_input(name, val=x.start, units=_units(x.unit), desc=_described(x.text, x.unit))
            if self._driven:
                self.add_design_var(name, lower=x.low, upper=x.high, ref=size)
        for name, each in self._of_outputs.items():
            text = _described(each.text, each.unit)
            self.add_output(name, val=start.values[each.rows], units=_units(each.unit), desc=text)
            if self._driven and each.low == each.high:
                self.add_constraint(name, equals=each.low, ref=each.scale)
            elif self._driven and (np.isfinite(each.low) or np.isfinite(each.high)):
                self.add_constraint(name, lower=each.low, upper=each.high, ref=each.scale)
        if self._objective is not None:
            value = self._objective.value(start)
            self.add_output(MINIMISED, val=value, desc=self._objective.text)
            if self._driven:
                self.add_objective(MINIMISED, ref=abs(value) or 1.0)
        self.declare_partials("*", "*")

    def compute(self, inputs: Any, outputs: Any, *_: Any) -> None:
        point = self._point(inputs)
        for name, each in self._of_outputs.items():
            outputs[name] = point.values[each.rows]
        if self._objective is not None:
            outputs[MINIMISED] = self._objective.value(point)

    def compute_partials(self, inputs: Any, partials: Any, *_: Any) -> None:
        point = self._point(inputs)
        try:
            point.refresh(set(self._design.equilibria.scenes))  # of motions: those of a search are estimates
            slopes = point.slopes
        except (ComputationError, SceneError) as error:
            raise AnalysisError(str(error)) from error
        for k, unknown in enumerate(self._of_inputs):
            for name, each in self._of_outputs.items():
                partials[name, unknown] = slopes[each.rows, k][:, None]
        if self._objective is not None:
            for unknown, slope in zip(self._of_inputs, self._objective.slopes(point), strict=True):
                partials[MINIMISED, unknown] = slope

    def _point(self, inputs: Any) -> Point:
        """Equilibria with these inputs; AnalysisError: there are none."""
        x = np.array([inputs[name].item() for name in self._of_inputs])
        try:
            return self._design.equilibria.point_of(x)
        except (ComputationError, SceneError) as error:
            raise AnalysisError(str(error)) from error


def _units(unit: str) -> str | None:
    """A unit such as N m^2 as OpenMDAO writes it; None: it has none, or not such a one."""
    text = unit.replace("^", "**").replace(" ", "*")
    return text if text and "," not in text and valid_units(text) else None


def _described(text: str, unit: str) -> str:
    """What it is, with a unit that OpenMDAO does not know."""
    return f"{text} [{unit}]" if unit and _units(unit) is None else text
