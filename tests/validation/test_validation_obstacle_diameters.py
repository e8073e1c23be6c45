"""Lines of several diameters on obstacles: what lies on them, and what a line has that is as thick throughout."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import hybrid
from tests.scenes import cable_scene, pinned_at
from tests.validation.obstacle_scenes import over_pipe

Tables = dict[str, Any]
STIFFNESS = 4e4


def cut(tables: Tables, lengths: list[float], diameters: list[float]) -> Tables:
    """The scene with its section cut in pieces of these lengths and diameters, m."""
    section = tables["cable"]["sections"][0]
    pieces = [section | {"length": x, "diameter": d} for x, d in zip(lengths, diameters, strict=True)]
    return tables | {"cable": {"sections": pieces}}


def test_each_section_rests_at_its_own_radius() -> None:
    """A limp rope on a floor: its axis is as high as its radius there, less the depth of the law of contact."""
    floor = {"kind": "plane", "at": [0, 0, 0], "normal": [0, 0, 1], "stiffness": STIFFNESS, "friction": 0.5}
    section = {"length": 12.0, "mass": 2.0, "diameter": 0.1, "axial_stiffness": 1e4, "bending_stiffness": 1e-4,
               "damping": {"mass": 5.0}}  # fmt: skip
    tables: Tables = cut(
        cable_scene(section, pinned_at(0, 0, 0.05), pinned_at(12, 0, 0.02), obstacles={"floor": floor}, model="rod",
                    mesh=120, contact={"self": False}, output={"points": 121}),
        [6.0, 6.0], [0.1, 0.04]
    )  # fmt: skip
    rest = hybrid.static(tables)
    z, weight, onset = rest.position[-1][:, 2], 2.0 * 9.81, 0.01 * 0.04
    p = np.sqrt(2.0 * onset * weight / STIFFNESS)
    p = p if p < onset else weight / STIFFNESS + 0.5 * onset
    assert z[10:50] == pytest.approx(0.05 + 0.5 * onset - p, abs=1e-7)
    assert z[70:110] == pytest.approx(0.02 + 0.5 * onset - p, abs=1e-7)
    force = -sum(rest[f"reaction_{x}"][-1][2] for x in ("start", "end")) + 12.0 * weight  # what the floor bears
    assert force == pytest.approx(float(np.trapezoid(np.full(120, weight), dx=0.1)), rel=0.02)


@pytest.mark.parametrize("model", ["rod", "catenary"])
def test_thick_sections_beside_the_pipe_change_nothing_on_it(model: str) -> None:
    """Where the thin section alone comes to the pipe all is as of a thin line, at rest and sliding over it."""
    tables = over_pipe(model=model)
    pipe = tables["obstacles"]["pipe"] | {"stiffness": 3e5, "at": [4, 0, -2.1]}
    tables["obstacles"] = {"pipe": pipe}
    tables["cable"]["sections"][0]["rotary_inertia"] = 1e-3  # else it goes by the diameter
    thin, thick = (hybrid.run(cut(tables, [1.125, 7.125, 3.75], x)) for x in ([0.05, 0.05, 0.05], [0.2, 0.05, 0.3]))
    assert np.abs(thin["work/friction"][-1]) > 0.1
    np.testing.assert_allclose(thick.position, thin.position, atol=1e-10)
    s = np.array(thin.s)
    within = np.abs(s - 1.125) + np.abs(s - 8.25) < 7.0  # not where sections meet, at which outputs know both
    np.testing.assert_allclose(thick["tension"][:, within], thin["tension"][:, within], rtol=1e-8)
    np.testing.assert_allclose(thick["energy/contact"], thin["energy/contact"], rtol=1e-7)


def test_a_step_of_diameter_that_rubs_on_a_pipe() -> None:
    """The thick side lies at its radius, the thin one no nearer than at its own, and the energy is what works have put in.

    Outputs are at ends of steps.
    """
    tables = cut(over_pipe(output={"every": 0.05, "points": 97, "exact": True}), [4.125, 7.875], [0.05, 0.09])
    pipe = tables["obstacles"]["pipe"] | {"at": [4, 0, -2.1]}
    result = hybrid.run(tables | {
        "obstacles": {"pipe": pipe}, "mesh": {"cells": 192}, "time": {"duration": 1.0, "step": 0.005}
    })  # fmt: skip
    axis, s = np.array(pipe["axis"]) / np.linalg.norm(pipe["axis"]), np.array(result.s)
    w = result.position - np.array(pipe["at"])
    gap = np.linalg.norm(w - (w @ axis)[..., None] * axis, axis=2) - pipe["radius"]
    assert gap[:, s > 4.12].min(axis=1) == pytest.approx(0.045, abs=0.002)
    assert gap[:, s < 4.12].min() > 0.025
    energy = sum(
        np.array(result[f"energy/{x}"]) for x in ("bending", "contact", "kinetic", "potential", "stretch", "torsion")
    )
    work = sum(np.array(result[f"work/{x}"]) for x in ("start", "end", "contact", "friction", "mass_damping", "scheme"))
    assert -result["work/friction"][-1] > 0.2
    np.testing.assert_allclose(energy - energy[0], work, atol=2e-3 * float(np.abs(result["work/end"]).max()))
