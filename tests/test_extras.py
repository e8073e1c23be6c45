"""Extras: what lacks one says the command that installs it, in one way; each stands in pyproject.toml."""

from __future__ import annotations

import ast
import os
import re
import runpy
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest
import typer
from compile_kernels import BY_TABLE
from extras import EXTRAS, PROJECT, extra_of, name_of

import hybrid
from hybrid.cli.app import session
from hybrid.cli.commands import main
from hybrid.errors import ResultError, command_for
from hybrid.kernels.machine.compile import entry
from hybrid.kernels.machine.kept_code import Called, _of_function
from hybrid.scene.motion import read_dataset
from hybrid.scene.motion_file import RecordRefused
from hybrid.statistics.fatigue import rainflow_cycles
from hybrid.studies.cases import evaluated

PACKAGE = Path(hybrid.__file__).parent
EXAMPLES = PACKAGE.parent / "examples"


def hide(monkeypatch: pytest.MonkeyPatch, package: str) -> None:
    """As if a package were not installed."""
    for module in [name for name in sys.modules if name.split(".")[0] == package]:
        monkeypatch.delitem(sys.modules, module)
    monkeypatch.setitem(sys.modules, package, None)


@pytest.mark.parametrize(
    ("package", "extra", "command"),
    [
        ("starlette", "view", ["view"]),
        pytest.param("websockets", "view", ["view", "--json"], marks=pytest.mark.needs("starlette", "uvicorn")),
        pytest.param(
            "zarr",
            "studies",
            ["study", str(EXAMPLES / "studies" / "heave.yaml"), "-o", "study"],
            marks=pytest.mark.needs("simpleeval", "xarray"),
        ),
        ("pythonfmu3", "fmu", ["export", str(EXAMPLES / "touchdown.yaml"), "-o", "line.fmu"]),
    ],
)
def test_a_command_without_its_extra_says_how_to_install_it(
    package: str, extra: str, command: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    hide(monkeypatch, package)
    monkeypatch.chdir(tmp_path)
    with pytest.raises(SystemExit) as left:
        main(command)
    said = "".join(capsys.readouterr())
    assert left.value.code == 1 and "bug" not in said and "Traceback" not in said
    assert package in said and command_for(extra) in said.replace('\\"', '"')
    assert not list(tmp_path.iterdir())


def test_functions_without_their_extra_say_how_to_install_it(monkeypatch: pytest.MonkeyPatch) -> None:
    for package in ("rainflow", "openmdao", "h5netcdf", "simpleeval"):
        hide(monkeypatch, package)
    with pytest.raises(ResultError, match=re.escape(command_for("export"))):
        rainflow_cycles([0.0, 1.0, 0.0])
    with pytest.raises(ResultError, match=re.escape(command_for("studies"))):
        evaluated("minimise", "mass", [{"mass": 1.0}])
    with pytest.raises(ResultError, match=re.escape(command_for("openmdao"))):
        hybrid.openmdao_component(EXAMPLES / "designs" / "buoy.yaml")
    with pytest.raises(RecordRefused) as refused:  # which the scene says with line and column
        read_dataset("ship.nc")
    assert refused.value.finding.fix == command_for("export")


def test_a_command_that_ends_with_a_code_is_no_bug(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(typer.Exit) as left, session(as_json=False, quiet=False):
        raise typer.Exit(3)
    assert left.value.exit_code == 3 and capsys.readouterr() == ("", "")


def test_every_extra_that_is_named_is_there_and_named_in_one_way() -> None:
    calls: dict[str, list[list[str]]] = {"optional_package": [], "command_for": []}
    for file in PACKAGE.rglob("*.py"):
        text = file.read_text(encoding="utf-8")
        assert "pip install" not in text or file.name == "errors.py", f"{file}: hybrid.errors.command_for says it"
        for node in ast.walk(ast.parse(text)) if any(name in text for name in calls) else ():
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id in calls:
                calls[node.func.id].append([x.value for x in node.args if isinstance(x, ast.Constant)])
    named = {words[-1] for words in [*calls["optional_package"], *calls["command_for"]] if words}
    assert named == {"export", "studies", "view", "video", "notebook", "fmu", "openmdao"}
    for package, _, extra in (words for words in calls["optional_package"] if len(words) == 3):
        name = {"distributed": "dask"}.get(package, package.split(".")[0])
        assert name in map(name_of, EXTRAS[extra]), f"{extra} does not bring {package}"


def test_dev_brings_all_others_and_test_only_what_pytest_needs() -> None:
    (own,) = (x for x in EXTRAS["dev"] if name_of(x) == PROJECT["name"])
    assert set(own.partition("[")[2].rstrip("]").split(",")) == EXTRAS.keys() - {"dev"}
    assert [*map(name_of, EXTRAS["test"])] == ["pytest", "pytest-xdist", "hypothesis"]
    core = {*map(name_of, PROJECT["dependencies"])}
    assert all(extra_of(name_of(x)) for x in EXTRAS["dev"]) and not core & {
        name_of(x) for y in EXTRAS.values() for x in y
    }


# --- How the suite is run (conftest.py): what needs no kernels first, in each process, and nothing is lost ---

CONFTEST = runpy.run_path(str(Path(__file__).parents[1] / "conftest.py"))
TESTS = CONFTEST["TESTS"]


def items(*files: str) -> list[SimpleNamespace]:
    return [SimpleNamespace(path=TESTS / file) for file in files]


@pytest.mark.parametrize("processes", [1, 2, 3])
def test_each_process_begins_with_files_of_few_kernels(processes: int) -> None:
    made = items(*["solve/a.py"] * 9, *["scene/b.py"] * 6, *["test_c.py"] * 3)
    ordered = list(made)
    config = SimpleNamespace(workerinput={"workercount": processes})
    CONFTEST["pytest_collection_modifyitems"](config, ordered)
    assert sorted(map(id, ordered)) == sorted(map(id, made))
    share = len(ordered) // processes
    for k in range(processes):
        first = [item.path.parent.name for item in ordered[k * share : (k + 1) * share]][: 6 // processes]
        assert set(first) == {"scene"}
    assert [x.path.name for x in ordered if x.path.name != "b.py"] == ["test_c.py"] * 3 + ["a.py"] * 9


def test_only_what_calls_many_kernels_waits_for_them(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(os.environ, CONFTEST["COMPILING"], str(tmp_path))
    marker, (few, many) = tmp_path / "plane", items("scene/b.py", "solve/a.py")
    marker.touch()
    waits: list[float] = []

    def sleep(seconds: float) -> None:
        waits.append(seconds)
        marker.unlink()

    monkeypatch.setattr("time.sleep", sleep)
    next(CONFTEST["pytest_runtest_protocol"](few))
    assert not waits
    next(CONFTEST["pytest_runtest_protocol"](many))
    assert len(waits) == 1


def code_of(kernels: str) -> dict[object, int]:
    """Bytes of bytecode of each function that some kernels reach."""
    found: Called = dict.fromkeys(entry(name).py_func for name in kernels.split())
    todo = list(found)
    while todo:
        new = [x for x in _of_function(todo.pop())[1] if x not in found]
        found.update(dict.fromkeys(new))
        todo += new
    return {x: len(x.__code__.co_code) for x in found}


@pytest.mark.long  # imports all kernels
def test_kernels_that_share_laws_are_compiled_in_one_process() -> None:
    """Half of what kernels read was read in both processes when each had the kernels of one dimension."""
    one, other = map(code_of, BY_TABLE.values())
    both = sum(one[x] for x in one.keys() & other.keys())
    assert 0 < both < 0.25 * sum((one | other).values())
