"""Twist, writhe and link against the double sum over a closed polygon, and what must be whole turns."""

from __future__ import annotations

import numpy as np
import pytest
from problems import writhe as writhe_of

from hybrid.kernels.march.link import link_of
from hybrid.kernels.state.state import Ends, Floats, Line, blank_line, no_ends

FAR = 300.0  # lengths of the line, at which the closed polygon of the tests turns back


def closed(r: Floats, t0: Floats, tn: Floats) -> Floats:
    """The polygon with what closes it, at a finite distance."""
    size = FAR * np.linalg.norm(np.diff(r, axis=0), axis=1).sum()
    axis, angle = np.cross(tn, -t0), np.arccos(np.clip(-tn @ t0, -1.0, 1.0))
    if np.linalg.norm(axis) < 1e-9:
        axis = np.cross(tn, [0.3, 0.2, 0.7])
    axis = np.cross(axis / np.linalg.norm(axis), tn)
    arc = [size * (np.cos(x) * tn + np.sin(x) * axis) for x in np.linspace(0.0, angle, 9)[1:-1]]
    return np.array([*r, r[-1] + size * tn, *arc, r[0] - size * t0])


def line_at(r: Floats, t0: Floats, tn: Floats, random: np.random.Generator) -> tuple[Line, Ends, Floats, Floats]:
    """A line with nodes at r between clamps along t0 and tn, its directors at random."""

    def director(t: Floats) -> Floats:
        a = np.cross(t, random.normal(size=3))
        return np.asarray(a / np.linalg.norm(a))

    e, ends = np.diff(r, axis=0), no_ends()
    lengths = np.linalg.norm(e, axis=1)
    for k, t in enumerate((t0, tn)):
        a = director(t)
        ends.frame[k] = np.column_stack([a, np.cross(t, a), t]).ravel()
    a1 = np.array([director(x) for x in e / lengths[:, None]])
    return blank_line(len(e))._replace(h=lengths, spin=np.ones(len(e), np.int8)), ends, e, a1


def found(r: Floats, t0: Floats, tn: Floats, seed: int = 0) -> tuple[Floats, float]:
    """(4,) of the kernel, and the turns from the frame of the end, carried to the start, to that of the start."""
    line, ends, e, a1 = line_at(r, t0, tn, np.random.default_rng(seed))
    out = link_of(line, ends, r, e, a1, np.zeros((0, 3)))
    a, b = ends.frame[0, 0::3], ends.frame[1, 0::3]
    c = b - (b @ t0) / (1.0 + t0 @ tn) * (t0 + tn)
    return out, float(np.arctan2(t0 @ np.cross(c, a), c @ a) / (2.0 * np.pi))


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("parallel", [True, False], ids=["parallel ends", "any ends"])
def test_writhe_of_random_lines(seed: int, parallel: bool) -> None:
    """As the double sum gives it, and with the twist whole turns but for the angle between the ends."""
    random = np.random.default_rng(seed)
    r = np.cumsum(random.normal(size=(30, 3)), axis=0)
    t0, tn = (x / np.linalg.norm(x) for x in random.normal(size=(2, 3)))
    tn = t0 if parallel else tn
    (twist, writhe, link, crossings), gap = found(r, t0, tn, seed)
    assert writhe == pytest.approx(writhe_of(closed(r, t0, tn)), abs=5e-3)  # of the distance of what closes it
    assert link == pytest.approx(twist + writhe, abs=1e-14)
    assert link + gap == pytest.approx(round(link + gap), abs=1e-12)
    assert crossings == round(crossings)


@pytest.mark.parametrize("turns", [1, -2, 3])
def test_writhe_of_a_helix(turns: int) -> None:
    """Right-handed ones have a positive writhe: turns (1 - cos of the angle of its tangent to its axis)."""
    s, x = np.linspace(0.0, 1.0, 1601), np.array([1.0, 0.0, 0.0])
    angle = 2.0 * np.pi * turns * s
    r = np.column_stack([6.0 * s, 0.05 * np.cos(angle), 0.05 * np.sin(angle)])
    (_, writhe, _, crossings), _ = found(r, x, x)
    exact = turns * (1.0 - 6.0 / np.hypot(6.0, 0.1 * np.pi * turns))
    assert writhe == pytest.approx(exact, rel=0.05)  # ends along the axis turn a little less than the helix
    assert crossings == 0.0


def test_lines_in_a_plane_have_no_writhe() -> None:
    s = np.linspace(0.0, np.pi, 100)
    down, up = np.array([0.0, 0.0, -1.0]), np.array([0.0, 0.0, 1.0])
    hairpin = np.column_stack([-np.cos(s), 0.0 * s, -np.sin(s)])
    wave = np.column_stack([s, 0.0 * s, np.sin(3.0 * s) ** 2])
    for r, t0, tn in ((hairpin, down, up), (wave, up, up), (wave, down, -up), (hairpin, -up - down, up)):
        if np.linalg.norm(t0) > 0.0:
            line, ends, e, a1 = line_at(r, t0, tn, np.random.default_rng(1))
            assert link_of(line, ends, r, e, a1, np.zeros((0, 3)))[1] == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("hand", [1.0, -1.0])
def test_a_loop_is_a_crossing(hand: float) -> None:
    """One round loop whose strands cross a little apart: nearly one turn of writhe."""
    x = np.array([1.0, 0.0, 0.0])
    u = np.linspace(-np.pi, np.pi, 201)
    loop = np.column_stack([np.sin(u), -hand * 0.02 * u / np.pi, -np.cos(u) - 1.0])
    lead = np.column_stack([np.linspace(-6.0, 0.0, 50)[:-1], np.full(49, hand * 0.02), np.zeros(49)])
    r = np.vstack([lead, loop[::1] * [-1.0, 1.0, 1.0], lead[::-1] * [-1.0, -1.0, 1.0]])
    (_, writhe, _, crossings), _ = found(r, x, x)
    assert abs(crossings) == 1.0
    assert writhe == pytest.approx(crossings, abs=0.05)
    assert np.sign(writhe) == -hand
