"""Lines on boxes, rings and sheaves: capstans, pressure, energy, no tunnelling, turned scenes, outlines."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import hybrid
from hybrid.kernels.laws.obstacles import distances
from hybrid.model.build import build
from hybrid.scene.read import one_line
from hybrid.view.figure import Area
from hybrid.view.projections import outlines, surfaces, view_named
from tests.meshes import box, text_stl
from tests.validation.obstacle_scenes import CENTRELINE, DRUM, STRAND, capstan, is_turned, over_beam
from tests.validation.test_validation_obstacles import falling

MU, EDGE = 0.3, 0.1
AT = {"at": [0, 0, 0], "friction": MU}
DRUMS: dict[str, Any] = {
    "box": AT | {"kind": "box", "size": [2 * DRUM, 1, 2 * DRUM], "rounding": EDGE},
    "torus": AT | {"kind": "torus", "at": [0, 0, 2], "axis": [1, 0, 0], "ring": 2.0, "radius": DRUM},
    "sheave": AT | {"kind": "sheave", "axis": [0, 1, 0], "radius": DRUM, "groove": 0.02, "rim": 0.01},
}  # fmt: skip


def ran(tables: dict[str, Any]) -> Any:
    return hybrid.run(hybrid.validate_scene(tables))


def over(kind: str, pull: float, **change: Any) -> dict[str, Any]:
    """A weightless rope, turned through half a turn by a box, the inside of a ring or the groove of a sheave."""
    tables = capstan(MU, pull, "rod")
    tables["obstacles"] = {"drum": DRUMS[kind] | change}
    if kind == "box":
        at, turn = DRUM - EDGE, np.linspace(0.0, 0.5 * np.pi, 9)
        corner = np.column_stack([at + (EDGE + STRAND) * np.cos(turn), 0 * turn, at + (EDGE + STRAND) * np.sin(turn)])
        points = [[-CENTRELINE, 0, -3], *(corner * [-1, 1, 1]).tolist(), *corner[::-1].tolist(), [CENTRELINE, 0, -0.3]]
        tables["initial"]["points"] = points
        length = float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())
        tables["cable"]["sections"][0]["length"] = length
    return tables


@pytest.mark.parametrize("kind", DRUMS)
def test_tension_grows_by_the_exponential_of_the_angle(kind: str) -> None:
    """e^(mu pi), by a hundredth of the exponent: over two edges of a box, through a ring, in a groove; work is booked."""
    result = ran(over(kind, 40.0))
    T, done = result.tension[-1], result["work/applied"][-1]
    assert 0.99 < np.log(T[-1] / T[0]) / (MU * np.pi) < 1.005  # edges of a box have five cells each
    assert np.abs(result.position[:, :, 1]).max() < 1e-9
    assert -0.5 * done < result["work/friction"][-1] < -0.2 * done
    assert abs(result["work/scheme"][-1]) < 1e-4 * done


@pytest.mark.parametrize("kind", ["torus", "sheave"])
def test_a_smooth_surface_presses_by_tension_over_radius(kind: str) -> None:
    """T/R by the law of contact from the penetration, on the inside of a ring and in a groove."""
    tables = over(kind, 10.0, friction=0.0)
    result, sea = ran(tables), build(one_line(hybrid.validate_scene(tables))).sea.values
    x = result.position[-1]
    *_, stiffness, _, onset, _ = sea.obstacles[0]
    depth = 0.5 * onset - distances(sea, x)[0][x[:, 2] > 0.2 * CENTRELINE]
    pressure = stiffness * np.where(depth < onset, 0.5 * depth**2 / onset, depth - 0.5 * onset)
    np.testing.assert_allclose(pressure, 10.0 / CENTRELINE, rtol=0.02)
    np.testing.assert_allclose(result.tension[-1], 10.0, rtol=2e-3)


BEAM = {"kind": "box", "size": [2.0, 3.0, 2.2], "rounding": 0.4}


@pytest.fixture(scope="module")
def laid() -> Any:
    return ran(over_beam(BEAM))


def test_an_equilibrium_over_a_beam_is_found_from_the_scene_alone(laid: Any) -> None:
    """It lies on the beam that its catenary would pass through, and nowhere deeper than it may."""
    away = distances(build(one_line(hybrid.validate_scene(over_beam(BEAM)))).sea.values, laid.position[0])[0]
    assert -0.05 * 0.05 < away.min() < 0.0
    assert {e.kind for e in laid.events} == {"static friction neglected"}


def test_energy_over_a_beam_is_booked(laid: Any) -> None:
    assert np.abs(laid["work/scheme"]).max() < 0.01 * np.abs(laid["work/end"]).max()
    assert laid["work/friction"][-1] < 0.0


def test_a_rotated_scene_has_a_rotated_result(laid: Any) -> None:
    is_turned(ran(over_beam(BEAM, 0.7)), laid, 0.7)


@pytest.mark.parametrize("kind", ["box", "torus", pytest.param("mesh", marks=pytest.mark.long)])
def test_no_step_carries_a_line_through(kind: str, tmp_path: Path) -> None:
    """At 20 m/s in steps of 0.02 s, 0.4 m: through a beam of 0.2 m, or the section of a ring of 0.2 m, in one step."""
    shapes: dict[str, Any] = {
        "mesh": {"kind": "mesh", "file": text_stl(tmp_path / "bar.stl", box((0.2, 2.0, 0.2))), "at": [0, 0, 0]},
        "box": {"kind": "box", "at": [0, 0, 0], "size": [0.2, 2.0, 0.2], "rounding": 0.05},
        "torus": {"kind": "torus", "at": [0, 0, -1], "axis": [1, 0, 0], "ring": 1.0, "radius": 0.1},
    }
    tables = falling(0.02, 20.0, obstacles={"bar": shapes[kind] | {"friction": 0.5}}) | {"initial": {
        "kind": "straight", "direction": [1, 0, 0], "origin": [-1.0, 0.0, 0.5], "velocity": [0, 0, -20]}}  # fmt: skip
    tables["cable"]["sections"][0]["max_strain"] = 0.2
    result = ran(tables)
    sea = build(one_line(hybrid.validate_scene(tables))).sea.values
    away = np.array([distances(sea, x)[0].min() for x in result.position])
    assert -0.01 < away.min() < 1e-3
    assert result.position[:, 50, 2].min() > 0.05
    assert result.steps.repeats.max() > 0
    assert result["work/scheme"].max() < 1e-3 * np.abs(result["energy/kinetic"]).max()


def test_a_sheave_turns_freely_under_a_rope_in_its_groove() -> None:
    """A sheave with a bearing carries the rope along: both sides then pull alike, but for its inertia."""
    result = ran(over("sheave", 20.0, bearing={"inertia": 1e-3}))
    T = result.tension[-1]
    assert T[-1] / T[0] == pytest.approx(1.0, abs=0.01)


def test_drawings_of_boxes_rings_and_sheaves() -> None:
    """Their surfaces lie on them; the outline of a beam is its section; a ring is seen with its hole."""
    tables = falling(0.01, obstacles=DRUMS)
    tables["initial"]["origin"] = [-1.0, 3.0, 0.5]
    tables["time"] = {"duration": 0.02, "step": 0.01}
    scene = hybrid.validate_scene(tables)
    result = hybrid.run(scene)
    sea = build(one_line(scene)).sea.values
    drawn = surfaces(result, np.array([[-4.0, -4.0, -4.0], [4.0, 4.0, 4.0]]))
    for each in drawn:
        x = np.column_stack([each[a] for a in "xyz"])
        np.testing.assert_allclose(distances(sea, x)[list(DRUMS).index(each["name"])] + 0.01, 0.0, atol=1e-9)
        assert max(*each["i"], *each["j"], *each["k"]) == len(x) - 1
    beam, _, ring = (x for x in outlines(result, view_named("xz"), 0) if isinstance(x, Area))
    np.testing.assert_allclose(np.ptp(beam.outlines[0], axis=0), 2 * DRUM, rtol=0.02)
    assert ring.outlines.shape[1:] == (4, 2)
