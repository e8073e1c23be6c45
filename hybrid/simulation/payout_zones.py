"""Zones that move on a line that is paid out: cells enter and leave as rods, and behind these the criteria decide."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from hybrid.adapt.manager import Change, DomainManager, Reason, change_base
from hybrid.kernels.mesh.stiffness_ramp import soften
from hybrid.kernels.reel.reel import MovingZones, zones_that_stay
from hybrid.kernels.state.state import State
from hybrid.model.build import Model, given_zones
from hybrid.model.layout import Layout
from hybrid.model.payout import FEWEST_CELLS, PayoutPlan
from hybrid.scene.schema import LineScene
from hybrid.simulation.payout import PayingOut
from hybrid.simulation.zone_switching import ZoneSwitching

# Ramp times of bending stiffness within which a cell that is taken in must have become rod.
AHEAD = 2.0
# Nodes by which cells are merged before the one leaves at which they must be whole: merged then, where the reel still
# brings lengths to their true ones, they kicked the pull by 0.14 % of its mean, a node before by 0.09 %.
MERGED_AHEAD = 2


def rods_at_winch(scene: LineScene, plan: PayoutPlan, model: Model, count: int, pace: float, rate: float) -> np.ndarray:
    """(N,) of base cells: 1 rod, -1 catenary, 0 adaptive, where the winch may reach them soon.

    count: material nodes that are out; pace: s; rate: m/s.
    """
    assert model.layout is not None
    given = given_zones(scene, model.layout)
    near = plan.at_winch(count, AHEAD * pace * abs(rate))
    given[near & (given == 0)] = 1
    return given


class PaidZones:
    """The zones of one line that is paid out."""

    def __init__(
        self, scene: LineScene, paying: PayingOut, switching: ZoneSwitching, turning: Sequence[bool] = (False, False)
    ) -> None:
        """turning: whether the ends are clamped to what turns, beside which a line stays rod."""
        self.scene, self.paying, self.switching, self._turning = scene, paying, switching, turning

    @property
    def manager(self) -> DomainManager:
        return self.switching.manager

    def before_change(self) -> tuple[Change, np.ndarray | None] | None:
        """What must change before a node enters or leaves: rods, and places of nodes on the finest mesh (K+1,) bool.

        Rods where a node leaves, and no cells there that are shorter than those near a winch may be; None: so it is.
        """
        paying, layout = self.paying, self.manager.layout
        near, none = paying.plan.at_winch(paying.count, 0.0), np.zeros_like(layout.rod)
        change, here = self.manager.same_zones(), None
        if not layout.rod[near].all():
            a, b = np.flatnonzero(near)[[0, -1]]
            why = Reason(int(a), int(b) + 1, "grow", "it is about to be taken in")
            change = Change(layout.rod | near, (why,), near, none)
        if paying.plan.follows:
            here = layout.node_flags
            if not paying.enters:
                here &= self._may_stay(layout)
        stays = here is None or bool((here == layout.node_flags).all())
        return None if change.same and stays else (change, here)

    def _may_stay(self, layout: Layout) -> np.ndarray:
        """(K+1,) bool, places on the finest mesh of nodes that there may be when MERGED_AHEAD less are out."""
        plan, count = self.paying.plan, self.paying.count
        fewer, whole = plan.parts_of(count - MERGED_AHEAD), np.ones(MERGED_AHEAD, int)
        fewer = np.concatenate([fewer, whole] if plan.side else [whole, fewer])
        step = np.repeat(layout.parts // np.minimum(fewer, layout.parts), layout.parts)
        return np.append((np.arange(step.size) - np.repeat(layout.starts[:-1], layout.parts)) % step == 0, True)

    def hand_over(self, t: float, state: State) -> None:
        """At t (s): cells whose lengths the reel has brought to their true ones are those of zones from now on.

        Where cells follow the curvature these are as long as makes chords of arcs, and go there within a ramp time.
        """
        paying, switching, zones = self.paying, self.switching, self.switching.zones
        reel, line = paying.reel, switching.model.line
        at = np.arange(reel.since.size)
        let = (reel.since > -np.inf) & (at < paying.material - 1)
        if paying.plan.follows:
            let &= at < paying.material - 1 - FEWEST_CELLS
        else:
            let &= reel.since + reel.span <= t
        if not let.any():
            return
        own = np.flatnonzero(let)
        lack, rate = paying.lengths_now(own, t)
        cells = own if paying.plan.side else reel.since.size - 1 - own
        true = np.diff(line.s)[cells]
        if paying.plan.follows:
            less = switching.arcs_less_chords(state)[cells]
            true, lack = true - less, lack - less
        zones.true[cells], zones.lack[cells], zones.rate[cells], zones.since[cells] = true, lack, rate, t
        zones.lengths[cells], zones.keeps[cells], zones.counts.relaxing = line.h[cells], False, 1
        paying.release(own)

    def as_now(self, model: Model, t: float, state: State) -> Model:
        """Before zones change at t (s): the model with its nodes where they are now."""
        self.hand_over(t, state)
        model, switching, zones = self.paying.as_now(model), self.switching, self.switching.zones
        assert model.layout is not None and model.on_base is not None
        switching.model = model
        manager = self.manager
        manager.layout, manager.on_base = model.layout, model.on_base
        manager.measure(model.layout)
        changing = self.paying.changing
        zones.lengths[changing] = model.line.h[changing]
        zones.true[changing] = model.line.h[changing]
        return model

    def carry(self, model: Model, source: np.ndarray, of_base: np.ndarray) -> None:
        """A node has entered or left: `model` has the cells of now.

        source, of_base: which old cells (N,), and base cells (n,), they were.
        """
        switching, zones = self.switching, self.switching.zones
        lengths, true, line = zones.lengths[source], zones.true[source], model.line
        self.paying.foreseen = self.paying.fastest
        self._change_base(model, of_base, source)
        kept = ~self.paying.changing
        line.h[kept] = lengths[kept]
        switching.zones.lengths[:], switching.zones.true[kept] = line.h, true[kept]
        near = self.paying.plan.at_winch(self.paying.count, 0.0)
        self.manager.grown[near], self.manager.leaving[near] = 1.0, False
        soften(self.manager.stiffness_shares(), switching.zones.stiff, line.kb)

    def resume(self, model: Model) -> None:
        """Go on with the cells of a checkpoint, from which all else follows (ZoneSwitching.restore)."""
        old = self.manager.layout
        assert model.layout is not None
        base, cells = np.arange(model.layout.rod.size), np.arange(model.cells)
        self._change_base(
            model, np.minimum(base, old.rod.size - 1), np.minimum(cells, old.base_of_cell.size - 1), anew=True
        )

    def _change_base(self, model: Model, source: np.ndarray, cells: np.ndarray, anew: bool = False) -> None:
        assert model.layout is not None and model.on_base is not None
        paying, manager = self.paying, self.manager
        given = rods_at_winch(self.scene, paying.plan, model, paying.count, manager.pace, paying.foreseen)
        given[[0, -1]] = np.where(self._turning, 1, given[[0, -1]])
        manager.cable = paying.plan.held_as(model.cable)
        change_base(manager, model.layout, source, cells, given, model.on_base, anew)
        self.switching.set_cells(model)

    def moving(self) -> MovingZones:
        """What the kernels of payout know of them."""
        return MovingZones(self.switching.zones.lengths, self.switching.zones.stiff)


def moving_zones(zones: PaidZones | None) -> MovingZones:
    """The same of any line."""
    return zones.moving() if zones is not None else zones_that_stay()
