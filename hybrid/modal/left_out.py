"""What a linear response leaves out: the rest of quadratic drag of lines and members, and the stretch by swinging.

Both are taken from the linear motion, at times of a stretch of sea, as loads that the linear network then answers:

    on half cells and pieces of members   f(U + u) - mean - B u,        of cells   a length of -|de|^2/2l across,

with B the linear drag of a velocity u relative to the water.  To the first order it is what quadratic drag and large
turns change, harmonics and all; what they change in turn is left out.  docs/theory.md, 21.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from itertools import pairwise, product
from typing import Any

import numpy as np
from scipy import sparse

from hybrid.kernels.algebra.block_elimination import SIZE
from hybrid.kernels.state.state import Floats
from hybrid.linear.drag import shape_of_drag
from hybrid.linear.excitation import current_at
from hybrid.linear.loaded_line import LoadedLine
from hybrid.linear.loaded_members import LoadedMembers
from hybrid.linear.matrices import LinearNetwork
from hybrid.linear.response_results import LineResponse

# Parts of times (of fewer, what is found scatters with the phases by more than a quarter), times of each, how many to
# the shortest period that counts, by a part of the power; loads beyond the last of their power are left out.
PARTS, TIMES, TO_A_PERIOD, POWER = 4, 256, 8.2, 0.01
# Times of each part where free points, bodies or heavy floats have drag, which alone may damp them: parts must outlast
# many such decays, else their windows spread what drag leaves out over more frequencies than the resonance answers to.
RESONANT = 1024
# Multiplications from which a product of matrices is shared among threads, whose waiting takes more processor time than
# products of this size.
SHARED = 2**18
# Amplitudes q of exp(-i w t) that the network answers to those of loads (q,), at w, 1/s.
Answer = Callable[[float, Any], Any]


def left_out(
    network: LinearNetwork, lines: Sequence[LoadedLine], members: Mapping[int, LoadedMembers], answer: Answer
) -> list[LineResponse]:
    """The response of each line, whose motion is known at all frequencies, with parts by which this changes standard

    deviations of tension (N,) and curvature (N+1,), and with the shape of the law of curvature.  members: of bodies, by
    their numbers.
    """
    omegas, step = lines[0].omegas, _step([*lines, *members.values()])
    times = RESONANT if any(x.by_drag for x in lines) else TIMES
    t = step * np.arange(PARTS * times)
    turned = np.hstack([np.cos(np.outer(t, omegas)), np.sin(np.outer(t, omegas))])  # (M, 2F)
    window = np.hanning(times + 1)[:-1]  # so that no end of a part excites what hardly anything damps
    loads = network.place.T @ np.concatenate([_loads(x, turned) for x in lines])  # (q, M)
    for b, each in members.items():
        first = network.size + 6 * (b - network.bodies)
        loads[first : first + 6] += _loads_of_members(each, turned)
    there = np.fft.rfft(loads.reshape(network.size, PARTS, times) * window, axis=2) / times
    nu = 2.0 * np.pi * np.fft.rfftfreq(times, step)
    power = np.cumsum((np.abs(there[:, :, 1:]) ** 2).sum(axis=(0, 1)))
    last = 2 + int(np.searchsorted(power, (1.0 - POWER) * power[-1])) if power[-1] > 0.0 else 1
    numbers = np.arange(1, min(last, nu.size))
    q = np.zeros((network.size, numbers.size, PARTS), complex)
    for row, k in enumerate(numbers):
        q[:, row] = answer(nu[k], there[:, :, k].conj())
    whole = network.place @ q.reshape(network.size, numbers.size * PARTS)
    part = PARTS * float(np.mean(window**2))
    return [_changes(x, whole[a:b], part) for x, (a, b) in zip(lines, pairwise(network.at), strict=True)]


def _step(loaded: Sequence[LoadedLine | LoadedMembers]) -> float:
    """s, between times that show the loads."""
    omegas = loaded[0].omegas
    every = np.arange(omegas.size)
    power = sum((np.abs(x.relative(every)) ** 2).sum(axis=(1, 2)) for x in loaded)
    part = np.cumsum(power) / max(float(np.sum(power)), 1e-300)
    shortest = omegas[min(int(np.searchsorted(part, 1.0 - POWER)), omegas.size - 1)]
    return float(2.0 * np.pi / shortest / TO_A_PERIOD)


def _at_times(turned: Floats, amplitudes: Floats) -> Floats:
    """(..., M) of amplitudes (F, ...)."""
    flat = amplitudes.reshape(len(amplitudes), -1)
    both = np.ascontiguousarray(np.vstack([flat.real, flat.imag]).T)
    size = max(math.isqrt(SHARED // both.shape[1]), 1)
    out = np.empty((len(both), len(turned)))
    for rows, columns in product(range(0, len(both), size), range(0, len(turned), size)):
        here = slice(rows, rows + size), slice(columns, columns + size)
        np.matmul(both[here[0]], turned[here[1]].T, out=out[here])
    return out.reshape(*amplitudes.shape[1:], len(turned))


def _loads(x: LoadedLine, turned: Floats) -> Floats:
    """(5 (N+1), M): what is left out at each time, less its mean."""
    n, count = x.line.s.size, len(turned)
    u = _at_times(turned, x.relative(np.arange(x.omegas.size)))  # (N+1, 3, M)
    used = np.flatnonzero((x.cn > 0.0) | (x.ct > 0.0))
    drag = _of_cylinders(x.d[used], (x.cn[used], x.ct[used]), u[x.node[used]] + x.current[used][:, :, None])
    gathered = sparse.csr_array((np.ones(used.size), (x.node[used], np.arange(used.size))), shape=(n, used.size))
    force = (gathered @ drag.reshape(used.size, 3 * count)).reshape(n, 3, count)
    at = np.flatnonzero(x.point_drag)
    speed = u[at] + current_at(x.line, x.sea, x.linear.r[at])[:, :, None]
    force[at] += x.point_drag[at][:, None, None] * np.sqrt((speed**2).sum(axis=1))[:, None] * speed
    out = np.zeros((n, SIZE, count))
    out[:, 1:4] = force - x.blocks @ u
    l = np.linalg.norm(x.linear.state.e, axis=1)
    direction = (x.linear.state.e / l[:, None])[:, :, None]
    de = np.diff(_at_times(turned, x.q[:, :, 1:4]), axis=0)
    square = (de**2).sum(axis=1) - (de * direction).sum(axis=1) ** 2
    out[1:, 0] = -square / (2.0 * l)[:, None]
    out -= out.mean(axis=2)[:, :, None]
    return np.asarray(out.reshape(n * SIZE, count))


def _loads_of_members(x: LoadedMembers, turned: Floats) -> Floats:
    """(6, M) N, N m on the body: what is left out of the drag of its members at each time, less its mean."""
    u = _at_times(turned, x.relative(np.arange(x.omegas.size)))  # (n, 3, M)
    rest = _of_cylinders(x.d, (x.cn, x.ct), u + x.current[:, :, None]) - x.blocks @ u
    out = np.einsum("nia,nim->am", x.T, rest)
    return np.asarray(out - out.mean(axis=1)[:, None])


def _of_cylinders(d: Floats, drag: tuple[Floats, Floats], speed: Floats) -> Floats:
    """Quadratic drag (H, 3, M) N of cylinders along d (H, 3) in water at a speed (H, 3, M) m/s, which it overwrites.

    drag: across and along, (H,) N s^2/m^2.
    """
    d = d[:, :, None]
    along = (speed * d).sum(axis=1)[:, None]
    speed -= d * along
    speed *= drag[0][:, None, None] * np.sqrt((speed**2).sum(axis=1))[:, None]
    speed += d * (drag[1][:, None, None] * np.abs(along) * along)
    return speed


def _changes(x: LoadedLine, whole: Any, part: float) -> LineResponse:
    """By the amplitudes (5 (N+1), K) of what is added, in parts whose windows have mean squares of this sum."""
    n, count = x.line.s.size, whole.shape[1]
    moved = np.moveaxis(whole.reshape(n, SIZE, count), 2, 0)
    added, linear = x.response_to(moved, np.zeros((count, 2, 3)), np.zeros(count)), x.result()
    own, more = linear.covariance, added.covariance
    # of the size of curvature, by where the bend points: fast bends across hide nothing of the plane of the bend
    points = own.copy()
    points[:, 0, 0] += linear.mean_curvature**2
    pairs = {
        "tension": [(np.abs(of.tension) ** 2).sum(axis=0) for of in (added, linear)],
        "curvature": [(points * of).sum(axis=(1, 2)) for of in (more, own)],
        "in plane": [of[:, 0, 0] for of in (more, own)],
    }
    out = {k: np.sqrt(1.0 + 4.0 / part * m / np.maximum(alone, 1e-300)) - 1.0 for k, (m, alone) in pairs.items()}
    in_plane = out.pop("in plane")
    return replace(linear, left_out=out, shape=_shape(x, linear, in_plane))


def _shape(x: LoadedLine, linear: LineResponse, part: Floats) -> Floats:
    """(N+1,): by which the deviation of the size of curvature changes as that in the plane of the bend is not normal.

    part: (N+1,) that what is left out adds to the deviation in that plane.

    A string bends against the load: by drag of the water that comes from inside the bend less.
    """
    if x.phases is not None or not (x.cn.any() and linear.mean_curvature.any()):
        return np.zeros(part.size)
    inwards = x.bend[2][:, 0]
    u = np.einsum("fni,ni->fn", x.relative(np.arange(x.omegas.size)), inwards)
    flow = -np.einsum("ni,ni->n", current_at(x.line, x.sea, x.linear.r), inwards)
    deviation = np.stack([np.sqrt(linear.spectrum(name).moment(0)) for name in ("curvature", "curvature_across")])
    spread = np.sqrt(0.5 * (np.abs(u) ** 2).sum(axis=0))
    return shape_of_drag(linear.mean_curvature, deviation, part, flow / np.maximum(spread, 1e-300))
