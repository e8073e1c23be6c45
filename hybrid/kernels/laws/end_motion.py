"""What both ends impose at a time, how far they turn on the way there, and how far the sea has grown.

    symbol   meaning                                                  unit
    r, dr    ramp 10 x^3 - 15 x^4 + 6 x^5, x = t / duration; its rate  -, 1/s
    A, w, p  amplitude, angular frequency and phase of a harmonic      m or rad, 1/s, rad
    v        rotation vector of a motion file                          rad
    eta      elevation of the surface above still water                m

A motion adds r A sin(w t + p), a steady velocity times the integral of r, a travel, the surface that it follows, and
the splines of a file.  An end on a body is where the motion of the body brings it.  A load is r times a constant, or r times what is linear between the rows of its history.  Roll, pitch and yaw turn the given frame by Rz Ry Rx, a file turns it by exp(v).  Vectors are
inertial.  scene.motion.EndMotion states the same laws in Python, for the second solver and for tests.
"""

from __future__ import annotations

import math

from hybrid.kernels.algebra.rotations import add, cross, dot, get3, get9, hat, mat_mat, mat_vec, scale, stack, transport
from hybrid.kernels.algebra.sparse_rows import interval_within
from hybrid.kernels.laws.element import chord
from hybrid.kernels.machine.compile import inner, kernel
from hybrid.kernels.state.state import NOT_ON_BODY, PLACE_THERE, RIDES, SEAT_THERE, TURNS_FREELY

# Rotation vectors shorter than this (rad) take Taylor series: the next terms are below round-off.
SMALL_VECTOR = 1e-4


@inner
def rise(t, duration):
    """The ramp r and its rate (1/s) at t; duration 0: grown from the start."""
    if duration == 0.0:
        return 1.0, 0.0
    x = min(max(t / duration, 0.0), 1.0)
    return x * x * x * (10.0 + x * (6.0 * x - 15.0)), 30.0 * x * x * (1.0 - x) ** 2 / duration


@inner
def rise_integral(t, duration):
    """The integral of r from 0 to t, s."""
    x = t / duration
    y = min(max(x, 0.0), 1.0)
    return duration * (y**4 * (2.5 + y * (y - 3.0)) + max(x - 1.0, 0.0))


@inner
def sea_at(t, sea):
    """Write how far current and waves have grown at t into sea.now; t = infinity: no waves, the current grown."""
    now = sea.now
    now[0] = t if t < math.inf else 0.0
    now[1] = rise(t, sea.ramps[0])[0]
    now[2], now[3] = rise(t, sea.ramps[1]) if t < math.inf else (0.0, 0.0)


@inner
def surface_at(t, x, y, sea):
    """Elevation eta (m) of the surface, its rate at a fixed place (m/s), and its slopes along x and y."""
    waves = sea.waves
    eta = rate = slope_x = slope_y = 0.0
    for j in range(waves.shape[0]):
        A, w, kx, ky = waves[j, 0], waves[j, 1], waves[j, 2], waves[j, 3]
        angle = kx * x + ky * y - w * t + waves[j, 4]
        up, down = A * math.cos(angle), A * math.sin(angle)
        eta += up
        rate += w * down
        slope_x -= kx * down
        slope_y -= ky * down
    r, dr = rise(t, sea.ramps[1])
    return r * eta, r * rate + dr * eta, r * slope_x, r * slope_y


@inner
def harmonics_at(t, k, first, moves):
    """Sums (3,) of the harmonics about axes first to first + 2 of end k, and their rates."""
    value, rate = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    r, dr = rise(t, moves.ramp[k])
    for j in range(moves.harmonics.shape[0]):
        axis = moves.harmonics[j, 1] - first
        if moves.harmonics[j, 0] == k and 0.0 <= axis <= 2.0:
            A, w, p = moves.harmonics[j, 2], moves.harmonics[j, 3], moves.harmonics[j, 4]
            s, c = math.sin(w * t + p), math.cos(w * t + p)
            unit = (1.0 if axis == 0.0 else 0.0, 1.0 if axis == 1.0 else 0.0, 1.0 if axis == 2.0 else 0.0)
            value = add(value, scale(r * A * s, unit))
            rate = add(rate, scale(A * (dr * s + r * w * c), unit))
    return value, rate


@inner
def cubic(x, c):
    """Value and derivative at x of the cubic with coefficients c (4,), highest power first."""
    return c[3] + x * (c[2] + x * (c[1] + x * c[0])), c[2] + x * (2.0 * c[1] + x * 3.0 * c[0])


@inner
def blended(t, k, moves, value, rate):
    """A value (3,) of the file of end k and its rate as far as its ramp has grown at t."""
    if moves.ramp[k] == 0.0:
        return value, rate
    r, dr = rise(t, moves.ramp[k])
    return scale(r, value), add(scale(r, rate), scale(dr, value))


@inner
def cubics_at(t, row, first, moves):
    """Values (3,) and rates of columns first to first + 2 of the cubics in a row."""
    x = t - moves.knots[row]
    a, da = cubic(x, moves.cubics[row, first])
    b, db = cubic(x, moves.cubics[row, first + 1])
    c, dc = cubic(x, moves.cubics[row, first + 2])
    return (a, b, c), (da, db, dc)


@inner
def position_at(t, k, moves, sea):
    """Position (m) and velocity (m/s) of an end whose position a motion prescribes."""
    base = (moves.position[k, 0], moves.position[k, 1], moves.position[k, 2])
    if moves.file[k, 1] > moves.file[k, 0]:
        when = min(t, moves.knots[moves.file[k, 1]])
        shift, v = cubics_at(when, interval_within(moves.knots, moves.file[k, 0], moves.file[k, 1], when), 0, moves)
        shift, v = blended(t, k, moves, shift, v)
        return add(base, shift), v
    shift, v = harmonics_at(t, k, 0.0, moves)
    x = add(base, shift)
    if moves.velocity_ramp[k] > 0.0:
        steady = (moves.velocity[k, 0], moves.velocity[k, 1], moves.velocity[k, 2])
        x = add(x, scale(rise_integral(t, moves.velocity_ramp[k]), steady))
        v = add(v, scale(rise(t, moves.velocity_ramp[k])[0], steady))
    if moves.travel[k, 4] > 0.0:
        way = (moves.travel[k, 0], moves.travel[k, 1], moves.travel[k, 2])
        part, rate = rise(t - moves.travel[k, 3], moves.travel[k, 4])
        x, v = add(x, scale(part, way)), add(v, scale(rate, way))
    if moves.follows[k]:
        eta, rate, slope_x, slope_y = surface_at(t, x[0], x[1], sea)
        x, v = add(x, (0.0, 0.0, eta)), add(v, (0.0, 0.0, rate + slope_x * v[0] + slope_y * v[1]))
    return x, v


@inner
def turn_by_angles(angle, rate):
    """Rz(yaw) Ry(pitch) Rx(roll) and its angular velocity: every rate about its own axis, turned by what follows."""
    cx, cy, cz = math.cos(angle[0]), math.cos(angle[1]), math.cos(angle[2])
    sx, sy, sz = math.sin(angle[0]), math.sin(angle[1]), math.sin(angle[2])
    turn = stack(
        (cz * cy, cz * sy * sx - sz * cx, cz * sy * cx + sz * sx),
        (sz * cy, sz * sy * sx + cz * cx, sz * sy * cx - cz * sx),
        (-sy, cy * sx, cy * cx),
    )
    roll, pitch, yaw = rate
    return turn, (cz * cy * roll - sz * pitch, sz * cy * roll + cz * pitch, yaw - sy * roll)


@inner
def turn_by_vector(v, rate):
    """exp of a rotation vector and the angular velocity that belongs to its rate (Rodrigues)."""
    q2 = v[0] * v[0] + v[1] * v[1] + v[2] * v[2]
    q = math.sqrt(q2)
    if q < SMALL_VECTOR:
        a, b, c = 1.0 - q2 / 6, 0.5 - q2 / 24, 1 / 6 - q2 / 120
    else:
        half = math.sin(0.5 * q) / q
        a, b = math.sin(q) / q, 2.0 * half * half
        c = (1.0 - a) / q2
    skew, once = hat(v), cross(v, rate)
    square = mat_mat(skew, skew)
    turn = stack(
        (1.0 + a * skew[0] + b * square[0], a * skew[1] + b * square[1], a * skew[2] + b * square[2]),
        (a * skew[3] + b * square[3], 1.0 + a * skew[4] + b * square[4], a * skew[5] + b * square[5]),
        (a * skew[6] + b * square[6], a * skew[7] + b * square[7], 1.0 + a * skew[8] + b * square[8]),
    )
    return turn, add(rate, add(scale(b, once), scale(c, cross(v, once))))


@inner
def part_of_path(t, k, moves):
    """How far along its path from outside end k is at t, 0 to 1, and the time that the path takes (s)."""
    begin, end = moves.paths[k, 0], moves.paths[k, 1]
    if not t < end:
        return 1.0, max(end - begin, 0.0)
    return max((t - begin) / (end - begin), 0.0), end - begin


@inner
def driven_position(t, k, moves):
    """Position (m) and velocity (m/s) of an end that is set from outside: on the cubic between two times (Hermite)."""
    x, dt = part_of_path(t, k, moves)
    p = moves.paths[k]
    a, va, b, vb = (p[2], p[3], p[4]), (p[5], p[6], p[7]), (p[8], p[9], p[10]), (p[11], p[12], p[13])
    if x == 1.0:
        return b, vb
    y, change = 1.0 - x, add(b, scale(-1.0, a))
    lean_a, lean_b = add(scale(dt, va), scale(-1.0, change)), add(change, scale(-dt, vb))
    value = add(add(scale(y, a), scale(x, b)), scale(x * y, add(scale(y, lean_a), scale(x, lean_b))))
    rate = add(change, add(scale(y * (1.0 - 3.0 * x), lean_a), scale(x * (2.0 - 3.0 * x), lean_b)))
    return value, scale(1.0 / dt, rate)


@inner
def driven_frame(t, k, moves):
    """Frame (9) and angular velocity (1/s, inertial) of an end that is set from outside: turned evenly."""
    x, dt = part_of_path(t, k, moves)
    p = moves.paths[k]
    frame, v = (p[14], p[15], p[16], p[17], p[18], p[19], p[20], p[21], p[22]), (p[23], p[24], p[25])
    still = (0.0, 0.0, 0.0)
    turn, _ = turn_by_vector(scale(x, v), still)
    spin = mat_vec(frame, scale(1.0 / dt, v)) if dt > 0.0 else still
    return mat_mat(frame, turn), spin


@inner
def frame_at(t, k, moves):
    """Frame (9) and angular velocity (1/s) that the motion of an end, or of the body that it is on, prescribes."""
    f = moves.frame[k]
    frame, spin = (f[0], f[1], f[2], f[3], f[4], f[5], f[6], f[7], f[8]), (0.0, 0.0, 0.0)
    when = t if t < math.inf else 0.0
    if moves.prescribed[k, 1]:
        if moves.file[k, 1] > moves.file[k, 0]:
            last = min(when, moves.knots[moves.file[k, 1]])
            v, rate = cubics_at(last, interval_within(moves.knots, moves.file[k, 0], moves.file[k, 1], last), 3, moves)
            v, rate = blended(when, k, moves, v, rate)
            turn, spin = turn_by_vector(v, rate)
        else:
            angle, rate = harmonics_at(when, k, 3.0, moves)
            turn, spin = turn_by_angles(angle, rate)
        frame = mat_mat(turn, frame)
    return frame, spin


@inner
def ride_at(x, v, frame, spin, k, moves):
    """Position, velocity, frame and angular velocity of end k, from those of the body that it is on."""
    p = moves.fairlead[k]
    arm = mat_vec(frame, (p[PLACE_THERE], p[PLACE_THERE + 1], p[PLACE_THERE + 2]))
    s = p[SEAT_THERE:]
    seat = (s[0], s[1], s[2], s[3], s[4], s[5], s[6], s[7], s[8])
    x, v = add(x, arm), add(v, cross(spin, arm))
    if p[RIDES] == TURNS_FREELY:
        return x, v, seat, (0.0, 0.0, 0.0)
    return x, v, mat_mat(frame, seat), spin


@inner
def bring_in(t, k, moves, frame, spin):
    """Frame and angular velocity of an end as far as it has turned from the tangent that it started with."""
    missing = moves.missing[k, 3]
    if missing != 0.0:
        part, rate = rise(t, moves.bring_in)
        if part < 1.0:
            axis = (moves.missing[k, 0], moves.missing[k, 1], moves.missing[k, 2])
            still = (0.0, 0.0, 0.0)
            back, _ = turn_by_vector(scale(-missing * (1.0 - part), axis), still)
            frame = mat_mat(back, frame)
            spin = add(mat_vec(back, spin), scale(missing * rate, axis))
    return frame, spin


@inner
def load_at(t, load, rows):
    """A load (of Moves.loads, N or N m) at t when it has grown: linear between its rows, constant outside them."""
    a, b = int(load[6]), int(load[7])
    if a == b:
        return load[2], load[3], load[4]
    if t <= rows[a, 0]:
        return rows[a, 1], rows[a, 2], rows[a, 3]
    b -= 1
    if t >= rows[b, 0]:
        return rows[b, 1], rows[b, 2], rows[b, 3]
    a = interval_within(rows[:, 0], a, b, t)
    b = a + 1
    x = (t - rows[a, 0]) / (rows[b, 0] - rows[a, 0])
    y = 1.0 - x
    return y * rows[a, 1] + x * rows[b, 1], y * rows[a, 2] + x * rows[b, 2], y * rows[a, 3] + x * rows[b, 3]


@inner
def ends_at(t, moves, sea, ends, velocity):
    """Write what both ends impose at t (s) into `ends`, and the velocity (2, 3) m/s of the held ends.

    t = infinity: loads grown and tangents turned in, motions as at 0.
    """
    when = t if t < math.inf else 0.0
    for k in range(2):
        x, v = (moves.position[k, 0], moves.position[k, 1], moves.position[k, 2]), (0.0, 0.0, 0.0)
        if moves.prescribed[k, 0]:
            x, v = position_at(when, k, moves, sea)
        if moves.driven[k, 0]:
            x, v = driven_position(when, k, moves)
        frame, spin = frame_at(t, k, moves)
        if moves.fairlead[k, RIDES] != NOT_ON_BODY:
            x, v, frame, spin = ride_at(x, v, frame, spin, k, moves)
        frame, spin = bring_in(t, k, moves, frame, spin)
        if moves.driven[k, 1]:
            frame, spin = driven_frame(when, k, moves)
        for i in range(3):
            ends.position[k, i], velocity[k, i], ends.spin[k, i] = x[i], v[i], spin[i]
            ends.force[k, i] = ends.moment[k, i] = 0.0
        for i in range(9):
            ends.frame[k, i] = frame[i]
    for j in range(moves.loads.shape[0]):
        part, _ = rise(t, moves.loads[j, 5])
        k, target = int(moves.loads[j, 0]), ends.force
        if moves.loads[j, 1] == 1.0:
            target = ends.moment
        load = load_at(when, moves.loads[j], moves.history)
        for i in range(3):
            target[k, i] += part * load[i]


# --- how far an end turns ------------------------------------------------------------------------


@inner
def sine_on_the_way(a, b):
    """How far sin goes up and down between angles a and b > a, the integral of |cos|, and the largest |sin| there."""
    before, after = math.floor(a / math.pi + 0.5), math.floor(b / math.pi + 0.5)
    sin_a, sin_b = math.sin(a), math.sin(b)
    way = 2.0 * (after - before) + (1.0 - 2.0 * (after % 2.0)) * sin_b - (1.0 - 2.0 * (before % 2.0)) * sin_a
    return way, 1.0 if after > before else max(abs(sin_a), abs(sin_b))


@inner
def way_of_cubics(a, b, row, moves):
    """Upper bound (rad) of the way of the rotation vector along the cubics of one row, from a to b.

    The polygon of a cubic's four Bezier points is no shorter than the cubic.
    """
    h = (b - a) / 3.0
    first, rate = cubics_at(a, row, 3, moves)
    last, rate_last = cubics_at(b, row, 3, moves)
    second, third = add(first, scale(h, rate)), add(last, scale(-h, rate_last))
    return distance(first, second) + distance(second, third) + distance(third, last)


@inner
def distance(a, b):
    """|a - b|."""
    x, y, z = a[0] - b[0], a[1] - b[1], a[2] - b[2]
    return math.sqrt(x * x + y * y + z * z)


@inner
def turn_of_file(a, b, k, moves):
    """Upper bound (rad) of the turn of end k by its file between a and b: no faster than its rotation vector moves."""
    last, grown = moves.file[k, 1], rise(b, moves.ramp[k])[0]
    more = grown - rise(a, moves.ramp[k])[0]  # of a ramp, which turns it as well, by no more than the largest vector
    a, b = min(a, moves.knots[last]), min(b, moves.knots[last])
    first, last = moves.file[k, 0], moves.file[k, 1]
    row, until, way = interval_within(moves.knots, first, last, a), interval_within(moves.knots, first, last, b), 0.0
    while row < until:
        way += way_of_cubics(a, moves.knots[row + 1], row, moves)
        row += 1
        a = moves.knots[row]
    way += way_of_cubics(a, b, row, moves)
    v, _ = cubics_at(b, row, 3, moves)
    return grown * way + more * (distance(v, (0.0, 0.0, 0.0)) + way)


@inner
def turn_between(a, b, moves):
    """Upper bound (rad) of the angle through which the faster-turning end turns on its way from time a to b > a (s).

    It is the length of the way, not the difference of two frames: a full turn counts 2 pi.  Exact for one harmonic
    about one axis without ramp; harmonics about several axes add up as if their axes were one.
    """
    most = 0.0
    for k in range(2):
        way = 0.0
        if moves.prescribed[k, 1] and moves.file[k, 1] > moves.file[k, 0]:
            way = turn_of_file(a, b, k, moves)
        elif moves.prescribed[k, 1]:
            r, grown = rise(a, moves.ramp[k])[0], rise(b, moves.ramp[k])[0]
            for j in range(moves.harmonics.shape[0]):
                if moves.harmonics[j, 0] == k and moves.harmonics[j, 1] >= 3.0:
                    w, p = moves.harmonics[j, 3], moves.harmonics[j, 4]
                    swings, largest = sine_on_the_way(w * a + p, w * b + p)
                    way += abs(moves.harmonics[j, 2]) * ((grown - r) * largest + grown * swings)
        if moves.driven[k, 1]:
            p = moves.paths[k]
            part = part_of_path(b, k, moves)[0] - part_of_path(a, k, moves)[0]
            way += part * distance((p[23], p[24], p[25]), (0.0, 0.0, 0.0))
        part = rise(b, moves.bring_in)[0] - rise(a, moves.bring_in)[0]
        most = max(most, way + moves.missing[k, 3] * part)
    return most


@kernel
def end_turn(e, frames):
    """Angle, rad, from the first end's director, carried along all chords without twist, to the second's.

    frames: (2, 9) of the ends.
    """
    Ra, Rb = get9(frames, 0), get9(frames, 1)
    a, d = (Ra[0], Ra[3], Ra[6]), (Ra[2], Ra[5], Ra[8])
    b, db = (Rb[0], Rb[3], Rb[6]), (Rb[2], Rb[5], Rb[8])
    for i in range(e.shape[0]):
        d1, _, _ = chord(get3(e, i))
        a = transport(a, d, d1)
        d = d1
    a = transport(a, d, db)
    return math.atan2(dot(cross(a, b), db), dot(a, b))
