"""Where what the caller of `hybrid.couple.moordyn` moves is: turned bodies, and decks that have no lines at all."""

from __future__ import annotations

import numpy as np

from hybrid.interop.moordyn.bodies import rotation_of
from hybrid.kernels.state.state import Floats
from hybrid.model.bodies import frame_of
from hybrid.simulation.stepped import CableState
from hybrid.simulation.stepped_points import PointState


def frame_of_angles(angles: Floats) -> Floats:
    """Axes (3, 3) of a body at angles (rad) as MoorDyn has them: about x, then the turned y, then the turned z."""
    x, y, z = np.degrees(angles).tolist()
    return frame_of(rotation_of((x, y, z)))


def spin_of_rates(angles: Floats, rates: Floats) -> Floats:
    """Angular velocity (3,) 1/s of a body at angles (rad) that change at rates (rad/s).

    MoorDyn takes the rates for it, which is the same for one angle and for small ones.
    """
    one = np.zeros(3)
    one[0] = angles[0]
    two = one.copy()
    two[1] = angles[1]
    about_y, about_z = frame_of_angles(one)[:, 1], frame_of_angles(two)[:, 2]
    return np.asarray(rates[0] * np.array([1.0, 0.0, 0.0]) + rates[1] * about_y + rates[2] * about_z)


class PlacesAlone:
    """A deck without lines in motion: points are where they are put, and nothing pulls at them."""

    def __init__(self, places: dict[str, tuple[Floats, Floats]]) -> None:
        """places: position and velocity (3,) of all points, by name."""
        self.t, self._places = 0.0, dict(places)

    def set_point(self, name: str, position: Floats, velocity: Floats) -> None:
        self._places[name] = np.array(position), np.array(velocity)

    def advance(self, until: float) -> None:
        self.t = until

    def point(self, name: str) -> PointState:
        position, velocity = self._places[name]
        return PointState(position, velocity, np.zeros(3))

    def line(self, name: str) -> CableState:
        raise ValueError(f"line {name}: the deck has none")

    def close(self) -> None:
        self._places.clear()
