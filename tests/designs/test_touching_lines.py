"""Derivatives of equilibria in which lines touch each other, against differences of such equilibria on the same cells."""

from __future__ import annotations

from typing import Any

import pytest

import hybrid
from hybrid.designs.network_at_rest import at_rest
from hybrid.designs.numbers_and_results import changed_scene
from hybrid.scene.read import as_scene
from tests.designs.differences import agree
from tests.validation.test_validation_lines_contact import crossing

Tables = dict[str, Any]
ROPE = {"length": 22.0, "mass": 3.0, "diameter": 0.04, "axial_stiffness": 1e6}
BENDS = {"bending_stiffness": 20.0, "torsional_stiffness": 20.0}


def line(start: str, end: str, section: Tables, cells: int, **more: Any) -> Tables:
    model = "rod" if "bending_stiffness" in section else "catenary"
    return {"start": start, "end": end, "sections": [section], "model": model, "mesh": {"cells": cells},
            "contact": {"self": False}} | more  # fmt: skip


def over(bends: Tables) -> Tables:
    """A slack hose that hangs over a taut wire, across and askew."""
    above = {"points": [[1, -8, 2], [1, 0, 8], [2, 9, 1]]}
    return {
        "environment": {"fluid": {"density": 1025}},
        "points": {"a": {"position": [-10, 0, 0]}, "b": {"position": [10, 0, 0]},
                   "c": {"position": [1, -8, 2]}, "d": {"position": [2, 9, 1]}},
        "lines": {"wire": line("a", "b", ROPE | bends | {"length": 20.0}, 137),
                  "hose": line("c", "d", ROPE | bends, 151, initial=above)},
        "contact": {},
    }  # fmt: skip


def held_by_a_buoy() -> Tables:
    """The wire ends at a buoy, which two legs hold in place."""
    tables = over(BENDS)
    tables["points"] |= {
        "b": {"initial_guess": [10, 0, 0], "mass": 100, "volume": 0.5},
        "e": {"position": [14, 6, -15]}, "f": {"position": [14, -6, -15]},
    }  # fmt: skip
    legs = {name: line(end, "b", ROPE | BENDS | {"length": 16.5}, 40) for name, end in (("one", "e"), ("two", "f"))}
    return tables | {"lines": tables["lines"] | legs, "contact": {"between": [["wire", "hose"]], "friction": 0.2}}


def beside(gap: float) -> Tables:
    """Two taut wires that cross, the one `gap` higher (m) at its pins."""
    section, above = ROPE | BENDS | {"length": 19.99}, {"points": [[0, -10, gap], [0, 0, gap + 1], [0.2, 10, gap]]}
    points = {"a": [-10, 0, 0], "b": [10, 0, 0], "c": [0, -10, gap], "d": [0.2, 10, gap]}
    return over(BENDS) | {
        "points": {name: {"position": x} for name, x in points.items()},
        "lines": {"wire": line("a", "b", section, 137), "hose": line("c", "d", section, 137, initial=above)},
    }


def crossing_ropes() -> Tables:
    tables = crossing(0.1)
    for each in tables["lines"].values():
        each["mesh"] = {"cells": 84}  # at 80 a piece has five sample points, and six with the least less of a diameter
    return tables


HOSE, LOADS = "lines.hose.sections[0].", ["wire/tension@end", "hose/tension@start", "hose/position.z@11.37"]
SCENES: dict[str, tuple[Tables, list[str], list[str]]] = {
    "ropes that cross": (
        crossing_ropes(),
        ["upper/tension@start", "lower/tension@end", "max upper/curvature", "lower/position.z@0.37",
         "upper/reaction_start.x"],
        [*(f"lines.upper.sections[0].{x}" for x in ("mass", "diameter")), "points.a.position[2]",
         *(f"lines.lower.sections[0].{x}" for x in ("length", "axial_stiffness", "bending_stiffness"))],
    ),
    "lines without bending stiffness": (over({}), LOADS, [f"{HOSE}mass", "points.c.position[2]", f"{HOSE}diameter"]),
    "a buoy": (held_by_a_buoy(), [*LOADS, "one/tension@start"],
               ["points.b.volume", f"{HOSE}mass", "environment.gravity"]),
    "lines that begin to touch": (beside(-0.02), LOADS[:2], [f"{HOSE}mass", "points.c.position[2]"]),
}  # fmt: skip


@pytest.mark.long
@pytest.mark.parametrize("what", SCENES)
def test_differences_of_equilibria(what: str) -> None:
    """Of what differs too much the one equilibrium lies between other sample points: then less counts."""
    rest = agree(*SCENES[what], 1e-6, (1e-4, 1e-5, 3e-5, 3e-6))
    assert rest.contact is not None and rest.contact.stiffness.nnz


@pytest.mark.long
def test_what_the_spacing_of_sample_points_does_is_in_the_error() -> None:
    """The hose slides along the wire as its buoy is drawn down: over hollows, by 3 %, and not within the one it lies in."""
    tables, key, of = held_by_a_buoy(), "lines.one.sections[0].length", [*LOADS, "one/tension@start"]
    made = as_scene(tables)
    more, less = (at_rest(changed_scene(made, key, 16.5 * x), of).values for x in (1.03, 0.97))
    for x, theirs in zip(hybrid.sensitivity(tables, of, [key]), (more - less) / (0.06 * 16.5), strict=True):
        assert abs(x.derivative - theirs) < x.error, x.of
        assert x.way == "factors of the equilibrium, friction left out"
    ropes = hybrid.sensitivity(crossing_ropes(), ["upper/tension@start"], ["lines.upper.sections[0].mass"])
    assert ropes[0].error < 2e-3 * ropes[0].derivative
    for x in hybrid.sensitivity(over({}), LOADS[:1], [f"{HOSE}mass"]):
        assert x.error >= abs(x.derivative)  # where a kink lies between nodes nobody knows


@pytest.mark.long
def test_lines_that_begin_to_touch_are_named() -> None:
    ways = {gap: hybrid.sensitivity(beside(gap), LOADS[:1], [f"{HOSE}mass"])[0].way for gap in (0.05, 0.03, -0.1)}
    assert [way.endswith(", lines wire and hose begin to touch") for way in ways.values()] == [False, True, False]


def test_what_a_rope_weighs_more_is_borne_by_both() -> None:
    """The upper rope, 1 m long, hands on some of it."""
    key, of = (
        "lines.upper.sections[0].mass",
        [f"{x}/reaction_{y}.z" for x in ("upper", "lower") for y in ("start", "end")],
    )
    found = at_rest(as_scene(crossing_ropes()), of).by([key])[0]
    assert found.sum() == pytest.approx(9.81, rel=1e-6) and 2.0 < found[2:].sum() < 4.0


def test_what_is_refused() -> None:
    with pytest.raises(hybrid.SceneError, match="do not touch each other"):
        at_rest(as_scene(crossing_ropes()), ["max upper/self_contact"])
