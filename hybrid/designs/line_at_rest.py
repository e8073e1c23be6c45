"""One line at rest: its residuals when its scene changes, and its results."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Any, NamedTuple, cast

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import splu

from hybrid.designs.numbers_and_results import Wanted
from hybrid.errors import Complaint, SceneError
from hybrid.kernels.algebra.block_elimination import SIZE, WIDTH
from hybrid.kernels.march.assembly import JOINED
from hybrid.kernels.march.zone_torque import TORQUE
from hybrid.kernels.run.newton import assembly, workspace_of
from hybrid.kernels.state.report import FRICTION, MOMENT_A, NET_A, PLANAR, WAVES
from hybrid.kernels.state.state import Batch, Ends, Floats, Line, Sea, State, batch_of_one, slip_size
from hybrid.linear.matrices import ANCHOR, load_layers
from hybrid.model.build import Model
from hybrid.model.ends import rotation
from hybrid.model.sections import SAME_PLACE, jump_points, output_points
from hybrid.outputs.probes import Observer
from hybrid.scene.schema import LineScene
from hybrid.simulation.run_line import observer_of
from hybrid.solve.stepper import POWERS

# How far a state is moved to differentiate its results: a part of chords, and of the largest tension.
ALONG = 1e-5
# Differences to both sides that are unequal by this part of them, and this part of the result, are of a jump.
KINK, ROUGH = 0.3, 1e-7
# Forces that do not act at rest, or depend on the way there; and a plane has block rows of its own.
LEFT_OUT = PLANAR | WAVES | FRICTION
# Of lines that are looked at together what has to be the same, and what results ask for that may differ.
SAME, VARIES = ("element", "spin"), ("s", "h", "hn", "k0", "kb", "ck", "mass", "force", "rotary", "polar")
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
        self,
        scene: LineScene,
        model: Model,
        state: State,
        wanted: Sequence[Wanted],
        free: Sequence[int] = (),
        frames: Frames = NO_FRAMES,
    ) -> None:
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
        self._line = at_rest_alone(model.line)
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
        assembly(at_rest_alone(x.model.line), x.sea, x.ends, self._still, 0.0, ANCHOR, work)
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

    def by_state(self, q: Floats, turns: Floats | None = None) -> Floats:
        """(P, W) derivatives of results along movements (P, N+1, 5) of the state.

        turns: (P, 2, 3) rad, of the frames of ends; None: they stay.
        """
        steps = steps_along(self.state, q, turns)
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
        places = [(self._observer.s, self.model.line.s)] * batch.t.size
        found = self._results(self._observer.values_of(self._observer.observation(batch)), places)
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
            if each:
                found[each] = self._of_lines([lines[k] for k in each], bool(moved))
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

    def _output(self, x: Beside, report: Floats) -> Batch:
        """This state on a line."""
        ends = self._held_ends(x)
        state = self.state._replace(layers=self.state.layers.copy())
        load_layers(x.model.line, ends, state, self._work)
        return batch_of_one(0.0, ends, state, report, np.zeros(len(POWERS)), x.sea)

    def _held_ends(self, x: Beside) -> Ends:
        """Ends of a line; one at a free point counts as held, by it."""
        held, position = x.ends.held.copy(), x.ends.position.copy()
        held[self._free] = JOINED
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


def at_rest_alone(line: Line) -> Line:
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


class Factors:
    """Factors of the matrix of an equilibrium, to rounding of the matrix.

    Each solve is corrected once by what it leaves: rows in N beside rows in m and N m would else lose three digits of
    what hardly answers.
    """

    def __init__(self, matrix: sparse.csc_array) -> None:
        self._matrix, self._factors = matrix, splu(matrix)

    def solve(self, right: Floats) -> Floats:
        """x (n, P) of A x = right."""
        x = self._factors.solve(right)
        return np.asarray(x + self._factors.solve(right - self._matrix @ x))
