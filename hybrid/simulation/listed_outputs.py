"""What a result will hold, by name, unit and description, before anything is computed."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import NamedTuple

from hybrid.model.build import build
from hybrid.model.model_costs import with_model
from hybrid.model.resolution import first_resolution, model_is_free
from hybrid.model.system import build_system
from hybrid.scene.quantities import KINDS, Quantity
from hybrid.scene.read import SceneLike, as_scene_or_system
from hybrid.scene.schema import AdaptiveModel, Scene
from hybrid.scene.system import System
from hybrid.simulation.case import Case
from hybrid.simulation.pair_forces import fields_of_pairs
from hybrid.simulation.result_file import STEP_FIELDS
from hybrid.simulation.system_lines import observer_of
from hybrid.simulation.system_points import fields_of
from hybrid.simulation.system_quantities import SystemQuantities
from hybrid.store.format import Field
from hybrid.store.lines import GROUP


class Listed(NamedTuple):
    """A quantity of a result: its name, unit, dimensions, and what it is."""

    name: str
    unit: str
    dims: tuple[str, ...]
    description: str


def listed_outputs(scene: SceneLike | System) -> list[Listed]:
    """What `hybrid run` (or `hybrid static` of a scene without time) will record over time; nothing is computed.

    Of several lines: what is recorded of points and bodies, and of every line under `lines/<name>/`.
    """
    asked = as_scene_or_system(scene)
    if isinstance(asked, Scene):
        return _of_scene(asked)
    model = build_system(asked)
    guesses = asked.guesses
    scenes = {name: asked.scene_of(name, asked.carried(name), guesses) for name in model.names}
    found = _over_time([*fields_of(asked), *fields_of_pairs(model), *SystemQuantities(asked, scenes).fields])
    if asked.time is not None:
        found = _with_ranges(found, asked.output.quantities)
    for (name, each), built in zip(scenes.items(), model.models, strict=True):
        fields = observer_of(each, built, asked.time is not None).fields
        found += _over_time(fields, steps=asked.time is not None, begin=f"{GROUP}/{name}/")
    return found


def kinds_of_quantities() -> list[Listed]:
    """Kinds of `output.quantities`, which are recorded where a scene asks for them."""
    words = {"end": "end given", "to": "touchdown point or other end", "what": "a point, a plane, a path or a line"}
    return [Listed(kind, unit, ("t",), text.format(**words)) for kind, (unit, text, _, _) in KINDS.items()]


def _of_scene(scene: Scene) -> list[Listed]:
    moves = scene.time is not None
    if model_is_free(scene):
        scene = with_model(scene, "adaptive")
    model = build(scene, first_resolution(scene))
    if moves:
        case = Case(scene, None)
        observer = case.observer(model, isinstance(scene.model, AdaptiveModel), case.points.s, None)
    else:
        observer = observer_of(scene, model, moves=False)
    found = _over_time(observer.fields, steps=moves)
    return _with_ranges(found, scene.output.quantities) if moves else found


def _with_ranges(found: list[Listed], asked: Mapping[str, Quantity]) -> list[Listed]:
    """Listed quantities that say whether extremes and limits of them are those of every step; asked: by name."""
    out = []
    for x in found:
        if x.name in asked or x.name in ("wall_tension", "von_mises"):
            x = x._replace(description=f"{x.description}; extremes and limits: of every step")
        out.append(x)
    return out


def _over_time(fields: Iterable[Field], steps: bool = False, begin: str = "") -> list[Listed]:
    """Fields at every output, and what is logged at every step; the second values of places with two are left out."""
    every = [Listed(begin + f.name, f.unit, ("t", *f.dims), f.description) for f in fields if "right/" not in f.name]
    return every + [Listed(f"{begin}steps/{f.name}", f.unit, ("steps/t",), f.description) for f in STEP_FIELDS if steps]
