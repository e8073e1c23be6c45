"""Whether the outputs are too far apart: end forces are known at every step, their errors at outputs only."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from scipy.interpolate import CubicSpline

from hybrid.errors import ZONE_EVENTS
from hybrid.store.reader import Result

# Worth a word: so many times the estimated error, and this part of the largest end force.
TIMES_THE_ERROR, PART = 2.0, 0.02
# Outputs after a change of zones within which a shake is laid to it.
SOON = 2.0


def undersampled_end_forces(result: Result, errors: Mapping[str, np.ndarray]) -> list[tuple[str, str]]:
    """Events (kind, text): where an end force leaves the curve through its outputs by more than its error."""
    out: list[tuple[str, str]] = []
    times, t = result.times, result["steps/t"] if "steps/t" in result else np.zeros(0)
    if len(times) < 4 or len(t) <= len(times):
        return out
    largest = max(float(result[f"steps/end_force_{end}"].max()) for end in ("start", "end"))
    for end in ("start", "end"):
        name = f"end_force_{end}"
        if name not in errors or f"reaction_{end}" not in result:
            continue
        force = result[f"steps/end_force_{end}"]
        seen = CubicSpline(times, np.linalg.norm(result[f"reaction_{end}"], axis=1))
        inside = (t >= times[1]) & (t <= times[-2])  # at the first and last output the curve has one side only
        off = np.where(inside, np.abs(force - seen(t)), 0.0)
        i = int(off.argmax())
        error = float(errors[name].max())
        if off[i] > max(TIMES_THE_ERROR * error, PART * largest):
            every = float(np.median(np.diff(times)))
            text = (
                f"between outputs the force at the {end} leaves the curve through them by up to {off[i]:.3g} N, at "
                f"t = {t[i]:.4g} s; the error figure ({error:.2g} N) is that of outputs; output.every: "
                f"{every / 10:.2g} shows it"
            )
            shaken = [e.t for e in result.events if e.kind in ZONE_EVENTS and 0.0 <= t[i] - e.t <= SOON * every]
            if shaken:
                text += f"; zones that change (t = {shaken[-1]:.4g} s) may have shaken it: model: rod has none"
            out.append(("end force between outputs", text))
    return out
