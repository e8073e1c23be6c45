"""Rods in place of a catenary that nobody asked for, where it goes into compression in a motion.

A line without bending stiffness is a catenary where its scene names no model, and no catenary carries compression.  So
that the choice of a model is never what a run stops for, such a run begins anew with rods, whose sections without
bending stiffness get EI = w l^3, with the submerged weight w per length and a hundredth of the line l, as long as the
cells of a mesh that is not given: under its weight the line then bends over one cell, which is as sharp as catenaries
show a bend.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, NamedTuple

from hybrid.errors import ComputationError, Outcome
from hybrid.model.payout import payout_of
from hybrid.scene.analysis import RodModel
from hybrid.scene.cable import Section
from hybrid.scene.root import Scene
from hybrid.scene.schema import Environment, LineScene

if TYPE_CHECKING:  # its tables take long to make
    from hybrid.scene.network_scene import Network

CHOSEN = "slack line as rods"  # of the event that says so
CELLS = 100  # of a mesh that is not given
# Of the weight in vacuum at the earth's surface: what a line that floats, or has no weight, counts as having.
LEAST_WEIGHT = 1e-2
GRAVITY = 9.81  # m/s2


class Instead(NamedTuple):
    """What is computed in place of a scene, and the text of the event."""

    scene: Any
    text: str


def rods_instead_of_slack(scene: Scene, error: ComputationError) -> Instead | None:
    """A scene with rods in place of catenaries that stood for no model; None: they did not, or did not go slack."""
    if error.outcome != Outcome.SLACK or error.t is None:
        return None
    asked: Any = scene
    return _rods_in_network(asked, error) if scene.line_names else _rods_of_cable(asked, error)


def _rods_of_cable(scene: LineScene, error: ComputationError) -> Instead | None:
    if "model" in scene.model_fields_set or payout_of(scene) is not None or scene.model.kind != "catenary":
        return None
    sections, given = _stiffened(scene.cable.sections, scene.environment)
    cable = scene.cable.model_copy(update={"sections": sections})
    return Instead(scene.model_copy(update={"cable": cable, "model": RodModel()}), _text(error, given))


def _rods_in_network(system: Network, error: ComputationError) -> Instead | None:
    """Rods in the line that the error names."""
    line = system.lines.get(error.line_name)
    if line is None or line.model is not None:
        return None
    sections, given = _stiffened(line.sections, system.environment)
    other = line.model_copy(update={"sections": sections, "model": RodModel()})
    lines = {name: other if name == error.line_name else x for name, x in system.lines.items()}
    text = f"line {error.line_name}: {_text(error, given)}" + "; no other line has changed" * (len(lines) > 1)
    return Instead(system.model_copy(update={"lines": lines}), text)


def _stiffened(sections: tuple[Section, ...], around: Environment) -> tuple[tuple[Section, ...], list[float]]:
    """Sections that bend, and the bending stiffness of those that had none, N m2."""
    length = sum(x.length for x in sections) / CELLS
    density = around.fluid.density if around.fluid is not None else 0.0
    found, given = [], []
    for x in sections:
        if not x.weakest_bending:
            in_water = around.gravity * (x.mass - density * 0.25 * math.pi * (x.diameter or 0.0) ** 2)
            given.append(max(abs(in_water), LEAST_WEIGHT * GRAVITY * x.mass) * length**3)
            x = x.model_copy(update={"bending_stiffness": given[-1]})
        found.append(x)
    return tuple(found), given


def _text(error: ComputationError, given: list[float]) -> str:
    """What the event says."""
    stiffness = " and ".join(f"{x:.3g}" for x in dict.fromkeys(given))
    return (
        f"computed as rods, because as a catenary it went into compression at t = {error.t:.4g} s, "
        f"s = {error.s or 0.0:.4g} m, and the run began anew; bending_stiffness is not given and taken as {stiffness} "
        "N m^2, by which the line bends over a hundredth of its length: give its own"
    )
