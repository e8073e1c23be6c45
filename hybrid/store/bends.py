"""Curvature of a result as vectors about the axes of the bends, for what counts bends to both sides."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from hybrid.store.reader import Result

Floats = np.ndarray


class Bends(NamedTuple):
    """Bends (nt, n, 3) 1/m, inertial, and mean tangents (n, 3), at s (n,) m; twice where it jumps."""

    s: Floats
    vectors: Floats
    tangents: Floats

    def at(self, places: Floats) -> Bends:
        """The same at arc lengths (m), those where curvature jumps twice; between output points linear."""
        s, vectors, tangents = [], [], []
        for x in np.atleast_1d(np.asarray(places, float)).tolist():
            exact = np.flatnonzero(np.abs(self.s - x) <= 1e-9 * np.ptp(self.s))
            if not exact.size:
                k = int(np.clip(np.searchsorted(self.s, x) - 1, 0, len(self.s) - 2))
                w = (x - self.s[k]) / (self.s[k + 1] - self.s[k])
                vectors.append((1.0 - w) * self.vectors[:, [k]] + w * self.vectors[:, [k + 1]])
                tangents.append((1.0 - w) * self.tangents[[k]] + w * self.tangents[[k + 1]])
            else:
                vectors.append(self.vectors[:, exact])
                tangents.append(self.tangents[exact])
            s += [x] * tangents[-1].shape[0]
        return Bends(np.array(s), np.concatenate(vectors, axis=1), np.concatenate(tangents))

    def across(self) -> Floats:
        """Components (nt, n, 2) 1/m about two axes across the mean tangents."""
        mean = self.tangents
        one = np.cross(mean, np.eye(3)[np.abs(mean).argmin(axis=1)])
        one /= np.linalg.norm(one, axis=1, keepdims=True)
        two = np.cross(mean, one)
        two /= np.linalg.norm(two, axis=1, keepdims=True)
        return np.stack([(self.vectors * one).sum(axis=2), (self.vectors * two).sum(axis=2)], axis=2)


def bends_of(result: Result, rows: slice | Floats) -> Bends:
    """The bends of outputs: `curvature` about the axis t x dt/ds of the tangents."""
    s, size = result.both_sides("curvature")
    theta, phi = (result.both_sides(name)[1][rows] for name in ("theta", "phi"))
    t = np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], axis=2)
    axes = np.cross(t, slopes(s, t))
    length = np.linalg.norm(axes, axis=2, keepdims=True)
    axes = np.divide(axes, length, out=np.zeros_like(axes), where=length > 0.0)
    return Bends(s, size[rows][..., None] * axes, t.mean(axis=0))


def slopes(s: Floats, x: Floats) -> Floats:
    """Derivatives of x (nt, n, 3) along s (n,), second order, at ends too; nothing is taken across a place that comes
    twice."""
    out = np.zeros_like(x)
    edges = [0, *(np.flatnonzero(np.diff(s) <= 0.0) + 1).tolist(), s.size]
    for a, b in pairwise(edges):
        if b - a > 1:
            out[:, a:b] = np.gradient(x[:, a:b], s[a:b], axis=1, edge_order=2 if b - a > 2 else 1)
    return out
