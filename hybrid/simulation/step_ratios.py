"""How many times as short the steps of a run are as those of another: around each output, and mostly.

Steps that follow the motion, or are halved where Newton's method fails, are not everywhere as much shorter in a finer
run as the counts of steps say: a run whose steps are limited to a third of a period may have more of them than a run
with twice as fine a limit, where a few moments are hard for it.
"""

from __future__ import annotations

import numpy as np

from hybrid.simulation.run_sample import RunSample

# Steps are counted over so many usual steps of the slower run, before and after an output.
AROUND = 2.0
# Ratios are held within these powers of the usual one: where steps are no shorter nothing shows what they do.
LEAST_POWER, MOST_POWER = 0.5, 2.0


def usual_ratio(fast: RunSample, slow: RunSample) -> float:
    """How many times as short steps mostly are: the median over the time of the run."""
    ratios = _ratios(fast, slow, 200)
    return fast.steps / max(slow.steps, 1) if ratios is None else float(np.median(ratios))


def ratios_at(fast: RunSample, slow: RunSample, count: int) -> np.ndarray:
    """The same around each of `count` outputs (count,) of a run, equally spaced over its time."""
    usual, ratios = usual_ratio(fast, slow), _ratios(fast, slow, count)
    if ratios is None:
        return np.full(count, usual)
    return np.asarray(np.clip(ratios, *sorted((usual**LEAST_POWER, usual**MOST_POWER))))


def of_outputs(numbers: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Numbers (nt,) of outputs, to be multiplied by values (nt, ...)."""
    return numbers.reshape(-1, *(1,) * (values.ndim - 1))


def _ratios(fast: RunSample, slow: RunSample, count: int) -> np.ndarray | None:
    """Around `count` times from the start to the end; None: the runs have not kept when their steps end."""
    logs = [np.append(0.0, run.forces[:, 0]) for run in (fast, slow)]
    if any(x.size != run.steps + 1 or x.size < 3 for x, run in zip(logs, (fast, slow), strict=True)):
        return None
    usual = np.diff(logs[1])
    near = AROUND * float((usual * usual).sum() / usual.sum())
    t = np.linspace(0.0, logs[1][-1], count)
    steps = [np.interp(t + near, x, np.arange(x.size)) - np.interp(t - near, x, np.arange(x.size)) for x in logs]
    return np.asarray(steps[0] / np.maximum(steps[1], 1e-9))
