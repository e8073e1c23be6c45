"""Runs laid over each other: numbers, curves, differences, and what of their scenes is different."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure
from reported import reported

import hybrid
from hybrid.errors import ResultError
from hybrid.view.figure import short
from hybrid.view.several_runs import OF_RUNS, _differences, _ranges_along, _table, _verdict

SCENE = """
title: {title}
cable:
  sections: [{{length: 60, mass: 8, diameter: 0.04, axial_stiffness: 1.0e+7}}]
ends:
  start: {{kind: pinned, position: [0, 0, -40]}}
  end: {{kind: pinned, position: [{x}, 0, 0]}}
initial: equilibrium
model: catenary
mesh: {{cells: 16}}
"""
from tests.called import Call
from tests.scenes import cable_scene, clamped_at, pulled, span


def test_differences_are_those_at_the_same_instant_and_place() -> None:
    """Tension of the made-up run with a dip of 500 N at one instant and place: that is the difference."""
    runs = {"a": reported(scene="x: 1\n"), "b": reported(scene="x: 2\n", dip=500.0), "c": reported(outputs=41)}
    panels = {panel.key: panel for panel in _differences(runs)}
    over = {line.label: line for line in panels["tension-over"].items}
    along = {line.label: line for line in panels["tension-along"].items}
    factor = 500.0 / over["b"].y.max()
    assert factor in (pytest.approx(1.0), pytest.approx(1000.0)) and over["b"].x[over["b"].y.argmax()] == 5.0
    assert along["b"].x[along["b"].y.argmax()] == 50.0 and np.count_nonzero(over["b"].y) == 1
    assert over["c"].x.size == 21 and over["c"].y.max() < 1e-9  # twice as many outputs: those in common are the same
    ranges = {panel.key: panel for panel in _ranges_along(runs)}["range-tension"]
    assert [line.label for line in ranges.items if line.label] == ["a", "b", "c"]


def test_every_graph_stands_under_its_own_title(tmp_path: Path) -> None:
    """What plotly draws at a place is the graph of the title, caption and still drawing there."""
    page = hybrid.compare({"a": reported(), "b": reported(dip=500.0)}, tmp_path / "x.html").read_text()
    figures = json.loads(re.search(r'id="index">(.*?)</script>', page, re.S)[1])["figures"]  # type: ignore[index]
    places = re.findall(r'id="plot-([\w-]+)" data-figure="(-?\d+)"', page)
    assert [int(k) for _, k in places] == list(range(len(figures)))
    drawn = {
        key: [figures[int(k)]["layout"][axis]["title"]["text"] for axis in ("xaxis", "yaxis")] for key, k in places
    }
    for key, axes in (
        ("shape", ["x (m)", "z (m)"]), ("grounded_length", ["t (s)", "length on the seabed (m)"]),
        ("range-tension", ["s (m)", "tension (kN)"]), ("range-curvature", ["s (m)", "curvature (1/m)"]),
        ("tension-over", ["t (s)", "difference (N)"]), ("tension-along", ["s (m)", "difference (N)"]),
    ):  # fmt: skip
        assert drawn[key] == axes
    captions = [int(k) for k in re.findall(r"<b>Figure (\d+)\.</b>", page)]
    assert captions == list(range(1, len(figures) + 1))


def test_a_result_without_bending_moments_before_one_that_has_them() -> None:
    """A cable without bending stiffness has none: it ended with a traceback, and curves had each other's colours."""
    runs = {"a": reported(rod=False), "b": reported(dip=12000.0)}
    (line,) = [x for x in {p.key: p for p in _ranges_along(runs)}["range-bending_moment"].items if x.label]
    assert (line.label, line.colour) == ("b", OF_RUNS[1])
    rows = dict(re.findall(r"<tr><td>([^<]*)</td>(.*?)</tr>", _table(runs)))
    cells = re.findall(r"<td[^>]*>(.*?)</td>", rows["largest bending moment"])
    assert cells[0] == "–" and cells[1].endswith(" N m")
    cells = re.findall(r"<td[^>]*>(.*?)</td>", rows["lowest tension"])
    assert cells == ["9 kN", "3 kN (-66.7 %)"]


def test_a_page_of_two_files(tmp_path: Path, call: Call) -> None:
    for name, x in (("near", 35), ("far", 40)):
        (tmp_path / f"{name}.yaml").write_text(SCENE.format(title=name, x=x))
        assert not call("static", str(tmp_path / f"{name}.yaml"), "-o", str(tmp_path / f"{name}.h5"), "-q").code
    files = [str(tmp_path / "near.h5"), str(tmp_path / "far.h5")]
    assert not call("report", *files, "-q").code
    page = (tmp_path / "near_far.html").read_text()
    assert "near, far: compared" in page and "What far has another way than near" in page
    assert "+    position: [40.0, 0.0, 0.0]" in page and "largest tension" in page
    figures = json.loads(re.search(r'id="index">(.*?)</script>', page, re.S)[1])["figures"]  # type: ignore[index]
    assert [trace["name"] for trace in figures[0]["data"]] == ["near", "far"]
    said = call("report", files[0], files[0], "-q")
    assert said.code == 1 and "compared with itself" in said.err  # refused before anything is done


def test_what_cannot_be_compared_is_refused(tmp_path: Path) -> None:
    one = reported()
    for runs in ({"a": one}, {str(k): one for k in range(7)}):
        with pytest.raises(ResultError, match="2 to 6 results"):
            hybrid.compare(runs, tmp_path / "x.html")
    with pytest.raises(ResultError, match="one has none"):
        hybrid.compare({"a": one, "b": reported(outputs=0, status="failed", message="no")}, tmp_path / "x.html")
    assert not (tmp_path / "x.html").exists()


# Pictures of one quantity: what is drawn is what is in the file, on axes that the user composes.


EXAMPLE = Path(__file__).parents[2] / "examples" / "01_hanging_chain.yaml"


def test_histories_profiles_and_single_values() -> None:
    result = reported()
    ax = hybrid.plot_quantity(result, "tension", at=[50.0, 100.0])
    lines = {line.get_label(): line.get_ydata() for line in ax.lines}
    assert lines["s = 50 m"] == pytest.approx(result.tension[:, 20] / 1000.0) and ax.get_ylabel() == "tension (kN)"
    assert [text.get_text() for text in ax.get_legend().get_texts()] == ["s = 50 m", "s = 100 m"]
    (line,) = hybrid.plot_quantity(result, "end_force_end").lines
    assert line.get_ydata() == pytest.approx(result["steps/end_force_end"] / 1000.0)
    profile = hybrid.plot_quantity(result, "tension").lines[0]
    assert profile.get_ydata() == pytest.approx(result.tension[-1] / 1000.0)
    (height,) = hybrid.plot_quantity(result, "z", at=50.0).lines
    assert height.get_ydata() == pytest.approx(result.position[:, 20, 2])
    with pytest.raises(ResultError, match="x, y or z"):
        hybrid.plot_quantity(result, "position", at=50.0)


def test_the_envelope_has_peaks_beyond_outputs(tmp_path: Path) -> None:
    """A chain that swings, saved at its turning points: its largest tension is between them, and in the picture."""
    scene = hybrid.load_scene(EXAMPLE, ["time.duration=0.84", "output.every=0.84"])
    result = hybrid.run(scene, tmp_path / "run.h5", progress=False)
    ax = hybrid.plot_quantity(result, "tension", envelope=True)
    high = next(line for line in ax.lines if line.get_label() == "highest")
    drawn = np.nanmax(high.get_ydata()) * (1000.0 if "kN" in ax.get_ylabel() else 1.0)
    assert drawn == pytest.approx(result["envelope/tension_max"].max())
    assert drawn > 1.01 * result.tension.max() and "every step" in ax.get_title(loc="left")


def test_a_spectrum_is_that_of_the_result() -> None:
    result = reported(outputs=401)
    (line,) = hybrid.plot_quantity(result, "tension", at=100.0, spectrum=True).lines
    found = result.spectrum("tension", at=100.0)
    shown = len(line.get_xdata())
    assert 2 < shown <= len(found.f) and line.get_xdata() == pytest.approx(found.f[:shown])
    unit = line.axes.get_ylabel()
    factor = {"N² s": 1.0, "kN² s": 1e-6}[unit[unit.index("(") + 1 : -1]]
    assert line.get_ydata() == pytest.approx(factor * np.ravel(found.S[:shown]))


def test_they_compose_on_axes_of_the_user() -> None:
    result = reported(outputs=21)
    figure = Figure(layout="constrained")
    axes = figure.subplots(2, 2).ravel()
    drawn = [
        hybrid.plot_shape(result, ax=axes[0]), hybrid.plot_quantity(result, "curvature", ax=axes[1]),
        hybrid.plot_zone_map(result, ax=axes[2]), hybrid.plot_energy(result, work=True, ax=axes[3]),
    ]  # fmt: skip
    assert all(one is given for one, given in zip(drawn, axes, strict=True)) and all(ax.has_data() for ax in axes)
    with pytest.raises(ResultError, match="no energies"):
        hybrid.plot_energy(reported(energy=False))
    with pytest.raises(ResultError, match="all times and places"):
        hybrid.plot_quantity(result, "tension", at=1.0, envelope=True)
    for name, text in (("tensoin", "did you mean tension"), ("end_force_end", "no value along the line")):
        with pytest.raises(ResultError, match=text):
            hybrid.plot_quantity(result, name, envelope=True)


def test_numbers_have_no_exponents() -> None:
    assert short(12345.0, 4) == "12340" and short(0.00012, 2) == "0.00012" and short(3.0, 4) == "3"


def test_the_command(call: Call) -> None:
    for arguments in (["static", str(EXAMPLE), "-o", "a.h5"], ["plot", "a.h5", "--quantity", "tension", "--envelope"]):
        assert not call(*arguments, "--quiet").code
    assert Path("a.tension.png").stat().st_size > 1000
    said = call("plot", "a.h5", "--quantity", "tensoin")
    assert said.code == 1 and "tensoin" in said.err


def test_a_comparison_tells_broken_quantities():
    result = hybrid.static(span(output=pulled("pull", 10.0)))
    assert "broken: pull" in _verdict({"a": result, "b": result})


def test_parts_of_negative_values():
    """A compression that halves was said to change by +-50 %."""
    rod = {"length": 1, "diameter": 0.03, "axial_stiffness": 1e6, "bending_stiffness": 200}
    stands = clamped_at([0, 0, 0], [0, 0, 1])
    found = [hybrid.static(cable_scene(rod | {"mass": x}, stands, "free", model="rod", mesh=8)) for x in (2.0, 1.0)]
    text = _table(dict(zip("ab", found, strict=True)))
    assert "(+50 %)" in text and "+-" not in text
