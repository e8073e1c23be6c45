"""The gallery: problems whose answer is known, and where it is known from.

Every problem is a function that returns a `hybrid.Scene`; its docstring gives the exact or
published solution, the source, the tolerance a test may ask for and the reason for it.
Tolerances are of three kinds:

    round-off       the discrete equations have this very solution; what is left is the
                    arithmetic (1e-16 times what amplifies it) and where Newton stops
                    (1e-9 of a turn or of the tension, usually far less: it converges quadratically)
    discretisation  an order, and a bound at a number of cells or a time step; an observed
                    order above the claim fails as well
    published       the digits printed in the source

SI units; x to the right, z up, unless said.  The cable runs from s = 0 at `start`.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from copy import deepcopy
from itertools import combinations, pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import quad
from scipy.linalg import eigh
from scipy.optimize import brentq, root
from scipy.sparse import csr_array, diags_array
from scipy.special import ellipe, ellipeinc, ellipk, ellipkinc, j0

from hybrid import Scene
from hybrid.errors import Outcome
from hybrid.kernels.algebra.block_elimination import SIZE, WIDTH
from hybrid.kernels.run.newton import assembly, block_rows, workspace
from hybrid.kernels.state.report import PLANAR
from hybrid.kernels.state.state import Ends, Line, State
from hybrid.model.build import Model, build
from hybrid.scene.read import one_line
from hybrid.solve.lines_at_rest import Group, LinesAtRest, lines_at_rest
from hybrid.solve.network_solver import NetworkSolver
from hybrid.solve.stepper import JoinedLine, NetworkState, NetworkTaken
from tests.scenes import cable_scene

Floats = NDArray[np.float64]
Kick = Callable[[State, Model], None]
ORIGIN = (0.0, 0.0, 0.0)
X, Y, Z = np.eye(3)


# --- how a problem is written down -------------------------------------------------------------


def scene(
    section: dict[str, Any],
    start: dict[str, Any],
    end: dict[str, Any],
    *,
    model: str | list[dict[str, Any]] = "rod",
    cells: int | None = None,
    gravity: float = 0.0,
    **tables: Any,
) -> Scene:
    """A scene of one section; what is not given is absent, and the cable starts in equilibrium."""
    environment = {"gravity": gravity} | ({"fluid": tables.pop("fluid")} if "fluid" in tables else {})
    kind: dict[str, Any] = {"kind": model} if isinstance(model, str) else {"kind": "zones", "zones": model}
    if cells is not None:
        tables["mesh"] = {"cells": cells}
    tables.setdefault("initial", {"kind": "equilibrium"})
    return Scene.model_validate(
        cable_scene(section, start, end, environment=environment, model=kind, initial=None) | tables
    )


def tables_with(tables: Any, changes: Mapping[str, Any]) -> Any:
    """A copy of nested tables with other values by dotted keys; None: without the key."""
    found = deepcopy(tables)
    for path, value in changes.items():
        *way, key = path.split(".")
        at = found
        for part in way:
            at = at[int(part)] if isinstance(at, list) else at.setdefault(part, {})
        if value is None:
            del at[key]
        else:
            at[key] = deepcopy(value)
    return found


def pinned(*position: float, **more: Any) -> dict[str, Any]:
    return {"kind": "pinned", "position": position or ORIGIN, **more}


def clamped(position: Sequence[float] = ORIGIN, tangent: Sequence[float] = (1, 0, 0), **more: Any) -> dict[str, Any]:
    return {"kind": "clamped", "position": tuple(position), "tangent": tuple(tangent), **more}


def free(**loads: Any) -> dict[str, Any]:
    return {"kind": "free", **loads}


def straight(*direction: float, **more: Any) -> dict[str, Any]:
    return {"kind": "straight", "direction": direction, **more}


def order(errors: Sequence[float]) -> Floats:
    """Observed orders of errors that belong to meshes (or steps) refined by two each time."""
    e = np.abs(np.asarray(errors, float))
    return np.log2(e[:-1] / e[1:])


# --- to look at every step, and at the discrete equations --------------------------------------


def at_rest(model: Model, t: float = 0.0, start: State | None = None) -> LinesAtRest:
    """The equilibrium in space of a line by itself."""
    scale, first = model.tension_scale, model.start if start is None else start
    x = JoinedLine(model.line, model.sea.at_time(t), model.ends.at_time(t), model.length, scale, 1e-6 * scale, (-1, -1))
    return lines_at_rest(Group([x]), [("the first shape", NetworkState([first]))])


STILL = np.zeros((2, 3))  # m/s2, of ends that begin at rest


class StepsOfLine:
    """Steps of one line by itself; its ends and sea are those of a model."""

    def __init__(self, model: Model, line: Line | None = None) -> None:
        """line: in place of that of the model."""
        self.model, line = model, model.line if line is None else line
        sea, ends = model.sea.at_time(0.0), model.ends.at_time(0.0)  # arrays that `at_time` overwrites
        x = JoinedLine(line, sea, ends, model.length, model.tension_scale, -np.inf, (-1, -1))
        self.solver = NetworkSolver([x], 0, apart=True)

    def begin(self, state: State, accelerations: Floats = STILL) -> NetworkTaken:
        """Give a state at t = 0 its accelerations and tensions; those of held ends: (2, 3) m/s2."""
        self._stand_at(0.0)
        return self.solver.consistent_accelerations(NetworkState([state]), [accelerations])

    def step(
        self, t: float, old: State, new: State, dt: float, rho: float, before: float, rho_before: float | None = None
    ) -> NetworkTaken:
        """From `old` to `new`, at t (s), over dt; before, rho_before: the step before, as long, of equal rho."""
        self._stand_at(t)
        states = NetworkState([old]), NetworkState([new])
        return self.solver.step(*states, dt, rho, before, rho if rho_before is None else rho_before)

    def _stand_at(self, t: float) -> None:
        self.model.sea.at_time(t)
        self.model.ends.at_time(t)


def motion(what: Scene, kick: Kick | None = None) -> Iterator[tuple[float, State]]:
    """Every step of a scene, without a file: (t, state); the arrays are overwritten two steps later.

    `kick` changes the state at t = 0, for what a scene has no word for: a velocity that varies along s.
    """
    time = what.require_time()
    model = build(one_line(what))
    steps = StepsOfLine(model)
    old = model.start.copy()
    if what.initial.kind == "equilibrium":
        old = at_rest(model).state.lines[0]
    if kick:
        kick(old, model)
    steps.begin(old)
    new = old.copy()
    yield 0.0, old
    count = round(time.duration / time.step)
    dt = time.duration / count
    for k in range(1, count + 1):
        t = k * time.duration / count
        taken = steps.step(t, old, new, dt, time.rho_inf, dt)
        assert taken.outcome == Outcome.OK, f"{taken} at t = {t}"
        old, new = new, old
        yield t, old


def poles(signal: Floats, step: float, damped: bool = False) -> complex:
    """The pole -decay + i omega [1/s] of the semi-discrete oscillator behind a signal computed with rho_inf = 1.

    One oscillator obeys y_{n+1} = a y_n + b y_{n-1} exactly (b = -1 without damping); with rho_inf = 1
    the scheme is the trapezoidal rule, so z = (1 + p dt/2)/(1 - p dt/2), inverted here: no error in time is left.
    """
    y = np.asarray(signal, float)
    before, middle, after = y[:-2], y[1:-1], y[2:]
    if damped:
        a, b = np.linalg.lstsq(np.column_stack([middle, before]), after, rcond=None)[0]
    else:
        a, b = float(middle @ (after + before) / (middle @ middle)), -1.0
    z = np.roots([1.0, -a, -b])[0]
    p = 2.0 / step * (z - 1.0) / (z + 1.0)
    return complex(p.real, abs(p.imag))


def stiffness(model: Model, ends: Ends, state: State) -> Floats:
    """Static stiffness of a state (free positions and spins; tensions eliminated), dense, from the rows of the march.

    A block of rows holds the length of the cell before the node, the balance of the node, and the spin of the cell
    after it; its unknowns are in that order, and its columns begin two blocks before its own.
    """
    line, n = model.line._replace(bits=model.line.bits & ~PLANAR), model.line.s.size
    rows = block_rows(line)
    assembly(line, model.sea.at_time(0.0), ends, state, 0.0, 0.0, workspace(n - 1)._replace(rows=rows))
    J = np.zeros((SIZE * n, SIZE * (n + 5)))
    for i, row in enumerate(rows.reshape(n, SIZE, WIDTH)):
        J[SIZE * i : SIZE * (i + 1), SIZE * i : SIZE * (i + 4)] = row[:, : 4 * SIZE]
        J[SIZE * i : SIZE * (i + 1), SIZE * (i + 4) + 1 : SIZE * (i + 4) + 4] = row[:, 4 * SIZE : 4 * SIZE + 3]
    sparse = csr_array(J[:, 2 * SIZE : SIZE * (n + 2)])
    tensions = [SIZE * i for i in range(1, n)]
    free_nodes = range(int(ends.held[0]), n - int(ends.held[1]))
    spins = [SIZE * i + 4 for i in range(n - 1) if line.spin[i]]
    others = sorted(spins + [SIZE * i + k for i in free_nodes for k in (1, 2, 3)])
    law, balance = sparse[tensions], sparse[others]
    lengths = law[:, tensions].diagonal()
    return -(balance[:, others] - balance[:, tensions] @ diags_array(1.0 / lengths) @ law[:, others]).toarray()


def lowest(K: Floats, count: int) -> Floats:
    """The lowest eigenvalues of a symmetric matrix (rounded so)."""
    return eigh(0.5 * (K + K.T), eigvals_only=True, subset_by_index=(0, count - 1))


def positive_definite(K: Floats) -> bool:
    """True when no eigenvalue of a symmetric matrix (rounded so) is negative: a Cholesky factor exists."""
    try:
        np.linalg.cholesky(0.5 * (K + K.T))
    except np.linalg.LinAlgError:
        return False
    return True


def twist_uniformly(model: Model, state: State, angle: float) -> Ends:
    """Twist a rod between two clamps: the end by `angle` (rad), the cells in proportion; returns the end conditions."""
    line, d = model.line, state.e / np.linalg.norm(state.e, axis=1)[:, None]
    part = angle * 0.5 * (line.s[1:] + line.s[:-1]) / model.length
    state.a1[:] = state.a1 * np.cos(part)[:, None] + np.cross(d, state.a1) * np.sin(part)[:, None]
    ends = model.ends.at_time(0.0)
    a1, a2, t = ends.frame[1].reshape(3, 3).T
    turned = np.cos(angle) * a1 + np.sin(angle) * a2
    frame = ends.frame.copy()
    frame[1] = np.column_stack([turned, np.cross(t, turned), t]).ravel()
    return ends._replace(frame=frame)


# --- statics: lines --------------------------------------------------------------------------------


def elastic_catenary(s: Any, H: float, V: float, w: float, c: float) -> tuple[Any, Any]:
    """x and z (m) at s of an elastic catenary, H and V being the forces at its start; c = 1/EA.

    With p = w s - V: x = H s/EA + (H/w) (asinh(p/H) + asinh(V/H)),
    z = (w s^2/2 - V s)/EA + (sqrt(H^2 + p^2) - sqrt(H^2 + V^2))/w  (Irvine, Cable Structures, 1981, section 2.4).
    """
    p = w * s - V
    x = H * s * c + H / w * (np.arcsinh(p / H) + np.arcsinh(V / H))
    return x, (0.5 * w * s * s - V * s) * c + (p - V) * (p + V) / (np.hypot(H, p) + np.hypot(H, V)) / w


def sagging_line(axial_stiffness: float | None, cells: int) -> Scene:
    """A heavy cable of 100 m between two points 70 m apart and 20 m different in height: `sagging_line_exact`.

    Discretisation: order 2 in shape and tension.  The polygon hangs its load at the nodes,
    so it is off by the sag of a cell, h^2 w/(8 H), on every cell: 1e-2 m at 40 cells; and the tension in the middle
    of a cell by a part (w h/H)^2/8, 1.6e-3.
    """
    elastic = {"axial_stiffness": axial_stiffness, "max_strain": 0.1} if axial_stiffness else {}
    section = {"length": 100.0, "mass": 1.0} | elastic
    return scene(section, pinned(), pinned(70, 0, 20), model="catenary", cells=cells, gravity=10.0)


def sagging_line_exact(axial_stiffness: float | None, s: Floats) -> tuple[Floats, Floats, tuple[float, float]]:
    """Position (ns, 3) and tension (ns,) of `sagging_line` at s, and (H, V)."""
    L, w = 100.0, 10.0
    c = 1.0 / axial_stiffness if axial_stiffness else 0.0
    found = root(lambda q: np.array(elastic_catenary(L, *q, w, c)) - [70.0, 20.0], (200.0, 400.0), tol=1e-13)
    H, V = (float(q) for q in found.x)
    x, z = elastic_catenary(s, H, V, w, c)
    return np.column_stack([x, np.zeros_like(s), z]), np.hypot(H, w * s - V), (H, V)


def taut_string(strain: float, axial_stiffness: float, cells: int, **tables: Any) -> Scene:
    """An elastic string of 2 m and 0.3 kg/m stretched between two points, no weight: T = EA strain.

    Round-off: the discrete string is straight and stretched evenly, too.

    In motion: transverse waves of speed sqrt(T/m') with m' = m/(1 + strain) the mass per stretched length,
    longitudinal waves of speed sqrt(EA/m) along s.  Of n equal cells the modes are sin(k pi s/L) exactly,
    with omega = (2 n/L) c sin(k pi/(2 n)) in place of c k pi/L: round-off again (1e-7: amplitude squared,
    and Newton's 1e-9 rad against the 1e-4 rad of the motion), and order 2 towards the string.
    """
    L = 2.0
    section = {"length": L, "mass": 0.3, "axial_stiffness": axial_stiffness}
    end = pinned(L * (1 + strain), 0, 0)
    return scene(section, pinned(), end, model="catenary", cells=cells, **tables)


def line_along_current(speed: float, cells: int) -> Scene:
    """A heavy line of 50 m that hangs from a ship in a current straight up (or down): T = (w - f)(L - s).

    f = rho pi d Ct U|U|/2 is the tangential drag per length.  Round-off: the force on a cell is that of the
    line below its middle, and the tension is linear in s.
    """
    section = {"length": 50.0, "mass": 3.0, "diameter": 0.04, "drag": {"normal": 1.2, "tangential": 0.02}}
    fluid = {"density": 1025.0, "current": [0, 0, speed]}
    return scene(section, pinned(), free(), model="catenary", cells=cells, gravity=9.81, fluid=fluid)


def line_along_current_exact(speed: float, s: Floats) -> Floats:
    """Tension (ns,) of `line_along_current`."""
    w = (3.0 - 1025.0 * math.pi / 4 * 0.04**2) * 9.81
    f = 0.5 * 1025.0 * math.pi * 0.04 * 0.02 * speed * abs(speed)
    return (w - f) * (50.0 - s)


def line_across_current(speed: float, cells: int) -> Scene:
    """The same line with normal drag only, in a horizontal current: a straight line at the critical angle.

    w cos a = rho d Cn U^2 sin(a)^2/2 with a the angle to the horizontal, and T = w z above the free end (Zajac,
    Dynamics and kinematics of the laying and recovery of submarine cable, 1957: the steadily laid cable,
    cos a = sqrt(1 + Hc^4/(4 U^4)) - Hc^2/(2 U^2), Hc^2 = 2 w/(rho Cn d), in the frame of the ship).
    Round-off: every cell is at that angle.
    """
    section = {"length": 50.0, "mass": 3.0, "diameter": 0.04, "drag": {"normal": 1.2}}
    fluid = {"density": 1025.0, "current": [speed, 0, 0]}
    initial = {"kind": "equilibrium", "direction": [1, 0, -1]}
    return scene(section, pinned(), free(), model="catenary", cells=cells, gravity=9.81, fluid=fluid, initial=initial)


def line_across_current_exact(speed: float) -> tuple[float, float]:
    """Angle to the horizontal (rad) of `line_across_current`, and its weight in water, N/m."""
    w = (3.0 - 1025.0 * math.pi / 4 * 0.04**2) * 9.81
    ratio = 2 * w / (1025.0 * 1.2 * 0.04) / speed**2
    return math.acos(math.sqrt(1 + ratio**2 / 4) - ratio / 2), w


# --- statics: rods -----------------------------------------------------------------------------------

SUSPENSION = json.loads((Path(__file__).parent / "data" / "suspension_full.json").read_text())
MOVED_JOINTS = {0.2: 1.91e-2, 0.4: 3.17e-2, 0.6: 4.16e-2, 0.8: 4.72e-2, 1.0: 5.36e-2, 1.2: 5.45e-2, 1.7: 8.03e-2}


def suspension(
    joint: float | None, cells: int, ratio: float = 1.0, rod_part: float | None = None, **tables: Any
) -> Scene:
    """A cable of 2 m with a clamped far end and no tension there (Goyal & Perkins, Table 1).

    joint: where a spherical joint parts the catenary (before) from the rod (after); None: all rod.
    ratio: length of the last cell over the first (of the rod); rod_part: share of the cells in the rod.

    Reference: solve_bvp at 1e-10, 101 points, in tests/data/suspension_full.json (`SUSPENSION`), computed
    independently of this project; `MOVED_JOINTS`: largest distance to the all-rod shape with the joint
    elsewhere, m, three digits published in shared/validation.md.

    Discretisation: order 2.0 +- 0.15; 3e-3 m at 40 uniform cells (EI kappa at the clamp bends 0.2 rad per cell
    there, the error is all from there), 2e-4 m at 160, 3e-5 m at 160 cells graded ten to one to the clamp.
    """
    length, diameter, g = 2.0, 1e-3, 9.8
    p = SUSPENSION["parameters"]
    section = {
        "length": length, "diameter": diameter, "mass": p["mass_per_length"], "bending_stiffness": p["EI"],
        "torsional_stiffness": 0.8 * p["EI"], "drag": {"normal": 1.5, "tangential": 0.05}, "damping": 2.0,
    }  # fmt: skip
    angle = math.radians(30)
    force = (0.01 * math.sin(angle), 0.0, 0.01 * math.cos(angle))
    end = {"kind": "guided", "tangent": [math.cos(angle), 0, -math.sin(angle)], "force": force}
    model: Any = "rod"
    if joint is None:
        tables["mesh"] = {"cells": cells, "ratio": ratio}
    else:
        share = (length - joint) / length if rod_part is None else rod_part
        rods = round(share * cells)
        model = [{"catenary": joint, "cells": cells - rods}, {"rod": length - joint, "cells": rods, "ratio": ratio}]
    tables.setdefault("initial", straight(1, 0, 0))
    fluid = {"density": p["rho_fluid"]}
    return scene(section, pinned(), end, model=model, gravity=g, fluid=fluid, **tables)


# Bisshopp & Drucker 1945: P L^2/EI -> axial shortening/L, deflection/L
BISSHOPP_DRUCKER = {
    1.0: (0.056433, 0.301721),
    2.0: (0.160642, 0.493457),
    3.0: (0.254420, 0.603253),
    5.0: (0.387628, 0.713792),
    10.0: (0.554996, 0.810609),
}


def end_loaded_cantilever(force: Sequence[float], cells: int, stiffness: Any = 1.0) -> Scene:
    """A cantilever of 1 m along x with a dead force at its end (Bisshopp & Drucker, Q. Appl. Math. 3, 1945).

    Tip displacements: `BISSHOPP_DRUCKER` (six digits), and `elastica_tip` from the elliptic integrals.
    `stiffness` a pair: about a1 (vertical) and about a2 (horizontal, across).
    Discretisation: within 0.1 % at 40 cells, order 2 (an element of h bends as the mean over h: kappa'' h^2/24).
    """
    section = {"length": 1.0, "mass": 1.0, "bending_stiffness": stiffness, "torsional_stiffness": 1.0}
    return scene(section, clamped(normal=(0, 0, 1)), free(force=tuple(force)), cells=cells)


def elastica_tip(load: float) -> tuple[float, float]:
    """Axial shortening/L and deflection/L of a cantilever under P L^2/EI = load, from elliptic integrals."""
    alpha = math.sqrt(load)

    def parts(slope: float) -> tuple[float, float]:
        m = 0.5 * (1 + math.sin(slope))
        return m, math.asin(1 / math.sqrt(2 * m))

    def mismatch(slope: float) -> float:
        m, phi = parts(slope)
        return float(ellipk(m) - ellipkinc(phi, m)) - alpha

    slope = brentq(mismatch, 1e-9, math.pi / 2 - 1e-9, xtol=1e-15)
    m, phi = parts(slope)
    return 1 - math.sqrt(2 * math.sin(slope)) / alpha, 1 - 2 / alpha * float(ellipe(m) - ellipeinc(phi, m))


def rolled_up(cells: int) -> Scene:
    """A cantilever of 1 m with EI = 2 under the end moment 8 pi: two full turns, closed on itself (Simo & Vu-Quoc).

    Round-off: every element bends by the same angle, so the cells lie on a regular polygon.  1e-8 m: 4 pi rad
    in `cells` equal angles, each left by Newton with up to 1e-9 rad.
    """
    section = {"length": 1.0, "mass": 1.0, "bending_stiffness": 2.0, "torsional_stiffness": 1.0}
    return scene(section, clamped(), free(moment=(0, 8 * math.pi, 0)), cells=cells)


def curled(cells: int) -> Scene:
    """A rod with the intrinsic curvature 2 pi/L, clamped at one end: it closes to a ring, without any moment.

    Round-off, as `rolled_up`; EI = 3 and GJ = 1 play no part.
    """
    section = {
        "length": 1.0, "mass": 1.0, "bending_stiffness": 3.0, "torsional_stiffness": 1.0,
        "intrinsic_curvature": [0, 2 * math.pi, 0],
    }  # fmt: skip
    return scene(section, clamped(), free(), cells=cells)


def stretched_rod(force: float, axial_stiffness: float, cells: int) -> Scene:
    """A clamped rod of 3 m pulled along its axis: the end moves by F L/EA.  Round-off: every cell stretches evenly."""
    section = {"length": 3.0, "mass": 1.0, "bending_stiffness": 1.0, "axial_stiffness": axial_stiffness}
    return scene(section, clamped(), free(force=(force, 0, 0)), cells=cells)


# T L^2/EI -> critical torque over 2 sqrt(EI T) of a rod clamped at both ends
GREENHILL_CLAMPED = {100.0: 1.0492, 400.0: 1.0124, 1600.0: 1.0031}


def twisted_taut_rod(load: float, cells: int, torsional_stiffness: float = 1.0) -> Scene:
    """A straight rod, L = EI = 1, clamped at both ends under the tension `load` = T L^2/EI, to be twisted.

    It buckles at `GREENHILL_CLAMPED` times Greenhill's 2 sqrt(EI T): the first root of
    (a - b) sin a sin b = a b sin(a - b), a, b = L/(2 lambda) (q +- sqrt(q^2 - 1)), q = M/(2 sqrt(EI T))
    (docs/theory.md, 7; `greenhill_clamped` computes it; a and b are half the wave numbers of the helix).
    Straight and evenly twisted is an exact equilibrium of the discrete rod; it loses stability where the
    lowest eigenvalue of its stiffness passes zero (twice: the helix has no preferred plane).
    Discretisation: order 2, 0.2 % at 100 cells for L/lambda = 10 (a turn of the helix takes L/10 lambda = 60 cells).
    EA = 1e6 T: the axial strain is far below that.
    """
    stiff = 1e6 * load
    section = {
        "length": 1.0, "mass": 1.0, "axial_stiffness": stiff, "bending_stiffness": 1.0,
        "torsional_stiffness": torsional_stiffness,
    }  # fmt: skip
    return scene(section, clamped(), clamped((1 + 1e-6, 0, 0)), cells=cells)


def greenhill_clamped(load: float) -> float:
    """Critical torque over 2 sqrt(EI T) of `twisted_taut_rod`."""

    def determinant(q: float) -> float:
        half, root_ = 0.5 * math.sqrt(load), math.sqrt(q * q - 1)
        a, b = half * (q + root_), half * (q - root_)
        return (a - b) * math.sin(a) * math.sin(b) - a * b * math.sin(a - b)

    qs = np.linspace(1.0 + 1e-7, 1.3, 4000)
    values = np.array([determinant(q) for q in qs])
    first = int(np.flatnonzero(np.sign(values[1:]) != np.sign(values[:-1]))[0])
    return float(brentq(determinant, qs[first], qs[first + 1], xtol=1e-14))


def ring(cells: int, torsional_stiffness: float) -> Scene:
    """A rod of 1 m, EI = 1, bent to a closed ring; both ends clamped at the same point, to be twisted there.

    It stays flat until the end is turned by 2 pi sqrt(3) EI/GJ (Michell 1889; Zajac, J. Appl. Mech. 29, 1962),
    then writhes.  A regular polygon with an even twist is an exact equilibrium of the discrete rod when
    GJ = EI.  The flat ring can turn about its tangent at the clamp without resistance (isotropic rod):
    one eigenvalue is zero throughout, and the next one tells.
    Discretisation: order 2 towards the published value.
    """
    section = {
        "length": 1.0, "mass": 1.0, "axial_stiffness": 1e6, "bending_stiffness": 1.0,
        "torsional_stiffness": torsional_stiffness,
    }  # fmt: skip
    angle = 2 * math.pi * (np.arange(cells) + 0.5) / cells
    chords = np.column_stack([np.cos(angle), np.zeros(cells), np.sin(angle)]) / cells
    points = np.vstack([np.zeros(3), np.cumsum(chords, axis=0)])
    points[-1] = 0.0
    initial = {"kind": "points", "points": points.tolist()}
    return scene(section, clamped(), clamped(), cells=cells, initial=initial)


# --- dynamics: small oscillations ----------------------------------------------------------------

# omega/sqrt(g/L): half the zeros of J0
CHAIN = (1.20241, 2.76004, 4.32686, 5.89577)
# beta L of Euler-Bernoulli beams, omega = (beta L)^2 sqrt(EI/m)/L^2
CANTILEVER = (1.8751041, 4.6940911, 7.8547574)
FREE_FREE = (4.7300407, 7.8532046)


def _clock(omega: float, periods: float, per_period: int) -> dict[str, float]:
    """A `time` table: that many periods of omega, rho_inf = 1 (no numerical damping; see `poles`)."""
    step = 2 * math.pi / omega / per_period
    return {"duration": step * round(periods * per_period), "step": step, "rho_inf": 1.0}


SMALL = 1e-4  # amplitude of small oscillations, over the length: its square, 1e-8, is what linear theory leaves out


def hanging_chain(mode: int, cells: int) -> tuple[Scene, Kick, Floats]:
    """A chain of 1 m that hangs from a pin, oscillating in mode 0 .. 3: omega = `CHAIN` sqrt(g/L) (Bernoulli).

    Mode shapes J0(2 omega sqrt((L - s)/g)).  Discretisation: order 2, 1e-3 for the first mode at 40 cells.
    Returns the scene, the kick that starts the mode, and the mode at the nodes (times nodal mass) to read it.
    """
    g = 9.81
    omega = CHAIN[mode] * math.sqrt(g)
    what = scene(
        {"length": 1.0, "mass": 1.0}, pinned(), free(), model="catenary", cells=cells, gravity=g,
        initial=straight(0, 0, -1), time=_clock(omega, 4, 100),
    )  # fmt: skip
    s = np.linspace(0, 1, cells + 1)
    shape = j0(2 * omega * np.sqrt((1 - s) / g))
    return what, _sideways(X, SMALL * omega * shape), _weighted(X, shape)


def cantilever(mode: int, cells: int, **damping: float) -> tuple[Scene, Kick, Floats]:
    """A cantilever, L = EI = m = 1, in bending mode 0 .. 2: omega = `CANTILEVER`^2 (Euler-Bernoulli).

    Discretisation: order 2, 1e-3 for the first mode at 40 cells.  Returns as `hanging_chain`.
    With `damping`: mass = c makes the damping ratio c/(2 omega), stiffness = tau makes it tau omega/2.
    """
    b = CANTILEVER[mode]
    s = np.linspace(0, 1, cells + 1)
    ratio = (math.sinh(b) - math.sin(b)) / (math.cosh(b) + math.cos(b))
    shape = np.cosh(b * s) - np.cos(b * s) - ratio * (np.sinh(b * s) - np.sin(b * s))
    return _beam(b, shape, clamped(), cells, damping)


def free_beam(mode: int, cells: int) -> tuple[Scene, Kick, Floats]:
    """A rod with free ends, L = EI = m = 1, in bending mode 0 or 1: omega = `FREE_FREE`^2.

    Discretisation: order 2; 4 times the error of a cantilever with as many cells per wave, 3e-3 at 40.
    """
    b = FREE_FREE[mode]
    s = np.linspace(0, 1, cells + 1)
    ratio = (math.cosh(b) - math.cos(b)) / (math.sinh(b) - math.sin(b))
    shape = np.cosh(b * s) + np.cos(b * s) - ratio * (np.sinh(b * s) + np.sin(b * s))
    return _beam(b, shape, free(), cells, {})


def _beam(
    b: float, shape: Floats, start: dict[str, Any], cells: int, damping: dict[str, float]
) -> tuple[Scene, Kick, Floats]:
    section: dict[str, Any] = {"length": 1.0, "mass": 1.0, "bending_stiffness": 1.0, "torsional_stiffness": 1.0}
    if damping:
        section["damping"] = damping
    origin = {} if start["kind"] == "clamped" else {"origin": ORIGIN}
    what = scene(section, start, free(), cells=cells, initial=straight(1, 0, 0, **origin), time=_clock(b * b, 4, 100))
    size = SMALL * b * b / np.abs(shape).max()
    return what, _sideways(Z, size * shape), _weighted(Z, shape)


def string_mode(mode: int, cells: int, direction: Floats) -> tuple[Scene, Kick, Floats, float, float]:
    """`taut_string` at 1 % strain in transverse or longitudinal mode 1, 2, ..., its frequency: discrete, continuous."""
    strain, stiff, L, m = 0.01, 500.0, 2.0, 0.3
    along = bool(direction[0])
    # (1 + strain) L and m/(1 + strain): c/L of the stretched string is sqrt(T/(m (1 + strain)))/L
    speed = math.sqrt(stiff / m) if along else math.sqrt(stiff * strain / (m * (1 + strain)))
    exact = mode * math.pi * speed / L
    discrete = 2 * cells / L * speed * math.sin(mode * math.pi / (2 * cells))
    what = taut_string(strain, stiff, cells, time=_clock(exact, 4, 100))
    shape = np.sin(mode * math.pi * np.linspace(0, 1, cells + 1))
    return what, _sideways(direction, 1e-3 * SMALL * exact * shape), _weighted(direction, shape), discrete, exact


def torsion_mode(mode: int, cells: int) -> tuple[Scene, Kick, float, float]:
    """A clamped-free rod of 1 m turning about its axis in mode 1, 2, ...: omega = (2 mode - 1) pi/2 sqrt(GJ/J)/L.

    The discrete modes are sin((2 mode - 1) pi s/2) at the middle of the cells, with
    omega = 2 n sin((2 mode - 1) pi/(4 n)) sqrt(GJ/J): round-off, and order 2 towards the rod.
    Returns scene, kick, the discrete and the continuous frequency.
    """
    GJ, J, k = 2.0, 0.5, 2 * mode - 1
    exact = k * math.pi / 2 * math.sqrt(GJ / J)
    discrete = 2 * cells * math.sin(k * math.pi / (4 * cells)) * math.sqrt(GJ / J)
    section = {
        "length": 1.0, "mass": 1.0, "bending_stiffness": 1.0, "torsional_stiffness": GJ, "rotary_inertia": [0.25, J],
    }  # fmt: skip
    what = scene(section, clamped(), free(), cells=cells, initial=straight(1, 0, 0), time=_clock(exact, 4, 100))

    def kick(state: State, model: Model) -> None:
        middle = 0.5 * (model.line.s[1:] + model.line.s[:-1])
        state.w[:] = SMALL * exact * np.sin(k * math.pi / 2 * middle)

    return what, kick, discrete, exact


def _sideways(direction: Floats, velocity: Floats) -> Kick:
    def kick(state: State, model: Model) -> None:
        state.v[:] = velocity[:, None] * direction

    return kick


def _weighted(direction: Floats, shape: Floats) -> Floats:
    """Weights (N+1, 3) that read a mode's amplitude from positions: the other modes are orthogonal to them."""
    weight = shape.copy()
    weight[[0, -1]] *= 0.5
    return weight[:, None] * direction


# --- dynamics: large motion ------------------------------------------------------------------------


def folded_chain(cells: int, step: float, duration: float) -> Scene:
    """A chain of 1 m folded in the middle, one end held, the other let go beside it.

    Without losses v^2 = g x (2 L - x)/(L - x) once the end has fallen by x; it needs 0.8472 sqrt(2 L/g) to x = L
    (Calkin & March, Am. J. Phys. 57, 1989).  A rod of EI = 1e-6 stands for the chain: 2e-5 of the energy is in
    the bend.
    Discretisation: the fold is three cells wide, so the two legs are 2.4 cells apart and not side by side, and a
    mesh takes the fold round one cell after the other: about first order in h (0.7 to 1.8 is accepted, the
    bend is resolved better and better), 1 % of the time and 2.5 % of v^2 at 81 cells.
    """
    h = 1.0 / cells
    legs = (cells - 3) // 2
    turn = np.pi / 4 * np.arange(1, 4)
    bend = np.outer(np.sin(turn), X) - np.outer(np.cos(turn), Z)
    chords = np.vstack([np.tile(-Z, (legs, 1)), bend, np.tile(Z, (legs, 1))])
    points = np.vstack([np.zeros(3), np.cumsum(h * chords, axis=0)])
    return scene(
        {"length": 1.0, "mass": 1.0, "bending_stiffness": 1e-6}, pinned(), free(), gravity=9.81,
        initial={"kind": "points", "points": points.tolist()}, mesh={"nodes": (np.arange(cells + 1) / cells).tolist()},
        time={"duration": duration, "step": step}, output={"every": step, "points": [0.0, 1.0]},
    )  # fmt: skip


def folded_chain_speed(fallen: Any) -> Any:
    """Speed of the falling end of `folded_chain` after falling `fallen` (m)."""
    return np.sqrt(9.81 * fallen * (2 - fallen) / (1 - fallen))


def folded_chain_time(fallen: float) -> float:
    """Time until the falling end of `folded_chain` has fallen by `fallen` (m)."""
    # x = y^2 takes the root at the start out of the integrand
    return float(quad(lambda y: 2 * y / folded_chain_speed(y * y), 1e-12, math.sqrt(fallen), epsabs=1e-12)[0])


def whip(cells: int, step: float, duration: float, rho_inf: float, every: float) -> Scene:
    """A thin rod (1 m, 0.1 kg/m, EI = 1e-6) on a pin, released from the horizontal: it whips after 0.45 s.

    Without damping its energy is constant: for rho_inf = 1 to the order of the scheme, 2.  For rho_inf = 0.5 it
    goes through the whip, which no mesh resolves, by numerical damping.  The scale of energy is m g L^2/2.
    """
    section = {"length": 1.0, "mass": 0.1, "bending_stiffness": 1e-6, "torsional_stiffness": 1e-6}
    time = {"duration": duration, "step": step, "rho_inf": rho_inf}
    return scene(
        section, pinned(), free(), cells=cells, gravity=9.81, initial=straight(1, 0, 0), time=time,
        output={"every": every},
    )  # fmt: skip


SPAGHETTI_OFF = 2.5  # s, when its load stops


def spaghetti(cells: int, step: float, duration: float = 5.0, every: float | None = None) -> Scene:
    """The flying spaghetti (Simo & Vu-Quoc 1986), planar: L 10, EI 100, 1 kg/m, rotary inertia 10, free ends.

    At the start end a moment of 80 and a force of 8 along x act for 2.5 s.  Exact afterwards: the linear
    momentum 8 x 2.5 = 20 (round-off: internal forces cancel in pairs, and a constant force is integrated
    exactly), and the angular momentum is constant (discretisation: 1e-4 at dt = 0.0125).  Order 2 in dt.
    rho_inf = 0.9.
    """
    section = {
        "length": 10.0, "mass": 1.0, "bending_stiffness": 100.0, "torsional_stiffness": 100.0, "rotary_inertia": 10.0,
    }  # fmt: skip
    off = SPAGHETTI_OFF
    start = free(force={"value": [8, 0, 0], "until": off}, moment={"value": [0, 80, 0], "until": off})
    return scene(
        section, start, free(), cells=cells, initial=straight(0.6, 0, -0.8, origin=[0, 0, 8]),
        time={"duration": duration, "step": step, "rho_inf": 0.9},
        output={"every": every or step, "points": np.linspace(0, 10, cells + 1).tolist()},
    )  # fmt: skip


def momenta(model: Model, state: State) -> tuple[Floats, Floats]:
    """Linear momentum (3,) and angular momentum about the origin (3,) of a state, rotary inertia included."""
    line = model.line
    p = line.mass[:, None] * state.v
    l = np.linalg.norm(state.e, axis=1)[:, None]
    d, e1 = state.e / l, np.diff(state.v, axis=0)
    d1 = (e1 - np.sum(d * e1, axis=1)[:, None] * d) / l
    turning = line.rotary[:, None] * np.cross(d, d1) + (line.polar * state.w)[:, None] * d
    return p.sum(axis=0), np.cross(state.r, p).sum(axis=0) + turning.sum(axis=0)


def sinking_rod(
    direction: Sequence[float], mass: float, duration: float, step: float, drag: bool = True, every: float | None = None
) -> Scene:
    """A straight, free rod of 5 m let go in still water, broadside or end-on; mass 3 kg/m sinks, 0.1 kg/m rises.

    Exact: from rest the acceleration is weight in water/(m + added mass), which without drag stays; with drag the
    speed is U tanh(t w/((m + added mass) U)) with U = sqrt(2 w/(rho d Cn)), or sqrt(2 w/(rho pi d Ct)) end-on.
    Round-off for the constant acceleration (the scheme integrates it exactly) and for the terminal speed;
    discretisation, order 2 in time, between.
    """
    section: dict[str, Any] = {
        "length": 5.0, "mass": mass, "diameter": 0.02, "bending_stiffness": 1.0,
        "added_mass": {"normal": 1.0, "tangential": 0.1},
    }  # fmt: skip
    if drag:
        section["drag"] = {"normal": 1.2, "tangential": 0.01}
    return scene(
        section, free(), free(), cells=10, gravity=9.81, fluid={"density": 1000.0},
        initial=straight(*direction, origin=ORIGIN), time={"duration": duration, "step": step},
        output={"points": 3, "every": every or duration}, dimension=3,  # in a plane it is seen that end-on is not stable
    )  # fmt: skip


def sinking_rod_exact(end_on: bool, mass: float) -> tuple[float, float, float]:
    """Weight in water (N/m, negative when it rises), mass that moves (kg/m) and terminal speed (m/s, downwards)."""
    displaced = 1000.0 * math.pi / 4 * 0.02**2
    w = (mass - displaced) * 9.81
    drag = 0.5 * 1000.0 * 0.02 * (0.01 * math.pi if end_on else 1.2)
    return w, mass + displaced * (0.1 if end_on else 1.0), math.copysign(math.sqrt(abs(w) / drag), w)


# --- invariants ----------------------------------------------------------------------------------------


def shaken_line(
    kind: str, step: float, duration: float, stiffness_damping: float, rho_inf: float = 0.9, every: float | None = None
) -> Scene:
    """A cable in water between two points, one of which is moved in three dimensions; for what every run must keep.

    kind "elastic": an extensible catenary.  Otherwise an inextensible "rod", "catenary" or "hybrid" with a rod in
    the last quarter, clamped at the end that moves and turns.  Drag, added mass and mass-proportional damping act,
    and stiffness-proportional damping if asked.

    Invariants: the length of an inextensible cable (1e-9 L: what Newton may leave, 1e-9 of a turn of a cell), frames
    orthonormal to 1e-12, and the energy ledger: what no work accounts for is the scheme's own, of order 2 in dt.
    """
    section: dict[str, Any] = {
        "length": 20.0, "mass": 2.0, "diameter": 0.02, "drag": {"normal": 1.2, "tangential": 0.02},
        "added_mass": {"normal": 1.0}, "damping": {"mass": 0.1, "stiffness": stiffness_damping},
    }  # fmt: skip
    motion_ = {"surge": {"amplitude": 0.5, "period": 4.0}, "sway": {"amplitude": 0.4, "period": 3.0},
               "heave": {"amplitude": 0.6, "period": 5.0}, "ramp": 2.0}  # fmt: skip
    if kind == "elastic":
        section["axial_stiffness"] = 1e4
    if kind in ("rod", "hybrid"):
        section |= {"bending_stiffness": 20.0, "torsional_stiffness": 15.0, "rotary_inertia": 0.01}
        end = clamped((15, 0, 2), (1, 0, 1), motion=motion_ | {"pitch": {"amplitude": 20.0, "period": 4.0}})
    else:
        end = pinned(15, 0, 2, motion=motion_)
    model: Any = "catenary" if kind == "elastic" else kind
    cells = {"cells": 40}
    if kind == "hybrid":
        model, cells = [{"catenary": 15.0, "cells": 24}, {"rod": 5.0, "cells": 16}], {}
    fluid = {"density": 1000.0, "current": [0.2, 0.3, 0.0]}
    return scene(
        section, pinned(), end, model=model, **cells, gravity=9.81, fluid=fluid,
        time={"duration": duration, "step": step, "rho_inf": rho_inf}, output={"every": every or duration / 20},
    )  # fmt: skip


TURNED_RING = {"amplitude": 760.0, "period": 16.0}  # deg, s: of the clamp at its end


def turned_ring(cells: int, step: float) -> Scene:
    """The `ring` twisted by turning its end through 2.1 turns in 4 s: it leaves its plane and passes through itself.

    Link = twist + writhe (Calugareanu, White): with the twist counted from cell to cell by parallel transport
    this holds for polygons exactly, so it shows any twist that the frames lose on the way.  Round-off.  (Without
    contact a line passes through itself, and link changes by 2 each time.)
    """
    what = ring(cells, 1.0)
    motion_ = {"roll": TURNED_RING, "ramp": 2.0}
    section = what.cable.sections[0].model_copy(update={"rotary_inertia": 1e-3, "damping": None})
    return scene(
        section.model_dump(exclude_none=True) | {"damping": {"mass": 10.0}}, clamped(), clamped(motion=motion_),
        mesh={"cells": cells}, initial=what.initial.model_dump(), time={"duration": 4.0, "step": step},
    )  # fmt: skip


def turned_by(t: float) -> float:
    """Angle (rad) of the clamp of `turned_ring` at t."""
    x = min(t / 2.0, 1.0)
    grown = x**3 * (10 - 15 * x + 6 * x * x)
    return grown * math.radians(TURNED_RING["amplitude"]) * math.sin(2 * math.pi * t / TURNED_RING["period"])


def twist_of(state: State, ends: Ends) -> float:
    """Twist (turns) from the clamp at the start through all cells to the clamp at the end, by parallel transport."""
    d = state.e / np.linalg.norm(state.e, axis=1)[:, None]
    first, last = (frame.reshape(3, 3) for frame in ends.frame)
    directions = np.vstack([first[:, 2], d, last[:, 2]])
    a1 = np.vstack([first[:, 0], state.a1, last[:, 0]])
    total = 0.0
    for (t, u), (a, b) in zip(pairwise(directions), pairwise(a1), strict=True):
        carried = a - (a @ u) / (1 + t @ u) * (t + u)
        total += math.atan2(np.cross(carried, b) @ u, carried @ b)
    return total / (2 * math.pi)


def solid_angle(a: Floats, b: Floats, c: Floats) -> float:
    """Signed area of the spherical triangle a, b, c (Van Oosterom & Strackee 1983)."""
    return 2 * math.atan2(a @ np.cross(b, c), 1 + a @ b + b @ c + c @ a)


def writhe(r: Floats, closed: bool = True) -> float:
    """Writhe of a polygon r (n, 3): Gauss's integral, exactly (Klenin & Langowski, Biopolymers 54, 2000)."""
    total = 0.0
    for (a, b), (c, d) in combinations(pairwise(np.vstack([r, r[: int(closed)]])), 2):
        sides = np.cross([c - a, d - a, d - b, c - b], [d - a, d - b, c - b, c - a])
        sizes = np.linalg.norm(sides, axis=1)[:, None]
        if sizes.min() > 0.0:
            angles = np.arcsin(np.clip(np.sum(sides / sizes * np.roll(sides / sizes, -1, axis=0), axis=1), -1, 1))
            total += float(angles.sum() * np.sign(np.cross(d - c, b - a) @ (c - a))) / (2 * math.pi)
    return total
