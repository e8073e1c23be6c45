"""Other right-hand sides of an iteration: how lines, points and bodies answer to them, with bodies that lines touch."""

from __future__ import annotations

from hybrid.kernels.junctions.body_contact import AGAIN
from hybrid.kernels.junctions.joined_lines import substitute_dense
from hybrid.kernels.junctions.junctions import correct_all, gather_right_sides
from hybrid.kernels.machine.compile import inner
from hybrid.kernels.machine.references import caller

call_meet = caller(0)


@inner
def answer_right_sides(job, coupled):
    """Corrections of all lines and bodies to the right-hand sides in the eliminated lines; False: they are not finite.

    job: as kernels.run.network.solve_system works with it, which has factored A in this iteration, with the address of
    `meet_bodies`, 0: no body has a shape;
    coupled: whether the corrections of the iteration have been coupled to bodies that lines touch.
    """
    m = job.A.shape[1] - 1
    gather_right_sides(job, m)
    substitute_dense(job.A, m)
    if correct_all(job, job.net.shape[0], m) >= 0:
        return False
    if job.meet != 0 and coupled:
        job.phase[0] = AGAIN
        return call_meet(job.meet, job.meet_table) != 0
    return True
