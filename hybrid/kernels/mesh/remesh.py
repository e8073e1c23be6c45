"""Other cells for a line in the middle of a run.

There is one road for kinds of cells, cells that follow, and nodes at a winch.

Two sets of arrays with room for the most cells, the sides, take turns: a change goes from one to the other, and the
tables of the run get the numbers of the other one.  A planner says whether a change is due and how many cells there
will be; the parts of a change fill the new line, carry the state to it, and book what the run knows beside.

Steps, planners and parts are kernels of their own and called by address: a kernel takes a table of addresses as
constant (kernels.machine.references), so what writes to tables must not be one that reads them.  Tables differ with
the side, the parity of the state and the number of cells: each is fixed numbers plus numbers per old and new cell.

What a cell is made of is a row: weight, stiffness and curvature of rods, then by FIELDS whatever cells and nodes have
in proportion to length.  A cell that grows at a winch has the means of all that it consists of.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hybrid.kernels.contact.lines_distance import forget_distances
from hybrid.kernels.contact.self_distance import boxes_of
from hybrid.kernels.laws.bending_law import FIRST_A, FIRST_B, GIVE, HALF_A, HALF_B, LAST_A, LAST_B
from hybrid.kernels.laws.element import NO_SPRING, put_spring
from hybrid.kernels.laws.water import DIAMETER, LIFT_A, LIFT_B, RAMP
from hybrid.kernels.laws.water import OFFSET as OF_PLACE
from hybrid.kernels.machine.binding import places
from hybrid.kernels.machine.compile import inner, kernel
from hybrid.kernels.machine.references import NamedNumbers, by_reference, caller, reader, rows
from hybrid.kernels.mesh.zone_criteria import HINGE, LOAD, SMOOTH, STEP, NodeKinds
from hybrid.kernels.state import books as b
from hybrid.kernels.state.books import Clock
from hybrid.kernels.state.state import (
    FIELDS,
    HALF,
    MEAN,
    NO_LAW,
    POINT,
    ROD,
    SHARED,
    Field,
    Floats,
    Line,
    NumberBlocks,
    NumberRows,
    Rows,
    blank_line,
    blanks,
)

Numbers = NDArray[np.int64]

# Numbers of a change: energy before it and after it, J; its time, s; 1 where lengths were on their way.
BEFORE, AFTER, TIME, RELAXES = range(4)
NUMBERS = 4


class RemeshCalls(NamedNumbers, number=np.int64):
    """Addresses of the kernels that are called."""

    solver: int
    due: int  # with the table of the planner: whether a change is due, and may be made without Python, as a number
    plan: int  # how many cells there will be
    keep: int  # keeps what outputs that wait need of the line that they are of; how many numbers that are
    before_forces: int  # with the table of the run
    after_forces: int
    books: int  # of kernels.run.network.begin_line
    stand: int  # with the table beside, of a line as it is now; 0: none


class RemeshPlaces(NamedNumbers, number=np.int64):
    """Where things are: arrays, tables, memory for samples."""

    side: int  # of the arrays that are in use, and of the line now
    cells: int
    next_cells: int  # of a change that has begun
    changes: int  # so far
    begun: int  # parts of a change up to which nobody but its line has heard of it
    task: int  # where the table of the run has its task
    may_wait: int  # 1 where outputs may wait although the cells that they are of change
    waiting: int  # lines whose outputs wait; numbers that are kept for them; numbers of their samples
    placed: int
    used: int
    per_node: int  # numbers of a node that are kept at most, and room for all
    room: int
    number: int  # of the line in its network
    boxes_at: int  # where the table of kernels.contact.self_distance has the rows of its tree


# Columns of `waiting`, and of `parts`.
OFFSET, COUNT, IS_OF_CELLS = range(3)
ADDRESS, BEGIN, END = range(3)


class RemeshJob(NamedTuple):
    """A run with all that changes of cells need.  Tables: (..., 3, size) fixed, per old cell, per new cell."""

    calls: RemeshCalls
    at: RemeshPlaces
    clock: Clock  # of the run
    own: Clock  # and of the line, which is another one where there are several
    counts: b.Counts
    work: Rows
    numbers: Floats  # (NUMBERS,)
    planners: NumberRows  # (2 sides, size) tables of the planner
    parts: NumberRows  # (P, 3) address of the kernel of a part, begin and end of its table in `change`
    change: Numbers  # tables of the parts, one behind the other
    changed: NumberBlocks  # (2 old sides x 2 parities, 3, size)
    run: Numbers  # table of the run
    task: Numbers  # its task where forces of a line as it is are asked for
    run_places: Numbers  # of those of its numbers that follow the cells
    in_run: NumberBlocks  # (2 sides, 3, run_places.size)
    even: Numbers  # likewise its tables in steps from states of even parity, and of odd
    odd: Numbers
    even_joined: Numbers  # the same of steps without lines that are solved by themselves; empty: there are none
    odd_joined: Numbers
    in_odd: NumberBlocks  # likewise of those
    beside: Numbers  # likewise a table of what moves beside: zones, or the reel
    beside_places: Numbers
    in_beside: NumberBlocks
    itself: Numbers  # of kernels.contact.self_distance.watch_itself
    itself_places: Numbers  # empty: nobody watches
    in_itself: NumberBlocks
    waiting: NumberRows  # (lines, 3)
    pairs: NumberRows  # (K, WATCHED) of kernels.contact.lines_distance: lines that may overlap
    room: Rows  # (K, ROOM) and how far apart they are


blank_remesh_job = blanks(RemeshJob)
read = reader(blank_remesh_job())
call, call_count, call_solver = caller(None), caller(0), caller((0, 0, 0.0, 0))
boxes = inner(boxes_of)


@inner
def put(numbers, old, new, table):
    """A table for so many old and new cells."""
    for i in range(table.shape[0]):
        table[i] = numbers[0, i] + old * numbers[1, i] + new * numbers[2, i]


@inner
def put_at(numbers, places, cells, table):
    """Numbers of a table for so many cells, at some of its places."""
    for i in range(places.shape[0]):
        table[places[i]] = numbers[0, i] + cells * numbers[2, i]


@inner
def call_parts(job, first, last):
    """Parts of a change, from a number up to another one, which is excluded."""
    for k in range(first, last):
        call(job.parts[k, ADDRESS], job.change[job.parts[k, BEGIN] : job.parts[k, END]])


@kernel
def begin_cells(table):
    """Lay out the cells that are planned, and carry the state to them."""
    job = read(table)
    at = job.at
    k, n = at.side, at.cells
    m = call_count(job.calls.plan, job.planners[k])
    at.next_cells = m
    put(job.changed[2 * k + job.counts.parity], n, m, job.change)
    call_parts(job, 0, at.begun)


@kernel
def put_cells(table):
    """The run goes on with the line of now."""
    job = read(table)
    k, m = job.at.side, job.at.cells
    put_at(job.in_run[k], job.run_places, m, job.run)
    put_at(job.in_beside[k], job.beside_places, m, job.beside)
    if job.itself_places.shape[0] > 0:
        put_at(job.in_itself[k], job.itself_places, m, job.itself)
        job.itself[job.at.boxes_at] = boxes(m)
    put_at(job.in_run[k], job.run_places, m, job.even)
    put_at(job.in_odd[k], job.run_places, m, job.odd)
    if job.even_joined.shape[0] > 0:
        put_at(job.in_run[k], job.run_places, m, job.even_joined)
        put_at(job.in_odd[k], job.run_places, m, job.odd_joined)


@inner
def exchange_tasks(job):
    """The table of the run gets the other task: that of steps has lengths and schemes of its own."""
    for k in range(job.task.shape[0]):
        i = job.at.task + k
        job.run[i], job.task[k] = job.task[k], job.run[i]


@kernel
def end_cells(table):
    """Lengths, books and forces of the new cells, which the run goes on with; the energy is booked."""
    job = read(table)
    at, calls = job.at, job.calls
    call_parts(job, at.begun, job.parts.shape[0])
    at.side, at.cells, at.changes = 1 - at.side, at.next_cells, at.changes + 1
    put_cells(table)
    job.own.now = job.clock.now
    call(calls.before_forces, job.run)
    exchange_tasks(job)
    call_solver(calls.solver, job.run)
    exchange_tasks(job)
    if calls.stand != 0:
        call(calls.stand, job.beside)
    call(calls.after_forces, job.run)
    call(calls.books, job.run)
    forget_distances(job.pairs, job.room, at.number)
    job.clock.previous = job.clock.now
    job.work[0, b.ZONES] += job.numbers[AFTER] - job.numbers[BEFORE]


@inner
def keep_rows(job):
    """The outputs that have been sampled wait where they are, with what they need of the line that they are of."""
    at, some = job.at, job.counts.samples - job.at.used
    if some > 0:
        row = job.waiting[at.waiting]
        row[OFFSET], row[COUNT], row[IS_OF_CELLS] = at.used, some, at.cells
        at.placed += call_count(job.calls.keep, job.planners[at.side])
        at.used += some
        at.waiting += 1


# --- entries ----------------------------------------------------------------------------------------


@kernel
def ask_cells(table):
    """Whether a change is due, and may be made without Python, as a number."""
    job = read(table)
    at = job.at
    if call_count(job.calls.due, job.planners[at.side]) == 0:
        return 0
    room = at.waiting < job.waiting.shape[0] and at.placed + at.per_node * (at.cells + 1) <= at.room
    return 1 if job.counts.samples == at.used or (at.may_wait != 0 and room) else 0


@kernel
def change_cells(table):
    """Other cells, after outputs within the last step."""
    job = read(table)
    keep_rows(job)
    begin_cells(table)
    end_cells(table)
    return 1


# Columns of a row.
WEIGHT = 0
B_1 = 1  # first of three
KAPPA_1 = 4  # first of three
FIRST = 7
# Fields that follow from one number per length of the same name, column FIRST on; and those of bodies.
PER_LENGTH = tuple(name for name, field in FIELDS.items() if field.rule in (MEAN, HALF, ROD, SHARED))
OF_POINTS = tuple(name for name, field in FIELDS.items() if field.rule == POINT)
COLUMNS = FIRST + len(PER_LENGTH)
COMPLIANCE = FIRST + PER_LENGTH.index("ck")

_at = places(blank_line(1))


def _table(names: Iterable[str]) -> NDArray[np.int64]:
    """Of fields: where in the table of a line; column of a row; rule."""
    found = [(_at[x], FIRST + PER_LENGTH.index(x) if x in PER_LENGTH else -1, FIELDS[x].rule) for x in names]
    return np.array(found, np.int64)


def _numbers(of_node: bool) -> NDArray[np.int64]:
    """Of fields of float64 of nodes, or of cells: where in the table of a line, and columns; slips have any number."""

    def wanted(name: str, field: Field) -> bool:
        return field.of_node == of_node and field.kind is np.float64 and not name.startswith("slip")

    return np.array([(_at[x], max(y.columns, 1)) for x, y in FIELDS.items() if wanted(x, y)], np.int64)


CELLS = _table(x for x in PER_LENGTH if not FIELDS[x].of_node)
NODES = _table(x for x in PER_LENGTH if FIELDS[x].of_node)
POINTS = _table(OF_POINTS)
OF_NODES, OF_CELLS = _numbers(True), _numbers(False)
array = rows(blank_line(1))


@inner
def fill_cell(line, c, made, j, h):
    """What cell c has, of length h, that is made of row j."""
    for k in range(CELLS.shape[0]):
        x, rule = made[j, CELLS[k, 1]], CELLS[k, 2]
        if rule == HALF:
            x = 0.5 * h * x
        elif rule == ROD:
            x = h * line.spin[c] * x
        array(line, CELLS[k, 0], 1)[c, 0] = x


@inner
def fill_node(line, i, made, a, ha, b, hb):
    """What node i has between a cell of length ha, of row a, and one of hb, of row b; 0: there is no cell."""
    for k in range(NODES.shape[0]):
        x = NODES[k, 1]
        array(line, NODES[k, 0], 1)[i, 0] = 0.5 * (ha * made[a, x]) + 0.5 * (hb * made[b, x])
    line.mass[i] += line.point_mass[i]
    line.force[i, 0], line.force[i, 1] = 0.0, 0.0
    line.force[i, 2] = -0.5 * (ha * made[a, WEIGHT]) - 0.5 * (hb * made[b, WEIGHT]) + line.point_lift[i]
    line.hn[i] = 0.5 * ha + 0.5 * hb


@inner
def round_and_straight(line, i):
    """The element at node i of a swivel, whose sides have no direction in common: it bends as on average of its axes."""
    line.k0[i, 0], line.k0[i, 1] = 0.0, 0.0
    if line.kb[i, 0] != line.kb[i, 1]:
        bends = 2.0 / (1.0 / line.kb[i, 0] + 1.0 / line.kb[i, 1])
        line.kb[i, 0], line.kb[i, 1] = bends, bends


@inner
def fill_element(line, i, made, a, ha, b, hb, turns):
    """The element at node i, two halves in series; lengths: as of `fill_node`; turns: whether it lets go the twist."""
    one, two = 0.5 * ha, 0.5 * hb
    for k in range(3):
        B, kappa = B_1 + k, KAPPA_1 + k
        if hb == 0.0:
            line.kb[i, k], line.k0[i, k] = made[a, B] / one, one * made[a, kappa]
        elif ha == 0.0:
            line.kb[i, k], line.k0[i, k] = made[b, B] / two, two * made[b, kappa]
        else:
            line.kb[i, k] = 1.0 / (one / made[a, B] + two / made[b, B])
            line.k0[i, k] = one * made[a, kappa] + two * made[b, kappa]
    if turns:
        line.kb[i, 2] = 0.0
        if ha > 0.0 and hb > 0.0:
            round_and_straight(line, i)


@inner
def copy_items(line, i, out, j, fields):
    """Node or cell i of a line as j of another one; fields: OF_NODES or OF_CELLS."""
    for k in range(fields.shape[0]):
        x, y = array(line, fields[k, 0], fields[k, 1]), array(out, fields[k, 0], fields[k, 1])
        if y.shape[0] > 0:  # else it has none of it
            for column in range(y.shape[1]):
                y[j, column] = x[i, column]


@inner
def copy_node(line, i, out, j):
    """Node i of a line as node j of another one."""
    copy_items(line, i, out, j, OF_NODES)
    out.element[j] = line.element[i]
    for x, y in ((line.slip_law, out.slip_law), (line.slip_now, out.slip_now), (line.slip_flow, out.slip_flow)):
        for column in range(y.shape[1] if y.shape[0] > 0 else 0):
            y[j, column] = x[i, column]


@inner
def copy_cell(line, i, out, j):
    """Cell i of a line as cell j of another one."""
    copy_items(line, i, out, j, OF_CELLS)
    out.spin[j] = line.spin[i]


@inner
def came_from(k, n, m, forward, cut, step):
    """Item k of m, counted from the far end, and the one of n that it comes from: numbers in their lines."""
    j = k if k < cut else max(k - step, 0)
    return (k, j) if forward else (m - 1 - k, n - 1 - j)


@kernel
def move_line(line, out, forward, cut, step):
    """Cells and nodes that stay; those that are new have the values of their neighbours (kernels.reel.payout_nodes.move_row)."""
    n, m = line.h.shape[0], out.h.shape[0]
    for k in range(m + 1):
        to, of = came_from(k, n + 1, m + 1, forward, cut, step)
        copy_node(line, of, out, to)
    for k in range(m):
        to, of = came_from(k, n, m, forward, cut, step)
        copy_cell(line, of, out, to)


# The line of a material on cells, and what criteria know of it, for any cells on the same base cells.  Sections, modules
# and points begin and end at base nodes, so a base cell has one of everything per length.


class Cable(NamedTuple):
    """A material on n base cells, and points at the n+1 base nodes."""

    made: Floats  # (n, COLUMNS) as of kernels.mesh.remesh
    EI: Floats  # N m2, mean of both axes
    w: Floats  # N/m, weight in water
    points: Floats  # (P, n+1) of bodies, as OF_POINTS has them
    blank: Floats  # (P,) of nodes without a body
    load: NDArray[np.int8]  # (n+1,) 1 where there is one
    turns: NDArray[np.int8]  # (n+1,) 1 where there is a swivel
    held: NDArray[np.int8]  # (2, 2) whether an element sits at the ends of a rod, and resists twist
    springs: Floats  # (2,) N m/rad, angular springs between held tangents and a rod; infinite: rigid
    width: Floats  # (n,) m, outer diameter
    law_table: Rows  # as of `Line`
    bend_table: Rows
    law: Rows  # (n, 14) as `Line.law`; empty, as what follows: no cell has one
    torque: Floats  # (n,) N m per N, torque by tension
    wake: Rows  # (n, WAKE) of vortices
    bend: Rows  # (n, BEND) of tables of moment over curvature
    mixed: NDArray[np.int8]  # (n+1,) 1 where such a table meets two bending stiffnesses: its bends are layers there


# Columns of `Cable.wake`: lift per length (kg/m2), what `Line.wake_law` has of nodes, and m, over which phases go once
# round; of `Cable.bend`: first row of a table and the one behind its last, and whether it is none.
LIFT = 0
OF_NODE = 1  # first of five
AROUND = 6
WAKE = 7
TABLE_FIRST, TABLE_LAST, NO_TABLE = range(3)
BEND = 3


def blank_cable(n: int) -> Cable:
    """A cable of nothing on n base cells."""
    z, points = np.zeros, len(OF_POINTS)
    load, turns, held, springs = z(n + 1, np.int8), z(n + 1, np.int8), z((2, 2), np.int8), np.full(2, np.inf)
    laws = z((0, 3)), z((0, 3)), z((0, NO_LAW.shape[1])), z(0), z((0, WAKE)), z((0, BEND)), z(n + 1, np.int8)
    return Cable(z((n, COLUMNS)), z(n), z(n), z((points, n + 1)), z(points), load, turns, held, springs, z(n), *laws)


by_reference(blank_cable(1))


class LineJob(NamedTuple):
    """A cable, its cells, and the line of these (written)."""

    cable: Cable
    nodes: Floats  # (N+1,) m
    base_of_cell: NDArray[np.int64]  # (N,)
    rod: NDArray[np.bool_]  # (N,)
    line: Line


class KindsJob(NamedTuple):
    """A cable, its cells, and what criteria know of them (written)."""

    cable: Cable
    base_of_cell: NDArray[np.int64]  # (N,)
    kinds: NodeKinds
    hinged: NDArray[np.bool_]  # (2,) whether ends turn freely
    floor_part: float  # of (EI w^2)^(1/3) that a tension must have
    least: float  # N, that it must have whatever the cable


blank_line_job = blanks(LineJob)


blank_kinds_job = blanks(KindsJob)
read_line, read_kinds = reader(blank_line_job()), reader(blank_kinds_job())


@inner
def base_node(of, i):
    """The base node that node i is; -1: it lies between two."""
    n = of.shape[0]
    if i == n:
        return of[n - 1] + 1
    return of[i] if i == 0 or of[i] != of[i - 1] else -1


@inner
def fill_laws_of_cell(line, c, cable, j):
    """Tension over strain, and torque by tension, of cell c on base cell j."""
    if line.law.shape[0] > 0:
        for k in range(line.law.shape[1]):
            line.law[c, k] = cable.law[j, k]
    if line.tension_torque.shape[0] > 0:
        x = cable.torque[j]
        line.tension_torque[c] = x
        line.tension_twist[c] = 0.5 * line.h[c] * x / cable.made[j, B_1 + 2] if x != 0.0 else 0.0


@inner
def fill_wake(line, i, cable, a, ha, b, hb):
    """Vortices at node i; arguments: as of `fill_node`, with base cells in place of rows."""
    law, one, other = line.wake_law, cable.wake[a], cable.wake[b]
    law[i, LIFT_A], law[i, LIFT_B] = 0.5 * ha * one[LIFT], 0.5 * hb * other[LIFT]
    count = (ha > 0.0 and one[OF_NODE] > 0.0) + (hb > 0.0 and other[OF_NODE] > 0.0)
    for k in range(RAMP + 1 - DIAMETER):
        x = (one[OF_NODE + k] if ha > 0.0 else 0.0) + (other[OF_NODE + k] if hb > 0.0 else 0.0)
        law[i, DIAMETER + k] = x / max(count, 1)
    law[i, OF_PLACE] = 2.0 * math.pi * line.s[i] / one[AROUND]


@inner
def fill_bend(line, i, cable, a, ha, b, hb, mixed, spring):
    """The table of moment over curvature of the element at node i; spring: N m/rad, in series, infinite: none."""
    law, one, other = line.bend_law, cable.bend[a], cable.bend[b]
    for k in range(law.shape[1]):
        law[i, k] = 0.0
    plain = (ha == 0.0 or one[NO_TABLE] > 0.0) and (hb == 0.0 or other[NO_TABLE] > 0.0)
    if plain or mixed or not line.element[i]:
        return
    if ha > 0.0:
        law[i, FIRST_A], law[i, LAST_A], law[i, HALF_A] = one[TABLE_FIRST], one[TABLE_LAST], 0.5 * ha
    if ha > 0.0 and hb > 0.0 and one[TABLE_FIRST] == other[TABLE_FIRST]:
        law[i, HALF_A] += 0.5 * hb
    elif hb > 0.0:
        law[i, FIRST_B], law[i, LAST_B], law[i, HALF_B] = other[TABLE_FIRST], other[TABLE_LAST], 0.5 * hb
    if spring < np.inf:
        j, half = (a, 0.5 * ha) if hb == 0.0 else (b, 0.5 * hb)
        stiffness = 0.5 * (cable.made[j, B_1] + cable.made[j, B_1 + 1]) / half
        law[i, GIVE] = 1.0 / max(spring, NO_SPRING * stiffness)


@kernel
def fill_line(table):
    """The line of a LineJob."""
    job = read_line(table)
    cable, of, line, s, rod = job.cable, job.base_of_cell, job.line, job.nodes, job.rod
    made, n = cable.made, job.line.h.shape[0]
    for c in range(n):
        line.h[c], line.spin[c] = s[c + 1] - s[c], rod[c]
        fill_cell(line, c, made, of[c], line.h[c])
        fill_laws_of_cell(line, c, cable, of[c])
    for i in range(n + 1):
        b, e, j = max(i - 1, 0), min(i, n - 1), base_node(of, i)
        hb = line.h[b] if i > 0 else 0.0
        he = line.h[e] if i < n else 0.0
        line.s[i] = s[i]
        for k in range(POINTS.shape[0]):
            array(line, POINTS[k, 0], 1)[i, 0] = cable.points[k, j] if j >= 0 else cable.blank[k]
        fill_node(line, i, made, of[b], hb, of[e], he)
        for k in range(3):
            line.kb[i, k], line.k0[i, k] = 0.0, 0.0
        inside = 0 < i < n
        end = 1 if i == n else 0
        line.element[i] = line.spin[b] and line.spin[e] and (inside or cable.held[end, 0])
        if line.element[i]:
            turns = (j >= 0 and cable.turns[j]) if inside else not cable.held[end, 1]
            fill_element(line, i, made, of[b], hb, of[e], he, turns)
            if not inside and cable.springs[end] < np.inf:
                put_spring(cable.springs[end], line, i)
        if line.bend_law.shape[0] > 0:
            mixed = j >= 0 and cable.mixed[j]
            fill_bend(line, i, cable, of[b], hb, of[e], he, mixed, np.inf if inside else cable.springs[end])
        if line.wake_law.shape[0] > 0:
            fill_wake(line, i, cable, of[b], hb, of[e], he)
        if line.bed_width.shape[0] > 0:
            one = cable.width[of[b]]
            line.bed_width[i] = one + he / (hb + he) * (cable.width[of[e]] - one)


@kernel
def fill_kinds(table):
    """What the criteria know of the nodes of a KindsJob."""
    job = read_kinds(table)
    cable, of, kinds, made = job.cable, job.base_of_cell, job.kinds, job.cable.made
    n, X, Y = of.shape[0], KAPPA_1, KAPPA_1 + 1
    for i in range(n + 1):
        a, b = of[max(i - 1, 0)], of[min(i, n - 1)]
        kinds.EI[i], kinds.w[i] = max(cable.EI[a], cable.EI[b]), max(cable.w[a], cable.w[b])
        kinds.GJ[i] = min(made[a, B_1 + 2], made[b, B_1 + 2])
        bent = max(made[a, X] ** 2 + made[a, Y] ** 2, made[b, X] ** 2 + made[b, Y] ** 2)
        kinds.bent[i] = bent**0.5
        kinds.node[i] = STEP if cable.EI[a] != cable.EI[b] else SMOOTH
        at_base = i == 0 or i == n or a != b
        if at_base and cable.load[b if i < n else b + 1]:
            kinds.node[i] = LOAD
        if (i == 0 and job.hinged[0]) or (i == n and job.hinged[1]):
            kinds.node[i] = HINGE
        kinds.floor[i] = max(job.floor_part * (kinds.EI[i] * kinds.w[i] ** 2) ** (1.0 / 3.0), job.least)
        if i < n:
            kinds.base_of_cell[i] = of[i]
