"""A run of a million steps takes the memory of a run of a thousand, and its file what its steps and events need.

    pytest tests/harden -m bench -s -k million

prints the memory along it.
"""

from __future__ import annotations

import gc
import resource
from collections import Counter
from pathlib import Path

import numpy as np
import pytest

import hybrid
from hybrid.cli.tables import zones_over_time
from hybrid.errors import OMITTED, ZONE_EVENTS
from hybrid.store import recorder as record
from tests.scenes import pinned_at

STEP, PERIOD = 0.05, 40.0  # s: of a step, and of the coming and going of a rod
PER_STEP = 80  # bytes of the step log a step: ten numbers
PER_EVENT = 800  # bytes of an event: its texts have fixed widths


def _scene(steps: int) -> hybrid.Scene:
    """A few cells between two pins, one of which heaves."""
    heave = {"heave": {"amplitude": 0.2, "period": 4.0}, "ramp": 8.0}
    section = {"length": 10.0, "mass": 1.0, "axial_stiffness": 1e5, "bending_stiffness": 0.5, "damping": 0.2}
    ends = {"start": pinned_at(0, 0, 0), "end": pinned_at(9, 0, 0, motion=heave)}
    return hybrid.validate_scene(
        {"cable": {"sections": [section]}, "ends": ends, "initial": "equilibrium", "mesh": {"cells": 8},
         "model": {"kind": "adaptive", "tolerance": 0.01, "hold_time": 2.0},
         "time": {"duration": steps * STEP, "step": STEP}, "output": {"every": steps * STEP / 100, "points": 5}}
    )  # fmt: skip


def comes_and_goes(look: hybrid.NodeState) -> np.ndarray:
    """A rod in the middle, for half of every period."""
    middle = np.abs(look.s - 5.0) < 2.0
    return np.where(middle & (look.t % PERIOD < 0.5 * PERIOD), 2.0, 0.1)


def _resident() -> float:
    """Memory that the process holds, MB."""
    return int(Path("/proc/self/statm").read_text().split()[1]) * resource.getpagesize() / 1e6


def memory_along(steps: int, path: Path) -> tuple[list[tuple[int, float]], Counter[str]]:
    """(step, MB) at every tenth of a run, and its events by kind."""
    found: list[tuple[int, float]] = []

    def tell(progress: hybrid.Progress) -> None:
        if progress.step >= (len(found) + 1) * steps // 10:
            gc.collect()
            found.append((progress.step, _resident()))

    with hybrid.run(_scene(steps), path, progress=tell, criterion=comes_and_goes) as result:
        assert result.status == "complete" and len(result["steps/t"]) == steps
        return found, Counter(event.kind for event in result.events)


def _stays(steps: int, path: Path, most: float) -> None:
    memory_along(2000, path)  # what is loaded at first use
    along, events = memory_along(steps, path)
    size = path.stat().st_size
    print(f"\n{steps} steps: " + ", ".join(f"{mb:.1f} MB at {n}" for n, mb in along))
    print(f"{size / 1e6:.1f} MB of file; events: {', '.join(f'{n} {kind}' for kind, n in events.most_common())}")
    changes = sum(events[kind] for kind in ZONE_EVENTS)
    assert changes > steps * STEP / PERIOD, "zones do not come and go"
    assert along[-1][1] - along[0][1] < most
    assert size < 1.5 * PER_STEP * steps + PER_EVENT * sum(events.values()) + 2e6


@pytest.mark.slow
def test_fifty_thousand_steps_take_no_more_memory_than_five_thousand(tmp_path: Path) -> None:
    _stays(50_000, tmp_path / "long.h5", 4.0)


@pytest.mark.bench
def test_a_million_steps_take_no_more_memory_than_a_hundred_thousand(tmp_path: Path) -> None:
    _stays(1_000_000, tmp_path / "long.h5", 8.0)


@pytest.mark.long
def test_events_that_repeat_are_counted_and_not_all_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What was left out is said, in the file and in the number of changes of zones at the end of a run."""
    everything = hybrid.run(_scene(8000), tmp_path / "all.h5", criterion=comes_and_goes)
    monkeypatch.setattr(record, "MOST_OF_A_KIND", 3)
    few = hybrid.run(_scene(8000), tmp_path / "few.h5", criterion=comes_and_goes)
    kinds = Counter(event.kind for event in everything.events)
    repeated = {kind: n for kind, n in kinds.items() if n > 3}
    assert repeated
    left = {event.criterion: event.value for event in few.events if event.kind == OMITTED}
    assert left == {kind: n - 3 for kind, n in repeated.items()}
    assert zones_over_time(few)["zone_changes"] == zones_over_time(everything)["zone_changes"]
