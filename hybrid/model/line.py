"""A material on nodes: the arrays of `Line` for a mesh and the kinds of its cells."""

from __future__ import annotations

from functools import cache
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hybrid.kernels.laws.axial_law import SHIFT
from hybrid.kernels.laws.bending_law import EACH, ENERGY
from hybrid.kernels.laws.element import NO_SPRING
from hybrid.kernels.machine.binding import Packed, Table
from hybrid.kernels.mesh.remesh import OF_POINTS, PER_LENGTH, Cable, blank_cable, blank_line_job, fill_line
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
    FIELDS,
    NO_LAW,
    NO_MOVED,
    NO_PLANE,
    NO_TORSION,
    TENSION_TORQUE,
    Floats,
    Line,
    blank,
    blank_line,
)
from hybrid.model.material import Material, elastic_layer, nodes_at
from hybrid.scene.section_laws import Curve, Layer, slopes

# What inertia the sections of rods have.
NO_INERTIA, ABOUT_CHORDS, WITH_SECTIONS = range(3)

# Fields of a line that are not of its nodes or cells.
OF_WHOLE_LINE = ("bits", "plane", "torsion", "law_table", "bend_table", "moved")


@cache
def lines_with(*names: str, **columns: int) -> Packed:
    """What makes lines of any number of cells that have optional fields of these names; columns: where not as usual."""

    def one(n: int) -> Line:
        wide = {name: FIELDS[name]._replace(optional=False) for name in names}
        wide |= {name: FIELDS[name]._replace(optional=False, columns=x) for name, x in columns.items()}
        more: dict[str, Any] = {name: blank(field, n) for name, field in wide.items()}
        return blank_line(n)._replace(**more)

    return Packed(one, given=OF_WHOLE_LINE)


def lines_like(line: Line) -> Packed:
    """What makes lines with the optional fields of this one."""
    has = {name: getattr(line, name) for name, field in FIELDS.items() if field.optional}
    return lines_with(**{name: x.shape[1] if x.ndim > 1 else 0 for name, x in has.items() if x.size})


def of_whole_line(line: Line) -> dict[str, Any]:
    """Fields that belong to a line as a whole, by name, which `lines_like` is given."""
    return {name: getattr(line, name) for name in OF_WHOLE_LINE}


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
    material: Material,
    cable: Cable,
    s: Floats,
    cells: Cells,
    bits: int,
    job: Table,
    plane: Floats = NO_PLANE,
    moved: NDArray[np.int8] = NO_MOVED,
) -> Line:
    """The line of a material with nodes s (N+1,) m on base cells.

    cable: that on these; cells: (N,) base cells of its cells, and whether they are rod; job: a table of
    kernels.mesh.remesh.LineJob; moved: as of `Line`.
    """
    of_cell, rod = cells
    h, of = np.diff(s), material.piece(0.5 * (s[:-1] + s[1:]))
    has = {"law": cable.law, "bend_law": cable.bend, "wake_law": cable.wake}
    has |= dict.fromkeys(TENSION_TORQUE, cable.torque)
    names = [name for name, x in has.items() if x.size] + ["bed_width"] * bool(bits & SOIL)
    torsion = torsion_zones(material, h, rod, of)
    shared = {"torsion": torsion, "moved": moved, "law_table": cable.law_table, "bend_table": cable.bend_table}
    line: Line = lines_with(*names)(h.size, bits=bits, plane=plane, **shared)
    job.bind(cable=cable, nodes=s, base_of_cell=of_cell, rod=rod, line=line)
    fill_line(job.numbers)
    return with_slip(line, material, of) if bits & BENDING_SLIP else line


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
    held = np.array([material.held_tangent, material.held_twist], np.int8).T.copy()
    made, EI, w = made_of(material, inertia)[of], material.mean_bending[of], np.abs(material.submerged_weight[of])
    cable = blank_cable(of.size)._replace(
        made=made, EI=EI, w=w, load=load, turns=turns, held=held, springs=np.array(material.springs)
    )
    cable = cable._replace(width=material.outer_diameter[of], **laws_on(material, of))
    put_points(material, place, cable, bits)
    return cable


def laws_on(material: Material, of: NDArray[np.int64]) -> dict[str, Any]:
    """What a `Cable` has, on base cells of pieces `of` (n,), of laws that only some materials have."""
    found: dict[str, Any] = {}
    if material.curves is not None:
        found |= axial_law(material, of)
    if material.bends is not None:
        found |= bend_law(material, of)
    if material.tension_torque.size:
        found["torque"] = material.tension_torque[of]
    if material.vortices.size:
        found["wake"] = np.column_stack([material.vortices[of], np.full(of.size, material.around)])
    return found


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


def axial_law(material: Material, of: NDArray[np.int64]) -> dict[str, Floats]:
    """`law` and `law_table` of a `Cable` on base cells of pieces `of` (n,)."""
    law, rows, begin = np.zeros((of.size, NO_LAW.shape[1])), [], 0
    for k, piece in enumerate(material.curves or ()):
        cells = of == k
        if piece is None or not cells.any():
            continue
        rows.append(_with_energy(piece.rows))
        law[cells, :SHIFT] = (begin, begin + len(piece.rows), *piece.dynamic, *piece.working, *piece.creep)
        begin += len(piece.rows)
    return {"law": law, "law_table": np.concatenate(rows)}


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


# Tables of moment over curvature: of sections, and of what stiffens them.


def bend_law(material: Material, of: NDArray[np.int64]) -> dict[str, Any]:
    """`bend`, `mixed` and `bend_table` of a `Cable` on base cells of pieces `of` (n,)."""
    known: dict[Curve, int] = {}
    number = np.array([known.setdefault(x, len(known)) for x in _each_piece(material)])[of]
    begins = np.cumsum([0, *map(len, known)])
    plain = np.array([x is None for x in material.bends or ()])[of]
    bend = np.column_stack([begins[number], begins[number + 1], plain]).astype(float)
    mixed = np.array([False, *(material.meet(a, b) for a, b in pairwise(of)), False], np.int8)
    return {"bend": bend, "mixed": mixed, "bend_table": np.concatenate([_with_energy(x) for x in known])}


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
