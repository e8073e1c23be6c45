"""Polyester that remembers its highest tension (Syrope), in hybrid and in MoorDyn: a bar of one segment, held and moved.

    pip install -e ".[dev,bench]"
    pytest bench/test_bench_syrope.py -m bench -s

A bar of 1 m without weight, of the rope of tests/data/moordyn/syrope.txt: both programs get the same deck, hybrid by its
import.  Its end is moved slowly (past the highest tension of before, back, past it again: the rope relaxes in half a second,
the motion takes minutes), and quickly (it relaxes in minutes, the motion has a period of 10 s).  MoorDyn's tension is the
force on the moved point.

Measured beside it: MoorDyn 2.7.2 does not read the first row of a table that begins in its third line (its own test has
such a table); this one begins in the fourth.

What is expected: the curves are the same, and the dynamic stiffness to first order in the change of tension; relaxation
times differ (hybrid has one, MoorDyn's changes with the tension), which shows while the tension lags behind the curves.
"""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from peers.moordyn_deck import march

import hybrid

pytestmark = pytest.mark.bench
DATA = Path(__file__).parents[1] / "tests" / "data" / "moordyn"
Vector = NDArray[np.float64]
SHAPES = {
    "EXP": ("0.2", "1.5"),
    "QUADRATIC": ("0.3", "0.5"),
    "LINEAR": ("0.4", "1.0"),
    "BY STIFFNESS": ("1.2e8", "1.0"),
}
BOUND = 0.5  # per cent of the largest tension, or of the range of tensions

DECK = """one segment
---------------------- LINE TYPES -------------------------------------------
TypeName  Diam   Mass/m   EA                                   BA             EI    Cd   Ca   CdAx  CaAx
(name)    (m)    (kg/m)   (N)                                  (N-s)          (N-m^2) (-) (-) (-)   (-)
rope      0.16   22       SYROPE:settings.dat|1.6e8|20         {ba}|1.0e5    0     0    0    0    0
---------------------- POINTS -----------------------------------------------
ID   Attachment  X      Y     Z      Mass  Volume  CdA  Ca
(#)  (-)         (m)    (m)   (m)    (kg)  (m^3)   (m^2) (-)
1    Fixed       0      0     -5     0     0       0     0
2    Coupled     {end:.12g}    0     -5    0     0       0     0
---------------------- LINES ------------------------------------------------
ID   LineType  AttachA  AttachB  UnstrLen  NumSegs  LineOutputs
(#)  (name)    (#)      (#)      (m)       (-)      (-)
1    rope      1        2        1         1        -
---------------------- SYROPE IC --------------------------------------------
Line   Tmax     Tmean
(#)    (N)      (N)
1      1.5e6    {mean:.12g}
---------------------- OPTIONS ----------------------------------------------
0.02     dtM      time step
0        g        gravity
10       WtrDpth  depth
0.01     dtIC     convergence
0.02     TmaxIC   longest
---------------------- NEED THIS LINE ---------------------------------------
"""


def bar(folder: Path, shape: str, ba: float, end: float, mean: float) -> tuple[str, hybrid.Scene, list[Path]]:
    """The deck of a bar that begins with a mean tension (N), its scene, and the files that it reads."""
    name, (k1, k2) = shape.split()[-1].replace("STIFFNESS", "LINEAR"), SHAPES[shape]
    settings = folder / "settings.dat"
    settings.write_text(f"syrope_owc.dat OWC curve\n{name} WCType shape\n{k1} k1 first\n{k2} k2 second")
    (folder / "syrope_owc.dat").write_text((DATA / "syrope_owc.dat").read_text())
    deck = folder / "deck.txt"
    deck.write_text(DECK.format(ba=ba, end=end, mean=mean))
    (made,) = hybrid.import_moordyn(deck).scenes.values()
    return deck.read_text(), made.scene, [settings, folder / "syrope_owc.dat"]


def both(shape: str, ba: float, times: Vector, strains: Vector, step: float) -> tuple[Vector, Vector]:
    """Tensions (n,) N at `times` of MoorDyn and of hybrid, of a bar whose strain is linear between these times."""
    with tempfile.TemporaryDirectory() as name:
        folder, end = Path(name), 1.0 + float(strains[0])
        _, scene, _ = bar(folder, shape, ba, end, 1e6)
        mean = float(hybrid.static(scene).tension[-1].mean())
        text, scene, files = bar(folder, shape, ba, end, mean)
        every = float(times[1] - times[0])
        seen = march(
            text,
            lambda t: np.array([1.0 + np.interp(t, times, strains), 0.0, -5.0]),
            float(times[-1]),
            every,
            step,
            files,
        )
        path = folder / "motion.csv"
        rows = np.column_stack([times, 1.0 + strains, 0.0 * times, -5.0 + 0.0 * times])
        np.savetxt(path, rows, delimiter=",", header="t,x,y,z", comments="", fmt="%.12g")
        data = scene.model_dump(mode="json", exclude_none=True)
        data["ends"]["end"]["motion"] = {"file": str(path)}
        data["mesh"] = {"cells": 2}
        del data["environment"]
        data["environment"] = {"gravity": 0}
        section = data["cable"]["sections"][0]
        for key in ("drag", "added_mass"):
            section.pop(key, None)
        section["mass"] = 1e-3
        section["diameter"] = None
        found = hybrid.run(data | {"time": {"duration": float(times[-1]), "step": step}, "output": {"every": every}})
        return np.abs(seen.forces[2][:, 0]), found.tension.mean(axis=1)


def smooth(x: Vector) -> Vector:
    """From 0 at x = 0 to 1 at 1, without a jump of acceleration."""
    x = np.clip(x, 0.0, 1.0)
    return np.asarray(x**3 * (10 - 15 * x + 6 * x**2))


@pytest.mark.parametrize("shape", SHAPES)
def test_slow_loading_past_the_highest_tension(shape: str) -> None:
    times = np.arange(0.0, 1501.0, 1.0)
    ways = [0.016, 0.016, 0.036, 0.036, 0.027, 0.027, 0.042]
    corners = [0, 100, 500, 600, 900, 1000, 1500]
    part = np.interp(times, corners, np.arange(7.0))
    k = np.minimum(part.astype(int), 5)
    strains = np.array(ways)[k] + np.diff(ways)[k] * smooth(part - k)
    theirs, ours = both(shape, 2e8, times, strains, 0.05)
    off = 100.0 * np.abs(ours - theirs) / theirs.max()
    print(f"{shape:13} slow: {theirs.min():.4g} to {theirs.max():.4g} N, off by at most {off.max():.3f} %")
    assert off.max() < BOUND


@pytest.mark.parametrize("shape", ["EXP", "QUADRATIC"])
def test_dynamic_stiffness(shape: str) -> None:
    times = np.arange(0.0, 60.1, 0.1)
    grown = np.minimum(times / 10.0, 1.0)
    strains = 0.016 + 4e-4 * grown**2 * (3 - 2 * grown) * np.sin(2 * np.pi * times / 10.0)
    theirs, ours = both(shape, 5e11, times, strains, 0.05)
    last = times > 39.9
    a, b = np.ptp(theirs[last]), np.ptp(ours[last])
    print(f"{shape:13} fast: range of {a:.6g} N, off by {100 * (b / a - 1):.3f} %")
    assert abs(b / a - 1) < BOUND / 100


def test_a_leg_pulled_past_its_highest_tension_and_shaken() -> None:
    """485 m of it in water: the fairlead goes out by 6 m, back to 3 m, and heaves then by 0.5 m in 8 s.

    The rope relaxes in 0.1 s on the working curves, 0.6 s on the original one, as MoorDyn has it.
    """
    times = np.arange(0.0, 300.1, 0.1)
    out = 6.0 * smooth((times - 20.0) / 100.0) - 3.0 * smooth((times - 140.0) / 60.0)
    heave = 0.5 * np.sin(2 * np.pi * (times - 220.0) / 8.0) * smooth((times - 220.0) / 24.0)
    rows = np.column_stack([400.0 + out, 0.0 * times, -10.0 + heave])
    text = (DATA / "syrope.txt").read_text()
    text = text.replace("5.0e8", "5.0e7")
    with tempfile.TemporaryDirectory() as name:
        deck = Path(name) / "deck.txt"
        deck.write_text(text)
        for file in ("syrope_owc.dat", "syrope_exponential.dat"):
            (Path(name) / file).write_text((DATA / file).read_text())
        (made,) = hybrid.import_moordyn(deck).scenes.values()
    rest = hybrid.static(made.scene)
    text = text.replace("1.5e6    1.0e6", f"1.5e6    {rest.tension[-1].mean():.6g}")
    files = [DATA / "syrope_owc.dat", DATA / "syrope_exponential.dat"]
    seen = march(text, lambda t: np.array([np.interp(t, times, x) for x in rows.T]), 300.0, 0.1, 0.05, files)
    theirs = np.linalg.norm(seen.forces[2], axis=1)
    with tempfile.TemporaryDirectory() as name:
        path = Path(name) / "motion.csv"
        np.savetxt(path, np.column_stack([times, rows]), delimiter=",", header="t,x,y,z", comments="", fmt="%.12g")
        data = made.scene.model_dump(mode="json", exclude_none=True)
        data["ends"]["end"]["motion"] = {"file": str(path)}
        found = hybrid.run(data | {"time": {"duration": 300.0, "step": 0.05}, "output": {"every": 0.1}})
    ours = np.linalg.norm(found["reaction_end"], axis=1)
    slow, late = (times > 15.0) & (times < 218.0), times > 260.0
    off = 100 * np.abs(ours - theirs)[slow].max() / theirs.max()
    shaken = 100 * (np.ptp(ours[late]) / np.ptp(theirs[late]) - 1)
    print(f"leg: largest pull {theirs.max():.5g} N, off by at most {off:.3f} %; range in heave off by {shaken:.3f} %")
    assert off < BOUND and abs(shaken) < 2.0
