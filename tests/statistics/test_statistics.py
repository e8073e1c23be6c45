"""Moments, crossings, spectra, extremes and fatigue against closed forms and independent programs."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy import stats

from hybrid.errors import ResultError
from hybrid.statistics import extremes, fatigue, moments

# A Gaussian process of many components with random phases: JONSWAP-like, significant value 4, peak period 10 s.
DT, HOUR = 0.25, 3600.0


def density(f: np.ndarray, significant: float = 4.0, peak: float = 0.1, gamma: float = 3.3) -> np.ndarray:
    """JONSWAP density (unit squared per Hz) whose zeroth moment is (significant / 4)^2."""
    width = np.where(f <= peak, 0.07, 0.09)
    with np.errstate(divide="ignore", over="ignore", invalid="ignore"):
        S = f**-5.0 * np.exp(-1.25 * (peak / f) ** 4) * gamma ** np.exp(-((f - peak) ** 2) / (2 * width**2 * peak**2))
    S = np.nan_to_num(S)
    return S * (significant / 4.0) ** 2 / np.trapezoid(S, f)


def record(duration: float, seed: int, dt: float = DT) -> tuple[np.ndarray, np.ndarray]:
    """Times and a Gaussian history of `density`: complex amplitudes with random real and imaginary parts."""
    n = int(duration / dt)
    f = np.fft.rfftfreq(n, dt)
    S = density(f, peak=0.1)
    S[f > 0.6] = 0.0
    rng = np.random.default_rng(seed)
    amplitude = np.sqrt(S * f[1] / 2.0)
    z = amplitude * (rng.standard_normal(f.size) + 1j * rng.standard_normal(f.size))
    return dt * np.arange(n), np.fft.irfft(z, n) * n / math.sqrt(2.0)


def exact_moment(n: int) -> float:
    f = np.linspace(0.0, 0.6, 60001)
    return float(np.trapezoid(f**n * density(f), f))


def test_moments_of_a_sine_and_of_uneven_times() -> None:
    """Mean 3, deviation 2/sqrt 2, no skewness, period 5 s, range 4; also at times that crowd on one side."""
    rng = np.random.default_rng(1)
    even = np.linspace(0.0, 100.0, 8001)
    crowded = np.unique(np.concatenate([even, rng.uniform(0.0, 2.5, 4000)]))
    for t in (even, crowded):
        found = moments.summary(t, 3.0 + 2.0 * np.sin(2.0 * np.pi * t / 5.0))
        assert found.mean == pytest.approx(3.0, abs=1e-5)
        assert found.standard_deviation == pytest.approx(math.sqrt(2.0), rel=1e-5)
        assert found.skewness == pytest.approx(0.0, abs=1e-5)
        assert found.crossing_period == pytest.approx(5.0, rel=1e-6)
        assert found.significant_range == pytest.approx(4.0, rel=1e-4)
        assert (found.minimum, found.maximum) == pytest.approx((1.0, 5.0), abs=1e-5)
        assert found.t_maximum % 5.0 == pytest.approx(1.25, abs=0.02)


def test_median_is_that_of_the_time() -> None:
    """Half of the time is spent below it, however steps are spread; of a steady history it is its value."""
    rng = np.random.default_rng(3)
    t = np.sort(np.concatenate([np.linspace(0.0, 4.0, 401), rng.uniform(0.0, 1.0, 4000)]))
    x = np.stack([t**2, np.full_like(t, 7.0), -t], axis=1)
    found = moments.median_over_time(t, x)
    assert found == pytest.approx([4.0, 7.0, -2.0], rel=1e-3) and found[1] == 7.0
    assert np.median(x[:, 0]) < 2.0  # of the samples it is another


def test_skewness_is_that_of_scipy() -> None:
    x = np.random.default_rng(2).gamma(2.0, size=200_000)
    fine = moments.summary(np.arange(x.size) * 1.0, np.repeat(x, 1))
    steps = np.repeat(x, 2)  # constant between times, but for short ramps: the same law of values
    t = np.ravel(np.column_stack([np.arange(x.size), np.arange(x.size) + 0.9999]))
    assert moments.summary(t, steps).skewness == pytest.approx(stats.skew(x), rel=1e-3)
    assert fine.mean == pytest.approx(x.mean(), rel=1e-4)


def test_fields_are_taken_column_by_column() -> None:
    t = np.linspace(0.0, 50.0, 2001)
    x = np.stack([np.sin(t), 5.0 + 0.1 * np.cos(2.0 * t), np.full(t.size, 7.0)], axis=1)
    found = moments.summary(t, x)
    for k in range(2):
        one = moments.summary(t, x[:, k])
        for all_of_them, alone in zip(found, one, strict=True):
            assert all_of_them[k] == pytest.approx(alone, rel=1e-9, abs=1e-12)
    assert found.standard_deviation[2] < 1e-9 and np.isnan(found.skewness[2]) and np.isnan(found.crossing_period[2])


@pytest.mark.parametrize(
    ("t", "x"),
    [([0.0, 1.0], [1.0]), ([0.0], [1.0]), ([0.0, 0.0], [1.0, 2.0]), ([0.0, 1.0], [1.0, math.nan]), ([[0.0]], [1.0])],
)
def test_what_is_no_history_is_refused(t: list, x: list) -> None:
    with pytest.raises(ResultError):
        moments.summary(t, x)


def test_significant_height_of_a_jonswap_record() -> None:
    """Within 2 %: an hour of one record, and four deviations; and Tz of its spectrum."""
    t, x = record(3.0 * HOUR, 3)
    assert 4.0 * moments.summary(t, x).standard_deviation == pytest.approx(4.0, rel=0.02)
    found = moments.welch(t, x)
    assert found.significant == pytest.approx(4.0, rel=0.02)
    assert found.peak_period == pytest.approx(10.0, rel=0.1)
    assert found.crossing_period == pytest.approx(math.sqrt(exact_moment(0) / exact_moment(2)), rel=0.02)
    # H1/3 of a narrow sea is 4 deviations, of this one a few per cent less
    assert 3.6 < moments.summary(t, x).significant_range < 4.0


def test_spectrum_is_that_of_the_process() -> None:
    """The mean of many records, against the density they were made of, where it is not small."""
    found = [moments.welch(*record(HOUR, seed), segment=400.0) for seed in range(40)]
    f, S = found[0].f, np.mean([x.S for x in found], axis=0)
    main = density(f) > 0.2 * density(f).max()
    assert S[main] == pytest.approx(density(f)[main], rel=0.15)


def test_spectrum_of_uneven_times_is_that_of_even_ones() -> None:
    t, x = record(1800.0, 4)
    keep = np.sort(np.random.default_rng(5).permutation(t.size)[: int(0.98 * t.size)])
    keep = np.unique(np.concatenate([[0, t.size - 1], keep]))
    assert moments.welch(t[keep], x[keep]).significant == pytest.approx(moments.welch(t, x).significant, rel=0.02)


def test_one_short_step_does_not_make_the_spectrum_of_millions_of_times() -> None:
    t, x = record(HOUR, 1)
    more = np.insert(t, 500, t[500] - 1e-7), np.insert(x, 500, x[500])
    found, even = moments.welch(*more), moments.welch(t, x)
    assert found.f.size < 20 * even.f.size
    assert found.significant == pytest.approx(even.significant, rel=0.01)


def test_l_moments_are_those_of_the_laws() -> None:
    """Gumbel: ln 2 x scale; uniform on 0..1: 1/6; by their definition as half the mean difference of two values."""
    x = np.random.default_rng(6).gumbel(1.0, 2.0, 400_000)
    assert extremes.l_moments(x)[1] == pytest.approx(2.0 * math.log(2.0), rel=0.01)
    small = np.array([1.0, 4.0, 9.0, 11.0])
    differences = [abs(a - b) for i, a in enumerate(small) for b in small[i + 1 :]]
    assert extremes.l_moments(small)[1] == pytest.approx(0.5 * np.mean(differences))


def test_laws_are_found_again() -> None:
    rng = np.random.default_rng(7)
    mode, scale = extremes.fit_gumbel(rng.gumbel(5.0, 2.0, 100_000))
    assert (mode, scale) == pytest.approx((5.0, 2.0), rel=0.01)
    size, shape = extremes.fit_weibull(3.0 * rng.weibull(1.4, 100_000))
    assert (size, shape) == pytest.approx((3.0, 1.4), rel=0.01)
    best = stats.gumbel_r.fit(rng.gumbel(5.0, 2.0, 2000))
    assert best == pytest.approx((5.0, 2.0), rel=0.1)  # maximum likelihood is no nearer


def test_expected_maximum_of_1000_peaks() -> None:
    """Of a narrow-band Gaussian process: sigma (sqrt(2 ln N) + 0.5772 / sqrt(2 ln N)), within 3 %."""
    N = 1000
    root = math.sqrt(2.0 * math.log(N))
    rng = np.random.default_rng(8)
    largest = rng.rayleigh(1.0, (400, N)).max(axis=1)
    assert largest.mean() == pytest.approx(root + extremes.EULER / root, rel=0.03)
    # found from 20 records of 1000 peaks: mode and mean of a Gumbel law
    mode, scale = extremes.fit_gumbel(largest[:20])
    assert mode + extremes.EULER * scale == pytest.approx(root + extremes.EULER / root, rel=0.03)


def test_extreme_of_a_record_is_that_of_the_process() -> None:
    """From an hour, the most probable largest value of three: sigma sqrt(2 ln N), inside the interval mostly."""
    N = 3.0 * HOUR * math.sqrt(exact_moment(2) / exact_moment(0))
    expected = math.sqrt(2.0 * math.log(N))
    inside, found = 0, []
    for seed in range(20):
        x = extremes.of_record(*record(HOUR, 100 + seed))
        low, high = x.most_probable_interval
        inside += low <= expected <= high
        found.append(x.most_probable)
        assert low < x.most_probable < high and x.most_probable < x.fractile
    assert inside >= 14  # of 18 expected at 90 %
    assert np.mean(found) == pytest.approx(expected, rel=0.05)


def test_extreme_of_seeds_contains_what_further_seeds_bring() -> None:
    """Largest values of 20 records of three hours: their most probable value, and the median of 200 more."""
    far = np.array([record(3.0 * HOUR, 1000 + k, 1.0)[1].max() for k in range(220)])
    found = extremes.of_maxima(far[:20], 3.0 * HOUR)
    assert found.median_interval[0] < np.median(far[20:]) < found.median_interval[1]
    half = extremes.of_maxima(far[:20], 3.0 * HOUR, probability=0.5)
    assert [half.fractile, *half.fractile_interval] == pytest.approx([found.median, *found.median_interval])
    assert found.beyond == 1.0 and found.peaks == 20
    # six hours are as two records: P(x)^2
    more = extremes.of_maxima(far[:20], 3.0 * HOUR, 6.0 * HOUR)
    scale = float(extremes.fit_gumbel(far[:20])[1])
    assert more.most_probable - found.most_probable == pytest.approx(scale * math.log(2.0))


def test_intervals_hold_what_they_promise() -> None:
    """In 200 draws of 20 Gumbel values mode, median and 90 % fractile are inside their 90 % intervals in 80 to 98 %."""
    rng = np.random.default_rng(9)
    truth = np.array([10.0 - 3.0 * math.log(-math.log(p)) for p in (math.exp(-1.0), 0.5, 0.9)])
    inside = np.zeros(3)
    for _ in range(200):
        found = extremes.of_maxima(rng.gumbel(10.0, 3.0, 20), 1.0, 1.0)
        low, high = np.transpose([found.most_probable_interval, found.median_interval, found.fractile_interval])
        inside += (low <= truth) & (truth <= high)
    assert np.all((inside >= 160) & (inside <= 196))


def test_median_of_a_record_is_that_of_its_peaks() -> None:
    """Exponential peaks, whose excess is a Weibull law: the largest of N exceeds ln(N / ln 2) in every other record."""
    N, rng = 10_000, np.random.default_rng(4)
    t = np.arange(2.0 * N + 1.0)
    x = np.zeros(t.size)  # a peak, and a trough as deep as another, at every other instant
    x[1::2] = rng.exponential(1.0, N)
    x[2::2] = -rng.permutation(x[1::2])
    found = extremes.of_record(t, x, t[-1])
    for value, interval, part in (
        (found.most_probable, found.most_probable_interval, 1.0), (found.median, found.median_interval, math.log(2.0))
    ):  # fmt: skip
        exact = math.log(N / part)
        assert value == pytest.approx(exact, rel=0.05) and interval[0] < exact < interval[1]
    low = extremes.of_record(t, x, t[-1], probability=0.5)
    assert low.fractile == low.median > low.most_probable


def test_too_few_peaks_are_refused() -> None:
    t = np.linspace(0.0, 30.0, 600)
    with pytest.raises(ResultError, match="too few"):
        extremes.of_record(t, np.sin(2.0 * np.pi * t / 10.0))
    with pytest.raises(ResultError, match="more seeds"):
        extremes.of_maxima([1.0, 2.0], 100.0)
    with pytest.raises(ResultError, match="all 3"):
        extremes.of_maxima([3.0] * 6, 100.0)


def test_curves_are_consistent() -> None:
    """Both slopes meet at the knee; under protection a curve has 0.4 less than in air; corroding ones a third of air."""
    for curve in fatigue.curves().values():
        if math.isfinite(curve.knee):
            size = 10.0 ** ((curve.log_a - math.log10(curve.knee)) / curve.m)
            assert 10.0**curve.log_a2 * size**-curve.m2 == pytest.approx(curve.knee, rel=0.012), curve.name
    by_name = fatigue.curves()
    for name in ("C", "D", "E", "F", "F1", "F3", "G", "W1", "W2", "W3"):
        air = by_name[f"{name} air"].log_a
        assert by_name[f"{name} corroding"].log_a == pytest.approx(air - math.log10(3.0), abs=0.0011)
        assert by_name[f"{name} sea"].log_a == pytest.approx(air - 0.4, abs=1e-9)
    assert by_name["D air"].cycles(52.63) == pytest.approx(1e7, rel=1e-3)
    assert by_name["studless chain"].cycles(100.0) == pytest.approx(6.0e4, rel=1e-5)
    assert by_name["studlink chain T-N"].cycles(0.1) == pytest.approx(1e6, rel=1e-5)


@pytest.mark.needs("rainflow")
def test_damage_of_constant_cycles() -> None:
    """1000 cycles of a range of 120 MPa, and a plate twice as thick as the reference."""
    x = 60.0 * np.sin(2.0 * np.pi * np.arange(0.0, 1000.0, 0.01))
    expected = 1000.0 * 120.0**3 / 10.0**11.764
    assert fatigue.damage(x, "D sea") == pytest.approx(expected, rel=2e-3)
    thick = fatigue.damage(x, "D sea", thickness=0.05)
    assert thick == pytest.approx(expected * (2.0**0.2) ** 3, rel=2e-3)
    assert fatigue.damage(np.ones(5), "D sea") == 0.0
    one = fatigue.damage(x, "D sea")
    assert np.array_equal(fatigue.damage(np.stack([x, 0.5 * x], axis=1), "D sea")[:1], [one])


@pytest.mark.needs("fatpack")
def test_damage_is_that_of_another_library() -> None:
    """fatpack counts the same cycles of a random history: the damage is within 1 %."""
    import fatpack

    _, x = record(HOUR, 11)
    ranges = fatpack.find_rainflow_ranges(30.0 * x, k=4096)
    curve = fatigue.curves()["F sea"]
    assert fatigue.damage(x, curve, scale=30.0) == pytest.approx((1.0 / curve.cycles(ranges)).sum(), rel=0.01)


@pytest.mark.needs("rainflow")
def test_damage_of_a_gaussian_process() -> None:
    """Dirlik within 5 % where it holds (this broad record), narrow-band above it, both of the exact spectrum."""
    curve = fatigue.curve_of({"kind": "S-N", "log_a": 12.0, "m": 3.0})
    f = np.linspace(0.0, 0.6, 60001)
    exact = moments.Spectrum(f, 30.0**2 * density(f), f[1])
    counted = np.mean([fatigue.damage(30.0 * record(HOUR, 50 + k)[1], curve) for k in range(12)])
    assert fatigue.dirlik_damage(exact, curve, HOUR) == pytest.approx(counted, rel=0.05)
    assert counted < fatigue.narrow_band_damage(exact, curve, HOUR) < 1.4 * counted


@pytest.mark.parametrize("stress", [8.0, 30.0, 120.0])
@pytest.mark.needs("rainflow")
def test_damage_of_a_gaussian_process_over_two_slopes(stress: float) -> None:
    """Most of it on the second slope, on both, on the first, as of cycles that are counted.

    Of ranges of Rayleigh's law it is the integral of each cycle's damage.
    """
    curve = fatigue.curves()["D air"]
    f = np.linspace(0.0, 0.6, 60001)
    exact = moments.Spectrum(f, stress**2 * density(f), f[1])
    counted = np.mean([fatigue.damage(stress * record(HOUR, 50 + k)[1], curve) for k in range(12)])
    assert fatigue.dirlik_damage(exact, curve, HOUR) == pytest.approx(counted, rel=0.07)
    z, dz = np.linspace(1e-4, 12.0, 400_001, retstep=True)
    ranges, m0 = 2.0 * np.sqrt(exact.moment(0)) * z, exact.moment(0)
    mean = float((z * np.exp(-0.5 * z**2) / curve.cycles(ranges)).sum() * dz)
    rate = HOUR * np.sqrt(exact.moment(2) / m0)
    assert fatigue.narrow_band_damage(exact, curve, HOUR) == pytest.approx(rate * mean, rel=1e-4)
    one = moments.Spectrum(np.array([0.1, 0.2]), np.array([stress**2, 0.0]), 0.1)  # all power at one frequency
    with np.errstate(divide="ignore", invalid="ignore"):
        assert fatigue.dirlik_damage(one, curve, HOUR) == fatigue.narrow_band_damage(one, curve, HOUR) > 0.0


def test_life_over_a_scatter_diagram() -> None:
    """Half the time a damage of 1e-6 an hour, a third 3e-6, the rest none."""
    years = fatigue.life_in_years([1e-6, 3e-6], [0.5, 1.0 / 3.0], HOUR)
    assert years == pytest.approx(HOUR / (1.5e-6 * fatigue.YEAR))
    with pytest.raises(ResultError, match=r"sum 1\.2"):
        fatigue.life_in_years([1.0, 1.0], [0.6, 0.6], 1.0)


@pytest.mark.needs("rainflow")
def test_turning_points_keep_all_cycles() -> None:
    import rainflow

    x = np.round(np.random.default_rng(12).standard_normal(3000).cumsum(), 1)
    whole = np.array(sorted(tuple(c[:3]) for c in rainflow.extract_cycles(x.tolist())))
    assert np.array_equal(np.array(sorted(map(tuple, fatigue.rainflow_cycles(x)))), whole)


@pytest.mark.needs("rainflow")
def test_a_history_that_only_rises_is_a_half_cycle() -> None:
    assert fatigue.rainflow_cycles([1.0, 2.0, 4.0]).tolist() == [[3.0, 2.5, 0.5]]
    assert fatigue.rainflow_cycles([1.0, 1.0]).shape == (0, 3)


@pytest.mark.parametrize(
    "wrong",
    [
        "D",
        {"kind": "S-N", "log_a": 12.0, "m": -3.0},
        {"kind": "x", "log_a": 1.0, "m": 3.0},
        {"kind": "S-N", "log_a": 12.0, "m": 3.0, "m2": 5.0, "knee": 1e7},
        {"a": 1},
    ],
)
def test_wrong_curves_are_refused(wrong: object) -> None:
    with pytest.raises(ResultError):
        fatigue.curve_of(wrong)  # type: ignore[arg-type]
