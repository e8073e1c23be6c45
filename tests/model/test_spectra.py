"""Seas as sums of waves: spectra against closed forms, directions, waves of files, realisations within their confidence."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.special import gamma as Gamma

import hybrid
from hybrid.errors import SceneError
from hybrid.model.sea import (
    components,
    directions,
    jonswap,
    ochi_hubble,
    surroundings,
    torsethaugen,
    torsethaugen_parts,
)
from hybrid.scene.wave_theory import (
    CROSSINGS,
    JonswapWaves,
    OchiHubbleWaves,
    PiersonMoskowitzWaves,
    Spreading,
    SumOfWaves,
    TorsethaugenWaves,
)
from tests.scenes import cable_scene, pinned_at

G = 9.81
SWELL = {"kind": "jonswap", "significant_height": 2.0, "peak_period": 14.0, "gamma": 6, "direction": 200.0}
WIND_SEA = {"kind": "pierson_moskowitz", "significant_height": 1.5, "zero_crossing_period": 5.0, "direction": -60.0}
TWO_PEAKS = [
    {"significant_height": 2.0, "peak_period": 14.0, "shape": 3.0},
    {"significant_height": 1.5, "peak_period": 6.0, "shape": 1.2},
]


def irregular(kind, **tables):
    """A sea by spectrum of each kind."""
    return {
        "jonswap": JonswapWaves, "pierson_moskowitz": PiersonMoskowitzWaves, "ochi_hubble": OchiHubbleWaves,
        "torsethaugen": TorsethaugenWaves, "sum": SumOfWaves,
    }[kind](**tables)  # fmt: skip


SEAS = {
    "jonswap": {"significant_height": 3.0, "peak_period": 9.0},
    "pierson_moskowitz": {"significant_height": 3.0, "peak_period": 9.0},
    "ochi_hubble": {"parts": TWO_PEAKS},
    "torsethaugen": {"significant_height": 2.5, "peak_period": 13.0},
    "sum": {"spectra": [SWELL, WIND_SEA]},
}
SPREAD = {name: x | ({} if name == "sum" else {"spreading": {"exponent": 8}}) for name, x in SEAS.items()}
SPREAD["sum"] = {"spectra": [SWELL | {"spreading": {"exponent": 30}}, WIND_SEA | {"spreading": {"exponent": 5}}]}


# --- spectra -----------------------------------------------------------------------------------


@pytest.mark.parametrize("shape", [0.8, 1.0, 3.0])
def test_a_part_of_ochi_and_hubble(shape):
    """Its energy is H^2/16, its peak where it is asked for, its moments those of a gamma function; 1 is ISSC."""
    H, peak = 2.5, 0.6
    part = [(H, peak, shape)]

    def moment(n):
        return quad(lambda w: float(ochi_hubble(np.array([w]), part)[0]) * w**n, 0.05, np.inf, limit=400)[0]

    assert moment(0) == pytest.approx(H**2 / 16.0, rel=1e-8)
    a = (shape + 0.25) * peak**4  # w^-4 a has a gamma distribution of shape l
    assert moment(1) / moment(0) == pytest.approx(a**0.25 * Gamma(shape - 0.25) / Gamma(shape), rel=1e-6)
    w = np.linspace(0.3, 2.0, 20001)
    assert w[np.argmax(ochi_hubble(w, part))] == pytest.approx(peak, abs=1e-4)
    if shape == 1.0:
        issc = 5.0 / 16.0 * H**2 * peak**4 * jonswap(w, peak, 1.0)
        np.testing.assert_allclose(ochi_hubble(w, part), issc, rtol=1e-12)


def test_period_of_zero_crossings():
    """Tz of the whole spectrum is 0.7104 Tp; and seas by either period are one."""
    by_tz = PiersonMoskowitzWaves(significant_height=3.0, zero_crossing_period=CROSSINGS * 9.0)
    by_tp = PiersonMoskowitzWaves(significant_height=3.0, peak_period=9.0)
    one = JonswapWaves(significant_height=3.0, peak_period=9.0, gamma=1.0)
    assert pytest.approx(0.71037, abs=1e-5) == CROSSINGS
    assert np.array_equal(components(by_tp, math.inf, G), components(one, math.inf, G))
    np.testing.assert_allclose(components(by_tz, math.inf, G), components(by_tp, math.inf, G), rtol=1e-12)
    waves = components(by_tp.model_copy(update={"components": 1000}), math.inf, G)
    tz = 2 * math.pi * math.sqrt(np.sum(waves[:, 0] ** 2) / np.sum((waves[:, 0] * waves[:, 1]) ** 2))
    assert 1.01 < tz / (CROSSINGS * 9.0) < 1.02  # the spectrum ends at 6 peak frequencies


@pytest.mark.parametrize("kind", SEAS)
def test_energy_is_that_of_the_spectrum(kind):
    sea = irregular(kind, **SEAS[kind])
    waves = components(sea, 60.0, G)
    assert 16.0 * np.sum(0.5 * waves[:, 0] ** 2) == pytest.approx(sea.significant_height**2, rel=1e-12)
    assert len(waves) == sea.waves_in_sum
    assert np.array_equal(waves, components(sea, 60.0, G))
    if kind == "ochi_hubble":
        two = [OchiHubbleWaves(parts=[x | {"significant_height": 1e-6} if k == i else x for i, x in enumerate(TWO_PEAKS)])
               for k in (1, 0)]  # fmt: skip
        m2 = [np.sum(0.5 * (x[:, 0] * x[:, 1]) ** 2) for x in (components(y, 60.0, G) for y in (sea, *two))]
        assert m2[0] == pytest.approx(m2[1] + m2[2], rel=0.02)  # where each is cut


def test_seas_of_a_sum_are_independent():
    """Two that are alike: no frequency in common, twice the energy, the parts of each as it is alone."""
    same = {"kind": "jonswap", "significant_height": 2.0, "peak_period": 8.0, "components": 50}
    waves = components(SumOfWaves(spectra=[same, same, same]), math.inf, G)
    alone = components(JonswapWaves(**{k: x for k, x in same.items() if k != "kind"}), math.inf, G)
    assert np.array_equal(waves[:50], alone)
    assert 16.0 * np.sum(0.5 * waves[:, 0] ** 2) == pytest.approx(12.0, rel=1e-12)
    w = np.sort(waves[:, 1])
    assert np.diff(w).min() > 0.1 * np.median(np.diff(w))
    m2 = [np.sum((x[:, 0] * x[:, 1]) ** 2) for x in (waves[:50], waves[50:100], waves[100:])]
    np.testing.assert_allclose(m2[1:], m2[0], rtol=1e-6)


def test_wind_sea_and_swell_of_torsethaugen():
    """The formulas with numbers put in, on both sides of the period of a fully grown sea, where they meet.

    H 2 m: 6.6 2^(1/3) = 8.3155 s.  T 6 s: e = (8.3155 - 6)/(8.3155 - 2.8284) = 0.42199, wind sea 0.7 + 0.3 exp(-0.71230).
    T 14 s: e = (14 - 8.3155)/(25 - 8.3155) = 0.34071, swell 0.6 + 0.4 exp(-1.28979).
    """
    (wind, w, n, m, gamma), (swell, s, *_) = torsethaugen_parts(2.0, 6.0, G)
    assert (n, m) == (pytest.approx(3.2 + 0.5 * 1.41421356), 4.0)
    assert wind == pytest.approx(2.0 * 0.847156, rel=1e-5) and wind**2 + swell**2 == pytest.approx(4.0)
    assert (w, s) == (pytest.approx(2 * math.pi / 6.0), pytest.approx(2 * math.pi / 10.31548, rel=1e-6))
    assert gamma == pytest.approx(35.0 * (1.0 + 3.5 * 0.1353353) * (2 * math.pi * wind / (G * 36.0)) ** 0.857, rel=1e-6)
    (swell, s, _, _, peaked), (wind, w, _, m, one) = torsethaugen_parts(2.0, 14.0, G)
    assert swell == pytest.approx(2.0 * 0.710130, rel=1e-5) and wind**2 + swell**2 == pytest.approx(4.0)
    assert peaked == pytest.approx(35.0 * 1.473673 * (2 * math.pi * 2.0 / (G * 69.14707)) ** 0.857 * 3.04426, rel=1e-4)
    assert m == pytest.approx(4.0 * (1.0 - 0.7 * 0.513417), rel=1e-5) and one == 1.0 and w > s
    below, above = (torsethaugen_parts(2.0, 6.6 * 2.0 ** (1 / 3) + x, G) for x in (-1e-6, 1e-6))
    assert below[0][0] == pytest.approx(2.0) and above[0][0] == pytest.approx(2.0)
    assert below[0][4] == pytest.approx(above[0][4], rel=1e-5)
    omega = np.geomspace(0.05, 60.0, 40001)
    for T in (6.0, 8.3, 14.0):
        S = torsethaugen(omega, 2.0, T, G)
        assert 16.0 * np.trapezoid(S, omega) == pytest.approx(4.0, rel=2e-3)
        assert omega[np.argmax(S)] == pytest.approx(2 * math.pi / T, rel=1e-2)


# --- directions --------------------------------------------------------------------------------


@pytest.mark.parametrize("s", [0.5, 1.0, 4.0, 15.0, 200.0])
def test_directions_have_their_distribution(s):
    """Means of cos and cos of twice the angle: s/(s + 1) and s(s - 1)/((s + 1)(s + 2)), and the density at the middle.

    Drawn in parts of equal energy, they are off by less than the largest part of one.
    """
    n = 4000
    angle = directions(Spreading(exponent=s), n, np.random.default_rng(2))
    assert np.cos(angle).mean() == pytest.approx(s / (s + 1.0), abs=2e-3)
    assert np.cos(2.0 * angle).mean() == pytest.approx(s * (s - 1.0) / ((s + 1.0) * (s + 2.0)), abs=4e-3)
    assert abs(np.sin(angle).mean()) < 2e-3
    factor = Gamma(s + 1.0) / (2.0 * math.sqrt(math.pi) * Gamma(s + 0.5)) if s < 100 else math.sqrt(s / math.pi) / 2.0
    near = 0.5 / factor * 0.2
    assert np.mean(np.abs(angle) < near) == pytest.approx(2.0 * near * factor, rel=0.02)
    neighbours = np.corrcoef(angle[1:], angle[:-1])[0, 1]
    assert abs(neighbours) < 0.06  # waves of near frequencies do not go the same way


@pytest.mark.parametrize("kind", SPREAD)
def test_spreading_changes_directions_alone(kind):
    plain, spread = (components(irregular(kind, **x[kind]), 40.0, G) for x in (SEAS, SPREAD))
    assert np.array_equal(plain[:, [0, 1, 5]], spread[:, [0, 1, 5]])
    if kind != "sum":
        assert np.array_equal(plain[:, 4], spread[:, 4])
    np.testing.assert_allclose(np.hypot(spread[:, 2], spread[:, 3]), spread[:, 5], rtol=1e-14)
    assert np.abs(plain[:, 2:4] - spread[:, 2:4]).max() > 0.01


def test_a_turned_sea_is_turned():
    tables = SPREAD["jonswap"]
    a, b = (components(JonswapWaves(**tables, direction=x), 40.0, G) for x in (0.0, 70.0))
    c, s = math.cos(math.radians(70.0)), math.sin(math.radians(70.0))
    np.testing.assert_allclose(b[:, 2:4], a[:, 2:4] @ np.array([[c, s], [-s, c]]), atol=1e-14)


# --- realisations ------------------------------------------------------------------------------


def beats(waves, duration):
    """Variance (m^4) of the mean square elevation over a time (s), from realisation to realisation.

    Of sum A cos(w t + phase): A_j A_k sinc((w_j - w_k) T/2) cos(..) for each pair, and what has the sum of both
    frequencies, which is small.
    """
    A, w = waves[:, 0], waves[:, 1]
    pairs = np.sinc(np.subtract.outer(w, w) * duration / (2.0 * np.pi))  # sin(pi x)/(pi x)
    np.fill_diagonal(pairs, 0.0)
    return 0.25 * float(A**2 @ pairs**2 @ A**2)


def statistics_of(sea, seeds, duration, step=0.25):
    """Of each seed: mean square of the elevation at a place (m^2), and its zero crossings per second."""
    t = np.arange(0.0, duration, step)
    out = []
    for seed in seeds:
        waves = components(sea.model_copy(update={"seed": seed}), math.inf, G)
        eta = np.zeros(t.size)
        for A, w, kx, ky, phase, _ in waves:
            eta += A * np.cos(37.0 * kx - 12.0 * ky - w * t + phase)
        out.append((np.mean(eta**2), np.sum((eta[:-1] < 0.0) & (eta[1:] >= 0.0)) / duration))
    return np.array(out), waves


def test_realisations_within_their_confidence():
    """Forty of five minutes, spread: Hs and Tz within three standard errors, and Hs scatters as its beats do."""
    sea = JonswapWaves(significant_height=3.0, peak_period=9.0, components=80, spreading={"exponent": 6})
    found, waves = statistics_of(sea, range(40), 300.0, 0.5)
    m0, later = (float(np.sum(0.5 * waves[:, 0] ** 2 * np.cos(waves[:, 1] * x))) for x in (0.0, 0.5))
    wanted = np.array([m0, math.acos(later / m0) / (2.0 * math.pi * 0.5)])  # of samples of a Gaussian process
    error = found.std(axis=0, ddof=1) / math.sqrt(len(found))
    assert np.all(np.abs(found.mean(axis=0) - wanted) < 3.0 * error)
    assert m0 == pytest.approx(9.0 / 16.0, rel=1e-12)
    assert 0.7 < found[:, 0].std(ddof=1) / math.sqrt(beats(waves, 300.0)) < 1.4


# --- waves of files ------------------------------------------------------------------------------


def scene(waves, **more):
    return hybrid.validate_scene(
        cable_scene({"length": 20, "mass": 5, "diameter": 0.05, "drag": {"normal": 1.0}}, pinned_at(0, 0, 0), "free",
                    fluid={"density": 1025, "surface": 0, "waves": waves}, model="catenary", mesh=5) | more
    )  # fmt: skip


def test_waves_one_by_one(tmp_path: Path):
    """A file of the waves of a spread sea is that sea; its order of columns does not matter."""
    sea = JonswapWaves(**SPREAD["jonswap"], components=9, direction=40.0)
    waves = components(sea, 70.0, G)
    rows = ["phase,amplitude,direction,frequency"]
    for A, w, kx, ky, phase, _ in waves.tolist():
        rows.append(f"{math.degrees(phase)!r},{A!r},{math.degrees(math.atan2(ky, kx))!r},{w!r}")
    (tmp_path / "sea.csv").write_text("\n".join(rows))
    given = scene({"kind": "components", "file": str(tmp_path / "sea.csv"), "depth": 70.0})
    values = surroundings(given, 5).values
    np.testing.assert_allclose(values.waves, waves, rtol=1e-12, atol=1e-12)
    assert given.environment.waves.significant_height == pytest.approx(3.0)
    assert given.environment.named_files() == [str(tmp_path / "sea.csv")]


def record(folder: Path, begin=-20.0, mean=0.3, rows=400, step=0.5):
    """An elevation with waves of 20, 5 and 2.5 s, three of which fit into it."""
    t = begin + step * np.arange(rows)
    w = 2.0 * math.pi / np.array([20.0, 5.0, 2.5])
    eta = mean + 0.8 * np.cos(w[0] * t - 0.4) + 0.5 * np.sin(w[1] * t) + 0.2 * np.cos(w[2] * t + 2.0)
    (folder / "eta.csv").write_text(
        "t,elevation\n" + "\n".join(f"{a:.3f},{b:.12f}" for a, b in zip(t, eta, strict=True))
    )
    return t, eta - mean


def test_a_record_is_met_where_it_was_measured(tmp_path: Path):
    t, eta = record(tmp_path)
    waves = {
        "kind": "record", "file": str(tmp_path / "eta.csv"), "position": [30.0, -10.0], "direction": 25.0, "depth": 30,
        "shortest_period": 1.1,
    }  # fmt: skip
    around = surroundings(scene(waves), 5)
    there = [around.elevation(30.0, -10.0, float(x))[0] for x in t[::7]]
    np.testing.assert_allclose(there, eta[::7], atol=1e-9)
    assert abs(around.elevation(0.0, 0.0, float(t[0]))[0] - eta[0]) > 0.01
    band = waves | {"shortest_period": 3.0, "longest_period": 19.0}
    found = scene(band).environment.waves.recorded
    total = 0.5 * (0.8**2 + 0.5**2 + 0.2**2)
    assert found.lost == pytest.approx(1.0 - 0.5 * 0.5**2 / total, rel=1e-6)
    assert found.mean == pytest.approx(0.3, abs=1e-9) and found.energy_period == pytest.approx(5.0, rel=1e-3)


def test_what_a_record_loses_is_noted(tmp_path: Path):
    record(tmp_path)
    waves = {"kind": "record", "file": str(tmp_path / "eta.csv"), "shortest_period": 3.0, "ramp": 5.0}
    result = hybrid.run(scene(waves, time={"duration": 1.0, "step": 0.25}))
    (note,) = [x.text for x in result.events if "record of the sea" in x.text]
    assert "4.3 % of its variance" in note and "0.3 m" in note


SAID = {
    "two periods": (WIND_SEA | {"peak_period": 7}, "zero_crossing_period", "because peak_period says it"),
    "no period": ({k: x for k, x in WIND_SEA.items() if "period" not in k}, "peak_period", "a number > 0, in s"),
    "a ramp of one": ({"kind": "sum", "spectra": [SWELL, WIND_SEA | {"ramp": 3}]}, "spectra.1.ramp", "have the same"),
    "a sum of a sum": ({"kind": "sum", "spectra": [SWELL, {"kind": "sum"}]}, "spectra.1.kind", "one of: jonswap"),
    "one part": ({"kind": "ochi_hubble", "parts": TWO_PEAKS[:1]}, "parts", "at least 2"),
    "breaks": (
        {"kind": "sum", "spectra": [SWELL, WIND_SEA | {"significant_height": 12}]}, "spectra.1.significant_height",
        "higher ones break",
    ),
    "too high": (
        {"kind": "stream_function", "height": 20, "period": 8}, "height", "no wave of 8 s in deep water is that high",
    ),
    "few harmonics": (
        {"kind": "stream_function", "height": 4.5, "period": 15, "depth": 8, "order": 8}, "order", "more, because",
    ),
    "narrow": (SWELL | {"spreading": {"exponent": 2000}}, "spreading.exponent", "1000"),
}  # fmt: skip


@pytest.mark.parametrize("name", SAID)
def test_seas_that_are_refused(name):
    waves, key, expected = SAID[name]
    with pytest.raises(SceneError) as refused:
        scene(waves)
    (found,) = refused.value.complaints
    assert found.where.replace("[", ".").replace("]", "") == f"environment.fluid.waves.{key}"
    assert expected in found.expected


def test_spread_seas_are_in_no_plane():
    tables = {"dimension": 2, "time": {"duration": 1, "step": 0.1}}
    assert scene(SWELL, **tables).dimension == 2
    with pytest.raises(SceneError, match=r"environment\.fluid\.waves\.spreading"):
        scene(SWELL | {"spreading": {"exponent": 10}}, **tables)


def test_a_run_goes_on_no_longer_than_its_record(tmp_path: Path):
    record(tmp_path, begin=0.0, mean=0.0, rows=40)
    waves = {"kind": "record", "file": str(tmp_path / "eta.csv"), "ramp": 5.0}
    with hybrid.run(scene(waves, time={"duration": 1.0, "step": 0.25}), tmp_path / "run.h5") as result:
        assert not any("record of the sea" in x.text for x in result.events)  # nothing of it is left out
    with pytest.raises(SceneError, match="at most 20 s, the end of the record"):
        hybrid.resume(tmp_path / "run.h5", until=21.0)
    with hybrid.resume(tmp_path / "run.h5", until=2.0) as result:
        assert result.times[-1] == 2.0


REFUSED = {
    "columns": ("components", "amplitude,period,direction,phase\n1,2,3,4\n", "columns amplitude,frequency,direction"),
    "no amplitude": ("components", "amplitude,frequency,direction,phase\n1,1,0,0\n0,2,3,4\n", "line 3: amplitude = 0"),
    "no rows": ("components", "amplitude,frequency,direction,phase\n", "1 to 5000 rows"),
    "breaking": ("components", "amplitude,frequency,direction,phase\n9,1.2,0,0\n", "higher ones break"),
    "a gap": ("record", "t,elevation\n" + "".join(f"{x},0.1\n" for x in (*range(9), 10)), "equal, rising steps"),
    "short": ("record", "t,elevation\n0,1\n1,2\n", "at least 8 rows"),
    "no waves": ("record", "t,elevation\n" + "".join(f"{x},0.1\n" for x in range(9)), "1 to 5000 harmonics"),
    "too late": ("record", "t,elevation\n" + "".join(f"{x + 2},{x % 3}e-3\n" for x in range(90)), "from t = 0 on"),
    "too short": ("record", "t,elevation\n" + "".join(f"{x},{x % 3}e-3\n" for x in range(20)), "at most 20 s"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_files_that_are_refused(name, tmp_path: Path):
    kind, text, expected = REFUSED[name]
    (tmp_path / "sea.csv").write_text(text)
    with pytest.raises(SceneError, match=expected):
        scene({"kind": kind, "file": str(tmp_path / "sea.csv")}, time={"duration": 30.0, "step": 0.1})


# --- one wave of finite height -------------------------------------------------------------------

HIGH = {"kind": "stream_function", "height": 4.0, "period": 7.0, "direction": 35.0, "depth": 40.0, "ramp": 2.0}


def test_a_line_in_high_waves_is_one_of_several_and_is_turned_with_them():
    tables = cable_scene(
        {"length": 20, "mass": 5, "diameter": 0.05, "drag": {"normal": 1.0}},
        pinned_at(0, 0, 0, motion={"follow": "waves"}), "free", fluid={"density": 1025, "surface": 0, "waves": HIGH},
        model="catenary", mesh=10, time=(4.0, 0.1), output=0.5
    )  # fmt: skip
    one = hybrid.run(tables)
    line = {"sections": tables["cable"]["sections"], "start": "a", "end": "b", "model": "catenary"}
    points = {
        "a": {"kind": "fixed", "position": [0, 0, 0], "motion": {"follow": "waves"}},
        "b": {"kind": "free", "initial_guess": [0, 0, -20]},
    }
    several = {
        "environment": tables["environment"], "points": points, "lines": {"l": line | {"mesh": {"cells": 10}}},
        "time": tables["time"], "output": tables["output"],
    }  # fmt: skip
    np.testing.assert_allclose(hybrid.run(several).lines["l"].position, one.position, atol=1e-7)
    turned = tables | {"environment": {"fluid": {"density": 1025, "surface": 0, "waves": HIGH | {"direction": 125.0}}}}
    x, y, z = np.moveaxis(hybrid.run(turned).position, -1, 0)
    np.testing.assert_allclose(np.stack([y, -x, z], axis=-1), one.position, atol=1e-9)
    assert np.ptp(one.position[:, 0, 2]) > 1.0 and np.abs(one.position[..., 0]).max() > 0.05


def test_what_is_linear_is_refused_beside_high_waves():
    with pytest.raises(SceneError, match="a response by frequency is linear"):
        hybrid.response(scene(HIGH))


def test_widths_of_the_peak_of_torsethaugen():
    """Before the peak 0.07, behind it 0.09, as of JONSWAP: a spectrum of its own, integrated by quadrature."""
    for height, period in ((5.0, 9.0), (2.5, 13.0)):
        parts = torsethaugen_parts(height, period, G)
        assert parts[0][4] > 1.5, "else it has no width"

        def own(w, parts=parts):
            return sum(H**2 / 16.0 * shape(w / p, n, m, g) / (p * area(n, m, g)) for H, p, n, m, g in parts)

        w = parts[0][1] * np.array([0.85, 0.93, 0.97, 1.03, 1.09, 1.2])
        np.testing.assert_allclose(torsethaugen(w, height, period, G), own(w), rtol=1e-4)


def shape(x, n, m, gamma):
    """x^-n exp(-(n/m) x^-m) gamma^exp(..) at frequencies over that of the peak."""
    wide = np.where(x <= 1.0, 0.07, 0.09)
    return x**-n * np.exp(-n / m * x**-m) * gamma ** np.exp(-((x - 1.0) ** 2) / (2.0 * wide**2))


def area(n, m, gamma):
    """Its integral."""
    return sum(quad(lambda x: float(shape(x, n, m, gamma)), a, b, limit=400)[0] for a, b in ((0.1, 1.0), (1.0, 100.0)))
