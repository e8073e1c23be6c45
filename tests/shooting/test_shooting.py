"""The arbiter: its derivatives, the published suspension, a rod in space with torsion, and what it refuses.

In every run test_against_arbiter.py holds it, at rest and in motion, against the package, which tests/validation holds to
closed forms.  Tolerances are of three kinds (house.md): round-off, discretisation (an order and a bound), published.
"""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from arbiter import ArbiterError, Outcome, ShootingRun, ShootingState, simulate, static
from arbiter import fields as fields_
from arbiter.conditions import Before
from arbiter.guess import straight
from arbiter.line import Line, line_of
from arbiter.newton import Problem
from arbiter.rotations import exp, log
from scipy.integrate import solve_ivp
from scipy.special import j0

from hybrid.errors import SceneError
from hybrid.scene.root import Scene

DATA = json.loads((Path(__file__).parents[1] / "data" / "suspension.json").read_text())


def scene(
    section: dict[str, Any] | list[dict[str, Any]],
    start: dict[str, Any],
    end: dict[str, Any],
    model: str | list[dict[str, Any]] = "rod",
    cells: int | None = 40,
    gravity: float = 0.0,
    **more: Any,
) -> Scene:
    tables: dict[str, Any] = {
        "environment": {"gravity": gravity, **({"fluid": more.pop("fluid")} if "fluid" in more else {})},
        "cable": {"sections": section if isinstance(section, list) else [section]},
        "ends": {"start": start, "end": end},
        "initial": more.pop("initial", {"kind": "equilibrium"}),
        "model": {"kind": model} if isinstance(model, str) else {"kind": "zones", "zones": model},
        **more,
    }
    if cells is not None:
        tables["mesh"] = {"cells": cells}
    return Scene.model_validate(tables)


def pinned(*position: float) -> dict[str, Any]:
    return {"kind": "pinned", "position": position}


def clamped(position: Any, tangent: Any, normal: Any = None, **more: Any) -> dict[str, Any]:
    return {"kind": "clamped", "position": position, "tangent": tangent, "normal": normal, **more}


def guided(tangent: Any, force: Any) -> dict[str, Any]:
    return {"kind": "guided", "tangent": tangent, "force": force}


def free(**loads: Any) -> dict[str, Any]:
    return {"kind": "free", **loads}


def history(what: Scene) -> list[ShootingState]:
    states: list[ShootingState] = []
    simulate(what, states.append)
    return states


def order(coarse: float, fine: float) -> float:
    return math.log2(coarse / fine)


# --- derivatives -----------------------------------------------------------------------------------

SECTION = {
    "length": 1.5,
    "mass": 1.3,
    "diameter": 0.2,
    "axial_stiffness": 40.0,
    "bending_stiffness": (2.0, 3.0),
    "torsional_stiffness": 1.5,
    "rotary_inertia": (0.2, 0.5),
    "intrinsic_curvature": (0.3, -0.2, 0.4),
    "drag": {"normal": 1.2, "tangential": 0.4},
    "added_mass": {"normal": 1.0, "tangential": 0.3},
    "damping": 0.7,
}
STIFFER = {**SECTION, "length": 0.9, "bending_stiffness": (3.0, 2.5), "intrinsic_curvature": None, "mass": 1.1}
WATER = {"density": 3.0, "current": (0.4, -0.3, 0.2)}
LOAD = {"force": (0.5, 0.2, -0.4), "moment": (0.1, -0.3, 0.2)}
HELD = clamped((0, 0, 0), (1, 0.3, 0.2), (0, 0.2, 1))
THREE_ZONES = [{"rod": 0.8}, {"catenary": 0.8}, {"rod": 0.8}]
LINES = {
    "rods, three zones": (HELD, free(**LOAD), THREE_ZONES),
    "catenaries outside": (pinned(0, 0, 0), free(), [{"catenary": 0.7}, {"rod": 0.9}, {"catenary": 0.8}]),
    "free start": (free(), HELD, [{"catenary": 1.2}, {"rod": 1.2}]),
    "loaded start": (free(**LOAD), pinned(1, 1, 0), [{"rod": 1.2}, {"catenary": 1.2}]),
}


def random_fields(line: Line, rng: np.random.Generator) -> list[fields_.Fields]:
    out: list[fields_.Fields] = []
    for y in straight(line):
        n = len(y.x)
        noise = lambda *shape, n=n: 0.4 * rng.standard_normal((n, *shape))  # noqa: E731
        if isinstance(y, fields_.RodFields):
            out.append(fields_.RodFields(noise(3), noise(3), y.R @ exp(noise(3)), noise(3), noise(3), noise(3)))
        else:
            t = y.t + 0.5 * noise(3)
            t /= np.linalg.norm(t, axis=1)[:, None]
            out.append(fields_.CatenaryFields.of(noise(3), noise(3), 2.0 + noise(), t))
    return out


def random_problem(line: Line, y: list[fields_.Fields], rng: np.random.Generator) -> Problem:
    clocks = []
    for fields in y:
        shape = (len(fields.x), 3)
        some = [0.3 * rng.standard_normal(shape) for _ in range(6)]
        R = fields.R if isinstance(fields, fields_.RodFields) else np.zeros((*shape, 3))
        clocks.append(fields_.Clock(7.0, *some[:5], some[4][:, 0], some[5], R))
    before = tuple(
        Before(0.3, 0.05, f.x[i], f.R[i] if isinstance(f, fields_.RodFields) else None)
        for f, i in ((y[0], 0), (y[-1], -1))
    )
    return Problem(line, 0.35, clocks, (before[0], before[1]))


@pytest.mark.parametrize("moving", [False, True], ids=["statics", "dynamics"])
@pytest.mark.parametrize("name", LINES)
def test_hand_written_derivatives(name: str, moving: bool) -> None:
    """Newton's matrix along some directions of all unknowns against differences of order six; 1e-10: round-off over the step 1e-3."""
    rng = np.random.default_rng(7)
    start, end, zones = LINES[name]
    cells = 2 * len(zones)
    line = line_of(
        scene([SECTION, STIFFER], start, end, zones, cells, 9.0, fluid=WATER, initial={"kind": "equilibrium"})
    )
    y = random_fields(line, rng)
    problem = random_problem(line, y, rng) if moving else Problem(line)
    if moving:  # frames and positions follow from spins and velocities
        y = [
            fields_.moved(f, np.zeros((len(f.x), p.unknowns)), problem.clock(i))
            for i, (f, p) in enumerate(zip(y, line.pieces, strict=True))
        ]
    linear = problem.linear(y, problem.scales(y))

    def residuals(d: list[np.ndarray[Any, Any]], step: float) -> np.ndarray[Any, Any]:
        moved = [fields_.moved(f, step * x, problem.clock(i)) for i, (f, x) in enumerate(zip(y, d, strict=True))]
        there = problem.linear(moved, linear.scales)
        parts = [there.start[0], *(c[0].ravel() for c in there.cells), *(m[0] for m in there.meetings), there.end[0]]
        return np.concatenate(parts)

    def written(d: list[np.ndarray[Any, Any]]) -> np.ndarray[Any, Any]:
        parts = [linear.start[1] @ d[0][0]]
        for k, (_, left, right) in enumerate(linear.cells):
            parts += [left[n] @ d[k][n] + right[n] @ d[k][n + 1] for n in range(len(left))]
        for k, (_, left, right) in enumerate(linear.meetings):
            parts.append(left @ d[k][-1] + right @ d[k + 1][0])
        return np.concatenate([*parts, linear.end[1] @ d[-1][-1]])

    h = 1.0e-3
    for _ in range(6):
        d = [0.3 * rng.standard_normal((len(f.x), p.unknowns)) for f, p in zip(y, line.pieces, strict=True)]
        f = {k: residuals(d, k * h) for k in (-3, -2, -1, 1, 2, 3)}
        slope = (45 * (f[1] - f[-1]) - 9 * (f[2] - f[-2]) + (f[3] - f[-3])) / (60 * h)
        exact = written(d)
        assert np.abs(slope - exact).max() < 1.0e-10 * (1.0 + np.abs(exact).max())


# --- statics: published and exact ------------------------------------------------------------------

CABLE = {
    "length": 2.0,
    "diameter": 1.0e-3,
    "mass": math.pi / 4.0e3,
    "bending_stiffness": 5.0 * math.pi / 64.0e3,
    "torsional_stiffness": math.pi / 16.0e3,
}
HYBRID = [{"catenary": 1.5}, {"rod": 0.5}]
TILT = (math.sqrt(3) / 2, 0.0, -0.5)


def suspension(model: str | list[dict[str, Any]], cells: int, **more: Any) -> Scene:
    """Goyal & Perkins, Table 1, from the straight horizontal line they start from."""
    end = guided(TILT, (0.005, 0.0, 0.01 * math.sqrt(3) / 2))
    initial = {"kind": "straight", "direction": (1, 0, 0)}
    section = {**CABLE, **more.pop("section", {})}
    return scene(section, pinned(0, 0, 0), end, model, cells, 9.8, fluid={"density": 1.0}, initial=initial, **more)


@pytest.mark.parametrize(
    ("model", "reference", "moment", "bound"),
    [
        ("rod", "rod", "rod_end_bending_moment", 1.4e-2),
        (HYBRID, "hybrid_joint_at_1.5", "hybrid_end_bending_moment", 1.4e-2),
    ],
    ids=["rod", "hybrid"],
)
def test_suspension(model: str | list[dict[str, Any]], reference: str, moment: str, bound: float) -> None:
    """Against solve_bvp at 1e-10: second order, 1.3e-2 m at 80 cells (kappa h is 0.2 at the sharp end)."""
    rows = np.array(DATA[reference])
    errors, moments = [], []
    for cells in (80, 160):
        state = static(suspension(model, cells))
        nodes = [int(np.argmin(np.abs(state.s - s))) for s in rows[:, 0]]
        assert np.abs(state.s[nodes] - rows[:, 0]).max() < 1e-12
        errors.append(np.hypot(*(state.r[nodes][:, [0, 2]] - rows[:, 1:3]).T).max())
        moments.append(abs(-state.moment[-1, 1] - DATA[moment]))
        assert state.residual < 1e-12
    assert 1.9 < order(*errors) < 2.1
    assert 1.9 < order(*moments) < 2.1
    assert errors[0] < bound
    assert moments[0] < 5e-3 * abs(DATA[moment])
    extrapolated = (4.0 * state.r[-1] - static(suspension(model, 80)).r[-1]) / 3.0
    # what is left of fourth order: (1/16) of the fourth-order share of 3e-3 m
    assert np.abs(extrapolated[[0, 2]] - rows[-1, 1:3]).max() < 1e-4


TWISTED = {
    "length": 1.0,
    "mass": 0.3,
    "axial_stiffness": 60.0,
    "bending_stiffness": (1.0, 1.4),
    "torsional_stiffness": 0.8,
    "intrinsic_curvature": (0.4, -0.3, 0.5),
}


def test_three_dimensional_rod_with_torsion() -> None:
    """Kirchhoff's equations integrated from one end at 1e-11 give both clamps; shooting must find them again."""
    B, k0, weight = np.array([1.0, 1.4, 0.8]), np.array([0.4, -0.3, 0.5]), np.array([0.0, 0.0, -0.3 * 9.81])
    e3 = np.array([0.0, 0.0, 1.0])

    def slope(_: float, y: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
        R, f, k = y[3:12].reshape(3, 3), y[12:15], y[15:]
        stretch, q = 1.0 + f[2] / 60.0, B * (k - k0)
        df = -np.cross(k, f) - R.T @ weight
        dq = stretch * np.cross(f, e3) - np.cross(k, q)
        return np.concatenate([stretch * R[:, 2], (R @ _hat(k)).ravel(), df, dq / B])

    R0 = exp(np.array([0.3, 1.2, -0.2]))
    y0 = np.concatenate([[0.1, -0.2, 0.3], R0.ravel(), [0.6, -0.8, 0.9], [0.9, 0.7, 1.1]])
    exact = solve_ivp(slope, (0.0, 1.0), y0, rtol=1e-11, atol=1e-12, dense_output=True)
    last = exact.y[:, -1]
    R1 = last[3:12].reshape(3, 3)
    errors: dict[str, list[float]] = {"place": [], "moment": [], "frame": []}
    for cells in (40, 80):
        start, end = clamped(y0[:3], R0[:, 2], R0[:, 0]), clamped(last[:3], R1[:, 2], R1[:, 0])
        state = static(scene(TWISTED, start, end, "rod", cells, 9.81))
        y = exact.sol(state.s)
        frames = y[3:12].T.reshape(-1, 3, 3)
        moment = np.einsum("nij,nj->ni", frames, B * (y[15:].T - k0))
        errors["place"].append(np.abs(state.r - y[:3].T).max())
        errors["moment"].append(np.abs(state.moment - moment).max())
        errors["frame"].append(np.abs(log(np.swapaxes(frames, 1, 2) @ state.frame)).max())
    for name, (coarse, fine) in errors.items():
        assert 1.9 < order(coarse, fine) < 2.1, name
        assert fine < 1e-3, name


def _hat(k: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
    return np.array([[0.0, -k[2], k[1]], [k[2], 0.0, -k[0]], [-k[1], k[0], 0.0]])


# --- where it dies ---------------------------------------------------------------------------------


def taut(ratio: float, cells: int = 400) -> Scene:
    """A rod under tension 1 N whose end slopes differ by 1e-3, L/lambda = ratio."""
    section = {"length": 1.0, "mass": 1.0, "bending_stiffness": ratio**-2.0}
    return scene(section, clamped((0, 0, 0), (1, 0, 1e-3)), guided((1, 0, 0), (1, 0, 0)), "rod", cells)


def test_short_enough() -> None:
    """L/lambda = 20: the linear beam z = slope lambda tanh-like layer; discretisation, (h/lambda)^2/12 = 2e-4."""
    state = static(taut(20.0))
    x = 20.0 * state.s
    slope = 1e-3 * np.sinh(20.0 - x) / math.sinh(20.0)
    assert np.abs(state.tangent[:, 2] - slope).max() < 2e-7
    assert state.growth > 1e8
    assert state.residual < 1e-12


@pytest.mark.parametrize("ratio", [60.0, 200.0, 1000.0])
def test_too_long_is_said(ratio: float) -> None:
    with pytest.raises(ArbiterError) as caught:
        static(taut(ratio))
    assert caught.value.outcome is Outcome.ILL_CONDITIONED
    assert "literal shooting" in str(caught.value)


def test_nothing_holds_it() -> None:
    """A rod adrift has no equilibrium: refused, not answered."""
    section = {"length": 1.0, "mass": 1.0, "bending_stiffness": 1.0}
    initial = {"kind": "straight", "direction": (1, 0, 0), "origin": (0, 0, 0)}
    with pytest.raises(ArbiterError) as caught:
        static(scene(section, free(), free(), "rod", 20, initial=initial))
    assert caught.value.outcome is Outcome.ILL_CONDITIONED


def test_slack_catenary_is_said() -> None:
    """A chain folded between two ends at one point: no tension at the fold, no answer."""
    with pytest.raises(ArbiterError):
        static(scene({"length": 4.0, "mass": 1.0}, pinned(0, 0, 0), pinned(0, 0, 0), "catenary", 40, 9.81))


def test_refusals() -> None:
    section = {"length": 1.0, "mass": 1.0, "bending_stiffness": 1.0, "damping": {"stiffness": 0.1}}
    with pytest.raises(SceneError, match=r"damping\.stiffness"):
        static(scene(section, clamped((0, 0, 0), (1, 0, 0)), free()))
    plain = scene({**section, "damping": None}, clamped((0, 0, 0), (1, 0, 0)), free())
    with pytest.raises(SceneError, match="time"):
        ShootingRun(plain)


# --- dynamics --------------------------------------------------------------------------------------


def polyline(x: np.ndarray[Any, Any], z: np.ndarray[Any, Any]) -> tuple[dict[str, Any], float]:
    points = [(float(a), 0.0, float(b)) for a, b in zip(x, z, strict=True)]
    return {"kind": "points", "points": points}, float(np.hypot(np.diff(x), np.diff(z)).sum())


def swinging_chain(cells: int, steps: int, periods: float = 2.0) -> tuple[Scene, float]:
    """Hanging chain let go in its first mode, `steps` a period; angular frequency 1.20241 sqrt(g/L)."""
    s = np.linspace(0.0, 1.0, 201)
    initial, length = polyline(1e-3 * j0(2.40482556 * np.sqrt(1.0 - s)), -s)
    w = 2.40482556 / 2.0 * math.sqrt(9.81 / length)
    time = {"duration": periods * 2 * math.pi / w, "step": 2 * math.pi / w / steps}
    section = {"length": length, "mass": 1.0}
    return scene(section, pinned(0, 0, 0), free(), "catenary", cells, 9.81, initial=initial, time=time), w


def test_chain_with_too_small_steps_is_said() -> None:
    """100 steps a period of the chain: waves cross it in 40 steps, exp(75) is too much growth to shoot through."""
    with pytest.raises(ArbiterError) as caught:
        history(swinging_chain(40, 100)[0])
    assert caught.value.outcome is Outcome.ILL_CONDITIONED
    assert caught.value.t is not None
