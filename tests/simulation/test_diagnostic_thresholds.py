"""Thresholds of the diagnostics from either side, in the numbers that the manual and theory.md give."""

from __future__ import annotations

import re
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from problems import pinned, scene

import hybrid
import hybrid.kernels
from hybrid.errors import Outcome
from hybrid.model.build import build
from hybrid.model.resolution import first_resolution
from hybrid.scene.read import one_line
from hybrid.simulation.diagnostics import Diagnostics
from hybrid.simulation.events import EventLog

SECTION = {"length": 10.0, "mass": 1.0, "bending_stiffness": 2.0, "axial_stiffness": 1e5}
SCENE = one_line(scene(SECTION, pinned(), pinned(9.5, 0, 0), model="rod", mesh={"cells": 10}))
MODEL = build(SCENE, first_resolution(SCENE))


def watch() -> Diagnostics:
    return Diagnostics(MODEL, EventLog())


def said(found: Diagnostics) -> list[str]:
    return [kind for _, _, _, kind, _ in found.events.waiting()]


def sharp(found: Diagnostics, bend: float, twist: float = 0.0) -> Any:
    """A bend (rad) at node 4 and a twist (rad) at node 6, from one cell to the next."""
    return found.shape(1.0, [bend, 4, twist, 6], MODEL.start)


@pytest.mark.parametrize(("angle", "told"), [(0.98, False), (1.02, True), (1.9, True)])
def test_a_bend_or_a_twist_beyond_one_radian_is_not_resolved(angle: float, told: bool) -> None:
    bent, twisted = watch(), watch()
    assert sharp(bent, angle) is None and sharp(twisted, 0.0, angle) is None
    assert said(bent) == ["unresolved bend"] * told and said(twisted) == ["unresolved twist"] * told
    if told:
        assert [s for _, s, *_ in bent.events.waiting()] == [4.0]


def test_it_is_told_again_where_it_is_half_as_much_again() -> None:
    found = watch()
    for angle in (1.1, 1.6, 1.7, 2.5, 2.6):  # told at 1.1, 1.7, 2.6
        sharp(found, angle)
    assert len(said(found)) == 3


def test_a_twist_beyond_two_radians_ends_the_run() -> None:
    assert sharp(watch(), 0.0, 1.99) is None
    assert sharp(watch(), 0.0, 2.01) == (Outcome.TWISTED_TOO_FAR, 6)


def test_the_compiled_run_asks_at_the_same_angles() -> None:
    clock: Any = SimpleNamespace()
    watch().watch(clock)
    assert clock.bend_limit == clock.twist_limit == 1.0


def finished(rho: float, steps: float, moved: float = 2.0, peaks: tuple[float, float] = (10.0, 20.0)) -> Diagnostics:
    """After a run with so many steps to a period where the motion, by `moved` (m), is fastest."""
    found, turn = watch(), 2.0 * np.pi / steps
    clock = SimpleNamespace(least_peak=peaks[0], largest_peak=peaks[1], moved=moved, rho=rho)
    worst = np.array([[moved * turn**3, 3.0, 0.1, 5.0]])  # what a step leaves, m; t, dt, s
    found.finish(SimpleNamespace(clock=clock, counts=SimpleNamespace(measured=1), worst=worst))  # type: ignore[arg-type]
    return found


@pytest.mark.parametrize(("rho", "few", "enough"), [(1.0, 7.4, 8.0), (0.5, 13.6, 14.5), (0.0, 23.5, 25.0)])
def test_steps_to_a_period_below_which_a_step_is_too_long(rho: float, few: float, enough: float) -> None:
    """theory.md, section 8: 8 with rho_inf = 1, 14 with 0.5, 24 with 0."""
    assert said(finished(rho, few)) == ["coarse step"] and said(finished(rho, enough)) == []
    ((t, s, _, _, text),) = finished(rho, few).events.waiting()
    assert (t, s) == (3.0, 5.0) and f"about {few:.2g} steps to a period" in text
    assert said(finished(rho, few, 1e-7, (20.0, 20.0))) == [], "what Newton's tolerance leaves is no motion"


# --- steps that are watched ---


def test_steps_that_are_watched_go_on_from_a_checkpoint(tmp_path: Path) -> None:
    """What is remembered of steps for the end of the run is in the checkpoint: the same event, whenever it stopped."""
    section = {"length": 30, "mass": 2, "axial_stiffness": 1e6}
    moved = {"position": [0, 0, 0], "motion": {"heave": {"amplitude": 0.3, "period": 2}, "ramp": 2}}
    line = {"start": "a", "end": "b", "sections": [section], "model": "catenary", "mesh": {"cells": 12}}
    more = {"time": {"duration": 6, "step": 0.25}}
    scene = {"points": {"a": moved, "b": {"position": [20, 0, 0]}}, "lines": {"line": line}}
    whole = hybrid.run(scene | more)
    short = {"time": more["time"] | {"duration": 4}}
    hybrid.run(scene | short, tmp_path / "a.h5")
    resumed = hybrid.resume(tmp_path / "a.h5", until=6)
    events = [[(x.t, x.text) for x in r.lines["line"].events if x.kind == "coarse step"] for r in (whole, resumed)]
    assert events[0] and events[1][-1] == events[0][-1]


def test_what_a_kernel_writes_into_a_table_it_does_not_read_there() -> None:
    """Tables are read as what never changes (kernels.machine.references): what solve_system writes into those of its lines,

    cv, ca and dt of their tasks, is passed to what is inlined in it."""
    folder = Path(hybrid.kernels.__file__).parent
    inlined = ("network", "junctions", "joined_lines", "bodies", "energies", "accept", "extremes")
    read = {
        name: re.findall(r"job\.task\.(?:cv|ca|dt)\b", next(folder.rglob(f"{name}.py")).read_text()) for name in inlined
    }
    assert not any(read.values()), read
