"""Steps that `hybrid plan` foretells where they follow the motion."""

from __future__ import annotations

from pathlib import Path

import pytest

import hybrid
from hybrid.accuracy import run_forecast
from hybrid.accuracy.run_forecast import Seen, _cost_of_a_step, _steps_a_second, _still_to_come
from hybrid.cli.plan_tables import plan_rows
from hybrid.scene.root import LINE, in_full

EXAMPLES = Path(__file__).parents[2] / "examples"


def scene(accuracy: str, *settings: str) -> hybrid.Scene:
    return hybrid.load_scene(
        EXAMPLES / "rov_tether.yaml", [f"accuracy={accuracy}", "mesh=null", "time={duration: 30}", *settings]
    )


@pytest.mark.long
def test_steps_are_about_those_of_the_run() -> None:
    for accuracy in ("3%", "0.3%"):
        run, foretold = hybrid.run(scene(accuracy)), hybrid.plan(scene(accuracy)).steps
        assert 0.5 < len(run["steps/t"]) / foretold < 2.0


def test_a_finer_result_costs_more() -> None:
    """Steps of third order in their error, of which 1.5 orders of what is asked."""
    coarse, fine = (hybrid.plan(scene(x), measure=False) for x in ("1%", "0.01%"))
    assert fine.steps == pytest.approx(10.0 * coarse.steps, rel=0.15)
    assert fine.seconds > 10.0 * coarse.seconds


def test_a_network_of_one_line_has_the_plan_of_its_cable() -> None:
    """With what each model would cost, where the program chooses one."""
    asked = scene("1%", "model=adaptive")
    of_cable = hybrid.plan(asked, measure=False)
    assert of_cable.choice and hybrid.plan(in_full(asked), measure=False).lines[LINE] == of_cable


@pytest.mark.parametrize(
    ("name", "own"), [("rov_tether", "mesh"), ("laying_winch", "payout"), ("armoured_cable", "hockling")]
)
def test_its_words_are_those_of_the_cable(name: str, own: str) -> None:
    """What zones that move may need, how a line is paid out, and when it throws a loop."""
    asked = hybrid.load_scene(EXAMPLES / f"{name}.yaml", ["model=adaptive", "mesh=null"] * (own == "mesh"))
    said = []
    for form in (asked, in_full(asked)):
        rows = plan_rows(form, hybrid.plan(form, measure=False))
        text = " ".join(" ".join(rows).split())
        said.append({key: text[text.index(key) + len(key) :] for key in (own, "forces", "accuracy")})
    for key in said[0]:
        begin = said[0][key][:40]
        assert said[1][key].startswith(begin), key


def test_what_the_first_steps_show_is_in_the_plan() -> None:
    """Cells that the mesh pre-run grades, and steps, are those of the result; without it they come from tables."""
    asked = scene("3%")
    hybrid.run(asked)  # compiles what it needs
    plan, guess = hybrid.plan(asked), hybrid.plan(asked, measure=False)
    ((_, line),) = plan.each_line()
    with hybrid.run(asked) as result:
        first = result.attributes["cells"] if result.attributes["effort_runs"] == line.runs - 1 else None
        ((_, of_line),) = result.each_line()
        assert 0.7 < len(of_line["steps/t"]) / plan.steps < 1.8
    assert plan.measured and not guess.measured
    assert first is None or sum(line.cells) == first
    assert plan.most_seconds is not None and plan.most_seconds > plan.seconds > 0.0


def test_layers_of_lines_are_in_the_plan() -> None:
    """Cells beside a float are as short as the bend there: 100 were said of 133."""
    section = {"length": 150, "mass": 0.8, "diameter": 0.025, "axial_stiffness": 2e6, "bending_stiffness": 20}
    points = {"top": {"position": [0, 0, 0]}, "low": {"initial_guess": [10, 0, -55], "mass": 900, "volume": 0.86}}
    floating = [{"kind": "float", "at": 75, "mass": 20, "buoyancy": 420}]
    line = {"start": "top", "end": "low", "model": "rod", "sections": [section], "attachments": floating}
    fluid, time = {"fluid": {"density": 1025, "surface": 0}}, {"duration": 1, "step": 0.1}
    asked = {"environment": fluid, "points": points, "lines": {"one": line}, "time": time}
    cells = hybrid.run(asked).attributes["cells"]
    assert hybrid.plan(asked).cells == cells != hybrid.plan(asked, measure=False).cells


def test_a_pre_run_that_is_cut_leaves_a_plan(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("PRE_RUN", "CHOICE"):
        monkeypatch.setattr(f"hybrid.accuracy.run_forecast.{name}", 0.0)
    plan = hybrid.plan(scene("3%"))
    assert plan.measured and plan.steps > 0 and plan.seconds > 0.0


@pytest.mark.long
@pytest.mark.parametrize("settled", [0, 1000])
def test_a_few_first_steps_do(settled: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Those of the shortest budget foretell the steps of a line that is paid out, and no later ones are shorter."""
    asked = hybrid.load_scene(EXAMPLES / "laying.yaml", ["accuracy=null", "time={duration: 80}"])
    monkeypatch.setattr(run_forecast, "FIRST_STEPS", 0.0)
    monkeypatch.setattr(run_forecast, "SETTLED", settled)
    foretold, run = hybrid.plan(asked), hybrid.run(asked)
    assert foretold.measured and 0.4 < foretold.steps / len(run["steps/t"]) < 2.5


def test_what_is_done_once_is_no_cost_of_a_step() -> None:
    """40 s of compiling in the first 20 of 500 steps, which are short; the others take 1 ms and 0.1 s of the motion."""
    seen = [Seen(1.0, 0, 0.0), Seen(41.0, 20, 0.02), Seen(41.2, 220, 20.02), Seen(41.48, 500, 48.02)]
    assert _cost_of_a_step(seen) == pytest.approx(1e-3)
    assert _steps_a_second(seen) == pytest.approx(10.0)
    assert _still_to_come(seen, 148.02) == pytest.approx(1.0)
    assert _cost_of_a_step(seen[:1]) == 0.0


def test_first_steps_of_lines_are_measured_too() -> None:
    section = {"length": 12, "mass": 2, "diameter": 0.03, "axial_stiffness": 1e6}
    points = {"low": {"position": [0, 0, 0]}, "high": {"position": [20, 0, 0]}}
    points["joint"] = {"kind": "free", "mass": 5, "initial_guess": [10, 0, -3]}
    lines = {
        name: {"start": a, "end": b, "model": "catenary", "sections": [section]}
        for name, a, b in (("one", "low", "joint"), ("two", "joint", "high"))
    }
    asked = {"points": points, "lines": lines, "time": {"duration": 1, "step": 0.1}}
    hybrid.run(asked)
    plan = hybrid.plan(asked)
    assert plan.measured and plan.steps == 10 and plan.seconds > 0.0


def test_steps_of_fixed_length_are_counted() -> None:
    assert hybrid.plan(scene("1%", "time={duration: 30, step: 0.25}")).steps == 120


def test_a_line_that_is_to_touch_itself_is_planned_dearer() -> None:
    """The first steps show nothing of the contact: expected and at most are apart."""
    hybrid.run(hybrid.load_scene(EXAMPLES / "plectoneme.yaml", ["time.duration=0.1"])).close()  # what is compiled
    touching = hybrid.plan(EXAMPLES / "plectoneme.yaml")
    assert touching.measured and touching.most_seconds > 1.5 * touching.seconds
    alone = hybrid.plan(hybrid.load_scene(EXAMPLES / "plectoneme.yaml", ["contact.self=false"]))
    assert alone.measured and alone.most_seconds == alone.seconds


def test_a_line_that_is_paid_out_from_few_cells_on() -> None:
    """A step of ten cells is mostly what any step costs, so steps of 250 are not 25 times as dear: 8.8 s were said."""
    found = hybrid.plan(EXAMPLES / "rov_descent.yaml", measure=False)
    assert found.payout is not None and found.payout.mean_cells > 10 * sum(found.cells)
    assert run_forecast._dearer([found]) < 0.6 * found.payout.mean_cells / sum(found.cells)
