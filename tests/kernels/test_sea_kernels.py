"""The kernels of the sea against closed forms, quadrature and differences: no line, no solver.

Tolerances.  Closed forms and exact quadrature: round-off, 1e-12 of the size.  Adaptive quadrature: what
scipy promises, 1e-10.  Derivatives: a fourth-order central difference with a step of 1e-3 of the argument's
size is right to some 1e-11, with round-off near 1e-13/1e-3 = 1e-10: 1e-8 is asked for.
"""

from __future__ import annotations

import math
import os
from itertools import pairwise

import numba
import numpy as np
import pytest
from scipy.integrate import quad

import hybrid
from hybrid.kernels.laws import seabed, water
from hybrid.kernels.laws.seabed import contact
from hybrid.kernels.laws.water import FADED, SAME_WETNESS, wave_kinematics
from hybrid.kernels.state.state import LANES, no_sea, with_waves
from hybrid.kernels.watch.tangents import PHASES, SLOPES, wave_slopes, waves_beside
from hybrid.model.sea import HIGHEST, LOWEST, Surroundings, components, current_table, jonswap, surroundings
from hybrid.scene.wave_theory import JonswapWaves, steady_wave
from hybrid.scene.waves import FINE, RegularWaves, StreamFunctionWaves, shares
from tests.scenes import cable_scene, pinned_at


def entry(law):
    """An entry for Python to a law that only kernels call."""
    return numba.njit(lambda *x: law(*x))


current_at, wetted, wetted_stretch = entry(water.current_at), entry(water.wetted), entry(water.wetted_stretch)
pressure, friction = entry(seabed.pressure), entry(seabed.friction)

G = 9.81
ROUND_OFF, QUADRATURE, DIFFERENCE = 1e-12, 1e-10, 1e-8


def assert_within(value, bound):
    """Show a figure with the test that measured it (`pytest -s`), and hold it to its bound."""
    test = os.environ["PYTEST_CURRENT_TEST"].split("::")[-1].removesuffix(" (call)")
    print(f"\n{test}: {value:.1e} of at most {bound:.1e}", end="")
    assert value <= bound


def slope(f, x, step):
    """f'(x) by a central difference of fourth order; f may return an array."""
    return (f(x - 2 * step) - 8 * f(x - step) + 8 * f(x + step) - f(x + 2 * step)) / (12 * step)


# --- current -------------------------------------------------------------------------------------

HEIGHTS = np.array([-100.0, -60.0, -59.0, -10.0, 0.0])
SPEEDS = np.random.default_rng(1).normal(size=(5, 3))


@pytest.mark.parametrize("height", [-150.0, -99.9, -70.0, -59.5, -30.0, -9.9, -0.1, 5.0])
def test_current_is_the_table(height):
    """Linear between its heights, constant beyond, times its part; and its slope, which is that of the table."""
    U, U1 = (np.array(x) for x in current_at(HEIGHTS, SPEEDS, 0.7, height))

    def table(z):
        return 0.7 * np.array([np.interp(z, HEIGHTS, SPEEDS[:, k]) for k in range(3)])

    assert_within(np.abs(U - table(height)).max(), ROUND_OFF)
    assert_within(np.abs(U1 - slope(table, height, 1e-3)).max(), 1e-10)


@pytest.mark.parametrize("z", HEIGHTS)
def test_current_is_continuous_at_its_heights(z):
    below, at, above = (np.array(current_at(HEIGHTS, SPEEDS, 1.0, z + d)[0]) for d in (-1e-9, 0.0, 1e-9))
    assert_within(np.abs(below - at).max(), 1e-8)
    assert_within(np.abs(above - at).max(), 1e-8)


def test_uniform_current():
    U, U1 = current_at(np.zeros(1), np.array([[1.0, -2.0, 0.5]]), 0.25, 37.0)
    assert U == (0.25, -0.5, 0.125)
    assert U1 == (0.0, 0.0, 0.0)


def test_power_law_table():
    """Interpolated in its table, the power law and its turn are right to 1e-5 of the speed at the top down to 1 % of
    the height over the foot, and to 2.5e-4 down to a millionth of it: x^(1/7) is steep there."""
    top, bottom, exponent, turn = -3.0, -100.0, 1 / 7, 40.0
    fluid = {
        "density": 1025,
        "current": {
            "kind": "power_law",
            "velocity": [0.8, -0.3, 0],
            "top": top,
            "bottom": bottom,
            "exponent": exponent,
            "veer": turn,
        },
    }
    z, table = current_table(_scene(fluid))
    heights = np.concatenate([np.linspace(bottom, top, 3001), bottom + (top - bottom) * np.geomspace(1e-6, 1, 2000)])
    part = (heights - bottom) / (top - bottom)
    angle = np.radians(turn) * (1 - part)
    size = math.hypot(0.8, 0.3)
    first = math.atan2(-0.3, 0.8)
    speed = size * part**exponent
    exact = np.column_stack([speed * np.cos(first + angle), speed * np.sin(first + angle), 0 * speed])
    found = np.array([current_at(z, table, 1.0, h)[0] for h in heights])
    error = np.abs(found - exact).max(axis=1) / size
    high = error[part >= 1e-2].max()
    print(f"power law: {high:.1e} of the speed at the top above 1 % of the height, {error.max():.1e} anywhere")
    assert_within(high, 1e-5)
    assert_within(error.max(), 2.5e-4)
    for beyond, speed_there in ((top + 20.0, size), (bottom - 20.0, 0.0)):
        assert np.linalg.norm(current_at(z, table, 1.0, beyond)[0]) == pytest.approx(speed_there, abs=ROUND_OFF)


def _scene(fluid, **environment):
    section, around = {"length": 10, "mass": 5.0, "diameter": 0.05}, {"fluid": fluid, **environment}
    return hybrid.validate_scene(
        cable_scene(section, pinned_at(0, 0, -5), "free", environment=around, model="catenary")
    )


# --- waves ---------------------------------------------------------------------------------------


def sea_of(waves, depth, ramp=None, surface=0.0, n=1):
    """Surroundings with these components, and room for n points."""
    sea = no_sea(n - 1)._replace(surface=surface, ramps=np.array([0.0, ramp or 0.0]))
    sea = with_waves(sea, waves, depth)
    return Surroundings(sea)


def stirred(around: Surroundings, t: float, points) -> np.ndarray:
    """Velocity, acceleration, elevation (n, 7) at points (n, 3) and t."""
    r = np.atleast_2d(np.asarray(points, float))
    sea = around.at_time(t)._replace(flow=np.zeros((len(r), 7)))
    wave_kinematics(sea, 0.4 * r, 0.6 * r)  # r + u is what counts
    return sea.flow


def airy(waves, depth, t, point, surface=0.0):
    """Velocity, acceleration, elevation of linear waves, depths stretched after Wheeler; cosh and sinh as in books."""
    x, y, z = point[0], point[1], point[2] - surface
    theta = waves[:, 2] * x + waves[:, 3] * y - waves[:, 1] * t + waves[:, 4]
    A, w, k = waves[:, 0], waves[:, 1], waves[:, 5]
    eta = float(np.sum(A * np.cos(theta)))
    z = min(z, eta)
    if math.isinf(depth):
        level = up = np.exp(k * (z - eta))
    else:
        q = depth * (z + depth) / (eta + depth)  # height above the bed
        level, up = np.cosh(k * q) / np.sinh(k * depth), np.sinh(k * q) / np.sinh(k * depth)
    towards = waves[:, 2:4] / k[:, None]
    u, a = A * w * level * np.cos(theta), A * w * w * level * np.sin(theta)
    v, b = A * w * up * np.sin(theta), -A * w * w * up * np.cos(theta)
    return np.concatenate([u @ towards, [v.sum()], a @ towards, [b.sum()], [eta]])


REGULAR = RegularWaves(height=2.0, period=8.0, direction=35.0, phase=50.0)
SLIGHT = RegularWaves(height=2e-6, period=8.0, direction=35.0, phase=50.0)


@pytest.mark.parametrize("depth", [math.inf, 200.0, 30.0, 8.0])
@pytest.mark.parametrize("z", [1.5, 0.0, -0.5, -3.0, -7.9, -25.0])
def test_regular_wave_kinematics(depth, z):
    if z < -depth:
        z = -depth
    waves = components(REGULAR, depth, G)
    size = np.abs(waves[:, 0] * waves[:, 1] ** 2).sum() / (1.0 if depth > 10 else math.tanh(waves[0, 5] * depth))
    around = sea_of(waves, depth, surface=3.0)
    for t in (0.0, 1.3, 5.1):
        point = (4.0, -7.0, z + 3.0)
        got, exact = stirred(around, t, point)[0], airy(waves, depth, t, point, 3.0)
        assert np.abs(got - exact).max() <= ROUND_OFF * max(size, 1.0) * 10


@pytest.mark.long
@pytest.mark.parametrize("depth", [math.inf, 60.0, 4.0])
@pytest.mark.parametrize("stretched", [1.0, 0.0])
def test_slopes_of_waves(depth, stretched):
    """Against differences, below and above the surface, at the bed and below it, while waves grow, of more nodes than are

    computed at a time; no point is so near a surface or the bed that a difference would go through it.
    """
    waves = components(JonswapWaves(significant_height=1.5, peak_period=6.0, direction=-40.0, seed=3), depth, G)
    points = np.random.default_rng(5).uniform([-300.0, -300.0, -6.0], [300.0, 300.0, 2.0], (37, 3))
    around = sea_of(waves, depth, ramp=20.0, n=len(points))
    sea = around.at_time(7.0)._replace(stretched=stretched, flow=np.zeros((len(points), 7)))

    def moved(way, x):
        wave_kinematics(sea, points, x * way)
        return sea.flow.copy()

    slopes = np.zeros((len(points), SLOPES))
    wave_slopes(sea, points, np.zeros((PHASES + 2 * len(waves), LANES)), slopes)
    base, h = moved(points, 0.0), 1e-6
    for way in np.random.default_rng(2).normal(size=(3, *points.shape)):
        found = np.zeros_like(base)
        waves_beside(base, slopes, h, way, found)
        exact = slope(lambda x, way=way: moved(way, x), 0.0, 1e-3)
        assert_within(np.abs((found - base) / h - exact).max(), 1e-9 * np.abs(exact).max())


@pytest.mark.parametrize("depth", [math.inf, 60.0])
@pytest.mark.parametrize("t", [3.3, 1.08e4, 1e6])
def test_irregular_waves_are_the_sum_of_their_components(depth, t):
    """Of more nodes than are computed at a time; late in a run the phases themselves are known to fewer digits."""
    waves = components(JonswapWaves(significant_height=3.0, peak_period=11.0, direction=-40.0, seed=3), depth, G)
    points = np.random.default_rng(5).uniform(
        [-300.0, -300.0, -1.0], [300.0, 300.0, 4.0], (37, 3)
    )  # nothing fades there
    got = stirred(sea_of(waves, depth, n=len(points)), t, points)
    exact = np.array([airy(waves, depth, t, point) for point in points])
    size = np.abs(waves[:, 0] * waves[:, 1] ** 2).sum()
    late = 2.0 * np.finfo(float).eps * t * waves[:, 1].max()
    assert np.abs(got - exact).max() <= size * (10 * ROUND_OFF + late)


def test_what_is_left_out_deep_down():
    """A component faded to FADED of its surface value is left out, and no other: the jump is FADED and no more."""
    waves = components(RegularWaves(height=2.0, period=5.0), math.inf, G)
    A, w, k = waves[0, 0], waves[0, 1], waves[0, 5]
    around = sea_of(waves, math.inf)
    depth = -math.log(FADED) / k
    t = 0.5 * math.pi / w  # level: eta = 0
    above, below = (np.abs(stirred(around, t, (0, 0, -depth * x))[0, :3]).max() for x in (1 - 1e-9, 1 + 1e-9))
    assert above == pytest.approx(A * w * FADED, rel=1e-6)
    assert below == 0.0


@pytest.mark.parametrize("depth", [math.inf, 2000.0])
def test_where_all_components_have_faded_the_water_is_still(depth):
    """Far below the surface nothing is computed, from a height on at which no component may count at any elevation."""
    waves = components(JonswapWaves(significant_height=6.0, peak_period=9.0, seed=4), depth, G)
    highest = np.abs(waves[:, 0]).sum()
    calm = math.log(FADED) / waves[:, 5].min() - highest
    above, below = (np.tile([[0.0, 0.0, calm + 3.0 + x]], (40, 1)) for x in (1e-6, -1e-6))
    around = sea_of(waves, depth, surface=3.0, n=40)
    for t in (0.0, 31.7, 400.0):
        assert not stirred(around, t, below).any()
        exact = airy(waves, math.inf, t, below[0], 3.0)
        assert np.abs(exact[:3]).max() < FADED * (np.abs(waves[:, 0]) * waves[:, 1]).sum()
        found = stirred(around, t, above)
        assert not found[:, :6].any() and found[0, 6] == pytest.approx(exact[6], abs=1e-12)  # there it is looked for
    low = calm + 3.0 + 2.0 * highest + 1.0  # in a trough some of it is there
    assert max(np.abs(stirred(around, t, (0, 0, low))[0, :3]).max() for t in np.linspace(0.0, 60.0, 61)) > 0.0


@pytest.mark.parametrize("depth", [math.inf, 20.0])
@pytest.mark.parametrize("ramp", [None, 40.0])
def test_acceleration_is_the_rate_of_velocity(depth, ramp):
    """At a fixed point, growth of the sea included.  Low waves: stretching moves the depths by a part k A only."""
    waves = components(SLIGHT, depth, G)
    around = sea_of(waves, depth, ramp)
    size = waves[0, 0] * waves[0, 1] ** 2 / math.tanh(min(waves[0, 5] * depth, 20.0))
    for z in (0.0, -2.0, -11.0):
        for t in (3.0, 17.0, 39.0, 60.0):
            rate = slope(lambda x, z=z: stirred(around, x, (5.0, 1.0, z))[0, :3], t, 1e-2)
            a = stirred(around, t, (5.0, 1.0, z))[0, 3:6]
            assert np.abs(a - rate).max() <= 1e-5 * size  # k A = 6e-8 to 1e-7, and 1e-2^4 of the difference


def test_waves_go_their_way():
    """Horizontal motion along the direction; a crest travels there with the phase speed w/k."""
    for direction in (0.0, 90.0, 205.0):
        waves = components(RegularWaves(height=1.0, period=6.0, direction=direction), math.inf, G)
        around = sea_of(waves, math.inf)
        towards = np.array([math.cos(math.radians(direction)), math.sin(math.radians(direction))])
        v = stirred(around, 1.0, (1.0, 2.0, -1.0))[0]
        assert abs(v[0] * towards[1] - v[1] * towards[0]) <= ROUND_OFF
        t, speed = 3.7, waves[0, 1] / waves[0, 5]
        assert around.elevation(*(speed * t * towards), t)[0] == pytest.approx(0.5, abs=1e-12)
        assert speed == pytest.approx(G * 6.0 / (2 * math.pi), rel=1e-12)  # deep water


@pytest.mark.parametrize("ramp", [None, 20.0])
def test_elevation_its_rate_and_slopes(ramp):
    """What an end follows is what the line feels; rate and slopes are its derivatives, growth included."""
    waves = components(JonswapWaves(significant_height=3.0, peak_period=9.0, components=30, direction=120), math.inf, G)
    around = sea_of(waves, math.inf, ramp)
    for t in (2.0, 13.0, 30.0):
        eta, rate, *slopes = around.elevation(12.0, -5.0, t)
        assert stirred(around, t, (12.0, -5.0, -4.0))[0, 6] == pytest.approx(eta, abs=1e-12)
        assert rate == pytest.approx(slope(lambda x: around.elevation(12.0, -5.0, x)[0], t, 1e-3), abs=1e-9)
        assert slopes[0] == pytest.approx(slope(lambda x, t=t: around.elevation(x, -5.0, t)[0], 12.0, 1e-3), abs=1e-9)
        assert slopes[1] == pytest.approx(slope(lambda x, t=t: around.elevation(12.0, x, t)[0], -5.0, 1e-3), abs=1e-9)


def test_growth_of_the_sea():
    """Nothing at t = 0, everything at the end of the ramp, half of it half way, smoothly."""
    waves = components(REGULAR, math.inf, G)
    grown, growing = sea_of(waves, math.inf), sea_of(waves, math.inf, 20.0)
    assert not stirred(growing, 0.0, (0, 0, -1)).any()
    assert growing.elevation(0, 0, 10.0)[0] == pytest.approx(0.5 * grown.elevation(0, 0, 10.0)[0], rel=1e-12)
    assert_within(np.abs(stirred(growing, 20.0, (0, 0, -1)) - stirred(grown, 20.0, (0, 0, -1))).max(), ROUND_OFF)


def test_depth_over_the_seabed_is_that_of_the_waves():
    fluid = {"density": 1025, "surface": 2.0, "waves": {"kind": "regular", "height": 1.0, "period": 9.0}}
    values = surroundings(_scene(fluid, seabed={"z": -18.0, "stiffness": 1e4}), 3).values
    k, w = values.waves[0, 5], values.waves[0, 1]
    assert values.depth == 20.0
    assert G * k * math.tanh(20.0 * k) == pytest.approx(w * w, rel=1e-14)


# --- irregular seas ------------------------------------------------------------------------------


def test_jonswap_spectrum_has_its_shape():
    """Peak where it is asked for, gamma times that of Pierson and Moskowitz there, a tail of w^-5."""
    peak = 0.7
    w = np.linspace(0.3, 2.0, 20001)
    S = jonswap(w, peak, 3.3)
    assert w[np.argmax(S)] == pytest.approx(peak, abs=1e-4)
    at = np.array([peak])
    assert jonswap(at, peak, 3.3)[0] / jonswap(at, peak, 1.0)[0] == pytest.approx(3.3, rel=1e-12)
    far = np.array([20 * peak, 40 * peak])
    assert float(np.log2(np.divide(*jonswap(far, peak, 3.3)))) == pytest.approx(5.0, abs=1e-3)


def test_waves_share_the_energy():
    """Each wave stands at the median of its share: as many waves lie below a frequency as there is energy."""
    peak, n = 2 * math.pi / 10.0, 200
    fine = peak * np.geomspace(LOWEST, HIGHEST, FINE)
    w = shares(fine, jonswap(fine, peak, 3.3), n)[0]
    total = quad(lambda x: float(jonswap(np.array([x]), peak, 3.3)[0]), 0.3 * peak, 6 * peak, limit=400, points=[peak])[
        0
    ]
    for x in (0.8, 1.0, 1.2, 2.0):
        below = quad(lambda q: float(jonswap(np.array([q]), peak, 3.3)[0]), 0.3 * peak, x * peak, limit=400)[0]
        assert abs(np.sum(w < x * peak) / n - below / total) <= 1.0 / n
    assert np.diff(w).min() > 0.0
    waves = components(JonswapWaves(significant_height=4.0, peak_period=10.0, components=n), math.inf, G)
    np.testing.assert_allclose(waves[:, 0], math.sqrt(2.0 / n), rtol=1e-12)  # all alike: m0 = Hs^2/16 = 1 m2
    np.testing.assert_allclose(waves[:, 1], w, rtol=1e-12)


def test_a_seed_is_a_sea():
    def sea(seed):
        return components(JonswapWaves(significant_height=2.0, peak_period=8.0, seed=seed), math.inf, G)

    assert np.array_equal(sea(5), sea(5))
    assert not np.array_equal(sea(5), sea(6))
    assert np.array_equal(sea(5)[:, :4], sea(6)[:, :4])  # the same spectrum, other phases
    # these numbers are those of numpy's PCG64; a change of them is a change of every irregular sea ever computed
    assert sea(5)[:2, 4] == pytest.approx(np.random.default_rng(5).uniform(0, 2 * np.pi, 2), abs=0.0)


# --- the surface ---------------------------------------------------------------------------------


def test_wetness_of_a_point():
    """From dry to wet over its height, half wet in the middle, with a continuous slope; antiderivative and slope."""
    assert wetted(-0.1) == (0.0, 0.0, 0.0)
    assert wetted(0.5)[0] == 0.5
    assert wetted(1.1)[0] == 1.0
    for x in (-0.4, 0.1, 0.37, 0.5, 0.8, 0.99, 1.7):
        g, big, rate = wetted(x)
        assert big == pytest.approx(quad(lambda q: wetted(q)[0], -1.0, x, points=[0.0, 1.0])[0], abs=1e-9)
        assert g == pytest.approx(slope(lambda q: wetted(q)[1], x, 1e-3), abs=1e-8)
        assert rate == pytest.approx(slope(lambda q: wetted(q)[0], x, 1e-4), abs=1e-8)
    for x in (0.0, 1.0):
        assert wetted(x - 1e-7)[2] == pytest.approx(wetted(x + 1e-7)[2], abs=1e-6)


PAIRS = [tuple(x) for x in np.random.default_rng(2).uniform(-1.5, 2.5, (30, 2))]
PAIRS += [(0.3, 0.3 + 3 * SAME_WETNESS), (-5.0, 700.0), (2000.0, 2000.3), (0.5, -40.0), (-2.0, -1.0)]


@pytest.mark.parametrize(("xa", "xb"), PAIRS)
def test_wetted_stretch_is_the_mean_of_the_wetness(xa, xb):
    W, wa, wb = wetted_stretch(xa, xb)
    breaks = sorted(q for q in ((0 - xa) / (xb - xa), (1 - xa) / (xb - xa)) if 0 < q < 1)
    edges = [0.0, *breaks, 1.0]
    mean = sum(quad(lambda q: wetted(xa + q * (xb - xa))[0], a, b, epsabs=1e-14)[0] for a, b in pairwise(edges))
    assert_within(abs(W - mean), QUADRATURE)
    step = min(1e-3, 0.3 * abs(xb - xa))
    assert wa == pytest.approx(
        slope(lambda x: wetted_stretch(x, xb)[0], xa, step), abs=1e-6 if step < 1e-3 else DIFFERENCE * 10
    )
    assert wb == pytest.approx(
        slope(lambda x: wetted_stretch(xa, x)[0], xb, step), abs=1e-6 if step < 1e-3 else DIFFERENCE * 10
    )
    assert wetted_stretch(xb, xa)[0] == pytest.approx(W, abs=ROUND_OFF)


@pytest.mark.parametrize("x", [-0.3, 0.05, 0.5, 0.95, 3.0])
def test_wetted_stretch_of_a_level_one(x):
    """Level and nearly level stretches: no jump where the quotient gives way to the middle (SAME_WETNESS^2/24 g'')."""
    just = [wetted_stretch(x, x + f * SAME_WETNESS) for f in (0.999, 1.001)]
    assert just[0][0] == pytest.approx(just[1][0], abs=1e-6 * SAME_WETNESS + 2e-9 + 1.6 * 0.002 * SAME_WETNESS)
    assert_within(np.abs(np.subtract(just[0], just[1])[1:]).max(), 1e-3)
    assert wetted_stretch(x, x)[0] == wetted(x)[0]


# --- contact -------------------------------------------------------------------------------------


def random_contact(seed):
    g = np.random.default_rng(seed)
    p0, p1 = g.uniform(-2.0, 3.0, 2) * 10.0 ** g.uniform(-3, 0)
    if max(p0, p1) <= 0.0:
        p0 = -p0
    o = 10.0 ** g.uniform(-3, 0)
    return p0, p1, *g.normal(size=2), g.uniform(0.2, 5.0), g.uniform(1.0, 1e5), g.uniform(0.0, 1e3), o


CONTACTS = [random_contact(seed) for seed in range(40)]
CONTACTS += [
    (0.3, 0.3, 0.1, -0.2, 1.0, 1e4, 50.0, 0.1),  # level, deep
    (0.05, 0.05, 0.1, -0.2, 1.0, 1e4, 50.0, 0.1),  # level, in the onset
    (1e-9, -1.0, 0.0, 0.0, 2.0, 1e4, 0.0, 0.1),  # a touch
    (0.0, 0.2, 1.0, 1.0, 2.0, 1e4, 30.0, 0.1),  # touchdown at the node
    (0.1, -0.1, 0.0, 1.0, 2.0, 1e4, 30.0, 0.1),  # onset at the node
]


@pytest.mark.parametrize("case", CONTACTS)
def test_contact_is_the_integral_of_the_pressure(case):
    """Against adaptive quadrature of a law written down anew (T17a), with the shape functions of the two nodes.

    The pressure has kinks where p is 0 or o, and where the bed lets go because damping would pull: quadrature in pieces.
    """
    p0, p1, v0, v1, h, k, c, o = case

    def q(x):
        p, v = p0 + x * (p1 - p0), v0 + x * (v1 - v0)
        if p <= 0:
            return 0.0
        return max(0.0, k * p * p / (2 * o) + c * p / o * v if p < o else k * (p - o / 2) + c * v)

    assert q(0.3) == pytest.approx(pressure(0.3, p0, p1, v0, v1, k, c, o)[0], rel=1e-13, abs=1e-13)
    kinks = [(p0, p1), (p0 - o, p1 - o), (k * p0 / 2 + c * v0, k * p1 / 2 + c * v1)]
    kinks += [(k * (p0 - o / 2) + c * v0, k * (p1 - o / 2) + c * v1)]
    edges = [0.0, *sorted(-a / (b - a) for a, b in kinks if a * b < 0.0), 1.0]

    def integral(f):
        return h * sum(quad(f, a, b, epsabs=1e-15, epsrel=1e-13)[0] for a, b in pairwise(edges))

    size = max(integral(lambda x: abs(q(x))), 1e-9)
    near, far = contact(p0, p1, v0, v1, h, k, c, o)[0], contact(p1, p0, v1, v0, h, k, c, o)[0]
    error = max(
        abs(near - integral(lambda x: (1 - x) * q(x))),
        abs(far - integral(lambda x: x * q(x))),
        abs(near + far - integral(q)),
    )
    assert_within(error, QUADRATURE * size)


@pytest.mark.parametrize("case", CONTACTS[:40])
def test_contact_derivatives(case):
    """Second derivatives jump where a node passes 0 or o: there the difference is of lower order, so 1e-6."""
    p0, p1, v0, v1, h, k, c, o = case
    x = np.array([p0, p1, v0, v1])
    exact = np.array(contact(*x, h, k, c, o)[1:])
    for i in range(4):
        step = 1e-6 * max(abs(p0), abs(p1), o) if i < 2 else 1e-3

        def f(q, i=i):
            y = x.copy()
            y[i] = q
            return contact(*y, h, k, c, o)[0]

        assert exact[i] == pytest.approx(
            slope(f, x[i], step), abs=1e-6 * (abs(exact).max() if i < 2 else max(exact[2], 1e-9))
        )


@pytest.mark.parametrize("still", [0.0, -0.05, 0.4])
def test_contact_is_smooth_while_touchdown_travels(still):
    """The other node at rest, this one from above to below: force and stiffness have no jump (onset 0.1 m)."""
    p = np.linspace(-0.5, 0.7, 24001)
    F = np.array([contact(x, still, 0.0, 0.0, 1.0, 1e4, 0.0, 0.1)[:3] if max(x, still) > 0 else (0, 0, 0) for x in p])
    # a jump would not shrink with the step of 5e-5: the force may change by k dp, its slopes by k dp/o, times h
    assert_within(np.abs(np.diff(F[:, 0])).max(), 1e4 * 5e-5)
    assert_within(np.abs(np.diff(F[:, 1:], axis=0)).max(), 4 * 1e4 * 5e-5 / 0.1)


@pytest.mark.parametrize("case", CONTACTS[:40])
def test_contact_has_a_potential(case):
    """Without damping N = d Phi/dp of its node, Phi = h int k P2(p) dx (force along the normal, p against it)."""
    p0, p1, _, _, h, k, _, o = case

    def phi(a, b):
        def V(x):
            p = a + x * (b - a)
            return 0.0 if p <= 0 else k * p**3 / (6 * o) if p < o else k * (p * (p - o) / 2 + o * o / 6)

        edges = [0.0, 1.0]
        if a != b:
            edges[1:1] = sorted(x for x in ((0 - a) / (b - a), (o - a) / (b - a)) if 0 < x < 1)
        return h * sum(quad(V, x, y, epsabs=1e-18, epsrel=1e-13)[0] for x, y in pairwise(edges))

    near, far = contact(p0, p1, 0, 0, h, k, 0, o), contact(p1, p0, 0, 0, h, k, 0, o)
    size = max(abs(near[0]), abs(far[0]))
    step = 1e-3 * max(abs(p0), abs(p1))
    assert near[0] == pytest.approx(slope(lambda x: phi(x, p1), p0, step), abs=1e-6 * size)
    assert far[0] == pytest.approx(slope(lambda x: phi(p0, x), p1, step), abs=1e-6 * size)
    assert near[2] == pytest.approx(far[2], rel=1e-9, abs=1e-9 * k)  # the Hessian is symmetric


def test_rest_on_the_bed():
    """A level cable of weight w lies w/k below the bed, half an onset less than counted from where contact begins."""
    k, o, w, h = 2e4, 1e-2, 200.0, 3.0
    p = w / k + o / 2
    assert p > o
    assert 2 * contact(p, p, 0, 0, h, k, 0, o)[0] == pytest.approx(w * h, rel=1e-13)


def test_the_bed_does_not_pull():
    """However fast a cable leaves it, damping takes the force away and no more."""
    speeds = -np.linspace(0.0, 30.0, 301)
    N = np.array([contact(0.01, -0.002, v, 0.3 * v, 1.0, 1e4, 1e3, 1e-3)[0] for v in speeds])
    assert N.min() >= 0.0
    assert N[0] > 0.0
    assert N[-1] == 0.0
    assert np.diff(N).max() <= 0.0


# --- friction ------------------------------------------------------------------------------------

NORMAL = np.array([0.1, -0.2, 1.0]) / math.sqrt(1.05)
AXIS = np.cross(NORMAL, [0.3, 1.0, 0.0])
AXIS /= np.linalg.norm(AXIS)
SIDE = np.cross(NORMAL, AXIS)
MU_A, MU_L, SL, N = 0.3, 0.8, 1e-3, 50.0


def rub(q, press=N):
    """Force (3,), df/dN, df/dq (3, 3), travel left (3,)."""
    q = np.asarray(q, float)
    f, g, D, part = friction(tuple(q), press, tuple(AXIS), tuple(NORMAL), MU_A, MU_L, SL)
    return np.array(f), np.array(g), np.array(D).reshape(3, 3), part * q


TRAVELS = [a * AXIS + b * SIDE for a, b in np.random.default_rng(3).normal(size=(20, 2)) * SL * 1.5]


@pytest.mark.parametrize("q", TRAVELS)
def test_friction_law(q):
    """Elastic below sl, on the ellipse (F_a/mu_a)^2 + (F_l/mu_l)^2 = N^2 beyond; against the travel; in the plane."""
    f, g, _, left = rub(q)
    cone = math.hypot(f @ AXIS / MU_A, f @ SIDE / MU_L) / N
    size = np.linalg.norm(q)
    assert cone == pytest.approx(min(size / SL, 1.0), rel=1e-12)
    assert_within(abs(f @ NORMAL), ROUND_OFF * N)
    assert f @ q < 0.0
    assert np.linalg.norm(left) == pytest.approx(min(size, SL), rel=1e-12)
    assert_within(np.abs(rub(left)[0] - f).max(), ROUND_OFF * N)  # what is left explains the force
    assert_within(np.abs(f - N * g).max(), ROUND_OFF * N)


@pytest.mark.parametrize("q", TRAVELS)
def test_friction_derivatives(q):
    _, g, D, _ = rub(q)
    for e, column in zip(np.eye(3), D.T, strict=True):
        if abs(np.linalg.norm(q) - SL) < 3e-6:
            continue
        assert np.abs(column - slope(lambda x, e=e: rub(q + x * e)[0], 0.0, 1e-6)).max() <= 1e-6 * N / SL
    assert_within(np.abs(g - slope(lambda x: rub(q, x)[0], N, 1e-2)).max(), DIFFERENCE)


def test_friction_along_and_across():
    """mu N along and across, each with its own coefficient, and the direction of sliding for both."""
    assert rub(50 * SL * AXIS)[0] == pytest.approx(-MU_A * N * AXIS, abs=1e-12 * N)
    assert rub(-50 * SL * SIDE)[0] == pytest.approx(MU_L * N * SIDE, abs=1e-12 * N)


def dragged(path, press):
    """Work (J) done on friction along a path (n, 3) of positions pressed by press (n,) N: by trapezoids."""
    q, work, before = np.zeros(3), 0.0, np.zeros(3)
    for a, b, n in zip(path, path[1:], press[1:], strict=False):
        f, _, _, q = rub(q + b - a, n)
        work -= 0.5 * (f + before) @ (b - a)
        before = f
    return work


@pytest.mark.parametrize("seed", range(5))
def test_friction_takes_energy_on_every_closed_path(seed):
    """Pressed evenly, from rest to rest, along closed paths large and small against the elastic travel."""
    g = np.random.default_rng(seed)
    t = np.linspace(0.0, 2 * math.pi, 4001)
    size = SL * 10.0 ** g.uniform(-1, 1.5)
    a, b = (sum(g.normal() * np.sin(k * t + g.uniform(0, 6)) for k in (1, 2, 3)) for _ in range(2))
    path = size * (np.outer(a - a[0], AXIS) + np.outer(b - b[0], SIDE))
    path = np.vstack([path, path, path])  # three rounds
    work = dragged(path, np.full(len(path), N))
    assert work >= -1e-9 * N * size
    if size > 5 * SL:
        assert work > 0.0


def test_friction_pressed_unevenly_gives_back_no_more_than_it_can_store():
    """Stretched when pressed little and released when pressed much, the elastic travel gives energy.

    A travel that sticks while the pressure changes stores mu N sl/2 at most: that bounds what a round can give, and it
    is small by the choice of sl (1 % of the diameter).  Two-sided: were it zero, this note would be out of date.
    """
    path = np.array([0.0, 1.0, 1.0, 0.0])[:, None] * 0.9 * SL * AXIS
    given = -dragged(path, np.array([N, N, 10 * N, 10 * N]))
    # trapezoids: (0 + f1)/2 sl on the way out, (f2 + 0)/2 on the way back
    most = 0.5 * MU_A * (10 * N - N) * SL
    print(f"given back: {given:.2e} J of at most {most:.2e} J")
    assert 0.0 < given <= most


# --- waves of finite height ----------------------------------------------------------------------


def test_steady_wave_of_a_published_case():
    """H 0.25 m, d 0.5 m, length 2 m, 20 harmonics, as raschii's own test: crest and velocity under it at y = 0.2 m.

    raschii ends its iteration at 1e-7 or so, and gives 0.67352456 m and 0.27263788 m/s.
    """
    wave = steady_wave(0.25, 0.5, 9.81, 20, length=2.0)
    j = np.arange(1, 21)
    assert 0.5 + wave.elevation.sum() == pytest.approx(0.67352456, abs=1e-7)
    u = np.sum(wave.stream * np.cosh(j * wave.k * 0.2) / np.cosh(j * wave.k * 0.5))
    assert u == pytest.approx(0.27263788, rel=1e-6)


def test_steady_wave_of_fenton_s_program():
    """H/d 0.3, T 10 sqrt(d/g): length, speed, B_j and E_j as its output prints them, and no Eulerian current."""
    wave = steady_wave(0.3, 1.0, 1.0, 20, period=10.0)
    assert 2 * math.pi / wave.k == pytest.approx(9.6897, abs=5e-5)
    assert wave.speed == pytest.approx(0.9690, abs=5e-5)
    B = wave.stream / (np.arange(1, 21) * wave.k) * wave.k**1.5
    np.testing.assert_allclose(B[:4], [1.1499699e-1, 1.7651940e-2, 2.4828287e-3, 2.5065983e-4], rtol=1e-6)
    E = [8.8912241e-2, 2.7443980e-2, 7.5955668e-3, 2.1863966e-3]
    np.testing.assert_allclose(wave.elevation[:4] * wave.k, E, rtol=1e-6)


@pytest.mark.parametrize("depth", [math.inf, 30.0, 9.0])
def test_steady_waves_as_the_line_feels_them(depth):
    """At its surface the water moves with the wave (kinematic condition), and Bernoulli's constant is one.

    Both from what kernels say of velocity and elevation at places all along the wave, up to the crest.
    """
    sea = StreamFunctionWaves(height=3.0, period=7.0, direction=25.0, phase=40.0, order=25)
    steady = sea.steady(depth, G)
    values = with_waves(
        no_sea(0)._replace(surface=2.0, ramps=np.zeros(2)), components(sea, depth, G), depth, steady.orbits
    )
    around = Surroundings(values)
    towards, c = np.array([math.cos(math.radians(25.0)), math.sin(math.radians(25.0))]), steady.speed
    heads = []
    for x in np.linspace(0.0, 2 * math.pi / steady.k, 13):
        place = x * towards
        eta, rate, *slopes = around.elevation(*place, 1.3)
        u = stirred(around, 1.3, (*place, 2.0 + eta))[0]
        assert u[6] == pytest.approx(eta, abs=1e-12)
        level = u[:2] @ towards
        assert abs(u[0] * towards[1] - u[1] * towards[0]) < 1e-12
        assert u[2] == pytest.approx(rate + u[:2] @ slopes, abs=2e-3 * steady.stream[0])
        heads.append(0.5 * ((level - c) ** 2 + u[2] ** 2) + G * eta)
        a = (stirred(around, 1.3001, (*place, 1.0))[0, :3] - stirred(around, 1.2999, (*place, 1.0))[0, :3]) / 2e-4
        if eta > -0.9:
            np.testing.assert_allclose(stirred(around, 1.3, (*place, 1.0))[0, 3:6], a, atol=1e-5)
    assert np.ptp(heads) < 1e-3 * G * 3.0
    heights = [around.elevation(0.0, 0.0, t)[0] for t in np.linspace(0.0, 7.0, 201)]
    assert np.ptp(heights) == pytest.approx(3.0, rel=2e-3) and max(heights) > 1.55


def test_low_steady_waves_are_linear():
    low = StreamFunctionWaves(height=1e-4, period=7.0, direction=25.0, phase=40.0)
    linear = components(RegularWaves(height=1e-4, period=7.0, direction=25.0, phase=40.0), 12.0, G)
    found = components(low, 12.0, G)
    np.testing.assert_allclose(found[0], linear[0], rtol=1e-5)
    assert low.steady(12.0, G).orbits[0] == pytest.approx(linear[0, 0] * linear[0, 1], rel=1e-5)
    assert np.abs(found[1:, 0]).max() < 1e-4 * linear[0, 0]
