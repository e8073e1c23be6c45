"""Which road a cable at rest is computed by, until there is one; this file goes with the old road."""

from __future__ import annotations

import os

from hybrid.scene.schema import Scene


def at_rest_as_network(scene: Scene) -> bool:
    """Whether the equilibrium of a cable is that of its network.

    Of several equilibria in contact with itself a cable's search finds another one than its run begins at, and it does
    not compute what presses on obstacles.  Else not yet, unless HYBRID_CABLES says `network`: in a plane it would
    compile the solver in space as well.
    """
    return os.environ.get("HYBRID_CABLES") == "network" or bool(scene.contact.self or scene.obstacles)
