"""Cells that follow the curvature on a line that is paid out or taken in: exact solutions, rods, kicks, resume."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import hybrid
from hybrid.cli.tables import zones_over_time
from hybrid.simulation.payout_nodes import NodeChanges
from tests.inside import OnlyLine, calls_of
from tests.scenes import cable_scene, clamped_at, pinned_at
from tests.simulation.test_payout import G, hanging
from tests.simulation.test_payout_zones import touching

FOLLOWING = {"kind": "adaptive", "tolerance": 1e-5, "hold_time": 1.0, "curvature_error": 0.05}


def pinned(rate: float, model: Any = FOLLOWING, **more: Any) -> dict[str, Any]:
    """The line of `touching` from a winch at which it turns freely."""
    scene = touching(rate, model, **more)
    scene["ends"]["end"]["kind"] = "pinned"
    del scene["ends"]["end"]["tangent"]
    return scene


def change_cells(line: OnlyLine, random: np.random.Generator, part: float) -> None:
    """Other cells far from the winch: a part of the nodes that there might be."""
    layout = line.model.layout
    assert layout is not None
    here = np.zeros(layout.starts[-1] + 1, bool)
    for begin, size in zip(layout.starts, layout.parts, strict=False):
        cells = [(begin, begin + size)]
        while cells:
            a, b = cells.pop()
            here[[a, b]] = True
            if b - a > 1 and random.random() < part:
                cells += [(a, (a + b) // 2), ((a + b) // 2, b)]
    line.zones.switch(line.zones.switching.manager.same_zones(), here)
    line.run.go_on_changed((), "where cells change")


@pytest.mark.long
@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("side", ["end", "start"])
def test_a_hanging_line_weighs_what_is_out_while_its_cells_change(sign: float, side: str) -> None:
    """T = w L - m L dc/dt at the winch, to round-off, with other cells every half a second."""
    scene = hanging({"rates": [[0, 0], [20, sign]]}, 18.0)
    section = {"length": 40.0, "mass": 2.0, "bending_stiffness": 20.0}
    scene |= {"cable": {"sections": [section]}, "model": FOLLOWING | {"rod_cell": 0.4, "force_rod": [[0, 40]]}}
    if side == "start":
        scene["ends"] = {"start": scene["ends"]["end"], "end": "free"}
    random, cells, off = np.random.default_rng(1), set(), []
    with hybrid.Simulation(scene) as sim:
        line = OnlyLine(sim)
        for k in range(350):
            sim.step()
            if k % 10 == 0:
                change_cells(line, random, 0.5)
            cells.add(line.model.cells)
            force = getattr(sim.forces(), side)[2]
            off.append(force / (-2.0 * sim.length * (G - sign * 0.05)) - 1.0)
        assert abs(sim.length - 40.0) > 7.0
    assert len(cells) > 10
    assert np.abs(off).max() < 1e-9


@pytest.mark.parametrize("side", ["end", "start"])
@pytest.mark.parametrize("rate", [0.5, -0.5])
def test_cells_behind_a_clamped_winch_are_short_where_no_mesh_is_given(rate: float, side: str) -> None:
    """Bending fades over 0.5 m there, an eighth of a base cell: the moment is that of short rods, and nothing warns."""
    other = {"end": "start", "start": "end"}[side]
    tangent = [1.0 if side == "end" else -1.0, 0.0, 0.0]
    section = {"length": 100.0, "mass": 8.0, "axial_stiffness": 1e7, "bending_stiffness": 1e3}
    held = clamped_at([75, 0, 0], tangent, payout={"rates": [[0, 0], [1, rate]]})
    ends = {other: pinned_at(0, 0, -45), side: held}
    scene = cable_scene(section, **ends, time=(4.0, 0.1), output={"every": 1.0, "errors": False})
    found = hybrid.run(scene | {"model": {"kind": "adaptive", "curvature_error": 0.05}})
    fine = hybrid.run(scene | {"model": "rod", "mesh": {"cells": 400}})
    assert "unresolved bend" not in {event.kind for event in found.events}
    its, true = (np.linalg.norm(x[f"moment_{side}"], axis=1) for x in (found, fine))
    assert np.abs(its / true - 1.0).max() < 0.05
    assert found.mesh[-1].s.size < 0.2 * fine.mesh[-1].s.size


@pytest.mark.parametrize(("rate", "part"), [(0.8, 0.7), (-0.8, 0.4)])
def test_as_rods_whose_cells_are_short_everywhere(rate: float, part: float) -> None:
    """Nearer to 320 rods than rods as long as its base cells, and its energy is balanced as theirs is."""
    fine, coarse = (hybrid.run(pinned(rate, model="rod", mesh={"cells": n})) for n in (320, 40))
    found = hybrid.run(pinned(rate))
    off = [np.abs(x["position"] - fine["position"]).max() for x in (found, coarse)]
    pulls = [np.linalg.norm(x["reaction_end"], axis=1) for x in (found, coarse, fine)]
    assert off[0] < part * off[1]
    assert np.abs(pulls[0] - pulls[2]).max() < 0.9 * np.abs(pulls[1] - pulls[2]).max()
    left = [np.abs(x["work/scheme"]).max() for x in (found, fine)]
    assert left[0] < 1.1 * left[1]
    assert found.mesh[-1].s.size < 0.75 * fine.mesh[-1].s.size


@pytest.mark.parametrize("model", [FOLLOWING, {"kind": "adaptive", "tolerance": 1e-5, "hold_time": 1.0}])
def test_the_tension_now_is_that_of_the_result(model: dict[str, Any], tmp_path: Path) -> None:
    """From outside, between outputs, which zones that move on a line that is paid out refused with a traceback."""
    scene = pinned(-0.8, model=model) | {"output": {"every": 2.0}}
    with hybrid.Simulation(scene, tmp_path / "run.h5") as sim:
        sim.advance(3.0)
        assert np.isfinite(sim.tension()).all()
        sim.advance(4.0)
        found, t = sim.tension(), sim.t
    result = hybrid.open(tmp_path / "run.h5")
    k = int(np.argmin(np.abs(result.t - t)))
    np.testing.assert_allclose(found, result["tension"][k], rtol=1e-9)


@pytest.mark.parametrize("side", ["end", "start"])
def test_cells_that_are_too_long_at_the_winch_are_told_of(side: str) -> None:
    """They stay whole, whatever `rod_cell` says; and the part that is rod is one of the line that is out."""
    result = hybrid.run(touching(0.8, FOLLOWING, side))
    (said,) = [x.text for x in result.events if x.kind == "unresolved bend" and x.t == 0.0]
    assert said.endswith("would do (`mesh.cells`: those at the winch stay whole)")
    shares = zones_over_time(result)["rod"]
    assert 0.0 < shares["least"] <= shares["mean"] <= shares["most"] <= 1.0
    assert max(sum(z.s_b - z.s_a for z in zones if z.kind == "rod") for zones in result.zones) > 100.0


# --- nodes that enter and leave in compiled code ---

# What is made of forces on the ends: those of the state between a change and the next step are summed up in another
# order, and outputs within that step lie between them; all else, and so every step, is the same to the last bit.
OF_ENDS = ("reaction_", "tension", "envelope/tension_")


def scene(winch: str, model: str, rate: float, **end: Any) -> dict[str, Any]:
    """20 m sagging over 16 m, dense enough to bend; nodes enter or leave at `winch`, which is clamped where asked."""
    section = {"length": 20.0, "mass": 2.0, "diameter": 0.03, "axial_stiffness": 1e6}
    if model == "rod":
        section |= {"bending_stiffness": 200.0}
    ends = {"start": pinned_at(0, 0, 0), "end": pinned_at(16, 0, 0)}
    ends[winch] |= {"payout": {"rate": rate, "ramp": 0.5}} | end
    return cable_scene(section, **ends, model=model, mesh=20, time=(3.0, 0.05), output=0.35)


@pytest.mark.parametrize(
    ("winch", "model", "rate", "end"),
    [
        ("end", "catenary", 1.5, {}),
        ("start", "catenary", -1.5, {}),
        ("start", "rod", 1.5, {"kind": "clamped", "tangent": [1, 0, -0.8]}),
    ],
)
def test_nodes_enter_and_leave_as_by_python(
    winch: str, model: str, rate: float, end: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    given = scene(winch, model, rate, **end)
    one_by_one = calls_of(monkeypatch, NodeChanges, "change_once")
    found = hybrid.run(given)
    assert not one_by_one
    monkeypatch.setattr(NodeChanges, "may_change", lambda *_: False)
    other = hybrid.run(given)
    assert len(one_by_one) >= 3
    for name in (x for x in found.names if x != "steps/cpu" and found[x].dtype.kind == "f"):
        most = 0.0
        if name.startswith(OF_ENDS):
            most = 4.0 * np.spacing(np.nanmax(np.abs(other[name])))
        np.testing.assert_allclose(found[name], other[name], rtol=0.0, atol=most, err_msg=name)


@pytest.mark.parametrize(
    ("winch", "rate", "more"),
    [("end", 0.8, {}), ("start", 0.8, {}), ("start", -0.8, {}), ("end", 0.4, {"contact": {"self": True}})],
)
def test_torque_stays_even_where_nodes_enter_and_leave(winch: str, rate: float, more: dict[str, Any]) -> None:
    """A straight line whose ends hold one turn: torque is 2 pi GJ/L at every node and step, in envelope and outputs.

    2 %: what the growing cell adds beside the winch, and the twist waves of the ramp.
    """
    far, out = "start" if winch == "end" else "end", 4.0
    up = {"tangent": [0, 0, 1 if winch == "end" else -1], "normal": [1, 0, 0]}
    section = {"length": out, "mass": 0.4, "diameter": 0.02, "axial_stiffness": 1e5, "bending_stiffness": 0.2}
    pulled = {"kind": "guided", **up, "force": [0, 0, -40.0]}
    held = {"kind": "clamped", "position": [0, 0, 0], **up, "payout": {"rate": rate, "ramp": 0.2}}
    turned = {winch: held, far: pulled}
    turned["end"] |= {"turns": 1}
    section |= {"torsional_stiffness": 0.16}
    given = cable_scene(section, **turned, model="rod", mesh=40, time=(1.5, 0.01), output=0.02, dimension=3)
    result = hybrid.run(given | more)
    length = result["payout/length"]
    assert abs(length[-1] - length[0]) > 5 * out / 40  # nodes have entered, or left
    expected = 2.0 * np.pi * 0.16 / length
    low, high = 0.98 * expected.min(), 1.02 * expected.max()
    torque = np.abs(result["torque"])
    assert low < torque.min() and torque.max() < high
    for bound in ("min", "max"):
        kept = np.abs(result[f"envelope/torque_{bound}"])
        kept = kept[np.isfinite(kept)]
        assert low < kept.min() and kept.max() < high
