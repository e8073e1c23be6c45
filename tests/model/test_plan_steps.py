"""Steps that `hybrid plan` foretells where they follow the motion."""

from __future__ import annotations

from pathlib import Path

import pytest

import hybrid

EXAMPLES = Path(__file__).parents[2] / "examples"


def scene(accuracy: str, *settings: str) -> hybrid.Scene:
    return hybrid.load_scene(
        EXAMPLES / "rov_tether.yaml", [f"accuracy={accuracy}", "mesh=null", "time={duration: 30}", *settings]
    )


def test_steps_are_about_those_of_the_run() -> None:
    for accuracy in ("3%", "0.3%"):
        run, foretold = hybrid.run(scene(accuracy)), hybrid.plan(scene(accuracy)).steps
        assert 0.5 < len(run["steps/t"]) / foretold < 2.0


def test_a_finer_result_costs_more() -> None:
    """Steps of third order in their error, of which 1.5 orders of what is asked."""
    coarse, fine = hybrid.plan(scene("1%")), hybrid.plan(scene("0.01%"))
    assert fine.steps == pytest.approx(10.0 * coarse.steps, rel=0.15)
    assert fine.seconds > 10.0 * coarse.seconds


def test_steps_of_fixed_length_are_counted() -> None:
    assert hybrid.plan(scene("1%", "time={duration: 30, step: 0.25}")).steps == 120
