"""Bends that weight makes where a rod carries almost no tension, within less than a cell.

    symbol   meaning                                                             unit
    EI       bending stiffness about the weaker axis                             N m2
    w        submerged weight                                                    N/m
    l        (EI/w)^(1/3), over which a cable without tension bends by weight    m

Where the tension is below EI/l^2, bending and weight alone form the line, over l.  A cell that is longer than l and
turns against the next shows no more than the mean of the bend: its curvature is too small, and the length of line that
bends too great.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hybrid.errors import Outcome
from hybrid.kernels.laws.bed import planes_under
from hybrid.kernels.state.report import SEABED
from hybrid.kernels.state.state import Floats, Line, State
from hybrid.model.build import LEAST_WEIGHT, Model
from hybrid.model.initial_shape import dead_loads, end_laid_anywhere
from hybrid.model.material import Material
from hybrid.outputs.joined_lines import JoinedObservation
from hybrid.outputs.observation import Observation
from hybrid.scene.schema import LineScene
from hybrid.simulation.events import EventLog
from hybrid.solve.flaws import lies_slack

# rad, from one cell to the next: less is the sag of a line that lies or hangs almost straight.
TURNS = 0.05
# Cells that show the bend, as a part of l; and l over a cell that no note of such a bend is about.
SHOWS, SPANS = 0.25, 1.25


def too_long_for_weight(cable: Material, line: Line) -> tuple[np.ndarray, Floats, Floats]:
    """Nodes (K,) between two cells of a rod of which one is longer than l; there l (K,) m and EI/l^2 (K,) N."""
    rod = (line.spin[:-1] == 1) & (line.spin[1:] == 1) & (line.element[1:-1] == 1)
    between = np.flatnonzero(rod & (line.h[:-1] > 0.0) & (line.h[1:] > 0.0))
    piece = cable.piece(0.5 * (line.s[:-1] + line.s[1:]))
    length = cable.bending_length(LEAST_WEIGHT * 9.81 * cable.mass)[piece]
    EI = cable.weakest_bending[piece]
    l = np.minimum(length[between], length[between + 1])
    longer = (np.maximum(line.h[between], line.h[between + 1]) > l) & (l > 0.0)
    between, l = between[longer], l[longer]
    return between + 1, l, np.minimum(EI[between], EI[between + 1]) / l**2


def turns_by_weight(line: Line, seen: Observation, nodes: np.ndarray, limits: Floats) -> Floats:
    """Turns (K, nb) rad at nodes (K,) beyond the natural bend, 0 where the tension exceeds limits (K,) N."""
    chord = np.linalg.norm(seen.d[nodes] - seen.d[nodes - 1], axis=1)  # 2 sin(x/2) of a turn by x
    turn = 2.0 * np.arcsin(0.5 * chord) - np.linalg.norm(line.k0[nodes, :2], axis=1)[:, None]
    slack = np.minimum(seen.T[nodes - 1], seen.T[nodes]) < limits[:, None]
    return np.where(slack, turn, 0.0)


def weight_text(l: float, s: float, h: float, turn: float, ask: str) -> str:
    """Text of the event at s (m) between cells of h (m) that turn by so much (rad)."""
    return (
        f"weight bends the slack cable within {l:.2g} m at s = {s:g} m, on a cell of {h:.2g} m "
        f"({np.degrees(turn):.0f} deg to the next): curvature and moment are wrong there; cells of {SHOWS * l:.2g} m "
        f"would do ({ask}, or `accuracy: {{curvature: 5%}}`)"
    )


def slack_text_of(model: Model, state: State) -> tuple[float, float, str] | None:
    """From where to where (m) a catenary lies slack on the bed, and what an event says of it; None: nowhere."""
    line, sea = model.line, model.sea.values
    cells = np.flatnonzero(lies_slack(line, sea, state))
    if not cells.size:
        return None
    half = 0.5 * float(np.abs(dead_loads(line)[cells[0] : cells[-1] + 2, 2]).max())
    text = (
        f"{float(line.h[cells].sum()):.4g} m of catenary lie slack on the seabed, which carry nothing, in one of many "
        f"shapes; forces at ends above it do not depend on that, but are known to {half:.3g} N, half the weight of the "
        f"cell that comes down: shorter cells, or `accuracy`, for less"
    )
    return float(line.s[cells[0]]), float(line.s[cells[-1] + 1]), text


def note_laid(scene: LineScene, model: Model, state: State, events: EventLog) -> None:
    """Say which way a free end lies on the bed where nothing in the scene does."""
    end = end_laid_anywhere(scene)
    free, held = (-1, 0) if end == "end" else (0, -1)
    if not end or not planes_under(model.sea.values, state.r[[free]])[1][0] > 0.0:
        return
    x, y = (state.r[free] - state.r[held])[:2]
    text = (
        f"the {end} lies free on the seabed at [{x:.4g}, {y:.4g}] m from the other one: nothing in the scene says "
        f"which way, and any other is as good; initial.direction chooses it"
    )
    events.event(0.0, 0.0, model.length, "laid one way", text)


def slack_remedy(model: Model, outcome: Outcome, s: float | None) -> str:
    """What to write where a catenary is slack at s, m, so that its bending carries it; empty: nothing is known."""
    if outcome != Outcome.SLACK or s is None or model.layout is not None:
        return ""
    cable, line = model.cable, model.line
    node = int(np.clip(np.searchsorted(line.s, s), 1, line.h.size))
    piece = cable.piece(np.array([s]))[0]
    if cable.weakest_bending[piece] > 0.0:
        return "`model: adaptive`, which makes a rod of it where it is slack"
    w, h = abs(float(cable.weight[piece])), float(line.h[node - 1])
    if not w:
        return ""
    least = float(f"{w * (SPANS * h) ** 3:.2g}")
    return (
        f"`model: adaptive`, and the bending_stiffness of the section; where none is known, {least:g} N m^2 makes its "
        f"slack bends as long as a cell of {h:.3g} m and changes forces by up to {w * SPANS * h:.2g} N; cells a tenth "
        f"as long take a thousandth of it, which changes them by up to a tenth"
    )


# Which outputs of lines with other cells in each the diagnostics have to look at one by one: most of them need not.
#
# Each bound is the one by which `Diagnostics` judges an output, so that none that it would note is missed.


class Bounds(NamedTuple):
    """Beyond which there is something to look at."""

    fold: float  # rad, of a catenary from cell to cell
    sag: float  # m, of a catenary below its chords
    kink: float  # rad, of a joint of a rod and a catenary beyond the bend beside it
    negative: float  # part of the largest tension by which one between cells may come out below 0
    sunk: float  # m, depth in the seabed
    layers: bool  # whether clamps and point loads are watched for bends within less than a cell
    pressed: float  # of EI/L, N m: what a rod carries that may buckle; infinite: that is not watched
    length: float  # m
    attached: tuple[float, ...]  # m, where point loads are
    cable: Material | None  # of which bends by weight within less than a cell are watched; None: they are not


def kinks_at(joints: NDArray[np.int64], bends: Floats, lengths: Floats) -> Floats:
    """Angles (J, nb), rad, of joints beyond the larger bend on their sides.

    bends: (N+1, nb) 1/m at nodes, 2 tan(x/2) over lengths (N+1,) m for an angle x.
    """
    turn = 2.0 * np.arctan(0.5 * bends[joints] * lengths[joints, None])
    return np.asarray(turn - np.maximum(bends[joints - 1], bends[joints + 1]) * lengths[joints, None])


def doubtful(seen: JoinedObservation, values: Mapping[str, Floats], bounds: Bounds) -> NDArray[np.bool_]:
    """Outputs (nb,) with something beyond a bound."""
    line, begin = seen.line, seen.begin[:-1]
    found = np.zeros(begin.size, bool)
    inside = np.zeros(line.s.size, bool)
    inside[1:-1] = (line.spin[:-1] == 0) & (line.spin[1:] == 0)
    inside[seen.end_nodes] = False
    inside &= ~np.isin(line.s, bounds.attached)
    if inside.any():
        half = np.where(inside, 0.5 * seen.bends[:, 0] * line.hn, 0.0)
        found |= np.maximum.reduceat(half, begin) > np.tan(0.5 * min(bounds.fold, np.pi))
        found |= np.maximum.reduceat(half * line.hn, begin) > 4.0 * bounds.sag
        found |= values["tension"].min(axis=1) < -bounds.negative * np.abs(values["tension"]).max(axis=1)
    joints = np.flatnonzero(line.spin[1:] != line.spin[:-1]) + 1
    joints = joints[~np.isin(joints, seen.end_nodes)]
    joints = joints[~np.isin(line.s[joints], bounds.attached)]
    if joints.size:
        kinked = kinks_at(joints, seen.bends, line.hn)[:, 0] > bounds.kink
        found[np.searchsorted(seen.begin, joints[kinked], side="right") - 1] = True
    if bounds.layers:
        found |= bool(bounds.attached) | seen.has_element(0) | seen.has_element(1)
    if bounds.cable is not None:
        nodes, _, limits = too_long_for_weight(bounds.cable, line)
        if nodes.size:
            bent = turns_by_weight(line, seen, nodes, limits)[:, 0] > TURNS
            found[np.searchsorted(seen.begin, nodes[bent], side="right") - 1] = True
    if line.bits & SEABED:
        found |= np.maximum.reduceat(seen.depth[:, 0], begin) - 0.5 * seen.sea.onset > bounds.sunk
    if np.isfinite(bounds.pressed) and line.spin.any():
        stiff = np.where(line.element == 1, line.kb[:, :2].min(axis=1) * line.hn, np.inf)
        least = bounds.pressed * np.minimum.reduceat(stiff, begin) / bounds.length
        least[np.isinf(least)] = 0.0
        tension = np.where(line.spin == 1, seen.T[:, 0], np.inf)
        tension[seen.begin[1:-1] - 1] = np.inf  # of no line
        found |= np.minimum.reduceat(tension, begin) * bounds.length < -least
        found |= values["energy/torsion"] > least
    return found
