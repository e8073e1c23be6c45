"""Where contact begins and ends, and what numbers of the scene do to it.

In a line of cells it goes from node to node: between two of them it answers by half as much as the line does, and in
between by much more.  Its derivative is therefore that of equilibria between which it goes over several cells.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from hybrid.designs.line_at_rest import LineAtRest
from hybrid.designs.network_at_rest import NetworkAtRest
from hybrid.designs.numbers import changed_scene, number_of, size_of
from hybrid.errors import Complaint, ComputationError, Outcome, SceneError
from hybrid.kernels.state.state import Floats
from hybrid.outputs.observation import penetration
from hybrid.scene.root import Scene

WAY = "differences of equilibria, from cell to cell"
NAMES = ("touchdown", "touchdown_position", "grounded_length")
# Cells over which contact goes between two equilibria, at least and at most; parts of a number by which they differ, at
# first and at most.
CELLS, PARTS = (2.0, 6.0), (1e-2, 0.2)
TRIES = 8
# Error in parts of what twice the way changes, one draw of what goes up and down with the cells; part of a derivative
# that is never said to be known.
OF_CHANGE, UNSURE = 1.5, 0.02


def is_edge(asked: Scene, text: str) -> bool:
    """Whether a result such as `max hose/touchdown`, or a quantity of the scene, goes by where contact begins."""
    name = text.split("@")[0].split("/")[-1].split(" ")[-1].split(".")[0]
    quantity = asked.output.quantities.get(name)
    if quantity is None:
        return name in NAMES
    seabed = asked.environment.seabed is not None
    return "touchdown" in quantity.kind or (quantity.kind == "layback" and quantity.ends_at(seabed) == "touchdown")


def refuse_edges(asked: Scene, of: Sequence[str]) -> None:
    """SceneError: a result that goes by where contact begins, of what knows derivatives of the line of cells alone."""
    for text in of:
        if is_edge(asked, text):
            expected = "a result that changes evenly: where contact begins goes by the nodes that come to the bed"
            fix = "compare two `hybrid static`, or `hybrid run`; `hybrid seek` finds it"
            raise SceneError([Complaint("of", text, expected, fix)])


def by_cells(
    asked: Scene, rest: NetworkAtRest, key: str, values_of: Callable[[Scene], Floats]
) -> tuple[Floats, Floats]:
    """Derivatives (W,) of where contact begins by a number, and their errors: all of what goes over too few cells.

    rest: the equilibrium; values_of: results (W,) of that of another scene, on cells that go along.
    ComputationError: there is no equilibrium beside this one.
    """
    number, size = number_of(asked, key), size_of(asked, key, number_of(asked, key))
    cell = max(_cell(x) for x in rest.lines)

    def change(step: float) -> Floats:
        more, less = (values_of(changed_scene(asked, key, number + x)) for x in (step, -step))
        if not np.isfinite(more - less).all():
            raise ComputationError(Outcome.NOT_REACHED, None, None, f"{key}: a line no longer lies on the bed")
        return more - less

    step, most, cells, found = PARTS[0] * size, PARTS[1] * size, 0.0, np.zeros(0)
    for k in range(TRIES):
        try:
            found = change(step)
        except (ComputationError, SceneError):
            if k == TRIES - 1:
                raise
            most = step = 0.5 * step
            continue
        cells = float(np.abs(found).max()) / cell
        if CELLS[0] <= cells <= CELLS[1] or (cells < CELLS[0] and step == most):
            break
        step = min(step * min(max(sum(CELLS) / 2.0 / max(cells, 1e-3), 0.1), 10.0), most)
    near = found / (2.0 * step)
    try:
        far = change(2.0 * step) / (4.0 * step)
    except (ComputationError, SceneError):
        return near, np.abs(near)
    few = (np.abs(found) < 0.5 * CELLS[0] * cell) | (np.abs(found) > 2.0 * CELLS[1] * cell)
    return far, np.where(few, np.abs(far), np.maximum(OF_CHANGE * np.abs(far - near), UNSURE * np.abs(far)))


def _cell(line: LineAtRest) -> float:
    """The longest cell in which contact begins or ends, m; of a line without contact of all."""
    lies = penetration(line.here.sea, line.state.r[:, :, None])[:, 0] > 0.0
    there = np.flatnonzero(lies[1:] != lies[:-1])
    return float(line.model.line.h[there if there.size else slice(None)].max())
