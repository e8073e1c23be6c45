"""Seas of a measured spectrum over frequency and direction: what is drawn of a spectrum in closed form, and files."""

from __future__ import annotations

import numpy as np
import pytest
from pydantic import ValidationError

import hybrid
from hybrid.model.sea import components, jonswap
from hybrid.scene.waves import MeasuredWaves

F = np.linspace(0.04, 0.4, 73)  # Hz
A = np.arange(0.0, 360.0, 10.0)  # deg
HEIGHT, PEAK, EXPONENT, TOWARDS = 3.0, 9.0, 4.0, 200.0


def spectrum():
    """JONSWAP times cos^2s, m^2/(Hz deg), of exactly this height on these frequencies."""
    S = jonswap(2 * np.pi * F, 2 * np.pi / PEAK, 3.3)
    S *= HEIGHT**2 / 16 / np.trapezoid(S, F)
    D = np.cos(0.5 * np.radians(A - TOWARDS)) ** (2 * EXPONENT)
    return S[:, None] * D / (D.sum() * 10.0)


def table(folder, E, more=()):
    rows = [f"{f:.6g},{a:g},{E[i, j]:.9g}" for i, f in enumerate(F) for j, a in enumerate(A)]
    path = folder / "sea.csv"
    path.write_text("\n".join(["frequency,direction,density", *rows, *more]))
    return path


def netcdf(folder, E, records=1):
    import xarray

    """As wavespectra writes it: where waves come from, clockwise from north, here along y, in an order of its own."""
    came = (90.0 - 180.0 - A) % 360.0
    order = np.argsort(came)[::-1]
    path = folder / "sea.nc"
    every = np.stack([(k + 1.0) * E[:, order] for k in range(records)])
    efth = xarray.DataArray(every, coords={"time": np.arange(records), "freq": F, "dir": came[order]}, name="efth")
    efth.transpose("time", "dir", "freq").to_dataset().to_netcdf(path, engine="h5netcdf")
    return path


@pytest.mark.parametrize("form", [table, pytest.param(netcdf, marks=pytest.mark.needs("xarray", "h5netcdf"))])
def test_waves_have_the_spectrum(tmp_path, form):
    """Height exactly, the mean rate of crossings, and mean direction and spread by E cos(a - a0) = s/(s + 1)."""
    sea = MeasuredWaves(file=str(form(tmp_path, spectrum())), components=1000)
    assert sea.significant_height == pytest.approx(HEIGHT, rel=1e-6)
    a, w, kx, ky, _, _ = components(sea, np.inf, 9.81).T
    S = spectrum().sum(axis=1) * 10.0
    fine = np.linspace(F[0], F[-1], 20_001)
    on = np.interp(fine, F, S)
    rate = np.sqrt(np.trapezoid(fine**2 * on, fine) / np.trapezoid(on, fine))
    assert np.sqrt((a**2 * w**2).sum() / (a**2).sum()) / (2 * np.pi) == pytest.approx(rate, rel=1e-4)
    heading = np.arctan2(ky, kx) - np.radians(TOWARDS)
    assert np.cos(heading).mean() == pytest.approx(EXPONENT / (EXPONENT + 1.0), abs=5e-3)
    assert abs(np.sin(heading).mean()) < 5e-3
    # energy below a frequency, from any quarter, is that of the table
    for low in (0.1, 0.12, 0.2):
        part = np.trapezoid(np.where(fine < low, on, 0.0), fine) / np.trapezoid(on, fine)
        assert np.mean(w < 2 * np.pi * low) == pytest.approx(part, abs=2e-3)
    again = MeasuredWaves(file=sea.file, components=1000, seed=2)
    assert not np.allclose(again.recorded.waves[:, 2], sea.recorded.waves[:, 2])


@pytest.mark.needs("xarray", "h5netcdf")
def test_records_and_north(tmp_path):
    path = str(netcdf(tmp_path, spectrum(), 3))
    assert MeasuredWaves(file=path, record=2).significant_height == pytest.approx(HEIGHT * np.sqrt(3.0), rel=1e-6)
    turned, plain = (MeasuredWaves(file=path, record=0, north=x).recorded.waves[:, 3] for x in (120.0, 90.0))
    assert np.mean(np.exp(1j * np.radians(turned))) == pytest.approx(
        np.mean(np.exp(1j * np.radians(plain + 30.0))), abs=0.02
    )
    with pytest.raises(ValidationError, match="which of them"):
        MeasuredWaves(file=path)
    with pytest.raises(ValidationError, match="a record from 0 to 2"):
        MeasuredWaves(file=path, record=3)


@pytest.mark.parametrize(
    ("more", "change", "expected"),
    [
        (["0.1,5,1"], None, "one row for each frequency and direction"),
        ((), -1.0, "densities >= 0"),
        ((), 0.0, "expected waves"),
    ],
)
def test_what_cannot_be_is_refused(tmp_path, more, change, expected):
    E = spectrum() if change is None else np.full((F.size, A.size), change)
    with pytest.raises(ValidationError, match=expected):
        MeasuredWaves(file=str(table(tmp_path, E, more)))


def test_a_line_moves_in_it_and_so_does_its_response(tmp_path):
    """In space, as the waves come from all sides; `hybrid response` takes them as those of any sea."""
    table(tmp_path, spectrum())
    scene = tmp_path / "scene.yaml"
    scene.write_text("""
environment: {fluid: {density: 1025, surface: 0, waves: {kind: spectrum, file: sea.csv, components: 20, depth: 100, ramp: 5}}}
cable: {sections: [{length: 60, mass: 30, diameter: 0.1, axial_stiffness: 5.0e+6, drag: {normal: 1.2}}]}
ends:
  start: {kind: pinned, position: [0, 0, -65]}
  end: {kind: pinned, position: [6, 0, -5.15]}
initial: equilibrium
model: catenary
mesh: {cells: 20}
time: {duration: 5, step: 0.1}
""")
    moved = hybrid.run(scene)
    assert np.ptp(moved.position[:, :, 1], axis=0).max() > 1e-3
    assert hybrid.response(scene).lines["cable"].deviation("tension").min() > 0.0
