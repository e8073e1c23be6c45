"""The sea of a scene as arrays: current over depth, wave components, seabed, and how they grow in time."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from hybrid.kernels.laws.bed import HEIGHTS
from hybrid.kernels.laws.obstacle_motion import carry_obstacles
from hybrid.kernels.laws.soil import LATERAL, LEFT_A, LEFT_L, NUMBERS, OVER, PART, STRENGTH, SUCTION, WEDGE
from hybrid.kernels.state.forces import BREAKOUT, FRICTION, REMEMBERS, SEABED, SOIL
from hybrid.kernels.state.obstacle_rows import ANGLE, EACH, INERTIA, ROLLED
from hybrid.kernels.state.state import NO_SLOW, Floats, Sea, State, no_sea, with_waves
from hybrid.model.driven_end import DrivenEnd
from hybrid.model.ends import rise
from hybrid.model.facets import facet_tables
from hybrid.model.obstacle_motion import courses_of
from hybrid.model.obstacles import obstacle_rows
from hybrid.model.scales import pressing
from hybrid.model.spectra import waves_of
from hybrid.scene.dispersion import wavenumber
from hybrid.scene.schema import CurrentProfile, LineScene, PowerLawCurrent, Seabed, UniformCurrent
from hybrid.scene.spectra import SumOfWaves
from hybrid.scene.waves import GivenWaves, MeasuredWaves, RecordedWaves, RegularWaves, StreamFunctionWaves, Waves

# Contact sets in over half the penetration of a cable at rest: it then rests on the linear part.
ONSET = 0.5
# Elastic travel of friction as a part of the diameter: far below what anyone measures on a seabed.
SLIP_LENGTH = 0.01
# Heights at which a power law is tabulated, and how they crowd towards its foot, where it is steep:
# linear interpolation of the usual seventh root is then right to 1e-5 of the largest speed.
POWER_LAW_HEIGHTS, CROWDING = 800, 8


class Surroundings:
    """Evaluates the sea at a time into the arrays of `Sea` (overwritten by the next call)."""

    def __init__(self, values: Sea, names: tuple[str, ...] = (), driven: Mapping[str, DrivenEnd] | None = None) -> None:
        """names: of obstacles; driven: those of them that are set from outside."""
        self.values, self.names, self.driven = values, names, dict(driven or {})
        self.at(np.inf)

    def on(self, cells: int) -> Surroundings:
        """The same sea around a line of another number of cells."""
        axis, slip, slid, bed = (np.zeros((cells + 1, 3)) for _ in range(4))
        values = self.values._replace(flow=np.zeros((cells + 1, 7)), axis=axis, slip=slip, slid=slid, bed=bed)
        if values.carried.size:
            values = values._replace(
                grip=np.zeros((cells + 1, self.values.grip.shape[1])),
                rolling=np.zeros((len(self.values.rolling), cells + 1, 5)),
            )
        return self.with_values(values)

    def with_values(self, values: Sea) -> Surroundings:
        """The same sea and obstacles, with arrays of their own."""
        return Surroundings(values, self.names, self.driven)

    def at(self, t: float) -> Sea:
        """The sea at t; t = infinity asks for what stays: the current fully grown, and no waves."""
        now = self.values.now
        now[0] = t if math.isfinite(t) else 0.0
        current_ramp, wave_ramp = self.values.ramps.tolist()
        now[1] = rise(t, current_ramp)[0]
        now[2], now[3] = rise(t, wave_ramp) if math.isfinite(t) else (0.0, 0.0)
        if self.values.carried.size:
            carry_obstacles(float(now[0]), float(now[0]), self.values)
        return self.values

    @property
    def waves_of_vessels(self) -> Floats:
        """Components (W, 6) by which vessels with an RAO move, as of `Sea.waves`.

        An RAO is of linear waves: of one wave of finite height, whose harmonics travel together, it is the first.
        """
        return self.values.waves[:1] if self.values.stretched == 0.0 else self.values.waves

    def roll_as(self, state: State) -> None:
        """Sheaves that turn freely are turned as in a state."""
        if state.sheave.size:
            self.values.carried[:, ROLLED] = state.sheave[:, ANGLE]

    def elevation(self, x: float, y: float, t: float) -> tuple[float, float, float, float]:
        """Elevation of the surface above still water (m) at a place and time, its rate (m/s) and slopes along x, y."""
        A, w, kx, ky, phase, _ = self.values.waves.T
        angle = kx * x + ky * y - w * t + phase
        part, rate = rise(t, float(self.values.ramps[1]))
        eta, down = float(np.sum(A * np.cos(angle))), A * np.sin(angle)
        return part * eta, part * float(w @ down) + rate * eta, -part * float(kx @ down), -part * float(ky @ down)


def surroundings(scene: LineScene, cells: int) -> Surroundings:
    """Everything around a line of `cells` cells that a scene names."""
    fluid, bed = scene.environment.fluid, scene.environment.seabed
    sea = no_sea(cells)
    current_ramp = wave_ramp = None
    if fluid is not None:
        z, current = current_table(scene)
        sea = sea._replace(z=z, current=current)
        current_ramp = getattr(fluid.current, "ramp", None)
        if fluid.surface is not None:
            sea = sea._replace(surface=float(fluid.surface))
        if fluid.waves is not None:
            depth = scene.environment.depth or math.inf
            waves, gravity = fluid.waves, scene.environment.gravity
            orbits = waves.steady(depth, gravity).orbits if isinstance(waves, StreamFunctionWaves) else None
            sea = with_waves(sea, components(waves, depth, gravity), depth, orbits)
            wave_ramp = fluid.waves.ramp
    if bed is not None:
        if bed.depths is not None:
            grid = bed.depths.surface
            heights = -grid.values.reshape(-1, HEIGHTS)
            heights[:, 0] += bed.z
            sea = sea._replace(bed_x=grid.x, bed_y=grid.y, bed_heights=heights)
        slope = bed.slope or (0.0, 0.0)
        normal = np.array([0.0 - slope[0], 0.0 - slope[1], 1.0]) / math.hypot(*slope, 1.0)
        sea = sea._replace(
            normal=normal, offset=float(normal[2] * bed.z), stiffness=bed.spring, damping=bed.damping,
            onset=ONSET * pressing(scene) / bed.spring, soil=soil_numbers(bed),
        )  # fmt: skip
        if rubs(bed):
            friction = np.array([bed.friction.axial, bed.friction.lateral]) if bed.friction else np.zeros(2)
            sea = sea._replace(friction=friction, slip_length=slip_length(scene, bed))
    if scene.obstacles:
        boxes, facets, _ = facet_tables(scene.obstacles)
        sea = sea._replace(obstacles=obstacle_rows(scene), boxes=boxes, facets=facets)
        if not (bed is not None and rubs(bed)):
            sea = sea._replace(
                friction=np.zeros(2), slip_length=1.0
            )  # of the bed: friction of obstacles is in their rows
    around = Surroundings(sea._replace(ramps=np.array([current_ramp or 0.0, wave_ramp or 0.0])), tuple(scene.obstacles))
    return _moved(scene, cells, around)


def _moved(scene: LineScene, cells: int, around: Surroundings) -> Surroundings:
    """The same with the motions of obstacles."""
    sea = around.values
    courses = courses_of(scene, sea.obstacles, around.waves_of_vessels, float(sea.ramps[1]), around.elevation)
    if not courses.carried.size:
        return around
    grip = np.zeros((cells + 1, EACH * len(sea.obstacles)))
    rolling = np.zeros((3 * int((courses.carried[:, INERTIA] > 0.0).sum()), cells + 1, 5))
    return Surroundings(
        sea._replace(courses=courses.moves, carried=courses.carried, grip=grip, rolling=rolling),
        around.names,
        courses.driven,
    )


def rubs(bed: Seabed | None) -> bool:
    """Whether a seabed has friction, or resists sideways."""
    if bed is None or bed.friction is None:
        return False
    lateral = bed.soil is not None and bed.soil.lateral is not None
    return bed.friction.axial > 0.0 or bed.friction.lateral > 0.0 or lateral


def bed_bits(bed: Seabed | None) -> int:
    """The forces that a seabed asks for (kernels.state.forces)."""
    if bed is None:
        return 0
    breaks = rubs(bed) and bed.friction is not None and bed.friction.residual is not None
    return SEABED | FRICTION * rubs(bed) | SOIL * (bed.soil is not None) | BREAKOUT * breaks


def soil_numbers(bed: Seabed) -> Floats:
    """`Sea.soil` of a bed; empty: of one that does not remember."""
    soil, friction, lateral = bed.soil, bed.friction, bed.soil.lateral if bed.soil is not None else None
    if not bed_bits(bed) & REMEMBERS:
        return NO_SLOW
    out = np.zeros(NUMBERS)
    out[PART] = 1.0
    if soil is not None:
        given = soil.shear_strength, soil.gradient, soil.bearing, soil.power, soil.stiffness, soil.suction
        out[STRENGTH : SUCTION + 1] = given
    if lateral is not None:
        out[LATERAL : WEDGE + 1] = 1.0, lateral.unit_weight, lateral.wedge
    if friction is not None and friction.residual is not None:
        pairs = zip(friction.residual, (friction.axial, friction.lateral), strict=True)
        out[LEFT_A : LEFT_L + 1] = [left / most if most > 0.0 else 1.0 for left, most in pairs]
        out[OVER] = friction.breakout
    return out


def slip_length(scene: LineScene, bed: Seabed) -> float:
    """Elastic travel (m) before a touching cable slides."""
    if bed.friction is not None and bed.friction.travel is not None:
        return bed.friction.travel
    widths = [x.diameter for x in scene.cable.sections if x.diameter]
    return SLIP_LENGTH * min(widths) if widths else 0.1 * pressing(scene) / bed.spring


def current_table(scene: LineScene) -> tuple[Floats, Floats]:
    """Heights (K,) m, increasing, and the current there (K, 3) m/s; linear between them, constant beyond."""
    fluid = scene.environment.fluid
    current = fluid.current if fluid else None
    if current is None:
        return np.zeros(1), np.zeros((1, 3))
    if isinstance(current, UniformCurrent):
        return np.zeros(1), np.array([current.flow], float)
    if isinstance(current, PowerLawCurrent):
        top = current.top_under(fluid.surface if fluid else None)
        part = (np.arange(POWER_LAW_HEIGHTS + 1) / POWER_LAW_HEIGHTS) ** CROWDING  # of the height above the foot
        angle = np.radians(current.veer) * (1.0 - part)
        x, y, up = current.flow
        speed = part**current.exponent
        turned = np.column_stack(
            [x * np.cos(angle) - y * np.sin(angle), x * np.sin(angle) + y * np.cos(angle), np.full(part.size, up)]
        )
        return current.bottom + (top - current.bottom) * part, speed[:, None] * turned
    points = current.table if isinstance(current, CurrentProfile) else current
    if isinstance(points[0], float):
        return np.zeros(1), np.array([points], float)
    ordered = sorted(points, key=lambda p: p.z)
    return np.array([p.z for p in ordered], float), np.array([p.flow for p in ordered], float)


def components(waves: Waves, depth: float, gravity: float) -> Floats:
    """Wave components (W, 6): amplitude, frequency, kx, ky, phase, k (m, 1/s, 1/m, 1/m, rad, 1/m).

    An irregular sea gets components of equal energy, each at the root mean square of its share of the spectrum, with
    phases drawn from the seed: no frequency is a multiple of another, so the sea does not repeat itself, and its
    variance is that of the spectrum exactly.
    """
    place = (0.0, 0.0)
    if isinstance(waves, StreamFunctionWaves):
        return _harmonics(waves, depth, gravity)
    if isinstance(waves, RegularWaves):
        amplitude, omega = np.array([0.5 * waves.height]), np.array([2 * np.pi / waves.period])
        phase, towards = np.radians([waves.phase]), np.array([math.radians(waves.direction)])
    elif isinstance(waves, SumOfWaves):
        seas = [waves_of(x, gravity, i, len(waves.spectra)) for i, x in enumerate(waves.spectra)]
        amplitude, omega, phase, towards = (np.concatenate(x) for x in zip(*seas, strict=True))
    elif isinstance(waves, GivenWaves | RecordedWaves | MeasuredWaves):
        amplitude, omega, phase, heading = waves.recorded.waves.T
        towards = np.array([math.radians(x) for x in heading.tolist()])
        place = getattr(waves, "position", place)
    else:
        amplitude, omega, phase, towards = waves_of(waves, gravity)
    k = np.array([wavenumber(w, None if math.isinf(depth) else depth, gravity) for w in omega])
    kx, ky = (k * np.array([part(x) for x in towards.tolist()]) for part in (math.cos, math.sin))
    if any(place):
        phase = phase - kx * place[0] - ky * place[1]
    return np.column_stack([amplitude, omega, kx, ky, phase, k])


def _harmonics(waves: StreamFunctionWaves, depth: float, gravity: float) -> Floats:
    """Components of one wave of finite height, which travel together."""
    steady = waves.steady(depth, gravity)
    j = np.arange(1, waves.order + 1)
    k, towards = j * steady.k, math.radians(waves.direction)
    return np.column_stack([
        steady.elevation, j * (2 * np.pi / waves.period), k * math.cos(towards), k * math.sin(towards),
        j * math.radians(waves.phase), k,
    ])  # fmt: skip
