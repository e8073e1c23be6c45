"""What every optional part costs where it is on, and that it costs nothing where it is off.

    pytest bench/test_bench_parts.py -m bench -s

Steps of one line are timed at the compiled call, bare and with one part more, in turns within one process; printed are
medians.  All share one compiled signature: what is off is a bit that is not set.
"""

import time
from statistics import median

import numpy as np
import pytest

import hybrid
from hybrid.kernels.state import books
from hybrid.model.build import build
from hybrid.model.plane import planar, untwist
from hybrid.solve.plane_stability import seed
from hybrid.solve.run import CompiledRun
from hybrid.solve.statics import Search, solve_statics
from hybrid.solve.stepper import Stepper

pytestmark = pytest.mark.bench
CELLS, STEPS, ROUNDS, STEP = 200, 60, 9, 0.02

SECTION = {"length": 20.0, "mass": 1.0, "axial_stiffness": 1e6, "bending_stiffness": 1.0, "rotary_inertia": 0}
WATER = {"density": 1025.0}
WET = {"diameter": 0.02}
WAVES = {"kind": "regular", "height": 0.2, "period": 4.0, "depth": 50.0}
FLOAT = {"kind": "float", "at": 10.0, "mass": 0.1, "volume": 0.0002, "drag_area": 0.01}
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
                "end": {"kind": "pinned", "position": [12, 0, 0]},
            },
            "initial": "equilibrium",
            "model": model,
            "mesh": {"cells": CELLS},
            "time": {"duration": 1.0, "step": STEP},
        }
        | tables
    )


class Line:
    """A line in motion, ready to be timed."""

    def __init__(self, asked, dimension=3, watched=True, extremes=False):
        model = build(asked)
        self.sea, self.ends = model.sea.at(0.0), model.ends.at(0.0)
        found = solve_statics(
            model.line,
            self.sea,
            self.ends,
            model.start,
            model.length,
            model.tension_scale,
            search=Search(others=model.other_starts),
        )
        self.start, line = found.state, model.line
        if dimension == 2:
            assert model.plane is not None
            line = planar(line, model.plane)
            untwist(line, self.ends, model.cable.held_tangent, self.start)
        self.stepper = Stepper(line, model.length, model.tension_scale)
        self.start.v[:, 2] = 0.1 * np.sin(np.pi * model.line.s / model.length)
        self.stepper.consistent_accelerations(self.sea, self.ends, np.zeros((2, 3)), self.start)
        self.line, self.model, self.watched = line, model, dimension == 2 and watched
        self.extremes = extremes
        self.cells, self.each, self.iterations = model.cells, [], 0.0

    def time(self):
        """One round in the compiled run: STEPS steps; seconds a step."""
        run, line = CompiledRun(0.5, np.zeros(0), self.extremes), self.line
        nodes, unbroken = np.arange(self.cells + 1), np.full(self.cells, np.inf)
        run.attach(
            self.stepper, self.sea, self.ends, self.model.ends.moves(), self.start.copy(), unbroken, nodes,
            np.zeros(nodes.size, np.int8),
        )  # fmt: skip
        if self.watched:
            push = seed(line.s, self.model.length / self.model.time_scale)
            run.carry((push, np.zeros_like(push)))
        run.place(self.start.r.copy())
        clock, count = run.clock, run.count
        clock.stop, clock.leg_step, count.leg_parts = np.inf, STEP, 10**9
        clock.floor = clock.slack_limit = -np.inf
        clock.bend_limit = clock.twist_limit = clock.scaled_jump = clock.most_turn = np.inf
        count.phase = books.BEGIN_STEP
        begin, total = time.process_time(), 0
        while run.count.steps < STEPS:
            code = run.go()
            assert code in (books.PAUSED, books.STEPPED), code
            total += int(run.log()[:, 2].sum())
        self.each.append((time.process_time() - begin) / int(run.count.steps))
        self.iterations = total / int(run.count.steps)

    @property
    def per_cell(self):
        """Microseconds per cell and step."""
        return 1e6 * median(self.each) / self.cells


def timed(*lines):
    """All of them, in turns; the first round warms caches."""
    for _ in range(ROUNDS):
        for line in lines:
            line.time()
    for line in lines:
        del line.each[0]
    return lines


def test_what_extremes_cost():
    """Lowest and highest of six quantities at every node, with their times, after every step."""
    for model in ("catenary", "rod"):
        for dimension in (2, 3):
            bare, kept = timed(*(Line(scene(model=model), dimension, extremes=x) for x in (False, True)))
            more = CELLS * (kept.per_cell - bare.per_cell)
            print(f"{model} {dimension}D: {CELLS * bare.per_cell:.1f} us a step, {more:+.1f} us with extremes")
            assert more < 0.2 * CELLS * bare.per_cell


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


def test_what_torsion_and_the_third_dimension_cost():
    """The same scenes in space and in their plane, with the watch on what would leave it, and without."""
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
    print(f"\n{'':26s} in space  in a plane, watched   ratio   not watched   ratio    us per cell and step")
    for name, asked in cases.items():
        space, flat, blind = timed(Line(asked), Line(asked, 2), Line(asked, 2, watched=False))
        ratio = space.per_cell / flat.per_cell
        print(
            f"  {name:24s} {space.per_cell:8.3f}  {flat.per_cell:18.3f} {ratio:8.2f} "
            f"{blind.per_cell:12.3f} {space.per_cell / blind.per_cell:8.2f}"
        )
        assert ratio >= (1.8 if "rod" in name and "catenary" not in name else 1.3), name


def test_what_is_absent_costs_nothing():
    """A scene with all tables named and nothing in them, and a bare one: the same bits, the same time within noise."""
    named = scene(
        section={"damping": {"mass": 0.0, "stiffness": 0.0}}, around={"gravity": 9.81}, output={"criteria": False}
    )
    for dimension in (3, 2):
        bare, same, again = timed(Line(scene(), dimension), Line(named, dimension), Line(scene(), dimension))
        assert bare.stepper.line.bits == same.stepper.line.bits
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
