"""Quantities that a scene asks for by name, of a batch of states: angles and forces at ends, layback, clearance."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from hybrid.kernels.laws.bed import planes_under
from hybrid.kernels.state.state import Floats
from hybrid.kernels.watch.named_quantities import LEAST_AZIMUTH
from hybrid.model.payout import whole_scene
from hybrid.model.sections import outer_diameter
from hybrid.outputs.observation import Observation, Probe
from hybrid.outputs.section_use import Capacities, Codes, Pipes

if TYPE_CHECKING:
    from hybrid.scene.quantities import Quantity
    from hybrid.scene.schema import LineScene

END = {"start": 0, "end": 1}
# Where a clearance is least: name of that field, after the name of the clearance.
WHERE = "_at"
# Pairs of chords that are looked at one and all; of more only those that can be nearest.
FEW = 4096


def quantities_of(scene: LineScene) -> Quantities | None:
    """What a scene asks for beside the usual outputs; None: nothing."""
    along = any(x.pipe is not None or x.capacity is not None or x.code is not None for x in scene.cable.sections)
    return Quantities(scene, scene.output.quantities) if along or scene.output.quantities else None


class Quantities:
    """The quantities of one line as probes, and the places from which excursions count."""

    def __init__(self, scene: LineScene, wanted: Mapping[str, Quantity]) -> None:
        self.wanted = dict(wanted)
        self.pipes = Pipes(scene) if any(x.pipe is not None for x in scene.cable.sections) else None
        self.capacities = Capacities(scene) if any(x.capacity for x in scene.cable.sections) else None
        self.codes = Codes(scene) if any(x.code for x in scene.cable.sections) else None
        self._scene, self._begin = whole_scene(scene)
        self._seabed = scene.environment.seabed is not None
        # nodes (nb, m+1, 3) m and radii of cells (m,) m of other lines in the outputs that are looked at, by name
        self.others: dict[str, tuple[Floats, Floats]] = {}
        # (n, 2) m, of the excursions in their order; NaN until there is a touchdown
        self.first = np.array(
            [q.reference or (np.nan, np.nan) for q in self.wanted.values() if q.kind == "touchdown_excursion"]
        ).reshape(-1, 2)
        # (n,) deg, from which azimuths are within half a turn, in their order; NaN until there is a pull
        self.turns = np.array([q.middle for q in self.wanted.values() if q.kind == "azimuth"])

    def probes(self) -> dict[str, Probe]:
        """Probes by name."""
        along = (x for x in (self.pipes, self.capacities, self.codes) if x is not None)
        found = {name: probe for x in along for name, probe in x.probes().items()}
        excursions = azimuths = 0
        for name, q in self.wanted.items():
            if q.kind == "touchdown_excursion":
                value = partial(self._excursion, q, excursions)
                excursions += 1
            elif q.kind == "azimuth":
                value = partial(self._azimuth, q, azimuths)
                azimuths += 1
            elif q.kind == "clearance":
                value = partial(self._clearance, q, 0)
                text = f"arc length at which {name} is least"
                found[name + WHERE] = Probe("m", text, (), partial(self._clearance, q, 1))
            else:
                value = partial(getattr(self, f"_{q.kind}"), q)
            found[name] = Probe(q.unit, q.description(self._seabed), (), value)
        return found

    # --- at the ends ---------------------------------------------------------------------------------

    def _horizontal_force(self, q: Quantity, v: Observation) -> Floats:
        x, y, _ = pull(v, q)
        return np.asarray(np.hypot(x, y))

    def _vertical_force(self, q: Quantity, v: Observation) -> Floats:
        return pull(v, q)[2]

    def _force_along(self, q: Quantity, v: Observation) -> Floats:
        return np.asarray(unit(q) @ pull(v, q))

    def _declination(self, q: Quantity, v: Observation) -> Floats:
        x, y, z = pull(v, q)
        return known(np.degrees(np.arctan2(np.hypot(x, y), z)), v, q)

    def _azimuth(self, q: Quantity, k: int, v: Observation) -> Floats:
        x, y, _ = pull(v, q)
        found = known(np.degrees(np.arctan2(y + 0.0, x)), v, q)  # no -0, which is half a turn away
        if np.isnan(self.turns[k]) and np.isfinite(found).any():
            first = float(found[np.isfinite(found).argmax()])
            self.turns[k] = first + 360.0 if first <= LEAST_AZIMUTH else first
        return found if np.isnan(self.turns[k]) else found + 360.0 * np.floor((self.turns[k] - found) / 360.0 + 0.5)

    def _end_angle(self, q: Quantity, v: Observation) -> Floats:
        along, force = unit(q), pull(v, q)
        aside = np.linalg.norm(np.cross(force, along, axis=0), axis=0)
        return known(np.degrees(np.arctan2(aside, along @ force)), v, q)

    def _uplift(self, q: Quantity, v: Observation) -> Floats:
        return np.maximum(_normal(v, q)[0], 0.0)

    def _uplift_angle(self, q: Quantity, v: Observation) -> Floats:
        up, along = _normal(v, q)
        return np.degrees(np.arctan2(np.maximum(up, 0.0), along))

    # --- on the seabed -------------------------------------------------------------------------------

    def _touchdown(self, q: Quantity, v: Observation) -> Floats:
        return v.touchdown.edges[END[str(q.end)]]

    def _excursion(self, q: Quantity, k: int, v: Observation) -> Floats:
        x, y, _ = v.touchdown.places[END[str(q.end)]]
        if np.isnan(self.first[k, 0]) and np.isfinite(x).any():
            first = int(np.isfinite(x).argmax())
            self.first[k] = x[first], y[first]
        return np.asarray(np.hypot(x - self.first[k, 0], y - self.first[k, 1]))

    def _layback(self, q: Quantity, v: Observation) -> Floats:
        k = END[str(q.end)]
        here = v.r[-k]
        there = v.touchdown.places[k] if q.ends_at(self._seabed) == "touchdown" else v.r[k - 1]
        return np.asarray(np.hypot(there[0] - here[0], there[1] - here[1]))

    # --- clearance -----------------------------------------------------------------------------------

    def _clearance(self, q: Quantity, what: int, v: Observation) -> Floats:
        if q.other is not None:
            there, rb = self.others[q.other]
        else:
            other = q.path if q.path is not None else (q.point,)
            there, rb = np.array(other, float)[None], np.full(max(len(other) - 1, 1), 0.5 * q.diameter)
        first, last, radius = self.cells(q, v)
        nodes, found = v.of_line("s", slice(None)), []
        for output, r in enumerate(v.r[first : last + 1].transpose(2, 0, 1)):
            s, b = nodes[:, min(output, nodes.shape[1] - 1)], there[min(output, len(there) - 1)]
            if q.normal is not None:
                n = np.array(q.normal) / np.linalg.norm(q.normal)
                height = (r - b[0]) @ n
                height = np.minimum(height[:-1], height[1:]) - radius
                k = int(height.argmin())
                least, part = float(height[k]), float((r[k + 1] - r[k]) @ n < 0.0)
            else:
                least, k, part = nearest(r, b, radius, rb)
            found.append((least, s[first + k] + part * (s[first + k + 1] - s[first + k]))[what])
        return np.array(found)

    def cells(self, q: Quantity, v: Observation) -> tuple[int, int, Floats]:
        """First and last node, and radii (m) of the cells between, of the part of a line that counts."""
        s = v.line.s
        first, last = 0, s.size - 1
        if q.range is not None:
            first, last = (int(np.abs(s - x).argmin()) for x in q.range)
            first, last = min(first, s.size - 2), max(last, first + 1)
        return first, last, self.radii(s[first : last + 1])

    def radii(self, nodes: Floats) -> Floats:
        """Radii (n,) m of the cells between nodes (n+1,), m; 0 where no diameter is given."""
        return 0.5 * np.nan_to_num(outer_diameter(self._scene, 0.5 * (nodes[1:] + nodes[:-1]) - self._begin))


def pull(v: Observation, q: Quantity) -> Floats:
    """Force (3, nb) N with which the line pulls at what holds an end; none where nothing holds it."""
    k = END[str(q.end)]
    force = v.reaction(k)
    return np.asarray(np.where((v.batch.held[:, k] != 0) | v.loaded(k), -force, 0.0))


def known(angle: Floats, v: Observation, q: Quantity) -> Floats:
    """An angle (nb,) of the pull; NaN where there is none."""
    return np.where((pull(v, q) ** 2).sum(axis=0) > 0.0, angle, np.nan)


def unit(q: Quantity) -> Floats:
    """The direction of a quantity as a unit vector."""
    return np.array(q.direction, float) / np.linalg.norm(np.array(q.direction, float))


def _normal(v: Observation, q: Quantity) -> tuple[Floats, Floats]:
    """Parts (nb,) N of the pull along the normal of the seabed under the end, and along the seabed."""
    force = pull(v, q)
    n = planes_under(v.sea, np.ascontiguousarray(v.r[-END[str(q.end)]].T))[0]
    up = np.einsum("bi,ib->b", n, force)
    return up, np.linalg.norm(force - up * n.T, axis=0)


# --- least distances between polylines, exact for their chords --------------------------------------


def nearest(a: Floats, b: Floats, ra: Floats, rb: Floats) -> tuple[float, int, float]:
    """Least clearance (m) of two polylines, distance less both radii, and where it is.

    a (n+1, 3), b (m+1, 3): nodes, m, a single node b being a point; ra (n,), rb (m,): radii of their chords, m.
    Where: which chord of a is nearest, and which part of it.
    """
    if len(b) == 1:
        b = np.concatenate([b, b])
    a0, a1, b0, b1 = a[:-1], a[1:], b[:-1], b[1:]
    if len(a0) * len(b0) <= FEW:
        i, j = (x.ravel() for x in np.indices((len(a0), len(b0))))
    else:
        i, j = _candidates(a0, a1, b0, b1, ra, rb)
    distance, part = between(a0[i], a1[i], b0[j], b1[j])
    clear = distance - ra[i] - rb[j]
    k = int(clear.argmin())
    return float(clear[k]), int(i[k]), float(part[k])


def between(a0: Floats, a1: Floats, b0: Floats, b1: Floats) -> tuple[Floats, Floats]:
    """Distances (n,) m of chords a0 a1 and b0 b1, each (n, 3) m, and the part of a where it is nearest."""
    da, db, r = a1 - a0, b1 - b0, a0 - b0
    aa, bb, ab = (np.einsum("ni,ni->n", x, y) for x, y in ((da, da), (db, db), (da, db)))
    ar, br = np.einsum("ni,ni->n", da, r), np.einsum("ni,ni->n", db, r)
    tiny = 1e-300
    area = aa * bb - ab * ab
    s = np.where(area > 1e-12 * aa * bb, np.clip((ab * br - ar * bb) / np.where(area > tiny, area, 1.0), 0.0, 1.0), 0.0)
    t = np.where(bb > tiny, (ab * s + br) / np.where(bb > tiny, bb, 1.0), 0.0)
    held = np.clip(t, 0.0, 1.0)
    along = np.where(aa > tiny, np.clip((ab * held - ar) / np.where(aa > tiny, aa, 1.0), 0.0, 1.0), 0.0)
    s = np.where((t != held) | (bb <= tiny), along, s)
    apart = r + s[:, None] * da - held[:, None] * db
    return np.sqrt(np.einsum("ni,ni->n", apart, apart)), s


def _candidates(
    a0: Floats, a1: Floats, b0: Floats, b1: Floats, ra: Floats, rb: Floats
) -> tuple[np.ndarray, np.ndarray]:
    """Pairs of chords that may be the nearest: the spheres around them are no farther apart than two nodes are."""
    from scipy.spatial import cKDTree

    middle_a, middle_b = 0.5 * (a0 + a1), 0.5 * (b0 + b1)
    half_a, half_b = (0.5 * np.linalg.norm(x - y, axis=1) for x, y in ((a1, a0), (b1, b0)))
    tree = cKDTree(middle_b)
    distance, k = tree.query(middle_a)
    most = float((distance - ra - rb[k]).min())
    found = tree.query_ball_point(middle_a, np.maximum(most + half_a + ra, 0.0) + float((half_b + rb).max()) + 1e-9)
    i = np.repeat(np.arange(len(a0)), [len(x) for x in found])
    j = np.concatenate([np.asarray(x, int) for x in found])
    return i, j
