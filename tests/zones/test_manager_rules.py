"""Rules of the domain manager one by one, without a run: waiting times, what is foreseen, failed steps, torque."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from adapt_cases import Rules, along, cable, even, on, planned, state_on
from problems import pinned, scene

from hybrid.kernels.junctions.joined_lines import TURNS
from hybrid.kernels.mesh.cell_errors import CURVATURE
from hybrid.kernels.mesh.zone_criteria import BEND, CRITERIA, GIVEN, SLACK, TORSION
from hybrid.kernels.mesh.zone_step import REJECT_RATIO
from hybrid.model.build import build
from hybrid.model.mesh import Layout
from hybrid.model.resolution import first_resolution
from hybrid.scene.analysis import AdaptiveModel
from hybrid.scene.read import one_line
from hybrid.simulation.zones_at_rest import managers_for
from hybrid.zones.manager import Allowed, Change, DomainManager, Times

HOLD = 2.0  # s


def manager(rod: str, given: Any = None, **times: Any) -> DomainManager:
    """Of ten base cells of 1 m."""
    zones = np.zeros(len(rod), int) if given is None else np.asarray(given)
    return DomainManager(cable(), even(len(rod), rod), zones, 1.0, Allowed(0.01), Times(HOLD, **times))


def becomes(found: DomainManager, rod: str, t: float, urgent: bool = False) -> None:
    """Cells become what `rod` says at t (s)."""
    new = np.array([x == "R" for x in rod])
    found.adopt_rods(new, Change(new, (), np.full(new.size, urgent), np.zeros_like(new)), t)
    found.layout = Layout(found.layout.base, found.layout.parts, new)


def test_a_rod_that_comes_back_soon_waits_longer_and_a_later_one_half_as_long_again() -> None:
    """Let go at 0 s and back 4 s later, within four holds: eight holds; then half of it each time, one at least."""
    found, waits = manager("RRRR"), []
    becomes(found, "RCCR", 0.0)
    becomes(found, "RRCR", 4.0)
    waits.append(found.wait_factor.tolist())
    t = 4.0
    for _ in range(5):
        becomes(found, "RCCR", t)
        t += 1000.0  # much later than four holds, eight times as long
        becomes(found, "RRCR", t)
        waits.append(found.wait_factor.tolist())
    assert [x[1] for x in waits] == [8.0, 4.0, 2.0, 1.0, 1.0, 1.0]
    assert all(x[0] == x[2] == x[3] == 1.0 for x in waits), "of those that did not come back nothing changes"


@pytest.mark.parametrize(("after", "wait"), [(7.9, 8.0), (8.1, 1.0)])
def test_soon_is_within_four_holds(after: float, wait: float) -> None:
    found = manager("RRRR")
    becomes(found, "RCCR", 100.0)
    becomes(found, "RRRR", 100.0 + after)
    assert found.wait_factor.tolist() == [1.0, wait, wait, 1.0]


def test_what_becomes_rod_begins_without_stiffness_and_faster_where_it_is_urgent() -> None:
    for urgent, speed in ((False, 1.0), (True, 16.0)):
        found = manager("RCCC")
        becomes(found, "RRCC", 1.0, urgent)
        assert found.grown.tolist()[:2] == [1.0, 0.0] and found.zones.ramp_factor[1] == speed
        assert np.isinf(found.below_since[1]) and not found.leaving.any()


def test_a_rod_begins_with_a_thousandth_of_its_stiffness() -> None:
    """With none its cells could spin freely; more of it would be there at once."""
    found = manager("RRRR")
    found.grown[1:3] = 0.0
    assert set(found.stiffness_shares().tolist()) == {1.0, 1e-3}


def test_what_a_pre_run_foresees_begins_as_rod() -> None:
    """Ratios are all 0: cells 4 and 5 will lack twice what is allowed; without that there are none."""
    found = manager("CCCCCCCCCC")
    line = on(found.cable, found.layout)
    state = state_on(line, along(), tension=1e6)
    assert not found.initial_rods(state).any()
    found.foreseen[4:6] = 2.0
    rods = found.initial_rods(state)
    assert rods[4:6].all() and not rods[[0, 1, 8, 9]].any()
    assert found.first[BEND].tolist() == [0.0] * 4 + [2.0] * 2 + [0.0] * 4


def test_after_a_failed_step_its_cell_and_its_neighbours_become_rod() -> None:
    given = [0, 0, 0, 0, 0, 0, 0, -1, 0, 0]
    found = manager("CCCCCCCCCC", given)
    for cell, rods in ((3, [2, 3, 4]), (0, [0, 1]), (9, [8, 9]), (6, [5, 6])):  # cell 7 is catenary, whatever happens
        change = found.force_rods(np.array([cell]), "a step failed")
        assert np.flatnonzero(change.rod).tolist() == rods
        assert {x.kind for x in change.reasons} == {"retry"} and change.urgent[rods].all()


def test_a_rod_that_is_blended_in_gets_all_of_its_stiffness_after_a_failed_step() -> None:
    found = manager("CRRRCCCCCC")
    found.grown[2] = 0.3
    change = found.force_rods(np.flatnonzero(found.base_of_cell == 2)[:1], "a step failed")
    assert np.flatnonzero(change.stiff).tolist() == [2]
    assert any("all of its stiffness" in x.text for x in change.reasons)


@pytest.mark.parametrize("first", [True, False])
@pytest.mark.parametrize("why", ["twisted", "loaded", ""])
def test_torque_asks_for_rods_from_end_to_end(why: str, first: bool) -> None:
    """A torsion ratio of 3 in one cell is one of all, where both ends hold the twist or a moment is given."""
    found = manager("CCCCCCCCCC", [0, 0, 0, 0, 0, 0, 0, 0, 0, 1])
    found.zones.counts.holds_twist = why == "twisted"
    if why == "loaded":
        found.load(np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]]))
    found.ratios[TORSION, 2] = 3.0
    if first:
        found.initial_rods(state_on(on(found.cable, found.layout), along(), 1e6))
    else:
        review_of(found)
    others = 3.0 if why else 0.0
    assert found.seen[TORSION].tolist() == [others] * 2 + [3.0] + [others] * 7
    assert 1.0 < found.seen[GIVEN, 9] < REJECT_RATIO and not found.seen[GIVEN, :9].any()


def test_only_catenaries_that_are_far_above_a_threshold_reject_a_step() -> None:
    found = manager("RCCCCCCCCC", [0, 0, -1, 0, 0, 0, 0, 0, 0, 0])
    found.ratios[BEND, :4] = 1e3  # a rod, a catenary, one that is given as catenary, a catenary
    assert np.unique(found.base_of_cell[found.cells_to_reject]).tolist() == [1, 3]


def test_only_cells_above_the_limit_at_which_they_let_go_may_help_a_step_that_failed_beside_them() -> None:
    """A bend at 0.3 (it lets go at 0.25) beside the cell that failed or in it, and not two cells away."""
    found = manager("CCCCCCCCCC")
    found.ratios[BEND, 4], found.ratios[BEND, 7] = 0.3, 0.2
    for base, near in ((3, [4]), (4, [4]), (5, [4]), (6, []), (7, [])):
        cells = found.cells_near_threshold(int(np.flatnonzero(found.base_of_cell == base)[0]))
        assert np.unique(found.base_of_cell[cells]).tolist() == near, base


def test_rods_are_two_lengths_of_bending_wider_than_what_asks() -> None:
    """Twice sqrt(EI/T), or (EI/w)^(1/3) where that is shorter; two cells where results must show a bend at a joint."""
    found = manager("CCCCCCCCCC")
    line = on(found.cable, found.layout)
    assert found.buffers(state_on(line, along(), tension=50.0)) == pytest.approx(2.0 * np.sqrt(2.0 / 50.0))
    assert found.buffers(state_on(line, along(), tension=2.0)) == pytest.approx(2.0 * (2.0 / 10.0) ** (1.0 / 3.0))
    allowed = Allowed(0.01, asked={CURVATURE: 0.05})
    found = DomainManager(cable(), even(10, "C" * 10), np.zeros(10, int), 1.0, allowed, Times(HOLD))
    assert (found.buffers(state_on(line, along(), tension=50.0)) >= 1.0).all()


def test_a_rod_on_its_way_out_comes_back_above_half_of_what_makes_a_rod() -> None:
    ratios, rod = np.zeros((len(CRITERIA), 10)), np.ones(10, bool)
    ratios[BEND] = np.where(np.arange(10) < 5, 0.55, 0.45)
    rules = Rules(np.zeros(10), 2, HOLD)
    stays, _ = planned(ratios, rod, np.full(10, -100.0), 0.0, np.arange(11.0), rules, leaving=True)
    assert stays.tolist() == [True] * 5 + [False] * 5


def test_the_user_speaks_for_catenaries_that_may_be_rods() -> None:
    for rod, given, highest_ratio in (("C" * 10, 0, 3.0), ("R" * 10, 0, 0.0), ("C" * 10, -1, 0.0)):
        zones = np.full(10, given)
        found = DomainManager(
            cable(), even(10, rod), zones, 1.0, Allowed(0.01), Times(HOLD), lambda nodes: np.full(nodes.s.size, 3.0)
        )
        line = on(found.cable, found.layout)
        found.ask_user(line, state_on(line, along(), tension=1e6), 0.0)
        assert found.zones.clock.highest_ratio == highest_ratio


def test_a_mask_of_the_user_asks_for_rods_and_repeats_no_step() -> None:
    found = DomainManager(
        cable(), even(10, "C" * 10), np.zeros(10, int), 1.0, Allowed(0.01), Times(HOLD), lambda nodes: nodes.s >= 0.0
    )
    line = on(found.cable, found.layout)
    found.ask_user(line, state_on(line, along(), tension=1e6), 0.0)
    assert 1.0 < found.zones.clock.highest_ratio < REJECT_RATIO


def test_a_joint_is_passed_where_a_rod_grows_and_not_where_one_appears() -> None:
    found = manager("RRCCCCCCCC")
    for new, place in (("RRRCCCCCCC", 2.0), ("RRCCCRRCCC", None)):
        rod = np.array([x == "R" for x in new])
        change = Change(rod, tuple(found._reasons(found.layout.rod, rod)), np.zeros(10, bool), np.zeros(10, bool))
        assert found.joint_passed(change) == place


def test_lines_stay_rod_at_clamps_to_what_turns() -> None:
    short = scene({"length": 10.0, "mass": 1.0, "bending_stiffness": 1.0}, pinned(), pinned(9.0, 0, 0), cells=10)
    what = replace(one_line(short), model=AdaptiveModel(kind="adaptive"))
    built, seats = build(what), np.zeros((1, 2, TURNS + 1))
    seats[0, 1, TURNS] = 1.0
    resolution = SimpleNamespace(lines={"a": first_resolution(what)})
    network: Any = SimpleNamespace(names=("a",), models=(built,), resolution=resolution, seats=seats)
    assert managers_for({"a": what}, network, None)[0].given.tolist() == [0] * 9 + [1]


# --- reviews ------------------------------------------------------------------------------------------


def review_of(found: DomainManager, t: float = 0.0, tension: float = 1e6) -> Change | None:
    """A review at t (s) of the ratios that it has, under an even tension (N)."""
    return found.review(t, state_on(on(found.cable, found.layout), along(), tension))


def test_zones_that_are_held_let_no_rod_go_and_what_is_given_as_catenary_becomes_none() -> None:
    for held in (True, False):
        found = manager("RRRRCCCCCC", [0] * 7 + [-1] * 3)
        found.held, found.below_since[:] = held, -100.0
        found.ratios[BEND, 8] = 2.0
        change = review_of(found)
        assert change is None or not change.rod[7:].any()
        assert found.leaving.any() == (not held)


def test_rods_go_when_they_have_no_stiffness_left_and_the_next_review_is_when_one_may_have_gone() -> None:
    found = manager("RRRRCCCCCC", ramp=1.0)
    found.below_since[:] = -100.0
    found.leaving[:4], found.grown[:4] = True, 0.1
    assert review_of(found) is None and found.zones.clock.next_review == pytest.approx(0.1)
    found.grown[:4], found.below_since[:] = 0.0, -100.0
    change = review_of(found)
    assert change is not None and not change.rod.any()


def test_without_anything_to_do_there_are_four_reviews_in_a_ramp_time() -> None:
    """A little earlier, lest round-off puts one off by a step."""
    found = manager("C" * 10)
    assert review_of(found) is None
    assert 0.25 * HOLD * (1.0 - 1e-6) < found.zones.clock.next_review < 0.25 * HOLD


@pytest.mark.parametrize("wait", [1.0, 8.0])
@pytest.mark.parametrize("twisted", [True, False])
def test_rods_go_that_were_calm_for_long_enough_and_with_a_torque_none_is(twisted: bool, wait: float) -> None:
    """Rods at both ends and in the middle, of which some are loud; all were calm for 5 s, and are to be for 2 or 16."""
    found = manager("RRCCRRCCRR")
    found.below_since[:], found.wait_factor[:], found.zones.counts.holds_twist = -5.0, wait, twisted
    found.ratios[BEND, 1] = found.ratios[TORSION, 4] = 0.95
    assert review_of(found) is None and not found.ratios.any() and found.seen[BEND, 1] == 0.95
    assert np.isinf(found.below_since[8:]).all() == twisted
    assert found.leaving[8:].all() == found.zones.counts.going == (not twisted and wait == 1.0)
    assert not found.leaving[:2].any()


def test_rods_are_urgent_where_a_line_is_slack_and_not_where_it_bends() -> None:
    found = manager("CCCCCCCCCC")
    found.ratios[SLACK, 2], found.ratios[BEND, 7] = 1.5, 1.5
    change = review_of(found)
    assert change is not None and change.rod[[2, 7]].all()
    assert change.urgent[2] and not change.urgent[7]


@pytest.mark.parametrize(
    ("before", "weightless", "urgent"), [(86.0, True, True), (84.0, True, False), (86.0, False, False)]
)
def test_rods_are_urgent_where_a_line_without_weight_loses_tension(
    before: float, weightless: bool, urgent: bool
) -> None:
    """From `before` (N) a ramp time ago to 50 now: 14 in a ramp time are less than 0.3 of that, 16 are not."""
    floor = float(manager("C" * 10).floor.max())  # N, of 10 N/m: without weight where it is below 1e-3 of the scale
    scale = 1e3 * floor * (1.01 if weightless else 0.99)
    found = DomainManager(cable(), even(10, "C" * 10), np.zeros(10, int), scale, Allowed(0.01), Times(HOLD))
    found.zones.past[:], found.zones.counts.known, found.zones.clock.age = before, 1, HOLD
    found.ratios[BEND, 7] = 1.5
    change = review_of(found, tension=50.0)
    assert change is not None and change.urgent[7] == urgent
