"""Statistics of a result: which values they are of, and what is refused."""

from __future__ import annotations

from functools import partial
from types import SimpleNamespace
from typing import Any, ClassVar

import numpy as np
import pytest
from reported import reported

import hybrid
from hybrid.cli.statistics_commands import _fatigue_at, _fatigue_lines
from hybrid.errors import ResultError
from hybrid.statistics import fatigue, moments
from hybrid.statistics.fatigue import damage
from hybrid.store import tables
from hybrid.store.histories import bends_of, extreme_of, history_of
from hybrid.store.tables import rows_of, values_of
from tests.called import Call
from tests.scenes import cable_scene, pinned_at

SCENE = cable_scene(
    {"length": 60.0, "mass": 8.0, "diameter": 0.04, "axial_stiffness": 1e7, "bending_stiffness": 500.0,
     "drag": {"normal": 1.2}},
    pinned_at(0, 0, -40), pinned_at(35, 0, 0, motion={"heave": {"amplitude": 1.0, "period": 5.0}, "ramp": 5.0}),
    fluid={"density": 1025.0}, model="rod", mesh=20, time=(130.0, 0.1), output=0.25
)  # fmt: skip


@pytest.fixture(scope="module")
def result(tmp_path_factory: pytest.TempPathFactory) -> hybrid.Result:
    return hybrid.run(SCENE, tmp_path_factory.mktemp("stats") / "run.h5")


def test_statistics_are_of_steps_and_of_outputs(result: hybrid.Result) -> None:
    """An end force is taken at every step; tension has a value at each place, which is that of its column."""
    found = result.statistics(times=(30.0, None))
    assert found["end_force_end"].maximum == result["steps/end_force_end"][result["steps/t"] >= 30.0].max()
    tension = found["tension"]
    assert tension.mean.shape == result.s.shape
    late = result.t >= 30.0
    one = moments.summary(result.t[late], result.tension[late, 7])
    assert tension.standard_deviation[7] == pytest.approx(one.standard_deviation, rel=1e-12)
    assert tension.crossing_period[-1] == pytest.approx(5.0, rel=2e-3)
    assert result.statistics(["tension"], at=[10.0, 20.0])["tension"].mean.shape == (2,)


def test_what_outputs_have_missed_is_said() -> None:
    """Every step has a larger tension than the outputs here: the row says so, where the window has that moment."""
    result = hybrid.run(SCENE | {"time": {"duration": 8.0, "step": 0.1}, "output": {"every": 2.5}})
    (row,) = rows_of(result, ["tension"])
    k = int(np.argmax(result["envelope/tension_max"]))
    most, t = result["envelope/tension_max"][k], result["envelope/tension_t_max"][k]
    assert most > 1.01 * row["maximum"] and row["maximum"] == result.tension.max()
    assert all(x in row["beyond_outputs"] for x in (f"{most:.5g} N", f"t = {t:.5g} s"))
    assert 2.5 < t < 5.0 and "beyond_outputs" not in rows_of(result, ["tension"], times=(5.0, None))[0]
    fine = hybrid.run(SCENE | {"time": {"duration": 8.0, "step": 0.1}, "output": {"every": 0.1}})
    assert "beyond_outputs" not in rows_of(fine, ["tension"])[0]


def test_extremes_and_their_negative() -> None:
    """The smallest value is the negative of the largest of what is negated, with its interval the right way round."""
    t, x = irregular(10.0, 300.0)
    low = extreme_of(Line(), "tension", "N", t, x, 3600.0, smallest=True)  # type: ignore[arg-type]
    high = extreme_of(Line(), "tension", "N", t, -x, 3600.0)  # type: ignore[arg-type]
    assert low.fractile < low.median < low.most_probable < x.min()
    assert low.fractile_interval[0] <= low.fractile <= low.fractile_interval[1]
    assert low.median_interval[0] <= low.median <= low.median_interval[1]
    assert (low.most_probable, low.fractile) == (-high.most_probable, -high.fractile)
    with pytest.raises(ResultError, match="less than one peak"):
        extreme_of(Line(), "tension", "N", t, x, 1.0)  # type: ignore[arg-type]


def test_spectrum_has_its_peak_where_the_motion_is(result: hybrid.Result) -> None:
    found = result.spectrum("end_force_end", times=(30.0, None), segment=50.0)
    assert found.peak_period == pytest.approx(5.0, rel=0.05)
    deviation = result.statistics(["end_force_end"], times=(30.0, None))["end_force_end"].standard_deviation
    assert found.significant == pytest.approx(4.0 * deviation, rel=0.02)


@pytest.mark.needs("rainflow")
def test_damage_along_the_line(result: hybrid.Result) -> None:
    """By tension it is that of the history; by stress it is at least that of tension alone, and of one plane in one."""
    s, damage = result.damage("studless chain T-N", strength=1e6, times=(30.0, None))
    history = history_of(result, "tension", (30.0, None))
    assert np.array_equal(s, result.s)
    assert damage[5] == fatigue.damage(history.values[:, 5], "studless chain T-N", 1e-6)
    section = (5e-4, 0.04, 2e11)
    _, worst = result.damage("D sea", section=section, times=(30.0, None))
    axial = fatigue.damage(history.values, "D sea", 1e-6 / section[0])
    assert np.all(worst >= 0.999 * axial) and worst.max() > axial.max()
    # the line bends in one plane: tension and bending of the fibre in it, on either side
    bend = history_of(result, "curvature", (30.0, None)).values[:, 10]
    sides = [
        fatigue.damage(fatigue.stress_of(history.values[:, 10], sign * bend, *section), "D sea") for sign in (1.0, -1.0)
    ]
    assert worst[10] == pytest.approx(max(sides), rel=0.15)
    assert worst[10] <= max(sides) * (1.0 + 1e-9)


@pytest.mark.parametrize(
    ("ask", "text"),
    [
        (lambda r: r.statistics(["tensio"]), "did you mean"),
        (lambda r: r.statistics(["energy"]), "is a group"),
        (lambda r: r.statistics(["s"]), "no history"),
        (lambda r: r.statistics(["tension"], times=(1e3, 2e3)), "no value"),
        (lambda r: r.statistics(["tension"], at=[1e3]), "outside the result"),
        (lambda r: r.extreme("tension"), "an arc length"),
        (lambda r: r.extreme("end_force_end", at=3.0), "no value at an arc length"),
        (lambda r: r.extreme("end_force_end", times=(20.0, None)), "peaks are alike"),
        (lambda r: r.extreme("end_force_end", times=(0.0, 20.0)), "too few"),
        (lambda r: r.spectrum("tension", segment=1e6), "expected"),
        (lambda r: r.damage("D sea", strength=1e6), "ranges of stress"),
        (lambda r: r.damage("studless chain T-N"), "strength"),
        (lambda r: r.damage("D sea", section=(1e-3, 0.05)), "section="),
        (lambda r: r.damage("studless chain T-N", strength=-1.0), "above 0"),
        (lambda r: r.statistics("tension", times=(1.0,)), "no window"),
        (lambda r: r.extreme("end_force_end", probability=1.5), "between 0 and 1"),
        (lambda r: r.damage("D see", section=(1, 1, 1)), "did you mean D sea"),
    ],
)  # fmt: skip
def test_what_cannot_be_is_refused_in_words(result: hybrid.Result, ask: object, text: str) -> None:
    with pytest.raises((ResultError, KeyError, AttributeError), match=text):
        ask(result)  # type: ignore[operator]


@pytest.mark.parametrize("outputs", [0, 1])
def test_a_run_that_was_stopped_before_its_first_output_has_no_history(outputs: int) -> None:
    stopped = reported(outputs=outputs, status="running", steps=False)
    fix = "hybrid resume the file` goes on" if outputs else "`hybrid run` of its scene"
    with pytest.raises(ResultError, match=rf"(?s)stopped before its first output.*{fix}.*output\.every"):
        stopped.statistics(["tension"])
    with pytest.raises(ResultError, match="stopped before its first output"):
        stopped.damage("D sea", strength=1e6)
    with pytest.raises(ResultError, match="one value is too few"):
        reported(outputs=1).statistics(["tension"])


@pytest.mark.needs("rainflow")
def test_both_sides_of_a_jump_are_counted() -> None:
    """EI changes a hundredfold at s = 30 m: curvature behind it is that of the softer side, and damage is done there."""
    first = SCENE["cable"]["sections"][0] | {"length": 30.0, "bending_stiffness": 5e4}
    scene = SCENE | {
        "cable": {"sections": [first, first | {"bending_stiffness": 5e2}]},
        "time": {"duration": 20.0, "step": 0.1},
    }
    result = hybrid.run(scene)
    s, curvature = result.both_sides("curvature")
    left, right = np.flatnonzero(s == 30.0)
    found = result.statistics("curvature")["curvature"]
    assert (
        found.maximum.shape == s.shape and found.maximum[right] == curvature[:, right].max() > 5.0 * found.maximum[left]
    )
    at = result.statistics("curvature", at=[10.0, 30.0])["curvature"].maximum
    assert at.shape == (3,) and at[2] == found.maximum[right]
    places, damage = result.damage("D sea", section=(5e-4, 0.04, 2e11))
    assert np.array_equal(places, s) and damage[right] > 5.0 * damage[left]
    alone_places, alone = result.damage("D sea", section=(5e-4, 0.04, 2e11), at=[30.0])
    between = result.damage("D sea", section=(5e-4, 0.04, 2e11), at=[12.3])[1]
    mixed_places, mixed = result.damage("D sea", section=(5e-4, 0.04, 2e11), at=[30.0, 12.3])
    assert mixed_places.tolist() == [30.0, 30.0, 12.3]
    assert mixed == pytest.approx([*damage[[left, right]], between[0]], rel=1e-9)
    assert alone_places.tolist() == [30.0, 30.0] and alone == pytest.approx(damage[[left, right]], rel=1e-9)


class Helix:
    """Curvature and tangents of a helix, whose bend turns along the line, on n + 1 points."""

    def __init__(self, n: int) -> None:
        self.s = np.linspace(0.0, 4.0, n + 1)
        self.t = np.stack([-0.6 * np.sin(self.s), 0.6 * np.cos(self.s), 0.8 + 0 * self.s], axis=1)

    def both_sides(self, name: str) -> tuple[np.ndarray, np.ndarray]:
        known = {
            "curvature": 0.6 + 0.0 * self.s, "theta": np.arccos(self.t[:, 2]),
            "phi": np.arctan2(self.t[:, 1], self.t[:, 0]),
        }  # fmt: skip
        return self.s, known[name][None]


def test_axes_of_bends_are_of_second_order_at_ends_too() -> None:
    def errors(n: int) -> np.ndarray:
        line = Helix(n)
        found = bends_of(line, slice(None)).vectors[0]  # type: ignore[arg-type]
        normal = -np.stack([np.cos(line.s), np.sin(line.s), 0.0 * line.s], axis=1)
        return np.linalg.norm(found - 0.6 * np.cross(line.t, normal), axis=1)

    coarse, fine = errors(20), errors(40)
    assert coarse.max() < 0.02
    assert fine[0] < coarse[0] / 3.5 and fine[-1] < coarse[-1] / 3.5 and fine[1:-1].max() < 1e-9


@pytest.fixture
def wide(monkeypatch: pytest.MonkeyPatch) -> None:
    """A terminal in which no line is cut, whatever that of the tests is."""
    monkeypatch.setenv("COLUMNS", "200")


@pytest.mark.needs("rainflow")
def test_the_command_prints_rows(result: hybrid.Result, wide: None, call: Call) -> None:
    """Every figure of the table is in the JSON; a run that is too short for extremes says so once."""
    asked = ["--times", "30:", "--curve", "studless chain T-N", "--strength", "1e6"]
    said = call("stats", str(result.file), "--json", *asked)
    assert not said.code
    rows = said.lines
    tension = next(row for row in rows if row.get("quantity") == "tension")
    column = np.flatnonzero(result.s == tension["s"])[0]
    assert tension["maximum"] == result.tension[result.t >= 30.0, column].max()
    assert rows[-1]["fatigue"]["damage"] > 0.0
    shown = call("stats", str(result.file), "--times", "100:")
    assert "tension (N)" in shown.out and "no MPM in 3 h of" in shown.err
    head = " ".join(shown.out.splitlines()[0].split()), " ".join(shown.out.splitlines()[1].split())
    assert head == ("standard MPM P90", "s (m) mean deviation skewness smallest largest period (s) in 3 h in 3 h")


@pytest.mark.needs("rainflow")
def test_damage_and_fatigue_life_at_chosen_places(result: hybrid.Result, wide: None, call: Call) -> None:
    asked = ["--names", "tension", "--at", "12,48", "--curve", "studless chain T-N", "--strength", "1e6"]
    said = call("stats", str(result.file), "--below", "100", *asked)
    assert not said.code
    lines = said.out.splitlines()
    damage = result.damage("studless chain T-N", strength=1e6, at=[12.0, 48.0])[1]
    part = 100.0 * result.exceedance("tension", below=100.0, at=[12.0, 48.0])
    for s, d, p in zip((12, 48), damage, part, strict=True):
        assert f"tension at s = {s} m is below 100 N for {p:.3g} % of the time" in lines
        text = f"fatigue by studless chain T-N: damage at s = {s} m: {d:.3g} in 130 s; fatigue life not verified: "
        assert any(line.startswith(text) for line in lines)  # its error is not estimated
    facts: dict[str, Any] = {"s": 12.0, "damage": 4e-6, "duration": 130.0, "life": 1.03, "life_not_verified": ""}
    facts["places"] = _fatigue_at(np.array([12.0, 48.0]), np.array([4e-6, 2e-6]), facts)
    assert [x["life"] for x in facts["places"]] == pytest.approx([1.03, 2.06], rel=1e-12)
    assert _fatigue_lines("D sea", facts).splitlines() == [
        "fatigue by D sea: damage at s = 12 m: 4e-06 in 130 s; fatigue life 1.03 years",
        "fatigue by D sea: damage at s = 48 m: 2e-06 in 130 s; fatigue life 2.06 years",
    ]
    most = _fatigue_lines("D sea", facts | {"places": []})
    assert most == "fatigue by D sea: largest damage at s = 12 m: 4e-06 in 130 s; fatigue life 1.03 years"


class Line:
    """A line of 100 m with 1e4 N of tension, as far as extremes of a longer time ask."""

    lines: ClassVar[dict[str, object]] = {}
    s, tension = np.array([0.0, 100.0]), np.array([[1e4, 1e4]])

    def __contains__(self, name: str) -> bool:
        return name == "tension"

    def __getitem__(self, name: str) -> np.ndarray:
        return self.tension


def irregular(size: float, mean: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """A narrow Gaussian process of half an hour, periods about 8 s."""
    rng, t = np.random.default_rng(3), np.arange(0.0, 1800.0, 0.25)
    waves = rng.uniform(0.7, 0.9, 100), rng.uniform(0.0, 2.0 * np.pi, 100)
    return t, mean + size * np.cos(np.outer(t, waves[0]) + waves[1]).sum(axis=1) / np.sqrt(50.0)


@pytest.mark.parametrize(
    ("unit", "size", "mean", "smallest", "why"),
    [
        ("N m", 1.0, 0.0, False, ""), ("N", 100.0, 1e4, True, ""), ("deg", 5.0, 20.0, False, ""),
        ("N m", 1e-15, 0.0, False, "round-off of 1e"), ("N", 1e-9, 1e4, False, "round-off"),
        ("1/m", 1e-16, 0.0, False, "round-off"), ("N m", 1e-10, 1e3, False, "round-off of .* its size"),
        ("deg", 5.0, 165.0, False, "bounded by 180 deg"), ("rad", 0.1, 3.0, False, "bounded by 3.142 rad"),
        ("deg", 2.0, 8.0, True, "bounded by 0 deg"),
    ],
)  # fmt: skip
def test_round_off_and_angles_at_their_bound_are_not_extrapolated(
    unit: str, size: float, mean: float, smallest: bool, why: str
) -> None:
    t, x = irregular(size, mean)
    ask = partial(extreme_of, Line(), "some", unit, t, x, smallest=smallest)  # type: ignore[arg-type]
    if not why:
        found = ask()
        assert (found.most_probable < x.min()) if smallest else (found.most_probable > x.max())
        return
    with pytest.raises(ResultError, match=why):
        ask()


def test_a_regular_motion_has_no_larger_maximum_in_a_longer_time(result: hybrid.Result) -> None:
    with pytest.raises(ResultError, match="peaks are alike"):
        result.extreme("end_force_end", times=(20.0, None))
    row = rows_of(result, ["end_force_end"], times=(20.0, None))[0]
    assert row["extreme"] is None and "alike" in row["no_extreme"]
    t = np.linspace(0.0, 200.0, 2001)
    beating = np.sin(t) * (1.0 + 0.5 * np.sin(0.11 * t))
    assert extreme_of(Line(), "some", "m", t, beating).most_probable > 1.4  # type: ignore[arg-type]


def test_the_former_name_of_the_standard_deviation_is_read() -> None:
    found = moments.summary([0.0, 1.0, 2.0], [0.0, 1.0, 0.0])
    with pytest.warns(DeprecationWarning, match="now standard_deviation"):
        assert found.deviation == found.standard_deviation


def test_exceedance_is_above_or_below(result: hybrid.Result) -> None:
    above, below = (result.exceedance("end_force_end", **{key: 400.0}) for key in ("above", "below"))
    assert float(above) + float(below) == pytest.approx(1.0, abs=1e-12)
    for asked in ({}, {"above": 1.0, "below": 2.0}):
        with pytest.raises(ResultError, match="one of above and below"):
            result.exceedance("end_force_end", **asked)


def test_components_of_vectors_have_rows_of_their_own_at_places() -> None:
    """x, y, z are those of the position; a vector asked for is its three components, at the places asked for."""
    result = reported()
    position, k = np.asarray(result["position"]), [0, int(np.searchsorted(result.s, 50.0))]
    rows = rows_of(result, ["position", "z", "position.x"], [0.0, 50.0])
    names = ["position.x", "position.y", "position.z", "z", "position.x"]
    assert [(x["quantity"], x["s"]) for x in rows] == [(name, s) for name in names for s in (0.0, 50.0)]
    for row in rows:
        axis, at = "xyz".index(row["quantity"][-1]), k[int(row["s"] > 0.0)]
        assert (row["minimum"], row["maximum"]) == (position[:, at, axis].min(), position[:, at, axis].max())
    (mean,) = rows_of(result, ["z"])
    assert mean["maximum"] == position[..., 2].max()
    both = result.statistics(["position"], at=[25.3, 50.0])["position"]
    assert np.shape(both.mean) == (2, 3)
    between = result.at(s=25.3, names=["position"])["position"]
    assert history_of(result, "z", at=[25.3]).values[:, 0] == pytest.approx(between[:, 2])
    for name in ("w", "tension.z", "position.w"):
        with pytest.raises(ResultError, match=name):
            rows_of(result, [name])
    with pytest.raises(ResultError, match=r"3 values at a time[\s\S]*position\.x"):
        result.extreme("position", at=50.0)


def test_an_equilibrium_has_values_at_places(tmp_path: Any, call: Call) -> None:
    """A place between two output points too; the command says that they are no statistics."""
    tables = {key: value for key, value in SCENE.items() if key != "time"}
    result = hybrid.static(hybrid.validate_scene(tables), tmp_path / "rest.h5")
    rows = values_of(result, ["curvature", "z", "reaction_start"], [0.0, 12.3])
    places = [x["s"] for x in rows if x["quantity"] == "curvature"]
    assert places == [0.0, 12.3] and [x["quantity"] for x in rows[-3:]] == [f"reaction_start.{x}" for x in "xyz"]
    wanted = {name: result.at(s=12.3, names=[name])[name][0] for name in ("curvature", "position")}
    found = {x["quantity"]: x["value"] for x in rows if x["s"] == 12.3}
    assert found == {"curvature": pytest.approx(wanted["curvature"]), "z": pytest.approx(wanted["position"][2])}
    (largest,) = values_of(result, ["tension"])
    assert largest["value"] == result["tension"].max()
    told = call("stats", "rest.h5", "--names", "curvature", "--at", "12.3")
    assert not told.code and f"{wanted['curvature']:.5g}" in told.out and "equilibrium" in told.out + told.err


# A fatigue life with the errors of what it rests on: ranges that are off by a part change it by that to the slope.


CURVE = {"kind": "S-N", "log_a": 12.0, "m": 3.0}
T, S = np.linspace(0.0, 100.0, 2001), np.array([0.0, 5.0, 10.0])
SECTION = (1e-3, 0.1, 2e11)
HISTORY = SimpleNamespace(t=T, values=1e4 + np.sin(2 * np.pi * T / 10.0)[:, None])


class Seen:
    """A result whose curvature swings by 1e-3 1/m at 5 m, known to `error`; its tension is steady."""

    times, s = T, S

    def __init__(self, error: float) -> None:
        swing = np.sin(2 * np.pi * T / 10.0)[:, None] * np.array([0.1, 1.0, 0.2]) * 1e-3
        self._values: dict[str, Any] = {
            "curvature": swing, "tension": 1e4 + 1e-6 * swing, "errors/total/tension": 0.0 * swing,
            "errors/total/curvature": np.full(swing.shape, error),
        }  # fmt: skip

    def __contains__(self, name: str) -> bool:
        return name in self._values

    def __getitem__(self, name: str) -> Any:
        return self._values[name]

    def damage(self, curve: Any, *, strength: Any, section: Any, times: Any, at: Any) -> Any:
        """Of bending stresses alone, in MPa."""
        k = [int(np.abs(S - x).argmin()) for x in at]
        return np.array(at), damage(self["curvature"][:, k], curve, section[2] * section[1] / 2.0 / 1e6)


def within(error: float, monkeypatch: pytest.MonkeyPatch) -> tuple[dict[str, Any], float]:
    monkeypatch.setattr(tables, "history_of", lambda *_: HISTORY)
    seen: Any = Seen(error)
    done = float(seen.damage(CURVE, strength=None, section=SECTION, times=None, at=[5.0])[1][0])
    facts = {"s": 5.0, "damage": done, "life": 2.0}
    return tables.life_within(seen, facts, CURVE, None, SECTION, None), done


@pytest.mark.needs("rainflow")
def test_ranges_that_are_off_change_the_life_by_their_third_power(monkeypatch: pytest.MonkeyPatch) -> None:
    part = 0.1
    found, done = within(part * 1e-3 / np.sqrt(2.0), monkeypatch)
    assert done > 0.0
    assert found["life_least"] == pytest.approx(2.0 / (1.0 + part) ** 3, rel=1e-3)
    assert found["life_most"] == pytest.approx(2.0 / (1.0 - part) ** 3, rel=1e-3)


@pytest.mark.needs("rainflow")
def test_an_error_as_large_as_what_varies_leaves_no_life(monkeypatch: pytest.MonkeyPatch) -> None:
    found, _ = within(1e-3, monkeypatch)
    assert found["life"] is None and "smaller accuracy of curvature" in found["life_not_verified"]


def test_an_error_of_a_tension_that_hardly_varies_counts_by_its_stress(monkeypatch: pytest.MonkeyPatch) -> None:
    """10 N on 1e-3 m^2 are 0.01 MPa, where bending swings by 7 MPa in the root mean square."""
    monkeypatch.setattr(tables, "history_of", lambda *_: HISTORY)
    seen: Any = Seen(0.0)
    seen._values["errors/total/tension"] = np.full((T.size, S.size), 10.0)
    swing = 0.5 * SECTION[2] * SECTION[1] * 1e-3 / np.sqrt(2.0)
    part = tables.part_off(seen, 5.0, None, SECTION)
    assert part == pytest.approx(10.0 / SECTION[0] / swing, rel=1e-3) and part < 0.01
    assert tables.part_off(seen, 5.0, None, None) > 1.0  # of tension alone nothing is known


def test_outputs_that_miss_crests_leave_no_life(monkeypatch: pytest.MonkeyPatch) -> None:
    """A sine with so many outputs to a period."""
    for n, doubted in ((2.7, True), (5.3, True), (6.7, False), (20.0, False)):
        t = np.arange(0.0, 1000.0, 10.0 / n)
        history = SimpleNamespace(t=t, values=1e4 + np.sin(2 * np.pi * t / 10.0)[:, None])
        monkeypatch.setattr(tables, "history_of", lambda *_, history=history: history)
        seen: Any = Seen(0.0)
        why = tables.too_far_apart(seen, 5.0, None)
        assert bool(why) is doubted
        if doubted:
            facts = {"s": 5.0, "damage": 1e-6, "life": 2.0}
            found = tables.life_within(seen, facts, CURVE, None, SECTION, None)
            assert found == {"life": None, "life_not_verified": why}
            assert f"{n:.2g} outputs to a cycle" in why and why.endswith("output.every: 1")
