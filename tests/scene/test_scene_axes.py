"""Where the axes of a section with two bending stiffnesses point, and how far a short line may be stretched."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scene_texts import complaints
from scipy.spatial.transform import Rotation

import hybrid
from hybrid.errors import SceneError
from tests.combinations.pairs import seen_by
from tests.scenes import cable_scene, clamped_at, pinned_at

DEFECTS = Path(__file__).parents[1] / "data" / "defects"
FLAT = {"length": 60.0, "mass": 3.0, "bending_stiffness": [900.0, 300.0], "torsional_stiffness": 150.0}


def hung(**start: Any) -> dict[str, Any]:
    """A flat line, clamped at one end."""
    return cable_scene(FLAT, clamped_at([0, 0, 0], [1, 0.5, 0.2]) | start, pinned_at(36, 12, 8), model="rod", mesh=30)


def test_axes_that_nothing_gives_are_asked_for() -> None:
    """0.6.0 took an axis of the world, so that turning the scene by 0.5 rad moved the line by 0.2 m of 60."""
    with pytest.raises(hybrid.SceneError) as refused:
        hybrid.validate_scene(hung())
    (complaint,) = refused.value.complaints
    assert complaint.where == "ends.start.normal" and "a1" in complaint.expected and "normal" in complaint.fix


@pytest.mark.parametrize("start", [{"normal": [0.0, 0.0, 1.0]}, {"swivel": True}])
def test_a_scene_with_its_axes_may_be_turned(start: dict[str, Any]) -> None:
    R = Rotation.from_euler("z", 0.5).as_matrix()
    here, there = (hybrid.static(x).position[-1] for x in (hung(**start), seen_by(R, hung(**start))))
    assert np.abs(there @ R - here).max() < 1e-6


def test_a_line_too_short_for_its_ends_is_refused_by_its_stress() -> None:
    """220 m over 228 m: 7.4 MN in a line of 50 mm, 3.7 GPa over its cross-section; said, or soft, it may be."""
    scene = DEFECTS / "too_short.yaml"
    with pytest.raises(hybrid.SceneError, match="too short and would stretch by 3"):
        hybrid.load_scene(scene)
    hybrid.load_scene(scene, ["cable.sections[0].max_strain=0.05"])
    hybrid.load_scene(scene, ["cable.sections[0].axial_stiffness=1e6"])
    hybrid.load_scene(scene, ["cable.sections[0].axial_stiffness=null",
                              "cable.sections[0].tension_strain=[[0, 0], [0.1, 2e7]]"])  # fmt: skip


# --- Tables of tension over strain in files, and where they cannot be used ---

SCENE = """\
cable: {sections: [{length: 10.0, mass: 1.0, bending_stiffness: 2.0, %s}]}
ends: {start: {kind: pinned, position: [0.0, 0.0, 0.0]}, end: %s}
initial: {kind: equilibrium}
"""
TABLE = "tension_strain: [[0, 0], [0.01, 1000.0]]"


def test_a_file_is_the_table_that_it_holds(tmp_path: Path) -> None:
    (tmp_path / "rope.csv").write_text("tension,strain\n0,0\n1000,0.01\n5000,0.03\n", encoding="utf-8")
    scene = tmp_path / "scene.yaml"
    scene.write_text(SCENE % ("tension_strain: {file: rope.csv}", "free"), encoding="utf-8")
    section = hybrid.load_scene(scene).cable.sections[0]
    assert section.curve == ((0.0, 0.0), (0.01, 1000.0), (0.03, 5000.0))
    assert section.strain_limit == 0.03 and section.borne == 5000.0 and section.stiffness == pytest.approx(2e5)
    (tmp_path / "rope.csv").write_text("tension,strain\n0,0\n1000,0.01\n900,0.03\n", encoding="utf-8")
    with pytest.raises(SceneError, match=r"rope.csv, line 4: 0.03, 900"):
        hybrid.load_scene(scene)


def test_a_file_of_the_reel_is_beside_the_scene_and_among_its_files(tmp_path: Path) -> None:
    (tmp_path / "rope.csv").write_text("tension,strain\n0,0\n1000,0.01\n", encoding="utf-8")
    rope = "tension_strain: {file: rope.csv}"
    end = (
        f"{{kind: pinned, position: [8, 0, 0], payout: {{rate: 0.1, ramp: 5, reel: [{{length: 5, mass: 1, {rope}}}]}}}}"
    )
    (tmp_path / "scene.yaml").write_text(SCENE % (rope, end) + "model: catenary\n", encoding="utf-8")
    assert hybrid.load_scene(tmp_path / "scene.yaml").named_files() == [str(tmp_path / "rope.csv")]


def test_a_cable_with_a_table_is_a_rod_by_default() -> None:
    assert hybrid.parse_scene(SCENE % (TABLE, "free")).model.kind == "rod"


@pytest.mark.parametrize(
    ("section", "reel", "where"), [(TABLE, "", ""), ("axial_stiffness: 1.0e+5", f", {TABLE}", ".tension_strain")]
)
def test_a_table_at_a_winch_or_on_its_reel_alone_is_refused(section: str, reel: str, where: str) -> None:
    reel = f"[{{length: 5, mass: 1{reel}}}]"
    end = f"{{kind: pinned, position: [8, 0, 0], payout: {{rate: 0.1, ramp: 5, reel: {reel}}}}}"
    found = complaints(f"{SCENE % (section, end)}model: catenary\n")
    assert f"ends.end.payout.reel[0]{where}" in [x.where for x in found]
