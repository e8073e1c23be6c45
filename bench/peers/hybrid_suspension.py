"""The suspension in this code, as the peers are asked."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

import hybrid
from peers import suspension

OURS = (
    (hybrid.run, ["mesh.cells=120", "time.step=0.1"]),
    (hybrid.run, ["mesh.cells=120", "time.step=0.1", "output.errors=true"]),
    (hybrid.run, ["accuracy={position: 0.3 mm}"]),
    (hybrid.static, ["mesh.cells=120", "output.errors=true"]),
)


def run(path: Path, command: Callable[..., hybrid.Result], sets: list[str]) -> tuple[float, float]:
    """CPU time (s) of a whole run, and the largest distance (m) to the truth at its end."""
    begin = time.process_time()
    result = command(hybrid.load_scene(suspension.SCENE, sets), path)
    spent = time.process_time() - begin
    s, r = np.asarray(result.s), np.asarray(result.position[-1])
    result.close()
    path.unlink()
    return spent, suspension.distance(s, r[:, 0], r[:, 2])
