"""Which road a cable is computed by, until there is one; this file goes with the old road."""

from __future__ import annotations

import os


def as_network() -> bool:
    """Whether a scene of a cable is computed as a network of one line: always, unless HYBRID_CABLES says `cable`."""
    return os.environ.get("HYBRID_CABLES") != "cable"


def at_rest_as_network() -> bool:
    """Whether its equilibrium is, too: not yet, as that in a plane would compile the solver in space as well."""
    return os.environ.get("HYBRID_CABLES") == "network"
