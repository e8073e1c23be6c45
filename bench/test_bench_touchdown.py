"""The touchdown scene in this code and in its peers, in one run, alternating.

    pip install -e ".[dev,bench]"
    pytest bench -m bench -s -k touchdown

Every contestant runs ROUNDS times, each time in a process of its own, one after the other; CPU seconds are those of
the time loop alone, the median of the rounds counts.  Peers get the best settings found for them (peers/measure.py
has the search), and are skipped when they are not installed.  Errors are those of the top tension over the last
three periods against what MoorDyn with 800 and CableDyn with 400 elements agree on.
"""

from __future__ import annotations

import functools
from statistics import median

import pytest
from peers.measure import FINE, HEAD, LEAN, LOOSE, LOW, PEERS, elsewhere, row

pytestmark = pytest.mark.bench
ROUNDS = 3

CONTESTANTS = {
    "ours, catenary": ("hybrid", 60, 0.0, {"dt": 0.25}),
    "ours, catenary, same mesh and step": ("hybrid", 100, 0.0, {}),
    "ours, rod": ("hybrid", 100, 2e3, {"dt": 0.25}),
    "ours, rod, same mesh and step": ("hybrid", 100, 2e3, {}),
    "ours, zones": ("hybrid", 36, 2e3, {"dt": 0.25, "zones": FINE}),
    "ours, lean zones": ("hybrid", 32, 2e3, {"dt": 0.4, "zones": LEAN}),
    "CableDyn, EI 0": ("CableDyn", 100, 0.0, {}),
    "CableDyn, EI 0, at its best": ("CableDyn", 100, 0.0, {"options": LOOSE}),
    "CableDyn, EI": ("CableDyn", 100, 2e3, {}),
    "CableDyn, EI, at its best": ("CableDyn", 100, 2e3, {"options": LOW}),
    "MoorDyn, at its best": ("MoorDyn", 200, 0.0, {"scheme": "RK2", "dt": 3.5e-4, "couple": 1.4e-3, "damping": -0.5}),
    "Exudyn, EI 0": ("Exudyn", 100, 0.0, {"radius": 0.2}),
    "Exudyn, EI": ("Exudyn", 100, 2e3, {}),
}
# ours, theirs, and how many times faster the project asks ours to be at no worse accuracy
DUELS = (
    ("ours, catenary", "CableDyn, EI 0", 8.0),
    ("ours, catenary, same mesh and step", "CableDyn, EI 0", 8.0),
    ("ours, catenary, same mesh and step", "CableDyn, EI 0, at its best", 4.0),
    ("ours, catenary", "CableDyn, EI 0, at its best", 4.0),
    ("ours, rod", "CableDyn, EI", 10.0),
    ("ours, zones", "CableDyn, EI", 30.0),
    ("ours, lean zones", "CableDyn, EI", 30.0),
    ("ours, lean zones", "CableDyn, EI, at its best", 30.0),
    ("ours, catenary", "MoorDyn, at its best", 60.0),
    ("ours, catenary", "Exudyn, EI 0", 8.0),
    ("ours, rod", "Exudyn, EI", 8.0),
)


@functools.cache
def table():
    """Errors (%) and median CPU seconds of the loop of every contestant that is installed."""
    there = {name: run for name, run in CONTESTANTS.items() if PEERS[run[0]].available()}
    rounds = [{name: elsewhere(run) for name, run in there.items()} for _ in range(ROUNDS)]
    out = {}
    print(f"\n{HEAD}")
    for name, run in there.items():
        found = rounds[0][name] | {"loop": median(r[name]["loop"] for r in rounds)}
        out[name] = found
        print(row(run, found))
    return out


@pytest.mark.parametrize("name", [x for x in CONTESTANTS if x.startswith("ours")])
def test_accuracy(name):
    """Mean within 0.1 %, peak within 0.3 %, minimum within 1 %, as the project is held to."""
    _, mean, peak, minimum = table()[name]["errors"]
    assert abs(mean) <= 0.1
    assert abs(peak) <= 0.3
    assert abs(minimum) <= 1.0


@pytest.mark.parametrize(("ours", "theirs", "times"), DUELS)
def test_speed(ours, theirs, times):
    found = table()
    if theirs not in found:
        pytest.skip(f"{theirs.split(',')[0].lower()} is not installed: pip install -e '.[bench]'")
    a, b = found[ours], found[theirs]
    words = [
        f"{what} {x:+.2f} / {y:+.2f} %"
        for what, x, y in zip(("mean", "peak", "min"), a["errors"][1:], b["errors"][1:], strict=True)
    ]
    print(f"\n{ours} against {theirs}: {b['loop'] / a['loop']:.1f} times faster; {', '.join(words)}")
    assert b["loop"] / a["loop"] >= times
