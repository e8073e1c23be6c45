"""Scenes of bench/test_bench_response.py: twenty lines in seas, of one kind each."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

Scene = dict[str, Any]
LINE = {
    "mass": 30.0, "diameter": 0.1, "axial_stiffness": 5e6, "bending_stiffness": 2e3, "torsional_stiffness": 1e3,
    "drag": {"normal": 1.2}, "added_mass": {"normal": 1.0},
}  # fmt: skip
ROPE = {
    "mass": 6.0, "diameter": 0.08, "axial_stiffness": 2e6, "drag": {"normal": 1.2}, "added_mass": {"normal": 1.0},
}  # fmt: skip
CHAIN = {"mass": 30.0, "diameter": 0.07, "axial_stiffness": 5e6, "drag": {"normal": 1.4}, "added_mass": {"normal": 1.0}}
TETHER = {
    "length": 30.0, "diameter": 0.025, "mass": 0.65, "axial_stiffness": 1e6, "bending_stiffness": 10.0,
    "drag": {"normal": 1.2, "tangential": 0.02}, "added_mass": {"normal": 1.0},
}  # fmt: skip
SEA = {"kind": "jonswap", "significant_height": 2.0, "peak_period": 8.0, "direction": 30.0}
STORM = {"significant_height": 5.0, "peak_period": 12.0}
SHORT = {"significant_height": 1.0, "peak_period": 5.0}
PARTS = [{"significant_height": 1.5, "peak_period": 13.0, "shape": 3.0},
         {"significant_height": 1.2, "peak_period": 6.0, "shape": 1.2}]  # fmt: skip
SWELL = {"significant_height": 1.5, "peak_period": 14.0, "direction": 100.0}
WIND = {"kind": "pierson_moskowitz", "significant_height": 1.0, "peak_period": 6.0, "spreading": {"exponent": 6}}
BED = {"z": -60.0, "stiffness": 5e4}
MODULES = {"kind": "modules", "range": [90.0, 130.0], "buoyancy": 500.0, "mass": 40.0, "drag_area": 0.5,
           "added_mass": 60.0}  # fmt: skip
BUOY = {"kind": "float", "at": 30.0, "buoyancy": 2000.0, "mass": 100.0, "drag_area": 0.6, "added_mass": 150.0}


def water(waves: Scene, bed: Scene | None = None, current: Any = None) -> Scene:
    """The environment: waves are those of SEA but for what is given."""
    waves = (waves if "kind" in waves else SEA | waves) | {"ramp": 10.0}
    fluid = {"density": 1025, "surface": 0, "waves": waves if bed else waves | {"depth": 100.0}}
    return {"fluid": fluid | ({"current": current} if current else {})} | ({"seabed": bed} if bed else {})


def line(length: float, first: list[float], last: list[float], waves: Scene, **more: Any) -> Scene:
    """A line between two places; more: section, model, cells, bed, current, items, start and end."""
    held = {name: {"kind": "pinned", "position": place} for name, place in (("start", first), ("end", last))}
    return {
        "environment": water(waves, more.get("bed"), more.get("current")),
        "cable": {
            "sections": more.get("sections", [more.get("section", LINE) | {"length": length}]),
            "attachments": list(more.get("items", ())),
        },
        "ends": {name: held[name] | more.get(name, {}) for name in held},
        "initial": "equilibrium",
        "model": more.get("model", "catenary"),
        "mesh": {"cells": more.get("cells", 60)},
    }


def hung(waves: Scene, **more: Any) -> Scene:
    """A riser of 60 m, from 65 m down to 5 m down, hardly stretched."""
    return line(60.0, [0, 0, -65], [6, 0, -5.15], waves, **more)


def taut(waves: Scene, **more: Any) -> Scene:
    """A leg of fibre rope, 0.6 % stretched."""
    return line(133.7, [0, 0, -95], [100, 0, -5], waves, section=ROPE, **more)


def tensioned(waves: Scene, **more: Any) -> Scene:
    """A riser of 80 m that a tension of 100 kN holds upright, clamped at its foot."""
    pipe = LINE | {"bending_stiffness": 2e5, "axial_stiffness": 2e7, "damping": 0.1}
    foot = {"kind": "clamped", "tangent": [0, 0, 1]}
    return line(80.0, [0, 0, -85], [0, 0, -4.6], waves, section=pipe, model="rod", cells=80, start=foot, **more)


def moored(waves: Scene, **more: Any) -> Scene:
    """A chain of 200 m, of which a third lies on the bed."""
    return line(200.0, [0, 0, -60], [170, 0, -5], waves, section=CHAIN, bed=BED, cells=80, **more)


def lazy(waves: Scene, **more: Any) -> Scene:
    """A cable whose modules hold a wave above the bed."""
    return line(200.0, [0, 0, -60], [170, 0, -5], waves, bed=BED, cells=80, items=[MODULES], **more)


def on_vessel(folder: Path, heave: float = 0.5) -> Scene:
    """The end held by a vessel that surges and heaves."""
    rows = [
        f"{w:.4f},{heading},{1.2 * heave / (1 + (w / 0.6) ** 4):.5f},{heave / (1 + (w / 0.7) ** 4):.5f},-90,0"
        for w in np.linspace(0.05, 8.0, 120)
        for heading in (-180, 0, 180)
    ]
    path = folder / "rao.csv"
    path.write_text("\n".join(["frequency,heading,surge,heave,surge_phase,heave_phase", *rows]))
    return {"motion": {"vessel": {"rao": str(path), "origin": [170.0, 0.0, -5.0]}}}


def s_tether(waves: Scene, **more: Any) -> Scene:
    """A tether, heavy above and buoyant below, from a place below the surface to a vehicle 30 m down."""
    light = TETHER | {"mass": 0.36}
    held = {"kind": "clamped", "tangent": [-0.2, 0, -1]}
    flow = [{"z": 0.0, "velocity": [0.2, 0, 0]}, {"z": -40.0, "velocity": [0.05, 0, 0]}]
    return line(60.0, [0, 0, -2], [20, 0, -32], waves, sections=[TETHER, light], model="rod", cells=100, end=held,
                current=flow, **more)  # fmt: skip


def bridle(waves: Scene) -> Scene:
    """Three lines that meet at a buoy below the surface."""
    points = {
        "left": {"position": [-40, 0, -60]}, "right": {"position": [40, 0, -60]}, "side": {"position": [0, 45, -60]},
        "buoy": {"mass": 300.0, "volume": 1.5, "drag_area": 1.2, "added_mass": 700.0, "initial_guess": [0, 12, -20]},
    }  # fmt: skip
    lengths = {"left": 57.2, "right": 57.2, "side": 52.0}
    return {
        "environment": water(waves), "points": points,
        "lines": {
            x: {"start": x, "end": "buoy", "sections": [ROPE | {"length": n}], "mesh": {"cells": 24}}
            for x, n in lengths.items()
        },
    }  # fmt: skip


PLACES = {"east": (1.0, 0.0), "north": (-0.5, 0.866), "south": (-0.5, -0.866)}


def spar(waves: Scene) -> Scene:
    """A spar of members on three chains."""
    points: Scene = {x: {"position": [150.0 * a, 150.0 * b, -100]} for x, (a, b) in PLACES.items()}
    points |= {f"at_{x}": {"body": "hull", "place": [a, b, -3]} for x, (a, b) in PLACES.items()}
    section = {"length": 182.0, "mass": 10.0, "diameter": 0.05, "axial_stiffness": 1e7, "drag": {"normal": 1.2}}
    hull = {
        "mass": 4e4, "inertia": [3e6, 3e6, 3e4], "centre": [0, 0, -1.5], "initial_guess": [0, 0, -12],
        "hydrostatics": {"level": -9.0, "heave": 1.78e4, "roll": 1.5e6, "pitch": 1.5e6},
        "members": [{"start": [0, 0, -15], "end": [0, 0, 15], "diameter": 1.5, "drag": 1.0, "added_mass": 1.0}],
    }  # fmt: skip
    return {
        "environment": water(waves, {"z": -100.0, "stiffness": 1e4}), "points": points, "bodies": {"hull": hull},
        "lines": {x: {"start": x, "end": f"at_{x}", "sections": [section], "mesh": {"cells": 16}} for x in PLACES},
    }  # fmt: skip


def sunken(waves: Scene) -> Scene:
    """A buoyant body 20 m down on three taut ropes."""
    points: Scene = {x: {"position": [60.0 * a, 60.0 * b, -90]} for x, (a, b) in PLACES.items()}
    points |= {f"at_{x}": {"body": "buoy", "place": [2 * a, 2 * b, -1]} for x, (a, b) in PLACES.items()}
    buoy = {
        "mass": 1.2e4, "volume": 24.0, "inertia": [3e4, 3e4, 3e4], "centre_of_buoyancy": [0, 0, 0.6],
        "initial_guess": [0, 0, -20],
        "members": [{"start": [0, 0, -1.5], "end": [0, 0, 1.5], "diameter": 3.0, "drag": 0.8, "added_mass": 1.0}],
    }  # fmt: skip
    return {
        "environment": water(waves), "points": points, "bodies": {"buoy": buoy},
        "lines": {
            x: {"start": x, "end": f"at_{x}", "sections": [ROPE | {"length": 89.5}], "mesh": {"cells": 20}}
            for x in PLACES
        },
    }  # fmt: skip


def buoyed(waves: Scene) -> Scene:
    """The three ropes at a free point, as heavy, buoyant and slow as that body."""
    buoy = {"mass": 1.2e4, "volume": 24.0, "drag_area": 5.8, "added_mass": 2.17e4, "initial_guess": [0, 0, -20]}
    points: Scene = {x: {"position": [60.0 * a, 60.0 * b, -90]} for x, (a, b) in PLACES.items()}
    lines = {
        x: {"start": x, "end": "buoy", "sections": [ROPE | {"length": 91.5}], "mesh": {"cells": 20}} for x in PLACES
    }
    return {"environment": water(waves), "points": points | {"buoy": buoy}, "lines": lines}


def floated(waves: Scene) -> Scene:
    """Two of these ropes as one, with a float at its middle."""
    held = {"kind": "float", "at": 91.5, "buoyancy": 1.2e5, "mass": 1.2e4, "drag_area": 5.8, "added_mass": 2.17e4}
    return line(183.0, [-60, 0, -90], [60, 0, -90], waves | {"direction": 0.0}, section=ROPE, items=[held], cells=40)


# By name, what makes the tables of a scene in a folder for its files.
SCENES: dict[str, Callable[[Path], Scene]] = {
    "taut leg": lambda _: taut({}),
    "taut leg, 5 m": lambda _: taut(STORM),
    "taut leg, short waves": lambda _: taut(SHORT),
    "mooring chain": lambda _: moored({}),
    "mooring chain on a vessel": lambda folder: moored({"significant_height": 1.5}, end=on_vessel(folder)),
    "riser": lambda _: hung({}),
    "riser, rods, spread sea": lambda _: hung({"spreading": {"exponent": 8}}, model="rod"),
    "riser, current": lambda _: hung({}, current=[0.6, 0, 0]),
    "riser, short waves": lambda _: hung(SHORT),
    "riser, float, two peaks": lambda _: hung({"kind": "ochi_hubble", "parts": PARTS, "direction": 70.0}, items=[BUOY]),
    "tensioned riser, current": lambda _: tensioned({"significant_height": 1.5}, current=[0.7, 0.2, 0]),
    "tensioned riser, 5 m": lambda _: tensioned(STORM),
    "lazy wave": lambda _: lazy({"significant_height": 1.0}),
    "lazy wave, rods, on a vessel": lambda folder: lazy(
        {"kind": "torsethaugen", "significant_height": 1.0, "peak_period": 9.0}, model="rod",
        end=on_vessel(folder, 0.2)),
    "sagging": lambda _: line(70.0, [0, 0, -20], [60, 0, -15], {"peak_period": 9.0, "direction": 60.0}),
    "sagging, swell and wind sea": lambda _: line(
        70.0, [0, 0, -20], [60, 0, -15], {"kind": "sum", "spectra": [SEA | SWELL, WIND]}, current=[0.3, 0.6, 0]),
    "S tether": lambda _: s_tether({"significant_height": 0.5}),
    "bridle at a buoy": lambda _: bridle({"significant_height": 1.0, "spreading": {"exponent": 8}}),
    "spar on three chains": lambda _: spar({"significant_height": 1.0}),
    "sunken body on three ropes": lambda _: sunken({"kind": "pierson_moskowitz", "significant_height": 1.5,
                                                    "peak_period": 10.0}),
}  # fmt: skip
