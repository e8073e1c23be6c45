"""Codes of sections: the formulas against numbers worked out otherwise, every result, verdicts, the report, a study."""

from __future__ import annotations

import math
import re

import numpy as np
import pytest
import yaml
from typer.testing import CliRunner

import hybrid
from hybrid.cli.commands import app
from hybrid.errors import SceneError
from hybrid.store.capacity import E301, F201, Row, code_of_steps, collapse, of_riser, use
from hybrid.store.statistics_table import rows_of
from tests.scenes import cable_scene, clamped_at, pinned_at

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
                       "ends": hung()["ends"], "environment": hung()["environment"]})  # fmt: skip


LINE = {"mass": 110.0, "diameter": 0.2731, "axial_stiffness": 2e9, "bending_stiffness": 2e7, "damping": 0.5}
WALL = {"pipe": {"wall": 0.0159, "pressure": 5e6, "content_density": 800}}
CODE = {"kind": "F201", "yield_strength": 430.08e6, "tensile_strength": 509.76e6}
MOORED = {"kind": "E301", "strength": 3e6, "pretension_factor": 1.2, "environment_factor": 1.5, "pretension": 5e4}


def hung(**more):
    """A pipe that is led to and fro, and a mooring line beyond it."""
    sections = [LINE | WALL | {"length": 60.0, "code": CODE}, LINE | {"length": 40.0, "code": MOORED}]
    return cable_scene(
        sections, clamped_at([0, 0, -5], [1, 0, -0.3]),
        pinned_at(99, 0, -10, motion={"surge": {"amplitude": 0.2, "period": 8.0}, "ramp": 8}),
        fluid={"density": 1025, "surface": 0.0}, model="rod", mesh=50, contact={"self": False}, time=(16.0, 0.1),
        output=0.5
    ) | more  # fmt: skip


@pytest.fixture(scope="module")
def moved(tmp_path_factory):
    path = tmp_path_factory.mktemp("codes") / "run.h5"
    hybrid.run(hung(output={"every": 0.5, "errors": True}), path).close()
    return path


def test_every_output_has_what_codes_let_it_use(moved):
    with hybrid.open(moved) as result:
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
    rod, catenary = (hybrid.static(hung(ends=ends, model=model, **more)) for model in ("rod", "catenary"))
    rod_used, used = rod["code_used"][0], catenary["code_used"][0]
    np.testing.assert_allclose(used[10:31], rod_used[10:31], rtol=0.02)  # away from the ends
    assert 100.0 * code_of_steps(catenary) == pytest.approx(used.max(), rel=0.01) and used.max() > 20.0


@pytest.mark.long
@pytest.mark.needs("dask", "zarr", "xarray")
def test_codes_are_shown(moved, tmp_path):
    """In `hybrid stats`, in the report with pictures along s and over time, and kept by a study."""
    out = CliRunner().invoke(app, ["stats", str(moved)])
    assert out.exit_code == 0 and "code_used" in out.output and "DNV-OS-F201" in out.output.replace("\n", " ")
    with hybrid.open(moved) as result:
        page = hybrid.report(result, tmp_path / "page.html").read_text()
    assert 'id="plot-range-code_used"' in page and 'id="plot-code_used"' in page
    assert "DNV-OS-E301 (July 2021)" in page and "DNV-OS-F201 (October 2010)" in page
    (tmp_path / "scene.yaml").write_text(yaml.safe_dump(hung()))
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
    tables = hung()
    tables["cable"]["sections"][1]["code"] = MOORED | {"strength": 1e3, "pretension": 0.0}
    rest = hybrid.static({k: x for k, x in tables.items() if k not in ("time", "output")})
    held = next(x for x in rest.verdicts().quantities if x.limit == "code")
    assert held.broken and held.s >= 60.0


def test_every_step_of_a_mooring_line_counts():
    """Exactly: outputs far apart have the largest use of outputs at every step, in verdicts, statistics and studies."""
    found = {}
    for every in (0.1, 7.3):
        tables = hung(output={"every": every, "points": 51}, time={"duration": 16.0, "step": 0.1})
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
    tables = hung(output={"every": 0.5, "errors": True}, model="catenary")
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
        hybrid.run(hung(cable={"sections": sections}, output={"every": x, "errors": True})) for x in (0.1, 7.3)
    )
    held = next(x for x in few.verdicts().quantities if x.limit == "code")
    bound, true = 100.0 * code_of_steps(few), float(np.nanmax(every["code_used"]))
    assert held.value < 0.9 * true and held.value < 100.0 < bound and bound >= true
    assert held.verdict == "not verified" and held.bound == pytest.approx(bound)
    (row,) = rows_of(few, ["code_used"])
    assert f"between them at most {bound:.5g} % by the ranges of all steps" in row["beyond_outputs"]


def test_refusals():
    tables = hung()
    tables["cable"]["sections"][1]["code"] = CODE
    with pytest.raises(SceneError, match="the wall that DNV-OS-F201 checks"):
        hybrid.validate_scene(tables)
    tables["cable"]["sections"][1]["code"] = {x: y for x, y in MOORED.items() if x != "environment_factor"}
    with pytest.raises(SceneError, match="environment_factor"):
        hybrid.validate_scene(tables)
