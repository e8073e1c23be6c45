"""Other names of what a file holds, which the reader understands too: short ones, and those of older versions."""

from __future__ import annotations

# Attribute: names, with commas, of quantities of which finer runs change as much as coarser ones did.
NOT_CONVERGED = "errors_not_converged"
ALIASES = {"times": "t", "moment": "bending_moment"}
OLD_NAMES = {
    f"{table}/pull_{end}": f"{table}/end_force_{end}"
    for table in ("steps", *(f"errors/{cause}" for cause in ("mesh", "time", "model", "total")))
    for end in ("start", "end")
}
OLD_ATTRIBUTES = {f"error_{cause}_pull": f"error_{cause}_end_force" for cause in ("mesh", "time", "model", "total")}
OLD_EVENTS = {
    "pull between outputs": "end force between outputs",
    "clamp left out": "bending at clamp neglected",
    "point left out": "bending at point load neglected",
    "torque left out": "torque neglected",
    "friction left out": "static friction neglected",
    "zones held": "zones fixed",
    "turned in": "end rotated in",
    "events left out": "events omitted",
    "error beyond estimate": "model error not estimated",
    "not judged": "stability not judged",
    "loses energy": "numerical dissipation",
}


def right_of(name: str) -> str:
    """Name of the array with the values on the right of jumps: right/tension, errors/total/right_tension."""
    group, _, last = name.rpartition("/")
    return f"{group}/right_{last}" if group else f"right/{name}"
