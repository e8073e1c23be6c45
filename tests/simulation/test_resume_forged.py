"""Forged checkpoints: refused with file and remedy, or resumed; none crashes the process, runs code or fills memory.

    pytest tests/simulation/test_resume_forged.py -s -m "slow or not slow"

The forgeries are those of forge.py, a process of its own.
"""

from __future__ import annotations

import gzip
import json
import os
import subprocess
import sys
from collections import Counter
from pathlib import Path

import pytest
from bits import Stopping
from forge import CONTAINERS

import hybrid

FORGE = Path(__file__).with_name("forge.py")
KEPT = Path(__file__).parents[1] / "data" / "result_0.6.h5.gz"
EXAMPLES = Path(__file__).parents[2] / "examples"


def forgeries(good: Path, first: int, last: int) -> Counter[str]:
    """What came of forgeries of a file; the test fails at the first that ends the process, or in other words."""
    asked = [sys.executable, str(FORGE), str(good), str(good.parent), str(first), str(last)]
    env = {"PYTHONPATH": f"{Path(hybrid.__file__).parents[1]}:{FORGE.parent}"}
    done = subprocess.run(asked, capture_output=True, text=True, env=os.environ | env)
    told = [json.loads(line) for line in done.stdout.splitlines()]
    assert done.returncode == 0, f"number {first + len(told)} ends the process: {done.stderr[-2000:]}"
    assert [x["number"] for x in told] == list(range(first, last))
    faults = [f"{x['number']}: {x['text']}" for x in told if x["kind"] == "fault"]
    assert not faults, "\n".join(faults[:20])
    count = Counter(x["kind"] for x in told)
    print(f"\n{last - first} forgeries: " + ", ".join(f"{n} {kind}" for kind, n in count.most_common()))
    return count


@pytest.fixture
def good(tmp_path: Path) -> Path:
    """A file of 0.6.0 that was stopped half-way: fixed zones, in space."""
    (tmp_path / "good.h5").write_bytes(gzip.decompress(KEPT.read_bytes()))
    return tmp_path / "good.h5"


@pytest.mark.long
def test_a_checkpoint_in_another_container_is_refused(good: Path) -> None:
    """Other types and shapes, lengths that nothing holds, links, other files, bombs; see CONTAINERS in forge.py."""
    assert forgeries(good, 0, len(CONTAINERS)) == {"refused": len(CONTAINERS)}


@pytest.mark.long
def test_a_checkpoint_of_other_content_is_refused_or_resumed(good: Path) -> None:
    """Types, shapes, sizes, numbers that are not finite, missing and surplus names, versions, bits: 60 drawn."""
    count = forgeries(good, 1000, 1060)
    assert count["refused"] > 40 and count["resumed"] > 2


@pytest.mark.bench  # 6 minutes
def test_many_checkpoints_of_other_content(good: Path) -> None:
    """3000 that are drawn as the 60 above."""
    count = forgeries(good, 2000, 5000)
    assert count["refused"] > 2000 and count["resumed"] > 100


@pytest.mark.parametrize(
    "many",
    [pytest.param(60, marks=pytest.mark.slow), pytest.param(600, marks=pytest.mark.bench)],  # 3 minutes each
)
@pytest.mark.parametrize("name", ["laying", "touchdown"])
def test_checkpoints_of_adaptive_runs(name: str, many: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Moving zones, friction, the energy balance of a plane: more that can be forged."""
    more = ["mesh.cells=20", "output={every: 1, points: 7, errors: false}", "time={duration: 4, step: 0.1}"]
    stopping = Stopping(monkeypatch)
    stopping.left = 25
    with pytest.raises(KeyboardInterrupt):
        hybrid.run(hybrid.load_scene(EXAMPLES / f"{name}.yaml", more), tmp_path / "good.h5", progress=stopping)
    count = forgeries(tmp_path / "good.h5", 5000, 5000 + many)
    assert count["refused"] > 2 * many // 3
