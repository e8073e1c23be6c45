"""Ends carried by a vessel: its RAOs in the waves of the scene, phases, arms, headings, spectra, and what is refused."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import hybrid
from hybrid.model.build import build
from hybrid.scene.read import one_line
from tests.scenes import cable_scene, pinned_at

WAVES = {"kind": "regular", "height": 2.0, "period": 9.0, "direction": 30.0, "phase": 25.0, "ramp": 18.0}
SEA = {
    "kind": "jonswap",
    "significant_height": 4.0,
    "peak_period": 10.0,
    "components": 400,
    "direction": 30.0,
    "seed": 3,
    "ramp": 20.0,
}
ORIGIN, HEADING = [5.0, -3.0, 0.0], 30.0
FAIRLEAD = [20.0, 4.0, -2.0]


def table(folder: Path, columns: dict[str, Any], headings: tuple[float, ...] = (-0.0, 180.0)) -> str:
    """A table with the same motion for all headings; columns: numbers, or functions of the frequency."""
    rows = []
    for w in np.linspace(0.05, 12.0, 600):
        values = [c(w) if callable(c) else c for c in columns.values()]
        rows += [[w, heading, *values] for heading in headings]
    path = folder / "rao.csv"
    np.savetxt(path, rows, delimiter=",", header=",".join(("frequency", "heading", *columns)), comments="", fmt="%.12g")
    return str(path)


def scene(rao: str, waves: dict[str, Any] = WAVES, clamped: bool = False, **vessel: Any) -> hybrid.Scene:
    c, s = math.cos(math.radians(HEADING)), math.sin(math.radians(HEADING))
    x, y, z = FAIRLEAD
    place = [ORIGIN[0] + c * x - s * y, ORIGIN[1] + s * x + c * y, ORIGIN[2] + z]
    end = {"kind": "pinned", "position": place}
    if clamped:
        end |= {"kind": "clamped", "tangent": [0, 0, 1]}
    given = {"rao": rao, "origin": ORIGIN, "heading": HEADING, "fairlead": FAIRLEAD} | vessel
    return hybrid.validate_scene(cable_scene(
        {"length": 120.0, "mass": 5.0, "diameter": 0.05, "axial_stiffness": 1e7, "bending_stiffness": 10.0},
        pinned_at(place[0] - 40, place[1], -95.0), end | {"motion": {"vessel": given}},
        fluid={"density": 1025, "surface": 0.0, "waves": waves | {"depth": 200.0}},
        model="rod" if clamped else "catenary", mesh=30, time=(40.0, 0.1), output=0.5
    ))  # fmt: skip


@pytest.mark.parametrize(("phase", "times"), [(0.0, (0.0, 3.0, 17.0, 25.0)), (90.0, (30.0, 33.3))])
def test_a_vessel_that_heaves_with_the_surface_at_its_origin(phase: float, times: Any, tmp_path: Path) -> None:
    """Heave 1 m/m: the fairlead is as high as the surface at the origin, the wave's ramp included.

    Phases lag behind the crest: 90 deg are a quarter of a period.
    """
    model = build(one_line(scene(table(tmp_path, {"heave": 1.0} | ({"heave_phase": phase} if phase else {})))))
    for t in times:
        height = model.sea.elevation(ORIGIN[0], ORIGIN[1], t - 9.0 * phase / 360.0)[0]
        assert model.ends.at_time(t).position[1, 2] == pytest.approx(FAIRLEAD[2] + height, abs=1e-9)


def test_arms_and_headings(tmp_path: Path) -> None:
    """Surge is along the bow; pitch lifts a point ahead by - x, roll one to port by y; a clamped end turns with it."""
    alone = build(one_line(scene(table(tmp_path, {"surge": 1.0}))))
    t, c, s = 25.0, math.cos(math.radians(HEADING)), math.sin(math.radians(HEADING))
    base, eta = alone.ends.motions[1].base, alone.sea.elevation(ORIGIN[0], ORIGIN[1], t)[0]
    np.testing.assert_allclose(alone.ends.at_time(t).position[1] - base, [c * eta, s * eta, 0.0], rtol=0, atol=1e-9)
    turned = build(one_line(scene(table(tmp_path, {"pitch": 1.5, "roll": 0.7}), clamped=True)))
    pitch, roll = math.radians(1.5 * eta), math.radians(0.7 * eta)
    x, y, z = FAIRLEAD
    body = np.cross([roll, pitch, 0.0], [x, y, z])
    wanted = [c * body[0] - s * body[1], s * body[0] + c * body[1], body[2]]
    np.testing.assert_allclose(turned.ends.at_time(t).position[1] - base, wanted, rtol=0, atol=1e-9)
    tangent = turned.ends.at_time(t).frame[1].reshape(3, 3)[:, 2]
    small = np.cross([c * roll - s * pitch, s * roll + c * pitch, 0.0], [0, 0, 1])
    np.testing.assert_allclose(tangent - [0, 0, 1], small, rtol=0, atol=2.0 * (pitch**2 + roll**2))


@pytest.mark.long
def test_the_spectrum_of_the_fairlead_is_that_of_the_waves_times_the_square_of_the_response(tmp_path: Path) -> None:
    """An hour of a JONSWAP sea against the elevation of that hour: 2 % in a band at the peak, heights within 1 %."""

    def heave(w: np.ndarray | float) -> np.ndarray | float:
        return 1.0 / (1.0 + (w / 0.7) ** 4)

    model = build(one_line(scene(table(tmp_path, {"heave": heave}), SEA)))
    t = np.arange(20.0, 3620.0, 0.5)
    z = np.array([model.ends.at_time(x).position[1, 2] for x in t]) - FAIRLEAD[2]
    eta = np.array([model.sea.elevation(ORIGIN[0], ORIGIN[1], x)[0] for x in t])
    spectra = [np.abs(np.fft.rfft(x * np.hanning(t.size))) ** 2 for x in (z, eta)]
    w, peak = 2 * np.pi * np.fft.rfftfreq(t.size, 0.5), 2 * np.pi / 10.0
    wanted = heave(w) ** 2 * spectra[1]
    band = abs(w - peak) < 0.2 * peak
    assert spectra[0][band].sum() == pytest.approx(wanted[band].sum(), rel=0.02)
    assert np.sqrt(spectra[0].sum()) == pytest.approx(np.sqrt(wanted.sum()), rel=0.01)
    assert spectra[0].sum() < 0.7 * spectra[1].sum(), "the response changes nothing"


def test_it_runs_and_resumes_with_its_table(tmp_path: Path) -> None:
    """The end is where the harmonics say, in compiled steps; the table is among the files of the result."""
    made = scene(table(tmp_path, {"heave": 0.8, "pitch": 0.5, "pitch_phase": 40.0}))
    model = build(one_line(made))
    with hybrid.run(made) as result:
        for k in (10, 50, 80):
            wanted = model.ends.at_time(float(result.t[k])).position[1]
            np.testing.assert_allclose(result.position[k, -1], wanted, rtol=0, atol=1e-8)
    assert made.ends.named_files() == [str(tmp_path / "rao.csv")]


REFUSED: dict[str, tuple[dict[str, Any], dict[str, Any], dict[str, Any], str]] = {
    "fairlead": ({}, {"fairlead": [0, 0, 0]}, WAVES, r"the position of the end would be \[5, -3, 0\]"),
    "heading": ({"headings": (0.0, 20.0)}, {"heading": 0.0, "fairlead": None}, WAVES, "the heading 30 deg"),
    "no ramp": ({}, {}, {k: x for k, x in WAVES.items() if k != "ramp"}, "starts from rest"),
    "frequency": ({}, {}, WAVES | {"period": 500.0}, r"ends\.end\.motion\.vessel\.rao[\s\S]*those of the waves"),
}  # fmt: skip


@pytest.mark.parametrize("name", REFUSED)
def test_what_is_refused(tmp_path: Path, name: str) -> None:
    more, vessel, waves, text = REFUSED[name]
    with pytest.raises(hybrid.SceneError, match=text):
        build(one_line(scene(table(tmp_path, {"heave": 1.0}, **more), waves, **vessel)))


@pytest.mark.parametrize(
    ("rows", "text"),
    [("frequency,heave\n1,1\n", "columns frequency"), ("frequency,heading,heave\n", "0 rows"),
     ("frequency,heading,heave\n1,0,1\n2,0,1\n\n2,0,1\n", "line 5: frequency and heading of line 3"),
     ("frequency,heading,heave\n1,0,1\n1,90,1\n2,90,1\n", "no row for 2 rad/s at 0 deg"),
     ("frequency,heading,heave\n0,0,1\n", "line 2: frequency = 0"), ("frequency,heading,heave_phase\n1,0,1\n", "columns"),
     ("frequency,heading,heave\n1,0,x\n", "line 2: heave is no finite")],
)  # fmt: skip
def test_a_bad_table_is_refused(tmp_path: Path, rows: str, text: str) -> None:
    (tmp_path / "rao.csv").write_text(rows)
    with pytest.raises(hybrid.SceneError, match=text):
        hybrid.run(scene(str(tmp_path / "rao.csv")))
