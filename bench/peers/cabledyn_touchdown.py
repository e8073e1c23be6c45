"""The touchdown scene in CableDyn, through its Python package and C interface."""

from __future__ import annotations

import importlib.util
import tempfile
import time
from pathlib import Path

import numpy as np

from peers import scene
from peers.answer import Answer

NAME = "CableDyn"

# CableDyn's drag and added mass have our conventions.  Its seabed is per area of line seen from above, its damper
# acts on the way down only.
DECK = """\
--------------------- CableDyn Input File ---------------------
touchdown
--------------------- LINE TYPES ---------------------
TypeName Diam MassDenInAir EA BA/-zeta EI Cd_n Cd_t Ca_n Ca_t
(-) (m) (kg/m) (N) (N-s/-) (N-m^2) (-) (-) (-) (-)
line {diameter} {mass} {ea} {ba} {ei} {cdn} {cdt} {can} 0.0
--------------------- POINTS ---------------------
ID Type X Y Z Mass Vol CdA Ca
(-) (-) (m) (m) (m) (kg) (m^3) (m^2) (-)
1 Fixed {ax} {ay} {az} 0 0 0 0
2 Coupled {fx} {fy} {fz} 0 0 0 0
--------------------- LINES ---------------------
ID NodeA NodeB Outputs
(-) (-) (-) (-)
1 2 1 -
--------------------- SECTIONS ---------------------
LineID LineType Length NumSegs
(-) (-) (m) (-)
1 line {length} {elements}
--------------------- OPTIONS ---------------------
{gravity} g
{density} rhoW
{depth} WtrDpth
{kbot} kBot
{cbot} cBot
{dt} dtM
{duration} TMax
{extra}
--------------------- OUTPUTS ---------------------
"FairTen1"
--------------------- need this line ---------------------
"""


def available() -> bool:
    """Whether the package is installed."""
    return importlib.util.find_spec("cabledyn") is not None


def deck(elements: int, EI: float, dt: float, damping: float, options: tuple[str, ...]) -> str:
    """The input file."""
    (ax, ay, az), (fx, fy, fz) = scene.ANCHOR, scene.FAIRLEAD
    return DECK.format(
        diameter=scene.DIAMETER, mass=scene.MASS, ea=scene.EA, ba=damping, ei=EI,
        cdn=scene.DRAG_NORMAL, cdt=scene.DRAG_TANGENTIAL, can=scene.ADDED_NORMAL,
        ax=ax, ay=ay, az=az, fx=fx, fy=fy, fz=fz,
        length=scene.LENGTH, elements=elements, gravity=scene.GRAVITY, density=scene.DENSITY, depth=scene.DEPTH,
        kbot=scene.SEABED_STIFFNESS / scene.DIAMETER, cbot=scene.SEABED_DAMPING / scene.DIAMETER,
        dt=dt, duration=scene.DURATION, extra="\n".join(options),
    )  # fmt: skip


def run(elements: int, EI: float, dt: float = 0.1, damping: float = 0.0, options: tuple[str, ...] = ()) -> Answer:
    """March the scene.

    `damping` is CableDyn's BA: N s, or a negative damping ratio.  `options` are lines of its OPTIONS section.
    """
    import cabledyn

    steps = round(scene.DURATION / dt)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "touchdown.dat"
        path.write_text(deck(elements, EI, dt, damping, options))
        begin = time.process_time()
        model = cabledyn.CableDyn(path)
    with model:
        position, velocity, acceleration = model.get_coupled_motion()
        heights = [k for k in range(2, position.size, 3) if abs(position[k] - scene.FAIRLEAD[2]) < 1e-9]
        velocity[:], acceleration[:] = 0.0, 0.0
        tension = np.empty(steps + 1)
        tension[0] = model.channel("FairTen1")
        cpu_start = time.process_time() - begin

        begin = time.process_time()
        for k in range(1, steps + 1):
            position[heights], velocity[heights], acceleration[heights] = scene.heave(k * dt)
            model.step(dt, position, velocity, acceleration)
            tension[k] = model.channel("FairTen1")
        cpu = time.process_time() - begin
    settings = ", ".join((f"dt {dt:g} s", *([f"BA {damping:g}"] if damping else []), *options))
    return Answer(np.linspace(0.0, scene.DURATION, steps + 1), tension, cpu, cpu_start, settings)
