"""A line that is paid out or taken in at one of its ends: what changes with its length in every step (docs/theory.md, 19).

Nodes, cells and chords count from the far end, whichever end of the line that is (kernels.reel.paid_length).
The last node is the fairlead, through which material passes.  Nodes of a layer before it ride with it; all others are
material.  Only the cell before the layer, which is the last one where there is none, changes its length, and with it
the mass, the loads and the stiffness that it brings to its two nodes.

    symbol  meaning                                                    unit
    L       unstretched length that is out                             m
    c       its rate, positive where line is paid out                  m/s
    p       place of the last material node                            m
    K       acceleration of the fairlead less that of the material     m/s2

A run calls `pay_out` by its address (kernels.run.network_run), so that lines of a fixed length compile none of it.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from hybrid.kernels.algebra.rotations import add, dot, get3, scale, sub
from hybrid.kernels.laws.element import Chord, Rates, chord
from hybrid.kernels.laws.node_forces import Z3, inertia_and_water
from hybrid.kernels.machine.compile import called, inner, kernel
from hybrid.kernels.march.assembly import JOINED
from hybrid.kernels.reel.paid_length import (
    cell,
    eased,
    find_balance,
    find_length,
    flows,
    growing,
    layers_that_came,
    length_at,
    let_layers_flow,
    node,
    prepare,
    put_balance_on,
    remember_bend,
    remove_balance,
    remove_riding,
    stop_flow,
)
from hybrid.kernels.reel.payout_work import (
    book,
    book_contact,
    correct_damping_power,
    correct_end,
    end_of,
    leave_to_reel,
    let_material_rub,
    power_of_flow,
    put_flow_on,
    remember,
    rubs,
    work_of_balance,
)
from hybrid.kernels.reel.reel import (
    FEWEST_STEPS,
    MOVES,
    WAITS,
    accept,
    answer_of_cell,
    at_its_end,
    by_length,
    last_change,
    lengthen_cell,
    losses,
    predict,
    read,
    softness,
    tension_held,
)
from hybrid.kernels.state import books as b
from hybrid.kernels.state.report import FORCE_A, FORCE_B, LENGTH_OUT, NET_A, PAYOUT_POWER, PAYOUT_RATE, TOUCHES

# --- the force of the fairlead --------------------------------------------------------------------


@inner
def chord_at(line, state, reel, c):
    """Chord of a cell, towards the fairlead."""
    return scale(reel.numbers.side, get3(state.e, cell(line, reel, c)))


@inner
def lengths_at(line, reel, j):
    """Lengths of the cells before and after node j."""
    return line.h[cell(line, reel, j - 1)], line.h[cell(line, reel, j)]


@inner
def slope_at(line, state, reel, i):
    """r' and r'' at node i: of the parabola through it and its neighbours, or through the last three."""
    j = min(i, line.h.shape[0] - 1)
    ha, hb = lengths_at(line, reel, j)
    sa, sb = scale(1.0 / ha, chord_at(line, state, reel, j - 1)), scale(1.0 / hb, chord_at(line, state, reel, j))
    part = ha / (ha + hb) if i == j else 1.0 + hb / (ha + hb)
    return add(sa, scale(part, sub(sb, sa))), scale(2.0 / (ha + hb), sub(sb, sa))


@inner
def velocity_at(line, state, reel, i, rate, g):
    """Velocity of the material at node i: that of a node behind the cell that grows is another one."""
    v = get3(state.v, node(line, reel, i))
    if i <= g:
        return v
    slope, _ = slope_at(line, state, reel, i)
    return sub(v, scale(rate, slope))


class Way(NamedTuple):
    """How the line lies at a node and how its material goes there: r', r'', velocity, and the rate of r'."""

    slope: tuple[float, float, float]
    bend: tuple[float, float, float]
    v: tuple[float, float, float]
    turns: tuple[float, float, float]


@inner
def way_at(line, state, reel, i, rate, g):
    """The `Way` at node i, where line comes at a rate, m/s, behind cell g."""
    j = min(i, line.h.shape[0] - 1)
    slope, bend = slope_at(line, state, reel, i)
    ha, hb = lengths_at(line, reel, j)
    first, middle = velocity_at(line, state, reel, j - 1, rate, g), velocity_at(line, state, reel, j, rate, g)
    last = velocity_at(line, state, reel, j + 1, rate, g)
    va, vb = scale(1.0 / ha, sub(middle, first)), scale(1.0 / hb, sub(last, middle))
    part, v = (ha / (ha + hb), middle) if i == j else (1.0 + hb / (ha + hb), last)
    return Way(slope, bend, v, add(va, scale(part, sub(vb, va))))


@inner
def left_behind(way, c, q):
    """Acceleration by which a node is ahead of material that comes at the rate c, m/s, which grows by q, m/s2."""
    return add(scale(2.0 * c, way.turns), add(scale(c * c, way.bend), scale(q, way.slope)))


@called
def of_material(line, sea, ends, state, reel, i):
    """What the force on node i, N, is more because it does not move as the material does, and r' there."""
    n, numbers = line.h.shape[0], reel.numbers
    way = way_at(line, state, reel, i, numbers.rate, growing(line, reel))
    K = left_behind(way, numbers.rate, numbers.acceleration)
    k, z = node(line, reel, i), ends.position[end_of(reel), 2]
    before, after = Chord(Z3, 0.0, 0.0), Chord(Z3, 0.0, 0.0)
    if k > 0:
        d, l, il = chord(get3(state.e, k - 1))
        before = Chord(d, l, il)
    if k < n:
        d, l, il = chord(get3(state.e, k))
        after = Chord(d, l, il)
    for c in range(i, n):
        z -= numbers.side * state.e[cell(line, reel, c), 2]
    vi, ai = get3(state.v, k), get3(state.vd, k)
    rates = Rates(0.0, 0.0)
    with_material, _, _, _ = inertia_and_water(line, sea, k, z, way.v, sub(ai, K), before, after, rates, reel.report)
    with_node, _, _, _ = inertia_and_water(line, sea, k, z, vi, ai, before, after, rates, reel.report)
    return sub(with_material, with_node), way.slope


@inner
def is_joined(ends, reel):
    """Whether the fairlead is joined to what moves by what pulls there: the force on it is one of the equations."""
    return ends.held[end_of(reel)] == JOINED


@inner
def put_riding_on(line, sea, ends, state, reel, t):
    """The forces on the line with those by which nodes that ride, and a fairlead that is joined, have more; t: s.

    A line that is damped in proportion to stiffness has the flow of its damping, too.
    """
    first, rides = growing(line, reel) + 1, reel.layer.shape[0] - 1
    for k in range(rides + (1 if is_joined(ends, reel) else 0)):
        more, _ = of_material(line, sea, ends, state, reel, first + k)
        if k == rides:
            more = sub(more, sum_of_balance(reel, t))
        for j in range(3):
            reel.riding[k, j] = more[j]
    for k in range(rides + 1):
        i = node(line, reel, first + k)
        for j in range(3):
            reel.riding[k, 3 + j] = line.force[i, j]
            line.force[i, j] += reel.riding[k, j]
    if reel.flow.shape[0] > 0:
        put_flow_on(line, ends, state, reel, t)
        reel.stage.flow_known = 1.0
    reel.stage.riding_on = 1.0


@inner
def sum_of_balance(reel, t):
    """The sum, N, of the forces that balance the neighbours of the last new node, at t.

    Where the cells at the fairlead are those that have changed, the force of the line on it is that much too large.
    """
    part, x, y, z = eased(reel, t), 0.0, 0.0, 0.0
    if part > 0.0:
        for i in range(reel.balance.shape[0]):
            x, y, z = x + reel.balance[i, 0], y + reel.balance[i, 1], z + reel.balance[i, 2]
    return part * x, part * y, part * z


@inner
def force_of_fairlead(reel, report, more):
    """Force of the line on the fairlead, N, of the material there, and where it stands in the report."""
    at = FORCE_B if end_of(reel) else FORCE_A
    return (report[at] + more[0], report[at + 1] + more[1], report[at + 2] + more[2]), at


@inner
def pull_at(force, slope):
    """Pull of the line at the fairlead, N: the size of its force, negative where it pushes."""
    size = math.sqrt(dot(force, force))
    return size if dot(force, slope) <= 0.0 else -size


@inner
def correct_force(line, sea, ends, state, velocity, reel, report, t):
    """The report of a state at t: the half cell at the fairlead has the velocity and the acceleration of the material.

    What the end does of power by the difference is kept in the numbers of the reel, to be taken back.  Returns the
    pull of the line there, N.
    """
    numbers, k = reel.numbers, end_of(reel)
    if is_joined(ends, reel):  # where the state has it, and not the last iterate
        for j in range(3):
            ends.position[k, j] = state.r[k * line.h.shape[0], j]
    more, slope = of_material(line, sea, ends, state, reel, line.h.shape[0])
    more = sub(more, sum_of_balance(reel, t))
    there = (0.0, 0.0, 0.0) if is_joined(ends, reel) else more  # where the report does not have it already
    force, at = force_of_fairlead(reel, report, there)
    report[at], report[at + 1], report[at + 2] = force
    for j in range(3):
        report[NET_A - FORCE_A + at + j] += there[j]
    report[LENGTH_OUT], report[PAYOUT_RATE] = numbers.length, numbers.rate
    report[PAYOUT_POWER] = numbers.rate * dot(force, slope)
    numbers.flux = dot(more, get3(velocity, k))
    for i in range(growing(line, reel) + 1, line.h.shape[0]):
        more, _ = of_material(line, sea, ends, state, reel, i)
        numbers.flux += dot(more, get3(state.v, node(line, reel, i)))
    return pull_at(force, slope)


# --- energy ---------------------------------------------------------------------------------------


@inner
def remember_all(job, state):
    """What the books of the next step ask of a state."""
    remember(job.line, job.ends, state, job.reel)
    if flows(job.line):
        remember_bend(job.line, job.ends, state, job.reel)


# --- entries --------------------------------------------------------------------------------------


@inner
def limit_step(reel, clock):
    """The next step, if it follows the motion, is so short that a new cell has its length before the next node enters.

    Of a winch that holds a tension the rate and its growth now tell what comes in a step, else the law of the length.
    """
    dt, numbers, fastest = clock.next_dt, reel.numbers, 1e-12
    if reel.winch.tension > 0.0:
        fastest = max(fastest, abs(numbers.rate) + abs(numbers.acceleration) * clock.last_dt)
    else:
        length, rate, _ = length_at(reel.law, clock.now)
        later, then, _ = length_at(reel.law, clock.now + dt)
        fastest = max(fastest, abs(rate), abs(then), abs(later - length) / dt)
    clock.next_dt = max(min(dt, reel.rest_length[0] / (FEWEST_STEPS * fastest)), clock.shortest)


@inner
def note_pull(reel, t, pull):
    """What the pull is when the brake of a winch opens: the last one before."""
    if t <= reel.winch.begin:
        reel.winch.held = pull


@kernel
def pay_out(table):
    """What a run whose line changes its length does before a try, after it, after a step; 1: Python must look at it."""
    job = read(table)
    line, reel, clock, count = job.line, job.reel, job.clock, job.counts
    phase, numbers, winch = count.phase, reel.numbers, reel.winch
    if phase == b.SOLVE:
        find_length(reel, clock.try_end)
        if winch.tension > 0.0:
            dt = clock.try_end - clock.now
            numbers.length, numbers.rate, numbers.acceleration = predict(
                winch, clock.rho, clock.step_before, clock.rho_before, dt
            )
        prepare(line, reel, clock.try_end)
        put_balance_on(line, reel, clock.try_end)
        if flows(line):
            let_layers_flow(line, job.new if count.parity else job.old, reel)
        return 0
    if phase == b.JUDGE:
        tried = job.old if count.parity else job.new
        remove_riding(line, reel)
        remove_balance(line, reel)
        pull = correct_force(line, job.sea, job.ends, tried, job.velocity, reel, job.report, clock.try_end)
        if reel.flow.shape[0] > 0:
            numbers.flux += power_of_flow(line, job.ends, tried, reel)
        note_pull(reel, clock.try_end, pull)
        leave_to_reel(line, job.zones, reel)
        return 0
    # a step is accepted, and the states have changed places
    reel.stage.flow_known = 0.0
    state, before = (job.new, job.old) if count.parity else (job.old, job.new)
    if winch.tension > 0.0:
        accept(winch, numbers.length, numbers.rate, numbers.acceleration)
    job.work[0, end_of(reel)] += book(line, job.ends, before, state, reel, clock.last_dt)
    job.work[0, b.ZONES] += work_of_balance(before, state, reel, clock.now, clock.last_dt)
    if line.bits & TOUCHES:
        book_contact(line, job.sea, before, state, reel, job.work)
    if flows(line):
        job.work[0, end_of(reel)] += layers_that_came(line, job.ends, before, state, reel)
        stop_flow(line, reel)
    remember_all(job, state)
    if count.controlled:
        limit_step(reel, clock)
    last = reel.true[growing(line, reel)]
    numbers.due = 1.0 if last > numbers.longest or last < numbers.shortest else 0.0
    return 1 if numbers.due > 0.0 or at_its_end(winch) else 0


@inner
def correct_length(job, change):
    """The length of a winch that holds a tension changes, m, in the iteration of a step."""
    numbers, winch, t = job.reel.numbers, job.reel.winch, job.clock.try_end
    numbers.length += change
    numbers.rate += winch.cv * change
    numbers.acceleration += winch.ca * change
    prepare(job.line, job.reel, t)
    put_balance_on(job.line, job.reel, t)
    if flows(job.line):
        let_layers_flow(job.line, job.new if job.counts.parity else job.old, job.reel)


@inner
def ride_and_wind(job, waits):
    """As `iterate`; waits: whether the length is corrected with all lines."""
    line, reel, clock = job.line, job.reel, job.clock
    numbers, winch, stage, t = reel.numbers, reel.winch, reel.stage, clock.try_end
    state = job.old if job.counts.parity else job.new
    if stage.lengthens == MOVES:
        stage.lengthens = 0.0
        correct_length(job, stage.change)
        return 0
    stage.lengthens = 0.0
    if stage.riding_on == 0.0:
        put_riding_on(line, job.sea, job.ends, state, reel, t)
        if rubs(line):
            let_material_rub(line, job.sea, job.new if job.counts.parity else job.old, reel)
        return 0
    if reel.flow.shape[0] > 0:
        correct_damping_power(line, job.ends, state, reel, job.report, True)
    remove_riding(line, reel)
    if t <= winch.begin or not winch.tension > 0.0:
        return 0
    at, n, g = last_change(line), line.h.shape[0], growing(line, reel)
    apart = end_of(reel) == 0 or g < n - 1  # the cell that grows is not the last one of the line
    more, slope = of_material(line, job.sea, job.ends, state, reel, n)
    more = (0.0, 0.0, 0.0) if is_joined(job.ends, reel) else sub(more, sum_of_balance(reel, t))
    force, _ = force_of_fairlead(reel, job.report, more)
    pull = pull_at(force, slope)
    lost, steep = losses(winch, numbers.rate)
    taken = winch.inertia * numbers.acceleration + lost + tension_held(winch, t)
    carried = 0.0  # with the fairlead and the nodes that ride with it
    for j in range(g + 1, n + 1):
        carried += line.mass[node(line, reel, j)] * math.sqrt(dot(slope, slope))
    stiff = (winch.inertia + carried) * winch.ca + steep * winch.cv
    c, before = cell(line, reel, g), n if end_of(reel) else 1
    if waits:
        stage.lengthens, stage.grows_at, stage.pulls_at = WAITS, c + 1.0, float(before)
        stage.puts, stage.out_of_balance, stage.alone = by_length(line, state, winch, c), taken - pull, stiff
        return 0
    if apart:
        answer, more_pull = answer_of_cell(line, state, winch, job.X, job.W, reel.columns, c, before)
    else:
        answer, more_pull = softness(line, state, winch, job.X), job.X[at]
    change = -(taken - (pull + more_pull)) / (stiff - answer)
    correct_length(job, change)
    if apart:
        lengthen_cell(line, job.X, change, reel.columns)
    else:
        job.X[at] += answer * change
    return 0


@kernel
def iterate(table):
    """What an iteration of Newton's method does before it assembles its equations, and after it has eliminated them.

    Nodes that ride with the fairlead have the inertia, the drag, the added mass and the friction of the material that
    they pass; a winch that holds a tension corrects the length, and the equations with it.
    """
    return ride_and_wind(read(table), False)


@kernel
def iterate_with_others(table):
    """The same of a line that one Newton solves with others.

    The length is corrected with all of these (kernels.junctions.sheaves_and_winches), and then changes.
    """
    return ride_and_wind(read(table), True)


@kernel
def end_payout(table):
    """Let the nodes that ride, and the fairlead, go on with the material that is there now; none comes any more."""
    job = read(table)
    line, reel = job.line, job.reel
    state, n, g = job.new if job.counts.parity else job.old, line.h.shape[0], growing(line, reel)
    for i in range(g + 1, n + 1):
        v = velocity_at(line, state, reel, i, reel.numbers.rate, g)
        for j in range(3):
            state.v[node(line, reel, i), j] = v[j]


@kernel
def fit_line(table):
    """The line with the length that its reel has, at clock[NOW]."""
    job = read(table)
    prepare(job.line, job.reel, job.clock.now)


@kernel
def lengthen(table):
    """The line as it is at clock[NOW]."""
    job = read(table)
    find_length(job.reel, job.clock.now)
    prepare(job.line, job.reel, job.clock.now)
    remember_all(job, job.new if job.counts.parity else job.old)
    leave_to_reel(job.line, job.zones, job.reel)


@kernel
def limit_next_step(table):
    """`limit_step`, after another law of the length."""
    job = read(table)
    limit_step(job.reel, job.clock)


@kernel
def put_forces_on(table):
    """On the line of now: forces of nodes that ride, and those that balance the neighbours of the last new node."""
    job = read(table)
    put_balance_on(job.line, job.reel, job.clock.now)
    state = job.new if job.counts.parity else job.old
    put_riding_on(job.line, job.sea, job.ends, state, job.reel, job.clock.now)


@kernel
def remove_forces(table):
    """The line without them."""
    job = read(table)
    remove_riding(job.line, job.reel)
    remove_balance(job.line, job.reel)


@kernel
def stand_still(table):
    """The line at clock[NOW], and the force of its fairlead, for a state that no step has led to."""
    job = read(table)
    was_on, damped, t = job.reel.stage.flow_known > 0.0, job.reel.flow.shape[0] > 0, job.clock.now
    state = job.new if job.counts.parity else job.old
    find_length(job.reel, t)
    prepare(job.line, job.reel, t)
    if damped or job.reel.stage.unbalanced > 0.0:
        put_riding_on(job.line, job.sea, job.ends, state, job.reel, t)
        if job.reel.stage.unbalanced > 0.0:
            find_balance(job.line, job.sea, job.ends, state, job.reel)
        if damped:
            correct_damping_power(job.line, job.ends, state, job.reel, job.report, was_on)
        if damped and not was_on:
            correct_end(job.line, job.ends, state, job.reel, job.report)
        remove_riding(job.line, job.reel)
        job.reel.stage.unbalanced, job.reel.stage.flow_known = 0.0, 0.0
    pull = correct_force(job.line, job.sea, job.ends, state, job.velocity, job.reel, job.report, t)
    if damped:
        job.reel.numbers.flux += power_of_flow(job.line, job.ends, state, job.reel)
    note_pull(job.reel, t, pull)
    remember_all(job, state)


@kernel
def stand_among(table):
    """`stand_still`, for a line of several."""
    stand_still(table)
    return 0
