"""Lines beside each other: their contact, whether they cross between two shapes, a watch over those without contact."""

from __future__ import annotations

import math
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
from hybrid.scene.network import Network
from hybrid.simulation.self_watch import diameters, least_bending
from hybrid.solve.joined import NetworkState
from hybrid.solve.shared_contact import SharedContact, TouchingLine

PASSED = "lines pass through each other"  # kind of an event
# Parts of a straight way between two shapes, and by how much the Gauss integral of two lines jumps where one passes
# through the other: by 1, and by far less in a part of a way on which none does.
PARTS, JUMP = 48, 0.5
FLAT = 1e-9  # volume, over the lengths, of chords that lie in one plane but for round-off, as neighbours do


def shared_of(model: NetworkModel, rubs: bool = False) -> SharedContact | None:
    """Contact of the lines of a model with each other, with friction or without; None: they have none."""
    if model.touching is None:
        return None
    return SharedContact(model.touching, [strand_in(model.models[k]) for k in model.touching.lines], rubs)


def strand_in(x: Model) -> TouchingLine:
    """What contact takes of the line of a model."""
    grows = 0.0 if x.payout is None else float(np.diff(x.payout.nodes).max())
    return TouchingLine(x.line, diameters(x), least_bending(x), x.tension_scale, grows)


def gauss_integral(a: Floats, b: Floats) -> float:
    """Gauss integral of two polylines (n, 3) m and (m, 3) m: half the sum of their signed crossings over all views."""
    p, q = a[:-1, None], a[1:, None]
    r, s = b[None, :-1], b[None, 1:]
    pr, ps, qr, qs = (y - x for x, y in ((p, r), (p, s), (q, r), (q, s)))
    normals = [np.cross(x, y) for x, y in ((pr, ps), (ps, qs), (qs, qr), (qr, pr))]
    n = [x / np.maximum(np.linalg.norm(x, axis=-1, keepdims=True), 1e-300) for x in normals]
    angles = [np.arcsin(np.clip(np.einsum("ijk,ijk->ij", n[i], n[(i + 1) % 4]), -1.0, 1.0)) for i in range(4)]
    volume = np.einsum("ijk,ijk->ij", np.cross(s - r, q - p), pr)
    largest = np.prod([np.linalg.norm(x, axis=-1) for x in np.broadcast_arrays(s - r, q - p, pr)], axis=0)
    side = np.where(np.abs(volume) > FLAT * largest, np.sign(volume), 0.0)
    return float((side * sum(angles)).sum() / (4.0 * math.pi))


def jumps(a: Floats, b: Floats) -> float:
    """Largest jump of the Gauss integral of two polylines on their straight ways.

    a (2, n, 3), b (2, m, 3): m, first and last nodes of each.
    """
    parts = np.linspace(0.0, 1.0, PARTS + 1)
    found = [gauss_integral((1.0 - x) * a[0] + x * a[1], (1.0 - x) * b[0] + x * b[1]) for x in parts]
    return float(np.abs(np.diff(found)).max())


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
        """Check the start, to which the jobs of even parity lead.

        Returns lines that meet at a point or body and lie in each other there, by a narrow angle: these are not
        reported.
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
