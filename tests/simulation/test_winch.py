"""A winch that holds a tension, against closed forms; its limit, the end of its reel, resume and refusals."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from test_payout import exchanged

import hybrid
from hybrid.errors import ComputationError, Outcome, SceneError
from tests.scenes import cable_scene, pinned_at

G = 9.81


def vertical(
    step: float = 0.05, duration: float = 10.0, bob: float = 0.0, m: float = 2.0, **winch: Any
) -> dict[str, Any]:
    """40 m of a line that hangs from a winch, with a bob at its lower end."""
    held = {"tension": 600.0, "inertia": 100.0, **winch}
    end = {"kind": "pinned", "position": [0, 0, 0], "payout": {"longest": 90.0, "winch": held}}
    start: dict[str, Any] = {"kind": "body", "mass": bob, "volume": 0.0} if bob else {"kind": "free"}
    return cable_scene(
        {"length": 40.0, "mass": m}, start, end, model="catenary", mesh=20, time=(duration, step), output=0.5
    )


def sagging(model: str = "rod", duration: float = 20.0, step: float = 0.05) -> dict[str, Any]:
    """100 m over 80 m; the ship surges by 1 m in 7 s, and its winch holds 3 kN."""
    section = {"length": 100.0, "mass": 5.0, "diameter": 0.05, "axial_stiffness": 2e6, "bending_stiffness": 2e4}
    end = {
        "kind": "pinned", "position": [80, 0, 0], "motion": {"surge": {"amplitude": 1.0, "period": 7.0}, "ramp": 7.0},
        "payout": {"longest": 150, "winch": {"tension": 3000.0, "inertia": 200.0, "damping": 100.0}},
    }  # fmt: skip
    return cable_scene(section, pinned_at(0, 0, 0), end, model=model, mesh=40, time=(duration, step), output=0.5)


def clamped(scene: dict[str, Any], tangent: list[float]) -> dict[str, Any]:
    """The same line as a rod, which leaves its winch along a direction."""
    for section in scene["cable"]["sections"]:
        section.setdefault("bending_stiffness", 100.0)
        section.setdefault("diameter", 0.03)
    scene["ends"]["end"] |= {"kind": "clamped", "tangent": tangent}
    return scene | {"model": "rod"}


def blend(t: float, first: float, then: float, begin: float, ramp: float) -> float:
    x = min(max((t - begin) / ramp, 0.0), 1.0)
    return first + x**3 * (10.0 - 15.0 * x + 6.0 * x * x) * (then - first)


@pytest.mark.parametrize("dimension", [None, 3])
def test_a_light_line_with_a_bob_answers_as_a_mass_does(dimension: int | None) -> None:
    """(I + M) dc/dt = M g - T(t), whose integral is a polynomial: order 2, through cells that enter and leave."""
    errors = []
    for step in (0.1, 0.05):
        scene = vertical(step, 12.0, bob=80.0, m=1e-6, ramp=4.0, begin=2.0, tension=700.0)
        result = hybrid.run(scene | ({"dimension": dimension} if dimension else {}))
        x = np.clip((result.t - 2.0) / 4.0, 0.0, 1.0)
        late = np.maximum(result.t - 6.0, 0.0)
        slope = (80.0 * G - 700.0) / 180.0
        rate = slope * (4.0 * (2.5 * x**4 - 3.0 * x**5 + x**6) + late)
        length = 40.0 + slope * (16.0 * (0.5 * x**5 - 0.5 * x**6 + x**7 / 7.0) + 4.0 * 0.5 * late + 0.5 * late**2)
        errors.append([np.abs(result["payout/rate"] - rate).max(), np.abs(result["payout/length"] - length).max()])
        assert np.ptp(result["payout/length"]) > 6.0
        assert (result["payout/rate"][result.t <= 2.0] == 0.0).all()
        steady = result.t > 7.0
        pull = 80.0 * (G - slope)
        assert np.abs(result["reaction_end"][steady, 2] / pull - 1.0).max() < 1e-5
    first, second = np.array(errors)
    assert (second < [1e-4, 5e-4]).all()
    assert (first > 3.3 * second).all()


@pytest.mark.parametrize("clamp", [False, True])
def test_a_heavy_line_that_runs_out(clamp: bool) -> None:
    """(I + m L) d2L/dt2 + d dL/dt = m g L - T(t) by another integrator; the pull is m L (g - d2L/dt2)."""

    def law(t: float, y: np.ndarray) -> list[float]:
        pull = blend(t, 80.0 * G, 600.0, 0.0, 5.0)
        return [y[1], (2.0 * G * y[0] - pull - 50.0 * y[1]) / (100.0 + 2.0 * y[0])]

    errors = []
    for step in (0.1, 0.05):
        scene = vertical(step, damping=50.0)
        result = hybrid.run(clamped(scene, [0, 0, 1]) if clamp else scene)
        exact = solve_ivp(law, (0.0, 10.0), [40.0, 0.0], rtol=1e-10, atol=1e-12, t_eval=result.t).y
        errors.append(np.abs(result["payout/length"] - exact[0]).max())
        pull = 2.0 * exact[0] * (G - np.array([law(t, y)[1] for t, y in zip(result.t, exact.T, strict=True)]))
        assert np.abs(result["reaction_end"][:, 2] / pull - 1.0).max() < 5e-2 * step
    assert errors[1] < 1.7e-3
    assert errors[0] > 3.7 * errors[1]


@pytest.mark.parametrize("model", ["catenary", "rod", "clamped"])
def test_at_rest_the_pull_is_the_tension_that_is_held(model: str) -> None:
    scene = sagging("rod" if model == "clamped" else model, 300.0, 0.1)
    scene = clamped(scene, [1.0, 0.0, 0.5]) if model == "clamped" else scene
    del scene["ends"]["end"]["motion"]
    scene["ends"]["end"]["payout"]["winch"]["damping"] = 300.0
    scene["cable"]["sections"][0]["damping"] = {"mass": 0.4}
    result = hybrid.run(scene)
    assert np.linalg.norm(result["reaction_end"][-1]) == pytest.approx(3000.0, rel=1e-5)
    assert abs(result["payout/length"][-1] - 100.0) > 1.0


@pytest.mark.parametrize(("model", "dimension"), [("catenary", None), ("rod", 3), ("clamped", None), ("clamped", 3)])
def test_a_winch_at_the_start_does_as_one_at_the_end(model: str, dimension: int | None) -> None:
    """The mirror image, through cells that enter or leave; there an iteration takes another right-hand side."""
    scene = sagging("rod" if model == "clamped" else model, 20.0, 0.1) | ({"dimension": dimension} if dimension else {})
    scene = clamped(scene, [1.0, 0.0, 0.5]) if model == "clamped" else scene
    one, other = hybrid.run(scene), hybrid.run(exchanged(scene))
    assert np.ptp(one["payout/length"]) > 3.0
    for name in ("payout/length", "payout/rate", "payout/power"):
        assert np.abs(one[name] - other[name]).max() < 1e-9 * np.abs(one[name]).max()
    assert np.abs(one["reaction_end"] - other["reaction_start"]).max() < 1e-9 * np.abs(one["reaction_end"]).max()
    assert other["steps/iterations"].mean() < one["steps/iterations"].mean() + 0.2


def test_the_rate_is_limited() -> None:
    """1 % above it with half the tension held, and not before."""
    result = hybrid.run(vertical(duration=20.0, max_rate=1.0))
    rate, length = result["payout/rate"][-1], result["payout/length"][-1]
    assert 1.0 < rate < 1.015
    force = 2.0 * G * length - 600.0
    assert 600.0 * 100.0 * (rate - 1.005) == pytest.approx(force, rel=0.02)


def test_a_winch_keeps_the_pull_where_a_locked_one_does_not() -> None:
    moving = sagging(duration=35.0)
    held = hybrid.run(moving)
    moving["ends"]["end"]["payout"] = {"rate": 0.0}
    locked = hybrid.run(moving)
    late = held.t > 14.0
    one, other = (np.ptp(np.linalg.norm(x["reaction_end"], axis=1)[late]) for x in (held, locked))
    assert one < 0.4 * other


def test_the_end_of_the_reel_stops_the_run() -> None:
    with pytest.raises(ComputationError, match="no more line") as found:
        hybrid.run(vertical(duration=60.0))
    assert found.value.outcome == Outcome.WINCH_AT_END
    found.value.snapshot.unlink()
    with pytest.raises(ComputationError, match="none to take in") as found:
        hybrid.run(vertical(duration=60.0, tension=2000.0))
    found.value.snapshot.unlink()


@pytest.mark.parametrize(
    ("payout", "where"),
    [
        ({"winch": {"tension": 600.0, "inertia": 100.0}}, "payout.longest"),
        ({"winch": {"tension": 600.0}, "longest": 60}, "winch.inertia"),
        ({"winch": {"tension": -1.0, "inertia": 100.0}, "longest": 60}, "winch.tension"),
        ({"winch": {"tension": 600.0, "inertia": 1.0, "max_rate": 0.0}, "longest": 60}, "winch.max_rate"),
        ({"winch": {"tension": 600.0, "inertia": 1.0, "speed": 1.0}, "longest": 60}, "winch.speed"),
        ({"winch": {"tension": 600.0, "inertia": 1.0}, "longest": 60, "rate": 1.0, "ramp": 1.0}, "payout.winch"),
    ],
)
def test_a_winch_that_cannot_be_is_refused(payout: dict[str, Any], where: str) -> None:
    scene = vertical()
    scene["ends"]["end"]["payout"] = payout
    with pytest.raises(SceneError) as found:
        hybrid.run(scene)
    assert where in str(found.value)
