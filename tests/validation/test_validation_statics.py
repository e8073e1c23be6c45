"""Equilibria with a closed form: catenaries, lines in a current, the elastica, and what a rod does exactly."""

from __future__ import annotations

import math

import numpy as np
import pytest
from problems import (
    BISSHOPP_DRUCKER,
    X,
    curled,
    elastica_tip,
    end_loaded_cantilever,
    line_across_current,
    line_across_current_exact,
    line_along_current,
    line_along_current_exact,
    order,
    rolled_up,
    sagging_line,
    sagging_line_exact,
    stretched_rod,
    taut_string,
)

import hybrid


@pytest.mark.parametrize("axial_stiffness", [None, 1e4], ids=["inextensible", "elastic"])
def test_catenary(axial_stiffness, report):
    errors = []
    for n in (40, 80, 160):
        result = hybrid.static(sagging_line(axial_stiffness, n))
        position, tension, (H, V) = sagging_line_exact(axial_stiffness, result.s)
        errors.append(
            (
                np.abs(result.position[-1] - position).max(),
                np.abs(result.tension[-1] / tension - 1).max(),
                np.abs(result.reaction_start[-1] - [-H, 0, V]).max() / V,
            )
        )
    what = "elastic" if axial_stiffness else "inextensible"
    names, bounds = ("shape (m of 100)", "tension (relative)", "reaction (relative)"), (2e-2, 2e-3, 2e-4)
    for name, bound, e in zip(names, bounds, np.array(errors).T, strict=True):
        p = order(e)
        report(
            f"Catenary, {what}: {name}, 40 cells",
            "closed form (Irvine)",
            f"{e[0]:.1e}, order {p[0]:.2f}, {p[1]:.2f}",
            f"discretisation: {bound:.0e}, order 2.0 +- 0.1",
        )
        assert e[0] <= bound
        assert np.abs(p - 2.0).max() <= 0.1


def test_taut_string(report):
    result = hybrid.static(taut_string(0.01, 500.0, 13))
    error = np.abs(result.tension[-1] / 5.0 - 1).max()
    report("Taut string: tension", "EA strain", f"{error:.1e}", "round-off: 1e-12")
    assert error <= 1e-12


@pytest.mark.parametrize("speed", [0.5, -1.0, 3.0])
def test_line_along_a_current(speed, report):
    """Tension falls linearly from w L - f L at the top, whether the drag pulls up or down."""
    result = hybrid.static(line_along_current(speed, 20))
    exact = line_along_current_exact(speed, result.s)
    error = np.abs(result.tension[-1] - exact).max() / exact.max()
    report(f"Heavy line in an axial current of {speed} m/s: tension", "closed form", f"{error:.1e}", "round-off: 1e-12")
    assert error <= 1e-12


@pytest.mark.parametrize("speed", [0.5, 2.0])
def test_line_across_a_current(speed, report):
    """Round-off at 1e-8: the angle of every cell is where Newton stops, 1e-9 rad."""
    result = hybrid.static(line_across_current(speed, 20))
    angle, w = line_across_current_exact(speed)
    direction = np.array([math.cos(angle), 0, -math.sin(angle)])
    apart = np.abs(result.position[-1] - np.outer(result.s, direction)).max() / 50.0
    tension = np.abs(result.tension[-1] - w * (50.0 - result.s) * math.sin(angle)).max() / (50.0 * w)
    report(
        f"Line across a current of {speed} m/s: critical angle {math.degrees(angle):.2f} deg",
        "closed form (Zajac 1957)",
        f"shape {apart:.1e} L, tension {tension:.1e} w L",
        "round-off: 1e-8",
    )
    assert max(apart, tension) <= 1e-8


@pytest.mark.parametrize("load", BISSHOPP_DRUCKER)
def test_bisshopp_drucker(load, report):
    """Tip within 0.1 % of the published digits at 40 cells, and order 2 against the elliptic integrals."""
    published, exact = np.array(BISSHOPP_DRUCKER[load]), np.array(elastica_tip(load))
    assert np.abs(exact - published).max() <= 0.5e-6  # the digits printed
    tips = []
    for n in (20, 40, 80):
        tip = hybrid.static(end_loaded_cantilever((0, 0, -load), n)).position[-1, -1]
        tips.append((1 - tip[0], -tip[2]))
    errors = np.abs(np.array(tips) / published - 1)[1]
    p = np.array([order(e) for e in (np.array(tips) - exact).T])
    report(
        f"Cantilever, P L^2/EI = {load:g}: shortening and deflection, 40 cells",
        "Bisshopp & Drucker 1945",
        f"{100 * errors[0]:.3f} %, {100 * errors[1]:.3f} %, order {p.min():.2f} to {p.max():.2f}",
        "published + discretisation: 0.1 %, order 2.0 +- 0.1",
    )
    assert errors.max() <= 1e-3
    assert np.abs(p - 2.0).max() <= 0.1


@pytest.mark.parametrize("cells", [20, 40])
def test_roll_up(cells, report):
    tip = hybrid.static(rolled_up(cells)).position[-1, -1]
    error = float(np.linalg.norm(tip))
    report(
        f"Rolled up twice by an end moment, {cells} cells: gap", "closed form", f"{error:.1e} m", "round-off: 1e-8 m"
    )
    assert error <= 1e-8


def test_intrinsic_curvature(report):
    result = hybrid.static(curled(20))
    gap, moment = float(np.linalg.norm(result.position[-1, -1])), float(np.abs(result.bending_moment[-1]).max())
    report(
        "Intrinsic curvature 2 pi/L: gap of the ring, moment",
        "closed form",
        f"{gap:.1e} m, {moment:.1e} N m",
        "round-off: 1e-8",
    )
    assert gap <= 1e-8
    assert moment <= 1e-8 * 3.0 * 2 * math.pi


@pytest.mark.parametrize(("force", "load"), [((0, 0, -5), 1.0), ((0, 5, 0), 5.0)], ids=["stiff plane", "soft plane"])
def test_anisotropic_bending(force, load, report):
    """EI 1 about a1 (vertical) and 5 about a2: the same force is P L^2/EI = 5 sideways and 1 upwards.

    Round-off against a round rod of the same stiffness, discretisation (0.1 % at 40 cells) against the elastica.
    """
    tip = hybrid.static(end_loaded_cantilever(force, 40, (1.0, 5.0))).position[-1, -1]
    round_ = hybrid.static(end_loaded_cantilever((0, 0, -load), 40)).position[-1, -1]
    shortening, deflection = 1 - tip[0], abs(tip[1]) + abs(tip[2])
    error = np.abs(np.array([shortening, deflection]) / elastica_tip(load) - 1).max()
    same = max(abs(tip[0] - round_[0]), abs(deflection + round_[2]))
    report(
        f"Anisotropic rod, P L^2/EI = {load:g}",
        "elastica; round rod",
        f"{100 * error:.3f} %; {same:.1e} m",
        "discretisation: 0.1 %; round-off: 1e-9 m",
    )
    assert error <= 1e-3
    assert same <= 1e-9


def test_stretched_rod(report):
    force, stiff = 7.0, 1e3
    tip = hybrid.static(stretched_rod(force, stiff, 10)).position[-1, -1]
    error = float(np.abs(tip - 3.0 * (1 + force / stiff) * X).max())
    report("Rod under an axial force: end extension T L/EA", "closed form", f"{error:.1e} m", "round-off: 1e-12 m")
    assert error <= 1e-12
