"""Scenes with which others have broken zones that move, each held against the rod of the same scene."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from adapt_scenes import changes, rods
from problems import clamped, free, pinned

import hybrid
from tests.scenes import cable_scene, pinned_at

Text = dict[str, Any]


def scene(section: Text, start: Text, end: Text, **more: Any) -> Text:
    text: Text = cable_scene(section, start, end, model={"kind": "adaptive"}, time=(10.0, 0.02), output=0.25)
    return text | more


def compared(text: Text) -> tuple[hybrid.Result, hybrid.Result, np.ndarray]:
    """The run, that of the rod, and the largest distance at every output over the tolerance."""
    L = text["cable"]["sections"][0]["length"]
    a = hybrid.run(hybrid.validate_scene(text))
    r = hybrid.run(hybrid.validate_scene(text | {"model": text["model"] | {"force_rod": [[0, L]]}}))
    far = np.linalg.norm(a.position - r.position, axis=2).max(axis=1)
    return a, r, far / L / text["model"].get("tolerance", 1e-3)


@pytest.mark.parametrize("moment, tolerance", [(100.0, 1e-3), (400.0, 1e-3), (400.0, 1e-4)])
def test_a_moment_that_grows_at_a_free_end(moment, tolerance):
    """M/T is what it holds the cable off its catenary by; it grows from nothing, so no equilibrium knows of it."""
    section = {"length": 20, "mass": 1, "bending_stiffness": 50, "axial_stiffness": 1e6, "damping": {"mass": 0.5}}
    end = free(force=[200, 0, -800], moment={"value": [0, moment, 0], "ramp": 5})
    model, mesh = {"kind": "adaptive", "tolerance": tolerance}, {"cells": 60}
    a, r, far = compared(scene(section, pinned(), end, model=model, mesh=mesh))
    assert far.max() < 1.0
    assert a.bending_moment[-1, -3:] == pytest.approx(r.bending_moment[-1, -3:], rel=1e-3)


def test_a_torque_that_grows_at_a_free_end_needs_rods_all_along():
    section = {
        "length": 20, "mass": 1, "bending_stiffness": 50, "torsional_stiffness": 400, "axial_stiffness": 1e6,
        "damping": {"mass": 0.5},
    }  # fmt: skip
    end = free(force=[800, 0, 0], moment={"value": [200, 0, 0], "ramp": 5})
    a, r, far = compared(scene(section, clamped(), end))
    assert far.max() < 1.0 and rods(a, 0) == rods(a, -1) == [(0.0, 20.0)]
    assert a.torque[-1] == pytest.approx(r.torque[-1], rel=1e-3)


def test_a_torque_in_a_curved_cable_is_held_against_the_tolerance():
    """M turn/(2 T): a twisted cable leaves its plane long before it could go into a loop (M^2/(4 EI T) is 0.07 here)."""
    section = {"length": 20, "mass": 0.5, "bending_stiffness": 5.0, "axial_stiffness": 1e6, "damping": {"mass": 0.5}}
    roll = {"roll": {"amplitude": 1440.0, "period": 40.0}, "ramp": 2.0}
    end = clamped((19, 0, 0), (1, 0, 0.35), motion=roll)
    a, r, far = compared(scene(section, clamped((0, 0, 0), (1, 0, -0.35)), end))
    assert far.max() < 1.0
    assert rods(a, -1) == [(0.0, 20.0)] and any(e.criterion == "torsion" for e in changes(a))
    assert a.torque[-1] == pytest.approx(r.torque[-1], rel=0.01)
    assert np.abs(r.position[-1, :, 1]).max() > 0.02  # what a catenary would have missed: the tolerance


@pytest.mark.parametrize("cells, span, tolerance", [(8, 60, 1e-3), (3, 90, 1e-3), (3, 60, 1e-2)])
def test_long_cells_are_those_of_rods_too(cells, span, tolerance):
    """Zones that move have the mesh of rods: however coarse it is, they differ by what bending does alone."""
    section = {"length": 100, "mass": 2, "bending_stiffness": 50, "axial_stiffness": 1e6}
    model = {"kind": "adaptive", "tolerance": tolerance}
    a, _, far = compared(scene(section, pinned(), pinned(span, 0, 0), mesh={"cells": cells}, model=model))
    assert far.max() < 0.1 and np.abs(a.velocity).max() < 1e-9
    assert not any(e.kind == "zones fixed" for e in a.events)
    assert a.mesh[-1].kinds.size == cells


def test_curvature_without_stress_bends_a_straight_cable():
    section = {
        "length": 20, "mass": 5, "bending_stiffness": 50, "torsional_stiffness": 40, "axial_stiffness": 1e6,
        "intrinsic_curvature": (2.0, 0, 0), "damping": {"mass": 0.5},
    }  # fmt: skip
    ends = clamped((0, 0, 0), (1, 0, -0.4)), clamped((19, 0, 0), (1, 0, 0.4))
    a, _, far = compared(scene(section, *ends, time={"duration": 4.0, "step": 0.02}))
    assert far.max() < 1.0 and np.abs(a.velocity).max() < 1e-6


@pytest.mark.parametrize("dwell", [1e-3, 0.05, None, 100.0])
def test_dwell_is_no_blending_time(dwell):
    """However short or long a rod must be calm, bending comes and goes in a time of the line's own."""
    section = {
        "length": 60, "mass": 1.5, "bending_stiffness": 5, "axial_stiffness": 1e6, "diameter": 0.03,
        "drag": {"normal": 1.2, "tangential": 0.1}, "added_mass": {"normal": 1.0},
    }  # fmt: skip
    end = pinned(52, 0, -3, motion={"surge": {"amplitude": 5.0, "period": 6.0}, "ramp": 6.0})
    water = {
        "environment": {"fluid": {"density": 1025}},
        "model": {"kind": "adaptive"} | ({"hold_time": dwell} if dwell else {}),
    }
    time, mesh = {"duration": 20.0, "step": 0.02}, {"cells": 60}
    a, r, far = compared(scene(section, pinned(), end, **water, time=time, mesh=mesh))
    assert far.max() < 1.0
    assert np.abs(a["work/scheme"]).max() < 1.5 * np.abs(r["work/scheme"]).max()


def test_an_inextensible_cable_that_snaps_creates_no_energy():
    """Zones come and go twice, then it snaps taut again and again."""
    section = {
        "length": 100, "mass": 2, "bending_stiffness": 50, "diameter": 0.03, "drag": {"normal": 1.2},
        "added_mass": {"normal": 1.0},
    }  # fmt: skip
    end = pinned(90, 0, 0, motion={"surge": {"amplitude": 8.0, "period": 6.0}, "ramp": 12.0})
    more = {"environment": {"fluid": {"density": 1025}}, "time": {"duration": 40.0, "step": 0.02}}
    a, r, _ = compared(scene(section, pinned(), end, **more))
    assert changes(a)
    assert np.abs(a["work/scheme"]).max() < 1.2 * np.abs(r["work/scheme"]).max()


def test_force_catenary_is_so_from_the_beginning():
    section = {"length": 60, "mass": 1, "bending_stiffness": 100, "axial_stiffness": 1e6}
    model = {"kind": "adaptive", "tolerance": 1e-5, "force_catenary": [[20, 40]]}
    text = scene(section, pinned(), pinned(55, 0, 0), model=model, time={"duration": 1.0, "step": 0.02})
    a = hybrid.run(hybrid.validate_scene(text))
    for k in (0, -1):
        assert all(not (z.s_a < 40 and z.s_b > 20) for z in a.zones[k] if z.kind == "rod")
    assert rods(a, 0) and not changes(a)
    start = text | {"initial": {"kind": "straight", "direction": (0, 0, -1)}}
    start["ends"] = {"start": pinned(), "end": free()}
    del section["axial_stiffness"]  # or weight, there at once, would send waves along it
    a = hybrid.run(hybrid.validate_scene(start))
    assert rods(a, 0) == [(0.0, 20.0), (40.0, 60.0)]


def test_a_clamp_that_is_left_out_is_said():
    section = {"length": 500, "mass": 1.2, "bending_stiffness": 20, "axial_stiffness": 3e6}
    text = scene(section, pinned(), clamped((400, 0, -100)), time={"duration": 0.2, "step": 0.02})
    a = hybrid.run(hybrid.validate_scene(text))
    (said,) = [e for e in a.events if e.kind == "bending at clamp neglected"]
    assert said.s_a == 500.0 and "force_rod: [[4" in said.text
    asked = text | {"model": {"kind": "adaptive", "force_rod": [[490, 500]]}}
    assert not [e for e in hybrid.run(hybrid.validate_scene(asked)).events if e.kind == "bending at clamp neglected"]


def test_sections_that_lie_one_way_or_the_other_are_refused():
    """A catenary does not know how its sections lie: rods came back on their stiff axis."""
    section = {"length": 60, "mass": 1.5, "bending_stiffness": (200, 20), "torsional_stiffness": 20}
    with pytest.raises(hybrid.SceneError, match="does not know which way its sections lie"):
        hybrid.validate_scene(scene(section, pinned(), pinned(52, 0, 0)))
    silent = scene(section, clamped(normal=(0, 1, 0)), pinned(52, 0, 0))
    del silent["model"]
    assert hybrid.validate_scene(silent).model.kind == "rod"


def test_a_step_that_fails_gets_all_of_the_stiffness_back():
    """Rods half blended out are no less a cause than catenaries: they are stiff again before a step is given up."""
    section = {
        "length": 60, "mass": 1.5, "bending_stiffness": 50.0, "torsional_stiffness": 20, "axial_stiffness": 1e6,
        "diameter": 0.03, "intrinsic_curvature": (0.3, 0, 0.5), "drag": {"normal": 1.2}, "added_mass": {"normal": 1.0},
    }  # fmt: skip
    end = clamped((52, 0, -3), (1, 0, 0.5), motion={"surge": {"amplitude": 3.0, "period": 6.0}, "ramp": 6.0})
    more = {"environment": {"fluid": {"density": 1025}}, "time": {"duration": 8.0, "step": 0.02}}
    a = hybrid.run(hybrid.validate_scene(scene(section, clamped((0, 0, 0), (1, 0, -0.5)), end, **more)))
    assert a.status == "complete"


# --- ends that leave the spin free, and torque where zones change ---


def hanging(random: np.random.Generator) -> dict[str, Any]:
    """A cable that hangs from a moving pin in a current that turns with depth; SI units."""
    length, mass = random.uniform(15.0, 60.0), random.uniform(0.3, 2.0)
    width = np.sqrt(4.0 * random.uniform(0.2, 0.7) * mass / (1025.0 * np.pi))
    period = random.uniform(5.0, 14.0)
    top = random.uniform(-0.25, 0.25, size=2)
    duration = 1.7 * period
    section = {
        "length": length, "mass": mass, "diameter": float(width), "axial_stiffness": 3e5,
        "bending_stiffness": float(np.exp(random.uniform(np.log(0.5), np.log(50.0)))),
        "drag": {"normal": 1.1, "tangential": 0.02}, "added_mass": {"normal": 1.0},
        "damping": {"mass": 0.05, "stiffness": 3e-4},
    }  # fmt: skip
    profile = [{"z": 0.0, "velocity": [*top, 0.0]}, {"z": -length, "velocity": [*(0.3 * top[::-1]), 0.0]}]
    surge = {"amplitude": random.uniform(0.1, 0.6), "period": period, "phase": random.uniform(0.0, 360.0)}
    return cable_scene(
        section, pinned_at(0.0, 0.0, 0.0, motion={"ramp": 1.8 * period, "surge": surge}), {"kind": "free"},
        fluid={"density": 1025, "current": profile}, mesh={"cells": 80, "ratio": 0.1},
        time=(duration, duration / 200.0), output=(duration / 20.0, 41)
    )  # fmt: skip


@pytest.mark.long  # 1.8 s
def test_forty_one_lines_with_free_ends_take_no_more_steps_than_asked() -> None:
    random = np.random.default_rng(41)
    for number in range(41):
        scene = hanging(random)
        result = hybrid.run(hybrid.validate_scene(scene | {"model": "adaptive"}))
        assert len(result["steps/t"]) <= 201 and not result["steps/repeats"][:].any(), f"line {number}"
        assert any(zone.kind == "rod" for zones in result.zones for zone in zones), f"line {number}"


def defect(force: float, length: float, time: float) -> dict[str, Any]:
    """The line that went through half a turn at once where its bend went through zero, in other units.

    force, length, time: size of the new unit of each.
    """
    mass = force * time**2 / length
    profile = [(0.0, 0.17324, 0.0584537), (-31.312, 0.051972, 0.0149872)]
    section = {
        "length": 31.312 * length, "mass": 0.648869 * mass / length, "diameter": 0.0183625 * length,
        "bending_stiffness": 6.61467 * force * length**2, "axial_stiffness": 257186.0 * force,
        "drag": {"normal": 1.0342, "tangential": 0.0192986}, "added_mass": {"normal": 0.538673},
        "damping": {"mass": 0.048755 / time, "stiffness": 0.000302503 * time},
    }  # fmt: skip
    surge = {"amplitude": 0.429689 * length, "period": 8.30559 * time, "phase": 33.4594}
    current = [{"z": z * length, "velocity": [x * length / time, y * length / time, 0.0]} for z, x, y in profile]
    return cable_scene(
        section, {"kind": "pinned", "position": [0.0] * 3, "motion": {"ramp": 15.1943 * time, "surge": surge}},
        {"kind": "free"}, fluid={"density": 1025.0 * mass / length**3, "current": current},
        gravity=9.80665 * length / time**2, mesh={"cells": 80, "ratio": 0.1}, model="adaptive",
        time=(13.8593 * time, 0.0692965 * time), output=(0.692963 * time, 201)
    )  # fmt: skip


def test_the_units_of_a_line_with_a_free_end_do_not_matter() -> None:
    here, there = (
        hybrid.run(hybrid.validate_scene(defect(*units))) for units in ((1.0, 1.0, 1.0), (94.9, 8.36, 1.8784))
    )
    assert len(here["steps/t"]) == len(there["steps/t"]) <= 201
    assert not here["steps/repeats"][:].any()
    np.testing.assert_allclose(there.position / 8.36, here.position, atol=1e-6 * 31.312)


# --- torque where zones change ---


def line(folder, turns, model, swing, span=12.0):
    """20 m of slack cable between clamps, one of which is turned by so many turns and swings along x by `swing`, m."""
    t = np.linspace(0.0, 14.0, 281)
    x, y = np.clip((t - 1.0) / 6.0, 0.0, 1.0), np.clip(t / 6.0, 0.0, 1.0)
    angle = 360.0 * turns * x**3 * (10.0 - 15.0 * x + 6.0 * x**2)
    shift = span + swing * np.sin(0.9 * t) * y**3 * (10.0 - 15.0 * y + 6.0 * y**2)
    path = folder / "end.csv"
    table = np.column_stack([t, shift, 0.0 * t, 0.0 * t, angle, 0.0 * t, 0.0 * t])
    np.savetxt(path, table, delimiter=",", header="t,x,y,z,rx,ry,rz", comments="")
    section = {
        "length": 20.0, "mass": 0.1, "diameter": 0.02, "bending_stiffness": 2.0, "axial_stiffness": 1e5,
        "damping": {"mass": 0.5},
    }  # fmt: skip
    clamp = {"kind": "clamped", "tangent": [1, 0, 0], "normal": [0, 0, 1]}
    return hybrid.run(
        hybrid.validate_scene(
            cable_scene(
                section,
                {**clamp, "position": [0, 0, 0]},
                {**clamp, "position": [span, 0, 0], "motion": {"file": str(path)}},
                mesh=80,
                model=model,
                time=(14.0, 0.02),
                output=0.5,
            )
        )
    )


@pytest.mark.parametrize(("turns", "swing"), [(2.0, 0.0), (-2.6, 3.0), (1.3, 5.0)])
def test_torque_of_zones_that_move(tmp_path, turns, swing):
    """Within 1e-3 of the largest torque of all rod, however often rods come and go; a turn is more than 0.1 of it."""
    adaptive = {"kind": "adaptive", "tolerance": 0.004, "hold_time": 0.5}
    rod, mixed = (line(tmp_path, turns, model, swing) for model in ("rod", adaptive))
    torque = rod["torque"][:].mean(axis=1)
    assert len(mixed.events) >= 2
    assert "torque neglected" not in {event.kind for event in mixed.events}
    np.testing.assert_allclose(mixed["torque"][:].mean(axis=1), torque, atol=1e-3 * np.abs(torque).max())


@pytest.mark.slow
def test_no_turn_is_lost_in_sixty_motions(tmp_path):
    """Turns and swings at random: what the clamp turns by is the link of the line, in rods, zones and between them."""
    adaptive, random = {"kind": "adaptive", "tolerance": 0.004, "hold_time": 0.5}, np.random.default_rng(60)
    changes = 0
    for _ in range(60):
        turns, swing = random.uniform(-3.0, 3.0), random.uniform(0.0, 5.0)
        result = line(tmp_path, turns, adaptive, swing)
        kinds = {event.kind for event in result.events}
        changes += len(kinds & {"split", "grow", "merge", "shrink"}) > 0
        lost = turns - result["turns/link"][result.times > 7.5]  # two at a time where it passes through itself
        through = 2.0 * np.round(0.5 * lost) if "line meets itself" in kinds else 0.0
        np.testing.assert_allclose(lost, through, atol=1e-6, err_msg=f"{turns} turns, swing {swing} m")
    assert changes >= 50
