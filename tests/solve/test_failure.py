"""Failure inside the loop: found in the step, said with place, cause and remedy, and nothing lost."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import yaml
from problems import StepsOfLine

import hybrid
from hybrid.errors import ComputationError, Outcome
from hybrid.kernels.state.state import Line, State
from hybrid.model.build import build
from hybrid.model.network import NetworkModel, build_network
from hybrid.scene.network import Network
from hybrid.scene.read import one_line, read_text, scene_text
from hybrid.scene.root import in_full
from hybrid.simulation.equilibrium import equilibrium_of, group_of
from hybrid.solve.lines_at_rest import lines_at_rest
from hybrid.solve.network_solver import NO_BODIES
from hybrid.solve.stability import FOLDED, folds
from hybrid.solve.stepper import NetworkState
from tests.said import ONE, both_ways, line_of, of_kind, said
from tests.scenes import cable_scene, clamped_at, pinned_at

SECTION = {"length": 2.0, "mass": 0.5, "bending_stiffness": 0.01, "torsional_stiffness": 0.01}


def scene(model="catenary", **changes):
    """A line hanging between two points, one of which is pushed towards the other."""
    motion = {"surge": {"amplitude": -0.4, "period": 0.8}, "ramp": 0.4}
    data = cable_scene(
        SECTION,
        pinned_at(0, 0, 0),
        pinned_at(1.5, 0, 0, motion=motion),
        model=model,
        mesh=40,
        time=(2.0, 0.01),
        output=0.05,
    )
    return hybrid.validate_scene(data | changes)


@both_ways
def test_a_slack_catenary_stops_the_run(tmp_path, network):
    with pytest.raises(hybrid.ComputationError) as stop:
        hybrid.run(said(scene(), network), tmp_path / "run.h5")
    error = stop.value
    assert error.outcome is hybrid.Outcome.SLACK
    assert 0.0 < error.t < 2.0
    assert 0.0 <= error.s <= 2.0
    assert "rod zone" in str(error)
    kept = hybrid.open(tmp_path / "run.h5")
    assert kept.status == "failed"
    assert "tension" in kept.message
    kept = line_of(kept)
    assert kept.times[-1] == pytest.approx(error.t)
    assert kept.tension[:-1].min() > 0.0
    assert [e.kind for e in kept.events] == ["snap", "slack"]  # it jerks, of 110 N within a step, before it goes slack
    with np.load(error.snapshot) as snapshot:
        assert float(snapshot["t"]) == error.t
        assert snapshot[f"{ONE}/r" if network else "r"].shape == (41, 3)
        read, expected = (
            read_text(x, "")[0]
            for x in (str(snapshot["scene"]), yaml.safe_dump(said(scene(), network), sort_keys=False))
        )
        assert scene_text(read) == scene_text(expected)


def heaving(step, heave=2.0, model="catenary", **time):
    """A tether of 200 m with 10 N at its lower end, whose upper end heaves by so much (m) in 6 s."""
    section = {"length": 200, "mass": 1.0, "diameter": 0.03, "axial_stiffness": 2e6, "bending_stiffness": 20}
    water = {"drag": {"normal": 1.2, "tangential": 0.01}, "added_mass": {"normal": 1.0}}
    motion = {"heave": {"amplitude": heave, "period": 6.0}, "ramp": 6.0}
    return cable_scene(
        section | water,
        pinned_at(0, 0, 0, motion=motion),
        {"kind": "free", "force": [0, 0, -10]},
        fluid={"density": 1025},
        model=model,
        mesh=40,
        time={"duration": 12.0, "step": step} | time,
    )


def test_a_step_too_long_for_waves_is_cut():
    """In steps of 0.2 s the tether would be slack; it keeps 5.8 N as a rod in short ones."""
    fine = hybrid.run(heaving(0.005, model="rod"))
    result = hybrid.run(heaving(0.2) | {"dimension": 3})
    cut = [e for e in result.events if e.kind == "steps cut"]
    assert len(cut) == 1 and 8.0 < cut[0].t < 8.5
    assert "0.2 s" in cut[0].text and "time.step: 0.1 " in cut[0].text
    assert 60 < len(result["steps/t"]) < 80  # few steps are cut
    lowest = float(fine.envelope["tension_min"].min())
    assert lowest == pytest.approx(5.85, abs=0.1)
    assert float(result.envelope["tension_min"].min()) > 0.0


@pytest.mark.parametrize(("step", "blamed"), [(0.05, True), (0.005, False), (0.002, False)])
def test_small_steps_are_tried_before_the_line_is_blamed(step, blamed):
    """It is slack in steps of any length: shorter ones are tried first, and the message says when that proves it.

    None is tried that is shorter than a wave takes to pass a cell, 0.0031 s: the least is between half of that and it,
    or the step of the scene.
    """
    with pytest.raises(hybrid.ComputationError) as stop:
        hybrid.run(heaving(step, heave=3.0) | {"dimension": 3})
    error = stop.value
    assert error.outcome is hybrid.Outcome.SLACK and error.t == pytest.approx(2.76, abs=0.02)
    assert ("the line is slack" in error.detail) is not blamed
    assert ("time.step: 0.0031 from the start" in str(error)) is blamed
    assert ("tried after longer ones" in error.detail) is (step > 0.0031)
    assert "rod zone" in str(error) and "passes a cell in 0.0031 s" in error.detail
    tried = float(error.detail.split("the step of ")[1].split()[0])
    assert 0.5 * min(step, 0.0031) < tried <= min(step, 0.0032)


def test_controlled_steps_are_cut_as_well():
    """The first that leaves the line slack is repeated; the line is slack in the end."""
    with pytest.raises(hybrid.ComputationError) as stop:
        hybrid.run(heaving(None, heave=3.0, tolerance=1.0))
    assert stop.value.outcome is hybrid.Outcome.SLACK
    assert "tried after longer ones" in stop.value.detail


def test_slack_can_be_asked_to_warn():
    result = hybrid.run(scene({"kind": "catenary", "slack": "warn"}, time={"duration": 0.8, "step": 0.01}))
    assert "slack" in {e.kind for e in result.events}
    assert result.status == "complete"


def test_the_same_line_as_a_rod_goes_through():
    elastic = {"sections": [SECTION | {"axial_stiffness": 1e5}]}
    result = hybrid.run(scene("rod", cable=elastic))
    assert result.status == "complete"
    assert result.tension.min() < 0.0  # compression, which a rod can carry


def test_energy_from_nowhere_is_noted_and_stops():
    """An inextensible rod that snaps taut again and again, far too fast for its step, and little damped."""
    with pytest.raises(hybrid.ComputationError) as stop:
        hybrid.run(scene("rod", time={"duration": 2.0, "step": 0.01, "rho_inf": 0.9}))
    assert stop.value.outcome is hybrid.Outcome.GAINS_ENERGY
    assert "fastest point" in str(stop.value)


def surging(path, x, amplitude, period):
    """A record that moves an end from x: a harmonic motion out of reach is refused before it is computed."""
    t = np.linspace(0.0, 4.0, 401)
    rows = np.column_stack([t, x + amplitude * np.sin(2.0 * np.pi * t / period) ** 3, 0.0 * t, 0.0 * t])
    np.savetxt(path / "surge.csv", rows, delimiter=",", header="t,x,y,z", comments="")
    return {"file": str(path / "surge.csv")}


def test_a_cable_pulled_beyond_its_length(tmp_path):
    motion = surging(tmp_path, 1.5, 0.6, 2.0)
    end = {"kind": "pinned", "position": [1.5, 0, 0], "motion": motion}
    with pytest.raises(hybrid.ComputationError, match="does not stretch beyond 2 m"):
        hybrid.run(scene("rod", ends={"start": {"kind": "pinned", "position": [0, 0, 0]}, "end": end}))


HUNG = {"length": 50.0, "mass": 20.0, "axial_stiffness": 1e5}  # 9.8 kN of weight: 9.8 % of strain at the top


def hung(**more):
    """A line that hangs from its start; by default its weight stretches it beyond 5 %."""
    return hybrid.validate_scene(
        cable_scene(HUNG | more, pinned_at(0, 0, 0), {"kind": "free"}, model="catenary", mesh=50)
    )


def test_an_equilibrium_that_no_section_bears_is_refused():
    with pytest.raises(hybrid.ComputationError) as stop:
        hybrid.static(hung())
    error = stop.value
    assert error.outcome is hybrid.Outcome.OVERSTRETCHED and error.t is None
    assert error.s == pytest.approx(0.0, abs=1.0)
    assert "max_strain" in error.detail and "axial_stiffness (N)" in str(error)
    assert "N" in error.detail
    assert hybrid.static(hung(max_strain=0.1)).status == "complete"
    assert hybrid.static(hung(axial_stiffness=None)).status == "complete"


def test_a_line_that_is_pulled_beyond_what_it_bears_stops(tmp_path):
    """Stretched by 4 % at rest; its end moves on until it is 7 %."""
    line = {"length": 10.0, "mass": 1.0, "axial_stiffness": 1e5}
    motion = surging(tmp_path, 20.8, 0.6, 8.0)
    data = cable_scene(
        [line, line | {"max_strain": 0.2}],
        pinned_at(0, 0, 0),
        pinned_at(20.8, 0, 0, motion=motion),
        gravity=0.0,
        model="catenary",
        mesh=20,
        time=(2.0, 0.01),
    )
    with pytest.raises(hybrid.ComputationError) as stop:
        hybrid.run(data, tmp_path / "run.h5")
    error = stop.value
    assert error.outcome is hybrid.Outcome.OVERSTRETCHED
    assert 0.5 < error.t < 1.0 and 0.0 <= error.s < 10.0  # of the section that bears less, when the ends are 21 m apart
    assert "max_strain is 5 %" in error.detail
    kept = hybrid.open(tmp_path / "run.h5")
    assert kept.status == "failed" and kept.times[-1] == pytest.approx(error.t)
    assert [e.kind for e in kept.events] == ["overstretched"]
    data["cable"]["sections"][0]["max_strain"] = 0.07
    assert hybrid.run(data | {"time": {"duration": 1.0, "step": 0.01}}).status == "complete"
    data["cable"]["sections"][0]["max_strain"] = 0.03  # less than at rest
    with pytest.raises(hybrid.SceneError, match=r"at most 20\.6 m from the start"):
        hybrid.run(data)


def test_a_strut_that_is_pushed_beyond_what_it_bears_stops(tmp_path):
    """A stiff rod of 10 m between two ends of which one moves in by 0.6 m: 5 % are borne, and 1.2 m were silent once."""
    strut = {"length": 10.0, "mass": 1.0, "axial_stiffness": 1e5, "bending_stiffness": 1e7}
    held = {"kind": "clamped", "tangent": [1, 0, 0]}
    data = cable_scene(
        strut, held | {"position": [0, 0, 0]},
        held | {"position": [10.0, 0, 0], "motion": {"travel": {"by": [-0.6, 0, 0], "over": 2.0}}}, gravity=0.0,
        model="rod", mesh=10, time=(2.0, 0.01)
    )  # fmt: skip
    with pytest.raises(hybrid.ComputationError) as stop:
        hybrid.run(data, tmp_path / "run.h5")
    assert stop.value.outcome is hybrid.Outcome.OVERSTRETCHED and "a strain of -5" in stop.value.detail
    assert 1.3 < stop.value.t < 1.7
    strut["max_strain"] = 0.07
    assert hybrid.run(data).status == "complete"
    data["ends"]["end"] = held | {"position": [9.2, 0, 0]}
    with pytest.raises(hybrid.ComputationError) as stop:
        hybrid.static(data)
    assert stop.value.outcome is hybrid.Outcome.OVERSTRETCHED and "a strain of -8 %" in stop.value.detail


@pytest.mark.parametrize("field", ["e", "v", "T", "a1"])
def test_a_number_that_is_not_finite_is_found_at_once(field):
    model = build(one_line(scene("rod")))
    steps = StepsOfLine(model)
    old = model.start.copy()
    getattr(old, field)[17] = np.nan
    taken = steps.step(0.0, old, old.copy(), 0.01, 0.5, 0.0)
    assert taken.outcome in (hybrid.Outcome.NOT_FINITE, hybrid.Outcome.TURNED_TOO_FAR)
    assert taken.iterations <= 1


def test_a_force_beyond_all_steps_is_said():
    """The largest force that is read, on 1 kg: no step is small enough, and the error says where and when."""
    free = {"kind": "free", "force": [0.0, 4.9e7, 0.0]}
    ends = {"start": {"kind": "pinned", "position": [0, 0, 0]}, "end": free}
    with pytest.raises(hybrid.ComputationError) as stop:
        hybrid.run(scene("rod", ends=ends, initial={"kind": "straight", "direction": [1, 0, 0]}))
    assert stop.value.t == 0.0
    assert stop.value.s is not None


def test_nothing_holds_the_line():
    """A slack, weightless catenary between two points has no equilibrium; nothing gives it a shape."""
    ends = {"start": {"kind": "pinned", "position": [0, 0, 0]}, "end": {"kind": "pinned", "position": [1.0, 0, 0]}}
    with pytest.raises(hybrid.ComputationError) as stop:
        hybrid.static(scene(environment={"gravity": 0.0}, ends=ends))
    assert stop.value.t is None
    assert stop.value.outcome is not hybrid.Outcome.OK


def test_a_coarse_bend_is_noted():
    """A cantilever rolled up on eight cells bends by 90 degrees from cell to cell."""
    ends = {"start": clamped_at([0, 0, 0], [1, 0, 0]), "end": {"kind": "free", "moment": [0.0, 0.01 * 2 * np.pi, 0.0]}}
    result = hybrid.static(scene("rod", environment={"gravity": 0.0}, ends=ends, mesh={"cells": 5}, time=None))
    assert {e.kind for e in result.events} == {"unresolved bend", "stability not judged"}
    assert any("would do" in e.text for e in result.events)


def test_undamped_inextensible_is_noted():
    straight = {"kind": "straight", "direction": [0, 0, -1]}
    ends = {"start": {"kind": "pinned", "position": [0, 0, 0]}, "end": {"kind": "free"}}
    short = {"duration": 0.1, "step": 0.01, "rho_inf": 1.0}
    result = hybrid.run(scene(ends=ends, initial=straight, time=short))
    assert [e.kind for e in result.events] == ["undamped"]


def test_outputs_that_wait_are_written_before_a_run_stops(tmp_path):
    """A load falls into an unstretched rope, which bears its weight but not its fall: no output before that is missing."""
    section = {"length": 10.0, "mass": 0.1, "axial_stiffness": 4e4, "max_strain": 0.02}
    scene = cable_scene(
        section, pinned_at(0, 0, 0), "free", attachments=[{"kind": "clump", "at": 10.0, "mass": 50.0}],
        initial={"kind": "straight", "direction": [0, 0, -1]}, model={"kind": "catenary", "slack": "warn"}, mesh=20,
        time=(1.0, 0.005), output=0.01
    )  # fmt: skip
    with pytest.raises(hybrid.ComputationError) as caught:
        hybrid.run(scene, tmp_path / "run.h5")
    assert caught.value.outcome is hybrid.Outcome.OVERSTRETCHED
    with hybrid.open(tmp_path / "run.h5") as result:
        t = np.asarray(result.times)
    due = np.arange(0.0, caught.value.t + 1e-9, 0.01)
    assert t.size > 5 and np.isin(np.round(due, 9), np.round(t, 9)).all()


# --- Folds of more than a right angle between two cells of a cable: a line hangs in a tight one, and none stands on
# one ---


def hairpin(cells: int, model: str = "rod", apart: float = 0.0, **more: Any) -> dict[str, Any]:
    """A line of 20 m between points next to each other, which bends over (EI/w)^(1/3) = 0.3 m where it is a rod."""
    section = {"length": 20.0, "mass": 1.0, "diameter": 0.01, "bending_stiffness": 0.25}
    ends = {"start": pinned_at(0, 0, 0), "end": pinned_at(apart, 0, 0)}
    cable = {"sections": [section]} | more
    return {"cable": cable, "ends": ends, "initial": "equilibrium", "model": model, "mesh": {"cells": cells}}


def model_of(tables: dict[str, Any]) -> tuple[Network, NetworkModel]:
    network = in_full(hybrid.validate_scene(tables))
    return network, build_network(network)


def rest_of(tables: dict[str, Any]) -> tuple[Line, State]:
    network, model = model_of(tables)
    return model.models[0].line, equilibrium_of(network, model, 0.0).state.lines[0]


def test_no_rod_stands_on_a_fold() -> None:
    """Newton's first answer on 21 cells turns by 173 deg into a cell that presses with 10.1 N, more than its weight."""
    _, model = model_of(hairpin(21))
    first = NetworkState([model.models[0].start])
    with pytest.raises(ComputationError) as refused:
        lines_at_rest(group_of(model, 0.0, NO_BODIES), [("the first shape", first)], quick=True)
    assert refused.value.outcome == Outcome.FOLDED
    assert refused.value.s == pytest.approx(10.0, abs=2.0)
    assert "would show the bend" in str(refused.value)
    line, state = rest_of(hairpin(21))
    assert state.T.min() > -9.81 * 20.0 / 21.0
    assert np.degrees(folds(line, state).max()) == pytest.approx(98.5, abs=1.0)
    assert state.r[:, 2].min() == pytest.approx(-10.0, abs=0.5)


@both_ways
@pytest.mark.parametrize(("kind", "lowest"), [("rod", -9.98), ("catenary", -9.99)])
def test_a_line_that_hangs_in_a_fold_is_right_to_a_cell_and_says_so(kind: str, lowest: float, network: bool) -> None:
    """It turns within 0.3 m, which 20 cells of 1 m do not show, and 200 do."""
    found = hybrid.static(said(hairpin(20, kind, 0.4), network))
    (event,) = of_kind(found, "unresolved bend")
    assert event.s_a == pytest.approx(10.0) and (f"line {ONE}" in event.text) is network
    assert "cells of" in event.text if kind == "rod" else "add cells" in event.text or "cells of" in event.text
    assert line_of(found).position[-1][:, 2].min() == pytest.approx(lowest, abs=0.05)
    assert kind != "rod" or folds(*rest_of(hairpin(200, kind, 0.4))).max() < 0.5 * np.pi


@pytest.mark.parametrize("model", ["rod", "catenary"])
def test_a_point_load_makes_a_true_kink(model: str) -> None:
    """A clump, in air, and a float without mass, in water that nothing drags, pull a line into two strands."""
    clump = {"attachments": [{"kind": "clump", "at": 10.0, "mass": 100.0}]}
    line, state = rest_of(hairpin(20, model, 0.4, **clump))
    chords = state.e / np.linalg.norm(state.e, axis=1)[:, None]
    assert chords[9] @ chords[10] < np.cos(FOLDED)
    assert folds(line, state)[10] == 0.0
    assert "unresolved bend" not in {
        event.kind for event in hybrid.static(hairpin(20, "catenary", 0.4, **clump)).events
    }


def test_a_float_without_mass_is_a_point_load() -> None:
    lift = {"attachments": [{"kind": "float", "at": 10.0, "buoyancy": 2000.0}]}
    tables = hairpin(20, "rod", 0.4, **lift) | {"environment": {"fluid": {"density": 1000.0}}}
    line, state = rest_of(tables)
    chords = state.e / np.linalg.norm(state.e, axis=1)[:, None]
    assert chords[9] @ chords[10] < np.cos(FOLDED)
    assert folds(line, state)[10] == 0.0
