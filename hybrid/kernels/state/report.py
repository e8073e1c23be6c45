"""What the numbers of a step's report and of obstacles' rows are, each with its name.

Rows of obstacles are those of Sea.obstacles, Sea.carried, State.grip and of samples.

What a step reports beside its state is one array of numbers.  The assembly of every iteration clears and writes the
first `ASSEMBLED` numbers, the step the others.

    name                      meaning                                                          unit
    FORCE_A, FORCE_B          force of the line on what holds, carries or loads its start, its
                              end (kernels.laws.end_forces), 3 numbers                              N
    MOMENT_A, MOMENT_B        moment at the start and at the end, 3 numbers                    N m
    DRAG_POWER                power of the drag                                                W
    MASS_DAMPING_POWER        power lost to damping proportional to mass                       W
    STIFFNESS_DAMPING_POWER   power lost to damping proportional to stiffness                  W
    RESIDUAL, RESIDUAL_NODE   largest residual force, and its node                             N, -
    ADDED_MASS_POWER          power into the added mass                                        W
    WAVE_POWER                power of the waves, and of buoyancy at the surface               W
    CONTACT_WORK              work of the seabed along its normal in the step                  J
    FRICTION_WORK             work of the seabed in its plane in the step                      J
    CONTACT_FORCE             force of the seabed along its normal                             N
    BEND, BEND_NODE           largest bend of an element, and its node (-1: none)              rad, -
    TWIST, TWIST_NODE         largest twist of an element, and its node (-1: none)             rad, -
    SLACKEST, SLACKEST_CELL   lowest tension of a catenary cell, and that cell                 N, -
    SEABED_ENERGY             energy that the seabed stores                                    J
    PUSH_ENERGY               kinetic energy of the push out of the plane                      J
    WRONG_PIVOTS              how many pivots of the push's equations have the wrong sign      -
    LOCAL_ERROR, ..._NODE     local error of position that the step makes, and its node        m, -
    SELF_CONTACT_ENERGY       energy of the contact of the line with itself                    J
    SELF_FRICTION_WORK        work of its friction in the step, and what that has stored more  J
    LENGTH_OUT, PAYOUT_RATE   unstretched length of a line that is paid out, and its rate      m, m/s
    PAYOUT_POWER              power of the winch on the line                                   W
    STRETCH_ENERGY            energy of stretch where an axial law is no straight line         J
    USED_RHO                  spectral radius at infinity of the step                          -
    NET_A, NET_B              resultant on the node at the start and at the end, 3 numbers     N
    OBSTACLE_WORK             work of obstacles as they move, in the step                      J
    LOST_WORK                 work of what ropes that remember a tension, and layers that slip,
                              lose in the step                                                 J
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

# Columns of Sea.obstacles, of cylinders, boxes, tori, sheaves, planes and meshes.
KIND = 0  # FLAT, ROUND, BOX, TORUS, SHEAVE or MESH
PLACE = 1  # 3, m
AXIS = 4  # 3, unit axis of a cylinder, torus, sheave and the first of a box, unit normal of a plane
SIDE = 7  # 3, unit vector across it, the second axis of a box
RADIUS = 10  # m, with the strand's: of a box of its edges, torus section, sheave groove bottom, plane: how far it is moved out
HALF_LENGTH = 11  # m, of a cylinder (infinite: endless; 0: a sphere), of the flat part of a box
HALF_WIDTH = 12  # m, of the flat part of a box; of a mesh all three are half of its mean thickness
HALF_HEIGHT = 13  # m
RING = 14  # m, about which sections of a torus or groove lie; of a mesh its smallest rounding (0: sharp edges)
GROOVE = 15  # m, radius of a groove less that of the strand
RIM = 16  # m, radius of its rims with that of the strand
ROOT = 17  # of a mesh, the first row in Sea.boxes
STRAND = 18  # m, its radius
MU = 19  # friction
STIFFNESS = 20  # N/m per m
DAMPING = 21  # N s/m per m
ONSET_OF = 22  # m
SLIP = 23  # m, elastic travel
# Kinds.
FLAT = 0.0
ROUND = 1.0
BOX = 2.0
TORUS = 3.0
SHEAVE = 4.0
MESH = 5.0
OBSTACLE = 24
# Behind them, of a line of several diameters, OF_PIECE numbers for each of its sections.
PIECE_END = 0  # arc length at which it ends, m
THINNER = 1  # by how much its radius is smaller than that of the strand, which is the largest, m
OF_PIECE = 2
# Columns of Sea.carried, of obstacles that move (kernels.laws.obstacles).
BEGAN = 0  # 3, c at the begin of the step, m
ENDED = 3  # 3, and at its end, m
SWEEP = 6  # 9, R R0^T
SPEED = 15  # 3, v at the end, m/s
TURNING = 18  # 3, w at the end, 1/s
TURNED = 21  # 9, R at the end
STILL_AXIS = 30  # 3, axis at t = 0
RATE = 33  # of the spin about it, 1/s
RAMP = 34  # time over which that grows, s
# Of sheaves that turn freely.
INERTIA = 35  # kg m2
BEARING = 36  # its damping, N m s
ROLLED_BEFORE = 37  # angle at the begin of the step, rad
ROLLED = 38  # and at its end, rad
ROLLING = 39  # its rate, 1/s
# Of a line that is fixed to the body which carries an obstacle, and of what a body carries.
MEETS_FROM = 40  # how far from its start it meets that, m
MEETS_TO = 41  # and up to how far from its end, m
OFFSET = 42  # 3, its place in axes of the body, as the axis at t = 0 and what is across are
RIDES = 45  # 1.0: a body carries it
STILL_SIDE = 46
CARRIED = 49
# Of Line.moved.
FIXED, MOVES, FREE = range(3)
# Columns of a row of State.sheave.
ANGLE = 0  # rad
SPIN = 1  # its rate, 1/s
ALGORITHMIC = 2  # acceleration, 1/s2
TRUE = 3  # acceleration, 1/s2
# Columns of each obstacle in a row of State.grip.
TRAVEL = 0  # 3, m
FORCE = 3  # 3, on the node, N
EACH = 6
# Columns of each obstacle in a sample, behind its place (3), m.
SEEN_TURN = 3  # 9, R
SEEN_FORCE = 12  # 3, of the line on it, N
SEEN_MOMENT = 15  # 3, about that place, N m
SEEN = 18


# What rows of Sea.boxes and Sea.facets hold: surfaces of triangles in axes of their obstacle, and a tree of boxes.

# Columns of Sea.boxes, each before what it holds (pre-order).
LOWEST = 0  # 3, coordinates, m
HIGHEST = 3  # 3, m
BEHIND = 6  # row behind what it holds
LEAF = 7  # facet of one that holds a single one, else -1
BOX_ROW = 8
# Columns of Sea.facets.
CORNERS = 0  # 9, counter-clockwise from outside, m
NORMAL = 9  # 3, unit normal
FEATURES = 12  # six: the edges from the first, second and third corner on, and these corners
# Columns of a feature, behind its normal (3), weighted by the angles of the facets around it.
TURNS = 3  # 1 where the surface turns there, else 0
ALONG = 4  # 3, unit vector along which it does not (0: it turns all around)
FEATURE = 7
FACET = FEATURES + 6 * FEATURE
# Which feature of a facet is nearest: its face, or one of the six.
FACE, FIRST_CORNER = -1, 3

NO_BOXES: NDArray[np.float64] = np.zeros((0, BOX_ROW))
NO_FACETS: NDArray[np.float64] = np.zeros((0, FACET))


FORCE_A = 0
FORCE_B = 3
MOMENT_A = 6
MOMENT_B = 9
DRAG_POWER = 12
MASS_DAMPING_POWER = 13
STIFFNESS_DAMPING_POWER = 14
RESIDUAL, RESIDUAL_NODE = 15, 16
ADDED_MASS_POWER, WAVE_POWER = 17, 18
CONTACT_WORK = 19
FRICTION_WORK = 20
CONTACT_FORCE = 21
ASSEMBLED = 22
BEND = 22
BEND_NODE = 23
TWIST = 24
TWIST_NODE = 25
SLACKEST, SLACKEST_CELL = 26, 27
SEABED_ENERGY = 28
PUSH_ENERGY, WRONG_PIVOTS = 29, 30
LOCAL_ERROR, LOCAL_ERROR_NODE = 31, 32
SELF_CONTACT_ENERGY, SELF_FRICTION_WORK = 33, 34
LENGTH_OUT = 35
PAYOUT_RATE = 36
PAYOUT_POWER = 37
STRETCH_ENERGY = 38
USED_RHO = 39
NET_A, NET_B = 40, 43
OBSTACLE_WORK = 46
LOST_WORK = 47
REPORT_SIZE = 48


# The optional forces: bit in the mask of a line, and what each needs.
#
# A force that no scene asked for has its bit off, and its parameters are never read.

DRAG = 1
ADDED_MASS = 2
MASS_DAMPING = 4
STIFFNESS_DAMPING = 8
ROTARY = 16
FLOW = 32
WAVES = 64
SURFACE = 128
BODIES = 256
SEABED = 512
FRICTION = 1024
# No force: all of the cable and of what acts on it lies in a plane (hybrid.kernels.algebra.plane).
PLANAR = 2048
# Contact of the line with itself (hybrid.kernels.contact.self_contact).
SELF_CONTACT = 4096
SELF_FRICTION = 8192
# No force: tension that is no multiple of strain (hybrid.kernels.laws.axial_law).
AXIAL_LAW = 16384

# No force: the line may come to touch itself, which is computed from where it comes near itself on.
MAY_TOUCH = 32768
# Nor is this: it may come to touch other lines, which is computed from where it comes near one on.
MAY_MEET = 8388608

# Contact with obstacles (hybrid.kernels.laws.obstacles); what the line is pressed on by, bed or obstacles.
OBSTACLES = 65536
TOUCHES = SEABED | OBSTACLES
# No force: moment that is no multiple of curvature (hybrid.kernels.laws.bending_law).
BENDING_LAW = 131072
# Lift of vortices that follow the motion (hybrid.kernels.laws.water).
VORTICES = 262144
# No force: layers of a section that slip on each other as it bends (hybrid.kernels.laws.bending_law).
BENDING_SLIP = 1048576
# Nor is this: they stay as Line.slip_now has them, whatever the line does.
HELD_SLIP = 16777216
# Bed that remembers (hybrid.kernels.laws.seabed): in place of the linear one; no force: friction that falls as a line slides.
SOIL = 2097152
BREAKOUT = 4194304
REMEMBERS = SOIL | BREAKOUT

FORCES = {
    "drag": (DRAG, "velocity, direction; environment.fluid and sections[].drag, or drag_area of modules"),
    "added mass": (ADDED_MASS, "acceleration, direction; environment.fluid and sections[].added_mass, or of modules"),
    "mass-proportional damping": (MASS_DAMPING, "velocity; sections[].damping.mass"),
    "stiffness-proportional damping": (STIFFNESS_DAMPING, "rate of strain; sections[].damping.stiffness"),
    "rotary inertia": (ROTARY, "turning of the cross-section; rod zones with a diameter or rotary_inertia"),
    "current": (FLOW, "height; environment.fluid.current"),
    "waves": (WAVES, "position, time; environment.fluid.waves"),
    "partly wetted cells at the surface": (SURFACE, "height; environment.fluid.surface"),
    "drag, added mass or wetting of bodies": (BODIES, "velocity, acceleration; cable.attachments, ends of kind body"),
    "lift of vortices": (VORTICES, "velocity, and a phase of its own; sections[].vortices"),
    "seabed contact": (SEABED, "height and its rate; environment.seabed"),
    "nonlinear soil": (SOIL, "height, and what it was before; environment.seabed.soil"),
    "seabed friction": (FRICTION, "travel along the seabed; environment.seabed.friction"),
    "friction that falls as the line slides": (BREAKOUT, "way along the seabed; environment.seabed.friction.residual"),
    "contact with obstacles": (OBSTACLES, "distance and its rate; obstacles"),
    "contact of the line with itself": (SELF_CONTACT, "distance of its parts; contact.self"),
    "friction of the line on itself": (SELF_FRICTION, "travel of its parts along each other; contact.friction"),
}
