"""Derivatives at rest beside differences of equilibria on the same cells."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from hybrid.designs.network_at_rest import NetworkAtRest, at_rest
from hybrid.designs.numbers_and_results import changed_scene
from hybrid.scene.read import as_scene


def agree(
    tables: Any, of: list[str], keys: list[str], within: float, steps: Sequence[float] = (1e-5,),
    changed: Callable[..., Any] = changed_scene,
) -> NetworkAtRest:  # fmt: skip
    """Each derivative is that of the best of some steps, within a part; steps: parts of a number.

    What answers less than a thousandth, in parts by parts, is compared with that.
    """
    made = as_scene(tables)
    rest = at_rest(made, of)
    for key, ours in zip(keys, rest.by(keys), strict=True):
        number, off = rest.number(key), np.full(len(of), np.inf)
        size = abs(number) or 1.0
        for d in (size * x for x in steps):
            more, less = (at_rest(changed(made, key, number + x), of, 1.0, rest.places).values for x in (d, -d))
            theirs = (more - less) / (2.0 * d)
            off = np.minimum(off, np.abs(ours - theirs) / np.maximum(np.abs(theirs), 1e-3 * np.abs(rest.values) / size))
            if off.max() < within:
                break
        assert off.max() < within, (key, off)
    return rest
