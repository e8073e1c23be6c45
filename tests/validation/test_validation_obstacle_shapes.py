"""Lines on drums, boxes, rings, sheaves and triangles: capstans, pressure, statics, energy, no tunnelling, outlines."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import hybrid
from hybrid.errors import ResultError
from hybrid.kernels.laws.obstacles import distances, stored_energy
from hybrid.model.build import build
from hybrid.scene.read import one_line
from hybrid.view.figure import Area
from hybrid.view.projections import obstacles_at, outlines, rings, surfaces, view_named
from tests.combinations.pairs import seen_by
from tests.meshes import box, prism, sphere, text_stl
from tests.validation.obstacle_scenes import (
    CENTRELINE,
    DRUM,
    STRAND,
    Tables,
    capstan,
    drum,
    half_turn,
    over_beam,
    over_pipe,
)
from tests.validation.test_validation_moving_obstacles import by
from tests.validation.test_validation_obstacles import falling

MU, EDGE = 0.3, 0.1
AT = {"at": [0, 0, 0], "friction": MU}
DRUMS: dict[str, Any] = {
    "drum": drum(MU)["drum"],
    "box": AT | {"kind": "box", "size": [2 * DRUM, 1, 2 * DRUM], "rounding": EDGE},
    "torus": AT | {"kind": "torus", "at": [0, 0, 2], "axis": [1, 0, 0], "ring": 2.0, "radius": DRUM},
    "sheave": AT | {"kind": "sheave", "axis": [0, 1, 0], "radius": DRUM, "groove": 0.02, "rim": 0.01},
}  # fmt: skip


def over(kind: str, pull: float, **change: Any) -> Tables:
    """A weightless rope, turned through half a turn by a drum, a box, the inside of a ring or the groove of a sheave."""
    tables = capstan(MU, pull, "catenary" if kind == "drum" else "rod")
    tables["obstacles"] = {"drum": DRUMS[kind] | change}
    if kind == "box":
        at, turn = DRUM - EDGE, np.linspace(0.0, 0.5 * np.pi, 9)
        corner = np.column_stack([at + (EDGE + STRAND) * np.cos(turn), 0 * turn, at + (EDGE + STRAND) * np.sin(turn)])
        points = [[-CENTRELINE, 0, -3], *(corner * [-1, 1, 1]).tolist(), *corner[::-1].tolist(), [CENTRELINE, 0, -0.3]]
        tables["initial"]["points"] = points
        length = float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())
        tables["cable"]["sections"][0]["length"] = length
    return tables


def over_prism(sides: int, strand: float, folder: Path) -> Tables:
    """The rope over a prism of triangles within the drum; strand: its radius, m.

    A thick one shows sharp edges with five cells each; over many edges a thin one takes them as a round drum.
    """
    tables, R = capstan(MU, 40.0, "rod"), DRUM + strand
    tables["cable"]["sections"][0] |= {"length": float(3.3 + np.pi * R), "diameter": 2.0 * strand,
                                       "mass": 100.0 * strand**2, "axial_stiffness": 200.0 / strand}  # fmt: skip
    tables["ends"]["start"]["position"] = [-R, 0, -3.0]
    tables["initial"]["points"] = half_turn(R, 3.0, 0.3)
    file = text_stl(folder / f"prism{sides}.stl", prism(DRUM * np.cos(np.pi / sides), sides, 1.0))
    return tables | {"obstacles": {"drum": AT | {"kind": "mesh", "file": file}}}


@pytest.mark.parametrize("kind", ["drum as rod", *DRUMS, 6, 60])
def test_tension_grows_by_the_exponential_of_the_angle(kind: Any, tmp_path: Path) -> None:
    """Euler and Eytelwein: T2/T1 = e^(mu phi) where a rope slides over an angle phi; work is booked.

    By a hundredth of the exponent, of which what has not slid yet, elastically, takes a part: over a drum, two edges of
    a box, through a ring, in a groove, and over the edges of prisms.
    """
    if kind == "drum as rod":
        tables = over("drum", 40.0) | {"model": "rod"}
    else:
        tables = over(kind, 40.0) if kind in DRUMS else over_prism(kind, 0.1 if kind == 6 else 0.01, tmp_path)
    result = hybrid.run(tables)
    T, done = result.tension[-1], result["work/applied"][-1]
    assert 0.99 < np.log(T[-1] / T[0]) / (MU * np.pi) < 1.005  # edges have five cells each
    assert np.linalg.norm(result.reaction_start[-1]) == pytest.approx(T[0], rel=1e-6)
    assert np.abs(result.position[:, :, 1]).max() < 1e-9
    assert -0.5 * done < result["work/friction"][-1] < -0.2 * done
    assert abs(result["work/scheme"][-1]) < (1e-4 if kind in DRUMS else 1e-3) * done
    assert 0.0 < result["energy/contact"][-1] < done


@pytest.mark.parametrize("kind", ["drum", "torus", "sheave"])
def test_a_smooth_surface_presses_by_tension_over_radius(kind: str) -> None:
    """T/R by the law of contact from the penetration, on a drum, on the inside of a ring and in a groove."""
    tables = over(kind, 10.0, friction=0.0)
    result, sea = hybrid.run(tables), build(one_line(hybrid.validate_scene(tables))).sea.values
    x = result.position[-1]
    *_, stiffness, _, onset, _ = sea.obstacles[0]
    deep = -distances(sea, x)[0][x[:, 2] > 0.2 * CENTRELINE]
    depth = 0.5 * onset + deep
    pressure = stiffness * np.where(depth < onset, 0.5 * depth**2 / onset, depth - 0.5 * onset)
    np.testing.assert_allclose(pressure, 10.0 / CENTRELINE, rtol=0.01 if kind == "drum" else 0.02)
    np.testing.assert_allclose(result.tension[-1], 10.0, rtol=2e-3)
    assert 0.001 * 2 * STRAND < deep.min() < 0.02 * 2 * STRAND  # a fiftieth at most


BEAM = over_beam({"kind": "box", "size": [2.0, 3.0, 2.2], "rounding": 0.4})


@pytest.fixture(scope="module", params=[over_pipe(), BEAM], ids=["pipe", "beam"])
def laid(request: pytest.FixtureRequest) -> Any:
    return hybrid.run(request.param), build(one_line(hybrid.validate_scene(request.param)))


def test_an_equilibrium_is_found_from_the_scene_alone(laid: Any) -> None:
    """It lies over what its catenary would pass through, nowhere deeper than it may, and ends bear what that does not."""
    result, model = laid
    away = distances(model.sea.values, result.position[0])[0]
    assert -0.05 * 0.05 < away.min() < 0.0 and (away < 0.01).sum() > 3
    assert {e.kind for e in result.events} == {"static friction neglected"}
    r, shift = result.position[0], 1e-7 * np.eye(3)  # the force as the derivative of what is stored by a shift
    energy = [stored_energy(model.line, model.sea.values, r + k * x) for x in shift for k in (-1.0, 1.0)]
    pressed = -np.diff(np.array(energy).reshape(3, 2), axis=1)[:, 0] / 2e-7
    forces = result.reaction_start[0] + result.reaction_end[0] + pressed
    np.testing.assert_allclose(forces, [0.0, 0.0, 2.0 * 9.81 * 12.0], atol=0.05)
    assert pressed[2] > 50.0


def test_energy_over_it_is_booked(laid: Any) -> None:
    result, _ = laid
    assert np.abs(result["work/scheme"]).max() < 0.01 * np.abs(result["work/end"]).max()
    assert result["work/friction"][-1] < 0.0


def test_a_rotated_scene_has_a_rotated_result() -> None:
    c, s = np.cos(0.7), np.sin(0.7)
    M = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    turned = seen_by(M, BEAM)
    turned["obstacles"]["beam"]["rotation"] = [5, -10, 15 + float(np.degrees(0.7))]
    one, other = hybrid.run(BEAM), hybrid.run(turned)
    np.testing.assert_allclose(other.position, one.position @ M.T, atol=1.2e-8)
    np.testing.assert_allclose(other.tension, one.tension, atol=1e-7 * one.tension.max())


@pytest.mark.parametrize(
    ("kind", "speed"),
    [("pipe", 0.0), ("pipe", 20.0), ("box", 20.0), ("torus", 20.0), pytest.param("mesh", 20.0, marks=pytest.mark.long)],
)
def test_no_step_carries_a_line_through(kind: str, speed: float, tmp_path: Path) -> None:
    """In steps of 0.02 s, 0.4 m at 20 m/s: through what is 0.2 m thick; some are repeated shorter."""
    shapes: dict[str, Any] = {
        "mesh": {"kind": "mesh", "file": text_stl(tmp_path / "bar.stl", box((0.2, 2.0, 0.2))), "at": [0, 0, 0]},
        "box": {"kind": "box", "at": [0, 0, 0], "size": [0.2, 2.0, 0.2], "rounding": 0.05},
        "torus": {"kind": "torus", "at": [0, 0, -1], "axis": [1, 0, 0], "ring": 1.0, "radius": 0.1},
        "pipe": {"kind": "cylinder", "at": [0, 0, 0], "axis": [0, 1, 0], "radius": 0.1},
    }
    tables = falling(0.02, speed, obstacles={"bar": shapes[kind] | {"friction": 0.5}})
    tables["initial"]["origin"] = [-1.0, 0.0, 0.5]
    tables["cable"]["sections"][0]["max_strain"] = 0.2
    result = hybrid.run(tables)
    sea = build(one_line(hybrid.validate_scene(tables))).sea.values
    away = np.array([distances(sea, x)[0].min() for x in result.position])
    assert -0.01 < away.min() < 1e-3  # it touches, and no part of it is within
    assert result.position[:, 50, 2].min() > 0.05  # the middle stays above
    assert result.steps.repeats.max() > 0 or speed == 0.0
    assert result["work/scheme"].max() < 1e-3 * np.abs(result["energy/kinetic"]).max()


def test_a_sheave_turns_freely_under_a_rope_in_its_groove() -> None:
    """A sheave with a bearing carries the rope along: both sides then pull alike, but for its inertia."""
    result = hybrid.run(over("sheave", 20.0, bearing={"inertia": 1e-3}))
    T = result.tension[-1]
    assert T[-1] / T[0] == pytest.approx(1.0, abs=0.01)


def test_drawings_of_boxes_rings_and_sheaves() -> None:
    """Their surfaces lie on them; the outline of a beam is its section; a ring is seen with its hole."""
    tables = falling(0.01, obstacles={x: DRUMS[x] for x in ("box", "torus", "sheave")})
    tables["initial"]["origin"] = [-1.0, 3.0, 0.5]
    tables["time"] = {"duration": 0.02, "step": 0.01}
    scene = hybrid.validate_scene(tables)
    result = hybrid.run(scene)
    sea = build(one_line(scene)).sea.values
    drawn = surfaces(result, np.array([[-4.0, -4.0, -4.0], [4.0, 4.0, 4.0]]))
    for each in drawn:
        x = np.column_stack([each[a] for a in "xyz"])
        np.testing.assert_allclose(
            distances(sea, x)[list(tables["obstacles"]).index(each["name"])] + 0.01, 0.0, atol=1e-9
        )
        assert max(*each["i"], *each["j"], *each["k"]) == len(x) - 1
    beam, _, ring = (x for x in outlines(result, view_named("xz"), 0) if isinstance(x, Area))
    np.testing.assert_allclose(np.ptp(beam.outlines[0], axis=0), 2 * DRUM, rtol=0.02)
    assert ring.outlines.shape[1:] == (4, 2)


# --- surfaces of triangles ---


def test_an_equilibrium_on_triangles_is_one_on_the_box(tmp_path: Path) -> None:
    """Begun where the other lies it stays: without friction a rope has several on a beam that is turned."""
    mesh = {"kind": "mesh", "file": text_stl(tmp_path / "beam.stl", box((2000.0, 3000.0, 2200.0))), "scale": 0.001}
    found = hybrid.static(over_beam(mesh)).position[0]
    tables = over_beam({"kind": "box", "size": [2.0, 3.0, 2.2], "rounding": 1e-9})
    tables["initial"] = {"kind": "equilibrium", "points": found.tolist()}
    np.testing.assert_allclose(hybrid.static(tables).position[0], found, atol=1e-8)


def test_a_result_is_drawn_without_the_file_and_not_gone_on_with(tmp_path: Path) -> None:
    """What is drawn lies on the surface; a file that has changed is not the same run."""
    file = text_stl(tmp_path / "hull.stl", prism(0.3, 6, 0.8))
    hull = {"kind": "mesh", "file": file, "at": [0, 0, -0.5], "rotation": [10, 0, 20]}
    ball = {"kind": "mesh", "file": text_stl(tmp_path / "ball.stl", sphere(0.2, 2)), "at": [0, 1, 0]}
    tables = falling(
        0.01, obstacles={"hull": hull, "ball": ball | {"motion": {"travel": {"by": [0.1, 0, 0], "over": 0.03}}}}
    )
    tables["time"] = {"duration": 0.04, "step": 0.01}
    hybrid.run(tables, tmp_path / "run.h5").close()
    sea = build(one_line(hybrid.validate_scene(tables))).sea.values
    text_stl(Path(file), prism(0.31, 6, 0.8))
    with pytest.raises(ResultError, match=r"hull\.stl"):
        hybrid.resume(tmp_path / "run.h5", until=0.06)
    Path(file).unlink()
    with hybrid.open(tmp_path / "run.h5") as result:
        for each in surfaces(result, np.array([[-4.0] * 3, [4.0] * 3]), output=0):
            k = list(tables["obstacles"]).index(each["name"])
            x = np.column_stack([each[a] for a in "xyz"])
            np.testing.assert_allclose(distances(sea, x)[k] + 0.01, 0.0, atol=1e-9)
            assert max(*each["i"], *each["j"], *each["k"]) == len(x) - 1
            assert len(each["rim"]) == (3 * 18 if each["name"] == "hull" else 0)  # a prism has 18 edges, a ball none
        drawn = [x for x in outlines(result, view_named("xz"), 0) if isinstance(x, Area)]
        assert [x.outlines.shape[1:] for x in drawn] == [(3, 2), (3, 2)]
        assert np.ptp(drawn[0].outlines.reshape(-1, 2), axis=0) == pytest.approx([0.4, 0.4])
        bodies = {x.name: x for x in obstacles_at(result, -1)}
        np.testing.assert_allclose(bodies["ball"].points.mean(axis=0), [0.1, 1, 0], atol=1e-9)
        assert rings(result, -1) == []  # a ball has no sharp edge


def test_a_mesh_that_pushes_is_a_box_that_pushes(tmp_path: Path) -> None:
    """A box that moves and turns into a rope, as a box and as twelve triangles: alike to what single steps leave."""
    size = (0.3, 0.24, 0.6)
    file = text_stl(tmp_path / "box.stl", box(size))
    shapes: list[Tables] = [{"kind": "box", "size": size, "rounding": 1e-9}, {"kind": "mesh", "file": file}]
    results = []
    for shape in shapes:
        tables = by("box")
        bar = tables["obstacles"]["bar"]
        tables["obstacles"]["bar"] = shape | {x: bar[x] for x in ("at", "rotation", "friction", "motion")}
        results.append(hybrid.run(tables))
    as_box, as_mesh = results
    assert as_box.position[:, 15:45, 1].max() > 0.05
    np.testing.assert_allclose(as_mesh.position, as_box.position, atol=1e-6)
    force = as_box["obstacles/bar/force"]
    np.testing.assert_allclose(as_mesh["obstacles/bar/force"], force, atol=1e-4 * np.abs(force).max())
    assert as_box["work/obstacles"][-1] == pytest.approx(as_mesh["work/obstacles"][-1], rel=1e-4) and force.any()
