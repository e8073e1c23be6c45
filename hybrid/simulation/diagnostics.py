"""Checks during a run: whatever makes a result doubtful without stopping the computation.

Each watch writes an event when something shows first and again when it has become much
worse; what makes going on pointless is returned as an Outcome, with its node or cell.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from hybrid.errors import Outcome
from hybrid.kernels.laws.obstacles import (
    bend_radii,
    cells_met,
    depths_in_obstacles,
    distances,
    half_thickness,
    put_obstacles,
)
from hybrid.kernels.laws.seabed import planes_under
from hybrid.kernels.march.resolution_checks import lowest
from hybrid.kernels.state import books as b
from hybrid.kernels.state.books import Books, Clock
from hybrid.kernels.state.report import (
    BEND,
    FLAT,
    FRICTION,
    KIND,
    OBSTACLES,
    PLANAR,
    RIDES,
    SEABED,
    SELF_CONTACT,
    TWIST_NODE,
)
from hybrid.kernels.state.state import Batch, Floats, Line, Sea, State
from hybrid.kernels.step.accept import LARGEST_TWIST
from hybrid.model.build import Model, as_kept
from hybrid.model.initial_shape import HUNG
from hybrid.model.obstacles import CELLS_PER_RADIUS
from hybrid.outputs.observation import JoinedObservation, Observation, Output
from hybrid.scene.plane import OUT
from hybrid.simulation import watches
from hybrid.simulation.events import (
    TURNS,
    EventLog,
    borne_strain,
    kinks_at,
    most_stretched,
    slack_text_of,
    too_long_for_weight,
    turns_by_weight,
    weight_text,
)
from hybrid.simulation.mesh_survey import ASKEW, hidden_layer, layer_text
from hybrid.simulation.watches import (
    NEWTON_LEAVES,
    Knot,
    Loops,
    SchemeWatch,
    Stop,
    note_departures,
    note_hockling,
    note_knot,
    note_loops,
    sheaves_of,
)
from hybrid.solve.stability import TOUCHING, behind_obstacles, is_stable, obstacles_left, passed_obstacles, rubs_on

# A rod that bends or twists by more than this (rad) from one cell to the next is not resolved by its mesh.
UNRESOLVED = 1.0
# The same part of it of zones that move: where they neglect bending, or repeat a step, a bend comes out some percent
# milder than that of rods on the same cells, which is not to decide whether it is told.
OF_ZONES_THAT_MOVE = 0.8
# What a catenary sags below the chord of a cell, as a part of the line's length, beyond which its shape is poor.
OFF = 0.02
# A turn at the joint of a rod and a catenary beyond the bend on its sides, rad: 20 deg, which a picture shows.  Zones
# that move stay below, because they take a catenary where bending would move the line little.
KINK = 0.35
# A tension below 0 by this part of the largest, between cells of a catenary that are all taut, is none of the line's.
# It is told where the line turns by more than so much, rad, from cell to cell: fronts of tension waves are no bends.
NEGATIVE, TURNS_A_LITTLE = 0.01, 0.3
NOTHING = 1e-6  # of the tension scale: of a line without tension there is no part
# Depth in the seabed, as a part of the line's length, that no bed of real soil allows.
SUNK = 0.01
# A rod of an equilibrium is in compression by more than this part of its largest force, or of the tension of its scene.
COMPRESSED = 1e-4
# A bend at a clamp that falls by more than this part to the next node is a boundary layer.
LAYER = 0.5
# A jump of tension within a step, as a part of the largest that anything in the scene can ask for.
SNAP = 3.0
NOWHERE: Floats = np.zeros((0, 3))
NEVER = 1e300  # s, when nothing was noted
# What a checkpoint holds of it as plain values.
REMEMBERED: tuple[str, ...] = ("_bend", "_twist", "_slack", "_fold", "_sunk", "_within", "_round", "_between", "_off")
REMEMBERED += ("_jump", "_loop", "_writhe", "_writhes", "_section", "_kink", "_weight", "_lay")
REMEMBERED += ("_knot", "_bent", "_negative", "_noted_bends")


class LineStep(NamedTuple):
    """A line after a step."""

    t: float  # s
    state: State
    before: State
    report: Floats  # (REPORT_SIZE,) of the state (kernels.state.report)
    books: Books


class Diagnostics:
    """What is watched in one run or one static solve."""

    def __init__(self, model: Model, events: EventLog) -> None:
        self.events, self._model, self._longest = events, model, 1.0 + borne_strain(model)
        self._sharp = UNRESOLVED * (OF_ZONES_THAT_MOVE if model.layout is not None else 1.0)
        self._bend = self._sharp
        self._fold, self._twist, self._slack = self._bend, UNRESOLVED, model.slack_floor
        self._sunk = SUNK * model.length
        self._within, self._round, self._between = 1.0, False, False
        # s, when a bend was noted first at the start, the end and point loads: outputs are looked at after later steps
        self._noted_bends: Floats = np.full(2 + len(model.attached), NEVER)
        self._off = OFF * model.length
        self._section = self._weight = False
        self._jump = SNAP * model.tension_scale  # N
        self.of_scheme = SchemeWatch(model, events)
        self._kink, self._negative = KINK, NEGATIVE
        self._knot, self._lay = [*Knot()], np.full((len(sheaves_of(model.sea.values)), 2), np.nan)
        self._loop, (self._writhe, self._writhes, self._bent) = 1.0, Loops()

    def begin(self) -> None:
        """Note what the contents of the model warn of."""
        for entry in self._model.contents:
            if entry.event:
                s_a, s_b = entry.s or (0.0, self._model.length)
                self.events.event(0.0, s_a, s_b, entry.event, f"{entry.what}: {entry.why}")

    def checkpoint(self, books: Books) -> dict[str, Any]:
        """What has been noted so far, and what `finish` will judge by."""
        clock, count = books.clock, books.counts
        known = {name: getattr(self, name) for name in REMEMBERED}
        known |= {name: getattr(self.of_scheme, name) for name in watches.REMEMBERED}
        known |= {"pulls": [float(clock.least_peak), float(clock.largest_peak)], "_rho": float(clock.rho)}
        known |= {"_moved": float(clock.moved), "_steps": int(count.measured), "placed": books.placed}
        return known | {"worst": books.worst[: min(int(count.measured), b.WORST)].copy()}

    def restore(self, saved: Mapping[str, Any], books: Books, r: Floats) -> Floats:
        """Go on as `checkpoint` has written; ValueError where that cannot be.

        r: (N+1, 3) m, where nodes are now.  Returns where base nodes were at the start, (n, 3) m.
        """
        vars(self).update({name: saved[name] for name in REMEMBERED})
        vars(self.of_scheme).update({name: saved[name] for name in watches.REMEMBERED})
        placed, worst, steps = saved["placed"], saved["worst"], saved["_steps"]
        if placed.shape not in (NOWHERE.shape, (books.base.size, 3)) or worst.shape != (min(steps, b.WORST), 4):
            raise ValueError("places of another line")
        books.worst[: len(worst)] = worst
        books.clock.least_peak, books.clock.largest_peak = saved["pulls"]
        books.clock.moved = saved["_moved"]
        books.counts.measured = steps
        self.watch(books.clock)
        return placed if placed.size else r[books.base].copy()

    def use_model(self, model: Model) -> None:
        """Watch the same line with other zones."""
        if model is not self._model:
            self._model, self._longest = model, 1.0 + borne_strain(model)

    def _places(self, line: Line) -> NDArray[np.int64]:
        """Nodes of `_noted_bends`."""
        loads = [int(np.argmin(np.abs(line.s - at))) for at in self._model.attached]
        return np.array([0, line.h.size, *loads])

    def _note_bend(self, t: float, node: int, bend: float, tension: Floats, line: Line) -> None:
        """A rod bends by an angle (rad) at a node more than its cells show."""
        self.note(t, node, "unresolved bend", self._bend_text(node, bend, tension, line), line)
        here = self._places(line) == node
        self._noted_bends[here] = np.minimum(self._noted_bends[here], t)

    def note(self, t: float, node: int, kind: str, text: str, line: Line | None = None) -> None:
        """An event at a node; line: as it was at t, None: as it is now."""
        s = float((line or self._model.line).s[node])
        self.events.event(t, s, s, kind, text)

    def friction_neglected(self, state: State, key: str, shares: bool = False, not_settled: str = "") -> None:
        """Of an equilibrium without friction that touches what has some; key: of the scene, that asks for it.

        shares: whether the line touches others.  Beside these, and what moves, friction settles in a motion alone.
        not_settled: why it has not where the scene leaves that to the program.
        """
        line = self._model.line
        on = rubs_on(line, self._model.sea.values, self._model.ends.values.held, state)
        if not line.bits & FRICTION or not on:
            return
        text = f"this equilibrium is the one without friction {' and '.join(on)}: "
        if shares or line.moved.size:
            text += "a run with damping that comes to rest has it"
        elif not_settled:
            text += f"none was found that is pulled tight from where the line lay without tension ({not_settled})"
        else:
            if self._model.payout is not None or line.bits & SELF_CONTACT:
                text += "what is paid out or forms loops was laid under tension; "
            text += f"say `{key}: {{kind: equilibrium, friction: settled}}` for one that lies where it was laid"
        self.events.event(0.0, 0.0, self._model.length, "static friction neglected", text)

    def within_plane(self, state: State, with_friction: bool) -> None:
        """An event where an equilibrium that the scene wants in a plane holds within that alone."""
        model = self._model
        line, sea, ends = as_kept(model.line, model.plane, model.kept_in), model.sea.values, model.ends.values
        judged = line if with_friction else line._replace(bits=line.bits & ~FRICTION)
        if line.bits & PLANAR and not is_stable(judged, sea, ends, state, model.length, model.tension_scale):
            text = "this equilibrium holds within the plane alone: in space (`dimension: 3`) the cable would leave it"
            self.note(0.0, int(np.argmin(state.T)), "out of plane", text)

    def note_at_rest(self, pushed: bool, slack: int, state: State) -> None:
        """An equilibrium beside one that is not stable, or with a slack catenary cell (-1: none)."""
        if pushed:
            text = (
                "the line was pushed off an equilibrium that is not stable, to one side: on the other it may rest as "
            )
            text += "well, as a mirror image, and which is found depends on the mesh; initial.points near one choose it"
            self.events.event(0.0, 0.0, self._model.length, "several equilibria", text)
        if slack >= 0:
            s, tension = float(self._model.line.s[slack]), float(state.T[slack])
            text = f"the only equilibrium found has a tension of {tension:.3g} N in a catenary at s = {s:g} m"
            self.note(0.0, slack, "slack", f"{text}: it stands like a strut, which no cable does")
        else:
            self.tension(0.0, state)
        self._compressed(state)
        if (lies := slack_text_of(self._model, state)) is not None:
            self.events.event(0.0, lies[0], lies[1], "slack", lies[2])
        if self._model.line.bits & OBSTACLES:
            if self._model.start_shape == HUNG:
                self._lies_behind(state)
            else:
                self._has_left(state)

    def _compressed(self, state: State) -> None:
        """Rods that are in compression, which a rope or chain would not be."""
        line = self._model.line
        most = COMPRESSED * max(float(np.abs(state.T).max()), self._model.tension_scale)
        pushed = (line.spin == 1) & (state.T + most < 0.0)
        if not pushed.any():
            return
        cells, worst = np.flatnonzero(pushed), int(np.argmin(np.where(pushed, state.T, np.inf)))
        text = (
            f"{float(line.h[cells].sum()):.3g} m of rod are in compression in this equilibrium, most at s = "
            f"{float(line.s[worst]):.4g} m: {float(state.T[worst]):.3g} N; their bending stiffness carries it; where a "
            f"rope or chain is meant, change its length or its ends"
        )
        self.events.event(0.0, float(line.s[cells[0]]), float(line.s[cells[-1] + 1]), "compression", text)

    def _lies_behind(self, state: State) -> None:
        """An obstacle on the side of which the line was not begun that is away from the straight span of its ends."""
        line, sea = self._model.line, self._model.sea
        for which, node in behind_obstacles(line, sea.values, state):
            text = (
                f"the line lies on the side of obstacle {sea.names[which]} that is away from the straight span of its "
                f"ends, at s = {line.s[node]:g} m: on the other it may rest as well, and which is found depends on the "
                f"mesh; initial.points near one choose it"
            )
            self.note(0.0, node, "several equilibria", text)

    def _has_left(self, state: State) -> None:
        """An obstacle on which the shape given lies, and the equilibrium does not; one that is between both."""
        line, sea, start = self._model.line, self._model.sea, self._model.start
        left = list(obstacles_left(line, sea.values, start, state))
        for which, node in passed_obstacles(sea.values, start.r, state.r):
            if which not in [x for x, *_ in left]:
                text = (
                    f"obstacle {sea.names[which]} is between the shape given and this equilibrium at s = "
                    f"{line.s[node]:g} m: a line that has not slid off its end has passed through it; initial.points "
                    f"nearer to an equilibrium choose one"
                )
                self.note(0.0, node, "several equilibria", text)
        for which, node, behind in left:
            now = "lies on its other side" if behind else "does not touch it"
            text = (
                f"the shape given lies on obstacle {sea.names[which]} at s = {line.s[node]:g} m, and this equilibrium "
                f"{now}: on this mesh none was found there; more cells, or initial.points nearer to one, "
                f"may lead to it"
            )
            self.note(0.0, node, "several equilibria", text)

    def shape(self, t: float, sharp: Sequence[float], state: State) -> Stop:
        """Bends and twists that the mesh does not resolve; `sharp`: what kernels.run.newton.sharpest has found."""
        bend, twist = sharp[0], sharp[2]
        if bend <= self._bend and twist <= min(self._twist, LARGEST_TWIST):
            return None
        node, twisted = int(sharp[1]), int(sharp[3])
        if bend > self._bend:
            self._note_bend(t, node, bend, state.T, self._model.line)
            self._bend = 1.5 * bend
        if twist > self._twist:
            text = f"a twist of {np.degrees(twist):.0f} deg to the next cell: add cells, or torque may be wrong"
            self.note(t, twisted, "unresolved twist", text)
            self._twist = 1.5 * twist
        return (Outcome.TWISTED_TOO_FAR, twisted) if twist > LARGEST_TWIST else None

    def _bend_text(self, node: int, bend: float, T: Floats, line: Line) -> str:
        s, cell = float(line.s[node]), min(node, line.h.size - 1)
        first, tension = float(line.h[cell]), float(T[cell])
        stiffness = float(line.kb[node, :2].max() * line.hn[node])
        leaving = float(np.sqrt(stiffness / tension)) if tension > 0.0 else np.inf
        place = "the cable leaves its end" if node in (0, line.s.size - 1) else "the cable leaves its point load"
        if leaving <= first and (bend < self._sharp or node in (0, line.s.size - 1)):
            finer = 0.25 * leaving
            how = f"{place} at s = {s:g} m within {leaving:.2g} m, less than its cell of {first:.2g} m"
        elif 0 < node < line.s.size - 1:
            finer = 0.3 * float(line.hn[node]) / bend
            how = f"the bend at s = {s:g} m is sharper than the mesh ({np.degrees(bend):.0f} deg to the next cell)"
        else:
            finer = 0.3 * first / bend
            how = f"the bend at the end s = {s:g} m is sharper than the mesh"
        return f"{how}: curvature and moment are wrong there; cells of {finer:.2g} m would do ({self._asks(cell)})"

    def _asks(self, cell: int, fixed: str = "`mesh.nodes` or `ratio`") -> str:
        """The keys that make cells shorter; fixed: those of cells that stay."""
        layout, paid = self._model.layout, self._model.payout
        if layout is not None and paid is not None and paid.follows and layout.parts[layout.base_of_cell[cell]] == 1:
            return "`mesh.cells`: those at the winch stay whole"
        return "`model.rod_cell`" if layout is not None and layout.parts.max() > 1 else fixed

    def scheme(self, rho: float) -> None:
        """A time scheme that damps nothing."""
        if rho == 1.0 and not self._model.line.ck.all():
            text = "rho_inf = 1 damps nothing: the tension of an inextensible cable grows a sawtooth; 0.9 keeps it away"
            self.events.event(0.0, 0.0, self._model.length, "undamped", text)

    def watch(self, clock: Clock) -> None:
        """Tell a run, by its clock, beyond which values there is something to look at."""
        model = self._model
        warns = model.slack == "warn" or bool(model.line.bits & FRICTION)  # friction may hold a compressed line
        clock.bend_limit, clock.twist_limit, clock.scaled_jump = self._bend, self._twist, self._jump
        clock.slack_limit = self._slack if warns else -np.inf

    def judge(self, step: LineStep, flags: int) -> Stop:
        """Look at what a run has flagged in its last step (kernels.state.books)."""
        t, state, stop = step.t, step.state, None
        if flags & b.JUMPED:
            jump = float(state.T.max() - step.before.T.max())
            text = (
                f"tension jumps by {jump:.3g} N within a step: what does not stretch stops at once, and the height of "
                f"such a peak depends on step and cells; give axial_stiffness"
            )
            self.note(t, int(np.argmax(state.T)), "snap", text)
            self._jump = 3.0 * jump
        if flags & b.STRETCHED:
            stop = self.stretch(state)
        if stop is None and flags & b.BENT:
            stop = self.shape(t, step.report[BEND : TWIST_NODE + 1].tolist(), state)
        if flags & b.SLACKENED:
            self.tension(t, state)
        self.watch(step.books.clock)
        return stop

    def finish(self, books: Books) -> None:
        """After the last step: whether the scheme has created energy, and steps were too long for the motion."""
        self.of_scheme.finish()
        self.of_scheme.note_coarse_steps(self._model.length, books)

    def stretch(self, state: State) -> Stop:
        """A section that is stretched or compressed beyond what it bears."""
        if self._model.inextensible:
            return None
        length, h = np.sqrt(np.einsum("ij,ij->i", state.e, state.e)), self._model.line.h
        over = (length > self._longest * h) | (length < (2.0 - self._longest) * h)
        return (Outcome.OVERSTRETCHED, most_stretched(self._model, state)) if over.any() else None

    def left_plane(self, r: Floats) -> Stop:
        """Nodes (..., N+1, 3) m of a line that is to stay in a plane, and is computed in space, that are out of it."""
        model = self._model
        if model.kept_in is None:
            return None
        out = np.abs((r - model.start.r[0]) @ model.kept_in).reshape(-1, r.shape[-2]).max(axis=0)
        return (Outcome.LEFT_PLANE, int(np.argmax(out))) if out.max() > OUT * model.length else None

    def outputs(self, seen: Observation, values: Mapping[str, Floats]) -> Stop:
        """Look at outputs as computed; values: their fields (nb, ...)."""
        if (stop := self.left_plane(seen.batch.r)) is not None:
            return stop
        self.mesh(seen)
        self.loops(seen.batch.t, values, seen.grid.s)
        self.contacts(self._model.line.s, seen.batch)
        self.of_scheme.judge_rest(self._model, seen.batch, values)
        return self.of_scheme.judge(self._model, seen.batch, values)

    def joined_outputs(
        self, seen: JoinedObservation, values: Mapping[str, Floats], lines: Sequence[tuple[Model, Output]]
    ) -> Stop:
        """Look at outputs as computed of which each has a line of its own; lines: each with a model of its cable."""
        for _, output in lines if self._model.kept_in is not None else ():
            if (stop := self.left_plane(output.batch.r)) is not None:
                return stop
        for k in np.flatnonzero(self._doubtful(seen, values)).tolist():
            model, output = lines[k]
            self.use_model(replace(model, line=output.line, zones=output.zones))
            one = seen.one(k)
            self.mesh(one)
            self.of_scheme.judge_rest(self._model, one.batch, {name: x[k : k + 1] for name, x in values.items()})
        self.loops(seen.batch.t, values, seen.points)
        for _, output in lines:
            self.contacts(output.line.s, output.batch)
        return self.of_scheme.judge(self._model, seen.batch, values, [output for _, output in lines])

    def _doubtful(self, seen: JoinedObservation, values: Mapping[str, Floats]) -> NDArray[np.bool_]:
        """Outputs (nb,) of other cells in each with something beyond a bound by which one would be noted."""
        line, begin, model = seen.line, seen.begin[:-1], self._model
        # what obstacles and changes of section hide shows in each output alone
        found = np.full(begin.size, bool(line.bits & OBSTACLES) or (not self._section and bool(seen.grid.changes)))
        inside = np.zeros(line.s.size, bool)
        inside[1:-1] = (line.spin[:-1] == 0) & (line.spin[1:] == 0)
        inside[seen.end_nodes] = False
        inside &= ~np.isin(line.s, model.attached)
        if inside.any():
            half = np.where(inside, 0.5 * seen.bends[:, 0] * line.hn, 0.0)
            found |= np.maximum.reduceat(half, begin) > np.tan(0.5 * min(self._fold, np.pi))
            found |= np.maximum.reduceat(half * line.hn, begin) > 4.0 * self._off
            found |= values["tension"].min(axis=1) < -self._negative * np.abs(values["tension"]).max(axis=1)
        joints = np.flatnonzero(line.spin[1:] != line.spin[:-1]) + 1
        joints = joints[~np.isin(joints, seen.end_nodes)]
        joints = joints[~np.isin(line.s[joints], model.attached)]
        if joints.size:
            kinked = kinks_at(joints, seen.bends, line.hn[:, None])[:, 0] > self._kink
            found[np.searchsorted(seen.begin, joints[kinked], side="right") - 1] = True
        layers = bool(model.attached) | seen.has_element(0) | seen.has_element(1)
        found |= layers
        if not self._weight:
            nodes, _, limits = too_long_for_weight(model.cable, line)
            if nodes.size:
                bent = turns_by_weight(line, seen, nodes, limits)[:, 0] > TURNS
                found[np.searchsorted(seen.begin, nodes[bent], side="right") - 1] = True
        if line.bits & SEABED:
            found |= np.maximum.reduceat(seen.depth[:, 0], begin) - 0.5 * seen.sea.onset > self._sunk
        if not self.of_scheme.rested and line.spin.any():
            least = NEWTON_LEAVES * model.tension_scale * model.length
            tension = np.where(line.spin == 1, seen.T[:, 0], np.inf)
            tension[seen.begin[1:-1] - 1] = np.inf  # of no line
            found |= np.minimum.reduceat(tension, begin) * model.length < -least
            found |= values["energy/torsion"] > least
        return found

    def loops(self, t: Floats, values: Mapping[str, Floats], s: Floats) -> None:
        """A torque that can throw a loop, and a loop, at outputs (nb,) s with fields (nb, ...) along s (ns,) m."""
        self._loop = note_hockling(self._model, t, values, s, self._loop, self.events.event)
        known = Loops(self._writhe, self._writhes, self._bent)
        self._writhe, self._writhes, self._bent = note_loops(t, values, s, known, self.events.event)

    def contacts(self, s: Floats, batch: Batch) -> None:
        """A knot that tightens, and sheaves that the line leaves, at outputs whose nodes are s (N+1,) m."""
        if batch.touch.size:
            for t, r, touch in zip(batch.t.tolist(), batch.r, batch.touch, strict=True):
                self._knot = [*note_knot(t, s, r, touch, Knot(*self._knot), self.events.event)]
        if self._lay.size:
            sea = self._model.sea
            for k, (t, r) in enumerate(zip(batch.t.tolist(), batch.r, strict=True)):
                around = self._around(batch, k)
                self._lay = note_departures(t, s, r, around, sea.names, self._lay, self.events.event)

    def _around(self, batch: Batch, output: int) -> Sea:
        """The sea with obstacles where they are at an output."""
        sea = self._model.sea.values
        if not batch.obstacles.size:
            return sea
        rows = sea.obstacles.copy()
        put_obstacles(rows, sea.carried, batch.obstacles[output])
        return sea._replace(obstacles=rows)

    def mesh(self, seen: Observation) -> None:
        """Folds that a catenary's cells do not resolve, kinks at joints of zones, and a line deep in the seabed."""
        line, batch = self._model.line, seen.batch
        flexible = (line.spin[:-1] == 0) & (line.spin[1:] == 0) & ~np.isin(line.s[1:-1], self._model.attached)
        if flexible.any():
            length = seen.of_line("hn", slice(1, -1)).T
            half = np.where(flexible, 0.5 * seen.bends.T[:, 1:-1] * length, 0.0)  # tan(x/2) of a turn by x
            for k in np.flatnonzero(half.max(axis=1) > np.tan(0.5 * min(self._fold, np.pi))).tolist():
                self._note_fold(float(batch.t[k]), 2.0 * np.arctan(half[k]), seen.line_of(k))
            for k in np.flatnonzero(
                (half * length).max(axis=1) > 4.0 * self._off
            ).tolist():  # the sag is no larger than this
                then = seen.line_of(k)
                self._note_sag(float(batch.t[k]), 2.0 * np.arctan(half[k]) * then.hn[1:-1] / 8.0, then)
            self._negative_between_cells(seen)
        self._kinks(seen)
        self._layers(seen)
        layer = None if self._section else hidden_layer(self._model, seen)
        if layer is not None:
            rod = bool(line.spin[layer.node if layer.stiffness[1] < layer.stiffness[0] else layer.node - 1])
            then = seen.line_of(layer.output)
            text = layer_text(layer, float(then.s[layer.node]), rod)
            self.note(float(batch.t[layer.output]), layer.node, "unresolved change of section", text, then)
            self._section = True
        if not self._weight:
            self._bends_by_weight(seen)
        if line.bits & SEABED:
            sea = self._model.sea.values
            depth = planes_under(sea, batch.r.reshape(-1, 3))[1].reshape(batch.r.shape[:2]) - 0.5 * sea.onset
            for k in np.flatnonzero(depth.max(axis=1) > self._sunk).tolist():
                node = int(np.argmax(depth[k]))
                if depth[k, node] > self._sunk:
                    then = seen.line_of(k)
                    text = f"the line lies {depth[k, node]:.3g} m deep in the seabed at s = {then.s[node]:g} m"
                    where = f"{text}: is its stiffness in N/m per m of cable?"
                    self.note(float(batch.t[k]), node, "deep in the seabed", where, then)
                    self._sunk = 3.0 * float(depth[k, node])
        if line.bits & OBSTACLES:
            self._obstacles(seen)

    def _obstacles(self, seen: Observation) -> None:
        """Report lines deep in an obstacle or through it, and cells too long for it.

        Cells do not follow its radius, or it may pass between their nodes.
        """
        sea, batch = self._model.sea, seen.batch
        for k, (t, r) in enumerate(zip(batch.t.tolist(), batch.r, strict=True)):
            line, around = seen.line_of(k), self._around(batch, k)
            longest = np.maximum(np.append(line.h, 0.0), np.append(0.0, line.h))
            met = cells_met(sea.values.carried, line.s) if sea.values.carried.size else None
            rows = around.obstacles
            within = depths_in_obstacles(around, r, line.s, met)
            which, node = (int(i) for i in np.unravel_index(np.argmax(within), within.shape))
            if within[which, node] > self._within:
                rides = bool(sea.values.carried.size) and sea.values.carried[which, RIDES] != 0.0
                key = f"bodies.{sea.names[which]}.shape" if rides else f"obstacles.{sea.names[which]}"
                text = (
                    f"the line is {within[which, node]:.2g} of its radii deep in obstacle {sea.names[which]} at s = "
                    f"{line.s[node]:g} m, or has passed through it between two nodes: make "
                    f"{key}.stiffness larger, time.step smaller or add cells"
                )
                self.note(t, node, "deep in an obstacle", text, line)
                self._within = 3.0 * float(within[which, node])
            if self._round:
                continue
            coarse = (within > -TOUCHING) & (CELLS_PER_RADIUS * longest > 1.01 * bend_radii(rows)[:, None])
            coarse &= (rows[:, KIND] != FLAT)[:, None]
            if coarse.any():
                which, node = (int(i) for i in np.argwhere(coarse)[0])
                name, radius = sea.names[which], bend_radii(rows)[which]
                text = (
                    f"cells of {longest[node]:.2g} m lie on obstacle {name} at s = {line.s[node]:g} m, whose radius is "
                    f"{radius:.2g} m: cells of {radius / CELLS_PER_RADIUS:.2g} m would follow it"
                )
                self.note(t, node, "unresolved bend", text, line)
                self._round = True
            elif not self._between:
                self._pass_between(t, r, around, met, line)

    def _pass_between(self, t: float, r: Floats, sea: Sea, met: Floats | None, line: Line) -> None:
        """Cells longer than an obstacle is thick, and so near to it that it may pass between their nodes untouched."""
        h, gap = line.h, distances(sea, r)
        gap = np.maximum(np.minimum(gap[:, :-1], gap[:, 1:]), 0.0)  # of the nearer node of each cell
        wide = 2.0 * half_thickness(sea.obstacles)
        missed = (h > wide[:, None]) & (gap < 0.5 * h)
        if met is not None:
            missed &= met > 0.0
        if not missed.any():
            return
        which, cell = (int(i) for i in np.argwhere(missed)[0])
        name, thick = self._model.sea.names[which], wide[which]
        text = (
            f"at s = {line.s[cell]:g} m the line is {gap[which, cell]:.2g} m from obstacle {name}, which "
            f"may pass between two nodes without touching one: cells are {h[cell]:.2g} m long, and cells of "
            f"{thick:.2g} m would meet it"
        )
        self.note(t, cell, "unresolved contact", text, line)
        self._between = True

    def _negative_between_cells(self, seen: Observation) -> None:
        """A tension below 0 in a bend of a catenary where its cell is taut: from cell to cell it goes on straight."""
        line, tension, points = self._model.line, seen.tension, seen.grid.points
        each = zip(seen.of_line("s", slice(None)).T, points.T, strict=True)
        cells = np.stack([np.clip(np.searchsorted(x, y) - 1, 0, line.h.size - 1) for x, y in each], axis=1)
        turn = 2.0 * np.arctan(0.5 * seen.bends * seen.of_line("hn", slice(None)))
        turn[1:-1] = np.maximum(turn[1:-1], np.maximum(turn[:-2], turn[2:]))  # at a node, and at those beside it
        bent = np.maximum(turn[:-1], turn[1:]) > TURNS_A_LITTLE
        there = np.take_along_axis(bent & (line.spin == 0)[:, None] & (seen.T >= 0.0), cells, axis=0)
        largest = np.maximum(np.abs(tension).max(axis=0), NOTHING * self._model.tension_scale)
        part = np.where(there, -tension, 0.0) / largest
        for k in np.flatnonzero(part.max(axis=0) > self._negative):
            at, column = int(np.argmax(part[:, k])), k if cells.shape[1] > 1 else 0
            if part[at, k] > self._negative:
                s, carried = float(points[at, column]), seen.T[cells[at, column], k]
                text = (
                    f"between cells the tension comes out as {tension[at, k]:.3g} N at s = {s:g} m, where the cell of "
                    f"a catenary carries {carried:.3g} N: too long for the bend there; add cells, or make it a rod"
                )
                self.events.event(float(seen.batch.t[k]), s, s, "unresolved bend", text)
                self._negative = 1.5 * float(part[at, k])

    def _note_fold(self, t: float, turn: Floats, line: Line) -> None:
        node = int(np.argmax(turn)) + 1
        if turn[node - 1] > self._fold:
            text = f"the catenary turns by {np.degrees(turn[node - 1]):.0f} deg from one cell to the next at s = "
            fix = f"{line.s[node]:g} m: its tension is wrong there; add cells, or make it a rod"
            self.note(t, node, "unresolved bend", text + fix, line)
            self._fold = 1.5 * float(turn[node - 1])

    def _note_sag(self, t: float, sag: Floats, line: Line) -> None:
        node = int(np.argmax(sag)) + 1
        if sag[node - 1] > self._off:
            text = f"at s = {line.s[node]:g} m the catenary sags by {sag[node - 1]:.2g} m below its chords"
            self.note(t, node, "unresolved bend", f"{text}: so far off is its shape; add cells", line)
            self._off = 3.0 * float(sag[node - 1])

    def _kinks(self, seen: Observation) -> None:
        """Turns at joints of a rod and a catenary, where no moment passes, beyond the bends at the next nodes."""
        line, batch = self._model.line, seen.batch
        joints = np.flatnonzero(line.spin[1:] != line.spin[:-1]) + 1
        joints = joints[~np.isin(line.s[joints], self._model.attached)]
        if not joints.size:
            return
        kinks = kinks_at(joints, seen.bends, seen.of_line("hn", slice(None)))
        for k in np.flatnonzero(kinks.max(axis=0) > self._kink).tolist():
            node = int(joints[np.argmax(kinks[:, k])])
            kink = float(kinks[:, k].max())
            if kink <= self._kink:
                continue
            then = seen.line_of(k)
            keys = "model.zones" if self._model.layout is None else "model.tolerance, model.force_catenary"
            text = (
                f"the rod and the catenary that meet at s = {then.s[node]:g} m form a kink of {np.degrees(kink):.0f} "
                f"deg, because their joint passes no moment: curvature and moment of the bend are missing; move this "
                f"border of the zones to where the line is straight ({keys}), or take model: rod"
            )
            self.note(float(batch.t[k]), node, "kink at joint", text, then)
            self._kink = 1.5 * kink

    def _layers(self, seen: Observation) -> None:
        """Clamps and point loads that bend a rod within less than a cell, however little: their moment is too small."""
        line, last, batch = self._model.line, self._model.line.h.size, seen.batch
        if not line.element.any():
            return
        d = batch.e / np.linalg.norm(batch.e, axis=2)[..., None]
        tangents = batch.frame[:, :, 2::3]
        ends = [(0, tangents[:, 0], d[:, 0]), (last, d[:, -1], tangents[:, 1])]
        places, found = self._places(line), list[tuple[int, int, float]]()
        inner = ((i, d[:, i - 1], d[:, i]) for i in places[2:].tolist() if 0 < i < last)
        for node, before, after in [*ends, *inner]:
            beside = [i for i in (node - 1, node + 1) if 0 < i < last and line.element[i]]
            if not line.element[node] or not beside:
                continue
            noted = self._noted_bends[places == node].min()
            cell, hn = min(node, last - 1), seen.of_line("hn", slice(None))
            stiffness = batch.stiffness(node, line)[:, :2].max(axis=1) * hn[node]
            thin = (batch.T[:, cell] * seen.of_line("h", cell) ** 2 > stiffness) & (batch.t < noted)
            angle = np.linalg.norm(after - before, axis=1) - float(np.linalg.norm(line.k0[node, :2]))
            smooth = np.max([np.linalg.norm(d[:, i] - d[:, i - 1], axis=1) / hn[i] for i in beside], axis=0)
            bad = np.flatnonzero(thin & (angle > ASKEW) & (smooth < LAYER * angle / hn[node]))
            found += [(int(k), node, float(angle[k])) for k in bad[:1]]
        for k, node, bend in sorted(found):
            self._note_bend(float(batch.t[k]), node, bend, batch.T[k], seen.line_of(k))

    def _bends_by_weight(self, seen: Observation) -> None:
        """Bends of a rod almost without tension that are shorter than its cells."""
        count = seen.batch.t.size if seen.varies else 1
        each = [(seen.line_of(k), slice(k, k + 1) if seen.varies else slice(None)) for k in range(count)]
        for line, outputs in each:
            nodes, l, limits = too_long_for_weight(self._model.cable, line)
            if not nodes.size:
                continue
            turns = turns_by_weight(line, seen, nodes, limits)[:, outputs]
            bent = np.flatnonzero(turns.max(axis=0) > TURNS)
            if bent.size:
                k, worst = int(bent[0]), int(np.argmax(turns[:, bent[0]]))
                node, at = int(nodes[worst]), nodes[turns[:, k] > TURNS]
                longest, asks = float(line.h[node - 1 : node + 1].max()), self._asks(node, "`mesh.cells`")
                text = weight_text(float(l[worst]), float(line.s[node]), longest, float(turns[worst, k]), asks)
                s_a, s_b = float(line.s[at[0] - 1]), float(line.s[at[-1] + 1])
                self.events.event(float(seen.batch.t[outputs][k]), s_a, s_b, "unresolved slack bend", text)
                self._weight = True
                return

    def tension(self, t: float, state: State) -> None:
        """Catenary cells without tension, where friction holds them or the scene asks to go on with them."""
        tension, cell = lowest(self._model.line, state.T)
        if not tension > self._slack:
            s = float(self._model.line.s[cell])
            lies = self._model.line.bits & FRICTION and state.bed[cell : cell + 2].any(axis=1).all()
            follows = "friction holds it on the seabed, loose" if lies else "what follows is grid noise there"
            text = f"tension {tension:.3g} N in a catenary zone at s = {s:g} m: {follows}"
            self.note(t, cell, "slack", text)
            self._slack = min(10.0 * tension, 10.0 * self._slack)
