"""Seeded random scenes of contact, soil and laws, each held against a closed form, a symmetry or a balance.

    python bench/attack_scenes.py contact     # or: soil, orders, all, a family; FIRST and LAST seed may follow

prints a line for each scene, with what deviates and the events, and the largest deviations of each family.  What was
found with it stands in docs/evidence/attacks.md.
"""

from __future__ import annotations

import sys
from collections import defaultdict
from collections.abc import Callable
from copy import deepcopy
from functools import partial
from itertools import pairwise
from math import sqrt
from pathlib import Path
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation

import hybrid
from hybrid.errors import HybridError

sys.path.insert(0, str(Path(__file__).parents[1]))  # of the tests, where a scene is said in other ways
from tests.combinations.pairs import as_network, scene_of, seen_by

Tables = dict[str, Any]
Rng = np.random.Generator
Found = tuple[str, dict[str, float], Any]  # what the scene is, deviations by name, its result
GRAVITY = 9.81  # m/s2


def any_turn(rng: Rng) -> Any:
    """A rotation (3, 3), all alike likely."""
    w, x, y, z = rng.normal(size=4)
    return Rotation.from_quat([x, y, z, w]).as_matrix()


def about_the_vertical(rng: Rng) -> Any:
    """A turn about the vertical, or a mirror in a plane through it (3, 3)."""
    c, s = np.cos(angle := rng.uniform(0, 2 * np.pi)), np.sin(angle)
    odd = -1.0 if rng.random() < 0.5 else 1.0
    return np.array([[c, -odd * s, 0], [s, odd * c, 0], [0, 0, 1.0]])


def exchanged(tables: Tables) -> Tables:
    """The scene with s counted from the other end."""
    ends, initial = tables["ends"], deepcopy(tables["initial"])
    if isinstance(initial, dict):
        initial["points"].reverse()
    return tables | {"ends": {"start": ends["end"], "end": ends["start"]}, "initial": initial}


def off(result: Any, other: Any, length: float) -> float:
    """Largest difference of places over a length."""
    return float(np.abs(result - other).max() / length)


# --- contact --------------------------------------------------------------------------------------------


def around(phi: float, rho: float, before: float, after: float) -> tuple[list[Any], Any, Any]:
    """Corners of a line around a drum of radius rho about y at the origin, and the directions of its ends outwards."""
    t0, t1 = 0.5 * (np.pi + phi), 0.5 * (np.pi - phi)
    arc = [[rho * np.cos(t), 0.0, rho * np.sin(t)] for t in np.linspace(t0, t1, max(9, int(phi / 0.1)))]
    back, ahead = np.array([-np.sin(t0), 0.0, np.cos(t0)]), np.array([np.sin(t1), 0.0, -np.cos(t1)])
    return [np.array(arc[0]) + before * back, *arc, np.array(arc[-1]) + after * ahead], back, ahead


def wheel(kind: str, axis: Any, radius: float, strand: float, **more: Any) -> Tables:
    table: Tables = {"kind": kind, "at": [0, 0, 0], "axis": axis.tolist(), "radius": radius} | more
    return table | ({"groove": 1.3 * strand, "rim": 0.3 * strand} if kind == "sheave" else {})


def capstan(rng: Rng) -> Found:
    """A weightless rope that is pulled over a drum or sheave in any direction: ln T2/T1 = mu phi."""
    M, kind, model = any_turn(rng), str(rng.choice(["cylinder", "sheave"])), str(rng.choice(["catenary", "rod"]))
    mu, a, phi = float(rng.uniform(0.05, 0.6)), float(10 ** rng.uniform(-2.5, -1.5)), float(rng.uniform(0.6, 3.1))
    radius, EA, per = a * 10 ** rng.uniform(0.8, 1.7), float(10 ** rng.uniform(3.5, 5)), rng.uniform(0.06, 0.12)
    rho, low = radius + a, 2e-3 * EA
    before, after = rho * rng.uniform(10, 24), 3 * rho
    points, _, ahead = around(phi, rho, before, after)
    length = float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())
    near, far = before - 4 * per * rho, length - after + 4 * per * rho
    nodes = [
        *np.linspace(0, near, 6)[:-1],
        *np.linspace(near, far, int(phi / per) + 9),
        *np.linspace(far, length, 4)[1:],
    ]
    passing, high = length * sqrt(0.1 / EA), low * np.exp(mu * phi) * rng.uniform(2, 4)
    over = 60 * passing
    section = {"length": length, "mass": 0.1, "diameter": 2 * a, "axial_stiffness": EA, "max_strain": 0.5,
               "bending_stiffness": EA * a * a * 1e-6, "damping": {"mass": 0.1 / passing}}  # fmt: skip
    pull = [[t, *(M @ ahead * T).tolist()] for t, T in ((0.0, low), (over, high))]
    tables = {
        "environment": {"gravity": 0}, "cable": {"sections": [section]},
        "obstacles": {"o": wheel(kind, M[:, 1], radius, a, friction=mu)},
        "ends": {"start": {"kind": "pinned", "position": (M @ points[0]).tolist()},
                 "end": {"kind": "free", "force": {"history": pull}}},
        "initial": {"kind": "equilibrium", "points": (np.array(points) @ M.T).tolist()}, "model": model,
        "mesh": {"nodes": [float(x) for x in nodes]}, "contact": {"self": False},
        "time": {"duration": 1.5 * over, "step": over / 100}, "output": {"every": over / 20},
    }  # fmt: skip
    r = hybrid.run(tables)
    exponent = np.log(r.tension[-1, -1] / r.tension[-1, 0])
    books = np.abs(r["work/scheme"]).max() / r["work/applied"][-1]
    return f"{kind} {model} mu {mu:.2f} phi {phi:.2f}", {"exponent": exponent - mu * phi, "books": books}, r


def obstacle(rng: Rng, length: float, mu: float) -> Tables:
    """A sphere, cylinder, capsule, box or torus of 3 to 12 % of a length."""
    radius, kind = (
        float(length * rng.uniform(0.03, 0.12)),
        str(rng.choice(["cylinder", "box", "torus", "sphere", "capsule"])),
    )
    own: Tables = {"friction": mu} if mu else {}
    axis = [float(rng.uniform(-0.4, 0.4)), 1.0, float(rng.uniform(-0.2, 0.2))]
    if kind == "sphere":
        return own | {"kind": kind, "radius": radius}
    if kind == "box":
        turn = [float(rng.uniform(-x, x)) for x in (10, 60, 20)]
        size = [2 * radius, 0.4 * length, 2 * radius]
        return own | {"kind": kind, "size": size, "rounding": float(radius * rng.uniform(0.3, 0.9)), "rotation": turn}
    if kind == "torus":
        return own | {"kind": kind, "axis": axis, "ring": 0.7 * radius, "radius": 0.3 * radius}
    return (
        own
        | {"kind": "cylinder", "axis": axis, "radius": radius}
        | ({"length": 0.3 * length} if kind == "capsule" else {})
    )


def over_something(rng: Rng, mu: float = 0.0) -> Tables:
    """A heavy line between two points, hung through an obstacle, or laid over it by a first shape."""
    L = float(10 ** rng.uniform(0, 2))
    D = float(L * 10 ** rng.uniform(-2.6, -1.7))
    w = float(np.pi / 4 * D * D * 10 ** rng.uniform(2.7, 3.9)) * GRAVITY
    span, h, cells = float(L * rng.uniform(0.5, 0.9)), float(L * rng.uniform(-0.2, 0.2)), int(rng.integers(24, 60))
    section = {"length": L, "mass": w / GRAVITY, "diameter": D, "bending_stiffness": w * L**3 * 10 ** rng.uniform(-6, -4),
               "axial_stiffness": w * L * 10 ** rng.uniform(2, 4.5)}  # fmt: skip
    part, thing = float(rng.uniform(0.3, 0.7)), obstacle(rng, L, mu)
    size = thing.get("radius", 0.0) + thing.get("ring", 0.0) or 0.5 * thing["size"][0]
    z = h * part - 0.4 * sqrt(L * L - span * span) * rng.uniform(0.3, 0.8)
    thing["at"] = [span * part, float(rng.uniform(-0.3, 0.3) * size), float(z - size)]
    initial: Any = "equilibrium"
    if rng.random() < 0.6:
        top = brentq(
            lambda y: np.hypot(span * part, y) + np.hypot(span * (1 - part), h - y) - L, h * part, h * part + 2 * L
        )
        initial = {"kind": "equilibrium", "points": [[0, 0, 0], [span * part, 0, float(top)], [span, 0, h]]}
    return {
        "cable": {"sections": [section]}, "obstacles": {"o": thing}, "initial": initial,
        "ends": {"start": {"kind": "pinned", "position": [0, 0, 0]}, "end": {"kind": "pinned", "position": [span, 0, h]}},
        "model": str(rng.choice(["rod", "catenary"])), "mesh": {"cells": cells}, "contact": {"self": False},
        "output": {"points": cells + 1},
    }  # fmt: skip


def drape(rng: Rng) -> Found:
    """A heavy line at rest over a smooth obstacle: balance, T + T^2/2EA - w z, symmetries, four times the cells."""
    tables, M = over_something(rng), about_the_vertical(rng)
    section, thing, r = tables["cable"]["sections"][0], tables["obstacles"]["o"], hybrid.static(tables)
    L, w, x, T = section["length"], section["mass"] * GRAVITY, r.position[-1], r.tension[-1]
    force = r.reaction_start[-1] + r.reaction_end[-1] - r["obstacles/o/normal_force"][-1]
    checks = {"balance": off(force, [0, 0, w * L], w * L)}
    if tables["model"] == "catenary":
        checks["T - w z"] = float(np.ptp((T + T * T / 2 / section["axial_stiffness"] - w * x[:, 2])[1:-1]) / (w * L))
    if thing["kind"] != "box":
        checks["turned"] = off(hybrid.static(seen_by(M, deepcopy(tables))).position[-1], x @ M.T, L)
    checks["exchanged"] = off(hybrid.static(exchanged(tables)).position[-1], x[::-1], L)
    checks["system"] = off(hybrid.static(as_network(tables)).lines["cable"].position[-1], x, L)
    finer = hybrid.static(tables | {"mesh": {"cells": 4 * tables["mesh"]["cells"]}})
    return f"{thing['kind']} {tables['model']}", checks | {"finer": off(finer.position[-1], x, L)}, r


def moving(rng: Rng) -> Found:
    """Such a rod with friction whose end moves, over what rests, moves, spins or turns freely."""
    tables, M = over_something(rng, float(rng.uniform(0.1, 0.5))), about_the_vertical(rng)
    section, thing, n = tables["cable"]["sections"][0], tables["obstacles"]["o"], int(rng.choice([60, 120]))
    L = section["length"]
    T = float(sqrt(L / GRAVITY) * rng.uniform(2, 5))
    ways = [[float(L * y) for y in rng.uniform(-x, x, 3)] for x in (0.08, 0.05)]
    tables["ends"]["end"]["motion"] = {"travel": {"by": ways[0], "over": 0.7 * T}}
    if rng.random() < 0.5:
        thing["motion"] = {"travel": {"by": ways[1], "over": 0.7 * T}}
    elif thing["kind"] in ("torus", "cylinder") and "length" not in thing:
        bearing = {"bearing": {"inertia": section["mass"] * L * (0.08 * L) ** 2}}
        thing |= bearing if rng.random() < 0.5 else {"spin": {"rate": float(rng.uniform(-3, 3) / T), "ramp": 0.5 * T}}
    tables |= {"model": "rod", "time": {"duration": T, "step": T / n}, "dimension": 3}
    tables["output"] |= {"every": 0.1 * T}
    r = hybrid.run(tables)
    checks = {"exchanged": off(hybrid.run(exchanged(tables)).position, r.position[:, ::-1], L)}
    if thing["kind"] != "box":
        checks["turned"] = off(hybrid.run(seen_by(M, deepcopy(tables))).position, r.position @ M.T, L)
    checks["system"] = off(hybrid.run(as_network(tables)).lines["cable"].position, r.position, L)
    checks["step/4"] = off(hybrid.run(tables | {"time": {"duration": T, "step": T / n / 4}}).position, r.position, L)
    done = np.abs(r["work/end"]).max() + np.abs(r["work/friction"]).max()
    return f"{thing['kind']} {[x for x in ('motion', 'spin', 'bearing') if x in thing]}", checks | {
        "created": float(r["work/scheme"].max() / done)}, r  # fmt: skip


def sheave_by_hand(F: float, pull: Callable[[float], float], mu: float, phi: float, rho: float, m: float, legs: Any,
                   inertia: float, damping: float, end: float) -> tuple[float, float]:  # fmt: skip
    """Travel (m) of a rope over a sheave and the turn (rad) of it, which sticks, or slips by e^(mu phi)."""
    L, ea, k = legs[0] + legs[1] + phi * rho, np.exp(mu * phi), m * rho / mu

    def rates(t: float, y: Any) -> list[float]:
        x, v, _, om = y
        l1, l2 = legs[0] - x, legs[1] + x
        a = (pull(t) - F - damping * v / rho**2) / (m * L + inertia / rho**2)
        light, heavy = F + m * l1 * a - m * v * v, pull(t) - m * l2 * a - m * v * v
        if v - om * rho <= 1e-9 * max(abs(v), 1e-12) and heavy + k * a <= ea * (light + k * a):
            return [v, a, om, a / rho]
        a = (pull(t) - m * v * v - ea * (F - m * v * v)) / (m * l2 + ea * (m * l1 + k) - k)
        turning = (pull(t) - m * l2 * a - F - m * l1 * a - m * rho * phi * a) * rho - damping * om
        return [v, a, om, turning / inertia]

    found = solve_ivp(rates, [0, end], [0, 0, 0, 0], max_step=end / 400, rtol=1e-8, atol=1e-12)
    return float(found.y[0, -1]), float(found.y[2, -1])


def sheave(rng: Rng) -> Found:
    """Two pulls on a rope over a sheave with inertia and bearing: travel and turn, stuck and slipping."""
    M, a = any_turn(rng), float(10 ** rng.uniform(-2.5, -1.7))
    rho, phi, mu = a * 10 ** rng.uniform(0.9, 1.4), float(rng.uniform(1.0, 3.1)), float(rng.uniform(0.1, 0.6))
    kind, slips = str(rng.choice(["cylinder", "sheave"])), bool(rng.random() < 0.5)
    m, legs = float(10 ** rng.uniform(-1.5, 0)), (rho * rng.uniform(5, 12), rho * rng.uniform(3, 6))
    points, back, ahead = around(phi, rho, *legs)
    L, F = float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum()), float(10 ** rng.uniform(0, 2))
    most = F * np.exp(mu * phi * (rng.uniform(1.3, 2.0) if slips else rng.uniform(0.1, 0.5)))
    inertia = float(m * L * rho**2 * 10 ** (rng.uniform(0.7, 1.5) if slips else rng.uniform(-0.5, 1.0)))
    damping = float(rng.integers(0, 2) * inertia * sqrt((most - F) / (m * L * L)))
    force = most - F * np.exp(mu * phi) if slips else (most - F) * m * L / (m * L + inertia / rho**2)
    end, n = sqrt(0.4 * legs[0] * m * L / force), int(rng.integers(100, 200))
    ramp = 0.25 * end
    rows = [[[0, 0, 0, 0], [0.2 * ramp, *(M @ x * F).tolist()]] for x in (back, ahead)]
    rows[1] += [[0.4 * ramp, *(M @ ahead * F).tolist()], [ramp, *(M @ ahead * most).tolist()]]
    EA = most * 10 ** rng.uniform(2.5, 3.5)
    section = {"length": L, "mass": m, "diameter": 2 * a, "axial_stiffness": EA, "bending_stiffness": EA * a * a * 1e-5,
               "damping": {"stiffness": 4 * end / n}}  # fmt: skip
    r = hybrid.run({
        "environment": {"gravity": 0}, "cable": {"sections": [section]},
        "obstacles": {"o": wheel(kind, M[:, 1], rho - a, a, friction=mu, bearing={"inertia": inertia, "damping": damping})},
        "ends": {x: {"kind": "free", "force": {"history": y}} for x, y in zip(("start", "end"), rows, strict=True)},
        "initial": {"kind": "points", "points": (np.array(points) @ M.T).tolist()}, "model": "rod",
        "mesh": {"cells": int(L / (0.12 * rho)) + 1}, "contact": {"self": False},
        "time": {"duration": end, "step": end / n}, "output": {"every": end / 20},
    })  # fmt: skip
    x, turned = sheave_by_hand(F, lambda t: F + (most - F) * float(np.clip((t / ramp - 0.4) / 0.6, 0, 1)), mu, phi, rho, m,
                               legs, inertia, damping, end)  # fmt: skip
    frames = Rotation.from_euler("xyz", r["obstacles/o/rotation"], degrees=True)
    turn = abs(((frames[1:] * frames[:-1].inv()).as_rotvec() @ M[:, 1]).sum())
    way = float((r.position[-1, -1] - r.position[0, -1]) @ (M @ ahead))
    return f"{kind} {'slips' if slips else 'sticks'}", {"travel": way / x - 1, "turn": turn / turned - 1}, r


def ball(rng: Rng) -> Found:
    """A ball that a force presses between two taut weightless ropes: strings with an arc, solved for its height."""
    M = any_turn(rng)
    half = float(rng.uniform(2, 6))
    R = float(half * rng.uniform(0.05, 0.15))
    a = float(R * 10 ** rng.uniform(-1.5, -0.9))
    rho = R + a
    c, EA, cells = float(rho * rng.uniform(0.3, 0.8)), float(10 ** rng.uniform(4, 6)), 2 * int(rng.integers(20, 50))
    L = 2 * half / (1 + float(rng.uniform(2e-3, 1e-2)))

    def lifted(z: float) -> tuple[float, float]:
        """Force on the ball z above the plane of the pins, and the tension, N."""
        H = np.hypot(c, z)
        far = np.hypot(half, H)
        slope = np.arcsin(rho / far) - np.arctan2(H, half)
        T = EA * ((2 * sqrt(far**2 - rho**2) + 2 * rho * slope) / L - 1)
        return 4 * T * np.sin(slope) * z / H, T

    heights = np.linspace(0, sqrt(rho**2 - c**2) * 0.9999, 400)[::-1]
    forces = np.array([lifted(z)[0] for z in heights])
    W = float(rng.uniform(0.1, 0.8) * forces.max())
    k = int(np.argmax(forces >= W))
    z = float(brentq(lambda y: lifted(y)[0] - W, heights[k], heights[k - 1]))
    section = {"length": L, "mass": 1000 * np.pi * a * a, "diameter": 2 * a, "axial_stiffness": EA,
               "bending_stiffness": EA * a * a * 1e-6, "damping": {"mass": 1.0}}  # fmt: skip
    line = {"sections": [section], "contact": {"self": False}, "model": str(rng.choice(["rod", "catenary"])),
            "mesh": {"cells": cells}}  # fmt: skip
    corners = {f"{i}{j}": [x, y, 0.0] for i, x in ((0, -half), (1, half)) for j, y in ((0, -c), (1, c))}
    r = hybrid.static({
        "environment": {"gravity": 0}, "points": {i: {"position": (M @ x).tolist()} for i, x in corners.items()},
        "bodies": {"ball": {"initial_guess": (M @ [0, 0, 1.02 * z]).tolist(), "mass": 10.0, "inertia": [1.0] * 3,
                            "force": (M @ [0, 0, -W]).tolist(), "shape": {"kind": "sphere", "radius": R}}},
        "lines": {n: {"start": f"0{j}", "end": f"1{j}", **line} for j, n in enumerate("pq")}, "output": {"points": cells + 1},
    })  # fmt: skip
    place, T = r["bodies/ball/position"][-1] @ M, [r.lines[n].tension[-1].mean() for n in "pq"]
    return f"{line['model']} cells {cells}", {
        "place": off(place, [0, 0, z], rho), "tension": max(abs(x / lifted(z)[1] - 1) for x in T)}, r  # fmt: skip


def struck(rng: Rng) -> Found:
    """A ball is pushed, then flies into a line that nothing holds: momentum, angular momentum, energy."""
    M, R, mu = any_turn(rng), float(rng.uniform(0.1, 0.5)), float(rng.choice([0, 0.3]))
    L, D = float(R * rng.uniform(2, 6)), float(R * 10 ** rng.uniform(-1.5, -0.7))
    m, v = float(rng.uniform(500, 8000) * np.pi / 4 * D * D), float(10 ** rng.uniform(-0.5, 1))
    mass, cells, n = float(m * L * 10 ** rng.uniform(-1, 1)), int(rng.integers(12, 40)), int(rng.choice([200, 400]))
    tau, end, height = 0.1 * R / v, 3.3 * R / v, 1.3 * R + 0.5 * D
    first = M @ [float(rng.uniform(-0.4, 0.4)) * L - 0.5 * L, float(rng.uniform(-0.7, 0.7)) * R, height]
    section = {"length": L, "mass": m, "diameter": D, "axial_stiffness": m * (v * 30) ** 2,
               "bending_stiffness": m * v * v * L * L * 10 ** rng.uniform(-3, 0)}  # fmt: skip
    push = {"value": (M @ [0, 0, mass * v / tau]).tolist(), "until": tau}
    r = hybrid.run({
        "environment": {"gravity": 1e-12},
        "points": {"a": {"initial_guess": first.tolist()}, "b": {"initial_guess": (first + L * M[:, 0]).tolist()}},
        "bodies": {"ball": {"initial_guess": [0, 0, 0], "mass": mass, "inertia": [0.4 * mass * R * R] * 3, "force": push,
                            "shape": {"kind": "sphere", "radius": R, "friction": mu}}},
        "lines": {"p": {"start": "a", "end": "b", "sections": [section], "model": "rod", "mesh": {"cells": cells},
                        "contact": {"self": False}, "initial": {"kind": "straight", "direction": M[:, 0].tolist()}}},
        "time": {"duration": end, "step": end / n}, "output": {"points": cells + 1, "every": end / 20},
    })  # fmt: skip
    p, after, nodes = (
        r.lines["p"],
        int(np.searchsorted(r.times, 1.001 * tau)),
        np.full((1, cells + 1, 1), m * L / cells),
    )
    nodes[:, [0, -1]] *= 0.5
    moved, spin, x = (r[f"bodies/ball/{y}"] for y in ("velocity", "angular_velocity", "position"))
    P = (p.velocity * nodes).sum(1) + mass * moved
    J = np.cross(p.position, p.velocity * nodes).sum(1) + mass * np.cross(x, moved) + 0.4 * mass * R * R * spin
    stored = sum(p[y] for y in p.names if y.startswith("energy/") and y.split("/")[1] not in ("kinetic", "potential"))
    E = (
        0.5 * (p.velocity**2 * nodes).sum((1, 2))
        + 0.5 * mass * ((moved**2).sum(1) + 0.4 * R * R * (spin**2).sum(1))
        + stored
    )
    E, P, J = E[after:], P[after:], J[after:]
    return f"mu {mu} cells {cells} mass ratio {mass / (m * L):.2f}", {
        "momentum": off(P, P[0], mass * v), "angular": off(J, J[0], mass * v * R), "created": float(E.max() / E[0] - 1)}, r  # fmt: skip


# --- soil -----------------------------------------------------------------------------------------------


class Clay:
    """Random soil, and its law written anew from (T17g) to (T17i) of docs/theory.md."""

    def __init__(self, rng: Rng, D: float) -> None:
        self.D, self.a, self.b = D, float(rng.uniform(4, 8)), float(rng.uniform(0.1, 0.5))
        self.su, self.rho = float(10 ** rng.uniform(2.5, 4.3)), float(rng.uniform(0, 2500) * (rng.random() < 0.7))
        self.K, self.f = float(10 ** rng.uniform(1.5, 2.5)), float(rng.choice([0, rng.uniform(0.1, 1)]))
        self.tables = {"shear_strength": self.su, "gradient": self.rho, "bearing": self.a, "power": self.b,
                       "stiffness": self.K, "suction": self.f}  # fmt: skip

    def most(self, z: float) -> float:
        x = z / self.D
        factor = self.a * (x**self.b if x > 0.1 else 0.1**self.b * sqrt(10 * x))
        return float(factor * (self.su + self.rho * z) * self.D)

    def first(self, z: float) -> float:
        return self.most(z) * z * self.K / (self.D + z * self.K)

    def along(self, depths: Any) -> list[float]:
        """N/m at depths that are passed through one after the other, from above the bed."""
        P, way, last, turn, then, out = 0.0, 0, 0.0, 0.0, 0.0, []
        for z in depths:
            sense = int(np.sign(z - last))
            if z <= 0.0:
                P, way = 0.0, 0
            elif last <= 0.0:
                P, way = self.first(z), 0
            else:
                if sense and way != sense and (way, sense) != (0, 1):
                    turn, then, way = last, P, sense
                P = self.first(z)
                if way:
                    x = self.most(turn) * abs(z - turn) * self.K / self.D
                    Q = then + self.f * self.most(z) if way < 0 else self.most(z) - then
                    branch = then + way * (Q * x / (Q + x) if Q > 0 else Q)
                    P, way = (branch, way) if branch < P else (P, 0)
            last = z
            out.append(P)
        return out


def history(rng: Rng) -> Found:
    """A stiff rod that is moved up and down in soil, on level and sloping beds: pressure and work of its history."""
    D = float(10 ** rng.uniform(-1.2, -0.3))
    clay, slope = Clay(rng, D), listed(rng.uniform(-0.3, 0.3, 2)) if rng.random() < 0.4 else [0.0, 0.0]
    n = np.array([-slope[0], -slope[1], 1.0]) / sqrt(1 + slope[0] ** 2 + slope[1] ** 2)
    angle = rng.uniform(0, 2 * np.pi)
    t = np.array([np.cos(angle), np.sin(angle), 0.0])
    t = (t - n * (t @ n)) / np.linalg.norm(t - n * (t @ n))
    o, big, step = n * D * rng.uniform(0.05, 0.3), float(D * rng.uniform(0.3, 1.2)), float(rng.choice([0.02, 0.04]))
    heave = [{"amplitude": big, "period": 8.0, "phase": -90.0},
             {"amplitude": float(big * rng.uniform(0.05, 0.3)), "period": 4 / float(rng.uniform(1.5, 3))}]  # fmt: skip
    section = {"length": 1.0, "mass": 2000 * D * D, "diameter": D, "axial_stiffness": 1e9, "bending_stiffness": 1e8,
               "damping": 2.0}  # fmt: skip
    r = hybrid.run({
        "environment": {"gravity": 0, "seabed": {"z": 0, "soil": clay.tables, "slope": slope}},
        "cable": {"sections": [section]}, "model": "rod", "contact": {"self": False}, "mesh": {"cells": 4},
        "ends": {x: {"kind": "pinned", "position": listed(o + y * t), "motion": {"ramp": 1.0, "heave": heave}}
                 for x, y in (("start", -0.5), ("end", 0.5))},
        "initial": {"kind": "straight", "origin": listed(o - 0.5 * t), "direction": listed(t)},
        "time": {"duration": 8.0, "step": step}, "output": {"every": step, "points": 5, "exact": True},
    })  # fmt: skip
    z = -(r.position @ n)
    P = np.array([clay.along(x) for x in z.T]).T
    taken = float(np.trapezoid(np.sum(0.5 * (P[1:] + P[:-1]) * np.diff(z, axis=0), axis=0), r.s))
    return f"D {D:.2f} suction {clay.f:.2f} to {z.max() / D:.2f} D", {
        "pressure": off(r.contact, P, P.max()), "work": -r["work/contact"][-1] / taken - 1}, r  # fmt: skip


def foundation(rng: Rng) -> Found:
    """A heavy rod on a bed whose end is lifted or pressed, pinned, clamped or free: EI y4 - T y2 + k y = 0."""
    D, EI, k = float(rng.uniform(0.5, 1.0)), float(10 ** rng.uniform(3, 6)), float(10 ** rng.uniform(3, 5.5))
    deep, kind = float(D * rng.uniform(0.005, 0.04)), str(rng.choice(["pinned", "clamped", "free"]))
    w = float(np.clip(deep * k, *(x * np.pi / 4 * D * D * GRAVITY for x in (20, 20000))))
    k = w / deep
    T, cells = float(rng.choice([0, rng.uniform(0, 1.5)]) * 2 * sqrt(k * EI)), int(rng.integers(100, 180))
    L = 24 * (4 * EI / k) ** 0.25
    u = float(rng.uniform(0.2, 0.7)) * deep * float(rng.choice([-1, 1]))
    p, q = sqrt(k / EI), T / EI
    al, be = 0.5 * sqrt(2 * p + q), 0.5 * np.emath.sqrt(2 * p - q)
    past = float(np.real(al**2 - be**2))
    start: Tables = {"kind": kind, "position": [0, 0, u - deep]}
    A, B, up = u, u * past / (2 * al), {"kind": "free", "force": [T, 0, 0]}
    if kind == "clamped":
        start["tangent"], B = [1, 0, 0], al * u
    if kind == "free":  # no moment, and the force P
        P = u * k / al
        c3, s3 = (float(np.real(x)) for x in (-(al**3) + 3 * al * be**2, 3 * al**2 - be**2))
        A, B = np.linalg.solve([[past, -2 * al], [EI * c3 + T * al, EI * s3 - T]], [0, -P])
        start, up = {"kind": kind, "force": [-T, 0, -P]}, {"kind": "pinned", "position": [L, 0, -deep]}
    r = hybrid.static({
        "environment": {"seabed": {"z": 0, "stiffness": k}}, "model": "rod", "mesh": {"cells": cells},
        "cable": {"sections": [{"length": L, "mass": w / GRAVITY, "diameter": D, "bending_stiffness": EI,
                                "axial_stiffness": max(T, w * L) * 1e6}]},
        "ends": {"start": start, "end": up}, "output": {"points": cells + 1},
        "initial": {"kind": "equilibrium", "points": [[0, 0, start.get("position", [0, 0, -deep])[2]], [L, 0, -deep]]},
    })  # fmt: skip
    y = np.real(np.exp(-al * r.s) * (A * np.cos(be * r.s) + B * np.sin(be * r.s) / be))
    return f"{kind} q/2p {q / 2 / p:.2f}", {"shape": off(r.position[-1, :, 2] + deep, y, np.abs(y).max())}, r


def lateral(rng: Rng) -> Found:
    """A stiff rod that is drawn aside in clay: (mu w + pu) (r + (1 - r) exp(-way/breakout)) behind its travel."""
    D, L = float(10 ** rng.uniform(-1.0, -0.4)), 2.0
    clay, mu, heavy, J = (
        Clay(rng, D),
        float(rng.uniform(0.05, 0.8)),
        float(rng.uniform(0, 8000)),
        float(rng.uniform(0.2, 0.6)),
    )
    travel, most = float(D * 10 ** rng.uniform(-2, -1)), clay.first(D * rng.uniform(0.05, 0.8))
    w = float(np.clip(most / GRAVITY, *(x * np.pi / 4 * D * D for x in (18, 25000)))) * GRAVITY
    z = float(brentq(lambda x: clay.first(x) - w, 1e-9, 5 * D))
    su = clay.su + clay.rho * z
    most = (mu * w + min(3 * su + heavy * z + J * su * z / D, 9 * su) * min(z, D)) * L
    left, over = float(rng.uniform(0.1, 0.8)), float(travel * rng.uniform(2, 10))
    friction: Tables = {"axial": mu, "lateral": mu, "travel": travel}
    if rng.random() < 0.5:
        friction |= {"residual": [left * mu, left * mu], "breakout": over}
    else:
        left = 1.0
    angle = rng.uniform(0, 2 * np.pi)
    along, aside = np.array([np.cos(angle), np.sin(angle), 0.0]), np.array([-np.sin(angle), np.cos(angle), 0.0])
    motion = {"travel": {"by": listed(6 * travel * aside), "over": 8.0}}
    section = {"length": L, "mass": w / GRAVITY, "diameter": D, "axial_stiffness": most * 1e6, "damping": {"mass": 3.0},
               "bending_stiffness": most * L * L * 1e5}  # fmt: skip
    soil = clay.tables | {"lateral": {"unit_weight": heavy, "wedge": J}}
    r = hybrid.run({
        "environment": {"seabed": {"z": 0, "soil": soil, "friction": friction}}, "cable": {"sections": [section]},
        "ends": {x: {"kind": "pinned", "position": listed(y * along - [0, 0, z]), "motion": motion}
                 for x, y in (("start", -1.0), ("end", 1.0))},
        "initial": "equilibrium", "model": "rod", "mesh": {"cells": 8}, "contact": {"self": False},
        "time": {"duration": 4.0, "step": 0.01}, "output": {"every": 0.02, "points": 9, "exact": True},
    })  # fmt: skip
    x, v = (r.position[:, 4] - r.position[0, 4]) @ aside, r.velocity[:, 4] @ aside
    F = (r.reaction_start + r.reaction_end) @ aside - w / GRAVITY * L * (np.gradient(v, r.times) + 3.0 * v)
    held = most * np.where(x < travel, x / travel, left + (1 - left) * np.exp(-np.maximum(x - travel, 0.0) / over))
    return f"z/D {z / D:.2f} left {left:.2f}", {"force": off(F[5:], held[5:], most)}, r


def listed(x: Any) -> list[float]:
    return [float(y) for y in x]


# --- orders of convergence ------------------------------------------------------------------------------

CURVE = [[0, 0], [0.05, 1.5], [0.2, 4.0], [0.6, 8.0]]  # 1/m, N m
LAWS: dict[str, Tables] = {
    "elastic": {},
    "slip": {"bending_stiffness": 12.0, "bending_slip": [
        {"stiffness": 20.0, "moment": 1.5}, {"stiffness": 10.0, "moment": 0.5, "per_tension": 0.05}]},
    "first loading": {"moment_curvature": CURVE, "first_loading": True, "bending_stiffness": None},
    "moment table": {"moment_curvature": CURVE, "bending_stiffness": None},
    "stiffness by tension": {"stiffness_per_tension": 0.5},
    "restrictor": {"attachments": [{"kind": "bend_restrictor", "range": [0.5, 1.5], "radius": 4.0, "locked_stiffness": 200.0}]},
    "stiffener": {"attachments": [
        {"kind": "bend_stiffener", "range": [0, 0.8], "diameters": [0.12, 0.05], "bore": 0.03, "modulus": 2e6}]},
}  # fmt: skip


def beam(law: Tables, rng: Rng) -> Tables:
    """A cantilever of 2 m, bent to and fro and aside by a smooth force at its tip, under a tension that changes."""
    F, T, t = float(rng.uniform(3, 6)), float(rng.uniform(5, 20)), np.linspace(0, 2, 41)
    force = np.column_stack([
        T * (1 + 0.5 * np.sin(2 * np.pi * t)), F * 0.25 * t * np.sin(4 * t), -F * np.sin(np.pi * t) ** 3,
    ])  # fmt: skip
    fine = np.linspace(0, 2, 801)
    rows = np.column_stack([fine, CubicSpline(t, force, bc_type="clamped")(fine)])
    section = {"length": 2.0, "mass": 2.0, "diameter": 0.03, "axial_stiffness": 1e6, "bending_stiffness": 20.0,
               "torsional_stiffness": 15.0, "damping": {"mass": 2.0}} | law  # fmt: skip
    attachments = section.pop("attachments", [])
    return {
        "environment": {"gravity": 0}, "model": "rod", "contact": {"self": False}, "initial": "equilibrium", "dimension": 3,
        "cable": {"sections": [{x: y for x, y in section.items() if y is not None}], "attachments": attachments},
        "ends": {"start": {"kind": "clamped", "position": [0, 0, 0], "tangent": [1, 0, 0], "normal": [0, 1, 0]},
                 "end": {"kind": "free", "force": {"history": rows.tolist()}}},
        "mesh": {"cells": 16}, "time": {"duration": 2.0, "step": 0.02},
        "output": {"every": 0.1, "points": 17, "exact": True},
    }  # fmt: skip


# Of tests.combinations.pairs, that a travel of the end of its line moves.
FEATURES_MOVED = (
    "table", "rope", "polyester", "creep", "moment table", "slip", "stiffness by tension", "torque of tension", "vortices",
    "seabed", "soil", "obstacle", "obstacle that moves", "sheave", "stiffener", "restrictor",
)  # fmt: skip


def moved(feature: str, rng: Rng) -> Tables:
    """A line of 12 m with a feature, whose end goes 0.3 m aside and up."""
    tables = deepcopy(scene_of(feature))
    end, way = tables["ends"]["end"], np.add(rng.uniform(-0.3, 0.3, 3), [0, 0, 0.3])
    end["motion"] = {"travel": {"by": listed(way), "over": 0.8}}
    if feature == "torque of tension":
        end |= {"kind": "clamped", "tangent": [1, 0, 0.8], "normal": [0, 1, 0]}
        tables["ends"]["start"] = {
            "kind": "clamped",
            "position": [0, 0, 0],
            "tangent": [1, 0, -0.5],
            "normal": [0, 1, 0],
        }
    if feature in ("seabed", "soil"):
        tables["environment"]["seabed"]["z"] = -0.3
    more = {"time": {"duration": 1.0, "step": 0.02}, "output": {"every": 0.1, "points": 13, "exact": True}}
    return tables | more | {"dimension": 3}


def of_order(made: Callable[[Rng], Tables]) -> Callable[[Rng], Found]:
    """Observed orders of places (root mean square) in steps and cells that are halved three times, and of energy."""

    def order(rng: Rng) -> Found:
        tables = made(rng)
        time, cells = tables["time"], tables["mesh"]["cells"]
        steps = [hybrid.run(tables | {"time": time | {"step": time["step"] / 2**k}}) for k in range(4)]
        finer = [steps[0], *(hybrid.run(tables | {"mesh": {"cells": cells * 2**k}}) for k in (1, 2, 3))]
        found = {}
        for name, runs in (("time", steps), ("space", finer)):
            d = [float(np.sqrt(np.mean((a.position - b.position) ** 2))) for a, b in pairwise(runs)]
            found |= {name: float(np.log2(d[1] / d[2])), f"{name} before": float(np.log2(d[0] / d[1]))}
        books = [np.abs(r["work/scheme"]).max() for r in steps]
        found["energy"] = float(np.log2(books[2] / books[3]))
        return f"bends to {steps[-1].curvature.max():.2f} 1/m", found, steps[0]

    return order


# --- runs -----------------------------------------------------------------------------------------------

CONTACT: dict[str, Callable[[Rng], Found]] = {
    "capstan": capstan, "drape": drape, "moving": moving, "sheave": sheave, "ball": ball, "struck": struck,
}  # fmt: skip
SOIL: dict[str, Callable[[Rng], Found]] = {"history": history, "foundation": foundation, "lateral": lateral}
ORDERS = {
    **{f"order of {x}": of_order(partial(beam, law)) for x, law in LAWS.items()},
    **{f"order with {x}": of_order(partial(moved, x)) for x in FEATURES_MOVED},
}
GROUPS = {"contact": CONTACT, "soil": SOIL, "orders": ORDERS, "all": CONTACT | SOIL | ORDERS}
ALL = GROUPS["all"]
SCENES = {"orders": 2, "soil": 15, "contact": 30}  # of each family


def attack(family: str, seeds: range) -> None:
    """Print what each scene of a family gives, and the median and the largest size of each deviation."""
    sizes, refused = defaultdict[str, list[float]](list), 0
    for seed in seeds:
        rng = np.random.default_rng([sum(map(ord, family)), seed])
        try:
            what, checks, result = ALL[family](rng)
        except HybridError as error:
            refused += 1
            print(f"{family} {seed}: {str(error).splitlines()[0]}", flush=True)
            continue
        for name, x in checks.items():
            sizes[name].append(abs(x))
        figures = ", ".join(f"{name} {x:.2g}" for name, x in checks.items())
        print(f"{family} {seed}: {what}: {figures} {sorted({e.kind for e in result.events})}", flush=True)
    figures = ", ".join(f"{name} {np.median(x):.2g} to {max(x):.2g}" for name, x in sizes.items())
    print(f"== {family}, {len(seeds)} scenes, {refused} refused: {figures}", flush=True)


if __name__ == "__main__":
    asked = sys.argv[1] if len(sys.argv) > 1 else "all"
    for name in GROUPS.get(asked, [asked]):
        group = "orders" if name in ORDERS else "soil" if name in SOIL else "contact"
        attack(name, range(*map(int, sys.argv[2:4])) if len(sys.argv) > 3 else range(SCENES[group]))
