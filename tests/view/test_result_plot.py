"""Plots show what is in the file: labels, units, curves, warnings; and leave no state behind."""

from __future__ import annotations

import io
import os
import subprocess
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

import hybrid
from hybrid.errors import ResultError
from hybrid.store.format import Field, Header
from hybrid.store.reader import Result, open_result
from hybrid.store.writer import Recorder
from hybrid.view import figure as look
from hybrid.view import panels
from hybrid.view import projections as views
from hybrid.view import quantities as plot
from hybrid.view.curves import stretches_of
from hybrid.view.figure import Axis, Line, Panel
from hybrid.view.matplotlib_backend import draw_panel, new_axes

MIXED = [("catenary", 0.0, 75.0), ("rod", 75.0, 100.0)]


def made(
    position: Callable[[np.ndarray, float], Sequence[Any]],
    *,
    nt: int = 12,
    zones: Callable[[float], list[tuple[str, float, float]]] = lambda t: MIXED,
    torque: float = 0.0,
    tension: float = 2.0e4,
    moment: bool = True,
    status: str = "complete",
    message: str = "",
    title: str = "Made-up mooring",
    curvature: float = 0.0,
    events: Sequence[tuple[float, str, str]] = (),
    bed: Sequence[float] | None = None,
    surface: float | None = None,
    attached: Sequence[float] = (),
) -> Result:
    """A result on 0 <= s <= 100 m and 0 <= t <= 10 s with a given shape and plausible forces.

    bed: what is not above the plane n . x = c, given as (n, c), touches it.
    """
    s = np.linspace(0.0, 100.0, 41)
    fixed: list[tuple[Field, np.ndarray]] = []
    if bed is not None:
        fixed.append((Field("seabed", "", "d", (4,), ("plane",), "inertial"), np.array(bed)))
    if surface is not None:
        fixed.append((Field("surface", "m", "d"), np.array(surface)))
    if attached:
        fixed.append((Field("attached", "m", "d", (len(attached),), ("attached",)), np.array(attached)))
    names = [("tension", "N"), ("curvature", "1/m"), ("theta", "rad")] + [("bending_moment", "N m")] * moment
    fields = [Field(n, u, "d", (41,), ("s",)) for n, u in [*names, ("torque", "N m")]]
    fields.append(Field("position", "m", "d", (41, 3), ("s", "xyz"), "inertial"))
    if bed is not None:
        fields.append(Field("contact", "N/m", "d", (41,), ("s",)))
        fields.append(Field("touchdown", "m", "d", (2,), ("edge",), nan_ok=True))
        fields.append(Field("touchdown_position", "m", "d", (2, 3), ("edge", "xyz"), "inertial", nan_ok=True))
    memory = io.BytesIO()
    recorder = Recorder(memory, Header(s, fields, [], {"title": title}, fixed=fixed), outputs=nt)
    for t in np.linspace(0.0, 10.0, nt):
        values = {
            "position": np.stack([np.broadcast_to(x, s.shape) for x in position(s, t)], axis=1),
            "tension": tension * (1.0 + 0.1 * np.sin(t)) * (1.0 + s / 200.0),
            "curvature": 2e-3 * np.exp(-((s - 80.0) ** 2) / 100.0) + curvature * (t < 1.0) * (s > 97.0),
            "theta": s / 200.0,
            "torque": torque + 0.0 * s,
        }
        if moment:
            values["bending_moment"] = np.where(s > 75.0, 3.0 + np.sin(t), 0.0)
        if bed is not None:
            lies = values["position"] @ bed[:3] <= bed[3] + 1e-9
            edges = np.flatnonzero(lies)[[0, -1]] if lies.any() else None
            values["contact"] = np.where(lies, 180.0, 0.0)
            values["touchdown"] = np.full(2, np.nan) if edges is None else s[edges]
            values["touchdown_position"] = np.full((2, 3), np.nan) if edges is None else values["position"][edges]
        recorder.save(float(t), values, zones(float(t)))
    for t, kind, text in events:
        recorder.event(t, 0.0, 100.0, kind, text)
    recorder.close(status, message)
    return open_result(memory)


def sag(s: np.ndarray, t: float) -> Sequence[Any]:
    return 0.9 * s, 0.0, 30.0 * ((s / 50.0 - 1.0) ** 2 - 1.0) * (1.0 + 0.1 * np.sin(t))


def image(figure: Figure) -> np.ndarray:
    canvas = figure.canvas
    assert isinstance(canvas, FigureCanvasAgg)
    canvas.draw()
    return np.asarray(canvas.buffer_rgba())


def texts(figure: Figure) -> str:
    axes = figure.axes
    return "\n".join(
        [t.get_text() for t in figure.texts]
        + [t.get_text() for ax in axes for t in ax.texts]
        + [ax.get_title("left") + ax.get_title("right") for ax in axes]
        + [f"{ax.get_xlabel()} | {ax.get_ylabel()}" for ax in axes]
        + [t.get_text() for legend in figure.legends for t in legend.get_texts()]
    )


def test_a_summary_shows_shape_profiles_and_histories(tmp_path: Path) -> None:
    result = made(sag, zones=lambda t: [("rod", 0.0, 100.0)] if t < 5 else MIXED)
    figure = plot.plot_summary(result, tmp_path / "page.png")
    shape, tension, moment, h_tension, h_position = _panels(figure)
    assert [a.get_xlabel() for a in (shape, moment, h_tension)] == ["x (m)", "s (m)", "t (s)"]
    assert (shape.get_ylabel(), tension.get_ylabel()) == ("z (m)", "tension (kN)")
    assert (moment.get_ylabel(), moment.get_title("left")) == ("|moment| (N m)", "|bending moment| at t = 10 s")
    assert h_position.get_ylabel() == "Δz (m)" and h_tension.get_ylabel() == "tension (kN)"
    assert shape.get_aspect() == 1.0
    kinds = [line for line in shape.lines if line.get_label() in ("rod", "catenary")]
    assert [line.get_label() for line in kinds] == ["catenary", "rod"] and kinds[0].get_color() != kinds[1].get_color()
    assert kinds[0].get_xdata()[-1] == kinds[1].get_xdata()[0] == pytest.approx(67.5)  # at the joint itself
    assert len(_earlier(shape)) == 9
    assert tension.lines[0].get_ydata() == pytest.approx(result.tension[-1] / 1e3)
    assert len(tension.collections) == 1 and len(tension.patches) == 2  # the range over time; two shaded zones
    curves = [line for line in h_tension.lines if line.get_label().startswith("s = ")]
    assert [line.get_label() for line in curves] == ["s = 25 m", "s = 50 m", "s = 75 m"]  # the ends are held
    assert curves[1].get_ydata() == pytest.approx(result.tension[:, 20] / 1e3)
    assert len(h_tension.lines) == 4  # and where the zones changed
    text = texts(figure)
    for part in (
        "Made-up mooring",
        "12 outputs",
        "joint",
        "start",
        "end",
        "earlier shapes at t = 0, ",
        "range over time",
        "zones changed",
        "catenary 0 … 75 m, rod 75 … 100 m",
        "s = 50 m",
    ):
        assert part in text
    assert "torque" not in text
    pixels = image(figure)
    assert pixels.shape == (900, 1200, 4) and (tmp_path / "page.png").stat().st_size > 20_000
    for ax in figure.axes:  # something is drawn in every panel
        x0, y0, x1, y1 = ax.get_window_extent().extents.astype(int)
        assert pixels[900 - y1 : 900 - y0, x0:x1, :3].std() > 3.0


def _panels(figure: Figure) -> list[Any]:
    by_name = {ax.get_label(): ax for ax in figure.axes}
    return [by_name[k] for k in "spPhH"]


def _earlier(shape: Any) -> list[Any]:
    return [line for line in shape.lines if line.get_linewidth() == 0.7]


def test_torque_is_drawn_when_there_is_some() -> None:
    moment = _panels(plot.plot_summary(made(sag, torque=-0.5)))[2]
    assert [line.get_label() for line in moment.lines[:2]] == ["|bending moment|", "torque"]
    assert (moment.get_title("left"), moment.get_ylabel()) == ("|moment| at t = 10 s", "|moment|,\ntorque (N m)")


def test_statics_show_curvature_and_tangent_in_place_of_histories() -> None:
    figure = plot.plot_summary(made(sag, nt=1, tension=0.02))
    text = texts(figure)
    for part in ("static", "curvature (1/km)", "angle to z (°)", "tension (mN)"):
        assert part in text
    assert "t (s)" not in text and "range over time" not in text and "t = " not in text
    assert_tidy(figure)


def test_a_catenary_shows_its_curvature_in_place_of_a_moment() -> None:
    all_catenary = [("catenary", 0.0, 100.0)]
    for moment in (True, False):
        figure = plot.plot_summary(made(sag, zones=lambda t: all_catenary, moment=moment))
        panel = _panels(figure)[2]
        assert panel.get_title("left") == "curvature at t = 10 s" and panel.get_ylabel() == "curvature (1/km)"
        assert "moment" not in texts(figure) and "joint" not in texts(figure)
    statics = plot.plot_summary(made(sag, nt=1, zones=lambda t: all_catenary))
    titles = [ax.get_title("left") for ax in _panels(statics)]
    assert titles == ["shape", "tension", "curvature", "angle to z", "position z"]  # no panel empty or twice
    assert "curvature" in texts(plot.plot_summary(made(sag, moment=False)))  # a rod whose moment was not recorded


def test_a_passing_spike_does_not_press_the_rest_to_the_ground() -> None:
    ax = Figure().subplots()
    draw_panel(panels.profiles(made(sag, curvature=5.0), "curvature"), ax)
    assert 2e-3 < ax.get_ylim()[1] < 0.01 and ax.get_ylim()[0] > -0.01
    assert [t.get_text() for t in ax.texts] == ["peak 5 1/m at s = 97.5 m"]


def test_an_error_far_beyond_a_curve_is_said_and_leaves_the_curve_its_room(monkeypatch: pytest.MonkeyPatch) -> None:
    """Curvature of 2 1/km at most, whose error is 400 1/km at one place and small elsewhere."""
    monkeypatch.setattr(
        panels, "_error_along", lambda _, __, found: np.where(found.s == 50.0, 0.4, 1e-4) + 0 * found.values
    )
    ax = Figure().subplots()
    draw_panel(panels.profiles(made(sag), "curvature"), ax)
    assert ax.get_ylim() == pytest.approx((-0.2, 4.0), abs=0.1)
    assert [t.get_text() for t in ax.texts] == ["error up to 400 1/km at s = 50 m"]
    monkeypatch.setattr(panels, "_error_along", lambda _, __, found: 1e-3 + 0 * found.values)
    draw_panel(panels.profiles(made(sag), "curvature"), ax := Figure().subplots())
    assert not ax.texts and ax.get_ylim()[1] < 4.0


def relaxing(s: np.ndarray, t: float) -> Sequence[Any]:
    return s, 0.0, 30.0 * np.sin(np.pi * s / 100.0) * np.exp(-3.0 * t)


def swinging(s: np.ndarray, t: float) -> Sequence[Any]:
    """Its period is 10 s / 9: the nine shapes that are even in time, or in distance, are all the same."""
    angle = 0.5 * np.sin(2.0 * np.pi * 0.9 * t)
    return s * np.sin(angle), 0.0, -s * np.cos(angle)


def test_earlier_shapes_show_the_motion() -> None:
    times = views.telling_times(made(relaxing, nt=401))
    assert len(times) == 9 and times[0] == 0.0 and times.max() < 1.5
    left = np.sort(np.exp(-3.0 * times))
    assert np.diff(left).max() < 0.26  # nothing much is left out; even times miss 98 % of it
    times = views.telling_times(made(swinging, nt=181))
    phase = np.sort(np.sin(2.0 * np.pi * 0.9 * times))
    assert phase[0] < -0.98 and phase[-1] > 0.98 and np.diff(phase).max() < 0.51
    still = plot.plot_summary(made(lambda s, t: (s, 0.0, 0.0)))
    assert "earlier shapes" not in texts(still) and _earlier(_panels(still)[0]) == []


def test_the_area_that_was_swept_is_shaded() -> None:
    ax = Figure().subplots()
    draw_panel(panels.shape(made(swinging, nt=181), times=[]), ax)
    (area,) = (c for c in ax.collections if c.get_label() == "range over time")
    tips = np.array([path.vertices[40] for path in area.get_paths()])
    assert np.ptp(tips[:, 0]) == pytest.approx(2 * 100.0 * np.sin(0.5), rel=0.02)


@pytest.mark.long
def test_the_table_of_pages_tells_what_room_they_leave(monkeypatch: pytest.MonkeyPatch) -> None:
    bowed = CASES["bowed"][0]
    for name, position, bed in (
        ("_ONE_VIEW", sag, None),
        ("_TWO_VIEWS", bowed, None),
        ("_ONE_VIEW_BED", sag, (0.0, 0.0, 1.0, -30.0)),
        ("_TWO_VIEWS_BED", bowed, (0.0, 0.0, 1.0, -30.0)),
    ):
        result = made(position, nt=3, bed=bed)
        for page in {str(page[0]): page for page in getattr(plot, name)}.values():  # every kind, not every width
            monkeypatch.setattr(plot, name, [page])
            figure = plot.plot_summary(result)
            figure.get_layout_engine().execute(figure)
            for ax in figure.axes:
                width, height = ax.bbox.size / figure.dpi
                if ax.get_label() in "sS":
                    # 4 %: the numbers have two digits, and tick labels differ in width
                    assert width / height == pytest.approx(page[3], rel=0.04), page
                assert width > 1.2 and height > 0.75  # inches; smaller is not legible
            monkeypatch.undo()


@pytest.mark.parametrize("ratio", [0.02, 0.8, 2.7, 30.0])
def test_the_shape_fills_its_panel(ratio: float) -> None:
    """Whatever its proportions, to scale or magnified; to 1 %, since the limits, when set, move the tick labels."""
    up = 100.0 / max(ratio, 1.0)
    result = made(lambda s, t: (0.5 * ratio * up * np.cos(s / 16), 0.0, 0.5 * up * np.sin(s / 16)), nt=2)
    figure = plot.plot_summary(result)
    figure.draw_without_rendering()
    ax = _panels(figure)[0]
    area = np.prod(
        [np.ptp(result.position[..., k]) / np.ptp(lim) for k, lim in ((0, ax.get_xlim()), (2, ax.get_ylim()))]
    )
    assert area > 0.5  # 0.8 is what the margins leave of a perfect fit
    scale = ax.transData.transform([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
    across, tall = scale[1, 0] - scale[0, 0], scale[2, 1] - scale[0, 1]
    title = ax.get_title("left")
    said = float(title.split(" × ")[1]) if " × " in title else 1.0
    assert max(across, tall) / min(across, tall) == pytest.approx(said, rel=0.01)
    assert (said > 1.0) == (ratio < 0.08 or ratio > 1 / 0.08)


def test_a_small_sway_across_a_sagging_line_is_shown() -> None:
    """1 m in 90 m, out of the plane of a sag of 30 m: below 2 % of the extent, but all that moves."""
    figure = plot.plot_summary(made(lambda s, t: (0.9 * s, 0.5 * np.sin(s / 32) * np.sin(t), sag(s, 1.57)[2]), nt=21))
    by_name = {ax.get_label(): ax for ax in figure.axes}
    assert by_name["s"].get_title("left") == "shape at t = 10 s"
    above = by_name["S"]
    assert above.get_title("left") == "shape from above at t = 10 s, y × 20"
    figure.draw_without_rendering()
    assert 1.0 / np.ptp(above.get_ylim()) > 0.5


def moored(s: np.ndarray, t: float) -> Sequence[Any]:
    """From an anchor at s = 0 along the bed at z = -40, up to the surface, and back and forth."""
    down = 40.0 + 5.0 * np.sin(t)
    above = np.maximum(s - down, 0.0)
    return s - 0.004 * above**2, 0.0, -40.0 + 40.0 * (above / (100.0 - down)) ** 2


FLAT, HIGH_UP = (0.0, 0.0, 1.0, -40.0), (0.0, 0.0, 1.0, -400.0)


def _sea(ax: Any) -> list[str]:
    """Names written on the planes of the sea that an Axes shows, from the top."""
    return [t.get_text() for t in ax.texts]


def _planes(ax: Any) -> list[np.ndarray]:
    """Corners of water and sand, whose rims are lines."""
    areas = [c.get_paths() for c in ax.collections if type(c).__name__ == "PolyCollection"]
    return [paths[0].vertices[:4] for paths in areas if len(paths) == 1]


def _by_name(figure: Figure) -> dict[str, Any]:
    return {ax.get_label(): ax for ax in figure.axes}


def test_the_sea_is_drawn_as_far_as_the_file_has_it() -> None:
    figure = plot.plot_summary(made(moored, nt=41, bed=FLAT, surface=0.0, attached=[70.0, 100.0]))
    axes = _by_name(figure)
    assert set(axes) == set("spPchTH")
    shape = axes["s"]
    assert _sea(shape) == ["still water", "seabed"]
    assert [plane[:2, 1].tolist() for plane in _planes(shape)] == [[0, 0], [-40, -40]]
    rims = {line.get_color(): line.get_ydata().tolist() for line in shape.lines if line.get_linewidth() == 0.9}
    assert rims == {look.LEVEL: [0, 0], look.BED: [-40, -40]}
    marks = {line.get_label(): line for line in shape.lines}
    assert marks["touchdown"].get_xydata() == pytest.approx(np.array([[35.0, -40.0]]))  # its other edge is the anchor
    assert marks["float, clump, body"].get_xdata()[1] == pytest.approx(moored(np.array([100.0]), 10.0)[0][0])
    assert shape.get_ylim()[0] < -42.0 and shape.get_ylim()[1] > 0.5 and shape.get_aspect() == 1.0
    assert (axes["c"].get_title("left"), axes["c"].get_ylabel()) == ("contact force at t = 10 s", "contact (N/m)")
    assert len([line for line in axes["c"].lines if line.get_linewidth() == 0.7]) == 9  # at the times of the shapes
    touchdown = axes["T"]
    (line,) = touchdown.lines
    assert (touchdown.get_title("left"), touchdown.get_xlabel()) == ("touchdown over time", "t (s)")
    assert line.get_ydata() == pytest.approx(made(moored, nt=41, bed=FLAT)["touchdown"][:, 1])
    assert touchdown.get_ylim()[0] > 30.0  # the sand below the line does not reach down to the anchor
    text = texts(figure)
    for part in ("touchdown", "float, clump, body", "s = 0 m", "s = 100 m"):  # both ends are followed
        assert part in text
    assert_tidy(figure)


def test_without_a_sea_there_is_none() -> None:
    figure = plot.plot_summary(made(sag))
    assert set(_by_name(figure)) == set("spPhH")
    assert _planes(_by_name(figure)["s"]) == [] and all(_sea(ax) == [] for ax in figure.axes)
    for part in ("touchdown", "contact", "seabed", "water", "float"):
        assert part not in texts(figure)


def test_a_bed_that_is_never_touched_is_a_bed_only() -> None:
    figure = plot.plot_summary(made(sag, bed=(0.0, 0.0, 1.0, -36.0)))
    shape = _by_name(figure)["s"]
    assert set(_by_name(figure)) == set("spPhH") and _sea(shape) == ["seabed"]
    assert shape.get_ylim()[0] < -38.0 and "touchdown" not in texts(figure)
    deep = _by_name(plot.plot_summary(made(sag, bed=HIGH_UP)))["s"]
    assert deep.get_ylim()[0] > -100.0  # one that is far away does not make the cable small
    assert_tidy(figure)


def test_a_cable_that_lifts_off_and_comes_back_leaves_a_gap() -> None:
    ax = Figure().subplots()

    def height(s: np.ndarray) -> np.ndarray:
        return -40.0 + 0.01 * np.maximum(s - 20.0, 0.0) ** 2

    result = made(lambda s, t: (s, 0.0, height(s) + 3.0 * (2.0 < t < 6.0)), nt=41, bed=FLAT)
    draw_panel(panels.touchdown(result), ax)
    (line,) = ax.lines
    assert np.array_equal(np.isnan(line.get_ydata()), (result.times > 2.0) & (result.times < 6.0))
    both = Figure().subplots()
    draw_panel(panels.touchdown(made(lambda s, t: (s, 0.0, height(abs(s - 50.0))), bed=FLAT)), both)
    assert [line.get_label() for line in both.lines] == ["first contact", "last contact"]


@pytest.mark.parametrize("turn", [0.0, 0.7])
def test_a_sloping_bed_passes_under_the_cable(turn: float) -> None:
    """Seen in its plane, whatever that is; the bed also falls across it."""
    normal = np.array([0.1, -0.2, 1.0]) / np.sqrt(1.05)

    def lying(s: np.ndarray, t: float) -> Sequence[Any]:
        x, y = 5.0 + 0.8 * s * np.cos(turn), 9.0 + 0.8 * s * np.sin(turn)
        return x, y, -40.0 - 0.1 * x + 0.2 * y + 0.01 * np.maximum(s - 40.0 - t, 0.0) ** 2

    figure = plot.plot_summary(made(lying, nt=5, bed=(*normal, -40.0 * normal[2]), surface=0.0))
    shape = _by_name(figure)["s"]
    bed = _planes(shape)[-1][:2]
    (cable,) = (line for line in shape.lines if line.get_label() == "catenary")
    across, up = cable.get_xdata()[:15], cable.get_ydata()[:15]  # up to s = 35 m it lies
    assert np.interp(across, bed[:, 0], bed[:, 1]) == pytest.approx(up, abs=1e-9)
    assert_tidy(figure)


def test_what_lies_on_a_bed_is_also_seen_from_above() -> None:
    """Deeper than it is long, yet the side views alone would hide how it lies."""

    def bight(s: np.ndarray, t: float) -> Sequence[Any]:
        lies = np.minimum(s, 40.0)
        return 12.0 * np.sin(lies / 13.0), 12.0 * (1.0 - np.cos(lies / 13.0)), np.maximum(s - 40.0, 0.0) - 60.0

    figure = plot.plot_summary(made(bight, nt=3, bed=(0.0, 0.0, 1.0, -60.0), torque=-0.5))
    axes = _by_name(figure)
    assert axes["s"].get_ylabel() == "z (m)" and axes["S"].get_title("left") == "shape from above at t = 10 s"
    assert _sea(axes["s"]) == ["seabed"] and _sea(axes["S"]) == []
    assert_tidy(figure)


def test_statics_on_a_bed_fill_all_panels() -> None:
    figure = plot.plot_summary(made(moored, nt=1, bed=FLAT))
    titles = [_by_name(figure)[k].get_title("left") for k in "pPchTH"]
    assert titles == ["tension", "|bending moment|", "contact force", "curvature", "angle to z", "position z"]
    assert_tidy(figure)


def test_zones_of_one_kind_are_one() -> None:
    cut = made(sag, zones=lambda t: [("rod", 0.0, 40.0), ("rod", 40.0, 60.0), ("catenary", 60.0, 100.0)])
    figure = plot.plot_summary(cut)
    (joint,) = (line for line in _by_name(figure)["s"].lines if line.get_label() == "joint")
    assert joint.get_xdata() == pytest.approx([54.0])
    assert "; rod 0 … 60 m, catenary 60 … 100 m;" in texts(figure)


def test_what_stands_still_is_a_straight_line_of_histories() -> None:
    ax = Figure().subplots()
    draw_panel(panels.history(made(lambda s, t: (s, 0.0, 1e-10 * np.sin(t))), "position", [50.0], component=2), ax)
    assert ax.get_ylim() == pytest.approx((-0.1, 0.1)) and ax.get_ylabel() == "Δz (mm)"


EVENTS = [
    (0.0, "end rotated in", "the tangent is missed by $30$ deg"),
    (3.0, "slack", "tension -1 N: " + "what follows is grid noise " * 9),
    (2.0, "slack", "tension -0.1 N\n in a catenary zone " + "and so on " * 30),
    (1.0, "rod", "of no concern"),
]


def test_warnings_are_mentioned_in_two_lines_the_worst_first() -> None:
    figure = plot.plot_summary(made(sag, events=EVENTS, title="Costs $1 or $2 " * 20))
    (lines,) = [t for t in figure.texts if t.get_text().startswith("Warning")]
    assert lines.get_text().startswith("Warning: slack (× 2); at t = 2 s: tension -0.1 N in a catenary zone and so")
    assert lines.get_text().count("\n") == 1 and lines.get_text().endswith(" …") and lines.get_color() == "#C00000"
    assert_tidy(figure)
    assert min(k.get_window_extent().y0 for k in figure.legends) - lines.get_window_extent().y1 > 6  # pixels
    assert "Note" not in texts(plot.plot_summary(made(sag, nt=0, events=EVENTS[3:])))


def test_news_are_no_alarm() -> None:
    why = "the tangent is missed by $30$ deg"
    for more in ("", " and is turned in over the first second or so; start from an equilibrium to avoid this" * 2):
        figure = plot.plot_summary(made(sag, nt=0, events=[(0.0, "end rotated in", why + more), *EVENTS[3:]]))
        (note,) = [t for t in figure.texts if t.get_text().startswith("Note")]
        assert note.get_text().replace("\n", " ") == f"Note: {why}{more}" and note.get_color() == "#6E6E6E"
        assert note.get_text().count("\n") == bool(more)
        box = note.get_window_extent()
        assert box.x1 < 1200 and box.y0 > 0


def blown(s: np.ndarray, t: float) -> Sequence[Any]:
    """A span of 90 m that rises by 10 m, sags by 2 m and is blown out by 1 m."""
    bow = np.sin(np.pi * s / 100.0)
    return 0.9 * s, 1.0 * bow, 0.1 * s - 2.0 * bow


def test_what_is_across_a_span_is_compared_with_its_sag_not_with_its_length() -> None:
    figure = plot.plot_summary(made(blown, nt=1, zones=lambda t: [("catenary", 0.0, 100.0)]))
    above = {ax.get_label(): ax for ax in figure.axes}["S"]
    assert (above.get_ylabel(), above.get_title("left")) == ("y (m)", "shape from above, y × 20")
    assert "position y" in texts(figure) and "position z" not in texts(figure)
    still = Figure().subplots()
    draw_panel(panels.shape(made(blown)), still)
    assert still.get_legend_handles_labels()[1] == ["catenary", "rod", "start", "end", "joint"]  # no range over time
    slight = made(lambda s, t: (blown(s, t)[0], 0.05 * blown(s, t)[1], blown(s, t)[2]))
    assert len(views.views_of(slight)) == 1
    turned = made(lambda s, t: (0.6 * s - blown(s, t)[1], 0.6 * s + blown(s, t)[1], blown(s, t)[2]))
    assert [v.up_label for v in views.views_of(turned)] == ["z", "across"]  # from above it is a line at 45 degrees
    assert views.views_of(turned)[0].across_label == "horizontal, 45° from x"


@pytest.mark.parametrize(
    "position, followed",
    [
        (lambda s, t: (s, 0.0, s * (100.0 - s) * t), [25.0, 50.0, 75.0]),
        (lambda s, t: (s, 0.0, s * t), [25.0, 50.0, 100.0]),
        (lambda s, t: (s, 0.0, (100.0 - s) * t), [0.0, 50.0, 75.0]),
        (lambda s, t: (s, 0.0, t), [0.0, 50.0, 100.0]),
        (lambda s, t: (s, 0.0, 0.0), [25.0, 50.0, 75.0]),
    ],
)
def test_a_held_end_is_not_followed(position: Callable[[np.ndarray, float], Sequence[Any]], followed: Any) -> None:
    assert views.history_points(made(position), None).tolist() == followed


def assert_tidy(figure: Figure) -> None:
    """Nothing leaves the page, and no panel, legend or line of text lies on another."""
    figure.draw_without_rendering()
    boxes = {f"panel {ax.get_label()}": ax.get_tightbbox() for ax in figure.axes}
    boxes |= {f"legend {k}": legend.get_window_extent() for k, legend in enumerate(figure.legends)}
    boxes |= {t.get_text()[:20]: t.get_window_extent() for t in figure.texts}
    for name, box in boxes.items():
        assert box.x0 > 0 and box.y0 > 0 and box.x1 < 1200 and box.y1 < 900, (name, box)
        for other, there in boxes.items():
            # 3 pixels: the empty rims of letters and legends
            apart = max(box.x0 - there.x1, there.x0 - box.x1, box.y0 - there.y1, there.y0 - box.y1)
            assert name == other or apart > -3, (name, other, apart)


@pytest.mark.parametrize(
    "status, message, shown",
    [("interrupted", "stopped by the user", "interrupted: stopped by the user"), ("running", "", "or still running")],
)
def test_an_incomplete_run_is_marked_in_red(status: str, message: str, shown: str) -> None:
    figure = plot.plot_summary(made(sag, status=status, message=message))
    (warning,) = [t for t in figure.texts if shown in t.get_text()]
    assert warning.get_color() == "#C00000"


def test_nothing_saved_still_gives_a_page() -> None:
    figure = plot.plot_summary(made(sag, nt=0, status="failed", message="singular at t = 0 s"))
    assert "no output was saved" in texts(figure) and "singular" in texts(figure)
    image(figure)


CASES: dict[str, tuple[Callable[[np.ndarray, float], Sequence[Any]], list[tuple[str, str]], str]] = {
    "in x-z": (sag, [("x (m)", "z (m)")], ""),
    "in y-z": (lambda s, t: (0.0, *sag(s, t)[::2]), [("y (m)", "z (m)")], ""),
    "level": (lambda s, t: (*sag(s, t)[::2], -5.0), [("x (m)", "y (m)")], "shape from above at"),
    "oblique": (
        lambda s, t: (0.8 * sag(s, t)[0], 0.6 * sag(s, t)[0], sag(s, t)[2]),
        [("horizontal, 36.9° from x (m)", "z (m)")],
        "shape at",
    ),
    "helix": (
        lambda s, t: (3 * np.cos(s / 5), 3 * np.sin(s / 5), -0.8 * s),
        [("x (m)", "z (m)"), ("y (m)", "z (m)")],
        "",
    ),
    "bowed": (
        lambda s, t: (0.9 * s, 20 * np.sin(s / 32 + t), sag(s, t)[2]),
        [("x (m)", "z (m)"), ("x (m)", "y (m)")],
        "shape from above at",
    ),
    "nearly straight": (lambda s, t: (0.3 * np.sin(s / 32) * np.cos(t), 0.0, -s), [("x (m)", "z (m)")], "x × 50"),
    "sideways": (lambda s, t: (0.01 * np.sin(s / 32), 0.9 * np.sin(s / 32), -s), [("y (m)", "z (m)")], "y × 30"),
    "straight": (lambda s, t: (s, 0.0, 0.0), [("x (m)", "z (m)")], ""),
}


@pytest.mark.long
@pytest.mark.parametrize("case", CASES)
def test_the_plane_suits_the_shape(case: str) -> None:
    position, labels, title = CASES[case]
    many = [
        ("rod", 0.0, 5.0),
        ("catenary", 5.0, 60.0),
        ("rod", 60.0, 70.0),
        ("catenary", 70.0, 90.0),
        ("rod", 90.0, 100.0),
    ]
    figure = plot.plot_summary(
        made(position, nt=3, torque=-0.5, zones=lambda t: many if t > 0 else MIXED, events=EVENTS)
    )
    shapes = [ax for ax in figure.axes if ax.get_label() in "sS"]
    assert [(ax.get_xlabel(), ax.get_ylabel()) for ax in shapes] == labels
    assert title in texts(figure)
    assert_tidy(figure)


def test_parts_draw_on_axes_of_the_user() -> None:
    result = made(sag)
    figure = Figure(layout="constrained")
    a, b, c, d = figure.subplots(2, 2).ravel()
    draw_panel(panels.shape(result, times=[0.0, 2.5], view="yz"), a)
    draw_panel(panels.profiles(result, "curvature", output=0), b)
    draw_panel(panels.history(result, "position", [0.0, 33.0]), c)
    draw_panel(panels.history(result, "position", [33.0], component=2), d)
    assert a.get_xlabel() == "y (m)" and len(_earlier(a)) == 2
    assert b.get_ylabel() == "curvature (1/km)"
    assert c.lines[1].get_ydata() == pytest.approx(np.linalg.norm(result.at(s=33.0)["position"], axis=-1))
    assert d.lines[0].get_ydata()[0] == 0.0 and d.get_ylabel() == "Δz (m)"
    FigureCanvasAgg(figure).draw()


@pytest.mark.parametrize(
    "unit, peak, shown, factor",
    [
        ("N", 2.5e4, "kN", 1e-3),
        ("N", 0.02, "mN", 1e3),
        ("N", 1000.0, "kN", 1e-3),
        ("N", 999.0, "N", 1.0),
        ("N/m", 2.5e4, "kN/m", 1e-3),
        ("N m", 3e-5, "µN m", 1e6),
        ("N m", 0.02, "N m", 1.0),  # "mN m" may be read as metres
        ("N m", 0.0, "N m", 1.0),
        ("N m", 1e-15, "N m", 1.0),
        ("m", 250.0, "m", 1.0),
        ("m", 2e4, "km", 1e-3),
        ("m", 1e-3, "mm", 1e3),
        ("1/m", 1e-4, "1/km", 1e3),
        ("kg", 1e9, "kg", 1.0),
        ("", 1.0, "–", 1.0),
    ],
)
def test_units_get_sensible_prefixes(unit: str, peak: float, shown: str, factor: float) -> None:
    assert look.prefix(unit, peak) == (pytest.approx(factor), shown)


def test_round_off_does_not_fill_a_panel() -> None:
    ax = Figure().subplots()
    result = made(sag, tension=1000.0)
    draw_panel(panels.profiles(result, "torque"), ax)
    assert ax.get_ylim() == (-1.0, 1.0)


def test_nonsense_is_refused(tmp_path: Path) -> None:
    result = made(sag)
    with pytest.raises(ResultError, match="0 <= s <= 100 m"):
        plot.plot_summary(result, history=[101.0])
    with pytest.raises(ResultError, match="list of arc lengths"):
        plot.plot_summary(result, history=[])
    with pytest.raises(ResultError, match="0 <= t <= 10 s"):
        plot.plot_summary(result, times=[11.0])
    for path in (tmp_path / "no" / "page.png", tmp_path / "page.xyz"):
        with pytest.raises(ResultError, match=r"no folder|unknown file format"):
            plot.plot_summary(result, path)
    ax = Figure().subplots()
    with pytest.raises(ResultError, match="'xx' is not a plane"):
        draw_panel(panels.shape(result, view="xx"), ax)
    with pytest.raises(ResultError, match="does not depend on s"):
        draw_panel(panels.history(result, "t", [0.0]), ax)
    with pytest.raises(ResultError, match="did you mean tension"):
        draw_panel(panels.history(result, "tenson", [0.0]), ax)


@pytest.mark.long
def test_no_pyplot_and_no_matplotlib_before_something_is_drawn() -> None:
    code = (
        "import sys, hybrid.view.quantities as p, hybrid.view.report; assert 'matplotlib' not in sys.modules; sys.path.insert(0, sys.argv[1]);"
        "from test_result_plot import made, sag; p.plot_summary(made(sag)).canvas.draw(); p.plot_zones(made(sag));"
        "assert 'matplotlib.pyplot' not in sys.modules and 'matplotlib' in sys.modules"
    )
    env = os.environ | {"PYTHONPATH": str(Path(hybrid.__file__).parents[1])}
    subprocess.run([sys.executable, "-c", code, str(Path(__file__).parent)], check=True, env=env)


class Drawn:
    """A line in the x-z plane, as far as views ask."""

    names: tuple[str, ...] = ()

    def __init__(self, x: np.ndarray, z: np.ndarray) -> None:
        self.position = np.stack([x, 0.0 * x, z], axis=1)[None]

    def __contains__(self, name: str) -> bool:
        return False


def test_a_picture_that_is_not_to_scale_says_whether_a_line_crosses_itself() -> None:
    """An S in deep water looks like a loop where one direction is opened."""
    s = np.linspace(0.0, 1.0, 401)
    turn = 0.5 - 0.5 * np.cos(np.pi * np.clip((s - 0.45) / 0.1, 0.0, 1.0))
    down = -3000.0 * s + 400.0 * np.sin(np.pi * turn) * np.sin(2.0 * np.pi * turn)
    view, loop = views.view_named("xz"), 2.0 * np.pi * turn
    cases = {
        "": (3000.0 * s, down),
        "not to scale: x is drawn 7 times as large as z": (100.0 * s, -3000.0 * s),
        "does not cross": (100.0 * s + 20.0 * turn, down),
        "and crosses": (100.0 * s - 90.0 * (1.0 - np.cos(loop)), -3000.0 * s + 400.0 * np.sin(loop)),
    }
    for text, (x, z) in cases.items():
        said = views.not_to_scale(view, Drawn(x, z))  # type: ignore[arg-type]
        assert text in said and bool(said) is bool(text), (text, said)
    assert "turns back" not in views.not_to_scale(view, Drawn(100.0 * s, -3000.0 * s))  # type: ignore[arg-type]


def test_a_history_of_hours_is_drawn_as_its_mean_and_range() -> None:
    """10 800 outputs of a wave of 10 s are a block of ink: curves below it were hidden."""
    t = np.arange(10_800.0)
    found = stretches_of(t, 5.0 + 2.0 * np.sin(2.0 * np.pi * t / 10.0))
    assert found is not None and len(found.x) == 150
    assert np.abs(found.mean - 5.0).max() < 0.1 and found.low.max() < 3.2 and found.high.min() > 6.8
    assert stretches_of(t, np.sin(2.0 * np.pi * t / 500.0)) is None  # as many outputs, and few swings
    assert stretches_of(t[:500], np.sin(t[:500])) is None
    axes = new_axes()
    draw_panel(
        Panel("h", "h", Axis("t", "s"), Axis("T", "N"), [Line(t, 5.0 + np.sin(t), "s = 0 m")]), axes, legend=True
    )
    (line,) = axes.lines
    assert len(np.asarray(line.get_xdata())) == 151 and line.get_label() == "s = 0 m"
    assert [x.get_text() for x in axes.texts] == ["mean and range of each 72 s"]


def test_times_of_earlier_shapes_look_different() -> None:
    assert look.distinct_texts([0.0, 4949.6, 4952.0, 10_800.0]) == ["0", "4950", "4952", "10800"]
    assert look.distinct_texts([1.0, 2.5]) == ["1", "2.5"] and look.distinct_texts([]) == []
