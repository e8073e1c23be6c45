"""Numbers from what was measured: closed forms of their deviations, and what cannot be told apart."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

import hybrid
from hybrid.cli.commands import app
from hybrid.scene.read import scene_text
from hybrid.scene.root import in_full
from tests.scenes import cable_scene, pinned_at

EI, MASS = "cable.sections[0].bending_stiffness", "cable.sections[0].mass"
G, W = 9.81, 0.05
TRUE = 12.0  # N m2
SCENE = f"""\
environment: {{gravity: {G}}}
cable: {{sections: [{{length: 2, mass: {W}, axial_stiffness: 1.0e+8, bending_stiffness: 20, torsional_stiffness: 20}}]}}
ends:
  start: {{kind: clamped, position: [0, 0, 0], tangent: [1, 0, 0]}}
  end: free
initial: equilibrium
model: rod
mesh: {{cells: 40}}
"""
DESIGN = f"""\
scene: rod.yaml
unknowns:
  EI: {{key: "{EI}", low: 2, high: 200}}
measured: {{file: shape.csv, deviation: 0.001}}
"""


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("rod.yaml").write_text(SCENE)
    Path("design.yaml").write_text(DESIGN)
    write(shape())
    return tmp_path


def shape(columns=("z",), s=(2.0,), mass=W):
    """What a rod of TRUE has at places."""
    rest = hybrid.static(hybrid.load_scene("rod.yaml", [f"{EI}={TRUE}", f"{MASS}={mass}"]))
    of = {"x": rest.position[-1][:, 0], "z": rest.position[-1][:, 2], "tension": rest.tension[-1]}
    return {"s": np.array(s)} | {x: np.interp(s, rest.s, of[x]) for x in columns}


def write(table):
    rows = [",".join(f"{x:.12g}" for x in row) for row in zip(*table.values(), strict=True)]
    Path("shape.csv").write_text("\n".join(["# measured", ",".join(table), *rows]) + "\n")


def test_stiffness_and_its_deviation(folder):
    """z = -w L^4 / 8 EI at the tip: d EI = EI d z / z, of a deflection of 4 % of the length within 1 %."""
    found = hybrid.design("design.yaml")
    (estimate,) = found.estimates
    assert estimate.value == pytest.approx(TRUE, rel=1e-6) and found.equilibria < 10
    sag = W * G * 2.0**4 / (8 * TRUE)
    assert estimate.deviation == pytest.approx(TRUE * 0.001 / sag, rel=0.01)
    assert estimate.high - estimate.low == pytest.approx(2 * 1.96 * estimate.deviation, rel=1e-3)
    assert not found.apart and found.count == 1
    assert abs(estimate.by_cells) < 1e-3 * TRUE and estimate.by_cells != 0.0


def test_the_only_line_needs_no_column_of_its_name(folder):
    named = scene_text(in_full(hybrid.load_scene("rod.yaml")))
    Path("rod.yaml").write_text(named)
    Path("design.yaml").write_text(DESIGN.replace(EI, EI.replace("cable", "lines.cable")))
    (estimate,) = hybrid.design("design.yaml").estimates
    assert estimate.value == pytest.approx(TRUE, rel=1e-6)


def test_only_the_ratio_of_stiffness_and_mass_is_known(folder):
    write(shape(("x", "z"), np.linspace(0.25, 2.0, 8)))
    Path("design.yaml").write_text(
        DESIGN.replace("measured:", f'  mass: {{key: "{MASS}", low: 0.01, high: 1}}\nmeasured:')
    )
    told = CliRunner().invoke(app, ["design", "design.yaml"])
    assert told.exit_code == 0, told.output
    assert f"EI and mass: only their ratio is known, EI / mass = {TRUE / W:.0f}" in told.output
    assert told.output.count("not known") == 2
    found = hybrid.design("design.yaml")
    assert all(np.isinf(x.deviation) for x in found.estimates)
    assert found.numbers["EI"] / found.numbers["mass"] == pytest.approx(TRUE / W, rel=1e-5)
    (apart,) = found.apart
    assert apart.parts == pytest.approx({"EI": 1.0, "mass": 1.0}, rel=1e-3)


def test_another_kind_of_measurement_tells_them_apart(folder):
    """The tension half way is the weight of what hangs beyond times the slope, which mass alone scales."""
    write(shape(("z", "tension"), (1.0, 2.0)))
    text = DESIGN.replace("measured:", f'  mass: {{key: "{MASS}", low: 0.01, high: 1}}\nmeasured:')
    Path("design.yaml").write_text(text.replace("deviation: 0.001", "deviations: {z: 0.001, tension: 0.0005}"))
    found = hybrid.design("design.yaml")
    assert not found.apart and found.numbers == pytest.approx({"EI": TRUE, "mass": W}, rel=1e-5)
    assert found.correlations[0, 1] > 0.5  # both rise together
    Path("design.yaml").write_text(text)
    assert hybrid.design("design.yaml").estimates[1].deviation > found.estimates[1].deviation  # 1 mN for 0.5 mN


def test_what_was_measured_scatters(folder):
    """Without a deviation that of the scatter, with Student's factor of 7; one that is too small is said."""
    s = np.linspace(0.25, 2.0, 8)
    table = shape(("z",), s)
    table["z"] = table["z"] + 0.002 * np.array([1, -1, -1, 1, 1, -1, -1, 1])
    write(table)
    Path("design.yaml").write_text(DESIGN.replace(", deviation: 0.001", ""))
    free = hybrid.design("design.yaml")
    assert free.scatter == pytest.approx(0.002, rel=0.05) and not free.notes
    (estimate,) = free.estimates
    assert (estimate.high - estimate.value) / estimate.deviation == pytest.approx(2.3646, rel=1e-3)
    Path("design.yaml").write_text(DESIGN.replace("0.001", "0.0005"))
    (note,) = hybrid.design("design.yaml").notes
    assert note.startswith("what is left is 4.") and "times the stated deviation" in note


def test_a_bound_that_is_in_the_way_is_said(folder):
    Path("design.yaml").write_text(DESIGN.replace("low: 2,", "low: 15,"))
    found = hybrid.design("design.yaml")
    assert found.numbers["EI"] == 15.0 and any("EI is at its bound (low)" in x for x in found.notes)


BAD = {
    "no s": ("x,z\n2,-0.08\n", "shape.csv:1: measured.file", "a column s"),
    "an unknown column": ("s,zz\n2,-0.08\n", "shape.csv:1: measured.file", "a column of x, y, z, or one of: tension"),
    "no number": ("s,z\n1,-0.02\n2,low\n", "shape.csv:3: z", "a number, or nothing"),
    "beyond the end": ("s,z\n\n2.5,-0.08\n", "shape.csv:3: s", "between 0 and 2 m"),
    "a short row": ("s,z\n2\n", "shape.csv:2: measured.file", "2, one for each column"),
    "nothing": ("s,z\n2,\n", "shape.csv: measured.file", "at least one number"),
    "two kinds": ("s,z,tension\n2,1,1\n", "design.yaml", "a deviation of every column"),
}


@pytest.mark.parametrize("name", BAD)
def test_bad_tables_are_refused_with_their_line(folder, name):
    text, place, expected = BAD[name]
    Path("shape.csv").write_text(text)
    if name == "two kinds":
        Path("design.yaml").write_text(DESIGN.replace(", deviation: 0.001", ""))
    with pytest.raises(hybrid.SceneError) as raised:
        hybrid.design("design.yaml")
    assert place in str(raised.value) and expected in str(raised.value), raised.value


def test_nothing_else_is_asked_beside_what_was_measured(folder):
    Path("design.yaml").write_text(DESIGN + "minimise: EI\n")
    with pytest.raises(hybrid.SceneError, match=r"design\.yaml:5:11: minimise[^$]*found from what was measured"):
        hybrid.design("design.yaml")


DRAG = "cable.sections[0].drag.normal"
TOWED = Path(__file__).parents[2] / "examples" / "designs" / "towed.yaml"


def towed(tmp_path, noise):
    """A record of the towed umbilical with EI 6 N m2 and drag 1.3, with noise (m, 2) in parts of 0.14 N, 0.0185 rad."""
    run = hybrid.run(hybrid.load_scene(TOWED, [f"{EI}=6", f"{DRAG}=1.3", "output.every=0.2"]))
    table = np.stack([run.t, run["reaction_start"][:, 0], run["theta"][:, -1]], axis=1)[1:]
    table[:, 1:] += noise * [0.14, 0.0185]
    rows = "".join(f"{t:.1f},{a:.12g},{b:.12g}\n" for t, a, b in table)
    (tmp_path / "record.csv").write_text("t,reaction_start.x,theta\n" + rows)
    stated = {"reaction_start.x": 0.14, "theta": 0.0185}
    return hybrid.design(
        hybrid.load_scene(TOWED),
        unknowns={"EI": {"key": EI, "low": 1, "high": 100}, "drag": {"key": DRAG, "low": 0.3, "high": 3}},
        measured={"file": str(tmp_path / "record.csv"), "at": "end", "deviations": stated},
    )


@pytest.mark.long
def test_stiffness_and_drag_from_a_history(tmp_path):
    """Without noise both come back; deviations are those of differences of runs by hand, J^T J over deviations."""
    found = towed(tmp_path, np.zeros((40, 2)))
    assert found.numbers == pytest.approx({"EI": 6.0, "drag": 1.3}, rel=1e-4)
    columns = []
    for key, x in ((EI, 6.0), (DRAG, 1.3)):
        both = []
        for part in (1.01, 0.99):
            others = [f"{EI}=6", f"{DRAG}=1.3", f"{key}={part * x}", "output.every=0.2"]
            run = hybrid.run(hybrid.load_scene(TOWED, others))
            both.append(np.concatenate([run["reaction_start"][1:, 0] / 0.14, run["theta"][1:, -1] / 0.0185]))
        columns.append((both[0] - both[1]) / (0.02 * x))
    J = np.stack(columns, axis=1)
    expected = np.sqrt(np.diag(np.linalg.inv(J.T @ J)))
    assert [x.deviation for x in found.estimates] == pytest.approx(expected, rel=0.01)
    assert [x.result for x in found.histories] == ["reaction_start.x", "theta@end"]
    assert found.histories[0].t[0] == 0.2 and found.histories[0].unit == "N" and found.moving == 1
    np.testing.assert_allclose(found.histories[1].after, found.histories[1].measured, rtol=1e-4)


def test_a_row_without_a_time_is_of_the_equilibrium(tmp_path):
    """A single row shows EI alone, in which drag has no part."""
    rest = hybrid.static(hybrid.load_scene(TOWED, [f"{EI}=6"]))["theta"][-1, -1]
    (tmp_path / "record.csv").write_text(f"t,theta\n,{rest:.12g}\n")
    found = hybrid.design(
        hybrid.load_scene(TOWED), unknowns={"EI": {"key": EI, "low": 1, "high": 100}},
        measured={"file": str(tmp_path / "record.csv"), "at": "end", "deviation": 0.0185},
    )  # fmt: skip
    assert found.numbers == pytest.approx({"EI": 6.0}, rel=1e-5) and found.runs == 0 and not found.histories


@pytest.mark.long
def test_noise_that_goes_on_from_reading_to_reading_is_said(tmp_path):
    """Of x_i = 0.8 x_(i-1) + e; noise of readings by themselves is not said to be so."""
    white = np.random.default_rng(3).standard_normal((40, 2))
    slow = white.copy()
    for i in range(1, 40):
        slow[i] = 0.8 * slow[i - 1] + 0.6 * white[i]
    assert not towed(tmp_path, white).notes
    notes = towed(tmp_path, slow).notes
    assert any("like that at the time before (correlation 0." in x for x in notes), notes


def test_friction_of_the_bed_from_the_pull_of_a_dragged_line(tmp_path):
    """A line that lies straight and is dragged slides as a whole: its pull is the friction times its weight.

    So it is once the line has stopped to ring: friction is the same at any speed and damps no ringing of a line that
    slides, of period 4 L sqrt(m / EA) = 0.57 s, by 180 N of 392 N here.  Damping of the material takes it.  The end is
    as deep as the line lies, so that the bed bears all of the weight.
    """
    friction, z = "environment.seabed.friction.axial", -5 * 9.81 / 1e5
    section = {"length": 20, "mass": 5, "diameter": 0.03, "axial_stiffness": 1e5, "damping": {"stiffness": 0.05}}
    bed = {"z": 0, "stiffness": 1e5, "damping": 1e3, "friction": {"axial": 0.5, "lateral": 0.5}}
    scene = hybrid.validate_scene(cable_scene(
        section, "free", pinned_at(20, 0, z, motion={"velocity": [0.5, 0, 0], "ramp": 1}), seabed=bed,
        initial={"kind": "straight", "origin": [0, 0, z], "direction": [1, 0, 0]}, model="catenary", mesh=20,
        time=(6, 0.02)
    ))  # fmt: skip
    weight = 5 * 20 * 9.81
    rows = "".join(f"{t},{0.4 * weight + d}\n" for t, d in ((4, 3), (5, -3)))
    (tmp_path / "pull.csv").write_text("t,tension\n" + rows)
    found = hybrid.design(
        scene, unknowns={"mu": {"key": friction, "low": 0.1, "high": 1}},
        measured={"file": str(tmp_path / "pull.csv"), "at": "end", "deviation": 4.0},
    )  # fmt: skip
    (mu,) = found.estimates
    assert mu.value == pytest.approx(0.4, rel=1e-4)
    assert mu.deviation == pytest.approx(4.0 / np.sqrt(2.0) / weight, rel=1e-3)


HISTORIES = {
    "no time": (lambda: str(Path("rod.yaml")), "t,z\n1,-0.08\n", "end", "shape.csv:2: t", "a scene with time"),
    "beyond the run": (lambda: str(TOWED), "t,z\n9,-0.08\n", "end", "shape.csv:2: t", "a time between 0 and 8 s"),
    "two places": (lambda: str(TOWED), "t,s,z\n1,1,-0.08\n", "end", "at", "nothing, because"),
    "beyond the end": (lambda: str(TOWED), "t,z\n1,-0.08\n", 4.5, "measured.at", "between 0 and 4 m"),
}


@pytest.mark.parametrize("name", HISTORIES)
def test_bad_histories_are_refused(folder, name):
    scene, text, at, place, expected = HISTORIES[name]
    Path("shape.csv").write_text(text)
    with pytest.raises(hybrid.SceneError) as raised:
        hybrid.design(
            scene(), unknowns={"EI": {"key": EI}}, measured={"file": "shape.csv", "at": at, "deviation": 0.001}
        )
    assert place in str(raised.value) and expected in str(raised.value), raised.value
