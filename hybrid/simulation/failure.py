"""What a run that fails leaves, and bends where a rod is slack.

Weight makes bends within less than a cell where a rod carries almost no tension:

    symbol   meaning                                                             unit
    EI       bending stiffness about the weaker axis                             N m2
    w        submerged weight                                                    N/m
    l        (EI/w)^(1/3), over which a cable without tension bends by weight    m

Where the tension is below EI/l^2, bending and weight alone form the line, over l.  A cell that is longer than l and
turns against the next shows no more than the mean of the bend: its curvature is too small, and the length of line that
bends too great.

A run that fails leaves why no step leads on, and its last good state in a file of its own.
"""

from __future__ import annotations

import os
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from hybrid.errors import Outcome
from hybrid.kernels.laws.seabed import planes_under
from hybrid.kernels.state.books import Clock, Counts
from hybrid.kernels.state.report import SEABED
from hybrid.kernels.state.state import Floats, Line, State
from hybrid.model.build import LEAST_WEIGHT, Model
from hybrid.model.ends import DrivenEnd, contradictions
from hybrid.model.initial_shape import dead_loads, end_laid_anywhere
from hybrid.model.material import Material
from hybrid.outputs.joined_lines import JoinedObservation
from hybrid.outputs.observation import Observation
from hybrid.scene.schema import LineScene
from hybrid.simulation.events import EventLog
from hybrid.solve.contact import SelfContact
from hybrid.solve.flaws import lies_slack
from hybrid.solve.network_steps import Tried

if TYPE_CHECKING:
    from hybrid.simulation.payout import PayingOut

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


# A step in which waves of tension pass so many cells may itself leave a line slack; and by how much shorter one should
# be that shows whether it does.
MOST_PASSED, SHORTER = 4.0, 16.0
# Where energy is created.
FASTEST = "the fastest point is at this place"


def borne_strain(model: Model) -> Floats:
    """Strain (N,) that each cell bears; infinite where it does not stretch."""
    s = model.line.s
    return np.asarray(model.cable.max_strain[model.cable.piece(0.5 * (s[:-1] + s[1:]))])


def most_stretched(model: Model, state: State) -> int:
    """The cell that is stretched or compressed most, of what it bears."""
    return int(np.argmax(np.abs(np.linalg.norm(state.e, axis=1) / model.line.h - 1.0) / borne_strain(model)))


def stretch_text(model: Model, state: State) -> str:
    """How far the cable is stretched or compressed (a negative strain), and how far it may be."""
    cell = most_stretched(model, state)
    strain, borne = np.linalg.norm(state.e[cell]) / model.line.h[cell] - 1.0, borne_strain(model)[cell]
    text = f"a strain of {100.0 * strain:.3g} % under {state.T[cell]:.4g} N, where max_strain is {100.0 * borne:.3g} %"
    apart, length = float(np.linalg.norm(state.r[-1] - state.r[0])), float(model.line.h.sum())
    if strain < 0.0 or apart <= length:
        return text
    return f"{text}; its ends are {apart:.6g} m apart, and it is {length:.6g} m long: too short for where they are"


def winch_text(paying: PayingOut) -> str:
    """What is out where a winch has no more line, or none to take in."""
    least, most = paying.plan.shortest, paying.plan.longest
    return f"{paying.length:.6g} m are out, of {least:.6g} m at least and {most:.6g} m (longest) at most"


class Stopped(NamedTuple):
    """A line of which a step fails, and no shorter one leads on."""

    model: Model
    now: State
    before: State  # the state that the last try led to
    clock: Clock
    counts: Counts
    tried: Tried
    dt: float  # s, of the last try; 0: there is no consistent start
    waves: float  # s, in which one passes its shortest catenary cell
    zones_move: bool
    held: bool  # whether both of its ends are, by what does not move with it
    touches: str  # what touches now, for the text; empty: nothing
    ended: str = ""  # why it is over though a step has been made

    @property
    def planned(self) -> float:
        """Length, s, that the step was to have."""
        return float(self.clock.until - self.clock.begin)

    @property
    def node(self) -> int:
        """The node at which the failure showed first."""
        return min(max(self.tried.where, 0), self.model.line.s.size - 1)

    @property
    def used_up(self) -> bool:
        """Whether the step has used up the Newton iterations that it may take."""
        return bool(0 < self.counts.most_iterations <= self.counts.taken)

    @property
    def too_long(self) -> bool:
        """Whether waves of tension pass many cells in the step as it was to be: so they did in those before."""
        return self.counts.steps > 0 and self.planned > MOST_PASSED * self.waves


def explanation(x: Stopped) -> str:
    """Why a run cannot go on, beside its cause."""
    model, outcome = x.model, x.tried.outcome
    if x.ended:
        detail = x.ended
    elif outcome == Outcome.SLACK:
        detail = _slack_detail(x)
        if x.zones_move:
            detail += "; model.force_catenary keeps it from becoming a rod"
    elif outcome == Outcome.GAINS_ENERGY:
        detail = FASTEST
    elif outcome == Outcome.TWISTED_TOO_FAR:
        detail = f"{model.cells} cells"
    elif outcome == Outcome.OVERSTRETCHED:
        detail = stretch_text(model, x.now)
    elif x.dt == 0.0:
        detail = "no accelerations are consistent with the shape and the loads"
    else:
        detail = f"smallest step tried {x.dt:.3g} s; {x.tried.iterations} Newton iterations in the last try"
    detail += x.touches
    if x.used_up:
        detail += f"; the {int(x.counts.most_iterations)} iterations that a step may take are used up"
    ends = model.ends.at_time(float(x.clock.now) + x.dt)
    apart = float(np.linalg.norm(ends.position[1] - ends.position[0]))
    if x.held and model.inextensible and apart >= model.length:
        longest = f"the cable does not stretch beyond {model.length:.6g} m"
        detail += f"; the ends are then {apart:.6g} m apart, and {longest}"
    return detail


def _slack_detail(x: Stopped) -> str:
    """Over which steps a catenary was slack, and whether they are short enough for the line to be to blame."""
    tension, cell = x.before.T[min(x.node, x.before.T.size - 1)], "a wave passes a cell in"
    over = f", tried after longer ones from {x.planned:.3g} s on," if x.dt < 0.99 * x.planned else ""
    detail = (
        f"the step of {x.dt:.3g} s{over} that starts at this time ends with a tension of {tension:.3g} N; "
        f"{cell} {x.waves:.2g} s"
    )
    return detail if x.too_long else f"{detail}: the steps are short enough, the line is slack"


def first_remedy(x: Stopped) -> str:
    """What to try before the remedy of an outcome; empty: nothing."""
    if x.used_up:
        return "restore() and a shorter step, or more iterations (most_iterations)"
    if x.tried.outcome == Outcome.GAINS_ENERGY:
        return contradictions(driven_of(x.model), soon=True)
    if x.tried.outcome != Outcome.SLACK or not x.too_long:
        return slack_remedy(x.model, x.tried.outcome, float(x.model.line.s[x.node]))
    step = max(x.planned / SHORTER, x.waves)
    return f"time.step: {step:.2g} from the start, because the steps before may be to blame, not the line"


def touch_text(contact: SelfContact | None, model: Model) -> str:
    """What is said of a line that touches itself where a step fails; empty: it does not."""
    if contact is None or not contact.touches:
        return ""
    p, q = (float(model.line.s[k]) for k in contact.deepest)
    return (
        f"; contact of the line with itself is computed, s = {min(p, q):.6g} m and s = {max(p, q):.6g} m touch: "
        f"shorter cells there may help, and contact: {{self: false}} leaves it out"
    )


def driven_of(model: Model) -> dict[str, DrivenEnd]:
    """What is set from outside of one cable, by its name in the scene."""
    ends = {f"ends.{('start', 'end')[k]}": x for k, x in model.ends.motions.items() if isinstance(x, DrivenEnd)}
    return ends | {f"obstacles.{name}": x for name, x in model.sea.driven.items()}


def write_snapshot(target: object, content: Mapping[str, Any]) -> Path | None:
    """Write arrays and texts by name; the file, or None when it cannot be written.

    target: the path of the result, beside which the snapshot is put; of anything else (a result in memory) it gets a
    name of its own in the folder for temporary files.  A link in its place is replaced, never followed.
    """
    try:
        if isinstance(target, Path):
            path = target.with_suffix(".snapshot.npz")
            path.unlink(missing_ok=True)
            file = path.open("xb")
        else:
            handle, name = tempfile.mkstemp(".snapshot.npz", "hybrid-")
            path, file = Path(name), os.fdopen(handle, "wb")
        with file:
            np.savez(file, **content)
    except OSError:
        return None
    return path
