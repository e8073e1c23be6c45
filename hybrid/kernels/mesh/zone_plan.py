"""From what the criteria say to zones: a pure function, so that the same past gives the same plan.

Compiled, because it is asked for a plan several times in a hold time, mostly without any change.
"""

from __future__ import annotations

import math
from typing import Annotated, NamedTuple

import numpy as np
from numpy.typing import NDArray

from hybrid.kernels.machine.compile import inner, kernel
from hybrid.kernels.machine.references import reader
from hybrid.kernels.mesh import zone_step as z
from hybrid.kernels.mesh.zone_criteria import CRITERIA, GIVEN, TORSION
from hybrid.kernels.state.state import Floats, Rows, blanks

OFF = np.array([x.off for x in CRITERIA])
ROUND_BUFFER = 1e-9  # of a length
ROUND_TIME = 1e-9  # of the ramp time of zones
BACK = 0.5  # ratio above which a rod that is on its way out comes back


@inner
def _asks(ratios, bound, j):
    """Whether any ratio of base cell j is above its bound, or not a number."""
    for c in range(ratios.shape[0]):
        if not ratios[c, j] <= bound[c]:
            return True
    return False


@inner
def _over(ratios, bound, j):
    """The same with one bound for all."""
    for c in range(ratios.shape[0]):
        if not ratios[c, j] <= bound:
            return True
    return False


@kernel
def mark_wanted(ratios, off, rod, out):
    for j in range(rod.size):
        out[j] = _asks(ratios, off, j) if rod[j] else _over(ratios, 1.0, j)


@kernel
def mark_spread(asks, base, buffer, out):
    n = asks.size
    out[:] = False
    for j in range(n):
        if asks[j]:
            out[j] = True
            k = j - 1
            while k >= 0 and base[k + 1] > base[j] - buffer[j]:
                out[k] = True
                k -= 1
            k = j + 1
            while k < n and base[k] < base[j + 1] + buffer[j]:
                out[k] = True
                k += 1


@kernel
def reach(T, base_of_cell, EI, w, floor, parts, light, buffer):
    """Buffers (n,) m of base cells: `parts` times sqrt(EI/T), or (EI/w)^(1/3) where that is shorter.

    Of the lowest tension in a base cell, and of that of its two nodes where it is shorter: nodes have the stiffness of
    the stiffer side; light: least weight that counts, N/m.
    """
    first = 0
    for i in range(T.size):
        j = base_of_cell[i]
        if i == 0 or base_of_cell[i - 1] != j:
            first, least = i, T[i]
        least = min(least, T[i])
        if i + 1 == T.size or base_of_cell[i + 1] != j:
            buffer[j] = math.inf
            for k in (first, i + 1):
                long = min((EI[k] / max(w[k], light)) ** (1.0 / 3.0), math.sqrt(EI[k] / max(least, floor[k])))
                buffer[j] = min(buffer[j], parts * long)


@inner
def _end(flags, a):
    """Where the run of equal flags that begins at a ends."""
    b = a + 1
    while b < flags.size and flags[b] == flags[a]:
        b += 1
    return b


@kernel
def widen(buffer, H):
    """Buffers (n,) m reach over two cells on either side at least; H: (n,) m, lengths of cells."""
    n = H.size
    for j in range(n):
        beside = max(H[max(j - 1, 0)], H[min(j + 1, n - 1)])
        buffer[j] = max(buffer[j], beside * (1.0 + ROUND_BUFFER))


@kernel
def tidy(flags, rod, shortest, before):
    n = flags.size
    changed = True
    while changed:
        for j in range(n):
            before[j] = flags[j]
        a = 0
        while a < n:
            b = _end(before, a)
            if before[a]:
                # a rod grows on both sides, cell by cell; on one side only while only that one was rod
                lo, hi = a, b
                while hi - lo < shortest and (lo > 0 or hi < n):
                    left, right = lo > 0, hi < n
                    if left and right and rod[lo - 1] != rod[hi]:
                        left, right = rod[lo - 1], rod[hi]
                    if left:
                        lo -= 1
                    if right and hi - lo < shortest:
                        hi += 1
                flags[lo:hi] = True
            a = b
        a = 0
        while a < n:
            b = _end(flags, a)
            if not flags[a] and a > 0 and b < n and b - a < shortest:
                flags[a:b] = True
            a = b
        changed = False
        for j in range(n):
            if flags[j] != before[j]:
                changed = True


@kernel
def make_plan(ratios, off, rod, below_since, t, base, buffer, shortest, wait, flags):
    """wait: (n,) s that rods must be below their thresholds; flags: (4, n) leaving, two to work in, what the base cells should be."""
    leaving, asks, near, out = flags[0], flags[1], flags[2], flags[3]
    n = rod.size
    for j in range(n):
        if leaving[j]:
            asks[j] = _over(ratios, BACK, j)
        else:
            asks[j] = _asks(ratios, off, j) if rod[j] else _over(ratios, 1.0, j)
    mark_spread(asks, base, buffer, near)
    for j in range(n):
        below_since[j] = min(below_since[j], t) if rod[j] and not near[j] else np.inf
        asks[j] = _over(ratios, 1.0, j)
    mark_spread(asks, base, buffer, near)
    for j in range(n):
        out[j] = near[j] or (rod[j] and t - below_since[j] < wait[j])
    tidy(out, rod, shortest, asks)


# --- reviews --------------------------------------------------------------------------------------


class ReviewJob(NamedTuple):
    """What a review of n base cells knows, as the domain manager has it."""

    zone_table: NDArray[np.int64]  # of a kernels.mesh.zone_step.ZoneJob
    base: Floats  # (n+1,) m
    given: NDArray[np.int64]  # (n,)
    below_since: Floats  # (n,) s, since when rods are below their thresholds
    release_cause: Rows  # (2, n) of rods on their way out: the criterion of `leading_criterion`, and its ratio
    wait_factor: Floats  # (n,) dwell times that each must be below
    seen: Rows  # (criteria, n), largest ratios since the last output
    buffer: Floats  # (n,) m (written)
    off: Floats  # (criteria,)
    next_below: Floats  # (n,) s, `below_since` as a plan would have it (written)
    wait: Floats  # (n,) s (written)
    flags: Annotated[NDArray[np.bool_], 2]  # (4, n) (written)
    shortest: int  # cells
    dwell: float  # s
    parts: float  # of the buffer
    light: float  # N/m
    forced: float  # ratio of what is given as rod
    ramp_time: float  # s, of bending stiffness
    pause: float  # of that, until the next review
    held: int  # 1 where rods may not go


blank_review_job = blanks(ReviewJob)
read, read_zones = reader(blank_review_job()), reader(z.blank_zone_job())


@inner
def leading_criterion(ratios, off, j):
    """The criterion of base cell j whose ratio is the largest part of its threshold."""
    which = 0
    for c in range(1, off.shape[0]):
        if ratios[c, j] / off[c] > ratios[which, j] / off[which]:
            which = c
    return which


@inner
def plan_zones(job, run, now):
    """What base cells should be, into flags[3], and since when rods are below their thresholds, into `next_below`."""
    zones, kinds, ratios = run.zones, run.zones.kinds, run.zones.ratios
    n = zones.rod.shape[0]
    if zones.counts.holds_twist or zones.counts.loaded:  # torque needs rods from end to end
        most = ratios[TORSION, 0]
        for j in range(1, n):
            x = ratios[TORSION, j]
            if x > most or math.isnan(x):
                most = x
        for j in range(n):
            ratios[TORSION, j] = most
    for j in range(n):
        if job.given[j] > 0:
            ratios[GIVEN, j] = job.forced
        job.flags[0, j], job.next_below[j] = zones.leaving[j], job.below_since[j]
        job.wait[j] = job.dwell * job.wait_factor[j]
    state = run.new if run.counts.parity else run.old
    reach(state.T, kinds.base_of_cell, kinds.EI, kinds.w, kinds.floor, job.parts, job.light, job.buffer)
    if z.asks_layers(zones):
        widen(job.buffer, zones.H)
    make_plan(ratios, job.off, zones.rod, job.next_below, now, job.base, job.buffer, job.shortest, job.wait, job.flags)
    for j in range(n):
        job.flags[3, j] = (job.flags[3, j] or (job.held != 0 and zones.rod[j])) and job.given[j] >= 0


@inner
def stays(job, zones, j):
    """Whether base cell j remains what it is: no catenary becomes rod, and no rod without stiffness goes."""
    return zones.rod[j] if job.flags[3, j] else not zones.rod[j] or zones.grown[j] > 0.0


@inner
def let_go(job, zones, now):
    """Rods that are not planned are on their way out; the next review is when one of them may have gone."""
    ratios, wait, going, any_before = zones.ratios, job.pause, 0, zones.counts.going
    for j in range(zones.rod.shape[0]):
        job.below_since[j] = job.next_below[j]
        goes = zones.rod[j] and not job.flags[3, j]
        if goes:
            going, wait = 1, min(wait, zones.grown[j])
            if not zones.leaving[j]:
                c = leading_criterion(ratios, job.off, j)
                job.release_cause[0, j], job.release_cause[1, j] = c, ratios[c, j]
        zones.leaving[j] = goes
    zones.counts.going = going
    if going or any_before:
        zones.counts.coming = z.is_coming(zones)  # perhaps one that was on its way out
    zones.clock.next_review = now + (max(wait, 0.0) - ROUND_TIME) * job.ramp_time


@kernel
def review_zones(table, now):
    """Plan zones at a time, s, and let rods go that are not planned; the domain manager carries the plan out."""
    job = read(table)
    run = read_zones(job.zone_table)
    plan_zones(job, run, now)
    let_go(job, run.zones, now)


@kernel
def quiet_review(table):
    """1 where a review now leaves all zones as they are, and is done; 0: the domain manager has to do it."""
    job = read(table)
    run = read_zones(job.zone_table)
    zones, now = run.zones, run.clock.now
    ratios = zones.ratios
    if zones.clock.highest_ratio > 1.0:
        return 0
    plan_zones(job, run, now)
    for j in range(zones.rod.shape[0]):
        if not stays(job, zones, j):
            return 0
    let_go(job, zones, now)
    for j in range(zones.rod.shape[0]):
        for c in range(ratios.shape[0]):
            job.seen[c, j], ratios[c, j] = max(job.seen[c, j], ratios[c, j]), 0.0
    return 1
