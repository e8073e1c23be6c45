"""Zones that move on a line that is paid out: cells enter and leave as rods, and behind these the criteria decide."""

from __future__ import annotations

import numpy as np

from hybrid.adapt.base_change import change_base
from hybrid.adapt.manager import Change, DomainManager, Reason
from hybrid.kernels.reel import MovingZones, zones_that_stay
from hybrid.kernels.stiffness_ramp import soften
from hybrid.model.build import Model, given_zones
from hybrid.model.payout import PayoutPlan
from hybrid.scene.schema import Scene
from hybrid.simulation.payout import PayingOut
from hybrid.simulation.zone_switching import ZoneSwitching

# Ramp times of bending stiffness within which a cell that is taken in must have become rod.
AHEAD = 2.0
BEFORE_LEAVING = 3  # cells before a node that leaves


def rods_at_winch(scene: Scene, plan: PayoutPlan, model: Model, count: int, pace: float, rate: float) -> np.ndarray:
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

    def __init__(self, scene: Scene, paying: PayingOut, switching: ZoneSwitching) -> None:
        self.scene, self.paying, self.switching = scene, paying, switching

    @property
    def manager(self) -> DomainManager:
        return self.switching.manager

    def rods_before_leaving(self) -> Change | None:
        """Rods where a node leaves, which must be there; None: they are."""
        paying, manager = self.paying, self.manager
        near = paying.plan.at_winch(paying.count, 0.0)
        if manager.layout.rod[near].all():
            return None
        rod = manager.layout.rod | near
        a, b = np.flatnonzero(near)[[0, -1]]
        none = np.zeros_like(rod)
        return Change(rod, (Reason(int(a), int(b) + 1, "grow", "it is about to be taken in"),), near, none)

    def as_now(self, model: Model) -> Model:
        """Before zones change: the model with its nodes where they are now."""
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

    def carry(self, model: Model, source: np.ndarray) -> None:
        """A node has entered or left: `model` has the cells of now; source: (N,) which old cells they were."""
        switching, zones = self.switching, self.switching.zones
        lengths, line = zones.lengths[source], model.line
        self.paying.foreseen = self.paying.fastest
        self._change_base(model, source)
        kept = ~self.paying.changing
        line.h[kept] = lengths[kept]
        switching.zones.lengths[:] = line.h
        near = self.paying.plan.at_winch(self.paying.count, 0.0)
        self.manager.grown[near], self.manager.leaving[near] = 1.0, False
        soften(self.manager.stiffness_shares(), switching.zones.stiff, line.kb)

    def resume(self, model: Model) -> None:
        """Go on with the cells of a checkpoint, from which all else follows (ZoneSwitching.restore)."""
        cells = np.arange(model.cells)
        self._change_base(model, np.minimum(cells, self.manager.layout.rod.size - 1))

    def _change_base(self, model: Model, source: np.ndarray) -> None:
        assert model.layout is not None and model.on_base is not None
        paying, manager = self.paying, self.manager
        given = rods_at_winch(self.scene, paying.plan, model, paying.count, manager.pace, paying.foreseen)
        manager.cable = paying.plan.held_as(model.cable)
        change_base(manager, model.layout, source, given, model.on_base)
        self.switching.take_cells(model)

    def moving(self) -> MovingZones:
        """What the kernels of payout know of them."""
        return MovingZones(self.switching.zones.lengths, self.switching.zones.stiff)


def moving_zones(zones: PaidZones | None) -> MovingZones:
    """The same of any line."""
    return zones.moving() if zones is not None else zones_that_stay()
