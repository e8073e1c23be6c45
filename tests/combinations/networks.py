"""The result of a cable and that of the same cable as a network of one line, dataset by dataset."""

from __future__ import annotations

import itertools
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import nullcontext, suppress
from pathlib import Path
from typing import Any, NamedTuple

import h5py
import numpy as np
import yaml

import hybrid
from hybrid import Result, Scene
from hybrid.model.network import NetworkResolution
from hybrid.model.resolution import first_resolution
from hybrid.scene.read import as_scene, scene_text
from hybrid.scene.short_form import LINE, network_of
from hybrid.simulation.case import Case
from hybrid.simulation.network_run import NetworkRun, Recording
from hybrid.simulation.progress import ProgressReporter
from hybrid.simulation.restart import LoadChange
from hybrid.simulation.run_file import Cable
from hybrid.store.array_contents import Target
from hybrid.store.reader import open_result
from hybrid.store.writer import WriteMode

SAME = 1e-9  # of the scale of a dataset: round-off that a motion of some hundred steps lets grow
# What says how Newton's method went, and clocks: no quantity of the line.
NUMERICS = ("steps/cpu", "steps/correction", "steps/residual", "steps/error", "steps/iterations")
# Instants of extremes: of values that are equal to round-off, as at rest, either is right.
INSTANTS = ("_t_max", "_t_min", "_at_max", "_at_min", "_t", "times")
# Sizes below which a dataset is held against these: what Newton's method leaves of a velocity near rest, and of forces,
# moments and energies, is round-off of the largest forces, F, and of these times the length, FL.
SLOW = 0.05  # m/s or rad/s
SMALL = 1e-3  # of F, or of FL
UNITS_OF_WORK = ("J", "W", "N m")
GRAVITY = 9.81  # m/s2
# Of a file: when it was made, how a dataset names others, and where a run may go on.
UNLIKE = ("created", "DIMENSION_LIST", "REFERENCE_LIST")
CHECKPOINTS = "checkpoint/slot_"


class Difference(NamedTuple):
    """A dataset that is not the same."""

    name: str
    by: float  # of the scale; infinite: of another size, or known in one of the two alone

    def __str__(self) -> str:
        return f"{self.name} {self.by:.1e}"


def exact_scene(tables: dict[str, Any], dimension: int = 3) -> Scene:
    """The scene of these tables, in space or in a plane, with steps that end at outputs."""
    tables = {key: x for key, x in tables.items() if key != "solver"} | {"dimension": dimension}
    return as_scene(tables | {"output": tables.get("output", {}) | {"exact": True}})


def both(tables: dict[str, Any], rest: bool = False) -> tuple[Result, Result]:
    """The results of a cable and of its network; rest: of their equilibria."""
    scene = exact_scene(tables)
    compute = hybrid.static if rest else hybrid.run
    return compute(scene), compute(network_of(scene))


def network_run(
    scene: Scene, target: Target, changes: Sequence[LoadChange[Scene]] = (), **recording: Any
) -> NetworkRun:
    """The run of the network of a cable, which gets the file of that; recording: fields of `Recording`."""
    asked = Recording(**{"mode": WriteMode({}), "planes": True, "cable": Cable(scene, changes)} | recording)
    resolution = None if asked.source is not None else NetworkResolution({LINE: first_resolution(scene)})
    others = [LoadChange(x.t, network_of(x.scene)) for x in changes]
    return NetworkRun(network_of(scene), target, scene_text(scene), True, resolution, asked, None, others)


def recorded(run: NetworkRun, looks: int | None = None) -> NetworkRun:
    """A run to its end; looks: after as many reports of its progress it is interrupted."""
    left = itertools.count(0 if looks is None else -looks)
    with nullcontext() if looks is None else suppress(KeyboardInterrupt):
        run.record_motion(ProgressReporter(None, 1.0), lambda: looks is not None and next(left) >= 0)
    return run


def both_files(scene: Scene, folder: Path, changes: Sequence[LoadChange[Scene]] = ()) -> tuple[Path, Path]:
    """The files of a cable and of its network, which gets that of a cable; each is computed once."""
    cable, network = folder / "cable.h5", folder / "network.h5"
    case = Case(scene, None, changes)
    case.record(NetworkResolution.of(case.lines), cable)
    recorded(network_run(scene, network, changes))
    return cable, network


def files_differ(one: Path, other: Path) -> list[str]:
    """What two files do not have in common: datasets, their form, attributes, texts, and numbers beyond round-off."""
    with h5py.File(one) as a, h5py.File(other) as b:
        found = [*_attributes_differ(a, b, "/"), *_contents_differ(a, b)]
    with open_result(one) as cable, open_result(other) as network:
        return found + [str(x) for x in differences(cable, network)]


def _contents_differ(a: h5py.File, b: h5py.File) -> Iterator[str]:
    names = [set[str](), set[str]()]
    for file, those in zip((a, b), names, strict=True):
        file.visit(those.add)
    yield from (f"{x}: in one alone" for x in sorted(names[0] ^ names[1]))
    events = [Counter(zip(x["events/kind"][()], x["events/text"][()], strict=True)) for x in (a, b)]  # in any order
    yield from (f"event of one alone: {x}" for x in [*(events[0] - events[1]), *(events[1] - events[0])])
    for name in sorted(x for x in names[0] & names[1] if not x.startswith(CHECKPOINTS)):
        x, y = a[name], b[name]
        yield from _attributes_differ(x, y, name)
        if not isinstance(x, h5py.Dataset):
            continue
        forms = [(each.dtype, each.shape, [(d.label, [*d.keys()]) for d in each.dims]) for each in (x, y)]
        if forms[0] != forms[1]:
            yield f"{name}: {forms[0]}, {forms[1]}"
        elif x.dtype.kind != "f" and not name.startswith(("events/", *NUMERICS)) and not np.array_equal(x[()], y[()]):
            k = np.argmax(np.ravel(x[()] != y[()]))
            yield f"{name}: {np.ravel(x[()])[k]}, {np.ravel(y[()])[k]}"


def _attributes_differ(x: Any, y: Any, name: str) -> Iterator[str]:
    for key in sorted({*x.attrs, *y.attrs} - {*UNLIKE}):
        a, b = x.attrs.get(key), y.attrs.get(key)
        same = np.isclose(a, b, rtol=SAME) if isinstance(a, float) and isinstance(b, float) else np.array_equal(a, b)
        if not same:
            yield f"{name} has {key}: {a}, {b}"


def differences(cable: Result, network: Result, same: float = SAME) -> list[Difference]:
    """Datasets that differ by more than `same` of their scale, the worst first, and events."""
    line, found = dict(network.lines).get(LINE, network), list[Difference]()
    sections = yaml.safe_load(cable.scene_text)["cable"]["sections"]
    weight = GRAVITY * sum(x["mass"] * x["length"] for x in sections)
    force = max(float(np.abs(cable["tension"]).max()), weight)  # a line that falls has hardly any tension
    length = float(cable["mesh/s"][-1])
    for name in sorted({*cable.names} & {*line.names}):
        if name in NUMERICS or name.endswith(INSTANTS) or name.startswith("events/"):
            continue
        a, b = np.asarray(cable[name]), np.asarray(line[name])
        if a.dtype.kind not in "fiu" or not a.size:
            continue
        if a.shape != b.shape or not np.array_equal(np.isfinite(a), np.isfinite(b)):
            found.append(Difference(name, np.inf))
            continue
        known = np.isfinite(a)
        if known.any():
            scale = max(float(np.abs(a[known]).max()), _least(name, cable, force, length)) or 1.0
            by = float(np.abs(a.astype(float) - b)[known].max()) / scale
            found += [Difference(name, by)] if by > same else []
    return sorted(found, key=lambda x: -x.by)


def _least(name: str, cable: Result, force: float, length: float) -> float:
    unit = cable.units[name]
    if unit in ("m/s", "rad/s", "1/s"):
        return SLOW
    if unit in ("N", "m"):
        return SMALL * (force if unit == "N" else length)
    if unit in ("1/m", "rad/m"):
        return SMALL / length
    return SMALL * force * length if unit in UNITS_OF_WORK else SMALL if unit in ("rad", "deg") else 0.0


def events_differ(cable: Result, network: Result) -> list[str]:
    """Kinds of events that one of the two alone has, or has otherwise often."""
    one, two = (Counter(x.kind for x in each.events) for each in (cable, network))
    return [f"{kind} {one[kind]}:{two[kind]}" for kind in sorted({*one, *two}) if one[kind] != two[kind]]
