"""Lengths that waves and hinged ends ask of cells that follow: against errors measured, over time, and through a resume."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from adapt_cases import along, followed
from test_cell_errors import pinned, scene

import hybrid
from hybrid.kernels.machine.compile import kernel
from hybrid.kernels.mesh import cell_errors as e
from hybrid.kernels.mesh.cell_errors import TAU, WAVES, know_new_nodes
from hybrid.kernels.mesh.zone_step import read, watch_waves
from hybrid.simulation.restart import zoning_of_today
from hybrid.store.integrity import Tree
from tests.simulation.bits import resumed

EXAMPLES = Path(__file__).parents[2] / "examples"
SHARE = 0.05


@kernel
def watch(table):
    """A step of the clock's DT has led to the state `new`."""
    job = read(table)
    watch_waves(job.line, job.new, job.zones, job.zones.clock.dt)


@kernel
def know(table):
    job = read(table)
    know_new_nodes(job.line, job.zones)


@kernel
def longest_behind_hinge(part):
    return e.longest_behind_hinge(part)


def watched(velocity, fineness=1.0):
    """A straight line of 10 m with a velocity across it, m/s of s: its manager, table, layout and state."""
    return followed(along((1.0, 0.0, 0.0)), SHARE, velocity=velocity, fineness=fineness, tolerance=1e-3)


def after(manager, table, time, steps=1):
    """Squares of the lengths that waves allow, m^2, after so long."""
    manager.zones.clock.dt = time / steps
    for _ in range(steps):
        watch(table.numbers)
    return manager.zones.waves.copy()


def hump(s):
    """A wave of 1 m/s, 1.5 m long, that has come as far as the middle."""
    return np.cos(2.0 * np.pi * (s - 5.0) / 1.5) * np.exp(-(((s - 5.0) / 1.0) ** 2))


def planned(velocity, **more):
    """Nodes that waves ask for, when they have been there for long."""
    found = watched(velocity, **more)
    after(found.manager, found.table, 50.0, 50)
    return found.planned.nodes


# --- e_h against errors measured ----------------------------------------------------------------------


@pytest.mark.parametrize("towed", [0.0, 30.0])
def test_lengths_interpolate_velocities_within_their_share(towed: float) -> None:
    """Cells that are as long as W: a straight line between two nodes is off by the share of the spread, and no more.

    A velocity that all have changes nothing.
    """
    manager, table, zones, _ = watched(lambda s: towed + hump(s))
    s, W = zones.nodes[1:-1], np.sqrt(after(manager, table, 50.0)[1:-1])
    nodes = [0.0]
    while nodes[-1] < 10.0:
        h = 4.0
        while h > W[(s >= nodes[-1]) & (s <= nodes[-1] + h)].min(initial=4.0):
            h *= 0.99
        nodes.append(nodes[-1] + h)
    fine = np.linspace(0.0, 10.0, 100_001)
    error = np.abs(np.interp(fine, nodes, hump(np.array(nodes))) - hump(fine)).max()
    assert 0.7 < error / (WAVES * SHARE * np.ptp(hump(fine))) < 1.05


def test_cells_are_as_long_as_waves_allow() -> None:
    """Halves of halves: no longer than W, and a quarter of it at least, but for those beside."""
    manager, table, zones, _ = watched(hump)
    W = np.sqrt(after(manager, table, 50.0))
    nodes, s = planned(hump), zones.nodes
    h = np.diff(nodes)
    least = np.array([W[1:-1][(s[1:-1] >= a) & (s[1:-1] <= a + x)].min() for a, x in zip(nodes, h, strict=False)])
    assert (h <= least).all() and (h / least)[least < 1.2 * least.min()].min() > 0.25
    assert h.max() >= 0.625 and nodes.size < 90


def test_finer_cells_are_shorter_in_waves_too() -> None:
    coarse, fine = planned(hump), planned(hump, fineness=2.0)
    assert set(coarse) <= set(fine) and np.diff(coarse).min() == 2.0 * np.diff(fine).min()


def test_lengths_that_waves_ask_for_have_bounds() -> None:
    """No shorter than 1.2 sqrt(EI/T), whatever shakes; three base cells of 1.25 m at rest."""
    shaken = watched(lambda s: (-1.0) ** np.arange(s.size))
    assert after(shaken.manager, shaken.table, 50.0, 50)[1:-1].min() == pytest.approx(1.2**2 * 2.0 / 1e4)
    still = watched(lambda s: 0.0 * s)
    assert after(still.manager, still.table, 50.0, 50)[1:-1] == pytest.approx((3 * 1.25) ** 2)


def test_a_line_at_rest_or_nearly_so_has_base_cells() -> None:
    """Vibrations far below what the tolerance allows in a ramp time are no waves to show."""
    for size in (0.0, 1e-8):
        assert planned(lambda s, size=size: size * hump(s)).size == 9
    assert planned(lambda s: 1e-3 * hump(s)).size > 20


@pytest.mark.parametrize("size", [4.0, 1.0, 0.25])
def test_velocities_below_a_twentieth_of_the_tolerance_in_a_ramp_time_count_as_that(size: float) -> None:
    """Cells are as long as for faster waves of that form down to there, and longer below as velocities bend less."""
    clock = watched(hump).manager.zones.clock
    slowest = 0.05 * clock.tolerance / clock.ramp_time / np.ptp(hump(np.linspace(0.0, 10.0, 1001)))
    fast, slow = (watched(lambda s, x=x: x * hump(s)) for x in (1.0, size * slowest))
    squares = [after(x.manager, x.table, 50.0)[1:-1].min() for x in (fast, slow)]
    assert squares[1] / squares[0] == pytest.approx(max(1.0 / size, 1.0), rel=0.01)


@pytest.mark.parametrize("cells", [30, 60, 120, 400])
def test_layer_behind_a_hinge(cells: int) -> None:
    """A heavy taut line with even cells: between its pinned end and the next node curvature is off by the part of that

    beside the layer that asks for such cells.
    """
    EI = 2e4
    rod, fine = (hybrid.static(scene("rod", n, EI, pinned(99.9))) for n in (cells, 4000))
    s, h = fine.s, 100.0 / cells
    l0 = np.sqrt(EI / np.interp(0.5, s, fine.tension[-1]))
    beside = np.interp(6.0 * l0, s, fine.curvature[-1])
    near = s <= h
    error = np.abs(rod.curvature[-1] - fine.curvature[-1])[near].max() / beside
    assert longest_behind_hinge(0.8 * error) < h / l0 < longest_behind_hinge(min(1.6 * error, 0.999)), (h / l0, error)


# --- over time ------------------------------------------------------------------------------------


def test_lengths_follow_waves_in_time_whatever_the_steps_are() -> None:
    """A wave that has come shortens cells by e in a time constant, in one step, in ten, or in steps that grow."""
    ways = []
    for steps in ((0.25,), (0.025,) * 10, tuple(0.25 * 2.0**k / 31.0 for k in range(5))):
        manager, table, _, state = watched(np.zeros_like)
        rest = after(manager, table, 1.0)
        state.v[:, 2] = hump(np.linspace(0.0, 10.0, state.v.shape[0]))
        for dt in steps:
            now = after(manager, table, dt)
        ways.append(now)
        assert now[256] == pytest.approx(rest[256] * np.exp(-2.0 * 0.25 / TAU), rel=1e-12)  # the ramp time is 1 s
    for other in ways[1:]:
        np.testing.assert_allclose(other, ways[0], rtol=1e-12)


def test_what_a_change_of_cells_leaves_in_the_velocities_is_no_wave() -> None:
    """It lasts a few steps, however large it is: cells become shorter by what these are of the time constant."""
    manager, table, _, state = watched(np.zeros_like)
    rest = after(manager, table, 1.0)
    state.v[200:203, 2] = 5.0, -5.0, 5.0
    found = after(manager, table, 0.02, 4)
    assert found[201] == pytest.approx(rest[201] * np.exp(-2.0 * 0.02 / TAU), rel=1e-12)
    state.v[:] = 0.0
    np.testing.assert_allclose(after(manager, table, 0.02, 4), rest, rtol=1e-12)


def test_new_nodes_begin_between_those_beside_them() -> None:
    manager, table, _, _ = watched(np.zeros_like)
    waves = manager.zones.waves
    waves[:] = np.linspace(4.0, 8.0, waves.size)
    whole = waves.copy()
    waves[3:200] = waves[300] = 0.0
    know(table.numbers)
    np.testing.assert_allclose(waves, whole, rtol=1e-14)
    waves[:5] = waves[-2:] = 0.0
    know(table.numbers)
    assert (waves[:5] == whole[5]).all() and (waves[-2:] == whole[-3]).all()


# --- laying -----------------------------------------------------------------------------------------


def laying(duration: float, model: object, cells: int) -> dict[str, Any]:
    what = hybrid.load_scene(EXAMPLES / "laying.yaml").model_dump(exclude_unset=True, mode="json")
    output = {"errors": False, "points": 801, "every": 0.5}
    time = what["time"] | {"duration": duration}
    return what | {"model": model, "mesh": {"cells": cells}, "output": output, "time": time}


FOLLOWING = {"kind": "adaptive", "curvature_error": SHARE}


def test_laying_keeps_its_share_at_the_held_end_and_its_pull() -> None:
    """Waves that the ship's heave sends into base cells of 25 m, and their layer at the ship.

    Without a look at velocities the pull was off by 2 % of its mean, and the curvature by all that there is at the ship.
    """
    truth, found = hybrid.run(laying(20.0, "rod", 1600)), hybrid.run(laying(20.0, FOLLOWING, 32))
    off = np.abs(found.curvature - truth.curvature)[2:].max() / truth.curvature.max()
    pull = np.abs(found.tension - truth.tension)[2:, -1].max() / truth.tension[:, -1].mean()
    assert off < SHARE and pull < 0.004, (off, pull)
    assert truth.curvature[:, -40:].max() > SHARE * truth.curvature.max()
    h = np.diff(found.mesh[-1].s)
    assert h[-1] < 2.0 and h[60:].max() == 25.0 and h.size < 140


@pytest.mark.parametrize("cut, until", [(2.5, 5.0), (6.5, 8.0)])
def test_laying_is_continued_to_the_last_bit(cut: float, until: float, tmp_path: Path) -> None:
    """While cells become shorter for waves; and while the ship's heave turns round, when it has been faster of late."""
    whole = resumed(laying(until, FOLLOWING, 32), tmp_path, cut)
    at_ship = [int((whole.mesh[k].s > 650.0).sum()) for k in (0, 5, 10)]
    assert at_ship[0] < at_ship[1] < at_ship[2]  # at rest, after 2.5 s, after 5 s


def test_waves_are_not_known_in_an_older_checkpoint() -> None:
    older: Tree = {"manager": {"ratios": 1}, "following": {"true": np.ones(3), "calm": np.zeros(4)}}
    found = zoning_of_today(older)
    assert found["manager"]["fastest"] == 0.0 and not found["following"]["waves"].any()
    own = {"true": np.ones(3), "idle_steps": np.zeros(4), "waves": np.ones(4)}
    assert zoning_of_today({"manager": {"fastest": 2.0}, "following": own})["following"]["waves"].all()


@pytest.mark.parametrize("part", [0.01, 0.1, 0.3, 0.5])
def test_the_length_behind_a_hinge_is_right_to_a_sixth_on_the_safe_side(part: float) -> None:
    x = np.linspace(1e-3, 10.0, 100_001)
    m = -np.expm1(-x) / x
    exact = x[np.searchsorted(1.0 - m + m * np.log(m), part)]
    assert 0.84 < longest_behind_hinge(part) / exact <= 1.0
