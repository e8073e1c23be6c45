"""Hs and Tz of 1000 realisations of seas of every kind, half an hour each, against their spectrum.

pytest bench/test_bench_seas.py -m bench -s

Hs scatters by how components beat in half an hour, by the closed form of `beats` in tests/model/test_spectra.py; errors
are of the mean of all, in standard errors of it.  Samples of a Gaussian process at steps h cross zero upwards
arccos(rho(h))/(2 pi h) times a second, rho(h) its correlation: Tz of samples, which that of the spectrum is for h = 0.
"""

from __future__ import annotations

import math

import numpy as np
import pytest

import hybrid
from hybrid.model.sea import components
from hybrid.scene.wave_theory import (
    JonswapWaves,
    OchiHubbleWaves,
    PiersonMoskowitzWaves,
    SumOfWaves,
    TorsethaugenWaves,
    steady_wave,
)

pytestmark = pytest.mark.bench
REALISATIONS, DURATION, STEP, PLACE = 1000, 1800.0, 0.5, (37.0, -12.0)
SPREAD = {"exponent": 8}
SWELL = {"kind": "jonswap", "significant_height": 2.0, "peak_period": 14.0, "gamma": 6, "direction": 200.0}
WIND = {"kind": "pierson_moskowitz", "significant_height": 1.5, "peak_period": 6.0, "spreading": {"exponent": 5}}
SEAS = {
    "jonswap": JonswapWaves(significant_height=3.0, peak_period=9.0),
    "jonswap, spread": JonswapWaves(significant_height=3.0, peak_period=9.0, spreading=SPREAD),
    "pierson_moskowitz": PiersonMoskowitzWaves(significant_height=3.0, zero_crossing_period=6.5, spreading=SPREAD),
    "ochi_hubble": OchiHubbleWaves(
        parts=[
            {"significant_height": 2.0, "peak_period": 14.0, "shape": 3.0},
            {"significant_height": 1.5, "peak_period": 6.0, "shape": 1.2},
        ]
    ),
    "torsethaugen": TorsethaugenWaves(significant_height=2.5, peak_period=13.0),
    "sum": SumOfWaves(spectra=[SWELL, WIND]),
}


def seeded(sea, seed):
    """The same sea with other phases."""
    if isinstance(sea, SumOfWaves):
        return sea.model_copy(update={"spectra": tuple(x.model_copy(update={"seed": seed}) for x in sea.spectra)})
    return sea.model_copy(update={"seed": seed})


def realised(sea, seeds):
    """Of each seed: mean square of the elevation at a place (m^2), and its zero crossings per second."""
    t = np.arange(0.0, DURATION, STEP)
    out, turned = [], None
    for seed in seeds:
        A, w, kx, ky, phase, _ = components(seeded(sea, seed), math.inf, 9.81).T
        if turned is None:
            turned = np.exp(-1j * np.outer(t, w))
        eta = (turned @ (A * np.exp(1j * (kx * PLACE[0] + ky * PLACE[1] + phase)))).real
        out.append((np.mean(eta**2), np.sum((eta[:-1] < 0.0) & (eta[1:] >= 0.0)) / DURATION))
    return np.array(out), A, w


@pytest.mark.parametrize("name", SEAS)
def test_realisations(name):
    sea = SEAS[name]
    found, A, w = realised(sea, range(REALISATIONS))
    rate = math.acos(np.sum(A**2 * np.cos(w * STEP)) / np.sum(A**2)) / (2.0 * np.pi * STEP)
    wanted = np.array([sea.significant_height**2 / 16.0, rate])
    tz = 2.0 * np.pi * math.sqrt(np.sum(A**2) / np.sum((A * w) ** 2))
    pairs = np.sinc(np.subtract.outer(w, w) * DURATION / (2.0 * np.pi))
    np.fill_diagonal(pairs, 0.0)
    beats = math.sqrt(0.25 * A**2 @ pairs**2 @ A**2)
    error = found.std(axis=0, ddof=1) / math.sqrt(REALISATIONS)
    off = (found.mean(axis=0) - wanted) / error
    Hs, Tz = 4.0 * math.sqrt(found[:, 0].mean()), 1.0 / found[:, 1].mean()
    print(
        f"\n{name}: Hs {Hs:.4f} m for {sea.significant_height:.4f} ({off[0]:+.1f} standard errors), "
        f"Tz {Tz:.3f} s for {1.0 / wanted[1]:.3f} ({off[1]:+.1f}; {tz:.3f} of the spectrum), "
        f"Hs^2 scatters {found[:, 0].std(ddof=1) / beats:.3f} of what beats give"
    )
    assert np.abs(off).max() < 3.5
    assert 0.9 < found[:, 0].std(ddof=1) / beats < 1.1


# --- waves of finite height against raschii 2.0 (pip install raschii) ------------------------------

# Height, depth, length (m) and order: raschii's own test, deep, middle and shallow water.
STEADY = [
    (0.25, 0.5, 2.0, 20),
    (8.0, 200.0, 100.0, 15),
    (5.0, 50.0, 150.0, 15),
    (10.0, 40.0, 180.0, 20),
    (1.0, 5.0, 40.0, 25),
]


LEFT = 1e-12  # of its equations, to which its iterations are continued


def test_against_raschii():
    """Elevations, and velocities along and up from the bed to the surface, at nine phases; errors as parts of the most."""
    fenton = pytest.importorskip("raschii.wave_fenton")
    for height, depth, length, order in STEADY:
        theirs = fenton.FentonWave(height=height, depth=depth, length=length, N=order)
        left = theirs.c
        found = fenton.fenton_coefficients(height, depth, length, order, 9.81, tolerance=LEFT, relax=0.5)
        theirs.set_data(found)  # its own iterations end at 1e-8
        ours = steady_wave(height, depth, 9.81, order, length=length)
        j, x = np.arange(1, order + 1), np.linspace(0.0, 0.5 * length, 9)
        eta = np.cos(np.outer(x, j) * ours.k) @ ours.elevation
        off_eta = np.abs(eta + depth - theirs.surface_elevation(x)).max() / height
        off = most = 0.0
        for place, top in zip(x, eta, strict=True):
            for y in np.linspace(0.02 * depth, 0.999 * (depth + top), 7):
                kd = j * ours.k * ours.depth
                lift = j * ours.k * (y - depth + ours.depth)
                u = np.sum(ours.stream * np.cosh(lift) / np.cosh(kd) * np.cos(j * ours.k * place))
                w = np.sum(ours.stream * np.sinh(lift) / np.cosh(kd) * np.sin(j * ours.k * place))
                there = np.ravel(theirs.velocity(place, y))
                off, most = max(off, np.hypot(u - there[0], w - there[1])), max(most, np.hypot(u, w))
        print(f"\nH {height:g}, d {depth:g}, L {length:g} m, {order}: elevation {off_eta:.1e}, velocity {off / most:.1e}, "
              f"speed {ours.speed / theirs.c - 1.0:.1e} ({left / theirs.c - 1.0:.1e} of theirs as it ends)")  # fmt: skip
        assert off_eta < 1e-6 and off / most < 1e-6


# --- spread seas by frequency and in time ----------------------------------------------------------


def test_spread_sea_by_frequency_and_in_time():
    """Standard deviations of tension, and of positions along x and y, of a line in a spread sea against six hours."""
    places = [3.0, 15.0, 30.0, 45.0, 57.0]
    waves = {
        "kind": "jonswap", "significant_height": 2.0, "peak_period": 8.0, "direction": 30, "ramp": 10, "depth": 100.0,
        "spreading": {"exponent": 4},
    }  # fmt: skip
    line = {
        "length": 60.0, "mass": 30.0, "diameter": 0.1, "axial_stiffness": 5e6, "bending_stiffness": 2e3,
        "drag": {"normal": 1.2}, "added_mass": {"normal": 1.0},
    }  # fmt: skip
    tables = {
        "environment": {"fluid": {"density": 1025, "surface": 0, "waves": waves}}, "cable": {"sections": [line]},
        "ends": {
            "start": {"kind": "pinned", "position": [0, 0, -65]}, "end": {"kind": "pinned", "position": [6, 0, -5.15]},
        },
        "initial": "equilibrium", "model": "catenary", "mesh": {"cells": 60},
        "time": {"duration": 3600.0, "step": 0.15}, "output": {"every": 0.25, "points": places},
    }  # fmt: skip
    there: list[list[np.ndarray]] = [[], [], []]
    for seed in range(1, 7):
        fluid = {"density": 1025, "surface": 0, "waves": waves | {"seed": seed}}
        result = hybrid.run(tables | {"environment": {"fluid": fluid}})
        late = result.times > 100.0
        place = result.position[late].std(axis=0)
        for values, found in zip(there, (result.tension[late].std(axis=0), place[:, 0], place[:, 1]), strict=True):
            values.append(found)
    found = hybrid.response(tables).lines["cable"]
    at = [int(np.abs(found.s - s).argmin()) for s in places]
    ours = (np.interp(places, found.middle, found.deviation("tension")), *found.deviation("position")[at, :2].T)
    for name, here, values in zip(("tension", "x", "y"), ours, there, strict=True):
        off = here / np.mean(values, axis=0) - 1.0
        scatter = np.std(values, axis=0, ddof=1) / np.mean(values, axis=0)
        print(f"\n{name}: {', '.join(f'{100 * x:+.1f} %' for x in off)}; seeds scatter by {100 * scatter.max():.1f} %")
        assert np.abs(off).max() < 0.1
