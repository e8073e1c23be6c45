"""Dynamics of long cables that are taut almost everywhere and slack somewhere.

A taut cable is a flexible catenary; where tension drops, bending and torsion rule and the
cable is a Kirchhoff rod.  `hybrid` computes both in one line, with joints between them.

    scene  = hybrid.load_scene("scene.yaml")
    result = hybrid.run(scene, output="run.h5")
    result.tension                 # (nt, ns), N

Names are imported when first used, so that `import hybrid` costs nothing.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from hybrid.accuracy.api import resume, run, static
    from hybrid.accuracy.run_forecast import plan
    from hybrid.couple.fmu_export import export_fmu
    from hybrid.designs.design import design, openmdao_component
    from hybrid.designs.nearest import seek
    from hybrid.designs.sensitivity import sensitivity
    from hybrid.designs.shares import shares
    from hybrid.errors import ComputationError, HybridError, Outcome, ResultError, SceneError
    from hybrid.exports.api import export
    from hybrid.interop.moordyn import export_moordyn, import_moordyn
    from hybrid.modal.api import modes, response
    from hybrid.scene.read import load_scene, parse_scene, scene_text, validate_scene
    from hybrid.scene.read import load_scene as load_system  # noqa: F401  # deprecated
    from hybrid.scene.root import Scene
    from hybrid.scene.root import Scene as System  # noqa: F401  # deprecated
    from hybrid.simulation.lines_stiffness import offsets, stiffness
    from hybrid.simulation.own_parts import RunPart, RunView
    from hybrid.simulation.run_quantities import kinds_of_quantities, listed_outputs
    from hybrid.simulation.stepping import Simulation
    from hybrid.simulation.stepping import Simulation as SystemSimulation  # noqa: F401  # deprecated
    from hybrid.store.reader import Result
    from hybrid.store.reader import open_result as open
    from hybrid.store.study_file import open_study
    from hybrid.studies.study import case_of as study_case
    from hybrid.studies.study import study
    from hybrid.studies.tradeoff import trade, trade_levels
    from hybrid.view.comparison import write_comparison as compare
    from hybrid.view.notebook import plot_space
    from hybrid.view.quantities import plot_energy, plot_quantity, plot_shape, plot_zone_map, plot_zones
    from hybrid.view.quantities import plot_summary as plot
    from hybrid.view.report import write_report as report
    from hybrid.zones.criteria import NodeState

_HOME = {
    "ComputationError": ("hybrid.errors", "ComputationError"),
    "HybridError": ("hybrid.errors", "HybridError"),
    "NodeState": ("hybrid.zones.criteria", "NodeState"),
    "Outcome": ("hybrid.errors", "Outcome"),
    "RunPart": ("hybrid.simulation.own_parts", "RunPart"),
    "RunView": ("hybrid.simulation.own_parts", "RunView"),
    "Result": ("hybrid.store.reader", "Result"),
    "ResultError": ("hybrid.errors", "ResultError"),
    "Scene": ("hybrid.scene.root", "Scene"),
    "SceneError": ("hybrid.errors", "SceneError"),
    "Simulation": ("hybrid.simulation.stepping", "Simulation"),
    "compare": ("hybrid.view.comparison", "write_comparison"),
    "design": ("hybrid.designs.design", "design"),
    "export_fmu": ("hybrid.couple.fmu_export", "export_fmu"),
    "export": ("hybrid.exports.api", "export"),
    "export_moordyn": ("hybrid.interop.moordyn", "export_moordyn"),
    "import_moordyn": ("hybrid.interop.moordyn", "import_moordyn"),
    "load_scene": ("hybrid.scene.read", "load_scene"),
    "modes": ("hybrid.modal.api", "modes"),
    "offsets": ("hybrid.simulation.lines_stiffness", "offsets"),
    "open": ("hybrid.store.reader", "open_result"),
    "openmdao_component": ("hybrid.designs.design", "openmdao_component"),
    "parse_scene": ("hybrid.scene.read", "parse_scene"),
    "plan": ("hybrid.accuracy.run_forecast", "plan"),
    "listed_outputs": ("hybrid.simulation.run_quantities", "listed_outputs"),
    "kinds_of_quantities": ("hybrid.simulation.run_quantities", "kinds_of_quantities"),
    "plot": ("hybrid.view.quantities", "plot_summary"),
    "plot_energy": ("hybrid.view.quantities", "plot_energy"),
    "plot_quantity": ("hybrid.view.quantities", "plot_quantity"),
    "plot_shape": ("hybrid.view.quantities", "plot_shape"),
    "plot_space": ("hybrid.view.notebook", "plot_space"),
    "plot_zone_map": ("hybrid.view.quantities", "plot_zone_map"),
    "plot_zones": ("hybrid.view.quantities", "plot_zones"),
    "report": ("hybrid.view.report", "write_report"),
    "response": ("hybrid.modal.api", "response"),
    "resume": ("hybrid.accuracy.api", "resume"),
    "run": ("hybrid.accuracy.api", "run"),
    "scene_text": ("hybrid.scene.read", "scene_text"),
    "seek": ("hybrid.designs.nearest", "seek"),
    "sensitivity": ("hybrid.designs.sensitivity", "sensitivity"),
    "shares": ("hybrid.designs.shares", "shares"),
    "static": ("hybrid.accuracy.api", "static"),
    "stiffness": ("hybrid.simulation.lines_stiffness", "stiffness"),
    "study": ("hybrid.studies.study", "study"),
    "study_case": ("hybrid.studies.study", "case_of"),
    "open_study": ("hybrid.store.study_file", "open_study"),
    "trade": ("hybrid.studies.tradeoff", "trade"),
    "trade_levels": ("hybrid.studies.tradeoff", "trade_levels"),
    "validate_scene": ("hybrid.scene.read", "validate_scene"),
}

__all__ = [
    "ComputationError",
    "HybridError",
    "NodeState",
    "Outcome",
    "Result",
    "ResultError",
    "RunPart",
    "RunView",
    "Scene",
    "SceneError",
    "Simulation",
    "compare",
    "design",
    "export",
    "export_fmu",
    "export_moordyn",
    "import_moordyn",
    "kinds_of_quantities",
    "listed_outputs",
    "load_scene",
    "modes",
    "offsets",
    "open",
    "open_study",
    "openmdao_component",
    "parse_scene",
    "plan",
    "plot",
    "plot_energy",
    "plot_quantity",
    "plot_shape",
    "plot_space",
    "plot_zone_map",
    "plot_zones",
    "report",
    "response",
    "resume",
    "run",
    "scene_text",
    "seek",
    "sensitivity",
    "shares",
    "static",
    "stiffness",
    "study",
    "study_case",
    "trade",
    "trade_levels",
    "validate_scene",
]

# public names that have changed: the old one still works
_FORMER = {"Look": "NodeState", "System": "Scene", "SystemSimulation": "Simulation", "load_system": "load_scene"}


def __getattr__(name: str) -> Any:
    if name == "__version__":
        from importlib.metadata import version

        return version("hybrid-cable")
    if name in _FORMER:
        import warnings

        warnings.warn(f"hybrid.{name} is now hybrid.{_FORMER[name]}", DeprecationWarning, stacklevel=2)
        return getattr(import_module("hybrid"), _FORMER[name])
    if name not in _HOME:
        raise AttributeError(f"module 'hybrid' has no attribute {name!r}")
    module, attribute = _HOME[name]
    value = getattr(import_module(module), attribute)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return [*__all__, "__version__"]
