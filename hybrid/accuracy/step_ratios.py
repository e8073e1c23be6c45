"""How many times as short the steps of a run mostly are as those of another.

Steps that follow the motion, or are halved where Newton's method fails, are not everywhere as much shorter in a finer
run as the counts of steps say: a run whose steps are limited to a third of a period may have more of them than a run
with twice as fine a limit, where a few moments are hard for it.
"""

from __future__ import annotations

import numpy as np

from hybrid.simulation.run_sample import RunSample

# Steps are counted over so many usual steps of the slower run, before and after each of so many times.
AROUND, TIMES = 2.0, 200


def usual_ratio(fast: RunSample, slow: RunSample) -> float:
    """The median over the time of the run; of runs that have not kept when their steps end, of their counts."""
    logs = [np.append(0.0, run.forces[:, 0]) for run in (fast, slow)]
    if any(x.size != run.steps + 1 or x.size < 3 for x, run in zip(logs, (fast, slow), strict=True)):
        return fast.steps / max(slow.steps, 1)
    usual = np.diff(logs[1])
    near = AROUND * float((usual * usual).sum() / usual.sum())
    t = np.linspace(0.0, logs[1][-1], TIMES)
    steps = [np.interp(t + near, x, np.arange(x.size)) - np.interp(t - near, x, np.arange(x.size)) for x in logs]
    return float(np.median(steps[0] / np.maximum(steps[1], 1e-9)))
