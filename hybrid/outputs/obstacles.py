"""What is recorded of obstacles of which one moves: where they are, and what the line does to them."""

from __future__ import annotations

from collections.abc import Sequence

from hybrid.kernels.state.obstacle_rows import SEEN_FORCE, SEEN_MOMENT, SEEN_TURN
from hybrid.kernels.state.state import Floats
from hybrid.model.bodies import angles_of
from hybrid.store.format import Field


def obstacle_fields(names: Sequence[str]) -> list[Field]:
    """Place and rotation of all obstacles, force and moment on them."""
    texts = {
        "position": ("m", "place of obstacle {}"),
        "rotation": ("deg", "rotation of obstacle {} since t = 0: roll, pitch, yaw, about x, then y, then z"),
        "force": ("N", "force of the line on obstacle {}"),
        "moment": ("N m", "moment of the line on obstacle {} about its place"),
    }
    return [
        Field(f"obstacles/{name}/{key}", unit, text.format(name), (3,), ("xyz",), "inertial")
        for name in names
        for key, (unit, text) in texts.items()
    ]


def obstacle_values(names: Sequence[str], seen: Floats) -> dict[str, Floats]:
    """Their values (nb, 3); seen: (nb, M, SEEN) of kernels.state.obstacle_rows."""
    found = {}
    for k, name in enumerate(names):
        x = seen[:, k]
        turned = x[:, SEEN_TURN:SEEN_FORCE].reshape(-1, 3, 3)
        found[f"obstacles/{name}/position"] = x[:, :SEEN_TURN].copy()
        found[f"obstacles/{name}/rotation"] = angles_of(turned)
        found[f"obstacles/{name}/force"] = x[:, SEEN_FORCE:SEEN_MOMENT].copy()
        found[f"obstacles/{name}/moment"] = x[:, SEEN_MOMENT:].copy()
    return found
