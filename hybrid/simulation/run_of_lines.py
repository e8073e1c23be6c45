"""What parts of a run of lines may ask of it, and have it do: contact, failures, loads that change, payout.

A part names this and no run, so that the run stands above all of its parts.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from typing import Protocol

import numpy as np

from hybrid.adapt.manager import Change
from hybrid.kernels.state.state import Floats, Line, Work
from hybrid.model.build import Model
from hybrid.model.network import NetworkModel, NetworkResolution
from hybrid.scene.network_scene import Network
from hybrid.scene.schema import LineScene
from hybrid.simulation.deferred_recorder import DeferredRecorder
from hybrid.simulation.events import Sink
from hybrid.simulation.line_of_run import HasPlanes
from hybrid.simulation.line_result import LineResult
from hybrid.simulation.lines_contact import LinesWatch
from hybrid.solve.joined import NetworkState
from hybrid.solve.lines_at_rest import LinesAtRest
from hybrid.solve.network_solver import NetworkSolver
from hybrid.solve.network_steps import NetworkSteps
from hybrid.solve.shared_contact import SharedContact
from hybrid.store.array_contents import ArrayRecorder
from hybrid.store.stored_rows import ComparisonRecorder
from hybrid.store.writer import Recorder


class MovingZones(Protocol):
    """Zones that move: what has changed in the lines they are of."""

    def change_line(self, number: int, change: Callable[[Line], Line]) -> None: ...

    def release(self, ends: Iterable[tuple[int, int]]) -> None: ...

    def change_loads(self) -> None: ...

    def switch(self, number: int, change: Change, here: np.ndarray | None = ...) -> None: ...

    def go_on(self, after: str = ...) -> None: ...


class PaidLines(Protocol):
    """Lines that are paid out."""

    def let_go(self, ends: Iterable[tuple[int, int]]) -> None: ...

    def fit_models(self, model: NetworkModel) -> NetworkModel: ...


class RunOfLines(Protocol):
    """A run between two steps; what is writable here, parts change, and the solver follows (`make_solver`)."""

    system: Network
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
    shared: SharedContact | None  # contact of lines with each other
    watch: LinesWatch | None  # over lines between which no contact is computed
    met: set[tuple[int, int]]  # lines that have been said to touch
    passed: set[tuple[int, int]]  # and to pass through each other
    let_pass: set[tuple[int, int]]  # of lines that may meet, those between which contact is not computed
    found: LinesAtRest | None
    lets_touch: bool  # whether contact begins by itself where lines come near themselves
    came_near_itself: bool  # whether one has

    @property
    def zones(self) -> MovingZones | None: ...

    @property
    def payout(self) -> PaidLines | None: ...

    @property
    def planes(self) -> HasPlanes | None: ...

    @property
    def recorder(self) -> Recorder | ArrayRecorder | DeferredRecorder | ComparisonRecorder: ...

    @property
    def noted(self) -> Sink: ...

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
    def asks_quantities(self) -> bool: ...

    def adopt_cells(self, number: int, model: Model, work: Work) -> None: ...

    def start_from(self, bodies: Floats) -> None: ...

    def make_solver(self) -> None: ...

    def renew_other(self) -> None: ...

    def ends_of_now(self) -> None: ...

    def restart_steps(self) -> None: ...

    def watch_lines(self) -> None: ...

    def gather_events(self) -> None: ...

    def output_due(self) -> None: ...


def change_lines(run: RunOfLines, changes: Mapping[int, Callable[[Line], Line]]) -> None:
    """Give a run models with these lines changed, by number; its solver has still to follow."""
    models = [*run.model.models]
    for k, change in changes.items():
        models[k] = replace(models[k], line=change(models[k].line))
        run.lines[k].follow(models[k])
        if run.zones is not None:
            run.zones.change_line(k, change)
    run.model = replace(run.model, models=tuple(models))
