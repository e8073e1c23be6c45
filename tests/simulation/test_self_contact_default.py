"""Contact with itself where a scene does not speak of it: on where the line can reach itself, from when it is near."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bits import Stopping

import hybrid
import hybrid.model.build
from hybrid.cli.plan_tables import plan_rows
from hybrid.kernels.contact.self_contact_law import INNER, OUTER
from hybrid.kernels.contact.self_contact_pairs import WINDOW
from hybrid.kernels.contact.self_distance import INSIDE
from hybrid.model.build import build
from hybrid.model.contents import LOOP, self_reach
from hybrid.scene.read import one_line
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
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("led") / "whole.h5"
    hybrid.run(hybrid.validate_scene(led_through()), path).close()
    return path


@pytest.fixture(scope="module")
def led(whole: Path) -> hybrid.Result:
    return hybrid.open(whole)


def test_a_line_in_a_plane_touches_itself_without_being_asked(led: hybrid.Result) -> None:
    kinds = {event.kind for event in led.events}
    assert "line touches itself" in kinds and "line meets itself" not in kinds
    assert float(led["self_distance/distance"]) > 0.85 * WIDTH
    touches = led["energy/self_contact"] > 0.0
    assert touches.any() and not touches[0]
    assert (led["self_contact"].max(axis=1)[touches] > 0.0).all() and not led["self_contact"][~touches].any()
    assert any(event.kind == "out of plane" and "itself" in event.text for event in led.events)
    put_in = sum(np.abs(led[name]).max() for name in led.names if name.startswith("work/") and name != "work/scheme")
    assert led["work/scheme"].max() < 1e-3 * put_in  # what steps in contact dissipate is theirs


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
        stopping.left = 4
        with pytest.raises(KeyboardInterrupt):
            hybrid.run(hybrid.validate_scene(scene), tmp_path / "run.h5", progress=stopping)
    with hybrid.resume(tmp_path / "run.h5") as result:
        assert result.status == "complete" and result.times[-1] == 0.2 and "self_contact" not in result
        assert one_line(hybrid.parse_scene(result.scene_text)).contact.self is None


@pytest.mark.slow  # 20 seconds of processor time
def test_a_hose_whose_end_is_lowered_touches_itself() -> None:
    """Its free end goes down past the slack below it: it crossed itself, without a word and in 8 runs, once."""
    scene, short = DEFECTS / "hose_crosses_itself.yaml", "time.duration=10.5"
    result = hybrid.run(hybrid.load_scene(scene, [short, "accuracy={position: 1%, tension: 1%}"]))
    (touch,) = [e for e in result.events if e.kind == "line touches itself"]
    assert 9.0 < touch.t < 10.5 and "line meets itself" not in {e.kind for e in result.events}
    assert float(result["self_distance/distance"]) > 0.85 * 0.03
    # a pre-run, three to compare with and one that shows what their steps do (longer ones are halved), the result, a
    # finer one, which seems to meet what is asked and moves further than was foretold, and one that shows that it does
    # not
    assert result.attributes["effort_runs"] <= 8
    fine = hybrid.run(hybrid.load_scene(scene, [short, "model=rod", "mesh={cells: 3360}", "time.step=0.005"]))
    for name, error in (("position", "position"), ("reaction_end", "end_force_end")):
        off = np.linalg.norm(result[name] - fine[name], axis=-1).max()
        assert result[f"errors/total/{error}"].max() > 0.4 * off, name  # 0.08 and 0.11 once, and nothing was said
    assert "accuracy missed" in {e.kind for e in result.events}


@pytest.mark.parametrize(
    ("more", "why"),
    [
        ({"contact": {"self": False}}, "contact.self: false"),
        ({"model": "catenary"}, "catenaries that stay"),
        ({"dimension": 2}, "dimension: 2"),
        ({"ends": {"start": {"kind": "pinned", "position": [0, 0, 0]},
                   "end": {"kind": "pinned", "position": [3.97, 0, 0]}}}, "of a loop"),
    ],
)  # fmt: skip
def test_where_it_cannot_be_it_is_off_and_says_why(more: dict[str, Any], why: str) -> None:
    scene = hybrid.validate_scene(led_through(**more))
    reach = self_reach(one_line(scene))
    assert not reach.asked and not reach.may and why in reach.why
    entry = next(x for x in build(one_line(scene)).contents if x.what == "contact of the line with itself")
    assert not entry.on and why in entry.why


def test_without_a_diameter_it_is_off() -> None:
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
    kinds = [event.kind for event in hybrid.run(hybrid.validate_scene(led_through(**short))).events]
    assert kinds.count("line meets itself") == 1
    with pytest.raises(hybrid.SceneError, match=r"s = .* m and s = .* m are .* m apart, less than 0.85[\s\S]*diameter"):
        hybrid.run(hybrid.validate_scene(led_through(contact={"self": True}, **short)))
