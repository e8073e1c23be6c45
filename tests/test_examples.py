"""Every example runs as it stands, and what its header says is true."""

from __future__ import annotations

import math
import runpy
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

import hybrid

EXAMPLES = Path(__file__).parents[1] / "examples"
Floats = NDArray[np.float64]


@cache
def ran(name: str) -> hybrid.Result:
    """The result of an example, complete."""
    result = hybrid.run(hybrid.load_scene(EXAMPLES / f"{name}.yaml"))
    assert result.status == "complete"
    return result


def periods(times: Floats, x: Floats) -> Floats:
    """Times between upward crossings of zero (s)."""
    before = np.flatnonzero((x[:-1] < 0) & (x[1:] >= 0))
    crossings = times[before] - x[before] * (times[before + 1] - times[before]) / (x[before + 1] - x[before])
    return np.diff(crossings)


def distance(a: hybrid.Result, b: hybrid.Result) -> float:
    """Largest distance of two shapes at the end of their runs (m)."""
    return float(np.linalg.norm(a.position[-1] - b.position[-1], axis=1).max())


def test_hanging_chain_swings_with_its_first_period() -> None:
    result = ran("01_hanging_chain")
    swings = periods(result.times, result.position[:, -1, 0])
    exact = 2 * math.pi / (1.20241 * math.sqrt(9.81))
    assert exact == pytest.approx(1.6684, abs=1e-4)
    assert swings.mean() == pytest.approx(exact, rel=0.01)  # 10 degrees are not small, and the second mode rides along
    assert np.ptp(swings) > 0.05  # it does
    energy = result.energy["kinetic"] + result.energy["potential"]
    swing = energy[0] + 0.5 * 9.81
    assert np.abs(energy - energy[0]).max() < 2e-3 * swing
    assert not result.events


def test_suspension_comes_to_rest_where_goyal_and_perkins_say() -> None:
    """Independent solutions of the boundary value problem; 100 cells are within 1e-3 m of them."""
    hybrid_, rod = ran("02_suspension"), ran("03_suspension_rod")
    assert hybrid_.position[-1, -1] == pytest.approx([1.70850, 0, 0.00183], abs=1e-3)
    assert rod.position[-1, -1] == pytest.approx([1.761849, 0, -0.003538], abs=1e-3)
    assert rod.position[-1, :, 2].min() == pytest.approx(-0.401365, abs=1e-4)
    assert np.linalg.norm(hybrid_.moment_end[-1]) == pytest.approx(2.02697e-3, rel=2e-3)
    assert np.linalg.norm(rod.moment_end[-1]) == pytest.approx(2.015395e-3, rel=2e-3)
    assert distance(hybrid_, rod) == pytest.approx(5.36e-2, rel=0.01)
    for result in (hybrid_, rod):
        assert np.abs(result.velocity[-1]).max() < 1e-6
        assert [event.kind for event in result.events] == ["turned in"]


def test_suspension_has_its_moment_in_the_rod_and_a_kink_at_the_joint() -> None:
    result = ran("02_suspension")
    moment, s = result.bending_moment[-1], result.s
    assert moment[s < 1.5].max() == 0.0 and moment.argmax() == len(s) - 1
    chord = np.diff(result.position[-1], axis=0)
    angle = np.degrees(np.arctan2(chord[:, 2], chord[:, 0]))
    before, after = int(np.searchsorted(s, 1.5)) - 1, int(np.searchsorted(s, 1.5 + 1e-9))
    assert angle[before] == pytest.approx(43.92, abs=1.0) and angle[after] == pytest.approx(39.73, abs=1.0)


def test_suspension_settles_in_its_own_equilibrium() -> None:
    for name in ("02_suspension", "03_suspension_rod", "04_suspension_catenary"):
        rest = hybrid.static(hybrid.load_scene(EXAMPLES / f"{name}.yaml"))
        assert distance(ran(name), rest) < 1e-5


def test_catenary_suspension_stays_taut_and_ends_elsewhere() -> None:
    result = ran("04_suspension_catenary")
    assert result.position[-1, -1] == pytest.approx([1.575, 0, 0.211], abs=1e-3)
    assert distance(result, ran("03_suspension_rod")) == pytest.approx(0.28, abs=0.01)
    assert result.tension[result.times > 0.45].min() > 2e-3 and result.tension[1:].min() > 0
    assert not result.events
    assert result.tension[-1, -1] == pytest.approx(0.01, rel=1e-3)  # the force it ends in
    assert "bending_moment" not in result


def test_a_blow_makes_the_catenary_slack_and_is_refused() -> None:
    scene = hybrid.load_scene(EXAMPLES / "04_suspension_catenary.yaml", ["ends.end.force.ramp=0"])
    with pytest.raises(hybrid.ComputationError) as stopped:
        hybrid.run(scene)
    assert stopped.value.outcome == hybrid.Outcome.SLACK


def test_cantilever_is_bent_as_bisshopp_and_drucker_say_and_swings() -> None:
    result = ran("05_cantilever")
    tip = result.position[:, -1]
    assert 1 - tip[0, 0] == pytest.approx(0.254420, rel=1e-3)
    assert tip[0, 1] == pytest.approx(0.603253, rel=1e-3)
    held = result.times <= 0.25
    assert np.abs(tip[held] - tip[0]).max() < 1e-6
    first = 2 * math.pi / 1.875104**2 / math.sqrt(0.16493 / 0.02466)
    assert first == pytest.approx(0.69, abs=0.005)
    assert periods(result.times, tip[:, 1]).mean() == pytest.approx(first, rel=0.015)  # large swings are not linear
    assert result.work["stiffness_damping"][-1] < 0
    total = sum(result.energy.values())
    lost = total[0] - total[-1]
    assert abs(result.work["scheme"][-1]) < 0.05 * lost


def test_whip_cracks_without_an_unresolved_bend() -> None:
    result = ran("06_whip")
    speed = np.linalg.norm(result.velocity[:, -1], axis=1)
    assert not result.events
    assert speed.max() == pytest.approx(12.7, abs=0.2)
    assert result.times[speed.argmax()] == pytest.approx(0.445, abs=5e-3)
    assert result.curvature.max() == pytest.approx(28, abs=1)
    energy, fall = sum(result.energy.values()), 0.1 * 9.81 * 0.5
    assert np.abs(energy - energy[0]).max() < 5e-4 * fall


def test_whip_owns_up_to_its_second_crack() -> None:
    changes = ["time.duration=1.6", "time.step=0.001", "mesh.cells=100"]
    result = hybrid.run(hybrid.load_scene(EXAMPLES / "06_whip.yaml", changes))
    assert "unresolved bend" in {event.kind for event in result.events}
    fall = 0.1 * 9.81 * 0.5
    assert -0.2 * fall < result.work["scheme"][-1] < -0.02 * fall


def test_taut_line_answers_as_the_string_equation_says() -> None:
    result = ran("07_forced_taut_cable")
    settled = result.times > 72 - 2 * 4.4
    middle = result.at(s=150.0)["position"][settled, 1]
    tension = result.at(s=0.0)["tension"][settled]
    H = result.tension[0].min()
    m, c, w, L = 1.6, 1.225 * 0.028 * 1.0 * 8.0, 2 * math.pi / 4.4, 299.9
    assert 2 * L / math.sqrt(H / m) == pytest.approx(4.594, abs=1e-3)
    k = np.sqrt((m * w * w - 1j * c * w) / H + 0j)
    theory = abs(1 / (2 * np.cos(k * L / 2)))
    assert theory == pytest.approx(4.1, abs=0.05)
    assert np.ptp(middle) / 2 / 0.05 == pytest.approx(theory, rel=0.02)  # drag linearised, sag left out
    assert periods(result.times[settled], tension - tension.mean()).mean() == pytest.approx(4.4 / 2, rel=0.01)


def test_taut_line_does_not_answer_away_from_resonance() -> None:
    motion = ["ends.end.motion.sway.period=3.5", "ends.end.motion.ramp=7.0"]
    result = hybrid.run(hybrid.load_scene(EXAMPLES / "07_forced_taut_cable.yaml", motion))
    middle = result.at(s=150.0)["position"][result.times > 72 - 7.0, 1]
    assert np.ptp(middle) / 2 / 0.05 < 1.2


def test_python_example_prints_what_it_promises(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Distances of the reference solutions (validation): hybrid 5.36 cm, its joint at 0.2 ... 1.7 m as listed."""
    script = runpy.run_path(str(EXAMPLES / "08_python_api.py"))
    found = script["main"](str(tmp_path / "picture.png"))
    said = capsys.readouterr().out
    assert found["rod"] == 0.0
    assert found["hybrid, 0.5 m of rod"] == pytest.approx(5.36e-2, rel=3e-3)
    assert found["catenary"] == pytest.approx(0.285, abs=1e-3)
    rows = [line.split() for line in said.splitlines()]
    listed = {float(row[0]): float(row[1]) for row in rows if len(row) == 2 and row[0][0].isdigit()}
    for joint, cm in ((0.2, 1.91), (0.4, 3.17), (0.6, 4.16), (0.8, 4.72), (1.0, 5.36), (1.2, 5.45), (1.7, 8.03)):
        assert listed[round(2.0 - joint, 1)] == pytest.approx(cm, abs=0.03)
    assert (tmp_path / "picture.png").stat().st_size > 10_000
