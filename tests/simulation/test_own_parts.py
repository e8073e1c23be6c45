"""Parts of a run that a user writes: they stop winches and runs, and are kept in checkpoints."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bits import Stopping, differences, went_on

import hybrid
from hybrid.errors import Outcome
from hybrid.kernels.state.books import ASK_STEPS
from hybrid.scene.root import in_full
from hybrid.simulation.run import new_run
from hybrid.simulation.run_record import Recording
from hybrid.store.format import MemoryTarget
from tests.said import of_kind
from tests.scenes import cable_scene, each_line, line_between, network_scene, pinned_at

LIMIT, OVER = 450.0, 2.0  # N, s

WINCH = {"winch": {"tension": 200.0, "inertia": 50, "damping": 200, "begin": 1, "ramp": 2}}


class Guard(hybrid.RunPart):
    """Stops the winch of a line when its tension passes a limit."""

    name = "guard"

    def __init__(self, limit: float = LIMIT, line: str = "") -> None:
        self.limit, self.line = limit, line  # N
        self.stopped: float | None = None  # s

    def after_step(self, run: hybrid.RunView) -> None:
        most = run.tension(self.line).max()
        if self.stopped is None and most > self.limit:
            run.stop_winch(self.line, over=OVER)
            run.note(f"winch stopped at {most:.6g} N, above {self.limit:g} N", self.line, most)
            self.stopped = run.t


class At(hybrid.RunPart):
    """Stops the winch of a line within half a second of a time, s."""

    name = "at"

    def __init__(self, at: float, line: str) -> None:
        self.at, self.line, self.done = at, line, False

    def after_step(self, run: hybrid.RunView) -> None:
        if run.t > self.at + 0.01 and not self.done:
            assert run.payout_rate(self.line) == pytest.approx(1.0)
            run.stop_winch(self.line, over=0.5)
            self.done = True


def hanging(payout: dict[str, Any] | None = None, **tables: Any) -> dict[str, Any]:
    """20 m of rod that hang from a winch, which pays out 1 m/s after 2 s unless it is told otherwise."""
    section = {"length": 20, "mass": 2, "axial_stiffness": 1e6, "bending_stiffness": 1}
    payout = {"longest": 40} | ({"rate": 1.0, "ramp": 2.0} if payout is None else payout)
    return cable_scene(
        section, "free", pinned_at(0, 0, 0, payout=payout), model="rod", mesh=20, time=(8, 0.02), output=0.1
    ) | tables  # fmt: skip


def out(result: hybrid.Result) -> np.ndarray:
    """Lengths (nt,) that are out, m."""
    return np.asarray(result["payout/length"])


def test_a_winch_stops_smoothly_when_a_tension_passes_a_limit() -> None:
    """After L + c T/2, with the rate c of the moment, and a rate (1 - 3 x^2 + 2 x^3) c on the way."""
    guard = Guard()
    result = hybrid.run(hanging(), parts=[guard])
    (event,) = of_kind(result, "part guard")
    assert guard.stopped is None, "a run has a copy"
    assert event.value > LIMIT and abs(event.value / LIMIT - 1) < 0.05
    x = np.clip((result.times - event.t) / OVER, 0, 1)
    there = 21 + np.minimum(result.times, event.t) - 2 + OVER * (x - x**3 + 0.5 * x**4)
    assert out(result)[20:] == pytest.approx(there[20:], abs=1e-9)


@pytest.mark.parametrize(
    ("payout", "time"),
    [(None, {}), (WINCH, {}), (None, {"tolerance": 1e-3})],
    ids=["rate", "tension", "steps that follow the motion"],
)
@pytest.mark.long
def test_it_goes_on_from_a_checkpoint_to_the_bit(
    payout: Any, time: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Before it stops, while it does and after."""
    stopping = Stopping(monkeypatch)
    limit = LIMIT if payout is None else 410.0
    scene = hybrid.validate_scene(hanging(payout, time={"duration": 8, "step": 0.02} | time))
    whole = hybrid.run(scene, tmp_path / "whole.h5", parts=[Guard(limit)])
    (event,) = of_kind(whole, "part guard")
    assert event.t < 6.0 and np.ptp(out(whole)[whole.times > event.t + OVER]) < 1e-12
    steps = whole["steps/t"]
    at = [int(np.searchsorted(steps, t)) for t in (0.0, event.t - 0.3, event.t + 0.5, event.t + 2.5)]
    stops = went_on(scene, tmp_path / "part.h5", stopping, [*np.diff(at)], parts=[Guard(limit)])
    assert stops == 3
    assert not (apart := differences(tmp_path / "whole.h5", tmp_path / "part.h5")), apart


@pytest.mark.parametrize("clamp", [{}, {"kind": "clamped", "tangent": [0, 0, -1]}], ids=["pinned", "clamped"])
def test_a_winch_that_holds_a_tension_at_the_start_stops(clamp: dict[str, Any], tmp_path: Path) -> None:
    """Nodes that leave after that find no room for another right-hand side, which is asked for no more."""
    scene = hanging(WINCH, time={"duration": 8, "step": 0.02})
    scene["ends"] = {"start": scene["ends"]["end"] | clamp, "end": {"kind": "free"}}
    whole = hybrid.run(scene, tmp_path / "whole.h5", parts=[Guard(410.0)])
    (event,) = of_kind(whole, "part guard")
    assert event.t < 5.0 and np.ptp(out(whole)) > 2.0 and np.ptp(out(whole)[whole.times > event.t + OVER]) < 1e-12
    hybrid.run(scene | {"time": {"duration": 6, "step": 0.02}}, tmp_path / "part.h5", parts=[Guard(410.0)]).close()
    hybrid.resume(tmp_path / "part.h5", until=8.0, parts=[Guard(410.0)]).close()
    apart = differences(tmp_path / "whole.h5", tmp_path / "part.h5")
    assert not [x for x in apart if not x.endswith(": scene")], apart


@pytest.mark.long
def test_a_simulation_stops_and_goes_back_as_the_run() -> None:
    scene = hanging(time={"duration": 7, "step": 0.02})
    whole = hybrid.run(scene, parts=[Guard()])
    with hybrid.Simulation(scene | {"dimension": 2}, parts=[Guard()]) as steps:
        steps.advance(4.0)
        kept = steps.save()
        steps.advance(6.5)
        steps.restore(kept)
        while steps.t < 7:
            steps.step()
    stepped = steps.result()
    assert [x.t for x in of_kind(stepped, "part guard")] == pytest.approx(
        [x.t for x in of_kind(whole, "part guard")], abs=1e-9
    )
    assert out(stepped)[-1] == pytest.approx(out(whole)[-1], abs=1e-6)


def test_what_is_set_from_outside_stops_too_and_stays() -> None:
    with hybrid.Simulation(hanging({}), parts=[Guard(400.0)]) as steps:
        steps.set_payout(1.0)
        steps.advance(5.0)
        begin = steps.t
        with pytest.raises(ValueError, match="stopped by a part of the run"):
            steps.set_payout(1.0)
        steps.advance(begin + OVER)
        length = steps.length
        steps.advance(begin + OVER + 1.0)
        assert steps.length == length < 24


@pytest.mark.long
def test_a_winch_of_one_of_two_lines_with_zones_that_move_stops() -> None:
    """It is known by the name of the line."""
    part = {"mass": 2, "axial_stiffness": 1e6, "bending_stiffness": 1}
    up = {"payout": {"rate": 1.0, "ramp": 2.0, "longest": 40}}
    scene = network_scene(
        {"a": {"position": [0, 0, 0]}, "b": {"position": [0, 0, -38]}, "c": {"position": [20, 0, 0]}},
        {"up": line_between("b", "a", part | {"length": 40}, connections={"end": up}),
         "over": line_between("a", "c", part | {"length": 21})},
        time=(4, 0.02), output=0.1
    )  # fmt: skip
    scene["lines"]["up"]["connections"]["end"]["payout"]["longest"] = 50
    result = hybrid.run(each_line(scene, model="adaptive", mesh=20), parts=[At(2.5, "up")])
    length = np.asarray(result.lines["up"]["payout/length"])
    assert length[-1] == pytest.approx(40 + 1 + 0.52 + 0.25, abs=1e-9) and np.ptp(length[31:]) < 1e-12


@pytest.mark.long
@pytest.mark.needs("dask", "zarr", "xarray", "simpleeval", "SALib")
def test_the_runs_of_a_study_have_it(tmp_path: Path) -> None:
    import yaml

    (tmp_path / "scene.yaml").write_text(yaml.safe_dump(hanging(time={"duration": 7, "step": 0.05})))
    (tmp_path / "study.yaml").write_text(
        "scene: scene.yaml\nvary: {L: {key: ends.end.payout.rate, values: [0.8, 1.0]}}\n"
        "collect: {out: {quantity: payout/length, take: [max]}}\n"
    )
    path = tmp_path / "study.yaml"
    with hybrid.study(path, parts=[Guard()], workers=1) as table:
        most = table["out"].values
    alone = hybrid.study_case(tmp_path / "study.zarr", 1, parts=[Guard()])
    assert most[1] == out(alone).max() and 20 < most[0] < 26 and most[1] < 26
    with pytest.raises(hybrid.ResultError, match="computed with the part guard"):
        hybrid.study_case(tmp_path / "study.zarr", 1)
    with pytest.raises(hybrid.ResultError, match="another part guard"):
        hybrid.study_case(tmp_path / "study.zarr", 1, parts=[Guard(500.0)])
    with pytest.raises(hybrid.ResultError, match="holds another study"):
        hybrid.study(path, parts=[Guard(500.0)])


def test_resumed_without_it_is_refused_by_its_name(tmp_path: Path) -> None:
    scene = hanging(time={"duration": 0.2, "step": 0.02})
    hybrid.run(scene, tmp_path / "with.h5", parts=[Guard()]).close()
    hybrid.run(scene, tmp_path / "without.h5").close()
    with pytest.raises(hybrid.ResultError, match="was computed with the part guard"):
        hybrid.resume(tmp_path / "with.h5", until=0.4)
    with pytest.raises(hybrid.ResultError, match="part guard: other values than those with which the run began"):
        hybrid.resume(tmp_path / "with.h5", until=0.4, parts=[Guard(460.0)])
    with pytest.raises(hybrid.ResultError, match="was computed without the part guard"):
        hybrid.resume(tmp_path / "without.h5", until=0.4, parts=[Guard()])


class Ending(hybrid.RunPart):
    """Ends the run at a time, s."""

    name = "ending"

    def __init__(self, at: float) -> None:
        self.at = at

    def begin(self, run: hybrid.RunView) -> None:
        run.note(f"{run.lines} begins with {run.end_forces()[1, 2]:.4g} N")

    def after_step(self, run: hybrid.RunView) -> None:
        if run.t > self.at:
            run.stop("it is late")

    def finish(self, run: hybrid.RunView, status: str) -> None:
        run.note(f"it is {status} after {run.length():g} m")


def test_a_part_ends_a_run_and_what_was_computed_stays(tmp_path: Path) -> None:
    with pytest.raises(hybrid.ComputationError, match="part ending: it is late") as error:
        hybrid.run(hanging({"rate": 0.0}), tmp_path / "run.h5", parts=[Ending(0.5)])
    assert error.value.outcome == Outcome.STOPPED
    with hybrid.open(tmp_path / "run.h5") as result:
        assert result.times[-1] == pytest.approx(0.52)
        begins, ends = (x.text for x in result.events if x.kind == "part ending")
        assert begins == "('',) begins with -392.4 N" and ends == "it is failed after 20 m"


def test_runs_to_compare_with_have_it() -> None:
    """Else the winch would not stop in them, and their difference would be called an error."""
    result = hybrid.run(hanging(accuracy="5%", mesh={"cells": 60}), parts=[Guard()])
    assert np.max(result["errors/total/position"]) < 0.5, "m, where 3 m more are out without"


class Saying(hybrid.RunPart):
    """Notes of the whole run at every half second, with the length by which its parts judge."""

    name = "saying"

    def after_step(self, run: hybrid.RunView) -> None:
        if abs(run.t - round(2.0 * run.t) / 2.0) < 1e-9:
            run.note("so far", value=run._run.model.models[0].length)


def test_a_note_of_the_whole_run_is_of_all_that_is_out_then(tmp_path: Path) -> None:
    """In a resumed run, too."""
    scene = hanging(time={"duration": 4, "step": 0.05})
    whole = hybrid.run(scene, tmp_path / "whole.h5", parts=[Saying()])
    hybrid.run(scene | {"time": scene["time"] | {"duration": 2.3}}, tmp_path / "part.h5", parts=[Saying()]).close()
    hybrid.resume(tmp_path / "part.h5", until=4.0, parts=[Saying()]).close()
    assert not (apart := differences(tmp_path / "whole.h5", tmp_path / "part.h5")), apart
    notes = of_kind(whole, "part saying")
    assert [e.value for e in notes] == [e.s_b for e in notes]
    spans = {round(e.t, 9): e.s_b for e in notes}
    known = dict(zip(whole.times.round(9).tolist(), out(whole).tolist(), strict=True))
    assert len(spans) == 8 and all(s == pytest.approx(known[t], abs=1e-9) for t, s in spans.items())


class Silent(hybrid.RunPart):
    name = "silent"


class Misspelt(hybrid.RunPart):
    name = "misspelt"

    def after_step(self) -> None:  # type: ignore[override]
        pass


class Open(Ending):
    def __init__(self) -> None:
        self.what = print


def named(name: str) -> hybrid.RunPart:
    found = Guard()
    found.name = name
    return found


@pytest.mark.parametrize(
    ("parts", "message"),
    [
        ([Guard], "expected objects of subclasses of hybrid.RunPart, found the class Guard, which is to be called"),
        (["guard"], "found str"),
        ([named("")], "name: expected up to 27 letters, digits, `_` and `-`, a letter first, found ''"),
        ([Guard(), Guard()], "the name guard is of two of them"),
        ([Silent()], "part Silent does nothing: expected a method begin, after_step, finish"),
        ([Misspelt()], r"part Misspelt: expected after_step\(run\): too many positional arguments"),
        ([Open()], "part Open cannot be kept in a checkpoint and copied: .* give it a checkpoint and a restore"),
    ],
)
def test_what_is_no_part_is_refused_before_anything_is_computed(parts: Any, message: str) -> None:
    with pytest.raises((TypeError, ValueError), match=message):
        hybrid.run(hanging(), parts=parts)


class Asking(hybrid.RunPart):
    """Asks for something at the first step."""

    name = "asking"

    def __init__(self, what: str, *args: Any) -> None:
        self.what, self.args = what, list(args)

    def after_step(self, run: hybrid.RunView) -> None:
        more = {"over": 1.0} if self.what == "stop_winch" else {}
        getattr(run, self.what)(*self.args, **more)


@pytest.mark.parametrize(
    ("what", "args", "message"),
    [
        ("tension", ["main"], "line 'main': expected one of none, because the only line has no name"),
        ("stop_winch", [], "line '' has no payout"),
        ("limit_step", [0.1], "steps have a fixed length"),
    ],
)
def test_what_cannot_be_is_refused_and_names_the_part(what: str, args: list[Any], message: str) -> None:
    scene = hanging()
    del scene["ends"]["end"]["payout"]
    with pytest.raises(ValueError, match=message) as error:
        hybrid.run(scene, parts=[Asking(what, *args)])
    assert error.value.__notes__ == ["raised by after_step of the part asking at t = 0.02 s"]


def test_steps_that_follow_the_motion_are_no_longer_than_a_part_says() -> None:
    scene = hanging({"rate": 0.0}, time={"duration": 0.5, "tolerance": 1e-2})
    result = hybrid.run(scene, parts=[Asking("limit_step", 0.01)])
    assert np.diff(result["steps/t"])[2:].max() < 0.0101


@pytest.mark.parametrize("longest", [float("nan"), 0.0, -1.0])
def test_a_longest_step_that_is_none_is_refused(longest: float) -> None:
    scene = hanging({"rate": 0.0}, time={"duration": 0.5, "tolerance": 1e-2})
    with pytest.raises(ValueError, match="longest: expected a time above 0, in s, found"):
        hybrid.run(scene, parts=[Asking("limit_step", longest)])


class Last(hybrid.RunPart):
    """Says how the run ended."""

    name = "last"

    def finish(self, run: hybrid.RunView, status: str) -> None:
        run.note(status)


def test_a_part_without_steps_asks_for_none_of_them() -> None:
    scene = hanging({"rate": 0.0})
    del scene["ends"]["end"]["payout"]
    network = in_full(hybrid.validate_scene(scene))
    for part, asks in ((Last(), 0), (Ending(1.0), ASK_STEPS)):
        run = new_run(network, MemoryTarget(), "", True, recording=Recording(parts=[part]))
        run.begin_motion()
        assert run.loop.counts.asks & ASK_STEPS == asks
