"""Polyester rope whose tension over strain depends on the highest mean tension that it has had (the Syrope model)."""

from __future__ import annotations

from itertools import pairwise
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, ValidationError, model_validator

from hybrid.scene.base import Finding, NonNegative, Positive, Table, refuse
from hybrid.scene.stretch import Curve, DynamicStiffness, TensionStrain, interpolated, refuse_rows, rows_of

Floats = NDArray[np.float64]
# Of exponential working curves: from this k2 on the last fiftieth of the way has most of the tension.
STEEPEST = 50.0
# Highest tensions to a piece of the original curve, and places on a working curve, at which it is judged.
TRIED, PLACES = 21, 101


class Syrope(Table):
    """Tension over strain at rest of polyester: the original curve while the mean tension is the highest so far, below

    it a working curve that ends there; needs dynamic_stiffness, which says what a mean tension is.
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

    @model_validator(mode="after")
    def _shape(self) -> Syrope:
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
        refuse(found)
        return self

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
        """What is wrong beside a dynamic stiffness, at any highest tension, and the row of `curve` at which that piece

        begins: that it is less than a static one; that a working curve gives back more than the original one took up.
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
        """Of each piece of the original curve that may be reached: its first row; highest tensions (N), strains there,

        its stiffness (N).
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
