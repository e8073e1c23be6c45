"""What every optional part costs where it is on, and that it costs nothing where it is off.

    pytest bench/test_bench_parts.py -m bench -s

Runs of one line are timed from their first step on, bare and with one part more, in turns within one process; printed
are medians.  All share one compiled signature: what is off is a bit that is not set.
"""

from statistics import median

import numpy as np
import pytest

import hybrid
import hybrid.solve.network_steps

pytestmark = pytest.mark.bench
CELLS, ROUNDS, STEP = 200, 9, 0.02
MOTION = {"heave": {"amplitude": 0.1, "period": 2.0}, "surge": {"amplitude": 0.1, "period": 3.0}, "ramp": 0.3}

SECTION = {"length": 20.0, "mass": 1.0, "axial_stiffness": 1e6, "bending_stiffness": 1.0, "rotary_inertia": 0}
WATER = {"density": 1025.0}
WET = {"diameter": 0.02}
WAVES = {"kind": "regular", "height": 0.2, "period": 4.0, "depth": 50.0}
FLOAT = {"kind": "float", "at": 10.0, "mass": 0.1, "volume": 0.0002, "drag_area": 0.01}
OUTPUT = {"every": 4.0, "errors": False}
BED = {"z": -6.0, "stiffness": 1000.0, "damping": 50.0}
# part -> changes of the section, of the environment, of the attachments
PARTS = {
    "drag": (WET | {"drag": {"normal": 1.2, "tangential": 0.02}}, {"fluid": WATER}, []),
    "added mass": (WET | {"added_mass": {"normal": 1.0}}, {"fluid": WATER}, []),
    "drag in a current": (WET | {"drag": {"normal": 1.2}}, {"fluid": WATER | {"current": [0.2, 0, 0]}}, []),
    "surface": (WET, {"fluid": WATER | {"surface": 1.0}}, []),
    "waves and surface": (WET, {"fluid": WATER | {"surface": 1.0, "waves": WAVES}}, []),
    "bodies": (WET, {"fluid": WATER}, [FLOAT]),
    "mass damping": ({"damping": {"mass": 0.1}}, {}, []),
    "stiffness damping": ({"damping": {"stiffness": 0.01}}, {}, []),
    "seabed": ({}, {"seabed": BED}, []),
    "seabed with friction": ({}, {"seabed": BED | {"friction": 0.5}}, []),
    "rotary inertia": ({"rotary_inertia": 1e-5}, {}, []),
}


def scene(model="rod", section=None, around=None, attached=(), **tables):
    """A line of 20 m that hangs between two ends, 12 m apart."""
    return hybrid.validate_scene(
        {
            "environment": around or {},
            "cable": {"sections": [SECTION | (section or {})], "attachments": list(attached)},
            "ends": {
                "start": {"kind": "pinned", "position": [0, 0, 0]},
                "end": {"kind": "pinned", "position": [12, 0, 0], "motion": MOTION},
            },
            "initial": "equilibrium",
            "model": model,
            "mesh": {"cells": CELLS},
            "time": {"duration": 4.0, "step": STEP},
            "output": OUTPUT,
        }
        | tables
    )


class Line:
    """Whole runs of a line in motion, to be timed."""

    def __init__(self, asked, dimension=3, parts=()):
        self.scene, self.each, self.iterations = asked.model_copy(update={"dimension": dimension}), [], 0.0
        self.parts = parts

    def time(self):
        """One run; seconds a step, from its first on."""
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(hybrid.solve.network_steps, "CELL_STEPS", 10 * CELLS)  # the time is noted after every call
            result = hybrid.run(self.scene, parts=self.parts)
        with result:
            cpu = result.steps["cpu"]
            self.each.append((cpu[-1] - cpu[0]) / (len(cpu) - 1))
            self.iterations = float(np.mean(result.steps["iterations"]))

    @property
    def per_cell(self):
        """Microseconds per cell and step."""
        return 1e6 * median(self.each) / CELLS


def timed(*lines):
    """All of them, in turns; the first round warms caches."""
    for _ in range(ROUNDS):
        for line in lines:
            line.time()
    for line in lines:
        del line.each[0]
    return lines


def test_what_each_part_costs():
    for dimension in (3, 2):
        lines = {"bare": Line(scene(), dimension)}
        for name, (section, around, attached) in PARTS.items():
            lines[name] = Line(scene(section=section, around=around, attached=attached), dimension)
        timed(*lines.values())
        bare = lines["bare"]
        where = "in space" if dimension == 3 else "in a plane"
        print(f"\nrod of {CELLS} cells {where}, us per cell and step (iterations)")
        for name, line in lines.items():
            more = line.per_cell / line.iterations - bare.per_cell / bare.iterations
            print(f"  {name:22s} {line.per_cell:6.3f} ({line.iterations:.2f})   {more:+.3f} per iteration")
            # the dearest, contact and stretches of the surface in space, cost about half a rod
            assert more < 0.6 * lines["bare"].per_cell / lines["bare"].iterations + 0.15, name


class Asked(hybrid.RunPart):
    """A user's own part that Python calls after every step."""

    name = "asked"

    def after_step(self, run):
        pass


class Reading(Asked):
    """One that reads the tensions, too."""

    name = "reading"

    def after_step(self, run):
        run.tension()


def test_what_a_part_of_the_users_own_costs():
    asked = scene("catenary", mesh={"cells": 20}, time={"duration": 40.0, "step": STEP}, output={"every": 40.0})
    bare, called, reading = timed(Line(asked, 2), Line(asked, 2, [Asked()]), Line(asked, 2, [Reading()]))
    steps = [1e6 * median(x.each) for x in (bare, called, reading)]
    print("\ncatenary of 20 cells in a plane, us a step: {:.1f}; with a part {:.1f}, that reads {:.1f}".format(*steps))
    assert steps[1] - steps[0] < 200.0


def test_what_torsion_and_the_third_dimension_cost():
    """The same scenes in space and in their plane, with the watch on what would leave it."""
    wet, around, _ = PARTS["drag in a current"]
    cases = {
        "rod": scene(),
        "catenary": scene("catenary"),
        "rod in water": scene(section=wet, around=around),
        "catenary in water": scene("catenary", section=wet, around=around),
        "touchdown, rod": scene(section=wet, around={"fluid": WATER, "seabed": BED | {"friction": 0.5}}),
        "touchdown, catenary": scene("catenary", section=wet, around={"fluid": WATER, "seabed": BED}),
        "half rod, half catenary": scene(
            {"kind": "zones", "zones": [{"rod": 10.0, "cells": 100}, {"catenary": 10.0, "cells": 100}]}, mesh=None
        ),
    }
    print(f"\n{'':26s} in space  in a plane, watched   ratio    us per cell and step")
    for name, asked in cases.items():
        space, flat = timed(Line(asked), Line(asked, 2))
        ratio = space.per_cell / flat.per_cell
        print(f"  {name:24s} {space.per_cell:8.3f}  {flat.per_cell:18.3f} {ratio:8.2f}")
        assert ratio >= (1.8 if "rod" in name and "catenary" not in name else 1.3), name


def test_what_is_absent_costs_nothing():
    """A scene with all tables named and nothing in them, and a bare one: the same bits, the same time within noise."""
    named = scene(
        section={"damping": {"mass": 0.0, "stiffness": 0.0}},
        around={"gravity": 9.81},
        output=OUTPUT | {"criteria": False},
    )
    for dimension in (3, 2):
        bare, same, again = timed(Line(scene(), dimension), Line(named, dimension), Line(scene(), dimension))
        ratio, noise = same.per_cell / bare.per_cell, again.per_cell / bare.per_cell
        print(f"\ndimension {dimension}: all named and zero over bare {ratio:.3f}, bare over itself {noise:.3f}")
        assert abs(ratio - 1.0) < 0.05 + 2.0 * abs(noise - 1.0)


def test_what_zones_that_move_and_outputs_cost():
    """Whole runs: the manager at every step, the criteria as fields, and 100 outputs; a share of the run."""
    long = {"time": {"duration": 10.0, "step": STEP}, "mesh": {"cells": 50}}

    def run(**tables):
        each = []
        for _ in range(3):
            result = hybrid.run(scene(**(long | tables)))
            each.append(result.steps["cpu"][-1] / len(result.steps["t"]))
        return 1e6 * median(each)

    fixed = run(output={"every": 10.0})
    moving = run(model={"kind": "adaptive", "force_rod": [[0.0, 20.0]]}, output={"every": 10.0})
    outputs = run(output={"every": 0.1})
    criteria = run(
        model={"kind": "adaptive", "force_rod": [[0.0, 20.0]]},
        output={"every": 0.1, "criteria": True},
    )
    plain = run(model={"kind": "adaptive", "force_rod": [[0.0, 20.0]]}, output={"every": 0.1})
    print(f"\n50 cells, us a step of a whole run: rod {fixed:.0f}; with a manager {moving:.0f}")
    print(
        f"an output every 5 steps: rod {outputs:.0f}; with a manager {plain:.0f}; with criteria as fields {criteria:.0f}"
    )
    assert moving < 4.0 * fixed and criteria < 1.5 * plain
