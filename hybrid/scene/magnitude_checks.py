"""Numbers that no line, sea or seabed has: refused when the scene is read.

What is possible and more likely in another unit is noted in the result instead (`model/plausibility.py`).
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING

from hybrid.scene.analysis import Time
from hybrid.scene.base import Finding
from hybrid.scene.cable import Environment
from hybrid.scene.ends import End, Ends, Triple
from hybrid.scene.motion_tables import Motion
from hybrid.scene.sea_checks import deepest_place

if TYPE_CHECKING:
    from hybrid.scene.motion_file import Record

# No solid has a coefficient of friction of 10; a chain in gravel reaches 1.
ROUGHEST = 10.0
# N; what is beyond the 1e8 that the strongest moorings bear is noted (model/plausibility.py), and far above it refused:
# scenes in units of their own are none of its matter.
LARGEST_FORCE = 1e13
# Times at which a motion near the seabed is looked at: to a period, and in all.
TO_A_PERIOD, MOST_TIMES = 24, 4000


def friction(environment: Environment) -> Iterator[Finding]:
    """A coefficient of friction of the seabed that no ground has."""
    given = environment.seabed.friction if environment.seabed is not None else None
    for key in ("axial", "lateral") if given is not None else ():
        value = getattr(given, key)
        if value > ROUGHEST:
            fix = f"a coefficient, not percent: {value / 100.0:g}" if value <= 200.0 else "a coefficient, such as 0.5"
            place = ("environment", "seabed", "friction", key)
            yield Finding(place, f"0 to {ROUGHEST:g}: sand has 0.3 to 0.6, chain in gravel up to 1", fix, f"{value:g}")
            return


def end_forces(ends: Ends) -> Iterator[Finding]:
    """A force at an end that would tear any line."""
    for name, end in ends.named().items():
        for load in end.loads:
            force = max(math.hypot(*value) for value in load.values)
            if load.what == "force" and force > LARGEST_FORCE:
                expected = f"less than {LARGEST_FORCE:g} N, a hundred thousand times what the strongest moorings bear"
                yield Finding(
                    ("ends", name, *load.key), expected, "check the number; forces are in N", f"{force:.4g} N"
                )


# --- ends that are moved into the seabed ---------------------------------------------------------


def moved_into_the_ground(
    end: End, motion: Motion, record: Record | None, time: Time | None, environment: Environment | None, length: float
) -> Iterator[Finding]:
    """A motion that takes an end under the seabed; nothing is said of vessels in waves.

    record: of motion.file; length: of the cable, m.
    """
    bed, place = environment.seabed if environment is not None else None, end.held_position
    sails = motion.vessel is not None and motion.file is None
    if bed is None or environment is None or place is None or time is None or sails or motion.follow is not None:
        return
    depth, surface = length, environment.fluid.surface if environment.fluid is not None else None
    if surface is not None:
        depth = max(surface - bed.height(0.0, 0.0), 0.0)
    sunk = deepest_place(bed, depth)
    if place[2] - bed.height(*place[:2]) < -sunk or not _may_reach(place, motion, record, time, bed.is_level, bed.z):
        return  # complained of already, or far above it
    from hybrid.scene.motion import EndMotion

    moving = EndMotion(motion, place)
    deepest, when, there = 0.0, 0.0, place
    for t in _times(motion, record, time):
        x, y, z = moving.at(t)[0].tolist()
        under = bed.height(x, y) - z
        if under > max(sunk, deepest):
            deepest, when, there = under, t, (x, y, z)
    if deepest > 0.0:
        given = f"a motion that takes the end {deepest:.4g} m under the seabed at t = {when:.4g} s"
        expected = f"an end that stays on the seabed or above, z >= {bed.height(*there[:2]):.6g} m"
        yield Finding(
            (), expected, "is it the motion of the other end? give it to that, or exchange start and end", given
        )


def _may_reach(place: Triple, motion: Motion, record: Record | None, time: Time, level: bool, bed: float) -> bool:
    """Whether a motion may lead down to a bed at all: amplitudes and ways added."""
    if not level or (record is not None and record.shift is not None):
        return True
    down = sum(abs(h.amplitude) for h in motion.harmonics().get("heave", ()))
    down += abs(motion.travel.by[2]) if motion.travel is not None else 0.0
    down += abs(motion.velocity[2]) * time.duration if motion.velocity else 0.0
    return place[2] - down < bed


def _times(motion: Motion, record: Record | None, time: Time) -> list[float]:
    """Times (s) of a run at which a motion is looked at."""
    if record is not None:
        every = max(1, len(record.times) // MOST_TIMES)
        return [t for t in record.times[::every].tolist() if t <= time.duration]
    periods = [h.period for listed in motion.harmonics().values() for h in listed if h.amplitude]
    count = min(MOST_TIMES, 50 + int(TO_A_PERIOD * time.duration / min(periods, default=time.duration)))
    return [time.duration * k / count for k in range(1, count + 1)]
