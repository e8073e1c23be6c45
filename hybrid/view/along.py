"""Quantities along the cable with both values where they jump, and curves with a gap there."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from hybrid.store.envelope import GROUP, SCALE, has_envelope
from hybrid.store.reader import Result

AXES = ("x", "y", "z")


class Along(NamedTuple):
    """Arc lengths s (n,), m, and values (nt, n) there; a jump comes twice, the left value first.

    points (n,): which output point each of them is.
    """

    s: np.ndarray
    values: np.ndarray
    points: np.ndarray

    def curve(self, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """s and y (..., n) of a curve, with a gap in y at jumps."""
        at = np.flatnonzero(np.diff(self.s) == 0.0) + 1
        return np.insert(self.s, at, self.s[at]), np.insert(np.asarray(y, float), at, np.nan, axis=-1)

    def of(self, result: Result, name: str) -> np.ndarray | None:
        """What else the file has of every output point, (..., ns), here; None if it does not have it."""
        if name not in result:
            return None
        found = result.both_sides(name)[1]
        return found if found.shape[-1] == len(self.s) else found[..., self.points]

    def side(self, k: int) -> int:
        """Of the k-th place -1 or 1, on the left or on the right of a jump; else 0."""
        s = self.s
        return int(k > 0 and s[k - 1] == s[k]) - int(k + 1 < len(s) and s[k + 1] == s[k])


def extent(result: Result, name: str) -> tuple[np.ndarray, np.ndarray, np.ndarray, str]:
    """Arc lengths (n,), lowest and highest value there with a gap at jumps, and of what: every step, or every output.

    Every accepted step, and outputs between nodes that go beyond it, where the file has its envelope, except where
    zones are corrected for bending, as in results of 0.6: an envelope is of the line that was computed.
    """
    found = along(result, name)
    low, high = found.values.min(axis=0), found.values.max(axis=0)
    corrected = any(zone.kind == "corrected" for zone in result.zones[-1])
    if has_envelope(result) and not corrected and f"{GROUP}/{name}_max" in result:
        bounds = [result[f"{GROUP}/{name}_{x}"] for x in ("min", "max")]
        if all(np.isfinite(x).all() for x in bounds):
            steps = found._replace(s=result[SCALE])
            steps, low, high = _widened(steps, bounds[0], bounds[1], found, low, high)
            (s, low), (_, high) = (steps.curve(x) for x in (low, high))
            return s, low, high, "every step"
    (s, low), (_, high) = (found.curve(x) for x in (low, high))
    return s, low, high, "every output"


def _widened(
    steps: Along, low: np.ndarray, high: np.ndarray, outputs: Along, lowest: np.ndarray, highest: np.ndarray
) -> tuple[Along, np.ndarray, np.ndarray]:
    """Places of an envelope and its bounds there, with those of outputs between nodes that lie beyond them."""
    near = 1e-9 * float(np.ptp(steps.s))

    def apart(s: np.ndarray) -> np.ndarray:
        """Places that come twice, on their sides."""
        twice, out = np.flatnonzero(np.diff(s) == 0.0), s.copy()
        out[twice] -= near
        out[twice + 1] += near
        return out

    a, b = apart(steps.s), apart(outputs.s)
    low, high = low.copy(), high.copy()
    nearest = np.abs(a - b[:, None]).argmin(axis=1)
    same = np.abs(a[nearest] - b) < 1.5 * near  # at a node there is no other place
    np.minimum.at(low, nearest[same], lowest[same])
    np.maximum.at(high, nearest[same], highest[same])
    more = ~same & ((lowest < np.interp(b, a, low)) | (highest > np.interp(b, a, high)))
    order = np.argsort(np.concatenate([a, b[more]]), kind="stable")
    s, low, high = (
        np.concatenate([x, y[more]])[order] for x, y in ((steps.s, outputs.s), (low, lowest), (high, highest))
    )
    return steps._replace(s=s), low, high


def along(result: Result, name: str) -> Along:
    """A quantity along the cable; of a vector its magnitude, and x, y, z of the position."""
    if name in AXES:
        s, values = result.s, np.asarray(result.position[..., AXES.index(name)])
    else:
        s, values = result.both_sides(name)
        values = np.linalg.norm(values, axis=-1) if result.dims(name)[-1] == "xyz" else values
    return Along(s, values, np.searchsorted(result.s, s))
