"""How often a run keeps outputs where its scene does not say: as its shortest period asks for, in a file of bounded size."""

from __future__ import annotations

import math
from typing import Any

import pytest
from scene_texts import SUSPENSION

from hybrid.cli.plan_tables import plan_rows
from hybrid.errors import SceneError
from hybrid.model.plan import output_times, plan, size_of_result
from hybrid.scene.analysis import OUTPUTS, PER_PERIOD, UNASKED_BYTES
from hybrid.scene.read import as_scene, one_line, parse_scene
from tests.scenes import cable_scene, line_between, network_scene, pinned_at, pulled, span

LINE = {"length": 30.0, "mass": 2.0, "axial_stiffness": 1e6}
HEAVE = {"heave": {"amplitude": 0.5, "period": 4.0}, "ramp": 8.0}


def cable(duration: float, motion: dict[str, Any] | None = HEAVE, **output: Any) -> dict[str, Any]:
    """A cable whose end heaves."""
    end = {"kind": "pinned", "position": [20, 0, 0]} | ({"motion": motion} if motion else {})
    return cable_scene(LINE, pinned_at(0, 0, -20), end, model="catenary", time={"duration": duration}, output=output)


def lines(duration: float, **output: Any) -> dict[str, Any]:
    """The same as one of two lines that join at a point."""
    point = {"kind": "fixed", "position": [20, 0, 0], "motion": HEAVE}
    return network_scene(
        {"a": {"position": [0, 0, -20]}, "b": point, "c": {"position": [20, 20, -20]}},
        {x: line_between(x, "b", LINE) for x in "ac"}, time=(duration, 0.05), output=output
    )  # fmt: skip


@pytest.mark.parametrize("made", [cable, lines])
def test_outputs_show_the_shortest_period(made: Any) -> None:
    short, long = (as_scene(made(t)) for t in (40.0, 900.0))
    assert short.output_interval == 40.0 / OUTPUTS
    assert long.output_interval == pytest.approx(4.0 / PER_PERIOD)
    assert as_scene(made(900.0, every=9.0)).output_interval == 9.0
    for name in getattr(long, "lines", {}):
        assert long.scene_of(name).output_interval == long.output_interval


def test_ramps_and_what_does_not_move_ask_for_no_more() -> None:
    assert as_scene(cable(900.0, None)).output_interval == 9.0
    travel = {"travel": {"by": [1, 0, 0], "over": 3.0}}
    assert as_scene(cable(900.0, travel)).output_interval == 9.0
    assert math.isinf(parse_scene(SUSPENSION).lasting_period)


def test_a_file_that_nobody_asked_for_has_a_bounded_size() -> None:
    long = as_scene(cable(1e6))
    assert size_of_result(long) == pytest.approx(UNASKED_BYTES, rel=1e-3)
    assert len(output_times(one_line(long))) < 1e6 * PER_PERIOD / 4.0


@pytest.mark.parametrize(
    ("every", "said"),
    [(None, "1351, every 0.6667 s, in a file of some 44 MB"), (3.0, "fewer than 6 in the period of 4 s")],
)
def test_a_plan_says_how_many_and_how_much(every: float | None, said: str) -> None:
    scene = as_scene(cable(900.0, **({"every": every} if every else {})))
    assert said in " ".join(" ".join(plan_rows(scene, plan(scene))).split())


@pytest.mark.parametrize("name", ["changes", "obstacles", "contacts", "shape", "max_contact_force"])
def test_names_that_results_have_are_refused(name: str) -> None:
    """A run with one crashed, or was told to free some disk space."""
    with pytest.raises(SceneError, match="quantities"):
        as_scene(span(output=pulled(name, 1e5)))
