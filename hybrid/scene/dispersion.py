"""How long linear waves are: the dispersion relation."""

from __future__ import annotations

import math

# Newton's method on the dispersion relation gains digits quadratically from a start within 5 %.
_MOST_ITERATIONS = 20
# Values of omega^2 depth / gravity beyond which tanh(k depth) is 1, or k depth, to round-off.
_DEEP, _SHALLOW = 20.0, 1e-16


def wavenumber(omega: float, depth: float | None, gravity: float) -> float:
    """Wavenumber k > 0 [1/m] of a linear wave: omega^2 = gravity k tanh(k depth), to round-off.

    omega: angular frequency > 0 [rad/s]; depth [m], None for deep water; gravity > 0 [m/s^2].
    """
    deep = omega * omega / gravity
    if depth is None or deep * depth > _DEEP:
        return deep
    q = deep * depth
    if q < _SHALLOW:
        return omega / math.sqrt(gravity * depth)
    y = q / math.sqrt(math.tanh(q))  # Eckart (1952): k depth within 5 %
    for _ in range(_MOST_ITERATIONS):
        t = math.tanh(y)
        change = (y * t - q) / (t + y * (1.0 - t * t))
        y -= change
        if abs(change) <= 1e-15 * y:
            break
    return y / depth
