"""What a run that fails leaves: why no step leads on, and its last good state in a file of its own."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from hybrid.errors import Outcome
from hybrid.kernels.state.books import Clock, Counts
from hybrid.kernels.state.state import Floats, State
from hybrid.model.build import Model
from hybrid.model.ends import DrivenEnd, contradictions
from hybrid.simulation.slack_bends import slack_remedy
from hybrid.solve.run import Tried
from hybrid.solve.self_contact import SelfContact

if TYPE_CHECKING:
    from hybrid.simulation.payout import PayingOut

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
    ends = model.ends.at(float(x.clock.now) + x.dt)
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
