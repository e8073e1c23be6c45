"""Limits of sections against the envelope of a result."""

from __future__ import annotations

import numpy as np
import pytest

from hybrid.store.envelope import judged


def envelope(tension: list[float]) -> dict[str, np.ndarray]:
    """An envelope of five nodes with the largest tensions, N, that are allowed 100 N at the last three."""
    values = {"s": np.arange(5.0), "max_tension": np.array([np.nan, np.nan, 100.0, 100.0, 100.0])}
    values |= {"tension_max": np.array(tension), "tension_t_max": np.arange(5.0) + 1.0}
    return {f"envelope/{name}": x for name, x in values.items()}


def test_what_stays_on_a_reel_does_not_hide_a_broken_limit() -> None:
    (found,) = judged(envelope([120.0, 110.0, 130.0, 90.0, np.nan]))
    assert found.broken and found.value == 130.0 and found.used == pytest.approx(1.3)
    assert (found.s, found.t) == (2.0, 3.0)


def test_a_limit_without_a_value_is_not_judged() -> None:
    assert judged(envelope([120.0, 110.0, np.nan, np.nan, np.nan])) == []
