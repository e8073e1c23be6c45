"""Start-up is light: a command imports what it needs and nothing else; help and schema need hardly anything."""

from __future__ import annotations

import json
import runpy
import subprocess
import sys
import warnings
from pathlib import Path

import pytest

import hybrid
from hybrid.cli.app import ORDER, session
from hybrid.kernels.machine.cache import CacheWarning
from tests.scenes import cable_scene, pinned_at

HEAVY = {"numba", "h5py", "matplotlib", "scipy"}
HANGING = cable_scene(
    {"length": 1.0, "mass": 1.0}, pinned_at(0, 0, 0), "free", model="catenary", mesh=4, time=(0.1, 0.001)
)
CODE = """
import sys, json
from hybrid.cli.commands import main
try:
    main(sys.argv[1:])
except SystemExit as leaving:
    assert not leaving.code
print(json.dumps(list(sys.modules)), file=sys.stderr)
"""


def call(*arguments: str) -> tuple[str, set[str]]:
    """What a command that succeeds prints, and the modules it imports."""
    done = subprocess.run([sys.executable, "-c", CODE, *arguments], capture_output=True, text=True, check=True)
    *said, modules = done.stderr.splitlines()
    assert not said
    return done.stdout, set(json.loads(modules))


@pytest.mark.parametrize("arguments", [["--version"], ["--help"], ["run", "--help"], ["schema"]])
def test_what_needs_no_numbers_imports_no_numbers(arguments: list[str]) -> None:
    out, modules = call(*arguments)
    assert out and not modules & HEAVY


@pytest.mark.long
def test_plan_draws_nothing_and_plot_needs_no_solver(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("hanging.yaml").write_text(json.dumps(HANGING))  # JSON is YAML
    out, modules = call("plan", "hanging.yaml")
    assert "4 cells" in out and "matplotlib" not in modules
    hybrid.run(hybrid.validate_scene(HANGING), "hanging.h5").close()
    out, modules = call("plot", "hanging.h5")
    assert "hanging.png" in out and not modules & {"numba", "scipy", "hybrid.accuracy.passes"}


@pytest.mark.long
@pytest.mark.parametrize("command", ["run", "static", "plan"])
def test_what_is_compiled_is_called_without_numba(
    command: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its import takes as long as a short run; so do together rich, payout, and the special

    functions of a line that snaps alone, with which f2py comes.
    """
    monkeypatch.chdir(tmp_path)
    Path("hanging.yaml").write_text(json.dumps(HANGING))
    subprocess.run([sys.executable, "-c", CODE, command, "hanging.yaml"], capture_output=True, check=True)
    _, modules = call(command, "hanging.yaml")  # what had to be compiled is, and was said
    assert "hybrid.kernels.machine.linked_code" in modules
    assert not modules & {"numba", "scipy", "scipy.special", "numpy.f2py", "matplotlib"}
    assert not modules & {"hybrid.simulation.payout", "hybrid.kernels.reel.payout"}
    assert command == "run" or not any(x.partition(".")[0] == "rich" for x in modules), "a long run shows a line"


@pytest.mark.long
def test_a_picture_of_a_command_is_that_of_python(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A command imports matplotlib without the help of its classes; its modules are those that drawing needs."""
    monkeypatch.chdir(tmp_path)
    with hybrid.run(hybrid.validate_scene(HANGING), "hanging.h5") as result:
        hybrid.plot(result, "python.png")
    code = CODE.replace("print(json", "from matplotlib.lines import Line2D; assert not Line2D.set.__doc__; print(json")
    done = subprocess.run([sys.executable, "-c", code, "plot", "hanging.h5"], capture_output=True, text=True)
    assert not done.returncode, done.stderr
    assert "matplotlib.pyplot" not in json.loads(done.stderr.splitlines()[-1])
    assert Path("hanging.png").read_bytes() == Path("python.png").read_bytes()


@pytest.mark.parametrize("several", [False, True])
def test_schema_is_valid_json_schema(several: bool) -> None:
    schema = json.loads(call("schema", *["--lines"] * several)[0])
    assert schema["$schema"].startswith("https://json-schema.org/")
    form = schema if several else schema["$defs"][schema["else"]["$ref"].rpartition("/")[2]]
    assert ({"points", "lines"} if several else {"cable", "ends", "initial"}) <= set(form["required"])
    assert form["additionalProperties"] is False

    def check(part: object) -> None:
        if isinstance(part, dict):
            if isinstance(part.get("$ref"), str):
                assert part["$ref"].removeprefix("#/$defs/") in schema["$defs"]
            if isinstance(part.get("type"), str):
                assert part["type"] in {"object", "array", "string", "number", "integer", "boolean", "null"}
            for inside in part.values():
                check(inside)
        elif isinstance(part, list):
            for inside in part:
                check(inside)

    check(schema)


def test_python_runs_the_package_as_the_command(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "argv", ["hybrid", "--version"])
    with pytest.raises(SystemExit) as left:
        runpy.run_module("hybrid", run_name="__main__")
    assert not left.value.code and capsys.readouterr().out.startswith(f"hybrid {hybrid.__version__}\n")


@pytest.mark.long
def test_the_help_names_every_command() -> None:
    from hybrid.cli.commands import app

    named = {x.name or x.callback.__name__ for x in app.registered_commands if x.callback}
    assert named == {*ORDER.split()}


def test_version_and_help() -> None:
    named, code = call("--version")[0].splitlines()
    assert named == f"hybrid {hybrid.__version__}" and code.startswith(
        "machine code: compiled once for this processor; "
    )
    assert call()[0] == call("-h")[0]
    for line in ("Compute the motion of a cable", "Exit codes: 0 done"):
        assert line in call("--help")[0]


def test_a_cache_that_is_not_used_is_said_in_one_line(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """As a note, or as a line of JSON; warnings of others are shown as ever."""
    shown: list[object] = []
    monkeypatch.setattr(warnings, "showwarning", lambda *of: shown.append(of[1]))
    for as_json in (False, True):
        with warnings.catch_warnings():
            warnings.simplefilter("always")
            monkeypatch.setattr(warnings, "showwarning", lambda *of: shown.append(of[1]))
            with session(as_json, False):
                warnings.warn("machine code x is truncated", CacheWarning, stacklevel=1)
                warnings.warn("other", RuntimeWarning, stacklevel=1)
        out, err = capsys.readouterr()
        if as_json:
            assert json.loads(out) == {"event": "note", "text": "machine code x is truncated"} and not err
        else:
            assert err == "note: machine code x is truncated\n" and not out
    assert shown == [RuntimeWarning, RuntimeWarning]
