"""Contact of a line with itself while it is paid out: its mirror image, zones that move, a winch, runs that resume."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import hybrid

WIDTH = 0.02
WINCH = {"tension": 3.0, "inertia": 2.0, "damping": 3.0, "max_rate": 0.5, "ramp": 1.0}


def crossing(side: str = "end", model: Any = "rod", winch: dict[str, float] | None = None, **more: Any) -> hybrid.Scene:
    """A line hangs from a winch; its far end is led past the winch through the other leg, which goes on to grow."""
    section = {
        "length": 5.0, "mass": 0.4, "diameter": WIDTH, "axial_stiffness": 1e5, "bending_stiffness": 0.02,
        "torsional_stiffness": 0.016, "damping": {"mass": 0.5},
    }  # fmt: skip
    payout = {"longest": 8.0} | ({"rate": 0.4, "ramp": 1.0} if winch is None else {"winch": winch})
    led = {"travel": {"by": [-2.8, 0.5 * WIDTH, 0.0], "over": 4.0}}
    ends = {
        side: {"kind": "pinned", "position": [0.1, 0, 0], "payout": payout},
        "start" if side == "end" else "end": {"kind": "pinned", "position": [2.5, 0, -0.5], "motion": led},
    }
    return hybrid.validate_scene({
        "cable": {"sections": [section]}, "model": model, "mesh": {"cells": 100}, "initial": "equilibrium",
        "contact": {"self": True, "friction": 0.3}, "ends": ends, "time": {"duration": 3.2, "step": 0.01},
        "output": {"every": 0.02, "points": 41}, **more,
    })  # fmt: skip


@pytest.fixture(scope="module")
def rod() -> hybrid.Result:
    return hybrid.run(crossing())


@pytest.mark.long  # a kernel of its own: 7 s
def test_strands_stay_apart_while_line_comes(rod: hybrid.Result) -> None:
    assert {event.kind for event in rod.events} == {"line touches itself"}
    assert float(rod["self_distance/distance"]) > 0.85 * WIDTH
    touches = rod["energy/self_contact"] > 0.0
    assert touches.sum() > 5 and rod["payout/length"][touches].max() > rod["payout/length"][touches].min() + 0.05
    assert (rod["self_contact"][touches].max(axis=1) > 0.0).all() and not rod["self_contact"][~touches].any()
    assert rod["work/scheme"].max() < 1e-3 * np.abs(rod["work/end"]).max()


def test_the_mirror_image(rod: hybrid.Result) -> None:
    mirror = hybrid.run(crossing("start"))
    np.testing.assert_allclose(mirror["position"][:, ::-1], rod["position"], atol=1e-5)
    most = rod["energy/self_contact"].max()
    np.testing.assert_allclose(mirror["energy/self_contact"], rod["energy/self_contact"], atol=1e-3 * most)


@pytest.mark.long
@pytest.mark.parametrize("more", [{"model": "adaptive"}, {"winch": WINCH, "side": "start"}], ids=["zones", "winch"])
def test_it_resumes_to_the_last_bit(tmp_path: Path, rod: hybrid.Result, more: dict[str, Any]) -> None:
    """Stopped while strands touch; zones that move touch as rods do."""
    whole = hybrid.run(crossing(**more))
    touches = whole.times[whole["energy/self_contact"] > 0.0]
    assert touches[0] < 2.9 < touches[-1]
    if "model" in more:
        assert any(zone.kind == "catenary" for zones in whole.zones for zone in zones)
        assert whole["energy/self_contact"].max() == pytest.approx(rod["energy/self_contact"].max(), rel=0.1)
        assert np.linalg.norm(whole["position"] - rod["position"], axis=2).max() < 0.01 * 5.0
    hybrid.run(crossing(**more, time={"duration": 2.9, "step": 0.01}), tmp_path / "part.h5").close()
    with hybrid.resume(tmp_path / "part.h5", until=3.2) as resumed:
        for name in (x for x in whole.names if x.startswith(("position", "tension", "energy/", "work/", "self"))):
            assert np.array_equal(whole[name], resumed[name], equal_nan=True), name


def test_sections_on_the_reel_need_a_diameter() -> None:
    scene = crossing().model_dump(exclude_unset=True, by_alias=True)
    scene["ends"]["end"]["payout"]["reel"] = [
        {"length": 4.0, "mass": 0.4, "axial_stiffness": 1e5, "bending_stiffness": 1.0}
    ]
    with pytest.raises(hybrid.SceneError, match=r"payout.reel\[0\].diameter"):
        hybrid.validate_scene(scene)
