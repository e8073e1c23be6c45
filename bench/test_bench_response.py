"""Response by frequency against hours in time: standard deviations of tension and curvature, and the cost of both.

pytest bench/test_bench_response.py -m bench -n 0 -s
HYBRID_HOURS=3 pytest bench/test_bench_response.py -m bench -n 0 -s -k "leg or bridle or resonance"

Of each scene of bench/response_scenes.py ten hours (HYBRID_HOURS: fewer), each of its own seed.  Ratios are of the
standard deviation by frequency over the mean of those of the hours, at nineteen places of every line, smallest and
largest of them; curvature where it is resolved (`LineResponse.resolved`, and `hybrid response` says so), as parts of
the largest of that line.  Behind +- is the standard error of that mean.  CPU time; of responses the median of three.

What was run, on a busy machine: ten hours of the first ten scenes, six of "sunken body", three of "tensioned riser,
current", two of "bridle", "lazy wave" and both "sagging", one of "spar", "S tether" and "lazy wave, rods"; not
"tensioned riser, 5 m".  Beyond 3 % where valid: one place of a bridle's curvature (3.9 +-0.6 %).  The chain on a vessel
was (4.0 %) and the ropes of the sunken body (4.4 % in six hours), since when lines that ends, points or bodies move may
leave out less.
"""

from __future__ import annotations

import json
import os
import time as clock

import numpy as np
import pytest
from response_scenes import SCENES, buoyed, floated, sunken

import hybrid
from hybrid.modal.validity import OF_DRAGGED

pytestmark = pytest.mark.bench
PLACES = np.linspace(0.05, 0.95, 19)
HOUR, SEEDS = 3600.0, range(1, 1 + int(os.environ.get("HYBRID_HOURS", "10")))
LATE = 100.0  # s, from which on the sea is stationary
# s: steps of 0.15 s give 1.3 % more tension than those of 0.05 s where a vessel moves the end.
STEP, ON_VESSEL = 0.1, 0.05
QUANTITIES = ("tension", "curvature")
# Parts by which a response that is valid may be off, beside two standard errors of the hours; what is told.
WITHIN, TOLD = 0.03, 0.1


def seeded(tables, seed):
    """An hour of another realisation."""
    step = ON_VESSEL if "vessel" in tables.get("ends", {}).get("end", {}).get("motion", {}) else STEP
    data = json.loads(json.dumps(tables))
    waves = data["environment"]["fluid"]["waves"]
    for k, sea in enumerate(waves.get("spectra", [waves])):
        sea["seed"] = 100 * k + seed
    return data | {"time": {"duration": HOUR, "step": step}}


def measured(tables, found):
    """Standard deviations of each hour, (hours, 19) by quantity and line, their places there, and the cost, s an hour."""
    one = len(found.lines) == 1
    lengths = {name: float(line.s[-1]) for name, line in found.lines.items()}
    points = [round(part * next(iter(lengths.values())), 3) for part in PLACES.tolist()] if one else 101
    there: dict[tuple[str, str], list] = {(what, name): [] for what in QUANTITIES for name in lengths}
    places, begin = {}, clock.process_time()
    for seed in SEEDS:
        with hybrid.run(seeded(tables, seed) | {"output": {"every": 0.25, "points": points}}) as result:
            late = result.times > LATE
            for name, length in lengths.items():
                line = result if one else result.lines[name]
                columns = [int(np.abs(line.s - part * length).argmin()) for part in PLACES]
                places[name] = line.s[columns]
                for what in QUANTITIES:
                    there[what, name].append(np.asarray(getattr(line, what))[late][:, columns].std(axis=0))
    return {k: np.array(x) for k, x in there.items()}, places, (clock.process_time() - begin) / len(SEEDS)


def ratios(what, line, places, hours):
    """Ratios of each place, their standard errors, and whether each place is resolved."""
    mean = hours.mean(axis=0)
    error = hours.std(axis=0, ddof=1) / np.sqrt(len(hours)) if len(hours) > 1 else np.full(mean.size, np.nan)
    if what == "tension":
        ours = np.interp(places, line.middle, line.deviation(what))
        return ours / mean, error / mean, np.ones(mean.size, bool)
    known = line.resolved(what)[[int(np.abs(line.s - x).argmin()) for x in places]]
    most = max(float(mean.max()), 1e-300)
    return 1.0 + (np.interp(places, line.s, line.deviation(what)) - mean) / most, error / most, known


@pytest.mark.parametrize("name", SCENES)
def test_against_hours(name, tmp_path):
    tables = SCENES[name](tmp_path)
    hybrid.response(tables)
    costs = []
    for _ in range(3):
        begin = clock.process_time()
        found = hybrid.response(tables)
        costs.append(clock.process_time() - begin)
    cost = float(np.median(costs))
    there, places, hours = measured(tables, found)
    print(f"\n{name}: {cost:.3f} s of CPU for {hours:.1f} s an hour, {10.0 * hours / cost:.0f} times cheaper than ten")
    for what in QUANTITIES:
        valid, beyond = found.valid_for(what), 0.0
        print(f"  {what}, {'valid' if valid else 'not valid'}:")
        for line_name, line in found.lines.items():
            ratio, error, known = ratios(what, line, places[line_name], there[what, line_name])
            off = np.abs(ratio - 1.0)
            text = "no place is resolved"
            if known.any():
                k = int(np.where(known, off, -1.0).argmax())
                text = (
                    f"{ratio[known].min():.3f} to {ratio[known].max():.3f}, worst at {places[line_name][k]:.4g} m, "
                    f"+-{error[k]:.3f}"
                )
                beyond = max(beyond, float(off[k] - 2.0 * np.nan_to_num(error[k])))
            unknown = f"; at {(~known).sum()} places that are not resolved up to {off[~known].max(initial=0.0):.2f} off"
            added = f", {100.0 * line.left_out[what].max():.1f} % left out" if what == "tension" else ""
            print(f"    {line_name}: {text}{unknown if not known.all() else ''}{added}")
        assert not valid or beyond < TOLD
        if valid and beyond > WITHIN:
            print(f"    BEYOND {100.0 * WITHIN:g} %")
    for note in found.notes:
        print(f"  {note}")


@pytest.mark.parametrize(
    ("made", "height"),
    # waves of 1.5 m stretch the rope with the float beyond what it bears
    [
        (sunken, 0.1),
        (sunken, 0.4),
        (sunken, 1.5),
        (buoyed, 0.1),
        (buoyed, 0.4),
        (buoyed, 1.5),
        (floated, 0.1),
        (floated, 0.4),
    ],
)
def test_resonance(made, height):
    """Tension of ropes at a body, a point and a float by the same waves at the same times, and what is said to be left out."""
    sea, off, left = {"kind": "pierson_moskowitz", "significant_height": height, "peak_period": 10.0}, [], []
    for seed in SEEDS:
        tables = seeded(made(sea), seed)
        found = hybrid.response(tables)
        with hybrid.run(tables | {"output": {"every": 0.25, "points": 41 if made is floated else 21}}) as result:
            late = result.times > LATE
            for name, line in found.lines.items():
                amplitudes = 0.5 * (line.tension[:, 9] + line.tension[:, 10])
                here = (np.exp(-2j * np.pi * np.outer(result.times[late], line.f)) @ amplitudes).real.std()
                of = result if len(found.lines) == 1 else result.lines[name]
                off.append(float(np.asarray(of.tension)[late][:, 10].std() / here - 1.0))
                left.append(float(line.left_out["tension"].max()))
    off, left = np.reshape(off, (len(SEEDS), -1)).mean(axis=1), np.reshape(left, (len(SEEDS), -1)).mean(axis=1)
    print(f"\n{made.__name__}, {height:g} m: tension {100.0 * off.mean():.2f} % more in time, of the hours "
          f"{100.0 * off.min():.1f} to {100.0 * off.max():.1f}; left out {100.0 * left.mean():.2f} %, "
          f"{100.0 * left.min():.1f} to {100.0 * left.max():.1f}")  # fmt: skip
    if off.size >= 3:  # fewer tell nothing of how far hours are apart
        assert off.mean() < WITHIN + 2.0 * off.std() / np.sqrt(off.size) or left.mean() > OF_DRAGGED
