"""`hybrid.response`: standard deviations, spectra and extremes in a stationary sea, linear about the equilibrium.

At every frequency of the scene's waves and motions

    (A - w^2 M - i w C) q = f,      C = C_0 + C_d,

with the matrices of the modes, the damping C_0 of the sections and the bed, and drag C_d that is linear in the mean
square, found by iteration (hybrid.linear.drag).  docs/theory.md, 21.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from scipy import sparse

from hybrid.accuracy.api import run
from hybrid.errors import Complaint, ComputationError, Outcome, SceneError
from hybrid.kernels.algebra.block_elimination import SIZE
from hybrid.kernels.junctions.bodies import DAMPING, FRAME, PLACE, V
from hybrid.kernels.state.state import Floats
from hybrid.linear.excitation import frequencies_of, refuse_motions
from hybrid.linear.loaded_line import LoadedLine, LoadedMembers, stiffness_by_water, turning_doubts
from hybrid.linear.matrices import ComplexSolver, linear_network
from hybrid.linear.response_results import LineResponse, Response
from hybrid.linear.touching import Rest
from hybrid.modal.api import equilibrium_of, of_first_length
from hybrid.modal.validity import closing_doubts, doubts_of, left_out, name_of, touching_doubts
from hybrid.scene.combinations import refuse_use
from hybrid.scene.read import SceneLike, as_scene
from hybrid.scene.root import Scene

ROUNDS = 30  # of the linear drag, at most
SETTLED = 2e-3  # relative change of its largest part at which they end
RELAXED = 0.8  # part of the change that a round makes
FEWER = 4  # of many frequencies one in so many serves for the rounds,
LEAST_FREQUENCIES = 12  # and at least so many: more than FEW of hybrid.linear.drag, whose sum is no normal process
# Part by which a run in time may differ before that is told: short runs of a sea differ by as much.
MOST_APART = 0.15


def response(scene: SceneLike, friction: bool = True, check: float | None = None) -> Response:
    """Response to the waves and harmonic motions of a scene, stationary, linear about its equilibrium.

    Drag is linear in the mean square, found by iteration; the mean drag of the waves is left out.  friction: as of
    `hybrid.modes`.  check: s, of a run in time to compare with.

    SceneError: nothing excites it, or what does is no sum of harmonics; a load changes in time.  ComputationError: no
    equilibrium.
    """
    asked = as_scene(scene)
    refuse_use(asked.written, "response")
    rest = equilibrium_of(asked, friction=friction)
    refuse_motions(rest.models, rest.names)
    omegas = frequencies_of(rest.models, [x.members.sea.waves for x in rest.floats if x.members is not None])
    if not omegas.size:
        expected = "waves, or ends that move as harmonics"
        raise SceneError([Complaint("environment.fluid.waves", "nothing that moves", expected, "add `waves`")])
    run = _Linear(rest, omegas, friction)
    rounds = run.linearize_drag()
    lines = run.results()
    notes = [
        *of_first_length(asked),
        *run.notes(lines),
        *([] if rounds < ROUNDS else [f"linear drag has not settled in {ROUNDS} rounds"]),
    ]
    checks = {} if check is None else compared(asked, lines, check)
    off = {name: there for name, (here, there) in checks.items() if abs(here - there) > MOST_APART * there}
    notes += [
        f"not valid: {name} has a standard deviation of {x:.4g} in a run of {check:g} s" for name, x in off.items()
    ]
    return Response(asked.title, lines, run.points(), run.bodies(), rounds, checks, tuple(notes))


class _Linear:
    """The network in the sea."""

    def __init__(self, rest: Rest, omegas: Floats, sticks: bool) -> None:
        self.rest, self.omegas = rest, omegas
        self.network = linear_network(rest.solver, rest.states, rest.names, sticks, touching=rest.touching)
        self.lines = [
            LoadedLine(x, linear, model, omegas)
            for x, linear, model in zip(rest.solver.lines, self.network.lines, rest.models, strict=True)
        ]
        self.first = self.network.size - 6 * self.network.bodies  # of the unknowns of bodies
        damping, stiffness = [], []
        self.members: dict[int, LoadedMembers] = {}
        for b, (row, state) in enumerate(zip(rest.solver.bodies, rest.states.bodies, strict=True)):
            R = np.kron(np.eye(2), state[FRAME:V].reshape(3, 3))
            damping.append(R @ row[DAMPING : DAMPING + 36].reshape(6, 6) @ R.T)
            stiffness.append(np.zeros((6, 6)))
            members = rest.floats[b].members if b < len(rest.floats) else None
            if members is not None:
                self.members[b] = LoadedMembers(rest.bodies[b], members, state, omegas)
                stiffness[b] = stiffness_by_water(rest.solver, rest.states, b, members)
        self.damping, self.by_water = damping, self._of_bodies(stiffness)
        self.by_touch = self.network.whole.T @ self.network.touching.damping @ self.network.whole
        dragged = bool(self.members) or any(
            x.x.joints[k] >= 0 and x.point_drag[-k] > 0.0 for x in self.lines for k in (0, 1)
        )
        for x in self.lines:
            x.by_drag |= dragged and max(x.x.joints) >= 0
        self.loaded: list[LoadedLine | LoadedMembers] = [*self.lines, *self.members.values()]
        self.solver: ComplexSolver | None = None
        self.vectors = np.zeros((len(omegas), self.network.size), complex)

    def _of_bodies(self, blocks: Sequence[Floats]) -> sparse.csc_array:
        """(q, q) of matrices (6, 6) of the bodies, which are the last of q."""
        return sparse.csc_array(sparse.block_diag([sparse.csc_array((self.first, self.first)), *blocks], format="csc"))

    def linearize_drag(self) -> int:
        """Iterate the linear drag, first by some of the frequencies; rounds that it took."""
        every = np.arange(len(self.omegas))
        some = every[len(every) % FEWER // 2 :: FEWER] if len(every) >= LEAST_FREQUENCIES * FEWER else every
        for x in self.loaded:
            x.blocks = x.drag_blocks(every, start=True)
        for round_ in range(1, ROUNDS + 1):
            self._solve(some)
            worst = 0.0
            for x in self.loaded:
                new = x.drag_blocks(some, start=False)
                size = float(np.abs(new).max(initial=0.0))
                if size > 0.0:
                    worst = max(worst, float(np.abs(new - x.blocks).max()) / size)
                x.blocks = x.blocks + RELAXED * (new - x.blocks)
            if worst < SETTLED:
                if some.size == every.size:
                    return round_
                some = every  # once more, by all
        return ROUNDS

    def _solve(self, which: np.ndarray) -> None:
        """The motion at some of the frequencies, with the drag as it is."""
        P = self.network.place
        dampings = [x.full_damping() for x in self.lines]
        of_bodies = [x + self.members[b].damping() if b in self.members else x for b, x in enumerate(self.damping)]
        C = sparse.csc_array(P.T @ sparse.block_diag(dampings, format="csr") @ P + self.by_touch)
        C = C + self._of_bodies(of_bodies)
        if self.solver is None or not self.solver.replace(2, C):
            stiffness = self.network.stiffness + self.network.skew + self.by_water
            self.solver = ComplexSolver([stiffness, self.network.mass, C])
        right = P.T @ np.concatenate(
            [x.loads(which, damping) for x, damping in zip(self.lines, dampings, strict=True)], axis=0
        )
        for b, members in self.members.items():
            right[self.first + 6 * b : self.first + 6 * b + 6] += members.loads(which)
        touching, held = self.network.touching, self._held(which)
        by_rates = touching.damping @ held * (-1j * self.omegas[which])
        right = right - self.network.whole.T @ (touching.stiffness @ held + by_rates)
        for column, f in enumerate(which):
            self.vectors[f] = self.answer(self.omegas[f], right[:, column])
        whole = (P @ self.vectors[which].T).T
        for x, a, b in zip(self.lines, self.network.at[:-1], self.network.at[1:], strict=True):
            x.set_motion(which, whole[:, a:b].reshape(which.size, -1, SIZE))
        for b, members in self.members.items():
            members.q[which] = self.vectors[which, self.first + 6 * b : self.first + 6 * b + 6]

    def _held(self, which: np.ndarray) -> Any:
        """(unknowns of what touches, F) m, of ends that are held and move."""
        moved = np.zeros((self.network.whole.shape[0], which.size), complex)
        for x, a, b in zip(self.lines, self.network.at[:-1], self.network.at[1:], strict=True):
            for k, at in ((0, a), (1, b - SIZE)):
                if x.x.joints[k] < 0:
                    moved[at + 1 : at + 4] = x.shifts[which, k].T
        return moved

    def answer(self, w: float, right: Any) -> Any:
        """Amplitudes (q,) of exp(-i w t) by loads (q,), with the drag as it was found last; w: 1/s."""
        assert self.solver is not None  # of the last round
        try:
            return self.solver.solve((1.0, -w * w, -1j * w), right)
        except RuntimeError:
            detail = f"at {w / (2.0 * np.pi):.4g} Hz, where nothing damps a mode"
            raise ComputationError(Outcome.SINGULAR, None, None, detail) from None

    def results(self) -> dict[str, LineResponse]:
        """Of each line, by its name."""
        found = left_out(self.network, self.lines, self.members, self.answer)
        return {x.name: each for x, each in zip(self.lines, found, strict=True)}

    def points(self) -> dict[str, Floats]:
        """Complex shifts (F, 3) m of free points."""
        first = self.network.size - 3 * self.network.points - 6 * self.network.bodies
        return {name: self.vectors[:, first + 3 * k : first + 3 * k + 3] for k, name in enumerate(self.rest.points)}

    def bodies(self) -> dict[str, Floats]:
        """Complex shifts and turns (F, 6) m, rad of free bodies."""
        first = self.first
        return {name: self.vectors[:, first + 6 * k : first + 6 * k + 6] for k, name in enumerate(self.rest.bodies)}

    def _carry_obstacles(self) -> None:
        """Let lines know how obstacles move that bodies carry."""
        moves = [self.vectors[:, self.first + 6 * b : self.first + 6 * b + 6] for b in range(self.network.bodies)]
        for x in self.lines:
            for k, b in enumerate(x.x.rides):
                if b >= 0:
                    arms = x.linear.r - self.rest.states.bodies[b, PLACE:FRAME]
                    x.carried[k] = moves[b][:, None, :3] + np.cross(moves[b][:, None, 3:], arms)

    def notes(self, found: Mapping[str, LineResponse]) -> Iterator[str]:
        """Where the motion is too large to be linear."""
        every = np.arange(len(self.omegas))
        moved = self.network.whole @ self.vectors.T + self._held(every)
        for touch in self.network.touching.touches:
            yield from (f"not valid: {text}" for text in touching_doubts(touch, name_of(touch, self.rest), moved))
        yield from (f"not valid: {text}" for text in closing_doubts(self.rest, found))
        self._carry_obstacles()
        for x in self.lines:
            name = f"line {x.name}: " if len(self.lines) > 1 else ""
            yield from (f"{name}not valid: {text}" for text in doubts_of(x, found[x.name]))
        for name, q in self.bodies().items():
            yield from (f"not valid: {text}" for text in turning_doubts(name, q))
        for members in self.members.values():
            yield from (f"not valid: {text}" for text in members.doubts())


# A response by frequency held against a run in time of the same scene.

# Part of the run that is left out, in which the motion begins; outputs to the shortest period that counts.
BEGINS, PER_PERIOD = 0.25, 12
# Steps of a scene that names none, of that period.
STEPS = 60
CHECKED = ("tension", "curvature")


def compared(asked: Scene, lines: Mapping[str, LineResponse], duration: float) -> dict[str, tuple[float, float]]:
    """Standard deviations where each quantity varies most, by frequency and in a run of `duration` (s)."""
    if not 0.0 < duration < np.inf:
        raise SceneError([Complaint("check", f"{duration:g}", "a time > 0, in s", "--check 600")])
    periods = [float(np.median(x.period("tension")[x.period("tension") > 0.0])) for x in lines.values()]
    period = min(periods)
    data: dict[str, Any] = asked.model_dump(mode="json", exclude_none=True)
    time = asked.time
    step = time.step if time is not None and time.step is not None else period / STEPS
    data["time"] = {"duration": duration / (1.0 - BEGINS), "step": step}
    data["output"] = {"every": period / PER_PERIOD}
    data.pop("accuracy", None)
    result: Any = run(as_scene(data))
    found = {}
    for name, line in lines.items():
        one = result.lines[name] if result.lines else result
        late = one.times > BEGINS * duration / (1.0 - BEGINS)
        for what in CHECKED:
            deviation = line.deviation(what)
            places = line.middle if what == "tension" else line.s
            at = int(deviation.argmax())
            column = int(np.abs(one.s - places[at]).argmin())
            there = float(np.asarray(getattr(one, what))[late][:, column].std())
            here = float(np.interp(one.s[column], places, deviation))
            found[f"{name} {what}" if len(lines) > 1 else what] = (here, there)
    return found
