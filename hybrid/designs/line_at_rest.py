"""One line at rest: its residuals when its scene changes, its results, and their gradients.

Gradients are those by the unknowns q.  From them one transposed solve has the derivative of a result g by all numbers:
dg/dp = λ·∂R/∂p  with  Aᵀλ = ∂g/∂q (theory.md, 22).  A result depends on the unknowns near its place, or near the ends
of the line.  Only these are moved, each by itself; that no other one counts is tried with all of the others at once.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from types import MappingProxyType
from typing import Any, NamedTuple, cast

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import splu

from hybrid.designs.wanted import Wanted
from hybrid.errors import Complaint, SceneError
from hybrid.kernels.algebra.block_elimination import SIZE, WIDTH
from hybrid.kernels.march.assembly import JOINED
from hybrid.kernels.march.zone_torque import TORQUE
from hybrid.kernels.run.entry import assembly, workspace_of
from hybrid.kernels.state.report import FRICTION, MOMENT_A, NET_A, PLANAR, WAVES
from hybrid.kernels.state.state import FIELDS, Batch, Ends, Floats, Line, Sea, State, batch_of_one, slip_size
from hybrid.linear.matrices import ANCHOR, load_layers, rotation
from hybrid.model.build import Model
from hybrid.model.sections import jump_points, output_points
from hybrid.outputs.probes import Observer
from hybrid.scene.schema import LineScene
from hybrid.simulation.line_result import observer_of
from hybrid.solve.stepper import POWERS, JoinedLine

# How far a state is moved to differentiate its results: a part of chords, and of the largest tension.
ALONG = 1e-5
# Differences to both sides that are unequal by this part of them, and this part of the result, are of a jump.
KINK, ROUGH = 0.3, 1e-7
# Forces that do not act at rest, or depend on the way there; and a plane has block rows of its own.
LEFT_OUT = PLANAR | WAVES | FRICTION
# Movements from which on a line without what results do not depend on pays; parts within which its results are these,
# and change as these do along a movement of all unknowns.
MANY, ALIKE = 3, (1e-11, 1e-6)
# Of lines that are looked at together what has to be the same, and what results ask for that may differ.
SAME, VARIES = ("element", "spin"), ("s", "h", "hn", "k0", "kb", "ck", "mass", "force", "rotary", "polar")
SAME_PLACE = 1e-9  # part of the length within which a node is at a jump
TURNED = 1e-9  # N m over N m, torque through catenary zones that is none


class Beside(NamedTuple):
    """A line of a scene: its model, its ends, the sea around it."""

    scene: LineScene
    model: Model
    ends: Ends
    sea: Sea


class Peak(NamedTuple):
    """Where an extreme is: nodes (1 or 3,) beside each other, and what each counts there."""

    nodes: np.ndarray
    weights: Floats


def _peak(s: Floats, values: Floats, sign: float, jumps: Sequence[float]) -> Peak:
    """Where values (n,) at nodes s, m, are largest (sign 1) or least (-1).

    At the top of the parabola through that node and its neighbours: its place goes from node to node, and its value has
    no kink there.  No parabola goes through jumps, m, where a value may be two.
    """
    k = int((sign * values).argmax())
    near = [abs(x - at) <= SAME_PLACE * s[-1] for x in s[max(k - 1, 0) : k + 2] for at in jumps]
    if not 0 < k < s.size - 1 or any(near):
        return Peak(np.array([k]), np.ones(1))
    i = np.array([k - 1, k, k + 1])
    left, right = (values[k] - values[k - 1]) / (s[k] - s[k - 1]), (values[k + 1] - values[k]) / (s[k + 1] - s[k])
    bent = (right - left) / (s[k + 1] - s[k - 1])
    if sign * bent >= 0.0 or not np.isfinite(bent):
        return Peak(np.array([k]), np.ones(1))
    top = 0.5 * (s[k - 1] + s[k]) - 0.5 * left / bent
    others = np.array([[s[m] for m in i if m != n] for n in i])
    return Peak(i, np.prod((top - others) / (s[i][:, None] - others), axis=1))


# Frames (9,) of ends that turn with what they are joined to, by end.
Frames = Mapping[int, Floats]
NO_FRAMES: Frames = MappingProxyType({})


class LineAtRest:
    """One line in the equilibrium of a scene, and lines beside it, of scenes with other numbers."""

    def __init__(
        self, scene: LineScene, model: Model, state: State, wanted: Sequence[Wanted], free: Sequence[int] = (),
        frames: Frames = NO_FRAMES,
    ) -> None:  # fmt: skip
        """Results of a line at rest in a state.

        wanted: results; free: ends (0, 1) that are joined to free points or bodies; frames: of those that turn with
        them.  SceneError: the line has no result of that name, or they have no derivative.
        """
        self.model, self.state, self.wanted, self._free = model, state, tuple(wanted), list(free)
        self._frames = frames
        self.here = Beside(scene, model, self._ends(model, frames), model.sea.at_time(np.inf))
        self._at = [x.at for x in wanted if x.at is not None]
        self._nodes = any(x.over for x in wanted) or not self._at
        self._observer, self._peak_of = self._observed(self.here), dict[Wanted, Peak]()
        self._values, self._left_here = np.zeros(len(self.wanted)), cast("tuple[Floats, Floats] | None", None)
        self._line = _at_rest(model.line)
        self._work, self._still, self._tried = workspace_of(self._line), _without_rates(state), _without_rates(state)
        self._with_rows = self._work._replace(rows=np.zeros((model.line.s.size, SIZE * WIDTH)))
        if state.turn.size and np.abs(state.turn[:, TORQUE]).max() > TURNED * model.tension_scale * model.length:
            expected = "an equilibrium in which no torque passes through catenary zones"
            raise SceneError([Complaint("model", "a torque through a catenary zone", expected, "model: rod")])

    def _ends(self, model: Model, frames: Frames) -> Ends:
        """The ends of a line, those at free points and bodies joined to these."""
        ends = model.ends.at_time(np.inf)
        held, frame = ends.held.copy(), ends.frame.copy()
        held[self._free] = JOINED
        for k, x in frames.items():
            frame[k] = x
        return ends._replace(held=held, frame=frame)

    def joined(self, x: Beside) -> JoinedLine:
        """The line with ends that nothing holds."""
        model, ends = x.model, x.ends._replace(held=np.zeros(2, np.int8))
        return JoinedLine(model.line, x.sea, ends, model.length, model.tension_scale, -np.inf, (-1, -1))

    def left(self, x: Beside) -> tuple[Floats, Floats]:
        """Right-hand side (5 (N+1),) of the equations of another line at this state, and its report."""
        if x is not self.here:
            return self._left(x)
        if self._left_here is None:
            self._left_here = self._left(x)
        return self._left_here

    def _left(self, x: Beside) -> tuple[Floats, Floats]:
        work = self._with_rows
        work.report[:] = 0.0
        assembly(_at_rest(x.model.line), x.sea, x.ends, self._still, 0.0, ANCHOR, work)
        right = work.rows.reshape(-1, SIZE, WIDTH)[:, :, -1].copy()
        right[:, 1:] *= -1.0
        for k in self._free:  # what is left over at a point
            right[-k, 1:4] = work.report[NET_A + 3 * k : NET_A + 3 * k + 3]
        return right.ravel(), work.report.copy()

    def beside(self, scene: LineScene, model: Model, frames: Frames = NO_FRAMES) -> Beside:
        """The line of another scene; what is around it is evaluated where it is not what is here.

        ValueError: it has layers that slip which this one does not have, or lacks some.
        """
        if slip_size(model.line) != slip_size(self.model.line):
            raise ValueError("layers that slip")
        ends = self.here.ends if model.ends is self.model.ends and not frames else self._ends(model, frames)
        sea = self.here.sea if model.sea is self.model.sea else model.sea.at_time(np.inf)
        return Beside(scene, model, ends, sea)

    # --- results ----------------------------------------------------------------------------------

    def values(self) -> Floats:
        """(W,) of what is wanted."""
        observer = self._observer
        found = observer.values_of(observer.observation(self._output(self.here, self.left(self.here)[1])))
        for x in self.wanted:
            if x.over and "s" in observer.dims(x.name):
                value = x.component(np.asarray(found[x.name][0]))
                nodes = self._along(x)
                at_nodes = value[np.searchsorted(observer.s, self.model.line.s[nodes])]
                sign, jumps = 1.0 if x.over == "max" else -1.0, jump_points(self.here.scene)
                self._peak_of[x] = _peak(self.model.line.s[nodes], at_nodes, sign, jumps)
                self._peak_of[x].nodes[:] = nodes[self._peak_of[x].nodes]
        self._values = self._results(found, [(observer.s, self.model.line.s)])[0]
        return self._values

    def _along(self, x: Wanted) -> np.ndarray:
        """Of which nodes an extreme is taken."""
        s, sections = self.model.line.s, self.here.scene.cable.sections
        if x.section is None:
            return np.arange(s.size)
        ends = np.cumsum([0.0, *(each.length for each in sections)])
        near = 1e-9 * s[-1]
        return np.flatnonzero((s >= ends[x.section] - near) & (s <= ends[x.section + 1] + near))

    def near(self) -> list[int]:
        """Nodes by which results stand: at their places, at extremes, and at the ends of the line for all others."""
        s, found = self.model.line.s, set[int]()
        for x in self.wanted:
            if x in self._peak_of:
                found.update(self._peak_of[x].nodes.tolist())
            elif x.at is None:
                found.update((0, s.size - 1))
            else:
                found.add(int(np.searchsorted(s, min(x.at, s[-1]))))
        return sorted(found)

    @cached_property
    def _near(self) -> tuple[Stretch, LineAtRest] | None:
        """The line by the places of results, whose results are these, and change as these do; None: there is none."""
        stretch = stretch_of(self.model, self.near()) if self._looked_at_with(self.here) == 0 else None
        if stretch is None:
            return None
        model = replace(stretch.model(self.model), sea=self.model.sea.on(stretch.cells.size))
        near = LineAtRest(self.here.scene, model, stretch.state(self.state), self.wanted, self._free, self._frames)
        for x, peak in self._peak_of.items():
            near._peak_of[x] = peak._replace(nodes=np.searchsorted(stretch.nodes, peak.nodes))
        near._values = near._of_states(near._output(near.here, near.left(near.here)[1]))[0]
        q = anywhere(self.state, SIZE)
        steps = steps_along(self.state, q)
        both = (
            [near._values, self._values],
            [x._by_state(y, steps) for x, y in ((near, q[:, stretch.nodes]), (self, q))],
        )
        same = all(np.allclose(a, b, rtol=part, atol=0.0) for (a, b), part in zip(both, ALIKE, strict=True))
        return (stretch, near) if same else None

    def by_state(self, q: Floats, turns: Floats | None = None) -> Floats:
        """(P, W) derivatives of results along movements (P, N+1, 5) of the state.

        turns: (P, 2, 3) rad, of the frames of ends; None: they stay.
        """
        on = self
        if len(q) >= MANY and self._near is not None:
            stretch, on = self._near
            q = q[:, stretch.nodes]
        return on._by_state(q, steps_along(on.state, q, turns), turns)

    def _by_state(self, q: Floats, steps: Floats, turns: Floats | None = None) -> Floats:
        """The same, moved by these parts (P,) of the movements."""
        moved = displaced(self.state, np.repeat(q, 2, axis=0), (steps[:, None] * (1.0, -1.0)).ravel())
        batch = _repeated(self._output(self.here, self._work.report), 2 * len(q))._replace(**cast(Any, moved))
        for end in self._free:
            batch.position[:, end] = batch.r[:, -end]
        ends = self.here.ends
        if turns is not None:
            for k, part in enumerate((steps[:, None] * (1.0, -1.0)).ravel()):
                batch.frame[k] = _turned(ends.frame, part * turns[k // 2])
        for k in range(2 * len(q)):
            for name, x in moved.items():
                getattr(self._tried, name)[:] = x[k]
            self._work.report[:] = 0.0
            here = ends if turns is None else ends._replace(frame=batch.frame[k].copy())
            assembly(self._line, self.here.sea, here, self._tried, 0.0, 0.0, self._work)
            batch.report[k] = self._work.report
            if self._tried.layers.size:
                load_layers(self._line, here, self._tried, self._work)
                batch.layers[k] = self._tried.layers
        found = self._of_states(batch)
        return self._slopes(found[::2], found[1::2], steps)

    def by_scene(self, lines: Sequence[tuple[Beside, Floats]], steps: Floats) -> Floats:
        """(P, W) derivatives of results of this state by numbers, by steps (P,).

        lines: with more and with less of each number, in turn, and their reports.
        """
        found = np.tile(self._values, (len(lines), 1))  # of the line here
        groups: dict[int, list[int]] = {0: [], 1: []}  # on the nodes here, and on others that are as many
        for k, (x, _) in enumerate(lines):
            if x is self.here:
                continue
            if (moved := self._looked_at_with(x)) is not None:
                groups[moved].append(k)
                continue
            observer = self._observed(x)
            values = observer.values_of(observer.observation(self._output(*lines[k])))
            found[k] = self._results(values, [(observer.s, x.model.line.s)])
        for moved, each in groups.items():
            if len(each) < 2 * MANY or self._near is None:
                found[each] = self._of_lines([lines[k] for k in each], bool(moved)) if each else found[each]
                continue
            stretch, near = self._near
            short = [(x._replace(model=stretch.model(x.model, VARIES)), y) for x, y in (lines[k] for k in each)]
            found[each] = near._of_lines(short, bool(moved))
        return self._slopes(found[::2], found[1::2], steps)

    def _of_lines(self, lines: Sequence[tuple[Beside, Floats]], moved: bool) -> Floats:
        """(n, W) of this state on lines, with their reports; moved: whether their nodes are not those here."""
        batch = _repeated(self._output(self.here, self._work.report), len(lines))
        for k, (x, report) in enumerate(lines):
            ends = self._held_ends(x)
            batch.report[k] = report
            for name in Ends._fields:
                getattr(batch, name)[k] = getattr(ends, name)
        varied = {name: np.stack([getattr(x.model.line, name) for x, _ in lines]) for name in VARIES[not moved :]}
        batch, observer = batch._replace(h=varied["h"], kb=varied["kb"]), self._observer
        places = [(observer.s, self.model.line.s)] * len(lines)
        if moved:
            points = np.stack([self._points(x.model) for x, _ in lines])
            observer = observer.on_varied(self.model.line, self.here.sea, self.model.zones, varied["s"], points)
            places = list(zip(points, varied["s"], strict=True))
        return self._results(observer.values_of(observer.observation(batch, varied)), places)

    def _looked_at_with(self, x: Beside) -> int | None:
        """In what a line differs from the one here.

        0: in what may differ among outputs that are observed together; 1: and in the places of its nodes; None: in
        more.
        """
        line, here, model = x.model.line, self.model.line, self.model
        if x.sea is not self.here.sea or self._observer.quantities is not None:
            return None
        more = (line.law, line.bend_law, line.torsion, line.tension_torque, line.wake_law, line.slip_law)
        same = line.bits == here.bits and all(np.array_equal(getattr(line, y), getattr(here, y)) for y in SAME)
        # beside ends of catenaries the observer knows how stiff a rod would be
        same &= bool(here.spin.all()) or np.array_equal(x.model.cable.B, model.cable.B)
        if any(a.size for a in more) or not same:
            return None
        if np.array_equal(line.s, here.s):
            return 0 if x.model.zones == model.zones else None
        plain = not x.model.attached and x.model.cable.bounds.size == 2 and len(model.zones) == 1
        return 1 if plain and self._points(x.model).size == self._observer.s.size else None

    def _points(self, model: Model) -> Floats:
        """Where results are looked at, m: at nodes where extremes are wanted, and at places."""
        at = [min(place, model.length) for place in self._at]
        return np.unique(np.concatenate([model.line.s, at] if self._nodes else [at]))

    def _observed(self, x: Beside) -> Observer:
        """What looks at a line, at its nodes where extremes are wanted, and at places."""
        points = output_points(x.scene)._replace(s=self._points(x.model))
        observer = observer_of(x.scene, x.model, False, points=points)
        for wanted in self.wanted:
            if wanted.name not in observer.names:
                names = ", ".join(sorted(name for name in observer.names if "/" not in name))
                raise SceneError([Complaint("of", wanted.name, f"one of {names}", "tension@0")])
        return observer.of([wanted.name for wanted in self.wanted])

    def _slopes(self, more: Floats, less: Floats, steps: Floats) -> Floats:
        """(P, W) derivatives of results that are these with more and with less, by steps (P,), of each number.

        A force at an end that lies at the edge of the bed may jump by the rounding of its place.  Where differences to
        both sides disagree, the least of them and of their mean is the one without a jump.
        """
        above, below = more - self._values, self._values - less
        mean = 0.5 * (above + below)
        every = np.stack([mean, above, below])
        small = np.take_along_axis(every, np.abs(every).argmin(axis=0)[None], axis=0)[0]
        rough = np.abs(above - below) > KINK * (np.abs(above) + np.abs(below)) + ROUGH * np.abs(self._values)
        return np.asarray(np.where(rough, small, mean) / steps[:, None])

    def _of_states(self, batch: Batch) -> Floats:
        """(n, W) of outputs of the line."""
        places = [(self._observer.s, self.model.line.s)] * batch.t.size
        return self._results(self._observer.values_of(self._observer.observation(batch)), places)

    def _output(self, x: Beside, report: Floats) -> Batch:
        """This state on a line."""
        ends = self._held_ends(x)
        state = self.state._replace(layers=self.state.layers.copy())
        load_layers(x.model.line, ends, state, self._work)
        return batch_of_one(0.0, ends, state, report, np.zeros(len(POWERS)), x.sea)

    def _held_ends(self, x: Beside) -> Ends:
        """Ends of a line; one at a free point counts as held, by it."""
        held, position = x.ends.held.copy(), x.ends.position.copy()
        held[self._free] = 1
        for k in self._free:
            position[k] = self.state.r[-k]
        return x.ends._replace(held=held, position=position)

    def _results(self, values: Mapping[str, Floats], places: Sequence[tuple[Floats, Floats]]) -> Floats:
        """(n, W) of what is wanted, of values of n outputs; places: of each, arc lengths of values and of nodes, m."""
        out = np.zeros((len(places), len(self.wanted)))
        for k, (s, nodes) in enumerate(places):
            for j, x in enumerate(self.wanted):
                out[k, j] = self._result(x, s, nodes, np.asarray(values[x.name][k], float))
        return out

    def _result(self, x: Wanted, s: Floats, nodes: Floats, value: Floats) -> float:
        """One result; an extreme is that of the place, among nodes, where it is in the equilibrium."""
        dims, value = self._observer.dims(x.name), x.component(value)
        if "edge" in dims:  # where contact begins and ends: the last of them
            return float(np.append(np.nan, value[np.isfinite(value)])[-1])
        if "s" not in dims:
            return float(value)
        if x.over:
            peak = self._peak_of[x]
            return float(peak.weights @ value[np.searchsorted(s, nodes[peak.nodes])])
        assert x.at is not None
        return float(np.interp(x.at, s, value))


def _at_rest(line: Line) -> Line:
    """A line without what does not act at rest, or depends on the way there."""
    if not line.bits & LEFT_OUT and not line.torsion.size:
        return line
    return line._replace(bits=line.bits & ~LEFT_OUT, torsion=line.torsion[:0])


def _without_rates(state: State) -> State:
    """A copy at rest, as a line without zones that a torque passes through has it, on soil as it was first."""
    still = state.copy()
    for rate in (still.v, still.a, still.vd, still.w, still.wa, still.wd, still.slip, still.soil):
        rate[:] = 0.0
    return still._replace(turn=still.turn[:0])


def _repeated(batch: Batch, count: int) -> Batch:
    """A batch of one output so many times."""
    rows: Any = [np.repeat(x, count, axis=0) if len(x) == 1 else x for x in batch]
    return Batch(*rows)


def moment_on_body(report: Floats, k: int) -> Floats:
    """Moment (3,) N m of the clamped end k of a line on what holds it."""
    return np.asarray(report[MOMENT_A + 3 * k : MOMENT_A + 3 * k + 3] * (1.0 - 2.0 * k))


def _turned(frames: Floats, turns: Floats) -> Floats:
    """Frames (2, 9) turned by small angles (2, 3) rad."""
    return np.stack([(rotation(n) @ x.reshape(3, 3)).ravel() for x, n in zip(frames, turns, strict=True)])


def steps_along(state: State, q: Floats, turns: Floats | None = None) -> Floats:
    """Factors (P,) of movements q (P, N+1, 5), turns (P, 2, 3).

    With them chords and tensions change by a part ALONG.
    """
    chord = np.linalg.norm(np.diff(q[:, :, 1:4], axis=1), axis=2) / np.linalg.norm(state.e, axis=1)
    tension = np.abs(q[:, :, 0]) / max(float(np.abs(state.T).max()), 1e-300)
    most = np.maximum(np.maximum(chord.max(axis=1), tension.max(axis=1)), np.abs(q[:, :-1, 4]).max(axis=1))
    if turns is not None:
        most = np.maximum(most, np.abs(turns).max(axis=(1, 2)))
    return np.asarray(ALONG / np.maximum(most, 1e-300))


def displaced(state: State, q: Floats, steps: Floats) -> dict[str, Floats]:
    """Positions, chords, tensions and directors (P, ..) of a state that is moved by steps (P,) times q (P, N+1, 5)."""
    q = steps[:, None, None] * q
    e = state.e + np.diff(q[:, :, 1:4], axis=1)
    d = e / np.linalg.norm(e, axis=2, keepdims=True)
    a = state.a1 - (state.a1 * d).sum(axis=2, keepdims=True) * d
    a = a + q[:, :-1, 4:] * np.cross(d, a)
    a /= np.maximum(np.linalg.norm(a, axis=2, keepdims=True), 1e-300)
    return {"r": state.r + q[:, :, 1:4], "e": e, "T": state.T + q[:, 1:, 0], "a1": a}


# A line at rest without most of the nodes on which its results do not depend.
#
# What results ask for stands beside their places and beside the ends.  Of what lies in between one cell is left, whose
# numbers mean nothing.

# Nodes that stay to either side of a place and beside ends; and beside what cuts the line.
REACH, BESIDE_CUTS = 8, 2
# Part of the nodes that stay, at most: else it does not pay.
WORTH = 0.5


class Stretch:
    """Which nodes (n,) and cells (n-1,) of a line stay."""

    def __init__(self, nodes: np.ndarray) -> None:
        self.nodes, self.cells = nodes, nodes[:-1]
        self._gaps = np.flatnonzero(np.diff(nodes) > 1)

    def line(self, line: Line, names: Sequence[str] = tuple(FIELDS)) -> Line:
        """The line; names: fields that are cut, others stay as long as they were."""
        found = {name: getattr(line, name) for name in names}
        cut = {name: x[self.nodes if FIELDS[name].of_node else self.cells] for name, x in found.items() if x.size}
        cut["h"][self._gaps] = np.diff(cut["s"])[self._gaps]
        out: Line = line._replace(**cut)
        return out

    def model(self, model: Model, names: Sequence[str] = tuple(FIELDS)) -> Model:
        """A model with the line."""
        return replace(model, line=self.line(model.line, names))

    def state(self, state: State) -> State:
        """The state, with straight chords over what is left out."""
        n = len(state.r)
        rows = [x[self.nodes] if x.shape[0] == n else x[self.cells] if x.shape[0] == n - 1 else x.copy() for x in state]
        out = State(*rows)
        out.e[self._gaps] = np.diff(out.r, axis=0)[self._gaps]
        return out


def stretch_of(model: Model, places: Sequence[int]) -> Stretch | None:
    """What stays beside nodes where results stand; None: too little could be left out."""
    s = model.line.s
    stays = np.zeros(s.size, bool)
    cuts = [*model.cable.bounds, *model.attached, *(x for zone in model.zones for x in (zone.s_a, zone.s_b))]
    for reach, nodes in ((REACH, [0, s.size - 1, *places]), (BESIDE_CUTS, [int(np.abs(s - x).argmin()) for x in cuts])):
        for i in nodes:
            stays[max(i - reach, 0) : i + reach + 1] = True
    return Stretch(np.flatnonzero(stays)) if stays.mean() <= WORTH else None


def anywhere(state: State, size: int) -> Floats:
    """(1, N+1, size) a movement of all unknowns that stretches and turns all cells alike."""
    scale = np.ones(size)
    scale[0], scale[1:4] = np.abs(state.T).max() or 1.0, np.linalg.norm(state.e, axis=1).mean()
    out = np.random.default_rng(1).uniform(0.5, 1.0, (1, len(state.r), size)) * scale
    out[:, 1::2] *= -1.0  # else nodes would go along with their neighbours
    return np.asarray(out)


# Nodes to either side of a place on which a result there may depend, tried in turn; then it is all of the line.
REACHES = (2, 5)
# What the others may change of a result, as a part of the most that one unknown changes by a movement as large.
OUTSIDE = 1e-8


class Gradients:
    """Of all results of a line: by its unknowns, and by turns of its ends."""

    def __init__(self, line: LineAtRest, turning: Sequence[int] = ()) -> None:
        """turning: ends whose frames turn with what they are joined to."""
        self._line, self._turning = line, list(turning)
        self._every = np.ones((line.model.line.s.size, SIZE), bool)
        self._every[0, 0] = self._every[-1, -1] = False  # there is no cell before the first node, nor behind the last

    def pay_for(self, numbers: int) -> bool:
        """Whether so many numbers are more than the unknowns that are moved, each of which costs what a number does."""
        turned = 3 * len(self._turning)
        fewest = int(np.count_nonzero(self._near(REACHES[0]))) + turned
        return numbers > fewest and numbers > int(np.count_nonzero(self._moved)) + turned

    @cached_property
    def by_unknowns(self) -> Floats:
        """(W, N+1, 5) per m of positions, per N of tensions, per rad of spins."""
        out = np.zeros((len(self._line.wanted), *self._every.shape))
        out[:, self._moved] = self._line.by_state(_each(self._moved)).T
        return out

    @cached_property
    def by_turns(self) -> Floats:
        """(W, 2, 3) per rad, by turns of the ends."""
        out = np.zeros((len(self._line.wanted), 2, 3))
        for k in self._turning:
            turns = np.zeros((3, 2, 3))
            turns[:, k] = np.eye(3)
            out[:, k] = self._line.by_state(np.zeros((3, *self._every.shape)), turns).T
        return out

    def _near(self, reach: int) -> np.ndarray:
        """Which unknowns (N+1, 5) are within a number of nodes of the places of results."""
        near = np.zeros(len(self._every), bool)
        for i in self._line.near():
            near[max(i - reach - 1, 0) : i + reach + 1] = True
        return np.asarray(self._every & near[:, None])

    @cached_property
    def _moved(self) -> np.ndarray:
        """Which unknowns (N+1, 5) are moved."""
        return next((x for x in map(self._near, REACHES) if self._suffices(x)), self._every)

    def _suffices(self, moved: np.ndarray) -> bool:
        """Whether results depend on these unknowns and on no other one."""
        line, others, q = self._line, self._every & ~moved, _each(moved)
        most = np.abs(line.by_state(q) * steps_along(line.state, q)[:, None]).max(axis=0)
        far = anywhere(line.state, SIZE) * others
        change = np.abs(line.by_state(far)[0] * steps_along(line.state, far)[0])
        return bool((change <= OUTSIDE * most).all())


def _each(moved: np.ndarray) -> Floats:
    """(D, N+1, 5) movements of one unknown each."""
    q = np.zeros((int(np.count_nonzero(moved)), *moved.shape))
    q[(np.arange(len(q)), *np.nonzero(moved))] = 1.0
    return q


# Solves with the matrix of an equilibrium and its transpose, to rounding of the matrix.


class Factors:
    """Factors of a sparse matrix.

    Each solve is corrected once by what it leaves: rows in N beside rows in m and N m would else lose three digits of
    what hardly answers.
    """

    def __init__(self, matrix: sparse.csc_array) -> None:
        self._matrix, self._factors = matrix, splu(matrix)

    def solve(self, right: Floats, transposed: bool = False) -> Floats:
        """x (n, P) of A x = right, or of its transpose."""
        matrix, kind = (self._matrix.T, "T") if transposed else (self._matrix, "N")
        x = self._factors.solve(right, kind)
        return np.asarray(x + self._factors.solve(right - matrix @ x, kind))
