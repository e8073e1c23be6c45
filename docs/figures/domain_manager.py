"""The domain manager at work on the touchdown of the examples: criteria, plan, change (docs/zone_rules.md).

python docs/figures/domain_manager.py
"""

from __future__ import annotations

import io
import sys
from pathlib import Path

import matplotlib as mpl

mpl.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

import hybrid

ROOT = Path(__file__).parents[2]
sys.path[:0] = [str(ROOT / "docs" / "figures")]
from make_pictures import shrink  # noqa: E402

SETTINGS = [
    "model={kind: adaptive, tolerance: 3e-5, hold_time: 2}", "mesh.cells=200", "time.duration=40",
    "output={every: 0.1, points: 501, criteria: true}",
]  # fmt: skip
SHOWN, MORE, LESS = (85.0, 125.0), ("split", "grow", "retry"), ("shrink", "merge")  # m; kinds of events


def main() -> None:
    """Run the example and draw its picture."""
    result = hybrid.run(hybrid.load_scene(ROOT / "examples" / "touchdown.yaml", SETTINGS))
    t, s = result.t, result.s
    ratio = np.max([result[x] for x in result.names if x.startswith("criteria/")], axis=0)
    rod = np.array([[any(z.kind == "rod" and z.s_a <= x <= z.s_b for z in zones) for x in s] for zones in result.zones])
    figure, (criteria, plan, change) = plt.subplots(
        3, 1, figsize=(9, 7), sharex=True, layout="constrained", height_ratios=(3, 3, 2)
    )
    mesh = criteria.pcolormesh(t, s, np.log10(np.maximum(ratio, 1e-2)).T, cmap="viridis", rasterized=True)
    criteria.contour(t, s, ratio.T, [1.0], colors="white", linewidths=1.0)
    bar = figure.colorbar(mesh, ax=criteria, ticks=[-2, -1, 0])
    bar.ax.set_yticklabels(["0.01", "0.1", "1"])
    title = "1  criteria: the largest ratio; white: 1, from where it asks for a rod"
    criteria.set(ylabel="s (m)", ylim=SHOWN, title=title)
    asks = np.where(rod, np.where(ratio > 1.0, 2.0, 1.0), 0.0)
    plan.pcolormesh(t, s, asks.T, cmap=mpl.colors.ListedColormap(["white", "#9ecae1", "#08519c"]), rasterized=True)
    title = "2  plan: rod where it is asked (dark), within 2 λ of that, and until hold times are over (light)"
    plan.set(ylabel="s (m)", ylim=SHOWN, title=title)
    change.plot(t, result["work/zones"], color="C1")
    for kinds, marker in ((MORE, "^"), (LESS, "v")):
        at = [e.t for e in result.events if e.kind in kinds]
        change.plot(at, np.interp(at, t, result["work/zones"]), marker, color="k", ms=4)
    title = "3  change: a rod grows (▲) or is let go (▼); the energy that all changes have put in"
    change.set(xlabel="t (s)", ylabel="J", title=title)
    page = io.BytesIO()
    figure.savefig(page, dpi=110)
    shrink(page.getvalue(), ROOT / "docs" / "pictures" / "domain_manager.png")


if __name__ == "__main__":
    main()
