"""Lowest and highest values, over every step, of the quantities that a scene asks for by name.

The compiled run keeps them (kernels.watch.named_quantities); here is what it is told, and what the file gets of them.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from types import MappingProxyType
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
    from hybrid.scene.schema import LineScene


NONE: Mapping[str, Quantity] = MappingProxyType({})
NO_ROWS: Mapping[str, tuple[int, int]] = MappingProxyType({})


class StepQuantities:
    """Ranges of the quantities of one line."""

    def __init__(
        self, scene: LineScene, wanted: Mapping[str, Quantity], pipes: Pipes | None = None, line: str = "",
        shown: Mapping[str, Quantity] = NONE, rows_of: Mapping[str, tuple[int, int]] = NO_ROWS,
    ) -> None:  # fmt: skip
        """wanted: by name; pipes: of which wall tension and stress are kept at every node, in the extremes of the line.

        line: its name, of several; shown: clearances by name of two lines that stand with the other one of them, and
        need chords of this one; rows_of: by name of such clearances rows of the path of all lines, the last excluded.
        """
        self.pipes = pipes
        self.walls = pipes.rows() if pipes is not None else np.zeros((0, 0))
        self.wanted = dict(wanted)
        self.asked = np.zeros((len(wanted) + len(shown), k.ASKED))
        self.reached = nothing(len(self.asked))
        rows: list[Floats] = []
        seabed = scene.environment.seabed is not None
        for row, reached, (name, q) in zip(self.asked, self.reached, [*wanted.items(), *shown.items()], strict=True):
            row[k.KIND], row[k.END] = getattr(k, q.kind.upper()), q.end == "end"
            row[k.FIRST : k.LAST + 1] = q.range if q.range and q.line in (line, None) else np.nan
            if q.other is not None:
                row[k.PATH], row[k.PATH_END] = rows_of[name]
                row[k.COUNTED], row[k.OF_PATH] = 1.0, q.line != line
                row[k.KIND] = k.CHORDS if name in shown else k.CLEARANCE
                continue
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
                more = chords_of(np.array(q.path or (q.point,), float), 0.5 * q.diameter)
                row[k.PATH], row[k.PATH_END] = len(rows), len(rows) + len(more)
                rows += [*more]
        self.path = np.array(rows).reshape(-1, k.PATH_ROW)
        whole, begin = whole_scene(scene)
        ends = np.cumsum([x.length for x in whole.cable.sections])
        middles = ends - 0.5 * np.array([x.length for x in whole.cable.sections])
        self.radii = np.column_stack([begin + ends, 0.5 * np.nan_to_num(outer_diameter(whole, middles))])

    def __bool__(self) -> bool:
        return bool(self.asked.size) or bool(self.walls.size)

    def share(self, path: Floats, begin: int) -> None:
        """Share a path with other lines; that of this one begins at a row."""
        own = self.asked[:, k.COUNTED] == 0.0
        self.asked[own, k.PATH] += begin
        self.asked[own, k.PATH_END] += begin
        self.path = path

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
        for row, (name, q) in zip(self.reached, self.wanted.items(), strict=False):  # behind them those that are shown
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


def chords_of(points: Floats, radius: float) -> Floats:
    """Rows (P, PATH_ROW) of a path of a radius, m, through points (n, 3), m.

    Through a single point it is a chord without length.
    """
    if len(points) == 1:
        points = np.concatenate([points, points])
    chords = np.diff(points, axis=0)
    rows = np.zeros((len(chords), k.PATH_ROW))
    rows[:, : k.SQUARE] = np.column_stack([points[:-1], chords])
    rows[:, k.SQUARE], rows[:, k.RADIUS] = np.einsum("ni,ni->n", chords, chords), radius
    return rows
