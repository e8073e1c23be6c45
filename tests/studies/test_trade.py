"""The ladder of models and accuracies: what counts as good, what is kept, what is refused, what is drawn."""

from __future__ import annotations

import csv
import io
import json
import shutil
import signal
from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import hybrid
from hybrid.errors import ComputationError, Outcome, SceneError
from hybrid.scene.root import in_full
from hybrid.store.tables import CHECK, FAILED, MISSED, REFERENCE, Row, TradeTable, judged, pareto
from hybrid.studies import runs, tradeoff
from hybrid.view.several_runs import plot_trade
from tests.scenes import cable_scene, line_between, network_scene, pinned_at

# A second of a line that hangs in water: every model can do it, and a run is some 0.1 s.
SAG: dict[str, Any] = cable_scene(
    {"length": 12.0, "diameter": 0.03, "mass": 2.0, "axial_stiffness": 1e5, "bending_stiffness": 20.0,
     "drag": {"normal": 1.2}, "added_mass": {"normal": 1.0}},
    pinned_at(0, 0, -5), pinned_at(10, 0, -5, motion={"heave": {"amplitude": 0.3, "period": 2.0}, "ramp": 1}),
    title="a line that sags", fluid={"density": 1025},
    model={"kind": "adaptive", "tolerance": 1e-4, "force_rod": [[0.0, 1.0]]}, mesh=20, time=(1.0, 0.05),
    output=(0.1, 25)
)  # fmt: skip


def scene(**changes: Any) -> hybrid.Scene:
    return hybrid.validate_scene(SAG | changes)


def row(model: str = "rod", asked: str = "1%", cpu: float = 1.0, error: float = 0.5, **more: Any) -> Row:
    """A run with `error` metres and ten times as many newtons."""
    figures = {"position": error, "end_force": 10.0 * error} | more
    parts = {"position_part": figures["position"] / 10, "end_force_part": (figures["end_force"] or 0.0) / 200}
    return Row("hybrid", model, asked, "done", cpu=cpu, **parts | figures)


def table(*rows: Row, position: float | None = 1.0, end_force: float | None = 10.0, **more: Any) -> TradeTable:
    reference = Row(
        "hybrid", "rod", "0.03%", REFERENCE, estimate_position=0.01, estimate_end_force=0.1, cells=9, steps=9
    )
    facts = (("command", "`hybrid trade x.yaml`"),)
    return TradeTable("by hand", "1%", 10.0, 200.0, position, end_force, (reference, *rows), facts=facts, **more)


# --- what counts as good ------------------------------------------------------------------------


def test_the_front_is_what_nothing_beats() -> None:
    points = [(1.0, 5.0), (2.0, 2.0), (3.0, 2.0), (2.0, 4.0), (5.0, 1.0), (6.0, 1.5), (0.5, 9.0)]
    assert pareto(points) == [True, True, False, False, True, False, True]


def test_equal_points_are_on_the_front_together_and_one_alone_is_on_it() -> None:
    assert pareto([(1.0, 1.0), (1.0, 1.0)]) == [True, True]
    assert pareto([(3.0, 3.0)]) == [True]
    assert pareto([]) == []


@pytest.mark.parametrize("seed", range(5))
def test_the_front_falls_and_leaves_nobody_better_outside(seed: int) -> None:
    points = [tuple(x) for x in np.random.default_rng(seed).uniform(size=(40, 2)).tolist()]
    front = sorted(p for p, on in zip(points, pareto(points), strict=True) if on)
    assert all(a[0] < b[0] and a[1] > b[1] for a, b in pairwise(front))
    for p, on in zip(points, pareto(points), strict=True):
        beaten = any(q[0] <= p[0] and q[1] <= p[1] and q != p for q in points)
        assert on != beaten


def test_the_cheapest_that_meets_what_is_asked_is_recommended() -> None:
    rough, cheap, dear = row(cpu=0.1, error=2.0), row("catenary", cpu=0.5, error=0.9), row(cpu=2.0, error=0.1)
    found = table(rough, cheap, dear, row("adaptive", cpu=0.7, error=0.95))
    assert found.recommended == cheap
    assert found.front() == [rough, cheap, dear]
    said = found.recommendation
    assert said.startswith("For 1% use model catenary with accuracy {position: 1%, tension: 1%}: 0.5 s of CPU time")
    assert "4 times less than a rod everywhere" in said and "0.9 m and 9 N" in said


def test_the_worse_of_two_quantities_counts_and_what_is_not_asked_does_not() -> None:
    bent = row(error=0.5, end_force=30.0)
    assert table(bent).score(bent) == 3.0
    assert table(bent).recommended is None
    assert table(bent, end_force=None).recommended == bent
    assert "No run met 1%; rod 1% comes nearest, with 3 times this error" in table(bent).recommendation


def test_failed_runs_references_and_other_programs_are_not_recommended() -> None:
    peer_run = replace(row(cpu=0.01, error=0.01), code="MoorDyn")
    ours = row(cpu=1.0, error=0.9)
    failed = Row("hybrid", "catenary", "1%", FAILED, "it went slack", cpu=0.001)
    check = replace(row(cpu=0.001, error=0.001), status=CHECK)
    found = table(ours, failed, check, peer_run)
    assert found.recommended == ours and found.front() == [peer_run]


def test_a_run_that_misses_what_it_was_asked_says_by_how_much() -> None:
    good, bad = row(error=0.5, estimate_end_force=2.0), row(error=3.0, estimate_end_force=2.0, end_force=4.0)
    limits = [(None, None), (1.0, 10.0), (1.0, 10.0), (None, None)]
    _, first, second, third = judged(table(good, bad, bad), limits).rows
    assert first.status == third.status == "done"
    assert second.status == MISSED and second.cause == "position error 3 times the accuracy"


def test_a_part_is_of_each_line_and_a_size_is_not() -> None:
    """0.5 m are a fifth of a line of 2.5 m beside one of 10 m: twice the 10 % that are asked, half of 1 m."""
    short = row(error=0.5, end_force=0.0, position_part=0.2)
    assert table(short).score(short) == pytest.approx(2.0)
    assert replace(table(short), target="1 m").score(short) == pytest.approx(0.5)
    limits = [(None, None), (1.0, 10.0)]
    assert judged(table(short), limits).rows[1].cause == "position error 2 times the accuracy"
    assert judged(table(replace(short, asked="1 m")), limits).rows[1].status == "done"


def test_a_run_is_not_blamed_for_the_error_of_the_reference() -> None:
    """The reference is known to 0.2 m, half of what the check differs by: 1.1 m may be 0.9 m, 1.3 m may not be 1 m."""
    check = replace(row(error=0.4), status=CHECK)
    limits = [(None, None)] * 2 + [(1.0, None)] * 2
    *_, near, far = judged(table(check, row(error=1.1), row(error=1.3)), limits).rows
    assert (near.status, far.status) == ("done", MISSED)


def test_errors_below_that_of_the_reference_are_marked() -> None:
    page = table(
        row(error=0.005, estimate_position=0.01), row("catenary", error=0.5, estimate_position=0.25)
    ).markdown()
    first, second = (line for line in page.splitlines() if line.startswith(("| rod 1%", "| catenary")))
    assert "≲ 0.005 m" in first and "(×" not in first
    assert "≲" not in second and "0.25 m (× 0.5)" in second
    doubt = table(row(), replace(row(error=0.4), status=CHECK))
    assert doubt.doubt("position") == 0.2 and doubt.doubt("end_force") == 2.0


def test_errors_are_the_largest_over_time_and_place_and_pulls_are_vectors() -> None:
    truth = {"position": np.zeros((3, 4, 3)), "reaction_start": np.tile([3.0, 4.0, 0.0], (3, 1))}
    values = {name: x.copy() for name, x in truth.items()}
    values["position"][1, 2] = [0.3, 0.0, 0.4]
    values["reaction_start"][2] = [4.0, 3.0, 0.0]  # as large, elsewhere to
    found = tradeoff.with_errors(row(), values, truth, 10.0)
    assert found.position == pytest.approx(0.5) and found.position_part == pytest.approx(0.05)
    assert found.end_force == pytest.approx(2**0.5) and found.end_force_part == pytest.approx(2**0.5 / 5)
    assert found.status == "done"
    wild = values | {"reaction_start": 3.0 * truth["reaction_start"]}
    assert tradeoff.with_errors(row(), wild, truth, 10.0).status == FAILED, "wrong by twice the largest pull"
    sizes = values | {"reaction_start": np.full((3, 1), 5.5)}  # a program that tells only how large a force is
    assert tradeoff.with_errors(row(), sizes, truth, 10.0).end_force == pytest.approx(0.5)


def test_names_of_0_5_still_work() -> None:
    found = table(row(error=0.5))
    with pytest.warns(DeprecationWarning, match="largest_pull is now largest_end_force"):
        assert found.largest_pull == found.largest_end_force == 200.0
    with pytest.warns(DeprecationWarning, match="pull_part is now end_force_part"):
        assert found.rows[1].pull_part == found.rows[1].end_force_part
    with pytest.warns(DeprecationWarning, match="asked_for=.* is now .*target="), pytest.raises(SceneError) as refused:
        hybrid.trade(scene(), "nowhere", asked_for="much")
    assert refused.value.complaints[0].where == "for"
    with pytest.raises(TypeError, match="goal"):
        hybrid.trade(scene(), "nowhere", goal="1%")


@pytest.mark.parametrize("compute", [hybrid.trade, hybrid.trade_levels])
def test_who_asks_for_other_programs_is_told_where_they_are(compute: Any, tmp_path: Path) -> None:
    with pytest.raises(TypeError, match=r"peers: .*python -m peers\.trade"):
        compute(scene(), tmp_path / "new", peers=True)
    assert not (tmp_path / "new").exists()


# --- the study ---------------------------------------------------------------------------------


def test_a_run_keeps_the_scene_and_drops_its_resolution() -> None:
    asked = hybrid.validate_scene(runs.scene_data(scene(), "adaptive", "0.3%"))
    assert asked.mesh is None and asked.time is not None and asked.time.step is None
    assert asked.accuracy is not None and asked.accuracy.position == "0.3%"
    assert asked.model.kind == "adaptive" and asked.model.tolerance is None and asked.model.force_rod == ((0.0, 1.0),)
    assert asked.cable == scene().cable and asked.ends == scene().ends and asked.output.points == 25
    assert runs.scene_data(scene(), "rod", "1%")["model"] == {"kind": "rod"}


def test_models_are_those_of_the_schema_that_the_scene_admits() -> None:
    assert {"rod", "catenary", "adaptive", "zones"} <= set(runs.model_kinds())
    soft = scene()
    data = soft.model_dump(mode="json", exclude_none=True)
    del data["cable"]["sections"][0]["bending_stiffness"]
    soft = hybrid.validate_scene(data | {"model": "catenary"})
    admitted = [kind for kind, why in tradeoff._models(soft, None).items() if not why]
    assert "catenary" in admitted and "rod" not in admitted


@pytest.mark.parametrize(
    ("changes", "where"),
    [
        ({"models": ["rood"]}, "models"),
        ({"accuracies": ["1 parsec"]}, "accuracies"),
        ({"accuracies": ["50%"]}, "accuracies"),
        ({"target": "much"}, "for"),
        ({"reference": "1%", "accuracies": ["1%"]}, "reference"),
        ({"reference": "none"}, "reference"),
        ({"repeat": 0}, "repeat"),
    ],
)
def test_nonsense_is_refused_before_anything_is_computed(tmp_path: Path, changes: dict[str, Any], where: str) -> None:
    with pytest.raises(SceneError) as refused:
        hybrid.trade(scene(), tmp_path / "new", **changes)
    assert refused.value.complaints[0].where.split(".")[0] == where
    assert not (tmp_path / "new").exists()


def test_a_scene_without_time_is_refused(tmp_path: Path) -> None:
    still = {name: value for name, value in SAG.items() if name != "time"}
    with pytest.raises(SceneError, match="time"):
        hybrid.trade(hybrid.validate_scene(still), tmp_path)


@pytest.mark.parametrize(
    ("accuracies", "reference"), [(["10%", "3%"], "0.03%"), (["0.06%"], "0.02%"), (["3 cm"], "0.03%")]
)
def test_the_reference_is_finer_than_the_ladder(accuracies: list[str], reference: str) -> None:
    assert tradeoff._finer(scene(), accuracies) == reference
    assert (
        tradeoff._coarser("0.03%") == "0.09%"
        and tradeoff._coarser("8%") == "10%"
        and tradeoff._coarser("3 cm") == "0.09 m"
    )


# --- runs ---------------------------------------------------------------------------------------

LADDER: dict[str, Any] = {"models": ["rod", "catenary"], "accuracies": ["10%", "3%"], "reference": "1%"}


@pytest.fixture
def counted(monkeypatch: pytest.MonkeyPatch) -> Iterator[list[str]]:
    """Which runs are made, warming up left out."""
    made: list[str] = []
    real = runs.run

    def run(scene: hybrid.Scene, *args: Any, **more: Any) -> hybrid.Result:
        if more:
            assert scene.accuracy is not None
            made.append(f"{scene.model.kind} {scene.accuracy.position}")
        return real(scene, *args, **more)

    monkeypatch.setattr(runs, "run", run)
    yield made


@pytest.mark.long
def test_a_ladder_is_computed_once_and_kept(tmp_path: Path, counted: list[str]) -> None:
    first = hybrid.trade(scene(), tmp_path, **LADDER)
    assert counted[:2] == ["rod 1%", "rod 3%"], "the reference comes first, then what shows how converged it is"
    # The check is the run "rod 3%" as well: one run serves both.
    assert sorted(counted) == sorted(["rod 1%", "rod 3%", "rod 10%", "catenary 10%", "catenary 3%"])
    assert [r.name for r in first.rows] == ["rod 1%", "rod 3%", "rod 10%", "rod 3%", "catenary 10%", "catenary 3%"]
    assert [r.status for r in first.rows][:2] == [REFERENCE, CHECK]
    for r in first.choices:
        assert r.position is not None and 0.0 < r.position < 0.5 and r.cells and r.steps and r.cpu and r.cpu > 0.0
    assert first.recommended is not None

    counted.clear()
    second = hybrid.trade(scene(), tmp_path, **LADDER)
    assert not counted and second.rows == first.rows
    assert (tmp_path / "trade.md").read_text().count("0 of 6 computed now") == 1

    files = sorted((tmp_path / "runs").glob("*.json"))
    lost = next(file for file in files if json.loads(file.read_text())["model"] == "catenary")
    lost.unlink()
    hybrid.trade(scene(), tmp_path, **LADDER)
    assert len(counted) == 1 and counted[0].startswith("catenary")

    counted.clear()
    hybrid.trade(scene(time={"duration": 0.2}), tmp_path, **LADDER)
    assert len(counted) == 5, "another scene is another ladder"


@pytest.fixture(scope="module")
def ladder(tmp_path_factory: pytest.TempPathFactory) -> tuple[TradeTable, Path]:
    """The whole ladder, and its folder."""
    folder = tmp_path_factory.mktemp("ladder")
    return hybrid.trade(scene(), folder, **LADDER, command="hybrid trade sag.yaml"), folder


@pytest.mark.long
def test_table_page_and_picture(ladder: tuple[TradeTable, Path]) -> None:
    found, folder = ladder
    rows = list(csv.DictReader(io.StringIO((folder / "trade.csv").read_text())))
    assert len(rows) == len(found.rows) == 6
    for read, kept in zip(rows, found.rows, strict=True):
        assert (read["model"], read["asked"], read["status"]) == (kept.model, kept.asked, kept.status)
        assert read["end_force"] == (f"{kept.end_force:.6g}" if kept.end_force is not None else "")
    assert sum(int(read["recommended"]) for read in rows) == 1
    assert {r.name for r in found.front()} == {f"{r['model']} {r['asked']}" for r in rows if r["pareto"] == "1"}
    page = (folder / "trade.md").read_text()
    for said in (
        "# a line that sags", found.recommendation, "(trade.png)", "| machine | ", "cores", "| versions | hybrid-cable ",
        "`hybrid trade sag.yaml`", "Reference: rod 1%", "rod 3% differs from it by", "time.step, mesh, model.tolerance",
        "it uses force_rod",
    ):  # fmt: skip
        assert said in page, said
    assert page.count("**recommended**") == 1
    assert_drawn(folder / "trade.png")


def figures_of(found: TradeTable) -> list[Row]:
    """The rows without clocks, and without the key that is that of the text of the scene."""
    return [replace(row, cpu=None, effort_cpu=None, key="") for row in found.rows]


@pytest.mark.long
def test_the_network_of_one_line_has_the_rows_of_its_cable(ladder: tuple[TradeTable, Path], tmp_path: Path) -> None:
    found = hybrid.trade(in_full(scene()), tmp_path, **LADDER)
    assert figures_of(found) == figures_of(ladder[0])
    assert (found.bound_position, found.bound_end_force) == (ladder[0].bound_position, ladder[0].bound_end_force)
    assert [found.score(x) for x in found.rows] == [ladder[0].score(x) for x in ladder[0].rows]


def joined(**of_chain: Any) -> dict[str, Any]:
    """A rope and a shorter chain that hang in water and meet at a free point; `of_chain`: more of the chain's table."""
    section = SAG["cable"]["sections"][0]
    chain = {k: x for k, x in section.items() if k != "bending_stiffness"} | {"length": 3.0, "mass": 4.0}
    return network_scene(
        {"left": {"kind": "fixed", "position": [0, 0, -5]},
         "knot": {"kind": "free", "initial_guess": [7, 0, -9], "mass": 5.0},
         "right": {"kind": "fixed", "position": [10, 0, -5], "motion": SAG["ends"]["end"]["motion"]}},
        {"rope": line_between("left", "knot", section | {"length": 9.0}, model="catenary"),
         "chain": line_between("knot", "right", chain) | of_chain},
        environment=SAG["environment"], time={"duration": 0.5}, output=(0.1, 11)
    )  # fmt: skip


@pytest.mark.long
def test_lines_that_are_joined_have_the_worst_error_of_all(tmp_path: Path) -> None:
    found = hybrid.trade(joined(), tmp_path, models=["rod", "catenary"], accuracies=["10%"], reference="3%")
    assert [(x.name, x.status) for x in found.rows[:2]] == [("rod 3%", REFERENCE), ("rod 9%", CHECK)]
    assert found.length == 9.0 and "# rope, chain" in (tmp_path / "trade.md").read_text()
    assert "- Not admitted by lines.chain, which keeps its model: rod (" in (tmp_path / "trade.md").read_text()
    store = runs.RunStore(tmp_path, None, 0, lambda: False)
    (_, exact), lengths = store.load(found.reference.key) or pytest.fail(), {"rope": 9.0, "chain": 3.0}
    for row in found.choices:
        _, values = store.load(row.key) or pytest.fail()
        errors = {x: np.linalg.norm(values[f"{x}/position"] - exact[f"{x}/position"], axis=-1).max() for x in lengths}
        assert row.position == pytest.approx(max(errors.values()))
        assert row.position_part == pytest.approx(max(errors[x] / lengths[x] for x in lengths))
        assert row.position_part * found.length / found.bound_position <= found.score(row), "of a part the largest part"
        assert row.cells and row.steps and row.runs and row.end_force and row.estimate_position


def test_a_line_that_does_not_admit_a_model_keeps_its_own() -> None:
    asked = hybrid.validate_scene(joined(model="catenary", accuracy="5%", mesh={"cells": 9}))
    spec = runs.run_spec(asked, "rod", "1%")
    assert spec.scene is not None and not spec.refused and list(spec.unchanged) == ["lines.chain"]
    assert {name: x.chosen_model.kind for name, x in spec.scene.lines.items()} == {"rope": "rod", "chain": "catenary"}
    assert all(x.mesh is None and x.accuracy is None for x in spec.scene.lines.values())
    assert runs.run_spec(asked, "zones", "1%").refused, "no line has zones"
    (dropped, *_) = tradeoff._notes(asked, {}, True)
    assert "lines.chain.mesh, lines.chain.accuracy" in dropped


@pytest.mark.slow  # a ladder of runs
def test_a_model_that_fails_is_a_row_and_is_not_tried_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, counted: list[str]
) -> None:
    real = runs.run

    def run(scene: hybrid.Scene, *args: Any, **more: Any) -> hybrid.Result:
        if scene.model.kind == "catenary":
            counted.append("failing")
            raise ComputationError(Outcome.SLACK, 0.4, 3.0)
        return real(scene, *args, **more)

    monkeypatch.setattr(runs, "run", run)
    found = hybrid.trade(scene(), tmp_path, **LADDER)
    failed = [r for r in found.rows if r.model == "catenary"]
    assert [r.status for r in failed] == [FAILED] * 2 and "goes into compression" in failed[0].cause
    assert all(r.status != FAILED for r in found.rows if r.model == "rod")
    counted.clear()
    hybrid.trade(scene(), tmp_path, **LADDER)
    assert not counted


def test_a_reference_that_fails_ends_it_and_says_so(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def run(*_: Any, **__: Any) -> None:
        raise ComputationError(Outcome.NOT_CONVERGED, 0.4, 3.0)

    monkeypatch.setattr(runs, "run", run)
    with pytest.raises(ComputationError, match="the reference run, rod 1%, failed"):
        hybrid.trade(scene(), tmp_path, **LADDER)
    assert not (tmp_path / "trade.md").exists()


@pytest.mark.slow  # a ladder of runs
def test_an_interrupted_ladder_leaves_a_table_and_goes_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, counted: list[str]
) -> None:
    real = runs.run

    def run(scene: hybrid.Scene, *args: Any, **more: Any) -> hybrid.Result:
        if more and len(counted) == 3:
            raise KeyboardInterrupt
        return real(scene, *args, **more)

    with monkeypatch.context() as patch:
        patch.setattr(runs, "run", run)
        with pytest.raises(KeyboardInterrupt):
            hybrid.trade(scene(), tmp_path, **LADDER)
    assert len(counted) == 3
    assert "(3 runs are missing)" in (tmp_path / "trade.md").read_text()
    assert_drawn(tmp_path / "trade.png")
    whole = hybrid.trade(scene(), tmp_path, **LADDER)
    assert len(counted) == 5 and whole.missing == 0 and len(whole.rows) == 6


class Dying:
    """An object at whose end a signal comes: Python drops what is raised there."""

    def __del__(self) -> None:
        signal.raise_signal(signal.SIGINT)


@pytest.mark.slow  # a ladder of runs
def test_a_signal_where_python_drops_exceptions_is_not_lost(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, counted: list[str]
) -> None:
    real = runs.run

    def run(scene: hybrid.Scene, *args: Any, **more: Any) -> hybrid.Result:
        result = real(scene, *args, **more)
        if len(counted) == 1:
            Dying()
        return result

    monkeypatch.setattr(runs, "run", run)
    with pytest.raises(KeyboardInterrupt):
        hybrid.trade(scene(), tmp_path, **LADDER)
    assert len(counted) == 1
    assert "(5 runs are missing)" in (tmp_path / "trade.md").read_text()


@pytest.mark.long
def test_a_half_written_run_is_made_again(ladder: tuple[TradeTable, Path], tmp_path: Path, counted: list[str]) -> None:
    shutil.copytree(ladder[1], tmp_path, dirs_exist_ok=True)
    for file in (tmp_path / "runs").glob("*.json"):
        if json.loads(file.read_text())["asked"] == "10%":
            file.write_text('{"code": "hyb')
    hybrid.trade(scene(), tmp_path, **LADDER)
    assert sorted(counted) == ["catenary 10%", "rod 10%"]


# --- the picture --------------------------------------------------------------------------------


def assert_drawn(file: Path) -> None:
    """It has ink, of more than one colour, and is no larger than a page may be."""
    from matplotlib.image import imread

    pixels = (255 * imread(file)[..., :3]).astype(int).reshape(-1, 3)
    assert len(np.unique(pixels, axis=0)) > 50
    assert 0.01 < (pixels.sum(axis=1) < 600).mean() < 0.5
    assert file.stat().st_size < 150_000


def test_the_picture_shows_every_run_at_its_place() -> None:
    rows = [row(asked=a, cpu=c, error=e) for a, c, e in (("10%", 0.1, 2.0), ("1%", 0.5, 0.5), ("0.1%", 3.0, 0.03))]
    rows += [row("catenary", "1%", 0.3, 0.7), replace(row(cpu=9.0, error=0.2), code="MoorDyn", asked="25 elements, x")]
    figure = plot_trade(table(*rows))
    position = next(ax for ax in figure.axes if ax.get_title("left") == "error of position")
    lines = {line.get_label(): line for line in position.get_lines()}
    np.testing.assert_allclose(lines["rod"].get_xydata(), [(0.1, 2.0), (0.5, 0.5), (3.0, 0.03)])
    np.testing.assert_allclose(lines["MoorDyn"].get_xydata(), [(9.0, 0.2)])
    np.testing.assert_allclose(lines["recommended"].get_xydata(), [(0.3, 0.7)])
    assert lines["Pareto front"].get_xydata().shape == (4, 2)
    assert position.get_xscale() == position.get_yscale() == "log"
    (low, high), (left, right) = position.get_ylim(), position.get_xlim()
    assert low < 0.03 and high > 2.0 and left < 0.1 and right > 9.0


def test_a_picture_without_runs_or_pulls_says_so() -> None:
    assert any("no finished run" in text.get_text() for text in plot_trade(table()).texts)
    figure = plot_trade(table(row(end_force=None, end_force_part=None)))
    assert [ax.get_label() for ax in figure.axes] == ["score", "position"]


def test_errors_do_not_hang_on_where_the_scene_lies(tmp_path: Path) -> None:
    """Map coordinates were kept in single precision: half a metre apart."""
    store = runs.RunStore(tmp_path, None, 1, lambda: False)
    values = {"position": np.full((1, 1, 3), 6e6) + 1e-3}
    _, kept = store.save(Row("hybrid", "rod", "1%", "done", key="x"), values)
    assert np.array_equal(kept["position"], values["position"])
    assert np.array_equal(store.load("x")[1]["position"], values["position"])


def test_an_error_of_forces_where_no_end_is_held_is_refused(tmp_path: Path) -> None:
    """The cheapest run was recommended, by no comparison at all."""
    section = {"length": 10, "mass": 1.5, "diameter": 0.03, "axial_stiffness": 1e5, "bending_stiffness": 50}
    points = {"kind": "points", "points": [[0, 0, 0], [5, 0, 0.5], [9.93, 0, 0]]}
    scene = cable_scene(section, {"kind": "free"}, {"kind": "free"}, initial=points, time=0.2, output=(0.1, 5))
    with pytest.raises(SceneError, match="an error of position"):
        hybrid.trade(scene, tmp_path, models=["rod"], accuracies=["10%"], target="50 N")
