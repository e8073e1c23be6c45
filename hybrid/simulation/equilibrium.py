"""Equilibria of networks are sought of joined lines together, and of each other line by itself.

One search for either (solve.lines_at_rest): on the side of obstacles where lines begin, with the turns of their ends,
on fewer cells first, with contact where that keeps them apart, then with friction that has settled as the scene says.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from hybrid.errors import Complaint, Outcome, SceneError
from hybrid.kernels.junctions.bodies import FRAME, NUMBERS, PLACE
from hybrid.kernels.junctions.joined_lines import TURNS
from hybrid.kernels.laws.water import PIECE, PUSH, WATER, WET
from hybrid.kernels.march.link import LINK, holds_twist, link_of
from hybrid.kernels.mesh.zone_criteria import twist_of_rods
from hybrid.kernels.state.report import FRICTION, OBSTACLES, SELF_CONTACT, WAVES
from hybrid.kernels.state.state import Floats, State
from hybrid.model.build import Model, as_kept, leaves_plane, planar
from hybrid.model.initial_shape import GIVEN, HUNG, reasons_against
from hybrid.model.nearby import MANY, carry_directors, coarser, refined
from hybrid.model.network import NetworkModel, balanced_places, starts_between
from hybrid.scene.analysis import Equilibrium as StaticStart
from hybrid.scene.base import dotted
from hybrid.scene.ends import Fairlead
from hybrid.scene.network import Network
from hybrid.scene.network_checks import floating_groups
from hybrid.scene.schema import LineScene
from hybrid.simulation.events import borne_strain
from hybrid.simulation.run_start import at_rest_with_contact, letting_touch, named, with_contact
from hybrid.solve.lines_at_rest import Group, LinesAtRest, lines_at_rest, settled_with_friction
from hybrid.solve.network_solver import NetworkSolver
from hybrid.solve.search import PUSHED, Start
from hybrid.solve.stability import ON_BED, behind_obstacles, passed_obstacles, rubs_on
from hybrid.solve.stepper import JoinedLine, LineFailed, NetworkState, joined_ends

# Turns that close the frames of the initial shape, at most, and round-off; the twist of a cell, rad, that is resolved.
CLOSING, MOST_TWIST = 0.5 + 1e-6, 1.0
# Equilibria until the water around members is that of the place found, and what of the largest wetted part, velocity
# and acceleration there counts as the same.
MOST_ROUNDS, SAME_WATER = 40, 1e-8
# Other places of what is free from which an equilibrium is sought where all else has failed: how many, and how far
# from the first ones, as a part of the shortest line (bench/test_bench_network_statics.py).
OTHER_PLACES = 10
ELSEWHERE = 1.0
# Lengths of its line from a held point to the first place of another, beyond which that is named where no equilibrium
# is found; nearer ones are found.
FAR = 3.0


class _Asked(NamedTuple):
    """What an equilibrium is sought of, with the loads of t (s); rubs: whether friction acts; begin: as of `starts`."""

    network: Network
    model: NetworkModel
    t: float
    bodies: Floats
    rubs: bool
    begin: Start | None = None

    @property
    def ways(self) -> dict[int, str]:
        """How friction settles, by number of the lines of which it does."""
        return ways_to_settle(self.model) if self.rubs else {}

    def starts(self) -> Iterator[Start]:
        """Shapes from which the equilibrium is looked for: `begin` alone, where that is given."""
        model, network = self.model, self.network
        if self.begin is not None:
            yield self.begin
            return
        yield _first_shapes(model)
        if len(model.places) + len(model.body_places):
            network = network.searched()
            places = balanced_places(network, model)
            if places is not None:
                yield "lines hung between places that balance", NetworkState(*starts_between(network, *places, model))

    def elsewhere(self) -> Iterator[Start]:
        """Shapes between other places, the same at every call, then the equilibrium of lines that may be slack.

        None where nothing is free.
        """
        model, network = self.model, self.network.searched()
        if not len(model.places) + len(model.body_places):
            return
        chance, reach = np.random.default_rng(0), ELSEWHERE * min(x.length for x in model.models)
        for _ in range(OTHER_PLACES):
            places, bodies = model.places.copy(), model.body_places.copy()
            for row in (*places, *bodies[:, PLACE:FRAME]):
                row += reach * chance.uniform(-1.0, 1.0, 3)
            yield "lines hung between other places", NetworkState(*starts_between(network, places, bodies, model))
        with suppress(LineFailed):
            group = group_of(model, self.t, self.bodies)
            group = group._replace(lines=[_without_bending(x) for x in group.lines])
            found = lines_at_rest(group, self.starts(), _other_shapes(model)).state
            for x, state in zip(model.models, found.lines, strict=True):
                carry_directors(x.line, x.start.e, x.start.a1, state)
            yield "the equilibrium without bending, slack or not", found


def equilibrium_of(network: Network, model: NetworkModel, t: float, friction: bool = True) -> LinesAtRest:
    """Equilibrium with the loads of time t (s; infinity: of full size).  ComputationError: none is found.

    friction: whether it settles on the bed, of lines that ask for that.
    """
    if floating := [Complaint(dotted(x.at), str(x.given), x.expected, x.fix) for x in floating_groups(network)]:
        raise SceneError(floating)

    def search(_: Sequence[int], own: NetworkModel) -> LinesAtRest:
        asked = _Asked(_network_of(network, own.names), own, t, own.body_numbers(t), friction)
        try:
            return _in_its_water(asked)
        except LineFailed as failed:
            if failed.outcome == Outcome.TURNS_LOST:  # another place may have others, which nobody asks for
                raise
            for begin in asked.elsewhere():
                with suppress(LineFailed):
                    return _in_its_water(asked._replace(begin=begin))
            raise

    try:
        return _by_parts(model, t, _parts_of(model), search)
    except LineFailed as failed:
        raise named(_with_reasons(failed, model), model, _nearer(network)) from None


def solve_from(
    found: LinesAtRest, model: NetworkModel, t: float, bodies: Floats, start: NetworkState, name: str
) -> LinesAtRest:
    """Find the equilibrium with the loads of time t (s) from a start next to another one.

    It is found as that was: with contact, or with friction that has settled likewise.
    """
    if found.parts:

        def again_of(part: tuple[int, ...], own: NetworkModel) -> LinesAtRest:
            states = NetworkState([start.lines[k] for k in part], start.bodies[: len(own.body_places)])
            return solve_from(found.parts[part], own, t, bodies[: len(own.body_places)], states, name)

        return _by_parts(model, t, [*found.parts], again_of)
    group = group_of(model, t, bodies)
    if found.settled:
        model, group = letting_touch(model, group)
        return _keep_turns(model, t, at_rest_with_contact(model, group, start, near=True))
    if found.with_friction and not found.pulled:  # where the lines were laid, which nothing else leads to
        ways = dict.fromkeys(found.with_friction, "start")
        return _keep_turns(model, t, settled_with_friction(group, ways, (name, start)))
    again = lines_at_rest(group, [(name, start)], rubs=bool(found.with_friction))
    again = _keep_turns(model, t, replace(again, not_settled=found.not_settled))
    ways = {k: way for k, way in ways_to_settle(model).items() if k in found.with_friction}
    return _with_friction(model, t, group, again, ways, (name, start))


# --- which lines, and one by one ------------------------------------------------------------------------


def joined_lines(model: NetworkModel, t: float) -> list[JoinedLine]:
    """The lines with their ends and their sea at t (s), whose arrays `ends.at` and `sea.at` overwrite."""
    lines = []
    for x, joints, fairleads, seats in zip(model.models, model.joints, model.fairleads, model.seats, strict=True):
        ends, floor, slackens = joined_ends(x.ends.at_time(t), joints), x.slack_floor, x.slack == "warn"
        borne = borne_strain(x) if x.line.bits & OBSTACLES else np.zeros(0)
        keeps_pace = x.payout is not None or x.layout is not None
        winds = x.payout is not None and x.payout.holds_tension
        given = ends, x.length, x.tension_scale, floor, joints, fairleads, seats, slackens, model.rides
        lines.append(JoinedLine(x.line, x.sea.at_time(t), *given, borne, keeps_pace, winds, x.most_cells))
    return lines


def group_of(model: NetworkModel, t: float, bodies: Floats) -> Group:
    """The lines of a model at t (s), as their search takes them."""
    first = model.models[0]
    return Group(joined_lines(model, t), len(model.free), bodies, first.plane, first.cable.held_tangent)


def _is_alone(model: NetworkModel, number: int) -> bool:
    """Whether a line is joined to nothing that moves and asks for no contact: what it finds, no other line knows."""
    return not model.asks_contact and max(model.joints[number]) < 0


def _parts_of(model: NetworkModel) -> list[tuple[int, ...]]:
    """Numbers of the lines that are sought together: each that is alone, and all others."""
    lines = tuple(range(len(model.models)))
    others = tuple(k for k in lines if not _is_alone(model, k))
    if not others and (model.free or len(model.body_places)):  # which no line holds
        return [lines]
    return [*((k,) for k in lines if k not in others), *([others] if others else [])]


def _network_of(network: Network, names: Sequence[str]) -> Network:
    """A network of some of the lines of another, with their points."""
    if len(names) == len(network.lines):
        return network
    lines = {name: network.lines[name] for name in names}
    at = {point for line in lines.values() for point in (line.start, line.end)}
    points = {name: x for name, x in network.points.items() if name in at}
    return network.model_copy(update={"lines": lines, "points": points})


def _model_of(model: NetworkModel, part: Sequence[int]) -> NetworkModel:
    """The model of some of its lines: of one that is alone, without what is free, and in its plane."""
    of = [*part]
    some: dict[str, Any] = {x: tuple(getattr(model, x)[k] for k in of) for x in ("names", "models", "joints", "turns")}
    own = replace(model, fairleads=model.fairleads[of], seats=model.seats[of], **some)
    if not _is_alone(model, part[0]):
        return own
    (x,) = own.models
    none: dict[str, Any] = dict.fromkeys(("free", "rigid", "moments", "bodies"), ())
    none |= {"places": model.places[:0], "body_places": model.body_places[:0]}
    return replace(own, models=(replace(x, line=as_kept(x.line, x.plane, x.kept_in)),), **none)


def _by_parts(
    model: NetworkModel,
    t: float,
    parts: Sequence[tuple[int, ...]],
    search: Callable[[tuple[int, ...], NetworkModel], LinesAtRest],
) -> LinesAtRest:
    """Return the equilibria that a search finds of each part, by numbers of its lines, as one."""
    if len(parts) == 1 and (len(parts[0]) > 1 or not _is_alone(model, 0)):
        return search(parts[0], model)
    found = dict[tuple[int, ...], LinesAtRest]()
    for part in parts:
        try:
            found[part] = search(part, _model_of(model, part))
        except LineFailed as failed:
            number = part[failed.line] if failed.line >= 0 else -1
            raise LineFailed(number, failed.outcome, None, failed.s, failed.detail, first=failed.first) from None
    return _together(model, t, found)


def _together(model: NetworkModel, t: float, found: Mapping[tuple[int, ...], LinesAtRest]) -> LinesAtRest:
    """Equilibria of the parts of a network as one."""
    of_line = {k: (x, j) for part, x in found.items() for j, k in enumerate(part)}
    each = [of_line[k] for k in range(len(model.models))]
    rubs = frozenset(k for k, (x, j) in enumerate(each) if j in x.with_friction)
    joined = next((x for part, x in found.items() if not _is_alone(model, part[0])), None)
    bodies = model.body_places if joined is None else joined.state.bodies
    states = NetworkState([x.state.lines[j] for x, j in each], bodies)

    def solver() -> NetworkSolver:
        lines = []
        for k, (x, own, one) in enumerate(zip(joined_lines(model, t), model.models, states.lines, strict=True)):
            line = x.line._replace(bits=x.line.bits & ~WAVES & ~(0 if k in rubs else FRICTION))
            if own.plane is not None and not leaves_plane(own.plane, one, own.length):
                line = planar(line, own.plane)  # in which it was found, so that nothing is compiled for space
            lines.append(x._replace(line=line))
        made = NetworkSolver(lines, len(model.free), model.body_numbers(t) if joined is None else joined.bodies)
        made.evaluate_forces(states, made.anchor)
        return made

    path = max(found.values(), key=lambda x: len(x.path)).path  # of the part that took most ways
    return LinesAtRest(
        states,
        path,
        sum(x.iterations for x in found.values()),
        max(x.residual for x in found.values()),
        solver,
        any(x.settled for x in found.values()),
        next((x.unjudged for x in found.values() if x.unjudged), ""),
        rubs,
        frozenset(k for k, (x, j) in enumerate(each) if j in x.blurred),
        found,
        {k: x.not_settled.get(j, "") for k, (x, j) in enumerate(each)},
    )


# --- one search -----------------------------------------------------------------------------------------


def _in_its_water(asked: _Asked) -> LinesAtRest:
    """Find the equilibrium of lines with bodies, whose members feel the water where they rest."""
    model, t, numbers = asked.model, asked.t, asked.bodies
    found = _at_rest(asked)
    if not any(body.members for body in model.bodies):
        return found
    part, before = 1.0, None
    for _ in range(MOST_ROUNDS):
        there = numbers.copy()
        model.update_water(t, found.state.bodies, 0.0, there)
        if _same_water(there, numbers):
            return found
        change = there - numbers
        if before is not None:  # Aitken's factor, for members that the water lifts out of it or pulls under
            more = change - before
            part = float(np.clip(-part * (before * more).sum() / max((more * more).sum(), 1e-300), 0.05, 1.0))
        numbers += part * change
        before = change
        found = solve_from(found, model, t, numbers, found.state, "members where they came to rest")
    told = f"the place of a body and the water around its members do not agree after {MOST_ROUNDS} equilibria; "
    raise LineFailed(-1, Outcome.NOT_CONVERGED, None, None, told + "take a nearer initial_guess, or more pieces")


def _same_water(there: Floats, taken: Floats) -> bool:
    """Whether wetted parts, velocity and acceleration of the water in numbers of bodies are the same."""
    now, then = (x[:, NUMBERS:].reshape(-1, PIECE) for x in (there, taken))
    return all(
        np.abs(now[:, a:b] - then[:, a:b]).max() <= SAME_WATER * np.abs(now[:, a:b]).max()
        for a, b in ((WET, WATER), (WATER, PUSH), (PUSH, PIECE))
    )


def _at_rest(asked: _Asked) -> LinesAtRest:
    """The equilibrium with contact, and with friction that has settled."""
    model, t, group = asked.model, asked.t, group_of(asked.model, asked.t, asked.bodies)
    model, found = with_contact(model, group, partial(_without_contact, asked, group), asked.starts)
    found = _keep_turns(model, t, found)
    if found.settled or found.with_friction:
        return found
    return _with_friction(model, t, group, found, asked.ways, _first_shapes(model))


def _without_contact(asked: _Asked, group: Group) -> LinesAtRest:
    """Find the equilibrium of lines that nothing keeps from passing through each other.

    Friction has not settled yet, but where it holds lines from the start.
    """
    model, ways = asked.model, asked.ways
    touch = any(x.line.bits & SELF_CONTACT for x in group.lines)
    if not touch and ways and {*ways.values()} == {"start"}:
        found = settled_with_friction(group, ways, _first_shapes(model))
    else:
        found = _on_many_cells(asked, group, touch or "start" in ways.values())
    return found if touch else _keep_turns(model, asked.t, found)


def _on_many_cells(asked: _Asked, group: Group, held: bool) -> LinesAtRest:
    """Find the equilibrium on fewer cells where that helps; not of lines that contact or friction hold from the start.

    Of several lines only where no other way leads to one: they have more equilibria, and that beside the first places
    is meant.
    """
    if held or asked.begin is not None:  # which is a shape of these cells
        return _on_its_side(asked, group)
    if len(group.lines) == 1:
        return _by_coarser(asked, group) or _on_its_side(asked, group)
    try:
        return _on_its_side(asked, group)
    except LineFailed:
        if (found := _by_coarser(asked, group)) is None:
            raise
        return found


def _first_shapes(model: NetworkModel) -> Start:
    shape = "lines hung between the first places" if len(model.models) > 1 else model.models[0].start_shape
    return shape, NetworkState([x.start for x in model.models], model.body_places)


def _other_shapes(model: NetworkModel) -> list[Start]:
    """The first shapes with arcs, then with straight spans."""
    lines = " of lines" if len(model.models) > 1 else ""
    return [
        (name + lines, NetworkState([dict(x.other_starts).get(name, x.start) for x in model.models], model.body_places))
        for name in dict.fromkeys(name for x in model.models for name, _ in x.other_starts)
    ]


def _on_its_side(asked: _Asked, group: Group, start: Start | None = None, quick: bool = False) -> LinesAtRest:
    """Find the equilibrium with the turns of ends, on the side of obstacles where lines begin.

    Where no way leads to that side, the other one may be meant.  start: from which alone an equilibrium is sought, on
    any side; quick: as of `lines_at_rest`.
    """
    model, t = asked.model, asked.t
    first = _first_shapes(model) if start is None else start
    turned = [k for k, x in enumerate(group.lines) if any(model.turns[k]) and not x.line.bits & SELF_CONTACT]
    # of lines with too few cells no way keeps turns
    turned = [k for k in turned if not lost_turns(model, t, k, first[1].lines[k])[0]]

    def lost(states: NetworkState) -> tuple[Outcome, int, int]:
        k = next((k for k in turned if lost_turns(model, t, k, states.lines[k])[0]), -1)
        return (Outcome.OK if k < 0 else Outcome.TURNS_LOST), k, -1

    def elsewhere(states: NetworkState) -> tuple[Outcome, int, int]:
        why = lost(states)
        if why[0] != Outcome.OK:
            return why
        for k, x in enumerate(model.models):
            node = next((node for _, node in _crossed_obstacles(x, states.lines[k])), -1)
            if node >= 0:
                return Outcome.BURIED, k, node
        return Outcome.OK, -1, -1

    others = _other_shapes(model) if start is None else []
    rubs = asked.rubs and not any(x.line.bits & SELF_CONTACT for x in group.lines)
    search = partial(lines_at_rest, group, others=others, quick=quick, rubs=rubs)
    if start is None and any(_has_side(x) for x in model.models):
        try:
            return search(asked.starts(), refused=elsewhere)
        except LineFailed:
            if quick:
                raise
    return search(asked.starts() if start is None else [start], refused=lost if turned else None)


def _without_bending(x: JoinedLine) -> JoinedLine:
    """The line as a catenary, of which a slack equilibrium will do."""
    line = x.line._replace(element=np.zeros_like(x.line.element), spin=np.zeros_like(x.line.spin))
    return x._replace(line=line, slackens=True)


def _has_side(model: Model) -> bool:
    """Whether the first shape of a line says on which side of obstacles it lies."""
    there = model.line.bits & OBSTACLES and len(model.sea.values.obstacles)
    return bool(there) and model.start_shape in (HUNG, GIVEN)


def _crossed_obstacles(model: Model, state: State) -> Iterable[tuple[int, int]]:
    """Obstacles on whose other side a line has come to lie, and a node there."""
    if not _has_side(model):
        return ()
    if model.start_shape == HUNG:
        return behind_obstacles(model.line, model.sea.values, state)
    return passed_obstacles(model.sea.values, model.start.r, state.r)


def _by_coarser(asked: _Asked, group: Group) -> LinesAtRest | None:
    """The equilibrium of lines of many cells: by Newton at once, or from that of a coarser mesh, easier to find.

    Of very many the coarser one comes first: where Newton fails at once, that costs more than all the rest.
    None: neither is, or there are few cells.
    """
    model = asked.model
    fewer = [coarser(x) for x in model.models]
    if not any(fewer):
        return None
    coarse = replace(model, models=tuple(x or y for x, y in zip(fewer, model.models, strict=True)))
    ways = [partial(_on_its_side, asked, group, quick=True), partial(_from_coarser, asked, group, coarse)]
    for way in ways if max(x.cells for x in model.models) <= MANY else ways[::-1]:
        try:
            return way()
        except LineFailed:
            pass
    return None


def _from_coarser(asked: _Asked, group: Group, coarse: NetworkModel) -> LinesAtRest:
    """From the equilibrium of lines with fewer cells; LineFailed: there is none, or it leads to none."""
    easier = asked._replace(model=coarse)
    few = group_of(coarse, asked.t, asked.bodies)
    found = _by_coarser(easier, few) or _on_its_side(easier, few)
    each = zip(found.state.lines, coarse.models, asked.model.models, strict=True)
    states = [state if x is full else refined(state, x.line, full.line) for state, x, full in each]
    shape = f"the equilibrium with {coarse.cells} cells{f', {PUSHED}' if found.pushed else ''}"
    return _on_its_side(asked, group, (shape, NetworkState(states, found.state.bodies)), quick=True)


# --- friction -------------------------------------------------------------------------------------------


def ways_to_settle(model: NetworkModel) -> dict[int, str]:
    """How friction settles (`settling`), by number of the lines of which it does.

    A line that nothing else holds is held where it starts, so that no other start will do.
    """
    touching = set(model.touching.lines) if model.touching is not None else set()
    found = dict[int, str]()
    for k, (name, x) in enumerate(zip(model.names, model.models, strict=True)):
        found[k] = settling(model.scenes[name], x, k in touching or model.rides.size > 0)
        if x.line.bits & FRICTION and max(model.joints[k]) < 0 and not x.ends.values.held.any():
            found[k] = "start"
    return {k: way for k, way in found.items() if way}


def settling(scene: LineScene, model: Model, touches: bool = False) -> str:
    """How friction is to settle, as of `settled_with_friction`.

    A shape that the scene gives is where the line was laid.  "usual": as "pull" on a bed alone, where that leads
    anywhere, else not, which a scene has that says nothing of it.  What is paid out was laid under tension; and
    friction of what moves or touches other lines (touches) is not known in equilibria.
    """
    asked, line = scene.initial, model.line
    if not line.bits & FRICTION or not isinstance(asked, StaticStart) or asked.friction == "neglected":
        return ""
    hangs = asked.points is None and asked.guess in ("auto", "catenary")
    if asked.friction == "settled":
        return "pull" if hangs else "start"
    meets = touches or line.moved.size or line.bits & SELF_CONTACT
    return "usual" if hangs and not meets and model.payout is None else ""


def _with_friction(
    model: NetworkModel, t: float, group: Group, found: LinesAtRest, ways: Mapping[int, str], first: Start
) -> LinesAtRest:
    """The equilibrium in which friction has settled from one without it, in these ways (`settling`) of lines.

    first: from where lines come to rest where a scene asks for that.  LineFailed: none is found where one is asked for.
    """
    asked = {k: way for k, way in ways.items() if way != "usual"}
    here = [(x.line, x.sea, x.ends.held, state) for x, state in zip(group.lines, found.state.lines, strict=True)]
    ways = {k: way for k, way in ways.items() if k in asked or rubs_on(*here[k]) == [ON_BED]}
    if not ways:
        return found
    try:
        laid = settled_with_friction(group, ways, first, found)
        return _keep_turns(model, t, replace(laid, not_settled=found.not_settled))
    except LineFailed as failed:
        if len(asked) == len(ways):
            raise
        why = {**found.not_settled, **dict.fromkeys(ways.keys() - asked.keys(), failed.outcome.cause)}
    if asked:
        found = _keep_turns(model, t, settled_with_friction(group, asked, first, found))
    return replace(found, not_settled=why)


# --- turns ----------------------------------------------------------------------------------------------


def _keep_turns(model: NetworkModel, t: float, found: LinesAtRest) -> LinesAtRest:
    """The same equilibrium; LineFailed where a line has lost turns by which its ends, which hold it, twist it.

    A motion with contact keeps them by itself, in the writhe of loops as well (solve.lines_at_rest).
    """
    for k, (x, state) in enumerate(zip(model.models, found.state.lines, strict=True)):
        turns = bool(model.seats[k, :, TURNS].any())
        keeps_link = found.settled and bool(x.line.bits & SELF_CONTACT) and not turns
        lost, s = lost_turns(model, t, k, state, keeps_link)
        if lost and turns:
            lost += "; what it is clamped to may turn by less than half a turn until then (initial_rotation)"
        if lost:
            raise LineFailed(k, Outcome.TURNS_LOST, None, s, lost)
    return found


def lost_turns(network: NetworkModel, t: float, k: int, state: State, keeps_link: bool = False) -> tuple[str, float]:
    """Tell how a line is not twisted by the turns that its ends have, and where (m); "": it is.

    What its ends are clamped to may have turned by less than half a turn.  keeps_link: whether a damped motion with
    contact has kept the link of the start, of which a loop has a part.

    What closes the frames of the initial shape comes to at most half a turn, and the shape itself takes the writhe of
    the equilibrium, less than half a turn unless the cable forms a loop.
    """
    model, by_end = network.models[k], network.turns[k]
    asked, last = by_end[1] - by_end[0], bool(by_end[1])
    if not asked or model.cable.swivels.size:  # which lets it turn back
        return "", 0.0
    where = f"lines.{network.names[k]}.connections.{'end' if last else 'start'}.turns: {by_end[last]:g}"
    s = model.length if last else 0.0
    if not model.line.element[1:-1].all():  # zones: whether it has passed through itself, or around a clamp
        if keeps_link or not holds_twist(model.line):
            return "", s
        ends = model.ends.at_time(t)
        wound, has = (link_of(model.line, ends, x.r, x.e, x.a1, x.turn)[LINK] for x in (model.start, state))
        text = f"{where}; the line starts with a link of {wound:.4g} turns, that of the equilibrium is {has:.4g}"
        return (text if abs(has - wound) > 0.5 else ""), s
    frames = model.ends.at_time(t).frame
    wound, has = (twist_of_rods(model.line, frames, x.e, x.a1) / (2.0 * np.pi) for x in (model.start, state))
    if abs(wound - asked) > CLOSING:
        least = int(np.ceil(2.0 * np.pi * abs(asked) / MOST_TWIST))
        return f"{where}; {model.cells} cells cannot hold {asked:g} turns, which take at least {least} equal ones", s
    text = f"{where}; the rods start with {wound:.4g} turns, those of the equilibrium have {has:.4g}"
    return (text if abs(has - wound) > 0.5 and not keeps_link else ""), s


# --- what is said where none is found -------------------------------------------------------------------


def _nearer(network: Network) -> str:
    """What to try first where a point is looked for farther away than a line to a held point reaches; else empty."""
    worst, text = FAR, ""
    for name, place in network.guesses.items():
        for line, end in network.lines_at(name):
            other = network.lines[line].end if end == "start" else network.lines[line].start
            if not network.is_held(other):
                continue
            length = sum(section.length for section in network.lines[line].sections)
            away = math.dist(place, network.first_place(other))
            if away > worst * length:
                point, worst = network.points[name], away / length
                key = f"bodies.{point.body}" if isinstance(point, Fairlead) else f"points.{name}"
                text = (
                    f"{key}.initial_guess nearer: {away:.6g} m from points.{other}, line {line} is {length:.6g} m long"
                )
    return text


def _with_reasons(failed: LineFailed, model: NetworkModel) -> LineFailed:
    """Add the reasons against an equilibrium of a line that is joined to nothing that moves."""
    k = failed.line
    if k < 0 or max(model.joints[k]) >= 0:
        return failed
    x, name = model.models[k], model.names[k]
    flexible = float(x.line.h[x.line.spin == 0].max(initial=0.0))
    reasons = reasons_against(model.scenes[name], (bool(x.line.spin[0]), bool(x.line.spin[-1])), flexible)
    roads = [line for line in failed.detail.splitlines() if line.endswith(" in all)")]
    if not reasons or not roads:
        return failed
    ways = f"{len(roads)} ways to an equilibrium were" if len(roads) > 1 else "1 way to an equilibrium was"
    tried = f"{ways} tried, the last: {roads[-1].strip()}"
    detail = "\n              ".join([*reasons, tried]).replace("ends.", f"lines.{name}.connections.")
    return LineFailed(k, failed.outcome, None, failed.s, detail, first=failed.first)
