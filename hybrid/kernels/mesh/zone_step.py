"""What zones that move ask of every step, compiled: lengths and stiffness before it, criteria and energy after it.

A run calls `advance_zones` by its address (kernels.run.network_run), so that scenes whose zones stay compile none of it; Python calls
the same functions where a criterion or joints of its own take part (zones.change).
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from hybrid.kernels.algebra.rotations import dot, get3, sub
from hybrid.kernels.laws.axial_law import has_law, stretch_work
from hybrid.kernels.laws.element import chord
from hybrid.kernels.laws.end_motion import end_turn
from hybrid.kernels.laws.obstacles import surface_velocity
from hybrid.kernels.laws.surfaces import surface
from hybrid.kernels.laws.tension_torque import twist_of_line
from hybrid.kernels.machine.compile import inner, kernel, linked_kernel
from hybrid.kernels.machine.references import NamedNumbers, by_reference, caller, reader
from hybrid.kernels.march.energies import Observed, observe
from hybrid.kernels.mesh.cell_errors import (
    CURVATURE,
    MOMENT,
    POSITION,
    QUANTITIES,
    QUIET,
    TAU,
    TENSION,
    WAVES,
    lack_of_moment,
    lack_of_torque,
    note_waves,
    over_shares,
    spread_of_velocity,
)
from hybrid.kernels.mesh.cell_lengths import FADE, arc_less_chord, foresee_edges, plan_cells, relax_arcs
from hybrid.kernels.mesh.zone_criteria import (
    CLAMP,
    CONTACT,
    CRITERIA,
    MOST,
    TORSION,
    TWISTED,
    NodeKinds,
    advance,
    blank_kinds,
    find_curvature,
    find_turns,
    freed,
    largest_ratio,
    length_defect,
    raise_ratio,
    raise_ratios,
    shares,
    soften,
    twist_of_rods,
)
from hybrid.kernels.state import books as b
from hybrid.kernels.state.books import Clock, Counts
from hybrid.kernels.state.report import OBSTACLES, STRAND
from hybrid.kernels.state.state import Ends, Floats, Line, Rows, Sea, State, blank_state, blanks, in_sea, no_ends

# How far a falling tension is extrapolated, in ramp times; the rate is taken over one or two samples.
LOOKAHEAD, LONGEST_LOOKAHEAD = 0.125, 2.0
STRAIGHT = 1e-6  # rad: a line that turns through no more at its largest curvature is straight but for round-off
SAMPLES = 16  # of the tension per ramp time
REJECT_RATIO = 4.0  # a step that ends with a catenary above this is rejected, and repeated with more rod


class ZoneClock(NamedNumbers):
    """What zones that move know of times, in s, and of the line as a whole."""

    dt: float  # since the last evaluation
    ramp_time: float  # of bending stiffness
    age: float  # of the tensions `past` and `recent`
    recent_age: float
    next_review: float
    tolerance: float  # m, of position
    highest_ratio: float  # largest ratio among catenaries, at the last evaluation
    torque: float  # N m, that a rod from end to end would carry, where there is none
    total_twist: float  # rad, of the ends against each other
    compliance: float  # of all the line: rad per N m; rad
    free_twist: float
    letting_go: float  # over which lengths become true
    steady_step: float  # longest steps: while nothing is ramped, and else
    ramp_step: float
    share: float  # of the largest curvature that the length of cells may make it wrong by, where they follow it; 0: they stay
    fineness: float  # of cells that follow the curvature: those that lengths ask for are so many times as short
    fastest: float  # m/s, by how much velocities of nodes differed of late
    edge_time: float  # s, for which the way of a contact edge is foreseen
    memory: float  # s, over which the largest values of earlier are forgotten


class ZoneFlags(NamedNumbers, number=np.int64):
    """What is the case of zones that move."""

    known: int  # tensions of earlier are of these cells
    holds_twist: int  # both ends hold the twist
    all_rod: int
    loaded: int  # moments are given at the ends
    relaxing: int  # lengths are on their way to true ones; those of the last step were
    under_way: int
    going: int  # stiffness is ramped down; up
    coming: int
    strained: int  # `strain` is of the state now
    cells_due: int  # rods should have other cells


class Zones(NamedTuple):
    """What zones that move know; n base cells."""

    clock: ZoneClock
    counts: ZoneFlags
    kinds: NodeKinds
    clamped: Floats  # (2,) 1 where an end holds the tangent
    tangents: Floats  # (2, 3) of the clamped ends, zero where there is none
    moments: Floats  # (2, 3) N m, given at the ends
    past: Floats  # (N,) N, tensions some time ago
    recent: Floats  # (N,) N, later ones, which will take their place
    # Of tension, curvature and moment (kernels.mesh.cell_errors; of position the tolerance stands):
    asked: Floats  # (4,) parts of the largest that leaving bending out may make; 0: nothing is asked
    largest: Floats  # (4,) N, 1/m, N m, of late
    shares: Floats  # (4,) m, N, 1/m, N m, what leaving bending out may make (written)
    limits: Floats  # (4,) and what the length of cells may make (written)
    ratios: Floats  # (criteria, n), largest since the last review
    rod: NDArray[np.bool_]  # (n,)
    leaving: NDArray[np.bool_]  # (n,) rods whose stiffness is ramped down
    grown: Floats  # (n,) part of its stiffness that each rod has
    ramp_factor: Floats  # (n,) by how much faster it is ramped up
    # Of cells that follow the curvature (kernels.mesh.cell_lengths); K cells of the finest mesh:
    parts: NDArray[np.int64]  # (n,) finest cells of base cells
    H: Floats  # (n,) m, lengths of base cells
    next_rod: NDArray[np.bool_]  # (n,) what is rod where nodes are planned
    here: NDArray[np.bool_]  # (K+1,) places of nodes now
    plan: NDArray[np.bool_]  # (K+1,) and where they should be
    idle_steps: NDArray[np.int64]  # (K+1,) steps for which a node could have gone
    waves: Floats  # (K+1,) m^2, squares of the longest cells that waves allow; 0: no node, or not known yet
    place: NDArray[np.int64]  # (N+1,) places of nodes
    wanted: Floats  # (N+1,) m, longest cells that the curvature allows
    share: Floats  # (N+1,) the same of nodes, at the end of a step
    stiff: Floats  # (N+1, 3) N m, all of their stiffness
    true: Floats  # (N,) m, lengths
    lengths: Floats  # (N,) m, at the end of the last step
    lack: Floats  # (N,) m, that cells on their way to their true length lacked
    rate: Floats  # (N,) m/s, its rate then
    since: Floats  # (N,) s, when that was
    keeps: NDArray[np.bool_]  # (N,) catenaries keep what they lack: it is what the chord of an arc is shorter by
    strain: Floats  # (2, N+1, 3) rad, of elements: at the beginning and the end of the last step
    moment: Floats  # (N+1, 3) this and the next: work arrays
    energy: Floats  # (4,)


def blank_zones(cells: int, base: int) -> Zones:
    """Zones of a line of so many cells and base cells, all catenary."""
    z, nodes = np.zeros, cells + 1
    shapes: dict[str, Any] = {"clamped": 2, "tangents": (2, 3), "moments": (2, 3), "waves": base + 1}
    shapes |= {"strain": (2, nodes, 3), "moment": (nodes, 3), "stiff": (nodes, 3), "energy": 4}
    shapes |= {"ratios": (len(CRITERIA), base)} | dict.fromkeys(("asked", "largest", "shares", "limits"), QUANTITIES)
    shapes |= dict.fromkeys(("grown", "ramp_factor", "H"), base) | {"wanted": nodes, "share": nodes}
    shapes |= dict.fromkeys(("past", "recent", "true", "lengths", "lack", "rate", "since"), cells)
    real: dict[str, Any] = {name: z(shape) for name, shape in shapes.items()}
    for name, value in {"grown": 1.0, "ramp_factor": 1.0, "H": 1.0, "since": -np.inf}.items():
        real[name][:] = value
    flags: dict[str, Any] = {name: z(base, bool) for name in ("rod", "leaving", "next_rod")}
    flags |= {"here": z(base + 1, bool), "plan": z(base + 1, bool), "keeps": z(cells, bool)}
    clock, kinds, idle = ZoneClock(fineness=1.0), blank_kinds(cells, base), z(base + 1, np.int64)
    whole: dict[str, Any] = {"parts": np.ones(base, np.int64), "idle_steps": idle, "place": z(nodes, np.int64)}
    return Zones(clock, ZoneFlags(), kinds, **real, **flags, **whole)


by_reference(blank_zones(1, 1))


class ZoneJob(NamedTuple):
    """Arguments of the entries: two states in turn as kernels.run.network_run has them, and its clock, counts and work."""

    line: Line
    sea: Sea
    ends: Ends
    old: State
    new: State
    clock: Clock
    counts: Counts
    work: Rows
    zones: Zones
    near: (
        Floats  # (N+1,) how near the line is to itself (kernels.contact.self_contact_pairs.look_ahead); empty: unknown
    )
    review_table: NDArray[np.int64]  # of an kernels.mesh.zone_plan.ReviewJob
    review: int = 0  # address of kernels.mesh.zone_plan.quiet_review; 0: Python reviews


blank_zone_job = blanks(ZoneJob)
read, call_review = reader(blank_zone_job()), caller(0)


@inner
def copy(x, out):
    for i in range(x.shape[0]):
        out[i] = x[i]


# --- before a step --------------------------------------------------------------------------------


@inner
def prepare(line, zones, end, dt):
    """Lengths and stiffness as they will be at `end`, after a step of dt."""
    z, flags = zones.clock, zones.counts
    if flags.relaxing:
        flags.under_way = length_defect(
            zones.lack, zones.rate, zones.since, zones.keeps, end, z.letting_go, zones.true, line.h
        )
    if flags.going or flags.coming:
        shares(zones.grown, zones.leaving, zones.ramp_factor, dt / z.ramp_time, zones.kinds.base_of_cell, zones.share)
        soften(zones.share, zones.stiff, line.kb)


# --- after a try ----------------------------------------------------------------------------------


@inner
def torque_of_ends(line, ends, state, zones):
    """Torque, N m, of the turn of one end against the other, as if all the line were rod; 0 if it is: rods know."""
    z = zones.clock
    if zones.counts.all_rod:
        z.total_twist = twist_of_rods(line, ends.frame, state.e, state.a1)
        return 0.0
    turn = end_turn(state.e, ends.frame)
    z.total_twist += (turn - z.total_twist + math.pi) % (2.0 * math.pi) - math.pi
    return (z.total_twist - z.free_twist + twist_of_line(line, state.T)) / z.compliance


@inner
def lowest(x):
    low = x[0]
    for i in range(1, x.shape[0]):
        low = min(low, x[i])
    return low


@inner
def weigh_moments(state, zones):
    """A moment M given at an end holds the cable off its catenary by M/T, as a clamp does; of its full size.

    What of it turns about the cable is a torque, whether rods feel it already or not.
    """
    kinds, ratios, shares = zones.kinds, zones.ratios, zones.shares
    n, last = state.T.shape[0], ratios.shape[1] - 1
    turned = 0.0
    for i in range(n + 1):
        turned += kinds.turn[i]
    for k in range(2):
        cell, node, j = (n - 1, n, last) if k else (0, 0, 0)
        M = get3(zones.moments, k)
        T = max(state.T[cell], kinds.floor[node], 1e-300)
        bent = over_shares(lack_of_moment(kinds.EI[node], T, math.sqrt(dot(M, M))), shares)
        ratios[CLAMP, j] = max(ratios[CLAMP, j], min(bent, MOST))
        along = abs(dot(M, chord(get3(state.e, cell))[0]))
        loosest = max(lowest(state.T), lowest(kinds.floor), 1e-300)
        twisting = along * along / (4.0 * lowest(kinds.EI) * TWISTED * loosest)
        torsion = min(max(twisting, over_shares(lack_of_torque(loosest, along, turned), shares)), MOST)
        for c in range(last + 1):
            ratios[TORSION, c] = max(ratios[TORSION, c], torsion)


@inner
def weigh_contact(near, zones):
    """What is near another part of the line, on both sides of every node."""
    of, last = zones.kinds.base_of_cell, zones.kinds.base_of_cell.shape[0] - 1
    for i in range(near.shape[0]):
        raise_ratio(zones.ratios, CONTACT, of[max(i - 1, 0)], of[min(i, last)], near[i])


@linked_kernel(in_sea(blank_state(1), blank_zones(1, 1), 0.0))
def weigh_obstacles(line, sea, state, zones, horizon):
    """What is near an obstacle, or will be within a horizon, s, as what is near the line itself."""
    rows, of, last = sea.obstacles, zones.kinds.base_of_cell, zones.kinds.base_of_cell.shape[0] - 1
    moves = line.moved.shape[0] > 0
    for i in range(state.r.shape[0]):
        x, v = get3(state.r, i), get3(state.v, i)
        for k in range(rows.shape[0]):
            gap, n, _ = surface(sea, k, x)
            if moves:
                v = sub(get3(state.v, i), surface_velocity(sea.carried, k, x))
            gap, wide = max(gap + min(horizon * dot(n, v), 0.0), 0.0), 2.0 * rows[k, STRAND]
            raise_ratio(zones.ratios, CONTACT, of[max(i - 1, 0)], of[min(i, last)], 2.0 * wide / (gap + wide))


@inner
def find_shares(line, state, zones):
    """What may be left out of each quantity, and what lengths may make, by the largest of late."""
    kinds, z, n = zones.kinds, zones.clock, line.h.shape[0]
    kappa, moment, tension = 0.0, 0.0, 0.0
    for i in range(n + 1):
        if line.element[i] or (0 < i < n and line.spin[i] == line.spin[i - 1]):  # not the kink of a joint
            there = kinds.curvature[i] if 0 < i < n else kinds.turn[i] / line.hn[i]
            kappa, moment = max(kappa, there), max(moment, kinds.EI[i] * there)
    for c in range(n):
        tension = max(tension, state.T[c])
    for k, size in ((TENSION, tension), (CURVATURE, kappa), (MOMENT, moment)):
        zones.largest[k] = max(zones.largest[k], size)
        share = zones.asked[k] * zones.largest[k]
        zones.shares[k], zones.limits[k] = share if share > 0.0 else math.inf, math.inf
    finer = 1.0 / (z.fineness * z.fineness)  # of second order
    zones.shares[POSITION], zones.limits[POSITION] = z.tolerance, z.tolerance * finer
    if z.share > 0.0 and zones.largest[CURVATURE] * (line.s[n] - line.s[0]) > STRAIGHT:
        zones.limits[CURVATURE] = z.share * zones.largest[CURVATURE] * finer


@kernel
def asks_layers(zones):
    """Whether what joints take of curvature counts as put back: curvature is asked, and no moment, on cells that stay.

    Results put it back from the joint and the nodes beside it (kernels.watch.sides), so rods are two cells wider, at least,
    than what asks for them.  A moment that a joint takes stays away.
    """
    return zones.asked[CURVATURE] > 0.0 and not zones.asked[MOMENT] > 0.0 and not zones.clock.share > 0.0


@linked_kernel(in_sea(no_ends(), blank_state(1), blank_zones(1, 1), np.zeros(1), 0.0))
def evaluate(line, sea, ends, state, zones, near, dt):
    """Raise the ratios since the last review to those of a state, dt after the last one; the highest of catenaries.

    dt = 0: there was none, or it was on other nodes.
    """
    z, flags = zones.clock, zones.counts
    if dt == 0.0 or not flags.known:
        copy(state.T, zones.past)
        copy(state.T, zones.recent)
        z.age, z.recent_age, flags.known = 0.0, 0.0, 1
    z.age, z.recent_age = z.age + dt, z.recent_age + dt
    ahead = min(LOOKAHEAD * z.ramp_time / z.age, LONGEST_LOOKAHEAD) if z.age > 0.0 else 0.0
    z.torque = torque_of_ends(line, ends, state, zones) if flags.holds_twist else 0.0
    for k in range(2):
        for j in range(3):
            zones.tangents[k, j] = ends.frame[k, 2 + 3 * j] * zones.clamped[k]
    find_turns(line, zones.tangents, state.e, state.a1, state.T, z.torque, zones.kinds)
    layers = asks_layers(zones)
    find_curvature(line, state.T, zones.kinds, layers)
    find_shares(line, state, zones)
    raise_ratios(line, sea, state, zones.past, ahead, zones.shares, layers, zones.kinds, zones.ratios)
    foresee_edges(line, sea, state, zones, layers, z.edge_time)
    if flags.loaded:
        weigh_moments(state, zones)
    weigh_contact(near, zones)
    if line.bits & OBSTACLES:
        weigh_obstacles(line, sea, state, zones, LOOKAHEAD * z.ramp_time)
    z.highest_ratio = largest_ratio(line, zones.kinds, zones.ratios)


# --- after a step -----------------------------------------------------------------------------------


@inner
def find_strain(line, ends, state, zones, k):
    """Strains of the elements of a state into zones.strain[k], from what has no stress."""
    strain = zones.strain[k]
    observed = Observed(zones.moment, strain, zones.energy)
    observe(line, ends, state.e, state.v, state.a1, state.w, state.T, state.turn, observed)
    for i in range(strain.shape[0]):
        for j in range(3):
            strain[i, j] = (strain[i, j] - line.k0[i, j]) * line.element[i]


@inner
def book(line, ends, before, state, dt, zones):
    """Energy, J, that lengths and stiffness which change put in through an accepted step of dt."""
    z, flags, booked = zones.clock, zones.counts, 0.0
    if flags.relaxing:
        for c in range(line.h.shape[0]):
            pulls = before.T[c] + state.T[c]
            if has_law(line, c):
                pulls = stretch_work(line, before, c) + stretch_work(line, state, c)
            booked -= 0.5 * pulls * (line.h[c] - zones.lengths[c])
            zones.lengths[c] = line.h[c]
        flags.relaxing = flags.under_way or z.share > 0.0
    if flags.going or flags.coming:
        if flags.strained:
            for i in range(zones.moment.shape[0]):
                for j in range(3):
                    zones.strain[0, i, j] = zones.strain[1, i, j]
        else:
            find_strain(line, ends, before, zones, 0)
        find_strain(line, ends, state, zones, 1)
        shares(zones.grown, zones.leaving, zones.ramp_factor, 0.0, zones.kinds.base_of_cell, zones.share)
        booked += freed(line, zones.share, zones.stiff, zones.strain[0], zones.strain[1])
        advance(zones.grown, zones.leaving, zones.ramp_factor, dt / z.ramp_time)
        flags.strained, flags.coming = 1, is_coming(zones)
    else:
        flags.strained = 0
    if z.recent_age * SAMPLES >= z.ramp_time:  # tensions to extrapolate from
        copy(zones.recent, zones.past)
        copy(state.T, zones.recent)
        z.age, z.recent_age = z.recent_age, 0.0
    return booked


@inner
def watch_waves(line, state, zones, dt):
    """What the velocities after a step of dt ask of lengths."""
    z = zones.clock
    z.fastest = max(z.fastest * math.exp(-dt / (FADE * z.ramp_time)), spread_of_velocity(state.v))
    fast = max(z.fastest, QUIET * z.tolerance / z.ramp_time)
    error = WAVES * z.share * fast / (z.fineness * z.fineness)
    note_waves(line, state, zones, error, dt / (TAU * z.ramp_time), z.fineness)


@inner
def other_cells(line, sea, state, zones, dt):
    """Whether rods should have other cells, after a step of dt."""
    z = zones.clock
    for j in range(zones.rod.shape[0]):
        zones.next_rod[j] = zones.rod[j]
    z.dt = dt
    return plan_cells(line, sea, state, zones, dt, z.fineness)


@inner
def is_coming(zones):
    """Whether any stiffness is ramped up."""
    coming = False
    for j in range(zones.rod.shape[0]):
        coming |= zones.rod[j] and not zones.leaving[j] and zones.grown[j] < 1.0
    return coming


# --- entries ----------------------------------------------------------------------------------------


@kernel
def evaluate_criteria(table):
    """`evaluate` for the state `new` of a job."""
    job = read(table)
    evaluate(job.line, job.sea, job.ends, job.new, job.zones, job.near, job.zones.clock.dt)


@kernel
def read_arcs(table):
    """True lengths that make chords of the state `new` of a job as long as arcs."""
    job = read(table)
    for c in range(job.line.h.shape[0]):
        less = arc_less_chord(job.line, job.new, job.zones, c)
        job.zones.true[c] = job.line.s[c + 1] - job.line.s[c] - less


@inner
def plan_from(job, state):
    """`plan_cells` by a state; where none has been weighed on these cells yet it turns as this one."""
    zones, clock = job.zones, job.zones.clock
    if not zones.counts.known:
        find_turns(job.line, zones.tangents, state.e, state.a1, state.T, clock.torque, zones.kinds)
    plan_cells(job.line, job.sea, state, zones, clock.dt, clock.fineness)


@kernel
def plan_nodes(table):
    """Places of nodes for the state `new` of a job and rods zones.next_rod, into zones.plan."""
    job = read(table)
    plan_from(job, job.new)


@kernel
def plan_next(table):
    """`plan_nodes` between two steps of a run, for the state that it has come to."""
    job = read(table)
    plan_from(job, job.new if job.counts.parity else job.old)


@kernel
def advance_zones(table):
    """What zones do in the present phase of a run, before a try, after it, after a step; 1: Python must look at it."""
    job = read(table)
    line, ends, zones, clock, count = job.line, job.ends, job.zones, job.clock, job.counts
    phase, dt = count.phase, clock.try_end - clock.now
    if phase == b.SOLVE:
        prepare(line, zones, clock.try_end, dt)
        return 0
    if phase == b.JUDGE:
        evaluate(line, job.sea, ends, job.old if count.parity else job.new, zones, job.near, dt)
        return 1 if zones.clock.highest_ratio > REJECT_RATIO else 0
    # a step is accepted, and the states have changed places
    state, before = (job.new, job.old) if count.parity else (job.old, job.new)
    for k in range(QUANTITIES):
        zones.largest[k] *= math.exp(-clock.last_dt / zones.clock.memory)
    job.work[0, b.ZONES] += book(line, ends, before, state, clock.last_dt, zones)
    if zones.clock.share > 0.0:
        relax_arcs(line, state, zones)
        watch_waves(line, state, zones, clock.last_dt)
        zones.counts.cells_due = other_cells(line, job.sea, state, zones, clock.last_dt)
    asks = zones.clock.highest_ratio > 1.0
    if not asks and clock.now >= zones.clock.next_review:  # which may let rods go: the next step hangs on that
        asks = job.review == 0 or call_review(job.review, job.review_table) == 0
    ramping = zones.counts.going or zones.counts.coming
    clock.allowed = zones.clock.ramp_step if ramping else zones.clock.steady_step
    return 1 if asks or zones.counts.cells_due != 0 else 0
