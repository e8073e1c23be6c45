"""Thresholds that hardly any scene comes near: what is just below each, and just above."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

import hybrid
from hybrid.accuracy.error_estimate import Estimate
from hybrid.accuracy.free_vibrations import Lost, uncertain_by_vibrations
from hybrid.accuracy.model_choice import rods_instead_of_slack
from hybrid.accuracy.refinement import Free, Verdict, refined
from hybrid.errors import ComputationError, Outcome
from hybrid.model.bodies import untwisted
from hybrid.model.build import build
from hybrid.model.initial_shape import reasons_against
from hybrid.model.plan import no_catenary
from hybrid.model.resolution import RequestedAccuracy, Resolution
from hybrid.scene.read import as_scene, one_line
from hybrid.simulation.equilibrium import _nearer
from hybrid.simulation.lone_planes import LonePlane
from hybrid.simulation.run_sample import RunSample, undersampled_end_forces
from tests.said import kinds
from tests.scenes import cable_scene, line_between, network_scene, pinned_at, system_of

COARSE = Resolution(1.0, 0.1, 1e-3, 1e-3)
SECTION = {"length": 100.0, "mass": 2.0, "diameter": 0.03, "axial_stiffness": 1e6}


# --- accuracy ---


@pytest.mark.parametrize(("after", "others"), [(0.54, False), (0.56, True), (0.44, True)])
def test_zones_are_others_from_a_tenth_of_catenaries_or_rods_on(after: float, others: bool) -> None:
    now, then = np.array([0.5, 0.5]), np.array([0.5, after])
    known = SimpleNamespace(
        run=SimpleNamespace(catenary=now, cells=100), _model_of=(100, 1, then), _model=True, notes=()
    )
    assert Estimate.differs_in_zones(known, SimpleNamespace(catenary=then)) == others  # type: ignore[arg-type]
    assert Estimate.lacks_model_errors(known) == others  # type: ignore[arg-type]


@pytest.mark.parametrize(("name", "error", "said"), [("tension", 0.8, False), ("tension", 1.2, True),
                                                     ("position", 0.4, False), ("position", 0.6, True)])  # fmt: skip
def test_a_vibration_that_steps_lose_is_worth_a_word_from_a_hundredth_on(name: str, error: float, said: bool) -> None:
    """Of the largest tension, 100 N, and of the length, 50 m, where nothing is asked."""
    forces = np.column_stack([np.linspace(0.1, 1.0, 10)] * 3)
    run = RunSample(COARSE, {name: np.full((2, 3), 100.0)}, 10, 10, 0.0, forces=forces)
    found = uncertain_by_vibrations({name: Lost(error, 1.0, 0.5, 0.01)}, run, {name: 1e-3}, None, 50.0)
    assert bool(found) == said


def test_a_run_is_three_times_as_fine_at_most_and_a_little_finer_where_only_the_sum_is_missed() -> None:
    free = Free(True, True, False)
    finest = refined(COARSE, Verdict(200.0, 100.0, 100.0, 0.0, ""), free)
    assert finest is not None and (finest.fineness, finest.step) == pytest.approx((3.0, 0.1 / 3.0))
    cells, steps = (refined(COARSE, Verdict(1.1, *x, 0.0, ""), free) for x in ((0.3, 0.2), (0.2, 0.3)))
    assert cells is not None and (cells.fineness, cells.step) == pytest.approx((1.25, 0.1))
    assert steps is not None and (steps.fineness, steps.step) == pytest.approx((1.0, 0.08))


def test_what_inertia_leaves_of_round_off_is_a_thousandth_of_the_force_at_most() -> None:
    """In steps of 1 ns it would be 1e6 N: a step whose Newton leaves more does not converge."""
    asked = RequestedAccuracy(None, None, 0.05, force=25.0, length=10.0, stiffness=1e7, mass=50.0)
    assert asked.round_off("N", 1e-9) == pytest.approx(0.025)


@pytest.mark.parametrize(("began", "shaken"), [(0.74, True), (0.70, False), (0.95, False)])
def test_a_shake_within_two_outputs_of_a_change_of_zones_is_laid_to_it(began: float, shaken: bool) -> None:
    outputs, t = np.linspace(0.0, 2.0, 21), np.linspace(0.0, 2.0, 201)
    force = np.where(np.isclose(t, 0.92), 150.0, 100.0)
    pull = np.outer(np.full(21, 100.0), [1.0, 0.0, 0.0])
    run = RunSample(COARSE, {"reaction_end": pull}, 10, 200, 0.0, forces=np.column_stack([t, force, force]))
    ((kind, text),) = undersampled_end_forces(outputs, run, {"end_force_end": 0.1}, [began])
    assert kind == "end force between outputs" and "t = 0.92 s" in text
    assert ("zones that change" in text) == shaken


# --- models ---


def test_a_line_that_floats_counts_as_having_a_thousandth_of_its_weight() -> None:
    """Where it goes slack as a catenary it becomes a rod that this bends over a hundredth of its length, 1 m."""
    floats = cable_scene(SECTION, pinned_at(0, 0, 0), pinned_at(80, 0, 0), time=(1.0, 0.1),
                         fluid={"density": 2.0 / (0.25 * np.pi * 0.03**2)})  # fmt: skip
    slack = ComputationError(Outcome.SLACK, 0.5, 50.0)
    found = rods_instead_of_slack(as_scene(floats), slack)
    assert found is not None and one_line(found.scene).cable.sections[0].bending_stiffness == pytest.approx(
        9.81e-3 * 2.0
    )


def test_the_longest_cells_of_a_zone_are_a_quarter_of_it() -> None:
    scene = cable_scene(SECTION, pinned_at(0, 0, 0), pinned_at(80, 0, 0), model="catenary")
    whole = one_line(as_scene(scene))
    assert build(whole, Resolution(1e-3, 0.1, None, 1e-3)).cells == 4


@pytest.mark.parametrize(("cosine", "brought"), [(-0.88, True), (-0.92, False)])
def test_a_material_axis_is_brought_to_a_tangent_that_is_not_nearly_opposite(cosine: float, brought: bool) -> None:
    """The short way from a tangent to its opposite has no plane: axes that were not given stay so."""
    start, end = untwisted(((1.0, 0.0, 0.0), None), ((cosine, 0.0, (1.0 - cosine**2) ** 0.5), None))
    assert (start[1] is not None, end[1] is not None) == (brought, brought)


@pytest.mark.parametrize(("length", "said"), [(80.06, False), (80.1, True)])
def test_a_line_that_is_hardly_longer_than_its_span_is_not_called_slack(length: float, said: bool) -> None:
    """By less than a thousandth: on the bed, and without weight."""
    section, ends = SECTION | {"length": length}, (pinned_at(0, 0, 0), pinned_at(80, 0, 0))
    for around in ({"gravity": 0.0}, {"seabed": {"z": 0.0, "stiffness": 1e4}}):
        reasons = reasons_against(
            one_line(as_scene(cable_scene(section, *ends, model="catenary", **around))), (False, False)
        )
        assert any("m longer" in x for x in reasons) == said


def test_a_body_without_size_passes_through_the_surface_over_a_centimetre() -> None:
    body = {"kind": "clump", "at": 50.0, "mass": 1.0, "added_mass": 2.0}
    scene = cable_scene(SECTION, pinned_at(0, 0, 0), pinned_at(80, 0, 0), model="catenary", attachments=[body],
                        fluid={"density": 1025.0, "surface": 0.0})  # fmt: skip
    assert build(one_line(as_scene(scene))).cable.points["point_height"] == pytest.approx([0.01])


@pytest.mark.parametrize(("slack", "ruled_out"), [(0.2, False), (0.3, True)])
def test_catenaries_are_no_choice_where_a_pre_run_is_within_four_times_of_slack(slack: float, ruled_out: bool) -> None:
    s = np.array([0.0, 10.0])
    nothing = np.zeros(2)
    text = no_catenary((nothing, np.array([0.0, slack]), nothing, nothing), s)
    assert bool(text) == ruled_out and ("at s = 10 m" in text) == ruled_out


# --- runs ---


@pytest.mark.parametrize(("away", "named"), [(2.9, False), (3.1, True)])
def test_a_first_place_three_lengths_away_is_named(away: float, named: bool) -> None:
    points = {"held": {"position": [0, 0, 0]}, "far": {"position": [150, 0, 0]},
              "knot": {"initial_guess": [100.0 * away, 0, 0], "mass": 1.0}}  # fmt: skip
    scene = network_scene(points, {x: line_between(x, "knot", SECTION, mesh=4) for x in ("held", "far")})
    assert ("points.knot.initial_guess nearer" in _nearer(system_of(scene))) == named


@pytest.mark.parametrize(("angle", "twisted"), [(0.008, False), (0.012, True)])
def test_a_line_with_sections_that_are_turned_stays_in_space(angle: float, twisted: bool) -> None:
    """However little torque that is."""
    section = SECTION | {"bending_stiffness": 10.0, "torsional_stiffness": 1e-9}
    model = build(
        one_line(as_scene(cable_scene(section, pinned_at(0, 0, 0), pinned_at(80, 0, 0), model="rod", mesh=4)))
    )
    assert LonePlane._is_twisted(model, np.full(4, angle)) == twisted


@pytest.mark.parametrize("stiffness", [10.0, 1e6])
def test_a_rod_that_stands_on_a_hinge_is_said_to_be_unstable_however_stiff_it_is(stiffness: float) -> None:
    """It was not where its weight was below a thousandth of EI/L^2: a rod that is so stiff tips over all the same."""
    section = {"length": 1.0, "mass": 0.1, "bending_stiffness": stiffness}
    up = {"kind": "straight", "direction": [0, 0, 1]}
    result = hybrid.run(cable_scene(section, pinned_at(0, 0, 0), {"kind": "free"}, model="rod", mesh=10, initial=up,
                                    gravity=9.81, time=(0.02, 0.01)))  # fmt: skip
    assert "unstable" in kinds(result)
