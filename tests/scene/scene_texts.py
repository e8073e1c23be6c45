"""Scenes and helpers that the tests of this room share."""

from __future__ import annotations

import re

from hybrid.errors import Complaint, SceneError
from hybrid.scene.read import parse_scene

SUSPENSION = """\
title: Cable suspension with low- and high-tension zones (Goyal & Perkins, Table 1)
environment:
  gravity: 9.8                       # m/s^2, along -z
  fluid: {density: 1.0}              # kg/m^3; leave the table out and there is no fluid
cable:
  sections:                          # from s = 0 on; as many as needed
    - length: 2.0                    # m, unstretched
      diameter: 1.0e-3               # m
      mass: 7.853981634e-4           # kg/m, in air
      bending_stiffness: 2.454369e-4 # N m^2
      torsional_stiffness: 1.963495e-4
      drag: {normal: 1.5, tangential: 0.05}
      damping: 2.0                   # 1/s, mass proportional: only to settle
ends:
  start: {kind: pinned, position: [0, 0, 0]}
  end:   {kind: guided, tangent: [0.8660254, 0, -0.5], force: [0.005, 0, 0.00866025]}
initial: {kind: straight, direction: [1, 0, 0]}   # or: equilibrium
model: {kind: zones, zones: [{catenary: 1.5}, {rod: 0.5}]}
time: {duration: 20.0, step: 0.01}
output: {every: 0.1}
"""

# examples/05_touchdown.yaml of the sketch, without what version 0.1 does not know.
OCEAN = """\
environment:
  gravity: 9.81
  fluid: {density: 1025, current: [0.3, 0, 0]}
cable:
  sections:
    - {length: 250, diameter: 0.05, mass: 20, axial_stiffness: 2.0e8, bending_stiffness: 2.0e3,
       drag: {normal: 1.2, tangential: 0.05}, added_mass: {normal: 1.0}}
ends:
  start: {kind: pinned, position: [0, 0, -100]}
  end:   {kind: pinned, position: [205, 0, 0], motion: {heave: {amplitude: 2.0, period: 8.0}, ramp: 16.0}}
initial: {kind: equilibrium}
model: {kind: catenary}
time: {duration: 100.0, step: 0.02}
"""

# Every key of the schema at least once, over two scenes that are accepted.
EVERYTHING = """\
title: every key
environment: {gravity: 9.81, fluid: {density: 1000.0, current: [0.1, 0.0, 0.0]}}
cable:
  sections:
    - length: 10.0
      mass: 1.0
      diameter: 0.02
      axial_stiffness: 1.0e6
      max_strain: 0.02
      bending_stiffness: [1.0, 2.0]
      torsional_stiffness: 1.5
      rotary_inertia: [1.0e-4, 2.0e-4]
      min_bend_radius: 0.3
      intrinsic_curvature: [0.1, 0.0, 0.0]
      drag: {normal: 1.2, tangential: 0.01}
      added_mass: {normal: 1.0, tangential: 0.1}
      damping: {mass: 0.1, stiffness: 0.01}
ends:
  start:
    kind: clamped
    position: [0.0, 0.0, 0.0]
    tangent: [1.0, 0.0, 0.0]
    normal: [0.0, 1.0, 0.0]
    swivel: true
    motion:
      surge: {amplitude: 0.1, period: 5.0, phase: 10.0}
      sway: {amplitude: 0.1, period: 5.0}
      heave: {amplitude: 0.1, period: 5.0}
      roll: {amplitude: 3.0, period: 5.0}
      pitch: {amplitude: 3.0, period: 5.0}
      yaw: {amplitude: 3.0, period: 5.0}
      ramp: 10.0
  end:
    kind: guided
    tangent: [1.0, 0.0, 0.0]
    normal: [0.0, 0.0, 1.0]
    force: {value: [1.0, 0.0, 0.0], until: 3.0}
    motion: {pitch: {amplitude: 3.0, period: 5.0}, ramp: 10.0}
initial: {kind: straight, direction: [1.0, 0.0, 0.0], origin: [0.0, 0.0, 0.0], velocity: [0.0, 0.0, 0.0]}
model:
  kind: zones
  slack: warn
  zones:
    - {catenary: 4.0, cells: 20, ratio: 0.5}
    - {rod: 6.0, cells: 30, ratio: 2.0}
mesh: {cells: 50, ratio: 1.0}
time: {duration: 20.0, step: 0.01, rho_inf: 0.5}
output: {every: 0.1, points: 51, history: [0.0, 10.0]}
dimension: 3
"""

EVERYTHING_ELSE = """\
cable: {sections: [{length: 10.0, mass: 1.0, bending_stiffness: 2.0, rotary_inertia: 1.0e-4, damping: 0.3}]}
ends:
  start: {kind: pinned, position: [0.0, 0.0, 0.0], motion: {heave: {amplitude: 0.0, period: 5.0}}}
  end: {kind: free, force: [1.0, 0.0, 0.0], moment: {value: [0.0, 1.0, 0.0], until: 2.0}}
initial: {kind: points, points: [[0.0, 0.0, 0.0], [5.0, 0.0, 0.0], [5.0, 0.0, -5.0]]}
model: {kind: catenary, slack: stop}
mesh: {nodes: [0.0, 4.0, 10.0]}
output: {points: [0.0, 5.0, 10.0]}
"""

# Every key of the sea at least once, over four scenes that are accepted.
SEA = """\
environment:
  gravity: 9.81
  fluid:
    density: 1025.0
    current: {kind: power_law, velocity: [0.5, 0.1, 0.0], top: -1.0, bottom: -80.0, exponent: 0.2, veer: 30.0, ramp: 5.0}
    surface: 0.0
    waves: {kind: jonswap, significant_height: 3.0, peak_period: 9.0, gamma: 2.0, direction: 180.0, seed: 7, components: 50, depth: 100.0, ramp: 18.0}
  seabed: {z: -100.0, slope: [0.01, -0.02], stiffness: 5.0e+3, damping: 500.0, friction: {axial: 0.3, lateral: 0.5}}
cable:
  sections: [{length: 150.0, mass: 5.0, diameter: 0.05, drag: {normal: 1.2}}]
  attachments:
    - {kind: float, at: 75.0, buoyancy: 60.0, mass: 4.0, drag_area: 0.02, added_mass: 3.0, height: 0.2}
    - {kind: clump, at: 100.0, mass: 30.0, volume: 0.004, drag_area: 0.05, added_mass: 2.0, height: 0.3}
    - {kind: modules, range: [20.0, 40.0], volume: 0.02, mass: 8.0, drag_area: 0.3, added_mass: 12.0}
ends:
  start:
    kind: pinned
    position: [0.0, 0.0, 0.0]
    motion:
      heave: [{amplitude: 0.5, period: 8.0}, {amplitude: 0.2, period: 5.0, phase: 40.0}]
      velocity: [0.5, 0.0, 0.0]
      travel: {by: [10.0, 0.0, -2.0], over: 30.0, begin: 5.0}
      follow: waves
      ramp: 16.0
  end: {kind: body, initial_guess: [60.0, 0.0, -80.0], mass: 100.0, volume: 0.09, height: 0.5, shape: cylinder, drag_area: 0.4, added_mass: 40.0, thrust: [20.0, 0.0, 0.0]}
initial: {kind: equilibrium, guess: catenary, friction: settled}
model: {kind: catenary}
time: {duration: 60.0, step: 0.05}
output: {elevation: [[0.0, 0.0], [20.0, 5.0]]}
"""

SEA_TOO = """\
environment:
  fluid:
    density: 1025.0
    current: {kind: profile, table: [{z: 0.0, velocity: [0.4, 0.0, 0.0]}, {z: -50.0, velocity: [0.1, 0.2, 0.0]}], ramp: 8.0}
    surface: 0.0
    waves: {kind: regular, height: 2.0, period: 7.0, direction: 30.0, phase: 90.0, depth: 60.0}
cable:
  sections: [{length: 40.0, mass: 2.0, diameter: 0.03}]
  attachments:
    - {kind: float, at: 15.0, volume: 0.2, mass: 20.0}
    - {kind: modules, range: [20.0, 30.0], buoyancy: -5.0, mass: 8.0}
ends:
  start: {kind: body, mass: 300.0, volume: 1.0, thrust: {value: [0.0, 5.0, 0.0], until: 20.0, ramp: 2.0}}
  end: {kind: pinned, position: [0.0, 0.0, -35.0]}
initial: {kind: equilibrium, points: [[10.0, 0.0, 0.0], [10.0, 0.0, -20.0], [0.0, 0.0, -35.0]]}
model: {kind: catenary}
"""

SEVERAL_SEAS = """\
environment:
  fluid:
    density: 1025.0
    surface: 0.0
    waves:
      kind: sum
      ramp: 9.0
      depth: 60.0
      spectra:
        - {kind: jonswap, significant_height: 2.0, peak_period: 14.0, direction: 200.0, spreading: {exponent: 25.0}}
        - {kind: pierson_moskowitz, significant_height: 1.0, zero_crossing_period: 4.0, components: 30, seed: 3}
        - kind: ochi_hubble
          parts:
            - {significant_height: 1.0, peak_period: 12.0, shape: 3.0}
            - {significant_height: 0.5, peak_period: 6.0, shape: 1.0}
cable: {sections: [{length: 10.0, mass: 2.0, diameter: 0.03}]}
ends: {start: {kind: pinned, position: [0.0, 0.0, 0.0]}, end: {kind: free}}
initial: {kind: equilibrium}
model: {kind: catenary}
"""

HIGH_WAVES = """\
environment:
  fluid:
    density: 1025.0
    surface: 0.0
    waves: {kind: stream_function, height: 6.0, period: 9.0, direction: 30.0, phase: 90.0, order: 16, depth: 40.0, ramp: 9.0}
cable: {sections: [{length: 10.0, mass: 2.0, diameter: 0.03, capacity: [[1.0e+5, 0.0], [6.0e+4, 0.2], [0.0, 0.4]]}]}
ends: {start: {kind: pinned, position: [0.0, 0.0, 0.0]}, end: {kind: free}}
initial: {kind: equilibrium}
model: {kind: catenary}
"""

SEA_LIST = """\
environment:
  fluid:
    density: 1025.0
    current: [{z: -100.0, velocity: [0.0, 0.0, 0.0]}, {z: 0.0, velocity: [0.3, 0.0, 0.0]}]
  seabed: {z: -20.0, stiffness: 1.0e+4, friction: 0.4}
cable: {sections: [{length: 10.0, mass: 2.0, diameter: 0.03, drag: {normal: 1.0}}]}
ends: {start: {kind: free}, end: {kind: body, mass: 10.0}}
initial: {kind: equilibrium, points: [[0.0, 0.0, -20.0], [10.0, 0.0, -20.0]]}
model: {kind: catenary}
"""

SEA_UNIFORM = """\
environment: {fluid: {density: 1.2, current: {kind: uniform, speed: 8.0, direction: 90.0, ramp: 4.0}}}
cable: {sections: [{length: 10.0, mass: 2.0, diameter: 0.03, drag: {normal: 1.0}}]}
ends: {start: {kind: pinned, position: [0.0, 0.0, 0.0]}, end: {kind: free}}
initial: {kind: equilibrium}
model: {kind: catenary}
"""

QUANTITIES = """\
output:
  elevation: [[0.0, 0.0], [20.0, 5.0]]
  quantities:
    hang_off: {kind: end_angle, end: end, direction: [1.0, 0.0, 0.0], smallest: 2.0, largest: 90.0}
    moved: {kind: touchdown_excursion, end: start, reference: [10.0, 0.0]}
    back: {kind: layback, end: start, to: touchdown}
    gap: {kind: clearance, point: [1.0, 2.0, -3.0], diameter: 0.5, range: [10.0, 90.0]}
    hull: {kind: clearance, point: [1.0, 2.0, -3.0], normal: [0.0, 0.0, 1.0]}
    pipeline: {kind: clearance, path: [[1.0, 2.0, -99.0], [50.0, 2.0, -99.0]]}
"""
PIPE = "diameter: 0.03, pipe: {wall: 0.004, outer_diameter: 0.025, modulus: 2.0e+11, pressure: 1.0e+6, pressure_z: -5.0, content_density: 800.0, max_stress: 3.0e+8}}]"
# Quantities that are asked for, and the steel of a pipe.
MEASURED = SEA.replace("output: {elevation: [[0.0, 0.0], [20.0, 5.0]]}\n", QUANTITIES)
PIPED = SEA_TOO.replace("diameter: 0.03}]", PIPE)

SEAS = {
    "several seas": SEVERAL_SEAS,
    "high waves": HIGH_WAVES,
    "sea": SEA,
    "sea too": SEA_TOO,
    "sea list": SEA_LIST,
    "sea uniform": SEA_UNIFORM,
}

AT_REST = """\
cable: {sections: [{length: 10.0, mass: 1.0}]}
ends: {start: {kind: pinned, position: [0.0, 0.0, 0.0]}, end: {kind: free}}
initial: {kind: equilibrium, guess: straight, direction: [1.0, 0.0, 0.0]}
model: {kind: catenary}
"""


def complaints(text: str, overrides: tuple[str, ...] = ()) -> list[Complaint]:
    """What the reader says about a text; none if it is accepted."""
    try:
        parse_scene(text, "scene.yaml", overrides)
    except SceneError as error:
        assert str(error).startswith("scene.yaml")
        return error.complaints
    return []


# The scene, a part of it, what stands there instead with `§` where the complaint must point, the key that it must name,
# and words that the fix (or what was expected) must contain.
Case = tuple[str, str | None, str | None, str, str]


def refused(case: Case, alone: bool = True) -> None:
    """That a text is refused at its line, column and key; alone: by that complaint and no other."""
    text, old, new, where, fix = case
    text = change(text, old, new) if old is not None and new is not None else text
    point = None
    if "§" in text:
        text, *point = marked(text)
    found = complaints(text)
    assert where in [c.where for c in found], found
    if alone:
        assert [c.where for c in found] == [where]
    complaint = next(c for c in found if c.where == where)
    assert len([c for c in found if c == complaint]) == 1
    if point is not None:
        assert [complaint.line, complaint.column] == point
    assert complaint.line is not None and complaint.value
    assert fix in complaint.fix or fix in complaint.expected, complaint
    words = complaint.expected
    assert not re.search(r"Input should|\b(tuple|dict|str|int|NoneType)\b(?!\))|<\w", words), complaint


def marked(text: str) -> tuple[str, int, int]:
    """The text without its mark `§`, and line and column where the mark was."""
    before = text[: text.index("§")]
    return text.replace("§", ""), before.count("\n") + 1, len(before) - (before.rfind("\n") + 1) + 1


def change(text: str, old: str, new: str) -> str:
    """The text with `old`, which must be there once, replaced."""
    assert text.count(old) == 1, f"{old!r} occurs {text.count(old)} times"
    return text.replace(old, new)
