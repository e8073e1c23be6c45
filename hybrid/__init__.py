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
    from hybrid.adapt.manager import Look
    from hybrid.errors import ComputationError, HybridError, Outcome, ResultError, SceneError
    from hybrid.ladder import trade
    from hybrid.model.plan import plan
    from hybrid.results.export import export
    from hybrid.results.plot import plot_summary as plot
    from hybrid.results.read import Result
    from hybrid.results.read import open_result as open
    from hybrid.results.report import write_report as report
    from hybrid.results.zoneplot import plot_zones
    from hybrid.scene.moordyn import import_moordyn
    from hybrid.scene.read import load_scene, parse_scene, scene_text, validate_scene
    from hybrid.scene.schema import Scene
    from hybrid.simulate import resume, run, static

_HOME = {
    "ComputationError": ("hybrid.errors", "ComputationError"),
    "HybridError": ("hybrid.errors", "HybridError"),
    "Look": ("hybrid.adapt.manager", "Look"),
    "Outcome": ("hybrid.errors", "Outcome"),
    "Result": ("hybrid.results.read", "Result"),
    "ResultError": ("hybrid.errors", "ResultError"),
    "Scene": ("hybrid.scene.schema", "Scene"),
    "SceneError": ("hybrid.errors", "SceneError"),
    "export": ("hybrid.results.export", "export"),
    "import_moordyn": ("hybrid.scene.moordyn", "import_moordyn"),
    "load_scene": ("hybrid.scene.read", "load_scene"),
    "open": ("hybrid.results.read", "open_result"),
    "parse_scene": ("hybrid.scene.read", "parse_scene"),
    "plan": ("hybrid.model.plan", "plan"),
    "plot": ("hybrid.results.plot", "plot_summary"),
    "plot_zones": ("hybrid.results.zoneplot", "plot_zones"),
    "report": ("hybrid.results.report", "write_report"),
    "resume": ("hybrid.simulate", "resume"),
    "run": ("hybrid.simulate", "run"),
    "scene_text": ("hybrid.scene.read", "scene_text"),
    "static": ("hybrid.simulate", "static"),
    "trade": ("hybrid.ladder", "trade"),
    "validate_scene": ("hybrid.scene.read", "validate_scene"),
}

__all__ = [
    "ComputationError",
    "HybridError",
    "Look",
    "Outcome",
    "Result",
    "ResultError",
    "Scene",
    "SceneError",
    "export",
    "import_moordyn",
    "load_scene",
    "open",
    "parse_scene",
    "plan",
    "plot",
    "plot_zones",
    "report",
    "resume",
    "run",
    "scene_text",
    "static",
    "trade",
    "validate_scene",
]


def __getattr__(name: str) -> Any:
    if name == "__version__":
        from importlib.metadata import version

        return version("hybrid-cable")
    if name not in _HOME:
        raise AttributeError(f"module 'hybrid' has no attribute {name!r}")
    module, attribute = _HOME[name]
    value = getattr(import_module(module), attribute)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return [*__all__, "__version__"]
