"""Checks during a run: whatever makes a result doubtful without stopping the computation.

Each watch writes an event when something shows first and again when it has become much
worse; what makes going on pointless is returned as an Outcome, with its node or cell.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from hybrid.errors import Outcome
from hybrid.kernels.entry import sharpest
from hybrid.kernels.forces import FRICTION, PLANAR, SEABED
from hybrid.kernels.resolution_checks import lowest
from hybrid.kernels.state import Ends, Floats, State
from hybrid.model.build import Model
from hybrid.simulation.events import EventLog
from hybrid.solve.stability import is_stable
from hybrid.solve.statics import Equilibrium

# A rod that bends or twists by more than this (rad) from one cell to the next is not resolved by its mesh.
UNRESOLVED = 1.0
# What a catenary sags below the chord of a cell, as a part of the line's length, beyond which its shape is poor.
OFF = 0.02
# Depth in the seabed, as a part of the line's length, that no bed of real soil allows.
SUNK = 0.01
# Twist of an element (rad) that could become its opposite unseen: the log strain ends at pi, and a step may add what
# an end turns in it (model.resolution.MOST_TURN); what goes beyond pi comes back as more than this.
LARGEST_TWIST = 2.0
# Energy that the scheme creates, as a part of what work, fall and start have put in: beyond the first it is
# noted (a healthy run stays below 1 %), at the second the motion is the scheme's own and the run stops.
GAIN_NOTED, GAIN_STOPS = 0.05, 1.0
# Energy below this part of tension scale times length is what Newton's tolerance leaves over many steps.
NEWTON_LEAVES = 1e-7
# Numerical dissipation, as a part of the same energy: beyond this the step was too long for the motion.
LOSS_NOTED = 0.5
# A rod is pressed when it carries more than this part of EI/L^2: a quarter of pi^2 is the least that any rod buckles
# under, and what Newton leaves of no tension at all is far below.
PRESSED = 1e-3
# What an oscillation is wrong by after one period, as a part of it, beyond which a step is said to be too long
# (docs/theory.md, 8): 8 steps a period with rho_inf = 1, 14 with 0.5, 24 with 0.
COARSE = 0.35
# So many of the worst steps are needed: one alone is a blow or a load let go, unless it leaves out all of the motion or
# there are hardly any others.
SEVERAL = 3
# Of the length, and of the largest tension: what Newton's tolerance changes them by is no motion.
HARDLY_MOVED = 1e-7
# An angle at a clamp (rad) that is more than what Newton leaves; a bend there that falls by more than this part to the
# next node is a boundary layer.
ASKEW, LAYER = 1e-5, 0.5
# A jump of tension within a step, as a part of the largest that anything in the scene can ask for.
SNAP = 3.0
# A turn of one end against the other (rad) whose torque is worth a word where no rod carries it.
TURNED = 0.01
# A line whose kinetic energy is below this part of its elastic energy is at rest for the test of stability.
AT_REST = 1e-4
# Inertia above this part of the load is a motion that has begun.
LET_GO = 0.01
NOWHERE: Floats = np.zeros((0, 3))
# What a checkpoint holds of it as plain values.
REMEMBERED = (
    "_bend", "_twist", "_slack", "_fold", "_sunk", "_off", "_gain", "_loss", "_rested", "_left_out", "_jump",
    "_rho", "_moved", "_steps", "_put_in", "_potential", "_alive",
)  # fmt: skip

Stop = tuple[Outcome, int] | None


def borne_strain(model: Model) -> Floats:
    """Strain (N,) that each cell bears; infinite where it does not stretch."""
    s = model.line.s
    return np.asarray(model.cable.max_strain[model.cable.piece(0.5 * (s[:-1] + s[1:]))])


def most_stretched(model: Model, state: State) -> int:
    """The cell that is stretched most, of what it bears."""
    return int(np.argmax((np.linalg.norm(state.e, axis=1) / model.line.h - 1.0) / borne_strain(model)))


def stretch_text(model: Model, state: State) -> str:
    """How far the cable is stretched, and how far it may be."""
    cell = most_stretched(model, state)
    strain, borne = np.linalg.norm(state.e[cell]) / model.line.h[cell] - 1.0, borne_strain(model)[cell]
    return f"a strain of {100.0 * strain:.3g} % under {state.T[cell]:.4g} N, where max_strain is {100.0 * borne:.3g} %"


class Diagnostics:
    """What is watched in one run or one static solve."""

    def __init__(self, model: Model, events: EventLog) -> None:
        self.events, self._model, self._longest = events, model, 1.0 + borne_strain(model)
        self._bend = self._twist = UNRESOLVED
        self._slack = model.slack_floor
        self._fold, self._sunk = UNRESOLVED, SUNK * model.length
        self._off = OFF * model.length
        self._gain, self._loss = GAIN_NOTED, LOSS_NOTED
        self._rested = self._left_out = False
        self._placed: Floats | None = None  # m, of base nodes at the start
        self._jump = SNAP * model.tension_scale  # N
        self._tension_range = (np.inf, 0.0)  # N, lowest and highest of the largest tensions
        self._rho, self._moved, self._steps = 0.0, 0.0, 0  # -, m, -
        self._left: list[tuple[float, float, float, float]] = []  # m; t and dt in s; s in m: of the worst steps
        self._put_in = self._potential = self._alive = 0.0  # J

    def begin(self) -> None:
        """Note what the contents of the model warn of."""
        for entry in self._model.contents:
            if entry.event:
                self.events.event(0.0, 0.0, self._model.length, entry.event, f"{entry.what}: {entry.why}")

    def checkpoint(self) -> dict[str, Any]:
        """What has been noted so far, and what `finish` will judge by."""
        worst = np.array(self._left).reshape(-1, 4)
        return {name: getattr(self, name) for name in REMEMBERED} | {
            "pulls": list(self._tension_range), "worst": worst,
            "placed": self._placed if self._placed is not None else NOWHERE,
        }  # fmt: skip

    def restore(self, saved: Mapping[str, Any]) -> None:
        """Go on as `checkpoint` has said; ValueError where that cannot be."""
        vars(self).update({name: saved[name] for name in REMEMBERED})
        places = self._model.line.s if self._model.layout is None else self._model.layout.base
        placed, worst = saved["placed"], saved["worst"]
        if placed.shape not in (NOWHERE.shape, (places.size, 3)) or worst.shape[1:] != (4,) or len(worst) > SEVERAL:
            raise ValueError("places of another line")
        self._placed = placed if placed.size else None
        self._tension_range, self._left = tuple(saved["pulls"]), [tuple(x) for x in worst.tolist()]

    def follow(self, model: Model) -> None:
        """Watch the same line with other zones."""
        if model is not self._model:
            self._model, self._longest = model, 1.0 + borne_strain(model)

    def note(self, t: float, node: int, kind: str, text: str) -> None:
        s = float(self._model.line.s[node])
        self.events.event(t, s, s, kind, text)

    def equilibrium(self, found: Equilibrium) -> None:
        """What a static solution leaves open."""
        if found.slack >= 0:
            s, tension = float(self._model.line.s[found.slack]), float(found.state.T[found.slack])
            text = f"the only equilibrium found has a tension of {tension:.3g} N in a catenary at s = {s:g} m"
            self.note(0.0, found.slack, "slack", f"{text}: it stands like a strut, which no cable does")
        if self._model.line.bits & FRICTION and not found.with_friction:
            text = "this equilibrium is the one without friction: say `initial: {kind: equilibrium, friction: settled}`"
            where = f"{text} for one that lies where it was laid"
            self.events.event(0.0, 0.0, self._model.length, "static friction neglected", where)
        model = self._model
        line, sea, ends = model.line, model.sea.values, model.ends.values
        judged = line if found.with_friction else line._replace(bits=line.bits & ~FRICTION)
        if line.bits & PLANAR and not is_stable(judged, sea, ends, found.state, model.length, model.tension_scale):
            text = "this equilibrium holds within the plane alone: in space (`dimension: 3`) the cable would leave it"
            self.note(0.0, int(np.argmin(found.state.T)), "out of plane", text)
        if not found.judged:
            why = (
                "round-off of the bending of so short cells hides it"
                if found.blurred
                else "an end moment is not conservative"
            )
            text = f"the stability of this equilibrium is not judged, because {why}"
            self.events.event(0.0, 0.0, self._model.length, "stability not judged", text)

    def still(self, ends: Ends, state: State) -> Stop:
        """As `shape`, for a state that no step has led to."""
        return self.shape(0.0, sharpest(self._model.line, ends, state), state)

    def shape(self, t: float, sharp: Sequence[float], state: State) -> Stop:
        """Bends and twists that the mesh does not resolve; `sharp`: what kernels.entry.sharpest has found."""
        bend, twist = sharp[0], sharp[2]
        if bend <= self._bend and twist <= min(self._twist, LARGEST_TWIST):
            return None
        node, twisted = int(sharp[1]), int(sharp[3])
        if bend > self._bend:
            self.note(t, node, "unresolved bend", self._bend_text(node, bend, state))
            self._bend = 1.5 * bend
        if twist > self._twist:
            text = f"a twist of {np.degrees(twist):.0f} deg to the next cell: add cells, or torque may be wrong"
            self.note(t, twisted, "unresolved twist", text)
            self._twist = 1.5 * twist
        return (Outcome.TWISTED_TOO_FAR, twisted) if twist > LARGEST_TWIST else None

    def _bend_text(self, node: int, bend: float, state: State) -> str:
        line, s = self._model.line, float(self._model.line.s[node])
        cell = min(node, line.h.size - 1)
        first, tension = float(line.h[cell]), float(state.T[cell])
        stiffness = float(line.kb[node, :2].max() * line.hn[node])
        leaving = float(np.sqrt(stiffness / tension)) if tension > 0.0 else np.inf
        place = "the cable leaves its end" if node in (0, line.s.size - 1) else "the cable leaves its point load"
        if leaving <= first and (bend < UNRESOLVED or node in (0, line.s.size - 1)):
            finer = 0.25 * leaving
            how = f"{place} at s = {s:g} m within {leaving:.2g} m, less than its cell of {first:.2g} m"
        elif 0 < node < line.s.size - 1:
            finer = 0.3 * float(line.hn[node]) / bend
            how = f"the bend at s = {s:g} m is sharper than the mesh ({np.degrees(bend):.0f} deg to the next cell)"
        else:
            finer = 0.3 * first / bend
            how = f"the bend at the end s = {s:g} m is sharper than the mesh"
        ask = "`ratio` grades them" if self._model.layout is None else "`model.rod_cell`"
        return f"{how}: curvature and moment are wrong there; cells of {finer:.2g} m would do ({ask})"

    def scheme(self, rho: float) -> None:
        """A time scheme that damps nothing."""
        if rho == 1.0 and not self._model.line.ck.all():
            text = "rho_inf = 1 damps nothing: the tension of an inextensible cable grows a sawtooth; 0.9 keeps it away"
            self.events.event(0.0, 0.0, self._model.length, "undamped", text)

    def step(self, t: float, dt: float, rho: float, before: State, state: State) -> None:
        """Remember the steps that leave the most out of the motion, and how far the line has moved."""
        first = slice(None) if self._model.layout is None else self._model.layout.first
        if self._placed is None:
            self._placed = before.r[first].copy()
        self._moved = max(self._moved, float(np.abs(state.r[first] - self._placed).max()))
        largest = float(state.T.max())
        jump = largest - float(before.T.max())
        if jump > self._jump and self._model.inextensible:
            cell = int(np.argmax(state.T))
            text = (
                f"tension jumps by {jump:.3g} N within a step: what does not stretch stops at once, and the height of "
                f"such a peak depends on step and cells; give axial_stiffness"
            )
            self.note(t, cell, "snap", text)
            self._jump = 3.0 * jump
        self._tension_range = min(self._tension_range[0], largest), max(self._tension_range[1], largest)
        change = np.abs(state.a - before.a)
        self._rho = rho
        self._steps += 1
        left = dt * dt * float(change.max())
        if len(self._left) < SEVERAL or left > self._left[-1][0]:
            node = int(np.argmax(change.max(axis=1)))
            self._left.append((left, t, dt, float(self._model.line.s[node])))
            self._left = sorted(self._left, reverse=True)[:SEVERAL]

    def finish(self) -> None:
        """After the last step: whether steps were too long for the motion.

        Of a x cos(w t) a step changes the acceleration by a w^3 dt; periods are too long by (beta - 1/6) (w dt)^2, with
        beta = 1/(1 + rho)^2 of generalized-alpha.
        """
        low, high = self._tension_range
        hardly = self._moved <= HARDLY_MOVED * self._model.length and not high - low > HARDLY_MOVED * high
        if hardly or not self._left or not self._moved > 0.0:
            return
        once, several = self._left[0], self._left[-1]
        left, t, dt, s = once if once[0] > self._moved or self._steps <= SEVERAL**2 else several
        turn = (left / self._moved) ** (1.0 / 3.0)  # w dt
        wrong = 2.0 * np.pi * (1.0 / (1.0 + self._rho) ** 2 - 1.0 / 6.0) * turn * turn
        if wrong > COARSE:
            text = (
                f"about {2.0 * np.pi / turn:.2g} steps to a period here, where the line moves by {self._moved:.2g} m: "
                f"an oscillation is off by some {100 * min(wrong, 1.0):.0f} % after a period; "
                f"a time.step of {dt * np.sqrt(0.1 * COARSE / wrong):.1g} s would do"
            )
            self.events.event(t, s, s, "coarse step", text)

    def torque(self, t: float, turn: float, torque: float) -> None:
        """A torque that zones which move do not carry, because a catenary lies between the ends."""
        if abs(turn) > TURNED and not self._left_out:
            text = (
                f"one end is turned by {np.degrees(turn):.3g} deg against the other, and a catenary lies between them: "
                f"the result has no torque ({torque:.3g} N m of a rod); for it, take model: rod"
            )
            self.events.event(t, 0.0, self._model.length, "torque neglected", text)
            self._left_out = True

    def stretch(self, state: State) -> Stop:
        """A section that is stretched beyond what it bears."""
        if self._model.inextensible:
            return None
        over = np.einsum("ij,ij->i", state.e, state.e) > (self._longest * self._model.line.h) ** 2
        return (Outcome.OVERSTRETCHED, most_stretched(self._model, state)) if over.any() else None

    def mesh(self, t: float, state: State) -> None:
        """Folds that a catenary's cells do not resolve, and a line deep in the seabed."""
        line, d = self._model.line, state.e / np.linalg.norm(state.e, axis=1)[:, None]
        flexible = (line.spin[:-1] == 0) & (line.spin[1:] == 0) & ~np.isin(line.s[1:-1], self._model.attached)
        turn = np.where(flexible, np.arccos(np.clip(np.einsum("ij,ij->i", d[:-1], d[1:]), -1.0, 1.0)), 0.0)
        if turn.size and turn.max() > self._fold:
            node = int(np.argmax(turn)) + 1
            text = f"the catenary turns by {np.degrees(turn[node - 1]):.0f} deg from one cell to the next at s = "
            fix = f"{line.s[node]:g} m: its tension is wrong there; add cells, or make it a rod"
            self.note(t, node, "unresolved bend", text + fix)
            self._fold = 1.5 * float(turn[node - 1])
        self._layers(t, state, d)
        sagging = np.where(flexible, turn * line.hn[1:-1] / 8.0, 0.0)
        if sagging.size and sagging.max() > self._off:
            node = int(np.argmax(sagging)) + 1
            text = f"at s = {line.s[node]:g} m the catenary sags by {sagging[node - 1]:.2g} m below its chords"
            self.note(t, node, "unresolved bend", f"{text}: so far off is its shape; add cells")
            self._off = 3.0 * float(sagging[node - 1])
        if line.bits & SEABED:
            sea = self._model.sea.values
            depth = sea.offset - state.r @ sea.normal
            node = int(np.argmax(depth))
            if depth[node] > self._sunk:
                text = f"the line lies {depth[node]:.3g} m deep in the seabed at s = {line.s[node]:g} m"
                self.note(t, node, "deep in the seabed", f"{text}: is its stiffness in N/m per m of cable?")
                self._sunk = 3.0 * float(depth[node])

    def _layers(self, t: float, state: State, d: Floats) -> None:
        """Clamps and point loads that bend a rod within less than a cell, however little: their moment is too small."""
        line, last = self._model.line, self._model.line.h.size
        if self._bend > UNRESOLVED:
            return
        tangents = self._model.ends.values.frame[:, 2::3]
        ends = [(0, tangents[0], d[0]), (last, d[-1], tangents[1])]
        inner = [int(np.argmin(np.abs(line.s - at))) for at in self._model.attached]
        for node, before, after in [*ends, *((i, d[i - 1], d[i]) for i in inner if 0 < i < last)]:
            beside = [i for i in (node - 1, node + 1) if 0 < i < last and line.element[i]]
            if not line.element[node] or not beside:
                continue
            cell, stiffness = min(node, last - 1), float(line.kb[node, :2].max() * line.hn[node])
            if state.T[cell] * line.h[cell] ** 2 <= stiffness:
                continue
            angle = float(np.linalg.norm(after - before)) - float(np.linalg.norm(line.k0[node, :2]))
            smooth = max(float(np.linalg.norm(d[i] - d[i - 1])) / line.hn[i] for i in beside)
            if angle > ASKEW and smooth < LAYER * angle / line.hn[node]:
                self.note(t, node, "unresolved bend", self._bend_text(node, angle, state))
                self._bend = 1.5 * UNRESOLVED
                return

    def tension(self, t: float, state: State) -> None:
        """Catenary cells without tension, where the scene asks to go on with them."""
        tension, cell = lowest(self._model.line, state.T)
        if not tension > self._slack:
            s = float(self._model.line.s[cell])
            text = f"tension {tension:.3g} N in a catenary zone at s = {s:g} m: what follows is grid noise there"
            self.note(t, cell, "slack", text)
            self._slack = min(10.0 * tension, 10.0 * self._slack)

    def energy(self, t: float, values: Mapping[str, Any], work: Floats, state: State) -> Stop:
        """Energy that the time scheme creates or dissipates, held against all that was put in."""
        gained, potential = float(values["work/scheme"]), float(values["energy/potential"])
        alive = sum(float(values[x]) for x in values if x.startswith("energy/")) - potential
        if t == 0.0:
            self._potential, self._alive = potential, alive
            return None
        self._put_in = max(self._put_in, float(np.abs(work).sum()) + abs(potential - self._potential) + self._alive)
        floor = NEWTON_LEAVES * self._model.tension_scale * self._model.length
        fastest = int(np.argmax(np.abs(state.v).sum(axis=1)))
        part = 100.0 * abs(gained) / (self._put_in or 1.0)
        if gained > GAIN_STOPS * self._put_in + floor:
            return Outcome.GAINS_ENERGY, fastest
        if gained > self._gain * self._put_in + floor:
            text = f"the time scheme has created {gained:.3g} J, {part:.0f} % of the energy put in"
            self.note(t, fastest, "gains energy", f"{text}: {Outcome.GAINS_ENERGY.remedy}")
            self._gain *= 3.0
        if -gained > self._loss * self._put_in + floor:
            text = f"the time scheme has dissipated {-gained:.3g} J, {part:.0f} % of the energy put in"
            self.note(
                t, fastest, "numerical dissipation", f"{text}: motion is faster than the step; make time.step smaller"
            )
            self._loss *= 1.3
        return None

    def rest(self, t: float, ends: Ends, values: Mapping[str, Any], state: State) -> None:
        """A rod at rest, or nearly, on an equilibrium that it would buckle out of if anything touched it."""
        line = self._model.line
        rod = line.spin == 1
        if self._rested or not rod.any():
            return
        elastic = sum(float(values[f"energy/{x}"]) for x in ("stretch", "bending", "torsion"))
        bending = float((line.kb[:, :2] * line.hn[:, None])[line.element == 1].min(initial=np.inf))
        least = PRESSED * bending / self._model.length if np.isfinite(bending) else 0.0  # J
        twisted = float(values["energy/torsion"]) > least
        pressed = float(state.T[rod].min()) * self._model.length < -least or twisted
        calm = float(values["energy/kinetic"]) <= AT_REST * elastic or not state.v.any()
        if not twisted:  # what is let go has no velocity yet, but is no longer at rest
            calm &= float(line.mass.sum()) * float(np.abs(state.vd).max()) <= LET_GO * -float(state.T[rod].min())
        if (
            pressed
            and calm
            and not is_stable(line, self._model.sea.values, ends, state, self._model.length, self._model.tension_scale)
        ):
            text = "the rod rests where it would buckle: only its perfect symmetry keeps it there; give it a small bow"
            self.note(t, int(np.argmin(state.T)), "unstable", text)
            self._rested = True
