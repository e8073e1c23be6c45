"""Torque that passes through catenary zones, against rods from end to end on the same nodes.

Tolerances are of the discretisation: a catenary's chords turn the frames a little otherwise than a rod's.
"""

import numpy as np
import pytest

import hybrid
from tests.scenes import cable_scene, clamped_at

RODS = ({"rod": 12, "cells": 48}, {"rod": 36, "cells": 144}, {"rod": 12, "cells": 48})


def sag(turns, zones, **more):
    """60 m of cable in a current across, one end twisted against the other; tension above 114 N."""
    section = {
        "length": 60.0, "mass": 0.6, "diameter": 0.02, "bending_stiffness": 10.0, "torsional_stiffness": 8.0,
        "drag": {"normal": 1.2}, "damping": {"mass": 0.2},
    }  # fmt: skip
    current = {"kind": "uniform", "velocity": [0.0, 0.3, 0.0]}
    start = clamped_at([0, 0, 0], [0.75, 0, -0.66], normal=[0, 1, 0])
    end = clamped_at([55, 0, 0], [0.75, 0, 0.66], normal=[0, 1, 0], turns=turns) | more.pop("end", {})
    around = {"gravity": 9.81, "fluid": {"density": 1000.0, "current": current}}
    return hybrid.validate_scene(
        cable_scene(section, start, end, model={"kind": "zones", "zones": zones}, **around) | more
    )


@pytest.fixture(scope="module")
def rods():
    return {turns: hybrid.static(sag(turns, RODS)) for turns in (4, 20, 60)}


MIDDLE = (RODS[0], {"catenary": 36, "cells": 144}, RODS[2])
TWO = (
    RODS[0], {"catenary": 12, "cells": 48}, {"rod": 12, "cells": 48}, {"catenary": 12, "cells": 48}, RODS[2],
)  # fmt: skip
AT_START = ({"catenary": 48, "cells": 192}, RODS[2])


@pytest.mark.parametrize("turns", [4, 20, 60])
@pytest.mark.parametrize("zones", [MIDDLE, TWO], ids=["one zone", "two zones"])
def test_torque_in_statics(rods, turns, zones):
    """Torques of 3.35 to 50.3 N m; at the last M^2/(4 EI T) is 0.55."""
    rod, mixed = rods[turns], hybrid.static(sag(turns, zones))
    torque = rod["torque"][0].mean()
    assert mixed["torque"][0].mean() == pytest.approx(torque, rel=2e-5)
    apart = np.linalg.norm(rod["position"][0] - mixed["position"][0], axis=1).max()
    assert apart < 60.0 * 2e-5 * (1.0 + turns)  # the side force of the torque, left out in catenaries, grows with it


def test_torque_of_a_catenary_at_the_end(rods):
    mixed = hybrid.static(sag(20, AT_START))
    assert mixed["torque"][0].mean() == pytest.approx(rods[20]["torque"][0].mean(), rel=1e-4)
    held = mixed["moment_start"][0]
    assert np.linalg.norm(held) == pytest.approx(mixed["torque"][0, 0], rel=1e-6)


def test_torque_in_motion():
    """An end that sways by 2 m while its frame turns back and forth: torque and energy as of rods."""
    motion = {"surge": {"amplitude": 1.0, "period": 6.0}, "sway": {"amplitude": 2.0, "period": 8.0},
              "roll": {"amplitude": 170.0, "period": 8.0}, "ramp": 4.0}  # fmt: skip
    time = {"duration": 8.0, "step": 0.02}
    rod, mixed = (
        hybrid.run(sag(8, zones, end={"motion": motion}, time=time, output={"every": 0.5, "points": 61}))
        for zones in (RODS, MIDDLE)
    )
    torque = rod["torque"][:]
    assert np.ptp(torque.mean(axis=1)) > 0.2  # it changes by more than a tenth
    np.testing.assert_allclose(mixed["torque"][:].mean(axis=1), torque.mean(axis=1), rtol=1e-3)
    np.testing.assert_allclose(mixed["turns/link"], rod["turns/link"], atol=1e-9)
    assert np.ptp(rod["turns/link"][:]) > 0.3
    scheme = [np.abs(x["work/scheme"][:]).max() for x in (rod, mixed)]
    assert scheme[1] < 1.1 * scheme[0]
    assert np.abs(mixed["work/zones"][:]).max() > 0.0
    iterations = [x["steps/iterations"][:].mean() for x in (rod, mixed)]
    assert iterations[1] <= 1.03 * iterations[0]


def test_an_equilibrium_with_zones_that_has_lost_turns_is_refused():
    """A loop between catenaries at the clamps, which hold no direction: one way led around them, to 1 of 3 turns."""
    section = {"length": 4.0, "mass": 0.4, "diameter": 0.02, "axial_stiffness": 1e5, "bending_stiffness": 0.5}
    clamp = {"kind": "clamped", "tangent": [1, 0, 0], "normal": [0, 0, 1]}
    scene = cable_scene(
        section | {"torsional_stiffness": 0.4}, clamp | {"position": [0, 0, 0]},
        clamp | {"position": [2.0, 0, 0], "turns": 3}, gravity=0.5, mesh=100, contact={"self": False},
        model={"kind": "zones", "zones": [{"catenary": 0.5}, {"rod": 3.0}, {"catenary": 0.5}]}
    )  # fmt: skip
    with pytest.raises(hybrid.ComputationError, match=r"compression|turns"):
        hybrid.static(hybrid.validate_scene(scene))
