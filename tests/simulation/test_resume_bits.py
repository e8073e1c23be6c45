"""A run that was stopped, however often, is the run that was not: bit for bit."""

from pathlib import Path
from zlib import crc32

import numpy as np
import pytest
from bits import Stopping, differences, went_on

import hybrid
from hybrid.errors import OMITTED
from hybrid.store import recorder as record

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
