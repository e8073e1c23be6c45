"""Lines whose equilibrium has a closed form: taut, hanging, sagging, doubled up, along every axis."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from extreme import AXES, MODELS, Case, Floats, Measured, X, Z, clamped, drawn, each, free, pinned, scene
from problems import elastic_catenary
from scipy.optimize import brentq, root

G = 9.81
ROUND_OFF = 1e-12  # of a length or a tension: straight lines, on which Newton converges to the last digits


def section(L: float, D: float, density: float, EI: float, EA: float | None) -> dict[str, Any]:
    """A section without rotary inertia (zones that move have none)."""
    mass = density * np.pi / 4 * D * D
    return {"length": L, "mass": mass, "diameter": D, "bending_stiffness": EI, "rotary_inertia": 0.0} | (
        {"axial_stiffness": EA} if EA else {}
    )


def told(**values: Any) -> str:
    """Parameters in words."""
    return ", ".join(f"{k} {v:g}" if isinstance(v, float | int) else f"{k} {v}" for k, v in values.items())


@drawn(
    1, 40, EI=(1e-9, 1e6), EA=[None, (1e3), 1e5, 1e7, 1e9, 1e12], T=(1e-6, 1e8), L=(0.1, 1e4), D=(1e-4, 1.0),
    n=[4, 5, 10, 33, 100, 400, 1000, 20_000], axis=list(AXES), model=list(MODELS),
)  # fmt: skip
def taut(d: dict[str, Any]) -> Iterator[Case]:
    """No weight, a pull T along an axis: straight, stretched by T/EA."""
    source = "straight, r = s (1 + T/EA), T everywhere; round-off: 1e-12 of length and tension"
    EA, T, L = d["EA"], d["T"], d["L"]
    along, stretch = AXES[d["axis"]], 1.0 + (T / EA if EA else 0.0)
    line = section(L, d["D"], 7850.0, d["EI"], EA)

    def truth(result: Any) -> Measured:
        exact = stretch * result.s[:, None] * along
        yield "shape/L", np.abs(result.position[-1] - exact).max() / L / stretch, ROUND_OFF
        yield "tension/T", np.abs(result.tension[-1] / T - 1).max(), ROUND_OFF

    tables = scene(line, pinned(), free(T * along), d["model"], d["n"])
    name = told(EI=d["EI"], EA=EA or "inf", T=T, L=L, n=d["n"], axis=d["axis"])
    yield Case("taut lines", name, d["model"], tables, truth, source)


@drawn(
    2, 36, EI=(1e-9, 1e6), EA=[None, 1e4, 1e6, 1e9], L=(0.1, 1e4), D=(1e-4, 1.0), fluid=[0.0, 1e-3, 1.2, 1025.0, 13_534.0],
    density=[20.0, 900.0, 1500.0, 7850.0, 19_300.0], n=[4, 7, 20, 100, 1000], held=["start", "end"], model=list(MODELS),
)  # fmt: skip
def hanging(d: dict[str, Any]) -> Iterator[Case]:
    """A line that hangs (or floats) straight from a pin: T = w (L - s), stretched by w (L s - s^2/2)/EA."""
    source = (
        "T = w (L - s) of the weight in the fluid, r = s + w (L s - s²/2)/EA; round-off: the discrete line has this very "
        "solution at its nodes and middles; 1e-12"
    )
    L, EA, n = d["L"], d["EA"], d["n"]
    line = section(L, d["D"], d["density"], d["EI"], EA)
    w = (d["density"] - d["fluid"]) * np.pi / 4 * d["D"] ** 2 * G
    if EA and abs(w) * L / EA > 0.5:
        return
    first = d["held"] == "start"
    points = np.linspace(0, L, (n if d["model"] != "adaptive" else 10) + 1)

    def truth(result: Any) -> Measured:
        s = result.s if first else L - result.s
        exact = -np.sign(w) * (s + (abs(w) * (L * s - s * s / 2) / EA if EA else 0.0))
        z = result.position[-1] - Z * exact[:, None]
        # between nodes a stretched line is a parabola, and the cubic through its nodes is exact
        yield "shape/L", np.abs(z).max() / L, ROUND_OFF
        yield "tension/(w L)", np.abs(result.tension[-1] - abs(w) * (L - s)).max() / abs(w) / L, ROUND_OFF

    ends = (pinned(), free()) if first else (free(), pinned())
    around = {"fluid": {"density": d["fluid"]}} if d["fluid"] else {}
    output = {"points": points.tolist()} if d["model"] in ("rod", "catenary") and n <= 100 else {"points": 5}
    tables = scene(line, *ends, d["model"], n, G, output=output, **around)
    name = told(EI=d["EI"], EA=EA or "inf", L=L, D=d["D"], fluid=d["fluid"], density=d["density"], n=n, held=d["held"])
    yield Case("hanging lines", name, d["model"], tables, truth, source)


def catenary_force(L: float, w: float, EA: float | None, span: float, rise: float) -> tuple[float, float]:
    """H and V at the start of an elastic catenary (Irvine 1981): from the inextensible or the taut limit by Newton."""
    chord = float(np.hypot(span, rise))
    if chord < 0.9999 * L:
        reach = np.sqrt(L * L - rise * rise) / span
        a = brentq(lambda x: np.sinh(x) / x - reach, 1e-6, 500.0, xtol=1e-15)
        H = w * span / (2 * a)
        V = 0.5 * w * (L - rise / np.tanh(a))
    else:  # chord/L = (1 + T/EA) (1 - (w cos L)^2/(24 T^2))
        load, c = w * L * span / chord, 1.0 / EA if EA else 0.0
        T = float(brentq(lambda T: (1 + T * c) * (1 - (load / T) ** 2 / 24) - chord / L, 0.2 * load, 1e9 * load))
        H, V = T * span / chord, 0.5 * w * L - T * rise / chord

    def miss(q: Floats) -> Floats:
        x, z = elastic_catenary(L, float(np.exp(q[0])), float(q[1] * w * L), w, 1.0 / EA if EA else 0.0)
        return np.array([x - span, z - rise]) / L

    found = root(miss, [np.log(H), V / (w * L)], tol=1e-14)
    assert np.abs(miss(found.x)).max() < 1e-10, "the closed form did not close"
    return float(np.exp(found.x[0])), float(found.x[1] * w * L)


@drawn(
    3, 60, stiff=[1e-12, 1e-10, 1e-8, 1e-6], EA=[None, None, 1e3, 1e5, 1e7], L=(0.1, 1e4), D=(1e-4, 1.0), far=[0.0, 1e3],
    tight=[0.02, 0.3, 0.7, 0.95, 0.999, 0.99999, 1.0001], slope=[-0.7, 0.0, 0.3, 0.7], n=[10, 20, 50, 100, 400, 2000],
    model=list(MODELS),
)  # fmt: skip
def sagging(d: dict[str, Any]) -> Iterator[Case]:
    """A heavy line between two points, from doubled up to as taut as a bar, far from the origin or not."""
    source = (
        "elastic catenary (Irvine 1981); discretisation: the sag of a cell h² w/(8 H) on the shape, (w h/H)²/8 + h/(4 L) w h/T "
        "on the tension; and EI w/H² + sqrt(EI/H) times the slope of a clamp for what bending shifts; floor 1e-7 L"
    )
    L, n, EA_ratio = d["L"], d["n"], d["EA"]
    if d["tight"] > 1.0 and EA_ratio is None:
        return
    n = max(n, 100) if d["tight"] < 0.1 else n  # a fold within a cell is a family of its own
    line = section(L, d["D"], 7850.0, 0.0, None)
    w = line["mass"] * G
    EA = EA_ratio * w * L if EA_ratio else None
    EI = float(f"{d['stiff'] * w * L**3:.3g}")
    line |= {"bending_stiffness": EI} | ({"axial_stiffness": EA} if EA else {})
    span, rise = L * d["tight"] * np.cos(d["slope"]), L * d["tight"] * np.sin(d["slope"])
    H, V = catenary_force(L, w, EA, span, rise)
    start = np.array([d["far"], -d["far"], d["far"]])
    h = L / (n if d["model"] in ("rod", "catenary") else 0.8 * n)
    tip = max(abs(V), abs(w * L - V))

    def truth(result: Any) -> Measured:
        x, z = elastic_catenary(result.s, H, V, w, 1.0 / EA if EA else 0.0)
        exact = start + np.column_stack([x, 0 * x, z])
        bent = EI * w / H**2 * (1.0 if d["model"] != "catenary" else 0.0) + (
            1e-3 * L if d["model"] == "adaptive" else 0.0
        )
        allowed = h * h * w / (8 * H) + bent + 1e-7 * L
        yield "shape (m)", np.abs(result.position[-1] - exact).max(), min(allowed, 0.02 * L)
        share = (w * h / H) ** 2 / 8 + 0.7 * (h / L) ** 2 + 4 * bent * w / H + 1e-6
        yield "pull", np.abs(np.linalg.norm(result.reaction_start[-1]) / np.hypot(H, V) - 1), min(0.05, share)

    tables = scene(line, pinned(start), pinned(start + np.array([span, 0, rise])), d["model"], n, G)
    name = told(
        EI=EI,
        EA=f"{EA:.3g}" if EA else "inf",
        L=L,
        D=d["D"],
        ends=f"{d['tight']} L apart",
        rise=f"{d['slope']} rad",
        n=n,
        H=f"{H:.2g}",
    )
    name += " far" * (d["far"] > 0) + f" sag of a cell {h * w / 8 / H:.1g} h" * (tip > 0)
    yield Case("sagging lines", name, d["model"], tables, truth, source)


# Length, cells, axial stiffness over the weight, and how far apart the ends are, in lengths.
TOGETHER = [(L, n, 1e5, 0.0) for L in (0.1, 10.0, 1e4) for n in (4, 21, 200)]
TOGETHER += [(L, n, None, 0.0) for L in (0.1, 1e4) for n in (21, 200)] + [(9.1, 10, None, 0.02)]


@each(TOGETHER, MODELS)
def doubled(given: Any, model: Any) -> Iterator[Case]:
    """Ends that coincide, or nearly: two strands side by side; the bottom has no tension but half a cell's weight."""
    source = (
        "two strands, z = -min(s, L - s) and T = w |L/2 - s| but for the bend; discretisation: one cell, or for a rod "
        "2 (EI/w)^(1/3), the size of the bend.  A catenary that folds within a cell hangs in a chain of cells under tension "
        "only where a node lies at the bottom, and an inextensible one is statically indeterminate even then"
    )
    L, n, stiff, apart = given
    line = section(L, 1e-3 * L, 7850.0, 0.0, None)
    w = line["mass"] * G
    line["bending_stiffness"] = EI = 1e-8 * w * L**3
    line |= {"axial_stiffness": stiff * w * L} if stiff else {}
    size = max(L / n * 1.3, 2 * (EI / w) ** (1 / 3))

    def truth(result: Any) -> Measured:
        z = result.position[-1][:, 2] + np.minimum(result.s, L - result.s)
        yield "z/L", np.abs(z).max() / L, size / L + 1e-5
        yield "aside/L", np.abs(result.position[-1][:, :2]).max() / L, size / L
        yield "pull/(w L/2)", np.linalg.norm(result.reaction_start[-1]) / (w * L / 2) - 1, 1e-6 + 2 * size / L

    tables = scene(line, pinned(), pinned((apart * L, 0, 0.006 * L * (apart > 0))), model, n, G)
    folds = model in ("catenary", "zones") and (stiff is None or n % 2 == 1)
    must = "refused" if folds else "right"
    name = told(L=L, EA=f"{stiff:g} w L" if stiff else "inf", apart=f"{apart} L", n=n)
    yield Case("ends that coincide", name, model, tables, truth, source, must, "folds within a cell")


@each(("catenary",), (({}, 7850.0), ({"fluid": {"density": 1025.0}}, 1025.0)), (0.0, 0.5, 0.99))
def weightless(model: Any, given1: Any, tight: Any) -> Iterator[Case]:
    """Neutral in the fluid, or no gravity, and longer than its span: nothing says where a flexible line is."""
    source = "no load, no tension: any shape is an equilibrium of a catenary, and none a shape that means anything"
    around, density = given1
    line = section(10.0, 0.02, density, 1.0, 1e6)
    ends = pinned(), pinned(10.0 * tight * X)
    name = told(density=density, fluid=around.get("fluid", {}).get("density", 0), ends=f"{tight} L apart")
    cause = "goes into compression|no unique solution|tension"
    gravity = G if around else 0.0
    tables = scene(line, *ends, model, 20, gravity, **around)
    yield Case("no load at all", name, model, tables, lambda _: [("any", 1.0, 0.5)], source, "refused", cause)


@each((2, 3, 4, 5, 6, 8), (0.5, 0.8, 0.95))
def coarse(n: Any, tight: Any) -> Iterator[Case]:
    """A catenary of 2 to 8 cells: a polygon, as far from the curve as it is, or with a word on it."""
    source = (
        "catenary (Irvine 1981); 2 % of the length: what a cell sags below its chord; beyond, the result must say so"
    )
    L = 10.0
    line = section(L, 0.02, 7850.0, 0.0, None)
    w = line["mass"] * G
    H, V = catenary_force(L, w, None, tight * L, 0.1 * L)

    def truth(result: Any) -> Measured:
        x, z = elastic_catenary(result.s, H, V, w, 0.0)
        yield "shape/L", np.abs(result.position[-1] - np.column_stack([x, 0 * x, z])).max() / L, 0.02

    tables = scene(line, pinned(), pinned((tight * L, 0, 0.1 * L)), "catenary", n, G)
    name = told(n=n, ends=f"{tight} L apart")
    yield Case("coarse meshes", name, "catenary", tables, truth, source, "right or warned", "unresolved bend")


@each(((1e-9, 0.1), (1.0, 10.0), (1e6, 1e4)), AXES.items(), MODELS)
def unloaded(given: Any, given1: Any, model: Any) -> Iterator[Case]:
    """T = 0, no gravity: a rod keeps its shape, a flexible line has none."""
    source = "a rod without load is straight and free of tension, T = 0; a catenary has no answer; round-off 1e-12"
    EI, L = given
    axis, along = given1

    def truth(result: Any) -> Measured:
        yield "shape/L", np.abs(result.position[-1] - result.s[:, None] * along).max() / L, ROUND_OFF
        yield "tension/(EI/L²)", np.abs(result.tension[-1]).max() * L * L / EI, ROUND_OFF

    must = "right" if model in ("rod", "adaptive") else "refused"
    cause = "goes into compression|no unique solution"
    tables = scene(section(L, 0.01, 7850.0, EI, None), clamped((0, 0, 0), along), free(), model, 20)
    yield Case("no tension", told(EI=EI, L=L, axis=axis), model, tables, truth, source, must, cause)


CASES = [*taut(), *hanging(), *sagging(), *doubled(), *weightless(), *coarse(), *unloaded()]
