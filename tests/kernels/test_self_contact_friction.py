"""Friction of a line on itself: what it keeps, what it never gives back, its slopes, rigid motions."""

from __future__ import annotations

import numpy as np
import pytest
from test_self_contact_kernels import SHAPES, WIDTH, Tangle

from hybrid.kernels.contact.self_contact import hold_points
from hybrid.kernels.contact.self_contact_law import (
    FORCE,
    HELD,
    NORMAL,
    SLIDES,
    SPRING,
    TRAVEL,
    TRY,
    add_held,
    add_held_product,
    keep_grips,
    link_grips,
)
from hybrid.kernels.machine.compile import kernel

MU = 0.3


@kernel
def hold(line, contact):
    hold_points(line, contact)


@kernel
def held(line, contact, out):
    for k in range(contact.counts.points):
        add_held(contact, k, out)


@kernel
def held_product(line, contact, x, out):
    for k in range(contact.counts.points):
        add_held_product(contact, k, x, out)


@kernel
def keep(line, contact):
    count = contact.counts.points
    keep_grips(line, contact, count)
    contact.counts.fresh, contact.counts.grips = count, count
    for k in range(count):
        for j in range(contact.grips.shape[1]):
            contact.grips[k, j] = contact.fresh[k, j]
    link_grips(contact, count)


class Rubbing(Tangle):
    """A tangle with friction; uneven: of diameters that differ from piece to piece, which share their distance."""

    def __init__(self, name: str, uneven: bool = False) -> None:
        super().__init__(SHAPES[name], friction=MU)
        self.parts = self.contact.contact
        if uneven:
            self.parts.width[:] *= 0.995 + 0.005 * np.cos(np.arange(self.parts.width.size))
        self.energy(np.zeros_like(self.r))
        assert self.count > 1

    @property
    def rows(self) -> np.ndarray:
        return self.parts.points[: self.count]

    @property
    def holds(self) -> np.ndarray:
        return self.parts.holds[: self.count]

    def move(self, x: np.ndarray) -> np.ndarray:
        """Friction (N+1, 4), with the opposite sign, of shifts and spins x (N+1, 4) from where it is."""
        self.parts.x[:] = x
        hold(self.line, self.parts)
        out = np.zeros((len(self.r), 4))
        held(self.line, self.parts, out)
        return out


def shifts(tangle: Rubbing, size: float, seed: int = 5) -> np.ndarray:
    x = size * WIDTH * np.random.default_rng(seed).normal(size=(len(tangle.r), 4))
    x[:, 3] /= WIDTH
    return x


@pytest.mark.long
@pytest.mark.parametrize("uneven", [False, True], ids=["even", "uneven"])
@pytest.mark.parametrize("name", SHAPES)
@pytest.mark.parametrize("size", [1e-7, 0.3], ids=["sticks", "slides"])
def test_forces_and_moments_add_up_to_nothing(name: str, size: float, uneven: bool) -> None:
    tangle = Rubbing(name, uneven)
    out = tangle.move(shifts(tangle, size))
    slides = tangle.holds[:, SLIDES] > 0.0
    assert not slides.any() if size < 1e-3 else slides.any()
    scale = np.abs(out[:, :3]).sum()
    assert scale > 0.0 and np.abs(out[:, :3].sum(axis=0)).max() < 1e-14 * scale
    d = np.diff(tangle.r, axis=0)
    d /= np.linalg.norm(d, axis=1)[:, None]
    moment = np.cross(tangle.r, out[:, :3]).sum(axis=0) + (out[:-1, 3:] * d).sum(axis=0)
    assert np.abs(moment).max() < 1e-13 * scale * np.abs(tangle.r).max()
    without = np.cross(tangle.r, out[:, :3]).sum(axis=0)
    assert np.abs(without).max() > 1e-6 * scale * WIDTH  # the moments along the chords are needed


@pytest.mark.parametrize("name", SHAPES)
def test_it_is_coulomb_at_most_along_the_way(name: str) -> None:
    tangle = Rubbing(name)
    tangle.move(shifts(tangle, 0.01))
    forces, normal = tangle.holds[:, HELD : HELD + 3], -tangle.rows[:, FORCE]
    size = np.linalg.norm(forces, axis=1)
    slides = tangle.holds[:, SLIDES] > 0.0
    assert slides.any()
    assert (size <= MU * normal * (1.0 + 1e-12)).all()
    np.testing.assert_allclose(size[slides], MU * normal[slides], rtol=1e-12)
    travel = np.linalg.norm(tangle.holds[:, TRAVEL : TRAVEL + 2], axis=1)
    np.testing.assert_allclose(size, tangle.rows[:, SPRING] * travel, rtol=1e-12, atol=1e-30)
    across = np.einsum("ij,ij->i", forces, tangle.rows[:, NORMAL : NORMAL + 3])
    assert np.abs(across).max() < 1e-13 * size.max()


@pytest.mark.long
@pytest.mark.parametrize("uneven", [False, True], ids=["even", "uneven"])
@pytest.mark.parametrize("name", SHAPES)
@pytest.mark.parametrize("size", [1e-7, 0.01, 0.3], ids=["sticks", "slides", "slides far"])
def test_its_stiffness_is_its_derivative(name: str, size: float, uneven: bool) -> None:
    """With directions, feet, arms and the force across that change, and a travel from before that turns with strand p."""
    tangle = Rubbing(name, uneven)
    tangle.move(shifts(tangle, 3e-6, seed=4))
    assert not (tangle.holds[:, SLIDES] > 0.0).any()  # one that has slid is between sticking and sliding
    keep(tangle.line, tangle.parts)
    x, y = shifts(tangle, size), shifts(tangle, 1e-6, seed=6)

    def moved(y: np.ndarray) -> np.ndarray:
        tangle.energy(y[:, :3])
        tangle.holds[:, TRY] = -1.0  # of another try: nothing has turned back
        return tangle.move(x + y)

    slope = 0.5 * (moved(y) - moved(-y))
    moved(0.0 * y)
    slides = tangle.holds[:, SLIDES] > 0.0
    assert slides.any() if size > 1e-3 else not slides.any()
    out = np.zeros_like(x)
    held_product(tangle.line, tangle.parts, y, out)
    assert np.abs(out - slope).max() < 1e-7 * np.abs(slope).max()


@pytest.mark.parametrize("uneven", [False, True], ids=["even", "uneven"])
@pytest.mark.parametrize("name", SHAPES)
def test_a_rigid_motion_rubs_nothing(name: str, uneven: bool) -> None:
    tangle = Rubbing(name, uneven)
    axis, angle = np.array([0.48, 0.6, 0.64]), 1e-4
    turn = angle * np.cross(axis, tangle.r) + 0.7 * WIDTH  # and a shift
    d = np.diff(tangle.r, axis=0)
    d /= np.linalg.norm(d, axis=1)[:, None]
    spin = np.append(angle * d @ axis, 0.0)
    tangle.move(np.column_stack([turn, spin]))
    assert np.abs(tangle.holds[:, TRAVEL : TRAVEL + 2]).max() < 1e-12 * WIDTH


@pytest.mark.parametrize("name", SHAPES)
def test_nothing_is_gained_and_nothing_creeps(name: str) -> None:
    """Whatever shifts follow each other and however the force across changes, energy is only lost."""
    tangle, random = Rubbing(name), np.random.default_rng(3)
    across, stored, lost = tangle.rows[:, FORCE].copy(), 0.0, 0.0
    for step in range(40):
        tangle.rows[:, FORCE] = across * random.uniform(0.2, 3.0, across.size)
        tangle.move(shifts(tangle, 10.0 ** random.uniform(-5.0, -2.0), seed=step))
        numbers = tangle.parts.numbers
        gained = numbers.slip_work + numbers.tried - stored
        assert gained <= 1e-12 * (abs(numbers.slip_work) + stored)
        stored, lost = numbers.tried, lost - gained
        keep(tangle.line, tangle.parts)
    assert lost > 0.0 and stored > 0.0
    tangle.rows[:, FORCE] = 10.0 * across  # sticks
    travel = tangle.holds[:, TRAVEL : TRAVEL + 2].copy()
    for _ in range(20):
        tangle.move(np.zeros((len(tangle.r), 4)))
        keep(tangle.line, tangle.parts)
    np.testing.assert_allclose(tangle.holds[:, TRAVEL : TRAVEL + 2], travel, rtol=1e-12)
    assert tangle.parts.numbers.friction == MU
