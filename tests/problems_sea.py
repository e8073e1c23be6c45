"""The gallery by the sea: currents, waves, the surface, the seabed, what hangs on a cable, with known answers.

As in tests/problems.py every problem is a function that returns a `hybrid.Scene`; its docstring gives the exact
solution, or says which independent one stands beside it, the tolerance and the reason for it.  SI units, z up.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray
from problems import ORIGIN, elastic_catenary, free, pinned
from scipy.integrate import quad, solve_bvp, solve_ivp
from scipy.optimize import brentq, root

import hybrid
from hybrid import Scene
from hybrid.kernels.laws.seabed import contact
from hybrid.scene.wave_theory import wavenumber

Floats = NDArray[np.float64]
Table = dict[str, Any]
RHO, G = 1025.0, 9.81


# --- how a problem is written down -------------------------------------------------------------


def sea_scene(
    sections: Table | Sequence[Table],
    start: Table | str,
    end: Table | str,
    *,
    fluid: Table | None = None,
    seabed: Table | None = None,
    attachments: Sequence[Table] = (),
    model: str | Sequence[Table] = "catenary",
    cells: int | None = None,
    initial: Any = "equilibrium",
    slack: str = "stop",
    **tables: Any,
) -> Scene:
    """A scene of one or more sections; `model` is a kind or a list of zones; what is not given is absent."""
    environment = {k: v for k, v in (("fluid", fluid), ("seabed", seabed)) if v is not None}
    kind: Table = {"kind": model} if isinstance(model, str) else {"kind": "zones", "zones": list(model)}
    if slack != "stop" and model != "rod":
        kind["slack"] = slack
    if cells is not None:
        tables["mesh"] = {"cells": cells}
    cable: Table = {"sections": [sections] if isinstance(sections, dict) else list(sections)}
    if attachments:
        cable["attachments"] = list(attachments)
    return hybrid.validate_scene(
        {"environment": environment, "cable": cable, "ends": {"start": start, "end": end}, "initial": initial,
         "model": kind} | tables
    )  # fmt: skip


def in_water(mass: float, diameter: float, rho: float = RHO) -> float:
    """Weight in water per length, N/m."""
    return (mass - rho * math.pi / 4 * diameter**2) * G


def wet_part(x: float) -> float:
    """Wetted part of a point with wetness coordinate x (docs/theory.md): x^2 (3 - 2 x)."""
    x = min(max(x, 0.0), 1.0)
    return x * x * (3.0 - 2.0 * x)


def height_when_wet(part: float, extent: float) -> float:
    """Height over the surface at which a point of that vertical extent has this wetted part."""
    return (0.5 - brentq(lambda x: wet_part(x) - part, 0.0, 1.0, xtol=1e-15)) * extent


# --- statics: the seabed -------------------------------------------------------------------------

MOORING: Table = {
    "length": 250.0, "mass": 20.0, "diameter": 0.05, "axial_stiffness": 2e8,
    "drag": {"normal": 1.2, "tangential": 0.05}, "added_mass": {"normal": 1.0},
}  # fmt: skip
SPAN, DEPTH = 205.0, 100.0


def resting_line(cells: int, stiffness: float, axial_stiffness: float | None = 2e8) -> Scene:
    """250 m of cable between an anchor on the bed and a point 100 m higher, 205 m away: `grounded_catenary`.

    On a stiff bed the polygon is off by the touchdown that may stand anywhere in a cell, a part (w h/H)^2/8 of the
    sag of a cell and of either sign: 5e-5 of the tension at 100 cells of 2.5 m, and no clean order.
    A soft bed lengthens the drop by `sunk` w/k.
    """
    section = {k: v for k, v in MOORING.items() if k != "axial_stiffness"}
    if axial_stiffness:
        section["axial_stiffness"] = axial_stiffness
    return sea_scene(
        section, pinned(0, 0, -DEPTH), pinned(SPAN, 0, 0), cells=cells, fluid={"density": RHO},
        seabed={"z": -DEPTH, "stiffness": stiffness},
    )  # fmt: skip


# A flexible line at rest has dT/dz = w - (force of the bed per length), so T = H + w (z + sunk w/k) above a soft bed: sunk =
# 1 - k^2/w^2 (int of P over the w/k + o/2 that it sinks), P = p^2/(2 o) up to the onset o = w/(2 k), then p - o/2.
# (Without an onset it would be 1/2.)  That, as a deeper bed, is exact but for (slope at the bed)^3 H/w.
SUNK = 1.0 - (1.25**2 / 2 - 0.5 * 1.25 / 2 + 0.5**2 / 6)


def grounded_catenary(
    drop: float, length: float, span: float, w: float, axial_stiffness: float | None
) -> tuple[float, float, float]:
    """(H, suspended length, tension at the top) of an elastic cable that lies on a rigid, frictionless bed for a part.

    The suspended part is an elastic catenary with a level tangent at touchdown (Irvine 1981), the grounded part is
    stretched by H: x = (H/w) asinh(w s/H) + H s/EA + (L - s)(1 + H/EA), z = (H/w)(sqrt(1 + (w s/H)^2) - 1) + w s^2/(2 EA).
    """
    c = 1.0 / axial_stiffness if axial_stiffness else 0.0

    def lifted(H: float) -> float:
        return brentq(
            lambda s: math.hypot(H / w, s) - H / w + 0.5 * w * s * s * c - drop, 0.0, length + drop, xtol=1e-13
        )

    def reach(log_H: float) -> float:
        H = math.exp(log_H)
        s = lifted(H)
        return H / w * math.asinh(w * s / H) + H * s * c + (length - s) * (1 + H * c) - span

    H = math.exp(brentq(reach, math.log(1e-3 * w * length), math.log(w * length), xtol=1e-14))
    s = lifted(H)
    return H, s, math.hypot(H, w * s)


LAYER_H, LAYER_BED = 1000.0, 10.0  # N; lambda over the bed's own length (EI/k)^(1/4)
# eps = lambda w/H -> reaction/(w lambda), extra suspended length/lambda, largest curvature/(w/H) (shared/validation.md)
LAYER_PUBLISHED = {0.2: (0.9782, 0.988, 0.8061), 0.05: (0.9982, 1.0001, 0.9562), 0.01: (0.9999, 1.0003, 0.9953)}


def lift_off(eps: float, cells_per_lambda: int) -> tuple[Scene, float, float]:
    """A rod with lambda = sqrt(EI/H) = 1 m that lies 15 m long and is then lifted by (H, V) until it is steep (V/H = 5).

    Exact on a rigid, frictionless bed: `layer_exact`.  Here k = EI/(lambda/10)^4 = 1e7 N/m2, so that the bed's own
    length, (EI/k)^(1/4), is a tenth of lambda: it spreads the concentrated reaction over some of it, behind the
    lift-off of the centreline by sqrt(2) of it; read with its moment (`concentrated`) it errs by its square, 1e-3.
    Discretisation: 1e-3 at 8 cells per lambda.  Returns the scene, w and k.
    """
    H, w = LAYER_H, eps * LAYER_H
    k = H * LAYER_BED**4
    rest, lies, near = w / k, 15.0, 15.0
    lifted = 5.0 / eps
    q = np.linspace(0.0, lifted, 401)
    t = np.maximum(q - 1.0, 0.0) * eps
    x, z = lies + np.minimum(q, 1.0) + np.arcsinh(t) / eps, (np.sqrt(1.0 + t * t) - 1.0) / eps - rest
    points = [(0.0, 0.0, -rest), *np.column_stack([x, 0.0 * x, z]).tolist()]
    fine, coarse = round((lies + near) * cells_per_lambda), max(8, round(2.0 * (lifted - near)))
    zones = [{"rod": lies + near, "cells": fine}, {"rod": lifted - near, "cells": coarse}]
    s = np.concatenate([np.linspace(0, lies + near, fine + 1), np.linspace(lies + near, lies + lifted, coarse + 1)[1:]])
    what = sea_scene(
        {"length": lies + lifted, "mass": w / G, "bending_stiffness": H}, pinned(0, 0, -rest),
        free(force=[H, 0.0, w * (lifted - 1.0)]), seabed={"z": 0.0, "stiffness": k}, model=zones,
        initial={"kind": "equilibrium", "points": points}, output={"points": s.tolist()},
    )  # fmt: skip
    return what, w, k


def layer_exact(eps: float, far: float | None = None) -> tuple[float, float, float]:
    """Reaction/(w lambda), extra suspended length/lambda and largest curvature/(w/H) of `lift_off` on a rigid bed.

    With s in lambda from the point of lift-off: theta'' = sin theta - eps (s - R) cos theta, theta = theta' = 0 there
    (what lies is straight and has no moment), and far up the decaying solution; solve_bvp at 1e-10.
    The extra length is that over the catenary with the same H at the same height; far up it is R, because both carry V.
    """
    far = far or 10.0 / eps

    def slope(s: Floats, y: Floats, p: Floats) -> Floats:
        return np.vstack([y[1], np.sin(y[0]) - eps * (s - p[0]) * np.cos(y[0]), np.sin(y[0])])

    def ends(a: Floats, b: Floats, p: Floats) -> Floats:
        V = eps * (far - p[0])
        decay = (1 + V * V) ** 0.25
        straight = math.atan(V) - 2 * V * eps**2 / (1 + V * V) ** 2.5
        return np.array([a[0], a[1], a[2], b[1] - eps / (1 + V * V) + decay * (b[0] - straight)])

    s = np.linspace(0.0, far, 2001)
    V = eps * np.maximum(s - 1.0, 0.0)
    first = np.vstack([np.arctan(V), eps / (1 + V * V) * (1 - np.exp(-s)), (np.sqrt(1 + V * V) - 1) / eps])
    found = solve_bvp(slope, ends, s, first, p=[1.0], tol=1e-10, max_nodes=400_000)
    assert found.status == 0
    high = float(found.sol(0.7 * far)[2])
    curvature = found.sol(np.linspace(0.0, min(far, 30.0), 20_001))[1].max()
    return float(found.p[0]), 0.7 * far - math.sqrt(high * high + 2 * high / eps), float(curvature) / eps


def node_contact(result: hybrid.Result, stiffness: float, onset: float, bed: float = 0.0) -> Floats:
    """Force of a level, undamped bed on every node of the last output (whose points are the nodes), N."""
    p, h = bed + 0.5 * onset - result.position[-1][:, 2], np.diff(result.s)
    N = np.zeros(result.s.size)
    for c in np.flatnonzero(np.maximum(p[:-1], p[1:]) > 0.0):
        N[c] += contact(p[c], p[c + 1], 0.0, 0.0, h[c], stiffness, 0.0, onset)[0]
        N[c + 1] += contact(p[c + 1], p[c], 0.0, 0.0, h[c], stiffness, 0.0, onset)[0]
    return N


def concentrated(N: Floats, s: Floats, w: float) -> tuple[float, float]:
    """(place of lift-off, reaction there): what weight w up to there and one force there must be to equal N at s.

    Two equations, force and moment: N_tot = w x + R, sum N s = w x^2/2 + R x.
    """
    total, moment = float(N.sum()), float(N @ s)
    x = (total - math.sqrt(total * total - 2 * w * moment)) / w
    return x, total - w * x


# --- statics: what hangs on a line, and currents ---------------------------------------------------


def loaded_span(cells: int, what: Table, points: Any = 101) -> Scene:
    """A cable of 100 m in water between two points 80 m apart, with a clump or float at 40 m: `loaded_span_exact`.

    Discretisation: order 2; the polygon is off by the sag of its cells, 1e-3 m at 100 cells.
    """
    section = {"length": 100.0, "mass": 2.0, "diameter": 0.03, "axial_stiffness": 1e6}
    return sea_scene(
        section, pinned(0, 0, -50), pinned(80, 0, -30), fluid={"density": RHO}, attachments=[what], cells=cells,
        output={"points": points},
    )  # fmt: skip


CLUMP: Table = {"kind": "clump", "at": 40.0, "mass": 30.0, "volume": 0.01}
FLOAT: Table = {"kind": "float", "at": 40.0, "buoyancy": 150.0, "mass": 5.0}
LOADS = {"clump": (CLUMP, (30.0 - RHO * 0.01) * G), "float": (FLOAT, -150.0)}  # table, force downwards


def loaded_span_exact(load: float, s: Floats) -> tuple[Floats, Floats]:
    """Position (ns, 3) and tension (ns,) of `loaded_span`: two elastic catenaries with one H, V jumping by the load."""
    w, c, L, at = in_water(2.0, 0.03), 1e-6, 100.0, 40.0

    def shape(H: float, V: float, s: Floats) -> tuple[Floats, Floats]:
        after = V - w * at - load
        a = elastic_catenary(np.minimum(s, at), H, V, w, c)
        b = elastic_catenary(np.maximum(s - at, 0.0), H, after, w, c)
        return a[0] + b[0], a[1] + b[1]

    found = root(lambda q: np.ravel(shape(q[0], q[1], np.array([L]))) - [80.0, 20.0], (300.0, 300.0), tol=1e-13)
    assert found.success
    H, V = found.x
    x, z = shape(H, V, s)
    return np.column_stack([x, 0 * x, z - 50.0]), np.hypot(H, w * s - V + load * (s > at))


LOWER: Table = {
    "length": 60.0,
    "mass": 1.0,
    "diameter": 0.05,
    "axial_stiffness": 1e7,
    "drag": {"normal": 1.2, "tangential": 0.02},
}
UPPER: Table = {
    "length": 70.0,
    "mass": 4.0,
    "diameter": 0.05,
    "axial_stiffness": 1e7,
    "drag": {"normal": 1.1, "tangential": 0.03},
}
CURRENTS: dict[str, tuple[Any, Callable[[float], Floats]]] = {
    "still water": (None, lambda z: np.zeros(3)),
    "uniform current": ([0.4, 0.3, 0.0], lambda z: np.array([0.4, 0.3, 0.0])),
    "sheared current": (
        [{"z": 0.0, "velocity": [0.8, 0.5, 0.0]}, {"z": -60.0, "velocity": [0.1, -0.3, 0.0]}],
        lambda z: np.array([0.1 + 0.7 * (1 + z / 60.0), -0.3 + 0.8 * (1 + z / 60.0), 0.0]),
    ),
}  # fmt: skip
TETHER_FLOAT: Table = {"kind": "float", "at": 60.0, "buoyancy": 120.0, "mass": 10.0, "drag_area": 0.4}


def s_tether(cells: int, current: str, float_: bool = False) -> Scene:
    """A tether lighter than water below and heavier above, from the bed to a vessel: an S, bent out of plane by currents.

    Beside `flexible_line`.  Discretisation: order 2, 0.01 m of 130 m and 5e-5 of the force at 130 cells.
    """
    fluid: Table = {"density": RHO}
    if CURRENTS[current][0] is not None:
        fluid["current"] = CURRENTS[current][0]
    return sea_scene(
        [LOWER, UPPER], pinned(0, 0, -60), pinned(60, 0, -2), fluid=fluid, cells=cells,
        attachments=[TETHER_FLOAT] if float_ else [], output={"points": 131},
    )  # fmt: skip


def flexible_line(
    sections: Sequence[Table],
    start: Floats,
    end: Floats,
    velocity: Callable[[float], Floats],
    first: Floats,
    s: Floats,
    bodies: Sequence[tuple[float, Callable[[float], Floats]]] = (),
) -> tuple[Floats, Floats]:
    """Positions and force vectors (ns, 3) of a perfectly flexible line in a current: shooting with scipy alone.

    F' = -(weight in water + Morison drag, normal and tangential, per unstretched length), r' = (1/|F| + 1/EA) F, from
    `start` with the force at the start that hits `end` (root, from `first`); DOP853 at 1e-11.
    bodies: arc length and force on it as a function of height.
    """
    bounds = np.concatenate([[0.0], np.cumsum([x["length"] for x in sections])])
    cuts = sorted({*bounds.tolist(), *(at for at, _ in bodies)})

    def march(F: Floats, at: Floats | None = None) -> Floats:
        y, out = np.concatenate([start, F]), []
        for a, b in pairwise(cuts):
            for where, force in bodies:
                if where == a:
                    y = np.concatenate([y[:3], y[3:] - force(y[2])])
            section = sections[int(np.searchsorted(bounds, 0.5 * (a + b))) - 1]
            D, c, drag = section["diameter"], 1.0 / section["axial_stiffness"], section.get("drag", {})
            normal = 0.5 * RHO * D * drag.get("normal", 0.0)
            tangential = 0.5 * RHO * math.pi * D * drag.get("tangential", 0.0)
            weight = np.array([0.0, 0.0, -in_water(section["mass"], D)])

            def slope(_: float, y: Floats, weight=weight, normal=normal, tangential=tangential, c=c) -> Floats:
                F = y[3:]
                T = np.linalg.norm(F)
                t, U = F / T, velocity(y[2])
                along = U @ t
                across = U - along * t
                load = weight + normal * np.linalg.norm(across) * across + tangential * abs(along) * along * t
                return np.concatenate([(1 / T + c) * F, -load])

            done = solve_ivp(slope, (a, b), y, method="DOP853", rtol=1e-11, atol=1e-9, dense_output=at is not None)
            y = done.y[:, -1]
            if at is not None:
                last = b == cuts[-1]
                out.append(done.sol(at[(at >= a) & ((at < b) | last)]).T)
        return y if at is None else np.vstack(out)

    found = root(lambda F: march(F)[:3] - end, first, tol=1e-11)
    assert np.abs(found.fun).max() < 1e-7
    values = march(found.x, s)
    return values[:, :3], values[:, 3:]


def body_in_current(cells: int) -> Scene:
    """A body of 80 kg on 50 m of cable without drag, in a current: an elastic catenary from the body upwards, with
    H its drag, rho CdA U^2/2, and V its weight in water.  Discretisation: order 2, 1e-3 m at 50 cells."""
    section = {"length": 50.0, "mass": 3.0, "diameter": 0.03, "axial_stiffness": 1e6}
    end = {"kind": "body", "mass": 80.0, "volume": 0.03, "drag_area": 0.6}
    return sea_scene(section, pinned(), end, fluid={"density": RHO, "current": [1.0, 0, 0]}, cells=cells)


def body_in_current_exact(s: Floats) -> tuple[Floats, Floats]:
    """Position (ns, 3) and tension (ns,) of `body_in_current`."""
    w, c, H, V = in_water(3.0, 0.03), 1e-6, 0.5 * RHO * 0.6, (80.0 - RHO * 0.03) * G

    def up(q: Any) -> Floats:
        x, z = elastic_catenary(q, H, -V, w, c)
        return np.array([x, 0 * x, z])

    return (up(50.0 - s) * [[-1], [1], [1]] + (up(50.0) * [1, 1, -1])[:, None]).T, np.hypot(H, V + w * (50.0 - s))


def in_the_air(volume: float) -> Scene:
    """A weight on 5 m of cable, all of it 5 m above the water, over a current: it hangs straight down.

    Round-off: water does nothing to what is not in it, whatever the drag area and the volume.
    """
    section = {"length": 5.0, "mass": 2.0, "diameter": 0.02, "axial_stiffness": 1e6, "drag": {"normal": 1.2}}
    end = {"kind": "body", "mass": 50.0, "volume": volume, "drag_area": 1.0}
    fluid = {"density": RHO, "surface": 0.0, "current": [1.0, 0.0, 0.0]}
    return sea_scene(section, pinned(0, 0, 10), end, fluid=fluid, cells=10)


def floating_cable(part: float, surface: float, model: str) -> Scene:
    """20 m of cable of `part` of the density of water that nothing holds: it floats level, that part of it wetted.

    Round-off: a straight line at (1/2 - x) D over the surface with x^2 (3 - 2 x) = part; half as dense as water, its
    axis is in the surface.
    """
    D = 0.1
    section = {
        "length": 20.0, "mass": part * RHO * math.pi / 4 * D**2, "diameter": D, "axial_stiffness": 1e6,
        "bending_stiffness": 100.0,
    }  # fmt: skip
    start = {"kind": "equilibrium", "points": [[0, 0, surface], [20, 0, surface]]}
    return sea_scene(
        section, "free", "free", fluid={"density": RHO, "surface": surface}, model=model, initial=start, slack="warn"
    )


def floating_buoy(model: str) -> tuple[Scene, float, float]:
    """A buoy at the surface with 30 m of thin cable below it: wetted part = (its weight + the cable's)/(rho g V).

    Round-off, but for what the cable (1 mm thick) displaces above the water: 1e-6 m.  Returns scene, height, tension.
    """
    mass, volume, extent = 200.0, 1.0, 1.2
    section = {"length": 30.0, "mass": 0.02, "diameter": 0.001, "axial_stiffness": 1e7, "bending_stiffness": 10.0}
    pull = 30.0 * in_water(0.02, 0.001)
    what = sea_scene(
        section, "free", {"kind": "body", "mass": mass, "volume": volume, "height": extent}, model=model, cells=60,
        fluid={"density": RHO, "surface": 0.0}, initial={"kind": "equilibrium", "points": [[0, 0, -30], [0, 0, 0]]},
    )  # fmt: skip
    return what, height_when_wet((mass * G + pull) / (RHO * G * volume), extent), pull


# --- steady laying -----------------------------------------------------------------------------------


def towed_line(speed: float, cells: int, by_ship: bool) -> tuple[Scene, float, float]:
    """100 m of cable laid or towed without bottom tension at a ship's speed: straight at the critical angle (Zajac 1957).

    cos a = sqrt(1 + Hc^4/(4 V^4)) - Hc^2/(2 V^2), Hc^2 = 2 w/(rho Cd d); T = w times the height gained.  The shape is the
    same whether the water passes the ship (an equilibrium in a current) or, `by_ship`, the ship sets off and tows the
    cable through still water until it is steady.  Inextensible.  Round-off in the current; what is left of the start
    when towed: 1e-5.  Returns the scene, the angle, w.
    """
    w, d, Cd = in_water(4.0, 0.04), 0.04, 1.3
    H2 = 2 * w / (RHO * Cd * d)
    angle = math.acos(math.sqrt(1 + H2**2 / (4 * speed**4)) - H2 / (2 * speed**2))
    section = {"length": 100.0, "mass": 4.0, "diameter": d, "drag": {"normal": Cd}}
    fluid: Table = {"density": RHO, "surface": 0.0}
    if not by_ship:
        return (
            sea_scene(section, "free", pinned(0, 0, -1), fluid=fluid | {"current": [-speed, 0, 0]}, cells=cells), angle, w,
        )  # fmt: skip
    ship = pinned(0, 0, -1, motion={"velocity": [speed, 0, 0], "ramp": 10.0})
    time = {"duration": 100.0 + 400.0 / speed, "step": 0.5}
    return sea_scene(section, "free", ship, fluid=fluid, cells=cells, time=time, output={"every": 10.0}), angle, w


# --- motion in water -----------------------------------------------------------------------------------

WIRE_D = 0.002
WIRE_M = RHO * math.pi / 4 * WIRE_D**2  # kg/m: weighs nothing in water


def _wire(length: float) -> Table:
    return {"length": length, "mass": WIRE_M, "diameter": WIRE_D, "bending_stiffness": 1.0}


SINKING_ROD: Table = {
    "length": 5.0, "mass": 3.0, "diameter": 0.02, "bending_stiffness": 1.0,
    "added_mass": {"normal": 1.0, "tangential": 0.1}, "drag": {"normal": 1.2, "tangential": 0.01},
}  # fmt: skip
MODULES: Table = {
    "kind": "modules",
    "range": [0, 5],
    "buoyancy": 10.0,
    "mass": 1.5,
    "drag_area": 0.05,
    "added_mass": 2.0,
}
WEIGHT: Table = {"kind": "clump", "at": 2.5, "mass": 4.0, "volume": 0.001, "drag_area": 0.02, "added_mass": 1.5}
SINKERS = ("modules broadside", "modules end-on", "clump end-on", "body alone", "buoyant body alone")


def sinker(what: str, steps: int, times: float) -> tuple[Scene, float, float, float]:
    """Something let go in still water: speed U tanh(t w/(m U)) with U = sqrt(2 w/(rho CdA)), at once w/m.

    What falls: a straight rod in modules (over all of it), a rod with a clump in its middle, end-on, or a body with a
    wire behind it that weighs nothing and has no drag.  Round-off for the first acceleration and the terminal speed.
    `steps` per time m U/w, for `times` of these.  Returns scene, U (m/s, downwards), w/m, m U/w.
    """
    displaced = RHO * math.pi / 4 * 0.02**2
    thin, ends, attachments, model, cells = SINKING_ROD, (free(), free()), [], "rod", 10
    direction = [0, 0, -1]
    if what == "modules broadside":
        direction, attachments = [1, 0, 0], [MODULES]
        w, drag, m = 5 * ((3.0 - displaced) * G - 10.0), 5 * (1.2 * 0.02 + 0.05), 5 * (4.5 + displaced + 2.0)
    elif what == "modules end-on":
        attachments = [MODULES]
        w, drag, m = 5 * ((3.0 - displaced) * G - 10.0), 5 * 0.01 * math.pi * 0.02, 5 * (4.5 + 0.1 * displaced)
    elif what == "clump end-on":
        attachments = [WEIGHT]
        w, drag = (5 * (3.0 - displaced) + 4.0 - RHO * 0.001) * G, 5 * 0.01 * math.pi * 0.02 + 0.02
        m = 5 * (3.0 + 0.1 * displaced) + 5.5
    else:
        mass, volume = (30.0, 0.05) if what.startswith("buoyant") else (50.0, 0.02)
        body = {"kind": "body", "mass": mass, "volume": volume, "drag_area": 0.3, "added_mass": 15.0}
        thin, ends, cells = _wire(4.0), (body, free()), 4
        w, drag, m = (mass - RHO * volume) * G, 0.3, mass + 15.0 + 4.0 * WIRE_M
        direction = [0, 0, 1 if w > 0 else -1]
    U = math.copysign(math.sqrt(abs(w) / (0.5 * RHO * drag)), w)
    scale = m * U / w
    return (
        sea_scene(
            thin, *ends, fluid={"density": RHO}, model=model, cells=cells, attachments=attachments,
            initial={"kind": "straight", "direction": direction, "origin": ORIGIN},
            time={"duration": times * scale, "step": scale / steps}, output={"points": 3, "every": scale / 10},
            dimension=3,  # in a plane it is seen that end-on is not stable
        ), U, w / m, scale,
    )  # fmt: skip


def heaving_body(added_mass: float) -> tuple[Scene, float, float]:
    """A body half under water with a wire below it: small heave at omega^2 = rho g V (3/2)/height / (m + added).

    3/2 is the slope of the wetness law in the middle: the water-plane area is 3/2 V/height; at its draught the added mass
    is the given one (docs/theory.md).  1e-5: the part of the wire that leaves the water.
    rho_inf = 1, to be read with `problems.poles`.  Returns the scene, omega, the speed for 1e-5 of the height, above which
    the added mass falls.
    """
    volume, extent = 1.0, 1.5
    mass = 0.5 * RHO * volume
    omega = math.sqrt(RHO * G * volume * 1.5 / extent / (mass + added_mass + 4.0 * WIRE_M))
    body = {"kind": "body", "mass": mass, "volume": volume, "height": extent, "added_mass": added_mass}
    step = 2 * math.pi / omega / 100
    what = sea_scene(
        _wire(4.0), body, free(), fluid={"density": RHO, "surface": 0.0}, model="rod", cells=4,
        initial={"kind": "straight", "direction": [0, 0, -1], "origin": ORIGIN},
        time={"duration": 400 * step, "step": step, "rho_inf": 1.0},
    )  # fmt: skip
    return what, omega, 1e-5 * extent * omega


def riding_body(period: float) -> tuple[Scene, float]:
    """A light body in waves of 1 m much longer than itself: it stays in the surface.

    It is off by a part (omega/omega_0)^2 of the height at most, less what the water's own acceleration carries it:
    1e-2 is asked for at (omega/omega_0)^2 = 0.003 to 0.011.  Returns the scene and that part.
    """
    volume, extent, added = 0.5, 0.6, 100.0
    mass = 0.5 * RHO * volume
    body = {"kind": "body", "mass": mass, "volume": volume, "height": extent, "added_mass": added, "drag_area": 0.3}
    waves = {"kind": "regular", "height": 1.0, "period": period, "direction": 30.0, "ramp": 4 * period}
    part = (2 * math.pi / period) ** 2 * (mass + added / 2) / (RHO * G * volume * 1.5 / extent)
    what = sea_scene(
        _wire(4.0), body, free(), fluid={"density": RHO, "surface": 0.0, "waves": waves}, model="rod", cells=4,
        initial={"kind": "straight", "direction": [0, 0, -1], "origin": ORIGIN},
        time={"duration": 9 * period, "step": period / 100}, output={"every": period / 20, "points": 3},
    )  # fmt: skip
    return what, part


DRIFT = {"period": 8.0, "amplitude": 0.01}


def drifting(kind: str, z: float, depth: float | None) -> tuple[Scene, float, float]:
    """A body, or a rod along the crests, as heavy as the water it displaces: it moves as the water does, whatever its
    added mass: (m + added) a = (rho V + added) a_water, Morison's inertia and the pressure of the wave together.

    Low waves (0.02 m high, so that depths stay what they are): an ellipse of half axes A cosh(k (z + d))/sinh(k d) and
    A sinh(k (z + d))/sinh(k d), to 1e-3.  Returns scene and the half axes.
    """
    period, amplitude = DRIFT["period"], DRIFT["amplitude"]
    waves: Table = {"kind": "regular", "height": 2 * amplitude, "period": period, "ramp": 4 * period}
    omega = 2 * math.pi / period
    k = wavenumber(omega, depth, G)
    level = up = amplitude * math.exp(k * z)
    if depth:
        waves["depth"] = depth
        level, up = (amplitude * f(k * (z + depth)) / math.sinh(k * depth) for f in (math.cosh, math.sinh))
    section, start = _wire(0.5) | {"added_mass": {"normal": 1.0}}, free()
    if kind == "body":
        start = {"kind": "body", "mass": 0.5 * RHO, "volume": 0.5, "added_mass": 80.0}
    else:
        section = {"length": 3.0, "mass": RHO * math.pi / 4 * 0.04, "diameter": 0.2, "bending_stiffness": 100.0,
                   "added_mass": {"normal": 0.7}}  # fmt: skip
    what = sea_scene(
        section, start, free(), fluid={"density": RHO, "surface": 0.0, "waves": waves}, model="rod", cells=2,
        initial={"kind": "straight", "direction": [0, 1, 0], "origin": [0, 0, z]},
        time={"duration": 7 * period, "step": period / 200}, output={"every": period / 40, "points": 3},
    )  # fmt: skip
    return what, level, up


PILE = {"length": 25.0, "depth": 20.0, "diameter": 0.5, "drag": 1.0, "added": 1.0, "height": 2.0, "period": 8.0}


def taut_pile(cells: int) -> Scene:
    """A line so taut that it hardly moves, from the bed through the surface, in waves and a current: `pile_force`.

    What holds it carries Morison's force: drag, added mass and the pressure of the wave, up to the moving surface.
    Discretisation: order 2 (the trapezoidal rule along the line; the passage through the surface, one diameter, is as
    long as a cell at 50 cells): 1e-3.  Under 1e9 N the line moves by 1e-4 m: 1e-4.
    """
    p = PILE
    section = {
        "length": p["length"], "mass": 3.0, "diameter": p["diameter"], "axial_stiffness": 1e11,
        "drag": {"normal": p["drag"]}, "added_mass": {"normal": p["added"]},
    }  # fmt: skip
    waves = {"kind": "regular", "height": p["height"], "period": p["period"], "ramp": 2 * p["period"]}
    fluid = {"density": RHO, "surface": 0.0, "current": [0.3, 0.0, 0.0], "waves": waves | {"depth": p["depth"]}}
    return sea_scene(
        section, pinned(0, 0, -p["depth"]), pinned(0, 0, 1.01 * p["length"] - p["depth"]), fluid=fluid, cells=cells,
        time={"duration": 5 * p["period"], "step": p["period"] / 160}, output={"every": p["period"] / 40},
    )  # fmt: skip


def pile_force(t: float) -> float:
    """Morison's force (N) along the waves on the pile of `taut_pile`, by quadrature over the wetted height.

    Wheeler's depths; per stretched length (1 % longer than unstretched) for none of the coefficients but the wetness:
    coefficients of the scene are per unstretched length, so the integral is divided by 1.01.
    """
    p = PILE
    A, omega, d, D = 0.5 * p["height"], 2 * math.pi / p["period"], p["depth"], p["diameter"]
    k = wavenumber(omega, d, G)
    eta = A * math.cos(omega * t)
    area = math.pi / 4 * D * D

    def load(z: float) -> float:
        level = math.cosh(k * d * (min(z, eta) + d) / (d + eta)) / math.sinh(k * d)
        u, a = 0.3 + A * omega * level * math.cos(omega * t), -A * omega**2 * level * math.sin(omega * t)
        return wet_part((eta - z) / D + 0.5) * RHO * (0.5 * D * p["drag"] * abs(u) * u + area * (1 + p["added"]) * a)

    return float(quad(load, -d, eta + 0.5 * D, points=[eta, eta - 0.5 * D], limit=200)[0]) / 1.01


# --- friction ------------------------------------------------------------------------------------------

DRY: Table = {"length": 100.0, "mass": 20.0, "diameter": 0.05, "axial_stiffness": 2e8, "bending_stiffness": 2e3}
BED_K, MU_AXIAL, MU_LATERAL = 1e5, 0.3, 0.7
PRESS = DRY["mass"] * G  # N/m
SWAY = 0.5  # 1/s, mass-proportional damping of what is dragged sideways


def dragged(cells: int, model: str, sideways: bool, start: str) -> tuple[Scene, float]:
    """100 m of cable (20 kg/m) on a bed, dragged at 0.1 m/s by one end along itself, or by both ends sideways.

    The pull is mu w L.  Along: round-off (every node slides under mu N, and the sum of all N is the weight); 1e-6.
    Sideways: held taut (0.25 % strain) it bows by less than 2 deg, so 0.1 % of mu w L; 0.2 % with what is left of its
    swaying, which friction does not damp, so there is damping (whose pull is known).  Starts at the depth of rest, w/k.
    """
    depth = -PRESS / BED_K
    far = 100.25 if sideways else 100.0
    points = [[0.0, 0.0, depth], [far, 0.0, depth]]
    motion = {"velocity": [0.0, 0.1, 0.0] if sideways else [0.1, 0.0, 0.0], "ramp": 5.0 if sideways else 2.0}
    moved = [{"kind": "pinned", "position": p, "motion": motion} for p in points]
    mu = MU_LATERAL if sideways else MU_AXIAL
    section = DRY | ({"damping": {"mass": SWAY}} if sideways else {})
    what = sea_scene(
        section, moved[0] if sideways else "free", moved[1], model=model, cells=cells, slack="warn",
        seabed={"z": 0.0, "stiffness": BED_K, "friction": {"axial": MU_AXIAL, "lateral": MU_LATERAL}},
        initial={"kind": start, "points": points},
        time={"duration": 40.0 if sideways else 10.0, "step": 0.1 if sideways else 0.05},
        output={"every": 0.5, "points": 11},
    )  # fmt: skip
    return what, mu * PRESS * 100.0


def on_a_slope(part: float, cells: int, model: str, across: bool, start: str, duration: float) -> tuple[Scene, float]:
    """100 m of cable at rest on a slope of `part` of the friction angle (mu = 0.5), up and down it or across.

    Below 1 it stays: the elastic travel of friction is known at the start (`hold_on`), 1 mm is asked for, 1e-5 m usual.
    Above 1 it slides with g (sin a - mu cos a), exactly: round-off.  Returns the scene and that acceleration.
    """
    mu = 0.5
    slope = math.tan(part * math.atan(mu))
    a = math.atan(slope)
    depth = PRESS * math.cos(a) / BED_K
    first = depth * np.array([math.sin(a), 0.0, -math.cos(a)])
    d = np.array([0.0, 1.0, 0.0]) if across else np.array([math.cos(a), 0.0, math.sin(a)])
    what = sea_scene(
        DRY, "free", "free", model=model, cells=cells, slack="warn",
        seabed={"z": 0.0, "slope": [slope, 0.0], "stiffness": BED_K, "damping": 1e3, "friction": mu},
        initial={"kind": start, "points": [first.tolist(), (first + 100.0 * d).tolist()]},
        time={"duration": duration, "step": 0.1}, output={"every": duration / 20, "points": 11},
    )  # fmt: skip
    return what, G * (math.sin(a) - mu * math.cos(a))


def dropped(stiffness: float, damping: float, step: float) -> Scene:
    """A rod of 10 m and 5 kg/m that falls flat from 0.5 m on a bed: in its 0.32 s of fall there are 32 steps of 10 ms.

    Overdamped beds (damping > 2 sqrt(k m)) and ones that hold what leaves them: it stays down and comes to rest at
    w/k, and no step may make energy of a blow that is shorter than itself.
    """
    section = {"length": 10.0, "mass": 5.0, "diameter": 0.03, "bending_stiffness": 100.0}
    return sea_scene(
        section, "free", "free", model="rod", cells=10, seabed={"z": 0.0, "stiffness": stiffness, "damping": damping},
        initial={"kind": "straight", "direction": [1, 0, 0], "origin": [0, 0, 0.5]},
        time={"duration": 2.0, "step": step}, output={"every": 0.01, "points": 3},
    )  # fmt: skip


# --- touchdown in motion -----------------------------------------------------------------------------------

# top tension over the last three periods: what MoorDyn with 800 segments and CableDyn with 400 elements agree on
TOUCHDOWN = {"mean": 31746.0, "peak": 41315.0, "minimum": 22640.0, "static": 31920.0}


def cells_of(**zones: Sequence[tuple[float, int]]) -> list[Table]:
    """Zones of one kind: catenary=[(length, cells), ...]."""
    return [{kind: length, "cells": n} for kind, parts in zones.items() for length, n in parts]


def touchdown(
    zones: Sequence[Table], step: float, amplitude: float = 2.0, duration: float = 100.0, every: float | None = None,
    bending: bool = False, **more: Any,
) -> Scene:  # fmt: skip
    """`resting_line` on a soft bed (5e3 N/m2), its upper end heaving by 2 m in 8 s: `TOUCHDOWN`.

    The tension at the top nearly vanishes from cell to cell at the touchdown point, where the cable is laid and lifted
    faster than transverse waves run in it (H/m) there: coarse meshes ring (0.5 % at 100 cells).
    """
    section = MOORING | ({"bending_stiffness": 2e3} if bending else {})
    heave = {"heave": {"amplitude": amplitude, "period": 8.0}, "ramp": 16.0}
    return sea_scene(
        section, pinned(0, 0, -DEPTH), pinned(SPAN, 0, 0, motion=heave), model=zones,
        **({"fluid": {"density": RHO}, "seabed": {"z": -DEPTH, "stiffness": 5e3, "damping": 5e2}} | more),
        time={"duration": duration, "step": step}, output={"every": every or step, "points": 3},
    )  # fmt: skip


def top_tension(result: hybrid.Result) -> Floats:
    """Magnitude of the force at the upper end (nt,), N."""
    return np.linalg.norm(result.reaction_end, axis=1)


def touchdown_errors(result: hybrid.Result) -> dict[str, float]:
    """Mean, peak, minimum over 76 < t <= 100, and the start, against `TOUCHDOWN`, relative."""
    T, t = top_tension(result), result.t
    last = T[(t > 76.0 + 1e-9) & (t <= 100.0 + 1e-9)]
    found = {"mean": last.mean(), "peak": last.max(), "minimum": last.min(), "static": T[0]}
    return {name: float(found[name] / TOUCHDOWN[name] - 1) for name in found}


# --- everything at once ------------------------------------------------------------------------------------


def everything(
    kind: str, friction: bool, turn: float = 0.0, away: float = 0.0, swapped: bool = False, split: bool = False,
    step: float = 0.1, duration: float = 12.0, bed_damping: float = 500.0,
) -> tuple[Scene, Floats, Floats]:  # fmt: skip
    """A mooring line with a float, a clump and modules on a sloping bed, in a sheared current and waves, its end moving.

    The same line may be told `turn` degrees about z, `away` metres along the contours of the bed (waves then have
    another phase), from its other end, or with its sections cut in pieces: the same answer, to what Newton may leave
    (tests/test_equivalence.py).  Returns the scene and how its positions came about: matrix (3, 3) and shift (3,).
    """
    c, sn = math.cos(math.radians(turn)), math.sin(math.radians(turn))
    R = np.array([[c, -sn, 0.0], [sn, c, 0.0], [0.0, 0.0, 1.0]])
    rise = np.array([0.05, -0.03, 0.0])
    contour = np.array([-rise[1], rise[0], 0.0]) / np.linalg.norm(rise)
    shift = away * (R @ contour)

    def turned(*x: float) -> list[float]:
        return [float(q) for q in R @ np.array(x)]

    def place(*x: float) -> list[float]:
        return [float(q) for q in R @ np.array(x) + shift]

    period, towards = 9.0, math.radians(30.0 + turn)
    k = wavenumber(2 * math.pi / period, 60.0, G)
    phase = 40.0 - math.degrees(k * (math.cos(towards) * shift[0] + math.sin(towards) * shift[1]))
    waves = {"kind": "regular", "height": 2.0, "period": period, "direction": 30.0 + turn, "phase": phase, "ramp": 8.0}
    current = [{"z": 0, "velocity": turned(0.5, 0.3, 0)}, {"z": -60, "velocity": turned(0.1, -0.2, 0)}]
    bed = {"z": -60.0, "slope": turned(*rise)[:2], "stiffness": 2e4, "damping": bed_damping}
    if friction:
        bed["friction"] = {"axial": 0.3, "lateral": 0.6}
    lower = MOORING | {"length": 100.0, "axial_stiffness": 2e7, "bending_stiffness": 500.0}
    upper = lower | {"length": 60.0, "mass": 8.0, "diameter": 0.07}
    sections = [lower, upper]
    if split:
        sections = [
            lower | {"length": 30.0},
            lower | {"length": 70.0},
            upper | {"length": 25.0},
            upper | {"length": 35.0},
        ]
    ends = [
        pinned(*place(0, 0, -60)),
        pinned(*place(115, 10, 0), motion={"heave": {"amplitude": 1.0, "period": 7.0}, "ramp": 10.0}),
    ]
    zones = {
        "catenary": [("catenary", 100.0, 50), ("catenary", 60.0, 30)],
        "rod": [("rod", 100.0, 50), ("rod", 60.0, 30)],
        "hybrid": [("catenary", 30.0, 10), ("rod", 50.0, 30), ("catenary", 80.0, 40)],
    }[kind]
    at, over = {"float": 110.0, "clump": 60.0}, [120.0, 140.0]
    if swapped:
        ends, sections, zones = ends[::-1], sections[::-1], zones[::-1]
        at, over = {name: 160.0 - s for name, s in at.items()}, [20.0, 40.0]
    attachments = [
        {"kind": "float", "at": at["float"], "buoyancy": 900, "mass": 60, "drag_area": 0.3, "added_mass": 80},
        {"kind": "clump", "at": at["clump"], "mass": 80, "volume": 0.01, "drag_area": 0.05, "added_mass": 10},
        {"kind": "modules", "range": over, "buoyancy": 20, "mass": 5, "drag_area": 0.05, "added_mass": 6},
    ]
    what = sea_scene(
        sections, *ends, fluid={"density": RHO, "surface": 0.0, "current": current, "waves": waves}, seabed=bed,
        attachments=attachments, model=[{name: length, "cells": n} for name, length, n in zones], slack="warn",
        time={"duration": duration, "step": step}, output={"every": 1.0, "points": 40},
    )  # fmt: skip
    return what, R, shift
