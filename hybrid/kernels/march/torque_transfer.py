"""Torque when zones change: directors of rods that are new, turns of zones that are new (docs/theory.md, 15).

Along the old line the twist is known everywhere: how far its directors turn against one that is carried along the chords
by the smallest rotations, and in zones the share of their turn.  New rods are twisted by it, and new zones begin with
what of it lies between the frames beside them, so that no turn is lost either way.
"""

from __future__ import annotations

import math

from hybrid.kernels.algebra.rotations import cross, dot, get3, spin_about, transport
from hybrid.kernels.laws.cell import chord
from hybrid.kernels.laws.tension_torque import couples
from hybrid.kernels.machine.compile import inner, kernel
from hybrid.kernels.march.zone_torque import FIRST, LAST, TURN, carry, frame_after, frame_before, twist_of_tensions


@inner
def angle_from(a, b, d):
    """Angle (rad, less than half a turn) about d from director a to b."""
    return math.atan2(dot(cross(a, b), d), dot(a, b))


@inner
def find_twist(line, ends, state, twist):
    """Twist (N+2,) rad of a line's cells against the frame of the start, and of the frame of the end."""
    n, zone, zones = line.h.shape[0], 0, line.torsion.shape[0]
    director, d = frame_before(line, ends, state, 0)
    total, c = 0.0, 0
    twist[0] = 0.0
    while c <= n:
        if zone < zones and c == line.torsion[zone, FIRST]:
            b = int(line.torsion[zone, LAST])
            low = line.s[0] if c == 0 else 0.5 * (line.s[c - 1] + line.s[c])
            high = line.s[n] if b == n else 0.5 * (line.s[b] + line.s[b + 1])
            # the twist by tension is as that is along the zone, the rest spread evenly
            by_tension = twist_of_tensions(line, state.T, 0, zone)
            less = line.tension_twist[c - 1] * state.T[c - 1] if couples(line) and c > 0 else 0.0
            for i in range(c, b):
                if couples(line):
                    less += line.tension_twist[i] * state.T[i]
                part = (0.5 * (line.s[i] + line.s[i + 1]) - low) / (high - low)
                twist[i + 1] = total + part * (state.turn[zone, TURN] + by_tension) - less
                if couples(line):
                    less += line.tension_twist[i] * state.T[i]
            total += state.turn[zone, TURN]
            c, zone = b, zone + 1
            director, d = frame_after(line, ends, state, c)
        else:
            here, dn = frame_after(line, ends, state, c)
            moved, _ = carry(director, d, dn)
            total += angle_from(moved, here, dn)
            director, d = here, dn
        twist[c + 1] = total
        c += 1


@inner
def middle(line, c):
    """Arc length (m) that the frame of cell c stands for; c = -1 and N: the ends."""
    n = line.h.shape[0]
    if c < 0:
        return line.s[0]
    return line.s[n] if c == n else 0.5 * (line.s[c] + line.s[c + 1])


@inner
def twist_at(line, twist, x, c):
    """Twist at the arc length x (m): linear between the middles of cells, from c on; and where it was found."""
    while c < line.h.shape[0] and middle(line, c) < x:
        c += 1
    low, high = middle(line, c - 1), middle(line, c)
    part = min(max((x - low) / (high - low), 0.0), 1.0)
    return (1.0 - part) * twist[c] + part * twist[c + 1], c


@inner
def is_kept(line, target, c, o):
    """Whether cell c of the target is the same cell of a rod as cell o of the line."""
    n = line.h.shape[0]
    return (
        o < n
        and line.spin[o] != 0
        and target.spin[c] != 0
        and line.s[o] == target.s[c]
        and line.s[o + 1] == target.s[c + 1]
    )


@inner
def twist_rods(line, target, ends, out, twist):
    """Directors of the rod cells of the target that are new, from the frame before them to the one after them."""
    n = target.h.shape[0]
    p, at, o = 0, 0, 0
    before, at = twist_at(line, twist, target.s[0], at)
    while p < n:
        while o < line.h.shape[0] and line.s[o + 1] <= target.s[p]:
            o += 1
        x, at = twist_at(line, twist, middle(target, p), at)
        if is_kept(line, target, p, o):
            before = x
            p += 1
            continue
        q, low = p, before  # cells p to q - 1 are new, of rods or catenaries
        director, d = frame_before(target, ends, out, p)
        while q < n and not is_kept(line, target, q, o):
            dn, _, _ = chord(get3(out.e, q))
            x, at = twist_at(line, twist, middle(target, q), at)
            director = spin_about(transport(director, d, dn), dn, x - low)
            out.a1[q, 0], out.a1[q, 1], out.a1[q, 2] = director
            d, low = dn, x
            q += 1
            while o < line.h.shape[0] and q < n and line.s[o + 1] <= target.s[q]:
                o += 1
        last, dn = frame_after(target, ends, out, q)
        x, at = twist_at(line, twist, middle(target, q), at)
        left = angle_from(spin_about(transport(director, d, dn), dn, x - low), last, dn)
        begin, end = middle(target, p - 1), middle(target, q)
        for c in range(p, q):  # what is left, because chords are others than before, is spread
            d, _, _ = chord(get3(out.e, c))
            part = left * (middle(target, c) - begin) / (end - begin)
            out.a1[c, 0], out.a1[c, 1], out.a1[c, 2] = spin_about(get3(out.a1, c), d, part)
        before, p = x, q


@kernel
def carry_torque(line, target, ends, state, out, twist):
    """Give a state on new zones the twist of that on the old ones; what is kept of `out` has been carried before.

    line, state: as they were; target, out: as they are, with directors of rod cells that stay; both ends hold the
    twist.  twist: (N+2,) of the old line, to work in.  Directors of catenary cells are written as well.
    """
    find_twist(line, ends, state, twist)
    twist_rods(line, target, ends, out, twist)
    at = 0
    for z in range(target.torsion.shape[0]):
        a, b = int(target.torsion[z, FIRST]), int(target.torsion[z, LAST])
        director, d = frame_before(target, ends, out, a)
        low, at = twist_at(line, twist, middle(target, a - 1), at)
        high, at = twist_at(line, twist, middle(target, b), at)
        for i in range(a, b):
            dn, _, _ = chord(get3(out.e, i))
            director, _ = carry(director, d, dn)
            d = dn
        last, dn = frame_after(target, ends, out, b)
        director, _ = carry(director, d, dn)
        turn = angle_from(director, last, dn)
        out.turn[z, TURN] = turn + 2.0 * math.pi * math.floor((high - low - turn) / (2.0 * math.pi) + 0.5)
