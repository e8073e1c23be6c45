"""The water around members of a body, before a try: how far their pieces are wet, velocity and acceleration of the water.

The body is taken where its velocity and acceleration at the start of the try lead it, so that a step has one water.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from hybrid.kernels.algebra.rotations import add, cross, mat_vec, scale, vector
from hybrid.kernels.junctions.bodies import FRAME, PLACE, STATE, A, V, W, matrix
from hybrid.kernels.laws.members import ALONG, MIDDLE, PIECE, PUSH, WATER, WET
from hybrid.kernels.laws.water import current_at, wave_kinematics
from hybrid.kernels.machine.compile import kernel
from hybrid.kernels.machine.references import reader
from hybrid.kernels.state.state import Floats, Sea, no_sea


class MembersJob(NamedTuple):
    """Pieces of the members of a body, n of them."""

    sea: Sea  # with room for n places; at the time that is asked
    pieces: Floats  # (n, PIECE)
    sizes: Floats  # (n, 3) added mass across it (kg), length, diameter (m)
    places: Floats  # (n, 3) m, worked in
    still: Floats  # (n, 3) of zeros
    state: Floats  # (STATE,) of the body, from which it goes on
    dt: Floats  # (1,) s
    waves: Floats  # (1,) 1 where they count
    out: Floats  # (n, PIECE) of which wetness and water are written


def blank_members_job() -> MembersJob:
    """A job with the types that every one has."""
    z = np.zeros
    return MembersJob(no_sea(1), z((1, PIECE)), z((1, 3)), z((1, 3)), z((1, 3)), z(STATE), z(1), z(1), z((1, PIECE)))


read_members = reader(blank_members_job())


@kernel
def stir_members(table):
    """Write how far the pieces of a body are wet, and the water around them."""
    job = read_members(table)
    sea, state, out, dt = job.sea, job.state, job.out, job.dt[0]
    R = matrix(state, FRAME)
    spin, shift = mat_vec(R, vector(state, W)), add(scale(dt, vector(state, V)), scale(0.5 * dt * dt, vector(state, A)))
    middle, waves = add(vector(state, PLACE), shift), sea.waves.shape[0] > 0 and job.waves[0] != 0.0
    for i in range(out.shape[0]):
        arm = mat_vec(R, vector(job.pieces[i], MIDDLE))
        place = add(middle, add(arm, scale(dt, cross(spin, arm))))
        job.places[i, 0], job.places[i, 1], job.places[i, 2] = place
    if waves:
        wave_kinematics(sea, job.places, job.still)
    for i in range(out.shape[0]):
        U, _ = current_at(sea.z, sea.current, sea.now[1], job.places[i, 2])
        level = sea.surface if abs(sea.surface) < math.inf else math.inf  # NaN: all is under water
        for k in range(3):
            out[i, WATER + k], out[i, PUSH + k] = U[k], 0.0
            if waves:
                out[i, WATER + k] += sea.flow[i, k]
                out[i, PUSH + k] = sea.flow[i, 3 + k]
        if waves:
            level += sea.flow[i, 6]
        up = min(abs(mat_vec(R, vector(job.pieces[i], ALONG))[2]), 1.0)
        high = up * job.sizes[i, 1] + math.sqrt(1.0 - up * up) * job.sizes[i, 2]
        out[i, WET] = min(max((level - job.places[i, 2]) / high + 0.5, 0.0), 1.0)
    return 0
