"""Changes of cells in a run: their lengths and their kinds.

A change of cells (kernels.mesh.remesh) makes the line there, and calls what is here: `plan_cells` places the nodes,
`begin_switch` and `end_switch` carry the state and its lengths, `renew` what the run knows beside, `before_forces` and
`after_forces` the report of the state.

Lengths go on smoothly through a change, and its energy is known.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hybrid.kernels.algebra.rotations import add, cross, dot, get3, get9, scale, sub
from hybrid.kernels.laws.axial_law import stretch_energy
from hybrid.kernels.laws.element import chord
from hybrid.kernels.laws.end_motion import ends_at, sea_at
from hybrid.kernels.laws.obstacle_grip import grip_obstacles
from hybrid.kernels.laws.obstacles import carry_obstacles, stored_in_contact
from hybrid.kernels.laws.seabed import lie_in_soil
from hybrid.kernels.laws.tension_torque import stretch_factor, torque_beside
from hybrid.kernels.laws.water import wave_kinematics
from hybrid.kernels.machine.compile import inner, kernel
from hybrid.kernels.machine.references import reader
from hybrid.kernels.march.assembly import JOINED
from hybrid.kernels.march.energies import Observed, observe
from hybrid.kernels.march.zone_torque import twist_energy
from hybrid.kernels.mesh.cell_lengths import arc_less_chord
from hybrid.kernels.mesh.remesh import AFTER, BEFORE, RELAXES, TIME, RemeshPlaces
from hybrid.kernels.mesh.zone_criteria import shares, soften
from hybrid.kernels.mesh.zone_step import ZoneClock, ZoneFlags, Zones
from hybrid.kernels.mesh.zone_transfer import Transfer, carry_push, old_cell, put3, transfer_state
from hybrid.kernels.state.books import Books, Clock
from hybrid.kernels.state.report import AXIAL_LAW, FRICTION, PLANAR, SEABED_ENERGY, SOIL, TOUCHES, WAVES
from hybrid.kernels.state.state import Blocks, Ends, Floats, Line, Rows, Sea, State, Work, blanks
from hybrid.kernels.step.line_step import read
from hybrid.kernels.step.step import friction_axes
from hybrid.kernels.watch.extremes import carry_extremes, fold_gone, match_nodes, put_starts


class CellPlanner(NamedTuple):
    """Where nodes should be, what that makes of the cells of the other side (written), and when.  K finest cells."""

    plan: NDArray[np.bool_]  # (K+1,) of the finest mesh, nodes besides those of base cells
    rod: NDArray[np.bool_]  # (n,)
    parts: NDArray[np.int64]  # (n,) finest cells of base cells
    finest: Floats  # (K+1,) m
    place: NDArray[np.int64]  # (M+1,) numbers of nodes on the finest mesh
    s: Floats  # (M+1,) m
    of: NDArray[np.int64]  # (M,) base cells
    rods: NDArray[np.bool_]  # (M,) whether they are rod
    first: NDArray[np.int64]  # (n+1,) first node of base cells
    here: NDArray[np.bool_]  # (K+1,) of the finest mesh: nodes now
    at: RemeshPlaces
    clock: Clock  # of the run
    zone_clock: ZoneClock
    zone_counts: ZoneFlags
    numbers: Floats  # (NUMBERS,) of kernels.mesh.remesh
    places: NDArray[np.int64]  # nodes of the lines whose outputs wait


blank_cell_planner = blanks(CellPlanner)


class RenewJob(NamedTuple):
    """What a run knows of a line beside its state: before a change, of N cells, and after it, of M."""

    s: Floats  # (N+1,) m, old nodes; at a winch those that come next, by which extremes are kept
    rods: NDArray[np.bool_]  # (N,) whether old cells are rod
    to_s: Floats  # (M+1,) m, new nodes, likewise
    to_rods: NDArray[np.bool_]  # (M,) and cells
    line: Line
    place: NDArray[np.int64]  # (M+1,)
    of: NDArray[np.int64]  # (M,)
    first: NDArray[np.int64]  # (n+1,)
    start: Rows  # (K+1, 3) m, of the nodes of the finest mesh: positions from which displacements count
    start_s: Floats  # (K+1,) m, these nodes
    always: NDArray[np.int64]  # base nodes whose displacement is watched
    marked: NDArray[np.int8]  # (n+1,) marks of base nodes
    borne: Floats  # (n,) length over unstretched length that base cells bear
    state: State  # of the new cells
    twin: State  # a copy of it (written)
    sea: Sea
    work: Work
    zones: Zones
    before: Books
    books: Books
    push: Rows  # (N+1, 4) out of the plane; empty: none
    new_push: Rows  # (M+1, 4)
    next_push: Rows  # (M+1, 4) a copy of it (written)
    envelope_s: Floats  # (E,) m, places of extremes of all meshes
    bounds: Blocks  # (4, EXTREMES, E)
    stays: NDArray[np.int64]  # room for all nodes
    spare: Floats  # room for the extremes of all nodes
    width: Floats  # (M,) m, diameters of the new cells; empty: nobody watches whether the line meets itself
    nearest: NDArray[np.int64]  # (2,) the pair of its cells that was nearest
    widths: Floats  # (n,) m, diameters of base cells
    scale: float  # N, tension scale


blank_renew_job = blanks(RenewJob)
read_planner, read_renew = reader(blank_cell_planner()), reader(blank_renew_job())


@kernel
def cells_due(table):
    """Whether nothing but the cells is to change, and they may without Python, as a number."""
    job = read_planner(table)
    zones = job.zone_clock
    if job.zone_counts.cells_due == 0:
        return 0
    return 0 if zones.highest_ratio > 1.0 or job.clock.now >= zones.next_review else 1


@kernel
def plan_cells(table):
    """Cells where nodes are planned; how many there are."""
    job = read_planner(table)
    job.numbers[TIME], job.numbers[RELAXES] = job.clock.now, job.zone_counts.relaxing
    i, begin = 0, 0
    for j in range(job.parts.shape[0]):
        job.first[j] = i
        for k in range(begin, begin + job.parts[j]):
            if k == begin or job.plan[k]:
                job.place[i], job.s[i], job.of[i], job.rods[i] = k, job.finest[k], j, job.rod[j]
                i += 1
        begin += job.parts[j]
    job.first[job.parts.shape[0]] = i
    job.place[i], job.s[i] = begin, job.finest[begin]
    return i


@kernel
def keep_places(table):
    """Places of the nodes of now are kept for outputs that wait; how many there are."""
    job = read_planner(table)
    i = job.at.placed
    for k in range(job.here.shape[0]):
        if job.here[k]:
            job.places[i] = k
            i += 1
    return i - job.at.placed


# --- beside the state -----------------------------------------------------------------------------


@inner
def set_aside(job):
    """Copy the extremes of the old nodes, which may lie in the memory of those of the new ones."""
    now, k = job.before.extremes, 0
    for bound in range(now.shape[0]):
        for row in range(now.shape[1]):
            for column in range(now.shape[2]):
                job.spare[k] = now[bound, row, column]
                k += 1


@inner
def fill_books(job):
    """What is kept of nodes and cells begins anew."""
    books, m, column = job.books, job.of.shape[0], job.of.shape[0] + 1
    put_starts(job.to_s, job.start_s, job.start, books.start)
    for i in range(m + 1):
        books.marks[i], books.right[i] = 0, i
    for j in range(job.always.shape[0]):
        books.base[j] = job.first[job.always[j]]
    for j in range(job.first.shape[0]):
        i = job.first[j]
        if job.marked[j]:
            books.marks[i], books.right[i] = job.marked[j], column
            column += 1
    for c in range(m):
        books.borne[c] = job.borne[job.of[c]]
    same = job.s.shape[0] == m + 1
    for c in range(m):
        for k in range(2):
            books.tension[k, c] = job.before.tension[k, c] if same else 0.0
    books.strains[:] = 0.0
    books.extremes[0], books.extremes[1], books.extremes[2:] = math.inf, -math.inf, math.nan


@inner
def copy_state(state, out):
    for i in range(state.r.shape[0]):
        for j in range(3):
            out.r[i, j], out.v[i, j], out.a[i, j] = state.r[i, j], state.v[i, j], state.a[i, j]
            out.vd[i, j], out.slip[i, j], out.bed[i, j] = state.vd[i, j], state.slip[i, j], state.bed[i, j]
    for one, other in (
        (state.soil, out.soil),
        (state.wake, out.wake),
        (state.grip, out.grip),
        (state.layers, out.layers),
    ):
        for i in range(other.shape[0]):
            for j in range(other.shape[1]):
                other[i, j] = one[i, j]
    for i in range(out.sheave.shape[0]):
        for j in range(out.sheave.shape[1]):
            out.sheave[i, j] = state.sheave[i, j]
    for one, other in ((state.slow, out.slow), (state.peak, out.peak)):
        for c in range(other.shape[0]):
            other[c] = one[c]
    for c in range(state.T.shape[0]):
        out.T[c], out.w[c], out.wa[c], out.wd[c] = state.T[c], state.w[c], state.wa[c], state.wd[c]
        for j in range(3):
            out.e[c, j], out.a1[c, j] = state.e[c, j], state.a1[c, j]


@inner
def wave_step(line, scale):
    """As hybrid.model.sections has it."""
    least, any_cell = math.inf, False
    for c in range(line.h.shape[0]):
        if not line.spin[c]:
            mass = 0.5 * (line.mass[c] + line.mass[c + 1] - line.point_mass[c] - line.point_mass[c + 1])
            soft = line.ck[c] if line.ck[c] > 0.0 else 1.0 / scale
            least, any_cell = min(least, math.sqrt(soft * mass * line.h[c])), True
    return least if any_cell else 0.0


@inner
def begin_anew(job, state, s, line):
    """What a change of cells or of nodes leaves of the run beside the line: nothing is known of the step before.

    job: a RenewJob, or the NodeJob of kernels.reel.payout_nodes; state, line: new; s: old nodes.
    """
    copy_state(state, job.twin)
    if job.push.shape[0] > 0:
        carry_push(job.push, s, line.s, job.new_push)
        for i in range(job.new_push.shape[0]):  # of a state of either parity, as the state
            for k in range(job.new_push.shape[1]):
                job.next_push[i, k] = job.new_push[i, k]
    job.sea.axis[:] = 0.0
    job.sea.slip[:] = 0.0
    job.sea.slid[:] = 0.0
    job.sea.bed[:] = 0.0
    job.sea.flow[:] = 0.0
    job.work.report[:] = 0.0
    job.work.X[:] = 0.0  # factors are read as zeros where there is no unknown any more
    job.nearest[0], job.nearest[1] = -1, -1
    job.books.clock.wave_step, job.books.counts.parity = wave_step(line, job.scale), 0


@inner
def begin_zones(job):
    """What criteria know begins anew, at the nodes that there are."""
    zones = job.zones
    for k in range(zones.here.shape[0]):
        zones.here[k] = False
    for i in range(job.place.shape[0]):
        zones.place[i] = job.place[i]
        zones.here[job.place[i]] = True
    for k in range(zones.here.shape[0]):
        if not zones.here[k]:
            zones.waves[k] = 0.0
    zones.clock.age, zones.clock.recent_age = 0.0, 0.0
    zones.counts.known, zones.counts.strained, zones.counts.relaxing = 0, 0, 1


@kernel
def clear_state(table):
    """What a change does not carry to the cells of a catenary, and what forces have worked in."""
    state = read_renew(table).state
    state.a1[:] = 0.0
    state.bed[:] = 0.0
    for c in range(state.T.shape[0]):
        state.w[c], state.wa[c], state.wd[c] = 0.0, 0.0, 0.0


@kernel
def renew(table):
    """What a run knows of its new cells, as of the beginning; what it knew of the old ones is kept where it must be."""
    job = read_renew(table)
    books, clock = job.books, job.books.clock
    cells, columns = job.rods.shape[0], job.before.extremes.shape[2]
    if books.extremes.shape[1] > 0:
        match_nodes(job.s, job.rods, job.to_s, job.to_rods, job.stays)
        fold_gone(job.s, job.before.extremes, job.before.right, job.stays, job.envelope_s, job.bounds)
        set_aside(job)
    fill_books(job)
    if books.extremes.shape[1] > 0:
        carry_extremes(job.stays, cells, job.spare, columns, books.right, job.of.shape[0], books.extremes)
    begin_anew(job, job.state, job.s, job.line)
    begin_zones(job)
    for c in range(job.width.shape[0]):
        job.width[c] = job.widths[job.of[c]]
    clock.previous = clock.now


# --- forces ---------------------------------------------------------------------------------------


@kernel
def before_forces(table):
    """What the assembly of a state as it is has to know; table: of a kernels.step.line_step.Job of parity 0."""
    job = read(table)
    clock, ends = job.books.clock, job.ends
    frames, spins = (get9(ends.frame, 0), get9(ends.frame, 1)), (get3(ends.spin, 0), get3(ends.spin, 1))
    ends_at(clock.now, job.moves, job.sea, ends, job.books.velocity)
    for k in range(2):
        if ends.held[k] == JOINED:  # at what moves, and may turn, with the other lines
            for i in range(3):
                ends.position[k, i] = job.old.r[k * job.line.h.shape[0], i]
                ends.spin[k, i] = spins[k][i]
            for i in range(9):
                ends.frame[k, i] = frames[k][i]
    sea_at(clock.now, job.sea)
    job.work.u[:] = 0.0
    if job.line.bits & WAVES:
        wave_kinematics(job.sea, job.old.r, job.work.u)
    if job.line.bits & FRICTION:
        friction_axes(job.sea, job.old.r, job.old.e, job.old.slip, job.old.grip)
    if job.line.bits & SOIL:
        lie_in_soil(job.line, job.sea, job.old.r, job.old.soil)
        for i in range(job.new.soil.shape[0]):  # a run goes on from either
            for k in range(job.new.soil.shape[1]):
                job.new.soil[i, k] = job.old.soil[i, k]


@kernel
def after_forces(table):
    """What the seabed stores and pushes in the state as it is, of which there is a report."""
    job = read(table)
    report = job.work.report
    if job.line.bits & TOUCHES:
        report[SEABED_ENERGY] = stored_in_contact(job.line, job.sea, job.old.r)
        for i in range(job.sea.bed.shape[0]):
            for j in range(3):
                job.old.bed[i, j] = job.sea.bed[i, j]
        if job.line.moved.shape[0] > 0:
            grip_obstacles(job.line, job.sea, job.work.u, job.old, job.old.grip, job.old.grip)
            for i in range(job.new.grip.shape[0]):  # a run goes on from either
                for k in range(job.new.grip.shape[1]):
                    job.new.grip[i, k] = job.old.grip[i, k]
    job.books.clock.stored = report[SEABED_ENERGY]


class SwitchJob(NamedTuple):
    """A transfer with what is around it."""

    transfer: Transfer
    ends: Ends
    sea: Sea
    target_sea: Sea
    zones: Zones
    target_zones: Zones
    numbers: Floats  # (NUMBERS,)
    guided: Floats  # (2,) 1 where an end holds the tangent, and with it a frame


blank_switch_job = blanks(SwitchJob)
read_switch = reader(blank_switch_job())


@inner
def energy_in(line, sea, ends, state, observed):
    """All energy of a state, J: kinetic, elastic, potential, and what contact with the sea has stored."""
    observe(line, ends, state.e, state.v, state.a1, state.w, state.T, state.turn, observed)
    parts = observed.energy
    total = parts[0] + parts[1] + parts[2] + parts[3] + twist_energy(line, state)
    if line.bits & AXIAL_LAW:
        total += stretch_energy(line, state)
    for i in range(state.r.shape[0]):
        total -= dot(get3(line.force, i), get3(state.r, i))
    return total + stored_in_contact(line, sea, state.r) if line.bits & TOUCHES else total


@inner
def energy(line, sea, ends, state, zones):
    """The same; strains of the state go into those of zones."""
    return energy_in(line, sea, ends, state, Observed(zones.moment, zones.strain[1], zones.energy))


@inner
def make_stiffness(line, zones):
    """Stiffness of elements as ramps have it now."""
    shares(zones.grown, zones.leaving, zones.ramp_factor, 0.0, zones.kinds.base_of_cell, zones.share)
    soften(zones.share, zones.stiff, line.kb)


@inner
def untwist(line, ends, guided, state):
    """Frames of the rods of a planar line, without twist against each other and against its clamps.

    In space a rod that begins twisted turns back within a step; in a plane nothing turns it.
    """
    n, m = get3(line.plane, 2), line.h.shape[0]
    first = 0
    while first < m and not line.spin[first]:
        first += 1
    if first == m:
        return
    k = 0 if guided[0] > 0.0 else 1
    f = ends.frame[k]
    if guided[k] > 0.0:
        a, across = (f[0], f[3], f[6]), cross(n, (f[2], f[5], f[8]))
    else:
        a, across = get3(state.a1, first), cross(n, chord(get3(state.e, first))[0])
    x, y = dot(a, n), dot(a, across)
    size = math.sqrt(x * x + y * y)
    for c in range(first, m):
        if line.spin[c]:
            side = cross(n, chord(get3(state.e, c))[0])
            put3(state.a1, c, scale(1.0 / size, add(scale(x, n), scale(y, side))))


@kernel
def begin_switch(table):
    """Energy before; the state on the new cells."""
    job = read_switch(table)
    transfer = job.transfer
    line = transfer.line
    if line.moved.shape[0] > 0:  # an output, or a try, has moved obstacles elsewhere, and none moves in a change
        carry_obstacles(job.numbers[TIME], job.numbers[TIME], job.sea)
    make_stiffness(line, job.zones)  # a step that was refused has left others
    for c in range(line.h.shape[0]):
        line.h[c] = job.zones.lengths[c]
    job.numbers[BEFORE] = energy(line, job.sea, job.ends, transfer.state, job.zones)
    for k in range(2):
        for j in range(3):
            transfer.clamps[k, 1, j] = job.ends.frame[k, 2 + 3 * j]
    transfer_state(transfer, job.guided)
    if transfer.target.bits & PLANAR:
        untwist(transfer.target, job.ends, job.guided, transfer.out)


# --- lengths --------------------------------------------------------------------------------------


@inner
def lengthening(state, c):
    """Rate, m/s, at which the chord of a cell grows longer."""
    return dot(chord(get3(state.e, c))[0], sub(get3(state.v, c + 1), get3(state.v, c)))


@inner
def lack_rate(zones, c, t):
    """Rate, m/s, at which what a cell on its way to its true length lacks grows (kernels.mesh.zone_criteria)."""
    duration = zones.clock.letting_go
    x = min(max((t - zones.since[c]) / duration, 0.0), 1.0)
    value = 0.0 if zones.keeps[c] else -30.0 * x * x * (1.0 - x) ** 2
    return zones.lack[c] * value / duration + zones.rate[c] * (1.0 - x) ** 2 * (1.0 + 2.0 * x - 15.0 * x * x)


@inner
def growth(job, c, t):
    """Rate, m/s, at which old cell c grows longer but for what tension makes of it."""
    transfer, zones = job.transfer, job.zones
    rate = lengthening(transfer.state, c)
    if job.numbers[RELAXES] > 0.0:
        line, state = transfer.line, transfer.state
        rate += stretch_factor(line, state, c, torque_beside(line, state, c)) * lack_rate(zones, c, t)
    return rate


@inner
def relax_cell(job, c, t):
    """A new cell goes on with its length, and with the change of it that the old cells under it had."""
    transfer, zones = job.transfer, job.target_zones
    line, target, of = transfer.line, transfer.target, old_cell(transfer, c)
    a, b = of, of + 1  # the old cell that it is a part of, or those that it is made of
    while a > 0 and line.s[a] > target.s[c]:
        a -= 1
    while b < line.h.shape[0] and line.s[b] < target.s[c + 1]:
        b += 1
    total = 0.0
    for k in range(a, b):
        total += growth(job, k, t)
    part = transfer.match.lengths[c] / (line.s[b] - line.s[a])
    stretch = stretch_factor(target, transfer.out, c, torque_beside(line, transfer.state, of))
    zones.lack[c] = zones.true[c] - transfer.match.lengths[c]
    zones.rate[c] = (total * part - lengthening(transfer.out, c)) / stretch
    zones.since[c] = t


@inner
def relax(job, t):
    """Lengths on their way to true ones from t on; what was on its way goes on."""
    zones, before, match = job.target_zones, job.zones, job.transfer.match
    for c in range(match.kept.shape[0]):
        a = match.kept[c]
        zones.keeps[c] = not job.transfer.target.spin[c] and not zones.clock.share > 0.0
        if a < 0:
            relax_cell(job, c, t)
        elif job.numbers[RELAXES] > 0.0:
            zones.lack[c], zones.rate[c], zones.since[c] = before.lack[a], before.rate[a], before.since[a]
        else:
            zones.lack[c], zones.rate[c], zones.since[c] = zones.true[c] - match.lengths[c], 0.0, -np.inf


@kernel
def end_switch(table):
    """Stiffness and lengths of the new cells; energy after."""
    job = read_switch(table)
    transfer, zones = job.transfer, job.target_zones
    target = transfer.target
    for i in range(target.s.shape[0]):
        for k in range(3):
            zones.stiff[i, k] = target.kb[i, k]
    for c in range(target.h.shape[0]):
        a = transfer.match.kept[c]
        zones.true[c], zones.lengths[c] = target.h[c], transfer.match.lengths[c]
        if zones.clock.share > 0.0:
            less = arc_less_chord(target, transfer.out, zones, c)
            zones.true[c] = job.zones.true[a] if a >= 0 else target.h[c] - less
    make_stiffness(target, zones)
    relax(job, job.numbers[TIME])
    for c in range(target.h.shape[0]):
        target.h[c] = transfer.match.lengths[c]
    job.numbers[AFTER] = energy(target, job.target_sea, job.ends, transfer.out, zones)
