"""Capacity polygons and the use of mooring lines: closed forms, every result, verdicts, refusals."""

from __future__ import annotations

import json
import math
import re

import numpy as np
import pytest
import yaml
from typer.testing import CliRunner

import hybrid
from hybrid.cli.commands import app
from hybrid.errors import ResultError, SceneError
from hybrid.store.capacity import (
    E301,
    F201,
    Row,
    code_of_steps,
    code_with_errors,
    collapse,
    most_used,
    of_riser,
    use,
    used,
)
from hybrid.store.tables import rows_of
from tests.combinations.pairs import as_network
from tests.said import line_of
from tests.scenes import cable_scene, clamped_at, pinned_at, span

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
    with hybrid.run(hung()) as one, hybrid.run(as_network(hung())) as result:
        mine = line_of(result)
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


# Codes of sections: the formulas against numbers worked out otherwise, every result, verdicts, the report, a study.


PIPE = {"outer": 0.2731, "wall": 0.0159, "modulus": 207e9, "yields": 430.08e6, "breaks": 509.76e6}
RISER = Row(
    first=0.0, last=1.0, kind=F201, functional=1.1, environment=1.3, tension=0.0, moment=0.0, strength=0.0,
    safety=1.14 * 1.15, ovality=0.005, fabrication=0.85, inside=0.0, inside_z=0.0, content=0.0, water=0.0, surface=0.0,
    **PIPE,
)  # fmt: skip


def test_a_riser_by_published_numbers():
    """D 0.2731 m, t 0.0159 m, 10 MPa inside, 150 kN m, 1200 kN, normal safety class: 0.46591, as another program has it."""
    assert float(of_riser(RISER, np.array(1.2e6), np.array(150e3), np.array(10e6))) == pytest.approx(0.46591, abs=1e-5)


def test_a_riser_written_out():
    """By hand, with pressure on either side; with the factors of loads; continuous where pressures are equal."""
    D, t, fy, fu = 0.2731, 0.0159, 430.08e6, 509.76e6
    beta = 0.4 * (60 - D / t) / 45
    alpha = 1 - beta + beta * fu / fy
    M_k, T_k = fy * alpha * (D - t) ** 2 * t, fy * alpha * math.pi * (D - t) * t
    outside = (1.14 * 1.15) ** 2 * ((1e5 / M_k + (8e5 / T_k) ** 2) ** 2 + (8e6 / collapse(RISER)) ** 2)
    assert float(of_riser(RISER, np.array(8e5), np.array(1e5), np.array(-8e6))) == pytest.approx(outside, rel=1e-12)
    p = collapse(RISER)
    elastic, plastic = 2 * 207e9 * (t / D) ** 3 / (1 - 0.09), 2 * t / D * fy * 0.85
    assert 0.0 < p < min(elastic, plastic)
    assert (p - elastic) * (p**2 - plastic**2) == pytest.approx(p * elastic * plastic * 0.005 * D / t, rel=1e-9)
    assert collapse(RISER._replace(ovality=1e-12)) == pytest.approx(min(elastic, plastic), rel=1e-3)
    row = RISER._replace(tension=5e5, moment=2e4)
    assert float(use(row, np.array(8e5), np.array(-1e5), np.array(0.0))) == pytest.approx(
        float(of_riser(RISER, np.array(1.1 * 5e5 + 1.3 * 3e5), np.array(1.1 * 2e4 + 1.3 * 8e4), np.array(0.0)))
    )
    burst = 2 / math.sqrt(3) * 2 * t / (D - t) * min(fy, fu / 1.15)
    parts = of_riser(RISER, np.array(0.0), np.array(1e5), burst * np.array([1 - 1e-9, 1.0, 1.5]))
    np.testing.assert_allclose(parts, [1.0, 1.0, 2.25], rtol=1e-4)  # pressure alone bursts it


def test_less_than_the_functional_part_is_no_relief():
    """A tension or moment below what is said to be functional has the factor of that, and never less than nothing."""
    row = RISER._replace(tension=5e5, moment=2e4)
    low = use(row, np.array(3e5), np.array(1e4), np.array(0.0))
    assert float(low) == pytest.approx(float(of_riser(RISER, np.array(1.1 * 3e5), np.array(1.1e4), np.array(0.0))))
    line = row._replace(kind=E301, strength=1e6, tension=2e5)
    T = np.array([0.0, 1e5, 2e5, 4e5])
    np.testing.assert_allclose(use(line, T, T, T), [0.0, 0.11, 0.22, 0.48], atol=1e-12)


@pytest.mark.parametrize(
    ("key", "value", "words"),
    [
        ("pretension_factor", 1.6, "at least pretension_factor, 1.6"),
        ("pretension", 4e6, "less than the strength, 3e+06 N"),
        ("strength", None, "a number > 0"),
        ("environment_factor", None, "a number > 0"),
    ],
)
def test_numbers_of_a_code_that_do_not_fit_are_refused(key, value, words):
    code = {k: x for k, x in (MOORED | {key: value}).items() if x is not None}
    with pytest.raises(SceneError, match=re.escape(words)):
        hybrid.static({"cable": {"sections": [LINE | {"length": 100.0, "code": code}]}, "model": "rod",
                       "ends": coded()["ends"], "environment": coded()["environment"]})  # fmt: skip


LINE = {"mass": 110.0, "diameter": 0.2731, "axial_stiffness": 2e9, "bending_stiffness": 2e7, "damping": 0.5}
WALL = {"pipe": {"wall": 0.0159, "pressure": 5e6, "content_density": 800}}
CODE = {"kind": "F201", "yield_strength": 430.08e6, "tensile_strength": 509.76e6}
MOORED = {"kind": "E301", "strength": 3e6, "pretension_factor": 1.2, "environment_factor": 1.5, "pretension": 5e4}


def coded(**more):
    """A pipe that is led to and fro, and a mooring line beyond it."""
    sections = [LINE | WALL | {"length": 60.0, "code": CODE}, LINE | {"length": 40.0, "code": MOORED}]
    return cable_scene(
        sections, clamped_at([0, 0, -5], [1, 0, -0.3]),
        pinned_at(99, 0, -10, motion={"surge": {"amplitude": 0.2, "period": 8.0}, "ramp": 8}),
        fluid={"density": 1025, "surface": 0.0}, model="rod", mesh=50, contact={"self": False}, time=(16.0, 0.1),
        output=0.5
    ) | more  # fmt: skip


@pytest.fixture(scope="module")
def led(tmp_path_factory):
    path = tmp_path_factory.mktemp("codes") / "run.h5"
    hybrid.run(coded(output={"every": 0.5, "errors": True}), path).close()
    return path


def test_every_output_has_what_codes_let_it_use(led):
    with hybrid.open(led) as result:
        s, used = result.both_sides("code_used")
        T, M = result.both_sides("tension")[1], result.both_sides("bending_moment")[1]
        z = np.array([np.interp(s, result.s, x) for x in result.position[:, :, 2]])
        k = int(np.flatnonzero(s == 60.0)[-1])  # after where they meet
        mooring = (1.2 * 5e4 + 1.5 * (T[:, k:] - 5e4)) / 3e6
        np.testing.assert_allclose(used[:, k:], 100.0 * mooring, rtol=1e-6)
        dp = np.maximum(5e6 - 800 * 9.81 * z, 0.0) + 1025 * 9.81 * np.minimum(z, 0.0)
        riser = of_riser(RISER, 1.3 * T, 1.3 * M, dp)
        np.testing.assert_allclose(used[:, :k], 100.0 * riser[:, :k], rtol=1e-4)
        most = float(used.max())
        held = next(x for x in result.verdicts().quantities if x.limit == "code")
        assert held.value == pytest.approx(most) and held.verdict == "within"
        assert 100.0 * code_of_steps(result) >= most
        for name in ("E301 (July 2021)", "F201 (October 2010)"):
            assert name in result.label("code_used")["description"]


def test_a_catenary_bends_like_the_rod_in_its_place():
    """Code and its bound by all steps count the moment of its curvature."""
    sections = [LINE | WALL | {"length": 300.0, "code": CODE}]
    more = {"cable": {"sections": sections}, "mesh": {"cells": 40}, "output": {"points": 41}}
    ends = {k: {"kind": "pinned", "position": [x, 0, -10]} for k, x in (("start", 0), ("end", 270))}
    rod, catenary = (hybrid.static(coded(ends=ends, model=model, **more)) for model in ("rod", "catenary"))
    rod_used, used = rod["code_used"][0], catenary["code_used"][0]
    np.testing.assert_allclose(used[10:31], rod_used[10:31], rtol=0.02)  # away from the ends
    assert 100.0 * code_of_steps(catenary) == pytest.approx(used.max(), rel=0.01) and used.max() > 20.0


@pytest.mark.long
@pytest.mark.needs("dask", "zarr", "xarray")
def test_codes_are_shown(led, tmp_path):
    """In `hybrid stats`, in the report with pictures along s and over time, and kept by a study."""
    out = CliRunner().invoke(app, ["stats", str(led)])
    assert out.exit_code == 0 and "code_used" in out.output and "DNV-OS-F201" in out.output.replace("\n", " ")
    with hybrid.open(led) as result:
        page = hybrid.report(result, tmp_path / "page.html").read_text()
    assert 'id="plot-range-code_used"' in page and 'id="plot-code_used"' in page
    assert "DNV-OS-E301 (July 2021)" in page and "DNV-OS-F201 (October 2010)" in page
    (tmp_path / "scene.yaml").write_text(yaml.safe_dump(coded()))
    study = {
        "scene": "scene.yaml", "vary": {"push": {"key": "ends.end.motion.surge.amplitude", "values": [0.1, 0.2]}},
        "collect": {"use": {"quantity": "code_used", "take": ["max"]}},
    }  # fmt: skip
    (tmp_path / "study.yaml").write_text(yaml.safe_dump(study))
    found = hybrid.study(tmp_path / "study.yaml", workers=1)
    (name,) = (x for x in found.data_vars if str(x).startswith("use"))
    values = np.asarray(found[name], float)
    assert 0.0 < values[0] < values[1]


def test_a_code_that_is_exceeded_is_broken():
    tables = coded()
    tables["cable"]["sections"][1]["code"] = MOORED | {"strength": 1e3, "pretension": 0.0}
    rest = hybrid.static({k: x for k, x in tables.items() if k not in ("time", "output")})
    held = next(x for x in rest.verdicts().quantities if x.limit == "code")
    assert held.broken and held.s >= 60.0


def test_every_step_of_a_mooring_line_counts():
    """Exactly: outputs far apart have the largest use of outputs at every step, in verdicts, statistics and studies."""
    found = {}
    for every in (0.1, 7.3):
        tables = coded(output={"every": every, "points": 51}, time={"duration": 16.0, "step": 0.1})
        tables["cable"]["sections"] = [LINE | {"length": 100.0, "code": MOORED | {"strength": 1.5e5}}]
        result = hybrid.run(tables)
        found[every] = next(x for x in result.verdicts().quantities if x.limit == "code")
    every, few = found[0.1], found[7.3]
    assert float(np.nanmax(result["code_used"])) < 98.0 and few.verdict == "broken" and not few.by_outputs
    assert few.value == pytest.approx(every.value, rel=1e-3) and few.value > 100.0
    assert few.t == pytest.approx(every.t, abs=0.11) and few.s == pytest.approx(every.s, abs=2.1)
    (row,) = rows_of(result, ["code_used"])
    assert f"code_used: {few.value:.5g} % at t = {few.t:.5g} s, of all steps" in row["beyond_outputs"]


def test_the_use_of_a_mooring_line_does_not_hang_by_its_bending():
    """Which its code does not take: bending that a catenary ignores at a clamp leaves it verified, that of a riser not."""
    tables = coded(output={"every": 0.5, "errors": True}, model="catenary")
    tables["cable"]["sections"] = [LINE | {"length": 100.0, "code": MOORED}]
    moored = hybrid.run(tables)
    assert [x.kind for x in moored.events] == ["ignored"]
    assert moored.verdicts().words["code_used code"] == "within"
    tables["cable"]["sections"] = [LINE | WALL | {"length": 100.0, "code": CODE}]
    riser = next(x for x in hybrid.run(tables | {"model": "rod", "mesh": {"cells": 6}}).verdicts().quantities)
    assert riser.limit == "code" and riser.verdict == "not verified" and "bend" in riser.why


@pytest.mark.long  # 1.2 s
def test_steps_of_a_riser_between_outputs_have_a_bound():
    """It is above what outputs at every step have, and says so where the limit stands between."""
    code = CODE | {"yield_strength": 2.1e8, "tensile_strength": 2.6e8}
    sections = [LINE | WALL | {"length": 100.0, "code": code}]
    every, few = (
        hybrid.run(coded(cable={"sections": sections}, output={"every": x, "errors": True})) for x in (0.1, 7.3)
    )
    held = next(x for x in few.verdicts().quantities if x.limit == "code")
    bound, true = 100.0 * code_of_steps(few), float(np.nanmax(every["code_used"]))
    assert held.value < 0.9 * true and held.value < 100.0 < bound and bound >= true
    assert held.verdict == "not verified" and held.bound == pytest.approx(bound)
    (row,) = rows_of(few, ["code_used"])
    assert f"between them at most {bound:.5g} % by the ranges of all steps" in row["beyond_outputs"]


def test_refusals():
    tables = coded()
    tables["cable"]["sections"][1]["code"] = CODE
    with pytest.raises(SceneError, match="the wall that DNV-OS-F201 checks"):
        hybrid.validate_scene(tables)
    tables["cable"]["sections"][1]["code"] = {x: y for x, y in MOORED.items() if x != "environment_factor"}
    with pytest.raises(SceneError, match="environment_factor"):
        hybrid.validate_scene(tables)


@pytest.mark.parametrize("pretension", [math.nan, math.inf, -1.0])
def test_numbers_that_are_none_are_refused(pretension):
    result = hybrid.run(span(time=(1, 0.1)))
    with pytest.raises(ResultError, match="a pretension in N"):
        result.mooring(1e5, (1.2, 1.4), pretension)
    with pytest.raises(ResultError, match="a number in the unit of the quantity"):
        result.exceedance("end_force_end", math.nan)


def test_a_mooring_line_uses_at_a_clump_what_the_tension_of_all_steps_is_on_either_side():
    scene = span(time=(9.0, 0.1), output={"every": 4.5, "points": 5})
    scene["cable"]["attachments"] = [{"kind": "clump", "at": 25, "mass": 60}]
    scene["ends"]["end"] = pinned_at(80, 0, 0, motion={"heave": {"amplitude": 1.0, "period": 4}, "ramp": 4})
    found = hybrid.run(scene)
    s, _, most = found.mooring(1.0, (1.0, 1.0), 0.0)
    assert most[s == 25.0] == pytest.approx(found["envelope/tension_max"][found["envelope/s"] == 25.0], rel=1e-12)


def in_a_sleeve(pull, mesh, attached=True, **more):
    """A pipe that a clamp and a sleeve lead, with what it uses."""
    pipe = {"length": 20, "mass": 60, "diameter": 0.2, "axial_stiffness": 1e9, "bending_stiffness": 6e6}
    pipe |= {"torsional_stiffness": 4.6e6, "pipe": {"wall": 0.01}, "code": CODE}
    sleeve = {"kind": "bend_stiffener", "range": [0, 4], "added_stiffness": [[0, 5.4e7], [4, 5.4e7]]}
    return cable_scene(
        pipe, clamped_at([0, 0, -10], [0, 0, -1]), {"kind": "free", "force": [pull, 0, 0]}, model="rod", mesh=mesh,
        attachments=[sleeve] if attached else None, fluid={"density": 1025, "surface": 0}, **more
    )  # fmt: skip


def test_a_pipe_in_a_sleeve_is_checked_by_its_own_moment():
    bare, inside = (hybrid.static(in_a_sleeve(4e3, 80, x)) for x in (False, True))
    at = int(np.abs(inside.s - 1.0).argmin())
    assert inside.curvature[0, at] < 0.11 * bare.curvature[0, at]
    assert inside.code_used[0, at] < 0.11 * bare.code_used[0, at]


@pytest.mark.parametrize("moves", [False, True])
def test_bounds_of_a_pipe_in_a_sleeve_are_those_of_its_own_moment(moves):
    """Allowed are 100 %; the moment of pipe and sleeve would use 109 %."""
    output, time = {"points": 41, "errors": True, "every": 0.05}, (0.3, 0.05)
    found = (hybrid.run if moves else hybrid.static)(in_a_sleeve(5.2e3, 40, output=output, time=time))
    used = found.both_sides("code_used")[1].max()
    assert used == pytest.approx(69.3, abs=0.1)
    for bound in (code_of_steps(found), code_with_errors(found)):
        assert used * (1.0 - 1e-6) <= 100.0 * bound < 69.4


@pytest.mark.parametrize("model", ["rod", "adaptive"])
def test_line_that_is_paid_out_has_what_its_code_lets_it_use(model):
    """Some outputs at once as each by itself: it was no result at all."""
    pipe = {"length": 20, "mass": 60, "diameter": 0.2, "axial_stiffness": 1e8, "bending_stiffness": 6e5}
    pipe |= {"torsional_stiffness": 4.6e5, "pipe": {"wall": 0.01}, "code": CODE}
    winch = pinned_at(2, 0, -28, payout={"rate": 0.5, "ramp": 0.2, "longest": 22})
    one, other = (
        hybrid.run(cable_scene(
            pipe, clamped_at([0, 0, -10], [0, 0, -1]) if model == "rod" else pinned_at(0, 0, -10), winch, model=model,
            mesh=20, fluid={"density": 1025, "surface": 0}, time=(0.4, 0.05), output=(every, 11)
        )) for every in (0.1, 0.4)
    )  # fmt: skip
    assert np.nanmax(one.code_used) > 0.0
    np.testing.assert_allclose(one.code_used[-1], other.code_used[-1])
