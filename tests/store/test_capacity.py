"""Capacity polygons and the use of mooring lines: closed forms, every result, verdicts, refusals."""

from __future__ import annotations

import json

import numpy as np
import pytest
from typer.testing import CliRunner

import hybrid
from hybrid.cli.commands import app
from hybrid.errors import SceneError
from hybrid.store.capacity import most_used, used
from tests.scenes import cable_scene, clamped_at, pinned_at

TRIANGLE, BOX = [[100.0, 0.0], [0.0, 2.0]], [[100.0, 0.0], [100.0, 2.0], [0.0, 2.0]]
BOTH_WAYS = [[100.0, 0.0], [0.0, 2.0], [-50.0, 0.0]]
HOLLOW = [[100.0, 0.0], [60.0, 0.4], [40.0, 1.5], [0.0, 2.0], [-20.0, 0.5], [-50.0, 0.0]]


def test_parts_that_are_used():
    T, k = np.array([0.0, 50.0, 100.0, 30.0, 0.0, 150.0]), np.array([0.0, 0.0, 0.0, 1.0, 3.0, 1.0])
    np.testing.assert_allclose(used(TRIANGLE, T, k), T / 100.0 + k / 2.0)
    np.testing.assert_allclose(used(BOX, T, k), np.maximum(T / 100.0, k / 2.0))
    np.testing.assert_allclose(used(TRIANGLE, -T, k), k / 2.0)  # no compression is given: it counts as no tension
    np.testing.assert_allclose(used(BOTH_WAYS, -T, k), T / 50.0 + k / 2.0)
    np.testing.assert_allclose(used(HOLLOW, *np.array(HOLLOW).T), 1.0)
    np.testing.assert_allclose(used(HOLLOW, *(0.3 * np.array(HOLLOW).T)), 0.3)
    assert np.isnan(used(BOX, np.array([np.nan]), np.array([1.0]))).all()


def test_a_bound_is_the_most_of_a_rectangle():
    """Against 200 by 200 points of it: never less, and more by no more than they are apart."""
    g = np.random.default_rng(4)
    for corners in (TRIANGLE, BOX, BOTH_WAYS, HOLLOW):
        for _ in range(20):
            low, high = np.sort(g.uniform(-60.0, 120.0, 2))
            k = g.uniform(0.0, 3.0)
            T, x = np.meshgrid(np.linspace(low, high, 200), np.linspace(0.0, k, 200))
            most, bound = float(used(corners, T, x).max()), float(most_used(corners, low, high, k))
            assert most * (1.0 - 1e-12) <= bound <= most + 0.06


@pytest.mark.parametrize(
    ("corners", "at", "expected"),
    [
        ([[1e5, 0]], "", "at least two corners"),
        ([[0, 0.2], [1e5, 0]], "[0]", "the largest tension without bending"),
        ([[1e5, 0], [5e4, 0.1]], "[1]", "the largest curvature without tension"),
        ([[1e5, 0], [4e4, 0.2], [5e4, 0.1], [0, 0.3]], "[2]", "further round"),
        ([[1e5, 0], [5e4, -0.1], [0, 0.3]], "[1][1]", "a curvature >= 0"),
    ],
)
def test_polygons_that_are_refused(corners, at, expected):
    tables = hung()
    tables["cable"]["sections"][0]["capacity"] = corners
    with pytest.raises(SceneError) as refused:
        hybrid.validate_scene(tables)
    (found,) = refused.value.complaints
    assert found.where == f"cable.sections[0].capacity{at}" and expected in found.expected


# --- results -------------------------------------------------------------------------------------

POLYGON = [[6000.0, 0.0], [4000.0, 2.4], [0.0, 4.0]]


def hung(**more):
    """A rod that is led to and fro, of two sections, the first of which has a capacity."""
    steel = {"mass": 5.0, "diameter": 0.05, "axial_stiffness": 1e6, "bending_stiffness": 200.0, "damping": 0.5}
    return cable_scene(
        [steel | {"length": 12.0, "capacity": POLYGON}, steel | {"length": 8.0, "mass": 8.0}],
        clamped_at([0, 0, 0], [1, 0, 0.2]),
        pinned_at(17, 0, 0, motion={"surge": {"amplitude": 0.5, "period": 4.0}, "ramp": 4}), model="rod", mesh=40,
        contact={"self": False}, time=(8.0, 0.05), output=0.25
    ) | more  # fmt: skip


@pytest.fixture(scope="module")
def moved(tmp_path_factory):
    path = tmp_path_factory.mktemp("capacity") / "run.h5"
    hybrid.run(hung(output={"every": 0.25, "errors": True}), path).close()
    return path


def test_every_output_has_its_part(moved):
    with hybrid.open(moved) as result:
        s, found = result.both_sides("capacity_used")
        T, k = result.both_sides("tension")[1], result.both_sides("curvature")[1]
        seam = np.flatnonzero(s == 12.0)
        assert seam.size == 2 and np.isfinite(found[:, seam[0]]).all() and np.isnan(found[:, seam[1]]).all()
        inside = s < 12.0
        inside[seam[0]] = True
        np.testing.assert_allclose(found[:, inside], 100.0 * used(POLYGON, T, k)[:, inside], rtol=1e-12)
        assert np.isnan(found[:, ~inside]).all()
        (held,) = (x for x in result.verdicts().quantities if x.limit == "capacity")
        most = np.nanmax(found)
        assert held.value == most and held.unit == "%" and 20.0 < most < 100.0
        row, column = np.argwhere(found == most)[0]
        assert (held.t, held.s) == (result.times[row], s[column]) and held.verdict == "within"
        assert result.statistics("capacity_used", at=[held.s])["capacity_used"].maximum == pytest.approx(most)
    assert "capacity_used" in CliRunner().invoke(app, ["stats", str(moved)]).output


def test_what_steps_may_have_between_outputs_is_not_verified():
    """A polygon that the outputs keep to, and that the largest tension with the largest curvature does not."""
    tables = hung()
    with hybrid.run(tables) as result:
        T, k = (
            float(np.nanmax(result[f"envelope/{x}_max"][result["envelope/s"] < 12.0])) for x in ("tension", "curvature")
        )
        (held,) = result.verdicts().quantities
        assert held.verdict == "not verified"  # its errors are not estimated
    small = 0.99 * T
    tables["cable"]["sections"][0]["capacity"] = [[small, 0], [0, 50 * k]]
    with hybrid.run(tables) as result:
        (held,) = result.verdicts().quantities
        broken = held.value > 100.0
        assert held.verdict == ("broken" if broken else "not verified")
        assert (100.0 * float(result.tension[:, result.s < 12.0].max()) / small > 100.0) <= broken


def test_one_line_of_several_has_its_capacity():
    tables = hung()
    one = hybrid.run(tables)
    points = {
        "a": {"kind": "fixed", "position": [0, 0, 0]},
        "b": {"kind": "fixed", "position": [17, 0, 0], "motion": tables["ends"]["end"]["motion"]},
    }
    line = {
        "start": "a", "end": "b", "sections": tables["cable"]["sections"], "model": "rod", "mesh": {"cells": 40},
        "connections": {"start": {"kind": "clamped", "tangent": [1, 0, 0.2]}},
    }  # fmt: skip
    several = {"points": points, "lines": {"l": line}, "time": tables["time"], "output": tables["output"]}
    with hybrid.run(several) as result:
        mine = result.lines["l"]
        np.testing.assert_allclose(mine["capacity_used"], one["capacity_used"], rtol=1e-6, atol=1e-5)
        assert [x.limit for x in mine.verdicts().quantities] == ["capacity"]


def test_a_capacity_changes_nothing():
    plain = hung()
    del plain["cable"]["sections"][0]["capacity"]
    with hybrid.run(plain) as without, hybrid.run(hung()) as there:
        assert np.array_equal(without.tension, there.tension) and "capacity_used" not in without


# --- mooring lines -------------------------------------------------------------------------------


def test_use_of_a_mooring_line(moved, tmp_path):
    """u = (T_pre 1.2 + (T - T_pre) 1.5)/S, by a number and by the equilibrium; of every step no less than outputs."""
    rest = tmp_path / "rest.h5"
    hybrid.static(hung(), rest).close()
    with hybrid.open(moved) as result, hybrid.open(rest) as still:
        s, found, most = result.mooring(5e4, (1.2, 1.5), 300.0)
        T = result.both_sides("tension")[1]
        np.testing.assert_allclose(found, (300.0 * 1.2 + (T - 300.0) * 1.5) / 5e4, rtol=1e-12)
        assert (most >= found.max(axis=0)).all() and s.size == most.size
        _, at_rest, _ = result.mooring(5e4, (1.2, 1.5), still)
        np.testing.assert_allclose(at_rest[0], 1.2 * T[0] / 5e4, rtol=1e-6)
        with pytest.raises(hybrid.ResultError, match="two factors"):
            result.mooring(5e4, (1.2,), 300.0)
    arguments = ["stats", str(moved), "--mooring", "5e4", "--factors", "1.2,1.5", "--pretension"]
    said = CliRunner().invoke(app, [*arguments, "300", "--json"])
    last = json.loads(said.output.strip().splitlines()[-1])
    assert last["mooring"]["used"] == pytest.approx(float(most.max()))
    said = CliRunner().invoke(app, [*arguments, str(rest)])
    assert "DNV-OS-E301 (2021), factors 1.2, 1.5" in said.output.replace("\n", " ")
    alone = CliRunner().invoke(app, ["stats", str(moved), "--mooring", "5e4"])
    assert alone.exit_code != 0 and "go together" in alone.output


def test_line_that_is_paid_out_has_its_capacity():
    tables = hung(ends={
        "start": {"kind": "body", "mass": 60.0, "initial_guess": [0, 0, -20]},
        "end": {"kind": "pinned", "position": [0, 0, 0], "payout": {"rate": 0.5, "ramp": 0.5, "longest": 24}},
    }, model="catenary", time={"duration": 2.0, "step": 0.1})  # fmt: skip
    tables["cable"]["sections"] = [tables["cable"]["sections"][0] | {"length": 20.0}]
    del tables["contact"]
    with hybrid.run(tables) as result:
        part = 100.0 * used(POLYGON, result.tension, result.curvature)
        np.testing.assert_allclose(result["capacity_used"], part, rtol=1e-12)
        assert np.nanmax(part) > 5.0


def test_a_bound_knows_the_way_to_a_dent():
    """Of a polygon that is dented at 20 N: the way there leaves a rectangle of 40 N and 0.5 1/m with 2, its corners

    with 1.78, 0.4 and 0.25.  A dent towards tension likewise: by curvature.
    """
    dented = [[100.0, 0.0], [20.0, 0.2], [60.0, 1.5], [0.0, 2.0]]
    assert float(used(dented, 40.0, 0.4)) == pytest.approx(2.0)
    assert float(most_used(dented, 0.0, 40.0, 0.5)) == pytest.approx(2.0)
    turned = [[100.0, 0.0], [75.0, 60.0], [10.0, 20.0], [0.0, 100.0]]
    assert float(used(turned, 20.0, 40.0)) == pytest.approx(2.0)
    assert float(most_used(turned, 0.0, 25.0, 40.0)) == pytest.approx(2.0)
    assert float(most_used(TRIANGLE, 10.0, 50.0, 1.0)) == pytest.approx(1.0)  # a corner of the rectangle
    assert float(most_used(BOTH_WAYS, -40.0, 10.0, 0.0)) == pytest.approx(0.8)  # without bending


def test_a_bound_knows_that_no_bending_may_be_the_worst():
    """A polygon that bends make stronger: 9 N of 10 N without bending, little with 0.09 1/m or more."""
    bulging = [[10.0, 0.0], [100.0, 1.0], [0.0, 2.0]]
    assert float(used(bulging, 9.0, 0.09)) == pytest.approx(0.09)
    assert float(most_used(bulging, 9.0, 9.0, 1.0)) == pytest.approx(0.9)
