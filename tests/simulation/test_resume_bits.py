"""A run that was stopped, however often, is the run that was not: bit for bit."""

import random
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path
from zlib import crc32

import numpy as np
import pytest
from bits import Stopping, differences, machine_code, went_on

import hybrid
from hybrid.errors import OMITTED
from hybrid.store import recorder as record
from hybrid.store.hdf5_file import opened
from hybrid.store.whole_file import read_checkpoint
from tests.scenes import cable_scene, pinned_at

EXAMPLES = Path(__file__).parents[2] / "examples"
# Adaptive zones, friction, seas, a plane, the model error, steps that follow the error, a climb to an accuracy with
# several results; what a line remembers otherwise: tests/combinations/test_goes_on.py.
CASES = {
    "rod in a plane": ("06_whip", ["time.duration=0.06"]),
    "adaptive in a plane": ("touchdown", ["time.duration=14"]),
    "cells that follow": (
        "touchdown",
        ["time.duration=8", "model={kind: adaptive, curvature_error: 0.05}", "mesh=null"],
    ),
    "adaptive in space": ("s_tether", ["time.duration=6"]),
    "friction, laid": ("laying", ["time.duration=12"]),
    "waves": ("irregular_sea", ["time.duration=4"]),
    "two spread seas": (
        "irregular_sea",
        [
            "time.duration=4",
            "environment.fluid.waves={kind: sum, ramp: 10, spectra: [{kind: jonswap, significant_height: 1, "
            "peak_period: 12, spreading: {exponent: 20}, components: 20}, {kind: pierson_moskowitz, "
            "significant_height: 1, peak_period: 6, direction: 40, spreading: {exponent: 4}, components: 20}]}",
        ],
    ),
    "model error": ("touchdown", ["time.duration=6", "model=catenary", "output.errors=true"]),
    "controlled steps": ("rov_tether", ["time={duration: 10, tolerance: 1.0e-4}"]),
    "accuracy": ("06_whip", ["accuracy=0.3%", "time={duration: 0.3}"]),
    "accuracy by a second result": ("s_tether", ["accuracy={tension: 0.3%}", "mesh=null", "time={duration: 3}"]),
}
LONG = ("accuracy by a second result",)  # several runs for each part


@pytest.mark.parametrize("name", [pytest.param(x, marks=pytest.mark.slow) if x in LONG else x for x in CASES])
@pytest.mark.long  # 20 s of 10 cases
def test_a_stopped_run_goes_on_bit_for_bit(name, tmp_path, monkeypatch):
    file, settings = CASES[name]
    scene = hybrid.load_scene(EXAMPLES / f"{file}.yaml", settings)
    stopping = Stopping(monkeypatch)
    with hybrid.run(scene, tmp_path / "whole.h5", progress=stopping) as whole:
        assert name not in LONG or whole.attributes["effort_runs"] > 4, "there is one result alone"
    steps, draw = stopping.heard, np.random.default_rng(crc32(name.encode()))
    stops = [round(0.3 * steps + 0.3 * steps * draw.random()), *draw.integers(2, steps // 4, 2).tolist()]
    assert went_on(scene, tmp_path / "run.h5", stopping, stops) >= 2, "nothing was stopped after it was resumed"
    assert differences(tmp_path / "whole.h5", tmp_path / "run.h5") == []
    assert {x.suffix for x in tmp_path.iterdir()} == {".h5"}, "something is left behind"


@pytest.mark.long
def test_steps_failed_and_taken_back_go_on_as_well(tmp_path, monkeypatch):
    """What a controller and a manager remember of steps that failed is in the checkpoint."""
    scene = hybrid.load_scene(EXAMPLES / "06_whip.yaml", ["time={duration: 0.3, tolerance: 1.0e-7}", "accuracy=null"])
    stopping = Stopping(monkeypatch)
    with hybrid.run(scene, tmp_path / "whole.h5", progress=stopping) as whole:
        assert whole["steps/repeats"].sum() > 0, "no step has failed: take another scene"
        failed = int(np.flatnonzero(whole["steps/repeats"])[0])
    assert went_on(scene, tmp_path / "run.h5", stopping, [failed + 2, 38]) == 2
    assert differences(tmp_path / "whole.h5", tmp_path / "run.h5") == []


@pytest.mark.long
def test_events_that_are_too_many_are_counted_on(tmp_path, monkeypatch):
    """Of those that are not written the file says how many there were, also where the run was stopped in between."""
    monkeypatch.setattr(record, "MOST_OF_A_KIND", 2)
    scene = hybrid.load_scene(EXAMPLES / "touchdown.yaml", ["time.duration=30"])
    stopping = Stopping(monkeypatch)
    with hybrid.run(scene, tmp_path / "whole.h5", progress=stopping) as whole:
        assert [e.value for e in whole.events if e.kind == OMITTED]
    assert went_on(scene, tmp_path / "run.h5", stopping, [280]) == 1
    assert differences(tmp_path / "whole.h5", tmp_path / "run.h5") == []


# --- kill -9 at random moments: the file opens, and goes on bit for bit ---

# Steps times cells from one checkpoint to the next: some tenths of a second, so that several are written before a kill.
WORK = 30_000
# The compiled run pauses often enough for them: a checkpoint is written at a pause between two steps.
PAUSE = WORK // 4
OFTEN = "import sys, hybrid, hybrid.simulation.run_record as loop, hybrid.solve.network_steps as run; "
OFTEN += f"loop.WORK, run.CELL_STEPS = {WORK}, {PAUSE}; "
RUN = OFTEN + "hybrid.run(hybrid.load_scene(sys.argv[1], sys.argv[3:]), sys.argv[2])"
RESUME = OFTEN + "hybrid.resume(sys.argv[1])"
# Long enough to be hit, most of its time in the loop: zones that move, friction and plane; and a climb to an accuracy.
SCENES = {
    "touchdown": ["time.duration=200", "output.every=0.5"],
    "laying": ["output.every=0.25"],
    "06_whip": ["time={duration: 4}", "accuracy=1%"],
}


def kills(name: str, count: int, folder: Path, seed: int) -> dict[str, int]:
    """Kill runs of an example, and resumed runs, so often; how it went."""
    scene, settings, draw = str(EXAMPLES / f"{name}.yaml"), SCENES[name], random.Random(seed)
    whole = folder / "whole.h5"

    def start(code: str, *arguments: str) -> subprocess.Popen[bytes]:
        return subprocess.Popen([sys.executable, "-c", code, *arguments], stderr=subprocess.PIPE)

    compiled: set[Path] | None = None
    while compiled != (compiled := machine_code()):  # timed again if kernels had to be compiled
        begin = time.monotonic()
        process = start(RUN, scene, str(whole), *settings)
        said = process.communicate()[1].decode()
        assert process.returncode == 0, said
        wall = time.monotonic() - begin
    went = {
        "killed": 0,
        "before there was a file": 0,
        "before its first output": 0,
        "opened": 0,
        "the same": 0,
        "steps times cells recomputed": 0,
    }
    path = folder / "run.h5"
    while went["killed"] < count:
        for old in folder.glob("*run*"):
            old.unlink()
        process, begin = start(RUN, scene, str(path), *settings), time.monotonic()
        while True:
            with suppress(subprocess.TimeoutExpired):
                process.wait(draw.uniform(0.2, 1.0) * wall)
                wall = min(wall, time.monotonic() - begin)  # the machine may have less to do than when it was timed
            ended = process.poll() is not None
            process.kill()
            said = process.communicate()[1].decode()
            if ended:
                assert process.returncode == 0 or "is complete" in said, said
                break
            went["killed"] += 1
            if not path.exists():
                went["before there was a file"] += 1
                break
            with hybrid.open(path) as result:
                went["opened"] += 1
                begun = len(result.times) > 0
            if not begun:  # some 50 ms between the file and its first output: there is nothing to resume
                went["before its first output"] += 1
                path.unlink()
                break
            with hybrid.open(path) as result:
                if result.status != "complete":  # else it was killed while its errors were estimated, or after
                    with opened(path) as file:
                        steps = int((file["steps/t"][:] > read_checkpoint(file).t).sum())
                    lost = steps * max(len(x.kinds) for x in result.mesh)
                    went["steps times cells recomputed"] = max(went["steps times cells recomputed"], lost)
            process = start(RESUME, str(path))
        if path.exists():
            try:
                hybrid.resume(path).close()
            except hybrid.ResultError as error:
                assert "is complete" in str(error), error
            assert differences(whole, path) == []
            went["the same"] += 1
            assert {x.name for x in folder.iterdir()} == {"whole.h5", "run.h5"}, "something is left behind"
    return went


@pytest.mark.parametrize(
    ("count", "seed"), [pytest.param(2, 1, marks=pytest.mark.slow), pytest.param(34, 2, marks=pytest.mark.bench)]
)
@pytest.mark.parametrize("name", SCENES)
def test_kills(name: str, count: int, seed: int, tmp_path: Path) -> None:
    """Of all three scenes two at a time, or a hundred in all."""
    went = kills(name, count, tmp_path, seed)
    print(f"\n{name}: " + ", ".join(f"{text} {number}" for text, number in went.items()))
    assert went["opened"] == went["killed"] - went["before there was a file"]
    assert went["steps times cells recomputed"] <= 2 * WORK


def falling(duration):
    """A line falls back on a hard bed when the force at its end is let go: steps are repeated in halves."""
    section = {"length": 20.0, "mass": 5.0, "diameter": 0.05, "bending_stiffness": 2.0, "damping": {"mass": 0.2}}
    return {
        "environment": {"seabed": {"z": -5.0, "stiffness": 1e8, "damping": 1e4, "friction": 0.5}},
        "cable": {"sections": [section]}, "mesh": {"cells": 20}, "model": "rod", "initial": "equilibrium",
        "ends": {"start": {"kind": "pinned", "position": [0, 0, 0]},
                 "end": {"kind": "free", "force": {"value": [300, 0, 60], "until": 1.0}}},
        "time": {"duration": duration, "step": 0.1}, "output": {"every": 0.1},
    }  # fmt: skip


def test_a_run_goes_on_to_the_bit_behind_a_step_that_was_shortened(tmp_path):
    whole = hybrid.run(falling(2.0), output=tmp_path / "whole.h5")
    first = float(whole["steps/t"][np.flatnonzero(whole["steps/repeats"])[0]])
    hybrid.run(falling(round(np.ceil(10.0 * first - 1e-6) / 10.0, 6)), output=tmp_path / "part.h5")
    assert np.array_equal(hybrid.resume(tmp_path / "part.h5", until=2.0).position, whole.position)


@pytest.mark.parametrize(("step", "cuts"), [(0.1, (0.7, 1.2)), (0.02, (0.58,)), (0.05, (0.35, 1.15))])
def test_a_run_goes_on_to_the_bit_where_steps_do_not_sum_up_to_its_end(step, cuts, tmp_path):
    """7 times 0.1 is 0.7000000000000001: an output and a step are at the time that is said."""

    def lasting(duration):
        return cable_scene(
            {"length": 5, "mass": 2, "axial_stiffness": 1e4, "bending_stiffness": 1.0}, pinned_at(0, 0, 0), {"kind": "free"},
            initial={"kind": "straight", "origin": [0, 0, 0], "direction": [1, 0, 0]}, model="rod", mesh=6,
            time=(duration, step), output={"every": step},
        )  # fmt: skip

    whole = hybrid.run(lasting(2.0))
    for cut in cuts:
        hybrid.run(lasting(cut), output=tmp_path / f"{cut}.h5").close()
        longer = hybrid.resume(tmp_path / f"{cut}.h5", until=2.0)
        assert np.array_equal(longer.t, whole.t) and cut in whole.t
        assert np.array_equal(longer.position, whole.position)


def test_a_step_that_is_taken_back_is_the_same_again():
    with hybrid.Simulation(falling(5.0)) as line:
        while line.t < 3.0:
            saved = line.save()
            once = line.step(), line.forces().start.copy()
            line.restore(saved)
            again = line.step(), line.forces().start.copy()
            assert once[0] == again[0] and np.array_equal(once[1], again[1])
