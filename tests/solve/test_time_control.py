"""Steps that change: tension stays clean and of second order, the controller keeps to its tolerance, steps land."""

from itertools import pairwise

import numpy as np
import pytest
from test_time_order import scene

from hybrid.errors import Outcome
from hybrid.kernels import books as b
from hybrid.kernels.compile import kernel
from hybrid.kernels.step_control import halve, passes
from hybrid.kernels.step_law import FIRST, LEAST, MOST, REFUSED, step_end
from hybrid.model.build import build
from hybrid.solve.statics import solve_statics
from hybrid.solve.stepper import Stepper

DURATION = 2.0  # s
REFERENCE = 64 * 16  # steps
# Lengths of steps in turn: nothing changes; by two, often; two longer ones among three short ones.
PATTERNS = {"equal": [1, 1, 1, 1], "halved and doubled": [2, 1, 0.5, 0.5], "two for one": [1.2, 1.2, 0.6, 0.5, 0.5]}


def motion(model, rho, steps, carried=True):
    """Times, positions and tensions at the end of every step; steps: s; carried: whether the scheme is told of them."""
    what = scene(model, 0.01, rho)
    made = build(what)
    stepper = Stepper(made.line, made.length, made.tension_scale)
    old = solve_statics(
        made.line, made.sea.at(0.0), made.ends.at(0.0), made.start, made.length, made.tension_scale
    ).state
    stepper.consistent_accelerations(made.sea.at(0.0), made.ends.at(0.0), made.ends.acceleration(0.0, 1e-5), old)
    new = old.copy()
    t, before, out = 0.0, 0.0, {}
    for dt in steps:
        t += dt
        taken = stepper.step(made.sea.at(t), made.ends.at(t), old, new, dt, rho, before if carried else dt)
        assert taken.outcome == Outcome.OK, f"{taken.outcome} at t = {t}"
        old, new, before = new, old, dt
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


@kernel
def _passes(clock, count, dt, error):
    return passes(clock, count, dt, error)


@kernel
def _halve(clock, count, dt):
    halve(clock, count, dt)


class Controller:
    """The controller of the compiled run, one decision at a time."""

    def __init__(self, tolerance, largest, smallest):
        self.clock, self.count = np.zeros(b.CLOCK_SIZE), np.zeros(b.COUNT_SIZE, np.int64)
        self.clock[b.TOLERANCE], self.clock[b.LARGEST], self.clock[b.SHORTEST] = tolerance, largest, smallest
        self.clock[b.NEXT_DT], self.clock[b.ERROR_RATIO] = largest / FIRST, 1.0
        self.count[b.CONTROLLED] = 1

    @property
    def next(self):
        return self.clock[b.NEXT_DT]

    def until(self, t, stop):
        return step_end(t, stop, self.next)

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
