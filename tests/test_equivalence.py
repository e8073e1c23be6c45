"""The same cable said in two ways gives the same answer.

Tolerance: Newton stops when the next correction would turn no chord by more than 1e-9
(kernels.step.line_step.TOLERANCE); two runs that round differently may then differ by some 1e-9 of
the length in statics and by some of these, accumulated over the steps, in motion.
"""

import numpy as np
import pytest

import hybrid
from tests.scenes import cable_scene, clamped_at

SAME = np.eye(3)
STATIC, MOVING = 2e-9, 2e-7  # of the length, and of the largest tension
LENGTH = 2.0

SECTIONS = [
    {"length": 0.8, "mass": 0.5, "diameter": 0.02, "bending_stiffness": (0.05, 0.02), "torsional_stiffness": 0.04,
     "intrinsic_curvature": [0.3, -0.2, 0.1], "drag": {"normal": 1.2, "tangential": 0.05}, "added_mass": {"normal": 1.0},
     "damping": {"mass": 0.1, "stiffness": 0.01}},
    {"length": 1.2, "mass": 0.7, "diameter": 0.03, "bending_stiffness": 0.08, "torsional_stiffness": 0.05,
     "axial_stiffness": 2e4, "drag": {"normal": 1.0}},
]  # fmt: skip
MODELS = {
    "rod": {"kind": "rod"},
    "catenary": {"kind": "catenary"},
    "hybrid": {
        "kind": "zones",
        "zones": [{"rod": 0.6, "cells": 12}, {"catenary": 0.8, "cells": 16}, {"rod": 0.6, "cells": 12}],
    },
}


def scene(case, rotate=SAME, sections=SECTIONS, **changes):
    """A line in a current, pulled and pushed in three dimensions, without gravity, so that it may be turned anywhere."""

    def turned(x):
        return tuple(float(c) for c in rotate @ np.array(x, float))

    data = cable_scene(
        sections, clamped_at(turned([0.1, -0.2, 0.3]), turned([0.2, 0.1, -1]), normal=turned([1, 0.5, 0])),
        {"kind": "free", "force": turned([6.0, 3.0, -4.0])}, gravity=0.0,
        fluid={"density": 1000.0, "current": turned([0.3, 0.2, -1.0])},
        initial={"kind": "equilibrium", "direction": turned([0.3, 0.2, -0.9])}, model=MODELS[case], time=(0.5, 0.01),
        output=(0.1, 41)
    )  # fmt: skip
    if case != "hybrid":
        data["mesh"] = {"cells": 40}
    return hybrid.validate_scene(data | changes)


def released(model, rotate=SAME, sections=SECTIONS):
    """The same line let go from a straight shape."""
    direction = tuple(float(c) for c in rotate @ np.array([0.2, 0.1, -1.0]))
    return scene(model, rotate, sections, initial={"kind": "straight", "direction": direction})


def random_rotation(seed):
    q = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))[0]
    return q * np.sign(np.linalg.det(q))


# the cable along +-x, +-y, +-z, and an arbitrary rotation
AXES = {
    "x to y": np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1.0]]),
    "x to z": np.array([[0, 0, -1], [0, 1, 0], [1, 0, 0.0]]),
    "z to -z": np.diag([1, -1, -1.0]),
    "x to -x": np.diag([-1, -1, 1.0]),
    "anyhow": random_rotation(4),
}


def assert_alike(a, b, tolerance, rotate=SAME):
    """Two results are the same, b being a turned by `rotate`."""
    size = np.abs(a.tension).max()
    moved = np.einsum("ij,tsj->tsi", rotate, a.position)
    assert np.abs(moved - b.position).max() < tolerance * LENGTH
    for name, bound in (("tension", 10 * size), ("curvature", 100 * max(1.0, np.abs(a.curvature).max()))):
        assert np.abs(a.both_sides(name)[1] - b.both_sides(name)[1]).max() < bound * tolerance, name


@pytest.mark.parametrize("turn", AXES)
@pytest.mark.parametrize("model", MODELS)
def test_a_turned_scene_gives_the_turned_answer(model, turn):
    rotate = AXES[turn]
    assert_alike(hybrid.static(scene(model)), hybrid.static(scene(model, rotate)), STATIC, rotate)
    if turn in ("x to z", "anyhow"):
        assert_alike(hybrid.run(released(model)), hybrid.run(released(model, rotate)), MOVING, rotate)


@pytest.mark.parametrize(
    ("whole", "split"),
    [
        ([{"rod": 2.0, "cells": 40}], [{"rod": 0.7, "cells": 14}, {"rod": 1.3, "cells": 26}]),
        ([{"catenary": 2.0, "cells": 40}], [{"catenary": 0.7, "cells": 14}, {"catenary": 1.3, "cells": 26}]),
        (
            [{"rod": 0.6, "cells": 12}, {"catenary": 1.4, "cells": 28}],
            [
                {"rod": 0.3, "cells": 6},
                {"rod": 0.3, "cells": 6},
                {"catenary": 0.4, "cells": 8},
                {"catenary": 1.0, "cells": 20},
            ],
        ),
    ],
)
def test_a_zone_split_in_two_of_the_same_kind(whole, split):
    straight = {"kind": "straight", "direction": [0.2, 0.1, -1.0]}
    a = hybrid.run(scene("hybrid", model={"kind": "zones", "zones": whole}, initial=straight))
    b = hybrid.run(scene("hybrid", model={"kind": "zones", "zones": split}, initial=straight))
    assert_alike(a, b, MOVING)
