"""Chains in heave in MoorDyn (the C++ code), from the rows of power_cables.json: one section, a bed, no current."""

from __future__ import annotations

import importlib.util
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from peers.cabledyn_cable import moved
from peers.moordyn_touchdown import silence

DECK = """\
--- LINE TYPES ---
TypeName Diam MassDen EA BA/-zeta EI Cd Ca CdAx CaAx
(-) (m) (kg/m) (N) (N-s) (N-m^2) (-) (-) (-) (-)
chain {diameter} {mass} {ea} {damping} 0 {drag} {added} {along} 0
--- POINTS ---
ID Attachment X Y Z M V CdA Ca
(-) (-) (m) (m) (m) (kg) (m^3) (m^2) (-)
1 Fixed {end} 0 0 0 0
2 Coupled {start} 0 0 0 0
--- LINES ---
ID LineType AttachA AttachB UnstrLen NumSegs Outputs
(-) (-) (-) (-) (m) (-) (-)
1 chain 1 2 {length} {count} -
--- OPTIONS ---
9.80665 g
1025.0 rhoW
{depth} WtrDpth
{bed} kBot
0 cBot
{step} dtM
RK2 tScheme
0 FrictionCoefficient
1 disableOutput
1 disableOutTime
0 writeLog
120 TmaxIC
--- need this line ---
"""
COUPLING = 0.005  # s, between two positions of the end that MoorDyn is given
EVERY = 0.1  # s, of the answer


def available() -> bool:
    """Whether MoorDyn is installed."""
    return importlib.util.find_spec("moordyn") is not None


def heaved(
    row: dict[str, Any], heave: dict[str, float], step: float
) -> tuple[NDArray[np.float64], NDArray[np.float64], float]:
    """Times (nt,) s and the force (nt,) N on the end that heaves, and the CPU time (s), the search for the rest included."""
    import moordyn

    ((kind, length, count),) = row["sections"]
    diameter, mass, ea, _, drag, along, added = row["types"][kind]
    text = DECK.format(
        diameter=diameter, mass=mass, ea=ea, damping=row["damping"], drag=drag, added=added, along=along,
        start=" ".join(map(str, row["start"])), end=" ".join(map(str, row["end"])), length=length, count=count,
        depth=row["bed"]["depth"], bed=row["bed"]["stiffness"], step=step,
    )  # fmt: skip
    with tempfile.TemporaryDirectory() as folder, silence():
        path = Path(folder) / "deck.txt"
        path.write_text(text)
        begin = time.process_time()
        network = moordyn.Create(str(path))
        try:
            place = [float(x) for x in row["start"]]
            assert moordyn.Init(network, place, [0.0, 0.0, 0.0]) == 0
            point, inner = moordyn.GetPoint(network, 2), round(EVERY / COUPLING)
            force = [np.linalg.norm(moordyn.GetPointForce(point))]
            for k in range(round(heave["duration"] / COUPLING)):
                now, then = (moved(t, heave)[0] for t in (k * COUPLING, (k + 1) * COUPLING))
                at = [place[0], place[1], place[2] + now]
                moordyn.Step(network, at, [0.0, 0.0, (then - now) / COUPLING], k * COUPLING, COUPLING)
                if not (k + 1) % inner:
                    force.append(np.linalg.norm(moordyn.GetPointForce(point)))
        finally:
            moordyn.Close(network)
        spent = time.process_time() - begin
    return np.arange(len(force)) * EVERY, np.array(force), spent
