"""Results of the cases of a design, equilibria and motions, and what they answer to unknowns.

Where a search asks for slopes of a motion they are tangents along the steps of a run or, where these are not known,
forward differences of runs in its steps, cells and zones; else those of the run before, corrected by what results
changed by on the way (secants, after Broyden), so that a step takes a run of each case.  Of an extreme its other peaks
are known as well, so that a search sees which of them would be the largest.  Results of a case that a search does not
need are what the last run of it foretells.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from hybrid.designs.in_motion import DIFFERENCES, TANGENTS, Motion, followed, size_of
from hybrid.designs.network_at_rest import NO_PLACES, NetworkAtRest, Places, at_rest
from hybrid.designs.numbers_and_results import at_end, number_of, parse_wanted, scene_with
from hybrid.designs.replay import Course, course_of
from hybrid.designs.tangents import Unfollowed, has_two_sides, step_of
from hybrid.errors import ComputationError, Outcome
from hybrid.kernels.state.state import Floats
from hybrid.scene.root import Scene

# Behind the name of a result of a motion; part of a number by which runs differ: off by as much, round-off is 1e-8.
IN_MOTION, PART = " in motion", 1e-4
FINER_RUN = 4  # runs' worth of one with cells and steps half as long
TANGENT = 0.5  # and of tangents of one number (bench/test_bench_tangents.py: of eight each 0.40 to 0.54, also in waves)


class Peaks(NamedTuple):
    """The value of a result, or of an extreme all its peaks, the largest first.

    where: when and where each is; values (m,), slopes (m, n); least: whether the least is asked for.
    """

    where: tuple[Any, ...]
    values: Floats
    slopes: Floats
    least: bool

    def moved(self, step: Floats) -> Peaks:
        """As they are foretold to be after a step of unknowns."""
        values = self.values + self.slopes @ step
        order = np.argsort(values if self.least else -values, kind="stable")
        return Peaks(tuple(self.where[k] for k in order), values[order], self.slopes[order], self.least)

    def foretold(self, where: Any, step: Floats) -> float:
        """The value of that which is next to a place and time, after a step."""
        k = self.nearest_to(where)
        return float(self.values[k] + self.slopes[k] @ step)

    def nearest_to(self, where: Any) -> int:
        """Which of them is at, or next to, another place and time."""
        if where is None:
            return 0
        return min(range(len(self.where)), key=lambda k: math.dist(self.where[k], where))


class OfMotion:
    """Runs with the same values of unknowns of cases, and results: of those that were run, and of others foretold.

    peaks: by case of its rows in turn; none where nobody has asked yet; fresh: cases whose slopes are not secants.
    """

    def __init__(self, x: Floats, runs: Mapping[str, Motion]) -> None:
        self.x, self.runs = x, dict(runs)
        self.peaks: dict[str, list[Peaks]] = {}
        self.fresh: set[str] = set()


class Motions:
    """Computes runs, and counts them."""

    def __init__(
        self,
        scenes: Mapping[str, Any],
        keys: Sequence[tuple[str, ...]],
        wanted: Sequence[tuple[str, str]],
        scene_of: Callable[[str, Floats], Any],
    ) -> None:
        """wanted: case and result of every row; scene_of: of a case with values of unknowns.

        SceneError: a result that no run has.
        """
        self._scenes, self._keys, self._scene_of = scenes, keys, scene_of
        moving = [k for k, (_, result) in enumerate(wanted) if result.endswith(IN_MOTION)]
        self.rows = {case: np.array([k for k in moving if wanted[k][0] == case], int) for case in scenes}
        self.rows = {case: rows for case, rows in self.rows.items() if rows.size}
        self._of = {
            case: [parse_wanted(scenes[case], wanted[k][1].removesuffix(IN_MOTION), moves=True) for k in rows]
            for case, rows in self.rows.items()
        }
        self.place = {int(k): (case, i) for case, rows in self.rows.items() for i, k in enumerate(rows)}
        self.count = 0.0
        self._courses: dict[str, Course] = {}
        self._last: dict[str, tuple[Floats, list[Peaks]]] = {}  # of each case the last run whose slopes were asked for
        self.ways: dict[str, str] = {}  # by case that has slopes, how these are found

    def runs_of(self, x: Floats, finer: bool = False, cases: Iterable[str] | None = None) -> OfMotion:
        """Runs with values (n,) of unknowns; cases: of which; others are foretold; None: of all."""
        point = OfMotion(x.copy(), {})
        self.run(point, self.rows if cases is None else cases, finer)
        return point

    def run(self, point: OfMotion, cases: Iterable[str], finer: bool = False) -> bool:
        """Run cases that were not, the first time with tangents; False: there are none."""
        wanted = [case for case in self.rows if case in set(cases) and case not in point.runs]
        for case in wanted:
            if case not in self._last and not finer and self._with_tangents(point, case):
                continue
            self.count += FINER_RUN if finer else 1
            scene = self._scene_of(case, point.x)
            if case not in self._courses:
                self._courses[case] = course_of(scene)
            point.runs[case] = Motion(scene, self._of[case], self._courses[case], finer=finer, smooth=True)
            point.peaks.pop(case, None)
        return bool(wanted)

    def values(self, point: OfMotion, values: Floats) -> None:
        """Put results into their rows."""
        for case, rows in self.rows.items():
            if case in point.runs:
                values[rows] = point.runs[case].values
            else:
                values[rows] = [x.values[0] for x in self._foretold(point, case)]

    def at_peaks(self, point: OfMotion, case: str, k: int, peaks: Peaks) -> Floats:
        """Values (m,) of the result k of a case at places and times of peaks of another run.

        Of a case that was not run those that are foretold of these.
        """
        if case in point.runs:
            return point.runs[case].at_peaks([self._of[case][k]], [peaks.where])
        x, last = self._last[case]
        return np.array([last[k].foretold(where, point.x - x) for where in peaks.where])

    def changed(self, x: Floats, size: int) -> Floats:
        """(size,) by how much results are foretold to change from the last run of each case, in their rows."""
        out = np.zeros(size)
        for case, rows in self.rows.items():
            x_last, last = self._last[case]
            out[rows] = [peaks.moved(x - x_last).values[0] - peaks.values[0] for peaks in last]
        return out

    def peaks(self, point: OfMotion, sizes: Floats) -> Mapping[str, list[Peaks]]:
        """Of every case: secants, but where slopes were taken anew; these at the first."""
        new = {case for case in point.runs if case not in self._last}
        self.refresh(point, new)
        for case in self.rows:
            if case not in point.runs:
                point.peaks.setdefault(case, self._foretold(point, case))
                continue
            if case not in point.peaks:
                point.peaks[case] = self._secants(point, case, sizes)
            self._last[case] = point.x, point.peaks[case]
        return point.peaks

    def _foretold(self, point: OfMotion, case: str) -> list[Peaks]:
        x, last = self._last[case]
        return [peaks.moved(point.x - x) for peaks in last]

    def _secants(self, point: OfMotion, case: str, sizes: Floats) -> list[Peaks]:
        """Slopes of the last run, of that of its peaks that is next to each."""
        run, (x, last) = point.runs[case], self._last[case]
        change = point.x - x
        step = change / sizes
        size, out, values = float(step @ step), [], iter(run.at_peaks(self._of[case], run.peaks))
        for where, before in zip(run.peaks, last, strict=True):
            found, slopes = [], []
            for place in where:
                k, value = before.nearest_to(place), float(next(values))
                slope = before.slopes[k]
                if size > 0.0:
                    slope = slope + (value - before.values[k] - slope @ change) / size * step / sizes
                found.append(value)
                slopes.append(slope)
            out.append(Peaks(tuple(where), np.array(found), np.array(slopes), before.least))
        return out

    def refresh(self, point: OfMotion, cases: Iterable[str]) -> bool:
        """Take tangents, or differences of runs beside those of a point, in these cases; False: there are, already."""
        wanted = (set(cases) & set(self.rows)) - point.fresh
        for case in sorted(wanted):
            if not self._with_tangents(point, case):
                self.run(point, {case})
                columns = [self._difference(point, case, i) for i in range(point.x.size)]
                self._keep_slopes(point, case, np.stack(columns, axis=1))
        return bool(wanted)

    def _keep_slopes(self, point: OfMotion, case: str, slopes: Floats) -> None:
        """Keep slopes (W, n) of all peaks of the results of a case that was run."""
        run, first, out = point.runs[case], 0, []
        values = run.at_peaks(self._of[case], run.peaks)
        for x, where in zip(self._of[case], run.peaks, strict=True):
            rows = slice(first, first + len(where))
            out.append(Peaks(tuple(where), values[rows], slopes[rows], x.over == "min"))
            first += len(where)
        point.peaks[case] = out
        point.fresh.add(case)

    def _with_tangents(self, point: OfMotion, case: str) -> bool:
        """Run a case with tangents along its steps; False: these are not known of it."""
        if self.ways.get(case, TANGENTS) != TANGENTS:
            return False
        try:
            self._keep_slopes(point, case, self._tangents(point, case))
        except Unfollowed as why:
            self.ways[case] = f"{DIFFERENCES}: {why}"
            return False
        self.ways[case] = TANGENTS
        return True

    def _size(self, point: OfMotion, case: str, i: int) -> float:
        scene, key = self._scenes[case], self._keys[i][0]
        return size_of(scene, key, float(point.x[i]) or number_of(scene, key))

    def _tangents(self, point: OfMotion, case: str) -> Floats:
        """Slopes (W, n) of a run that is made with tangents along its steps; Unfollowed: these are not known of it."""
        scene = self._scene_of(case, point.x)
        if case not in self._courses:
            self._courses[case] = course_of(scene)
        each = range(point.x.size)
        steps = [min(step_of(key, self._size(point, case, i)) for key in self._keys[i]) for i in each]

        def other(i: int, d: float) -> Any:
            return self._scene_of(case, point.x + d * (np.arange(point.x.size) == i))

        pairs = [
            (other(i, h), other(i, -h) if has_two_sides(self._keys[i], float(point.x[i])) else None)
            for i, h in zip(each, steps, strict=True)
        ]
        run, slopes, _ = followed(scene, self._of[case], self._courses[case], pairs, steps, smooth=True)
        self.count += 1 + TANGENT * point.x.size
        point.runs[case] = run
        return slopes.T

    def _difference(self, point: OfMotion, case: str, i: int) -> Floats:
        """Change of results of a case by one unknown; ComputationError: no run beside goes as this one does."""
        d, wanted = PART * self._size(point, case, i), self._of[case]
        base, failed = point.runs[case], None
        for step in (d, -d):
            beside = point.x + step * (np.arange(point.x.size) == i)
            self.count += 1
            try:
                run = Motion(self._scene_of(case, beside), wanted, base.course, base, smooth=True)
                run.check(base, self._keys[i][0])
            except ComputationError as error:
                failed = error
                continue
            change = run.at_peaks(wanted, base.peaks) - base.at_peaks(wanted, base.peaks)
            return np.asarray(change / step)
        assert failed is not None
        raise failed


AnyScene = Scene
FINER = 0.5  # length of cells of the equilibria that check what was found, over that of others
# Part by which unknowns that are alike are told apart: between sections that are alike there need be no node.
APART = 1e-12


class Point:
    """Equilibria and runs of all cases with the same values of unknowns: results (R,), what they answer to unknowns.

    rests: none of a case whose motion alone is asked.
    """

    def __init__(self, x: Floats, rests: Mapping[str, NetworkAtRest], motion: OfMotion, equilibria: Equilibria) -> None:
        self.x, self.rests, self._motion, self._of = x, rests, motion, equilibria
        self.values = np.zeros(len(equilibria.wanted))
        for case, rest in rests.items():
            self.values[equilibria.rows[case]] = rest.values
        self._slopes: Floats | None = None
        self._read_motions()

    @property
    def slopes(self) -> Floats:
        """(R, n) derivatives of results by unknowns."""
        if self._slopes is None:
            self._slopes = np.zeros((self.values.size, self.x.size))
            keys = [key for group in self._of.keys for key in group]
            owner = np.repeat(np.arange(self.x.size), [len(group) for group in self._of.keys])
            for case, rows in self._of.rows.items():
                if rows.size:
                    by_key = self.rests[case].by(keys).T
                    np.add.at(self._slopes, (rows[:, None], owner[None, :]), by_key)
            for case, rows in self._of.motions.rows.items():
                self._slopes[rows] += [x.slopes[0] for x in self._motions[case]]
        return self._slopes

    @property
    def _motions(self) -> Mapping[str, list[Peaks]]:
        return self._of.motions.peaks(self._motion, np.where(self.x == 0.0, 1.0, np.abs(self.x)))

    def peaks(self, row: int) -> Peaks | None:
        """The peaks of an extreme over time, of other results of motions their value; None: it is of an equilibrium."""
        if row not in self._of.motions.place:
            return None
        case, k = self._of.motions.place[row]
        return self._motions[case][k]

    def at_peaks(self, row: int, peaks: Peaks) -> Floats:
        """Values (m,) of a result at places and times of the peaks of another point, but the first: its own extreme."""
        case, k = self._of.motions.place[row]
        values = self._of.motions.at_peaks(self._motion, case, k, peaks)
        values[0] = self.values[row]
        return values

    def foretold(self, x: Floats) -> Floats:
        """Results (R,) by slopes with other values of unknowns."""
        values = self.values + self.slopes @ (x - self.x)
        for case, rows in self._of.motions.rows.items():
            values[rows] = [each.moved(x - self.x).values[0] for each in self._motions[case]]
        return np.asarray(values)

    def _read_motions(self) -> None:
        self._of.motions.values(self._motion, self.values)
        self._of.check(self)
        self._slopes = None

    def complete(self, cases: Iterable[str] | None = None) -> bool:
        """Run cases that were foretold; None: all; False: none of them were."""
        motions = self._of.motions
        if not motions.run(self._motion, motions.rows if cases is None else cases):
            return False
        self._read_motions()
        return True

    def refresh(self, cases: set[str]) -> bool:
        """Make slopes of motions in these cases those of runs beside; False: they are."""
        if not self._of.motions.refresh(self._motion, cases):
            return False
        self._read_motions()
        return True

    def nodes(self, case: str, name: str) -> Floats:
        """Arc lengths (N+1,) of the nodes of a line, m."""
        rest = self.rests[case]
        return rest.lines[list(rest.scene.asked_lines).index(name)].model.line.s

    def shapes(self) -> dict[str, dict[str, Floats]]:
        """Places (N+1, 3) of the nodes of every line, m, by case; "" is the name of a line that is alone.

        Of a case whose motion alone is asked those of its output points where it begins.
        """
        begins = {case: run.begin for case, run in self._motion.runs.items()}
        return {case: self.rests[case].shapes if case in self.rests else begins[case] for case in self._of.scenes}


class Equilibria:
    """Computes equilibria and runs, and counts them."""

    def __init__(
        self, scenes: Mapping[str, AnyScene], keys: Sequence[tuple[str, ...]], wanted: Sequence[tuple[str, str]]
    ) -> None:
        """scenes: by case; keys: of each unknown; wanted: case and result, such as `tension@end`, in any order."""
        self.scenes, self.keys, self.wanted = dict(scenes), list(keys), list(wanted)
        resting = [k for k, (_, result) in enumerate(wanted) if not result.endswith(IN_MOTION)]
        self.rows = {case: np.array([k for k in resting if wanted[k][0] == case], int) for case in scenes}
        self.motions = Motions(self.scenes, self.keys, self.wanted, self.scene)
        self.count = 0
        self._kept: dict[bytes, Point] = {}
        self._places: dict[str, Places] = {}  # cells of the first: others would make results jump

    def point_of(self, x: Floats, cells: float = 1.0, moving: Iterable[str] | None = None) -> Point:
        """Equilibria with values (n,) of unknowns.

        cells: how many times as long as usual; moving: cases to run, others are foretold (`Motions.runs_of`);
        None: all.
        SceneError: a scene may not have these; ComputationError: there is no equilibrium, or a result is not there in
        it, such as `touchdown` of a line that does not lie on the bed.
        """
        kept = self._kept.get(x.tobytes()) if cells == 1.0 else None
        if kept is not None:
            kept.complete(moving)
            return kept
        rests = {}
        for case in self.scenes:
            if case in self.motions.rows and not self.rows[case].size:
                continue
            self.count += 1
            of = [at_end(self.scenes[case], self.wanted[k][1]) for k in self.rows[case]]
            rests[case] = at_rest(self.scene(case, x), of, cells, self._places.get(case, NO_PLACES))
            self._places.setdefault(case, rests[case].places)
        point = Point(x.copy(), rests, self.motions.runs_of(x, cells < 1.0, moving), self)
        if cells == 1.0:
            first = [*self._kept.items()][:1]  # where a search began is asked for once more at its end
            self._kept = dict(first + [*self._kept.items()][1:][-1:]) | {x.tobytes(): point}
        return point

    def check(self, point: Point) -> None:
        """ComputationError: a result that has no value."""
        for k in np.flatnonzero(~np.isfinite(point.values))[:1]:
            case, result = self.wanted[k]
            given = ", ".join(f"{group[0]} = {value:.6g}" for group, value in zip(self.keys, point.x, strict=True))
            detail = f"{result}{f' ({case})' if case else ''} has no value in the equilibrium with {given}"
            raise ComputationError(Outcome.NOT_REACHED, None, None, detail)

    def scene(self, case: str, x: Floats) -> Any:
        """The scene of a case with values of unknowns; SceneError: it may not have these."""
        return scene_with(self.scenes[case], self.keys, x * (1.0 + APART * np.arange(x.size)))
