"""A bed of depths on a grid: a plane is the plane bed, the surface and its slopes, hills, and what is refused."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.interpolate import PchipInterpolator

import hybrid
from hybrid.errors import SceneError
from hybrid.kernels.laws.seabed import HEIGHTS, planes_under
from hybrid.kernels.state.state import Sea, no_sea
from hybrid.scene.sea import Depths
from tests.scenes import cable_scene, pinned_at

SLOPE = (0.06, 0.03)
X, Y = [-300.0, -100.0, 50.0, 120.0, 400.0], [-300.0, -50.0, 100.0, 300.0]
PLANE = {"x": X, "y": Y, "depth": [[100.0 - SLOPE[0] * x - SLOPE[1] * y for y in Y] for x in X]}
LINE = {
    "length": 250.0, "diameter": 0.05, "mass": 20.0, "axial_stiffness": 2e8, "bending_stiffness": 2e3,
    "drag": {"normal": 1.2}, "added_mass": {"normal": 1.0},
}  # fmt: skip


def mooring(bed: dict[str, Any], **more: Any) -> hybrid.Scene:
    """A line that touches down on a bed of z = -100 m at x = y = 0, its upper end heaving."""
    seabed = {"stiffness": 5e3, "damping": 5e2, "friction": 0.4} | bed
    data = cable_scene(
        LINE, pinned_at(0, 0, -100),
        pinned_at(205, 0, 0, motion={"heave": {"amplitude": 2.0, "period": 8.0}, "ramp": 4}), fluid={"density": 1025.0},
        seabed=seabed, model="rod", dimension=3, mesh=60, time=(6.0, 0.1), output=1.0
    )  # fmt: skip
    return hybrid.validate_scene(data | more)


def hill(n: int = 65, high: float = 6.0) -> dict[str, Any]:
    """A hill under the line on the bed, on a grid of n points along x."""
    x, y = np.linspace(-60, 260, n), np.linspace(-80, 80, n // 2 + 1)
    depth = 100.0 - high * np.exp(-((x[:, None] - 45) ** 2 + (y - 8) ** 2) / 20**2)
    return {"z": 0.0, "depths": {"x": x.tolist(), "y": y.tolist(), "depth": depth.tolist()}}


def sea_of(depths: Depths) -> Sea:
    grid = depths.surface
    return no_sea(2)._replace(
        bed_x=grid.x, bed_y=grid.y, bed_heights=-grid.values.reshape(-1, HEIGHTS), onset=0.0
    )  # fmt: skip


@pytest.mark.parametrize("model", ["rod", "catenary"])
def test_depths_of_a_plane_are_the_plane_to_rounding(model: str) -> None:
    """From rest without friction, whose travel since it was laid makes more of rounding."""
    smooth = {"model": model, "initial": {"kind": "equilibrium", "friction": "neglected"}}
    with (
        hybrid.run(mooring({"z": -100.0, "slope": list(SLOPE)}, **smooth)) as plane,
        hybrid.run(mooring({"z": 0.0, "depths": PLANE}, **smooth)) as grid,
    ):
        assert float(plane["grounded_length"].min()) > 50.0
        for name, most in (("position", 1e-11), ("tension", 1e-6), ("contact", 1e-7), ("touchdown", 1e-9)):
            np.testing.assert_allclose(grid[name], plane[name], rtol=0, atol=most)
        np.testing.assert_allclose(grid["seabed"], plane["seabed"], rtol=1e-12)
        np.testing.assert_allclose(grid.uplift("start")[0], plane.uplift("start")[0], atol=1e-6)


def test_heights_and_slopes_are_continuous_and_one_is_the_derivative_of_the_other() -> None:
    rng = np.random.default_rng(3)
    x, y = np.sort(rng.uniform(-50, 50, 8)), np.sort(rng.uniform(-40, 40, 6))
    depths = Depths(x=x.tolist(), y=y.tolist(), depth=rng.uniform(90, 110, (8, 6)).tolist())
    sea = sea_of(depths)

    def height(places: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        n, p = planes_under(sea, places)
        return p / n[:, 2] + places[:, 2], -n[:, :2] / n[:, 2:]

    places = rng.uniform(-70, 70, (300, 3))
    _, slopes = height(places)
    for k in (0, 1):
        d = 1e-5 * np.eye(3)[k]
        by_difference = (height(places + d)[0] - height(places - d)[0]) / 2e-5
        np.testing.assert_allclose(slopes[:, k], by_difference, rtol=0, atol=2e-5)
    from_scene = np.array([depths.surface.depth_at(a, b) for a, b, _ in places])
    np.testing.assert_allclose(-height(places)[0], from_scene[:, 0], rtol=0, atol=1e-9)
    np.testing.assert_allclose(-slopes, from_scene[:, 1:], rtol=0, atol=1e-10)
    on_lines = np.column_stack([x, np.full(8, 3.3), np.zeros(8)])
    for step in (np.array([1e-9, 0, 0]), np.array([0, 1e-9, 0])):
        (z1, s1), (z2, s2) = height(on_lines - step), height(on_lines + step)
        np.testing.assert_allclose(z1, z2, atol=1e-6)
        np.testing.assert_allclose(s1, s2, atol=1e-6)
    at_points, _ = height(np.array([[a, b, 0.0] for a in x for b in y]))
    np.testing.assert_allclose(-at_points.reshape(8, 6), depths.depth, rtol=1e-14)


def random_steps(rng: np.random.Generator, n: int) -> list[float]:
    """Rising coordinates (n,), m, of a grid whose steps differ by up to a thousand times."""
    steps: list[float] = np.cumsum(10.0 ** rng.uniform(-1.0, 2.0, n)).tolist()
    return steps


def leaves_range(depths: Depths, parts: int = 7) -> float:
    """By how many m the surface leaves the range of the four corner depths of a cell, at the most."""
    surface, depth = depths.surface, np.array(depths.depth)
    most = 0.0
    for i, j in np.ndindex(len(depths.x) - 1, len(depths.y) - 1):
        corners = depth[i : i + 2, j : j + 2]
        for a in np.linspace(depths.x[i], depths.x[i + 1], parts):
            for b in np.linspace(depths.y[j], depths.y[j + 1], parts):
                z = surface.depth_at(a, b)[0]
                most = max(most, z - corners.max(), corners.min() - z)
    return most


@pytest.mark.long
@pytest.mark.parametrize(
    ("x", "row"),
    [
        ([-50, 99, 100, 300], [100, 100, 90, 90]),
        ([-50, 90, 110, 300], [100, 100, 90, 90]),
        ([-50, 40, 60, 300], [100, 100, 95, 95]),
        ([-50, 60, 80, 81, 300], [100, 100, 105, 104, 101]),
    ],
)
def test_a_shelf_on_an_uneven_grid_is_monotone(x: list[float], row: list[float]) -> None:
    depths = Depths(x=x, y=[-50, 50], depth=[[z, z] for z in row])
    assert leaves_range(depths, 51) <= 1e-12 * max(row)
    across = Depths(x=[-50, 50], y=x, depth=[row, row])
    assert leaves_range(across, 51) <= 1e-12 * max(row)
    places = np.linspace(x[0], x[-1], 300)
    along = [depths.surface.depth_at(a, 3.0) for a in places]
    np.testing.assert_allclose(along, [np.take(across.surface.depth_at(3.0, a), [0, 2, 1]) for a in places], atol=1e-12)


@pytest.mark.parametrize("seed", range(6))
def test_no_depth_leaves_the_range_of_its_four_corners_on_random_grids(seed: int) -> None:
    """By Bezier points, without a tolerance but rounding; and a plane on the same grid keeps its slopes."""
    rng = np.random.default_rng(seed)
    x, y = random_steps(rng, 7), random_steps(rng, 6)
    depth = rng.choice([60.0, 90.0, 100.0], (7, 6)) if seed % 2 else rng.uniform(50, 100, (7, 6)).cumsum(axis=0)
    depths = Depths(x=x, y=y, depth=depth.tolist())
    assert leaves_range(depths) <= 1e-12 * depth.max()
    plane = Depths(x=x, y=y, depth=[[100.0 - 0.06 * a + 0.03 * b for b in y] for a in x]).surface
    np.testing.assert_allclose(plane.values[..., 1], -0.06, rtol=1e-9)
    np.testing.assert_allclose(plane.values[..., 2], 0.03, rtol=1e-9)
    np.testing.assert_allclose(plane.values[..., 3], 0.0, atol=1e-9)


def test_slopes_are_those_of_monotone_cubics() -> None:
    """Along x of depths that do not change with y, against scipy's PCHIP."""
    rng = np.random.default_rng(8)
    x, row = random_steps(rng, 20), rng.uniform(80, 100, 20)
    depths = Depths(x=x, y=[0, 1, 5], depth=[[z] * 3 for z in row.tolist()])
    places = np.linspace(x[0], x[-1], 500)
    found = [depths.surface.depth_at(a, 2.2)[0] for a in places]
    np.testing.assert_allclose(found, PchipInterpolator(x, row)(places), rtol=1e-12)


def test_a_line_over_a_hill_is_pushed_aside_and_balances() -> None:
    """The bed pushes along its normal, so what it bears across the line has to be borne by tension."""
    with hybrid.static(mooring(hill(), model="catenary")) as result:
        r = result.position[-1]
        assert r[:, 1].min() < -3.0 and result["contact"][-1].max() > 300.0
        assert result.attributes["static_residual"] < 1e-3
        grid = Depths(**hill()["depths"]).surface
        lies = result["contact"][-1] > 50.0
        under = [-grid.depth_at(a, b)[0] - c for a, b, c in r[lies]]
        assert min(under) > 0.0 and max(under) < 0.12


def test_energy_is_kept_on_a_hill_to_second_order() -> None:
    """Without damping, drag and friction the bed stores what it takes: the work of the scheme falls with the step."""
    lost = []
    fluid = {"fluid": {"density": 1025.0}}
    plain = {k: v for k, v in LINE.items() if k not in ("drag",)}
    for step in (0.05, 0.0125):
        bed = hill() | {"stiffness": 5e3, "damping": 0.0}
        made = mooring(
            {}, environment=fluid | {"seabed": bed}, cable={"sections": [plain]}, model="catenary",
            time={"duration": 3.0, "step": step},
        )  # fmt: skip
        with hybrid.run(made) as result:
            lost.append(float(np.abs(result.work["scheme"]).max()))
            most = float(np.ptp(result.energy["contact"]))
    assert lost[1] < 0.2 * lost[0] and lost[1] < 0.05 * most, (lost, most)


def test_a_file_gives_the_same_bed_and_its_path_is_relative_to_the_scene(tmp_path: Path) -> None:
    rows = [f"{y},{x},{100.0 - SLOPE[0] * x - SLOPE[1] * y!r}" for y in Y for x in X]
    (tmp_path / "bed.csv").write_text("y,x,depth\n" + "\n".join(reversed(rows)) + "\n")
    (tmp_path / "scene.yaml").write_text(
        "environment: {seabed: {z: 0, stiffness: 5e3, depths: {file: bed.csv}}}\n"
        "cable: {sections: [{length: 10, mass: 1}]}\n"
        "ends: {start: {kind: pinned, position: [0, 0, -90]}, end: {kind: free}}\ninitial: equilibrium\n"
    )
    scene = hybrid.load_scene(tmp_path / "scene.yaml")
    bed = scene.environment.seabed
    assert bed is not None and bed.height(20.0, 30.0) == pytest.approx(-100 + 20 * 0.06 + 30 * 0.03, abs=1e-12)


@pytest.mark.parametrize(
    ("depths", "words"),
    [
        ({"x": [0, 1], "y": [0, 1], "depth": [[1, 2]]}, "2 rows"),
        ({"x": [0, 1], "y": [0, 1], "depth": [[1, 2], [1]]}, "2 numbers"),
        ({"x": [0, 0], "y": [0, 1], "depth": [[1, 2], [1, 1]]}, "above the one before"),
        ({"x": [0, 1], "y": [0, 1]}, "x, y and depth, or file"),
        ({"file": "missing.csv"}, "does not exist"),
        ({"x": [-1, 1], "y": [-1, 1], "depth": [[1, 2], [1, 1]]}, "over the grid of depths"),
    ],
)
def test_what_is_no_bed_is_refused(depths: dict[str, Any], words: str) -> None:
    with pytest.raises(SceneError) as refused:
        mooring({"z": 0.0, "depths": depths})
    assert words in str(refused.value)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("x,y,depth\n0,0,1\n0,1,1\n1,0,1\n", "no row for x = 1, y = 1"),
        ("x,y,depth\n0,0,1\n0,1,1\n1,0,1\n1,1,1\n1,1,2\n", "line 6"),
        ("x,y,z\n0,0,1\n", "columns x,y,depth"),
        ("x,y,depth\n0,0,1\n0,1,a\n1,0,1\n1,1,1\n", "line 3"),
    ],
)
def test_what_is_no_grid_in_a_file_is_refused_with_its_line(tmp_path: Path, text: str, words: str) -> None:
    path = tmp_path / "bed.csv"
    path.write_text(text)
    with pytest.raises(SceneError) as refused:
        mooring({"z": 0.0, "depths": {"file": str(path)}})
    assert words in str(refused.value)


def test_a_bed_of_depths_is_in_space_and_has_no_slope_beside() -> None:
    with pytest.raises(SceneError) as refused:
        mooring({"z": 0.0, "depths": PLANE}, dimension=2)
    assert "depths" in str(refused.value)
    with pytest.raises(SceneError, match="depths give the shape"):
        mooring({"z": 0.0, "depths": PLANE, "slope": [0.1, 0.0]})
