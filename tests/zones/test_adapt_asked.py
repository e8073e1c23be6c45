"""What a user asks of zones that move: a criterion of their own, criteria as fields, the default model."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np
import pytest
from adapt_cases import X, cable, even, on, state_on
from adapt_cases import still as held
from adapt_scenes import CELL, DWELL, EI, LENGTH, breathing, changes, comes, goes, output_at, ran, rods, sagging
from problems import Scene, clamped, pinned, scene

import hybrid
from hybrid.kernels.mesh.zone_criteria import BEND, CRITERIA, advance
from hybrid.kernels.mesh.zone_step import REJECT_RATIO
from hybrid.kernels.state.state import no_sea
from hybrid.zones.manager import Allowed, DomainManager, NodeState, Times, cell_ratios, of_line
from tests.scenes import cable_scene

STEP = 0.02
EXAMPLES = Path(__file__).parents[2] / "examples"


# --- a criterion of the user --------------------------------------------------------------------------


def calm(**model):
    """A cable that asks for nothing."""
    return breathing(9.0, 8.0, {"tolerance": 0.1} | model, duration=3.0)


def test_a_criterion_of_the_user_on_and_off():
    """1 at t >= 0.5 s around the middle, 0.4 from 1 s on: a rod there, then gone after dwell and blending."""
    seen = []

    def criterion(look):
        seen.append(look)
        level = 0.0 if look.t < 0.5 else 1.2 if look.t < 1.0 else 0.4
        return np.where(np.abs(look.s - 5.0) < 0.55, level, 0.0)

    result = hybrid.run(calm(), criterion=criterion)
    (first, *_), gone = comes(result), goes(result)
    assert first.t == pytest.approx(0.5, abs=STEP) and first.criterion == "given" and first.value == pytest.approx(1.2)
    assert first.s_a <= 4.4 and first.s_b >= 5.6
    assert -STEP < gone[0].t - (1.0 + 2 * DWELL) < 0.5 * DWELL + 2 * STEP  # the reviews at which it was calm, and gone
    assert gone[0].criterion == "given" and gone[0].threshold == 0.5
    look = seen[-1]
    assert look.s.shape == look.curvature.shape == look.bending_stiffness.shape == (look.tension.size + 1,)
    assert look.position.shape == look.velocity.shape == (look.s.size, 3)


def test_half_a_criterion_keeps_what_is_there():
    """Between its `off` of 0.5 and 1 nothing comes and nothing goes."""
    result = hybrid.run(calm(), criterion=lambda look: np.full(look.s.size, 1.1 if 0.1 < look.t < 0.3 else 0.6))
    assert comes(result) and not goes(result)
    assert not changes(hybrid.run(calm(), criterion=lambda look: np.full(look.s.size, 0.99)))


def test_what_a_criterion_sees_is_not_its_own():
    def greedy(look):
        look.position[:] = 0.0
        return np.zeros(look.s.size)

    with pytest.raises(ValueError, match="read-only"):
        hybrid.run(calm(), criterion=greedy)


@pytest.mark.parametrize("answer", [1.0, np.zeros(3), np.zeros((5, 2))])
def test_a_criterion_of_another_shape(answer):
    with pytest.raises(ValueError, match="expected: one number per node"):
        hybrid.run(calm(), criterion=lambda look: answer)


def test_a_criterion_that_is_no_number():
    with pytest.raises(ValueError, match=r"returned nan at s = 5 m at t = 0 s"):
        hybrid.run(calm(), criterion=lambda look: np.where(look.s == 5.0, np.nan, 0.0))


class Counting:
    """A criterion that is an object."""

    def __call__(self, look):
        return "x"


def of_words(look, word):
    return [word] * look.s.size


@pytest.mark.parametrize(
    ("criterion", "name", "given"),
    [
        (lambda look: "x", "<lambda>", r"'x' \(str\)"),
        (lambda look: None, "<lambda>", r"None \(NoneType\)"),
        (Counting(), "Counting", r"'x' \(str\)"),
        (partial(of_words, word="rod"), "of_words", r"\['rod', 'rod'.* \(list\)"),
    ],
)
@pytest.mark.parametrize("of", [lambda criterion: criterion, lambda criterion: of_line(criterion, "hose")])
def test_a_criterion_that_gives_words_is_named_with_its_place(of, criterion, name, given):
    """File, line, function, what it returned and what is expected, of one cable and of lines."""
    nodes = NodeState(0.5, np.arange(3.0), *np.zeros((2, 3, 3)), np.ones(2), *np.zeros((2, 3)))
    place = rf"test_adapt_asked.py:\d+: the criterion {name} returned {given} at t = 0.5 s\n"
    with pytest.raises(
        ValueError, match=place + r"    expected: one number per node, an array of shape \(3,\).*\n    try: "
    ):
        cell_ratios(of(criterion), nodes)
    with pytest.raises(ValueError, match="criterion: expected a function"):
        cell_ratios(of("bend"), nodes)


def test_a_criterion_may_be_a_mask():
    result = hybrid.run(calm(), criterion=lambda look: look.s > 7.0)
    assert rods(result, -1)[0][1] == LENGTH


# --- criteria as fields ---------------------------------------------------------------------------------


def test_criteria_are_fields():
    """`criteria: true`: what every criterion was, over t and s, and switches happen where one of them is above 1."""
    what = sagging().model_dump(exclude_none=True)
    what["output"]["criteria"] = True
    result = hybrid.run(Scene.model_validate(what))
    ratios = {x.name: result[f"criteria/{x.name}"] for x in CRITERIA}
    assert all(x.shape == (result.times.size, result.s.size) and np.isfinite(x).all() for x in ratios.values())
    for e in comes(result):
        if e.criterion:
            k = output_at(result, e.t)
            near = np.abs(result.s - 0.5 * (e.s_a + e.s_b)) < e.s_b - e.s_a + 10 * CELL
            assert ratios[e.criterion][k, near].max() >= e.value * (1 - 1e-12), e
    # slack is what is seen in tension: the floor over it, or over what it will be
    assert (ratios["slack"] > 0.0).all()
    assert "criteria/slack" not in ran("deep")


# --- twist is remembered -----------------------------------------------------------------------------------


@pytest.mark.long  # kernels of its own: 8 s
def test_a_cable_that_becomes_rod_again_has_its_twist():
    """One end is rolled by a whole turn while the cable is a catenary; as a rod it has the torque of that turn.

    GJ 2 pi/L, as the run that is rod all the time; a cable that forgets would have none, or that of a part of a turn.
    """
    length, GJ = 10.0, 0.5
    end = clamped((10.004, 0, 0), (1, 0, 0), motion={"roll": {"amplitude": 360.0, "period": 8.0}, "ramp": 1.0})
    what = scene(
        {"length": length, "mass": 0.1, "bending_stiffness": 0.64, "torsional_stiffness": GJ, "axial_stiffness": 1e5,
         "damping": {"mass": 3.0}},
        clamped(), end, cells=20, time={"duration": 3.0, "step": 0.02}, output={"every": 0.1},
    ).model_dump(exclude_none=True)  # fmt: skip
    what["model"] = {"kind": "adaptive", "tolerance": 0.1, "hold_time": 0.4}
    result = hybrid.run(Scene.model_validate(what), criterion=lambda look: np.full(look.s.size, float(look.t >= 1.5)))
    always = hybrid.run(Scene.model_validate(what | {"model": {"kind": "rod"}}))
    assert rods(result, 0) == [] and rods(result, -1) == [(0.0, length)]
    turned = 2 * np.pi * np.sin(2 * np.pi * 3.0 / 8.0)
    assert turned > 4.0
    assert np.abs(result.torque[-1]) == pytest.approx(GJ * turned / length, rel=0.01)
    assert result.torque[-1] == pytest.approx(always.torque[-1], rel=0.01)


# --- safety ------------------------------------------------------------------------------------------------


def test_a_step_that_goes_too_far_is_taken_back():
    """A blow that no criterion saw coming: the step is repeated with rods, and an event says so, with time and place."""
    what = breathing(
        9.0, 3.0, {"tolerance": 0.1, "hold_time": 0.05}, period=0.56, duration=0.5, step=0.05, max_strain=0.2
    )
    result = hybrid.run(what)
    again = [e for e in result.events if e.kind == "retry"]
    assert again
    assert all("the step is repeated" in e.text or "it is repeated" in e.text for e in again)
    assert result.status == "complete"


def test_a_rod_that_comes_back_is_blended_in_again():
    """On its way out and half gone, a rod is asked for again: it must get all of its stiffness back, and then rest."""
    what, zones = cable(), even(10, "R" * 10)
    manager = DomainManager(what, zones, np.zeros(10, int), 1.0, Allowed(0.1), Times(1.0))
    line = on(what, zones)
    state = state_on(line, lambda s: np.outer(s, X), 500.0)
    still, t = 0.0, 0.0

    def pass_by(seconds, ratio):
        nonlocal t
        for _ in range(round(seconds / 0.05)):
            t += 0.05
            manager.ratios[BEND] = ratio
            advance(manager.grown, manager.leaving, manager.zones.ramp_factor, 0.05 / manager.ramp_time)
            if manager.review_due(t):
                manager.review(t, state)

    pass_by(1.6, still)
    assert manager.leaving.all() and 0.0 < manager.grown.max() < 0.9 and manager.stiffness_shares().max() < 0.9
    pass_by(2.0, 0.9)
    assert not manager.leaving.any() and (manager.grown == 1.0).all() and (manager.stiffness_shares() == 1.0).all()
    assert not manager.zones.counts.going


def test_far_beyond_is_no_tension_that_is_only_foreseen():
    """A tension that falls fast asks for rod; a step is taken back only for what it has become."""
    what, zones = cable(), even(10, "C" * 10)
    manager = DomainManager(what, zones, np.zeros(10, int), 1.0, Allowed(0.1), Times(1.0))
    line, sea = on(what, zones), no_sea(10)
    for T, dt in ((400.0, 0.0), (100.0, 0.05)):
        highest = manager.evaluate_criteria(line, sea, held(), state_on(line, lambda s: np.outer(s, X), T), dt)
    assert 1.0 < highest < REJECT_RATIO and not manager.cells_to_reject.size
    highest = manager.evaluate_criteria(line, sea, held(), state_on(line, lambda s: np.outer(s, X), -1.0), 0.05)
    assert highest > REJECT_RATIO and manager.cells_to_reject.size == 10


# --- the default ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize("section, kind", [({"bending_stiffness": EI}, "adaptive"), ({}, "catenary")])
def test_the_model_of_a_scene_that_does_not_say(section, kind):
    what = hybrid.validate_scene(
        cable_scene({"length": 10.0, "mass": 1.0, **section}, pinned(), pinned(8.0, 0, 0), time=(0.2, 0.02))
    )
    assert what.model.kind == kind
    assert hybrid.run(what).status == "complete"


def test_the_former_name_of_what_a_criterion_sees_still_works():
    with pytest.warns(DeprecationWarning, match=r"hybrid\.Look is now hybrid\.NodeState"):
        former = hybrid.Look  # type: ignore[attr-defined]
    assert former is hybrid.NodeState


def test_a_joint_asks_for_no_more_rod() -> None:
    """A touchdown at rest, curvature asked: the kink of a joint is no bend, for which a rod would grow cell by cell.

    A rod is where contact ends, a few cells, and no joint or pin asks for one: results know what they take.
    """
    asked = ["model={kind: adaptive, always_move: true}", "accuracy={curvature: 10%}", "mesh.cells=250"]
    result = hybrid.static(hybrid.load_scene(EXAMPLES / "touchdown.yaml", asked))
    found = rods(result, 0)
    assert len(found) == 1 and found[0][1] - found[0][0] < 20.0
    assert found[0][0] < 89.0 < found[0][1]  # m, where the line leaves the bed
    rod = hybrid.static(hybrid.load_scene(EXAMPLES / "touchdown.yaml", ["model=rod", *asked[2:]]))
    apart = np.abs(result.curvature - rod.curvature)
    assert apart.max() < 0.03 * rod.curvature.max()
