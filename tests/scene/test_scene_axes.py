"""Where the axes of a section with two bending stiffnesses point, and how far a short line may be stretched."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import hybrid
from tests.scenes import cable_scene, clamped_at

DEFECTS = Path(__file__).parents[1] / "data" / "defects"
FLAT = {"length": 60.0, "mass": 3.0, "bending_stiffness": [900.0, 300.0], "torsional_stiffness": 150.0}


def turned(v: list[float], angle: float) -> list[float]:
    c, s = np.cos(angle), np.sin(angle)
    return [float(c * v[0] - s * v[1]), float(s * v[0] + c * v[1]), v[2]]


def hung(angle: float, **start: Any) -> dict[str, Any]:
    """A flat line, clamped at one end, in a scene that is turned about the vertical."""
    clamp = {key: turned(x, angle) if isinstance(x, list) else x for key, x in start.items()}
    return cable_scene(
        FLAT, clamped_at([0, 0, 0], turned([1, 0.5, 0.2], angle)) | clamp,
        {"kind": "pinned", "position": turned([36, 12, 8], angle)}, model="rod", mesh=30
    )  # fmt: skip


def system(angle: float, **start: Any) -> dict[str, Any]:
    """The same in a scene of several lines."""
    tables = hung(angle, **start)
    points = {name: {"position": end.pop("position")} for name, end in tables["ends"].items()}
    clamp = {key: x for key, x in tables["ends"]["start"].items() if key != "kind"}
    line = {"sections": [FLAT], "model": "rod", "mesh": tables["mesh"], "start": "start", "end": "end"}
    return {"points": points, "lines": {"flat": line | {"connections": {"start": clamp}}}}


def test_axes_that_nothing_gives_are_asked_for() -> None:
    """0.6.0 took an axis of the world, so that turning the scene by 0.5 rad moved the line by 0.2 m of 60."""
    with pytest.raises(hybrid.SceneError) as refused:
        hybrid.validate_scene(hung(0.0))
    (complaint,) = refused.value.complaints
    assert complaint.where == "ends.start.normal" and "a1" in complaint.expected and "normal" in complaint.fix
    with pytest.raises(hybrid.SceneError) as refused:
        hybrid.static(system(0.0))
    assert [x.where for x in refused.value.complaints] == ["lines.flat.connections.start.normal"]


@pytest.mark.parametrize("start", [{"normal": [0.0, 0.0, 1.0]}, {"swivel": True}])
def test_a_scene_with_its_axes_may_be_turned(start: dict[str, Any]) -> None:
    here, there = (np.asarray(hybrid.static(hung(angle, **start)).position)[-1] for angle in (0.0, 0.5))
    back = np.array([turned(x, -0.5) for x in there.tolist()])
    assert np.abs(back - here).max() < 1e-6


def test_a_line_too_short_for_its_ends_is_refused_by_its_stress() -> None:
    """220 m over 228 m: 7.4 MN in a line of 50 mm, 3.7 GPa over its cross-section; said, or soft, it may be."""
    scene = DEFECTS / "too_short.yaml"
    with pytest.raises(hybrid.SceneError, match="too short and would stretch by 3"):
        hybrid.load_scene(scene)
    hybrid.load_scene(scene, ["cable.sections[0].max_strain=0.05"])
    hybrid.load_scene(scene, ["cable.sections[0].axial_stiffness=1e6"])
    hybrid.load_scene(scene, ["cable.sections[0].axial_stiffness=null",
                              "cable.sections[0].tension_strain=[[0, 0], [0.1, 2e7]]"])  # fmt: skip
