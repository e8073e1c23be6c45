"""Fatigue damage: cycles by rainflow, curves of ranges and cycles, Miner's sum, life.

Cycles are those of ASTM E1049 (the package rainflow counts them).  Curves are rows of fatigue_curves.csv or the user's
own.  A stress is what the user makes of tension and curvature: `stress_of` for a simple section.  Damage of Gaussian
processes from their spectra, narrow-band and by Dirlik's formula (Application of computers in fatigue analysis, thesis,
Warwick 1985), is what counted damage is compared with.
"""

from __future__ import annotations

import csv
import math
from collections.abc import Iterable, Mapping
from functools import cache
from importlib.resources import files
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hybrid.errors import ResultError, optional_package
from hybrid.statistics.moments import Spectrum

Floats = NDArray[np.float64]

YEAR = 365.25 * 86400.0  # s
# m: plate thickness to which S-N curves refer.
REFERENCE_THICKNESS = 0.025
LARGEST_SLOPE = 20.0  # m of a curve: a larger one is refused
# Part by which zero crossings over peaks fall short of 1, below which Dirlik's parts are round-off.
NARROW = 1e-6


class Curve(NamedTuple):
    """Cycles to failure N = 10^log_a range^-m, and beyond `knee` cycles 10^log_a2 range^-m2.

    kind: "S-N", ranges of stress in MPa, or "T-N", ranges of tension over the reference strength.  thickness: exponent
    k of the factor (thickness / 25 mm)^k on ranges of stress, for plates that are thicker.
    """

    name: str
    kind: str
    log_a: float
    m: float
    log_a2: float = math.nan
    m2: float = math.nan
    knee: float = math.inf
    thickness: float = 0.0
    source: str = ""

    def cycles(self, ranges: ArrayLike, thickness: float = REFERENCE_THICKNESS) -> Floats:
        """Cycles to failure (...) of ranges (...): MPa, or parts of the reference strength."""
        factor = max(thickness / REFERENCE_THICKNESS, 1.0) ** self.thickness
        size = np.asarray(ranges, float) * factor
        with np.errstate(divide="ignore"):
            number = 10.0**self.log_a * size**-self.m
            if math.isfinite(self.knee):
                number = np.where(number > self.knee, 10.0**self.log_a2 * size**-self.m2, number)
        return np.asarray(number)


@cache
def curves() -> Mapping[str, Curve]:
    """The curves that come with the package, by name."""
    text = files("hybrid.statistics").joinpath("fatigue_curves.csv").read_text(encoding="utf-8")
    rows = csv.DictReader(line for line in text.splitlines() if not line.startswith("#"))
    found = {}
    for row in rows:
        first, second = (row["log_a"], row["m"]), (row["log_a2"] or "nan", row["m2"] or "nan")
        a, b = (tuple(float(x) for x in pair) for pair in (first, second))
        rest = float(row["knee"] or "inf"), float(row["thickness"]), row["source"]
        found[row["name"]] = Curve(row["name"], row["kind"], a[0], a[1], b[0], b[1], *rest)
    return found


def curve_of(given: str | Mapping[str, float | str] | Curve) -> Curve:
    """A curve by its name, or by its numbers (kind, log_a, m, and log_a2, m2, knee of a second slope).

    ResultError for a name that is not known, or numbers that make no curve.
    """
    if isinstance(given, Curve):
        curve = given
    elif isinstance(given, str):
        if given not in curves():
            import difflib

            near = difflib.get_close_matches(given, curves(), 3, 0.3)
            hint = f"did you mean {' or '.join(near)}?" if near else f"it is one of {', '.join(curves())}"
            raise ResultError(f"no curve of fatigue is called '{given}'\n    try:      {hint}")
        return curves()[given]
    else:
        try:
            curve = Curve(**({"name": "given"} | dict(given)))  # type: ignore[arg-type]
        except TypeError as error:
            keys = ", ".join(Curve._fields)
            raise ResultError(f"a curve of fatigue has the keys {keys}\n    detail:   {error}") from None
    second = {name: getattr(curve, name) for name in ("log_a2", "m2", "knee")}
    if len(missing := [name for name, x in second.items() if not math.isfinite(x)]) in (1, 2):
        raise ResultError(
            f"a curve of fatigue without {', '.join(missing)}\n"
            "    expected: log_a2, m2 and knee of a second slope, or none of them"
        )
    slopes = [curve.m] + ([curve.m2] if math.isfinite(curve.knee) else [])
    if curve.kind not in ("S-N", "T-N") or not all(0.0 < m <= LARGEST_SLOPE for m in slopes):
        raise ResultError(
            f"kind = {curve.kind}, slopes {', '.join(f'{m:g}' for m in slopes)} are no curve of fatigue\n"
            f"    expected: kind S-N (MPa) or T-N (parts of the strength), slopes above 0, {LARGEST_SLOPE:g} at most"
        )
    return curve


def rainflow_cycles(x: ArrayLike) -> Floats:
    """Cycles (n, 3) of a history (nt,): range, mean, and count, 1 or a half."""
    package, turns = optional_package("rainflow", "counting cycles", "export"), turning_points(x)
    if turns.size == 2:  # a half cycle, which the package leaves out
        return np.array([[abs(turns[1] - turns[0]), turns.mean(), 0.5]])
    return np.array([c[:3] for c in package.extract_cycles(turns.tolist())]).reshape(-1, 3)


def turning_points(x: ArrayLike) -> Floats:
    """A history (nt,) at its first and last value and where it turns: its cycles are the same, and counted sooner."""
    values = np.asarray(x, float)
    values = values[np.concatenate([[True], np.diff(values) != 0.0])]
    rises = np.diff(values) > 0.0
    return values[np.concatenate([[True], rises[1:] != rises[:-1], [True]])] if values.size > 1 else values


def damage(
    x: ArrayLike,
    curve: str | Mapping[str, float | str] | Curve,
    scale: float = 1.0,
    thickness: float = REFERENCE_THICKNESS,
) -> Floats:
    """Miner's sum (...) of histories x (nt, ...); scale: MPa, or part of the strength, per unit of x."""
    law, values = curve_of(curve), np.asarray(x, float)
    if not np.all(np.isfinite(values)) or values.ndim == 0:
        raise ResultError("a history has values that are no finite numbers")
    flat = values.reshape(values.shape[0], -1)
    found = np.zeros(flat.shape[1])
    for k in range(flat.shape[1]):
        if np.ptp(flat[:, k]) > 0.0:
            cycles = rainflow_cycles(flat[:, k])
            found[k] = (cycles[:, 2] / law.cycles(cycles[:, 0] * scale, thickness)).sum()
    return found.reshape(values.shape[1:])


def life_in_years(damages: Iterable[ArrayLike], parts: Iterable[float], duration: float) -> Floats:
    """Life (...) in years of a line whose sea states do `damages` (...) in `duration` (s), for `parts` of the time.

    parts: of a scatter diagram, with sum 1 at most (what is missing does no damage); ResultError if they are none.
    """
    weights = np.asarray(list(parts), float)
    if not (np.all(weights >= 0.0) and 0.0 < weights.sum() <= 1.0 + 1e-9):
        raise ResultError(f"parts of the time have the sum {weights.sum():.6g}\n    expected: from 0 to 1 in all")
    rate = sum(w * np.asarray(d, float) for w, d in zip(weights, damages, strict=True)) / duration
    with np.errstate(divide="ignore"):
        return np.asarray(1.0 / (rate * YEAR))


def stress_of(tension: ArrayLike, bending: ArrayLike, area: float, outer_diameter: float, modulus: float) -> Floats:
    """Axial stress (...) of a simple section at its fibre that is bent most, MPa.

    tension: N, over `area` (m2); bending: curvature about one axis, 1/m, with sign; outer_diameter: m; modulus: Pa.
    """
    axial = np.asarray(tension, float) / area
    return np.asarray((axial + 0.5 * modulus * outer_diameter * np.asarray(bending, float)) * 1e-6)


def narrow_band_damage(spectrum: Spectrum, curve: Curve, duration: float) -> Floats:
    """Damage (...) in `duration` (s) of a Gaussian process whose ranges are Rayleigh-distributed."""
    m0, m2 = spectrum.moment(0), spectrum.moment(2)
    return np.asarray(np.sqrt(m2 / m0) * duration * _mean_damage(curve, np.sqrt(8.0 * m0), 2))


def dirlik_damage(spectrum: Spectrum, curve: Curve, duration: float) -> Floats:
    """Damage (...) in `duration` (s) of a Gaussian process by Dirlik's law of rainflow ranges."""
    m0, m1, m2, m4 = (spectrum.moment(n) for n in (0, 1, 2, 4))
    peaks, regular = np.sqrt(m4 / m2), m2 / np.sqrt(m0 * m4)
    centre = m1 / m0 * np.sqrt(m2 / m4)
    d1 = 2.0 * (centre - regular**2) / (1.0 + regular**2)
    r = (regular - centre - d1**2) / (1.0 - regular - d1 + d1**2)
    d2 = (1.0 - regular - d1 + d1**2) / (1.0 - r)
    d3 = 1.0 - d1 - d2
    q = np.maximum(1.25 * (regular - d3 - d2 * r) / d1, 0.0)
    mean = d1 * _mean_damage(curve, 2.0 * np.sqrt(m0) * q, 1)
    mean += d2 * _mean_damage(curve, np.sqrt(8.0 * m0) * np.abs(r), 2) + d3 * _mean_damage(curve, np.sqrt(8.0 * m0), 2)
    narrow = regular > 1.0 - NARROW
    return np.asarray(np.where(narrow, narrow_band_damage(spectrum, curve, duration), peaks * duration * mean))


def _mean_damage(curve: Curve, size: Floats, shape: int) -> Floats:
    """Damage (...) of a mean cycle, whose range over a size (...) exceeds y with the probability exp(-y^shape)."""
    k = curve.m / shape
    first = 10.0**-curve.log_a * size**curve.m * math.gamma(1.0 + k)
    if not math.isfinite(curve.knee):
        return first
    from scipy.special import gammainc, gammaincc

    k2 = curve.m2 / shape
    at = ((10.0**curve.log_a / curve.knee) ** (1.0 / curve.m) / size) ** shape
    second = 10.0**-curve.log_a2 * size**curve.m2 * math.gamma(1.0 + k2)
    return np.asarray(first * gammaincc(1.0 + k, at) + second * gammainc(1.0 + k2, at))
