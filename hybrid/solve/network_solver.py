"""Lines that meet at points: their equilibrium, their consistent accelerations, and their steps in time.

One Newton for all of them (kernels.run.newton), or where nothing joins or may join them one after the other, in space
or in its plane (kernels.run.newton).  States go in and come out as of a single line (solve.stepper); a free
point has none of its own, it is the last or first node of every line that is joined to it.  A body has a row of numbers
(kernels.junctions.bodies).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from hybrid.errors import Outcome
from hybrid.kernels.contact.self_contact_pairs import Contact
from hybrid.kernels.junctions.bodies import FRAME, LINES, MASS, NUMBERS, OWN, PLACE, VD, WA, WD, WORK, A, U, V, W, X
from hybrid.kernels.junctions.borders import NONE
from hybrid.kernels.laws.obstacles import carry_obstacles
from hybrid.kernels.laws.seabed import lie_in_soil, rest_in_soil
from hybrid.kernels.laws.water import wave_kinematics
from hybrid.kernels.run.network import JUNCTIONS, begin_line, book_network_step
from hybrid.kernels.run.newton import ONE_MARCH, solve_network, workspace_of
from hybrid.kernels.state.report import (
    AXIAL_LAW,
    FRICTION,
    LOCAL_ERROR,
    NET_A,
    OBSTACLES,
    PLANAR,
    RESIDUAL,
    SEABED_ENERGY,
    TOUCHES,
    USED_RHO,
    WAVES,
)
from hybrid.kernels.state.state import Floats, State, Work
from hybrid.kernels.step.line_step import ASSEMBLY, CORRECTION, EQUILIBRIUM, STEP, TOLERANCE, Limits, Task
from hybrid.kernels.step.step import friction_axes
from hybrid.kernels.step.step_control import REFUSED
from hybrid.solve.contact import SharedContact, left_over
from hybrid.solve.line_jobs import LineJobs, Lines, SelfContacts
from hybrid.solve.stability import ANCHOR, CONTACT_DAMPING, DAMPING, buckling_line, flaw_of_lines, stop
from hybrid.solve.stepper import HEAVY, REACH, JoinedLine, NetworkState, NetworkTaken, Solution, lie_on_bed
from hybrid.solve.stepper import MOST_ITERATIONS as MOST_OF_STEP

MOST_ITERATIONS = 40  # of Newton from a poor shape: 6 to 12 are usual, beyond 40 it wanders
MOST_TURNING = 200  # of Newton with turning chords, which goes half a radian at a time: 8 pi are 40 turns of that size
# An equilibrium is out of balance by at most this part of its largest tension and of the scale; so many tries.
BALANCED, BALANCING = 1e-6, 4
# Where lines touch Newton goes on once unless this many times the residual balances, too: a ball on lines that lie on
# others was 3e-7 m away from where it rests, and lines on one that is held bore 1e-5 more than its weight.
CLOSER = 100.0
ROUNDED = 1e-14  # what round-off may leave of a strain
DRIFTED = 10.0  # lengths that a line has gone from its start where it has drifted
# Springs of points and bodies that nothing holds, in the test of stability, as a part of tension scale over length.
NEUTRAL = 1e-6
# Of the longest line: arm by which moments on bodies are compared with forces, at least.
LEAST_ARM = 0.01
NO_BODIES: Floats = np.zeros((0, NUMBERS))


class NetworkSolver(LineJobs):
    """Solves for all lines of a network at once; owns the work arrays, not the states.

    It works in space, but for lines that are joined to nothing and are marked as planar.
    """

    def __init__(
        self,
        lines: Lines,
        points: int,
        bodies: Floats = NO_BODIES,
        contacts: SelfContacts = (),
        shared: SharedContact | None = None,
        tolerance: float = TOLERANCE,
        apart: bool = False,
    ) -> None:
        """Make tables of lines; each point and body must be at an end of some line.

        points: how many free points there are; bodies: (B, NUMBERS), what they are, read at every step; contacts: of
        lines that touch themselves, in the order of the lines, None: of one that does not; empty: none does.  shared:
        contact of lines that may touch each other, which have none of their own; tolerance: of Newton's method in
        steps; apart: whether lines that are joined to nothing are solved by themselves whatever is free beside them.
        """
        self.tolerance, self.net, self.body_work = tolerance, np.zeros((points, 3)), np.zeros((len(bodies), WORK))
        super().__init__(lines, bodies, contacts, shared, apart)
        self.blurred: set[int] = set()  # lines of the last equilibrium of which round-off hides whether they buckle
        mass = sum(float(x.line.mass.sum()) for x in lines) + float(bodies[:, MASS].sum())
        self.scale = max(x.scale for x in lines)
        self.length = max(x.length for x in lines)
        self.anchor = ANCHOR * self.scale / (mass * self.length)  # 1/s2
        self._make_tables()

    def _solve(self, task: Task, old: NetworkState, new: NetworkState, t: float = 0.0) -> NetworkTaken:
        """Do a task (kernels.step.line_step) from `old` to `new`, which is overwritten; t: s, of `new`.

        Lines that nothing joins or may join are solved one after the other, with the limits of each.
        """
        if not self._marches_alone:
            return self._solve_joined(task, old, new, t)
        self.turns, most, residual, worst = None, 0, 0.0, (Outcome.OK, -np.inf, -1, -1)
        for k, table in self._lone_tables.items():
            x, work = self.lines[k], self.work[k]
            if task.what in (ASSEMBLY, CORRECTION):
                work.torsion.known[:1] = -1.0  # how it answers to torques is found anew
            own = task._replace(limits=task.limits._replace(reach=REACH * x.length, scale=x.scale))
            table.bind(task=own, **self._by_itself(k, {"old": old.lines[k], "new": new.lines[k]}))
            outcome, iterations, left, where = self._kernel_of(k)(table.numbers)
            left_over = float(work.report[RESIDUAL])
            most, residual = max(most, iterations), max(residual, left_over if left_over < np.inf else np.inf)
            if task.what == ASSEMBLY and outcome == Outcome.SINGULAR and left_over < np.inf:
                outcome = Outcome.OK  # forces of a line alone are known whatever its equations are
            if outcome != Outcome.OK or not left <= worst[1]:
                worst = Outcome(outcome), left, k, where
            if outcome != Outcome.OK:
                break
        if task.what == ASSEMBLY and worst[0] == Outcome.OK:
            self._begin_books(new, t)
        return NetworkTaken(worst[0], most, *worst[1:], residual)

    def _solve_joined(self, task: Task, old: NetworkState, new: NetworkState, t: float = 0.0) -> NetworkTaken:
        """The same with all lines at once, in space."""
        self.turns = None
        self._bind_states(0, old, new)
        for k, contact in self._contacts.items():
            contact.set_states(old.lines[k], new.lines[k])
            self.books[k].counts.parity = 0
        limits = task.limits
        of_step = task.what, task.dt, task.before, task.rho, task.cv, task.ca, limits.reach, limits.scale, limits.most
        how = task.rho_before, task.fixed, t, 1.0, task.cut, limits.tolerance, task.cv, task.ca
        self._asked[:] = (*of_step, *how)
        self._let_march()
        outcome, iterations, left, line, where = solve_network(self._all.jobs[0].numbers)
        return NetworkTaken(Outcome(outcome), iterations, left, line, where, self.residual())

    def _begin_books(self, states: NetworkState, t: float) -> None:
        """Powers and extremes of lines that are solved by themselves, in states whose reports are known, at t (s)."""
        for k, table in self._lone_tables.items():
            x, clock = self.lines[k], self.books[k].clock
            if x.line.bits & TOUCHES:
                lie_on_bed(x.line, x.sea, self.work[k], states.lines[k])
                clock.stored = self.work[k].report[SEABED_ENERGY]
            if k in self._reels:
                from hybrid.kernels.reel.payout import stand_among  # which a scene without payout does without

                stand_among(self._reels[k])
            clock.now = t
            begin_line(table.numbers)

    def residual(self) -> float:
        """Largest residual force (N) of the last march, at a node or a point; without contact."""
        left = self.body_work[:, OWN : OWN + 6] + self.body_work[:, LINES : LINES + 6]
        return self._largest([float(work.report[RESIDUAL]) for work in self.work], self.net, left)

    @property
    def arm(self) -> float:
        """Arm (m) by which moments on bodies are compared with forces."""
        return max(LEAST_ARM * self.length, float(np.abs(self._fairleads).max()))

    def _largest(self, inside: Sequence[float], net: Floats, left: Floats) -> float:
        """The largest of what is left over inside lines, at points (P, 3) N, and at bodies (B, 6) N, N m."""
        turning = float(np.abs(left[:, 3:]).max(initial=0.0)) / self.arm
        return max(*inside, turning, *(float(np.abs(x).max(initial=0.0)) for x in (net, left[:, :3])))

    def in_contact(self) -> list[int]:
        """Lines that touch themselves, or may touch others that do, in the states that were looked at last."""
        shared = self.shared.lines if self.shared is not None and self.shared.touches else ()
        return [*(k for k, contact in self._contacts.items() if contact.touches), *shared]

    @property
    def meets(self) -> bool:
        """Whether lines touch bodies that are free."""
        return bool(self._rides.size)

    @property
    def presses_bodies(self) -> bool:
        """Whether a line touched a free body in the last march."""
        return bool(self._rides.size) and bool(self._pressed["found"].any())

    def pressed_bodies(self, states: NetworkState, cv: float = 0.0) -> tuple[Floats, Floats, Floats, NDArray[np.int64]]:
        """What lines that touch bodies do to them in states at rest.

        Rows (n, TOUCHED) of nodes, how that changes as each body moves (S, 36), what it is (S, 6), and the numbers of
        these bodies (S,).  cv: 1/s, of the damping.
        """
        self.evaluate_forces(states, 0.0)
        if cv:
            self._solve_joined(Task(ASSEMBLY, cv=cv, limits=ONE_MARCH), states, states)
        rows = self._pressed["touched"][: self._pressed["found"][0]]
        own, wrench = (self._pressed[x].copy() for x in ("own", "wrench"))
        return rows.copy(), own, wrench, self._pressed["carriers"]

    @property
    def narrowest(self) -> float:
        """The least diameter, m, of lines that touch; infinite: none does."""
        found = [*self._contacts.values(), *([] if self.shared is None else [self.shared])]
        return min((x.narrowest for x in found if x.touches), default=np.inf)

    def proof(self, states: NetworkState) -> float:
        """Largest force (N) that is left over at a node, a point or a body, with that of contact; reports follow."""
        taken = self.evaluate_forces(states, self.anchor)
        residual = taken.residual if taken.outcome == Outcome.OK else np.inf
        return self._largest(*self.unbalanced(states, self.anchor)) if self.in_contact() else residual

    def unbalanced(self, states: NetworkState, ca: float) -> tuple[list[float], Floats, Floats]:
        """What does not balance, with contact, in states that have just been evaluated.

        The largest force (N) at a node of each line, forces (P, 3) N on points, forces and moments (B, 6) N, N m on
        bodies.  ca: as of them.
        """
        points = len(self.net)
        inside, net = [float(work.report[RESIDUAL]) for work in self.work], self.net.copy()
        left = self.body_work[:, OWN : OWN + 6] + self.body_work[:, LINES : LINES + 6]
        pushed = {} if self.shared is None else self._push(states)
        for k in self.in_contact():
            x, work = self.lines[k], workspace_of(self.lines[k].line, keep=True)
            force = pushed[k] if k in pushed else self._contacts[k].force(states.lines[k])
            inside[k], forces = left_over(x.line, x.sea, x.ends, states.lines[k], force, ca, work)
            for joint, force, arm in zip(x.joints, forces, self._arms[k], strict=True):
                if 0 <= joint < points:
                    net[joint] += force
                elif joint >= points:
                    left[joint - points] += np.concatenate([force, np.cross(arm, force)])
        return inside, net, left

    def _push(self, states: NetworkState) -> dict[int, Floats]:
        """Forces (N+1, 3) N on lines that may touch each other, by number, in states at rest."""
        assert self.shared is not None
        self.join_states(states)
        self.shared.rest_energy(self.work)
        return self.shared.forces()

    def contacts_at(self, states: NetworkState, finer: int = 1) -> list[tuple[Contact, Sequence[int]]]:
        """Contact in states at rest, with the numbers of its lines, whose nodes it has in turn.

        finer: by how much more sample points lie on each piece of a line than the law has.
        """
        found: list[tuple[Contact, Sequence[int]]] = [(x.contact, (k,)) for k, x in self._contacts.items()]
        found += [] if self.shared is None else [(self.shared.contact, self.shared.lines)]
        for contact, _ in found:
            contact.samples[:] *= finer
        for k, own in self._contacts.items():
            own.set_states(states.lines[k], states.lines[k])
            own.force(states.lines[k])
        if self.shared is not None:
            self._push(states)
        for contact, _ in found:
            contact.samples[:] //= finer
        return found

    def contact_energy(self, states: NetworkState) -> float:
        """Energy, J, of contact of lines with each other in states at rest; infinite: they are in each other."""
        assert self.shared is not None
        self.join_states(states)
        return self.shared.rest_energy(self.work)

    # --- motion -------------------------------------------------------------------------------------

    def step(
        self,
        old: NetworkState,
        new: NetworkState,
        dt: float,
        rho: float,
        before: float,
        rho_before: float,
        t: float = 0.0,
        most: int = MOST_OF_STEP,
    ) -> NetworkTaken:
        """From `old` to `new` (overwritten) over dt, with the ends and the sea of the new time in the lines' arrays.

        before, rho_before: the length, s, of the step that led to `old`, 0 if it is a start, and its spectral radius,
        `NetworkTaken.rho` of it.  t: s, of `new`, for extremes.
        """
        limits = Limits(REACH * self.length, self.scale, most, self.tolerance)
        task = Task(STEP, dt, before, rho, limits=limits, rho_before=rho_before)
        taken = self._solve(task, old, new, t)
        if taken.outcome != Outcome.OK:
            return taken
        used = float(self.work[0].report[USED_RHO])
        if self._marches_alone:  # of which nobody asks for errors and books
            return replace(taken, rho=used)
        errors = np.array([work.report[LOCAL_ERROR] for work in self.work])  # fairleads move as their bodies
        ratio = float((errors / self.allowed).max())
        if not ratio > REFUSED:
            book_network_step(self._all.jobs[0].numbers)
        return replace(taken, error=float(errors.max()), ratio=ratio, rho=used)

    def consistent_accelerations(
        self,
        states: NetworkState,
        accelerations: Sequence[Floats],
        t: float = 0.0,
        lengthening: Mapping[int, Floats] = MappingProxyType({}),
    ) -> NetworkTaken:
        """Give `states` the accelerations and tensions that positions, velocities and loads imply (solve.stepper).

        accelerations: (2, 3) m/s2 of the held ends of each line; lengthening: (N,) m/s2, second rates of the lengths of
        cells, by line.
        """
        states.bodies[:, A:W] = states.bodies[:, WA:] = 0.0
        self._turning_gaps(states)
        each = zip(self.lines, self.work, states.lines, accelerations, strict=True)
        for k, (x, work, state, given) in enumerate(each):
            state.a[:], state.vd[:], state.wa[:], state.wd[:] = 0.0, 0.0, 0.0, 0.0
            l = np.linalg.norm(state.e, axis=1)
            d = state.e / l[:, None]
            e1 = np.diff(state.v, axis=0)
            across = e1 - np.einsum("ij,ij->i", d, e1)[:, None] * d
            gaps = -np.einsum("ij,ij->i", across, across) / (l * HEAVY)
            if k in lengthening:
                gaps += lengthening[k] / HEAVY
            work.u[:], work.X[:] = 0.0, 0.0
            for end in (0, 1):
                if x.joints[end] < 0:
                    work.u[-end] = -given[end] / HEAVY  # what a held end has still to go is position - r - u
            if x.joints[0] >= 0:
                work.u[0] = -self._gaps[k, 0]
            if x.line.moved.size:
                carry_obstacles(t, t, x.sea)
            rest_in_soil(x.line, x.sea, state.r, state.soil)
            self._around(x, state, work)
            ends = x.ends._replace(position=state.r[[0, -1]])
            self.bind_line(k, work=work._replace(gaps=gaps), ends=ends)
        self._at_rest[0] = 1
        for k in self._touching_lines:
            self.books[k].clock.now = t
        taken = self._solve(Task(CORRECTION, ca=HEAVY, limits=ONE_MARCH), states, states)
        self._at_rest[0] = 0
        for k, (x, work) in enumerate(zip(self.lines, self.work, strict=True)):
            self.bind_line(k, work=work, ends=x.ends)
        if taken.outcome != Outcome.OK:
            return taken
        for row, own, solved in zip(states.bodies, self.bodies, self.body_work[:, X : X + 6], strict=True):
            row[VD : VD + 3] = row[A : A + 3] = HEAVY * solved[:3]
            if own[MASS + 21 : MASS + 36].any():  # a turn without inertia has no acceleration
                row[WD : WD + 3] = row[WA : WA + 3] = HEAVY * solved[3:] @ row[FRAME:V].reshape(3, 3)
        for x, work, state in zip(self.lines, self.work, states.lines, strict=True):
            state.vd[:] = HEAVY * work.x[:, 1:4]
            if x.line.bits & PLANAR and not self._marches_alone:  # round-off in space, which steps would add up
                state.vd[:] -= np.outer(state.vd @ x.line.plane[2], x.line.plane[2])
            state.a[:] = state.vd
            state.T[:] += work.x[1:, 0]
            # a spin without inertia has no acceleration, and none is in a plane
            turning = (x.line.spin == 1) & (x.line.polar > 0) & (not x.line.bits & PLANAR)
            state.wd[turning] = HEAVY * work.x[:-1, 4][turning]
            state.wa[:] = state.wd
        return self.forces_in_motion(states, t)

    def _turning_gaps(self, states: NetworkState) -> None:
        """What fairleads accelerate beside the acceleration of their bodies, towards the axis of rotation."""
        self._gaps[:] = 0.0
        for l, x in enumerate(self.lines):
            for k in (0, 1):
                if x.joints[k] >= len(self.net):
                    row = states.bodies[x.joints[k] - len(self.net)]
                    R = row[FRAME:V].reshape(3, 3)
                    spin = R @ row[W : W + 3]
                    self._gaps[l, k] = np.cross(spin, np.cross(spin, R @ x.fairleads[k])) / HEAVY

    def evaluate_forces(self, states: NetworkState, ca: float, t: float = 0.0) -> NetworkTaken:
        """The forces, reports, powers and residuals of states at rest as they are, at t (s).

        ca: 1/s2, of springs of that times the mass.
        """
        if self.shared is not None and self.books[self.shared.last].extremes.size:
            self._bind_states(0, states, states)  # extremes are noted of line by line, with what presses on each
            self.books[self.shared.last].clock.now = t
            self.shared.rest_energy(self.work)
        for x, work, state in zip(self.lines, self.work, states.lines, strict=True):
            work.u[:] = 0.0
            if x.line.moved.size:
                carry_obstacles(t, t, x.sea)
            self._around(x, state, work)
            if state.soil.size:
                lie_in_soil(x.line, x.sea, state.r, state.soil)
        taken = self._solve(Task(ASSEMBLY, ca=ca, limits=ONE_MARCH), states, states, t)
        if taken.outcome == Outcome.OK:
            self._count_contact_energy(states)
        return taken

    def forces_in_motion(self, states: NetworkState, t: float) -> NetworkTaken:
        """The same of states between two steps, at t (s): mean tensions of ropes stay what they are."""
        return self.evaluate_forces(states, HEAVY, t)

    def _count_contact_energy(self, states: NetworkState) -> None:
        """Put what contact does to held ends into the reports and powers of states that have just been evaluated."""
        before = {k: self.work[k].report[NET_A : NET_A + 6].copy() for k in self._touching_lines}
        for k, contact in self._contacts.items():
            contact.count_energy(states.lines[k], self.lines[k].ends, self.work[k].report)
        if self.shared is not None:
            self.shared.count_energies(self.work, [x.ends for x in self.lines])
        for k, net in before.items():
            books, report = self.books[k], self.work[k].report
            added = (report[NET_A : NET_A + 6] - net).reshape(2, 3)
            books.power[0, :2] -= np.einsum("ij,ij->i", added, books.velocity)
            books.report[0] = report

    def _stand(self, states: NetworkState) -> None:
        """Lines stand where states have them, in the water that is there."""
        for x, work, state in zip(self.lines, self.work, states.lines, strict=True):
            work.u[:] = 0.0
            self._around(x, state, work)

    def _around(self, x: JoinedLine, state: State, work: Work) -> None:
        if x.line.bits & WAVES:
            wave_kinematics(x.sea, state.r, work.u)
        if x.line.bits & FRICTION:
            friction_axes(x.sea, state.r, state.e, state.slip, state.grip)

    # --- equilibrium --------------------------------------------------------------------------------

    def compliance(self, states: NetworkState, ca: float) -> Floats | None:
        """How points and bodies of an equilibrium give way to forces on them; None: the system is singular.

        (n, n) m/N, rad/N, .., of the points (3 each), then of the bodies (3 of the origin, 3 of the rotation), from the
        factors of its lines.  Friction is left out.  ca: 1/s2, of springs of that times the mass.
        """
        self._stand(states)
        taken = self._solve_joined(Task(JUNCTIONS, ca=ca, limits=ONE_MARCH), states, states)
        matrix = self._rooms.whole["A"]
        m = matrix.shape[1] - 1
        if taken.outcome != Outcome.OK:
            return None
        if m == 0:
            return np.zeros((0, 0))
        A = matrix[:m, :m]
        columns = 1.0 / np.maximum(np.abs(A).max(axis=0), 1e-300)
        rows = 1.0 / np.maximum(np.abs(A * columns).max(axis=1), 1e-300)
        try:
            inverse = columns[:, None] * np.linalg.inv(rows[:, None] * A * columns) * rows
        except np.linalg.LinAlgError:
            return None
        first = int((self.joints[:, 1] != NONE).sum())
        return np.asarray(-inverse[first:, first:])

    def is_stable(self, states: NetworkState) -> bool:
        """Whether points and bodies come back to an equilibrium when they are moved a little; False also if neither.

        The springs that hold what nothing else does are a part of NEUTRAL of what a force of the tension scale does
        over the length.  Whether lines themselves would buckle is not asked.
        """
        if not (len(self.net) or len(self.bodies)):
            return True
        C = self.compliance(states, NEUTRAL / ANCHOR * self.anchor)
        if C is None:
            return False
        arm = np.ones(C.shape[0])
        turns = 3 * len(self.net) + 6 * np.arange(len(self.bodies))[:, None] + np.arange(3, 6)
        arm[turns.ravel()] = max(float(np.abs(self._fairleads).max()), 1e-3 * self.length)  # m, so that all are lengths
        C = C * arm * arm[:, None]
        give = np.linalg.eigvalsh(0.5 * (C + C.T))
        return bool(give[0] > -1e-6 * NEUTRAL * give[-1])

    def factor(self, states: NetworkState, ca: float) -> bool:
        """Leave the factors of states as they are where `keep_factors` keeps them; ca: as of `evaluate_forces`.

        False: the system is singular.
        """
        self._gaps[:] = 0.0
        self._stand(states)
        taken = self._solve_joined(Task(CORRECTION, ca=ca, limits=ONE_MARCH), states, states)
        return taken.outcome == Outcome.OK

    def others(self, lines: Sequence[JoinedLine], bodies: Floats | None = None) -> NetworkSolver:
        """The same of other lines that are joined likewise, without contact; bodies: None: of the same ones."""
        return NetworkSolver(lines, len(self.net), self.bodies if bodies is None else bodies, apart=self.apart)

    @property
    def settling(self) -> float:
        """Of a motion to rest, as of solve.stability.damped."""
        return DAMPING if self._marches_alone else CONTACT_DAMPING

    def turned(self, start: NetworkState) -> Solution | None:
        """As `newton`, with chords that are turned; None: they are of lines by themselves alone."""
        return self.newton(start, turning=True) if self._marches_alone else None

    def newton(self, start: NetworkState, turning: bool = False) -> Solution:
        """Static Newton from `start`; a new state is returned, the old one is left as it was.

        An outcome other than OK also where what was found is no equilibrium (`flaw`), or has gone with what only the
        springs of the anchor hold.
        """
        taken, new = self._balance(start, turning)
        if taken.outcome == Outcome.OK:
            outcome, line, where = self.flaw(new)
            if self.is_apart and outcome != Outcome.SLACK:
                each = zip(start.lines, new.lines, self.lines, strict=True)
                for k, (a, b, x) in enumerate(each):
                    far = np.abs(b.r - a.r).max(axis=1)
                    if far.max() > DRIFTED * x.length:
                        outcome, line, where = Outcome.SINGULAR, k, int(np.argmax(far))
            taken = replace(taken, outcome=outcome, line=line, where=where)
        return taken, new

    def balance(self, start: NetworkState) -> Solution:
        """As `newton`, whatever the state in which forces balance; of lines by themselves as far as Newton says so."""
        return self._balance(start, proves=not self._marches_alone)

    def _balance(self, start: NetworkState, turning: bool = False, proves: bool = True) -> Solution:
        """Rounds of Newton until forces are seen to balance; proves: whether they are looked at."""
        new = start.copy()
        for state in new.lines:
            stop(state)
            state.sheave[:] = 0.0
        new.bodies[:, V:] = 0.0
        taken = NetworkTaken(Outcome.NOT_CONVERGED, 0, np.inf, -1, -1, np.inf)
        iterations, kept, rubs = 0, None, any(x.line.bits & FRICTION for x in self.lines)
        lies = self._marches_alone and any(x.line.bits & OBSTACLES for x in self.lines)
        for _ in range(BALANCING):
            taken = self.newton_round(new, turning)
            iterations += taken.iterations
            taken = replace(taken, iterations=iterations)
            if taken.outcome != Outcome.OK or not proves:
                break
            # Newton stops by turns and tensions; a very stiff seabed makes much force of little way
            proof = self.proof(new)
            taken, touches = replace(taken, residual=proof), lies or self.in_contact()
            if not self.is_balanced(new, max(proof, self._unstretched(new))):
                taken = replace(taken, outcome=Outcome.NOT_CONVERGED)
            elif kept is not None or (not rubs and (not touches or self.is_balanced(new, CLOSER * proof))):
                break
            else:  # contact, and friction that sticks, are stiff: one more round, of which nothing is lost
                kept = taken, new.copy()
        if kept is not None and taken.outcome != Outcome.OK:
            taken, new = kept
            self.proof(new)
        return taken, new

    def _unstretched(self, states: NetworkState) -> float:
        """Largest force (N) by which a tension is not that of its stretched cell, which a motion would begin with."""
        worst = 0.0
        for x, state in zip(self.lines, states.lines, strict=True):
            if not (x.line.bits & AXIAL_LAW or x.line.tension_twist.size):
                give = x.line.ck > 0.0
                stretched = np.linalg.norm(state.e, axis=1)[give] / x.line.h[give] - 1.0
                left = np.abs(stretched - x.line.ck[give] * state.T[give]) - ROUNDED
                worst = max(worst, float((left / x.line.ck[give]).max(initial=0.0)))
        return worst

    def newton_round(self, states: NetworkState, turning: bool = False) -> NetworkTaken:
        """Static Newton from states at rest, which it overwrites; turning: whether chords are turned.

        Springs of `anchor` times their mass hold nodes and bodies where they are: what is found balances with these.
        """
        for x, work, state in zip(self.lines, self.work, states.lines, strict=True):
            work.u[:], state.soil[:] = 0.0, 0.0
            self._around(x, state, work)
        for contact in self._contacts.values():
            contact.forget()
        if self.shared is not None:
            self.shared.forget()
        limits = Limits(REACH * self.length, self.scale, MOST_TURNING if turning else MOST_ITERATIONS)
        taken = self._solve(Task(EQUILIBRIUM, ca=self.anchor, turning=turning, limits=limits), states, states)
        states.bodies[:, PLACE:FRAME] += self.body_work[:, U : U + 3]
        states.bodies[:, V:] = 0.0
        for x, work, state in zip(self.lines, self.work, states.lines, strict=True):
            state.r[:] += work.u
            state.vd[:], state.wd[:] = 0.0, 0.0  # of the springs
            if x.line.bits & FRICTION:
                state.slip[:] = x.sea.slid
            rest_in_soil(x.line, x.sea, state.r, state.soil)
        return taken

    def is_balanced(self, states: NetworkState, residual: float) -> bool:
        """Whether a largest residual force (N) is round-off of the forces in states."""
        greatest = max(float(np.abs(state.T).max()) for state in states.lines)
        return residual <= BALANCED * (greatest + self.scale)

    def flaw(self, states: NetworkState) -> tuple[Outcome, int, int]:
        """Why a balanced state is no equilibrium (OK: it is one), the line (-1: a point or body), and its node or cell.

        It is stable where lines would not buckle between joints that are held, and points and bodies come back with
        what lines do to them then: these two parts are the second variation.  Not asked where a line touches itself.
        """
        outcome, line, where = flaw_of_lines(self.lines, states)
        if outcome != Outcome.OK or self.in_contact() or self.presses_bodies:
            return outcome, line, where
        self.blurred.clear()
        line = buckling_line(self.lines, states, self.blurred)
        if line >= 0:
            return Outcome.UNSTABLE, line, int(np.argmin(states.lines[line].T))
        return (Outcome.OK if self.is_stable(states) else Outcome.UNSTABLE), -1, -1
