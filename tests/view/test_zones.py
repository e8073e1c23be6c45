"""The picture of zones shows what is in the file, in its place, and nothing between."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from test_result_plot import EVENTS, MIXED, assert_tidy, image, made, sag, texts

import hybrid
from hybrid.errors import ResultError
from hybrid.kernels.mesh.zone_criteria import CRITERIA
from hybrid.store.reader import Result
from hybrid.view import zones as zoneplot
from hybrid.view.figure import Axis, Map, Panel, Text
from hybrid.view.matplotlib_backend import draw_panel
from hybrid.view.plotly_backend import draw_graph
from hybrid.view.quantities import plot_zones
from hybrid.view.zones import WHY, rods_at_start, why_rods, zone_map

EXAMPLES = Path(__file__).parents[2] / "examples"
Zones = list[tuple[str, float, float]]
ROD, CATENARY = [("rod", 0.0, 100.0)], [("catenary", 0.0, 100.0)]


def moving(t: float) -> Zones:
    """Boundaries on output points (multiples of 2.5 m), between them, and a rod too short to hold one; at first none."""
    if t < 2.0:
        return CATENARY
    a = 40.0 + round(3.0 * t)
    return [("rod", 0.0, 5.0), ("catenary", 5.0, a), ("rod", a, a + 20.0), ("catenary", a + 20.0, 97.7),
            ("rod", 97.7, 99.1), ("catenary", 99.1, 100.0)]  # fmt: skip


def expected(result: Result, output: int, s: float) -> tuple[str, float]:
    """Kind, and value at the nearest output point that the recorder counts to the same zone; NaN where there is none.

    Sums and loops, and none of the arrays of the picture.
    """
    previous = -1.0
    for kind, a, b in result.zones[output]:
        points = [k for k, x in enumerate(result.s) if previous < x <= b]
        previous = b
        if a < s < b:
            if not points:
                return kind, np.nan
            nearest = min(points, key=lambda k: abs(result.s[k] - s))
            return kind, float(result[zoneplot.SHOWN[kind]][output, nearest])
    raise AssertionError("no zone")


def by_name(figure: Figure) -> dict[str, Any]:
    return {ax.get_label(): ax for ax in figure.axes}


def value(picture: Any, t: float, s: float) -> float:
    """What an image shows there, NaN: nothing."""
    there = picture.get_cursor_data(SimpleNamespace(xdata=t, ydata=s))
    return np.nan if there is None or np.ma.is_masked(there) else float(there)


def places(seed: int, count: int) -> list[float]:
    return np.random.default_rng(seed).uniform(0.0, 100.0, count).tolist()


def check_values(result: Result, images: dict[str, Any], factors: dict[str, float], where: Sequence[float]) -> int:
    """Every image shows the file's value in its zones and nothing elsewhere; how many places are grey."""
    grey = 0
    first, last = result.times[0] + 1e-9, result.times[-1] - 1e-9  # on the very rim matplotlib sees the other one
    for output, t in enumerate(result.times):
        for s in where:
            kind, number = expected(result, output, s)
            for name, picture in images.items():
                shown = value(picture, float(np.clip(t, first, last)), s)
                if name == kind and np.isfinite(number):
                    assert shown == number * factors[kind], (t, s)
                else:
                    assert np.isnan(shown), (t, s)
            grey += bool(np.isnan(number))
    return grey


def test_what_is_drawn_is_what_is_in_the_file() -> None:
    result = made(sag, zones=moving, nt=21)
    images = draw_panel(zoneplot.zone_map(result), Figure().subplots())
    assert [picture.get_label() for picture in images.values()] == ["rod: curvature (1/km)", "catenary: tension (kN)"]
    where = [*places(0, 60), 98.0, 99.0, 99.3, 0.01, 99.99]
    assert check_values(result, images, {"rod": 1e3, "catenary": 1e-3}, where) > 10


def test_zones_of_an_adaptive_run_are_drawn_as_they_were(tmp_path: Path) -> None:
    scene = hybrid.load_scene(
        EXAMPLES / "s_tether.yaml", ["model={kind: adaptive, tolerance: 1e-2}", "time.duration=15"]
    )
    result = hybrid.run(scene, tmp_path / "run.h5")
    assert len(np.unique(result["zones/t"])) > 3  # they do move
    figure = hybrid.plot_zones(hybrid.open(tmp_path / "run.h5"), tmp_path / "run.png")
    assert_tidy(figure)
    images = draw_panel(zoneplot.zone_map(result), Figure().subplots())
    check_values(result, images, {"rod": 1.0, "catenary": 1.0}, [0.6 * s for s in places(1, 25)])


def test_pixels_have_the_colours_of_the_values() -> None:
    """On the page as it is seen; away from the lines between zones, which are drawn over it."""
    result = made(sag, zones=lambda t: [("catenary", 0.0, 30.0 + 4.0 * t), ("rod", 30.0 + 4.0 * t, 100.0)], nt=11)
    figure = plot_zones(result)
    pixels = image(figure)[:, :, :3] / 255.0
    ax = by_name(figure)["map"]
    images = {picture.get_label().split(":")[0]: picture for picture in ax.images}
    for output, t in enumerate(result.times[1:-1], 1):
        for s in places(output, 40):
            ends = [abs(s - x) for zone in result.zones[output] for x in zone[1:]]
            points = np.abs(result.s - s)
            if min(ends) < 1.0 or np.diff(np.sort(points)[:2])[0] < 0.5:  # m; beside a line, or between two cells
                continue
            kind, number = expected(result, output, s)
            x, y = ax.transData.transform((t, s)).astype(int)
            number *= {"rod": 1e3, "catenary": 1e-3}[kind]
            # 2/255: colours are looked up in a table of 256
            assert pixels[899 - y, x] == pytest.approx(np.array(images[kind].to_rgba(number)[:3]), abs=2 / 255)


def test_the_page_tells_zones_share_and_events(tmp_path: Path) -> None:
    events = [(2.0, "split", "a"), (4.0, "split", "b"), (5.0, "merge", "c"), (7.0, "retry", "d"), (12.0, "merge", "e")]
    result = made(sag, zones=moving, nt=41, events=events, attached=[20.0, 100.0])
    figure = plot_zones(result, tmp_path / "zones.png")
    axes = by_name(figure)
    assert set(axes) == {"map", "rod", "catenary", "share"}
    text = texts(figure)
    for part in (
        "Made-up mooring", "41 outputs, t = 0 … 10 s; split × 2, merge × 2, retry × 1", "t (s) | share (%)",
        "zones: rod by curvature, catenary by tension", "zone boundary", "attached", "no output point in the zone",
    ):  # fmt: skip
        assert part in text
    assert [axes[k].get_ylabel() for k in ("map", "rod", "catenary")] == [
        "s (m)", "rod: curvature (1/km)", "catenary: tension (kN)",
    ]  # fmt: skip
    assert axes["map"].get_xlim() == axes["share"].get_xlim() == (0.0, 10.0) and axes["map"].get_ylim() == (0.0, 100.0)
    marks = {line.get_label(): line for line in axes["map"].lines}
    assert marks["split"].get_xydata().tolist() == [[2.0, 50.0], [4.0, 50.0]]  # the middle of where they were
    assert marks["retry"].get_xydata().tolist() == [[7.0, 50.0]]
    assert marks["merge"].get_xydata().tolist() == [[5.0, 50.0]]  # what came after the last output is off the page
    assert [list(marks[name].get_ydata()) for name in ("attached", "_attached")] == [[20.0, 20.0], [100.0, 100.0]]
    pixels = image(figure)
    assert pixels.shape == (900, 1200, 4) and (tmp_path / "zones.png").stat().st_size > 20_000
    assert_tidy(figure)


def test_too_many_marks_are_left_out_and_the_page_says_so() -> None:
    figure = plot_zones(made(sag, zones=moving, events=[(0.01 * k, "split", "") for k in range(251)]))
    assert "split × 251 (too many to mark)" in texts(figure)
    assert "split" not in [line.get_label() for line in by_name(figure)["map"].lines]
    assert "too many" not in texts(plot_zones(made(sag, events=[(0.04 * k, "split", "") for k in range(250)])))


def test_boundaries_are_where_the_file_has_them() -> None:
    """Along t at the place of the joint, not of the nearest output point; along s half way between two outputs."""
    ax = Figure().subplots()
    result = made(sag, nt=11, zones=lambda t: CATENARY if t < 3.5 else [("catenary", 0.0, 61.3), ("rod", 61.3, 100.0)])
    draw_panel(zoneplot.zone_map(result), ax)
    (line,) = ax.lines
    assert line.get_label() == "zone boundary" and np.isnan(line.get_xydata()[2::3]).all()  # a gap after each
    ends = sorted(np.round(line.get_xydata()[k : k + 2], 9).tolist() for k in range(0, len(line.get_xdata()), 3))
    assert ends == [[[3.5, 61.3], [3.5, 100.0]], [[3.5, 61.3], [10.0, 61.3]]]
    for whole in ([("rod", 0.0, 40.0), ("rod", 40.0, 100.0)], ROD, CATENARY):  # nothing happens between two of a kind
        ax = Figure().subplots()
        draw_panel(zoneplot.zone_map(made(sag, zones=lambda t, whole=whole: whole)), ax)
        assert not ax.lines


def test_the_share_of_rod_is_that_of_the_zones() -> None:
    result = made(sag, zones=moving, nt=21)
    share = zoneplot.rod_share(result)
    assert share[result.times < 2.0].tolist() == [0.0] * 4
    assert share[result.times >= 2.0] == pytest.approx(0.264)  # 5 + 20 + 1.4 m of 100
    figure = plot_zones(result)
    title = by_name(figure)["share"].get_title("left")
    # four outputs of 0.5 s, the first of which holds for half of that: 1.75 s of 10 without any
    assert title == f"share of rod: {0.825 * 26.4:.3g} % of the cable on average, between 0 and 26.4 %"
    assert "share of rod: 25 % of the cable\n" in texts(plot_zones(made(sag))) + "\n"


def test_rods_that_are_paid_out_are_no_change_of_zones() -> None:
    longer = made(sag, zones=lambda t: ROD if t < 5.0 else [("rod", 0.0, 60.0), ("rod", 60.0, 100.0)])
    assert zoneplot.shares(longer) == "100 % of the cable is rod, all the time."
    assert zoneplot.shares(made(sag, zones=moving, nt=21)).startswith(
        "Rod is 0 to 26.4 % of the cable; zones changed at "
    )


def touching(when: Sequence[bool]) -> Result:
    """On the bed between s = 30 and 60 m at the outputs that are named, else above it."""

    def height(s: np.ndarray, t: float) -> Sequence[Any]:
        lies = when[round(t / 10.0 * (len(when) - 1))]
        return s, 0.0, np.where(lies & (s >= 30.0) & (s <= 60.0), -40.0, -30.0)

    return made(height, nt=len(when), bed=(0.0, 0.0, 1.0, -40.0))


def test_touchdown_has_gaps_where_nothing_touches() -> None:
    ax = Figure().subplots()
    result = touching([False, True, True, True, False, True, False, False, True, True, False])
    draw_panel(zoneplot.zone_map(result), ax)
    first, alone, last, _ = [line for line in ax.lines if len(line.get_xdata()) in (1, len(result.times))]
    assert first.get_label() == "touchdown" and last.get_label() == "_touchdown"
    for line, k in ((first, 0), (last, 1)):
        assert np.array_equal(line.get_ydata(), result["touchdown"][:, k], equal_nan=True)
        assert np.array_equal(line.get_xdata(), result.times)
    assert alone.get_xydata().tolist() == [[5.0, 30.0]]  # a line through one point would be none
    never = Figure().subplots()
    draw_panel(zoneplot.zone_map(touching([False] * 5)), never)
    assert [line.get_label() for line in never.lines] == ["zone boundary"]
    for result in (touching([False] * 5), touching([False, True, False, False, True])):
        assert_tidy(plot_zones(result))


def test_a_touchdown_that_stays_at_an_end_is_not_drawn() -> None:
    ax = Figure().subplots()
    result = made(lambda s, t: (s, 0.0, -40.0 + 0.01 * np.maximum(s - 40.0 - t, 0.0) ** 2), bed=(0.0, 0.0, 1.0, -40.0))
    draw_panel(zoneplot.zone_map(result), ax)
    (line,) = (line for line in ax.lines if "touchdown" in line.get_label())
    assert np.array_equal(line.get_ydata(), result["touchdown"][:, 1])


CASES: dict[str, dict[str, Any]] = {
    "fixed": {},
    "rod": {"zones": lambda t: ROD},
    "catenary": {"zones": lambda t: CATENARY, "moment": False},
    "moving": {"zones": moving, "events": [*EVENTS, (4.0, "merge", "calm")]},
    "with bed": {"zones": moving, "bed": (0.0, 0.0, 1.0, -30.0), "attached": [10.0]},
    "static": {"nt": 1},
    "two outputs": {"nt": 2},
    "straight rod": {"zones": lambda t: ROD, "tension": 0.0},
    "pushed": {"tension": -5.0},
    "interrupted": {"status": "interrupted", "message": "by the user"},
    "no zones": {"zones": lambda t: []},
}


@pytest.mark.parametrize("case", CASES)
def test_every_kind_of_result_draws(case: str) -> None:
    figure = plot_zones(made(sag, **CASES[case]))
    axes = by_name(figure)
    kinds = {"catenary": {"catenary"}, "rod": {"rod"}, "straight rod": {"rod"}, "no zones": set()}
    assert set(axes) - {"map", "share"} == kinds.get(case, {"rod", "catenary"})
    assert_tidy(figure)
    pixels = image(figure)
    if case != "no zones":
        x0, y0, x1, y1 = axes["map"].get_window_extent().extents.astype(int)
        assert pixels[900 - y1 : 900 - y0, x0:x1, :3].std() > 3.0
    assert ("t = " in texts(figure)) == (case != "static")


def test_nothing_saved_still_gives_a_page() -> None:
    figure = plot_zones(made(sag, nt=0, status="failed", message="singular at t = 0 s"))
    assert "no output was saved" in texts(figure) and figure.axes == []


def norm_of(kind: str, values: Sequence[float]) -> Any:
    """How an image of these values takes its colours."""
    low, high, log = zoneplot.span_of(np.array(values), bends=kind == "rod", straight=1e-8)
    edges, unit = np.arange(len(values) + 1.0), Axis("", "", 0.0, 1.0)
    shown = Map(edges, np.array([0.0, 1.0]), np.array([values]), kind, "", "", zoneplot.COLOURS[kind], low, high, log)
    return draw_panel(Panel("", "", unit, unit, [shown]), Figure().subplots())[kind].norm


@pytest.mark.parametrize(
    "kind, values, low, high, log",
    [
        ("rod", [0.2, 0.3, 1.0], 0.0, 1.0, False),
        ("rod", [0.0, 0.02, 1.0], 0.01, 1.0, True),  # a joint, where a rod is straight, does not stretch the scale
        ("rod", [0.05, 0.05, 1.0], 0.05, 1.0, True),
        ("rod", [0.0, 1e-14], 0.0, 1e-8, False),  # a straight rod has no colours of round-off
        ("rod", [np.nan], 0.0, 1e-8, False),
        ("catenary", [3.0, 20.0], 0.0, 20.0, False),
        ("catenary", [300.0, 330.0], 300.0, 330.0, False),
        ("catenary", [-1.0, 9.0], -1.0, 9.0, False),
        ("catenary", [1e3, 1e3 + 1e-9], 1e3, 1001.0, False),
        ("catenary", [0.0, 0.0], 0.0, 1.0, False),
        ("catenary", [np.nan], 0.0, 1.0, False),
    ],
)
def test_colours_span_what_is_there(kind: str, values: list[float], low: float, high: float, log: bool) -> None:
    norm = norm_of(kind, values)
    assert (norm.vmin, norm.vmax, isinstance(norm, LogNorm)) == (pytest.approx(low), pytest.approx(high), log)
    assert float(norm(0.0)) <= 0.2 and not np.ma.is_masked(norm(0.0))  # a joint is pale, not a hole in the picture


# What eyes without one kind of cone make of linear RGB: Machado, Oliveira & Fernandes (2009), IEEE TVCG 15, 1291.
EYES = {
    "full": [[1, 0, 0], [0, 1, 0], [0, 0, 1]],
    "protan": [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]],
    "deutan": [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]],
    "tritan": [[1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602], [0.004733, 0.691367, 0.303900]],
}


def oklab(colour: str, eye: str) -> np.ndarray:
    """B. Ottosson (2020), A perceptual color space for image processing."""
    c = np.array([int(colour[i : i + 2], 16) for i in (1, 3, 5)]) / 255.0
    linear = np.array(EYES[eye]) @ np.where(c <= 0.04045, c / 12.92, ((c + 0.055) / 1.055) ** 2.4)
    cones = np.array([[0.4122214708, 0.5363325363, 0.0514459929], [0.2119034982, 0.6806995451, 0.1073969566],
                      [0.0883024619, 0.2817188376, 0.6299787005]])  # fmt: skip
    opponent = np.array([[0.2104542553, 0.7936177850, -0.0040720468], [1.9779984951, -2.4285922050, 0.4505937099],
                         [0.0259040371, 0.7827717662, -0.8086757660]])  # fmt: skip
    return opponent @ np.cbrt(np.clip(cones @ linear, 0.0, None))


@pytest.mark.parametrize("eye", EYES)
def test_kinds_of_zones_are_told_apart_by_all_eyes(eye: str) -> None:
    rod, catenary = (np.array([oklab(c, eye) for c in zoneplot.COLOURS[kind]]) for kind in ("rod", "catenary"))
    # 0.02 is what is just told apart side by side
    assert np.linalg.norm(rod[:, None] - catenary[None], axis=2).min() > 0.07
    for lightness in (rod[:, 0], catenary[:, 0]):
        assert (np.diff(lightness) < -0.04).all() and lightness[0] - lightness[-1] > 0.55


def test_nonsense_is_refused(tmp_path: Path) -> None:
    for name in ("no/zones.png", "zones.xyz"):
        with pytest.raises(ResultError, match=r"no folder|unknown file format"):
            plot_zones(made(sag), tmp_path / name)
    (tmp_path / "bad.h5").write_text("no HDF5")
    with pytest.raises(ResultError, match="cannot be read as a result"):
        hybrid.plot_zones(hybrid.open(tmp_path / "bad.h5"))


def test_sums_that_differ_in_the_last_digit_are_one_place() -> None:
    def noisy(t: float) -> Zones:
        joint = 75.0 - 1e-13 * (t > 5.0)
        return [("catenary", 0.0, joint), ("rod", joint, 100.0)]

    cells, once = (zoneplot.cells_of(made(sag, zones=zones)) for zones in (noisy, lambda t: MIXED))
    assert cells.s == pytest.approx(once.s, abs=1e-12) and cells.t.tolist() == once.t.tolist()
    assert np.array_equal(cells.kind, once.kind) and np.array_equal(cells.point, once.point)


def test_the_picture_of_zones_says_why_a_stretch_is_rod() -> None:
    """Rods at the start by their criteria, of a run and of its equilibrium; later ones by those of their events."""
    scene = hybrid.load_scene(EXAMPLES / "s_tether.yaml", ["time.duration=4", "output.points=21"])
    assert set(WHY) == {x.name for x in CRITERIA}
    for result in (hybrid.run(scene), hybrid.static(scene)):
        first = rods_at_start(result)
        assert [(x.s_a, x.s_b) for x in first] == [(z.s_a, z.s_b) for z in result.zones[0] if z.kind == "rod"]
        assert [x.why[0] for x in first] == ["bending", "asked for by the scene"]
        said = why_rods(result)
        assert said.startswith(
            "rod at the start: s = 14.4 to 46.64 m, bending; s = 55.47 to 60 m, asked for by the scene"
        )
        assert said.endswith("rod later: bending × 1") is any(x.kind == "grow" for x in result.events)
        words = [x.text for x in zone_map(result).items if isinstance(x, Text)]
        assert words == ["bending", "asked for by the scene"]
        assert all(word in draw_graph(zone_map(result)) for word in words)  # in a report, too
        assert said in " ".join(texts(plot_zones(result)).split())
        result.close()
