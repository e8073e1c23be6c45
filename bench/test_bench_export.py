"""How large every export of a result is, and how long it takes.

    pytest bench/test_bench_export.py -m bench -s

The result is that of examples/touchdown.yaml; printed are sizes and the median time of five exports, the first of which
loads what it needs and does not count.
"""

import time
from pathlib import Path
from statistics import median

import pytest

import hybrid

pytestmark = pytest.mark.bench
ROOT = Path(hybrid.__file__).parents[1]
ROUNDS = 5


def test_size_and_time_of_every_export(tmp_path):
    hybrid.run(hybrid.load_scene(ROOT / "examples" / "touchdown.yaml"), tmp_path / "run.h5").close()
    whole = (tmp_path / "run.h5").stat().st_size
    print(f"\n| format | MB | s |\n|---|---|---|\n| run.h5 | {whole / 1e6:.2f} | |")
    for kind, most in (("nc", 1.1), ("vtkhdf", 1.2), ("csv", 0.1), ("fatigue", 0.1)):
        taken = []
        for _ in range(ROUNDS + 1):
            with hybrid.open(tmp_path / "run.h5") as result:
                begin = time.perf_counter()
                files = hybrid.export(result, format=kind).files
                taken.append(time.perf_counter() - begin)
        size = sum(file.stat().st_size for file in files)
        print(f"| {kind} | {size / 1e6:.2f} | {median(taken[1:]):.3f} |")
        assert size <= most * whole, "no format holds more than the result does, but for the lines of VTKHDF"
