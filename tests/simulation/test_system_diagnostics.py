"""Lines of a system are looked at after every step as a cable is: the same events at the same times."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import hybrid
import hybrid.kernels

LIFT = [[0, 0, 0, 0], [0.1, 0, 0, 0], [0.15, 200, 0, 2000], [0.4, 200, 0, 2000], [0.45, 0, 0, 0], [9, 0, 0, 0]]


def both(section: dict[str, Any], model: Any, ends: list[dict[str, Any]], **more: Any) -> list[list[Any]]:
    """Events of a line as a cable and as a system of one line."""
    line = {"sections": [section]}
    start, end = ({"kind": "pinned"} | x if "position" in x else x for x in ends)
    thrust = {"thrust" if k == "force" else k: x for k, x in end.items() if k != "initial_guess"}
    one = {"cable": line, "ends": {"start": start, "end": thrust}, "initial": "equilibrium", "model": model}
    joined = line | {"start": "a", "end": "b", "model": model, "mesh": {"cells": 12}}
    points = [{k: x for k, x in end.items() if k != "kind"} for end in ends]
    many = {"points": dict(zip("ab", points, strict=True)), "lines": {"line": joined}}
    found = [
        hybrid.run(one | {"mesh": {"cells": 12}, "dimension": 3} | more).events,
        hybrid.run(many | more).lines["line"].events,
    ]
    kinds = ("coarse step", "snap", "slack", "unresolved bend", "undamped")
    return [[x for x in events if x.kind in kinds] for events in found]


CASES = {
    "coarse step": (
        {"length": 30, "mass": 2, "axial_stiffness": 1e6}, "catenary",
        [{"position": [0, 0, 0], "motion": {"heave": {"amplitude": 0.3, "period": 2}, "ramp": 2}}, {"position": [20, 0, 0]}],
        {"time": {"duration": 6, "step": 0.25}},
    ),
    "snap": (
        {"length": 10, "mass": 2}, {"kind": "catenary", "slack": "warn"},
        [{"position": [0, 0, 0]}, {"kind": "body", "initial_guess": [0, 0, -10], "mass": 100, "force": {"history": LIFT}}],
        {"time": {"duration": 2, "step": 0.01, "rho_inf": 0.5}},
    ),
}  # fmt: skip


@pytest.mark.parametrize("kind", CASES)
def test_a_line_of_a_system_says_what_the_cable_says(kind: str) -> None:
    section, model, ends, more = CASES[kind]
    cable, line = both(section, model, ends, **more)
    assert kind in {x.kind for x in cable}
    line, cable = (sorted((x.t, x.kind) for x in events) for events in (line, cable))
    assert [kind for _, kind in line] == [kind for _, kind in cable]
    np.testing.assert_allclose([t for t, _ in line], [t for t, _ in cable], atol=1e-6)


def test_steps_that_are_watched_go_on_from_a_checkpoint(tmp_path: Path) -> None:
    """What is remembered of steps for the end of the run is in the checkpoint: the same event, whenever it stopped."""
    section, model, ends, more = CASES["coarse step"]
    line = {"start": "a", "end": "b", "sections": [section], "model": model, "mesh": {"cells": 12}}
    scene = {"points": dict(zip("ab", ends, strict=True)), "lines": {"line": line}}
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
    inlined = ("network", "junctions", "joined_lines", "carried_frames", "bodies", "powers", "accept", "extremes")
    read = {
        name: re.findall(r"job\.task\.(?:cv|ca|dt)\b", next(folder.rglob(f"{name}.py")).read_text()) for name in inlined
    }
    assert not any(read.values()), read
