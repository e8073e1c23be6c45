"""A node that enters a line at its fairlead, or leaves it: the state, what new cells lack, and the change of cells.

The material has a velocity and accelerations of its own at the fairlead: those of the last node less what comes from
the flow of material through it (docs/theory.md, 19).  A new node lies on the cubic through the last four.
A change of cells (kernels.mesh.remesh) calls what is said here of a line that is paid out.
Places, nodes and cells count from the far end towards the fairlead; a chord and a spin of a line whose fairlead is its
start change their sign so.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hybrid.kernels.algebra.rotations import add, cross, dot, get3, scale, sub
from hybrid.kernels.laws.axial_law import has_law, strain_and_energy_at
from hybrid.kernels.laws.seabed import remember_between
from hybrid.kernels.laws.tension_torque import couples, stretch_factor, torque_beside
from hybrid.kernels.laws.water import PHASE
from hybrid.kernels.machine.binding import places
from hybrid.kernels.machine.compile import inner, kernel
from hybrid.kernels.machine.references import reader, rows
from hybrid.kernels.march.energies import Observed
from hybrid.kernels.mesh.cell_changes import begin_anew, energy_in, make_stiffness
from hybrid.kernels.mesh.remesh import AFTER, BEFORE, COMPLIANCE, RemeshPlaces, came_from
from hybrid.kernels.mesh.zone_step import Zones
from hybrid.kernels.mesh.zone_transfer import put3
from hybrid.kernels.reel.paid_length import (
    carry_layers,
    cell,
    changes_length,
    go_round,
    growing,
    lack_rate,
    length_at,
    lie_wide,
    line_as,
    made_between,
    node,
    piece_at,
    place_of,
    prepare,
)
from hybrid.kernels.reel.payout import chord_at, left_behind, way_at
from hybrid.kernels.reel.payout_work import put_travels, strain_at
from hybrid.kernels.reel.reel import ENTERS, FEWEST_STEPS, LEAVES, Reel, Winch, at_its_end
from hybrid.kernels.state.books import Books, Clock
from hybrid.kernels.state.report import PLANAR, STIFFNESS_DAMPING
from hybrid.kernels.state.state import NO_SOIL, Blocks, Ends, Floats, Line, Rows, Sea, State, Work, blank_state, blanks
from hybrid.kernels.step.step_control import lead
from hybrid.kernels.watch.extremes import fold_gone, put_starts


class CarryJob(NamedTuple):
    """A state on N cells, and room for it on one more or one less.

    The new reel has its places already (`place_reel`), the new line its compliances.
    """

    line: Line
    target: Line
    state: State
    out: State  # written
    reel: Reel
    new: Reel  # what its cells lack is written
    clock: Clock  # of the run
    tension: Rows  # (2, N) N, before the last step
    nodes: Floats  # (M,) m, places of all material nodes that there may be


blank_carry_job = blanks(CarryJob)
read = reader(blank_carry_job())


class Flow(NamedTuple):
    """How material flows through the fairlead: c, its rate; both when the algorithmic acceleration stands for."""

    rate: float  # m/s
    acceleration: float  # m/s2
    later_rate: float
    later_acceleration: float


# --- places ---------------------------------------------------------------------------------------


@kernel
def place_reel(reel, nodes, count):
    """What a reel knows of a line of so many material nodes; none of its cells lacks anything."""
    numbers, before, place, next_ = reel.numbers, nodes[count - 2], nodes[count - 1], nodes[count]
    numbers.place = place
    numbers.longest = next_ - place + ENTERS * (nodes[count + 1] - next_)
    numbers.shortest = LEAVES * (next_ - place)
    made_between(reel.pieces, before, place, reel.rest, 0)
    reel.rest_length[0] = place - before
    for c in range(reel.true.shape[0]):
        reel.lack[c], reel.rate[c], reel.since[c], reel.span[c] = 0.0, 0.0, -np.inf, 1.0
    for c in range(count - 1):
        reel.true[c] = nodes[c + 1] - nodes[c]
    rides = reel.layer.shape[0] - 1
    for k in range(rides):
        reel.true[count + k] = reel.layer[k] - reel.layer[k + 1]


# --- the state ------------------------------------------------------------------------------------

# Of the fields of nodes and of cells in a state: where they are in its table, and their columns.
_at = places(blank_state(1))
_COLUMNS = {3: ("r", "v", "a", "vd", "slip", "bed", "e", "a1"), 1: ("T", "w", "wa", "wd", "slow", "peak"), 4: ("wake",)}
_COLUMNS[NO_SOIL.shape[1]] = ("soil",)
MOVED = np.array([(_at[name], columns) for columns, names in _COLUMNS.items() for name in names], np.int64)
of_state = rows(blank_state(1))


@kernel
def move_row(old, new, forward, cut, step):
    """Values of cells or nodes counted from the far end: up to `cut` they stay, the others move by `step`."""
    n, m = old.shape[0], new.shape[0]
    for k in range(m):
        j = k if k < cut else max(k - step, 0)
        if forward:
            new[k] = old[j]
        else:
            new[m - 1 - k] = old[n - 1 - j]


@kernel
def move_rows(old, new, forward, cut, step):
    """The same of rows."""
    n, m = old.shape[0], new.shape[0]
    for k in range(m):
        j = k if k < cut else max(k - step, 0)
        to, of = (k, j) if forward else (m - 1 - k, n - 1 - j)
        for i in range(old.shape[1]):
            new[to, i] = old[of, i]


@inner
def move_state(state, out, forward, cut, step):
    """Nodes and cells that stay; those that are new have the values of their neighbours."""
    for k in range(MOVED.shape[0]):
        at, columns = MOVED[k, 0], MOVED[k, 1]
        move_rows(of_state(state, at, columns), of_state(out, at, columns), forward, cut, step)
    move_rows(state.grip, out.grip, forward, cut, step)
    move_rows(state.layers, out.layers, forward, cut, step)
    for k in range(state.sheave.shape[0]):
        for j in range(state.sheave.shape[1]):
            out.sheave[k, j] = state.sheave[k, j]
    for k in range(state.turn.shape[0]):
        for j in range(3):
            out.turn[k, j] = state.turn[k, j]


@inner
def put_chord(line, state, reel, c, e):
    put3(state.e, cell(line, reel, c), scale(reel.numbers.side, e))


@inner
def flow_at(reel, clock):
    """How material flows through the fairlead after an accepted step."""
    t, winch = clock.now, reel.winch
    ahead = lead(clock.last_rho) * clock.last_dt
    if winch.tension > 0.0:
        rate, acceleration = winch.rate_now, winch.true_now
        return Flow(rate, acceleration, rate + ahead * acceleration, winch.algorithmic_now)
    _, rate, acceleration = length_at(reel.law, t)
    _, later, then = length_at(reel.law, t + ahead)
    return Flow(rate, acceleration, later, then)


@inner
def material_at(line, state, reel, flow, g):
    """Velocity, algorithmic and true acceleration of the material at the first node behind the cell that grows."""
    way, k = way_at(line, state, reel, g + 1, flow.rate, g), node(line, reel, g + 1)
    then = left_behind(way, flow.later_rate, flow.later_acceleration)
    now = left_behind(way, flow.rate, flow.acceleration)
    return way.v, sub(get3(state.a, k), then), sub(get3(state.vd, k), now)


@inner
def is_damped(line, c):
    """Whether part of the tension of cell c (of the line) is of damping."""
    return line.bits & STIFFNESS_DAMPING != 0 and line.ck[c] > 0.0 and line.tau[c] > 0.0


@inner
def late_strain(line, state, c):
    """By how much damping makes the strain of cell c (of the line) less than its tension would."""
    return line.ck[c] * state.T[c] - strain_at(line, state, c) if is_damped(line, c) else 0.0


@inner
def strain_of(line, state, c):
    """Strain of cell c (of the line) under its tension without damping, and a torque where tension makes one."""
    if couples(line):
        return stretch_factor(line, state, c, torque_beside(line, state, c)) - 1.0
    strain, _ = strain_and_energy_at(line, state, c, state.T[c])
    return strain


@inner
def tension_rate(line, state, clock, tension, c):
    """Rate, N/s, of the tension of cell c (of the line) over the last step, or of its material now if it is damped."""
    if is_damped(line, c):
        return late_strain(line, state, c) / (line.tau[c] * line.ck[c])
    dt = clock.last_dt
    return (state.T[c] - tension[0, c]) / dt if dt > 0.0 else 0.0


@inner
def flow_stretch(line, state, reel, rate, c):
    """By how much, m/s, the cell that grows, c, becomes longer because what comes into it stretches otherwise than it.

    0 where the reel holds no sections of another compliance.
    """
    k, end, at = cell(line, reel, c), reel.numbers.length - reel.layer[0], 0
    while at + 1 < reel.pieces.shape[0] and reel.pieces[at + 1, 0] < end:
        at += 1
    return rate * state.T[k] * (reel.pieces[at, 1 + COMPLIANCE] - line.ck[k]) if not has_law(line, k) else 0.0


@inner
def mismatch(job, flow, g, c):
    """By how much, m/s, the rate of the chord of cell c misses that of its length."""
    line, state, reel, clock = job.line, job.state, job.reel, job.clock
    k, e = cell(line, reel, c), chord_at(line, state, reel, c)
    if is_damped(line, k):  # its tension is that of its rate
        return 0.0
    ends = sub(get3(state.v, node(line, reel, c + 1)), get3(state.v, node(line, reel, c)))
    along = dot(e, ends) / math.sqrt(dot(e, e))
    grows = (flow.rate if c == g else 0.0) - lack_rate(reel, clock.now, c)
    rises = tension_rate(line, state, clock, job.tension, k)
    found = along - grows * (1.0 + strain_of(line, state, k)) - line.h[k] * line.ck[k] * rises
    return found - flow_stretch(line, state, reel, flow.rate, c) if c == g else found


@inner
def carried(a, e, to):
    """A first director carried from one chord to another by the smallest rotation."""
    d, f = scale(1.0 / math.sqrt(dot(e, e)), e), scale(1.0 / math.sqrt(dot(to, to)), to)
    out = sub(a, scale(dot(a, f) / (1.0 + dot(d, f)), add(d, f)))
    size = math.sqrt(dot(out, out))
    return scale(1.0 / size, out) if size > 0.0 else out


@inner
def twist_rate(line, state, reel, i):
    """Rate, rad/m along s, at which the frames of the two cells at a node turn about the line; 0: nothing bears torque there."""
    k = node(line, reel, i)
    if not 0 < k < line.h.shape[0] or not line.element[k] or not line.kb[k, 2] > 0.0 or line.bits & PLANAR:
        return 0.0
    e = get3(state.e, k)
    a, b = carried(get3(state.a1, k - 1), get3(state.e, k - 1), e), get3(state.a1, k)
    angle = math.atan2(dot(cross(a, b), e) / math.sqrt(dot(e, e)), dot(a, b))
    return 2.0 * angle / (line.h[k - 1] + line.h[k])


@inner
def put_director(job, c, a, e, turn):
    """The first director of a new cell: `a`, of a cell with the chord e, carried there and turned by `turn`, rad.

    Cells of a twisted line differ by what the twist is between their middles.  Without this the torque at a new node is
    zero, and that beside it half as much again, until twist waves have levelled it.
    """
    to = chord_at(job.target, job.out, job.new, c)
    a, side = carried(a, e, to), job.new.numbers.side / math.sqrt(dot(to, to))
    if turn != 0.0:
        a = add(scale(math.cos(turn), a), scale(math.sin(turn) * side, cross(to, a)))
    put3(job.out.a1, cell(job.target, job.new, c), a)


@inner
def let_lack(job, flow, c, true, grows, rises, kept, late, span):
    """Cell c of the new line lacks what its law of length misses, and gets it in `span`, s.

    true: m, its length; grows: m/s, its rate; rises: N/s; kept: m/s, mismatch that it keeps; late: as of
    `late_strain`.
    """
    target, out, new = job.target, job.out, job.new
    k, e = cell(target, new, c), chord_at(target, out, new, c)
    ends = sub(get3(out.v, node(target, new, c + 1)), get3(out.v, node(target, new, c)))
    l, strain = math.sqrt(dot(e, e)), strain_of(target, out, k) - late
    if grows != 0.0 and not is_damped(target, k):
        kept += flow_stretch(target, out, new, grows, c)
    new.lack[c] = true - l / (1.0 + strain)
    new.rate[c] = grows - (dot(e, ends) / l - kept - true * target.ck[k] * rises) / (1.0 + strain)
    new.since[c], new.span[c] = job.clock.now, span


@inner
def crossing_time(job, g):
    """Time, s, in which a wave of the tension before the fairlead, or of the weight if that is more, crosses the line."""
    line, n, pull, mass = job.line, job.line.h.shape[0], job.state.T[cell(job.line, job.reel, g)], 0.0
    weight = 0.0
    for i in range(n + 1):
        weight += abs(line.force[i, 2])
        mass += line.mass[i]
    pull = max(pull, weight)
    return math.sqrt(mass * job.reel.numbers.length / pull) if pull > 0.0 else math.inf


@inner
def span_of(job, flow, g):
    """Time, s, over which a new cell gets its length: what half of it takes to come, and no more than waves take.

    It does not go by the steps unless they are long: the shorter, the more a new node would kick.
    """
    dt, h = job.clock.last_dt, job.nodes[g + 1] - job.nodes[g]
    slowly = min(crossing_time(job, g), 0.5 * h / max(abs(flow.rate), 1e-12))
    return max(slowly, FEWEST_STEPS * dt, 1e-9)


@inner
def shed_between(wake, at, before, behind, part):
    """Vortices at a new node are between those of its neighbours; more than half a turn apart: those of the one before."""
    if abs(wake[before, PHASE] - wake[behind, PHASE]) < math.pi:
        for j in range(wake.shape[1]):
            wake[at, j] = (1.0 - part) * wake[before, j] + part * wake[behind, j]


@inner
def enter(job, flow, g):
    """One more node, in the cell that grows."""
    line, target, state, out, reel, new = job.line, job.target, job.state, job.out, job.reel, job.new
    place, i, first = job.nodes[g + 1], g + 1, max(g - 2, 0)
    v, a, vd = material_at(line, state, reel, flow, g)
    e_old = chord_at(line, state, reel, g)
    chord, rate, algorithmic, true = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    back = (0.0, 0.0, 0.0)  # from node g to the one before the present one
    for k in range(i, first - 1, -1):
        w = 1.0  # Lagrange's weight
        for j in range(first, i + 1):
            if j != k:
                w *= (place - place_of(line, reel, j)) / (place_of(line, reel, k) - place_of(line, reel, j))
        if k == i:
            chord, rate, algorithmic, true = scale(w, e_old), scale(w, v), scale(w, a), scale(w, vd)
            continue
        if k < g:
            back = sub(back, chord_at(line, state, reel, k))
        at = node(line, reel, k)
        chord = add(chord, scale(w, back))
        rate, algorithmic = add(rate, scale(w, get3(state.v, at))), add(algorithmic, scale(w, get3(state.a, at)))
        true = add(true, scale(w, get3(state.vd, at)))
    put_chord(target, out, new, g, chord)
    put_chord(target, out, new, i, sub(e_old, chord))
    at, before, behind = node(target, new, i), node(line, reel, g), node(line, reel, i)
    put3(out.r, at, add(get3(state.r, before), chord))
    put3(out.v, at, rate)
    put3(out.a, at, algorithmic)
    put3(out.vd, at, true)
    h = place_of(line, reel, i) - place_of(line, reel, g)
    part = (place - place_of(line, reel, g)) / h
    put_travels(state, out, at, before, behind, part)
    if state.soil.shape[0] > 0:
        remember_between(state.soil, out.soil, at, before, behind, part)
    if state.wake.shape[0] > 0:
        shed_between(out.wake, at, node(target, new, g), node(target, new, i + 1), part)
    cut, last = cell(line, reel, g), cell(line, reel, g - 1)
    slope = (state.T[cut] - state.T[last]) / (0.5 * (line.h[last] + h))
    kept, rises = mismatch(job, flow, g, g), tension_rate(line, state, job.clock, job.tension, cut)
    late, flows = late_strain(line, state, cut), 0.5 * flow.rate * slope if is_damped(line, cut) else 0.0
    twist, side = twist_rate(line, state, reel, g), reel.numbers.side
    ahead = twist_rate(line, state, reel, i)
    if ahead == 0.0:
        ahead = twist
    elif twist == 0.0:
        twist = ahead
    for c in range(g):
        new.lack[c], new.rate[c], new.since[c], new.span[c] = reel.lack[c], reel.rate[c], reel.since[c], reel.span[c]
    for c in range(g, g + 2):
        length = place - place_of(line, reel, g) if c == g else place_of(line, reel, i) - place
        middle = 0.5 * (length - h) if c == g else 0.5 * (h - length)
        k = cell(target, new, c)
        out.T[k] = state.T[cut] + slope * middle
        # the twist is linear between the nodes: that between the two middles
        rate = 0.5 * (twist + ahead) + 0.5 * (ahead - twist) * middle / h
        put_director(job, c, get3(state.a1, cut), e_old, side * rate * middle)
        if state.slow.shape[0] > 0:
            out.slow[k] = state.slow[cut] + slope * middle
        if state.peak.shape[0] > 0 and c == i:  # what comes off the reel has had no more than the tension there
            out.peak[k] = out.slow[k]
    for c in range(g, g + 2):
        length = place - place_of(line, reel, g) if c == g else place_of(line, reel, i) - place
        grows = flow.rate if c == i else 0.0
        more = flows if c == i else 0.0  # the cell that grows has other material, which bears more
        let_lack(job, flow, c, length, grows, rises + more, kept * length / h, late, span_of(job, flow, g))


@inner
def leave(job, flow, g):
    """One node less: the cell that grows and the one before it become one."""
    line, target, state, out, reel, new = job.line, job.target, job.state, job.out, job.reel, job.new
    c = g - 1
    last, cut, k = cell(line, reel, c), cell(line, reel, g), cell(target, new, c)
    ha, hb = line.h[last], line.h[cut]
    a, z = ha / (ha + hb), hb / (ha + hb)
    e = chord_at(line, state, reel, c)
    both = add(e, chord_at(line, state, reel, g))
    put_chord(target, out, new, c, both)
    out.T[k] = a * state.T[last] + z * state.T[cut]
    out.w[k], out.wa[k] = a * state.w[last] + z * state.w[cut], a * state.wa[last] + z * state.wa[cut]
    out.wd[k] = a * state.wd[last] + z * state.wd[cut]
    if state.slow.shape[0] > 0:
        out.slow[k] = a * state.slow[last] + z * state.slow[cut]
    put_director(job, c, get3(state.a1, last), e, 0.5 * reel.numbers.side * twist_rate(line, state, reel, g) * hb)
    kept = mismatch(job, flow, g, c) + mismatch(job, flow, g, g)
    rises = a * tension_rate(line, state, job.clock, job.tension, last)
    rises += z * tension_rate(line, state, job.clock, job.tension, cut)
    late = a * late_strain(line, state, last) + z * late_strain(line, state, cut)
    if is_damped(line, cut):
        rises += flow.rate * (state.T[cut] - state.T[last]) / (ha + hb)
    for j in range(c):
        new.lack[j], new.rate[j], new.since[j], new.span[j] = reel.lack[j], reel.rate[j], reel.since[j], reel.span[j]
    true = place_of(line, reel, g + 1) - place_of(line, reel, c)
    let_lack(job, flow, c, true, flow.rate, rises, kept, late, span_of(job, flow, g))


@kernel
def carry_node(table):
    """The state on the new nodes, and what new cells lack."""
    job = read(table)
    line, reel, new = job.line, job.reel, job.new
    n, m = line.h.shape[0], job.target.h.shape[0]
    g, flow, step = n - reel.layer.shape[0], flow_at(reel, job.clock), m - n
    move_state(job.state, job.out, reel.numbers.side > 0.0, g + 1 if step > 0 else g, step)
    if step > 0:
        enter(job, flow, g)
    else:
        leave(job, flow, g)
    if job.out.layers.shape[0] > 0:
        carry_layers(line, job.target, job.state, job.out, reel, new)
    plain = (
        line.torsion.shape[0] == 0 and line.tension_twist.shape[0] == 0
    )  # no force that payout_balance does not know
    new.stage.unbalanced = 1.0 if plain else 0.0
    new.numbers.changed, new.numbers.easing = job.clock.now if plain else -np.inf, span_of(job, flow, g)


# --- one node more or less: what a change of cells calls ---------------------------------------


class NodeJob(NamedTuple):
    """One node more or less: what a run has before and after it, in two sets of arrays."""

    carry: CarryJob
    ends: Ends
    sea: Sea  # of the new cells, as all that follows
    work: Work
    twin: State
    before: Books
    books: Books
    push: Rows  # (N+1, 4) out of the plane; empty: none
    new_push: Rows
    next_push: Rows
    width: Floats  # (M,) m, diameters of the new cells; empty: nobody watches whether the line meets itself
    nearest: NDArray[np.int64]  # (2,) the pair of its cells that was nearest
    borne: Floats  # (P,) length over unstretched length that pieces bear, as of Reel.pieces
    widths: Floats  # (P,) m, their diameters
    start: Rows  # (M, 3) m, of all nodes that there may be: positions from which displacements count
    start_s: Floats  # (M,) m, these nodes, and one work array likewise
    kept: Floats
    envelope_s: Floats  # (E,) m, places of extremes of all meshes
    bounds: Blocks  # (4, EXTREMES, E)
    gone: NDArray[np.int64]  # (M,) -1: no node stays
    moment: Rows  # (M+1, 3) this and the next: work arrays
    strain: Rows
    energy: Floats  # (5,)
    numbers: Floats  # (NUMBERS,) of kernels.mesh.remesh
    scale: float  # N, tension scale


blank_node_job = blanks(NodeJob)
read_node = reader(blank_node_job())


# --- one change -----------------------------------------------------------------------------------


@inner
def kept_nodes(line, reel, nodes, out):
    """(N+1,) m, arc lengths by which extremes are kept: of what moves with the fairlead those of the nodes to come."""
    n, g = line.h.shape[0], growing(line, reel)
    for k in range(n + 1):
        i = node(line, reel, k)
        out[i] = line.s[i] if k <= g else reel.numbers.far + reel.numbers.side * nodes[k]


@inner
def renew_books(job, n, m, forward, cut):
    """What a run knows beside its state, of the new nodes and cells."""
    before, books, s, carry, column = job.before, job.books, job.carry.target.s, job.carry, m + 1
    if before.extremes.shape[1] > 0:
        kept_nodes(carry.line, carry.reel, carry.nodes, job.kept)
        fold_gone(job.kept[: n + 1], before.extremes, before.right, job.gone, job.envelope_s, job.bounds)
    kept_nodes(carry.target, carry.new, carry.nodes, job.kept)
    put_starts(job.kept[: m + 1], job.start_s, job.start, books.start)
    move_row(before.marks, books.marks, forward, cut, m - n)
    for i in range(m + 1):
        books.right[i] = i
        if books.marks[i]:
            books.right[i] = column
            column += 1
    for c in range(m):
        piece = piece_at(job.carry.new, 0.5 * (s[c] + s[c + 1]))
        books.borne[c] = job.borne[piece]
        if job.width.shape[0] > 0:
            job.width[c] = job.widths[piece]
    if not forward:
        for k in range(books.base.shape[0]):
            books.base[k] += m - n
    books.tension[:] = 0.0
    books.strains[:] = 0.0
    for row in range(books.extremes.shape[1]):
        for k in range(books.extremes.shape[2]):
            books.extremes[0, row, k], books.extremes[1, row, k] = np.inf, -np.inf
            books.extremes[2, row, k], books.extremes[3, row, k] = np.nan, np.nan


@kernel
def energy_of(line, sea, ends, state, moment, strain, parts):
    """All energy of a state, J; the last three are work arrays (N+1, 3), (N+1, 3), (5,)."""
    return energy_in(line, sea, ends, state, Observed(moment, strain, parts))


# Parts of a change, in this order; between the first two comes kernels.reel.payout_nodes.carry_node, whose table begins this one.


@kernel
def change_line(table):
    """One node more, or less, at the fairlead: the line and its reel."""
    job = read_node(table).carry
    reel, new, target = job.reel, job.new, job.target
    for k in range(reel.numbers.plain.shape[0]):
        new.numbers.plain[k] = reel.numbers.plain[k]
    new.stage.riding_on, new.stage.balance_on, new.stage.flow_known, new.numbers.due = 0.0, 0.0, 0.0, 0.0
    place_reel(new, job.nodes, target.h.shape[0] - reel.layer.shape[0] + 1)
    line_as(job.line, target, new, job.nodes)
    prepare(target, new, job.clock.now)  # what new cells lack goes by what they are made of
    first = growing(job.line, reel)
    if target.wake_law.shape[0] > 0:
        go_round(target, new, first)
    if target.bed_width.shape[0] > 0:
        lie_wide(target, new, read_node(table).widths, first)


@kernel
def fit_changed(table):
    """The new line has the length of now."""
    job = read_node(table).carry
    prepare(job.target, job.new, job.clock.now)


@kernel
def book_change(table):
    """Energy, J, before and after."""
    job = read_node(table)
    for k in range(2):  # one call for both: it is compiled once
        line, state = (job.carry.target, job.carry.out) if k else (job.carry.line, job.carry.state)
        found = energy_of(line, job.sea, job.ends, state, job.moment, job.strain, job.energy)
        job.numbers[AFTER if k else BEFORE] = found


@kernel
def renew_run(table):
    """What a run knows beside the line and its state, as of the beginning; what it knew is kept where it must be."""
    job = read_node(table)
    line, target, clock, forward = job.carry.line, job.carry.target, job.carry.clock, job.carry.new.numbers.side > 0.0
    n, m = line.h.shape[0], target.h.shape[0]
    begin_anew(job, job.carry.out, line.s, target)
    renew_books(job, n, m, forward, min(n, m) - job.carry.new.layer.shape[0] + 1)
    clock.previous = clock.now


class ZonesJob(NamedTuple):
    """Zones that move, before a node enters or leaves and after it: of base cells they know already."""

    line: Line
    target: Line
    reel: Reel  # of the new line
    zones: Zones
    out: Zones  # written


blank_zones_job = blanks(ZonesJob)
read_zones = reader(blank_zones_job())


@kernel
def carry_zones(table):
    """What zones know of cells, on the new ones, whose elements are as stiff as ramps have them."""
    job = read_zones(table)
    zones, out, reel, n, m = job.zones, job.out, job.reel, job.line.h.shape[0], job.target.h.shape[0]
    forward, step, cut = reel.numbers.side > 0.0, m - n, min(n, m) - reel.layer.shape[0]
    for k in range(m):
        c, a = came_from(k, n, m, forward, cut, step)
        out.past[c], out.recent[c], out.lengths[c] = zones.past[a], zones.recent[a], zones.lengths[a]
        out.true[c], out.lack[c], out.rate[c] = zones.true[a], zones.lack[a], zones.rate[a]
        out.since[c], out.keeps[c] = zones.since[a], zones.keeps[a]
        if changes_length(job.target, reel, c):
            out.true[c], out.lengths[c] = reel.true[cell(job.target, reel, c)], job.target.h[c]
    for k in range(m + 1):  # from the cell that is now complete on they have all of their stiffness
        i, a = came_from(k, n + 1, m + 1, forward, cut + 1, step)
        for j in range(3):
            out.stiff[i, j] = job.target.kb[i, j] if k >= cut else zones.stiff[a, j]
    make_stiffness(job.target, out)


class LineJob(NamedTuple):
    """A line, and the same of another length (written), whose places are put into its reel."""

    line: Line
    out: Line
    reel: Reel  # of `out`
    nodes: Floats  # (M,) m
    since: Floats  # s, from when on cells of `line` get what they lack, as of its reel


blank_line_job = blanks(LineJob)
read_line = reader(blank_line_job())


@kernel
def make_line(table):
    """`line_as`, and its reel; cells that lack something in `line` alone have their true lengths."""
    job = read_line(table)
    out, reel = job.out, job.reel
    place_reel(reel, job.nodes, out.h.shape[0] - reel.layer.shape[0] + 1)
    line_as(job.line, out, reel, job.nodes)
    for k in range(min(job.since.shape[0], out.h.shape[0])):
        if job.since[k] > -np.inf:
            out.h[cell(out, reel, k)] = reel.true[k]


# --- the planner ----------------------------------------------------------------------------------

OF_REEL = 4  # numbers of a cell that are kept for outputs that wait: lack, rate, since, span


class NodePlanner(NamedTuple):
    """What says when a node enters or leaves, of one of the two sets of arrays."""

    at: RemeshPlaces
    reel: Reel  # with all its room
    winch: Winch
    room: Floats  # for what cells of lines of before lacked


blank_node_planner = blanks(NodePlanner)
read_planner = reader(blank_node_planner())


@kernel
def node_due(table):
    """Whether a node is to enter or leave, and may without Python, as a number."""
    job = read_planner(table)
    return 0 if job.reel.numbers.due == 0.0 or at_its_end(job.winch) else 1


@kernel
def plan_node(table):
    """How many cells there will be."""
    job = read_planner(table)
    reel, n = job.reel, job.at.cells
    return n + 1 if reel.true[n - reel.layer.shape[0]] > reel.numbers.longest else n - 1


@kernel
def keep_reel(table):
    """What cells of the line lack is kept for outputs that wait; how many numbers that are."""
    job = read_planner(table)
    reel, n, o = job.reel, job.at.cells, job.at.placed
    for c in range(n):
        job.room[o + c], job.room[o + n + c] = reel.lack[c], reel.rate[c]
        job.room[o + 2 * n + c], job.room[o + 3 * n + c] = reel.since[c], reel.span[c]
    return OF_REEL * n
