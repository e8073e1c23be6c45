"""Write docs/scene.md from the JSON schema of a scene.

    python docs/make_scene_reference.py            # writes the page
    python docs/make_scene_reference.py --check    # exit code 1 if the page is stale

Descriptions, units, bounds and defaults are those of the models in hybrid/scene; to change
the page, change them there.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from hybrid.scene.base import Table
from hybrid.scene.combinations import REFUSALS
from hybrid.scene.network import Network
from hybrid.scene.schema import CableScene

PAGE = Path(__file__).with_name("scene.md")

HEAD = """\
# The scene

Use this page to look up every key of a scene: meaning, unit, bounds and default.
A scene is a YAML file, or the same tables in Python: `hybrid.validate_scene({...})`.
It names [points and lines](#points-and-lines), or is the [short form](#short-form-of-one-line) of one line, `cable`
with `ends` ([points.md](points.md)).
SI units; the inertial frame has z up; arc length s is unstretched and runs from the start of a line to its end.
Angles are in degrees, as people write them.
A table that is left out is not there, and a key that does not exist is refused.
`hybrid schema` prints the JSON schema, with which editors complete and check a scene as
you type;
`hybrid run scene.yaml --set time.step=0.005` changes a value without touching the file.

This page is made from that schema by `python docs/make_scene_reference.py`.
Each table has a heading to link to, such as `scene.html#section`, and is closed: its line of keys opens it, a link to
it does as well, and *Open all tables* opens all, to search the page.

## The least that is needed

Copy this, and change the numbers; everything else has a default, and `hybrid plan scene.yaml` says which:

```yaml
cable:
  sections: [{length: 100, mass: 2.0, diameter: 0.03}]     # m, kg/m, m
ends:
  start: {kind: pinned, position: [0, 0, 0]}
  end: {kind: pinned, position: [80, 0, 0]}
initial: equilibrium
```

With most of what a scene may have:

```yaml
title: Two sections, hung between two points, one of them moving
environment:
  fluid: {density: 1025, current: [0.3, 0, 0]}
cable:
  sections:
    - {length: 20, mass: 2.0, diameter: 0.03, bending_stiffness: 40, drag: {normal: 1.2}}
    - {length: 80, mass: 0.8, diameter: 0.02, axial_stiffness: 2.0e+6, drag: {normal: 1.2}, added_mass: {normal: 1.0}}
ends:
  start: {kind: clamped, position: [0, 0, -60], tangent: [1, 0, 1]}
  end: {kind: pinned, position: [70, 0, 0], motion: {heave: {amplitude: 0.5, period: 8.0}, ramp: 16.0}}
initial: equilibrium
model: {kind: zones, zones: [{rod: 20, cells: 60, ratio: 20}, {catenary: 80}]}
time: {duration: 60.0, step: 0.02}
output: {every: 0.2, history: [0, 20, 100]}
```
"""

TAIL = """\
## What is refused

Everything below is reported at once, with file, line, column, the value, what was expected and what to try:
unknown keys and kinds; numbers out of bounds or written as text; two pinned ends farther apart than an inextensible
cable is long; zones that do not add up to the length; a rod zone, or zones that move, over a section without
bending stiffness; drag,
added mass or buoyancy without fluid or diameter; a motion that does not start from rest or whose velocity jumps;
an initial shape that misses a held end; a normal along its tangent; waves without a surface, or so steep that they
break (height / length ≥ 0.142 tanh(k depth)); an end in the ground, or carried out of the reach of the cable; a float
that sinks; an attachment beyond the end of the cable; a cable that nothing holds, unless it lies on a seabed or floats
at a surface; a time step that cannot follow a period, a ramp or a move; a section whose mass and diameter make a mean
density below 15 or above 300 000 kg/m³; a fluid of 1.02 to 1.03 kg/m³ (sea water in t/m³), below 0.0005 or above
14 000; over a seabed one that is neither air (0.5 to 2 kg/m³) nor a liquid (400 to 3000), with a surface one that is no
liquid.

A computation stops, with time and place, where a section is stretched, or compressed, beyond its `max_strain`.

## Roll, pitch and yaw

Angles are right-handed about the axes of the inertial frame: a positive roll turns y towards z, a positive pitch z
towards x (so that a tangent along x dips), a positive yaw x towards y.
Given together they are applied in this order, each about the fixed inertial axis: roll about x, then pitch about y,
then yaw about z (extrinsic x-y-z).
What stood at time zero as a vector v, such as the tangent of a clamp, then points along Rz(yaw) Ry(pitch) Rx(roll) v.
The same rotation about axes that turn with the end is yaw about z, then pitch about the new y, then roll about the new
x (intrinsic z-y′-x″).
In scipy: `Rotation.from_euler("xyz", [roll, pitch, yaw], degrees=True)`.
Columns rx, ry, rz of a motion file are something else: a rotation vector, whose direction is the axis and whose length
the angle, in degrees.

## Turns of an end

The rotation of an end is a path, not a first and a last frame: harmonics and files may turn it any number of times.
Automatic steps are so short that no end turns by more than a radian in one (two in runs to compare with), fixed ones
are cut to that, with an event, so no step or output interval loses a turn.  A rotation vector of a file may be longer
than 360 degrees and must not jump back by a turn: `rx: 720` is two turns about x.

In statics and at the start of a run, `turns: 27` at a clamped end, or a guided one with `normal`, twists it about its
tangent by 27 turns against the other end, right-handed, from the twist of less than half a turn that joins the two
`normal` in the initial shape; fractions count, and -27 turns it the other way.
The rod is wound evenly before its equilibrium is sought, and what is found must have this twist to within half a turn;
else the computation stops (a slack cable that forms loops, too few cells).
The torque of a straight rod of length L is GJ 2π turns / L.
Catenary zones pass it on.
Cells that are left to the program are short enough for the twist that `turns` and motions prescribe.

## Ropes

A steel wire has an `axial_stiffness`; what stretches by a table has `tension_strain`; a fibre rope, soft to what is
slow and stiff to what is fast, `dynamic_stiffness` beside one of the two.
Polyester remembers besides how hard it was ever pulled: with `syrope` a taut leg follows its original curve while its
mean tension is the highest so far, and comes back on a working curve, longer than before:

```yaml
environment:
  fluid: {density: 1025, surface: 0}
  seabed: {z: -300, stiffness: 5.0e+4}
cable:
  sections:
    - length: 485
      mass: 22
      diameter: 0.16
      syrope:
        curve: [[0, 0], [0.01, 8.0e+5], [0.02, 1.45e+6], [0.03, 2.05e+6], [0.05, 3.5e+6]]  # or {file: owc.csv}
        working: exponential
        k1: 0.2
        k2: 1.5
        highest_tension: 1.5e+6  # by the installation, say
      dynamic_stiffness: {constant: 1.6e+8, per_tension: 20, relaxation_time: 200}
ends:
  start: {kind: pinned, position: [0, 0, -300]}
  end: {kind: pinned, position: [400, 0, -10]}
initial: equilibrium
model: catenary
```

The mean tension is that of the last `relaxation_time`: long beside waves, short beside a storm, so that a storm is
remembered and a wave is not.
At rest the rope is on the working curve below `highest_tension`, or, under more, on the original one.
`hybrid import` reads such ropes from decks of MoorDyn; what they lose is in `work/hysteresis`.

## Bending with hysteresis

The armour of a flexible pipe sticks until friction gives way, and then slips: stiff in small bends, soft in large ones,
and what it loses is the fatigue that it is spared.
`bending_stiffness` is what is left when all slips; a layer adds its own until its moment is the slip moment.

```yaml
environment: {fluid: {density: 1025}}
cable:
  sections:
    - length: 120
      mass: 90
      diameter: 0.26
      axial_stiffness: 3.0e+8
      bending_stiffness: 9.67e+3
      torsional_stiffness: 1.0e+5
      bending_slip: [{stiffness: 87.2e+3, moment: 600, per_tension: 0.003}]  # sticks to 0.01 1/m under 90 kN
ends:
  start: {kind: pinned, position: [60, 0, -90]}
  end:
    kind: clamped
    position: [0, 0, -2]
    tangent: [0, 0, 1]
    motion: {surge: {amplitude: 1.5, period: 9}, ramp: 9}
initial: equilibrium
model: rod
time: {duration: 20, step: 0.05}
```

A measured curve in place of layers: `moment_curvature: [[0, 0], [0.01, 969], [0.05, 1356]]` and `first_loading: true`.
An equilibrium is that of a first loading from straight, whatever came before: with layers, there are others.
What is lost is in `work/hysteresis` ([theory.md](theory.md#layers-that-slip)).

## Air and wind

A line in air is a line in a fluid of density 1.225 whose current is the wind, here 12 m/s along y:

```yaml
environment:
  fluid: {density: 1.225, current: [0, 12, 0]}
cable:
  sections:
    - {length: 305, mass: 1.63, diameter: 0.028, axial_stiffness: 3.0e+7, drag: {normal: 1.0}}
ends:
  start: {kind: pinned, position: [0, 0, 40]}
  end: {kind: pinned, position: [300, 0, 40]}
initial: equilibrium
model: catenary
```

Without a fluid there is neither drag nor wind; a cable that swings in still air has `density: 1.225` and no current.

## Currents

The shortest form is a vector, `current: [0.3, 0, 0]`.
In every form a velocity may be a speed and a direction instead: `current: {speed: 0.5, direction: 30}` flows towards
30 degrees from x, counter-clockwise seen from above, as waves travel, so that a study can vary either.
A list gives velocities at heights, `current: [{z: 0, velocity: [0.6, 0, 0]}, {z: -100, velocity: [0, 0.1, 0]}]`: linear
between them, constant above the highest and below the lowest.
A table has a kind, which its keys tell, and may have a `ramp`, the time over which the current grows from nothing:

```yaml
environment:
  fluid:
    density: 1025
    current: {kind: power_law, velocity: [0.8, 0, 0], top: 0, bottom: -100, exponent: 0.2, veer: 30}
cable:
  sections: [{length: 90, mass: 3.0, diameter: 0.03, axial_stiffness: 2.0e+7, drag: {normal: 1.2}}]
ends:
  start: {kind: pinned, position: [0, 0, 0]}
  end: free
initial: equilibrium
model: catenary
```

## Waves, the seabed, what hangs on the cable

A mooring line that lies on the bed for a part of its length, with a float, a clump and buoyancy modules, its upper end
moved by a vessel in a swell of two periods.
Waves need the `surface` of the fluid; their length follows from the depth over the seabed.
The attachments may stand in any order.

```yaml
environment:
  fluid:
    density: 1025
    surface: 0
    current: [{z: 0, velocity: [0.6, 0, 0]}, {z: -100, velocity: [0.1, 0, 0]}]
    waves: {kind: jonswap, significant_height: 3.0, peak_period: 10.0, direction: 180, ramp: 20}
  seabed: {z: -100, stiffness: 2.0e+4, damping: 500, friction: {axial: 0.3, lateral: 0.5}}
cable:
  sections:
    - {length: 400, mass: 30, diameter: 0.06, axial_stiffness: 2.0e+8, drag: {normal: 1.2}, added_mass: {normal: 1.0}}
  attachments:
    - {kind: float, at: 320, buoyancy: 2000, mass: 150, drag_area: 0.5, added_mass: 180}
    - {kind: clump, at: 200, mass: 300, volume: 0.04, drag_area: 0.2, added_mass: 40}
    - {kind: modules, range: [330, 360], buoyancy: 50, mass: 12, drag_area: 0.2, added_mass: 20}
ends:
  start: {kind: pinned, position: [0, 0, -100]}
  end:
    kind: pinned
    position: [350, 0, -5]
    motion: {heave: [{amplitude: 1.0, period: 10.0}, {amplitude: 0.3, period: 7.0, phase: 40}], ramp: 20}
initial: equilibrium
model: catenary
time: {duration: 120.0, step: 0.1}
```

Other seas; each is a value of `waves`, and `depth` and `ramp` go with all:

```text
- {kind: stream_function, height: 6, period: 9}  # one wave of finite height
- {kind: jonswap, significant_height: 3, peak_period: 9, spreading: {exponent: 10}}  # cos^2s of half the angle
- {kind: pierson_moskowitz, significant_height: 3, zero_crossing_period: 6.5}        # ISSC, Bretschneider
- kind: ochi_hubble
  parts:
    - {significant_height: 2, peak_period: 14, shape: 3}
    - {significant_height: 1.5, peak_period: 6, shape: 1.2}
- {kind: torsethaugen, significant_height: 3, peak_period: 9}                      # North Sea: swell and wind sea
- kind: sum
  spectra:
    - {kind: jonswap, significant_height: 2, peak_period: 14, direction: 200}
    - {kind: jonswap, significant_height: 1.5, peak_period: 6, spreading: {exponent: 8}}
- {kind: components, file: sea.csv}      # amplitude,frequency,direction,phase (m, rad/s, deg, deg)
- {kind: record, file: eta.csv, direction: 30, shortest_period: 2}                   # t,elevation (s, m)
```

A `stream_function` wave is steady, with sharp crests and flat troughs, and holds up to its surface; its water is at
rest on average at a fixed point under the troughs, and a current is added to it, which changes neither its length nor
its period.
Swell and wind sea (`sum`) have independent phases and no frequency in common.
With `spreading` every wave of a sea has one direction of its own, drawn from the seed, so that a step costs what it
does without; the waves do not lie in a plane any more.  cosⁿ of the whole angle with n = 2 is about s = 5.6.
A `record` is met where it was measured, at its own times; elsewhere it is as if all of it ran in one direction.  Its
harmonics begin anew at its end, so a run may not be longer; what is in no wave is an event.

`buoyancy` is net: the weight of the displaced fluid minus that of the float or the modules.  Where the size is known
rather than the lift, give `volume` instead.
Mass and volume must make a possible density: from 0.008 of that of the fluid (0.05 for a clump) to 25 000 kg/m³.
Without a mass a float is weightless, without a volume a clump displaces nothing; then neither may be wider than the
cable is long.

## Bodies, travel, ends that follow the waves

A `body` is an end that carries a mass and is not held: a vehicle, a buoy, a weight.
Give it a volume and it is buoyant; if it displaces more than its mass, it floats at the surface.
`initial_guess` says where the search of the equilibrium puts it first.
Here a vehicle of 1.5 t hangs from a ship that rises and falls with the waves, sets off at 0.5 m/s, and is then moved
10 m aside:

```yaml
environment:
  fluid: {density: 1025, surface: 0, waves: {kind: regular, height: 1.5, period: 8.0, ramp: 16}}
cable:
  sections: [{length: 200, mass: 1.5, diameter: 0.03, axial_stiffness: 1.0e+7, drag: {normal: 1.2}}]
ends:
  start:
    kind: pinned
    position: [0, 0, 2]
    motion: {follow: waves, velocity: [0.5, 0, 0], ramp: 20, travel: {by: [0, 10, 0], over: 30, begin: 40}}
  end: {kind: body, mass: 1500, volume: 1.2, height: 1.0, drag_area: 1.5, added_mass: 900}
initial: equilibrium
model: catenary
time: {duration: 100.0, step: 0.1}
```

A force on a `free` end pulls but has no inertia: however the cable moves, the tension at that end is the force.
That is right for a winch that holds a tension; a weight that swings or is heaved is a `body`.

A cable that no end holds can be in equilibrium, too: a heavy one on a seabed, a light one at a surface, as long as
nothing pushes it along.  State where it lies, with `points`:

```yaml
environment:
  seabed: {z: -20, stiffness: 1.0e+4, friction: 0.4}
cable:
  sections: [{length: 10, mass: 2.0}]
ends: {start: free, end: {kind: body, mass: 10}}
initial: {kind: equilibrium, points: [[0, 0, -20], [6, 0, -20], [6, 4, -20]]}
model: catenary
```

## Zones that move

`model: adaptive`, or no `model` for a cable that bends: rod where bending, torsion or slack ask for it, catenary
elsewhere, at every step anew; docs/zones.md says by which criteria.
`tolerance` is a part of the length; `force_rod` and `force_catenary` take whole cells and, for rods, a buffer.
The mesh is that of rods everywhere; `rod_cell` is for cells that follow the curvature (`curvature_error`).

```yaml
environment: {fluid: {density: 1025}}
cable:
  sections:
    - {length: 100, mass: 0.8, diameter: 0.025, axial_stiffness: 2.0e+6, bending_stiffness: 20, drag: {normal: 1.2}}
ends:
  start: {kind: pinned, position: [0, 0, 0], motion: {heave: {amplitude: 1.0, period: 8.0}, ramp: 16}}
  end: {kind: clamped, position: [40, 0, -60], tangent: [1, 0, 0.5]}
initial: equilibrium
model: {kind: adaptive, tolerance: 5.0e-4, force_rod: [[95, 100]]}
time: {duration: 60, step: 0.05}
output: {every: 0.25, criteria: true}
```

Every change is an event: `split` (a rod within a catenary), `grow`, `merge` (a rod goes), `shrink`, and `retry` (a step
was taken back because a catenary would have gone too far in it), each with the criterion, its value and threshold; the
energy that the changes of a moment put in is in the first of them.
`zones fixed` and `bending at clamp neglected` say what the program decided at the start.

## Steps and outputs

`output.every` says when something is kept, `time.step` how finely it is computed.
Steps are as long as `time.step`, cut evenly to `duration`; the one up to a release, or to where a load stops, is
shorter.
An output within a step is interpolated to second order from
the states at both its ends.  With `output: {exact: true}` steps end at outputs: the interval from one output to the
next is cut into the fewest equal steps that are no longer than `time.step`.
The last output is at `duration`, also when `every` does not divide it.
Without `time.step` steps follow the motion, cells are placed where the cable bends, and both as finely as `accuracy`
asks (1 % if it is not there): `accuracy: 1%`, `3 cm`, `50 N`, or a table such as
`accuracy: {position: 3 cm, tension: 1%, curvature: 5%}` or `{all: 2%, curvature: 5%}`, from 0.0001% to 10%.  `1%` is
`{all: 1%}`: of how far the line moves, of its tension, and of curvature where something rests on it; `plan` says what
that comes to.  In irregular waves extremes and standard
deviations are judged, unless `accuracy: {instant: 1%}` asks for every instant.  What the scene fixes (`time.step`,
`mesh`, `model.tolerance`) stays; if it cannot meet what is asked, the event `accuracy missed` says so.
[accuracy.md](accuracy.md) says where the figures of error come from and what they have been worth.
Keep 20 outputs or more of the shortest period you want to see; the steps must be as short as the motion needs, at
least 6 and better 20 in the shortest period of a moving end, and in the period of waves.

## Motion files

A CSV file whose first line names its columns, `t,x,y,z` or `t,rx,ry,rz` or all seven: time in s, position in m
(inertial, absolute), rotation vector in degrees counted from the end's own frame.  Lines that begin with `#` are
skipped.  It must begin at or before t = 0, cover the duration, have 12 samples a period or more, start from rest
where the end is held, and be smooth: a jump of velocity is refused with the time at which it happens.
Between samples the motion is a cubic spline with continuous acceleration.

A ramp that is then held: over 8 s the end of the first scene above, held at [70, 0, 0], rises by 2 m, and a clamped
end turns by 30 degrees about y.
The polynomial starts and stops with neither velocity nor acceleration; a straight ramp would be refused.

```python
import numpy as np

t = np.arange(0.0, 60.01, 0.25)  # as long as time.duration, and evenly: a spline rings over a wide gap
x = np.minimum(t / 8.0, 1.0)
grow = x**3 * (10.0 - 15.0 * x + 6.0 * x**2)  # from 0 to 1, then held
lift = np.column_stack([t, 70.0 + 0.0 * t, 0.0 * t, 2.0 * grow])
turn = np.column_stack([t, 0.0 * t, 30.0 * grow, 0.0 * t])
np.savetxt("lift.csv", lift, delimiter=",", header="t,x,y,z", comments="", fmt="%.8g")
np.savetxt("turn.csv", turn, delimiter=",", header="t,rx,ry,rz", comments="", fmt="%.8g")
```

`lift.csv` then begins with

```csv
t,x,y,z
0,70,0,0
0.25,70,0,0.00058209896
0.5,70,0,0.0044364929
```

and `end: {kind: pinned, position: [70, 0, 0], motion: {file: lift.csv}}` follows it.
"""


def words(schema: dict[str, Any]) -> str:
    """What a value may be, in words."""
    arms = [arm for key in ("anyOf", "oneOf") for arm in schema.get(key, []) if arm.get("type") != "null"]
    if arms:
        return " or ".join(dict.fromkeys(words(arm) for arm in arms))
    if "$ref" in schema:
        name = schema["$ref"].rsplit("/", 1)[-1]
        return f"[{name}](#{name.lower()})"
    if "const" in schema:
        return f"`{schema['const']}`"
    if "enum" in schema:
        return " or ".join(f"`{value}`" for value in schema["enum"])
    kind = schema.get("type")
    if isinstance(schema.get("additionalProperties"), dict):
        return f"by name: {words(schema['additionalProperties'])}"
    if kind == "array":
        if "prefixItems" in schema:
            first = schema["prefixItems"][0]
            of = {"array": "rows", "string": "names"}.get(str(first.get("type")), "numbers")
            return f"{schema['minItems']} {of}{bounds(first)}"
        least = schema.get("minItems", 0)
        return f"list of {words(schema['items'])}" + (f", at least {least}" if least > 1 else "")
    if kind in ("number", "integer"):
        return ("number" if kind == "number" else "whole number") + bounds(schema)
    return {"string": "text", "boolean": "`true` or `false`"}.get(str(kind), str(kind))


def bounds(schema: dict[str, Any]) -> str:
    signs = {"gt": ">", "exclusiveMinimum": ">", "ge": "≥", "minimum": "≥", "lt": "<", "le": "≤", "maximum": "≤"}
    said = [f"{sign} {schema[key]:g}" for key, sign in signs.items() if key in schema]
    return " " + " and ".join(said) if said else ""


def default(name: str, schema: dict[str, Any], required: list[str]) -> str:
    if name in required:
        return "**required**"
    value = schema.get("default")
    if "const" in schema or value is None or value == "" or isinstance(value, dict):
        return ""
    if value == []:
        return "none"
    text = f"{value:.4g}" if isinstance(value, float) and value != round(value, 4) else json.dumps(value)
    return f"`{text}`".replace('"', "")


def unit(description: str) -> tuple[str, str]:
    """The description without its unit, and the unit; units stand in brackets at the end."""
    if not description.endswith("]"):
        return description, ""
    text, _, measure = description[:-1].rpartition(" [")
    return text, "" if measure == "-" else measure


def table(schema: dict[str, Any]) -> Iterator[str]:
    yield "| key | value | unit | default | meaning |"
    yield "|---|---|---|---|---|"
    for name, field in schema["properties"].items():
        text, measure = unit(field.get("description", ""))
        cells = (f"`{name}`", words(field), measure, default(name, field, schema.get("required", [])), text)
        yield "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"


def folded(schema: dict[str, Any]) -> Iterator[str]:
    """The table, closed: its keys stand in the line that opens it, those that are required first and bold."""
    names, required = list(schema["properties"]), schema.get("required", [])
    marked = [f"<b><code>{name}</code></b>" for name in names if name in required]
    marked += [f"<code>{name}</code>" for name in names if name not in required]
    yield from ('<details markdown="1">', f"<summary>{', '.join(marked)}</summary>", "")
    yield from table(schema)
    yield from ("", "</details>")


def referred(schema: Any) -> Iterator[str]:
    """Names of the tables a schema refers to, in the order they are met."""
    if isinstance(schema, dict):
        if "$ref" in schema:
            yield schema["$ref"].rsplit("/", 1)[-1]
        for value in schema.values():
            yield from referred(value)
    elif isinstance(schema, list):
        for value in schema:
            yield from referred(value)


def former_names() -> Iterator[str]:
    """The keys that were renamed, table by table."""
    yield "## Former names"
    yield ""
    yield "These keys were renamed.  The former name is still read, and a note says where it stands and what it became."
    yield ""
    yield "| table | former name | name of today |"
    yield "|---|---|---|"
    tables = [Table]
    for table in tables:
        tables += table.__subclasses__()
    for table in sorted(tables, key=lambda kind: kind.__name__):
        for old, new in table.former.items():
            yield f"| [{table.__name__}](#{table.__name__.lower()}) | `{old}` | `{new}` |"
    yield ""


def combinations() -> Iterator[str]:
    """What is refused together, by the table that the checks read."""
    yield "## What does not combine"
    yield ""
    yield (
        "Pairs that are refused, each with what to do instead.  *Physics* cannot be otherwise; the rest is not worked "
        "out.  All other pairs of some thirty features are computed in the short form and with names, turned and "
        "mirrored (`pytest tests/combinations -m slow`)."
    )
    yield ""
    yield "| this | beside this | because |  |"
    yield "|---|---|---|---|"
    for x in REFUSALS:
        a, b = (f"{y.name} (`{y.key}`)" for y in (x.feature, x.beside))
        yield f"| {a} | {b} | {x.reason} | {x.kind} |"
    yield ""


def page() -> str:
    """The whole page."""
    order: list[str] = []
    lines = [HEAD]
    forms: dict[str, type[Table]] = {"Short form of one line": CableScene, "Points and lines": Network}
    for title, schema in ((title, form.model_json_schema()) for title, form in forms.items()):
        tables = schema.pop("$defs")
        known = len(order)

        def visit(name: str) -> None:
            if name not in order:
                order.append(name)
                for inner in referred(tables[name]["properties"]):  # noqa: B023  # called in this round only
                    visit(inner)

        for name in referred(schema["properties"]):
            visit(name)
        lines += [f"## {title}", "", " ".join(schema["description"].split()), "", *table(schema), ""]
        for name in order[known:]:
            text = " ".join(tables[name]["description"].split())
            lines += [f"### {name}", "", text, "", *folded(tables[name]), ""]
    return "\n".join([*lines, *former_names(), *combinations(), TAIL])


def main(arguments: list[str]) -> int:
    text = page()
    if "--check" in arguments:
        return 0 if PAGE.is_file() and PAGE.read_text(encoding="utf-8") == text else 1
    PAGE.write_text(text, encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
