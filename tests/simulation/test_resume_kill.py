"""kill -9 at random moments: the file opens, and goes on bit for bit."""

import random
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path

import pytest
from bits import differences, machine_code

import hybrid
from hybrid.store.checkpoint import read_checkpoint
from hybrid.store.hdf5_file import opened

EXAMPLES = Path(__file__).parents[2] / "examples"
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


@pytest.mark.slow
@pytest.mark.parametrize("name", SCENES)
def test_some_kills(name, tmp_path):
    went = kills(name, 2, tmp_path, 1)
    assert went["opened"] == went["killed"] - went["before there was a file"]
    assert went["steps times cells recomputed"] <= 2 * WORK


@pytest.mark.bench
@pytest.mark.parametrize("name", SCENES)
def test_a_hundred_kills(name, tmp_path):
    went = kills(name, 34, tmp_path, 2)
    print(f"\n{name}: " + ", ".join(f"{text} {number}" for text, number in went.items()))
    assert went["opened"] == went["killed"] - went["before there was a file"]
    assert went["steps times cells recomputed"] <= 2 * WORK
