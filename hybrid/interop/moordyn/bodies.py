"""Rigid bodies of a deck as those of a scene, and back.

MoorDyn                          hybrid
Rx(r0) Ry(p0) Rz(y0), degrees    rotation: Rz(yaw) Ry(pitch) Rx(roll), degrees
Fixed, Coupled                   kind: fixed; give `motion`
Free: Mass, CG, I about the CG   mass, centre, inertia
Volume                           volume, its centre at the CG, as measured with MoorDyn 2.7
Ca (rho V)                       added_mass of translations
CdA                              none: the damping of a body is linear
"""

from __future__ import annotations

import math
from typing import Any

from hybrid.interop.moordyn.deck import Body, Triple
from hybrid.interop.moordyn.rows import number

Matrix = tuple[Triple, Triple, Triple]


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


def body_table(body: Body, density: float) -> tuple[dict[str, Any], list[str]] | str:
    """The table of a body, and what is lost of it; or why there is none."""
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
    if mass[0] <= 0.0 or min(inertia) <= 0.0:
        return "a free rigid body without mass or moments of inertia"
    found: dict[str, Any] = {"kind": "free", "initial_guess": body.place, "mass": mass[0]}
    found |= {"initial_rotation": turned} if any(turned) else {}
    found |= {"centre": centre} if any(centre) else {}
    found["inertia"] = inertia
    lost = []
    if density and volume[0]:
        found["volume"] = volume[0]
        found |= {"centre_of_buoyancy": centre} if any(centre) else {}
        moved = (added * 3)[:3] if len(added) == 1 else added[:3]
        if any(added):
            found["added_mass"] = [*(density * volume[0] * ca for ca in moved), 0.0, 0.0, 0.0]
        if any(added[3:]):
            lost.append("added inertia of its rotations (Ca)")
    if density and any(drag):
        lost.append("its drag (CdA); `damping` of a body of hybrid is linear")
    return found, lost
