"""Lines of several that are joined to nothing and lie in a plane: each is computed in it, as one cable is.

What a line does there, leaves and comes back to is watched by the object that watches one cable
(simulation.plane_monitor); all else of the run has these lines in space, with the bit of a plane where one is.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any, Protocol

import numpy as np

from hybrid.errors import IN_SPACE
from hybrid.kernels.run.entry import NO_PUSH
from hybrid.kernels.state import books as b
from hybrid.kernels.state.forces import OBSTACLES, SELF_CONTACT
from hybrid.kernels.state.state import Floats
from hybrid.model.build import Model
from hybrid.model.plane import planar
from hybrid.model.system import SystemModel
from hybrid.simulation.events import EventLog
from hybrid.simulation.plane_monitor import PlaneMonitor, same_plane
from hybrid.solve.joined import JoinedLine, SystemState
from hybrid.solve.system import SystemSolver
from hybrid.store.named_arrays import matched

TOUCHES = "where it may touch"


class _Line(Protocol):
    """What is asked of a line of the run."""

    books: b.Books
    events: EventLog
    shares: bool


class _Run(Protocol):
    """What is asked of the run."""

    model: SystemModel
    state: SystemState

    @property
    def t(self) -> float: ...
    @property
    def lines(self) -> Sequence[_Line]: ...


class LonePlane:
    """The plane of one line, and the push out of it that is carried along with its steps."""

    def __init__(self, number: int, line: _Line, counts: b.Counts, insists: bool) -> None:
        """counts: of the run, whose parity says which of two pushes is that of now; insists: as of the monitor."""
        self.monitor = PlaneMonitor(insists)
        self.plane: Floats | None = None  # (3, 3) in which its steps are computed; None: in space
        self._number, self._line, self._counts = number, line, counts
        self._pushes: list[Floats] = [NO_PUSH, NO_PUSH]
        self._solver: SystemSolver | None = None

    @property
    def clock(self) -> b.Clock:
        """Of the line, with what is known of its push."""
        return self._line.books.clock

    @property
    def push(self) -> Floats:
        """(N+1, 4) out of the plane now, empty where none is carried."""
        return self._pushes[int(self._counts.parity)]

    def carry(self, pushes: tuple[Floats, Floats]) -> None:
        """Carry a push along, now, and room for the next; empty: none."""
        self._pushes[:] = pushes[::-1] if self._counts.parity else pushes
        self.clock.push_start = 0.0
        if self._solver is not None:
            self._solver.carry(self._number, self._pushes)

    def attach(self, solver: SystemSolver) -> None:
        """Another solver makes the steps from now on."""
        self._solver = solver
        solver.carry(self._number, self._pushes)
        self.monitor.attach(self, solver.lines[self._number].line)


class LonePlanes:
    """Which lines of a run are computed in a plane."""

    def __init__(self, run: _Run, counts: b.Counts, insists: bool) -> None:
        """counts: of its steps; insists: whether the scene asks for two dimensions."""
        self._run = run
        self._lines = {
            k: LonePlane(k, run.lines[k], counts, insists)
            for k, x in enumerate(run.model.models)
            if x.plane is not None
        }

    def _may(self, k: int) -> bool:
        """Whether nothing of line k has to be computed in space."""
        return not (self._run.lines[k].shares or self._run.model.models[k].line.bits & (SELF_CONTACT | OBSTACLES))

    def _note(self, k: int, node: int, kind: str, text: str) -> None:
        s = float(self._run.model.models[k].line.s[node])
        self._run.lines[k].events.event(self._run.t, s, s, kind, text)

    def _model(self, k: int) -> Model:
        """The model of line k, in its plane where it is in it."""
        model, plane = self._run.model.models[k], self._lines[k].plane
        return (
            replace(model, plane=None) if plane is None else replace(model, line=planar(model.line, plane), plane=plane)
        )

    def begin(self) -> None:
        """Lines that begin in their planes are computed there, from states that lie in them exactly."""
        for k, x in self._lines.items():
            if self._may(k):
                x.plane = x.monitor.begin(
                    self._run.model.models[k], self._run.state.lines[k], partial(self._note, k)
                ).plane

    def on(self, lines: Sequence[JoinedLine]) -> list[JoinedLine]:
        """The lines as another solver gets them: in planes, but for those that touch, or lie in no plane, now."""
        found = [*lines]
        for k, x in self._lines.items():
            may, now = self._may(k), self._run.model.models[k].plane
            x.monitor.comes_back = may
            if not same_plane(x.monitor.home, now):  # loads are others
                x.monitor.home = None
            if x.plane is not None and not may:
                self._note(k, 0, "out of plane", f"the line comes near itself or another one: {IN_SPACE}, {TOUCHES}")
            if x.plane is not None and not (may and same_plane(x.plane, now)):
                self._leave(k)
            plane = x.plane if x.plane is not None else x.monitor.home
            if plane is not None:
                line = found[k].line
                found[k] = found[k]._replace(
                    line=line._replace(plane=plane) if x.plane is None else planar(line, plane)
                )
        return found

    def attach(self, solver: SystemSolver) -> None:
        """Steps are made by another solver, with lines as of `on`."""
        for x in self._lines.values():
            x.attach(solver)

    def _leave(self, k: int) -> None:
        """Line k goes on in space, with its push unless it does so for other lines, as if it had been there always."""
        x = self._lines[k]
        if x.monitor.speed and self._run.lines[k].shares and x.plane is not None:
            x.monitor.leave_as_it_is(x.plane)
        elif x.monitor.speed:
            x.monitor.leave(self._model(k), x, self._run.state.lines[k])
        x.plane = None

    def after_step(self, renew: Callable[[str], None]) -> None:
        """Lines leave their planes and come back after a step that has flagged it; renew: gives the run a solver."""
        left, back = False, dict[int, Model]()
        for k, x in self._lines.items():
            flags = int(self._run.lines[k].books.counts.notices)
            if flags & b.PUSH_DIED:
                x.monitor.renew(x)
            if flags & b.LEAVES_PLANE and x.monitor.must_leave(x, partial(self._note, k)):
                self._leave(k)
                left = True
            if flags & b.NEARS_PLANE and x.plane is None:
                model = x.monitor.come_back(self._model(k), x, self._run.state.lines[k])
                if model is not None:
                    x.plane, back[k] = model.plane, model
        if left or back:
            renew("where a line leaves its plane, or comes back to it")
        for k, model in back.items():
            self._lines[k].monitor.push_on(self._lines[k], model)

    # --- checkpoints ------------------------------------------------------------------------------

    def checkpoint(self) -> dict[str, Any]:
        """The planes of lines, and what is carried along there, by name."""
        names, found = self._run.model.names, {}
        for k, x in self._lines.items():
            push = None if x.plane is None else x.monitor.checkpoint(x)
            found[names[k]] = {"plane": x.plane, "home": x.monitor.home, "push": push}
        return found

    def restore_planes(self, saved: Mapping[str, Any]) -> None:
        """Lines are in the planes of a checkpoint, before there is a solver.  ValueError: they have none."""
        if not isinstance(saved, Mapping):
            raise ValueError("planes: a table with names of lines was expected")
        for k, x in self._lines.items():
            mine = saved.get(self._run.model.names[k])  # not in a checkpoint of an earlier program
            if mine is not None:
                mine = matched(mine, {"plane": None, "home": None, "push": None}, "planes")
                x.plane, x.monitor.home = (
                    None if mine[key] is None else matched(mine[key], np.zeros((3, 3)), key)
                    for key in ("plane", "home")
                )
                x.monitor.speed = 0.0
                if mine["push"] is not None:
                    model = self._run.model.models[k]
                    x.monitor.speed = model.length / model.time_scale

    def restore_pushes(self, saved: Mapping[str, Any]) -> None:
        """Carry along what a checkpoint says, with the solver that there is now.  ValueError: that cannot be."""
        for k, x in self._lines.items():
            mine = saved.get(self._run.model.names[k])
            if mine is not None and mine["push"] is not None:
                pair = np.zeros((2, *x.push.shape))
                push = {"pair": pair, "unit": 0.0, "energy": 0.0, "led": True, "real": False}
                x.monitor.restore(matched(mine["push"], push, "push"), x)
