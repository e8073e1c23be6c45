"""Response of a vessel to waves from a dataset of Capytaine, in netCDF: its RAO, or what it follows from.

    symbol   meaning                                                                    unit
    w, b     angular frequency, direction in which the waves run                        1/s, rad
    M, A     mass and added mass of the six rigid degrees of freedom                    kg, kg m, kg m^2
    B, K     radiation damping, hydrostatic stiffness
    F, X     excitation by a wave of 1 m, response to it                                N, N m; m, rad

In Capytaine x(t) = Re(X exp(-i w t)), and the crest of the wave is at the origin at t = 0.  A velocity is -i w X, so

    (-w^2 (M + A) - i w B + K) X = F

A response that lags by arg X behind the crest is conj(X) in kernels of this package, where it is exp(-i lag).
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hybrid.scene.motion_file import RecordRefused, netcdf_reader

FREEDOMS = ("surge", "sway", "heave", "roll", "pitch", "yaw")
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
