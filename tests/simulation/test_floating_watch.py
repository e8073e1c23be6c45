"""What is watched in a run and told: a buoy that its lines pull under water, a torque that can throw a loop."""

from __future__ import annotations

import re
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import hybrid
from hybrid import Result
from hybrid.model.build import build
from hybrid.scene.read import one_line
from hybrid.simulation.watches import Loops, note_hockling, note_loops
from tests.scenes import cable_scene, network_scene

HEIGHT = 2.0  # m


def two_chains(volume: float, **more: Any) -> dict[str, Any]:
    """A buoy of 2.5 t between two slack chains of 60 m in deep water."""
    chain = {"length": 60, "mass": 40, "diameter": 0.08, "axial_stiffness": 1.7e8, "drag": {"normal": 1.3}}
    line = {"end": "buoy", "sections": [chain], "mesh": {"cells": 20}}
    buoy = {"mass": 2500, "volume": volume, "height": HEIGHT, "shape": "cylinder"} | more
    return network_scene(
        {"east": {"position": [20, 0, -35]}, "west": {"position": [-20, 0, -35]},
         "buoy": {"initial_guess": [0, 0, 0], "drag_area": 3, "added_mass": 3000} | buoy},
        {"east": {"start": "east"} | line, "west": {"start": "west"} | line}, fluid={"density": 1025, "surface": 0},
        time=(2.0, 0.1), output=0.5
    )  # fmt: skip


def pulled(result: Result) -> list[str]:
    return [x.text for x in result.events if x.kind == "pulled under"]


def test_the_volume_that_is_named_floats_the_lines_and_a_smaller_one_does_not() -> None:
    few = hybrid.static(two_chains(3.5))
    (text,) = pulled(few)
    depth = -few["points/buoy/position"][0, 2] - 0.5 * HEIGHT
    assert f"its top is {depth:.3g} m below the surface" in text and depth > 1.0
    net = 9.81 * (1025 * 3.5 - 2500)
    assert f"less its weight is {net:.4g} N at most" in text
    volume = float(re.search(r"a volume of (\S+) m\^3 would float them", text)[1])  # type: ignore[index]
    assert volume > 3.5
    floats = hybrid.static(two_chains(1.02 * volume))
    assert not pulled(floats) and -0.5 * HEIGHT < floats["points/buoy/position"][0, 2] < 0.0
    assert pulled(hybrid.static(two_chains(0.98 * volume)))


def test_what_is_to_stay_in_the_depth_is_not_told() -> None:
    """Without height, and first put below the surface, as a buoy of a mooring that is submerged."""
    scene = two_chains(3.5, initial_guess=[0, 0, -15], height=None)
    del scene["points"]["buoy"]["height"]
    assert not pulled(hybrid.static(scene))


@pytest.mark.long  # 1.0 s
def test_a_buoy_is_told_once_in_waves_that_pass_over_it_and_again_where_it_is_much_deeper(tmp_path: Path) -> None:
    """A crest of 1 m stands over a buoy that its taut chains hold; the run that goes on does not tell it again."""
    scene = two_chains(4.0)
    scene["environment"]["fluid"]["waves"] = {"kind": "regular", "height": 2.0, "period": 8.0}
    whole = hybrid.run(scene)
    told = pulled(whole)
    assert told and "and its lines pull it down by" in told[0]
    tops = [float(re.search(r"top is (\S+) m", x)[1]) for x in told]  # type: ignore[index]
    assert all(b > 3.0 * a for a, b in pairwise(tops))
    file = tmp_path / "half.h5"
    scene["time"]["duration"] = 1.0
    hybrid.run(scene, file)
    assert pulled(hybrid.resume(file, until=2.0)) == told


# --- torques that can throw a loop ---

EI, GJ, DIAMETER = 0.5, 0.4, 0.02


CATENARY = {"kind": "zones", "zones": [{"catenary": 4.0, "cells": 80}]}


def twisted(turns: float, over: float = 0.0, model: Any = "rod", away: float = 0.1) -> hybrid.Scene:
    """A taut cable whose clamps are twisted against each other; in a time `over`, s, its end gives way by `away`, m."""
    section = {
        "length": 4.0, "mass": 0.4, "diameter": DIAMETER, "axial_stiffness": 1e5, "bending_stiffness": EI,
        "damping": {"mass": 2.0}, "torsional_stiffness": GJ,
    }  # fmt: skip
    clamp = {"kind": "clamped", "tangent": [1, 0, 0], "normal": [0, 0, 1]}
    end = clamp | {"position": [3.995, 0, 0], "turns": turns}
    time = {}
    if over:
        end["motion"] = {"travel": {"by": [-away, 0, 0], "over": over}}
        time = {"time": {"duration": over + 2.0, "step": 0.02}, "output": {"every": 0.2, "points": 41}}
    mesh = {} if isinstance(model, dict) else {"mesh": {"cells": 80}}
    return hybrid.validate_scene(
        cable_scene(section, clamp | {"position": [0, 0, 0]}, end, gravity=2.0, model=model) | mesh | time
    )


def told(result: hybrid.Result) -> list[Any]:
    return [event for event in result.events if event.kind == "loop can form"]


def margins(result: hybrid.Result) -> np.ndarray:
    """(nt, ns) formation margins."""
    return np.asarray(4.0 * EI * np.maximum(result["tension"], 1e-9) / result["torque"] ** 2)


def test_an_equilibrium_with_too_much_torque() -> None:
    few, many = hybrid.static(twisted(3.0, model=CATENARY)), hybrid.static(twisted(12.0, model=CATENARY))
    assert margins(few).min() > 1.0 and not told(few)
    (event,) = told(many)
    assert event.value == pytest.approx(margins(many).min(), rel=1e-9) and event.value < 1.0
    assert event.s_a == pytest.approx(many.s[margins(many)[0].argmin()])
    assert event.threshold == 1.0
    for part in ("N m", "M^2/(4 EI)", "opens", "friction"):
        assert part in event.text


@pytest.mark.parametrize(("model", "over"), [("rod", 0.5), (CATENARY, 6.0)], ids=["rod", "catenary"])
def test_a_run_that_slackens(model: Any, over: float) -> None:
    """The first event is soon after the first output with a margin below 1, others follow at a third of it."""
    result = hybrid.run(twisted(5.0, over, model))
    least = margins(result).min(axis=1)
    assert least[0] > 1.0 > least.min()
    events = told(result)
    first = int(np.argmax(least < 1.0))
    at = int(np.argmin(np.abs(result.times - events[0].t)))
    assert 0 <= at - first <= 2  # the stretch must be long enough
    assert events[0].value == pytest.approx(least[at], rel=1e-6)
    assert all(b.value <= a.value / 3.0 for a, b in pairwise(events))
    assert len(events) < 12
    assert not told(hybrid.run(twisted(0.5, over, model)))


def test_a_loop_that_forms() -> None:
    """Slowly, a rod follows its loop with a margin above 1: the writhe says that there is one, and where."""
    result = hybrid.run(twisted(6.0, 6.0, away=0.8))
    found = [event for event in result.events if event.kind == "loop formed"]
    writhe = np.abs(result["turns/writhe"] - result["turns/writhe"][0])
    first = int(np.argmax(writhe > 0.75))
    assert writhe.max() > 0.75 and found[0].t == pytest.approx(result.times[first])
    assert found[0].s_a == pytest.approx(result.s[result["curvature"][first].argmax()])
    assert len(found) < 5
    lost = 6.0 - result["turns/link"][:]  # two turns wherever it passes through itself, to round-off
    np.testing.assert_allclose(lost, 2.0 * np.round(0.5 * lost), atol=1e-9)
    assert bool(np.round(lost).any()) == any(event.kind == "line meets itself" for event in result.events)
    assert not [event for event in hybrid.run(twisted(0.5, 6.0)).events if event.kind == "loop formed"]


FIXED, ZONES = {"duration": 5.0, "step": 0.02}, [{"rod": 3.0, "cells": 60}, {"catenary": 1.0, "cells": 10}]


@pytest.mark.parametrize(
    ("model", "time"),
    [("rod", FIXED), ("rod", {"duration": 5.0}), ({"kind": "zones", "zones": ZONES}, FIXED), ("adaptive", FIXED)],
    ids=["rod", "rod whose steps follow", "zones", "zones that move"],
)
def test_a_loop_that_forms_slowly_is_foreseen(model: Any, time: dict[str, float]) -> None:
    """The straight line is left at a margin below 1 in an ever shorter stretch: no output of it was long enough."""
    tables = twisted(6.0, 6.0, model if isinstance(model, dict) else "rod", away=0.8)
    data = tables.model_dump(mode="python", exclude_unset=True) | {"model": model, "time": time}
    result = hybrid.run(hybrid.validate_scene(data))
    (formed, *_) = [event for event in result.events if event.kind == "loop formed"]
    first, least = told(result)[0], margins(result).min(axis=1)
    assert 0.9 < first.value < 1.0 and first.t < formed.t - 1.5
    assert first.t <= result.times[int(np.argmax(least < 1.0))] + 0.45  # the stretch must be long enough


def test_a_stretch_that_the_torque_alone_cannot_bend_is_too_short() -> None:
    """Greenhill: a pinned line without tension, of length l, is bent by M = 2 pi EI/l."""
    model, s = build(one_line(twisted(0.0))), np.linspace(0.0, 4.0, 401)
    torque, found = np.full((1, 401), 6.0), []
    for length in (0.95, 1.05):
        tension = np.full((1, 401), 20.0)  # needed: 18 N
        tension[0, np.abs(s - 2.0) < 0.5 * length * 2.0 * np.pi * EI / 6.0 - 0.01] = 17.9
        values = {"torque": torque, "tension": tension}
        note_hockling(model, np.zeros(1), values, s, 1.0, lambda *x, **y: found.append((x[0], y["value"])))
        assert len(found) == (length > 1.0)
    assert found[0][1] == pytest.approx(17.9 / 18.0)


def told_of(writhe: list[float], bends: list[float], batches: int = 1) -> list[tuple[float, str, str]]:
    """Times, kinds and texts of the events of a line of 3 points, whose middle bends, in batches of outputs."""
    found: list[tuple[float, str, str]] = []
    t, s, known = np.arange(float(len(writhe))), np.array([0.0, 1.0, 2.0]), Loops()
    curvature = np.outer(bends, [0.0, 1.0, 0.5])
    tension = 10.0 * (1.0 + t[:, None]) + s  # N, largest at the end
    for part in np.array_split(np.arange(t.size), batches):
        values = {"turns/writhe": np.array(writhe)[part], "curvature": curvature[part], "tension": tension[part]}

        def event(t: float, a: float, b: float, kind: str, text: str, **more: float) -> None:
            found.append((t, kind, text))

        known = note_loops(t[part], values, s, known, event)
    return found


def test_a_loop_that_opens_is_told_with_its_pull_and_its_least_radius() -> None:
    """It forms at 2 s, is bent to 1/8 m at 3 s and open at 5 s, and another forms; in batches as at once."""
    writhe = [0.0, 0.5, 1.0, 1.0, 0.5, 0.1, 0.6, 0.9]
    bends = [1.0, 2.0, 4.0, 8.0, 6.0, 1.0, 2.0, 3.0]
    found = told_of(writhe, bends)
    assert [(t, kind) for t, kind, _ in found] == [(2.0, "loop formed"), (5.0, "loop opened"), (7.0, "loop formed")]
    assert "radius of 0.125 m" in found[1][2] and "tension along the line is 62 N" in found[1][2]
    assert found == told_of(writhe, bends, 3) == told_of(writhe, bends, 8)
    assert not told_of([0.0, 0.5, 0.7, 0.1], [1.0] * 4)


def test_a_loop_that_is_there_from_the_start_opens_and_another_forms() -> None:
    found = told_of([1.0, 0.9, 0.1, 0.2, 1.0], [1.0] * 5)
    assert [(t, kind) for t, kind, _ in found] == [(2.0, "loop opened"), (4.0, "loop formed")]


def test_a_run_that_is_resumed_in_a_loop_tells_that_it_opens(tmp_path: Path) -> None:
    """The end comes back: the writhe is that of the start again, from one output on, and the event says so once."""
    times = np.arange(0.0, 14.05, 0.1)
    away = 0.4 * (1.0 - np.cos(np.pi * np.clip(np.minimum(times, 12.0 - times), 0.0, 5.0) / 5.0))
    rows = [f"{t},{x},0,0\n" for t, x in zip(times, 3.995 - away, strict=True)]
    (tmp_path / "away.csv").write_text("t,x,y,z\n" + "".join(rows))
    scene = twisted(6.0, 6.0, away=0.8)
    tables = scene.model_dump(mode="python", exclude_unset=True)
    tables["ends"]["end"]["motion"] = {"file": str(tmp_path / "away.csv")}
    tables["time"]["duration"] = 7.0
    hybrid.run(tables, tmp_path / "loop.h5")
    whole = hybrid.resume(tmp_path / "loop.h5", until=14.0)
    writhe = np.abs(whole["turns/writhe"] - whole["turns/writhe"][0])
    formed, opened = ([x for x in whole.events if x.kind == f"loop {word}"] for word in ("formed", "opened"))
    assert writhe.max() > 0.75 and formed[0].t < 7.0 and len(opened) == 1
    k = int(np.flatnonzero(whole.times > formed[-1].t)[np.argmax(writhe[whole.times > formed[-1].t] < 0.375)])
    assert opened[0].t == pytest.approx(whole.times[k]) and opened[0].value == pytest.approx(whole["tension"][k].max())
    since = (whole.times >= formed[0].t) & (whole.times <= whole.times[k])
    assert f"radius of {1.0 / whole['curvature'][since].max():.3g} m" in opened[0].text
