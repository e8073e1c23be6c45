"""The sea against closed forms and independent solutions (problems_sea): statics, laying, motion, friction, touchdown."""

from __future__ import annotations

import math

import numpy as np
import pytest
from problems import build, motion, order, poles
from problems_sea import (
    CURRENTS,
    DEPTH,
    LAYER_BED,
    LAYER_H,
    LAYER_PUBLISHED,
    LOADS,
    LOWER,
    MOORING,
    PILE,
    RHO,
    SINKERS,
    SPAN,
    SUNK,
    SWAY,
    UPPER,
    G,
    body_in_current,
    body_in_current_exact,
    cells_of,
    concentrated,
    dragged,
    drifting,
    dropped,
    everything,
    flexible_line,
    floating_buoy,
    floating_cable,
    grounded_catenary,
    heaving_body,
    height_when_wet,
    in_the_air,
    in_water,
    layer_exact,
    lift_off,
    loaded_span,
    loaded_span_exact,
    node_contact,
    on_a_slope,
    pile_force,
    resting_line,
    riding_body,
    s_tether,
    sinker,
    taut_pile,
    top_tension,
    touchdown,
    touchdown_errors,
    towed_line,
)

import hybrid
from hybrid.scene.read import one_line

# --- statics ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("axial_stiffness", [2e8, None], ids=["elastic", "inextensible"])
def test_touchdown_at_rest(axial_stiffness, report):
    """On a stiff bed (1e6 N/m2: it sinks 0.2 mm); 100 to 800 cells, no clean order: see the problem."""
    w = in_water(MOORING["mass"], MOORING["diameter"])
    H, lifted, top = grounded_catenary(DEPTH, 250.0, SPAN, w, axial_stiffness)
    if axial_stiffness:
        assert top == pytest.approx(31907.25, abs=0.05)
    error = []
    for n in (100, 200, 400, 800):
        result = hybrid.static(resting_line(n, 1e6, axial_stiffness))
        pull = result.reaction_end[-1]
        found = (np.linalg.norm(pull) / top - 1, pull[0] / H - 1, (result.grounded_length[-1] - 250 + lifted) / 250)
        error.append(np.abs(found))
    tension, level, grounded = np.array(error).T
    report(
        f"Touchdown at rest, {'elastic' if axial_stiffness else 'inextensible'}, 100 and 800 cells: top tension {top:.1f} N",
        "catenary and grounded part (Irvine)",
        f"tension {tension[0]:.1e}, {tension[-1]:.1e}; H {level[0]:.1e}, {level[-1]:.1e}; grounded length {grounded[0]:.1e} L",
        "discretisation: 5e-5 at 100 cells, 1e-5 at 800; grounded within a third of a cell",
    )
    assert max(tension[0], level[0]) <= 5e-5
    assert max(tension[-1], level[-1]) <= 1e-5
    assert grounded[0] <= 1.0 / 300


def test_touchdown_at_rest_on_a_soft_bed(report):
    """5e3 N/m2, the bed of the touchdown scene: as on a rigid bed that is 0.74 w/k = 26 mm deeper (problems_sea.SUNK).

    Left: the climb to the anchor, which is pinned on the bed and not in it: 2e-5.
    """
    w = in_water(MOORING["mass"], MOORING["diameter"])
    _, _, top = grounded_catenary(DEPTH + SUNK * w / 5e3, 250.0, SPAN, w, 2e8)
    error = top_tension(hybrid.static(resting_line(400, 5e3)))[-1] / top - 1
    report(
        f"Touchdown at rest on a soft bed: top tension {top:.1f} N", "catenary with a deeper bed",
        f"{error:+.1e}", "soft edge: 2e-5",
    )  # fmt: skip
    assert abs(error) <= 2e-5


@pytest.mark.parametrize("eps", LAYER_PUBLISHED)
def test_boundary_layer_at_touchdown(eps, report):
    """1 % of the published figures, 0.3 % of the boundary value problem solved here; the reaction is the concentrated
    one that is statically equal to the contact force (problems_sea.concentrated), on a bed with (EI/k)^(1/4) = lambda/10."""
    scene, w, k = lift_off(eps, 8)
    result = hybrid.static(scene)
    x, R = concentrated(node_contact(result, k, 0.5 * w / k), result.s, w)
    up = int(np.argmin(np.abs(result.s - x - 3.5 / eps)))
    z = float(result.position[-1, up, 2]) + w / k
    extra = result.s[up] - x - math.sqrt(z * z + 2 * z * LAYER_H / w)
    found = np.array([R / w, extra, result.curvature[-1].max() * LAYER_H / w])
    exact, published = np.array(layer_exact(eps)), np.array(LAYER_PUBLISHED[eps])
    assert np.abs(exact - published)[[0, 2]].max() <= 1e-4
    error = found / exact - 1
    report(
        f"Boundary layer at touchdown, eps = {eps}, cells of lambda/8: reaction, extra length, curvature",
        "rigid bed (published; solve_bvp)",
        f"{found[0]:.4f} {found[1]:.4f} {found[2]:.4f}: {', '.join(f'{100 * e:+.2f} %' for e in error)}",
        f"published: 1 %; discretisation and a bed of lambda/{LAYER_BED:g}: 0.3 %",
    )
    assert np.abs(error).max() <= 3e-3
    assert np.abs(found / published - 1)[[0, 2]].max() <= 1e-2
    assert abs(found[1] - published[1]) <= 1.2e-2  # the published length has its own far end; see layer_exact


@pytest.mark.parametrize("name", LOADS)
def test_point_load(name, report):
    """Two catenaries, at the nodes; the forces at both ends."""
    table, load = LOADS[name]
    error = []
    for n in (50, 100, 200):
        result = hybrid.static(loaded_span(n, table, np.linspace(0, 100, n + 1).tolist()))
        position, tension = loaded_span_exact(load, result.s)
        ends = [np.linalg.norm(result[f"reaction_{e}"][-1]) / tension[k] - 1 for e, k in (("start", 0), ("end", -1))]
        error.append((np.abs(result.position[-1] - position).max(), np.abs(ends).max()))
    p = [order(e) for e in np.array(error).T]
    report(
        f"A {name} on a span, 100 cells: shape, end forces", "two elastic catenaries",
        f"{error[1][0]:.1e} m, {error[1][1]:.1e}, order {p[0][1]:.2f}, {p[1][1]:.2f}", "discretisation: 3e-3 m, 1e-4, order 2.0 +- 0.1",
    )  # fmt: skip
    assert error[1][0] <= 3e-3
    assert error[1][1] <= 1e-4
    assert np.abs(np.array(p) - 2.0).max() <= 0.1


@pytest.mark.parametrize("name", LOADS)
def test_point_load_between_the_nodes(name, report):
    """Outputs in the middle of the cells on both sides of the load: second order everywhere (outputs/probes.py)."""
    table, load = LOADS[name]
    error = []
    for n in (50, 100, 200, 400):
        points = [40.0 - 50.0 / n, 40.0 + 50.0 / n]
        result = hybrid.static(loaded_span(n, table, points))
        error.append(np.abs(result.position[-1] - loaded_span_exact(load, result.s)[0]).max())
    p = order(error)
    report(
        f"A {name} on a span: shape in the middle of the cells beside it, 100 cells", "two elastic catenaries",
        f"{error[1]:.1e} m, order {', '.join(f'{x:.2f}' for x in p)}", "discretisation: 5e-3 m, order 2.0 +- 0.2",
    )  # fmt: skip
    assert error[1] <= 5e-3
    assert np.abs(p - 2.0).max() <= 0.2


@pytest.mark.parametrize("current", CURRENTS)
def test_s_tether(current, report):
    """With the sheared current a float with drag sits between the sections."""
    with_float = current == "sheared current"
    bodies = [
        (60.0, lambda z: np.array([0, 0, 120.0]) + 0.5 * RHO * 0.4 * np.linalg.norm(U := CURRENTS[current][1](z)) * U)
    ]
    error, exact = [], None
    for n in (65, 130, 260):
        result = hybrid.static(s_tether(n, current, with_float))
        if exact is None:
            exact = flexible_line(
                [LOWER, UPPER], np.array([0, 0, -60.0]), np.array([60, 0, -2.0]), CURRENTS[current][1],
                -result.reaction_start[-1], result.s, bodies if with_float else (),
            )  # fmt: skip
        r, F = exact
        pull = np.abs([result.reaction_start[-1] + F[0], result.reaction_end[-1] - F[-1]]).max() / np.linalg.norm(F[-1])
        on_nodes = np.arange(131) % (2 if n == 65 else 1) == 0
        error.append((np.abs(result.position[-1] - r)[on_nodes].max(), pull))
    p = [order(e) for e in np.array(error).T]
    out = np.abs(exact[0][:, 1]).max()
    report(
        f"S-tether of two sections in {current}{' with a float' if with_float else ''}, 130 cells: shape, end forces",
        "shooting (scipy, DOP853)",
        f"{error[1][0]:.1e} m ({out:.1f} m out of plane), {error[1][1]:.1e}, order {p[0][1]:.2f}, {p[1][1]:.2f}",
        "discretisation: 1.5e-2 m, 1e-4, order 2.0 +- 0.1",
    )
    assert error[1][0] <= 1.5e-2
    assert error[1][1] <= 1e-4
    assert np.abs(np.array(p) - 2.0).max() <= 0.1


def test_body_in_a_current(report):
    error = []
    for n in (50, 100, 200):
        result = hybrid.static(body_in_current(n))
        position, tension = body_in_current_exact(result.s)
        nodes = np.arange(101) % (2 if n == 50 else 1) == 0
        pull = np.linalg.norm(result.reaction_start[-1]) / tension[0] - 1
        error.append(np.abs(result.position[-1] - position)[nodes].max())
    p = order(error)
    report(
        "Body on a cable in a current, 100 cells: shape; end force at the top", "elastic catenary",
        f"{error[1]:.1e} m, order {p[0]:.2f}, {p[1]:.2f}; {abs(pull):.1e}", "discretisation: 1e-3 m, order 2.0 +- 0.1; round-off: 1e-9",
    )  # fmt: skip
    assert error[1] <= 1e-3
    assert np.abs(p - 2.0).max() <= 0.1
    assert abs(pull) <= 1e-9


@pytest.mark.parametrize("model", ["rod", "catenary"])
def test_floating_cable(model, report):
    worst = 0.0
    for part, surface in ((0.5, 0.0), (0.5, 7.3), (0.3, 0.0), (0.8, 7.3)):
        result = hybrid.static(floating_cable(part, surface, model))
        worst = max(worst, np.abs(result.position[-1][:, 2] - surface - height_when_wet(part, 0.1)).max())
    report(
        f"A {model} at the surface, 0.5, 0.3 and 0.8 as dense as water: height of its axis", "wetted part = density",
        f"{worst:.1e} m", "round-off: 1e-8 m",
    )  # fmt: skip
    assert worst <= 1e-8


@pytest.mark.parametrize("model", ["rod", "catenary"])
def test_floating_buoy(model, report):
    scene, height, pull = floating_buoy(model)
    result = hybrid.static(scene)
    off, tension = abs(result.position[-1, -1, 2] - height), abs(result.tension[-1, -1] / pull - 1)
    report(
        f"A buoy with a {model} below it: height, tension under it", "weights = buoyancy",
        f"{off:.1e} m, {tension:.1e}", "round-off and a dry end of wire: 1e-6 m, 3e-5",
    )  # fmt: skip
    assert off <= 1e-6
    assert tension <= 3e-5


@pytest.mark.parametrize("volume", [0.01, 0.0])
def test_no_water_in_the_air(volume, report):
    """A weight's volume is 0 where the scene says nothing of it: that it is dry must not hang on its volume."""
    aside = float(np.abs(hybrid.static(in_the_air(volume)).position[-1, :, 0]).max())
    report(
        f"A weight of {volume:g} m3 5 m over a current: pushed aside", "hangs straight down", f"{aside:.1e} m",
        "round-off: 1e-8 m",
    )  # fmt: skip
    assert aside <= 1e-8


# --- laying ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("by_ship", [False, True], ids=["in a current", "by a ship"])
@pytest.mark.parametrize("speed", [0.5, 1.5, 3.0])
def test_steady_laying(speed, by_ship, report):
    scene, angle, w = towed_line(speed, 20, by_ship)
    result = hybrid.run(scene) if by_ship else hybrid.static(scene)
    r = result.position[-1]
    whole = r[-1] - r[0]
    found = math.atan2(whole[2], whole[0])
    bow = np.linalg.norm(np.cross(r - r[0], whole / np.linalg.norm(whole)), axis=1).max()
    off, tension = found / angle - 1, np.linalg.norm(result.reaction_end[-1]) / (w * whole[2]) - 1
    report(
        f"Laying at {speed} m/s {'by a ship' if by_ship else 'in a current'}: critical angle {math.degrees(angle):.3f} deg, T = w x height",
        "Zajac 1957",
        f"{off:+.1e}, {tension:+.1e}, bow {bow:.1e} m of 100 m",
        "0.1 %; " + ("steady to 1e-5" if by_ship else "round-off: 1e-8"),
    )
    assert max(abs(off), abs(tension), bow / 100.0) <= (1e-5 if by_ship else 1e-8)


# --- motion ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("what", SINKERS)
def test_falling_in_water(what, report):
    scene, U, a, scale = sinker(what, 10, 20.0)
    first = next(motion(scene))[1].vd[0, 2] / -a - 1
    last = hybrid.run(scene).velocity[-1, 0, 2] / -U - 1
    error = []
    for n in (20, 40):
        result = hybrid.run(sinker(what, n, 2.0)[0])
        error.append(np.abs(result.velocity[:, 0, 2] / U + np.tanh(result.t / scale)).max())
    p = float(order(error)[0])
    report(
        f"Falling in water, {what}: first acceleration, terminal speed {U:.3f} m/s, U tanh(t/tau) at dt = tau/40",
        "weight/(mass + added); drag = weight",
        f"{abs(first):.1e}, {abs(last):.1e}, {error[1]:.1e} U, order {p:.2f}",
        "round-off: 1e-10, 1e-10; discretisation: 1e-4, order 2.0 +- 0.1",
    )
    assert max(abs(first), abs(last)) <= 1e-10
    assert error[1] <= 1e-4
    assert abs(p - 2.0) <= 0.1


@pytest.mark.parametrize("added_mass", [0.0, 300.0])
def test_heave_of_a_floating_body(added_mass, report):
    scene, omega, speed = heaving_body(added_mass)

    def kick(state, _model):
        state.v[:, 2] = speed

    z = np.array([state.r[0, 2] for _, state in motion(scene, kick)])
    error = poles(z, scene.time.step).imag / omega - 1
    report(
        f"Heave of a half-wet body, added mass {added_mass:g} kg: frequency", "sqrt(rho g Awp/(m + added mass))",
        f"{error:+.1e}", "a wire in the surface: 1e-5",
    )  # fmt: skip
    assert abs(error) <= 1e-5


@pytest.mark.parametrize("period", [10.0, 20.0])
def test_body_rides_long_waves(period, report):
    scene, part = riding_body(period)
    result = hybrid.run(scene)
    sea = build(one_line(scene)).sea
    eta = np.array([sea.elevation(r[0], r[1], t)[0] for r, t in zip(result.position[:, 0], result.t, strict=True)])
    late = result.t > 5 * period
    off = np.abs(result.position[:, 0, 2] - eta)[late].max() / np.abs(eta[late]).max()
    report(
        f"A body in waves of {period:g} s, (omega/omega_0)^2 = {part:.3f}: off the surface", "rides long waves",
        f"{off:.1e} of the amplitude", "1e-2",
    )  # fmt: skip
    assert off <= 1e-2


@pytest.mark.parametrize("kind", ["body", "rod"])
@pytest.mark.parametrize(("z", "depth"), [(-5.0, None), (-8.0, 20.0)], ids=["deep", "shallow"])
def test_neutral_body_moves_with_the_waves(kind, z, depth, report):
    scene, level, up = drifting(kind, z, depth)
    result = hybrid.run(scene)
    late = result.t > 4.5 * 8.0
    t, angle = result.t[late], 2 * math.pi / 8.0 * result.t[late]
    basis = np.column_stack([np.ones_like(t), t, np.cos(angle), np.sin(angle)])
    (_, x), (_, z1) = (
        np.hsplit(np.linalg.lstsq(basis, result.position[late, 0][:, k], rcond=None)[0], 2) for k in (0, 2)
    )
    # x = -level sin(-w t) and z = up cos(-w t) in a wave A cos(k x - w t)
    error = max(abs(x[0] / level), abs(x[1] / level - 1), abs(z1[0] / up - 1), abs(z1[1] / up))
    report(
        f"A {kind} as heavy as water in waves, {-z:g} m deep{f' of {depth:g} m' if depth else ''}: its orbit", "Airy",
        f"{error:.1e} of its half axes", "period/200 and k A = 6e-3: 2e-3",
    )  # fmt: skip
    assert error <= 2e-3


def test_morison_on_a_taut_line(report):
    """Waves and current on a line through the surface, against quadrature over its wetted height, in the last two periods."""
    error = []
    for n in (25, 50, 100):
        result = hybrid.run(taut_pile(n))
        late = result.t >= 3 * PILE["period"]
        exact = np.array([pile_force(t) for t in result.t[late]])
        held = -(result.reaction_start + result.reaction_end)[late, 0]
        error.append(np.abs(held - exact).max() / np.abs(exact).max())
    report(
        "Morison's force on a taut line through the surface, 25/50/100 cells", "quadrature",
        ", ".join(f"{e:.1e}" for e in error) + " of its largest", "discretisation: 1e-3 at 50 cells, falling",
    )  # fmt: skip
    assert error[1] <= 1e-3
    assert error[2] < error[1] < error[0]


# --- friction ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("sideways", [False, True], ids=["along", "sideways"])
@pytest.mark.parametrize("model", ["rod", "catenary"])
def test_dragged_over_the_bed(model, sideways, report):
    """mu w L for meshes from 5 to 200 cells, started from points and from equilibrium; the work of friction with it."""
    worst, works = 0.0, 0.0
    for cells in (5, 20, 200):
        for start in ("points", "equilibrium"):
            scene, exact = dragged(cells, model, sideways, start)
            result = hybrid.run(scene)
            late = result.t > (20.0 if sideways else 7.0)
            axis = 1 if sideways else 0
            pull = result.reaction_end[late, axis]
            if sideways:  # both ends pull, and mass damping takes its share: damping x mass x speed
                pull = pull + result.reaction_start[late, axis] - SWAY * 20.0 * 100.0 * 0.1
            worst = max(worst, np.abs(pull / exact - 1).max())
            way = 0.1 * np.diff(result.t[late][[0, -1]])[0]
            works = max(works, abs(np.diff(result.work["friction"][late][[0, -1]])[0] / (-exact * way) - 1))
    report(
        f"A {model} dragged {'sideways' if sideways else 'along'}, 5 to 200 cells, two starts: end force, work of friction",
        "mu w L",
        f"{worst:.1e}, {works:.1e}",
        "1 %; " + ("it bows: 2e-3" if sideways else "round-off: 1e-6"),
    )
    assert max(worst, works) <= (2e-3 if sideways else 1e-6)


@pytest.mark.slow  # a minute for all
@pytest.mark.parametrize("across", [False, True], ids=["down the slope", "across"])
@pytest.mark.parametrize("model", ["rod", "catenary"])
def test_on_a_slope(model, across, report):
    moved = slid = 0.0
    for cells in (5, 50):
        for part in (0.8, 0.99):
            for start in ("points", "equilibrium"):
                result = hybrid.run(on_a_slope(part, cells, model, across, start, 100.0)[0])
                moved = max(moved, np.linalg.norm(result.position - result.position[0], axis=2).max())
        scene, a = on_a_slope(1.2, cells, model, across, "points", 10.0)
        speed = np.linalg.norm(hybrid.run(scene).velocity[-1], axis=1)
        slid = max(slid, np.abs(speed / (a * 10.0) - 1).max())
    report(
        f"A {model} on a slope, {'across' if across else 'up and down'}: way in 100 s below the friction angle; acceleration above",
        "stays; g (sin a - mu cos a)",
        f"{moved:.1e} m; {slid:.1e}",
        "1 mm; round-off: 1e-9",
    )
    assert moved <= 1e-3
    assert slid <= 1e-9


@pytest.mark.parametrize(("stiffness", "damping"), [(2e4, 1e3), (1e5, 5e3)])
def test_dropped_on_the_bed(stiffness, damping, report):
    """It stays down, and the motion gains no energy from a blow that is over within a step.

    The ledger cannot follow such a blow: the force at the end of the step times the way through it is up to twice
    the energy that was there (mass times change of velocity over the step, times velocity times the step).
    """
    result = hybrid.run(dropped(stiffness, damping, 0.01))
    z, fallen = result.position[:, 1, 2], 10.0 * 5.0 * G * 0.5
    hit = int(np.argmax(z < 0.0))
    mechanical = sum(result.energy[name] for name in ("kinetic", "potential", "contact"))
    highest, gain = z[hit:].max(), mechanical[hit:].max() / fallen
    made = result.work["scheme"].max() / fallen
    report(
        f"Dropped from 0.5 m on a bed of {stiffness:g} N/m2, dt = 10 ms: height afterwards, energy left, ledger off",
        "overdamped: it stays down",
        f"{highest:.3f} m, {100 * gain:.0f} %, {100 * made:.0f} % of the fall",
        "below 0.1 m; 100 %; 200 %",
    )
    assert highest <= 0.1
    assert gain <= 1.0
    assert made <= 2.0


# --- touchdown in motion -------------------------------------------------------------------------------

SIXTY = cells_of(catenary=[(60.0, 10), (50.0, 30), (140.0, 20)])
MIXED = [{"catenary": 70.0, "cells": 5}, {"rod": 35.0, "cells": 14}, {"catenary": 145.0, "cells": 14}]
RUNS = {
    # cells of 10 m in the suspended part of the last are off by their sag: 0.2 % in the mean, and in the static tension
    "100 catenary cells": (cells_of(catenary=[(250.0, 100)]), 0.1, 1e-3),
    "60 catenary cells, half of them at touchdown": (SIXTY, 0.1, 1e-3),
    "100 rod cells": (cells_of(rod=[(250.0, 100)]), 0.1, 1e-3),
    "33 cells: catenary, rod, catenary": (MIXED, 0.1, 2e-3),
}


@pytest.mark.parametrize("name", RUNS)
def test_touchdown_in_motion(name, report):
    zones, step, mean = RUNS[name]
    bending = any("rod" in z for z in zones)
    error = touchdown_errors(hybrid.run(touchdown(zones, step, bending=bending)))
    report(
        f"Touchdown, heave of 2 m in 8 s, {name}, dt = {step}: mean, peak, minimum over three periods; static",
        "MoorDyn with 800 segments, CableDyn with 400 elements",
        ", ".join(f"{100 * e:+.2f} %" for e in error.values()),
        f"{100 * mean:g} %, 0.3 %, 1 %; {100 * mean:g} %",
    )
    assert abs(error["mean"]) <= mean
    assert abs(error["peak"]) <= 3e-3
    assert abs(error["minimum"]) <= 1e-2
    assert abs(error["static"]) <= mean


@pytest.mark.long
@pytest.mark.parametrize("amplitude", [0.25, 2.0])
def test_touchdown_converges(amplitude, report):
    """Top tension against 800 cells, and against dt = 1/80 s, root mean square over its standard deviation, from 16 s on.

    Gentle heave: about order 2 in both (touchdown moves the third derivative: 1.5 to 3 is accepted).  Heave of 2 m:
    the line is laid faster than waves run along it, and the mesh rings until its cells are 1.25 m: bounds only.
    """

    def signal(cells, step):
        result = hybrid.run(touchdown(cells_of(catenary=[(250.0, cells)]), step, amplitude, 32.0, 0.2))
        return top_tension(result)[result.t > 16.0]

    def away(found, reference):
        return float(np.sqrt(np.mean((found - reference) ** 2)) / reference.std())

    fine = signal(800, 0.05)
    mesh = [away(signal(n, 0.05), fine) for n in (50, 100, 200, 400)]
    short = signal(200, 0.0125)
    time = [away(signal(200, dt), short) for dt in (0.2, 0.1, 0.05)]
    p, q = order(mesh), order(time)
    report(
        f"Touchdown, heave of {amplitude} m: top tension with 50/100/200/400 cells; with dt = 0.2/0.1/0.05", "self-convergence",
        f"{', '.join(f'{100 * e:.2g}' for e in mesh)} % (order {', '.join(f'{x:.1f}' for x in p)}); "
        f"{', '.join(f'{100 * e:.2g}' for e in time)} % (order {', '.join(f'{x:.1f}' for x in q)})",
        "order 1.5 to 3, 1.5 to 2.5" if amplitude < 1 else "4 %, 3 %, 0.2 %, 0.02 %; 1 %, 0.5 %, 0.5 %",
    )  # fmt: skip
    if amplitude < 1:
        assert 1.5 <= p.min() <= p.max() <= 3.0
        assert 1.5 <= q.min() <= q.max() <= 2.5
    else:
        assert np.all(np.array(mesh) <= [0.04, 0.03, 2e-3, 2e-4])
        assert np.all(np.array(time) <= [0.01, 5e-3, 5e-3])


# --- the same said in other ways -----------------------------------------------------------------------

TELLINGS = {
    "turned by 73 deg": {"turn": 73.0},
    "turned by 180 deg": {"turn": 180.0},
    "1 km away": {"away": 1000.0},
    "from the other end": {"swapped": True},
    "in four sections": {"split": True},
}


@pytest.mark.parametrize("friction", [False, True], ids=["smooth", "rough"])
@pytest.mark.parametrize("kind", ["catenary", "rod", "hybrid"])
def test_the_same_sea_described_differently(kind, friction, report):
    """Round-off: 2e-7 of length and tension, as in tests/test_equivalence.py; 1 km away has 1e4 roundings of 1 km."""
    base = hybrid.run(everything(kind, friction)[0])
    assert base.grounded_length.min() > 50.0
    worst = {}
    for name, telling in TELLINGS.items():
        scene, R, shift = everything(kind, friction, **telling)
        result = hybrid.run(scene)
        along = slice(None, None, -1) if "swapped" in telling else slice(None)
        position = np.abs(np.einsum("ij,tsj->tsi", R, base.position[:, along]) + shift - result.position).max() / 160.0
        (_, before), (_, now) = base.both_sides("tension"), result.both_sides("tension")
        tension = np.abs(before[:, along] - now).max() / base.tension.max()
        worst[name] = max(position, 0.1 * tension)
    report(
        f"A {kind} in a sea of everything{' with friction' if friction else ''}, described in five ways", "equivalence",
        ", ".join(f"{name} {x:.0e}" for name, x in worst.items()), "round-off: 2e-7",
    )  # fmt: skip
    assert max(worst.values()) <= 2e-7


# --- energy ----------------------------------------------------------------------------------------------

LEDGERS = {
    "touchdown": lambda dt: touchdown(cells_of(catenary=[(250.0, 50)]), dt, duration=24.0, every=0.4),
    "touchdown with friction, hybrid": lambda dt: touchdown(
        [{"catenary": 70.0, "cells": 14}, {"rod": 35.0, "cells": 28}, {"catenary": 145.0, "cells": 29}], dt,
        duration=24.0, every=0.4, bending=True,
        seabed={"z": -DEPTH, "stiffness": 5e3, "damping": 5e2, "friction": 0.5},
    ),
    "sea of everything, rod": lambda dt: everything("rod", False, step=dt, duration=16.0)[0],
    "sea of everything with friction, rod": lambda dt: everything("rod", True, step=dt, duration=16.0)[0],
}  # fmt: skip


@pytest.mark.parametrize("name", LEDGERS)
def test_energy_ledger_by_the_sea(name, report):
    """Change of energies = sum of the works, up to what the scheme takes or gives: order 2, over two halvings of the step.

    The sea of everything shakes its line harder (the bed is hit from cell to cell): half the steps.
    """
    left, scale, works = [], 0.0, {}
    steps = (0.1, 0.05, 0.025) if "touchdown" in name else (0.05, 0.025, 0.0125)
    for dt in steps:
        works = hybrid.run(LEDGERS[name](dt)).work
        scale = max(np.abs(works[x]).max() for x in ("end", "drag"))
        left.append(np.abs(works["scheme"]).max() / scale)
    p = order(left)
    assert works["contact"][-1] < 0.0
    assert works["friction"][-1] <= 0.0
    report(
        f"Energy ledger, {name}: what no work accounts for, dt = {'/'.join(map(str, steps))}", "change of energy = work",
        f"{left[0]:.1e}, {left[1]:.1e}, {left[2]:.1e} of {scale:.2g} J, order {p[0]:.2f}, {p[1]:.2f}",
        "discretisation: 1e-3 at the longest, 1e-4 at the shortest, order 2.0 +- 0.5",
    )  # fmt: skip
    assert left[0] <= 1e-3
    assert left[2] <= 1e-4
    assert abs(p.mean() - 2.0) <= 0.5
