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
from hybrid.store.envelope import extreme, extremes_of_outputs, farthest, judged, largest_contact, limits_of
from hybrid.store.limits import extreme_errors
from hybrid.store.recorder import _PIECE
from hybrid.studies.workers import collected
from hybrid.view.curves import extent
from hybrid.view.summary import facts_of
from tests.scenes import cable_scene, network_scene, pinned_at
from tests.validation.obstacle_scenes import CENTRELINE, capstan


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


# The limit of contact force of a section, against obstacles, the seabed and other lines.


PULL = 10.0  # N, along a weightless rope over a smooth drum
PRESSURE = PULL / CENTRELINE  # N/m


def over_drum(allowed: float | None, **more: Any) -> Any:
    tables = capstan(0.0, PULL) | more
    tables["time"] = {"duration": 0.1, "step": 0.01}
    tables["cable"]["sections"][0] |= {"max_contact_force": allowed} if allowed is not None else {}
    return hybrid.run(hybrid.validate_scene(tables))


@pytest.fixture(scope="module")
def pressed() -> Any:
    return over_drum(0.5 * PRESSURE)


def test_a_smooth_drum_presses_by_tension_over_radius_at_every_step(pressed: Any) -> None:
    """T/R inside the arc; where the rope leaves it, over a cell or two, more by what bending and the bed's softness ask."""
    s, most = pressed["envelope/s"], pressed["envelope/obstacle_contact_max"]
    middle = pressed.s[-1] - 0.3 - 0.5 * np.pi * CENTRELINE  # m, of the arc
    inside = np.abs(s - middle) < 0.4 * np.pi * CENTRELINE
    np.testing.assert_allclose(most[inside], PRESSURE, rtol=0.03)
    assert not most[s < 2.0].any() and PRESSURE < most.max() < 1.5 * PRESSURE
    partner, found = largest_contact(pressed) or ("", None)
    assert partner == "obstacle drum" and found is not None and found.value == most.max()


def test_a_broken_limit_says_what_presses_where_and_when(pressed: Any) -> None:
    (event,) = [x for x in pressed.events if x.kind == "contact force above limit"]
    most = pressed["envelope/obstacle_contact_max"]
    k = int(most.argmax())
    assert event.value == most[k] and event.threshold == pytest.approx(0.5 * PRESSURE)
    assert (event.s_a, event.t) == (pressed["envelope/s"][k], pressed["envelope/obstacle_contact_t_max"][k])
    assert "contact force of an obstacle" in event.text and "above the" in event.text
    judged = pressed.utilisation()["max_contact_force"]
    assert judged.broken and judged.used == pytest.approx(most[k] / (0.5 * PRESSURE))
    facts = extremes_facts(pressed)
    assert (
        facts["contact_max"]["value"] == most[k]
        and facts["contact_max"]["partner"] == judged.partner == "obstacle drum"
    )
    assert any(fact.key == "obstacles" and fact.values["force"] == most[k] for fact in facts_of(pressed))


def test_a_limit_that_holds_is_not_verified_because_its_error_is_not_known() -> None:
    found = over_drum(2.0 * PRESSURE).utilisation()["max_contact_force"]
    assert not found.broken and found.verdict == "not verified" and "not estimated" in found.why


@pytest.mark.long
@pytest.mark.parametrize(("part", "verdict"), [(2.0, "within"), (1.04, "not verified")])
def test_a_limit_holds_where_its_error_over_all_steps_leaves_room(part: float, verdict: str) -> None:
    """The force where the rope leaves the drum, 1.01 T/R, known to some per cent by cells of twice and four times."""
    result = over_drum(part * PRESSURE, output={"errors": True})
    found, error = result.utilisation()["max_contact_force"], extreme_errors(result)["max_contact_force"]
    assert found.verdict == verdict and not found.broken
    assert 0.005 < error < 0.1 and (found.value / found.allowed + error <= 1.0) == (verdict == "within")


def test_a_limit_changes_nothing_that_is_computed(pressed: Any) -> None:
    assert np.array_equal(over_drum(None).position, pressed.position)


def test_the_limit_is_of_all_that_touches() -> None:
    """The worst of what presses, each in its own envelope."""
    values = {"s": np.arange(3.0), "max_contact_force": np.full(3, 10.0)}
    for name, x in (
        ("contact", [1.0, 2.0, 3.0]),
        ("self_contact", [0.0, 12.0, 0.0]),
        ("obstacle_contact", [8.0, 0, 0]),
    ):
        values |= {f"{name}_max": np.array(x), f"{name}_t_max": np.full(3, 4.0)}
    (found,) = limits_of(None, {f"envelope/{name}": x for name, x in values.items()})
    assert (found.limit, found.value, found.s, found.t, found.broken) == ("max_contact_force", 12.0, 1.0, 4.0, True)
    assert found.partner == "the line itself or another" and found.used == pytest.approx(1.2)


def test_a_line_at_rest_on_the_bed_is_held_against_it() -> None:
    """A chain that lies on the bed bears its weight per length there."""
    section = {"length": 120.0, "mass": 10.0, "diameter": 0.05, "axial_stiffness": 1e7, "max_contact_force": 50.0}
    scene = cable_scene(section, pinned_at(0, 0, 0), pinned_at(95, 0, 40), seabed={"z": 0.0, "stiffness": 1e4}, mesh=60)
    result = hybrid.static(hybrid.validate_scene(scene))
    (event,) = [x for x in result.events if x.kind == "contact force above limit"]
    assert "of the seabed" in event.text and 0.98 * 98.1 < event.value < 1.3 * 98.1


def crossing() -> dict[str, Any]:
    """Two taut ropes without weight that cross, one drawn over the other; output points beside the place."""
    section = {"length": 2.0, "mass": 0.5, "diameter": 0.03, "axial_stiffness": 1e4, "bending_stiffness": 0.1}
    section |= {"max_contact_force": 100.0}
    rope = {"sections": [section], "mesh": {"cells": 20}}
    over, under = [[0, -1, -0.3], [0, 0, 0.05], [0, 1, -0.3]], [[-1, 0, 0], [0, 0, -0.05], [1, 0, 0]]
    return network_scene(
        {f"{name}{k}": {"position": x[-k]} for name, x in (("a", under), ("b", over)) for k in (0, 1)},
        {"a": {"start": "a0", "end": "a1", "initial": {"points": under}} | rope,
         "b": {"start": "b0", "end": "b1", "initial": {"points": over}} | rope},
        gravity=0, contact={}, output={"points": 4}, time=(0.005, 0.005)
    )  # fmt: skip


def test_an_equilibrium_of_crossing_lines_is_judged_at_its_nodes_as_a_run_is() -> None:
    """The ropes press where no output point is: `static` and the first step of `run` name one force and one place."""
    rest, moving = (each.lines["a"] for each in (hybrid.static(crossing()), hybrid.run(crossing())))
    found, of_run = (x.utilisation()["max_contact_force"] for x in (rest, moving))
    assert found.broken and found.s == of_run.s == 1.0 and found.partner == of_run.partner == "line b"
    assert found.value == pytest.approx(of_run.value, rel=1e-3) and found.value > 5.0 * rest["self_contact"].max()
    (event,) = [x for x in rest.events if x.kind == "contact force above limit"]
    assert (event.value, event.s_a) == (found.value, 1.0)
