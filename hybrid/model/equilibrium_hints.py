"""Why a scene may have no equilibrium, or none that a flexible line can hold: for messages of a failed search."""

from __future__ import annotations

import math

from hybrid.model.initial_shape import HARDLY
from hybrid.model.scales import net_weight
from hybrid.scene.schema import Body, Equilibrium, Free, LineScene


def end_laid_anywhere(scene: LineScene) -> str:
    """The end that lies on a level bed in any direction as well, because nothing in the scene says which; "": none."""
    bed, fluid, initial, ends = scene.environment.seabed, scene.environment.fluid, scene.initial, scene.ends
    said = not isinstance(initial, Equilibrium) or initial.points is not None or initial.direction is not None
    if bed is None or not bed.is_level or said or len(ends.held()) != 1 or (fluid is not None and fluid.flows()):
        return ""
    (held,) = ends.held()
    other = "end" if held == "start" else "start"
    tangent = ends.named()[held].held_tangent
    pulled = any(any(x.value[:2]) for x in ends.named()[other].loads if x.what == "force")
    return "" if pulled or (tangent is not None and any(tangent[:2])) else other


def reasons_against(scene: LineScene, rod_ends: tuple[bool, bool], flexible: float = 0.0) -> list[str]:
    """Reasons against an equilibrium of the scene, in sentences; empty when nothing is known.

    rod_ends: whether the line begins and ends with a rod.  flexible: its longest cell of a catenary, m.
    """
    found = []
    bed, held = scene.environment.seabed, scene.ends.held()
    weight = net_weight(scene)
    if bed is not None and weight > 0.0 and len(held) == 2:
        (xa, ya, za), (xb, yb, zb) = held["start"], held["end"]
        # the longest way that can be taut: straight up from the bed, and along it
        heights = [z - bed.height(x, y) for x, y, z in (held["start"], held["end"])]
        along = math.dist((xa, ya, za - heights[0]), (xb, yb, zb - heights[1]))
        over = scene.length - along - sum(max(h, 0.0) for h in heights)
        if over > HARDLY * scene.length:
            found.append(
                f"the cable is {over:.4g} m longer than from end to end along the seabed and straight up: "
                f"that much lies slack on it, where only bending and friction give it a shape"
            )
    if bed is not None and weight > 0.0:
        for name, end, rod in zip(("start", "end"), (scene.ends.start, scene.ends.end), rod_ends, strict=True):
            x, y, z = next(iter(held.values()), (0.0, 0.0, 0.0))
            reaches = z - bed.height(x, y) < scene.length
            if reaches and not rod and isinstance(end, Free) and end.force is None and held and not bed.friction:
                found.append(
                    f"the {name} lies free on a seabed without friction: nothing keeps the cable there taut, "
                    f"and a flexible line without tension has no shape: make it a rod there"
                )
    fluid = scene.environment.fluid
    still = fluid is None or not fluid.flows()
    if bed is not None and bed.is_level and len(held) == 1 and still and not all(rod_ends):
        forces = [x for end in scene.ends.both for x in end.loads if x.what == "force"]
        if not any(any(x.value[:2]) for x in forces):
            found.append(
                "nothing pulls the line along the seabed: what lies there has no tension, and a flexible line without "
                "tension has no shape: make it a rod there, or give a current"
            )
    if bed is not None and not held and not all(rod_ends):
        found.append("nothing holds the cable: on the bed it has no tension, and a flexible line then has no shape")
    if bed is not None and not held and bed.slope is not None:
        slope = math.hypot(*bed.slope)
        least = min(bed.friction.axial, bed.friction.lateral) if bed.friction else 0.0
        if slope > least:
            found.append(
                f"the seabed slopes by {math.degrees(math.atan(slope)):.3g} deg and friction holds up to "
                f"{math.degrees(math.atan(least)):.3g} deg: nothing else keeps the cable from sliding"
            )
    if weight and bed is None and len(held) == 2:
        across = math.dist(held["start"][:2], held["end"][:2])
        if across < flexible:
            found.append(
                f"the ends are {across:.3g} m apart across gravity, and cells of the catenary {flexible:.3g} m long: "
                f"it folds within a cell, where it has no tension; a rod (bending_stiffness) rounds the fold, and more "
                f"cells or some axial_stiffness may help"
            )
    if not weight and not any(isinstance(x, Body) for x in (scene.ends.start, scene.ends.end)) and len(held) == 2:
        apart = math.dist(held["start"], held["end"])
        if scene.length > apart * (1.0 + HARDLY):
            found.append(
                f"the cable has no weight in its surroundings and is {scene.length - apart:.4g} m longer than its "
                f"span: nothing tautens it"
            )
    return found
