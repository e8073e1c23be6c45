"""Beyond the end, other loads, and what is refused."""

import json
import subprocess
import sys
import textwrap
from pathlib import Path

import h5py
import numpy as np
import pytest
from bits import Stopping, differences, resumed

import hybrid
import hybrid.simulation.run_record
from hybrid.accuracy.error_estimate import Estimate
from hybrid.errors import OTHER_PROGRAM
from hybrid.scene.root import in_full
from hybrid.simulation import case, restart, zones_at_rest
from hybrid.simulation.progress import ESTIMATION, RESULT
from hybrid.store import hdf5_file, whole_file
from hybrid.store import writer as record
from hybrid.store.hdf5_file import opened
from hybrid.store.integrity import pack, unpack
from hybrid.zones import change as zone_changes
from tests.combinations.pairs import END, scene_of
from tests.inside import calls_of
from tests.problems import tables_with
from tests.scenes import cable_scene, pinned_at

EXAMPLES = Path(__file__).parents[2] / "examples"


def swinging(**more):
    """A chain of 1 m that swings for 2 s, in steps of 0.01 s."""
    data = cable_scene(
        {"length": 1.0, "mass": 1.0, "diameter": 0.02, "drag": {"normal": 1.0}}, pinned_at(0, 0, 0), {"kind": "free"},
        initial={"kind": "straight", "direction": [0.6, 0, -0.8]}, fluid={"density": 100.0}, model="catenary", mesh=20,
        time=(2.0, 0.01), output={"every": 0.1, "points": 11, "errors": False},
    )  # fmt: skip
    return hybrid.validate_scene(data | more)


@pytest.fixture
def whole(tmp_path):
    hybrid.run(swinging(), tmp_path / "whole.h5").close()
    return tmp_path / "whole.h5"


def stopped(path: Path, monkeypatch, scene=None, after: int = 150) -> Path:
    Stopping(monkeypatch).stop(after, hybrid.run, scene or swinging(), path)
    return path


# ---- further ---------------------------------------------------------------------------------------


@pytest.mark.long
def test_beyond_the_end_of_an_accuracy_the_whole_is_judged(tmp_path):
    scene = hybrid.load_scene(EXAMPLES / "touchdown.yaml", ["accuracy=3%", "time={duration: 5}"])
    hybrid.run(scene, tmp_path / "run.h5").close()
    with hybrid.resume(tmp_path / "run.h5", until=8.0) as longer:
        assert longer.times[-1] == 8.0 and longer.status == "complete"
        assert len(longer["errors/total/position"]) == len(longer.times)
        assert "time: {duration: 8.0" in longer.scene_text
    with h5py.File(tmp_path / "run.h5") as file:
        assert whole_file.BEFORE not in file


@pytest.mark.long
@pytest.mark.parametrize("errors", [False, True])
def test_a_result_keeps_its_output_points(errors, tmp_path, monkeypatch):
    """Results of 0.6 have no output point at a change of section, and one value there; so have their errors."""
    section = {"mass": 1.0, "diameter": 0.02, "drag": {"normal": 1.0}}
    cable = {"sections": [section | {"length": 0.45}, section | {"length": 0.55, "mass": 2.0}]}
    scene = swinging(cable=cable, output={"every": 0.1, "points": 11, "errors": errors})
    stopping = Stopping(monkeypatch)
    with monkeypatch.context() as older:
        points = case.OutputPoints(np.linspace(0.0, 1.0, 11), np.zeros(0))
        older.setattr(case, "output_points", lambda scene, *_: points)
        hybrid.run(scene, tmp_path / "whole.h5", progress=stopping).close()
        stopped(tmp_path / "run.h5", monkeypatch, scene, stopping.heard - 50)
    with hybrid.resume(tmp_path / "run.h5") as result:
        assert result.s.size == 11 and "right/s" not in result and ("errors/total/tension" in result) == errors
    assert differences(tmp_path / "whole.h5", tmp_path / "run.h5") == []
    with hybrid.run(scene) as now:
        assert now.s.size == 12 and now["right/s"].tolist() == [0.45]


def test_an_end_that_is_moved_from_a_time_on(tmp_path, whole):
    travel = "ends.start.motion={travel: {by: [0.5, 0, 0], over: 1.0, begin: 2.5}}"
    with hybrid.resume(whole, until=4.0, settings=[travel]) as result:
        assert np.allclose(result.position[-1, 0], [0.5, 0, 0]) and np.allclose(result.position[25, 0], 0.0)


@pytest.mark.long
def test_a_change_is_made_where_the_run_stands_and_not_at_its_last_output(tmp_path, monkeypatch):
    """Outputs every second, stopped half-way between two: the file has the time at which the change was made."""
    scene = in_full(swinging(output={"every": 1.0, "points": 11}))
    path = stopped(tmp_path / "run.h5", monkeypatch, scene, 160)
    with opened(path) as file:
        point = whole_file.read_checkpoint(file)
    t, more = point.state["t"], {"settings": ["environment.fluid.current=[0.9, 0, 0]"]}
    assert point.t == 1.0 and 1.2 < t < 1.7
    with pytest.raises(hybrid.ResultError, match="computes the run anew"):
        hybrid.resume(path, start=t - 0.1, **more)
    hybrid.run(scene, tmp_path / "long.h5").close()
    hybrid.resume(tmp_path / "long.h5", tmp_path / "anew.h5", start=t, **more).close()
    with hybrid.resume(path, **more) as result, hybrid.open(tmp_path / "anew.h5") as anew:
        assert json.loads(result.changes_text)[0]["t"] == t
        one, other = (dict(x.lines).get("cable", x).position for x in (result, anew))
        assert np.allclose(one, other, rtol=0, atol=1e-9)


# ---- refusals --------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("more", "match"),
    [
        ({}, r"(?s)complete.*--until"),
        ({"until": 1.0}, "until"),
        ({"until": float("inf")}, "until"),
        ({"until": 3.0, "start": 2.5}, "from"),
        ({"until": 3.0, "settings": ["time.duration=4"]}, "say it once"),
        ({"start": 1.0}, r"(?s)from.*--set"),
        ({"settings": ["cable.sections[0].mass=2.0"]}, "from|sections"),
        ({"settings": ["cable.sections[0].mass=2.0"], "until": 3.0}, r"(?s)sections.*run the changed scene"),
        ({"settings": ["mesh.cells=30"], "until": 3.0}, "mesh"),
        ({"settings": ["environment.fluid.current=[1, 0, 0]"]}, r"(?s)before the end.*--until"),
        ({"settings": ["environment.fluid.current=[1, 0, 0]"], "start": 1.0}, r"(?s)anew.*-o"),
        ({"settings": ["ends.start.motion={surge: {amplitude: 1, period: 4}, ramp: 1}"], "until": 3.0}, "jumps by"),
        ({"settings": ["nonsense"], "until": 3.0}, "override"),
    ],
)
def test_what_cannot_be_is_refused_and_the_file_stays(more, match, whole):
    before = whole.read_bytes()
    with pytest.raises(hybrid.errors.HybridError if more else hybrid.ResultError, match=match):
        hybrid.resume(whole, **more)
    assert whole.read_bytes() == before
    assert [x.name for x in whole.parent.iterdir()] == [whole.name]


@pytest.mark.long
def test_another_program_goes_on_and_says_so(tmp_path, monkeypatch, whole):
    """The format of the checkpoint decides, not the program; that bits may differ is an event."""
    path = stopped(tmp_path / "run.h5", monkeypatch)
    with h5py.File(path) as file:
        t = whole_file.read_checkpoint(file).t
    monkeypatch.setattr(restart, "program", lambda: "9.9.9 0123456789abcdef")
    with hybrid.resume(path) as result, hybrid.open(whole) as same:
        (event,) = (e for e in result.events if e.kind == OTHER_PROGRAM)
        assert event.t == t and hybrid.__version__ in event.text and "9.9.9" in event.text
        assert (result.position == same.position).all()


def test_a_file_without_checkpoints_is_refused(tmp_path):
    hybrid.static(swinging(time=None), tmp_path / "rest.h5").close()
    with pytest.raises(hybrid.ResultError, match="no checkpoint"):
        hybrid.resume(tmp_path / "rest.h5", until=3.0)
    (tmp_path / "text.h5").write_text("no result")
    with pytest.raises(hybrid.ResultError, match="HDF5"):
        hybrid.resume(tmp_path / "text.h5")


@pytest.mark.long
def test_a_checkpoint_that_was_cut_off_leaves_the_one_before(tmp_path, monkeypatch):
    hybrid.run(swinging(), tmp_path / "whole.h5").close()
    path = stopped(tmp_path / "run.h5", monkeypatch)
    with h5py.File(path, "r+") as file:
        newest = whole_file.read_checkpoint(file)
        slot = file[whole_file.SLOTS[newest.number % 2]]
        slot[200:400] = 0
        older = whole_file.read_checkpoint(file)
        assert older.number == newest.number - 1 and older.state["t"] < newest.state["t"]
    hybrid.resume(path).close()
    assert differences(tmp_path / "whole.h5", path) == []
    path = stopped(tmp_path / "run.h5", monkeypatch)
    with h5py.File(path, "r+") as file:
        for name in whole_file.SLOTS:
            file[name][50:90] = 0
    with pytest.raises(hybrid.ResultError, match="no checkpoint"):
        hybrid.resume(path)


def test_an_end_that_moves_otherwise_is_noticed(tmp_path, monkeypatch):
    csv = tmp_path / "motion.csv"
    t = np.linspace(0.0, 3.0, 301)
    way = 0.1 * np.sin(t) ** 4
    csv.write_text("t,x,y,z\n" + "".join(f"{a:.3f},{b:.9f},0,0\n" for a, b in zip(t, way, strict=True)))
    ends = {"start": pinned_at(0, 0, 0, motion={"file": str(csv)}), "end": {"kind": "free"}}
    path = stopped(tmp_path / "run.h5", monkeypatch, swinging(ends=ends))
    csv.write_text("t,x,y,z\n" + "".join(f"{a:.3f},{2 * b:.9f},0,0\n" for a, b in zip(t, way, strict=True)))
    with pytest.raises(hybrid.ResultError, match=r"motion\.csv: other than when the run began"):
        hybrid.resume(path)
    # a change beyond the checkpoint is one as well
    kept = way.copy()
    kept[-1] += 1e-6
    csv.write_text("t,x,y,z\n" + "".join(f"{a:.3f},{b:.9f},0,0\n" for a, b in zip(t, kept, strict=True)))
    with pytest.raises(hybrid.ResultError, match="other than when the run began"):
        hybrid.resume(path)
    csv.unlink()
    with pytest.raises((hybrid.SceneError, hybrid.ResultError), match=r"motion\.csv"):
        hybrid.resume(path)


@pytest.mark.long
def test_two_processes_on_one_file(tmp_path, monkeypatch):
    from hybrid.cli.commands import main

    path = stopped(tmp_path / "run.h5", monkeypatch)
    script = f"""
        import time
        from pathlib import Path
        from hybrid.store.hdf5_file import locked
        with locked(Path({str(path)!r})):
            print("held", flush=True)
            time.sleep(60)
    """
    with subprocess.Popen([sys.executable, "-c", textwrap.dedent(script)], stdout=subprocess.PIPE) as other:
        assert other.stdout.readline() == b"held\n"
        before = path.read_bytes()
        for attempt in (lambda: hybrid.resume(path), lambda: hybrid.run(swinging(), path)):
            with pytest.raises(hybrid.ResultError, match="another process"):
                attempt()
        assert path.read_bytes() == before
        with pytest.raises(SystemExit) as left:
            main(["resume", str(path)])
        assert left.value.code == 1
        other.kill()
    hybrid.resume(path).close()  # a lock of a process that is gone does not hold
    assert [x.name for x in tmp_path.iterdir()] == ["run.h5"]


@pytest.mark.long
def test_a_full_disk_loses_nothing(tmp_path):
    """As full as a limit of the file's size makes it, in a process of its own; then it goes on, bit for bit."""
    scene = swinging(output={"every": 0.01, "points": 101, "errors": False})
    (tmp_path / "scene.yaml").write_text(hybrid.scene_text(scene))
    hybrid.run(scene, tmp_path / "whole.h5").close()
    most = round(0.7 * (tmp_path / "whole.h5").stat().st_size)
    script = f"""
        import resource
        from hybrid.cli.commands import main
        from hybrid.store import writer as record
        import hybrid.simulation.run_record
        import hybrid.solve.network_steps
        hybrid.simulation.run_record.WORK = 0
        record._PART = 0.0
        record.pause = lambda made: 0.0
        hybrid.solve.network_steps.CELL_STEPS = 1
        resource.setrlimit(resource.RLIMIT_FSIZE, ({most}, {most}))
        main(["run", "-q", {str(tmp_path / "scene.yaml")!r}, "-o", {str(tmp_path / "run.h5")!r}])
    """
    done = subprocess.run([sys.executable, "-c", textwrap.dedent(script)], capture_output=True, text=True)
    assert done.returncode == 2, done.stderr
    assert "cannot be written" in done.stderr and "free some" in done.stderr and "hybrid resume" in done.stderr
    with hybrid.open(tmp_path / "run.h5") as result:
        assert result.status == "running" and len(result.times) > 2
    hybrid.resume(tmp_path / "run.h5").close()
    assert differences(tmp_path / "whole.h5", tmp_path / "run.h5") == []


def test_a_folder_that_is_read_only(tmp_path, monkeypatch):
    path = stopped(tmp_path / "run.h5", monkeypatch)
    before = path.read_bytes()

    def refused(*_):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(hdf5_file.FileLock, "acquire", refused)
    with pytest.raises(
        hybrid.ResultError, match=r"(?s)cannot be written.*Permission denied.*a folder you may write to"
    ):
        hybrid.resume(path)
    assert path.read_bytes() == before


# ---- the command -----------------------------------------------------------------------------------


@pytest.mark.long
def test_the_command_goes_on_and_says_so(tmp_path, monkeypatch, call):
    path = str(stopped(tmp_path / "run.h5", monkeypatch))
    done = call("resume", path, "--json")
    assert not done.code and done.lines[-1]["status"] == "complete" and done.lines[-1]["t"] == 2.0
    done = call("resume", path)
    assert done.code == 1 and "nothing left to do" in done.err
    done = call("resume", path, "--until", "2.5", "--set", "environment.fluid.current=[0.2,0,0]", "--from", "2.2")
    assert not done.code and "the last 0.5 s" in " ".join(done.out.split())


# ---- versions --------------------------------------------------------------------------------------


def test_a_file_of_a_newer_format_is_refused(whole):
    with h5py.File(whole, "r+") as file:
        file.attrs["format_version"] = 2
    for attempt in (hybrid.open, hybrid.resume):
        with pytest.raises(hybrid.ResultError, match="result format 2; this program reads format 1"):
            attempt(whole)


# ---- what an adversary found -----------------------------------------------------------------------


@pytest.mark.long
@pytest.mark.parametrize(
    "more", [{"until": 8.0}, {"settings": ["environment.fluid.current=[0.4, 0, 0]"], "start": 4.5}]
)
def test_a_change_that_is_stopped_has_the_errors_of_the_change(more, tmp_path, monkeypatch):
    """The climb of the run before it is not that of the run that goes on."""
    settings = ["output.errors=true", "time.duration=5", "model=catenary"]
    scene = hybrid.load_scene(EXAMPLES / "touchdown.yaml", settings)
    Stopping(monkeypatch)

    def stop_after(name, t):
        def stop(progress):
            if progress.name == name and progress.t > t:
                raise KeyboardInterrupt

        return stop

    begun = tmp_path / "begun.h5"
    with pytest.raises(KeyboardInterrupt):
        hybrid.run(scene, begun, progress=stop_after(RESULT, 4.0))
    hybrid.resume(begun, tmp_path / "whole.h5", **more).close()
    for name, t in ((RESULT, 4.7), (ESTIMATION, 1.0)):
        (tmp_path / "run.h5").write_bytes(begun.read_bytes())
        with pytest.raises(KeyboardInterrupt):
            hybrid.resume(tmp_path / "run.h5", progress=stop_after(name, t), **more)
        hybrid.resume(tmp_path / "run.h5").close()
        assert differences(tmp_path / "whole.h5", tmp_path / "run.h5") == []


@pytest.mark.long
def test_a_run_that_is_stopped_while_its_model_error_is_computed_again(tmp_path, monkeypatch):
    """After the result, where no accuracy is asked for: the result stands, and goes on to its error figure."""
    monkeypatch.setattr(Estimate, "lacks_model_errors", lambda self: True)
    scene = hybrid.load_scene(EXAMPLES / "touchdown.yaml", ["output.errors=true", "time.duration=5"])
    stopping = Stopping(monkeypatch)
    hybrid.run(scene, tmp_path / "whole.h5", progress=stopping).close()
    path = stopped(tmp_path / "run.h5", monkeypatch, scene, stopping.heard - 3)
    with hybrid.open(path) as result:
        assert result.status == "complete" and result.times[-1] == 5.0
    hybrid.resume(path).close()
    assert differences(tmp_path / "whole.h5", path) == []


@pytest.mark.long
def test_a_finer_result_of_another_scene_is_not_taken(tmp_path):
    """What a killed run has left beside its file is of that run."""
    file, settings = "touchdown.yaml", ["accuracy=0.3%", "time={duration: 5}"]
    scene = hybrid.load_scene(EXAMPLES / file, settings)
    other = hybrid.load_scene(EXAMPLES / file, [*settings, "title=other", "output.points=51"])
    left = tmp_path / ".run.h5.finer"
    hybrid.run(scene, tmp_path / "run.h5").close()
    left.write_bytes((tmp_path / "run.h5").read_bytes())
    with hybrid.run(other, tmp_path / "run.h5") as result:
        assert result.title == "other" and len(result.s) == 51
    assert [x.name for x in tmp_path.iterdir()] == ["run.h5"]


@pytest.mark.parametrize("setting", ["ends.end.motion.pitch.amplitude=-60", "ends.end.motion=null"])
def test_an_end_that_would_turn_at_once_is_refused(setting, tmp_path):
    data = cable_scene(
        {"length": 2.0, "mass": 1.0, "bending_stiffness": 5.0, "torsional_stiffness": 5.0}, pinned_at(0, 0, 0),
        {"kind": "guided", "tangent": [1, 0, 0], "force": [20, 0, 0],
         "motion": {"pitch": {"amplitude": 20, "period": 4}, "ramp": 1}},
        gravity=0.0, initial={"kind": "straight", "direction": [1, 0, 0]}, model="rod", mesh=10, time=(1.0, 0.02),
        output={"every": 0.1, "points": 5, "errors": False}
    )  # fmt: skip
    hybrid.run(data, tmp_path / "run.h5").close()
    with pytest.raises(hybrid.SceneError, match=r"(?s)jumps by.*rad"):
        hybrid.resume(tmp_path / "run.h5", until=2.0, settings=[setting])


def test_an_end_before_a_change_is_refused(tmp_path, monkeypatch, whole):
    more = {"settings": ["environment.fluid.current=[0.4, 0, 0]"], "start": 2.6, "until": 3.0}
    Stopping(monkeypatch).stop(20, hybrid.resume, whole, **more)
    with pytest.raises(hybrid.SceneError, match=r"after the change at 2\.6 s"):
        hybrid.resume(whole, until=2.5)


@pytest.mark.long
def test_a_checkpoint_of_odd_things_is_refused_in_words(tmp_path, monkeypatch):
    """Its digest is right, and what it says is not."""
    path = stopped(tmp_path / "run.h5", monkeypatch)
    with h5py.File(path) as file:
        point = whole_file.read_checkpoint(file)._asdict()
    lines = "lines" in point["state"]  # else a file by the road of cables
    finely, of_line = point["resolution"], point["state"]["lines"]["cable"] if lines else point["state"]

    def fine(**more):
        return {"resolution": {"cable": finely["cable"] | more} if lines else finely | more}

    def state(**more):
        return {"state": point["state"] | ({"lines": {"cable": of_line | more}} if lines else more)}

    odd = [
        {"resolution": [1.0]}, {"state": point["rows"]}, {"rows": {"nowhere": 3}}, {"rows": {}}, {"rows": {"t": -1}},
        {"happened": {"merge": "often"}}, {"number": 0.0}, {"t": "now"}, {"t": 0.5}, {"zones": [["rod", 0.0]]},
        fine(step=1e-9), fine(parts=0), fine(places=np.array([0.0, 2.0, 1.0])),
        {"state": point["state"] | {"t": float("nan")}}, state(work=np.zeros(3)), state(plane=np.zeros((2, 3))),
        {"state": {k: v for k, v in point["state"].items() if k != "steps"}},
    ]  # fmt: skip
    for wrong in odd:
        with h5py.File(path, "r+") as file:
            for name in whole_file.SLOTS:  # both, so that there is none to fall back on
                file[name][:] = 0
            whole_file.write_slot([file[whole_file.SLOTS[0]]], 0, pack(point | {"number": 0} | wrong))
        with pytest.raises(hybrid.ResultError, match="checkpoint"):
            hybrid.resume(path)


@pytest.mark.long
def test_home_and_links_lead_to_the_file_they_name(tmp_path, monkeypatch):
    monkeypatch.setenv("HOME", str(tmp_path))
    scene = hybrid.load_scene(EXAMPLES / "touchdown.yaml", ["accuracy=0.3%", "time={duration: 5}"])
    hybrid.run(scene, "~/run.h5").close()
    (tmp_path / "link.h5").symlink_to("run.h5")
    hybrid.run(scene, tmp_path / "link.h5").close()
    assert (tmp_path / "link.h5").is_symlink()
    left = {x.name for x in tmp_path.iterdir()} - {".cache"}  # kernels, where no other folder is named for them
    assert left == {"run.h5", "link.h5"}


def test_checkpoints_are_at_the_same_places_whatever_the_clock(tmp_path, monkeypatch):
    """By the work done: a run whose file is flushed at every pause has the same ones as one that never is."""
    monkeypatch.setattr(hybrid.simulation.run_record, "WORK", 20 * 40)  # 40 steps of 20 cells
    monkeypatch.setattr(hybrid.solve.network_steps, "CELL_STEPS", 20 * 7)  # a pause every 7 steps
    places, kept, last = [], [], calls_of(monkeypatch, record.Recorder, "checkpoint", after=lambda _, x, *__: x.last)
    for k, pause in enumerate((0.0, 1e9)):
        monkeypatch.setattr(record, "pause", lambda _, pause=pause: pause)
        monkeypatch.setattr(record, "_PART", 0.0)
        hybrid.run(swinging(), tmp_path / f"{k}.h5").close()
        places.append([*last])
        last.clear()
        with opened(tmp_path / f"{k}.h5") as file:
            points = [whole_file._checkpoint(unpack(bytes(file[name][()]))) for name in whole_file.SLOTS]
        kept.append([(x.number, x.t, x.rows, x.state["steps"]) for x in points])
    assert places[0] == places[1] and len(places[0]) == 6  # of 200 steps: the first, after 42, 84, 126, 168, the last
    assert kept[0] == kept[1]


@pytest.mark.long
def test_zones_that_are_fixed_stay_so(tmp_path, monkeypatch):
    """A run whose rods may not go, and which says so in its checkpoint alone: the same bits, and none goes."""
    text = hybrid.load_scene(EXAMPLES / "touchdown.yaml").model_dump(exclude_none=True)
    text |= {"model": {"kind": "adaptive", "tolerance": 2e-5, "hold_time": 1.5}}

    def lasting(duration):
        return hybrid.validate_scene(text | {"time": text["time"] | {"duration": duration}})

    assert any(e.kind in ("shrink", "merge") for e in hybrid.run(lasting(20.0)).events)
    with monkeypatch.context() as patch:
        found = zone_changes.manager_for

        def held(*given):
            manager = found(*given)
            manager.held = True
            return manager

        for module in (zone_changes, zones_at_rest):
            patch.setattr(module, "manager_for", held)
        whole = hybrid.run(lasting(30.0))
        hybrid.run(lasting(15.0), tmp_path / "short.h5").close()
    with hybrid.resume(tmp_path / "short.h5", until=30.0) as more:
        assert np.array_equal(more.position, whole.position)
        assert not any(e.kind in ("shrink", "merge") for e in more.events)


def test_events_before_the_old_end_are_kept_and_those_of_the_end_go(tmp_path):
    """What is noted at an end of what was before was written in front of it, and kept in its place."""
    payout = {"rate": 3.0, "ramp": 0.1, "longest": 14.0}
    changes = {f"{END}.payout": payout, "output.every": 0.125, "time.step": 0.03125}
    resumed(tables_with(scene_of("payout", "clump"), changes), tmp_path, 0.25)


def test_of_two_changes_at_one_time_both_hold(tmp_path):
    """The second was dropped, and began where the file was made longer."""
    section = {"length": 40, "mass": 2.0, "diameter": 0.03, "axial_stiffness": 1e5, "drag": {"normal": 1.2}}
    scene = cable_scene(
        section, pinned_at(0, 0, 0), pinned_at(30, 0, -5), fluid={"density": 1025}, initial="equilibrium", mesh=12,
        time=(0.5, 0.05), output=(0.25, 9)
    )  # fmt: skip
    first, second = (f"environment.fluid.current=[0, {x}, 0]" for x in (1, -1))
    hybrid.run(scene, tmp_path / "a.h5").close()
    hybrid.resume(tmp_path / "a.h5", tmp_path / "b.h5", until=1, settings=[first], start=0.5).close()
    both = hybrid.resume(tmp_path / "b.h5", tmp_path / "c.h5", settings=[second], start=0.5)
    alone = hybrid.resume(tmp_path / "a.h5", tmp_path / "d.h5", until=1, settings=[second], start=0.5)
    np.testing.assert_allclose(both.position, alone.position, atol=1e-9)
