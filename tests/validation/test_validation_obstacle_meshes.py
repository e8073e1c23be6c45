"""Lines on surfaces of triangles: as on the shapes that they are of, capstans, no tunnelling, resume, without their file."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import hybrid
from hybrid.errors import ResultError
from hybrid.kernels.laws.obstacles import distances
from hybrid.model.build import build
from hybrid.scene.read import one_line
from hybrid.view.figure import Area
from hybrid.view.projections import obstacles_at, outlines, rings, surfaces, view_named
from tests.meshes import box, prism, sphere, text_stl
from tests.validation.obstacle_scenes import DRUM, Tables, capstan, half_turn, is_turned, over_beam
from tests.validation.test_validation_obstacle_shapes_combined import by
from tests.validation.test_validation_obstacles import falling

MU = 0.3


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("meshes")


@pytest.mark.parametrize(("sides", "strand"), [(6, 0.1), (60, 0.01)])
def test_tension_grows_by_the_exponential_of_the_angle(sides: int, strand: float, folder: Path) -> None:
    """e^(mu pi) over the edges of a prism within a drum, within a hundredth of the exponent; work is booked.

    A thick rope shows sharp edges with five cells each; over many edges a thin one takes them as a round drum.
    """
    tables, R = capstan(MU, 40.0, "rod"), DRUM + strand
    tables["cable"]["sections"][0] |= {
        "length": float(3.3 + np.pi * R),
        "diameter": 2.0 * strand,
        "mass": 100.0 * strand**2,
        "axial_stiffness": 200.0 / strand,
    }
    tables["ends"]["start"]["position"] = [-R, 0, -3.0]
    tables["initial"]["points"] = half_turn(R, 3.0, 0.3)
    file = text_stl(folder / f"prism{sides}.stl", prism(DRUM * np.cos(np.pi / sides), sides, 1.0))
    tables["obstacles"] = {"drum": {"kind": "mesh", "file": file, "at": [0, 0, 0], "friction": MU}}
    result = hybrid.run(tables)
    T, done = result.tension[-1], result["work/applied"][-1]
    assert 0.99 < np.log(T[-1] / T[0]) / (MU * np.pi) < 1.005
    assert np.abs(result.position[:, :, 1]).max() < 1e-9
    assert -0.5 * done < result["work/friction"][-1] < -0.2 * done
    assert abs(result["work/scheme"][-1]) < 1e-3 * done


def over(folder: Path, turn: float = 0.0) -> Tables:
    """A rope over a beam with sharp edges."""
    beam = {"kind": "mesh", "file": text_stl(folder / "beam.stl", box((2000.0, 3000.0, 2200.0))), "scale": 0.001}
    return over_beam(beam, turn)


@pytest.fixture(scope="module")
def laid(folder: Path) -> Any:
    return hybrid.run(over(folder))


def test_an_equilibrium_on_triangles_is_one_on_the_box(laid: Any, folder: Path) -> None:
    """Begun where the other lies it stays: without friction a rope has several on a beam that is turned."""
    tables = over(folder)
    beam = tables["obstacles"]["beam"]
    tables["obstacles"]["beam"] = {"kind": "box", "size": [2.0, 3.0, 2.2], "rounding": 1e-9} | {
        x: beam[x] for x in ("at", "rotation", "friction")
    }
    found = hybrid.static(over(folder)).position[0]
    tables["initial"] = {"kind": "equilibrium", "points": found.tolist()}
    np.testing.assert_allclose(hybrid.static(tables).position[0], found, atol=1e-8)
    assert np.abs(laid.position[0] - found).max() < 1e-8


def test_a_rotated_scene_has_a_rotated_result(laid: Any, folder: Path) -> None:
    is_turned(hybrid.run(over(folder, 0.7)), laid, 0.7)


def test_zones_that_move_have_the_answer_of_rods(laid: Any, folder: Path) -> None:
    moving = {"kind": "adaptive", "always_move": True, "tolerance": 1e-3}
    zones = hybrid.run(over(folder) | {"model": moving})
    assert {x.kind for row in zones.zones for x in row} == {"rod", "catenary"}
    assert np.linalg.norm(np.array(zones.position) - np.array(laid.position), axis=2).max() < 0.012


def test_a_result_is_drawn_without_the_file_and_not_gone_on_with(folder: Path, tmp_path: Path) -> None:
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


def test_a_mesh_that_pushes_is_a_box_that_pushes(folder: Path) -> None:
    """A box that moves and turns into a rope, as a box and as twelve triangles: alike to what single steps leave."""
    size = (0.3, 0.24, 0.6)
    file = text_stl(folder / "box.stl", box(size))
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
