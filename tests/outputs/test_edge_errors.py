"""What cells miss of curvature beside edges of contact and ends on the bed: against closed forms and finer runs."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.optimize import root

import hybrid
from hybrid.outputs.probes import PARTS, LineEnd, Windows, between, curvature, cuts_of, refined
from tests.scenes import cable_scene, pinned_at

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


class AtEnd:
    """A rod on the bed from an end at the height where contact begins on: pinned, or clamped with slope `up`."""

    def __init__(self, EI: float, up: float | None) -> None:
        m = -np.sqrt(np.roots([EI, -T, K]).astype(complex))  # w = -Q/K + sum c exp(m s)
        given = (m**2, 0.0) if up is None else (m, up)
        self.m, self.c = m, np.linalg.solve(np.array([[1.0, 1.0], given[0]]), [Q / K, given[1]])

    def of_order(self, n: int, s: np.ndarray) -> np.ndarray:
        return (self.c * self.m**n * np.exp(s[:, None] * self.m)).sum(axis=1).real


@pytest.mark.parametrize("up", [None, 0.0, -0.01], ids=["pinned", "level clamp", "sloping clamp"])
@pytest.mark.parametrize("EI", [2e3, 5e4])
@pytest.mark.parametrize("h", [0.8, 2.5, 9.6])
def test_an_end_on_the_bed_against_a_closed_form(h: float, EI: float, up: float | None) -> None:
    """On cells of half and up to six times sqrt(T/K), but for those beside where the line is kept: to 8 % of the largest error."""
    exact, s = AtEnd(EI, up), h * np.arange(14.0)
    load = np.full(s.size, Q * h)
    # heights of nodes that balance, the bed integrated along chords; the last one lies as the rod does far from its end
    below = np.eye(s.size, k=-1) + np.eye(s.size, k=1)
    bend = (below - 2.0 * np.eye(s.size)) / h**2  # w''
    bend[0] = 0.0
    held = np.zeros(s.size)
    if up is not None:
        bend[0, :2], held[0] = np.array([-1.0, 1.0]) / h / (0.5 * h), -up / (0.5 * h)
    bend[-1] = 0.0
    apart = (below - 2.0 * np.eye(s.size)) / h
    matrix = T * apart - EI * apart @ bend - K * h * (below + 4.0 * np.eye(s.size)) / 6.0
    right = load + EI * apart @ held
    matrix[0], matrix[-1] = np.eye(s.size)[0], np.eye(s.size)[-1]
    right[0], right[-1] = 0.0, -Q / K
    w = np.linalg.solve(matrix, right)[None]
    x = Windows(s[None], w, 0.0 * w, np.full((1, s.size - 1), T), np.full(w.shape, EI))
    k = curvature(x)
    k[:, 0] = (bend @ w[0] + held)[0]
    end = LineEnd(k[:, 0].copy(), np.array([np.inf if up is None else 0.5 * h]), np.zeros(1))
    at, fine, settled = refined(x, k, SEA, end)
    assert settled.all()
    shown, true = between(k, cuts_of(s.size - 1, True))[0], exact.of_order(2, at[0])
    off, said = (np.abs(shown - y)[: -2 * PARTS] for y in (true, fine[0]))
    assert np.abs(said - off).max() < 0.08 * off.max()


MODELS = {
    "rod": {"kind": "rod"},
    "catenary at the anchor": {"kind": "zones", "zones": [{"catenary": 75}, {"rod": 50}, {"catenary": 125}]},
}


@pytest.mark.parametrize("anchor", [-99.98, -100.0, -100.02], ids=["above", "on it", "in it"])
@pytest.mark.parametrize("model", MODELS)
def test_an_anchor_on_the_bed_against_a_finer_rest(model: str, anchor: float) -> None:
    """Pinned where contact begins or 2 cm beside: cells of 2.5 m show no layer of sqrt(T/K) = 1.7 m beside it."""
    text = hybrid.load_scene("examples/touchdown.yaml").model_dump(exclude_none=True)
    text["ends"]["start"]["position"] = [0.0, 0.0, anchor]
    text |= {"model": MODELS[model], "output": {"points": 1001, "errors": True}}
    found = hybrid.static(hybrid.validate_scene(text))
    text |= {"model": {"kind": "rod"}, "mesh": {"nodes": [*np.linspace(0, 20, 401)[:-1], *np.linspace(20, 250, 401)]}}
    fine = hybrid.static(hybrid.validate_scene(text))
    near = found.s < 10.0
    off = np.abs(np.interp(found.s, fine.s, fine.curvature[0]) - found.curvature[0])[near]
    said = found["errors/total/curvature"][0, near]
    assert off.max() > 8e-4
    assert 0.95 < off.max() / said.max() < 1.05
    assert (off < 1.1 * said + 0.01 * off.max()).all()


def test_cells_that_do_not_show_the_anchor_say_so() -> None:
    """An accuracy of tension leaves cells of 9.6 m there: the figure of curvature was a quarter of what it is off."""
    text = hybrid.load_scene("examples/touchdown.yaml").model_dump(exclude_none=True)
    del text["model"], text["mesh"]
    found = hybrid.static(hybrid.validate_scene(text | {"accuracy": {"tension": "1%"}}))
    text |= {"model": {"kind": "rod"}, "mesh": {"cells": 2000}}
    fine = hybrid.static(hybrid.validate_scene(text))
    off = np.abs(found.curvature - fine.curvature)[0]
    first = int(np.argmin(np.abs(found.s - 2.5)))
    assert off[first] > 2e-3
    assert 0.95 < off[first] / found["errors/total/curvature"][0, first] < 1.05


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
    nodes = [*np.linspace(0, 15, 121)[:-1], *np.linspace(15, 250, 377)]
    text["mesh"], text["time"]["step"] = {"nodes": nodes}, 0.05
    fine = hybrid.run(hybrid.validate_scene(text))
    ratio, stated = [], []
    for j in range(1, found.times.size):
        near = np.abs(found.s - found["touchdown"][j, 1]) < 4.0
        true = np.abs(found.curvature[j] - fine.curvature[j])[near].max()
        ratio.append(true / found["errors/edges/curvature"][j, near].max())
        stated.append(true / found["errors/total/curvature"][j, near].max())
        moment = found["errors/edges/bending_moment"][j, near].max()
        assert moment == pytest.approx(2e3 * found["errors/edges/curvature"][j, near].max(), rel=1e-9)
        anchor = found.s < 6.0  # where the figure said a third
        true = np.abs(found.curvature[j] - fine.curvature[j])[anchor].max()
        assert 0.9 < true / found["errors/total/curvature"][j, anchor].max() < 1.1
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


# --- What lies on the bed: contact force per length without overshoot, and the uplift of anchors ---

W = (141.0 - 1025.0 * math.pi / 4 * 0.151**2) * 9.81  # N/m


def chain(**changes: Any) -> hybrid.Result:
    """A chain of 700 m in 100 m of water, at rest; its bed takes it up over sqrt(T/k) = 3 m."""
    data: dict[str, Any] = cable_scene(
        {"length": 700, "mass": 141, "diameter": 0.151, "axial_stiffness": 6e8}, pinned_at(0, 0, -100),
        pinned_at(655, 0, -12), fluid={"density": 1025, "surface": 0}, seabed={"z": -100, "stiffness": 5e4},
        model="catenary", mesh=100, output={"points": 101}
    )  # fmt: skip
    return hybrid.static(data | changes)


@pytest.mark.parametrize(("cells", "bound"), [(100, 0.02), (200, 0.02), (1000, 1e-3)])
def test_contact_is_the_weight_that_lies_there(cells: int, bound: float) -> None:
    result = chain(mesh={"cells": cells}, output={"points": cells + 1})
    contact, s = result["contact"][0], result.s
    assert contact.max() <= (1.0 + bound) * W and result["envelope/contact_max"].max() <= (1.0 + bound) * W
    assert contact[(s > 50.0) & (s < 500.0)] == pytest.approx(W, rel=2e-3)
    assert np.trapezoid(contact, s) == pytest.approx(float(result.contact_force[0]), rel=2e-3)


def test_an_anchor_is_lifted_by_what_the_weight_does_not_balance() -> None:
    lying = chain()
    assert lying.uplift("start")[0] == 0.0 and lying.uplift("start")[1] == 0.0
    short = {"length": 655.0, "mass": 141, "diameter": 0.151, "axial_stiffness": 6e8}
    taut = chain(cable={"sections": [short]}, ends={"start": pinned_at(0, 0, -100), "end": pinned_at(658.5, 0, -12)})
    force, angle = taut.uplift("start")
    top = taut["reaction_end"][0]
    assert force[0] == pytest.approx(top[2] - W * 655.0 + float(taut.contact_force[0]), rel=1e-6)
    assert force[0] > 1e4 and angle[0] == pytest.approx(math.degrees(math.atan2(force[0], top[0])), rel=1e-6)
