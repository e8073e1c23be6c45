"""Scenes of several lines: what is read, and what is refused with its place and what to try."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import hybrid
from hybrid.errors import SceneError
from hybrid.kernels.junctions.bodies import FORCE, MOMENT, NUMBERS
from hybrid.model.bodies import body_model
from hybrid.scene.bodies import FixedBody, FreeBody, Hydrostatics
from hybrid.scene.ends import Fairlead, FixedPoint, FreePoint
from hybrid.scene.network import JoinedLine, Network, NetworkOutput
from hybrid.scene.read import load_scene, read_text, scene_text

PAGE = Path(__file__).parents[2] / "docs" / "scene.md"
TEXT = """\
environment:
  fluid: {density: 1025, surface: 30}
points:
  west: {position: [-150, 0, -100]}
  east: {position: [150, 0, -100]}
  buoy: {kind: free, initial_guess: [0, 0, 5], mass: 1000, volume: 20}
lines:
  west: {start: west, end: buoy, sections: [{length: 185, mass: 10, diameter: 0.05, axial_stiffness: 1.0e+7}]}
  east: {start: buoy, end: east, sections: [{length: 185, mass: 10, diameter: 0.05, axial_stiffness: 1.0e+7}]}
time: {duration: 20, step: 0.05}
"""


def network(text: str, *settings: str) -> Network:
    found, _ = read_text(text, "lines.yaml", settings)
    assert isinstance(found, Network)
    return found


def test_a_system_is_read_changed_and_written() -> None:
    found = network(TEXT, "time.step=0.1", "points.buoy.mass=1200", "lines.west.mesh={cells: 20}")
    assert found.time is not None and found.time.step == 0.1
    assert found.free == ("buoy",) and found.lines_at("buoy") == [("west", "end"), ("east", "start")]
    assert found.carried("west") == ("end",) and found.carried("east") == ()
    assert found.lines["west"].mesh is not None and found.lines["west"].chosen_model.kind == "catenary"
    assert network(scene_text(found)) == found
    plan = hybrid.plan(found)
    assert plan.cells == 120 and plan.free == ("buoy",) and plan.steps == 200


@pytest.mark.parametrize(
    ("old", "new", "line", "where", "says"),
    [
        ("end: east,", "end: eats,", 9, "lines.east.end", "did you mean east?"),
        ("kind: free,", "kind: fre,", 6, "points.buoy.kind", "did you mean free?"),
        ("mass: 1000", "mas: 1000", 6, "points.buoy.mas", "did you mean mass?"),
        ("mass: 1000, volume: 20", "added_mass: 2", 6, "points.buoy.added_mass", "no mass, volume or drag area"),
        ("[150, 0, -100]", "[150, 0]", 5, "points.east.position", "three numbers"),
        ("step: 0.05", "step: 0.05, rho_inf: 1, tolerance: 0.1", 10, "time.rho_inf", "steps follow the motion"),
        ("start: buoy, end: east", "start: east, end: east", 9, "lines.east.end", "a point other than east"),
        ("  east: {position", "  idle: {position: [0, 0, 0]}\n  east: {position", 5, "points.idle", "leave it out"),
        ("  fluid: {density: 1025, surface: 30}", "  gravity: 9.81", 6, "points.buoy.volume", "fluid"),
        ("time:", "accuracy: 1 kg\ntime:", 10, "accuracy", "1%, 3 cm or 50 N"),
        ("time:", "dimension: 4\ntime:", 10, "dimension", "one of: 2, 3"),
        ("mass: 10, diameter: 0.05, axial", "mass: 10, diameter: 0.05, drag: 3, axial", 8, "lines.west.sections[0].drag",
         "normal: 3"),
    ],
)  # fmt: skip
def test_refused_with_place_and_remedy(old: str, new: str, line: int, where: str, says: str) -> None:
    assert old in TEXT
    with pytest.raises(SceneError) as refused:
        read_text(TEXT.replace(old, new, 1), "lines.yaml")
    found = {complaint.where: complaint for complaint in refused.value.complaints}
    assert where in found, str(refused.value)
    assert found[where].line == line and says in found[where].text(), found[where].text()


def test_points_that_nothing_holds_are_refused() -> None:
    text = TEXT.replace("  buoy: {", "  a: {initial_guess: [0, 0, 9]}\n  b: {initial_guess: [5, 0, 9]}\n  buoy: {")
    text = text.replace("lines:\n", "lines:\n  loose: {start: a, end: b, sections: [{length: 9, mass: 1}]}\n")
    with pytest.raises(SceneError, match=r"nothing holds this cable, which weighs 88\.29 N"):
        read_text(text)


def test_a_pendant_may_be_the_first_line_at_its_knot() -> None:
    """It carries the knot in the balance of forces, and the other lines hold that: in a current it was refused."""
    text = TEXT.replace("surface: 30}", "surface: 30, current: [1, 0, 0]}").replace(
        "lines:\n",
        "  top: {initial_guess: [0, 0, 9], mass: 10, volume: 0.1}\nlines:\n"
        "  pendant: {start: buoy, end: top, sections: [{length: 9, mass: 1, diameter: 0.05, drag: {normal: 1}}]}\n",
    )
    assert network(text).carried("pendant") == ("start",)


def test_a_guess_out_of_reach_is_only_a_guess() -> None:
    found = network(TEXT.replace("initial_guess: [0, 0, 5]", "initial_guess: [0, 0, 500]"))
    result = hybrid.static(found)
    assert abs(result["points/buoy/position"][-1, 0]) < 1e-6 and result["points/buoy/position"][-1, 2] < 30


TOW = """\
environment: {fluid: {density: 1025}}
points:
  anchor: {position: [0, 0, -50]}
  float: {initial_guess: [0, 0, -20], mass: 100, volume: 0.5}
  tug: {position: [30, 0, -20], motion: {travel: {by: [40, 0, 0], over: 20}}}
lines:
  leg: {start: anchor, end: float, sections: [{length: 60, mass: 2, diameter: 0.03, axial_stiffness: 1.0e+7}]}
  tow: {start: float, end: tug, sections: [{length: 40, mass: 2, diameter: 0.03, axial_stiffness: 1.0e+7}]}
time: {duration: 30, step: 0.1}
"""


def test_a_float_may_follow_a_tug_that_leaves_its_first_guess() -> None:
    """The tug goes 50 m from where the float is first looked for, at the end of a line of 40 m: the float follows."""
    assert hybrid.plan(network(TOW)).steps == 300
    with pytest.raises(SceneError) as refused:
        network(TOW.replace("[40, 0, 0]", "[80, 0, 0]"))
    (told,) = refused.value.complaints
    assert told.where == "points.tug.motion.travel" and "from point anchor" in str(refused.value)
    text = TOW.replace("{start: anchor,", "{start: anchor, break_at: {time: 1, end: start},")
    assert network(text.replace("[40, 0, 0]", "[80, 0, 0]")).lines["leg"].break_at is not None


def test_points_farther_apart_than_lines_reach_are_refused_with_the_line() -> None:
    with pytest.raises(
        SceneError, match=r"points\.east(?s:.*)1050 m(?s:.*)388\.5 m from point west, as far as lines west, east"
    ):
        hybrid.static(network(TEXT.replace("[150, 0, -100]", "[900, 0, -100]")))


@pytest.mark.parametrize(
    "table", [FixedPoint, FreePoint, Fairlead, FixedBody, FreeBody, Hydrostatics, JoinedLine, NetworkOutput]
)
def test_every_key_is_on_the_page(table: type) -> None:
    page = PAGE.read_text(encoding="utf-8")
    for key in table.model_fields:
        assert f"`{key}`" in page, key


def test_keys_of_one_cable_say_what_several_lines_have_instead() -> None:
    for key, fix in Network.instead.items():
        with pytest.raises(SceneError) as refused:
            read_text(f"{TEXT}{key}: 1\n")
        assert [x.fix for x in refused.value.complaints if x.where == key] == [fix]


@pytest.mark.parametrize(("name", "better"), [("a/b", "a_b"), ("../../x", "x"), ("/", "line1")])
def test_a_name_that_the_result_file_does_not_take(name: str, better: str) -> None:
    """It was called `lines.a/b.[key]`, of which "something else" was expected."""
    before, _, after = TEXT.partition("lines:\n  west:")
    with pytest.raises(SceneError) as refused:
        read_text(f"{before}lines:\n  {name}:{after}")
    (found,) = [x for x in refused.value.complaints if x.value.startswith(f"{name}: ")]
    assert (found.line, found.fix) == (before.count("\n") + 2, f"call it {better}")
    assert "without / and ." in found.expected


# --- Histories of forces and moments on points and bodies of several lines, given by rows or by files beside the
# scene ---

SCENE = """
points:
  anchor: {position: [0, 0, -50]}
  top: {body: buoy, place: [0, 0, -1]}
  pulled: {initial_guess: [20, 0, -30], mass: 10, force: {file: loads/force.csv}}
  far: {position: [40, 0, -50]}
  rail: {body: ship, place: [0, 0, 0]}
bodies:
  buoy:
    initial_guess: [0, 0, 0]
    mass: 1000
    inertia: [500, 500, 500]
    force: {file: loads/force.csv}
    moment: {history: [[0, 0, 0, 0], [2, 0, 80, 0], [4, 0, 0, 0]]}
  ship: {position: [60, 0, 0], motion: {file: loads/ship.csv}}
lines:
  a: {start: anchor, end: top, sections: [{length: 52, mass: 2}], mesh: {cells: 4}}
  b: {start: anchor, end: pulled, sections: [{length: 32, mass: 2}], mesh: {cells: 4}}
  c: {start: pulled, end: far, sections: [{length: 32, mass: 2}], mesh: {cells: 4}}
  d: {start: far, end: rail, sections: [{length: 60, mass: 2}], mesh: {cells: 4}}
time: {duration: 5, step: 0.1}
"""


def written(folder: Path) -> Path:
    """The scene with its files in a folder."""
    (folder / "loads").mkdir()
    (folder / "loads" / "force.csv").write_text("t,x,y,z\n0,0,0,0\n2,0,0,600\n4,100,0,0\n")
    (folder / "loads" / "ship.csv").write_text("t,x,y,z\n" + "".join(f"{0.5 * k},60,0,0\n" for k in range(12)))
    (folder / "scene.yaml").write_text(SCENE)
    return folder / "scene.yaml"


def test_files_of_points_and_bodies_are_looked_for_beside_the_scene(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = written(tmp_path)
    monkeypatch.chdir(Path(__file__).parent)
    scene = load_scene(path)
    ship, buoy, pulled = scene.bodies["ship"], scene.bodies["buoy"], scene.points["pulled"]
    assert ship.motion is not None and ship.motion.file == str(tmp_path / "loads" / "ship.csv")  # type: ignore[union-attr]
    for x in (buoy, pulled):
        assert x.end.loads[0].rows == ((0, 0, 0, 0), (2, 0, 0, 600), (4, 100, 0, 0))  # type: ignore[union-attr]


def test_a_body_bears_what_its_histories_say(tmp_path: Path) -> None:
    """Linear between rows, the last value after them, nothing once a load is let go."""
    scene = load_scene(written(tmp_path))
    model = body_model("buoy", scene.bodies["buoy"], 0.0, 9.81)  # type: ignore[union-attr,arg-type]
    row = np.zeros(NUMBERS)
    for t, force, moment in ((1.0, (0, 0, 300), 40.0), (3.0, (50, 0, 300), 40.0), (9.0, (100, 0, 0), 0.0)):
        model.load(t, 0.0, row)
        np.testing.assert_allclose(row[FORCE : FORCE + 3], force, atol=1e-12)
        np.testing.assert_allclose(row[MOMENT : MOMENT + 3], (0.0, moment, 0.0), atol=1e-12)
