"""Contact of a line with itself: derivatives against differences, what its forces keep, limits of corrections."""

from __future__ import annotations

import numpy as np
import pytest

from hybrid.kernels.contact import self_contact as k
from hybrid.kernels.contact.self_contact_law import DISTANCE, INNER, NORMAL, OUTER, POINT, add_gradient, add_product
from hybrid.kernels.machine.compile import kernel
from hybrid.kernels.run.newton import workspace
from hybrid.kernels.state.books import blank_books
from hybrid.kernels.state.state import blank_line, blank_state, no_ends
from hybrid.kernels.step.line_step import ASKED, PREDICT, SAFE_PART, STAND
from hybrid.outputs.observation import Lines
from hybrid.solve.contact import SelfContact

WIDTH = 0.1


@kernel
def gradient(points, count, out):
    for i in range(count):
        add_gradient(points[i], out)


@kernel
def product(points, count, x, out):
    for i in range(count):
        add_product(points[i], x, out)


class Tangle:
    """A line at rest with nodes at r (N+1, 3) m, and its contact."""

    def __init__(self, r: np.ndarray, width: float = WIDTH, friction: float = 0.0) -> None:
        n = len(r) - 1
        self.r, h = r, np.linalg.norm(np.diff(r, axis=0), axis=1)
        line = blank_line(n)._replace(
            h=h,
            s=np.append(0.0, np.cumsum(h)),
            kb=np.ones((n + 1, 3)),
            hn=np.full(n + 1, h.mean()),
            mass=np.ones(n + 1),
            spin=np.ones(n, np.int8),
        )
        self.line = line
        states = (blank_state(n), blank_state(n))
        for state in states:
            state.r[:] = r
        self.work = workspace(n, keep=True)
        self.contact = SelfContact(line, np.full(n, width), np.ones(n), 1.0, friction)
        ends = no_ends()
        ends.held[:] = 0
        books = blank_books(n)._replace(touch=np.zeros((3, n + 1)))
        self.clock = books.clock
        self.states = states
        self.table = self.contact.attach(line, ends, states, self.work, books)

    def energy(self, u: np.ndarray) -> float:
        """Energy (J) with the nodes displaced by u, m; the points of contact are then those."""
        self.work.u[:] = u
        self.contact.call[ASKED] = STAND
        return k.contact_task(self.table)

    @property
    def count(self) -> int:
        return int(self.contact.contact.counts.points)

    def gradient(self, u: np.ndarray) -> np.ndarray:
        self.energy(u)
        out = np.zeros_like(self.r)
        gradient(self.contact.contact.points, self.count, out)
        return out

    def limit(self, x: np.ndarray) -> float:
        """The safe part of a correction x (m)."""
        self.energy(np.zeros_like(self.r))
        self.work.x[:, 1:4] = x
        self.contact.call[ASKED] = SAFE_PART
        return k.contact_task(self.table)

    def speed(self, x: np.ndarray) -> float:
        """What is found in the limit of a correction x (m) of pieces that may come into contact, m."""
        self.states[0].v[:] = x
        self.clock.try_end, self.work.u[:] = 1.0, 0.0
        self.contact.call[ASKED] = PREDICT
        k.contact_task(self.table)
        return float(self.contact.contact.numbers.speed)


def crossing(gap: float, angle: float = 70.0, seed: int = 0) -> np.ndarray:
    """A bent line whose two legs cross at an angle (deg), `gap` diameters apart; nodes shaken a little."""
    random = np.random.default_rng(seed)
    x, a = np.linspace(-1.0, 1.0, 21), np.radians(angle)
    first = np.column_stack([x, 0.05 * x**2, np.zeros(21)])
    second = np.column_stack([-x * np.cos(a), -x * np.sin(a) + 0.013, np.full(21, gap * WIDTH)])
    bow = np.linspace(0.0, 1.0, 14)[1:-1, None]
    way = first[-1] * (1.0 - bow) + second[0] * bow + np.array([1.0, 0.5, 0.3]) * 4.0 * bow * (1.0 - bow)
    r = np.vstack([first, way, second])
    return r + 1e-3 * random.normal(size=r.shape)


def plectoneme(turns: int = 3, cells: int = 60) -> np.ndarray:
    """Two strands wound about each other, joined at one end."""
    t = np.linspace(0.0, 1.0, cells // 2)
    up = np.column_stack(
        [0.48 * WIDTH * np.cos(2 * np.pi * turns * t), 0.48 * WIDTH * np.sin(2 * np.pi * turns * t), 1.2 * t]
    )
    down = (up * [-1.0, -1.0, 1.0])[::-1]
    bow = np.linspace(0.0, np.pi, 12)[1:-1]
    top = np.column_stack([0.1 * np.cos(bow), np.zeros(10), 1.2 + 0.15 * np.sin(bow)])
    return np.vstack([up, top, down])


SHAPES = {
    "crossing": crossing(0.95), "flat": crossing(0.96, angle=25.0), "plectoneme": plectoneme(),
    "oblique": crossing(0.97, angle=35.0, seed=3),
}  # fmt: skip


@pytest.mark.long
@pytest.mark.parametrize("name", SHAPES)
def test_force_and_stiffness_are_derivatives_of_the_energy(name: str) -> None:
    tangle, random = Tangle(SHAPES[name]), np.random.default_rng(1)
    still = np.zeros_like(tangle.r)
    assert tangle.energy(still) > 0.0 and tangle.count > 1
    g = tangle.gradient(still)
    for _ in range(4):
        x = random.normal(size=still.shape)
        e = 1e-7 * WIDTH
        slope = (tangle.energy(e * x) - tangle.energy(-e * x)) / (2.0 * e)
        assert slope == pytest.approx(np.vdot(g, x), rel=1e-6, abs=1e-6 * np.abs(g).max())
        turn = (tangle.gradient(e * x) - tangle.gradient(-e * x)) / (2.0 * e)
        tangle.energy(still)
        out = np.zeros_like(still)
        product(tangle.contact.contact.points, tangle.count, x, out)
        assert np.abs(out - turn).max() < 1e-5 * np.abs(turn).max()


@pytest.mark.parametrize("name", SHAPES)
def test_contact_keeps_momentum_and_angular_momentum(name: str) -> None:
    tangle = Tangle(SHAPES[name])
    g = tangle.gradient(np.zeros_like(tangle.r))
    size = np.abs(g).sum()
    assert np.abs(g.sum(axis=0)).max() < 1e-14 * size
    assert np.abs(np.cross(tangle.r, g).sum(axis=0)).max() < 1e-14 * size * np.abs(tangle.r).max()


@pytest.mark.parametrize("name", SHAPES)
def test_contact_does_not_depend_on_how_a_line_lies(name: str) -> None:
    """Energy, the safe part of a correction, and the speed that the size of the law in collisions follows."""
    random, r = np.random.default_rng(2), SHAPES[name]
    x, far = 0.3 * WIDTH * random.normal(size=r.shape), 1.2 * r + 0.05
    found = []
    for seed in range(6):
        turned = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))[0] if seed else np.eye(3)
        tangle, apart = Tangle(r @ turned.T), Tangle(far @ turned.T)
        parts = tangle.limit(x @ turned.T), apart.limit(x @ turned.T)
        found.append([tangle.energy(np.zeros_like(r)), *parts, apart.speed(x @ turned.T)])
    assert np.allclose(found, found[0], rtol=1e-9)


@pytest.mark.parametrize("end", [0, -1], ids=["first", "last"])
def test_ends_of_a_line_take_part(end: int) -> None:
    """The end of one strand stands on the middle of the other: it is the last half cell that touches."""
    x = np.linspace(-1.0, 1.0, 21)
    leg = np.column_stack([x, np.zeros(21), np.zeros(21)])
    up = np.column_stack([np.zeros(16), np.zeros(16), 0.95 * WIDTH + 0.2 * np.arange(16)])
    bow = np.linspace(0.0, np.pi, 20)[1:-1]
    way = np.column_stack([1.0 - 0.5 * (1.0 - np.cos(bow)), 1.5 * np.sin(bow), 0.5 * (up[-1, 2]) * (1 - np.cos(bow))])
    r = np.vstack([leg, way, up[::-1]])
    tangle = Tangle(r if end else r[::-1].copy())
    g = tangle.gradient(np.zeros_like(r))
    assert tangle.count > 0 and abs(g[end, 2]) > 0.5 * np.abs(g[:, 2]).max()
    assert np.abs(g.sum(axis=0)).max() < 1e-13 * np.abs(g).sum()
    still, shift = np.zeros_like(r), np.random.default_rng(0).normal(size=r.shape)
    slope = (tangle.energy(still + 1e-8 * shift) - tangle.energy(still - 1e-8 * shift)) / 2e-8
    assert slope == pytest.approx(np.vdot(g, shift), rel=1e-5)
    push = np.zeros_like(r)
    push[end, 2] = -WIDTH
    assert 0.0 < tangle.limit(push) < 0.2


def test_no_contact_no_energy() -> None:
    far = Tangle(crossing(OUTER + 0.1))
    assert far.energy(np.zeros_like(far.r)) == 0.0 and far.count == 0


@pytest.mark.parametrize("seed", range(12))
@pytest.mark.parametrize("far", [0.5, 3.0, 40.0])
def test_no_correction_leads_through_the_line(seed: int, far: float) -> None:
    """Strands end up farther apart than where the force is infinite, however large a correction is asked."""
    random = np.random.default_rng(seed)
    tangle = Tangle(crossing(1.0 + 2.0 * random.random(), angle=10.0 + 70.0 * random.random(), seed=seed))
    x = np.zeros_like(tangle.r)
    x[33:, 2] = -far * WIDTH  # the second leg through the first
    x += 0.1 * far * WIDTH * random.normal(size=x.shape)
    part = tangle.limit(x)
    assert 0.0 < part <= 1.0
    for share in np.linspace(0.0, part, 40):
        assert np.isfinite(tangle.energy(share * x))
        assert tangle.r[33:, 2].min() - tangle.r[:21, 2].max() > 0.0  # it began on this side
    if far > 4.0:
        assert part < 1.0
    gaps = (tangle.r + part * x)[43, 2] - (tangle.r + part * x)[10, 2]
    assert gaps > 0.5 * INNER * WIDTH


@pytest.mark.parametrize("name", SHAPES)
def test_points_of_outputs_are_those_of_steps(name: str) -> None:
    """The same places, feet and normals, and some beyond where the law begins, whatever room there is at first."""
    tangle = Tangle(SHAPES[name])
    tangle.energy(np.zeros_like(tangle.r))
    contact, bears = tangle.contact.contact, np.ones(len(tangle.r))
    lines, steps = Lines(contact, tangle.line), contact.points[: tangle.count, : NORMAL + 3]
    seen = lines.points(tangle.r, bears)
    narrow = lines._replace(contact=contact._replace(points=np.zeros((1, POINT))))
    assert np.array_equal(seen, narrow.points(tangle.r, bears)) and len(seen) > tangle.count > 1
    near = seen[seen[:, DISTANCE] < OUTER * WIDTH, : NORMAL + 3]
    assert sorted(near.tolist()) == sorted(steps.tolist())
    assert not len(lines.points(tangle.r, 0.0 * bears))


@pytest.mark.parametrize("cells", [20, 40, 60, 100])
def test_as_many_sample_points_in_every_unit(cells: int) -> None:
    """Pieces of a whole number of quarters of a diameter, lengths in m, mm, km and feet, and one unit in the last place

    longer or shorter: round-off decides nothing.
    """
    counts = set()
    for unit in (1.0, 1e3, 1e-3, 1.0 / 0.3048):
        for length in np.nextafter(2.0 * unit, [0.0, 2.0 * unit, np.inf]):
            line = blank_line(cells)._replace(s=np.linspace(0.0, length, cells + 1), mass=np.ones(cells + 1))
            width = np.full(cells, 0.8 / cells * unit)
            contact = SelfContact(line, width, np.ones(cells), 1.0).contact
            counts |= {int(x) for x in contact.samples[2:-2]}
    assert counts == {10}
