"""Curvature of rods whose stiffness is under way: a kink that a joint leaves behind is no bend of the line."""

from __future__ import annotations

from pathlib import Path
from typing import Any, cast

import numpy as np
import pytest

import hybrid
from hybrid.model.build import build
from hybrid.model.material import Material
from hybrid.scene.read import one_line, validate_scene
from tests.combinations.pairs import BASE, END, FEATURES, SECTION
from tests.problems import tables_with
from tests.said import of_kind
from tests.scenes import cable_scene, pinned_at
from tests.simulation.bits import resumed

MOVES = {"kind": "adaptive", "always_move": True}
LINES: dict[str, dict[str, Any]] = {
    "60 m, level": {"lengths": [60], "end": [40, 0, 0], "EI": 10},
    "60 m, in space": {"lengths": [60], "end": [20, 0, -30], "EI": 100, "across": 0.4},
    "100 m": {"lengths": [100], "end": [60, 0, -20], "EI": 100},
    "two sections, clamped": {"lengths": [35, 25], "end": [35, 0, 0], "EI": 10, "tangent": [0.2, 0, 1]},
    "several EI/GJ": {"lengths": [28, 32], "end": [40, 0, 0], "EI": 5, "GJ": [9, 7]},
    "stiffener": {"lengths": [60], "end": [40, 0, 0], "EI": 10, "stiffener": [31, 35]},
}


def slack(
    lengths: list[float], end: list[float], EI: float, model: Any, across: float = 0.0, tangent: Any = None,
    GJ: Any = (), stiffener: Any = None,
) -> dict[str, Any]:  # fmt: skip
    """A slack line in water of 480 cells, whose upper end heaves; outputs at every step and node.

    The second section is four times as stiff as the first.
    """
    section = {"diameter": 0.025, "mass": 0.65, "axial_stiffness": 1e6, "drag": {"normal": 1.2}}
    sections = [section | {"length": x, "bending_stiffness": EI * 4**k} for k, x in enumerate(lengths)]
    for x, torsion in zip(sections, GJ, strict=False):
        x["torsional_stiffness"] = torsion
    cone = {"kind": "bend_stiffener", "range": stiffener, "diameters": [0.05, 0.04], "bore": 0.03, "modulus": 1e7}
    motion = {"heave": {"amplitude": 1.0, "period": 7.0}, "ramp": 7.0}
    held = {"kind": "pinned"} if tangent is None else {"kind": "clamped", "tangent": tangent}
    return cable_scene(
        sections,
        pinned_at(0, 0, 0, motion=motion),
        held | {"position": end},
        attachments=[cone] * (stiffener is not None),
        fluid={"density": 1025, "current": [0.3, across, 0]},
        contact={"self": False},
        mesh=480,
        time=(12.0, 0.05),
        model=model,
        output=(0.05, 481),
    )


@pytest.mark.long
@pytest.mark.parametrize("name", LINES)
def test_a_joint_that_moves_on_leaves_no_bend_behind(name: str) -> None:
    """The smallest bend radius of zones that move is that of rods: half and a third of it, before."""
    moves, rods = (hybrid.run(slack(**LINES[name], model=x)) for x in (MOVES, {"kind": "rod"}))
    assert sum(event.kind == "grow" for event in moves.events) >= 3
    smallest, true = (1.0 / np.nanmax(x["envelope/curvature_max"]) for x in (moves, rods))
    print(f"{name}: smallest bend radius {smallest:.2f} m, of rods {true:.2f} m")
    assert smallest == pytest.approx(true, rel=0.05)
    largest, of_rods = moves.curvature.max(axis=0), rods.curvature.max(axis=0)
    counts = of_rods > 0.2 * of_rods.max()
    assert (largest < 1.2 * np.maximum(of_rods, 0.2 * of_rods.max())).all()
    assert (largest > 0.9 * of_rods)[counts].all()


@pytest.mark.long
@pytest.mark.parametrize("name", ["60 m, level", "several EI/GJ"])
def test_while_line_is_paid_out_as_well(name: str) -> None:
    scenes = [slack(**LINES[name], model=x) for x in (MOVES, {"kind": "rod"})]
    for scene in scenes:
        scene["ends"]["end"]["payout"] = {"rate": 0.2, "ramp": 2.0}
    moves, rods = map(hybrid.run, scenes)
    assert sum(event.kind == "grow" for event in moves.events) >= 3
    smallest, true = (1.0 / np.nanmax(x["envelope/curvature_max"]) for x in (moves, rods))
    assert smallest == pytest.approx(true, rel=0.05)


@pytest.mark.long
@pytest.mark.parametrize("name", ["60 m, in space", "two sections, clamped", "several EI/GJ", "stiffener"])
def test_steps_and_outputs_have_the_same(name: str) -> None:
    """Where every step has an output and every node a point, extremes are those of the outputs."""
    found = hybrid.run(slack(**LINES[name], model=MOVES))
    before = np.append(True, np.diff(found["envelope/s"][:]) > 0.0)  # where sections meet the side that points show
    np.testing.assert_allclose(found["envelope/s"][before], found.s, atol=1e-9)
    changes = np.array([event.t for event in found.events])  # then a step ends with other zones than its output has
    times = found["envelope/curvature_t_max"][before]
    apart = np.abs(times[:, None] - changes).min(axis=1) > 0.01
    apart[[0, -1]] = False
    assert apart.mean() > 0.8
    envelope, outputs = found["envelope/curvature_max"][before][apart], found.curvature.max(axis=0)[apart]
    np.testing.assert_allclose(envelope, outputs, rtol=1e-6, atol=1e-9 * outputs.max())


LEFT: dict[str, dict[str, Any]] = {
    "tables of moment": {"moment_curvature": [[0, 0], [0.1, 1.0], [0.3, 2.4]], "bending_stiffness": None},
    "intrinsic curvature": {"intrinsic_curvature": [0, 0.001, 0], "torsional_stiffness": 8.0},
}


def limited(radius: float, **section: Any) -> dict[str, Any]:
    """A slack line of 240 cells whose zones move, with a smallest allowed bend radius, m."""
    scene = slack(**LINES["60 m, level"], model=MOVES) | {"mesh": {"cells": 240}}
    scene["cable"]["sections"][0] |= {"min_bend_radius": radius} | section
    scene["time"]["duration"] = 4.0
    return scene


@pytest.mark.parametrize("name", LEFT)
def test_where_kinks_count_as_bends_an_event_says_so(name: str) -> None:
    """Once, of all the line; no verdict on bends, beyond the limit or within it."""
    for radius in (8.0, 0.1):
        found = hybrid.run(limited(radius, **LEFT[name]))
        (said,) = of_kind(found, "kink at joint")
        first = next(event for event in found.events if event.kind == "grow")
        assert said.t == first.t > 0.0 and (said.s_a, said.s_b) == (0.0, 60.0)
        assert name in said.text and "model: rod" in said.text
        place = float(said.text.split()[3])
        assert min(abs(place - first.s_a), abs(place - first.s_b)) < 0.01
        (limit,) = found.verdicts().limits
        assert limit.allowed == radius and (limit.value < radius) == (radius == 8.0)
        assert limit.verdict == "not verified" and not limit.broken and limit.used is None
        assert limit.why == "kink at joint" and "model: rod" in limit.remedy


def test_what_no_kink_can_have_broken_is_broken() -> None:
    """Of lines of one EI/GJ; and a limit that is broken before a rod grows stays so."""
    early = limited(8.0, **LEFT["intrinsic curvature"])
    early["ends"]["end"] |= {"kind": "clamped", "tangent": [0.2, 0, 1]}
    found = hybrid.run(early)
    (limit,) = found.verdicts().limits
    assert limit.verdict == "broken" and limit.t < of_kind(found, "kink at joint")[0].t
    found = hybrid.run(limited(12.0))
    assert any(event.kind == "grow" for event in found.events) and not of_kind(found, "kink at joint")
    (limit,) = found.verdicts().limits
    assert limit.verdict == "broken" and limit.value > 10.0


def test_a_run_that_is_resumed_says_it_once(tmp_path: Path) -> None:
    whole = resumed(limited(8.0, **LEFT["tables of moment"]), tmp_path, 3.5)
    assert len(of_kind(whole, "kink at joint")) == 1 and sum(x.kind == "grow" and x.t > 3.5 for x in whole.events) > 0


MOMENT = {END: {"kind": "free", "force": [40, 3, 30], "moment": [0, 1, 0]}}
SECTIONS = [SECTION | {"length": 5.0}, SECTION | {"length": 7.0, "bending_stiffness": 80, "torsional_stiffness": 60}]
STIFF: dict[str, dict[str, Any]] = {
    "sprung clamp": FEATURES["zones"][0] | FEATURES["sprung clamp"][0],
    "swivel": FEATURES["swivel"][0],
    "given moment": FEATURES["clamp"][0] | MOMENT,
    "sections": {"cable.sections": SECTIONS},
    "swivel at a clamp": FEATURES["zones"][0] | FEATURES["swivel at a clamp"][0],
}


@pytest.mark.parametrize("name", STIFF)
def test_rods_with_all_of_their_stiffness_are_as_they_were(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """To the last bit."""
    scene = tables_with(BASE, STIFF[name])
    assert build(one_line(validate_scene(scene))).cable.hinges[2, 0] > 0.0
    found, hinges = hybrid.run(scene), cast(Any, Material.hinges).func
    monkeypatch.setattr(Material, "hinges", property(lambda self: hinges(self)[:3] * [[1.0], [1.0], [0.0]]))
    plain = hybrid.run(scene)
    np.testing.assert_array_equal(found.curvature, plain.curvature)
    for key in ("curvature_max", "curvature_min"):
        np.testing.assert_array_equal(found[f"envelope/{key}"][:], plain[f"envelope/{key}"][:])
