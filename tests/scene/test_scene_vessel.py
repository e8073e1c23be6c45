"""Ends carried by a vessel: its RAOs in the waves of the scene, phases, arms, headings, spectra, and what is refused."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import hybrid
from hybrid.model.build import build
from hybrid.scene.motion_file import RecordRefused, continuous, read_record
from hybrid.scene.read import one_line
from tests.scenes import cable_scene, pinned_at

WAVES = {"kind": "regular", "height": 2.0, "period": 9.0, "direction": 30.0, "phase": 25.0, "ramp": 18.0}
SEA = {
    "kind": "jonswap",
    "significant_height": 4.0,
    "peak_period": 10.0,
    "components": 400,
    "direction": 30.0,
    "seed": 3,
    "ramp": 20.0,
}
ORIGIN, HEADING = [5.0, -3.0, 0.0], 30.0
FAIRLEAD = [20.0, 4.0, -2.0]


def table(folder: Path, columns: dict[str, Any], headings: tuple[float, ...] = (-0.0, 180.0)) -> str:
    """A table with the same motion for all headings; columns: numbers, or functions of the frequency."""
    rows = []
    for w in np.linspace(0.05, 12.0, 600):
        values = [c(w) if callable(c) else c for c in columns.values()]
        rows += [[w, heading, *values] for heading in headings]
    path = folder / "rao.csv"
    np.savetxt(path, rows, delimiter=",", header=",".join(("frequency", "heading", *columns)), comments="", fmt="%.12g")
    return str(path)


def scene(rao: str, waves: dict[str, Any] = WAVES, clamped: bool = False, **vessel: Any) -> hybrid.Scene:
    c, s = math.cos(math.radians(HEADING)), math.sin(math.radians(HEADING))
    x, y, z = FAIRLEAD
    place = [ORIGIN[0] + c * x - s * y, ORIGIN[1] + s * x + c * y, ORIGIN[2] + z]
    end = {"kind": "pinned", "position": place}
    if clamped:
        end |= {"kind": "clamped", "tangent": [0, 0, 1]}
    given = {"rao": rao, "origin": ORIGIN, "heading": HEADING, "fairlead": FAIRLEAD} | vessel
    return hybrid.validate_scene(cable_scene(
        {"length": 120.0, "mass": 5.0, "diameter": 0.05, "axial_stiffness": 1e7, "bending_stiffness": 10.0},
        pinned_at(place[0] - 40, place[1], -95.0), end | {"motion": {"vessel": given}},
        fluid={"density": 1025, "surface": 0.0, "waves": waves | {"depth": 200.0}},
        model="rod" if clamped else "catenary", mesh=30, time=(40.0, 0.1), output=0.5
    ))  # fmt: skip


@pytest.mark.parametrize(("phase", "times"), [(0.0, (0.0, 3.0, 17.0, 25.0)), (90.0, (30.0, 33.3))])
def test_a_vessel_that_heaves_with_the_surface_at_its_origin(phase: float, times: Any, tmp_path: Path) -> None:
    """Heave 1 m/m: the fairlead is as high as the surface at the origin, the wave's ramp included.

    Phases lag behind the crest: 90 deg are a quarter of a period.
    """
    model = build(one_line(scene(table(tmp_path, {"heave": 1.0} | ({"heave_phase": phase} if phase else {})))))
    for t in times:
        height = model.sea.elevation(ORIGIN[0], ORIGIN[1], t - 9.0 * phase / 360.0)[0]
        assert model.ends.at_time(t).position[1, 2] == pytest.approx(FAIRLEAD[2] + height, abs=1e-9)


def test_arms_and_headings(tmp_path: Path) -> None:
    """Surge is along the bow; pitch lifts a point ahead by - x, roll one to port by y; a clamped end turns with it."""
    alone = build(one_line(scene(table(tmp_path, {"surge": 1.0}))))
    t, c, s = 25.0, math.cos(math.radians(HEADING)), math.sin(math.radians(HEADING))
    base, eta = alone.ends.motions[1].base, alone.sea.elevation(ORIGIN[0], ORIGIN[1], t)[0]
    np.testing.assert_allclose(alone.ends.at_time(t).position[1] - base, [c * eta, s * eta, 0.0], rtol=0, atol=1e-9)
    turned = build(one_line(scene(table(tmp_path, {"pitch": 1.5, "roll": 0.7}), clamped=True)))
    pitch, roll = math.radians(1.5 * eta), math.radians(0.7 * eta)
    x, y, z = FAIRLEAD
    body = np.cross([roll, pitch, 0.0], [x, y, z])
    wanted = [c * body[0] - s * body[1], s * body[0] + c * body[1], body[2]]
    np.testing.assert_allclose(turned.ends.at_time(t).position[1] - base, wanted, rtol=0, atol=1e-9)
    tangent = turned.ends.at_time(t).frame[1].reshape(3, 3)[:, 2]
    small = np.cross([c * roll - s * pitch, s * roll + c * pitch, 0.0], [0, 0, 1])
    np.testing.assert_allclose(tangent - [0, 0, 1], small, rtol=0, atol=2.0 * (pitch**2 + roll**2))


@pytest.mark.long
def test_the_spectrum_of_the_fairlead_is_that_of_the_waves_times_the_square_of_the_response(tmp_path: Path) -> None:
    """An hour of a JONSWAP sea against the elevation of that hour: 2 % in a band at the peak, heights within 1 %."""

    def heave(w: np.ndarray | float) -> np.ndarray | float:
        return 1.0 / (1.0 + (w / 0.7) ** 4)

    model = build(one_line(scene(table(tmp_path, {"heave": heave}), SEA)))
    t = np.arange(20.0, 3620.0, 0.5)
    z = np.array([model.ends.at_time(x).position[1, 2] for x in t]) - FAIRLEAD[2]
    eta = np.array([model.sea.elevation(ORIGIN[0], ORIGIN[1], x)[0] for x in t])
    spectra = [np.abs(np.fft.rfft(x * np.hanning(t.size))) ** 2 for x in (z, eta)]
    w, peak = 2 * np.pi * np.fft.rfftfreq(t.size, 0.5), 2 * np.pi / 10.0
    wanted = heave(w) ** 2 * spectra[1]
    band = abs(w - peak) < 0.2 * peak
    assert spectra[0][band].sum() == pytest.approx(wanted[band].sum(), rel=0.02)
    assert np.sqrt(spectra[0].sum()) == pytest.approx(np.sqrt(wanted.sum()), rel=0.01)
    assert spectra[0].sum() < 0.7 * spectra[1].sum(), "the response changes nothing"


def test_it_runs_and_resumes_with_its_table(tmp_path: Path) -> None:
    """The end is where the harmonics say, in compiled steps; the table is among the files of the result."""
    made = scene(table(tmp_path, {"heave": 0.8, "pitch": 0.5, "pitch_phase": 40.0}))
    model = build(one_line(made))
    with hybrid.run(made) as result:
        for k in (10, 50, 80):
            wanted = model.ends.at_time(float(result.t[k])).position[1]
            np.testing.assert_allclose(result.position[k, -1], wanted, rtol=0, atol=1e-8)
    assert made.ends.named_files() == [str(tmp_path / "rao.csv")]


REFUSED: dict[str, tuple[dict[str, Any], dict[str, Any], dict[str, Any], str]] = {
    "fairlead": ({}, {"fairlead": [0, 0, 0]}, WAVES, r"the position of the end would be \[5, -3, 0\]"),
    "heading": ({"headings": (0.0, 20.0)}, {"heading": 0.0, "fairlead": None}, WAVES, "the heading 30 deg"),
    "no ramp": ({}, {}, {k: x for k, x in WAVES.items() if k != "ramp"}, "starts from rest"),
    "frequency": ({}, {}, WAVES | {"period": 500.0}, r"ends\.end\.motion\.vessel\.rao[\s\S]*those of the waves"),
}  # fmt: skip


@pytest.mark.parametrize("name", REFUSED)
def test_what_is_refused(tmp_path: Path, name: str) -> None:
    more, vessel, waves, text = REFUSED[name]
    with pytest.raises(hybrid.SceneError, match=text):
        build(one_line(scene(table(tmp_path, {"heave": 1.0}, **more), waves, **vessel)))


@pytest.mark.parametrize(
    ("rows", "text"),
    [("frequency,heave\n1,1\n", "columns frequency"), ("frequency,heading,heave\n", "0 rows"),
     ("frequency,heading,heave\n1,0,1\n2,0,1\n\n2,0,1\n", "line 5: frequency and heading of line 3"),
     ("frequency,heading,heave\n1,0,1\n1,90,1\n2,90,1\n", "no row for 2 rad/s at 0 deg"),
     ("frequency,heading,heave\n0,0,1\n", "line 2: frequency = 0"), ("frequency,heading,heave_phase\n1,0,1\n", "columns"),
     ("frequency,heading,heave\n1,0,x\n", "line 2: heave is no finite")],
)  # fmt: skip
def test_a_bad_table_is_refused(tmp_path: Path, rows: str, text: str) -> None:
    (tmp_path / "rao.csv").write_text(rows)
    with pytest.raises(hybrid.SceneError, match=text):
        hybrid.run(scene(str(tmp_path / "rao.csv")))


# --- by a recorded history of six degrees of freedom, and angles of records: convention, wraps, turns ---

AFLOAT, CORNER = np.array([5.0, -3.0, 0.5]), np.array(FAIRLEAD)
T = np.arange(0.0, 31.0, 0.1)


def attitude(roll: Any, pitch: Any, yaw: Any) -> np.ndarray:
    """Rz Ry Rx of angles in deg, written out anew."""
    a, b, c = np.radians([roll, pitch, yaw])
    X = np.array([[1, 0, 0], [0, math.cos(a), -math.sin(a)], [0, math.sin(a), math.cos(a)]])
    Y = np.array([[math.cos(b), 0, math.sin(b)], [0, 1, 0], [-math.sin(b), 0, math.cos(b)]])
    Z = np.array([[math.cos(c), -math.sin(c), 0], [math.sin(c), math.cos(c), 0], [0, 0, 1]])
    return np.asarray(Z @ Y @ X)


def motion(t: float) -> np.ndarray:
    """x, y, z (m), roll, pitch, yaw (deg) of the vessel; at t = 0 it is at rest, at its origin and heading."""
    s = math.sin(math.pi * t / 40.0) ** 4
    return np.array([*(AFLOAT + s * np.array([2.0, 1.0, 0.5])), 4.0 * s, -3.0 * s, HEADING + 25.0 * s])


def written(path: Path, rows: np.ndarray, header: str) -> str:
    names = ["t", "x", "y", "z", "roll", "pitch", "yaw"]
    order = [names.index(x) for x in header.split(",")]
    np.savetxt(path, rows[:, order], delimiter=",", header=header, comments="", fmt="%.12g")
    return str(path)


def recorded(file: str, clamped: bool = False, ramp: float | None = None, **vessel: Any) -> hybrid.Scene:
    c, s = math.cos(math.radians(HEADING)), math.sin(math.radians(HEADING))
    place = (AFLOAT + np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]) @ CORNER).tolist()
    end: dict[str, Any] = {"kind": "pinned", "position": place}
    if clamped:
        end |= {"kind": "clamped", "tangent": [0, 0, 1]}
    given = {"origin": AFLOAT.tolist(), "heading": HEADING, "fairlead": CORNER.tolist()} | vessel
    moved = {"file": file, "vessel": given} | ({"ramp": ramp} if ramp else {})
    return hybrid.validate_scene(cable_scene(
        {"length": 60.0, "mass": 5.0, "diameter": 0.05, "axial_stiffness": 1e6, "bending_stiffness": 100.0},
        pinned_at(place[0] - 30, place[1], -35.0), end | {"motion": moved}, model="rod" if clamped else "catenary",
        mesh=30, time=(30.0, 0.1), output=1.0
    ))  # fmt: skip


@pytest.fixture
def history(tmp_path: Path) -> str:
    return written(tmp_path / "ship.csv", np.array([[t, *motion(t)] for t in T]), "yaw,z,t,pitch,x,y,roll")


@pytest.mark.parametrize("clamped", [False, True])
def test_the_fairlead_goes_where_the_vessel_takes_it(history: str, clamped: bool) -> None:
    made = recorded(history, clamped)
    model = build(one_line(made))
    rest = attitude(0, 0, HEADING)
    for t in (0.0, 7.3, 20.0, 29.5):
        at = motion(t)
        R = attitude(*at[3:])
        found = model.ends.at_time(t)
        assert found.position[1] == pytest.approx(at[:3] + R @ CORNER, abs=2e-6)
        if clamped:
            assert found.frame[1].reshape(3, 3)[:, 2] == pytest.approx(R @ rest.T @ [0, 0, 1], abs=2e-6)
    with hybrid.run(made) as result:  # in compiled steps
        at = motion(20.0)
        assert result.position[20, -1] == pytest.approx(at[:3] + attitude(*at[3:]) @ CORNER, abs=2e-6)


def test_one_that_is_under_way_is_blended_in(tmp_path: Path) -> None:
    rows = np.array([[t, *(motion(t + 11.0) + np.eye(6)[0])] for t in T])
    file = written(tmp_path / "ship.csv", rows, "t,x,y,z,roll,pitch,yaw")
    with pytest.raises(hybrid.SceneError, match="ramp"):
        hybrid.run(recorded(file))
    made = recorded(file, ramp=12.0)
    model = build(one_line(made))
    assert model.ends.at_time(0.0).position[1] == pytest.approx(made.ends.end.position)
    at = rows[200, 1:]
    assert model.ends.at_time(20.0).position[1] == pytest.approx(at[:3] + attitude(*at[3:]) @ CORNER, abs=2e-6)
    with hybrid.run(made) as result:
        assert "motion blended in" in {e.kind for e in result.events}


def test_angles_that_wrap_are_the_same_motion(tmp_path: Path) -> None:
    """A vessel that turns by two turns, its heading written from -180 to 180 deg."""
    rows = np.array([[t, *AFLOAT, 0.0, 0.0, 170.0 + 1.2 * t**2 * (45.0 - t) / 18.0] for t in T])
    wrapped = rows.copy()
    wrapped[:, 6] = (rows[:, 6] + 180.0) % 360.0 - 180.0
    assert np.abs(np.diff(wrapped[:, 6])).max() > 300.0
    records = [
        read_record(written(tmp_path / name, x, "t,x,y,z,roll,pitch,yaw"))
        for name, x in (("a.csv", rows), ("b.csv", wrapped))
    ]
    assert records[1].rotation == pytest.approx(records[0].rotation, abs=1e-6)
    vectors = records[0].rotation
    assert vectors is not None and np.linalg.norm(vectors[-1]) > 360.0
    assert np.abs(np.diff(vectors, axis=0)).max() < 20.0


def test_rotation_vectors_and_angles_are_the_same_rotations() -> None:
    for angles in np.random.default_rng(3).uniform(-180, 180, (50, 3)):
        assert Rotation.from_euler("xyz", angles, degrees=True).as_matrix() == pytest.approx(
            attitude(*angles), abs=1e-12
        )
    counted = continuous(np.array([[0, 0, 3.0], [0, 0, -3.0], [0, 0, 0.0], [0, 0, 1.0]]))
    assert counted[:, 2] == pytest.approx([3.0, 2 * np.pi - 3.0, 2 * np.pi, 2 * np.pi + 1.0])


@pytest.mark.parametrize(
    ("rows", "text"),
    [("t,x,y,z,roll,pitch,yaw\n" + "\n".join(f"{k},0,0,0,0,0,{120 * k}" for k in range(8)), "changes by 120 deg"),
     ("t,roll,pitch,yaw,rx,ry,rz\n" + "\n".join(f"{k},0,0,0,0,0,0" for k in range(8)), "columns t,x,y,z or"),
     ("t,roll,pitch,yaw\n" + "\n".join(f"{k},0,5,{30 * k}" for k in range(20)), "a full turn of an axis that is tilted"),
     ("t,x,y,z,roll,pitch\n" + "\n".join(f"{k},0,0,0,0,0" for k in range(8)), "columns t,x,y,z or")],
)  # fmt: skip
def test_a_bad_record_is_refused(tmp_path: Path, rows: str, text: str) -> None:
    (tmp_path / "ship.csv").write_text(rows)
    with pytest.raises(RecordRefused, match=text):
        read_record(tmp_path / "ship.csv")


def test_what_does_not_go_together_is_refused(tmp_path: Path, history: str) -> None:
    (tmp_path / "flat.csv").write_text("t,x,y,z\n" + "\n".join(f"{k},0,0,0" for k in range(40)))
    for make, text in (
        (lambda: recorded(history, rao="x.csv"), "file gives the motion of the vessel"),
        (
            lambda: recorded(history, drift={"yaw": {"amplitude": 1, "period": 60}}),
            "file gives the motion of the vessel",
        ),
        (lambda: hybrid.run(recorded(str(tmp_path / "flat.csv"))), "because a vessel carries the end"),
        (lambda: hybrid.run(recorded(history, fairlead=[0, 0, 0])), "the position of the end would be"),
    ):
        with pytest.raises(hybrid.SceneError, match=text):
            make()
