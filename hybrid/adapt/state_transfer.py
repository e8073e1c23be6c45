"""From the old zones to the new ones: the state on their nodes (kernels.mesh.zone_transfer)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from hybrid.kernels.machine.binding import Packed, Table
from hybrid.kernels.mesh.zone_transfer import Transfer, blank_match, blank_transfer, transfer
from hybrid.kernels.state.state import NO_WAKE, Floats, Line, State, blank_state
from hybrid.model.layout import Layout

Clamp = tuple[Floats, Floats]  # first director and tangent
states = Packed(blank_state, given=("turn", "slow", "wake", "peak", "grip", "sheave", "soil"))


class Remapped(NamedTuple):
    """A state on new nodes, and the lengths (N,) m that its cells have now; their true ones are in the line."""

    state: State
    lengths: Floats


def transfer_to(
    old: Layout,
    new: Layout,
    line: Line,
    target: Line,
    state: State,
    kinks: np.ndarray,
    twist: Floats,
    clamps: Sequence[Clamp | None] = (None, None),
    shifts: bool = True,
) -> Transfer:
    """What carries a state from one layout to another of the same base.

    line, target: the old and the new line; kinks: (n+1,) bool, base nodes where tangent and tension may jump (point
    loads); twist: (n,) 1/m, twist to give to the frames of base cells that become rod; clamps: first director and
    tangent of what holds the twist of the two ends, None: nothing does; shifts: whether momentum is kept exactly.
    """
    held, frames = np.zeros(2, bool), np.zeros((2, 2, 3))
    for k, clamp in enumerate(clamps):
        if clamp is not None:
            held[k], frames[k] = True, clamp
    out = states(
        target.h.size,
        turn=np.zeros((len(target.torsion), 3)),
        slow=np.zeros(len(target.law)),
        wake=np.zeros((len(target.wake_law), NO_WAKE.shape[1])),
        peak=np.zeros(state.peak.size and target.h.size),
        grip=np.zeros((len(state.grip) and target.h.size + 1, state.grip.shape[1])),
        sheave=np.zeros(state.sheave.shape),
        soil=np.zeros((len(state.soil) and target.h.size + 1, state.soil.shape[1])),
    )
    return Transfer(
        line, target, state, out, old.places, new.places, new.base_of_cell, old.first, kinks, twist,
        frames, held, np.array([shifts]), blank_match(line.h.size, target.h.size),
    )  # fmt: skip


def remap(
    old: Layout, new: Layout, line: Line, target: Line, state: State, kinks: np.ndarray, twist: Floats,
    clamps: Sequence[Clamp | None] = (None, None),
) -> Remapped:  # fmt: skip
    """Carry a state: arguments as of transfer_to."""
    job = transfer_to(old, new, line, target, state, kinks, twist, clamps)
    transfer(Table(blank_transfer()._replace(**job._asdict())).numbers)
    return Remapped(job.out, job.match.lengths)
