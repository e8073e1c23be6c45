"""CableDyn's decks of several lines in hybrid, CableDyn and MoorDyn: spread moorings of chain whose fairleads heave.

The decks are in the folder examples of CableDyn's repository, Copyright SMI Lab, Inha University, and contributors,
Apache License 2.0 (https://github.com/SMI-Lab-Inha/CableDyn): spread_3line_chain.dat, spread_4line_chain.dat and
connect_weighted_point.dat, here as numbers, with as many segments for all programs.
"""

from __future__ import annotations

import importlib.util
import math
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import hybrid
from peers.moordyn_touchdown import silence

Vector = NDArray[np.float64]

PERIOD, RAMP, DURATION, STEP, EVERY = 8.0, 16.0, 48.0, 0.05, 0.1
GRAVITY, DENSITY = 9.80665, 1025.0
# Diameter, mass, EA; drag and added mass are the same in all: 1.37 and 0.64, 1 and 0.
R4_185, R4_155 = (0.333, 685.0, 3.270e9), (0.2791, 480.93, 2.058e9)
# Chain; radius and depth of anchors and fairleads, length, segments of the deck times 2, lines.
SPREADS: dict[str, int] = {"spread_3line_chain": 3, "spread_4line_chain": 4}
ANCHORS, FAIRLEADS, DEPTH, LENGTH, SEGMENTS, BED, BED_DAMPING = (
    (837.6, -200.0),
    (58.0, -14.0),
    200.0,
    850.0,
    100,
    3e6,
    1e4,
)


def around(count: int, place: tuple[float, float], k: int) -> tuple[float, float, float]:
    angle = 2.0 * math.pi * k / count
    return place[0] * math.cos(angle), place[0] * math.sin(angle), place[1]


def section(chain: tuple[float, float, float], length: float) -> dict[str, Any]:
    """With the damping of the decks, zeta = 1 of a segment, h sqrt(m/EA): without, tensions at the fairleads ring by 0.2 %
    in waves along the line (0.8 s and less) from where it lands, and least and largest ones do not settle with the step.
    """
    return {
        "damping": {"stiffness": LENGTH / SEGMENTS * math.sqrt(chain[1] / chain[2])},
        "length": length, "mass": chain[1], "diameter": chain[0], "axial_stiffness": chain[2],
        "drag": {"normal": 1.37, "tangential": 0.64}, "added_mass": {"normal": 1.0},
    }  # fmt: skip


def deck(
    chain: tuple[float, float, float], points: list[str], lines: list[tuple[int, int, float]], cells: int,
    *rows: str,
) -> str:  # fmt: skip
    """Lines: points at their upper and lower end, length."""
    text = [
        "--- Input File ---", "deck", "--- LINE TYPES ---", "TypeName Diam MassDenInAir EA BA/-zeta EI Cd_n Cd_t Ca_n Ca_t",
        "(-) (m) (kg/m) (N) (N-s/-) (N-m^2) (-) (-) (-) (-)", f"chain {chain[0]} {chain[1]} {chain[2]} -1.0 0.0 1.37 0.64 1.0 0.0",
        "--- POINTS ---", "ID Type X Y Z Mass Vol CdA Ca", "(-) (-) (m) (m) (m) (kg) (m^3) (m^2) (-)",
        *(f"{k} {row}" for k, row in enumerate(points, 1)),
        "--- LINES ---", "ID NodeA NodeB Outputs", "(-) (-) (-) (-)",
        *(f"{k} {a} {b} -" for k, (a, b, _) in enumerate(lines, 1)),
        "--- SECTIONS ---", "LineID LineType Length NumSegs", "(-) (-) (m) (-)",
        *(f"{k} chain {length} {cells}" for k, (_, _, length) in enumerate(lines, 1)),
        "--- OPTIONS ---", f"{GRAVITY} g", f"{DENSITY} rhoW", *rows,
        "--- OUTPUTS ---", *(f'"FairTen{k}"' for k in range(1, len(lines) + 1)), "--- need this line ---", "",
    ]  # fmt: skip
    return "\n".join(text)


def model_of(text: str) -> Any:
    import cabledyn

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "deck.dat"
        path.write_text(text)
        return cabledyn.CableDyn(path)


def heaved(t: float) -> float:
    ramp = min(t / RAMP, 1.0)
    return ramp**3 * (10.0 - 15.0 * ramp + 6.0 * ramp**2) * math.sin(2.0 * math.pi * t / PERIOD)


def cabledyns(count: int, step: float = STEP) -> tuple[Vector, float]:
    """Tension (nt,) N at the fairlead of the first line, every EVERY s; CPU time (s) from the deck to the end."""
    points, lines = [], []
    for k in range(count):
        points += [
            "Fixed {} {} {} 0 0 0 0".format(*around(count, ANCHORS, k)),
            "Coupled {} {} {} 0 0 0 0".format(*around(count, FAIRLEADS, k)),
        ]
        lines.append((2 * k + 2, 2 * k + 1, LENGTH))
    rows = f"{DEPTH} WtrDpth", f"{BED} kBot", f"{BED_DAMPING} cBot", f"{step} dtM", f"{DURATION} TMax"
    begin = time.process_time()
    with model_of(deck(R4_185, points, lines, SEGMENTS, *rows)) as model:
        position, velocity, acceleration = model.get_coupled_motion()
        velocity[:], acceleration[:] = 0.0, 0.0
        rest, d = np.array(position, float).copy(), 1e-4
        # what is given to it are all points, and a fixed one obeys as well: those that are fairleads heave
        up = [k for k in range(2, rest.size, 3) if abs(rest.ravel()[k] - FAIRLEADS[1]) < 1e-9]
        assert len(up) == count
        pull = [float(model.channel("FairTen1"))]
        for k in range(1, round(DURATION / step) + 1):
            t = k * step
            before, now, after = heaved(t - d), heaved(t), heaved(t + d)
            position.ravel()[up] = rest.ravel()[up] + now
            velocity.ravel()[up], acceleration.ravel()[up] = (
                (after - before) / (2 * d),
                (after - 2 * now + before) / d**2,
            )
            model.step(step, position, velocity, acceleration)
            if k % max(round(EVERY / step), 1) == 0:
                pull.append(float(model.channel("FairTen1")))
        spent = time.process_time() - begin
    return np.array(pull), spent


def hybrids(count: int, step: float = STEP, **output: Any) -> tuple[Vector, float]:
    """The same of hybrid, the pull of the line on its fairlead; CPU time (s) of the whole run, file written."""
    motion = {"heave": {"amplitude": 1.0, "period": PERIOD}, "ramp": RAMP}
    points: dict[str, Any] = {}
    for k in range(count):
        points[f"anchor{k}"] = {"position": around(count, ANCHORS, k)}
        points[f"fairlead{k}"] = {"position": around(count, FAIRLEADS, k), "motion": motion}
    lines = {
        f"line{k}": {"start": f"anchor{k}", "end": f"fairlead{k}", "sections": [section(R4_185, LENGTH)],
                     "mesh": {"cells": SEGMENTS}, "model": "catenary"}
        for k in range(count)
    }  # fmt: skip
    bed = {"z": -DEPTH, "stiffness": BED * R4_185[0], "damping": BED_DAMPING * R4_185[0]}
    scene = {
        "environment": {"gravity": GRAVITY, "fluid": {"density": DENSITY}, "seabed": bed}, "points": points,
        "lines": lines, "time": {"duration": DURATION, "step": step},
        "output": {"every": EVERY, "points": 11} | output,
    }  # fmt: skip
    with tempfile.TemporaryDirectory() as folder:
        begin = time.process_time()
        result = hybrid.run(scene, Path(folder) / "run.h5", progress=False)
        spent = time.process_time() - begin
        pull = np.linalg.norm(result["points/fairlead0/force"], axis=1)
        result.close()
    return pull, spent


MOORDYN = """\
--- LINE TYPES ---
TypeName Diam MassDen EA BA/-zeta EI Cd Ca CdAx CaAx
(-) (m) (kg/m) (N) (-) (N-m^2) (-) (-) (-) (-)
chain {diameter} {mass} {ea} -0.8 0 1.37 1.0 0.64 0.0
--- POINTS ---
ID Attachment X Y Z M V CdA Ca
(-) (-) (m) (m) (m) (kg) (m^3) (m^2) (-)
{points}
--- LINES ---
ID LineType AttachA AttachB UnstrLen NumSegs Outputs
(-) (-) (-) (-) (m) (-) (-)
{lines}
--- OPTIONS ---
{gravity} g
{density} rhoW
{depth} WtrDpth
{bed} kBot
{damping} cBot
{step} dtM
RK2 tScheme
1 disableOutput
1 disableOutTime
0 writeLog
20 TmaxIC
--- need this line ---
"""
COUPLING = 0.02  # s, between two positions of fairleads that MoorDyn is given


def moordyns(count: int, step: float) -> tuple[Vector, float]:
    """The same of MoorDyn: the force of its line on the first fairlead, CPU time (s) from the deck to the end."""
    import moordyn

    points = [
        "{} {} {} {} {} 0 0 0 0".format(2 * k + first, kind, *around(count, place, k))
        for k in range(count)
        for first, kind, place in ((1, "Fixed", ANCHORS), (2, "Coupled", FAIRLEADS))
    ]
    lines = [f"{k + 1} chain {2 * k + 1} {2 * k + 2} {LENGTH} {SEGMENTS} -" for k in range(count)]
    text = MOORDYN.format(
        diameter=R4_185[0], mass=R4_185[1], ea=R4_185[2], points="\n".join(points), lines="\n".join(lines),
        gravity=GRAVITY, density=DENSITY, depth=DEPTH, bed=BED, damping=BED_DAMPING, step=step,
    )  # fmt: skip
    with tempfile.TemporaryDirectory() as folder, silence():
        path = Path(folder) / "deck.txt"
        path.write_text(text)
        begin = time.process_time()
        network = moordyn.Create(str(path))
        rest, velocity = np.array([around(count, FAIRLEADS, k) for k in range(count)]), np.zeros((count, 3))
        assert moordyn.Init(network, rest.ravel().tolist(), velocity.ravel().tolist()) == 0
        point = moordyn.GetPoint(network, 2)
        pull = [float(np.linalg.norm(moordyn.GetPointForce(point)))]
        for k in range(round(DURATION / COUPLING)):
            now, then = heaved(COUPLING * k), heaved(COUPLING * (k + 1))
            position = rest.copy()
            position[:, 2] += now
            velocity[:, 2] = (then - now) / COUPLING
            moordyn.Step(network, position.ravel().tolist(), velocity.ravel().tolist(), COUPLING * k, COUPLING)
            if (k + 1) % round(EVERY / COUPLING) == 0:
                pull.append(float(np.linalg.norm(moordyn.GetPointForce(point))))
        spent = time.process_time() - begin
        moordyn.Close(network)
    return np.array(pull), spent


def figures(pull: Vector) -> Vector:
    """Mean, largest and least of the last two periods."""
    last = pull[-round(2 * PERIOD / EVERY) :]
    return np.array([last.mean(), last.max(), last.min()])


def installed(package: str) -> bool:
    """Whether a package is there, without importing it."""
    return importlib.util.find_spec(package) is not None
