"""What a line has on both sides of its nodes: tension at its ends, curvature, twist, torque; of steps and of outputs.

Rods have curvature by their elements, catenaries that of the circle that two of their chords are tangents of.  Where no
element sits it follows from the moment that is given there; where sections meet the moment is one; at what may be a
kink of a catenary it is what the nodes inside lead to.  Rods have what joints take of it, catenaries have not what
fades at their ends (kernels.laws.closed_forms).  Its sign says whether it is against the bend that was computed.

    symbol   meaning                                                               unit
    k        log strain of the element at a node (laws.element)                    rad
    M        moment that is given at an end; of its element                        N m
    i, side  node, and the side of it, -1 or 1; j the next node on that side
    passed   torque that a catenary passes on at a node                            N m

A state has e, T, a1 (and v, w where stiffness damps), books have strains, marks and hinges: those of a run, or an output.

Curvature of rods whose stiffness is on its way in or out is what the line would have if it had all of it.
Where a rod has grown past a joint, the kink of that joint stays until the stiffness of its element has come: a bend of
one cell that no rod has.  The same forces across the line are in balance with its turns now and with all of the stiffness:

    T w^_i - D(K w^)_i = T w_i - D(p K w)_i,    D(M)_i = (M_i+1 - M_i)/h_i - (M_i - M_i-1)/h_i-1

Hence w^ = p w + M/K, where M is what its neighbours bear of what an element lacks:

    (T/K)_i M_i - D(M)_i = T_i (1 - p_i) w_i

A joint has p = 0; of the catenary behind it the curvature of its next node goes on, as in kernels.laws.closed_forms.
Beyond a clamp there is no cell, and an end without a clamp has M = 0.  It is exact for small turns at rest.

    symbol  meaning                                                                             unit
    w, w^   turn of the chords at a node now; with all of the stiffness; vectors across both    rad
    p       part of the bending stiffness that an element has; its torsion has all of it        1
    K       all of that stiffness: EI over the length of the node                               N m
    M       see above                                                                           N m
    T, h    tension at a node; length of a cell                                                 N, m

Columns of books.strains while it is solved, from the first node on: M_i = d_i - c_i M_i+1.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hybrid.kernels.algebra.rotations import add, cross, dot, get3, get9, scale, sub, vector
from hybrid.kernels.laws.bending_law import (
    RIGID,
    curvature_under,
    elastic_moment,
    give_of_spring,
    has_bend_law,
    own_strain,
    parts_without_spring,
    slips,
)
from hybrid.kernels.laws.closed_forms import FADED, FARTHEST, at_hinge, depth_of, fade, left_of, stiffness_share
from hybrid.kernels.laws.element import chord, frames_at, strain_of_element
from hybrid.kernels.laws.tension_torque import couples, rest_strain
from hybrid.kernels.machine.compile import called, inner, kernel
from hybrid.kernels.march.zone_torque import FIRST, LAST, TORQUE
from hybrid.kernels.state.books import SEAM
from hybrid.kernels.state.report import FORCE_A, PLANAR
from hybrid.kernels.state.state import Floats

# --- rods whose stiffness is on its way in or out ----------------------------------------------

# Columns of books.strains.
RAW = 0  # curvature of elements
BENT = 3  # curvature of results
C = 4  # c and d of above
D = 5
WHOLE = 1.0 - 1e-9  # p from which on a rod has all of its stiffness
LINE = 2  # first row of books.hinges of pieces of the line
EI, END, GJ = range(3)  # columns of these
FOLDED = 1e-12  # 1 + cos(x) of cells that are as good as folded onto each other
SLACK = 2.5e-5  # least h T/K, for lines with hardly any tension: M fades within some 200 cells


class Rods(NamedTuple):
    """Of a state and of `Books` what is needed here: the same of a step and of an output."""

    e: Floats
    T: Floats
    strains: Floats
    hinges: Floats
    marks: NDArray[np.int8]


@inner
def of_chords(line, e, i):
    """Curvature, 1/m, at node i of the circle that its two chords are tangents of."""
    d, _, _ = chord(get3(e, i - 1))
    dn, _, _ = chord(get3(e, i))
    s, cosine = cross(d, dn), 1.0 + dot(d, dn)
    half = math.sqrt(dot(s, s)) / cosine if cosine > FOLDED else math.sqrt(2.0 / FOLDED)  # tan(x/2)
    return 2.0 * half / line.hn[i]


@inner
def across(a, b):
    """Direction across a and b."""
    x = cross(a, b)
    length = math.sqrt(dot(x, x))
    return scale(1.0 / length, x) if length > 0.0 else (0.0, 1.0, 0.0)


@called
def bend_direction(line, e, i):
    """Direction across both chords at inner node i; of a line in a plane its normal, or against it."""
    a, b = chord(get3(e, i - 1))[0], chord(get3(e, i))[0]
    if line.bits & PLANAR:
        normal = get3(line.plane, 2)
        return normal if dot(normal, cross(a, b)) >= 0.0 else scale(-1.0, normal)
    return across(a, b)


@inner
def bend_at(line, ends, rods, i):
    """Curvature of the chords at a node of a rod, a vector, 1/m; 0 at an end without an element."""
    n = line.h.shape[0]
    if 0 < i < n:
        size = rods.strains[i, RAW] if line.element[i] else of_chords(line, rods.e, i)
        return scale(size, bend_direction(line, rods.e, i))
    if not line.element[i]:
        return (0.0, 0.0, 0.0)
    R, d = get9(ends.frame, 0 if i == 0 else 1), chord(get3(rods.e, min(i, n - 1)))[0]
    t = (R[2], R[5], R[8])
    return scale(rods.strains[i, RAW], across(t, d) if i == 0 else across(d, t))


@inner
def piece_at(pieces, s):
    """Row of `pieces`, books.hinges, of the piece that lies at s (m)."""
    low, high = LINE, pieces.shape[0] - 1
    while low < high:
        middle = (low + high) // 2
        if s < pieces[middle, END]:
            high = middle
        else:
            low = middle + 1
    return low


@inner
def part_of_stiffness(line, i, pieces):
    """p of the element at node i, 1 where it has all of its stiffness or that is not known; pieces: books.hinges."""
    if not line.element[i] or pieces[LINE, EI] <= 0.0:
        return 1.0
    a, b, s = max(i - 1, 0), min(i, line.h.shape[0] - 1), line.s
    j = piece_at(pieces, 0.5 * (s[a] + s[a + 1]))
    half = 0.5 * line.h[a]
    bends, twists = half / pieces[j, EI], half / pieces[j, GJ]  # by a moment, rad per N m
    if a != b:
        k, half = piece_at(pieces, 0.5 * (s[b] + s[b + 1])), 0.5 * line.h[b]
        bends, twists = bends + half / pieces[k, EI], twists + half / pieces[k, GJ]
    else:  # an angular spring at a clamp does not twist
        bends = line.hn[i] / pieces[j, EI]
    if line.kb[i, 2] > 0.0:  # of no swivel: all of its torsion is there, whatever lengths are under way
        bends /= twists * line.kb[i, 2]
    part = line.kb[i, 0] * bends
    return part if 0.0 < part < WHOLE else 1.0


@inner
def all_stiffness(line, i, pieces, way):
    """K of node i; at a joint of the rod on its side `way` (-1, 1)."""
    j = i if line.element[i] else i + way
    return line.kb[j, 0] / part_of_stiffness(line, j, pieces) * (line.hn[j] / line.hn[i])


@inner
def balance(line, ends, rods, i, a, b):
    """Diagonal and right side of the balance of node i of the rod from node a to b, if a is not an end that turns."""
    h, pieces, inside = line.h, rods.hinges, a < i < b
    way = 1 if i == a else -1
    K, rod = all_stiffness(line, i, pieces, way), min(max(i, a), b - 1)
    T = 0.5 * (rods.T[i - 1] + rods.T[i]) if inside else rods.T[rod]
    T = max(T, SLACK * K / h[rod])
    lack = 1.0 - part_of_stiffness(line, i, pieces) if line.element[i] else 1.0
    rhs = scale(T * lack * line.hn[i], bend_at(line, ends, rods, i))
    diagonal = T / K + (1.0 / h[i - 1] if i > a else 0.0) + (1.0 / h[i] if i < b else 0.0)
    outer = i - way
    if not inside and is_smooth(line, rods.marks, outer):
        cell = 1.0 / h[min(i, outer)]
        diagonal += cell
        rhs = add(
            rhs, scale(K * line.hn[i] * cell * of_chords(line, rods.e, outer), bend_direction(line, rods.e, outer))
        )
    return diagonal, rhs


@inner
def turns_freely(line, i):
    """Whether node i is an end of the line that has no moment, or one that is given."""
    return (i == 0 or i == line.h.shape[0]) and not line.element[i]


@kernel
def restore_rod(line, ends, rods, a, b):
    """Enter into column BENT the curvature of the rod from node a to b with all of its stiffness.

    Of joints into RAW as well: on the side of the catenary it is the same.
    """
    bent, pieces, h, n = rods.strains, rods.hinges, line.h, line.h.shape[0]
    for i in range(a, b + 1):
        if turns_freely(line, i):
            for k in range(4):
                bent[i, C + k] = 0.0
            continue
        diagonal, rhs = balance(line, ends, rods, i, a, b)
        if i > a:
            diagonal -= bent[i - 1, C] / h[i - 1]
            rhs = add(rhs, scale(1.0 / h[i - 1], vector(bent[i - 1], D)))
        bent[i, C] = 1.0 / (h[i] * diagonal) if i < b else 0.0
        for k in range(3):
            bent[i, D + k] = rhs[k] / diagonal
    M = (0.0, 0.0, 0.0)
    for j in range(b - a + 1):
        i = b - j
        M = add(vector(bent[i], D), scale(bent[i, C], M))
        bend, part = bend_at(line, ends, rods, i), 0.0
        if line.element[i]:
            part = part_of_stiffness(line, i, pieces)
        K = all_stiffness(line, i, pieces, 1 if i == a else -1)
        whole = add(scale(part, bend), scale(1.0 / (K * line.hn[i]), M))
        bent[i, BENT] = math.copysign(math.sqrt(dot(whole, whole)), dot(whole, bend))
        if not line.element[i] and 0 < i < n:
            bent[i, RAW] = abs(bent[i, BENT])


@kernel
def restore_stiffness(line, ends, rods):
    """`restore_rod` of all rods with an element that has not all of its stiffness, if that is known."""
    n, pieces, a = line.h.shape[0], rods.hinges, 0
    while pieces[LINE, EI] > 0.0 and a < n:
        if not line.spin[a]:
            a += 1
            continue
        b, soft = a + 1, False
        while b < n and line.spin[b]:
            soft |= line.kb[b, 2] > 0.0 and part_of_stiffness(line, b, pieces) < WHOLE
            b += 1
        if soft:
            restore_rod(line, ends, rods, a, b)
        a = b


# --- sides of nodes ----------------------------------------------------------------------------

SAME_PLACE = 1e-9  # part of a length
SAME = 1e-12  # part of a curvature: round-off
# First of two columns of books.strains that elements use: at nodes of catenaries the part that is left of the layer at
# either end, at that end its curvature, 1/m.
LAYER = 1


@inner
def beyond(T, h, near, far):
    """Tension where cell `near` ends, from the middles of two neighbours."""
    return T[near] + (T[near] - T[far]) * h[near] / (h[near] + h[far])


@inner
def beside(T, h, marks, i, side):
    """Tension at node i as the cells on its side (-1, 1) lead to, up to the next kink."""
    near = i - 1 if side < 0 else i
    far = near + side
    if not 0 <= far < h.shape[0] or marks[i + side]:
        far = near
    return beyond(T, h, near, far)


@inner
def second_cell(h, marks, k):
    """The cell from which, beside that at end k, values at the end are extrapolated: none across a kink."""
    n = h.shape[0]
    first = k * (n - 1)
    if n == 1 or marks[n - 1 if k else 1]:
        return first
    return first + 1 - 2 * k


@inner
def beyond_spring(t, d, line, ends, state, i):
    """Tangent of the line at a clamp with tangent t: between it and the chord d, if an angular spring at node i turns."""
    cosine = min(max(dot(t, d), -1.0), 1.0)
    angle = math.acos(cosine)
    x, y = angle, 0.0
    if slips(line, i) and give_of_spring(line, i) > 0.0:
        Ra, Rb = frames_at(line, ends, state, i)
        k = strain_of_element(Ra, Rb, get3(line.kb, i), get3(line.k0, i), i)
        x, y = k[0] - line.k0[i, 0], k[1] - line.k0[i, 1]
    part = parts_without_spring(line, i, x, y)[0]
    if part > RIGID or angle < 1e-6:
        return t
    return add(scale(math.sin(part * angle), t), scale(math.sin((1.0 - part) * angle), d))


@called
def end_tension(line, ends, state, report, loaded, marks, k):
    """Tension at an end: the force of what holds or loads it along the tangent; beside a body, that of the cable."""
    n = line.h.shape[0]
    first, second = k * (n - 1), second_cell(line.h, marks, k)
    if loaded[k] and (ends.held[k] == 1 or (ends.held[k] == 0 and not line.element[k * n])):  # a support bears it, too
        return beyond(state.T, line.h, first, second)
    d, _, _ = chord(get3(state.e, first))
    d2, _, _ = chord(get3(state.e, second))
    t = sub(scale(1.5, d), scale(0.5, d2))
    if line.element[k * n]:
        R = get9(ends.frame, k)
        t = beyond_spring((R[2], R[5], R[8]), d, line, ends, state, k * n)
    at = FORCE_A + 3 * k
    return (1.0 - 2.0 * k) * dot((report[at], report[at + 1], report[at + 2]), t) / math.sqrt(dot(t, t))


@inner
def is_smooth(line, marks, i):
    """Whether node i lies inside a catenary, away from loads and changes of section."""
    n = line.h.shape[0]
    return 0 < i < n and not line.element[i] and not line.spin[i - 1] and not line.spin[i] and not marks[i]


@called
def towards(line, state, marks, i, side):
    """Curvature at what may be a kink, node i, as the nodes on its side (-1, 1) lead to."""
    x = 0.0
    if is_smooth(line, marks, i + side):
        x = of_chords(line, state.e, i + side)
        if is_smooth(line, marks, i + 2 * side) and is_smooth(line, marks, i + 3 * side):
            there = of_chords(line, state.e, i + 2 * side)
            far = abs(line.s[i + side] - line.s[i]) / abs(line.s[i + 2 * side] - line.s[i + side])
            x = max(0.0, x + far * (x - there))
    return x


@inner
def passed_torque(line, turn, i, zone):
    """`passed` at node i, and the zone to ask for at the next one; zone: that of node i or the first behind it."""
    if zone < turn.shape[0] and i >= line.torsion[zone, FIRST]:
        return turn[zone, TORQUE], zone + (i >= line.torsion[zone, LAST])
    return 0.0, zone


@inner
def element_strain(line, ends, state, i):
    """k of the element at node i; nothing where there is none."""
    if not line.element[i]:
        return (0.0, 0.0, 0.0)
    Ra, Rb = frames_at(line, ends, state, i)
    return strain_of_element(Ra, Rb, get3(line.kb, i), get3(line.k0, i), i)


@inner
def given_moment(line, ends, i):
    """M that is given at an end of a rod without an element; inside the line nothing."""
    n = line.h.shape[0]
    if (i > 0 and i < n) or not line.spin[min(i, n - 1)]:
        return (0.0, 0.0, 0.0)
    return scale(-1.0 if i == 0 else 1.0, get3(ends.moment, 0 if i == 0 else 1))


@inner
def more_twist(line, T, marks, i, side):
    """Twist, 1/m, by which tension turns the middle of the cell on a side of an edge more than the node."""
    j, c = i + side, min(i, i + side)
    if not couples(line) or j == 0 or j == line.h.shape[0] or marks[j] or not line.spin[c + side]:
        return 0.0
    h, d = line.h, c + side
    return 2.0 * line.tension_twist[c] / h[c] * (T[c] - T[d]) * (h[c] / (h[c] + h[d]))


@called
def strain_of_moment(line, ends, state, hinges, i, side, k, passed):
    """The same of the rod on a side of node i from its moment: by the element there, or as it is given.

    Twist is that of torque and tension; where layers slip it depends on the way, and bends are those of node j.
    """
    j, c = i + side, min(i, i + side)
    if not line.element[j]:
        return 0.0, 0.0, 0.0, 0.0, 0.0
    if line.element[i]:
        mx, my = elastic_moment(line, i, k)
        torque, law, beside = line.kb[i, 2] * (k[2] - rest_strain(line, state.T, i)[2]), i, side
    else:
        d, a, M = chord(get3(state.e, c))[0], get3(state.a1, c), given_moment(line, ends, i)
        mx, my, torque = dot(a, M), dot(cross(d, a), M), dot(d, M) + passed
        law, beside = j, -side
    hn, rest = line.hn[j], get3(line.k0, j)
    a, b, twist = 0.0, 0.0, rest[2] / hn
    if line.kb[j, 2] > 0.0:
        twist += torque / (line.kb[j, 2] * hn)
    if couples(line):
        twist -= 2.0 * line.tension_twist[c] / line.h[c] * state.T[c]
    if slips(line, j):
        x = sub(element_strain(line, ends, state, j), rest)
        a, b = x[0] / hn, x[1] / hn
    elif has_bend_law(line, law):
        size = math.sqrt(mx * mx + my * my)
        part = curvature_under(line, law, beside, size) / size if size > 0.0 else 0.0
        a, b = part * mx, part * my
    else:
        part = part_of_stiffness(line, j, hinges) / hn
        a = part * mx / line.kb[j, 0] if line.kb[j, 0] > 0.0 else 0.0
        b = part * my / line.kb[j, 1] if line.kb[j, 1] > 0.0 else 0.0
    return rest[0] / hn + a, rest[1] / hn + b, twist, a, b


@inner
def is_jump(line, marks, i, side):
    """Whether sections meet at the element of node i, whose moment is one: its strain on a side is not its own."""
    return marks[i] & SEAM and line.element[i] and line.element[i + side] and not slips(line, i)


@inner
def rod_strain(line, ends, state, books, i, side, k, passed):
    """Bends and twist, 1/m, of the rod on a side of node i without layers, and its bends from what has no stress."""
    if line.element[i] and not is_jump(line, books.marks, i, side):
        return own_strain(line, i, k)
    return strain_of_moment(line, ends, state, books.hinges, i, side, k, passed)


@inner
def rod_curvature(line, books, i, side, plain):
    """Curvature, 1/m, that results have of the rod on a side of node i; plain: its size without layers.

    Where sections meet that of a rod with all of its stiffness is of one moment, too.
    """
    bent, raw, j = books.strains[i, BENT], books.strains[i, RAW], i + side
    if not line.element[i]:
        return plain if i == 0 or i == line.h.shape[0] else bent
    if not (books.marks[i] & SEAM) or not line.element[j]:
        return bent
    if bent == raw:
        return plain
    parts = part_of_stiffness(line, j, books.hinges) / part_of_stiffness(line, i, books.hinges)
    beside = line.kb[j, 0] * line.hn[j]
    return bent * (line.kb[i, 0] * line.hn[i] / beside * parts if beside > 0.0 else 1.0)


@inner
def is_touched(line, books, i, plain):
    """Whether a joint takes a part of the curvature of a rod at node i, or its element lacks stiffness."""
    if line.element[i]:
        return books.strains[i, BENT] != books.strains[i, RAW]
    return 0 < i < line.h.shape[0] and abs(abs(books.strains[i, BENT]) - plain) > SAME * plain


@inner
def catenary_curvature(line, state, books, i, side):
    """Curvature of the catenary on a side of node i: at a joint that which goes on there, less what fades at ends."""
    n, strains = line.h.shape[0], books.strains
    if is_smooth(line, books.marks, i):
        x, j = strains[i, BENT], i
    elif (i == 0 or i == n) and strains[i, LAYER] + strains[i, LAYER + 1] > 0.0:
        return 0.0
    else:
        x, j = towards(line, state, books.marks, i, side), min(max(i + side, 1), n - 1)
        if 0 < i < n and line.spin[i] != line.spin[i - 1]:
            x = strains[i, RAW]
    for end in range(2):
        part = strains[i, LAYER + end]
        if part > 0.0:
            direction = bend_direction(line, state.e, 1 + end * (n - 2))
            along = dot(bend_direction(line, state.e, j), direction)
            x = with_layer(x, -part * strains[end * n, LAYER + end], along)
    return x


@called
def strain_on_side(line, ends, state, books, i, side, k, passed):
    """Curvature and twist, 1/m, on a side of node i, bends from what has no stress, and whether these are unknown.

    Those of catenaries are, which do not know which way their sections are curved.
    """
    if not line.spin[min(i, i + side)]:
        return catenary_curvature(line, state, books, i, side), 0.0, 0.0, 0.0, True
    x, y, twist, a, b = rod_strain(line, ends, state, books, i, side, k, passed)
    plain = math.sqrt(x * x + y * y)
    return rod_curvature(line, books, i, side, plain), twist, a, b, is_touched(line, books, i, plain)


@inner
def with_layer(kappa, missing, along):
    """Curvature kappa with what a joint takes of it, in a direction of cosine `along` to it; negative: against it."""
    both = kappa + missing * along
    return math.copysign(math.sqrt(both * both + missing * missing * (1.0 - min(along * along, 1.0))), both)


@inner
def goes_on(line, marks, j, way):
    """Whether the rod goes on beyond node j, without a point load or another section."""
    return not marks[j] and line.spin[min(j, j + way)] != 0


@inner
def layer_part(line, state, j, way, EI):
    """f of the cell before node j of a rod; EI: N m2."""
    T, h = state.T[min(j, j - way)], line.h[min(j, j - way)]
    return fade(h * h * T / EI) if T > 0.0 and EI > 0.0 else 0.0


@inner
def is_hinge(line, books, k):
    """Whether the curvature of a rod would fade to nothing at end k, where a catenary of two cells or more ends."""
    n = line.h.shape[0]
    return (
        books.hinges[k, 0] > 0.0
        and n > 1
        and not line.spin[k * (n - 1)]
        and is_smooth(line, books.marks, 1 + k * (n - 2))
    )


@called
def put_layer_at_end(line, state, books, k):
    """Enter into strains[:, LAYER + k] the parts of the layer in which the curvature of a rod fades at end k."""
    n, EI, T, h, column = line.h.shape[0], books.hinges[k, 0], state.T, line.h, LAYER + k
    way, j = 1 - 2 * k, 1 + k * (n - 2)
    books.strains[k * n, column] = towards(line, state, books.marks, k * n, way)
    first, depth = T[k * (n - 1)], 0.0
    while 0 < j < n and T[min(j, j - way)] > 0.0 and not line.spin[min(j, j - way)] and first > 0.0:
        depth += depth_of(T[min(j, j - way)], EI, h[min(j, j - way)])
        part = left_of(depth, 0.5 * max(T[j - 1] + T[j], 0.0), first)
        if part <= FADED:
            break
        books.strains[j, column] = part
        if not abs(line.s[j] - line.s[k * n]) < (1.0 - SAME_PLACE) * books.hinges[k, 1]:  # another stiffness
            break
        j += way


@inner
def put_layers(line, ends, state, books):
    """Enter curvature of results into strains[:, BENT], and what fades at ends of catenaries behind LAYER.

    Of rods with what joints take of it.  At joints themselves that of the side of the catenary is in strains[:, RAW].
    """
    n, bent = line.h.shape[0], books.strains
    for i in range(n + 1):
        if line.element[i]:
            bent[i, BENT] = bent[i, RAW]
        else:
            bent[i, BENT] = of_chords(line, state.e, i) if is_smooth(line, books.marks, i) else 0.0
            bent[i, LAYER], bent[i, LAYER + 1] = 0.0, 0.0
    for k in range(2):
        if is_hinge(line, books, k):
            put_layer_at_end(line, state, books, k)
    for i in range(1, n):
        if line.spin[i] != line.spin[i - 1]:
            put_layer_back(line, ends, state, books, i, 1 if line.spin[i] else -1)


@called
def put_layer_back(line, ends, state, books, i, way):
    """Enter the curvature at the joint of node i, and what it takes of the rod on its side `way`."""
    n, bent = line.h.shape[0], books.strains
    x, y, _, _, _ = strain_of_moment(line, ends, state, books.hinges, i, way, (0.0, 0.0, 0.0), 0.0)
    own, j, outer = math.sqrt(x * x + y * y), i + way, i - way
    bent[i, RAW], bent[i, BENT] = towards(line, state, books.marks, i, -way), own
    if not (0 < j < n and is_smooth(line, books.marks, outer) and goes_on(line, books.marks, j, way)):
        return
    T, EI = state.T[min(j, i)], line.kb[j, 0] * line.hn[j]
    direction, part = bend_direction(line, state.e, outer), layer_part(line, state, j, way, EI)
    before = stiffness_share(EI, T, line.hn[i], line.h[min(outer, i)])
    after = stiffness_share(EI, T, line.hn[i], line.h[min(j, i)])
    along = dot(bend_direction(line, state.e, j), direction)
    turned = dot(bend_direction(line, state.e, i), direction)
    there = at_hinge(of_chords(line, state.e, i), turned, of_chords(line, state.e, outer), before, after, part)
    bent[i, RAW], bent[i, BENT] = there, with_layer(own, there, along)
    for _ in range(FARTHEST):
        if part <= FADED:
            break
        along = dot(bend_direction(line, state.e, j), direction)
        bent[j, BENT] = with_layer(bent[j, BENT], there * part, along)
        j += way
        if not (0 < j < n and goes_on(line, books.marks, j, way)):
            break
        part *= layer_part(line, state, j, way, line.kb[j, 0] * line.hn[j])


@called
def direction_on_side(line, e, i, side, edge, moment):
    """Direction of the curvature that was computed on a side of node i, across both chords; edge: whether it has two.

    moment: at an end of the line that across the tangent there, N m.  At ends of stretches that no element bends across
    it is that of the next node in the stretch, as at ends that are bent without a moment.
    """
    n = line.h.shape[0]
    if n == 1:
        return (0.0, 1.0, 0.0)
    outer, rod = i == 0 or i == n, line.spin[min(i, i + side)]
    if outer and rod and line.k0[i, 0] == 0.0 and line.k0[i, 1] == 0.0 and line.k0[i, 2] == 0.0:
        size = math.sqrt(dot(moment, moment))
        if size > 0.0:
            return scale(1.0 / size, moment)
    beside = outer or (edge and not (rod and line.element[i]))
    return bend_direction(line, e, min(max(i + side if beside else i, 1), n - 1))
