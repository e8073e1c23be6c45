"""Dynamics of long cables that are taut almost everywhere and slack somewhere.

A taut cable is a flexible catenary; where tension drops, bending and torsion rule and the
cable is a Kirchhoff rod.  `hybrid` computes both in one line, with joints between them.

    scene  = hybrid.load_scene("scene.yaml")
    result = hybrid.run(scene, output="run.h5")
    result.tension                 # (nt, ns), N

Names are imported when first used, so that `import hybrid` costs nothing.
"""
# ruff: noqa: F401  # of names that are imported when first used

from __future__ import annotations

import warnings
from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from hybrid.accuracy.passes import resume, run, static
    from hybrid.accuracy.run_forecast import plan
    from hybrid.couple.fmu_export import export_fmu
    from hybrid.designs.design import design, openmdao_component
    from hybrid.designs.nearest import seek
    from hybrid.designs.sensitivity import sensitivity, shares
    from hybrid.errors import ComputationError, HybridError, Outcome, ResultError, SceneError
    from hybrid.exports.api import export
    from hybrid.interop.moordyn import export_moordyn, import_moordyn
    from hybrid.modal.api import modes, response
    from hybrid.scene.read import load_scene, parse_scene, scene_text, validate_scene
    from hybrid.scene.read import load_scene as load_system  # deprecated
    from hybrid.scene.root import Scene
    from hybrid.scene.root import Scene as System  # deprecated
    from hybrid.simulation.lines_stiffness import offsets, stiffness
    from hybrid.simulation.own_parts import RunPart, RunView
    from hybrid.simulation.run_quantities import kinds_of_quantities, listed_outputs
    from hybrid.simulation.stepping import Simulation
    from hybrid.simulation.stepping import Simulation as SystemSimulation  # deprecated
    from hybrid.store.reader import Result
    from hybrid.store.reader import open_result as open
    from hybrid.store.study_file import open_study
    from hybrid.studies.study import case_of as study_case
    from hybrid.studies.study import study
    from hybrid.studies.tradeoff import trade, trade_levels
    from hybrid.view.quantities import plot_energy, plot_quantity, plot_shape, plot_zone_map, plot_zones
    from hybrid.view.quantities import plot_summary as plot
    from hybrid.view.report import plot_space
    from hybrid.view.report import write_report as report
    from hybrid.view.several_runs import write_comparison as compare
    from hybrid.zones.manager import NodeState

# Public names by the file that has them, and what those are called there that have another name.
_FILES = {
    "accuracy.passes": ("resume", "run", "static"),
    "accuracy.run_forecast": ("plan",),
    "couple.fmu_export": ("export_fmu",),
    "designs.design": ("design", "openmdao_component"),
    "designs.nearest": ("seek",),
    "designs.sensitivity": ("sensitivity", "shares"),
    "errors": ("ComputationError", "HybridError", "Outcome", "ResultError", "SceneError"),
    "exports.api": ("export",),
    "interop.moordyn": ("export_moordyn", "import_moordyn"),
    "modal.api": ("modes", "response"),
    "scene.read": ("load_scene", "parse_scene", "scene_text", "validate_scene"),
    "scene.root": ("Scene",),
    "simulation.lines_stiffness": ("offsets", "stiffness"),
    "simulation.own_parts": ("RunPart", "RunView"),
    "simulation.run_quantities": ("kinds_of_quantities", "listed_outputs"),
    "simulation.stepping": ("Simulation",),
    "store.reader": ("Result", "open"),
    "store.study_file": ("open_study",),
    "studies.study": ("study", "study_case"),
    "studies.tradeoff": ("trade", "trade_levels"),
    "view.several_runs": ("compare",),
    "view.quantities": ("plot", "plot_energy", "plot_quantity", "plot_shape", "plot_zone_map", "plot_zones"),
    "view.report": ("plot_space", "report"),
    "zones.manager": ("NodeState",),
}
_THERE = {
    "open": "open_result",
    "study_case": "case_of",
    "compare": "write_comparison",
    "plot": "plot_summary",
    "report": "write_report",
}
_HOME = {name: file for file, names in _FILES.items() for name in names}

__all__ = list(_HOME)

# public names that have changed: the old one still works
_FORMER = {"Look": "NodeState", "System": "Scene", "SystemSimulation": "Simulation", "load_system": "load_scene"}


def __getattr__(name: str) -> Any:
    if name == "__version__":
        from importlib.metadata import version

        return version("hybrid-cable")
    if name in _FORMER:
        warnings.warn(f"hybrid.{name} is now hybrid.{_FORMER[name]}", DeprecationWarning, stacklevel=2)
        return getattr(import_module("hybrid"), _FORMER[name])
    if name not in _HOME:
        raise AttributeError(f"module 'hybrid' has no attribute {name!r}")
    value = getattr(import_module(f"hybrid.{_HOME[name]}"), _THERE.get(name, name))
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return [*__all__, "__version__"]
