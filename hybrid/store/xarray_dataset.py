"""A result as one Dataset of xarray, and that as netCDF.

One flat Dataset, not a tree of groups: selecting along t or s then reaches energies, errors and criteria as well, and
every netCDF program shows all there is.  The rule for names is one: a slash becomes an underscore, so
``energy/kinetic`` is ``energy_kinetic``, and the step log lies along ``steps_t``.  (The groups of a result cannot
be a tree of xarray: their ``t`` would have to be that of the outputs.)
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from hybrid.errors import ResultError, optional_package
from hybrid.store.selection import Part, facts

if TYPE_CHECKING:
    import xarray


def dataset(part: Part) -> xarray.Dataset:
    """What was chosen, with units, descriptions, `zone_kind` over t and s, the scene, and versions as attributes."""
    xr = optional_package("xarray", "a Dataset", "export")
    result = part.result
    used = {dim for name in part.names for dim in result.dims(name)} | {"t", "s"}
    coordinates = {_name(dim): _variable(part, dim) for dim in sorted(used)}
    variables: dict[str, Any] = {}
    for name in (name for name in part.names if name not in used):
        if _name(name) in variables or _name(name) in coordinates:
            raise ResultError(f"two fields would both be called '{_name(name)}' in a Dataset; one is '{name}'")
        variables[_name(name)] = _variable(part, name)
    kinds, meanings = part.zone_kinds(part.s)
    flags = np.arange(len(meanings), dtype=kinds.dtype)
    about = {"long_name": "kind of the zone", "flag_values": flags, "flag_meanings": " ".join(meanings)}
    variables["zone_kind"] = (("t", "s"), kinds, about)
    variables["scene"] = ((), result.scene_text, {"long_name": "the scene that was run, as YAML"})
    return xr.Dataset(variables, coordinates, facts(part))


def image(part: Part) -> memoryview:
    """The same as a netCDF 4 file."""
    optional_package("h5netcdf", "netCDF", "export")
    return memoryview(dataset(part).to_netcdf(engine="h5netcdf"))


def _name(name: str) -> str:
    return name.replace("/", "_")


def _variable(part: Part, name: str) -> tuple[tuple[str, ...], np.ndarray, dict[str, str]]:
    unit, description, frame = part.result.label(name).values()
    about = {"units": unit, "long_name": description} | ({"frame": frame} if frame else {})
    return tuple(_name(dim) for dim in part.result.dims(name)), part.array(name), about
