"""Scenes in a plane: computed in it, as in space; watched for what would leave it; refused where they do not lie in it."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bits import resumed
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation
from scipy.special import ellipe, ellipk

import hybrid
from hybrid.errors import SceneError
from hybrid.model.build import WHAT, build
from hybrid.scene.read import one_line
from hybrid.simulation.lone_planes import LonePlane
from tests.said import texts_of
from tests.scenes import cable_scene, clamped_at, pinned_at

EXAMPLES = Path(__file__).parents[2] / "examples"
# Two marches that solve the same equations end Newton within its tolerance of each other, 1e-9 of the length.
SAME = 1e-9
FLAT = (
    "01_hanging_chain", "02_suspension", "03_suspension_rod", "04_suspension_catenary", "05_cantilever", "06_whip",
    "irregular_sea", "laying", "rov_tether", "s_tether", "touchdown",
)  # fmt: skip


def scene(what: dict[str, Any], **tables: Any) -> hybrid.Scene:
    return hybrid.validate_scene(what | tables)


def example(name: str, steps: int = 300, **tables: Any) -> hybrid.Scene:
    """An example, cut short: enough steps for zones to move where they do."""
    what = hybrid.load_scene(EXAMPLES / f"{name}.yaml").model_dump(exclude_none=True)
    what.pop("dimension", None)
    step = what["time"]["step"]
    duration = min(what["time"]["duration"], steps * step)
    what["time"]["duration"] = duration
    what["output"]["every"] = duration / 20
    return scene(what, **tables)


def entry(asked: hybrid.Scene) -> Any:
    return next(x for x in hybrid.plan(asked).contents if x.what == WHAT)


@pytest.mark.long
@pytest.mark.parametrize("name", FLAT)
def test_the_gallery_in_its_plane_and_in_space(name: str) -> None:
    """The same motion, the same zones, nothing across the plane, and no event of it in the first 300 steps."""
    space = hybrid.run(example(name, dimension=3))
    for asked in ({}, {"dimension": 2}):
        flat = hybrid.run(example(name, **asked))
        assert not texts_of(flat, "out of plane")
        assert np.abs(flat.position - space.position).max() < SAME * space.s[-1]
        assert np.abs(flat.tension - space.tension).max() < 10 * SAME * np.abs(space.tension).max()
        assert [len(z) for z in flat.zones] == [len(z) for z in space.zones]
        n = build(one_line(example(name))).plane
        assert n is not None and np.abs(flat.velocity @ n[2]).max() == 0.0


@pytest.mark.long
@pytest.mark.parametrize("name, model", [("touchdown", "catenary"), ("irregular_sea", None), ("rov_tether", None)])
def test_the_model_error_in_its_plane_and_in_space(name: str, model: str | None) -> None:
    """What leaving bending out does, by rods that either march solves; 1e-9 in tensions makes 1e-7 in forces."""
    what = example(name, 100).model_dump(exclude_none=True)
    what["output"]["errors"] = True
    if model is not None:
        what["model"] = model
    space, *flat = (hybrid.run(scene(what, **asked)) for asked in ({"dimension": 3}, {}, {"dimension": 2}))
    names = [x for x in space.names if x.startswith("errors/model/")]
    assert np.abs(space["errors/model/position"]).max() > 1e-4
    for found in flat:
        assert not [e for e in found.events if e.kind in ("out of plane", "model error not estimated")]
        for x in names:
            assert np.abs(found[x] - space[x]).max() < 1e-6 * np.abs(space[x]).max(), x


@pytest.mark.parametrize("name", [*FLAT[:2], "05_cantilever", "s_tether", "rov_tether"])
def test_statics_in_the_plane_and_in_space(name: str) -> None:
    what = example(name).model_dump(exclude_none=True) | {"initial": {"kind": "equilibrium"}}
    flat, space = (hybrid.static(scene(what, dimension=d)) for d in (2, 3))
    assert np.abs(flat.position - space.position).max() < SAME * space.s[-1]
    assert np.abs(flat.tension - space.tension).max() < 10 * SAME * np.abs(space.tension).max()


def turned(what: Any, R: np.ndarray) -> Any:
    """A scene with every vector turned."""
    if isinstance(what, dict):
        return {k: turned(v, R) for k, v in what.items()}
    if isinstance(what, list | tuple) and len(what) == 3 and all(isinstance(x, int | float) for x in what):
        return [float(x) for x in R @ np.array(what, float)]
    return [turned(x, R) for x in what] if isinstance(what, list | tuple) else what


def about(axis: tuple[float, float, float], angle: float) -> np.ndarray:
    return Rotation.from_rotvec(angle * np.array(axis) / np.linalg.norm(axis)).as_matrix()


@cache
def as_written(name: str) -> tuple[dict[str, Any], hybrid.Result]:
    """Tables of an example of 200 steps, and its result."""
    what = example(name, 200).model_dump(exclude_none=True)
    what["output"].pop("history", None)
    return what, hybrid.run(scene(what))


TURNS = [
    *(
        (name, about((0, 0, 1), x))
        for name in ("03_suspension_rod", "06_whip", "rov_tether")
        for x in (0.3, 1.7, 2.9, -2.0)
    ),
    *(("05_cantilever", about(axis, 1.1)) for axis in ((1, 2, 3), (1, 0, 0), (-2, 1, 0.5))),
]


@pytest.mark.parametrize(("name", "R"), TURNS)
def test_any_vertical_plane_and_any_where_nothing_is_heavy(name: str, R: np.ndarray) -> None:
    what, straight = as_written(name)
    asked = scene(turned(what, R))
    assert entry(asked).on
    found = hybrid.run(asked)
    assert np.abs(found.position - straight.position @ R.T).max() < SAME * straight.s[-1]
    if name != "05_cantilever":
        assert not texts_of(found, "out of plane")
        assert np.abs(found.velocity @ (R @ [0, 1, 0])).max() < 1e-12 * np.abs(found.velocity).max()


@pytest.mark.parametrize("dimension", [None, 2])
@pytest.mark.parametrize("model", ["rod", "catenary"])
def test_what_is_written_in_a_plane_goes_on_after_a_stop(model: str, dimension: int | None, tmp_path: Path) -> None:
    """Turns, torques and moments between two clamps too, which a line that may leave its plane has."""
    clamp = {"kind": "clamped", "position": [0, 0, 0], "tangent": [1, 0, -0.5]}
    travel = {"motion": {"travel": {"by": [0.05, 0, 0.1], "over": 0.5}}}
    asked: dict[str, Any] = cable_scene(
        {"length": 12.0, "mass": 2.0, "bending_stiffness": 20.0, "torsional_stiffness": 15.0}, clamp,
        clamp | {"position": [10, 0, 3], "tangent": [1, 0, 0.8]} | travel, model=model, mesh=12, time=(0.5, 2**-5),
        output=2**-3
    )  # fmt: skip
    whole = resumed(asked if dimension is None else asked | {"dimension": dimension}, tmp_path, 0.25)
    assert ("turns/link" in whole) == (dimension is None)


@pytest.mark.slow  # 4 s
def test_random_scenes_in_a_vertical_plane() -> None:
    """Two sections, a moving end, current, seabed with friction, a float, an end moment, damping of both kinds."""
    told = 0
    for seed in range(6):
        g = np.random.default_rng(seed)
        x, y = np.cos(seed), np.sin(seed)
        section = {
            "length": 10.0, "mass": 1.0, "diameter": 0.02, "axial_stiffness": 1e5, "bending_stiffness": 2.0,
            "drag": {"normal": 1.2, "tangential": 0.02}, "added_mass": {"normal": 1.0},
            "damping": {"mass": 0.1, "stiffness": 0.01},
        }  # fmt: skip
        a = float(g.uniform(12, 17))
        moved = {"heave": {"amplitude": 0.2, "period": 3}, "velocity": [0.1 * x, 0.1 * y, 0], "ramp": 2}
        what = cable_scene(
            [section, section | {"mass": 1.5}],
            pinned_at(0, 0, 0, motion=moved), clamped_at([a * x, a * y, -8.0], [x, y, -0.2]),
            attachments=[{"kind": "float", "at": 8.0, "mass": 0.2, "volume": 0.0005, "drag_area": 0.01}],
            fluid={"density": 1025, "surface": 0, "current": [0.3 * x, 0.3 * y, 0]},
            seabed={"z": -9.0, "stiffness": 1000.0, "damping": 100.0, "friction": 0.4 if seed % 2 else 0},
            initial={"kind": "equilibrium", "friction": "neglected"},  # settled, all six hold in space
            model=["rod", "adaptive", {"zones": [{"catenary": 3}, {"rod": 17}]}][seed % 3], time=(3.0, 0.05),
        )  # fmt: skip
        flat, space = (hybrid.run(scene(what, dimension=d)) for d in (2, 3))
        if texts_of(flat, "out of plane"):  # an equilibrium that holds in the plane alone: in space another is sought
            told += 1
            flat = hybrid.run(scene(what))
        assert np.abs(flat.position - space.position).max() < SAME * 20, seed
        assert np.abs(flat.tension - space.tension).max() < 1e-8 * np.abs(space.tension).max(), seed
    assert told == 1  # of six


# --- what would leave the plane ------------------------------------------------------------------


def deep_beam(part: float, **tables: Any) -> hybrid.Scene:
    """A cantilever as deep as a ruler under `part` of the tip load at which it topples, 4.0126 sqrt(EI GJ)/L^2."""
    EI, GJ, deep = 0.01, 0.008, 30.0
    critical = 4.0126 * np.sqrt(EI * GJ / ((1 - EI / deep) * (1 - GJ / deep)))
    what = cable_scene(
        {"length": 1.0, "mass": 0.1, "bending_stiffness": [deep, EI], "torsional_stiffness": GJ, "rotary_inertia": 0,
         "damping": {"mass": 0.2}},
        clamped_at([0, 0, 0], [1, 0, 0], normal=[0, 1, 0]),
        {"kind": "free", "force": {"value": [0, 0, float(-part * critical)], "ramp": 1.0}}, gravity=0.0,
        initial={"kind": "straight", "direction": [1, 0, 0]}, model="rod", mesh=40, time=(60.0, 0.02)
    )  # fmt: skip
    return scene(what, **tables)


def test_a_deep_beam_topples_where_prandtl_says() -> None:
    """Prandtl (1899), Michell (1899): below the load nothing grows, above it the beam leaves the plane; within 5 %."""
    calm = hybrid.run(deep_beam(0.95))
    assert not texts_of(calm, "out of plane") and np.abs(calm.position[..., 1]).max() == 0.0
    topples = hybrid.run(deep_beam(1.05))
    assert len(texts_of(topples, "out of plane")) == 1
    assert np.abs(topples.position[..., 1]).max() > 0.02


def test_in_space_nothing_would_have_been_seen() -> None:
    """A scene without any imperfection stays in its plane in space as well; that is why it is watched."""
    assert np.abs(hybrid.run(deep_beam(1.05, dimension=3)).position[..., 1]).max() == 0.0


def test_who_insists_on_a_plane_is_told() -> None:
    result = hybrid.run(deep_beam(1.05, dimension=2))
    assert len(texts_of(result, "out of plane")) == 1 and "dimension: 3" in texts_of(result, "out of plane")[0]
    assert np.abs(result.position[..., 1]).max() == 0.0


def test_equilibria_that_hold_in_the_plane_alone() -> None:
    """A strut, soft across the plane: in the plane it stands, in space it bends to one side as an elastica."""
    what = deep_beam(0.0).model_dump(exclude_none=True)
    what["ends"]["end"] = {"kind": "free", "force": [-0.03, 0.0, 0.0]}  # 1.2 times Euler's load for EI
    what["initial"] = {"kind": "equilibrium", "guess": "straight", "direction": [1, 0, 0]}
    flat = hybrid.static(scene(what, dimension=2))
    assert texts_of(flat, "out of plane") and np.abs(flat.position[0, :, 1:]).max() < 1e-9
    with hybrid.static(scene(what)) as bent:
        assert {x.kind for x in bent.events} == {"several equilibria", "compression"}
        tip = bent.position[0, -1]
    k = brentq(lambda k: ellipk(k * k) - np.sqrt(0.03 / 0.01), 0.1, 0.9)
    height, aside = 2.0 * ellipe(k * k) / ellipk(k * k) - 1.0, 2.0 * k * np.sqrt(0.01 / 0.03)
    np.testing.assert_allclose([tip[0], abs(tip[1]), tip[2]], [height, aside, 0.0], rtol=0, atol=1e-3)


def swinging(sway: float, phase: float, dimension: int | None = None) -> dict[str, Any]:
    """A line in the vertical plane at 53 degrees from x, whose end surges by 0.6 m and sways."""
    both = {"surge": {"amplitude": 0.6, "period": 4.0}, "sway": {"amplitude": sway, "period": 4.0, "phase": phase}}
    motion = both | {"heave": {"amplitude": 0.3, "period": 5.0}, "ramp": 4.0}
    section = {"length": 30, "mass": 2.0, "diameter": 0.03, "bending_stiffness": 20, "drag": {"normal": 1.2}}
    return cable_scene(
        section, pinned_at(0, 0, 0), pinned_at(15, 20, 0, motion=motion), fluid={"density": 1025}, model="rod", mesh=20,
        time=(4, 0.05), output=(0.5, 11)
    ) | ({"dimension": dimension} if dimension else {})  # fmt: skip


def test_surge_and_sway_in_phase_are_one_direction() -> None:
    """As in space; in opposite phase with the sign turned; out of phase, or another way, they leave the plane."""
    flat, space = (hybrid.run(swinging(0.8, 0.0, dimension)) for dimension in (2, 3))
    np.testing.assert_allclose(flat.position, space.position, rtol=0, atol=1e-10)
    assert np.ptp(flat.position[:, -1, 1]) > 0.5
    assert entry(hybrid.validate_scene(swinging(0.8, 0.0))).on
    hybrid.validate_scene(swinging(-0.8, 180.0, 2))
    for sway, phase in ((0.8, 10.0), (0.7, 0.0), (0.8, 180.0)):
        with pytest.raises(SceneError, match="dimension is 2"):
            hybrid.validate_scene(swinging(sway, phase, 2))


@pytest.mark.parametrize("period, grows", [(1.0, True), (0.67, False)])
def test_a_string_whose_tension_swings_twice_as_fast_as_it_does(period: float, grows: bool) -> None:
    """Parametric resonance (Melde): no tangent matrix is ever indefinite, and yet the string leaves the plane."""
    tension, length, mass = 100.0, 10.0, 1.0
    first = 2 * length * np.sqrt(mass / tension)  # s, of its first mode: half of it is the period that makes it grow
    EA = 1e4
    what = cable_scene(
        {"length": length, "mass": mass, "axial_stiffness": EA}, pinned_at(0, 0, 0),
        pinned_at(length * (1 + tension / EA), 0, 0,
                  motion={"surge": {"amplitude": 0.4 * length * tension / EA, "period": 0.5 * period * first},
                          "ramp": 4}),
        gravity=0.0, model="catenary", mesh=20, time=(80.0, 0.02, 0.9)
    )  # fmt: skip
    result = hybrid.run(scene(what))
    assert bool(texts_of(result, "out of plane")) == grows


# --- what is not in a plane ----------------------------------------------------------------------

BASE = """\
environment: {fluid: {density: 1025, current: [0.3, 0, 0]}}
cable: {sections: [{length: 10, mass: 1, diameter: 0.02, bending_stiffness: 1, drag: {normal: 1}}]}
ends:
  start: {kind: pinned, position: [0, 0, 0]}
  end: {kind: clamped, position: [6, 0, -2], tangent: [1, 0, 0.5]}
initial: equilibrium
model: rod
dimension: 2
time: {duration: 1, step: 0.1}
"""
WRONG = {
    "current": ("current: [0.3, 0, 0]", "current: [0.3, 0.1, 0]", "environment.fluid.current", 1),
    "tangent": ("tangent: [1, 0, 0.5]", "tangent: [1, 0.2, 0.5]", "ends.end.tangent", 5),
    "motion": ("position: [0, 0, 0]", "position: [0, 0, 0], motion: {ramp: 1, sway: {amplitude: 1, period: 1}}",
               "ends.start.motion.sway", 4),
    "slope": ("environment: {", "environment: {seabed: {z: -20, stiffness: 100, slope: [0, 0.1]}, ",
              "environment.seabed.slope", 1),
    "roll": ("tangent: [1, 0, 0.5]", "tangent: [1, 0, 0.5], motion: {ramp: 1, roll: {amplitude: 5, period: 1}}",
             "ends.end.motion.roll", 5),
    "twist": ("diameter: 0.02, bending_stiffness: 1", "diameter: 0.02, bending_stiffness: [1, 2], torsional_stiffness: 1",
              "cable.sections[0].bending_stiffness", 2),
    "curl": ("diameter: 0.02,", "diameter: 0.02, torsional_stiffness: 1, intrinsic_curvature: [0, 0, 1],",
             "cable.sections[0].intrinsic_curvature", 2),
}  # fmt: skip


@pytest.mark.parametrize(("old", "new", "where", "line"), WRONG.values(), ids=WRONG)
def test_what_leaves_the_plane_is_named(old: str, new: str, where: str, line: int) -> None:
    assert hybrid.parse_scene(BASE).dimension == 2
    assert old in BASE
    with pytest.raises(SceneError) as caught:
        hybrid.parse_scene(BASE.replace(old, new))
    found = [c for c in caught.value.complaints if c.where == where]
    assert found and found[0].line == line
    if where != "dimension":
        assert "dimension is 2" in found[0].expected and "dimension" in found[0].fix
        # and without insisting it is computed in space, and the plan says why
        held = BASE.replace(old, new).replace("tangent: [1, 0, 0.5]", "tangent: [1, 0, 0.5], normal: [0.5, 1, -1]")
        asked = hybrid.parse_scene(held.replace("dimension: 2\n", ""))
        assert not entry(asked).on and "leaves" in entry(asked).why


def test_the_plan_says_who_asked() -> None:
    for dimension, on, why in ((2, True, "dimension: 2"), (3, False, "dimension: 3"), (None, True, "all of the scene")):
        text = BASE.replace("dimension: 2\n", f"dimension: {dimension}\n" if dimension else "")
        told = entry(hybrid.parse_scene(text))
        assert told.on is on and why in told.why
    flat, space = (hybrid.plan(hybrid.parse_scene(BASE.replace("dimension: 2", f"dimension: {d}"))) for d in (2, 3))
    cells = sum(flat.cells)
    assert flat.unknowns == 3 * cells + 2 and space.unknowns == 5 * cells + 3
    texts = [BASE.replace("dimension: 2", f"dimension: {d}") for d in (2, 3)]
    long = [hybrid.parse_scene(text, overrides=["time.duration=100"]) for text in texts]
    flat, space = (hybrid.plan(x, measure=False) for x in long)  # from tables: no time of this machine
    assert flat.seconds < 0.9 * space.seconds  # outputs, and the start of a run, cost the same


def test_an_end_moment_must_be_normal_to_the_plane() -> None:
    what = hybrid.parse_scene(BASE).model_dump(exclude_none=True)
    what["ends"]["end"] = {"kind": "free", "moment": [0, 0.5, 0]}
    assert entry(scene(what)).on
    what["ends"]["end"]["moment"] = [0.5, 0, 0]
    with pytest.raises(SceneError, match="moment"):
        scene(what)


def test_a_load_that_is_let_go_in_a_plane_is_let_go_in_space() -> None:
    """The accelerations after it are found by the march in space, which steps in the plane had left their work in."""
    what = cable_scene(
        {"length": 1.0, "mass": 1.0}, pinned_at(0, 0, 0),
        {"kind": "free", "force": {"value": [0.03, 0, 0], "until": 0.5}},
        initial={"kind": "straight", "direction": [0.6, 0, -0.8]}, model="catenary", mesh=20, time=(0.7, 0.01),
        output={"every": 0.1, "points": 11, "errors": False}
    )  # fmt: skip
    flat, deep = (hybrid.run(scene(what, dimension=k)) for k in (2, 3))
    assert np.abs(flat.position - deep.position).max() < SAME


# --- a line that comes back to its plane ---

STEP = 0.1


def storm(duration: float) -> hybrid.Scene:
    """A mooring line in a storm: it buckles on the seabed at 118 s and again at 331 s."""
    section = {
        "length": 250, "mass": 20, "diameter": 0.05, "axial_stiffness": 2e8, "bending_stiffness": 2e3,
        "drag": {"normal": 1.2, "tangential": 0.05}, "added_mass": {"normal": 1.0},
    }  # fmt: skip
    waves = {"kind": "jonswap", "significant_height": 6, "peak_period": 11, "gamma": 2.5, "ramp": 60, "seed": 3}
    fluid = {"density": 1025, "surface": 0, "waves": waves | {"direction": 0}}
    return hybrid.validate_scene(cable_scene(
        section, pinned_at(0, 0, -100), pinned_at(205, 0, -5, motion={"follow": "waves"}), fluid=fluid,
        seabed={"z": -100, "stiffness": 5e3, "damping": 5e2}, model="rod", mesh=40, time=(duration, STEP), output=0.5
    ))  # fmt: skip


@pytest.mark.long
def test_a_line_that_has_buckled_comes_back_to_its_plane(monkeypatch: pytest.MonkeyPatch) -> None:
    """In the plane its forces are those in space, and what was left across it leads to the same next buckle."""
    flat = hybrid.run(storm(333.0))
    monkeypatch.setattr(LonePlane, "attach", _never_back(LonePlane.attach))
    space = hybrid.run(storm(333.0))
    assert [e.kind for e in flat.events].count("out of plane") == 1
    t, across, there = flat.t, *(np.abs(x.position[:, :, 1]).max(axis=1) for x in (flat, space))
    in_plane = (t > 120.0) & (across == 0.0)
    assert 30.0 < 0.5 * in_plane.sum() < 60.0  # s; it comes back at 283 s
    assert 0.0 < there[in_plane].max() < 2e-3
    force = np.linalg.norm(flat.reaction_end - space.reaction_end, axis=1)[in_plane]
    assert force.max() < 1e-4 * np.linalg.norm(space.reaction_end, axis=1).max()
    assert there[-1] > 0.01  # and buckles again, by centimetres, as what was 1e-7 of the length has grown
    assert abs(across[-1] / there[-1] - 1.0) < 0.05


def _never_back(attach):
    def without(self, solver):
        self.comes_back = False
        attach(self, solver)

    return without
