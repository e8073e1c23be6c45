"""Motion by shooting: generalized-alpha in time, one march along s per Newton iteration.

The scheme is the first-order generalized-alpha of Jansen, Whiting & Hulbert (2000), written as
Arnold & Bruels do: the field equations hold at t_{n+1}, and only what is differentiated in time
has a history, by an auxiliary rate a,

    (1 - am) a' + am a = (1 - af) y_t' + af y_t        y' = y + dt ((1 - ga) a + ga a')
    am = (3 rho - 1) / (2 (rho + 1))   af = rho / (rho + 1)   ga = 1/2 + af - am

so y_t' = c0 y' + history with c0 = (1 - am) / ((1 - af) ga dt): second order, rho = time.rho_inf.
y is (v, w, k, e, x, turn) on a rod, v, w, k in body axes as GP differentiate them, and
(v, (1+e) t, x) on a catenary.  The frame follows the spin as a Lie group element, R' = R exp(turn),
the position the velocity: second order, like the rest.  GP (1), (6) and (7) say that x' = (1+e) t and
R' = R hat(k) only by their rates, so the errors of the time scheme would pile up; each step therefore
adds to the rates the gap left at its start, divided by SETTLE steps (third order small, and a line
that comes to rest does so in the equilibrium of statics.py).

The accelerations at the start are not known.  A trial step of backward Euler (am = af = 0, ga = 1)
finds them to first order, and the first step then starts from the same state with these: one step
of that costs an error of second order.  (Keeping the trial step is of second order too, but eats
5 % of a swing resolved by 20 steps, against 1 %.)
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from hybrid.scene.analysis import Equilibrium
from hybrid.scene.root import Scene

from .conditions import SETTLE, Before
from .fields import PLACE, TURN, CatenaryFields, Clock, Fields, RodFields, moved
from .guess import given
from .line import Line, Piece, line_of, refuse
from .newton import Outcome, Problem, Solved, newton
from .rotations import Array, log
from .state import ShootingState, state_of
from .statics import equilibrium


@dataclass(frozen=True)
class Scheme:
    """Coefficients of one step of length dt (s)."""

    am: float
    af: float
    ga: float
    dt: float

    @property
    def c0(self) -> float:
        return (1.0 - self.am) / ((1.0 - self.af) * self.ga * self.dt)

    def history(self, y: Array, rate: Array, a: Array) -> Array:
        """What to add to c0 y' for the rate at the end of the step."""
        out: Array = (self.am * a - self.af * rate) / (1.0 - self.af) - self.c0 * (y + self.dt * (1.0 - self.ga) * a)
        return out

    def auxiliary(self, y: Array, new: Array, a: Array) -> Array:
        out: Array = (new - y - self.dt * (1.0 - self.ga) * a) / (self.ga * self.dt)
        return out


def generalized_alpha(rho: float, dt: float) -> Scheme:
    am, af = (3.0 * rho - 1.0) / (2.0 * (rho + 1.0)), rho / (rho + 1.0)
    return Scheme(am, af, 0.5 + af - am, dt)


def backward_euler(dt: float) -> Scheme:
    return Scheme(0.0, 0.0, 1.0, dt)


@dataclass(frozen=True)
class Past:
    """Per piece: what has a history (n, k), its rate and the auxiliary rate."""

    y: Array
    rate: Array
    a: Array


def _differentiated(piece: Piece, y: Fields, turn: Array | None) -> Array:
    """(v, w, k, e, x, turn) (n, 16) of a rod, (v, (1+e) t, x) (n, 9) of a catenary."""
    if isinstance(y, CatenaryFields):
        return np.concatenate([y.v, (1.0 + piece.compliance * y.T)[:, None] * y.t, y.x], 1)
    e = piece.compliance * y.f[:, 2:]
    return np.concatenate([y.v, y.w, y.k, e, y.x, np.zeros_like(y.x) if turn is None else turn], 1)


def _clock(scheme: Scheme, past: Past, y: Fields) -> Clock:
    h = scheme.history(past.y, past.rate, past.a)
    if isinstance(y, CatenaryFields):
        none = np.zeros_like(y.x)
        return Clock(scheme.c0, h[:, 6:], h[:, :3], h[:, 3:6], none, none, none[:, 0], none, none)
    return Clock(scheme.c0, h[:, 10:13], h[:, :3], h[:, :3], h[:, 3:6], h[:, 6:9], h[:, 9], h[:, 13:], y.R)


class ShootingRun:
    """A motion, step by step; `state` is the line now, `advance()` goes one step on.

    Errors: SceneError for what the arbiter cannot do, ArbiterError where it dies.
    """

    def __init__(self, scene: Scene) -> None:
        if scene.time is None or scene.time.step is None:
            raise refuse("time", None, "a duration and a step", "add time: {duration: 10, step: 0.01}")
        self.line: Line = line_of(scene)
        self.step: float = scene.time.step
        self.rho = scene.time.rho_inf
        self.duration = scene.time.duration
        self.taken = 0
        if isinstance(scene.initial, Equilibrium):
            self._solved = equilibrium(self.line)
        else:
            self._solved = Solved(given(self.line), Outcome.OK, 0, 0.0, 0.0, 1.0, 1.0)
        self._past = []
        for piece, y in zip(self.line.pieces, self._solved.fields, strict=True):
            now = _differentiated(piece, y, None)
            self._past.append(Past(now, np.zeros_like(now), np.zeros_like(now)))

    @property
    def t(self) -> float:
        """Time reached, s."""
        return self.taken * self.step

    @property
    def state(self) -> ShootingState:
        return state_of(self.line, self._solved, self.t)

    def advance(self) -> ShootingState:
        """One step on; the run stays where it was if the step fails."""
        if self.taken == 0:
            self._past = self._begun(self._stepped(backward_euler(self.step))[1])
        self._solved, self._past = self._stepped(generalized_alpha(self.rho, self.step))
        self.taken += 1
        return self.state

    def _stepped(self, scheme: Scheme) -> tuple[Solved, list[Past]]:
        """The line and its past one step on by this scheme."""
        old, t = self._solved.fields, (self.taken + 1) * self.step
        clocks = [_clock(scheme, past, y) for past, y in zip(self._past, old, strict=True)]
        settle = 1.0 / (SETTLE * self.step)
        drift = [_drift(piece, y, settle) for piece, y in zip(self.line.pieces, old, strict=True)]
        problem = Problem(self.line, t, clocks, (self._before(0), self._before(-1)), drift)
        solved = newton(problem, [_started(y, clock) for y, clock in zip(old, clocks, strict=True)]).demand(t)
        past = []
        for piece, clock, then, y in zip(self.line.pieces, clocks, self._past, solved.fields, strict=True):
            new = _differentiated(piece, y, clock.turned(y.w) if isinstance(y, RodFields) else None)
            rate = scheme.c0 * new + scheme.history(then.y, then.rate, then.a)
            a = scheme.auxiliary(then.y, new, then.a)
            if isinstance(y, RodFields):
                new[:, 13:] = 0.0  # the next turn is counted from here
            past.append(Past(new, rate, a))
        return solved, past

    def _begun(self, trial: list[Past]) -> list[Past]:
        """The past at the start: accelerations of the trial, velocities as given, shape and strain at rest."""
        out = []
        for y, past, tried in zip(self._solved.fields, self._past, trial, strict=True):
            rate = np.zeros_like(past.rate)
            if isinstance(y, RodFields):
                rate[:, :6] = tried.rate[:, :6]
                rate[:, 10:13], rate[:, 13:] = np.einsum("nij,nj->ni", y.R, y.v), y.w
            else:
                rate[:, :3], rate[:, 6:] = tried.rate[:, :3], y.v
            out.append(Past(past.y, rate, rate))
        return out

    def _before(self, i: int) -> Before:
        y = self._solved.fields[i]
        return Before(self.t, self.step, y.x[i], y.R[i] if isinstance(y, RodFields) else None)


def _drift(piece: Piece, y: Fields, rate: float) -> Array:
    """What to add to the compatibility of the cells (n-1, m) so that shape and fields agree again; rate 1/s."""
    h = np.diff(piece.s)[:, None]
    out = np.zeros((len(h), piece.unknowns))
    mean = lambda b: 0.5 * h * (b[1:] + b[:-1])  # noqa: E731
    if isinstance(y, CatenaryFields):
        out[:, PLACE] = -rate * (mean((1.0 + piece.compliance * y.T)[:, None] * y.t) - np.diff(y.x, axis=0))
        return out
    gap = mean((1.0 + piece.compliance * y.f[:, 2:]) * y.R[:, :, 2]) - np.diff(y.x, axis=0)
    out[:, PLACE] = -rate * np.einsum("nji,nj->ni", 0.5 * (y.R[1:] + y.R[:-1]), gap)
    out[:, TURN] = -rate * (mean(y.k) - log(np.swapaxes(y.R[:-1], 1, 2) @ y.R[1:]))
    return out


def _started(y: Fields, clock: Clock) -> Fields:
    """First iterate of a step: the old velocities, and the positions and frames they lead to."""
    if isinstance(y, CatenaryFields):
        return replace(y, x=(y.v - clock.x) / clock.c0)
    return moved(y, np.zeros((len(y.x), 12)), clock)


def simulate(scene: Scene, on_state: Callable[[ShootingState], None]) -> None:
    """Run the scene; `on_state` is called at t = 0 and after every step."""
    run = ShootingRun(scene)
    on_state(run.state)
    for _ in range(round(run.duration / run.step)):
        on_state(run.advance())
