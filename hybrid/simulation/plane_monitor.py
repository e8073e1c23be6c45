"""A motion in a plane: when it begins, what is watched, and how it goes on in space.

Everything in a plane that could leave it does so by itself in space, if something pushes it; in a plane nothing can.
So a small push is carried along with the motion (kernels.out_of_plane).  When it grows, an event says so, and a motion
that nobody wants in a plane whatever comes goes on in space, with that push.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from hybrid.kernels.report import PUSH_ENERGY, WRONG_PIVOTS
from hybrid.kernels.state import Floats, State
from hybrid.model.build import Model
from hybrid.model.plane import in_space, leaves_plane, planar, untwist
from hybrid.scene.schema import Scene
from hybrid.solve.plane_stability import GROWN, Push
from hybrid.solve.stepper import Stepper

# Of the length: how far the push displaces a cable that goes on in space: a hundred times what an equilibrium may be
# out of the plane, and nothing that anybody would see.
HANDED_ON = 1e-6

Note = Callable[[int, str, str], None]


class PlaneMonitor:
    """Watches a motion in a plane, for as long as it is in one."""

    def __init__(self, scene: Scene) -> None:
        self.insists = scene.dimension == 2
        self.push: Push | None = None

    def begin(self, model: Model, state: State, note: Note) -> Model:
        """The model that the motion begins with, in the plane if it is in one; what leaves the plane is noted."""
        if model.plane is None:
            return model
        if not self.insists and leaves_plane(model.plane, state, model.length):
            text = "the equilibrium found leaves the plane of the scene: it goes on in space"
            out = np.abs((state.r - state.r[0]) @ model.plane[2])
            note(int(np.argmax(out)), "out of plane", text)
            return replace(model, plane=None)
        plane = model.plane
        model = replace(model, line=planar(model.line, plane))
        n = plane[2]
        for x, origin in ((state.r, state.r[0].copy()), (state.e, np.zeros(3))):  # what Newton's tolerance has left
            x -= np.outer((x - origin) @ n, n)
        untwist(model.line, model.ends.values, model.cable.held_tangent, state)
        self.push = Push(model.line, model.length, model.time_scale)
        return model

    def attach(self, stepper: Stepper) -> None:
        """Carry the push along with the steps of a (new) stepper."""
        if self.push is not None:
            self.push.on(stepper.line.s)
        stepper.push = self.push

    def must_leave(self, stepper: Stepper, note: Note) -> bool:
        """Whether, after an accepted step, the motion has to go on in space."""
        if self.push is None:
            return False
        grown = self.push.judge(*stepper.told[PUSH_ENERGY : WRONG_PIVOTS + 1])
        if grown < GROWN:
            return False
        fast = "faster than the step can follow" if np.isinf(grown) else f"by a factor of {grown:.0f}"
        text = f"a small push out of the plane has grown {fast}: the cable would leave the plane"
        where = int(np.argmax(np.abs(self.push.last(1.0)[:, 0])))
        if self.insists:
            note(where, "out of plane", f"{text}; dimension: 2 keeps it there, `dimension: 3` does not")
            stepper.push = self.push = None
            return False
        note(where, "out of plane", f"{text}; it goes on in space, pushed by {HANDED_ON:g} of its length")
        return True

    def leave(self, model: Model, state: State) -> Model:
        """The model in space; the state gets the push."""
        assert self.push is not None and model.plane is not None
        n, x = model.plane[2], self.push.last(HANDED_ON * model.length)
        held = np.flatnonzero(model.ends.values.held) * (model.line.s.size - 1)
        x[held] = 0.0
        for array, column in ((state.r, 0), (state.v, 1), (state.a, 2), (state.vd, 3)):
            array += x[:, column, None] * n
        state.e[:] += np.diff(x[:, 0])[:, None] * n
        d = state.e / np.linalg.norm(state.e, axis=1)[:, None]
        a = state.a1 - np.einsum("ij,ij->i", state.a1, d)[:, None] * d
        size = np.linalg.norm(a, axis=1)[:, None]
        state.a1[:] = np.where(size > 0.0, a / np.where(size > 0.0, size, 1.0), state.a1)
        self.push = None
        return replace(model, line=in_space(model.line), plane=None)


def same_plane(a: Floats | None, b: Floats | None) -> bool:
    """Whether two planes (3, 3) have the same normal, of either sense."""
    return a is not None and b is not None and bool(abs(abs(float(a[2] @ b[2])) - 1.0) < 1e-12)
