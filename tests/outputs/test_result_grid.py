"""Interpolation to the output points, against one made point by point, and outputs in batches, against one at a time."""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from scipy.interpolate import CubicHermiteSpline

import hybrid
from hybrid.kernels.state.state import Batch, Floats
from hybrid.model.mesh import Zone
from hybrid.outputs import observed_states
from hybrid.outputs.observation import JoinedGrid, JoinedObservation, Observation
from hybrid.outputs.observed_states import Grid, means_beside
from hybrid.outputs.probes import Observer
from tests.inside import calls_of
from tests.scenes import cable_scene, pinned_at


def slope(x: Floats, y: Floats, i: int) -> Floats:
    """Derivative at node i of the parabola through the three nearest nodes, of the line where there are only two."""
    near = sorted(sorted(range(x.size), key=lambda j: abs(j - i))[:3])
    return np.polyfit(x[near] - x[i], y[near], len(near) - 1)[-2]


def line(x: Floats, y: Floats, at: float) -> Floats:
    """Through the two next to `at`, or the nearest two."""
    if x.size == 1:
        return y[0]
    k = min(max(int(np.searchsorted(x, at)), 1), x.size - 1)
    return y[k - 1] + (y[k] - y[k - 1]) * (at - x[k - 1]) / (x[k] - x[k - 1])


def plain(
    nodes: Floats, spans: list[tuple[int, int, int]], s: Floats, after: bool, loads: list[float]
) -> dict[str, Floats]:
    """The matrices, as what interpolation makes of the values 1, 0, 0, ... and 0, 1, 0, ... and so on."""
    n, sides = nodes.size, sum(b - a + 1 for a, b, _ in spans)
    middles = 0.5 * (nodes[:-1] + nodes[1:])
    with_ends = np.concatenate([[0.0], middles, nodes[-1:]])
    rows: dict[str, list[Floats]] = {"nodes": [], "cells": [], "held": [], "sides": []}
    for at in s.tolist():
        if after:
            a, b, offset = next(span for span in reversed(spans) if at >= nodes[span[0]] * (1 - 1e-13))
        else:
            a, b, offset = next(span for span in spans if at <= nodes[span[1]] * (1 + 1e-13))
        x, own = nodes[a : b + 1], np.eye(n)[a : b + 1]
        slopes = np.array([slope(x, own, i) for i in range(x.size)])
        rows["nodes"].append(CubicHermiteSpline(x, own, slopes)(at))
        rows["cells"].append(line(middles[a:b], np.eye(n - 1)[a:b], at))
        near_end = at < middles[0] or at > middles[-1]
        first, last = (0, n + 1) if near_end else (a + 1, b + 1)
        if not near_end and last == first + 1:  # one cell: across joints, and to the ends of the line
            first, last = first - (nodes[a] not in loads), last + (nodes[b] not in loads)
        rows["held"].append(line(with_ends[first:last], np.eye(n + 1)[first:last], at))
        rows["sides"].append(line(x, np.eye(sides)[offset : offset + x.size], at))
    return {name: np.array(x) for name, x in rows.items()}


@pytest.mark.parametrize("after", [False, True])
@pytest.mark.parametrize("seed", range(60))
def test_matrices_are_those_of_a_plain_interpolation(seed: int, after: bool) -> None:
    """Stretches of one, two and more cells, cut by joints and by loads; points on nodes, middles and in between."""
    random = np.random.default_rng(seed)
    cells = random.integers(1, 2 + seed % 5, random.integers(1, 7))
    nodes = np.concatenate([[0.0], np.cumsum(random.uniform(0.3, 2.0, cells.sum()))])
    cuts = [0, *np.cumsum(cells).tolist()]
    is_joint = [True, *(random.random(len(cuts) - 2) < 0.5), True]
    joints = [k for k, joint in zip(cuts, is_joint, strict=True) if joint]
    loads = [float(nodes[k]) for k, joint in zip(cuts, is_joint, strict=True) if not joint]
    kinds = ("rod", "catenary") if seed % 2 else ("catenary", "rod")
    zones = [Zone(kinds[i % 2], float(nodes[a]), float(nodes[b])) for i, (a, b) in enumerate(pairwise(joints))]
    s = np.unique([*nodes, *(0.5 * (nodes[:-1] + nodes[1:])), *random.uniform(0.0, nodes[-1], 20)])

    grid = Grid(nodes, zones, s, loads, after=after)

    assert grid.spans == [(a, b, a + i) for i, (a, b) in enumerate(pairwise(cuts))]
    assert grid.side_nodes.tolist() == [k for a, b in pairwise(cuts) for k in range(a, b + 1)]
    assert [(part.s_a, part.s_b) for part in grid.parts] == [(nodes[a], nodes[b]) for a, b in pairwise(cuts)]
    assert grid.loads == tuple(loads)
    assert grid.s is s
    for name, expected in plain(nodes, grid.spans, s, after, loads).items():
        matrix = getattr(grid, name)
        for a, b in pairwise(matrix.begin):
            assert (np.diff(matrix.columns[a:b]) > 0).all()
        assert (matrix.weights != 0.0).all()
        np.testing.assert_allclose(matrix @ np.eye(expected.shape[1]), expected, rtol=0.0, atol=1e-12, err_msg=name)


def test_grids_of_many_lines_are_made_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """The matrices of lines one behind the other are those of each, made in one call for all of them."""
    rng, s, grids = np.random.default_rng(3), np.linspace(0.0, 10.0, 41), []
    for cells in (1, 5, 12, 30):
        x = np.unique(np.concatenate([[0.0, 10.0], rng.choice(s[1:-1], cells - 1, replace=False)]))
        zones = [Zone("rod", 0.0, 10.0)]
        if cells > 1:
            zones = [Zone("rod", 0.0, x[cells // 2]), Zone("catenary", x[cells // 2], 10.0)]
        grids.append(Grid(x, zones, s, [x[1]] if cells > 1 else []))
    calls, joined = calls_of(monkeypatch, observed_states, "_rows"), JoinedGrid(grids)
    found = {name: getattr(joined, name) for name in ("nodes", "cells", "chords", "held", "sides")}
    assert len(calls) == 5
    for name, rows in found.items():
        gap = name == "cells"  # a cell between two lines belongs to none
        sizes = [grid._x.size + {"held": 1, "sides": len(grid.spans) - 1}.get(name, 0) for grid in grids]
        values = [rng.normal(size=n - gap) for n in sizes]
        at_once = rows @ np.concatenate([np.append(v, [9.9] * gap) for v in values])[:, None]
        alone = np.concatenate([getattr(grid, name) @ v[:, None] for grid, v in zip(grids, values, strict=True)])
        np.testing.assert_array_equal(at_once, alone, err_msg=name)


# --- Means over the lengths of output points: they keep the integral and miss nothing between the points ---


@pytest.mark.parametrize("points", [5, 37, 400], ids=["coarser", "about as fine", "finer"])
def test_the_integral_is_kept(points: int) -> None:
    random = np.random.default_rng(points)
    nodes = np.append(0.0, np.cumsum(random.uniform(0.5, 1.5, 40)))
    values = np.zeros((3, nodes.size))
    values[:, 17:19] = random.uniform(1.0, 2.0, (3, 2))
    s = np.linspace(0.0, nodes[-1], points)
    found = means_beside(s, nodes, values)
    edges = np.concatenate([[0.0], 0.5 * (s[1:] + s[:-1]), [nodes[-1]]])
    integral = (0.5 * np.diff(nodes) * (values[:, 1:] + values[:, :-1])).sum(axis=1)
    np.testing.assert_allclose((found * np.diff(edges)[:, None]).sum(axis=0), integral, rtol=1e-13)
    assert (found >= -1e-12).all() and (found.max(axis=0) > 0.0).all()
    if points == 400:
        np.testing.assert_allclose(found[:, 0], np.interp(s, nodes, values[0]), atol=0.1)


def test_what_is_linear_stays_so_inside() -> None:
    nodes, s = np.linspace(0.0, 7.0, 15), np.linspace(1.0, 6.0, 11)
    np.testing.assert_allclose(means_beside(s, nodes, 2.0 * nodes[None])[:, 0], 2.0 * s, rtol=1e-13)


# --- outputs computed in batches, against one state at a time ---

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
