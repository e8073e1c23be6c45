"""Small oscillations: frequencies against closed forms, discrete and continuous, and what damping does to them.

The frequencies are free of the error in time (problems.poles), so the orders are those in space.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from problems import (
    CANTILEVER,
    CHAIN,
    FREE_FREE,
    X,
    Y,
    cantilever,
    free_beam,
    hanging_chain,
    motion,
    order,
    poles,
    string_mode,
    torsion_mode,
)


def pole(scene, kick, read, damped=False) -> complex:
    """Pole of the mode that `read` picks out of the positions."""
    signal = np.array([np.vdot(read, state.r) for _, state in motion(scene, kick)])
    return poles(signal - signal[0], scene.time.step, damped)


def frequency(*problem) -> float:
    return pole(*problem).imag


@pytest.mark.parametrize("mode", range(4))
def test_hanging_chain(mode, report):
    exact = CHAIN[mode] * math.sqrt(9.81)
    meshes = (20, 40, 80) if mode < 3 else (40, 80, 160)
    error = np.array([frequency(*hanging_chain(mode, n)) / exact - 1 for n in meshes])
    p = order(error)
    at40 = error[meshes.index(40)]
    report(
        f"Hanging chain, mode {mode + 1}, 40 cells",
        "half the zeros of J0",
        f"{at40:+.1e}, order {p[0]:.2f}, {p[1]:.2f}",
        "discretisation: 1e-3 for the first, order 2.0 +- 0.15",
    )
    assert mode > 0 or abs(at40) <= 1e-3
    assert np.abs(p - 2.0).max() <= 0.15


@pytest.mark.parametrize(
    ("name", "beam", "roots", "most", "mode"),
    [*(("Cantilever", cantilever, CANTILEVER, 1e-3, k) for k in range(3)),
     *(("Free-free rod", free_beam, FREE_FREE, 3e-3, k) for k in range(2))],
    ids=[*(f"cantilever-{k}" for k in range(3)), *(f"free-{k}" for k in range(2))],
)  # fmt: skip
def test_beam(name, beam, roots, most, mode, report):
    error = np.array([frequency(*beam(mode, n)) / roots[mode] ** 2 - 1 for n in (20, 40, 80)])
    p = order(error)
    report(
        f"{name}, bending mode {mode + 1}, 40 cells",
        "Euler-Bernoulli",
        f"{error[1]:+.1e}, order {p[0]:.2f}, {p[1]:.2f}",
        f"discretisation: {most:.0e} for the first, order 2.0 +- 0.1".replace("e-0", "e-"),
    )
    assert mode > 0 or abs(error[1]) <= most
    assert np.abs(p - 2.0).max() <= 0.1


@pytest.mark.parametrize("mode", [1, 2, 3])
@pytest.mark.parametrize("direction", [X, Y], ids=["longitudinal", "transverse"])
def test_taut_string(direction, mode, report):
    """Against the discrete string to round-off; the speed of waves, sqrt(EA/m) or sqrt(T/m), to order 2."""
    error, away = [], 0.0
    for n in (20, 40):
        scene, kick, read, discrete, exact = string_mode(mode, n, direction)
        omega = frequency(scene, kick, read)
        away = max(away, abs(omega / discrete - 1))
        error.append(omega / exact - 1)
    p = order(error)[0]
    what = "longitudinal" if direction[0] else "transverse"
    report(
        f"Taut string, {what} mode {mode}, 40 cells",
        "closed forms, discrete and continuous",
        f"{away:.1e} from the discrete, {error[1]:+.1e} from the continuous string, order {p:.2f}",
        "round-off: 1e-7; discretisation: order 2.0 +- 0.05",
    )
    assert away <= 1e-7
    assert abs(p - 2.0) <= 0.05


@pytest.mark.parametrize("mode", [1, 2])
def test_torsion(mode, report):
    error, away = [], 0.0
    for n in (20, 40):
        scene, kick, discrete, exact = torsion_mode(mode, n)
        steps = motion(scene, kick)
        a1 = next(steps)[1].a1[-1].copy()
        a2 = np.cross(X, a1)
        angle = [0.0] + [math.atan2(state.a1[-1] @ a2, state.a1[-1] @ a1) for _, state in steps]
        omega = poles(np.array(angle), scene.time.step).imag
        away = max(away, abs(omega / discrete - 1))
        error.append(omega / exact - 1)
    p = order(error)[0]
    report(
        f"Torsion of a clamped-free rod, mode {mode}, 40 cells",
        "closed forms, discrete and continuous",
        f"{away:.1e} from the discrete, {error[1]:+.1e} from the continuous rod, order {p:.2f}",
        "round-off: 1e-7; discretisation: order 2.0 +- 0.05",
    )
    assert away <= 1e-7
    assert abs(p - 2.0) <= 0.05


@pytest.mark.parametrize(("kind", "value"), [("mass", 0.5), ("stiffness", 0.02)])
def test_damping(kind, value, report):
    """The discrete damping is proportional to the discrete mass or stiffness: the ratio is that of the discrete omega.

    Round-off with 1e-6: the square of the amplitude (the kick is not quite the discrete mode) over four periods.
    """
    omega = frequency(*cantilever(0, 40))
    ratio = value / (2 * omega) if kind == "mass" else value * omega / 2
    found = pole(*cantilever(0, 40, **{kind: value}), damped=True)
    decay, turn = -found.real / (ratio * omega) - 1, found.imag / (omega * math.sqrt(1 - ratio**2)) - 1
    law = "c/(2 omega)" if kind == "mass" else "tau omega/2"
    report(
        f"{kind.capitalize()}-proportional damping of a cantilever's first mode",
        f"ratio {law}",
        f"decay {decay:+.1e}, frequency {turn:+.1e}",
        "round-off: 1e-6",
    )
    assert abs(decay) <= 1e-6
    assert abs(turn) <= 1e-6
