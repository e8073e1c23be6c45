"""What is recorded of a run beside its lines: points, bodies and pairs of lines, and quantities asked for by name."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np

from hybrid.kernels.run.network import (
    SAMPLE_AXES,
    SAMPLE_DONE,
    SAMPLE_ENERGIES,
    SAMPLE_LINES,
    SAMPLE_PLACE,
    SAMPLE_V,
    SAMPLE_W,
)
from hybrid.kernels.state.report import FORCE_A, MOMENT_A
from hybrid.kernels.state.state import Batch, Floats
from hybrid.kernels.watch.named_quantities import PATH_ROW
from hybrid.model.bodies import angles_of
from hybrid.model.network import NetworkModel, build_network
from hybrid.model.plan import with_models
from hybrid.model.resolution import model_is_free
from hybrid.outputs.observation import KEYS, Lines, Probe, pair_fields, pair_forces
from hybrid.outputs.probes import elevation, elevation_field
from hybrid.outputs.quantities import Quantities, StepQuantities
from hybrid.scene.bodies import FreeBody
from hybrid.scene.ends import Fairlead, FreePoint, GuidedPoint, Point
from hybrid.scene.network import Network
from hybrid.scene.quantities import KINDS
from hybrid.scene.read import SceneLike, as_scene
from hybrid.scene.schema import LineScene
from hybrid.simulation.parts import Part, Sampled, times
from hybrid.simulation.result_file import STEP_FIELDS, asked_limits
from hybrid.simulation.run_line import RunLine, observer_of
from hybrid.solve.contact import SharedContact
from hybrid.solve.network_solver import NetworkSolver
from hybrid.store.format import Field
from hybrid.store.hdf5_file import group_of
from hybrid.store.integrity import matched


def idle_ends(network: Network, model: NetworkModel) -> list[tuple[int, int]]:
    """Ends (line, 0 or 1) that are alone at a free point on which nothing acts, or have come loose."""
    found = []
    for number, (name, x, joints) in enumerate(zip(model.names, model.models, model.joints, strict=True)):
        for k, point in enumerate((network.lines[name].start, network.lines[name].end)):
            at = network.points[point]
            loaded = getattr(at, "force", None) is not None or (isinstance(at, FreePoint) and at.is_body)
            if joints[k] < 0 and not x.ends.values.held[k] and (not loaded or (number, k) in model.loose):
                found.append((number, k))
    return found


class RunQuantities(Part):
    """The quantities of all lines, each computed from a state of its line."""

    name, older = "quantities", MappingProxyType({"quantities": None})

    def __init__(self, network: Network, scenes: Mapping[str, LineScene]) -> None:
        """scenes: of the lines whose quantities are kept here, by name; others keep them themselves."""
        self._wanted, self._scenes, self._network = network.output.quantities, scenes, network
        self._idle: frozenset[tuple[str, int]] = frozenset()
        self._of_line: dict[str, tuple[Quantities, dict[str, Probe]]] = {}
        self._steps: dict[str, StepQuantities] = {}  # their ranges over all steps, of a motion
        for line, scene in scenes.items():
            mine = {name: q for name, q in self._wanted.items() if q.line == line}
            if mine:
                found = Quantities(scene, mine)
                found.pipes = found.capacities = found.codes = None  # the result of the line has what goes along it
                self._of_line[line] = found, found.probes()

    def keep_ranges(self, lines: Sequence[RunLine]) -> None:
        """From now on the books of the lines keep the ranges of what is asked of them, over all steps.

        Clearances of two lines stand with the later one, which is looked at when the other one has been.
        """
        order, first, keeper = [line.name for line in lines], dict[str, str](), dict[str, str]()
        rows_of, rows = dict[str, tuple[int, int]](), 0
        for name, q in self._wanted.items():
            keeper[name] = q.line or ""
            if q.other is not None:
                first[name], keeper[name] = sorted([str(q.line), q.other], key=order.index)
                most = lines[order.index(first[name])].model.most_cells + 2
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
        self._idle = frozenset((model.names[line], k) for line, k in idle_ends(self._network, model))
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

    def restore(self, saved: Mapping[str, Any]) -> None:
        """Go on with ranges that a checkpoint has.

        In files of earlier programs there are no ranges, or no references: these are unknown.
        """
        for x in self._steps.values():
            x.restore(None)
        now, mine = self.checkpoint()["quantities"], saved["quantities"]
        if mine is None:
            mine = now
        elif isinstance(mine, dict):
            mine = self._references() | mine
        matched(mine, now, "quantities")
        for name, x in self._steps.items():
            x.restore(mine[name])
        for line, (found, _) in self._of_line.items():
            found.first[:] = mine.get(f"{line}/first", found.first)  # none, where nothing is asked that counts from it
            found.turns[:] = mine.get(f"{line}/turns", found.turns)

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
        return asked_limits(self._wanted)

    def values(self, states: Mapping[str, Batch], lines: Mapping[str, RunLine]) -> dict[str, Floats]:
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

    def _radii(self, line: RunLine) -> Floats:
        return Quantities(line.scene, {}).radii(line.model.line.s)


class Rotations(Part):
    """Roll, pitch and yaw of bodies and points that go on from output to output, beyond half a turn."""

    name = "rotations"

    def __init__(self, network: Network, model: NetworkModel) -> None:
        """They begin within half a turn of what the scene gives for bodies, and of 0 for points."""
        begin = {f"points/{name}/rotation": np.zeros(3) for name in model.rigid}
        for name, body in network.bodies.items():
            given = body.initial_rotation if isinstance(body, FreeBody) else body.rotation
            begin[f"bodies/{name}/rotation"] = np.array(given, float)
        self.names = list(begin)
        self.last = np.array(list(begin.values())).reshape(-1, 3)  # (n, 3) deg
        self.older = self.checkpoint()

    def checkpoint(self) -> dict[str, Any]:
        """Those of the last output."""
        return {"rotations": self.last.copy()}

    def restore(self, saved: Mapping[str, Any]) -> None:
        """Go on from there."""
        self.last[:] = matched(saved["rotations"], self.last, "rotations")

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


# Forces between lines that touch each other, at the outputs of a network: which pairs are named, and their values.


def fields_of_pairs(model: NetworkModel) -> list[Field]:
    """What is recorded of the pairs of lines whose contact is computed, and of these lines with themselves."""
    return pair_fields([(model.names[a], model.names[b]) for a, b in _pairs(model).values()])


def values_of_pairs(
    model: NetworkModel, shared: SharedContact | None, states: Sequence[Batch], of: Sequence[RunLine]
) -> dict[str, Floats]:
    """Values (nb, ...) of those fields, from nb states of all lines; shared: their contact, None: nothing touches."""
    found: dict[str, Floats] = {}
    nb, pairs = len(states[0].t), _pairs(model)
    for a, b in pairs.values():
        at = f"contacts/{model.names[a]}/{model.names[b]}"
        found |= {f"{at}/{key}": np.zeros((nb, 3) if key == "force" else nb) for key in KEYS[a == b :]}
    if shared is None or not pairs:
        return found
    mine = {k: states[k] for k in shared.lines}
    paid = {k: of[k].paid_out(x) for k, x in mine.items() if of[k].paying is not None and x.touch.any()}
    for output in range(nb):
        touch = np.concatenate([x.touch[output] for x in mine.values()])
        if not touch.any():
            continue
        lines = Lines(shared.contact, shared.with_lengths({k: (s[output], h[output]) for k, (s, h) in paid.items()}))
        r = np.concatenate([x.r[output] for x in mine.values()])
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
    model = build_network(asked)
    if "" not in scenes:  # which would record the quantities itself, and has no points beside it
        found = _over_time([*fields_of(asked), *fields_of_pairs(model), *RunQuantities(asked, scenes).fields])
    for (name, each), built in zip(scenes.items(), model.models, strict=True):
        fields = observer_of(each, built, moves).fields
        found += _over_time(fields, steps=moves, begin=group_of(name))
    told = {*asked.output.quantities, "wall_tension", "von_mises"} if moves else ()
    every = "; extremes and limits: of every step"
    return [x._replace(description=x.description + every) if x.name in told else x for x in found]


def kinds_of_quantities() -> list[Listed]:
    """Kinds of `output.quantities`, which are recorded where a scene asks for them."""
    words = {"end": "end given", "to": "touchdown point or other end", "what": "a point, a plane, a path or a line"}
    return [Listed(kind, unit, ("t",), text.format(**words)) for kind, (unit, text, _, _) in KINDS.items()]


def _over_time(fields: Iterable[Field], steps: bool = False, begin: str = "") -> list[Listed]:
    """Fields at every output, and what is logged at every step; the second values of places with two are left out."""
    every = [Listed(begin + f.name, f.unit, ("t", *f.dims), f.description) for f in fields if "right/" not in f.name]
    return every + [Listed(f"{begin}steps/{f.name}", f.unit, ("steps/t",), f.description) for f in STEP_FIELDS if steps]


WORKS = ("lines", "damping", "loads")


def fields_of(network: Network) -> list[Field]:
    """Place and velocity of all points and bodies, forces on them, energies of free bodies, and the sea at gauges."""

    def vector(name: str, unit: str, what: str) -> Field:
        return Field(name, unit, what, (3,), ("xyz",), "inertial")

    fields = []
    for name, point in network.points.items():
        at = f"points/{name}"
        fields.append(vector(f"{at}/position", "m", f"position of point {name}"))
        fields.append(vector(f"{at}/velocity", "m/s", f"velocity of point {name}"))
        if isinstance(point, GuidedPoint):
            what = f"moment of the line that is clamped at point {name}, about it, which its support bears"
            fields.append(vector(f"{at}/moment", "N m", what))
        elif not isinstance(point, FreePoint):
            bears = "its body" if network.body_of(name) is not None else "its support"
            fields.append(vector(f"{at}/force", "N", f"force of the lines on point {name}, which {bears} bears"))
            if network.clamped_at(name):
                what = f"moment of the lines that are clamped at point {name}, about it, which {bears} bears"
                fields.append(vector(f"{at}/moment", "N m", what))
        elif network.clamped_at(name):
            turns = f"rotation of point {name}: roll, pitch and yaw of its axes, about x, then y, then z"
            fields.append(Field(f"{at}/rotation", "deg", turns, (3,), ("xyz",), "inertial"))
    for name, body in network.bodies.items():
        at = f"bodies/{name}"
        fields.append(vector(f"{at}/position", "m", f"position of the origin of body {name}"))
        turns = f"rotation of body {name}: roll, pitch and yaw, about x, then y, then z; beyond half a turn, too"
        fields.append(Field(f"{at}/rotation", "deg", turns, (3,), ("xyz",), "inertial"))
        fields.append(vector(f"{at}/velocity", "m/s", f"velocity of the origin of body {name}"))
        fields.append(vector(f"{at}/angular_velocity", "rad/s", f"angular velocity of body {name}"))
        fields.append(vector(f"{at}/force", "N", f"force of the lines on body {name}"))
        fields.append(vector(f"{at}/moment", "N m", f"moment of the lines on body {name} about its origin"))
        if isinstance(body, FreeBody):
            fields.append(Field(f"{at}/energy/kinetic", "J", f"kinetic energy of body {name}, with its added mass"))
            what = f"potential energy of body {name}: weight, buoyancy and hydrostatics"
            fields.append(Field(f"{at}/energy/potential", "J", what))
            for work in WORKS:
                what = {"lines": "its lines", "damping": "its damping", "loads": "given loads"}[work]
                fields.append(Field(f"{at}/work/{work}", "J", f"work done on body {name} by {what} since t = 0"))
    if network.output.elevation:
        fields.append(elevation_field(gauges_of(network)))
    return fields


def gauges_of(network: Network) -> Floats:
    """Places (n, 2) m at which the elevation of the sea is recorded."""
    return np.array(network.output.elevation or (), float).reshape(-1, 2)


def values_of(network: Network, model: NetworkModel, seen: Sampled) -> dict[str, Floats]:
    """The values (nb, ...) of all fields for outputs."""
    values: dict[str, Floats] = {}
    t, count = seen.t, len(seen.bodies)
    if network.output.elevation:  # the sea is that of every line
        values["elevation"] = elevation(model.models[0].sea.values, gauges_of(network), seen.lines[0].sea_now)
    pulls: dict[str, list[tuple[Floats, Floats, Floats]]] = {name: [] for name in network.bodies}
    none = np.zeros((count, 3))
    for name, point in network.points.items():
        at = [(model.names.index(line), -(end == "end")) for line, end in network.lines_at(name)]
        here = [(line, node) for line, node in at if (line, -node) not in model.loose]
        position, velocity = _place(model, seen, point, at[0], here)
        values[f"points/{name}/position"], values[f"points/{name}/velocity"] = position, velocity
        if isinstance(point, FreePoint):
            if name in model.rigid:
                frames = seen.frame(len(model.bodies) + model.rigid.index(name))
                values[f"points/{name}/rotation"] = angles_of(frames)
            continue
        moment = _clamp_moment(network, model, seen, name)
        if moment is not None:
            values[f"points/{name}/moment"] = moment
        if isinstance(point, GuidedPoint):
            continue
        reports = [(seen.lines[k].report, FORCE_A - 3 * node) for k, node in here]
        values[f"points/{name}/force"] = force = sum((r[:, f : f + 3] for r, f in reports), none)
        if network.body_of(name) is not None:
            pulls[point.body].append((position, force, none if moment is None else moment))  # type: ignore[union-attr]
    for name, known in model.known.items():
        found = [known.at_time(x) for x in t]
        position, velocity, frame, spin = (np.array(x) for x in zip(*found, strict=True))
        force = sum((f for _, f, _ in pulls[name]), none)
        moment = sum((np.cross(place - position, f) + m for place, f, m in pulls[name]), none)
        values |= _of_body(name, position, frame, velocity, spin, force, moment)
    for k, body in enumerate(model.bodies):
        x, at_body = seen.bodies[:, k], f"bodies/{body.name}"
        force, moment = x[:, SAMPLE_LINES : SAMPLE_LINES + 3], x[:, SAMPLE_LINES + 3 : SAMPLE_ENERGIES]
        place, velocity = x[:, SAMPLE_PLACE:SAMPLE_AXES], x[:, SAMPLE_V:SAMPLE_W]
        values |= _of_body(body.name, place, seen.frame(k), velocity, seen.spin(k), force, moment)
        for o, energy in enumerate(("kinetic", "potential"), SAMPLE_ENERGIES):
            values[f"{at_body}/energy/{energy}"] = x[:, o].copy()
        values |= {f"{at_body}/work/{work}": x[:, o].copy() for o, work in enumerate(WORKS, SAMPLE_DONE)}
    return values


def _clamp_moment(network: Network, model: NetworkModel, seen: Sampled, point: str) -> Floats | None:
    """Moment (nb, 3) N m of the lines that are clamped at a point, about it; None: there are none."""
    here = network.clamped_at(point)
    if not here:
        return None
    moment = np.zeros((len(seen.bodies), 3))
    for line, end in here:
        k = model.names.index(line)
        if (k, int(end == "end")) in model.loose:
            continue
        report = seen.lines[k].report
        moment += report[:, MOMENT_A : MOMENT_A + 3] if end == "start" else -report[:, MOMENT_A + 3 : MOMENT_A + 6]
    return moment


def _place(
    model: NetworkModel, seen: Sampled, point: Point, first: tuple[int, int], here: Sequence[tuple[int, int]]
) -> tuple[Floats, Floats]:
    """Positions and velocities (nb, 3) of a point; first: line and node that began there, here: those still there."""
    if here:
        line, node = here[0]
        return seen.lines[line].r[:, node].copy(), seen.lines[line].v[:, node].copy()
    for k, body in enumerate(model.bodies):
        if isinstance(point, Fairlead) and point.body == body.name:
            x = seen.bodies[:, k]
            arm = times(seen.frame(k), np.array(point.place))
            velocity = x[:, SAMPLE_V:SAMPLE_W] + np.cross(seen.spin(k), arm)
            return x[:, SAMPLE_PLACE:SAMPLE_AXES] + arm, velocity
    line, node = first
    ends, found = model.supports.get((line, -node), model.models[line].ends), []
    for t in seen.t:
        ends.at_time(t)
        found.append((ends.values.position[-node].copy(), ends.velocity[-node].copy()))
    position, velocity = (np.array(x) for x in zip(*found, strict=True))
    return position, velocity


def _of_body(
    name: str, position: Floats, frame: Floats, velocity: Floats, spin: Floats, force: Floats, moment: Floats
) -> dict[str, Floats]:
    keys = ("position", "rotation", "velocity", "angular_velocity", "force", "moment")
    found = (position, angles_of(frame), velocity, spin, force, moment)
    return {f"bodies/{name}/{key}": np.array(x) for key, x in zip(keys, found, strict=True)}
