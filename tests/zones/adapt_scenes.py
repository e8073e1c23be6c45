"""Scenes whose zones come and go, and their criteria, computed anew from what a result shows.

In every scene the start moves towards the end and back (the end moves away, so that both moves begin and end at
rest), slowly against the waves on the cable, which mass-proportional damping calms.  Base cells are even, and the
output points are their nodes and middles, at every step: catenary tensions are exact in the middles, curvatures at nodes.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from problems import Scene, clamped, pinned, scene

from hybrid import run
from hybrid.kernels.mesh.zone_criteria import CRITERIA
from hybrid.model.material import TENSION_FLOOR
from hybrid.store.reader import Result
from hybrid.store.records import Event

Floats = np.ndarray
GRAVITY = 10.0
LENGTH, CELLS, EI = 10.0, 50, 0.64
CELL = LENGTH / CELLS
DWELL = 0.5
FLOORED = TENSION_FLOOR * (EI * (1.0 * GRAVITY) ** 2) ** (1 / 3)  # N, for a cable of 1 kg/m
OFF = {x.name: x.off for x in CRITERIA}


def breathing(
    far: float, near: float, model: dict[str, Any], *, period: float = 6.0, duration: float = 8.0, step: float = 0.02,
    start: dict[str, Any] | None = None, end: dict[str, Any] | None = None, height: float = 0.0,
    environment: dict[str, Any] | None = None, attachments: list[dict[str, Any]] | None = None, **section: Any,
) -> Scene:  # fmt: skip
    """Two ends `far` apart come as near as `near` after half a period and are apart again after the whole."""
    by = [far - near, 0.0, 0.0]
    cable = {
        "length": LENGTH, "mass": 1.0, "bending_stiffness": EI, "torsional_stiffness": 0.8 * EI,
        "axial_stiffness": 1e5, "damping": {"mass": 3.0},
    } | section  # fmt: skip
    cable = {k: x for k, x in cable.items() if x is not None}
    one = {"motion": {"travel": {"by": by, "over": period / 2}}} | (start or pinned())
    two = {"motion": {"travel": {"by": by, "over": period / 2, "begin": period / 2}}} | (end or pinned(far, 0, height))
    what = scene(
        cable, one, two, cells=CELLS, gravity=GRAVITY, time={"duration": duration, "step": step},
        output={"every": step, "points": np.linspace(0, LENGTH, 2 * CELLS + 1).tolist()},
    ).model_dump(exclude_none=True)  # fmt: skip
    what["model"] = {"kind": "adaptive", "hold_time": DWELL} | model
    what["environment"] |= environment or {}
    if attachments:
        what["cable"]["attachments"] = attachments
    return Scene.model_validate(what)


def slackening(**more: Any) -> Scene:
    """A cable that stands straight up, its foot raised and its head raised after: slack at the foot, without any bend.

    The tension at s is that of the foot and w s; in the lowest cell it goes from 25 N to half the floor and back.
    """
    stiff, w = 4e3, GRAVITY
    high, low = 24.0, 0.5 * FLOORED - 0.5 * w * CELL  # N, at the foot
    lengths = [LENGTH + (x * LENGTH + 0.5 * w * LENGTH**2) / stiff for x in (high, low)]
    foot = pinned(0, 0, 0) | {"motion": {"travel": {"by": [0, 0, lengths[0] - lengths[1]], "over": 3.0}}}
    head = pinned(0, 0, lengths[0])
    head["motion"] = {"travel": {"by": [0, 0, lengths[0] - lengths[1]], "over": 3.0, "begin": 3.0}}
    return breathing(
        0.0, 0.0, {"tolerance": 0.1} | more.pop("model", {}), start=foot, end=head, axial_stiffness=stiff, **more
    )


def sagging(**more: Any) -> Scene:
    """A deep sag, from 11.5 N at the lowest point to about 2 and back; at (EI w^2)^(1/3) = 4 N EI w/T^2 is the tolerance."""
    return breathing(5.0, 2.2, {"tolerance": 0.04} | more.pop("model", {}), **more)


def bending(**more: Any) -> Scene:
    """A sag of EI kappa/T from 2 to 80 mm; the tolerance is 44.4 mm.  The tension stays twice the floor."""
    return breathing(9.0, 4.5, {"tolerance": 0.00444} | more.pop("model", {}), **more)


def kinking(**more: Any) -> Scene:
    """A clump of 30 N on a light cable: sqrt(EI/T) sin(angle/2) from 11 to 100 mm; the tolerance is 60 mm."""
    clump = [{"kind": "clump", "at": 5.0, "mass": 3.0}]
    return breathing(9.9, 8.0, {"tolerance": 0.006} | more.pop("model", {}), mass=0.1, attachments=clump, **more)


def taut(start: Any, end: Any, duration: float, model: dict[str, Any], **cable: Any) -> Scene:
    section = {"length": LENGTH, "bending_stiffness": EI, "axial_stiffness": 1e5, "damping": {"mass": 3.0}} | cable
    what = scene(
        section, start, end, cells=CELLS, gravity=GRAVITY, time={"duration": duration, "step": 0.02},
        output={"every": 0.02, "points": np.linspace(0, LENGTH, 2 * CELLS + 1).tolist()},
    ).model_dump(exclude_none=True)  # fmt: skip
    return Scene.model_validate(what | {"model": {"kind": "adaptive", "hold_time": DWELL} | model})


def nodding(**more: Any) -> Scene:
    """A taut cable whose clamp nods by 20 deg and back: sqrt(EI/T) 2 sin(angle/2) to 2.5 times the tolerance."""
    model = {"tolerance": 0.0015} | more.pop("model", {})
    clamp = {"kind": "clamped", "position": (0, 0, 0), "tangent": (1, 0, 0), "normal": (0, 0.6, 0.8)}
    clamp["motion"] = {"yaw": {"amplitude": 20.0, "period": 10.0}, "ramp": 2.0}
    return taut(clamp, pinned(10.008, 0, 0), 6.0, model, **{"mass": 0.2, "torsional_stiffness": 0.8 * EI} | more)


def lowering(**more: Any) -> Scene:
    """A cable that lies on the bed and rises to its end: where it leaves the bed EI w/T^2 passes the tolerance."""
    bed = {"seabed": {"z": 0.0, "stiffness": 2e3}}
    return breathing(
        8.9,
        8.2,
        {"tolerance": 0.0016} | more.pop("model", {}),
        height=3.5,
        start=pinned(0, 0, 0),
        environment=bed,
        **more,
    )


def easing(normal: tuple[float, float, float], **more: Any) -> Scene:
    """A cable clamped where it is lowest, along its own tangent; its end comes near, and it goes slack at the clamp."""
    clamp = {"kind": "clamped", "position": (0, 0, 0), "tangent": (1, 0, 0), "normal": normal}
    model = {"tolerance": 0.02} | more.pop("model", {})
    return breathing(7.0, 2.0, model, start=clamp, height=6.0, duration=3.0, **more)


def turning(**more: Any) -> Scene:
    """A taut cable between two clamps, one of which turns about its tangent: M^2/(4 EI T)/0.5 of the rod is 2.5 at the end."""
    end = clamped((10.002, 0, 0), (1, 0, 0), motion={"roll": {"amplitude": 720.0, "period": 12.0}, "ramp": 2.0})
    return taut(clamped(), end, 3.0, {"tolerance": 0.01} | more["model"], mass=0.1, torsional_stiffness=20 * EI)


SCENES = {"slack": slackening, "deep": sagging, "bend": bending, "point": kinking, "clamp": nodding, "edge": lowering}


@cache
def ran(name: str, always: str = "") -> Result:
    """The result of one of SCENES, its zones free, or all of one kind."""
    return run(SCENES[name](model={f"force_{always}": [[0, LENGTH]]} if always else {}))


def swapped(what: Scene) -> Scene:
    """The same scene with the cable counted from its other end."""
    text = what.model_dump(exclude_none=True)
    ends = text["ends"]
    ends["start"], ends["end"] = ends["end"], ends["start"]
    for x in ends.values():
        if "tangent" in x:
            x["tangent"] = [-y for y in x["tangent"]]
    for x in text["cable"].get("attachments", ()):
        x["at"] = LENGTH - x["at"]
    text["cable"]["sections"] = text["cable"]["sections"][::-1]
    return Scene.model_validate(text)


# --- criteria, from a result -----------------------------------------------------------------------------


def tensions(result: Result) -> Floats:
    """(nt, n) N, in the middles of base cells."""
    return result.tension[:, 1::2]


def at_nodes(result: Result) -> Floats:
    """(nt, n+1) N, the smaller of the two base cells at a node."""
    T = tensions(result)
    return np.minimum(np.hstack([T[:, :1], T]), np.hstack([T, T[:, -1:]]))


def slack(result: Result, floor: float = FLOORED) -> Floats:
    """(nt, n): floor over tension."""
    T = tensions(result)
    return np.where(T > 0.0, floor / np.maximum(T, 1e-300), np.inf)


def bend(result: Result, tolerance: float, floor: float = FLOORED) -> Floats:
    """(nt, n+1): EI kappa/T over the tolerance (m), at base nodes."""
    return EI * result.curvature[:, ::2] / np.maximum(at_nodes(result), floor) / tolerance


def kink(result: Result, tolerance: float, node: int, floor: float) -> Floats:
    """(nt,): sqrt(EI/T) times half the angle at a node over the tolerance, from the chords of the two base cells."""
    r = result.position[:, ::2]
    d = np.diff(r[:, node - 1 : node + 2], axis=1)
    d = d / np.linalg.norm(d, axis=2)[:, :, None]
    angle = np.linalg.norm(d[:, 1] - d[:, 0], axis=1)
    return np.sqrt(EI / np.maximum(at_nodes(result)[:, node], floor)) * 0.5 * angle / tolerance


COMES, GOES = ("split", "grow", "retry"), ("merge", "shrink")


def comes(result: Result) -> list[Event]:
    """Where a rod comes."""
    return [e for e in result.events if e.kind in COMES]


def goes(result: Result) -> list[Event]:
    """Where a rod goes."""
    return [e for e in result.events if e.kind in GOES]


def changes(result: Result) -> list[Event]:
    return [e for e in result.events if e.kind in COMES + GOES]


def rods(result: Result, output: int) -> list[tuple[float, float]]:
    return [(z.s_a, z.s_b) for z in result.zones[output] if z.kind == "rod"]


def output_at(result: Result, t: float) -> int:
    return int(np.argmin(np.abs(result.times - t)))


def bump(file: Path, column: str, height: float, over: float, duration: float) -> str:
    """A motion file: a rotation (deg) that rises smoothly to a height and falls back, then rests."""
    t = np.linspace(0.0, duration + 1.0, round(200 * (duration + 1.0)) + 1)
    x = np.clip(t / over, 0.0, 1.0)
    columns = {name: np.zeros_like(t) for name in ("rx", "ry", "rz")}
    columns[column] = height * 64.0 * x**3 * (1.0 - x) ** 3
    rows = np.column_stack([t, *columns.values()])
    np.savetxt(file, rows, delimiter=",", header="t,rx,ry,rz", comments="", fmt="%.12g")
    return str(file)
