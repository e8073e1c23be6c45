"""What every run must keep: lengths, frames, the energy ledger, and the link of a twisted rod."""

from __future__ import annotations

import math

import numpy as np
import pytest
from problems import build, motion, order, shaken_line, solid_angle, turned_by, turned_ring, twist_of, writhe

import hybrid
from hybrid.scene.read import one_line


@pytest.mark.long
@pytest.mark.parametrize("damping", [0.0, 0.01], ids=["undamped", "damped strain"])
@pytest.mark.parametrize("kind", ["catenary", "rod", "hybrid"])
def test_length_and_frames_over_many_steps(kind, damping, report):
    """10^4 steps of a cable shaken in three dimensions."""
    scene = shaken_line(kind, 0.01, 100.0, damping, 0.5)
    spin = build(one_line(scene)).line.spin == 1
    longest = worst = 0.0
    steps = -1
    for _, state in motion(scene):
        steps += 1
        length = np.linalg.norm(np.diff(state.r, axis=0), axis=1)
        longest = max(longest, abs(length.sum() / scene.length - 1))
        if spin.any():
            d = (state.e / np.linalg.norm(state.e, axis=1)[:, None])[spin]
            a1 = state.a1[spin]
            off = max(np.abs((a1 * a1).sum(axis=1) - 1).max(), np.abs((a1 * d).sum(axis=1)).max())
            worst = max(worst, float(off))
    assert steps == 10_000
    with_ = f" with stiffness damping {damping} s" if damping else ""
    assert worst <= 1e-12
    if spin.any() and not damping:
        what = f"Frames of a {kind}: unit and normal to the chord, 10^4 steps"
        report(what, "orthonormal", f"{worst:.1e}", "1e-12")
    report(f"Length of an inextensible {kind}{with_}, 10^4 steps", "compatibility", f"{longest:.1e} L", "1e-9 L")
    assert longest <= 1e-9


@pytest.mark.parametrize("damping", [0.0, 0.01], ids=["undamped", "damped strain"])
@pytest.mark.parametrize("kind", ["elastic", "catenary", "rod", "hybrid"])
def test_energy_ledger(kind, damping, report):
    """Ends that move and turn, drag in a current, added mass, damping: what is left is of order 2."""
    left, scale = [], 0.0
    for step in (0.02, 0.01, 0.005):
        work = hybrid.run(shaken_line(kind, step, 6.0, damping)).work
        scale = np.abs(work["end"]).max()
        left.append(np.abs(work["scheme"]).max() / scale)
    p = order(left)
    report(
        f"Energy ledger, {kind}{', damped strain' * (damping > 0)}: what no work accounts for, dt = 10 ms",
        "change of energy = work",
        f"{left[1]:.1e} of the work of the end ({scale:.0f} J), order {p[0]:.2f}, {p[1]:.2f}",
        "discretisation: 1e-4, order 2.0 +- 0.1",
    )
    assert left[1] <= 1e-4
    assert np.abs(p - 2.0).max() <= 0.1


@pytest.mark.slow  # 20 s
def test_link_is_twist_and_writhe(report):
    """A ring whose end is turned twice: it buckles, and passes through itself (there is no contact; link changes by 2).

    1e-7: Gauss's integral takes the arcsine of numbers near one, which keeps half the digits.
    """
    scene = turned_ring(40, 0.002)
    model = build(one_line(scene))

    def lean(state, _model):
        s = model.line.s
        state.v[:, 1] = 1e-2 * np.sin(4 * math.pi * s) * np.sin(math.pi * s) ** 2

    worst = largest = 0.0
    for k, (t, state) in enumerate(motion(scene, lean)):
        if k % 40 == 0:
            ends = model.ends.at_time(t)
            d = state.e / np.linalg.norm(state.e, axis=1)[:, None]
            corner = solid_angle(d[-1], ends.frame[0].reshape(3, 3)[:, 2], d[0]) / (2 * math.pi)
            w = writhe(state.r[:-1])
            link = twist_of(state, ends) + w + corner - turned_by(t) / (2 * math.pi)
            worst, largest = max(worst, abs(link - 2 * round(link / 2))), max(largest, abs(w))
    report(
        "Link = twist + writhe of a ring turned 2.1 times",
        "Calugareanu, White",
        f"{worst:.1e}, writhe up to {largest:.2f}",
        "round-off: 1e-7, and a writhe of at least 0.3",
    )
    assert worst <= 1e-7
    assert largest >= 0.3
