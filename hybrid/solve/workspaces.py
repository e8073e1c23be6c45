"""Work arrays of a line; the address of what passes torques through its zones takes a millisecond to find: once."""

from __future__ import annotations

from functools import cache

from hybrid.kernels.march.zone_torque import pass_torque, torsion_of
from hybrid.kernels.run import entry
from hybrid.kernels.state.forces import PLANAR
from hybrid.kernels.state.obstacle_rows import FREE
from hybrid.kernels.state.state import Line, Work, blank_line, blank_state, no_ends


@cache
def _torque_address() -> int:
    """Of kernels.march.zone_torque.pass_torque, the same for all lines, whose arrays have the same types."""
    return int(pass_torque.address(blank_line(1), no_ends(), blank_state(1), entry.workspace(1), 0, 0.0))


def workspace_of(line: Line, keep: bool = False) -> Work:
    """As kernels.run.entry.workspace_of; keep: factors stay, as they do where sheaves turn with the line."""
    keep = keep or bool((line.moved == FREE).any())
    if not line.torsion.size or line.bits & PLANAR:
        return entry.workspace_of(line, keep)
    work = entry.workspace_of(line._replace(torsion=line.torsion[:0]), keep=True)
    return work._replace(torsion=torsion_of(line, keep)._replace(address=_torque_address()))
