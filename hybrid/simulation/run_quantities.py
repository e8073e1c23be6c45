"""Quantities that a scene of several lines asks for by name, recorded beside its points and bodies."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from hybrid.kernels.state.state import Batch, Floats
from hybrid.kernels.watch.named_quantities import PATH_ROW
from hybrid.model.network import NetworkModel
from hybrid.outputs.observation import Probe
from hybrid.outputs.quantities import Quantities
from hybrid.outputs.step_quantities import StepQuantities
from hybrid.scene.network_scene import Network
from hybrid.scene.points import FreePoint
from hybrid.scene.schema import LineScene
from hybrid.simulation.line_result import LineResult
from hybrid.simulation.result_file import limits_of
from hybrid.store.format import Field

MORE_CELLS = 4  # times as many as at first may a line have whose chords are looked at; with more nothing is known


def idle_ends(system: Network, model: NetworkModel) -> list[tuple[int, int]]:
    """Ends (line, 0 or 1) that are alone at a free point on which nothing acts, or have come loose."""
    found = []
    for number, (name, x, joints) in enumerate(zip(model.names, model.models, model.joints, strict=True)):
        for k, point in enumerate((system.lines[name].start, system.lines[name].end)):
            at = system.points[point]
            loaded = getattr(at, "force", None) is not None or (isinstance(at, FreePoint) and at.is_body)
            if joints[k] < 0 and not x.ends.values.held[k] and (not loaded or (number, k) in model.loose):
                found.append((number, k))
    return found


class RunQuantities:
    """The quantities of all lines, each computed from a state of its line."""

    def __init__(self, system: Network, scenes: Mapping[str, LineScene]) -> None:
        """scenes: of the lines whose quantities are kept here, by name; others keep them themselves."""
        self._wanted, self._scenes, self._system = system.output.quantities, scenes, system
        self._idle: frozenset[tuple[str, int]] = frozenset()
        self._of_line: dict[str, tuple[Quantities, dict[str, Probe]]] = {}
        self._steps: dict[str, StepQuantities] = {}  # their ranges over all steps, of a motion
        for line, scene in scenes.items():
            mine = {name: q for name, q in self._wanted.items() if q.line == line}
            if mine:
                found = Quantities(scene, mine)
                found.pipes = found.capacities = None  # what goes along a line is in the result of the line
                self._of_line[line] = found, found.probes()

    def keep_ranges(self, lines: Sequence[LineResult]) -> None:
        """From now on the books of the lines keep the ranges of what is asked of them, over all steps.

        Clearances of two lines stand with the later one, which is looked at when the other one has been.
        """
        order, first, keeper = [line.name for line in lines], dict[str, str](), dict[str, str]()
        rows_of, rows = dict[str, tuple[int, int]](), 0
        for name, q in self._wanted.items():
            keeper[name] = q.line or ""
            if q.other is not None:
                first[name], keeper[name] = sorted([str(q.line), q.other], key=order.index)
                most = MORE_CELLS * lines[order.index(first[name])].model.line.h.size + 2
                rows_of[name], rows = (rows, rows + most), rows + most
        paths = [np.zeros((rows, PATH_ROW))]
        for line in (x for x in lines if x.name in self._scenes):
            mine = {name: q for name, q in self._wanted.items() if keeper[name] == line.name}
            shown = {name: self._wanted[name] for name, x in first.items() if x == line.name}
            pipes = line.envelope.quantities.pipes
            found = StepQuantities(line.scene, mine, pipes, line.name, shown, rows_of)
            if found:
                self._steps[line.name] = found
                paths.append(found.path)
        begins = np.cumsum([len(x) for x in paths]).tolist()
        path = np.concatenate(paths)
        for line in lines:
            if line.name in self._steps:
                self._steps[line.name].share(path, begins.pop(0))
                line.books = self._steps[line.name].given_to(line.books)

    def follow(self, model: NetworkModel) -> None:
        """Know from now on which ends came loose: nothing takes their pull, which has no direction."""
        self._idle = frozenset((model.names[line], k) for line, k in idle_ends(self._system, model))
        for name, x in self._steps.items():
            x.set_idle([k for line, k in self._idle if line == name])

    @property
    def ranges(self) -> list[tuple[Field, np.ndarray]]:
        """The smallest and the largest value of each over all steps, not yet known."""
        return [(f, np.full(f.shape, np.nan)) for x in self._steps.values() for f in x.fields()]

    def range_values(self) -> dict[str, np.ndarray]:
        """Values of those fields up to now."""
        return {name: x for line in self._steps.values() for name, x in line.values().items()}

    def ranges_of(self, line: str) -> dict[str, np.ndarray]:
        """Those of a line."""
        return {name: x for name, x in self.range_values().items() if self._wanted[name.split("/")[-1]].line == line}

    def checkpoint(self) -> dict[str, np.ndarray]:
        """Ranges by line, and from what excursions and azimuths count."""
        return {name: x.reached.copy() for name, x in self._steps.items()} | self.references()

    def references(self) -> dict[str, np.ndarray]:
        """From where excursions, m, and from which azimuths, deg, of a line count, by `line/first` and `line/turns`."""
        found = {f"{line}/first": x.first for line, (x, _) in self._of_line.items()}
        found |= {f"{line}/turns": x.turns for line, (x, _) in self._of_line.items()}
        return {name: x.copy() for name, x in found.items() if x.size}

    def unknown(self) -> dict[str, np.ndarray]:
        """The same of a run that has kept none so far."""
        for x in self._steps.values():
            x.restore(None)
        return self.checkpoint()

    def of_today(self, saved: object) -> object:
        """What a checkpoint has, of a file of before with unknown references: it kept none."""
        return self.references() | saved if isinstance(saved, dict) else saved

    def restore(self, saved: Mapping[str, np.ndarray]) -> None:
        """Go on with ranges that a checkpoint has; of one from before there were any, they stay unknown."""
        for name, x in self._steps.items():
            x.restore(saved.get(name))
        for line, (found, _) in self._of_line.items():
            found.first[:] = saved.get(f"{line}/first", found.first)
            found.turns[:] = saved.get(f"{line}/turns", found.turns)

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

    def values(self, states: Mapping[str, Batch], lines: Mapping[str, LineResult]) -> dict[str, Floats]:
        """Values (nb,) of outputs, from the states of the lines and what is recorded of them, by name."""
        out: dict[str, Floats] = {}
        for name, (found, probes) in self._of_line.items():
            found.others = {
                q.other: (states[q.other].r, self._radii(lines[q.other]))
                for q in found.wanted.values()
                if q.other is not None
            }
            _, seen, _ = lines[name].look(self._seen(name, states[name]))
            out |= {key: np.array(probe.value(seen)) for key, probe in probes.items()}
        return out

    def _seen(self, name: str, states: Batch) -> Batch:
        """States of a line with ends that nothing takes as the free ends that they are."""
        held = np.ones_like(states.held)
        held[:, [k for line, k in self._idle if line == name]] = 0
        return states._replace(held=held)

    def _radii(self, line: LineResult) -> Floats:
        return Quantities(line.scene, {}).radii(line.model.line.s)
