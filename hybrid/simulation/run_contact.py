"""Lines of a system that touch themselves: from when on, and what the equilibrium of those that ask for it is like."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from functools import partial

import numpy as np
from numpy.typing import NDArray

from hybrid.errors import Complaint, Outcome, SceneError
from hybrid.kernels.state.books import ZONES
from hybrid.kernels.state.report import MAY_TOUCH, SELF_CONTACT_ENERGY
from hybrid.model.network import NetworkModel
from hybrid.model.self_reach import touching, touching_no_more
from hybrid.simulation.contact_equilibrium import contact_of
from hybrid.simulation.lines_contact import PASSED, pair_text
from hybrid.simulation.lines_contact_equilibrium import energy_between, touches_alone
from hybrid.simulation.lines_contact_start import (
    GIVEN_UP,
    given_up,
    given_up_text,
    lines_near,
    touch_each_other,
    touching_now,
)
from hybrid.simulation.run_of_lines import RunOfLines, change_lines
from hybrid.simulation.self_watch import deepest_text, diameters
from hybrid.solve.joined import JoinedLine, LineFailed, NetworkState
from hybrid.solve.shared_contact import SharedContact
from hybrid.store.envelope import meeting_text

# Diameters by which ways from a joint to where lines that lie along each other meet differ at most.
ALONG = 2.0
# Where lines are that are said to be within themselves.
WITHOUT_CONTACT, AT_START = "in the equilibrium without contact", "at the start"


def refuse_within_itself(
    system: NetworkModel, lines: Sequence[JoinedLine], state: NetworkState, moves: bool, where: str = WITHOUT_CONTACT
) -> None:
    """SceneError: a line for which contact is asked is within itself at the start; where: what that is.

    In an equilibrium without contact so is every start from which a damped motion with contact could lead to another.
    moves: whether a motion begins there, which may begin in contact; an equilibrium alone must be apart.
    """
    if system.touching is not None:
        _refuse_within_others(system, lines, state, moves, where)
    for k, (name, model, x, one) in enumerate(zip(system.names, system.models, lines, state.lines, strict=True)):
        if not touches_alone(system, k):
            continue
        contact = contact_of(model)
        energy = contact.energy_of(x.line, x.ends, one)
        if energy == 0.0 or (moves and math.isfinite(energy)):
            continue
        given = f"self: true, and {where} {deepest_text(contact, model)}"
        expected = "a start in which the line is apart"
        fix = f"lines.{name}.initial: {{points: [...]}}, such as a wide U, a smaller diameter, or leave contact out"
        if where == WITHOUT_CONTACT:
            contact.energy_of(x.line, x.ends, model.start)
            first = deepest_text(contact, model)
            expected = "a first shape in which the line is apart, for a damped motion with contact to lead to rest"
            expected += f"; in this one {first}"
            fix += "; or `hybrid run` from a start that is apart"
        raise SceneError([Complaint(f"lines.{name}.contact", given, expected, fix)])


def _refuse_within_others(
    system: NetworkModel, lines: Sequence[JoinedLine], state: NetworkState, moves: bool, where: str
) -> None:
    """The same of lines that touch each other."""
    energy, shared = energy_between(system, lines, system.body_numbers(0.0), state)
    if energy == 0.0 or (moves and math.isfinite(energy)):
        return
    given = f"and {where}, {pair_text(shared, system)}"
    expected = "a start in which lines are apart"
    if where == WITHOUT_CONTACT:
        expected = "first shapes in which lines are apart, for a damped motion with contact to lead to rest"
    fix = "lines.NAME.initial: {points: [...]} of a line that passes beside the other, or points farther apart"
    raise SceneError([Complaint("contact", given, expected, fix)])


def begin_where_near(run: RunOfLines) -> None:
    """Contact is computed from now on of lines that are near themselves in the state from which a run begins."""
    step = run.resolution.one.step
    for line, state in zip(run.lines, run.state.lines, strict=True):
        line.nears_itself = line.is_near_itself(run.t, state, step)
    begin_contact(run)


def begin_contact(run: RunOfLines) -> None:
    """Contact is computed from now on of lines that have come near themselves; those within themselves go on without.

    Nothing moves; energy that contact has at once is booked as that of a change of zones.
    """
    near = [line for line in run.lines if line.nears_itself]
    run.came_near_itself |= bool(near)
    if not run.lets_touch:
        for line in near:
            line.watch_itself_no_more(run.solver)
        return
    begun = []
    for line in near:
        x, line.nears_itself = run.solver.lines[line.number], False
        model = run.model.models[line.number]
        energy = contact_of(model).energy_of(x.line, x.ends, run.state.lines[line.number])
        watch = line.envelope.itself
        if math.isfinite(energy):
            begun.append(line.number)
            watch.begins(run.t, model, line.events.event)
            continue
        watch.waits()
        if run.steps:  # what is so at the start is told with the equilibrium
            line.meets_itself(run.t, run.last_step)
    if begun:
        let_touch(run, begun)
        _go_on(run, begun, "where contact of the line with itself begins")


def end_contact(run: RunOfLines, numbers: Sequence[int]) -> None:
    """Contact is computed no longer of lines of these numbers, until they come near themselves again."""
    let_touch(run, numbers, touch=False)
    _go_on(run, numbers, "where contact of the line with itself ends")


def begin_between(run: RunOfLines) -> bool:
    """Contact is computed from now on of lines that have come near each other; whether any begins."""
    pairs = lines_near(run)
    if not pairs:  # they are let pass
        tell_passages(run)
        run.watch_lines()
        return False
    now = run.model.touching.pairs if run.model.touching is not None else []
    _change_pairs(run, {*now, *pairs}, "where contact of lines with each other begins")
    return True


def _change_pairs(run: RunOfLines, pairs: Iterable[tuple[int, int]], after: str) -> None:
    """These lines, two each, touch each other from now on, and no others."""
    numbers = set(run.model.touching.lines) if run.model.touching is not None else set()
    touch_each_other(run, pairs)
    numbers |= set(run.model.touching.lines) if run.model.touching is not None else set()
    _go_on(run, sorted(numbers), after)


def _go_on(run: RunOfLines, numbers: Sequence[int], after: str) -> None:
    """Another solver, for lines of these numbers that touch themselves, or each other, now, or no longer.

    The energy of contact that comes or goes so is booked.
    """
    if run.zones is not None:
        run.zones.go_on()
        return
    before = [float(run.solver.work[k].report[SELF_CONTACT_ENERGY]) for k in numbers]
    renew_solver(run, after)
    for k, energy in zip(numbers, before, strict=True):
        run.lines[k].books.work[0, ZONES] += float(run.solver.work[k].report[SELF_CONTACT_ENERGY]) - energy


def gives_up_contact(run: RunOfLines, dt: float) -> bool:
    """No step of dt (s) leads on: as `gives_up_contact`, of all lines that touch themselves."""
    numbers = []
    for line in run.lines:
        contact = line.contact
        if contact is None or not (contact.touches and line.model.line.bits & MAY_TOUCH):
            continue
        s, other, text = given_up(contact, line.model, dt)
        line.events.event(run.t, s, other, GIVEN_UP, text)
        line.envelope.itself.waits()
        numbers.append(line.number)
    if numbers:
        end_contact(run, numbers)
    return _gives_up_pairs(run, dt) or bool(numbers)


def _gives_up_pairs(run: RunOfLines, dt: float) -> bool:
    """The same of lines that touch each other because they have come near: those that touch now are let pass."""
    touches = touching_now(run)
    if not touches:
        return False
    run.gather_events()
    run.note(GIVEN_UP, given_up_text(run, dt))
    assert run.model.touching is not None
    alone = {a for a, b in touches if a == b}
    pairs = run.model.touching.pairs
    passing = {x for x in pairs if x in touches or alone & set(x)}
    run.let_pass |= passing
    _change_pairs(run, [x for x in pairs if x not in passing], "where contact of lines with each other ends")
    return True


def let_touch(run: RunOfLines, numbers: Iterable[int], touch: bool = True) -> None:
    """Give a run models of lines that touch themselves, or no longer; its solver has still to follow."""
    frictions = {k: run.lines[k].scene.contact.friction for k in numbers}
    change_lines(run, {k: partial(touching, friction=x) if touch else touching_no_more for k, x in frictions.items()})


def renew_solver(run: RunOfLines, after: str) -> None:
    """Another solver in mid-motion, for lines that have changed; after: what, for the text of a failure."""
    run.gather_events()  # in the order in which they happen
    bodies, work = run.solver.bodies.copy(), run.solver.body_work.copy()
    run.make_solver()
    run.solver.bodies[:], run.solver.body_work[:] = bodies, work
    run.renew_other()
    evaluate_forces(run, after)


def go_on_as_attached(run: RunOfLines, after: str) -> None:
    """Go on with the same solver and states in mid-motion, for lines that have changed; after: as of `renew_solver`."""
    run.gather_events()
    turns = run.loop.turns
    evaluate_forces(run, after)
    run.solver.take_turns(turns)
    run.loop.stand_after_change()


def evaluate_forces(run: RunOfLines, after: str) -> None:
    """The forces of the state of now; after: as of `renew_solver`.  LineFailed: there are none."""
    for line, model in zip(run.lines, run.model.models, strict=True):
        model.ends.at(run.t)
        model.sea.at(run.t)
        line.books.velocity[:] = model.ends.velocity  # a try has moved them on
    run.model.load_bodies(run.t, run.solver.bodies, run.loaded)
    taken = run.solver.forces_in_motion(run.state, run.t)
    if taken.outcome != Outcome.OK:
        raise LineFailed(taken.line, taken.outcome, run.t, None, after)


def tell_meetings(run: RunOfLines) -> None:
    """An event for every two lines that have met, when they do first."""
    told = run.met
    shared: SharedContact | None = run.solver.shared
    for a, b, t, s, other in sorted(shared.met() if shared is not None else (), key=lambda x: x[2]):
        if (a, b) in told:
            continue
        told.add((a, b))
        text = meeting_text(run.model.names[a], run.model.names[b], s, other)
        run.recorder.event(t, 0.0, 0.0, "lines touch", text)


def _side_by_side(run: RunOfLines, joined: NDArray[np.int64], a: int, b: int, s: float, other: float) -> bool:
    """Whether two lines that met at s and other (m) of them lay along each other all the way from a common joint.

    They did where both places are as far from it along the lines, and one of the lines is straight up to there.
    """
    width = max(float(diameters(run.model.models[k]).max()) for k in (a, b))
    for m, k in ((m, k) for m in (0, -1) for k in (0, -1) if joined[a, m] == joined[b, k]):
        ways, bows = [], []
        for line, at, tip in ((a, s, m), (b, other, k)):
            nodes, r = run.model.models[line].line.s, run.state.lines[line].r
            place = [np.interp(at, nodes, r[:, j]) for j in range(3)]
            ways.append(abs(at - float(nodes[tip])))
            bows.append(ways[-1] - float(np.linalg.norm(place - r[tip])))
        if abs(ways[0] - ways[1]) < ALONG * width and min(bows) < width:
            return True
    return False


def tell_passages(run: RunOfLines) -> None:
    """An event for every two lines that have met without contact, when they do first.

    Of lines that lie along each other from what both are joined to there is nothing to tell, as at the start.
    """
    if (watch := run.watch) is None:
        return
    for a, b, t, s, other in sorted(watch.met(), key=lambda x: x[2]):
        if (a, b) in run.passed:
            continue
        run.passed.add((a, b))
        if _side_by_side(run, watch.joined, a, b, s, other):
            continue
        one, two = run.model.names[a], run.model.names[b]
        text = (
            f"lines {one} and {two} pass through each other: no contact between them is computed, and at s = {s:.4g} m "
            f"of {one} and s = {other:.4g} m of {two} their centrelines are nearer than the mean of their diameters; "
            f"contact: {{between: [[{one}, {two}]]}} keeps them apart"
        )
        run.recorder.event(t, 0.0, 0.0, PASSED, text)
