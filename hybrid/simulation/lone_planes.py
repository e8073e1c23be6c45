"""Lines of several that are joined to nothing and lie in a plane: each is computed in it, as one cable is.

What a line does there, leaves and comes back to is watched by the object that watches one cable
(simulation.plane_monitor).  The model that a run has of a line is one in the plane for as long as it is computed there.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from hybrid.errors import IN_SPACE
from hybrid.kernels.run.entry import NO_PUSH
from hybrid.kernels.state import books as b
from hybrid.kernels.state.report import OBSTACLES, PLANAR, SELF_CONTACT
from hybrid.kernels.state.state import Floats, Line
from hybrid.model.build import Model
from hybrid.model.plane import in_space, planar
from hybrid.simulation.line_result import LineResult
from hybrid.simulation.plane_monitor import PlaneMonitor, same_plane
from hybrid.simulation.run_contact import renew_solver
from hybrid.simulation.run_of_lines import RunOfLines, change_lines
from hybrid.solve.network_solver import NetworkSolver
from hybrid.store.named_arrays import matched

TOUCHES = "where it may touch"


class LonePlane:
    """The plane of one line, and the push out of it that is carried along with its steps."""

    def __init__(self, number: int, line: LineResult, counts: b.Counts, insists: bool) -> None:
        """counts: of the run, whose parity says which of two pushes is that of now; insists: as of the monitor."""
        self.monitor = PlaneMonitor(insists)
        self.plane: Floats | None = None  # (3, 3) in which its steps are computed; None: in space
        self._number, self._line, self._counts = number, line, counts
        self._pushes: list[Floats] = [NO_PUSH, NO_PUSH]
        self._solver: NetworkSolver | None = None

    @property
    def clock(self) -> b.Clock:
        """Of the line, with what is known of its push."""
        return self._line.books.clock

    @property
    def push(self) -> Floats:
        """(N+1, 4) out of the plane now, empty where none is carried."""
        return self._pushes[int(self._counts.parity)]

    @property
    def pushes(self) -> tuple[Floats, Floats]:
        """Of states of even parity, and of odd."""
        return self._pushes[0], self._pushes[1]

    @pushes.setter
    def pushes(self, pushes: tuple[Floats, Floats]) -> None:
        self._pushes[:] = pushes

    def carry(self, pushes: tuple[Floats, Floats]) -> None:
        """Carry a push along, now, and room for the next; empty: none."""
        self._pushes[:] = pushes[::-1] if self._counts.parity else pushes
        self.clock.push_start = 0.0
        if self._solver is not None:
            self._solver.carry(self._number, self._pushes)

    def attach(self, solver: NetworkSolver) -> None:
        """Another solver makes the steps from now on."""
        self._solver = solver
        solver.carry(self._number, self._pushes)
        self.monitor.attach(self, solver.lines[self._number].line)


class LonePlanes:
    """Which lines of a run are computed in a plane."""

    def __init__(self, run: RunOfLines, counts: b.Counts, insists: bool) -> None:
        """counts: of its steps; insists: whether the scene asks for two dimensions."""
        self._run = run
        self._lines = {
            k: LonePlane(k, run.lines[k], counts, insists)
            for k, x in enumerate(run.model.models)
            if x.plane is not None
        }
        self._leaving = self._nearing = frozenset[int]()  # after the last step

    def of(self, k: int) -> LonePlane | None:
        """What is known of the plane of line k; None: it has none."""
        return self._lines.get(k)

    def _may(self, k: int) -> bool:
        """Whether nothing of line k has to be computed in space."""
        return not (self._run.lines[k].shares or self._run.model.models[k].line.bits & (SELF_CONTACT | OBSTACLES))

    def _note(self, k: int, node: int, kind: str, text: str) -> None:
        s = float(self._run.model.models[k].line.s[node])
        self._run.lines[k].events.event(self._run.t, s, s, kind, text)

    def _model(self, k: int) -> Model:
        """The model of line k, in its plane where it is in it."""
        model, plane = self._run.model.models[k], self._lines[k].plane
        return replace(model, plane=None) if plane is None else _in(model, plane)

    def begin(self) -> None:
        """Lines that begin in their planes are computed there, from states that lie in them exactly."""
        for k, x in self._lines.items():
            if self._may(k):
                x.plane = x.monitor.begin(
                    self._run.model.models[k], self._run.state.lines[k], partial(self._note, k)
                ).plane

    def put_lines(self) -> None:
        """Before another solver: lines in planes, but for those that touch, or lie in no plane, now."""
        changes = {}
        for k, x in self._lines.items():
            model, may = self._run.model.models[k], self._may(k)
            stays = model.layout is None and model.payout is None and self._run.lines[k].correction is None
            x.monitor.comes_back = may and stays
            if x.plane is not None and not may:
                self._note(k, 0, "out of plane", f"the line comes near itself or another one: {IN_SPACE}, {TOUCHES}")
            if x.plane is not None and not (may and same_plane(x.plane, model.plane)):
                self._leave(k)
            if not same_plane(x.monitor.home, model.plane):  # loads are others
                x.monitor.home = None
            known, line = (x.plane, x.monitor.home, model.line.plane), model.line
            plane = next(each for each in known if each is not None)
            if line.plane is not plane or bool(line.bits & PLANAR) != (x.plane is not None):
                changes[k] = partial(_as_computed, plane=plane, flat=x.plane is not None)
        change_lines(self._run, changes)

    def attach(self, solver: NetworkSolver) -> None:
        """Steps are made by another solver, with lines as of `put_lines`."""
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

    def take_cells(self, k: int, line: Line) -> None:
        """Line k goes on with other cells, to which steps have carried the push."""
        if k in self._lines:
            self._lines[k].monitor.take(line)

    def note_step(self) -> None:
        """Hear of what a step has flagged: pushes that are given anew, and lines that are to leave or to come back."""
        leaving, nearing = set(), set()
        for k, x in self._lines.items():
            flags = int(self._run.lines[k].books.counts.notices)
            if flags & b.PUSH_DIED:
                x.monitor.renew(x)
            if flags & b.LEAVES_PLANE and x.monitor.must_leave(x, partial(self._note, k)):
                leaving.add(k)
            if flags & b.NEARS_PLANE:
                nearing.add(k)
        self._leaving, self._nearing = frozenset(leaving), frozenset(nearing)

    def after_step(self) -> None:
        """Lines leave their planes, and come back, as the last step asks for."""
        left, back = [k for k in self._leaving if self._lines[k].plane is not None], dict[int, Model]()
        for k in left:
            self._leave(k)
        for k in self._nearing:
            x = self._lines[k]
            if x.plane is None and (model := x.monitor.come_back(self._model(k), x, self._run.state.lines[k])):
                x.plane, back[k] = model.plane, model
        if left or back:
            renew_solver(self._run, "where a line leaves its plane, or comes back to it")
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


def _as_computed(line: Line, plane: Floats, flat: bool) -> Line:
    """The line as it is computed: in its plane, or in space beside it."""
    return planar(line, plane) if flat else in_space(line._replace(plane=plane))


def _in(model: Model, plane: Floats) -> Model:
    """A model in a plane."""
    return replace(model, line=planar(model.line, plane), plane=plane)
