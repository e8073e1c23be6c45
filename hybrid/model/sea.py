"""The sea of a scene as arrays: current over depth, wave components, seabed, and how they grow in time."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from hybrid.kernels.laws.obstacles import carry_obstacles
from hybrid.kernels.laws.seabed import HEIGHTS, LATERAL, LEFT_A, LEFT_L, NUMBERS, OVER, PART, STRENGTH, SUCTION, WEDGE
from hybrid.kernels.state.report import ANGLE, BREAKOUT, EACH, FRICTION, INERTIA, REMEMBERS, ROLLED, SEABED, SOIL
from hybrid.kernels.state.state import NO_SLOW, Floats, Sea, State, no_sea, with_waves
from hybrid.model.ends import DrivenEnd, rise
from hybrid.model.obstacles import courses_of, facet_tables, obstacle_rows
from hybrid.model.sections import pressing
from hybrid.scene.schema import LineScene
from hybrid.scene.sea import CurrentProfile, PowerLawCurrent, Seabed, UniformCurrent
from hybrid.scene.wave_theory import (
    JonswapWaves,
    OchiHubbleWaves,
    PiersonMoskowitzWaves,
    Spectrum,
    Spreading,
    SumOfWaves,
    TorsethaugenWaves,
    wavenumber,
)
from hybrid.scene.waves import (
    FINE,
    GivenWaves,
    MeasuredWaves,
    RecordedWaves,
    RegularWaves,
    StreamFunctionWaves,
    Waves,
    shares,
)

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
        self.at_time(np.inf)

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

    def at_time(self, t: float) -> Sea:
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
        sea = sea._replace(normal=normal, offset=float(normal[2] * bed.z), stiffness=bed.spring, damping=bed.damping)
        sea = sea._replace(onset=ONSET * pressing(scene) / bed.spring, soil=soil_numbers(bed))
        if rubs(bed):
            friction = np.array([bed.friction.axial, bed.friction.lateral]) if bed.friction else np.zeros(2)
            sea = sea._replace(friction=friction, slip_length=slip_length(scene, bed))
    if scene.obstacles:
        boxes, facets, _ = facet_tables(scene.obstacles)
        sea = sea._replace(obstacles=obstacle_rows(scene), boxes=boxes, facets=facets)
        if not rubs(bed):  # of the bed: friction of obstacles is in their rows
            sea = sea._replace(friction=np.zeros(2), slip_length=1.0)
    around = Surroundings(sea._replace(ramps=np.array([current_ramp or 0.0, wave_ramp or 0.0])), tuple(scene.obstacles))
    sea = around.values
    courses = courses_of(scene, sea.obstacles, around.waves_of_vessels, float(sea.ramps[1]), around.elevation)
    if not courses.carried.size:
        return around
    grip = np.zeros((cells + 1, EACH * len(sea.obstacles)))
    rolling = np.zeros((2 * int((courses.carried[:, INERTIA] > 0.0).sum()), cells + 1, 5))
    sea = sea._replace(courses=courses.moves, carried=courses.carried, grip=grip, rolling=rolling)
    return Surroundings(sea, around.names, courses.driven)


def rubs(bed: Seabed | None) -> bool:
    """Whether a seabed has friction, or resists sideways."""
    if bed is None or bed.friction is None:
        return False
    lateral = bed.soil is not None and bed.soil.lateral is not None
    return bed.friction.axial > 0.0 or bed.friction.lateral > 0.0 or lateral


def bed_bits(bed: Seabed | None) -> int:
    """The forces that a seabed asks for (kernels.state.report)."""
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
    omega, phase = j * (2 * np.pi / waves.period), j * math.radians(waves.phase)
    return np.column_stack([steady.elevation, omega, k * math.cos(towards), k * math.sin(towards), phase, k])


# Irregular seas as sums of linear waves: spectra, their parts of equal energy, directions that spread.
#
# symbol   meaning                                  unit
# w, w_p   angular frequency, at the peak           1/s
# S        spectrum of the elevation                m^2 s
# H        significant height                       m
# l        shape of a part of Ochi and Hubble       -
# s        exponent of the spreading                -

# Frequencies of an irregular sea, in peak frequencies: outside lies less than 0.2 % of its energy.
LOWEST, HIGHEST = 0.3, 6.0


def jonswap(omega: Floats, peak: float, gamma: float) -> Floats:
    """JONSWAP spectrum over frequency (1/s), not normalised."""
    width = np.where(omega <= peak, 0.07, 0.09)
    crest = np.exp(-0.5 * ((omega - peak) / (width * peak)) ** 2)
    return np.asarray(omega**-5.0 * np.exp(-1.25 * (peak / omega) ** 4) * gamma**crest)


def ochi_hubble(omega: Floats, parts: list[tuple[float, float, float]]) -> Floats:
    """Spectrum (m^2 s) over frequency (1/s) of parts of significant height (m), peak (1/s) and shape l.

    (1/4) a^l H^2/(Gamma(l) w^(4 l + 1)) exp(-a/w^4), a = (4 l + 1) w_p^4/4 (Ochi and Hubble 1976), of each part; its
    integral is H^2/16, its largest value at w_p, and l = 1 is the spectrum of Pierson and Moskowitz.
    """
    S = np.zeros_like(omega)
    for height, peak, shape in parts:
        x = (shape + 0.25) * (peak / omega) ** 4
        size = shape * np.log(x) - x - np.log(omega) - math.lgamma(shape)
        S += 0.25 * height**2 * np.exp(size)
    return S


def torsethaugen(omega: Floats, height: float, period: float, gravity: float) -> Floats:
    """Spectrum (m^2 s) of swell and wind sea over frequency (1/s); height: m; period: s, of the higher peak.

    Torsethaugen 1996, as a public code of Norsk Hydro has it (MSS, torsetSpectrum): x^-n exp(-(n/m) x^-m) gamma^.. of
    each part, x = w/w_p, of energy H^2/16 here exactly; gamma is 1 at least.
    """
    return np.sum([_torsethaugen_part(omega, *x) for x in torsethaugen_parts(height, period, gravity)], axis=0)


def torsethaugen_parts(height: float, period: float, gravity: float) -> list[tuple[float, float, float, float, float]]:
    """Significant height (m), peak (1/s), n, m and gamma of wind sea and swell."""
    limit = 6.6 * height ** (1.0 / 3.0)  # s, of a sea that is fully grown on the fetch
    n = 0.5 * math.sqrt(height) + 3.2
    peaked = 35.0 * (1.0 + 3.5 * math.exp(-height))
    if period < limit:
        short = (limit - period) / (limit - 2.0 * math.sqrt(height))
        wind = 0.7 + 0.3 * math.exp(-((short / 0.5) ** 2))
        steepness = 2.0 * math.pi * wind * height / (gravity * period**2)
        gamma = max(peaked * steepness**0.857, 1.0)
        swell = math.sqrt(1.0 - wind**2) * height
        return [(wind * height, 2 * np.pi / period, n, 4.0, gamma), (swell, 2 * np.pi / (limit + 2.0), n, 4.0, 1.0)]
    long = (period - limit) / (25.0 - limit)
    swell = 0.6 + 0.4 * math.exp(-((long / 0.3) ** 2))
    wind = math.sqrt(1.0 - swell**2) * height
    gamma = max(peaked * (2.0 * math.pi * height / (gravity * limit**2)) ** 0.857 * (1.0 + 6.0 * long), 1.0)
    parts = [(swell * height, 2 * np.pi / period, n, 4.0, gamma)]
    if wind > 0.0:
        m = 4.0 * (1.0 - 0.7 * math.exp(-height / 3.0))
        order = (n - 1.0) / m
        factor = m / math.gamma(order) * (n / m) ** order
        size = factor * wind**2 / (16.0 * 0.08 * (1.0 - math.exp(-height / 3.0)) * 0.4**n)
        parts.append((wind, 2 * np.pi / size ** (1.0 / (n - 1.0)), n, m, 1.0))
    return parts


def _torsethaugen_part(omega: Floats, height: float, peak: float, n: float, m: float, gamma: float) -> Floats:
    def shape(w: Floats) -> Floats:
        x = w / peak
        width = np.where(x <= 1.0, 0.07, 0.09)
        return np.asarray(x**-n * np.exp(-n / m * x**-m) * gamma ** np.exp(-0.5 * ((x - 1.0) / width) ** 2))

    fine = peak * np.geomspace(0.1, 100.0, FINE)
    return np.asarray(height**2 / 16.0 * shape(omega) / np.trapezoid(shape(fine), fine))


def directions(spreading: Spreading, n: int, draw: np.random.Generator) -> Floats:
    """Angles (n,) rad from the mean direction, one for each wave, in random order.

    The distribution cos^2s of half the angle is cut into n parts of equal energy, and in each an angle is drawn: with
    y the sine of half the angle, (1 + y)/2 has a beta distribution with both parameters s + 1/2.
    """
    from scipy.special import betaincinv  # slow to import

    part = (draw.permutation(n) + draw.uniform(size=n)) / n
    half = spreading.exponent + 0.5
    return np.asarray(2.0 * np.arcsin(2.0 * betaincinv(half, half, part) - 1.0))


def waves_of(sea: Spectrum, gravity: float, order: int = 0, of: int = 1) -> tuple[Floats, Floats, Floats, Floats]:
    """Amplitudes (m), frequencies (1/s), phases and directions (rad), (n,) each, of an irregular sea.

    order, of: which it is of how many that act together: their frequencies lie between each other, and their phases are
    drawn anew, so that seas that are alike are independent.
    """
    omega, S, height = _spectrum(sea, gravity)
    n = sea.components
    w, share = shares(omega, S, n, order / of)
    amplitude = 0.25 * height * np.sqrt(2.0 * share)
    if not order:
        amplitude = np.full(n, 0.25 * height * math.sqrt(2.0 / n))
    draw = np.random.default_rng([sea.seed, order] if order else sea.seed)
    phase = draw.uniform(0.0, 2 * np.pi, n)
    towards = np.full(n, math.radians(sea.direction))
    if sea.spreading is not None:
        towards += directions(sea.spreading, n, draw)
    return amplitude, w, phase, towards


def _spectrum(sea: Spectrum, gravity: float) -> tuple[Floats, Floats, float]:
    """Fine frequencies (1/s) of a sea, its spectrum there in any unit, and its significant height (m)."""
    if isinstance(sea, OchiHubbleWaves):
        parts = [(x.significant_height, 2 * np.pi / x.peak_period, x.shape) for x in sea.parts]
        peaks = [peak for _, peak, _ in parts]
        omega = np.geomspace(LOWEST * min(peaks), HIGHEST * max(peaks), FINE)
        return omega, ochi_hubble(omega, parts), sea.significant_height
    if isinstance(sea, TorsethaugenWaves):
        peaks = [x[1] for x in torsethaugen_parts(sea.significant_height, sea.peak_period, gravity)]
        omega = np.geomspace(LOWEST * min(peaks), HIGHEST * max(peaks), FINE)
        return omega, torsethaugen(omega, sea.significant_height, sea.peak_period, gravity), sea.significant_height
    assert isinstance(sea, JonswapWaves | PiersonMoskowitzWaves)
    peak = 2 * np.pi / sea.main_period
    omega = peak * np.geomspace(LOWEST, HIGHEST, FINE)
    return omega, jonswap(omega, peak, getattr(sea, "gamma", 1.0)), sea.significant_height
