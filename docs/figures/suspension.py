"""The suspension of the paper in space and in a plane: its shape at rest, and what its joint gains over a full rod.

    python docs/figures/suspension.py

Times are measured anew (some five minutes), by the bench.
"""

from __future__ import annotations

import io
import sys
from pathlib import Path
from typing import Any

import matplotlib as mpl

mpl.use("Agg")
import matplotlib.pyplot as plt

ROOT = Path(__file__).parents[2]
sys.path[:0] = [str(ROOT / "bench"), str(ROOT / "docs" / "figures")]
from make_pictures import shrink  # noqa: E402
from test_bench_zones import SUSPENSION_STEPS, gains_of_a_joint, suspension  # noqa: E402  of the bench

MODELS: dict[str, tuple[dict[str, Any], str]] = {
    "rod everywhere": ({"kind": "rod"}, "C0"),
    "catenary to 1.5 m, rod from there": ({"kind": "zones", "zones": [{"catenary": 1.5}, {"rod": 0.5}]}, "C1"),
    "catenary everywhere": ({"kind": "catenary"}, "C2"),
}
HEADLINE = (1.5, 2.0)  # times that the paper says


def draw_shapes(side: Any, above: Any) -> None:
    """At rest in a current across it: from the side and from above."""
    for name, (model, colour) in MODELS.items():
        with suspension(80, True, model) as result:
            x, y, z = result.position[-1].T
            side.plot(x, z, color=colour, label=name)
            above.plot(x, y, color=colour)
            if model["kind"] == "zones":
                k = abs(result.s - 1.5).argmin()
                side.plot(x[k], z[k], "o", color=colour, mfc="white")
                above.plot(x[k], y[k], "o", color=colour, mfc="white")
    side.set(ylabel="z (m)", ylim=(-0.5, 0.4), title="at rest, in a current of 1 m/s across")
    above.set(xlabel="x (m)", ylabel="y (m)")
    side.legend(loc="upper left", fontsize=8)


def draw_gains(axes: Any) -> None:
    """Whole runs over the number of cells."""
    axes.axhspan(*HEADLINE, color="0.9", label="Goyal and Perkins: 1.5 to 2")
    for space, style in ((True, "o-"), (False, "s--")):
        gains = [gains_of_a_joint(cells, space)[1] for cells in SUSPENSION_STEPS]
        print("in space" if space else "in a plane", [round(x, 2) for x in gains])
        axes.plot(list(SUSPENSION_STEPS), gains, style, color="C1", label="in space" if space else "in a plane")
    axes.axhline(1.0, color="0.5", lw=0.8)
    axes.set(
        xscale="log", xlabel="cells", ylabel="rod over hybrid", title="processor time of whole runs", ylim=(0.8, 2.4)
    )
    axes.legend(loc="upper left", fontsize=8)


def main() -> None:
    figure, axes = plt.subplot_mosaic([["side", "gain"], ["above", "gain"]], figsize=(9, 4.2), layout="constrained")
    draw_shapes(axes["side"], axes["above"])
    draw_gains(axes["gain"])
    page = io.BytesIO()
    figure.savefig(page, dpi=110)
    shrink(page.getvalue(), ROOT / "docs" / "pictures" / "suspension_gain.png")


if __name__ == "__main__":
    main()
