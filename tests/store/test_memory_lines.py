"""A result of several lines in memory: the same numbers as in a file, each line closed by itself."""

from __future__ import annotations

from pathlib import Path

import numpy as np

import hybrid
from hybrid.store.format import MemoryTarget
from tests.scenes import line_between, network_scene

ROPE = {"length": 60, "mass": 4, "diameter": 0.04, "axial_stiffness": 1e7}
SCENE = network_scene(
    {"west": {"position": [-40, 0, -50]}, "east": {"position": [40, 0, -50]},
     "float": {"initial_guess": [0, 0, -10], "mass": 200, "volume": 1.0}},
    {name: line_between(name, "float", ROPE, mesh=8) for name in ("west", "east")}, title="A float on two legs",
    fluid={"density": 1025}
)  # fmt: skip


def test_arrays_equal_those_of_a_file(tmp_path: Path) -> None:
    result, written = hybrid.static(SCENE), hybrid.static(SCENE, tmp_path / "legs.h5")
    assert isinstance(result._source, MemoryTarget), "no file is made in memory"
    assert result.names == written.names and tuple(result.lines) == ("west", "east") == tuple(written.lines)
    both = [(result, written), *((result.lines[x], written.lines[x]) for x in written.lines)]
    for ours, theirs in both:
        assert ours.names == theirs.names and ours.scene_text == theirs.scene_text
        for name in theirs.names:
            assert np.array_equal(ours[name], theirs[name], equal_nan=theirs[name].dtype.kind == "f"), name
            assert ours.dims(name) == theirs.dims(name) and ours.label(name) == theirs.label(name)
    with result.line("west") as line:
        tension = line.tension
    with result.line("west") as again:
        assert np.array_equal(again.tension, tension), "a line that was closed can be opened again"
    written.close()
