"""Results of equilibria and motions by unknowns, of one scene or of the cases of a design."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from hybrid.designs.motions import IN_MOTION, Motions, OfMotion, Peaks
from hybrid.designs.network_at_rest import NO_PLACES, NetworkAtRest, Places
from hybrid.designs.numbers import scene_with
from hybrid.designs.sensitivity import at_rest
from hybrid.errors import ComputationError, Outcome
from hybrid.kernels.state.state import Floats
from hybrid.scene.root import Scene

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
            of = [self.wanted[k][1] for k in self.rows[case]]
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
