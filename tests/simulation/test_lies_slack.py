"""Lines that are longer than along a level bed and straight up: they hang straight down, the rest lies slack.

The pull at an end above the bed is unique, w d, of the submerged weight w per length over the depth d; what lies carries
nothing.  On cells of length h it is known to w h/2, which an event says.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

import hybrid
from hybrid.cli.tables import equilibrium_facts
from hybrid.errors import ComputationError
from tests.scenes import cable_scene, network_scene, pinned_at

SECTION = {"length": 300.0, "mass": 100.0, "diameter": 0.1, "axial_stiffness": 8e8}
W = 9.80665 * (100.0 - 1025.0 * 0.25 * math.pi * 0.1**2)  # N/m


def around(depth: float, **bed: Any) -> dict[str, Any]:
    """Sea water over a bed."""
    fluid = {"density": 1025.0, "surface": 0.0}
    return {"gravity": 9.80665, "fluid": fluid, "seabed": {"z": -depth, "stiffness": 3e5, "damping": 3e4} | bed}


def slack(depth: float = 50.0, start: tuple[float, ...] = (), bed: Any = None, **more: Any) -> dict[str, Any]:
    """A chain from an anchor to a fairlead 200 m beside it, too long for them."""
    return (
        cable_scene(SECTION, {"kind": "pinned", "position": start or (-200.0, 0.0, -depth)}, pinned_at(0.0, 0.0, 0.0),
                    environment=around(depth, **(bed or {})), model="catenary", mesh=30) | more
    )  # fmt: skip


def forces_of(result: hybrid.Result) -> dict[str, list[float]]:
    return equilibrium_facts(result)["force"]


@pytest.mark.parametrize("depth", [50.0, 47.0])
def test_the_pull_of_a_slack_line_is_the_weight_that_hangs(depth: float) -> None:
    result = hybrid.static(slack(depth))
    x, y, z = forces_of(result)["end"]
    assert abs(z - W * depth) <= 0.5 * W * 10.0 and math.hypot(x, y) < 1e-6 * z
    (event,) = [x for x in result.events if x.kind == "slack"]
    assert f"known to {0.5 * W * 10.0:.3g} N" in event.text and event.s_a == 0.0
    # In the cell at the anchor the force on the support has a part along the line, which sinks a little from there.
    lies = result.tension[-1][(result.s >= 10.0) & (result.s < 300.0 - depth - 10.0)]
    assert np.abs(lies).max() < 1e-9 * z, "what lies carries nothing"


def test_both_ends_may_hang_and_shorter_cells_come_to_the_weight() -> None:
    asked = {"mesh": {"cells": 600}}
    found = forces_of(hybrid.static(slack(start=(-200.0, 30.0, -20.0)) | asked))
    assert found["start"][2] == pytest.approx(30.0 * W, rel=0.01)
    assert found["end"][2] == pytest.approx(50.0 * W, rel=0.01)


def test_an_accuracy_that_is_asked_is_met() -> None:
    asked = {key: value for key, value in slack().items() if key != "mesh"} | {"accuracy": "1%"}
    result = hybrid.static(asked)
    assert forces_of(result)["end"][2] == pytest.approx(50.0 * W, rel=0.01)


def test_lines_of_a_network_lie_slack_as_well() -> None:
    line = {"end": "b", "model": "catenary", "mesh": {"cells": 60}}
    result = hybrid.static(network_scene(
        {"a": {"position": (-200, 0, -50)}, "b": {"position": (0, 0, 0)}, "c": {"position": (200, 0, -50)}},
        {"slack": line | {"start": "a", "sections": [SECTION]},
         "taut": line | {"start": "c", "sections": [SECTION | {"length": 212.0}]}},
        environment=around(50.0)
    ))  # fmt: skip
    of = {name: [x for x in line.events if x.kind == "slack"] for name, line in result.lines.items()}
    assert len(of["slack"]) == 1 and not of["taut"]
    assert result.lines["slack"].tension[-1].max() == pytest.approx(50.0 * W, rel=0.05)


def test_a_run_begins_there_and_stays() -> None:
    result = hybrid.run(slack(time={"duration": 1.0, "step": 0.05}))
    assert np.ptp(result.tension[:, -1]) < 1e-6 * 50.0 * W


@pytest.mark.parametrize("why", [{"bed": {"slope": (0.02, 0.0)}}, {"dimension": 2}])
def test_what_has_no_such_shape_is_refused_with_what_a_bending_stiffness_does_to_it(why: Any) -> None:
    with pytest.raises(ComputationError, match=r"changes forces by up to 1\.2e\+04 N"):
        hybrid.static(slack(start=(-200.0, 0.0, -45.0), **why))


@pytest.mark.parametrize("direction", [None, (0.0, 1.0, -1.0)])
def test_which_way_a_free_end_was_laid_is_told_where_nothing_says_so(direction: Any) -> None:
    scene = slack(20.0, initial={"kind": "equilibrium", "direction": direction} if direction else "equilibrium")
    section = {"length": 60.0, "mass": 5.0, "diameter": 0.05, "bending_stiffness": 100.0}
    scene |= {"cable": {"sections": [section]}, "model": "rod"}
    scene["ends"] = {"start": {"kind": "pinned", "position": (0, 0, 0)}, "end": "free"}
    result = hybrid.static(scene)
    told = [x.text for x in result.events if x.kind == "laid one way"]
    assert len(told) == (direction is None)
    assert result.position[-1, -1, 1 if direction else 0] > 30.0
    assert all("the end lies free on the seabed at [4" in text for text in told)
