"""The arrays a solver works on: the line (what does not move), its ends, and its state.

All three are NamedTuples of contiguous arrays with fixed types, so that one compiled
signature serves every scene.  N cells, N+1 nodes; SI units; inertial frame unless said.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


class Line(NamedTuple):
    """What the plan says: mesh, stiffness, mass and load parameters.

    A parameter of a force that is off (see `bits`) is NaN: used by mistake, it shows at once.
    """

    s: Floats  # (N+1,) m, unstretched arc length of the nodes
    h: Floats  # (N,) m, unstretched cell length
    ck: Floats  # (N,) 1/N, axial compliance; 0 when inextensible
    mass: Floats  # (N+1,) kg, of the half cells that meet at the node
    force: Floats  # (N+1, 3) N, weight and buoyancy
    element: NDArray[np.int8]  # (N+1,) 1 where a rod element sits
    spin: NDArray[np.int8]  # (N,) 1 where the cell has a frame and a spin
    kb: Floats  # (N+1, 3) N m, stiffness of the element (two bending, torsion)
    k0: Floats  # (N+1, 3) rad, its strain without stress
    hn: Floats  # (N+1,) m, length an element stands for
    rotary: Floats  # (N,) kg m2, transverse rotary inertia of the cell
    polar: Floats  # (N,) kg m2, polar inertia of the cell
    drag_n: Floats  # (N,) kg/m, of half the cell
    drag_t: Floats  # (N,) kg/m
    added_n: Floats  # (N,) kg, of half the cell
    added_t: Floats  # (N,) kg
    damp: Floats  # (N+1,) kg/s, mass-proportional damping of the node
    tau: Floats  # (N,) s, stiffness-proportional damping time
    current: Floats  # (3,) m/s
    bits: int  # which optional forces are on (physics.loads)


class Ends(NamedTuple):
    """What the two ends impose at one moment; row 0 the start, row 1 the end."""

    held: NDArray[np.int8]  # (2,) 1 where the position is given
    position: Floats  # (2, 3) m
    frame: Floats  # (2, 9) columns (a1, a2, tangent), row order; read only where an element sits at the end
    spin: Floats  # (2, 3) 1/s, angular velocity of that frame
    force: Floats  # (2, 3) N, applied to the cable
    moment: Floats  # (2, 3) N m, applied to the cable; read where a rod ends without an element


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

    def copy(self) -> State:
        return State(*(x.copy() for x in self))


def blank_state(n_cells: int) -> State:
    """A state of zeros with room for `n_cells` cells."""
    node, cell = (n_cells + 1, 3), (n_cells, 3)
    z = np.zeros
    return State(z(node), z(node), z(node), z(node), z(cell), z(n_cells), z(cell), z(n_cells), z(n_cells), z(n_cells))
