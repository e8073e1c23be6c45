"""The model error against the truth, and what it costs.

    pytest bench -m bench -s -k model_error

The truth is a rod on the same nodes with the same steps: what differs is bending alone.
"""

from __future__ import annotations

import time
from copy import deepcopy
from typing import Any

import numpy as np
import pytest
from ruamel.yaml import YAML

import hybrid
from hybrid.kernels.state.books import Clock, Counts
from hybrid.kernels.watch.bending_error import advance_error
from hybrid.model.build import build
from hybrid.model.network import build_system
from hybrid.scene.short_form import network_of
from hybrid.simulation.bending_correction import corrector_for
from hybrid.simulation.equilibrium import equilibrium_of
from hybrid.solve.stepper import Stepper

pytestmark = pytest.mark.bench


def example(name: str, model: Any, **more: Any) -> hybrid.Scene:
    """An example with another model, errors on; more: tables to replace, or None to leave out."""
    with open(f"examples/{name}.yaml") as file:
        data = YAML(typ="safe", pure=True).load(file)
    data |= {"model": model} | more
    data.setdefault("output", {})["errors"] = True
    return hybrid.validate_scene({k: x for k, x in data.items() if x is not None})


def zones(*parts: tuple[str, float, int]) -> dict[str, Any]:
    return {"kind": "zones", "zones": [{kind: length, "cells": n} for kind, length, n in parts]}


def clamped(model: Any, kind: str = "clamped", EI: float = 30.0) -> hybrid.Scene:
    """A cable in a current across its plane, held by two clamps that bend it by up to 60 degrees (or two pins)."""
    start = {"kind": kind, "position": [0, 0, 0], "tangent": [0.3, 0.1, -1]}
    end = {"kind": kind, "position": [40, 5, -25], "tangent": [1, 0, 0.2]}
    start["motion"] = {
        "heave": {"amplitude": 0.5, "period": 6.0}, "sway": {"amplitude": 0.5, "period": 9.0}, "ramp": 8,
    }  # fmt: skip
    if kind == "pinned":
        start.pop("tangent"), end.pop("tangent")
    section = {
        "length": 60, "diameter": 0.03, "mass": 2.0, "axial_stiffness": 2e6, "bending_stiffness": EI,
        "drag": {"normal": 1.2, "tangential": 0.02}, "added_mass": {"normal": 1.0},
    }  # fmt: skip
    return hybrid.validate_scene(
        {
            "environment": {"fluid": {"density": 1025, "current": {"kind": "uniform", "velocity": [0.3, 0.8, 0]}}},
            "cable": {"sections": [section]}, "ends": {"start": start, "end": end}, "initial": "equilibrium",
            "mesh": {"cells": 120}, "time": {"duration": 30, "step": 0.05}, "model": model,
            "output": {"every": 0.25, "errors": True},
        }
    )  # fmt: skip


def twisted(model: Any) -> hybrid.Scene:
    """A sag between clamps along it, 0.4 turns of one against the other: torque out of its plane."""
    a, slope = 2.0 * np.pi * 0.4, 0.55
    end = {
        "kind": "clamped", "position": [20, 0, 0], "tangent": [1, 0, slope],
        "normal": [0, -float(np.sin(a)), float(np.cos(a))], "motion": {"heave": {"amplitude": 0.2, "period": 3.0}, "ramp": 3},
    }  # fmt: skip
    section = {
        "length": 21.0, "mass": 1.0, "axial_stiffness": 1e6, "bending_stiffness": 0.5, "torsional_stiffness": 80.0,
        "damping": 0.5,
    }  # fmt: skip
    return hybrid.validate_scene(
        {
            "cable": {"sections": [section]},
            "ends": {
                "start": {"kind": "clamped", "position": [0, 0, 0], "tangent": [1, 0, -slope], "normal": [0, 0, 1]},
                "end": end,
            },
            "initial": "equilibrium", "mesh": {"cells": 400}, "time": {"duration": 8.0, "step": 0.02}, "model": model,
            "output": {"every": 0.2, "errors": True},
        }
    )  # fmt: skip


def hung(joint: float, kind: str, at_rest: bool) -> hybrid.Scene:
    cells = round(50 * joint)
    parts = [(kind, joint, cells), ("rod", 2.0 - joint, 100 - cells)]
    more = {"initial": "equilibrium"} if at_rest else {}
    return example(
        "02_suspension", zones(*parts), time={"duration": 0.1 if at_rest else 10.0, "step": 0.01},
        output={"every": 0.1}, **more,
    )  # fmt: skip


TOUCHDOWN = {"time": {"duration": 60.0, "step": 0.1}}
BEDDED = {"mesh": None} | TOUCHDOWN
S = {"time": {"duration": 30.0, "step": 0.05}}
EVERY = {"kind": "adaptive"}  # base cells everywhere: the same nodes whatever they are


def cases():
    """Name, scene of a model, of the rod."""
    for name, low, rod in (
        (
            "touchdown, catenary",
            example("touchdown", "catenary", **TOUCHDOWN), example("touchdown", "rod", **TOUCHDOWN),
        ),
        (
            "touchdown, rod 70 to 120 m",
            *(
                example("touchdown", zones((k, 70, 28), ("rod", 50, 20), (k, 130, 52)), **BEDDED)
                for k in ("catenary", "rod")
            ),
        ),
        (
            "s_tether, catenary",
            example("s_tether", {"kind": "catenary", "slack": "warn"}, **S), example("s_tether", "rod", **S),
        ),
        (
            "s_tether, rod 8 to 50 m",
            *(
                example("s_tether", zones((k, 8, 16), ("rod", 42, 84), (k, 10, 20)), mesh=None, **S)
                for k in ("catenary", "rod")
            ),
        ),
        ("pins, current across", *(clamped(k, "pinned", 300.0) for k in ("catenary", "rod"))),
        ("clamps, current across", *(clamped(k) for k in ("catenary", "rod"))),
        ("clamps, EI ten times", *(clamped(k, EI=300.0) for k in ("catenary", "rod"))),
        ("twisted by 0.4 turns", *(twisted(k) for k in ("catenary", "rod"))),
    ):  # fmt: skip
        yield name, low, rod
    for joint in (0.2, 0.4, 0.6, 0.8, 1.0, 1.2, 1.5, 1.7):
        yield f"suspension at rest, {joint} m", *(hung(joint, k, True) for k in ("catenary", "rod"))
    for joint in (0.5, 1.0, 1.5):
        yield f"suspension let go, {joint} m", *(hung(joint, k, False) for k in ("catenary", "rod"))
    for name, tolerance in (
        ("touchdown", 2e-5), ("s_tether", 1e-3), ("s_tether", 1e-2), ("slack_on_seabed", 1e-3), ("irregular_sea", 3e-3),
    ):  # fmt: skip
        plain = example(name, EVERY | {"tolerance": tolerance}, mesh={"cells": 120})
        plain = plain.model_copy(
            update={
                "time": plain.require_time().model_copy(update={"duration": min(plain.require_time().duration, 40.0)})
            }
        )
        model = plain.model.model_copy(update={"force_rod": ((0.0, plain.length),)})
        yield f"{name}, adaptive {tolerance:g}", plain, plain.model_copy(update={"model": model})


def test_model_error_effectivity():
    """Effectivity: estimated over true largest distance to the rod, median over time."""
    print(f"\n{'':28s} {'true (m)':>9s}  effectivity (5 % .. 95 %)")
    for name, low, rod in cases():
        a, b = hybrid.run(low), hybrid.run(rod)
        true = np.linalg.norm(b["position"] - a["position"], axis=2).max(axis=1)
        clear = true > 1e-3 * true.max()
        ratio = (a["errors/model/position"].max(axis=1) / np.maximum(true, 1e-300))[clear]
        print(
            f"{name:28s} {np.median(true[clear]):9.2e}  {np.median(ratio):5.3f} ({np.percentile(ratio, 5):.2f} .. "
            f"{np.percentile(ratio, 95):.2f})"
        )
        if "adaptive" not in name and "s_tether, catenary" not in name:
            assert 0.7 < np.median(ratio) < 1.3, name  # the worst when written: 0.94 and 1.09


def test_model_error_cost():
    """Processor time of the corrector over that of a catenary's step, kernels alone; and of a whole run."""
    print()
    for name, model, cells in (
        ("touchdown", "catenary", 100), ("touchdown", "catenary", 1600),
        ("s_tether", {"kind": "catenary", "slack": "warn"}, 100), ("s_tether", {"kind": "catenary", "slack": "warn"}, 1600),
    ):  # fmt: skip
        scene = example(name, model, mesh={"cells": cells})
        m, dt = build(scene), scene.require_time().step
        network = network_of(scene)
        rest = equilibrium_of(network, build_system(network), 0.0).state.lines[0]
        medians = []
        for keep in (False, True):
            old, new = rest.copy(), rest.copy()
            stepper, corrector = Stepper(m.line, m.length, m.tension_scale, keep=keep), corrector_for(m)
            sea, ends, clock, counts = (
                m.sea.at(0.0),
                m.ends.at(0.0),
                Clock(),
                Counts(),
            )
            clock.last_dt, clock.rho = dt, 0.5
            corrector.rest(sea, ends, old)
            table = corrector.bind(m.line, sea, ends, (old, new), clock, counts, stepper.work)
            stepper.consistent_accelerations(m.sea.at(0.0), m.ends.at(0.0), m.ends.acceleration(0.0, 1e-3 * dt), old)
            took = []
            for k in range(150):
                sea, ends = m.sea.at((k + 1) * dt), m.ends.at((k + 1) * dt)
                begin = time.perf_counter()
                stepper.step(sea, ends, old, new, dt, 0.5)
                middle = time.perf_counter()
                old, new = new, old
                if keep:
                    counts.parity = 1 - counts.parity
                    advance_error(table)
                took.append((middle - begin, time.perf_counter() - middle))
            medians.append(np.median(took, axis=0) * 1e6)
        (step, _), (kept, more) = medians
        print(
            f"{name:12s} {cells:5d} cells: step {step:.0f} us, keeping factors {kept:.0f} us, corrector {more:.0f} us"
        )
        assert more < 0.6 * step
    for name, model in (("touchdown", "catenary"), ("s_tether", {"kind": "catenary", "slack": "warn"})):
        runs = {}
        for errors in (False, True):
            scene = example(name, model)
            scene = scene.model_copy(update={"output": scene.output.model_copy(update={"errors": errors})})
            took = []
            for _ in range(5):
                begin = time.process_time()
                hybrid.run(deepcopy(scene))
                took.append(time.process_time() - begin)
            runs[errors] = float(np.median(took))
        print(
            f"{name:12s} whole run: {runs[False]:.3f} s without, {runs[True]:.3f} s with: {runs[True] / runs[False] - 1:.0%}"
        )
