"""What is exported is what is in the file: read back by xarray, netCDF4, pandas, numpy and VTK itself."""

from __future__ import annotations

import io
import json
import locale
import subprocess
import sys
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

import hybrid
from hybrid.errors import ResultError
from hybrid.exports.api import SUFFIXES, export
from hybrid.store.format import Field, Header
from hybrid.store.reader import Result, open_result
from hybrid.store.writer import Recorder
from tests.called import Call
from tests.scenes import cable_scene, pinned_at

NS, LENGTH, PERIOD, PULL = 21, 10.0, 2.0, 20.0
S = np.linspace(0.0, LENGTH, NS)
SCENE = "title: Schwingt, 5 µm # nicht viel\ncable: {sections: [{length: 10, mass: 1}]}\n"
FORMATS = ("nc", "csv", "vtkhdf", "fatigue")


def bend(t: float) -> np.ndarray:
    """Curvature with a sign, 1/m: to one side and to the other, most at the end."""
    return 0.1 * np.cos(2 * np.pi * t / PERIOD) * S / LENGTH


def made(
    target: Path | io.BytesIO | None = None, *, every: float = 0.1, duration: float = 8.0, step: float = 0.02,
    close: tuple[str, str] = ("complete", "400 steps"), bed: bool = False, steps: bool = True,
) -> Result:  # fmt: skip
    """A cable that bends to and fro in the x-z plane, its end pulled 50 times in 50 s; rod comes after half the time."""
    at = {"s": NS, "xyz": 3, "edge": 2}
    fields = [
        Field(name, unit, f"the {name}", tuple(at[d] for d in dims), dims, frame, name == "touchdown")
        for name, unit, dims, frame in (
            ("position", "m", ("s", "xyz"), "inertial"),
            ("velocity", "m/s", ("s", "xyz"), "inertial"),
            ("tension", "N", ("s",), ""),
            ("curvature", "1/m", ("s",), ""),
            ("theta", "rad", ("s",), ""),
            ("phi", "rad", ("s",), ""),
            ("reaction_end", "N", ("xyz",), "inertial"),
            ("energy/kinetic", "J", (), ""),
            ("errors/total/tension", "N", ("s",), ""),
            *([("touchdown", "m", ("edge",), "")] if bed else []),
        )
    ]
    log = [Field("t", "s", "end of the step"), Field("dt", "s", "length"), Field("end_force_end", "N", "the end_force")]
    memory = io.BytesIO()
    fixed = [(Field("history", "m", "arc lengths to follow", (1,), ("history",)), np.array([2.5]))]
    if bed:
        fixed.append((Field("seabed", "", "plane", (4,), ("plane",)), np.array([0.0, 0.0, 1.0, -50.0])))
    recorder = Recorder(
        target or memory,
        Header(S, fields, log if steps else [], {"title": "Schwingt, 5 µm", "cells": 20}, {"scene": SCENE}, fixed),
        overwrite=True,
    )
    for i in range(round(duration / every) + 1):
        t, x = i * every, np.zeros(NS)
        angle = np.pi / 2 + 0.1 * np.cos(2 * np.pi * t / PERIOD) * S**2 / (2 * LENGTH)
        values = {
            "position": np.stack([S, x, -np.sin(t) * S / 3], axis=1),
            "velocity": np.stack([x, x, -np.cos(t) * S / 3], axis=1),
            "tension": 100.0 + S + np.sin(2 * np.pi * t),
            "curvature": np.abs(bend(t)),
            "theta": angle,
            "phi": x,
            "reaction_end": np.array([t, 0.0, 1.0 / 3.0]),
            "energy/kinetic": np.array(t**2),
            "errors/total/tension": 0.5 + x,
            **({"touchdown": np.array([0.0, 4.0 + np.sin(t)])} if bed else {}),
        }
        if steps and i:
            for k in range(1, round(every / step) + 1):
                end = t - every + k * step
                recorder.log({"t": end, "dt": step, "end_force_end": 100.0 + PULL * np.sin(2 * np.pi * end)})
        middle = 6.0 if t < duration / 2 else 3.0
        recorder.save(t, values, [("catenary", 0.0, middle), ("rod", middle, LENGTH)])
    recorder.event(duration / 2, 3.0, 6.0, "grow", 'bend 1.05 > 1, in "the" middle', criterion="bend", value=1.05)
    recorder.event(0.0, 0.0, LENGTH, "coarse step", "made up")
    recorder.close(*close)
    return open_result(target or memory)


@pytest.fixture
def result(tmp_path: Path) -> Iterator[Result]:
    with made(tmp_path / "run.h5") as opened:
        yield opened


def folder_of(path: Path) -> set[str]:
    return {file.name for file in path.iterdir()}


# ---- xarray ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("engine", ["h5netcdf", "netcdf4"])
@pytest.mark.needs("xarray", "h5netcdf")
def test_a_result_opens_directly_in_xarray(result: Result, tmp_path: Path, engine: Any) -> None:
    import xarray

    with xarray.open_dataset(tmp_path / "run.h5", engine=engine) as opened:
        assert opened.tension.dims == ("t", "s") and opened.position.dims == ("t", "s", "xyz")
        assert (opened.t == result.times).all() and (opened.s == S).all()
        assert (opened.position == result.position).all()
        assert opened.tension.attrs["units"] == "N" and opened.tension.attrs["long_name"] == "the tension"
        assert opened.t.attrs["units"] == "s" and opened.position.attrs["frame"] == "inertial"
        assert opened.scene.item() == SCENE
        assert opened.attrs["title"] == "Schwingt, 5 µm" and opened.attrs["status"] == "complete"
        assert not [dim for dim in opened.sizes if dim.startswith("phony")]
    with xarray.open_dataset(tmp_path / "run.h5", engine=engine, group="steps") as steps:
        assert steps.end_force_end.dims == ("t",) and (steps.t == result.steps["t"]).all()
    groups = xarray.open_groups(tmp_path / "run.h5", engine=engine)
    assert {"/", "/energy", "/errors/total", "/steps", "/zones", "/events"} <= set(groups)
    assert groups["/energy"].kinetic.dims == ("t",) and groups["/errors/total"].tension.dims == ("t", "s")
    log = groups["/events"].sortby("t")  # the file has them as they were written
    assert log.text.astype(str).values.tolist() == [event.text for event in result.events]
    for group in groups.values():
        group.close()


@pytest.mark.parametrize("engine", ["h5netcdf", "netcdf4"])
@pytest.mark.needs("xarray", "h5netcdf")
def test_netcdf_has_everything(result: Result, tmp_path: Path, engine: Any) -> None:
    import xarray

    made = export(result, tmp_path / "run.nc")
    assert made.files == (tmp_path / "run.nc",) and made.notes == ()
    with xarray.open_dataset(tmp_path / "run.nc", engine=engine) as opened:
        opened.load()
        xarray.testing.assert_identical(opened.drop_attrs(), result.to_xarray().drop_attrs())
        for name in result.names:
            there = opened[name.replace("/", "_")]
            assert there.dims == tuple(dim.replace("/", "_") for dim in result.dims(name)), name
            np.testing.assert_array_equal(there.values, result[name], name)
            assert there.attrs["units"] == result.units[name] or there.dtype.kind not in "fi"
        kinds = opened.zone_kind
        meanings = kinds.attrs["flag_meanings"].split()
        assert kinds.dims == ("t", "s") and meanings == ["catenary", "rod"]
        for i, s in ((0, 5.5), (0, 6.0), (80, 2.5), (80, 3.0), (80, 10.0)):
            kind = meanings[int(kinds.sel(s=s)[i])]
            assert kind == [z.kind for z in result.zones[i] if z.s_a <= s][-1]
        assert opened.scene.item() == SCENE
        assert opened.attrs["version_h5py"] == h5py.__version__ and opened.attrs["status"] == "complete"
        assert opened.events_text.values.tolist() == [event.text for event in result.events]
        assert opened.attrs["noted"] == "coarse step", "what calls the answer into question; a zone that grows does not"
        assert opened.tension.sel(t=4.0, s=5.0, method="nearest") == result.tension[40, 10]
    with pytest.raises(ResultError, match="not a result of hybrid"):
        hybrid.open(tmp_path / "run.nc")


@pytest.mark.needs("xarray", "h5netcdf")
def test_a_dataset_can_be_a_part(result: Result) -> None:
    part = result.to_xarray(names=["tension", "energy", "zones", "steps"], times=(4.5, 6.0), at=[3.3, 0.0, 3.3])
    assert part.t.values.tolist() == result.times[45:61].tolist() and part.s.values.tolist() == [0.0, 3.3]
    np.testing.assert_array_equal(part.tension, result.at(s=[0.0, 3.3])["tension"][45:61])
    assert set(part.data_vars) & {"curvature", "events_kind"} == set() and "energy_kinetic" in part
    assert part.zones_kind.values.tolist() == ["catenary", "rod"] and (part.zones_t == 4.0).all()
    assert part.steps_t.min() >= 4.5 - 1e-9 and part.steps_t.max() <= 6.0 + 1e-9 and part.steps_t.size >= 75
    assert part.attrs["left_out"] == "only t = 4.5 to 6 s of 0 to 8 s"
    assert (part.zone_kind.sel(s=3.3) == 1).all()


@pytest.mark.needs("xarray", "h5netcdf")
def test_a_result_in_memory_and_one_output(tmp_path: Path) -> None:
    memory = made(duration=0.0, steps=False)
    assert memory.to_xarray().sizes["t"] == 1
    with pytest.raises(ResultError, match="in memory has no name"):
        export(memory)
    for kind in ("nc", "csv", "vtkhdf"):
        assert export(memory, tmp_path / f"one.{kind}").text.endswith("1 output, t = 0 s")
    with pytest.raises(ResultError, match="1 output has no cycles"):
        export(memory, tmp_path / "one.csv", format="fatigue")
    assert folder_of(tmp_path) == {"one.nc", "one.csv", "one.vtkhdf"}


# ---- CSV ------------------------------------------------------------------------------------------


def test_the_error_of_an_end_force_is_told_with_its_components(tmp_path: Path) -> None:
    """Components of a vector along no line have no field of errors, and the file has the figure of the run."""
    section = {"length": 10.0, "mass": 1.0, "axial_stiffness": 1e6}
    pins = {"start": {"kind": "pinned", "position": [0, 0, 0]}, "end": {"kind": "pinned", "position": [9, 0, 0]}}
    tables = {"cable": {"sections": [section]}, "ends": pins, "initial": "equilibrium", "model": "catenary"}
    told = []
    for errors in (True, False):
        found = hybrid.static(tables | {"output": {"errors": errors}})
        head = export(found, tmp_path / f"{errors}.csv", names=["reaction_end"]).files[0].read_text(encoding="utf-8")
        told.append("not estimated" in head)
        if errors:
            most = float(found.attributes["error_total_end_force"])
            assert f"#   reaction_end: at most {most:.3g} N, estimated" in head
    assert told == [False, True]


def test_csv_keeps_every_digit(result: Result, tmp_path: Path) -> None:
    file = export(result, tmp_path / "run.csv").files[0]
    lines = file.read_text(encoding="utf-8").splitlines()
    head = [line for line in lines if line.startswith("#")]
    assert head[0] == "# hybrid-cable export: histories" and "# title: Schwingt, 5 µm" in head
    assert any(line.startswith("# computed by: ") and f"h5py {h5py.__version__}" in line for line in head)
    assert "# the run noted: coarse step; see its events" in head
    assert "#   tension at s = 2.5 m: at most 0.5 N, estimated" in head
    assert [line[4:] for line in head[-2:]] == SCENE.splitlines()
    names = "t (s),tension (N) at s = 0 m,tension (N) at s = 2.5 m,tension (N) at s = 10 m"
    assert lines[len(head)] == names, "the ends, and the place that the scene follows"
    table = np.genfromtxt(file, delimiter=",", skip_header=len(head) + 1)
    np.testing.assert_array_equal(table[:, 0], result.times)
    np.testing.assert_array_equal(table[:, 1:], result.tension[:, [0, 5, 20]])


@pytest.mark.needs("pandas")
def test_csv_of_places_components_and_tables_opens_in_pandas(result: Result, tmp_path: Path) -> None:
    import pandas

    file = export(
        result, tmp_path / "a.csv", names=["position", "reaction_end", "energy"], at=[3.3], times=(1, 2)
    ).files[0]
    table = pandas.read_csv(file, comment="#")
    assert list(table)[:2] == ["t (s)", "position x (m) at s = 3.3 m"] and list(table)[-1] == "energy/kinetic (J)"
    np.testing.assert_allclose(table["position z (m) at s = 3.3 m"], result.at(s=3.3)["position"][10:21, 2], rtol=1e-15)
    np.testing.assert_allclose(table["reaction_end z (N)"], result.reaction_end[10:21, 2], rtol=1e-15)
    assert "# note: only t = 1 to 2 s of 0 to 8 s" in file.read_text(encoding="utf-8")
    log = pandas.read_csv(export(result, tmp_path / "b.csv", names=["steps"]).files[0], comment="#")
    np.testing.assert_allclose(log["steps/end_force_end (N)"], result.steps["end_force_end"], rtol=1e-15)
    events = pandas.read_csv(export(result, tmp_path / "c.csv", names=["events"]).files[0], comment="#")
    assert events["events/text"].tolist() == [event.text for event in result.events], "commas and quotes are kept"


@pytest.mark.long
def test_csv_knows_no_locale(result: Result, tmp_path: Path) -> None:
    before = locale.setlocale(locale.LC_ALL)
    try:
        for name in ("de_DE.UTF-8", "fr_FR.UTF-8", "de_DE"):
            try:
                locale.setlocale(locale.LC_ALL, name)
                break
            except locale.Error:
                continue
        german = export(result, tmp_path / "a.csv").files[0].read_bytes()
    finally:
        locale.setlocale(locale.LC_ALL, before)
    assert b"\r" not in german and german.endswith(b"\n8.0,100.0,102.5,110.0\n")
    # where no locale is installed this still says that nothing asks for it
    code = f"import hybrid; hybrid.export(hybrid.open({str(tmp_path / 'run.h5')!r}), {str(tmp_path / 'b.csv')!r})"
    root = str(Path(hybrid.__file__).parents[1])
    subprocess.run([sys.executable, "-c", code], env={"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONPATH": root}, check=True)
    assert (tmp_path / "b.csv").read_bytes() == german


# ---- ParaView -------------------------------------------------------------------------------------


@pytest.mark.needs("vtk")
def test_vtk_reads_what_is_in_the_file(tmp_path: Path) -> None:
    from vtkmodules.util.numpy_support import vtk_to_numpy
    from vtkmodules.vtkIOHDF import vtkHDFReader

    result = made(tmp_path / "run.h5", bed=True)
    file = export(result, tmp_path / "run.vtkhdf").files[0]
    reader = vtkHDFReader()
    reader.SetFileName(str(file))
    reader.UpdateInformation()
    assert reader.GetNumberOfSteps() == 81
    assert {reader.GetPointArrayName(k) for k in range(reader.GetNumberOfPointArrays())} == {
        "s", "velocity", "tension", "curvature", "theta", "phi", "errors_total_tension",
    }  # fmt: skip
    for step in (0, 39, 40, 80, 7):  # zones move between 39 and 40; and back in time
        reader.SetStep(step)
        reader.Update()
        cable = reader.GetOutput()
        assert reader.GetTimeValue() == result.times[step]
        np.testing.assert_array_equal(vtk_to_numpy(cable.GetPoints().GetData()), result.position[step])
        for name in ("velocity", "tension", "curvature"):
            np.testing.assert_array_equal(vtk_to_numpy(cable.GetPointData().GetArray(name)), result[name][step], name)
        np.testing.assert_array_equal(vtk_to_numpy(cable.GetPointData().GetArray("s")), S)
        joint = 12 if step < 40 else 6  # the point at s = 6 or 3 m
        assert cable.GetNumberOfCells() == cable.GetNumberOfLines() == 2
        lines = [[c.GetPointId(k) for k in range(c.GetNumberOfPoints())] for c in map(cable.GetCell, (0, 1))]
        assert lines == [list(range(joint + 1)), list(range(joint, NS))]
        assert vtk_to_numpy(cable.GetCellData().GetArray("zone_kind")).tolist() == [0, 1]
        facts = {name: vtk_to_numpy(cable.GetFieldData().GetArray(name)) for name in ("energy_kinetic", "reaction_end")}
        assert facts["energy_kinetic"].tolist() == [result.energy.kinetic[step]]
        np.testing.assert_array_equal(facts["reaction_end"].ravel(), result.reaction_end[step])
        assert vtk_to_numpy(cable.GetFieldData().GetArray("seabed")).ravel().tolist() == [0, 0, 1, -50]
    with h5py.File(file) as opened:
        assert opened["scene"][()].decode() == SCENE and opened.attrs["title"] == "Schwingt, 5 µm"
        assert opened["VTKHDF/PointData/tension"].attrs["units"] == "N"
        assert opened["VTKHDF/CellData/zone_kind"].attrs["meanings"].tolist() == ["catenary", "rod"]


ANGLE = Path(__file__).parents[1] / "data" / "angle.obj"


@pytest.mark.needs("vtk")
def test_vtk_has_obstacles_where_they_are(tmp_path: Path) -> None:
    from vtkmodules.util.numpy_support import vtk_to_numpy
    from vtkmodules.vtkIOHDF import vtkHDFReader

    section = {"length": 2.01, "mass": 1.0, "diameter": 0.02, "axial_stiffness": 1e5}
    obstacles = {
        "ball": {"kind": "sphere", "at": [1, 1, 0], "radius": 0.2, "motion": {"velocity": [0, 0, 1.0], "ramp": 0.06}},
        "pipe": {"kind": "cylinder", "at": [0, 0, -2], "axis": [0, 1, 0], "radius": 0.1},
        "floor": {"kind": "plane", "at": [0, 0, -3], "normal": [0, 0, 1]},
        "angle": {"kind": "mesh", "file": str(ANGLE), "scale": 0.1, "at": [1, -3, 0]},
    }
    result = hybrid.run(cable_scene(
        section, pinned_at(0, 0, 0), pinned_at(2, 0, 0), obstacles=obstacles, model="catenary", mesh=10,
        time=(0.2, 0.02), output=(0.1, 11)
    ))  # fmt: skip
    reader = vtkHDFReader()
    reader.SetFileName(str(export(result, tmp_path / "run.vtkhdf", times=(0.1, None)).files[0]))
    reader.UpdateInformation()
    facets = len(result["obstacles/angle/triangles"])
    for step in (1, 0):
        reader.SetStep(step)
        reader.Update()
        seen = reader.GetOutput()
        points = vtk_to_numpy(seen.GetPoints().GetData())
        np.testing.assert_array_equal(points[:11], result.position[step + 1])
        tension = vtk_to_numpy(seen.GetPointData().GetArray("tension"))
        np.testing.assert_array_equal(tension[:11], result.tension[step + 1])
        assert np.isnan(tension[11:]).all() and seen.GetNumberOfLines() == 1
        kinds = vtk_to_numpy(seen.GetCellData().GetArray("zone_kind"))
        assert kinds[0] == 0 and set(kinds[1:].tolist()) == {1} and kinds.size == seen.GetNumberOfCells()
        corners = vtk_to_numpy(seen.GetPolys().GetConnectivityArray()).reshape(-1, 3)
        assert len(corners) == seen.GetNumberOfPolys() and corners.min() == 11
        middle = result["obstacles/ball/position"][step + 1]
        assert middle[2] == pytest.approx(0.1 * (step + 1), abs=0.05)
        of_ball = np.linalg.norm(points - middle, axis=1) < 0.2001
        a, b, c = (points[corners[of_ball[corners].all(axis=1)]] - points[of_ball].mean(axis=0)).transpose(1, 0, 2)
        volume = np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6.0  # positive: seen from outside they turn left
        assert abs(volume) == pytest.approx(4.0 / 3.0 * np.pi * 0.2**3, rel=0.05)
        of_pipe = np.abs(np.hypot(points[:, 0], points[:, 2] + 2.0) - 0.1) < 1e-9
        assert points[of_pipe, 1].min() < -0.3 and points[of_pipe, 1].max() > 0.3
        mesh = result["obstacles/angle/points"] + [1, -3, 0]
        assert (np.abs(points[:, None] - mesh[None]).max(axis=2).min(axis=0) < 1e-12).all()
        beside = (points[corners][:, :, 1] < -2.1) & (points[corners][:, :, 2] > -1.0)
        assert beside.all(axis=1).sum() == facets


@pytest.mark.needs("vtk")
def test_vtk_reads_a_part_and_a_single_output(tmp_path: Path) -> None:
    from vtkmodules.util.numpy_support import vtk_to_numpy
    from vtkmodules.vtkIOHDF import vtkHDFReader

    result = made(tmp_path / "run.h5")
    for more, steps, points in (
        ({"times": (2.0, 2.0)}, 1, NS),
        ({"at": [0, 3.3, 10], "names": ["tension"], "times": (2.0, 3.0)}, 11, 3),
    ):
        reader = vtkHDFReader()
        reader.SetFileName(str(export(result, tmp_path / "run.vtkhdf", **more).files[0]))  # type: ignore[arg-type]
        reader.UpdateInformation()
        assert reader.GetNumberOfSteps() == steps
        reader.SetStep(steps - 1)
        reader.Update()
        said = vtk_to_numpy(reader.GetOutput().GetFieldData().GetArray("t"))
        assert said.tolist() == [result.times[20 if steps == 1 else 30]]
        if steps > 1:  # the reader takes a file with one step for one without time
            assert reader.GetTimeValue() == result.times[30]
        assert reader.GetOutput().GetNumberOfPoints() == points
        if steps > 1:
            there = vtk_to_numpy(reader.GetOutput().GetPointData().GetArray("tension"))
            np.testing.assert_array_equal(there, result.at(s=[0, 3.3, 10])["tension"][30])
    with pytest.raises(ResultError, match="two points"):
        export(result, tmp_path / "x.vtkhdf", at=[1.0])


# ---- fatigue --------------------------------------------------------------------------------------


def table_of(file: Path) -> Any:
    import pandas

    return pandas.read_csv(file, comment="#")


@pytest.mark.needs("rainflow", "pandas")
def test_cycles_of_a_pull_and_of_a_bend_to_both_sides(result: Result, tmp_path: Path) -> None:
    made = export(result, format="fatigue")
    assert [file.name for file in made.files] == ["run.cycles.csv", "run.histories.csv"] and made.notes == ()
    cycles, histories = (table_of(file) for file in made.files)
    at_end = cycles[(cycles["s (m)"] == LENGTH)]
    end_force = at_end[at_end["quantity"] == "end_force"]
    full = end_force[end_force["range"] > 0.99 * 2 * PULL]
    # a sine has as many cycles as periods: seven between eight maxima, and halves that add up to one more at most
    assert 7.0 <= full["count"].sum() <= 8.0 and (full["unit"] == "N").all()
    # steps of 0.02 s meet a maximum and a minimum of a period of 1 s to within 0.01 s
    assert full["range"].to_numpy() == pytest.approx(2 * PULL, rel=1 - np.cos(2 * np.pi * 0.01))
    assert full["mean"].to_numpy() == pytest.approx(100.0, abs=0.1)
    curvature = at_end[at_end["quantity"] == "curvature"]
    # 0.1 1/m to one side and 0.1 1/m to the other: a range of 0.2, where the magnitude would give 0.1
    assert curvature["range"].max() == pytest.approx(0.2, rel=1e-6)
    assert curvature["count"].sum() == pytest.approx(4.0)
    assert set(cycles["place"]) == {"start", "end and largest range of curvature"}
    base = histories["t (s)"].to_numpy()
    assert np.diff(base) == pytest.approx(0.02, rel=1e-9), "the outputs are every 0.1 s, the steps every 0.02 s"
    np.testing.assert_allclose(histories["end_force (N) at s = 10 m"], 100 + PULL * np.sin(2 * np.pi * base), atol=1e-9)
    for file in made.files:
        head = file.read_text(encoding="utf-8")
        assert "# not done: stress" in head and "#   title: Schwingt, 5 µm" in head
    assert "curvature at s = 10 m (end and largest range of curvature): about the axis" in head
    assert "rod 100 % of the outputs" in head


@pytest.mark.needs("rainflow")
def test_counts_are_those_of_a_series_counted_by_hand(tmp_path: Path) -> None:
    """The series of the example in ASTM E1049, section 5.4.4, as the end force: ranges and counts as published there."""
    from hybrid.exports.api import _cycles

    counts: dict[float, float] = {}
    for size, _, number, _, _ in _cycles(np.array([-2.0, 1, -3, 5, -1, 3, -4, 4, -2])):
        counts[size] = counts.get(size, 0.0) + number
    assert counts == {3: 0.5, 4: 1.5, 6: 0.5, 8: 1.0, 9: 0.5}


@pytest.mark.needs("rainflow", "pandas")
def test_round_off_is_no_cycle(tmp_path: Path) -> None:
    """The straight end of the cable has a curvature of round-off: no cycle there, and the head says how many."""
    made(tmp_path / "run.h5").close()
    with h5py.File(tmp_path / "run.h5", "r+") as file:
        file["curvature"][:, 0] = 1e-12 * np.arange(81) % 3e-12
        file["theta"][:, :2] = np.pi / 2 + np.array([0.0, 1e-10])
    files = export(open_result(tmp_path / "run.h5"), format="fatigue").files
    cycles = table_of(files[0])
    assert not ((cycles["quantity"] == "curvature") & (cycles["s (m)"] == 0.0)).any()
    (line,) = [line for line in files[0].read_text(encoding="utf-8").splitlines() if line.startswith("# left out: ")]
    assert int(line.split()[3]) > 10


@pytest.mark.needs("rainflow", "pandas")
def test_places_of_a_touchdown_and_those_asked_for(tmp_path: Path) -> None:
    result = made(tmp_path / "run.h5", bed=True)
    cycles = table_of(export(result, format="fatigue", at=[7.25]).files[0])
    places = {s: place for place, s in zip(cycles["place"], cycles["s (m)"], strict=True)}
    # the edge goes from 3 to 5 m; in its range and half a metre around the curvature ranges most at the upper end
    assert places == {0.0: "start", 5.0: "touchdown", 7.25: "asked for", 10.0: "end and largest range of curvature"}
    asked = cycles[(cycles["s (m)"] == 7.25) & (cycles["quantity"] == "curvature")]
    assert asked["range"].max() == pytest.approx(0.2 * 0.725, rel=1e-6)
    tension = cycles[(cycles["s (m)"] == 5.0) & (cycles["quantity"] == "tension")]
    assert tension["range"].max() == pytest.approx(np.ptp(result.tension[:, 10]), rel=1e-12)


@pytest.mark.needs("rainflow")
def test_outputs_too_far_apart_are_said_and_how_much_they_lose(tmp_path: Path) -> None:
    fine = export(made(tmp_path / "fine.h5", every=0.1), format="fatigue")
    assert fine.notes == ()
    (note,) = export(made(tmp_path / "coarse.h5", every=0.4), format="fatigue").notes
    assert note.startswith("outputs every 0.4 s are far apart for cycles of 1 s in the end force at s = 10 m")
    assert note.endswith("try output: {every: 0.1}")
    # five samples of a sine in two periods: the extremes among them are at 0.1 and 0.3 of a period from a zero
    seen, there = (np.ptp(np.sin(2 * np.pi * np.arange(0, 2, every))) for every in (0.4, 0.02))
    assert f"its largest range would be {100 * (1 - seen / there):.2g} % smaller" in note
    coarse_steps = export(made(tmp_path / "steps.h5", every=0.2, step=0.2), format="fatigue")
    assert any(note.startswith("steps of 0.2 s are long for cycles of") for note in coarse_steps.notes)


# ---- what all share -------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", FORMATS)
@pytest.mark.needs("xarray", "h5netcdf", "rainflow")
def test_an_interrupted_result_says_so_everywhere(tmp_path: Path, kind: str, call: Call) -> None:
    made(tmp_path / "run.h5", close=("interrupted", "stopped from outside")).close()
    file = tmp_path / f"run{SUFFIXES[kind]}"
    said = call("export", str(tmp_path / "run.h5"), "--format", kind)
    assert not said.code and "; interrupted: stopped from outside -> " in said.out
    text = "the run is not complete (interrupted: stopped from outside): t ends at 8 s"
    assert f"note: {text}" in " ".join(said.err.split())
    if kind in ("nc", "vtkhdf"):
        with h5py.File(file) as opened:
            assert opened.attrs["status"] == "interrupted" and opened.attrs["left_out"] == text
    else:
        assert f"# note: {text}\n" in file.read_text(encoding="utf-8")


def test_the_command_in_json_and_quietly(result: Result, tmp_path: Path, call: Call) -> None:
    call = partial(call, "export", str(tmp_path / "run.h5"))
    code, out, err = call("--format", "csv", "--times", "1:", "--at", "0,5", "--json")
    note, done = map(json.loads, out.splitlines())
    assert (code, err) == (0, "") and note["text"] == "only t = 1 to 8 s of 0 to 8 s"
    assert done["files"] == [str(tmp_path / "run.csv")] and done["status"] == "complete"
    assert call("-q", "-o", str(tmp_path / "b.csv")) == (0, "", "")
    code, out, err = call("-o", str(tmp_path / "b.csv"), "--no-overwrite")
    assert code == 1 and "exists" in err
    assert call("--names", "tensoin")[2] == "the result has no 'tensoin'; did you mean tension?\n"
    assert "no window of time" in call("--times", "3")[2]
    code, out, err = call("--format", "csv", "--names", "tension")
    assert out.endswith(f"81 rows, 4 columns; 81 outputs, t = 0 to 8 s -> {tmp_path / 'run.csv'}\n")


@pytest.mark.parametrize(
    ("more", "message"),
    [
        ({"path": "run.h5"}, "the name 'run.h5' has no known ending\n    expected: nc, csv, vtkhdf, fatigue"),
        ({"path": "x.nc", "format": "csv"}, "the format is csv, but the name ends with .nc"),
        ({"path": "x.nc", "format": "fatigue"}, "the format is fatigue, but the name ends with .nc"),
        ({"format": "xlsx"}, "there is no format 'xlsx'"),
        ({"names": ["tensoin"]}, "no 'tensoin'; did you mean tension"),
        ({"names": []}, "no field was chosen"),
        ({"at": [11.0]}, "s = 11 m is outside the result\n    expected: 0 <= s <= 10 m"),
        ({"at": [float("nan")]}, "s = nan m is outside"),
        ({"at": []}, "no list of arc lengths"),
        ({"times": (9.0, None)}, "no output lies between t = 9 and inf s"),
        ({"times": (3.0, 2.0)}, "no output lies between"),
        (
            {"path": "x.csv", "names": ["tension", "steps"]},
            "one clock in common\n    given:    steps/t: .*; t: tension",
        ),
        ({"path": "x.csv", "names": ["s"]}, "one clock in common"),
        ({"format": "fatigue", "names": ["tension"]}, "other names cannot be chosen"),
        ({"format": "fatigue", "times": (0.0, 0.1)}, "2 outputs have no cycles"),
    ],
)
@pytest.mark.needs("xarray", "h5netcdf", "rainflow")
def test_nonsense_is_refused_and_nothing_is_left(
    result: Result, tmp_path: Path, more: dict[str, Any], message: str
) -> None:
    before = folder_of(tmp_path)
    if "path" in more:
        more = more | {"path": tmp_path / more["path"]}
    with pytest.raises(ResultError, match=message):
        export(result, **more)
    assert folder_of(tmp_path) == before


@pytest.mark.long
@pytest.mark.parametrize("kind", FORMATS)
def test_only_older_exports_are_replaced(result: Result, tmp_path: Path, kind: str) -> None:
    file = export(result, format=kind).files[0]
    before = file.read_bytes()
    with pytest.raises(ResultError, match="exists\n    try:      another name, or leave --no-overwrite out"):
        export(result, format=kind, overwrite=False)
    again = export(result, format=kind, times=(0, 4)).files
    assert file.read_bytes() != before
    for other in again:
        for content in (b"my thesis", (tmp_path / "run.h5").read_bytes()):
            other.write_bytes(content)
            with pytest.raises(ResultError, match="exists and was not exported by hybrid"):
                export(result, format=kind)
            assert other.read_bytes() == content
        other.write_bytes(b"")  # nothing to lose, as `mktemp` makes it
    export(result, format=kind)
    assert folder_of(tmp_path) == {"run.h5", *(other.name for other in again)}


@pytest.mark.needs("xarray", "h5netcdf", "rainflow")
def test_places_where_nothing_can_be_written(result: Result, tmp_path: Path) -> None:
    with pytest.raises(ResultError, match=r"there is no folder .*\n    try:      mkdir -p"):
        export(result, tmp_path / "no" / "run.nc")
    (tmp_path / "a.nc").mkdir()
    with pytest.raises(ResultError, match="is a folder"):
        export(result, tmp_path / "a.nc")
    for kind in FORMATS:
        with pytest.raises(ResultError, match="cannot be written\n    detail: "):
            export(result, f"/proc/run{SUFFIXES[kind]}", format=kind)


@pytest.mark.long
@pytest.mark.skipif(sys.platform == "win32", reason="no limit of file sizes there")
@pytest.mark.parametrize("kind", FORMATS)
@pytest.mark.needs("xarray", "h5netcdf", "rainflow")
def test_a_full_disk_leaves_what_was_there(tmp_path: Path, kind: str) -> None:
    """A limit of the size of a file stands in for a full disk: the write fails in the same call."""
    made(tmp_path / "run.h5").close()
    code = f"""
import resource, signal, hybrid
from hybrid.errors import ResultError
result = hybrid.open({str(tmp_path / "run.h5")!r})
files = hybrid.export(result, format={kind!r}).files
before = [file.read_bytes() for file in files]
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, (2000, 2000))
try:
    hybrid.export(result, format={kind!r})
except ResultError as error:
    assert "cannot be written" in str(error) and "free space" in str(error), error
    assert [file.read_bytes() for file in files] == before
    print("refused")
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=tmp_path)
    assert done.returncode == 0 and done.stdout == "refused\n" and done.stderr == "", done.stderr
    assert not [name for name in folder_of(tmp_path) if name.endswith(".new")]


@pytest.mark.parametrize(("kind", "package"), [("nc", "xarray"), ("nc", "h5netcdf"), ("fatigue", "rainflow")])
@pytest.mark.needs("xarray", "h5netcdf", "rainflow")
def test_a_missing_package_is_named_with_its_command(
    result: Result, tmp_path: Path, kind: str, package: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    for module in [name for name in sys.modules if name.split(".")[0] == package]:
        monkeypatch.delitem(sys.modules, module)
    monkeypatch.setitem(sys.modules, package, None)  # as if it were not installed
    with pytest.raises(ResultError, match=rf"'{package}'.*\n.*\n    try:      pip install \"hybrid-cable\[export\]\""):
        export(result, format=kind)
    assert folder_of(tmp_path) == {"run.h5"}


def test_a_result_without_outputs_and_a_closed_one(tmp_path: Path) -> None:
    memory = io.BytesIO()
    Recorder(memory, Header(S, [], [], {"title": ""})).close("failed", "why")
    for kind in FORMATS:
        with pytest.raises(ResultError, match=r"holds no output yet.*failed: why"):
            export(open_result(memory), tmp_path / f"x{SUFFIXES[kind]}", format=kind)
    closed = made(tmp_path / "run.h5")
    closed.close()
    with pytest.raises(ResultError, match="closed"):
        export(closed, tmp_path / "x.csv")
    assert folder_of(tmp_path) == {"run.h5"}


@pytest.mark.long
@pytest.mark.needs("xarray", "h5netcdf")
def test_a_killed_run_is_exported_as_far_as_it_came(tmp_path: Path) -> None:
    """xarray cannot open such a file, which has no end; `hybrid` can."""
    import xarray

    code = f"""
import os, sys
sys.path.insert(0, {str(Path(__file__).parent)!r})
from test_result_export import SCENE, S, Field, Header, Recorder, np
step = [Field("t", "s", "end of the step")]
fields = [Field("tension", "N", "d", (21,), ("s",))]
recorder = Recorder("run.h5", Header(S, fields, step, {{"title": ""}}, {{"scene": SCENE}}))
for i in range(5):
    recorder.save(float(i), {{"tension": i + S}}, [("rod", 0.0, 10.0)])
recorder.flush()
os._exit(9)
"""
    root = {"PYTHONPATH": str(Path(hybrid.__file__).parents[1])}
    assert subprocess.run([sys.executable, "-c", code], cwd=tmp_path, env=root).returncode == 9
    with pytest.raises(OSError, match="already open for write"):
        xarray.open_dataset(tmp_path / "run.h5", engine="h5netcdf")
    with open_result(tmp_path / "run.h5") as result:
        made = export(result, format="nc")
    note = "the run is not complete (interrupted or still running): t ends at 4 s"
    assert made.notes == (note,)
    with xarray.open_dataset(made.files[0]) as opened:
        assert opened.attrs["left_out"] == note and opened.tension[-1, -1] == 14.0


def test_what_reads_exports_is_loaded_only_then(tmp_path: Path) -> None:
    made(tmp_path / "run.h5").close()
    code = (
        "import sys, hybrid; hybrid.export(hybrid.open('run.h5'), 'run.csv'); hybrid.export(hybrid.open('run.h5'), "
        "'run.vtkhdf'); print({'xarray', 'vtk', 'rainflow', 'numba', 'matplotlib', 'pandas'} & set(sys.modules))"
    )
    root = {"PYTHONPATH": str(Path(hybrid.__file__).parents[1])}
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, cwd=tmp_path, env=root, check=True
    )
    assert done.stdout == "set()\n"
