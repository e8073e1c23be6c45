"""The door to a computation: what may be given as a scene, and what a failed run leaves."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import hybrid
from hybrid.kernels.machine.kept_code import KeptCode
from hybrid.kernels.reel import payout, payout_nodes
from hybrid.scene.read import as_scene
from hybrid.simulation import first_use
from hybrid.simulation.progress import Progress
from tests.inside import calls_of
from tests.scenes import cable_scene, pinned_at

WIRE = cable_scene(
    {"length": 2.0, "mass": 1.0}, pinned_at(0, 0, 0), {"kind": "free", "force": [0, 0, -20]}, model="catenary", mesh=4,
    time=(0.1, 0.05)
)  # fmt: skip
# Let go and pushed upwards: it goes into compression.
PUSHED = WIRE | {
    "ends": {"start": {"kind": "pinned", "position": [0, 0, 0]}, "end": {"kind": "free", "force": [0, 0, 400.0]}},
    "initial": {"kind": "straight", "direction": [0, 0, -1]},
}


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "wire.yaml"
    path.write_text(hybrid.scene_text(hybrid.validate_scene(WIRE)))
    return path


def test_a_scene_is_a_scene_a_path_or_a_dict(file: Path) -> None:
    scene = hybrid.load_scene(file)
    want = hybrid.run(scene)
    for given in (file, str(file), WIRE):
        with hybrid.run(given) as result:
            np.testing.assert_array_equal(result.position, want.position)
        with hybrid.static(given) as rest:
            np.testing.assert_array_equal(rest.position[0], want.position[0])
        assert hybrid.plan(given, measure=False) == hybrid.plan(scene, measure=False)


@pytest.mark.parametrize("given", [None, 3, ["wire.yaml"], b"wire.yaml"])
def test_anything_else_is_refused_with_what_is_expected(given: Any, tmp_path: Path) -> None:
    for call in (hybrid.run, hybrid.static, hybrid.plan, lambda x: hybrid.trade(x, tmp_path / "trade")):
        with pytest.raises(TypeError, match=r"path.*dict") as refused:
            call(given)
        assert type(given).__name__ in str(refused.value)


def test_results_are_taken_as_a_user_may_give_them(file: Path, tmp_path: Path) -> None:
    with hybrid.run(file) as result:
        with pytest.raises(TypeError, match=r"path of a result file, found Result"):
            hybrid.resume(result)  # type: ignore[arg-type]
        with pytest.raises(hybrid.ResultError, match="above: expected a number in the unit of 'tension', found 'a'"):
            result.exceedance("tension", "a")
        named = hybrid.export(result, tmp_path / "a.csv", names="tension").files[0].read_text()
        assert named == hybrid.export(result, tmp_path / "b.csv", names=["tension"]).files[0].read_text()
        page = hybrid.compare([result, result], tmp_path / "both.html").read_text()
        assert "1: in memory" in page and "2: in memory" in page


def test_a_bad_dict_is_refused_like_a_bad_file() -> None:
    with pytest.raises(hybrid.SceneError, match="model"):
        hybrid.run(WIRE | {"model": "string"})


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="has no such pipes")
def test_a_pipe_or_device_is_not_replaced(tmp_path: Path, file: Path) -> None:
    hybrid.run(file, tmp_path / "run.h5")
    os.mkfifo(tmp_path / "pipe")
    for call in (hybrid.run, hybrid.static, lambda _, to: hybrid.resume(tmp_path / "run.h5", to, until=0.2)):
        with pytest.raises(hybrid.ResultError, match="no regular file"):
            call(file, tmp_path / "pipe")
    assert (tmp_path / "pipe").is_fifo()


# --- snapshots -----------------------------------------------------------------------------------


def failed(output: Path | None) -> Path:
    """The snapshot of a run that fails."""
    with pytest.raises(hybrid.ComputationError) as stopped:
        hybrid.run(PUSHED, output)
    assert stopped.value.snapshot is not None and str(stopped.value.snapshot) in str(stopped.value)
    return stopped.value.snapshot


def test_a_snapshot_replaces_a_link_and_does_not_follow_it(tmp_path: Path) -> None:
    victim = tmp_path / "victim.txt"
    victim.write_text("precious")
    link = tmp_path / "run.snapshot.npz"
    link.symlink_to(victim)
    assert failed(tmp_path / "run.h5").resolve() == link.resolve() and not link.is_symlink()
    assert victim.read_text() == "precious"
    with np.load(link) as snapshot:
        assert snapshot["outcome"] == "SLACK" and snapshot["r"].shape == (5, 3)


def test_snapshots_of_runs_in_memory_have_names_of_their_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    one, other = failed(None), failed(None)
    assert one != other and one.parent == other.parent == tmp_path
    assert os.stat(one).st_mode & 0o077 == 0, "nobody else reads it"
    with np.load(one) as snapshot:
        assert float(snapshot["t"]) >= 0.0


# --- signals -------------------------------------------------------------------------------------


class Late:
    """A listener that raises a signal when the run has ended, before its handlers are back."""

    def __init__(self, number: signal.Signals) -> None:
        self.number = number

    def __call__(self, _: Progress) -> None:
        pass

    def close(self) -> None:
        signal.raise_signal(self.number)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize("scene", [WIRE, PUSHED], ids=["complete", "failed"])
def test_a_signal_at_the_very_end_of_a_run_is_not_lost(
    scene: dict[str, Any], number: signal.Signals, tmp_path: Path
) -> None:
    before = signal.signal(number, signal.default_int_handler)
    try:
        with pytest.raises(KeyboardInterrupt):
            hybrid.run(scene, tmp_path / "run.h5", progress=Late(number))
        assert signal.getsignal(number) is signal.default_int_handler
    finally:
        signal.signal(number, before)
    with hybrid.open(tmp_path / "run.h5") as result:
        assert result.status == ("complete" if scene is WIRE else "failed")


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_that_has_stopped_a_run_is_raised_once(number: signal.Signals, tmp_path: Path) -> None:
    heard: list[int] = []
    before = signal.signal(number, lambda got, _frame: heard.append(got))
    try:
        with pytest.raises(KeyboardInterrupt):
            hybrid.run(WIRE, tmp_path / "run.h5", progress=lambda _: signal.raise_signal(number))
    finally:
        signal.signal(number, before)
    with hybrid.open(tmp_path / "run.h5") as result:
        assert result.status == "interrupted" and not heard


def test_a_second_signal_ends_a_run_at_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As in an equilibrium that takes long, where no step looks at the first."""
    monkeypatch.setattr("hybrid.simulation.progress.IMPATIENT", 0.0)
    reached: list[str] = []

    def search(*_: object, **__: object) -> None:
        for name in ("first", "second", "third"):
            reached.append(name)
            signal.raise_signal(signal.SIGINT)

    monkeypatch.setattr("hybrid.simulation.case.Case._first_state", search)
    with pytest.raises(KeyboardInterrupt):
        hybrid.run(WIRE, tmp_path / "run.h5")
    assert reached == ["first", "second"]


def test_a_run_that_is_ended_before_it_has_a_solver_leaves_a_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As by a second signal while kernels are compiled."""

    def compiled(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("hybrid.simulation.run.Run.make_solver", compiled)
    with pytest.raises(KeyboardInterrupt):
        hybrid.run(WIRE, tmp_path / "run.h5")
    with hybrid.open(tmp_path / "run.h5") as result:
        assert result.status == "interrupted" and len(result.times) == 0


# --- The process that compiles beside the first run ---


@pytest.mark.parametrize("name", ["hybrid", "numpy", "signal"])
def test_files_of_the_present_folder_are_not_run(name: str, tmp_path: Path) -> None:
    """A user's numpy.py beside the scene is no module of the second process."""
    (tmp_path / f"{name}.py").write_text("open('run', 'w').close()\nraise SystemExit(3)\n")
    done = subprocess.run(first_use.command_to_compile([]), cwd=tmp_path, capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "") and not (tmp_path / "run").exists()


@pytest.mark.parametrize("frozen", [False, True])
def test_a_frozen_application_does_not_start_itself(frozen: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    started: list[Any] = []

    class Started:
        def __init__(self, **arguments: Any) -> None:
            started.append(arguments)

        def start(self) -> None:
            pass

    monkeypatch.setattr(sys, "frozen", frozen, raising=False)
    monkeypatch.setattr(first_use, "is_ready", lambda _: False)
    monkeypatch.setattr("os.cpu_count", lambda: 2)
    monkeypatch.setattr(first_use, "Thread", Started)
    first_use.compile_beside(hybrid.validate_scene(first_use.SAMPLE))
    assert len(started) == (not frozen)


def test_kernels_of_a_line_that_is_paid_out_are_compiled_beside() -> None:
    """All entries that take a table, of which none is forgotten, but for what joined lines, zones and a release ask for."""
    others = {"end_payout", "iterate_with_others", "carry_zones"}
    entry = type(payout_nodes.plan_node)
    used = {
        x.__qualname__
        for module in (payout, payout_nodes)
        for x in vars(module).values()
        if isinstance(x, entry) and list(x.py_func.__code__.co_varnames[: x.py_func.__code__.co_argcount]) == ["table"]
    }
    assert used - others <= {x.__qualname__ for x in first_use.payout_kernels()}
    given = cable_scene(
        {"length": 40.0, "mass": 2.0, "bending_stiffness": 1.0}, {"kind": "free"},
        pinned_at(0, 0, 0, payout={"longest": 60}), model="catenary", mesh=20, time=(10, 0.05)
    )  # fmt: skip
    scene, moves = hybrid.validate_scene(given), hybrid.validate_scene(given | {"model": "adaptive"})
    paid, zones = first_use.PAYOUT_OF_LINES[0], first_use.PAID_ZONES
    assert paid in first_use.kernels_of(scene) and zones not in first_use.kernels_of(scene)
    assert zones in first_use.kernels_of(moves)
    assert paid not in first_use.kernels_of(scene, static=True)


ROPE = {"length": 12, "mass": 2.0, "diameter": 0.02, "axial_stiffness": 1e5}
WIRE_FIRST = ROPE | {"bending_stiffness": 5.0}
POINTS = {"a": {"position": [0, 0, 0]}, "b": {"position": [10, 0, 0]}, "c": {"position": [10, 5, 0]}}
TIME = {"time": {"duration": 0.1, "step": 0.05}}


def one(section: dict[str, Any], model: str, **more: Any) -> dict[str, Any]:
    ends = (pinned_at(*POINTS[at]["position"]) for at in "ab")
    return cable_scene(section, *ends, model=model, mesh=12, contact={"self": False}) | TIME | more


def named(section: dict[str, Any], model: str, **more: Any) -> dict[str, Any]:
    """The same line with a name."""
    line = {"sections": [section], "model": model, "mesh": {"cells": 12}, "start": "a", "end": "b"}
    line |= {key: more.pop(key) for key in [*more] if key == "contact"}
    return {"points": {x: POINTS[x] for x in "ab"}, "lines": {"one": {"contact": {"self": False}} | line}} | TIME | more


def two(section: dict[str, Any] = ROPE, line: dict[str, Any] | None = None, **more: Any) -> dict[str, Any]:
    lines = {x: {"sections": [section], "mesh": {"cells": 12}, "start": "a", "end": x} for x in "bc"}
    lines["b"] |= line or {}
    return {"points": POINTS, "lines": lines} | TIME | more


WINCH = {"connections": {"end": {"payout": {"rate": 0.1, "ramp": 0.1}}}}
ALONE: dict[str, tuple[dict[str, Any], str, dict[str, Any]]] = {
    "catenary": (ROPE, "catenary", {}),
    "rod in a plane": (WIRE_FIRST, "rod", {}),
    "rod in space": (WIRE_FIRST, "rod", {"dimension": 3}),
    "zones that move": (WIRE_FIRST, "adaptive", {}),
    "error of bending": (WIRE_FIRST, "catenary", {"output": {"errors": True}}),
    "contact with itself": (WIRE_FIRST, "rod", {"contact": {"self": True}}),
    "on a floor": (
        WIRE_FIRST,
        "rod",
        {"obstacles": {"floor": {"kind": "plane", "at": [0, 0, -1], "normal": [0, 0, 1]}}},
    ),
}
KINDS = {
    **{name: one(section, model, **more) for name, (section, model, more) in ALONE.items()},
    **{f"{name}, with a name": named(section, model, **more) for name, (section, model, more) in ALONE.items()},
    "two lines": two(),
    "two lines that touch": two(contact={"friction": 0.2}),
    "two lines whose zones move": two(WIRE_FIRST, {"model": "adaptive"}),
    "two lines and a winch": two(line=WINCH),
}


@pytest.mark.parametrize("static", [True, False])
@pytest.mark.parametrize("kind", KINDS)
def test_what_a_scene_calls_is_known_beforehand(kind: str, static: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of the kernels that take long to compile: else a machine would be said to be ready while they compile."""
    called = calls_of(monkeypatch, KeptCode, "taking", lambda code, _: code._name)
    scene = as_scene(KINDS[kind])
    known = first_use.kernels_of(scene, static)
    hybrid.static(scene) if static else hybrid.run(scene)
    texts = [x for value in vars(first_use).values() for x in (value if isinstance(value, tuple) else (value,))]
    large = {x for x in texts if isinstance(x, str) and x.count(".") == 2}
    assert {"run.newton.in_space", "run.network.begin_line"} < large
    before = {first_use.ZONES: first_use.CRITERIA, first_use.STEPS_OF_LINES: first_use.REST_OF_LINES}
    stood_for = {before[name] for name in known if name in before}  # compiled before those, by the same calls
    if "zones" in kind:
        stood_for.add(first_use.STABILITY)  # zones may come out without a rod: nobody knows before
    assert not ({*called} & large) - set(known) - stood_for


@pytest.mark.long
def test_an_equilibrium_in_a_plane_asks_for_no_solver_in_space() -> None:
    """Whose compilation takes longest; in a process of its own, where nothing is compiled or loaded yet."""
    code = "import hybrid, json, sys; from hybrid.kernels.run import newton; hybrid.static(json.loads(sys.argv[1])); "
    code += "print(len(newton.in_plane.signatures), len(newton.in_space.signatures))"
    done = subprocess.run(
        [sys.executable, "-c", code, json.dumps(KINDS["rod in a plane"])], capture_output=True, text=True, check=True
    )
    assert done.stdout.split() == ["1", "0"]


@pytest.mark.parametrize("kind", [x for x in KINDS if x.startswith(("rod in", "zones that move"))])
def test_a_line_that_is_joined_to_nothing_asks_for_no_solver_of_joined_ones(
    kind: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Nor one in a plane for that in space: together they take longer to compile than all else."""
    called = calls_of(monkeypatch, KeptCode, "taking", lambda code, _: code._name)
    hybrid.run(KINDS[kind])
    assert not {*called} & {"run.newton.solve_network", "junctions.junctions.join_lines"}
    assert ("run.newton.in_space" in called) == kind.startswith("rod in space")
