"""A result in memory holds the same, under the same names, as one that is written into a file."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

import hybrid
from hybrid.store.format import ArrayContents, Field, Header, MemoryTarget
from hybrid.store.reader import Result, written_result
from hybrid.store.writer import Recorder
from tests.said import assert_same_results
from tests.scenes import line_between, network_scene

EXAMPLES = Path(__file__).parents[2] / "examples"
Pair = tuple[Result, Result]


@pytest.fixture(scope="module", params=["motion", "at rest"])
def pair(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Pair]:
    scene = hybrid.load_scene(EXAMPLES / "touchdown.yaml", ["time.duration=1", "output.errors=false"])
    path = tmp_path_factory.mktemp("pair") / "x.h5"
    compute = hybrid.run if request.param == "motion" else hybrid.static
    compute(scene, path).close()
    with compute(scene) as memory, hybrid.open(path) as file:
        yield memory, file


def test_they_are_the_same(pair: Pair) -> None:
    assert isinstance(pair[0]._contents, ArrayContents)
    assert_same_results(*pair)


def test_closed_it_keeps_what_was_read_and_nothing_else() -> None:
    text = hybrid.load_scene(EXAMPLES / "touchdown.yaml", ["output.errors=false"])
    result = hybrid.static(text)
    tension = result.tension
    result.close()
    assert result.tension is tension
    with pytest.raises(hybrid.ResultError, match="was not read before the result was closed"):
        result.position  # noqa: B018
    with pytest.raises(hybrid.ResultError, match="closed"):
        result.label("tension")


def _recorder(target: MemoryTarget) -> Recorder:
    fields, fixed = [Field("x", "m", "a place", (2,), ("s",))], [(Field("k", "", "a number"), np.array(2.0))]
    return Recorder(target, Header(np.array([0.0, 1.0]), fields, (), {"title": "t"}, {"scene": "a: 1"}, fixed))


def test_a_run_that_fails_says_so() -> None:
    target = MemoryTarget()
    with pytest.raises(ValueError, match="why"), _recorder(target) as recorder:
        recorder.save(0.0, {"x": np.zeros(2)}, [("rod", 0.0, 1.0)])
        raise ValueError("why")
    result = written_result(target)
    assert (result.status, result.message, result.x.shape) == ("failed", "why", (1, 2))


def test_what_cannot_be_kept_is_refused() -> None:
    recorder = _recorder(MemoryTarget())
    with pytest.raises(hybrid.ResultError, match="not finite"):
        recorder.save(0.0, {"x": np.array([0.0, np.nan])}, [("rod", 0.0, 1.0)])
    with pytest.raises(hybrid.ResultError, match="k has shape"):
        recorder.replace({"k": np.zeros(3)})
    with pytest.raises(hybrid.ResultError, match="increasing"):
        Recorder(MemoryTarget(), Header(np.array([1.0, 0.0]), (), (), {}))
    with pytest.raises(hybrid.ResultError, match="written by the recorder itself"):
        Recorder(MemoryTarget(), Header(np.array([0.0, 1.0]), (), (), {"status": "x"}))


# A result of several lines in memory: the same numbers as in a file, each line closed by itself.


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
    for name in written.lines:
        assert_same_results(result.lines[name], written.lines[name])
    for name in written.names:
        assert np.array_equal(result[name], written[name]) and result.dims(name) == written.dims(name)
    with result.line("west") as line:
        tension = line.tension
    with result.line("west") as again:
        assert np.array_equal(again.tension, tension), "a line that was closed can be opened again"
    written.close()
