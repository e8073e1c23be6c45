"""The base cells of a line change while it is paid out: what the domain manager remembers of those that stay."""

from __future__ import annotations

import numpy as np

from hybrid.adapt.manager import OF_BASE, DomainManager
from hybrid.kernels.mesh.zone_step import blank_zones
from hybrid.model.layout import Layout, LineOnBase, on_other_parts

# Arrays of `Zones` that have no base cells; of base cells; of cells.
OF_LINE = ("clock", "counts", "clamped", "tangents", "moments", "asked", "largest", "shares", "limits")
CARRIED = ("leaving", "grown", "haste")
OF_CELLS = ("past", "recent", "lack", "rate", "since", "keeps")


def change_base(
    manager: DomainManager, layout: Layout, source: np.ndarray, of_cell: np.ndarray, given: np.ndarray,
    on_base: LineOnBase, anew: bool = False,
) -> None:  # fmt: skip
    """Let a manager go on with base cells of which some have come or gone, where they are one cell each.

    source, of_cell: which of the old base cells (n,), and cells (N,), a new one is, or has come from; given: (n,) 1
    rod, -1 catenary, 0 adaptive; anew: how long nodes have been calm is not known.
    """
    old, n, places = manager.zones, layout.rod.size, layout.starts[-1] + 1
    calm = np.zeros(places, np.int64) if anew else on_other_parts(manager.layout, old.calm, source, layout.parts)
    waves = np.zeros(places) if anew else on_other_parts(manager.layout, old.waves, source, layout.parts)
    blank = blank_zones(1, n)._replace(here=np.zeros(places, bool), plan=np.zeros(places, bool), calm=calm, waves=waves)
    kept = {name: getattr(old, name) for name in OF_LINE} | {"ratios": old.ratios[:, source].copy()}
    kept |= {name: getattr(old, name)[source] for name in CARRIED}
    assert set(kept) <= set(OF_BASE)
    cells = {name: getattr(old, name)[of_cell] for name in OF_CELLS}
    known, relaxing = old.counts.known, old.counts.relaxing
    age, recent_age = manager.age, manager.recent_age
    manager.zones = blank._replace(**kept)
    for name in ("calm_since", "patience", "released", "buffer"):
        setattr(manager, name, getattr(manager, name)[source])
    manager.calmed, manager.seen = manager.calmed[:, source].copy(), manager.seen[:, source].copy()
    manager.given, manager.free, manager.on_base = given, (given >= 0).astype(np.int8), on_base
    manager.measure(layout)
    manager.set_layout(layout)
    for name, x in cells.items():
        getattr(manager.zones, name)[:] = x
    manager.zones.counts.known, manager.zones.counts.relaxing = known, relaxing
    manager.age, manager.recent_age = age, recent_age
