"""The elevation of the sea as an output: of a regular wave by its formula, of many components by their sum."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import hybrid
from hybrid.model.sea import surroundings
from hybrid.scene.read import one_line

EXAMPLES = Path(__file__).parents[2] / "examples"
PLACES = [[0.0, 0.0], [30.0, 10.0], [-12.5, 4.0]]
LINE = """
environment: {{fluid: {{density: 1025, surface: 0, waves: {waves}}}}}
cable: {{sections: [{{length: 12, mass: 2, axial_stiffness: 1e6, diameter: 0.02}}]}}
ends: {{start: {{kind: pinned, position: [0, 0, -40]}}, end: {{kind: pinned, position: [10, 0, -40]}}}}
initial: equilibrium
model: catenary
mesh: {{cells: 8}}
time: {{duration: 6, step: 0.1}}
output: {{every: 0.25, elevation: {places}}}
"""


def test_a_regular_wave() -> None:
    waves = "{kind: regular, height: 2.0, period: 7.0, direction: 30.0, phase: 90.0, ramp: 4.0}"
    result = hybrid.run(hybrid.parse_scene(LINE.format(waves=waves, places=PLACES)))
    w = 2.0 * np.pi / 7.0
    k, t = w**2 / 9.81, result.times[:, None]
    along = np.array(PLACES) @ [np.cos(np.pi / 6.0), np.sin(np.pi / 6.0)]
    part = np.clip(t / 4.0, 0.0, 1.0)
    grown = part**3 * (10.0 - 15.0 * part + 6.0 * part**2)
    assert result.elevation == pytest.approx(grown * np.cos(k * along - w * t + 0.5 * np.pi), abs=1e-9)
    assert result.elevation_at.tolist() == PLACES
    assert result.units["elevation"] == "m"


def test_many_components_and_the_same_after_a_resume(tmp_path: Path) -> None:
    waves = "{kind: jonswap, significant_height: 3.0, peak_period: 9.0, components: 40, depth: 60}"
    scene = hybrid.parse_scene(LINE.format(waves=waves, places=PLACES))
    file = tmp_path / "run.h5"
    hybrid.run(scene, file)
    sea = surroundings(one_line(scene), 8)
    with hybrid.open(file) as result:
        expected = [[sea.elevation(x, y, float(t))[0] for x, y in PLACES] for t in result.times]
        assert result.elevation == pytest.approx(np.array(expected), abs=1e-9)
        table = hybrid.export(result, tmp_path / "run.csv", names=["elevation"]).files[0].read_text()
    rows = [line for line in table.splitlines() if not line.startswith("#")]
    assert len(rows[0].split(",")) == 1 + len(PLACES)
    assert float(rows[-1].split(",")[1]) == pytest.approx(expected[-1][0], abs=1e-6)


def test_the_equilibrium_has_still_water() -> None:
    waves = "{kind: regular, height: 2.0, period: 7.0}"
    assert not hybrid.static(hybrid.parse_scene(LINE.format(waves=waves, places=PLACES))).elevation.any()


def test_no_elevation_without_waves() -> None:
    with pytest.raises(hybrid.SceneError, match=r"output\.elevation(.|\n)*no waves"):
        hybrid.parse_scene(LINE.format(waves="null", places=PLACES).replace(", waves: null", ""))
