"""Histories of forces and moments on points and bodies of several lines, given by rows or by files beside the scene."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from hybrid.kernels.junctions.bodies import FORCE, MOMENT, NUMBERS
from hybrid.model.bodies import body_model
from hybrid.scene.read import load_scene

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
