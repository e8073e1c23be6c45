"""The law of drag (Morison) in plain Python: kernels compile it (loads.py), and the first shape calls it with arrays.

Symbols as in kernels.laws.water; vectors are tuples of numbers or of arrays.  It runs on complex numbers too.
"""

from __future__ import annotations

from typing import Any


def split(u: Any, d: Any) -> Any:
    """The tangential part ut of a velocity, the normal part un, and the square of its size."""
    ut = u[0] * d[0] + u[1] * d[1] + u[2] * d[2]
    un = (u[0] - ut * d[0], u[1] - ut * d[1], u[2] - ut * d[2])
    return ut, un, un[0] * un[0] + un[1] * un[1] + un[2] * un[2]


def half_cell(ut: Any, un: Any, size_t: Any, size_n: Any, d: Any, cn: Any, ct: Any) -> Any:
    """f = -cn |un| un - ct |ut| ut d, with sizes |ut| and |un|; and p = cn |un|, q = ct |ut| ut."""
    p, q = cn * size_n, ct * size_t * ut
    return (-p * un[0] - q * d[0], -p * un[1] - q * d[1], -p * un[2] - q * d[2]), p, q


def body(u: Any, size: Any, c: Any) -> Any:
    """f = -c |u| u of a body without direction, with size |u|; and p = -c |u|."""
    p = -c * size
    return (p * u[0], p * u[1], p * u[2]), p
