"""Natural modes against closed forms, published frequencies, and the compliance of joints by another way."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest
from typer.testing import CliRunner

import hybrid
from hybrid.cli.commands import app
from hybrid.linear.eigen import _every, _nearest
from hybrid.linear.matrices import linear_network
from hybrid.modal.api import _modes_on_mesh, equilibrium_of
from hybrid.scene.read import as_scene
from tests.scenes import cable_scene, line_between, network_scene
from tests.scenes import pinned_at as pinned

G = 9.81


def clamped(*place, **more):
    return {"kind": "clamped", "position": list(place), "tangent": [1, 0, 0], "normal": [0, 0, 1]} | more


def scene(sections, start, end, model, cells, gravity=0.0, **more):
    return hybrid.validate_scene(cable_scene(sections, start, end, gravity=gravity, model=model, mesh=cells, **more))


def string(cells, **more):
    """100 m under 100 kN, 10 kg/m."""
    section = {"length": 100.0, "mass": 10.0, "axial_stiffness": 1e9}
    return scene(section, pinned(0, 0, 0), pinned(100.01, 0, 0), "catenary", cells, **more)


def chain(cells):
    return scene({"length": 10.0, "mass": 1.0}, pinned(0, 0, 0), {"kind": "free"}, "catenary", cells, G)


def sag(cells, x=100.0, y=0.0, **more):
    """Span of 100 m with 1/77 of sag; lambda^2 = 19.2; x, y, more: of its end."""
    section = {"length": 99.990048, "mass": 10.0, "axial_stiffness": 2e8}
    return scene(section, pinned(0, 0, 0), pinned(x, y, 0, **more), "catenary", cells, G)


def omega(found):
    return np.array([2.0 * np.pi / x.period for x in found.modes])


@pytest.mark.long
def test_string_is_that_of_lumped_masses():
    """2/h sqrt(T/m) sin(n pi/2N), of which half waves lie in either direction; h and m are of the unstretched line."""
    cells = 40
    found = omega(hybrid.modes(string(cells), 8))
    speed = math.sqrt(1e5 / 10.0 * 1.0001)
    exact = 2.0 * cells / 100.01 * speed * np.sin(np.arange(1, 5) * np.pi / (2 * cells))
    np.testing.assert_allclose(found, np.repeat(exact, 2), rtol=1e-6)


CLOSED = {
    # zeros of J0: omega = z/2 sqrt(g/L)
    "hanging chain": (chain, (50, 100), np.array([2.404826, 5.520078, 8.653728]).repeat(2) / 2.0 * math.sqrt(G / 10.0)),
    # own finite elements, N to infinity (docs of the brief); across and in plane
    "sagging line": (sag, (100, 200), np.array([3.14213, 4.99833, 6.27986, 6.28369])),
    "pinned beam": (lambda n: beam(n, pinned), (40, 80), np.array([3.143143, 6.295576, 9.466544]).repeat(2)),
    "clamped beam": (lambda n: beam(n, clamped), (200, 400), np.array([3.207298, 6.424129, 9.659977]).repeat(2)),
}


def beam(cells, end):
    section = {
        "length": 100.0, "mass": 10.0 / 1.0001, "axial_stiffness": 1e9, "bending_stiffness": 1e5,
        "torsional_stiffness": 1e7,
    }  # fmt: skip
    return scene(section, end(0, 0, 0), end(100.01, 0, 0), "rod", cells)


@pytest.mark.long
@pytest.mark.parametrize("name", CLOSED)
def test_closed_forms_with_order_two(name):
    make, meshes, exact = CLOSED[name]
    coarse, fine = (hybrid.modes(make(n), exact.size) for n in meshes)
    off = [np.abs(omega(x) / exact - 1.0).max() for x in (coarse, fine)]
    print(f"{name}: off by {off[0]:.1e} and {off[1]:.1e}, order {math.log2(off[0] / off[1]):.2f}")
    assert off[1] < 2e-3
    assert 1.7 < math.log2(off[0] / off[1]) < 2.4
    # the error figure is about as large as the error
    figure = np.array([x.error / x.period for x in coarse.modes])
    true = np.abs(omega(coarse) / exact - 1.0)
    seen = true > 0.1 * true.max()
    ratio = figure[seen] / true[seen]
    assert ratio.min() > 0.7 and ratio.max() < 3.0


@pytest.mark.parametrize("more", [{"axial_stiffness": 1e8}, {}, {"axial_stiffness": 1e8, "rotary_inertia": 0.0}])
def test_no_mode_of_a_cantilever_without_tension_is_missing(more):
    """w = z^2/L^2 sqrt(EI/m), cos z cosh z = -1, of which there are two: as many as the factors count below a gap."""
    section = {"length": 5.0, "mass": 3.0, "diameter": 0.02, "bending_stiffness": 2000.0} | more
    made = scene(section, clamped(0, 0, 0), {"kind": "free"}, "rod", 100)
    found = hybrid.modes(made, 4)
    exact = np.array([1.875104, 4.694091]).repeat(2) ** 2 / 25.0 * math.sqrt(2000.0 / 3.0)
    np.testing.assert_allclose(omega(found), exact, rtol=1e-3)
    assert found.notes == ()
    assert _modes_on_mesh(made, 1.0, 4, None, True).eigen.missed == 0


def test_twist_of_a_rod():
    """omega = n pi/L sqrt(GJ/G_p) between two clamps, G_p = m d^2/8 of a round section; lumped, as the string is."""
    section = {"length": 10.0, "mass": 8.0, "diameter": 0.5, "bending_stiffness": 1e9, "torsional_stiffness": 1e3}
    cells = 20
    made = scene(section | {"axial_stiffness": 1e12}, clamped(0, 0, 0), clamped(10, 0, 0), "rod", cells)
    found = hybrid.modes(made, 3)
    speed = math.sqrt(1e3 / (8.0 * 0.25 / 8.0))
    half = np.arange(1, 4) * np.pi / (2 * cells)
    # spins belong to cells: those beside a clamp are half a cell away from it
    exact = 2.0 * cells / 10.0 * speed * np.sin(half)
    assert [x.what for x in found.modes] == ["twist"] * 3
    np.testing.assert_allclose(omega(found), exact, rtol=2e-3)
    assert all(np.abs(x.twists["cable"]).max() == pytest.approx(1.0) for x in found.modes)


def test_mass_on_a_string():
    """1000 kg in the middle of two strings of 50 m: x tan x = 1."""
    made = string(200, attachments=[{"kind": "clump", "at": 50.0, "mass": 1000.0}])
    found = omega(hybrid.modes(made, 2))
    np.testing.assert_allclose(found, 1.720667, rtol=2e-4)


def two_strings(cells):
    """1000 kg in the middle of two strings of 50 m and 10 kg/m under 100 kN, as two lines: half of it to each."""
    section = {"length": 50.0, "mass": 10.0, "axial_stiffness": 1e9}
    points = {
        "a": {"kind": "fixed", "position": [0, 0, 0]}, "b": {"kind": "fixed", "position": [100.01, 0, 0]},
        "p": {"kind": "free", "mass": 1000.0, "initial_guess": [50, 0, 0]},
    }  # fmt: skip
    more = {"sections": [section], "model": "catenary", "mesh": {"cells": cells}}
    lines = {"one": {"start": "a", "end": "p"} | more, "two": {"start": "p", "end": "b"} | more}
    return {"environment": {"gravity": 0.0}, "points": points, "lines": lines}


def as_cable(made):
    """The same tether without a name of its line."""
    line, points = made["lines"].pop("l"), made.pop("points")
    end = points["p"] | {"kind": "body"}
    ends = {"start": {"kind": "pinned", "position": points["a"]["position"]}, "end": end}
    of_line = {"model": line["model"], "mesh": line["mesh"], "initial": "equilibrium"}
    del made["lines"]
    return made | {"cable": {"sections": line["sections"]}, "ends": ends} | of_line


def tether(cells, point, **more):
    """50 m that weigh nothing in water, 40 kg/m with the water that moves along, under what weighs 4000 kg with it."""
    section = {
        "length": 50.0, "mass": 20.0, "diameter": math.sqrt(0.02 * 4.0 / math.pi), "axial_stiffness": 1e9,
        "added_mass": {"normal": 1.0},
    }  # fmt: skip
    line = {"start": "a", "end": "p", "sections": [section], "model": "catenary", "mesh": {"cells": cells}}
    points = {"a": {"kind": "fixed", "position": [0, 0, -60]}, "p": point}
    return {"environment": {"fluid": {"density": 1000.0}}, "points": points, "lines": {"l": line}} | more


FLOAT = {"kind": "free", "initial_guess": [0, 0, -10], "mass": 1000.0, "volume": 4.0, "added_mass": 3000.0}
EYE = {"kind": "fairlead", "body": "b", "place": [0, 0, 0]}
BODY = {"mass": 4000.0, "inertia": [1e3] * 3, "volume": 8.0, "initial_guess": [0, 0, -10]}
ENDS_OF_STRINGS = {
    "point of two lines": (two_strings(10), 1.0, "point p", 2),
    "point with added mass": (tether(10, FLOAT), 0.5, "point p", 1),
    "end with added mass": (as_cable(tether(10, FLOAT)), 0.5, "ends.end", 1),
    "body": (tether(10, EYE, bodies={"b": BODY}), 0.5, "body b", 1),
}


@pytest.mark.parametrize("name", ENDS_OF_STRINGS)
def test_energy_of_a_mass_at_the_end_of_a_string(name):
    """The shape is sin(x s/L) with x tan x = mL/M: the string has mL/2 (1 - sin 2x/2x), the mass M sin^2 x."""
    made, ratio, what, lines = ENDS_OF_STRINGS[name]
    x = {1.0: 0.860334, 0.5: 0.653271}[ratio]
    assert x * math.tan(x) == pytest.approx(ratio, rel=1e-5)
    of_line, of_mass = 0.5 * ratio * (1.0 - math.sin(2.0 * x) / (2.0 * x)), math.sin(x) ** 2
    part = of_mass / (of_line + of_mass)
    energy = dict(hybrid.modes(made, 2).modes[0].energy)
    (mass,) = [energy.pop(key) for key in list(energy) if key.startswith(what)]
    assert mass == pytest.approx(part, rel=2e-3)
    if lines == 1:
        assert sum(energy.values()) == pytest.approx(1.0 - part, rel=2e-2)
    else:
        assert [key.split()[0] for key in sorted(energy)] == ["one", "two"]
        assert list(energy.values()) == pytest.approx([0.5 * (1.0 - part)] * 2, rel=2e-2)


def test_riser_of_huera_huarte():
    """13.12 m of 28 mm in water, 1188.28 N at the top: 0.80865 .. 4.9822 Hz, computed by Huera-Huarte (2006)."""
    area = math.pi * 0.028**2 / 4.0
    mass = 3.0 * 1000.0 * area
    section = {
        "length": 13.12, "mass": mass, "diameter": 0.028, "bending_stiffness": 29.88, "axial_stiffness": 1e9,
        "torsional_stiffness": 1e3, "added_mass": {"normal": 1.0, "tangential": 0.0}, "rotary_inertia": 0.0,
    }  # fmt: skip
    pull = 1188.28 / 1e9 * 13.12
    weight = (mass - 1000.0 * area) * G * 13.12
    height = 13.12 + pull - 0.5 * weight * 13.12 / 1e9
    made = scene(
        section, pinned(0, 0, -20), pinned(0, 0, -20 + height), "rod", 200, G,
        fluid={"density": 1000.0, "surface": 0.0},
    )  # fmt: skip
    found = [x for x in hybrid.modes(made, 12).modes if x.what != "twist"]
    hertz = np.array([x.frequency for x in found])[::2]
    np.testing.assert_allclose(hertz[:6], [0.80865, 1.6211, 2.4411, 3.2722, 4.1181, 4.9822], rtol=4e-4)


def test_all_modes_have_all_the_mass():
    """Of ten cells: 27 modes of nine nodes, whose effective masses add up to what can move."""
    found = hybrid.modes(string(10), 27)
    assert len(found.modes) == 27
    np.testing.assert_allclose(sum(x.mass for x in found.modes), found.mass, rtol=1e-9)
    np.testing.assert_allclose(found.mass, 900.0, rtol=1e-12)
    first = found.modes[0]
    assert np.abs(first.shifts["cable"]).max() == pytest.approx(1.0)
    assert first.energy[first.what] > 0.9


@pytest.mark.long  # 2.6 s
def test_nearest_to_a_period():
    whole = hybrid.modes(sag(60), 10)
    some = hybrid.modes(sag(60), 3, near=whole.modes[5].period)
    away = np.abs(omega(whole) - omega(whole)[5])
    near = np.sort(omega(whole)[np.argsort(away)[:3]])
    np.testing.assert_allclose(omega(some), near, rtol=1e-9)
    assert not some.notes


@pytest.mark.long  # 3.5 s
def test_turned_scenes_have_the_same_periods():
    """About the vertical."""
    c, s = math.cos(0.7), math.sin(0.7)
    one, found = hybrid.modes(sag(60), 6), hybrid.modes(sag(60, 100 * c, 100 * s), 6)
    np.testing.assert_allclose(omega(found), omega(one), rtol=1e-9)
    assert [x.what for x in found.modes] == [x.what for x in one.modes]


BUOY = {
    "mass": 50.0, "inertia": [5.0, 6.0, 7.0], "volume": 0.2, "centre_of_buoyancy": [0, 0, 0.3],
    "initial_guess": [0.0, 0.0, -20.0],
}  # fmt: skip


def moored(cells=20, **body):
    """A buoy, all of it in water, over its anchor on a light line, its fairlead 0.5 m below its origin."""
    line = {"length": 30.0, "mass": 1e-3, "diameter": 1e-3, "axial_stiffness": 1e9}
    return (network_scene(
        {"anchor": {"kind": "fixed", "position": [0, 0, -50]},
         "eye": {"kind": "fairlead", "body": "buoy", "place": [0, 0, -0.5]}},
        {"tether": line_between("anchor", "eye", line, model="catenary", mesh=cells)}, fluid={"density": 1000.0},
        bodies={"buoy": BUOY | body}
    ))  # fmt: skip


def test_moored_body():
    """A rigid pendulum on a massless line, upside down in water: two freedoms in each upright plane.

    With x the origin's shift and q its tilt, B the buoyancy, W the weight, T = B - W, a and b the arms of the eye and
    of the centre of buoyancy:  M x'' = -T (x + a q)/L,  J q'' = -T a (x + a q)/L - (T a + B b) q.
    """
    found = hybrid.modes(moored(), 8)
    B, W, L, a, b = 1000.0 * 0.2 * 9.80665, 50.0 * 9.80665, 30.0, 0.5, 0.3
    T = B - W
    for inertia, what in ((6.0, ("surge", "pitch")), (5.0, ("sway", "roll"))):
        K = np.array([[T / L, T * a / L], [T * a / L, T * a * a / L + T * a + B * b]])
        w = np.sqrt(np.linalg.eigvals(np.linalg.solve(np.diag([50.0, inertia]), K)).real)
        for value, word in zip(np.sort(w), what, strict=True):
            near = [x for x in found.modes if x.what == f"body buoy, {word}"]
            assert 2.0 * math.pi / near[0].period == pytest.approx(value, rel=1e-4)
    assert found.notes == ("what nothing holds has no period and is left out: body buoy, yaw",)


def test_joints_give_way_as_the_solver_says():
    """(K + ca M)^-1 at points and bodies is the compliance that the junctions of the solver have from its factors."""
    network = as_scene(PIPE)
    rest = equilibrium_of(network)
    solver, states = rest.solver, rest.states
    network = linear_network(solver, states, rest.names, False)
    m = 3 * len(rest.points) + 6 * len(rest.bodies)
    assert (len(rest.points), len(rest.bodies)) == (1, 1)
    for ca in (0.0, 0.5):
        theirs = solver.compliance(states, max(ca, solver.anchor))
        A = (network.stiffness + network.skew + max(ca, solver.anchor) * network.mass).toarray()
        ours = np.linalg.inv(A)[-m:, -m:]
        np.testing.assert_allclose(ours, theirs, rtol=0, atol=1e-6 * np.abs(theirs).max())


PIPE = network_scene(
    {"bed": {"kind": "fixed", "position": [0, 0, -60]}, "east": {"kind": "fixed", "position": [60, 0, -60]},
     "ring": {"kind": "free", "mass": 20.0, "volume": 0.05, "initial_guess": [30, 0, -30]},
     "hang": {"kind": "fairlead", "body": "buoy", "place": [0.5, 0, -1.0]},
     "side": {"kind": "fairlead", "body": "buoy", "place": [0.8, 0.2, 0.0]}},
    {"pipe": line_between("bed", "hang",
                          {"length": 59.5, "mass": 12.0, "diameter": 0.1, "axial_stiffness": 1e6,
                           "bending_stiffness": 2e3, "torsional_stiffness": 1e3},
                          model="rod", mesh=30,
                          connections={"end": {"kind": "clamped", "tangent": [0, 0, 1], "normal": [1, 0, 0]}}),
     "leg": line_between("east", "ring", {"length": 45.0, "mass": 3.0, "diameter": 0.02, "axial_stiffness": 1e6},
                         model="catenary", mesh=15),
     "guy": line_between("ring", "side", {"length": 45.0, "mass": 3.0, "diameter": 0.02, "axial_stiffness": 1e6},
                         model="catenary", mesh=15)},
    fluid={"density": 1025.0, "current": [0.3, 0, 0]},
    bodies={"buoy": {"mass": 900.0, "inertia": [300.0, 300.0, 200.0], "initial_guess": [0.0, 0.0, 0.0],
                     "hydrostatics": {"level": 0.0, "heave": 2e4, "roll": 4e4, "pitch": 4e4}}}
)  # fmt: skip


@pytest.mark.long  # 2.7 s
def test_friction_holds_what_lies_on_the_bed():
    section = {"length": 60.0, "mass": 5.0, "axial_stiffness": 1e7}
    bed = {"z": 0.0, "stiffness": 1e5, "friction": 0.6}
    made = scene(section, pinned(0, 0, 0), pinned(45, 0, 20), "catenary", 60, G, seabed=bed)
    stuck, smooth = (hybrid.modes(made, 6, friction=x) for x in (True, False))
    rest = smooth.position["cable"][:, 2] < 0.0
    sideways = [max(np.abs(x.shifts["cable"][rest, 1]).max() for x in each.modes[:3]) for each in (stuck, smooth)]
    assert sideways[0] < 0.05 and sideways[1] > 0.2


def test_periods_that_meet_and_what_turns_freely():
    motion = {"heave": {"amplitude": 0.1, "period": 1.27}, "ramp": 1.0}
    (note,) = hybrid.modes(sag(40, motion=motion), 3).notes
    assert note == "ends.end.motion.heave has a period of 1.27 s, near that of mode 2 (1.257 s)"


def test_what_is_refused():
    with pytest.raises(hybrid.SceneError, match="a number of modes from 1 to 200"):
        hybrid.modes(string(10), 0)
    with pytest.raises(hybrid.SceneError, match="a number of modes from 1 to 200"):
        hybrid.modes(chain(10), count=2.5)
    with pytest.raises(hybrid.SceneError, match="a period > 0"):
        hybrid.modes(string(10), 3, near=-1.0)


@pytest.mark.long  # 1.9 s
def test_the_command(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "sag.yaml").write_text(hybrid.scene_text(sag(40)))
    told = CliRunner().invoke(app, ["modes", "sag.yaml", "--count", "4", "--plot", "sag.svg"])
    assert told.exit_code == 0, told.output
    assert "4 modes on 40 cells" in told.output and "sideways 100 %" in told.output
    assert "<dc:title>hybrid-cable</dc:title>" in (tmp_path / "sag.svg").read_text()
    told = CliRunner().invoke(app, ["modes", "sag.yaml", "--count", "2", "--json"])
    (line,) = [x for x in map(json.loads, told.output.splitlines()) if x.get("event", x.get("kind")) == "modes"]
    assert [round(x["period"], 3) for x in line["modes"]] == [2.0, 1.257]
    assert _modes_on_mesh(sag(40), 1.0, 2, None, True).eigen.missed == 0


def test_a_line_that_is_paid_out_has_those_of_its_first_length():
    end = pinned(0, 0, 0, payout={"rate": 0.2, "ramp": 2.0})
    section = {"length": 10.0, "mass": 1.0, "axial_stiffness": 1e6}
    made = scene(section, end, {"kind": "free"}, "catenary", 20, G, time={"duration": 5.0, "step": 0.05})
    found = hybrid.modes(made, 2)
    assert omega(found)[0] == pytest.approx(2.404826 / 2.0 * math.sqrt(G / 10.0), rel=5e-3)
    assert any("of its first length" in x for x in found.notes)


@pytest.mark.parametrize("made", [string(12), chain(40), sag(40)], ids=["pairs of one frequency", "hangs", "sags"])
def test_blocks_find_the_modes_of_the_whole_matrix(made) -> None:
    """Both of two modes of one frequency among them, and all that there are of a small network."""
    rest = equilibrium_of(made)
    network = linear_network(rest.solver, rest.states, rest.names, True)
    found = [
        np.sort(by(network.stiffness, network.mass, -1e-3 * network.slow, 20)[0])[:16] for by in (_every, _nearest)
    ]
    assert np.abs(found[1] / found[0] - 1.0).max() < 1e-9


def test_the_largest_shift_of_a_mode_is_1_m_whatever_its_direction():
    for turned in (0.0, 0.7):
        found = hybrid.modes(sag(20, 100.0 * math.cos(turned), 100.0 * math.sin(turned)), count=3).modes
        assert [np.linalg.norm(x.shifts["cable"], axis=1).max() for x in found] == pytest.approx([1.0] * 3)


@pytest.mark.parametrize("cells", [4, 10])
def test_few_cells_that_do_not_stretch_have_modes(cells):
    periods = []
    for more in ({}, {"axial_stiffness": 1e9}):
        section = {"length": 50, "mass": 5, "diameter": 0.03} | more
        tables = cable_scene(section, pinned(0, 0, 0), pinned(30, 0, -30), model="catenary", mesh=cells)
        periods.append([x.period for x in hybrid.modes(tables, 4).modes])
    assert periods[0] == pytest.approx(periods[1], rel=1e-4)


def test_the_longest_periods_are_there_however_many_modes_are_asked_for():
    section = {"length": 200.0, "mass": 1.2, "diameter": 0.02, "axial_stiffness": 2.4e7}
    rov = {"kind": "body", "mass": 20000.0, "volume": 19.5, "initial_guess": [0, 0, -200]}
    tables = cable_scene(section, pinned(0, 0, 0), rov, model="catenary", mesh=10, fluid={"density": 1000}, dimension=3)
    few, many = hybrid.modes(tables, 4), hybrid.modes(tables, 30)
    assert [x.period for x in many.modes[:4]] == pytest.approx([x.period for x in few.modes], rel=1e-6)
    assert not any("nothing holds" in x for x in many.notes)
