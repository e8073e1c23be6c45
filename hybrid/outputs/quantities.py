"""Quantities that a scene asks for by name, and the use of sections.

Of a batch of states: angles and forces at ends, layback, clearance; stress of pipes (docs/theory.md), and the parts
that are used of capacities and codes.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from functools import partial
from itertools import chain, pairwise
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np

from hybrid.kernels.state.books import Books
from hybrid.kernels.state.state import Floats
from hybrid.kernels.watch import named_quantities as k
from hybrid.model.payout import whole_scene
from hybrid.model.sections import bending_stiffness, outer_diameter, sleeves
from hybrid.outputs.observation import Observation, Probe
from hybrid.store.capacity import CLAUSES, E301, F201, Row, moment_of
from hybrid.store.capacity import CODE_NAME as CODE_USED
from hybrid.store.capacity import NAME as CAPACITY_USED
from hybrid.store.capacity import use as code_used
from hybrid.store.capacity import used as capacity_used
from hybrid.store.format import Field
from hybrid.store.limits import EXTREMES

if TYPE_CHECKING:
    from hybrid.scene.cable import Section
    from hybrid.scene.quantities import Quantity
    from hybrid.scene.schema import LineScene


class OfSections:
    """The sections of one line, and which of them points are of."""

    def __init__(self, scene: LineScene) -> None:
        whole, begin = whole_scene(scene)
        self.sections = whole.cable.sections
        lengths = np.array([x.length for x in self.sections])
        self.ends = begin + np.cumsum(lengths)
        self.begins, self._near = np.concatenate([[begin], self.ends[:-1]]), 1e-9 * lengths.sum()
        fluid = scene.environment.fluid
        self.gravity = scene.environment.gravity
        self.water = fluid.density * self.gravity if fluid is not None else 0.0
        self.surface = 0.0 if fluid is None or fluid.surface is None else fluid.surface

    def numbers(self, s: Floats, after: bool) -> np.ndarray:
        """Numbers of the sections at arc lengths s (m), after or before where sections meet."""
        return np.searchsorted(self.ends[:-1], s + (self._near if after else -self._near))


class Pipes(OfSections):
    """The pipes of one line.  Only for a scene that has some."""

    def __init__(self, scene: LineScene) -> None:
        super().__init__(scene)
        self.rows = np.zeros((len(self.sections), k.WALL))  # of kernels.watch.named_quantities
        self.rows[:, k.SECTION_END] = self.ends
        self.rows[:, k.WATER], self.rows[:, k.SURFACE] = self.water, self.surface
        for row, x in zip(self.rows, self.sections, strict=True):
            row[k.OUTER] = x.diameter or 0.0
            if (p := x.pipe) is not None:
                row[k.OUTER] = p.outer_diameter or x.diameter or np.nan
                row[k.INNER], row[k.MODULUS] = row[k.OUTER] - 2.0 * p.wall, p.modulus
                row[k.INSIDE], row[k.INSIDE_Z] = p.pressure, self.surface if p.pressure_z is None else p.pressure_z
                row[k.CONTENT] = p.content_density * self.gravity
                row[k.NATURAL] = np.hypot(*(x.intrinsic_curvature or (0.0, 0.0))[:2])
        limits = [x.pipe.max_stress if x.pipe is not None else None for x in self.sections]
        self.limits = np.array([np.nan if x is None else x for x in limits], float)

    def probes(self) -> dict[str, Probe]:
        """Probes by name."""
        text = "tension in the wall: tension, plus pressure inside on the bore, less pressure outside on the pipe"
        stress = "largest von Mises stress in the wall of a pipe; NaN: no pipe"
        return {
            "wall_tension": Probe("N", text, ("s",), self.wall_tension),
            "von_mises": Probe("Pa", stress, ("s",), self.von_mises),
        }

    def largest_allowed(self, s: Floats, after: bool) -> Floats:
        """Largest stress (ns,) Pa allowed at arc lengths s (m), after or before where sections meet; NaN: any."""
        return self.limits[self.numbers(s, after)]

    def gains(self, s: Floats, after: bool) -> tuple[Floats, Floats]:
        """By how much a stress rises at most with tension (ns,) 1/m2 and with curvature (ns,) Pa m, likewise."""
        rows = self.rows[self.numbers(s, after)]
        outer, modulus = rows[:, k.OUTER], np.where(rows[:, k.MODULUS] > 0.0, rows[:, k.MODULUS], np.nan)
        area = np.where(np.isnan(modulus), np.nan, 0.25 * np.pi * (outer**2 - rows[:, k.INNER] ** 2))
        return 1.0 / area, 0.5 * modulus * outer

    def has_wall(self, s: Floats) -> np.ndarray:
        """(ns,) bool, whether the sections at arc lengths s (m), away from where they meet, are pipes."""
        return np.asarray(self.rows[self.numbers(s, True), k.MODULUS] > 0.0)

    def _observed(self, v: Observation, bend: Floats) -> tuple[Floats, Floats]:
        """Wall tension (ns, nb) N and stress (ns, nb) Pa; bend: (5, ns, nb) as of `observe_pipes`."""
        shape = v.tension.shape
        sections = np.broadcast_to(self.numbers(v.grid.points, v.grid.after), shape)
        force, stress = np.empty(shape), np.empty(shape)
        arrays = (np.ascontiguousarray(x) for x in (sections, (v.grid.nodes @ v.r)[:, 2], v.tension, bend))
        k.observe_pipes(self.rows, *arrays, force, stress)
        return force, stress

    def wall_tension(self, v: Observation) -> Floats:
        """(ns, nb) N."""
        return self._observed(v, np.zeros((5, *v.tension.shape)))[0]

    def von_mises(self, v: Observation) -> Floats:
        """(ns, nb) Pa: the largest of the four points where stress is largest, by Lame, bending and torsion."""
        bend = np.zeros((5, *v.tension.shape))
        bend[0], bend[1] = v.curvature_twist[:, 0], v.torque
        if np.any(self.rows[:, k.NATURAL] > 0.0):
            bend[2:] = v.bends_without_natural
        return self._observed(v, bend)[1]


class Capacities(OfSections):
    """The capacity polygons of one line.  Only for a scene that has some."""

    def __init__(self, scene: LineScene) -> None:
        super().__init__(scene)
        self._corners = [None if x.capacity is None else np.array(x.capacity, float) for x in self.sections]

    def probes(self) -> dict[str, Probe]:
        """Probes by name."""
        text = "part of the capacity that tension and curvature use together; NaN: none given"
        return {CAPACITY_USED: Probe("%", text, ("s",), self.used)}

    def used(self, v: Observation) -> Floats:
        """(ns, nb) %."""
        section, curvature = self.numbers(v.grid.points, v.grid.after), v.curvature_twist[:, 0]
        found = np.full(v.tension.shape, np.nan)
        for i, corners in enumerate(self._corners):
            if corners is not None:
                found = np.where(section == i, 100.0 * capacity_used(corners, v.tension, curvature), found)
        return found

    def rows(self) -> Floats:
        """(K, 4): from and to (m), tension (N) and curvature (1/m) of each corner of each section that has any."""
        found = [
            np.column_stack([np.full(len(x), self.begins[i]), np.full(len(x), self.ends[i]), x])
            for i, x in enumerate(self._corners)
            if x is not None
        ]
        return np.concatenate(found)


class Codes(OfSections):
    """The codes of one line.  Only for a scene that has some."""

    def __init__(self, scene: LineScene) -> None:
        super().__init__(scene)
        of = zip(self.sections, self.begins.tolist(), self.ends.tolist(), strict=True)
        self._rows = [self._row(*x) for x in of]
        self._kinds = list(dict.fromkeys(x.code.kind for x in self.sections if x.code is not None))
        self._sleeves = sleeves(scene)

    def _row(self, section: Section, first: float, last: float) -> Row | None:
        code, pipe = section.code, section.pipe
        if code is None:
            return None
        if code.kind == "E301":
            numbers = (code.pretension_factor, code.environment_factor, code.pretension, 0.0, code.strength)
            return Row(first, last, E301, *numbers, *[0.0] * 13)
        assert pipe is not None
        numbers = (
            code.functional_factor,
            code.environment_factor,
            code.functional_tension,
            code.functional_moment,
            0.0,
        )
        outer = pipe.outer_diameter or section.diameter or np.nan
        of_wall = (code.safety, outer, pipe.wall, pipe.modulus, code.yield_strength, code.tensile_strength)
        tube = pipe.modulus * np.pi / 64.0 * (outer**4 - (outer - 2.0 * pipe.wall) ** 4)
        natural = float(np.hypot(*(section.intrinsic_curvature or (0.0, 0.0))[:2]))
        of_bend = (max(bending_stiffness(section)) or tube, natural)
        z = self.surface if pipe.pressure_z is None else pipe.pressure_z
        pressures = (pipe.pressure, z, pipe.content_density * self.gravity, self.water, self.surface)
        return Row(first, last, F201, *numbers, *of_wall, code.ovality, code.fabrication, *pressures, *of_bend)

    def probes(self) -> dict[str, Probe]:
        """Probes by name."""
        which = "; ".join(CLAUSES[kind] for kind in self._kinds)
        return {CODE_USED: Probe("%", f"part used of what codes allow: {which}; NaN: none given", ("s",), self.used)}

    def used(self, v: Observation) -> Floats:
        """(ns, nb) %."""
        section = self.numbers(v.grid.points, v.grid.after)
        z, found = (v.grid.nodes @ v.r)[:, 2], np.full(v.tension.shape, np.nan)
        lies = np.repeat(~v.side_is_rod[:, None], v.columns, axis=1)
        catenary = np.asarray(v.grid.sides @ lies.astype(float)) > 0.0
        s, near, sleeved = v.grid.points, self._near, np.zeros(v.tension.shape, bool)  # a sleeve bears what is its own
        for a, b in self._sleeves:
            sleeved |= (s >= a - near) & (s <= b + near)
        for i, row in enumerate(self._rows):
            if row is not None:
                of_curvature = moment_of(row, v.curvature_twist[:, 0]) if row.kind == F201 else 0.0
                M = np.where(catenary, of_curvature, v.bending_moment)
                M = np.where(sleeved, np.minimum(M, of_curvature), M)
                found = np.where(section == i, 100.0 * code_used(row, v.tension, M, z), found)
        return found

    def rows(self) -> Floats:
        """(K, columns) of `Row`."""
        return np.array([part for x in self._rows if x is not None for part in self._parts(x)], float)

    def _parts(self, row: Row) -> list[Row]:
        """A row, cut where sleeves begin and end."""
        edges = sorted({s for s in chain(*self._sleeves) if row.first + self._near < s < row.last - self._near})
        parts = [row._replace(first=a, last=b) for a, b in pairwise([row.first, *edges, row.last])]
        return [
            x._replace(sleeved=float(any(a < 0.5 * (x.first + x.last) < b for a, b in self._sleeves))) for x in parts
        ]


# Lowest and highest values, over every step, of the quantities that a scene asks for by name.
#
# The compiled run keeps them (kernels.watch.named_quantities); here is what it is told, and what the file gets of them.

NONE: Mapping[str, Quantity] = MappingProxyType({})
NO_ROWS: Mapping[str, tuple[int, int]] = MappingProxyType({})


def _rows(asked: Sequence[Quantity], line: str | None) -> tuple[Floats, Floats]:
    """Rows (Q, ASKED) and (Q, REACHED) of quantities of a line, but for what they are to."""
    rows = np.zeros((len(asked), k.ASKED))
    for row, q in zip(rows, asked, strict=True):
        row[k.KIND], row[k.END] = getattr(k, q.kind.upper()), q.end == "end"
        row[k.FIRST : k.LAST + 1] = q.range if q.range and q.line in (line, None) else np.nan
    return rows, nothing(len(asked))


def _radii(scene: LineScene) -> Floats:
    """(S, 2) m, where the sections of a line end, and their radii; 0 where no diameter is given."""
    (whole, begin), ends = whole_scene(scene), OfSections(scene).ends
    middles = np.diff(ends, prepend=begin)
    return np.column_stack([ends, 0.5 * np.nan_to_num(outer_diameter(whole, ends - begin - 0.5 * middles))])


def _fill(row: Floats, reached: Floats, q: Quantity, seabed: bool, rows: list[Floats]) -> None:
    """Enter a quantity of one line into its row, and the path that it keeps clear of into `rows`."""
    row[k.TO_TOUCHDOWN] = q.ends_at(seabed) == "touchdown"
    if q.reference is not None:
        reached[k.REFERENCE : k.REFERENCE + 2] = q.reference
    if q.kind == "azimuth":
        reached[k.REFERENCE] = q.middle
    along = q.direction or q.normal
    if along is not None:
        row[k.DIRECTION : k.DIRECTION + 3] = np.array(along, float) / np.linalg.norm(along)
    if q.normal is not None:
        row[k.IS_PLANE], row[k.POINT : k.POINT + 3] = 1.0, q.point
    elif q.kind == "clearance":
        more = chords_of(np.array(q.path or (q.point,), float), 0.5 * q.diameter)
        row[k.PATH], row[k.PATH_END] = len(rows), len(rows) + len(more)
        rows += [*more]


class StepQuantities:
    """Ranges of the quantities of one line."""

    def __init__(
        self,
        scene: LineScene,
        wanted: Mapping[str, Quantity],
        pipes: Pipes | None = None,
        line: str = "",
        shown: Mapping[str, Quantity] = NONE,
        rows_of: Mapping[str, tuple[int, int]] = NO_ROWS,
    ) -> None:
        """wanted: by name; pipes: of which wall tension and stress are kept at every node, in the extremes of the line.

        line: its name, of several; shown: clearances by name of two lines that stand with the other one of them, and
        need chords of this one; rows_of: by name of such clearances rows of the path of all lines, the last excluded.
        """
        self.pipes = pipes
        self.walls = pipes.rows if pipes is not None else np.zeros((0, 0))
        self.wanted = dict(wanted)
        self.asked, self.reached = _rows([*wanted.values(), *shown.values()], line)
        rows: list[Floats] = []
        seabed = scene.environment.seabed is not None
        for row, reached, (name, q) in zip(self.asked, self.reached, [*wanted.items(), *shown.items()], strict=True):
            if q.other is not None:
                row[k.PATH], row[k.PATH_END] = rows_of[name]
                row[k.COUNTED], row[k.OF_PATH] = 1.0, q.line != line
                row[k.KIND] = k.CHORDS if name in shown else k.CLEARANCE
                continue
            _fill(row, reached, q, seabed, rows)
        self.path = np.array(rows).reshape(-1, k.PATH_ROW)
        self.radii = _radii(scene)

    def __bool__(self) -> bool:
        return bool(self.asked.size) or bool(self.walls.size)

    def share(self, path: Floats, begin: int) -> None:
        """Share a path with other lines; that of this one begins at a row."""
        own = self.asked[:, k.COUNTED] == 0.0
        self.asked[own, k.PATH] += begin
        self.asked[own, k.PATH_END] += begin
        self.path = path

    def given_to(self, books: Books) -> Books:
        """Books of a run, or of a line of several, that keep the ranges."""
        return books._replace(
            asked=self.asked, reached=self.reached, path=self.path, radii=self.radii, walls=self.walls
        )

    def set_idle(self, ends: Collection[int]) -> None:
        """Ends (0, 1) of a line of several at which nothing takes its pull from now on; at the others it is taken."""
        self.asked[:, k.IDLE] = np.isin(self.asked[:, k.END], list(ends))

    def restore(self, saved: object) -> None:
        """Go on with ranges that a checkpoint has; of one from before there were any, they stay unknown."""
        if isinstance(saved, np.ndarray) and saved.shape == self.reached.shape:
            self.reached[:] = saved
        else:
            self.reached[:, k.SMALLEST], self.reached[:, k.LARGEST] = -np.inf, np.inf

    # --- for the file -------------------------------------------------------------------------------

    def fields(self) -> list[Field]:
        """What the file has of them."""
        found = []
        for name, q in self.wanted.items():
            for group, unit, text in parts(q):
                full, about = f"{EXTREMES}/{group}{name}", text.format(name=name)
                found.append(Field(full, unit, about, (2,), ("bounds",), nan_ok=True))
        return found

    def values(self) -> dict[str, Any]:
        """Values of those fields; NaN: not known."""
        out = {}
        for row, (name, q) in zip(self.reached, self.wanted.items(), strict=False):  # behind them those that are shown
            known = bool(row[k.SMALLEST] <= row[k.LARGEST]) and bool(np.isfinite(row[: k.LARGEST + 1]).all())
            for (group, *_), at in zip(parts(q), (k.SMALLEST, k.TIMES, k.PLACES), strict=False):
                out[f"{EXTREMES}/{group}{name}"] = row[at : at + 2].copy() if known else np.full(2, np.nan)
        return out


def parts(q: Quantity) -> list[tuple[str, str, str]]:
    """What is kept of a quantity: group of its field, unit, and what it is."""
    found = [
        ("", q.unit, "smallest and largest {name} at any accepted step; NaN: not known"),
        ("t/", "s", "times of the smallest and the largest {name}"),
    ]
    return [*found, ("s/", "m", "arc lengths where they were")] if q.kind == "clearance" else found


def nothing(count: int) -> Floats:
    """Ranges (count, REACHED) of nothing."""
    found = np.full((count, k.REACHED), np.nan)
    found[:, k.SMALLEST], found[:, k.LARGEST], found[:, k.NEAREST] = np.inf, -np.inf, 0.0
    return found


def chords_of(points: Floats, radius: float | Floats) -> Floats:
    """Rows (..., P, PATH_ROW) of a path of a radius, or of one of each chord, m, through points (..., n, 3), m.

    Through a single point it is a chord without length.
    """
    if points.shape[-2] == 1:
        points = np.concatenate([points, points], axis=-2)
    chords = np.diff(points, axis=-2)
    rows = np.zeros((*chords.shape[:-1], k.PATH_ROW))
    rows[..., : k.CHORD], rows[..., k.CHORD : k.SQUARE] = points[..., :-1, :], chords
    rows[..., k.SQUARE], rows[..., k.RADIUS] = np.einsum("...ni,...ni->...n", chords, chords), radius
    return rows


# Where a clearance is least: name of that field, after the name of the clearance.
WHERE = "_at"


def quantities_of(scene: LineScene) -> Quantities | None:
    """What a scene asks for beside the usual outputs; None: nothing."""
    along = any(x.pipe is not None or x.capacity is not None or x.code is not None for x in scene.cable.sections)
    return Quantities(scene, scene.output.quantities) if along or scene.output.quantities else None


class Quantities:
    """The quantities of one line as probes, and the places from which excursions count."""

    def __init__(self, scene: LineScene, wanted: Mapping[str, Quantity]) -> None:
        self.wanted = dict(wanted)
        self.pipes = Pipes(scene) if any(x.pipe is not None for x in scene.cable.sections) else None
        self.capacities = Capacities(scene) if any(x.capacity for x in scene.cable.sections) else None
        self.codes = Codes(scene) if any(x.code for x in scene.cable.sections) else None
        self._seabed, self._radii = scene.environment.seabed is not None, _radii(scene)
        # nodes (nb, m+1, 3) m and radii of cells (m,) m of other lines in the outputs that are looked at, by name
        self.others: dict[str, tuple[Floats, Floats]] = {}
        order = sorted(self.wanted.items(), key=lambda x: (x[1].kind != "touchdown_excursion", x[1].kind != "azimuth"))
        asked = [q for _, q in order]
        self._asked, reached = _rows(asked, asked[0].line if asked else None)
        paths: list[Floats] = []
        for row, one, q in zip(self._asked, reached, asked, strict=True):
            if q.other is None:
                _fill(row, one, q, self._seabed, paths)
        self._reached, self._path = reached, np.array(paths).reshape(1, -1, k.PATH_ROW)
        self._row = {name: row for row, (name, _) in enumerate(order)}
        kinds = [q.kind for q in asked]
        count = kinds.count("touchdown_excursion")
        # (n, 2) m, of the excursions in their order; NaN until there is a touchdown
        self.first = reached[:count, k.REFERENCE : k.REFERENCE + 2]
        # (n,) deg, from which azimuths are within half a turn, in their order; NaN until there is a pull
        self.turns = reached[count : count + kinds.count("azimuth"), k.REFERENCE]

    def probes(self) -> dict[str, Probe]:
        """Probes by name."""
        along = (x for x in (self.pipes, self.capacities, self.codes) if x is not None)
        found = {name: probe for x in along for name, probe in x.probes().items()}
        for name, q in self.wanted.items():
            if q.kind == "clearance":
                text = f"arc length at which {name} is least"
                found[name + WHERE] = Probe("m", text, (), partial(self._observed, name, 1))
            found[name] = Probe(q.unit, q.description(self._seabed), (), partial(self._observed, name, 0))
        return found

    def _observed(self, name: str, what: int, v: Observation) -> Floats:
        """Values (nb,) of a quantity, or where a clearance is, m."""
        asked, path, found = self._asked[self._row[name]], self._path, np.empty((2, v.batch.t.size))
        if (other := self.wanted[name].other) is not None:
            path = chords_of(*self.others[other])
            asked[k.PATH], asked[k.PATH_END] = 0, path.shape[1]
        loaded = np.array([v.loaded(0), v.loaded(1)], np.int8)
        s, b, whole = v.of_line("s", slice(None)).T, v.batch, np.ascontiguousarray
        held, report = whole(b.held), whole(b.report)
        seen = k.Seen(whole(s), whole(b.r), whole(b.e), v.sea, held, loaded, report, self._radii, path)
        k.observe_quantity(seen, asked, self._reached[self._row[name]], found)
        return found[what]

    def radii(self, nodes: Floats) -> Floats:
        """Radii (n,) m of the cells between nodes (n+1,), m; 0 where no diameter is given."""
        ends, radii = self._radii.T
        return radii[np.searchsorted(ends[:-1], 0.5 * (nodes[1:] + nodes[:-1]))]
