"""Arrays of a line whose cells change in a run, for so many cells as it has at the time."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np

from hybrid.adapt.manager import OF_BASE
from hybrid.kernels.contact.self_distance import Itself, blank_itself
from hybrid.kernels.machine.binding import Packed, Room
from hybrid.kernels.mesh.zone_step import Zones
from hybrid.kernels.run.entry import NO_PUSH
from hybrid.kernels.run.following_run import FollowingPlaces
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
)
from hybrid.simulation.cell_arrays import REST_OF_SEA, Cells, Side, blank_kept, seas, works
from hybrid.simulation.line_of_run import OneOfMany


class CellViews:
    """Two sets of arrays (sides k = 0, 1) with room for the most cells, and views of them for a number of cells."""

    def __init__(self, owner: OneOfMany, most: int, marked: int, at: FollowingPlaces) -> None:
        """most: cells at most; marked: nodes of them beside which extremes are kept on both sides; at: numbers of the
        run (kernels.run.following_run)."""
        assert owner.switching is not None and owner.model.layout is not None
        self._owner, self._run, self._switching, self._at = owner, owner.run, owner.switching, at
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
        if not self._run.push.size:
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
            return self._run.books._replace(**own)
        if (Books, cells) not in self._views:
            self._views[Books, cells] = self._run.books._replace(**own)
        return self._views[Books, cells]
