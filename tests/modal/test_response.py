"""Response by frequency against closed forms, and against runs in time."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest
from typer.testing import CliRunner

import hybrid
from hybrid.cli.commands import app
from hybrid.linear.response_results import LineResponse, Response, across, along, of_few, phases_of, size_deviation
from hybrid.scene.combinations import RESPONSE_TO_MOTION
from hybrid.statistics.fatigue import damage
from tests.scenes import cable_scene, clamped_at, pinned_at

T_N = {"kind": "T-N", "log_a": 3.0, "m": 3.0}

REGULAR = {"kind": "regular", "height": 1.0, "period": 7.0, "ramp": 10, "depth": 100}
STORM = {"kind": "jonswap", "significant_height": 4.0, "peak_period": 12.0, "direction": 30, "ramp": 10, "depth": 100}


def hung(waves=None, motion=None, model="catenary", end=(6, 0, -5.15), cells=60, **section):
    """A line of 60 m in water, between a place 65 m down and one 5 m down."""
    line = {
        "length": 60.0, "mass": 30.0, "diameter": 0.1, "axial_stiffness": 5e6, "bending_stiffness": 2e3,
        "torsional_stiffness": 1e3, "drag": {"normal": 1.2}, "added_mass": {"normal": 1.0},
    } | section  # fmt: skip
    fluid = {"density": 1025, "surface": 0} | ({"waves": waves} if waves else {})
    ends = pinned_at(0, 0, -65), pinned_at(*end, **({"motion": motion} if motion else {}))
    line = {k: x for k, x in line.items() if x is not None}
    return cable_scene(line, *ends, fluid=fluid, model=model, mesh=cells, time=(10.0, 0.1))


def test_linear_drag_of_a_normal_velocity():
    """sqrt(8/pi) sigma along one direction, 1.87997 sigma in all; with a mean of one sigma 2.33326."""
    one, both = np.diag([1.0, 1e-14])[None], np.eye(2)[None]
    still, flow = np.zeros((1, 2)), np.array([[1.0, 0.0]])
    assert across(still, one)[0, 0, 0] == pytest.approx(math.sqrt(8.0 / math.pi), rel=2e-3)
    assert across(still, both)[0] == pytest.approx(1.87997 * np.eye(2), abs=1e-4)
    assert across(flow, one)[0, 0, 0] == pytest.approx(2.33326, rel=2e-3)
    assert across(np.zeros((1, 3)), np.eye(3)[None])[0, 0, 0] == pytest.approx(4 / 3 * math.sqrt(8 / math.pi), rel=5e-3)
    np.testing.assert_allclose(along(np.array([0.0, 1.0]), np.ones(2)), [1.59577, 2.33326], rtol=1e-5)
    # of the size of a vector: Rayleigh's, and that along the mean where this is large
    found = size_deviation(np.array([0.0, 50.0]), np.repeat(both, 2, axis=0))
    np.testing.assert_allclose(found, [math.sqrt(2.0 - math.pi / 2.0), 1.0], rtol=1e-3)


@pytest.mark.parametrize("w", [[0.6, 0.97], [0.4, 0.8], [0.5, 0.71, 1.03]])
def test_linear_drag_of_few_harmonics(w):
    """What leaves least of |u| u in the mean square, of the sum in time: of two that drift apart, an octave, three."""
    draw = np.random.default_rng(3)
    x = draw.normal(size=(len(w), 1, 2)) + 1j * draw.normal(size=(len(w), 1, 2))
    mean, t = np.array([[0.3, -0.1]]), 2000.0 * np.pi / 0.4 * (np.arange(200_000) + 0.5) / 200_000
    moved = (np.exp(-1j * np.outer(t, w)) @ x[:, 0]).real
    u = mean + moved
    best = np.linalg.lstsq(moved, np.linalg.norm(u, axis=1)[:, None] * u, rcond=None)[0].T
    np.testing.assert_allclose(of_few(mean, x, phases_of(np.array(w)))[0], best, rtol=0.01, atol=0.01 * best.max())
    assert phases_of(np.linspace(0.3, 1.7, 11)) is None


def test_bar_that_is_moved_at_its_end():
    """EA k cot(k L) of a bar of 100 m, EA 1e7 N, 10 kg/m at 10 rad/s: 64209.3 N/m; order two."""
    off = []
    for cells in (25, 50):
        tables = cable_scene(
            {"length": 100.0, "mass": 10.0, "axial_stiffness": 1e7}, pinned_at(0, 0, 0),
            pinned_at(100.1, 0, 0, motion={"surge": {"amplitude": 0.01, "period": 2.0 * math.pi / 10.0}, "ramp": 1.0}),
            gravity=0.0, model="catenary", mesh=cells
        )  # fmt: skip
        line = hybrid.response(tables).lines["cable"]
        assert line.f == pytest.approx([10.0 / (2.0 * math.pi)])
        # the tension of the last cell is that of its middle
        k = 0.01
        exact = 1e7 * k * math.cos(k * (100.0 - 50.0 / cells)) / math.sin(k * 100.0)
        off.append(abs(abs(line.tension[0, -1]) / 0.01 / exact - 1.0))
    assert off[1] < 5e-4 and 1.8 < math.log2(off[0] / off[1]) < 2.2


def compare(tables, duration, seeds=(1,), step=0.05, late=0.25):
    """Standard deviations of tension at five places by frequency, and the mean of those of runs."""
    response = hybrid.response(tables)
    line = response.lines["cable"]
    places = [3.0, 15.0, 30.0, 45.0, 57.0]
    there = []
    for seed in seeds:
        data = json.loads(json.dumps(tables))
        if "waves" in data["environment"]["fluid"] and data["environment"]["fluid"]["waves"]["kind"] == "jonswap":
            data["environment"]["fluid"]["waves"]["seed"] = seed
        data |= {"time": {"duration": duration, "step": step}, "output": {"every": 0.25, "points": places}}
        result = hybrid.run(data)
        there.append(result.tension[result.times > late * duration].std(axis=0))
    return response, np.interp(places, line.middle, line.deviation("tension")), np.mean(there, axis=0)


def test_a_moved_end_as_in_time():
    motion = {"surge": {"amplitude": 0.05, "period": 7.0}, "ramp": 10.0}
    response, here, there = compare(hung(motion=motion), 150.0)
    np.testing.assert_allclose(here, there, rtol=5e-3)
    assert response.valid and response.rounds < 10


def leg(waves):
    """A leg of fibre rope, 0.6 % stretched, where drag is most of what damps it."""
    rope = {"length": 133.7, "mass": 6.0, "diameter": 0.08, "axial_stiffness": 2e6, "bending_stiffness": 0.0}
    tables = hung(waves, end=(100, 0, -5), torsional_stiffness=0.0, **rope)
    tables["ends"]["start"]["position"] = [0, 0, -95]
    return tables


def test_one_component_is_one_wave():
    """A spectrum of one component is the regular wave of its energy, with the fatigue of equal cycles."""
    sea = STORM | {"significant_height": 2.0, "peak_period": 8.0, "components": 1}
    one = hybrid.response(leg(sea)).lines["cable"]
    wave = {"kind": "regular", "height": math.sqrt(2.0), "period": float(1.0 / one.f[0]), "direction": 30, "depth": 100}
    same = hybrid.response(leg(wave)).lines["cable"]
    for name in ("tension", "curvature"):
        np.testing.assert_allclose(one.deviation(name), same.deviation(name), rtol=1e-5)
    ranges = 2.0 * np.abs(one.tension[0]) / 1e4
    np.testing.assert_allclose(one.damage(T_N, 1e4, hours=2.0), 7200.0 * one.f[0] * ranges**3 / 1e3, rtol=1e-12)
    t = np.exp(-2j * np.pi * np.linspace(0.0, 1.0, 4001)[:-1])[:, None]
    size = np.hypot(one.mean_curvature + (t * one.curvature[0]).real, (t * one.curvature_across[0]).real)
    np.testing.assert_allclose(one.deviation("curvature")[1:-1], size.std(axis=0)[1:-1], rtol=2e-3)


@pytest.mark.needs("rainflow")
def test_few_components_as_in_time():
    """Two components: drag and fatigue of their sum, which is no sea (by a normal law 7 % less tension)."""
    tables = leg(STORM | {"significant_height": 2.0, "peak_period": 8.0, "components": 2})
    response, here, there = compare(tables, 1200.0, step=0.15)
    np.testing.assert_allclose(here, there, rtol=0.015)
    line = response.lines["cable"]
    x = (np.exp(-2j * np.pi * np.outer(np.arange(0.0, 7200.0, 0.1), line.f)) @ line.tension[:, 30]).real
    assert line.damage(T_N, 1e4, hours=2.0)[30] == pytest.approx(float(damage(x, T_N, 1e-4)), rel=0.02)
    assert response.valid_for("tension")


def test_what_is_left_out_counts_more_where_ends_move():
    """More than half of it comes true there: 4 % are too much, which waves alone may leave out."""
    tables = leg(STORM | {"significant_height": 2.0, "peak_period": 8.0})
    found = hybrid.response(tables)
    assert 0.04 < found.lines["cable"].left_out["tension"].max() < 0.045 and found.valid_for("tension")
    tables["ends"]["end"]["motion"] = {"surge": {"amplitude": 1e-4, "period": 8.0}, "ramp": 16.0}
    found = hybrid.response(tables)
    assert found.lines["cable"].left_out["tension"].max() > 0.025 and not found.valid_for("tension")


def test_a_float_on_a_catenary_makes_a_kink_and_no_curvature():
    """At the float, and beside it, as in time; the kink itself would be several times as much, and grow with the mesh."""
    tables = hung(motion={"surge": {"amplitude": 0.05, "period": 7.0}, "ramp": 10.0})
    tables["cable"]["attachments"] = [
        {"kind": "float", "at": 30.0, "buoyancy": 2000.0, "mass": 100.0, "drag_area": 0.6}
    ]
    line = hybrid.response(tables).lines["cable"]
    places = [15.0, 29.0, 30.0, 31.0, 45.0]
    result = hybrid.run(
        tables | {"time": {"duration": 105.0, "step": 0.05}, "output": {"every": 0.25, "points": places}}
    )
    s, there = result.both_sides("curvature")
    there = there[result.times > 35.0].std(axis=0)
    here = np.interp(s, line.s, line.deviation("curvature"))
    sides = np.flatnonzero(s == 30.0)
    assert sides.size == 2 and there[sides].min() * 0.9 < here[sides[0]] < there[sides].max() * 1.1
    np.testing.assert_allclose(np.delete(here, sides), np.delete(there, sides), rtol=0.05)


def test_a_rod_that_a_clamp_turns_as_in_time():
    """The frame of an end that pitches bends the rod beside it."""
    tables = hung(model="rod", cells=80, damping=0.3, bending_stiffness=2e5)
    tables["ends"]["end"] = clamped_at(
        [6, 0, -5.15], [0.1, 0, 1], motion={"pitch": {"amplitude": 0.5, "period": 5.0}, "ramp": 10.0}
    )
    line = hybrid.response(tables).lines["cable"]
    tables |= {"time": {"duration": 60.0, "step": 0.02}, "output": {"every": 0.1, "points": [50.0, 58.0, 60.0]}}
    result = hybrid.run(tables)
    there = result.curvature[result.times > 30.0].std(axis=0)
    here = np.interp([50.0, 58.0, 60.0], line.s, line.deviation("curvature"))
    np.testing.assert_allclose(here, there, rtol=0.03)


def test_what_hardly_varies_is_not_resolved(tmp_path):
    """In short waves the lower end bends by less than a fifth of the upper one, or what is left out there is much of it,

    and the command says so.
    """
    waves = {"kind": "jonswap", "significant_height": 1.0, "peak_period": 5.0, "direction": 30, "depth": 100}
    line = hybrid.response(hung(waves)).lines["cable"]
    known, deviation = line.resolved("curvature"), line.deviation("curvature")
    assert not known[3] and known[57]
    much = line.left_out["curvature"] > 0.055
    assert (known == (deviation >= 0.2 * deviation.max()) & ~much).all() and (
        much & (deviation > deviation[known].min())
    ).any()
    (tmp_path / "scene.yaml").write_text(json.dumps(hung(waves)))
    out = CliRunner().invoke(app, ["response", str(tmp_path / "scene.yaml")])
    assert "curvature is not known where" in out.output.replace("\n", " "), out.output


def test_waves_of_many_directions_as_in_time(tmp_path):
    """Given waves of 12, 8 and 6 s from three directions: the line swings in both planes, as it does over 24 s.

    Low and damped, what has the square of the waves is 0.4 % (2 % of waves three times as high).
    """
    rows = [f"{a},{2 * math.pi / period!r},{to},{phase}" for a, period, to, phase in
            ((0.05, 12, 20, 10), (0.03, 8, 140, 200), (0.02, 6, -75, 70))]  # fmt: skip
    (tmp_path / "sea.csv").write_text("\n".join(["amplitude,frequency,direction,phase", *rows]))
    waves = {"kind": "components", "file": str(tmp_path / "sea.csv"), "depth": 100, "ramp": 24}
    tables = hung(waves, cells=40, damping=5.0)
    response = hybrid.response(tables)
    line = response.lines["cable"]
    assert line.f == pytest.approx([1 / 12, 1 / 8, 1 / 6])
    tables |= {"time": {"duration": 96.0, "step": 0.2}, "output": {"every": 0.2, "points": [15.0, 30.0, 45.0]}}
    result = hybrid.run(tables)
    late = (result.times > 48.0) & (result.times <= 96.0)
    there = result.position[late].std(axis=0)
    at = [int(np.argmin(np.abs(line.s - s))) for s in (15.0, 30.0, 45.0)]
    here = line.deviation("position")[at]
    np.testing.assert_allclose(here, there, rtol=6e-3)
    tension = result.tension[late].std(axis=0)
    np.testing.assert_allclose(np.interp([15, 30, 45], line.middle, line.deviation("tension")), tension, rtol=6e-3)
    assert here[:, 1].min() > 0.3 * here[:, 0].min()


def test_a_line_that_is_turned_with_its_waves_has_the_same_response():
    one, other = (
        hybrid.response(x).lines["cable"] for x in (hung(STORM), hung(STORM | {"direction": 120}, end=(0, 6, -5.15)))
    )
    for name in ("tension", "curvature"):
        ours = one.deviation(name)
        np.testing.assert_allclose(other.deviation(name), ours, rtol=1e-6, atol=1e-7 * ours.max())


@pytest.mark.slow
def test_a_storm_as_in_hours_of_it():
    """The mean of six hours: 605, 607, 614, 627, 645 N.  Not said to be valid: of the 6.9 % that are left out of tension about

    half comes true in general, here less.
    """
    response, here, there = compare(hung(STORM, cells=30), 3600.0, seeds=range(1, 7), step=0.15, late=0.05)
    print(here, there)
    np.testing.assert_allclose(here, there, rtol=0.03)
    assert not response.valid_for("tension") and not response.valid_for("curvature")
    assert 0.055 < response.lines["cable"].left_out["tension"].max() < 0.08


def test_spectrum_and_extremes():
    line = hybrid.response(hung(STORM)).lines["cable"]
    spectrum = line.spectrum("tension")
    np.testing.assert_allclose(spectrum.moment(0), line.deviation("tension") ** 2, rtol=1e-12)
    period = line.period("tension")[30]
    assert 6.0 < period < 13.0
    largest = line.most_probable("tension", hours=3.0)[30] / line.deviation("tension")[30]
    assert largest == pytest.approx(math.sqrt(2.0 * math.log(3.0 * 3600.0 / period)), rel=1e-12)
    damage = line.damage({"kind": "T-N", "log_a": 3.0, "m": 3.0}, strength=1e5)
    assert damage.shape == (60,) and (damage > 0.0).all()
    single = hybrid.response(hung(REGULAR)).lines["cable"]
    np.testing.assert_allclose(single.most_probable("tension"), math.sqrt(2.0) * single.deviation("tension"), rtol=1e-9)


@pytest.mark.parametrize(
    "law", [{"bending_stiffness": 1e4}, {"moment_curvature": [[0, 0], [1e-3, 90], [5e-3, 200], [1, 2e4]]}]
)
@pytest.mark.parametrize("spring", [None, 2e4, 1e-3])
def test_a_slow_motion_bends_a_sprung_clamp_as_equilibria_do(law, spring):
    """Curvature of the line, without what its angular spring turns, by the height of the other end."""
    section = {"length": 8, "mass": 30, "diameter": 0.1, "axial_stiffness": 1e7} | law
    clamp = {"kind": "clamped", "position": [0, 0, 0], "tangent": [1, 0, 0]}
    clamp |= {"bend_stiffness": spring} if spring is not None else {}

    def scene(z, **more):
        end = {"kind": "pinned", "position": [7, 0, 3 + z]} | more
        return cable_scene(
            section, clamp, end, fluid={"density": 1000}, model="rod", mesh=40, contact={"self": False},
            time=(10, 0.05), output={"points": 3}
        )  # fmt: skip

    low, rest, high = (hybrid.static(scene(z)).curvature[0, 0] for z in (-1e-3, 0.0, 1e-3))
    heave = {"heave": {"amplitude": 1e-3, "period": 400.0}, "ramp": 800}
    found = hybrid.response(scene(0.0, motion=heave)).lines["cable"]
    assert found.mean_curvature[0] == pytest.approx(rest, rel=1e-3)
    assert abs(found.curvature[0, 0]) == pytest.approx(0.5 * abs(high - low), rel=1e-3)
    assert abs(found.curvature[0, 0]) > 1e-12


@pytest.mark.parametrize(
    ("law", "quantity"),
    [
        ({"tension_strain": [[0, 0], [0.01, 2.001e4], [0.02, 8e4]]}, "tension"),
        ({"tension_strain": [[0, 0], [0.02, 4e4], [0.03, 2e5]]}, ""),
        ({"axial_stiffness": 2e6, "moment_curvature": [[0, 0], [2e-4, 2.0], [1e-3, 3.0]]}, "curvature"),
        ({"axial_stiffness": 2e6, "moment_curvature": [[0, 0], [0.1, 1e3], [0.2, 1.5e3]]}, ""),
    ],
)
def test_a_law_of_pieces_is_told_where_its_stiffness_changes(law, quantity):
    """A line of 2e4 N whose end moves along it by 200 N, and across it so that it bends by 1e-3 1/m."""
    T, motion = 2e4, {"surge": {"amplitude": 0.01, "period": 2.0}, "heave": {"amplitude": 0.2, "period": 2.0}}
    section = {"length": 100.0, "mass": 10.0, "diameter": 0.05, "bending_stiffness": 1e4, "torsional_stiffness": 1e3}
    if "moment_curvature" in law:
        section.pop("bending_stiffness")
    scene = cable_scene(
        section | {"damping": 0.05} | law, pinned_at(0, 0, 0), pinned_at(101.0, 0, 0, motion=motion | {"ramp": 10.0}),
        gravity=0.0, model="rod", mesh=20
    )  # fmt: skip
    response = hybrid.response(scene)
    assert T / 2.0 < response.lines["cable"].mean_tension[0] < 2.0 * T
    told = [x for x in response.notes if "passes over a point of its table" in x]
    assert [x.split()[2] for x in told] == [quantity] * bool(quantity), response.notes


@pytest.mark.parametrize(
    "asked",
    [
        lambda x: x.most_probable("tension", hours=-3.0),
        lambda x: x.damage(T_N, strength=0.0),
        lambda x: x.damage(T_N, strength=math.nan),
        lambda x: x.damage(T_N, strength=1e6, hours=0.0),
        lambda x: x.damage({"kind": "S-N", "log_a": 12.0, "m": 3.0}, strength=1e6),
        lambda x: x.deviation("moment"),
    ],
)
@pytest.mark.needs("rainflow")
def test_what_makes_no_sense_is_no_number(asked):
    """Damage of no strength, or of none of stress, was 0."""
    ones = np.ones((2, 3), complex)
    line = LineResponse(
        np.arange(3.0), np.arange(3.0), np.array([0.1, 0.2]), ones[:, :, None], ones, ones, ones, np.ones((3, 1)),
        np.ones(3), np.ones(3),
    )  # fmt: skip
    assert (line.damage(T_N, strength=10.0) > 0.0).all()
    with pytest.raises(ValueError, match=r"expected|one of"):
        asked(line)
    with pytest.raises(ValueError, match="one of"):
        Response("", {}, {}, {}, 1, {}, ()).valid_for("moment")


def test_where_it_is_not_valid():
    motion = {"heave": {"amplitude": 1.5, "period": 4.0}, "ramp": 10.0}
    found = hybrid.response(hung(motion=motion, end=(30, 0, -20)))
    assert not found.valid and any("below zero for" in x and "s = " in x for x in found.notes)
    bed = hung({key: x for key, x in STORM.items() if key != "depth"}, cells=40)
    bed["environment"]["seabed"] = {"z": -65, "stiffness": 5e4}
    bed["ends"]["end"] = {"kind": "pinned", "position": [52, 0, -45], "motion": motion}
    assert any("lift off the bed" in x for x in hybrid.response(bed).notes)


def test_what_is_refused():
    with pytest.raises(hybrid.SceneError, match="waves, or ends that move as harmonics"):
        hybrid.response(hung())
    travel = {"travel": {"by": [1, 0, 0], "over": 10.0}}
    with pytest.raises(hybrid.SceneError, match=RESPONSE_TO_MOTION.why):
        hybrid.response(hung(REGULAR, motion=travel))


def test_the_command_and_its_check(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    motion = {"surge": {"amplitude": 0.05, "period": 7.0}, "ramp": 10.0}
    (tmp_path / "hung.yaml").write_text(hybrid.scene_text(hybrid.validate_scene(hung(motion=motion))))
    told = CliRunner().invoke(app, ["response", "hung.yaml", "--check", "100", "--json"])
    assert told.exit_code == 0, told.output
    (line,) = [x for x in map(json.loads, told.output.splitlines()) if "rows" in x]
    assert line["valid"]
    (tension,) = [x for x in line["rows"] if x["quantity"] == "tension"]
    here, there = line["checks"]["tension"]
    assert tension["deviation"] == pytest.approx(here, rel=0.01) and here == pytest.approx(there, rel=0.02)
    told = CliRunner().invoke(app, ["response", "hung.yaml"])
    assert "deviation" in told.output and "in 3 h" in told.output


@pytest.mark.parametrize(
    "load", [{"history": [[0, 0, 0, -50], [60, 0, 0, 900]]}, {"value": [0, 0, 900], "until": 30.0}]
)
def test_loads_that_change_in_time_are_refused(load):
    scene = hung(STORM)
    scene["ends"]["end"] = {"kind": "free", "force": load}
    with pytest.raises(hybrid.SceneError, match=r"ends.end.force(.|\n)*loads that stay"):
        hybrid.response(scene)


def test_a_load_that_grows_is_that_of_the_equilibrium():
    scene = hung(STORM)
    scene["ends"]["end"] = {"kind": "free", "force": {"value": [0, 0, 20000], "ramp": 5.0}}
    assert hybrid.response(scene).lines["cable"].mean_tension[-1] == pytest.approx(20000, rel=0.01)


def test_curvature_beside_a_pin_is_that_of_a_fine_rod():
    """Deviations and means beside both pins: of a catenary less the layer in which that of a rod fades."""
    motion = {"surge": {"amplitude": 0.05, "period": 7.0}, "ramp": 10.0}
    line, rod = (
        hybrid.response(hung(motion=motion, model=model, cells=cells)).lines["cable"]
        for model, cells in (("catenary", 60), ("rod", 480))
    )
    for name in ("curvature", "mean_curvature"):
        one, other = (x.deviation(name) if name == "curvature" else x.mean_curvature for x in (line, rod))
        other = other[::8]
        assert one[0] == one[-1] == 0.0
        np.testing.assert_allclose(one[:8], other[:8], atol=0.02 * other.max())
        np.testing.assert_allclose(one[-8:], other[-8:], atol=0.02 * other.max())


@pytest.mark.parametrize("held", ["clamped", "pinned"])
def test_a_mast_and_a_hanging_line_with_a_free_end_are_answered(held: str) -> None:
    """Neither is slack, and swinging does not stretch them: the one is compressed at rest, a free end gives way."""
    up = 1 if held == "clamped" else -1
    scene = hung({"kind": "jonswap", "significant_height": 1.0, "peak_period": 7.0, "depth": 40}, model="rod", cells=18)
    scene["cable"]["sections"][0] |= {"length": 11.0, "bending_stiffness": 1e6, "axial_stiffness": 1e8}
    foot = {"kind": held, "position": [0, 0, -12]} | ({"tangent": [0, 0, 1]} if up > 0 else {})
    scene["ends"] = {"start": foot, "end": "free"}
    found = hybrid.response(scene)
    assert (up * found.lines["cable"].mean_tension < 0.0).all() and found.valid_for("tension"), found.notes


# --- said in another way --------------------------------------------------------------------------

FLUID = {"density": 1025.0}
TAUT = {"length": 100.0, "mass": 1.0, "diameter": 0.05, "axial_stiffness": 1e6}


def between(section, a, b, motion, **more):
    ends = {"start": {"kind": "pinned", "position": a}, "end": {"kind": "pinned", "position": b, "motion": motion}}
    return {"cable": {"sections": [section]}, "ends": ends, "initial": "equilibrium", "mesh": {"cells": 20}} | more


def buoy(turned):
    """A buoy on two lines in waves; turned: lines run from the buoy to the anchors."""
    section = {"length": 56.0, "mass": 5.0, "diameter": 0.05, "axial_stiffness": 1e6, "drag": {"normal": 1.2},
               "added_mass": {"normal": 1.0}, "damping": {"stiffness": 0.05}}  # fmt: skip
    points = {k: {"position": [x, 0, -50]} for k, x in (("a", -30.0), ("b", 30.0))}
    points["buoy"] = {"kind": "free", "initial_guess": [0, 0, -3], "mass": 500, "volume": 2, "height": 1.5,
                      "drag_area": 1, "added_mass": 1000}  # fmt: skip
    ends = [("buoy", k) if turned else (k, "buoy") for k in "ab"]
    lines = {k: {"start": x, "end": y, "sections": [section], "model": "catenary", "mesh": {"cells": 20}}
             for k, (x, y) in zip("ab", ends, strict=True)}  # fmt: skip
    fluid = FLUID | {"surface": 0.0, "waves": {"kind": "regular", "height": 0.5, "period": 7.0, "ramp": 14.0}}
    return {"environment": {"fluid": fluid}, "points": points, "lines": lines}


def test_waves_push_a_point_whatever_way_its_lines_run():
    one, two = (hybrid.response(buoy(turned)) for turned in (False, True))
    np.testing.assert_allclose(one.points["buoy"], two.points["buoy"], rtol=1e-9, atol=1e-12)


def test_a_motion_of_an_obstacle_is_refused_in_a_response():
    moves = {"heave": {"amplitude": 0.02, "period": 6.0}, "ramp": 12.0}
    roller = {"kind": "cylinder", "at": [50, 0, -3], "axis": [0, 1, 0], "radius": 1.0, "motion": moves}
    section = TAUT | {"length": 101.0, "bending_stiffness": 100.0}
    start = {"kind": "equilibrium", "points": [[0, 0, -10], [50, 0, -1.9], [100, 0, -10]]}
    surge = {"surge": {"amplitude": 0.01, "period": 6.0}, "ramp": 12.0}
    scene = between(
        section, [0, 0, -10], [100, 0, -10], surge, initial=start, model="rod", obstacles={"roller": roller}
    )
    with pytest.raises(hybrid.SceneError, match=r"obstacles\.roller\.motion"):
        hybrid.response(scene)


def test_a_harmonic_that_never_slackens_a_line_is_valid():
    motion = {"heave": {"amplitude": 0.55, "period": 8.0}, "ramp": 16.0}
    found = hybrid.response(between(TAUT, [0, 0, 0], [0, 0, 101], motion, model="catenary"))
    line = found.lines["cable"]
    assert (line.mean_tension > 1.5 * np.abs(line.tension).sum(axis=0)).all()
    assert found.valid, found.notes
    motion["heave"]["amplitude"] = 1.1
    assert "below zero" in str(hybrid.response(between(TAUT, [0, 0, 0], [0, 0, 101], motion, model="catenary")).notes)


@pytest.mark.parametrize("other", [0.0, 45.0, 90.0])
def test_the_largest_curvature_of_a_straight_line_is_the_same_in_all_directions(other):
    section = TAUT | {"mass": 10.0, "axial_stiffness": 1e8, "bending_stiffness": 2e3, "drag": {"normal": 1.2}}

    def most(angle):
        amplitude = zip(("surge", "sway"), (np.cos(angle), np.sin(angle)), strict=True)
        motion = {k: {"amplitude": float(x), "period": 8.0} for k, x in amplitude} | {"ramp": 16.0}
        scene = between(section, [0, 0, -99], [0, 0, 1.2], motion, environment={"fluid": FLUID})
        line = hybrid.response(scene).lines["cable"]
        assert np.isfinite(line.period("curvature")[1:-1]).all()
        return line.most_probable("curvature").max()

    assert most(np.radians(other)) == pytest.approx(most(0.3), rel=1e-6)


def sideways():
    section = TAUT | {"length": 100.5, "mass": 10.0, "axial_stiffness": 1e7, "drag": {"normal": 1.2}}
    motion = {"sway": {"amplitude": 0.1, "period": 8.0}, "ramp": 16.0}
    return between(section, [0, 0, 0], [100, 0, 0], motion, model="catenary", environment={"fluid": FLUID})


def test_a_check_of_a_line_whose_tension_stays():
    assert hybrid.response(sideways(), check=30.0).checks["tension"][0] == 0.0


def test_a_check_begins_after_the_ramps():
    motion = {"heave": {"amplitude": 0.3, "period": 8.0}, "ramp": 100.0}
    found = hybrid.response(between(TAUT, [0, 0, 0], [0, 0, 101], motion, model="catenary"), check=40.0)
    assert found.valid, found.notes


def test_what_is_added_to_nothing_is_no_number():
    assert "more than 1000 %" in str(hybrid.response(sideways()).notes)


def test_a_bend_at_a_spring_with_layers_is_the_same_at_either_end():
    section = {"length": 100.0, "mass": 10.0, "diameter": 0.06, "axial_stiffness": 1e7, "bending_stiffness": 1e3,
               "torsional_stiffness": 1e3, "bending_slip": [{"stiffness": 4e3, "moment": 40.0}]}  # fmt: skip

    def mean(turned):
        way = -1.0 if turned else 1.0
        low = {"kind": "clamped", "position": [0, 0, -50], "tangent": [way, 0, 0.2 * way], "normal": [0, 1, 0],
               "bend_stiffness": 300.0}  # fmt: skip
        top = {
            "kind": "pinned",
            "position": [70, 0, 0],
            "motion": {"heave": {"amplitude": 0.1, "period": 8}, "ramp": 16},
        }
        ends = dict(zip(("start", "end"), (top, low) if turned else (low, top), strict=True))
        scene = {"cable": {"sections": [section]}, "ends": ends, "initial": "equilibrium", "model": "rod"}
        found = hybrid.response(scene | {"mesh": {"cells": 60}, "environment": {"fluid": FLUID}}).lines["cable"]
        return found.mean_curvature[-1 if turned else 0]

    assert mean(True) == pytest.approx(mean(False), rel=1e-6)


def on_bed(amplitude):
    section = {"length": 100, "mass": 8.0, "diameter": 0.05, "axial_stiffness": 1e6, "drag": {"normal": 1.2}}
    motion = {"surge": {"amplitude": amplitude, "period": 20.0}, "ramp": 40.0}
    bed = {"z": -30.0, "stiffness": 1e5, "friction": 0.3}
    return cable_scene(
        section,
        pinned_at(0, 0, -30),
        pinned_at(100.5, 0, -30, motion=motion),
        fluid={"density": 1025},
        seabed=bed,
        model="catenary",
        mesh=100,
        time=(100.0, 0.1),
    )


def over_drum(amplitude):
    section = {"length": 16.4, "mass": 1.0, "diameter": 0.06, "axial_stiffness": 2e5, "bending_stiffness": 30.0}
    drum = {"kind": "cylinder", "at": [0, 0, 1.5], "axis": [0, 1, 0], "radius": 1.0, "friction": 0.05}
    motion = {"surge": {"amplitude": amplitude, "period": 6.0}, "ramp": 12.0}
    shape = {"kind": "equilibrium", "points": [[-7, 0, -1], [-1, 0, 3.2], [1, 0, 3.2], [7.5, 0, -1.5]]}
    return cable_scene(
        section | {"damping": {"stiffness": 0.01}},
        pinned_at(-7, 0, -1),
        pinned_at(7.5, 0, -1.5, motion=motion),
        obstacles={"drum": drum},
        initial=shape,
        model="rod",
        mesh=72,
        time=(36.0, 0.03),
    )


def test_what_slides_on_the_bed_and_on_obstacles_is_said():
    # in time the tension at the end has a standard deviation of 404 N, not 1198 N
    assert any("the bed slides" in x for x in hybrid.response(on_bed(0.01)).notes)
    assert any("drum slides" in x for x in hybrid.response(over_drum(0.006)).notes)
    assert not any("slides" in x for x in hybrid.response(on_bed(1e-3)).notes)
    assert not any("slides" in x for x in hybrid.response(over_drum(1e-5)).notes)


def test_what_friction_holds_is_no_doubt():
    section = {"length": 200, "mass": 8.0, "diameter": 0.05, "axial_stiffness": 1e6, "drag": {"normal": 1.2}}
    motion = {"surge": {"amplitude": 0.05, "period": 20.0}, "ramp": 40.0}
    bed = {"z": -30.0, "stiffness": 1e5, "friction": 0.3}
    scene = cable_scene(
        section | {"added_mass": {"normal": 1.0}},
        pinned_at(0, 0, -30),
        pinned_at(196.5, 0, 0, motion=motion),
        fluid={"density": 1025},
        seabed=bed,
        model="catenary",
        mesh=100,
        time=(120.0, 0.1),
    )
    # 87.3 N at the end by frequency, 87.4 N in time
    assert hybrid.response(scene).valid_for("tension")


def bent_at(end):
    table = [[0, 0], [0.1, 300.0], [0.5, 500.0]]
    section = {"length": 20.0, "mass": 4.0, "diameter": 0.06, "axial_stiffness": 1e5, "moment_curvature": table}
    motion = {"heave": {"amplitude": 0.03, "period": 6.0}, "ramp": 12.0}
    moved = pinned_at(19, 0, 0, motion=motion)
    ends = (
        (clamped_at([0, 0, 0], [1, 0, -0.2172]), moved)
        if end == "start"
        else (moved, clamped_at([0, 0, 0], [-1, 0, 0.2172]))
    )
    section |= {"torsional_stiffness": 200.0, "drag": {"normal": 1.2}}
    return cable_scene(section, *ends, fluid={"density": 1025}, model="rod", mesh=32, time=(60.0, 0.05))


def test_a_point_of_a_table_at_a_clamp_is_told_whichever_way_the_line_runs():
    for end in ("start", "end"):
        assert any("a point of its table" in x for x in hybrid.response(bent_at(end)).notes), end


def below_the_surface(height):
    buoy = {"kind": "body", "mass": 50.0, "volume": 0.6, "drag_area": 0.3, "added_mass": 300.0}
    waves = {"kind": "regular", "height": height, "period": 8.0, "direction": 90.0, "ramp": 16.0}
    section = {"length": 29.2, "mass": 4.0, "diameter": 0.04, "axial_stiffness": 1e6, "drag": {"normal": 1.2}}
    fluid = {"density": 1025, "surface": 0.0, "waves": waves}
    return cable_scene(section, pinned_at(0, 0, -30), buoy, fluid=fluid, model="catenary", mesh=20, time=(64.0, 0.02))


def test_a_buoy_that_comes_out_of_the_water_is_told():
    # in waves of 1.4 m the tension has a standard deviation of 760 N in time, not 272 N
    assert any("buoyancy" in x for x in hybrid.response(below_the_surface(1.4)).notes)
    assert not any("buoyancy" in x for x in hybrid.response(below_the_surface(0.3)).notes)


def test_the_length_that_lifts_off_does_not_go_by_the_direction_of_the_line():
    """It lies on the bed with cells of 2 m and 1.1 m."""
    section = {"length": 75.0, "mass": 20.0, "diameter": 0.1, "axial_stiffness": 2e6, "bending_stiffness": 10.0}
    zones = [{"rod": 20.0, "cells": 10}, {"rod": 55.0, "cells": 50}]
    high = pinned_at(50, 8, 2, motion={"heave": {"amplitude": 0.5, "period": 7.0}, "ramp": 20.0})
    notes = []
    for way in (1, -1):
        scene = cable_scene(
            section | {"drag": {"normal": 1.2}}, *(pinned_at(0, 0, -39), high)[::way], fluid={"density": 1025},
            seabed={"z": -40.0, "stiffness": 5e3, "damping": 100.0}, model={"kind": "zones", "zones": zones[::way]},
            time=(40.0, 0.1),
        )  # fmt: skip
        notes.append([x for x in hybrid.response(scene).notes if "lift off" in x])
    assert notes[0] == notes[1] and len(notes[0]) == 1
