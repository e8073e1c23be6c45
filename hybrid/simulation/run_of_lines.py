"""What parts of a run of lines may ask of it, and have it do: contact, failures, loads that change, payout.

A part names this and no run, so that the run stands above all of its parts.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple, Protocol

from hybrid.kernels.junctions.bodies import DONE, SPRING
from hybrid.kernels.state.report import SELF_CONTACT
from hybrid.kernels.state.state import Floats, Line, Work
from hybrid.model.build import Model
from hybrid.model.contents import touching
from hybrid.model.failure import unclamped, without_hold
from hybrid.model.network import NetworkModel, NetworkResolution, build_system
from hybrid.scene.network import Network
from hybrid.scene.schema import LineScene
from hybrid.simulation.events import Sink
from hybrid.simulation.line_result import LineResult, LineStep
from hybrid.simulation.parts import Part, Parts
from hybrid.simulation.progress import ProgressReporter
from hybrid.simulation.restart import LoadChange
from hybrid.solve.lines_at_rest import LinesAtRest
from hybrid.solve.network_solver import NetworkSolver
from hybrid.solve.network_steps import NetworkSteps
from hybrid.solve.stepper import NetworkState
from hybrid.store.stored_rows import ComparisonRecorder
from hybrid.store.writer import Recorder
from hybrid.zones.change import on_layout


class RunOfLines(Protocol):
    """A run between two steps; what is writable here, parts change, and the solver follows (`make_solver`)."""

    network: Network
    model: NetworkModel
    state: NetworkState
    other: NetworkState  # after the next step
    solver: NetworkSolver
    loop: NetworkSteps
    lines: list[LineResult]
    scenes: list[LineScene]
    resolution: NetworkResolution
    loaded: float  # s, loads that have stopped by then act no more
    rest: Floats  # bodies when the motion began
    found: LinesAtRest | None

    @property
    def parts(self) -> Parts: ...

    @property
    def recorder(self) -> Recorder | ComparisonRecorder: ...

    @property
    def noted(self) -> Sink: ...

    @property
    def span(self) -> tuple[float, float]: ...

    def note(self, kind: str, text: str, **more: float) -> None: ...

    @property
    def t(self) -> float: ...

    @property
    def steps(self) -> int: ...

    @property
    def last_step(self) -> float: ...

    @property
    def last_rho(self) -> float: ...

    @property
    def touches(self) -> bool: ...

    @property
    def asks_quantities(self) -> bool: ...

    def adopt_cells(self, number: int, model: Model, work: Work) -> None: ...

    def start_from(self, bodies: Floats) -> None: ...

    def make_solver(self) -> None: ...

    def renew_other(self) -> None: ...

    def ends_of_now(self) -> None: ...

    def restart_steps(self) -> None: ...

    def balance(self) -> None: ...

    def renew_solver(self, after: str) -> None: ...

    def change_lines(self, changes: Mapping[int, Callable[[Line], Line]]) -> None: ...

    def go_on_changed(self, numbers: Iterable[int], after: str) -> None: ...

    def go_on_as_attached(self, after: str) -> None: ...

    def gather_events(self) -> None: ...

    def output_due(self) -> None: ...


class Heard(NamedTuple):
    """Who hears of a run, and whether it is to end."""

    reporter: ProgressReporter
    interrupted: Callable[[], bool]


class WatchedLines(Part):
    """What steps have flagged of lines: how near they are to themselves, and what is doubtful about them."""

    name = "lines"

    def __init__(self, run: RunOfLines) -> None:
        self._run = run

    def note_step(self) -> None:
        """Look at it.  LineFailed where going on would make no sense."""
        run, solver = self._run, self._run.solver
        for line, new, old, work in zip(run.lines, run.state.lines, run.other.lines, solver.work, strict=True):
            if seen := int(run.loop.seen[line.number]):
                line.note_nearness(solver, seen, run.t, run.last_step, new)
            if line.books.counts.notices:
                line.watch(LineStep(run.t, new, old, work.report, line.books))


# Other loads and other motions of points and bodies from some time of a run of several lines on.

# Tables of a system in which loads and motions stand.
LOADED = ("environment", "points", "bodies")


def with_loads_of(system: Network, other: Network) -> Network:
    """A system with the loads and motions of another one, which has the same lines."""
    return system.model_copy(update={name: getattr(other, name) for name in LOADED})


def loaded_as(
    model: NetworkModel, system: Network, t: float, fits: Iterable[Callable[[NetworkModel], NetworkModel]] = ()
) -> NetworkModel:
    """The same network from t (s) on with the loads and motions of a system; what is joined or loose stays so.

    fits: each gives a model the cells of now of some lines, in place of those of t = 0.
    """
    other = build_system(system, model.resolution, model)
    for fit in fits:
        other = fit(other)
    models = tuple(_line_as(*each, system, t) for each in zip(model.names, model.models, other.models, strict=True))
    touching = model.touching
    if touching is not None:
        models = tuple(
            replace(x, line=touching.bits(x.line)) if k in touching.lines else x for k, x in enumerate(models)
        )
    supports = {(line, k): other.models[line].ends for line, k in model.supports}
    return replace(
        model, models=models, bodies=other.bodies, known=other.known, scenes=other.scenes, moments=other.moments,
        supports=supports,
    )  # fmt: skip


def _line_as(name: str, now: Model, later: Model, system: Network, t: float) -> Model:
    """The model of a line with other loads, on its cells of now, with what has come off it."""
    for k in (0, 1):
        if now.ends.released[k]:
            later = without_hold(later, k, t)
        elif later.cable.held_tangent[k] and not now.cable.held_tangent[k]:  # it has broken off
            later = unclamped(later, k)
    if now.layout is not None:
        later = on_layout(later, now.layout)
    line = later.line
    for values in ("h", "kb", "k0", "hn", "element", "spin"):
        getattr(line, values)[:] = getattr(now.line, values)  # what is on its way goes on
    line = line._replace(torsion=now.line.torsion)
    if now.line.bits & SELF_CONTACT:
        line = touching(line, system.lines[name].contact.friction)
    later.sea.values.obstacles[:] = now.sea.values.obstacles  # as stiff as they were
    later.ends.go_on_from(now.ends, t)
    return replace(later, line=line)


class LoadChanges(Part):
    """Other loads, and other motions of points and bodies, from some times on."""

    name = "loads"

    def __init__(self, run: RunOfLines, changes: Sequence[LoadChange[Network]], made: int) -> None:
        """changes: in their order; made: how many of them already hold."""
        self._run, self._changes, self._made = run, changes, made

    @property
    def phases(self) -> Sequence[float]:
        """When the others begin to hold (s)."""
        return [x.t for x in self._changes[self._made :]]

    def begin_phase(self, t: float) -> None:
        """The next one holds from now on: lines stay what they are and where they are."""
        run, system = self._run, self._changes[self._made].scene
        run.ends_of_now()
        for line in run.lines:
            line.write_down()
        run.gather_events()  # in the order in which they happen
        run.network, run.model = system, loaded_as(run.model, system, run.t, [x.fit_models for x in run.parts])
        run.loaded = run.t  # loads that end now, or would have ended before, act no more
        run.start_from(run.rest)
        for line, model in zip(run.lines, run.model.models, strict=True):
            line.use_model(model)
        for part in run.parts:
            part.change_loads()
        done = run.solver.body_work[:, DONE:SPRING].copy()
        run.make_solver()
        run.solver.body_work[:, DONE:SPRING] = done
        run.renew_other()
        run.restart_steps()
        others = "other loads act, or points and bodies move otherwise"
        run.note("loads change", f"from t = {run.t:.6g} s on {others}, as `hybrid resume` was asked to")
        self._made += 1

    def checkpoint(self) -> dict[str, Any]:
        """How many hold."""
        return {"changes": self._made}

    def of_today(self, saved: Mapping[str, Any]) -> dict[str, Any]:
        """In files of an earlier program none did."""
        return {"changes": saved.get("changes", 0)}


class ProgressOfRun(Part):
    """Who listens hears how far a run is, and may end it."""

    name = "progress"

    def __init__(self, run: RunOfLines, heard: Heard) -> None:
        self._run, self._heard = run, heard

    def at_pause(self, finished: bool) -> None:
        """Report; KeyboardInterrupt: the run is to end."""
        run, heard = self._run, self._heard
        iterations = int(run.loop.counts.iterations)
        heard.reporter(run.t, run.steps, iterations, run.model.models[0].zones, finished, run.touches)
        if not finished and heard.interrupted():
            raise KeyboardInterrupt
