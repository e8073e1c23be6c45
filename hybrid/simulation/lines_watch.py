"""Lines of a system between which no contact is computed: whether they overlap, or come near, where contact begins."""

from __future__ import annotations

from collections.abc import Collection
from itertools import combinations
from typing import TYPE_CHECKING

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
from hybrid.model.lines_contact import joined_ends_of
from hybrid.model.system import SystemModel
from hybrid.scene.system import System
from hybrid.simulation.self_watch import diameters

if TYPE_CHECKING:
    from hybrid.simulation.system_run import SystemRun

# Diameters by which ways from a joint to where lines that lie along each other meet differ at most.
ALONG = 2.0

PASSED = "lines pass through each other"  # kind of an event


def watched_pairs(system: System, model: SystemModel) -> list[tuple[int, int]]:
    """Numbers of lines, two each, that have diameters, and between which no contact is computed."""
    thick = [k for k, x in enumerate(model.models) if (diameters(x) > 0.0).all()]
    touching = model.touching
    return [(a, b) for a, b in combinations(thick, 2) if touching is None or b not in touching.partners(a)]


def _joined_by_place(system: System, width: float) -> NDArray[np.int64]:
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
        self, system: System, model: SystemModel, met: set[tuple[int, int]], clock: Clock,
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

    def begin(self, system: System) -> set[tuple[int, int]]:
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


def _side_by_side(run: SystemRun, joined: NDArray[np.int64], a: int, b: int, s: float, other: float) -> bool:
    """Whether two lines that met at s and other (m) of them lay along each other all the way from a common joint.

    They did where both places are as far from it along the lines, and one of the lines is straight up to there.
    """
    width = max(float(diameters(run.model.models[k]).max()) for k in (a, b))
    for m, k in ((m, k) for m in (0, -1) for k in (0, -1) if joined[a, m] == joined[b, k]):
        ways, bows = [], []
        for line, at, tip in ((a, s, m), (b, other, k)):
            nodes, r = run.model.models[line].line.s, run.state.lines[line].r
            place = [np.interp(at, nodes, r[:, j]) for j in range(3)]
            ways.append(abs(at - float(nodes[tip])))
            bows.append(ways[-1] - float(np.linalg.norm(place - r[tip])))
        if abs(ways[0] - ways[1]) < ALONG * width and min(bows) < width:
            return True
    return False


def tell_passages(run: SystemRun) -> None:
    """An event for every two lines that have met without contact, when they do first.

    Of lines that lie along each other from what both are joined to there is nothing to tell, as at the start.
    """
    if (watch := run.watch) is None:
        return
    for a, b, t, s, other in sorted(watch.met(), key=lambda x: x[2]):
        if (a, b) in run.passed:
            continue
        run.passed.add((a, b))
        if _side_by_side(run, watch.joined, a, b, s, other):
            continue
        one, two = run.model.names[a], run.model.names[b]
        text = (
            f"lines {one} and {two} pass through each other: no contact between them is computed, and at s = {s:.4g} m "
            f"of {one} and s = {other:.4g} m of {two} their centrelines are nearer than the mean of their diameters; "
            f"contact: {{between: [[{one}, {two}]]}} keeps them apart"
        )
        run.recorder.event(t, 0.0, 0.0, PASSED, text)
