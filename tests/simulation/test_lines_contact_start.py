"""Contact between lines that nobody asks for: it begins where lines come near each other, and changes nothing before."""

from __future__ import annotations

from collections.abc import Callable
from copy import deepcopy
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bits import resumed

import hybrid
from hybrid.kernels.state.books import FAILED, PARTS_ITSELF
from hybrid.model.network import build_network
from hybrid.simulation import run_record
from tests.scenes import each_line, line_between, network_scene, system_of
from tests.validation.test_validation_lines_contact import PASSAGE, ROPE, bridle, crossing, lowered

Tables = dict[str, Any]
BEGINS, NOT_ASKED = "contact begins", {"between": []}
NAMES = ("position", "tension", "self_contact")


def unasked(duration: float = 0.8, **more: Any) -> Tables:
    tables = lowered(duration)
    del tables["contact"]
    return tables | more


def kinds(result: Any) -> list[str]:
    return [e.kind for e in result.events]


def same(a: Any, b: Any, names: tuple[str, ...] = NAMES) -> float:
    """The largest difference of results of several lines, as a part of the largest value."""
    return max(
        float(np.abs(x[name] - b.lines[line][name]).max() / (np.abs(x[name]).max() or 1.0))
        for line, x in a.lines.items()
        for name in names
    )


@pytest.fixture(scope="module")
def begun() -> Any:
    return hybrid.run(unasked())


def test_contact_begins_where_lines_come_near_and_is_that_which_is_asked_for(begun: Any) -> None:
    (event,) = (e for e in begun.events if e.kind == BEGINS)
    met = next(e for e in begun.events if e.kind == "lines touch")
    assert 0.0 < met.t - event.t < 0.1
    assert "upper and lower" in event.text and "between: []" in event.text
    assert PASSAGE not in kinds(begun)
    assert begun.lines["upper"]["self_contact"].max() > 1.0
    assert same(begun, hybrid.run(unasked(contact={}))) < 1e-9


def test_what_presses_is_called_by_its_name(begun: Any) -> None:
    """Nobody asked for contact, so that outputs have no forces by partner: events name the other line."""
    from hybrid.store.envelope import largest_contact

    for name, other in (("upper", "line lower"), ("lower", "line upper")):
        found = largest_contact(begun.lines[name])
        assert found is not None and found[0] == other and found[1].value > 1.0


def test_taut_catenaries_touch_as_if_asked() -> None:
    tables = each_line(unasked(), model="catenary", sections=[ROPE | {"length": 0.805}])
    found = hybrid.run(tables)
    assert BEGINS in kinds(found) and PASSAGE not in kinds(found)
    assert same(found, hybrid.run(tables | {"contact": {}})) < 1e-9


def test_where_contact_is_off_or_an_accuracy_is_asked_lines_pass_and_that_is_said() -> None:
    assert BEGINS not in kinds(off := hybrid.run(unasked(contact=NOT_ASKED)))
    assert PASSAGE in kinds(off)
    for more in ({"accuracy": "3%"}, {"output": {"errors": True}}, {"time": {"duration": 1.0}}):
        assert build_network(system_of(unasked(**more))).may_meet == ()
    assert build_network(system_of(unasked())).may_meet == (0, 1)
    thin = deepcopy(unasked())
    del thin["lines"]["lower"]["sections"][0]["diameter"]
    assert build_network(system_of(thin)).may_meet == ()


@pytest.mark.parametrize("half", [0.02, 0.05, 0.1])
def test_legs_that_leave_a_point_by_a_narrow_angle_are_not_pressed_apart(half: float) -> None:
    found = hybrid.run(bridle(half))
    assert same(found, hybrid.run(bridle(half) | {"contact": NOT_ASKED}), ("position", "tension")) == 0.0
    assert not any(x["self_contact"].any() for x in found.lines.values())


def bight(away: float) -> Tables:
    """A taut rope from a point, and a loose one whose bight comes back beside that rope, so far (m) from the point."""
    rope = {"mesh": {"cells": 80}, "contact": {"self": False}, "model": "rod"}
    points = [[0, 0, 0], [0, 0, 0.2], [away, 0.01035, 0.2], [away, 0.01035, -0.2], [0.2, 0.2, -0.2]]
    length = float(np.linalg.norm(np.diff(np.array(points, float), axis=0), axis=1).sum())
    taut = {"kind": "straight", "direction": [1, 0, 0]}
    return network_scene(
        {"knot": {"position": [0, 0, 0]}, "e": {"position": [0.8, 0, 0]}, "f": {"position": points[-1]}},
        {"taut": rope | line_between("knot", "e", ROPE | {"length": 0.8}, initial=taut),
         "loose": rope | line_between("knot", "f", ROPE | {"length": length},
                                      initial={"kind": "points", "points": points})},
        gravity=0, time=(0.002, 0.001), output={"points": 21}
    )  # fmt: skip


@pytest.mark.parametrize(("away", "begins"), [(0.02, False), (0.4, True)])
def test_what_lies_against_the_joint_of_another_line_is_no_contact(away: float, begins: bool) -> None:
    """Within six diameters of the point that both are joined to, however far along itself the loose rope is there."""
    assert (BEGINS in kinds(hybrid.run(bight(away)))) == begins


@pytest.mark.parametrize(("begin", "told"), [("knot", False), ("own", True)])
def test_lines_that_come_to_lie_along_each_other_from_a_joint_pass_through_nothing(begin: str, told: bool) -> None:
    """Two taut ropes, of which one is drawn to the end of the other: without a joint in common they meet there."""
    rope = {"mesh": {"cells": 20}, "sections": [ROPE | {"length": 0.8}], "model": "rod"}
    aside = {"travel": {"by": [0, -0.1, 0], "over": 0.2}}
    points = {"knot": {"position": [0, 0, 0]}, "e": {"position": [0.8, 0, 0]}, "own": {"position": [0, 0.1, 0]}}
    points["f"] = {"position": [0.8, 0.1, 0], "motion": aside}
    lines = {"rest": rope | {"start": "knot", "end": "e"}, "drawn": rope | {"start": begin, "end": "f"}}
    tables: Tables = {"environment": {"gravity": 0}, "contact": NOT_ASKED, "time": {"duration": 0.2, "step": 0.005}}
    used = {name: x for name, x in points.items() if any(name in (y["start"], y["end"]) for y in lines.values())}
    found = hybrid.run(tables | {"points": used, "lines": lines, "output": {"points": 5}})
    assert (PASSAGE in kinds(found)) == told


def hung_apart(part: float = 1.0, **more: Any) -> Tables:
    """Ropes held at points of their own cross slowly, 8 diameters, or a part, from two that are 6 diameters apart."""
    tables = unasked(0.3, **more)
    move, near = {"travel": {"by": [0, 0, -0.006], "over": 0.3}}, {"a": [-0.08, -0.03], "c": [-0.08, 0.03]}
    places = {name: [part * x for x in at] for name, at in near.items()} | {"b": [0.72, 0.27], "d": [0.72, -0.27]}
    for name, place in places.items():
        tables["points"][name] = {"position": [*place, 0]}
    for name in "ab":
        tables["points"][name] = {"position": [*tables["points"][name]["position"][:2], 0.012], "motion": move}
    return each_line(tables, sections=[ROPE | {"length": 0.77 + 0.09 * part}])


@pytest.mark.parametrize("part", [1.0, 0.5])
def test_lines_that_are_held_at_points_of_their_own_touch_near_these(part: float) -> None:
    found = hybrid.run(hung_apart(part))
    assert BEGINS in kinds(found) and PASSAGE not in kinds(found)
    assert same(found, hybrid.run(hung_apart(part, contact={})), ("position",)) < 1e-4


def test_a_line_within_itself_is_let_pass_and_the_run_goes_on() -> None:
    tables, turn = unasked(0.6), np.linspace(0.0, 2 * np.pi, 25)
    loop = [[0.0, 0.2 + 0.06 * np.sin(x), 0.06 - 0.06 * np.cos(x)] for x in turn]
    points = [*([0.0, -0.4 + 0.1 * k, 0.0] for k in range(6)), *loop, [0.0, 0.3, 0.0], [0.0, 0.4, 0.0]]
    length = 1.001 * float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())
    tables["lines"]["lower"] |= {"sections": [ROPE | {"length": length}], "initial": {"kind": "points", "points": points},
                                 "contact": {}}  # fmt: skip
    straight = {"kind": "straight", "direction": [1, 0, 0]}
    tables["lines"]["upper"] |= {"sections": [ROPE | {"length": 0.8}], "initial": straight}
    tables["environment"] = {"gravity": 1.0}
    for name in "ab":
        tables["points"][name]["motion"] = {"travel": {"by": [0, 0, -0.15], "over": 0.5}}
    found = hybrid.run(tables)
    assert "line meets itself" in kinds(found) and PASSAGE in kinds(found) and BEGINS not in kinds(found)
    assert same(found, hybrid.run(tables | {"contact": NOT_ASKED}), ("position", "tension")) == 0.0


def three(**more: Any) -> Tables:
    """A third rope comes down on the two after they have met."""
    tables = unasked(**{"time": {"duration": 0.9, "step": 0.004}} | more)
    line = tables["lines"]["upper"]
    tables["points"] |= {
        "e": {"position": [-0.35, 0.2, 0.12], "motion": {"travel": {"by": [0, -0.05, -0.15], "over": 1.0}}},
        "f": {"position": [0.35, -0.2, 0.12], "motion": {"travel": {"by": [0, 0.02, -0.15], "over": 1.0}}},
    }
    tables["lines"]["third"] = line | {"start": "e", "end": "f"}
    return tables


@pytest.mark.long
def test_a_third_line_joins_two_that_touch_already() -> None:
    """What is known of the contact of two lines goes on in that of three.

    Until then the third one is stepped as without the others: the numerical damping of steps in which two touch is theirs.
    """
    found, alone = hybrid.run(three()), three()
    for name in ("upper", "lower"):
        del alone["lines"][name]
    for point in "abcd":
        del alone["points"][point]
    third, before = hybrid.run(alone).lines["third"], found.times < max(e.t for e in found.events if e.kind == BEGINS)
    np.testing.assert_allclose(found.lines["third"].position[before], third.position[before], rtol=0, atol=1e-12)
    assert kinds(found).count(BEGINS) >= 2
    assert len({e.t for e in found.events if e.kind == BEGINS}) >= 2
    assert found.lines["third"]["self_contact"].max() > 1.0
    whole = hybrid.run(three(contact={}))
    for name in ("upper", "lower"):
        x, y = (each.lines[name].tension[before] for each in (found, whole))
        np.testing.assert_allclose(x, y, rtol=1e-9)
    assert same(found, whole) < 5e-3
    told, of = ([e.text for e in x.events if e.kind == "lines touch"] for x in (found, whole))
    assert told == of


def test_contact_that_lets_no_step_lead_on_is_given_up_and_lines_pass(begun: Any, tmp_path: Path) -> None:
    """By hand, because no scene is known in which it happens: the run goes on, says so, and is resumed so."""
    tables = unasked()
    with hybrid.Simulation(tables, tmp_path / "whole.h5") as run:
        run.advance(0.5)
        assert any(part.judge_try(FAILED) for part in run._run.parts)
        assert run._run.model.touching is None
        run.advance(0.8)
        result = run.result()
    assert "contact given up" in kinds(result)
    assert PASSAGE in kinds(result)
    assert kinds(result).count(BEGINS) == 1
    assert same(begun, result, ("position",)) > 1e-3


def test_lines_that_are_asked_to_touch_are_resumed_bit_for_bit(tmp_path: Path) -> None:
    assert kinds(resumed(lowered(0.5), tmp_path, 0.3, 0.4)).count("lines touch") == 1


def test_lines_that_have_met_after_what_was_saved_have_not_met(begun: Any) -> None:
    met = next(e.t for e in begun.events if e.kind == "lines touch")
    with hybrid.Simulation(unasked()) as run:
        run.advance(0.2)
        saved = run.save()
        while run.t < met:  # so that the last step is that in which they do
            run.step()
        run.restore(saved)
        assert not {BEGINS, "lines touch"} & {*kinds(run.result())}


def test_a_line_that_parts_from_itself_as_it_comes_near_another_one_stays_in_contact(begun: Any) -> None:
    with hybrid.Simulation(unasked()) as run:
        run.advance(0.5)
        run._run.lines[0].parts_itself = True  # as if it had been seen in the step in which contact of two lines began
        run._run.loop.counts.notices |= PARTS_ITSELF
        run._run._after_step()
        run.advance(0.8)
        assert same(begun, run.result()) < 1e-9


def moving(tables: Tables) -> Tables:
    return each_line(tables, model={"kind": "adaptive", "tolerance": 1e-3})


def following(tables: Tables) -> Tables:
    return each_line(tables, model={"kind": "adaptive", "curvature_error": 0.05}, mesh={})


def paid(tables: Tables) -> Tables:
    payout = {"rate": 0.01, "ramp": 0.2, "longest": 1.01}  # outputs lie by the longest of either run
    tables["lines"]["upper"]["connections"] = {"end": {"kind": "pinned", "payout": payout}}
    return tables


@pytest.mark.long
@pytest.mark.parametrize("change", [moving, following, paid])
def test_contact_begins_in_lines_whose_cells_come_and_go(change: Callable[[Tables], Tables], tmp_path: Path) -> None:
    found = resumed(change(unasked()), tmp_path, 0.5)
    assert BEGINS in kinds(found) and PASSAGE not in kinds(found)
    assert found.lines["upper"]["self_contact"].max() > 1.0
    upper, lower = (found.lines[x].position for x in ("upper", "lower"))
    apart = np.linalg.norm(upper[:, :, None] - lower[:, None], axis=3).min(axis=(1, 2))
    assert apart.min() > 0.9 * ROPE["diameter"]


@pytest.mark.long  # 1.1 s
def test_other_loads_change_nothing_of_what_touches(begun: Any, tmp_path: Path) -> None:
    tables = unasked(0.5)
    hybrid.run(tables, tmp_path / "half.h5")
    motion = "points.c.motion={travel: {by: [0, 0, 0.01], over: 0.5, begin: 0.5}}"
    found = hybrid.resume(tmp_path / "half.h5", until=0.8, settings=[motion])
    assert "loads change" in kinds(found) and PASSAGE not in kinds(found)
    assert 0.0 < same(begun, found, ("position",)) < 0.05


def write_as_before(patch: pytest.MonkeyPatch) -> None:
    """Let runs be those of a version that computed no contact between lines without being asked."""
    content = run_record.content

    def as_before(run: Any) -> dict[str, Any]:
        kept = content(run)
        kept["state"] = {key: x for key, x in kept["state"].items() if key not in ("let_pass", "between")}
        return kept

    patch.setattr("hybrid.model.network.that_may_meet", lambda *_: ())
    patch.setattr("hybrid.simulation.run_record.content", as_before)


@pytest.mark.long  # 1.0 s
def test_a_file_of_before_goes_on_without_contact(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    with monkeypatch.context() as before:
        write_as_before(before)
        hybrid.run(unasked(0.2), tmp_path / "half.h5")
    found = hybrid.resume(tmp_path / "half.h5", until=0.8)
    assert BEGINS not in kinds(found) and PASSAGE in kinds(found)


def test_an_equilibrium_in_which_lines_have_crossed_says_so() -> None:
    """Looked for from above, the upper rope of a drop of 0.1 m hangs below the lower one where contact is not asked."""
    tables = crossing(0.1)
    del tables["contact"]
    (event,) = (e for e in hybrid.static(tables).events if e.kind == PASSAGE)
    assert "lines upper and lower cross" in event.text and "between: [[upper, lower]]" in event.text
    tables["lines"]["upper"]["initial"] = {"points": [[-0.4, 0, -0.1], [0, 0, -0.5], [0.4, 0, -0.1]]}
    assert PASSAGE not in kinds(hybrid.static(tables))
