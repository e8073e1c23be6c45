"""The designs of examples/ are what they say."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import pytest

import hybrid
from hybrid.designs.design import Found, Identified

DESIGNS = Path(__file__).parents[2] / "examples" / "designs"
NAMES = ("lazy_wave", "pretension", "stiffness", "towing")
IN_SEAS = "lazy_wave_in_seas"  # takes minutes: bench/test_bench_design.py


@cache
def designed(name: str) -> Found:
    return hybrid.design(DESIGNS / f"{name}.yaml")


def test_there_is_no_other_example() -> None:
    found = {file.stem for file in DESIGNS.glob("*.yaml") if "\nscene:" in file.read_text(encoding="utf-8")}
    assert found == {*NAMES, IN_SEAS}


def test_pretension_of_three_lines_takes_six_equilibria() -> None:
    found = designed("pretension")
    assert found.equilibria <= 6
    with hybrid.static(found.scene) as result:
        east = result.lines["east"]
        assert east.tension[-1][-1] == pytest.approx(60e3, rel=1e-7)
        assert east.position[-1][-1][:2] == pytest.approx([0.0, 0.0], abs=1e-6)
    assert abs(found.kept[0].finer - 60e3) < 0.001 * 60e3  # on twice the cells, with other numbers than these


@pytest.mark.long
def test_the_lazy_wave_is_held_by_as_many_limits_as_there_are_unknowns() -> None:
    found = designed("lazy_wave")
    assert found.equilibria <= 60 and found.minimised == pytest.approx(2.394, rel=2e-3)
    active = {(x.name, x.case) for x in found.kept if x.active}
    assert active == {("bend", "near"), ("top", "far"), ("sag", "near")} and not found.bounds
    assert sum(x.active for x in found.kept) == 4  # the bend in two sections
    for x in found.kept:
        allowed = 1e-5 * abs(x.bound)
        assert x.value <= x.bound + allowed if x.side > 0 else x.value >= x.bound - allowed
    with hybrid.static(found.scenes["far"]) as result:  # more than the limit of any other case
        assert result.tension[-1][-1] == pytest.approx(30e3, rel=1e-5)


@pytest.mark.needs("simpleeval")
def test_a_price_is_what_a_wider_limit_is_worth() -> None:
    found = designed("lazy_wave")
    (top,) = (x for x in found.kept if x.name == "top" and x.active)
    assert top.price == pytest.approx(-1.4e-4, rel=0.05)  # m3 per N


def test_a_sagging_umbilical_shows_the_ratio_of_stiffness_and_mass() -> None:
    """The shape was made with 8 N m2 and 0.8 kg/m, and noise of 2 mm."""
    found = designed("stiffness")
    assert isinstance(found, Identified)
    (apart,) = found.apart
    assert apart.text.startswith("stiffness and mass: only their ratio is known, stiffness / mass = ")
    assert found.numbers["stiffness"] / found.numbers["mass"] == pytest.approx(10.0, abs=0.045)  # three deviations


@pytest.mark.long
def test_a_towing_record_shows_stiffness_and_drag() -> None:
    """The record was made with 6 N m2 and 1.3, and noise of 2 % of the largest force and change of angle."""
    found = designed("towing")
    assert isinstance(found, Identified) and not found.apart and not found.notes
    for estimate, truth in zip(found.estimates, (6.0, 1.3), strict=True):
        assert estimate.low <= truth <= estimate.high and estimate.deviation < 0.03 * truth
