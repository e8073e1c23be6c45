"""Runs to compare with compute contact of a line with itself where it touches itself in the result, and not before."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from test_self_contact_default import led_through

import hybrid
from hybrid.model.network import NetworkResolution
from hybrid.scene.root import LINE, in_full
from hybrid.simulation.case import Case
from hybrid.simulation.run_sample import Samples

Form = Callable[[Any], Any]
FORMS = pytest.mark.parametrize("form", [lambda scene: scene, in_full], ids=["cable", "named"])
OUTPUT = {"every": 0.1, "points": 21, "errors": True}
DEFECTS = Path(__file__).parents[1] / "data" / "defects"


@pytest.fixture
def touched(monkeypatch: pytest.MonkeyPatch) -> list[bool]:
    """Whether contact was computed, of every run to compare with."""
    found: list[bool] = []
    sample = Case.sample

    def noted(self: Case, *args: Any, **more: Any) -> Samples:
        run = sample(self, *args, **more)
        found.append(run[LINE].touches)
        return run

    monkeypatch.setattr(Case, "sample", noted)
    return found


@FORMS
def test_they_are_made_with_contact_where_the_result_touches(form: Form, touched: list[bool]) -> None:
    result = hybrid.run(form(hybrid.validate_scene(led_through(output=OUTPUT))))
    assert "line touches itself" in {event.kind for event in result.events}
    assert touched == [True] * 3 and result.attributes["effort_runs"] == 4
    assert all(float(x["errors/total/position"].max()) > 0.0 for _, x in result.each_line())


@FORMS
def test_they_compute_none_where_it_does_not(form: Form, touched: list[bool]) -> None:
    near = led_through(time={"duration": 1.5, "step": 0.02}, output=OUTPUT)
    result = hybrid.run(form(hybrid.validate_scene(near)))
    assert "line touches itself" not in {event.kind for event in result.events}
    assert touched == [False] * 3


@FORMS
def test_they_do_from_the_start_where_contact_is_asked(form: Form, touched: list[bool]) -> None:
    more = {"contact": {"self": True}, "time": {"duration": 0.1, "step": 0.02}}
    hybrid.run(form(hybrid.validate_scene(led_through(**more, output=OUTPUT))))
    assert touched == [True] * 3


@FORMS
def test_a_line_that_came_near_itself_is_known(form: Form) -> None:
    """Of which the choice of a model makes no catenary."""
    case = Case(form(hybrid.validate_scene(led_through(output=OUTPUT))), None)
    case.sample(NetworkResolution.of(case.lines))
    assert case.near_themselves == {LINE}


@pytest.mark.long
def test_a_tether_far_from_itself_does_not_stall() -> None:
    """Two parts 12 m apart, 367 diameters, on chords longer than their bend, began contact in the coarsest run."""
    result = hybrid.run(hybrid.load_scene(DEFECTS / "long_s_tether.yaml", ["time.duration=60"]))
    assert result.attributes["effort_runs"] <= 6 and result.attributes["cells"] < 1500
    assert len(result["steps/t"]) < 1500
    assert not {event.kind for event in result.events} & {"line touches itself", "line meets itself", "no error figure"}
