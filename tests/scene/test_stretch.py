"""Tables of tension over strain in files, and where they cannot be used."""

from __future__ import annotations

from pathlib import Path

import pytest
import yaml
from scene_texts import complaints

import hybrid
from hybrid.errors import SceneError

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


@pytest.mark.parametrize("network", [False, True])
def test_a_file_of_the_reel_is_beside_the_scene_and_among_its_files(network: bool, tmp_path: Path) -> None:
    (tmp_path / "rope.csv").write_text("tension,strain\n0,0\n1000,0.01\n", encoding="utf-8")
    rope = "tension_strain: {file: rope.csv}"
    end = (
        f"{{kind: pinned, position: [8, 0, 0], payout: {{rate: 0.1, ramp: 5, reel: [{{length: 5, mass: 1, {rope}}}]}}}}"
    )
    tables = yaml.safe_load(SCENE % (rope, end)) | {"model": "catenary"}
    if network:
        line = {"start": "a", "end": "b", "sections": tables["cable"]["sections"], "model": "catenary"}
        line["connections"] = {"end": {"payout": tables["ends"]["end"]["payout"]}}
        points = {"a": {"position": [0.0, 0.0, 0.0]}, "b": {"position": [8.0, 0.0, 0.0]}}
        tables = {"points": points, "lines": {"rope": line}}
    (tmp_path / "scene.yaml").write_text(yaml.safe_dump(tables), encoding="utf-8")
    assert hybrid.load_scene(tmp_path / "scene.yaml").named_files() == [str(tmp_path / "rope.csv")]


def test_a_cable_with_a_table_is_a_rod_by_default() -> None:
    assert hybrid.parse_scene(SCENE % (TABLE, "free")).model.kind == "rod"


@pytest.mark.parametrize(
    ("end", "more", "where"),
    [
        (
            "{kind: pinned, position: [8, 0, 0], payout: {rate: 0.1, ramp: 5, reel: [{length: 5, mass: 1}]}}",
            "model: catenary",
            "ends.end.payout.reel[0]",
        ),
    ],
)
def test_what_cannot_be_computed_with_a_table_is_refused(end: str, more: str, where: str) -> None:
    assert where in [x.where for x in complaints(f"{SCENE % (TABLE, end)}{more}\n")]


def test_a_table_on_the_reel_is_refused() -> None:
    reel = f"[{{length: 5, mass: 1, {TABLE}}}]"
    end = f"{{kind: pinned, position: [8, 0, 0], payout: {{rate: 0.1, ramp: 5, reel: {reel}}}}}"
    found = complaints(f"{SCENE % ('axial_stiffness: 1.0e+5', end)}model: catenary\n")
    assert "ends.end.payout.reel[0].tension_strain" in [x.where for x in found]
