"""Lines that are paid out whose bending is no multiple of curvature, or that are stiffened along their arc length."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest
from test_payout import clamped, sagging

import hybrid
from hybrid.errors import SceneError

EI = 2e4
SAME = {"moment_curvature": [[0, 0], [0.01, 0.01 * EI], [0.1, 0.1 * EI]]}
# Its corners lie within the curvatures of the line.
TABLE = {"moment_curvature": [[0, 0], [0.004, 80.0], [0.012, 120.0], [0.05, 1500.0]]}
CONE = {"kind": "bend_stiffener", "range": [0, 10], "diameters": [0.4, 0.06], "bore": 0.05, "modulus": 1e8}
RESTRICTOR = {"kind": "bend_restrictor", "range": [40, 60], "radius": 60}


def paid(
    section: dict[str, Any], rate: float = 0.8, step: float = 0.05, duration: float = 8.0, **more: Any
) -> dict[str, Any]:
    scene = clamped(sagging("rod", 2e6, EI, rate, step, duration, **more))
    scene["ends"]["start"] = {"kind": "clamped", "position": [0, 0, 0], "tangent": [1, 0, -0.3]}
    if section:
        del scene["cable"]["sections"][0]["bending_stiffness"]
        scene["cable"]["sections"][0] |= section
    return scene


@cache
def linear(rate: float) -> hybrid.Result:
    """The line of constant stiffness."""
    return hybrid.run(paid({"bending_stiffness": EI}, rate))


@pytest.mark.parametrize("rate", [0.8, -0.8])
def test_a_table_that_is_a_constant_stiffness_does_as_that(rate: float) -> None:
    """Forces, places, curvature and energies, over nodes that enter and leave behind a clamp."""
    one, other = linear(rate), hybrid.run(paid(SAME, rate))
    assert np.abs(np.diff(one["payout/length"])).sum() > 4.0
    for name in ("reaction_end", "position", "curvature", "moment", "energy/bending", "work/end", "work/zones"):
        assert np.abs(other[name] - one[name]).max() < 1e-7 * np.abs(one[name]).max(), name


def settles(scene: dict[str, Any], length: float) -> tuple[hybrid.Result, hybrid.Result]:
    """A scene whose line of 100 m becomes so long, slowly, in water; and the equilibrium of a line of that length."""
    section = scene["cable"]["sections"][0]
    section["drag"] = {"normal": 1.5, "tangential": 0.3}
    section["damping"] = {"mass": 0.4}
    scene["environment"] = {"fluid": {"density": 1025}}
    scene["time"], scene["output"] = {"duration": 80.0, "step": 0.25}, {"every": 80.0}
    end = scene["ends"]["end"]
    del end["motion"]
    still = {**scene, "ends": {**scene["ends"], "end": {k: x for k, x in end.items() if k != "payout"}}}
    still["cable"] = {**scene["cable"], "sections": [{**section, "length": length}]}
    end["payout"] = {"lengths": [[0, 100], [15, 0.5 * (100 + length)], [30, length]]}
    # Those that ride with the winch and the one that grows are as long as all others at these lengths.
    scene["mesh"], still["mesh"] = (
        {"nodes": [*np.arange(0, 10, 0.5), *np.arange(10, x + 1, 2.5)]} for x in (100, length)
    )
    scene["output"] |= {"points": round(0.4 * max(100, length)) + 1}
    still["output"] = {"points": round(0.4 * length) + 1}
    return hybrid.run(scene), hybrid.static(still)


@pytest.mark.parametrize("length", [110.0, 90.0])
@pytest.mark.parametrize(
    ("section", "attachment"), [({}, CONE), (TABLE, None), ({}, RESTRICTOR)], ids=["stiffener", "table", "restrictor"]
)
def test_it_comes_to_rest_as_a_line_of_the_final_length(
    section: dict[str, Any], attachment: dict[str, Any] | None, length: float
) -> None:
    scene = paid(section)
    if attachment:
        scene["cable"]["attachments"] = [attachment]
    moved, rest = settles(scene, length)
    at, its = (np.searchsorted(x["s"], 2.5 * np.arange(0.4 * length) - 1e-6) for x in (moved, rest))
    np.testing.assert_allclose(moved["s"][at], rest["s"][its])
    assert np.abs(moved.position[-1, at] - rest.position[-1, its]).max() < 1e-5 * length
    assert np.abs(moved["moment"][-1, at] - rest["moment"][-1, its]).max() < 1e-5 * np.abs(rest["moment"]).max()
    pull = np.linalg.norm(rest["reaction_end"][-1])
    assert np.linalg.norm(moved["reaction_end"][-1] - rest["reaction_end"][-1]) < 1e-5 * pull


def bent() -> dict[str, Any]:
    """A table at the winch, and a stiffener at the other end."""
    scene = paid(TABLE)
    scene["cable"]["attachments"] = [CONE]
    return scene


def test_what_cannot_be_is_refused() -> None:
    near = paid({})
    near["cable"]["attachments"] = [CONE | {"range": [90, 100]}]
    other = paid(TABLE)
    other["ends"]["end"]["payout"]["reel"] = [{**other["cable"]["sections"][0], **SAME}]
    for scene, where in ((near, "s = 100 m, and the winch"), (other, "ends.end.payout.reel[0].moment_curvature")):
        with pytest.raises(SceneError) as refused:
            hybrid.plan(scene)
        assert where in str(refused.value)
