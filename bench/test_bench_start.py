"""How long a person waits: `import hybrid`, and from the command to the first step.

pytest bench -m bench -s
"""

import json
import os
import resource
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


EXAMPLES = SCENE.parent


def cost(folder, cache, *arguments):
    """Processor and wall time, s, of a command and of the processes it starts, from the shell to its end."""
    command = [str(Path(sys.executable).with_name("hybrid")), *arguments]
    env = os.environ | {"HYBRID_CACHE_DIR": str(cache), "PYTHONPYCACHEPREFIX": str(cache / "pyc")}
    env.pop("PYTHONDONTWRITEBYTECODE", None)  # installed packages are compiled to bytecode
    before, begin = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    subprocess.run(command, check=True, capture_output=True, env=env, cwd=folder)
    after, end = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime, end - begin


@pytest.mark.parametrize(
    "scenes",
    [
        (("02_suspension",), ("touchdown",), ("02_suspension", "--set", "dimension=3")),
        (("touchdown",), ("02_suspension",), ("07_forced_taut_cable",)),
    ],
    ids=["suspension first", "touchdown first"],
)
def test_from_an_empty_cache(scenes, tmp_path):
    """Each scene as a whole run, file written: the first compiles, the next what it needs more; then all again."""
    for when in ("cold", "warm"):
        for name, *settings in scenes:
            arguments = ["run", str(EXAMPLES / f"{name}.yaml"), *settings, "-q", "-o", str(tmp_path / "run.h5")]
            cpu, wall = cost(tmp_path, tmp_path / "cache", *arguments)
            print(
                f"{when} {name:22s} {' '.join(settings):18s} {cpu:5.1f} s of processor time, {wall:5.1f} s of wall time"
            )


# What a person waits for, and the processor time asked for, s; --plot: beyond the run without.
COMMANDS = {
    "--help": (("--help",), 0.2),
    "plan": (("plan", str(SCENE)), 0.5),
    "static": (("static", str(SCENE), "-o", "static.h5"), 0.7),
    "run": (("run", str(SCENE), "-o", "run.h5"), 0.9),
    "run --plot": (("run", str(SCENE), "-o", "run.h5", "--plot"), 0.6),
    "run touchdown": (("run", str(EXAMPLES / "touchdown.yaml"), "-o", "touchdown.h5"), 1.0),
}


def test_warm_commands(tmp_path):
    """Processor and wall time of each command, the lowest of five, with kernels and bytecode compiled."""
    least = {}
    for name, (arguments, asked) in COMMANDS.items():
        cost(tmp_path, tmp_path / "cache", *arguments)
        each = [cost(tmp_path, tmp_path / "cache", *arguments) for _ in range(5)]
        least[name], wall = (min(x) for x in zip(*each, strict=True))
        cpu = least[name] - (least["run"] if name == "run --plot" else 0.0)
        print(f"hybrid {name:14s} {cpu:5.2f} s of processor time (asked: {asked} s), {wall:.2f} s of wall time")


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
