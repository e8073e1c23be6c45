"""Where Newton starts: straight lines, given points, and the catenary that hangs from the same ends."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.optimize import least_squares

from hybrid.scene.analysis import Equilibrium, Points, Straight

from .conditions import TIP
from .fields import CatenaryFields, Fields, RodFields
from .line import Line
from .rotations import Array, frame, log, transported


def guesses(line: Line) -> Iterator[list[Fields]]:
    """Starts for statics, the likeliest first; the scene's own comes before the others."""
    initial = line.scene.initial
    kind = initial.guess if isinstance(initial, Equilibrium) else ""
    if not isinstance(initial, Equilibrium):
        yield given(line)
    wants_span = kind in ("span", "auto", "catenary", "arc") and (not all(p.rod for p in line.pieces) or _both(line))
    ways = (hanging, straight) if wants_span else (straight, hanging)
    for way in ways:
        fields = way(line)
        if fields is not None:
            yield fields


def given(line: Line) -> list[Fields]:
    """The scene's initial shape, for a start of the motion: straight with its velocity, or through points."""
    initial = line.scene.initial
    if isinstance(initial, Points):
        p = np.array(initial.points)
        chord = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(p, axis=0), axis=1))])
        curve = CubicSpline(chord * line.length / chord[-1], p)
        nodes = _nodes(line)
        slope = curve(nodes, 1)
        t = slope / np.linalg.norm(slope, axis=1)[:, None]
        return _fields(line, curve(nodes), t, _pretension(line) * t)
    assert isinstance(initial, Straight)
    fields = _straight(line, np.array(initial.direction), initial.origin)
    if initial.velocity is None:
        return fields
    u = np.array(initial.velocity)
    out: list[Fields] = []
    for y in fields:
        if isinstance(y, RodFields):
            out.append(RodFields(y.x, np.einsum("nji,j->ni", y.R, u), y.R, y.f, y.k, y.w))
        else:
            out.append(CatenaryFields.of(y.x, np.tile(u, (len(y.x), 1)), y.T, y.t))
    return out


def straight(line: Line) -> list[Fields]:
    """Straight along the scene's direction, the first held tangent, the chord, the end force, or x."""
    a, b = line.start.at(0.0), line.end.at(0.0)
    initial = line.scene.initial
    if isinstance(initial, Equilibrium) and initial.direction is not None:
        d = np.array(initial.direction)
    elif line.start.tangent and a.frame is not None:
        d = a.frame[:, 2]
    elif _both(line) and a.position is not None and b.position is not None and (a.position != b.position).any():
        d = b.position - a.position
    elif line.end.tangent and b.frame is not None:
        d = b.frame[:, 2]
    elif line.end.force(0.0).any() or line.start.force(0.0).any():
        d = line.end.force(0.0) - line.start.force(0.0)
    else:
        d = np.array([1.0, 0.0, 0.0])
    return _straight(line, d, None)


def hanging(line: Line) -> list[Fields] | None:
    """The line without bending or drag under its weight; None if nothing pulls it tight."""
    s = _nodes(line)
    h = np.diff(s)
    weight = np.concatenate([np.tile(p.weight, (len(p.s), 1)) for p in line.pieces])
    compliance = np.concatenate([np.full(len(p.s), p.compliance) for p in line.pieces])
    carried = np.concatenate([np.zeros((1, 3)), np.cumsum(0.5 * h[:, None] * (weight[1:] + weight[:-1]), 0)])
    a, b = line.start.at(0.0).position, line.end.at(0.0).position

    def span(first: Array) -> Array:
        n = first - 0.5 * (carried[1:] + carried[:-1])
        T = np.linalg.norm(n, axis=1)
        stretch = 1.0 + 0.5 * (compliance[1:] + compliance[:-1]) * T
        return np.cumsum((h * stretch / np.maximum(T, 1e-300))[:, None] * n, axis=0)

    total = float(np.linalg.norm(carried[-1]))
    if line.start.place and line.end.place:
        assert a is not None and b is not None
        if total == 0.0:
            return None
        fit = least_squares(lambda u: (span(u * total)[-1] - (b - a)) / line.length, _parabola(line, b - a) / total)
        first = fit.x * total
        origin = a
    elif line.start.place:
        assert a is not None
        first, origin = line.end.force(0.0) + carried[-1], a
    elif line.end.place:
        assert b is not None
        first = -line.start.force(0.0)
        origin = b - span(first)[-1]
    else:
        return None
    n = first - carried
    T = np.linalg.norm(n, axis=1)
    if not T.max() > 0.0:
        return None
    n = np.where(T[:, None] > TIP * T.max(), n, TIP * T.max() * np.array([0.0, 0.0, -1.0]))
    t = n / np.linalg.norm(n, axis=1)[:, None]
    return _fields(line, np.concatenate([origin[None], origin + span(first)]), t, n)


def _parabola(line: Line, chord: Array) -> Array:
    """Force (3,) on the start's face of a line sagging between its ends: the parabola of the same length."""
    across, up = float(np.hypot(chord[0], chord[1])), float(chord[2])
    w = sum(float(np.linalg.norm(p.weight)) * (p.s[-1] - p.s[0]) for p in line.pieces) / line.length
    slack = line.length**2 - up**2 - across**2
    # 0.2: a taut line; 10: hung like a bag.  Outside these the formula has no meaning, inside it is good to 20 %.
    bow = 0.2 if slack <= 0.0 else min(10.0, np.sqrt(3.0 * slack / max(across, 1.0e-9 * line.length) ** 2))
    level = 0.5 * w * max(across, 1.0e-3 * line.length) / bow
    flat = chord[:2] / across if across > 0.0 else np.array([1.0, 0.0])
    return np.array([*(level * flat), 0.5 * w * (up / np.tanh(bow) - line.length)])


def _both(line: Line) -> bool:
    return line.start.place and line.end.place


def _nodes(line: Line) -> Array:
    return np.concatenate([p.s for p in line.pieces])


def _pretension(line: Line) -> float:
    """A tension to start catenaries with (N); nought for a line that is rod all over: it starts unstressed."""
    if all(p.rod for p in line.pieces):
        return 0.0
    weight = sum(float(np.linalg.norm(p.weight)) * (p.s[-1] - p.s[0]) for p in line.pieces)
    force = max(np.linalg.norm(h.force(0.0)) for h in (line.start, line.end))
    if weight == 0.0 and force == 0.0:
        # nothing pulls but the ends: the weight the line would have at a tenth of a g is a tension to begin with
        return sum(p.mass * (p.s[-1] - p.s[0]) for p in line.pieces)
    return max(weight, float(force))


def _straight(line: Line, direction: Array, origin: tuple[float, float, float] | None) -> list[Fields]:
    d = direction / np.linalg.norm(direction)
    a, b = line.start.at(0.0).position, line.end.at(0.0).position
    if origin is not None:
        first = np.array(origin)
    elif line.start.place and a is not None:
        first = a
    elif line.end.place and b is not None:
        first = b - line.length * d
    else:
        first = np.zeros(3)
    s = _nodes(line)
    t = np.tile(d, (len(s), 1))
    return _fields(line, first + s[:, None] * d, t, _pretension(line) * t)


def _fields(line: Line, x: Array, t: Array, n: Array) -> list[Fields]:
    """Fields at rest of a shape: positions, unit tangents and forces (N, 3) at all nodes, inertial."""
    a, b = line.start.at(0.0).frame, line.end.at(0.0).frame
    frames = transported(t, a if line.start.tangent and a is not None else frame(t[0]))
    if line.end.twist and b is not None:  # spread the turn still missing at the end over the line
        from_, to = frames[-1], transported(t[-1:], b)[0]
        missing = float(log(from_.T @ to)[2])
        s = _nodes(line)
        part = s / s[-1] if line.start.twist else np.ones_like(s)
        c, w = np.cos(missing * part)[:, None], np.sin(missing * part)[:, None]
        frames = np.stack([c * frames[..., 0] + w * frames[..., 1], c * frames[..., 1] - w * frames[..., 0], t], 2)
    out: list[Fields] = []
    done = 0
    for piece in line.pieces:
        here = slice(done, done + len(piece.s))
        done += len(piece.s)
        rest = np.zeros((len(piece.s), 3))
        if piece.rod:
            R = frames[here]
            bend = log(np.swapaxes(R[:-1], 1, 2) @ R[1:]) / np.diff(piece.s)[:, None]
            k = 0.5 * (np.concatenate([bend[:1], bend]) + np.concatenate([bend, bend[-1:]]))
            out.append(RodFields(x[here], rest, R, np.einsum("nji,nj->ni", R, n[here]), k, rest))
        else:
            out.append(CatenaryFields.of(x[here], rest, np.linalg.norm(n[here], axis=1), t[here]))
    return out
