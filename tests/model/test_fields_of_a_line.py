"""Every field of a line is carried wherever a line is made or changed: zones, cells that follow, payout, release.

What a material has per length and its scene does not ask for is given a number of its own here, so that a field which
has been added to `Line` (docs/extend.md, "A force") is walked as well, by no more than its name.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import hybrid
import hybrid.model.payout
from hybrid.kernels.state.report import FRICTION, SEABED
from hybrid.kernels.state.state import ALONG_LINE, NODES_OF_LINE, Line
from hybrid.model.build import Model, build, in_space, planar
from hybrid.model.line import NO_INERTIA, line_on
from hybrid.model.material import Material, material
from hybrid.model.nearby import without_hold
from hybrid.scene.read import one_line
from tests.inside import OnlyLine
from tests.scenes import cable_scene, pinned_at

ROUND = 1e-12
# Fields in which the time counts: lengths on their way to their true ones, and what balances a node that has entered.
IN_TIME = {"h", "force"}
# Of rods that come and go: cross-sections without inertia, unless nothing else holds their spin.
WITHOUT_INERTIA = {"rotary", "polar"}
SECTION = {"diameter": 0.03, "mass": 1.5, "axial_stiffness": 2e6, "bending_stiffness": 60, "torsional_stiffness": 50}
FORCES = {
    "drag": {"normal": 1.2, "tangential": 0.01}, "added_mass": {"normal": 1.0, "tangential": 0.1},
    "damping": {"mass": 0.01, "stiffness": 1e-3}, "intrinsic_curvature": [0.0, 0.001, 0.0],
}  # fmt: skip
FLOAT = {"kind": "float", "at": 22.0, "buoyancy": 200, "mass": 15, "drag_area": 0.3, "added_mass": 20, "height": 0.5}
FLOAT |= {"shape": "cylinder"}
CLUMP = {"kind": "clump", "at": 12.0, "mass": 60, "volume": 0.02, "drag_area": 0.1, "added_mass": 25, "height": 0.2}
SEA = {
    "fluid": {
        "density": 1025, "surface": 0, "current": [0.2, 0, 0],
        "waves": {"kind": "regular", "height": 0.2, "period": 6, "direction": 0},
    },
    "seabed": {"z": -200, "stiffness": 1e3},
}  # fmt: skip


def tether(**more: Any) -> hybrid.Scene:
    """60 m of line with two sections and a float, and all forces on."""
    sections = [SECTION | FORCES | {"length": 40}, SECTION | FORCES | {"length": 20, "mass": 2.0, "diameter": 0.04}]
    tables = cable_scene(
        sections,
        pinned_at(0, 0, -40),
        pinned_at(30, 0, -3, motion={"heave": {"amplitude": 1.5, "period": 3}, "ramp": 3}),
        attachments=[CLUMP, FLOAT],
        environment=SEA,
        model="adaptive",
        mesh=24,
        time=(3, 0.02),
    )
    return hybrid.validate_scene(tables | more)


def paid_out(model: Any, rate: float) -> hybrid.Scene:
    """The same, straight without load, from a winch; the float is far from it."""
    straight = [
        {k: v for k, v in (SECTION | FORCES).items() if k not in ("intrinsic_curvature", "damping")}
        | {"length": 60, "damping": {"mass": 0.01}}
    ]
    end = {"kind": "pinned", "position": [30, 0, -3], "payout": {"rate": rate, "begin": 0.2, "ramp": 0.5}}
    cable = {"sections": straight, "attachments": [CLUMP, FLOAT]}
    start = {"kind": "pinned", "position": [0, 0, -40]}
    return tether(cable=cable, ends={"start": start, "end": end}, model=model)


@pytest.fixture(autouse=True)
def numbers_for_all(monkeypatch: pytest.MonkeyPatch) -> None:
    """What a material has per length and nobody asked for is a number of its own in each piece, not NaN."""

    def filled(scene: hybrid.Scene, nodes: Any = None) -> Material:
        cable = material(scene, nodes)
        for k, field in enumerate(dataclasses.fields(Material)):
            x = getattr(cable, field.name)
            if isinstance(x, np.ndarray) and x.shape == cable.mass.shape and np.isnan(x).all():
                setattr(cable, field.name, (2.0 + k) * cable.mass)
        return cable

    monkeypatch.setattr(hybrid.model.payout, "material", filled)


def check(line: Line, cable: Material, but: set[str] = WITHOUT_INERTIA, shape: Line | None = None) -> None:
    """A line is that of its material on its nodes."""
    s = (shape or line).s
    same = line_on(cable, s, line.spin == 1, 512)
    for name in ALONG_LINE:
        a, b = getattr(line, name), getattr(same, name)
        assert a.shape[0] == s.size - (name not in NODES_OF_LINE), name
        if name not in but:
            np.testing.assert_allclose(a, b, rtol=ROUND, atol=1e-14, err_msg=name)


def test_the_walk_meets_every_field() -> None:
    """All fields have numbers in the line that others are held against, so that none is equal for want of any."""
    model = build(one_line(tether(model="rod")))
    silent = {name for name in ALONG_LINE if not np.nan_to_num(getattr(model.line, name)).any()}
    assert not silent, "a field that is nothing anywhere: give the scene what makes it something"


def test_lines_of_zones_have_every_field() -> None:
    model = build(one_line(tether()))
    assert model.layout is not None and model.on_base is not None
    random = np.random.default_rng(3)
    for _ in range(3):
        here = random.random(model.layout.starts[-1] + 1) < 0.5
        layout = model.layout._replace(rod=random.random(model.layout.rod.size) < 0.5, here=here)
        check(model.on_base.line(layout, model.line.bits), model.cable)


def lines_of_a_run(scene: hybrid.Scene) -> Iterator[tuple[Model, Line]]:
    with hybrid.Simulation(scene) as simulation:
        run = OnlyLine(simulation)
        for t in (1.0, 2.0, 3.0):
            simulation.advance(t)
            yield run.model, run.model.line


@pytest.mark.parametrize(
    "model", [{"kind": "adaptive"}, {"kind": "adaptive", "curvature_error": 0.1}], ids=["zones", "cells"]
)
def test_a_run_whose_cells_change_keeps_every_field(model: dict[str, Any]) -> None:
    sizes = set()
    for at, line in lines_of_a_run(tether(model=model)):
        check(line, at.cable, WITHOUT_INERTIA | {"kb", "k0", "h"})  # stiffness comes and goes in time
        sizes.add((line.h.size, int(line.spin.sum())))
    assert len(sizes) > 1


@pytest.mark.parametrize("rate", [2.0, -2.0])
@pytest.mark.parametrize("model", ["rod", {"kind": "adaptive", "curvature_error": 0.1}], ids=["rod", "cells"])
def test_payout_keeps_every_field(model: Any, rate: float) -> None:
    """Nodes enter and leave, cells grow and shrink."""
    sizes = set()
    for at, line in lines_of_a_run(paid_out(model, rate)):
        assert at.payout is not None
        but = WITHOUT_INERTIA | IN_TIME | ({"kb", "k0"} if model != "rod" else set())
        check(line, at.payout.held_as(at.cable), but)
        sizes.add(line.h.size)
    assert len(sizes) > 1


@pytest.mark.parametrize(
    "change", [lambda x: without_hold(x, 1, 0.0).line, lambda x: in_space(planar(x.line, np.eye(3)))]
)
def test_release_and_the_plane_keep_every_field(change: Callable[[Model], Line]) -> None:
    model = build(one_line(tether(model="rod")))
    line = change(model)
    for name in ALONG_LINE:
        np.testing.assert_array_equal(getattr(line, name), getattr(model.line, name), err_msg=name)


# --- Lines on base cells, compiled, are those of the material on nodes, whatever is rod ---

EXAMPLES = Path(__file__).parents[2] / "examples"
ROUND_OFF = 4e-16  # a product and a sum may be one operation


@pytest.mark.parametrize("name", ["touchdown", "rov_tether", "laying", "irregular_sea"])
def test_a_line_on_base_cells_is_that_of_the_material(name: str) -> None:
    """Sections, floats, end bodies, waves, a seabed with friction; any base cells rod, any of their nodes there."""
    scene = hybrid.load_scene(EXAMPLES / f"{name}.yaml", ["model={kind: adaptive, curvature_error: 0.05}"])
    model = build(one_line(scene))
    assert model.layout is not None and model.on_base is not None
    random = np.random.default_rng(1)
    for _ in range(3):
        rod = random.random(model.layout.rod.size) < 0.5
        layout = model.layout._replace(rod=rod, here=random.random(model.layout.starts[-1] + 1) < 0.5)
        more = model.line.bits & (SEABED | FRICTION)
        same = line_on(model.cable, layout.nodes, layout.rod_cells, more, NO_INERTIA)
        line = model.on_base.line(layout, same.bits)
        for field, a, b in zip(line._fields, line, same, strict=True):
            np.testing.assert_allclose(a, b, rtol=ROUND_OFF, atol=0.0, err_msg=field)
        assert set(layout.base) <= set(layout.nodes.tolist()) and layout.nodes.size == line.s.size < model.line.s.size


def test_an_end_that_is_let_go_holds_no_later_line() -> None:
    """Zones that change after the release of a clamp make lines without it."""
    scene = hybrid.load_scene(EXAMPLES / "s_tether.yaml")
    data = scene.model_dump(mode="json", exclude_none=True)
    data["ends"]["end"] = {"kind": "clamped", "position": [20, 0, -30], "tangent": [0, 0, -1]}
    model = build(one_line(hybrid.validate_scene(data | {"model": "adaptive"})))
    assert model.layout is not None and model.on_base is not None
    assert model.on_base.line(model.layout, model.line.bits).element[-1] == 1
    free = without_hold(model, 1, 0.0)
    assert free.on_base is not None
    line = free.on_base.line(model.layout, free.line.bits)
    assert line.element[-1] == 0 and not line.kb[-1].any() and line.element[1:-1].all()
