"""Whether results are what they were: digests of more than sixty, to 1e-12, and what a step of each costs.

    pytest bench/test_bench_digests.py -m bench -n 0 -s
    HYBRID_DIGESTS=write pytest bench/test_bench_digests.py -m bench -n 0 -s

The second command renews `digests.json` beside this file: before work that must change no result.  Names of scenes whose
digest differs are printed with the quantity that differs most, as a part of its root mean square.  Digests of another
processor may differ by round-off that grows, as in a line that snaps: renew them there first.
"""

from __future__ import annotations

import json
import os
import time as clock
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from digest_scenes import EXAMPLES, at_rest, moving

import hybrid
from hybrid.errors import HybridError

pytestmark = pytest.mark.bench
KEPT = Path(__file__).with_name("digests.json")
WRITE = os.environ.get("HYBRID_DIGESTS") == "write"
SAME = 1e-12  # of the root mean square
LEAST_SCENES = 60
WEIGHTS = 3
# Sizes below which a quantity is held against these, not against its own: what Newton's method leaves of a velocity near
# rest is round-off of forces, 1e-14 m/s, and of another compilation another one.
# What a line that is not twisted has of torque is round-off of its bending moment.
SMALLEST = {
    "velocity": 0.05,
    "energy": 1e-9,
    "work": 100.0,
    "torque": 0.1,
    "twist": 1e-4,
}  # m/s or rad/s, J, J, N m, 1/m
# Clocks, and numbers that go by them.
CLOCKS = ("steps/cpu",)
Digest = dict[str, list[float]]


def digest(result: hybrid.Result) -> Digest:
    """Of each quantity its size, its root mean square and sums with weights that are the same in each run."""
    found = {}
    for name in sorted(result.names):
        values = np.asarray(result[name])
        if name in CLOCKS or values.dtype.kind not in "fiu" or not values.size:
            continue
        flat = np.nan_to_num(values.astype(float).ravel(), nan=0.0, posinf=1e300, neginf=-1e300)
        weights = np.random.default_rng(flat.size).uniform(-1.0, 1.0, (WEIGHTS, flat.size))
        rms = float(np.sqrt(np.mean(flat**2))) if np.abs(flat).max() < 1e150 else float(np.abs(flat).max())
        found[name] = [float(flat.size), rms, *(float(x) for x in weights @ flat / np.sqrt(flat.size))]
    return found


def difference(old: Digest, new: Digest) -> tuple[float, str]:
    """The largest difference, as a part of the root mean square, and of which quantity."""
    worst = (0.0, "")
    for name in old.keys() | new.keys():
        a, b = old.get(name), new.get(name)
        if a is None or b is None or a[0] != b[0]:
            return np.inf, f"{name}: {'missing' if b is None else 'new' if a is None else 'of another size'}"
        least = max((size for part, size in SMALLEST.items() if part in name), default=0.0)
        scale = max(abs(a[1]), abs(b[1]), least) or 1.0
        worst = max(worst, (float(np.abs(np.subtract(a[1:], b[1:])).max()) / scale, name))
    return worst


def computed(data: dict[str, Any], rest: bool) -> tuple[hybrid.Result, float]:
    """A result, and the processor time that it took, s."""
    begin = clock.process_time()
    result = hybrid.static(data) if rest else hybrid.run(data)
    return result, clock.process_time() - begin


def test_digests(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(EXAMPLES)  # files that scenes name
    kept = json.loads(KEPT.read_text(encoding="utf-8")) if KEPT.exists() and not WRITE else {}
    found: dict[str, Digest] = {}
    differ = []
    scenes = [(name, data, False) for name, data in moving().items()]
    scenes += [(name, data, True) for name, data in at_rest().items()]
    assert len(scenes) >= LEAST_SCENES
    print(f"\n{'scene':58}{'steps':>7}{'cells':>7}{'us a step':>11}{'CPU (s)':>9}  difference")
    for name, data, rest in scenes:
        try:
            computed(data, rest)[0].close()  # compiles
            result, cpu = computed(data, rest)
        except HybridError as error:
            raise AssertionError(f"{name}: {error}") from error
        with result:
            found[name] = digest(result)
            lines = list(result.lines.values()) or [result]
            steps = 0 if rest else len(lines[0]["steps/cpu"])
            cells = sum(int(np.asarray(x["mesh/s"]).size) - 1 for x in lines)
            loop = 0.0 if rest else 1e6 * float(lines[0]["steps/cpu"][-1]) / max(steps, 1)
        by, what = difference(kept[name], found[name]) if name in kept else (np.nan, "not kept")
        told = "same" if by <= SAME else f"{by:.1e} of {what}" if np.isfinite(by) else what
        print(f"{name:58}{steps:7}{cells:7}{loop:11.1f}{cpu:9.3f}  {told}", flush=True)
        differ += [] if by <= SAME else [name]
    if WRITE:
        rows = ",\n".join(f"{json.dumps(name)}: {json.dumps(found[name])}" for name in sorted(found))
        KEPT.write_text(f"{{\n{rows}\n}}\n", encoding="utf-8")
        return
    assert not differ, f"{len(differ)} of {len(scenes)} differ: {', '.join(differ)}"
