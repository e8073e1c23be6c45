"""Designs: how many equilibria they take, from where they find the same, and how often stated intervals hold.

pytest bench/test_bench_design.py -m bench -s

RECORDS=60 makes so many random records in place of 400 of a shape, which take a minute, and of 100 of a towing run or
of the pull of a dragged line, which take two each.  The lazy wave in ten seas takes three.
"""

from __future__ import annotations

import os
import time as clock
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import binomtest, norm, t

import hybrid
from hybrid.designs.design import Found
from hybrid.kernels.state.state import Floats
from hybrid.scene.study import DESIGN
from tests.designs.test_in_motion import heaved

pytestmark = pytest.mark.bench
RECORDS, HISTORIES = (int(os.environ.get("RECORDS", many)) for many in ("400", "100"))
DESIGNS = Path(__file__).parents[1] / "examples" / "designs"
# Of the towing record: keys and true numbers, EI (N m2) and drag; noise, 2 % of the largest force (N) and
# change of angle (rad).
TOWED = {"cable.sections[0].bending_stiffness": 6.0, "cable.sections[0].drag.normal": 1.3}
TOWED_NOISE = np.array([0.14, 0.0185])
# Of the dragged line: keys and true numbers, friction and drag along it; noise, 2 % of the largest pull (N); net weight
# (N/m).  It stretches for a second before all of it slides; drag grows with the square of the speed.
DRAGGED = {"environment.seabed.friction.axial": 0.4, "cable.sections[0].drag.tangential": 0.03}
DRAGGED_NOISE = np.array([3.5])
DRAGGED_WEIGHT = 9.81 * (1.5 - 1000 * np.pi * 0.03**2 / 4)
DRAGGED_SCENE = f"""\
environment:
  fluid: {{density: 1000, surface: 10}}
  seabed: {{z: {DRAGGED_WEIGHT / 1e5}, stiffness: 1.0e+5, damping: 1000, friction: {{axial: 0.6, lateral: 0.5}}}}
cable:
  sections:
    - {{length: 20, mass: 1.5, diameter: 0.03, axial_stiffness: 2.0e+4, damping: {{stiffness: 0.05}},
       drag: {{normal: 1, tangential: 0.05}}}}
ends:
  start: free
  end: {{kind: pinned, position: [20, 0, 0], motion: {{velocity: [2, 0, 0], ramp: 4}}}}
initial: {{kind: straight, origin: [0, 0, 0], direction: [1, 0, 0]}}
model: catenary
mesh: {{cells: 20}}
time: {{duration: 5, step: 0.02}}
"""
# Of the lazy wave: diameter of the buoyancy, lengths of lower, buoyant and upper section.
STARTS = ((0.45, 130, 50, 90), (0.5, 110, 60, 80), (0.6, 120, 30, 100), (0.42, 140, 70, 85), (0.7, 120, 25, 110))
# The same of the lazy wave in ten seas: diameters of both buoyant sections, lengths of the four.
IN_SEAS = (
    (0.42, 0.42, 130, 18, 18, 80), (0.4, 0.4, 125, 20, 15, 85), (0.45, 0.4, 130, 12, 18, 80),
    (0.38, 0.38, 135, 20, 20, 80), (0.42, 0.36, 135, 15, 15, 90),
)  # fmt: skip


def test_pretension_of_a_buoy_on_three_lines() -> None:
    found = hybrid.design(DESIGNS / "pretension.yaml")
    print(f"pretension of three lines: {found.equilibria} equilibria, that of the check on twice the cells included")
    assert found.equilibria <= 6


def test_one_short_motion() -> None:
    """A mass for a largest pull within 2 s of heave: no equilibrium where the motion alone is asked."""
    scene = heaved(time={"duration": 2.0, "step": 0.05})
    top = {"quantity": "tension", "at": "start", "over": "max", "value": 3500.0}
    unknowns = {"m": {"key": "cable.sections[0].mass", "low": 1, "high": 20}}
    took = []
    for _ in range(6):
        begin = clock.process_time()
        found = hybrid.design(scene, unknowns=unknowns, targets={"top": top})
        took.append(clock.process_time() - begin)
    print(f"one short motion: {min(took):.3f} s of CPU time, {found.equilibria} equilibria, {found.runs} runs")
    assert found.equilibria == 0


def from_start(name: str, start: Sequence[float]) -> Found:
    asked = DESIGN.read(DESIGNS / f"{name}.yaml").asked
    each = zip(asked.unknowns.items(), start, strict=True)
    unknowns = {name: x.model_copy(update={"start": float(value)}) for (name, x), value in each}
    more = {x: getattr(asked, x) for x in ("cases", "limits", "minimise")}
    return hybrid.design(asked.scene, unknowns=unknowns, **more)


def test_lazy_wave_from_five_starts() -> None:
    values = []
    for start in STARTS:
        found = from_start("lazy_wave", start)
        values.append(found.minimised)
        rounds = found.equilibria / len(found.scenes)
        print(
            f"lazy wave from {start}: {found.minimised:.4f} m3, {found.equilibria} equilibria, {rounds:.0f} of each case"
        )
        assert rounds <= 40
    assert max(values) < 1.001 * min(values)


@pytest.mark.parametrize("start", IN_SEAS)
def test_lazy_wave_in_ten_seas_from_five_starts(start: Sequence[float]) -> None:
    """Runs' worth are those of each sea, with all of differences; the free run counts four."""
    found = from_start("lazy_wave_in_seas", start)
    off = max(x.side * (x.value - x.bound) / abs(x.bound) for x in found.kept)
    free = max(x.side * (x.finer - x.bound) / abs(x.bound) for x in found.kept if x.finer is not None)
    print(
        f"lazy wave in seas from {start}: {found.minimised:.4f} m3, settled: {found.settled}, {found.runs / found.moving:.1f} "
        f"runs' worth; limits missed by at most {100 * off:.2g} %, in free runs {100 * free:.2g} %"
    )
    assert off <= 1e-3 and found.moving == 10
    assert found.settled and found.runs <= 40 * found.moving


def test_stated_intervals_hold_the_truth(tmp_path: Path) -> None:
    """EI of a sagging rod from records of its height at eight places, with noise of 2 % of its sag.

    Chance of the records themselves is 1.1 of 100; beside it stands what linear least squares by hand has of them.
    """
    key, truth = "cable.sections[0].bending_stiffness", 8.0
    scene = hybrid.load_scene(DESIGNS / "rod.yaml", [f"{key}={truth}", "mesh.cells=20"])
    rest, s = hybrid.static(scene), np.linspace(0.25, 2.0, 8)
    z = np.interp(s, rest.s, rest.position[-1][:, 2])
    slopes = [
        x.derivative for x in hybrid.sensitivity(scene, [f"position.z@{a if a < 2.0 else 'end'}" for a in s], [key])
    ]
    along = np.array(slopes) / np.linalg.norm(slopes)
    noise, rng, within = 0.02 * abs(z[-1]), np.random.default_rng(0), []
    for _ in range(RECORDS):
        e = rng.standard_normal(s.size)
        rows = "".join(f"{a:g},{b:.9g}\n" for a, b in zip(s, z + noise * e, strict=True))
        (tmp_path / "record.csv").write_text("s,z\n" + rows)
        shift = float(e @ along)
        left = float(np.linalg.norm(e - shift * along)) / np.sqrt(s.size - 1.0)
        linear = abs(shift) <= norm.ppf(0.975), abs(shift) <= left * t.ppf(0.975, s.size - 1)
        for stated, by_hand in zip(({"deviation": float(noise)}, {}), linear, strict=True):
            found = hybrid.design(
                scene, unknowns={"EI": {"key": key, "start": 12.0}},
                measured={"file": str(tmp_path / "record.csv")} | stated,
            )  # fmt: skip
            (estimate,) = found.estimates
            within.append((estimate.low <= truth <= estimate.high, by_hand))
    for k, what in enumerate(("stated", "of the scatter")):
        held, by_hand = 100.0 * np.mean(within[k::2], axis=0)
        print(
            f"deviation {what}: EI within its 95 % in {held:.1f} of 100 of {RECORDS} records, {by_hand:.1f} by linear "
            "least squares by hand"
        )
        assert abs(held - by_hand) <= 1.0


def towed(numbers: Mapping[str, float]) -> Floats:
    """Times (s), forces on the clamp in x (N) and angles of the lower end (rad) of a towing run: (40, 3)."""
    changes = [f"{k}={x}" for k, x in numbers.items()]
    run = hybrid.run(hybrid.load_scene(DESIGNS / "towed.yaml", [*changes, "output.every=0.2"]))
    return np.stack([run.t, run["reaction_start"][:, 0], run["theta"][:, -1]], axis=1)[1:]


def count_intervals(
    what: str,
    numbers: Mapping[str, float],
    noise: Floats,
    simulate: Callable[[Mapping[str, float]], Floats],
    identify: Callable[[Floats, int], Found],
) -> None:
    """Prints and asserts how often the 95 % of numbers, by key, hold the truth, of HISTORIES random records.

    `simulate` has times (s) and readings of a run, (n, 1 + m), of deviation `noise` (m); `identify` is of a record and
    its seed.  Beside it stands what linear least squares by hand, with differences of runs, has of the same records.
    """
    truth, values = simulate(numbers), np.array([*numbers.values()])
    each = [simulate({**numbers, k: 1.01 * x}) - simulate({**numbers, k: 0.99 * x}) for k, x in numbers.items()]
    J = np.stack([x[:, 1:] / noise for x in each], axis=-1).reshape(-1, values.size) / (0.02 * values)
    reach = norm.ppf(0.975) * np.sqrt(np.diag(np.linalg.inv(J.T @ J)))
    within, by_hand, noted = np.zeros(values.size, int), np.zeros(values.size, int), 0
    for seed in range(HISTORIES):
        e = np.random.default_rng(seed).standard_normal((truth.shape[0], noise.size))
        found = identify(truth + np.pad(e * noise, ((0, 0), (1, 0))), seed)
        within += [x.low <= y <= x.high for x, y in zip(found.estimates, values, strict=True)]
        by_hand += np.abs(np.linalg.lstsq(J, e.ravel(), rcond=None)[0]) <= reach
        noted += bool(found.notes)
    print(f"a note in {noted} of {HISTORIES} records of {what}")
    for estimate, held, linear, part in zip(found.estimates, within, by_hand, reach / values, strict=True):
        low, high = binomtest(held, HISTORIES).proportion_ci()
        print(
            f"{estimate.name} within its 95 % (+-{100 * part:.1f} %) in {held} of {HISTORIES} records of {what} "
            f"({100 * held / HISTORIES:.1f} %, 95 % from {100 * low:.1f} to {100 * high:.1f}); {linear} by linear least "
            "squares by hand"
        )
        assert binomtest(held, HISTORIES, 0.95).pvalue > 0.001
        assert abs(held - linear) <= max(1, 0.03 * HISTORIES)


def test_stated_intervals_of_a_towing_record_hold_the_truth(tmp_path: Path) -> None:
    """EI and drag from records of force and angle; the record of seed 0 is that of the example."""
    record, task = tmp_path / "towing_record.csv", tmp_path / "towing.yaml"
    for name in (task.name, "towed.yaml"):
        (tmp_path / name).write_text((DESIGNS / name).read_text())
    example = [x for x in (DESIGNS / record.name).read_text().splitlines(True) if not x.startswith("#")]

    def identify(table: Floats, seed: int) -> Found:
        rows = [f"{a:.1f},{b:.3f},{c:.4f}\n" for a, b, c in table]
        record.write_text("".join(["t,reaction_start.x,theta\n", *rows]))
        assert seed or record.read_text() == "".join(example)
        return hybrid.design(task)

    count_intervals("a towing run", TOWED, TOWED_NOISE, towed, identify)


def test_stated_intervals_of_friction_hold_the_truth(tmp_path: Path) -> None:
    """Friction and drag along a line from records of its pull on a bed, from rest to a speed of 2 m/s.

    At that speed the pull is friction of its weight and drag on pi x diameter, a closed form.
    """
    scene, record = tmp_path / "dragged.yaml", tmp_path / "pull.csv"
    scene.write_text(DRAGGED_SCENE)

    def simulate(numbers: Mapping[str, float]) -> Floats:
        run = hybrid.run(hybrid.load_scene(scene, [*(f"{k}={x}" for k, x in numbers.items()), "output.every=0.1"]))
        return np.stack([run.t, run["tension"][:, -1]], axis=1)[1:]

    def identify(table: Floats, seed: int) -> Found:
        record.write_text("".join(["t,tension\n", *(f"{a:.1f},{b:.3f}\n" for a, b in table)]))
        return hybrid.design(
            hybrid.load_scene(scene),
            unknowns={
                "friction": {"key": friction, "low": 0.05, "high": 2},
                "drag": {"key": drag, "low": 0.003, "high": 0.3},
            },
            measured={"file": str(record), "at": "end", "deviation": float(*DRAGGED_NOISE)},
        )

    friction, drag = DRAGGED
    steady = 20 * (DRAGGED[friction] * DRAGGED_WEIGHT + 500 * np.pi * 0.03 * DRAGGED[drag] * 2**2)
    assert simulate(DRAGGED)[-1, 1] == pytest.approx(steady, rel=1e-3)
    count_intervals("the pull of a dragged line", DRAGGED, DRAGGED_NOISE, simulate, identify)
