"""What a section bears of tension and bending together: the corners of its capacity polygon."""

from __future__ import annotations

from itertools import pairwise

from hybrid.scene.base import Finding

Corners = tuple[tuple[float, float], ...]  # tension (N), curvature (1/m)


def capacity_findings(rows: Corners) -> list[Finding]:
    """What is wrong with the corners of a capacity polygon, from the largest tension round to bending alone.

    Each has to lie further round, as seen from no load, or the part that is used would have two values.
    """
    if len(rows) < 2:
        fix = "give [largest tension, 0], corners, and [0, largest curvature]"
        return [Finding((), "at least two corners [tension, curvature]", fix, f"{len(rows)} corners")]
    for i, (_, k) in enumerate(rows):
        if k < 0.0:
            return [Finding((i, 1), "a curvature >= 0: the same to either side", "leave the other side out")]
    (T, k), (last_T, last_k) = rows[0], rows[-1]
    if not (T > 0.0 and k == 0.0):
        fix = "begin with [largest tension, 0]; tension in N comes first, then curvature in 1/m"
        return [Finding((0,), "the largest tension without bending, [T, 0] with T > 0", fix)]
    if not ((last_T == 0.0 and last_k > 0.0) or (last_T < 0.0 and last_k == 0.0)):
        expected = "the largest curvature without tension, [0, curvature], or the largest compression, [-T, 0]"
        return [Finding((len(rows) - 1,), expected, "end with that corner")]
    for i, ((T, k), (U, m)) in enumerate(pairwise(rows), start=1):
        if not T * m - U * k > 0.0:
            expected = "a corner further round, from tension to bending, as seen from no load"
            return [Finding((i,), expected, "sort the corners")]
    return []
