"""What a run that fails leaves: why no step leads on, and its last good state in a file of its own."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from hybrid.errors import Outcome
from hybrid.scene.read import scene_text
from hybrid.simulation.diagnostics import stretch_text
from hybrid.simulation.transient import Transient
from hybrid.solve.run import Tried


def explanation(run: Transient, tried: Tried, dt: float) -> str:
    """Why a run cannot go on, beside its cause; tried: the last try, over dt (s)."""
    model = run.model
    if tried.outcome == Outcome.SLACK:
        tension = run.before.T[failed_node(run, tried)]
        detail = f"the step that starts at this time ends with a tension of {tension:.3g} N"
        if run.switching is not None:
            detail += "; model.force_catenary keeps it from becoming a rod"
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
    ends = model.ends.at(run.t + dt)
    apart = float(np.linalg.norm(ends.position[1] - ends.position[0]))
    if ends.held.all() and model.inextensible and apart >= model.length:
        longest = f"the cable does not stretch beyond {model.length:.6g} m"
        detail += f"; the ends are then {apart:.6g} m apart, and {longest}"
    return detail


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
