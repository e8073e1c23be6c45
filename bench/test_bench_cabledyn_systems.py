"""hybrid and CableDyn on CableDyn's own decks of several lines: tensions at rest, and with fairleads that heave; what
the deck of three lines costs both, and MoorDyn, by errors of mean, largest and least tension.

    pip install -e ".[dev,bench]"
    pytest bench/test_bench_cabledyn_systems.py -m bench -s

The decks are not in its package but in the folder examples of its repository, Copyright SMI Lab, Inha University, and
contributors, Apache License 2.0 (https://github.com/SMI-Lab-Inha/CableDyn): spread_3line_chain.dat,
spread_4line_chain.dat and connect_weighted_point.dat, here as numbers, with as many segments for both programs.
Fairleads heave alike by 1 m at 8 s (ramp 16 s).  The deck with a free point has no fairleads: it is compared at rest.
"""

from __future__ import annotations

import numpy as np
import pytest
from peers.spread_mooring import (
    DENSITY,
    EVERY,
    GRAVITY,
    PERIOD,
    R4_155,
    SPREADS,
    STEP,
    cabledyns,
    deck,
    figures,
    hybrids,
    model_of,
    moordyns,
    section,
)

import hybrid

pytestmark = pytest.mark.bench
MEAN, PEAK = 0.5, 2.0  # per cent: figures that are asked for


@pytest.mark.parametrize("name", SPREADS)
def test_a_spread_mooring_pulls_as_in_cabledyn(name: str) -> None:
    pytest.importorskip("cabledyn")
    (mine, _), (other, _) = hybrids(SPREADS[name]), cabledyns(SPREADS[name])
    last = round(2 * PERIOD / EVERY)
    rest = 100.0 * (other[0] / mine[0] - 1.0)
    mean, most, least = (100.0 * (f(other[-last:]) / f(mine[-last:]) - 1.0) for f in (np.mean, np.max, np.min))
    print(f"\n| {name} | {mine[0] / 1e3:.2f} kN | {rest:+.3f} % | {mean:+.3f} % | {most:+.3f} % | {least:+.3f} % |")
    assert max(abs(rest), abs(mean)) < MEAN and max(abs(most), abs(least)) < PEAK


# Steps (s) of each program, the last one the reference for its own errors; times are medians of so many runs.
LADDERS: dict[str, tuple[float, ...]] = {
    "hybrid": (0.2, 0.1, 0.05, 0.025, 0.00625), "CableDyn": (0.1, 0.05, 0.025, 0.00625), "MoorDyn": (4e-3, 2e-3, 5e-4),
}  # fmt: skip
ROUNDS = 5


def test_what_a_mooring_of_three_lines_costs() -> None:
    """Whole runs of hybrid with a file, against whole runs of the others: each row beside those as exact or better."""
    pytest.importorskip("cabledyn")
    pytest.importorskip("moordyn")
    programs = {"hybrid": hybrids, "CableDyn": cabledyns, "MoorDyn": moordyns}
    error: dict[tuple[str, float], float] = {}
    cost: dict[tuple[str, float], float] = {}
    for name, steps in LADDERS.items():
        right = figures(programs[name](3, steps[-1])[0])
        for step in steps[:-1]:
            try:
                runs = [programs[name](3, step) for _ in range(ROUNDS)]
            except Exception as fault:  # of a program that is not stable with such a step
                print(f"{name:9} {step:8g} s: {fault}")
                continue
            off = 100.0 * (figures(runs[0][0]) / right - 1.0)
            if not np.isfinite(off).all():
                continue
            error[name, step], cost[name, step] = float(np.abs(off).max()), float(np.median([x for _, x in runs]))
            print(
                f"{name:9} {step:8g} s: {cost[name, step]:6.2f} s of CPU; mean, max, min off by {np.round(off, 3)} %",
                flush=True,
            )
    with_error = float(np.median([hybrids(3, STEP, errors=True)[1] for _ in range(3)]))
    for (name, step), off in error.items():
        if name != "hybrid":
            equal = [cost[x] for x in cost if x[0] == "hybrid" and error[x] <= off]
            best = f"{cost[name, step] / min(equal):.2f}" if equal else "no step of hybrid is as exact"
            print(f"{name} at {step:g} s over hybrid, not less exact: {best}; with its errors at {STEP} s: ", end="")
            print(f"{cost[name, step] / with_error:.2f}")
    assert max(off for (name, _), off in error.items() if name == "hybrid") < PEAK


def test_a_weight_on_two_chains_pulls_as_in_cabledyn() -> None:
    pytest.importorskip("cabledyn")
    place, weight, volume, length = (0.0, 0.0, -100.0), 50000.0, 2.0, 240.0
    points = [
        "Fixed -200.0 0.0 0.0 0 0 0 0", "Connect {} {} {} 50000 2.0 0 0".format(*place), "Fixed 200.0 0.0 0.0 0 0 0 0",
    ]  # fmt: skip
    text = deck(
        R4_155, points, [(1, 2, length), (3, 2, length)], 60, "1.0e5 kBot", "1.0e4 cBot", "0.01 dtM", "2.0 TMax"
    )
    with model_of(text) as model:
        there = np.array([float(model.channel(f"FairTen{k}")) for k in (1, 2)])
    line = {"end": "knot", "sections": [section(R4_155, length)], "mesh": {"cells": 60}, "model": "catenary"}
    result = hybrid.static(
        {
            "environment": {"gravity": GRAVITY, "fluid": {"density": DENSITY, "surface": 0.0}},
            "points": {
                "west": {"position": [-200, 0, 0]}, "east": {"position": [200, 0, 0]},
                "knot": {"initial_guess": place, "mass": weight, "volume": volume},
            },
            "lines": {name: line | {"start": name} for name in ("west", "east")},
        }
    )  # fmt: skip
    here = np.array([np.linalg.norm(result[f"points/{name}/force"][-1]) for name in ("west", "east")])
    print(f"\n| connect_weighted_point | {here[0] / 1e3:.2f} kN | {100 * (there / here - 1)} % |")
    assert np.abs(there / here - 1.0).max() < MEAN / 100.0
