"""Every command, every exit code, and what is said on which stream."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import hybrid
from hybrid.cli.app import FAILED, REFUSED, report_error
from hybrid.cli.commands import main
from hybrid.cli.console import Console
from hybrid.cli.tables import lowest_node
from tests.called import Call

WIRE = """\
title: a wire that swings
environment: {gravity: 9.81}
cable:
  sections:
    - {length: 2.0, mass: 1.0, axial_stiffness: 1.0e5, bending_stiffness: 0.1, damping: 1.0}
ends:
  start: {kind: pinned, position: [0, 0, 0]}
  end: {kind: free, force: {value: [5, 0, 0], until: 0.02}}
initial: equilibrium
model: {kind: zones, zones: [{catenary: 1.0, cells: 5}, {rod: 1.0, cells: 5}]}
time: {duration: 0.05, step: 0.005}
output: {every: 0.01, points: 5}
"""

LONG = "x" * 300  # characters, more than the name of a file may have

# The moving end catches up with the wave it sends: no flexible cable stays taut.
PUSHED = """\
title: a taut wire whose end moves in
cable:
  sections:
    - {length: 10.0, mass: 1.0, axial_stiffness: 1.0e6}
ends:
  start: {kind: pinned, position: [0, 0, 0]}
  end: {kind: pinned, position: [10.01, 0, 0], motion: {travel: {by: [-3.0, 0, 0], over: 0.5}}}
initial: equilibrium
model: catenary
mesh: {cells: 20}
time: {duration: 2.0, step: 0.005}
"""

BRIDLE = """\
title: a bridle that tows
environment: {fluid: {density: 1025, surface: 0, current: {kind: uniform, velocity: [0.8, 0, 0]}}}
points:
  ship: {position: [0, 5, 0]}
  other: {position: [0, -5, 0]}
  ring: {kind: free, mass: 20, initial_guess: [15, 0, -10], drag_area: 0.1, volume: 0.01}
  fish: {position: [40, 0, -55]}
lines:
  port: {start: ship, end: ring, sections: [&wire {length: 20, mass: 2, diameter: 0.03, axial_stiffness: 1.0e7, drag: {normal: 1.2}, added_mass: {normal: 1}}]}
  starboard: {start: other, end: ring, sections: [*wire]}
  tow:
    start: ring
    end: fish
    sections: [{length: 60, mass: 2, diameter: 0.03, axial_stiffness: 1.0e7, bending_stiffness: 50}]
    connections: {end: {kind: clamped, tangent: [0.6, 0, -0.8]}}
time: {duration: 10, step: 0.1}
"""


@pytest.fixture(autouse=True)
def folder(call: Call) -> None:
    """Where wire.yaml and pushed.yaml are."""
    Path("wire.yaml").write_text(WIRE)
    Path("pushed.yaml").write_text(PUSHED)


# ---- 0: done --------------------------------------------------------------------------------------


def test_run_writes_a_file_named_after_the_scene_and_says_what_it_reached(call: Call) -> None:
    said = call("run", "wire.yaml")
    assert said.code == 0
    *reached, closing = said.out.splitlines()
    assert closing.startswith("0.05 s in 10 steps, ") and closing.endswith("-> wire.h5")
    assert [line.split("  ")[0] for line in reached] == ["largest tension", "smallest tension", "smallest bend radius"]
    with hybrid.open("wire.h5") as result:
        assert result.status == "complete"
        assert result.times[-1] == 0.05


def test_run_output_settings_and_plot(call: Call) -> None:
    said = call("run", "wire.yaml", "-o", "other.h5", "--set", "time.step=0.01", "--set", "output.points=7", "--plot")
    assert said.code == 0
    assert "5 steps" in said.out and said.out.endswith("-> other.h5 and other.png\n")
    assert Path("other.png").read_bytes().startswith(b"\x89PNG")
    with hybrid.open("other.h5") as result:
        assert len(result.s) == 7


def test_quiet_says_nothing(call: Call) -> None:
    assert call("run", "wire.yaml", "--quiet") == (0, "", "")
    assert call("static", "wire.yaml", "-q") == (0, "", "")
    assert call("plot", "wire.h5", "-q") == (0, "", "")


def test_static_prints_a_table_and_writes_a_file(call: Call) -> None:
    said = call("static", "wire.yaml")
    assert said.code == 0
    for words in (
        "found by",
        "residual force",
        "largest tension",
        "smallest tension",
        "force at start",
        "lowest point",
    ):
        assert words in said.out
    assert said.out.endswith("-> wire.static.h5\n")
    facts = call("static", "wire.yaml", "--json").lines[-1]
    # The start holds the weight and the force at the free end.
    assert facts["force"]["start"] == pytest.approx([-5.0, 0.0, 2.0 * 9.81], abs=1e-6)
    assert facts["residual"] < 1e-6
    assert facts["tension_max"]["s"] == 0.0
    assert facts["lowest"]["s"] == 2.0


def test_the_lowest_point_of_a_flat_line_is_not_chosen_by_round_off() -> None:
    """The first node that is as low as any; one that is lower by more than round-off is the lowest."""
    s, r = np.linspace(0.0, 100.0, 11), np.zeros((11, 3))
    r[:, 2] = [-5.0, *(-7.0 - 1e-12 * np.random.default_rng(3).random(9)), -6.0]
    assert lowest_node(s, r) == 1
    r[7, 2] -= 1e-6
    assert lowest_node(s, r) == 7


@pytest.mark.long
def test_plot_takes_its_format_from_the_name(call: Call) -> None:
    call("run", "wire.yaml")
    said = call("plot", "wire.h5")
    assert said.code == 0 and said.out.endswith("t = 0 to 0.05 s -> wire.png\n")
    said = call("plot", "wire.h5", "-o", "wire.svg", "--times", "0,0.02", "--history", "0.5,1")
    assert said.code == 0 and Path("wire.svg").read_text().startswith("<?xml")


@pytest.mark.long
def test_plot_zones_has_a_file_of_its_own(call: Call) -> None:
    call("run", "wire.yaml")
    said = call("plot", "wire.h5", "--zones")
    assert said.code == 0 and said.out.endswith("t = 0 to 0.05 s -> wire.zones.png\n")
    assert Path("wire.zones.png").read_bytes().startswith(b"\x89PNG") and not Path("wire.png").exists()
    (done,) = call("plot", "wire.h5", "--zones", "-o", "zones.svg", "--json").lines
    assert done["file"] == "zones.svg" and Path("zones.svg").read_text().startswith("<?xml")
    assert call("plot", "wire.h5", "--zones", "-q") == (0, "", "")


def test_plan_of_lines_has_their_forces_their_time_and_no_text_that_is_cut(call: Call) -> None:
    Path("bridle.yaml").write_text(BRIDLE)
    said = call("plan", "bridle.yaml")
    lines = said.out.rstrip("\n").split("\n")
    rows = {line[:16].strip(): line[16:] for line in lines[1:-1] if not line.startswith(" ")}
    assert said.code == 0 and max(map(len, lines)) <= 80 and "..." not in said.out
    assert rows["line port"] == "20 m, ship to ring, catenary, 100 cells"
    cells = 100 if "estimated from tables" in said.out else 108  # with those in the layer at the clamp, as the run has
    assert rows["line tow"].startswith(f"60 m, ring to fish, rod, {cells} cells; end clamped")
    assert rows["free points"] == "ring" and rows["mesh"].startswith(f"{200 + cells} cells, ")
    assert all(name in said.out for name in ("gravity", "buoyancy", "drag", "added mass", "current", "bodies"))
    told, slack = " ".join(said.out.split()), r"up to [\d.]+ m?s if a line goes slack and becomes a rod"
    notes = rf"\(({slack}|estimated from tables: no step was tried)\)"  # the second where kernels are not compiled
    assert re.search(rf"time 10 s in 100 steps of 0.1 s; about [\d.]+ m?s of CPU for all runs {notes}", told), told


@pytest.mark.long
def test_plan_of_lines_says_what_touches_what(call: Call) -> None:
    Path("bridle.yaml").write_text(BRIDLE)
    apart = " ".join(call("plan", "bridle.yaml", "--set", "contact={between: []}").out.split())
    assert "lines pass through each other, and an event says where" in apart
    diameters = [f"lines.{name}.sections[0].diameter=0.02" for name in ("port", "starboard", "tow")]
    more = [
        "contact={friction: 0.2, between: [[port, tow]]}",
        "obstacles={pile: {at: [0, 50, 0], axis: [0, 0, 1], radius: 1}}",
    ]
    near = call("plan", "bridle.yaml", *(x for key in diameters for x in ("--set", key)))
    assert "of lines with each other, from where they come near each other" in " ".join(near.out.split())
    said = call("plan", "bridle.yaml", *(x for key in (*diameters, *more) for x in ("--set", key)))
    flat = " ".join(said.out.split())
    assert (
        said.code == 0
        and "of lines with each other, friction 0.2: port with tow; of every line with obstacles pile" in flat
    )
    assert "pass through" not in flat


def test_plan_says_what_is_on_and_computes_nothing(call: Call) -> None:
    # 10^11 steps would not end; and what is on is the same.
    long = ("--set", "time.duration=1e8", "--set", "time.step=1e-3", "--set", "output.every=1e6")
    said = call("plan", "wire.yaml", *long)
    assert said.code == 0
    lines = said.out.rstrip("\n").split("\n")
    assert len(lines) <= 12 and max(map(len, lines)) <= 80
    assert "gravity" in said.out and "10 cells" in said.out and "100000000000 steps of 0.001 s" in said.out
    verbose = call("plan", "wire.yaml", "--verbose", *long)
    assert "asked for by" in verbose.out and "environment.gravity" in verbose.out
    assert sorted(p.name for p in Path().iterdir()) == ["pushed.yaml", "wire.yaml"]
    touching = ("--set", "contact={self: true}", "--set", "model=rod", "--set", "cable.sections[0].bending_stiffness=1")
    for more in ((), touching):  # nobody knows for how long it will
        said = " ".join(call("plan", "wire.yaml", *more, "--set", "cable.sections[0].diameter=0.01").out.split())
        assert ("several times as much while it touches itself" in said) == bool(more), said
    (plan,) = call("plan", "wire.yaml", "--json").lines
    assert plan["event"] == "plan" and plan["steps"] == 10 and plan["cells"] == 10
    assert [(z["kind"], z["s_a"], z["s_b"], z["cells"]) for z in plan["zones"]] == [
        ("catenary", 0, 1, 5),
        ("rod", 1, 2, 5),
    ]
    assert {"what", "on", "why", "event", "s"} == set(plan["contents"][0])


@pytest.mark.long
def test_plan_of_a_line_with_20_000_attachments(call: Call) -> None:
    """Seconds; it did not end within 40 s when each asked for all the others."""
    clumps = "".join(f"    - {{kind: clump, at: {i * 1e-4:.4f}, mass: 0.001}}\n" for i in range(1, 20_000))
    Path("many.yaml").write_text(WIRE.replace("ends:\n", f"  attachments:\n{clumps}ends:\n", 1))
    (plan,) = call("plan", "many.yaml", "--json").lines
    assert plan["cells"] >= 20_000


def test_plan_of_a_scene_without_time(call: Call) -> None:
    Path("wire.yaml").write_text(WIRE.replace("time: {duration: 0.05, step: 0.005}\n", ""))
    said = call("plan", "wire.yaml")
    assert said.code == 0 and "statics only" in said.out


def test_json_lines_of_a_run(call: Call) -> None:
    said = call("run", "wire.yaml", "--json")
    assert said.code == 0
    progress, done = [line for line in said.lines if line["event"] == "progress"], said.lines[-1]
    last = progress[-1]
    assert (last["t"], last["duration"], last["step"]) == (0.05, 0.05, 10)
    assert last["zones"] == [{"kind": "catenary", "s_a": 0.0, "s_b": 1.0}, {"kind": "rod", "s_a": 1.0, "s_b": 2.0}]
    assert done["event"] == "done" and done["file"] == "wire.h5" and done["status"] == "complete"
    assert done["steps"] == 10 and done["wall"] > 0
    assert [line["event"] for line in call("run", "wire.yaml", "--json", "-q").lines] == ["done"]


def test_what_happened_is_told_most_important_first(call: Call, monkeypatch: pytest.MonkeyPatch) -> None:
    from hybrid.store.reader import Result
    from hybrid.store.records import Event

    events = [Event(0.0, 1, 1, "other", "b"), Event(0.0, 2, 2, "end rotated in", "a"), Event(1.5, 3, 3, "other", "c")]
    monkeypatch.setattr(Result, "events", events)
    said = call("run", "wire.yaml")
    assert said.err == "note: t = 0 s: a\nnote: t = 0 s: b (1 more like this)\n"
    notes = [line for line in call("run", "wire.yaml", "--json").lines if line["event"] == "note"]
    assert [(n["kind"], n["count"]) for n in notes] == [("end rotated in", 1), ("other", 2)]


# ---- 1: refused -----------------------------------------------------------------------------------


def test_a_bad_scene_is_refused_with_file_line_and_column(call: Call) -> None:
    Path("bad.yaml").write_text(WIRE.replace("mass: 1.0", "mass: -1.0").replace("length: 2.0", "lenght: 2.0"))
    for command in ("run", "static", "plan"):
        said = call(command, "bad.yaml")
        assert said.code == 1 and said.out == ""
        assert "bad.yaml:5:" in said.err and "cable.sections[0].mass" in said.err and "length?" in said.err
    (error,) = call("run", "bad.yaml", "--json").lines
    assert error["event"] == "error" and error["kind"] == "scene" and error["file"] == "bad.yaml"
    mass = next(c for c in error["complaints"] if c["where"].endswith("mass"))
    column = Path("bad.yaml").read_text().splitlines()[4].index("-1.0") + 1
    assert (mass["line"], mass["column"]) == (5, column)


def test_a_renamed_key_is_told_with_its_place(call: Call) -> None:
    Path("old.yaml").write_text(WIRE.replace(WIRE[WIRE.index("model:") : WIRE.index("time:")], "model: {dwell: 2.0}\n"))
    said = call("plan", "old.yaml")
    assert said.code == 0 and "old.yaml:10:9: model.dwell: dwell is now called hold_time" in " ".join(said.err.split())
    note, plan = call("plan", "old.yaml", "--json").lines
    assert (note["event"], plan["event"]) == ("note", "plan")
    assert {k: note[k] for k in ("old", "new", "line", "column")} == {
        "old": "dwell",
        "new": "hold_time",
        "line": 10,
        "column": 9,
    }


def test_an_unknown_setting_suggests_the_right_one(call: Call) -> None:
    said = call("run", "wire.yaml", "--set", "time.stp=0.01")
    assert said.code == 1 and "time.stp" in said.err and "step" in said.err.split("try:")[1]
    assert call("run", "wire.yaml", "--set", "nonsense").code == 1
    assert not Path("wire.h5").exists()


def test_a_scene_without_time_cannot_be_run(call: Call) -> None:
    Path("wire.yaml").write_text(WIRE.replace("time: {duration: 0.05, step: 0.005}\n", ""))
    said = call("run", "wire.yaml")
    assert said.code == 1 and said.err.startswith("wire.yaml:1:1: time\n")
    assert call("static", "wire.yaml").code == 0


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("run", "absent.yaml"), "absent.yaml"),
        (("plot", "absent.h5"), "there is no file"),
        (("run", "wire.yaml", "-o", "no/such/folder.h5"), "there is no folder"),
        (("run", "wire.yaml", "-o", "wire.yaml"), "is not a result of hybrid"),
        (("run", "wire.yaml", "--nonsense"), "hybrid run --help"),
        (("run",), "SCENE.yaml"),
        (("rum",), "Did you mean 'run'"),
        (("plot", "wire.h5", "--times", "0,x"), "no list of numbers"),
        (("plot", "absent.h5", "--zones"), "there is no file"),
        (("plot", "wire.h5", "--zones", "--times", "0"), "without --zones"),
        (("plot", "wire.h5", "--zones", "--history", "1"), "without --zones"),
        (("plot", f"{LONG}.h5"), "a shorter name"),
        (("run", f"{LONG}.yaml"), "given:    xxx"),
        (("run", "wire.yaml", "-o", f"{LONG}.h5"), "a shorter name"),
        (("static", "wire.yaml", "-o", f"{LONG}.h5"), "a shorter name"),
        (("import", "wire.yaml", "-o", f"{LONG}.yaml"), "wire.yaml"),
        (("export", "wire.yaml", "-o", f"{LONG}.fmu"), "a shorter name"),
        (("stats", "wire.h5", "--hours", "0"), "0 is no time"),
        (("stats", "wire.h5", "--hours", "nan"), "nan is no time"),
        (("stats", "wire.h5", "--strength", "1e6"), "add --curve"),
        (("stats", "wire.h5", "--section", "1,2,3"), "add --curve"),
        (("report", "a.h5", "b.h5", "--modes", "3"), "--modes: of the page of one result"),
        (("report", ".", "--modes", "3"), "--modes: of the page of one result"),
        (("report", ".", "--line", "x"), "--line: of a result"),
        (("trade", "wire.yaml", "--levels", "--models", "rod"), "--models: --levels has"),
        (("plan", "wire.yaml", "--outputs", "-v"), "--verbose: of the plan"),
        (("study", "wire.yaml", "--case", "0", "--sensitivity", "tension_max"), "--sensitivity: not with --case"),
        (("study", "wire.yaml", "--case", "0", "--netcdf", "x.nc"), "--netcdf: not with --case"),
    ],
)
def test_input_that_is_refused(call: Call, arguments: tuple[str, ...], words: str) -> None:
    said = call(*arguments)
    assert said.code == 1 and said.out == ""
    assert words in said.err and "Traceback" not in said.err
    (error,) = call(*arguments, "--json").lines
    assert error["event"] == "error" and words in error["message"]


@pytest.mark.parametrize(
    ("arguments", "where"),
    [
        (("--stiffness", "point:rng"), "stiffness"),
        (("--stiffness", "ring"), "stiffness"),
        (("--offsets", "point:ring"), "--offsets"),
        (("--offsets", "point:ring", "--reach", "0"), "--reach"),
        (("--offsets", "point:ring", "--reach", "inf"), "--reach"),
        (("--offsets", "point:ring", "--reach", "1", "--heading", "nan"), "--heading"),
        (("--reach", "1"), "--reach"),
        (("--heading", "90"), "--heading"),
        (("--set", "time.step"), "override"),
    ],
)
def test_options_are_refused_before_anything_is_computed(call: Call, arguments: tuple[str, ...], where: str) -> None:
    """An equilibrium was found and written first; and an option was said to stand in line 1 of the scene."""
    Path("bridle.yaml").write_text(BRIDLE)
    said = call("static", "bridle.yaml", *arguments)
    assert said.code == 1 and said.out == "" and said.err.startswith(f"bridle.yaml: {where}\n")
    assert not Path("bridle.static.h5").exists()


def test_plot_refuses_what_it_cannot_draw(call: Call) -> None:
    call("run", "wire.yaml", "-q")
    assert "outside the result" in call("plot", "wire.h5", "--times", "9").err
    said = call("plot", "wire.h5", "-o", "wire.docx")
    assert said.code == 1 and "docx" in said.err


def test_a_folder_that_others_write_to_is_not_what_was_written(tmp_path: Path) -> None:
    """The exit code of `-o FOLDER` was 2, failed, where another program wrote to the folder meanwhile."""
    console = Console(as_json=False, quiet=True)
    console.will_write(tmp_path)
    os.utime(tmp_path, ns=(1, 1))
    assert console.written is None


def test_an_older_result_is_replaced_unless_told_otherwise(call: Call) -> None:
    assert call("run", "wire.yaml", "-q").code == 0
    before = Path("wire.h5").read_bytes()
    said = call("run", "wire.yaml", "--no-overwrite")
    assert said.code == 1 and "exists" in said.err
    assert Path("wire.h5").read_bytes() == before
    assert call("run", "wire.yaml", "-q", "--set", "output.points=9").code == 0
    assert Path("wire.h5").read_bytes() != before


# ---- 2: failed ------------------------------------------------------------------------------------


def test_a_failed_computation_names_cause_place_and_snapshot(call: Call) -> None:
    said = call("run", "pushed.yaml")
    assert said.code == 2 and said.out == ""
    assert "goes into compression" in said.err and "(t = " in said.err and "s = " in said.err
    snapshot = Path("pushed.snapshot.npz").resolve()
    assert f"snapshot: {snapshot}" in said.err and snapshot.is_file()
    assert "file:     pushed.h5" in said.err
    with hybrid.open("pushed.h5") as result:
        assert result.status == "failed"
    error = call("run", "pushed.yaml", "--json").lines[-1]
    assert (error["event"], error["kind"], error["outcome"]) == ("error", "computation", "SLACK")
    assert error["snapshot"] == str(snapshot) and 0 < error["t"] < 2 and 0 <= error["s"] <= 10


def test_a_file_that_cannot_be_finished_is_a_failure(call: Call, monkeypatch: pytest.MonkeyPatch) -> None:
    def run(scene: object, output: Path, **_: object) -> None:
        output.write_text("half")
        raise hybrid.ResultError("disk full")

    monkeypatch.setattr(hybrid, "run", run)
    assert call("run", "wire.yaml").code == 2


def test_a_bug_is_called_a_bug(call: Call, monkeypatch: pytest.MonkeyPatch) -> None:
    def run(*_: object, **__: object) -> None:
        raise ZeroDivisionError("oh")

    monkeypatch.setattr(hybrid, "run", run)
    said = call("run", "wire.yaml")
    assert said.code == 2 and said.err.startswith("this is a bug in hybrid") and "ZeroDivisionError: oh" in said.err
    assert call("run", "wire.yaml", "--json").lines[-1]["kind"] == "bug"


# ---- the wrong kind of file, a pipe that is closed ----------------------------------------------------


@pytest.mark.parametrize("command", ["run", "static", "plan", "trade"])
def test_a_result_in_the_place_of_a_scene_is_named_as_one(call: Call, command: str) -> None:
    call("static", "wire.yaml", "-q")
    called = call(command, "wire.static.h5")
    assert called.code == 1 and not called.out
    assert "given:    an HDF5 file" in called.err and "try:      `hybrid plot wire.static.h5`" in called.err


@pytest.mark.parametrize("command", ["plot", "report", "resume", "export"])
def test_a_scene_in_the_place_of_a_result_is_named_as_one(call: Call, command: str) -> None:
    called = call(command, "wire.yaml")
    assert called.code == 1 and not called.out
    assert "is a scene, not a result" in called.err and "`hybrid run wire.yaml` writes wire.h5" in called.err


def into_a_closed_pipe(stream: str, *command: str) -> subprocess.CompletedProcess[bytes]:
    """A command, one of whose streams goes to a reader that is gone before anything is written."""
    script = "import sys; from hybrid.cli.commands import main; main(sys.argv[1:])"
    end, begin = os.pipe()
    os.close(end)
    streams = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE} | {stream: begin}
    try:
        return subprocess.run([sys.executable, "-c", script, *command], check=False, **streams)
    finally:
        os.close(begin)


@pytest.mark.skipif(sys.platform == "win32", reason="has no such pipes")
@pytest.mark.parametrize("command", [["schema"], ["--help"], ["--version"], ["plan", "-v", "wire.yaml"]])
def test_a_closed_pipe_ends_a_command_quietly(call: Call, command: list[str]) -> None:
    done = into_a_closed_pipe("stdout", *command)
    assert (done.returncode, done.stderr) == (0, b"")


@pytest.mark.skipif(sys.platform == "win32", reason="has no such pipes")
@pytest.mark.long  # 0.9 s
def test_a_closed_pipe_of_errors_changes_no_exit_code(call: Call) -> None:
    soft = "cable.sections[0].axial_stiffness=1.0"  # stretched beyond what a section bears
    assert into_a_closed_pipe("stderr", "static", "wire.yaml", "--set", soft).returncode == 2


@pytest.mark.parametrize("command", ["schema", "--help", "import"])
def test_a_full_disk_behind_the_output_takes_one_line(
    command: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    deck = Path(__file__).parents[1] / "data" / "moordyn" / "chain.txt"
    arguments = [command, str(deck), "-o", str(tmp_path)] if command == "import" else [command]
    with open("/dev/full", "w") as full:
        monkeypatch.setattr("sys.stdout", full)
        with pytest.raises(SystemExit) as ended:
            main(arguments)
        monkeypatch.undo()
    assert ended.value.code == FAILED
    said = [line for line in capsys.readouterr().err.splitlines() if "space" in line or "bug" in line]
    assert said == ["the output: No space left on device", "    try:      a folder you may write to, with free space"]


@pytest.mark.parametrize("options", [["--json"], []])
def test_a_run_whose_output_finds_no_space_is_kept_to_its_end(
    options: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Progress as JSON ended it, as failed."""
    scene, result = tmp_path / "scene.yaml", tmp_path / "run.h5"
    scene.write_text(
        "cable: {sections: [{length: 10, mass: 1, axial_stiffness: 1e5}]}\ninitial: equilibrium\n"
        "ends: {start: {kind: pinned, position: [0, 0, 0]}, end: {kind: pinned, position: [8, 0, 0]}}\n"
        "time: {duration: 1, step: 0.05}\n"
    )
    with open("/dev/full", "w") as full:
        monkeypatch.setattr("sys.stdout", full)
        with pytest.raises(SystemExit) as ended:
            main(["run", str(scene), "-o", str(result), *options])
        monkeypatch.undo()
    assert ended.value.code == FAILED
    said = [line for line in capsys.readouterr().err.splitlines() if "space left" in line or "bug" in line]
    assert said == [f"the output: No space left on device; the result is kept in {result}"]
    assert hybrid.open(result).status == "complete"


def test_a_link_that_leads_to_itself_is_no_bug(tmp_path: Path, call: Call) -> None:
    (tmp_path / "loop.h5").symlink_to("loop.h5")
    told = call("report", str(tmp_path / "loop.h5"))
    said = told.err.splitlines()
    assert told.code == REFUSED and len(said) == 2
    assert said[0].startswith(f"{tmp_path}/loop.h5: ") and "link" in said[1]


def test_memory_that_has_run_out_is_told_behind_what_fails_after_it(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(ValueError) as late:
        try:
            raise MemoryError("Unable to allocate 4.00 GiB")
        finally:
            raise ValueError("I/O operation on closed file")
    assert report_error(Console(False, False), late.value) == FAILED
    said = capsys.readouterr().err
    assert said.startswith("not enough memory\n") and "fewer cells" in said and "bug" not in said
