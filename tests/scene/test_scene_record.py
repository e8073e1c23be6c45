"""The kink test both ways: smooth signals of 12 samples a period pass, kinks and steps are found where they are."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from hybrid.scene.motion_file import Precision, first_jump

Array = NDArray[np.float64]

T = 8.0
W = 2 * np.pi / T


def _ramp(t: Array, over: float) -> Array:
    x = np.clip(t / over, 0.0, 1.0)
    return x**3 * (10.0 - 15.0 * x + 6.0 * x**2)


def _triangle(t: Array) -> Array:
    return 2 / np.pi * np.arcsin(np.sin(W * t))


def _units(written: list[str], values: Array) -> Array:
    precision = Precision()
    for text in written:
        precision.add(text)
    return precision.unit(values)


def _jump(t: Array, x: Array, form: str | None) -> tuple[float, float] | None:
    """The first jump of a signal along y, written with `form` (None: all digits)."""
    values, unit = np.zeros((len(t), 3)), np.full((len(t), 3), 1e-15)
    values[:, 1] = x
    if form is not None:
        written = [form % v for v in x]
        values[:, 1] = [float(w) for w in written]
        unit[:, 1] = _units(written, values[:, 1])
    return first_jump(t, values, unit)


def _times(samples: int, uneven: float, rng: np.random.Generator) -> Array:
    t = np.arange(0.0, 10 * T, T / samples)
    t[1:] += uneven * T / samples * rng.uniform(-1.0, 1.0, len(t) - 1)
    return t


SMOOTH = {
    "swell": lambda t, p: _ramp(t, 2 * T) * np.sin(W * t + p),
    "short ramp": lambda t, p: _ramp(t, T) * np.sin(W * t + p),
    "cosine": lambda t, p: 1 - np.cos(W * t),
    "irregular": lambda t, p: (
        _ramp(t, 2 * T) * sum(np.sin(W * t / k + 9 * k * p) / k for k in (1, 1.13, 1.3, 1.7, 2.1))
    ),
    "one move": lambda t, p: _ramp(t - 20 - p, T),
    "pulse": lambda t, p: np.exp(-(((t - 30) * W) ** 2) / 2),
    "still": lambda t, p: 0.0 * t + p,
}

SHARP = {
    "triangle": (lambda t, p: _triangle(t), 0.0),
    "triangle, later": (lambda t, p: np.where(t > 20 + p, _triangle(t - 20 - p), 0.0), None),
    "corner": (lambda t, p: np.where(t > 20 + p, t - 20 - p, 0.0), None),
    "corner on a swell": (lambda t, p: _ramp(t, 2 * T) * np.sin(W * t) + np.where(t > 40 + p, t - 40 - p, 0.0), None),
    "step": (lambda t, p: np.where(t > 20 + p, 1.0, 0.0), None),
    "folded swell": (lambda t, p: np.abs(_ramp(t, T) * np.sin(W * t)), None),
    "sine": (lambda t, p: np.sin(W * t), 0.0),
    "sine, shifted": (lambda t, p: np.sin(W * t + 1 + p / 7) - np.sin(1 + p / 7), 0.0),
}

SAMPLES, FORMS = [12, 13, 24, 100, 500], [None, "%.3f", "%.4f", "%.4g", "%.6g"]


@pytest.mark.parametrize("uneven", [0.0, 0.2])
@pytest.mark.parametrize("name", SMOOTH)
def test_smooth_signals_pass(name: str, uneven: float) -> None:
    rng = np.random.default_rng(1)
    for samples in SAMPLES:
        for phase in rng.uniform(0.0, 6.0, 3 if samples < 500 else 1):
            t = _times(samples, uneven, rng)
            for form in FORMS:
                assert _jump(t, SMOOTH[name](t, phase), form) is None, (samples, phase, form)


@pytest.mark.parametrize("uneven", [0.0, 0.2])
@pytest.mark.parametrize("name", SHARP)
def test_sharp_signals_are_refused(name: str, uneven: float) -> None:
    rng = np.random.default_rng(2)
    signal, when = SHARP[name]
    for samples in SAMPLES:
        for phase in rng.uniform(0.0, 6.0, 3):
            t = _times(samples, uneven, rng)
            for form in (None, "%.4f", "%.4g") if samples <= 100 else (None,):
                jump = _jump(t, signal(t, phase), form)
                assert jump is not None, (samples, phase, form)
                assert when is None or jump[0] == when


@pytest.mark.parametrize("samples", [12, 24, 100])
@pytest.mark.parametrize("name", ["corner", "step", "corner on a swell"])
def test_the_time_is_that_of_the_kink(name: str, samples: int) -> None:
    t = np.arange(0.0, 10 * T, T / samples)
    start = 40.0 if "swell" in name else 20.0
    for phase in (0.1, 1.7, 3.3):
        jump = _jump(t, SHARP[name][0](t, phase), None)
        assert jump is not None
        # where a swell hides half of the kink, its neighbour may be named
        assert abs(jump[0] - start - phase) <= (2 if "swell" in name else 1) * T / samples


def test_size_of_the_jump() -> None:
    t = np.arange(0.0, 80.0, 0.5)
    jump = _jump(t, np.where(t > 20.0, 0.3 * (t - 20.0), 0.0), None)
    assert jump is not None and jump == pytest.approx((20.0, 0.3))


def test_a_leap_has_its_size_where_its_kinks_hide_each_other() -> None:
    """Near the begin of a record that is blended in: what the test finds is a smooth sample beside them."""
    t, values = np.arange(12.0), np.zeros((12, 3))
    values[:, 0] = np.where(t > 1.0, 100.0, 0.0)
    assert first_jump(t, values, np.zeros((12, 3)), from_rest=False) == pytest.approx((1.0, 100.0))


def test_jumps_outside_the_computation_do_not_matter() -> None:
    t = np.arange(-20.0, 80.0, 0.5)
    values = np.zeros((len(t), 3))
    values[:, 0] = np.where(t > 60.0, t - 60.0, 0.0) + np.where(t < -10.0, -10.0 - t, 0.0)
    unit = np.full_like(values, 1e-15)
    assert first_jump(t, values, unit, until=50.0) is None
    assert first_jump(t, values, unit, until=70.0) == pytest.approx((60.0, 1.0))


def test_last_digits() -> None:
    written = ["0", "0.0012", "12.3450", "100"]  # four decimals, six digits
    units = _units(written, np.array([float(w) for w in written]))
    np.testing.assert_allclose(units, [1e-4, 1e-4, 1e-4, 1e-3], rtol=1e-12)
    written = ["1.234e3", "1.2e-3", "-5.678e0"]  # four digits
    units = _units(written, np.array([float(w) for w in written]))
    np.testing.assert_allclose(units, [1.0, 1e-4, 1e-3], rtol=1e-12)
    # one or two digits are meant exactly: 0, 0.5, 1 is not a rounded 0.6
    assert not _units(["0", "0.5", "1"], np.array([0.0, 0.5, 1.0])).any()
