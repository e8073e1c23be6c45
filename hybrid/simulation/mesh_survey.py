"""The mesh pre-run, and shorter cells at layers.

The mesh pre-run is a coarse run that shows where the cable bends, and hence where cells should be short.

Of a scene that leaves the mesh open and asks for nothing, cells become shorter where a rod bends within less than one:

    symbol   meaning                                                             unit
    EI       bending stiffness, about the weaker axis                            N m2
    lambda   sqrt(EI/T), over which a bend at a clamp or point load fades        m

What the equilibrium on the usual mesh shows decides: where cells are longer than a part of lambda beside a clamp, a
point load or a change of section that bends the line, or turn too far.  Elsewhere, and where nothing is hidden, the
mesh stays as it is.  Where an accuracy is asked for, the pre-run places the cells.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from hybrid.errors import ComputationError
from hybrid.kernels.state.state import Floats, State
from hybrid.model.build import Model, twist_rate
from hybrid.model.mesh import AT_PLACE, DEFAULT_CELLS, GROWTH, LAYER, SAMPLES, Grading, grading, layers
from hybrid.model.network import NetworkResolution, build_network
from hybrid.model.payout import payout_of
from hybrid.model.plan import Demand
from hybrid.model.resolution import (
    Reach,
    RequestedAccuracy,
    Resolution,
    follows_curvature,
    for_motion,
    is_irregular,
    mesh_is_free,
    requested_accuracy,
    shows_bends,
    wants_survey,
)
from hybrid.model.sections import limits_along
from hybrid.outputs.observation import Observation
from hybrid.scene.analysis import ROUGHEST
from hybrid.scene.motion_checks import stationary_from
from hybrid.scene.network import Network
from hybrid.scene.schema import LineScene
from hybrid.simulation.progress import at_once
from hybrid.simulation.run_sample import Outputs, reach_of

CELLS = 2.0  # so many times as long as those of the first result
STEPS = 4.0  # so many times as long as those of the first result
POINTS = 201  # places at which it is compared
# Periods of a stationary irregular motion that the pre-run follows: what 98 % of its outputs ask for is known by then.
PERIODS = 100
# Part of the outputs of an irregular motion whose curvature cells must show.  With 1 (the largest) the ten storms of
# bench/test_bench_irregular.py take about three times as long and are hardly better; with 0.9 largest forces are wrong
# without an event.  Chosen on these ten.
OFTEN = 0.98
# Share of an error of curvature, moment or tension along the line that catenaries may make where a model is chosen.
OF_ALONG = 0.5


def survey_points(model: Model, coarse: Resolution) -> Floats:
    """Places (K,) m at which a pre-run is looked at: evenly spread, and its nodes where a bend has placed these."""
    s = np.linspace(0.0, model.length, POINTS)
    return s if coarse.grading is None else np.union1d(s, model.line.s)


def survey_duration(scene: LineScene) -> float:
    """How long the pre-run is, s: of an irregular motion that is stationary, PERIODS of it, else all of the run."""
    duration = scene.require_time().duration
    found = stationary_from(scene) if is_irregular(scene) else None
    return duration if found is None else min(duration, found[0] + PERIODS * found[1])


def with_survey(resolution: Resolution, scene: LineScene, survey: Survey | None) -> Resolution:
    """With cells where a pre-run shows that they should be, and the share of curvature that limits ask for."""
    if survey is None:
        return resolution
    moved = for_motion(resolution, scene, survey.reach)
    rods = stretches_above_one(survey.demand.s, lack_along(scene, survey))
    return replace(moved, grading=survey.grading(), bends=survey.bends, rods=rods)


def stretches_above_one(s: Floats, x: Floats) -> tuple[tuple[float, float, float], ...]:
    """Where x (K,) at places s (K,) m is above 1: from, to, half of the way to the next place, and the largest x."""
    asks, between = x > 1.0, 0.5 * (s[:-1] + s[1:])
    changes = np.flatnonzero(np.diff(np.concatenate([[False], asks, [False]]).astype(int)))
    bounds = np.concatenate([s[:1], between, s[-1:]])
    return tuple((float(bounds[a]), float(bounds[b]), float(x[a:b].max())) for a, b in changes.reshape(-1, 2))


def lack_along(scene: LineScene, survey: Survey) -> Floats:
    """`Survey.lack_along` of what a scene asks; none (K,) where it asks for nothing."""
    asked = requested_accuracy(scene)
    return survey.lack_along(asked) if asked is not None else np.zeros(survey.demand.s.size)


def bending_asked(scene: LineScene, s: Floats, curvature: Floats) -> float:
    """Error of curvature that is asked, as a part of the largest; infinite where none is.

    curvature: (K,) 1/m, the largest at s (K,) m, which shows how much of min_bend_radius is used.
    """
    asked, largest = requested_accuracy(scene), float(curvature.max(initial=0.0))
    if asked is None or not largest > 0.0:
        return np.inf
    parts = [x for x in (asked.of_curvature, asked.of_moment) if x]
    for x in (x for x in asked.limits if x.quantity == "curvature"):
        used = curvature * limits_along(scene, s)[x.limit]
        if np.isfinite(used).any():
            k = int(np.nanargmax(used))
            parts.append(x.part(float(used[k])) * float(curvature[k] / max(used[k], 1e-300)) / largest)
    return min(parts, default=np.inf)


@dataclass(frozen=True)
class Survey:
    """What a pre-run has shown: its model, and what of it cells and kinds follow from."""

    model: Model
    demand: Demand
    given: float | None  # cells to a length sqrt(EI/T), at fineness 1, where the scene says
    along: bool  # whether cells follow what is asked of curvature, moment or tension along the line
    reach: Reach  # how far the line moves
    bends: float = np.inf  # error of curvature that is asked, as a part of the largest

    @classmethod
    def of(
        cls, scene: LineScene, resolution: Resolution, model: Model, s: Floats, run: Mapping[str, Outputs]
    ) -> Survey:
        """From positions, curvature and tension (nt, K) of a run at s (K,) m; resolution: of the first result."""
        curvature, tension = np.asarray(run["curvature"]), np.asarray(run["tension"])
        low = np.maximum(tension, 1e-9 * model.tension_scale)
        ends = tension.min(axis=0), tension.max(axis=0), tension.mean(axis=0)
        given = None
        if scene.resolution is not None:
            given = AT_PLACE * scene.resolution.cells_per_layer / resolution.fineness
        sharp = curvature.max(axis=0)
        if is_irregular(scene):  # cells are for what statistics see, not for the instant of a snap
            sharp = np.quantile(curvature, OFTEN, axis=0)
        demand = Demand(s, sharp, (curvature / low).max(axis=0), *ends)
        bends = bending_asked(scene, s, sharp)
        reach = reach_of(run["position"])
        along = (asked := requested_accuracy(scene)) is not None and asked.along
        return cls(model, demand, given, along or bends <= ROUGHEST, reach, bends)

    def _layers(self, rod: np.ndarray, joints: Sequence[float]) -> Floats:
        """Cells (SAMPLES,) 1/m beside what disturbs rods; rod: (K,) where the line is one; joints: m."""
        model, demand, material = self.model, self.demand, self.model.cable
        low = np.maximum(demand.least if self.given is None else demand.mean, 1e-3 * model.tension_scale)
        fade = np.where(rod, np.sqrt(material.weakest_bending[material.piece(demand.s)] / low), 0.0)
        disturbed = [*joints, *model.attached]
        disturbed += [x for x, held in zip((0.0, model.length), material.held_tangent, strict=True) if held]
        x = np.linspace(0.0, model.length, SAMPLES)
        found = layers(x, demand.s, fade, sorted({*disturbed}), LAYER if self.given is None else self.given)
        if self.along:  # as short where curvature changes within such a length, as where contact begins
            jumps = np.where(rod, self._jumps(), self._bent())  # a catenary has the bends that it shows, and no sharper
            part = np.sqrt(jumps / demand.curvature.max(initial=1e-300))
            found = found + np.interp(x, demand.s, LAYER * part / np.maximum(fade, self._reach))
        return found

    @property
    def _square(self) -> Floats:
        """EI/T (K,) m2, the square of the length over which bending fades."""
        low = np.maximum(self.demand.least, 1e-3 * self.model.tension_scale)
        return np.asarray(self.model.cable.mean_bending[self.model.cable.piece(self.demand.s)] / low)

    @property
    def _reach(self) -> Floats:
        """Its root (K,) m, or what the pre-run can show."""
        return np.maximum(np.sqrt(self._square), 2.0 * self.model.length / (self.demand.s.size - 1))

    def _beside(self) -> tuple[Floats, Floats]:
        """Curvature (K,) 1/m at this distance before and after every place."""
        s, reach = self.demand.s, self._reach
        before, after = (np.interp(s + x, s, self.demand.curvature) for x in (-reach, reach))
        return before, after

    def _bent(self) -> Floats:
        """By how much curvature (K,) 1/m bends over that distance, as the pre-run shows it."""
        before, after = self._beside()
        return np.asarray(np.abs(before - 2.0 * self.demand.curvature + after))

    def _jumps(self) -> Floats:
        """The same as it is: what a catenary lacks of it, about."""
        return np.asarray(self._bent() * self._smeared)

    @property
    def _smeared(self) -> Floats:
        """How much sharper a bend of that length is than cells of the pre-run show (K,); 1 without stiffness."""
        line = self.model.line
        cell = np.interp(self.demand.s, 0.5 * (line.s[1:] + line.s[:-1]), line.h)
        stiff = self._square > 0.0
        return np.where(stiff, np.maximum(1.0, 0.5 * cell / np.sqrt(np.where(stiff, self._square, 1.0))), 1.0)

    def lack_along(self, asked: RequestedAccuracy) -> Floats:
        """What leaving bending out makes wrong of values along the line (K,), over the share of it that it may.

        A catenary lacks what curvature changes by within sqrt(EI/T), and has EI curvature^2/2 of tension too much.
        """
        demand = self.demand
        found = self._jumps() / (OF_ALONG * self.bends * demand.curvature.max(initial=1e-300))
        if asked.of_tension:
            sharpest = np.maximum(demand.curvature, np.maximum(*self._beside()))
            sharpest = sharpest + self._jumps() * (1.0 - 1.0 / self._smeared)
            less = 0.5 * self._square * demand.least * sharpest**2
            size = max(float(demand.largest.max()), -float(demand.least.min()))
            allowed = max(asked.of_tension * size, asked.round_off("N"))
            found = np.maximum(found, less / (OF_ALONG * allowed))
        return np.asarray(found)

    def grading(self) -> Grading:
        """Cells of a line whose zones stay what they are, those of the pre-run."""
        model, demand = self.model, self.demand
        middle = 0.5 * (model.line.s[:-1] + model.line.s[1:])
        rod = np.interp(demand.s, middle, model.line.spin.astype(float)) > 0.5
        return self._grading(self._layers(rod, [z.s_b for z in model.zones[:-1]]))

    def _grading(self, beside: Floats) -> Grading:
        """beside: (SAMPLES,) 1/m, cells beside what disturbs rods."""
        return grading(self.demand.s, self.demand.curvature, beside, self.model.length)

    @cached_property
    def grading_of_catenary(self) -> Grading:
        """Cells of a line that is catenary everywhere."""
        return self._grading(np.zeros(SAMPLES))


# Changes of bending stiffness along a line, beside which the softer side bends within less than a cell can show.
#
#     symbol   meaning                                                             unit
#     EI       bending stiffness of the section on either side                     N m2
#     lambda   sqrt(EI/T), over which bending fades on a side                      m
#     kappa0   curvature of the line away from the change                          1/m
#
# The moment is the same on both sides.  Where a taut line would bend evenly by kappa0 it is
# kappa0 (EI_1 lambda_2 + EI_2 lambda_1)/(lambda_1 + lambda_2): of a beam under tension, M'' = T (M/EI - kappa0) on
# either
# side, with M and M' continuous.  So the softer side bends by up to sqrt(EI_2/EI_1) times as much as the line beside
# it.

# Cells of a rod that are longer than this many lambda do not show the bend.
LONG = 1.5
# The event is written where the curvature is more than this times the one that is shown.
MORE = 1.5
# rad: bends by less than this are what Newton's tolerance leaves.
ASKEW = 1e-5
# Part of the largest curvature along the line below which the bend decides nothing.
SMALL = 0.2


class SectionLayer(NamedTuple):
    """A bend at a change of section that is not shown."""

    output: int  # of the batch
    node: int
    stiffness: tuple[float, float]  # N m2, before and after it
    shown: float  # 1/m, at the softer side
    true: float  # 1/m, there, of a rod
    length: float  # m, over which it fades there


def hidden_layer(model: Model, seen: Observation) -> SectionLayer | None:
    """The first output, and change of section, whose bend is not shown; None: there is none."""
    line, cable, first = seen.line, model.cable, None
    for node in seen.changes:
        if not 1 < node < line.h.size - 1:
            continue
        s, near = line.s[node], 1e-6 * model.length
        EI = cable.B[cable.piece(np.array([s - near, s + near])), :2].min(axis=1)
        if not (EI.min() > 0.0 and EI.max() > MORE * EI.min()):
            continue
        found = _hidden_at(model, seen, node, EI)
        if found is not None and (first is None or found.output < first.output):
            first = found
    return first


def _hidden_at(model: Model, seen: Observation, node: int, EI: Floats) -> SectionLayer | None:
    """The same of one change of section, between the stiffnesses EI (2,) N m2."""
    line, after = seen.line, int(EI[1] < EI[0])  # whether the softer side is behind it
    d, length = seen.d, model.length
    T = np.maximum(np.minimum(seen.T[node - 1], seen.T[node]), 1e-300)
    fades = np.sqrt(EI[:, None] / T)
    true_moment = (EI[0] * fades[1] + EI[1] * fades[0]) / (fades[0] + fades[1])  # for kappa0 = 1/m
    beside = node + (2 if after else -2)
    beside = beside if 0 < beside < line.h.size else node + (1 if after else -1)
    kappa = np.linalg.norm(d[1:] - d[:-1], axis=1) / seen.of_line("hn", slice(1, -1))  # of the nodes inside
    true = kappa[beside - 1] * true_moment / EI.min()
    side = int(np.flatnonzero(seen.grid.side_nodes == node)[-1 if after else 0])
    shown = seen.curvature_on_sides[side]
    cell = node if after else node - 1
    may_show = line.spin[cell] == 1
    hidden = (true > MORE * shown) & (true * fades.min(axis=0) > ASKEW) & (true > SMALL * kappa.max(axis=0))
    hidden &= (seen.T[node] > 0.0) & (fades.min(axis=0) < 0.1 * length)
    if may_show:
        hidden &= seen.of_line("h", cell) > LONG * fades.min(axis=0)
    at = np.flatnonzero(hidden)
    if not at.size:
        return None
    k = int(at[0])
    return SectionLayer(
        k, node, (float(EI[0]), float(EI[1])), float(shown[k]), float(true[k]), float(fades[:, k].min())
    )


def layer_text(layer: SectionLayer, s: float, rod: bool) -> str:
    """Text of the event; s: m, of the change; rod: whether the softer side is a rod."""
    before, after = layer.stiffness
    shown = f"{layer.shown:.3g} 1/m is shown" if layer.shown > 1e-3 * layer.true else "none is shown"
    why = "in less than a cell" if rod else "and a catenary has no bending"
    return (
        f"bending stiffness changes from {before:.3g} to {after:.3g} N m2 at s = {s:g} m: a rod bends by about "
        f"{layer.true:.3g} 1/m at the softer side, over {layer.length:.2g} m, {why}: {shown}, and error figures of "
        "curvature and moment do not hold there; accuracy: {curvature: 5%} makes cells short enough, with model: rod"
    )


# Cells to a length lambda at a place that bends a rod, and beyond how many such lengths a longer cell hides the bend:
# the curvature at the end of an exponential layer is then off by 1 % and by about 4 %.
LAYER_CELLS, HIDDEN = 4.0, 0.5
# Shortest length lambda that is shown, as a part of the line: below, cells would be shorter than any cable is thick.
SHORTEST = 1e-6
# rad by which a point load or a change of section turns a line before it counts; a clamp always does.
TURNED = 0.02
# rad that a cell may turn through before it is cut, and does turn through then.
MOST_TURN, TURN = 0.3, 0.1
# rad that a cell of a pre-run may turn through in its first state, and how often its cells are placed anew until then.
MOST_FOLD, ROUNDS = 0.6, 6
# Places in geometric order on either side of a disturbed one, as parts of lambda.
BESIDE = np.concatenate([[0.0], np.geomspace(0.05, 20.0, 40)])


# Gives models of lines with their first states, by name, on such cells.  ComputationError: there is no equilibrium.
Rests = Callable[[NetworkResolution], Mapping[str, tuple[Model, State]]]


def layered(scenes: Mapping[str, LineScene], resolution: NetworkResolution, rests: Rests) -> NetworkResolution:
    """With cells as bends and layers of the equilibrium ask for, of rods whose mesh is left open, without a pre-run.

    scenes: of the lines by name.  Zones that move have the mesh of rods, hence that of an equilibrium of rods.
    """
    wanted = [x for x, scene in scenes.items() if _is_open(scene, resolution.lines[x]) and not wants_survey(scene)]
    if not any(shows_bends(scenes[name]) for name in wanted):
        return resolution
    try:
        rest = rests(resolution)
    except ComputationError:
        return resolution  # the run says why
    found = {name: grading_of(scenes[name], *rest[name]) for name in wanted}
    return _graded(resolution, found)


def shown(scenes: Mapping[str, LineScene], resolution: NetworkResolution, rests: Rests) -> NetworkResolution:
    """With cells on which the equilibrium is found, and bends no rod by more than MOST_FOLD from one cell to the next.

    Of lines that have a pre-run.  A slack bend is often shorter than the cells of that by far, and on such cells it may
    be anywhere: where the usual mesh, whatever is asked, shows a fold, its cells are placed and counted from that.
    """
    wanted = [x for x, scene in scenes.items() if _is_open(scene, resolution.lines[x]) and wants_survey(scene)]
    usual = {k: replace(x, fineness=max(x.fineness, 1.0)) if k in wanted else x for k, x in resolution.lines.items()}
    if any(shows_bends(scenes[name]) for name in wanted):
        found = _unfolded(scenes, wanted, NetworkResolution(usual), rests)
        if any(found.lines[name].grading is not None for name in wanted):
            return found
    return _unfolded(scenes, wanted, resolution, rests)


def _unfolded(
    scenes: Mapping[str, LineScene], wanted: Sequence[str], resolution: NetworkResolution, rests: Rests
) -> NetworkResolution:
    """The cells of `shown` that begin with those of a resolution; wanted: names of lines whose cells are placed."""
    tried, found = resolution, resolution
    for _ in range(ROUNDS if wanted else 0):
        try:
            rest = rests(tried)
        except ComputationError:
            lines = tried.lines.items()
            tried = NetworkResolution({k: x.coarser(cells=0.5) if k in wanted else x for k, x in lines})
            continue
        folded = [name for name in wanted if float(_turns(*rest[name]).max()) > MOST_FOLD]
        found, finer = tried, _graded(tried, {name: grading_of(scenes[name], *rest[name]) for name in folded})
        if finer is tried:
            return tried
        tried = finer
    return found


def _graded(resolution: NetworkResolution, gradings: Mapping[str, Grading | None]) -> NetworkResolution:
    """With cells of lines placed, by name; the same where none are."""
    found = {name: x for name, x in gradings.items() if x is not None}
    if not found:
        return resolution
    lines = resolution.lines.items()
    return NetworkResolution({k: replace(x, grading=found[k]) if k in found else x for k, x in lines})


def rods_at_rest(network: Network, resolution: NetworkResolution, moves: bool) -> dict[str, tuple[Model, State]]:
    """Models of lines with their first states, by name, before zones move: as rods.  ComputationError.

    moves: the equilibrium is that with which a motion begins, else that under full loads.
    """
    from hybrid.simulation.equilibrium import equilibrium_of

    with at_once():
        model = build_network(network, resolution=resolution)
        states: Sequence[State] = [x.start for x in model.models]
        if not (moves and network.starts_as_placed):
            states = equilibrium_of(network, model, 0.0 if moves else np.inf).state.lines
    return dict(zip(model.names, zip(model.models, states, strict=True), strict=True))


def _is_open(scene: LineScene, resolution: Resolution) -> bool:
    """Whether the cells of a line are for the program to place, and not yet placed."""
    placed = follows_curvature(scene) or resolution.grading is not None or payout_of(scene) is not None
    return mesh_is_free(scene) and not placed


def grading_of(scene: LineScene, model: Model, state: State) -> Grading | None:
    """The cells that show all bends of a state; None: its own do."""
    line, length = model.line, model.length
    if not line.spin.any():
        return None
    turns = _turns(model, state)
    sharp = np.where(turns > MOST_TURN, _rounded(turns / line.hn / TURN), 0.0)  # 1/m
    found = [(s, float(_rounded(fade))) for s, fade, cell in _layers(model, state, turns) if cell > HIDDEN * fade]
    for s, _ in found:
        sharp[np.abs(line.s - s) <= line.h.max()] = 0.0  # that bend is the layer's
    if not found and not sharp.any():
        return None
    beside = [s + sign * fade * BESIDE for s, fade in found for sign in (-1.0, 1.0)]
    x = np.unique(np.concatenate([np.linspace(0.0, length, SAMPLES), line.s, *beside]))
    x = x[(x >= 0.0) & (x <= length)]
    density = np.interp(x, line.s, np.maximum(sharp, 0.0)) + DEFAULT_CELLS / length
    for s, fade in found:
        density += layers(x, np.array([0.0, length]), np.full(2, fade), [s], LAYER_CELLS)
    density = np.maximum(density, twist_rate(scene, model.cable, x))
    grown = GROWTH * x
    cell = np.minimum.accumulate(1.0 / density - grown) + grown
    cell = np.minimum.accumulate((cell + grown)[::-1])[::-1] - grown
    return Grading(x, 1.0 / cell)


def _layers(model: Model, state: State, turns: Floats) -> Iterator[tuple[float, float, float]]:
    """Places that bend a rod (s, m), the shorter lambda (m) beside them, and the longest cell there (m)."""
    line, cable = model.line, model.cable
    near = 1e-9 * model.length
    last = line.s.size - 1
    places = [node for node, held in zip((0, last), cable.held_tangent, strict=True) if held]
    inner = {*np.searchsorted(line.s, np.array(model.attached) - near).tolist()} - {0, last}
    changes = {*np.searchsorted(line.s, cable.bounds[1:-1] - near).tolist()}
    for node in sorted(changes - {0, last}):
        EI = cable.weakest_bending[cable.piece(line.s[node] + np.array([-near, near]))]
        if EI.max() > MORE * EI.min() > 0.0:
            inner.add(node)
    places += [node for node in sorted(inner) if turns[node] > TURNED]
    for node in places:
        cells = [k for k in (node - 1, node) if 0 <= k < last and line.spin[k]]
        if not cells:
            continue
        middle = 0.5 * (line.s[:-1] + line.s[1:])[cells]
        T, EI = np.asarray(state.T)[cells], cable.weakest_bending[cable.piece(middle)]
        fades = np.sqrt(EI[T > 0.0] / T[T > 0.0])
        fades = fades[fades > SHORTEST * model.length]
        if fades.size:
            yield float(line.s[node]), float(fades.min()), float(line.h[cells].max())


def _rounded(x: Floats | float) -> Floats:
    """To half a percent, so that round-off of an equilibrium (in a plane, in space) does not move nodes."""
    return np.asarray(np.exp(0.01 * np.round(100.0 * np.log(np.maximum(x, 1e-300)))))


def _turns(model: Model, state: State) -> Floats:
    """Angles (N+1,) rad by which rods turn at their inner nodes; 0 at the ends and beside catenaries."""
    d = state.e / np.linalg.norm(state.e, axis=1)[:, None]
    out, spin = np.zeros(model.line.s.size), model.line.spin.astype(bool)
    cosine = np.clip((d[1:] * d[:-1]).sum(axis=1), -1.0, 1.0)
    out[1:-1] = np.where(spin[1:] & spin[:-1], np.arccos(cosine), 0.0)
    return out
