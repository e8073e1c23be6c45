"""How long a line that is paid out is when: the length over time, as polynomials, and what is asked of it."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import NoReturn

import numpy as np

from hybrid.errors import Complaint, SceneError
from hybrid.kernels.state.state import Floats
from hybrid.scene.payout import Payout

# Of the length of the cable: as much may the first one given differ from it, by round-off.
SAME_LENGTH = 1e-9


@contextmanager
def said_of_line(name: str) -> Iterator[None]:
    """What is refused within of how a line is paid out is said of its connection, if it has a name."""
    try:
        yield
    except SceneError as error:
        at = f"lines.{name}.connections." if name else "ends."
        raise SceneError([replace(x, where=re.sub(r"^ends\.", at, x.where)) for x in error.complaints]) from None


def refuse(where: str, given: str, expected: str, fix: str) -> NoReturn:
    raise SceneError([Complaint(where, given, expected, fix)])


def _rows(rows: list[tuple[float, list[float]]]) -> Floats:
    """(K, 8) rows from times and coefficients, highest power first, of any number."""
    out = np.zeros((len(rows), 8))
    for k, (t, c) in enumerate(rows):
        out[k, 0] = t
        out[k, 8 - len(c) :] = c
    return out


def law_of(payout: Payout, length: float, duration: float, where: str = "payout") -> Floats:
    """The length, m, that is out over time, as polynomials: (K, 8) as of kernels.reel.payout.Reel.

    length: m, at t = 0; duration: s, of the motion; where: the key in the scene, for messages.
    """
    if payout.rate is not None:
        return _law_of_rate(payout, length)
    if payout.file is not None:
        payout = payout.model_copy(update=_rows_of(payout.file, length, where))
    if payout.rates is not None:
        return _law_of_rates(np.array(payout.rates, float), length, duration)
    if payout.lengths is not None:
        return _law_of_lengths(np.array(payout.lengths, float), length, where)
    return _rows([(0.0, [length])])


def _rows_of(path: str, length: float, where: str) -> dict[str, Floats]:
    """Rates or lengths over time of a file, by their key in the scene; length: m, at t = 0."""
    from hybrid.scene.motion_file import RecordRefused, check_file, read_table

    name = Path(path).name

    def checked(_: str, header: list[str]) -> list[str]:
        if sorted(header) not in (["rate", "t"], ["length", "t"]):
            given = f"{name} with columns {', '.join(header)[:60]}"
            raise RecordRefused("columns t,rate or t,length", "name the columns in the first line of the file", given)
        return header

    try:
        check_file(path)
        header, table, lines = read_table(path, checked)
    except RecordRefused as refused:
        found = refused.finding
        refuse(f"{where}.file", found.given or name, found.expected, found.fix)
    key, rows = ("rates", 2) if "rate" in header else ("lengths", 3)
    t, x = table[:, header.index("t")], table[:, 1 - header.index("t")]
    if len(t) < rows:
        refuse(f"{where}.file", f"{name}, {len(t)} rows", f"at least {rows} rows", "sample more finely")
    for k in np.flatnonzero(np.diff(t) <= 0.0)[:1]:
        given = f"{name}, line {lines[k + 1]}: t = {t[k + 1]:.9g} after t = {t[k]:.9g}"
        refuse(f"{where}.file", given, "times that increase strictly", "sort the rows and drop duplicates")
    if t[0] != 0.0 or (key == "rates" and x[0] != 0.0):
        expected = "a first row at t = 0" + (" with rate 0, because the line is at rest" if key == "rates" else "")
        refuse(f"{where}.file", f"{name}, line {lines[0]}: t = {t[0]:.9g}, {x[0]:.9g}", expected, "add that row")
    if key == "lengths":
        for k in np.flatnonzero(x <= 0.0)[:1]:
            refuse(f"{where}.file", f"{name}, line {lines[k]}: length = {x[k]:.9g}", "lengths > 0, in m", "correct it")
        if abs(x[0] - length) > SAME_LENGTH * length:
            given, expected = f"{name}, line {lines[0]}: length = {x[0]:.9g}", f"{length:.9g} m, that of the cable"
            refuse(f"{where}.file", given, expected, "the same length at t = 0, in m")
    return {key: np.column_stack([t, x])}


def _law_of_rate(payout: Payout, length: float) -> Floats:
    """A rate that grows with the ramp, and ends with it."""
    rate, T, begin = payout.rate or 0.0, payout.ramp or 1.0, payout.begin
    grows = [rate / T**5, -3.0 * rate / T**4, 2.5 * rate / T**3, 0.0, 0.0, 0.0]
    rows = [(0.0, [length]), (begin, [*grows, length]), (begin + T, [rate, length + 0.5 * rate * T])]
    if payout.until is not None:
        out = length + rate * (payout.until - begin - 0.5 * T)
        ends = [-x for x in grows[:-1]]
        rows.append((payout.until, [*ends, rate, out]))
        rows.append((payout.until + T, [out + 0.5 * rate * T]))
    return _rows(rows)


def _law_of_rates(table: Floats, length: float, duration: float) -> Floats:
    """Rates at times, a cubic spline between them; beyond the last it is constant."""
    from scipy.interpolate import CubicSpline  # slow to import

    t, c = table.T
    spline = CubicSpline(t, c, bc_type=("natural", (1, 0.0) if t[-1] < duration else "natural"))
    way = spline.antiderivative()
    rows = [(float(x), [*a[:-1].tolist(), float(a[-1]) + length]) for x, a in zip(way.x, way.c.T, strict=False)]
    return _rows([*rows, (float(t[-1]), [float(c[-1]), float(way(t[-1])) + length])])


def _law_of_lengths(table: Floats, length: float, where: str) -> Floats:
    """Lengths at times, a spline of fifth degree between them, which begins and ends without rate and acceleration."""
    from scipy.interpolate import PPoly, make_interp_spline

    t, out = table.T
    if abs(out[0] - length) > SAME_LENGTH * length:
        given, expected = f"{out[0]:.9g} m at t = 0", f"{length:.9g} m, the length of the cable"
        refuse(f"{where}.lengths", given, expected, "the same length")
    rest = [(1, 0.0), (2, 0.0)]
    spline = PPoly.from_spline(make_interp_spline(t, out, k=5, bc_type=(rest, rest)))
    pieces = [(float(x), a.tolist()) for x, y, a in zip(spline.x[:-1], spline.x[1:], spline.c.T, strict=True) if y > x]
    return _rows([*pieces, (float(t[-1]), [float(out[-1])])])


def length_at(law: Floats, t: float) -> tuple[float, float, float]:
    """Length (m) that is out at t (s), its rate (m/s) and the rate of that (m/s2), just before t where it jumps."""
    row = law[max(int(np.searchsorted(law[:, 0], t)) - 1, 0)].tolist()
    x, value, rate, twice = max(t - row[0], 0.0), 0.0, 0.0, 0.0
    for c in row[1:]:
        twice = twice * x + 2.0 * rate
        rate = rate * x + value
        value = value * x + c
    return value, rate, twice


def fastest(law: Floats) -> float:
    """Largest size of the rate, m/s, that a law of length has."""
    last = float(law[-1, 0])
    t = np.unique(np.concatenate([np.linspace(0.0, last + 1.0, 501), law[:, 0], law[:, 0] + 1e-9 * (last + 1.0)]))
    return float(np.abs(lengths_at(law, t)[1]).max())


def lengths_at(law: Floats, t: Floats) -> tuple[Floats, Floats]:
    """Lengths (n,) m that are out at times t (n,) s, and their rates, m/s, just before t where they jump."""
    rows = law[np.maximum(np.searchsorted(law[:, 0], t) - 1, 0)]
    x, value, rate = np.maximum(t - rows[:, 0], 0.0), np.zeros(t.size), np.zeros(t.size)
    for c in rows.T[1:]:
        rate = rate * x + value
        value = value * x + c
    return value, rate


def least_length(law: Floats, length: float) -> float:
    """Shortest length, m, at any time, also beyond the end of a run, so that a resumed run has the same nodes."""
    last = float(law[-1, 0])
    return -np.inf if law[-1, 1:7].min() < 0.0 else extremes(law, length, last)[0]


def extremes(law: Floats, length: float, duration: float) -> tuple[float, float]:
    """Shortest and longest length, m, up to a time, s."""
    t = np.unique(np.concatenate([np.linspace(0.0, duration, 2001), law[(law[:, 0] <= duration), 0]]))
    found, _ = lengths_at(law, t)
    return float(min(found.min(), length)), float(max(found.max(), length))
