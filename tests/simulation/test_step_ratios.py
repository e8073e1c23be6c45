"""What steps and cells make of an error, where steps are not everywhere as much shorter in a finer run."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from hybrid.accuracy.error_estimate import Estimate, usual_ratio
from hybrid.model.resolution import Resolution
from hybrid.simulation.run_sample import RunSample

DURATION, OUTPUTS = 100.0, 401
FIRST = Resolution(1.0, 0.5, 1e-3, 1e-3)


def ended(step: float, hard: float = 0.0) -> np.ndarray:
    """When steps end, s; hard: their length in the last tenth of the time, 0: as before."""
    later = hard or step
    return np.concatenate([np.arange(step, 90.0 + 1e-9, step), 90.0 + np.arange(later, 10.0 + 1e-9, later)])


def run(cells: float, step: float, hard: float, mesh: float, time: float, every: int = 1) -> RunSample:
    """A force with an error of order 1.5 by cells, and by steps before t = 80 s, where they are of length `step`."""
    t = np.linspace(0.0, DURATION, OUTPUTS)[::every]
    wrong = mesh / cells**1.5 + time * np.where(t < 80.0, (step / FIRST.step) ** 1.5, 0.0) * np.sin(t)
    force = (50.0 + wrong)[:, None] * [0.0, 0.0, 1.0]
    position = np.zeros((t.size, 2, 3))
    position[..., 2] = 1e-3 * wrong[:, None]
    steps = ended(step, hard)
    forces = np.column_stack([steps, np.full(steps.size, 50.0), np.full(steps.size, 50.0)])
    resolution = replace(FIRST.coarser(1.0 / cells, step / FIRST.step), every=every)
    values = {"position": position, "reaction_end": force}
    return RunSample(resolution, values, round(100 * cells), steps.size, 0.0, every, forces=forces)


def first(mesh: float, time: float) -> Estimate:
    """Runs that all take short steps in the last tenth: by their counts steps hardly differ."""
    short = 0.02
    runs = ((1.0, 0.5, 1), (0.5, 1.0, 2), (0.5, 2.0, 4), (0.25, 2.0, 4))
    return Estimate(*(run(cells, step, short, mesh, time, every) for cells, step, every in runs))


def test_the_usual_ratio_is_not_that_of_the_counts():
    fast, slow = run(1.0, 0.5, 0.02, 0.0, 0.0), run(1.0, 1.0, 0.02, 0.0, 0.0)
    assert fast.steps / slow.steps == pytest.approx(1.15, abs=0.01)
    assert usual_ratio(fast, slow) == pytest.approx(2.0, rel=0.01)


def test_without_a_log_of_steps_their_counts_count():
    fast, slow = (replace(run(1.0, x, 0.02, 0.0, 0.0), forces=np.zeros((0, 3))) for x in (0.5, 1.0))
    assert usual_ratio(fast, slow) == fast.steps / slow.steps


def test_steps_that_are_short_at_one_moment_do_not_make_the_error_larger():
    """By the counts of their steps, 790 and 890, the error by the steps was six times what it is."""
    estimate = first(0.0, 1.0)
    assert 0.7 < estimate.errors.largest("total", "end_force_end") / 1.0 < 1.5


def test_cells_and_steps_refined_together_share_what_they_changed():
    """At 45 s all coarser runs miss a kink alike, which shorter steps resolve: it was laid to the cells, four times it."""
    estimate = first(0.3, 1.0)
    finer = run(1.6, 0.5 / 3.0, 0.02, 0.3, 1.0)
    wrong = np.abs(np.asarray(finer.values["reaction_end"])[:, 2] - 50.0).max()
    force = np.array(finer.values["reaction_end"])
    force[180, 2] += 1.2
    estimate.update(replace(finer, values={**finer.values, "reaction_end": force}))
    assert 0.7 < estimate.errors.largest("total", "end_force_end") / wrong < 3.0
