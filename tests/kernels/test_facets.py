"""Surfaces of triangles: distances against boxes and spheres, order of convergence, files that are refused."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hybrid.errors import SceneError
from hybrid.model.obstacles import surface_of
from hybrid.scene.obstacles import distance_to, read_mesh
from tests.kernels.test_surfaces import OBSTACLES, STRAND, Around, around, at, places, scene
from tests.meshes import binary_stl, box, prism, sphere, text_stl

SIZE, TURN = (1.2, 0.8, 0.5), [20.0, -35.0, 50.0]
AT = [0.1, 0.2, -0.1]


def obstacles(**tables: Any) -> Around:
    return around(scene(obstacles=tables))


@pytest.fixture(scope="module")
def boxes(tmp_path_factory: Any) -> Around:
    """A box as a box, and as twelve triangles."""
    file = text_stl(tmp_path_factory.mktemp("meshes") / "box.stl", box(SIZE))
    shape = {"at": AT, "rotation": TURN}
    return obstacles(
        box=shape | {"kind": "box", "size": SIZE, "rounding": 1e-12}, mesh=shape | {"kind": "mesh", "file": file}
    )


@pytest.mark.long
def test_a_box_of_triangles_is_a_box(boxes: Around) -> None:
    """d, n and K within and without, to round-off."""
    for x in places(600):
        (d, n, K, _), (e, m, L, _) = (at(boxes, k, tuple(x)) for k in (0, 1))
        assert e == pytest.approx(d, abs=2e-12)
        np.testing.assert_allclose(m, n, atol=1e-9)
        np.testing.assert_allclose(L, K, atol=1e-6 * max(1.0, np.abs(K).max()))


def test_diagonals_of_sides_are_flat(tmp_path: Path) -> None:
    """Right above the diagonal of a side, an edge and a corner: flat, as a cylinder, as a sphere."""
    file = text_stl(tmp_path / "box.stl", box(SIZE))
    sea, half = obstacles(mesh={"kind": "mesh", "file": file, "at": [0, 0, 0]}), np.array(SIZE) / 2.0
    _, n, K, _ = at(sea, 0, (0.0, 0.0, half[2] + 0.02))
    np.testing.assert_array_equal(n, [0, 0, 1])
    np.testing.assert_array_equal(K, 0.0)
    d, _, K, _ = at(sea, 0, (half[0] + 0.03, 0.0, half[2] + 0.04))
    assert d == pytest.approx(0.05 - STRAND, abs=1e-12)
    np.testing.assert_allclose(np.linalg.eigvalsh(np.reshape(K, (3, 3))), [0, 0, 1 / 0.05], atol=1e-9)
    _, _, K, _ = at(sea, 0, tuple(half + np.array([0.03, 0.04, 0.12])))
    np.testing.assert_allclose(np.linalg.eigvalsh(np.reshape(K, (3, 3))), [0, 1 / 0.13, 1 / 0.13], atol=1e-9)


@pytest.mark.long
def test_a_sphere_of_triangles_converges_with_order_two(tmp_path: Path) -> None:
    """Its distance, around it and within, by a quarter with every halving of its edges."""
    x, errors = places(400), []
    for times in (2, 3, 4, 5):
        file = binary_stl(tmp_path / f"{times}.stl", sphere(400.0, times))
        found = obstacles(
            ball={"kind": "sphere", "at": AT, "radius": 0.4},
            mesh={"kind": "mesh", "file": file, "at": AT, "rotation": TURN, "scale": 0.001},
        )
        d = np.array([[at(found, k, tuple(p))[0] for k in (0, 1)] for p in x])
        errors.append(np.abs(d[:, 1] - d[:, 0]).max())
    ratios = np.array(errors[:-1]) / errors[1:]
    assert ((ratios > 3.3) & (ratios < 4.7)).all(), ratios
    assert errors[-1] < 1e-3 * 0.4


def test_the_tree_finds_the_nearest_of_all_triangles(tmp_path: Path) -> None:
    """Against all triangles and the solid angles under which they are seen, which need no normals."""
    file = text_stl(tmp_path / "egg.stl", sphere(0.4, 3) * [1.0, 0.5, 1.5])
    both = {"egg": {"kind": "mesh", "file": file, "at": AT}, "bar": OBSTACLES["angle"]}
    found, shapes = obstacles(**both), scene(obstacles=both).obstacles
    for x in places(300):
        for k, shape in enumerate(shapes.values()):
            assert at(found, k, tuple(x))[0] == pytest.approx(shape.distance(tuple(x)) - STRAND, abs=1e-12)


@pytest.mark.parametrize(
    ("corners", "rounding", "half"),
    [
        (box(SIZE), 0.0, 0.48 / 3.92),
        (prism(0.3, 40, 1.0), 0.0, None),  # its rims are sharp
        (sphere(0.4, 4), 0.4, 0.4 / 3.0),
    ],
)  # fmt: skip
def test_how_round_and_how_thick_surfaces_are(
    corners: np.ndarray, rounding: float, half: float | None, tmp_path: Path
) -> None:
    found = surface_of(read_mesh(text_stl(tmp_path / "x.stl", corners)))
    assert found.rounding == pytest.approx(rounding, rel=0.02)
    if half is not None:
        assert found.half_thickness == pytest.approx(half, rel=0.01)


def test_cones_that_touch_at_their_tips_have_a_tip_each(tmp_path: Path) -> None:
    tip = np.array([[[0, 0, 0], [1, 0, 1], [0, 1, 1]], [[0, 0, 0], [0, 1, 1], [-1, -1, 1]],
                    [[0, 0, 0], [-1, -1, 1], [1, 0, 1]], [[1, 0, 1], [-1, -1, 1], [0, 1, 1]]], float)  # fmt: skip
    mesh = read_mesh(text_stl(tmp_path / "tips.stl", np.concatenate([tip[:, ::-1], -tip])))
    assert (len(mesh.points), len(mesh.triangles)) == (8, 8)


def test_formats_agree(tmp_path: Path) -> None:
    """Text, binary and OBJ; a header that begins with solid, a triangle with two corners in a place, a byte order mark."""
    corners = box(SIZE)
    flat = np.concatenate([corners, corners[:1, [0, 1, 1]]])
    text, binary = read_mesh(text_stl(tmp_path / "a.stl", flat)), read_mesh(binary_stl(tmp_path / "b.STL", corners))
    data = (tmp_path / "b.STL").read_bytes()
    (tmp_path / "c.stl").write_bytes(b"solid of some program" + data[21:])
    rows = [f"v {x} {y} {z}" for x, y, z in corners.reshape(-1, 3)] + [
        f"f {k} {k + 1} {k + 2}" for k in range(1, 37, 3)
    ]
    (tmp_path / "d.obj").write_text("\ufeff" + "\n".join(rows), encoding="utf-8")
    for mesh in (text, binary, read_mesh(str(tmp_path / "c.stl")), read_mesh(str(tmp_path / "d.obj"))):
        assert (len(mesh.points), len(mesh.triangles)) == (8, 12)
        np.testing.assert_allclose(mesh.points, text.points, atol=1e-7)


BOX = box(SIZE)
WRONG: dict[str, tuple[Any, str]] = {
    "hole": (BOX[:-1], r"a closed surface, .*facet \d+, line \d+ .*nothing beside its edge .*3 such edges"),
    "turned": (np.concatenate([BOX[:1, ::-1], BOX[1:]]), "counter-clockwise around their outside.* same direction"),
    "twice": (np.concatenate([BOX, BOX[:1]]), "leave out triangles that are there twice"),
    "inside out": (BOX[:, ::-1], "seen from outside.*a shell whose volume is -0.48.*turn the surface over"),
    "one of two": (np.concatenate([BOX, BOX[:, ::-1] + 3.0]), "seen from outside"),
    "flat": (np.concatenate([BOX[:1] * [1, 1, 0], BOX[1:]]), "1e-06 of their longest edge|a closed surface"),
    "sliver": (np.concatenate([BOX, [[[0, 0, 0], [1, 0, 0], [2, 0, 0]]]]), "1e-06 of their longest edge high.*facet 13"),
    "far": (np.where(BOX > 0.5, 1e13, BOX), r"coordinates up to 1e\+12"),
    "empty": (BOX[:0], "at least 4 triangles"),
    "nowhere": (np.zeros((2, 3, 3)), "none with an area"),
}  # fmt: skip


@pytest.mark.parametrize("what", WRONG)
def test_surfaces_that_cannot_be_are_refused(what: str, tmp_path: Path) -> None:
    corners, says = WRONG[what]
    assert_refused(text_stl(tmp_path / "x.stl", np.asarray(corners)), says)


def assert_refused(file: str, says: str) -> None:
    with pytest.raises(SceneError) as error:
        obstacles(mesh={"kind": "mesh", "file": file, "at": [0, 0, 0]})
    (found,) = (x for x in error.value.complaints if x.where == "obstacles.mesh.file")
    assert re.search(says, f"{found.expected}, {found.value}; {found.fix}", re.DOTALL), found


def test_a_hollow_of_a_shell_is_no_mistake(tmp_path: Path) -> None:
    mesh = read_mesh(text_stl(tmp_path / "x.stl", np.concatenate([BOX, 0.5 * BOX[:, ::-1]])))
    assert distance_to(mesh, (0.0, 0.0, 0.0)) == pytest.approx(0.125)
    assert distance_to(mesh, (0.0, 0.0, 0.2)) == pytest.approx(-0.05)


TEXT = "solid x\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\n"
FILES: dict[str, tuple[str, bytes, str]] = {
    "short": ("x.stl", b"\0" * 80 + b"\5\0\0\0" + b"\0" * 60, "144 bytes, where 5 facets would take 334"),
    "other": ("x.stl", b"hello", "an STL file, text that begins with solid or binary"),
    "cut": ("x.stl", (TEXT + "vertex 0 1 0").encode(), "cut off.*|endfacet.*line 2"),
    "two corners": ("x.stl", (TEXT + "endloop\nendfacet\n").encode(), "three lines `vertex x y z` in a facet.*line 2"),
    "word": ("x.stl", (TEXT + "vertex 0 1 o\n").encode(), "three coordinates.*line 6: '0 1 o'"),
    "two": ("x.obj", b"v 0 0\n", "three coordinates.*line 1"),
    "number": ("x.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 4\n", "one of the 3 places before.*line 4: '4'"),
    "nothing": ("x.obj", b"f 0 0 0\n", "one of the 0 places before.*line 1"),
    "edge": ("x.obj", b"v 0 0 0\nv 1 0 0\nf 1 2\n", "at least three corners.*line 3"),
    "suffix": ("x.ply", b"ply\n", "name it"),
    "curves": ("x.obj", b"v 0 0 0\nl 1 1\n", "at least 4 triangles"),
}  # fmt: skip


@pytest.mark.parametrize("what", FILES)
def test_files_that_cannot_be_read_are_refused(what: str, tmp_path: Path) -> None:
    name, data, says = FILES[what]
    (tmp_path / name).write_bytes(data)
    assert_refused(str(tmp_path / name), says)


def test_a_file_that_is_not_there_is_refused(tmp_path: Path) -> None:
    assert_refused(str(tmp_path / "none.stl"), "an STL or OBJ file.*does not exist")
    assert_refused(str(tmp_path), "an STL or OBJ file.*a folder")


def test_an_end_within_the_surface_is_refused() -> None:
    with pytest.raises(SceneError, match=r"outside of obstacles\.angle, in which it lies 0\.2 m deep"):
        scene(
            obstacles={"angle": OBSTACLES["angle"] | {"rotation": [0, 0, 0], "at": [0, 0, 0]}},
            ends={"start": {"kind": "pinned", "position": [0.2, 0.2, 0]}, "end": "free"},
        )
