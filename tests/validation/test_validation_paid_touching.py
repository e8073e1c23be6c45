"""Lines that are paid out while they touch other lines and bodies: the rest of longer lines, Coulomb's law, resume."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import hybrid
import hybrid.simulation.run
from tests.validation.test_validation_body_contact import on_two_lines
from tests.validation.test_validation_lines_contact import AREA, DENSITY, RADIUS, crossing, force_between

Tables = dict[str, Any]
G, MORE = 9.81, 0.08  # m/s2; m that is paid out
FRICTION, ABOVE = 0.3, 0.04  # m, by how much higher the pins of the upper rope are


def let_out(friction: float, side: str = "end", duration: float = 3.0) -> Tables:
    """The upper rope hangs above the lower one until a winch has let out more of it."""
    tables = crossing(-ABOVE, contact={"friction": friction}, time={"duration": duration, "step": 0.01})
    upper = tables["lines"]["upper"]
    del upper["initial"]
    upper["connections"] = {side: {"kind": "pinned", "payout": {"rate": MORE, "ramp": 0.3, "until": 1.0}}}
    tables["output"] = {"points": 81, "every": 0.1}
    return tables


def longer() -> Tables:
    """At rest with as much rope."""
    tables = crossing(-ABOVE)
    (section,) = tables["lines"]["upper"]["sections"]
    tables["lines"]["upper"]["sections"] = [section | {"length": section["length"] + MORE}]
    tables["lines"]["upper"] |= {
        "mesh": {"cells": 86},
        "initial": {"points": [[-0.4, 0, 0.04], [0, 0, 0.36], [0.4, 0, 0.04]]},
    }
    return tables


@pytest.fixture(scope="module")
def rest() -> Any:
    return hybrid.static(longer())


def pressed(result: Any, row: int, length: float) -> tuple[float, float]:
    """By what the pins of the upper rope bear less than its weight, and those of the lower one more, N."""
    off, on = force_between(result, row)
    return off + DENSITY * AREA * G * (length - 1.0), on


@pytest.mark.parametrize("side", ["end", "start"])
def test_a_rope_that_is_let_out_onto_another_rests_as_one_that_is_longer(side: str, rest: Any) -> None:
    result = hybrid.run(let_out(0.0, side, 6.0))
    assert any(e.kind == "lines touch" and 0.1 < e.t < 1.5 for e in result.events)
    assert result.lines["upper"]["payout/length"][-1] == pytest.approx(1.0 + MORE)
    _, wanted = pressed(rest, 0, 1.0 + MORE)
    off, on = pressed(result, -1, 1.0 + MORE)
    assert wanted > 0.05
    assert on == pytest.approx(wanted, rel=0.01)
    assert off == pytest.approx(on, rel=0.01)
    assert result["contacts/upper/lower/force"][-1, 2] == pytest.approx(on, rel=2e-3)
    lowest, like = (x.lines["upper"].position[-1][:, 2].min() for x in (result, rest))
    assert lowest == pytest.approx(like, abs=0.1 * RADIUS)


# --- with friction, both ways ---------------------------------------------------------------------------


def in_and_out(duration: float = 2.4) -> Tables:
    """The rope is let out onto the other one and taken in again, over it, with friction."""
    tables = let_out(FRICTION, duration=duration)
    rates = [[0.0, 0.0], [0.3, 0.1], [0.9, 0.1], [1.2, 0.0], [1.5, 0.0], [1.8, -0.02], [6.0, -0.02]]
    tables["lines"]["upper"]["connections"]["end"]["payout"] = {"rates": rates}
    return tables


@pytest.fixture(scope="module")
def whole() -> hybrid.Result:
    return hybrid.run(in_and_out())


def test_what_a_paid_rope_does_to_another_is_booked(whole: hybrid.Result) -> None:
    """Nodes have entered and left in contact; 1e-3 of what the winch does is left, and friction takes energy."""
    upper, lower = whole.lines["upper"], whole.lines["lower"]
    length = np.array(upper["payout/length"])
    assert np.ptp(length) > 2.0 / 80
    touching = np.array(upper["self_contact"]).max(axis=1) > 0.0
    assert np.ptp(length[touching]) > 1.0 / 80
    winch = np.abs(upper["work/end"]).max()
    assert max(np.abs(x["work/scheme"]).max() for x in (upper, lower)) < 1e-3 * winch
    assert max(np.abs(x["work/zones"]).max() for x in (upper, lower)) < 5e-3 * winch
    assert float(upper["work/friction"][-1] + lower["work/friction"][-1]) < 0.0
    np.testing.assert_allclose(upper["energy/self_contact"], lower["energy/self_contact"], atol=1e-12)


def test_first_in_the_scene_or_last_it_is_the_same(whole: hybrid.Result) -> None:
    """The line that grows stands before the other one in the arrays of contact, or behind it.

    Which of two strands looks for feet on the other changes the answer: 1.7e-4 m where a rope comes down without a winch.
    """
    tables = in_and_out()
    tables["lines"] = dict(reversed(tables["lines"].items()))
    other = hybrid.run(tables)
    assert [*other.lines] == ["lower", "upper"]
    for name, line in whole.lines.items():
        np.testing.assert_allclose(other.lines[name].position, line.position, atol=2e-5)


# --- bodies ---------------------------------------------------------------------------------------------


@pytest.mark.long
def test_a_ball_goes_down_on_lines_that_are_let_out() -> None:
    """It swings about where it rests on longer lines."""
    paid, like = on_two_lines(), on_two_lines()
    paid["time"], paid["output"]["every"] = {"duration": 8.0, "step": 0.01}, 0.1
    for line, longer in zip(paid["lines"].values(), like["lines"].values(), strict=True):
        (section,) = line["sections"]
        line["connections"] = {"end": {"kind": "pinned", "payout": {"rate": 0.04, "ramp": 1.0, "until": 2.0}}}
        longer["sections"] = [section | {"length": section["length"] + 0.08}]
    moved, rest = hybrid.run(paid), hybrid.static(like)
    height, place = np.array(moved["bodies/ball/position"])[:, 2], float(rest["bodies/ball/position"][-1][2])
    assert height[0] - place > 0.05
    late = height[moved.times > 4.0]
    assert np.ptp(late) < 0.5 * (height[0] - place)
    assert late.mean() == pytest.approx(place, abs=0.02 * (height[0] - place))
