"""`result.mesh[i]`: the cells at every output, whatever the output grid is."""

import h5py
import numpy as np
import pytest

import hybrid
from hybrid.accuracy import api
from hybrid.errors import ResultError
from hybrid.simulation.case import Case
from hybrid.simulation.line_result import LineResult
from hybrid.simulation.run_zones import RunKinds
from tests.scenes import cable_scene, clamped_at, pinned_at


def swinging(model, **more):
    """A line whose end swings so fast at first that zones change."""
    section = {"length": 20.0, "mass": 1.0, "bending_stiffness": 5.0, "axial_stiffness": 1e5}
    motion = {"surge": {"amplitude": 3.0, "period": 4.0}, "ramp": 2.0}
    data = cable_scene(
        section,
        clamped_at([0, 0, 0], [0, 0, -1]),
        pinned_at(8, 0, 0, motion=motion),
        model=model,
        time=(6.0, 0.02),
        output=(0.1, 7),
    )
    return hybrid.validate_scene(data | more)


@pytest.mark.parametrize(
    "model", ["rod", "catenary", {"zones": [{"rod": 5, "cells": 20}, {"catenary": 15, "cells": 9}]}]
)
def test_a_mesh_that_stays(model):
    result = hybrid.static(swinging(model))
    assert len(result.mesh) == 1
    nodes, kinds = result.mesh[-1]
    assert nodes[0] == 0.0 and nodes[-1] == 20.0 and (np.diff(nodes) > 0.0).all()
    assert nodes.size == kinds.size + 1 == result.attributes["cells"] + 1
    if isinstance(model, str):
        assert set(kinds) == {model}
    else:
        assert kinds.tolist() == ["rod"] * 20 + ["catenary"] * 9
        np.testing.assert_allclose(np.diff(nodes[20:]), 15 / 9)
        assert repr(result.mesh[0]) == "<mesh of 29 cells of 0.25 to 1.667 m: 9 catenary, 20 rod>"


def test_the_mesh_of_zones_that_move(monkeypatch, tmp_path):
    """At every output the nodes are those that the step was computed on."""
    seen = {}

    class Spy(Case):
        def _loop(self, *args):
            loop = super()._loop(*args)
            record = loop._record

            def recorded(batch, errors):
                line = loop.run.model.line
                for t in batch.t.tolist():
                    seen[t] = line.s.copy(), line.spin.astype(bool).copy()
                return record(batch, errors)

            loop._record = recorded
            return loop

    def shown(self, batch):
        for t in batch.t.tolist():
            seen[t] = self.model.line.s.copy(), self.model.line.spin.astype(bool).copy()
        return output(self, batch)

    output = LineResult.output
    monkeypatch.setattr(LineResult, "output", shown)
    monkeypatch.setattr(api, "Case", Spy)
    monkeypatch.setattr(RunKinds, "apply", lambda *_: False)  # outputs of other zones are recorded one by one
    result = hybrid.run(swinging("adaptive"), tmp_path / "run.h5")
    kinds = {tuple(mesh.kinds) for mesh in result.mesh}
    assert len(kinds) > 3 and len(result.mesh) == len(result.times) == len(seen)
    for t, mesh in zip(result.times, result.mesh, strict=True):
        nodes, rod = seen[float(t)]
        np.testing.assert_array_equal(mesh.s, nodes)
        np.testing.assert_array_equal(mesh.kinds == "rod", rod)
    assert [m.s.size for m in result.mesh[3:5]] == [result.mesh[k].s.size for k in (3, 4)]
    with pytest.raises(IndexError):
        result.mesh[len(result.mesh)]


def test_a_result_without_a_mesh_has_none(tmp_path):
    """As results of before 0.6."""
    path = tmp_path / "still.h5"
    hybrid.static(swinging("catenary"), path).close()
    with h5py.File(path, "r+") as file:
        del file["mesh"]
    result = hybrid.open(path)
    assert not hasattr(result, "mesh")
    with pytest.raises(ResultError, match="no 'mesh'"):
        result.mesh  # noqa: B018
