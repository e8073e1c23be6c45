"""What the length of a step does to vortex-induced vibration: amplitude and frequency of a cylinder on springs.

pytest bench/test_bench_vortices.py -m bench -n 0 -s
"""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent.parent / "tests" / "simulation"))

from test_vortices import amplitude, frequency, on_springs

import hybrid

pytestmark = pytest.mark.bench


def test_steps_to_a_period() -> None:
    print(f"\n{'U':>6}{'step':>8}{'a period':>10}{'amplitude/D':>13}{'frequency':>11}")
    for U in (0.45, 0.55, 0.65, 0.75):
        seen = []
        for step in (0.04, 0.02, 0.01):
            found = hybrid.run(on_springs(U, step))
            late = found.t > 20.0
            z = found.position[late, 1, 2]
            seen.append((amplitude(z), frequency(found.t[late], z)))
            print(f"{U:6}{step:8}{1 / step / seen[-1][1]:10.0f}{seen[-1][0]:13.4f}{seen[-1][1]:11.4f}")
        assert seen[0] == pytest.approx(seen[-1], rel=0.02)
