"""Forces at ends that a body or the seabed carries: right at any mesh."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import hybrid
from tests.scenes import cable_scene, pinned_at

DEFECTS = Path(__file__).parents[1] / "data" / "defects"
BED = -50.0
CHAIN = {"length": 300, "mass": 40, "diameter": 0.08, "axial_stiffness": 1.5e8}
RHO, G = 1025.0, 9.81
WEIGHT = G * (40 - RHO * np.pi / 4 * 0.08**2)  # N/m, in water


@pytest.mark.parametrize("cells", [5, 40])
def test_the_force_of_an_end_body_is_what_acts_on_it(cells: int) -> None:
    """A weight that hangs in a current: its drag and its weight in water, to round-off (defects/body_end_reaction)."""
    towed = hybrid.load_scene(DEFECTS / "body_end_reaction.yaml", [f"mesh.cells={cells}"])
    found = hybrid.static(towed)
    drag, weight = 0.5 * 1025 * 0.23 * 0.5**2, 9.81 * (320 - 1025 * 0.083)
    np.testing.assert_allclose(found.reaction_end[0], [drag, 0.0, -weight], rtol=1e-9, atol=1e-6)
    assert found["h"][0] == pytest.approx(drag, rel=1e-9)
    assert found.tension[0, -1] == pytest.approx(np.hypot(drag, weight), rel=1e-3)


def swung(cells: int, model: str, dimension: int = 3) -> hybrid.Result:
    """A clump below a line in water whose upper end surges."""
    section = {"length": 20, "mass": 5, "diameter": 0.05, "axial_stiffness": 1e6, "bending_stiffness": 10}
    surge = {"surge": {"amplitude": 1.0, "period": 4}, "ramp": 4}
    return hybrid.run(
        hybrid.validate_scene(
            cable_scene(
                section | {"drag": {"normal": 1.2}, "added_mass": {"normal": 1}},
                pinned_at(0, 0, 0, motion=surge),
                {"kind": "body", "mass": 60, "volume": 0.01, "drag_area": 0.1, "added_mass": 8},
                fluid={"density": RHO},
                model=model,
                mesh=cells,
                dimension=dimension,
                time=(6, 0.02),
            )
        )
    )


@pytest.mark.parametrize(("model", "dimension"), [("catenary", 3), ("rod", 2)])
def test_in_motion_its_inertia_and_drag_are_in_it(model: str, dimension: int) -> None:
    """Newton's law of the body, with its acceleration from three outputs; that of the last cell is off by 6.7 N."""
    found = swung(4, model, dimension)
    r, dt = found.position[:, -1], float(found.times[1] - found.times[0])
    v, a = (np.gradient(x, dt, axis=0)[2:-2] for x in (r, np.gradient(r, dt, axis=0)))
    drag = -0.5 * RHO * 0.1 * np.linalg.norm(v, axis=1)[:, None] * v
    expected = (60 + 8) * a - drag + [0.0, 0.0, G * (60 - RHO * 0.01)]  # what pulls at it
    assert np.ptp(expected[:, 0]) > 60.0
    np.testing.assert_allclose(-found.reaction_end[2:-2], expected, atol=0.04 * np.ptp(expected[:, 0]))


def moored(cells: int, **more: Any) -> hybrid.Scene:
    """A chain from an anchor on the seabed; its last 140 m hang."""
    section = CHAIN | more.pop("section", {})
    return hybrid.validate_scene(
        cable_scene(
            section,
            pinned_at(0, 0, BED) | more.pop("start", {}),
            more.pop("end", pinned_at(286, 0, 0)),
            fluid={"density": RHO},
            seabed={"z": BED, "stiffness": 1e4},
            model="catenary",
            mesh=cells,
        )
        | more
    )


@pytest.mark.parametrize("cells", [15, 60, 600])
def test_an_anchor_bears_what_the_bed_does_not(cells: int) -> None:
    """The line sinks to w/k over sqrt(T/k), and w sqrt(T/k) hangs on the anchor, not a third of a cell more (20 m: 2.07 kN)."""
    found = hybrid.static(moored(cells))
    along, up = found.reaction_start[0, 0], -found.reaction_start[0, 2]
    layer = WEIGHT * np.sqrt(-along / 1e4)
    assert 200 < layer < 900
    assert -up == pytest.approx(layer, abs=min(0.03 * WEIGHT * 300 / cells, 0.06 * layer))


@pytest.mark.parametrize("clamped", [False, True])
def test_an_anchor_of_a_rod_bears_what_its_layer_makes(clamped: bool) -> None:
    """EI p'''' - T p'' + k p = w has the two lengths 1/r; of a pinned end w (q + p)/(p sqrt(q + 2p)), p = sqrt(k/EI),

    q = T/EI, of a clamped one w sqrt(q + 2p)/p."""
    EI = 2e4
    section = {"bending_stiffness": EI}
    start = {"kind": "clamped", "tangent": [1, 0, 0]} if clamped else {}
    found = hybrid.static(moored(60, model="rod", section=section, start=start))
    p, q = np.sqrt(1e4 / EI), -found.reaction_start[0, 0] / EI
    length = np.sqrt(q + 2 * p) / p if clamped else (q + p) / (p * np.sqrt(q + 2 * p))
    assert found.reaction_start[0, 2] == pytest.approx(WEIGHT * length, abs=0.1 * WEIGHT * 5)


def test_an_anchor_beside_touchdown_and_above_the_bed() -> None:
    """The force changes smoothly where touchdown comes to the anchor, and where this is raised."""
    taut = [{"kind": "pinned", "position": [float(x), 0, 0]} for x in np.linspace(291, 296, 26)]
    forces = [hybrid.static(moored(30, end=end)).reaction_start[0, 2] for end in taut]
    assert np.abs(np.diff(forces, 2)).max() < 0.1 * np.ptp(forces)
    heights = (-1e-6, 0.0, 1e-6, 0.1)
    raised = [hybrid.static(moored(30, start={"position": [0, 0, BED + z]})).reaction_start[0, 2] for z in heights]
    assert np.ptp(raised[:3]) < 1e-3 * raised[1] < raised[3] - raised[1]


ANCHORED = {"length": 60, "mass": 3, "diameter": 0.04, "axial_stiffness": 1e6, "bending_stiffness": 50}


def anchored(cells: int, model: str, clamped: bool, height: float, exchanged: bool = False) -> dict[str, Any]:
    """An umbilical from a support at a height above its bed of 3 kN/m2; its layers, 0.24 to 0.6 m, are within a cell."""
    end = pinned_at(0, 0, height - 20)
    if clamped:
        end |= {"kind": "clamped", "tangent": [-1 if exchanged else 1, 0, 0], "normal": [0, 1, 0]}
    ends = (end, pinned_at(50, 0, -1))
    return cable_scene(
        ANCHORED, *(ends[::-1] if exchanged else ends), fluid={"density": RHO},
        seabed={"z": -20, "stiffness": 3000, "damping": 0}, model=model, mesh=cells
    )  # fmt: skip


SUPPORTS = [("rod", False), ("rod", True), ("catenary", False)]


@pytest.mark.parametrize(("model", "clamped"), SUPPORTS)
def test_the_force_at_a_support_has_no_jump_and_no_kink_at_the_level_of_the_bed(model: str, clamped: bool) -> None:
    """Below, at and above the bed: slopes on both sides agree, and forces are those of cells of a sixteenth.

    It had two values by rounding at the level of the bed, 8.504 and 9.838 N of the rod, where such cells say 5.5 N."""
    heights = (-3e-3, -1e-5, 0.0, 1e-5, 1e-3, 0.1)

    def forces(cells: int, exchanged: bool = False) -> list[float]:
        found = [hybrid.static(anchored(cells, model, clamped, z, exchanged)) for z in heights]
        return [float(x["reaction_end" if exchanged else "reaction_start"][0, 2]) for x in found]

    coarse, fine = forces(60), forces(960)
    below, above = coarse[2] - coarse[1], coarse[3] - coarse[2]
    assert below == pytest.approx(above, rel=0.04) and 0.0 < above < 0.01 * coarse[2]
    np.testing.assert_allclose(coarse, fine, rtol=0.12)
    np.testing.assert_allclose(forces(60, exchanged=True), coarse, rtol=1e-6)


@pytest.mark.parametrize("model", ["catenary", "rod"])
def test_a_taut_leg_leaves_an_anchor_at_the_level_of_the_bed_as_one_a_micron_above_or_below(model: str) -> None:
    """At 28 degrees upwards, where nothing of the cell lies: rounding of the depth has no part in the force.

    It was -15 084 N at 100 m and -20 750 N of the rod, where cells of an eighth say -21 015 N and -21 037 N."""
    leg = {"length": 1.85, "mass": 10, "diameter": 0.05, "axial_stiffness": 1e7, "bending_stiffness": 2e3}
    for depth in (100.0, 33.7, 57.1, 150.1):
        sea = {"fluid": {"density": RHO, "surface": 0}, "seabed": {"z": -depth, "stiffness": 1e4, "damping": 1e3}}
        anchors = [[1.5 * depth, 0, z - depth] for z in (-1e-6, 0.0, 1e-6)]
        cable = {"sections": [leg | {"length": 1.85 * depth}]}
        tables = {"environment": sea, "cable": cable, "initial": "equilibrium", "model": model, "mesh": {"cells": 20}}
        top = {"kind": "pinned", "position": [0, 0, 0.09 * depth]}
        ends = [{"start": {"kind": "pinned", "position": x}, "end": top} for x in anchors]
        forces = [hybrid.static(tables | {"ends": x}).reaction_start[0, 2] for x in ends]
        np.testing.assert_allclose(forces, forces[0], rtol=1e-5)


def test_a_stiff_rod_that_rises_from_its_anchor_without_tension_does_not_lie_beside_it() -> None:
    """Its tension counted as the weight of a cell, under which a line without bending would hang down to the bed.

    It was 299 N upwards for 515 N with a buoyant middle, in cells of 1.5 m."""
    rope = {"diameter": 0.085, "mass": 12.6, "axial_stiffness": 1.32e7, "bending_stiffness": 1.78e4}
    sections = [
        rope | {"length": 22.3},
        rope | {"length": 24.3, "diameter": 0.202, "mass": 25.8},
        rope | {"length": 31.6},
    ]
    z = -68.30569792314034
    tables = cable_scene(
        sections, pinned_at(102.4, 41, z), pinned_at(116.09, 15.24, -34.99), model="rod",
        fluid={"density": RHO}, seabed={"z": z, "stiffness": 3726},
    )  # fmt: skip
    coarse, fine = (hybrid.static(tables | {"mesh": {"cells": n}}).reaction_start[0, 2] for n in (53, 212))
    assert coarse == pytest.approx(fine, rel=0.01)


@pytest.mark.long
def test_what_a_support_at_the_level_of_the_bed_answers_to_is_known_in_motion() -> None:
    """Derivatives by mass along the steps of a run against runs with 0.1 % more and less.

    That of tension was -23 948 N m/kg, with a stated error of 0.01."""
    scene, key = DEFECTS / "support_on_bed.yaml", "cable.sections[0].mass"
    of = ["max tension@start", "max reaction_start.z"]
    found = hybrid.sensitivity(hybrid.load_scene(scene), of, [key], motion=True)
    runs = [hybrid.run(hybrid.load_scene(scene, [f"{key}={x}"])) for x in (2.997, 3.003)]
    (a, b), (c, d) = ((x.tension[:, 0].max(), x["reaction_start"][:, 2].max()) for x in runs)
    assert [x.derivative for x in found] == pytest.approx([(c - a) / 0.006, (d - b) / 0.006], rel=0.02)


@pytest.mark.parametrize("shape", ["cylinder", "sphere"])
def test_added_mass_acts_as_given_at_the_draught_of_a_body(shape: str) -> None:
    """Heave of a float at its draught: 2 pi sqrt((m + a)/(rho g A)), A the slope of what it displaces there."""
    mass, volume, height, added = 500.0, 0.8, 1.0, 300.0
    wet = mass / (RHO * volume)
    x = wet if shape == "cylinder" else float(np.roots([-2, 3, 0, -wet])[1].real)
    slope = 1.0 if shape == "cylinder" else 6 * x * (1 - x)
    stiffness = RHO * G * volume * slope / height
    body = {"kind": "body", "mass": mass, "volume": volume, "height": height, "shape": shape, "added_mass": added}
    up = (0.5 - x) * height
    found = hybrid.run(cable_scene(
        {"length": 1, "mass": 0.01, "diameter": 1e-3, "axial_stiffness": 1e4}, body, "free",
        initial={"kind": "straight", "origin": [0, 0, up + 0.01], "direction": [0, 0, -1]},
        fluid={"density": RHO, "surface": 0}, model="catenary", mesh=2, time=(6, 0.005, 1), output=0.01,
    ))  # fmt: skip
    z = found.position[:, 0, 2] - up
    turns = np.flatnonzero(np.diff(np.sign(z)))
    times = found.times[turns] - z[turns] * np.diff(found.times)[turns] / np.diff(z)[turns]
    period = 2 * float(np.mean(np.diff(times)))
    assert period == pytest.approx(2 * np.pi * np.sqrt((mass + added) / stiffness), rel=5e-3)
