"""The sea of a scene as arrays: current over depth, wave components, seabed, and how they grow in time."""

from __future__ import annotations

import math

import numpy as np

from hybrid.kernels.laws.bed import HEIGHTS
from hybrid.kernels.state.state import Floats, Sea, no_sea, with_waves
from hybrid.model.ends import rise
from hybrid.model.obstacles import obstacle_rows
from hybrid.model.scales import pressing
from hybrid.scene.schema import (
    CurrentProfile,
    JonswapWaves,
    PowerLawCurrent,
    RegularWaves,
    Scene,
    Seabed,
    UniformCurrent,
)
from hybrid.scene.sea import wavenumber

# Contact sets in over half the penetration of a cable at rest: it then rests on the linear part.
ONSET = 0.5
# Elastic travel of friction as a part of the diameter: far below what anyone measures on a seabed.
SLIP_LENGTH = 0.01
# Heights at which a power law is tabulated, and how they crowd towards its foot, where it is steep:
# linear interpolation of the usual seventh root is then right to 1e-5 of the largest speed.
POWER_LAW_HEIGHTS, CROWDING = 800, 8
# Frequencies of an irregular sea, in peak frequencies: outside lies less than 0.2 % of its energy.
LOWEST, HIGHEST = 0.3, 6.0


class Surroundings:
    """Evaluates the sea at a time into the arrays of `Sea` (overwritten by the next call)."""

    def __init__(self, values: Sea, names: tuple[str, ...] = ()) -> None:
        """names: of obstacles."""
        self.values, self.names = values, names
        self.at(np.inf)

    def on(self, cells: int) -> Surroundings:
        """The same sea around a line of another number of cells."""
        axis, slip, slid, bed = (np.zeros((cells + 1, 3)) for _ in range(4))
        values = self.values._replace(flow=np.zeros((cells + 1, 7)), axis=axis, slip=slip, slid=slid, bed=bed)
        return Surroundings(values, self.names)

    def at(self, t: float) -> Sea:
        """The sea at t; t = infinity asks for what stays: the current fully grown, and no waves."""
        now = self.values.now
        now[0] = t if math.isfinite(t) else 0.0
        current_ramp, wave_ramp = self.values.ramps.tolist()
        now[1] = rise(t, current_ramp)[0]
        now[2], now[3] = rise(t, wave_ramp) if math.isfinite(t) else (0.0, 0.0)
        return self.values

    def elevation(self, x: float, y: float, t: float) -> tuple[float, float, float, float]:
        """Elevation of the surface above still water (m) at a place and time, its rate (m/s) and slopes along x, y."""
        A, w, kx, ky, phase, _ = self.values.waves.T
        angle = kx * x + ky * y - w * t + phase
        part, rate = rise(t, float(self.values.ramps[1]))
        eta, down = float(np.sum(A * np.cos(angle))), A * np.sin(angle)
        return part * eta, part * float(w @ down) + rate * eta, -part * float(kx @ down), -part * float(ky @ down)


def surroundings(scene: Scene, cells: int) -> Surroundings:
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
            sea = with_waves(sea, components(fluid.waves, depth, scene.environment.gravity), depth)
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
            normal=normal, offset=float(normal[2] * bed.z), stiffness=bed.stiffness, damping=bed.damping,
            onset=ONSET * pressing(scene) / bed.stiffness,
        )  # fmt: skip
        if rubs(bed):
            friction = np.array([bed.friction.axial, bed.friction.lateral]) if bed.friction else np.zeros(2)
            sea = sea._replace(friction=friction, slip_length=slip_length(scene, bed))
    if scene.obstacles:
        sea = sea._replace(obstacles=obstacle_rows(scene))
        if not (bed is not None and rubs(bed)):
            sea = sea._replace(
                friction=np.zeros(2), slip_length=1.0
            )  # of the bed: friction of obstacles is in their rows
    return Surroundings(sea._replace(ramps=np.array([current_ramp or 0.0, wave_ramp or 0.0])), tuple(scene.obstacles))


def rubs(bed: Seabed | None) -> bool:
    """Whether a seabed has friction."""
    return bed is not None and bed.friction is not None and (bed.friction.axial > 0.0 or bed.friction.lateral > 0.0)


def slip_length(scene: Scene, bed: Seabed) -> float:
    """Elastic travel (m) before a touching cable slides."""
    widths = [x.diameter for x in scene.cable.sections if x.diameter]
    return SLIP_LENGTH * min(widths) if widths else 0.1 * pressing(scene) / bed.stiffness


def current_table(scene: Scene) -> tuple[Floats, Floats]:
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


def components(waves: RegularWaves | JonswapWaves, depth: float, gravity: float) -> Floats:
    """Wave components (W, 6): amplitude, frequency, kx, ky, phase, k (m, 1/s, 1/m, 1/m, rad, 1/m).

    An irregular sea gets components of equal energy, each at the root mean square of its share of the JONSWAP
    spectrum (Hasselmann et al. 1973), with phases drawn from the seed: no frequency is a multiple of
    another, so the sea does not repeat itself, and its variance is that of the spectrum exactly.
    """
    if isinstance(waves, RegularWaves):
        amplitude = np.array([0.5 * waves.height])
        omega = np.array([2 * np.pi / waves.period])
        phase = np.radians([waves.phase])
    else:
        n = waves.components
        omega = frequencies(2 * np.pi / waves.peak_period, waves.gamma, n)
        amplitude = np.full(n, 0.25 * waves.significant_height * math.sqrt(2.0 / n))
        phase = np.random.default_rng(waves.seed).uniform(0.0, 2 * np.pi, n)
    k = np.array([wavenumber(w, None if math.isinf(depth) else depth, gravity) for w in omega])
    towards = math.radians(waves.direction)
    return np.column_stack([amplitude, omega, k * math.cos(towards), k * math.sin(towards), phase, k])


def jonswap(omega: Floats, peak: float, gamma: float) -> Floats:
    """JONSWAP spectrum over frequency (1/s), not normalised."""
    width = np.where(omega <= peak, 0.07, 0.09)
    crest = np.exp(-0.5 * ((omega - peak) / (width * peak)) ** 2)
    return np.asarray(omega**-5.0 * np.exp(-1.25 * (peak / omega) ** 4) * gamma**crest)


def frequencies(peak: float, gamma: float, n: int) -> Floats:
    """Root mean squares of n parts of equal energy of a JONSWAP spectrum, 1/s.

    The variance of the sea and that of its rate are then those of the spectrum.
    """
    omega = peak * np.geomspace(LOWEST, HIGHEST, 20_001)
    S = jonswap(omega, peak, gamma)
    energy, rate = (
        np.concatenate([[0.0], np.cumsum(0.5 * (y[1:] + y[:-1]) * np.diff(omega))]) for y in (S, omega**2 * S)
    )
    parts = np.interp(np.arange(n + 1) / n * energy[-1], energy, rate)
    return np.asarray(np.sqrt(np.diff(parts) * n / energy[-1]))
