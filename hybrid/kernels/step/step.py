"""What stands before and after Newton in a step of generalized-alpha (docs/theory.md, 2)."""

from __future__ import annotations

import math
from typing import NamedTuple

from hybrid.kernels.algebra.block_elimination import ROW
from hybrid.kernels.algebra.plane import KEPT, TRIPLE
from hybrid.kernels.algebra.rotations import add, dot, get3, scale, spin_about, sub
from hybrid.kernels.laws.element import chord
from hybrid.kernels.laws.obstacle_grip import (
    book_obstacles,
    find_rates_of_sheaves,
    grip_obstacles,
    mean_force,
    predict_sheaves,
)
from hybrid.kernels.laws.obstacles import carry_obstacles, normal_at, passes, stored_in_contact
from hybrid.kernels.laws.out_of_plane import step_out_of_plane
from hybrid.kernels.laws.seabed import bed_under, slide_on, update_soil
from hybrid.kernels.laws.water import advance_wake, wave_kinematics
from hybrid.kernels.machine.compile import inner, linked_kernel
from hybrid.kernels.march.march import carry_director
from hybrid.kernels.march.resolution_checks import lowest, lowest_not_held, sharpest_in_plane, sharpest_in_space
from hybrid.kernels.state.report import (
    BEND,
    BEND_NODE,
    CONTACT_WORK,
    EACH,
    FRICTION,
    FRICTION_WORK,
    LOCAL_ERROR,
    LOCAL_ERROR_NODE,
    OBSTACLE_WORK,
    OBSTACLES,
    PUSH_ENERGY,
    REMEMBERS,
    ROTARY,
    SEABED_ENERGY,
    SLACKEST,
    SLACKEST_CELL,
    TOUCHES,
    TWIST,
    TWIST_NODE,
    USED_RHO,
    VORTICES,
    WAVES,
    WRONG_PIVOTS,
)
from hybrid.kernels.state.state import ROWS, Floats, State, no_sea
from hybrid.kernels.step.step_control import weights

# A step in which a chord turns (or is predicted to turn) by more than this, in rad, is repeated in parts; so is one in
# which a cell spins by more against the next one.
LARGEST_STEP_TURN = 1.0
# What counts as a turn too large: a node that goes through an obstacle, or deep into it.
THROUGH = 2.0 * LARGEST_STEP_TURN


class States(NamedTuple):
    """The states before and after a step.

    was, now: (N+1, 4) a push out of the plane before and after it, empty where there is none
    (kernels.laws.out_of_plane).
    """

    old: State
    new: State
    was: Floats
    now: Floats


@inner
def largest_turn(e, u):
    """Largest change of a chord e by the displacements u, as a part of its length (an angle in rad), and its cell."""
    widest, where = 0.0, -1
    for i in range(e.shape[0]):
        x, y, z = u[i + 1, 0] - u[i, 0], u[i + 1, 1] - u[i, 1], u[i + 1, 2] - u[i, 2]
        part = (x * x + y * y + z * z) / (e[i, 0] * e[i, 0] + e[i, 1] * e[i, 1] + e[i, 2] * e[i, 2])
        if not part <= widest:
            widest, where = part, i
    return math.sqrt(widest), where


@linked_kernel(lambda: (no_sea(1), ROWS, ROWS, ROWS, ROWS))
def friction_axes(sea, r, e, slip, grip):
    """Remember for friction how the line lies when a step starts: its direction along the bed, its elastic travel."""
    last = e.shape[0]
    for i in range(last + 1):
        n, _ = bed_under(sea, get3(r, i))
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
        for k in range(grip.shape[1]):
            sea.grip[i, k] = grip[i, k]


@inner
def acceleration_change(old, new):
    """Largest change of the algorithmic acceleration in a step, m/s2, and its node."""
    worst, where = 0.0, 0
    for i in range(old.a.shape[0]):
        x, y, z = new.a[i, 0] - old.a[i, 0], new.a[i, 1] - old.a[i, 1], new.a[i, 2] - old.a[i, 2]
        size = x * x + y * y + z * z
        if not size <= worst:
            worst, where = size, i
    return math.sqrt(worst), where


@inner
def predict_nodes(old, new, u, s):
    """Displacement, velocity and acceleration with the algorithmic acceleration kept."""
    dt, am, af, _, be, _, ca = s
    for i in range(u.shape[0]):
        for k in range(3):
            ai = old.a[i, k]
            # with a' = a the increment is dt v + dt^2 a/2, and what remains is be dt^2 (a' - a) = 0
            u[i, k] = dt * old.v[i, k] + 0.5 * dt * dt * ai
            new.v[i, k] = old.v[i, k] + dt * ai
            new.vd[i, k] = (am * ai - af * old.vd[i, k]) / (1.0 - af) + ca * be * dt * dt * ai


@inner
def predict_cells(plane, space, line, old, new, u, s):
    """Chords, tensions, directors and spins that go with it."""
    dt, am, af, _, be, cv, ca = s
    for i in range(old.e.shape[0]):
        ei = get3(old.e, i)
        en = (ei[0] + u[i + 1, 0] - u[i, 0], ei[1] + u[i + 1, 1] - u[i, 1], ei[2] + u[i + 1, 2] - u[i, 2])
        new.e[i, 0], new.e[i, 1], new.e[i, 2] = en
        new.T[i] = old.T[i]
        new.w[i], new.wd[i] = 0.0, 0.0
        a = get3(old.a1, i)
        if line.spin[i]:
            a = carry_director(plane, space, a, ei, en)
            if space is not None:
                dpsi = dt * old.w[i] + 0.5 * dt * dt * old.wa[i]
                new.w[i] = old.w[i] + dt * old.wa[i]
                new.wd[i] = (am * old.wa[i] - af * old.wd[i]) / (1.0 - af) + ca * be * dt * dt * old.wa[i]
                if line.bits & ROTARY:
                    dn, _, _ = chord(en)
                    a = spin_about(a, dn, dpsi)
                else:
                    # without inertia twist is a balance, sought from where it was: a spin that goes on by itself would
                    # pass through that balance turn after turn
                    new.w[i] -= cv * dpsi
                    new.wd[i] -= ca * dpsi
        new.a1[i, 0], new.a1[i, 1], new.a1[i, 2] = a
    for z in range(new.turn.shape[0]):  # the turn is counted on from where it was
        for k in range(new.turn.shape[1]):
            new.turn[z, k] = old.turn[z, k]


@inner
def find_rates(space, line, sea, old, new, u, s):
    """Positions, algorithmic accelerations and elastic travel after the step.

    a' = (r' - rp)/(be dt^2) with rp = r + dt v + dt^2 (1/2 - be) a; likewise for the spin, through w'.
    """
    dt, _, _, ga, be, _, _ = s
    for i in range(u.shape[0]):
        for k in range(3):
            rp = dt * old.v[i, k] + dt * dt * (0.5 - be) * old.a[i, k]
            new.a[i, k] = (u[i, k] - rp) / (be * dt * dt)
            new.r[i, k] = old.r[i, k] + u[i, k]
            if line.bits & FRICTION:
                new.slip[i, k] = sea.slid[i, k]
    for i in range(old.e.shape[0]):
        new.wa[i] = 0.0
        if space is not None:
            if line.spin[i]:
                new.wa[i] = (new.w[i] - old.w[i] - dt * (1.0 - ga) * old.wa[i]) / (ga * dt)
    if space is not None:
        if new.sheave.shape[0] > 0:
            find_rates_of_sheaves(old, new, s)


@inner
def contact_work(line, sea, old, new, u, report):
    """Work of the seabed and of obstacles in the step, and what they store."""
    moves = line.moved.shape[0] > 0
    if moves:
        report[OBSTACLE_WORK] = 0.0
        grip_obstacles(line, sea, u, new, sea.grip, new.grip)
        book_obstacles(sea, old, new, u, report)
    for i in range(u.shape[0]):  # force times way: bounded by the energy of a blow, however short the step is not
        b = scale(0.5, add(get3(old.bed, i), get3(sea.bed, i)))
        if moves:  # what is left is the bed's
            for k in range(line.moved.shape[0]):
                b = sub(b, mean_force(old, new, i, EACH * k))
        if b[0] != 0.0 or b[1] != 0.0 or b[2] != 0.0:
            ui, normal = get3(u, i), normal_at(line, sea, get3(new.r, i), moves)
            along = dot(normal, ui) * dot(normal, b)
            report[CONTACT_WORK] += along
            report[FRICTION_WORK] += dot(b, ui) - along
        new.bed[i, 0], new.bed[i, 1], new.bed[i, 2] = get3(sea.bed, i)
    if line.bits & REMEMBERS:
        update_soil(line, sea, new.r, new.soil)
        slide_on(line, sea, old, new, u)
    report[SEABED_ENERGY] = stored_in_contact(line, sea, new.r)


@inner
def shorten(new, u, s, part):
    """Go only a part of the way that is predicted; rates follow as with a correction."""
    for i in range(u.shape[0]):
        for k in range(3):
            du = (part - 1.0) * u[i, k]
            u[i, k] += du
            new.v[i, k] += s.cv * du
            new.vd[i, k] += s.ca * du


@inner
def begin_step(plane, space, line, sea, old, new, u, s, safe):
    """Predict the end of a step from `old` into `new`, with the algorithmic acceleration kept.

    safe: part of the way in which the line does not pass through itself.

    Returns the largest turn of a chord (rad) and its cell; beyond LARGEST_STEP_TURN the step is not begun.
    """
    if space is not None:
        if line.moved.shape[0] > 0:
            if new.sheave.shape[0] > 0:
                predict_sheaves(line, sea, old, new, s)
            carry_obstacles(sea.now[0] - s.dt, sea.now[0], sea)
    predict_nodes(old, new, u, s)
    if safe < 1.0:
        shorten(new, u, s, safe)
    turn, cell = largest_turn(old.e, u)
    if turn < LARGEST_STEP_TURN:
        predict_cells(plane, space, line, old, new, u, s)
        if line.bits & WAVES:  # at the predicted positions, which are right to third order
            wave_kinematics(sea, old.r, u)
        if line.bits & FRICTION:
            friction_axes(sea, old.r, old.e, old.slip, old.grip)
        if line.bits & REMEMBERS:
            for i in range(new.soil.shape[0]):
                for k in range(new.soil.shape[1]):
                    new.soil[i, k] = old.soil[i, k]
        if line.bits & VORTICES:
            advance_wake(line, sea, old, new, s.dt)
    return turn, cell


@inner
def largest_spin(line, ends, old, new, s):
    """Largest spin of a cell against the next one, or against what holds its twist, in a step, rad, and the cell.

    Of cells with polar inertia: others are where the balance of torques has them, and create no energy.
    """
    most, where, before, n = 0.0, -1, 0.0, old.w.shape[0]
    for i in range(n + 1):
        now = 0.0
        if i < n and line.spin[i]:
            now = s.dt * (old.w[i] + s.dt * ((0.5 - s.be) * old.wa[i] + s.be * new.wa[i]))  # however many turns
        inert = line.polar[max(i - 1, 0)] > 0.0 or line.polar[min(i, n - 1)] > 0.0
        if inert and line.element[i] and line.kb[i, 2] > 0.0:
            if i == 0 or i == n:
                c = min(i, n - 1)
                d, _, _ = chord(get3(new.e, c))
                turned = s.dt * dot(get3(ends.spin, 0 if i == 0 else 1), d)
                x = abs(now - turned) if i == 0 else abs(turned - before)
            else:
                x = abs(now - before)
            if not x <= most:
                most, where = x, min(i, n - 1)
        before = now
    return most, where


@inner
def end_step(plane, space, line, sea, ends, states, s, task, work, strains):
    """Report of a step that Newton has solved, and strains of its elements.

    Returns its largest turn of a chord, rad, and the cell; or the spin of a cell against the next one, where that is
    more than LARGEST_STEP_TURN: half a turn more or less would not show in the twist of the element between them.
    """
    old, new, was, now = states
    u, report, dt = work.u, work.report, s.dt
    sharp = (0.0, -1, 0.0, -1)
    if space is not None:
        sharp = sharpest_in_space(line, ends, new.e, new.T, new.a1, strains)
    if plane is not None:
        sharp = sharpest_in_plane(line, ends, new.e, new.T, new.a1, strains)
    report[BEND], report[BEND_NODE], report[TWIST], report[TWIST_NODE] = sharp
    if line.bits & FRICTION:
        report[SLACKEST], report[SLACKEST_CELL] = lowest_not_held(line, sea, new.T)
    else:
        report[SLACKEST], report[SLACKEST_CELL] = lowest(line, new.T)
    change, place = acceleration_change(old, new)
    _, _, _, _, part = weights(task.rho, task.rho_before, task.before / dt)
    report[LOCAL_ERROR], report[LOCAL_ERROR_NODE] = part * dt * dt * change, place
    report[USED_RHO] = task.rho
    if line.bits & TOUCHES:
        contact_work(line, sea, old, new, u, report)
    if plane is not None:
        if was.shape[0] > 0:
            n, A = was.shape[0], work.X
            if A.shape[0] > n * ROW:  # behind the factors that are kept
                A = A[n * (TRIPLE + KEPT) :]
            report[PUSH_ENERGY], report[WRONG_PIVOTS] = step_out_of_plane(line, sea, ends, new, s, was, now, A)
    if space is not None:
        spun, cell = largest_spin(line, ends, old, new, s)
        if not spun < LARGEST_STEP_TURN:
            return spun, cell
        if line.bits & OBSTACLES:
            node = passes(line, sea, old.r, u)
            if node >= 0:
                return THROUGH, min(node, old.T.shape[0] - 1)
    return largest_turn(old.e, u)
