"""Errors of leaving bending out that a linear estimate lets drift: bounded by what criteria of zones let pass."""

from __future__ import annotations

import numpy as np

from hybrid.simulation.run_sample import NOT_ESTIMATED, Notes, RunSample

# Model errors beyond so many times what the criteria of zones let pass are not believed: a loose line drifts for ever.
BELIEVED = 30.0


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
