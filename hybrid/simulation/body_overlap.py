"""Events where a body with a shape is in another one, in an obstacle or in the seabed: lines alone touch shapes."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

import numpy as np

from hybrid.kernels.laws.bed import planes_under
from hybrid.kernels.laws.obstacles import distances, put_obstacles
from hybrid.kernels.state.forces import OBSTACLES, SEABED
from hybrid.kernels.state.obstacle_rows import (
    AXIS,
    BOX,
    HALF_LENGTH,
    HALF_WIDTH,
    PLACE,
    RADIUS,
    RIDES,
    SIDE,
    STRAND,
)
from hybrid.kernels.state.state import Floats, Sea
from hybrid.model.network import NetworkModel
from hybrid.simulation.run_points import Sampled

Tell = Callable[[float, float, float, str, str], None]
KIND_OF_EVENT, BED = "bodies overlap", "the seabed"
# Parts of an axis, and along the flat of a box to each of its sides, at which a body is looked at; of the smaller
# radius, how deep one is in another.
PARTS, DEEP = np.linspace(-1.0, 1.0, 9), 0.05


def note_overlaps(model: NetworkModel, seen: Sampled, told: set[str], tell: Tell) -> None:
    """An event for each pair of bodies, or body and obstacle or bed, that are in each other.

    told: what has been said, to which they are added.
    """
    lines = zip(model.models, seen.lines, strict=True)
    found = next(((x, batch) for x, batch in lines if x.line.bits & OBSTACLES), None)
    if found is None or not found[0].sea.values.carried.size or not found[0].sea.values.carried[:, RIDES].any():
        return
    x, batch = found
    sea, names = x.sea.values, x.sea.names
    for k, t in enumerate(batch.t.tolist()):
        rows = sea.obstacles.copy()
        if batch.obstacles.size:
            put_obstacles(rows, sea.carried, batch.obstacles[k])
        for pair, deep in _overlaps(sea._replace(obstacles=rows), names, bool(x.line.bits & SEABED)):
            if (key := " in ".join(pair)) not in told:
                told.add(key)
                text = f"body {pair[0]} is {deep:.3g} m deep in {pair[1]}: lines touch the shapes of bodies, but bodies"
                tell(t, 0.0, 0.0, KIND_OF_EVENT, f"{text} touch neither each other nor obstacles nor the bed")


def _overlaps(sea: Sea, names: Sequence[str], bed: bool) -> Iterator[tuple[tuple[str, str], float]]:
    """Pairs of a body with what it is in, and how deep (m); bed: whether there is one."""
    rows, rides = sea.obstacles, sea.carried[:, RIDES] != 0.0
    for a in np.flatnonzero(rides).tolist():
        radius, core = rows[a, RADIUS] - rows[a, STRAND], _core(rows[a])
        gaps = (distances(sea, core) + rows[:, STRAND, None]).min(axis=1) - radius
        for b, gap in enumerate(gaps):
            least = DEEP * min(radius, rows[b, RADIUS] if rides[b] else radius)
            if b != a and gap < -least and not (rides[b] and b < a):
                yield (names[a], f"body {names[b]}" if rides[b] else f"obstacle {names[b]}"), -float(gap)
        if bed and (deep := float(planes_under(sea, core)[1].max()) - 0.5 * sea.onset + radius) > DEEP * radius:
            yield (names[a], BED), deep


def _core(row: Floats) -> Floats:
    """Places (n, 3) m whose balls, of the radius of a row without the strand's, make the surface of a body."""
    along = row[HALF_LENGTH] * PARTS[:, None] * row[AXIS : AXIS + 3]
    if row[0] != BOX:
        return np.asarray(row[PLACE : PLACE + 3] + along)
    across = row[SIDE : SIDE + 3]
    sides = np.stack([across, np.cross(row[AXIS : AXIS + 3], across)])
    half = row[HALF_WIDTH : HALF_WIDTH + 2, None] * sides
    grid = (PARTS[:, None, None] * half[0] + PARTS[None, :, None] * half[1]).reshape(-1, 3)
    return np.asarray(row[PLACE : PLACE + 3] + (along[:, None] + grid).reshape(-1, 3))
