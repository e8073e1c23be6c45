"""Newton's method for one step (in time, or one static solve): the only nonlinear loop of the package.

Each iteration is one march along s and one substitution back (kernels.assembly),
then an update of positions, tensions, frames and rates.  The whole step is one
compiled call.
"""

from __future__ import annotations

import math

from hybrid.kernels.assembly import get9, march
from hybrid.kernels.assembly_plane import carried, march_planar, sharpest_planar, substitute_planar, update_planar
from hybrid.kernels.block_elimination import substitute
from hybrid.kernels.cell import chord
from hybrid.kernels.compile import inner, kernel
from hybrid.kernels.element import relative_rotation
from hybrid.kernels.forces import FRICTION, PLANAR, ROTARY, SEABED, WAVES
from hybrid.kernels.generalized_alpha import weights
from hybrid.kernels.node_forces import get3
from hybrid.kernels.out_of_plane import step_out_of_plane
from hybrid.kernels.plane import chord2, part2
from hybrid.kernels.report import (
    BEND,
    BEND_NODE,
    CONTACT_WORK,
    FRICTION_WORK,
    LOCAL_ERROR,
    LOCAL_ERROR_NODE,
    PUSH_ENERGY,
    RESIDUAL,
    RESIDUAL_NODE,
    SEABED_ENERGY,
    SLACKEST,
    SLACKEST_CELL,
    TWIST,
    TWIST_NODE,
    WRONG_PIVOTS,
)
from hybrid.kernels.rotations import dot, frame, log_rotation, spin_about, transport
from hybrid.kernels.seabed import stored
from hybrid.kernels.water import stir

OK, NOT_CONVERGED, NOT_FINITE, SINGULAR, TURNED_TOO_FAR = 0, 1, 2, 3, 5  # errors.Outcome, as kernels see it

# Newton stops when the next correction, predicted from the last two by quadratic
# convergence, turns no chord by more than TOLERANCE (rad) and changes no tension by more
# than TOLERANCE of the largest.  Differences between two ways of computing the same thing
# (ends swapped, scene rotated) then stay near 1e-9, a hundred times above round-off.
TOLERANCE = 1e-9
# Below this the correction is accepted when it no longer shrinks: round-off of ill-scaled lines.
ROUND_OFF = 1e-6
# Round-off of the length of the line, as a part of it (equal cells are all rounded the same way), and the most, as a
# part of the tension scale, that it may make of a tension: a step so small that it is more does not converge.
ROUND_OFF_LENGTH, MOST_NOISE = 2.5e-16, 1e-3
# At a clamp whose first cell is longer than sqrt(EI/T) the moment is not resolved, whatever
# the angle; angles above 1/CLAMP rad (3 deg) are worth a word.
CLAMP = 20.0
# A shift of the line as a whole turns nothing; it counts as a part of `reach` times this (that is, of the length).
WHOLE = 0.1
# Changes of tension count against the largest tension of the line, or against this part of
# the tension scale of the scene where that is larger (a line can be free of tension).
LOW_TENSION = 1e-3
# A step in which a chord turns (or is predicted to turn) by more than this, in rad, is repeated in parts.
LARGEST_STEP_TURN = 1.0
# A chord that would turn by more than this in one iteration shortens the whole correction
# (damped Newton): the linearised constraint of length is useless beyond about half a radian.
LARGEST_TURN = 0.7


@kernel
def measure(e, T, x):
    """Size of a Newton correction x: largest shift, largest turn of a chord or spin and its cell, largest change of
    tension, and the largest tension."""
    n = e.shape[0]
    shift, turn, pull, big, where = 0.0, 0.0, 0.0, 0.0, -1
    for i in range(n + 1):
        shift = max(shift, abs(x[i, 1]) + abs(x[i, 2]) + abs(x[i, 3]))
        pull = max(pull, abs(x[i, 0]))
        if i < n:
            de = (x[i + 1, 1] - x[i, 1], x[i + 1, 2] - x[i, 2], x[i + 1, 3] - x[i, 3])
            ei = (e[i, 0], e[i, 1], e[i, 2])
            t = max(math.sqrt(dot(de, de) / dot(ei, ei)), abs(x[i, 4]))
            big = max(big, abs(T[i]))
            if t > turn:
                turn, where = t, i
    return shift, turn, where, pull, big


@kernel
def update(line, e, u, v, vd, T, a1, w, wd, x, cv, ca, part, turning):
    """Apply `part` of the correction x to everything that depends on it.

    With `turning` chords are turned and stretched by the correction instead of shifted:
    the same to first order, but a large turn does not stretch the line.  Positions then
    follow from the start along the chords, and a held end is met again by the next correction.
    """
    n = e.shape[0]
    drift = (0.0, 0.0, 0.0)
    for i in range(n):
        de = (
            part * (x[i + 1, 1] - x[i, 1]),
            part * (x[i + 1, 2] - x[i, 2]),
            part * (x[i + 1, 3] - x[i, 3]),
        )
        ei = (e[i, 0], e[i, 1], e[i, 2])
        d, l, il = chord(ei)
        T[i] += part * x[i + 1, 0]
        en = (ei[0] + de[0], ei[1] + de[1], ei[2] + de[2])
        if turning:
            along = dot(d, de)
            across = (de[0] - along * d[0], de[1] - along * d[1], de[2] - along * d[2])
            q = math.sqrt(dot(across, across))
            if q > 0.0:
                c, s = (l + along) * math.cos(q * il), (l + along) * math.sin(q * il) / q
                turned = (c * d[0] + s * across[0], c * d[1] + s * across[1], c * d[2] + s * across[2])
                drift = (
                    drift[0] + turned[0] - en[0],
                    drift[1] + turned[1] - en[1],
                    drift[2] + turned[2] - en[2],
                )
                en = turned
            u[i + 1, 0] += drift[0]
            u[i + 1, 1] += drift[1]
            u[i + 1, 2] += drift[2]
        e[i, 0], e[i, 1], e[i, 2] = en
        if line.spin[i]:
            dpsi = part * x[i, 4]
            dn, _, _ = chord(en)
            a = transport((a1[i, 0], a1[i, 1], a1[i, 2]), d, dn)
            if dpsi != 0.0:
                a = spin_about(a, dn, dpsi)
            a1[i, 0], a1[i, 1], a1[i, 2] = a
            w[i] += cv * dpsi
            wd[i] += ca * dpsi
    for i in range(n + 1):
        for k in range(3):
            dr = part * x[i, k + 1]
            u[i, k] += dr
            v[i, k] += cv * dr
            vd[i, k] += ca * dr


@inner
def first_bad(x, e):
    """The first cell that is not finite: its chord, or else its correction (substitution goes backwards)."""
    for i in range(e.shape[0]):
        if not abs(e[i, 0]) + abs(e[i, 1]) + abs(e[i, 2]) < math.inf:
            return i
    for i in range(x.shape[0] - 1, -1, -1):
        if not abs(x[i, 0]) + abs(x[i, 1]) + abs(x[i, 2]) + abs(x[i, 3]) + abs(x[i, 4]) < math.inf:
            return i
    return -1


@kernel
def newton(
    line, sea, ends, r, u, e, v, vd, T, a1, w, wd, cv, ca, reach, scale, most, turning, gaps, W, X, x, report, rows
):  # fmt: skip
    """Solve the equilibrium at the end of a step.

    Starts from the prediction in (u, e, v, vd, T, a1, w, wd) and leaves the answer
    there.  `reach` (m) bounds the shift of a node in one iteration, `scale` (N) is the
    tension scale of the scene; `turning`: see `update`.  Returns outcome,
    iterations, last predicted correction, and the cell or node where it was worst.
    """
    planar = line.bits & PLANAR
    before = math.inf
    left = math.inf
    where = -1
    # What round-off of a cell's length makes of the tension when inertia must account for it within a short step.
    heavy = 0.0
    length = 0.0
    for i in range(e.shape[0]):
        heavy += line.mass[i]
        length += line.h[i]
    noise = min(ROUND_OFF_LENGTH * length * heavy * ca, MOST_NOISE * scale)
    for it in range(1, most + 1):
        if planar:
            bad = march_planar(line, sea, ends, e, u, r, v, vd, T, a1, cv, ca, X, report, rows)
        else:
            bad = march(line, sea, ends, e, u, r, v, vd, T, a1, w, wd, cv, ca, gaps, W, X, report, rows)
        if bad >= 0:
            if not report[RESIDUAL] < math.inf:  # a NaN makes every pivot fail: say so instead of "singular"
                return NOT_FINITE, it, left, int(report[RESIDUAL_NODE])
            return SINGULAR, it, left, bad
        if not (substitute_planar(line.plane, X, x) if planar else substitute(X, x)):
            return NOT_FINITE, it, left, first_bad(x, e)
        shift, turn, where, pull, big = measure(e, T, x)
        part = 1.0
        if shift > reach and not turning:
            part = reach / shift
        if turn * part > LARGEST_TURN:
            part = LARGEST_TURN / turn
        if line.bits & FRICTION and cv > 0.0 and it in (7, 10, 13):  # it goes round between sticking and sliding
            part *= 0.5
        if planar and not turning:
            update_planar(line, e, u, v, vd, T, a1, x, cv, ca, part)
        else:
            update(line, e, u, v, vd, T, a1, w, wd, x, cv, ca, part, turning)
        turn = max(turn, WHOLE * shift / reach)
        size = turn if pull < noise else max(turn, pull / max(big, LOW_TENSION * scale))
        ratio = size / before
        left = size * min(1.0, ratio * ratio)
        if part == 1.0:
            if size <= TOLERANCE or (it > 1 and size < 1e-3 and left <= 0.1 * TOLERANCE):
                return OK, it, left, where
            if it > 4 and size < ROUND_OFF and ratio > 0.3:
                return OK, it, size, where
        before = size if part == 1.0 else math.inf
    return NOT_CONVERGED, most, left, where


@kernel
def sharpest(line, ends, e, T, a1):
    """How far the mesh is from resolving a rod: largest bend and twist of an element, rad, and their nodes (-1: none).

    The element at a clamp or guide stands for half a cell; it counts twice, and CLAMP times
    h/lambda where the cell is longer than lambda = sqrt(EI/T), over which a cable leaves its clamp.
    """
    if line.bits & PLANAR:
        return sharpest_planar(line, ends, e, T, CLAMP)
    bend, twist, bend_at, twist_at = 0.0, 0.0, -1, -1
    n = e.shape[0]
    for i in range(n + 1):
        if not line.element[i]:
            continue
        c = min(i, n - 1)
        d, l, _ = chord((e[c, 0], e[c, 1], e[c, 2]))
        Rb = frame((a1[c, 0], a1[c, 1], a1[c, 2]), d)
        weight = 1.0
        if 0 < i < n:
            d, _, _ = chord((e[i - 1, 0], e[i - 1, 1], e[i - 1, 2]))
            Ra = frame((a1[i - 1, 0], a1[i - 1, 1], a1[i - 1, 2]), d)
        else:
            Ra = get9(ends.frame, 0 if i == 0 else 1)
            if i == n:
                Ra, Rb = Rb, Ra
            stiffness = max(line.kb[i, 0], line.kb[i, 1]) * line.hn[i]
            weight = 2.0
            if T[c] > 0.0 and l * l * T[c] > stiffness:
                weight = CLAMP * l * math.sqrt(T[c] / stiffness)
        k = log_rotation(relative_rotation(Ra, Rb))
        x = weight * math.sqrt(k[0] * k[0] + k[1] * k[1])
        y = abs(k[2]) if line.kb[i, 2] > 0.0 else 0.0
        if not x <= bend:
            bend, bend_at = x, i
        if not y <= twist:
            twist, twist_at = y, i
    return bend, bend_at, twist, twist_at


@inner
def widest_turn(e, u):
    """Largest change of a chord e by the displacements u, as a part of its length (an angle in rad), and its cell."""
    widest, where = 0.0, -1
    for i in range(e.shape[0]):
        x, y, z = u[i + 1, 0] - u[i, 0], u[i + 1, 1] - u[i, 1], u[i + 1, 2] - u[i, 2]
        part = (x * x + y * y + z * z) / (e[i, 0] * e[i, 0] + e[i, 1] * e[i, 1] + e[i, 2] * e[i, 2])
        if not part <= widest:
            widest, where = part, i
    return math.sqrt(widest), where


@kernel
def lowest(line, T):
    """Lowest tension of a catenary zone and its cell; infinity and -1 without one."""
    where, low = -1, math.inf
    for i in range(T.shape[0]):
        if not line.spin[i] and not T[i] > low:
            where, low = i, T[i]
    return low, where


@kernel
def lay(sea, e, slip):
    """Remember for friction how the line lies when a step starts: its direction along the bed, its elastic travel."""
    n, last = sea.normal, e.shape[0]
    for i in range(last + 1):
        x, y, z = 0.0, 0.0, 0.0
        for c in range(max(i - 1, 0), min(i + 1, last)):
            d, _, _ = chord(get3(e, c))
            x, y, z = x + d[0], y + d[1], z + d[2]
        w = n[0] * x + n[1] * y + n[2] * z
        x, y, z = x - w * n[0], y - w * n[1], z - w * n[2]
        size = math.sqrt(x * x + y * y + z * z)
        if not size > 1e-9:  # upright or folded: any direction in the plane
            x, y, z = 1.0 - n[0] * n[0], -n[0] * n[1], -n[0] * n[2]
            size = math.sqrt(x * x + y * y + z * z)
        sea.axis[i, 0], sea.axis[i, 1], sea.axis[i, 2] = x / size, y / size, z / size
        sea.slip[i, 0], sea.slip[i, 1], sea.slip[i, 2] = slip[i, 0], slip[i, 1], slip[i, 2]


@inner
def unrest(old, new):
    """Largest change of the algorithmic acceleration in a step, m/s2, and its node."""
    worst, where = 0.0, 0
    for i in range(old.a.shape[0]):
        x, y, z = new.a[i, 0] - old.a[i, 0], new.a[i, 1] - old.a[i, 1], new.a[i, 2] - old.a[i, 2]
        size = x * x + y * y + z * z
        if not size <= worst:
            worst, where = size, i
    return math.sqrt(worst), where


@kernel
def advance(line, sea, ends, old, new, u, dt, before, rho, reach, scale, most, gaps, W, X, x, report, rows, was, now):
    """One step of generalized-alpha (docs/theory.md, 2) from `old` to `new`, all in one call.

    Prediction with the algorithmic acceleration kept; then Newton.  Returns as `newton`.  before: s, the length of
    the step that led to `old`, 0 if none did.
    A step whose prediction or answer turns a chord by more than LARGEST_STEP_TURN is refused:
    it has missed the motion, and Newton may end on a branch that has nothing to do with it.
    was, now: a push out of the plane before and after the step (kernels.out_of_plane); empty where there is none.
    """
    am, af, ga, be, slip = weights(rho, before / dt)
    cv = ga / (be * dt)
    ca = (1.0 - am) / ((1.0 - af) * be * dt * dt)
    n = old.e.shape[0]
    for i in range(n + 1):
        for k in range(3):
            ai = old.a[i, k]
            # with a' = a the increment is dt v + dt^2 a/2, and what remains is be dt^2 (a' - a) = 0
            u[i, k] = dt * old.v[i, k] + 0.5 * dt * dt * ai
            new.v[i, k] = old.v[i, k] + dt * ai
            new.vd[i, k] = (am * ai - af * old.vd[i, k]) / (1.0 - af) + ca * be * dt * dt * ai
    turn, where = widest_turn(old.e, u)
    if not turn < LARGEST_STEP_TURN:
        return TURNED_TOO_FAR, 0, turn, where
    for i in range(n):
        ei = (old.e[i, 0], old.e[i, 1], old.e[i, 2])
        en = (
            ei[0] + u[i + 1, 0] - u[i, 0],
            ei[1] + u[i + 1, 1] - u[i, 1],
            ei[2] + u[i + 1, 2] - u[i, 2],
        )
        new.e[i, 0], new.e[i, 1], new.e[i, 2] = en
        new.T[i] = old.T[i]
        if line.bits & PLANAR:
            a = get3(old.a1, i)
            if line.spin[i]:
                d, _, _ = chord2(part2(line.plane, old.e, i))
                dn, _, _ = chord2(part2(line.plane, new.e, i))
                a = carried(line.plane, a, d, dn)
            new.a1[i, 0], new.a1[i, 1], new.a1[i, 2] = a
            new.w[i], new.wd[i] = 0.0, 0.0
        elif line.spin[i]:
            dpsi = dt * old.w[i] + 0.5 * dt * dt * old.wa[i]
            d, _, _ = chord(ei)
            dn, _, _ = chord(en)
            a = transport((old.a1[i, 0], old.a1[i, 1], old.a1[i, 2]), d, dn)
            new.w[i] = old.w[i] + dt * old.wa[i]
            new.wd[i] = (am * old.wa[i] - af * old.wd[i]) / (1.0 - af) + ca * be * dt * dt * old.wa[i]
            if line.bits & ROTARY:
                a = spin_about(a, dn, dpsi)
            else:
                # without inertia twist is a balance, sought from where it was: a spin that goes on by itself would
                # pass through that balance turn after turn
                new.w[i] -= cv * dpsi
                new.wd[i] -= ca * dpsi
            new.a1[i, 0], new.a1[i, 1], new.a1[i, 2] = a
        else:
            new.a1[i, 0], new.a1[i, 1], new.a1[i, 2] = old.a1[i, 0], old.a1[i, 1], old.a1[i, 2]
            new.w[i], new.wd[i] = 0.0, 0.0

    if line.bits & WAVES:  # at the predicted positions, which are right to third order
        stir(sea, old.r, u)
    if line.bits & FRICTION:
        lay(sea, old.e, old.slip)
    outcome, iterations, left, where = newton(
        line, sea, ends, old.r, u, new.e, new.v, new.vd, new.T, new.a1, new.w, new.wd,
        cv, ca, reach, scale, most, False, gaps, W, X, x, report, rows,
    )  # fmt: skip

    # a' = (r' - rp)/(be dt^2) with rp = r + dt v + dt^2 (1/2 - be) a; likewise for the spin, through w'
    for i in range(n + 1):
        for k in range(3):
            rp = dt * old.v[i, k] + dt * dt * (0.5 - be) * old.a[i, k]
            new.a[i, k] = (u[i, k] - rp) / (be * dt * dt)
            new.r[i, k] = old.r[i, k] + u[i, k]
    if line.bits & FRICTION:
        for i in range(n + 1):
            for k in range(3):
                new.slip[i, k] = sea.slid[i, k]
    for i in range(n):
        if line.spin[i] and not line.bits & PLANAR:
            new.wa[i] = (new.w[i] - old.w[i] - dt * (1.0 - ga) * old.wa[i]) / (ga * dt)
        else:
            new.wa[i] = 0.0
    if outcome == OK:
        turn, cell = widest_turn(old.e, u)
        if not turn < LARGEST_STEP_TURN:
            outcome, where = TURNED_TOO_FAR, cell
        report[BEND], report[BEND_NODE], report[TWIST], report[TWIST_NODE] = sharpest(line, ends, new.e, new.T, new.a1)
        report[SLACKEST], report[SLACKEST_CELL] = lowest(line, new.T)
        change, place = unrest(old, new)
        report[LOCAL_ERROR], report[LOCAL_ERROR_NODE] = slip * dt * dt * change, place
        if line.bits & SEABED:
            normal = (sea.normal[0], sea.normal[1], sea.normal[2])
            for i in range(n + 1):  # force times way: bounded by the energy of a blow, however short the step is not
                b = (0.5 * (old.bed[i, 0] + sea.bed[i, 0]), 0.5 * (old.bed[i, 1] + sea.bed[i, 1]),
                     0.5 * (old.bed[i, 2] + sea.bed[i, 2]))  # fmt: skip
                ui = get3(u, i)
                along = dot(normal, ui) * dot(normal, b)
                report[CONTACT_WORK] += along
                report[FRICTION_WORK] += dot(b, ui) - along
                new.bed[i, 0], new.bed[i, 1], new.bed[i, 2] = get3(sea.bed, i)
            report[SEABED_ENERGY] = stored(line, sea, new.r)
        if was.shape[0] > 0:
            report[PUSH_ENERGY], report[WRONG_PIVOTS] = step_out_of_plane(
                line, sea, ends, new, dt, before, rho, was, now, X
            )
    return outcome, iterations, left, where
