"""A line in deep water costs as much per cell and step as a short one.

pytest bench -m bench -s -k deep
"""

from __future__ import annotations

from statistics import median

import pytest
from peers.hybrid_touchdown import described

import hybrid

pytestmark = pytest.mark.bench
RUNS = 5


def deep(length, depth, span, cells, duration):
    """The touchdown scene, longer and deeper."""
    scene = described(cells, 0.0, 0.1, ())
    scene["environment"]["seabed"]["z"] = -depth
    scene["cable"]["sections"][0]["length"] = length
    scene["ends"]["start"]["position"] = (0, 0, -depth)
    scene["ends"]["end"]["position"] = (span, 0, 0)
    scene["time"]["duration"] = duration
    return hybrid.validate_scene(scene | {"output": {"every": duration}})


def cost(*what):
    """Microseconds per cell and step, of whole runs with their log; iterations per step."""
    each = []
    for _ in range(RUNS):
        result = hybrid.run(deep(*what))
        cpu = result.steps["cpu"]
        each.append(1e6 * (cpu[-1] - cpu[0]) / (len(cpu) - 1) / what[3])
    return median(each), result.steps["iterations"].mean()


def test_deep_water_costs_no_more():
    short, few = cost(250, 100, 205, 1000, 30.0)
    long, many = cost(2500, 2000, 1300, 1000, 30.0)
    finest, most = cost(2500, 2000, 1300, 4000, 10.0)
    print(f"\n 250 m in  100 m, 1000 cells: {short:.3f} us per cell and step ({few:.2f} iterations)")
    print(
        f"2500 m in 2000 m, 1000 cells: {long:.3f} us per cell and step ({many:.2f} iterations), ratio {long / short:.2f}"
    )
    print(f"2500 m in 2000 m, 4000 cells: {finest:.3f} us per cell and step ({most:.2f} iterations)")
    assert 0.5 <= long / short <= 1.2  # cheaper where the same heave is a smaller motion: fewer iterations
    assert finest <= 1.5
