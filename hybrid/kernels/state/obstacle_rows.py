"""What rows of Sea.obstacles, Sea.carried, State.grip and of samples hold of obstacles."""

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
# Columns of Sea.carried, of obstacles that move (kernels.laws.obstacle_motion).
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
LEFT_OVER = 46  # residual moment, N m
ALONE = 47  # its derivative by the angle where the line stays, N m (0: the sheave is held)
YIELDING = 48  # and where it yields, N m
# Of a line that is fixed to the body which carries an obstacle, and of what a body carries.
MEETS_FROM = 40  # arc length from which it meets that, m
MEETS_TO = 41  # and up to which, m
OFFSET = 42  # 3, its place in axes of the body, as the axis at t = 0 and what is across are
RIDES = 45  # 1.0: a body carries it
STILL_SIDE = 49
CARRIED = 52
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
