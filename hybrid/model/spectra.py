"""Irregular seas as sums of linear waves: spectra, their parts of equal energy, directions that spread.

symbol   meaning                                  unit
w, w_p   angular frequency, at the peak           1/s
S        spectrum of the elevation                m^2 s
H        significant height                       m
l        shape of a part of Ochi and Hubble       -
s        exponent of the spreading                -
"""

from __future__ import annotations

import math

import numpy as np

from hybrid.kernels.state.state import Floats
from hybrid.scene.measured_spectrum import FINE, shares
from hybrid.scene.spectra import (
    JonswapWaves,
    OchiHubbleWaves,
    PiersonMoskowitzWaves,
    Spectrum,
    Spreading,
    TorsethaugenWaves,
)

# Frequencies of an irregular sea, in peak frequencies: outside lies less than 0.2 % of its energy.
LOWEST, HIGHEST = 0.3, 6.0


def jonswap(omega: Floats, peak: float, gamma: float) -> Floats:
    """JONSWAP spectrum over frequency (1/s), not normalised."""
    width = np.where(omega <= peak, 0.07, 0.09)
    crest = np.exp(-0.5 * ((omega - peak) / (width * peak)) ** 2)
    return np.asarray(omega**-5.0 * np.exp(-1.25 * (peak / omega) ** 4) * gamma**crest)


def ochi_hubble(omega: Floats, parts: list[tuple[float, float, float]]) -> Floats:
    """Spectrum (m^2 s) over frequency (1/s) of parts of significant height (m), peak (1/s) and shape l.

    (1/4) a^l H^2/(Gamma(l) w^(4 l + 1)) exp(-a/w^4), a = (4 l + 1) w_p^4/4 (Ochi and Hubble 1976), of each part; its
    integral is H^2/16, its largest value at w_p, and l = 1 is the spectrum of Pierson and Moskowitz.
    """
    S = np.zeros_like(omega)
    for height, peak, shape in parts:
        x = (shape + 0.25) * (peak / omega) ** 4
        size = shape * np.log(x) - x - np.log(omega) - math.lgamma(shape)
        S += 0.25 * height**2 * np.exp(size)
    return S


def torsethaugen(omega: Floats, height: float, period: float, gravity: float) -> Floats:
    """Spectrum (m^2 s) of swell and wind sea over frequency (1/s); height: m; period: s, of the higher peak.

    Torsethaugen 1996, as a public code of Norsk Hydro has it (MSS, torsetSpectrum): x^-n exp(-(n/m) x^-m) gamma^.. of
    each part, x = w/w_p, of energy H^2/16 here exactly; gamma is 1 at least.
    """
    return np.sum([_torsethaugen_part(omega, *x) for x in torsethaugen_parts(height, period, gravity)], axis=0)


def torsethaugen_parts(height: float, period: float, gravity: float) -> list[tuple[float, float, float, float, float]]:
    """Significant height (m), peak (1/s), n, m and gamma of wind sea and swell."""
    limit = 6.6 * height ** (1.0 / 3.0)  # s, of a sea that is fully grown on the fetch
    n = 0.5 * math.sqrt(height) + 3.2
    peaked = 35.0 * (1.0 + 3.5 * math.exp(-height))
    if period < limit:
        short = (limit - period) / (limit - 2.0 * math.sqrt(height))
        wind = 0.7 + 0.3 * math.exp(-((short / 0.5) ** 2))
        steepness = 2.0 * math.pi * wind * height / (gravity * period**2)
        gamma = max(peaked * steepness**0.857, 1.0)
        swell = math.sqrt(1.0 - wind**2) * height
        return [(wind * height, 2 * np.pi / period, n, 4.0, gamma), (swell, 2 * np.pi / (limit + 2.0), n, 4.0, 1.0)]
    long = (period - limit) / (25.0 - limit)
    swell = 0.6 + 0.4 * math.exp(-((long / 0.3) ** 2))
    wind = math.sqrt(1.0 - swell**2) * height
    gamma = max(peaked * (2.0 * math.pi * height / (gravity * limit**2)) ** 0.857 * (1.0 + 6.0 * long), 1.0)
    parts = [(swell * height, 2 * np.pi / period, n, 4.0, gamma)]
    if wind > 0.0:
        m = 4.0 * (1.0 - 0.7 * math.exp(-height / 3.0))
        order = (n - 1.0) / m
        factor = m / math.gamma(order) * (n / m) ** order
        size = factor * wind**2 / (16.0 * 0.08 * (1.0 - math.exp(-height / 3.0)) * 0.4**n)
        parts.append((wind, 2 * np.pi / size ** (1.0 / (n - 1.0)), n, m, 1.0))
    return parts


def _torsethaugen_part(omega: Floats, height: float, peak: float, n: float, m: float, gamma: float) -> Floats:
    def shape(w: Floats) -> Floats:
        x = w / peak
        width = np.where(x <= 1.0, 0.07, 0.09)
        return np.asarray(x**-n * np.exp(-n / m * x**-m) * gamma ** np.exp(-0.5 * ((x - 1.0) / width) ** 2))

    fine = peak * np.geomspace(0.1, 100.0, FINE)
    return np.asarray(height**2 / 16.0 * shape(omega) / np.trapezoid(shape(fine), fine))


def directions(spreading: Spreading, n: int, draw: np.random.Generator) -> Floats:
    """Angles (n,) rad from the mean direction, one for each wave, in random order.

    The distribution cos^2s of half the angle is cut into n parts of equal energy, and in each an angle is drawn: with
    y the sine of half the angle, (1 + y)/2 has a beta distribution with both parameters s + 1/2.
    """
    from scipy.special import betaincinv  # slow to import

    part = (draw.permutation(n) + draw.uniform(size=n)) / n
    half = spreading.exponent + 0.5
    return np.asarray(2.0 * np.arcsin(2.0 * betaincinv(half, half, part) - 1.0))


def waves_of(sea: Spectrum, gravity: float, order: int = 0, of: int = 1) -> tuple[Floats, Floats, Floats, Floats]:
    """Amplitudes (m), frequencies (1/s), phases and directions (rad), (n,) each, of an irregular sea.

    order, of: which it is of how many that act together: their frequencies lie between each other, and their phases are
    drawn anew, so that seas that are alike are independent.
    """
    omega, S, height = _spectrum(sea, gravity)
    n = sea.components
    w, share = shares(omega, S, n, order / of)
    amplitude = 0.25 * height * np.sqrt(2.0 * share)
    if not order:
        amplitude = np.full(n, 0.25 * height * math.sqrt(2.0 / n))
    draw = np.random.default_rng([sea.seed, order] if order else sea.seed)
    phase = draw.uniform(0.0, 2 * np.pi, n)
    towards = np.full(n, math.radians(sea.direction))
    if sea.spreading is not None:
        towards += directions(sea.spreading, n, draw)
    return amplitude, w, phase, towards


def _spectrum(sea: Spectrum, gravity: float) -> tuple[Floats, Floats, float]:
    """Fine frequencies (1/s) of a sea, its spectrum there in any unit, and its significant height (m)."""
    if isinstance(sea, OchiHubbleWaves):
        parts = [(x.significant_height, 2 * np.pi / x.peak_period, x.shape) for x in sea.parts]
        peaks = [peak for _, peak, _ in parts]
        omega = np.geomspace(LOWEST * min(peaks), HIGHEST * max(peaks), FINE)
        return omega, ochi_hubble(omega, parts), sea.significant_height
    if isinstance(sea, TorsethaugenWaves):
        peaks = [x[1] for x in torsethaugen_parts(sea.significant_height, sea.peak_period, gravity)]
        omega = np.geomspace(LOWEST * min(peaks), HIGHEST * max(peaks), FINE)
        return omega, torsethaugen(omega, sea.significant_height, sea.peak_period, gravity), sea.significant_height
    assert isinstance(sea, JonswapWaves | PiersonMoskowitzWaves)
    peak = 2 * np.pi / sea.main_period
    omega = peak * np.geomspace(LOWEST, HIGHEST, FINE)
    return omega, jonswap(omega, peak, getattr(sea, "gamma", 1.0)), sea.significant_height
