"""Vortex-induced vibration: a cylinder on springs against its own equations, risers that were measured, and what stays."""

from __future__ import annotations

from math import pi, sqrt
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import hybrid
from hybrid.errors import SceneError
from tests.scenes import cable_scene, each_line, line_between, network_scene, pinned_at

# A cylinder of 1 m: kg, N/m, m; kg/m3; coefficients of the model.
MASS, SPRING, D, RHO, DRAG = 16.79, 1218.0, 0.1, 1000.0, 1.2
LIFT, CENTER, LOW, HIGH = 1.2, 0.144, 0.08, 0.206


def on_springs(U: float, step: float = 0.02, **more: Any) -> dict[str, Any]:
    """50 m of the cylinder in the middle of a taut string of two cells, which is its spring in both directions."""
    half, pull = 50.0, SPRING * 50.0**2 / 2
    stiffness = pull / 0.004
    length = half / (1 + pull / stiffness)
    section = {
        "length": 2 * length, "mass": MASS * half / length, "diameter": D, "axial_stiffness": stiffness,
        "max_strain": 0.2, "drag": {"normal": DRAG}, "added_mass": {"normal": 1.0},
        "vortices": {"lift": LIFT, "center": CENTER, "low": LOW, "high": HIGH},
    }  # fmt: skip
    return cable_scene(
        section, pinned_at(0, 0, 0), pinned_at(2 * half, 0, 0), gravity=0, fluid={"density": RHO, "current": [0, U, 0]},
        model="catenary", mesh=2, time=(40, step, 1.0), output={"every": 0.04, "points": 3, "exact": True}
    ) | more  # fmt: skip


def frequency(t: Any, x: Any) -> float:
    """Of crossings of the mean upwards, Hz."""
    x = x - x.mean()
    k = np.flatnonzero((x[1:] > 0) & (x[:-1] <= 0))
    return float(1.0 / np.diff(t[k] - x[k] * np.diff(t)[k] / (x[k + 1] - x[k])).mean())


def amplitude(x: Any) -> float:
    """sqrt(2) times the standard deviation, over the diameter of the cylinder."""
    return float(sqrt(2.0) * np.std(x) / D)


def by_equations(U: float) -> tuple[float, float]:
    """Amplitude and frequency of the cylinder, from its two motions, the phase and the two means, in continuous time."""
    inertia = MASS + RHO * pi / 4 * D**2

    def rate(t: float, y: Any) -> list[float]:
        x, z, vx, vz, phase, mean_v, mean_a = y
        u, w = U - vx, -vz  # of the water against the cylinder
        speed = sqrt(u * u + w * w)
        ex, ez = w / speed, -u / speed  # across it
        lift = 0.5 * RHO * D * LIFT * speed**2 * np.cos(phase)
        drag = 0.5 * RHO * D * DRAG * speed
        ax = (-SPRING * x + drag * u + lift * ex) / inertia
        az = (-SPRING * z + drag * w + lift * ez) / inertia
        v, a = vx * ex + vz * ez, ax * ex + az * ez
        S = np.sin(np.arctan2(-a / sqrt(mean_a), v / sqrt(mean_v)) - phase)
        f = CENTER + S * ((HIGH - CENTER) if S > 0 else (CENTER - LOW))
        decay = 0.17 * speed / (8 * D)
        return [vx, vz, ax, az, 2 * pi * f * speed / D, decay * (v * v - mean_v), decay * (a * a - mean_a)]

    start = [0.5 * RHO * D * DRAG * U**2 / SPRING, 0, 0, 0.01, pi, 1e-4, 1e-3]
    found = solve_ivp(rate, (0, 60), start, t_eval=np.arange(30, 60, 0.01), rtol=1e-8, atol=1e-10)
    return amplitude(found.y[1]), frequency(found.t, found.y[1])


@pytest.mark.long
@pytest.mark.parametrize("U", [0.45, 0.65])
def test_a_cylinder_on_springs_moves_as_its_equations_say(U: float) -> None:
    """In 50 steps a period; within the range of frequencies it locks in to."""
    found = hybrid.run(on_springs(U))
    late = found.t > 20.0
    size, f = amplitude(found.position[late, 1, 2]), frequency(found.t[late], found.position[late, 1, 2])
    expected, expected_f = by_equations(U)
    assert size == pytest.approx(expected, rel=2e-2)
    assert f == pytest.approx(expected_f, rel=5e-3)
    assert LOW < f * D / U < 1.05 * HIGH  # |u| is more than U where the cylinder moves
    if U == 0.65:  # published beside the model, of a cylinder that moves across the flow alone
        assert (size, f) == pytest.approx((0.89135, 1.11867), rel=2e-2)


@pytest.mark.long
def test_lock_in_has_a_range() -> None:
    """Beside the natural frequency, 1.12 Hz in water, the cylinder moves by most of a diameter; far from it hardly."""
    sizes = []
    for U in (0.25, 0.6, 2.5):
        found = hybrid.run(on_springs(U, 0.01 if U > 1 else 0.02))
        sizes.append(amplitude(found.position[found.t > 20.0, 1, 2]) / min(U, 1.0))
    assert sizes[1] > 1.2 and sizes[0] < 0.35 * sizes[1]
    assert sizes[2] / 2.5 < 0.6 * sizes[1]


def test_there_is_no_lift_at_rest() -> None:
    scene = on_springs(0.65)
    with_lift = hybrid.static(scene)
    del scene["cable"]["sections"][0]["vortices"]
    assert np.abs(with_lift.position - hybrid.static(scene).position).max() < 1e-9


def stepped_current(**vortices: float) -> dict[str, Any]:
    """Case 1 of F. Huera-Huarte's thesis (2006): a riser of 13.12 m, the lowest 45 % in 0.31 m/s."""
    L, wide = 13.12, 0.028
    area = pi / 4 * wide**2
    mass, stiffness = 3 * RHO * area, 1e5
    pull = 1175 - (mass - RHO * area) * 9.81 * L / 2
    length = L / (1 + pull / stiffness)
    flow = [(0.0, 0.31), (0.45 * L - 0.05, 0.31), (0.45 * L + 0.05, 0.0), (L, 0.0)]
    section = {
        "length": length, "mass": mass * L / length, "diameter": wide, "axial_stiffness": stiffness,
        "bending_stiffness": 29.88, "drag": {"normal": 1.2}, "added_mass": {"normal": 1.0}, "vortices": vortices,
    }  # fmt: skip
    return cable_scene(
        section, pinned_at(0, 0, 0), pinned_at(0, 0, L),
        fluid={"density": RHO, "current": [{"z": z, "velocity": [u, 0, 0]} for z, u in flow]}, model="rod", mesh=30,
        contact={"self": False}, time=(30, 0.025), output={"every": 0.05, "points": 51, "exact": True}
    )  # fmt: skip


@pytest.mark.long
@pytest.mark.parametrize(
    ("vortices", "beam_f", "beam_size"),
    [({}, 1.63, 0.85), ({"lift": 0.7, "center": 0.18, "low": 0.1, "high": 0.26}, 1.67, 0.52)],
    ids=["script", "MoorDyn"],
)
def test_a_riser_in_a_stepped_current(vortices: dict[str, float], beam_f: float, beam_size: float) -> None:
    """Measured: the second mode across the flow at 1.66 Hz; a linear beam with this model has beam_f and beam_size."""
    found = hybrid.run(stepped_current(**vortices))
    late = found.t > 15.0
    y = found.position[late][:, :, 1]
    sizes = sqrt(2.0) * y.std(axis=0) / 0.028
    at = int(sizes.argmax())
    f = frequency(found.t[late], y[:, at])
    assert f == pytest.approx(1.66, rel=0.05)
    assert (f, sizes[at]) == pytest.approx((beam_f, beam_size), rel=0.05)
    middle = sizes[(found.s > 6.0) & (found.s < 7.2)].min()
    assert middle < 0.35 * sizes[at]  # two half waves
    assert np.corrcoef(y[:, 13], y[:, 38])[0, 1] < -0.8


def catenary(model: Any = "rod", duration: float = 60.0, **more: Any) -> dict[str, Any]:
    """The riser that MoorDyn's test of its vortices has, after Thorsen's."""
    section = {
        "length": 23.71, "mass": 0.69, "diameter": 0.024, "axial_stiffness": 6.66e5, "bending_stiffness": 10.5,
        "drag": {"normal": 1.2, "tangential": 0.08}, "added_mass": {"normal": 2.0},
        "vortices": {"lift": 0.7, "center": 0.18, "low": 0.1, "high": 0.26},
    }  # fmt: skip
    return cable_scene(
        section, pinned_at(-21.0425, 0, -10), pinned_at(0, 0, -1), gravity=9.80665,
        fluid={"density": 1000, "current": [0.2, 0, 0]}, model=model, mesh=40, contact={"self": False},
        time=(duration, 0.04), output={"every": 0.08, "points": 51, "exact": True}
    ) | more  # fmt: skip


@pytest.mark.long
def test_a_catenary_riser_shakes_as_in_moordyn() -> None:
    """MoorDyn 2.7.2: 1.0497 Hz and 0.326 diameters at 0.66 of the length (its target 1.04 Hz), 20 to 60 s."""
    found = hybrid.run(catenary())
    late, at = found.t >= 20.0, int(np.argmin(np.abs(found.s - 0.66 * 23.71)))
    y = found.position[late, at, 1]
    assert frequency(found.t[late], y) == pytest.approx(1.0497, rel=0.15)
    assert sqrt(2.0) * y.std() / 0.024 == pytest.approx(0.326, rel=0.15)
    drag, potential = found["work/drag"], found["energy/potential"]
    lost = np.abs(found["work/scheme"]).max()
    assert np.ptp(drag) > 0.0 and lost < 0.05 * np.ptp(potential) + 0.2 * found["energy/kinetic"].max()


@pytest.mark.long
@pytest.mark.parametrize("model", ["adaptive", {"kind": "adaptive", "curvature_error": 0.05}], ids=["zones", "cells"])
def test_phases_go_along_where_zones_move(model: Any) -> None:
    """The amplitude of a riser whose cells and kinds change is that of rods everywhere."""
    sizes = []
    for x in ("rod", model):
        heave = {"heave": {"amplitude": 0.3, "period": 8}, "ramp": 8}
        scene = catenary(x, 30.0)
        scene["ends"]["end"]["motion"] = heave
        scene["mesh"] = {"cells": 20 if isinstance(x, dict) else 40}
        found = hybrid.run(scene)
        late = found.t > 15.0
        sizes.append(sqrt(2.0) * found.position[late][:, 5:-5, 1].std(axis=0).mean() / 0.024)
    assert sizes[0] > 0.15
    assert sizes[1] == pytest.approx(sizes[0], rel=0.2)


@pytest.mark.long
def test_a_shaking_riser_that_is_turned_is_the_same() -> None:
    one = hybrid.run(catenary(duration=8.0))
    turned = catenary(duration=8.0)
    turned["environment"]["fluid"]["current"] = [0, 0.2, 0]
    turned["ends"]["start"]["position"] = [0, -21.0425, -10]
    other = hybrid.run(turned)
    back = np.stack([other.position[..., 1], -other.position[..., 0], other.position[..., 2]], axis=-1)
    assert np.abs(back - one.position).max() < 1e-7 * 23.71


def test_frequencies_are_in_order() -> None:
    scene = on_springs(0.5)
    scene["cable"]["sections"][0]["vortices"] = {"low": 0.3}
    with pytest.raises(SceneError, match=r"between low, 0\.3, and high"):
        hybrid.validate_scene(scene)


# --- Morison members of bodies: drag, added mass and waves against closed forms, derivatives, energy, refusals ---

RHO_MEMBER, G = 1025.0, 9.81
SOFT = {"length": 99.0, "mass": 0.01, "diameter": 0.003, "axial_stiffness": 50.0, "max_strain": 0.9}

HUNG = {"length": 101.0, "mass": 2.0, "diameter": 0.03, "axial_stiffness": 1e6}


def body(**more: Any) -> dict[str, Any]:
    """A vertical cylinder of 4 m, diameter 0.5 m, as heavy as the water that it displaces."""
    volume = 0.25 * np.pi * 0.25 * 4.0
    base = {
        "initial_guess": [0, 0, -30], "mass": RHO_MEMBER * volume, "inertia": [900.0, 900.0, 40.0], "volume": volume,
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
        fluid={"density": RHO_MEMBER} | fluid, gravity=G, bodies={"it": given}
    ) | more  # fmt: skip


@pytest.mark.long
def test_a_current_pushes_with_the_drag_of_the_members() -> None:
    """1/2 rho D Cd L U^2 across, pi D Cd_t along, in equilibrium with the lines."""
    members = [{"start": [0, -2, 0], "end": [0, 2, 0], "diameter": 0.5, "drag": 0.9},
               {"start": [-1, 0, 0], "end": [1, 0, 0], "diameter": 0.2, "drag": 0.7, "axial_drag": 0.05}]  # fmt: skip
    made = scene({"current": [0.8, 0, 0]}, body(members=members))
    with hybrid.static(each_line(made, sections=[HUNG])) as result:
        force = result["bodies/it/force"][-1]
        expected = 0.5 * RHO_MEMBER * 0.64 * (0.5 * 0.9 * 4.0 + np.pi * 0.2 * 0.05 * 2.0)
        assert -force[0] == pytest.approx(expected, rel=1e-5)
        assert np.abs(result["bodies/it/moment"][-1, [0, 2]]).max() < 1e-9 * expected


def floating(**more: Any) -> dict[str, Any]:
    """The body upright at the surface, in a current; a line to each side."""
    members = [{"start": [0, 0, -2], "end": [0, 0, 2], "diameter": 0.5, "drag": 1.0, "added_mass": 1.0, "pieces": 8}]
    floats = {"hydrostatics": {"heave": 5e3, "roll": 1e9, "pitch": 1e9}, "volume": 0.0}
    given = body(**({"members": members, "centre_of_buoyancy": [0, 0, 0]} | floats | more))
    made = scene({"current": [0.8, 0, 0], "surface": 0.0}, given)
    made["points"]["west"]["position"], made["points"]["east"]["position"] = [-101, 0, -2], [101, 0, -2]
    return each_line(made, sections=[HUNG | {"drag": {"normal": 0.0}}])


@pytest.mark.parametrize("guess", [-6.0, -1.0, 0.0, 4.0])
def test_the_wetted_length_is_that_of_the_place_where_the_body_rests(guess: float) -> None:
    """Drag of a member through the surface, whatever the first guess; its hydrostatics are large numbers beside it."""
    with hybrid.static(floating(initial_guess=[0, 0, guess])) as result:
        wet = 2.0 - result["bodies/it/position"][-1, 2]
        assert 2.1 < wet < 3.0
        assert -result["bodies/it/force"][-1, 0] == pytest.approx(0.5 * RHO_MEMBER * 0.5 * 0.64 * wet, rel=1e-6)


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
        assert -result["bodies/it/force"][-1, 0] == pytest.approx(0.5 * RHO_MEMBER * 0.5 * 4.0 * wet, rel=1e-6)


def test_a_body_is_slowed_down_as_drag_and_added_mass_say() -> None:
    """m v' = -c v^2 from v0: v = v0 / (1 + c v0 t / m), pushed for a moment; m with the added mass of its members."""
    push = {"force": {"history": [[0, 0, 0, 0], [0.02, 4000, 0, 0], [1, 4000, 0, 0], [1.02, 0, 0, 0]]}}
    made = scene({}, body(**push), time={"duration": 4.0, "step": 0.01}, output={"every": 0.1, "points": 3})
    with hybrid.run(made) as result:
        m = RHO_MEMBER * 0.25 * np.pi * 0.25 * 4.0 * 2.0
        c = 0.5 * RHO_MEMBER * 0.5 * 4.0
        after = result.t >= 1.1 - 1e-9
        t, v = result.t[after] - 1.1, result["bodies/it/velocity"][after, 0]
        pull = np.abs(result["bodies/it/force"]).max()
        assert pull < 0.02 * 4000.0
        assert v == pytest.approx(v[0] / (1.0 + c * v[0] * t / m), rel=0.02)
        first = np.sqrt(4000.0 / c) * np.tanh(np.sqrt(4000.0 * c) / m)
        assert v[0] == pytest.approx(first / (1.0 + c * first * 0.09 / m), rel=0.01)


def small_body(depth: float, waves: dict[str, Any], **tables: Any) -> tuple[dict[str, Any], float]:
    """A body as heavy as its water between soft lines, and its volume, m3.

    Three cylinders across each other: each direction is across two of them.
    """
    ends = ([-0.1, 0, 0], [0.1, 0, 0]), ([0, -0.1, 0], [0, 0.1, 0]), ([0, 0, -0.1], [0, 0, 0.1])
    members = [{"start": a, "end": b, "diameter": 0.1, "drag": 0.0, "added_mass": 1.0, "pieces": 2} for a, b in ends]
    volume = 3 * 0.25 * pi * 0.01 * 0.2
    given = body(
        members=members, mass=RHO_MEMBER * volume, volume=volume, inertia=[0.1, 0.1, 0.1], initial_guess=[0, 0, -depth]
    )
    soft = {"length": 59.0, "mass": 1e-4, "diameter": 3e-4, "axial_stiffness": 0.05, "max_strain": 0.9}
    made = scene({"surface": 0.0, "waves": {"kind": "regular", "height": 1.0, "period": 8.0} | waves}, given, **tables)
    made["points"]["west"]["position"], made["points"]["east"]["position"] = [-61, 0, -10], [61, 0, -10]
    return each_line(made, sections=[soft]), volume


def test_waves_carry_a_small_body_along_with_the_water() -> None:
    """As heavy as its water and with Ca = 1: (m + m) a = (1 + 1) m a_water: it moves as the water at its place."""
    time = {"time": {"duration": 40.0, "step": 0.05}, "output": {"every": 0.5, "points": 3}}
    made, volume = small_body(10.0, {"ramp": 16.0}, **time)
    with hybrid.run(made) as result:
        w = 2 * np.pi / 8.0
        k = w * w / G
        late = result.t > 24.0  # two periods
        turns = np.exp(1j * w * result.t[late])
        v = 2.0 * np.abs((result["bodies/it/velocity"][late] * turns[:, None]).mean(axis=0))
        size = 0.5 * w * np.exp(k * result["bodies/it/position"][late, 2].mean())  # the lines let it sink
        m, push = RHO_MEMBER * volume, 2 * (2.0 / 3.0) * RHO_MEMBER * volume
        expected = size * push / (m + (2.0 / 3.0) * m)
        assert v[0] == pytest.approx(expected, rel=0.01)
        assert v[2] == pytest.approx(expected, rel=0.04)  # it drifts upwards


def test_energy_of_a_swinging_body_is_balanced_to_second_order() -> None:
    lost = []
    for step in (0.05, 0.0125):
        given = body(force={"history": [[0, 0, 0, 0], [0.25, 3000, 500, 0], [0.5, 0, 0, 0]]}, centre=[0, 0, -0.4])
        made = scene({"current": [0.5, 0.2, 0]}, given, time={"duration": 2.0, "step": step}, output={"every": 0.5})
        made["points"]["board"]["place"] = [0.8, 0.1, 0.5]
        with hybrid.run(each_line(made, sections=[HUNG])) as result:
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
