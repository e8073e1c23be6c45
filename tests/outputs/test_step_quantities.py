"""Ranges of quantities over every step: against the same run with an output at every step."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import hybrid
from hybrid.kernels.watch import named_quantities
from hybrid.scene.quantities import KINDS
from hybrid.scene.read import read_text
from hybrid.scene.study import Kept
from hybrid.store.limits import held_of
from hybrid.store.tables import rows_of
from hybrid.studies.workers import collected

SCENE = """
environment: {fluid: {density: 1025, current: [0.4, 0.3, 0], surface: 0}, seabed: {z: -20, stiffness: 1.0e4, damping: 500}}
cable:
  sections:
    - {length: 40, mass: 20, diameter: 0.05, axial_stiffness: 1.0e7, bending_stiffness: 2.0e3, drag: {normal: 1.2},
       pipe: {wall: 0.004, max_stress: 2.0e8, pressure: 1.0e6, content_density: 900}}
    - {length: 20, mass: 25, diameter: 0.07, axial_stiffness: 1.0e7, bending_stiffness: 6.0e3, drag: {normal: 1.2}}
ends:
  start: {kind: pinned, position: [0, 0, -20]}
  end:
    kind: pinned
    position: [45, 0, -2]
    motion: {heave: {amplitude: 1.5, period: 4}, sway: {amplitude: 1.0, period: 5}, ramp: 2}
initial: equilibrium
model: {kind: catenary, slack: warn}
mesh: {cells: 30}
time: {duration: 3, step: 0.05}
output:
  every: 0.05
  points: 31
  quantities:
    level: {kind: horizontal_force, end: end}
    upward: {kind: vertical_force, end: start}
    along: {kind: force_along, end: end, direction: [1, 2, 3]}
    steep: {kind: declination, end: end}
    heading: {kind: azimuth, end: start}
    back: {kind: azimuth, end: end}
    other_turn: {kind: azimuth, end: end, smallest: -190, largest: -170}
    hang_off: {kind: end_angle, end: end, direction: [0, 0, -1], largest: 7}
    lift: {kind: uplift, end: end, largest: 1}
    lift_angle: {kind: uplift_angle, end: start}
    tdp: {kind: touchdown, end: end}
    moved: {kind: touchdown_excursion, end: end}
    layback: {kind: layback, end: end}
    reach: {kind: layback, end: start, to: end}
    point: {kind: clearance, point: [30, 0, -5], smallest: 4}
    wall: {kind: clearance, point: [0, 0, -21], normal: [0.1, 0, 1], range: [10, 50]}
    riser: {kind: clearance, path: [[20, 5, -19], [25, 3, -10], [40, 6, -8]], diameter: 0.5}
"""
SPARSE = SCENE.replace("every: 0.05", "every: 1.5")


@pytest.fixture(scope="module")
def dense() -> hybrid.Result:
    return hybrid.run(hybrid.parse_scene(SCENE))


def check_ranges(result: hybrid.Result, dense: hybrid.Result) -> None:
    """The ranges of a result are those of a result with an output at every step."""
    names = [x.removeprefix("extremes/") for x in result.names if x.startswith("extremes/") and x.count("/") == 1]
    assert names
    for name in names:
        values = dense[name]
        places = dense[f"{name}_at"] if f"extremes/s/{name}" in result else None
        for bound, k in ((0, int(np.nanargmin(values))), (1, int(np.nanargmax(values)))):
            scale = np.nanmax(np.abs(values))
            assert result[f"extremes/{name}"][bound] == pytest.approx(values[k], abs=1e-12 * scale), name
            t = result[f"extremes/t/{name}"][bound]
            assert abs(values[np.abs(dense.times - t).argmin()] - values[k]) <= 1e-12 * scale, name
            if places is not None:
                assert result[f"extremes/s/{name}"][bound] == pytest.approx(places[k], abs=1e-3), name


def test_every_kind_has_its_number() -> None:
    numbers = [getattr(named_quantities, kind.upper()) for kind in KINDS]
    assert sorted(numbers) == list(range(len(KINDS)))


def test_ranges_are_those_of_all_steps(dense: hybrid.Result, tmp_path: Path) -> None:
    sparse = hybrid.run(hybrid.parse_scene(SPARSE), tmp_path / "sparse.h5")
    assert len(sparse.times) == 3
    check_ranges(sparse, dense)
    held = {(x.name, x.limit): x for x in held_of(sparse)}
    found = held["hang_off", "largest"]
    assert found.value == dense.hang_off.max() > sparse.hang_off.max() and not found.by_outputs
    assert "outputs" not in found.text and found.t in dense.times
    assert held["point", "smallest"].s is not None
    stress = held["von_mises", "max_stress"]
    s, values = dense.both_sides("von_mises")
    inside = [k for k in range(s.size) if not np.isnan(values[:, k]).any()]
    assert stress.value >= values[:, inside].max() * (1 - 1e-9) and not stress.by_outputs
    kept = {"far": Kept(quantity="point", take=("max",)), "near": Kept(quantity="point", take=("min",))}
    values_kept = {name: float(x) for name, (_, x) in collected(sparse, kept).kept.items()}
    assert values_kept == pytest.approx({"far": dense.point.max(), "near": dense.point.min()}, rel=1e-12)
    rows = rows_of(sparse, names=["hang_off"])
    assert "of all steps" in rows[0]["beyond_outputs"]
    gone_on = hybrid.parse_scene(SPARSE.replace("duration: 3", "duration: 1.5"))
    hybrid.run(gone_on, tmp_path / "half.h5").close()
    check_ranges(hybrid.resume(tmp_path / "half.h5", tmp_path / "rest.h5", until=3.0), dense)


def test_azimuths_go_on_beyond_half_a_turn(dense: hybrid.Result) -> None:
    """The pull at the end is along -x, and swings to both sides of it."""
    assert dense.back.min() < 180.0 < dense.back.max() and np.abs(np.diff(dense.back)).max() < 90.0
    np.testing.assert_allclose(dense.other_turn, dense.back - 360.0, atol=1e-9)


def test_stress_and_wall_tension_at_every_node_and_step(dense: hybrid.Result) -> None:
    places = dense["envelope/s"]
    for name in ("von_mises", "wall_tension"):
        s, values = dense.both_sides(name)
        compared = 0
        for x in np.unique(s):
            there, here = np.flatnonzero(np.abs(s - x) < 1e-9), np.flatnonzero(np.abs(places - x) < 1e-9)
            for i, j in zip(there, here, strict=True) if there.size == here.size else ():
                largest, scale = dense[f"envelope/{name}_max"][j], np.nanmax(values)
                assert np.isnan(largest) == np.isnan(values[:, i]).any()
                if not np.isnan(largest):
                    assert largest == pytest.approx(values[:, i].max(), abs=1e-9 * scale)
                    assert dense[f"envelope/{name}_min"][j] == pytest.approx(values[:, i].min(), abs=1e-9 * scale)
                    compared += 1
        assert compared >= (21 if name == "von_mises" else 31)


def test_ranges_of_a_rod_and_of_one_that_is_paid_out() -> None:
    def both(old: str, new: str) -> None:
        text = SCENE.replace(old, new).replace("duration: 3", "duration: 1")
        check_ranges(hybrid.run(hybrid.parse_scene(text.replace("every: 0.05", "every: 0.5"))),
                     hybrid.run(hybrid.parse_scene(text)))  # fmt: skip

    both("model: {kind: catenary, slack: warn}", "model: rod")
    paid = "position: [45, 0, -2]\n    payout: {rate: 1.0, ramp: 0.5}"
    both("position: [45, 0, -2]", paid)


SYSTEM = """
environment: {gravity: 0.0}
points:
  a: {kind: fixed, position: [0, 0, 0]}
  b: {kind: fixed, position: [10.01, 0, 0], motion: {sway: {amplitude: 0.1, period: 1}, ramp: 0.3}}
  c: {kind: fixed, position: [3, -5, 2]}
  d: {kind: fixed, position: [3, 5.01, 2], motion: {travel: {by: [0, 0, -1.0], over: 2.0}}}
lines:
  one: {start: a, end: b, sections: [{length: 10, mass: 1, axial_stiffness: 1.0e5, diameter: 0.2}], mesh: {cells: 10}}
  two: {start: c, end: d, sections: [{length: 10, mass: 1, axial_stiffness: 1.0e5, diameter: 0.1}], mesh: {cells: 10}}
time: {duration: 1, step: 0.05}
output:
  every: 0.05
  quantities:
    gap: {kind: clearance, line: one, other: two, smallest: 1.9}
    back: {kind: clearance, line: two, other: one, range: [1, 4.5]}
    part: {kind: clearance, line: one, other: two, range: [0, 2.2]}
    pull: {kind: horizontal_force, line: two, end: start, largest: 1}
    spot: {kind: clearance, line: one, point: [3, 1, 0]}
"""


@pytest.mark.long
def test_ranges_of_several_lines(tmp_path: Path) -> None:
    def run(text: str, name: str) -> hybrid.Result:
        network = read_text(text)[0]
        assert isinstance(network, hybrid.Scene)
        return hybrid.run(network, tmp_path / name)

    dense = run(SYSTEM, "dense.h5")
    sparse = run(SYSTEM.replace("every: 0.05", "every: 0.5"), "sparse.h5")
    check_ranges(sparse, dense)
    assert {x.name: x.by_outputs for x in held_of(sparse)} == {"gap": False, "pull": False}
    run(SYSTEM.replace("every: 0.05", "every: 0.5").replace("duration: 1,", "duration: 0.5,"), "half.h5").close()
    check_ranges(hybrid.resume(tmp_path / "half.h5", tmp_path / "rest.h5", until=1.0), dense)
