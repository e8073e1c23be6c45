"""Arrays with room for the most cells that a line may have in a run, and tables that follow their number."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from hybrid.adapt.manager import all_zones
from hybrid.adapt.state_transfer import states
from hybrid.kernels.machine.binding import Packed, Room, Table
from hybrid.kernels.run.entry import workspace
from hybrid.kernels.state import books as b
from hybrid.kernels.state.state import Floats, Sea, no_sea
from hybrid.model.layout import kinds_of
from hybrid.model.line import lines

OF_SEA = ("flow", "axis", "slip", "slid", "bed")  # what it has of nodes
REST_OF_SEA = tuple(name for name in Sea._fields if name not in OF_SEA)
seas = Packed(no_sea, given=REST_OF_SEA)
works = Packed(workspace, given=("torsion",))


class Kept(NamedTuple):
    """What of `Books` depends on the cells, but for the samples."""

    tension: Floats
    borne: Floats
    strains: Floats
    start: Floats
    marks: np.ndarray
    right: np.ndarray
    extremes: Floats


class Cells(NamedTuple):
    """A layout, as kernels.mesh.cell_changes.LayoutJob has it; a push out of the plane, and room for the next."""

    place: np.ndarray
    s: Floats
    of: np.ndarray
    rods: np.ndarray
    push: Floats
    next_push: Floats


def blank_cells(n: int) -> Cells:
    z = np.zeros
    return Cells(z(n + 1, int), z(n + 1), z(n, int), z(n, bool), z((n + 1, 4)), z((n + 1, 4)))


class Shaped:
    """A table whose numbers follow from the number of cells of the old and of the new line."""

    def __init__(self, table: Table, values: Callable[[int, int], dict[str, Any]], like: Shaped | None = None) -> None:
        """values: what is bound for so many old and new cells; like: a table of arrays of the same shapes."""
        self.table, self._values = table, values
        self._by_old: np.ndarray
        self._by_new: np.ndarray
        one = self._of(2, 2)
        if like is not None:
            self._by_old, self._by_new = like._by_old, like._by_new
        else:
            self._by_old, self._by_new = self._of(3, 2) - one, self._of(2, 3) - one
        assert max(abs(self._by_old).max(), abs(self._by_new).max()) < 1000  # of shapes; addresses stay
        self._fixed = one - 2 * (self._by_old + self._by_new)

    def _of(self, old: int, new: int) -> np.ndarray:
        self.table.bind(**self._values(old, new))
        return self.table.numbers.copy()

    @property
    def numbers(self) -> np.ndarray:
        """(3, size) fixed, for each old and each new cell."""
        return np.array([self._fixed, self._by_old, self._by_new])

    def of(self, old: int, new: int) -> np.ndarray:
        """(size,) for so many old and new cells."""
        return np.asarray(self._fixed + old * self._by_old + new * self._by_new)

    def places(self, names: tuple[str, ...]) -> np.ndarray:
        """Where the numbers of some values are."""
        parts = [self.table.part(name) for name in names]
        return np.concatenate([np.arange(at.start, at.stop) for at in parts])


class Side:
    """One of the two sets of arrays."""

    def __init__(self, most: int, base: int) -> None:
        self.line, self.kinds, self.zones = Room(lines, most), Room(kinds_of, most), Room(all_zones, most)
        self.states, self.cells = (Room(states, most), Room(states, most)), Room(Packed(blank_cells), most)
        self.first = np.zeros(base + 1, np.int64)


def blank_kept(n: int, extra: int, some: bool) -> Kept:
    """extra: marked nodes; some: whether extremes are kept."""
    nodes, z = n + 1, np.zeros
    return Kept(
        z((2, n)), z(n), z((nodes if some else 0, b.STRAINS)), z((nodes, 3)), z(nodes, np.int8), z(nodes, np.int64),
        z((4, b.EXTREMES, nodes + extra)) if some else z((4, 0, nodes)),
    )  # fmt: skip


class Joined(NamedTuple):
    """Of kernels.mesh.zone_transfer.Match what new cells have."""

    same: np.ndarray
    left: np.ndarray
    kept: np.ndarray
    lengths: Floats


class Single(NamedTuple):
    """And what old nodes have."""

    single: np.ndarray


def blank_joined(n: int) -> Joined:
    z = np.zeros
    return Joined(z(n + 1, np.int64), z(n + 1, np.int64), z(n, np.int64), z(n))


def blank_single(n: int) -> Single:
    return Single(np.zeros(n + 1, np.int8))
