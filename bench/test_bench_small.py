"""Small costs that a user meets often: statics, a logged step, a notebook cell, a motion, a file that is cut off.

pytest bench -m bench -s -k small
"""

import time
import timeit
from statistics import median

import pytest
from reported import reported
from test_result_file import recorder
from test_statics_sea import SEEDS, variant

import hybrid
from hybrid.scene.motion import EndMotion
from hybrid.scene.motion_tables import Harmonic, Motion

pytestmark = pytest.mark.bench


def test_small_statics():
    """Equilibria of random moorings and tethers, 100 cells, result included."""
    hybrid.static(variant(SEEDS[0]))  # compile
    seconds = []
    for seed in SEEDS:
        scene = variant(seed)
        begin = time.process_time()
        try:
            hybrid.static(scene)
        except hybrid.ComputationError:
            continue
        seconds.append(time.process_time() - begin)
    print(f"\n{len(seconds)} of {len(SEEDS)} equilibria: median {1e3 * median(seconds):.0f} ms of CPU time, ", end="")
    print(f"slowest {1e3 * max(seconds):.0f} ms")
    assert median(seconds) <= 0.05


def test_small_log(tmp_path):
    row = {"t": 0.0, "residual": 0.0, "dt": 1.0, "iterations": 1}
    with recorder(tmp_path / "run.h5") as file:
        each = min(timeit.repeat(lambda: file.log(row), number=1000, repeat=5)) / 1000
    print(f"\na step in the log: {1e6 * each:.2f} us")
    assert each < 20e-6


def test_small_notebook_cell():
    result = reported(outputs=501)
    seconds = median(timeit.repeat(result._repr_html_, number=1, repeat=5))
    print(f"\na notebook cell of 501 outputs: {1e3 * seconds:.0f} ms")
    assert seconds < 1.0


def test_small_motion():
    motion = EndMotion(Motion(heave=Harmonic(amplitude=2.0, period=8.0), ramp=16.0), (0.0, 0.0, 0.0))
    each = min(timeit.repeat(lambda: motion.at_time(20.0), number=1000, repeat=5)) / 1000
    print(f"\nposition of an end that heaves: {1e6 * each:.1f} us")
    assert each < 16e-6


def test_small_cut_off_file(tmp_path):
    """HDF5 alone would read the tables of a file that is cut off again and again."""
    scene = hybrid.load_scene("examples/02_suspension.yaml", ["time.duration=1"])
    hybrid.run(scene, tmp_path / "run.h5", progress=False)
    whole, cut = (tmp_path / "run.h5").read_bytes(), tmp_path / "cut.h5"
    cut.write_bytes(whole[: len(whole) // 2])
    begin = time.perf_counter()
    with pytest.raises(hybrid.ResultError):
        hybrid.open(cut)
    seconds = time.perf_counter() - begin
    print(f"\na file that is cut off is refused in {1e3 * seconds:.0f} ms")
    assert seconds < 1.0
