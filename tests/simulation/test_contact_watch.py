"""Events of outputs: a knot that tightens, and a line that leaves a sheave and comes back."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import hybrid
from hybrid.simulation.contact_watch import Knot, note_knot
from hybrid.simulation.knots import crossings_of_knot

Floats = NDArray[np.float64]
ROUND = np.linspace(0.0, 2.0 * np.pi, 300, endpoint=False)


def of_torus(p: int, q: int) -> Floats:
    """A closed curve p times around an axis and q times around a ring about it."""
    out = 2.0 + np.cos(q * ROUND)
    return np.column_stack([out * np.cos(p * ROUND), out * np.sin(p * ROUND), np.sin(q * ROUND)])


def opened(closed: Floats) -> Floats:
    """A closed curve, cut open where it is farthest out, both ends led away there."""
    out = closed - closed.mean(axis=0)
    at = int(np.argmax(np.linalg.norm(out, axis=1)))
    away = out[at] / np.linalg.norm(out[at])
    turned = np.roll(closed, -at, axis=0)
    aside = np.cross(away, [0.1, 0.2, 1.0])
    aside *= np.sign((turned[1] - turned[-1]) @ aside)
    return np.vstack([turned[0] + 20 * away + 3 * aside, turned, turned[-1] + 20 * away - 3 * aside])


EIGHT = (2.0 + np.cos(2 * ROUND)) * np.array([np.cos(3 * ROUND), np.sin(3 * ROUND)])


@pytest.mark.parametrize(
    ("curve", "expected"),
    [
        (of_torus(2, 3), 3),
        (np.column_stack([*EIGHT, np.sin(4 * ROUND)]), 4),  # figure eight
        (of_torus(2, 5), 5),
        (of_torus(2, 7), 7),
        (of_torus(3, 4), 8),
        (of_torus(1, 5), 0),
        (of_torus(5, 1), 0),
    ],
    ids=["trefoil", "figure eight", "cinquefoil", "seven", "eight", "coil", "turns of a coil"],
)
def test_crossings_are_those_of_the_table_of_knots(curve: Floats, expected: int) -> None:
    line = opened(curve)
    turn, _ = np.linalg.qr(np.random.default_rng(3).normal(size=(3, 3)))
    assert crossings_of_knot(line) == expected
    assert crossings_of_knot(line[::-1] @ turn) == expected


def drawn(size: float) -> tuple[Floats, Floats]:
    """Arc lengths (n,) and nodes (n, 3), m, of a line of 10 m with a trefoil in its middle, `size` times as large."""
    t = np.linspace(-2.05, 2.05, 60)
    knot = size * np.column_stack([t**3 - 3 * t, -(t**4 - 4 * t**2), (t**5 - 10 * t) / 20])
    out = [(a - b) / np.linalg.norm(a - b) for a, b in ((knot[0], knot[1]), (knot[-1], knot[-2]))]
    inside = np.linalg.norm(np.diff(knot, axis=0), axis=1).sum()
    ways = np.linspace(0.5 * (10.0 - inside), 0.02, 20)[:, None]
    r = np.vstack([knot[0] + ways * out[0], knot, knot[-1] + ways[::-1] * out[1]])
    return np.append(0.0, np.cumsum(np.linalg.norm(np.diff(r, axis=0), axis=1))), r


def test_a_knot_that_tightens_is_told_at_every_half_with_its_place() -> None:
    told: list[tuple[Any, ...]] = []

    def event(*which: Any, **more: Any) -> None:
        told.append((*which, more))

    known, sizes = Knot(), [0.2, 0.13, 0.09, 0.07, 0.04]
    for k, size in enumerate(sizes):
        s, r = drawn(size)
        known = note_knot(float(k), s, r, np.where(np.abs(s - 5.0) < 9.0 * size, 1.0, 0.0), known, event)
    assert [(t, kind) for t, _, _, kind, *_ in told] == [(2.0, "knot tightens"), (4.0, "knot tightens")]
    for t, first, last, _, text, more in told:
        assert first < 5.0 < last and more["value"] == pytest.approx(last - first)
        assert more["value"] < more["threshold"] and "of 3 crossings" in text
        assert 10.0 * sizes[int(t)] < last - first < 20.0 * sizes[int(t)]


def test_a_line_that_only_rises_along_its_course_has_no_knot() -> None:
    told: list[tuple[Any, ...]] = []
    s, r = drawn(0.2)
    r[:, 2] = 0.1 * s
    known = Knot()
    for size in (1.0, 0.3):
        known = note_knot(0.0, s, size * r, np.ones(len(s)), known, lambda *x, **_: told.append(x))
    assert not known.crossings and not told


def over_a_sheave(**more: Any) -> dict[str, Any]:
    """A rope of 4.02 m whose span a sheave lifts, goes down from, and comes back to, twice in 8 s."""
    section = {"length": 4.02, "mass": 1.0, "diameter": 0.02, "axial_stiffness": 1e5, "bending_stiffness": 0.5}
    sheave = {"kind": "sheave", "at": [0, 0, -0.3], "axis": [0, 1, 0], "radius": 0.3, "groove": 0.03, "rim": 0.02}
    sheave["motion"] = {"heave": {"amplitude": 0.3, "period": 4.0}, "ramp": 1.0}
    return {
        "cable": {"sections": [section | {"damping": {"mass": 1.0}}]}, "obstacles": {"wheel": sheave},
        "ends": {"start": {"kind": "pinned", "position": [-2, 0, 0]}, "end": {"kind": "pinned", "position": [2, 0, 0]}},
        "initial": {"kind": "equilibrium", "points": [[-2, 0, 0], [-0.2, 0, -0.05], [0, 0, 0.02], [0.2, 0, -0.05], [2, 0, 0]]},
        "model": "rod", "mesh": {"cells": 80}, "time": {"duration": 8.0, "step": 0.01},
        "output": {"every": 0.05, "points": 161},
    } | more  # fmt: skip


def departures(result: Any) -> list[Any]:
    return [e for e in result.events if e.kind == "line leaves the sheave"]


@pytest.mark.long
def test_a_line_leaves_a_sheave_and_comes_back() -> None:
    result = hybrid.run(over_a_sheave())
    place = result["obstacles/wheel/position"]
    out = np.linalg.norm((result.position - place[:, None])[:, :, [0, 2]], axis=2).min(axis=1)
    off = out > 0.3 + 0.03 + 0.02 + 1e-9  # beyond the rims
    lies = out < 0.3 + 0.011
    expected, on = [], False
    for t, lying, gone in zip(result.times, lies, off, strict=True):
        if on and gone:
            expected.append(t)
        on = lying or (on and not gone)
    found = departures(result)
    assert len(expected) == 2
    assert [e.t for e in found] == pytest.approx(expected)
    assert all(abs(e.s_a - 2.01) < 0.2 and "leaves wheel" in e.text and "farther out" in e.text for e in found)


def test_a_run_that_is_resumed_knows_where_the_line_lay(tmp_path: Any) -> None:
    whole = departures(hybrid.run(over_a_sheave()))
    simulation = hybrid.Simulation(hybrid.validate_scene(over_a_sheave()), tmp_path / "run.h5")
    simulation.advance(whole[0].t - 0.12)
    kept = simulation.save()
    simulation.advance(whole[0].t + 0.2)
    simulation.restore(kept)
    simulation.advance(whole[0].t + 0.2)
    found = departures(simulation.result())
    assert [(e.t, e.s_a, e.text) for e in found] == [(whole[0].t, whole[0].s_a, whole[0].text)]


def test_each_of_several_lines_leaves_the_sheave_by_itself() -> None:
    tables = over_a_sheave()
    cable, ends = tables.pop("cable"), tables.pop("ends")
    initial, model, mesh = (tables.pop(x) for x in ("initial", "model", "mesh"))
    points = {"a": {"position": ends["start"]["position"]}, "b": {"position": ends["end"]["position"]}}
    line = cable | {"start": "a", "end": "b", "model": model, "mesh": mesh, "initial": {"points": initial["points"]}}
    result = hybrid.run(tables | {"points": points, "lines": {"rope": line}})
    alone = departures(hybrid.run(over_a_sheave()))
    found = departures(result.lines["rope"])
    assert [e.t for e in found] == pytest.approx([e.t for e in alone], abs=0.051) and len(found) == 2
