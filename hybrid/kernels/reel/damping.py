"""Damping in proportion to stiffness of a line that is paid out (docs/theory.md, 19).

The cell that grows at the fairlead, and those behind it that ride with it, hold other material at every moment: not all
of the rate of a chord is a rate of strain, nor all of the rate at which an element turns one of curvature.  What is not
(the flow) is taken off.  A cell that gets its length slowly (kernels.reel.payout_nodes) stretches by less, likewise.

    symbol   meaning                                                              unit
    c        rate at which line comes, positive outwards                          m/s
    eps      strain of a cell without damping, l/h - 1                            -
    x        flow of a cell: rate of its chord at which no material stretches     m/s
    w        flow of an element: rate of its turn at which nothing bends          rad/s

A cell between two faces that material passes with c_a and c_b has x = c_b (1 + eps_b) - c_a (1 + eps_a), so that its
law of length is l + tau (dl/dt - x) = h (1 + ck T): that of a cell without flow, h + tau x/(1 + ck T) long.  An element
has w = c_b kappa_b - c_a kappa_a with the curvatures in the middles of its cells, as if it were bent by tau w without
stress.  What comes off the reel has the strain of the tension at the winch and no stress of bending.
Nodes, cells and chords count from the far end.
"""

from __future__ import annotations

from hybrid.kernels.algebra.rotations import (
    add,
    cross,
    dot,
    get3,
    inverse_left_jacobian,
    jacobian_functions,
    log_rotation,
    mat_vec,
    scale,
    sub,
    vec_mat,
)
from hybrid.kernels.laws.element import chord, frames_at, relative_rotation, turning
from hybrid.kernels.machine.compile import inner
from hybrid.kernels.mesh.remesh import COMPLIANCE
from hybrid.kernels.reel.paid_length import cell, flows, growing, lack_rate, node, piece_at, shift_layers
from hybrid.kernels.reel.reel import FLOW, LENGTH_OF, STRAIN_OF, TURN_FLOW
from hybrid.kernels.state.report import FORCE_A, MOMENT_A, NET_A, STIFFNESS_DAMPING_POWER

Z3 = (0.0, 0.0, 0.0)


# --- strain ---------------------------------------------------------------------------------------


@inner
def strain_at(line, state, i):
    """Strain of cell i of the line without damping."""
    _, l, _ = chord(get3(state.e, i))
    return (l - line.h[i]) / line.h[i]


@inner
def elastic_tension(line, state, i):
    """Tension, N, of cell i of the line without that of damping."""
    return strain_at(line, state, i) / line.ck[i] if line.ck[i] > 0.0 else state.T[i]


@inner
def compliance_at(line, reel, j):
    """Compliance, 1/N, of the material at node j."""
    return reel.pieces[piece_at(reel, line.s[node(line, reel, j)]), 1 + COMPLIANCE]


@inner
def strain_of_face(line, state, reel, j):
    """Strain of the material at node j, from the fairlead's neighbours on."""
    n = line.h.shape[0]
    c = min(j, n - 1)
    a, b = cell(line, reel, c - 1), cell(line, reel, c)
    part = line.h[a] / (line.h[a] + line.h[b])
    if j < n:
        T, U = elastic_tension(line, state, a), elastic_tension(line, state, b)
    else:
        part = 1.0 + line.h[b] / (line.h[a] + line.h[b])
        if reel.numbers.rate > 0.0:  # what comes bears the tension there
            T, U = state.T[a], state.T[b]
        else:
            T, U = elastic_tension(line, state, a), elastic_tension(line, state, b)
    return compliance_at(line, reel, j) * (T + part * (U - T))


@inner
def flow_of_cell(line, state, reel, k, t):
    """x of cell k at t, m/s."""
    i, g, c = cell(line, reel, k), growing(line, reel), reel.numbers.rate
    if not line.ck[i] > 0.0:
        return 0.0
    x = -lack_rate(reel, t, k) * (1.0 + strain_at(line, state, i))
    if k >= g:
        x += c * (1.0 + strain_of_face(line, state, reel, k + 1))
    if k > g:
        x -= c * (1.0 + strain_of_face(line, state, reel, k))
    return x


# --- bend -----------------------------------------------------------------------------------------


@inner
def spin_beside(line, ends, state, i, side):
    """Angular velocity, rad/s, of the cell before (0) or after (1) node i of the line, or of the end there."""
    c = i - 1 + side
    if c < 0:
        return get3(ends.spin, 0)
    if c >= line.h.shape[0]:
        return get3(ends.spin, 1)
    d, _, il = chord(get3(state.e, c))
    d1, _ = turning(d, il, sub(get3(state.v, c + 1), get3(state.v, c)), 0.0)
    return add(cross(d, d1), scale(state.w[c], d))


@inner
def curvature_at(line, ends, state, reel, j):
    """Curvature, 1/m, and twist, rad/m, at node j, about the axes of the material; 0 where nothing bends."""
    i = node(line, reel, j)
    if not line.element[i]:
        return Z3
    a, b = frames_at(line, ends, state, i)
    return scale(1.0 / line.hn[i], log_rotation(relative_rotation(a, b)))


@inner
def flow_through_middle(line, ends, state, reel, k):
    """Speed of the middle of cell k against its material times the curvature there, rad/s.

    Beyond the last cell, that of the material at a clamp that is the fairlead.
    """
    n, g, c = line.h.shape[0], growing(line, reel), reel.numbers.rate
    if k < g:
        return Z3
    if k == n:
        last = curvature_at(line, ends, state, reel, n)
        if c > 0.0:
            i = node(line, reel, n)
            return scale(2.0 * c / line.h[cell(line, reel, n - 1)], get3(line.k0, i))
        return scale(c, add(last, scale(1.0 / 3.0, sub(last, curvature_at(line, ends, state, reel, n - 1)))))
    before, after = curvature_at(line, ends, state, reel, k), curvature_at(line, ends, state, reel, k + 1)
    # the half cell at a clamp has its curvature at a quarter of the cell
    part = 2.0 / 3.0 if k + 1 == n and line.element[node(line, reel, n)] else 0.5
    return scale(0.5 * c if k == g else c, add(before, scale(part, sub(after, before))))


@inner
def damping_time(line, i):
    """Damping time, s, of the element at node i of the line."""
    n = line.h.shape[0]
    return 0.5 * (line.tau[max(i - 1, 0)] + line.tau[min(i, n - 1)])


# --- on the line ---------------------------------------------------------------------------------


@inner
def put_flow_on(line, ends, state, reel, t):
    """The line with lengths and strains without stress that have the flow at t in them."""
    n, g, flow = line.h.shape[0], growing(line, reel), reel.flow
    for k in range(n):
        flow[cell(line, reel, k), FLOW] = flow_of_cell(line, state, reel, k, t)
    for k in range(n + 1):
        i, w = node(line, reel, k), Z3
        if k >= g and line.element[i]:
            before = flow_through_middle(line, ends, state, reel, k - 1)
            w = sub(flow_through_middle(line, ends, state, reel, k), before)
        for j in range(3):
            flow[i, STRAIN_OF + j], flow[i, TURN_FLOW + j] = line.k0[i, j], w[j]
    for i in range(n):
        flow[i, LENGTH_OF] = line.h[i]
        if flow[i, FLOW] != 0.0:
            line.h[i] += line.tau[i] * flow[i, FLOW] / (1.0 + line.ck[i] * state.T[i])
    for k in range(g, n + 1):
        i = node(line, reel, k)
        for j in range(3):
            line.k0[i, j] += damping_time(line, i) * flow[i, TURN_FLOW + j]
        if flows(line):
            shift_layers(line, flow, i, -1.0)


# --- energy ---------------------------------------------------------------------------------------


@inner
def rate_of_length(state, i):
    """Rate, m/s, of the length of the chord of cell i of the line."""
    d, _, _ = chord(get3(state.e, i))
    return dot(d, sub(get3(state.v, i + 1), get3(state.v, i)))


@inner
def rate_of_turn(line, ends, state, i):
    """Rate, rad/s, of the log strain of the element at node i of the line."""
    a, b = frames_at(line, ends, state, i)
    k = log_rotation(relative_rotation(a, b))
    g, _ = jacobian_functions(dot(k, k))
    between = sub(spin_beside(line, ends, state, i, 1), spin_beside(line, ends, state, i, 0))
    return mat_vec(inverse_left_jacobian(k, g), vec_mat(between, a))


@inner
def correct_damping_power(line, ends, state, reel, report, was_on):
    """The report of a line that has the flow on it and has just been assembled: what damping loses without the flow.

    was_on: whether it was on when the line was assembled.
    """
    n, flow = line.h.shape[0], reel.flow
    for i in range(n):
        x, h, ck = flow[i, FLOW], flow[i, LENGTH_OF], line.ck[i]
        if x != 0.0:
            rate, assembled = rate_of_length(state, i), line.h[i] if was_on else h
            report[STIFFNESS_DAMPING_POWER] += line.tau[i] / ck * ((rate - x) ** 2 / h - rate * rate / assembled)
    for k in range(growing(line, reel), n + 1):
        i = node(line, reel, k)
        if line.element[i]:
            rate, tau = rate_of_turn(line, ends, state, i), damping_time(line, i)
            for j in range(3):
                w = flow[i, TURN_FLOW + j]
                report[STIFFNESS_DAMPING_POWER] += tau * line.kb[i, j] * (w - 2.0 * rate[j]) * w


@inner
def moment_of_flow(line, ends, state, reel, i):
    """What the flow takes off the moment (N m) of the element at node i of the line."""
    if not line.element[i]:
        return Z3
    a, b = frames_at(line, ends, state, i)
    k, tau = log_rotation(relative_rotation(a, b)), damping_time(line, i)
    g, _ = jacobian_functions(dot(k, k))
    kb, w = get3(line.kb, i), (reel.flow[i, TURN_FLOW], reel.flow[i, TURN_FLOW + 1], reel.flow[i, TURN_FLOW + 2])
    less = (tau * kb[0] * w[0], tau * kb[1] * w[1], tau * kb[2] * w[2])
    return mat_vec(a, vec_mat(less, inverse_left_jacobian(k, g)))


@inner
def correct_end(line, ends, state, reel, report):
    """The report of a line that was assembled without the flow: force and moment at the fairlead."""
    n, k = line.h.shape[0], 1 if reel.numbers.side > 0.0 else 0
    d, _, il = chord(get3(state.e, k * (n - 1)))
    here, beside = (
        moment_of_flow(line, ends, state, reel, k * n),
        moment_of_flow(line, ends, state, reel, 1 + k * (n - 2)),
    )
    shear = scale(il, cross(d, sub(here, beside)))
    for j in range(3):
        report[NET_A + 3 * k + j] += shear[j]
        report[FORCE_A + 3 * k + j] += shear[j]
        report[MOMENT_A + 3 * k + j] -= here[j]


@inner
def power_of_flow(line, ends, state, reel):
    """Power, W, into the line by the moments and tensions of damping on the flow; the line is without it."""
    n, flow, into = line.h.shape[0], reel.flow, 0.0
    for i in range(n):
        x = flow[i, FLOW]
        if x != 0.0:
            into -= line.tau[i] / (line.h[i] * line.ck[i]) * (rate_of_length(state, i) - x) * x
    for k in range(growing(line, reel), n + 1):
        i = node(line, reel, k)
        if line.element[i]:
            rate, tau = rate_of_turn(line, ends, state, i), damping_time(line, i)
            for j in range(3):
                w = flow[i, TURN_FLOW + j]
                into -= tau * line.kb[i, j] * (rate[j] - w) * w
    return into


@inner
def damped_stretch_work(line, state, i, h):
    """Energy per length, N, that cell i of length h takes up as its unstretched length grows.

    Its ends stay; without that of the tension of damping, which is part of `power_of_flow`.
    """
    _, l, _ = chord(get3(state.e, i))
    if not line.ck[i] > 0.0:
        return state.T[i]
    strain = (l - h) / h
    return strain * (1.0 + 0.5 * strain) / line.ck[i]
