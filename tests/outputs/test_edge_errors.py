"""What cells miss of a curvature with a kink in one of them."""

from __future__ import annotations

import numpy as np
import pytest

from hybrid.outputs.edge_errors import kink_missed

S = np.array([-2.3, -1.2, -0.4, 0.5, 1.4, 2.6])  # m, the kink is at 0
AT = np.linspace(-0.4, 0.5, 19)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_kink_between_two_nodes_is_found(sign: float) -> None:
    """Straight before and after it, exactly; where it bends after it as well, less than that by what it bends."""

    def off(curve) -> np.ndarray:
        return np.abs(np.interp(AT, S, curve(S)) - curve(AT))

    def kinked(s: np.ndarray) -> np.ndarray:
        return sign * (0.2 * s + 3.0 * np.maximum(s, 0.0))

    np.testing.assert_allclose(kink_missed(S, kinked(S), AT), off(kinked), atol=1e-12)

    def bent(s: np.ndarray) -> np.ndarray:
        return sign * np.where(s > 0.0, 3.0 * s - 0.2 * s * s, 0.0)

    assert 0.7 < kink_missed(S, bent(S), AT).max() / off(bent).max() < 1.3


@pytest.mark.parametrize("curve", [np.sin, np.square, lambda s: np.maximum(s - 0.9, 0.0), lambda s: 0.0 * s])
def test_without_a_kink_in_that_cell_nothing_is_missed(curve) -> None:
    assert kink_missed(S, curve(S), AT).max() < 0.02
