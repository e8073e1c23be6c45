"""A material on nodes: the arrays of `Line` for a mesh and the kinds of its cells."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hybrid.kernels.axial_law import SHIFT, follow_law
from hybrid.kernels.element import NO_SPRING
from hybrid.kernels.forces import AXIAL_LAW, BODIES, ROTARY, STIFFNESS_DAMPING
from hybrid.kernels.state import NO_ADDRESS, NO_LAW, NO_TABLE, NO_TORSION, Floats, Line, blank_line, no_work, state_for
from hybrid.model.material import Material


def line_on(
    material: Material, s: Floats, rod: np.ndarray, more_bits: int = 0, sections_turn: bool = True,
    comes_and_goes: bool = False,
) -> Line:  # fmt: skip
    """The line of a material with nodes s (N+1,) and rod cells where `rod` (N,) is true.

    more_bits: forces that the surroundings ask for; sections_turn: whether cross-sections of rods have inertia.
    comes_and_goes: its rods do; they have inertia about their chords alone, where nothing else holds their spin.
    """
    h = np.diff(s)
    n = h.size
    middle = 0.5 * (s[:-1] + s[1:])
    of = material.piece(middle)
    bits = material.bits | more_bits
    rotary = polar = np.full(n, np.nan)
    if sections_turn and rod.any() and (material.polar[of] > 0.0).any():
        bits |= ROTARY
        rotary, polar = h * rod * material.rotary[of], h * rod * material.polar[of]
        if comes_and_goes:
            rotary = 0.0 * polar
    point = {name: np.full(n + 1, 0.0 if name == "point_mass" or bits & BODIES else np.nan) for name in material.points}
    place = material.point_nodes(s)
    for name, values in material.points.items():
        if name == "point_mass" or bits & BODIES:
            point[name][place] = values
    force = np.zeros((n + 1, 3))
    force[:, 2] = -_to_nodes(h * material.weight[of])
    lift = np.zeros(n + 1)
    lift[place] = material.lift
    force[:, 2] += lift
    footing = np.full(n + 1, np.nan)
    if material.footing.size or more_bits:
        footing[:] = 0.0
        footing[place[: material.footing.size]] = material.footing
    element, kb, k0, hn = _elements(material, h, rod, of)
    kb[material.swivel_nodes(s), 2] = 0.0
    half = 0.5 * h
    torsion = torsion_zones(material, h, rod, of)
    law, law_table, law_at = axial_law(material, h, of)
    torque, twist = material.torque_by_tension(h, of)
    return Line(
        s=s, h=h, ck=material.ck[of], mass=_to_nodes(h * material.mass[of]) + point["point_mass"], force=force,
        element=element, spin=rod.astype(np.int8), kb=kb, k0=k0, hn=hn, rotary=rotary, polar=polar,
        drag_n=half * material.drag_n[of], drag_t=half * material.drag_t[of],
        added_n=half * material.added_n[of], added_t=half * material.added_t[of],
        damp=_to_nodes(h * material.damp[of]), tau=material.tau[of],
        buoy=half * material.buoy[of], displaced=half * material.displaced[of], diameter=material.diameter[of],
        point_lift=lift, footing=footing, bits=bits | (AXIAL_LAW if law_at.size else 0), torsion=torsion,
        law=law, law_table=law_table, law_at=law_at, tension_torque=torque, tension_twist=twist, **point,
    )  # fmt: skip


def spins_freely(material: Material) -> bool:
    """Whether only inertia holds the spin of rods that come and go.

    Where no torque passes from end to end, a rod between joints turns freely about its chords, and the damping of its
    bend turns it: at once by half a turn where the bend goes through zero and nothing has inertia.
    """
    return not material.passes_torque and bool(material.bits & STIFFNESS_DAMPING) and bool(material.polar.any())


def with_spin_inertia(line: Line, material: Material) -> Line:
    """The line with inertia of its rods about their chords, where nothing else holds their spin from now on."""
    if line.bits & ROTARY or not spins_freely(material):
        return line
    polar = line.h * line.spin * material.polar[material.piece(0.5 * (line.s[:-1] + line.s[1:]))]
    return line._replace(bits=line.bits | ROTARY, polar=polar, rotary=0.0 * polar)


def _to_nodes(x: Floats) -> Floats:
    y = np.zeros(x.size + 1)
    y[:-1] += 0.5 * x
    y[1:] += 0.5 * x
    return y


def _elements(
    material: Material, h: Floats, rod: np.ndarray, of: np.ndarray
) -> tuple[np.ndarray, Floats, Floats, Floats]:
    """Where elements sit, their stiffness B/hn, their strain without stress, and the length each stands for."""
    n = h.size
    B, kappa, half = material.B[of], material.kappa[of], 0.5 * h[:, None]
    element = np.zeros(n + 1, np.int8)
    kb, k0, hn = np.zeros((n + 1, 3)), np.zeros((n + 1, 3)), np.zeros(n + 1)
    hn[:-1] += 0.5 * h
    hn[1:] += 0.5 * h
    element[1:-1] = rod[:-1] & rod[1:]
    inner = np.flatnonzero(element)
    a, b = inner - 1, inner
    kb[inner] = 1.0 / (half[a] / B[a] + half[b] / B[b])  # two halves in series
    k0[inner] = half[a] * kappa[a] + half[b] * kappa[b]
    for k, node, cell in ((0, 0, 0), (1, n, n - 1)):
        if rod[cell] and material.held_tangent[k]:
            element[node] = 1
            kb[node] = B[cell] / half[cell]
            k0[node] = half[cell] * kappa[cell]
            if material.springs[k] < np.inf:
                kb[node], hn[node] = in_series(kb[node], hn[node], material.springs[k])
            if not material.held_twist[k]:
                kb[node, 2] = 0.0
    return element, kb, k0, hn


def in_series(kb: Floats, hn: float, spring: float) -> tuple[Floats, float]:
    """Stiffness (3,) N m of the element at a clamp, and the length, m, that it stands for, with an angular spring

    (N m/rad) between the clamp and the half cell, whose are kb and hn: the length of line that would bend as much, so
    that kb hn stays the bending stiffness.  (The same: kernels.element.put_spring.)
    """
    out = kb.copy()
    out[:2] = 1.0 / (1.0 / kb[:2] + 1.0 / max(spring, NO_SPRING * kb[:2].max()))
    return out, float(hn * kb[:2].mean() / out[:2].mean())


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


def axial_law(material: Material, h: Floats, of: np.ndarray) -> tuple[Floats, Floats, NDArray[np.int64]]:
    """`law`, `law_table` and `law_at` of a line with cells of lengths h (N,) m on pieces `of` (N,)."""
    if material.curves is None:
        return NO_LAW, NO_TABLE, NO_ADDRESS
    law, rows, begin = np.zeros((h.size, NO_LAW.shape[1])), [], 0
    for k, piece in enumerate(material.curves):
        cells = of == k
        if piece is None or not cells.any():
            continue
        strain, tension = np.array(piece.rows, float).T
        energy = np.concatenate([[0.0], np.cumsum(0.5 * np.diff(strain) * (tension[1:] + tension[:-1]))])
        rows.append(np.column_stack([strain, tension, energy]))
        law[cells, :SHIFT] = (begin, begin + strain.size, *piece.dynamic)
        begin += strain.size
    table = np.concatenate(rows)
    blank = blank_line(1)._replace(law=law, law_table=table)
    state = state_for(blank)
    address = follow_law.address(blank, state, state, no_work(), 0.0, 0.0)
    return law, table, np.array([address], np.int64)
