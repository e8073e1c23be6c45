"""An equilibrium on a coarse mesh as a start for a fine one."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from problems import at_rest, pinned, scene

import hybrid
from hybrid.model.build import build
from hybrid.model.nearby import FEWEST, coarser, refined
from hybrid.scene.read import one_line
from tests.scenes import cable_scene, pinned_at

EXAMPLES = Path(__file__).parents[2] / "examples"


def hanging(cells, **more):
    section = {"length": 10.0, "mass": 1.0, "bending_stiffness": 0.5, "axial_stiffness": 1e5}
    clump = {"attachments": [{"kind": "clump", "at": 3.3, "mass": 2.0}]} if more.pop("clump", False) else {}
    what = scene(section, pinned(), pinned(7.0, 0, 0), cells=cells, gravity=10.0, **more).model_dump(exclude_none=True)
    what["cable"] |= clump
    return build(one_line(hybrid.validate_scene(what)))


def test_places_that_matter_keep_their_nodes():
    zones = [{"catenary": 4.0, "cells": 40}, {"rod": 2.5, "cells": 90}, {"catenary": 3.5, "cells": 50}]
    fine = hanging(None, model=zones, clump=True)
    coarse = coarser(fine)
    assert coarse is not None and coarse.cells < 0.3 * fine.cells
    assert coarse.line.mass.sum() == pytest.approx(fine.line.mass.sum(), rel=1e-14)
    assert coarse.line.force.sum(axis=0) == pytest.approx(fine.line.force.sum(axis=0), rel=1e-14)
    for s in (0.0, 3.3, 4.0, 6.5, 10.0):
        assert np.abs(coarse.line.s - s).min() < 1e-12
    assert [z.kind for z in coarse.zones] == ["catenary", "rod", "catenary"]
    assert set(np.round(coarse.line.s, 12)) <= set(np.round(fine.line.s, 12))


def test_few_cells_are_coarse_already():
    assert coarser(hanging(FEWEST)) is None


def test_a_refined_equilibrium_is_nearly_one():
    """Of second order: Newton starts nearer by four from a mesh twice as fine."""
    shifts = []
    for cells in (160, 320):
        fine = hanging(4 * cells)
        coarse = coarser(fine)
        start = refined(at_rest(coarse).state.lines[0], coarse.line, fine.line)
        assert np.abs(np.einsum("ij,ij->i", start.a1, start.e)).max() < 1e-12
        found = at_rest(fine, start=start)
        shifts.append(np.abs(found.state.lines[0].r - start.r).max())
        assert len(found.path) == 1
    assert 3.0 < shifts[0] / shifts[1] < 5.0


def test_a_line_that_newton_misses_on_a_fine_mesh():
    """The laid cable with 1200 rods: from its own first shape it needs minutes, or is not found; the tension is Zajac's."""
    result = hybrid.static(hybrid.load_scene(EXAMPLES / "laying.yaml", ["model=rod", "mesh.cells=1200"]))
    assert "the equilibrium with 300 cells" in result.attributes["static_path"]
    assert result.tension[0, -1] == pytest.approx(1521.4, rel=1e-4)


def test_of_very_many_cells_the_coarser_equilibrium_comes_first(monkeypatch):
    """Newton would do at once here; where it fails that is dear.  The answer is the same, to Newton's tolerance."""
    scene = hybrid.load_scene(EXAMPLES / "touchdown.yaml", ["model=rod", "mesh.cells=1200"])
    found = hybrid.static(scene)
    assert "the equilibrium with 300 cells" in found.attributes["static_path"]
    monkeypatch.setattr("hybrid.simulation.equilibrium.MANY", 1e9)
    at_once = hybrid.static(scene)
    assert "the equilibrium with" not in at_once.attributes["static_path"]
    assert np.abs(found.position - at_once.position).max() < 1e-9 * scene.cable.length


@pytest.mark.parametrize("cells", [80, 200, 800])
def test_a_fold_in_its_plane_is_not_twisted(cells):
    """Both ends at one place, and a bend far sharper than a cell of the start: plane and space agree in the moment."""
    section = {"length": 10.0, "mass": 0.6, "diameter": 0.01, "bending_stiffness": 6e-5, "axial_stiffness": 6e6}
    loop = cable_scene(
        section | {"max_strain": 1e9}, pinned_at(0, 0, 0), pinned_at(0, 0, 0), gravity=9.81, model="rod", mesh=cells
    )
    flat, space = (hybrid.static(loop | {"dimension": n}) for n in (2, 3))
    assert flat.bending_moment.max() == pytest.approx(space.bending_moment.max(), rel=1e-6)
    assert flat.curvature.max() == pytest.approx(space.curvature.max(), rel=1e-6)
