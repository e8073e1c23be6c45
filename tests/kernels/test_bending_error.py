"""The model error: what neglecting bending shifts a cable by (docs/theory.md, 14)."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from test_jacobian import CA, CV, WITHOUT_OBSTACLES, ZONES, N, assembled, random_case

import hybrid
from hybrid.kernels.algebra.block_elimination import KEPT, ROW
from hybrid.kernels.algebra.kept_factors import solve_again
from hybrid.kernels.run.entry import assembly, workspace
from hybrid.kernels.state.report import REPORT_SIZE, ROTARY, SEABED, STIFFNESS_DAMPING
from hybrid.kernels.state.state import no_sea
from hybrid.kernels.watch.bending_error import FINITE, FURTHEST, History, right_hand_side
from hybrid.kernels.watch.neglected_moments import Bending, neglected_moments, tabulate_chords
from hybrid.model.build import build
from hybrid.model.material import full_bending
from hybrid.model.mesh import Zone
from hybrid.model.network import build_system
from hybrid.scene.short_form import network_of
from hybrid.simulation.bending_correction import Correction
from hybrid.simulation.equilibrium import equilibrium_of
from hybrid.solve.stepper import Stepper

# --- the second right-hand side ----------------------------------------------------------------


@pytest.mark.parametrize("name", ZONES)
@pytest.mark.parametrize("held", [(0, 0), (1, 1), (1, 0)])
def test_kept_factors_solve_any_right_hand_side(name, held):
    """Against a dense solve of the assembled rows.  Round-off: 1e-9 of the largest, at condition numbers near 1e4."""
    line, sea, ends, st = random_case(3, ZONES[name], 2047, held)
    u = np.zeros_like(st.r)
    J, _ = assembled(line, sea, ends, st, u)
    work = workspace(N, keep=True)
    assembly(line, sea, ends, st, CV, CA, work)
    b = np.random.default_rng(8).normal(size=(N + 1, 5))
    b[0, 0] = 0.0  # there is no cell before the start
    b[:-1, 4] *= line.spin
    b[-1, 4] = 0.0
    for k, node in ((0, 0), (1, N)):
        if held[k]:
            b[node, 1:4] = 0.0
    x = np.zeros((N + 1, 5))
    assert solve_again(work.X, work.W, b, x)
    expected = np.linalg.solve(J, b.ravel()).reshape(N + 1, 5)
    np.testing.assert_allclose(x, expected, rtol=0, atol=1e-9 * np.abs(expected).max())


def test_keeping_factors_changes_nothing():
    """Bit for bit: what is kept is a copy."""
    line, sea, ends, st = random_case(5, ZONES["three"], 2047)
    found = []
    for keep in (False, True):
        work = workspace(N, keep)
        assembly(line, sea, ends, st, CV, CA, work)
        found.append((work.X[: (N + 1) * 45].copy(), work.report.copy()))
    np.testing.assert_array_equal(found[0][0], found[1][0])
    np.testing.assert_array_equal(found[0][1], found[1][1])


# --- history -----------------------------------------------------------------------------------


def history(line, sea, ends, st, q):
    """Right-hand side (N+1, 5) that history alone makes: of cv q and ca q in the rates."""
    chords = np.zeros((N, 5))
    tabulate_chords(st.e, chords)
    nothing, b, out = np.zeros((N + 1, 3)), np.zeros((N + 1, 5)), np.zeros((N + 1, 4))
    zero = np.zeros((N + 1, 4))
    past = History(CV * q, CA * q, zero, zero, nothing, out, np.zeros(REPORT_SIZE))
    right_hand_side(line, sea, ends, chords, st, nothing, nothing, True, past, b)
    return b


def rate_rows(line, sea, ends, st, q):
    """The same from the matrix: (J(cv, ca) - J(0, 0)) q, which is what the rates make of it."""
    u = np.zeros_like(st.r)
    J = assembled(line, sea, ends, st, u)[0] - assembled(line, sea, ends, st, u, 0.0, 0.0)[0]
    return (J @ np.column_stack([np.zeros(N + 1), q]).ravel()).reshape(N + 1, 5)


@pytest.mark.long
@pytest.mark.parametrize("bits", WITHOUT_OBSTACLES)
@pytest.mark.parametrize("seed", range(3))
def test_history_of_a_catenary_is_the_matrix_own(bits, seed):
    """Every force's own rates, to round-off: a force that `rates` has forgotten would show."""
    line, sea, ends, st = random_case(seed, ZONES["catenary"], bits)
    q = np.random.default_rng(seed).normal(size=(N + 1, 4))
    q[:, 3] = 0.0
    expected = -rate_rows(line, sea, ends, st, q)
    np.testing.assert_allclose(
        history(line, sea, ends, st, q), expected, rtol=0, atol=1e-11 * max(np.abs(expected).max(), 1.0)
    )


@pytest.mark.parametrize("bits", [STIFFNESS_DAMPING, ROTARY, STIFFNESS_DAMPING | ROTARY])
def test_history_of_a_straight_rod_is_the_matrix_own(bits):
    """Rods damp and turn to first order in their bend: a straight one at rest to round-off."""
    line, sea, ends, st = random_case(1, ZONES["rod"], bits)
    axis, across = np.array([0.6, 0.0, 0.8]), np.array([0.8, 0.0, -0.6])
    st.e[:] = line.h[:, None] * axis
    st.r[1:] = np.cumsum(st.e, axis=0)
    st.a1[:] = across
    frame = np.column_stack([across, np.cross(axis, across), axis]).ravel()
    line.k0[:] = 0.0
    line.kb[:, 1] = line.kb[:, 0]
    ends = ends._replace(frame=np.array([frame, frame]), spin=np.zeros((2, 3)))
    for x in (st.v, st.vd, st.w, st.wd):
        x[:] = 0.0
    q = np.random.default_rng(2).normal(size=(N + 1, 4))
    q[-1, 3] = 0.0
    expected = -rate_rows(line, sea, ends, st, q)
    np.testing.assert_allclose(history(line, sea, ends, st, q), expected, rtol=0, atol=1e-11 * np.abs(expected).max())


# --- the moment that is left out ---------------------------------------------------------------


def chain(cells, angle=0.1, EI=2.0, T=50.0, tangent=(0, 0), turn=None):
    """A catenary along x with a kink in its middle; its moments dM about y, over s."""
    length = 10.0
    turn = turn or [(cells // 2, angle)]
    s = np.linspace(0.0, length, cells + 1)
    h = np.diff(s)
    angles = np.zeros(cells)
    for cell, by in turn:
        angles[cell:] += by
    e = h[:, None] * np.column_stack([np.cos(angles), np.zeros(cells), np.sin(angles)])
    what = hybrid.validate_scene(
        {
            "environment": {"gravity": 0.0},
            "cable": {"sections": [{"length": length, "mass": 1.0, "bending_stiffness": EI}]},
            "ends": {
                "start": {"kind": "clamped", "position": [0, 0, 0], "tangent": [1, 0, 0]},
                "end": {"kind": "free", "force": [T, 0, 0]},
            },
            "initial": {"kind": "straight", "direction": [1, 0, 0]},
            "model": "catenary",
            "mesh": {"cells": cells},
            "time": {"duration": 1, "step": 0.1},
        }
    )
    model = build(what)
    ki, floor = full_bending(model.cable, model.line.s, model.line.h, model.tension_scale)
    chords, work = np.zeros((cells, 5)), np.zeros((cells + 1, 4))
    tabulate_chords(e, chords)
    dM, M = np.zeros((2, cells + 1, 3))
    kinks = np.array([tangent[0], *np.zeros(cells - 1), tangent[1]], np.int8)
    kinks[[cell for cell, _ in turn if cell > 0]] = 1
    bending = Bending(1.0 / ki, kinks, np.array(tangent, np.int8), floor)
    neglected_moments(model.line, model.ends.at(0.0), bending, chords, chords, np.full(cells, T), 0.0, work, dM, M)
    np.testing.assert_array_equal(dM, M)  # a catenary has none of it
    return s, dM[:, 1]


@pytest.mark.long
@pytest.mark.parametrize("cells", [10, 50, 200, 800])
def test_moment_at_a_kink_at_any_length_of_cells(cells):
    """EI alpha / (2 lambda) of the boundary layers on both sides, of cells of lambda/16 to 5 lambda; beside it exp(-s)."""
    EI, T, angle = 2.0, 50.0, 0.02
    lam = np.sqrt(EI / T)
    s, M = chain(cells, angle, EI, T)
    exact = -EI * 2.0 * np.tan(0.5 * angle) / (2.0 * lam) * np.exp(-np.abs(s - 5.0) / lam)
    assert M[cells // 2] == pytest.approx(exact[cells // 2], rel=1e-9)
    if cells == 800:
        assert np.abs(M - exact).max() <= 1e-3 * np.abs(exact).max()


@pytest.mark.parametrize("cells", [10, 60, 600])
def test_moment_at_a_clamp_is_that_of_its_boundary_layer(cells):
    """sqrt(EI T) times the misfit of the clamp, at any length of cells."""
    EI, T, angle = 2.0, 50.0, 0.02
    _, M = chain(cells, EI=EI, T=T, tangent=(1, 0), turn=[(0, angle)])
    exact = -np.sqrt(EI * T) * 2.0 * np.tan(0.5 * angle)
    assert M[0] == pytest.approx(exact, rel=1e-6)
    if cells == 600:
        assert M[60] == pytest.approx(exact * np.exp(-1.0 / np.sqrt(EI / T)), rel=1e-2)


# --- the error against the truth ---------------------------------------------------------------


def span(EI: float, model: Any, **more: Any) -> hybrid.Scene:
    """A span of 20 m that sags by 1.5 m, its end driven; errors on."""
    return hybrid.validate_scene(
        {
            "cable": {
                "sections": [
                    {"length": 20.3, "mass": 1.0, "axial_stiffness": 1e6, "bending_stiffness": EI, "damping": 0.3}
                ]
            },
            "ends": {
                "start": {"kind": "pinned", "position": [0, 0, 0]},
                "end": {
                    "kind": "pinned",
                    "position": [20, 0, 0],
                    "motion": {"heave": {"amplitude": 0.3, "period": 2.5}, "ramp": 3},
                },
            },
            "initial": "equilibrium",
            "model": model,
            "mesh": {"cells": 80},
            "time": {"duration": 5.0, "step": 0.02},
            "output": {"every": 0.1, "errors": True},
        }
        | more
    )


def distances(low: hybrid.Scene, high: hybrid.Scene) -> tuple[np.ndarray, np.ndarray]:
    """Largest distance over s at every output, true and estimated (nt,)."""
    a, b = hybrid.run(low), hybrid.run(high)
    true = np.linalg.norm(b["position"] - a["position"], axis=2).max(axis=1)
    return true, a["errors/model/position"].max(axis=1)


@pytest.mark.long
def test_estimate_is_the_distance_to_the_rod():
    """In proportion to EI; of curvature, whose layers at the pins results have, little is left, and no less is said."""
    found = []
    for EI in (2.0, 4.0):
        rod, catenary = hybrid.run(span(EI, "rod")), hybrid.run(span(EI, "catenary"))
        true = np.linalg.norm(rod["position"] - catenary["position"], axis=2).max(axis=1)
        estimate = catenary["errors/model/position"].max(axis=1)
        effectivity = estimate / true
        assert np.median(effectivity) == pytest.approx(1.0, abs=0.02)  # 0.999 when written
        assert effectivity.min() > 0.9 and effectivity.max() < 1.15
        found.append(np.median(true))
        for name in ("tension", "bending_moment"):
            was = np.abs(rod[name] - (0.0 if name == "bending_moment" else catenary[name])).max(axis=1)
            assert np.median(catenary[f"errors/model/{name}"].max(axis=1) / was) == pytest.approx(1.0, abs=0.05), name
    assert 1.8 < found[1] / found[0] < 2.1
    fine, plain = (hybrid.run(span(4.0, model, mesh={"cells": 2560})) for model in ("rod", "catenary"))
    left = np.median(np.abs(fine["curvature"] - plain["curvature"]).max(axis=1))
    assert left < 2e-3 * fine["curvature"].max()
    assert 0.7 < np.median(plain["errors/model/curvature"].max(axis=1)) / left < 3.0


@pytest.mark.long
def test_pull_of_the_ends_is_estimated():
    """The force that holds an end, as its magnitude; within a tenth in the median (0.99 when written)."""
    a, b = hybrid.run(span(4.0, "catenary")), hybrid.run(span(4.0, "rod"))
    for end in ("start", "end"):
        true = np.abs(np.diff([np.linalg.norm(x[f"reaction_{end}"], axis=1) for x in (a, b)], axis=0)[0])
        clear = true > 0.1 * true.max()
        ratio = a[f"errors/model/end_force_{end}"][clear] / true[clear]
        assert np.median(ratio) == pytest.approx(1.0, abs=0.1)


def suspension(model: Any) -> hybrid.Scene:
    """examples/02 at rest and for half a second."""
    what = hybrid.load_scene("examples/02_suspension.yaml").model_dump(exclude_none=True)
    what |= {"model": model, "initial": {"kind": "equilibrium"}, "time": {"duration": 0.1, "step": 0.01}}
    what["output"] = {"every": 0.1, "errors": True}
    return hybrid.validate_scene(what)


@pytest.mark.long
@pytest.mark.parametrize("joint", [0.2, 0.4, 1.0, 1.5, 1.7])
def test_joints_in_the_middle_of_a_sag_know_what_they_cost(joint):
    """The suspension, lambda a tenth of its length (shared/validation: 1.9 to 8 cm): 0.95 to 1.15 of the truth."""
    cells = round(50 * joint)
    zones = [{"catenary": joint, "cells": cells}, {"rod": 2.0 - joint, "cells": 100 - cells}]
    whole = hybrid.run(suspension({"kind": "zones", "zones": [{"rod": 2.0, "cells": 100}]}))
    a = hybrid.run(suspension({"kind": "zones", "zones": zones}))
    true = np.linalg.norm(whole["position"] - a["position"], axis=2)[0].max()
    assert 0.95 < a["errors/model/position"][0].max() / true < 1.15
    moment = np.abs(whole["bending_moment"] - a["bending_moment"])[0].max()
    assert a["errors/model/bending_moment"][0].max() / moment == pytest.approx(1.0, abs=0.05)


def twisted(model: Any, torsion: float = 40.0) -> hybrid.Scene:
    """A sag between two clamps along it, one turned by 0.4 turns against the other."""
    a, slope = 2.0 * np.pi * 0.4, 0.55
    return hybrid.validate_scene(
        {
            "cable": {
                "sections": [
                    {
                        "length": 21.0, "mass": 1.0, "axial_stiffness": 1e6, "bending_stiffness": 0.5,
                        "torsional_stiffness": torsion, "damping": 0.5,
                    }
                ]
            },
            "ends": {
                "start": {"kind": "clamped", "position": [0, 0, 0], "tangent": [1, 0, -slope], "normal": [0, 0, 1]},
                "end": {
                    "kind": "clamped",
                    "position": [20, 0, 0],
                    "tangent": [1, 0, slope],
                    "normal": [0, -float(np.sin(a)), float(np.cos(a))],
                    "motion": {"heave": {"amplitude": 0.2, "period": 3.0}, "ramp": 3},
                },
            },
            "initial": "equilibrium",
            "model": model,
            "mesh": {"cells": 400},
            "time": {"duration": 4.0, "step": 0.02},
            "output": {"every": 0.2, "errors": True},
        }
    )  # fmt: skip


def test_torque_leaves_the_plane_as_a_twisted_rod_does():
    """A torque Mt pushes across by Mt kappa b: y is its alone.  A fifth at most is missing (0.14 when written):
    what the slopes at the clamps change by is not in it."""
    rest = {"time": None, "output": {"points": 401}}
    plain, rod = (hybrid.validate_scene(twisted(x).model_dump(exclude_none=True) | rest) for x in ("catenary", "rod"))
    network, model = network_of(plain), build(plain)
    state = equilibrium_of(network, build_system(network), np.inf).state.lines[0]
    correction = Correction(model)
    correction.begin(model.ends.at(np.inf), state, at_rest=True)
    out = hybrid.static(rod).position[0, :, 1]
    assert np.abs(out).max() > 5e-4  # m: it is there
    assert np.abs(state.r[:, 1]).max() < 1e-9
    assert np.abs(out - correction.corrector.position[:, 1]).max() < 0.2 * np.abs(out).max()


def test_one_way_only():
    """Bit for bit the same run with errors and without."""
    with_, without = span(4.0, "catenary"), span(4.0, "catenary", output={"every": 0.1})
    a, b = hybrid.run(with_), hybrid.run(without)
    for name in ("position", "velocity", "tension", "reaction_end"):
        np.testing.assert_array_equal(a[name], b[name])
    assert not [name for name in b.names if name.startswith("errors/model")]


# --- where there is none -----------------------------------------------------------------------


@pytest.mark.parametrize(
    ("model", "bending", "why"),
    [
        ("rod", 2.0, "rod everywhere"),
        ({"kind": "zones", "zones": [{"rod": 10.0}, {"rod": 10.3}]}, 2.0, "rod everywhere"),
        ("catenary", None, "no bending stiffness"),
        ("catenary", [2.0, 3.0], "two directions"),
    ],
)
def test_nothing_left_out_is_absent_and_says_why(model, bending, why):
    what = span(2.0, "catenary").model_dump(exclude_none=True)
    section = what["cable"]["sections"][0] | {"bending_stiffness": bending}
    if isinstance(bending, list):
        section["torsional_stiffness"] = 1.0
    what["cable"]["sections"] = [{k: x for k, x in section.items() if x is not None}]
    what["model"], what["time"] = model, {"duration": 0.1, "step": 0.02}
    scene = hybrid.validate_scene(what)
    assert not build(scene).follows_error
    entry = next(x for x in hybrid.plan(scene).contents if x.what.startswith("model error"))
    assert not entry.on and why in entry.why
    assert not [name for name in hybrid.run(scene).names if name.startswith("errors/model")]


def test_a_stepper_keeps_factors_only_when_asked():
    line, _, _, _ = random_case(1, ZONES["catenary"], 0)
    blocks = line.s.size
    assert Stepper(line, 1.0, 1.0).work.X.size == blocks * ROW
    assert Stepper(line, 1.0, 1.0, keep=True).work.X.size == blocks * (ROW + KEPT)


def test_error_beyond_a_tenth_of_the_length_is_clipped_and_said():
    """A rod of EI/(w L^3) = 30 stays nearly straight where a catenary falls: no linear estimate can know that."""
    what = span(2e4, "catenary", time={"duration": 2.0, "step": 0.02}, output={"every": 0.1, "errors": True})
    data = what.model_dump(exclude_none=True)
    data["initial"] = {"kind": "straight", "direction": [1, 0, 0]}
    data["ends"]["end"] = {"kind": "free"}
    data["model"] = {"kind": "catenary", "slack": "warn"}
    result = hybrid.run(hybrid.validate_scene(data))
    assert any(e.kind == "model error not estimated" for e in result.events)
    assert 0.0 < result["errors/model/position"].max() < 0.15 * 20.3  # between nodes a cubic overshoots


@pytest.mark.parametrize("first", ["rod", "catenary"])
def test_where_an_error_is_not_known_is_the_catenary_that_leaves_bending_out(first):
    """The node that is shifted most is the free end: of a rod all the time, it may be, which leaves out nothing."""
    what = span(2e4, "catenary", time={"duration": 2.0, "step": 0.02}, output={"every": 0.1, "errors": True})
    data = what.model_dump(exclude_none=True)
    half, other = 0.5 * what.length, "catenary" if first == "rod" else "rod"
    data["initial"] = {"kind": "straight", "direction": [1, 0, 0]}
    data["ends"]["end"] = {"kind": "free"}
    zones = [{first: half, "cells": 20}, {other: half, "cells": 20}]
    data["model"] = {"kind": "zones", "slack": "warn", "zones": zones}
    del data["mesh"]
    with hybrid.run(hybrid.validate_scene(data)) as result:
        (event,) = [e for e in result.events if e.kind == "model error not estimated"]
        (bent,) = [zone for zone in result.zones[0] if zone.kind == "catenary"]
    assert (event.s_a, event.s_b) == (bent.s_a, bent.s_b)
    assert f"from s = {bent.s_a:.4g} to {bent.s_b:.4g} m" in event.text and "at s = 20.3 m" in event.text


def test_an_error_that_begins_anew_says_that_its_figure_lacks_what_was_before():
    model = build(span(2.0, "catenary", time={"duration": 0.1, "step": 0.02}))
    correction = Correction(model)
    correction.corrector.arrays.found[[FURTHEST, FINITE]] = -1, 0
    rod, catenary = Zone("rod", 0.0, 5.0), Zone("catenary", 5.0, model.length)
    s_a, s_b, text = correction.unknown([rod, catenary])
    assert (s_a, s_b) == (5.0, model.length) and "has only what is left out from now on" in text
    assert correction.unknown([rod])[:2] == (0.0, 5.0)


def test_no_sea_is_needed():
    line, _, ends, st = random_case(2, ZONES["catenary"], 0)
    q = np.ones((N + 1, 4))
    assert not line.bits & SEABED
    assert np.isfinite(history(line, no_sea(N), ends, st, q)).all()


@pytest.mark.parametrize("cells", [25, 100, 400])
def test_model_error_beside_a_float(cells):
    """A float in the middle of a catenary, cells of 2 to 35 lambda: the distance to a rod is 0.06 to 0.07 m."""
    scene = {
        "environment": {"fluid": {"density": 1025}},
        "cable": {
            "sections": [
                {"length": 100, "mass": 1, "diameter": 0.025, "axial_stiffness": 1e6, "bending_stiffness": 2}
            ],
            "attachments": [{"kind": "float", "at": 50, "buoyancy": 200}],
        },
        "ends": {
            "start": {"kind": "pinned", "position": [0, 0, -10]}, "end": {"kind": "pinned", "position": [90, 0, -10]},
        },
        "initial": "equilibrium", "mesh": {"cells": cells}, "model": "catenary",
        "output": {"errors": True, "points": 201},
    }  # fmt: skip
    rod = hybrid.static(scene | {"model": "rod", "mesh": {"cells": 3000}, "output": {"points": 201}})
    line = hybrid.static(scene)
    true = np.linalg.norm(line.position[0] - rod.position[0], axis=1)
    assert 0.7 < line.errors["total/position"][0].max() / true.max() < 1.5
    if cells > 25:
        assert line.errors["total/position"][0].argmax() == true.argmax()
