"""What is checked of a result when it is complete: outputs too far apart for its end forces, vibrations damped out."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from hybrid.kernels.state import Floats
from hybrid.simulation.run_sample import RunSample
from hybrid.store.reader import Result

# Worth a word: so many times the estimated error, and this part of the largest end force.
TIMES_THE_ERROR, PART = 2.0, 0.02
# Outputs after a change of zones within which a shake is laid to it.
SOON = 2.0
# Energy lost to the scheme that is worth a word, as a part of the largest kinetic energy, and of tension scale times
# length: below, it is what Newton's tolerance leaves.
NOTHING_LOST = 1e-6
# The same as a part of all work done: what the books miss when steps are long.
IN_BOOKS = 0.01


def undersampled_end_forces(
    times: Floats, result: RunSample, errors: Mapping[str, float], changes: Sequence[float]
) -> list[tuple[str, str]]:
    """Events (kind, text): where an end force leaves the curve through its outputs by more than its error, N.

    times: (nt,) s, of the outputs; changes: s, when zones have changed.
    """
    out: list[tuple[str, str]] = []
    t = result.forces[:, 0]
    if len(times) < 4 or len(t) <= len(times):
        return out
    from scipy.interpolate import CubicSpline  # slow to import

    largest = float(result.forces[:, 1:].max())
    for end, force in (("start", result.forces[:, 1]), ("end", result.forces[:, 2])):
        name = f"end_force_{end}"
        if name not in errors or f"reaction_{end}" not in result.values:
            continue
        seen = CubicSpline(times, np.linalg.norm(np.asarray(result.values[f"reaction_{end}"]), axis=1))
        inside = (t >= times[1]) & (t <= times[-2])  # at the first and last output the curve has one side only
        off = np.where(inside, np.abs(force - seen(t)), 0.0)
        i = int(off.argmax())
        error = errors[name]
        if off[i] > max(TIMES_THE_ERROR * error, PART * largest):
            every = float(np.median(np.diff(times)))
            text = (
                f"between outputs the force at the {end} leaves the curve through them by up to {off[i]:.3g} N, at "
                f"t = {t[i]:.4g} s; the error figure ({error:.2g} N) is that of outputs; output.every: "
                f"{every / 10:.2g} shows it"
            )
            shaken = [x for x in changes if 0.0 <= t[i] - x <= SOON * every]
            if shaken:
                text += f"; zones that change (t = {shaken[-1]:.4g} s) may have shaken it: model: rod has none"
            out.append(("end force between outputs", text))
    return out


def damped_vibrations(result: Result) -> tuple[tuple[str, str], ...]:
    """Events (kind, text): where the time scheme has dissipated more energy than the cable ever stored by straining."""
    names = [x for x in ("energy/stretch", "energy/bending", "energy/torsion") if x in result]
    strained = sum(np.array(result[x]) for x in names)
    lost = -float(np.min(result["work/scheme"]))
    peak = float(np.ptp(strained)) if np.ndim(strained) else 0.0
    books = IN_BOOKS * sum(float(np.abs(result.work[x]).max()) for x in result.work if x != "scheme")
    least = NOTHING_LOST * float(result.attributes["tension_scale"]) * float(result.attributes["length"])
    if not lost > max(peak, NOTHING_LOST * float(np.max(result.energy["kinetic"])), least, books):
        return ()
    text = (
        f"steps follow the motion in metres: vibrations of less are damped out ({lost:.2g} J, where at most "
        f"{peak:.2g} J are stored by strain), and with them their moments and reactions, which the error figure "
        f"does not see; for those give a time.step that follows them"
    )
    return (("vibrations damped", text),)
