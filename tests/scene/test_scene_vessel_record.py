"""A vessel by a recorded history of six degrees of freedom, and angles of records: convention, wraps, turns."""

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

ORIGIN, HEADING, FAIRLEAD = np.array([5.0, -3.0, 0.5]), 30.0, np.array([20.0, 4.0, -2.0])
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
    return np.array([*(ORIGIN + s * np.array([2.0, 1.0, 0.5])), 4.0 * s, -3.0 * s, HEADING + 25.0 * s])


def written(path: Path, rows: np.ndarray, header: str) -> str:
    names = ["t", "x", "y", "z", "roll", "pitch", "yaw"]
    order = [names.index(x) for x in header.split(",")]
    np.savetxt(path, rows[:, order], delimiter=",", header=header, comments="", fmt="%.12g")
    return str(path)


def scene(file: str, clamped: bool = False, ramp: float | None = None, **vessel: Any) -> hybrid.Scene:
    c, s = math.cos(math.radians(HEADING)), math.sin(math.radians(HEADING))
    place = (ORIGIN + np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]) @ FAIRLEAD).tolist()
    end: dict[str, Any] = {"kind": "pinned", "position": place}
    if clamped:
        end |= {"kind": "clamped", "tangent": [0, 0, 1]}
    given = {"origin": ORIGIN.tolist(), "heading": HEADING, "fairlead": FAIRLEAD.tolist()} | vessel
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
    made = scene(history, clamped)
    model = build(one_line(made))
    rest = attitude(0, 0, HEADING)
    for t in (0.0, 7.3, 20.0, 29.5):
        at = motion(t)
        R = attitude(*at[3:])
        found = model.ends.at_time(t)
        assert found.position[1] == pytest.approx(at[:3] + R @ FAIRLEAD, abs=2e-6)
        if clamped:
            assert found.frame[1].reshape(3, 3)[:, 2] == pytest.approx(R @ rest.T @ [0, 0, 1], abs=2e-6)
    with hybrid.run(made) as result:  # in compiled steps
        at = motion(20.0)
        assert result.position[20, -1] == pytest.approx(at[:3] + attitude(*at[3:]) @ FAIRLEAD, abs=2e-6)


def test_one_that_is_under_way_is_blended_in(tmp_path: Path) -> None:
    rows = np.array([[t, *(motion(t + 11.0) + np.eye(6)[0])] for t in T])
    file = written(tmp_path / "ship.csv", rows, "t,x,y,z,roll,pitch,yaw")
    with pytest.raises(hybrid.SceneError, match="ramp"):
        hybrid.run(scene(file))
    made = scene(file, ramp=12.0)
    model = build(one_line(made))
    assert model.ends.at_time(0.0).position[1] == pytest.approx(made.ends.end.position)
    at = rows[200, 1:]
    assert model.ends.at_time(20.0).position[1] == pytest.approx(at[:3] + attitude(*at[3:]) @ FAIRLEAD, abs=2e-6)
    with hybrid.run(made) as result:
        assert "motion blended in" in {e.kind for e in result.events}


def test_angles_that_wrap_are_the_same_motion(tmp_path: Path) -> None:
    """A vessel that turns by two turns, its heading written from -180 to 180 deg."""
    rows = np.array([[t, *ORIGIN, 0.0, 0.0, 170.0 + 1.2 * t**2 * (45.0 - t) / 18.0] for t in T])
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
        (lambda: scene(history, rao="x.csv"), "file gives the motion of the vessel"),
        (lambda: scene(history, drift={"yaw": {"amplitude": 1, "period": 60}}), "file gives the motion of the vessel"),
        (lambda: hybrid.run(scene(str(tmp_path / "flat.csv"))), "because a vessel carries the end"),
        (lambda: hybrid.run(scene(history, fairlead=[0, 0, 0])), "the position of the end would be"),
    ):
        with pytest.raises(hybrid.SceneError, match=text):
            make()
