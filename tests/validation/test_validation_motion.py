"""Large motion: what falls, sinks, flies and whips, against closed forms, momenta, energy and refined runs."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
from problems import (
    SPAGHETTI_OFF,
    X,
    Z,
    build,
    folded_chain,
    folded_chain_speed,
    folded_chain_time,
    momenta,
    motion,
    order,
    shaken_line,
    sinking_rod,
    sinking_rod_exact,
    solid_angle,
    spaghetti,
    turned_by,
    turned_ring,
    twist_of,
    whip,
    writhe,
)

import hybrid
from hybrid.scene.read import one_line

CASES = {
    "broadside": (False, 3.0, X),
    "end-on": (True, 3.0, -Z),
    "rising broadside": (False, 0.1, X),
    "rising end-on": (True, 0.1, Z),
}


def energy(result: hybrid.Result) -> np.ndarray:
    return sum(result.energy[name] for name in result.energy)


@pytest.mark.parametrize("case", CASES)
def test_terminal_velocity(case, report):
    end_on, mass, direction = CASES[case]
    w, moved, terminal = sinking_rod_exact(end_on, mass)
    tau = moved * terminal / w
    velocity = hybrid.run(sinking_rod(direction, mass, 20 * tau, tau / 5)).velocity[-1]
    error = np.abs(velocity / terminal + Z).max()
    report(
        f"Terminal velocity, {case}",
        "drag = weight in water",
        f"{error:.1e} of {terminal:.4f} m/s",
        "round-off: 1e-12",
    )
    assert error <= 1e-12


@pytest.mark.parametrize("case", CASES)
def test_speed_on_the_way_to_terminal_velocity(case, report):
    """U tanh(t/tau), with added mass and drag: order 2 in time."""
    end_on, mass, direction = CASES[case]
    w, moved, terminal = sinking_rod_exact(end_on, mass)
    tau = moved * terminal / w
    error = []
    for n in (10, 20, 40):
        result = hybrid.run(sinking_rod(direction, mass, 2 * tau, tau / n, every=tau / 10))
        error.append(np.abs(result.velocity[:, 1, 2] / terminal + np.tanh(result.t / tau)).max())
    p = order(error)
    report(
        f"Speed of a rod let go in water, {case}, dt = tau/20",
        "U tanh(t/tau)",
        f"{error[1]:.1e} U, order {p[0]:.2f}, {p[1]:.2f}",
        "discretisation: 1e-3 U, order 2.0 +- 0.1",
    )
    assert error[1] <= 1e-3
    assert np.abs(p - 2.0).max() <= 0.1


@pytest.mark.parametrize("case", CASES)
def test_added_mass(case, report):
    """Without drag the acceleration is weight in water/(m + added mass), at once and for good."""
    end_on, mass, direction = CASES[case]
    w, moved, _ = sinking_rod_exact(end_on, mass)
    scene = sinking_rod(direction, mass, 1.0, 0.1, drag=False)
    first = next(motion(scene))[1].vd
    last = hybrid.run(scene).velocity[-1]
    error = [np.abs(a / (w / moved) + Z).max() for a in (first, last)]
    report(
        f"Added mass, {case}: acceleration at t = 0, and mean over 1 s",
        "w/(m + added)",
        f"{error[0]:.1e}, {error[1]:.1e}",
        "round-off: 1e-12",
    )
    assert max(error) <= 1e-12


def test_added_mass_of_a_slanting_rod(report):
    """At 45 degrees: the weight is parted along and across, each with its own mass; the rod does not turn."""
    along, across = np.array([1, 0, -1]) / math.sqrt(2), np.array([1, 0, 1]) / math.sqrt(2)
    w, normal, _ = sinking_rod_exact(False, 3.0)
    _, tangential, _ = sinking_rod_exact(True, 3.0)
    exact = -w * ((Z @ along) / tangential * along + (Z @ across) / normal * across)
    velocity = hybrid.run(sinking_rod(along, 3.0, 1.0, 0.1, drag=False)).velocity[-1]
    error = np.abs(velocity - exact).max() / np.linalg.norm(exact)
    report("Added mass, slanting at 45 degrees", "closed form", f"{error:.1e}", "round-off: 1e-12")
    assert error <= 1e-12


@pytest.mark.slow  # 20 s
def test_folded_chain(report):
    """Time to 0.9 L and v^2 at half the way.  Steps of 0.25 ms resolve the fold's passage of a cell to 0.8 L."""
    step, wanted = 2.5e-4, folded_chain_time(0.9)
    assert folded_chain_time(1 - 1e-12) == pytest.approx(0.8472 * math.sqrt(2 / 9.81), rel=1e-4)
    times, squares = [], []
    for n in (81, 161, 321):
        result = hybrid.run(folded_chain(n, step, math.ceil((wanted + 0.01) / step) * step))
        fallen, speed = -result.position[:, 1, 2], -result.velocity[:, 1, 2]
        assert fallen[-1] > 0.9
        times.append(np.interp(0.9, fallen, result.t) / wanted - 1)
        squares.append((np.interp(0.5, fallen, speed) / folded_chain_speed(0.5)) ** 2 - 1)
    p = np.array([order(times), order(squares)])
    report(
        "Folded chain: time to fall 0.9 L, v^2 at 0.5 L; 81/161/321 cells",
        "v^2 = g x (2L - x)/(L - x)",
        ", ".join(f"{100 * a:+.2f} %" for a in times) + "; " + ", ".join(f"{100 * a:+.2f} %" for a in squares),
        "discretisation: 1 % and 2.5 % at 81 cells, order 0.7 to 1.8",
    )
    assert abs(times[0]) <= 1e-2
    assert abs(squares[0]) <= 2.5e-2
    assert p.min() >= 0.7
    assert p.max() <= 1.8


SCALE = 0.5 * 0.1 * 9.81  # J, m g L/2 of the whip


def test_whip_keeps_its_energy(report):
    """rho_inf = 1 to t = 0.2 s: the drift is that of the scheme, of order 2."""
    drift = []
    for step in (0.002, 0.001, 0.0005):
        e = energy(hybrid.run(whip(25, step, 0.2, 1.0, 0.02)))
        drift.append(np.abs(e - e[0]).max() / SCALE)
    p = order(drift)
    report(
        "Whip, rho_inf = 1: drift of the energy until 0.2 s, dt = 1 ms",
        "no work is done",
        f"{drift[1]:.1e} m g L/2, order {p[0]:.2f}, {p[1]:.2f}",
        "discretisation: 1e-5, order 2.0 +- 0.1",
    )
    assert drift[1] <= 1e-5
    assert np.abs(p - 2.0).max() <= 0.1


def test_whip_position(report):
    """Shape at 0.4 s, just before the whip: order 2 in dt, and near that of 200 cells.

    5e-3 m at 50 cells: the rod turns over a radius of sqrt(EI/T) = 3 mm there, and a cell is 20 mm.
    """
    at = [hybrid.run(whip(50, step, 0.4, 0.5, 0.4)).position[-1] for step in (0.002, 0.001, 0.0005, 0.00025)]
    change = [np.abs(a - b).max() for a, b in pairwise(at)]
    p = order(change)
    fine = hybrid.run(whip(200, 0.0005, 0.4, 0.5, 0.4)).position[-1]
    apart = [np.abs(hybrid.run(whip(n, 0.0005, 0.4, 0.5, 0.4)).position[-1] - fine).max() for n in (50, 100)]
    report(
        "Whip: position at 0.4 s, 50 and 100 cells",
        "own run with 200 cells",
        f"{apart[0]:.1e}, {apart[1]:.1e} m; order in dt {p[0]:.2f}, {p[1]:.2f}",
        "discretisation: 5e-3 m at 50 cells, less than half of it at 100; order in dt 2.0 +- 0.2",
    )
    assert apart[0] <= 5e-3
    assert apart[1] <= 0.5 * apart[0]
    assert np.abs(p - 2.0).max() <= 0.2


@pytest.mark.parametrize(("cells", "step"), [(25, 0.001), (50, 0.002), (100, 0.001)])
def test_whip_goes_through(cells, step, report):
    """rho_inf = 0.5, through the whip at 0.45 s to 1 s."""
    result = hybrid.run(whip(cells, step, 1.0, 0.5, 0.01))
    e = energy(result)
    loss, worst = (e[0] - e[-1]) / SCALE, np.abs(e - e[0]).max() / SCALE
    report(
        f"Whip, {cells} cells, dt = {1e3 * step:g} ms: energy lost until 1 s (largest on the way)",
        "no work is done",
        f"{100 * loss:.3f} % ({100 * worst:.3f} %)",
        "1 %",
    )
    assert result.status == "complete"
    assert 0.0 <= loss <= 1e-2
    assert worst <= 1e-2


def flight(cells: int, step: float) -> tuple[hybrid.Result, np.ndarray, np.ndarray]:
    """A run of the flying spaghetti with its linear and angular momenta at every step."""
    scene = spaghetti(cells, step)
    model = build(one_line(scene))
    result = hybrid.run(scene)
    pairs = []
    for r, v in zip(result.position, result.velocity, strict=True):
        pairs.append(momenta(model, model.start._replace(r=r, v=v, e=np.diff(r, axis=0))))
    linear, angular = zip(*pairs, strict=True)
    return result, np.array(linear), np.array(angular)[:, 1]


def test_flying_spaghetti_momenta(report):
    """After the load, 20 cells: linear momentum 8 x 2.5 to round-off, angular momentum constant to order 2.

    1e-4 of the angular momentum at the end of the following 2.5 s with dt = 0.0125, at every moment with half of it.
    """
    drift, last, balance = [], [], []
    for step in (0.025, 0.0125, 0.00625):
        result, linear, angular = flight(20, step)
        off = int(np.argmin(np.abs(result.t - SPAGHETTI_OFF)))
        momentum = np.abs(linear[off:] / 20.0 - X).max()
        drift.append(np.abs(angular[off:] / angular[off] - 1).max())
        last.append(abs(angular[-1] / angular[off] - 1))
        torque = 80.0 + 8.0 * result.position[: off + 1, 0, 2]  # of the moment, and of the force about the origin
        impulse = float(np.sum(0.5 * (torque[1:] + torque[:-1]))) * step
        balance.append((angular[off] - angular[0]) / impulse - 1)
        report(
            f"Flying spaghetti, dt = {step}: momenta over 2.5 s after the load",
            "impulse 20 N s; conservation",
            f"linear {momentum:.1e}; angular {drift[-1]:.1e} at most, {last[-1]:.1e} at the end",
            "round-off: 1e-9; 1e-4 at the end for 0.0125, always for 0.00625",
        )
        assert momentum <= 1e-9
    p = np.concatenate([order(drift), order(balance)])
    report(
        "Flying spaghetti: order of the angular drift and of the angular impulse",
        "scheme",
        ", ".join(f"{x:.2f}" for x in p),
        "order 2.0 +- 0.2",
    )
    assert last[1] <= 1e-4
    assert drift[2] <= 1e-4
    assert np.abs(p - 2.0).max() <= 0.2


def test_flying_spaghetti_self_convergence(report):
    at = [hybrid.run(spaghetti(20, step, every=5.0)).position[-1] for step in (0.05, 0.025, 0.0125, 0.00625)]
    change = [np.abs(a - b).max() for a, b in pairwise(at)]
    p = order(change)
    report(
        "Flying spaghetti: change of the position at 5 s when dt is halved",
        "self-convergence",
        ", ".join(f"{x:.1e}" for x in change) + f" m, order {p[0]:.2f}, {p[1]:.2f}",
        "order 2.0 +- 0.1",
    )
    assert np.abs(p - 2.0).max() <= 0.1


# --- What every run must keep: lengths, frames, the energy ledger, and the link of a twisted rod ---


@pytest.mark.long
@pytest.mark.parametrize("damping", [0.0, 0.01], ids=["undamped", "damped strain"])
@pytest.mark.parametrize("kind", ["catenary", "rod", "hybrid"])
def test_length_and_frames_over_many_steps(kind, damping, report):
    """10^4 steps of a cable shaken in three dimensions."""
    scene = shaken_line(kind, 0.01, 100.0, damping, 0.5)
    spin = build(one_line(scene)).line.spin == 1
    longest = worst = 0.0
    steps = -1
    for _, state in motion(scene):
        steps += 1
        length = np.linalg.norm(np.diff(state.r, axis=0), axis=1)
        longest = max(longest, abs(length.sum() / scene.length - 1))
        if spin.any():
            d = (state.e / np.linalg.norm(state.e, axis=1)[:, None])[spin]
            a1 = state.a1[spin]
            off = max(np.abs((a1 * a1).sum(axis=1) - 1).max(), np.abs((a1 * d).sum(axis=1)).max())
            worst = max(worst, float(off))
    assert steps == 10_000
    with_ = f" with stiffness damping {damping} s" if damping else ""
    assert worst <= 1e-12
    if spin.any() and not damping:
        what = f"Frames of a {kind}: unit and normal to the chord, 10^4 steps"
        report(what, "orthonormal", f"{worst:.1e}", "1e-12")
    report(f"Length of an inextensible {kind}{with_}, 10^4 steps", "compatibility", f"{longest:.1e} L", "1e-9 L")
    assert longest <= 1e-9


@pytest.mark.parametrize("damping", [0.0, 0.01], ids=["undamped", "damped strain"])
@pytest.mark.parametrize("kind", ["elastic", "catenary", "rod", "hybrid"])
def test_energy_ledger(kind, damping, report):
    """Ends that move and turn, drag in a current, added mass, damping: what is left is of order 2."""
    left, scale = [], 0.0
    for step in (0.02, 0.01, 0.005):
        work = hybrid.run(shaken_line(kind, step, 6.0, damping)).work
        scale = np.abs(work["end"]).max()
        left.append(np.abs(work["scheme"]).max() / scale)
    p = order(left)
    report(
        f"Energy ledger, {kind}{', damped strain' * (damping > 0)}: what no work accounts for, dt = 10 ms",
        "change of energy = work",
        f"{left[1]:.1e} of the work of the end ({scale:.0f} J), order {p[0]:.2f}, {p[1]:.2f}",
        "discretisation: 1e-4, order 2.0 +- 0.1",
    )
    assert left[1] <= 1e-4
    assert np.abs(p - 2.0).max() <= 0.1


@pytest.mark.slow  # 20 s
def test_link_is_twist_and_writhe(report):
    """A ring whose end is turned twice: it buckles, and passes through itself (there is no contact; link changes by 2).

    1e-7: Gauss's integral takes the arcsine of numbers near one, which keeps half the digits.
    """
    scene = turned_ring(40, 0.002)
    model = build(one_line(scene))

    def lean(state, _model):
        s = model.line.s
        state.v[:, 1] = 1e-2 * np.sin(4 * math.pi * s) * np.sin(math.pi * s) ** 2

    worst = largest = 0.0
    for k, (t, state) in enumerate(motion(scene, lean)):
        if k % 40 == 0:
            ends = model.ends.at_time(t)
            d = state.e / np.linalg.norm(state.e, axis=1)[:, None]
            corner = solid_angle(d[-1], ends.frame[0].reshape(3, 3)[:, 2], d[0]) / (2 * math.pi)
            w = writhe(state.r[:-1])
            link = twist_of(state, ends) + w + corner - turned_by(t) / (2 * math.pi)
            worst, largest = max(worst, abs(link - 2 * round(link / 2))), max(largest, abs(w))
    report(
        "Link = twist + writhe of a ring turned 2.1 times",
        "Calugareanu, White",
        f"{worst:.1e}, writhe up to {largest:.2f}",
        "round-off: 1e-7, and a writhe of at least 0.3",
    )
    assert worst <= 1e-7
    assert largest >= 0.3
