"""Contact of a line with itself where its cells change in it: energy, forces, friction, and runs that resume."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from bits import Stopping, differences, went_on
from test_self_contact_default import WIDTH, led_through

import hybrid
from hybrid.kernels.contact.self_contact_friction import AT, NEAREST, TRAVEL
from hybrid.kernels.contact.self_contact_law import WX, P
from hybrid.kernels.state.state import Line
from hybrid.solve.self_contact import SelfContact

FOLLOWING = {"kind": "adaptive", "curvature_error": 0.05, "hold_time": 0.4}  # so that zones change as well


def rubbing() -> hybrid.Scene:
    """A line whose legs rub on each other, in cells that follow the curvature, with outputs within steps."""
    more = {"contact": {"self": True, "friction": 0.3}, "model": FOLLOWING, "mesh": {}}
    return hybrid.validate_scene(
        led_through(**more, time={"duration": 2.6, "step": 0.02}, output={"every": 0.005, "points": 101})
    )


@pytest.fixture
def travels(monkeypatch: pytest.MonkeyPatch) -> list[tuple[int, int]]:
    """Of every change of cells in contact: points with a travel before, and points without one after it.

    Points that had nothing near them before are not counted: they come into contact by the change.
    """
    found: list[tuple[int, int]] = []
    settle, begin = SelfContact.settle, SelfContact.__init__

    def beginning(contact: SelfContact, line: Line, *args: object) -> None:
        begin(contact, line, *args)
        contact.s = line.s

    def noting(contact: SelfContact, *args: object) -> float:
        kept = contact.contact.grips[: int(contact.contact.counts.grips), AT].copy()
        energy = settle(contact, *args)
        points = int(contact.contact.counts.points)
        rows, lost = contact.contact.points[:points], 0
        for row, hold in zip(rows, contact.contact.holds[:points], strict=True):
            at = row[WX : WX + 3] @ contact.s[int(row[P]) - 1 : int(row[P]) + 2]
            near = kept.size and np.abs(kept - at).min() < NEAREST * WIDTH
            lost += bool(near and not hold[TRAVEL : TRAVEL + 2].any())
        found.append((kept.size, lost))
        return energy

    monkeypatch.setattr(SelfContact, "settle", noting)
    monkeypatch.setattr(SelfContact, "__init__", beginning)
    return found


@pytest.mark.long
def test_it_goes_on(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, travels: list[tuple[int, int]]) -> None:
    """Energy and force of contact do not fall to nothing where cells change, and friction keeps its travels."""
    stopping, scene = Stopping(monkeypatch), rubbing()
    result = hybrid.run(scene, tmp_path / "whole.h5", progress=stopping)
    held = [lost for had, lost in travels if had > 8]
    assert len(held) >= 4 and sum(held) == 0  # 29 lost where only the same sample points kept theirs
    for x in (result["energy/self_contact"], result["self_contact"].sum(axis=1)):
        assert not ((x[1:-1] < 0.3 * np.minimum(x[:-2], x[2:])) & (x[2:] > 1e-12)).any()
    work = {name: result[f"work/{name}"] for name in ("end", "friction", "scheme", "zones")}
    assert work["friction"][-1] < -0.01 and np.diff(work["friction"]).max() <= 0.0
    assert work["scheme"][-1] < 5e-3 * work["end"][-1]  # 0.07 where ends were without the force of contact
    assert went_on(scene, tmp_path / "run.h5", stopping, [110, 12]) == 2
    assert differences(tmp_path / "whole.h5", tmp_path / "run.h5") == []
