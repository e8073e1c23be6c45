"""How long a person waits: `import hybrid`, and from the command to the first step.

pytest bench -m bench -s
"""

import json
import os
import subprocess
import sys
import time
from pathlib import Path
from statistics import median

import pytest

pytestmark = pytest.mark.bench
SCENE = Path(__file__).parents[1] / "examples" / "02_suspension.yaml"


def wall(command, env=None):
    begin = time.perf_counter()
    subprocess.run(command, check=True, capture_output=True, env=env)
    return time.perf_counter() - begin


def test_import():
    bare = median(wall([sys.executable, "-c", "pass"]) for _ in range(7))
    whole = median(wall([sys.executable, "-c", "import hybrid"]) for _ in range(7))
    print(f"import hybrid: {whole - bare:.3f} s (python alone {bare:.3f} s)")
    assert whole - bare <= 0.4


def first_step(folder, cache):
    """Seconds from the command to the first step of the suspension."""
    command = [str(Path(sys.executable).with_name("hybrid")), "run", str(SCENE), "-o", str(folder / "run.h5"), "--json"]
    env = os.environ | {"HYBRID_CACHE_DIR": str(cache)}
    begin = time.perf_counter()
    waited = None
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=env) as process:
        assert process.stdout is not None
        for line in process.stdout:
            if json.loads(line)["event"] in ("progress", "done") and waited is None:
                waited = time.perf_counter() - begin
    assert process.returncode == 0
    assert waited is not None
    return waited


def test_command_to_first_step(tmp_path):
    cold = first_step(tmp_path, tmp_path / "cache")
    warm = median(first_step(tmp_path, tmp_path / "cache") for _ in range(5))
    print(f"command to first step: {cold:.1f} s with an empty cache, {warm:.2f} s with a warm one")
    assert cold <= 25.0
    assert warm <= 1.5
