"""Lines of a system touch themselves where nobody speaks of contact: from when they are near, at no cost before."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bits import differences
from test_system_contact import RUBS, TIME, WIDTH, system
from test_system_contact_zones import system as adaptive

import hybrid
import hybrid.model.build
from hybrid.simulation.network_run import NetworkRun
from hybrid.simulation.stepping import Simulation

RUNS_ON = {"friction": RUBS["friction"]}
NAMES = ("position", "tension", "self_contact", "energy/self_contact", "work/friction")


def line(result: hybrid.Result, name: str = "hose") -> hybrid.Result:
    return result.lines[name]


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("default") / "whole.h5"
    hybrid.run(system(contact=RUNS_ON), path, progress=False).close()
    return path


def test_it_is_the_run_that_asks_for_contact(whole: Path) -> None:
    """What is computed without contact until the legs come near each other is the same but for round-off."""
    with hybrid.open(whole) as result, hybrid.run(system(contact=RUBS), progress=False) as asked:
        for name in NAMES:
            one, other = line(result)[name], line(asked)[name]
            assert np.abs(one - other).max() <= 1e-7 * np.abs(other).max() > 0.0, name
        kinds = {event.kind for event in line(result).events}
        assert {"contact begins", "line touches itself"} <= kinds and "line meets itself" not in kinds
        assert any(x.kind == "line touches itself" and "line hose" in x.text for x in result.events)
        assert float(line(result)["self_distance/distance"]) > 0.85 * WIDTH


def test_nothing_is_computed_before_a_line_is_near_itself(monkeypatch: pytest.MonkeyPatch) -> None:
    begun: list[float] = []
    make = NetworkRun.make_solver

    def counted(run: NetworkRun) -> None:
        make(run)
        begun.extend(run.t for x in run.lines if x.contact is not None)

    monkeypatch.setattr(NetworkRun, "make_solver", counted)
    result = hybrid.run(system(contact=RUNS_ON), progress=False)
    touched = next(x.t for x in result.events if x.kind == "line touches itself")
    (since,) = begun
    assert 0.5 * touched < since < touched


@pytest.mark.long
def test_it_resumes_bit_for_bit_before_contact_begins_and_in_it(whole: Path, tmp_path: Path) -> None:
    scene = system(contact=RUNS_ON)
    with hybrid.open(whole) as result:
        touching = float(result.times[np.flatnonzero(line(result)["energy/self_contact"])[0]])
    scene["time"] = TIME | {"duration": 0.4}
    hybrid.run(scene, tmp_path / "part.h5", progress=False).close()
    hybrid.resume(tmp_path / "part.h5", until=touching).close()
    hybrid.resume(tmp_path / "part.h5", until=TIME["duration"]).close()
    assert [x for x in differences(whole, tmp_path / "part.h5") if "scene" not in x and "checkpoint" not in x] == []


@pytest.mark.long
def test_what_is_taken_back_takes_its_contact_with_it() -> None:
    """From before contact begins into it, back, and there again: bit for bit."""
    times = np.arange(1, 18) * 0.1
    found = []
    for back in (False, True):
        with Simulation(system(contact=RUNS_ON)) as lines:
            for t in times:
                if back and t > 1.0:
                    before = lines.save()
                    lines.advance(1.7)
                    lines.restore(before)
                lines.advance(float(t))
            found.append(lines.line("hose").position)
    assert np.array_equal(*found)


@pytest.mark.parametrize(
    ("more", "on", "why"),
    [
        ({}, True, "whatever its ends do"),
        ({"contact": {"self": False}}, False, "contact.self: false"),
        ({"model": "catenary"}, False, "catenaries that stay"),
        ({"start": "a", "end": "b"}, False, "of a loop"),
        ({"start": "a", "end": "b", "break_at": {"time": 1.0}}, True, "whatever its ends do"),
        ({"start": "a", "end": "weak"}, True, "whatever its ends do"),
    ],
)
def test_the_plan_says_which_lines_have_it(more: dict[str, Any], on: bool, why: str) -> None:
    """A line that cannot reach itself lies nearly straight between points that nothing moves."""
    scene = system(contact={})
    line = scene["lines"]["hose"] | more
    places = {"a": {"position": [0, 0, 0]}, "b": {"position": [3.99, 0, 0]}}
    places["weak"] = places["b"] | {"break_at": {"tension": 1e3}}
    scene["points"] |= {name: x for name, x in places.items() if name in (line["start"], line["end"])}
    plan = hybrid.plan(scene | {"lines": scene["lines"] | {"other": line}}).lines["other"]
    (entry,) = (x for x in plan.contents if x.what == "contact of the line with itself")
    assert entry.on is on and why in entry.why


@pytest.mark.slow
def test_a_line_whose_zones_move_touches_itself_as_if_asked() -> None:
    """The same zones at the same times, and rod in time where it touches."""
    scene = adaptive(0.0)
    asked = hybrid.run(scene, progress=False)
    scene["lines"]["line 0"] = scene["lines"]["line 0"] | {"contact": RUNS_ON}
    result = hybrid.run(scene, progress=False)
    touches = line(asked, "line 0")["energy/self_contact"] > 0.0
    assert touches.any()
    assert np.array_equal(line(result, "line 0")["energy/self_contact"] > 0.0, touches)
    apart = line(result, "line 0").position - line(asked, "line 0").position
    assert np.abs(apart).max() < 1e-3 * WIDTH
