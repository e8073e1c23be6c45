"""Answers of programs that share nothing with ours: linked chains by Lagrange's equations, shooting, lines in a current."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import arbiter
import numpy as np
from extreme import AXES, MODELS, Case, Floats, Measured, Z, across, clamped, drawn, each, free, pinned, scene
from lines import G, section, told
from motions import clock, drift
from rods import rod
from scipy.integrate import solve_ivp

import hybrid


def linked(n: int, angle: float, stiff: Floats, times: Floats) -> Floats:
    """Positions (nt, n + 1, 2) of n equal, massive links on a pin, let go straight at `angle` to the vertical.

    L = m = g = 1: node masses 1/n, half at the ends; stiff: (n - 1,) EI/h of the hinges.  Lagrange's equations in the
    angles of the links, by DOP853 at 1e-10.
    """
    h = 1.0 / n
    mass = np.append(np.full(n - 1, h), 0.5 * h)  # of nodes 1 .. n
    beyond = np.cumsum(mass[::-1])[::-1]  # what hangs on link i
    shared = np.minimum.outer(beyond, beyond) * h * h

    def rate(_: float, y: Floats) -> Floats:
        q, w = y[:n], y[n:]
        apart = q[:, None] - q
        bend = stiff * np.diff(q)
        force = -shared * np.sin(apart) @ (w * w) - beyond * h * np.sin(q)
        force[:-1] += bend
        force[1:] -= bend
        return np.concatenate([w, np.linalg.solve(shared * np.cos(apart), force)])

    found = solve_ivp(
        rate, (0, times[-1]), np.r_[np.full(n, angle), np.zeros(n)], "DOP853", times, rtol=1e-10, atol=1e-12
    )
    assert found.success, found.message
    q = found.y[:n].T
    links = h * np.stack([np.sin(q), -np.cos(q)], axis=2)
    return np.concatenate([np.zeros((times.size, 1, 2)), np.cumsum(links, axis=1)], axis=1)


@drawn(
    31, 44, L=(0.1, 1e4), stiff=[1e-9, 1e-6, 1e-3, 1.0], degrees=[5.0, 40.0, 75.0, 90.0, 120.0], steps=[100, 300, 1000], rho=[0.0, 0.5, 0.8],
    n=[4, 10, 20], turn=[0.0, 1.0, 4.0], model=["rod", "rod", "catenary", "zones"],
)  # fmt: skip
def whips(d: dict[str, Any]) -> Iterator[Case]:
    """A chain, a rod or both on a pin, let go straight at an angle: it swings, and beyond 90 degrees it whips."""
    source = (
        "the same n links by Lagrange's equations in their angles, scipy DOP853 at 1e-10; discretisation in time alone: "
        "order 2, 40 (β - 1/6)/steps² L for steps per sqrt(L/g), 60 times that where it whips (beyond 75 degrees)"
    )
    L, n, angle, model = d["L"], d["n"], np.radians(d["degrees"]), d["model"]
    if model != "rod":
        angle = min(angle, np.radians(75.0))  # beyond, a chain goes slack
        n = max(n, 10)
    EI = d["stiff"] * G * L**3
    beat = np.sqrt(L / G)
    level = np.array([np.cos(d["turn"]), np.sin(d["turn"]), 0.0])
    along = np.sin(angle) * level - np.cos(angle) * Z
    hinges = np.full(n - 1, 1.0)
    if model == "zones":
        part = round(0.3 * n)
        hinges[part - 1 : n - part] = 0.0
    hinges *= (model != "catenary") * d["stiff"] * n

    def truth(result: Any) -> Measured:
        flat = linked(n, angle, hinges, result.times / beat) * L
        exact = flat[:, :, :1] * level + flat[:, :, 1:] * Z
        allowed = 40 * drift(d["rho"]) / d["steps"] ** 2 * (60 if angle > 1.4 else 1) + 1e-6
        yield "place/L", np.abs(result.position - exact).max() / L, min(allowed, 0.05)

    line = rod(L, EI, 1.0, rotary_inertia=0.0)
    motion = clock(round(1.2 * d["steps"]), beat / d["steps"], d["rho"])
    motion["output"]["points"] = np.linspace(0, L, n + 1).tolist()
    initial = {"kind": "straight", "direction": along.tolist()}
    tables = scene(line, pinned(), free(), model, n, G, initial=initial, **motion)
    name = told(
        L=L,
        EI=f"{EI:.2g} ({d['stiff']:g} w L³)",
        degrees=round(np.degrees(angle)),
        n=n,
        dt=f"sqrt(L/g)/{d['steps']}",
        rho=d["rho"],
    )
    yield Case("whips and chains", name, model, tables, truth, source)


@drawn(
    32, 36, L=(0.1, 1e4), D=(1e-4, 1.0), density=[20.0, 900.0, 1500.0, 7850.0], fluid=[1.2, 1025.0, 13_534.0], ratio=(1e-2, 30.0),
    turn=[0.0, 1.57, 2.5, 4.0], n=[4, 20, 200], EI=(1e-9, 1e2), model=list(MODELS), along=[False, False, True],
)  # fmt: skip
def currents(d: dict[str, Any]) -> Iterator[Case]:
    """A line held at one end in a current, in air, water or a heavy fluid: straight, at its critical angle."""
    source = (
        "w cos a = ρ D C (U sin a)²/2 (Zajac 1957), T = w z; along a current T = (w - ρ π D C_t U²/2) (L - s); round-off 1e-8: "
        "Newton's 1e-9 rad in every cell"
    )
    L, D = d["L"], d["D"]
    weight = (d["density"] - d["fluid"]) * np.pi / 4 * D * D * G
    level = np.array([np.cos(d["turn"]), np.sin(d["turn"]), 0.0])
    down = -np.sign(weight)
    speed = np.sqrt(2 * abs(weight) * d["ratio"] / (d["fluid"] * 1.2 * D))
    drag = {"normal": 1.2} if not d["along"] else {"normal": 1.2, "tangential": 0.3}
    line = section(L, D, d["density"], d["EI"], None) | {"drag": drag}
    current = speed * level if not d["along"] else -down * np.sqrt(abs(weight) / (d["fluid"] * D * 1.2)) * Z  # no kite
    half = 1 / d["ratio"] / 2
    cosine = np.sqrt(1 + half * half) - half  # w cos a = f sin(a)^2
    sine = np.sqrt(1 - cosine**2)
    way = level * cosine + down * sine * Z if not d["along"] else down * Z
    pull = abs(weight) * (sine if not d["along"] else 1 - 0.5 * np.pi * 0.3 / 1.2)

    def truth(result: Any) -> Measured:
        yield "shape/L", np.abs(result.position[-1] - result.s[:, None] * way).max() / L, 1e-8
        yield (
            "tension/(abs(weight) L)",
            np.abs(result.tension[-1] - pull * (L - result.s)).max() / (abs(weight) * L),
            1e-8,
        )

    fluid = {"density": d["fluid"], "current": current.tolist()}
    initial = {"kind": "equilibrium", "direction": (0.5 * level + down * Z).tolist()}
    tables = scene(line, pinned(), free(), d["model"], d["n"], G, fluid=fluid, initial=initial)
    name = told(
        L=L,
        D=D,
        EI=d["EI"],
        density=d["density"],
        fluid=d["fluid"],
        U=f"{np.linalg.norm(current):.2g}",
        along=d["along"],
        n=d["n"],
    )
    yield Case("lines in a current", name, d["model"], tables, truth, source)


@drawn(
    33, 20, EI=(1e-9, 1e6), L=(0.1, 1e4), turns=[0.25, 0.5, 1.0, 2.0, 5.0, 10.0], n=[40, 80, 200], axis=list(AXES), model=["rod", "rod", "adaptive"],
)  # fmt: skip
def rolled(d: dict[str, Any]) -> Iterator[Case]:
    """A cantilever rolled up by an end moment, turn upon turn, about every axis."""
    source = (
        "a circle of L/turns, M everywhere: a regular polygon of n chords is the discrete solution; round-off 1e-11 a radian; "
        "an event says that its stability is not judged"
    )
    EI, L, n, turns = d["EI"], d["L"], d["n"], d["turns"]
    along = AXES[d["axis"]]
    side = across(along)
    angle = 2 * np.pi * turns

    def truth(result: Any) -> Measured:
        cells = int(result.attributes["cells"])
        middles = angle * (np.arange(cells) + 0.5) / cells
        end = L / cells * (np.cos(middles).sum() * along + np.sin(middles).sum() * side)
        yield "end/L", np.abs(result.position[-1, -1] - end).max() / L, 1e-11 * max(1.0, angle)
        yield "moment", np.abs(result.bending_moment[-1] * L / EI / angle - 1).max(), 1e-9

    moment = EI * angle / L * np.cross(along, side)
    tables = scene(rod(L, EI), clamped((0, 0, 0), along), free(moment=moment.tolist()), d["model"], n)
    name = told(EI=EI, L=L, turns=turns, n=n, axis=d["axis"])
    yield Case("rolled up", name, d["model"], tables, truth, source)


def shot() -> Iterator[Case]:
    """Short lines of any shape in space, against the arbiter: the paper's own fields, marched literally."""
    source = (
        "literal shooting (bench/arbiter), which shares nothing with hybrid but the scene; discretisation: both are "
        "of order 2, 2/n² of the length on the shape and 10/n² on the moment at the clamp"
    )
    rng = np.random.default_rng(34)
    for _ in range(24):
        n, model = 60, str(rng.choice(["rod", "rod", "zones"]))
        L = float(f"{10 ** rng.uniform(-1, 4):.2g}")
        load = float(f"{10 ** rng.uniform(-1, 1.3):.2g}")  # w L^3/EI: beyond, there are several equilibria
        EI = float(f"{10 ** rng.uniform(-9, 6):.2g}")
        mass = load * EI / L**3 / G
        tangent = rng.normal(size=3) * [1, 1, 0.5]
        tangent /= np.linalg.norm(tangent)
        pull = (
            mass * G * L * (0.3 * rng.normal(size=3) + 0.7 * tangent - Z * (model == "zones"))
        )  # no push: one equilibrium

        def truth(result: Any, L: float = L, n: int = n, again: dict[str, Any] = {}) -> Measured:  # noqa: B006
            state = arbiter.static(hybrid.validate_scene(again["tables"]))
            other = arbiter.at(state, result.s)
            yield "shape/L", np.abs(result.position[-1] - other["position"]).max() / L, 2 / n**2
            yield "moment", np.linalg.norm(result.bending_moment[-1, 0]) / other["bending_moment"][0] - 1, 10 / n**2

        line = rod(L, EI, mass, rotary_inertia=0.0)
        tables = scene(line, clamped((0, 0, 0), tangent), free(pull), model, n, G)
        given = dict(tables=tables)
        name = told(**{"w L³/EI": load}, L=L, EI=EI, tangent="({:.2f}, {:.2f}, {:.2f})".format(*tangent), n=n)
        yield Case("against the arbiter", name, model, tables, lambda r, t=truth, g=given: t(r, again=g), source)


@each((0.1, 10.0, 1e4), ("rod", "catenary"))
def folds(L: Any, model: Any) -> Iterator[Case]:
    """A start folded by 180 degrees: a rod cannot, and the loose strand of a chain falls freely, without tension."""
    points = [[0, 0, 0], [0, 0, -0.5 * L], [0, 0, 0]]
    initial = {"kind": "points", "points": points}
    beat = np.sqrt(L / G)
    tables = scene(rod(L, 1e-3 * G * L**3), pinned(), free(), model, 20, G, initial=initial, **clock(20, 0.005 * beat))
    cause = "corner of 180 deg" if model == "rod" else "goes into compression"
    source = "a fold has no direction in which a rod could bend; the loose strand falls with g and has T = 0"
    yield Case("folded starts", told(L=L), model, tables, lambda _: [("any", 1.0, 0.5)], source, "refused", cause)


CASES = [*whips(), *currents(), *rolled(), *shot(), *folds()]
