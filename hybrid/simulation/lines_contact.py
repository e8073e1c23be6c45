"""Lines beside each other: their contact, whether they cross between two shapes, a watch over those without contact."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from hybrid.kernels.contact.self_contact_law import OUTER
from hybrid.kernels.junctions.lines_distance import (
    AT,
    HAVE_MET,
    MET,
    MOVED,
    NEAR,
    OTHER,
    ROOM,
    TIME,
    WATCHED,
    blank_lines_job,
    watch_lines,
)
from hybrid.kernels.machine.binding import Table
from hybrid.kernels.state.books import Clock
from hybrid.kernels.state.state import Floats
from hybrid.model.build import Model
from hybrid.model.lines_contact import Touching, joined_ends_of
from hybrid.model.network import NetworkModel
from hybrid.scene.network_scene import Network
from hybrid.simulation.contact_equilibrium import JUMP, jumps
from hybrid.simulation.self_watch import diameters, least_bending
from hybrid.solve.joined import NetworkState
from hybrid.solve.shared_contact import SharedContact, TouchingLine

PASSED = "lines pass through each other"  # kind of an event


def shared_of(model: NetworkModel, rubs: bool = False) -> SharedContact | None:
    """Contact of the lines of a model with each other, with friction or without; None: they have none."""
    if model.touching is None:
        return None
    return SharedContact(model.touching, [strand_in(model.models[k]) for k in model.touching.lines], rubs)


def strand_in(x: Model) -> TouchingLine:
    """What contact takes of the line of a model."""
    grows = 0.0 if x.payout is None else float(np.diff(x.payout.nodes).max())
    return TouchingLine(x.line, diameters(x), least_bending(x), x.tension_scale, grows)


def crossed(touching: Touching, first: NetworkState, last: NetworkState) -> Iterator[tuple[int, int]]:
    """Numbers of lines, two each, of which one passes through the other on the straight way between two shapes."""
    for j, a in enumerate(touching.lines):
        for k, b in enumerate(touching.lines[j + 1 :], j + 1):
            if not touching.meets[j, k]:
                continue
            ways = [np.stack(_of_as_many_nodes(first.lines[m].r, last.lines[m].r)) for m in (a, b)]
            lows, highs = ([f(w, axis=(0, 1)) for w in ways] for f in (np.min, np.max))
            if (np.maximum(*lows) > np.minimum(*highs)).any():
                continue
            if jumps(*ways) > JUMP:
                yield a, b


def _of_as_many_nodes(a: Floats, b: Floats) -> list[Floats]:
    """Two shapes of a line, (n, 3) m; where its cells have changed between them at equal parts of their lengths."""
    if a.shape == b.shape:
        return [a, b]
    parts, shapes = np.linspace(0.0, 1.0, max(len(a), len(b))), []
    for r in (a, b):
        s = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(r, axis=0), axis=1)))
        shapes.append(np.column_stack([np.interp(parts * s[-1], s, x) for x in r.T]))
    return shapes


def pair_text(shared: SharedContact, model: NetworkModel) -> str:
    """Which two lines, or a line and itself, are nearest of what was looked at last, and where."""
    a, i, b, j, distance = shared.deepest_pair
    s, other = (float(model.models[k].line.s[n]) for k, n in ((a, i), (b, j)))
    return f"lines {model.names[a]} and {model.names[b]} are {distance:.3g} m apart at s = {s:.4g} and {other:.4g} m"


# --- lines between which no contact is computed -------------------------------------------------------


def watched_pairs(system: Network, model: NetworkModel) -> list[tuple[int, int]]:
    """Numbers of lines, two each, that have diameters, and between which no contact is computed."""
    thick = [k for k, x in enumerate(model.models) if (diameters(x) > 0.0).all()]
    touching = model.touching
    return [(a, b) for a, b in combinations(thick, 2) if touching is None or b not in touching.partners(a)]


def _joined_by_place(system: Network, width: float) -> NDArray[np.int64]:
    """As joined_ends_of, but what is held or moved is one thing only where it is one place at first.

    width: m, the largest diameter.
    """
    joined = joined_ends_of(system)
    held = np.argwhere(joined == 0)
    lines = list(system.lines.values())
    at = np.array([system.first_place((lines[k].start, lines[k].end)[end]) for k, end in held]).reshape(-1, 3)
    first = 1 + int(joined.max(initial=0))
    for row, place in zip(held, at, strict=True):  # the number of the first that is there
        beside = np.linalg.norm(at - place, axis=1) <= OUTER * width
        joined[tuple(row)] = first + int(beside.argmax())
    return joined


class LinesWatch:
    """What looks after every step whether two of such lines have met, or are near."""

    def __init__(
        self, system: Network, model: NetworkModel, met: set[tuple[int, int]], clock: Clock,
        alone: Collection[tuple[int, int]] = (),
    ) -> None:  # fmt: skip
        """met: lines of which it is known; clock: of the run; alone: lines that may meet, but are let pass."""
        may = set(combinations(model.may_meet, 2)) - set(alone)
        rows = [(*x, MET * (x in met), x in may, 0) for x in watched_pairs(system, model)]
        self._pairs = np.array(rows, np.int64).reshape(-1, WATCHED)
        self._room = np.zeros((len(self._pairs), ROOM))
        width = [diameters(x) for x in model.models]
        begins = np.concatenate([[0], np.cumsum([x.size for x in width])[:-1]]).astype(np.int64)
        widest = max((float(x.max()) for x in width), default=0.0)
        self.joined = _joined_by_place(system, widest)
        self._bound = {
            "joined": self.joined, "begins": begins, "width": np.concatenate(width),
            "clock": clock, "pairs": self._pairs, "room": self._room, "moved": np.zeros((len(width), MOVED)),
        }  # fmt: skip
        self._jobs = Table(blank_lines_job), Table(blank_lines_job)

    @property
    def is_needed(self) -> bool:
        """Whether there is anything that may still meet."""
        return bool((self._pairs[:, HAVE_MET] != MET).any())

    def attach(self, tables: NDArray[np.int64]) -> tuple[np.ndarray, np.ndarray, int]:
        """Tables for both parities and the address of the kernel; tables: (2, L, ..) jobs of the lines."""
        for job, numbers in zip(self._jobs, tables, strict=True):
            job.bind(tables=numbers, **self._bound)
        even, odd = self._jobs
        return even.numbers, odd.numbers, watch_lines.address(even.numbers)

    def begin(self, system: Network) -> set[tuple[int, int]]:
        """Look at the start, to which the jobs of even parity lead; lines that meet at a point or body and lie in each

        other there, by a narrow angle, are returned: of these nothing is said.
        """
        watch_lines(self._jobs[0].numbers)
        lines = list(system.lines.values())
        ends = [{system.body_of(p) or p for p in (x.start, x.end)} for x in lines]
        return {(a, b) for a, b, *_ in self.met() if any(x is y or x == y for x in ends[a] for y in ends[b])}

    def met(self) -> list[tuple[int, int, float, float, float]]:
        """Lines that have met, two each: numbers, when (s), and at which arc lengths (m)."""
        return [
            (int(a), int(b), float(row[TIME]), float(row[AT]), float(row[OTHER]))
            for (a, b, has, *_), row in zip(self._pairs, self._room, strict=True)
            if has == MET
        ]

    def near(self) -> list[tuple[int, int, float, float]]:
        """Lines that are near each other, and contact begins, two each: numbers, and at which arc lengths (m)."""
        return [
            (int(a), int(b), float(row[AT]), float(row[OTHER]))
            for (a, b, has, *_), row in zip(self._pairs, self._room, strict=True)
            if has == NEAR
        ]
