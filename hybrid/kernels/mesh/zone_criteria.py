"""When a stretch must be a rod, and how its bending comes in.

Every criterion of the table is evaluated at every step, as a ratio, what is there over what a catenary can stand: at
1 a stretch becomes a rod, and below the criterion's `off` it may become a catenary again.  Errors of position that
leaving bending out would make (e_k of kernels.mesh.cell_errors) count against the shares that the scene allows: of
position, tension, curvature and moment.  Slack, a torque near to a loop and contact have no bound in a catenary
(docs/theory.md, 13).

    symbol   meaning                                          shape  unit
    EI       bending stiffness at a node                      -      N m2
    T, ahead tension now, and as it will be                   -      N
    turn     |d_b - d_a| of the chords at a node              -      rad
    Mt       torque                                           -      N m

Bending comes in and goes out by a share of its stiffness, whose change frees energy.

grown: (n,) of base cells, 0 to 1; leaving: (n,) those on their way out; ramp_factor: (n,) times as fast as the others
that some come in.  Times in ramp times of the manager.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hybrid.kernels.algebra.rotations import cross, dot, frame, get3, get9, log_rotation, sub, transport
from hybrid.kernels.laws.bending_law import energy_share
from hybrid.kernels.laws.closed_forms import FADED, at_hinge, depth_of, fade, left_of, stiffness_share
from hybrid.kernels.laws.element import chord, relative_rotation
from hybrid.kernels.laws.seabed import bed_under
from hybrid.kernels.laws.tension_torque import rest_strain
from hybrid.kernels.machine.compile import inner, kernel
from hybrid.kernels.mesh.cell_errors import (
    CURVATURE,
    MOMENT,
    CellError,
    edge_length,
    lack_at_clamp,
    lack_at_edge,
    lack_at_kink,
    lack_of_bend,
    lack_of_torque,
    layer_length,
    node_curvature,
    over_shares,
    second_slope,
)
from hybrid.kernels.state.report import PLANAR, SEABED
from hybrid.kernels.state.state import Floats

# The criteria by which zones move: what each weighs, and where it lets go.
#
# Every criterion is a ratio, what is there over what a catenary can stand: at 1 a stretch becomes a
# rod, and below the criterion's `off` it may become a catenary again.  Errors of position that leaving
# bending out would make are lengths, and count against the tolerance (m) of the scene.

BEND, SLACK, CLAMP, POINT, EDGE, TORSION, GIVEN, CONTACT = range(8)


@dataclass(frozen=True)
class Criterion:
    """A criterion: name, the ratio that it is (in words), and the part of 1 below which it lets go."""

    name: str
    ratio: str
    off: float


CRITERIA: tuple[Criterion, ...] = (
    Criterion("bend", "bending length EI kappa/T over the tolerance", 0.25),
    Criterion("slack", "tension floor over tension, now or as it will be a horizon ahead", 0.5),
    Criterion("clamp", "lambda times the angle at a clamp, or moment at an end over T, over the tolerance", 0.25),
    Criterion(
        "point", "lambda times half the kink at a point load, a step of section or a joint, over the tolerance", 0.25
    ),
    Criterion("edge", "EI w/(2 T^2) where contact with the seabed begins, over the tolerance", 0.25),
    Criterion("torsion", "torque^2/(4 EI T) over a half, or torque x turn of the line/(2 T) over the tolerance", 0.25),
    Criterion("given", "what the scene or a function of the user asks for", 0.5),
    Criterion("contact", "two diameters over the distance of the line to itself, now or as it will be", 0.5),
)


# When a stretch must be a rod: every criterion of the table, as a ratio, at every step.

# What a ratio is where there is no tension, or no number: large, and finite.
MOST = 1e6
# Torque^2/(4 EI T) from which a straight cable is near to a loop: the Maxwell torque is 0.4 of the buckling one.
TWISTED = 0.5
# The most that a tension counts for that is only foreseen.
FORESEEN = 2.0
# Part of a layer beyond which its tension counts; part of a change of tension within that by which it may be wrong.
SHOWS, BY_TENSION = 0.37, 0.25
# What may sit at a node.
SMOOTH = 0  # nothing
STEP = 1  # a jump of bending stiffness
LOAD = 2  # a point load
HINGE = 3  # at an end, a hinge that results know


@inner
def raise_ratio(ratios, c, ja, jb, x):
    """Raise a ratio of the base cells on both sides of a node; what is not a number is large."""
    if not x < MOST:
        x = MOST
    if x > ratios[c, ja]:
        ratios[c, ja] = x
    if x > ratios[c, jb]:
        ratios[c, jb] = x


@inner
def depth(sea, r, i):
    _, p = bed_under(sea, get3(r, i))
    return p


@inner
def find_turns(line, tangents, e, a1, T, torque, kinds):
    """Turns of the nodes, rad, torques of the nodes between cells, N m, and twists per length, rad/m, into `kinds`.

    tangents: (2, 3) of clamped ends, zero where there is none; torque: N m, of all the line as far as its rods do not
    know it.
    """
    n, turn, twisting, twist = e.shape[0], kinds.turn, kinds.twisting, kinds.twist
    turn[0], turn[n] = 0.0, 0.0
    d0 = get3(tangents, 0)
    d1, _, _ = chord(get3(e, 0))
    if dot(d0, d0) > 0.0:
        x = sub(d1, d0)
        turn[0] = math.sqrt(dot(x, x))
    for i in range(1, n):
        d0 = d1
        d1, _, _ = chord(get3(e, i))
        x = sub(d1, d0)
        turn[i] = math.sqrt(dot(x, x))
        twisting[i] = torque
        twist[i] = abs(torque) / kinds.GJ[i] if kinds.GJ[i] > 0.0 else 0.0
        if line.element[i]:
            angle = 0.0
            if not line.bits & PLANAR:  # in a plane nothing twists
                b, carried = get3(a1, i), transport(get3(a1, i - 1), d0, d1)
                angle = math.atan2(dot(cross(carried, b), d1), dot(carried, b))
            twisting[i] = line.kb[i, 2] * (angle - rest_strain(line, T, i)[2])
            twist[i] = abs(angle) / line.hn[i] if kinds.GJ[i] > 0.0 else 0.0
    d0 = get3(tangents, 1)
    if dot(d0, d0) > 0.0:
        x = sub(d1, d0)
        turn[n] = math.sqrt(dot(x, x))
    twist[0], twist[n] = twist[min(1, n)], twist[max(n - 1, 0)]


@inner
def tensions_at(T, past, a, i):
    """Lowest tension beside node i now, and as foreseen, N; -1 where one is not a number."""
    n = T.shape[0]
    c = min(i, n - 1)
    now, ahead = T[c], T[c] + a * (T[c] - past[c])
    if 0 < i < n:
        before = T[i - 1] + a * (T[i - 1] - past[i - 1])
        ahead = before if not ahead < before else ahead
        now = T[i - 1] if not now < T[i - 1] else now
        if not T[i] + before < math.inf:  # a NaN must not hide behind a number
            now = -1.0
    return now, min(now, ahead)


@inner
def kink_at(line, turn, i):
    """Turn of node i, rad, without what the curvature on both sides of it makes of it."""
    n = line.h.shape[0]
    smooth = 0.0
    if i > 1:
        smooth = turn[i - 1] / line.hn[i - 1]
    if i < n - 1:
        smooth = min(smooth, turn[i + 1] / line.hn[i + 1]) if i > 1 else turn[i + 1] / line.hn[i + 1]
    return max(turn[i] - smooth * line.hn[i], 0.0)


class NodeKinds(NamedTuple):
    """What the criteria know of the nodes of a line."""

    EI: Floats  # (N+1,) N m2
    GJ: Floats  # (N+1,) N m2, the smaller one where it jumps; 0: twist has no meaning
    w: Floats  # (N+1,) N/m, weight per length
    bent: Floats  # (N+1,) 1/m, curvature without stress
    node: NDArray[np.int8]  # (N+1,) SMOOTH, STEP, LOAD or HINGE
    floor: Floats  # (N+1,) N, tension floor
    base_of_cell: NDArray[np.int64]  # (N,)
    free: NDArray[np.int8]  # (n,) of base cells
    turn: Floats  # (N+1,) rad, turns of nodes (written)
    twisting: Floats  # (N+1,) N m, torques of nodes (written)
    twist: Floats  # (N+1,) rad/m, of rods, and of what would be a rod under the torque of the line (written)
    curvature: Floats  # (N+1,) 1/m, of inner nodes; with what joints take of it, where that is asked (written)


def blank_kinds(cells: int, base: int) -> NodeKinds:
    """Room for what criteria know of a line of so many cells and base cells."""
    z, nodes = np.zeros, cells + 1
    node, base_of_cell, free = z(nodes, np.int8), z(cells, np.int64), z(base, np.int8)
    (EI, GJ, w, bent), (turn, twisting, twist, curvature) = z((4, nodes)), z((4, nodes))
    return NodeKinds(EI, GJ, w, bent, node, z(nodes), base_of_cell, free, turn, twisting, twist, curvature)


@inner
def is_joint(line, kinds, i):
    """Whether a rod and a catenary meet at inner node i, and nothing else is there."""
    return line.spin[i] != line.spin[i - 1] and kinds.node[i] != LOAD


@inner
def layer_part(line, T, j, way):
    """f of the cell before node j of a rod (kernels.laws.closed_forms)."""
    c = min(j, j - way)
    return fade(line.h[c] * line.h[c] * T[c] / max(line.kb[j, 0] * line.hn[j], 1e-300))


@inner
def put_layer_back(line, T, kinds, i):
    """Curvature of joint i and of the rod beside it with what the joint takes of it."""
    n, kappa, way = line.h.shape[0], kinds.curvature, 1 if line.spin[i] else -1
    outer, j = i - way, i + way
    if not (0 < outer < n and 0 < j < n) or line.spin[min(outer, outer - way)] != 0:  # a catenary of one cell
        return
    part = layer_part(line, T, j, way)
    EI, tension = line.kb[j, 0] * line.hn[j], T[min(j, i)]
    before = stiffness_share(EI, tension, line.hn[i], line.h[min(outer, i)])
    after = stiffness_share(EI, tension, line.hn[i], line.h[min(j, i)])
    missing = there = at_hinge(kinds.turn[i] / line.hn[i], 1.0, kappa[outer], before, after, part)
    kappa[i] = there
    while 0 < j < n and line.element[j] and missing > FADED * there:
        missing *= part
        kappa[j] += missing
        j += way
        if 0 < j < n:
            part = layer_part(line, T, j, way)


@inner
def find_curvature(line, T, kinds, layers):
    """Curvature of inner nodes; layers: with the layers at joints put back."""
    n = line.h.shape[0]
    for i in range(1, n):
        kinds.curvature[i] = kinds.turn[i] / line.hn[i]
    if layers:
        for i in range(1, n):
            if is_joint(line, kinds, i):
                put_layer_back(line, T, kinds, i)


@inner
def bends_at(line, kinds, shares, layers, i):
    """|kappa''| at inner node i, 1/m^3, where curvature counts; without layers none beside a joint, which has a kink."""
    if not (shares[CURVATURE] < math.inf and 1 < i < line.h.shape[0] - 1):
        return 0.0
    if layers or line.spin[i - 2] == line.spin[i + 1]:
        kappa = kinds.curvature
        return second_slope(line.s, i, kappa[i - 1], kappa[i], kappa[i + 1])
    return 0.0


@inner
def left_at_hinge(line, T, kinds, i):
    """Curvature, 1/m, by which the layer that results take away at end i may be wrong.

    It goes on to the next change of section or joint, where what is left of it is missing, and is that of a tension that
    changes little within sqrt(EI/T): about a quarter of what it changes by there.
    """
    n, way, j = line.h.shape[0], 1 if i == 0 else -1, 1 if i == 0 else line.h.shape[0] - 1
    end, depth, part, kappa = min(i, n - 1), 0.0, 1.0, node_curvature(line, kinds.turn, min(max(j, 1), n - 1))
    first = last = T[end]
    while part > FADED:
        c = min(j, j - way)
        if T[c] <= 0.0 or not 0 < j < n:
            return kappa * part
        if part > SHOWS:
            last = T[c]
        depth += depth_of(T[c], kinds.EI[i], line.h[c])
        part = left_of(depth, T[c], first)
        joint = not line.spin[end] and line.spin[min(j, j + way)] != 0
        if part > FADED and (kinds.node[j] == STEP or joint):
            return kappa * part
        j += way
    return kappa * min(BY_TENSION * abs(last - first) / min(first, last), 1.0)


@inner
def lack_of_node(line, kinds, shares, layers, i, T, tensions):
    """What a catenary would lack at node i, at tension T, N; and the criterion that this is.

    tensions: (N,) N, of all cells.

    layers: what joints and hinges take of curvature is in results.
    """
    n, turn, EI, w = line.h.shape[0], kinds.turn, kinds.EI[i], kinds.w[i]
    along = shares[CURVATURE] < math.inf or shares[MOMENT] < math.inf
    if i == 0 or i == n:
        lack = lack_at_clamp(EI, w, T, turn[i])
        if kinds.node[i] == HINGE and layers:  # the layer in which it fades is taken away in results
            return CellError(0.0, 0.0, left_at_hinge(line, tensions, kinds, i) if along else 0.0, 0.0), CLAMP
        if along and not line.element[i] and turn[i] == 0.0:  # a pin, where the curvature of a rod fades away
            k = min(max(i, 1), n - 1)
            lack = CellError(0.0, 0.0, node_curvature(line, turn, k), 0.0)
        if along and line.element[i]:
            kappa = turn[i] / line.hn[i]
            lack = CellError(lack.position, lack.tension, kappa, EI * kappa)
        return lack, CLAMP
    kappa = kinds.curvature[i]
    if layers and is_joint(line, kinds, i):  # what its kink takes of curvature and moment is put back in results
        lack = lack_at_kink(EI, w, T, kink_at(line, turn, i))
        bent = lack_of_bend(EI, w, T, 0.0, bends_at(line, kinds, shares, layers, i))
        return CellError(lack.position, lack.tension, bent.curvature, 0.0), POINT
    if kinds.node[i] == LOAD or line.spin[i] != line.spin[i - 1]:  # a joint has a kink too
        lack = lack_at_kink(EI, w, T, kink_at(line, turn, i))
        if along and line.element[i]:
            lack = CellError(lack.position, lack.tension, kappa, EI * kappa)
        return lack, POINT
    lack = lack_of_bend(EI, w, T, kappa + kinds.bent[i], bends_at(line, kinds, shares, layers, i))
    return lack, POINT if kinds.node[i] == STEP else BEND


@inner
def weigh_edge(line, sea, state, kinds, shares, layers, i, T, ratios):
    """Raise the ratio of the base cells at inner node i, if contact with the seabed begins beside it.

    layers: cells stay, and rods would have the same.
    """
    p, r = depth(sea, state.r, i) > 0.0, state.r
    if p != (depth(sea, r, i - 1) > 0.0) or p != (depth(sea, r, i + 1) > 0.0):
        of = kinds.base_of_cell
        h = min(line.h[i - 1], line.h[i]) if layers else 0.0
        lack = lack_at_edge(kinds.EI[i], kinds.w[i], T, sea.stiffness, h)
        raise_ratio(ratios, EDGE, of[i - 1], of[i], over_shares(lack, shares))


@inner
def shift_per_length(turn):
    """By how much an edge moves when the line between it and a held place is longer by one; turn: rad, of that line.

    Of a catenary that leaves the bed at a and is held at (X, Y), u = asinh(tan(turn)), C = cosh u, S = sinh u:
    da = ((1 - C) dX + (S - C u) dY)/((u - S) S + (C - 1)^2).  The largest of all directions; 6/u^2 of a shallow one.
    """
    u = math.asinh(math.tan(min(max(turn, 1e-3), 1.5)))
    if u < 0.1:  # the difference of large numbers
        return 6.0 / (u * u)
    C, S = math.cosh(u), math.sinh(u)
    return math.sqrt((C - 1.0) ** 2 + (C * u - S) ** 2) / ((u - S) * S + (C - 1.0) ** 2)


@inner
def weigh_span(line, sea, state, kinds, shares, edge, far, ratios):
    """Raise the ratios of edges between node `edge`, where the line leaves the bed, and `far`, where it is held.

    A rod reaches further than a catenary by the integral of lam^2 kappa^2 (docs/theory.md, 13).  By that, over all that
    is catenary, the edge is elsewhere, and so is the curvature that begins there.
    """
    of, way = kinds.base_of_cell, 1 if far > edge else -1
    first, last = (edge, far - 1) if way > 0 else (edge - 1, far)
    d0, most = chord(get3(state.e, first))[0], 0.0
    for c in range(first, last + way, way):
        d = chord(get3(state.e, c))[0]
        most = max(most, math.acos(min(max(dot(d0, d), -1.0), 1.0)))
    before, after = max(edge - 1, 0), min(edge, line.h.shape[0] - 1)
    T = max(min(state.T[before], state.T[after]), kinds.floor[edge], 1e-300)
    rounded = layer_length(kinds.EI[edge], kinds.w[edge], T) + edge_length(T, sea.stiffness)
    allowed = shares[CURVATURE] * T * max(rounded, line.h[before], line.h[after]) / max(kinds.w[edge], 1e-300)
    shift, per_length = 0.0, shift_per_length(most)
    for i in range(far - way, edge, -way):
        kappa = kinds.curvature[i]
        T = max(min(state.T[i - 1], state.T[i]), kinds.floor[i], 1e-300)
        shift += per_length * kinds.EI[i] * kappa * kappa / T * line.hn[i]
        raise_ratio(ratios, EDGE, of[i - 1], of[i], shift / allowed)


@inner
def weigh_shifts(line, sea, state, kinds, shares, ratios):
    """`weigh_span` of every stretch above the bed; of one between two edges each half."""
    n, begins, edge = line.h.shape[0], 0, False
    for i in range(n + 1):
        if depth(sea, state.r, i) > 0.0 or i == n:
            ends = i < n or depth(sea, state.r, i) > 0.0
            if i - begins > 1 and (edge or ends):
                middle = (begins + i) // 2 if edge and ends else (i if edge else begins)
                if edge:
                    weigh_span(line, sea, state, kinds, shares, begins, middle, ratios)
                if ends:
                    weigh_span(line, sea, state, kinds, shares, i, middle, ratios)
            begins, edge = i, True


@inner
def raise_ratios(line, sea, state, past, ahead, shares, layers, kinds, ratios):
    """Raise ratios (criteria, base cells) to those of a state: the largest of every criterion in each base cell.

    past: (N,) N, tensions some time ago; ahead: how far their change since then goes on; shares: (4,) of
    kernels.mesh.cell_errors; layers: whether what joints take of curvature counts; kinds: with the turns of this state.
    """
    a = ahead
    floor, of, turn, twisting = kinds.floor, kinds.base_of_cell, kinds.turn, kinds.twisting
    n = state.e.shape[0]
    whole = 0.0
    for i in range(n + 1):
        whole += turn[i]
    for i in range(n + 1):
        ja, jb = of[max(i - 1, 0)], of[min(i, n - 1)]
        now, ahead = tensions_at(state.T, past, a, i)
        slack = min(floor[i] / ahead, FORESEEN) if ahead > 0.0 else FORESEEN
        if not floor[i] <= slack * now:
            slack = floor[i] / now if now > 0.0 else MOST
        raise_ratio(ratios, SLACK, ja, jb, slack)
        T = max(floor[i], 1e-300)
        T = now if now > T else T
        lack, criterion = lack_of_node(line, kinds, shares, layers, i, T, state.T)
        raise_ratio(ratios, criterion, ja, jb, over_shares(lack, shares))
        if i == 0 or i == n:
            continue
        loop = twisting[i] * twisting[i] / (4.0 * kinds.EI[i] * TWISTED * T)
        loop = max(loop, over_shares(lack_of_torque(T, twisting[i], whole), shares))
        raise_ratio(ratios, TORSION, ja, jb, loop)
        if line.bits & SEABED:
            weigh_edge(line, sea, state, kinds, shares, layers, i, T, ratios)
    if line.bits & SEABED and shares[CURVATURE] < math.inf:
        weigh_shifts(line, sea, state, kinds, shares, ratios)


@inner
def largest_ratio(line, kinds, ratios):
    """The largest ratio among base cells that are catenary and free."""
    highest_ratio = 0.0
    for i in range(line.spin.shape[0]):
        j = kinds.base_of_cell[i]
        if not line.spin[i] and kinds.free[j]:
            for c in range(ratios.shape[0]):
                highest_ratio = max(highest_ratio, ratios[c, j])
    return highest_ratio


@kernel
def twist_of_rods(line, frames, e, a1):
    """Twist of all elements, rad; frames: (2, 9) of the ends."""
    n = e.shape[0]
    twist = 0.0
    for i in range(n + 1):
        if line.element[i]:
            Ra, Rb = get9(frames, 0), get9(frames, 1)
            if i > 0:
                Ra = frame(get3(a1, i - 1), chord(get3(e, i - 1))[0])
            if i < n:
                Rb = frame(get3(a1, i), chord(get3(e, i))[0])
            twist += log_rotation(relative_rotation(Ra, Rb))[2]
    return twist


# A rod begins with this part of its stiffness: with none its cells could spin freely.
FIRST = 1e-3


@inner
def moved(x, leaving, ramp_factor, dt):
    x += -dt if leaving else dt * ramp_factor
    return min(max(x, 0.0), 1.0)


@kernel
def advance(grown, leaving, ramp_factor, dt):
    """Move all on by dt."""
    for j in range(grown.size):
        grown[j] = moved(grown[j], leaving[j], ramp_factor[j], dt)


@kernel
def shares(grown, leaving, ramp_factor, dt, base_of_cell, out):
    """Parts of the stiffness (N+1,) of nodes, dt from now: smooth in time, of the softer cell beside a node."""
    n = base_of_cell.size
    before = 1.0
    for i in range(n):
        j = base_of_cell[i]
        x = moved(grown[j], leaving[j], ramp_factor[j], dt)
        part = max(x * x * (3.0 - 2.0 * x), FIRST)
        out[i] = min(before, part) if i > 0 else part
        before = part
    out[n] = before


@kernel
def length_defect(lack, rate, since, keeps, t, duration, true, h):
    """Lengths h (N,) m at t of cells on their way to their true ones; whether any is still under way.

    A quintic from value and rate at `since` to rest at nothing, or, where `keeps`, at the value, after `duration`.
    """
    going = False
    for c in range(h.size):
        x = (t - since[c]) / duration
        if x < 1.0:
            going = True
            x = max(x, 0.0)
            y = (1.0 - x) ** 3
            value = 1.0 if keeps[c] else 1.0 - x**3 * (10.0 - 15.0 * x + 6.0 * x * x)
            h[c] = true[c] - lack[c] * value - duration * rate[c] * x * y * (1.0 + 3.0 * x)
        else:
            h[c] = true[c] - (lack[c] if keeps[c] else 0.0)
    return going


@kernel
def soften(part, stiff, kb):
    """Bending in kb (N+1, 3) = part (N+1,) of stiff (N+1, 3); torsion is all there, so that no torque is lost."""
    for i in range(part.size):
        for k in range(2):
            kb[i, k] = part[i] * stiff[i, k]
        kb[i, 2] = stiff[i, 2]


@kernel
def freed(line, part, stiff, before, after):
    """Energy, J, that a step puts in whose stiffness line.kb is not what it was before, `part` of stiff.

    before, after: strains (N+1, 3) rad at the two ends of the step, from what has no stress.
    """
    total = 0.0
    for i in range(part.size):
        x = energy_share(line, i, math.sqrt(before[i, 0] ** 2 + before[i, 1] ** 2))
        y = energy_share(line, i, math.sqrt(after[i, 0] ** 2 + after[i, 1] ** 2))
        for k in range(2):
            more = line.kb[i, k] - part[i] * stiff[i, k]
            total += more * (x * before[i, k] ** 2 + y * after[i, k] ** 2)
    return 0.25 * total
