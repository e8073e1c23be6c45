"""The process of another program: `python -m peers.adapters FOLDER` runs the task in the folder."""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from hybrid.model.plan import output_times
from hybrid.scene.read import one_line, parse_scene
from peers.adapters import PEERS
from peers.adapters.interface import PeerFailed, PeerRun, line_of


@contextmanager
def silence() -> Iterator[None]:
    """Some of them report on the standard output, past Python's own."""
    sys.stdout.flush()
    kept = os.dup(1)
    with open(os.devnull, "w") as hole:
        os.dup2(hole.fileno(), 1)
    try:
        yield
    finally:
        os.dup2(kept, 1)
        os.close(kept)


def main(folder: Path) -> None:
    """Run it, and write values.npz and cost.json."""
    task = json.loads((folder / "task.json").read_text(encoding="utf-8"))
    scene, peer_run = parse_scene(task["scene"]), PeerRun(**task["run"])
    with silence():
        found = PEERS[peer_run.code].run(line_of(scene), peer_run, [0.0, *output_times(one_line(scene))])
    if not all(np.isfinite(x).all() for x in found.values.values()):
        raise PeerFailed("its result is not finite")
    np.savez(folder / "values.npz", **found.values)  # type: ignore[arg-type]
    (folder / "cost.json").write_text(json.dumps({"cpu": found.cpu, "steps": found.steps}), encoding="utf-8")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
