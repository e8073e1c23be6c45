"""Rods that weight bends within less than a cell, where they carry almost no tension: found, and said with a remedy."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import hybrid

KIND = "unresolved slack bend"
EI, WEIGHT, DIAMETER = 100.0, 1.5 * 9.81 - 1025 * 9.81 * np.pi / 4 * 0.03**2, 0.03
BEND = (EI / WEIGHT) ** (1 / 3)  # m
ENDS = {"start": "free", "end": {"kind": "pinned", "position": [0, 0, 0]}}


def laid(cells: int, **more: Any) -> dict[str, Any]:
    """A cable that a ship lays at 2 m/s on a seabed 60 m below, seen from the ship."""
    sea = {
        "fluid": {"density": 1025, "surface": 0, "current": [-2.0, 0, 0]},
        "seabed": {"z": -60, "stiffness": 2e3, "damping": 5e2},
    }
    section = {
        "length": 240, "diameter": DIAMETER, "mass": 1.5, "axial_stiffness": 2e7, "bending_stiffness": EI,
        "drag": {"normal": 1.2},
    }  # fmt: skip
    return {
        "environment": sea, "cable": {"sections": [section]}, "ends": ENDS, "dimension": 2, "initial": "equilibrium",
        "model": "rod", "time": {"duration": 0.2, "step": 0.05}, "mesh": {"cells": cells},
    } | more  # fmt: skip


def noted(result: hybrid.Result) -> list[Any]:
    return [event for event in result.events if event.kind == KIND]


def test_a_rod_on_cells_longer_than_its_bend(tmp_path: Path) -> None:
    coarse = hybrid.run(laid(30), tmp_path / "coarse.h5")
    [event] = noted(coarse)
    assert f"within {BEND:.2g} m" in event.text and "a cell of 8 m" in event.text
    assert f"cells of {0.25 * BEND:.2g} m would do" in event.text
    fine = hybrid.run(laid(400), tmp_path / "fine.h5")
    assert not noted(fine)
    bends = [float(x["curvature"][0].max()) for x in (coarse, fine)]
    assert bends[0] < 0.5 * bends[1]  # what the event is about
    s = fine.s[np.argmax(fine["curvature"][0])]
    assert event.s_a <= s <= event.s_b


def test_cells_as_the_text_asks_for_show_the_bend(tmp_path: Path) -> None:
    cells = int(np.ceil(240 / (0.25 * BEND)))
    found, finer = (hybrid.run(laid(n), tmp_path / f"{n}.h5") for n in (cells, 2 * cells))
    assert float(found["curvature"][0].max()) == pytest.approx(float(finer["curvature"][0].max()), rel=0.05)


def test_accuracy_of_curvature_is_a_remedy(tmp_path: Path) -> None:
    scene = {key: value for key, value in laid(30).items() if key != "mesh"}
    assert noted(hybrid.run(scene, tmp_path / "plain.h5"))
    assert not noted(hybrid.run(scene | {"accuracy": {"curvature": "5%"}}, tmp_path / "asked.h5"))


def test_cells_that_follow_are_looked_at_too(tmp_path: Path) -> None:
    model = {"kind": "adaptive", "curvature_error": 0.1, "rod_cell": 6.0}
    [event] = noted(hybrid.run(laid(30, model=model), tmp_path / "follow.h5"))
    assert "`model.rod_cell`" in event.text


def test_lines_of_a_system(tmp_path: Path) -> None:
    scene = laid(30)
    sections = scene["cable"]["sections"]
    points, lines = {}, {}
    for name, y in (("port", -20.0), ("starboard", 20.0)):
        tail = {"kind": "free", "initial_guess": [-230.0, y, -60]}
        points |= {f"{name} tail": tail, f"{name} ship": {"kind": "fixed", "position": [0, y, 0]}}
        lines[name] = {
            "start": f"{name} tail", "end": f"{name} ship", "sections": sections, "mesh": scene["mesh"],
            "model": "rod",
        }  # fmt: skip
    whole = {key: scene[key] for key in ("environment", "time")} | {"points": points, "lines": lines}
    found = hybrid.run(whole, tmp_path / "system.h5")
    assert all(len(noted(found.lines[name])) == 1 for name in lines)


def test_it_is_noted_once_and_not_again_after_a_resume(tmp_path: Path) -> None:
    hybrid.run(laid(30), tmp_path / "half.h5")
    assert len(noted(hybrid.resume(tmp_path / "half.h5", until=0.4))) == 1


@pytest.mark.parametrize("change", ["taut", "straight", "natural"])
def test_what_is_shown_is_not_noted(change: str, tmp_path: Path) -> None:
    scene = laid(30)
    section = scene["cable"]["sections"][0]
    if change == "taut":  # a suspension whose tension stays above EI/l^2
        scene["ends"] = {"start": {"kind": "pinned", "position": [0, 0, -10]}, "end": ENDS["end"]}
        scene["ends"]["end"] = {"kind": "pinned", "position": [230, 0, -10]}
    elif change == "straight":  # lies on the bed
        section["length"], scene["initial"] = 60, {"kind": "equilibrium"}
        scene["environment"]["fluid"]["current"] = [0, 0, 0]
        scene["ends"] = {"start": "free", "end": {"kind": "pinned", "position": [0, 0, -60]}}
        scene["mesh"] = {"cells": 10}
    else:  # lies on the bed in an arc that it has without stress
        section |= {"length": 60, "intrinsic_curvature": [0.05, 0.0, 0.0], "torsional_stiffness": EI}
        scene["environment"]["fluid"]["current"] = [0, 0, 0]
        clamp = {"kind": "clamped", "position": [0, 0, -60], "tangent": [1, 0, 0], "normal": [0, 0, 1]}
        scene |= {"ends": {"start": clamp, "end": "free"}, "mesh": {"cells": 15}, "dimension": 3}
    result = hybrid.run(scene, tmp_path / "a.h5")
    assert not noted(result)
    if change == "natural":  # it is bent, by 0.2 rad a cell, and without tension
        assert result["curvature"][0].max() == pytest.approx(0.05, rel=0.05)
