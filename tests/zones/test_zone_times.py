"""Times, shares and first zones of the domain manager, each constant with the number that it has."""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from problems import Scene, pinned, scene

from hybrid.errors import Outcome
from hybrid.kernels.mesh.cell_errors import CURVATURE
from hybrid.kernels.mesh.zone_criteria import BEND
from hybrid.kernels.state.state import state_for
from hybrid.model.build import Model, build
from hybrid.model.resolution import first_resolution
from hybrid.scene.read import one_line
from hybrid.scene.schema import LineScene
from hybrid.simulation import run_zones, zones_at_rest
from hybrid.solve.stepper import NetworkTaken
from hybrid.zones.change import ZoneSwitching, manager_for, on_layout, rods_at_winch
from hybrid.zones.manager import DomainManager, shares_asked


def line(period: float = 0.0, step: float = 0.001, **model: Any) -> tuple[LineScene, Model]:
    """10 m between two pins, of which one heaves with a period (s), if any."""
    motion = {"motion": {"heave": {"amplitude": 0.1, "period": period}, "ramp": 1.0}} if period else {}
    section = {"length": 10.0, "mass": 1.0, "bending_stiffness": 1.0, "axial_stiffness": 1e5}
    found = scene(
        section, pinned(), pinned(9.0, 0, 0) | motion, cells=20, time={"duration": 10 * step, "step": step}, output={"every": 10 * step}
    ).model_dump(exclude_none=True)  # fmt: skip
    found["model"] = {"kind": "adaptive"} | model
    whole = one_line(Scene.model_validate(found))
    return whole, build(whole)


def managed(period: float = 0.0, step: float = 0.001, rods: Any = (), **model: Any) -> tuple[Model, DomainManager]:
    """The model, and its domain manager; rods: what a pre-run foresees."""
    whole, built = line(period, step, **model)
    return built, manager_for(whole, built, replace(first_resolution(whole), rods=rods), None)


def times(found: DomainManager) -> tuple[float, float, float, float]:
    """Hold and ramp time, s, for how long an edge is foreseen, and for how long the largest values count."""
    return found.dwell, found.ramp_time, float(found.zones.clock.edge_time), float(found.zones.clock.memory)


def test_times_of_a_line_without_periods() -> None:
    """A quarter of the time of a wave, and twenty steps at least; ten of these count for the largest values."""
    built, found = managed()
    wave = 0.25 * built.time_scale
    assert times(found) == pytest.approx((wave, wave, wave, 10.0 * wave))
    built, found = managed(step=wave)
    assert times(found)[:2] == pytest.approx((20.0 * wave, 20.0 * wave))


@pytest.mark.parametrize("period", [12.5, 75.0, 500.0])
def test_times_of_a_line_that_moves_to_and_fro(period: float) -> None:
    """Rods stay for two periods, for ten ramp times at most; edges are foreseen for a quarter of a period."""
    built, found = managed(period=period)
    ramp = 0.25 * built.time_scale
    expected = max(ramp, min(2.0 * period, 10.0 * ramp)), ramp, min(ramp, 0.25 * period), 10.0 * max(ramp, period)
    assert times(found) == pytest.approx(expected)


def test_a_hold_time_that_is_asked_for_is_kept_and_the_ramp_goes_with_it() -> None:
    """No slower than twice the ramp of its own, no faster than ten steps."""
    built, _ = managed()
    ramp = 0.25 * built.time_scale
    for hold, expected in ((50.0 * ramp, 2.0 * ramp), (1e-6, 10 * 0.001), (1.5 * ramp, 1.5 * ramp)):
        _, found = managed(hold_time=hold)
        assert times(found)[:2] == pytest.approx((hold, expected))


def test_rods_whose_cells_follow_are_never_let_go_unless_that_is_asked() -> None:
    built, found = managed(curvature_error=0.03, period=20.0)
    ramp = 0.25 * built.time_scale
    assert times(found) == pytest.approx((math.inf, ramp, ramp, 10.0 * ramp))  # periods do not count
    assert managed(curvature_error=0.03, hold_time=3.0)[1].dwell == 3.0


def test_steps_while_bending_comes_and_goes() -> None:
    """A tenth of the ramp time; twice that before; lengths are let go within a ramp time."""
    built, found = managed()
    run: Any = SimpleNamespace(resolution=SimpleNamespace(one=SimpleNamespace(every=1)))
    clock = run_zones._LineZones(run, 0, built, found).switching.zones.clock
    assert clock.ramp_step == pytest.approx(0.1 * found.ramp_time)
    assert clock.steady_step == pytest.approx(0.2 * found.ramp_time)
    assert clock.letting_go == pytest.approx(found.ramp_time)


def test_what_a_pre_run_foresees_is_kept_by_base_cells() -> None:
    built, found = managed(rods=((2.1, 3.2, 1.7), (3.0, 4.0, 3.0)))
    assert built.layout is not None
    assert np.diff(built.layout.base) == pytest.approx(0.5)
    assert found.foreseen.tolist() == [0.0] * 4 + [1.7, 1.7, 3.0, 3.0] + [0.0] * 12, "the larger one where both are"


def test_shares_along_the_line() -> None:
    """A quarter of what is asked of limits of bending; a curvature error that is smaller stands."""
    whole, _ = line()
    assert shares_asked(whole, None) == {}
    assert shares_asked(whole, None, 0.08) == {CURVATURE: pytest.approx(0.02)}
    assert shares_asked(whole, None, 0.11) == {}, "rougher than can be asked"
    assert shares_asked(whole, 0.01, 0.08) == {CURVATURE: 0.01}


def test_rods_are_made_for_two_ramp_times_ahead_of_a_winch() -> None:
    whole, built = line()
    asked = []

    def at_winch(count: int, ahead: float) -> Any:
        asked.append((count, ahead))
        return np.arange(20) >= 17

    given = rods_at_winch(whole, SimpleNamespace(at_winch=at_winch), built, 7, 3.0, -0.5)  # type: ignore[arg-type]
    assert asked == [(7, 3.0)], "2 x 3 s x 0.5 m/s"
    assert given.tolist() == [0] * 17 + [1] * 3


# --- zones of the equilibrium -------------------------------------------------------------------------


def sought(monkeypatch: pytest.MonkeyPatch, apart: float) -> tuple[list[float], DomainManager, Any]:
    """Tolerances (m) at which zones are sought that are so far (m) from the rods, and what comes of it."""
    built, found = managed()
    found.zones.clock.tolerance, asked = 1.0, []

    def within(*_: Any) -> Any:
        asked.append(found.zones.clock.tolerance)
        return "zones", "rest"

    monkeypatch.setattr(zones_at_rest, "_within", within)
    monkeypatch.setattr(zones_at_rest, "_apart", lambda *_: apart)
    rods = SimpleNamespace(models=[built])
    answer = zones_at_rest._zones_at_rest(rods, "rods at rest", {0: found}, 0.0)  # type: ignore[arg-type]
    return asked, found, answer


def test_zones_that_are_far_from_the_rods_are_sought_with_stricter_criteria(monkeypatch: pytest.MonkeyPatch) -> None:
    """At the tolerance, a half and a quarter of it; then zones stay rod."""
    asked, found, answer = sought(monkeypatch, apart=1.01)
    assert asked == [1.0, 0.5, 0.25]
    assert answer[1] == "rods at rest" and found.held and found.zones.clock.tolerance == 1.0


def test_zones_that_are_near_the_rods_are_taken_as_they_are(monkeypatch: pytest.MonkeyPatch) -> None:
    asked, found, answer = sought(monkeypatch, apart=0.99)
    assert asked == [1.0] and answer == ("zones", "rest") and not found.held


def test_rounds_of_zones_and_equilibrium_only_add_rod_and_end(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each asks for one more cell, and no longer for the last: all that were asked for stay; after ten it is all rod."""
    built, found = managed()
    made: list[Any] = []

    def with_rods(model: Any, rest: Any, rods: Any, t: float) -> Any:
        made.append(rods[0].copy())
        return model, rest

    monkeypatch.setattr(zones_at_rest, "_with_rods", with_rods)
    monkeypatch.setattr(found, "set_layout", lambda _: None)
    monkeypatch.setattr(zones_at_rest, "_asked", lambda *_: {0: np.arange(20) == len(made)})
    model = SimpleNamespace(models=[built])
    assert zones_at_rest._within(model, None, {0: found}, 0.0) is None  # type: ignore[arg-type]
    assert [int(x.sum()) for x in made] == list(range(1, 11))


# --- steps that fail ----------------------------------------------------------------------------------


def rescued(outcome: Outcome, rescues: int, slack: int = -1) -> list[int]:
    """Base cells that become rod after a try of a catenary, of which cell 10 is far above a threshold; slack: a cell."""
    built, found = managed()
    assert built.layout is not None
    model = on_layout(built, built.layout._replace(rod=np.zeros(built.layout.rod.size, bool)))
    assert model.layout is not None
    found.set_layout(model.layout)
    found.ratios[BEND, 10], found.zones.clock.highest_ratio, tried = 5.0, 5.0, state_for(model.line)
    tried.T[:] = model.slack_floor + 1.0
    if slack >= 0:
        tried.T[slack] = model.slack_floor
    switching = ZoneSwitching(model, found)
    change = switching.rescue(NetworkTaken(outcome, 5, 1.0, 0, 11, 0.0), 1.0, tried, rescues)
    return [] if change is None else np.flatnonzero(change.rod).tolist()


def test_a_step_that_leaves_a_catenary_far_beyond_a_threshold_is_repeated_with_rods_twenty_times() -> None:
    assert rescued(Outcome.OK, 0) == rescued(Outcome.OK, 19) == [9, 10, 11]
    assert rescued(Outcome.OK, 20) == []


def test_a_step_that_leaves_a_catenary_without_tension_is_repeated_with_rods_there() -> None:
    assert rescued(Outcome.SLACK, 19, slack=4) == [3, 4, 5]
    assert rescued(Outcome.SLACK, 0) == []


def test_a_step_that_fails_beside_a_cell_near_its_threshold_is_repeated_once_with_more_rod() -> None:
    assert rescued(Outcome.NOT_CONVERGED, 0) == [9, 10, 11]
    assert rescued(Outcome.NOT_CONVERGED, 1) == []
