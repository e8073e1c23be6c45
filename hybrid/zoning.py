"""Zones that move: carries out what the domain manager proposes on a model, its state and its books."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from hybrid.adapt.manager import Change, DomainManager
from hybrid.adapt.plan import spread, wanted
from hybrid.adapt.remap import remap
from hybrid.model.build import Model
from hybrid.model.layout import Layout
from hybrid.model.line import line_on
from hybrid.model.state import Ends, Floats, Line, Sea, State
from hybrid.physics.loads import FRICTION, SEABED
from hybrid.physics.seabed import stored
from hybrid.solve.observe import observe
from hybrid.solve.statics import Equilibrium, solve_statics

# A stretch that has become chords, or arcs, is let go to its true length over this many dwell times.
LETTING_GO = 1.0
# Dwell of a scene that does not say: a part of the time of a transverse wave along the line, and some time steps.
DWELL, LEAST_DWELL = 0.25, 20
# Rounds of zones and equilibrium at the start: each only adds rod, so they end.
MOST_ROUNDS = 10


@dataclass
class Relaxing:
    """Cells on their way to their true length: what they lacked (N,) m, its rate (N,) m/s, when it began (N,) s."""

    lack: Floats
    rate: Floats
    since: Floats

    def at(self, t: float, duration: float) -> tuple[Floats, bool]:
        """What they lack at t, and whether any still lacks something: a quintic from value and slope to rest."""
        x = np.clip((t - self.since) / duration, 0.0, 1.0)
        value = 1.0 - x**3 * (10.0 - 15.0 * x + 6.0 * x * x)
        slope = x * (1.0 - x) ** 3 * (1.0 + 3.0 * x)
        return self.lack * value + duration * self.rate * slope, bool((x < 1.0).any())


def manager_for(model: Model, tolerance: float, dwell: float | None, given: np.ndarray, step: float) -> DomainManager:
    """The domain manager of a model; tolerance as a part of the length, step: time step, s."""
    assert model.layout is not None
    wait = dwell if dwell is not None else max(DWELL * model.time_scale, LEAST_DWELL * step)
    return DomainManager(model.cable, model.layout, tolerance * model.length, wait, given, model.tension_scale)


def on_layout(model: Model, layout: Layout) -> Model:
    """The same model with other zones; its start is not touched."""
    more = model.line.bits & (SEABED | FRICTION)
    line = line_on(model.cable, layout.nodes, layout.rod_cells, more, sections_turn=False)
    return replace(model, line=line, zones=layout.zones, layout=layout, sea=model.sea.on(line.h.size))


def first_zones(model: Model, manager: DomainManager, t: float, **how: object) -> tuple[Model, Equilibrium]:
    """Zones for an equilibrium, and the equilibrium: all rod first, then rod where the criteria ask for it."""
    found = _equilibrium(model, t, model.start)
    layout = model.layout
    assert layout is not None
    fine = layout.nodes
    full = found.state
    manager.weigh(model.line, model.sea.at(t), model.ends.at(t), full, 0.0)
    rod = _asked(manager, full)
    best = (model, found)
    for _ in range(MOST_ROUNDS):
        new = on_layout(model, layout._replace(rod=rod))
        start = _picked(full, fine, new.line)
        try:
            answer = _equilibrium(new, t, start)
        except Exception:
            return best
        manager.follow(new.layout)  # type: ignore[arg-type]
        manager.weigh(new.line, new.sea.at(t), new.ends.at(t), answer.state, 0.0)
        more = rod | _asked(manager, answer.state)
        if (more == rod).all():
            return new, answer
        rod = more
    return best


def _asked(manager: DomainManager, state: State) -> np.ndarray:
    """Base cells that ask to be rod, after `weigh`, which then begins anew."""
    n = manager.layout.rod.size
    asks = wanted(manager.ratios, np.zeros(n, bool)) | (manager.given > 0)
    out = spread(asks, manager.layout.base, manager.rules(state).buffer)
    manager.ratios[:] = 0.0
    return np.asarray(out & (manager.given >= 0))


def _equilibrium(model: Model, t: float, start: State) -> Equilibrium:
    return solve_statics(
        model.line, model.sea.at(t), model.ends.at(t), start, model.length, model.tension_scale, model.slack_floor,
        shape=model.start_shape,
    )  # fmt: skip


def _picked(state: State, s: Floats, line: Line) -> State:
    """The state at the nodes of a coarser line, a subset of the nodes s."""
    from hybrid.model.state import blank_state

    at = np.searchsorted(s, line.s - 1e-9 * s[-1])
    out = blank_state(line.h.size)
    out.r[:] = state.r[at]
    out.e[:] = np.diff(out.r, axis=0)
    out.T[:] = state.T[at[:-1]]
    d = out.e / np.linalg.norm(out.e, axis=1)[:, None]
    a = state.a1[at[:-1]]
    a = a - np.einsum("ij,ij->i", a, d)[:, None] * d
    out.a1[:] = a / np.linalg.norm(a, axis=1)[:, None]
    return out


class Zoning:
    """The zones of one motion."""

    def __init__(self, model: Model, manager: DomainManager) -> None:
        self.model, self.manager = model, manager
        self.stiff = model.line.kb.copy()  # N m, with all bending
        self.true = model.line.h.copy()
        self.lengths = self.true.copy()  # m, at the end of the last step
        self.relaxing: Relaxing | None = None
        self.letting_go = False
        self.switches = 0

    def look(self, t: float, dt: float, ends: Ends, state: State) -> Change | None:
        """Weigh the criteria after a step of dt."""
        manager = self.manager
        manager.weigh(self.model.line, self.model.sea.values, ends, state, dt)
        return manager.review(t, state) if manager.due(t) else None

    def prepare(self, end: float) -> None:
        """Give cells on their way to their true length the one they have at the end of the step that comes."""
        if self.relaxing is not None:
            lack, self.letting_go = self.relaxing.at(end, LETTING_GO * self.manager.dwell)
            self.model.line.h[:] = self.true - lack

    def settle(self, dt: float, ends: Ends, before: State, state: State) -> float:
        """After a step from `before` to `state`: the energy (J) of lengths let go in it, and of bending blended now."""
        booked = 0.0
        line = self.model.line
        if self.relaxing is not None:
            booked -= 0.5 * float((before.T + state.T) @ (line.h - self.lengths))
            self.lengths[:] = line.h
            if not self.letting_go:
                self.relaxing = None
        if self.manager.going or self.manager.coming:
            parts = self.manager.blend(dt)
            was = _bending(line, ends, state)
            line.kb[:] = parts[:, None] * self.stiff
            booked += _bending(line, ends, state) - was
        return booked

    def switch(self, change: Change, t: float, ends: Ends, state: State, sea: Sea) -> tuple[Model, State, float]:
        """The model and the state with other zones, and the energy (J) that the switch puts in."""
        old, manager, model = self.manager.layout, self.manager, self.model
        new = old._replace(rod=change.rod)
        was = _energy(model.line, sea, ends, state)
        changed = on_layout(model, new)
        target = changed.line
        n = new.rod.size
        kinks = np.zeros(n + 1, bool)
        kinks[np.searchsorted(new.base, model.cable.at - 1e-9 * model.length)] = True
        carried = remap(old, new, model.line, target, state, kinks, np.zeros(n))
        fresh = new.rod & ~old.rod
        manager.grown[fresh], manager.leaving[fresh] = 0.0, False
        manager.grown[~new.rod], manager.leaving[~new.rod] = 1.0, False
        manager.calm_since[fresh] = np.inf
        manager.follow(new)
        self.stiff, self.true = target.kb.copy(), target.h.copy()
        target.kb[:] = manager.parts()[:, None] * self.stiff
        target.h[:] = carried.lengths
        self.lengths = carried.lengths.copy()
        # new cells go on with the length, and the change of length, that their ends and tension imply
        kept_now, kept_then = (np.repeat(old.rod == new.rod, x.counts) for x in (new, old))
        d = carried.state.e / np.linalg.norm(carried.state.e, axis=1)[:, None]
        rate = -np.einsum("ij,ij->i", d, np.diff(carried.state.v, axis=0)) / (1.0 + target.ck * carried.state.T)
        lack, since = self.true - carried.lengths, np.full(target.h.size, t)
        lack[kept_now], rate[kept_now], since[kept_now] = 0.0, 0.0, -np.inf
        if self.relaxing is not None:  # what was on its way goes on
            for mine, its in ((lack, self.relaxing.lack), (rate, self.relaxing.rate), (since, self.relaxing.since)):
                mine[kept_now] = its[kept_then]
        self.relaxing = Relaxing(lack, rate, since)
        self.model = changed
        self.switches += 1
        return changed, carried.state, _energy(target, changed.sea.values, ends, carried.state) - was


def _observed(line: Line, ends: Ends, state: State) -> Floats:
    n = line.h.size
    M, strain, energy = np.zeros((n + 1, 3)), np.zeros((n + 1, 3)), np.zeros(4)
    observe(line, ends, state.e, state.v, state.a1, state.w, M, strain, energy)
    return energy


def _bending(line: Line, ends: Ends, state: State) -> float:
    return float(_observed(line, ends, state)[1:3].sum())


def _energy(line: Line, sea: Sea, ends: Ends, state: State) -> float:
    """All energy of a state, J."""
    contact = stored(line, sea, state.r) if line.bits & SEABED else 0.0
    return float(_observed(line, ends, state).sum() - np.sum(line.force * state.r) + contact)
