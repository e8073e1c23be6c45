"""The sea of a scene: currents, waves, seabed, attachments and bodies, accepted and refused at their line."""

from __future__ import annotations

import math

import pytest
from scene_texts import AT_REST, OCEAN, SEA, SEA_LIST, SEA_TOO, SEA_UNIFORM, change, complaints, refused

from hybrid.errors import SceneError
from hybrid.scene.analysis import CatenaryModel, Equilibrium
from hybrid.scene.attachments import Clump, Float, Modules
from hybrid.scene.cable import Fluid
from hybrid.scene.ends import Body, Free, Pinned
from hybrid.scene.motion_tables import Load, Motion
from hybrid.scene.read import parse_scene, validate_scene
from hybrid.scene.sea import CurrentPoint, CurrentProfile, Friction, PowerLawCurrent, Seabed, UniformCurrent
from hybrid.scene.start_checks import net_weight
from hybrid.scene.wave_theory import wavenumber
from hybrid.scene.waves import RegularWaves
from tests.scenes import cable_scene, pinned_at

# --- what is read ------------------------------------------------------------------------------


def test_currents_of_every_form() -> None:
    point = {"z": 0, "velocity": [0.4, 0, 0]}
    below = {"z": -50, "velocity": [0.1, 0.2, 0]}
    points = (CurrentPoint(z=0, velocity=(0.4, 0, 0)), CurrentPoint(z=-50, velocity=(0.1, 0.2, 0)))
    assert Fluid(density=1, current=[0.3, 0, 0]).current == (0.3, 0.0, 0.0)
    assert Fluid(density=1, current=[point, below]).current == points
    assert Fluid(density=1, current=list(points)).current == points
    assert Fluid(density=1, current={"kind": "profile", "table": points}).current == CurrentProfile(table=points)
    assert parse_scene(SEA_LIST).environment.fluid.current[1].z == 0.0
    assert parse_scene(SEA_UNIFORM).environment.fluid.current == UniformCurrent(speed=8, direction=90, ramp=4.0)
    assert isinstance(parse_scene(SEA_TOO).environment.fluid.current, CurrentProfile)
    assert parse_scene(SEA_UNIFORM).environment.fluid.current.flow == (0.0, 8.0, 0.0)
    assert Fluid(density=1, current={"speed": 2, "direction": -60}).current.flow == (1.0, -2 * 0.866025403784439, 0.0)
    assert Fluid(density=1, current=[{"z": 0, "speed": 1}, below]).current[0].flow == (1.0, 0.0, 0.0)
    assert Fluid(density=1, current={"speed": 1, "bottom": -9}).current == PowerLawCurrent(speed=1, bottom=-9)
    law = PowerLawCurrent(velocity=(1, 0, 0), bottom=-40)
    assert (law.exponent, law.veer, law.top_under(None), law.top_under(3.0)) == (1 / 7, 0.0, 0.0, 3.0)
    assert PowerLawCurrent(velocity=(1, 0, 0), top=-2, bottom=-40).top_under(3.0) == -2.0


def test_whether_anything_flows() -> None:
    assert not Fluid(density=1).flows() and not Fluid(density=1, current=(0, 0, 0)).flows()
    assert Fluid(density=1, current=(0, 1, 0)).flows()
    for text in (SEA, SEA_TOO, SEA_LIST, SEA_UNIFORM):
        assert parse_scene(text).environment.fluid.flows()


def test_friction_as_a_number_means_both() -> None:
    assert parse_scene(SEA_LIST).environment.seabed.friction == Friction(axial=0.4, lateral=0.4)
    scene = parse_scene(SEA_LIST, overrides=["environment.seabed.friction.axial=0.1"])
    assert scene.environment.seabed.friction == Friction(axial=0.1, lateral=0.4)


def test_overrides_reach_into_lists_and_kinds() -> None:
    scene = parse_scene(
        SEA_LIST,
        overrides=[
            "environment.fluid.current[0].velocity=[0.1, 0, 0]",
            "ends.end.mass=12",
            "ends.end.thrust=[0, 0, 1]",
        ],
    )
    assert scene.environment.fluid.current[0].velocity == (0.1, 0.0, 0.0)
    assert scene.ends.end == Body(mass=12.0, thrust=(0.0, 0.0, 1.0))
    scene = parse_scene(SEA, overrides=["cable.attachments[0].at=70", "ends.start.motion.heave[1].period=6"])
    assert scene.cable.attachments[0].at == 70.0
    assert [h.period for h in scene.ends.start.motion.harmonics()["heave"]] == [8.0, 6.0]


def test_height_of_the_seabed_and_depth_of_the_water() -> None:
    seabed = parse_scene(SEA).environment.seabed
    assert seabed.height(100.0, 50.0) == pytest.approx(-100.0 + 1.0 - 1.0)
    assert Seabed(z=-3, stiffness=1).height(1e3, 1e3) == -3.0
    assert parse_scene(SEA).environment.depth == 100.0
    assert parse_scene(SEA_TOO).environment.depth == 60.0
    assert parse_scene(SEA_LIST).environment.depth is None and parse_scene(OCEAN).environment.depth is None


def test_volumes_follow_from_net_buoyancy() -> None:
    float_, clump, modules = parse_scene(SEA).cable.attachments
    volume = float_.volume_in(1025.0, 9.81)
    assert (1025.0 * volume - 4.0) * 9.81 == pytest.approx(60.0, rel=1e-14)
    assert clump.volume_in(1025.0, 9.81) == 0.004 and modules.volume_in(1025.0, 9.81) == 0.02
    lift = Modules(range=(0, 1), buoyancy=100, mass=5).volume_in(1000.0, 10.0)
    assert lift == pytest.approx((10.0 + 5.0) / 1000.0, rel=1e-14)
    assert float_.height_in(1025.0, 9.81) == 0.2
    ball = Float(at=0, volume=math.pi / 6).height_in(1025.0, 9.81)
    assert ball == pytest.approx(1.0, rel=1e-14)
    assert Clump(at=0, mass=1, volume=math.pi / 6 * 8).height_in(1.0, 1.0) == pytest.approx(2.0, rel=1e-14)
    body = Body(mass=1, volume=math.pi / 6 * 27)
    assert body.height_in(1.0, 1.0) == pytest.approx(3.0, rel=1e-14) and body.volume_in(1.0, 1.0) == body.volume


def test_net_weight_counts_everything() -> None:
    """Cable, float, clump, modules, body and thrust of SEA, by hand."""
    scene = parse_scene(SEA)
    g, rho = 9.81, 1025.0
    cable = (5.0 - rho * math.pi / 4 * 0.05**2) * 150.0
    clump, modules, body = 30.0 - rho * 0.004, (8.0 - rho * 0.02) * 20.0, 100.0 - rho * 0.09
    weight, gross = net_weight(scene.environment, scene.cable, scene.ends)
    assert weight == pytest.approx(g * (cable + clump + modules + body) - 60.0, rel=1e-12)
    assert gross > abs(weight)
    lifted = scene.ends.model_copy(update={"end": Body(mass=100.0, volume=0.09, thrust=Load(value=(0, 0, 50.0)))})
    assert net_weight(scene.environment, scene.cable, lifted)[0] == pytest.approx(weight - 50.0, rel=1e-12)


# --- the length of waves -----------------------------------------------------------------------


@pytest.mark.parametrize("period", [0.5, 2.0, 8.0, 20.0, 300.0, 1e5])
@pytest.mark.parametrize("depth", [0.01, 1.0, 30.0, 4000.0, None])
def test_wavenumber_obeys_the_dispersion_relation(period: float, depth: float | None) -> None:
    """Round-off: the relation is recovered to 1e-12 of omega^2 in deep, middle and shallow water."""
    omega, g = 2 * math.pi / period, 9.81
    k = wavenumber(omega, depth, g)
    tanh = 1.0 if depth is None else math.tanh(k * depth)
    assert g * k * tanh == pytest.approx(omega**2, rel=1e-12)


def test_wavenumber_at_its_limits() -> None:
    omega, g = 0.7, 9.81
    for q in (1e-16, 20.0):  # the closed forms beyond meet the iteration
        d = q * g / omega**2
        assert wavenumber(omega, 0.999999 * d, g) * d == pytest.approx(wavenumber(omega, 1.000001 * d, g) * d, rel=3e-6)
    assert wavenumber(1e-200, 1.0, g) > 0.0 and wavenumber(1e200, 1e300, g) == math.inf
    assert wavenumber(omega, 1e6, g) == pytest.approx(omega**2 / g, rel=1e-14)
    shallow = 1e-4  # (k d)^2 / 6 = 1.5e-6 from the shallow limit
    assert wavenumber(omega, shallow, g) == pytest.approx(omega / math.sqrt(g * shallow), rel=1e-5)
    # Dean & Dalrymple (1991), table: d / L0 = 0.1 -> d / L = 0.14100 to the digits printed
    assert 0.1 * wavenumber(math.sqrt(2 * math.pi * g), 0.1, g) / (2 * math.pi) == pytest.approx(0.1410, abs=5e-5)


# --- refusals ----------------------------------------------------------------------------------

BODY = "{kind: body, initial_guess: [60.0, 0.0, -80.0], mass: 100.0, volume: 0.09, height: 0.5, shape: cylinder, drag_area: 0.4, added_mass: 40.0, thrust: [20.0, 0.0, 0.0]}"
POWER = "{kind: power_law, velocity: [0.5, 0.1, 0.0], top: -1.0, bottom: -80.0, exponent: 0.2, veer: 30.0, ramp: 5.0}"
REGULAR = "{kind: regular, height: 2.0, period: 7.0, direction: 30.0, phase: 90.0, depth: 60.0}"
PROFILE = (
    "{kind: profile, table: [{z: 0.0, velocity: [0.4, 0.0, 0.0]}, {z: -50.0, velocity: [0.1, 0.2, 0.0]}], ramp: 8.0}"
)
FLOAT = "{kind: float, at: 75.0, buoyancy: 60.0, mass: 4.0, drag_area: 0.02, added_mass: 3.0, height: 0.2}"
CLUMP = "{kind: clump, at: 100.0, mass: 30.0, volume: 0.004, drag_area: 0.05, added_mass: 2.0, height: 0.3}"
MODULES = "{kind: modules, range: [20.0, 40.0], volume: 0.02, mass: 8.0, drag_area: 0.3, added_mass: 12.0}"
SEABED = (
    "seabed: {z: -100.0, slope: [0.01, -0.02], stiffness: 5.0e+3, damping: 500.0, friction: {axial: 0.3, lateral: 0.5}}"
)
LIST = "[{z: -100.0, velocity: [0.0, 0.0, 0.0]}, {z: 0.0, velocity: [0.3, 0.0, 0.0]}]"
CALM = change(SEA_LIST, f"current: {LIST}", "current: [0, 0, 0]")
POINTS = "[[10.0, 0.0, 0.0], [10.0, 0.0, -20.0], [0.0, 0.0, -35.0]]"
HEAVE = "{heave: {amplitude: 2.0, period: 8.0}, ramp: 16.0}"
GUESS = "guess: straight, direction: [1.0, 0.0, 0.0]"
FREE = "{kind: free}"
HELD = "{kind: pinned, position: [0.0, 0.0, 0.0]}"
AFLOAT = change(
    change(AT_REST, "cable:", "environment: {fluid: {density: 1025, surface: 0}}\ncable:"),
    "mass: 1.0",
    "mass: 1.0, diameter: 0.05",
)
LOOSE = change(AT_REST, f"{HELD}, end: {FREE}", "free, end: free")
RISING = change(AFLOAT, f"{HELD}, end: {FREE}", "free, end: free")

CASES = {
    # --- currents
    "one entry": (SEA_LIST, LIST, "§[{z: 0.0, velocity: [0.3, 0, 0]}]", "environment.fluid.current", "at least 2 entries"),
    "no velocity in an entry": (SEA_LIST, LIST, "[§{z: -100}, {z: 0, velocity: [0, 0, 0]}]", "environment.fluid.current[0].velocity", "add `speed: 0.5` and `direction: 0`"),
    "a number as entry": (SEA_LIST, LIST, "[{z: 0, velocity: [0, 0, 0]}, §3]", "environment.fluid.current[1]", "write {z: 3, velocity: ...}"),
    "the same z twice": (SEA_LIST, LIST, "[{z: 0, velocity: [0, 0, 0]}, {z: §0, velocity: [0, 1, 0]}]", "environment.fluid.current[1].z", "sort the entries"),
    "z up and down": (SEA_LIST, LIST, "[{z: 0, velocity: [0, 0, 0]}, {z: -9, velocity: [0, 1, 0]}, {z: §-8, velocity: [0, 1, 0]}]", "environment.fluid.current[2].z", "sort the entries"),
    "z up and down in a table": (SEA_TOO, PROFILE, "{kind: profile, table: [{z: 0, velocity: [0, 0, 0]}, {z: §0, velocity: [0, 1, 0]}]}", "environment.fluid.current.table[1].z", "sort the entries"),
    "misspelt in an entry": (SEA_LIST, LIST, "[{z: 0, §velocty: [0, 0, 0], velocity: [0, 0, 0]}, {z: -9, velocity: [0, 1, 0]}]", "environment.fluid.current[0].velocty", "did you mean velocity?"),
    "two numbers": (SEA_LIST, LIST, "§[0.3, 0]", "environment.fluid.current", "there are 2"),
    "kind of current": (SEA, POWER, "{kind: §profil}", "environment.fluid.current.kind", "did you mean profile?"),
    "current of no kind": (SEA, POWER, "§{ramp: 3}", "environment.fluid.current.kind", "add `kind: uniform`"),
    "speed beside velocity": (SEA_UNIFORM, "speed: 8.0, direction: 90.0,", "velocity: [0, 8, 0], speed: §8.0,", "environment.fluid.current.speed", "leave the one"),
    "direction without speed": (SEA_UNIFORM, "speed: 8.0, ", "", "environment.fluid.current.velocity", "add `speed: 0.5`"),
    "profile without table": (SEA, POWER, "§profile", "environment.fluid.current.table", "table: [{z: ..., velocity: [x, y, z]}"),
    "uniform with a table": (SEA, POWER, "{kind: uniform, velocity: [0, 1, 0], §table: 3}", "environment.fluid.current.table", "use kind: profile"),
    "bottom over top": (SEA, "bottom: -80.0", "bottom: §80.0", "environment.fluid.current.bottom", "negative"),
    "bottom over surface": (SEA, "top: -1.0, bottom: -80.0", "bottom: §80.0", "environment.fluid.current.bottom", "0 m, the surface"),
    "exponent": (SEA, "exponent: 0.2", "exponent: §0", "environment.fluid.current.exponent", "> 0"),
    # --- waves
    "waves without surface": (SEA_TOO, f"surface: 0.0\n    waves: {REGULAR}", f"waves: {REGULAR}", "environment.fluid.surface", "add `surface: 0` (m)"),
    "waves of no kind": (SEA_TOO, REGULAR, "§{height: 2, period: 7}", "environment.fluid.waves.kind", "add `kind: regular`"),
    "waves, a word": (SEA_TOO, REGULAR, "§regular", "environment.fluid.waves.height", "{kind: regular, height: ..., period: ...}"),
    "irregular": (SEA_TOO, REGULAR, "{kind: §irregular, height: 2, period: 7}", "environment.fluid.waves.kind", "did you mean jonswap?"),
    "gamma of regular waves": (SEA_TOO, REGULAR, "{kind: regular, height: 2, period: 7, §gamma: 3}", "environment.fluid.waves.gamma", "use kind: jonswap"),
    "gamma below one": (SEA, "gamma: 2.0", "gamma: §0.5", "environment.fluid.waves.gamma", ">= 1"),
    "too many components": (SEA, "components: 50", "components: §1001", "environment.fluid.waves.components", "<= 1000"),
    "half a seed": (SEA, "seed: 7", "seed: §7.5", "environment.fluid.waves.seed", "round"),
    "Hs": (SEA, "significant_height: 3.0", "significant_height: 3.0, §Hs: 3", "environment.fluid.waves.Hs", "did you mean significant_height (m)?"),
    "waves one table up": (SEA_TOO, f"    surface: 0.0\n    waves: {REGULAR}", f"  §waves: {REGULAR}", "environment.waves", "did you mean environment.fluid.waves?"),
    "waves without gravity": (SEA_TOO, f"environment:\n  fluid:\n    density: 1025.0\n    current: {PROFILE}\n    surface: 0.0\n    waves: {REGULAR}", f"environment:\n  gravity: 0\n  fluid: {{density: 1025, surface: 0, waves: §{REGULAR}}}", "environment.fluid.waves", "without gravity"),
    "breaking in deep water": (SEA_TOO, REGULAR, "{kind: regular, height: §11, period: 7}", "environment.fluid.waves.height", "less than 10.86 m, because in deep water waves of 7 s are 76.5 m long"),
    "breaking in shallow water": (SEA_TOO, REGULAR, "{kind: regular, height: §2, period: 7, depth: 2}", "environment.fluid.waves.height", "in 2 m of water"),
    "breaking over the seabed": (SEA, "significant_height: 3.0", "significant_height: §30.0", "environment.fluid.waves.significant_height", "in 100 m of water"),
    "two depths": (SEA, "depth: 100.0", "depth: §99.0", "environment.fluid.waves.depth", "follows from the seabed"),
    "waves too fast for the step": (change(SEA_TOO, "model: {kind: catenary}", "model: {kind: catenary}\ntime: {duration: 30, step: §2}"), None, None, "time.step", "a sixth of the shortest period, 1.16 s, of environment.fluid.waves"),
    # --- the seabed
    "stiffnes": (SEA, "slope: [0.01, -0.02], stiffness", "slope: [0.01, -0.02], §stiffnes: 1, stiffness", "environment.seabed.stiffnes", "did you mean stiffness?"),
    "mu": (SEA, "damping: 500.0", "damping: 500.0, §mu: 0.3", "environment.seabed.mu", "did you mean friction: {axial: ..., lateral: ...}?"),
    "half a friction": (SEA_LIST, "friction: 0.4", "friction: §{axial: 0.3}", "environment.seabed.friction.lateral", "add `lateral: ...`"),
    "normal friction": (SEA_LIST, "friction: 0.4", "friction: {axial: 0.3, lateral: 0.3, §normal: 0.4}", "environment.seabed.friction.normal", "did you mean lateral?"),
    "one slope": (SEA, "slope: [0.01, -0.02]", "slope: §0.01", "environment.seabed.slope", "`slope: [0.01, 0]`"),
    "soft as water": (SEA, "stiffness: 5.0e+3", "stiffness: §0", "environment.seabed.stiffness", "> 0"),
    "ground": (SEA, SEABED, f"{SEABED}\n  §ground: 3", "environment.ground", "did you mean seabed: {z: ..., stiffness: ...}?"),
    "depth of the environment": (SEA, SEABED, f"{SEABED}\n  §depth: 100", "environment.depth", "seabed: {z: ..., stiffness: ...}"),
    "a depth for a height": (SEA, "z: -100.0, slope", "z: §100.0, slope", "environment.seabed.z", "write z: -100"),
    "surface under the seabed": (SEA, "surface: 0.0", "surface: §-101.0", "environment.fluid.surface", "seabed at ends.start"),
    "an end in the ground": (OCEAN, "  fluid", "  seabed: {z: -95, stiffness: 1.0e4}\n  fluid", "ends.start.position", "raise it"),
    "a body in the ground": (SEA, "initial_guess: [60.0, 0.0, -80.0]", "initial_guess: §[60.0, 0.0, -110.0]", "ends.end.initial_guess", "raise it"),
    "a way into the ground": (SEA, "by: [10.0, 0.0, -2.0]", "by: §[0.0, 0.0, -120.0]", "ends.start.motion.travel.by", "raise it"),
    "a polyline in the ground": (change(CALM, "{kind: equilibrium, points", "{kind: points, points"), "[10.0, 0.0, -20.0]]", "§[6.0, 0.0, -28.0]]", "initial.points[1]", "raise it"),
    "a straight cable in the ground": (change(CALM, "ends: {start: {kind: free}", "ends: {start: {kind: pinned, position: [0, 0, -20]}"), "{kind: equilibrium, points: [[0.0, 0.0, -20.0], [10.0, 0.0, -20.0]]}", "{kind: straight, direction: §[1, 0, -1]}", "initial.direction", "another direction"),
    # --- attachments
    "neither buoyancy nor volume": (SEA, FLOAT, "§{kind: float, at: 75.0, mass: 4.0}", "cable.attachments[0].buoyancy", "add `buoyancy: ...` (N)"),
    "buoyancy and volume": (SEA, FLOAT, "{kind: float, at: 75.0, buoyancy: 60.0, volume: §3}", "cable.attachments[0].volume", "leave one of them out"),
    "both for modules": (SEA, "volume: 0.02", "volume: §0.02, buoyancy: 3", "cable.attachments[2].volume", "(N/m, net)"),
    "a float that sinks": (SEA, "buoyancy: 60.0", "buoyancy: §-60.0", "cable.attachments[0].buoyancy", "use kind: clump"),
    "a volume that sinks": (SEA_TOO, "volume: 0.2, mass: 20.0", "volume: §0.01, mass: 20.0", "cable.attachments[0].volume", "use kind: clump"),
    "ballast without mass": (SEA_TOO, "buoyancy: -5.0, mass: 8.0", "buoyancy: §-5.0", "cable.attachments[1].buoyancy", "at least 0 N/m"),
    "beyond the end": (SEA, "at: 75.0", "at: §151.0", "cable.attachments[0].at", "150 m"),
    "over the end": (SEA, "range: [20.0, 40.0]", "range: [20.0, §151.0]", "cable.attachments[2].range[1]", "150 m"),
    "backwards": (SEA, "range: [20.0, 40.0]", "range: §[40.0, 20.0]", "cable.attachments[2].range", "[from, to]"),
    "over a point": (SEA, "range: [20.0, 40.0]", "range: §30", "cable.attachments[2].range", "two numbers"),
    "a float in vacuum": (AT_REST, "mass: 1.0}]", "mass: 1.0}], attachments: [{kind: §float, at: 3, volume: 1}]", "cable.attachments[0].kind", "only weighs is kind: clump"),
    "a clump that drags in vacuum": (AT_REST, "mass: 1.0}]", "mass: 1.0}], attachments: [{kind: clump, at: 3, mass: 1, drag_area: §1}]", "cable.attachments[0].drag_area", "leave drag_area out"),
    "buoyancy without gravity": (SEA_TOO, f"environment:\n  fluid:\n    density: 1025.0\n    current: {PROFILE}\n    surface: 0.0\n    waves: {REGULAR}", "environment: {gravity: 0, fluid: {density: 1025}}", "cable.attachments[1].buoyancy", "give volume"),
    "weight of a clump": (SEA, "at: 100.0, mass: 30.0", "at: 100.0, mass: 30.0, §weight: 300", "cable.attachments[1].weight", "mass (kg)"),
    "buoyancy of a clump": (SEA, "at: 100.0, mass: 30.0", "at: 100.0, mass: 30.0, §buoyancy: 300", "cable.attachments[1].buoyancy", "volume (m^3)"),
    "drag of a float": (SEA, "drag_area: 0.02", "drag_area: 0.02, §drag: 1", "cable.attachments[0].drag", "did you mean drag_area (m^2)?"),
    "stretch of a float": (SEA, "at: 75.0", "at: 75.0, §range: [1, 2]", "cable.attachments[0].range", "kind: modules"),
    "point of modules": (SEA, "range: [20.0, 40.0]", "range: [20.0, 40.0], §at: 3", "cable.attachments[2].at", "kind: float or clump"),
    "sinker": (SEA, CLUMP, "{kind: §sinker, at: 3, mass: 3}", "cable.attachments[1].kind", "did you mean clump?"),
    "attachments as a table": (AT_REST, "mass: 1.0}]", "mass: 1.0}], attachments: §{kind: clump, at: 3, mass: 1}", "cable.attachments", "dash"),
    # --- bodies
    "massless": (SEA, BODY, "§{kind: body, volume: 1}", "ends.end.mass", "add `mass: ...` (kg)"),
    "body, a word": (SEA, BODY, "§body", "ends.end.mass", "{kind: body, mass: ...}"),
    "rov": (SEA, BODY, "{kind: §rov, mass: 1}", "ends.end.kind", "did you mean body?"),
    "buoyancy of a body": (SEA, "volume: 0.09", "volume: 0.09, §buoyancy: 3", "ends.end.buoyancy", "volume (m^3)"),
    "position of a body": (SEA, "initial_guess: [60.0", "§position: [0, 0, 0], initial_guess: [60.0", "ends.end.position", "kind: pinned or clamped"),
    "force on a body": (SEA, "volume: 0.09", "volume: 0.09, §force: [1, 0, 0]", "ends.end.force", "thrust"),
    "motion of a body": (SEA, "volume: 0.09", "volume: 0.09, §motion: {ramp: 1}", "ends.end.motion", "kind: pinned or clamped"),
    "a massive free end": (AT_REST, FREE, "{kind: free, §mass: 3}", "ends.end.mass", "kind: body"),
    "a body that floats in vacuum": (AT_REST, FREE, "{kind: body, mass: 3, volume: §1}", "ends.end.volume", "leave volume out"),
    "a body elsewhere": (AT_REST.replace(GUESS, "guess: auto"), FREE, "{kind: body, mass: 3, initial_guess: §[20, 0, 0]}", "ends.end.initial_guess", "a longer cable"),
    "a body beside a direction": (AT_REST, FREE, "{kind: body, mass: 3, initial_guess: §[5, 0, 0]}", "ends.end.initial_guess", "leave initial_guess out"),
    "a body beside the polyline": (SEA_TOO, "{kind: body, mass", "{kind: body, initial_guess: §[10, 0, 1], mass", "ends.start.initial_guess", "leave initial_guess out"),
    "a body beside the straight cable": (AT_REST.replace(f"equilibrium, {GUESS}", "straight, direction: [0, 0, -1]"), FREE, "{kind: body, mass: 3, initial_guess: §[0, 0, -9]}", "ends.end.initial_guess", "leave initial_guess out"),
    "a number for thrust": (SEA, "thrust: [20.0, 0.0, 0.0]", "thrust: §20", "ends.end.thrust", "`thrust: [20, 0, 0]`"),
    # --- mass and volume
    "a body in tonnes": (SEA, "mass: 100.0, volume: 0.09", "mass: §0.1, volume: 0.09", "ends.end.mass", "is mass in t? then mass: 100 (kg); or is volume in litres? then volume: 9e-05 (m^3)"),
    "a clump in cm^3, a thousandfold": (SEA, CLUMP, "{kind: clump, at: 100, mass: §6, volume: 2e-6}", "cable.attachments[1].mass", "this one is 3e+06 kg/m^3"),
    "a clump of steel in tonnes": (SEA, CLUMP, "{kind: clump, at: 100, mass: §0.3, volume: 0.04}", "cable.attachments[1].mass", "is mass in t? then mass: 300 (kg)"),
    "a float in grams": (SEA, FLOAT, "{kind: float, at: 75, mass: §20000, volume: 0.1}", "cable.attachments[0].mass", "is mass in g? then mass: 20 (kg)"),
    "a float in tonnes": (SEA, FLOAT, "{kind: float, at: 75, mass: §0.02, buoyancy: 420}", "cable.attachments[0].mass", "8.2 to 25000 kg/m^3"),
    "modules in litres": (SEA, MODULES, "{kind: modules, range: [20, 40], mass: §8, volume: 20}", "cable.attachments[2].mass", "is volume in litres/m? then volume: 0.02 (m^3/m)"),
    "a float wider than the cable is long": (SEA, FLOAT, "{kind: float, at: 75, volume: §4.0e6}", "cable.attachments[0].volume", "197 m wide, and the cable is 150 m long"),
    "a mass too large for its cable": (SEA, CLUMP, "{kind: clump, at: 100, mass: §1.0e11}", "cable.attachments[1].mass", "densest metal"),
    # --- motion
    "velocity without ramp": (OCEAN, HEAVE, "§{velocity: [1, 0, 0]}", "ends.end.motion.ramp", "add `ramp: ...` (s)"),
    "ramp of a travel": (OCEAN, HEAVE, "{travel: {by: [1, 0, 0], over: 20}, ramp: §3}", "ends.end.motion.ramp", "travel has `over`"),
    "travel of no time": (OCEAN, HEAVE, "{travel: §{by: [1, 0, 0]}}", "ends.end.motion.travel.over", "add `over: ...` (s)"),
    "travel at once": (OCEAN, HEAVE, "{travel: {by: [1, 0, 0], over: §0.05}}", "ends.end.motion.travel.over", "smaller time.step"),
    "ramp at once": (OCEAN, HEAVE, "{velocity: [0.1, 0, 0], ramp: §0.05}", "ends.end.motion.ramp", "a longer ramp"),
    "travel to": (OCEAN, HEAVE, "{travel: {by: [1, 0, 0], over: 20, §to: [0, 0, 1]}}", "ends.end.motion.travel.to", "did you mean by (m)?"),
    "file and velocity": (OCEAN, HEAVE, "{file: x.csv, velocity: §[1, 0, 0], ramp: 3}", "ends.end.motion.velocity", "leave file out"),
    "file and travel": (OCEAN, HEAVE, "{file: x.csv, travel: §{by: [1, 0, 0], over: 20}}", "ends.end.motion.travel", "leave file out"),
    "file and follow": (OCEAN, HEAVE, "{file: x.csv, follow: §waves}", "ends.end.motion.follow", "leave file out"),
    "follow something else": (OCEAN, HEAVE, "{follow: §wave}", "ends.end.motion.follow", "did you mean waves?"),
    "nothing to follow": (OCEAN, HEAVE, "{follow: §waves}", "ends.end.motion.follow", "give environment.fluid.waves"),
    "follow waves that are there at once": (SEA, ", depth: 100.0, ramp: 18.0}", "}", "environment.fluid.waves.ramp", "add `ramp: 18` (s)"),
    "follow waves that jump": (SEA, "depth: 100.0, ramp: 18.0", "depth: 100.0, ramp: §0.1", "environment.fluid.waves.ramp", "follows the waves"),
    "a guided end that travels": (OCEAN, f"pinned, position: [205, 0, 0], motion: {HEAVE}", "guided, tangent: [1, 0, 0], motion: {travel: §{by: [1, 0, 0], over: 20}}", "ends.end.motion.travel", "clamped"),
    "no harmonic in the list": (OCEAN, HEAVE, "{heave: §[], ramp: 3}", "ends.end.motion.heave", "at least one entry"),
    "a list without ramp": (OCEAN, HEAVE, "§{heave: [{amplitude: 0, period: 8}, {amplitude: 1, period: 9}]}", "ends.end.motion", "give `ramp: 18`"),
    "a list too fast for the step": (change(OCEAN, HEAVE, "{heave: [{amplitude: 1, period: 8}, {amplitude: 1, period: 0.1}], ramp: 16}"), "step: 0.02", "step: §0.02", "time.step", "of ends.end.motion.heave[1]"),
    "torn by a travel": (OCEAN, HEAVE, "{travel: §{by: [300, 0, 0], over: 20}}", "ends.end.motion.travel", "a shorter way"),
    "torn by a velocity": (OCEAN, HEAVE, "{velocity: §[3, 0, 0], ramp: 10}", "ends.end.motion.velocity", "a shorter way"),
    # --- where it starts
    "points and guess": (SEA_TOO, "{kind: equilibrium, ", "{kind: equilibrium, guess: §arc, ", "initial.guess", "leave out either"),
    "points and direction": (SEA_TOO, "{kind: equilibrium, ", "{kind: equilibrium, direction: §[1, 0, 0], ", "initial.direction", "leave out either"),
    "one point": (SEA_TOO, POINTS, "§[[0.0, 0.0, -35.0]]", "initial.points", "at least 2"),
    "a point twice": (SEA_TOO, POINTS, "[[10, 0, 0], [10, 0, -20], §[10, 0, -20], [0.0, 0.0, -35.0]]", "initial.points[2]", "leave it out"),
    "points elsewhere": (SEA_TOO, POINTS, "[[10, 0, 0], [10, 0, -20], §[1, 0, -35]]", "initial.points[2]", "held ends"),
    "points too long": (SEA_TOO, POINTS, "§[[10, 0, 0], [25, 0, -20], [0.0, 0.0, -35.0]]", "initial.points", "within 20 %"),
    "direction of an arc": (AT_REST, "guess: straight, direction: ", "guess: arc, direction: §", "initial.direction", "guess: straight"),
    "catenary from one end": (AT_REST, GUESS, "guess: §catenary", "initial.guess", "hold both ends"),
    "too short, inextensible": (change(change(OCEAN, "axial_stiffness: 2.0e8, ", ""), "length: 250", "length: 150"), "[205, 0, 0]", "§[205, 0, 0]", "ends.end.position", "too short"),
    "too short, extensible": (change(OCEAN, "length: 250", "length: 150"), "[205, 0, 0]", "§[205, 0, 0]", "ends.end.position", "too short and would stretch by 52"),
    # --- what nothing holds
    "falls": (LOOSE, "kind: equilibrium", "kind: §equilibrium", "initial.kind", "no seabed to carry it"),
    "falls through water": (SEA_LIST, "\n  seabed: {z: -20.0, stiffness: 1.0e+4, friction: 0.4}", "", "initial.kind", "no seabed to carry it"),
    "rises": (RISING, ", surface: 0", "", "initial.kind", "no surface to stop it"),
    "weighs nothing": (change(LOOSE, "cable:", "environment: {gravity: 0}\ncable:"), "kind: equilibrium", "kind: §equilibrium", "initial.kind", "weighs nothing"),
    "drifts afloat": (change(RISING, "diameter: 0.05", "diameter: 0.05, drag: {normal: 1}"), "surface: 0", "surface: 0, current: [1, 0, 0]", "initial.kind", "against the current"),
    "drifts aground": (SEA_LIST, ", friction: 0.4", "", "initial.kind", "environment.seabed.friction"),
    "is pulled": (change(CALM, ", friction: 0.4", ""), "mass: 10.0", "mass: 10.0, thrust: [9, 0, 0]", "initial.kind", "horizontal force of 9 N"),
    "slides": (CALM, ", friction: 0.4", ", slope: [0.1, 0]", "initial.kind", "slope of the seabed"),
    "lies anywhere": (CALM, "{kind: equilibrium, points: [[0.0, 0.0, -20.0], [10.0, 0.0, -20.0]]}", "§{kind: equilibrium}", "initial.points", "add `points"),
}  # fmt: skip

# What is refused for one reason and contradicts another table as well.
SEVERAL = {"waves, a word", "waves without gravity"}


@pytest.mark.parametrize("name", CASES)
def test_refusal(name: str) -> None:
    refused(CASES[name], alone=name not in SEVERAL)


ACCEPTED = {
    "a lift bag": (SEA, FLOAT, "{kind: float, at: 75, mass: 10, volume: 1}"),
    "syntactic foam": (SEA, MODULES, "{kind: modules, range: [20, 40], mass: 10, volume: 0.2}"),
    "a balloon": (AT_REST.replace("cable:", "environment: {fluid: {density: 1.2}}\ncable:"), "mass: 1.0}]", "mass: 1.0, diameter: 0.02}], attachments: [{kind: float, at: 3, mass: 1, volume: 2}]"),
    "a weight of lead": (SEA, CLUMP, "{kind: clump, at: 100, mass: 1134, volume: 0.1}"),
    "modules that only weigh, rounded": (SEA, MODULES, "{kind: modules, range: [20, 40], mass: 8, buoyancy: -78.4}"),
    "a float that has no mass": (SEA, FLOAT, "{kind: float, at: 75, volume: 3}"),
    "current, rising or falling": (SEA_LIST, LIST, "[{z: 0, velocity: [1, 0, 0]}, {z: -1, velocity: [0, 0, 0]}]"),
    "an end a little in the ground": (OCEAN, "  fluid", "  seabed: {z: -99.9, stiffness: 1.0e4}\n  fluid"),
    "the depth again": (SEA, "depth: 100.0", "depth: 100.00001"),
    "modules that overlap": (SEA, MODULES, f"{MODULES}\n    - {{kind: modules, range: [30, 150], buoyancy: 1}}"),
    "an attachment at either end": (SEA, CLUMP, "{kind: clump, at: 0, mass: 1}\n    - {kind: clump, at: 150, mass: 1}"),
    "a clump in vacuum": (AT_REST, "mass: 1.0}]", "mass: 1.0}], attachments: [{kind: clump, at: 3, mass: 1}]"),
    "a body in vacuum": (AT_REST, FREE, "{kind: body, mass: 3, thrust: [1, 0, 0]}"),
    "a body where the straight cable ends": (AT_REST.replace(f"equilibrium, {GUESS}", "straight, direction: [0, 0, -1]"), FREE, "{kind: body, mass: 3, initial_guess: [0, 0, -10]}"),
    "two bodies afloat": (RISING, "free, end: free}\ninitial: {kind: equilibrium, " + GUESS, "{kind: body, mass: 1, volume: 0.1, initial_guess: [0, 0, 0]}, end: {kind: body, mass: 1, volume: 0.1, initial_guess: [8, 0, 0]}}\ninitial: {kind: equilibrium"),
    "held against each other": (change(CALM, ", friction: 0.4", ""), "{start: {kind: free}, end: {kind: body, mass: 10.0}}", "{start: {kind: free, force: [-1, 0, 0]}, end: {kind: body, mass: 10.0, thrust: [1, 0, 0]}}"),
    "a catenary to a body": (AT_REST.replace(GUESS, "guess: catenary"), FREE, "{kind: body, mass: 3, initial_guess: [5, 0, 0]}"),
    "an arc": (OCEAN, "{kind: equilibrium}", "{kind: equilibrium, guess: arc}"),
    "both ends towed": (change(OCEAN, "position: [0, 0, -100]}", "position: [0, 0, -100], motion: {velocity: [5, 0, 0], ramp: 10}}"), HEAVE, "{velocity: [5, 0, 0], ramp: 10}"),
    "to and fro by lists": (OCEAN, HEAVE, "{heave: [{amplitude: 1, period: 8}], sway: {amplitude: 1, period: 9}, ramp: 16}"),
    "waves that are there at once": (SEA_TOO, ", depth: 60.0", ""),
}  # fmt: skip


@pytest.mark.parametrize("name", ACCEPTED)
def test_accepted(name: str) -> None:
    assert complaints(change(*ACCEPTED[name])) == []


def test_numbers_are_given() -> None:
    (ground,) = complaints(change(OCEAN, "  fluid", "  seabed: {z: -95, stiffness: 1.0e4}\n  fluid"))
    assert "lies 5 m under the seabed" in ground.value and "z >= -95 m" in ground.expected
    for elastic in (True, False):
        text = change(
            change(OCEAN, "length: 250", "length: 150"),
            f"pinned, position: [205, 0, 0], motion: {HEAVE}",
            "pinned, position: [205, 0, 0]",
        )
        (short,) = complaints(text if elastic else change(text, "axial_stiffness: 2.0e8, ", ""))
        assert (
            "228.08989 m from the start" in short.value and "too short" in short.expected and "150 m" in short.expected
        )
    (torn,) = complaints(change(OCEAN, HEAVE, "{travel: {by: [300, 0, 0], over: 20}}"))
    assert "motion to [505, 0, 0] at t = 20 s, 514.8" in torn.value
    (falls,) = complaints(LOOSE)
    assert "98.1 N in all" in falls.expected and falls.value == "equilibrium"


def test_the_sea_is_refused_in_python_too() -> None:
    with pytest.raises(ValueError, match="either buoyancy"):
        Float(at=0, buoyancy=1, volume=1)
    with pytest.raises(ValueError, match="smaller first"):
        Modules(range=(2, 1), volume=1)
    with pytest.raises(ValueError, match="waves need a surface"):
        Fluid(density=1, waves=RegularWaves(height=1, period=8))
    with pytest.raises(ValueError, match="only rise or only fall"):
        CurrentProfile(table=(CurrentPoint(z=0, velocity=(0, 0, 0)), CurrentPoint(z=0, velocity=(0, 0, 0))))
    with pytest.raises(ValueError, match="velocity has to grow from zero"):
        Motion(velocity=(1, 0, 0))
    with pytest.raises(SceneError) as caught:
        validate_scene(
            {
                "environment": {"seabed": {"z": 1.0, "stiffness": 1e4}},
                "cable": {"sections": [{"length": 10, "mass": 1}]},
                "ends": {"start": Pinned(position=(0, 0, 0)), "end": Free()},
                "initial": Equilibrium(),
                "model": CatenaryModel(),
            }
        )
    (complaint,) = caught.value.complaints
    assert complaint.where == "ends.start.position" and complaint.line is None


def test_all_mistakes_of_an_attachment_are_said_at_once() -> None:
    text = change(SEA, FLOAT, "{kind: float, at: -1, buoyancy: -60, mass: x, colour: red}")
    assert [c.where.rpartition(".")[2] for c in complaints(text)] == ["at", "buoyancy", "mass", "colour"]


def test_waves_as_long_as_tides_are_refused() -> None:
    """At 1.2e19 s the formulas of waves in shallow water have no digits left: the tension was not a number."""
    waves = {"kind": "regular", "height": 2.0, "period": 1.2e19, "depth": 20.0}
    with pytest.raises(SceneError, match=r"waves\.period[\s\S]*at most 100000 s[\s\S]*current"):
        validate_scene(cable_scene(
            {"length": 30, "mass": 1, "diameter": 0.03, "axial_stiffness": 1e6}, pinned_at(0, 0, -20),
            pinned_at(5, 0, 5), fluid={"density": 1025.0, "surface": 0.0, "waves": waves}, time=(1, 0.1), initial=None
        ))  # fmt: skip
