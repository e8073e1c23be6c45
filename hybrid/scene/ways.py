"""Where what is driven is, as far as tables say it (travel, velocity and harmonic motion), and when it is farthest."""

from __future__ import annotations

import math
from collections.abc import Sequence

from hybrid.scene.end_loads import Triple
from hybrid.scene.motion_tables import SHIFTS, Motion

# Times of a period at which a distance is looked at, spread by the golden section; and of a run at most.  What they
# miss of the largest distance is some 0.5 % of an amplitude: what is found there is true all the same.
PER_PERIOD, MOST_TIMES, GOLDEN = 48, 4000, 0.5 * (math.sqrt(5.0) - 1.0)


def shift(motion: Motion | None, t: float) -> Triple:
    """How far an end has moved at t [s], inertial [m]; what files, vessels and waves do is not known here."""
    if motion is None:
        return 0.0, 0.0, 0.0
    (x, y, z), grown = motion.carried(t)[0], motion.grown(t)
    given = motion.harmonics()
    far = [
        grown * sum(h.amplitude * math.sin(2.0 * math.pi * t / h.period + math.radians(h.phase)) for h in given[name])
        if name in given
        else 0.0
        for name in SHIFTS
    ]
    return x + far[0], y + far[1], z + far[2]


def times_of(motions: Sequence[Motion | None], duration: float) -> list[float]:
    """Times [s] of a run at which what moves so may be farthest from each other, in order."""
    found, shortest = {0.0, duration}, math.inf
    for motion in motions:
        if motion is not None and motion.travel is not None:
            found.add(min(motion.travel.begin + motion.travel.over, duration))
        given = motion.harmonics() if motion is not None else {}
        shortest = min([shortest, *(h.period for name in SHIFTS for h in given.get(name, ()) if h.amplitude)])
    count = min(math.ceil(PER_PERIOD * duration / shortest), MOST_TIMES)
    return sorted(found | {duration * (k * GOLDEN % 1.0) for k in range(1, count)})


def farthest(
    places: tuple[Triple, Triple], motions: tuple[Motion | None, Motion | None], duration: float, within: float = 0.0
) -> tuple[float, float]:
    """The largest distance [m] of two ends that are held at places and driven so, and when [s].

    within: m, a distance of which only what is beyond is of interest: nearer ones are not looked for in time.
    """
    apart = math.dist(*places)
    if apart + sum(_most(x, duration) for x in motions) <= within:
        return apart, 0.0
    return max(((_apart(places, motions, t), t) for t in times_of(motions, duration)), key=lambda x: x[0])


def moving_key(motion: Motion) -> str:
    """The key of a motion that moves its end most, of those that are followed here; "" where none does."""
    given = motion.harmonics()
    sizes = {name: sum(abs(h.amplitude) for h in given.get(name, ())) for name in SHIFTS}
    largest = max(sizes, key=lambda name: sizes[name])
    if motion.travel is not None or motion.velocity is not None:
        return "travel" if motion.travel is not None else "velocity"
    return largest if sizes[largest] else ""


def smaller(key: str) -> str:
    """What of a motion, by the key that moves an end most, would keep it nearer."""
    return "a shorter way" if key in ("travel", "velocity") else f"a smaller amplitude of {key}"


def _apart(places: tuple[Triple, Triple], motions: tuple[Motion | None, Motion | None], t: float) -> float:
    (a, b), (u, v) = places, (shift(motion, t) for motion in motions)
    return math.dist((a[0] + u[0], a[1] + u[1], a[2] + u[2]), (b[0] + v[0], b[1] + v[1], b[2] + v[2]))


def _most(motion: Motion | None, duration: float) -> float:
    """What a motion moves an end by at most, m."""
    if motion is None:
        return 0.0
    far = sum(abs(h.amplitude) for name, given in motion.harmonics().items() if name in SHIFTS for h in given)
    far += math.hypot(*motion.velocity) * duration if motion.velocity is not None else 0.0
    return far + (math.hypot(*motion.travel.by) if motion.travel is not None else 0.0)
