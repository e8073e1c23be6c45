"""The touchdown scene in MoorDyn (the C++ code), through its Python wrapper."""

from __future__ import annotations

import contextlib
import importlib.util
import math
import os
import sys
import tempfile
import time
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path

import numpy as np

from peers import scene
from peers.answer import Answer

NAME = "MoorDyn"

# MoorDyn's drag and added mass have our conventions; its seabed is per area of line seen from above.
DECK = """\
--------------------- MoorDyn Input File ---------------------
touchdown
---------------------- LINE TYPES ----------------------
TypeName Diam Mass/m EA BA/-zeta EI Cd Ca CdAx CaAx
(name) (m) (kg/m) (N) (N-s/-) (N-m^2) (-) (-) (-) (-)
line {diameter} {mass} {ea} {ba} {ei} {cdn} {can} {cdt} 0.0
---------------------- POINTS ----------------------
ID Attachment X Y Z M V CdA Ca
(#) (-) (m) (m) (m) (kg) (m^3) (m^2) (-)
1 Fixed {ax} {ay} {az} 0 0 0 0
2 Coupled {fx} {fy} {fz} 0 0 0 0
---------------------- LINES ----------------------
ID LineType AttachA AttachB UnstrLen NumSegs Outputs
(#) (name) (#) (#) (m) (-) (-)
1 line 1 2 {length} {elements} -
---------------------- OPTIONS ----------------------
0 writeLog
1 disableOutput
1 disableOutTime
{gravity} g
{density} rho
{depth} WtrDpth
{kbot} kBot
{cbot} cBot
{dt} dtM
{scheme} tScheme
0.0 FrictionCoefficient
{relaxation} TmaxIC
{extra}
---------------------- OUTPUTS ----------------------
FairTen1
---------------------- need this line ----------------------
"""


def available() -> bool:
    """Whether the package is installed."""
    return importlib.util.find_spec("moordyn") is not None


def deck(
    elements: int, EI: float, dt: float, scheme: str, damping: float, relaxation: float, options: tuple[str, ...]
) -> str:
    """The input file."""
    (ax, ay, az), (fx, fy, fz) = scene.ANCHOR, scene.FAIRLEAD
    return DECK.format(
        diameter=scene.DIAMETER, mass=scene.MASS, ea=scene.EA, ba=damping, ei=EI,
        cdn=scene.DRAG_NORMAL, cdt=scene.DRAG_TANGENTIAL, can=scene.ADDED_NORMAL,
        ax=ax, ay=ay, az=az, fx=fx, fy=fy, fz=fz,
        length=scene.LENGTH, elements=elements, gravity=scene.GRAVITY, density=scene.DENSITY, depth=scene.DEPTH,
        kbot=scene.SEABED_STIFFNESS / scene.DIAMETER, cbot=scene.SEABED_DAMPING / scene.DIAMETER,
        dt=dt, scheme=scheme, relaxation=relaxation, extra="\n".join(options),
    )  # fmt: skip


@contextlib.contextmanager
def silence() -> Iterator[None]:
    """MoorDyn reports on the standard streams, past Python's own."""
    sys.stdout.flush()
    sys.stderr.flush()
    kept = [os.dup(1), os.dup(2)]
    with open(os.devnull, "w") as hole:
        os.dup2(hole.fileno(), 1)
        os.dup2(hole.fileno(), 2)
    try:
        yield
    finally:
        for number, stream in zip((1, 2), kept, strict=True):
            os.dup2(stream, number)
            os.close(stream)


def run(
    elements: int,
    EI: float,
    dt: float = 5.5e-4,
    scheme: str = "RK4",
    damping: float = 0.0,
    couple: float = 0.0011,
    relaxation: float = 120.0,
    duration: float = scene.DURATION,
    options: tuple[str, ...] = (),
) -> Answer:
    """March the scene.

    `couple` is the interval at which the fairlead's motion is handed over.  MoorDyn lets the fairlead run on from the
    place at the beginning of the interval with the speed it is given, so that it gets the mean one; a larger interval
    jerks the fairlead and the tension with it (1 % at 5 ms).  `damping` is MoorDyn's BA: N s, or a negative damping
    ratio of the segments.  `relaxation` bounds the search for the rest, in simulated seconds.

    The tension is that of the force on the fairlead.  MoorDyn's own figure (GetLineFairTen) is the one in the middle
    of the last segment, less by half a segment's weight: 0.3 % with 200 segments.
    """
    import moordyn

    steps = round(duration / couple)
    every = max(1, round(0.05 / couple))
    x, _, z = scene.FAIRLEAD
    heights = [scene.heave(k * couple)[0] + z for k in range(steps + 1)]
    rates = [(up - down) / couple for down, up in pairwise(heights)]
    tension = np.empty(steps // every + 1)
    with tempfile.TemporaryDirectory() as folder, silence():
        path = Path(folder) / "touchdown.dat"
        path.write_text(deck(elements, EI, dt, scheme, damping, relaxation, options))
        begin = time.process_time()
        network = moordyn.Create(str(path))
        try:
            if moordyn.Init(network, [x, 0.0, heights[0]], [0.0, 0.0, 0.0]):
                raise RuntimeError("MoorDyn does not start")
            tension[0] = math.hypot(*moordyn.GetPointForce(moordyn.GetPoint(network, 2)))
            cpu_start = time.process_time() - begin

            begin = time.process_time()
            for k in range(steps):
                force = moordyn.Step(network, (x, 0.0, heights[k]), (0.0, 0.0, rates[k]), k * couple, couple)
                if not (k + 1) % every:
                    tension[(k + 1) // every] = math.hypot(*force)
            cpu = time.process_time() - begin
        finally:
            moordyn.Close(network)
    settings = f"{scheme}, dt {dt:g} s, BA {damping:g}, motion every {couple:g} s"
    times = np.linspace(0.0, couple * every * (tension.size - 1), tension.size)
    return Answer(times, tension, cpu, cpu_start, settings)
