"""Morison members of bodies: drag, added mass and waves against closed forms, derivatives, energy, refusals."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import hybrid
from hybrid.errors import SceneError
from tests.scenes import line_between, network_scene

RHO, G = 1025.0, 9.81
SOFT = {"length": 99.0, "mass": 0.01, "diameter": 0.003, "axial_stiffness": 50.0, "max_strain": 0.9}

HUNG = {"length": 101.0, "mass": 2.0, "diameter": 0.03, "axial_stiffness": 1e6}


def body(**more: Any) -> dict[str, Any]:
    """A vertical cylinder of 4 m, diameter 0.5 m, as heavy as the water that it displaces."""
    volume = 0.25 * np.pi * 0.25 * 4.0
    base = {
        "initial_guess": [0, 0, -30], "mass": RHO * volume, "inertia": [900.0, 900.0, 40.0], "volume": volume,
        "centre_of_buoyancy": [0, 0, 0.3],
        "members": [{"start": [0, 0, -2], "end": [0, 0, 2], "diameter": 0.5, "drag": 1.0, "added_mass": 1.0}],
    }  # fmt: skip
    return base | more


def scene(fluid: dict[str, Any], given: dict[str, Any], **more: Any) -> dict[str, Any]:
    """The body on two soft lines that hardly hold it."""
    return network_scene(
        {"west": {"position": [-101, 0, -30]}, "east": {"position": [101, 0, -30]},
         "port": {"body": "it", "place": [-1, 0, 0]}, "board": {"body": "it", "place": [1, 0, 0]}},
        {"w": line_between("west", "port", SOFT, mesh=4), "e": line_between("east", "board", SOFT, mesh=4)},
        fluid={"density": RHO} | fluid, gravity=G, bodies={"it": given}
    ) | more  # fmt: skip


@pytest.mark.long
def test_a_current_pushes_with_the_drag_of_the_members() -> None:
    """1/2 rho D Cd L U^2 across, pi D Cd_t along, in equilibrium with the lines."""
    members = [{"start": [0, -2, 0], "end": [0, 2, 0], "diameter": 0.5, "drag": 0.9},
               {"start": [-1, 0, 0], "end": [1, 0, 0], "diameter": 0.2, "drag": 0.7, "axial_drag": 0.05}]  # fmt: skip
    made = scene({"current": [0.8, 0, 0]}, body(members=members))
    for line in made["lines"].values():
        line["sections"] = [HUNG]
    with hybrid.static(made) as result:
        force = result["bodies/it/force"][-1]
        expected = 0.5 * RHO * 0.64 * (0.5 * 0.9 * 4.0 + np.pi * 0.2 * 0.05 * 2.0)
        assert -force[0] == pytest.approx(expected, rel=1e-5)
        assert np.abs(result["bodies/it/moment"][-1, [0, 2]]).max() < 1e-9 * expected


def floating(**more: Any) -> dict[str, Any]:
    """The body upright at the surface, in a current; a line to each side."""
    members = [{"start": [0, 0, -2], "end": [0, 0, 2], "diameter": 0.5, "drag": 1.0, "added_mass": 1.0, "pieces": 8}]
    floats = {"hydrostatics": {"heave": 5e3, "roll": 1e9, "pitch": 1e9}, "volume": 0.0}
    given = body(**({"members": members, "centre_of_buoyancy": [0, 0, 0]} | floats | more))
    made = scene({"current": [0.8, 0, 0], "surface": 0.0}, given)
    made["points"]["west"]["position"], made["points"]["east"]["position"] = [-101, 0, -2], [101, 0, -2]
    for line in made["lines"].values():
        line["sections"] = [HUNG | {"drag": {"normal": 0.0}}]
    return made


@pytest.mark.parametrize("guess", [-6.0, -1.0, 0.0, 4.0])
def test_the_wetted_length_is_that_of_the_place_where_the_body_rests(guess: float) -> None:
    """Drag of a member through the surface, whatever the first guess; its hydrostatics are large numbers beside it."""
    with hybrid.static(floating(initial_guess=[0, 0, guess])) as result:
        wet = 2.0 - result["bodies/it/position"][-1, 2]
        assert 2.1 < wet < 3.0
        assert -result["bodies/it/force"][-1, 0] == pytest.approx(0.5 * RHO * 0.5 * 0.64 * wet, rel=1e-6)


def test_the_motion_does_not_depend_on_the_first_guess() -> None:
    """Added mass as well as drag are those of the wetted length where the motion starts."""
    found = []
    for guess in (-6.0, 0.0, 4.0):
        made = floating(initial_guess=[0, 0, guess], force={"value": [3000, 0, 0], "until": 1.0})
        made |= {"time": {"duration": 2.0, "step": 0.05}, "output": {"every": 0.1, "points": 3}}
        with hybrid.run(made) as result:
            found.append(result["bodies/it/velocity"][:, 0])
    assert np.ptp(found[0]) > 0.1
    np.testing.assert_allclose(found[1:], [found[0]] * 2, rtol=0, atol=1e-6)


@pytest.mark.parametrize("guess", [-0.4, 1.5])
def test_a_member_that_its_drag_lifts_out_of_the_water_comes_to_rest(guess: float) -> None:
    """A bar across the current hangs from above: one that is as wet as at the place before swings in and out."""
    bar = {"start": [0, -2, 0], "end": [0, 2, 0], "diameter": 0.5, "drag": 1.0}
    made = floating(initial_guess=[0, 0, guess], hydrostatics=None, mass=60.0, centre=[0, 0, -0.3], members=[bar])
    made["environment"]["fluid"]["current"] = [1.0, 0, 0]
    made["points"], made["lines"] = {}, {}
    for name, y in (("w", -2.0), ("e", 2.0)):
        made["points"] |= {f"{name}1": {"position": [0, y, 8]}, f"{name}2": {"body": "it", "place": [0, y, 0]}}
        sections = [HUNG | {"length": 8.5, "drag": {"normal": 0.0}}]
        made["lines"][name] = {"start": f"{name}1", "end": f"{name}2", "sections": sections, "mesh": {"cells": 8}}
    with hybrid.static(made) as result:
        wet = 0.5 - result["bodies/it/position"][-1, 2] / 0.5
        assert 0.05 < wet < 0.95
        assert -result["bodies/it/force"][-1, 0] == pytest.approx(0.5 * RHO * 0.5 * 4.0 * wet, rel=1e-6)


def test_a_body_is_slowed_down_as_drag_and_added_mass_say() -> None:
    """m v' = -c v^2 from v0: v = v0 / (1 + c v0 t / m), pushed for a moment; m with the added mass of its members."""
    push = {"force": {"history": [[0, 0, 0, 0], [0.02, 4000, 0, 0], [1, 4000, 0, 0], [1.02, 0, 0, 0]]}}
    made = scene({}, body(**push), time={"duration": 4.0, "step": 0.01}, output={"every": 0.1, "points": 3})
    with hybrid.run(made) as result:
        m = RHO * 0.25 * np.pi * 0.25 * 4.0 * 2.0
        c = 0.5 * RHO * 0.5 * 4.0
        after = result.t >= 1.1 - 1e-9
        t, v = result.t[after] - 1.1, result["bodies/it/velocity"][after, 0]
        pull = np.abs(result["bodies/it/force"]).max()
        assert pull < 0.02 * 4000.0
        assert v == pytest.approx(v[0] / (1.0 + c * v[0] * t / m), rel=0.02)
        first = np.sqrt(4000.0 / c) * np.tanh(np.sqrt(4000.0 * c) / m)
        assert v[0] == pytest.approx(first / (1.0 + c * first * 0.09 / m), rel=0.01)


def test_waves_carry_a_small_body_along_with_the_water() -> None:
    """As heavy as its water and with Ca = 1: (m + m) a = (1 + 1) m a_water: it moves as the water at its place."""
    waves = {"kind": "regular", "height": 1.0, "period": 8.0, "ramp": 16.0}
    ends = ([-0.1, 0, 0], [0.1, 0, 0]), ([0, -0.1, 0], [0, 0.1, 0]), ([0, 0, -0.1], [0, 0, 0.1])
    members = [{"start": a, "end": b, "diameter": 0.1, "drag": 0.0, "added_mass": 1.0, "pieces": 2} for a, b in ends]
    volume = 3 * 0.25 * np.pi * 0.01 * 0.2
    # three cylinders across each other: each direction is across two of them
    given = body(members=members, mass=RHO * volume, volume=volume, inertia=[0.1, 0.1, 0.1], initial_guess=[0, 0, -10])
    given["mass"] = RHO * volume
    soft = {"length": 59.0, "mass": 1e-4, "diameter": 3e-4, "axial_stiffness": 0.05, "max_strain": 0.9}
    made = scene(
        {"surface": 0.0, "waves": waves},
        given,
        time={"duration": 40.0, "step": 0.05},
        output={"every": 0.5, "points": 3},
    )
    made["points"]["west"]["position"], made["points"]["east"]["position"] = [-61, 0, -10], [61, 0, -10]
    for line in made["lines"].values():
        line["sections"] = [soft]
    with hybrid.run(made) as result:
        w = 2 * np.pi / 8.0
        k = w * w / G
        late = result.t > 24.0  # two periods
        turns = np.exp(1j * w * result.t[late])
        v = 2.0 * np.abs((result["bodies/it/velocity"][late] * turns[:, None]).mean(axis=0))
        size = 0.5 * w * np.exp(k * result["bodies/it/position"][late, 2].mean())  # the lines let it sink
        m, push = RHO * volume, 2 * (2.0 / 3.0) * RHO * volume
        expected = size * push / (m + (2.0 / 3.0) * m)
        assert v[0] == pytest.approx(expected, rel=0.01)
        assert v[2] == pytest.approx(expected, rel=0.04)  # it drifts upwards


def test_energy_of_a_swinging_body_is_balanced_to_second_order() -> None:
    lost = []
    for step in (0.05, 0.0125):
        given = body(force={"history": [[0, 0, 0, 0], [0.25, 3000, 500, 0], [0.5, 0, 0, 0]]}, centre=[0, 0, -0.4])
        made = scene({"current": [0.5, 0.2, 0]}, given, time={"duration": 2.0, "step": step}, output={"every": 0.5})
        made["points"]["board"]["place"] = [0.8, 0.1, 0.5]
        for line in made["lines"].values():
            line["sections"] = [HUNG]
        with hybrid.run(made) as result:
            part = {key: result[f"bodies/it/{key}"] for key in
                    ("energy/kinetic", "energy/potential", "work/lines", "work/damping", "work/loads")}  # fmt: skip
            left = part["energy/kinetic"] + part["energy/potential"]
            left = left - left[0] - part["work/lines"] - part["work/damping"] - part["work/loads"]
            lost.append(float(np.abs(left).max()))
            assert abs(part["work/damping"][-1]) > 5.0
    assert lost[1] < 0.12 * lost[0] < 1.0, lost


@pytest.mark.parametrize(
    ("member", "words"),
    [
        ({"start": [0, 0, 0], "end": [0, 0, 0], "diameter": 0.5}, "other than that of the start"),
        ({"start": [0, 0, 0], "end": [0, 0, 1], "diameter": -0.5}, "diameter"),
        ({"start": [0, 0, 0], "end": [0, 0, 1], "diameter": 0.5, "pieces": 0}, "pieces"),
    ],
)
def test_what_is_no_member_is_refused(member: dict[str, Any], words: str) -> None:
    with pytest.raises(SceneError) as refused:
        hybrid.static(scene({}, body(members=[member])))
    assert words in str(refused.value)


def test_members_need_a_fluid() -> None:
    made = scene({}, body(volume=0.0))
    del made["environment"]["fluid"]
    with pytest.raises(SceneError, match="members"):
        hybrid.static(made)
