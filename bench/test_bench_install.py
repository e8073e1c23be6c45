"""From a wheel to the first picture, in an empty environment with an empty cache of kernels: wall and CPU time (s).

`python release/build_wheel.py --few`, then `pytest bench/test_bench_install.py -m bench -n 0 -s`.  HYBRID_WHEEL names the
wheel, else it is the one in dist/.  Packages come from where pip takes them: the time of pip is that of the network and
the disk as well.  Of all that, hybrid's are its wheel and a run in which the packages that it needs are there, with their
byte code, and its own is not: the wheel is installed anew before it.
"""

from __future__ import annotations

import os
import resource
import subprocess
import sys
import time
from pathlib import Path

import pytest

from hybrid.kernels.machine.cache import SUFFIX

pytestmark = pytest.mark.bench

ROOT = Path(__file__).resolve().parents[1]
SCENE = ROOT / "examples" / "02_suspension.yaml"


def spent(command: list[str | Path], folder: Path) -> tuple[float, float]:
    """Wall and CPU time (s) of a command and the processes that it starts, in a folder that has the cache of kernels."""
    environment = {k: v for k, v in os.environ.items() if not k.startswith(("PYTHON", "HYBRID"))}
    environment |= {"HYBRID_CACHE_DIR": str(folder / "cache"), "OMP_NUM_THREADS": "1"}
    begin, before = time.perf_counter(), resource.getrusage(resource.RUSAGE_CHILDREN)
    done = subprocess.run([*map(str, command)], cwd=folder, env=environment, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    cpu = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return time.perf_counter() - begin, cpu


def test_from_the_wheel_to_the_first_picture(tmp_path: Path) -> None:
    tag = f"cp{sys.version_info[0]}{sys.version_info[1]}"
    found = (
        [Path(os.environ["HYBRID_WHEEL"])]
        if "HYBRID_WHEEL" in os.environ
        else sorted((ROOT / "dist").glob(f"*-{tag}-*.whl"))
    )
    if not found:
        pytest.skip("no wheel: python release/build_wheel.py --few")
    here = tmp_path / "environment"
    pip, program = here / "bin" / "pip", here / "bin" / "hybrid"
    picture = ["run", SCENE, "--plot"]
    install = [pip, "install", "-q", "--disable-pip-version-check", "--no-compile"]
    print(f"\n{found[-1].name}")

    def show(name: str, command: list[str | Path]) -> float:
        wall, cpu = spent(command, tmp_path)
        print(f"{name:44s} {wall:6.1f} s of wall time, {cpu:6.1f} s of CPU time")
        return wall

    total = show("python -m venv", [sys.executable, "-m", "venv", here])
    total += show("pip install of the wheel", [*install, found[-1]])
    total += show("hybrid run --plot, the first time", [program, *picture])
    print(f"{'from nothing to the first picture':44s} {total:6.1f} s of wall time")
    show("hybrid run --plot, again", [program, *picture])
    own = show("pip install of the wheel alone", [*install, "--no-deps", "--force-reinstall", found[-1]])
    own += show("hybrid run --plot, byte code of others there", [program, *picture])
    print(f"{'of which hybrid':44s} {own:6.1f} s of wall time")
    assert (tmp_path / "02_suspension.png").stat().st_size > 10_000
    assert not list((tmp_path / "cache").rglob(f"*{SUFFIX}")), "something was compiled"
