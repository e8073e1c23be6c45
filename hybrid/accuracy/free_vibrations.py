"""Free vibrations that ramps and moves of ends leave in a line that hardly anything damps, and what steps make of them.

A forced motion forgets, a free vibration does not: its phase is late by a part of a radian in every radian, and steps
take a part of its energy.  Runs with longer steps have lost what the result has lost, and their differences do not show
it.  Here the line is linear about its first output: nodes with its masses, joined by its tension and its stiffness.
docs/errors.md
"""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise
from math import isfinite, pi
from typing import NamedTuple

import numpy as np

from hybrid.model.output_points import output_points
from hybrid.scene.analysis import CatenaryModel, Equilibrium
from hybrid.scene.attachments import Clump
from hybrid.scene.cable import Section
from hybrid.scene.ends import Body
from hybrid.scene.motion import EndMotion
from hybrid.scene.motion_tables import Motion
from hybrid.scene.schema import Scene
from hybrid.simulation.run_sample import END_FORCES, RunSample

Floats = np.ndarray

RAW = {shown: raw for raw, shown in END_FORCES.items()}
UNITS = {"position": "m", "curvature": "1/m", "bending_moment": "N m"} | dict.fromkeys(RAW, "N")

# Elements of the line, and its lowest modes that are looked at.
ELEMENTS, MODES = 40, 12
# A motion is integrated by Gauss's rule of so many points, in at least as many pieces as it has periods of a vibration
# and as few as these; modes with more periods than MOST_PERIODS are left out: a ramp that is so long leaves nothing.
GAUSS, FEWEST_PIECES, MOST_PERIODS = 8, 8, 200
# A section that does not stretch is so many times as stiff as its tension and bending; fewer output points than these
# do not show the shape; a fluid of more than this density, kg/m^3, damps what lasts in air.
STIFF, FEWEST_POINTS, GAS = 1.0e4, 6, 5.0
# Frequencies of a motion and of a vibration count as different by at least so many rad in the duration.
CLOSE = 1.0
# An error by steps that this makes is worth a word where it exceeds what is asked, and the error figure so many times;
# where nothing is asked, this part of the largest value.
TIMES_THE_FIGURE, PART = 1.5, 0.01
# Times that are looked at, at most; of longer runs some of theirs, from so many at a time.
ROWS, BLOCK = 20_000, 2000


class Lost(NamedTuple):
    """What steps make of free vibrations in a quantity: its largest error, and the vibration that makes most of it."""

    error: float  # m, N, N m or 1/m
    amplitude: float  # of all of them together, in the same unit
    period: float  # s
    step: float  # s, that leaves an error of a tenth of this


class Line(NamedTuple):
    """A line as linear: freedoms are the positions of its nodes, and the directions in which clamps hold its ends."""

    stiffness: Floats  # (n, n)
    mass: Floats  # (n,)
    bends: Floats  # (nodes, 3, n) changes of curvature
    rigidity: Floats  # (nodes,) N m^2
    held: Floats  # (n,) whether a freedom is prescribed
    damping: tuple[float, float, float]  # Rayleigh's 1/s and s; 1/2 density x diameter x Cd, kg/m^2


def uncertain_by_vibrations(
    scene: Scene, result: RunSample, errors: Mapping[str, float], allowed: Mapping[str, float] | None
) -> list[tuple[str, str]]:
    """The event that says so where steps lose more of free vibrations than error figures show.

    errors: figures, by quantity; allowed: errors that are asked, None: nothing is.
    """
    worst, of = 1.0, ""
    found = lost_vibrations(scene, result)
    for name, lost in found.items():
        values = result.values.get(RAW.get(name, name))
        if name not in errors or values is None or (allowed is not None and name not in allowed):
            continue
        if allowed is None:
            sizes = np.asarray(values) if name in ("curvature", "bending_moment") else np.linalg.norm(values, axis=-1)
            least = PART * float(np.abs(sizes).max())
        else:
            least = allowed[name]
        least = max(least, TIMES_THE_FIGURE * errors[name])
        if least > 0.0 and lost.error > worst * least:
            worst, of = lost.error / least, name
    if not of:
        return []
    lost, unit = found[of], UNITS[of]
    steps = np.diff(result.forces[:, 0])
    text = (
        f"{of.replace('end_force_', 'force at the ').replace('_', ' ')}: a free vibration with a period of "
        f"{lost.period:.2g} s is left by the ramp or move of an end, up to {lost.amplitude:.2g} {unit}, which hardly "
        f"anything damps; steps of {float(np.median(steps)):.2g} s make it late or lose it, an error of up to "
        f"{lost.error:.2g} {unit}, which the error figure ({errors[of]:.2g} {unit}) does not see; time.step: "
        f"{lost.step:.2g} shows it, damping ends it, and a longer ramp or move leaves less of it"
    )
    return [("error uncertain", text)]


def lost_vibrations(scene: Scene, result: RunSample) -> dict[str, Lost]:
    """By quantity, what steps of the result make of free vibrations; empty where none is left, or it is not known."""
    motions = [end.prescribed_motion for end in scene.ends.both]
    begins = [_quiet_from(x) for x in motions if x is not None]
    if not begins or any(x is None for x in begins) or not _is_simple(scene) or len(result.forces) < 2:
        return {}
    line = linear_line(scene, result)
    if line is None:
        return {}
    duration = float(result.forces[-1, 0])
    quiet = min(max(x for x in begins if x is not None), duration)
    w, modes, rest = _modes(line)
    fits = w * quiet <= 2.0 * pi * MOST_PERIODS
    w, modes = w[fits], modes[:, fits]
    if not w.size or not (w > 0.0).all():
        return {}
    drive = modes.T @ (line.mass[~line.held, None] * rest)  # (modes, prescribed)
    size = _amplitudes(scene, motions, w, drive, quiet, duration)
    t = np.concatenate([[0.0], result.forces[:, 0]])
    t = t[np.concatenate([[True], np.diff(t) > 0.0])]
    factors = Factors(_radius(scene))
    of_mass, of_stiffness, of_drag = line.damping
    fall = 0.5 * (of_mass + of_stiffness * w * w)
    lengths = np.linalg.norm(_nodes(modes, line), axis=-1)
    cubes = (lengths**3).sum(axis=0) * scene.length / (len(lengths) - 1)
    drift, t = factors.drift(w, t)
    dies = np.exp(-np.outer(t, fall)) / (1.0 + np.outer(t, 4.0 / (3.0 * pi) * of_drag * w * cubes * size))
    wrong = np.abs(1.0 - np.exp(drift)) * dies * size
    wrong = wrong[t >= min(quiet, 0.5 * duration)]
    found = {}
    for name, shapes in _outputs(line, modes).items():
        each = np.abs(shapes) if shapes.ndim == 2 else np.linalg.norm(shapes, axis=1)  # (places, modes)
        errors = np.sqrt((wrong**2) @ (each**2).T)  # (times, places)
        error, whole = float(errors.max()), float(np.sqrt(((size * each) ** 2).sum(axis=1)).max())
        at = np.unravel_index(int(errors.argmax()), errors.shape)
        k = int((wrong[at[0]] * each[at[1]]).argmax())
        found[name] = Lost(error, whole, 2.0 * pi / w[k], factors.step(w[k], duration))
    return found


def _is_simple(scene: Scene) -> bool:
    """Whether a line is one of which `linear_line` knows all: from an equilibrium, in a gas or none, no ground."""
    fluid, ends = scene.environment.fluid, scene.ends.both
    still = fluid is None or (fluid.density <= GAS and fluid.waves is None)
    plain = all(isinstance(x, Clump) for x in scene.cable.attachments)
    steady = not any(x.loads or x.release is not None or getattr(x, "payout", None) for x in ends)
    at_rest = isinstance(scene.initial, Equilibrium)
    return still and plain and steady and at_rest and scene.environment.seabed is None


def _quiet_from(motion: Motion) -> float | None:
    """When an end moves as harmonics alone do, s; None: never."""
    if motion.file is not None or motion.follow is not None or motion.vessel is not None:
        return None
    travel = motion.travel
    return max(motion.ramp or 0.0, travel.begin + travel.over if travel is not None else 0.0)


def _radius(scene: Scene) -> float:
    return scene.time.rho_inf if scene.time is not None else 0.5


def linear_line(scene: Scene, result: RunSample) -> Line | None:
    """The line about its first output; None: too few output points show it."""
    s, n = output_points(scene).s, ELEMENTS
    s = s[result.places] if result.places.size else s
    place, pull = (np.asarray(result.values[x][:1])[0] for x in ("position", "tension"))
    if not FEWEST_POINTS <= s.size == len(place):
        return None
    at = np.linspace(0.0, scene.length, n + 1)
    h, middle = scene.length / n, 0.5 * (at[1:] + at[:-1])
    x = np.column_stack([np.interp(at, s, place[:, k]) for k in range(3)])
    tension = np.interp(middle, s, pull)
    sections = [_section_at(scene, y) for y in middle]
    string = isinstance(scene.model, CatenaryModel)
    rigid = np.array([0.0 if string else (y.weakest_bending or 0.0) for y in sections])
    usual = STIFF * max(float(np.abs(tension).max()), float(rigid.max()) / h**2)
    axial = np.array([usual if y.stiffness is None else y.stiffness for y in sections])
    size = 3 * (n + 3)  # nodes, and two directions
    along = np.diff(x, axis=0)
    along /= np.linalg.norm(along, axis=1)[:, None]
    stiffness = np.zeros((size, size))
    for i, d in enumerate(along):
        spring = axial[i] / h * np.outer(d, d) + tension[i] / h * (np.eye(3) - np.outer(d, d))
        a, b = slice(3 * i, 3 * i + 3), slice(3 * i + 3, 3 * i + 6)
        for p, q, factor in ((a, a, 1.0), (b, b, 1.0), (a, b, -1.0), (b, a, -1.0)):
            stiffness[p, q] += factor * spring
    bends, per_node = np.zeros((n + 1, 3, size)), np.zeros(n + 1)
    per_node[1:-1] = 0.5 * (rigid[1:] + rigid[:-1])
    per_node[[0, -1]] = rigid[[0, -1]]
    for i in range(1, n):
        d = along[i] + along[i - 1]
        across = (np.eye(3) - np.outer(d, d) / (d @ d)) / h**2
        for j in (i - 1, i, i + 1):
            bends[i, :, 3 * j : 3 * j + 3] = (-2.0 if j == i else 1.0) * across
        stiffness += per_node[i] * h * bends[i].T @ bends[i]
    held = np.zeros(size, bool)
    held[-6:] = True
    for end, i, j, k in ((scene.ends.start, 0, 1, n + 1), (scene.ends.end, n, n - 1, n + 2)):
        held[3 * i : 3 * i + 3] = end.held_position is not None
        if end.held_tangent is None or not per_node[i]:
            continue
        across = np.eye(3) - np.outer(along[min(i, n - 1)], along[min(i, n - 1)])
        sign = 1.0 if j > i else -1.0  # directions are those of increasing s
        soft = 1.0 if not isfinite(end.spring) else end.spring / (end.spring + 2.0 * per_node[i] / h)
        parts = {j: 1.0, i: -1.0, k: -sign * h}
        for m, part in parts.items():
            bends[i, :, 3 * m : 3 * m + 3] = soft * part * 2.0 / h**2 * across
        stiffness += (per_node[i] * h / 2.0 / max(soft, 1e-12)) * bends[i].T @ bends[i]
    return Line(stiffness, _masses(scene, sections, h), bends, per_node, held, _damping(scene, sections))


def _section_at(scene: Scene, s: float) -> Section:
    until = 0.0
    for section in scene.cable.sections:
        until += section.length
        if s <= until:
            return section
    return scene.cable.sections[-1]


def _masses(scene: Scene, sections: list[Section], h: float) -> Floats:
    """Of all freedoms, kg; directions have none."""
    n, mass = len(sections), np.zeros(len(sections) + 3)
    for i, section in enumerate(sections):
        mass[i : i + 2] += 0.5 * h * section.mass
    for item in scene.cable.attachments:
        if isinstance(item, Clump):
            mass[min(n, round(item.at / h))] += item.mass
    for end, i in zip(scene.ends.both, (0, n), strict=True):
        mass[i] += end.mass if isinstance(end, Body) else 0.0
    return np.repeat(mass, 3)


def _damping(scene: Scene, sections: list[Section]) -> tuple[float, float, float]:
    """The least of Rayleigh's two coefficients and of 1/2 density x diameter x Cd in all sections."""
    rayleigh = [x.damping for x in sections]
    of_mass = min(x.mass if x is not None else 0.0 for x in rayleigh)
    of_stiffness = min(x.stiffness if x is not None else 0.0 for x in rayleigh)
    fluid = scene.environment.fluid
    density = fluid.density if fluid is not None else 0.0
    drag = min(0.5 * density * (x.diameter or 0.0) * (x.drag.normal if x.drag is not None else 0.0) for x in sections)
    return of_mass, of_stiffness, drag


def _modes(line: Line) -> tuple[Floats, Floats, Floats]:
    """Of the lowest free vibrations: rad/s (m,) and shapes (free, m) of mass 1; and how what is prescribed moves the

    free nodes at rest (free, held).  rad/s 0: some of it can move at no cost.
    """
    free, root = ~line.held, np.sqrt(line.mass[~line.held])
    inner, coupling = line.stiffness[np.ix_(free, free)], line.stiffness[np.ix_(line.held, free)]
    squares, vectors = np.linalg.eigh(inner / np.outer(root, root))
    if not squares[0] > 1e-12 * squares[-1]:
        return np.zeros(1), np.zeros((root.size, 1)), np.zeros(coupling.T.shape)
    shapes = vectors / root[:, None]
    rest = -(shapes / squares) @ (shapes.T @ coupling.T)
    return np.sqrt(squares[:MODES]), shapes[:, :MODES], rest


def _nodes(modes: Floats, line: Line) -> Floats:
    """Shapes (nodes, m, 3) of modes."""
    whole = np.zeros((line.held.size, modes.shape[1]))
    whole[~line.held] = modes
    return np.moveaxis(whole[:-6].reshape(-1, 3, modes.shape[1]), 1, 2)


def _outputs(line: Line, modes: Floats) -> dict[str, Floats]:
    """What a unit of each mode is in outputs, (places, 3, m)."""
    whole = np.zeros((line.held.size, modes.shape[1]))
    whole[~line.held] = modes
    bent = np.einsum("kij,jm->kim", line.bends, whole)
    found = {"position": whole[:-6].reshape(-1, 3, modes.shape[1])}
    if line.rigidity.any():
        found |= {"curvature": bent, "bending_moment": line.rigidity[:, None, None] * bent}
    pulls = line.stiffness @ whole
    for name, first in (("end_force_start", 0), ("end_force_end", line.held.size - 9)):
        if line.held[first]:
            found[name] = pulls[None, first : first + 3]
    return found


def _amplitudes(
    scene: Scene, motions: list[Motion | None], w: Floats, drive: Floats, quiet: float, duration: float
) -> Floats:
    """Of the free vibrations that are there once ends move as harmonics alone, (m,), by modes of mass 1.

    q'' + w^2 q = -drive u'': integral of u'' exp(-i w t) until then, less what harmonics go on to add.
    """
    held = [which for which, end in enumerate(scene.ends.both) if end.held_position is not None]
    column = {which: 3 * k for k, which in enumerate(held)}  # of `drive`: ends that are held, then two directions
    t, weights = _gauss(motions, quiet, float(w.max()))
    total = np.zeros(w.size, complex)
    for which, (motion, end) in enumerate(zip(motions, scene.ends.both, strict=True)):
        if motion is None:
            continue
        moved = EndMotion(motion, end.held_position, np.eye(3))
        tangent = np.array(end.held_tangent or (0.0, 0.0, 0.0), float)
        tangent /= max(float(np.linalg.norm(tangent)), 1e-300)
        turning = drive[:, 3 * len(held) + 3 * which :][:, :3]
        moving = drive[:, column[which] : column[which] + 3] if which in column else np.zeros((w.size, 3))
        rates = np.array([np.concatenate([v, np.cross(spin, tangent)]) for _, v, _, spin in map(moved.at, t.tolist())])
        both = np.hstack([moving, turning])
        waves = np.exp(-1j * np.outer(t, w))
        inside = rates @ both.T * waves  # (t, m)
        total += inside[-1] + 1j * w * (weights @ inside[:-1])
        if quiet >= duration:
            continue
        for axis, amplitude, o, phase in moved.terms().harmonics:
            unit = np.zeros(6)
            along = amplitude * np.eye(6)[int(axis)]
            unit[:3], unit[3:] = along[:3], np.cross(along[3:], tangent)
            near = np.where(o < w, -1.0, 1.0) * np.maximum(np.abs(o - w), CLOSE / duration)
            up = np.exp(1j * (near * quiet + phase)) / (1j * near)
            down = np.exp(-1j * ((o + w) * quiet + phase)) / (-1j * (o + w))
            total -= (both @ unit) * (-o * o) / 2j * (up - down)
    return np.asarray(np.abs(total) / w)


def _gauss(motions: list[Motion | None], quiet: float, w: float) -> tuple[Floats, Floats]:
    """Times until `quiet`, s, and their weights in an integral over motions and vibrations of up to w; and `quiet`."""
    found = {0.0, quiet}
    for motion in motions:
        if motion is not None:
            travel = motion.travel
            found |= {motion.ramp or 0.0} | (
                {travel.begin, travel.begin + travel.over} if travel is not None else set()
            )
    breaks = sorted(x for x in found if x <= quiet)
    x, each = np.polynomial.legendre.leggauss(GAUSS)
    times, weights = [], []
    for a, b in pairwise(breaks):
        ends = np.linspace(a, b, max(FEWEST_PIECES, int(w * (b - a) / pi)) + 1)
        half = 0.5 * (ends[1] - ends[0])
        times.append((ends[:-1, None] + half * (1.0 + x)).ravel())
        weights.append(np.tile(half * each, ends.size - 1))
    return np.concatenate([*times, [quiet]]), np.concatenate([*weights, []])


class Factors:
    """By what generalized-alpha multiplies a free vibration in a step, over what the vibration itself does: its log."""

    def __init__(self, radius: float) -> None:
        self._at = np.geomspace(1e-3, 1e3, 600)  # rad to a step
        am, af = (2.0 * radius - 1.0) / (radius + 1.0), radius / (radius + 1.0)
        ga = 0.5 - am + af
        be = 0.25 * (1.0 - am + af) ** 2
        w2 = self._at**2
        below = (1.0 - am) + w2 * (1.0 - af) * be
        new = np.stack([-w2, -w2 * (1.0 - af), -am - w2 * (1.0 - af) * (0.5 - be)], axis=-1) / below[:, None]
        one = np.ones_like(w2)
        rows = [np.stack(x, axis=-1) for x in ((one, one, (0.5 - be) * one), (0 * one, one, (1.0 - ga) * one))]
        matrix = np.stack([rows[0] + be * new, rows[1] + ga * new, new], axis=1)
        roots = np.linalg.eigvals(matrix)
        root = roots[np.arange(w2.size), roots.imag.argmax(axis=1)]
        self._log = np.log(np.abs(root)) + 1j * (np.abs(np.angle(root)) - self._at)

    def of(self, angle: Floats) -> Floats:
        """Of steps of so many radians; of short ones as their cube."""
        inside, cube = np.maximum(angle, self._at[0]), np.minimum(angle / self._at[0], 1.0) ** 3
        return np.asarray(np.interp(inside, self._at, self._log) * cube)

    def drift(self, w: Floats, t: Floats) -> tuple[Floats, Floats]:
        """(times, m) since the start, and these times, s: of all steps, or of so many as fit into memory."""
        every = -(-len(t) // ROWS)
        parts, now = [np.zeros((1, w.size), complex)], np.zeros(w.size, complex)
        for a in range(0, len(t) - 1, every * BLOCK):
            steps = self.of(np.outer(np.diff(t[a : a + every * BLOCK + 1]), w))
            sums = now + np.cumsum(np.add.reduceat(steps, np.arange(0, len(steps), every)), axis=0)
            parts, now = [*parts, sums], sums[-1]
        return np.vstack(parts), np.append(t[:-1:every], t[-1])

    def step(self, w: float, duration: float) -> float:
        """The step, s, that leaves a tenth of the vibration wrong at the end."""
        angle = np.geomspace(1e-3, 1.0, 200)
        fits = np.abs(1.0 - np.exp(self.of(angle) * (w * duration / angle))) <= 0.1
        return float(angle[fits].max(initial=angle[0]) / w)
