"""What becomes of a deck: every kind of table, the conversions, the notes, and the way from a scene and back."""

from __future__ import annotations

import importlib.util
import math
import re
from pathlib import Path
from typing import Any

import pytest
from moordyn_decks import DECKS, FOLDER, from_text, imported, text_of
from peers.adapters.decks import MoorDyn
from peers.adapters.interface import line_of

import hybrid
from hybrid.errors import SceneError
from hybrid.interop.moordyn import ImportedScene
from hybrid.interop.moordyn.tables import _rotated
from hybrid.scene.ends import Body, Clamped, Free, Pinned
from hybrid.scene.root import Scene
from tests.scenes import cable_scene, pinned_at


def only(name: str, line: int | None = None) -> ImportedScene:
    (one,) = imported(name, line).scenes.values()
    return one


@pytest.mark.parametrize("name", DECKS)
def test_every_scene_is_planned_and_says_where_it_comes_from(name: str) -> None:
    deck = imported(name)
    assert deck.scenes
    for scene in deck.scenes.values():
        assert hybrid.parse_scene(scene.text) == scene.scene
        assert hybrid.plan(scene.scene).cells
        assert f"{name}.txt" in scene.text.splitlines()[0] and f"{name}.txt" in scene.scene.title
        lines = text_of(name).splitlines()
        for id in scene.lines:
            numbers = [n for n, row in enumerate(lines, 1) if row.split()[:1] == [str(id)]]
            assert any(f" {n}" in scene.text or f" {n}," in scene.text for n in numbers)


def test_a_chain() -> None:
    scene = only("chain").scene
    (section,) = scene.cable.sections
    assert (section.length, section.mass, section.diameter) == (250.0, 20.0, 0.05)
    assert section.axial_stiffness == 2.0e8 and section.bending_stiffness is None and section.damping is None
    assert (section.drag.normal, section.drag.tangential) == (1.2, 0.05)
    assert (section.added_mass.normal, section.added_mass.tangential) == (1.0, 0.0)
    bed, fluid = scene.environment.seabed, scene.environment.fluid
    assert (bed.z, bed.friction) == (-100.0, None)
    assert bed.stiffness == pytest.approx(1e5 * 0.05) and bed.damping == pytest.approx(1e4 * 0.05)
    assert (fluid.density, fluid.surface, scene.environment.gravity) == (1025.0, 0.0, 9.81)
    assert scene.ends.start == Pinned(position=(0.0, 0.0, -100.0))
    assert scene.ends.end == Pinned(position=(205.0, 0.0, -2.0))
    assert scene.mesh.cells == 50 and scene.model.kind == "catenary" and scene.initial.kind == "equilibrium"


def test_two_lines_that_meet_at_a_free_point_are_one_cable_with_what_hangs_there() -> None:
    made = only("rope_and_chain")
    chain, rope = made.scene.cable.sections
    assert made.lines == (1, 2) and made.name == "line1+2"
    assert (chain.mass, rope.mass) == (70.0, 11.5) and chain.axial_stiffness == 3.0e8
    (clump,) = made.scene.cable.attachments
    assert (clump.kind, clump.at, clump.mass, clump.volume, clump.drag_area) == ("clump", 220.0, 2000.0, 0.25, 0.8)
    assert clump.added_mass == pytest.approx(0.5 * 1025.0 * 0.25)
    assert made.scene.ends.end.position == (400.0, 60.0, -12.0), "the rope is written from there; the cable ends there"
    # BA: half of the critical damping of a segment of 10 m, and 1e5 N s
    assert chain.damping.stiffness == pytest.approx(0.5 * 10.0 * math.sqrt(70.0 / 3.0e8))
    assert rope.damping.stiffness == pytest.approx(1.0e5 / 2.0e7)
    nodes = made.scene.mesh.nodes
    assert len(nodes) == 53 and nodes[22] == 220.0 and nodes[23] == pytest.approx(227.0)
    bed = made.scene.environment.seabed
    assert bed.stiffness == pytest.approx(3.0e6 * 0.12) and bed.damping == pytest.approx(3.0e5 * 0.12)
    assert (bed.friction.axial, bed.friction.lateral) == (0.4, 0.4)
    assert made.scene.environment.gravity == 9.80665


@pytest.mark.parametrize(("line", "ids"), [(1, (1, 2)), (2, (1, 2))])
def test_a_line_of_a_cable_names_it(line: int, ids: tuple[int, ...]) -> None:
    assert only("rope_and_chain", line).lines == ids


def test_three_lines_are_three_scenes() -> None:
    deck = imported("three_lines")
    assert list(deck.scenes) == ["line1", "line2", "line3"]
    tail = deck.scenes["line3"].scene
    reach = math.dist(tail.ends.start.position, tail.ends.end.position)
    assert tail.cable.length == pytest.approx(0.98 * reach), "a negative length is so many times the distance"
    assert tail.cable.sections[0].drag.tangential == 0.04 and tail.cable.sections[0].added_mass.tangential == 0.0


def test_version_1_has_other_columns() -> None:
    made = only("version1")
    lower, upper = made.scene.cable.sections
    assert (lower.length, upper.length) == (2.9, 1.1)
    assert (upper.added_mass.normal, upper.added_mass.tangential) == (0.9, 0.1)
    assert (upper.drag.normal, upper.drag.tangential) == (1.2, 0.01)
    (buoy,) = made.scene.cable.attachments
    assert (buoy.kind, buoy.mass, buoy.volume, buoy.drag_area) == ("float", 0.06, 3.0e-4, 0.004)
    assert buoy.added_mass == pytest.approx(0.5 * 1025.0 * 3.0e-4)
    assert made.scene.ends.end.position == (-0.5, 0.0, -0.2)
    assert made.scene.environment.seabed.stiffness == pytest.approx(3.0e5 * 0.004)


def test_tables_that_count_their_rows() -> None:
    scene = only("counted").scene
    assert scene.cable.length == 900.0 and scene.ends.start.position == (850.0, 0.0, -320.0)
    assert scene.environment.seabed.stiffness == pytest.approx(3.0e6 * 0.09)
    assert scene.cable.sections[0].axial_stiffness == 3.84e8
    assert any(note.line == 6 and "MoorDyn-C stops reading" in note.why for note in imported("counted").notes)


def test_free_points_at_the_end_are_bodies_or_nothing_and_the_bed_is_moordyns_own() -> None:
    deck = imported("free_fall")
    weight, loose = (deck.scenes[f"line{k}"].scene.ends.end for k in (1, 2))
    assert isinstance(weight, Body) and isinstance(loose, Free)
    assert (weight.mass, weight.volume, weight.drag_area, weight.initial_guess) == (500.0, 0.06, 0.2, (0.0, 0.0, -60.0))
    assert weight.added_mass == pytest.approx(0.5 * 1025.0 * 0.06)
    scene = deck.scenes["line1"].scene
    assert scene.environment.seabed.z == -80.0
    assert scene.environment.seabed.stiffness == pytest.approx(3.0e6 * 0.03), "MoorDyn's own, where a deck has none"


def test_rods_and_bodies_hold_what_they_can() -> None:
    deck = imported("rods_and_bodies")
    assert list(deck.scenes) == ["line1", "line2", "line3", "line9", "line10"]
    first = deck.scenes["line1"].scene.ends
    assert isinstance(first.start, Clamped) and isinstance(first.end, Clamped)
    assert first.start.position == (0.0, 50.0, -78.0), "end B of a rod of 2 m"
    assert first.start.tangent == (0.0, 0.0, 1.0), "the line goes on as the rod points"
    # rod 2 has no segments, so both of its ends are at A; body 1 is turned by 90 degrees about z
    assert first.end.position == pytest.approx((10.0, 4.0, -6.0))
    assert first.end.tangent == pytest.approx((0.0, 0.0, 1.0)), "the line comes into the rod at its end A"
    assert first.start.swivel and first.end.swivel
    assert deck.scenes["line2"].scene.ends.end.position == pytest.approx((8.0, 1.0, -6.0))
    assert deck.scenes["line3"].scene.ends.end.position == pytest.approx((295.0, 0.0, -23.0))
    assert deck.scenes["line3"].scene.cable.sections[0].axial_stiffness == 2.0e7
    assert deck.scenes["line10"].scene.ends.start.position == (-50.0, 0.0, -80.0)
    assert isinstance(deck.scenes["line9"].scene.ends.end, Body)
    assert deck.scenes["line9"].scene.ends.end.initial_guess is None, "out of the line's reach, so left to the search"


def test_bodies_turn_as_in_moordyn() -> None:
    """Measured with MoorDyn 2.7: a point at [1, 2, 3] on a body turned by 30, 40, 50 degrees."""
    assert _rotated((30.0, 40.0, 50.0), (1.0, 2.0, 3.0)) == pytest.approx((1.2471, 0.3419, 3.5111), abs=5e-5)
    assert _rotated((0.0, 0.0, 90.0), (1.0, 2.0, 3.0)) == pytest.approx((-2.0, 1.0, 3.0))


# --- what is said ------------------------------------------------------------------------------


def said(name: str) -> set[tuple[int | None, str]]:
    deck = imported(name)
    notes = [*deck.notes, *(note for scene in deck.scenes.values() for note in scene.notes)]
    return {(note.line, note.kind) for note in notes}


def test_everything_without_a_place_is_named_with_its_line() -> None:
    found = said("rods_and_bodies")
    lines = text_of("rods_and_bodies").splitlines()

    def row(begin: str) -> int:
        return 1 + next(i for i, text in enumerate(lines) if text.startswith(begin))

    left_out = [
        "whirl ", "4    curve", "5    cable      1        R3A", "6    cable", "7    cable", "8    cable",
        "1          1       2,3", "1     Body2", "1          2", "3         3.5e5", "whatever", "bed.txt",
        "1          WaveKin", "1          Currents", "7          quality", "only_a_word",
    ]  # fmt: skip
    assert {line for line, kind in found if kind == "left out"} == {row(begin) for begin in left_out}
    taken = ["1     Coupled", "2     Free", "1    can", "4    can", "6    Free", "8    Coupled"]
    assert {line for line, kind in found if kind == "taken as"} == {row(begin) for begin in taken}
    assert row("poly ") not in {line for line, _ in found}  # its static and dynamic stiffness have a counterpart
    assert {line for line, kind in found if kind == "not needed"} == {row("0.25"), row("200        CV")}


def test_a_deck_with_nothing_strange_leaves_nothing_out() -> None:
    for name in ("chain", "rope_and_chain", "three_lines", "version1", "counted", "free_fall"):
        assert not {line for line, kind in said(name) if kind == "left out"}
    assert {line for line, kind in said("chain") if kind == "taken as"} == {11}
    assert {line for line, kind in said("chain") if kind == "not needed"} == {15, 17, 18, 19, 25, 26, 27, 30, 31}


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("2.0e8    0          0   ", "2.0e8    0          1.0e3   ", "no torsion"),
        ("1.0e4    cBot", "0.3 FrictionCoefficient", "holds nothing at rest"),
        ("100      WtrDpth\n", "", "lowest point of the deck"),
        ("1.0e5    kBot", "0    kBot", "without stiffness"),
        ("250       50", "250       1", "two cells"),
        ("0        WaveKin", "0        WaveKin\n9.81 g", "line 20"),
    ],
)
def test_differences_are_said_where_they_are(old: str, new: str, words: str, tmp_path: Path) -> None:
    text = text_of("chain")
    assert old in text
    plain, other = from_text(text, tmp_path), from_text(text.replace(old, new), tmp_path)
    for deck, there in ((plain, False), (other, True)):
        notes = [*deck.notes, *(note for scene in deck.scenes.values() for note in scene.notes)]
        assert any(words in note.why for note in notes) == there


@pytest.mark.parametrize(
    ("deck", "old", "new", "line", "kind", "words"),
    [
        ("version1", "3.0e-4   0     0     0 ", "3.0e-4   0     0     2 ", 11, "left out", "a steady force on a point"),
        ("version1", "6.0e4    -0.6", "6.0e4    50.0", 5, "taken as", "BA is taken in N s"),
        ("version1", "0.06   3.0e-4", "0.0    0.0   ", 11, "left out", "drag of a point without mass"),
        ("rope_and_chain", "1.0e5      0   ", "ba.dat     0   ", 7, "left out", "BA is read from ba.dat"),
        ("rope_and_chain", "120      WtrDpth", "bed.txt  WtrDpth", 20, "left out", "the depth is read from a file"),
        ("three_lines", "6    Coupled ", "6    Turbine1", 15, "left out", "FAST.Farm"),
        ("three_lines", "3        P6", "3        4 ", 15, "left out", "holds no line"),
    ],
)
def test_what_is_said_of_a_row(deck: str, old: str, new: str, line: int, kind: str, words: str, tmp_path: Path) -> None:
    text = text_of(deck)
    assert text.count(old) == 1
    made = from_text(text.replace(old, new), tmp_path)
    notes = [*made.notes, *(note for scene in made.scenes.values() for note in scene.notes)]
    found = [note for note in notes if words in note.why]
    assert found and found[0].kind == kind
    assert found[0].line == line or words == "FAST.Farm", "of a turbine the line that ends there is named"


def test_a_point_with_buoyancy_and_no_mass_is_a_buoy(tmp_path: Path) -> None:
    row = "2    Coupled      205   0    -2     0      0 "
    (made,) = from_text(
        text_of("chain").replace(row, "2    Free  205   0    -2     0      1 "), tmp_path
    ).scenes.values()
    assert (made.scene.ends.end.mass, made.scene.ends.end.volume) == (0.0, 1.0)


def test_bending_makes_the_model_only_where_all_sections_have_it(tmp_path: Path) -> None:
    text = text_of("chain").replace("2.0e8    0          0   ", "2.0e8    0          1.0e3   ")
    (one,) = from_text(text, tmp_path).scenes.values()
    assert one.scene.model.kind == "adaptive" and one.scene.cable.sections[0].bending_stiffness == 1.0e3
    mixed = text_of("rope_and_chain").replace("1.0e5      0   ", "1.0e5      50  ")
    (one,) = from_text(mixed, tmp_path).scenes.values()
    assert one.scene.model.kind == "catenary" and any("without EI" in note.why for note in one.notes)


def test_line_ends_and_comments_of_other_systems(tmp_path: Path) -> None:
    text = text_of("chain")
    plain = from_text(text, tmp_path).scenes["line1"]
    for other in (text.replace("\n", "\r\n"), "\ufeff" + text, text.replace(" ", "\t")):
        assert from_text(other, tmp_path).scenes["line1"].scene == plain.scene
    (tmp_path / "deck.txt").write_bytes(text.replace("m^3", "m³").encode("latin-1"))
    assert hybrid.import_moordyn(tmp_path / "deck.txt").scenes["line1"].scene == plain.scene


# --- from a scene and back ---------------------------------------------------------------------

MOORING: dict[str, Any] = cable_scene(
    {"length": 250.0, "mass": 20.0, "diameter": 0.05, "axial_stiffness": 2.0e8, "bending_stiffness": 2.0e3,
     "drag": {"normal": 1.2, "tangential": 0.05}, "added_mass": {"normal": 0.8}},
    pinned_at(0.0, 0.0, -100.0), pinned_at(205.0, 10.0, -3.0), gravity=9.81, fluid={"density": 1025.0, "surface": 0.0},
    seabed={"z": -100.0, "stiffness": 5.0e3, "damping": 5.0e2}, mesh=40, time={"duration": 10.0}
)  # fmt: skip


def leaves(scene: Scene) -> dict[str, Any]:
    """What a scene says of the physics: every number of environment, cable, ends and mesh, by its path."""

    def walk(node: Any, path: str) -> Any:
        if isinstance(node, dict):
            return [x for key, value in node.items() for x in walk(value, f"{path}.{key}")]
        if isinstance(node, list | tuple):
            return [x for i, value in enumerate(node) for x in walk(value, f"{path}[{i}]")]
        return [(path, node)]

    data = scene.model_dump(mode="json", exclude_none=True)
    return {path: x for key in ("environment", "cable", "ends", "mesh") for path, x in walk(data[key], key)}


def test_a_scene_written_as_a_deck_comes_back(tmp_path: Path) -> None:
    scene = hybrid.validate_scene(MOORING)
    text = MoorDyn().deck(line_of(scene), 40, 1e-3)
    (back,) = from_text(text, tmp_path).scenes.values()
    there, here = leaves(scene), leaves(back.scene)
    assert here.keys() == there.keys()
    for path, value in there.items():
        assert here[path] == (pytest.approx(value, rel=1e-12) if isinstance(value, float) else value), path
    assert back.scene.model.kind == scene.model.kind == "adaptive"


def test_an_equilibrium_written_as_a_deck_comes_back(tmp_path: Path) -> None:
    scene = hybrid.validate_scene(MOORING | {"model": "catenary"})
    (back,) = from_text(MoorDyn().deck(line_of(scene), 40, 1e-3), tmp_path).scenes.values()
    data = back.scene.model_dump(mode="json", exclude_none=True) | {"model": "catenary"}
    here, there = hybrid.static(hybrid.validate_scene(data)), hybrid.static(scene)
    assert here.tension[-1] == pytest.approx(there.tension[-1], rel=1e-9)


# --- MoorDyn's own generator -------------------------------------------------------------------


@pytest.mark.needs("moordyn")
def test_the_generator_still_makes_the_decks_that_are_kept() -> None:
    spec = importlib.util.spec_from_file_location("generate", FOLDER / "generate.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    made = module.made()
    assert {name: text_of(name) for name in DECKS if name.startswith("generator")} == made


def test_generated_decks_are_those_written_by_hand() -> None:
    by_hand, generated = only("chain").scene, only("generator_chain").scene
    same = {"title": ""}
    assert by_hand.model_copy(update=same) == generated.model_copy(update=same)
    assert len(imported("generator_spread").scenes) == 3
    assert only("generator_clump").scene.cable.attachments[0].mass == 2000.0


# --- stiffness of more than one number ----------------------------------------------------------


@pytest.mark.parametrize(
    ("cells", "dynamic", "tau"),
    [
        ("1.0e8|2.0e8 4.0e9|1.0e6", {"constant": 2e8, "relaxation_time": 20.0}, 1e6 / 2e8),
        ("1.0e8|2.0e8|3 4.0e9", {"constant": 2e8, "per_tension": 3.0, "relaxation_time": 20.0}, None),
    ],
)
def test_a_static_and_a_dynamic_stiffness(
    cells: str, dynamic: dict[str, float], tau: float | None, tmp_path: Path
) -> None:
    """The slow spring is EA_s EA_d/(EA_d - EA_s) = 2e8 N, beside its dashpot."""
    made = from_text(text_of("chain").replace("2.0e8    0  ", f"{cells}  "), tmp_path).scenes["line1"]
    (section,) = made.scene.cable.sections
    assert section.axial_stiffness == 1e8
    assert section.dynamic_stiffness.model_dump(exclude_defaults=True) == pytest.approx(dynamic)
    assert (section.damping.stiffness if section.damping else None) == (pytest.approx(tau) if tau else None)
    assert hybrid.parse_scene(made.text) == made.scene


def test_a_table_of_tension_over_strain(tmp_path: Path) -> None:
    (tmp_path / "rope.dat").write_text("strain tension\n(-) (N)\n0 0\n0.01 1e6\n0.02 4e6\n", encoding="utf-8")
    made = from_text(text_of("chain").replace("2.0e8 ", "rope.dat"), tmp_path).scenes["line1"]
    (section,) = made.scene.cable.sections
    assert section.curve == ((0.0, 0.0), (0.01, 1e6), (0.02, 4e6)) and section.axial_stiffness is None
    with pytest.raises(SceneError, match="one stiffness, which this export writes"):
        hybrid.export_moordyn(hybrid.static(made.scene), tmp_path / "back.txt")


@pytest.mark.parametrize(
    ("rows", "message"),
    [
        ("0 0\n0.01 1e6\n", "two lines before the table"),
        ("a b\n(-) (N)\n0 0\n0.02 4e6\n0.01 5e6\n", "line 5"),
        ("a b\n(-) (N)\n0 0\n0.02 x\n", "line 4"),
        ("a b\n(-) (N)\n0 0\n", "2 to 1000 rows"),
    ],
)
def test_a_table_that_is_none(rows: str, message: str, tmp_path: Path) -> None:
    (tmp_path / "rope.dat").write_text(rows, encoding="utf-8")
    with pytest.raises(SceneError, match=message):
        from_text(text_of("chain").replace("2.0e8 ", "rope.dat"), tmp_path)


def test_a_dynamic_stiffness_below_the_static_one(tmp_path: Path) -> None:
    with pytest.raises(SceneError, match="exchanged"):
        from_text(text_of("chain").replace("2.0e8    0  ", "2.0e8|1.0e8 4.0e9|1e6 "), tmp_path)


OWC = "a\nb\nc\n0 0\n0.02 2e6\n0.04 4e6\n0.06 9e6\n"
SETTINGS = "rope.dat OWC curve\n{} WCType shape\n{} k1 first\n{} k2 second\n"
PAST = "---------------------- SYROPE IC -----\nLine Tmax Tmean\n(#) (N) (N)\n{}\n---------------------- OPTIONS"


def polyester(tmp_path: Path, past: str = "1 2e6 1e6", shape: str = "EXP", k: str = "0.25 1.5", owc: str = OWC) -> Any:
    """The chain of polyester, by EA = SYROPE:..."""
    (tmp_path / "rope.dat").write_text(owc, encoding="utf-8")
    (tmp_path / "shape.dat").write_text(SETTINGS.format(shape, *k.split()), encoding="utf-8")
    text = text_of("chain").replace("2.0e8    0  ", "SYROPE:shape.dat|3e8|20 1e9|1e6 ")
    head, tail = re.split(r"(?m)^-+ *OPTIONS", text, maxsplit=1)
    return from_text(head + PAST.format(past) + tail if past else text, tmp_path)


def test_polyester_that_remembers(tmp_path: Path) -> None:
    """k1 e_m is the strain without tension; at Tmean the curve is as soft as the derivative of its formula."""
    made = polyester(tmp_path).scenes["line1"]
    (section,) = made.scene.cable.sections
    assert (section.syrope.working, section.syrope.k1, section.syrope.k2) == ("exponential", 0.25, 1.5)
    assert section.syrope.highest_tension == 2e6 and section.axial_stiffness is None
    grown = math.expm1(1.5)
    soft = 0.75 * 0.02 * grown / (1.5 * (1 + 0.5 * grown) * 2e6)
    assert section.dynamic_stiffness.constant == 3e8 and section.dynamic_stiffness.per_tension == 20
    assert section.dynamic_stiffness.relaxation_time == pytest.approx(1e9 * (soft - 1 / (3e8 + 20 * 1e6)), rel=1e-5)
    assert section.damping.stiffness == pytest.approx(1e6 / 3e8)
    assert hybrid.parse_scene(made.text) == made.scene
    with pytest.raises(SceneError, match="one stiffness, which this export writes"):
        hybrid.export_moordyn(hybrid.static(made.scene), tmp_path / "back.txt")


def test_a_curve_of_polyester_ends_where_it_would_give_back_more_than_it_took(tmp_path: Path) -> None:
    made = polyester(tmp_path, shape="LINEAR", k="0.6 1", owc=OWC + "0.08 2.4e7\n").scenes["line1"]
    assert made.scene.cable.sections[0].syrope.curve[-1] == (0.04, 4e6)
    assert any("taken up to 4e+06 N" in note.why for note in made.notes)


def test_the_row_that_moordyn_does_not_read_is_told_of(tmp_path: Path) -> None:
    told = [any("leaves out the first row" in n.why for n in polyester(tmp_path, owc=x).notes) for x in (OWC, OWC[2:])]
    assert told == [False, True]


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"past": ""}, "add a row to SYROPE IC"),
        ({"past": "1 2e6"}, "lines, Tmax and Tmean"),
        ({"past": "1 2e7 1e6"}, "at most the tension of the last row"),
        ({"shape": "CUBIC"}, "LINEAR, QUADRATIC or EXP"),
        ({"k": "-1 2"}, "a number, >= 0"),
        ({"owc": "a\nb\nc\n0 0\n0.02 2e6\n0.01 4e6\n"}, "line 6"),
        ({"k": "0.25 9"}, "more: the static stiffness is"),
    ],
)
def test_polyester_that_cannot_be(given: dict[str, str], message: str, tmp_path: Path) -> None:
    with pytest.raises(SceneError, match=message):
        assert polyester(tmp_path, **given).scenes


def test_a_chain_names_no_model_so_that_no_run_stops_where_it_goes_slack() -> None:
    (made,) = imported("chain").scenes.values()
    assert made.scene.model.kind == "catenary" and "model" not in made.scene.model_fields_set
