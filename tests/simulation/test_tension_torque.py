"""Torque of tension (`tension_torque`): closed forms of straight and hanging lines, energy, zones against rods."""

import numpy as np
import pytest

import hybrid
from tests.inside import OnlyLine
from tests.scenes import cable_scene

C, EA, GJ, L, G = 2e-3, 1e5, 20.0, 200.0, 9.81
W = 2.0 * G  # N/m
ZONES = {"kind": "zones", "zones": [{"rod": 50.0}, {"catenary": 100.0}, {"rod": 50.0}]}
DOWN = {"tangent": [0, 0, -1], "normal": [1, 0, 0]}


def section(**more):
    return {
        "length": L, "mass": 2.0, "diameter": 0.03, "axial_stiffness": EA, "max_strain": 0.2, "bending_stiffness": 50.0,
        "torsional_stiffness": GJ, "tension_torque": C,
    } | more  # fmt: skip


def hanging(model, end, force, **more):
    sections = more.pop("sections", [section()])
    return hybrid.validate_scene(
        cable_scene(sections, {"kind": "clamped", "position": [0, 0, 0], **DOWN},
                     {"kind": end, "force": [0, 0, -force], **(DOWN if end == "guided" else {})},
                     gravity=more.pop("gravity", G), model=model, mesh=200, output={"points": 41}) | more
    )  # fmt: skip


@pytest.mark.parametrize("model", ["rod", "catenary", ZONES], ids=["rod", "catenary", "zones"])
def test_a_line_that_is_held_has_the_torque_of_its_mean_tension(model):
    found = hybrid.static(hanging(model, "guided", 500.0))
    mean = 500.0 + 0.5 * W * L
    np.testing.assert_allclose(found["torque"][0], C * mean, rtol=1e-9)
    assert -found["position"][0, -1, 2] == pytest.approx(L * (1.0 + mean / EA), rel=1e-12)
    s = found["s"]
    turn = (C * mean * s - C * (500.0 * s + W * (L * s - 0.5 * s * s))) / GJ  # a parabola
    if model == "rod":
        twist = found["twist"][0]
        np.testing.assert_allclose(np.gradient(turn, s, edge_order=2), twist, atol=1e-9)


@pytest.mark.parametrize("model", ["rod", "catenary", ZONES], ids=["rod", "catenary", "zones"])
def test_a_line_that_turns_freely_has_none_and_is_softer(model):
    found = hybrid.static(hanging(model, "free", 500.0))
    mean = 500.0 + 0.5 * W * L
    assert -found["position"][0, -1, 2] == pytest.approx(L * (1.0 + mean * (1.0 / EA + C * C / GJ)), rel=1e-12)
    if model == "rod":
        assert np.abs(found["torque"][0]).max() < 1e-9 * C * mean
        T = 500.0 + W * (L - found["s"])
        np.testing.assert_allclose(found["twist"][0], -C * T / GJ, rtol=1e-9)
        turns = np.trapezoid(found["twist"][0], found["s"]) / (2.0 * np.pi)
        assert turns == pytest.approx(-C * mean * L / GJ / (2.0 * np.pi), rel=1e-9)


def test_of_two_armours_laid_against_each_other_one_turns_the_other():
    """Sections with opposite torque share the twist by their compliances: Q (1/GJ1 + 1/GJ2) = T (c1/GJ1 + c2/GJ2)."""
    sections = [section(length=100.0), section(length=100.0, tension_torque=-1e-3, torsional_stiffness=5.0)]
    T = 3000.0
    found = hybrid.static(hanging("rod", "guided", T, sections=sections, gravity=0.0))
    torque = T * (C / GJ - 1e-3 / 5.0) / (1.0 / GJ + 1.0 / 5.0)
    np.testing.assert_allclose(found["torque"][0], torque, rtol=1e-9)
    assert found["twist"][0, 5] == pytest.approx((torque - C * T) / GJ, rel=1e-9)


def sag(model, step, turns=0.0, **more):
    """60 m between clamps, the second of which swings."""
    swing = {"sway": {"amplitude": 1.5, "period": 6.0}, "surge": {"amplitude": 0.5, "period": 4.0}, "ramp": 4.0}
    ends = [{"kind": "clamped", "tangent": [0.6, 0, z], "normal": [0, 1, 0]} for z in (-0.8, 0.8)]
    part = section(length=60.0, mass=0.6, diameter=0.02, bending_stiffness=2.0, torsional_stiffness=8.0,
                   axial_stiffness=5e4, tension_torque=5e-3)  # fmt: skip
    return hybrid.validate_scene(
        cable_scene(part, {**ends[0], "position": [0, 0, 0]},
                     {**ends[1], "position": [52, 0, 0], "motion": swing, "turns": turns}, gravity=G, model=model,
                     mesh=120, time=(6.0, step, 0.9), output=(0.5, 61)) | more
    )  # fmt: skip


def test_energy_balances_to_second_order_and_zones_are_rods():
    rods = [hybrid.run(sag("rod", step)) for step in (0.02, 0.01)]
    left = [float(found["work/scheme"][-1]) for found in rods]
    assert left[0] / left[1] == pytest.approx(4.0, abs=0.4)
    assert abs(left[1]) < 1e-4 * float(rods[1]["work/end"][-1])
    zones = {"kind": "zones", "zones": [{"rod": 12.0}, {"catenary": 36.0}, {"rod": 12.0}]}
    mixed = hybrid.run(sag(zones, 0.01))
    torque, other = rods[1]["torque"][:, 30], mixed["torque"][:, 30]
    assert np.abs(other - torque).max() < 1e-3 * np.abs(torque).max()
    assert np.abs(torque).max() > 0.8
    assert float(mixed["work/scheme"][-1]) == pytest.approx(left[1], rel=0.1)


def test_it_is_left_out_where_nothing_has_it():
    plain = section()
    plain.pop("tension_torque")
    none = hybrid.static(hanging("rod", "guided", 500.0, sections=[plain]))
    assert np.abs(none["torque"][0]).max() < 1e-12


@pytest.mark.parametrize(
    ("change", "where"),
    [
        ({"axial_stiffness": None}, "axial_stiffness"),
        ({"torsional_stiffness": None}, "torsional_stiffness"),
        ({"tension_torque": 2.0}, "tension_torque"),
    ],
)
def test_what_it_needs(change, where):
    given = {key: value for key, value in (section() | change).items() if value is not None}
    with pytest.raises(hybrid.SceneError, match=where):
        hanging("rod", "guided", 500.0, sections=[given])


@pytest.mark.parametrize(
    ("more", "words"),
    [
        ({"dimension": 2}, "tension_torque"),
    ],
)
def test_what_it_does_not_go_with(more, words):
    model = more.pop("model", "rod")
    with pytest.raises(hybrid.SceneError, match=words):
        hanging(model, "guided", 500.0, **more)


@pytest.mark.long
def test_cells_that_follow_the_curvature_carry_it():
    """A sagging tether that is moved: torque of 400 rods, on cells that change, and positions as near as without it."""
    clamp = {"kind": "clamped", "position": [0, 0, 0], "tangent": [1, 0, -1], "normal": [0, 1, 0]}
    far = clamp | {"position": [20, 0, 4], "tangent": [1, 0, 1.2],
                   "motion": {"travel": {"by": [3, 2, 1], "over": 2.0}}}  # fmt: skip
    follows = {"kind": "adaptive", "curvature_error": 0.02}

    def run(model, cells, torque):
        tether = section(length=30.0, mass=3.0, bending_stiffness=40.0, tension_torque=torque, damping={"mass": 0.2})
        return hybrid.run(cable_scene(
            tether, clamp, far, gravity=G, contact={"self": False}, model=model, mesh=cells, time=(3.0, 0.02),
            output=(0.5, 31)
        ))  # fmt: skip

    fine, plain = run("rod", 400, 5e-3), run("rod", 400, 0.0)
    found, without = run(follows, 40, 5e-3), run(follows, 40, 0.0)
    largest, stays = np.abs(fine["torque"]).max(), run({"kind": "adaptive"}, 100, 5e-3)
    off, of_others = (np.abs(x["torque"] - fine["torque"]).max() for x in (found, stays))
    assert off < 1.2 * of_others < 0.05 * largest  # as near as zones on cells that stay
    assert np.abs(plain["torque"]).max() < 0.1 * largest
    apart, apart_without = (np.abs(x.position - y.position).max() for x, y in ((found, fine), (without, plain)))
    assert apart < 1.2 * apart_without < 1e-2
    changes, of_plain = (abs(x["work/zones"][-1]) for x in (found, without))
    assert changes < 1.2 * of_plain < 1.0


# --- torques that are saved ---


@pytest.fixture(scope="module")
def simulation():
    section = {"length": 6.0, "mass": 0.6, "diameter": 0.02, "bending_stiffness": 10.0, "torsional_stiffness": 8.0}
    sway = {"motion": {"sway": {"amplitude": 0.5, "period": 4.0}, "ramp": 1.0}}
    clamp = {"kind": "clamped", "normal": [0, 1, 0]}
    scene = hybrid.validate_scene(cable_scene(
        section | {"damping": {"mass": 0.2}}, clamp | {"position": [0, 0, 0], "tangent": [0.75, 0, -0.66]},
        clamp | {"position": [5.5, 0, 0], "tangent": [0.75, 0, 0.66], "turns": 2.0} | sway, gravity=9.81,
        time=(5.0, 0.01), output=1.0,
        model={"kind": "zones",
               "zones": [{"rod": 1.5, "cells": 6}, {"catenary": 3, "cells": 12}, {"rod": 1.5, "cells": 6}]}
    ))  # fmt: skip
    return hybrid.Simulation(scene)


def answers(simulation):
    return OnlyLine(simulation).work.torsion


def test_answers_serve_for_steps_of_the_same_length(simulation):
    """Round-off of the times of steps is no other length: answers were found anew in every step."""
    simulation.advance(0.5)
    served = []
    for _ in range(12):
        simulation.advance(simulation.t + 0.01)
        served.append(int(answers(simulation).known[1]))
    assert max(served) > 10, f"iterations that answers served: {served}"
