"""Lines that are paid out whose bending is no multiple of curvature, or that are stiffened along their arc length."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from test_payout import clamped, sagging

import hybrid
from tests.problems import tables_with
from tests.scenes import cable_scene

EI = 2e4
SAME = {"moment_curvature": [[0, 0], [0.01, 0.01 * EI], [0.1, 0.1 * EI]]}
# Its corners lie within the curvatures of the line.
TABLE = {"moment_curvature": [[0, 0], [0.004, 80.0], [0.012, 120.0], [0.05, 1500.0]]}
CONE = {"kind": "bend_stiffener", "range": [0, 10], "diameters": [0.4, 0.06], "bore": 0.05, "modulus": 1e8}
RESTRICTOR = {"kind": "bend_restrictor", "range": [40, 60], "radius": 60}


def paid(
    section: dict[str, Any], rate: float = 0.8, step: float = 0.05, duration: float = 8.0, **more: Any
) -> dict[str, Any]:
    scene = clamped(sagging("rod", 2e6, EI, rate, step, duration, **more))
    scene["ends"]["start"] = {"kind": "clamped", "position": [0, 0, 0], "tangent": [1, 0, -0.3]}
    if section:
        del scene["cable"]["sections"][0]["bending_stiffness"]
        scene["cable"]["sections"][0] |= section
    return scene


def settles(scene: dict[str, Any], length: float) -> tuple[hybrid.Result, hybrid.Result]:
    """A scene whose line of 100 m becomes so long, slowly, in water; and the equilibrium of a line of that length."""
    section = scene["cable"]["sections"][0]
    section["drag"] = {"normal": 1.5, "tangential": 0.3}
    section["damping"] = {"mass": 0.4}
    scene["environment"] = {"fluid": {"density": 1025}}
    scene["time"], scene["output"] = {"duration": 80.0, "step": 0.25}, {"every": 80.0}
    end = scene["ends"]["end"]
    del end["motion"]
    still = {**scene, "ends": {**scene["ends"], "end": {k: x for k, x in end.items() if k != "payout"}}}
    still["cable"] = {**scene["cable"], "sections": [{**section, "length": length}]}
    end["payout"] = {"lengths": [[0, 100], [15, 0.5 * (100 + length)], [30, length]]}
    # Those that ride with the winch and the one that grows are as long as all others at these lengths.
    scene["mesh"], still["mesh"] = (
        {"nodes": [*np.arange(0, 10, 0.5), *np.arange(10, x + 1, 2.5)]} for x in (100, length)
    )
    scene["output"] |= {"points": round(0.4 * max(100, length)) + 1}
    still["output"] = {"points": round(0.4 * length) + 1}
    return hybrid.run(scene), hybrid.static(still)


@pytest.mark.parametrize("length", [110.0, 90.0])
@pytest.mark.parametrize(
    ("section", "attachment"), [({}, CONE), (TABLE, None), ({}, RESTRICTOR)], ids=["stiffener", "table", "restrictor"]
)
def test_it_comes_to_rest_as_a_line_of_the_final_length(
    section: dict[str, Any], attachment: dict[str, Any] | None, length: float
) -> None:
    scene = paid(section)
    if attachment:
        scene["cable"]["attachments"] = [attachment]
    moved, rest = settles(scene, length)
    at, its = (np.searchsorted(x["s"], 2.5 * np.arange(0.4 * length) - 1e-6) for x in (moved, rest))
    np.testing.assert_allclose(moved["s"][at], rest["s"][its])
    assert np.abs(moved.position[-1, at] - rest.position[-1, its]).max() < 1e-5 * length
    assert np.abs(moved["moment"][-1, at] - rest["moment"][-1, its]).max() < 1e-5 * np.abs(rest["moment"]).max()
    pull = np.linalg.norm(rest["reaction_end"][-1])
    assert np.linalg.norm(moved["reaction_end"][-1] - rest["reaction_end"][-1]) < 1e-5 * pull


def bent() -> dict[str, Any]:
    """A table at the winch, and a stiffener at the other end."""
    scene = paid(TABLE)
    scene["cable"]["attachments"] = [CONE]
    return scene


# --- rods that are curved without load, and swivels ---

LENGTH = 8.0
SECTION = {
    "length": LENGTH, "mass": 1.0, "diameter": 0.05, "axial_stiffness": 1e5, "bending_stiffness": 60.0,
    "torsional_stiffness": 50.0, "damping": {"mass": 2.0},
}  # fmt: skip
CURL = [0.25, 0.2, 0.1]
FAR = {"kind": "clamped", "position": [0, 0, 0], "tangent": [1, 0, 0.5], "normal": [0, 1, 0]}
NEAR = {"kind": "clamped", "position": [6, 0, 1], "tangent": [1, 0, 0.6], "normal": [0, 1, 0]}


def curled(rate: float | None, duration: float, near: dict[str, Any], **changes: Any) -> dict[str, Any]:
    paid = {} if rate is None else {"payout": {"rate": rate, "ramp": 4.0}}
    scene = cable_scene(
        SECTION, FAR, near | paid, gravity=9.81, model="rod", mesh=40, contact={"self": False},
        time=(duration, duration / 800), output=(duration / 10, 17)
    )  # fmt: skip
    return dict(tables_with(scene, changes))


def test_a_curved_rod_that_is_paid_out_freely_follows_its_own_arc() -> None:
    """Without weight it leaves the clamp along the circle of its curvature, and has no moment: a closed form."""
    kappa, rate, begin, EI = 0.5, 0.1, 2.0, 60.0
    section = {"length": begin, "mass": 1.0, "diameter": 0.05, "axial_stiffness": 1e6, "bending_stiffness": EI,
               "torsional_stiffness": EI, "intrinsic_curvature": [0, kappa, 0]}  # fmt: skip
    winch = {"kind": "clamped", "position": [0, 0, 0], "tangent": [1, 0, 0], "normal": [0, 0, 1]}
    result = hybrid.run(cable_scene(
        section, {"kind": "free"}, winch | {"payout": {"rate": rate, "ramp": 4.0}}, gravity=0, model="rod", mesh=20,
        contact={"self": False}, time=(12.0, 0.01), output=(2.0, 5)
    ))  # fmt: skip
    out = result["payout/length"]
    assert out[-1] == pytest.approx(begin + rate * 10.0, abs=1e-9)
    way = np.array([np.sin(kappa * out), 0.0 * out, 1.0 - np.cos(kappa * out)]).T / kappa
    assert np.abs(np.abs(result.position[:, 0]) - way).max() < 1e-3 * begin  # of the free end, s = 0
    assert result["energy/bending"].max() < 1e-5 * 0.5 * EI * kappa**2 * begin


@pytest.mark.parametrize("rate", [0.3, -0.3])
def test_energy_that_comes_with_curved_material_is_booked(rate: float) -> None:
    """The scheme is left with a thousandth of a joule of the 3 J that bending changes by, at a clamp where bends stay."""
    result = hybrid.run(curled(rate, 4.0, NEAR, **{"cable.sections.0.intrinsic_curvature": CURL}))
    assert abs(result["work/scheme"][-1]) < 2e-3
    assert abs(result["energy/bending"][-1] - result["energy/bending"][0]) > 3.0


def test_a_curved_rod_comes_to_rest_where_one_of_its_length_does() -> None:
    """Paid out slowly, in damping: the equilibrium of the longer line, from which one that is straight is far."""
    near = {"kind": "pinned", "position": [6, 0, 1]}
    curved = {"cable.sections.0.intrinsic_curvature": CURL}
    slowly = hybrid.run(curled(0.02, 40.0, near, **curved))
    long = float(slowly["payout/length"][-1])
    s = slowly.s[slowly.s <= LENGTH]
    rest, straight = (
        hybrid.static(curled(None, 40.0, near, **{"cable.sections.0.length": long} | more)) for more in (curved, {})
    )
    there, other = (np.array([np.interp(s, x.s, x.position[-1, :, k]) for k in range(3)]).T for x in (rest, straight))
    found = slowly.position[-1, : s.size]
    assert np.abs(found - there).max() < 5e-3
    assert np.abs(found - other).max() > 0.1


def test_a_swivel_near_the_far_end_of_a_line_that_is_paid_out_lets_it_turn() -> None:
    """The far clamp turns by 1 rad: torque GJ/L of what is out without a swivel, and none with it but by inertia."""
    turn = {"roll": {"amplitude": float(np.degrees(1.0)), "period": 16.0, "phase": -90}, "ramp": 2.0}
    taut = {
        "ends.start": FAR | {"tangent": [1, 0, 0], "motion": turn}, "environment.gravity": 0.0,
        "cable.sections.0.damping": {"mass": 0.5}, "time.step": 0.01,
    }  # fmt: skip
    near = NEAR | {"position": [8.1, 0, 0], "tangent": [1, 0, 0]}
    swivel = {"cable.attachments": [{"kind": "swivel", "at": 1.0}]}
    plain, free = (hybrid.run(curled(0.005, 8.0, near, **taut, **x)) for x in ({}, swivel))
    out = plain["payout/length"][-1]
    assert out == pytest.approx(LENGTH + 0.005 * 6.0, abs=1e-9)
    assert np.abs(plain["torque"][-1]).max() == pytest.approx(SECTION["torsional_stiffness"] / out, rel=1e-3)
    assert np.abs(free["torque"]).max() < 1e-3 * np.abs(plain["torque"]).max()
    assert free.position[-1] == pytest.approx(
        np.array([np.interp(free.s, plain.s, plain.position[-1, :, k]) for k in range(3)]).T, abs=1e-6 * LENGTH
    )


def test_events_of_outputs_stand_on_the_line_as_it_was(tmp_path: Path) -> None:
    """A bend that is seen at t = 0, looked at with outputs of later lines: where the end was, as a file has it."""
    taut = {"kind": "clamped", "position": [8.02, 0, 0], "tangent": [1, 0, 0.3]}
    start = {"ends.start.tangent": [1, 0, 0.3]}
    scene = curled(0.4, 2.0, taut, **start, **{"mesh.cells": 16, "model": {"kind": "adaptive", "tolerance": 3e-3}})
    with hybrid.run(scene) as kept, hybrid.run(scene, tmp_path / "run.h5") as written:
        assert kept.events == written.events
        places = {x.s_a for x in kept.events if x.kind == "unresolved bend" and x.t == 0.0}
    assert places == {0.0, LENGTH}
