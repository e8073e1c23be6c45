"""Results of motions of the cases of a design, and what they answer to unknowns.

Slopes are forward differences of runs in the steps, cells and zones of the one between them where a search asks for
that, and else those of the point before, corrected by what results changed by on the way (secants, after Broyden): a
step then takes one run of each case, in place of one more for each unknown.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from hybrid.designs.in_motion import Motion, parse_history, size_of
from hybrid.designs.numbers import number_of
from hybrid.designs.replay import Course, course_of
from hybrid.errors import ComputationError
from hybrid.kernels.state.state import Floats

# Behind the name of a result of a motion; part of a number by which runs differ: off by as much, round-off is 1e-8.
IN_MOTION, PART = " in motion", 1e-4
FINER_RUN = 4  # runs' worth of one with cells and steps half as long


class OfMotion:
    """Runs of all cases with the same values of unknowns.

    slopes: (R, n); None: nobody has asked yet; fresh: cases whose slopes are differences.
    """

    def __init__(self, x: Floats, runs: Mapping[str, Motion]) -> None:
        self.x, self.runs = x, dict(runs)
        self.slopes: Floats | None = None
        self.fresh: set[str] = set()


class Motions:
    """Computes runs, and counts them."""

    def __init__(
        self, scenes: Mapping[str, Any], keys: Sequence[tuple[str, ...]], wanted: Sequence[tuple[str, str]],
        scene_of: Callable[[str, Floats], Any],
    ) -> None:  # fmt: skip
        """wanted: case and result of every row; scene_of: of a case with values of unknowns.

        SceneError: a result that no run has.
        """
        self._scenes, self._keys, self._scene_of = scenes, keys, scene_of
        moving = [k for k, (_, result) in enumerate(wanted) if result.endswith(IN_MOTION)]
        self.rows = {case: np.array([k for k in moving if wanted[k][0] == case], int) for case in scenes}
        self.rows = {case: rows for case, rows in self.rows.items() if rows.size}
        self._of = {
            case: [parse_history(scenes[case], wanted[k][1].removesuffix(IN_MOTION)) for k in rows]
            for case, rows in self.rows.items()
        }
        self._size, self.count = len(wanted), 0
        self._courses: dict[str, Course] = {}
        self._last: OfMotion | None = None  # whose slopes were asked for last

    def at(self, x: Floats, finer: bool = False) -> OfMotion:
        """Runs with values (n,) of unknowns."""
        runs = {}
        for case in self.rows:
            self.count += FINER_RUN if finer else 1
            scene = self._scene_of(case, x)
            if case not in self._courses:
                self._courses[case] = course_of(scene)
            runs[case] = Motion(scene, self._of[case], self._courses[case], finer=finer, smooth=True)
        return OfMotion(x.copy(), runs)

    def values(self, point: OfMotion, values: Floats) -> None:
        """Put results into their rows."""
        for case, rows in self.rows.items():
            values[rows] = point.runs[case].values

    def slopes(self, point: OfMotion, sizes: Floats) -> Floats:
        """(R, n): those of the point before, corrected by what has changed since; differences at the first."""
        if point.slopes is None:
            last = self._last
            if last is None or last.slopes is None:
                self.refresh(point, set(self.rows))
            else:
                point.slopes, step = last.slopes.copy(), (point.x - last.x) / sizes
                size = float(step @ step)
                for case, rows in self.rows.items():
                    if size > 0.0:
                        off = point.runs[case].values - last.runs[case].values - last.slopes[rows] @ (point.x - last.x)
                        point.slopes[rows] += np.outer(off, step / sizes) / size
            self._last = point
        assert point.slopes is not None
        return point.slopes

    def refresh(self, point: OfMotion, cases: set[str]) -> bool:
        """Take differences of runs beside those of a point in these cases; False: there are, already."""
        wanted = (cases & set(self.rows)) - point.fresh
        if not wanted:
            return False
        if point.slopes is None:
            point.slopes = np.zeros((self._size, point.x.size))
        for case in sorted(wanted):
            for i in range(point.x.size):
                point.slopes[self.rows[case], i] = self._difference(point, case, i)
        point.fresh |= wanted
        return True

    def _difference(self, point: OfMotion, case: str, i: int) -> Floats:
        """Change of results of a case by one unknown; ComputationError: no run beside goes as this one does."""
        scene, key = self._scenes[case], self._keys[i][0]
        d = PART * size_of(scene, key, float(point.x[i]) or number_of(scene, key))
        base, failed = point.runs[case], None
        for step in (d, -d):
            beside = point.x + step * (np.arange(point.x.size) == i)
            self.count += 1
            try:
                run = Motion(self._scene_of(case, beside), self._of[case], base.course, base, smooth=True)
                run.check(base, key)
            except ComputationError as error:
                failed = error
                continue
            return np.asarray((run.values - base.values) / step)
        assert failed is not None
        raise failed
