"""What rows of Sea.boxes and Sea.facets hold: surfaces of triangles in axes of their obstacle, and a tree of boxes."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

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
