"""Derived quantities of a cable: one definition each, held against the figures of a scene."""

from __future__ import annotations

import re
from math import pi

import numpy as np
import pytest
from problems import clamped, pinned, scene

import hybrid
from hybrid.model.material import TENSION_FLOOR, material, tension_floor
from hybrid.scene.read import one_line

SECTION = {"length": 60.0, "mass": 3.0, "diameter": 0.05, "bending_stiffness": 40.0, "axial_stiffness": 1e6}
SUBMERGED = 9.81 * (3.0 - 1025 * pi / 4 * 0.05**2)  # N/m


def cable(fluid=None, attachments=(), model="catenary", **section):
    return material(
        one_line(
            hybrid.validate_scene(
                {
                    "environment": {"gravity": 9.81, **({"fluid": fluid} if fluid else {})},
                    "cable": {"sections": [SECTION | section], "attachments": list(attachments)},
                    "ends": {"start": pinned(), "end": pinned(50.0, 0, 0)},
                    "initial": "equilibrium",
                    "model": model,
                }
            )
        )
    )


@pytest.mark.parametrize("surface", [None, 100.0, -100.0], ids=["no surface", "under it", "above it"])
def test_submerged_weight_is_the_same_with_and_without_a_surface(surface):
    fluid = {"density": 1025} | ({} if surface is None else {"surface": surface})
    found = cable(fluid)
    assert found.submerged_weight == pytest.approx([SUBMERGED], rel=1e-12)
    assert found.bending_length(0.0) == pytest.approx([(40.0 / SUBMERGED) ** (1 / 3)], rel=1e-12)
    assert cable().submerged_weight == pytest.approx([9.81 * 3.0], rel=1e-12)


def test_modules_weigh_where_they_are():
    modules = {"kind": "modules", "range": [20, 40], "mass": 5.0, "volume": 0.004}
    found = cable({"density": 1025, "surface": 100.0}, [modules])
    more = 9.81 * (5.0 - 1025 * 0.004)
    assert found.submerged_weight == pytest.approx([SUBMERGED, SUBMERGED + more, SUBMERGED], rel=1e-12)
    assert found.piece(np.array([0.0, 20.0, 20.1, 60.0])).tolist() == [0, 0, 1, 2]


def test_bending_about_both_axes_and_torsion():
    found = cable(model="rod", bending_stiffness=[30.0, 50.0], torsional_stiffness=9.0)
    assert found.mean_bending == pytest.approx([40.0]) and found.weakest_bending == pytest.approx([30.0])
    assert found.B.tolist() == [[30.0, 50.0, 9.0]]
    assert pytest.approx(np.array([[40.0, 40.0, 40.0 / 1.3]])) == cable(model="rod").B  # of a solid round section


def test_a_cable_without_weight_has_a_least_tension():
    floor = tension_floor(np.array([40.0, 40.0]), np.array([27.0, 0.0]), 1e3)
    assert floor == pytest.approx([TENSION_FLOOR * (40.0 * 27.0**2) ** (1 / 3), 1e-3])


def test_the_rod_advised_at_a_neglected_clamp_follows_from_the_weight_under_water():
    water = {"density": 1025, "surface": 50.0}
    section = {"length": 500, "mass": 1.2, "diameter": 0.035, "bending_stiffness": 20, "axial_stiffness": 3e6}
    text = scene(
        section, pinned(), clamped((400, 0, -100)), model="adaptive", gravity=9.81, fluid=water,
        time={"duration": 0.1, "step": 0.05},
    )  # fmt: skip
    (said,) = [e.text for e in hybrid.run(text).events if "the clamp at ends.end" in e.text]
    begin = float(re.findall(r"\[\[([\d.]+), 500\]\]", said)[0])
    submerged = 9.81 * (1.2 - 1025 * pi / 4 * 0.035**2)
    assert 500.0 - begin == pytest.approx(4 * (20 / submerged) ** (1 / 3), abs=0.06)  # by the weight in air: 4.8 m
