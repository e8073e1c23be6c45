"""What the motion of lines answers to numbers of its scene: tangents along the steps of a run.

As of one line (kernels.watch.tangents), line by line; what lines hand over to points and bodies is solved with the
factors of the lines that the last iteration has left, as another right-hand side (kernels.junctions.borders).

A body has tangents of its own: of its place r, of its turn theta (inertial), of the rotation vector n of the step, and
of the rates of both.  With R' = R_0 exp([n]x),  theta' = theta_0' + R_0 J(n) n',  J the left Jacobian.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hybrid.kernels.algebra.block_elimination import KEPT, ROW, SIZE
from hybrid.kernels.algebra.kept_factors import carry_block, solve_with
from hybrid.kernels.algebra.plane import solve_again_planar
from hybrid.kernels.algebra.rotations import (
    add,
    cross,
    dot,
    get3,
    inverse_left_jacobian,
    jacobian_functions,
    mat_mat,
    mat_vec,
    scale,
    sub,
    vec_mat,
    vector,
)
from hybrid.kernels.junctions.bodies import (
    FRAME,
    OWN,
    PLACE,
    START,
    VD,
    WA,
    WD,
    A,
    N,
    U,
    V,
    W,
    X,
    matrix,
    own_force,
    put,
    put_matrix,
    rotation,
)
from hybrid.kernels.junctions.borders import END, NONE, answer_right_sides, hand_on, read_network, task_of
from hybrid.kernels.junctions.borders import START as BEGIN
from hybrid.kernels.laws.element import chord
from hybrid.kernels.laws.water import wave_kinematics
from hybrid.kernels.machine.compile import inner, kernel
from hybrid.kernels.machine.references import reader
from hybrid.kernels.march.march import AT_REST, left_over_in_space
from hybrid.kernels.run.network_run import load_bodies
from hybrid.kernels.state.books import HEAD, SAMPLE_POSITION, Clock, Counts
from hybrid.kernels.state.report import NET_A, WAVES
from hybrid.kernels.state.state import Blocks, Floats, NumberRows, Rows, blanks
from hybrid.kernels.step.line_step import with_radius
from hybrid.kernels.step.step_control import scheme
from hybrid.kernels.watch.tangents import (
    ALONE,
    SECOND_R,
    SECOND_T,
    STEPS,
    begin_other,
    carry_spins,
    correct_rates,
    end_other,
    is_wanted,
    keep_own,
    largest_correction,
    leave_apart,
    leave_over,
    needs_two,
    note_left,
    put_other,
    read_job,
    read_other,
    stay_held,
)

# Numbers of the tangents of a body, behind those of its place (3).
TURN_OF = 3  # 3, turn (inertial), rad
V_OF = 6  # 3, rates of both, as in its state
A_OF = 9  # 3
VD_OF = 12  # 3
W_OF = 15  # 3
WA_OF = 18  # 3
WD_OF = 21  # 3
N_OF = 24  # 3, n of the step
TANGENTS = 27
SMALL_TURN = 1e-3


class OtherBodies(NamedTuple):
    """The bodies of a scene with more of a number, beside those of the run."""

    numbers: Rows  # (B, NUMBERS)
    fairleads: Blocks  # (J, 2, 3) m, of lines that are joined to what moves with them
    loads: Rows  # as kernels.run.network_run.StepsJob.loads, history
    history: Rows
    rates: Rows  # (B, TANGENTS) named above, of the last step's end
    before: Rows  # the same before the step
    old: Rows  # (B, STATE)
    new: Rows
    work: Rows  # (B, WORK)
    right: Rows  # (B, 6) what the bodies themselves add to the right-hand side
    h: float


class NetworkTangents(NamedTuple):
    """Arguments of `advance_joined`, `advance_in_plane` and `correct_beside`."""

    even: NDArray[np.int64]  # of a NetworkJob of the lines that are joined to what moves with them, as of StepsJob
    odd: NDArray[np.int64]
    joined: NDArray[np.int64]  # (J,) their numbers
    lone: NDArray[np.int64]  # and those of the others
    lines: NumberRows  # (L, ..) tables of a TangentJob each
    bodies: NumberRows  # (P, ..) tables of an OtherBodies each
    clock: Clock
    counts: Counts
    asked: NDArray[np.int64]  # (1,) of `correct_beside`: the number, -1: the lines of the run
    by: Floats  # (2,) cv, ca of `correct_beside`


blank_bodies = blanks(OtherBodies)


blank_network_tangents = blanks(NetworkTangents)
read_bodies, read_tangents = reader(blank_bodies()), reader(blank_network_tangents())


# --- bodies -----------------------------------------------------------------------------------------


@inner
def turned_by(n, x):
    """J(n) x, the left Jacobian of rotations by a vector."""
    q2 = n[0] * n[0] + n[1] * n[1] + n[2] * n[2]
    if q2 < SMALL_TURN:
        b = 0.5 - q2 * (1 / 24 - q2 * (1 / 720 - q2 / 40320))
        c = 1 / 6 - q2 * (1 / 120 - q2 * (1 / 5040 - q2 / 362880))
    else:
        q = math.sqrt(q2)
        b, c = (1.0 - math.cos(q)) / q2, (q - math.sin(q)) / (q2 * q)
    once = cross(n, x)
    return add(x, add(scale(b, once), scale(c, cross(n, once))))


@inner
def predict_body_rates(network, other, s):
    """Tangents of all bodies at the end of a step as they are predicted, from those before it."""
    dt, am, af, _, be, _, ca = s
    was, now = other.before, other.rates
    for b in range(now.shape[0]):
        for k in range(TANGENTS):
            was[b, k] = now[b, k]
        x, y = was[b], now[b]
        for v, a, vd, shift in ((V_OF, A_OF, VD_OF, 0), (W_OF, WA_OF, WD_OF, N_OF)):
            for k in range(3):
                more = dt * x[v + k] + 0.5 * dt * dt * x[a + k]
                y[shift + k] = more if shift == N_OF else x[k] + more
                y[v + k] = x[v + k] + dt * x[a + k]
                y[vd + k] = (am * x[a + k] - af * x[vd + k]) / (1.0 - af) + ca * be * dt * dt * x[a + k]
        z = network.work[b]
        turn = mat_vec(matrix(z, START), turned_by(vector(z, N), vector(y, N_OF)))
        put(y, TURN_OF, add(vector(x, TURN_OF), turn))


@inner
def correct_body_rates(network, now, s):
    """Add the corrections of bodies to tangents."""
    for b in range(now.shape[0]):
        y, z = now[b], network.work[b]
        n = vector(z, N)
        g, _ = jacobian_functions(n[0] * n[0] + n[1] * n[1] + n[2] * n[2])
        dn = mat_vec(inverse_left_jacobian(n, g), vec_mat(vector(z, X + 3), matrix(z, START)))
        for k in range(3):
            dr = z[X + k]
            y[k] += dr
            y[V_OF + k] += s.cv * dr
            y[VD_OF + k] += s.ca * dr
            y[TURN_OF + k] += z[X + 3 + k]
            y[N_OF + k] += dn[k]
            y[W_OF + k] += s.cv * dn[k]
            y[WD_OF + k] += s.ca * dn[k]


@inner
def find_body_rates(other, s):
    """Tangents of algorithmic accelerations of bodies (kernels.junctions.bodies.end_bodies)."""
    dt, _, _, _, be, _, _ = s
    for b in range(other.rates.shape[0]):
        x, y = other.before[b], other.rates[b]
        for k in range(3):
            there = x[k] + dt * x[V_OF + k] + dt * dt * (0.5 - be) * x[A_OF + k]
            y[A_OF + k] = (y[k] - there) / (be * dt * dt)
            turned = dt * x[W_OF + k] + dt * dt * (0.5 - be) * x[WA_OF + k]
            y[WA_OF + k] = (y[N_OF + k] - turned) / (be * dt * dt)


@inner
def put_bodies(network, other):
    """Where the other bodies stand: those of the run and h times the tangents."""
    h = other.h
    for b in range(other.rates.shape[0]):
        x, y, here, there = other.before[b], other.rates[b], network.new[b], other.new[b]
        z, own = network.work[b], other.work[b]
        for k in range(3):
            there[PLACE + k] = here[PLACE + k] + h * y[k]
            for o, rate in ((V, V_OF), (A, A_OF), (VD, VD_OF), (W, W_OF), (WA, WA_OF), (WD, WD_OF)):
                there[o + k] = here[o + k] + h * y[rate + k]
            other.old[b, PLACE + k] = network.old[b, PLACE + k] + h * x[k]
            own[U + k] = z[U + k] + h * (y[k] - x[k])
        put_matrix(there, FRAME, mat_mat(rotation(scale(h, vector(y, TURN_OF))), matrix(here, FRAME)))


@inner
def reach(network, j, k, b):
    """Where fairlead k of joined line j is from the origin of its body in the run, in space."""
    return mat_vec(matrix(network.new[b], FRAME), vector(network.fairleads[j, k], 0))


@inner
def place_fairleads(network, net, p, s):
    """Ends of the other lines at bodies are where their fairleads are."""
    other, points = read_bodies(net.bodies[p]), network.net.shape[0]
    for j in range(network.joints.shape[0]):
        job = read_job(net.lines[net.joined[j]])
        now = read_other(job.tables[p]).rates
        for k in range(2):
            b = network.joints[j, k] - points
            if b >= 0:
                i, y = k * job.line.h.shape[0], other.rates[b]
                rho = reach(network, j, k, b)
                apart = scale(1.0 / other.h, sub(vector(other.fairleads[j, k], 0), vector(network.fairleads[j, k], 0)))
                more = add(cross(vector(y, TURN_OF), rho), mat_vec(matrix(network.new[b], FRAME), apart))
                for m in range(3):
                    shift = y[m] + more[m] - now.r[i, m]
                    now.r[i, m] += shift
                    now.v[i, m] += s.cv * shift
                    now.vd[i, m] += s.ca * shift


@inner
def own_right_sides(network, net, p):
    """What bodies themselves leave over beside those of the run, and by what the arms of their lines are others."""
    other, points = read_bodies(net.bodies[p]), network.net.shape[0]
    for b in range(other.rates.shape[0]):
        own_force(network.bodies[b], network.old[b], network.new[b], network.work[b])
        own_force(other.numbers[b], other.old[b], other.new[b], other.work[b])
        for k in range(6):
            other.right[b, k] = (network.work[b, OWN + k] - other.work[b, OWN + k]) / other.h
    for j in range(network.joints.shape[0]):
        job = read_job(net.lines[net.joined[j]])
        report = read_other(job.tables[p]).work.report
        for k in range(2):
            b = network.joints[j, k] - points
            if b >= 0:
                there = mat_vec(matrix(other.new[b], FRAME), vector(other.fairleads[j, k], 0))
                arm = scale(1.0 / other.h, sub(there, reach(network, j, k, b)))
                moment = cross(arm, vector(report, NET_A + 3 * k))
                for m in range(3):
                    other.right[b, 3 + m] -= moment[m]


# --- lines ------------------------------------------------------------------------------------------


@inner
def faster_apart(state, c):
    """Acceleration, m/s2, by which the nodes of cell c go apart."""
    d, _, _ = chord(get3(state.e, c))
    return dot(d, sub(get3(state.vd, c + 1), get3(state.vd, c)))


@inner
def leave_over_at_rest(job, other, cv, ca):
    """What `leave_over` does, of a state as it is, at which no step ends."""
    work, b, there = other.work, other.left, other.even
    put_other(None, 1, other.line, job.even, other.rates, other.spin, other.h, there)
    work.u[:] = 0.0
    if other.line.bits & WAVES:
        wave_kinematics(other.sea, there.r, work.u)
    left_over_in_space(other.line, other.sea, other.ends, there.r, there, cv, ca, work, b)
    leave_apart(job, other, job.even, there)
    for c in range(other.line.h.shape[0] if ca > AT_REST else 0):  # accelerations are sought of places that are known:
        if not other.line.ck[c] > 0.0:  # rounding of the length of what does not stretch would be one
            b[c + 1, 0] = (faster_apart(job.even, c) - faster_apart(there, c)) / (other.h * ca)


@inner
def set_right_side(line_work, job, other, starts, ends):
    """What is left over becomes the right-hand side of an eliminated line; starts, ends: whether these are joined."""
    x, X_, b, n = line_work.x, line_work.X, other.left, job.line.h.shape[0]
    there, here, h = other.work.report, job.own.report, other.h
    for a in range(3):
        if starts:  # the march has replaced its balance by its place
            line_work.rows[0, (a + 1) * 24 + 23] = (here[NET_A + a] - there[NET_A + a]) / h
        if ends:
            b[n, 1 + a] = (here[NET_A + 3 + a] - there[NET_A + 3 + a]) / h
    for i in range(n + 1):
        x[i, 0] = X_[(n + 1) * ROW + i * KEPT + 62] * b[i, 0]
        for k in range(1, SIZE):
            x[i, k] = b[i, k]
        carry_block(X_, line_work.W, x, i, i, n, 0, not (ends and i == n))
    hand_on(line_work, ends, 0)


@inner
def put_right_sides(network, right, part):
    """A part of right-hand sides (B, 6) of bodies to where borders find them."""
    first = 3 * network.net.shape[0]
    for b in range(right.shape[0]):
        for k in range(6):
            network.right[first + 6 * b + k] = part * right[b, k]


@inner
def answer_joined(network, net, p):
    """Corrections of the other lines that move with points and bodies, and of these."""
    own = read_bodies(net.bodies[p])
    for j in range(network.tables.shape[0]):
        job = read_job(net.lines[net.joined[j]])
        starts, ends = network.joints[j, BEGIN] >= 0, network.joints[j, END] != NONE
        set_right_side(job.work, job, read_other(job.tables[p]), starts, ends)
    if network.right.shape[0] > 0:
        own_right_sides(network, net, p)
        put_right_sides(network, own.right, 1.0)
        answer_right_sides(network, network.borders.shape[0])
        put_right_sides(network, own.right, 0.0)


@inner
def answer(plane, space, network, net, p):
    """Corrections of all other lines and bodies: in work.x of the lines of the run and in what its bodies work with."""
    if space is not None:
        answer_joined(network, net, p)
    for k in range(net.lone.shape[0]):
        job = read_job(net.lines[net.lone[k]])
        left = read_other(job.tables[p]).left
        if space is not None:
            solve_with(job.work.X, job.work.W, left, job.work.x, False)
        if plane is not None:
            solve_again_planar(plane, job.work.X, left, job.work.x)
    for l in range(net.lines.shape[0]):
        job = read_job(net.lines[l])
        stay_held(job, job.work.x)


@inner
def hold_ends(network):
    """Ends go nowhere by themselves, and arms are those of bodies as they are."""
    points = network.net.shape[0]
    for j in range(network.joints.shape[0]):
        for k in range(2):
            b = network.joints[j, k] - points
            if b >= 0:
                rho = reach(network, j, k, b)
                for m in range(3):
                    network.arms[j, k, m] = rho[m]
            for m in range(3):
                network.gaps[j, k, m] = 0.0


# --- steps ------------------------------------------------------------------------------------------


@inner
def old_of(job, x):
    """Of the states of a line the one before the last step; x: the line of the run, or another one."""
    return x.even if job.counts.parity else x.odd


@inner
def new_of(job, x):
    """And the one behind it."""
    return x.odd if job.counts.parity else x.even


@inner
def how_many(net, p):
    """How many corrections tangents get, and whether forces are wanted of the end of the step."""
    wanted, two = False, False
    for l in range(net.lines.shape[0]):
        other = read_other(read_job(net.lines[l]).tables[p])
        wanted = wanted or is_wanted(other.books)
        two = two or needs_two(other.sizes)
    return (2 if two else 1) + (1 if wanted else 0), wanted


@inner
def correct_lines(space, net, p, s, k, count, wanted):
    """Add corrections to tangents of all lines, the k-th of so many, and keep how large they are."""
    for l in range(net.lines.shape[0]):
        job = read_job(net.lines[l])
        other = read_other(job.tables[p])
        sizes = other.sizes
        correct_rates(space, job.work.x, s, other.rates, other.spin)
        r, T = largest_correction(job.work.x)
        if k == 1:
            sizes[SECOND_R], sizes[SECOND_T] = max(sizes[SECOND_R], r), max(sizes[SECOND_T], T)
        if k == count - 1:
            if count > 1:
                note_left(r, T, other.work.x[0, 0], other.work.x[0, 1], wanted, other.rates, sizes)
            sizes[STEPS] += 1.0
            sizes[ALONE] = 1.0 if count == 1 else 0.0
        other.work.x[0, 0], other.work.x[0, 1] = r, T  # room that is not used


@inner
def end_lines(plane, space, net, p, s):
    """The other lines stand where tangents lead; in their outputs ends are where nodes are."""
    for l in range(net.lines.shape[0]):
        job = read_job(net.lines[l])
        other = read_other(job.tables[p])
        books, n = other.books, other.line.h.shape[0]
        begin = books.counts.samples
        new, there_old, there = new_of(job, job), old_of(job, other), new_of(job, other)
        end_other(plane, space, job, other, s, new, there_old, there, job.work.report)
        for i in range(begin, books.counts.samples):
            row = books.samples[i]
            for j in range(3):
                row[SAMPLE_POSITION + j] = row[HEAD + j]
                row[SAMPLE_POSITION + 3 + j] = row[HEAD + 3 * n + j]


@inner
def advance(plane, space, network, net, p, s):
    """The other lines and bodies of a number from the beginning of the last step of the run to its end."""
    bodies = read_bodies(net.bodies[p])
    for l in range(net.lines.shape[0]):
        job = read_job(net.lines[l])
        other = read_other(job.tables[p])
        begin_other(space, job, other, s, old_of(job, other))
    if space is not None:
        load_bodies(bodies.numbers, bodies.loads, bodies.history, net.clock.now)
        predict_body_rates(network, bodies, s)
        place_fairleads(network, net, p, s)
    for l in range(net.lines.shape[0]):
        job = read_job(net.lines[l])
        other = read_other(job.tables[p])
        carry_spins(plane, space, other, old_of(job, job), new_of(job, job), old_of(job, other), new_of(job, other))
    count, wanted = how_many(net, p)
    for k in range(count):
        for l in range(net.lines.shape[0]):
            job = read_job(net.lines[l])
            other = read_other(job.tables[p])
            leave_over(plane, space, job, other, s, new_of(job, job), old_of(job, other), new_of(job, other))
        if space is not None:
            put_bodies(network, bodies)
        answer(plane, space, network, net, p)
        correct_lines(space, net, p, s, k, count, wanted)
        if space is not None:
            correct_body_rates(network, bodies.rates, s)
    if space is not None:
        find_body_rates(bodies, s)
    end_lines(plane, space, net, p, s)


@inner
def advance_tangents(plane, space, net):
    """Tangents of all lines and bodies through the last step of their run."""
    network = read_network(net.even if net.counts.parity else net.odd)
    task = task_of(network.asked)
    task = with_radius(task, task.rho)
    s = scheme(task.rho, task.before, task.rho_before, task.dt)
    if space is not None:
        hold_ends(network)
    for l in range(net.lines.shape[0]):
        job = read_job(net.lines[l])
        keep_own(plane, space, job, s, old_of(job, job), new_of(job, job))
    for p in range(net.bodies.shape[0]):
        advance(plane, space, network, net, p, s)
    return 0


@kernel
def advance_joined(table):
    """The same of lines in space; table: of NetworkTangents.  Returns 0."""
    return advance_tangents(None, 1, read_tangents(table))


@kernel
def advance_in_plane(table):
    """The same of lines in one plane that are joined to nothing that moves with them.  Returns 0."""
    net = read_tangents(table)
    return advance_tangents(read_job(net.lines[0]).line.plane, None, net)


@kernel
def correct_beside(table):
    """Correct tangents of a state as it is, by its factors; returns 0.

    Of the number asked[0], in what the lines and bodies of the run work with; -1: residuals of the lines of the run are
    found.
    """
    net = read_tangents(table)
    network, p, cv, ca = read_network(net.even), net.asked[0], net.by[0], net.by[1]
    if p < 0:
        hold_ends(network)
        for l in range(net.lines.shape[0]):
            job = read_job(net.lines[l])
            left_over_in_space(job.line, job.sea, job.ends, job.even.r, job.even, cv, ca, job.own, job.left)
        return 0
    for l in range(net.lines.shape[0]):
        job = read_job(net.lines[l])
        leave_over_at_rest(job, read_other(job.tables[p]), cv, ca)
    put_bodies(network, read_bodies(net.bodies[p]))
    answer(None, 1, network, net, p)
    return 0
