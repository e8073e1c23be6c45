"""Cells that follow the curvature: their lengths, chords as long as arcs, and runs whose mesh moves."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path
from typing import NoReturn

import numpy as np
import pytest
from adapt_cases import along, bight, cable, followed, hanging, helix, layout, on, state_on
from problems import order

import hybrid
from hybrid.errors import ComputationError, Outcome
from hybrid.kernels.machine import binding
from hybrid.kernels.machine.binding import Table
from hybrid.kernels.mesh.cell_errors import CURVATURE, MOMENT, TENSION
from hybrid.kernels.mesh.zone_criteria import CRITERIA
from hybrid.kernels.mesh.zone_step import blank_zone_job, read_arcs
from hybrid.outputs.probes import Observer
from hybrid.scene.read import one_line
from hybrid.simulation import cell_changes, zones_at_rest
from hybrid.simulation.cell_changes import CellChanges
from hybrid.simulation.restart import zoning_of_today
from hybrid.simulation.run_zones import _LineZones
from hybrid.solve.network_steps import NetworkSteps
from hybrid.zones.manager import Allowed, DomainManager, Times, shares_asked
from tests.inside import calls_of, never_due
from tests.scenes import cable_scene, clamped_at, pinned_at

EXAMPLES = Path(__file__).parents[2] / "examples"
# A line that touches down, its upper end heaving; the layer at the touchdown is 0.4 m long and goes to and fro over 20 m.
TOUCHDOWN = (
    "output.errors=false", "output.points=501", "output.every=1", "time.duration=20",
    "model={kind: adaptive, force_rod: [[0, 250]], curvature_error: 0.03}", "mesh={cells: 24}",
)  # fmt: skip
ZONES = "model={kind: adaptive, curvature_error: 0.05, hold_time: 2.0}"  # by themselves they would not pay so soon


def test_where_tension_is_lost_is_read_on_the_cells_of_now() -> None:
    """Cells that follow change between two reviews, and the manager knows the layout of the last one."""
    what = cable(10.0)
    before, now = (layout(np.linspace(0.0, 10.0, 9), parts, "R" * 8) for parts in (4, 1))
    managers = [DomainManager(what, x, np.zeros(8, int), 1e12, Allowed(1e-2, 0.03), Times(1.0)) for x in (before, now)]
    manager, other = managers
    manager.use_cells_of(before, other.zones)  # as a change of cells leaves it
    manager.zones.counts.known, manager.zones.past[:], manager.zones.clock.age = 1, 100.0, 1.0
    state = state_on(on(what, now), hanging(0.5, 3.0)[0], lambda s: np.where(abs(s - 4.4) < 0.6, 1.0, 90.0))
    assert manager._losing_tension(state).tolist() == [x == 3 for x in range(8)]


@pytest.mark.parametrize("share", [0.01, 0.04])
def test_cells_are_as_long_as_the_curvature_allows(share: float) -> None:
    """A catenary, kappa = a/(a^2 + s^2): h^2 |kappa''| / 8 is at most the share of the largest, and cells no shorter

    than a quarter of what that allows; they are dyadic parts, and neighbours differ by little.
    """
    a, at = 0.5, 3.0
    found = followed(hanging(a, at)[0], share).planned
    s, h = found.nodes, np.diff(found.nodes)
    x = np.linspace(0.0, 10.0, 20001)
    k = a / (a * a + (x - at) ** 2)
    bends = np.abs(np.gradient(np.gradient(k, x), x))
    worst = np.array([bends[(x >= p) & (x <= q)].max() for p, q in pairwise(s)])
    assert (h**2 * worst / 8.0 <= 1.1 * share * k.max()).all()
    sharp = worst > 0.3 * worst.max()
    assert (h[sharp] ** 2 * worst[sharp] / 8.0).max() > share * k.max() / 16.0
    assert set(found.base) <= set(s.tolist()) and found.places.size < 150
    ratio = h[1:] / h[:-1]
    assert ratio.min() > 1 / 4.01 and ratio.max() < 4.01
    size = np.diff(found.places)
    assert ((size & (size - 1)) == 0).all() and (found.places[:-1] % size == 0).all()


def test_no_cell_of_a_rod_is_twisted_by_more_than_a_quarter_rad() -> None:
    """However straight it is, as cells that stay; where there is little twist, or no rod, cells may be long."""
    line = on(cable(10.0), layout(np.linspace(0.0, 10.0, 9), 64, "R" * 8))
    rate = np.where(line.s[1:-1] < 5.0, 4.0, 0.01)
    straight = along((1.0, 0.0, 0.0))
    found = followed(straight, 0.1, twist=rate * line.h[1:]).planned
    h, middle = np.diff(found.nodes), 0.5 * (found.nodes[1:] + found.nodes[:-1])
    twisted = 4.0 * h[middle < 5.0]
    assert twisted.max() < 0.25 < 4.0 * twisted.min()
    assert h[middle > 7.5].min() > 10.0 * twisted.max() / 4.0
    left = followed(straight, 0.1, twist=rate * line.h[1:])
    left.manager.zones.next_rod[:] = np.arange(8) > 3
    assert np.diff(left.planned.nodes)[:2].min() > 1.0


@pytest.mark.parametrize("shape", ["hanging", "helix"])
def test_chords_become_as_long_as_arcs_to_fourth_order(shape: str) -> None:
    """What is taken off a length is what the chord of a smooth curve lacks, h^3 kappa^2 / 24, to fourth order."""
    curve = {"hanging": hanging(), "helix": helix()}[shape][0]
    left = []
    for n in (10, 20, 40):
        what, zones = cable(), layout(np.linspace(0, 10, n + 1), 1, "R" * n)
        line = on(what, zones)
        state = state_on(line, curve)
        manager = DomainManager(what, zones, np.ones(n, int), 1.0, Allowed(1e-2, 0.05), Times(1.0))
        table = Table(blank_zone_job())
        table.bind(line=line, new=state, zones=manager.zones)
        read_arcs(table.numbers)
        chords = np.linalg.norm(state.e, axis=1)
        inner = slice(2, -2)
        left.append(np.abs(manager.zones.true - chords)[inner].max() / line.h[0])
        assert np.abs(line.h - chords)[inner].max() / line.h[0] > 5.0 * left[-1]
    assert order(left)[-1] > 3.5, left


@pytest.fixture(scope="module")
def following():
    return hybrid.run(hybrid.load_scene(EXAMPLES / "touchdown.yaml", list(TOUCHDOWN)))


def test_a_mesh_that_moves_with_the_touchdown(following: hybrid.Result) -> None:
    """The curvature everywhere and always as 600 uniform cells have it, with a fifth of them, and they move."""
    rod = hybrid.run(
        hybrid.load_scene(EXAMPLES / "touchdown.yaml", [*TOUCHDOWN[:4], "model=rod", "mesh={cells: 1000}"])
    )
    most = rod.curvature.max()
    cells = [mesh.kinds.size for mesh in following.mesh][2:]
    assert max(cells) < 150 and np.mean(cells) < 125
    assert np.abs(following.curvature - rod.curvature)[2:].max() < 0.07 * most
    assert np.abs(following.tension - rod.tension)[:, -1].max() < 5e-3 * rod.tension[:, -1].mean()
    assert np.abs(following.position - rod.position).max() < 2e-4 * 250.0
    edges = rod.touchdown[:, 1]
    nearest = [np.diff(mesh.s)[np.searchsorted(mesh.s, x) - 1] for mesh, x in zip(following.mesh, edges, strict=True)]
    assert np.ptp(edges) > 5.0 and max(nearest[2:]) < 0.8  # m, shorter than two layers wherever the touchdown is


def test_what_changes_of_cells_put_in_is_booked(following: hybrid.Result) -> None:
    """Energy less all work is what the time scheme dissipates: as much as with rods that stay, within a part of it."""
    rod = hybrid.run(hybrid.load_scene(EXAMPLES / "touchdown.yaml", [*TOUCHDOWN[:4], "model=rod", "mesh={cells: 400}"]))
    scheme, size = following["work/scheme"], np.abs(rod["work/drag"]).max()
    assert np.abs(following["work/zones"]).max() > 0.0
    assert np.abs(scheme - rod["work/scheme"]).max() < 0.02 * size


@pytest.mark.parametrize("friction", ["", "environment.seabed.friction=0.4"])
@pytest.mark.long  # a kernel of its own: 4 s
def test_changes_in_arrays_made_once_are_those_of_new_arrays(friction: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Cells and zones change alike to the last bit, whether the run's arrays are made once or anew at every change.

    In arrays made once outputs of other cells are looked at together, and are what each is alone.
    """
    sets = [*TOUCHDOWN, "time.duration=8", ZONES, "output.every=0.1"]
    scene = hybrid.load_scene(EXAMPLES / "touchdown.yaml", [*sets, friction] if friction else sets)
    together = calls_of(monkeypatch, Observer, "joined_observation", lambda _, outs: {x.line.s.size for x in outs})
    once = hybrid.run(scene)
    assert max(map(len, together)) > 3 and len(together) < 0.1 * once.t.size
    anew = hybrid.run(scene)
    assert len({mesh.s.size for mesh in once.mesh}) > 5 and {"retry", "shrink"} <= {e.kind for e in once.events}
    assert [(e.t, e.kind, e.text) for e in once.events] == [(e.t, e.kind, e.text) for e in anew.events]
    for name in ("position", "velocity", "tension", "curvature", "work/zones", "energy/bending", "envelope/tension_max",
                 "envelope/curvature_t_max", "envelope/displacement_max", "steps/iterations"):  # fmt: skip
        assert np.array_equal(once[name], anew[name], equal_nan=True), name


def test_a_line_that_is_watched_changes_its_cells_in_arrays_made_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """A slack line could come near itself: every step looks how near it is, and its cells change in compiled code."""
    section = {
        "length": 2000, "diameter": 0.05, "mass": 20, "axial_stiffness": 2e8, "bending_stiffness": 2e4,
        "drag": {"normal": 1.2, "tangential": 0.05}, "added_mass": {"normal": 1.0},
    }  # fmt: skip
    moves = {"surge": {"amplitude": 8.0, "period": 40}, "heave": {"amplitude": 2.0, "period": 10}, "ramp": 10}
    scene = hybrid.validate_scene(cable_scene(
        section, pinned_at(0, 0, -500), pinned_at(1650, 0, 0, motion=moves), fluid={"density": 1025},
        seabed={"z": -500, "stiffness": 5e3, "damping": 500}, time=(40.0, 0.2), mesh=32,
        model={"kind": "adaptive", "curvature_error": 0.03}, output={"every": 2, "points": 501, "errors": False}
    ))  # fmt: skip
    changed = calls_of(
        monkeypatch, _LineZones, "switch", lambda x, how, *_: how.same and x._run.lines[0].envelope.itself.on
    )
    once = hybrid.run(scene)
    by_python = sum(changed)
    monkeypatch.setattr(CellChanges, "may_change", lambda *_: False)
    anew = hybrid.run(scene)
    assert sum(changed) - by_python > 20 > 5 >= by_python
    assert [(e.t, e.kind, e.text) for e in once.events] == [(e.t, e.kind, e.text) for e in anew.events]
    # at ends it is of forces between a change and the next step, which Python sums up in another order
    np.testing.assert_array_max_ulp(once["tension"], anew["tension"], 4)
    for name in (
        "position",
        "steps/end_force_end",
        "curvature",
        "envelope/curvature_max",
        "envelope/contact_t_max",
        *(f"self_distance/{x}" for x in ("clearance", "s_a", "s_b", "time")),
    ):
        assert np.array_equal(once[name], anew[name], equal_nan=True), name


SHORT = [
    *TOUCHDOWN, "time.duration=4", "model={kind: adaptive, curvature_error: 0.05}", "output.every=0.1",
    "ends.end.motion={heave: {amplitude: 2.0, period: 6.0}, ramp: 1.0}",
]  # fmt: skip


@pytest.fixture(scope="module")
def short():
    return hybrid.run(hybrid.load_scene(EXAMPLES / "touchdown.yaml", SHORT))


def test_quantities_asked_for_by_name_are_those_of_every_step_where_cells_change() -> None:
    """With an output at every step, extremes over all steps are those of the outputs.

    A change of cells follows the output of a step, and what it leads to counts as well: forces then are off by 1e-6.
    """
    asked = "{angle: {kind: declination, end: end}, lay: {kind: layback, end: end, to: touchdown}, "
    asked += "gap: {kind: clearance, point: [150, 0, -50], diameter: 0.1}, up: {kind: vertical_force, end: end}}"
    sets = [*SHORT, "ends.end.motion.ramp=4.0", "time.step=0.1", f"output.quantities={asked}"]
    result = hybrid.run(hybrid.load_scene(EXAMPLES / "touchdown.yaml", sets))
    assert len({mesh.s.size for mesh in result.mesh}) > 3 and np.allclose(result["steps/t"], result.t[1:])
    for name in ("angle", "lay", "gap", "up"):
        values = result[name]
        found, rtol = result[f"extremes/{name}"], 1e-5 if name == "up" else 1e-8
        np.testing.assert_allclose(found, [values.min(), values.max()], rtol=rtol, err_msg=name)
        at = [values.argmin(), values.argmax()]
        np.testing.assert_allclose(result[f"extremes/t/{name}"], result.t[at], atol=1e-9, err_msg=name)


def test_what_is_held_after_a_change_is_what_binding_would_give(monkeypatch: pytest.MonkeyPatch) -> None:
    """After a change of cells the numbers of tables are put in their places; what Python then holds has these."""
    held = []

    def hold(self: Table, **values) -> None:
        binding._here.known.clear()  # numbers of tuples that were bound before
        anew = self.again(self.numbers.copy())
        anew._bound.clear()
        anew.bind(**values)
        np.testing.assert_array_equal(self.numbers, anew.numbers, err_msg=", ".join(values))
        held.append(set(values))
        holds(self, **values)

    holds = Table.hold
    monkeypatch.setattr(Table, "hold", hold)
    with hybrid.Simulation(hybrid.load_scene(EXAMPLES / "touchdown.yaml", [*SHORT, "dimension=2"])) as simulation:
        while simulation.t < 3.99:
            simulation.step()  # after each Python has the cells of now
    assert len(held) > 10 and {"line", "old", "new", "work", "books", "zones"} <= set().union(*held)


def test_a_run_seldom_returns_from_compiled_code(short: hybrid.Result, monkeypatch: pytest.MonkeyPatch) -> None:
    """Only where zones change, a step fails or buffers are full; with a return for every change the run is the same."""
    calls = calls_of(monkeypatch, NetworkSteps, "go")
    scene = hybrid.load_scene(EXAMPLES / "touchdown.yaml", SHORT)
    hybrid.run(scene)
    once = len(calls)
    monkeypatch.setattr(cell_changes, "cells_due", never_due)
    found = hybrid.run(scene)
    assert 2 * once < len(calls) - once, (once, len(calls))
    for name in ("position", "tension", "work/zones", "envelope/curvature_max"):
        np.testing.assert_array_equal(found[name], short[name], err_msg=name)


def test_cells_that_become_one_in_a_layer_do_not_kick_the_end_force(monkeypatch: pytest.MonkeyPatch) -> None:
    """After each step it is near to the cubic through the four beside it: within 0.3 % of its mean.

    Two cells of the clamp's layer that became one where the curvature doubles made it 1.6 %.  (The motion begins on the
    shortest cells, so that there are some to become one.)
    """

    def nowhere(*_: object) -> NoReturn:
        raise ComputationError(Outcome.NOT_CONVERGED, None, 0.0, "no equilibrium on longer cells")

    monkeypatch.setattr(zones_at_rest, "_on_planned_cells", nowhere)
    result = hybrid.run(
        bight()
        | {
            "model": {"kind": "adaptive", "curvature_error": 0.05}, "mesh": {"cells": 32},
            "time": {"duration": 22.5, "step": 0.1}, "output": {"every": 7.5, "points": 101, "errors": False},
        }
    )  # fmt: skip
    force = result["steps/end_force_end"][:]
    off = np.abs(np.convolve(force, np.array([-1.0, 4.0, -6.0, 4.0, -1.0]) / 6.0, "valid"))[80:]
    assert len({mesh.s.size for mesh in result.mesh}) > 1
    assert off.max() < 3e-3 * force.mean()


def whip(model, cells: int) -> hybrid.Result:
    """1000 m hanging from a point that moves aside in 1 s: the kink runs down and is the sharper the less tension."""
    section = {"length": 1000, "diameter": 0.05, "mass": 10, "axial_stiffness": 2e8, "bending_stiffness": 2e4}
    held = {"kind": "pinned", "position": [0, 0, 0], "motion": {"travel": {"by": [6.0, 0, 0], "over": 1.0}}}
    scene = cable_scene(
        section, held, "free", dimension=2, model=model, mesh=cells, time=(18.0, 0.02),
        output={"every": 0.5, "points": 2001, "errors": False}
    )  # fmt: skip
    return hybrid.run(scene)


@pytest.mark.slow
def test_cells_become_as_short_as_a_kink_that_gets_sharper() -> None:
    """A kink at a free end is three times as sharp as a layer at rest there.

    Held to 0.6 l0, curvature was off by 11 % of its largest and the end force by 0.93 % of its mean; 3000 rods are
    within 1 % and 0.08 % of 6000.
    """
    rods = whip("rod", 3000)
    found = whip({"kind": "adaptive", "curvature_error": 0.005, "force_rod": [[0, 1000]]}, 32)
    force, right = (x["steps/end_force_start"][:] for x in (found, rods))
    late = found["steps/t"][:] > 14.5
    assert np.abs(force - right)[late].max() < 0.005 * right.mean()
    assert np.abs(found.curvature - rods.curvature).max() < 0.035 * rods.curvature.max()
    cells = [mesh.s.size - 1 for mesh in found.mesh]
    assert np.mean(cells) < 400 and cells[0] == 32  # a straight line asks for none


def test_a_motion_begins_on_the_cells_of_its_equilibrium_and_keeps_its_rods(short: hybrid.Result) -> None:
    """Not on the shortest ones (1536 and, as catenary where it may be, 1221), with the curvature that is asked for.

    Rods are let go only where a hold time is given: without bending they cost little more than a catenary.
    """
    first = short.mesh[0]
    assert first.kinds.size < 130 and all(kind == "rod" for mesh in short.mesh for kind in mesh.kinds)
    assert not {"grow", "shrink", "split", "merge", "retry"} & {e.kind for e in short.events}
    rod = hybrid.static(hybrid.load_scene(EXAMPLES / "touchdown.yaml", [*SHORT, "model=rod", "mesh={cells: 1500}"]))
    assert np.abs(short.curvature[0] - rod.curvature[0]).max() < 0.05 * rod.curvature.max()
    assert np.abs(short.tension[0] - rod.tension[0]).max() < 1e-3 * rod.tension.max()


def test_kinds_and_cells_keep_the_share() -> None:
    """Where kinds follow as well, the field of curvature is within about what is asked, joints and pins included."""
    scene = [*TOUCHDOWN[:4], ZONES, "mesh={cells: 24}", "output.every=0.5"]
    found = hybrid.run(hybrid.load_scene(EXAMPLES / "touchdown.yaml", scene))
    rod = hybrid.run(
        hybrid.load_scene(EXAMPLES / "touchdown.yaml", [*scene[:4], scene[-1], "model=rod", "mesh={cells: 1200}"])
    )
    kinds = [set(mesh.kinds) for mesh in found.mesh]
    assert any("catenary" in kind for kind in kinds)
    assert np.abs(found.curvature - rod.curvature)[2:].max() < 0.055 * rod.curvature.max()


def test_a_change_of_cells_keeps_momentum_to_second_order(monkeypatch: pytest.MonkeyPatch) -> None:
    """In every change of a run, to 1e-3 of that of the line at its largest speed."""
    left, change = [], CellChanges.change

    def measured(self: CellChanges, *given) -> float:
        k, n, parity = self.side, self.cells, int(self._run.loop.counts.parity)
        line, state = self.line(k, n), self.state(k, parity, n)
        size, before = line.mass.sum() * np.linalg.norm(state.v, axis=1).max(), line.mass @ state.v
        booked = change(self, *given)
        line, state = self.line(self.side, self.cells), self.state(self.side, 0, self.cells)
        left.append(np.linalg.norm(line.mass @ state.v - before) / size)
        return booked

    monkeypatch.setattr(CellChanges, "change", measured)
    monkeypatch.setattr(cell_changes, "cells_due", never_due)
    hybrid.run(hybrid.load_scene(EXAMPLES / "touchdown.yaml", [*TOUCHDOWN, "time.duration=40"]))
    assert len(left) > 50 and 0.0 < np.median(left) < 1e-4 and max(left) < 1e-3, max(left)


@pytest.mark.parametrize(
    "asked, share", [("curvature", CURVATURE), ("bending_moment", MOMENT), ("line_tension", TENSION)]
)
def test_what_is_asked_along_the_line_is_a_share_of_the_rule(asked: str, share: int) -> None:
    """A quarter of it; a curvature error that is smaller stands."""
    scene = hybrid.load_scene(EXAMPLES / "touchdown.yaml", [f"accuracy={{{asked}: 4%}}", "model=adaptive"])
    assert shares_asked(one_line(scene), None) == {share: 0.01}
    assert shares_asked(one_line(scene), 0.01)[CURVATURE] == 0.01 and shares_asked(one_line(scene), 0.03)[share] == 0.01


def test_zones_of_an_older_checkpoint() -> None:
    """It had one largest curvature, or none, or fewer criteria; that it did not look at velocities is tested with them."""
    rest = {"true": np.ones(3), "idle_steps": np.zeros(4), "waves": np.zeros(4)}
    found = zoning_of_today({"manager": {"ratios": 1}, "following": rest | {"peak": 0.2}})
    assert found["following"] == rest and found["manager"]["largest"].tolist() == [0, 0, 0.2, 0]
    assert zoning_of_today({"manager": {"ratios": 1}})["following"] is None
    own = {"largest": np.ones(4)}
    assert zoning_of_today({"manager": own, "following": rest})["manager"]["largest"].tolist() == [1, 1, 1, 1]
    fewer = zoning_of_today({"manager": {x: np.ones((len(CRITERIA) - 2, 3)) for x in ("ratios", "seen")}})["manager"]
    assert all(np.sum(fewer[x], axis=1).tolist() == [3.0] * (len(CRITERIA) - 2) + [0.0] * 2 for x in ("ratios", "seen"))
    later = np.ones((len(CRITERIA) + 1, 3))  # of a later program, which is refused by its shape
    assert zoning_of_today({"manager": {"ratios": later}})["manager"]["ratios"] is later
    names = {"haste": "ramp_factor", "calm_since": "below_since", "calmed": "release_cause", "patience": "wait_factor"}
    assert (
        zoning_of_today({"manager": {x: x for x in names}})["manager"].items()
        >= {y: x for x, y in names.items()}.items()
    )


def test_new_cells_beside_a_clamp_leave_along_it() -> None:
    """An output at a change of cells shows the pull that the step has ended with: 54 % of the largest was between."""
    section = {"length": 60, "mass": 5.0, "diameter": 0.05, "axial_stiffness": 1e6, "bending_stiffness": 30.0,
               "drag": {"normal": 1.2}}  # fmt: skip
    heave = {"heave": {"amplitude": 1.0, "period": 4.0}, "ramp": 4}
    found = hybrid.run(cable_scene(
        section, pinned_at(0, 0, -22), clamped_at([38, 0, 0], [0.5, 0, 1], motion=heave), fluid={"density": 1025},
        seabed={"z": -22, "stiffness": 3e3, "damping": 200}, model={"kind": "adaptive", "curvature_error": 0.03},
        dimension=2, mesh=40, time=(3.2, 0.05), output=(0.05, 21)
    ))  # fmt: skip
    shown = np.linalg.norm(found["reaction_end"], axis=1)[1:]
    ended = np.interp(found.times[1:], found["steps/t"], found["steps/end_force_end"])
    assert np.abs(shown - ended).max() < 0.1 * ended.max()
