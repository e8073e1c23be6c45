"""Numbers of a section of cable, or of what is attached to it: as the scene writes them, or by default."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from itertools import accumulate, chain, pairwise
from typing import NamedTuple, TypeVar

import numpy as np

from hybrid.kernels.state.state import Floats, Line
from hybrid.scene.analysis import RodZone, Straight, ZonesModel
from hybrid.scene.attachments import BendRestrictor, BendStiffener, Clump, Float, Modules, Spread, Swivel
from hybrid.scene.cable import Section
from hybrid.scene.ends import Body
from hybrid.scene.motion_tables import SHIFTS
from hybrid.scene.schema import LineScene

# Limits that a section may have and that only reports ask for: unit, what it is, the stricter one of two.
SECTION_LIMITS: dict[str, tuple[str, str, np.ufunc]] = {
    "min_bend_radius": ("m", "smallest bend radius allowed", np.fmax),
    "max_tension": ("N", "largest tension allowed", np.fmin),
    "min_tension": ("N", "smallest tension allowed", np.fmax),
    "max_contact_force": ("N/m", "largest contact force per length allowed", np.fmin),
}
Kind = TypeVar("Kind")
# Poisson's ratio of a solid round section, used where a rod's torsional stiffness is not given.
POISSON = 0.3


def merged_sections(sections: Sequence[Section]) -> list[Section]:
    """Neighbouring sections that differ in nothing but length, and in what only reports ask for, are one section."""
    merged: list[Section] = []
    for section in (x.model_copy(update=dict.fromkeys((*SECTION_LIMITS, "capacity", "code"))) for x in sections):
        if merged and merged[-1].model_copy(update={"length": section.length}) == section:
            merged[-1] = section.model_copy(update={"length": merged[-1].length + section.length})
        else:
            merged.append(section)
    return merged


def torsional_stiffness(section: Section) -> float:
    """GJ in N m^2; of a solid round section with the bending stiffness given where the scene is silent."""
    if section.torsional_stiffness is not None:
        return section.torsional_stiffness
    return float(np.mean(bending_stiffness(section))) / (1.0 + POISSON)


def mean_compliance(section: Section) -> float:
    """1/EA in 1/N, 0 where nothing stretches; of a table on average, up to what it bears."""
    if section.curve is not None:
        return section.strain_limit / section.borne
    return 1.0 / section.axial_stiffness if section.axial_stiffness else 0.0


def bending_stiffness(section: Section) -> tuple[float, float]:
    """EI about both axes in N m^2, 0 where none is given; of a table that without bend."""
    return section.initial_bending or (0.0, 0.0)


def limits_along(scene: LineScene, s: np.ndarray) -> dict[str, np.ndarray]:
    """Limits (ns,) of the sections at arc lengths s (m), by name: those that the scene gives at all.

    NaN where none is given; the stricter one at a seam.
    """
    found = {}
    for name, (_, _, stricter) in SECTION_LIMITS.items():
        values = [getattr(x, name) for x in scene.cable.sections]
        if any(x is not None for x in values):
            found[name] = _along(scene, s, [np.nan if x is None else x for x in values], stricter)
    return found


def weakest_bending(scene: LineScene, s: np.ndarray) -> np.ndarray:
    """The smaller bending stiffness (ns,) N m^2 at arc lengths s (m), with stiffeners; at a seam the weaker one."""
    found = _along(scene, s, [min(bending_stiffness(x)) for x in scene.cable.sections], np.fmin)
    near, length = 1e-9 * scene.length, scene.length
    for x in attached(scene, BendStiffener):
        a, b = x.range
        inside = (s > a + near if a > near else s >= 0.0) & (s < b - near if b < length - near else s <= length)
        found[inside] += [x.stiffness(float(at)) for at in s[inside]]
    return found


def outer_diameter(scene: LineScene, s: np.ndarray) -> np.ndarray:
    """Outer diameter (ns,) m at arc lengths s (m); at a seam the larger one, NaN where none is given."""
    return _along(scene, s, [np.nan if x.diameter is None else x.diameter for x in scene.cable.sections], np.fmax)


def _along(scene: LineScene, s: np.ndarray, of_section: Sequence[float], choose: np.ufunc) -> np.ndarray:
    """A number per section at arc lengths s (ns,); where two sections meet, what `choose` makes of both."""
    ends = np.cumsum([x.length for x in scene.cable.sections])[:-1]
    near = 1e-9 * scene.length  # a seam that adding up lengths has shifted is still a seam
    values = np.array(of_section, float)
    left, right = (values[np.searchsorted(ends, s + shift)] for shift in (-near, near))
    return np.asarray(choose(left, right))


def rotary_inertia(section: Section) -> tuple[float, float]:
    """Transverse and polar inertia per length, kg m; of a solid round section where only the diameter is given."""
    given = section.rotary_inertia
    if given is None:
        return (
            (section.mass * section.diameter**2 / 16, section.mass * section.diameter**2 / 8)
            if section.diameter
            else (0.0, 0.0)
        )
    return given if isinstance(given, tuple) else (given, 2.0 * given)


def weight(section: Section, scene: LineScene) -> float:
    """Weight in water (air, vacuum) per unstretched length, N/m, positive downwards."""
    fluid = scene.environment.fluid
    displaced = fluid.density * np.pi / 4 * section.diameter**2 if fluid and section.diameter else 0.0
    return float((section.mass - displaced) * scene.environment.gravity)


def attachments_at(scene: LineScene) -> Iterator[tuple[float, Float | Clump | Swivel | Body]]:
    """Everything that sits at a point of the line, with its arc length, m: floats, clumps, bodies at the ends."""
    for x in scene.cable.attachments:
        if not isinstance(x, Spread):
            yield x.at, x
    for at, end in ((0.0, scene.ends.start), (scene.length, scene.ends.end)):
        if isinstance(end, Body):
            yield at, end


def swivels(scene: LineScene) -> list[float]:
    """Arc lengths, m, at which the cable turns freely about itself."""
    return sorted(x.at for x in attached(scene, Swivel))


def attached(scene: LineScene, *kinds: type[Kind]) -> list[Kind]:
    """Attachments of some kinds, such as `Modules`, in the order of the scene."""
    return [x for x in scene.cable.attachments if isinstance(x, kinds)]


def sleeves(scene: LineScene) -> list[tuple[float, float]]:
    """Stretches (m) where a bend stiffener or a restrictor bends with the cable."""
    return [x.range for x in attached(scene, BendStiffener, BendRestrictor)]


def attached_weights(scene: LineScene) -> list[float]:
    """Weight in water of every attachment and end body, N, positive downwards."""
    fluid, gravity = scene.environment.fluid, scene.environment.gravity
    density = fluid.density if fluid else 0.0

    def sinks(x: Float | Clump | Swivel | Modules | BendStiffener | Body) -> float:
        return gravity * (x.mass - (density * x.volume_in(density, gravity) if fluid else 0.0))

    points = [sinks(x) for _, x in attachments_at(scene)]
    spread = (x for x in scene.cable.attachments if isinstance(x, Modules | BendStiffener))
    return points + [sinks(x) * (x.range[1] - x.range[0]) for x in spread]


def section_changes(scene: LineScene) -> tuple[float, ...]:
    """Arc lengths (m) inside the cable where bending stiffness jumps: between sections, at the ends of stiffeners."""
    found = [*accumulate(x.length for x in merged_sections(scene.cable.sections)[:-1])]
    near = 1e-9 * scene.length
    for edge in chain(*sleeves(scene)):
        if near < edge < scene.length - near and all(abs(edge - s) > near for s in found):
            found.append(edge)
    return tuple(sorted(found))


# Where along the cable results are written, and where quantities may have two values.

# Part of the length by which two places, or lengths, that are one may differ by round-off.
SAME_PLACE = 1e-9


class OutputPoints(NamedTuple):
    """Arc lengths, m, of a result: s (ns,), its output points, and jumps, those of them where a value may be two."""

    s: Floats
    jumps: Floats


def output_points(scene: LineScene, longest: float | None = None, at_start: bool = False) -> OutputPoints:
    """The points that `output.points` asks for, those of the history, and all jumps.

    longest: m, of a line that is paid out, how much may be out, and at_start: whether at its start, where s is then
    negative; its points are in material.
    Of points that round-off alone tells apart there is one: a jump before one of the history, that before another.
    """
    asked, length, jumps = scene.output.points, scene.length, jump_points(scene)
    ends = (length - (longest or length), length) if at_start else (0.0, longest or length)
    usual = np.linspace(*ends, asked) if isinstance(asked, int) else np.array(asked, float)
    followed = (x for x in scene.output.history or () if all(abs(x - at) > SAME_PLACE * length for at in jumps))
    more = [*jumps, *distinct(followed, length)]
    if more:
        near = np.abs(usual[:, None] - np.array(more)).min(axis=1) <= SAME_PLACE * length
        usual = np.unique(np.concatenate([usual[~near], more]))
    return OutputPoints(usual, np.array(jumps, float))


def jump_points(scene: LineScene) -> tuple[float, ...]:
    """Arc lengths (m) inside the cable where quantities may have two values, one on each side.

    Point loads, changes of section, ends of modules and stiffeners, joints of rod and catenary in zones that stay where
    they are.
    """
    found = [*section_changes(scene)]
    for item in scene.cable.attachments:
        found += list(item.range) if isinstance(item, Spread) else [item.at]
    if isinstance(scene.model, ZonesModel):
        zones = scene.model.zones
        ends = accumulate(next(iter(zone.model_dump().values())) for zone in zones)
        neighbours = pairwise(isinstance(zone, RodZone) for zone in zones)
        found += [end for end, (left, right) in zip(ends, neighbours, strict=False) if left != right]
    return tuple(distinct(found, scene.length))


def distinct(places: Iterable[float], length: float) -> list[float]:
    """Places (m) inside a cable of that length (m) in order, one of those that round-off alone tells apart."""
    out: list[float] = []
    for x in sorted(places):
        if x - (out[-1] if out else 0.0) > SAME_PLACE * length and length - x > SAME_PLACE * length:
            out.append(float(x))
    return out


# Sizes of a whole scene: its weight in its surroundings, what it presses on its bed with, a tension typical of it.


def pressing(scene: LineScene) -> float:
    """The least weight per length (N/m) that a cable of the scene puts on its bed; its dry weight if it would float."""
    heavy = [w for w in (weight(x, scene) for x in scene.cable.sections) if w > 0.0]
    dry = [x.mass * (scene.environment.gravity or 1.0) for x in scene.cable.sections]
    return min(heavy or dry)


def net_weight(scene: LineScene) -> float:
    """Weight of the whole line with its attachments in its surroundings, N, positive downwards."""
    return sum(weight(x, scene) * x.length for x in scene.cable.sections) + sum(attached_weights(scene))


def tension_scale(scene: LineScene, sections: Sequence[Section], bending: bool, fastest: float = 0.0) -> float:
    """A tension typical of the scene, N: the largest that weight, loads, bending, drag, motion or speed can ask for.

    bending: whether bending counts, as it does where there is a rod; fastest: the current's highest speed, m/s.
    """
    length = scene.length
    mass = sum(s.mass * s.length for s in sections)
    candidates = [
        sum(abs(weight(s, scene)) * s.length for s in sections) + sum(abs(x) for x in attached_weights(scene))
    ]
    if bending:
        candidates += [max(bending_stiffness(s)) / length**2 for s in sections]
    fluid = scene.environment.fluid
    if fluid and fastest:
        candidates += [
            0.5 * fluid.density * s.diameter * s.drag.normal * fastest**2 * s.length
            for s in sections
            if s.drag and s.diameter
        ]
        candidates += [0.5 * fluid.density * x.drag_area * fastest**2 for _, x in attachments_at(scene)]
    for end in scene.ends.both:
        for load in end.loads:
            candidates.append(float(np.abs(load.values).max()) / (length if load.what == "moment" else 1.0))
        motion = end.prescribed_motion
        if motion is not None:
            candidates += [
                mass * abs(x.amplitude) * (2 * np.pi / x.period) ** 2
                for name, parts in motion.harmonics().items()
                if name in SHIFTS
                for x in parts
            ]
    first, last = (end.held_position for end in scene.ends.both)
    if first and last and all(s.stiffness for s in sections):
        free = length / sum(s.length / s.stiffness for s in sections if s.stiffness)  # N per unit strain
        candidates.append(free * max(0.0, float(np.linalg.norm(np.subtract(last, first))) / length - 1.0))
    velocity = scene.initial.velocity if isinstance(scene.initial, Straight) else None
    if velocity:
        candidates.append(mass / length * float(np.dot(velocity, velocity)))
    scale = max(candidates)
    if scale > 0.0:
        return scale
    return mass / length * (length / scene.time.duration) ** 2 if scene.time else 1.0


def wave_step(line: Line, scale: float) -> float:
    """The shortest time, s, in which a wave passes a catenary cell, 0 without catenaries.

    A wave of tension, or, where a cell does not stretch, across the line under the tension `scale`, N.
    """
    cells = line.spin == 0
    mass = 0.5 * (line.mass[:-1] + line.mass[1:] - line.point_mass[:-1] - line.point_mass[1:])
    soft = np.where(line.ck > 0.0, line.ck, 1.0 / scale)
    return float(np.sqrt((soft * mass * line.h)[cells].min())) if cells.any() else 0.0
