"""Joints between rod and catenary that carry the moment of the catenary's curvature."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from hybrid.kernels.state.state import Floats, Line, State


class Joints:
    """Joints that carry the moment EI kappa of the catenary beside them, relaxed in time, onto the rod.

    The moment is a couple on the rod's last cell.  The catenary's side gets none: its own moments, which the
    model leaves out, go on beyond the joint.
    """

    def __init__(self, line: Line) -> None:
        turns = np.flatnonzero(line.spin[1:] != line.spin[:-1]) + 1
        before = line.spin[turns - 1] == 1  # the rod lies before the joint
        self.node, self.cell = turns, np.where(before, turns - 1, turns)
        self.side = np.where(before, 1.0, -1.0)
        self.inside = np.clip(np.where(before, turns + 1, turns - 1), 1, line.h.size - 1)
        self.s = line.s[turns]
        self.beside = np.where(before, turns - 1, turns + 1)  # the rod's last element
        self.moment = self.next = np.zeros((turns.size, 3))
        self.force = np.zeros((line.s.size, 3))

    def checkpoint(self) -> dict[str, Any]:
        """The moments, between two steps."""
        return {"moment": self.moment}

    def restore(self, saved: Mapping[str, Any]) -> None:
        """Go on with these moments."""
        self.moment = saved["moment"]

    def on(self, line: Line) -> Joints:
        """The joints of another line; those that stay keep their moments."""
        new = Joints(line)
        for k, s in enumerate(new.s):
            same = np.flatnonzero(self.s == s)
            if same.size and self.side[same[0]] == new.side[k]:
                new.moment[k] = self.moment[same[0]]
        return new

    def aim(self, line: Line, state: State, EI: Floats) -> Floats:
        """EI kappa (k, 3) N m of the catenary at its first node beyond each joint."""
        i = self.inside
        d = state.e / np.linalg.norm(state.e, axis=1)[:, None]
        a, b = d[i - 1], d[i]
        turn = 2.0 * np.cross(a, b) / (1.0 + np.einsum("ij,ij->i", a, b))[:, None]
        return np.asarray((EI[i] / line.hn[i])[:, None] * turn)

    def load(self, line: Line, state: State, EI: Floats, grown: Floats, part: float) -> None:
        """Relax the moments by a part towards their aim, and put them on the rods' ends as forces on the line.

        grown: (N+1,) how much of its stiffness every node has; a rod gets no more moment than that.
        """
        if not self.node.size:
            return
        line.force[:] -= self.force  # of a step that was refused
        c = self.cell
        l = np.linalg.norm(state.e[c], axis=1)[:, None]
        moment = self.moment + min(part, 1.0) * (self.aim(line, state, EI) - self.moment)
        pull = (grown[self.beside] * self.side)[:, None] * np.cross(moment, state.e[c] / l) / l
        self.next, self.force[:] = moment, 0.0
        np.add.at(self.force, c + 1, pull)
        np.add.at(self.force, c, -pull)
        line.force[:] += self.force

    def unload(self, line: Line, way: Floats) -> float:
        """After a step: the work (J) of the moments on the way (N+1, 3) m; the line has its dead loads only."""
        work = float(np.sum(self.force * way))
        line.force[:] -= self.force
        if way.any():
            self.moment = self.next
        self.force[:] = 0.0
        return work
