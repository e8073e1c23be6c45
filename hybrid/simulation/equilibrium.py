"""Equilibria of a scene: found at once, or from a coarser mesh."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np

from hybrid.errors import ComputationError, Outcome
from hybrid.kernels.march.link import LINK, holds_twist, link_of
from hybrid.kernels.mesh.zone_criteria import twist_of_rods
from hybrid.kernels.state.report import FRICTION, MAY_TOUCH, OBSTACLES, PLANAR, SELF_CONTACT
from hybrid.kernels.state.state import Line, State
from hybrid.model.build import Model
from hybrid.model.coarsen import coarser, refined
from hybrid.model.initial_shape import GIVEN, HUNG, reasons_against
from hybrid.model.plane import leaves_plane, planar, untwist
from hybrid.scene.analysis import Equilibrium as StaticStart
from hybrid.scene.schema import LineScene
from hybrid.simulation.contact_equilibrium import is_apart, settled_from
from hybrid.simulation.diagnostics import borne_strain
from hybrid.simulation.slack_bends import slack_remedy
from hybrid.solve.flaws import ON_BED, behind_obstacles, passed_obstacles, rubs_on
from hybrid.solve.search import PUSHED
from hybrid.solve.stability import is_stable
from hybrid.solve.statics import Equilibrium, Search, solve_statics

# Turns that close the frames of the initial shape, at most, and round-off; the twist of a cell, rad, that is resolved.
CLOSING, MOST_TWIST = 0.5 + 1e-6, 1.0
# Cells from which on the equilibrium of a coarser mesh is sought first.
MANY = 1000


def equilibrium_of(scene: LineScene, model: Model, t: float) -> Equilibrium:
    """Equilibrium with the loads of time t; infinity stands for loads that have grown to their full size.

    Of a line that may touch itself and has lost turns of its ends on all ways, on which it passed through itself, that
    to which a damped motion with contact leads.
    """
    try:
        return _without_contact(scene, model, t)
    except ComputationError as failed:
        may_touch = failed.outcome == Outcome.TURNS_LOST and model.line.bits & MAY_TOUCH
        if not may_touch or not is_apart(model, t, model.start):
            raise
        try:
            return settled_from(model, t, model.start)
        except ComputationError as too:
            tried = "\n              ".join(x for x in (failed.detail, too.detail) if x)
            raise ComputationError(
                failed.outcome, None, failed.s, tried, first=slack_remedy(model, failed.outcome, failed.s)
            ) from None


def _without_contact(scene: LineScene, model: Model, t: float) -> Equilibrium:
    """Equilibrium of a line that nothing keeps from passing through itself."""
    try:
        found = _as_laid(scene, model, t)
        count_turns(scene, model, t, found.state)
        return found
    except ComputationError as failed:
        flexible = float(model.line.h[model.line.spin == 0].max(initial=0.0))
        reasons = reasons_against(scene, (bool(model.line.spin[0]), bool(model.line.spin[-1])), flexible)
        first = slack_remedy(model, failed.outcome, failed.s)
        if not reasons and not first:
            raise
        roads = [x for x in failed.detail.splitlines() if x.endswith(" in all)")]
        ways = f"{len(roads)} ways to an equilibrium were" if len(roads) > 1 else "1 way to an equilibrium was"
        tried = f"{ways} tried, the last: {roads[-1].strip()}"
        because = "\n              ".join([*reasons, tried]) if reasons else failed.detail
        raise ComputationError(failed.outcome, None, failed.s, because, first=first) from None


def count_turns(
    scene: LineScene, model: Model, t: float, state: State, given: tuple[float, float] | None = None,
    keeps_link: bool = False,
) -> None:  # fmt: skip
    """ComputationError where a rod between two ends that hold it is not twisted by the turns of the scene.

    given: those of its start and end, of a line of several; None: as of the scene.  What its ends are clamped to may
    have turned by less than half a turn.  keeps_link: whether a damped motion with contact has kept the link of the
    start, of which a loop has a part.

    What closes the frames of the initial shape comes to at most half a turn, and the shape itself takes the writhe of
    the equilibrium, less than half a turn unless the cable forms a loop.
    """
    by_end = given or (scene.ends.start.held_turns, scene.ends.end.held_turns)
    asked, name = by_end[1] - by_end[0], "end" if by_end[1] else "start"
    if not asked or model.cable.swivels.size:  # which lets it turn back
        return
    where, s = f"ends.{name}.turns: {by_end[name == 'end']:g}", model.length if name == "end" else 0.0
    if not model.line.element[1:-1].all():
        if keeps_link:
            return
        _count_link(model, t, state, where, s)
        return
    frames = model.ends.at(t).frame
    wound, found = (twist_of_rods(model.line, frames, x.e, x.a1) / (2.0 * np.pi) for x in (model.start, state))
    if abs(wound - asked) > CLOSING:
        least = int(np.ceil(2.0 * np.pi * abs(asked) / MOST_TWIST))
        detail = f"{where}; {model.cells} cells cannot hold {asked:g} turns, which take at least {least} equal ones"
        raise ComputationError(Outcome.TURNS_LOST, None, s, detail)
    if abs(found - wound) > 0.5 and not keeps_link:
        detail = f"{where}; the rods start with {wound:.4g} turns, those of the equilibrium have {found:.4g}"
        raise ComputationError(Outcome.TURNS_LOST, None, s, detail)


def _count_link(model: Model, t: float, state: State, where: str, s: float) -> None:
    """ComputationError where a line with zones has passed through itself, or around a clamp, and lost turns so."""
    if not holds_twist(model.line):
        return
    ends = model.ends.at(t)
    wound, found = (link_of(model.line, ends, x.r, x.e, x.a1, x.turn)[LINK] for x in (model.start, state))
    if abs(found - wound) > 0.5:
        detail = f"{where}; the line starts with a link of {wound:.4g} turns, that of the equilibrium is {found:.4g}"
        raise ComputationError(Outcome.TURNS_LOST, None, s, detail)


def solve_model(model: Model, t: float, start: State, search: Search) -> Equilibrium:
    """Equilibrium of a model with the loads of time t: in its plane where it holds in space too, else in space."""
    sea, ends = model.sea.at(t), model.ends.at(t)
    rest = model.length, model.tension_scale, model.slack_floor
    if model.line.bits & PLANAR:
        start = _untwisted(model, model.line, start)
        search = search._replace(others=[(x, _untwisted(model, model.line, y)) for x, y in search.others])
    elif model.plane is not None and not leaves_plane(model.plane, start, model.length):
        line = planar(model.line, model.plane)
        flat = _untwisted(model, line, start)
        try:
            at_once = search._replace(quick=True, take_slack=False, others=())
            found = solve_statics(line, sea, ends, flat, *rest, model.start_shape, at_once)
            judged = line if found.with_friction else line._replace(bits=line.bits & ~FRICTION)
            if is_stable(judged, sea, ends, found.state, model.length, model.tension_scale):
                return found
        except ComputationError:  # there are more ways in space
            pass
    return solve_statics(model.line, sea, ends, start, *rest, model.start_shape, search)


def solve_like(model: Model, t: float, start: State, like: Equilibrium) -> Equilibrium:
    """The equilibrium near a start, found as another one was: with friction on the bed, or in contact with itself."""
    if like.touches:
        return settled_from(model, t, start, near=True)
    if like.with_friction and not like.pulled:
        return solve_model(model, t, start, Search("start"))
    found = solve_model(model, t, start, Search())
    if not like.pulled:
        return replace(found, not_settled=like.not_settled)
    try:  # travel is of the size of strains, which other cells do not keep
        return pulled_from(found, lambda: solve_model(model, t, found.state, Search("pull")))
    except ComputationError as failed:
        return replace(found, not_settled=failed.outcome.cause)


def _untwisted(model: Model, line: Line, start: State) -> State:
    """A start for a planar line: in its plane nothing would turn back the twist of frames about a fold."""
    out = start.copy()
    untwist(line, model.ends.values, model.cable.held_tangent, out)
    return out


def _as_laid(scene: LineScene, model: Model, t: float) -> Equilibrium:
    """Equilibrium with friction that has settled as the scene says; as it says nothing, that is where it can."""
    way = settling(scene, model)
    try:
        found = _by_coarser(scene, model, t) or _statics(scene, model, t, "start" if way == "start" else "")
    except ComputationError:
        if way != "pull":
            raise
        return _statics(scene, model, t, "start")
    on = rubs_on(model.line, model.sea.values, model.ends.values.held, found.state)
    if found.with_friction or not (way == "pull" or (way == "usual" and on == [ON_BED])):
        return found
    try:
        return pulled_from(found, lambda: _statics(scene, model, t, "pull", start=found.state))
    except ComputationError as failed:
        if way == "usual":
            return replace(found, not_settled=failed.outcome.cause)
        return _statics(scene, model, t, "start")


def pulled_from(found: Equilibrium, pull: Callable[[], Equilibrium]) -> Equilibrium:
    """The equilibrium with friction that a pull leads to from one without it, with what is known of that."""
    laid = pull()
    how = f"{laid.path[-1]}, {PUSHED}" if found.pushed else laid.path[-1]
    return replace(laid, path=(*found.path[:-1], *laid.path[:-1], how), iterations=found.iterations + laid.iterations)


def _statics(
    scene: LineScene, model: Model, t: float, settle: str = "", quick: bool = False, start: State | None = None
) -> Equilibrium:
    """The equilibrium by the ways of `Search`, from the start of the model or another."""
    lies = bool(model.line.bits & OBSTACLES)
    borne = borne_strain(model) if lies else np.zeros(0)
    search = Search(settle, quick, model.slack == "warn" and not quick, model.other_starts, borne=borne)

    def keeps_turns(state: State) -> bool:
        try:
            count_turns(scene, model, t, state)
        except ComputationError:
            return False
        return True

    counts = bool(scene.ends.turns) and keeps_turns(model.start)  # else too few cells: no way helps

    def refused(state: State) -> tuple[Outcome, int]:
        return (Outcome.TURNS_LOST if counts and not keeps_turns(state) else Outcome.OK), -1

    def elsewhere(state: State) -> tuple[Outcome, int]:
        outcome, cell = refused(state)
        if outcome != Outcome.OK:
            return outcome, cell
        sea = model.sea.values
        through = passed_obstacles(sea, model.start.r, state.r)
        others = behind_obstacles(model.line, sea, state) if model.start_shape == HUNG else through
        node = next((node for _, node in others), -1)
        return (Outcome.BURIED, node) if node >= 0 else (Outcome.OK, -1)

    solve = partial(solve_model, model, t, model.start if start is None else start)
    if lies and model.start_shape in (HUNG, GIVEN):
        try:
            return solve(search._replace(refused=elsewhere))
        except ComputationError:  # where no way leads to the side of the span, or of the shape, the other may be meant
            if quick:
                raise
    return solve(search._replace(refused=refused if counts else None))


def _settles(scene: LineScene, model: Model, t: float) -> bool:
    """Whether friction holds the cable where it starts, so that no other start will do."""
    return bool(model.line.bits & FRICTION) and (settling(scene, model) == "start" or not model.ends.at(t).held.any())


def settling(scene: LineScene, model: Model, touches: bool = False) -> str:
    """How friction is to settle, as of `Search`: a shape that the scene gives is where the line was laid.

    "usual": as "pull" on a bed alone, where that leads anywhere, else not, which a scene has that says nothing of it.
    What is paid out was laid under tension; and friction of what moves or touches other lines (touches) is not known in
    equilibria.
    """
    asked, line = scene.initial, model.line
    if not line.bits & FRICTION or not isinstance(asked, StaticStart) or asked.friction == "neglected":
        return ""
    hangs = asked.points is None and asked.guess in ("auto", "catenary")
    if asked.friction == "settled":
        return "pull" if hangs else "start"
    meets = touches or line.moved.size or line.bits & SELF_CONTACT
    return "usual" if hangs and not meets and model.payout is None else ""


def _by_coarser(scene: LineScene, model: Model, t: float) -> Equilibrium | None:
    """The equilibrium of a line of many cells: by Newton at once, or from that of a coarser mesh, easier to find.

    Of very many the coarser one comes first: where Newton fails at once, that costs more than all the rest.
    None: neither is, or there are few cells.
    """
    fewer = coarser(model)
    if fewer is None or _settles(scene, model, t):
        return None
    ways = [partial(_statics, scene, model, t, quick=True), partial(_from_coarser, scene, model, fewer, t)]
    for way in ways if model.cells <= MANY else ways[::-1]:
        try:
            return way()
        except ComputationError:
            pass
    return None


def _from_coarser(scene: LineScene, model: Model, fewer: Model, t: float) -> Equilibrium:
    """From the equilibrium of the model with fewer cells; ComputationError: there is none, or it leads to none."""
    coarse = _by_coarser(scene, fewer, t) or _statics(scene, fewer, t)
    start = refined(coarse.state, fewer.line, model.line)
    shape = f"the equilibrium with {fewer.cells} cells{f', {PUSHED}' if coarse.pushed else ''}"
    return _statics(scene, replace(model, start=start, start_shape=shape, other_starts=()), t, quick=True)
