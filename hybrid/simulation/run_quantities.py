"""Quantities that a scene of several lines asks for by name, recorded beside its points and bodies."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from hybrid.kernels.state.state import Batch, Floats
from hybrid.kernels.watch.named_quantities import PATH_ROW
from hybrid.model.network import NetworkModel, build_system
from hybrid.model.plan import with_models
from hybrid.model.resolution import model_is_free
from hybrid.outputs.observation import Probe
from hybrid.outputs.obstacle_forces import KEYS, Lines, pair_fields, pair_forces
from hybrid.outputs.quantities import Quantities, StepQuantities
from hybrid.scene.bodies import FreeBody
from hybrid.scene.network import Network
from hybrid.scene.points import FreePoint
from hybrid.scene.quantities import KINDS, Quantity
from hybrid.scene.read import SceneLike, as_scene
from hybrid.scene.schema import LineScene
from hybrid.simulation.line_result import LineResult, observer_of
from hybrid.simulation.parts import Part
from hybrid.simulation.result_file import STEP_FIELDS, limits_of
from hybrid.simulation.run_points import fields_of
from hybrid.solve.contact import SharedContact
from hybrid.solve.network_solver import NetworkSolver
from hybrid.store.format import Field
from hybrid.store.hdf5_file import group_of

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


class RunQuantities(Part):
    """The quantities of all lines, each computed from a state of its line."""

    name, is_of_form = "quantities", True

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

    def use_solver(self, model: NetworkModel, solver: NetworkSolver) -> None:
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

    def checkpoint(self) -> dict[str, Any]:
        """Ranges by line, and from what excursions and azimuths count."""
        return {"quantities": {name: x.reached.copy() for name, x in self._steps.items()} | self._references()}

    def _references(self) -> dict[str, np.ndarray]:
        """From where excursions, m, and from which azimuths, deg, of a line count, by `line/first` and `line/turns`."""
        found = {f"{line}/first": x.first for line, (x, _) in self._of_line.items()}
        found |= {f"{line}/turns": x.turns for line, (x, _) in self._of_line.items()}
        return {name: x.copy() for name, x in found.items() if x.size}

    def of_today(self, saved: Mapping[str, Any]) -> dict[str, Any]:
        """In files of earlier programs there are no ranges, or no references: these are unknown."""
        for x in self._steps.values():
            x.restore(None)
        mine = saved["quantities"] if "quantities" in saved else self.checkpoint()["quantities"]
        return {"quantities": self._references() | mine if isinstance(mine, dict) else mine}

    def restore(self, saved: Mapping[str, Any]) -> None:
        """Go on with ranges that a checkpoint has; of one from before there were any, they stay unknown."""
        saved = saved["quantities"]
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
            _, seen, _ = lines[name].observe(self._seen(name, states[name]))
            out |= {key: np.array(probe.value(seen)) for key, probe in probes.items()}
        return out

    def _seen(self, name: str, states: Batch) -> Batch:
        """States of a line with ends that nothing takes as the free ends that they are."""
        held = np.ones_like(states.held)
        held[:, [k for line, k in self._idle if line == name]] = 0
        return states._replace(held=held)

    def _radii(self, line: LineResult) -> Floats:
        return Quantities(line.scene, {}).radii(line.model.line.s)


class Rotations(Part):
    """Roll, pitch and yaw of bodies and points that go on from output to output, beyond half a turn."""

    name, is_of_form = "rotations", True

    def __init__(self, system: Network, model: NetworkModel) -> None:
        """They begin within half a turn of what the scene gives for bodies, and of 0 for points."""
        begin = {f"points/{name}/rotation": np.zeros(3) for name in model.rigid}
        for name, body in system.bodies.items():
            given = body.initial_rotation if isinstance(body, FreeBody) else body.rotation
            begin[f"bodies/{name}/rotation"] = np.array(given, float)
        self.names = list(begin)
        self.last = np.array(list(begin.values())).reshape(-1, 3)  # (n, 3) deg

    def checkpoint(self) -> dict[str, Any]:
        """Those of the last output."""
        return {"rotations": self.last.copy()}

    def of_today(self, saved: Mapping[str, Any]) -> dict[str, Any]:
        """In files of an earlier program they were within half a turn of 0."""
        return {"rotations": saved.get("rotations", self.last)}

    def restore(self, saved: Mapping[str, Any]) -> None:
        """Go on from there."""
        self.last[:] = saved["rotations"]

    def unwind(self, values: dict[str, Floats]) -> None:
        """Put in place of the rotations (nb, 3) in `values` the same ones, deg, each nearest to the one before it."""
        for k, name in enumerate(self.names):
            for row in values.get(name, ()):
                row[:] = self.last[k] = nearest_angles(row, self.last[k])


def nearest_angles(angles: Floats, before: Floats) -> Floats:
    """Roll, pitch and yaw (3,) deg of the same rotation as `angles`, nearest to `before`.

    The same: whole turns of each, or half a turn more of roll and yaw with 180 deg - pitch in place of pitch.
    """
    other = np.array([angles[0] + 180.0, 180.0 - angles[1], angles[2] + 180.0])
    both = [x + 360.0 * np.round((before - x) / 360.0) for x in (np.asarray(angles, float), other)]
    return min(both, key=lambda x: float(((x - before) ** 2).sum()))


# Forces between lines that touch each other, at the outputs of a system: which pairs are named, and their values.


def fields_of_pairs(model: NetworkModel) -> list[Field]:
    """What is recorded of the pairs of lines whose contact is computed, and of these lines with themselves."""
    return pair_fields([(model.names[a], model.names[b]) for a, b in _pairs(model).values()])


def values_of_pairs(model: NetworkModel, shared: SharedContact | None, states: Sequence[Batch]) -> dict[str, Floats]:
    """Values (nb, ...) of those fields, from nb states of all lines; shared: their contact, None: nothing touches."""
    found: dict[str, Floats] = {}
    nb, pairs = len(states[0].t), _pairs(model)
    for a, b in pairs.values():
        at = f"contacts/{model.names[a]}/{model.names[b]}"
        found |= {f"{at}/{key}": np.zeros((nb, 3) if key == "force" else nb) for key in KEYS[a == b :]}
    if shared is None or not pairs:
        return found
    lines, mine = Lines(shared.contact, shared.s), [states[k] for k in shared.lines]
    for output in range(nb):
        touch = np.concatenate([x.touch[output] for x in mine])
        if not touch.any():
            continue
        r = np.concatenate([x.r[output] for x in mine])
        for pair, values in pair_forces(lines, r, touch).items():
            at = "contacts/" + "/".join(model.names[k] for k in pairs[pair])
            for key, value in zip(KEYS, values, strict=True):
                if f"{at}/{key}" in found:
                    found[f"{at}/{key}"][output] = np.asarray(value)
    return found


def _pairs(model: NetworkModel) -> dict[tuple[int, int], tuple[int, int]]:
    """Numbers of two lines, or of one twice, by their places among the lines that touch others, first <= second.

    None, where nobody asks for their contact: which lines will meet is not known when a file is begun.
    """
    if model.touching is None or model.may_meet:
        return {}
    lines = model.touching.lines
    each = zip(*np.nonzero(np.triu(model.touching.meets)), strict=True)
    return {(int(j), int(k)): (lines[j], lines[k]) for j, k in each}


# What a result will hold, by name, unit and description, before anything is computed.


class Listed(NamedTuple):
    """A quantity of a result: its name, unit, dimensions, and what it is."""

    name: str
    unit: str
    dims: tuple[str, ...]
    description: str


def listed_outputs(scene: SceneLike) -> list[Listed]:
    """What `hybrid run` (or `hybrid static` of a scene without time) will record over time; nothing is computed.

    Of several lines: what is recorded of points and bodies, and of every line under `lines/<name>/`.
    """
    asked = as_scene(scene)
    free, moves = [name for name in asked.lines if model_is_free(asked.asked_scene(name))], asked.time is not None
    asked = with_models(asked, dict.fromkeys(free, "adaptive"))
    scenes, found = asked.asked_scenes, list[Listed]()
    model = build_system(asked)
    if "" not in scenes:  # which would record the quantities itself, and has no points beside it
        found = _over_time([*fields_of(asked), *fields_of_pairs(model), *RunQuantities(asked, scenes).fields])
    for (name, each), built in zip(scenes.items(), model.models, strict=True):
        fields = observer_of(each, built, moves).fields
        found += _over_time(fields, steps=moves, begin=group_of(name))
    return _with_ranges(found, asked.output.quantities) if moves else found


def kinds_of_quantities() -> list[Listed]:
    """Kinds of `output.quantities`, which are recorded where a scene asks for them."""
    words = {"end": "end given", "to": "touchdown point or other end", "what": "a point, a plane, a path or a line"}
    return [Listed(kind, unit, ("t",), text.format(**words)) for kind, (unit, text, _, _) in KINDS.items()]


def _with_ranges(found: list[Listed], asked: Mapping[str, Quantity]) -> list[Listed]:
    """Listed quantities that say whether extremes and limits of them are those of every step; asked: by name."""
    out = []
    for x in found:
        if x.name in asked or x.name in ("wall_tension", "von_mises"):
            x = x._replace(description=f"{x.description}; extremes and limits: of every step")
        out.append(x)
    return out


def _over_time(fields: Iterable[Field], steps: bool = False, begin: str = "") -> list[Listed]:
    """Fields at every output, and what is logged at every step; the second values of places with two are left out."""
    every = [Listed(begin + f.name, f.unit, ("t", *f.dims), f.description) for f in fields if "right/" not in f.name]
    return every + [Listed(f"{begin}steps/{f.name}", f.unit, ("steps/t",), f.description) for f in STEP_FIELDS if steps]
