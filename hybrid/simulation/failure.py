"""What a run that fails leaves: why no step leads on, and its last good state in a file of its own."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from hybrid.errors import Outcome
from hybrid.model.build import Model
from hybrid.model.driven_end import DrivenEnd, contradictions
from hybrid.scene.read import scene_text
from hybrid.simulation.diagnostics import stretch_text
from hybrid.simulation.slack_bends import slack_remedy
from hybrid.simulation.transient import Transient
from hybrid.solve.run import Tried

if TYPE_CHECKING:
    from hybrid.simulation.payout import PayingOut

# A step in which waves of tension pass so many cells may itself leave a line slack; and by how much shorter one should
# be that shows whether it does.
MOST_PASSED, SHORTER = 4.0, 16.0


def winch_text(paying: PayingOut) -> str:
    """What is out where a winch has no more line, or none to take in."""
    least, most = paying.plan.shortest, paying.plan.longest
    return f"{paying.length:.6g} m are out, of {least:.6g} m at least and {most:.6g} m (longest) at most"


def explanation(run: Transient, tried: Tried, dt: float) -> str:
    """Why a run cannot go on, beside its cause; tried: the last try, over dt (s)."""
    model = run.model
    if tried.outcome == Outcome.SLACK:
        detail = _slack_detail(run, tried, dt)
        if run.switching is not None:
            detail += "; model.force_catenary keeps it from becoming a rod"
    elif tried.outcome == Outcome.WINCH_AT_END:
        assert run.payout is not None
        detail = winch_text(run.payout)
    elif tried.outcome == Outcome.COLLAPSED:
        detail = run.collapse
    elif tried.outcome == Outcome.GAINS_ENERGY:
        detail = "the fastest point is at this place"
    elif tried.outcome == Outcome.TWISTED_TOO_FAR:
        detail = f"{model.cells} cells"
    elif tried.outcome == Outcome.OVERSTRETCHED:
        detail = stretch_text(model, run.state)
    elif dt == 0.0:
        detail = "no accelerations are consistent with the shape and the loads"
    else:
        detail = f"smallest step tried {dt:.3g} s; {tried.iterations} Newton iterations in the last try"
    contact = run.run.contact
    if contact is not None and contact.touches and tried.outcome != Outcome.COLLAPSED:
        p, q = (float(model.line.s[k]) for k in contact.deepest)
        detail += (
            f"; contact of the line with itself is computed, s = {min(p, q):.6g} m and s = {max(p, q):.6g} m touch: "
            f"shorter cells there may help, and contact: {{self: false}} leaves it out"
        )
    if _used_up(run):
        detail += f"; the {int(run.run.count.most_iterations)} iterations that a step may take are used up"
    ends = model.ends.at(run.t + dt)
    apart = float(np.linalg.norm(ends.position[1] - ends.position[0]))
    if ends.held.all() and model.inextensible and apart >= model.length:
        longest = f"the cable does not stretch beyond {model.length:.6g} m"
        detail += f"; the ends are then {apart:.6g} m apart, and {longest}"
    return detail


def _used_up(run: Transient) -> bool:
    """Whether the step that fails has used up the Newton iterations that it may take."""
    count = run.run.count
    return bool(0 < count.most_iterations <= count.taken)


def _slack_detail(run: Transient, tried: Tried, dt: float) -> str:
    """Over which steps a catenary was slack, and whether they are short enough for the line to be to blame."""
    tension, waves = run.before.T[failed_node(run, tried)], float(run.run.clock.wave_step)
    over = f", tried after longer ones from {_planned(run):.3g} s on," if dt < 0.99 * _planned(run) else ""
    detail = (
        f"the step of {dt:.3g} s{over} that starts at this time ends with a tension of {tension:.3g} N; a wave "
        f"passes a cell in {waves:.2g} s"
    )
    return detail if _steps_too_long(run) else f"{detail}: the steps are short enough, the line is slack"


def _steps_too_long(run: Transient) -> bool:
    """Whether waves of tension pass many cells in the step that fails, as it was to be: so they did in those before."""
    return run.steps > 0 and _planned(run) > MOST_PASSED * float(run.run.clock.wave_step)


def _planned(run: Transient) -> float:
    """Length, s, that the step that fails was to have."""
    return float(run.run.clock.until - run.run.clock.begin)


def first_remedy(run: Transient, tried: Tried) -> str:
    """What to try before the remedy of an outcome; empty: nothing."""
    if _used_up(run):
        return "restore() and a shorter step, or more iterations (most_iterations)"
    if tried.outcome == Outcome.GAINS_ENERGY:
        return contradictions(driven_of(run.model), soon=True)
    if tried.outcome != Outcome.SLACK or not _steps_too_long(run):
        return slack_remedy(run.model, tried.outcome, float(run.model.line.s[failed_node(run, tried)]))
    step = max(_planned(run) / SHORTER, float(run.run.clock.wave_step))
    return f"time.step: {step:.2g} from the start, because the steps before may be to blame, not the line"


def driven_of(model: Model) -> dict[str, DrivenEnd]:
    """What is set from outside of one cable, by its name in the scene."""
    ends = {f"ends.{('start', 'end')[k]}": x for k, x in model.ends.motions.items() if isinstance(x, DrivenEnd)}
    return ends | {f"obstacles.{name}": x for name, x in model.sea.driven.items()}


def failed_node(run: Transient, tried: Tried) -> int:
    """The node at which a failure showed first."""
    return min(max(tried.where, 0), run.model.line.s.size - 1)


def snapshot(run: Transient, target: object, tried: Tried, dt: float) -> Path | None:
    """Write the last good state with all that a repetition of the failed step needs; None when it cannot be written."""
    content: dict[str, Any] = {"t": run.t, "dt": dt, "outcome": tried.outcome.name, "s": run.model.line.s}
    return write_snapshot(target, content | {"scene": scene_text(run.scene), **run.state._asdict()})


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
