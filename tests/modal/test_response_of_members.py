"""Response and modes of bodies with members, and drag of a single harmonic: closed forms, and runs in time."""

from __future__ import annotations

import math

import numpy as np
import pytest

import hybrid
from hybrid.kernels.junctions.bodies import FRAME as AXES
from hybrid.kernels.junctions.bodies import STATE, V
from hybrid.linear.loaded_line import turning_doubts
from hybrid.linear.response_results import of_few, phases_of
from hybrid.model.network import build_network
from hybrid.scene.root import in_full
from tests.scenes import cable_scene, clamped_at, each_line, line_between, network_scene, pinned_at
from tests.simulation.test_vortices import G, body, floating, scene, small_body

ANCHORS = {"east": (150.0, 0.0), "north": (-75.0, 130.0), "south": (-75.0, -130.0)}
CHAIN = {"mass": 10.0, "diameter": 0.05, "axial_stiffness": 1e7, "drag": {"normal": 1.2}}
REGULAR = {"kind": "regular", "period": 7.0, "direction": 30.0, "ramp": 20.0}
# A slender frame, whose drag is as large as its inertia, and turns it about all axes.
FRAME = {
    "mass": 2.5e4, "inertia": [2e5, 2e5, 2e5], "volume": 45.0, "centre": [0, 0, -1.5], "centre_of_buoyancy": [0, 0, 0.5],
    "initial_guess": [0, 0, -12],
    "members": [
        {"start": [0, 0, -6], "end": [0, 0, 6], "diameter": 0.5, "drag": 4.0, "axial_drag": 0.05, "added_mass": 1.0},
        {"start": [-4, 2, -1], "end": [5, 2, 1], "diameter": 0.5, "drag": 4.0, "axial_drag": 0.1, "added_mass": 0.8},
        {"start": [1, -4, 2], "end": [2, 4, 5], "diameter": 0.6, "drag": 4.0, "added_mass": 0.8},
    ],
}  # fmt: skip
SPAR = {
    "mass": 4e4, "inertia": [3e6, 3e6, 3e4], "centre": [0, 0, -1.5], "initial_guess": [0, 0, -12],
    "hydrostatics": {"level": -9.0, "heave": 1.78e4, "roll": 1.5e6, "pitch": 1.5e6},
    "members": [{"start": [0, 0, -15], "end": [0, 0, 15], "diameter": 1.5, "drag": 1.0, "added_mass": 1.0}],
}  # fmt: skip


def moored(given, length, height, current=(0.0, 0.0, 0.0)):
    """A body on three lines in regular waves."""
    places = {"east": [1, 0, -3], "north": [-0.5, 0.87, -3], "south": [-0.5, -0.87, -3]}
    points = {x: {"position": [*place, -100]} for x, place in ANCHORS.items()}
    points |= {f"at_{x}": {"body": "hull", "place": place} for x, place in places.items()}
    section = CHAIN | {"length": length}
    lines = {x: {"start": x, "end": f"at_{x}", "sections": [section], "mesh": {"cells": 16}} for x in ANCHORS}
    fluid = {"density": 1025, "surface": 0.0, "current": [*current], "waves": REGULAR | {"height": height}}
    bed = {"z": -100.0, "stiffness": 1e4}
    return {"environment": {"fluid": fluid, "seabed": bed}, "points": points, "bodies": {"hull": given}, "lines": lines}


def deviations(tables, until, since):
    """Of shifts and turns of the body and of tensions at the fairleads: by frequency, and in time."""
    found = hybrid.response(tables)
    here = np.sqrt(0.5 * (np.abs(found.bodies["hull"]) ** 2).sum(axis=0))
    pulls = [x.deviation("tension")[-1] for x in found.lines.values()]
    time = {"time": {"duration": until, "step": 0.1}, "output": {"every": 0.25, "points": 17}}
    with hybrid.run(tables | time) as run:
        late = run.t > since
        moved, turned = run["bodies/hull/position"][late].std(axis=0), run["bodies/hull/rotation"][late].std(axis=0)
        tension = [run.lines[x].tension[late][:, -1].std() for x in found.lines]
    return np.array([*here, *pulls]), np.array([*moved, *np.radians(turned), *tension]), found


@pytest.mark.parametrize(("current", "most"), [((0.0, 0.0, 0.0), 0.02), ((0.5, 0.1, 0.0), 0.02)])
def test_a_frame_of_members_swings_as_in_time(current, most):
    """All six motions and tensions, in still water and in a current that is faster than the waves."""
    here, there, found = deviations(moored(FRAME, 167.0, 1.0, current), 260.0, 190.0)
    assert found.valid, found.notes
    np.testing.assert_allclose(here, there, rtol=most)


def test_a_spar_through_the_surface_swings_as_in_time():
    """In surge, sway, roll and pitch (it heaves by less than a millimetre); waves wet and dry a tenth of it."""
    here, there, found = deviations(moored(SPAR, 182.0, 2.0), 360.0, 290.0)
    assert not any("body hull" in x for x in found.notes)
    moves = [0, 1, 3, 4]
    np.testing.assert_allclose(here[moves], there[moves], rtol=0.025)


def test_a_small_body_goes_with_the_water():
    """Three cylinders across each other, each direction across two of them: (1 + 2/3 Ca) a = 2/3 (1 + Ca) a_water."""
    made, _ = small_body(50.0, {})
    with hybrid.static(made) as rest:
        depth = -rest["bodies/it/position"][-1, 2]
    moved = hybrid.response(made).bodies["it"][0]
    exact = 0.8 * 0.5 * math.exp(-((2.0 * math.pi / 8.0) ** 2) * depth / G)
    np.testing.assert_allclose(np.abs(moved[[0, 2]]), exact, rtol=1e-3)
    assert abs(np.angle(moved[2] / moved[0])) == pytest.approx(0.5 * math.pi, abs=1e-3)
    assert abs(moved[1]) < 1e-9 * exact


def test_it_says_where_members_are_not_linear():
    wetted = hybrid.response(moored(FRAME, 176.0, 3.0))
    assert any("of the members of body hull come out of the water" in x for x in wetted.notes) and not wetted.valid
    turn = np.array([[0.0, 0.0, 0.0, 0.0, 0.3, 0.0]], complex)
    assert not list(turning_doubts("hull", 0.9 * turn))
    assert list(turning_doubts("hull", turn)) == ["body hull turns by 0.21 rad (standard deviation)"]


BUOY = {
    "mass": 1.5e4, "inertia": [2e5, 2e5, 2e4], "centre": [0, 0, -1], "initial_guess": [0, 0, 0],
    "hydrostatics": {"level": 1.0, "heave": 5e4, "roll": 8e5, "pitch": 8e5},
    "members": [{"start": [0, 0, -6], "end": [0, 0, 6], "diameter": 0.6, "drag": 8.0, "added_mass": 1.0, "pieces": 40}],
}  # fmt: skip


@pytest.mark.long
def test_how_much_of_the_members_waves_may_wet():
    """A buoy of 6 m draft in waves of 0.9 and 1.9 m, which reach a quarter and half of it: told where it matters."""
    for height, most, told in ((0.9, 0.04, False), (1.9, 0.15, True)):
        here, there, found = deviations(moored(BUOY, 190.0, height), 260.0, 190.0)
        np.testing.assert_allclose(here[[0, 1, 3, 4]], there[[0, 1, 3, 4]], rtol=most)
        assert any("come out of the water" in x for x in found.notes) == told


def test_modes_have_the_added_mass_of_the_wetted_length_at_rest():
    """Whatever the first guess, as in a motion."""
    periods = []
    for guess in (-6.0, 0.0, 4.0):
        made = floating(initial_guess=[0, 0, guess])
        made["environment"]["fluid"]["current"] = [0, 0, 0]
        periods.append([x.period for x in hybrid.modes(made, count=6).modes])
    np.testing.assert_allclose(periods[1:], [periods[0]] * 2, rtol=1e-6)


def test_modes_do_not_depend_on_where_the_origin_of_a_body_is():
    """A frame that is told from 5 m beside, and 9 m below, its middle; its members push to the side as it turns."""
    shift, periods = np.array([3.0, -4.0, 9.0]), []
    for by in (np.zeros(3), shift):
        given = {x: list(FRAME[x] - by) for x in ("centre", "centre_of_buoyancy")} | {
            "initial_guess": [*(by - [0, 0, 12])]
        }
        ends = [{x: list(member[x] - by) for x in ("start", "end")} for member in FRAME["members"]]
        members = [member | each for member, each in zip(FRAME["members"], ends, strict=True)]
        made = moored(FRAME | given | {"members": members}, 167.0, 1.0)
        for point in made["points"].values():
            if "place" in point:
                point["place"] = list(point["place"] - by)
        periods.append([x.period for x in hybrid.modes(made, count=6).modes])
    np.testing.assert_allclose(*periods, rtol=1e-6)


def test_added_mass_of_members_couples_shifts_and_turns():
    """Of a cylinder below the origin, by hand: the integrals of a, a z and a z^2 of its added mass per length, a."""
    given = FRAME | {"members": [{"start": [0, 0, -12], "end": [0, 0, 0], "diameter": 1.5, "added_mass": 1.0}]}
    found = in_full(hybrid.validate_scene(moored(given, 167.0, 1.0)))
    row = np.zeros(STATE)
    row[2], row[AXES:V] = -40.0, np.eye(3).ravel()
    a = 1025.0 * 0.25 * math.pi * 1.5**2
    M = build_network(found).bodies[0].members.added_mass(row)
    np.testing.assert_allclose([M[0, 0], M[0, 4], M[1, 3]], [12 * a, -72 * a, 72 * a], rtol=1e-12)


def test_drag_of_a_single_harmonic():
    """8/(3 pi) of an amplitude along one way, the radius of a circle, and the tangent in a fast current."""
    one = phases_of(np.array([0.6]))
    ways = np.array([[0.7, 0.0], [0.7, 0.7j], [0.35 - 0.1j, 0.2j]])
    forth, circle, _ = of_few(np.zeros((3, 2)), ways[None], one)
    assert forth[0, 0] == pytest.approx(8.0 / (3.0 * math.pi) * 0.7, rel=2e-4) and abs(forth[1, 0]) < 1e-12
    np.testing.assert_allclose(circle, 0.7 * np.eye(2), atol=1e-12)
    fast = np.array([3.0, 4.0]) / 5.0
    near = of_few(100.0 * fast[None], ways[2:][None], one)[0]
    np.testing.assert_allclose(near, 100.0 * (np.eye(2) + np.outer(fast, fast)), atol=2e-3)
    # what the law makes of an ellipse in a current is the first harmonic of |u| u
    mean, x = np.array([[0.2, -0.1]]), ways[2:]
    angle = np.linspace(0.0, 2.0 * math.pi, 4001)[:-1]
    u = mean + (x * np.exp(-1j * angle)[:, None]).real
    first = 2.0 * (np.linalg.norm(u, axis=1)[:, None] * u * np.exp(1j * angle)[:, None]).mean(axis=0)
    np.testing.assert_allclose(of_few(mean, x[None], one)[0] @ x[0], first, rtol=1e-4)
    line = of_few(np.array([[0.3]]), np.array([[[0.5 + 0j]]]), one)[0, 0, 0]
    speed = 0.3 + 0.5 * np.cos(angle)
    assert line == pytest.approx(2.0 * (np.abs(speed) * speed * np.cos(angle)).mean() / 0.5, rel=1e-4)


def test_what_is_left_out_of_the_drag_of_members():
    """A member that stiff lines hold in waves of one harmonic: all they feel is c |u| u of it, as of a line.

    The whole load has sqrt(3/8) c U^2, its linear part 8/(3 pi sqrt 2) c U^2 (tests/modal/test_left_out.py).
    """
    member = {"start": [0, 0, -1], "end": [0, 0, 1], "diameter": 0.05, "drag": 200.0, "pieces": 2}
    waves = {"kind": "regular", "height": 1.0, "period": 8.0, "ramp": 10.0}
    wire = {"length": 99.8, "mass": 0.01, "diameter": 0.003, "axial_stiffness": 1e8}
    made = scene({"surface": 0.0, "waves": waves}, body(members=[member], inertia=[900.0] * 3))
    made = each_line(made, sections=[wire])
    part = math.sqrt(3.0 / 8.0) / (8.0 / (3.0 * math.pi) / math.sqrt(2.0)) - 1.0
    for line in hybrid.response(made).lines.values():
        assert line.left_out["tension"] == pytest.approx(part, rel=0.02)


def sunken(height, damping):
    """A buoyant body 20 m down on three taut ropes that surges with a period of 9.9 s, in a sea with a peak at 10 s."""
    ways = {"east": (1.0, 0.0), "north": (-0.5, 0.866), "south": (-0.5, -0.866)}
    points = {x: {"position": [60.0 * a, 60.0 * b, -90]} for x, (a, b) in ways.items()}
    points |= {f"at_{x}": {"body": "buoy", "place": [2 * a, 2 * b, -1]} for x, (a, b) in ways.items()}
    buoy = {
        "mass": 1.2e4, "volume": 24.0, "inertia": [3e4, 3e4, 3e4], "centre_of_buoyancy": [0, 0, 0.6],
        "initial_guess": [0, 0, -20], "damping": np.diag([damping] * 3 + [1e4] * 3).tolist(),
        "members": [{"start": [0, 0, -1.5], "end": [0, 0, 1.5], "diameter": 3.0, "drag": 1.6, "added_mass": 1.0}],
    }  # fmt: skip
    rope = {"length": 89.5, "mass": 6.0, "diameter": 0.08, "axial_stiffness": 2e6, "added_mass": {"normal": 1.0}}
    waves = {"kind": "pierson_moskowitz", "significant_height": height, "peak_period": 10.0, "depth": 100.0}
    return network_scene(
        points, {x: line_between(x, f"at_{x}", rope, mesh=8) for x in ways},
        fluid={"density": 1025, "surface": 0, "waves": waves | {"ramp": 10.0}}, bodies={"buoy": buoy}
    )  # fmt: skip


def at_a_point(made):
    """The same ropes at a free point with such a drag, mass and lift."""
    buoy = {"mass": 1.2e4, "volume": 24.0, "drag_area": 10.0, "added_mass": 2.17e4, "initial_guess": [0, 0, -20]}
    made["points"] = {x: made["points"][x] for x in made["lines"]} | {"buoy": buoy}
    for line in made["lines"].values():
        line["end"] = "buoy"
        line["sections"][0]["length"] = 91.5
    del made["bodies"]
    return made


@pytest.mark.parametrize(
    ("tables", "least", "most"),
    [
        (sunken(1.5, 0.0), 0.03, 0.08),
        (sunken(0.1, 3000.0), -0.01, 0.01),
        (at_a_point(sunken(1.5, 0.0)), 0.03, 0.08),
    ],
    ids=["drag of members", "linear damping", "drag of a point"],
)
@pytest.mark.long  # 7 s of 3 cases
def test_tension_near_a_resonance_that_drag_alone_damps(tables, least, most):
    """Too small by more than 3 %, which is told; and right where what damps it is linear, of which nothing is told.

    By the same waves at the same times, so that it is no matter of chance.
    """
    found = hybrid.response(tables)
    time = {"time": {"duration": 1800.0, "step": 0.1}, "output": {"every": 0.5, "points": 17}}
    with hybrid.run(tables | time) as run:
        late = run.t > 100.0
        for name, line in found.lines.items():
            there = run.lines[name].tension[late][:, 8].std()
            amplitudes = 0.5 * (line.tension[:, 3] + line.tension[:, 4])
            here = (np.exp(-2j * np.pi * np.outer(run.t[late], line.f)) @ amplitudes).real.std()
            assert least < there / here - 1.0 < most
    notes = [x for x in found.notes if "tension at s" in x]
    assert found.valid_for("tension") == (not notes) == (most < 0.03)
    assert all("of quadratic drag, of points, floats and bodies too," in x and "run it in time" in x for x in notes)


@pytest.mark.long  # 0.9 s
def test_tension_of_a_line_with_a_heavy_float_near_its_resonance():
    """As that of ropes at a free point."""
    rope = {"length": 183.0, "mass": 6.0, "diameter": 0.08, "axial_stiffness": 2e6, "added_mass": {"normal": 1.0}}
    held = {"kind": "float", "at": 91.5, "buoyancy": 1.2e5, "mass": 1.2e4, "drag_area": 5.8, "added_mass": 2.17e4}
    sea = sunken(0.4, 0.0)["environment"]
    ends = pinned_at(-60, 0, -90), pinned_at(60, 0, -90)
    tables = cable_scene(rope, *ends, attachments=[held], environment=sea, model="catenary", mesh=16)
    found = hybrid.response(tables)
    line, time = found.lines["cable"], {"duration": 1800.0, "step": 0.1}
    with hybrid.run(tables | {"time": time, "output": {"every": 0.5, "points": 17}}) as run:
        late = run.times > 100.0
        here = (np.exp(-2j * np.pi * np.outer(run.times[late], line.f)) @ line.tension[:, 3:5].mean(axis=1)).real.std()
        assert 0.03 < run.tension[late][:, 4].std() / here - 1.0 < 0.08
    assert not found.valid_for("tension")


def test_a_clamp_on_a_body_turns_with_it():
    pipe = {"length": 57.0, "mass": 30.0, "diameter": 0.15, "axial_stiffness": 1e8, "bending_stiffness": 2e5}
    leg = {"length": 69.0, "mass": 4, "diameter": 0.03, "axial_stiffness": 1e7, "drag": {"normal": 1.0}}
    heave, surge = ({"amplitude": 0.05, "period": 6.0} for _ in range(2))
    points = {
        "well": {"position": [0, 0, -60]}, "hang": {"body": "buoy", "place": [1, 0, -2]},
        "anchor": {"position": [-40, 0, -60], "motion": {"surge": surge, "heave": heave, "ramp": 12}},
        "tether": {"body": "buoy", "place": [-1, 0, -2]},
    }  # fmt: skip
    up = {"end": {"tangent": [0, 0, 1]}}
    lines = {
        "pipe": line_between("well", "hang", pipe | {"drag": {"normal": 1.0}}, mesh=20, model="rod", connections=up),
        "leg": line_between("anchor", "tether", leg, mesh=12),
    }
    six = [5e3, 5e3, 5e3, 3e3, 3e3, 3e3]
    buoy = {"initial_guess": [0, 0, -2], "mass": 5000, "volume": 9, "inertia": [9000] * 3, "centre": [0, 0, -1]}
    tables = network_scene(
        points, lines, bodies={"buoy": buoy | {"added_mass": six, "damping": six}},
        fluid={"density": 1025, "current": [0.2, 0, 0]}, time=(60, 0.03), output=(0.1, 20)
    )  # fmt: skip
    line, result = hybrid.response(tables).lines["pipe"], hybrid.run(tables)
    there = result.lines["pipe"].curvature[result.t > 36.0].std(axis=0)[-1]
    assert line.deviation("curvature")[-1] == pytest.approx(there, rel=0.04)  # 9.1e-5 for 2.1e-4 1/m


@pytest.mark.parametrize("flip", [False, True])
def test_a_clamp_that_pitches_takes_damping_with_it(flip):
    rod = {"length": 10.0, "mass": 5.0, "diameter": 0.1, "axial_stiffness": 1e7, "bending_stiffness": 2e4}
    rod |= {"torsional_stiffness": 1e4, "damping": {"stiffness": 0.5}}
    pitch = {"pitch": {"amplitude": 1.0, "period": 4.0}, "ramp": 8.0}
    clamp = clamped_at([0, 0, 0], [0, 0, 1 if flip else -1], motion=pitch)
    ends = ("free", clamp) if flip else (clamp, "free")
    tables = cable_scene(rod, *ends, mesh=20, fluid={"density": 1000}, time=(30, 0.02), output=(0.1, 11), model="rod")
    line, result = hybrid.response(tables).lines["cable"], hybrid.run(tables)
    at = -1 if flip else 0
    there = result.curvature[result.t > 18.0].std(axis=0)[[at, 5]]
    assert line.deviation("curvature")[[at, 10]] == pytest.approx(there, rel=0.02)  # 0.0145 for 0.0017 1/m


def test_drag_settles_in_whatever_order_lines_stand():
    def deviation(order):
        section = {"mass": 10, "diameter": 0.05, "axial_stiffness": 1e7, "drag": {"normal": 1.2}}
        surge = {"surge": {"amplitude": 0.05, "period": 8}, "heave": {"amplitude": 0.05, "period": 8}, "ramp": 16}
        points = {
            "east": {"position": [150, 0, -100]}, "west": {"position": [-150, 0, -100]},
            "vessel": {"position": [60, 0, 20], "motion": surge},
            "buoy": {"initial_guess": [0, 0, 5], "mass": 1000, "volume": 20, "drag_area": 4, "added_mass": 5000},
        }  # fmt: skip
        lines = {name: line_between(name, "buoy", section | {"length": 185}, mesh=12) for name in ("east", "west")}
        lines["hose"] = line_between("buoy", "vessel", section | {"length": 100}, mesh=12)
        fluid = {"density": 1025, "surface": 30, "current": [0.3, 0.1, 0]}
        tables = network_scene(points, {x: lines[x] for x in order}, fluid=fluid, time=(2, 0.1), output=(0.1, 11))
        return hybrid.response(tables).lines["hose"].deviation("tension")

    one, two = deviation(["east", "west", "hose"]), deviation(["hose", "west", "east"])
    np.testing.assert_allclose(one, two, rtol=1e-8)  # 4e-3
