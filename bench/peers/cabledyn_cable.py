"""Cables at rest and in heave in CableDyn, from the rows of power_cables.json: bed, sections with bending, uniform current.

A row may have `damping`, EA times the time of its strain rate (N s).
"""

from __future__ import annotations

import importlib.util
import math
import tempfile
import time
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

NO_BED = 1000.0  # m, depth of a cable that touches none
DECK = """\
--- CableDyn Input File ---
cable
--- LINE TYPES ---
TypeName Diam MassDenInAir EA BA/-zeta EI Cd_n Cd_t Ca_n Ca_t
(-) (m) (kg/m) (N) (N-s/-) (N-m^2) (-) (-) (-) (-)
{types}
--- POINTS ---
ID Type X Y Z Mass Vol CdA Ca
(-) (-) (m) (m) (m) (kg) (m^3) (m^2) (-)
1 Coupled {start} 0 0 0 0
2 Fixed {end} 0 0 0 0
--- LINES ---
ID NodeA NodeB Outputs
(-) (-) (-) (-)
1 1 2 -
--- SECTIONS ---
LineID LineType Length NumSegs
(-) (-) (m) (-)
{sections}
--- OPTIONS ---
9.80665 g
1025.0 rhoW
{depth} WtrDpth
{bed} kBot
0 cBot
0.4 rhoInf
{dt} dtM
{current} current
{duration} TMax
--- OUTPUTS ---
{outputs}
--- need this line ---
"""


class Found(NamedTuple):
    """Times (nt,) s, force at the start and at the end (nt,) N, curvature at the nodes (nt, n) 1/m, CPU time (s)."""

    t: NDArray[np.float64]
    top: NDArray[np.float64]
    anchor: NDArray[np.float64]
    curvature: NDArray[np.float64]
    cpu: float


def available() -> bool:
    """Whether CableDyn is installed."""
    return importlib.util.find_spec("cabledyn") is not None


def deck(row: dict[str, Any], dt: float, duration: float) -> tuple[str, list[str]]:
    """The input file, and its channels of curvature."""
    bed = row["bed"] or {"depth": NO_BED, "stiffness": 1.0}
    types = [
        f"{name} {d} {mass} {EA} {row.get('damping', 0)} {EI} {drag} {along} {added} 0"
        for name, (d, mass, EA, EI, drag, along, added) in row["types"].items()
    ]
    sections = [f"1 {kind} {length} {count}" for kind, length, count in row["sections"]]
    bends = [f"Curv1N{k + 1}" for k in range(sum(x[2] for x in row["sections"]) + 1)]
    return DECK.format(
        types="\n".join(types), sections="\n".join(sections), start=" ".join(map(str, row["start"])),
        end=" ".join(map(str, row["end"])), depth=bed["depth"], bed=bed["stiffness"], dt=dt, duration=duration,
        current="uniform " + " ".join(map(str, row["current"])) if "current" in row else "none",
        outputs="\n".join(f'"{x}"' for x in ("FairTen1", "AnchTen1", *bends)),
    ), bends  # fmt: skip


def run(row: dict[str, Any], heave: dict[str, float] | None = None, dt: float = 0.05, every: int = 2) -> Found:
    """The equilibrium of a cable, and its motion where its start heaves: statics included in the CPU time."""
    import cabledyn

    duration = heave["duration"] if heave else dt
    text, bends = deck(row, dt, duration)
    times, found = [0.0], []
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "cable.dat"
        path.write_text(text)
        begin = time.process_time()
        model = cabledyn.CableDyn(path)
    names = ["FairTen1", "AnchTen1", *bends]
    with model:
        position, velocity, acceleration = model.get_coupled_motion()
        velocity[:], acceleration[:] = 0.0, 0.0
        rest = float(position[2])
        found.append([model.channel(x) for x in names])
        for k in range(1, round(duration / dt) + 1 if heave else 1):
            assert heave is not None
            z, v, a = moved(k * dt, heave)
            position[2], velocity[2], acceleration[2] = rest + z, v, a
            model.step(dt, position, velocity, acceleration)
            if k % every == 0:
                times.append(k * dt)
                found.append([model.channel(x) for x in names])
        cpu = time.process_time() - begin
    values = np.array(found, dtype=float)
    return Found(np.array(times), values[:, 0], values[:, 1], np.abs(values[:, 2:]), cpu)


def heaved(
    row: dict[str, Any], heave: dict[str, float], step: float
) -> tuple[NDArray[np.float64], NDArray[np.float64], float]:
    """Times (nt,) s, force (nt,) N at the start, which heaves, CPU time (s)."""
    found = run(row, heave, step)
    return found.t, found.top, found.cpu


def moved(t: float, heave: dict[str, float]) -> tuple[float, float, float]:
    """Height (m) of the start over its mean, its rate and acceleration; the ramp is 10 x^3 - 15 x^4 + 6 x^5."""
    w, x, ramp = 2.0 * math.pi / heave["period"], min(t / heave["ramp"], 1.0), heave["ramp"]
    grown = x**3 * (10.0 - 15.0 * x + 6.0 * x * x)
    rate = 30.0 * (x * (1.0 - x)) ** 2 / ramp
    bend = 60.0 * x * (1.0 - x) * (1.0 - 2.0 * x) / ramp**2
    z, v, a = (heave["amplitude"] * y for y in (math.sin(w * t), w * math.cos(w * t), -w * w * math.sin(w * t)))
    return grown * z, rate * z + grown * v, bend * z + 2.0 * rate * v + grown * a
