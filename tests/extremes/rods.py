"""Rods whose equilibrium has a closed form or an independent solution: boundary layers, elasticas, arcs, own weight."""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache
from typing import Any

import numpy as np
from extreme import AXES, Case, Floats, Measured, X, Y, Z, across, clamped, drawn, each, free, pinned, scene
from lines import ROUND_OFF, G, told
from scipy.integrate import solve_bvp
from scipy.optimize import brentq
from scipy.special import ellipe, ellipk


def rod(L: float, EI: float, mass: float = 1.0, **more: Any) -> dict[str, Any]:
    return {"length": L, "mass": mass, "bending_stiffness": EI, "torsional_stiffness": EI, **more}


@drawn(
    11, 48, EI=(1e-9, 1e6), T=(1e-6, 1e8), ratio=(1e-2, 1e4), angle=[1e-4, 1e-3, 1e-2, 0.03, 0.3],
    n=[10, 40, 200, 2000], axis=list(AXES), model=["rod", "rod", "rod", "zones", "adaptive"],
)  # fmt: skip
def layers(d: dict[str, Any]) -> Iterator[Case]:
    """A clamp pulled a little askew: the angle fades over lambda = sqrt(EI/T), cells are 1e-2 to 1e4 of it."""
    source = (
        "tensioned beam: M(0) = θ sqrt(EI T) tanh(l/λ), aside y(L) = θ (L - λ tanh(l/λ)), θ the angle of the pull, l the length "
        "of the rod; "
        "discretisation: (h/λ)²/4 of the moment while h < λ (at least θ², what linear theory leaves out), the layer λ θ of "
        "the shape; beyond, the moment is not resolved and the result must say so"
    )
    EI, T, angle, n = d["EI"], d["T"], d["angle"], d["n"]
    size = np.sqrt(EI / T)
    h = d["ratio"] * size
    L = float(f"{h * n:.6g}")
    if not 1e-3 <= L <= 1e6:
        T = float(f"{EI * (d['ratio'] * n / np.clip(L, 0.1, 1e4)) ** 2:.6g}")
        size = np.sqrt(EI / T)
        L = float(f"{d['ratio'] * size * n:.6g}")
    along = AXES[d["axis"]]
    side = across(along)

    def truth(result: Any) -> Measured:
        bent = L if d["model"] != "zones" else 0.3 * L  # the rod up to the joint
        moment = angle * np.sqrt(EI * T) * np.tanh(bent / size)
        y = angle * (L - size * np.tanh(bent / size))
        h = L / n / (1 if d["model"] == "rod" else 0.8)
        close = min((h / size) ** 2 / 4 + angle**2 + 1e-5, 0.25)
        found = np.linalg.norm(result.bending_moment[-1, 0]) if "bending_moment" in result.names else 0.0
        yield "moment at the clamp", found / moment - 1, close
        allowed = min(angle**2 + 1e-6, 0.1) * abs(y) + angle * size * close + 2 * angle * h * (h > size)
        yield (
            "aside (m)",
            result.position[-1, -1] @ side - y,
            allowed + 1e-9 * L + (1e-3 * L if d["model"] == "adaptive" else 0),
        )

    tables = scene(
        rod(L, EI), clamped((0, 0, 0), along), free(T * (np.cos(angle) * along + np.sin(angle) * side)), d["model"], n,
    )  # fmt: skip
    must, cause = ("right", "") if d["ratio"] <= 1 else ("warned", "unresolved bend|bending at clamp neglected")
    if d["model"] == "adaptive":  # a clamp that shifts the line by less than the tolerance has no moment
        shift = size * angle / L / 1e-3
        if 0.5 < shift < 2:
            return
        must = "warned" if shift < 1 else must
        cause = "bending at clamp neglected|unresolved bend"
    name = told(EI=EI, T=T, **{"h/λ": d["ratio"]}, angle=angle, L=f"{L:.3g}", n=n, axis=d["axis"])
    yield Case("boundary layers", name, d["model"], tables, truth, source, must, cause)


@lru_cache
def column(part: float) -> tuple[float, float]:
    """x and y of the end, per length, of a clamped column under `part` > 1 times its Euler load (Love, art. 263)."""
    k = float(brentq(lambda k: (2 * ellipk(k * k) / np.pi) ** 2 - part, 1e-9, 1 - 1e-13, xtol=1e-15))
    return float(2 * ellipe(k * k) / ellipk(k * k) - 1), float(2 * k / ellipk(k * k))


@drawn(
    12, 40, EI=(1e-9, 1e6), L=(0.1, 1e4), part=[0.01, 0.5, 0.98, 1.05, 1.3, 2.0, 5.0], n=[10, 40, 160, 1000], axis=list(AXES),
    model=["rod", "rod", "adaptive", "catenary"],
)  # fmt: skip
def columns(d: dict[str, Any]) -> Iterator[Case]:
    """A rod clamped at one end, pressed at the other along every axis: straight below Euler's load, an elastica above."""
    source = (
        "Euler's column: straight below π² EI/(4 L²), above it the elastica (Love, elliptic integrals); discretisation: order "
        "2, 0.5/n² L, near the bifurcation 0.5/n²/(P/P_E - 1) L; straight: round-off 1e-12"
    )
    L, EI, part, n = d["L"], d["EI"], d["part"], d["n"]
    P = part * np.pi**2 * EI / (4 * L * L)
    along = AXES[d["axis"]]

    def truth(result: Any) -> Measured:
        tip = result.position[-1, -1] / L
        x = tip @ along
        if part < 1:
            yield "end/L", np.abs(tip - along).max(), ROUND_OFF
            return
        exact = column(part)
        allowed = 0.5 / n**2 * max(1.0, 1 / (part - 1)) * (1 + part / 5)
        yield "end along/L", x - exact[0], allowed
        yield "end aside/L", np.linalg.norm(tip - x * along) - exact[1], allowed

    tables = scene(rod(L, EI), clamped((0, 0, 0), along), free(-P * along), d["model"], n)
    tables["initial"] = {"kind": "equilibrium", "guess": "straight", "direction": along.tolist()}
    must = "refused" if d["model"] == "catenary" else "right"
    name = told(EI=EI, L=L, **{"P/P_E": part}, n=n, axis=d["axis"])
    yield Case(
        "columns",
        name,
        d["model"],
        tables,
        truth,
        source,
        must,
        "goes into compression|no unique solution|did not converge",
    )


@each((1 - 1e-6, 1 - 1e-3, 0.9, 0.5, 0.1, 0.0), ((1e-9, 0.1), (1.0, 10.0), (1e6, 1e4)), ("rod", "adaptive", "catenary"))
def pressed(apart: Any, given1: Any, model: Any) -> Iterator[Case]:
    """Both ends pinned and brought together, until they coincide: the elastica between two points."""
    source = (
        "elastica between pins: distance (2 E/K - 1) L, height k L/K, force 4 K² EI/L² (Love); discretisation: 1/n² of L "
        "and 4/n² of the force; a catenary has no tension there"
    )
    EI, L = given1
    axis = ("+x", "-y", "+z")[len(model) % 3]
    along, n = AXES[axis], 60
    k = float(brentq(lambda k, a=apart: 2 * ellipe(k * k) / ellipk(k * k) - 1 - a, 1e-9, 1 - 1e-12, xtol=1e-15))

    def truth(result: Any) -> Measured:
        r, K = result.position[-1], ellipk(k * k)
        aside = np.linalg.norm(r - np.outer(r @ along, along), axis=1).max() / L
        if not np.any(r[-1]):  # a loop in a plane of its own choice
            aside = np.linalg.norm(r, axis=1).max() / L
        yield "height/L", aside - k / K, 1 / n**2
        force = np.linalg.norm(result.reaction_start[-1]) / (4 * K * K * EI / L**2)
        yield "force", force - 1, 4 / n**2

    tables = scene(rod(L, EI), pinned(), pinned(apart * L * along), model, n)
    must = "refused" if model == "catenary" else "right"
    cause = "nothing tautens it" if apart < 0.999 else "goes into compression|no unique solution"
    name = told(EI=EI, L=L, apart=f"{apart:g} L", axis=axis)
    yield Case("pressed together", name, model, tables, truth, source, must, cause)


@drawn(
    13, 36, EI=(1e-9, 1e6), L=(0.1, 1e4), degrees=[1.0, 10.0, 90.0, 180.0, 270.0, 360.0], n=[8, 40, 200], axis=list(AXES),
    model=["rod", "rod", "adaptive"],
)  # fmt: skip
def arcs(d: dict[str, Any]) -> Iterator[Case]:
    """Clamps that ask for a circular arc: from a degree to a closed ring, the fold of 180 degrees among them."""
    source = (
        "a circle, M = EI θ/L everywhere, no force; discretisation: a polygon of chords h is (θ/n)²/6 too short of its "
        "arc, which moves a flat arc by a part 1/n² of its height θ L/8: L ((θ/n)²/5 + 0.15 θ/n²) on the shape, "
        "0.5 (θ/n)² + 20/n² on the moment"
    )
    L, EI, n, angle = d["L"], d["EI"], d["n"], np.radians(d["degrees"])
    along = AXES[d["axis"]]
    side = across(along)

    def shape(s: Floats, L: float = L, a: float = angle, u: Floats = along, v: Floats = side) -> Floats:
        return L / a * (np.outer(np.sin(a * s / L), u) + np.outer(1 - np.cos(a * s / L), v))

    end = np.cos(angle) * along + np.sin(angle) * side

    def truth(result: Any) -> Measured:
        yield (
            "shape/L",
            np.abs(result.position[-1] - shape(result.s)).max() / L,
            (angle / n) ** 2 / 5 + 0.15 * angle / n**2 + 1e-8,
        )
        moment = np.abs(result.bending_moment[-1] / (EI * angle / L) - 1).max()
        yield "moment", moment, 0.5 * (angle / n) ** 2 + 20 / n**2 + 1e-6

    guess = shape(np.linspace(0, L, n + 1))
    if d["degrees"] == 360.0:
        guess[-1] = 0.0
    tables = scene(rod(L, EI), clamped((0, 0, 0), along), clamped(guess[-1], end), d["model"], n)
    tables["initial"] = {"kind": "equilibrium", "points": guess.tolist()}
    name = told(EI=EI, L=L, degrees=d["degrees"], n=n, axis=d["axis"])
    yield Case("arcs and folds", name, d["model"], tables, truth, source)


@lru_cache
def heavy(load: float, angle: float, rod_part: float = 1.0) -> tuple[float, float, float]:
    """End (level, z)/L and root moment M L/EI of a cantilever clamped at `angle` (rad) to the horizontal, w L^3/EI = load.

    theta'' = load (1 - s) cos theta, theta(0) = angle, theta'(l) = 0 by solve_bvp at 1e-9, from a curved start and a
    load that changes in steps; beyond the rod's part l the line hangs from its joint.
    """
    s = np.linspace(0, rod_part, 81)
    fall = (angle + np.pi / 2) * 0.7
    y = np.vstack([angle - fall * (1 - np.exp(-3 * s)), -3 * fall * np.exp(-3 * s)])
    begin = 30.0
    steps = np.geomspace(begin, load, 2 + int(6 * abs(np.log10(load / begin))))
    for w in steps:
        found = solve_bvp(
            lambda s, y, w=w: np.vstack([y[1], w * (1 - s) * np.cos(y[0])]),
            lambda a, b: np.array([a[0] - angle, b[1]]), s, y, tol=1e-8 if w == steps[-1] else 1e-5, max_nodes=200_000,
        )  # fmt: skip
        assert found.success, found.message
        s, y = found.x, found.y
    assert not 1.5 < angle < 1.6 or abs(y[1, 0]) > 0.1, "the column has not buckled"
    fine = np.linspace(0, rod_part, 20_001)
    theta = found.sol(fine)[0]
    below = 1.0 - rod_part
    return float(np.trapezoid(np.cos(theta), fine)), float(np.trapezoid(np.sin(theta), fine)) - below, float(-y[1, 0])


@drawn(
    14, 44, load=(1e-3, 1e4), EI=(1e-9, 1e6), L=(0.1, 1e4), angle=[-np.pi / 2, -0.7, 0.0, 0.0, 0.7, np.pi / 2], turn=[0, 90, 180, 270],
    n=[20, 80, 320], model=["rod", "rod", "adaptive", "zones"],
)  # fmt: skip
def sagging_cantilevers(d: dict[str, Any]) -> Iterator[Case]:
    """A cantilever under its own weight, clamped level, upwards, downwards and between, stiff or limp."""
    source = (
        "the heavy elastica by scipy's solve_bvp at 1e-8 (zones: of the first rod, under what hangs from its joint); "
        "discretisation: order 2, (h/b)²/2 of b = min(L, (EI/w)^(1/3), λ at the clamp) on end and moment, at most 20 %; "
        "beyond, the result must say that the bend is not resolved"
    )
    load, EI, L, n, angle = d["load"], d["EI"], d["L"], d["n"], d["angle"]
    if angle > 1.5 and (7.0 < load < 9.0 or d["model"] == "zones"):
        return  # right at Greenhill's bifurcation, 7.837; and a catenary that stands
    mass = load * EI / L**3 / G
    level = np.cos(np.radians(d["turn"])) * X + np.sin(np.radians(d["turn"])) * Y
    level[np.abs(level) < 1e-12] = 0.0
    tangent = np.round(np.cos(angle), 12) * level + np.sin(angle) * Z
    edge = min(1.0, load ** (-1 / 2))
    upright = angle > 1.5 and load < 7.8
    part = 0.3 if d["model"] == "zones" else 1.0

    def truth(result: Any) -> Measured:
        x, z, moment = (0.0, 1.0, 0.0) if upright else heavy(load, angle, part) if angle > -1.5 else (0.0, -1.0, 0.0)
        tip = result.position[-1, -1] / L
        close = min(0.5 * (1 / n / edge) ** 2 + 1e-6, 0.2)
        shift = 1e-3 if d["model"] == "adaptive" else 0.0
        near = 3 / abs(load - 7.837) + 1 if angle > 1.5 and not upright else 1.0  # the amplitude is soft near Greenhill
        yield (
            "end/L",
            max(abs(np.hypot(tip[0], tip[1]) - abs(x)), abs(tip[2] - z)),
            close * min(1.0, load) * near + 1e-7 + shift,
        )
        if moment:
            found = np.linalg.norm(result.bending_moment[-1, 0]) * L / EI
            yield (
                "moment at the clamp",
                found / abs(moment) - 1,
                min(close * near, 0.2) + (0.02 if d["model"] == "adaptive" else 0.0),
            )

    tables = scene(rod(L, EI, mass), clamped((0, 0, 0), tangent), free(), d["model"], n, G)
    if 0.5 < n * edge < 1.2 and d["model"] != "adaptive" and angle > -1.5:
        return  # between resolved and not
    must, cause = (
        ("right", "") if n * edge > 1 or angle < -1.5 or d["model"] == "adaptive" else ("warned", "unresolved bend")
    )
    name = told(**{"w L³/EI": load}, EI=EI, L=L, angle=f"{np.degrees(angle):.0f} deg", turned=d["turn"], n=n)
    yield Case("heavy cantilevers", name, d["model"], tables, truth, source, must, cause)


@drawn(
    15, 36, EI=(1e-9, 1e6), L=(0.1, 1e4), ratio=(1e-2, 1e3), angle=[1e-3, 1e-2, 0.05], n=[20, 100, 1000], model=["rod", "rod", "adaptive"],
)  # fmt: skip
def points(d: dict[str, Any]) -> Iterator[Case]:
    """A weight in the middle of a taut rod, pinned at one end and pulled at the other: the kink is rounded over lambda on either side, cells are finer or coarser."""
    source = (
        "tensioned beam under a point load: M = θ sqrt(EI T) tanh(L/(2 λ)), θ = Q/(2 T) half the kink; discretisation: "
        "(h/λ)²/4 of the moment while h < λ, and 5 θ² for linear theory; beyond, the result must say so"
    )
    EI, L, n, angle = d["EI"], d["L"], d["n"], d["angle"]
    if 0.7 < d["ratio"] < 1.5:
        return  # between resolved and not
    size = L / n / d["ratio"]
    T = EI / size**2
    load = 2 * T * angle
    line = rod(L, EI, 1e-9 * load / G / L)

    def truth(result: Any) -> Measured:
        moment = angle * np.sqrt(EI * T) * np.tanh(L / 2 / size)
        found = result.bending_moment[-1][50] if "bending_moment" in result.names else 0.0
        yield "moment at the load", found / moment - 1, min((L / n / size) ** 2 / 4 + 5 * angle**2 + 1e-5, 0.25)

    tables = scene(line, pinned(), free(T * X), d["model"], n, G)
    tables["cable"]["attachments"] = [{"kind": "clump", "at": L / 2, "mass": load / G}]
    must = "right" if d["ratio"] < 1 else "warned"
    if d["model"] == "adaptive":
        must = "right or warned"
    name = told(EI=EI, L=L, T=f"{T:.2g}", slope=angle, **{"h/λ": d["ratio"]}, n=n)
    yield Case(
        "point loads", name, d["model"], tables, truth, source, must, "unresolved bend|bending at point load neglected"
    )


CASES = [*layers(), *columns(), *pressed(), *arcs(), *sagging_cantilevers(), *points()]
