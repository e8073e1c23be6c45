"""Motions with an exact or an independent solution: flight, sinking, impacts, pendulums, twist, whips, moves."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from extreme import AXES, MODELS, Case, Measured, Z, clamped, drawn, each, free, pinned, scene
from lines import G, section, told
from problems import elastic_catenary
from rods import rod
from scipy.special import ellipj, ellipk

ANYWHERE = {"origin": [0.0, 0.0, 0.0]}


def drift(rho: float) -> float:
    """Relative error of a period over (w dt)^2: beta - 1/6 of generalized-alpha, beta = 1/(1 + rho)^2."""
    return 1.0 / (1.0 + rho) ** 2 - 1.0 / 6.0


def clock(steps: int, step: float, rho: float = 0.5, outputs: int = 4) -> dict[str, Any]:
    """The tables of a motion of so many steps, with a few outputs."""
    time = {"duration": steps * step, "step": step * (1 + 1e-9), "rho_inf": rho}
    return {"time": time, "output": {"every": steps * step / outputs, "points": 11}}


@drawn(
    21, 48, EI=(1e-9, 1e6), EA=[None, None, 1e3, 1e6, 1e12], L=(0.1, 1e4), dt=(1e-6, 10.0), rho=[0.0, 0.3, 0.5, 0.8, 0.95, 1.0],
    n=[4, 20, 100, 1000, 20_000], axis=list(AXES), speed=[0.0, 1.0, 300.0], g=[0.0, 9.81, 9.81], model=list(MODELS),
)  # fmt: skip
def flights(d: dict[str, Any]) -> Iterator[Case]:
    """A straight line thrown and let go in a vacuum: every point falls on its parabola, whatever the step."""
    source = (
        "r = r0 + v t - g t²/2; round-off: the scheme is exact for a constant acceleration; 1e-9 of the way and the length, "
        "as a line may turn by the 1e-9 rad at which Newton stops"
    )
    L, dt, steps = d["L"], d["dt"], 20
    if d["EA"] is None and d["rho"] == 1.0:
        d["rho"] = 0.95  # rho = 1 damps no tension: docs/theory.md, 8, and its own event
    if d["model"] == "adaptive":
        d["n"] = min(d["n"], 1000)  # base cells, of up to 32 rod cells each
    along = AXES[d["axis"]]
    velocity = d["speed"] * np.array([0.6, -0.48, 0.64])
    line = rod(L, d["EI"], 0.1, rotary_inertia=0.0) | ({"axial_stiffness": d["EA"]} if d["EA"] else {})

    def truth(result: Any) -> Measured:
        t = result.times[-1]
        way = velocity * t - 0.5 * d["g"] * t * t * Z
        exact = result.s[:, None] * along + way
        yield "place/(L + way)", np.abs(result.position[-1] - exact).max() / (L + np.linalg.norm(way)), 1e-9

    initial = {"kind": "straight", "direction": along.tolist(), "velocity": velocity.tolist(), **ANYWHERE}
    tables = scene(
        line, free(), free(), d["model"], d["n"], d["g"], initial=initial, slack=True, **clock(steps, dt, d["rho"])
    )
    name = told(
        EI=d["EI"], EA=d["EA"] or "inf", L=L, dt=dt, rho=d["rho"], n=d["n"], axis=d["axis"], v=d["speed"], g=d["g"]
    )
    yield Case("free flight", name, d["model"], tables, truth, source)


@drawn(
    22, 48, L=(0.1, 1e4), D=(1e-4, 1.0), fluid=[1e-3, 1.2, 900.0, 1025.0, 13_534.0], density=[20.0, 1025.0, 1500.0, 7850.0, 19_300.0],
    ratio=(1e-3, 30.0), rho=[0.0, 0.5, 0.8, 1.0], n=[4, 20, 100], model=list(MODELS),
)  # fmt: skip
def sinking(d: dict[str, Any]) -> Iterator[Case]:
    """A straight level line let go in a fluid, from near vacuum to mercury: v = v_end tanh(t g'/v_end), up or down."""
    source = (
        "dv/dt = (w - ½ ρ D C v²)/(m + added), exactly tanh; discretisation: order 2, 2 β (dt/t_end)² of the way, t_end "
        "= v_end/g', at most 20 %, beyond which the result must warn"
    )
    L, D, fluid = d["L"], d["D"], d["fluid"]
    if d["model"] in ("catenary", "zones") and d["ratio"] > 0.1:
        return  # without tension a flexible line crumples; what is left of Newton's tolerance begins it
    area = np.pi / 4 * D * D
    line = section(L, D, d["density"], 1.0, None) | {"drag": {"normal": 1.2}, "added_mass": {"normal": 1.0}}
    weight = (d["density"] - fluid) * area * G
    inertia = (d["density"] + fluid) * area
    end_speed = np.sqrt(2 * abs(weight) / (fluid * D * 1.2))
    time_scale = inertia * end_speed / abs(weight) if weight else 1.0
    dt = float(np.clip(d["ratio"] * time_scale, 1e-6, 10.0))
    steps = 40

    def truth(result: Any) -> Measured:
        t = result.times
        way = -np.sign(weight) * end_speed * time_scale * (np.logaddexp(t / time_scale, -t / time_scale) - np.log(2.0))
        scale = abs(way[-1]) + 1e-6 * L
        yield (
            "way",
            np.abs(result.position[:, :, 2] - way[:, None]).max() / scale,
            min(1e-7 + 2 / (1 + d["rho"]) ** 2 * (dt / time_scale) ** 2, 0.2),
        )

    initial = {"kind": "straight", "direction": [1, 0, 0], **ANYWHERE}
    tables = scene(
        line, free(), free(), d["model"], d["n"], G, fluid={"density": fluid}, initial=initial, slack=True, **clock(steps, dt, d["rho"]),
    )  # fmt: skip
    name = told(
        density=d["density"],
        fluid=fluid,
        D=D,
        L=L,
        dt=f"{dt:.2g} ({dt / time_scale:.2g} t_end)",
        rho=d["rho"],
        n=d["n"],
    )
    yield Case("sinking and rising", name, d["model"], tables, truth, source)


@drawn(
    23, 40, EA=[None, 1e3, 1e4, 1e6, 1e8, 1e12], body=[1.0, 10.0, 1000.0], L=(0.1, 1e4), steps=[3, 4, 30, 100, 1000], EI=(1e-9, 1e3),
    rho=[0.0, 0.5, 0.8, 1.0], n=[4, 20, 50], model=list(MODELS),
)  # fmt: skip
def drops(d: dict[str, Any]) -> Iterator[Case]:
    """A weight let go on a vertical, unstretched elastic line: it is pulled up short with twice its weight."""
    source = (
        "chain of n springs and masses with the body at its end, by its eigenvectors, exact in time; discretisation: of its "
        "first mode order 2 in time, 2 (β - 1/6) (ω dt)² ω t, and what the line's own modes do, 0.2 m/(M + m); four steps a "
        "period and fewer must warn; inextensible: the weight hangs at once"
    )
    L, EA, n, M = d["L"], d["EA"], d["n"], d["body"]
    m = 0.01 * M
    n = n if d["model"] != "adaptive" else 10
    if EA and (M + m) * G / EA > 0.3:
        M, m = 0.1 * EA / G, 0.001 * EA / G
    h = L / n
    mass = np.full(n, m / n)
    mass[-1] = M + 0.5 * m / n
    omega = np.sqrt((EA or 1e15) / L / (M + m / 3))
    dt = 2 * np.pi / omega / d["steps"] if EA else 0.01 * np.sqrt(L)
    if not 1e-6 <= dt <= 10.0:
        return

    def truth(result: Any) -> Measured:
        t = result.times
        if EA is None:
            yield "end/L", np.abs(result.position[:, -1] + L * Z).max() / L, 1e-8
            yield "pull", np.abs(result.tension[1:, -1] / (M * G) - 1).max(), m / M
            return
        k = EA / h
        K = k * (2 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1))
        K[-1, -1] = k
        root_m = np.sqrt(mass)
        squares, shapes = np.linalg.eigh(K / np.outer(root_m, root_m))
        force = shapes.T @ (root_m * G)
        swing = force / squares * (1 - np.cos(np.sqrt(np.abs(squares)) * t[:, None]))
        down = (swing @ shapes.T) / root_m
        static = (M + m) * G * L / EA
        close = min(2 * drift(d["rho"]) * (omega * dt) ** 2 * (1 + omega * t[-1]) + 0.2 * m / (M + m) + 1e-6, 0.35)
        yield "end/stretch", np.abs(-result.position[:, -1, 2] - L - down[:, -1]).max() / static, close
        yield "aside/stretch", np.abs(result.position[:, :, :2]).max() / static, 1e-3

    line = {"length": L, "mass": m / L, "bending_stiffness": d["EI"]} | ({"axial_stiffness": EA} if EA else {})
    tables = scene(
        line, pinned(), {"kind": "body", "mass": M}, d["model"], d["n"], G, initial={"kind": "straight", "direction": [0, 0, -1]},
        **clock(max(round(0.8 * d["steps"]), 3), dt, d["rho"], 3 if d["steps"] < 30 else 8),
    )  # fmt: skip
    must = "warned" if EA and d["steps"] < 10 else "right"
    name = told(
        EA=EA or "inf", EI=d["EI"], M=f"{M:.3g}", L=L, dt=f"{dt:.2g} ({d['steps']} a period)", rho=d["rho"], n=d["n"]
    )
    yield Case("snap loads", name, d["model"], tables, truth, source, must, "coarse step")


@drawn(
    24, 40, L=(0.1, 1e3), stiff=[1e2, 1e4], swing=[0.01, 0.3, 1.0, 1.57, 2.5], steps=[2, 6, 30, 60, 200, 600], rho=[0.0, 0.5, 0.8, 1.0],
    n=[8, 30], turn=[0.0, 2.0, 4.0], model=["rod", "rod", "adaptive"],
)  # fmt: skip
def pendulums(d: dict[str, Any]) -> Iterator[Case]:
    """A stiff rod on a pin let go at an angle: a physical pendulum of any swing, steps from fine to hopeless."""
    source = (
        "physical pendulum, ω² = 3 g/(2 L), angle by Jacobi's elliptic function; discretisation: n cells have an inertia "
        "1/(2 n²) too large, and order 2 in time: 2 (β - 1/6) (ω dt)² ω t of the swing (over cos² of half of it, which turns "
        "faster below), at most 35 %, where the result begins to warn; with seven steps a period and fewer what is worse must warn or stop"
    )
    L, a, n = d["L"], d["swing"], d["n"]
    if a > 2 and d["steps"] >= 10:
        d["steps"] = max(d["steps"], 200)
    omega = np.sqrt(1.5 * G / L)
    k = np.sin(a / 2)
    period = 4 * ellipk(k * k) / omega
    dt = period / d["steps"]
    if not 1e-6 <= dt <= 10:
        return
    level = np.array([np.cos(d["turn"]), np.sin(d["turn"]), 0.0])
    along = np.sin(a) * level - np.cos(a) * Z
    line = rod(L, d["stiff"] * 0.1 * G * L**3, 0.1, rotary_inertia=0.0)

    def truth(result: Any) -> Measured:
        t = result.times
        sn = ellipj(ellipk(k * k) - omega * t, k * k)[0]
        angle = 2 * np.arcsin(k * sn)
        r = result.position[:, -1]
        found = np.unwrap(np.arctan2(r @ level, -r[:, 2]))
        period = 2 * drift(d["rho"]) * (omega * dt) ** 2 / np.cos(a / 2) ** 2 + 0.5 / n**2 + 0.1 / d["stiff"]
        yield "angle/swing", np.abs(found - angle).max() / a, min(period * (1 + omega * t[-1]), 0.35)
        if dt > 1 / omega and result["steps/dt"].max() > 0.9 * dt:
            yield "steps of a radian", omega * dt, 0.5

    tables = scene(
        line, pinned(), free(), d["model"], n, G, initial={"kind": "straight", "direction": along.tolist()},
        **clock(max(2, d["steps"]), dt, d["rho"], min(12, max(2, d["steps"]))),
    )  # fmt: skip
    name = told(
        L=L, EI=f"{line['bending_stiffness']:.2g}", swing=a, dt=f"{dt:.2g} ({d['steps']} a period)", rho=d["rho"], n=n
    )
    must = "right" if d["steps"] > 10 else "right or warned or refused"
    yield Case(
        "pendulums",
        name,
        d["model"],
        tables,
        truth,
        source,
        must,
        "coarse step|numerical dissipation|gains energy|creates energy|turned by more|did not converge",
    )


@drawn(
    25, 40, turns=[0.1, 0.5, 3.0, 10.0, 50.0], n=[8, 20, 60, 200], EI=(1e-9, 1e6), L=(0.1, 1e4), part=[0.1, 0.5, 0.9, 1.5], axis=list(AXES),
    model=["rod", "rod", "rod", "adaptive"],
)  # fmt: skip
def twists(d: dict[str, Any]) -> Iterator[Case]:
    """A taut shaft clamped at both ends, one of them rolled by up to 50 turns."""
    source = (
        "M = GJ θ/L while it is straight, and straight is stable below Greenhill's 2 sqrt(EI T); round-off 1e-9; more than "
        "2 rad a cell: stopped; beyond Greenhill: an event says that only symmetry keeps it straight"
    )
    EI, L, turns, n = d["EI"], d["L"], d["turns"], d["n"]
    angle = 2 * np.pi * turns
    torque = EI * angle / L
    T = (torque / d["part"]) ** 2 / (4 * EI)
    along = AXES[d["axis"]]
    which, sign = {"x": "roll", "y": "pitch", "z": "yaw"}[d["axis"][1]], 1.0 if d["axis"][0] == "+" else -1.0
    steps = max(80, int(25 * turns))  # within a radian a step at the most; longer ones are cut

    def truth(result: Any) -> Measured:
        if d["part"] > 1:
            yield "beyond Greenhill", d["part"], 1.0
            return
        exact = result.s[:, None] * along
        yield "shape/L", np.abs(result.position[-1] - exact * (1 + 1e-7)).max() / L, 1e-9
        yield "torque", np.abs(np.abs(result.torque[-1]) / torque - 1).max(), 1e-9

    end = clamped(
        (1 + 1e-7) * L * along,
        along,
        motion={which: {"amplitude": sign * np.degrees(angle), "period": 4.0}, "ramp": 1.0},
    )
    line = rod(L, EI, T / L, axial_stiffness=1e7 * T, rotary_inertia=0.0)
    tables = scene(line, clamped((0, 0, 0), along), end, d["model"], n, **clock(steps, 1.0 / steps))
    must, cause = "right", ""
    if d["part"] > 1 and turns < 3:
        return  # short of ten λ a clamped rod bears more than Greenhill's torque
    if d["part"] > 1:
        must, cause = "warned or refused", "unstable|twist from one cell to the next"
    if angle / n > 2.0 and d["model"] == "rod":
        must, cause = "refused", "twist from one cell to the next"
    name = told(EI=EI, L=L, turns=turns, T=f"{T:.2g}", **{"M/Greenhill": d["part"]}, n=n, axis=d["axis"])
    yield Case("twist of many turns", name, d["model"], tables, truth, source, must, cause)


@drawn(
    26, 24, L=(0.1, 1e4), stiff=[1e-9, 1e-7], tight=[0.5, 0.8, 0.95], to=[0.3, 0.6, 0.9], n=[20, 60], rho=[0.0, 0.5, 0.8], EA=[None, 1e4],
    model=list(MODELS),
)  # fmt: skip
def moves(d: dict[str, Any]) -> Iterator[Case]:
    """A hanging line whose end is moved and comes to rest under damping: the catenary of its new place."""
    from lines import catenary_force

    source = (
        "elastic catenary of the last place; discretisation: as at rest, 0.7/n² on the pull, the sag of a cell on the shape, "
        "EI w/H² for bending, and 1e-3 of what is still moving (30 damping times)"
    )
    L, n = d["L"], d["n"]
    w = 1.0 * G
    EI, EA = d["stiff"] * w * L**3, d["EA"] and d["EA"] * w * L
    beat = np.sqrt(L / G)
    line = {"length": L, "mass": 1.0, "bending_stiffness": EI, "damping": 3.0 / beat, "rotary_inertia": 0.0} | (
        {"axial_stiffness": EA} if EA else {}
    )
    H, V = catenary_force(L, w, EA, d["to"] * L, 0.1 * L)

    def truth(result: Any) -> Measured:
        x, z = elastic_catenary(result.s, H, V, w, 1.0 / EA if EA else 0.0)
        h = L / n / (0.8 if d["model"] in ("zones", "adaptive") else 1.0)
        bent = (EI * w / H**2 if d["model"] != "catenary" else 0.0) + (1e-3 * L if d["model"] == "adaptive" else 0.0)
        allowed = h * h * w / (8 * H) + bent + 1e-3 * L
        yield (
            "shape/L",
            np.abs(result.position[-1] - np.column_stack([x, 0 * x, z])).max() / L,
            min(allowed / L, 0.02),
        )

    by = np.array([(d["to"] - d["tight"]) * L, 0.0, 0.1 * L])
    end = pinned((d["tight"] * L, 0, 0), motion={"travel": {"by": by.tolist(), "over": 10 * beat}})
    tables = scene(line, pinned(), end, d["model"], n, G, **clock(300, 30 * beat / 300, d["rho"]))
    name = told(
        L=L, EI=f"{EI:.2g}", EA="inf" if not EA else f"{EA:.2g}", ends=f"{d['tight']} to {d['to']} L", n=n, rho=d["rho"]
    )
    yield Case("moves to rest", name, d["model"], tables, truth, source)


@each((0.1, 10.0, 1e4), (2e-4, 1e-3), ("rod", "zones", "adaptive", "catenary"))
def impacts(L: Any, dt: Any, model: Any) -> Iterator[Case]:
    """A slack line pulled taut at speed: without stretch the impact has no peak that steps and cells could find."""
    source = "what does not stretch stops at once, at an infinite force: no answer but one that says so"
    beat = np.sqrt(L / G)
    end = pinned((0.7 * L, 0, 0), motion={"travel": {"by": [0.295 * L, 0, 0], "over": 0.5 * beat}})
    line = rod(L, 1e-7 * G * L**3, 1.0, rotary_inertia=0.0)
    tables = scene(line, pinned(), end, model, 30, G, **clock(round(0.7 / dt), dt * beat, 0.5, 30))
    name = told(L=L, dt=f"{dt:g} sqrt(L/g)")
    cause = "snap|energy|goes into compression"
    yield Case(
        "inextensible impacts", name, model, tables, lambda _: [("any", 1.0, 0.5)], source, "warned or refused", cause
    )


@each((0.1, 10.0, 1e4), (1e3, 1e5), ("rod", "adaptive", "catenary"))
def presses(L: Any, stiff: Any, model: Any) -> Iterator[Case]:
    """A straight rod between pins that are moved together: it stays straight by symmetry alone, and that must be said."""
    source = "a straight rod bears π² EI/L² between pins; pressed beyond, it is straight only in a computation"
    EI = 1.0
    EA = stiff * EI / L**2
    beat = np.sqrt(L * L / (EI / L**2))
    end = pinned((L, 0, 0), motion={"travel": {"by": [-0.1 * L, 0, 0], "over": 2 * beat}})
    line = rod(L, EI, 1.0, axial_stiffness=EA, damping=3.0 / beat, rotary_inertia=0.0)
    initial = {"kind": "straight", "direction": [1, 0, 0]}
    tables = scene(line, pinned(), end, model, 20, 0.0, initial=initial, **clock(300, 6 * beat / 300, 0.5, 6))
    cause = "unstable|out of plane" if model != "catenary" else "goes into compression"
    must = "warned" if model != "catenary" else "refused"
    name = told(L=L, EA=f"{stiff:g} EI/L²")
    yield Case("pressed while straight", name, model, tables, lambda _: [("any", 1.0, 0.5)], source, must, cause)


CASES = [*flights(), *sinking(), *drops(), *pendulums(), *twists(), *moves(), *impacts(), *presses()]
