"""Results of several lines for other programs: the file itself in netCDF4 and xarray, and `hybrid export` of it."""

from __future__ import annotations

import json
import re
import shlex
import zipfile
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

import hybrid
from hybrid.errors import ResultError
from tests.called import Call
from tests.scenes import line_between, network_scene

ROPE = {"length": 60, "mass": 4, "diameter": 0.04, "axial_stiffness": 1e7}
SCENE: dict[str, Any] = network_scene(
    {"anchor": {"position": [-40, 0, -50]}, "fairlead": {"body": "hull", "place": [0, 0, -1]},
     "float": {"initial_guess": [0, 0, -10], "mass": 200, "volume": 1.0}},
    {"west": line_between("anchor", "float", ROPE, mesh=8), "east": line_between("fairlead", "float", ROPE, mesh=8)},
    title="A float between an anchor and a hull", fluid={"density": 1025}, bodies={"hull": {"position": [40, 0, -49]}},
    time=(0.2, 0.05), output={"points": 9}
)  # fmt: skip


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run, one that was resumed from it, and an equilibrium."""
    folder = tmp_path_factory.mktemp("lines")
    hybrid.run(SCENE, folder / "run.h5").close()
    hybrid.resume(folder / "run.h5", folder / "resumed.h5", until=0.4).close()
    hybrid.static(SCENE, folder / "static.h5").close()
    return folder


def exported(call: Call, folder: Path, name: str, *arguments: str, result: str = "run.h5") -> tuple[int, set[str], str]:
    """Exit code, names of the files that were made, and what was said of an error."""
    before = {x.name for x in folder.iterdir()}
    said = call("export", str(folder / result), "-o", str(folder / name), *arguments)
    return said.code, {x.name for x in folder.iterdir()} - before, said.err


@pytest.mark.parametrize("file", ["run.h5", "resumed.h5", "static.h5"])
def test_every_dimension_of_a_file_leads_to_its_scale(folder: Path, file: str) -> None:
    with h5py.File(folder / file) as opened:
        found: dict[str, h5py.Dataset] = {}
        opened.visititems(lambda name, x: found.update({name: x} if isinstance(x, h5py.Dataset) else {}))
        assert sum(name.startswith("lines/") for name in found) > 80
        for name, data in found.items():
            top = "/".join(["", *name.split("/")[: 2 if name.startswith("lines/") else 0]]).rstrip("/")
            for k, dim in enumerate(data.dims):
                if dim.label and data.name != f"{top}/{dim.label}":  # bytes of checkpoints are scales without a label
                    assert [x.name for x in dim.values()] == [f"{top}/{dim.label}"], (name, k)
                    assert dim[0].is_scale and len(dim[0]) == data.shape[k]


@pytest.mark.long
@pytest.mark.parametrize("engine", ["h5netcdf", "netcdf4"])
@pytest.mark.parametrize("file", ["run.h5", "resumed.h5", "static.h5"])
@pytest.mark.needs("xarray", "h5netcdf")
def test_a_file_opens_in_xarray(folder: Path, file: str, engine: Any) -> None:
    import xarray

    groups = xarray.open_groups(folder / file, engine=engine)
    with hybrid.open(folder / file) as result:
        for name, line in result.lines.items():
            found = groups[f"/lines/{name}"]
            assert found.tension.dims == ("t", "s") and found.position.dims == ("t", "s", "xyz")
            assert np.array_equal(found.tension, line.tension) and np.array_equal(found.s, line.s)
            assert found.tension.attrs["units"] == "N" and len(found.t) == len(result.times)
            assert np.array_equal(groups[f"/lines/{name}/energy"].potential, line["energy/potential"])
        assert np.array_equal(groups["/points/float"].position, result["points/float/position"])
    for each in groups.values():
        assert not [dim for dim in each.sizes if dim.startswith("phony")]
        each.close()


@pytest.mark.needs("pandas")
def test_points_and_bodies_are_exported_under_their_names(folder: Path, call: Call) -> None:
    """As `hybrid.export` of the result does; a name of lines is a file of each, at the places that are asked for."""
    import pandas

    assert exported(call, folder, "float.csv", "--names", "points/float/position") == (0, {"float.csv"}, "")
    with hybrid.open(folder / "run.h5") as result:
        table = pandas.read_csv(folder / "float.csv", comment="#")
        assert np.array_equal(table.iloc[:, 1:], result["points/float/position"])
        hybrid.export(result, folder / "same.csv", names=["points/float/position"])
        assert (folder / "same.csv").read_bytes() == (folder / "float.csv").read_bytes()
        made = exported(call, folder, "mix.csv", "--names", "tension,bodies/hull,points", "--at", "5")
        assert made == (0, {"mix.csv", "mix.west.csv", "mix.east.csv"}, "")
        table = pandas.read_csv(folder / "mix.csv", comment="#")
        for key in ("bodies/hull/position", "points/fairlead/velocity"):
            assert np.array_equal(table.filter(like=key), result[key])
        table = pandas.read_csv(folder / "mix.east.csv", comment="#")
        assert list(table.columns) == ["t (s)", "tension (N) at s = 5 m"]
    assert exported(call, folder, "t.csv")[1] == {"t.west.csv", "t.east.csv"}, "tension, which lines alone have"
    assert exported(call, folder, "e.csv", "--names", "events")[1] == {"e.csv", "e.west.csv", "e.east.csv"}


@pytest.mark.long
@pytest.mark.needs("xarray", "h5netcdf")
def test_netcdf_holds_everything(folder: Path, call: Call) -> None:
    import xarray

    assert exported(call, folder, "all.nc")[:2] == (0, {"all.nc", "all.west.nc", "all.east.nc"})
    with xarray.open_dataset(folder / "all.nc") as shared, hybrid.open(folder / "run.h5") as result:
        assert np.array_equal(shared.points_float_position, result["points/float/position"])
    assert exported(call, folder, "one.nc", "--line", "west")[1] == {"one.nc"}


@pytest.mark.parametrize(
    ("name", "arguments", "message"),
    [
        ("p.vtkhdf", ("--names", "points/float"), "vtkhdf is of lines alone\n    given:    points/float"),
        ("p.csv", ("--names", "points/float/positon"), "no 'points/float/positon'; did you mean points/float/position"),
        ("p.csv", ("--names", "contacts"), "the result has no 'contacts'"),
        ("p.csv", ("--names", "tensoin"), "the result has no 'tensoin'; did you mean tension"),
        (
            "p.xyz",
            (),
            "'p.xyz' has no known ending\n    expected: nc, csv, vtkhdf, fatigue of a result; fmu of a scene",
        ),
    ],
)
def test_what_is_not_there_is_refused(
    folder: Path, call: Call, name: str, arguments: tuple[str, ...], message: str
) -> None:
    code, made, said = exported(call, folder, name, *arguments)
    assert code == 1 and message in said and not made


@pytest.mark.parametrize("name", ["run.vtkhdf", "run.cycles.csv", "run.csv"])
def test_a_format_of_one_line_says_to_take_one(folder: Path, name: str) -> None:
    kind = {"run.cycles.csv": "fatigue"}.get(name, name.split(".")[-1])
    with hybrid.open(folder / "run.h5") as whole:
        with pytest.raises(
            ResultError, match=rf"{kind} is of one line, .* several: west, east\n.*result.lines\['west'\]"
        ):
            hybrid.export(whole, folder / "whole" / name, format=kind)
        with pytest.raises(ResultError, match=r"'vtkhdf' has no known ending\n.*\n.*such as run.vtkhdf"):
            hybrid.export(whole.lines["west"], "vtkhdf")


def test_the_only_line_is_what_a_format_of_one_line_is_of(folder: Path) -> None:
    scene = SCENE | {"points": {"a": {"position": [-40, 0, 0]}, "b": {"position": [10, 0, 0]}}, "bodies": {}}
    with hybrid.run(scene | {"lines": {"west": SCENE["lines"]["west"] | {"start": "a", "end": "b"}}}) as one:
        made = hybrid.export(one, folder / "one.csv").files[0]
        same = hybrid.export(one.lines["west"], folder / "west.csv").files[0]
    assert made.read_text() == same.read_text()


@pytest.mark.needs("pythonfmu3")
def test_a_scene_of_several_lines_becomes_a_unit(folder: Path, call: Call) -> None:
    """The command makes of a file what `hybrid.export_fmu` makes of it; a wrong ending names the format."""
    (folder / "scene.yaml").write_text(json.dumps(SCENE))
    assert exported(call, folder, "lines.fmu", result="scene.yaml") == (0, {"lines.fmu"}, "")
    (folder / "python").mkdir()
    units = folder / "lines.fmu", hybrid.export_fmu(folder / "scene.yaml", folder / "python" / "lines.fmu")
    names = "resources/scene.yaml", "resources/interface.json"
    one, two = ([zipfile.ZipFile(unit).read(name) for name in names] for unit in units)
    assert one == two
    assert "fmu of a scene" in exported(call, folder, "lines.xyz", result="scene.yaml")[2]


def test_a_result_says_what_it_is_of(folder: Path) -> None:
    result = hybrid.open(folder / "run.h5")
    text = "t = 0 ... 0.2 s; lines west, east; points anchor, fairlead, float; bodies hull; complete: 4 steps>"
    assert repr(result).endswith(text)
    result.close()
    assert repr(result).endswith(text)
    assert repr(hybrid.run(SCENE)).endswith(text), "in memory"
    assert "9 points on s = 0 ... 60 m" in repr(hybrid.open(folder / "run.h5").lines["west"])


# docs/export.md does what it says: its commands and its Python run, in order, beside the result they name.


ROOT = Path(hybrid.__file__).parents[1]
PAGE = ROOT / "docs" / "export.md"


@pytest.mark.long
@pytest.mark.needs("xarray", "h5netcdf", "netCDF4", "pandas", "vtk", "rainflow")
def test_the_page_runs(tmp_path: Path, call: Call, capsys: pytest.CaptureFixture[str]) -> None:
    hybrid.run(hybrid.load_scene(ROOT / "examples" / "02_suspension.yaml"), tmp_path / "02_suspension.h5").close()
    blocks = re.findall(r"^```(\w+)\n(.*?)^```$", PAGE.read_text(encoding="utf-8"), re.DOTALL | re.MULTILINE)
    names: dict[str, object] = {}
    for language, block in blocks:
        if language == "bash":
            for line in block.splitlines():
                words = shlex.split(line, comments=True)
                assert words[0] == "hybrid" or line.startswith("pip install "), line
                if words[0] == "hybrid":
                    said = call(*words[1:])
                    assert not said.code, f"{line}: {said.err}"
        elif language == "python":
            capsys.readouterr()
            exec(compile(block, PAGE.name, "exec"), names)
            printed = capsys.readouterr().out.splitlines()
            assert printed == re.findall(r"print\(.*\)  # (.*)$", block, re.MULTILINE), "as the comments beside it say"
    assert {language for language, _ in blocks} >= {"bash", "python"}
    made = {file.name for file in tmp_path.iterdir()}
    assert {"02_suspension.nc", "02_suspension.csv", "02_suspension.vtkhdf", "02_suspension.cycles.csv"} <= made
