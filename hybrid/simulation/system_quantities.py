"""Quantities that a scene of several lines asks for by name, recorded beside its points and bodies."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from hybrid.kernels.state import Batch, Floats
from hybrid.outputs.probes import Probe
from hybrid.outputs.quantities import Quantities
from hybrid.scene.schema import Scene
from hybrid.scene.system import System
from hybrid.simulation.result_file import limits_of
from hybrid.simulation.system_lines import LineResult
from hybrid.store.format import Field


class SystemQuantities:
    """The quantities of all lines, each computed from a state of its line."""

    def __init__(self, system: System, scenes: Mapping[str, Scene]) -> None:
        """scenes: of the lines, by name."""
        self._wanted, self._scenes = system.output.quantities, scenes
        self._of_line: dict[str, tuple[Quantities, dict[str, Probe]]] = {}
        for line, scene in scenes.items():
            mine = {name: q for name, q in self._wanted.items() if q.line == line}
            if mine:
                found = Quantities(scene, mine)
                found.pipes = None  # their stresses are in the result of the line
                self._of_line[line] = found, found.probes()

    @property
    def fields(self) -> list[Field]:
        """What is recorded."""
        may_be_nan = set(self._wanted)
        return [
            Field(name, p.unit, p.description, nan_ok=name in may_be_nan)
            for _, probes in self._of_line.values()
            for name, p in probes.items()
        ]

    @property
    def limits(self) -> list[tuple[Field, np.ndarray]]:
        """Limits by name."""
        return limits_of(self._wanted)

    def values(self, states: Mapping[str, Batch], lines: Mapping[str, LineResult]) -> dict[str, float]:
        """Values of one output, from the states of the lines and what is recorded of them, by name."""
        out: dict[str, float] = {}
        for name, (found, probes) in self._of_line.items():
            found.others = {
                q.other: (states[q.other].r[0], self._radii(lines[q.other]))
                for q in found.wanted.values()
                if q.other is not None
            }
            seen = lines[name].observer.look(states[name])
            out |= {key: float(probe.value(seen)[0]) for key, probe in probes.items()}
        return out

    def _radii(self, line: LineResult) -> Floats:
        return Quantities(line.scene, {}).radii(line.model.line.s)
