"""A material on nodes: the arrays of `Line` for a mesh and the kinds of its cells."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from hybrid.kernels.laws.axial_law import SHIFT
from hybrid.kernels.laws.bending_law import (
    EACH,
    ENERGY,
    FIRST_A,
    FIRST_B,
    GIVE,
    HALF_A,
    HALF_B,
    LAST_A,
    LAST_B,
)
from hybrid.kernels.laws.element import NO_SPRING
from hybrid.kernels.laws.water import DIAMETER, LIFT_A, LIFT_B, OFFSET, RAMP
from hybrid.kernels.machine.binding import Packed, Table
from hybrid.kernels.mesh.remesh import OF_POINTS, PER_LENGTH, Cable, blank_line_job, fill_line
from hybrid.kernels.state.report import (
    AXIAL_LAW,
    BENDING_LAW,
    BENDING_SLIP,
    BODIES,
    FRICTION,
    ROTARY,
    SEABED,
    SOIL,
    STIFFNESS_DAMPING,
)
from hybrid.kernels.state.state import (
    NO_BEND_LAW,
    NO_LAW,
    NO_PLANE,
    NO_TORSION,
    NO_WAKE_LAW,
    TENSION_TORQUE,
    Floats,
    Line,
    blank_line,
)
from hybrid.model.material import Material, elastic_layer, nodes_at
from hybrid.scene.section_laws import Curve, Layer, slopes

# What inertia the sections of rods have.
NO_INERTIA, ABOUT_CHORDS, WITH_SECTIONS = range(3)

lines = Packed(blank_line, given=("bits", "plane", "torsion", *TENSION_TORQUE))


def line_on(
    material: Material, s: Floats, rod: np.ndarray, more_bits: int = 0, inertia: int = WITH_SECTIONS, without: int = 0
) -> Line:
    """The line of a material with nodes s (N+1,) and rod cells where `rod` (N,) is true.

    more_bits: forces that the surroundings ask for; without: those that are left out all the same.
    inertia: what cross-sections of rods have; of rods that come and go `inertia_of_zones`.
    """
    bits = (material.bits | more_bits) & ~without
    if rod.any() and (material.polar[material.piece(0.5 * (s[:-1] + s[1:]))] > 0.0).any():
        bits |= ROTARY * (inertia != NO_INERTIA)
    else:
        inertia = NO_INERTIA
    if material.curves is not None:
        bits |= AXIAL_LAW
    if material.bends is not None:
        bits |= BENDING_LAW
    if material.layered:
        bits |= BENDING_SLIP
    cable, cells = cable_on(material, s, bits, inertia), (np.arange(rod.size), rod)
    return on_base(material, cable, s, cells, bits, Table(blank_line_job))


Cells = tuple[NDArray[np.int64], np.ndarray]


def on_base(
    material: Material, cable: Cable, s: Floats, cells: Cells, bits: int, job: Table, plane: Floats = NO_PLANE
) -> Line:
    """The line of a material with nodes s (N+1,) m on base cells.

    cable: that on these; cells: (N,) base cells of its cells, and whether they are rod; job: a table of
    kernels.mesh.remesh.LineJob.
    """
    of_cell, rod = cells
    h, of = np.diff(s), material.piece(0.5 * (s[:-1] + s[1:]))
    torque, twist = material.torque_by_tension(h, of)
    torsion = torsion_zones(material, h, rod, of)
    line: Line = lines(h.size, bits=bits, plane=plane, torsion=torsion, tension_torque=torque, tension_twist=twist)
    job.bind(cable=cable, nodes=s, base_of_cell=of_cell, rod=rod, line=line)
    fill_line(job.numbers)
    if material.curves is not None:
        law, law_table = axial_law(material, h, of)
        line = line._replace(law=law, law_table=law_table)
    if material.bends is not None:
        bent, table = bend_law(material, line, of)
        line = line._replace(bend_law=bent, bend_table=table)
    if bits & BENDING_SLIP:
        line = with_slip(line, material, of)
    if material.vortices.size:
        line = line._replace(wake_law=wake_law(material, s, of))
    if bits & SOIL:
        line = line._replace(bed_width=bed_width(material, h, of))
    return line


def made_of(material: Material, inertia: int = WITH_SECTIONS) -> Floats:
    """(K, COLUMNS) of each piece of a material what cells of it are made of (kernels.mesh.remesh)."""
    of = {name: getattr(material, name) for name in PER_LENGTH}
    if inertia == NO_INERTIA:
        of["rotary"] = of["polar"] = np.full(material.polar.size, np.nan)
    elif inertia == ABOUT_CHORDS:
        of["rotary"] = 0.0 * material.polar
    return np.column_stack([material.weight, material.B, material.kappa, *of.values()])


def cable_on(material: Material, base: Floats, bits: int, inertia: int) -> Cable:
    """A material on base cells (n+1,) m; bits: forces that are on; inertia: as of `made_of`."""
    of, place = material.piece(0.5 * (base[:-1] + base[1:])), nodes_at(material.at, base)
    load, turns = np.zeros(base.size, np.int8), np.zeros(base.size, np.int8)
    load[place], turns[nodes_at(material.swivels, base)] = 1, 1
    points = np.zeros((len(OF_POINTS), base.size))
    held = np.array([material.held_tangent, material.held_twist], np.int8).T.copy()
    made, EI, w = made_of(material, inertia)[of], material.mean_bending[of], np.abs(material.submerged_weight[of])
    cable = Cable(made, EI, w, points, np.zeros(len(points)), load, turns, held, np.array(material.springs))
    put_points(material, place, cable, bits)
    return cable


def put_points(material: Material, place: np.ndarray, cable: Cable, bits: int) -> None:
    """Bodies at the base nodes `place`; what is off is not a number."""
    on = {"point_mass": True, "point_lift": True, "footing": material.footing.size > 0 or bits & (SEABED | FRICTION)}
    of = {"point_lift": material.lift, "footing": material.footing, **material.points}
    for row, name in enumerate(OF_POINTS):
        cable.blank[row] = 0.0 if on.get(name, bits & BODIES) else np.nan
        cable.points[row] = cable.blank[row]
        if of[name].size:
            cable.points[row, place] += of[name]


def spins_freely(material: Material) -> bool:
    """Whether only inertia holds the spin of rods that come and go.

    Where no torque passes from end to end, a rod between joints turns freely about its chords, and what turns it there
    turns it at once where nothing has inertia: the damping of its bend by half a turn where the bend goes through zero,
    friction until nothing slides.
    """
    turned = material.rubs or material.bits & STIFFNESS_DAMPING
    return not material.passes_torque and bool(turned) and bool(material.polar.any())


def inertia_of_zones(material: Material) -> int:
    """What inertia the sections of rods that come and go have: all that is given, else what nothing but it holds."""
    return WITH_SECTIONS if material.sections_turn else ABOUT_CHORDS if spins_freely(material) else NO_INERTIA


def with_spin_inertia(line: Line, material: Material) -> Line:
    """The line with inertia of its rods about their chords, where nothing else holds their spin from now on."""
    if line.bits & ROTARY or not spins_freely(material):
        return line
    polar = line.h * line.spin * material.polar[material.piece(0.5 * (line.s[:-1] + line.s[1:]))]
    return line._replace(bits=line.bits | ROTARY, polar=polar, rotary=0.0 * polar)


def torsion_zones(material: Material, h: Floats, rod: np.ndarray, of: np.ndarray) -> Floats:
    """Catenary zones that a torque passes through, (K, 5) as `Line.torsion`; none where an end turns freely.

    h: (N,) m, cells; rod: (N,) whether they are; of: (N,) their pieces.  Half of a rod's cell beside a zone counts as
    the zone's: from the frame in its middle.
    """
    GJ = material.B[of, 2]
    if rod.all() or not material.passes_torque:
        return NO_TORSION
    rows = []
    edges = np.flatnonzero(np.diff(np.concatenate([[0], ~rod, [0]])))
    for a, b in edges.reshape(-1, 2):
        share = h[max(a - 1, 0) : b + 1].copy()
        share[0] *= 0.5 if a > 0 else 1.0
        share[-1] *= 0.5 if b < h.size else 1.0
        cells = slice(max(a - 1, 0), b + 1)
        if not GJ[cells].all():
            continue
        soft = share / GJ[cells]
        tau = float(soft @ np.nan_to_num(material.tau[of[cells]]) / soft.sum())
        rows.append((a, b, soft.sum(), share @ material.kappa[of[cells], 2], tau))
    return np.array(rows, float).reshape(-1, 5)


def bed_width(material: Material, h: Floats, of: np.ndarray) -> Floats:
    """`bed_width` (N+1,) m of a line with cells of lengths h (N,) m on pieces `of` (N,): means."""
    D, before, after = material.outer_diameter[of], np.concatenate([[0.0], h]), np.concatenate([h, [0.0]])
    one, other = np.concatenate([D[:1], D]), np.concatenate([D, D[-1:]])
    return np.asarray(one + after / (before + after) * (other - one))


def wake_law(material: Material, s: Floats, of: np.ndarray) -> Floats:
    """`wake_law` of a line with nodes s (N+1,) m and cells on pieces `of` (N,); phases begin once round along it."""
    row, half = material.vortices[of], 0.5 * np.diff(s)
    out = np.zeros((s.size, NO_WAKE_LAW.shape[1]))
    out[1:, LIFT_A], out[:-1, LIFT_B] = half * row[:, 0], half * row[:, 0]
    sheds = (row[:, 1] > 0.0).astype(float)
    of_node = np.zeros((s.size, 5))
    for sides in (slice(1, None), slice(None, -1)):
        of_node[sides] += row[:, 1:]
    count = np.concatenate([[0.0], sheds]) + np.concatenate([sheds, [0.0]])
    out[:, DIAMETER : RAMP + 1] = of_node / np.maximum(count, 1.0)[:, None]
    out[:, OFFSET] = 2.0 * np.pi * s / material.around
    return out


def axial_law(material: Material, h: Floats, of: np.ndarray) -> tuple[Floats, Floats]:
    """`law` and `law_table` of a line with cells of lengths h (N,) m on pieces `of` (N,)."""
    law, rows, begin = np.zeros((h.size, NO_LAW.shape[1])), [], 0
    for k, piece in enumerate(material.curves or ()):
        cells = of == k
        if piece is None or not cells.any():
            continue
        rows.append(_with_energy(piece.rows))
        law[cells, :SHIFT] = (begin, begin + len(piece.rows), *piece.dynamic, *piece.working, *piece.creep)
        begin += len(piece.rows)
    return law, np.concatenate(rows)


# Layers that slip on each other as a line bends: of the elements of a line on its cells.


def with_slip(line: Line, material: Material, of: NDArray[np.int64]) -> Line:
    """The line, whose cells are of pieces `of` (N,) of a material with layers, with these.

    An element between layers of two kinds has one curvature, and of each as much as its half of the length.  So it is
    between a table of moment over curvature and two bending stiffnesses.
    """
    layers = material.layers
    number = [layers.index(x) for x in layers]
    kind = np.array(number)[of]
    rows = []
    for i, has_element in enumerate(line.element):
        sides = [c for c in (i - 1, i) if 0 <= c < line.h.size] if has_element else []
        length = sum(0.5 * line.h[c] for c in sides)
        parts = {kind[c]: sum(0.5 * line.h[k] for k in sides if kind[k] == kind[c]) / length for c in sides}
        rows.append([x * part for k, part in parts.items() for layer in layers[k] for x in layer])
        if len(sides) == 2 and material.meet(*of[sides]):
            part = [0.5 * line.h[c] / line.hn[i] for c in sides]
            line.kb[i, :2] = sum(x * material.B[of[c], :2] for x, c in zip(part, sides, strict=True)) / line.hn[i]
            for x, c in zip(part, sides, strict=True):
                rows[-1] += [x * number for layer in _of_table(material, int(of[c])) for number in layer]
    widths = [EACH, *map(len, rows)]
    for k, spring in enumerate(material.springs):
        if spring < np.inf:  # as many columns when the clamp is let go
            widths.append(sum(map(len, layers[of[-k]])) + EACH)
        if rows[-k] and spring < np.inf:
            half = float(material.B[of[-k], :2].max()) / (0.5 * line.h[-k])  # N m/rad, of half a cell there
            rows[-k] += [0.0, 1.0 / max(spring, NO_SPRING * half), 0.0, 0.0]
    law = np.zeros((line.s.size, max(widths)))
    for i, row in enumerate(rows):
        law[i, : len(row)] = row
    return line._replace(slip_law=law, slip_now=np.zeros_like(law))


def _of_table(material: Material, piece: int) -> list[Layer]:
    """Elastic layers that a table of moment over curvature is beside its first piece; none without one."""
    table = (material.bends or {piece: None})[piece]
    if table is None:
        return []
    more = np.diff(slopes(table))
    return [elastic_layer(x, float(K)) for (x, _), K in zip(table[1:-1], more, strict=True) if K != 0.0]


# Tables of moment over curvature: of sections, of what stiffens them, and of the elements of a line on its cells.


def bend_law(material: Material, line: Line, of: NDArray[np.int64]) -> tuple[Floats, Floats]:
    """`bend_law` and `bend_table` of a line whose cells are of pieces `of` (N,) of a material."""
    known: dict[Curve, int] = {}
    number = np.array([known.setdefault(x, len(known)) for x in _each_piece(material)])[of]
    begins = np.cumsum([0, *map(len, known)])
    n, half = line.h.size, 0.5 * line.h
    law = np.zeros((n + 1, NO_BEND_LAW.shape[1]))
    for cells, first, last, length, nodes in (
        (number, FIRST_A, LAST_A, HALF_A, slice(1, n + 1)),
        (number, FIRST_B, LAST_B, HALF_B, slice(0, n)),
    ):
        law[nodes, first], law[nodes, last], law[nodes, length] = begins[cells], begins[cells + 1], half
    same = np.concatenate([[False], number[1:] == number[:-1], [False]])
    law[same, HALF_A] += law[same, HALF_B]
    law[same, FIRST_B : HALF_B + 1] = 0.0
    plain = np.array([x is None for x in material.bends or ()])[of]
    without = np.concatenate([[True], plain]) & np.concatenate([plain, [True]])
    mixed = np.array([False, *(material.meet(a, b) for a, b in pairwise(of)), False])
    law[without | mixed | (line.element == 0)] = 0.0
    for k, spring in enumerate(material.springs):
        if law[-k, LAST_A] + law[-k, LAST_B] > 0.0 and spring < np.inf:
            stiffness = float(material.B[of[-k], :2].mean()) / half[-k]
            law[-k, GIVE] = 1.0 / max(spring, NO_SPRING * stiffness)
    return law, np.concatenate([_with_energy(x) for x in known])


def _each_piece(material: Material) -> list[Curve]:
    """Tables of all pieces, of one without a table a straight line."""
    assert material.bends is not None
    stiff = material.mean_initial_bending
    return [x or ((0.0, 0.0), (1.0, float(B))) for x, B in zip(material.bends, stiff, strict=True)]


def _with_energy(rows: Curve) -> Floats:
    """Rows of `Line.bend_table`: curvature, moment, energy per length; of `law_table`: strain, tension, energy."""
    x, M = np.array(rows, float).T
    out = np.column_stack([x, M, np.zeros(x.size)])
    out[1:, ENERGY] = np.cumsum(0.5 * np.diff(x) * (M[1:] + M[:-1]))
    return out
