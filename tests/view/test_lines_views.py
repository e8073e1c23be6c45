"""Pages, films, reports and exports of several lines: every line, point and body is there, with its own numbers."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from PIL import Image
from typer.testing import CliRunner

import hybrid
import hybrid.cli.commands  # registers them
from hybrid.cli.app import app
from hybrid.cli.console import Console
from hybrid.cli.plan_tables import plan_rows
from hybrid.cli.tables import show_equilibrium, show_motion
from hybrid.errors import ResultError
from hybrid.scene.read import as_scene
from hybrid.scene.root import in_full
from hybrid.store.records import Zone
from hybrid.view.figure import Line, Marks, Text
from hybrid.view.lines import AllLines, arms_of, clearest_view, motions, page, points_of, rotations, views_of_lines
from hybrid.view.matplotlib_backend import animate
from hybrid.view.quantities import plot_energy, plot_quantity, plot_shape
from hybrid.view.report import _extreme_text, html
from tests.scenes import cable_scene, clamped_at, each_line, network_scene, pinned_at
from tests.simulation.bits import Stopping

SECTION = {"length": 120, "mass": 20, "diameter": 0.1, "axial_stiffness": 1e8}
ENDS = {"start": 0, "end": 11.5}
PLACES = {"east": (100, 0), "north": (-50, 87), "south": (-50, -87)}


def spar() -> dict[str, Any]:
    """A body on three lines, pulled and let go, over a bed; the tension of one line breaks its limit."""
    lines = {n: {"start": n, "end": f"to_{n}", "mesh": {"cells": 12}, "sections": [SECTION]} for n in PLACES}
    lines["east"]["sections"] = [SECTION | {"max_tension": 1000}]
    return network_scene(
        {n: {"position": [x, y, -60]} for n, (x, y) in PLACES.items()} | {
            f"to_{n}": {"body": "spar", "place": [x / 50, y / 50, -4]} for n, (x, y) in PLACES.items()},
        lines, title="<three> lines", fluid={"density": 1025, "surface": 5.0}, seabed={"z": -62, "stiffness": 1e4},
        bodies={"spar": {"initial_guess": [0, 0, 0], "mass": 1e5, "centre": [0, 0, -3], "inertia": [4e6, 4e6, 2e6],
                         "hydrostatics": {"heave": 8e4, "roll": 4e6, "pitch": 4e6},
                         "force": {"value": [4e4, 0, 0], "until": 1}}},
        time=(4.0, 0.05), output=(0.2, 13)
    )  # fmt: skip


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    target = tmp_path_factory.mktemp("views") / "spar.h5"
    hybrid.run(spar(), target).close()
    return target


@pytest.fixture(scope="module")
def result(path: Path) -> hybrid.Result:
    return hybrid.open(path)


def test_a_page_has_every_line_where_it_is(result: hybrid.Result) -> None:
    drawn = page(result)
    shape = drawn.panels["S"]  # from above
    lines = {item.label: item for item in shape.items if isinstance(item, Line)}
    for name, line in result.lines.items():
        x, y = (
            line.position[-1] @ axis
            for axis in (np.eye(3)["xy".index(shape.x.name)], np.eye(3)["xy".index(shape.y.name)])
        )
        assert np.array_equal(lines[name].x, x) and np.array_equal(lines[name].y, y)
    points = next(item for item in shape.items if isinstance(item, Marks) and item.label == "points")
    assert len(points.x) == 6
    assert [item.label for item in drawn.panels["p"].items if isinstance(item, Line)] == list(PLACES)
    moved = drawn.panels["m"].items
    assert [x.label for x in moved if isinstance(x, Line)] == ["body spar"]
    largest = {x.label: x.y for x in drawn.panels["h"].items if isinstance(x, Line)}
    factor = largest["east"].max() / result.lines["east"].tension.max()
    assert factor in (1.0, 1e-3)
    assert "tension above limit" in drawn.note and "line east" in drawn.note


@pytest.mark.parametrize("part", [1e-10, 3e-6])
def test_motion_below_what_is_resolved_is_drawn_flat(result: hybrid.Result, part: float) -> None:
    """Round-off of a body at rest does not fill a panel; a motion of 3e-6 of the longest line does."""
    every = AllLines(result)
    way = 120.0 * part * np.sin(np.arange(every.outputs))[:, None] * [1.0, 0.0, 0.0]
    still = dict.fromkeys((f"points/{n}/position" for n in points_of(result)), np.zeros((every.outputs, 3)))
    seen = Moved(result, still | {"bodies/spar/position": way})
    ((_, panel),) = motions(seen, every)  # type: ignore[arg-type]
    (low, high), drawn = panel.limits()[1], next(x.y for x in panel.items if isinstance(x, Line))
    assert ("at rest, to 0.12 mm" in panel.title) == (part < 1e-6)
    assert (np.ptp(drawn) < 1e-3 * (high - low)) == (part < 1e-6)


def test_what_moves_by_round_off_has_no_curve_beside_what_moves(result: hybrid.Result) -> None:
    every = AllLines(result)
    wave = np.sin(np.arange(every.outputs))[:, None] * [1.0, 0.0, 0.0]
    names = [f"points/{n}/position" for n in points_of(result)]
    assert len(names) > 1
    shaken = {name: 1e-9 * wave for name in names} | {"bodies/spar/position": 0.5 * wave}
    ((_, panel),) = motions(Moved(result, shaken), every)  # type: ignore[arg-type]
    assert [x.label for x in panel.items if isinstance(x, Line) and x.label] == ["body spar"]


def test_a_body_that_only_yaws_is_shown_to_yaw(result: hybrid.Result) -> None:
    """Its panel comes before a motion of millimetres, and its name stands above the curve."""
    every = AllLines(result)
    still = {
        f"points/{n}/position": np.tile(result[f"points/{n}/position"][0], (every.outputs, 1))
        for n in points_of(result)
    }
    wave = np.sin(np.arange(every.outputs))[:, None]
    seen: Any = Moved(result, still | {
        "bodies/spar/position": 3e-3 * wave * [0.0, 0.0, 1.0], "bodies/spar/rotation": [0, 0, 180] + 10.0 * wave * [0, 0, 1],
    })  # fmt: skip
    ((_, panel),) = rotations(seen, every)
    assert panel.key == "rotation-yaw" and page(seen).panels["m"].title == panel.title
    drawn = next(x.y for x in panel.items if isinstance(x, Line))
    assert np.ptp(drawn) > 19.0 and panel.limits()[1][1] > drawn.max() + 0.2 * np.ptp(drawn)


class Moved:
    """A result with other motions."""

    def __init__(self, result: hybrid.Result, other: dict[str, Any]) -> None:
        self._result, self._other = result, other

    def __getattr__(self, name: str) -> Any:
        return getattr(self._result, name)

    def __contains__(self, name: str) -> bool:
        return name in self._other or name in self._result

    def __iter__(self) -> Any:
        return iter(self._result)

    def __getitem__(self, name: str) -> Any:
        return self._other[name] if name in self._other else self._result[name]


class Extremes(dict[str, Any]):
    """A line as the table of extremes sees it: of one kind of zone, with a largest moment and curvature."""

    def __init__(self, kind: str, moment: float) -> None:
        names = {"envelope/s": [0.0, 1.0], "envelope/curvature_max": [0.1, 0.2], "envelope/curvature_t_max": [0.0, 0.0],
                 "envelope/bending_moment_max": [0.0, moment], "envelope/bending_moment_t_max": [0.0, 0.0]}  # fmt: skip
        super().__init__({name: np.array(x) for name, x in names.items()})
        self.zones = [[Zone(kind, 0.0, 1.0)]]


def test_a_line_that_was_catenary_throughout_has_no_moment() -> None:
    """0 N m beside a curvature would say that it does not bend; a rod without moment, or with one, shows its number."""
    ask = "bending_moment", "max", "N m"
    assert _extreme_text(Extremes("catenary", 0.0), *ask) == "–"  # type: ignore[arg-type]
    assert _extreme_text(Extremes("rod", 0.0), *ask).startswith("0 N m\ns")  # type: ignore[arg-type]
    assert _extreme_text(Extremes("catenary", 2.0), *ask).startswith("2 N m\ns")  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("angles", "across"),
    [
        ((0.0, 120.0, 240.0), "x"), ((90.0, 210.0, 330.0), "y"),
        ((0.0, 90.0, 180.0, 270.0), "horizontal, 45° from x"),
    ],
)  # fmt: skip
def test_the_overview_shows_every_line_in_both_planes(angles: tuple[float, ...], across: str) -> None:
    """Three legs, one along x: its length is seen, though the others reach farther along y; four legs along the axes."""
    legs = [np.array([[0.0, 0.0, 0.0], [np.cos(a), np.sin(a), -0.6]]) for a in np.radians(angles)]
    every = AllLines.__new__(AllLines)
    every.lines = {str(k): SimpleNamespace(position=leg[None]) for k, leg in enumerate(legs)}  # type: ignore[misc]
    every.position = np.concatenate(legs)[None]
    every._around = {}  # type: ignore[assignment]
    upright, plan = views_of_lines(every)
    assert clearest_view(every).across_label == upright.across_label == across
    assert (plan.across_label, plan.up_label) == ("x", "y")
    for leg in legs:
        seen = np.ptp(leg @ upright.across)
        assert seen > 0.25 * np.hypot(*np.ptp(leg, axis=0)[:2])


def test_arms_lead_from_a_body_to_its_fairleads(result: hybrid.Result) -> None:
    arms = arms_of(result, "spar", [0, -1])
    assert arms.shape == (2, 7, 3)
    lengths = np.linalg.norm(np.diff(arms, axis=1), axis=2)
    assert np.allclose(lengths, np.hypot(np.hypot(*np.array(PLACES["north"]) / 50), 4), rtol=0.01)


def test_a_report_has_all_lines_points_and_bodies(result: hybrid.Result) -> None:
    text = html(result)
    assert "&lt;three&gt; lines" in text and "<three>" not in text.split("<script")[0]
    index = json.loads(re.search(r'id="index">(.*?)</script>', text, re.S)[1])  # type: ignore[index]
    scene = index["scene"]
    assert [x[0] for x in scene["colours"][0]["legend"]] == [*PLACES, "bodies"]
    assert scene["x"]["shape"] == [21, 3 * 14 + 7] and scene["s"]["shape"] == [3 * 14 + 7]  # gaps between, none behind
    assert [mark["name"] for mark in scene["marks"]] == ["body spar", "points", ""]
    for name, line in result.lines.items():
        most = line.envelope["tension_max"].max()
        row = re.search(rf"<td>{name}</td><td class=\"number\">120 m</td><td class=\"number\">([\d.]+) kN", text)
        assert row is not None and abs(float(row[1]) * 1e3 - most) < 1e-3 * most
        assert f"Line {name}: " in text
    force = np.linalg.norm(result["points/east/force"], axis=1).max()
    assert f"{force / 1e3:.4g} kN" in text.split("<h3>Points</h3>")[1].split("<h3>Bodies</h3>")[0]
    first = text.split("Look at this first")[1].split("</ul>")[0]
    assert "Line east: largest tension" in first and "north" not in first
    assert "None, beside limits that are broken." in text and "None were given." not in text


@pytest.fixture(scope="module", params=[as_scene, in_full])
def alone(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> hybrid.Result:
    """A line without a name, and the same with one."""
    ends = {name: pinned_at(x, 0, 0) for name, x in ENDS.items()}
    section = SECTION | {"length": 12, "bending_stiffness": 5.0, "diameter": 0.05}
    asked = cable_scene(section, **ends, model="adaptive", mesh=40, time=(0.4, 0.1), output=(0.1, 11))
    return hybrid.run(request.param(as_scene(asked)), tmp_path_factory.mktemp("alone") / "run.h5")


def test_a_line_alone_is_drawn_in_all_detail(alone: hybrid.Result) -> None:
    """With a name it was refused where zones, energies, a history or a quantity are drawn, as of several lines."""
    titles = [x.get_title(loc="left") for x in hybrid.plot(alone, history=[3.0]).axes]
    assert {"tension over time", "curvature at t = 0.4 s"} <= set(titles)
    assert len(hybrid.plot_zones(alone).axes) > 1
    assert plot_energy(alone).lines and plot_shape(alone).lines and plot_quantity(alone, "curvature").lines


def test_statistics_are_those_of_the_only_line(alone: hybrid.Result) -> None:
    """With a name it was to be named in the command, too."""
    told = CliRunner().invoke(app, ["stats", str(alone.file), "--json"])
    rows = [json.loads(x) for x in told.output.splitlines()]
    assert told.exit_code == 0 and {"tension", "curvature"} <= {x.get("quantity") for x in rows}


def test_a_report_of_one_line_has_all_that_is_known_of_it(alone: hybrid.Result) -> None:
    """Of a line with a name cards of loads, zones over time, and energies were left out."""
    text = html(alone)
    found = re.findall(r'<section id="(\w+)"', text)
    assert {"verdict", "cable", "zones", "histories", "ranges", "energy"} <= set(found)
    assert all(f'id="fact-{key}"' in text for key in ("tension", "bend", "slack", "hockling", "seabed"))
    index = json.loads(re.search(r'id="index">(.*?)</script>', text, re.S)[1])  # type: ignore[index]
    assert [x["key"] for x in index["scene"]["colours"]] == ["zone", "tension", "curvature"]
    assert [x["name"] for x in index["scene"]["marks"]] == ["start", "end"]


def test_the_table_of_a_run_judges_each_line(path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    show_motion(Console(False, False), as_scene(spar()), hybrid.open(path), path)
    said = " ".join(capsys.readouterr().out.split())
    east, north = said.split("line east")[1].split("line north")
    assert "; max_tension of 1000 N BROKEN" in east and "BROKEN" not in north


@pytest.mark.parametrize("form", [as_scene, in_full])
def test_zones_and_the_search_are_said_of_one_line_and_of_many(
    form: Callable[[Any], hybrid.Scene], capsys: pytest.CaptureFixture[str]
) -> None:
    """Of lines with names how much was rod was not said, and how the equilibrium was found behind the file alone."""
    ends = {name: clamped_at([x, 0, 0], [1, 0, 0]) for name, x in ENDS.items()}
    section = SECTION | {"length": 12, "bending_stiffness": 5.0, "diameter": 0.05}
    asked = form(as_scene(cable_scene(section, **ends, model="adaptive", mesh=60, time=(0.2, 0.1))))
    show_motion(Console(False, False), asked, hybrid.run(asked), Path("run.h5"))
    moved = capsys.readouterr().out
    assert re.search(r"rod: \d+% of the line, all the time|rod: \d+% to \d+% of the line", moved)
    show_equilibrium(Console(False, False), hybrid.static(asked))
    rows = capsys.readouterr().out.splitlines()
    assert rows[0].startswith("found by") and any(x.startswith("residual force") for x in rows)


@pytest.mark.parametrize(("names", "title"), [(["l"], "Von mises."), (["l", "m"], "Line l: von mises.")])
def test_the_stress_of_pipes_is_judged(
    names: list[str], title: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """As the only limit of a line it went by in the table of commands and in the report, which names several lines."""
    pipe = {"bending_stiffness": 1.5e4, "diameter": 0.04, "pipe": {"wall": 0.004, "max_stress": 1e6}}
    line = {"start": "a", "end": "b", "sections": [SECTION | pipe], "mesh": {"cells": 12}}
    points = {"a": {"position": [0, 0, -60]}, "b": {"position": [100, 0, 0]}}
    path = tmp_path / "pipe.h5"
    result = hybrid.static({"points": points, "lines": dict.fromkeys(names, line)}, path)
    show_equilibrium(Console(False, False), result)
    assert re.search(r"von_mises of \S+ Pa, above the 1e\+06 Pa allowed; BROKEN", capsys.readouterr().out)
    text = html(result)
    assert title in text and "None, beside limits that are broken." in text
    assert "<td>max_stress</td><td>broken</td>" in text and f"{len(names)} of {len(names)} broken" in text


@pytest.mark.long
def test_a_film_moves_all_lines(result: hybrid.Result, tmp_path: Path) -> None:
    film = animate(result, tmp_path / "spar.gif")
    with Image.open(film.path) as image:
        assert image.n_frames == film.frames == 21
        first = np.array(image.convert("L"), int)
        image.seek(10)
        assert np.abs(np.array(image.convert("L"), int) - first).max() > 100


def test_what_is_of_one_line_says_so(result: hybrid.Result) -> None:
    with pytest.raises(ResultError, match=r"--line east"):
        hybrid.plot_zones(result)
    with pytest.raises(ResultError, match=r"--line east"):
        hybrid.plot(result, history=[1.0])


@pytest.mark.long
def test_commands_take_all_lines_or_one(path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    call = CliRunner()
    for command in ("plot", "report"):
        assert (
            call.invoke(app, [command, str(path), "-o", f"all.{'png' if command == 'plot' else 'html'}"]).exit_code == 0
        )
    assert call.invoke(app, ["plot", str(path), "--line", "east", "-o", "east.png"]).exit_code == 0
    assert call.invoke(app, ["export", str(path), "-o", "run.csv"]).exit_code == 0
    assert {x.name for x in tmp_path.iterdir()} == {
        "all.png", "all.html", "east.png", *(f"run.{name}.csv" for name in PLACES)
    }  # fmt: skip
    rows = [x for x in (tmp_path / "run.north.csv").read_text().splitlines() if not x.startswith("#")]
    assert len(rows) == 22


def test_an_equilibrium_is_drawn_as_one_picture_of_all_lines(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    scene = each_line(spar(), sections=[SECTION | {"bending_stiffness": 1e4}], model="rod")
    del scene["time"], scene["output"]["every"]
    Path("spar.yaml").write_text(json.dumps(scene))
    told = CliRunner().invoke(app, ["static", "spar.yaml", "--plot"])
    assert told.exit_code == 0 and "spar.static.png" in told.output
    assert {x.name for x in tmp_path.iterdir()} == {"spar.yaml", "spar.static.h5", "spar.static.png"}
    drawn = page(hybrid.open("spar.static.h5")).panels
    assert {x.label for x in drawn["b"].items if isinstance(x, Line)} == set(PLACES)  # bending moments of all lines


@pytest.mark.long
def test_a_stopped_run_is_drawn(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A file with fewer outputs than were asked for, and an equilibrium with one."""
    target = tmp_path / "part.h5"
    Stopping(monkeypatch).stop(30, hybrid.run, spar(), target)
    with hybrid.open(target) as part:
        assert part.status == "interrupted" and 1 < AllLines(part).outputs < 21
        assert "interrupted" in page(part).facts and "interrupted" in html(part).lower()
    still = hybrid.static(spar())
    assert set(page(still).panels) == {"s", "S", "p"} and "static, one output" in html(still)


def test_a_page_of_an_equilibrium_of_catenaries_can_be_drawn() -> None:
    """Two planes side by side over the one curve that there is: its page ended in an error of matplotlib."""
    around = zip("abc", (0.0, 2.1, 4.2), strict=True)
    points: dict[str, Any] = {x: {"position": [np.cos(a), np.sin(a), -0.3]} for x, a in around}
    points |= {"top": {"position": [0, 0, 0]}}
    sections = [{"length": 1.2, "mass": 1.0}]
    lines = {x: {"start": x, "end": "top", "sections": sections, "model": "catenary"} for x in "abc"}
    with hybrid.static({"points": points, "lines": lines}) as result:
        made = page(result)
    assert made.mosaic[0] == ["s", "S"] and {len(row) for row in made.mosaic} == {2}


# ---- many lines -----------------------------------------------------------------------------------


def fan() -> dict[str, Any]:
    """Fourteen legs, longer from one to the next, of which the last but one breaks its limit."""
    points: dict[str, Any] = {"top": {"position": [0, 0, 0]}}
    lines: dict[str, Any] = {}
    for k in range(14):
        a, far = 0.4 * k, 50.0 + 5.0 * k
        points[f"a{k}"] = {"position": [far * np.cos(a), far * np.sin(a), -20]}
        section = {"length": 1.12 * far, "mass": 5, "diameter": 0.05, "axial_stiffness": 1e7, "max_tension": 1e4}
        section |= {"max_tension": 700.0} if k == 12 else {}
        lines[f"leg{k}"] = {"start": "top", "end": f"a{k}", "sections": [section], "mesh": {"cells": 8}}
        lines[f"leg{k}"]["model"] = "catenary"
    return {"points": points, "lines": lines, "time": {"duration": 0.2, "step": 0.1}}


@pytest.fixture(scope="module")
def many(tmp_path_factory: pytest.TempPathFactory) -> Path:
    target = tmp_path_factory.mktemp("many") / "fan.h5"
    hybrid.run(fan(), target).close()
    return target


def test_of_many_lines_the_worst_come_first_and_all_are_named_in_the_plan(many: Path) -> None:
    drawn = page(hybrid.open(many))
    plan = drawn.panels["S"]
    assert plan.x.name == "x" and {x.text for x in plan.items if isinstance(x, Text)} == set(fan()["lines"])
    assert drawn.panels["p"].y.names[:3] == ("leg12", "leg13", "leg11")  # a broken limit, then the largest tensions
    for name in "Sh":
        labels = [x.label for x in drawn.panels[name].items if isinstance(x, Line) and "shapes" not in x.label]
        assert list(dict.fromkeys(labels)) == ["8 other lines", "leg12", "leg13", "leg11", "leg10", "leg9", "leg8"]


def test_a_report_of_many_lines_folds_all_but_the_worst(many: Path) -> None:
    text = html(hybrid.open(many))
    table = text.split("<h3>Lines: extremes of all steps, the worst first</h3>")[1].split("<h3>")[0]
    shown, folded = table.split("<summary>4 other lines</summary>")
    assert re.findall(r"<tr><td>(leg\d+)</td>", shown)[:2] == ["leg12", "leg13"] and "<td>leg1</td>" in folded
    limits = text.split("<h3>Limits of the lines</h3>")[1].split("<h3>")[0]
    assert re.findall(r"<td>(leg\d+)</td><td>max_tension</td>", limits)[0] == "leg12" and len(limits.split("leg1")) > 2
    assert text.count("<h3>Line leg12: tension</h3>") == 1 and "<h3>Line leg1: tension</h3>" not in text
    assert "has the others" in text


@pytest.mark.parametrize("columns", [80, 120])
def test_the_table_of_many_lines_fits(
    many: Path, columns: int, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", str(columns))
    show_motion(Console(False, False), as_scene(fan()), hybrid.open(many), many)
    said = capsys.readouterr().out.splitlines()
    rows = [x.split() for x in said if x.startswith("leg")]
    assert [row[0] for row in rows] == ["leg12", "leg13", "leg11", "leg10", "leg9", "leg8", "leg7", "leg6"]
    assert "max_tension BROKEN" in " ".join(rows[0]) and all(len(x) <= columns for x in said)
    assert any("6 other lines: tension from" in x for x in said) and any("11 others with smaller" in x for x in said)


def test_a_plan_of_many_lines_has_a_row_for_those_that_are_alike() -> None:
    network = as_scene(each_line(fan(), sections=[SECTION]))
    rows = plan_rows(network, hybrid.plan(network, measure=False))  # type: ignore[arg-type]
    assert any(x.startswith("14 lines ") and "120 m" in x for x in rows) and not any(
        x.startswith("line ") for x in rows
    )
