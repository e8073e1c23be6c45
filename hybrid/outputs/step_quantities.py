"""Lowest and highest values, over every step, of the quantities that a scene asks for by name.

The compiled run keeps them (kernels.watch.named_quantities); here is what it is told, and what the file gets of them.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from hybrid.kernels.state.books import Books
from hybrid.kernels.state.state import Floats
from hybrid.kernels.watch import named_quantities as k
from hybrid.model.payout import whole_scene
from hybrid.model.sections import outer_diameter
from hybrid.store.format import Field
from hybrid.store.limits import EXTREMES

if TYPE_CHECKING:
    from hybrid.outputs.section_use import Pipes
    from hybrid.scene.quantities import Quantity
    from hybrid.scene.schema import Scene


class StepQuantities:
    """Ranges of the quantities of one line."""

    def __init__(self, scene: Scene, wanted: Mapping[str, Quantity], pipes: Pipes | None = None) -> None:
        """wanted: by name; those that are clearances to another line are left out, as known at the outputs alone.

        pipes: of which wall tension and stress are kept at every node, in the extremes of the line.
        """
        self.pipes = pipes
        self.walls = pipes.rows() if pipes is not None else np.zeros((0, 0))
        self.wanted = {name: q for name, q in wanted.items() if q.other is None}
        self.asked = np.zeros((len(self.wanted), k.ASKED))
        self.reached = nothing(len(self.wanted))
        rows: list[Floats] = []
        seabed = scene.environment.seabed is not None
        for row, reached, q in zip(self.asked, self.reached, self.wanted.values(), strict=True):
            row[k.KIND], row[k.END] = getattr(k, q.kind.upper()), q.end == "end"
            row[k.FIRST : k.LAST + 1] = q.range or np.nan
            row[k.TO_TOUCHDOWN] = q.ends_at(seabed) == "touchdown"
            if q.reference is not None:
                reached[k.REFERENCE : k.REFERENCE + 2] = q.reference
            if q.kind == "azimuth":
                reached[k.REFERENCE] = q.middle
            along = q.direction or q.normal
            if along is not None:
                row[k.DIRECTION : k.DIRECTION + 3] = np.array(along, float) / np.linalg.norm(along)
            if q.normal is not None:
                row[k.IS_PLANE], row[k.POINT : k.POINT + 3] = 1.0, q.point
            elif q.kind == "clearance":
                more = chords_of(np.array(q.path or (q.point,), float))
                row[k.PATH], row[k.PATH_END] = len(rows), len(rows) + len(more)
                row[k.RADIUS] = 0.5 * q.diameter
                rows += [*more]
        self.path = np.array(rows).reshape(-1, k.PATH_ROW)
        whole, begin = whole_scene(scene)
        ends = np.cumsum([x.length for x in whole.cable.sections])
        middles = ends - 0.5 * np.array([x.length for x in whole.cable.sections])
        self.radii = np.column_stack([begin + ends, 0.5 * np.nan_to_num(outer_diameter(whole, middles))])

    def __bool__(self) -> bool:
        return bool(self.wanted) or bool(self.walls.size)

    def given_to(self, books: Books) -> Books:
        """Books of a run, or of a line of several, that keep the ranges."""
        return books._replace(
            asked=self.asked, reached=self.reached, path=self.path, radii=self.radii, walls=self.walls
        )

    def set_idle(self, ends: Collection[int]) -> None:
        """Ends (0, 1) of a line of several at which nothing takes its pull from now on; at the others it is taken."""
        self.asked[:, k.IDLE] = np.isin(self.asked[:, k.END], list(ends))

    def restore(self, saved: object) -> None:
        """Go on with ranges that a checkpoint has; of one from before there were any, they stay unknown."""
        if isinstance(saved, np.ndarray) and saved.shape == self.reached.shape:
            self.reached[:] = saved
        else:
            self.reached[:, k.SMALLEST], self.reached[:, k.LARGEST] = -np.inf, np.inf

    # --- for the file -------------------------------------------------------------------------------

    def fields(self) -> list[Field]:
        """What the file has of them."""
        found = []
        for name, q in self.wanted.items():
            for group, unit, text in parts(q):
                full, about = f"{EXTREMES}/{group}{name}", text.format(name=name)
                found.append(Field(full, unit, about, (2,), ("bounds",), nan_ok=True))
        return found

    def values(self) -> dict[str, Any]:
        """Values of those fields; NaN: not known."""
        out = {}
        for row, (name, q) in zip(self.reached, self.wanted.items(), strict=True):
            known = bool(row[k.SMALLEST] <= row[k.LARGEST]) and bool(np.isfinite(row[: k.LARGEST + 1]).all())
            for (group, *_), at in zip(parts(q), (k.SMALLEST, k.TIMES, k.PLACES), strict=False):
                out[f"{EXTREMES}/{group}{name}"] = row[at : at + 2].copy() if known else np.full(2, np.nan)
        return out


def parts(q: Quantity) -> list[tuple[str, str, str]]:
    """What is kept of a quantity: group of its field, unit, and what it is."""
    found = [
        ("", q.unit, "smallest and largest {name} at any accepted step; NaN: not known"),
        ("t/", "s", "times of the smallest and the largest {name}"),
    ]
    return [*found, ("s/", "m", "arc lengths where they were")] if q.kind == "clearance" else found


def nothing(count: int) -> Floats:
    """Ranges (count, REACHED) of nothing."""
    found = np.full((count, k.REACHED), np.nan)
    found[:, k.SMALLEST], found[:, k.LARGEST], found[:, k.NEAREST] = np.inf, -np.inf, 0.0
    return found


def chords_of(points: Floats) -> Floats:
    """Rows (P, PATH_ROW) of a path through points (n, 3), m; of a single one a chord without length."""
    if len(points) == 1:
        points = np.concatenate([points, points])
    chords = np.diff(points, axis=0)
    return np.column_stack([points[:-1], chords, np.einsum("ni,ni->n", chords, chords)])
