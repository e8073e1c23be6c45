"""The state that a computation begins with: from the first shape of a scene, or one that was found otherwise."""

from __future__ import annotations

import numpy as np

from hybrid.errors import Complaint, SceneError
from hybrid.kernels.state.state import Floats, Line, State, state_for
from hybrid.model.catenary_guess import Hanging
from hybrid.model.ends import EndConditions
from hybrid.model.initial_shape import end_conditions, frames, initial_nodes, twist_by_tension
from hybrid.model.material import Material
from hybrid.model.sea import Surroundings
from hybrid.scene.schema import Equilibrium, LineScene, Points, Straight

HUNG = "an elastic catenary under all loads"  # a first shape that has the tensions of an equilibrium, but for bending
SHARPEST_START = np.radians(150.0)


def first_state(
    scene: LineScene, line: Line, cable: Material, sea: Surroundings, scale: float, shape: Hanging | None
) -> tuple[State, str, EndConditions]:
    """The state that a computation begins with, the name of its shape, and the ends; scale: N, its tensions where

    nothing is known of them; shape: an elastic catenary, None: the first nodes of the scene.
    """
    start = state_for(line)
    if shape is not None:
        shape_name = HUNG
        start.r[:], start.T[:] = shape
    else:
        start.r[:], shape_name = initial_nodes(scene, line.s)
        start.T[:] = scale
    start.e[:] = np.diff(start.r, axis=0)
    if isinstance(scene.initial, Points):
        _exact_lengths(start, line.h, line.ck == 0.0, scene)
        _refuse_folds(start.e, line.s, line.spin == 1)
    if isinstance(scene.initial, Straight):  # exact chords: no round-off of the positions in the strain
        start.e[:] = line.h[:, None] * np.array(scene.initial.direction) / np.linalg.norm(scene.initial.direction)
        start.v[:] = scene.initial.velocity or (0.0, 0.0, 0.0)
    directors, chords = _put_frames(scene, start, line, cable), start.e[[0, -1]]
    ends = end_conditions(scene, directors, chords / np.linalg.norm(chords, axis=1)[:, None], sea)
    if isinstance(scene.initial, Equilibrium):  # what is not at rest begins without tension
        twist_by_tension(line, cable, start)
    return start, shape_name, ends


def other_state(scene: LineScene, r: Floats, line: Line, cable: Material, scale: float) -> State:
    """Another shape to find the equilibrium from: nodes r (N+1, 3) m, tensions of the scale (N)."""
    spare = state_for(line)
    spare.r[:], spare.T[:] = r, scale
    spare.e[:] = np.diff(r, axis=0)
    _put_frames(scene, spare, line, cable)
    if isinstance(scene.initial, Equilibrium):
        twist_by_tension(line, cable, spare)
    return spare


def _put_frames(scene: LineScene, state: State, line: Line, cable: Material) -> tuple[Floats, Floats]:
    """Give a state the directors and turns that its chords make; the directors at both ends."""
    directors, state.turn[:, 0] = frames(scene, state.e, line, cable)
    state.a1[:] = directors[1:-1]
    return directors[0], directors[-1]


def _exact_lengths(start: State, h: Floats, stiff: np.ndarray, scene: LineScene) -> None:
    """Give inextensible cells exactly their length: points carry round-off, which would be an impact at the first step.

    The gap this leaves at a held end is closed by small shifts of all chords, until both are met.
    """
    to = scene.ends.end.held_position if scene.ends.start.held_position else None
    for _ in range(50 if to else 1):
        if to:
            gap = np.array(to, float) - start.r[0] - start.e.sum(axis=0)
            start.e[:] += gap * (h / h.sum())[:, None]
        lengths = np.linalg.norm(start.e, axis=1)
        start.e[stiff] *= (h / lengths)[stiff, None]
    start.r[1:] = start.r[0] + np.cumsum(start.e, axis=0)


def _refuse_folds(chords: Floats, s: Floats, rod: np.ndarray) -> None:
    """A rod cannot start folded back onto itself: its bend has no direction there."""
    d = chords / np.linalg.norm(chords, axis=1)[:, None]
    cosine = np.einsum("ij,ij->i", d[:-1], d[1:])
    folded = np.flatnonzero((cosine < np.cos(SHARPEST_START)) & rod[:-1] & rod[1:])
    if folded.size:
        angle = np.degrees(np.arccos(cosine[folded[0]]))
        given = f"a corner of {angle:.0f} deg at s = {s[folded[0] + 1]:g} m in a rod zone"
        fix = "round it with a few points, or make the zone a catenary if it stays taut"
        raise SceneError([Complaint("initial.points", given, "corners below 150 deg, because a rod bends", fix)])
