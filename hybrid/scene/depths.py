"""A bed of depths on a grid: depths at the crossings of rising x and y, inline or from a CSV file."""

from __future__ import annotations

import os
from collections.abc import Callable
from functools import lru_cache
from itertools import pairwise
from typing import TYPE_CHECKING, Any, NamedTuple

from pydantic import Field, model_validator

from hybrid.scene.base import Finding, Number, Table, Text, refuse

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

# More points than any survey of a mooring needs; they are kept in memory three times over.
MOST_POINTS = 4_000_000


class Depths(Table):
    """Depths of the bed at the points of a grid.

    Between them the bed is a smooth surface that never leaves the range of the four depths around; beyond the grid it
    goes on straight.
    """

    x: tuple[Number, ...] = Field(default=(), description="x of the grid's lines, rising [m]")
    y: tuple[Number, ...] = Field(default=(), description="y of the grid's lines, rising [m]")
    depth: tuple[tuple[Number, ...], ...] = Field(
        default=(), description="depth of the bed under `seabed.z`: a row for each x, with a number for each y [m]"
    )
    file: Text | None = Field(
        default=None,
        min_length=1,
        description="CSV file with columns x,y,depth, a row for each point of the grid, in any order (m); relative to "
        "the scene file",
    )

    @property
    def surface(self) -> Surface:
        """The grid as arrays.  Only after validation: the file is readable then."""
        if self.file is not None:
            status = os.stat(self.file)
            return _from_file(self.file, status.st_mtime_ns, status.st_size)
        return _from_lists(self.x, self.y, self.depth)

    @model_validator(mode="after")
    def _one_grid(self) -> Depths:
        given = [name for name in ("x", "y", "depth") if getattr(self, name)]
        if self.file is not None:
            fix = "leave it out, or leave file out"
            refuse(Finding((name,), "nothing, because file already gives the depths", fix) for name in given)
            from hybrid.scene.motion_file import readable

            with readable(self.file):
                assert self.surface is not None
            return self
        if len(given) < 3:
            fix = "write x: [...], y: [...], depth: [[...], ...], or file: depths.csv"
            refuse([Finding((), "x, y and depth, or file", fix)])
        for name in ("x", "y"):
            values = getattr(self, name)
            if len(values) < 2:
                refuse([Finding((name,), "at least two numbers, in m", "a level bed needs no depths: give z alone")])
            for k, (a, b) in enumerate(pairwise(values), start=1):
                if not b > a:
                    refuse([Finding((name, k), f"a number above the one before, {a:g} m", "sort them")])
        if len(self.depth) != len(self.x):
            expected = f"{len(self.x)} rows, one for each x"
            refuse([Finding(("depth",), expected, "rows go with x, columns with y", f"{len(self.depth)} rows")])
        for k, row in enumerate(self.depth):
            if len(row) != len(self.y):
                expected = f"{len(self.y)} numbers, one for each y"
                refuse([Finding(("depth", k), expected, "rows go with x, columns with y", f"{len(row)} numbers")])
        return self


class Surface(NamedTuple):
    """Depths (n, m, 4) at x (n,) and y (m,): depth, its slopes along x and y, and the rate of these along the other."""

    x: NDArray[np.float64]
    y: NDArray[np.float64]
    values: NDArray[np.float64]

    def depth_at(self, x: float, y: float) -> tuple[float, float, float]:
        """Depth (m) and its slopes along x and y, as kernels.laws.bed has them."""
        import numpy as np

        i = int(np.clip(np.searchsorted(self.x, x, "right") - 1, 0, len(self.x) - 2))
        j = int(np.clip(np.searchsorted(self.y, y, "right") - 1, 0, len(self.y) - 2))
        h, g = self.x[i + 1] - self.x[i], self.y[j + 1] - self.y[j]
        t, s = min(max((x - self.x[i]) / h, 0.0), 1.0), min(max((y - self.y[j]) / g, 0.0), 1.0)
        over_x, over_y = x - self.x[i] - t * h, y - self.y[j] - s * g
        corners = self.values[i : i + 2, j : j + 2]

        def weights(t: float, h: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
            s = 1.0 - t
            value = [[s * s * (1.0 + 2.0 * t), h * t * s * s], [t * t * (3.0 - 2.0 * t), -h * t * t * s]]
            slope = [[-6.0 * t * s / h, s * (1.0 - 3.0 * t)], [6.0 * t * s / h, t * (3.0 * t - 2.0)]]
            return np.array(value), np.array(slope)

        (a, da), (b, db) = weights(t, h), weights(s, g)

        def weigh(p: NDArray[np.float64], q: NDArray[np.float64]) -> float:
            # corners[..., [[0, 2], [1, 3]]]: derivative along x counts the rows, that along y the columns
            table = corners[..., [0, 2, 1, 3]].reshape(2, 2, 2, 2)
            return float(np.einsum("ik,jl,ijkl->", p, q, table))

        zx, zy = weigh(da, b), weigh(a, db)
        twist = weigh(da, db) if over_x or over_y else 0.0
        depth = weigh(a, b) + over_x * zx + over_y * zy + over_x * over_y * twist
        return depth, zx + over_y * twist, zy + over_x * twist


def _slopes(values: NDArray[np.float64], at: NDArray[np.float64]) -> NDArray[np.float64]:
    """Slopes along the first axis at the points `at`, limited so that the cubics between are monotone (PCHIP)."""
    import numpy as np

    h = np.diff(at).reshape(-1, *[1] * (values.ndim - 1))
    chord = np.diff(values, axis=0) / h
    if len(chord) == 1:
        return np.repeat(chord, 2, axis=0)
    out = np.zeros_like(values)
    before, after = chord[:-1], chord[1:]
    w_before, w_after = h[:-1] + 2.0 * h[1:], 2.0 * h[:-1] + h[1:]
    same = np.sign(before) * np.sign(after) > 0.0
    # harmonic mean; a ratio of chords instead of their inverses, which can overflow
    low, high = np.minimum(abs(before), abs(after)), np.maximum(abs(before), abs(after))
    at_low = np.where(abs(before) <= abs(after), w_before, w_after)
    ratio = np.divide(low, high, out=np.zeros_like(low), where=same)
    total = w_before + w_after
    mean = low * total / (at_low + (total - at_low) * ratio)
    out[1:-1] = np.where(same, np.sign(before) * mean, 0.0)
    for end, k, beside in ((0, 0, 1), (-1, -1, -2)):
        near, far = chord[k], chord[beside]
        slope = near + (near - far) * (h[k] / (h[k] + h[beside]))
        slope = np.where(np.sign(slope) == np.sign(near), slope, 0.0)
        turns = (np.sign(near) != np.sign(far)) & (abs(slope) > 3.0 * abs(near))
        out[end] = np.where(turns, 3.0 * near, slope)
    return out


def _surface(x: NDArray[np.float64], y: NDArray[np.float64], depth: NDArray[np.float64]) -> Surface:
    """With slopes that keep the depths of every cell of the grid between those of its four corners.

    A bicubic is between the smallest and the largest of its 16 Bezier points.  Those on the edges are between the
    corners with monotone cubics there; slopes at a point, then its mixed derivative, are reduced until the inner ones
    are, in the four cells around it.
    """
    import numpy as np

    dx, dy = _slopes(depth, x), _slopes(depth.T, y).T
    both = 0.5 * (_slopes(dx.T, y).T + _slopes(dy, x))
    cells = np.stack([depth[:-1, :-1], depth[1:, :-1], depth[:-1, 1:], depth[1:, 1:]])
    low, high = cells.min(axis=0), cells.max(axis=0)
    h, g = np.diff(x)[:, None] / 3.0, np.diff(y)[None, :] / 3.0

    def limit(parts: Callable[[Any, Any, tuple[slice, slice]], tuple[Any, Any]]) -> NDArray[np.float64]:
        """The largest part (n, m), up to 1, of a change that keeps the inner points; (base, change) by `parts`."""
        part = np.ones_like(depth)
        for i, a in ((slice(None, -1), h), (slice(1, None), -h)):
            for j, b in ((slice(None, -1), g), (slice(1, None), -g)):
                base, change = parts(a, b, (i, j))
                room = np.where(change > 0.0, high - base, base - low).clip(0.0)
                within = np.divide(room, abs(change), out=np.ones_like(room), where=abs(change) > room)
                part[i, j] = np.minimum(part[i, j], within)
        return part

    part = limit(lambda a, b, at: (depth[at], a * dx[at] + b * dy[at]))
    dx, dy = part * dx, part * dy
    both = both * limit(lambda a, b, at: (depth[at] + a * dx[at] + b * dy[at], a * b * both[at]))
    return Surface(x, y, np.ascontiguousarray(np.stack([depth, dx, dy, both], axis=-1)))


@lru_cache(maxsize=4)
def _from_lists(x: tuple[float, ...], y: tuple[float, ...], depth: tuple[tuple[float, ...], ...]) -> Surface:
    import numpy as np

    return _surface(np.array(x), np.array(y), np.array(depth))


@lru_cache(maxsize=4)
def _from_file(path: str, _changed: int, _size: int) -> Surface:
    """The grid of a file, read once for as long as that does not change; RecordRefused."""
    import numpy as np

    from hybrid.scene.motion_file import RecordRefused, read_table

    name = os.path.basename(path)
    header, table, lines = read_table(path, _header)
    columns = [table[:, header.index(c)] for c in ("x", "y", "depth")]
    x, of_x = np.unique(columns[0], return_inverse=True)
    y, of_y = np.unique(columns[1], return_inverse=True)
    if len(x) < 2 or len(y) < 2 or len(x) * len(y) > MOST_POINTS:
        expected = f"a grid of at least 2 x and 2 y, and at most {MOST_POINTS} points"
        raise RecordRefused(expected, "one row for each point x, y", f"{name}, {len(x)} x and {len(y)} y")
    found = np.full((len(x), len(y)), -1)
    for k, (i, j) in enumerate(zip(of_x.tolist(), of_y.tolist(), strict=True)):
        if found[i, j] >= 0:
            given = f"{name}, line {lines[k]}: x = {x[i]:.9g}, y = {y[j]:.9g} again"
            raise RecordRefused("each point once", "drop one of the two rows", given)
        found[i, j] = k
    if (found < 0).any():
        i, j = np.argwhere(found < 0)[0]
        given = f"{name}, which has no row for x = {x[i]:.9g}, y = {y[j]:.9g}"
        expected = f"a depth for every pair of its {len(x)} x and {len(y)} y"
        raise RecordRefused(expected, "put scattered soundings on a grid first", given)
    return _surface(x, y, columns[2][found])


def _header(name: str, header: list[str]) -> list[str]:
    from hybrid.scene.motion_file import RecordRefused

    if sorted(header) == ["depth", "x", "y"]:
        return header
    given = f"{name} with columns {', '.join(header)[:60]}"
    raise RecordRefused("columns x,y,depth, in any order", "name the columns in the first line of the file", given)
