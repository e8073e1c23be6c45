"""Arrays of a line whose cells change in a run, for so many cells as it has at the time."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, NamedTuple

import numpy as np

from hybrid.adapt.manager import OF_BASE, all_zones, states
from hybrid.kernels.contact.self_distance import Itself, blank_itself
from hybrid.kernels.machine.binding import Packed, Room, Table
from hybrid.kernels.mesh.zone_step import Zones
from hybrid.kernels.run.entry import NO_PUSH, workspace
from hybrid.kernels.run.following_run import FollowingPlaces
from hybrid.kernels.state import books as b
from hybrid.kernels.state.books import Books
from hybrid.kernels.state.state import (
    NO_GRIP,
    NO_PEAK,
    NO_SHEAVES,
    NO_SLOW,
    NO_SOIL,
    NO_TENSION_TORQUE,
    NO_TORSION,
    NO_WAKE,
    TENSION_TORQUE,
    Floats,
    Line,
    Sea,
    State,
    Work,
    no_sea,
)
from hybrid.model.layout import kinds_of
from hybrid.model.line import lines
from hybrid.simulation.line_of_run import OneOfMany


class CellViews:
    """Two sets of arrays (sides k = 0, 1) with room for the most cells, and views of them for a number of cells."""

    def __init__(self, owner: OneOfMany, most: int, marked: int, at: FollowingPlaces) -> None:
        """Views of a line whose cells follow the curvature.

        most: cells at most; marked: nodes of them beside which extremes are kept on both sides; at: numbers of the run
        (kernels.run.following_run).
        """
        assert owner.switching is not None and owner.model.layout is not None
        self._owner, self._switching, self._at = owner, owner.switching, at
        base, some = int(owner.model.layout.rod.size), owner.envelope is not None
        self.base = np.zeros(base + 1, np.int64)
        self.sides = Side(most, base), Side(most, base)
        self._kept = Room(Packed(lambda n: blank_kept(n, marked, some)), most)
        self._sea, self._work = Room(seas, most), Room(works, most)
        self.watched = owner.itself is not None and owner.itself.on
        self.itself: Itself = blank_itself(np.zeros(most))
        self._turn = np.zeros((0, 3))
        self._views: dict[Any, Any] = {}  # while tables are bound
        self._binding = False

    @contextmanager
    def bound(self) -> Iterator[None]:
        """While tables are bound a view is the same for the same number of cells."""
        self._binding = True
        try:
            yield
        finally:
            self._binding = False
            self._views.clear()

    def _view(self, room: Room, cells: int, given: Callable[[], dict[str, Any]] = dict) -> Any:
        """Of a room, for so many cells; while tables are bound, the same for the same."""
        if not self._binding:
            return room.view(cells, **given())
        if (room, cells) not in self._views:
            self._views[room, cells] = room.view(cells, **given())
        return self._views[room, cells]

    def line(self, k: int, cells: int) -> Line:
        line = self._owner.model.line
        given = {"bits": line.bits, "plane": line.plane, "torsion": NO_TORSION}
        given |= dict.fromkeys(TENSION_TORQUE, NO_TENSION_TORQUE)
        found: Line = self._view(self.sides[k].line, cells, lambda: given)
        return found

    def zones(self, k: int, cells: int) -> Zones:
        zones = self._switching.zones

        def given() -> dict[str, Any]:
            kinds = self._view(self.sides[k].kinds, cells, lambda: {"free": zones.kinds.free})
            return {"kinds": kinds, **{name: getattr(zones, name) for name in OF_BASE}}

        found: Zones = self._view(self.sides[k].zones, cells, given)
        return found

    def state(self, k: int, which: int, cells: int) -> State:
        found: State = self._view(
            self.sides[k].states[which],
            cells,
            lambda: {
                "turn": self._turn,
                "slow": NO_SLOW,
                "wake": NO_WAKE,
                "peak": NO_PEAK,
                "grip": NO_GRIP,
                "sheave": NO_SHEAVES,
                "soil": NO_SOIL,
            },
        )
        return found

    def layout(self, k: int, cells: int) -> Cells:
        found: Cells = self._view(self.sides[k].cells, cells)
        return found

    def width(self, cells: int) -> Floats:
        """Diameters of cells; none where nobody watches whether the line meets itself."""
        return self.itself.width[: cells if self.watched else 0]

    def push(self, k: int, which: int, cells: int) -> Floats:
        """Of a run that carries one, else none."""
        if not self._owner.push.size:
            return NO_PUSH
        layout = self.layout(k, cells)
        return layout.next_push if which else layout.push

    def sea_on(self, cells: int) -> Sea:
        values = self._owner.model.sea.values
        found: Sea = self._view(self._sea, cells, lambda: {x: getattr(values, x) for x in REST_OF_SEA})
        return found

    def work_on(self, cells: int) -> Work:
        found: Work = self._view(self._work, cells, lambda: {"torsion": self._owner.stepper.work.torsion})
        return found

    def books(self, cells: int) -> Books:
        own = self._view(self._kept, cells)._asdict() | {"base": self.base}
        if not self._binding:
            return self._owner.books._replace(**own)
        if (Books, cells) not in self._views:
            self._views[Books, cells] = self._owner.books._replace(**own)
        return self._views[Books, cells]


# Arrays with room for the most cells that a line may have in a run, and tables that follow their number.

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


def copy_fields(old: Any, new: Any, but: tuple[str, ...] = ()) -> None:
    """Copy the arrays of a named tuple into those of another one, but for these."""
    for name in old._fields:
        if name not in but:
            getattr(new, name)[:] = getattr(old, name)
