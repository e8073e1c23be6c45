"""What is checked of a result when it is complete: outputs too far apart for its end forces, vibrations damped out."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from hybrid.kernels.state.state import Floats
from hybrid.model.resolution import OF_VIBRATION, Vibration, start_vibrations, strain_travel
from hybrid.scene.schema import LineScene
from hybrid.simulation.run_sample import END_FORCES, RunSample
from hybrid.store.reader import Result

# Worth a word: so many times the estimated error, and this part of the largest end force.
TIMES_THE_ERROR, PART = 2.0, 0.02
# Outputs after a change of zones within which a shake is laid to it.
SOON = 2.0
# Steps to a period that show a vibration.
STEPS_PER_VIBRATION = 12
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
    t, largest = result.forces[:, 0], float(result.forces[:, 1:].max(initial=0.0))
    for name, off in beyond_outputs(times, result).items():
        if name not in errors:
            continue
        i, error, end = int(off.argmax()), errors[name], name.removeprefix("end_force_")
        if off[i] > max(TIMES_THE_ERROR * error, PART * largest):
            every = float(np.median(np.diff(times)))
            text = (
                f"between outputs the force at the {end} leaves the curve through them by up to {off[i]:.3g} N, at "
                f"t = {t[i]:.4g} s; the error figure ({error:.2g} N) is by what all steps of the runs differ; "
                f"output.every: {every / 10:.2g} shows it"
            )
            shaken = [x for x in changes if 0.0 <= t[i] - x <= SOON * every]
            if shaken:
                text += f"; zones that change (t = {shaken[-1]:.4g} s) may have shaken it: model: rod has none"
            out.append(("end force between outputs", text))
    return out


def beyond_outputs(times: Floats, result: RunSample) -> dict[str, Floats]:
    """By how much end forces of all steps (n,) N leave the curves through their outputs, at times (nt,) s, by name."""
    found: dict[str, Floats] = {}
    t = result.forces[:, 0]
    if len(times) < 4 or len(t) <= len(times):
        return found
    inside = (t >= times[1]) & (t <= times[-2])  # at the first and last output the curve has one side only
    for force, (raw, name) in zip(result.forces[:, 1:].T, END_FORCES.items(), strict=True):
        if raw in result.values:
            outputs = np.linalg.norm(np.asarray(result.values[raw]), axis=1)
            found[name] = np.where(inside, np.abs(force - cubic_spline(times, outputs, t)), 0.0)
    return found


def cubic_spline(x: Floats, y: Floats, at: Floats) -> Floats:
    """The cubic spline through four or more points (not-a-knot: its first two pieces are one, and its last two)."""
    h, slope = np.diff(x), np.diff(y) / np.diff(x)
    # below, diagonal, above, right-hand side of the second derivatives at the inner points
    a, b, c, d = h[:-1].copy(), 2.0 * (h[:-1] + h[1:]), h[1:].copy(), 6.0 * np.diff(slope)
    b[0] += h[0] * (1.0 + h[0] / h[1])
    c[0] -= h[0] * h[0] / h[1]
    b[-1] += h[-1] * (1.0 + h[-1] / h[-2])
    a[-1] -= h[-1] * h[-1] / h[-2]
    lower, diagonal, upper, m = (v.tolist() for v in (a, b, c, d))
    for i in range(1, len(m)):
        w = lower[i] / diagonal[i - 1]
        diagonal[i] -= w * upper[i - 1]
        m[i] -= w * m[i - 1]
    m[-1] /= diagonal[-1]
    for i in range(len(m) - 2, -1, -1):
        m[i] = (m[i] - upper[i] * m[i + 1]) / diagonal[i]
    first = m[0] + (m[0] - m[1]) * h[0] / h[1]
    last = m[-1] + (m[-1] - m[-2]) * h[-1] / h[-2]
    M = np.array([first, *m, last])
    k = np.clip(np.searchsorted(x, at, side="right") - 1, 0, len(h) - 1)
    p, l = at - x[k], h[k]
    return np.asarray(
        y[k] + p * (slope[k] - l * (2.0 * M[k] + M[k + 1]) / 6.0 + p * (0.5 * M[k] + p * (M[k + 1] - M[k]) / (6.0 * l)))
    )


def jolts(scene: LineScene) -> list[Vibration]:
    """Where the slope of a load's history jumps, and the vibration along the line that starts there.

    A jump a (N/s) at one end of a bar that is held at the other makes a triangle of a L/c about the slow answer, of
    period 4 L/c; L/c is the time in which strain runs along it.  None in a line that does not stretch.
    """
    travel = strain_travel(scene.cable)
    if travel is None:
        return []
    found = []
    for load in (load for end in scene.ends.both for load in end.loads if load.what == "force"):
        rows = np.array(load.rows)
        if len(rows) < 2:
            continue
        times, values = rows[:, 0], rows[:, 1:]
        slopes = np.diff(values, axis=0) / np.diff(times)[:, None]
        jump = np.diff(np.vstack([np.zeros(3), slopes, np.zeros(3)]), axis=0)
        sizes = np.linalg.norm(values, axis=1)
        along = np.abs((jump * values).sum(axis=1)) / np.where(
            sizes > 0.0, sizes, 1.0
        )  # lines lie along what pulls them
        both = zip(times, along, strict=True)
        found += [Vibration(float(t), float(a) * travel, 4.0 * travel) for t, a in both if t > 0.0]
    return found


def damped_jolts(scene: LineScene, result: RunSample, error: float, allowed: float | None) -> list[tuple[str, str]]:
    """The events that say so where steps damp a vibration that a jump in the slope of a load, or a ramp, starts.

    error: N, figure of the forces at the ends, which does not see it, as all runs damp it; allowed: N, None: not asked.
    """
    worth = error if allowed is None else max(allowed - error, 0.0)
    of_ramps = worth if allowed is None else max(worth, OF_VIBRATION * allowed)
    out = []
    for found, least, begins, cure in (
        (jolts(scene), worth, "the slope of a force given at an end jumps", "a smoother history"),
        (start_vibrations(scene), of_ramps, "the ramp or move of an end begins or ends", "a longer ramp or move"),
    ):
        worst = max((x for x in found if not _is_shown(x, result.forces[:, 0])), key=lambda x: x.force, default=None)
        if worst is None or not worst.force > least:
            continue
        text = (
            f"{begins} at t = {worst.t:.4g} s: a vibration along the line of {worst.force:.2g} N and a period of "
            f"{worst.period:.2g} s starts, which steps damp out, and the error figure of forces ({error:.2g} N) "
            f"does not see it; time.step: {worst.period / STEPS_PER_VIBRATION:.2g} shows it, or {cure} has none"
        )
        out.append(("error uncertain", text))
    return out


def _is_shown(found: Vibration, steps: Floats) -> bool:
    """Whether the steps (s, when they end) after a vibration has begun follow it, or the run is over before."""
    t, period = found.t, found.period
    near = (steps >= t - 1e-9 * period) & (steps <= t + 2.0 * period)
    return bool(t >= steps[-1] or np.count_nonzero(near) > 2.0 * STEPS_PER_VIBRATION)


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
