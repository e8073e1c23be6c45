"""A fatigue life with the errors of what it rests on: ranges that are off by a part change it by that to the slope."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from hybrid.statistics.fatigue import damage
from hybrid.store import statistics_table

CURVE = {"kind": "S-N", "log_a": 12.0, "m": 3.0}
T, S = np.linspace(0.0, 100.0, 2001), np.array([0.0, 5.0, 10.0])
SECTION = (1e-3, 0.1, 2e11)
HISTORY = SimpleNamespace(t=T, values=1e4 + np.sin(2 * np.pi * T / 10.0)[:, None])


class Seen:
    """A result whose curvature swings by 1e-3 1/m at 5 m, known to `error`; its tension is steady."""

    times, s = T, S

    def __init__(self, error: float) -> None:
        swing = np.sin(2 * np.pi * T / 10.0)[:, None] * np.array([0.1, 1.0, 0.2]) * 1e-3
        self._values: dict[str, Any] = {
            "curvature": swing, "tension": 1e4 + 1e-6 * swing, "errors/total/tension": 0.0 * swing,
            "errors/total/curvature": np.full(swing.shape, error),
        }  # fmt: skip

    def __contains__(self, name: str) -> bool:
        return name in self._values

    def __getitem__(self, name: str) -> Any:
        return self._values[name]

    def damage(self, curve: Any, *, strength: Any, section: Any, times: Any, at: Any) -> Any:
        """Of bending stresses alone, in MPa."""
        k = [int(np.abs(S - x).argmin()) for x in at]
        return np.array(at), damage(self["curvature"][:, k], curve, section[2] * section[1] / 2.0 / 1e6)


def within(error: float, monkeypatch: pytest.MonkeyPatch) -> tuple[dict[str, Any], float]:
    monkeypatch.setattr(statistics_table, "history_of", lambda *_: HISTORY)
    seen: Any = Seen(error)
    done = float(seen.damage(CURVE, strength=None, section=SECTION, times=None, at=[5.0])[1][0])
    facts = {"s": 5.0, "damage": done, "life": 2.0}
    return statistics_table.life_within(seen, facts, CURVE, None, SECTION, None), done


@pytest.mark.needs("rainflow")
def test_ranges_that_are_off_change_the_life_by_their_third_power(monkeypatch: pytest.MonkeyPatch) -> None:
    part = 0.1
    found, done = within(part * 1e-3 / np.sqrt(2.0), monkeypatch)
    assert done > 0.0
    assert found["life_least"] == pytest.approx(2.0 / (1.0 + part) ** 3, rel=1e-3)
    assert found["life_most"] == pytest.approx(2.0 / (1.0 - part) ** 3, rel=1e-3)


@pytest.mark.needs("rainflow")
def test_an_error_as_large_as_what_varies_leaves_no_life(monkeypatch: pytest.MonkeyPatch) -> None:
    found, _ = within(1e-3, monkeypatch)
    assert found["life"] is None and "smaller accuracy of curvature" in found["life_not_verified"]


def test_an_error_of_a_tension_that_hardly_varies_counts_by_its_stress(monkeypatch: pytest.MonkeyPatch) -> None:
    """10 N on 1e-3 m^2 are 0.01 MPa, where bending swings by 7 MPa in the root mean square."""
    monkeypatch.setattr(statistics_table, "history_of", lambda *_: HISTORY)
    seen: Any = Seen(0.0)
    seen._values["errors/total/tension"] = np.full((T.size, S.size), 10.0)
    swing = 0.5 * SECTION[2] * SECTION[1] * 1e-3 / np.sqrt(2.0)
    part = statistics_table.part_off(seen, 5.0, None, SECTION)
    assert part == pytest.approx(10.0 / SECTION[0] / swing, rel=1e-3) and part < 0.01
    assert statistics_table.part_off(seen, 5.0, None, None) > 1.0  # of tension alone nothing is known


def test_outputs_that_miss_crests_leave_no_life(monkeypatch: pytest.MonkeyPatch) -> None:
    """A sine with so many outputs to a period."""
    for n, doubted in ((2.7, True), (5.3, True), (6.7, False), (20.0, False)):
        t = np.arange(0.0, 1000.0, 10.0 / n)
        history = SimpleNamespace(t=t, values=1e4 + np.sin(2 * np.pi * t / 10.0)[:, None])
        monkeypatch.setattr(statistics_table, "history_of", lambda *_, history=history: history)
        seen: Any = Seen(0.0)
        why = statistics_table.too_far_apart(seen, 5.0, None)
        assert bool(why) is doubted
        if doubted:
            facts = {"s": 5.0, "damage": 1e-6, "life": 2.0}
            found = statistics_table.life_within(seen, facts, CURVE, None, SECTION, None)
            assert found == {"life": None, "life_not_verified": why}
            assert f"{n:.2g} outputs to a cycle" in why and why.endswith("output.every: 1")
