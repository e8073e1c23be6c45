"""Equilibria of systems with lines that touch themselves: whether one does, and the damped motion to them."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from itertools import chain, pairwise

import numpy as np

from hybrid.errors import Outcome
from hybrid.kernels.state.report import FRICTION, OBSTACLES, SELF_CONTACT
from hybrid.kernels.state.state import Floats, State
from hybrid.model.build import Model
from hybrid.model.initial_shape import GIVEN, HUNG, first_state, hung
from hybrid.model.lines_contact import touching_among
from hybrid.model.network import NetworkModel
from hybrid.scene.network_scene import Network
from hybrid.simulation.contact_equilibrium import KEPT, contact_of, keeps_turns, nearness, passes_itself
from hybrid.simulation.lines_contact import crossed, shared_of, watched_pairs
from hybrid.solve.contact_statics import settled_system, touching_solver
from hybrid.solve.flaws import behind_obstacles, passed_obstacles
from hybrid.solve.joined import JoinedLine, LineFailed, NetworkState
from hybrid.solve.lines_at_rest import LinesAtRest, lines_at_rest
from hybrid.solve.network_solver import NetworkSolver
from hybrid.solve.search import Start, Tally, in_slower_currents, is_in_current
from hybrid.solve.self_contact import SelfContact
from hybrid.solve.shared_contact import SharedContact

# Turns by which an equilibrium without contact may differ from its start, whose shape may have a writhe of its own.
OF_SHAPE = 0.5
# Parts of a current by whose equilibria lines come to that in all of it.
SLOWER = tuple(np.linspace(0.875, 0.0, 8).tolist())


def solve_with_contact(
    model: NetworkModel, lines: Sequence[JoinedLine], bodies: Floats, starts: Callable[[], Iterator[Start]]
) -> LinesAtRest:
    """As `lines_at_rest`; of lines that contact is asked for, and that would touch, have lost turns of their
    ends or have passed through each other on the way from their first shapes, that to which a damped motion with
    contact leads from the first start that is apart; the last start is the equilibrium without contact.

    starts: begins anew at every call.  An equilibrium within itself comes back where no start is apart.
    """
    try:
        found = _on_the_side_of_the_span(model, lines, bodies, starts)
    except LineFailed as failed:
        if not any(_touch(lines)) or (first := _first_apart(model, lines, bodies, starts())) is None:
            raise
        try:
            return settle(model, lines, bodies, first)
        except LineFailed as too:
            tried = "\n              ".join(x for x in (failed.detail, too.detail) if x)
            raise LineFailed(failed.line, failed.outcome, None, failed.s, tried) from None
    if not any(_touch(lines)):
        return found
    first_shapes = _before_current(model)
    lost = _has_lost(lines, first_shapes, found)
    lost = lost or _passes_another(model, lines, bodies, first_shapes, found.state)
    each = zip(_touch(lines), model.models, found.state.lines, strict=True)
    lost = lost or any(touches and passes_itself(x, state) for touches, x, state in each)
    if not (lost or _largest_energy(model, lines, bodies, found.state)):
        return found
    last: list[Start] = [] if lost else [("the equilibrium without contact", found.state)]
    before = [("lines hung in still water", first_shapes)] if model.touching is not None else []
    first = _first_apart(model, lines, bodies, chain(before, starts(), last))
    return found if first is None else settle(model, lines, bodies, first)


def _passes_another(
    model: NetworkModel, lines: Sequence[JoinedLine], bodies: Floats, first: NetworkState, found: NetworkState
) -> bool:
    """Whether a line passes through another one from its first shape to an equilibrium that knows no contact.

    Where a current acts by the equilibria while it grows, as far as there are any: two lines that pass through each
    other twice, first in a weak current and again in a strong one, do not on the straight way.
    """
    if model.touching is None:
        return False
    way = [found]
    if any(is_in_current(lines[k].line, lines[k].sea) for k in model.touching.lines):
        smooth = [x._replace(line=x.line._replace(bits=x.line.bits & ~FRICTION)) for x in lines]
        solver = NetworkSolver(smooth, len(model.free), bodies.copy())
        way += in_slower_currents(solver, found, SLOWER, Tally()) or []
    return any(True for a, b in pairwise((first, *way[::-1])) for _ in crossed(model.touching, a, b))


def crossings(system: Network, model: NetworkModel, rest: NetworkState) -> list[tuple[int, int]]:
    """Numbers of lines, two each, without contact, that cross on the straight way from first shapes to an equilibrium.

    A first shape says on which side of another line one lies where the scene gives it, or it hangs between held places.
    """
    known = [
        x.start_shape == GIVEN or not (system.is_joined(line.start) or system.is_joined(line.end))
        for x, line in zip(model.models, system.lines.values(), strict=True)
    ]
    pairs = [(a, b) for a, b in watched_pairs(system, model) if known[a] and known[b]]
    touching = touching_among(system, model.scenes, pairs)
    if touching is None:
        return []
    return [*crossed(touching, _before_current(replace(model, touching=touching)), rest)]


def _before_current(model: NetworkModel) -> NetworkState:
    """The first shapes of all lines, of those that touch others as they hang in still water.

    They say on which side of another line each lies: a current that comes then drives it against the other one, and
    not through it.
    """
    states = [x.start for x in model.models]
    for k in model.touching.lines if model.touching is not None else ():
        x, scene = model.models[k], model.scenes[model.names[k]]
        sea = x.sea.values
        if x.start_shape == HUNG and is_in_current(x.line, sea):
            shape = hung(scene, x.line, sea._replace(current=np.zeros_like(sea.current)))
            if shape is not None:
                states[k] = first_state(scene, x.line, x.cable, x.sea, x.tension_scale, shape)[0]
    return NetworkState(states, model.body_places)


def _on_the_side_of_the_span(
    model: NetworkModel, lines: Sequence[JoinedLine], bodies: Floats, starts: Callable[[], Iterator[Start]]
) -> LinesAtRest:
    """As `lines_at_rest`, and where a way leads there, with lines that hang on obstacles on the side of their

    straight spans, and others on that of the shapes that the scene gives, as one cable does.
    """
    there = [k for k, x in enumerate(model.models) if x.line.bits & OBSTACLES and len(x.sea.values.obstacles)]
    hung, given = ([k for k in there if model.models[k].start_shape == shape] for shape in (HUNG, GIVEN))

    def behind(states: NetworkState) -> tuple[Outcome, int, int]:
        for k in hung:
            x = model.models[k]
            for _, node in behind_obstacles(x.line, x.sea.values, states.lines[k]):
                return Outcome.BURIED, k, node
        for k in given:
            x = model.models[k]
            for _, node in passed_obstacles(x.sea.values, x.start.r, states.lines[k].r):
                return Outcome.BURIED, k, node
        return Outcome.OK, -1, -1

    if there:
        try:
            others = _other_starts(model, hung)
            return lines_at_rest(lines, len(model.free), bodies.copy(), starts(), others, behind)
        except LineFailed:  # where no way leads there, the other side may be meant
            pass
    return lines_at_rest(lines, len(model.free), bodies, starts())


def _other_starts(model: NetworkModel, hung: Sequence[int]) -> Iterator[Start]:
    """The first shapes with arcs, then with straight spans, for the lines of these numbers."""
    for name in dict.fromkeys(name for k in hung for name, _ in model.models[k].other_starts):
        first = [x.start.copy() for x in model.models]
        for k in hung:
            first[k] = dict(model.models[k].other_starts).get(name, first[k]).copy()
        yield f"{name} of lines on obstacles", NetworkState(first, model.body_places)


def settle(
    model: NetworkModel, lines: Sequence[JoinedLine], bodies: Floats, start: NetworkState, near: bool = False
) -> LinesAtRest:
    """The equilibrium with contact that a damped motion reaches from a start that is apart; near: as of that."""
    keeps = keeps_turns(lines, start, KEPT)
    return settled_system(lines, len(model.free), bodies.copy(), start, lambda: contacts_of(model), keeps, near)


def contacts_of(model: NetworkModel) -> tuple[list[SelfContact | None], SharedContact | None]:
    """Contact without friction of each line that it is asked for, and of lines with each other."""
    own = [contact_of(x) if touches_alone(model, k) else None for k, x in enumerate(model.models)]
    return own, shared_of(model)


def touches_alone(model: NetworkModel, number: int) -> bool:
    """Whether contact is asked for of a line with itself, and not with others."""
    others = model.touching.lines if model.touching is not None else ()
    return bool(model.models[number].line.bits & SELF_CONTACT) and number not in others


def energy_of(x: JoinedLine, model: Model, state: State) -> float:
    """Energy, J, of contact of a line at rest; infinite: parts are in each other."""
    return contact_of(model).energy_of(x.line, x.ends, state)


def _touch(lines: Iterable[JoinedLine]) -> list[bool]:
    return [bool(x.line.bits & SELF_CONTACT) for x in lines]


def _largest_energy(model: NetworkModel, lines: Sequence[JoinedLine], bodies: Floats, state: NetworkState) -> float:
    """Of all lines that contact is asked for, J."""
    each = enumerate(zip(lines, model.models, state.lines, strict=True))
    found = [energy_of(*x) for k, x in each if touches_alone(model, k)]
    if model.touching is not None:
        found.append(energy_between(model, lines, bodies, state)[0])
    return max(found)


def energy_between(
    model: NetworkModel, lines: Sequence[JoinedLine], bodies: Floats, state: NetworkState
) -> tuple[float, SharedContact]:
    """Energy, J, of contact of lines with each other at rest, and that contact; infinite: they are in each other."""
    solver = touching_solver(lines, len(model.free), bodies, lambda: ([], shared_of(model)))
    assert solver.shared is not None
    return solver.contact_energy(state), solver.shared


def nearness_in(model: NetworkModel, lines: Sequence[JoinedLine], found: LinesAtRest, t: float) -> dict[int, Floats]:
    """How near nodes (N+1,) of lines at rest are to what they may touch, by number: above 1, nearer than two diameters.

    Lines that touch neither themselves nor others are not in it.
    """
    each = enumerate(zip(model.models, found.state.lines, strict=True))
    near = {k: nearness(x, t, state) for k, (x, state) in each if touches_alone(model, k)}
    if model.touching is not None:
        bodies = found.bodies
        solver = touching_solver(lines, len(model.free), bodies, lambda: ([], shared_of(model)))
        assert solver.shared is not None
        near |= solver.shared.look_ahead(1.0)
        solver.contact_energy(found.state)
    return near


def _first_apart(
    model: NetworkModel, lines: Sequence[JoinedLine], bodies: Floats, starts: Iterable[Start]
) -> NetworkState | None:
    """The first start in which no line is within itself, or another."""
    return next((state for _, state in starts if math.isfinite(_largest_energy(model, lines, bodies, state))), None)


def _has_lost(lines: Sequence[JoinedLine], hung: NetworkState, found: LinesAtRest) -> bool:
    """Whether an equilibrium that knows no contact has lost turns, against its lines hung between first places."""
    return bool(keeps_turns(lines, hung, OF_SHAPE)(found.state)[1])
