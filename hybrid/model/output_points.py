"""Where along the cable results are written, and where quantities may have two values."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import accumulate, pairwise
from typing import NamedTuple

import numpy as np

from hybrid.kernels.state.state import Floats
from hybrid.model.sections import section_changes
from hybrid.scene.schema import LineScene, RodZone, Spread, ZonesModel

# Part of the length below which two places are one.
NEAR = 1e-9


class OutputPoints(NamedTuple):
    """Arc lengths, m, of a result: s (ns,), its output points, and jumps, those of them where a value may be two."""

    s: Floats
    jumps: Floats


def output_points(scene: LineScene, longest: float | None = None, at_start: bool = False) -> OutputPoints:
    """The points that `output.points` asks for, those of the history, and all jumps.

    longest: m, of a line that is paid out, how much may be out, and at_start: whether at its start, where s is then
    negative; its points are in material.
    Of points that round-off alone tells apart there is one: a jump before one of the history, that before another.
    """
    asked, length, jumps = scene.output.points, scene.length, jump_points(scene)
    ends = (length - (longest or length), length) if at_start else (0.0, longest or length)
    usual = np.linspace(*ends, asked) if isinstance(asked, int) else np.array(asked, float)
    followed = (x for x in scene.output.history or () if all(abs(x - at) > NEAR * length for at in jumps))
    more = [*jumps, *distinct(followed, length)]
    if more:
        near = np.abs(usual[:, None] - np.array(more)).min(axis=1) <= NEAR * length
        usual = np.unique(np.concatenate([usual[~near], more]))
    return OutputPoints(usual, np.array(jumps, float))


def jump_points(scene: LineScene) -> tuple[float, ...]:
    """Arc lengths (m) inside the cable where quantities may have two values, one on each side.

    Point loads, changes of section, ends of modules and stiffeners, joints of rod and catenary in zones that stay where
    they are.
    """
    found = [*section_changes(scene)]
    for item in scene.cable.attachments:
        found += list(item.range) if isinstance(item, Spread) else [item.at]
    if isinstance(scene.model, ZonesModel):
        zones = scene.model.zones
        ends = accumulate(next(iter(zone.model_dump().values())) for zone in zones)
        neighbours = pairwise(isinstance(zone, RodZone) for zone in zones)
        found += [end for end, (left, right) in zip(ends, neighbours, strict=False) if left != right]
    return tuple(distinct(found, scene.length))


def distinct(places: Iterable[float], length: float) -> list[float]:
    """Places (m) inside a cable of that length (m) in order, one of those that round-off alone tells apart."""
    out: list[float] = []
    for x in sorted(places):
        if x - (out[-1] if out else 0.0) > NEAR * length and length - x > NEAR * length:
            out.append(float(x))
    return out
