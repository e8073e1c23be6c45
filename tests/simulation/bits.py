"""Whether two results are the same, bit for bit, but for clocks; and runs that are stopped."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

import hybrid
import hybrid.accuracy.refinement
import hybrid.simulation.run_record
import hybrid.solve.network_steps
from hybrid.kernels.machine.cache import cache_folder
from hybrid.simulation import progress as reports
from hybrid.store.hdf5_file import opened

CLOCKS = ("steps/cpu",)
FEW_STEPS = 1000  # cells x steps between two checkpoints; there is one where a run is stopped, too
CLOCK_ATTRIBUTES = ("created", "effort_cpu")


def differences(a: Path, b: Path) -> list[str]:
    """What two results differ in, checkpoints and clocks aside."""
    out = []
    with opened(a) as x, opened(b) as y:  # also what a kill has left between its status and its last byte
        names: list[set[str]] = []
        for file in (x, y):
            names.append(set())
            file.visit(names[-1].add)
        ours = [{n for n in found if not n.startswith("checkpoint/slot")} for found in names]
        out += [f"only in one: {name}" for name in ours[0] ^ ours[1]]
        for name in sorted(ours[0] & ours[1]):
            if isinstance(x[name], h5py.Dataset) and not name.endswith(CLOCKS):
                one, other = x[name][()], y[name][()]
                same = one == other if isinstance(one, bytes) else one.tobytes() == other.tobytes()
                if not same or getattr(one, "shape", ()) != getattr(other, "shape", ()):
                    out.append(f"other values: {name}")
        for name in {*x.attrs, *y.attrs} - {*CLOCK_ATTRIBUTES}:
            if not np.array_equal(x.attrs.get(name), y.attrs.get(name)):
                out.append(f"other attribute: {name}: {x.attrs.get(name)!r}, {y.attrs.get(name)!r}")
    return out


def resumed(scene: dict[str, Any], folder: Path, *stops: float) -> hybrid.Result:
    """The run of a scene, after asserting that one that ends at each of `stops` (s), resumed, is the same, bit for bit."""
    time = scene["time"]
    whole = hybrid.run(scene, folder / "whole.h5")
    hybrid.run(scene | {"time": time | {"duration": stops[0]}}, folder / "part.h5").close()
    for until in (*stops[1:], time["duration"]):
        hybrid.resume(folder / "part.h5", until=until).close()
    apart = differences(folder / "whole.h5", folder / "part.h5")
    apart = [x for x in apart if not re.fullmatch(r"other values: lines/\w+/scene", x)]  # with a duration each
    assert not apart, apart
    return whole


def machine_code() -> set[Path]:
    """Files of the kernels that have been compiled."""
    return {*cache_folder().glob("*.kernel")}


class Stopping:
    """Hears of every step, and stops the run like Ctrl-C at one of them."""

    def __init__(self, monkeypatch, checkpoints: bool = True) -> None:
        monkeypatch.setattr(reports, "REPORT_EVERY", -1.0)
        monkeypatch.setattr(hybrid.accuracy.refinement, "LITTLE", np.inf)  # an event that goes by clocks
        monkeypatch.setattr(hybrid.solve.network_steps, "CELL_STEPS", 1)  # a step a call
        if checkpoints:  # every few steps; they are otherwise some seconds apart
            monkeypatch.setattr(hybrid.simulation.run_record, "WORK", FEW_STEPS)
        self.left, self.heard = -1, 0

    def __call__(self, progress: hybrid.simulation.progress.Progress) -> None:
        self.left -= 1
        self.heard += 1
        if self.left == 0:
            raise KeyboardInterrupt

    def stop(self, after: int, go: Callable[..., Any], *given: Any, **more: Any) -> None:
        """Stop what runs after so many steps."""
        self.left = after
        with pytest.raises(KeyboardInterrupt):
            go(*given, progress=self, **more)


def went_on(scene: hybrid.Scene, path: Path, stopping: Stopping, stops: list[int], **more) -> int:
    """Run a scene that is stopped after so many steps of each part, and resume it until it is complete; the stops."""
    begun, count = False, 0
    for stop in [*stops, -1]:
        stopping.left = stop
        try:
            if begun:
                hybrid.resume(path, progress=stopping, **more).close()
            else:
                hybrid.run(scene, path, progress=stopping, **more).close()
            break
        except KeyboardInterrupt:
            count += 1
            begun = begun or path.exists()
    return count
