"""Scenes of which the digests are kept: each way to compute a line once, short, on few cells.

A scene is a file of the examples, or a network of this module, with values that are set; the name says what it covers.
"""

from __future__ import annotations

import copy
from functools import cache
from pathlib import Path
from typing import Any

import yaml

EXAMPLES = Path(__file__).parents[1] / "examples"
DEFECTS = EXAMPLES.parent / "tests" / "data" / "defects"
Data = dict[str, Any]

SYSTEMS = """
buoy:
  environment:
    fluid: {density: 1025, surface: 30, current: [0.5, 0, 0]}
    seabed: {z: -100, stiffness: 1.0e+4, damping: 1.0e+3, friction: 0.3}
  points:
    east: {position: [150, 0, -100]}
    north: {position: [-75, 130, -100]}
    south: {position: [-75, -130, -100]}
    vessel: {position: [60, 0, 20], motion: {heave: {amplitude: 2, period: 8}, ramp: 8}}
    buoy: {kind: free, initial_guess: [0, 0, 5], mass: 1000, volume: 20, drag_area: 4, added_mass: 5000}
  lines:
    east: {start: east, end: buoy, sections: [&chain {length: 185, mass: 10, diameter: 0.05, axial_stiffness: 1.0e+7, drag: {normal: 1.2}}], mesh: {cells: 20}}
    north: {start: north, end: buoy, sections: [*chain], mesh: {cells: 20}}
    south: {start: south, end: buoy, sections: [*chain], mesh: {cells: 20}}
    hose:
      start: buoy
      end: vessel
      sections: [{length: 100, mass: 10, diameter: 0.08, axial_stiffness: 1.0e+7, bending_stiffness: 400, drag: {normal: 1.2}}]
      mesh: {cells: 40}
  time: {duration: 4, step: 0.05}
  output: {every: 0.5, points: 21}
towed:
  environment: {fluid: {density: 1025, current: [0.4, 0.1, 0]}}
  points:
    west: {position: [-55, 0, -50]}
    east: {position: [55, 5, -50]}
    float: {initial_guess: [0, 0, -10], mass: 300, volume: 1.2, drag_area: 2}
    winch: {position: [35, 0, 1], motion: {surge: {amplitude: 0.5, period: 4}, ramp: 4}}
  lines:
    west: {start: west, end: float, sections: [&leg {length: 70, mass: 3, diameter: 0.04, axial_stiffness: 2.0e+6, drag: {normal: 1.2}}]}
    east: {start: float, end: east, sections: [*leg]}
    tow: {start: float, end: winch, sections: [{<<: *leg, length: 45, bending_stiffness: 300}]}
  time: {duration: 4}
  accuracy: {position: 5 cm, tension: 2%}
  output: {every: 0.5, points: 21}
parted:
  environment: {fluid: {density: 1025}}
  points:
    east: {position: [60, 0, -50]}
    north: {position: [-30, 52, -50]}
    south: {position: [-30, -52, -50]}
    buoy: {initial_guess: [0, 0, 0], mass: 500, volume: 4, drag_area: 3, added_mass: 2000}
  lines:
    east:
      start: east
      end: buoy
      break_at: {time: 1}
      sections: [&rope {length: 75, mass: 6, diameter: 0.04, axial_stiffness: 5.0e+6, bending_stiffness: 20, drag: {normal: 1.2}}]
      mesh: {cells: 30}
    north: {start: north, end: buoy, sections: [*rope], mesh: {cells: 30}}
    south: {start: south, end: buoy, sections: [*rope], mesh: {cells: 30}}
  time: {duration: 2, step: 0.02}
  output: {every: 0.2, points: 21}
pipe:
  environment: {fluid: {density: 1025, current: [0.4, 0, 0]}}
  points:
    wellhead: {position: [0, 0, -60]}
    hangoff: {body: buoy, place: [1, 0, -2]}
    anchor: {position: [-40, 0, -60]}
    tether: {body: buoy, place: [-1, 0, -2]}
    tee: {initial_guess: [0, 0, -30]}
    branch: {initial_guess: [3, 0, -31], mass: 50, volume: 0.03}
  bodies:
    buoy: {initial_guess: [0, 0, -2], mass: 5000, volume: 9, inertia: [9000, 9000, 9000], centre: [0, 0, -1]}
  lines:
    lower:
      start: wellhead
      end: tee
      connections: {start: {tangent: [0, 0, 1]}, end: {tangent: [0, 0, 1]}}
      sections: [&pipe {length: 30, mass: 30, diameter: 0.15, axial_stiffness: 1.0e+8, bending_stiffness: 2.0e+4, drag: {normal: 1.2}}]
      mesh: {cells: 30}
    upper:
      start: tee
      end: hangoff
      connections: {start: {tangent: [0, 0, 1]}, end: {tangent: [0, 0, 1], bend_stiffness: 2.0e+4}}
      sections: [{<<: *pipe, length: 26.5}]
      mesh: {cells: 30}
    stub: {start: tee, end: branch, connections: {start: {tangent: [1, 0, 0]}}, sections: [{<<: *pipe, length: 3}], mesh: {cells: 10}}
    leg: {start: anchor, end: tether, sections: [{length: 69.5, mass: 4, diameter: 0.03, axial_stiffness: 1.0e+7}], mesh: {cells: 20}}
  time: {duration: 2, step: 0.05}
  output: {every: 0.2, points: 21}
spar:
  environment: {fluid: {density: 1025, surface: 0, current: [0.4, 0, 0], waves: {kind: regular, height: 4, period: 9}}}
  points:
    east: {position: [400, 0, -150]}
    north: {position: [-200, 346, -150]}
    south: {position: [-200, -346, -150]}
    to_east: {body: spar, place: [5, 0, -20]}
    to_north: {body: spar, place: [-2.5, 4.33, -20]}
    to_south: {body: spar, place: [-2.5, -4.33, -20]}
  bodies:
    spar:
      initial_guess: [0, 0, 0]
      mass: 3.0e+6
      centre: [0, 0, -25]
      inertia: [8.0e+8, 8.0e+8, 4.0e+7]
      added_mass: [2.6e+6, 2.6e+6, 3.0e+5, 1.5e+9, 1.5e+9, 0]
      damping: [2.0e+5, 2.0e+5, 1.0e+5, 2.0e+7, 2.0e+7, 1.0e+7]
      hydrostatics: {heave: 7.8e+5, roll: 1.2e+8, pitch: 1.2e+8}
      members: [{start: [0, 0, -40], end: [0, 0, 5], diameter: 9, drag: 0.8, added_mass: 1.0, pieces: 10}]
      force: {value: [3.0e+5, 0, 0], until: 10}
  lines:
    east: {start: east, end: to_east, sections: [&wire {length: 425, mass: 80, diameter: 0.1, axial_stiffness: 4.0e+8, drag: {normal: 1.2}}], mesh: {cells: 20}}
    north: {start: north, end: to_north, sections: [*wire], mesh: {cells: 20}}
    south: {start: south, end: to_south, sections: [*wire], mesh: {cells: 20}}
  time: {duration: 5, step: 0.1}
  output: {every: 0.5, points: 21}
alone:
  environment: {fluid: {density: 1025}, seabed: {z: -100, stiffness: 5.0e+3, damping: 5.0e+2}}
  points:
    anchor: {position: [0, 0, -100]}
    fairlead: {position: [205, 0, 0], motion: {heave: {amplitude: 2.0, period: 8.0}, ramp: 16}}
  lines:
    line:
      start: anchor
      end: fairlead
      sections: [{length: 250, diameter: 0.05, mass: 20, axial_stiffness: 2.0e+8, bending_stiffness: 2.0e+3, drag: {normal: 1.2, tangential: 0.05}, added_mass: {normal: 1.0}}]
      mesh: {cells: 50}
  time: {duration: 10, step: 0.1}
  output: {every: 0.5, points: 21}
"""
RODS, CATENARY, MOVES = "rod", "catenary", {"kind": "adaptive", "tolerance": 2e-5}
ZONES = {"kind": "zones", "zones": [{"catenary": 75}, {"rod": 50}, {"catenary": 125}]}
FOLLOWS = {"kind": "adaptive", "curvature_error": 0.02}
MODELS: dict[str, Any] = {"rod": RODS, "catenary": CATENARY, "zones": ZONES, "moves": MOVES, "follows": FOLLOWS}
ACROSS = {"environment.fluid.current": [0.3, 0.4, 0.0]}
SHORT = {"time.duration": 10.0, "mesh.cells": 50, "output": {"every": 0.5, "points": 21}}


@cache
def _systems() -> dict[str, Data]:
    found = yaml.safe_load(SYSTEMS)
    assert isinstance(found, dict)
    return found


def _example(name: str, **values: Any) -> Data:
    """A file of the examples with values set by their dotted keys, `__` for a dot."""
    data = yaml.safe_load((EXAMPLES / f"{name}.yaml").read_text(encoding="utf-8"))
    return changed(data, {key.replace("__", "."): value for key, value in values.items()})


def changed(data: Data, values: Data) -> Data:
    """A copy with values set; None: without that key."""
    data = copy.deepcopy(data)
    for key, value in values.items():
        *path, last = key.split(".")
        at: Any = data
        for name in path:
            at = at[int(name)] if isinstance(at, list) else at.setdefault(name, {})
        if value is None:
            at.pop(last, None)
        else:
            at[last] = value
    return data


def _named(data: Data, name: str, model: Any) -> Data:
    """A network one line of which has that model."""
    return changed(data, {f"lines.{name}.model": model})


def moving() -> dict[str, Data]:
    """Name -> a scene in motion."""
    found: dict[str, Data] = {}
    for name, model in MODELS.items():
        own = {"model": model} | ({"mesh": None} if name in ("zones", "follows") else {})
        touchdown = changed(_example("touchdown"), SHORT | own)
        found[f"touchdown, {name}"] = touchdown
        found[f"touchdown, {name}, in space"] = changed(touchdown, ACROSS)
    fast = _example("touchdown", time__duration=10.0, output={"every": 0.5, "points": 21})
    found["touchdown, steps that follow the motion"] = changed(
        fast, {"time.step": None, "accuracy": {"tension": "1%"}, "mesh": None, "model": None}
    )
    found["touchdown, errors of fixed steps"] = changed(fast, {"output.errors": True, "model": RODS, "mesh.cells": 50})
    friction = {"environment.seabed.friction": 0.4, "model": MOVES}
    found["touchdown, friction"] = changed(changed(fast, friction | {"mesh.cells": 50}), ACROSS)
    short: dict[str, Data] = {
        "02_suspension": {"time.duration": 2.0}, "03_suspension_rod": {"time.duration": 2.0},
        "04_suspension_catenary": {"time.duration": 2.0}, "05_cantilever": {}, "06_whip": {},
        "07_forced_taut_cable": {}, "armoured_cable": {}, "irregular_sea": {}, "laying": {}, "laying_loop": {},
        "laying_winch": {}, "rov_descent": {},
        "rov_tether": {}, "s_tether": {}, "slack_on_seabed": {}, "twisted_tether": {},
    }  # fmt: skip
    for name, values in short.items():
        found[f"example {name}"] = _cut(changed(_example(name), values))
    wound = {"time": {"duration": 14.0, "step": 0.02}, "mesh.cells": 100, "output": {"every": 1.0, "points": 21}}
    found["example plectoneme, until its strands touch"] = changed(_example("plectoneme"), wound)
    winch = _cut(_example("laying_winch", mesh__cells=60))
    found["payout by a rate, catenary"] = changed(winch, {
        "model": CATENARY, "ends.end.payout": {"rate": 0.5, "ramp": 5, "longest": 260},
        "ends.end.motion": {"velocity": [0.5, 0, 0], "ramp": 5},
    })  # fmt: skip
    found["payout by a rate, rod in space"] = changed(
        winch, {"dimension": None, "ends.end.payout": {"rate": -0.3, "ramp": 2, "longest": 260}}
    )
    let_go = {"ends.end.release_at": {"time": 3.0}, "ends.end.motion": None, "model": RODS, "mesh.cells": 50}
    found["an end that is let go"] = changed(fast, let_go)
    found["table of tension over strain"] = changed(fast, {
        "cable.sections.0.tension_strain": [[0, 0], [0.001, 1e5], [0.003, 4e5]], "cable.sections.0.axial_stiffness": None,
        "model": RODS, "mesh.cells": 50,
    })  # fmt: skip
    found["damping and rotary inertia"] = changed(
        fast, {"cable.sections.0.damping": {"mass": 0.05}, "model": RODS, "mesh.cells": 50}
    )
    float_ = {"cable.attachments": [{"kind": "float", "at": 150, "buoyancy": 3000, "mass": 50, "drag_area": 0.5}]}
    found["a float, zones that move"] = changed(changed(fast, float_ | {"mesh.cells": 50}), ACROSS)
    networks = _systems()
    found |= {f"system {name}": data for name, data in networks.items()}
    found["system buoy, hose whose zones move"] = _named(networks["buoy"], "hose", MOVES)
    found["system buoy, hose as catenary"] = _named(networks["buoy"], "hose", CATENARY)
    found["system parted, zones that move"] = _named(networks["parted"], "north", MOVES)
    for name, model in {"rod": RODS, "catenary": CATENARY, "moves": MOVES}.items():
        found[f"system of one line, {name}"] = _named(networks["alone"], "line", model)
        found[f"system of one line, {name}, in space"] = changed(found[f"system of one line, {name}"], ACROSS)
    return found


def _cut(data: Data) -> Data:
    """At most 150 steps, or 5 s where steps follow the motion; eleven outputs of 21 points."""
    data, time = copy.deepcopy(data), data.get("time") or {}
    if "duration" in time:
        data["time"]["duration"] = min(time["duration"], 150 * time["step"] if "step" in time else 5.0)
        data["output"] = {"every": data["time"]["duration"] / 10, "points": 21}
    return data


def at_rest() -> dict[str, Data]:
    """Name -> a scene whose equilibrium is computed."""
    found = {
        f"rest of {name}": _example(name)
        for name in ("01_hanging_chain", "touchdown", "s_tether", "rov_tether", "twisted_tether")
    }
    found |= {f"rest of {name}": changed(data, {"time": None}) for name, data in _systems().items()}
    for name in ("body_end_reaction", "polyester_on_depths", "table_with_turns", "buoy_with_folded_legs"):
        found[f"rest of {name}"] = yaml.safe_load((DEFECTS / f"{name}.yaml").read_text(encoding="utf-8"))
    found["rest of touchdown, 1%"] = _example("touchdown", accuracy={"tension": "1%"}, mesh=None, model=None)
    return found
