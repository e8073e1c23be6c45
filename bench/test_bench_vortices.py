"""What the length of a step does to vortex-induced vibration, of a cylinder on springs; the mode that a riser shakes in.

pytest bench/test_bench_vortices.py -m bench -n 0 -s
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent.parent / "tests" / "simulation"))

from test_vortices import amplitude, catenary, frequency, on_springs

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


def half_waves(y: np.ndarray) -> int:
    """Of a shape that is zero at its ends."""
    return 1 + int((y[1:-2] * y[2:-1] < 0.0).sum())


def test_mode_of_the_catenary_riser() -> None:
    """Natural frequencies across the flow by half waves, and what the riser that MoorDyn's test has does in time."""
    modes = {}
    for x in hybrid.modes(catenary(), 20).modes:
        if x.what == "sideways":
            modes[half_waves(x.shifts["cable"][:, 1])] = 1.0 / x.period
    print("\n" + ", ".join(f"{n}: {f:.3f} Hz" for n, f in modes.items()))
    found = hybrid.run(catenary())
    late = found.t >= 20.0
    y = found.position[late][:, :, 1] - found.position[late][:, :, 1].mean(axis=0)
    shape = np.linalg.svd(y, full_matrices=False)[2][0]
    f = frequency(found.t[late], y[:, int(np.argmin(np.abs(found.s - 0.66 * 23.71)))])
    print(f"in time: {f:.3f} Hz in {half_waves(shape)} half waves; MoorDyn 1.050 Hz")
    assert half_waves(shape) == 7
    assert f == pytest.approx(modes[7], rel=0.02)
    assert abs(1.0497 - modes[8]) < abs(1.0497 - modes[7])
