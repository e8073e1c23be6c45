"""Motion of a vessel in waves by its RAOs, and the harmonics of a point of the vessel.

RAOs are a CSV table or a dataset of Capytaine.

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
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hybrid.scene.motion_file import RecordRefused, check_file, netcdf_reader, read_table
from hybrid.scene.motion_tables import SHIFTS, TURNS, Drift

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


# Response of a vessel to waves from a dataset of Capytaine, in netCDF: its RAO, or what it follows from.
#
#     symbol   meaning                                                                    unit
#     w, b     angular frequency, direction in which the waves run                        1/s, rad
#     M, A     mass and added mass of the six rigid degrees of freedom                    kg, kg m, kg m^2
#     B, K     radiation damping, hydrostatic stiffness
#     F, X     excitation by a wave of 1 m, response to it                                N, N m; m, rad
#
# In Capytaine x(t) = Re(X exp(-i w t)), and the crest of the wave is at the origin at t = 0.  A velocity is -i w X, so
#
#     (-w^2 (M + A) - i w B + K) X = F
#
# A response that lags by arg X behind the crest is conj(X) in kernels of this package, where it is exp(-i lag).

NETCDF = (".nc", ".nc4", ".netcdf")
# What the response follows from, beside the excitation.
NEEDED = ("added_mass", "radiation_damping", "hydrostatic_stiffness")
WHY = "a dataset of Capytaine with `rao`, or with added_mass, radiation_damping, hydrostatic_stiffness, inertia_matrix "
WHY += "and excitation_force (or Froude_Krylov_force and diffraction_force)"


def read_dataset(path: str) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.complex128]]:
    """Frequencies (F,) rad/s, headings (H,) deg, and the response (F, H, 6) per metre (m, rad).  RecordRefused."""
    xarray = netcdf_reader(Path(path).name)
    try:
        with xarray.open_dataset(path) as opened:
            data = opened.load()
    except Exception as error:  # each of its back ends has errors of its own
        raise RecordRefused("a netCDF file", WHY, f"{Path(path).name}: {str(error).splitlines()[0]:.80}") from None
    return _response(data, Path(path).name)


def _response(data: Any, name: str) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.complex128]]:
    """What `read_dataset` returns, of a dataset that is open."""
    missing = [x for x in ("omega", "wave_direction", "radiating_dof") if x not in data.coords]
    if missing:
        raise RecordRefused("coordinates omega, wave_direction and radiating_dof", WHY, f"{name} without {missing[0]}")
    along = str(data["omega"].dims[0]) if data["omega"].dims else ""
    if data["omega"].ndim != 1 or data["wave_direction"].ndim != 1:
        raise RecordRefused("several frequencies and directions", WHY, f"{name} with one of them")
    data = data.assign_coords({along: np.arange(data.sizes[along])}) if along != "omega" else data
    omega = np.array(data["omega"].values, float)
    good = np.flatnonzero(np.isfinite(omega) & (omega > 0.0))
    if not good.size:
        raise RecordRefused("frequencies > 0", WHY, f"{name} without any")
    moving = _columns(data["radiating_dof"].values, name)
    response = next((data[x] for x in ("rao", "RAO") if x in data), None)
    if response is not None:
        given = _complex(response).transpose(along, "wave_direction", "radiating_dof").values[good]
    else:
        given = _solved(data, along, name)[good]
    X = np.zeros((good.size, data.sizes["wave_direction"], 6), complex)
    for column, freedom in moving.items():
        X[:, :, freedom] = np.conj(given[:, :, column])
    headings = np.degrees(np.array(data["wave_direction"].values, float))
    if not np.isfinite(X).all():
        at = omega[good][np.flatnonzero(~np.isfinite(X).all(axis=(1, 2)))[0]]
        raise RecordRefused("a response at every frequency and direction", WHY, f"{name}: none at {at:.4g} rad/s")
    rows, columns = np.argsort(omega[good]), np.argsort(headings)
    return omega[good][rows], headings[columns], X[rows][:, columns]


def _columns(names: Any, file: str) -> dict[int, int]:
    """Degree of freedom (0 to 5) by its place among those of the dataset; all must be of one body."""
    found: dict[int, int] = {}
    bodies = set()
    for k, each in enumerate(map(str, np.atleast_1d(names))):
        body, _, freedom = each.rpartition("__")
        bodies.add(body)
        if freedom.lower() not in FREEDOMS:
            raise RecordRefused(f"degrees of freedom {', '.join(FREEDOMS)}", WHY, f"{file} with {each:.40}")
        found[k] = FREEDOMS.index(freedom.lower())
    if len(bodies) > 1 or len(set(found.values())) < len(found):
        fix = "select one with dataset.sel(radiating_dof=[...], influenced_dof=[...])"
        raise RecordRefused("the degrees of freedom of one body", fix, f"{file} with several")
    return found


def _complex(values: Any) -> Any:
    """Complex values, which Capytaine writes as real and imaginary parts along a dimension `complex`."""
    if "complex" not in values.dims:
        return values
    return values.sel(complex="re", drop=True) + 1j * values.sel(complex="im", drop=True)


def _solved(data: Any, along: str, name: str) -> NDArray[np.complex128]:
    """The response (F, H, D) of the equation of motion, D the degrees of freedom of the dataset."""
    mass = next((data[x] for x in ("inertia_matrix", "mass") if x in data), None)
    lacking = [x for x in NEEDED if x not in data] + ["inertia_matrix"] * (mass is None)
    parts = ("excitation_force",) if "excitation_force" in data else ("Froude_Krylov_force", "diffraction_force")
    lacking += [x for x in parts if x not in data]
    if lacking:
        raise RecordRefused(f"the variable {lacking[0]}, or `rao`", WHY, f"{name} without {', '.join(lacking)}")
    w = data["omega"]
    A = (mass + data["added_mass"]) * (-(w**2)) + data["hydrostatic_stiffness"] - 1j * w * data["radiation_damping"]
    F = sum(_complex(data[x]) for x in parts)
    matrix = A.transpose(along, "influenced_dof", "radiating_dof").values
    try:
        found = np.linalg.solve(matrix, F.transpose(along, "influenced_dof", "wave_direction").values)
    except np.linalg.LinAlgError:
        raise RecordRefused("a body that something holds or that has mass", WHY, f"{name}: no response") from None
    return np.asarray(np.swapaxes(found, 1, 2), complex)


def is_dataset(path: str) -> bool:
    """Whether a file is netCDF, by its name."""
    return Path(path).suffix.lower() in NETCDF
