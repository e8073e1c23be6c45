"""A response by frequency held against a run in time of the same scene."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from hybrid.accuracy.api import run
from hybrid.errors import Complaint, SceneError
from hybrid.scene.read import as_scene
from hybrid.scene.root import Scene

if TYPE_CHECKING:
    from hybrid.linear.response_results import LineResponse

# Part of the run that is left out, in which the motion begins; outputs to the shortest period that counts.
BEGINS, PER_PERIOD = 0.25, 12
# Steps of a scene that names none, of that period.
STEPS = 60
CHECKED = ("tension", "curvature")


def compared(asked: Scene, lines: Mapping[str, LineResponse], duration: float) -> dict[str, tuple[float, float]]:
    """Standard deviations where each quantity varies most, by frequency and in a run of `duration` (s)."""
    if not 0.0 < duration < np.inf:
        raise SceneError([Complaint("check", f"{duration:g}", "a time > 0, in s", "--check 600")])
    periods = [float(np.median(x.period("tension")[x.period("tension") > 0.0])) for x in lines.values()]
    period = min(periods)
    data: dict[str, Any] = asked.model_dump(mode="json", exclude_none=True)
    time = asked.time
    step = time.step if time is not None and time.step is not None else period / STEPS
    data["time"] = {"duration": duration / (1.0 - BEGINS), "step": step}
    data["output"] = {"every": period / PER_PERIOD}
    data.pop("accuracy", None)
    result: Any = run(as_scene(data))
    found = {}
    for name, line in lines.items():
        one = result.lines[name] if result.lines else result
        late = one.times > BEGINS * duration / (1.0 - BEGINS)
        for what in CHECKED:
            deviation = line.deviation(what)
            places = line.middle if what == "tension" else line.s
            at = int(deviation.argmax())
            column = int(np.abs(one.s - places[at]).argmin())
            there = float(np.asarray(getattr(one, what))[late][:, column].std())
            here = float(np.interp(one.s[column], places, deviation))
            found[f"{name} {what}" if len(lines) > 1 else what] = (here, there)
    return found
