"""Contact with itself where a scene does not speak of it: on where the line can reach itself, from when it is near."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bits import Stopping, differences, resumed, went_on

import hybrid
import hybrid.model.build
import hybrid.solve.contact
from hybrid.cli.plan_tables import plan_rows
from hybrid.kernels.contact.self_contact_law import AT, INNER, NEAREST, OUTER, TRAVEL, WX, P
from hybrid.kernels.contact.self_contact_pairs import WINDOW
from hybrid.kernels.contact.self_distance import INSIDE
from hybrid.kernels.state.books import blank_books
from hybrid.kernels.state.state import Line
from hybrid.kernels.step.accept import MANY, collapses
from hybrid.model.build import build
from hybrid.model.contents import LOOP, self_reach
from hybrid.model.network import NetworkResolution
from hybrid.scene.read import one_line
from hybrid.scene.root import LINE
from hybrid.simulation import run as run_module
from hybrid.simulation.case import Case
from hybrid.simulation.run_contact import RunContact
from hybrid.solve.contact import SelfContact
from tests.inside import calls_of
from tests.said import kinds, work_put_in
from tests.scenes import cable_scene, pinned_at

DEFECTS = Path(__file__).parents[1] / "data" / "defects"

WIDTH = 0.02


def led_through(**more: Any) -> dict[str, Any]:
    """A line hangs between two ends in a plane; one is led sideways through the other leg.

    Its cells show how weight bends it: else an event says so, which has another place among the others after a stop.
    """
    section = {
        "length": 4.0, "mass": 0.4, "diameter": WIDTH, "axial_stiffness": 1e4, "bending_stiffness": 1.3e-3,
        "damping": {"mass": 1.0},
    }  # fmt: skip
    across = {"travel": {"by": [-1.2, 0, 0], "over": 4.0}}
    return cable_scene(
        section, pinned_at(0, 0, 0), pinned_at(0.6, 0, -1.0, motion=across), model="rod", mesh=60, time=(3.0, 0.02),
        output=(0.02, 101)
    ) | more  # fmt: skip


@pytest.fixture(scope="module")
def led() -> hybrid.Result:
    return hybrid.run(led_through())


def test_a_line_in_a_plane_touches_itself_without_being_asked(led: hybrid.Result) -> None:
    assert "line touches itself" in kinds(led) and "line meets itself" not in kinds(led)
    assert float(led["self_distance/distance"]) > 0.85 * WIDTH
    touches = led["energy/self_contact"] > 0.0
    assert touches.any() and not touches[0]
    assert (led["self_contact"].max(axis=1)[touches] > 0.0).all() and not led["self_contact"][~touches].any()
    assert any(event.kind == "out of plane" and "itself" in event.text for event in led.events)
    assert led["work/scheme"].max() < 1e-3 * work_put_in(led)  # what steps in contact dissipate is theirs


def test_contact_that_begins_by_itself_is_told(led: hybrid.Result) -> None:
    """Where and when, by an event, by a word of the progress, and before the run by its plan, with what it costs."""
    begun = [event for event in led.events if event.kind == "contact begins"]
    touched = next(event for event in led.events if event.kind == "line touches itself")
    assert begun and 0.0 < begun[0].t < touched.t
    assert abs(begun[0].s_a - touched.s_a) < 0.5 and abs(begun[0].s_b - touched.s_b) < 0.5
    assert "surfaces are" in begun[0].text and "contact: {self: false}" in begun[0].text
    said = list[tuple[float, bool, str]]()
    hybrid.run(led_through(), progress=lambda x: said.append((x.t, x.touches, x.text))).close()
    assert all(("contact" in text) == on for _, on, text in said) and said[-1][1]
    assert all(t >= begun[0].t for t, on, _ in said if on)
    for more, told in (({}, True), ({"contact": {"self": False}}, False), ({"contact": {"self": True}}, False)):
        scene = hybrid.validate_scene(led_through(**more))
        lines = " ".join(" ".join(plan_rows(scene, hybrid.plan(scene))).split())
        assert ("whatever its ends do; its steps take 2 to 20 times as long" in lines) == told


@pytest.mark.long
def test_a_file_of_before_goes_on_as_it_began(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """It was written when nothing was computed that was not asked for, and has no fields for it."""
    stopping, scene = Stopping(monkeypatch), led_through(time={"duration": 0.2, "step": 0.02})
    with monkeypatch.context() as before:
        before.setattr(hybrid.model.build, "contact_bits", lambda scene: 0)
        stopping.stop(4, hybrid.run, scene, tmp_path / "run.h5")
    with hybrid.resume(tmp_path / "run.h5") as result:
        assert result.status == "complete" and result.times[-1] == 0.2 and "self_contact" not in result
        assert one_line(hybrid.parse_scene(result.scene_text)).contact.self is None


@pytest.mark.slow  # 20 seconds of processor time
def test_a_hose_whose_end_is_lowered_touches_itself() -> None:
    """Its free end goes down past the slack below it: it crossed itself, without a word and in 8 runs, once."""
    scene, short = DEFECTS / "hose_crosses_itself.yaml", "time.duration=10.5"
    result = hybrid.run(hybrid.load_scene(scene, [short, "accuracy={position: 1%, tension: 1%}"]))
    (touch,) = [e for e in result.events if e.kind == "line touches itself"]
    assert 9.0 < touch.t < 10.5 and "line meets itself" not in kinds(result)
    assert float(result["self_distance/distance"]) > 0.85 * 0.03
    # a pre-run, three to compare with and one that shows what their steps do (longer ones are halved), the result, a
    # finer one, which seems to meet what is asked and moves further than was foretold, and one that shows that it does
    # not
    assert result.attributes["effort_runs"] <= 8
    fine = hybrid.run(hybrid.load_scene(scene, [short, "model=rod", "mesh={cells: 3360}", "time.step=0.005"]))
    for name, error in (("position", "position"), ("reaction_end", "end_force_end")):
        off = np.linalg.norm(result[name] - fine[name], axis=-1).max()
        assert result[f"errors/total/{error}"].max() > 0.4 * off, name  # 0.08 and 0.11 once, and nothing was said
    assert "accuracy missed" in kinds(result)


def test_where_it_cannot_be_it_is_off_and_says_why() -> None:
    """In a plane that is asked for, and without a diameter; other reasons are in test_system_contact.py."""
    scene = led_through(dimension=2)
    (entry,) = (x for x in hybrid.plan(scene).contents if x.what == "contact of the line with itself")
    assert not entry.on and "dimension: 2" in entry.why
    scene = led_through()
    del scene["cable"]["sections"][0]["diameter"]
    assert "diameter" in self_reach(one_line(hybrid.validate_scene(scene))).why


def test_the_smallest_loop_is_that_of_contact() -> None:
    assert pytest.approx(WINDOW - OUTER) == LOOP and pytest.approx(1.0 - INNER) == INSIDE


def test_it_is_on_where_the_slack_makes_a_loop() -> None:
    plan = build(one_line(hybrid.validate_scene(led_through())))
    entry = next(x for x in plan.contents if x.what == "contact of the line with itself")
    assert entry.on and "near itself" in entry.why
    assert plan.plane is not None  # nothing is computed in space before the line comes near itself


def test_a_start_within_itself_is_told_of_and_refused_where_contact_is_asked() -> None:
    ends = {"start": {"kind": "pinned", "position": [0, 0, 0]}, "end": {"kind": "pinned", "position": [0.01, 0, 0]}}
    short = {"ends": ends, "time": {"duration": 0.04, "step": 0.02}, "output": {"every": 0.02}}
    assert [x.kind for x in hybrid.run(led_through(**short)).events].count("line meets itself") == 1
    with pytest.raises(hybrid.SceneError, match=r"s = .* m and s = .* m are .* m apart, less than 0.85[\s\S]*diameter"):
        hybrid.run(led_through(contact={"self": True}, **short))


# --- Contact of a line with itself begins where it is near itself, ends where it is not, and is given up where it
# fails ---

GIVEN_UP, COLLAPSE = "contact given up", "steps collapse"


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
    result = hybrid.run(led_through(ends=ends, time={"duration": 7.0, "step": 0.01}))
    assert [name for name, _ in happened] == ["begins", "ends"] * 2
    assert "line touches itself" in kinds(result) and "line meets itself" not in kinds(result)
    assert float(result["self_distance/distance"]) > 0.85 * WIDTH
    ends_at = [t for name, t in happened if name == "ends"]
    assert not any(result["energy/self_contact"][np.searchsorted(result.times, ends_at)])
    assert result["work/scheme"].max() < 1e-3 * work_put_in(result)  # nothing is put in where contact comes or goes


@pytest.fixture
def no_room(monkeypatch: pytest.MonkeyPatch) -> None:
    """Room for one point of contact: no step leads on with more."""
    for name in ("LEAST_POINTS", "MOST_POINTS"):
        monkeypatch.setattr(hybrid.solve.contact, name, 1)


@pytest.mark.usefixtures("no_room")
def test_where_no_step_leads_on_it_is_given_up() -> None:
    result = hybrid.run(led_through())
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
        hybrid.run(led_through(contact={"self": True}))


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
    result = hybrid.run(hanging(errors=True))
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


# --- Contact of a line with itself while it is paid out: its mirror image, zones that move, a winch, runs that resume
# ---

WINCH = {"tension": 3.0, "inertia": 2.0, "damping": 3.0, "max_rate": 0.5, "ramp": 1.0}


def crossing(
    side: str = "end", model: Any = "rod", winch: dict[str, float] | None = None, **more: Any
) -> dict[str, Any]:
    """A line hangs from a winch; its far end is led past the winch through the other leg, which goes on to grow."""
    section = {
        "length": 5.0, "mass": 0.4, "diameter": WIDTH, "axial_stiffness": 1e5, "bending_stiffness": 0.02,
        "torsional_stiffness": 0.016, "damping": {"mass": 0.5},
    }  # fmt: skip
    payout = {"longest": 8.0} | ({"rate": 0.4, "ramp": 1.0} if winch is None else {"winch": winch})
    led = {"travel": {"by": [-2.8, 0.5 * WIDTH, 0.0], "over": 4.0}}
    far, held = pinned_at(2.5, 0, -0.5, motion=led), pinned_at(0.1, 0, 0, payout=payout)
    ends = (far, held) if side == "end" else (held, far)
    return cable_scene(
        section, *ends, model=model, mesh=100, contact={"self": True, "friction": 0.3}, time=(3.2, 0.01),
        output=(0.02, 41)
    ) | more  # fmt: skip


@pytest.fixture(scope="module")
def rod() -> hybrid.Result:
    return hybrid.run(crossing())


@pytest.mark.long  # a kernel of its own: 7 s
def test_strands_stay_apart_while_line_comes(rod: hybrid.Result) -> None:
    assert kinds(rod) == {"line touches itself"}
    assert float(rod["self_distance/distance"]) > 0.85 * WIDTH
    touches = rod["energy/self_contact"] > 0.0
    assert touches.sum() > 5 and rod["payout/length"][touches].max() > rod["payout/length"][touches].min() + 0.05
    assert (rod["self_contact"][touches].max(axis=1) > 0.0).all() and not rod["self_contact"][~touches].any()
    assert rod["work/scheme"].max() < 1e-3 * np.abs(rod["work/end"]).max()


def test_the_mirror_image(rod: hybrid.Result) -> None:
    mirror = hybrid.run(crossing("start"))
    np.testing.assert_allclose(mirror["position"][:, ::-1], rod["position"], atol=1e-5)
    most = rod["energy/self_contact"].max()
    np.testing.assert_allclose(mirror["energy/self_contact"], rod["energy/self_contact"], atol=1e-3 * most)


@pytest.mark.long
@pytest.mark.parametrize("more", [{"model": "adaptive"}, {"winch": WINCH, "side": "start"}], ids=["zones", "winch"])
def test_it_resumes_to_the_last_bit(tmp_path: Path, rod: hybrid.Result, more: dict[str, Any]) -> None:
    """Stopped while strands touch; zones that move touch as rods do."""
    whole = resumed(crossing(**more), tmp_path, 2.9)
    touches = whole.times[whole["energy/self_contact"] > 0.0]
    assert touches[0] < 2.9 < touches[-1]
    if "model" in more:
        assert any(zone.kind == "catenary" for zones in whole.zones for zone in zones)
        assert whole["energy/self_contact"].max() == pytest.approx(rod["energy/self_contact"].max(), rel=0.1)
        assert np.linalg.norm(whole["position"] - rod["position"], axis=2).max() < 0.01 * 5.0


def test_sections_on_the_reel_need_a_diameter() -> None:
    scene = crossing()
    scene["ends"]["end"]["payout"]["reel"] = [
        {"length": 4.0, "mass": 0.4, "axial_stiffness": 1e5, "bending_stiffness": 1.0}
    ]
    with pytest.raises(hybrid.SceneError, match=r"payout.reel\[0\].diameter"):
        hybrid.validate_scene(scene)


# --- Runs to compare with compute contact of a line with itself where it touches itself in the result, and not before
# ---

OUTPUT = {"every": 0.1, "points": 21, "errors": True}


@pytest.fixture
def touched(monkeypatch: pytest.MonkeyPatch) -> list[bool]:
    """Whether contact was computed, of every run to compare with."""
    return calls_of(monkeypatch, Case, "sample", after=lambda run, *_: run[LINE].touches)


@pytest.mark.parametrize(
    ("asked", "duration", "touches"), [({}, 3.0, True), ({}, 1.5, False), ({"contact": {"self": True}}, 0.1, True)]
)
def test_they_are_made_with_contact_where_the_result_touches(
    asked: dict[str, Any], duration: float, touches: bool, touched: list[bool]
) -> None:
    """And from the start where contact is asked; of a line that came near itself the choice of a model is no catenary."""
    scene = hybrid.validate_scene(led_through(time={"duration": duration, "step": 0.02}, output=OUTPUT, **asked))
    result = hybrid.run(scene)
    assert touched == [touches] * 3 and result.attributes["effort_runs"] == 4
    assert float(result["errors/total/position"].max()) > 0.0
    assert asked or ("line touches itself" in kinds(result)) is touches
    case = Case(scene, None)
    case.sample(NetworkResolution.of(case.lines))
    assert case.near_themselves == ({LINE} if touches else set())


@pytest.mark.long
def test_a_tether_far_from_itself_does_not_stall() -> None:
    """Two parts 12 m apart, 367 diameters, on chords longer than their bend, began contact in the coarsest run."""
    result = hybrid.run(hybrid.load_scene(DEFECTS / "long_s_tether.yaml", ["time.duration=60"]))
    assert result.attributes["effort_runs"] <= 6 and result.attributes["cells"] < 1500
    assert len(result["steps/t"]) < 1500
    assert not kinds(result) & {"line touches itself", "line meets itself", "no error figure"}


def test_a_loop_opens_where_its_ends_were_in_each_other() -> None:
    """Let go, they were no neighbours any more, and in each other: the run stopped."""
    rope = {"length": 2.0, "mass": 1.0, "diameter": 0.05, "axial_stiffness": 1e5, "bending_stiffness": 1.0}
    heights = []
    for gap in (0.0, 0.03, 0.06):  # of 0.05 m; the last are apart
        ends = pinned_at(0, 0, 0), pinned_at(gap, 0, 0, release_at={"time": 0.05})
        made = cable_scene(rope, *ends, model="rod", mesh=40, time=(0.4, 0.002), output=0.05, contact={"self": True})
        heights.append(float(hybrid.run(made).position[-1, -1, 2]))
    assert heights[1] == pytest.approx(0.5 * (heights[0] + heights[2]), abs=0.005)
