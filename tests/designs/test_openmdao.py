"""The component of OpenMDAO: its derivatives, and the optimum of `hybrid design` by an optimiser of OpenMDAO."""

from __future__ import annotations

import sys
from pathlib import Path

import extras
import numpy as np
import pytest

from tests.scenes import cable_scene, clamped_at, pinned_at

pytestmark = extras.of_file("openmdao")

import openmdao.api as om

import hybrid
from hybrid.scene.study import DESIGN
from tests.designs.test_design import HANGING, LENGTH, MASS, TOP

EXAMPLES = Path(__file__).parents[2] / "examples"
ROD = cable_scene(
    {"length": 110.0, "mass": 9.0, "diameter": 0.06, "axial_stiffness": 1e7, "bending_stiffness": 800.0,
     "torsional_stiffness": 800.0, "drag": {"normal": 1.2}},
    clamped_at([0, 0, 0], [1, 0, 0.2]), pinned_at(90.0, 0, 20.0), fluid={"density": 1025.0, "current": [0.2, 0.1, 0.0]},
    model="rod", mesh=60
)  # fmt: skip


@pytest.fixture(autouse=True)
def _elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """OpenMDAO writes folders where it runs."""
    monkeypatch.chdir(tmp_path)


def problem_of(component: object) -> om.Problem:
    problem = om.Problem(reports=False)
    problem.model.add_subsystem("line", component, promotes=["*"])
    problem.driver = om.ScipyOptimizeDriver(optimizer="SLSQP", tol=1e-9, disp=False)
    problem.setup(force_alloc_complex=False)
    problem.run_model()
    return problem


def errors_of(problem: om.Problem, **how: object) -> dict[tuple[str, str], float]:
    """Largest difference of each partial to a central difference of equilibria, in parts of it."""
    (found,) = problem.check_partials(out_stream=None, method="fd", form="central", **how).values()
    return {
        key: float(np.abs(x["J_fwd"] - x["J_fd"]).max() / max(np.abs(x["J_fd"]).max(), 1e-12))
        for key, x in found.items()
    }


@pytest.mark.long
def test_partials_are_those_of_differences():
    component = hybrid.openmdao_component(
        ROD,
        unknowns={
            "length": {"key": LENGTH}, "mass": {"key": MASS}, "drag": {"key": "cable.sections[0].drag.normal"},
            "EI": {"keys": ["cable.sections[0].bending_stiffness", "cable.sections[0].torsional_stiffness"]},
            "x": {"key": "ends.end.position[0]"},
        },
        cases={"slow": {}, "fast": {"environment.fluid.current": [0.5, 0.1, 0.0]}},
        results={
            "top": {"quantity": "tension", "at": "end", "case": "fast"},
            "bend": {"quantity": "curvature", "take": "max", "case": "slow"},
            "pull": {"quantity": "reaction_start.x", "case": "slow"},
            "middle": {"quantity": "position.z", "at": 60, "case": "fast"},
        },
        minimise="top / 1000 + length**2",
    )  # fmt: skip
    problem = problem_of(component)
    errors = errors_of(problem, step=1e-5, step_calc="rel_avg")
    assert len(errors) == 5 * 5 and max(errors.values()) < 1e-4
    units = {name: meta["units"] for name, meta in component.get_io_metadata(metadata_keys=["units"]).items()}
    assert units == {
        "length": "m", "mass": "kg/m", "drag": None, "EI": "N*m**2", "x": "m", "top": "N", "bend": "1/m", "pull": "N",
        "middle": "m", "minimised": None,
    }  # fmt: skip
    alone = {(x.of, x.by): x.derivative for x in hybrid.sensitivity(ROD, ["reaction_start.x"], [MASS])}
    assert problem.compute_totals(["pull"], ["mass"])["pull", "mass"].item() == pytest.approx(
        alone["reaction_start.x", MASS], rel=1e-9
    )


def test_an_optimum_is_that_of_the_design():
    """In a model of its own: the cost is the user's component, the line one of two."""
    unknowns = {"mass": {"key": MASS, "low": 1, "high": 20}, "length": {"key": LENGTH, "low": 10, "high": 90}}
    ours = hybrid.design(
        HANGING, unknowns=unknowns, limits={"top": TOP | {"largest": 1962.0}},
        minimise="(mass - 6)**2 + ((length - 50) / 10)**2",
    )  # fmt: skip
    problem = om.Problem(reports=False)
    line = hybrid.openmdao_component(HANGING, unknowns=unknowns, results={"top": TOP})
    problem.model.add_subsystem("line", line, promotes=["*"])
    cost = om.ExecComp("cost = (mass - 6)**2 + ((length - 50) / 10)**2", mass={"units": "kg/m"}, length={"units": "m"})
    problem.model.add_subsystem("price", cost, promotes=["*"])
    problem.model.set_input_defaults("mass", 5.0, units="kg/m")
    problem.model.set_input_defaults("length", 40.0, units="m")
    problem.model.add_design_var("mass", lower=1, upper=20)
    problem.model.add_design_var("length", lower=10, upper=90)
    problem.model.add_constraint("top", upper=1.962, units="kN")
    problem.model.add_objective("cost")
    problem.driver = om.ScipyOptimizeDriver(optimizer="SLSQP", tol=1e-10, disp=False)
    problem.setup()
    assert problem.run_driver().exit_status != "FAIL"
    for name in unknowns:
        assert problem.get_val(name).item() == pytest.approx(ours.numbers[name], rel=1e-5)
    assert problem.get_val("top").item() == pytest.approx(1962.0, rel=1e-6)


@pytest.mark.long
def test_a_design_states_its_own_problem():
    """Buoyancy of a lazy wave in three cases: bounds, limits and what is minimised are those of its file, with bounds

    within which all lines reach: drivers of scipy do not go back where there is no equilibrium.
    """
    file = DESIGN.read(EXAMPLES / "designs" / "lazy_wave.yaml").asked
    unknowns = dict(file.unknowns)
    for name, low, high in (("lower", 110, 140), ("buoyant", 25, 60), ("upper", 85, 105)):
        unknowns[name] = unknowns[name].model_copy(update={"low": low, "high": high})
    asked = file.model_copy(update={"unknowns": unknowns})
    problem = problem_of(hybrid.openmdao_component(asked, driven=True))
    assert problem.get_val("bend").shape == (9,)  # three sections in three cases
    assert problem.run_driver().success
    ours = hybrid.design(file)
    assert problem.get_val("minimised").item() == pytest.approx(ours.minimised, rel=1e-4)
    assert problem.get_val("bend").max() <= 0.08 * (1 + 1e-5)
    assert problem.get_val("sag").min() >= -80.0 * (1 + 1e-5)


def test_a_target_is_an_equality():
    problem = problem_of(
        hybrid.openmdao_component(
            HANGING, unknowns={"length": {"key": LENGTH, "low": 10, "high": 90}}, targets={"top": TOP | {"value": 3000.0}},
            minimise="length", driven=True,
        )
    )  # fmt: skip
    problem.run_driver()
    assert problem.get_val("length").item() == pytest.approx(3000.0 / 5.0 / 9.81, rel=1e-6)


@pytest.mark.long
def test_several_lines():
    design = EXAMPLES / "designs" / "pretension.yaml"
    problem = problem_of(hybrid.openmdao_component(design))
    assert max(errors_of(problem, step=1e-4, step_calc="abs").values()) < 1e-4


def test_a_motion():
    """Forward differences of runs, 0.01 % of a number, beside those of fourth order."""
    scene = HANGING | {
        "cable": {"sections": [{"length": 10.0, "mass": 5.0, "axial_stiffness": 1e5}]},
        "initial": {"kind": "straight", "origin": [0, 0, 0], "direction": [0, 0, -1]},
        "time": {"duration": 0.15, "step": 0.005},
    }  # fmt: skip
    component = hybrid.openmdao_component(
        scene, unknowns={"mass": {"key": MASS}}, results={"pull": TOP | {"over": "mean"}}
    )
    problem = problem_of(component)
    found = problem.compute_totals(["pull"], ["mass"])["pull", "mass"].item()
    (exact,) = hybrid.sensitivity(scene, ["mean tension@start"], [MASS], motion=True)
    assert found == pytest.approx(exact.derivative, rel=2e-3)


@pytest.mark.parametrize("length", [80.0, -5.0])
def test_what_has_no_equilibrium_is_an_analysis_error(length: float):
    """Of 80 m between ends that are 92 m apart, which would stretch by 15 %, or of no length."""
    short = ROD | {"model": "catenary", "mesh": {"cells": 20}}
    short["ends"] = ROD["ends"] | {"start": {"kind": "pinned", "position": [0, 0, 0]}}
    component = hybrid.openmdao_component(
        short, unknowns={"length": {"key": LENGTH, "low": -10}}, results={"top": {"quantity": "tension", "at": "end"}}
    )
    problem = problem_of(component)
    assert problem.get_val("top").item() > 0.0
    problem.set_val("length", length)
    with pytest.raises(om.AnalysisError, match=r"would stretch|length"):
        problem.run_model()
    problem.set_val("length", 110.0)
    problem.run_model()  # it goes on


@pytest.mark.parametrize(
    "more, what",
    [
        ({"unknowns": {LENGTH: {}}, "results": {"top": TOP}}, "letters and digits"),
        ({"unknowns": {"top": {"key": LENGTH}}, "limits": {"top": TOP | {"largest": 1.0}}}, "a name of its own"),
        ({"unknowns": {"a": {"key": LENGTH}}, "results": {"b": {"quantity": "speed", "at": 0}}}, "one of"),
        ({"unknowns": {"a": {"key": "mesh.cells"}}, "results": {"top": TOP}}, "a key of what is there"),
        ({"unknowns": {"a": {"key": LENGTH}}, "measured": {"file": "shape.csv"}}, "an identification has no outputs"),
        ({"unknowns": {"a": {"key": LENGTH}}, "results": {"b": {"quantity": "touchdown_position"}}}, "changes evenly"),
        (
            {"unknowns": {"a": {"key": LENGTH}}, "targets": {"b": {"quantity": "touchdown", "value": 9}}},
            "changes evenly",
        ),
    ],
)
def test_refusals(more: dict, what: str):
    with pytest.raises(hybrid.SceneError, match=what):
        hybrid.openmdao_component(HANGING, **more)


def test_without_openmdao_it_says_what_to_install(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setitem(sys.modules, "openmdao.api", None)
    with pytest.raises(hybrid.ResultError, match=r"hybrid-cable\[openmdao\]"):
        hybrid.openmdao_component(HANGING, unknowns={"length": {"key": LENGTH}}, results={"top": TOP})


def test_numbers_of_tables_are_inputs() -> None:
    from hybrid.designs.openmdao_component import _units

    assert _units("1/m, N m") is None and _units("N m^2") == "N*m**2"
