"""MoorDyn decks of several lines as one scene: what becomes of points, rods and bodies, and what is refused."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from moordyn_decks import DECKS, FOLDER, one_scene, text_of
from test_moordyn_refusals import mutated

import hybrid
from hybrid.interop.moordyn import import_moordyn
from hybrid.interop.moordyn.tables import _rotated, angles_of, rotation_of
from hybrid.scene.bodies import turned
from hybrid.scene.ends import FixedPoint, FreePoint
from hybrid.scene.read import read_text

# A riser over a buoyant section, held by a tether: rods without length join its sections, a body the tether.
RISER = """\
--- LINE TYPES ---
TypeName Diam Mass/m EA BA EI Can Cat Cdn Cdt
- m kg/m N N-s N-m^2 - - - -
riser 0.12 25 3.6e8 0 100 1.0 0.0 1.1 0.008
float 0.36 59 3.6e8 0 100 1.0 0.4 2.6 0.3
rope 0.12 25 5.0e5 0 0 1.0 0.0 2.0 0.1
--- BODIES ---
ID Attachment X0 Y0 Z0 r0 p0 y0 Mass CG I Volume CdA Ca
- - m m m deg deg deg kg m kg-m^2 m^3 m^2 -
1 Free 450 0 -313 0 0 30 29.5 0 0.1 0.014 0.5|0.6 1.0
--- RODS ---
ID RodType Attachment Xa Ya Za Xb Yb Zb NumSegs Outputs
- - - m m m m m m - -
1 conn Free 375 0 -250 375 0 -250 0 -
2 conn Free 290 0 -215 290 0 -215 0 -
--- POINTS ---
ID Attachment X Y Z M V CdA Ca
- - m m m kg m^3 m^2 -
1 Fixed 600 0 -320 0 0 0 0
2 Fixed 452 0 -320 0 0 0 0
3 Body1 0 0 0 0 0 0 0
4 Coupled 0 0 -60 0 0 0 0
--- LINES ---
ID LineType AttachA AttachB UnstrLen NumSegs Outputs
- - - - m - -
1 rope 2 3 7 7 -
2 riser 1 3 150 15 -
3 riser R1A 3 110 11 -
4 float R1B R2A 80 8 -
5 riser R2B 4 340 34 -
--- OPTIONS ---
320 WtrDpth
--- need this line ---
"""


@pytest.mark.parametrize("name", [name for name in DECKS if name != "rods_and_bodies"])
def test_every_deck_is_one_scene_that_is_planned(name: str) -> None:
    deck = import_moordyn(FOLDER / f"{name}.txt")
    (made,) = deck.scenes.values()
    assert read_text(made.text)[0] == made.scene and hybrid.plan(made.scene).cells
    assert made.lines == tuple(range(1, 1 + len(made.lines)))
    assert ("" not in made.scene.asked_lines) == (name in ("three_lines", "free_fall", "generator_spread"))


def test_lines_that_meet_nowhere_are_one_scene_as_well() -> None:
    (made,) = import_moordyn(FOLDER / "three_lines.txt").scenes.values()
    scene = made.scene
    assert list(scene.points) == [f"point{k}" for k in (1, 4, 2, 5, 3, 6)]
    assert scene.points["point4"] == FixedPoint(position=(40.0, 0.0, -14.0))
    tail = scene.lines["line3"]
    assert (tail.start, tail.end) == ("point3", "point6") and tail.mesh.cells == 10
    reach = math.dist(scene.points["point3"].position, scene.points["point6"].position)
    assert tail.cable.length == pytest.approx(0.98 * reach)
    assert {n.line for n in made.notes if "calling program" in n.why} == {13, 14, 15}


def test_free_points_with_one_line_hang_there(tmp_path: Path) -> None:
    made = one_scene(text_of("free_fall"), tmp_path)
    weight, loose = made.scene.points["point2"], made.scene.points["point4"]
    assert (weight.mass, weight.volume, weight.drag_area) == (500.0, 0.06, 0.2)
    assert weight.added_mass == pytest.approx(0.5 * 1025.0 * 0.06)
    assert loose == FreePoint(initial_guess=(20.0, 0.0, -55.0))


def test_rods_without_length_join_lines_and_a_body_at_its_centre_is_a_point(tmp_path: Path) -> None:
    made = one_scene(RISER, tmp_path)
    lines, points = made.scene.lines, made.scene.points
    assert list(lines) == ["line1", "line2", "line5+4+3"]
    riser = lines["line5+4+3"]  # in the direction of line 3, which is written from the rod to the body
    assert (riser.start, riser.end) == ("point4", "body1")
    assert [x.length for x in riser.sections] == [340.0, 80.0, 110.0]
    assert riser.mesh.cells == 53
    body = points["body1"]
    assert (body.initial_guess, body.mass, body.volume, body.drag_area) == ((450.0, 0.0, -313.0), 29.5, 0.014, 0.5)
    assert body.added_mass == pytest.approx(1025.0 * 0.014)
    assert lines["line1"].chosen_model.kind == "catenary" and riser.chosen_model.kind == "rod"


def test_columns_of_added_mass_before_drag_are_read_as_they_are_named(tmp_path: Path) -> None:
    made = one_scene(RISER, tmp_path)
    section = made.scene.lines["line2"].sections[0]
    assert (section.drag.normal, section.drag.tangential, section.added_mass.normal) == (1.1, 0.008, 1.0)
    deck = import_moordyn(tmp_path / "deck.txt")
    assert {n.line for n in deck.notes if "as the columns are named" in n.why} == {4, 5, 6}
    now = one_scene(RISER.replace("Can Cat Cdn Cdt", "Cd Ca CdAx CaAx"), tmp_path).scene.lines["line2"].sections[0]
    assert (now.drag.normal, now.drag.tangential, now.added_mass.tangential) == (1.0, 1.1, 0.008)


def test_a_force_on_a_point_of_version_1(tmp_path: Path) -> None:
    text = text_of("version1")
    # The force acts on a cable of two sections, which has no place for it; with a third line there the point is one.
    assert text.count("3.0e-4   0     0     0 ") == 1
    row = next(row for row in text.splitlines() if row.split()[:1] == ["1"] and "2.9" in row)
    third = row.replace("1", "3", 1)
    text = text.replace("3.0e-4   0     0     0 ", "3.0e-4   0     0     2 ")
    last = [row for row in text.splitlines() if row.split()[:1] == ["2"]][-1]
    scene = one_scene(text.replace(last, last + "\n" + third), tmp_path).scene
    (free,) = [p for p in scene.points.values() if isinstance(p, FreePoint)]
    assert free.force == (0.0, 0.0, 2.0)


PARTS = ["5 Body1 1 0 0 8 0.02 0 0.5", "5 Body1 -0.5 0.8 0.3 2 0 0.4 0", "5 Body1 0 0 0 1 0.01 0 1.0"]


def test_points_on_a_free_body_are_part_of_it(tmp_path: Path) -> None:
    """A load of the body and its points does the same work on each: mass, weight and lift of every one at its place."""
    row, heavy = "4 Coupled 0 0 -60 0 0 0 0\n", RISER.replace("29.5 0 0.1", "29.5 0.5|0|0 3")
    text = heavy.replace("3 Body1 0 0", "3 Body1 0.1 0").replace(row, f"{row}{PARTS[0]}\n")
    deck = one_scene(text, tmp_path)
    body = deck.scene.bodies["body1"]
    density, parts = 1025.0, [(29.5, (0.5, 0.0, 0.0)), (8.0, (1.0, 0.0, 0.0))]
    assert (body.mass, body.volume) == pytest.approx((37.5, 0.034))
    M = np.zeros((6, 6))  # T = 1/2 q M q, of a velocity of the origin and a rate of turning, point by point
    for (m, place), added in zip(parts, (density * 0.014, density * 0.02 * 0.5), strict=True):
        for kilograms, at in ((m, place), (added, (0.0, 0.0, 0.0) if m == 29.5 else place)):
            J = np.hstack([np.eye(3), -np.cross(np.eye(3), at)])  # velocity there: v - at x w
            M += kilograms * J.T @ J
    M[3:, 3:] += np.diag([3.0, 3.0, 3.0])
    assert np.array(body.mass_matrix) == pytest.approx(M, abs=1e-9)
    lift = (0.014 * np.array([0.5, 0.0, 0.0]) + 0.02 * np.array([1.0, 0.0, 0.0])) / 0.034
    assert body.centre_of_buoyancy == pytest.approx(lift)
    with pytest.raises(hybrid.SceneError, match="products of inertia"):
        one_scene(heavy.replace(row, f"{row}{PARTS[1]}\n"), tmp_path)
    centred = one_scene(RISER.replace(row, f"{row}{PARTS[2]}\n"), tmp_path).scene.points["body1"]
    assert (centred.mass, centred.volume, centred.drag_area) == pytest.approx((30.5, 0.024, 0.5))
    assert centred.added_mass == pytest.approx(density * 0.024)


@pytest.mark.parametrize("row", ["2 Fixed 452 0 -320", "4 Coupled 0 0 -60", "3 Body1 0 0 0"])
def test_loads_of_held_points_are_said_to_be_left_out(row: str, tmp_path: Path) -> None:
    held = RISER.replace("1 Free 450", "1 Fixed 450")
    assert held.count(f"{row} 0 0 0 0") == 1
    one_scene(held.replace(f"{row} 0 0 0 0", f"{row} 500 0 0.1 0"), tmp_path)
    for separate in (False, True):
        scenes = import_moordyn(tmp_path / "deck.txt", separate=separate).scenes.values()
        notes = [n for scene in scenes for n in scene.notes]
        assert any(n.kind == "left out" and "its own weight" in n.why and n.text.startswith(row[:6]) for n in notes)


@pytest.mark.parametrize(
    ("old", "new", "line", "says"),
    [
        ("29.5 0 0.1", "29.5 0|0|1 0", 10, "without mass or moments of inertia"),
        ("29.5 0 0.1", "29.5 0|0|1 any", 10, "are not all numbers"),
        ("1 Free 450", "1 Pinned 450", 10, "that a deck pins"),
        ("290 0 -215 0 -", "291 0 -215 3 -", 15, "a rigid rod that moves"),
        ("4 Coupled", "4 Turbine1", 22, "FAST.Farm"),
        ("rope 0.12 25 5.0e5", "rope 0.12 25 stretch.dat", 26, "EA is not one number"),
        ("3 riser R1A 3 110 11 -\n", "3 riser R1A R2B 110 11 -\n", 28, "ring of free rods"),
        ("4 Coupled 0 0 -60", "4 Coupled 0 0 -900", 22, "on the seabed or above"),
    ],
)
def test_what_has_no_place_refuses_the_deck(old: str, new: str, line: int, says: str, tmp_path: Path) -> None:
    assert RISER.count(old) == 1
    with pytest.raises(hybrid.SceneError) as refused:
        one_scene(
            RISER.replace(old, new).replace(
                "5 riser R2B 4 340 34 -\n", "" if "R2B 110" in new else "5 riser R2B 4 340 34 -\n"
            ),
            tmp_path,
        )
    assert line in {c.line for c in refused.value.complaints if says in c.text()}, str(refused.value)


def test_a_point_that_has_a_volume_and_no_mass_lifts_its_line(tmp_path: Path) -> None:
    """The anchor bears what the point lifts less the weight of the line in water."""
    text = text_of("free_fall")
    assert text.count("500    0.06    0.2    0.5") == text.count("2    Free         0    0    -60 ") == 1
    text = text.replace("500    0.06    0.2    0.5", "0 0.5 0.2 0.5").replace("0    0    -60 ", "0 0 -10 ")
    text = text.replace("1    Coupled      0    0    5 ", "1 Fixed 0 0 -79 ")
    scene = one_scene(text, tmp_path).scene
    assert scene.points["point2"].mass == 0.0 and scene.points["point2"].volume == 0.5
    found = hybrid.static(scene.model_copy(update={"lines": {"line1": scene.lines["line1"]}, "points": {
        name: scene.points[name] for name in ("point1", "point2")}}))  # fmt: skip
    rho, g, line = 1025.0, scene.environment.gravity, scene.lines["line1"].sections[0]
    wet = (line.mass - rho * math.pi / 4 * line.diameter**2) * g * line.length
    lift = found["points/point1/force"][-1]
    assert lift[2] == pytest.approx(rho * g * 0.5 - wet, rel=1e-9)


def test_a_free_body_has_its_mass_inertia_and_buoyancy(tmp_path: Path) -> None:
    """Its centre of buoyancy is its centre of mass, as measured with MoorDyn 2.7."""
    text = RISER.replace("3 Body1 0 0 0 0", "3 Body1 1 0 0.5 0").replace("29.5 0 0.1", "29.5 -2 0.1|0.2|0.3")
    made = one_scene(text, tmp_path)
    body, point = made.scene.bodies["body1"], made.scene.points["point3"]
    assert (body.mass, body.centre, body.inertia) == (29.5, (0.0, 0.0, -2.0), (0.1, 0.2, 0.3))
    assert (body.volume, body.centre_of_buoyancy) == (0.014, (0.0, 0.0, -2.0))
    assert body.initial_rotation == pytest.approx((0.0, 0.0, 30.0))
    assert [body.added_mass[i][i] for i in range(6)] == pytest.approx([1025.0 * 0.014] * 3 + [0.0] * 3)
    assert (point.body, point.place) == ("body1", (1.0, 0.0, 0.5))
    assert [n.line for n in made.notes if "CdA" in n.why] == [10]


SEAFLOOR = "3 2\n-900 0 900\n-800 800\n" + "".join(
    f"{x} {y} {-220.0 - x / 900.0 + y / 400.0!r}\n" for y in (-800.0, 800.0) for x in (-900.0, 0.0, 900.0)
)
SEA = "bed.txt SeafloorFile\n200      WtrDpth"


def test_a_seafloor_file_is_a_bed_of_depths(tmp_path: Path) -> None:
    (tmp_path / "bed.txt").write_text(SEAFLOOR)
    (tmp_path / "deck.txt").write_text(text_of("three_lines").replace("200      WtrDpth", SEA))
    deck = import_moordyn(tmp_path / "deck.txt")
    (made,) = deck.scenes.values()
    bed = made.scene.environment.seabed
    assert bed is not None and bed.depths is not None
    assert bed.height(-400.0, 300.0) == pytest.approx(-220.0 + 4.0 / 9.0 + 0.75, abs=1e-9)
    assert [n.kind for n in (*deck.notes, *made.notes) if "straight lines" in n.why] == ["taken as"]


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("3 2", "3 3", "rising"), ("-900 0", "900 0", "rising"), ("-900.0 -800.0", "-901.0 -800.0", "an x of line 2"),
        ("0.0 800.0 ", "0.0 -800.0 ", "for each of the 3 x 2"), ("-221.0", "deep", "three numbers"),
    ],
)  # fmt: skip
def test_a_seafloor_file_that_cannot_be_read_is_refused(tmp_path: Path, old: str, new: str, words: str) -> None:
    assert old in SEAFLOOR
    (tmp_path / "bed.txt").write_text(SEAFLOOR.replace(old, new, 1))
    (tmp_path / "deck.txt").write_text(text_of("three_lines").replace("200      WtrDpth", SEA))
    with pytest.raises(hybrid.SceneError) as refused:
        import_moordyn(tmp_path / "deck.txt")
    assert words in str(refused.value)


@pytest.mark.parametrize("angles", [(30.0, 40.0, 50.0), (-8.0, 3.0, 170.0), (0.0, 90.0, 20.0)])
def test_angles_of_a_deck_are_rotations_of_a_scene_and_back(angles: tuple[float, float, float]) -> None:
    for v in ((1.0, 2.0, 3.0), (-1.0, 0.0, 0.5)):
        assert turned(rotation_of(angles), v) == pytest.approx(_rotated(angles, v))
        assert _rotated(angles_of(rotation_of(angles)), v) == pytest.approx(_rotated(angles, v))


@pytest.mark.long
@settings(max_examples=200, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(mutated([RISER, RISER.replace("3 Body1 0 0 0 0", "3 Body1 1 0 0.5 0"), text_of("rods_and_bodies")]))
def test_a_mutated_deck_is_one_scene_or_refused_with_its_line(tmp_path: Path, text: str) -> None:
    (tmp_path / "deck.txt").write_bytes(text.encode("utf-8", errors="surrogateescape"))
    try:
        assert import_moordyn(tmp_path / "deck.txt").scenes
    except hybrid.SceneError as error:
        lines = {c.line for c in error.complaints if c.where not in ("LINE TYPES", "LINES")}
        assert all(line is not None and 1 <= line <= text.count("\n") + text.count("\r") + 1 for line in lines)
