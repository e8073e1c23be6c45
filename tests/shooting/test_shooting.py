"""The arbiter, held to closed forms, to published numbers and to its own symmetries.

Tolerances are of three kinds (house.md): round-off, discretisation (an order and a bound), published.
Its motions against closed forms are slow; in every run test_against_arbiter.py holds them against those of the package.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable
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
from scipy.optimize import brentq, minimize_scalar
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


def test_suspension_joint_angles() -> None:
    """The angles at the joint that the reference gives; discretisation, 160 cells."""
    state = static(suspension(HYBRID, 160))
    left = int(np.flatnonzero(np.diff(state.s) == 0.0)[0])
    assert not state.rod[left]
    assert state.rod[left + 1]
    angle = np.degrees(np.arctan2(state.tangent[:, 2], state.tangent[:, 0]))
    assert abs(angle[left]) == pytest.approx(DATA["joint_angle_catenary_side_deg"], abs=0.15)
    assert abs(angle[left + 1]) == pytest.approx(DATA["joint_angle_rod_side_deg"], abs=0.15)
    assert np.abs(state.moment[: left + 2]).max() < 1e-15
    assert np.abs(state.force[left] - state.force[left + 1]).max() < 1e-15
    assert np.abs(state.r[left] - state.r[left + 1]).max() == 0.0


@pytest.mark.parametrize("stiffness", [None, 500.0])
def test_elastic_catenary(stiffness: float | None) -> None:
    """Irvine's closed form from the computed force at the start: the far end must be met, second order."""
    w, length = 2.0 * 9.81, 10.0
    target = np.array([8.0, 0.0, -1.0])

    def miss(cells: int) -> float:
        section = {"length": length, "mass": 2.0, "axial_stiffness": stiffness}
        state = static(scene(section, pinned(0, 0, 0), pinned(*target), "catenary", cells, 9.81))
        H, V = state.force[0, 0], state.force[0, 2]
        x = H / w * (math.asinh((V + w * length) / H) - math.asinh(V / H))
        z = (math.hypot(H, V + w * length) - math.hypot(H, V)) / w
        if stiffness is not None:
            x += H * length / stiffness
            z += (V * length + w * length**2 / 2) / stiffness
        return math.hypot(x - target[0], z - target[2])

    errors = [miss(40), miss(80)]
    assert 1.9 < order(*errors) < 2.1
    assert errors[1] < 5e-4


def test_catenary_ends_pass_no_tangent() -> None:
    """On a catenary a clamp is a pin and a guide is a free end with a force; round-off."""
    section, force = {"length": 2.0, "mass": 1.0}, (3.0, 1.0, 4.0)
    plain = static(scene(section, pinned(0, 0, 0), free(force=force), "catenary", 20, 9.81))
    other = static(scene(section, clamped((0, 0, 0), (0, 0, 1)), guided((0, 1, 0), force), "catenary", 20, 9.81))
    assert np.abs(plain.r - other.r).max() < 1e-12
    assert np.abs(plain.force[0] - np.array(force) + (0, 0, 2.0 * 9.81)).max() < 1e-12


def test_rod_stretches_under_its_weight() -> None:
    """A rod hung from a clamp: elongation w L^2 / (2 EA), which the box rule integrates exactly; round-off."""
    section = {"length": 2.0, "mass": 3.0, "bending_stiffness": 1.0, "axial_stiffness": 200.0}
    state = static(scene(section, clamped((0, 0, 0), (0, 0, -1)), free(), "rod", 10, 9.81))
    assert -state.r[-1, 2] == pytest.approx(2.0 + 3.0 * 9.81 * 4.0 / 400.0, abs=1e-12)


@pytest.mark.parametrize(
    ("load", "shortening", "deflection"),
    [
        (1, 0.056433, 0.301721),
        (2, 0.160642, 0.493457),
        (3, 0.254420, 0.603253),
        (5, 0.387628, 0.713792),
        (10, 0.554996, 0.810609),
    ],
)
def test_cantilever(load: float, shortening: float, deflection: float) -> None:
    """Bisshopp & Drucker (1945); published to 1e-6, extrapolated from 20 and 40 cells to 2e-6."""
    section = {"length": 1.0, "mass": 1.0, "bending_stiffness": 1.0}
    tips = [
        static(scene(section, clamped((0, 0, 0), (1, 0, 0)), free(force=(0, 0, -load)), "rod", cells)).r[-1]
        for cells in (20, 40)
    ]
    tip = (4.0 * tips[1] - tips[0]) / 3.0
    assert 1.0 - tip[0] == pytest.approx(shortening, abs=2e-6)
    assert -tip[2] == pytest.approx(deflection, abs=2e-6)


def test_rolled_up() -> None:
    """Two full turns under M = 4 pi EI/L: constant curvature, which the box rule closes exactly; round-off."""
    section = {"length": 1.0, "mass": 1.0, "bending_stiffness": 2.0}
    state = static(scene(section, clamped((0, 0, 0), (1, 0, 0)), free(moment=(0, -8 * math.pi, 0)), "rod", 80))
    assert np.abs(state.r[-1]).max() < 1e-10
    assert np.abs(state.moment[:, 1] + 8 * math.pi).max() < 1e-9


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


# --- symmetries: round-off -------------------------------------------------------------------------

PART = {"length": 1.0, "mass": 0.6, "bending_stiffness": 0.3, "torsional_stiffness": 0.2, "axial_stiffness": 90.0}
ZONES = [{"rod": 0.6, "cells": 12, "ratio": 2.0}, {"catenary": 0.9, "cells": 18}, {"rod": 0.5, "cells": 12}]
BOTH = [{**PART}, {**PART, "mass": 0.9, "bending_stiffness": 0.2}]


def test_marching_from_either_end() -> None:
    """The scene written from the other end: rod -> catenary becomes catenary -> rod, and the answer stays."""
    there = scene(BOTH, clamped((0, 0, 0), (0.6, 0.3, 0.8)), pinned(1.5, 0.4, 0.2), ZONES, None, 9.81)
    mirrored = [{**z, "ratio": 1.0 / z.get("ratio", 1.0)} for z in ZONES[::-1]]
    back = scene(BOTH[::-1], pinned(1.5, 0.4, 0.2), clamped((0, 0, 0), (-0.6, -0.3, -0.8)), mirrored, None, 9.81)
    a, b = static(there), static(back)
    assert np.abs(a.s - (2.0 - b.s[::-1])).max() < 1e-12
    assert np.abs(a.r - b.r[::-1]).max() < 1e-10
    assert np.abs(a.force + b.force[::-1]).max() < 1e-9
    assert np.abs(a.moment + b.moment[::-1]).max() < 1e-10
    assert np.abs(a.moment).max() > 1e-2
    assert np.array_equal(a.rod, b.rod[::-1])


def test_turning_the_scene() -> None:
    """A scene turned about the vertical gives the turned answer, whatever polar axis the catenary picks."""
    c, s = math.cos(1.0), math.sin(1.0)
    turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    force = (0.5, -0.2, 0.4)
    a, b = (
        static(
            scene(
                [{**x, "diameter": 0.02, "drag": {"normal": 1.0, "tangential": 0.1}} for x in BOTH],
                clamped((0, 0, 0), Q @ (0.6, 0.3, 0.8)),
                guided(Q @ (1.0, 0.5, 0.2), tuple(Q @ force)),
                ZONES,
                None,
                9.81,
                fluid={"density": 900.0, "current": tuple(Q @ (0.3, 0.1, 0.0))},
            )
        )
        for Q in (np.eye(3), turn)
    )
    assert np.abs(a.r @ turn.T - b.r).max() < 1e-10
    assert np.abs(a.force @ turn.T - b.force).max() < 1e-10


def test_splitting_a_zone() -> None:
    """Zones of one kind side by side are one; so are two sections of one kind, passed through as two pieces."""
    whole = static(scene({**PART, "length": 2.0}, pinned(0, 0, 0), pinned(1.4, 0, 0.1), "rod", 40, 9.81))
    zones = [{"rod": 0.5, "cells": 10}, {"rod": 1.5, "cells": 30}]
    split = static(scene({**PART, "length": 2.0}, pinned(0, 0, 0), pinned(1.4, 0, 0.1), zones, None, 9.81))
    assert np.abs(whole.r - split.r).max() < 1e-12
    # a second section that differs in nothing that matters at rest
    two = [PART, {**PART, "rotary_inertia": 1e-9}]
    pieces = static(scene(two, pinned(0, 0, 0), pinned(1.4, 0, 0.1), "rod", 40, 9.81))
    assert len(pieces.s) == 42
    assert np.abs(np.delete(pieces.r, 20, 0) - whole.r).max() < 1e-10


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


def frequency(states: list[ShootingState], value: Callable[[ShootingState], float], near: float) -> float:
    """Angular frequency (1/s) of the best sine through the values, the first two steps left out."""
    t, y = np.array([x.t for x in states[2:]]), np.array([value(x) for x in states[2:]])

    def miss(w: float) -> float:
        waves = np.column_stack([np.cos(w * t), np.sin(w * t)])
        fit = np.linalg.lstsq(waves, y, rcond=None)[0]
        return float(np.sum((waves @ fit - y) ** 2) / np.sum(y**2))

    found = minimize_scalar(miss, bounds=(0.8 * near, 1.2 * near), method="bounded", options={"xatol": 1e-9 * near})
    assert found.fun < 0.02  # it is one sine: the scheme damps it by a per cent a period
    return float(found.x)


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


@pytest.mark.long
def test_hanging_chain() -> None:
    """First frequency, half the first zero of J0: second order, 3e-3 with 40 steps a period."""
    errors = []
    for cells, steps in ((10, 20), (20, 40)):
        what, w = swinging_chain(cells, steps)
        errors.append(abs(frequency(history(what), lambda x: x.r[-1, 0], w) / w - 1.0))
    assert 1.7 < order(*errors) < 2.3
    assert errors[1] < 5e-3


def test_chain_with_too_small_steps_is_said() -> None:
    """100 steps a period of the chain: waves cross it in 40 steps, exp(75) is too much growth to shoot through."""
    with pytest.raises(ArbiterError) as caught:
        history(swinging_chain(40, 100)[0])
    assert caught.value.outcome is Outcome.ILL_CONDITIONED
    assert caught.value.t is not None


@pytest.mark.slow
def test_vibrating_cantilever() -> None:
    """First bending frequency 1.8751^2 sqrt(EI/m)/L^2: second order."""
    b, s = 1.87510407, np.linspace(0.0, 1.0, 101)
    k = (math.cosh(b) + math.cos(b)) / (math.sinh(b) + math.sin(b))
    shape = 5e-3 * (np.cosh(b * s) - np.cos(b * s) - k * (np.sinh(b * s) - np.sin(b * s)))
    initial, length = polyline(s, shape)
    w = b**2 * math.sqrt(3.0 / 2.0) / length**2
    section = {"length": length, "mass": 2.0, "bending_stiffness": 3.0}
    errors = []
    for cells, steps in ((20, 25), (40, 50)):
        time = {"duration": 4 * math.pi / w, "step": 2 * math.pi / w / steps}
        what = scene(section, clamped((0, 0, 0), (1, 0, 0)), free(), "rod", cells, initial=initial, time=time)
        errors.append(abs(frequency(history(what), lambda x: x.r[-1, 2], w) / w - 1.0))
    assert 1.7 < order(*errors) < 2.3
    assert errors[1] < 3e-3


@pytest.mark.slow
def test_torsional_vibration() -> None:
    """A torsion pendulum: a wire with a heavy, stiff bob, twisted by a torque that is let go; second order.

    Exact: GJ2 k2 tan(k2 L2) = GJ1 k1 cot(k1 L1), k = w sqrt(J/GJ).  The bob makes the swing one sine.
    """
    wire = {
        "length": 1.0,
        "mass": 1.0,
        "bending_stiffness": 1.0,
        "torsional_stiffness": 2.0,
        "rotary_inertia": (0.01, 0.02),
    }
    bob = {**wire, "length": 0.2, "torsional_stiffness": 200.0, "rotary_inertia": (1.0, 2.0)}
    k = math.sqrt(0.02 / 2.0), math.sqrt(2.0 / 200.0)
    w = brentq(lambda w: 20.0 * w * math.tan(0.2 * k[1] * w) - 0.2 * w / math.tan(k[0] * w), 0.1, 10.0)
    errors = []
    for cells, steps in ((12, 20), (24, 40)):
        time = {"duration": 4 * math.pi / w, "step": 2 * math.pi / w / steps}
        torque = {"value": (0.1, 0.0, 0.0), "until": 1e-9}  # ends inside the first step
        start, end = clamped((0, 0, 0), (1, 0, 0), (0, 0, 1)), free(moment=torque)
        states = history(scene([wire, bob], start, end, "rod", cells, time=time))
        turned = lambda x: float(log(x.frame[0].T @ x.frame[-1])[2])  # noqa: E731
        assert turned(states[0]) == pytest.approx(0.05 + 0.0001, rel=1e-9)
        errors.append(abs(frequency(states, turned, w) / w - 1.0))
    assert 1.7 < order(*errors) < 2.3
    assert errors[1] < 5e-3


def test_equilibrium_stays() -> None:
    """A bent, twisted and drag-laden hybrid at rest stays where it is: statics and dynamics share their balance."""
    sections = [
        {**TWISTED, "diameter": 0.02, "drag": {"normal": 1.0, "tangential": 0.1}},
        {**PART, "diameter": 0.02, "drag": {"normal": 1.0}, "added_mass": {"normal": 1.0}, "rotary_inertia": 1e-4},
    ]
    what = scene(
        sections,
        clamped((0, 0, 0), (1, 0, 0.5), (0, 0, 1)),
        pinned(1.2, 0.5, 0.3),
        [{"rod": 0.9}, {"catenary": 0.5}, {"rod": 0.6}],
        24,
        9.81,
        fluid={"density": 500.0, "current": (0.5, 0.8, 0.0)},
        time={"duration": 1.0, "step": 0.2},
    )
    states = history(what)
    assert len(states) == 6
    for state in states[1:]:
        assert np.abs(state.r - states[0].r).max() < 1e-9
        assert np.abs(state.force - states[0].force).max() < 1e-7


@pytest.mark.slow
@pytest.mark.parametrize("model", ["rod", HYBRID], ids=["rod", "hybrid"])
def test_suspension_relaxes(model: str | list[dict[str, Any]]) -> None:
    """What Goyal & Perkins did: let the straight line sink with losses.  It must end in the equilibrium of statics."""
    lossy = {"damping": 2.0, "drag": {"normal": 1.5, "tangential": 0.05}}
    what = suspension(model, 40, section=lossy, time={"duration": 15.0, "step": 0.1})
    last, rest = history(what)[-1], static(what)
    assert np.abs(last.v).max() < 1e-5  # e^-15 of metres: mass damping 2/s halves to 1/s where it is overdamped
    assert np.abs(last.r - rest.r).max() < 1e-5
    assert np.abs(last.moment - rest.moment).max() < 1e-8


@pytest.mark.parametrize(("direction", "kind"), [((1, 0, 0), "normal"), ((0, 0, -1), "tangential")])
def test_sinking(direction: tuple[float, float, float], kind: str) -> None:
    """A free rod let go in still water: v = V tanh(t/tau), added mass included; second order in the step."""
    rho, d, mass = 1000.0, 0.05, 4.0
    section = {
        "length": 2.0,
        "mass": mass,
        "diameter": d,
        "bending_stiffness": 50.0,
        "drag": {"normal": 1.2, "tangential": 0.02},
        "added_mass": {"normal": 1.0, "tangential": 0.1},
    }
    displaced = rho * math.pi * d**2 / 4
    drag = 0.5 * rho * d * (1.2 if kind == "normal" else 0.02 * math.pi)
    weight, moved = (mass - displaced) * 9.81, mass + displaced * (1.0 if kind == "normal" else 0.1)
    final, tau = math.sqrt(weight / drag), moved / math.sqrt(weight * drag)
    errors = []
    for steps in (20, 40):
        what = scene(
            section,
            free(),
            free(),
            "rod",
            4,
            9.81,
            fluid={"density": rho},
            initial={"kind": "straight", "direction": direction, "origin": (0, 0, 0)},
            time={"duration": 2 * tau, "step": 2 * tau / steps},
        )
        states = history(what)
        errors.append(max(abs(-x.v[0, 2] / final - math.tanh(x.t / tau)) for x in states))
        assert np.ptp(states[-1].v[:, 2]) < 1e-9
    assert 1.7 < order(*errors) < 2.6
    assert errors[1] < 2e-3


@pytest.mark.slow
def test_marching_from_either_end_in_motion() -> None:
    """The swinging hybrid written from its other end: both orders of joint, the same motion."""
    inert = [{**x, "rotary_inertia": 1e-3} for x in BOTH]
    wave = {"sway": {"amplitude": 0.1, "period": 0.8}, "yaw": {"amplitude": 10.0, "period": 0.8}, "ramp": 0.8}
    hold = clamped((0, 0, 0), (0.6, 0.3, 0.8), motion=wave)
    mirrored = [{**z, "ratio": 1.0 / z.get("ratio", 1.0)} for z in ZONES[::-1]]
    back_hold = {**hold, "tangent": (-0.6, -0.3, -0.8)}
    time = {"duration": 2.0, "step": 0.1}
    there = history(scene(inert, hold, pinned(1.5, 0.4, 0.2), ZONES, None, 9.81, time=time))[-1]
    back = history(scene(inert[::-1], pinned(1.5, 0.4, 0.2), back_hold, mirrored, None, 9.81, time=time))[-1]
    assert np.abs(there.v).max() > 0.1
    assert np.abs(there.r - back.r[::-1]).max() < 1e-8
    assert np.abs(there.moment + back.moment[::-1]).max() < 1e-8


@pytest.mark.slow
def test_energy_ledger() -> None:
    """A shaken rod, in space, with torsion, stretch and rotary inertia: work of the clamp = change of energy.

    Second order; the scheme's own losses (rho_inf = 0.9) are part of it.
    """
    inertia, B = np.array([0.02, 0.02, 0.04]), np.array([1.0, 1.4, 0.8])
    section = {**TWISTED, "intrinsic_curvature": None, "rotary_inertia": (0.02, 0.04)}
    motion = {
        "sway": {"amplitude": 0.15, "period": 1.6},
        "heave": {"amplitude": 0.1, "period": 1.1, "phase": 40.0},
        "roll": {"amplitude": 30.0, "period": 1.3},
        "ramp": 1.0,
    }

    def energy(x: ShootingState) -> float:
        q, stretch = B * x.curvature, x.tension**2 / 60.0
        density = 0.3 * np.sum(x.v**2, 1) + np.sum(inertia * x.spin**2, 1) + np.sum(q**2 / B, 1) + stretch
        return float(np.trapezoid(0.5 * density + 0.3 * 9.81 * x.r[:, 2], x.s))

    misses = []
    for cells, step in ((15, 0.04), (30, 0.02)):
        start = clamped((0, 0, 0), (1, 0, 0.3), (0, 0, 1), motion=motion)
        time = {"duration": 2.0, "step": step, "rho_inf": 0.9}
        states = history(scene(section, start, free(), "rod", cells, 9.81, time=time))
        spins = np.array([x.frame[0] @ x.spin[0] for x in states])
        power = [-(x.force[0] @ x.v[0] + x.moment[0] @ w) for x, w in zip(states, spins, strict=True)]
        stored = np.array([energy(x) for x in states])
        work = np.concatenate([[0.0], np.cumsum(0.5 * step * (np.array(power)[1:] + np.array(power)[:-1]))])
        misses.append(np.abs(stored - stored[0] - work).max() / np.abs(work).max())
    assert 1.7 < order(*misses) < 2.6
    assert misses[1] < 1e-2


@pytest.mark.long
def test_ends_follow_their_motion() -> None:
    """A clamp that heaves and pitches: the end is where it should be, to third order in the step (SETTLE)."""
    from hybrid.scene.motion import EndMotion

    motion = {
        "heave": {"amplitude": 0.1, "period": 1.0},
        "pitch": {"amplitude": 20.0, "period": 1.5, "phase": 30.0},
        "ramp": 1.0,
    }
    section = {"length": 1.0, "mass": 1.0, "bending_stiffness": 1.0, "torsional_stiffness": 1.0, "rotary_inertia": 0.01}
    misses = []
    for step in (0.05, 0.025):
        start = clamped((0, 0, 0), (1, 0, 0), (0, 0, 1), motion=motion)
        what = scene(section, start, free(), "rod", 10, 1.0, time={"duration": 1.5, "step": step})
        run = ShootingRun(what)
        table = what.ends.start
        truth = EndMotion(table.motion, (0.0, 0.0, 0.0), run.state.frame[0])  # type: ignore[union-attr]
        worst = 0.0
        while run.t < 1.5 - 1e-9:
            state = run.advance()
            position, velocity, frame, _ = truth.at(state.t)
            assert frame is not None
            assert np.abs(state.v[0] - velocity).max() < 0.2 * step  # the drift correction, an order smaller than v
            worst = max(worst, np.abs(state.r[0] - position).max(), np.abs(log(frame.T @ state.frame[0])).max())
        misses.append(worst)
    assert 2.3 < order(*misses) < 3.3
    assert misses[1] < 1e-3


def test_rod_and_chain_agree_when_bending_vanishes() -> None:
    """A pendulum of 0.2 rad as catenary and as very limp rod: the same swing but for bending, EI/(w L^3) = 1e-4."""
    initial = {"kind": "straight", "direction": (0.1, 0.2, -1.0)}
    section = {
        "length": 1.0,
        "mass": 1.0,
        "bending_stiffness": 1e-3,
        "torsional_stiffness": 1e-3,
        "rotary_inertia": 1e-6,
    }
    tips = [
        np.array(
            [
                x.r[-1]
                for x in history(
                    scene(
                        section,
                        pinned(0, 0, 0),
                        free(),
                        kind,
                        20,
                        9.81,
                        initial=initial,
                        time={"duration": 1.0, "step": 0.05},
                    )
                )
            ]
        )
        for kind in ("rod", "catenary")
    ]
    assert np.abs(tips[0] - tips[1]).max() < 2e-2
    assert np.abs(tips[0][:, 1] - 2.0 * tips[0][:, 0]).max() < 1e-9  # it swings in its plane
