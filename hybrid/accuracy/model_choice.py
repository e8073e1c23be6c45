"""Which model a scene is computed with, and what bending that is left out changes.

What leaving bending out changes: the run with rods in place of catenaries is computed as well, and compared.
Lines that are joined move each other: all get the error that one of them has.  The rods have the cells and the very
steps of the run, and where zones have moved those of its rods, so that both have the same error by the mesh and by the
step.  Beside point loads and clamps that catenaries bend at they have shorter cells, within which bending fades.  A run
to compare with, whose cells and steps are longer, shows it of catenaries that move and touch nothing; else the result
does.

A scene that leaves the choice of its model gets rods, catenaries or zones that move, whichever costs least.
A pre-run of rods shows where the cable bends and how tension goes; what each kind would cost follows from the cells
that it needs.  docs/zone_rules.md
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import replace
from math import ceil, isinf
from typing import Any, NamedTuple

import numpy as np

from hybrid.accuracy.error_order import joined, magnitude
from hybrid.errors import ComputationError, Outcome, SceneError
from hybrid.model.build import Model
from hybrid.model.material import LEAST_WEIGHT
from hybrid.model.mesh import GROWTH, Grading
from hybrid.model.network import NetworkResolution, build_network
from hybrid.model.payout import payout_of
from hybrid.model.plan import (
    REST,
    ModelChoice,
    cheapest,
    costs,
    foretold_steps,
    no_catenary,
    ratios,
    reasons,
    rods_of_zones,
    structural,
)
from hybrid.model.resolution import Resolution, model_is_free, wants_survey
from hybrid.model.sections import OutputPoints
from hybrid.scene.analysis import AdaptiveModel, CatenaryZone, Mesh, RodModel, RodZone, ZonesModel
from hybrid.scene.cable import Environment, Section
from hybrid.scene.network import JoinedLine, Network
from hybrid.scene.root import Scene
from hybrid.scene.schema import LineScene
from hybrid.simulation.case import Case
from hybrid.simulation.mesh_survey import CELLS, STEPS, Survey, lack_along, layered, shown, with_survey
from hybrid.simulation.run_sample import END_FORCES, NOT_ESTIMATED, RIGHT, RunSample, Samples
from hybrid.zones.change import HOLD, LONGEST_IN_RAMP, READY

Stretches = Collection[tuple[float, float]]  # m, of s
ROD_CELLS = 4.0  # of rods to a length sqrt(EI/T) beside point loads and clamps: the curvature there is 1 % off


class _EndCell(NamedTuple):
    """Outputs within a cell at an end: a rod and a catenary are drawn there each in its own way.

    How far each is off is an error of cells (outputs.probes).
    """

    within: np.ndarray  # their numbers
    nodes: tuple[int, int]  # of the output at the end, and the first beyond the cell
    parts: np.ndarray  # (2, n) of the values at these two, in the values within


def with_model_errors(case: Case, runs: Samples, costs: list[float]) -> Samples:
    """A run with what leaving bending out changes in it.

    costs: s of processor time, to which that of the rods is added.  All lines get the error, because what one of them
    leaves out moves the others.
    """
    network = case.scene
    names = [name for name, x in runs.items() if leaves_bending_out(network.lines[name], x)]
    if not names:
        return dict(runs)
    finely = NetworkResolution({name: _in_steps_of(x) for name, x in runs.items()})
    changes, finely, ends = as_rods(network, finely, {name: runs[name] for name in names}, case.points)
    try:
        with case.instead(case.scene.with_lines(changes)):
            rods = case.sample(finely)
    except (ComputationError, SceneError) as error:
        text = f"with rods in place of them: {str(error).splitlines()[0]}; `model: rod`, or a finer mesh, tells why"
        note = ((NOT_ESTIMATED, f"what bending would change in its catenaries is not known: {text}"),)
        return {name: replace(x, notes=(*x.notes, *note)) if name in names else x for name, x in runs.items()}
    costs.append(next(iter(rods.values())).cpu)
    return {name: replace(x, model_error=_difference(x, rods[name], ends.get(name, ()))) for name, x in runs.items()}


def _in_steps_of(run: RunSample) -> Resolution:
    """The resolution of a run in the very steps that it took: of others, the difference would be of steps."""
    if run.resolution.local is None or not len(run.forces):
        return run.resolution
    return replace(run.resolution, local=None, ends=tuple(run.forces[:, 0].tolist()))


def goes_by_cells(case: Case, runs: Samples) -> bool:
    """Whether longer cells do not show what leaving bending out changes, or hardly cost less.

    They do not beside joints of rods and catenaries, and where a line touches down: bending fades within a cell there.
    An equilibrium costs little on any cells.
    """
    network = case.scene
    left_out = [x for name, x in runs.items() if leaves_bending_out(network.lines[name], x)]
    return not case.moves or any(x.rods or may_touch(network) for x in left_out)


def may_touch(network: Network) -> bool:
    """Whether there is a bed or an obstacle."""
    return network.environment.seabed is not None or bool(network.surfaces)


def can_leave_bending_out(line: JoinedLine) -> bool:
    """Whether a line that can bend may be catenary somewhere."""
    return any(x.weakest_bending for x in line.sections) and not isinstance(line.chosen_model, RodModel)


def leaves_bending_out(line: JoinedLine, run: RunSample) -> bool:
    """Whether a line that can bend was catenary anywhere, at any time of a run."""
    if not can_leave_bending_out(line):
        return False
    if run.catenary.size:  # zones have moved
        return bool(run.catenary.any())
    return sum(b - a for a, b in joined(run.rods)) < line.cable.length * (1 - 1e-9)


def as_rods(
    network: Network, resolution: NetworkResolution, runs: Samples, points: Mapping[str, OutputPoints]
) -> tuple[dict[str, dict[str, Any]], NetworkResolution, dict[str, list[_EndCell]]]:
    """Tables of lines with rods in place of catenaries, by name, how finely they are computed, and their end cells.

    resolution: of a run of the network; runs: of the lines that change in it; points: where outputs of lines are.
    """
    model, tables, finely = build_network(network, resolution=resolution), {}, dict(resolution.lines)
    ends: dict[str, list[_EndCell]] = {}
    for name, run in runs.items():
        line, s = model.models[model.names.index(name)], points[name].s
        tension = np.asarray(run.values["tension"]).max(axis=0)
        nodes, s = _nodes(line, run.rods), s[run.places] if run.places.size else s
        ends[name] = list(_end_cells(line, nodes, s))
        for at, short in _kinks(line, s, tension):
            nodes = _with_layer(nodes, at, short, run.rods)
        tables[name] = {"model": _rods(network.lines[name]), "mesh": Mesh(nodes=tuple(nodes.tolist()))}
        finely[name] = replace(resolution.lines[name], fineness=1.0, grading=None, parts=1)
    return tables, NetworkResolution(finely), ends


def _difference(run: RunSample, rods: RunSample, ends: Iterable[_EndCell]) -> dict[str, np.ndarray]:
    """By quantity; of moments, which a catenary has none of, all of them.

    ends: cells within which curvature differs as it does from node to node.
    """
    called, there = END_FORCES | RIGHT, {name: np.asarray(x) for name, x in run.values.items()}
    found = {
        called.get(name, name): magnitude(np.asarray(x) - there.get(name, 0.0), name) for name, x in rods.values.items()
    }
    for x in ends if "curvature" in found else ():
        found["curvature"][:, x.within] = found["curvature"][:, list(x.nodes)] @ x.parts
    return found


def _nodes(model: Model, rods: Stretches) -> np.ndarray:
    """Nodes (m) of a line whose zones stay, or, where they move, of base cells and of rods where there were any."""
    layout = model.layout
    if layout is None:
        return model.line.s
    s, near = layout.finest.nodes, 1e-9 * model.length
    kept = np.zeros(s.size, bool)
    kept[layout.starts] = True
    for a, b in rods:
        kept |= (s >= a - near) & (s <= b + near)
    return s[kept]


def _end_cells(model: Model, nodes: np.ndarray, s: np.ndarray) -> Iterator[_EndCell]:
    """The cells at ends that turn freely, of nodes and outputs at these s (m), where there is one at the end."""
    ends, cells = (0, s.size - 1), (nodes[1] - nodes[0], nodes[-1] - nodes[-2])
    for end, place, cell, held in zip(ends, (nodes[0], nodes[-1]), cells, model.cable.held_tangent, strict=True):
        away = np.abs(s - place)
        within, beyond = np.flatnonzero((away > 0.0) & (away < cell)), np.flatnonzero(away >= cell)
        if not held and away[end] == 0.0 and within.size and beyond.size:
            other = int(beyond[np.argmin(away[beyond])])
            part = away[within] / away[other]
            yield _EndCell(within, (end, other), np.array([1.0 - part, part]))


def _kinks(model: Model, s: np.ndarray, tension: np.ndarray) -> Iterator[tuple[float, float]]:
    """Point loads and clamps (m), and how long cells of rods are there; tension: N, the largest at s (m).

    None of a line that is paid out, whose winch makes its cells.
    """
    cable, ends = model.cable, (0.0, model.length)
    for at in (
        ()
        if model.payout is not None
        else {*model.attached, *(x for x, held in zip(ends, cable.held_tangent, strict=True) if held)}
    ):
        EI, T = float(cable.mean_bending[cable.piece(np.array([at]))[0]]), float(np.interp(at, s, tension))
        if EI > 0.0 < T:
            yield at, float(np.sqrt(EI / T)) / ROD_CELLS


def _with_layer(nodes: np.ndarray, at: float, short: float, rods: Stretches) -> np.ndarray:
    """Nodes (m) with others beside a place: cells of a length there, which grow away from it, in place of longer ones.

    rods: stretches that keep their cells.
    """
    more = list[float]()
    for way, end in ((-1.0, nodes[0]), (1.0, nodes[-1])):
        far = step = short
        while far < way * (end - at):
            x = at + way * far
            k = min(max(int(np.searchsorted(nodes, x)), 1), nodes.size - 1)
            if any(a <= x <= b for a, b in rods) or nodes[k] - nodes[k - 1] < step:
                break
            if min(nodes[k] - x, x - nodes[k - 1]) > 0.5 * step:
                more.append(x)
            step = short + GROWTH * far
            far += step
    return np.union1d(nodes, more)


def _rods(line: JoinedLine) -> RodModel | ZonesModel:
    """Rod wherever a line can bend."""
    kinds = [bool(x.weakest_bending) for x in line.sections]
    if all(kinds):
        return RodModel()
    lengths: list[tuple[bool, float]] = []
    for kind, section in zip(kinds, line.sections, strict=True):
        before = lengths.pop()[1] if lengths and lengths[-1][0] is kind else 0.0
        lengths.append((kind, before + section.length))
    zones = tuple(RodZone(rod=x) if kind else CatenaryZone(catenary=x) for kind, x in lengths)
    return ZonesModel(zones=zones)


# Why a line may be no catenary that has come near itself in a pre-run.
NEAR = "it comes near itself, and contact of catenaries alone is not asked for"


def choice_of(
    scene: LineScene, rods: LineScene, survey: Survey, resolution: Resolution, near: str
) -> tuple[ModelChoice, Resolution]:
    """The model that costs least, and how finely it is computed first, by a pre-run of rods.

    scene: as it was asked; rods: of the pre-run; near: why the line may be no catenary, beside what its scene says.
    """
    resolution = with_survey(resolution, scene, survey)
    model, demand = survey.model, survey.demand
    gradings: dict[str, Grading] = {"rod": survey.grading(), "catenary": survey.grading_of_catenary}
    gradings["adaptive"] = gradings["rod"]
    found = ratios(scene, model, demand, resolution.zones * model.length, lack_along(scene, survey))
    cells, catenaries = (gradings[kind].count(0.0, model.length, resolution.fineness) for kind in ("rod", "catenary"))
    why_not = structural(scene, model.cable) or near or no_catenary(found, demand.s)
    of_zones = rods_of_zones(model, demand, found, gradings["rod"])
    each = costs(scene, model, cells, catenaries, of_zones, why_not, _steps_of_zones(rods, model, resolution))
    kind = cheapest(each).kind
    return ModelChoice(kind, reasons(each)), replace(resolution, grading=gradings[kind])


def _steps_of_zones(scene: LineScene, model: Model, resolution: Resolution) -> float:
    """Steps of zones that move for one of rods: those that follow the motion are no longer than zones let them be."""
    time, longest = scene.require_time(), LONGEST_IN_RAMP * READY * HOLD * model.time_scale
    if resolution.local is None or isinf(longest):
        return 1.0
    rods = foretold_steps(scene, model, resolution, ceil(time.duration / resolution.step))
    return max(1.0, time.duration / longest / rods)


def chosen_and_surveyed(
    case: Case, resolution: NetworkResolution, chosen: Collection[str] = ()
) -> tuple[dict[str, ModelChoice], NetworkResolution]:
    """Models for lines whose scene names none, and cells by a pre-run for those that want one.

    chosen: lines whose model has been chosen already.
    """
    resolution = layered(case.lines, resolution, case.first_shapes)
    scenes = {name: x for name, x in case.lines.items() if wants_survey(x)}
    open_yet = [x for x, scene in scenes.items() if x not in chosen and model_is_free(scene, case.moves)]
    choices = dict[str, ModelChoice]()
    if not scenes:
        return choices, resolution
    if not case.moves:
        choices = dict.fromkeys(open_yet, ModelChoice("rod", REST))
        case.scene, open_yet = case.with_models(dict.fromkeys(open_yet, "rod")), []
        scenes = {name: case.lines[name] for name in scenes}
    if case.criterion is not None:
        open_yet = []
    # of rods, which alone show what zones would leave out of a bend
    moving = [name for name, x in scenes.items() if name in open_yet or isinstance(x.model, AdaptiveModel)]
    rods = case.with_models(dict.fromkeys(moving, "rod"))
    with case.instead(rods):
        of_rods, coarse = case.lines, resolution.coarser(CELLS, STEPS if case.moves else 1.0)
        if not (case.moves and case.scene.starts_as_placed):  # a shape that is given has the bends that it has
            coarse = shown(of_rods, coarse, case.first_shapes)
        surveys = case.survey(resolution, coarse)
    if surveys is None:
        failed = ModelChoice("rod", "the pre-run that would show what others cost failed")
        case.scene = case.with_models(dict.fromkeys(open_yet, "rod"))
        return choices | dict.fromkeys(open_yet, failed), _placed_as(resolution, coarse, {*open_yet, *chosen})
    finely = dict(resolution.lines)
    for name, scene in scenes.items():
        if name in open_yet:
            near = NEAR if name in case.near_themselves else ""
            choices[name], finely[name] = choice_of(scene, of_rods[name], surveys[name], finely[name], near)
        else:
            finely[name] = with_survey(finely[name], scene, surveys[name])
    case.scene = case.with_models({name: choices[name].kind for name in open_yet})
    return choices, NetworkResolution(finely)


def _placed_as(resolution: NetworkResolution, coarse: NetworkResolution, names: Collection[str]) -> NetworkResolution:
    """With the cells of a pre-run that failed, as the equilibrium has placed them, of lines with these names."""
    found = {k: replace(x, grading=coarse.lines[k].grading) if k in names else x for k, x in resolution.lines.items()}
    return NetworkResolution(found)


# Rods in place of a catenary that nobody asked for, where it goes into compression in a motion.
#
# A line without bending stiffness is a catenary where its scene names no model, and no catenary carries compression.
# So
# that the choice of a model is never what a run stops for, such a run begins anew with rods, whose sections without
# bending stiffness get EI = w l^3, with the submerged weight w per length and a hundredth of the line l, as long as the
# cells of a mesh that is not given: under its weight the line then bends over one cell, which is as sharp as catenaries
# show a bend.

CHOSEN = "slack line as rods"  # of the event that says so
RODS = 100  # of a mesh that is not given


class Instead(NamedTuple):
    """What is computed in place of a scene, and the text of the event."""

    scene: Any
    text: str


def rods_instead_of_slack(scene: Scene, error: ComputationError) -> Instead | None:
    """A scene with rods in place of catenaries that stood for no model; None: they did not, or did not go slack."""
    if error.outcome != Outcome.SLACK or error.t is None:
        return None
    called = scene.form.names
    name = next((x for x in scene.lines if called[x] == error.line_name), None)
    if name is None or scene.lines[name].model is not None or payout_of(scene.scene_of(name)) is not None:
        return None
    sections, given = _stiffened(scene.lines[name].sections, scene.environment)
    text = f"{f'line {name}: ' * bool(called[name])}{_text(error, given)}"
    text += "; no other line has changed" * (len(called) > 1)
    return Instead(scene.with_lines({name: {"sections": sections, "model": RodModel()}}), text)


def _stiffened(sections: tuple[Section, ...], around: Environment) -> tuple[tuple[Section, ...], list[float]]:
    """Sections that bend, and the bending stiffness of those that had none, N m2."""
    length = sum(x.length for x in sections) / RODS
    density = around.fluid.density if around.fluid is not None else 0.0
    found, given = [], []
    for x in sections:
        if not x.weakest_bending:
            in_water = around.gravity * (x.mass - density * 0.25 * math.pi * (x.diameter or 0.0) ** 2)
            given.append(max(abs(in_water), LEAST_WEIGHT * x.mass) * length**3)
            x = x.model_copy(update={"bending_stiffness": given[-1]})
        found.append(x)
    return tuple(found), given


def _text(error: ComputationError, given: list[float]) -> str:
    """What the event says."""
    stiffness = " and ".join(f"{x:.3g}" for x in dict.fromkeys(given))
    return (
        f"computed as rods, because as a catenary it went into compression at t = {error.t:.4g} s, "
        f"s = {error.s or 0.0:.4g} m, and the run began anew; bending_stiffness is not given and taken as {stiffness} "
        "N m^2, by which the line bends over a hundredth of its length: give its own"
    )
