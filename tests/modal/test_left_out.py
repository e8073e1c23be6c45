"""What a linear response says that it leaves out, against closed forms and a run in time."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import hybrid
from hybrid.linear.response_results import shape_of_drag
from hybrid.modal import validity
from tests.scenes import cable_scene, pinned_at, span

EA, LENGTH, T0 = 1e6, 50.0, 2e4
COUNT = 13
PERIODS = 32.0 * 10.0 / np.arange(20.0, 20.0 + COUNT)  # s, of which 320 s are a whole number


@pytest.fixture(autouse=True)
def many_parts(monkeypatch: pytest.MonkeyPatch) -> None:
    """So that what is found hardly scatters with the phases."""
    monkeypatch.setattr(validity, "PARTS", 60)


def harmonics(amplitude: float, seed: int) -> list[dict[str, float]]:
    phases = np.random.default_rng(seed).uniform(0.0, 360.0, COUNT)
    return [{"amplitude": amplitude, "period": p, "phase": x} for p, x in zip(PERIODS.tolist(), phases, strict=True)]


def moved(t: np.ndarray, given: list[dict[str, float]]) -> np.ndarray:
    return sum(x["amplitude"] * np.sin(2.0 * np.pi * t / x["period"] + np.radians(x["phase"])) for x in given)


def test_the_stretch_by_swinging() -> None:
    """A light bar that is turned and stretched: EA (a/L + b^2/2L^2) for ends that move by a along and b across."""
    along, across = harmonics(0.002, 1), harmonics(0.3, 2)
    motion = {"surge": along, "sway": across, "ramp": 60.0}
    scene = cable_scene(
        {"length": LENGTH / (1.0 + T0 / EA), "mass": 1e-3, "axial_stiffness": EA},
        pinned_at(0, 0, 0),
        pinned_at(LENGTH, 0, 0, motion=motion),
        gravity=0,
        model="catenary",
        mesh=8,
    )
    found = hybrid.response(scene).lines["cable"]
    t = np.linspace(0.0, 320.0, 20_001)[:-1]
    a, b = moved(t, along), moved(t, across)
    linear, square = (a / LENGTH).std(), (b**2 / (2.0 * LENGTH**2)).std()
    assert found.deviation("tension").max() == pytest.approx(EA * (1.0 + T0 / EA) * linear, rel=0.02)
    part = np.sqrt(1.0 + (square / linear) ** 2) - 1.0
    assert 0.05 < part < 1.0
    assert found.left_out["tension"] == pytest.approx(part, rel=0.1)


@pytest.mark.parametrize(
    ("waves", "part", "bound"),
    [
        ({"kind": "regular", "height": 0.5, "period": 12.0}, np.sqrt(3.0 / 8.0) / (8.0 / (3.0 * np.pi) / np.sqrt(2.0)) - 1.0, 0.02),
        ({"kind": "jonswap", "significant_height": 0.5, "peak_period": 14.0}, np.sqrt(3.0 * np.pi / 8.0) - 1.0, 0.25),
    ],
    ids=["one harmonic", "a sea"],
)  # fmt: skip
def test_the_rest_of_drag(waves: dict[str, object], part: float, bound: float) -> None:
    """Curvature of a taut string is its load over its tension: of c |u| u, u of one harmonic or normal, along a line.

    Of 1100 waves the square of what is left, whose kurtosis is about 20, scatters by 13 %.
    The whole load has sqrt(3/8) c U^2 and sqrt(3) c s^2, its linear part 8/(3 pi sqrt 2) c U^2 and sqrt(8/pi) c s^2.
    """
    section = {"length": 10.0, "mass": 0.2, "diameter": 0.01, "axial_stiffness": 1e8, "drag": {"normal": 1.2}}
    water = {"density": 1025, "surface": 0.0, "waves": waves | {"depth": 10.0, "direction": 90.0, "ramp": 10.0}}
    scene = cable_scene(
        section, pinned_at(0, 0, -9.9), pinned_at(10.005, 0, -9.9), fluid=water, model="catenary", mesh=10
    )
    line = hybrid.response(scene).lines["cable"]
    assert line.left_out["curvature"][2:-2] == pytest.approx(part, rel=bound)


DRAG = np.sqrt(3.0 * np.pi / 8.0) - 1.0  # what drag of still water leaves out where nothing else acts


def test_the_size_of_a_vector_with_the_law_of_drag() -> None:
    """About 0 the size of z has the variance 1 - 2/pi, and that of z|z|/sqrt(3) 1 - 1/3; far from 0 both have 1.

    Between, with drag of a current and what is linear, it is that of 10^6 values.
    """

    def shape(mean: float, across: float, part: float, flow: float) -> float:
        each = np.array([mean]), np.array([[1.0], [across]]), np.array([part]), np.array([flow])
        return float(shape_of_drag(*each)[0])

    about = np.sqrt((1.0 - 1.0 / 3.0) / (1.0 - 2.0 / np.pi)) - 1.0
    assert shape(1e-9, 0.0, DRAG, 0.0) == pytest.approx(about, rel=1e-2)
    assert shape(9.0, 0.3, DRAG, 0.0) == 0.0 == shape(1.0, 0.3, 0.0, 0.0)
    z, y = np.random.default_rng(1).normal(size=(2, 1_000_000))
    for mean, flow, part in ((1.6, 0.0, 0.05), (2.4, 3.2, 0.02), (1.6, -1.0, 0.02)):
        force = np.abs(flow + z) * (flow + z)
        rest = force - force.mean() - (force * z).mean() * z
        x = z + np.sqrt((1.0 + part) ** 2 - 1.0) * rest / rest.std()
        there = np.hypot(mean + x / x.std(), 0.4 * y).std() / np.hypot(mean + z, 0.4 * y).std() - 1.0
        assert shape(mean, 0.4, part, flow) == pytest.approx(there, abs=3e-3)
    assert shape(1.6, 0.4, 0.05, 0.0) < -0.05 < 0.0 < shape(2.4, 0.4, 0.02, 3.2)


def in_waves(section: dict[str, Any], sea: dict[str, Any], *ends: dict[str, Any]) -> dict[str, Any]:
    """A line between two ends in 100 m of water."""
    fluid = {"density": 1025, "surface": 0, "waves": sea | {"direction": 30.0, "ramp": 10.0, "depth": 100.0}}
    return cable_scene(section | {"added_mass": {"normal": 1.0}}, *ends, fluid=fluid, model="catenary", mesh=60)


def deviations(scene: dict[str, Any], points: list[float], duration: float, step: float) -> np.ndarray:
    """Standard deviations of curvature at points in a run, after 100 s."""
    more = {"time": {"duration": duration, "step": step}, "output": {"every": 0.25, "points": points}}
    with hybrid.run(scene | more) as result:
        return np.asarray(result.curvature)[result.times > 100.0].std(axis=0)


@pytest.mark.long
def test_a_string_whose_bend_turns_over_in_waves_as_in_an_hour() -> None:
    """A taut leg near the surface: its curvature is drag over tension, not normal, and 1.6 standard deviations from 0.

    A normal law would be 8 % too large.
    """
    rope = {"length": 133.7, "mass": 6.0, "diameter": 0.08, "axial_stiffness": 2e6, "drag": {"normal": 1.2}}
    waves = {"kind": "jonswap", "significant_height": 2.0, "peak_period": 8.0}
    scene = in_waves(rope, waves, pinned_at(0, 0, -95), pinned_at(100, 0, -5))
    line, there = hybrid.response(scene).lines["cable"], deviations(scene, [120.33, 127.015], 3600.0, 0.15)
    nodes = [int(np.abs(line.s - s).argmin()) for s in (120.33, 127.015)]
    here = line.deviation("curvature")[nodes]
    assert here == pytest.approx(there, rel=0.03)
    assert (here / (1.0 + np.asarray(line.shape)[nodes]))[1] > 1.06 * there[1]


@pytest.mark.long
def test_fast_bends_across_hide_nothing_of_a_quiet_bend() -> None:
    """A hung line in short waves, deep down: across its bend it moves by waves, in it mostly by what drag leaves out.

    Measured by both directions together, a tenth of what is left out would be told.
    """
    section = {"length": 60.0, "mass": 30.0, "diameter": 0.1, "axial_stiffness": 5e6, "drag": {"normal": 1.2}}
    waves = {"kind": "jonswap", "significant_height": 1.0, "peak_period": 5.0}
    scene = in_waves(section, waves, pinned_at(0, 0, -65), pinned_at(6, 0, -5.15))
    found = hybrid.response(scene)
    line, nodes = found.lines["cable"], [3, 4, 6]
    added = deviations(scene, [3.0, 4.0, 6.0], 700.0, 0.1) / line.deviation("curvature")[nodes] - 1.0
    assert line.left_out["curvature"][nodes] == pytest.approx(added, rel=0.3)
    assert not line.resolved("curvature")[nodes].any() and not found.valid_for("curvature")


@pytest.mark.long  # 1.2 s
def test_curvature_that_is_known_hardly_anywhere_is_not_valid() -> None:
    """A chain on the bed, moved at its end: it bends to and fro at the touchdown, and known is only that."""
    chain = {"length": 200.0, "mass": 30.0, "diameter": 0.07, "axial_stiffness": 5e6, "drag": {"normal": 1.4}}
    waves = {"kind": "jonswap", "significant_height": 0.2, "peak_period": 8.0, "direction": 30.0}
    motion = {"heave": {"amplitude": 0.02, "period": 9.0}, "ramp": 10.0}
    scene = cable_scene(
        chain | {"added_mass": {"normal": 1.0}},
        pinned_at(0, 0, -60),
        pinned_at(170, 0, -5, motion=motion),
        fluid={"density": 1025, "surface": 0, "waves": waves},
        seabed={"z": -60.0, "stiffness": 5e4},
        model="catenary",
        mesh=80,
    )
    found = hybrid.response(scene)
    assert found.lines["cable"].resolved("curvature").sum() == 1
    (note,) = found.notes
    assert "where it varies most, is known; along 98.8 % of the line it is not" in note
    assert not found.valid_for("curvature") and found.valid_for("tension") and found.valid_for("position")


def released(**when):
    moved = pinned_at(80, 0, 0, motion={"heave": {"amplitude": 0.1, "period": 8.0}, "ramp": 8.0}, release_at=when)
    return span(time=(20.0, 0.1)) | {"ends": {"start": pinned_at(0, 0, 0), "end": moved}}


def test_an_end_that_is_let_go_is_told():
    assert any("let go at 10 s" in x for x in hybrid.response(released(time=10.0)).notes)
    assert any("let go at 10 s" in x for x in hybrid.modes(released(time=10.0), count=2).notes)
    assert any("let go at 1000 N" in x for x in hybrid.response(released(tension=1000.0)).notes)
    assert not any("let go" in x for x in hybrid.response(released(tension=1e5)).notes)
