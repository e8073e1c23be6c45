"""What a result will hold, by name, unit and description, before anything is computed."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import NamedTuple

from hybrid.model.model_costs import with_models
from hybrid.model.network import build_system
from hybrid.model.resolution import model_is_free, wants_errors
from hybrid.scene.quantities import KINDS, Quantity
from hybrid.scene.read import SceneLike, as_scene
from hybrid.scene.short_form import network_of
from hybrid.simulation.line_result import Wanted, observer_of
from hybrid.simulation.pair_forces import fields_of_pairs
from hybrid.simulation.result_file import STEP_FIELDS
from hybrid.simulation.run_points import fields_of
from hybrid.simulation.run_quantities import RunQuantities
from hybrid.store.copying import GROUP
from hybrid.store.format import Field


class Listed(NamedTuple):
    """A quantity of a result: its name, unit, dimensions, and what it is."""

    name: str
    unit: str
    dims: tuple[str, ...]
    description: str


def listed_outputs(scene: SceneLike) -> list[Listed]:
    """What `hybrid run` (or `hybrid static` of a scene without time) will record over time; nothing is computed.

    Of several lines: what is recorded of points and bodies, and of every line under `lines/<name>/`.
    """
    asked = as_scene(scene)
    moves, named, system = asked.time is not None, bool(asked.line_names), network_of(asked)
    free = [name for name in system.lines if model_is_free(system.scene_of(name))]
    system = with_models(system, dict.fromkeys(free, "adaptive"))
    model, found, scenes = build_system(system), list[Listed](), system.scenes_of_lines
    if named:
        found = _over_time([*fields_of(system), *fields_of_pairs(model), *RunQuantities(system, scenes).fields])
    else:  # a cable is recorded by its own scene, which has its quantities
        scenes = {name: asked.scene_of(key) for name, key in zip(scenes, asked.lines, strict=True)}
    for (name, each), built in zip(scenes.items(), model.models, strict=True):
        wanted = Wanted(error=built.follows_error and wants_errors(each))
        fields = observer_of(each, built, moves, wanted=wanted).fields
        found += _over_time(fields, steps=moves, begin=f"{GROUP}/{name}/" if named else "")
    return _with_ranges(found, asked.output.quantities) if moves else found


def kinds_of_quantities() -> list[Listed]:
    """Kinds of `output.quantities`, which are recorded where a scene asks for them."""
    words = {"end": "end given", "to": "touchdown point or other end", "what": "a point, a plane, a path or a line"}
    return [Listed(kind, unit, ("t",), text.format(**words)) for kind, (unit, text, _, _) in KINDS.items()]


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
