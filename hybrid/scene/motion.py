"""Prescribed motion of an end or a vessel.

RAOs of a vessel in waves are a CSV table or a dataset of Capytaine.

    symbol   meaning                                                           unit
    A, w, k  amplitude, angular frequency, wave vector of a wave               m, 1/s, 1/m
    phi      phase of its crest at the origin of the vessel: crest at w t = phi  rad
    X, Q     response per metre, complex: surge, sway, heave; roll, pitch, yaw  -, rad/m
    p        the point in axes of the vessel                                   m

A degree of freedom with amplitude a and phase lag b moves as a A cos(w t - phi - b): a positive phase comes after the
crest.  To first order in the angles, as RAOs are, a point moves by X + Q x p in axes of the vessel (x to the bow, y
to port, z up, right-handed), which stand at `heading` from the inertial x axis.

Motion has to start from rest and stay smooth: `motion_checks` refuses what does not.

Symbols: A amplitude, w = 2 pi / period, p phase; ramp r(t) = 10 x^3 - 15 x^4 + 6 x^5 with
x = t / ramp (C2 at both ends), which multiplies a file as well; harmonic r(t) A sin(w t + p);
steady travel V times the integral of r; rotation R = Rz Ry Rx applied to the base frame;
eta(x, y, t) height of the surface above still water, followed where the end is.  Everything adds
up, in inertial axes, angles in radians inside, degrees in the scene.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hybrid.errors import Complaint, SceneError
from hybrid.scene.motion_file import (
    Record,
    RecordRefused,
    continuous,
    netcdf_reader,
    read_once,
    read_record,
    read_table,
    spline,
)
from hybrid.scene.motion_tables import SHIFTS, TURNS, Drift, Harmonic, Motion, Triple, Vessel, smooth_step

FREEDOMS = (*SHIFTS, *TURNS)
COLUMNS = ("frequency", "heading", *FREEDOMS, *(f"{name}_phase" for name in FREEDOMS))
# deg, of a wave direction: round-off of a heading.
SAME_HEADING = 1e-6


@read_once(4)
def read_rao(path: str) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.complex128]]:
    """Frequencies (F,) rad/s, headings (H,) deg, and the response (F, H, 6) per metre (m, rad).  RecordRefused."""
    if Path(path).suffix.lower() in NETCDF:
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


Array = NDArray[np.float64]

# Height of the surface above still water [m], its rate [m/s] and its slopes along x and y, at x, y [m], t [s].
Elevation = Callable[[float, float, float], tuple[float, float, float, float]]


class MotionTerms(NamedTuple):
    """What a motion adds up from, as numbers, for an evaluation elsewhere.

    translates, rotates: whether it moves and turns the end; harmonics: axis (0 to 2 along x, y, z, 3 to 5 about them),
    amplitude [m or rad], angular frequency [1/s], phase [rad]; ramp [s], 0: none; velocity [m/s] and its ramp [s],
    0: no velocity; travel: the way [m], its beginning and its duration [s], 0: no travel; follows: the surface of the
    sea; knots: (K,) [s] of a file; cubics: (K, 6, 4) from each knot on, highest power first [m, rad]; ride: of an end
    on a body that moves so, the axes (3, 3) of that without motion, the place (3,) [m] of the end in these, and the
    frame (3, 3) with which it turns there, None: it turns freely.
    """

    translates: bool
    rotates: bool
    harmonics: tuple[tuple[float, ...], ...]
    ramp: float
    velocity: tuple[float, ...]
    velocity_ramp: float
    travel: tuple[float, ...]
    follows: bool
    knots: Array
    cubics: Array
    ride: tuple[Array, Array, Array | None] | None = None


class EndMotion:
    """The motion of one end as a function of time.

    motion: the scene's table, or None for an end at rest; position: (3,) m, inertial, where the end
    is held (None for a guided end); frame: (3, 3), columns a1, a2, tangent in inertial axes, or None;
    elevation: the surface of the sea, which a motion with `follow: waves` needs;
    waves: (J, 6) of `Sea.waves`, their ramp [s], and whether the end turns with a vessel, which a motion with `vessel`
    needs.  base: (3,) m, without motion.
    SceneError if the motion file cannot be read.
    """

    def __init__(
        self,
        motion: Motion | None,
        position: ArrayLike | None,
        frame: ArrayLike | None = None,
        elevation: Elevation | None = None,
        waves: tuple[Array, float, bool] | None = None,
    ) -> None:
        self.base = _constant(np.zeros(3) if position is None else position)
        self._frame = None if frame is None else _constant(frame)
        self._still = _constant(np.zeros(3))
        self._motion = motion
        self._ramp = None if motion is None else motion.ramp
        harmonics = {} if motion is None else motion.harmonics()
        self._shifts = _components(harmonics, SHIFTS, 1.0)
        self._turns = _components(harmonics, TURNS, math.pi / 180)
        if motion is not None and motion.vessel is not None and motion.file is None:
            self._sail(motion.vessel, waves)
        self._carried = None
        if motion is not None and ((motion.velocity and any(motion.velocity)) or motion.travel is not None):
            self._carried = motion.carried
        self._follows = motion is not None and motion.follow is not None
        if self._follows and elevation is None:
            raise ValueError("a motion that follows the waves needs their elevation")
        self._elevation = elevation
        self._shift_spline: Any = None
        self._turn_spline: Any = None
        if motion is not None and motion.file is not None:
            self._read_record(motion, waves[2] if waves is not None else frame is not None)
        by_table = bool(self._shifts) or self._carried is not None or self._follows
        self._translates = by_table or self._shift_spline is not None
        self._rotates = bool(self._turns) or self._turn_spline is not None
        self.moving = self._translates or self._rotates

    def _read_record(self, motion: Motion, turns: bool) -> None:
        """Splines of the motion file; turns: whether the end turns with the motion."""
        try:
            record = motion_record(motion, self.base.tolist(), turns)
        except RecordRefused as refused:
            found = refused.finding
            raise SceneError([Complaint("motion.file", found.given or "", found.expected, found.fix)]) from None
        if record.shift is not None:
            self._shift_spline = spline(record.times, record.shift, self.base if self._ramp else None)
        if record.rotation is not None:
            still = np.zeros(3) if self._ramp else None
            self._turn_spline = spline(record.times, np.radians(record.rotation), still)
        self._last = float(record.times[-1])

    def at_time(self, t: float) -> tuple[Array, Array, Array | None, Array]:
        """Position (3,) m, velocity (3,) m/s, frame (3, 3) or None, angular velocity (3,) rad/s at t [s].

        All inertial.  What does not move is returned read-only and shared.
        """
        position, velocity = self._translation(t) if self._translates else (self.base, self._still)
        frame, spin = self._rotation(t) if self._rotates else (self._frame, self._still)
        return position, velocity, frame, spin

    def turn_from(self, frame: ArrayLike) -> None:
        """Turn another frame (3, 3) from now on."""
        self._frame = None if self._frame is None else _constant(frame)

    def terms(self) -> MotionTerms:
        """What the motion adds up from."""
        motion, still = self._motion, (0.0, 0.0, 0.0)
        velocity = motion.velocity if motion is not None else None
        travel = motion.travel if motion is not None else None
        harmonics = (*self._shifts, *((axis + 3, *h) for axis, *h in self._turns))
        splines = [x for x in (self._shift_spline, self._turn_spline) if x is not None]
        knots = splines[0].x if splines else np.zeros(0)
        cubics = np.zeros((knots.size, 6, 4))
        for first, curve in ((0, self._shift_spline), (3, self._turn_spline)):
            if curve is not None:
                cubics[:-1, first : first + 3] = curve.c.transpose(1, 2, 0)
        ramped = velocity is not None and any(velocity)
        ramp = self._ramp or 0.0
        way = (*travel.by, travel.begin, travel.over) if travel is not None else (*still, 0.0, 0.0)
        steady = velocity or still, ramp if ramped else 0.0, way
        return MotionTerms(self._translates, self._rotates, harmonics, ramp, *steady, self._follows, knots, cubics)

    def _translation(self, t: float) -> tuple[Array, Array]:
        if self._shift_spline is not None:
            shift, speed = self._followed(self._shift_spline, t)
            return self.base + shift, speed
        r, dr = self._grow(t)
        position, velocity = self.base.tolist(), [0.0, 0.0, 0.0]
        for axis, amplitude, w, phase in self._shifts:
            sine, cosine = math.sin(w * t + phase), math.cos(w * t + phase)
            position[axis] += r * amplitude * sine
            velocity[axis] += amplitude * (dr * sine + r * w * cosine)
        if self._carried is not None:
            far, fast = self._carried(t)
            for axis in range(3):
                position[axis] += far[axis]
                velocity[axis] += fast[axis]
        if self._follows:
            assert self._elevation is not None
            eta, rate, slope_x, slope_y = self._elevation(position[0], position[1], t)
            position[2] += eta
            velocity[2] += rate + slope_x * velocity[0] + slope_y * velocity[1]
        return np.array(position), np.array(velocity)

    def _rotation(self, t: float) -> tuple[Array | None, Array]:
        if self._turn_spline is not None:
            turn, spin = _turn_by_vector(*self._followed(self._turn_spline, t))
        else:
            r, dr = self._grow(t)
            angle, rate = [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]
            for axis, amplitude, w, phase in self._turns:
                sine, cosine = math.sin(w * t + phase), math.cos(w * t + phase)
                angle[axis] += r * amplitude * sine
                rate[axis] += amplitude * (dr * sine + r * w * cosine)
            turn, spin = _turn_by_angles(angle, rate)
        return None if self._frame is None else turn @ self._frame, spin

    def _sail(self, vessel: Vessel, waves: tuple[Array, float, bool] | None) -> None:
        """Move with a vessel in waves."""
        if waves is None or not len(waves[0]):
            raise ValueError("a vessel needs waves to move in")
        components, ramp, turns = waves
        assert vessel.rao is not None
        try:
            harmonics = point_harmonics(vessel.rao, components, np.array(vessel.origin), vessel.heading, self.base)
        except RecordRefused as refused:
            found = refused.finding
            raise SceneError([Complaint("motion.vessel.rao", found.given or "", found.expected, found.fix)]) from None
        if vessel.drift is not None:
            harmonics += drift_harmonics(vessel.drift, np.array(vessel.origin), vessel.heading, self.base)
        self._ramp = ramp
        self._shifts = [h for h in harmonics if h[0] < 3]
        self._turns = [(axis - 3, a, w, phase) for axis, a, w, phase in harmonics if axis >= 3 and turns]

    def _followed(self, curve: Any, t: float) -> tuple[Array, Array]:
        """Value (3,) and rate of a spline, as far as it has grown."""
        r, dr = self._grow(t)
        t = min(t, self._last)
        value, rate = curve(t), curve(t, 1)
        return r * value, r * rate + dr * value

    def _grow(self, t: float) -> tuple[float, float]:
        """The ramp and its derivative [1/s]."""
        if self._ramp is None or t >= self._ramp:
            return 1.0, 0.0
        grown, rate = smooth_step(t / self._ramp)
        return grown, rate / self._ramp


def _constant(value: ArrayLike) -> Array:
    array = np.array(value, dtype=float)
    array.flags.writeable = False
    return array


def _components(
    harmonics: dict[str, tuple[Harmonic, ...]], names: tuple[str, ...], scale: float
) -> list[tuple[int, float, float, float]]:
    """(axis, amplitude, angular frequency, phase) of the harmonics that move at all."""
    return [
        (axis, scale * h.amplitude, 2 * math.pi / h.period, math.radians(h.phase))
        for axis, name in enumerate(names)
        for h in harmonics.get(name, ())
        if h.amplitude != 0.0
    ]


def _turn_by_angles(angle: list[float], rate: list[float]) -> tuple[Array, Array]:
    """Rz(yaw) Ry(pitch) Rx(roll) and its angular velocity: every rate about its own axis, turned by what follows."""
    (cx, cy, cz), (sx, sy, sz) = map(math.cos, angle), map(math.sin, angle)
    turn = np.array(
        [
            [cz * cy, cz * sy * sx - sz * cx, cz * sy * cx + sz * sx],
            [sz * cy, sz * sy * sx + cz * cx, sz * sy * cx - cz * sx],
            [-sy, cy * sx, cy * cx],
        ]
    )
    roll, pitch, yaw = rate
    return turn, np.array([cz * cy * roll - sz * pitch, sz * cy * roll + cz * pitch, yaw - sy * roll])


def _turn_by_vector(vector: Array, rate: Array) -> tuple[Array, Array]:
    """exp of a rotation vector [rad] and the angular velocity that belongs to its rate (Rodrigues)."""
    x, y, z = vector
    skew = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    square = skew @ skew
    angle = math.sqrt(x * x + y * y + z * z)
    if angle < 1e-4:  # below, the next Taylor terms are under round-off, and 1 - cos loses digits
        a, b, c = 1.0 - angle**2 / 6, 0.5 - angle**2 / 24, 1 / 6 - angle**2 / 120
    else:
        a, b = math.sin(angle) / angle, 2.0 * (math.sin(angle / 2) / angle) ** 2
        c = (1.0 - a) / angle**2
    return np.eye(3) + a * skew + b * square, rate + b * (skew @ rate) + c * (square @ rate)


# The recorded motion of an end: its own, or that of a vessel that carries it, in six degrees of freedom.
#
#     symbol   meaning                                                                          unit
#     P, R     origin of the vessel and its axes (to the bow, to port, up), inertial            m, -
#     R0       its axes at rest, turned by `heading` about the vertical                         -
#     f        the end in axes of the vessel, f = R0^T (position - origin)                      m
#
# The end is at P + R f, and what it holds is turned by R R0^T.  Angles: R = Rz(yaw) Ry(pitch) Rx(roll).


def motion_record(motion: Motion, position: Triple | None, turns: bool = True) -> Record:
    """The record of `motion.file` as motion of an end at `position` (m); turns: whether the end holds a direction.

    RecordRefused: the file cannot be read, or a vessel has no positions or no rotations in it.
    """
    from scipy.spatial.transform import Rotation  # slow to import

    record = read_record(motion.file or "")
    vessel = motion.vessel
    if vessel is None:
        return record
    if record.shift is None or record.rotation is None or record.shift_unit is None or record.rotation_unit is None:
        fix = "add the columns that are missing; zeros where it does not move"
        expected = "columns t,x,y,z and roll,pitch,yaw (or rx,ry,rz), because a vessel carries the end"
        raise RecordRefused(expected, fix, f"{record.name} without {'positions' if record.shift is None else 'turns'}")
    c, s = math.cos(math.radians(vessel.heading)), math.sin(math.radians(vessel.heading))
    at_rest = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    arm = at_rest.T @ (np.array(position or vessel.origin) - np.array(vessel.origin))
    axes = Rotation.from_rotvec(record.rotation, degrees=True)
    shift = record.shift + axes.apply(arm)
    reach = float(np.linalg.norm(arm))
    shift_unit = record.shift_unit + reach * np.radians(record.rotation_unit.max(axis=1, keepdims=True))
    if not turns:
        return replace(record, shift=shift, shift_unit=shift_unit, rotation=None, rotation_unit=None)
    turned = np.degrees(continuous((axes * Rotation.from_matrix(at_rest.T)).as_rotvec()))
    return replace(record, shift=shift, shift_unit=shift_unit, rotation=turned)
