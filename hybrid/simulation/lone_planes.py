"""Lines that are joined to nothing and lie in a plane: each is computed in it, until it leaves it.

Everything in a plane that could leave it does so by itself in space, if something pushes it; in a plane nothing can.
So a small push is carried along with the motion (laws.out_of_plane).  When it grows, an event says so, and a motion
that nobody wants in a plane whatever comes goes on in space, with that push.  A line that has come back goes on in the
plane, and what it is still off it becomes the push.  The model that a run has of a line is one in the plane for as long
as it is computed there.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

import numpy as np

from hybrid.errors import IN_SPACE, PUSHED
from hybrid.kernels.run.newton import NO_PUSH
from hybrid.kernels.state import books as b
from hybrid.kernels.state.report import OBSTACLES, PLANAR, SELF_CONTACT
from hybrid.kernels.state.state import Floats, Line, State
from hybrid.kernels.step.accept import GROWN
from hybrid.model.build import Model, in_space, leaves_plane, planar, untwist
from hybrid.model.network import NetworkModel
from hybrid.simulation.parts import Part
from hybrid.simulation.run_line import RunLine
from hybrid.simulation.run_of_lines import RunOfLines
from hybrid.solve.network_solver import NetworkSolver
from hybrid.solve.stability import on_nodes, scaled, seed
from hybrid.store.integrity import matched

TOUCHES = "where it may touch"
# Of the length: how far the push displaces a cable that goes on in space: a hundred times what an equilibrium may be
# out of the plane, and nothing that anybody would see.
HANDED_ON = 1e-6
# Of the length: how far from its plane a line in space is back in it.
BACK = 1e-7
# Of the length: a push that was real and is larger is given its size anew: linear equations no longer hold.
FARTHEST = 1e-4
# Angle, rad, through which sections of rods may then be turned against those of a line without twist.
UNTWISTED = 1e-2

NO_NODES: Floats = np.zeros(0)
Note = Callable[[int, str, str], None]


class LonePlane:
    """The plane of one line: whether its steps are in it, and the push out of it that they carry along."""

    def __init__(self, number: int, line: RunLine, counts: b.Counts, insists: bool) -> None:
        """counts: of the run, whose parity says which of two pushes is that of now; insists: as of `LonePlanes`."""
        self.insists = insists
        self.plane: Floats | None = None  # (3, 3) in which its steps are computed; None: in space
        self.home: Floats | None = None  # (3, 3) plane that has been left once
        self.comes_back = False  # whether a line that has left its plane may go on in it later
        self.speed = 0.0  # m/s, of a push when it is given; 0: none is carried along
        self.real = False  # whether the push is what a line that has come back was off its plane
        self._s: Floats = NO_NODES  # m, nodes that it is carried on
        self._across: Floats = np.zeros((0, 4))  # of a line that comes back, m, s
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

    def carry(self, push: Floats, started: float = 0.0) -> None:
        """Carry a push along, and room for the next; NO_PUSH: none.  started: J, its energy when it was given."""
        pushes = push, np.zeros_like(push)
        self._pushes[:] = pushes[::-1] if self._counts.parity else pushes
        self.clock.push_start = started
        if self._solver is not None:
            self._solver.carry(self._number, self._pushes)

    def begin(self, model: Model, state: State, note: Note) -> None:
        """The motion begins in the plane if the state is in it; what leaves the plane is noted."""
        if model.plane is None:
            return
        n = model.plane[2]
        if not self.insists and leaves_plane(model.plane, state, model.length):
            text = f"the equilibrium found leaves the plane of the scene: {IN_SPACE}"
            note(int(np.argmax(np.abs((state.r - state.r[0]) @ n))), "out of plane", text)
            return
        for x, origin in ((state.r, state.r[0].copy()), (state.e, np.zeros(3))):  # what Newton's tolerance has left
            x -= np.outer((x - origin) @ n, n)
        untwist(planar(model.line, model.plane), model.ends.values, model.cable.held_tangent, state)
        self.speed, self.plane = model.length / model.time_scale, model.plane

    def attach(self, solver: NetworkSolver) -> None:
        """Another solver makes the steps from now on: carry the push along with its line, in proportion to s."""
        self._solver, line = solver, solver.lines[self._number].line
        solver.carry(self._number, self._pushes)
        away = self.comes_back and self.home is not None and not self.speed
        self.clock.near_plane = BACK * line.s[-1] if away else 0.0
        if not self.speed:
            self.carry(NO_PUSH)
        elif not np.array_equal(line.s, self._s):
            push = on_nodes(self.push, self._s, line.s) if self._s.size else seed(line.s, self.speed)
            self._give(push, line.s)

    def use_cells_of(self, line: Line) -> None:
        """Go on with other cells, to which the run has carried the push."""
        if self.speed:
            self._s = line.s

    def _give(self, push: Floats, s: Floats) -> None:
        self.carry(push, float(self.clock.push_start) if self._s.size else 0.0)
        self._s = s

    def renew(self) -> None:
        """Give the push anew: it has died."""
        self.push[:] = seed(self._s, self.speed)
        self.clock.push_start, self.real = 0.0, False

    def must_leave(self, note: Note) -> bool:
        """Whether the motion has to go on in space, after a step in which the push had grown too large."""
        grown = float(self.clock.push_grown)
        fast = "faster than the step can follow" if np.isinf(grown) else f"by a factor of {grown:.0f}"
        text = f"a small push out of the plane has grown {fast}: the cable would leave the plane"
        where = int(np.argmax(np.abs(scaled(self.push, 1.0, self._s)[:, 0])))
        if self.insists:
            note(where, "out of plane", f"{text}; dimension: 2 keeps it there, `dimension: 3` does not")
            self.speed = 0.0
            self.carry(NO_PUSH)
            return False
        if self.home is None:
            back = f"; in the plane again where it is within {BACK:g} of its length" if self.comes_back else ""
            note(where, "out of plane", f"{text}; {PUSHED} {HANDED_ON:g} of its length{back}")
        return True

    def leave(self, model: Model, state: State, shares: bool) -> None:
        """Go on in space; the state gets the push, but for a line that shares contact, which others move out of it."""
        assert self.plane is not None
        if self.speed and not shares:
            self._displace(model, state, self.plane[2])
        if self.speed:
            self.speed, self._s, self.home, self.real = 0.0, NO_NODES, self.plane, False
        self.plane = None

    def _displace(self, model: Model, state: State, n: Floats) -> None:
        """Displace a state by the push along the normal n (3,)."""
        known = self.real and bool(np.abs(self.push[:, 0]).max() < FARTHEST * model.length)
        x = self.push.copy() if known else scaled(self.push, HANDED_ON * model.length, self._s)
        held = np.flatnonzero(model.ends.values.held) * (model.line.s.size - 1)
        x[held] = 0.0
        for array, column in ((state.r, 0), (state.v, 1), (state.a, 2), (state.vd, 3)):
            array += x[:, column, None] * n
        state.e[:] += np.diff(x[:, 0])[:, None] * n
        d = state.e / np.linalg.norm(state.e, axis=1)[:, None]
        a = state.a1 - np.einsum("ij,ij->i", state.a1, d)[:, None] * d
        size = np.linalg.norm(a, axis=1)[:, None]
        state.a1[:] = np.where(size > 0.0, a / np.where(size > 0.0, size, 1.0), state.a1)

    def come_back(self, model: Model, state: State) -> bool:
        """Whether the motion goes on in the plane, on which the state is projected; not where its rods are twisted.

        What was across the plane becomes the push when the run has the model (`push_on`).
        """
        assert self.home is not None
        n, line = self.home[2], planar(model.line, self.home)
        twisted = state.a1.copy()
        across = [(state.r - state.r[0]) @ n, state.v @ n, state.a @ n, state.vd @ n]
        state.r[:] -= np.outer(across[0], n)
        for x in (state.e, state.v, state.a, state.vd):
            x -= np.outer(x @ n, n)
        untwist(line, model.ends.values, model.cable.held_tangent, state)
        if self._is_twisted(model, np.linalg.norm(state.a1 - twisted, axis=1)):
            return False
        for spins in (state.w, state.wa, state.wd):
            spins[:] = 0.0
        self.speed, self.real, self._across = model.length / model.time_scale, True, np.column_stack(across)
        self.plane = self.home
        return True

    @staticmethod
    def _is_twisted(model: Model, angle: Floats) -> bool:
        """Whether turns of sections by these angles (N,) rad matter: M Theta/(2 T) is beyond BACK of the length."""
        line = model.line
        between = line.element * np.abs(np.diff(angle, prepend=0.0, append=0.0))
        torque = float((line.kb[:, 2] * between).max())
        return bool(angle.max() > UNTWISTED or torque * np.pi > 2.0 * model.tension_scale * BACK * model.length)

    def push_on(self, model: Model) -> None:
        """Carry along what was across the plane; about where that comes to HANDED_ON of the length it leaves again."""
        self._give(self._across, model.line.s)
        least = BACK * model.length / model.time_scale
        speeds = np.maximum(np.abs(self._across[:, 1]), least)
        begun = BACK * GROWN / HANDED_ON  # by how much a push that was given at the start would have grown by now
        self.clock.push_start = 0.5 * float(model.line.mass @ speeds**2) / begun**2

    def checkpoint(self) -> dict[str, Any] | None:
        """The push, its energy when it was given, and whether it is of a line that has come back."""
        if not self.speed:
            return None
        pair, energy = np.array([self.push, self.push]), float(self.clock.push_start)
        return {"pair": pair, "unit": self.speed, "energy": energy, "led": True, "real": self.real}

    def restore(self, saved: Mapping[str, Any]) -> None:
        """Go on as `checkpoint` has written; ValueError where that cannot be."""
        if not saved["unit"] > 0.0:
            raise ValueError("a push of no size")
        self.speed, self.real = saved["unit"], saved["real"]
        self.push[:] = saved["pair"][int(saved["led"])]
        self.clock.push_start = saved["energy"]


def same_plane(a: Floats | None, b: Floats | None) -> bool:
    """Whether two planes (3, 3) have the same normal, of either sense."""
    return a is not None and b is not None and bool(abs(abs(float(a[2] @ b[2])) - 1.0) < 1e-12)


class LonePlanes(Part):
    """Which lines of a run are computed in a plane."""

    name, wants = "planes", b.LEAVES_PLANE | b.PUSH_DIED | b.NEARS_PLANE

    def __init__(self, run: RunOfLines, counts: b.Counts, insists: bool, begins: bool) -> None:
        """counts: of its steps; insists: whether the scene asks for two dimensions; begins: whether it is a start."""
        self._run, self._begins = run, begins
        self._lines = {
            k: LonePlane(k, run.lines[k], counts, insists)
            for k, x in enumerate(run.model.models)
            if x.plane is not None
        }
        for k, plane in self._lines.items():
            run.lines[k].plane = plane
        self._leaving = self._nearing = frozenset[int]()  # after the last step

    def _may(self, k: int) -> bool:
        """Whether nothing of line k has to be computed in space."""
        return not (self._run.lines[k].shares or self._run.model.models[k].line.bits & (SELF_CONTACT | OBSTACLES))

    def _note(self, k: int, node: int, kind: str, text: str) -> None:
        s = float(self._run.model.models[k].line.s[node])
        self._run.lines[k].events.event(self._run.t, s, s, kind, text)

    def fit_lines(self) -> None:
        """Lines go into their planes, but for those that touch, or lie in no plane, now.

        Those that begin in their planes do so from states that lie in them exactly.
        """
        changes, begins, self._begins = {}, self._begins, False
        for k, x in self._lines.items():
            if begins and self._may(k):
                x.begin(self._run.model.models[k], self._run.state.lines[k], partial(self._note, k))
        for k, x in self._lines.items():
            model, may = self._run.model.models[k], self._may(k)
            stays = model.layout is None and model.payout is None
            x.comes_back = may and stays
            if x.plane is not None and not may:
                near = "may reach an obstacle" if model.line.bits & OBSTACLES else "comes near itself or another one"
                self._note(k, 0, "out of plane", f"the line {near}: {IN_SPACE}, {TOUCHES}")
            if x.plane is not None and not (may and same_plane(x.plane, model.plane)):
                self._leave(k)
            if not same_plane(x.home, model.plane):  # loads are others
                x.home = None
            known, line = (x.plane, x.home, model.line.plane), model.line
            plane = next(each for each in known if each is not None)
            if line.plane is not plane or bool(line.bits & PLANAR) != (x.plane is not None):
                changes[k] = partial(_as_computed, plane=plane, flat=x.plane is not None)
        self._run.change_lines(changes)

    def use_solver(self, model: NetworkModel, solver: NetworkSolver) -> None:
        """Steps are made by another solver, with lines as of `fit_lines`."""
        for x in self._lines.values():
            x.attach(solver)

    def _leave(self, k: int) -> None:
        """Line k goes on in space, as if it had been there always."""
        run = self._run
        self._lines[k].leave(run.model.models[k], run.state.lines[k], run.lines[k].shares)

    def note_step(self) -> None:
        """Hear of what a step has flagged: pushes that are given anew, and lines that are to leave or to come back."""
        leaving, nearing = set(), set()
        for k, x in self._lines.items():
            flags = int(self._run.lines[k].books.counts.notices)
            if flags & b.PUSH_DIED:
                x.renew()
            if flags & b.LEAVES_PLANE and x.must_leave(partial(self._note, k)):
                leaving.add(k)
            if flags & b.NEARS_PLANE:
                nearing.add(k)
        self._leaving, self._nearing = frozenset(leaving), frozenset(nearing)

    def after_step(self) -> None:
        """Lines leave their planes, and come back, as the last step asks for."""
        run, lines = self._run, self._lines
        left = [k for k in self._leaving if lines[k].plane is not None]
        for k in left:
            self._leave(k)
        away = [k for k in self._nearing if lines[k].plane is None]
        back = [k for k in away if lines[k].come_back(run.model.models[k], run.state.lines[k])]
        if left or back:
            run.renew_solver("where a line leaves its plane, or comes back to it")
        for k in back:
            lines[k].push_on(run.model.models[k])

    # --- checkpoints ------------------------------------------------------------------------------

    def checkpoint(self) -> dict[str, Any]:
        """The planes of lines, and what is carried along there, by name."""
        names, found = self._run.model.names, {}
        for k, x in self._lines.items():
            push = None if x.plane is None else x.checkpoint()
            found[names[k]] = {"plane": x.plane, "home": x.home, "push": push}
        return {"planes": found}

    def restore_lines(self, saved: Mapping[str, Any]) -> bool:
        """Lines are in the planes of a checkpoint.  ValueError: they have none."""
        saved = saved["planes"]
        if not isinstance(saved, Mapping):
            raise ValueError("planes: a table with names of lines was expected")
        for k, x in self._lines.items():
            mine = saved.get(self._run.model.names[k])  # not in a checkpoint of an earlier program
            if mine is not None:
                mine = matched(mine, {"plane": None, "home": None, "push": None}, "planes")
                x.plane, x.home = (
                    None if mine[key] is None else matched(mine[key], np.zeros((3, 3)), key)
                    for key in ("plane", "home")
                )
                x.speed = 0.0
                if mine["push"] is not None:
                    model = self._run.model.models[k]
                    x.speed = model.length / model.time_scale
        return False  # lines are as `fit_lines` makes them

    def restore(self, saved: Mapping[str, Any]) -> None:
        """Carry along what a checkpoint says, with the solver that there is now.  ValueError: that cannot be."""
        for k, x in self._lines.items():
            mine = saved["planes"].get(self._run.model.names[k])
            if mine is not None and mine["push"] is not None:
                pair = np.zeros((2, *x.push.shape))
                push = {"pair": pair, "unit": 0.0, "energy": 0.0, "led": True, "real": False}
                x.restore(matched(mine["push"], push, "push"))


def _as_computed(line: Line, plane: Floats, flat: bool) -> Line:
    """The line as it is computed: in its plane, or in space beside it."""
    return planar(line, plane) if flat else in_space(line._replace(plane=plane))
