"""Equilibria of the sea from the scene alone: touchdown, tethers, and many random variants of them.

pytest tests/solve/test_statics_sea.py -s
"""

from __future__ import annotations

import numpy as np
import pytest

import hybrid
from tests.scenes import cable_scene, pinned_at

SEEDS = range(50)


def two_heights(g, depth, top, bottom):
    """A current over depth, horizontal and random."""
    up, down = g.uniform(-top, top, 2), g.uniform(-bottom, bottom, 2)
    return [{"z": 0.0, "velocity": [*up, 0.0]}, {"z": -depth, "velocity": [*down, 0.0]}]


def touchdown(g):
    """A line from an anchor on the bed to the surface: two decades of depth, five of EI, any slackness, floats."""
    depth = 10 ** g.uniform(1, 3)
    length = depth * g.uniform(1.15, 4.0)
    span = g.uniform(0.2, 0.995) * np.sqrt(length**2 - depth**2)
    mass = 10 ** g.uniform(0, 2)
    section = {
        "length": length, "diameter": np.sqrt(4 * mass / np.pi / 10 ** g.uniform(3.2, 3.9)), "mass": mass,
        "axial_stiffness": 1e7 * mass, "bending_stiffness": 10 ** g.uniform(-1, 4),
        "drag": {"normal": 1.2, "tangential": 0.05},
    }  # fmt: skip
    bed = {"z": -depth, "stiffness": 10 ** g.uniform(3, 5)} | ({"friction": 0.4} if g.random() < 0.3 else {})
    lift = mass * length * g.uniform(0, 2)
    floats = [{"kind": "float", "at": length * g.uniform(0.2, 0.8), "buoyancy": lift, "drag_area": 0.3}]
    return cable_scene(
        section, pinned_at(0, 0, -depth), pinned_at(span * np.cos(1.0), span * np.sin(1.0), 0), initial="",
        fluid={"density": 1025, "current": two_heights(g, depth, 1.0, 0.3)}, seabed=bed,
        attachments=floats if g.random() < 0.3 else [],
    )  # fmt: skip


def tether(g):
    """A tether, heavy above and buoyant below, or with a float at mid-length and a vehicle at its end."""
    depth = 10 ** g.uniform(1, 2.5)
    length = depth * g.uniform(1.2, 3.0)
    span = g.uniform(0.05, 0.98) * np.sqrt(length**2 - depth**2)
    diameter, stiffness = g.uniform(0.01, 0.05), 10 ** g.uniform(-2, 2)
    displaced = 1025 * np.pi / 4 * diameter**2

    def section(part, density):
        return {
            "length": part * length, "diameter": diameter, "mass": density * displaced, "axial_stiffness": 1e6,
            "bending_stiffness": stiffness, "drag": {"normal": 1.2, "tangential": 0.02},
        }  # fmt: skip

    end = {"kind": "pinned", "position": [span, 0, -depth]}
    cable = {"sections": [section(0.5, g.uniform(1.05, 3)), section(0.5, g.uniform(0.4, 0.95))]}
    if g.random() < 0.5:
        lift = displaced * 9.81 * length * g.uniform(0.05, 1)
        foam = 0.3 * lift / 9.81  # kg: its density is 0.3 / 1.3 of that of the water, 240 kg/m^3
        float_ = {"kind": "float", "at": 0.5 * length, "buoyancy": lift, "mass": foam, "drag_area": 0.05}
        cable = {"sections": [section(1.0, g.uniform(1.02, 3))], "attachments": [float_]}
        if g.random() < 0.5:
            thrust = (50 * g.uniform(-1, 1, 3)).tolist()
            end = {"kind": "body", "mass": 300.0, "volume": g.uniform(0.25, 0.292), "drag_area": 1.0, "thrust": thrust}
    return {
        "environment": {"fluid": {"density": 1025, "current": two_heights(g, depth, 1.0, 0.3)}},
        "cable": cable,
        "ends": {"start": {"kind": "pinned", "position": [0, 0, 0]}, "end": end},
    }


def variant(seed):
    """A random scene with 100 cells, rod or catenary."""
    g = np.random.default_rng(seed)
    data = (touchdown if g.random() < 0.5 else tether)(g)
    kind = "rod" if g.random() < 0.6 else "catenary"
    return hybrid.validate_scene(data | {"model": kind, "initial": "equilibrium", "mesh": {"cells": 100}})


@pytest.mark.long
def test_random_variants_converge_or_are_refused_with_a_true_reason():
    """Out of balance: below 1e-6 of the largest tension, a thousand times what Newton's tolerance leaves."""
    hybrid.static(variant(SEEDS[0]))  # compile
    found, refused = 0, []
    for seed in SEEDS:
        scene = variant(seed)
        try:
            result = hybrid.static(scene)
        except hybrid.ComputationError as stop:
            # the only true reason among these scenes: more cable than the way along the bed and up
            assert "longer than from end to end along the seabed" in str(stop), seed
            refused.append(seed)
            continue
        found += 1
        out_of_balance = float(result.message.split("residual force ")[1].split()[0])
        assert out_of_balance <= 1e-6 * np.abs(result.tension).max() + 1e-6, seed
    print(f"\n{found} of {len(SEEDS)} found; refused with a reason: {refused}")
    assert len(refused) <= 0.1 * len(SEEDS)


def test_the_first_shape_is_named_and_can_be_chosen():
    data = variant(1).model_dump(exclude_none=True)
    data["ends"]["end"] = {"kind": "pinned", "position": [0.6 * variant(1).length, 0, 0]}
    data["environment"].pop("seabed", None)
    data["ends"]["start"]["position"] = [0, 0, 0]
    found = {}
    for guess in ("auto", "arc", "span"):
        data["initial"] = {"kind": "equilibrium", "guess": guess}
        found[guess] = hybrid.static(hybrid.validate_scene(data))
    assert "elastic catenary" in found["auto"].message
    assert found["arc"].position == pytest.approx(found["auto"].position, abs=1e-6 * variant(1).length)


def test_refused_with_the_reason():
    """A cable too long for its bed, and one that nothing keeps from sliding."""
    data = variant(1).model_dump(exclude_none=True)
    length = variant(1).length
    data["environment"]["seabed"] = {"z": 0.0, "stiffness": 1e4}
    data["environment"]["fluid"].pop("current")
    data["cable"] |= {"attachments": []}
    data["cable"]["sections"] = [data["cable"]["sections"][0] | {"length": length, "mass": 10.0}]
    data |= {"model": {"kind": "catenary"}, "dimension": 2}  # in space it lies slack beside the span
    data["ends"] = {"start": pinned_at(0, 0, 0), "end": pinned_at(0.4 * length, 0, 0.3 * length)}
    with pytest.raises(hybrid.ComputationError, match="longer than from end to end along the seabed and straight up"):
        hybrid.static(hybrid.validate_scene(data))


@pytest.mark.parametrize(
    "others", [[{"kind": "clump", "at": 30, "mass": 50, "volume": 0.006}], [{"kind": "swivel", "at": 30}]]
)
def test_what_displaces_most_at_a_place_says_how_it_floats(others):
    """In either order: the last of them had its own height and shape for all."""
    spar = {"kind": "float", "at": 30, "volume": 1.0, "mass": 200, "height": 3.0, "shape": "cylinder"}
    section = {"length": 60, "mass": 2, "diameter": 0.03, "axial_stiffness": 1e6}
    mass, volume = (spar[x] + sum(y.get(x, 0.0) for y in others) for x in ("mass", "volume"))
    heights = []
    for items in ([spar, *others], [*others, spar], [spar | {"mass": mass, "volume": volume}]):
        cable = {"sections": [section], "attachments": items}
        made = {"cable": cable, "ends": {"start": pinned_at(0, 0, -15), "end": pinned_at(40, 0, -15)}, "model": "catenary",
                "environment": {"fluid": {"density": 1025, "surface": 0}}, "initial": "equilibrium", "mesh": {"cells": 20}}  # fmt: skip
        found = hybrid.static(made)
        heights.append(found.position[-1, found.s.searchsorted(30), 2])
    assert heights == pytest.approx([heights[2]] * 3, abs=1e-9)
