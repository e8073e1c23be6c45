"""Outputs computed in batches, against one state at a time."""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from typing import Any

import numpy as np
import pytest

import hybrid
from hybrid.kernels.state.state import Batch, Floats
from hybrid.outputs.observation import JoinedObservation, Observation
from hybrid.outputs.probes import Observer
from tests.scenes import cable_scene, pinned_at

# Round-off of sums in another order, as a part of the largest value of a field in the run.
SAME = 1e-13
MOTION = {"heave": {"amplitude": 2.0, "period": 8.0}, "ramp": 16.0}
ACROSS = {"heave": {"amplitude": 2.0, "period": 8.0}, "sway": {"amplitude": 2.0, "period": 5.0}, "ramp": 16.0}
LOADS = [
    {"kind": "clump", "at": 100.0, "mass": 50.0, "volume": 0.02},
    {"kind": "float", "at": 180.0, "mass": 5.0, "volume": 0.05},
]
IN_ZONES = [{"rod": 20.0, "cells": 10}, {"catenary": 100.0, "cells": 20}, {"rod": 60.0, "cells": 10},
            {"catenary": 70.0, "cells": 10}]  # fmt: skip


def touchdown(model: Any, motion: dict[str, Any] = MOTION, loads: Sequence[Any] = (), **output: Any) -> dict[str, Any]:
    """A mooring line of 250 m on a seabed, its upper end moved."""
    section = {"length": 250.0, "diameter": 0.05, "mass": 20.0, "axial_stiffness": 2e8, "bending_stiffness": 2e4,
               "drag": {"normal": 1.2, "tangential": 0.05}, "added_mass": {"normal": 1.0}}  # fmt: skip
    bed = {"z": -100.0, "stiffness": 5e3, "damping": 5e2}
    return cable_scene(
        section, pinned_at(0, 0, -100), pinned_at(205, 0, 0, motion=motion), attachments=list(loads),
        fluid={"density": 1025.0}, seabed=bed, model=model, time=(4.0, 0.1),
        output={"every": 0.2, "points": 77, **output}
    ) | ({} if isinstance(model, dict) and "zones" in model else {"mesh": {"cells": 50}})  # fmt: skip


def hanging(model: str, *loads: dict[str, Any], **output: Any) -> dict[str, Any]:
    """A line of 2 m in air whose end is free, or carries a body."""
    section = {"length": 2.0, "diameter": 0.01, "mass": 0.1, "axial_stiffness": 1e4, "bending_stiffness": [1e-2, 2e-2],
               "torsional_stiffness": 1e-2, "damping": {"stiffness": 0.001}}  # fmt: skip
    if model != "rod":
        section["bending_stiffness"] = 1e-3
    held = {"kind": "clamped", "position": [0, 0, 0], "tangent": [0, 0, -1], "normal": [1, 0, 0]}
    return cable_scene(
        section, held | {"motion": ACROSS | {"ramp": 16.0}}, "free", attachments=list(loads), model=model, mesh=30,
        time=(0.4, 0.01), output={"every": 0.02, "points": 41, **output}
    )  # fmt: skip


def clump(at: float) -> dict[str, Any]:
    return {"kind": "clump", "at": at, "mass": 0.05}


SCENES = {
    "catenary": touchdown("catenary"),
    "rod": touchdown("rod"),
    "rod in space": touchdown("rod", ACROSS),
    "zones": touchdown({"kind": "zones", "zones": IN_ZONES}),
    "zones that move": touchdown({"kind": "adaptive", "tolerance": 2e-5}, criteria=True),
    "point loads": touchdown("rod", loads=LOADS),
    "point loads on a catenary": touchdown("catenary", loads=LOADS),
    "errors of zones with point loads": touchdown({"kind": "zones", "zones": IN_ZONES}, loads=LOADS, errors=True),
    "errors of the model": touchdown("catenary", errors=True),
    "free end": hanging("rod"),
    "body at the end": hanging("rod", clump(2.0)),
    "body at the end of a catenary": hanging("catenary", clump(1.0), clump(2.0), errors=True),
}


# Fields that are a small difference of larger ones, and the field whose size their round-off has.
SIZED_BY = {
    "torque": "bending_moment", "work/scheme": "energy/potential",
}  # fmt: skip


def compare(found: dict[str, Floats], expected: dict[str, Floats]) -> None:
    """Fields (nb, ...) that both have."""
    for name in found.keys() & expected.keys():
        x, y = found[name], expected[name]
        assert x.shape == y.shape, name
        assert np.array_equal(np.isnan(x), np.isnan(y)), name
        size = np.nan_to_num(expected[SIZED_BY.get(name.removeprefix("right/"), name)])
        np.testing.assert_allclose(x, y, rtol=0.0, atol=SAME * float(np.abs(size).max()), err_msg=name)


def alone(observer: Observer, seen: Observation, k: int) -> dict[str, Floats]:
    """Fields (1, ...) of output k, looked at by itself."""
    by_itself = copy(observer)
    if isinstance(seen, JoinedObservation):
        one = seen.one(k)
        by_itself.line, by_itself.grid = one.line, observer.grid.of[k]
        by_itself._after = observer._after.of[k] if observer._right else None
        return VALUES_OF(by_itself, one)
    one = observer.observation(Batch(*(np.array(x[k : k + 1]) for x in seen.batch)))
    by_itself._criteria = []
    return VALUES_OF(by_itself, one)


VALUES_OF = Observer.values_of


@pytest.mark.long
@pytest.mark.parametrize("name", SCENES)
def test_a_batch_is_what_its_states_are_one_by_one(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    past: dict[Observer, list[tuple[Batch, Any, dict[str, Floats]]]] = {}

    def watched(self: Observer, seen: Observation, ratios: Floats | None = None) -> dict[str, Floats]:
        found, batch = VALUES_OF(self, seen, ratios), seen.batch
        rows = [alone(self, seen, k) for k in range(batch.t.size)]
        compare(found, {field: np.concatenate([row[field] for row in rows]) for field in rows[0]})
        copied = Batch(*(np.array(x) for x in batch))  # the next steps overwrite it
        past.setdefault(self, []).append((copied, ratios, found))
        return found

    monkeypatch.setattr(Observer, "values_of", watched)
    hybrid.run(SCENES[name])
    observer, taken = max(past.items(), key=lambda item: (len(item[0].fields), len(item[1])))
    batches, ratios, found = zip(*taken, strict=True)
    batch = Batch(*(np.concatenate(parts) for parts in zip(*batches, strict=True)))
    wide = Batch(*(np.repeat(x, 3, axis=0).reshape(len(x), 3, *x.shape[1:])[:, 1] for x in batch))  # views
    again = VALUES_OF(observer, observer.observation(wide), None if ratios[0] is None else np.concatenate(ratios))
    compare(again, {field: np.concatenate([part[field] for part in found]) for field in again})
    computed = [x for field, x in again.items() if not field.startswith("criteria/")]
    assert all(x.flags.c_contiguous and not np.shares_memory(x, wide.work) for x in computed)
