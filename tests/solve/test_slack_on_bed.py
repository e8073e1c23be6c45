"""Lines that lie slack on a bed: bows of the elastica, however soft they are; lines along ridges and over rough ground."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.special import ellipe, ellipk

import hybrid
from hybrid.model.build import build
from hybrid.scene.read import one_line
from hybrid.scene.sea import Depths
from hybrid.solve.stability import Stability
from tests.scenes import cable_scene, pinned_at

SPAN, WEIGHT = 100.0, 50.0 * 9.81


def lying(length: float, bed: dict[str, Any], end: float = SPAN, **section: float) -> dict[str, Any]:
    """A line on a bed, between ends that lie on it SPAN apart, or `end`."""
    one = {"length": length, "diameter": 0.1, "mass": 50.0, "axial_stiffness": 1e8} | section
    ends, around = (pinned_at(0.0, 0.0, 0.0), pinned_at(end, 0.0, 0.0)), {"z": 0.0, "stiffness": 5e4} | bed
    return cable_scene(one, *ends, gravity=9.81, seabed=around, model="rod", mesh=100)


@pytest.mark.parametrize(("EI", "longer"), [(100.0, 1.001), (100.0, 1.05), (1e4, 1.01)])
def test_a_slack_line_lies_in_a_bow_of_the_elastica(EI: float, longer: float) -> None:
    """Which it falls into, sideways, in some hours: the time scale of the line is 10 s."""
    length = longer * SPAN
    with hybrid.static(lying(length, {}, bending_stiffness=EI)) as result:
        T, r = result.tension[-1], result.position[-1]
        assert {x.kind for x in result.events} - {"compression"} == {"several equilibria"}
    k = brentq(lambda k: 2.0 * ellipe(k * k) / ellipk(k * k) - 1.0 - SPAN / length, 1e-6, 0.9)
    crest = len(T) // 2
    assert T[crest] == pytest.approx(-EI * (2.0 * ellipk(k * k) / length) ** 2, rel=3e-3)
    bow = k * length / ellipk(k * k)
    assert abs(r[crest, 1]) == pytest.approx(bow, rel=3e-3)
    assert np.abs(r[:, 2]).max() < 2.0 * WEIGHT / 5e4


def ridge() -> tuple[dict[str, Any], float]:
    """A ridge along x, and its curvature at the top."""
    y = np.linspace(-8, 8, 17)
    depths = {"x": [-50.0, 0.0, 100.0, 150.0], "y": y.tolist(), "depth": [(0.025 * y**2).tolist()] * 4}
    slopes = [Depths(**depths).surface.depth_at(50.0, side)[2] for side in (-1e-3, 1e-3)]
    return {"depths": depths}, (slopes[1] - slopes[0]) / 2e-3


@pytest.mark.parametrize("part", [0.9, 1.1])
def test_a_line_stays_on_a_ridge_under_enough_tension(part: float) -> None:
    """T pi^2/L^2 + EI pi^4/L^4 against w kappa: below it slides off to one side."""
    bed, kappa = ridge()
    EI, q = 100.0, math.pi / SPAN
    T = part * (WEIGHT * kappa - EI * q**4) / q**2
    scene = lying(SPAN, bed, SPAN * (1.0 + T / 1e8), bending_stiffness=EI)
    with hybrid.static(scene) as found:
        aside = float(np.abs(found.position[-1][:, 1]).max())
        said = {x.kind for x in found.events}
    if part > 1.0:
        assert aside < 1e-6
        assert not said
    else:
        assert 0.1 < aside < 8.0
        assert said == {"several equilibria"}


@pytest.mark.parametrize("seed", [1, 3, 4])
def test_a_line_is_found_across_rough_ground(seed: int) -> None:
    """Without friction the turning normal is all that holds it in the hollows.  A rod and a catenary, coarse and fine."""
    rng = np.random.default_rng(seed)
    x, y = np.arange(-50.0, 551.0, 25.0), np.arange(-50.0, 51.0, 25.0)
    depth = 100.0 + rng.uniform(-0.5, 0.5, (x.size, y.size))
    bed = {"stiffness": 2e4, "depths": {"x": x.tolist(), "y": y.tolist(), "depth": depth.tolist()}}
    ends = {"start": [0.0, 0.0, -10.0], "end": [450.0, 0.0, -100.0]}
    pull, aside = [], []
    for model, cells in (("rod", 400), ("rod", 100), ("catenary", 200)):
        scene = lying(520.0, bed, diameter=0.2, mass=250.0, axial_stiffness=1e9, bending_stiffness=1e4)
        scene |= {"ends": {k: {"kind": "pinned", "position": z} for k, z in ends.items()}}
        with hybrid.static(scene | {"model": model, "mesh": {"cells": cells}}) as found:
            pull.append(found.tension[-1][[0, -1]])
            aside.append(float(np.abs(found.position[-1][:, 1]).max()))
            assert not found.events
    np.testing.assert_allclose(pull[1], pull[0], rtol=0.03)
    np.testing.assert_allclose(pull[2], pull[0], rtol=3e-3)
    assert aside == pytest.approx([aside[0]] * 3, rel=0.02)
    assert aside[0] > 1.0


@pytest.mark.parametrize("cells", [60, 3000])
def test_the_softest_motion_of_a_strut_is_that_of_euler(cells: int) -> None:
    """w^2 = (EI q^2 - P) q^2/m, q = pi/L; of many cells without a dense matrix."""
    length, EI, P, mass = 10.0, 200.0, 60.0, 2.0
    scene = hybrid.validate_scene(cable_scene(
        {"length": length, "mass": mass, "bending_stiffness": EI, "torsional_stiffness": 150.0, "axial_stiffness": 1e6},
        pinned_at(0, 0, 0), pinned_at(10, 0, 0), gravity=0.0, initial={"kind": "straight", "direction": [1, 0, 0]},
        model="rod", mesh=cells, dimension=3, time=(1.0, 0.1)
    ))  # fmt: skip
    model = build(one_line(scene))
    state = model.start.copy()
    state.T[:] = -P
    stability = Stability(model.line, model.sea.at_time(0.0), model.length, model.tension_scale)
    square, shape = stability.softest_motion(model.ends.at_time(0.0), state, np.full(cells, 0.1))
    q = math.pi / length
    assert square == pytest.approx((EI * q**2 - P) * q**2 / mass, rel=2e-3)
    aside = np.hypot(shape[:, 1], shape[:, 2])  # in whichever plane through the line
    np.testing.assert_allclose(aside / aside.max(), np.sin(q * model.line.s), atol=1e-3)
    assert 1.0 <= aside.max() < math.sqrt(2.0) + 1e-9


def test_a_line_that_sinks_by_more_than_it_is_too_long_hangs() -> None:
    """Nothing of it lies in its first shape: a division by zero."""
    chain = {"length": 10, "mass": 100, "diameter": 0.05, "axial_stiffness": 1e8}
    bed = {"z": 0, "stiffness": 1e3}
    scene = cable_scene(chain, pinned_at(0, 0, 0), pinned_at(0.05, 0, 9.5), model="catenary", mesh=40, seabed=bed)
    found = hybrid.static(scene)
    assert found.tension[-1].min() > 0.0 and -0.5 < np.min(found.position[-1, :, 2]) < 0.0
