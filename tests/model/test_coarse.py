"""An equilibrium on a coarse mesh as a start for a fine one."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from problems import at_rest, pinned, scene

import hybrid
from hybrid.kernels.laws.water import body_drag, half_cell_drag
from hybrid.kernels.machine.compile import kernel
from hybrid.model.build import build
from hybrid.model.initial_shape import current_drag
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


# --- The first shape of a search for equilibrium ---


@kernel
def drag_of_a_half_cell(u, d, il, cn, ct):
    return half_cell_drag(u, d, il, cn, ct)[0]


@kernel
def drag_of_a_body(u, c):
    return body_drag(u, c)[0]


def test_drag_on_the_first_shape_is_that_of_the_kernels():
    scene = hybrid.validate_scene(
        cable_scene(
            {"length": 60, "mass": 3, "diameter": 0.05, "drag": {"normal": 1.2, "tangential": 0.1}},
            pinned_at(0, 0, 0),
            pinned_at(30, 0, -40),
            attachments=[{"kind": "clump", "at": 30, "mass": 20, "drag_area": 0.3}],
            fluid={
                "density": 1025,
                "current": [{"z": -50, "velocity": [0.2, 0.1, 0]}, {"z": 0, "velocity": [1, -1, 0]}],
            },
            model="catenary",
            mesh=6,
        )
    )
    model = build(one_line(scene))
    line, sea, r = model.line, model.sea.values, model.start.r
    expected = np.zeros_like(r)
    u = [tuple(-np.array([np.interp(z, sea.z, sea.current[:, k]) for k in range(3)])) for z in r[:, 2]]
    for c in range(6):
        e = r[c + 1] - r[c]
        size = float(np.linalg.norm(e))
        for i in (c, c + 1):
            expected[i] += drag_of_a_half_cell(u[i], tuple(e / size), 1 / size, line.drag_n[c], line.drag_t[c])
    for i in range(7):
        expected[i] += drag_of_a_body(u[i], line.point_drag[i])
    assert line.point_drag.any() and np.abs(expected).min(axis=0)[0] > 0
    assert current_drag(line, sea, r) == pytest.approx(expected, rel=1e-12, abs=1e-12)


def test_a_line_that_falls_into_a_point_has_no_first_shape_of_loads():
    """Hardly any axial stiffness, a current: the catenary stretches until its cells have no directions."""
    section = {"length": 800, "mass": 1.5, "diameter": 0.03, "axial_stiffness": 1e-30, "drag": {"normal": 1.2}}
    scene = hybrid.validate_scene(
        cable_scene(
            section,
            "free",
            pinned_at(0, 0, 0),
            fluid={"density": 1025, "surface": 0, "current": [-2, 0, 0]},
            seabed={"z": -200, "stiffness": 2000},
            model="catenary",
            mesh=16,
        )
    )
    assert np.isfinite(build(one_line(scene)).start.r).all()


@pytest.mark.parametrize("length", [15.0, 15.3])
@pytest.mark.parametrize("places", [[4.34, 5.44], [3.48, 3.88], [3.0, 3.4, 3.6, 8.9], [2.5, 2.51]])
def test_nodes_of_a_line_that_is_counted_from_its_other_end_are_the_same(length: float, places: list[float]) -> None:
    """Where clumps are near each other there was a cell more or less from one end."""
    section, ends = {"length": length, "mass": 2.0, "axial_stiffness": 1e6}, (pinned_at(0, 0, 0), pinned_at(12, 0, 0))
    found = []
    for of, x in ((ends, places), (ends[::-1], [15.0 - s for s in reversed(places)])):
        clumps = [{"kind": "clump", "at": s * length / 15.0, "mass": 5.0} for s in x]
        tables = cable_scene(section, *of, attachments=clumps, model="catenary", mesh=15)
        found.append(build(one_line(hybrid.validate_scene(tables))).line.s)
    assert found[0] == pytest.approx(length - found[1][::-1])
