"""Motion of a vessel in waves: amplitudes and phases (RAO, a CSV table or a dataset of Capytaine), and the harmonics of
a point of the vessel.

    symbol   meaning                                                           unit
    A, w, k  amplitude, angular frequency, wave vector of a wave               m, 1/s, 1/m
    phi      phase of its crest at the origin of the vessel: crest at w t = phi  rad
    X, Q     response per metre, complex: surge, sway, heave; roll, pitch, yaw  -, rad/m
    p        the point in axes of the vessel                                   m

A degree of freedom with amplitude a and phase lag b moves as a A cos(w t - phi - b): a positive phase comes after the
crest.  To first order in the angles, as RAOs are, a point moves by X + Q x p in axes of the vessel (x to the bow, y to
port, z up, right-handed), which stand at `heading` from the inertial x axis.
"""

from __future__ import annotations

import math
from functools import lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from hybrid.scene.motion_file import RecordRefused, check_file, read_table
from hybrid.scene.motion_tables import SHIFTS, TURNS, Drift
from hybrid.scene.rao_dataset import is_dataset, read_dataset

FREEDOMS = (*SHIFTS, *TURNS)
COLUMNS = ("frequency", "heading", *FREEDOMS, *(f"{name}_phase" for name in FREEDOMS))
# deg, of a wave direction: round-off of a heading.
SAME_HEADING = 1e-6


def read_rao(path: str) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.complex128]]:
    """Frequencies (F,) rad/s, headings (H,) deg, and the response (F, H, 6) per metre (m, rad).  RecordRefused."""
    check_file(path)
    status = Path(path).stat()
    return _read(path, status.st_mtime_ns, status.st_size)


@lru_cache(maxsize=4)
def _read(
    path: str, _changed: int, _size: int
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.complex128]]:
    if is_dataset(path):
        return read_dataset(path)
    name = Path(path).name
    header, table, lines = read_table(path, _checked_header)
    if not lines:
        raise RecordRefused("a row for every frequency and heading", "add them", f"{name}, 0 rows")
    columns = {column: table[:, header.index(column)] for column in header}
    w, headings = columns["frequency"], columns["heading"]
    for bad in np.flatnonzero(w <= 0.0)[:1]:
        given = f"{name}, line {lines[bad]}: frequency = {w[bad]:g}"
        raise RecordRefused("frequencies > 0, in rad/s", "2 pi over the period", given)
    frequency, row = np.unique(w, return_inverse=True)
    heading, column = np.unique(headings, return_inverse=True)
    first = np.full((frequency.size, heading.size), -1)
    for k, (i, j) in enumerate(zip(row.tolist(), column.tolist(), strict=True)):
        if first[i, j] >= 0:
            given = f"{name}, line {lines[k]}: frequency and heading of line {lines[first[i, j]]} again"
            raise RecordRefused("one row for every frequency and heading", "drop one of them", given)
        first[i, j] = k
    for i, j in np.argwhere(first < 0)[:1]:
        given = f"{name}: no row for {frequency[i]:g} rad/s at {heading[j]:g} deg, {(first < 0).sum()} missing in all"
        raise RecordRefused("one row for every frequency and heading", "complete the table", given)
    response = np.zeros((frequency.size, heading.size, 6), complex)
    for k, freedom in enumerate(FREEDOMS):
        if freedom in columns:
            unit = math.pi / 180.0 if freedom in TURNS else 1.0
            lag = np.radians(columns.get(f"{freedom}_phase", np.zeros(len(w))))
            response[row, column, k] = unit * columns[freedom] * np.exp(-1j * lag)
    return frequency, heading, response


def _checked_header(name: str, header: list[str]) -> list[str]:
    moves = [x for x in FREEDOMS if x in header]
    without = [x for x in FREEDOMS if f"{x}_phase" in header and x not in header]
    complete = {"frequency", "heading"} <= set(header) <= set(COLUMNS) and len(set(header)) == len(header)
    if complete and moves and not without:
        return header
    odd = [x for x in header if x not in COLUMNS] or header
    expected = "columns frequency (rad/s), heading (deg), of surge, sway, heave (m/m), roll, pitch, yaw (deg/m) those "
    expected += "that there are, with surge_phase and the like (deg behind the crest)"
    raise RecordRefused(expected, "name the columns in the first line", f"{name} with columns {', '.join(odd)[:60]}")


def point_harmonics(
    path: str, waves: NDArray[np.float64], origin: NDArray[np.float64], heading: float, point: NDArray[np.float64]
) -> list[tuple[int, float, float, float]]:
    """Harmonics (axis, amplitude, angular frequency, phase) of a point of the vessel in waves; 3 to 5: its turns.

    waves: (J, 6) amplitude (m), frequency (1/s), wave vector (1/m), phase (rad), wave number (1/m); origin, point: (3,)
    m, inertial, at rest; heading: deg.  RecordRefused: the table does not cover frequencies or directions of the waves.
    """
    frequency, headings, response = read_rao(path)
    name, out = Path(path).name, []
    A, w = waves[:, 0], waves[:, 1]
    towards = np.degrees(np.arctan2(waves[:, 3], waves[:, 2]))
    relative = (towards - heading + SAME_HEADING) % 360.0 - SAME_HEADING
    near = 1e-9 * frequency[-1]
    if w.min() < frequency[0] - near or w.max() > frequency[-1] + near:
        given = f"{name} from {frequency[0]:.4g} to {frequency[-1]:.4g} rad/s"
        fix = "add rows: zero where the waves do not move the vessel, 1 for surge and heave of very long waves"
        raise RecordRefused(f"frequencies from {w.min():.4g} to {w.max():.4g} rad/s, those of the waves", fix, given)
    low, high = headings[0] - SAME_HEADING, headings[-1] + SAME_HEADING
    if relative.min() < low or relative.max() > high:
        given = f"{name} with headings from {headings[0]:g} to {headings[-1]:g} deg"
        expected = f"the heading {relative.min():.6g} deg, the direction of the waves against that of the vessel"
        fix = "add rows, such as those mirrored at the x axis: sway, roll and yaw change sign"
        raise RecordRefused(expected, fix, given)
    i = np.clip(np.searchsorted(frequency, w) - 1, 0, max(frequency.size - 2, 0))
    j = np.clip(np.searchsorted(headings, relative) - 1, 0, max(headings.size - 2, 0))
    x, i1 = _part(frequency, i, w)
    y, j1 = _part(headings, j, relative)
    below, above = ((1 - y) * response[k, j] + y * response[k, j1] for k in (i, i1))
    H = (1 - x) * below + x * above
    phi = waves[:, 2] * origin[0] + waves[:, 3] * origin[1] + waves[:, 4]
    H = H * (A * np.exp(-1j * phi))[:, None]
    c, s = math.cos(math.radians(heading)), math.sin(math.radians(heading))
    turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    shift, angle = H[:, :3] @ turn.T, H[:, 3:] @ turn.T  # inertial
    moved = np.concatenate([shift + np.cross(angle, point - origin), angle], axis=1)
    for axis in range(6):
        for z, omega in zip(moved[:, axis].tolist(), w.tolist(), strict=True):
            if z != 0.0:
                out.append((axis, abs(z), omega, math.atan2(z.imag, z.real) + 0.5 * math.pi))
    return out


def drift_harmonics(
    drift: Drift, origin: NDArray[np.float64], heading: float, point: NDArray[np.float64]
) -> list[tuple[int, float, float, float]]:
    """Harmonics of a point of the vessel by its slow motion; arguments and result as of `point_harmonics`."""
    c, s = math.cos(math.radians(heading)), math.sin(math.radians(heading))
    axes, out = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]]), []
    for name, listed in drift.harmonics().items():
        axis = axes[FREEDOMS.index(name) % 3]
        unit = np.concatenate([axis, np.zeros(3)])
        if name in TURNS:
            unit = math.radians(1.0) * np.concatenate([np.cross(axis, point - origin), axis])
        for h in listed:
            w, phase = 2.0 * math.pi / h.period, math.radians(h.phase)
            out += [(k, h.amplitude * x, w, phase) for k, x in enumerate(unit.tolist()) if h.amplitude * x != 0.0]
    return out


def _part(
    nodes: NDArray[np.float64], i: NDArray[np.int64], at: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """How far between node i and the next values lie, (J, 1), and the next node."""
    after = np.minimum(i + 1, nodes.size - 1)
    width = nodes[after] - nodes[i]
    part = np.where(width > 0.0, (at - nodes[i]) / np.where(width > 0.0, width, 1.0), 0.0)
    return np.clip(part, 0.0, 1.0)[:, None], after
