"""What rows of Sea.obstacles, Sea.carried, State.grip and of samples hold of obstacles."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

# Of Sea.obstacles: kind; place (m); unit axis of a cylinder, torus, sheave and the first of a box, unit normal of a plane;
# unit vector across it, the second axis of a box; radius of the surface moved out by the strand's (m; of a plane how far it
# is moved out; of a box that of its edges, of a torus that of its section, of a sheave that at the bottom of its groove);
# half the length of a cylinder (m; infinite: endless; 0: a sphere) or of the flat part of a box, half the width and height
# of that (of a mesh all three half of how thick it is on average); radius of the ring about which sections of a torus or
# groove lie, of a mesh the smallest of what is round on it (0: it has sharp edges); radius of a groove less that of the
# strand, and of its rims more that (m); of a mesh the first row in Sea.boxes;
KIND, PLACE, AXIS, SIDE, RADIUS, HALF_LENGTH, HALF_WIDTH, HALF_HEIGHT, RING, GROOVE, RIM, ROOT = (
    0,
    1,
    4,
    7,
    10,
    11,
    12,
    13,
    14,
    15,
    16,
    17,
)
# radius of the strand (m); friction; stiffness (N/m per m), damping (N s/m per m), onset (m), elastic travel (m).
STRAND, MU, STIFFNESS, DAMPING, ONSET_OF, SLIP = 18, 19, 20, 21, 22, 23
FLAT, ROUND, BOX, TORUS, SHEAVE, MESH = 0.0, 1.0, 2.0, 3.0, 4.0, 5.0
OBSTACLE = 24
# Behind them, of a line of several diameters, two numbers for each of its sections: the arc length at which it ends, and by
# how much its radius is smaller than that of the strand, which is the largest (m).
PIECE_END, THINNER, OF_PIECE = 0, 1, 2
# Of Sea.carried, of obstacles that move: c at the begin and the end of the step (m); R R0^T; v (m/s), w (1/s) and R at the
# end (kernels.laws.obstacle_motion); the axis at t = 0, the rate of the spin about it (1/s) and the time over which it
# grows (s); of sheaves that turn freely the inertia (kg m2) and the damping of the bearing (N m s), angles at the begin and
# the end of the step (rad), and their rate (1/s); what the line leaves of the moment (N m), and its derivatives by the angle
# where the line stays and where it yields (N m; 0: the sheave is held).
BEGAN, ENDED, SWEEP, SPEED, TURNING, TURNED, STILL_AXIS, RATE, RAMP = 0, 3, 6, 15, 18, 21, 30, 33, 34
INERTIA, BEARING, ROLLED_BEFORE, ROLLED, ROLLING = 35, 36, 37, 38, 39
LEFT_OVER, ALONE, YIELDING = 46, 47, 48
# Of a line that is fixed to the body which carries an obstacle: from which arc length and up to which (m) it meets that; of
# what a body carries its place and whether one does (1.0), in axes of the body, as the axis at t = 0 and what is across are.
MEETS_FROM, MEETS_TO, OFFSET, RIDES = 40, 41, 42, 45
STILL_SIDE = 49
CARRIED = 52
# Of Line.moved; of a row of State.sheave: angle (rad), rate, algorithmic and true acceleration.
FIXED, MOVES, FREE = 0, 1, 2
ANGLE, SPIN, ALGORITHMIC, TRUE = 0, 1, 2, 3
# Of each obstacle in a row of State.grip: travel (m), force on the node (N).
TRAVEL, FORCE, EACH = 0, 3, 6
# Of each obstacle in a sample: place (m), R, force of the line on it (N), moment about that place (N m).
SEEN_TURN, SEEN_FORCE, SEEN_MOMENT, SEEN = 3, 12, 15, 18


# What rows of Sea.boxes and Sea.facets hold: surfaces of triangles in axes of their obstacle, and a tree of boxes.

# Of Sea.boxes, each before what it holds (pre-order): lowest and highest coordinates (m); the row behind what it holds;
# the facet of one that holds a single one, else -1.
LOWEST, HIGHEST, BEHIND, LEAF, BOX_ROW = 0, 3, 6, 7, 8
# Of Sea.facets: three corners (m), counter-clockwise from outside; unit normal; then of each feature, the edges from the
# first, second and third corner on and these corners: normal, weighted by the angles of the facets around it; 1 where the
# surface turns there, else 0; along which unit vector it does not (0: it turns all around).
CORNERS, NORMAL, FEATURES = 0, 9, 12
TURNS, ALONG, FEATURE = 3, 4, 7
FACET = FEATURES + 6 * FEATURE
# Which feature of a facet is nearest: its face, or one of the six.
FACE, FIRST_CORNER = -1, 3

NO_BOXES: NDArray[np.float64] = np.zeros((0, BOX_ROW))
NO_FACETS: NDArray[np.float64] = np.zeros((0, FACET))
