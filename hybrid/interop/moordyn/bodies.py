"""Rigid bodies of a deck as those of a scene, and back.

MoorDyn                          hybrid
Rx(r0) Ry(p0) Rz(y0), degrees    rotation: Rz(yaw) Ry(pitch) Rx(roll), degrees
Fixed, Coupled                   kind: fixed; give `motion`
Free: Mass, CG, I about the CG   mass, centre, inertia
Volume                           volume, its centre at the CG, as measured with MoorDyn 2.7
Ca (rho V)                       added_mass of translations
CdA                              none: the damping of a body is linear
points on a free body: M, V, Ca  part of it, at their places, as MoorDyn counts them
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from hybrid.interop.moordyn.deck import Body, Point, Triple
from hybrid.interop.moordyn.rows import LEFT_OUT, TAKEN, Note, note, number

Matrix = tuple[Triple, Triple, Triple]
DAMP = "give `damping`, about its mean motion"


def numbers_of(cell: str) -> list[float] | None:
    """The numbers of a cell such as 0|0|1; None if one is none."""
    found = [number(x) for x in cell.split("|")]
    return None if any(x is None for x in found) else [float(x or 0.0) for x in found]


def three(cell: str, alone: str) -> Triple | None:
    """Three numbers of a cell; one alone is that of z ("z") or of all ("all")."""
    found = numbers_of(cell)
    if found is not None and len(found) == 1:
        found = [0.0, 0.0, found[0]] if alone == "z" else found * 3
    return (found[0], found[1], found[2]) if found is not None and len(found) == 3 else None


def _product(*matrices: Matrix) -> Matrix:
    a, *rest = matrices
    if not rest:
        return a
    b = _product(*rest)
    rows = [[sum(a[i][k] * b[k][j] for k in range(3)) for j in range(3)] for i in range(3)]
    x, y, z = ((row[0], row[1], row[2]) for row in rows)
    return x, y, z


def _about(angles: Triple) -> tuple[Matrix, Matrix, Matrix]:
    """Rotations about x, y and z by angles in degrees."""
    (cx, cy, cz), (sx, sy, sz) = ([f(math.radians(a)) for a in angles] for f in (math.cos, math.sin))
    return (
        ((1.0, 0.0, 0.0), (0.0, cx, -sx), (0.0, sx, cx)),
        ((cy, 0.0, sy), (0.0, 1.0, 0.0), (-sy, 0.0, cy)),
        ((cz, -sz, 0.0), (sz, cz, 0.0), (0.0, 0.0, 1.0)),
    )


def rotation_of(angles: Triple) -> Triple:
    """Roll, pitch, yaw (degrees) as a scene has them, of the angles of a deck."""
    x, y, z = _about(angles)
    R = _product(x, y, z)
    flat = math.hypot(R[0][0], R[1][0])
    if flat < 1e-12:  # straight up or down: yaw is none of its own
        return _degrees(math.atan2(-R[1][2], R[1][1]), math.atan2(-R[2][0], flat), 0.0)
    return _degrees(math.atan2(R[2][1], R[2][2]), math.atan2(-R[2][0], flat), math.atan2(R[1][0], R[0][0]))


def angles_of(rotation: Triple) -> Triple:
    """The angles of a deck of roll, pitch, yaw of a scene (degrees)."""
    x, y, z = _about(rotation)
    R = _product(z, y, x)
    flat = math.hypot(R[0][0], R[0][1])
    if flat < 1e-12:
        return _degrees(math.atan2(R[2][1], R[1][1]), math.atan2(R[0][2], flat), 0.0)
    return _degrees(math.atan2(-R[1][2], R[2][2]), math.atan2(R[0][2], flat), math.atan2(-R[0][1], R[0][0]))


def _degrees(*angles: float) -> Triple:
    x, y, z = (math.degrees(a) + 0.0 for a in angles)
    return x, y, z


def body_row(body: Any, place: Triple, rotation: Triple, density: float, surface: float) -> tuple[str, list[str]]:
    """The row of a body of a scene, at its place (m) and rotation (degrees), without its number; and what is wrong.

    surface: height of the water, m.
    """
    wrong: list[str] = []
    kind = "Free" if body.kind == "free" else "Coupled" if body.motion is not None else "Fixed"
    rest = ["0"] * 6
    if body.kind == "free":
        wrong += [key for key in ("hydrostatics", "damping") if getattr(body, key) is not None]
        wrong += ["members"] if body.members else []
        wrong += [load.what for load in body.end.loads]
        if body.volume and math.dist(body.centre, body.centre_of_buoyancy) > 0.0:
            wrong.append("centre_of_buoyancy")  # MoorDyn's is the centre of mass
        matrix = body.added_mass or [[0.0] * 6 for _ in range(6)]
        if any(matrix[i][j] for i in range(6) for j in range(6) if i != j or i > 2):
            wrong.append("added_mass")
        displaced = density * body.volume
        ca = [matrix[i][i] / displaced if displaced else 0.0 for i in range(3)]
        if any(matrix[i][i] for i in range(3)) and not displaced:
            wrong.append("added_mass")
        ca = [*ca, 0.0, 0.0, 0.0] if any(ca) else [0.0]
        cells = ([body.mass], body.centre, body.inertia, [body.volume], [0.0], ca)
        rest = ["|".join(f"{x:.12g}" for x in cell) for cell in cells]
    x, y, z = place
    numbers = (x, y, z - surface, *angles_of(rotation))
    return f"{kind} {' '.join(f'{x:.12g}' for x in numbers)} {' '.join(rest)}", wrong


def body_table(body: Body, density: float, parts: Sequence[Point] = ()) -> tuple[dict[str, Any], list[Note]] | str:
    """The table of a body, and notes on what is not as in the deck; or why there is none.

    parts: points on it that have a mass, a volume or a drag area of their own.
    """
    turned = rotation_of(body.angles)
    if body.kind in ("fixed", "coupled"):
        return {"kind": "fixed", "position": body.place} | ({"rotation": turned} if any(turned) else {}), []
    if body.kind != "free":
        return "a rigid body that a deck pins; bodies of a scene are fixed or free"
    mass, volume = (numbers_of(body.rest[i]) for i in (0, 3))
    centre, inertia = three(body.rest[1], "z"), three(body.rest[2], "all")
    drag, added = numbers_of(body.rest[4]), numbers_of(body.rest[5])
    if mass is None or volume is None or centre is None or inertia is None or drag is None or added is None:
        return "a rigid body whose mass, CG, I, Volume, CdA and Ca are not all numbers"
    if mass[0] <= 0.0 or min(inertia) < 0.0 or max(inertia) <= 0.0:
        return "a free rigid body without mass or moments of inertia"
    notes = []
    if min(inertia) == 0.0:
        why = f"it has no moment of inertia about some axes; {max(inertia):g} kg m^2 is taken there, too"
        notes.append(note(TAKEN, body.row, why, "give its moments of inertia; at rest they do nothing"))
        x, y, z = (each or max(inertia) for each in inertia)
        inertia = (x, y, z)
    masses = [(mass[0], centre), *((p.mass, p.place) for p in parts)]
    whole, about = _centre(masses)
    turning = _inertia(inertia, masses, about)
    if max(abs(turning[i][j]) for i in range(3) for j in range(i)) > _PRODUCTS * min(turning[i][i] for i in range(3)):
        return "a free rigid body that the masses of its points give products of inertia"
    found: dict[str, Any] = {"kind": "free", "initial_guess": body.place, "mass": whole}
    found |= {"initial_rotation": turned} if any(turned) else {}
    found |= {"centre": about} if any(about) else {}
    found["inertia"] = (turning[0][0], turning[1][1], turning[2][2])
    if density:
        volumes = [(volume[0], centre), *((p.volume, p.place) for p in parts)]
        displaced, lift = _centre(volumes)
        found |= {"volume": displaced} if displaced else {}
        found |= {"centre_of_buoyancy": lift} if displaced and any(lift) else {}
        moved = (added * 3)[:3] if len(added) == 1 else added[:3]
        found |= _added([density * volume[0] * ca for ca in moved], parts, density)
        if volume[0] and any(added[3:]):
            notes.append(note(LEFT_OUT, body.row, "added inertia of its rotations (Ca)", DAMP))
        if any(drag):
            why = "its drag (CdA); `damping` of a body of hybrid is linear"
            notes.append(note(LEFT_OUT, body.row, why, DAMP))
        if any(p.drag_area for p in parts):
            which = ", ".join(str(p.id) for p in parts if p.drag_area)
            why = f"the drag (CdA) of its points {which}; `damping` of a body of hybrid is linear"
            notes.append(note(LEFT_OUT, body.row, why, DAMP))
    return found, notes


# Products of inertia that round-off leaves, of the smallest moment of inertia.
_PRODUCTS = 1e-9


def _centre(parts: Sequence[tuple[float, Triple]]) -> tuple[float, Triple]:
    """The sum of masses or volumes, and its centre."""
    total = sum(m for m, _ in parts)
    x, y, z = (sum(m * place[i] for m, place in parts) / total if total else 0.0 for i in range(3))
    return total, (x, y, z)


def _inertia(own: Triple, masses: Sequence[tuple[float, Triple]], centre: Triple) -> list[list[float]]:
    """(3, 3) about the common centre, kg m^2, of the first mass with its own moments and of mass points."""
    found = [[own[i] if i == j else 0.0 for j in range(3)] for i in range(3)]
    for m, place in masses:
        r = [a - b for a, b in zip(place, centre, strict=True)]
        square = sum(x * x for x in r)
        for i in range(3):
            for j in range(3):
                found[i][j] += m * ((square if i == j else 0.0) - r[i] * r[j])
    return found


def _added(own: Sequence[float], parts: Sequence[Point], density: float) -> dict[str, Any]:
    """Added mass about the origin: of translations of the body, and of its points at their places."""
    pieces = [(density * p.volume * p.added, p.place) for p in parts if p.volume and p.added]
    if not pieces:
        return {"added_mass": [*own, 0.0, 0.0, 0.0]} if any(own) else {}
    M = [[own[i] if i == j < 3 else 0.0 for j in range(6)] for i in range(6)]
    for m, (x, y, z) in pieces:
        offset = ((0.0, m * z, -m * y), (-m * z, 0.0, m * x), (m * y, -m * x, 0.0))
        turning = _inertia((0.0, 0.0, 0.0), [(m, (x, y, z))], (0.0, 0.0, 0.0))
        for i in range(3):
            M[i][i] += m
            for j in range(3):
                M[i][3 + j] += offset[i][j]
                M[3 + j][i] += offset[i][j]
                M[3 + i][3 + j] += turning[i][j]
    return {"added_mass": M}
