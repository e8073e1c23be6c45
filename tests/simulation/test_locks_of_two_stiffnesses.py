"""Bend restrictors on sections with two bending stiffnesses, and tables of moment beside these."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import hybrid
from tests.scenes import cable_scene, clamped_at, pinned_at

EI, OTHER, LOCKED, RADIUS = 20.0, 50.0, 300.0, 3.0
TABLE = [[0.0, 0.0], [0.1, 4.0], [0.3, 8.0], [1.0, 36.0]]


def bent(axis: int, sections: list[dict[str, Any]], attachments: list[dict[str, Any]], cells: int, **more: Any) -> Any:
    """Six metres between a clamp and a pin, sagging in the plane in which it bends about one of its axes."""
    plain = {"mass": 2.0, "axial_stiffness": 1e5, "torsional_stiffness": 30.0, "damping": {"mass": 1.0}}
    normal = [0, 1, 0] if axis == 0 else [0, 0, 1]
    return cable_scene(
        [plain | x for x in sections], clamped_at([0, 0, 0], [1, 0, 0], normal=normal), pinned_at(4.5, 0, 0.5),
        attachments=attachments, model="rod", mesh=cells, output={"points": 25, "exact": True}
    ) | more  # fmt: skip


def about(axis: int) -> list[float]:
    """EI about this axis, more about the other one: bent about the stiffer one it would turn over."""
    return [OTHER, EI] if axis else [EI, OTHER]


def sleeve(a: float, b: float) -> dict[str, Any]:
    return {"kind": "bend_restrictor", "range": [a, b], "radius": RADIUS, "locked_stiffness": LOCKED}


def apart(one: hybrid.Result, two: hybrid.Result) -> float:
    return float(np.abs(one.position - two.position).max())


@pytest.mark.long
@pytest.mark.parametrize("axis", [0, 1])
def test_about_an_axis_it_is_the_restrictor_of_that_stiffness(axis: int) -> None:
    """All of the line, so that no element is at its edge: at rest, and swinging."""
    moves = {"motion": {"travel": {"by": [-0.5, 0, 0.3], "over": 0.5}}}
    for dimension in (2, 3):
        found = []
        for stiffness in (about(axis), EI):
            scene = bent(
                axis, [{"length": 6.0, "bending_stiffness": stiffness}], [sleeve(0, 6)], 30, dimension=dimension
            )
            scene["ends"]["end"] |= moves
            found.append(hybrid.run(scene | {"time": {"duration": 1.0, "step": 0.01}}))
        two, one = found
        assert apart(two, one) < 1e-8
        assert two["bending_moment"] == pytest.approx(one["bending_moment"], abs=1e-6)
        assert two["energy/bending"] == pytest.approx(one["energy/bending"], rel=1e-7)
        assert one["curvature"].max() > 1.1 / RADIUS  # it is locked
        loose = hybrid.static(bent(axis, [{"length": 6.0, "bending_stiffness": EI}], [], 30))
        assert float(np.abs(loose.position[0] - two.position[0]).max()) > 0.05


@pytest.mark.parametrize("axis", [0, 1])
@pytest.mark.parametrize("what", ["sleeve", "table"])
def test_at_an_edge_it_comes_to_the_same(axis: int, what: str) -> None:
    """Of the element there both halves have one curvature, which jumps from 0.37 to 0.86 1/m: of first order."""
    off = []
    for cells in (48, 96, 192):
        found = []
        for stiffness in (about(axis), EI):
            table = {"length": 3.0, "moment_curvature": TABLE}
            first = {"length": 3.0 if what == "table" else 6.0, "bending_stiffness": stiffness}
            sections = [first, table] if what == "table" else [first]
            found.append(hybrid.static(bent(axis, sections, [] if what == "table" else [sleeve(1.5, 3.0)], cells)))
        off.append(apart(*found))
        assert found[1]["curvature"].max() > 1.1 / RADIUS
    assert off[0] < 0.01
    assert 3.6 < off[0] / off[2] < 4.6, off


def test_bent_out_of_its_axes_its_energy_is_kept() -> None:
    """Without damping, with order two in the step: force and energy are of one potential."""
    lost = []
    for step in (0.004, 0.002):
        half = {"length": 3.0, "bending_stiffness": [EI, OTHER], "damping": {"mass": 0.0}}
        scene = bent(
            0, [half, {"length": 3.0, "moment_curvature": TABLE, "damping": {"mass": 0.0}}], [sleeve(0, 2)], 24
        )
        scene["ends"]["start"]["normal"] = [0, 1, 0.7]
        scene["ends"]["end"] = {"kind": "free", "force": {"value": [5, 8, 30], "until": 0.5}}
        run = hybrid.run(scene | {"time": {"duration": 1.0, "step": step, "rho_inf": 1.0}})
        moving = run["energy/kinetic"].max()
        assert moving > 5.0 and run["curvature"].max() > 1.05 / RADIUS
        lost.append(np.abs(run["work/scheme"]).max() / moving)
    assert lost[1] < 0.01 and lost[1] < 0.5 * lost[0], lost
