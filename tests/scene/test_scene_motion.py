"""Motion of an end: harmonics, travel, waves that are followed, records; C2 everywhere, and what is refused."""

from __future__ import annotations

import math
import os
import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from pydantic import ValidationError
from scene_texts import OCEAN, change, complaints

import hybrid
from hybrid.errors import SceneError
from hybrid.scene.motion import EndMotion
from hybrid.scene.motion_tables import Harmonic, Motion, Travel, smooth_step, way_of_smooth_step
from hybrid.scene.read import parse_scene, validate_scene
from hybrid.scene.root import Scene
from tests.scenes import cable_scene, pinned_at, span

Array = NDArray[np.float64]

# Any rotation will do as base frame, as long as no axis is special.
BASE = np.linalg.qr(np.array([[1.0, 2.0, 3.0], [0.5, -1.0, 2.0], [2.0, 0.3, -1.0]]))[0]
PLACE = np.array([1.0, -2.0, 3.0])

HARMONIC = Motion(
    surge=Harmonic(amplitude=1.0, period=5.0, phase=20.0),
    sway=Harmonic(amplitude=-0.5, period=3.0),
    heave=Harmonic(amplitude=2.0, period=8.0, phase=90.0),
    roll=Harmonic(amplitude=40.0, period=6.0, phase=-60.0),
    pitch=Harmonic(amplitude=70.0, period=7.0),
    yaw=Harmonic(amplitude=200.0, period=9.0, phase=45.0),
    ramp=10.0,
)


def _swell(t: Array) -> Array:
    """A smooth motion that starts from rest, (n, 3)."""
    x = np.clip(t / 16.0, 0.0, 1.0)
    ramp = x**3 * (10.0 - 15.0 * x + 6.0 * x**2)
    return np.stack([ramp * a * np.sin(w * t + p) for a, w, p in ((1, 0.8, 0), (2, 0.6, 1), (0.5, 1.0, 2))], axis=1)


def _csv(path: Path, times: Array, columns: dict[str, Array], form: str = "%.12g") -> str:
    names = [n for kind in columns for n in ((f"{kind}x", f"{kind}y", f"{kind}z"))]
    table = np.column_stack([times, *columns.values()])
    np.savetxt(path, table, delimiter=",", header=",".join(["t", *names]), comments="", fmt=form)
    return str(path)


@pytest.fixture
def recorded(tmp_path: Path) -> Motion:
    t = np.arange(0.0, 40.0, 0.25)
    return Motion(file=_csv(tmp_path / "swell.csv", t, {"": PLACE + _swell(t), "r": 40.0 * _swell(t)}))


SWELL = Harmonic(amplitude=1.0, period=9.0, phase=20.0)
CHOP = Harmonic(amplitude=0.3, period=4.0, phase=-70.0)

# A wave of 1.2 m amplitude and 60 m length that travels along (0.8, 0.6) and grows over 12 s.
K, W, A, RAMP = 2 * math.pi / 60.0, 1.0, 1.2, 12.0


def sea(x: float, y: float, t: float) -> tuple[float, float, float, float]:
    """Elevation, its rate at a place that stands, and its slopes."""
    grown, rate = smooth_step(t / RAMP)
    angle = K * (0.8 * x + 0.6 * y) - W * t + 0.4
    eta, down = grown * A * math.cos(angle), grown * A * math.sin(angle)
    return eta, A * rate / RAMP * math.cos(angle) + W * down, -0.8 * K * down, -0.6 * K * down


MOTIONS = {
    "angles": HARMONIC,
    "a list": Motion(heave=(SWELL, CHOP), sway=SWELL, ramp=10.0),
    "velocity": Motion(velocity=(0.5, -0.3, 0.1), ramp=10.0),
    "travel": Motion(travel=Travel(by=(20.0, 5.0, -3.0), over=10.0, begin=4.0)),
    "waves": Motion(follow="waves"),
    "everything": Motion(
        surge=(SWELL, CHOP),
        velocity=(0.5, -0.3, 0.1),
        travel=Travel(by=(20.0, 5.0, -3.0), over=10.0, begin=4.0),
        follow="waves",
        ramp=10.0,
    ),
}


def derivative(f: Callable[[float], Array], t: float, h: float = 1e-3) -> Array:
    """Sixth-order central difference: error h^6 f''' / 140 and round-off eps / h, both below 1e-11 here."""
    w = {1: 45.0, 2: -9.0, 3: 1.0}
    return np.asarray(sum(c * (f(t + k * h) - f(t - k * h)) for k, c in w.items()) / (60.0 * h))


@pytest.fixture(params=[*MOTIONS, "recorded"])
def moved(request: pytest.FixtureRequest, recorded: Motion) -> EndMotion:
    """An end that moves in each of these ways."""
    return EndMotion(MOTIONS.get(request.param, recorded), PLACE, BASE, elevation=sea)


def test_velocity_and_spin_are_derivatives(moved: EndMotion) -> None:
    """In the ramp, at its end and beyond; between samples of the record, where its spline is one cubic."""
    assert moved.moving
    for t in (0.6, 3.3, 4.6, 7.13, 9.6, 11.7, 13.8, 20.6, 39.3):
        position, velocity, frame, spin = moved.at_time(t)
        np.testing.assert_allclose(velocity, derivative(lambda u: moved.at_time(u)[0], t), atol=1e-9)
        assert frame is not None and position.shape == (3,)
        np.testing.assert_allclose(frame.T @ frame, np.eye(3), atol=1e-14)
        assert np.linalg.det(frame) == pytest.approx(np.linalg.det(BASE))
        rate = derivative(lambda u: np.asarray(moved.at_time(u)[2]), t) @ frame.T
        np.testing.assert_allclose(rate, np.cross(np.eye(3), spin), atol=1e-9)


def test_it_starts_at_rest_where_it_is_held(moved: EndMotion) -> None:
    position, velocity, frame, spin = moved.at_time(0.0)
    np.testing.assert_allclose(position, PLACE, atol=1e-14)
    np.testing.assert_allclose(frame, BASE, atol=1e-14)
    assert np.abs(velocity).max() < 1e-12 and np.abs(spin).max() < 1e-14


@pytest.mark.parametrize("name", MOTIONS)
@pytest.mark.parametrize("t", [0.0, 4.0, 10.0, 12.0, 14.0])
def test_acceleration_is_continuous_where_something_begins_or_ends(name: str, t: float) -> None:
    """One-sided accelerations differ by O(h): they halve with h, or are round-off."""
    motion = EndMotion(MOTIONS[name], PLACE, BASE, elevation=sea)

    def jump(h: float) -> float:
        left = (motion.at_time(t)[1] - motion.at_time(t - h)[1]) / h
        right = (motion.at_time(t + h)[1] - motion.at_time(t)[1]) / h
        return float(np.abs(right - left).max())

    assert jump(1e-3) < (0.1 if name == "angles" else 2e-2)
    assert jump(1e-3) <= 0.6 * jump(2e-3) + 1e-9


def test_angles_follow_the_convention() -> None:
    """R = Rz(yaw) Ry(pitch) Rx(roll), angles in degrees, applied to the base frame."""
    from scipy.spatial.transform import Rotation

    motion = EndMotion(HARMONIC, PLACE, BASE)
    for t in (2.0, 11.0, 25.0):
        x = min(t / 10.0, 1.0)
        ramp = 10 * x**3 - 15 * x**4 + 6 * x**5
        angles = [
            ramp * h.amplitude * np.sin(2 * np.pi * t / h.period + np.radians(h.phase))
            for h in (HARMONIC.yaw, HARMONIC.pitch, HARMONIC.roll)
            if h is not None
        ]
        for order, given in (("ZYX", angles), ("xyz", angles[::-1])):  # about axes that turn, about those of space
            expected = Rotation.from_euler(order, given, degrees=True).as_matrix() @ BASE
            np.testing.assert_allclose(motion.at_time(t)[2], expected, atol=1e-14)


def test_the_manual_states_the_convention() -> None:
    """The line of scipy in docs/scene.md, as it stands there, and the signs that it states."""
    from scipy.spatial.transform import Rotation

    text = (Path(__file__).parents[2] / "docs" / "scene.md").read_text(encoding="utf-8")
    (line,) = re.findall(r"`(Rotation\.from_euler\(.*\))`", text)
    roll, pitch, yaw = 40.0, -25.0, 70.0

    def turned(**angles: float) -> np.ndarray:
        table = {name: Harmonic(amplitude=x, period=4.0, phase=90.0) for name, x in angles.items()}
        frame = EndMotion(Motion(**table, ramp=1.0), PLACE, np.eye(3)).at_time(4.0)[2]
        assert frame is not None
        return frame

    said = eval(line, {"Rotation": Rotation, "roll": roll, "pitch": pitch, "yaw": yaw})
    np.testing.assert_allclose(turned(roll=roll, pitch=pitch, yaw=yaw), said.as_matrix(), atol=1e-14)
    x, y, z = np.eye(3)
    for name, from_, to in (("roll", y, z), ("pitch", z, x), ("yaw", x, y)):
        np.testing.assert_allclose(turned(**{name: 90.0}) @ from_, to, atol=1e-14)


def test_rotation_vectors_follow_the_convention(recorded: Motion) -> None:
    from scipy.spatial.transform import Rotation

    motion = EndMotion(recorded, PLACE, BASE)
    for t in (2.0, 11.0, 25.0):  # samples, where the spline is exact; 12 digits are in the file
        turn = Rotation.from_rotvec(40.0 * _swell(np.array([t]))[0], degrees=True).as_matrix()
        np.testing.assert_allclose(motion.at_time(t)[2], turn @ BASE, atol=1e-10)
        np.testing.assert_allclose(motion.at_time(t)[0], PLACE + _swell(np.array([t]))[0], atol=1e-11)


def test_small_and_large_angles_join() -> None:
    """The series below 1e-4 rad and the closed form above it agree to round-off."""
    from hybrid.scene.motion import _turn_by_vector

    axis, rate = np.array([0.6, 0.0, 0.8]), np.array([0.3, -1.0, 0.2])
    turn_a, spin_a = _turn_by_vector(axis * 0.99999e-4, rate)
    turn_b, spin_b = _turn_by_vector(axis * 1.00001e-4, rate)
    # they differ by the step of 2e-9 rad between them, and by nothing else
    np.testing.assert_allclose(turn_a, turn_b, atol=3e-9)
    np.testing.assert_allclose(spin_a, spin_b, atol=3e-9)
    np.testing.assert_allclose(_turn_by_vector(np.zeros(3), rate)[0], np.eye(3), atol=0)


def test_what_does_not_move() -> None:
    zero = Motion(heave=Harmonic(amplitude=0.0, period=3.0))
    for motion in (EndMotion(None, PLACE, BASE), EndMotion(zero, PLACE, BASE)):
        assert not motion.moving
        position, velocity, frame, spin = motion.at_time(3.0)
        assert position is motion.at_time(4.0)[0]  # shared, hence read-only
        with pytest.raises(ValueError):
            position[0] = 1.0
        assert not velocity.any() and not spin.any() and frame is not None
    guided = EndMotion(Motion(yaw=Harmonic(amplitude=3.0, period=3.0), ramp=1.0), None)
    assert guided.moving and guided.at_time(2.0)[2] is None


def test_after_the_record_the_end_stays(recorded: Motion) -> None:
    """Round-off may ask a hair beyond the last row; no cubic may run away there."""
    motion = EndMotion(recorded, PLACE, BASE)
    for last, beyond in zip(motion.at_time(39.75), motion.at_time(1e9), strict=True):
        np.testing.assert_array_equal(last, beyond)


def test_harmonics_of_a_list_add_up() -> None:
    both = EndMotion(Motion(heave=[SWELL, CHOP], ramp=10.0), PLACE)
    one, other = (EndMotion(Motion(heave=h, ramp=10.0), PLACE) for h in (SWELL, CHOP))
    for t in (3.0, 25.0):
        for k in (0, 1):
            rest = PLACE if k == 0 else 0.0
            np.testing.assert_allclose(both.at_time(t)[k], one.at_time(t)[k] + other.at_time(t)[k] - rest, atol=1e-14)
    assert Motion(heave=SWELL, yaw=[CHOP]).harmonics() == {"heave": (SWELL,), "yaw": (CHOP,)}


def test_turns_of_a_list_add_up() -> None:
    frame = np.eye(3)
    two = EndMotion(
        Motion(yaw=[Harmonic(amplitude=10, period=8), Harmonic(amplitude=20, period=8)], ramp=10.0), None, frame
    )
    one = EndMotion(Motion(yaw=Harmonic(amplitude=30, period=8), ramp=10.0), None, frame)
    np.testing.assert_allclose(two.at_time(23.0)[2], one.at_time(23.0)[2], atol=1e-14)
    np.testing.assert_allclose(two.at_time(23.0)[3], one.at_time(23.0)[3], atol=1e-14)


def test_steady_travel_reaches_its_velocity_and_lags_by_half_the_ramp() -> None:
    motion = EndMotion(Motion(velocity=(2.0, 0.0, -1.0), ramp=10.0), PLACE)
    np.testing.assert_allclose(motion.at_time(30.0)[1], (2.0, 0.0, -1.0), atol=1e-14)
    np.testing.assert_allclose(motion.at_time(30.0)[0] - PLACE, 25.0 * np.array([2.0, 0.0, -1.0]), atol=1e-12)
    np.testing.assert_allclose(motion.at_time(5.0)[1], (1.0, 0.0, -0.5), atol=1e-14)


def test_a_travel_arrives_and_stays() -> None:
    motion = EndMotion(MOTIONS["travel"], PLACE)
    for t in (0.0, 3.9, 4.0):
        np.testing.assert_array_equal(motion.at_time(t)[0], PLACE)
    np.testing.assert_allclose(motion.at_time(9.0)[0] - PLACE, (10.0, 2.5, -1.5), atol=1e-14)
    for t in (14.0, 1e6):
        np.testing.assert_allclose(motion.at_time(t)[0] - PLACE, (20.0, 5.0, -3.0), atol=1e-14)
        assert not motion.at_time(t)[1].any()


def test_the_smooth_step_is_the_derivative_of_its_way() -> None:
    for x in (-1.0, 0.2, 0.5, 0.9, 3.0):
        slope = derivative(lambda u: np.array(way_of_smooth_step(u)), x)
        assert smooth_step(x)[0] == pytest.approx(float(slope), abs=1e-12)
        assert smooth_step(x)[1] == pytest.approx(
            float(derivative(lambda u: np.array(smooth_step(u)[0]), x)), abs=1e-11
        )
    assert way_of_smooth_step(1.0) == 0.5 and way_of_smooth_step(4.0) == 3.5


def test_an_end_that_follows_waves_needs_them() -> None:
    with pytest.raises(ValueError, match="elevation"):
        EndMotion(MOTIONS["waves"], PLACE)
    position, velocity, *_ = EndMotion(MOTIONS["waves"], PLACE, elevation=sea).at_time(30.0)
    eta, rate, *_ = sea(PLACE[0], PLACE[1], 30.0)
    np.testing.assert_array_equal(position, PLACE + np.array([0.0, 0.0, eta]))
    np.testing.assert_array_equal(velocity, (0.0, 0.0, rate))


def test_nothing_moves_without_a_way() -> None:
    assert not EndMotion(Motion(velocity=(0.0, 0.0, 0.0)), PLACE).moving
    assert EndMotion(Motion(follow="waves"), PLACE, elevation=sea).moving


# --- refusals ----------------------------------------------------------------------------------

HEAVE = "{heave: {amplitude: 2.0, period: 8.0}, ramp: 16.0}"


def _scene(motion: str, position: str = "[205, 0, 0]") -> Scene:
    return parse_scene(change(OCEAN, f"[205, 0, 0], motion: {HEAVE}", f"{position}, motion: {motion}"), "scene.yaml")


def _refusal(motion: str, position: str = "[205, 0, 0]") -> str:
    with pytest.raises(SceneError) as caught:
        _scene(motion, position)
    (complaint,) = caught.value.complaints
    assert complaint.where.startswith("ends.end.motion") and complaint.line == 10
    return f"{complaint.value} | {complaint.expected} | {complaint.fix}"


@pytest.mark.parametrize("phase", [0, 30, 90, 180, -90])
def test_harmonics_need_a_ramp(phase: int) -> None:
    text = _refusal(f"{{surge: {{amplitude: 2.0, period: 8.0, phase: {phase}}}}}")
    assert "ramp: 16" in text
    assert ("position jumps" if abs(phase) == 90 else "velocity jumps") in text
    _scene(f"{{surge: {{amplitude: 2.0, period: 8.0, phase: {phase}}}, ramp: 16}}")


def _motion_file(tmp_path: Path, text: str) -> str:
    path = tmp_path / "fairlead.csv"
    path.write_text(text)
    return f"{{file: {path}}}"


def _rows(values: dict[float, str]) -> str:
    return "t,x,y,z\n" + "".join(f"{t},{v}\n" for t, v in values.items())


STILL = {float(t): "205,0,0" for t in range(0, 110, 10)}

BAD_FILES = {
    "empty": ("", "empty"),
    "no header": ("0,205,0,0\n1,205,0,0\n", "t,x,y,z"),
    "half the columns": ("t,x,y\n0,205,0\n", "t,x,y,z"),
    "a column too many": ("t,x,y,z,w\n0,205,0,0,1\n", "t,x,y,z"),
    "short row": (_rows({**STILL, 20.0: "205,0"}), "line 4: 3 entries"),
    "word": (_rows({**STILL, 20.0: "205,0,up"}), "line 4: z is no finite number"),
    "nan": (_rows({**STILL, 20.0: "205,0,nan"}), "line 4: z is no finite number"),
    "infinity": (_rows({**STILL, 20.0: "205,0,inf"}), "line 4: z is no finite number"),
    "gap": (_rows({**STILL, 20.0: "205,0,"}), "line 4: z is empty"),
    "few rows": ("t,x,y,z\n0,205,0,0\n200,205,0,0\n", "2 rows"),
    "time stands": (_rows(STILL).replace("20.0,", "10.0,"), "line 4: t = 10 after t = 10"),
    "time runs back": (_rows(STILL).replace("30.0,", "5.0,"), "line 5: t = 5 after t = 20"),
    "starts late": (_rows({t + 1: v for t, v in STILL.items()}), "starts at t = 1 s"),
    "ends early": (_rows({t / 2: v for t, v in STILL.items()}), "ends at t = 50 s"),
    "elsewhere": (_rows(STILL).replace("205", "204"), "[204, 0, 0] m in its first row | [205, 0, 0] m"),
    "rotation of a pin": ("t,rx,ry,rz\n" + "".join(f"{t},0,0,0\n" for t in STILL), "clamped"),
}


@pytest.mark.parametrize("name", BAD_FILES)
def test_bad_file(tmp_path: Path, name: str) -> None:
    text, said = BAD_FILES[name]
    assert said in _refusal(_motion_file(tmp_path, text))


def test_good_files(tmp_path: Path) -> None:
    _scene(_motion_file(tmp_path, _rows(STILL)))
    text = "# from the vessel\n" + _rows(STILL).replace("t,x,y,z", " t , x, y,z") + "\n"
    assert _scene(_motion_file(tmp_path, "\ufeff" + text)).length == 250.0
    before = {-20.0: "205,0,0", -10.0: "205,0,0", **STILL}
    _scene(_motion_file(tmp_path, _rows(before)))


def test_not_text(tmp_path: Path) -> None:
    (tmp_path / "x.csv").write_bytes(b"\xff\xfe\x00\x01")
    assert "cannot be read" in _refusal(f"{{file: {tmp_path / 'x.csv'}}}")
    assert "which is a folder" in _refusal(f"{{file: {tmp_path}}}")


def test_what_is_no_regular_file_is_refused_unread(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A pipe nobody writes to would be waited for, and a device can be read for ever."""
    os.mkfifo(tmp_path / "pipe.csv")
    (tmp_path / "link.csv").symlink_to("/dev/zero")
    for file, kind in (("pipe.csv", "a named pipe"), ("/dev/zero", "a device"), ("link.csv", "a device")):
        assert f"which is {kind}" in _refusal(f"{{file: {tmp_path / file}}}")
    monkeypatch.setattr("hybrid.scene.motion_file.LARGEST_FILE", 100)
    assert "at most 0 MB" in _refusal(_motion_file(tmp_path, _rows(STILL)))


def test_a_refusal_repeats_nothing_of_the_file(tmp_path: Path) -> None:
    secret = "root:x:0"
    texts = (f"{secret}\n", f"t,x,{secret}\n", f"t,x,y,z\n0,205,0,{secret}\n", f"t,x,y,z\n0,205,{secret}\n")
    for text in texts:
        assert secret not in _refusal(_motion_file(tmp_path, text))


def _moved(by: str, over: float) -> str:
    text = change(OCEAN, HEAVE, f"{{travel: {{by: {by}, over: {over}, begin: 30}}}}")
    return change(text, ", step: 0.02", "")


def test_a_travel_no_cable_can_follow_is_refused() -> None:
    """20 m in 0.05 s, a typing error: the speed and acceleration it asks for, and what would be accepted."""
    (complaint,) = complaints(_moved("[20, 0, 0]", 0.05))
    assert complaint.where == "ends.end.motion.travel.over" and complaint.line == 10
    assert "20 m in 0.05 s: up to 750 m/s and 4.62e+04 m/s^2" in complaint.value
    assert "2.945 %" in complaint.expected and "23.7 %" in complaint.expected
    accepted = float(complaint.fix.split()[1])
    assert complaints(_moved("[20, 0, 0]", accepted)) == []
    assert complaints(_moved("[20, 0, 0]", 0.9 * accepted)) != []
    # what hardly reaches into the cable, or is slow, may be short
    assert complaints(_moved("[0, 0, 0.45]", 0.01)) == [] and complaints(_moved("[0, 0, 40]", 10.0)) == []
    (stiff,) = complaints(change(_moved("[-20, 0, 0]", 0.05), "axial_stiffness: 2.0e8, ", ""))
    assert "5000 m/s" in stiff.expected


def test_a_record_as_fast_is_refused_alike(tmp_path: Path) -> None:
    """Smooth, with 20 rows in the 0.05 s of the move."""
    t = np.arange(0.0, 101.0, 0.0025)
    x = np.clip((t - 30.0) / 0.05, 0.0, 1.0)
    shift = np.zeros((len(t), 3))
    shift[:, 0] = 205.0 + 20.0 * x**3 * (10.0 - 15.0 * x + 6.0 * x**2)
    file = _csv(tmp_path / "m.csv", t, {"": shift})
    (complaint,) = complaints(change(change(OCEAN, HEAVE, f"{{file: {file}}}"), ", step: 0.02", ""))
    assert complaint.where == "ends.end.motion.file" and "m/s^2" in complaint.value and "units" in complaint.fix


def test_end_motion_refuses_a_bad_file_too(tmp_path: Path) -> None:
    with pytest.raises(SceneError, match=r"motion\.file"):
        EndMotion(Motion(file=str(tmp_path / "nowhere.csv")), PLACE)


def test_guided_and_clamped_files(tmp_path: Path) -> None:
    guided = "{kind: guided, tangent: [1, 0, 0], motion: MOTION}"
    clamped = "{kind: clamped, position: [205, 0, 0], tangent: [1, 0, 0], motion: MOTION}"
    old = f"{{kind: pinned, position: [205, 0, 0], motion: {HEAVE}}}"
    both = "t,x,y,z,rx,ry,rz\n" + "".join(f"{t},205,0,0,0,0,0\n" for t in STILL)
    turned = "t,rx,ry,rz\n" + "".join(f"{t},0,0,10\n" for t in STILL)
    with pytest.raises(SceneError, match="position of a guided end is free"):
        parse_scene(change(OCEAN, old, guided.replace("MOTION", _motion_file(tmp_path, both))))
    parse_scene(change(OCEAN, old, clamped.replace("MOTION", _motion_file(tmp_path, both))))
    with pytest.raises(SceneError, match="subtract the first row"):
        parse_scene(change(OCEAN, old, clamped.replace("MOTION", _motion_file(tmp_path, turned))))


@pytest.mark.parametrize("form", ["%.4f", "%.4g", "%.12g"])
@pytest.mark.parametrize("kind", ["smooth", "kink", "step", "start"])
def test_files_with_and_without_jumps(tmp_path: Path, form: str, kind: str) -> None:
    t = np.arange(0.0, 101.0, 0.5)
    values = _swell(t)
    if kind == "kink":
        values[:, 1] += np.where(t > 60.0, 0.8 * (t - 60.0), 0.0)
    if kind == "step":
        values[:, 2] += np.where(t > 60.0, 0.5, 0.0)
    if kind == "start":
        values[:, 0] += 0.8 * t
    path = _csv(tmp_path / "m.csv", t, {"": values}, form)
    if kind == "smooth":
        _scene(f"{{file: {path}}}", "[0, 0, 0]")
        assert np.isfinite(EndMotion(Motion(file=path), np.zeros(3)).at_time(1e9)[0]).all()
    else:
        said = _refusal(f"{{file: {path}}}", "[0, 0, 0]")
        assert "at t = 0, because the cable starts at rest" in said if kind == "start" else "at t = 60" in said


def test_motions_are_checked_wherever_a_scene_is_made() -> None:
    wrong = _scene(HEAVE).model_dump()
    wrong["ends"]["end"]["motion"]["ramp"] = None
    with pytest.raises(SceneError, match=r"ends\.end\.motion"):
        validate_scene(wrong)
    with pytest.raises(ValidationError, match=r"ends\.end\.motion"):
        Scene(**wrong)


def test_the_motion_files_of_the_page(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    page = (Path(__file__).parents[2] / "docs" / "scene.md").read_text(encoding="utf-8")
    scenes, (code, *_), (begin, *_) = (
        re.findall(rf"^```{x}\n(.*?)^```$", page, re.S | re.M) for x in ("yaml", "python", "csv")
    )
    scene = next(text for text in scenes if "heave: {amplitude: 0.5" in text)
    monkeypatch.chdir(tmp_path)
    exec(compile(code, "scene.md", "exec"), {})
    assert Path("lift.csv").read_text().startswith(begin)
    scene = scene.replace("motion: {heave: {amplitude: 0.5, period: 8.0}, ramp: 16.0}", "motion: {file: lift.csv}")
    scene = scene.replace("tangent: [1, 0, 1]", "tangent: [1, 0, 1], motion: {file: turn.csv}")
    ends = parse_scene(scene, "scene.yaml").ends
    assert ends.start.motion.file.endswith("turn.csv") and ends.end.motion.file.endswith("lift.csv")


# --- a record that leaps ---------------------------------------------------------------------------


@pytest.mark.parametrize("back", [False, True], ids=["for good", "and back"])
@pytest.mark.parametrize("row", [1, 2, 60, 197, 198, 199, 200])
@pytest.mark.parametrize("swell", [0.0, 2.0])
def test_a_leap_of_20_m_between_two_samples_is_refused(tmp_path: Path, swell: float, row: int, back: bool) -> None:
    """Wherever it is, also in the first and in the last rows of the record."""
    t = np.arange(0.0, 100.1, 0.5)
    z = np.array([swell * smooth_step(u / 16.0)[0] * math.sin(2 * math.pi * u / 8.0) for u in t])
    table = np.column_stack([t, 205.0 + 0.0 * t, 0.0 * t, z])
    name = tmp_path / "fairlead.csv"
    text = change(OCEAN, HEAVE, f"{{file: {name}}}")

    def said(rows: Array) -> list[str]:
        np.savetxt(name, rows, delimiter=",", header="t,x,y,z", comments="", fmt="%.6g")
        return [f"{c.where}: {c.value}" for c in complaints(text)]

    assert said(table) == []
    table[row : row + 1 if back else None, 3] += 20.0
    (complaint,) = said(table)
    assert complaint.startswith("ends.end.motion.file: fairlead.csv, whose velocity jumps by") or row <= 2
    assert "jumps by" in complaint or "starts with" in complaint


# --- Motion files that do not start at rest where the end is, blended in by a ramp ---

CENTRE = np.array([3.0, 0.0, 1.0])
BLENDED, TURNING = 5.0, 2.0


def table(folder: Path, kink: bool = False) -> str:
    """A circle of 0.5 m whose centre is 0.2 m beside the end: it begins with an offset and with 1 m/s."""
    t = np.arange(0.0, 12.01, 0.1)
    z = 1.0 + 0.5 * np.cos(TURNING * t) + (0.6 * np.maximum(t - 6.05, 0.0) if kink else 0.0)
    rows = np.column_stack([3.2 + 0.5 * np.sin(TURNING * t), t, z, 0.0 * t])
    path = folder / "circle.csv"
    np.savetxt(path, rows, delimiter=",", header="x,t,z,y", comments="", fmt="%.12g")
    return str(path)


def scene(file: str, **motion: float) -> hybrid.Scene:
    return hybrid.validate_scene(cable_scene(
        {"length": 5.0, "mass": 0.5, "axial_stiffness": 1e4}, pinned_at(0, 0, 0),
        {"kind": "pinned", "position": CENTRE.tolist(), "motion": {"file": file, **motion}}, model="catenary", mesh=20,
        time=(10.0, 0.05), output=0.5
    ))  # fmt: skip


def test_it_starts_at_rest_and_is_the_file_after_the_ramp(tmp_path: Path) -> None:
    """C2 at the start; exactly the circle from then on (spline of 31 rows a period: 1e-5 of its radius)."""
    motion = EndMotion(Motion(file=table(tmp_path), ramp=BLENDED), CENTRE)
    place, speed = motion.at_time(0.0)[:2]
    assert place.tolist() == CENTRE.tolist() and not speed.any()
    h = 1e-4
    assert np.linalg.norm(motion.at_time(h)[1]) < 1e-6
    for t in (0.7, 2.2, 4.9, 6.3, 9.0):
        change = (motion.at_time(t + h)[0] - motion.at_time(t - h)[0]) / (2 * h)
        np.testing.assert_allclose(motion.at_time(t)[1], change, rtol=0, atol=1e-6)
    for t in (5.0, 6.3, 9.0):
        circle = [3.2 + 0.5 * np.sin(TURNING * t), 0.0, 1.0 + 0.5 * np.cos(TURNING * t)]
        np.testing.assert_allclose(motion.at_time(t)[0], circle, rtol=0, atol=1e-5)


def test_a_run_says_how_it_is_blended_in(tmp_path: Path) -> None:
    with hybrid.run(scene(table(tmp_path), ramp=BLENDED)) as result:
        (event,) = (e for e in result.events if e.kind == "motion blended in")
        assert "0.5385 m" in event.text and "over 5 s" in event.text and event.s_a == 5.0
        end = result.position[result.t >= BLENDED, -1]
        t = result.t[result.t >= BLENDED]
        np.testing.assert_allclose(end[:, 0], 3.2 + 0.5 * np.sin(TURNING * t), rtol=0, atol=1e-5)


def test_a_run_of_several_lines_says_it_of_points(tmp_path: Path) -> None:
    """Of the point, once, whatever number of lines ends there."""
    line = {
        "sections": [{"length": 5.0, "mass": 0.5, "axial_stiffness": 1e4}],
        "model": "catenary",
        "mesh": {"cells": 5},
    }
    motion = {"file": table(tmp_path), "ramp": BLENDED}
    with hybrid.run({
        "points": {"low": {"position": [0, 0, 0]}, "far": {"position": [6, 0, 0]},
                   "eye": {"position": CENTRE.tolist(), "motion": motion}},
        "lines": {"one": line | {"start": "low", "end": "eye"}, "two": line | {"start": "eye", "end": "far"}},
        "time": {"duration": 0.2, "step": 0.05},
    }) as result:  # fmt: skip
        (event,) = (e for e in result.events if e.kind == "motion blended in")
        assert "points.eye" in event.text and "0.5385 m" in event.text and "over 5 s" in event.text


@pytest.mark.parametrize(
    ("motion", "kink", "text"),
    [({}, False, r"the position of this end at the start[\s\S]*or give `ramp"), ({"ramp": 5.0}, True, "a smooth velocity"),
     ({"ramp": 0.1}, False, "a ramp of at least 3 time steps")],
)  # fmt: skip
def test_what_is_refused(tmp_path: Path, motion: dict[str, float], kink: bool, text: str) -> None:
    with pytest.raises(hybrid.SceneError, match=text):
        hybrid.run(scene(table(tmp_path, kink), **motion))


def test_what_comes_after_the_end_of_a_run_is_not_judged(tmp_path: Path) -> None:
    """Runs were refused for a time that they do not compute."""
    t = np.arange(0, 60.01, 0.25)
    x = np.minimum(t / 8, 1)
    z = 2 * x**3 * (10 - 15 * x + 6 * x * x) + 0.5 * np.clip((t - 30) / 8, 0, 1) ** 3 * np.sin(
        2 * np.pi * (t - 30) / 3.0
    )
    table = np.column_stack([t, 80 + 0 * t, 0 * t, z])
    np.savetxt(tmp_path / "m.csv", table, delimiter=",", header="t,x,y,z", comments="", fmt="%.10g")
    scene = span(time=(20, 1.5))
    scene["ends"]["end"]["motion"] = {"file": str(tmp_path / "m.csv")}
    validate_scene(scene)
    rows = [[0, 1e3, 0, 1e3], [100, 1e3, 0, 1e3], [100.01, 1e3, 0, 9e3], [100.02, 1e3, 0, 1e3]]
    for duration in (10, 101):
        scene = span(time=(duration, 0.1))
        scene["ends"]["end"] = {"kind": "free", "force": {"history": rows}}
        if duration == 101:
            with pytest.raises(SceneError, match=r"100\.01 s"):
                validate_scene(scene)
        else:
            validate_scene(scene)
