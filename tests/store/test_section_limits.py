"""Limits of sections against the envelope of a result."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import hybrid
from hybrid.cli.tables import extremes_facts
from hybrid.scene.study import Kept
from hybrid.store.envelope import extreme, extremes_of_outputs, farthest, judged
from hybrid.store.recorder import _PIECE
from hybrid.studies.workers import collected
from hybrid.view.curves import extent
from tests.scenes import cable_scene, pinned_at


def envelope(tension: list[float]) -> dict[str, np.ndarray]:
    """An envelope of five nodes with the largest tensions, N, that are allowed 100 N at the last three."""
    values = {"s": np.arange(5.0), "max_tension": np.array([np.nan, np.nan, 100.0, 100.0, 100.0])}
    values |= {"tension_max": np.array(tension), "tension_t_max": np.arange(5.0) + 1.0}
    return {f"envelope/{name}": x for name, x in values.items()}


def test_what_stays_on_a_reel_does_not_hide_a_broken_limit() -> None:
    (found,) = judged(envelope([120.0, 110.0, 130.0, 90.0, np.nan]))
    assert found.broken and found.value == 130.0 and found.used == pytest.approx(1.3)
    assert (found.s, found.t) == (2.0, 3.0)


def test_a_limit_without_a_value_is_not_judged() -> None:
    assert judged(envelope([120.0, 110.0, np.nan, np.nan, np.nan])) == []


@pytest.mark.parametrize(("least", "over"), [
    ([5.0, 2.0, 2.0 + 1e-7, 2.0, 4.0, 9.0], (1.0, 3.0)), ([2.0, 2.0, 2.0, 2.0, 2.0, 2.0], (0.0, 5.0)),
    ([2.0, 2.0, 3.0, 4.0, 4.0, 9.0], (0.0, 1.0)), ([5.0, 2.0, 2.0 + 1e-4, 3.0, 2.0, 9.0], None),
    ([np.nan, 3.0, 2.0, 2.0, np.nan, 9.0], (2.0, 3.0)),
])  # fmt: skip
def test_an_extreme_that_is_the_same_over_a_part_of_the_line_has_that_range_as_its_place(
    least: list[float], over: tuple[float, float] | None
) -> None:
    """As the tension of what lies on a flat bed, to round-off: a millionth of the largest."""
    values = {"s": np.arange(6.0), "tension_min": np.array(least), "tension_t_min": np.zeros(6)}
    found = extreme({f"envelope/{name}": x for name, x in values.items()}, "tension", "min")
    assert found is not None and found.value == 2.0 and found.over == over


# --- outputs beyond the envelope --------------------------------------------------------------------


class Outputs(dict[str, np.ndarray]):
    """Quantities of a line whose outputs come one by one."""

    def rows_of(self, *names: str) -> Iterator[tuple[np.ndarray, ...]]:
        for k in range(len(self["t"])):
            yield tuple(self[name][k : k + 1] for name in names)


def test_extremes_of_outputs_know_both_sides_of_a_jump() -> None:
    values = Outputs(
        {
            "s": np.array([0.0, 1.0, 2.0]), "right/s": np.array([1.0]), "t": np.array([3.0, 4.0, 5.0]),
            "tension": np.array([[1.0, 2.0, 3.0], [4.0, -1.0, np.nan], [0.0, 0.0, 0.5]]),
            "right/tension": np.array([[7.0], [8.0], [-9.0]]),
            "min_tension": np.array([0.0, 0.0, 1.0]), "right/min_tension": np.array([1.0]),
        }
    )  # fmt: skip
    found = {name.removeprefix("envelope/"): x for name, x in extremes_of_outputs(values, "tension").items()}
    assert found["s"].tolist() == [0.0, 1.0, 1.0, 2.0] and found["min_tension"].tolist() == [0.0, 0.0, 1.0, 1.0]
    assert found["tension_min"].tolist() == [0.0, -1.0, -9.0, 0.5] and found["tension_max"].tolist() == [4, 2, 8, 3]
    assert found["tension_t_min"].tolist() == [5.0, 4.0, 5.0, 5.0]
    (broken,) = judged(extremes_of_outputs(values, "tension"))
    assert (broken.value, broken.allowed, broken.s, broken.t) == (-9.0, 1.0, 1.0, 5.0)


def released(**limits: float) -> dict[str, Any]:
    """A chain with a clump, let go at one end: compression runs along it, strongest inside a cell."""
    section = {"length": 40.0, "mass": 2.0, "diameter": 0.03, "axial_stiffness": 1e6, "bending_stiffness": 5.0} | limits
    end = {"kind": "pinned", "position": [30, 0, 0], "release_at": {"time": 0.3}}
    return cable_scene(
        section, pinned_at(0, 0, 0), end, attachments=[{"kind": "clump", "at": 20, "mass": 15}], model="rod", mesh=20,
        time=(1.5, 0.01), output=(0.02, 501)
    )  # fmt: skip


@pytest.mark.parametrize("kind", ["memory", "file", "resumed"])
def test_an_output_between_nodes_breaks_a_limit_that_its_envelope_keeps(tmp_path: Path, kind: str) -> None:
    """At the nodes -344 N, within a cell -347 N: a limit between both is broken, for run, report and studies."""
    plain = hybrid.run(released())
    kept, shown = float(np.nanmin(plain["envelope/tension_min"])), float(plain["tension"].min())
    assert shown < kept - 2.0, "else this tests nothing"
    scene, limit = released(min_tension=0.5 * (kept + shown)), 0.5 * (kept + shown)
    path = None if kind == "memory" else tmp_path / "run.h5"
    if kind == "resumed":  # what was recorded before counts as well
        hybrid.run(scene | {"time": scene["time"] | {"duration": 1.2}}, path).close()
        result = hybrid.resume(path, until=1.5)
    else:
        result = hybrid.run(scene, path)
    told = [event for event in result.events if event.kind == "tension below limit"]
    assert [event.value for event in told] == [shown] and told[0].threshold == limit
    found = result.utilisation()["min_tension"]
    assert found.broken and found.value == shown and found.margin == pytest.approx(shown - limit)
    (row,) = extremes_facts(result)["limits"]
    assert row["broken"] and extremes_facts(result)["tension_min"]["value"] == shown
    assert (below := farthest(result, "tension", "min")) is not None and below.value == shown
    taken = collected(result, {"tension": Kept(quantity="tension", take=["min"])})
    assert [float(x) for _, x in taken.kept.values()] == [shown]
    assert float(np.nanmin(extent(result, "tension")[1])) == shown


def test_outputs_of_a_long_run_are_read_in_pieces(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The same event whether the outputs are read at once or eleven at a time."""
    assert _PIECE >= 100_000
    monkeypatch.setattr("hybrid.store.recorder._PIECE", 11 * 501)
    result = hybrid.run(released(min_tension=-345.5), tmp_path / "run.h5")
    (told,) = [event for event in result.events if event.kind == "tension below limit"]
    assert told.value == float(result["tension"].min())
