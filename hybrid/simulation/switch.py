"""Which road a cable at rest is computed by, until there is one; this file goes with the old road."""

from __future__ import annotations

import os


def at_rest_as_network() -> bool:
    """Whether the equilibrium of a cable is that of its network: not yet, unless HYBRID_CABLES says `network`.

    In a plane it would compile the solver in space as well.
    """
    return os.environ.get("HYBRID_CABLES") == "network"
