"""Numbers in a wrong unit get a word, or are refused: with place, value, expected range and remedy; others do not."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

import hybrid
from hybrid.errors import SceneError
from hybrid.model.plausibility import implausible
from hybrid.scene.read import one_line, read_scene
from hybrid.scene.root import Scene
from tests.scenes import cable_scene, pinned_at

ROOT = Path(__file__).parents[2]
CHAIN = {"mass": 20.0, "diameter": 0.05, "axial_stiffness": 8.5e7, "bending_stiffness": 50.0}
PIPE = {
    "mass": 160.0, "diameter": 0.4, "axial_stiffness": 5e9, "bending_stiffness": 9e7,
    "pipe": {"wall": 0.02},
}  # fmt: skip


def scene(section: dict[str, Any] | None = None, **changes: Any) -> Scene:
    """A line from the seabed, 100 m deep, to a vessel that heaves."""
    heave = {"heave": {"amplitude": 2.0, "period": 8.0}, "ramp": 16.0}
    data: dict[str, Any] = cable_scene(
        [{"length": 50.0} | CHAIN, {"length": 200.0} | (section or CHAIN)], pinned_at(0, 0, -100.0),
        pinned_at(205.0, 0, 0, motion=heave), fluid={"density": 1025, "surface": 0.0, "current": [0.5, 0, 0]},
        seabed={"z": -100.0, "stiffness": 1e4, "friction": 0.5}, model="catenary", time=(60.0, 0.05)
    )  # fmt: skip
    return hybrid.validate_scene(data | changes)


def environment(**changes: Any) -> dict[str, Any]:
    given = {"density": 1025, "surface": 0.0, "current": [0.5, 0, 0]}
    bed = {"z": -100.0, "stiffness": 1e4, "friction": 0.5}
    return {
        "environment": {
            "gravity": changes.get("gravity", 9.81),
            "fluid": given | {k: x for k, x in changes.items() if k in ("density", "current", "waves")},
            "seabed": bed | {k: x for k, x in changes.items() if k in ("stiffness", "friction", "z")},
        }
    }


def moved(**harmonic: Any) -> dict[str, Any]:
    motion = {"surge": harmonic, "ramp": 16.0}
    return {"ends": {"start": pinned_at(0, 0, -100.0), "end": pinned_at(205.0, 0, 0, motion=motion)}}


SECTIONS = {
    "EA in kN": (CHAIN | {"axial_stiffness": 8.5e4}, "axial_stiffness", "in kN? then 8.5e+07"),
    "EA in mN": (CHAIN | {"axial_stiffness": 8.5e10 * 10}, "axial_stiffness", "is it in N?"),
    "EA of a light rope in N, its weight in kN": (
        {"mass": 0.5, "diameter": 0.025, "axial_stiffness": 20.0}, "axial_stiffness", "in kN? then 20000"),
    "EA of a light rope in kN, at rest in water": (
        {"mass": 0.1, "diameter": 0.012, "axial_stiffness": 200.0}, "axial_stiffness", "in kN? then 200000"),
    "largest tension in kN": (CHAIN | {"max_tension": 900.0}, "max_tension", "in kN? then 900000"),
    "bend radius in mm": (CHAIN | {"min_bend_radius": 5000.0}, "min_bend_radius", "in mm? then 5"),
    "bend radius in km": (CHAIN | {"min_bend_radius": 0.005}, "min_bend_radius", "in km? then 5"),
    "EI in N mm2": (CHAIN | {"bending_stiffness": 50e6}, "bending_stiffness", "in N mm^2"),
    "EI of a pipe in kN m2": (PIPE | {"bending_stiffness": 9e4}, "bending_stiffness", "kN m^2"),
    "EA of a pipe in kN": (PIPE | {"axial_stiffness": 5e6}, "axial_stiffness", "kN"),
    "rotary inertia in g m": (CHAIN | {"rotary_inertia": 6.0}, "rotary_inertia", "at most 0.00625 kg m"),
    "drag of a percentage": (CHAIN | {"drag": {"normal": 120}}, "drag", "at most 10"),
    "moments before curvatures": (
        {"mass": 20.0, "diameter": 0.05, "axial_stiffness": 8.5e7, "moment_curvature": [[0, 0], [50, 0.02], [90, 0.1]]},
        "moment_curvature", "less than 40 1/m"),
    "capacity in kN": (CHAIN | {"capacity": [[900.0, 0], [0, 0.5]]}, "capacity", "in kN? then 900000"),
    "strength of a code in kN": (
        CHAIN | {"code": {"kind": "E301", "strength": 900.0, "pretension_factor": 1.2, "environment_factor": 1.5}},
        "code.strength", "in kN? then 900000"),
    "strengths of a wall in MPa": (
        PIPE | {"code": {"kind": "F201", "yield_strength": 430.0, "tensile_strength": 510.0}},
        "code.yield_strength", "is it in Pa?"),
    "a rubber cord under its weight": (
        {"mass": 20.0, "diameter": 0.1, "axial_stiffness": 4e3}, "axial_stiffness", "max_strain"),
}  # fmt: skip


@pytest.mark.parametrize("name", SECTIONS)
def test_a_section_in_a_wrong_unit_is_noted_at_its_place(name: str) -> None:
    section, key, words = SECTIONS[name]
    notes = [x for x in implausible(one_line(scene(section))) if f"cable.sections[1].{key}: expected" in x.why]
    assert len(notes) >= 1, list(implausible(one_line(scene(section))))
    assert any(words in x.why for x in notes), notes
    assert all(x.s == (50.0, 250.0) for x in notes)


FLOATS = {
    "mass in g": ({"buoyancy": 2000.0, "mass": 1e6}, "at most 2.04e+04 kg"),
    "mass of a heavy one in g": ({"volume": 1e4, "mass": 6e6}, "at most 5e+06 kg"),
    "buoyancy in kN": ({"buoyancy": 2.0, "mass": 150.0}, "is buoyancy in N"),
}


@pytest.mark.parametrize("name", FLOATS)
def test_a_float_in_a_wrong_unit_is_noted_at_its_place(name: str) -> None:
    given, words = FLOATS[name]
    sections = {"sections": [{"length": 50.0} | CHAIN, {"length": 200.0} | CHAIN]}
    for x, expected in ((given, 1), ({"buoyancy": 2000.0, "mass": 150.0}, 0), ({"buoyancy": 50.0, "mass": 150.0}, 0)):
        cable = sections | {"attachments": [{"kind": "float", "at": 120.0} | x]}
        notes = list(implausible(one_line(scene(cable=cable))))
        assert len(notes) == expected, notes
        for note in notes:
            assert words in note.why and note.why.startswith("cable.attachments[0].mass: expected")
            assert note.s == (120.0, 120.0)


CONE = {"kind": "bend_stiffener", "diameters": [0.3, 0.1], "bore": 0.05, "modulus": 7e7}
SLEEVES = {
    "in mm": (CONE | {"diameters": [300.0, 100.0], "bore": 50.0}, "diameters: expected at most 5 m"),
    "a bore that is a radius": (CONE | {"bore": 0.025}, "bore: expected 0.05 m or more"),
    "modulus in MPa": (CONE | {"modulus": 70.0}, "modulus: expected 100000 Pa or more: is it in Pa? in MPa"),
    "radius in km": ({"kind": "bend_restrictor", "radius": 0.003}, "radius: expected 0.025 m or more"),
    "usual": (CONE, ""),
    "usual restrictor": ({"kind": "bend_restrictor", "radius": 3.0}, ""),
}


@pytest.mark.parametrize("name", SLEEVES)
def test_a_sleeve_that_does_not_fit_is_noted(name: str) -> None:
    given, words = SLEEVES[name]
    cable = {"sections": [{"length": 50.0} | CHAIN, {"length": 200.0} | CHAIN]}
    notes = list(implausible(one_line(scene(cable=cable | {"attachments": [given | {"range": [48.0, 52.0]}]}))))
    assert len(notes) == bool(words), notes
    for note in notes:
        assert note.why.startswith(f"cable.attachments[0].{words}") and note.s == (48.0, 52.0)


SURROUNDINGS = {
    "friction in tens of percent": (environment(friction=5.0), "friction of 5"),
    "current in cm/s": (environment(current={"speed": 50.0, "direction": 30.0}), "a current of 50 m/s"),
    "a bed in kPa": (environment(stiffness=10.0), "sinks"),
    "gravity in cm/s2": (environment(gravity=981.0), "a gravity of 981"),
    "a period in minutes": (moved(amplitude=20.0, period=0.5), "an end that moves at"),
    "depth in cm": ({**environment(z=-20_000.0), "cable": {"sections": [{"length": 25_000.0} | CHAIN]},
                     "ends": {"start": pinned_at(0, 0, -20_000.0), "end": pinned_at(205.0, 0, 0)}},
                    "a depth of 20000 m")
}  # fmt: skip


def test_waves_of_a_file_in_hertz_are_noted(tmp_path: Path) -> None:
    """Frequencies of 0.6 and 1.2 rad/s, written in rad/s and in Hz."""
    for unit, expected in ((1.0, 0), (6.283, 1)):
        (path := tmp_path / f"sea{unit}.csv").write_text(
            f"amplitude,frequency,direction,phase\n0.5,{0.6 / unit},0,0\n0.2,{1.2 / unit},0,90\n"
        )
        notes = list(implausible(one_line(scene(**environment(waves={"kind": "components", "file": str(path)})))))
        assert [x.why.startswith("environment.fluid.waves.file: expected at most 40 s") for x in notes] == [
            True
        ] * expected


@pytest.mark.parametrize("name", SURROUNDINGS)
def test_surroundings_in_a_wrong_unit_are_noted(name: str) -> None:
    changes, words = SURROUNDINGS[name]
    step = {"time": {"duration": 60.0, "step": 0.02}} if "ends" in changes else {}
    notes = list(implausible(one_line(scene(**changes | step))))
    assert any(words in x.what and "expected" in x.why for x in notes), notes


def test_the_note_is_an_event_where_the_section_is() -> None:
    with hybrid.static(scene(CHAIN | {"drag": {"normal": 120.0}})) as result:
        event = next(x for x in result.events if x.kind == "implausible")
        assert (event.s_a, event.s_b) == (50.0, 250.0)
        assert event.text.startswith("drag of 120: cable.sections[1].drag: expected at most 10")


REFUSED = {
    "friction of 50": (environment(friction=50.0), "environment.seabed.friction", "not percent: 0.5"),
    "a force of 2^63 N": ({"ends": {"start": pinned_at(0, 0, -100.0), "end": {"kind": "free", "force": [0, 0, 2.0**63]}}},
                          "ends.end.force", "less than 1e+13 N"),
    "a thrust of 2^63 N": ({"ends": {"start": pinned_at(0, 0, -100.0),
                                     "end": {"kind": "body", "mass": 500.0, "thrust": [2.0**63, 0, 0]}}},
                           "ends.end.thrust", "forces are in N"),
    "an end that heaves into the bed": ({"ends": {"start": pinned_at(205.0, 0, 0),
                                                  "end": pinned_at(0, 0, -100.0,
                                                                   motion={"heave": {"amplitude": 2.0, "period": 8.0},
                                                                           "ramp": 16.0})}},
        "ends.end.motion", "exchange start and end"),
    "an end that sinks into the bed": ({"ends": {"start": pinned_at(100.0, 0, -97.0),
                                                 "end": pinned_at(0, 0, -97.0,
                                                                  motion={"velocity": [0, 0, -0.1], "ramp": 5.0})}},
        "ends.end.motion", "under the seabed")
}  # fmt: skip


@pytest.mark.parametrize("name", REFUSED)
def test_what_nothing_makes_right_is_refused(name: str) -> None:
    changes, where, words = REFUSED[name]
    with pytest.raises(SceneError) as caught:
        scene(**changes)
    complaint = next(x for x in caught.value.complaints if x.where.startswith(where))
    assert words in f"{complaint.value} {complaint.expected} {complaint.fix}"


def test_a_point_of_several_lines_that_heaves_into_the_bed_is_refused() -> None:
    heave = {"heave": {"amplitude": 2.0, "period": 8.0}, "ramp": 16.0}
    network = environment() | {
        "points": {"anchor": {"position": [0, 0, -100.0], "motion": heave}, "top": {"position": [205.0, 0, 0]}},
        "lines": {"leg": {"start": "anchor", "end": "top", "sections": [{"length": 250.0} | CHAIN]}},
        "time": {"duration": 60.0, "step": 0.05},
    }
    with pytest.raises(SceneError) as caught:
        hybrid.validate_scene(network)
    assert [x.where for x in caught.value.complaints] == ["points.anchor.motion"]


def test_an_end_on_the_bed_may_heave_up_and_slide() -> None:
    up = {"surge": {"amplitude": 2.0, "period": 8.0}, "travel": {"by": [0, 0, 5.0], "over": 9.0}, "ramp": 16.0}
    start = {"kind": "pinned", "position": [0, 0, -100.0], "motion": up}
    assert scene(ends={"start": start, "end": {"kind": "pinned", "position": [205.0, 0, 0]}}).ends.start.motion


def test_the_seabed_end_of_a_mooring_whose_ends_are_exchanged_is_refused() -> None:
    with pytest.raises(SceneError, match="2 m under the seabed"):
        read_scene(ROOT / "tests" / "data" / "defects" / "swapped_ends.yaml")


def between(apart: float, *sections: dict[str, Any]) -> list[Any]:
    """Notes on a line between ends that are `apart`, m."""
    changes = cable_scene(list(sections), pinned_at(0, 0, -50.0), pinned_at(apart, 0, -50.0), initial=None)
    return list(implausible(one_line(scene(**changes))))


def test_a_line_too_short_for_the_way_between_its_ends_is_noted() -> None:
    """2.8 % of a chain, in the section where all of it is; its tension by EA and the strains of both sections."""
    (note,) = between(102.8, {"length": 100.0} | CHAIN | {"axial_stiffness": 4e7})
    assert note.what.startswith("a line of 100 m between ends that are 102.8 m apart: 1.12e+06 N at rest")
    assert "by 2.80%" in note.what and "cable.sections[0].length" in note.why and "102.8 m or more" in note.why
    rope = {"length": 50.0, "mass": 23.0, "diameter": 0.19, "axial_stiffness": 4e8}
    (note,) = between(152.0, {"length": 100.0} | CHAIN | {"axial_stiffness": 5.3e7}, rope)
    assert note.s == (0.0, 100.0) and "102 m or more" in note.why
    tension = 2.0 / (100.0 / 5.3e7 + 50.0 / 4e8)
    assert f"{tension:.3g} N at rest" in note.what and f"by {tension / 5.3e7:.2%}" in note.what


def test_a_tension_at_rest_that_no_rope_bears_is_noted() -> None:
    (note,) = between(100.5, {"length": 100.0, "mass": 0.1, "diameter": 0.01, "axial_stiffness": 5e7})
    assert "cable.sections[0].length: expected less than 1.96e+05 N" in note.why


@pytest.mark.parametrize(
    "section",
    [
        CHAIN | {"length": 102.5},  # as taut as chains are
        {"length": 100.0, "mass": 23.0, "diameter": 0.19, "axial_stiffness": 6e7},  # polyester
        {"length": 100.0, "mass": 5.0, "diameter": 0.1, "axial_stiffness": 3e7},  # HMPE
        {"length": 100.0, "mass": 250.0, "diameter": 0.4, "axial_stiffness": 4e6},  # rubber hose
        CHAIN | {"length": 100.0, "axial_stiffness": 4e7, "max_strain": 0.04},  # meant
    ],
)
def test_lines_that_bear_their_strain_are_not_noted(section: dict[str, Any]) -> None:
    assert not [x for x in between(102.8, section) if "at rest" in x.what]


@pytest.mark.parametrize("path", sorted((ROOT / "examples").glob("*.yaml")), ids=lambda x: x.stem)
def test_no_example_is_called_implausible(path: Path) -> None:
    read, *_ = read_scene(path)
    assert isinstance(read, Scene)
    assert list(implausible(one_line(read))) == []


STEEL, WIRE = {"mass": 20.0, "diameter": 0.05}, {"mass": 0.7, "diameter": 0.014}
REAL = {
    "studless chain": STEEL | {"axial_stiffness": 2.1e8},
    "spiral strand": {"mass": 42.0, "diameter": 0.1, "axial_stiffness": 8.5e8},
    "wire rope": WIRE | {"axial_stiffness": 9e6},
    "polyester": {"mass": 23.0, "diameter": 0.19, "axial_stiffness": 6e7},
    "nylon": {"mass": 1.5, "diameter": 0.048, "axial_stiffness": 1.2e6},
    "bungee": {"mass": 2.0, "diameter": 0.05, "axial_stiffness": 1.5e4, "max_strain": 2.0},
    "rubber hose": {"mass": 250.0, "diameter": 0.66, "axial_stiffness": 4e6, "bending_stiffness": 6e4},
    "umbilical": {"mass": 41.0, "diameter": 0.15, "axial_stiffness": 4e8, "bending_stiffness": 1.5e4},
    "steel riser": {"mass": 160.0, "diameter": 0.4, "axial_stiffness": 5e9, "bending_stiffness": 9e7},
    "tether": {"mass": 0.6, "diameter": 0.025, "axial_stiffness": 1e6, "bending_stiffness": 1.0},
    "carbon rod": {"mass": 0.8, "diameter": 0.025, "axial_stiffness": 8e7, "bending_stiffness": 3e3},
    "power cable": {"mass": 40.0, "diameter": 0.13, "axial_stiffness": 3e8, "max_tension": 6e4, "min_bend_radius": 2.5},
    "pipe on a reel": {"mass": 70.0, "diameter": 0.2, "axial_stiffness": 1.5e9, "bending_stiffness": 7e6,
                       "max_tension": 2e6, "min_bend_radius": 49.0},
    "fibre optic cable": {"mass": 8e-3, "diameter": 3e-3, "axial_stiffness": 5e4, "max_tension": 100.0,
                          "min_bend_radius": 0.03},
    "fishing line": {"mass": 4e-4, "diameter": 7e-4, "axial_stiffness": 800.0},
}  # fmt: skip


@pytest.mark.parametrize("name", REAL)
def test_real_lines_are_not_called_implausible(name: str) -> None:
    assert list(implausible(one_line(scene(REAL[name])))) == []


@pytest.mark.parametrize(
    ("force", "verdict"), [(0.99e8, ""), (1.01e8, "noted"), (0.99e13, "noted"), (1.01e13, "refused")]
)
def test_a_force_at_an_end_is_noted_from_where_the_page_says(force: float, verdict: str) -> None:
    page = (ROOT / "docs" / "troubleshooting.md").read_text(encoding="utf-8")
    assert "less than 1e+13 N" in page and "From 1e8 N on it is accepted, and [implausible]" in page
    ends = {"start": {"kind": "pinned", "position": [0, 0, 0]}, "end": {"kind": "free", "force": [force, 0, 0]}}
    if verdict == "refused":
        with pytest.raises(SceneError, match=r"ends\.end\.force(?s:.*)less than 1e\+13 N"):
            scene(ends=ends)
        return
    noted = [x for x in implausible(one_line(scene(ends=ends))) if "at an end" in x.what]
    assert [x.why for x in noted] == (
        ["ends.end.force: expected at most 1e+08 N, which the strongest moorings bear: is it in N?"] if verdict else []
    )
