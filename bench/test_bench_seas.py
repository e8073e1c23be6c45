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

from hybrid.model.sea import components
from hybrid.scene.spectra import JonswapWaves, OchiHubbleWaves, PiersonMoskowitzWaves, SumOfWaves, TorsethaugenWaves

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
