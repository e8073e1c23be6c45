"""The equilibrium of several lines, and what results of them answer to numbers of the scene.

As of one cable (design.cable_at_rest), with the matrix of the network: lines that meet at free points move with them.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import splu

from hybrid.design.cable_at_rest import PART
from hybrid.design.line_at_rest import LEFT_OUT, Beside, LineAtRest, Wanted, parse_result
from hybrid.design.numbers import is_allowed, number_of, with_number
from hybrid.errors import Complaint, ComputationError, Outcome, SceneError
from hybrid.kernels.algebra.block_elimination import SIZE
from hybrid.kernels.state.state import Floats
from hybrid.modal.matrices import linear_network
from hybrid.model.nearby import nearby
from hybrid.model.system import SystemResolution
from hybrid.scene.combinations import refuse_use
from hybrid.scene.read import scene_text
from hybrid.scene.schema import Scene
from hybrid.scene.system import System
from hybrid.simulation.system_run import static_system
from hybrid.solve.system import SystemSolver

OF_LINE = re.compile(r"^(?:(max|min) )?([^/@]+)/(.+)$")
# Tables of a scene on which every line hangs.
OF_ALL = ("environment", "points", "bodies", "obstacles", "output")


def parse_result_of(system: System, text: str) -> tuple[str, Wanted]:
    """The line and the parts of a result such as `east/tension@end`, `max hose/curvature`; SceneError: it is none."""
    found = OF_LINE.match(text)
    name = found[2] if found is not None else ""
    if found is None or name not in system.lines:
        names = ", ".join(system.lines)
        example = f"{next(iter(system.lines))}/tension@end"
        raise SceneError([Complaint("of", text, f"LINE/NAME@S, max LINE/NAME or min LINE/NAME, of {names}", example)])
    text = f"{found[1]} {found[3]}" if found[1] else found[3]
    return name, parse_result(text, system.lines[name].cable.length)


class SystemAtRest:
    """The equilibrium on one mesh, its factors, and the values of results."""

    def __init__(self, system: System, cells: float, of: Sequence[str]) -> None:
        """cells: how many times as long as usual; of: results.

        SceneError, ComputationError: as of `hybrid.sensitivity`.
        """
        refuse_use(system, "derivatives", given="hybrid sensitivity")
        wanted = [parse_result_of(system, x) for x in of]
        resolution = SystemResolution.first(system)
        if cells > 1.0:
            resolution = replace(resolution, lines={k: x.coarser(cells=cells) for k, x in resolution.lines.items()})
        run = static_system(system, None, lambda: scene_text(system), resolution=resolution)
        assert run.found is not None
        if run.found.settled:
            expected = "an equilibrium in which no line touches itself"
            raise SceneError([Complaint("lines", "contact of a line with itself", expected, "a shape that is apart")])
        self.scene, self._resolution, self._names = system, resolution, run.model.names
        self._scenes = {name: self._scene_of(system, name) for name in self._names}
        joined = [
            x._replace(line=model.line) for x, model in zip(run.found.solver.lines, run.model.models, strict=True)
        ]
        self._free = [[k for k in (0, 1) if x.joints[k] >= 0] for x in joined]
        self._order = [(name, k) for name in self._names for k, (line, _) in enumerate(wanted) if line == name]
        rows = zip(self._names, run.model.models, run.state.lines, self._free, strict=True)
        self.lines = [
            LineAtRest(self._scenes[name], model, state, [x for line, x in wanted if line == name], free)
            for name, model, state, free in rows
        ]
        solver = SystemSolver(joined, len(run.found.solver.net), run.found.solver.bodies)
        self._network = linear_network(solver, run.state, self._names, sticks=False, quick=False)
        self._factors = splu(sparse.csc_array(self._network.stiffness + self._network.skew))
        self.values = self._in_order([x.values() if x.wanted else np.zeros(0) for x in self.lines])

    def number(self, key: str) -> float:
        """The value of a key of the scene."""
        return number_of(self.scene, key)

    def by(self, keys: Sequence[str]) -> Floats:
        """(P, W) derivatives of all results by numbers."""
        if not keys:
            return np.zeros((0, self.values.size))
        numbers = np.array([number_of(self.scene, key) for key in keys])
        steps = np.where(numbers == 0.0, PART, PART * np.abs(numbers))
        network, rights, shifts, reports = self._network, [], [], []
        pairs = [self._beside(*row) for row in zip(keys, numbers.tolist(), steps.tolist(), strict=True)]
        for l, line in enumerate(self.lines):
            both = [x[l] for pair in pairs for x in pair]
            left, report = zip(*(line.left(x) for x in both), strict=True)
            right = np.stack([x - y for x, y in zip(left[::2], left[1::2], strict=True)], axis=1) / (2.0 * steps)
            shift = np.zeros((right.shape[0] // SIZE, SIZE, len(keys)))
            for k in {0, 1} - {*self._free[l]}:
                if line.here.ends.held[k]:
                    places = np.stack([x.ends.position[k] for x in both], axis=1)
                    shift[-k, 1:4] = (places[:, ::2] - places[:, 1::2]) / (2.0 * steps)
            shift = shift.reshape(right.shape)
            rights.append(right - network.lines[l].stiffness @ shift)
            shifts.append(shift)
            reports.append([*zip(both, report, strict=True)])
        q = np.asarray(network.place @ self._factors.solve(np.asarray(network.place.T @ np.concatenate(rights))))
        out = []
        for l, line in enumerate(self.lines):
            moved = (q[network.at[l] : network.at[l + 1]] + shifts[l]).T.copy().reshape(len(keys), -1, SIZE)
            blank = np.zeros((len(keys), 0))
            out.append(line.by_state(moved) + line.by_scene(reports[l], steps) if line.wanted else blank)
        return self._in_order(out)

    def _in_order(self, of_lines: Sequence[Floats]) -> Floats:
        """(.., W) results in the order in which they are wanted, of those of each line."""
        every = np.concatenate(of_lines, axis=-1)
        out = np.empty_like(every)
        for place, (_, k) in enumerate(self._order):
            out[..., k] = every[..., place]
        return out

    def _scene_of(self, system: System, name: str) -> Scene:
        """A line with the free points that it carries, and others where they are first."""
        return system.scene_of(name, system.carried(name), system.guesses)

    def _beside(self, key: str, number: float, step: float) -> tuple[list[Beside], list[Beside]]:
        """All lines with a number that is more by a step, and less."""
        more, less = (with_number(self.scene, key, number + d) for d in (step, -step))
        if not is_allowed(more):
            fix = "a number that others do not have to match, as lengths of zones have to"
            raise SceneError([Complaint("by", key, "a number that may change by itself", fix)])
        return self._lines_of(more, key), self._lines_of(less, key)

    def _lines_of(self, system: System, key: str) -> list[Beside]:
        """All lines of a changed scene."""
        same = all(getattr(system, x) is getattr(self.scene, x) for x in OF_ALL)
        out = []
        for name, line in zip(self._names, self.lines, strict=True):
            if same and system.lines[name] is self.scene.lines[name]:
                out.append(line.here)
                continue
            scene = self._scene_of(system, name)
            model = nearby(line.model, self._scenes[name], scene, self._resolution.lines[name], LEFT_OUT)
            if model is None:
                detail = f"{key}: a change of it changes the number of cells; give `mesh: {{cells: ..}}`"
                raise ComputationError(Outcome.NOT_CONVERGED, None, None, detail)
            out.append(line.beside(scene, model))
        return out
