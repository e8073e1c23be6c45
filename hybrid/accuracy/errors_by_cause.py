"""Estimated errors of a result, by cause and output, computed in blocks."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from math import prod
from typing import NamedTuple

import numpy as np

from hybrid.accuracy.error_order import MOST
from hybrid.simulation.run_sample import END_FORCES


class Block(NamedTuple):
    """Errors of an output by one cause: magnitudes (n, ...) at n output times, from number `begin` on."""

    cause: str
    name: str
    begin: int
    values: np.ndarray


class Errors:
    """Estimated errors of a run, by cause ("mesh", "time", "model", "total") and output, computed in blocks."""

    def __init__(self, fields: Mapping[str, Mapping[str, tuple[int, ...]]], blocks: Callable[[], Iterator[Block]]):
        """fields: shapes (nt, ...) of all errors, by cause and output; blocks: computes them."""
        self.fields, self._compute = fields, blocks
        self._largest: dict[tuple[str, str], np.ndarray] | None = None  # over time
        numbers = sum(prod(shape) for found in fields.values() for shape in found.values())
        self._kept: list[Block] | None = [] if numbers <= MOST else None  # once they are computed

    @classmethod
    def of(cls, values: Mapping[str, Mapping[str, np.ndarray]]) -> Errors:
        """From magnitudes, by cause and output."""
        shapes = {cause: {name: x.shape for name, x in found.items()} for cause, found in values.items()}
        flat = [Block(cause, name, 0, x) for cause, found in values.items() for name, x in found.items()]
        return cls(shapes, lambda: iter(flat))

    def blocks(self) -> Iterator[Block]:
        """All of them, each computed when it is asked for; few are kept."""
        if self._kept:
            yield from self._kept
            return
        largest: dict[tuple[str, str], np.ndarray] = {}
        kept = []
        for block in self._compute():
            key = block.cause, block.name
            most = np.max(block.values, axis=0, initial=0.0)
            largest[key] = np.maximum(most, largest[key]) if key in largest else most
            if self._kept is not None:
                kept.append(block)
            yield block
        self._largest = largest
        if self._kept is not None:
            self._kept = kept

    def largest(self, cause: str, name: str, allowed: np.ndarray | None = None) -> float:
        """Largest error of an output, or of it over `allowed` (ns,), NaN where nothing is; 0 where not estimated."""
        if self._largest is None:
            for _ in self.blocks():
                pass
        assert self._largest is not None
        found = self._largest.get((cause, name))
        if found is None:
            return 0.0
        return float(np.max(found, initial=0.0) if allowed is None else np.nanmax(found / allowed, initial=0.0))


def summary(errors: Errors) -> dict[str, float]:
    """The largest errors of position (m) and of the end forces (N), by cause, as attributes of a result."""
    out = {}
    for cause in errors.fields:
        out[f"error_{cause}_position"] = errors.largest(cause, "position")
        out[f"error_{cause}_end_force"] = max(errors.largest(cause, name) for name in END_FORCES.values())
    return out
