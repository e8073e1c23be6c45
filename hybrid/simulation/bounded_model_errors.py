"""Errors of leaving bending out that a linear estimate lets drift: bounded by what criteria of zones let pass."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from hybrid.simulation.run_sample import NOT_ESTIMATED, Notes, RunSample

if TYPE_CHECKING:
    from hybrid.accuracy.errors_by_cause import Errors

# Model errors beyond so many times what the criteria of zones let pass are not believed: a loose line drifts for ever.
BELIEVED = 30.0
# Part of an error figure that an estimate of neglected bending may be wrong by, beyond which that is said.
WORTH_SAYING = 0.5


def bounded(run: RunSample) -> tuple[np.ndarray | None, Notes]:
    """Factors (nt,) on the model errors of a run whose zones move, and the event that says so; None: they are believed.

    Where they shift the cable by too much to be believed, the criteria of the zones are: at every output where the
    shift is beyond what they let pass it counts as that, and the errors of all else in proportion, because the estimate
    is linear.  Left out, as until 0.6, they made a figure of 2 mm where 37 mm were true.
    """
    found = run.model_error.get("position")
    if found is None or not run.bound:
        return None, ()
    shift = np.asarray(found)
    largest = shift.max(axis=tuple(range(1, shift.ndim)), initial=0.0)
    most = float(np.max(largest, initial=0.0))
    if most <= BELIEVED * run.bound:
        return None, ()
    text = (
        f"the error of leaving bending out comes to {most:.3g} m, beyond what its criteria let pass "
        f"({run.bound:.3g} m): it is not believed and counts as that, in forces and moments in proportion; "
        "compare with model: rod"
    )
    return run.bound / np.maximum(largest, run.bound), ((NOT_ESTIMATED, text),)


def scaled(error: np.ndarray, factors: np.ndarray | None) -> np.ndarray:
    """Errors (n, ...) of n outputs, times factors (n,); None: as they are."""
    return error if factors is None else error * factors.reshape(-1, *[1] * (error.ndim - 1))


def doubt_text(doubt: np.ndarray) -> str:
    """Where a linear estimate of neglected bending knows least, and why; doubt: as of `RunSample`."""
    t, s, share, far = doubt.tolist()
    part = 100.0 * min(share, 1.0)
    return (
        f"at t = {t:.4g} s, s = {s:.4g} m bending, which a catenary neglects, changes the tension or the direction of "
        f"the line so much that a linear estimate of its shift ({far:.2g} m) may be wrong by {part:.0f} %"
    )


def possible_error(found: float, doubt: np.ndarray, largest: float) -> float:
    """By how much a model error may be larger than its figure, which is linear; largest: m, figure of the position."""
    _, _, share, far = doubt.tolist()
    return found * min(share, 1.0) * min(far / largest, 1.0) if largest > 0.0 else 0.0


def doubtful(errors: Errors, doubt: np.ndarray, bounds: Mapping[str, float] | None) -> Notes:
    """The event that says so where a model error that is not known may take a figure beyond what is asked.

    bounds: what is asked, by quantity; None: nothing is, and the figure of position is to be right.
    """
    if not doubt[2] > 0.0:
        return ()
    far, names = errors.largest("model", "position"), []
    for name, bound in (bounds or {"position": 0.0}).items():
        total = errors.largest("total", name)
        more = possible_error(errors.largest("model", name), doubt, far)
        if more > WORTH_SAYING * total and total + more > bound:
            names.append(name.replace("_", " "))
    if not names:
        return ()
    text = (
        f"{doubt_text(doubt)}: the error of {', '.join(names)} may be larger than its figure; compare with model: rod, "
        "or model: adaptive, which makes such places rod"
    )
    return (("error uncertain", text),)
