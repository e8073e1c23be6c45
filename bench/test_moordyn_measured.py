"""What `hybrid import` takes for granted of MoorDyn, measured with MoorDyn itself (skipped where it is not installed)."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from peers.moordyn_deck import march, options
from peers.moordyn_touchdown import silence

import hybrid
from hybrid.interop.moordyn import rows as taken

moordyn: Any = import_module("moordyn") if find_spec("moordyn") else None
pytestmark = pytest.mark.skipif(moordyn is None, reason="MoorDyn is not installed")

# A line between two points that are moved, upright; z from -50 to -30.
DECK = """\
--- measured ---
--- LINE TYPES ---
Name Diam Mass EA BA EI Cd Ca CdAx CaAx
(-) (m) (kg/m) (N) (N-s) (N-m^2) (-) (-) (-) (-)
line 0.1 20 1e8 {ba} 0 {cd} {ca} {cdt} {cat}
--- BODIES ---
ID Attachment X0 Y0 Z0 r0 p0 y0 Mass CG I Volume CdA Ca
(#) (-) (m) (m) (m) (deg) (deg) (deg) (kg) (m) (kgm2) (m3) (m2) (-)
1 Fixed 0 0 -10 30 40 50 0 0 0 0 0 0
--- POINTS ---
ID Attachment X Y Z M V CdA Ca
(#) (-) (m) (m) (m) (kg) (m^3) (m^2) (-)
1 Coupled {a} 0 0 0 0
2 Coupled {b} {hung}
3 Body1 1 2 3 0 0 0 0
--- LINES ---
ID LineType AttachA AttachB UnstrLen NumSegs Outputs
(#) (-) (#) (#) (m) (-) (-)
1 line 1 2 {length} {n} -
--- OPTIONS ---
1 disableOutput
1 disableOutTime
0 writeLog
1e-5 dtM
2 TmaxIC
{options}
--- need this line ---
"""
AREA = math.pi / 4 * 0.1**2
HALF = 0.5  # m of line at an end node
LYING = {"a": "0 0 -30", "b": "20 0 -30"}


@contextmanager
def network(tmp_path: Path, **words: Any) -> Iterator[Any]:
    """A running MoorDyn, at rest."""
    usual = {"ba": 0, "cd": 0, "ca": 0, "cdt": 0, "cat": 0, "a": "0 0 -50", "b": "0 0 -30", "hung": "0 0 0 0"}
    usual |= {"length": 20, "n": 20, "options": "100 WtrDpth"}
    path = tmp_path / "deck.txt"
    path.write_text(DECK.format(**(usual | words)))
    with silence():
        made = moordyn.Create(str(path))
        try:
            ends = [float(x) for x in f"{(usual | words)['a']} {(usual | words)['b']}".split()]
            assert moordyn.Init(made, ends, [0.0] * 6) == 0
            yield made, ends
        finally:
            moordyn.Close(made)


def moved(made: Any, ends: list[float], velocity: list[float], sink: float = 0.0) -> None:
    """One tiny step with both ends at a velocity; lowered first."""
    there = [x - sink * (i % 3 == 2) for i, x in enumerate(ends)]
    moordyn.Step(made, there, velocity, 0.0, 1e-5)


def pulls(made: Any) -> np.ndarray:
    return np.array([moordyn.GetPointForce(moordyn.GetPoint(made, k)) for k in (1, 2)])


@pytest.mark.parametrize(
    ("options", "gravity", "density"),
    [("", taken.GRAVITY, taken.DENSITY), ("10 g\n1000 rho", 10.0, 1000.0), ("10 gravity\n1000 WtrDnsty", 10.0, 1000.0)],
)
def test_gravity_and_density(options: str, gravity: float, density: float, tmp_path: Path) -> None:
    with network(tmp_path, options=f"100 WtrDpth\n{options}", length=19.99) as (made, _):
        weight = -pulls(made).sum(axis=0)[2]
    assert weight == pytest.approx((20 - density * AREA) * gravity * 19.99, rel=1e-6)


@pytest.mark.parametrize(
    ("cd", "cdt", "velocity", "width"),
    [(1.0, 0.0, [1.0, 0, 0] * 2, 0.1), (0.0, 1.0, [0, 0, 1.0] * 2, math.pi * 0.1)],
)
def test_drag_is_on_the_diameter_and_along_on_the_circumference(
    cd: float, cdt: float, velocity: list[float], width: float, tmp_path: Path
) -> None:
    with network(tmp_path, cd=cd, cdt=cdt, options="0 g\n100 WtrDpth") as (made, ends):
        moved(made, ends, velocity)
        drag = np.array(moordyn.GetLineNodeDrag(moordyn.GetLine(made, 1), 0))
    assert np.linalg.norm(drag) == pytest.approx(0.5 * 1025 * width * HALF, rel=1e-4)


def test_added_mass_is_on_the_displaced_mass(tmp_path: Path) -> None:
    with network(tmp_path, ca=1.0, cat=0.5) as (made, _):
        mass = np.diag(moordyn.GetLineNodeM(moordyn.GetLine(made, 1), 5))
    assert mass - 20 == pytest.approx(1025 * AREA * np.array([1.0, 1.0, 0.5]), rel=1e-5)


@pytest.mark.parametrize(("speed", "per"), [(0.0, 1000.0), (-1.0, 2000.0), (1.0, 0.0)])
def test_the_bed_is_a_pressure_on_the_diameter_and_damps_both_ways(speed: float, per: float, tmp_path: Path) -> None:
    text = "0 g\n30 WtrDpth\n1e4 kBot\n1e3 cBot"
    with network(tmp_path, **LYING, options=text) as (made, ends):
        moved(made, ends, [0, 0, speed] * 2, sink=0.1)
        force = moordyn.GetLineNodeSeabedForce(moordyn.GetLine(made, 1), 0)[2]
    assert force == pytest.approx(per * 0.1 * HALF, abs=0.02)


def test_the_bed_without_options_is_under_the_lowest_point(tmp_path: Path) -> None:
    found = []
    for speed in (0.0, -1.0):
        with network(tmp_path, **LYING, options="0 g") as (made, ends):
            moved(made, ends, [0, 0, speed] * 2, sink=0.1)
            found.append(moordyn.GetLineNodeSeabedForce(moordyn.GetLine(made, 1), 0)[2] / (0.1 * HALF))
    assert found[0] == pytest.approx(0.1 * taken.BED_STIFFNESS, rel=1e-4)
    assert found[1] - found[0] == pytest.approx(taken.BED_DAMPING, rel=1e-3)


@pytest.mark.parametrize(("ba", "tension"), [(1.0e6, 1.0e6), (-0.5, 0.5 * 20 * math.sqrt(1e8 * 20))])
def test_ba_is_tension_per_rate_of_strain_or_a_part_of_critical(ba: float, tension: float, tmp_path: Path) -> None:
    with network(tmp_path, ba=ba, n=1, options="0 g\n100 WtrDpth") as (made, ends):
        moved(made, ends, [0, 0, 0, 0, 0, 1.0])
        pull = -pulls(made)[1, 2]
    stretched = 1e8 * 0.5e-5 / 20  # in the middle of the step, where RK2 takes its forces
    assert pull == pytest.approx(tension / 20 + stretched, rel=1e-6)


@pytest.mark.parametrize("z", [-30, 5])
def test_a_point_is_lifted_by_its_volume_above_the_surface_too(z: float, tmp_path: Path) -> None:
    found = []
    for hung in ("0 0 0 0", "100 1 0 0"):
        with network(tmp_path, hung=hung, b=f"0 0 {z}", length=z + 50) as (made, _):
            found.append(pulls(made)[1])
    assert found[1] - found[0] == pytest.approx([0, 0, taken.GRAVITY * (1025 - 100)], rel=1e-6)


def test_a_body_turns_by_degrees_about_x_then_y_then_z(tmp_path: Path) -> None:
    from hybrid.interop.moordyn.tables import _rotated

    with network(tmp_path) as (made, _):
        place = np.array(moordyn.GetPointPos(moordyn.GetPoint(made, 3))) - [0, 0, -10]
    assert place == pytest.approx(_rotated((30.0, 40.0, 50.0), (1.0, 2.0, 3.0)), abs=1e-9)


def test_a_negative_length_is_times_the_distance(tmp_path: Path) -> None:
    with network(tmp_path, length=-1.02) as (made, _):
        assert moordyn.GetLineUnstretchedLength(moordyn.GetLine(made, 1)) == pytest.approx(20.4)


ROD_END = Path(__file__).parents[1] / "tests" / "data" / "moordyn" / "rod_end.txt"


@pytest.mark.parametrize(("end", "rod"), [("R1A", "-20     50    0     -19"), ("R1B", "-19     50    0     -20")])
def test_a_rod_holds_the_direction_of_a_line_that_bends(end: str, rod: str, tmp_path: Path) -> None:
    """The shape at rest is that of the scene, clamped as imported; pinned it would be another.

    Into the rod at its end A the line goes as the rod points, into its end B the other way: here upwards both times.
    """
    path = tmp_path / "deck.txt"
    path.write_text(ROD_END.read_text().replace("R1A", end).replace("-20     50    0     -19", rod))
    (made,) = hybrid.import_moordyn(path).scenes.values()
    data = made.scene.model_dump(mode="json", exclude_none=True) | {"model": "rod", "output": {"points": 61}}
    assert data["ends"]["end"]["tangent"] == pytest.approx([0.0, 0.0, 1.0])
    still = options(path.read_text(), dtM=2e-4, tScheme="RK4", writeLog=0, disableOutput=1, disableOutTime=1)
    there = march(still, lambda t: np.zeros(0), 60.0, 1.0, 0.1).nodes[1]
    here = hybrid.static(hybrid.validate_scene(data)).position[-1]
    data["ends"]["end"] = {"kind": "pinned", "position": data["ends"]["end"]["position"]}
    pinned = hybrid.static(hybrid.validate_scene(data)).position[-1]
    off, without = (np.linalg.norm(there - x, axis=1).max() for x in (here, pinned))
    print(f"{end}: {off:.4f} m of 62 m from the clamped scene, {without:.4f} m from a pinned one")
    assert off < 0.02 and without > 1.0
