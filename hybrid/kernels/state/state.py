"""The arrays a solver works on: the line (what does not move), its ends, the sea around it, its state, its work.

All are NamedTuples of contiguous arrays with fixed types, so that one compiled signature serves every scene.  N cells, N+1 nodes; SI units; inertial frame unless said.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Annotated, Any, NamedTuple, TypeVar, get_args, get_type_hints

import numpy as np
from numpy.typing import NDArray

from hybrid.kernels.machine.references import by_reference, examples
from hybrid.kernels.state.report import (
    CARRIED,
    EACH,
    ENDED,
    FORCE,
    FREE,
    NO_BOXES,
    NO_FACETS,
    OBSTACLE,
    OFFSET,
    REMEMBERS,
    REPORT_SIZE,
    SEEN,
    TURNED,
)

# What a field of a line is: one for every node or cell, and how it follows from what the material has per length.
#
# Each field of `kernels.state.state.Line` says it beside its name; whatever makes, copies or moves lines reads it from
# there.

# How a field of a cell or of a node follows from what there is per length, x, over the length h of the cells.
MEAN = 0  # of a cell: the mean of x
HALF = 1  # h x/2, of half the cell
ROD = 2  # h x where the cell is of a rod, else 0
SHARED = 3  # of a node: h x/2 of the cells beside it, and what a body there has
POINT = 4  # of a node: of the body there
OWN = 5  # by a rule of its own (kernels.mesh.remesh)


class Field(NamedTuple):
    """What stands beside the name of a field."""

    of_node: bool
    rule: int = OWN
    columns: int = 0  # 0: one number
    kind: Any = np.float64
    optional: bool = False  # whether a line may have none of it: then the array is empty


def node(rule: int = OWN, columns: int = 0, kind: Any = np.float64, optional: bool = False) -> Field:
    """There is one for every node."""
    return Field(True, rule, columns, kind, optional)


def cell(rule: int = OWN, columns: int = 0, kind: Any = np.float64, optional: bool = False) -> Field:
    """There is one for every cell."""
    return Field(False, rule, columns, kind, optional)


def fields_of(line: type) -> dict[str, Field]:
    """The fields along the line, of a class whose annotations have them."""
    found = {name: getattr(x, "__metadata__", ()) for name, x in get_type_hints(line, include_extras=True).items()}
    return {name: x[0] for name, x in found.items() if x}


def blank(field: Field, cells: int) -> NDArray[Any]:
    """Zeros of a field on so many cells; of one that a line may have none of, none."""
    size = 0 if field.optional else cells + field.of_node
    return np.zeros((size, field.columns) if field.columns else size, field.kind)


# The arrays a solver works on: the line (what does not move), its ends, the sea around it, its state, its work.

Floats = NDArray[np.float64]
# Nodes for which waves are computed at a time: two vectors of eight float64, or four of four.
LANES = 16
# Of a line in space.  Writeable: a read-only default would give every kernel a second signature.
NO_PLANE: Floats = np.full((3, 3), np.nan)
NOT_VARYING: Floats = np.zeros(0)
# Of a line without catenary zones that a torque passes through.
NO_TORSION: Floats = np.zeros((0, 5))
NO_TENSION_TORQUE: Floats = np.zeros(0)
NO_TURN: Floats = np.zeros((0, 3))
NO_TURNS: Floats = np.zeros((0, 0, 3))
# Of a line whose tensions are multiples of strains (kernels.laws.axial_law has the columns).
NO_LAW: Floats = np.zeros((0, 14))
WORKING = 5  # the column that says which cells remember their highest mean tension; 0: not this one
NO_TABLE: Floats = np.zeros((0, 3))
# Of a line whose moments are multiples of curvature (kernels.laws.bending_law has the columns).
NO_BEND_LAW: Floats = np.zeros((0, 7))
# Of a line without layers that slip (kernels.laws.bending_law has the columns).
NO_SLIP: Floats = np.zeros((0, 4))
NO_SLIP_FLOW: Floats = np.zeros((0, 2))
ROWS: Floats = np.zeros((1, 3))  # any, as an example
NO_LAYERS: Floats = np.zeros((0, 0))
# Of a line without vortices (kernels.laws.water has the columns).
NO_WAKE_LAW: Floats = np.zeros((0, 8))
NO_WAKE: Floats = np.zeros((0, 4))
NO_SLOW: Floats = np.zeros(0)
NO_PEAK: Floats = np.zeros(0)
NO_OBSTACLES: Floats = np.zeros((0, OBSTACLE))
# Of a scene in which no obstacle moves (kernels.state.report has the columns).
NO_CARRIED: Floats = np.zeros((0, CARRIED))
NO_OBSTACLES_SEEN: Floats = np.zeros((0, 0, SEEN))
NO_GRIP: Floats = np.zeros((0, 0))
NO_LAYERS_SEEN: Floats = np.zeros((0, 0, 0))
# Of a line on a bed that does not remember (kernels.laws.seabed has the columns), and of outputs of one.
NO_SOIL: Floats = np.zeros((0, 6))
NO_SOIL_SEEN: Floats = np.zeros((0, 0, 0))
NO_SHEAVES: Floats = np.zeros((0, 4))
NO_ROOM: Floats = np.zeros((0, 0, 0))
NO_MOVED: NDArray[np.int8] = np.zeros(0, np.int8)


class Line(NamedTuple):
    """What the plan says: mesh, stiffness, mass and load parameters.

    A parameter of a force that is off (see `bits`) is NaN: used by mistake, it shows at once.
    """

    s: Annotated[Floats, node()]  # (N+1,) m, unstretched arc length of the nodes
    h: Annotated[Floats, cell()]  # (N,) m, unstretched cell length
    ck: Annotated[Floats, cell(MEAN)]  # (N,) 1/N, axial compliance; 0 when inextensible
    mass: Annotated[Floats, node(SHARED)]  # (N+1,) kg, of the half cells that meet at the node
    force: Annotated[Floats, node(columns=3)]  # (N+1, 3) N, weight and buoyancy
    element: Annotated[NDArray[np.int8], node(kind=np.int8)]  # (N+1,) 1 where a rod element sits
    spin: Annotated[NDArray[np.int8], cell(kind=np.int8)]  # (N,) 1 where the cell has a frame and a spin
    kb: Annotated[Floats, node(columns=3)]  # (N+1, 3) N m, stiffness of the element (two bending, torsion)
    k0: Annotated[Floats, node(columns=3)]  # (N+1, 3) rad, its strain without stress
    hn: Annotated[Floats, node()]  # (N+1,) m, length an element stands for
    rotary: Annotated[Floats, cell(ROD)]  # (N,) kg m2, transverse rotary inertia of the cell
    polar: Annotated[Floats, cell(ROD)]  # (N,) kg m2, polar inertia of the cell
    drag_n: Annotated[Floats, cell(HALF)]  # (N,) kg/m, of half the cell
    drag_t: Annotated[Floats, cell(HALF)]  # (N,) kg/m
    added_n: Annotated[Floats, cell(HALF)]  # (N,) kg, of half the cell
    added_t: Annotated[Floats, cell(HALF)]  # (N,) kg
    damp: Annotated[Floats, node(SHARED)]  # (N+1,) kg/s, mass-proportional damping of the node
    tau: Annotated[Floats, cell(MEAN)]  # (N,) s, stiffness-proportional damping time
    # (N,) N, buoyancy of half the cell where it depends on the surface (else part of `force`)
    buoy: Annotated[Floats, cell(HALF)]
    # (N,) kg, water displaced by half the cell, on which the pressure of waves acts
    displaced: Annotated[Floats, cell(HALF)]
    diameter: Annotated[Floats, cell(MEAN)]  # (N,) m, over which a cell passes through the surface
    point_mass: Annotated[Floats, node(POINT)]  # (N+1,) kg, of a body at the node (part of `mass`)
    point_lift: Annotated[Floats, node(POINT)]  # (N+1,) N, buoyancy less weight of a body at the node (part of `force`)
    point_drag: Annotated[Floats, node(POINT)]  # (N+1,) kg/m, rho CdA/2 of a body at the node
    point_added: Annotated[Floats, node(POINT)]  # (N+1,) kg, added mass of a body at the node
    # (N+1,) N, buoyancy of a body at the node where it depends on the surface (else in `force`)
    point_buoy: Annotated[Floats, node(POINT)]
    point_displaced: Annotated[Floats, node(POINT)]  # (N+1,) kg, water displaced by a body at the node
    # (N+1,) wetted part from which on a body has its added mass; less of it at a smaller one
    point_floats: Annotated[Floats, node(POINT)]
    point_height: Annotated[Floats, node(POINT)]  # (N+1,) m, over which a body passes through the surface
    # (N+1,) 1 where a body is a cylinder that stands upright, 0 where it is a sphere
    point_upright: Annotated[Floats, node(POINT)]
    # (N+1,) m, length of cable that presses on the seabed as much as the body at the node
    footing: Annotated[Floats, node(POINT)]
    bits: int  # which optional forces are on (kernels.state.report)
    plane: Floats = NO_PLANE  # (3, 3) rows p, q and the normal p x q of the plane that a planar line lies in
    # (K, 5) catenary zones that a torque passes through: first cell, cell after the last, compliance (rad per N m),
    # turn without torque (rad), stiffness-proportional damping time (s)
    torsion: Floats = NO_TORSION
    # (N, 13) of cells whose tension is no multiple of strain (kernels.laws.axial_law); empty: there are none
    law: Annotated[Floats, cell(columns=14, optional=True)] = NO_LAW
    law_table: Floats = NO_TABLE  # (K, 3) tables that it speaks of: strain, tension (N), energy per length (J/m)
    # (N,) of sections in which tension makes a torque (kernels.laws.tension_torque): torque by tension, N m per N; twist of half
    # a cell by tension, rad/N; empty: there are none
    tension_torque: Annotated[Floats, cell(optional=True)] = NO_TENSION_TORQUE
    tension_twist: Annotated[Floats, cell(optional=True)] = NO_TENSION_TORQUE
    # (N+1, 7) of elements whose moment is no multiple of bend (kernels.laws.bending_law); empty: there are none
    bend_law: Annotated[Floats, node(columns=7, optional=True)] = NO_BEND_LAW
    bend_table: Floats = NO_TABLE  # (K, 3) tables that it speaks of: curvature (1/m), moment (N m), energy per length
    # (N+1, 8) of nodes with vortices (kernels.laws.water); empty: there are none
    wake_law: Annotated[Floats, node(columns=8, optional=True)] = NO_WAKE_LAW
    # (N+1, 4 L) of elements with up to L layers that slip (kernels.laws.bending_law), and how far they have, written before
    # every march; empty: there are none
    slip_law: Annotated[Floats, node(columns=4, optional=True)] = NO_SLIP
    slip_now: Annotated[Floats, node(columns=4, optional=True)] = NO_SLIP
    # (N+1, 2 L) 1/m, by how much State.layers is another in a step because material flows past nodes
    # (kernels.reel.paid_length); empty: the line is not paid out
    slip_flow: Annotated[Floats, node(columns=2, optional=True)] = NO_SLIP_FLOW
    # (N+1,) m, diameter with which nodes lie in soil (kernels.laws.seabed); empty: there is none
    bed_width: Annotated[Floats, node(optional=True)] = NO_PEAK
    moved: NDArray[np.int8] = (
        NO_MOVED  # (M,) of all obstacles: 1 where one moves, 2 where one turns freely; empty: none does
    )


FIELDS = fields_of(Line)
# Of these there is one for every node; of all but what belongs to the whole line or to few, one for every node or cell.
NODES_OF_LINE = tuple(name for name, x in FIELDS.items() if x.of_node and not x.optional)
ALONG_LINE = tuple(name for name, x in FIELDS.items() if not x.optional)
TENSION_TORQUE = ("tension_torque", "tension_twist")


class Ends(NamedTuple):
    """What the two ends impose at one moment; row 0 the start, row 1 the end."""

    held: NDArray[np.int8]  # (2,) 1 where the position is given
    position: Floats  # (2, 3) m
    frame: Floats  # (2, 9) columns (a1, a2, tangent), row order; read only where an element sits at the end
    spin: Floats  # (2, 3) 1/s, angular velocity of that frame
    force: Floats  # (2, 3) N, applied to the cable
    moment: Floats  # (2, 3) N m, applied to the cable; read where a rod ends without an element


class Moves(NamedTuple):
    """How what the two ends impose changes in time (kernels.laws.end_motion); row 0 the start, row 1 the end.

    E harmonics, L loads that act now, K knots of motion files.  What is absent has no rows, or zeros where said.
    """

    prescribed: NDArray[np.int8]  # (2, 2) 1 where a motion prescribes the position; the frame
    position: Floats  # (2, 3) m, without motion
    frame: Floats  # (2, 9) without motion; as Ends.frame
    ramp: Floats  # (2,) s, over which the harmonics of an end grow; 0: none
    harmonics: Floats  # (E, 5) end; axis, 0 to 2 along x, y, z, 3 to 5 about them; m or rad; 1/s; rad
    velocity: Floats  # (2, 3) m/s, steady
    velocity_ramp: Floats  # (2,) s, over which it grows; 0: no velocity
    travel: Floats  # (2, 5) m: the way; s: its beginning and duration; duration 0: no travel
    follows: NDArray[np.int8]  # (2,) 1 where the end follows the surface of the sea
    file: NDArray[np.int64]  # (2, 2) first and last row of `knots`; equal: no file
    knots: Floats  # (K,) s
    cubics: Floats  # (K, 6, 4) coefficients from a knot on, highest power first: m (3), rotation vector in rad (3)
    missing: Floats  # (2, 4) axis and angle (rad) by which a frame has still to turn at t = 0; angle 0: none
    bring_in: float  # s, over which it does
    driven: NDArray[np.int8]  # (2, 2) 1 where the position, the frame, is set from outside, step by step
    paths: Floats  # (2, 26) of driven ends: from t to t' (s), position and velocity at both (m, m/s), then
    # the frame at t and the rotation vector to that at t', in the axes of the frame (rad)
    loads: Floats  # (L, 8) end; 0 force, 1 moment; N or N m (3); s, over which it grows, 0: at once; of `history` the
    # first row and the one behind the last; equal: constant
    history: Floats  # (H, 4) s, N or N m (3), linear between the rows of a load
    fairlead: Floats  # (2, FAIRLEAD) of ends on a body that moves as is said above, below


# Numbers of `Moves.fairlead`.
RIDES = 0  # NOT_ON_BODY, TURNS_FREELY or TURNS_WITH_BODY
PLACE_THERE = 1  # 3, on a body that moves, m
SEAT_THERE = 4  # 9, frame: in axes of the body where it turns with it, else inertial
FAIRLEAD = 13
NOT_ON_BODY = 0.0
TURNS_FREELY = 1.0
TURNS_WITH_BODY = 2.0


class Sea(NamedTuple):
    """What surrounds the line at one moment.  Parameters of what is off are NaN or empty.

    `flow` and what follows are work arrays, `courses` and `carried` aside: `flow` and `lanes` are filled by
    `kernels.laws.water.wave_kinematics`, `axis`, `slip` and `grip` at the start of a step, `slid` and `bed` by the march.
    """

    z: Floats  # (K,) m, increasing: heights of the current profile
    current: Floats  # (K, 3) m/s, at these heights; linear between, constant beyond
    waves: Floats  # (W, 6) m, 1/s, 1/m, 1/m, rad, 1/m: amplitude, frequency, kx, ky, phase, k
    orbits: Floats  # (W,) m/s, amplitude of their velocity, times cosh k(d + z)/sinh k d: A w of linear waves
    stretched: float  # 1: kinematics are stretched to the moving surface (Wheeler); 0: they hold up to it
    depth: float  # m, for waves; infinite in deep water
    surface: float  # m, z of still water
    now: Floats  # (4,) time, s; grown part of the current; of the waves, and its rate, 1/s
    ramps: Floats  # (2,) s, over which the current and the waves grow from nothing; 0: there from the start
    normal: Floats  # (3,) unit normal of the seabed, upwards
    offset: float  # m, normal . x on the seabed
    bed_x: Floats  # (K,) m, increasing: of a bed of depths on a grid (kernels.laws.seabed); empty: the bed is a plane
    bed_y: Floats  # (M,) m, increasing
    bed_heights: Floats  # (K M, 4) z (m), its slopes along x and y, and the rate of these along the other, 1/m
    stiffness: float  # N/m per m
    damping: float  # N s/m per m
    onset: float  # m, penetration over which contact sets in
    friction: Floats  # (2,) axial and lateral coefficient
    slip_length: float  # m, elastic travel before a touching cable slides
    obstacles: Floats  # (M, OBSTACLE) obstacles (kernels.state.report), where they are now; empty: there are none
    flow: Floats  # (N+1, 7) velocity and acceleration of the waves at the nodes, and their elevation there
    lanes: Floats  # (10 + 2 W, LANES) what kernels.laws.water needs for LANES nodes at a time
    axis: Floats  # (N+1, 3) direction of the cable in the plane of the seabed
    slip: Floats  # (N+1, 3) m, elastic travel at the start of the step
    slid: Floats  # (N+1, 3) m, at its end
    bed: Floats  # (N+1, 3) N, force of the seabed and of obstacles on the nodes
    courses: Moves  # how obstacles move, a row each; empty: none does
    carried: Floats  # (M, CARRIED) how far they have (kernels.laws.obstacles); empty: none does
    grip: Floats  # (N+1, 6 M) as `State.grip`, at the start of the step; empty: no obstacle moves
    rolling: Floats  # (2 K, N+1, 5) -p and q of K sheaves that turn freely (kernels.laws.obstacle_grip)
    boxes: Floats = NO_BOXES  # (B, BOX_ROW) boxes over facets (kernels.state.report); empty: no obstacle has any
    facets: Floats = NO_FACETS  # (F, FACET) of surfaces of triangles, in axes of their obstacles
    soil: Floats = NO_SLOW  # of a bed that remembers (kernels.laws.seabed); empty: it does not


class State(NamedTuple):
    """Where the cable is.  The only history is kinematic; tension and moment carry none."""

    r: Floats  # (N+1, 3) m
    v: Floats  # (N+1, 3) m/s
    a: Floats  # (N+1, 3) m/s2, algorithmic acceleration of generalized-alpha
    vd: Floats  # (N+1, 3) m/s2, true acceleration
    e: Floats  # (N, 3) m, chords, accumulated from increments
    T: Floats  # (N,) N
    a1: Floats  # (N, 3) first director of the cell's frame; unit, normal to the chord where spin = 1
    w: Floats  # (N,) 1/s, spin rate about the chord
    wa: Floats  # (N,) 1/s2, algorithmic spin acceleration
    wd: Floats  # (N,) 1/s2, true spin acceleration
    slip: Floats  # (N+1, 3) m, elastic travel of friction on the seabed and on obstacles
    bed: Floats  # (N+1, 3) N, force of the seabed and of obstacles
    # (K, 3) of zones that a torque passes through: turn of the frame after the zone against that before it, counted
    # beyond half a turn (rad), torque (N m), power that the torque gains because the zone bends without it (W)
    turn: Floats = NO_TURN
    slow: Floats = NO_SLOW  # (N,) N, mean tension of lines with a `law`; else empty
    wake: Floats = NO_WAKE  # (N+1, 4) of lines with a `wake_law` (kernels.laws.water); else empty
    # (N+1, 6 M) of each obstacle, of lines with `moved` (kernels.laws.obstacle_grip); else empty
    grip: Floats = NO_GRIP
    sheave: Floats = NO_SHEAVES  # (M, 4) of all obstacles where one turns freely (laws.obstacle_grip); else empty
    peak: Floats = NO_PEAK  # (N,) N, highest mean tension of lines with a section that remembers it; else empty
    layers: Floats = NO_LAYERS  # (N+1, 2 L) 1/m, how far layers have slipped, of lines with a `slip_law`; else empty
    soil: Floats = NO_SOIL  # (N+1, 6) of lines on a bed that remembers (kernels.laws.seabed); else empty

    def copy(self) -> State:
        return State(*(x.copy() for x in self))


# What only some lines have of a state: of others it is empty, and earlier programs did not keep all of it.
OPTIONAL_STATE = ("turn", "slow", "wake", "grip", "sheave", "peak", "layers", "soil")


class Batch(NamedTuple):
    """What outputs are made of: nb states with their ends and what was reported of them, one row per output.

    float64 but for `held`; arrays may be views of larger ones, contiguous but in the first axis.
    """

    t: Floats  # (nb,) s
    r: Floats  # (nb, N+1, 3) m
    v: Floats  # (nb, N+1, 3) m/s
    vd: Floats  # (nb, N+1, 3) m/s2, true acceleration
    e: Floats  # (nb, N, 3) m
    T: Floats  # (nb, N) N
    a1: Floats  # (nb, N, 3)
    w: Floats  # (nb, N) 1/s
    held: NDArray[np.int8]  # (nb, 2) this and the five that follow: as `Ends` has them
    position: Floats  # (nb, 2, 3) m
    frame: Floats  # (nb, 2, 9)
    spin: Floats  # (nb, 2, 3) 1/s
    force: Floats  # (nb, 2, 3) N
    moment: Floats  # (nb, 2, 3) N m
    report: Floats  # (nb, REPORT_SIZE) as named in kernels.state.report
    work: Floats  # (nb, number of powers) J, since the start
    sea_now: Floats  # (nb, 4) as `Sea.now`
    h: Floats = NOT_VARYING  # (nb, N) m, lengths of cells where they change in a run; else empty: those of the line
    kb: Floats = NOT_VARYING  # (nb, N+1, 3) N m, stiffness of elements, likewise
    turn: Floats = NO_TURNS  # (nb, K, 3) as `State.turn`
    touch: Floats = NOT_VARYING  # (nb, N+1) N/m, of contact of the line with itself; empty: there is none
    obstacles: Floats = NO_OBSTACLES_SEEN  # (nb, M, SEEN) where they are, and what acts on them; empty: none moves
    layers: Floats = NO_LAYERS_SEEN  # (nb, N+1, 2 L) as `State.layers`
    soil: Floats = NO_SOIL_SEEN  # (nb, N+1, 6) as `State.soil`

    def line(self, k: int, line: Line) -> Line:
        """The line at output k, from the one of all outputs."""
        return line._replace(h=self.h[k], kb=self.kb[k]) if self.h.size else line

    def stiffness(self, node: int, line: Line) -> Floats:
        """Stiffness (1 or nb, 3) N m of the element at a node."""
        return self.kb[:, node] if self.kb.size else line.kb[None, node]


def batch_of_one(
    t: float, ends: Ends, state: State, report: Floats, work: Floats, sea: Sea, touch: Floats | None = None
) -> Batch:
    """The batch of a single output at time t, s, with copies of what the next step overwrites.

    touch: (N+1,) N/m, force of the line on itself; None: it does not touch itself.
    """
    known = state._asdict() | ends._asdict() | {"report": report, "work": work, "sea_now": sea.now}
    known |= {} if touch is None else {"touch": touch}
    now = {x: known[x][None].copy() for x in Batch._fields if x in known and (known[x].size or x == "turn")}
    now |= {"obstacles": obstacles_now(sea, state)[None]} if state.grip.size else {}
    return Batch(t=np.array([t]), **now)


def obstacles_now(sea: Sea, state: State) -> Floats:
    """Where obstacles are that move, and what the line does to them: (M, SEEN) of kernels.state.report."""
    turned = sea.carried[:, TURNED : TURNED + 9]
    # the middle of what bodies carry
    offset = np.einsum("kij,kj->ki", turned.reshape(-1, 3, 3), sea.carried[:, OFFSET : OFFSET + 3])
    place = sea.carried[:, ENDED : ENDED + 3] + offset
    force = -state.grip.reshape(len(state.r), -1, EACH)[:, :, FORCE:]
    moment = np.cross(state.r[:, None] - place, force)
    return np.hstack([place, turned, force.sum(axis=0), moment.sum(axis=0)])


def state_in(batch: Batch, k: int, line: Line) -> State:
    """The state of a line at output k, in arrays of its own.

    Algorithmic accelerations and friction are not known, and mean tensions are those of a line at rest.
    """
    state = state_for(line)
    state.turn[:] = batch.turn[k] if batch.turn.size else 0.0
    state.slow[:] = batch.T[k] if state.slow.size else 0.0
    state.layers[:] = batch.layers[k] if batch.layers.size else 0.0
    state.soil[:] = batch.soil[k] if batch.soil.size else 0.0
    for name in ("r", "v", "vd", "e", "T", "a1", "w"):
        getattr(state, name)[:] = getattr(batch, name)[k]
    return state


def ends_in(batch: Batch, k: int) -> Ends:
    """The conditions of the ends at output k, in arrays of their own."""
    rows = (batch.held, batch.position, batch.frame, batch.spin, batch.force, batch.moment)
    return Ends(*(np.array(x[k]) for x in rows))


class Torsion(NamedTuple):
    """What a torque through K catenary zones takes beside the march (kernels.march.zone_torque); empty: there is none."""

    passed: Floats  # (2, N) N m of cells of rods beside zones: torque on their spin; stiffness that holds it meanwhile
    slope: Floats  # (N, 3) 1/m, how the turn of the zone of a cell, or beside it, answers to its chord
    directions: Floats  # (K, 2, 3) how it answers to the directions of ends that hold the zone
    floating: NDArray[np.int64]  # (F,) cells that are held meanwhile: one of each rod that no end holds
    columns: Floats  # (K+F, N+1, 5) how the line answers to the torque of each zone, to a torque on each such cell
    # (5,) cv of the columns, 1/s (< 0: they are not known); how often they have served; whether they are made anew, from
    # factors that the march keeps; whether it keeps them in any case; iterations of the step; empty: it keeps them where
    # there is room
    known: Floats
    right: Floats  # (N+1, 5) a right-hand side
    coupling: Floats  # (K+F, K+F) how turns and those spins answer to the columns
    dense: (
        Floats  # (K+F+5, K+F+1) equations of the torques and of those spins (kernels.algebra.sparse_rows.factor_dense)
    )


class Work(NamedTuple):
    """Arrays that a solver works in; kernels.run.newton.workspace makes them."""

    u: Floats  # (N+1, 3) m, displacement of the nodes since the start of the step
    x: Floats  # (N+1, 5) Newton's correction: dT of the cell before (N), dr of the node (m), dpsi of the cell after (rad)
    W: Floats  # one block row
    X: Floats  # the eliminated block rows, and what another right-hand side needs of them where there is room for it
    report: Floats  # (REPORT_SIZE,) named in kernels.state.report
    gaps: Floats  # (N,) m, change of length asked of inextensible cells; empty: their law of length
    rows: Floats  # (N+1, ...) the block rows before their elimination; empty: they are not kept
    torsion: Torsion
    couple: (
        Floats  # (N+1, COUPLES) of elements where tension makes a torque (kernels.laws.tension_torque); empty: nowhere
    )
    lanes: Floats  # what kernels.march.march needs for some nodes at a time


def no_torsion() -> Torsion:
    """No torque passes through catenary zones."""
    z = np.zeros
    return Torsion(
        z((2, 0)), z((0, 3)), z((0, 2, 3)), z(0, np.int64), z((0, 0, 5)), z(0), z((0, 5)), z((0, 0)), z((0, 1))
    )


def blank_state(
    n_cells: int,
    zones: int = 0,
    slow: bool = False,
    wake: bool = False,
    obstacles: int = 0,
    sheaves: bool = False,
    peak: bool = False,
    layers: int = 0,
    soil: bool = False,
) -> State:
    """A state of zeros with room for `n_cells` cells.

    zones: those that a torque passes through; slow: mean tensions; wake: phases of vortices; obstacles: of which one
    moves; sheaves: one of them turns freely; peak: highest mean tensions; layers: that slip; soil: what nodes remember
    of the bed.
    """
    n, node, cell = n_cells, (n_cells + 1, 3), (n_cells, 3)
    shapes: list[Any] = [node, node, node, node, cell, n, cell, n, n, n, node, node, (zones, 3)]
    shapes += [n if slow else 0, (n + 1 if wake else 0, 4), (n + 1 if obstacles else 0, 6 * obstacles)]
    shapes += [(obstacles if sheaves else 0, 4), n if peak else 0, (n + 1 if layers else 0, 2 * layers)]
    return State(*map(np.zeros, [*shapes, (n + 1 if soil else 0, NO_SOIL.shape[1])]))


def state_for(line: Line) -> State:
    """A state of zeros of a line."""
    return blank_state(line.h.size, len(line.torsion), *memory_of(line))


def memory_of(line: Line) -> tuple[bool, bool, int, bool, bool, int, bool]:
    """What `blank_state` has to know of a line besides its cells and zones."""
    free, soil, wake = bool((line.moved == FREE).any()), bool(line.bits & REMEMBERS), line.wake_law.size > 0
    return line.law.size > 0, wake, line.moved.size, free, remembers(line), slip_size(line) // 2, soil


def sampled_size(line: Line) -> int:
    """Numbers of a node in a sample of a line, of layers that slip and of soil that remembers."""
    return slip_size(line) + (NO_SOIL.shape[1] if line.bits & REMEMBERS else 0)


def slip_size(line: Line) -> int:
    """Numbers of a node in `State.layers` of a line."""
    return 2 * line.slip_law.size // (4 * line.s.size)


def remembers(line: Line) -> bool:
    """Whether a cell of a line remembers its highest mean tension."""
    return bool(line.law[:, WORKING].any())


def no_sea(n_cells: int) -> Sea:
    """Nothing around a line of `n_cells` cells: no current but zero, no waves, no seabed."""
    z, node, nan = np.zeros, (n_cells + 1, 3), float("nan")
    waves = z((0, 6)), z(0), nan, nan, nan, np.array([0.0, 1.0, 1.0, 0.0]), z(2)
    bed = np.array([0.0, 0.0, 1.0]), nan, z(0), z(0), z((0, 4)), nan, nan, nan, np.full(2, nan), nan
    room = z((n_cells + 1, 7)), z((10, LANES)), z(node), z(node), z(node), z(node)
    return Sea(*(z(1), z((1, 3)), *waves, *bed, NO_OBSTACLES, *room, NO_MOVES, NO_CARRIED, NO_GRIP, NO_ROOM))


def with_waves(sea: Sea, waves: Floats, depth: float, orbits: Floats | None = None) -> Sea:
    """The same with waves (W, 6) over water of a depth, m; orbits: (W,) m/s of waves that are not linear."""
    stretched = 1.0 if orbits is None else 0.0
    speeds = waves[:, 0] * waves[:, 1] if orbits is None else orbits
    lanes = np.zeros((10 + 2 * len(waves), LANES))
    return sea._replace(waves=waves, orbits=speeds, stretched=stretched, depth=depth, lanes=lanes)


def blank_line(n_cells: int) -> Line:
    """A line of `n_cells` cells without length, mass or load."""
    along: dict[str, Any] = {name: blank(field, n_cells) for name, field in FIELDS.items()}
    return Line(**along, bits=0)


def on_line(*more: Any) -> Callable[[], tuple[Any, ...]]:
    """Makes arguments of a kernel as examples: a line, and more (kernels.machine.compile.linked_kernel)."""
    return lambda: (blank_line(1), *more)


def in_sea(*more: Any) -> Callable[[], tuple[Any, ...]]:
    """The same of a line and a sea."""
    return lambda: (blank_line(1), no_sea(1), *more)


def no_ends() -> Ends:
    """Both ends free, without loads."""
    vectors = [np.zeros((2, 3)) for _ in range(4)]
    return Ends(np.zeros(2, np.int8), vectors[0], np.zeros((2, 9)), *vectors[1:])


def no_moves(n: int = 2) -> Moves:
    """Both ends, or n obstacles, at the origin, not moved, not loaded."""
    z = np.zeros
    still = z((n, 2), np.int8), z((n, 3)), z((n, 9)), z(n), z((0, 5)), z((n, 3)), z(n), z((n, 5)), z(n, np.int8)
    files = z((n, 2), np.int64), z(0), z((0, 6, 4)), z((n, 4)), 1.0
    return Moves(*still, *files, z((n, 2), np.int8), z((n, 26)), z((0, 8)), z((0, 4)), z((n, FAIRLEAD)))


NO_MOVES = no_moves(0)


def no_work() -> Work:
    """A workspace in which nothing can be solved."""
    z = np.zeros
    return Work(z((2, 3)), z((2, 5)), z(1), z(1), z(REPORT_SIZE), z(0), z((0, 1)), no_torsion(), z((0, 1)), z(1))


for _each in (blank_line(1), no_sea(1), no_ends(), no_moves(), blank_state(1), no_work()):
    by_reference(_each)


# Arguments of kernels are NamedTuples whose annotations say of each array how many dimensions it has: one, or these.
Rows = Annotated[Floats, 2]
Blocks = Annotated[Floats, 3]
NumberRows = Annotated[NDArray[np.int64], 2]
NumberBlocks = Annotated[NDArray[np.int64], 3]
Arguments = TypeVar("Arguments")

# What the arrays of such annotations hold (what an alias of numpy is made of differs between its versions).
NUMBERS: dict[Any, type] = {
    NDArray[np.float64]: np.float64,
    NDArray[np.int64]: np.int64,
    NDArray[np.int8]: np.int8,
    NDArray[np.bool_]: np.bool_,
}


def blanks(of: type[Arguments]) -> Callable[[], Arguments]:
    """What makes arguments of a kernel with the types that all have: nothing in arrays, zeros, and defaults."""
    return partial(_blank_value, of)


def _blank_value(of: Any) -> Any:
    """A value of a type; of a class that is kept by reference arrays of its own, as its example has them."""
    if of in examples:
        return copied(examples[of])
    if hasattr(of, "_field_defaults"):
        kinds = get_type_hints(of, include_extras=True)
        return of(**{name: _blank_value(kind) for name, kind in kinds.items()} | of._field_defaults)
    if isinstance(of, type):
        return of()  # a number, or numbers with names
    kind, dimensions = get_args(of) if hasattr(of, "__metadata__") else (of, 1)
    return np.zeros((0,) * dimensions, NUMBERS[kind])


def copied(value: Any) -> Any:
    """The same in arrays of its own, of a NamedTuple of arrays and numbers."""
    if isinstance(value, tuple):
        return type(value)(*map(copied, value))
    return value.copy() if isinstance(value, np.ndarray) else value
