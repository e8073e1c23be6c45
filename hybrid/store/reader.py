"""Read what a run has written, and choose what of it goes into another file: `open_result("run.h5")` gives a `Result`.

Arrays are those of `StoredResult`, read when they are asked for, once; what follows from them is computed here.

A `Part` is a choice: some fields, outputs of some time, the grid of the result or given arc lengths.  All formats
start from one, so that `--names`, `--times` and `--at` mean the same in each.  A file comes to be whole or not at all.
"""

from __future__ import annotations

import html
import io
import os
import zipfile
from collections.abc import Mapping, Sequence
from contextlib import ExitStack, suppress
from dataclasses import dataclass
from importlib import import_module
from math import inf
from pathlib import Path
from typing import TYPE_CHECKING, Any

import h5py
import numpy as np

from hybrid.errors import EVENTS_BY_WEIGHT, ResultError, optional_package
from hybrid.statistics import extremes, fatigue, moments
from hybrid.store.capacity import mooring_use
from hybrid.store.envelope import Judged, Pressed, contacts_of, stored_window
from hybrid.store.format import MemoryTarget, versions
from hybrid.store.hdf5_file import check_place, is_held, replacing
from hybrid.store.histories import (
    FIBRES,
    Section,
    Window,
    bends_at,
    extreme_of,
    history_of,
    lies_along,
    one_history,
    summary_of,
    usual_names,
)
from hybrid.store.records import ALIASES, right_of
from hybrid.store.stored_result import StoredResult
from hybrid.store.verdicts import Verdicts, section_limits, verdicts_of
from hybrid.store.whole_file import LateFile

if TYPE_CHECKING:
    import xarray


# --- what goes into another file ---------------------------------------------------------------

Numbers = Sequence[float] | np.ndarray

# The first words of everything that is written here, so that a file of somebody else is never replaced.  Not the
# format of a result: what is exported cannot be opened, plotted or resumed as one.
MARK = "hybrid-cable export"
# Kinds of numpy types that other formats have as well: numbers and text.  What lies over named dimensions is either.
_KINDS = "fiuU"


@dataclass(frozen=True)
class Part:
    """Fields `names` of a result, at its outputs `rows`, on its own grid or at the arc lengths `at` (m).

    Where a quantity jumps, fields have the value before; `after` has the other.
    """

    result: StoredResult
    names: tuple[str, ...]
    rows: slice
    at: np.ndarray | None

    @property
    def times(self) -> np.ndarray:
        """Output times, s."""
        return np.asarray(self.result["t"][self.rows])

    @property
    def s(self) -> np.ndarray:
        """Arc lengths, m."""
        return np.asarray(self.result["s"] if self.at is None else self.at)

    @property
    def zones(self) -> list[Any]:
        """Zones at every output."""
        return list(self.result.zones[self.rows])

    def array(self, name: str) -> np.ndarray:
        """A field, or the scale of one of its dimensions."""
        if name == "s":
            return self.s
        dims = self.result.dims(name)
        if self.at is not None and "s" in dims:
            array = np.asarray(self.result.at(s=self.at, names=[name], side="left")[name])
        else:
            array = np.asarray(self.result[name])
        first = dims[0] if dims else ""
        if first == "t":
            return array[self.rows]
        if first.endswith("/t"):
            return array[self._rows_of(first)]
        return array

    def after(self, name: str, s: float) -> np.ndarray | None:
        """A field just after the arc length s (m), (nt,), if it jumps there; None if it does not."""
        if right_of(name) not in self.result:
            return None
        jumps = self.result["right/s"]
        k = int(np.abs(jumps - s).argmin())
        if abs(jumps[k] - s) > 1e-9 * float(np.ptp(self.result["s"])):
            return None
        return np.asarray(self.result[right_of(name)][self.rows, k])

    def zone_kinds(self, s: np.ndarray) -> tuple[np.ndarray, list[str]]:
        """Kind of the zone at arc lengths s (m): numbers (nt, len(s)), and what they mean.

        Between two zones the one that begins there counts.
        """
        kinds = sorted({zone.kind for zones in self.zones for zone in zones})
        found = np.zeros((len(self.times), len(s)), dtype=np.int8)
        before: Any = None
        for i, zones in enumerate(self.zones):
            if i and zones == before:
                found[i] = found[i - 1]
                continue
            starts = [zone.s_a for zone in zones]
            which = np.clip(np.searchsorted(starts, s, side="right") - 1, 0, len(zones) - 1)
            found[i], before = np.array([kinds.index(zone.kind) for zone in zones])[which], zones
        return found, kinds

    def _rows_of(self, scale: str) -> np.ndarray:
        """Rows of a table within the time that was chosen; of zones those that hold then."""
        t = self.result[scale]
        if len(self.times) == len(self.result["t"]):
            return np.arange(len(t))
        if scale == "zones/t":
            begun = t[t <= self.times[0]]
            return np.flatnonzero((t >= (begun[-1] if len(begun) else -inf)) & (t <= self.times[-1]))
        return np.flatnonzero((t >= self.times[0]) & (t <= self.times[-1]))


def part_of(
    result: StoredResult, names: Sequence[str] | None = None, times: Window | None = None, at: Numbers | None = None
) -> Part:
    """Choose: names of fields or groups (None: all), times from and to (s, both included), arc lengths (m).

    ResultError when there is no such name, no output in that time, or no such place.
    """
    t = result["t"]
    if not len(t):
        raise ResultError(f"the result holds no output yet: there is nothing to export ({result.status_text})")
    first, last = times or (None, None)
    a, b = -inf if first is None else first, inf if last is None else last
    slack = 1e-9 * max(t[-1] - t[0], abs(t[-1]))  # what writing a time in decimals loses
    rows = np.flatnonzero((t >= a - slack) & (t <= b + slack))
    if not len(rows):
        raise ResultError(
            f"no output lies between t = {a:.9g} and {b:.9g} s\n"
            f"    expected: a window in {t[0]:.9g} ... {t[-1]:.9g} s, wide enough for one of {len(t)} outputs"
        )
    places = None
    if at is not None:
        places = np.unique(np.asarray(at, dtype=float))
        if not len(places):
            raise ResultError("at = [] is no list of arc lengths\n    try:      at=[0.0]")
        result.at(s=places, t=t[0], names=["s"])  # refuses what is outside
    known = _exportable(result)
    chosen: list[str] = []
    for name in known if names is None else names:
        value = None if name in known else result[name]  # refuses what is not there, and says what is near
        inside = [f"{name}/{key}" for key in value] if isinstance(value, Mapping) else [ALIASES.get(name, name)]
        if not set(inside) <= set(known):
            raise ResultError(f"'{name}' is no array of numbers or text over named dimensions: it stays where it is")
        chosen += [n for n in inside if n not in chosen]
    if not chosen:
        raise ResultError("no field was chosen\n    try:      names=['tension']")
    return Part(result, tuple(chosen), slice(int(rows[0]), int(rows[-1]) + 1), places)


def _exportable(result: StoredResult) -> list[str]:
    """Names of all arrays whose dimensions have names, and of single numbers and texts."""
    scales = {name for name in result.names if result.dims(name) == (name,)}
    named = (name for name in result.names if set(result.dims(name)) <= scales)
    return [name for name in named if result.dims(name) or np.asarray(result[name]).dtype.kind in _KINDS]


# ---- what every file says of itself ---------------------------------------------------------------


def facts(part: Part) -> dict[str, Any]:
    """Attributes of a file: those of the result, what was done to it, and what is missing."""
    result = part.result
    own = {k: v for k, v in result.attributes.items() if k not in ("format", "format_version")}
    made = {"format": MARK, "exported_from": result.file.name if result.file else "a result in memory"}
    said = {"noted": ", ".join(noted_events(part)), "left_out": "; ".join(missing_parts(part))}
    return made | own | {"exported_by": f"hybrid-cable {versions()['hybrid-cable']}"} | said


def noted_events(part: Part) -> list[str]:
    """Kinds of events of the run that call its answer into question, the worst first."""
    kinds = {event.kind for event in part.result.events}
    return [kind for kind in EVENTS_BY_WEIGHT if kind in kinds]


def missing_parts(part: Part) -> list[str]:
    """What a reader of the file must know: the run is not complete, or only some of it is there."""
    said, t, whole = [], part.times, part.result["t"]
    if part.result.status != "complete":
        said.append(f"the run is not complete ({part.result.status_text}): t ends at {whole[-1]:.9g} s")
        if "extremes" in (window := stored_window(part.result)):
            said.append(f"stored of it: {window}")
    elif part.result.pending:
        said.append(part.result.pending)
    if len(t) < len(whole):
        said.append(f"only t = {t[0]:.9g} to {t[-1]:.9g} s of {whole[0]:.9g} to {whole[-1]:.9g} s")
    return said


def head_lines(part: Part) -> list[str]:
    """The beginning of a text file, without the marks of a comment: title, origin, status."""
    result, own = part.result, facts(part)
    lines = [f"title: {result.title}", f"result: {own['exported_from']}, {result.status_text}"]
    lines += [f"note: {text}" for text in missing_parts(part)]
    lines += [f"the run noted: {', '.join(noted_events(part))}; see its events"] if noted_events(part) else []
    lines.append("computed by: " + ", ".join(f"{k} {v}" for k, v in result.versions.items()))
    lines.append(f"computed: {own['created']}; exported by: {own['exported_by']}")
    return lines


def scene_lines(part: Part) -> list[str]:
    return ["scene:", *(f"  {line}".rstrip() for line in part.result.scene_text.splitlines())]


def error_name(part: Part, name: str) -> tuple[str, str]:
    """The field of the estimated error of a field, and which error it is; ("", "") where none was estimated."""
    for kind, said in (("total", "estimated"), ("model", "of the model alone")):
        if f"errors/{kind}/{name}" in part.result:
            return f"errors/{kind}/{name}", said
    return "", ""


# ---- a Dataset of xarray, and that as netCDF ------------------------------------------------------


def dataset(part: Part) -> xarray.Dataset:
    """What was chosen, with units, descriptions, `zone_kind` over t and s, the scene, and versions as attributes.

    One flat Dataset: groups of a result cannot be a tree of xarray, because their ``t`` would be that of the outputs.
    """
    xr = optional_package("xarray", "a Dataset", "export")
    result = part.result
    used = {dim for name in part.names for dim in result.dims(name)} | {"t", "s"}
    coordinates = {_flat(dim): _variable(part, dim) for dim in sorted(used)}
    variables: dict[str, Any] = {}
    for name in (name for name in part.names if name not in used):
        if _flat(name) in variables or _flat(name) in coordinates:
            raise ResultError(f"two fields would both be called '{_flat(name)}' in a Dataset; one is '{name}'")
        variables[_flat(name)] = _variable(part, name)
    kinds, meanings = part.zone_kinds(part.s)
    flags = np.arange(len(meanings), dtype=kinds.dtype)
    about = {"long_name": "kind of the zone", "flag_values": flags, "flag_meanings": " ".join(meanings)}
    variables["zone_kind"] = (("t", "s"), kinds, about)
    variables["scene"] = ((), result.scene_text, {"long_name": "the scene that was run, as YAML"})
    return xr.Dataset(variables, coordinates, facts(part))


def netcdf(part: Part) -> memoryview:
    """The same as a netCDF 4 file."""
    optional_package("h5netcdf", "netCDF", "export")
    return memoryview(dataset(part).to_netcdf(engine="h5netcdf"))


def _flat(name: str) -> str:
    """The name in a Dataset: a slash becomes an underscore, as in ``energy_kinetic``."""
    return name.replace("/", "_")


def _variable(part: Part, name: str) -> tuple[tuple[str, ...], np.ndarray, dict[str, str]]:
    unit, description, frame = part.result.label(name).values()
    about = {"units": unit, "long_name": description} | ({"frame": frame} if frame else {})
    return tuple(_flat(dim) for dim in part.result.dims(name)), part.array(name), about


# ---- whole or not at all --------------------------------------------------------------------------


def write_atomically(files: Mapping[Path, bytes | memoryview], overwrite: bool) -> None:
    """Write all files or none, each beside its place first.  ResultError when that cannot be done.

    The files are made in memory: where a disk is full, HDF5 cannot close what it writes, and takes the interpreter
    down with it.
    """
    for path in files:
        check_target(path, overwrite)
    with ExitStack() as stack:
        for path, content in files.items():
            stack.enter_context(replacing(path)).write_bytes(content)


def check_target(path: Path, overwrite: bool) -> None:
    """ResultError if nothing can or may be written there."""
    check_place(path, "run.nc")
    why, advice = "", "another name, or delete the file yourself"
    if path.exists():
        if not overwrite:
            why, advice = "exists", "another name, or leave --no-overwrite out (overwrite=True in Python)"
        elif not os.access(path, os.W_OK):
            why = "exists and is write-protected"
        elif path.stat().st_size and not is_export(path):
            why = "exists and was not exported by hybrid"
    if why:
        raise ResultError(f"{path} {why}\n    try:      {advice}")


def is_export(path: Path) -> bool:
    """Whether a file was written by an export."""
    with path.open("rb") as file:
        if file.read(2 + len(MARK)) == f"# {MARK}".encode():
            return True
    with suppress(OSError, zipfile.BadZipFile), zipfile.ZipFile(path) as unit:  # an FMU
        return "resources/interface.json" in unit.namelist()
    with suppress(OSError), h5py.File(path, "r", locking="best-effort") as file:
        mark = file.attrs.get("format", "")
        return (mark.decode() if isinstance(mark, bytes) else str(mark)).startswith((MARK, "hybrid-cable study"))
    return False


# --- a result ----------------------------------------------------------------------------------

Floats = np.ndarray


class Result(StoredResult):
    """The recorded answer of one run.

    Arrays have the output times first: `position` is (nt, ns, 3).  `units`, `describe` and `dims` say what each
    is.  Use `refresh` to see what a running computation has added since.
    """

    def contacts(self) -> list[Pressed]:
        """What presses on the line by name, or which of several lines press on each other: largest forces at outputs.

        Of each its `partner`, `force` (N, over all places) at `t_force` (s), `contact` (N/m) at `t_contact` (s), and
        the `group` in which the result has these over time.
        """
        return contacts_of(self)

    def statistics(
        self, names: Sequence[str] | None = None, *, times: Window | None = None, at: Any = None
    ) -> dict[str, moments.Summary]:
        """Summaries of histories, each of the shape of the quantity at one time.

        Mean, standard deviation, skewness, extremes with their times, period between up-crossings of the mean,
        significant range, number of cycles.
        names: None for end forces, tension, curvature, bending moment, torque, contact force, and what the scene asks
        for, where the result has them at all outputs; times: from and to, s; at: arc lengths, m, None: all output
        points.  A quantity along the line has a value at each place of `both_sides(name)[0]`: where it jumps, one
        before and one after.
        """
        found = {}
        asked = usual_names(self) if names is None else [names] if isinstance(names, str) else names
        for name in asked:
            history = history_of(self, name, times, at if lies_along(self, name) else None)
            if names is None and not np.isfinite(history.values).all():
                continue
            found[name] = summary_of(history)
        return found

    def extreme(
        self,
        name: str,
        *,
        at: float | None = None,
        duration: float = extremes.THREE_HOURS,
        threshold: float | None = None,
        times: Window | None = None,
        smallest: bool = False,
        probability: float = extremes.FRACTILE,
    ) -> extremes.Extreme:
        """The largest (or smallest) value that a time of `duration` (s) brings, by peaks over a threshold of a history.

        at: arc length (m), of a quantity along the line; threshold: in the unit of the quantity, None: nine tenths of
        the peaks are below it.  ResultError with too few peaks, of what is round-off, and where the law leads beyond
        what an angle can be.
        """
        history = one_history(history_of(self, name, times, at))
        record, how = (name, history.unit, history.t, history.values), (threshold, smallest, probability)
        return extreme_of(self, *record, duration, *how)

    def exceedance(
        self,
        name: str,
        above: float | None = None,
        *,
        below: float | None = None,
        at: Any = None,
        times: Window | None = None,
    ) -> Floats:
        """Part of the time for which a history is above a value, or below one.

        above, below: one of them, in the unit of the quantity; at, times: as of `statistics`.  The answer has the shape
        of the quantity at one time.  ResultError: both or none is given, or no number.
        """
        if (above is None) is (below is None):
            raise ResultError("exceedance\n    expected: one of above and below, in the unit of the quantity")
        value = above if below is None else below
        if isinstance(value, bool) or not isinstance(value, int | float | np.integer | np.floating):
            key = "above" if below is None else "below"
            raise ResultError(f"{key}: expected a number in the unit of {name!r}, found {value!r:.60}")
        history = history_of(self, name, times, at)
        return moments.exceedance(history.t, history.values, above, below)

    def utilisation(self) -> dict[str, Judged]:
        """Utilisation of each limit of the line's sections over all steps and outputs, by key.

        `used` is the part of max_tension or min_bend_radius that was used, None of min_tension and of what is not
        verified; `verdict` is within, broken or not verified, with `why` and `remedy`; at s (m) and t (s).
        ResultError of a result of several lines: each has its own.
        """
        if self.lines:
            first = next(iter(self.lines))
            raise ResultError(
                f"utilisation of a result with the lines {', '.join(self.lines)}\n"
                f"    expected: that of one line\n    try:      result.lines[{first!r}].utilisation()"
            )
        return {found.limit: found for found in section_limits(self)}

    def mooring(self, strength: float, factors: tuple[float, ...], pretension: Any) -> tuple[Floats, Floats, Floats]:
        """Utilisation of a mooring line by DNV-OS-E301 (July 2021), (T_pre g_pre + (T - T_pre) g_env)/S.

        Returns arc lengths (n,) m, the utilisation at the outputs (nt, n), and that of the largest tension over all
        steps and outputs (n,).
        strength: S, N; factors: g_pre, g_env, by class and limit state, without default; pretension: T_pre, N, or the
        result of an equilibrium under it, `hybrid.static` without current.  ResultError: of another line.
        """
        return mooring_use(self, strength, factors, pretension)

    def verdicts(self) -> Verdicts:
        """Verdicts on limits and on the accuracy, each with its reason and remedy.

        Limits of sections and of quantities are within or broken, an accuracy that was asked for is met or missed, or
        they are not verified.  Of several lines each has its own, and the result those of quantities of all.
        """
        return verdicts_of(self)

    def spectrum(
        self, name: str, *, at: Any = None, times: Window | None = None, segment: float | None = None
    ) -> moments.Spectrum:
        """The spectrum of a history by Welch's method; segment: s, None: an eighth of the record."""
        history = history_of(self, name, times, at)
        return moments.welch(history.t, history.values, segment)

    def damage(
        self,
        curve: str | Mapping[str, Any] | fatigue.Curve,
        *,
        strength: float | None = None,
        section: Section | Sequence[float] | None = None,
        concentration: float = 1.0,
        times: Window | None = None,
        at: Any = None,
    ) -> tuple[Floats, Floats]:
        """Arc lengths (n,) m and the damage (n,) that the outputs of the run do there, by a curve of fatigue.

        curve: a name of hybrid/statistics/fatigue_curves.csv, or kind, log_a, m (log_a2, m2, knee) of one's own.
        strength: N, reference strength, for a T-N curve.  section: (area m2, outer diameter m, Young's modulus Pa) for
        an S-N curve; the stress is that of tension and bending at the worst of FIBRES fibres, times `concentration`.
        The damage is that of the time of the outputs; divide by it for a rate.
        """
        law = fatigue.curve_of(curve)
        tension = history_of(self, "tension", times, at)
        if law.kind == "T-N":
            if strength is None or section is not None or not 0.0 < strength < np.inf:
                expected = "strength=... (--strength N), in N, above 0, and no section"
                raise ResultError(f"the curve '{law.name}' is of ranges of tension\n    expected: {expected}")
            return np.asarray(tension.s), fatigue.damage(tension.values, law, concentration / strength)
        if section is None or strength is not None or len(section) != 3 or not all(0.0 < x < np.inf for x in section):
            fix = "section=(area m2, outer diameter m, Young's modulus Pa), --section A,D,E, and no strength"
            raise ResultError(f"the curve '{law.name}' is of ranges of stress\n    try:      {fix}")
        bends = bends_at(self, times, at)
        found = []
        for k in range(FIBRES):
            angle = 2.0 * np.pi * k / FIBRES
            about = np.cos(angle) * bends[..., 0] + np.sin(angle) * bends[..., 1]
            stress = fatigue.stress_of(tension.values, about, *Section(*section))
            found.append(fatigue.damage(stress, law, concentration))
        return np.asarray(tension.s), np.max(found, axis=0)

    def to_xarray(
        self,
        *,
        names: Sequence[str] | None = None,
        times: tuple[float | None, float | None] | None = None,
        at: Any = None,
    ) -> xarray.Dataset:
        """Everything as one Dataset of xarray: over t and s, with units; a slash in a name becomes an underscore.

        names: fields or groups, None for all; times: from and to, s; at: arc lengths, m, in place of the output grid.
        """

        return dataset(part_of(self, names, times, at))

    def _ipython_display_(self) -> None:
        """Show the card and the cable in space in a notebook; elsewhere IPython takes one of the other ways."""
        import_module("hybrid.view.report").show(self)  # by name: the store imports no view

    def _repr_html_(self) -> str:
        """What a notebook shows; of a result that cannot be drawn, what a terminal shows."""
        try:
            return str(import_module("hybrid.view.report").card(self))  # by name: the store imports no view
        except Exception:  # a cell must never fail because its result is closed, empty or odd
            try:
                return f"<pre>{html.escape(repr(self))}</pre>"
            except Exception:
                return "<pre>a result that can no longer be read</pre>"


def open_result(source: str | Path | bytes | io.BytesIO) -> Result:
    """Open a result file, or one in memory.

    A file that another process is writing, or that was left by a killed one, opens too,
    with the outputs that were complete.  ResultError when it is not a result.
    """
    source = io.BytesIO(source) if isinstance(source, bytes) else source
    if isinstance(source, io.BytesIO):
        return Result(source)
    path = Path(source).expanduser().resolve()
    is_held(path)  # which removes the lock that a killed process has left
    return Result(path)


def written_result(source: Path | io.BytesIO | MemoryTarget, late: LateFile | None = None) -> Result:
    """Open a result that this process has written just now, without holding its bytes against their sum.

    late: the last file that was written in one go: where that is the source, its arrays are in memory.
    """
    if late is None or late.path != source or not late.may_stay():
        return Result(source, summed=False)
    return Result(source, contents=late.contents)
