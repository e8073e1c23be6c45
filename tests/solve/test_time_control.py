"""Steps that change: tension stays clean and of second order, the controller keeps to its tolerance, steps land."""

from itertools import pairwise

import numpy as np
import pytest
from problems import StepsOfLine, at_rest

import hybrid
from hybrid.errors import Outcome
from hybrid.kernels.machine.compile import kernel
from hybrid.kernels.state import books as b
from hybrid.kernels.state.state import no_moves
from hybrid.kernels.step.step_control import (
    FIRST,
    LEAST,
    MOST,
    REFUSED,
    before_fixed,
    end_of_try,
    halve,
    note_past,
    passes,
    radius_of_step,
    step_end,
    weights,
)
from hybrid.model.build import build
from hybrid.scene.read import one_line
from tests.scenes import cable_scene, pinned_at

DURATION = 2.0  # s
REFERENCE = 64 * 16  # steps
# Lengths of steps in turn: nothing changes; by two, often; two longer ones among three short ones.
PATTERNS = {
    "equal": [1, 1, 1, 1], "halved and doubled": [2, 1, 0.5, 0.5], "two for one": [1.2, 1.2, 0.6, 0.5, 0.5],
    "one halved": [1, 1, 1, 0.5, 0.5],
}  # fmt: skip
FAR = [1, 1, 1, *[1 / 16] * 16]


def motion(model, rho, steps, carried=True):
    """Times, positions and tensions at the end of every step; steps: s; carried: whether the scheme is told of them."""
    what = scene(model, 0.01, rho)
    made = build(one_line(what))
    stepper, old = StepsOfLine(made), at_rest(made).state.lines[0]
    stepper.begin(old, made.ends.acceleration(0.0, 1e-5))
    new = old.copy()
    t, before, radius, out = 0.0, 0.0, rho, {}
    for dt in steps:
        t += dt
        taken = stepper.step(t, old, new, dt, rho, *((before, radius) if carried else (dt, rho)))
        assert taken.outcome == Outcome.OK, f"{taken.outcome} at t = {t}"
        old, new, before, radius = new, old, dt, taken.rho
        out[round(t, 9)] = (old.r.copy(), old.T.copy())
    return out


def errors(model, rho, pattern, carried, reference):
    """Largest errors of position (m) and of tension (as a part) for three lengths of steps."""
    whole = max(np.abs(T).max() for _, T in reference.values())
    found = []
    for n in (16, 32, 64):
        unit = DURATION / (4 * n)
        at = motion(model, rho, np.tile(np.array(pattern) * unit, n), carried)
        common = [t for t in at if t in reference]
        assert len(common) >= n
        found.append(
            [
                max(np.abs(at[t][0] - reference[t][0]).max() for t in common),
                max(np.abs(at[t][1] - reference[t][1]).max() for t in common) / whole,
            ]
        )
    return np.array(found)


@pytest.mark.long
@pytest.mark.parametrize("rho", [0.5, 0.8])
@pytest.mark.parametrize("model", ["rod", "catenary"])
def test_tension_is_clean_when_steps_change(model, rho):
    """Order 2 with every pattern; without weights that know the step before, tension is of first order and far worse."""
    reference = motion(model, rho, np.full(4 * REFERENCE, DURATION / (4 * REFERENCE)))
    equal = errors(model, rho, PATTERNS["equal"], True, reference)
    for name, pattern in PATTERNS.items():
        found = errors(model, rho, pattern, True, reference)
        order = np.log2(found[:-1] / found[1:])
        plain = errors(model, rho, pattern, False, reference)
        print(
            f"{model}, rho_inf {rho}, {name}: tension off by {found[-1, 1]:.1e} (order {order[:, 1].round(2)}), "
            f"equal steps {equal[-1, 1]:.1e}, plain weights {plain[-1, 1]:.1e}; position {found[-1, 0]:.1e} m"
        )
        assert order[-1, 0] == pytest.approx(2.0, abs=0.2)
        assert 1.7 < order[-1, 1] < 2.6
        assert found[-1, 1] < 20.0 * equal[-1, 1]
        if name != "equal":
            assert plain[-1, 1] > 5.0 * found[-1, 1]


@pytest.mark.long
@pytest.mark.parametrize("rho", [0.5, 0.8])
def test_tension_is_cleaner_where_a_step_is_cut_far(rho):
    """Of first order, as with plain weights, but three times less: a cut by more than two is weighted as one by two."""
    reference = motion("rod", rho, np.full(4 * REFERENCE, DURATION / (4 * REFERENCE)))
    found, plain = (errors("rod", rho, FAR, carried, reference)[-1] for carried in (True, False))
    print(f"rho_inf {rho}: tension off by {found[1]:.1e}, plain weights {plain[1]:.1e}; position {found[0]:.1e} m")
    assert found[1] < plain[1] / 3.0 and found[0] < 1e-4


@kernel
def _before_fixed(dt, last, last_rho, rho):
    return before_fixed(dt, last, last_rho, rho)


@kernel
def _weights(rho, before, rho_before, dt):
    if rho_before >= 0.0:
        rho = radius_of_step(rho, before, rho_before, dt)
    else:  # one radius for all steps
        rho_before = rho
    am, af, ga, be, _ = weights(rho, rho_before, before / dt)
    return rho, am, af, ga, be


def amplification(w, dt, am, af, ga, be):
    """What a step of dt makes of (r, v, a, dv/dt) of an oscillator r'' = -w^2 r."""
    ahead = np.array([1.0, dt, dt * dt * (0.5 - be), 0.0])
    given = np.array([0.0, 0.0, -am, af]) - (1.0 - af) * w * w * ahead
    a = given / (1.0 - am + (1.0 - af) * w * w * be * dt * dt)
    r = ahead + be * dt * dt * a
    return np.array([r, np.array([0.0, 1.0, dt * (1.0 - ga), 0.0]) + dt * ga * a, a, -w * w * r])


def growth(rho, steps, same=False, fixed=False):
    """By how much an oscillation of any frequency grows at most in a sequence of steps that is repeated for ever.

    same: with the radius of equal steps in all of them.  fixed: as whole steps and parts of them.
    """
    at, laws, before = rho, [], steps[-1]
    for dt in steps * 3:
        if fixed:
            before, at = _before_fixed(dt, before, at, rho)
        at, *law = _weights(rho, before, -1.0 if same else at, dt)
        laws.append((dt, *law))
        before = dt
    most = 0.0
    for w in np.append(np.logspace(-1.5, 2.0, 60), [1e3, 1e6]):
        whole = np.eye(4)
        for law in laws[-len(steps) :]:
            whole = amplification(w, *law) @ whole
        most = max(most, np.abs(np.linalg.eigvals(whole)).max())
    return most


# Sequences, each repeated, and by how much they may let grow what they excite.
SEQUENCES = {
    "halved": ([1.0, 0.5], 1.001), "a quarter": ([1.0, 0.25], 1.05), "two halves": ([1.0, 0.5, 0.5], 1.001),
    "cut": ([1.0] * 5 + [1 / 8] * 8, 1.2), "cut far": ([1.0] * 5 + [1 / 64] * 64, 1.25),
    "doubled three times": ([1 / 8, 1 / 4, 1 / 2, 1.0], 1.08), "doubled six times": ([2.0**-k for k in range(6, -1, -1)], 1.12),
    "up and down": ([1 / 8, 1 / 4, 1 / 2, 1.0, 1 / 2, 1 / 4], 1.1), "a little": ([1.0, 1.2, 1.44, 1.2], 1.001),
    "up by 1.2": ([1.2**k for k in range(10)], 1.05),
}  # fmt: skip


@pytest.mark.parametrize("rho", [0.0, 0.2, 0.5, 0.8, 0.9])
@pytest.mark.parametrize("name", SEQUENCES)
def test_steps_that_change_for_ever_excite_little(rho, name):
    steps, most = SEQUENCES[name]
    found, one = growth(rho, steps), growth(rho, steps, same=True)
    print(f"{name}, rho_inf {rho}: {found:.3f}; with one radius {one:.3f}")
    assert found < most
    if name.startswith("doubled") and rho >= 0.5:
        assert one > 1.2 * found


@pytest.mark.parametrize("rho", [0.0, 0.5, 0.9])
@pytest.mark.parametrize("parts", [2, 4, 8, 64])
def test_fixed_steps_that_are_cut_again_and_again_excite_nothing(rho, parts):
    for whole in (5, 20):
        assert growth(rho, [1.0] * whole + [1.0 / parts] * parts, fixed=True) < 1.001


@kernel
def _passes(clock, count, dt, error):
    return passes(clock, count, dt, error)


@kernel
def _halve(clock, count, dt):
    halve(clock, count, dt)


class Controller:
    """The controller of the compiled run, one decision at a time."""

    def __init__(self, tolerance, largest, smallest):
        self.clock, self.count = b.Clock(), b.Counts()
        self.clock.tolerance, self.clock.largest, self.clock.shortest = tolerance, largest, smallest
        self.clock.next_dt, self.clock.error_ratio = largest / FIRST, 1.0
        self.count.controlled = 1

    @property
    def next(self):
        return self.clock.next_dt

    def until(self, t, stop):
        return step_end.py_func(t, stop, self.next)

    def accepts(self, dt, error):
        return _passes(self.clock, self.count, dt, error)

    def fails(self, dt):
        _halve(self.clock, self.count, dt)
        return self.next


@pytest.mark.parametrize("rho", [0.0, 0.5, 0.8, 0.9])
def test_random_steps_stay_stable(rho):
    """Steps that change at random by up to a factor of two each time, 256 of them."""
    right = motion("catenary", rho, np.full(512, DURATION / 512))
    right = right[DURATION][1]
    for seed in range(3):
        rng = np.random.default_rng(seed)
        f = [1.0]
        while len(f) < 256:
            f.append(min(max(f[-1] * rng.uniform(0.5, 2.0), 0.25), 4.0))
        at = motion("catenary", rho, np.array(f) * DURATION / np.sum(f))
        T = list(at.values())[-1][1]
        assert np.abs(T - right).max() < 0.01 * np.abs(right).max()


def test_controller_aims_at_its_tolerance():
    """An error c dt^3 whose c grows and falls by 1e6: steps follow, land, and are seldom taken back."""
    control = Controller(1e-6, 0.5, 1e-9)
    t, steps, refused = 0.0, [], 0
    for stop in np.arange(1, 21) * 0.5:
        while t < stop:
            dt = control.until(t, stop) - t
            c = 10.0 ** (6.0 * np.exp(-((t + dt - 5.0) ** 2))) * 1e-5
            while not control.accepts(dt, c * dt**3):
                refused += 1
                dt = control.next
            t = stop if stop - t - dt < 1e-12 else t + dt
            steps.append((t, dt, c * dt**3))
        assert t == stop
    error = np.array(steps)[:, 2]
    dts = np.array(steps)[:, 1]
    assert error.max() <= REFUSED * 1e-6
    assert refused < 0.1 * len(steps)
    assert dts.min() < 0.02 * dts.max()
    assert all(LEAST / 2 <= b / a <= 2 * MOST for a, b in pairwise(dts[3:]))


def test_failed_steps_are_halved_and_do_not_grow_at_once():
    control = Controller(1e-3, 1.0, 1e-9)
    control.accepts(0.1, 1e-9)
    assert control.fails(0.1) == pytest.approx(0.05)
    assert control.accepts(0.05, 0.0) and control.next <= 0.05
    for _ in range(5):
        control.accepts(control.next, 0.0)
    assert control.next > 0.1


@kernel
def _take_past(clock, count):
    note_past(clock, count)


@kernel
def _end_of_try(clock, moves):
    return end_of_try(clock, moves)


def test_fixed_steps_know_the_step_before_where_it_had_another_length():
    """Equal but for round-off, after a start or far shorter parts: the weights of equal steps; halved, or after half
    a step: others."""
    clock, count = b.Clock(), b.Counts()
    clock.now, clock.try_end = 9345.0, 9345.05
    dt = clock.try_end - clock.now
    clock.rho, clock.last_rho = 0.5, 0.25
    for before, told, radius in (
        (0.05, dt, 0.25),
        (0.0, dt, 0.5),
        (0.025, 0.025, 0.25),
        (0.0125, dt, 0.5),
        (0.1, 0.1, 0.25),
    ):
        clock.last_dt = before
        _take_past(clock, count)
        assert (clock.step_before, clock.rho_before) == (told, radius)
    count.controlled, clock.last_dt = 1, 0.0
    _take_past(clock, count)
    assert clock.step_before == 0.0


@pytest.mark.parametrize("begin", [0.0, 9345.2, 1e7])
def test_parts_of_a_halved_step_end_with_it_however_late(begin):
    """A rest of 9e-12 s was a step once, 2.6 h into a run, and none that followed it was short enough."""
    clock = b.Clock()
    clock.most_turn, clock.now, clock.until = 1.0, begin, begin + 0.05
    clock.tried_dt, parts = 0.05 / 32, 0
    while clock.now < clock.until:
        clock.now, parts = _end_of_try(clock, no_moves()), parts + 1
    assert parts == 32 and clock.now == begin + 0.05


def test_a_line_without_drag_that_is_thrown_about_for_minutes_does_not_gain_energy_by_halved_steps():
    """It stopped at 200 s with "the computation creates energy": halved steps had the weights of equal ones."""
    section = {"length": 30, "diameter": 0.03, "mass": 2.0, "axial_stiffness": 1e7, "bending_stiffness": 60}
    result = hybrid.run(cable_scene(
        section, pinned_at(0, 0, -20),
        pinned_at(14, 0, 0, motion={"heave": {"amplitude": 0.5, "period": 4}, "ramp": 4}),
        seabed={"z": -20, "stiffness": 2e3}, model="rod", mesh=40, time=(220, 0.05), output=10
    ))  # fmt: skip
    assert np.array(result["steps/repeats"]).max() > 0, "steps are halved in it"
    assert "gains energy" not in {x.kind for x in result.events}


# --- Order in time: two for positions and tensions, for rod, catenary and hybrid ---

MODELS = {
    "rod": {"kind": "zones", "zones": [{"rod": 2.0, "cells": 40}]},
    "catenary": {"kind": "zones", "zones": [{"catenary": 2.0, "cells": 40}]},
    "hybrid": {
        "kind": "zones",
        "zones": [{"catenary": 0.7, "cells": 14}, {"rod": 0.6, "cells": 12}, {"catenary": 0.7, "cells": 14}],
    },
}


def scene(model, step, rho):
    section = {
        "length": 2.0, "mass": 0.5, "diameter": 0.02, "bending_stiffness": 0.002, "torsional_stiffness": 0.0016,
        "drag": {"normal": 1.2, "tangential": 0.05}, "added_mass": {"normal": 1.0},
    }  # fmt: skip
    motion = {
        "heave": {"amplitude": 0.1, "period": 2.5},
        "sway": {"amplitude": 0.1, "period": 3.1, "phase": 40},
        "ramp": 2.0,
    }
    return hybrid.validate_scene(
        cable_scene(
            section,
            pinned_at(0, 0, 0),
            pinned_at(1.2, 0.3, 0.2, motion=motion),
            gravity=9.81,
            fluid={"density": 1000.0},
            model=MODELS[model],
            time=(2.0, step, rho),
            output=0.1,
        )
    )


@pytest.mark.parametrize("rho", [0.5, 0.8])
def test_second_order(rho):
    """Of a rod between catenaries; of each alone it is that of equal steps above."""
    results = [hybrid.run(scene("hybrid", step, rho)) for step in (0.02, 0.01, 0.005, 0.0025)]
    orders = {}
    for name in ("position", "tension"):
        change = [np.sqrt(np.mean((a[name] - b[name]) ** 2)) for a, b in pairwise(results)]
        orders[name] = [float(np.log2(a / b)) for a, b in pairwise(change)]
    print(f"rho_inf {rho}: order {orders}")
    assert np.abs(np.array(orders["position"]) - 2.0).max() < 0.2
    assert min(orders["tension"]) >= 1.8
    assert max(orders["tension"]) < 2.5
