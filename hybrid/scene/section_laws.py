"""How a section stretches, and checks of it by formulas of codes.

Where tension is no multiple of strain, it is a table or the dynamic stiffness of fibre ropes.  Checks change nothing
that is computed.
"""

from __future__ import annotations

import os
from bisect import bisect_right
from collections.abc import Iterator
from itertools import pairwise
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Discriminator, Field, Tag, ValidationError

from hybrid.scene.base import Finding, Findings, Kinds, NonNegative, Pair, Positive, Table, Text, refuse, value_or_table
from hybrid.scene.motion_file import RecordRefused, columns_of, read_once, read_table, unreadable

# Factors of safety classes of DNV-OS-F201.
SAFETY_CLASSES = {"low": 1.04, "normal": 1.14, "high": 1.26}


class MooringCode(Table):
    """A mooring line by DNV-OS-E301 (July 2021), Ch.2 Sec.2: (pretension x its factor + the rest x its)/strength."""

    kind: Literal["E301"] = Field(description="DNV-OS-E301, position mooring")
    strength: Positive = Field(description="characteristic strength of the line [N]")
    pretension_factor: Positive = Field(
        description="factor of the pretension, by class and limit state: no usual one [-]"
    )
    environment_factor: Positive = Field(description="factor of the rest of the tension [-]")
    pretension: NonNegative = Field(
        default=0.0, description="smallest tension of the section at rest without current and waves; 0: none counts [N]"
    )

    def findings(self) -> Iterator[Finding]:
        """Numbers that do not fit each other."""
        yield from _factors("pretension_factor", self.pretension_factor, self.environment_factor)
        if self.pretension >= self.strength:
            expected = f"less than the strength, {self.strength:g} N"
            yield Finding(("pretension",), expected, "check both; they are in N", f"{self.pretension:g}")


class RiserCode(Table):
    """A riser pipe by DNV-OS-F201 (October 2010), Sec.5 D: bending, tension and pressure together; needs `pipe`."""

    kind: Literal["F201"] = Field(description="DNV-OS-F201, dynamic risers")
    yield_strength: Positive = Field(description="characteristic yield stress fy of the wall [Pa]")
    tensile_strength: Positive = Field(description="characteristic tensile strength fu of the wall [Pa]")
    safety_class: Literal["low", "normal", "high"] = Field(
        default="normal", description="safety class: factors 1.04, 1.14, 1.26"
    )
    material_factor: Positive = Field(default=1.15, description="material factor [-]")
    functional_factor: Positive = Field(default=1.1, description="factor of functional tension and moment [-]")
    environment_factor: Positive = Field(default=1.3, description="factor of the rest of tension and moment [-]")
    functional_tension: NonNegative = Field(
        default=0.0, description="smallest tension of the section at rest without current and waves; 0: none counts [N]"
    )
    functional_moment: NonNegative = Field(default=0.0, description="smallest bending moment there, likewise [N m]")
    ovality: Positive = Field(default=0.005, description="(largest - smallest diameter)/diameter f0, for collapse [-]")
    fabrication: Positive = Field(
        default=0.85, description="fabrication factor, for collapse; 0.85: UOE pipe, 1: seamless [-]"
    )

    def findings(self) -> Iterator[Finding]:
        """Numbers that do not fit each other."""
        yield from _factors("functional_factor", self.functional_factor, self.environment_factor)
        if self.tensile_strength < self.yield_strength:
            expected = f"at least yield_strength, {self.yield_strength:g} Pa"
            yield Finding(("tensile_strength",), expected, "are the two exchanged?")

    @property
    def safety(self) -> float:
        """Product of the factors of safety class and material."""
        return SAFETY_CLASSES[self.safety_class] * self.material_factor


def _factors(first: str, factor: float, environment: float) -> Iterator[Finding]:
    """What is known best has the smaller factor: else to leave it at 0 were not on the safe side."""
    if environment < factor:
        expected = f"at least {first}, {factor:g}"
        yield Finding(("environment_factor",), expected, "are the two exchanged?", f"{environment:g}")


Code = Annotated[MooringCode | RiserCode, Kinds(usual=("E301",))]


# What a section bears of tension and bending together: the corners of its capacity polygon.

Corners = tuple[tuple[float, float], ...]  # tension (N), curvature (1/m)


def capacity_findings(rows: Corners) -> list[Finding]:
    """What is wrong with the corners of a capacity polygon, from the largest tension round to bending alone.

    Each has to lie further round, as seen from no load, or the part that is used would have two values.
    """
    if len(rows) < 2:
        fix = "give [largest tension, 0], corners, and [0, largest curvature]"
        return [Finding((), "at least two corners [tension, curvature]", fix, f"{len(rows)} corners")]
    for i, (_, k) in enumerate(rows):
        if k < 0.0:
            return [Finding((i, 1), "a curvature >= 0: the same to either side", "leave the other side out")]
    (T, k), (last_T, last_k) = rows[0], rows[-1]
    if not (T > 0.0 and k == 0.0):
        fix = "begin with [largest tension, 0]; tension in N comes first, then curvature in 1/m"
        return [Finding((0,), "the largest tension without bending, [T, 0] with T > 0", fix)]
    if not ((last_T == 0.0 and last_k > 0.0) or (last_T < 0.0 and last_k == 0.0)):
        expected = "the largest curvature without tension, [0, curvature], or the largest compression, [-T, 0]"
        return [Finding((len(rows) - 1,), expected, "end with that corner")]
    for i, ((T, k), (U, m)) in enumerate(pairwise(rows), start=1):
        if not T * m - U * k > 0.0:
            expected = "a corner further round, from tension to bending, as seen from no load"
            return [Finding((i,), expected, "sort the corners")]
    return []


Curve = tuple[tuple[float, float], ...]  # rows of strain and tension, N
COLUMNS = ["strain", "tension"]
# No rope bears more: nylon breaks at 0.5.
LARGEST_STRAIN = 1.0


def _findings(rows: Curve) -> list[Finding]:
    """What is wrong with a table of strain and tension."""
    if len(rows) < 2:
        return [
            Finding((), "at least two rows [strain, tension]", "one number is axial_stiffness", f"{len(rows)} rows")
        ]
    if tuple(rows[0]) != (0.0, 0.0):
        fix = "begin with [0, 0]: lengths are those without tension"
        return [Finding((0,), "no strain without tension, [0, 0]", fix)]
    for k, ((x, T), (y, U)) in enumerate(pairwise(rows), start=1):
        if not y > x:
            return [
                Finding((k, 0), f"a strain above that of the row before, {x:g}", "sort the rows; strain comes first")
            ]
        if not U > T:
            fix = "sort the rows, and smooth what was measured: a rope that slackens as it stretches has no answer"
            return [Finding((k, 1), f"a tension above that of the row before, {T:g} N", fix)]
        if y > LARGEST_STRAIN:
            fix = "strain comes first, then tension in N; a strain is a part: 2 % is 0.02"
            return [Finding((k, 0), f"a strain of at most {LARGEST_STRAIN:g}", fix)]
    return []


class CurveFile(Table):
    """A table of tension over strain in a file."""

    file: Text = Field(
        min_length=1,
        description="CSV file with columns strain,tension (-, N), rising, from 0,0 on; relative to the scene file",
    )

    @property
    def rows(self) -> Curve:
        """Strain and tension (N).  Only after validation: the file is readable then."""
        return _from_file(self.file)

    def _check_readable(self) -> Findings:
        return unreadable(self.file, lambda: self.rows)


@read_once(16)
def _from_file(path: str) -> Curve:
    """Rows of a file; RecordRefused."""
    name = os.path.basename(path)
    header, table, lines = read_table(path, columns_of(COLUMNS))
    at = [header.index(x) for x in COLUMNS]
    rows = tuple((float(x), float(y)) for x, y in table[:, at])
    for found in _findings(rows):
        where = f"{name}, line {lines[int(found.at[0])]}" if found.at else name
        given = found.given or ", ".join(f"{x:g}" for x in rows[int(found.at[0])])
        raise RecordRefused(found.expected, found.fix, f"{where}: {given}")
    return rows


TensionStrain = Annotated[
    Annotated[tuple[Pair, ...], Tag("<value>")] | Annotated[CurveFile, Tag("<table>")], Discriminator(value_or_table)
]


class DynamicStiffness(Table):
    """Stiffness of a fibre rope against changes of tension faster than its relaxation.

    It is constant + per_tension x mean tension. What is slower follows axial_stiffness, or tension_strain.
    """

    constant: Positive = Field(description="dynamic stiffness without mean tension, above the static one [N]")
    per_tension: NonNegative = Field(default=0.0, description="by how much it grows with the mean tension: N per N [-]")
    relaxation_time: Positive = Field(
        description="time over which tension is averaged, and the rope creeps to its static strain: long beside waves, "
        "short beside a storm [s]"
    )


class Creep(Table):
    """Strain that a rope under load gains in time, per_decade x log10(1 + t/loaded), t counted from the start."""

    per_decade: Positive = Field(description="strain gained in a tenfold time under load [-]")
    loaded: Positive = Field(description="for how long it has been under load at the start [s]")


def rows_of(given: tuple[tuple[float, float], ...] | CurveFile) -> Curve:
    """The rows of a table, given or in a file."""
    return given.rows if isinstance(given, CurveFile) else given


def refuse_rows(given: tuple[tuple[float, float], ...] | CurveFile, key: str) -> None:
    """Refuse a table, given under a key, that is no rising curve from [0, 0] on."""
    if not isinstance(given, CurveFile):
        refuse(Finding((key, *x.at), x.expected, x.fix, x.given) for x in _findings(given))


def bending_findings(rows: Curve) -> list[Finding]:
    """What is wrong with a table of curvature and moment."""
    if len(rows) < 2:
        expected = "at least two rows [curvature, moment]"
        return [Finding((), expected, "one number is bending_stiffness", f"{len(rows)} rows")]
    if tuple(rows[0]) != (0.0, 0.0):
        fix = "begin with [0, 0]: curvature is counted from that without moment, and is the same to either side"
        return [Finding((0,), "no moment without curvature, [0, 0]", fix)]
    for k, ((x, M), (y, N)) in enumerate(pairwise(rows), start=1):
        if not y > x:
            expected = f"a curvature above that of the row before, {x:g} 1/m"
            return [Finding((k, 0), expected, "sort the rows; curvature comes first")]
        if not N > M:
            expected = f"a moment above that of the row before, {M:g} N m"
            return [Finding((k, 1), expected, "sort the rows; a line that softens until it gives way has no answer")]
    return []


def first_loading_findings(rows: Curve | None) -> list[Finding]:
    """What is wrong with a table of curvature and moment as one of a first loading."""
    if rows is None:
        fix = "give its rows, or leave first_loading out"
        return [Finding(("moment_curvature",), "rows [curvature, moment], because first_loading is true", fix)]
    for k, (a, b) in enumerate(pairwise(slopes(rows)), start=1):
        if not b < a:
            expected = f"a slope behind it below the one before, {a:g} N m^2, because first_loading is true"
            fix = "layers that slip soften it; leave rows out on a straight line, or leave first_loading out"
            return [Finding(("moment_curvature", k), expected, fix)]
    if len(rows) < 3:
        return [Finding(("moment_curvature",), "three rows or more: at the second, a layer slips", "add a row")]
    return []


class SlipLayer(Table):
    """A layer that slips as the section bends: elastic until its moment is the slip moment, which it then keeps."""

    stiffness: Positive = Field(description="bending stiffness that it adds while it sticks [N m^2]")
    moment: NonNegative = Field(default=0.0, description="slip moment without tension [N m]")
    per_tension: NonNegative = Field(
        default=0.0,
        description="by how much the slip moment grows with tension, that at the start of a step [N m per N]",
    )

    def _check_bears(self) -> Findings:
        if self.moment == self.per_tension == 0.0:
            expected = "a number > 0, in N m, or per_tension: a layer without slip moment does nothing"
            yield [Finding(("moment",), expected, "add `moment: ...` (N m)")]


# Of a layer: stiffness, N m^2; slip moment, N m; what this, and then what stiffness gains by tension, m and m^2.
Layer = tuple[float, float, float, float]


def layers_of(rows: Curve) -> tuple[Layer, ...]:
    """Layers whose first loading is a table of moment (N m) over curvature (1/m).

    What the last piece of the table has from straight on is no part of them (Masing).
    """
    steps = zip(pairwise(slopes(rows)), rows[1:], strict=False)
    return tuple((a - b, (a - b) * x, 0.0, 0.0) for (a, b), (x, _) in steps)


def slopes(rows: Curve) -> list[float]:
    """Stiffness (N) of each piece of a table."""
    return [(U - T) / (y - x) for (x, T), (y, U) in pairwise(rows)]


def stiffened(rows: Curve, beyond: float, stiffness: float) -> Curve:
    """A table of moment (N m) over curvature with a stiffness (N m^2) more from a curvature on (1/m)."""
    last = rows[-1][0]
    at = sorted({*(x for x, _ in rows), beyond, *([2.0 * beyond] if beyond >= last else [])})
    return tuple((x, interpolated(rows, x) + stiffness * max(x - beyond, 0.0)) for x in at)


def interpolated(rows: Curve, x: float, over_tension: bool = False) -> float:
    """Tension (N) at a strain; or the strain at a tension.  Beyond the table its last piece goes on."""
    a, b = (1, 0) if over_tension else (0, 1)
    k = min(max(bisect_right([row[a] for row in rows], x) - 1, 0), len(rows) - 2)
    low, high = rows[k], rows[k + 1]
    return low[b] + (x - low[a]) * (high[b] - low[b]) / (high[a] - low[a])


# Polyester rope whose tension over strain depends on the highest mean tension that it has had (the Syrope model).

Floats = NDArray[np.float64]
# Of exponential working curves: from this k2 on the last fiftieth of the way has most of the tension.
STEEPEST = 50.0
# Highest tensions to a piece of the original curve, and places on a working curve, at which it is judged.
TRIED, PLACES = 21, 101


class Syrope(Table):
    """Tension over strain at rest of polyester (Syrope).

    It is the original curve while the mean tension is the highest so far, below it a working curve that ends there;
    needs dynamic_stiffness, which says what a mean tension is.
    """

    curve: TensionStrain = Field(
        description="original curve, of a rope that is loaded for the first time: rows [strain, tension in N] from "
        "[0, 0] on, both rising; or {file: owc.csv} [-, N]"
    )
    working: Literal["linear", "quadratic", "exponential"] = Field(
        description="shape of working curves: tension over the highest is x, or x (k2 x + 1 - k2), or (exp(k2 x) - 1)/"
        "(exp(k2) - 1), with x the part of the way from the strain without tension to that of the highest tension"
    )
    k1: NonNegative = Field(
        description="strain without tension over that of the highest tension, below 1; of linear ones also, from 1 on, "
        "their stiffness in N [-]"
    )
    k2: Positive | None = Field(
        default=None, description="of quadratic ones, up to 1, and of exponential ones; linear ones have none [-]"
    )
    highest_tension: Positive = Field(
        description="highest mean tension that the rope has had before the start; at rest under more, it is that [N]"
    )

    def _check_shape(self) -> Findings:
        refuse_rows(self.curve, "curve")
        found, straight = [], self.working == "linear"
        if not straight and self.k1 >= 1.0:
            found.append(Finding(("k1",), "a part below 1", "only linear working curves have a stiffness there"))
        if straight and self.k2 is not None:
            found.append(Finding(("k2",), "nothing, because linear working curves have one number", "leave it out"))
        if not straight and self.k2 is None:
            found.append(Finding(("k2",), f"a number, of {self.working} working curves", "add `k2: ...`"))
        most = 1.0 if self.working == "quadratic" else STEEPEST
        if not straight and self.k2 is not None and self.k2 > most:
            found.append(Finding(("k2",), f"at most {most:g}", "are k1 and k2 exchanged?"))
        last = self.rows[-1][1]
        if self.highest_tension > last:
            expected = f"at most the tension of the last row of curve, {last:g} N"
            found.append(Finding(("highest_tension",), expected, "add rows up to what the rope bears"))
        yield found

    @property
    def rows(self) -> Curve:
        """Strain and tension (N) of the original curve."""
        return rows_of(self.curve)

    @property
    def by_stiffness(self) -> bool:
        """Whether k1 is the stiffness of working curves, N."""
        return self.working == "linear" and self.k1 >= 1.0

    def shape(self, x: Floats) -> tuple[Floats, Floats, float]:
        """Parts of the highest tension at the parts x of the way, their slopes, and the area below the whole shape."""
        k = self.k2 or 0.0
        if self.working == "quadratic":
            return x * (k * x + 1.0 - k), 2.0 * k * x + 1.0 - k, 0.5 - k / 6.0
        if self.working == "exponential":
            grown = float(np.expm1(k))
            return np.expm1(k * x) / grown, k * np.exp(k * x) / grown, 1.0 / k - 1.0 / grown
        return x, np.ones_like(x), 0.5

    def compliance(self, mean: float) -> float:
        """Strain by tension, 1/N, at rest under a mean tension, N, up to highest_tension, on the working curve."""
        strain = interpolated(self.rows, self.highest_tension, over_tension=True)
        x = np.linspace(0.0, 1.0, 10 * PLACES)
        parts, slope, _ = self.shape(x)
        at = float(np.interp(mean / self.highest_tension, parts, slope))
        return self._way(np.array([self.highest_tension]), np.array([strain]))[0] / (self.highest_tension * at)

    def _way(self, highest: Floats, strain: Floats) -> Floats:
        """Strains that working curves cover below highest tensions (N) at these strains."""
        return highest / self.k1 if self.by_stiffness else (1.0 - self.k1) * strain

    def first_fault(self, dynamic: DynamicStiffness) -> tuple[int, Finding] | None:
        """What is wrong beside a dynamic stiffness, and the row of `curve` at which that piece begins.

        At any highest tension: it is less than a static one; a working curve gives back more than the original one took
        up.
        """
        parts, slope, area = self.shape(np.linspace(0.0, 1.0, PLACES))
        for row, highest, strain, stiffness in self._pieces():
            way = self._way(highest, strain)
            widens = 1.0 / self.k1 if self.by_stiffness else (1.0 - self.k1) / stiffness
            if (bad := way > strain * (1.0 + 1e-9)).any():
                expected = f"more than {(highest / strain).max():.6g} N: working curves begin at strains from 0 on"
                fix = f"found with a highest tension of {highest[bad][0]:.6g} N"
                return row, Finding(("syrope", "k1"), expected, fix)
            static = np.maximum(highest[:, None] / way[:, None] * slope, stiffness)
            fast = dynamic.constant + dynamic.per_tension * highest[:, None] * parts
            if not (static < fast).all():
                worst = int(np.argmax((static / fast).max(axis=1)))
                most = static[worst].max()
                expected = f"more: the static stiffness is {most:.6g} N once the mean was {highest[worst]:.6g} N"
                return row, Finding(("dynamic_stiffness", "constant"), expected, _SOFTER)
            if (gains := highest / stiffness < (1.0 - 1e-9) * area * (way + highest * widens)).any():
                expected = f"tensions up to {highest[gains][0]:.6g} N: beyond, it would give back more than it took up"
                fix = "leave out the rows beyond, or choose a larger part k1"
                return row, Finding(("syrope", "curve"), expected, fix)
        return None

    def _pieces(self) -> list[tuple[int, Floats, Floats, float]]:
        """Pieces of the original curve that may be reached.

        Of each its first row; highest tensions (N), strains there, its stiffness (N).
        """
        found = []
        for row, ((x, T), (y, U)) in enumerate(pairwise(self.rows)):
            if self.highest_tension <= U:
                stiffness = (U - T) / (y - x)
                highest = np.linspace(max(T, self.highest_tension), U, TRIED)
                found.append((row, highest, x + (highest - T) / stiffness, stiffness))
        return found


def syrope_of(given: dict[str, Any]) -> Syrope | str:
    """The table of these keys, or what is wrong with the first of them."""
    try:
        return Syrope.model_validate(given)
    except ValidationError as error:
        return str(error.errors()[0]["msg"])


_SOFTER = (
    "a rope answers stiffer to what is fast; working curves are flatter with a smaller k1 or k2, or once the rope has "
    "had a higher highest_tension"
)
