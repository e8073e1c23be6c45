"""A tether of 150 m with three floats between a ship that heaves and a fixed point, in this code and in CableDyn.

The line of examples/rov_tether.yaml in still water: 70 m, a stiffer part of 10 m, 70 m.
"""

from __future__ import annotations

import importlib.util
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

PLACES, BUOYANCY, MASS, DRAG_AREA, ADDED = (65.0, 75.0, 85.0), 140.0, 7.0, 0.03, 8.0  # m, N, kg, m^2, kg
PARTS = ((70.0, 20.0), (10.0, 300.0), (70.0, 20.0))  # m, N m^2
END, AMPLITUDE, PERIOD, RAMP, DURATION, EVERY = [25.0, 0.0, -110.0], 1.0, 8.0, 16.0, 40.0, 0.5
DENSITY, GRAVITY = 1025.0, 9.81
# Cells of a mesh, as (length, number) from the ship on.
Graded = Sequence[tuple[float, int]]

DECK = """\
--- CableDyn Input File ---
floats
--- LINE TYPES ---
TypeName Diam MassDenInAir EA BA/-zeta EI Cd_n Cd_t Ca_n Ca_t
(-) (m) (kg/m) (N) (N-s/-) (N-m^2) (-) (-) (-) (-)
soft .025 .8 2.0e6 0 20 1.2 .02 1.0 0.0
stiff .025 .8 2.0e6 0 300 1.2 .02 1.0 0.0
--- POINTS ---
ID Type X Y Z Mass Vol CdA Ca
(-) (-) (m) (m) (m) (kg) (m^3) (m^2) (-)
1 Coupled 0 0 0 0 0 0 0
2 Fixed {end} 0 0 0 0
--- LINES ---
ID NodeA NodeB Outputs
(-) (-) (-) (-)
1 1 2 -
--- SECTIONS ---
LineID LineType Length NumSegs
(-) (-) (m) (-)
{sections}
--- ATTACHMENTS ---
LineID ArcLength Mass Volume CdA Ca
(-) (m) (kg) (m^3) (m^2) (-)
{attached}
--- OPTIONS ---
{gravity} g
{density} rhoW
400 WtrDpth
1.0 kBot
0 cBot
{dt} dtM
{duration} TMax
--- OUTPUTS ---
{outputs}
--- need this line ---
"""


class Peer(NamedTuple):
    """Arc lengths of nodes (n,) m, curvature (nt, n) 1/m at outputs, CPU time of the time loop, s."""

    s: Floats
    curvature: Floats
    cpu: float


def available() -> bool:
    """Whether CableDyn is installed."""
    return importlib.util.find_spec("cabledyn") is not None


def scene(mesh: dict[str, Any] | None, step: float | None, points: int, **more: Any) -> dict[str, Any]:
    """The scene for this code; mesh, step: None leaves them to the program; more: tables, with `errors` of the output."""
    sections = [
        {
            "length": length, "diameter": 0.025, "mass": 0.8, "axial_stiffness": 2e6, "bending_stiffness": EI,
            "drag": {"normal": 1.2, "tangential": 0.02}, "added_mass": {"normal": 1.0},
        }
        for length, EI in PARTS
    ]  # fmt: skip
    one = {"kind": "float", "buoyancy": BUOYANCY, "mass": MASS, "drag_area": DRAG_AREA, "added_mass": ADDED}
    heave = {"heave": {"amplitude": AMPLITUDE, "period": PERIOD}, "ramp": RAMP}
    return {
        "environment": {"fluid": {"density": DENSITY}, "gravity": GRAVITY},
        "cable": {"sections": sections, "attachments": [{"at": at, **one} for at in PLACES]},
        "ends": {
            "start": {"kind": "pinned", "position": [0, 0, 0], "motion": heave},
            "end": {"kind": "pinned", "position": END},
        },
        "initial": "equilibrium", "output": {"every": EVERY, "points": points, "errors": more.pop("errors", None)},
        "time": {"duration": DURATION} | ({} if step is None else {"step": step}),
    } | ({} if mesh is None else {"mesh": mesh}) | more  # fmt: skip


def nodes(mesh: Graded) -> list[float]:
    """Arc lengths of the nodes of a graded mesh, m."""
    cells = np.concatenate([np.full(n, length / n) for length, n in mesh])
    return [round(float(x), 9) for x in np.concatenate([[0.0], np.cumsum(cells)])]


def deck(mesh: Graded, dt: float, curvature: bool) -> str:
    """The input file of CableDyn."""
    where = np.cumsum([0.0, *(length for length, _ in mesh)])
    rows = [
        f"1 {'stiff' if 70.0 <= a < 80.0 else 'soft'} {length} {n}"
        for a, (length, n) in zip(where[:-1], mesh, strict=True)
    ]
    volume = (BUOYANCY / GRAVITY + MASS) / DENSITY
    attached = [f"1 {at} {MASS} {volume:.12g} {DRAG_AREA} {ADDED / DENSITY / volume:.12g}" for at in PLACES]
    count = sum(n for _, n in mesh) + 1
    named = ['"FairTen1"', *(f'"Curv1N{k}"' for k in range(1, count + 1) if curvature)]
    return DECK.format(
        end=" ".join(map(str, END)), sections="\n".join(rows), attached="\n".join(attached), gravity=GRAVITY,
        density=DENSITY, dt=dt, duration=DURATION, outputs="\n".join(named),
    )  # fmt: skip


def heave(t: float) -> tuple[float, float, float]:
    """Height of the ship, its rate and acceleration, m and s; grown by 10 x^3 - 15 x^4 + 6 x^5 over RAMP."""
    w, x = 2.0 * np.pi / PERIOD, min(t / RAMP, 1.0)
    r = x**3 * (10.0 - 15.0 * x + 6.0 * x * x)
    dr = 30.0 * (x * (1.0 - x)) ** 2 / RAMP if x < 1.0 else 0.0
    ddr = 60.0 * x * (1.0 - x) * (1.0 - 2.0 * x) / RAMP**2 if x < 1.0 else 0.0
    z, v, a = AMPLITUDE * np.array([np.sin(w * t), w * np.cos(w * t), -w * w * np.sin(w * t)])
    return r * z, dr * z + r * v, ddr * z + 2.0 * dr * v + r * a


def cabledyn(mesh: Graded, dt: float, curvature: bool = False) -> Peer:
    """CableDyn's own loop; curvature: at all nodes at outputs, which takes time of its own."""
    import cabledyn as peer

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "floats.dat"
        path.write_text(deck(mesh, dt, curvature))
        model = peer.CableDyn(path)
    s, found = np.array(nodes(mesh)), []
    names = [f"Curv1N{k}" for k in range(1, s.size + 1)]
    with model:
        position, velocity, acceleration = model.get_coupled_motion()
        velocity[:], acceleration[:] = 0.0, 0.0
        begin = time.process_time()
        for k in range(1, round(DURATION / dt) + 1):
            position[2], velocity[2], acceleration[2] = heave(k * dt)
            model.step(dt, position, velocity, acceleration)
            model.channel("FairTen1")
            if curvature and k % round(EVERY / dt) == 0:
                found.append([model.channel(x) for x in names])
        return Peer(s, np.array(found), time.process_time() - begin)
