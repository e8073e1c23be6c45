"""What a review that changes zones and the switch that follows cost, on the touchdown line in space.

    pytest bench/test_bench_switch.py -m bench -n 0 -s

Times by the wall clock, us: the smallest and the median of all switches of three runs, which other programs on the
machine lengthen, and the first switch of a run, which makes the tables.
"""

from __future__ import annotations

from collections.abc import Callable
from time import perf_counter
from typing import Any

import numpy as np
import pytest
from test_bench_zones import MESHES, SHARE, run, touchdown

from hybrid.adapt.manager import DomainManager
from hybrid.simulation.transient import Transient

pytestmark = pytest.mark.bench
ROUNDS = 3


def timed(call: Callable[..., Any], into: list[float]) -> Callable[..., Any]:
    """The same, with the time (us) that it takes at the end of a list."""

    def with_time(*given: Any) -> Any:
        begin = perf_counter()
        found = call(*given)
        into.append(1e6 * (perf_counter() - begin))
        return found

    return with_time


@pytest.mark.parametrize("mesh", MESHES)
def test_switch(mesh: str, monkeypatch: pytest.MonkeyPatch) -> None:
    reviews, switches, first = list[float](), list[float](), list[float]()
    monkeypatch.setattr(DomainManager, "review", timed(DomainManager.review, reviews))
    monkeypatch.setattr(Transient, "_switch", timed(Transient._switch, switches))
    text = touchdown(True)
    for _ in range(ROUNDS + 1):  # the first compiles
        begin = len(switches)
        run(text, MESHES[mesh], {"kind": "adaptive"}, SHARE)
        first.append(switches.pop(begin))
    print(f"\n{mesh}: us, smallest and median; a review that changes zones or may, a switch; the first of a run")
    for name, x in (("review", reviews), ("switch", switches), ("first switch", first[1:])):
        print(f"  {name:14s} {np.min(x):6.0f} {np.median(x):6.0f}  of {len(x)}")
