"""From a scene that lies in a plane to a line that is computed in it."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from hybrid.errors import Complaint, SceneError
from hybrid.kernels.state.report import PLANAR
from hybrid.kernels.state.state import Ends, Floats, Line, State
from hybrid.model.contents import Entry
from hybrid.scene.plane import EXACT, TYPED, plane_of
from hybrid.scene.schema import LineScene

# Of the length: how far an equilibrium may be out of the plane and count as in it (Newton's tolerance).
IN_PLANE = 1e-8
WHAT = "computed in a plane (3 unknowns a node)"


def in_plane(
    scene: LineScene, start: State, others: list[tuple[str, State]], ends: Ends
) -> tuple[Floats | None, Entry]:
    """The plane (3, 3) of a scene, rows p, q and normal, or None; and its entry in the contents of the model.

    What a scene does not write down is looked at as well: the shape that it starts from.  Starts in `others` that
    leave the plane are dropped where the scene insists on it, for they lead nowhere.  SceneError: it insists, and its
    own start leaves the plane.
    """
    if scene.dimension == 3:
        return None, Entry(WHAT, False, "dimension: 3")
    asked = scene.dimension == 2
    touching = "contact.self" if scene.contact.self else "obstacles" if scene.obstacles else ""
    if touching and not asked:
        what = "of the line with itself" if scene.contact.self else "with obstacles"
        return None, Entry(WHAT, False, f"{touching}: contact {what} is computed in space")
    tolerance = TYPED if asked else EXACT
    found, findings = plane_of(scene.environment, scene.cable, scene.ends, scene.initial, tolerance)
    if findings:
        where = ".".join(str(x) for x in findings[0].at)
        return None, Entry(WHAT, False, f"{where} leaves {found.text()}")
    plane = np.array([found.p, found.q, found.normal])
    if not _lies_in(plane, start, ends, tolerance):
        if asked:
            fix = "give `initial` a shape or a direction in the plane, or write `dimension: 3`"
            expected = f"a first shape in {found.text()}, which the rest of the scene lies in"
            raise SceneError([Complaint("initial", "one that leaves the plane", expected, fix)])
        return None, Entry(WHAT, False, f"the first shape leaves {found.text()}")
    if asked:
        others[:] = [(name, x) for name, x in others if _lies_in(plane, x, ends, tolerance)]
        if touching:
            why = f"{touching}: contact is computed in space, where nothing may leave {found.text()}"
            return plane, Entry(WHAT, False, why)
        return plane, Entry(WHAT, True, f"dimension: 2; {found.text()}")
    why = f"all of the scene lies in {found.text()}; dimension: 3 switches it off"
    return plane, Entry(WHAT, True, why)


def _lies_in(plane: Floats, state: State, ends: Ends, tolerance: float) -> bool:
    """Whether nodes, velocities and frames of the ends are in the plane, to a part of what they are."""
    n = plane[2]
    tangents = ends.frame.reshape(2, 3, 3)[:, :, 2]
    groups: Iterable[Floats] = (state.r - state.r[0], state.v, tangents)
    return all(float(np.abs(x @ n).max()) <= tolerance * float(np.abs(x).max()) for x in groups)


def leaves_plane(plane: Floats, state: State, length: float) -> bool:
    """Whether nodes of a state are further from the plane (3, 3) than IN_PLANE of the length, m."""
    return bool(np.abs((state.r - state.r[0]) @ plane[2]).max() > IN_PLANE * length)


def planar(line: Line, plane: Floats) -> Line:
    """The line, to be computed in the plane (3, 3)."""
    return line._replace(bits=line.bits | PLANAR, plane=plane)


def as_kept(line: Line, plane: Floats | None, kept_in: Floats | None) -> Line:
    """The line in the plane where its scene asks for that, as it is found at rest; plane, kept_in: of its model."""
    return line if plane is None or kept_in is None else planar(line, plane)


def in_space(line: Line) -> Line:
    """The line, to be computed in space."""
    return line._replace(bits=line.bits & ~PLANAR)


def as_begun(line: Line, held: Line | None, dimension: int | None) -> Line:
    """The line as its run began: in space, but of a scene of two dimensions; what is written goes by that.

    held: as it was before an end was let go, if one was.
    """
    found = line if held is None else held
    return found if dimension == 2 else in_space(found)


def untwist(line: Line, ends: Ends, guides: tuple[bool, bool], state: State) -> None:
    """Give the rods of a planar line frames without twist against each other and against its clamps.

    guides: whether an end holds a tangent, and with it a frame.  In space a rod that begins twisted turns back within
    a step; in a plane nothing turns it.
    """
    rods = np.flatnonzero(line.spin)
    if not rods.size:
        return
    n = line.plane[2]
    across = np.cross(n, state.e / np.linalg.norm(state.e, axis=1)[:, None])
    frames = ends.frame.reshape(2, 3, 3)
    if guides[0] or guides[1]:
        held = frames[0 if guides[0] else 1]
        director, m = held[:, 0], np.cross(n, held[:, 2])
    else:
        director, m = state.a1[rods[0]], across[rods[0]]
    x, y = float(director @ n), float(director @ m)
    size = np.hypot(x, y)
    state.a1[rods] = (x * n + y * across[rods]) / size
