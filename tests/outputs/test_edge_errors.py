"""What cells miss of curvature beside an edge of contact: against closed forms, and of a motion against a finer run."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.optimize import root

import hybrid
from hybrid.outputs.edge_errors import PARTS, Windows, curvature, refined

T, Q, K = 1.4e4, 180.0, 5e3  # N, N/m, N/m2
SEA = SimpleNamespace(stiffness=K, damping=0.0, onset=1e-9)
X = (np.arange(200) + 0.5) / 200  # of a cell


class Exact:
    """A rod that lies on an elastic bed before s = 0 and hangs behind it: EI w'''' - T w'' + K w (w < 0) + Q = 0."""

    def __init__(self, EI: float) -> None:
        self.b = np.sqrt(T / EI)
        self.m = np.sqrt(np.roots([EI, -T, K]).astype(complex))  # w = -Q/K + sum c exp(m s) on the bed
        # behind it w = A s + Q s^2/2T + B (exp(-b s) - 1); w, w', w'', w''' go on
        rows = [
            [1.0, 1.0, 0.0, 0.0],
            [*self.m, -1.0, self.b],
            [*self.m**2, 0.0, -(self.b**2)],
            [*self.m**3, 0.0, self.b**3],
        ]
        self.c = np.linalg.solve(np.array(rows), [Q / K, 0.0, Q / T, 0.0])

    def w(self, s: np.ndarray) -> np.ndarray:
        bed = (self.c[:2] * np.exp(np.minimum(s, 0.0)[:, None] * self.m)).sum(axis=1) - Q / K
        _, _, A, B = self.c
        return np.where(s < 0.0, bed, A * s + 0.5 * Q / T * s * s + B * np.expm1(-self.b * np.maximum(s, 0.0))).real

    def k(self, s: np.ndarray) -> np.ndarray:
        bed = (self.c[:2] * self.m**2 * np.exp(np.minimum(s, 0.0)[:, None] * self.m)).sum(axis=1)
        return np.where(s < 0.0, bed, Q / T + self.c[3] * self.b**2 * np.exp(-self.b * np.maximum(s, 0.0))).real


def on_cells(exact: Exact, s: np.ndarray, EI: float) -> np.ndarray:
    """Heights of nodes that balance, the bed integrated along chords; the two at either end are those of the rod."""
    h = np.diff(s)
    large = EI / h[0] ** 3 + T / h[0] + K * h[0]

    def lacks(w: np.ndarray) -> np.ndarray:
        k = np.zeros(s.size)
        k[1:-1] = np.diff(np.diff(w) / h) / (0.5 * (h[1:] + h[:-1]))
        press = K * np.maximum(-(w[:-1, None] + np.diff(w)[:, None] * X), 0.0) * h[:, None]
        load = 0.5 * Q * (h[1:] + h[:-1]) - (press * X).mean(axis=1)[:-1] - (press * (1.0 - X)).mean(axis=1)[1:]
        out = w - exact.w(s)
        out[2:-2] = (np.diff(T * np.diff(w) / h - EI * np.diff(k) / h) - load)[1:-1] / large
        return out

    found = root(lacks, exact.w(s), tol=1e-13)
    assert np.abs(lacks(found.x)).max() < 1e-11
    return found.x


@pytest.mark.parametrize("EI", [2e3, 5e4])
@pytest.mark.parametrize("h", [0.8, 2.5])
def test_an_edge_of_contact_against_a_closed_form(h: float, EI: float) -> None:
    """Wherever it lies in its cell, on cells of half and more than sqrt(T/K) = 1.7 m: the largest error within 10 to 20 %."""
    exact, ratios = Exact(EI), []
    assert abs(exact.w(np.zeros(1))[0]) < 1e-12
    for phase in (0.0, 0.2, 0.4, 0.6, 0.8):
        s = h * (np.arange(-9, 10) + phase)
        w = on_cells(exact, s, EI)[1:-1]
        x = Windows(*(np.asarray(y)[None] for y in (s[1:-1], w, 0.0 * w, np.full(w.size - 1, T), np.full(w.size, EI))))
        k = curvature(x)
        at, fine, settled = refined(x, k, SEA)
        assert settled.all()
        inner = slice(2 * PARTS, -2 * PARTS)
        shown = np.interp(at[0], x.s[0], k[0])
        true = np.abs(shown - exact.k(at[0]))[inner].max()
        ratios.append(np.abs(shown - fine[0])[inner].max() / true)
    assert min(ratios) > 0.9 and max(ratios) < 1.2


@pytest.mark.parametrize("dimension", [2, 3])
def test_a_moving_edge_against_a_finer_run(dimension: int) -> None:
    """At every output of a line that heaves: curvature near the edge, where the figure once said a sixth of what it was."""
    text = hybrid.load_scene("examples/touchdown.yaml").model_dump(exclude_none=True)
    text["model"], text["dimension"] = {"kind": "rod"}, dimension
    if dimension == 3:
        text["environment"]["fluid"]["current"] = [0.0, 0.5, 0.0]
    text["time"]["duration"] = 24.0
    text["output"] = {"every": 1.0, "points": 1001}
    found = hybrid.run(hybrid.validate_scene(text | {"output": text["output"] | {"errors": True}}))
    text["mesh"], text["time"]["step"] = {"cells": 400}, 0.05
    fine = hybrid.run(hybrid.validate_scene(text))
    ratio, stated = [], []
    for j in range(1, found.times.size):
        near = np.abs(found.s - found["touchdown"][j, 1]) < 4.0
        true = np.abs(found.curvature[j] - fine.curvature[j])[near].max()
        ratio.append(true / found["errors/edges/curvature"][j, near].max())
        stated.append(true / found["errors/total/curvature"][j, near].max())
        moment = found["errors/edges/bending_moment"][j, near].max()
        assert moment == pytest.approx(2e3 * found["errors/edges/curvature"][j, near].max(), rel=1e-9)
    assert 0.85 < np.median(ratio) < 1.1
    assert min(ratio) > 0.6 and max(ratio) < 1.3
    assert max(stated) < 1.3


def test_nothing_is_missed_where_nothing_touches_down() -> None:
    """A line that hangs above its bed."""
    text = hybrid.load_scene("examples/touchdown.yaml").model_dump(exclude_none=True)
    text |= {"model": {"kind": "rod"}, "output": {"every": 1.0, "points": 51, "errors": True}}
    text["time"]["duration"] = 4.0
    text["environment"]["seabed"]["z"] = -200.0
    above = hybrid.run(hybrid.validate_scene(text))
    assert above["errors/edges/curvature"].max() == 0.0 < above["errors/mesh/curvature"].max()


def test_a_bend_that_a_cell_is_too_long_for_is_said() -> None:
    """Laying into slack, in compression on the bed: cells of 8 m show a third of the bend that cells of 1 m do."""
    text = hybrid.load_scene("examples/laying.yaml").model_dump(exclude_none=True)
    text["time"]["duration"] = 4.0
    found = hybrid.run(hybrid.validate_scene(text | {"output": text["output"] | {"errors": True}}))
    fine = hybrid.run(hybrid.validate_scene(text | {"model": {"kind": "rod"}, "mesh": {"cells": 800}}))
    off = fine.curvature.max() - found.curvature.max()
    assert off > 1.5 * found.curvature.max()
    assert 0.7 < found["errors/edges/curvature"].max() / off < 1.3
