"""Vessels that move by an RAO in one wave of finite height: as in the regular wave of its first harmonic."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import hybrid
from hybrid.scene.dispersion import wavenumber
from hybrid.scene.stream_function import steady_wave
from tests.combinations.pairs import BASE, END, Tables
from tests.problems import tables_with

DEPTH, PERIOD, HEIGHT = 40.0, 6.0, 3.0
RAO = """frequency,heading,surge,heave,pitch,surge_phase,heave_phase,pitch_phase
0.8,0,0.9,0.8,1.5,80,10,95
1.3,0,0.5,0.6,1.0,70,20,100
"""


def moved(waves: Tables, rao: Path, **vessel: Any) -> Tables:
    """A line to a vessel, in a sea without drag, so that the vessel alone moves it."""
    fluid = {"density": 1025, "surface": 5.0, "waves": {"period": PERIOD, "phase": 25, "ramp": 6.0} | waves}
    sail = {"rao": str(rao), "origin": [10, 0, 5], "heading": 0.0} | vessel
    return tables_with(BASE, {
        "environment.fluid": fluid, "environment.seabed": {"z": 5.0 - DEPTH, "stiffness": 1e3},
        END + ".motion": {"vessel": sail}, "time": {"duration": 8.0, "step": 0.04}, "output": {"every": 0.4, "points": 13},
    })  # fmt: skip


def of_vessel(tables: Tables) -> np.ndarray:
    """Places (nb, 3) m of the end that it moves."""
    return np.asarray(hybrid.run(tables).position[:, -1])


@pytest.fixture
def rao(tmp_path: Path) -> Path:
    path = tmp_path / "ship.csv"
    path.write_text(RAO)
    return path


def test_a_vessel_moves_by_the_first_harmonic_of_a_wave_of_finite_height(rao: Path) -> None:
    """To round-off that of the regular wave of twice its amplitude, at the phase that it has where the vessel is.

    A table that ends below the frequency of the second harmonic is enough.
    """
    wave = steady_wave(HEIGHT, DEPTH, 9.81, 20, PERIOD)
    assert wave is not None
    first = 2.0 * float(wave.elevation[0])
    assert abs(first / HEIGHT - 1.0) > 0.005  # m: crests are sharp
    finite = moved({"kind": "stream_function", "height": HEIGHT}, rao)
    linear = {"kind": "regular", "height": first, "phase": 25.0}

    linear["phase"] += np.degrees((wave.k - wavenumber(2.0 * np.pi / PERIOD, DEPTH, 9.81)) * 10.0)
    apart = of_vessel(finite) - of_vessel(moved(linear, rao))
    assert np.ptp(of_vessel(finite), axis=0)[[0, 2]].min() > 1.0
    assert np.abs(apart).max() < 1e-9


def test_a_plan_says_which_harmonics_do_not_move_it(rao: Path) -> None:
    for kind in ("stream_function", "regular"):
        contents = hybrid.plan(moved({"kind": kind, "height": HEIGHT}, rao)).contents
        told = [x for x in contents if x.what == "higher harmonics of the waves in the motion of ends.end"]
        assert bool(told) == (kind == "stream_function") and not any(x.on for x in told)


def test_in_low_waves_it_is_the_vessel_of_linear_waves(rao: Path) -> None:
    """With the square of the height, of which the first harmonic and the length differ."""
    off = []
    for height in (1.0, 0.5):
        finite, linear = (of_vessel(moved({"kind": k, "height": height}, rao)) for k in ("stream_function", "regular"))
        off.append(np.abs(finite - linear).max() / np.ptp(linear, axis=0).max())
    assert off[1] < 2e-3 and np.log2(off[0] / off[1]) == pytest.approx(2.0, abs=0.2)
