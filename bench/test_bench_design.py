"""Designs: how many equilibria they take, from where they find the same, and how often stated intervals hold.

pytest bench/test_bench_design.py -m bench -s

RECORDS=100 makes so many random records in place of 400, which take a minute.
"""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest

import hybrid
from hybrid.scene.design import DESIGN

pytestmark = pytest.mark.bench
RECORDS = int(os.environ.get("RECORDS", "400"))
DESIGNS = Path(__file__).parents[1] / "examples" / "designs"
# Of the lazy wave: diameter of the buoyancy, lengths of lower, buoyant and upper section.
STARTS = ((0.45, 130, 50, 90), (0.5, 110, 60, 80), (0.6, 120, 30, 100), (0.42, 140, 70, 85), (0.7, 120, 25, 110))


def test_pretension_of_a_buoy_on_three_lines() -> None:
    found = hybrid.design(DESIGNS / "pretension.yaml")
    print(f"pretension of three lines: {found.equilibria} equilibria, that of the check on twice the cells included")
    assert found.equilibria <= 6


def test_lazy_wave_from_five_starts() -> None:
    asked = DESIGN.read(DESIGNS / "lazy_wave.yaml").asked
    values = []
    for start in STARTS:
        each = zip(asked.unknowns.items(), start, strict=True)
        unknowns = {name: x.model_copy(update={"start": float(value)}) for (name, x), value in each}
        more = {x: getattr(asked, x) for x in ("cases", "limits", "minimise")}
        found = hybrid.design(asked.scene, unknowns=unknowns, **more)
        values.append(found.minimised)
        rounds = found.equilibria / len(asked.cases)
        print(
            f"lazy wave from {start}: {found.minimised:.4f} m3, {found.equilibria} equilibria, {rounds:.0f} of each case"
        )
        assert rounds <= 40
    assert max(values) < 1.001 * min(values)


def test_stated_intervals_hold_the_truth(tmp_path: Path) -> None:
    """EI of a sagging rod from records of its height at eight places, with noise of 2 % of its sag."""
    key, truth = "cable.sections[0].bending_stiffness", 8.0
    scene = hybrid.load_scene(DESIGNS / "rod.yaml", [f"{key}={truth}", "mesh.cells=20"])
    rest, s = hybrid.static(scene), np.linspace(0.25, 2.0, 8)
    z = np.interp(s, rest.s, rest.position[-1][:, 2])
    noise, rng, within = 0.02 * abs(z[-1]), np.random.default_rng(0), []
    for _ in range(RECORDS):
        rows = "".join(f"{a:g},{b:.9g}\n" for a, b in zip(s, z + noise * rng.standard_normal(s.size), strict=True))
        (tmp_path / "record.csv").write_text("s,z\n" + rows)
        for stated in ({"deviation": float(noise)}, {}):
            found = hybrid.design(
                scene, unknowns={"EI": {"key": key, "start": 12.0}},
                measured={"file": str(tmp_path / "record.csv")} | stated,
            )  # fmt: skip
            (estimate,) = found.estimates
            within.append(estimate.low <= truth <= estimate.high)
    for k, what in enumerate(("stated", "of the scatter")):
        some = within[k::2]
        hundreds = ", ".join(str(sum(some[a : a + 100])) for a in range(0, len(some), 100))
        held = 100.0 * sum(some) / len(some)
        print(
            f"deviation {what}: EI within its 95 % in {held:.1f} of 100 of {len(some)} records; by hundreds {hundreds}"
        )
        assert 93.0 <= held <= 97.0
