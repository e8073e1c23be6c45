"""Decks written of scenes: they come back as the same scenes, and what MoorDyn has not is refused or named."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from moordyn_decks import FOLDER, one_scene, text_of
from test_moordyn_systems import RISER

import hybrid
from hybrid.interop.moordyn import export_moordyn, import_moordyn
from hybrid.interop.moordyn.writer import deck_of
from hybrid.scene.read import as_scene, read_text, scene_text
from hybrid.scene.root import in_full
from tests.scenes import line_between, network_scene


class Straight:
    """A result of lines that are straight between the places of their ends, with the cells of the scene."""

    def __init__(self, scene: Any) -> None:
        self.scene_text = scene_text(scene)
        self.lines: dict[str, Any] = {}
        if isinstance(scene, hybrid.Scene) and "" not in scene.asked_lines:
            self.lines = {name: Straight(scene.scene_of(name)) for name in scene.lines}
            self._arrays = {}
            for name, body in scene.bodies.items():
                place = body.position if body.kind == "fixed" else body.initial_guess
                rotation = body.rotation if body.kind == "fixed" else body.initial_rotation
                self._arrays |= {
                    f"bodies/{name}/position": np.array([place]),
                    f"bodies/{name}/rotation": np.array([rotation]),
                }
            return
        mesh, length = scene.mesh, scene.cable.length
        places = [*(scene.ends.held() | scene.ends.initial_guesses()).values()]
        if len(places) == 1:
            places.append((places[0][0], places[0][1], places[0][2] - length))
        self.s = np.linspace(0.0, length, 11)
        nodes = np.array(mesh.nodes) if mesh.nodes else np.linspace(0.0, length, mesh.cells + 1)
        self._arrays = {"position": np.linspace(*places, 11)[None], "mesh/s": nodes[None]}

    def __getitem__(self, name: str) -> Any:
        return self._arrays[name]


def back(scene: Any, folder: Path) -> Any:
    (folder / "back.txt").write_text(deck_of(Straight(scene)).text)
    (made,) = import_moordyn(folder / "back.txt").scenes.values()
    return made.scene


def assert_same(ours: Any, theirs: Any) -> None:
    """Two cables are made of the same, to the digits of a deck."""
    for a, b in zip(ours.sections, theirs.sections, strict=True):
        for key in ("length", "mass", "diameter", "axial_stiffness", "bending_stiffness"):
            assert (getattr(b, key) or 0.0) == pytest.approx(getattr(a, key) or 0.0, rel=1e-10)
        assert (a.drag, a.added_mass) == (b.drag, b.added_mass)
        taus = [x.damping.stiffness if x.damping else 0.0 for x in (a, b)]
        assert taus[1] == pytest.approx(taus[0], rel=1e-10)


@pytest.mark.parametrize("name", ["three_lines", "generator_spread"])
def test_several_lines_come_back(name: str, tmp_path: Path) -> None:
    (made,) = import_moordyn(FOLDER / f"{name}.txt").scenes.values()
    again = back(made.scene, tmp_path)
    for ours, theirs in zip(made.scene.lines.values(), again.lines.values(), strict=True):
        assert_same(ours.cable, theirs.cable)
        for a, b in ((ours.start, theirs.start), (ours.end, theirs.end)):
            assert again.points[b].position == pytest.approx(made.scene.points[a].position)
    assert again.environment == made.scene.environment


def test_a_riser_with_joints_comes_back(tmp_path: Path) -> None:
    scene = one_scene(RISER, tmp_path).scene
    again = back(scene, tmp_path)
    ours, theirs = ([x.cable for x in s.lines.values()] for s in (scene, again))
    assert sorted(len(x.sections) for x in ours) == sorted(len(x.sections) for x in theirs) == [1, 1, 3]
    riser, copy = (max(x, key=lambda cable: len(cable.sections)) for x in (ours, theirs))
    assert_same(riser, copy)
    body, point = scene.points["body1"], next(p for p in again.points.values() if p.kind == "free")
    assert (point.mass, point.volume, point.drag_area) == (body.mass, body.volume, body.drag_area)
    assert point.added_mass == pytest.approx(body.added_mass)
    assert again.environment == scene.environment


def test_bodies_come_back(tmp_path: Path) -> None:
    text = RISER.replace("3 Body1 0 0 0 0", "3 Body1 1 0 0.5 0").replace("29.5 0 0.1", "29.5 -2 0.1|0.2|0.3")
    scene = one_scene(text.replace("0 0 30 29.5", "10 -20 30 29.5"), tmp_path).scene
    again = back(scene, tmp_path)
    a, b = scene.bodies["body1"], again.bodies["body1"]
    assert (a.mass, a.centre, a.inertia, a.volume) == (b.mass, b.centre, b.inertia, b.volume)
    assert b.initial_guess == a.initial_guess and b.initial_rotation == pytest.approx(a.initial_rotation)
    assert b.centre_of_buoyancy == a.centre_of_buoyancy and b.added_mass[1] == pytest.approx(a.added_mass[1])
    given = scene.model_dump(mode="json", exclude_none=True)
    given["bodies"]["body1"]["hydrostatics"] = {"heave": 10}
    del given["bodies"]["body1"]["volume"], given["bodies"]["body1"]["centre_of_buoyancy"]
    other, _ = read_text(scene_text(hybrid.Scene.model_validate(given)))
    with pytest.raises(hybrid.SceneError, match=r"bodies.body1.hydrostatics"):
        deck_of(Straight(other))


def test_a_cable_with_a_clump_comes_back(tmp_path: Path) -> None:
    (made,) = import_moordyn(FOLDER / "rope_and_chain.txt").scenes.values()
    scene, again = made.scene, back(made.scene, tmp_path)
    assert_same(scene.cable, again.cable)
    (clump,), (copy,) = scene.cable.attachments, again.cable.attachments
    assert (clump.at, clump.mass, clump.volume, clump.drag_area) == (copy.at, copy.mass, copy.volume, copy.drag_area)
    assert again.mesh.nodes == pytest.approx(scene.mesh.nodes)
    assert again.environment.seabed.stiffness == pytest.approx(scene.environment.seabed.stiffness)


def test_a_clamp_is_a_rod_without_length(tmp_path: Path) -> None:
    text = text_of("chain").replace("2.0e8    0          0   ", "2.0e8    0          1.0e3   ")
    scene = one_scene(text, tmp_path).scene
    clamp = {"kind": "clamped", "position": [205, 0, -2], "tangent": [3, 0, 4], "motion": {"heave": {"amplitude": 1, "period": 9}, "ramp": 9}}  # fmt: skip
    clamp["swivel"] = True
    data = scene.model_dump(mode="json", exclude_none=True)
    scene = hybrid.validate_scene(
        data | {"ends": {"start": {**clamp, "position": [0, 0, -99], "motion": None}, "end": clamp}}
    )
    again = back(scene, tmp_path)
    for a, b in zip(scene.ends.both, again.ends.both, strict=True):
        assert b.position == a.position and b.tangent == pytest.approx((0.6, 0.0, 0.8)) and b.swivel
    deck = deck_of(Straight(scene))
    assert " Coupled 205 0 -2 205.6 0 -1.2 0 -" in deck.text and "rod 1: start; rod 2: end" in deck.text
    assert deck.notes == ("MoorDyn has no torsion",)


@pytest.mark.parametrize(
    ("change", "where", "says"),
    [
        ({"environment": {"fluid": {"density": 1025}, "seabed": {"z": -100, "stiffness": 1e4, "slope": [0.01, 0]}}}, "environment.seabed.slope", "level"),
        ({"cable": {"sections": [{"length": 250, "mass": 20}]}}, "cable.sections[0].axial_stiffness", "springs"),
        ({"cable": {"sections": [{"length": 250, "mass": 20, "axial_stiffness": 2e8, "creep": {"per_decade": 2e-3, "loaded": 9}}]}},
         "cable.sections[0].creep", "axial_stiffness alone"),
        ({"ends": {"start": {"kind": "pinned", "position": [0, 0, -99]}, "end": {"kind": "free", "force": [9e4, 0, 9e4]}}},
         "ends.end", "no force"),
    ],
)  # fmt: skip
def test_what_moordyn_has_not_is_refused(change: dict[str, Any], where: str, says: str) -> None:
    (made,) = import_moordyn(FOLDER / "chain.txt").scenes.values()
    data = made.scene.model_dump(mode="json", exclude_none=True)
    if "cable" in change:
        del data["environment"]["fluid"]
    scene = hybrid.validate_scene(data | change)
    with pytest.raises(hybrid.SceneError) as refused:
        deck_of(Straight(scene))
    assert where in {c.where for c in refused.value.complaints} and says in str(refused.value)


def test_contact_is_named() -> None:
    (made,) = import_moordyn(FOLDER / "chain.txt").scenes.values()
    data = made.scene.model_dump(mode="json", exclude_none=True)
    scenes = [hybrid.validate_scene(data | {"contact": {"self": x}}) for x in (True, False)]
    section = {"length": 30, "mass": 9, "diameter": 0.1, "axial_stiffness": 1e7}
    lines = {x: line_between("a", "b", section, mesh=9, model="catenary") for x in "lm"}
    ends = {"a": {"position": [0, 0, -20]}, "b": {"position": [20, 0, 0]}}
    scenes += [hybrid.validate_scene(network_scene(ends, lines, contact=x)) for x in ({}, {"between": []})]
    said = [any("contact is left out" in x for x in deck_of(Straight(scene)).notes) for scene in scenes]
    assert said == [True, False, True, False]


def test_lift_of_vortices_is_named() -> None:
    (made,) = import_moordyn(FOLDER / "chain.txt").scenes.values()
    data = made.scene.model_dump(mode="json", exclude_none=True)
    data["cable"]["sections"][0]["vortices"] = {}
    (note,) = deck_of(Straight(hybrid.validate_scene(data))).notes
    assert note.startswith("cable.sections[0].vortices is left out")


def test_currents_and_waves_are_named(tmp_path: Path) -> None:
    (made,) = import_moordyn(FOLDER / "chain.txt").scenes.values()
    data = made.scene.model_dump(mode="json", exclude_none=True)
    data["environment"]["fluid"] |= {
        "current": [1, 0, 0],
        "waves": {"kind": "regular", "height": 2, "period": 8, "ramp": 8},
    }
    notes = deck_of(Straight(hybrid.validate_scene(data))).notes
    assert [note.split(" ")[0] for note in notes] == ["environment.fluid.current", "environment.fluid.waves"]


@pytest.mark.parametrize(("z", "notes"), [(-0.3, 1), (-5.0, 0)])
def test_a_buoy_that_floats_at_the_surface_is_named(z: float, notes: int) -> None:
    """MoorDyn has it 4.5 m above the water, where the scene has 0.3 m below."""
    points = {
        "buoy": {"kind": "free", "mass": 500, "volume": 6, "height": 2, "initial_guess": [0, 0, z]},
        "anchor": {"position": [0, 40, -40]},
    }
    section = {"length": 66, "mass": 20, "diameter": 0.05, "axial_stiffness": 2e7}
    line = line_between("anchor", "buoy", section, mesh=20, model="catenary")
    scene = network_scene(points, {"a": line}, fluid={"density": 1025, "surface": 0})
    found = deck_of(Straight(hybrid.validate_scene(scene))).notes
    assert sum("whole volume; hybrid only where it is wet" in x for x in found) == notes


def test_a_deck_that_is_there_is_kept(tmp_path: Path) -> None:
    (made,) = import_moordyn(FOLDER / "chain.txt").scenes.values()
    path = tmp_path / "deck.txt"
    assert export_moordyn(Straight(made.scene), path).text == path.read_text()
    with pytest.raises(hybrid.SceneError, match="not there yet"):
        export_moordyn(Straight(made.scene), path)
    export_moordyn(Straight(made.scene), path, overwrite=True)


def test_a_deck_replaces_only_decks_that_were_written_here(tmp_path: Path) -> None:
    """`hybrid export deck.h5 --moordyn` wrote over deck.txt, from which the scene had been imported, and over scenes."""
    deck = tmp_path / "deck.txt"
    deck.write_bytes((FOLDER / "chain.txt").read_bytes())
    (made,) = import_moordyn(deck).scenes.values()
    with pytest.raises(hybrid.SceneError, match="a deck that hybrid has written"):
        export_moordyn(Straight(made.scene), deck, overwrite=True)
    assert deck.read_bytes() == (FOLDER / "chain.txt").read_bytes()
    deck.write_text("")
    assert export_moordyn(Straight(made.scene), deck, overwrite=True).text == deck.read_text()


def test_clamps_of_several_lines_are_rods_and_come_back(tmp_path: Path) -> None:
    """At a fixed point and at a body that is turned, in axes of the body; a spring has no counterpart."""
    pipe = {"length": 30.0, "mass": 9.0, "diameter": 0.08, "axial_stiffness": 1e7, "bending_stiffness": 5e3}
    held = {"start": {"tangent": [0.0, 0.6, 0.8], "swivel": True}, "end": {"tangent": [1.0, 0.0, 0.0], "swivel": True}}
    tables: dict[str, Any] = network_scene(
        {"low": {"position": [0.0, 0.0, -20.0]}, "far": {"position": [-20.0, 0.0, -15.0]},
         "lug": {"body": "ship", "place": [1.0, 0.0, -2.0]}},
        {"pipe": line_between("low", "lug", pipe, connections=held, mesh=20),
         "leg": line_between("low", "far", pipe, model="catenary", mesh=10)},
        fluid={"density": 1025.0, "surface": 5.0},
        bodies={"ship": {"position": [8.0, 3.0, 2.0], "rotation": [0.0, 0.0, 90.0]}}
    )  # fmt: skip
    scene = hybrid.Scene.model_validate(tables)
    made = back(scene, tmp_path)
    ours, theirs = scene.lines["pipe"], made.lines["line1"]
    for end in ("start", "end"):
        mine, its = getattr(ours.connections, end), getattr(theirs.connections, end)
        assert its.tangent == pytest.approx(mine.tangent) and its.swivel
    assert all(getattr(made.lines["line2"].connections, end).kind == "pinned" for end in ("start", "end"))
    shapes = [next(iter(hybrid.static(x).lines.values())) for x in (scene, made)]
    assert np.abs(shapes[0]["position"][-1] - shapes[1]["position"][-1] - [0.0, 0.0, 5.0]).max() < 1e-6
    held["end"]["bend_stiffness"] = 1e3
    with pytest.raises(hybrid.SceneError, match=r"lines\.pipe\.connections\.end"):
        back(hybrid.Scene.model_validate(tables), tmp_path)


@pytest.mark.parametrize(("form", "where"), [(as_scene, "ends.end"), (lambda x: in_full(as_scene(x)), "points.end")])
def test_a_guided_end_is_refused(form: Any, where: str) -> None:
    section = {"length": 12.0, "mass": 2.0, "bending_stiffness": 5.0}
    ends = {"start": {"kind": "pinned", "position": [0, 0, 0]}, "end": {"kind": "guided", "tangent": [1, 0, 0]}}
    straight = {"kind": "straight", "origin": [0, 0, 0], "direction": [1, 0, 0]}
    made = {"cable": {"sections": [section]}, "ends": ends, "initial": straight, "model": "rod", "mesh": {"cells": 12}}
    scene = form(made | {"time": {"duration": 0.02, "step": 0.01}})
    with pytest.raises(hybrid.SceneError, match=rf"{where}\n.*guided"):
        deck_of(hybrid.run(scene))
