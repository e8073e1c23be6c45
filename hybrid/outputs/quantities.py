"""Quantities that a scene asks for by name, and the use of sections.

What sections bear, of a batch of states: stress of pipes (docs/theory.md), parts used of capacities and codes.

Quantities that a scene asks for by name, of a batch of states: angles and forces at ends, layback, clearance.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from functools import partial
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from hybrid.kernels.laws.seabed import planes_under
from hybrid.kernels.state.books import Books
from hybrid.kernels.state.state import Floats
from hybrid.kernels.watch import named_quantities as k
from hybrid.kernels.watch import named_quantities as wall_of
from hybrid.kernels.watch.named_quantities import LEAST_AZIMUTH
from hybrid.model.payout import whole_scene
from hybrid.model.sections import bending_stiffness, outer_diameter
from hybrid.outputs.observation import Observation, Probe
from hybrid.outputs.strains import bends_without_natural
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

CURVED_NOWHERE: Floats = np.zeros(1)


class Walls(NamedTuple):
    """Of sections: arrays (sections,); of those without a pipe `inner` is 0 and `modulus` NaN."""

    outer: Floats  # m
    inner: Floats  # m
    modulus: Floats  # Pa
    pressure: Floats  # Pa, inside, at pressure_z
    pressure_z: Floats  # m
    content: Floats  # kg/m3
    natural: Floats = CURVED_NOWHERE  # 1/m, curvature without load, of which there is no stress


class Pipes:
    """The pipes of one line.  Only for a scene that has some."""

    def __init__(self, scene: LineScene) -> None:
        fluid = scene.environment.fluid
        self._gravity = scene.environment.gravity
        self._density = fluid.density if fluid is not None else 0.0
        self._surface = 0.0 if fluid is None or fluid.surface is None else fluid.surface
        whole, begin = whole_scene(scene)
        sections = whole.cable.sections
        self._bounds = begin + np.cumsum([x.length for x in sections])[:-1]
        self._near = 1e-9 * sum(x.length for x in sections)
        rows = []
        for x in sections:
            p = x.pipe
            if p is None:
                rows.append((x.diameter or 0.0, 0.0, np.nan, 0.0, 0.0, 0.0, 0.0))
                continue
            outer = p.outer_diameter or x.diameter or np.nan
            z = self._surface if p.pressure_z is None else p.pressure_z
            natural = float(np.hypot(*(x.intrinsic_curvature or (0.0, 0.0))[:2]))
            rows.append((outer, outer - 2.0 * p.wall, p.modulus, p.pressure, z, p.content_density, natural))
        self._walls = Walls(*np.array(rows, float).T)
        self.whole = tuple(begin + np.cumsum([x.length for x in sections]))  # m, where they end
        limits = [x.pipe.max_stress if x.pipe is not None else None for x in sections]
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
        return self.limits[self._sections(s, after)]

    def gains(self, s: Floats, after: bool) -> tuple[Floats, Floats]:
        """By how much a stress rises at most with tension (ns,) 1/m2 and with curvature (ns,) Pa m, likewise."""
        walls = Walls(*(x[self._sections(s, after)] for x in self._walls))
        area = 0.25 * np.pi * (walls.outer**2 - walls.inner**2)
        none = np.isnan(walls.modulus)
        by_tension = np.divide(1.0, area, out=np.full(s.size, np.nan), where=~none)
        return by_tension, 0.5 * walls.modulus * walls.outer

    def rows(self) -> Floats:
        """(sections, WALL) of kernels.watch.named_quantities."""
        found, walls = np.zeros((len(self.whole), wall_of.WALL)), self._walls
        columns: dict[int, Any] = {
            wall_of.SECTION_END: self.whole, wall_of.OUTER: walls.outer, wall_of.INNER: walls.inner,
            wall_of.MODULUS: np.nan_to_num(walls.modulus), wall_of.INSIDE: walls.pressure,
            wall_of.INSIDE_Z: walls.pressure_z, wall_of.CONTENT: walls.content * self._gravity,
            wall_of.WATER: self._density * self._gravity, wall_of.SURFACE: self._surface,
            wall_of.NATURAL: walls.natural,
        }  # fmt: skip
        for column, values in columns.items():
            found[:, column] = values
        return found

    def has_wall(self, s: Floats) -> np.ndarray:
        """(ns,) bool, whether the sections at arc lengths s (m), away from where they meet, are pipes."""
        return ~np.isnan(self._walls.modulus[self._sections(s, True)])

    def _sections(self, s: Floats, after: bool) -> np.ndarray:
        return np.searchsorted(self._bounds, s + (self._near if after else -self._near))

    def _pressures(self, v: Observation) -> tuple[Walls, Floats, Floats]:
        """Walls at the output points, and the pressures (ns, nb) Pa over that of the air outside and inside."""
        walls = Walls(*(x[self._sections(v.grid.points, v.grid.after)] for x in self._walls))
        z = (v.grid.nodes @ v.r)[:, 2]
        outside = self._density * self._gravity * np.maximum(self._surface - z, 0.0)
        inside = np.maximum(walls.pressure + walls.content * self._gravity * (walls.pressure_z - z), 0.0)
        return walls, outside, np.where(walls.inner > 0.0, inside, 0.0)

    def wall_tension(self, v: Observation) -> Floats:
        """(ns, nb) N."""
        walls, outside, inside = self._pressures(v)
        return np.asarray(v.tension + 0.25 * np.pi * (inside * walls.inner**2 - outside * walls.outer**2))

    def von_mises(self, v: Observation) -> Floats:
        """(ns, nb) Pa: the largest of the four points where stress is largest, by Lame, bending and torsion."""
        walls, outside, inside = self._pressures(v)
        force = self.wall_tension(v)
        curvature, torque = v.curvature_twist[:, 0], v.torque
        if np.any(walls.natural > 0.0):
            bent, unknown = bends_without_natural(v, v.curvature_on_sides)
            bent = np.where(unknown, curvature + walls.natural, bent)
            curvature = np.where(walls.natural > 0.0, bent, curvature)
        return largest_stress(walls, outside, inside, force, curvature, torque)


def largest_stress(
    walls: Walls, outside: Floats, inside: Floats, force: Floats, curvature: Floats, torque: Floats
) -> Floats:
    """Largest von Mises stress (Pa) of pipes under pressures (Pa), wall tension (N), curvature (1/m), torque (N m).

    Taken at both surfaces of the wall, on both sides of the bend: what lies between is less.  Shear across is left out.
    """
    o2, i2 = walls.outer**2, walls.inner**2
    area, polar = 0.25 * np.pi * (o2 - i2), np.pi / 32.0 * (walls.outer**4 - walls.inner**4)
    mean = (inside * i2 - outside * o2) / (o2 - i2)
    swing = (inside - outside) * o2 * i2 / (o2 - i2)
    most = np.zeros(np.broadcast_shapes(force.shape, curvature.shape, walls.outer.shape))
    for d in (walls.inner, walls.outer):
        d2 = np.where(d > 0.0, d * d, np.nan)
        radial, hoop = mean - swing / d2, mean + swing / d2
        shear = 0.5 * torque * d / polar
        for side in (-0.5, 0.5):
            axial = force / area + side * walls.modulus * curvature * d
            square = 0.5 * ((axial - hoop) ** 2 + (hoop - radial) ** 2 + (radial - axial) ** 2) + 3.0 * shear**2
            most = np.maximum(most, np.sqrt(square))
    return np.where(np.isnan(walls.modulus), np.nan, most)


class Capacities:
    """The capacity polygons of one line.  Only for a scene that has some."""

    def __init__(self, scene: LineScene) -> None:
        whole, begin = whole_scene(scene)
        sections = whole.cable.sections
        ends = begin + np.cumsum([x.length for x in sections])
        self._ends, self._near = ends[:-1], 1e-9 * sum(x.length for x in sections)
        self._corners = [None if x.capacity is None else np.array(x.capacity, float) for x in sections]
        self._begins = np.concatenate([[begin], ends[:-1]])
        self._whole = ends

    def probes(self) -> dict[str, Probe]:
        """Probes by name."""
        text = "part of the capacity that tension and curvature use together; NaN: none given"
        return {CAPACITY_USED: Probe("%", text, ("s",), self.used)}

    def used(self, v: Observation) -> Floats:
        """(ns, nb) %."""
        s, curvature = v.grid.points, v.curvature_twist[:, 0]
        section = np.searchsorted(self._ends, s + (self._near if v.grid.after else -self._near))
        found = np.full(v.tension.shape, np.nan)
        for i, corners in enumerate(self._corners):
            if corners is not None:
                found = np.where(section == i, 100.0 * capacity_used(corners, v.tension, curvature), found)
        return found

    def rows(self) -> Floats:
        """(K, 4): from and to (m), tension (N) and curvature (1/m) of each corner of each section that has any."""
        found = [
            np.column_stack([np.full(len(x), self._begins[i]), np.full(len(x), self._whole[i]), x])
            for i, x in enumerate(self._corners)
            if x is not None
        ]
        return np.concatenate(found)


class Codes:
    """The codes of one line.  Only for a scene that has some."""

    def __init__(self, scene: LineScene) -> None:
        fluid, gravity = scene.environment.fluid, scene.environment.gravity
        self._water = fluid.density * gravity if fluid is not None else 0.0
        self._surface = 0.0 if fluid is None or fluid.surface is None else fluid.surface
        self._gravity = gravity
        whole, begin = whole_scene(scene)
        sections = whole.cable.sections
        ends = begin + np.cumsum([x.length for x in sections])
        begins = np.concatenate([[begin], ends[:-1]])
        self._ends, self._near = ends[:-1], 1e-9 * sum(x.length for x in sections)
        self._rows = [self._row(*x) for x in zip(sections, begins.tolist(), ends.tolist(), strict=True)]
        self._kinds = list(dict.fromkeys(x.code.kind for x in sections if x.code is not None))

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
        z = self._surface if pipe.pressure_z is None else pipe.pressure_z
        pressures = (pipe.pressure, z, pipe.content_density * self._gravity, self._water, self._surface)
        return Row(first, last, F201, *numbers, *of_wall, code.ovality, code.fabrication, *pressures, *of_bend)

    def probes(self) -> dict[str, Probe]:
        """Probes by name."""
        which = "; ".join(CLAUSES[kind] for kind in self._kinds)
        return {CODE_USED: Probe("%", f"part used of what codes allow: {which}; NaN: none given", ("s",), self.used)}

    def used(self, v: Observation) -> Floats:
        """(ns, nb) %."""
        s = v.grid.points
        section = np.searchsorted(self._ends, s + (self._near if v.grid.after else -self._near))
        z, found = (v.grid.nodes @ v.r)[:, 2], np.full(v.tension.shape, np.nan)
        catenary = np.asarray(v.grid.sides @ (~v.side_is_rod[:, None]).astype(float)) > 0.0
        for i, row in enumerate(self._rows):
            if row is not None:
                of_curvature = moment_of(row, v.curvature_twist[:, 0]) if row.kind == F201 else 0.0
                M = np.where(catenary, of_curvature, v.bending_moment)
                found = np.where(section == i, 100.0 * code_used(row, v.tension, M, z), found)
        return found

    def rows(self) -> Floats:
        """(K, columns) of `Row`."""
        return np.array([x for x in self._rows if x is not None], float)


# Lowest and highest values, over every step, of the quantities that a scene asks for by name.
#
# The compiled run keeps them (kernels.watch.named_quantities); here is what it is told, and what the file gets of them.

NONE: Mapping[str, Quantity] = MappingProxyType({})
NO_ROWS: Mapping[str, tuple[int, int]] = MappingProxyType({})


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
        self, scene: LineScene, wanted: Mapping[str, Quantity], pipes: Pipes | None = None, line: str = "",
        shown: Mapping[str, Quantity] = NONE, rows_of: Mapping[str, tuple[int, int]] = NO_ROWS,
    ) -> None:  # fmt: skip
        """wanted: by name; pipes: of which wall tension and stress are kept at every node, in the extremes of the line.

        line: its name, of several; shown: clearances by name of two lines that stand with the other one of them, and
        need chords of this one; rows_of: by name of such clearances rows of the path of all lines, the last excluded.
        """
        self.pipes = pipes
        self.walls = pipes.rows() if pipes is not None else np.zeros((0, 0))
        self.wanted = dict(wanted)
        self.asked = np.zeros((len(wanted) + len(shown), k.ASKED))
        self.reached = nothing(len(self.asked))
        rows: list[Floats] = []
        seabed = scene.environment.seabed is not None
        for row, reached, (name, q) in zip(self.asked, self.reached, [*wanted.items(), *shown.items()], strict=True):
            row[k.KIND], row[k.END] = getattr(k, q.kind.upper()), q.end == "end"
            row[k.FIRST : k.LAST + 1] = q.range if q.range and q.line in (line, None) else np.nan
            if q.other is not None:
                row[k.PATH], row[k.PATH_END] = rows_of[name]
                row[k.COUNTED], row[k.OF_PATH] = 1.0, q.line != line
                row[k.KIND] = k.CHORDS if name in shown else k.CLEARANCE
                continue
            _fill(row, reached, q, seabed, rows)
        self.path = np.array(rows).reshape(-1, k.PATH_ROW)
        whole, begin = whole_scene(scene)
        ends = np.cumsum([x.length for x in whole.cable.sections])
        middles = ends - 0.5 * np.array([x.length for x in whole.cable.sections])
        self.radii = np.column_stack([begin + ends, 0.5 * np.nan_to_num(outer_diameter(whole, middles))])

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


def chords_of(points: Floats, radius: float) -> Floats:
    """Rows (P, PATH_ROW) of a path of a radius, m, through points (n, 3), m.

    Through a single point it is a chord without length.
    """
    if len(points) == 1:
        points = np.concatenate([points, points])
    chords = np.diff(points, axis=0)
    rows = np.zeros((len(chords), k.PATH_ROW))
    rows[:, : k.SQUARE] = np.column_stack([points[:-1], chords])
    rows[:, k.SQUARE], rows[:, k.RADIUS] = np.einsum("ni,ni->n", chords, chords), radius
    return rows


END = {"start": 0, "end": 1}
# Where a clearance is least: name of that field, after the name of the clearance.
WHERE = "_at"
# Pairs of chords that are looked at one and all; of more only those that can be nearest.
FEW = 4096


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
        self._scene, self._begin = whole_scene(scene)
        self._seabed = scene.environment.seabed is not None
        # nodes (nb, m+1, 3) m and radii of cells (m,) m of other lines in the outputs that are looked at, by name
        self.others: dict[str, tuple[Floats, Floats]] = {}
        # (n, 2) m, of the excursions in their order; NaN until there is a touchdown
        self.first = np.array(
            [q.reference or (np.nan, np.nan) for q in self.wanted.values() if q.kind == "touchdown_excursion"]
        ).reshape(-1, 2)
        # (n,) deg, from which azimuths are within half a turn, in their order; NaN until there is a pull
        self.turns = np.array([q.middle for q in self.wanted.values() if q.kind == "azimuth"])

    def probes(self) -> dict[str, Probe]:
        """Probes by name."""
        along = (x for x in (self.pipes, self.capacities, self.codes) if x is not None)
        found = {name: probe for x in along for name, probe in x.probes().items()}
        excursions = azimuths = 0
        for name, q in self.wanted.items():
            if q.kind == "touchdown_excursion":
                value = partial(self._excursion, q, excursions)
                excursions += 1
            elif q.kind == "azimuth":
                value = partial(self._azimuth, q, azimuths)
                azimuths += 1
            elif q.kind == "clearance":
                value = partial(self._clearance, q, 0)
                text = f"arc length at which {name} is least"
                found[name + WHERE] = Probe("m", text, (), partial(self._clearance, q, 1))
            else:
                value = partial(getattr(self, f"_{q.kind}"), q)
            found[name] = Probe(q.unit, q.description(self._seabed), (), value)
        return found

    # --- at the ends ---------------------------------------------------------------------------------

    def _horizontal_force(self, q: Quantity, v: Observation) -> Floats:
        x, y, _ = pull(v, q)
        return np.asarray(np.hypot(x, y))

    def _vertical_force(self, q: Quantity, v: Observation) -> Floats:
        return pull(v, q)[2]

    def _force_along(self, q: Quantity, v: Observation) -> Floats:
        return np.asarray(unit(q) @ pull(v, q))

    def _declination(self, q: Quantity, v: Observation) -> Floats:
        x, y, z = pull(v, q)
        return known(np.degrees(np.arctan2(np.hypot(x, y), z)), v, q)

    def _azimuth(self, q: Quantity, k: int, v: Observation) -> Floats:
        x, y, _ = pull(v, q)
        found = known(np.degrees(np.arctan2(y + 0.0, x)), v, q)  # no -0, which is half a turn away
        if np.isnan(self.turns[k]) and np.isfinite(found).any():
            first = float(found[np.isfinite(found).argmax()])
            self.turns[k] = first + 360.0 if first <= LEAST_AZIMUTH else first
        return found if np.isnan(self.turns[k]) else found + 360.0 * np.floor((self.turns[k] - found) / 360.0 + 0.5)

    def _end_angle(self, q: Quantity, v: Observation) -> Floats:
        along, force = unit(q), pull(v, q)
        aside = np.linalg.norm(np.cross(force, along, axis=0), axis=0)
        return known(np.degrees(np.arctan2(aside, along @ force)), v, q)

    def _uplift(self, q: Quantity, v: Observation) -> Floats:
        return np.maximum(_normal(v, q)[0], 0.0)

    def _uplift_angle(self, q: Quantity, v: Observation) -> Floats:
        up, along = _normal(v, q)
        return np.degrees(np.arctan2(np.maximum(up, 0.0), along))

    # --- on the seabed -------------------------------------------------------------------------------

    def _touchdown(self, q: Quantity, v: Observation) -> Floats:
        return v.touchdown.edges[END[str(q.end)]]

    def _excursion(self, q: Quantity, k: int, v: Observation) -> Floats:
        x, y, _ = v.touchdown.places[END[str(q.end)]]
        if np.isnan(self.first[k, 0]) and np.isfinite(x).any():
            first = int(np.isfinite(x).argmax())
            self.first[k] = x[first], y[first]
        return np.asarray(np.hypot(x - self.first[k, 0], y - self.first[k, 1]))

    def _layback(self, q: Quantity, v: Observation) -> Floats:
        k = END[str(q.end)]
        here = v.r[-k]
        there = v.touchdown.places[k] if q.ends_at(self._seabed) == "touchdown" else v.r[k - 1]
        return np.asarray(np.hypot(there[0] - here[0], there[1] - here[1]))

    # --- clearance -----------------------------------------------------------------------------------

    def _clearance(self, q: Quantity, what: int, v: Observation) -> Floats:
        if q.other is not None:
            there, rb = self.others[q.other]
        else:
            other = q.path if q.path is not None else (q.point,)
            there, rb = np.array(other, float)[None], np.full(max(len(other) - 1, 1), 0.5 * q.diameter)
        first, last, radius = self.cells(q, v)
        nodes, found = v.of_line("s", slice(None)), []
        for output, r in enumerate(v.r[first : last + 1].transpose(2, 0, 1)):
            s, b = nodes[:, min(output, nodes.shape[1] - 1)], there[min(output, len(there) - 1)]
            if q.normal is not None:
                n = np.array(q.normal) / np.linalg.norm(q.normal)
                height = (r - b[0]) @ n
                height = np.minimum(height[:-1], height[1:]) - radius
                k = int(height.argmin())
                least, part = float(height[k]), float((r[k + 1] - r[k]) @ n < 0.0)
            else:
                least, k, part = nearest(r, b, radius, rb)
            found.append((least, s[first + k] + part * (s[first + k + 1] - s[first + k]))[what])
        return np.array(found)

    def cells(self, q: Quantity, v: Observation) -> tuple[int, int, Floats]:
        """First and last node, and radii (m) of the cells between, of the part of a line that counts."""
        s = v.line.s
        first, last = 0, s.size - 1
        if q.range is not None:
            first, last = (int(np.abs(s - x).argmin()) for x in q.range)
            first, last = min(first, s.size - 2), max(last, first + 1)
        return first, last, self.radii(s[first : last + 1])

    def radii(self, nodes: Floats) -> Floats:
        """Radii (n,) m of the cells between nodes (n+1,), m; 0 where no diameter is given."""
        return 0.5 * np.nan_to_num(outer_diameter(self._scene, 0.5 * (nodes[1:] + nodes[:-1]) - self._begin))


def pull(v: Observation, q: Quantity) -> Floats:
    """Force (3, nb) N with which the line pulls at what holds an end; none where nothing holds it."""
    k = END[str(q.end)]
    force = v.reaction(k)
    return np.asarray(np.where((v.batch.held[:, k] != 0) | v.loaded(k), -force, 0.0))


def known(angle: Floats, v: Observation, q: Quantity) -> Floats:
    """An angle (nb,) of the pull; NaN where there is none."""
    return np.where((pull(v, q) ** 2).sum(axis=0) > 0.0, angle, np.nan)


def unit(q: Quantity) -> Floats:
    """The direction of a quantity as a unit vector."""
    return np.array(q.direction, float) / np.linalg.norm(np.array(q.direction, float))


def _normal(v: Observation, q: Quantity) -> tuple[Floats, Floats]:
    """Parts (nb,) N of the pull along the normal of the seabed under the end, and along the seabed."""
    force = pull(v, q)
    n = planes_under(v.sea, np.ascontiguousarray(v.r[-END[str(q.end)]].T))[0]
    up = np.einsum("bi,ib->b", n, force)
    return up, np.linalg.norm(force - up * n.T, axis=0)


# --- least distances between polylines, exact for their chords --------------------------------------


def nearest(a: Floats, b: Floats, ra: Floats, rb: Floats) -> tuple[float, int, float]:
    """Least clearance (m) of two polylines, distance less both radii, and where it is.

    a (n+1, 3), b (m+1, 3): nodes, m, a single node b being a point; ra (n,), rb (m,): radii of their chords, m.
    Where: which chord of a is nearest, and which part of it.
    """
    if len(b) == 1:
        b = np.concatenate([b, b])
    a0, a1, b0, b1 = a[:-1], a[1:], b[:-1], b[1:]
    if len(a0) * len(b0) <= FEW:
        i, j = (x.ravel() for x in np.indices((len(a0), len(b0))))
    else:
        i, j = _candidates(a0, a1, b0, b1, ra, rb)
    distance, part = between(a0[i], a1[i], b0[j], b1[j])
    clear = distance - ra[i] - rb[j]
    k = int(clear.argmin())
    return float(clear[k]), int(i[k]), float(part[k])


def between(a0: Floats, a1: Floats, b0: Floats, b1: Floats) -> tuple[Floats, Floats]:
    """Distances (n,) m of chords a0 a1 and b0 b1, each (n, 3) m, and the part of a where it is nearest."""
    da, db, r = a1 - a0, b1 - b0, a0 - b0
    aa, bb, ab = (np.einsum("ni,ni->n", x, y) for x, y in ((da, da), (db, db), (da, db)))
    ar, br = np.einsum("ni,ni->n", da, r), np.einsum("ni,ni->n", db, r)
    tiny = 1e-300
    area = aa * bb - ab * ab
    s = np.where(area > 1e-12 * aa * bb, np.clip((ab * br - ar * bb) / np.where(area > tiny, area, 1.0), 0.0, 1.0), 0.0)
    t = np.where(bb > tiny, (ab * s + br) / np.where(bb > tiny, bb, 1.0), 0.0)
    held = np.clip(t, 0.0, 1.0)
    along = np.where(aa > tiny, np.clip((ab * held - ar) / np.where(aa > tiny, aa, 1.0), 0.0, 1.0), 0.0)
    s = np.where((t != held) | (bb <= tiny), along, s)
    apart = r + s[:, None] * da - held[:, None] * db
    return np.sqrt(np.einsum("ni,ni->n", apart, apart)), s


def _candidates(
    a0: Floats, a1: Floats, b0: Floats, b1: Floats, ra: Floats, rb: Floats
) -> tuple[np.ndarray, np.ndarray]:
    """Pairs of chords that may be the nearest: the spheres around them are no farther apart than two nodes are."""
    from scipy.spatial import cKDTree

    middle_a, middle_b = 0.5 * (a0 + a1), 0.5 * (b0 + b1)
    half_a, half_b = (0.5 * np.linalg.norm(x - y, axis=1) for x, y in ((a1, a0), (b1, b0)))
    tree = cKDTree(middle_b)
    distance, k = tree.query(middle_a)
    most = float((distance - ra - rb[k]).min())
    found = tree.query_ball_point(middle_a, np.maximum(most + half_a + ra, 0.0) + float((half_b + rb).max()) + 1e-9)
    i = np.repeat(np.arange(len(a0)), [len(x) for x in found])
    j = np.concatenate([np.asarray(x, int) for x in found])
    return i, j
