"""Contact of a line with itself begins where it is near itself, ends where it is not, and is given up where it fails."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bits import Stopping, differences, went_on
from test_self_contact_default import WIDTH, led_through

import hybrid
import hybrid.solve.contact
from hybrid.kernels.contact.self_contact_law import AT, NEAREST, TRAVEL, WX, P
from hybrid.kernels.state.books import blank_books
from hybrid.kernels.state.state import Line
from hybrid.kernels.step.accept import MANY, collapses
from hybrid.simulation import run as run_module
from hybrid.simulation.run_contact import RunContact
from hybrid.solve.contact import SelfContact
from tests.scenes import cable_scene, pinned_at

GIVEN_UP, COLLAPSE = "contact given up", "steps collapse"


def kinds(result: hybrid.Result) -> set[str]:
    return {event.kind for event in result.events}


def test_it_comes_and_goes_with_the_legs(monkeypatch: pytest.MonkeyPatch) -> None:
    """An end that swings beside the other: the legs touch twice."""
    happened: list[tuple[str, float]] = []
    let_touch = RunContact._let_touch

    def noted(contact: RunContact, numbers: Any, touch: bool = True) -> None:
        happened.append(("begins" if touch else "ends", contact._run.t))
        let_touch(contact, numbers, touch)

    monkeypatch.setattr(RunContact, "_let_touch", noted)
    sway = {"surge": {"amplitude": 0.26, "period": 2.0}, "ramp": 4.0}
    ends = {"start": pinned_at(0, 0, 0), "end": pinned_at(0.3, 0, 0, motion=sway)}
    result = hybrid.run(hybrid.validate_scene(led_through(ends=ends, time={"duration": 7.0, "step": 0.01})))
    assert [name for name, _ in happened] == ["begins", "ends"] * 2
    assert "line touches itself" in kinds(result) and "line meets itself" not in kinds(result)
    assert float(result["self_distance/distance"]) > 0.85 * WIDTH
    ends_at = [t for name, t in happened if name == "ends"]
    assert not any(result["energy/self_contact"][np.searchsorted(result.times, ends_at)])
    put_in = sum(
        np.abs(result[name]).max() for name in result.names if name.startswith("work/") and name != "work/scheme"
    )
    assert result["work/scheme"].max() < 1e-3 * put_in  # nothing is put in where contact comes or goes


@pytest.fixture
def no_room(monkeypatch: pytest.MonkeyPatch) -> None:
    """Room for one point of contact: no step leads on with more."""
    for name in ("LEAST_POINTS", "MOST_POINTS"):
        monkeypatch.setattr(hybrid.solve.contact, name, 1)


@pytest.mark.usefixtures("no_room")
def test_where_no_step_leads_on_it_is_given_up() -> None:
    result = hybrid.run(hybrid.validate_scene(led_through()))
    (event,) = [x for x in result.events if x.kind == GIVEN_UP]
    assert result.status == "complete" and event.s_a < 1.4 and event.s_b > 3.9
    assert "cells of at most" in event.text and "until these are apart" in event.text
    (meets,) = [x for x in result.events if x.kind == "line meets itself"]
    assert "let no step lead on" in meets.text


@pytest.mark.usefixtures("no_room")
def test_where_it_is_asked_for_a_failure_names_it() -> None:
    with pytest.raises(
        hybrid.ComputationError, match=r"contact of the line with itself is computed, s = .*self: false"
    ):
        hybrid.run(hybrid.validate_scene(led_through(contact={"self": True})))


# --- steps that collapse ------------------------------------------------------------------------------------


def test_many_steps_below_a_thousandth_of_the_longest_have_collapsed() -> None:
    books = blank_books()
    clock, count = books.clock, books.counts
    assert not collapses.py_func(clock, count, 1.0)
    told = [collapses.py_func(clock, count, 5e-4) for _ in range(2 * MANY)]
    assert [k + 1 for k, x in enumerate(told) if x] == [MANY, 2 * MANY]
    count.cut_by_error = 3
    assert not collapses.py_func(clock, count, 2e-3) and count.tiny_steps == count.cut_by_error == 0


def hanging(**output: Any) -> dict[str, Any]:
    """A line of 20 cells that an end shakes, in 12000 steps."""
    section = {"length": 4.0, "mass": 0.4, "diameter": WIDTH, "axial_stiffness": 1e4, "bending_stiffness": 1e-3}
    shaken = {"heave": {"amplitude": 0.1, "period": 1.0}, "ramp": 2.0}
    return cable_scene(
        section, pinned_at(0, 0, 0), pinned_at(3.0, 0, 0, motion=shaken), model="rod", mesh=20, time=(6.0, 0.0005),
        output={"every": 0.1, "points": 11} | output
    )  # fmt: skip


@pytest.fixture
def longest(monkeypatch: pytest.MonkeyPatch) -> None:
    """All runs have made a very long step."""
    begin = run_module.Run.begin_motion

    def after_a_long_step(self: run_module.Run) -> None:
        begin(self)
        self.loop.clock.longest = 1e3

    monkeypatch.setattr(run_module.Run, "begin_motion", after_a_long_step)


@pytest.mark.usefixtures("longest")
def test_a_collapse_is_named_and_a_run_to_compare_with_is_given_up() -> None:
    result = hybrid.run(hybrid.validate_scene(hanging(errors=True)))
    (event,) = [x for x in result.events if x.kind == COLLAPSE]
    assert event.t == pytest.approx(MANY * 0.0005) and "shorter than 0.001 of the longest, 1e+03 s" in event.text
    (none,) = [x for x in result.events if x.kind == "no error figure"]
    assert "steps have become so short" in none.text and result.status == "complete"


# --- where cells change in contact ---

FOLLOWING = {"kind": "adaptive", "curvature_error": 0.05, "hold_time": 0.4}  # so that zones change as well


def rubbing() -> hybrid.Scene:
    """A line whose legs rub on each other, in cells that follow the curvature, with outputs within steps."""
    more = {"contact": {"self": True, "friction": 0.3}, "model": FOLLOWING, "mesh": {}}
    return hybrid.validate_scene(
        led_through(**more, time={"duration": 2.6, "step": 0.02}, output={"every": 0.005, "points": 101})
    )


@pytest.fixture
def travels(monkeypatch: pytest.MonkeyPatch) -> list[tuple[int, int]]:
    """Of every change of cells in contact: points with a travel before, and points without one after it.

    Points that had nothing near them before are not counted: they come into contact by the change.
    """
    found: list[tuple[int, int]] = []
    settle, begin = SelfContact.count_energy, SelfContact.__init__

    def beginning(contact: SelfContact, line: Line, *args: object) -> None:
        begin(contact, line, *args)
        contact.s = line.s

    def noting(contact: SelfContact, *args: object) -> float:
        kept = contact.contact.grips[: int(contact.contact.counts.grips), AT].copy()
        energy = settle(contact, *args)
        points = int(contact.contact.counts.points)
        rows, lost = contact.contact.points[:points], 0
        for row, hold in zip(rows, contact.contact.holds[:points], strict=True):
            at = row[WX : WX + 3] @ contact.s[int(row[P]) - 1 : int(row[P]) + 2]
            near = kept.size and np.abs(kept - at).min() < NEAREST * WIDTH
            lost += bool(near and not hold[TRAVEL : TRAVEL + 2].any())
        found.append((kept.size, lost))
        return energy

    monkeypatch.setattr(SelfContact, "count_energy", noting)
    monkeypatch.setattr(SelfContact, "__init__", beginning)
    return found


@pytest.mark.long
def test_it_goes_on(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, travels: list[tuple[int, int]]) -> None:
    """Energy and force of contact do not fall to nothing where cells change, and friction keeps its travels."""
    stopping, scene = Stopping(monkeypatch), rubbing()
    result = hybrid.run(scene, tmp_path / "whole.h5", progress=stopping)
    held = [lost for had, lost in travels if had > 8]
    assert len(held) >= 4 and sum(held) == 0  # 29 lost where only the same sample points kept theirs
    for x in (result["energy/self_contact"], result["self_contact"].sum(axis=1)):
        assert not ((x[1:-1] < 0.3 * np.minimum(x[:-2], x[2:])) & (x[2:] > 1e-12)).any()
    work = {name: result[f"work/{name}"] for name in ("end", "friction", "scheme", "zones")}
    assert work["friction"][-1] < -0.01 and np.diff(work["friction"]).max() <= 0.0
    assert work["scheme"][-1] < 5e-3 * work["end"][-1]  # 0.07 where ends were without the force of contact
    assert went_on(scene, tmp_path / "run.h5", stopping, [110, 12]) == 2
    assert differences(tmp_path / "whole.h5", tmp_path / "run.h5") == []
