"""What meshes and models do not show is said: kinks at joints, slack bends, changes of stiffness, compression."""

from __future__ import annotations

import re
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from bits import resumed
from problems import pinned, scene

import hybrid
import hybrid.kernels
from hybrid.errors import Outcome
from hybrid.model.build import build
from hybrid.model.resolution import first_resolution
from hybrid.scene.read import one_line
from hybrid.simulation.diagnostics import Diagnostics
from hybrid.simulation.events import EventLog, kinks_at
from hybrid.store.verdicts import MET, verdicts_of
from tests.said import kinds, of_kind, texts_of
from tests.scenes import cable_scene, clamped_at, line_between, network_scene, pinned_at

KINK = "kink at joint"


def sagging(border: float, **more: Any) -> dict[str, Any]:
    """A cable of 20 m over 8 m, a stiff rod to the border and a catenary from there on."""
    section = {"length": 20.0, "mass": 1.0, "bending_stiffness": 20.0}
    zones = {"kind": "zones", "zones": [{"rod": border}, {"catenary": 20.0 - border}]}
    return cable_scene(section, pinned_at(0, 0, 0), pinned_at(8, 0, 0), model=zones, mesh=80) | more


def test_a_border_in_the_sag_is_said_with_place_angle_and_remedy() -> None:
    (said,) = of_kind(hybrid.static(sagging(10.0)), KINK)
    assert said.s_a == said.s_b == pytest.approx(10.0)
    assert "s = 10 m" in said.text and "model.zones" in said.text and "model: rod" in said.text
    assert not of_kind(hybrid.static(sagging(16.0)), KINK)


def test_a_run_says_it_when_it_comes() -> None:
    """A border that lies in a straight stretch at first, and in the sag when the end has come nearer."""
    ends = sagging(10.0)["ends"]
    ends["end"] = {"kind": "pinned", "position": [19, 0, 0], "motion": {"surge": {"amplitude": -12.0, "period": 40.0}}}
    ends["end"]["motion"]["ramp"] = 5.0
    time = {"duration": 20.0, "step": 0.05}
    section = {"length": 20.0, "mass": 1.0, "bending_stiffness": 20.0, "damping": 2.0, "axial_stiffness": 1e5}
    run = hybrid.run(sagging(10.0, ends=ends, time=time, cable={"sections": [section]}))
    said = of_kind(run, KINK)
    assert said and said[0].t > 0.0 and said[0].s_a == pytest.approx(10.0)


def test_zones_that_move_say_it_too() -> None:
    """Where a scene forces the border into the sag, at any output."""
    model = {"kind": "adaptive", "force_rod": [[0, 10]], "force_catenary": [[10, 20]]}
    time = {"duration": 0.2, "step": 0.05}
    said = of_kind(hybrid.run(sagging(10.0, model=model, time=time)), KINK)
    assert said and said[0].s_a == pytest.approx(10.0) and "model.force_catenary" in said[0].text


def test_a_point_load_at_the_joint_is_no_kink_of_zones() -> None:
    clump = {"kind": "clump", "at": 10.0, "mass": 30.0}
    loaded = sagging(10.0)
    loaded["cable"]["attachments"] = [clump]
    assert not of_kind(hybrid.static(loaded), KINK)


def test_what_bends_beside_a_joint_is_taken_off() -> None:
    bends, lengths = np.array([[0.1], [0.1], [2.0 * np.tan(0.25)], [0.2], [0.1]]), np.ones(5)
    assert kinks_at(np.array([2]), bends, lengths)[0, 0] == pytest.approx(0.5 - 0.2)


# --- bends in cells that are too long where there is almost no tension ---

SLACK_BEND = "unresolved slack bend"
EI, WEIGHT, DIAMETER = 100.0, 1.5 * 9.81 - 1025 * 9.81 * np.pi / 4 * 0.03**2, 0.03
BEND = (EI / WEIGHT) ** (1 / 3)  # m
ENDS = {"start": "free", "end": {"kind": "pinned", "position": [0, 0, 0]}}


def laid(cells: int, **more: Any) -> dict[str, Any]:
    """A cable that a ship lays at 2 m/s on a seabed 60 m below, seen from the ship."""
    sea = {
        "fluid": {"density": 1025, "surface": 0, "current": [-2.0, 0, 0]},
        "seabed": {"z": -60, "stiffness": 2e3, "damping": 5e2},
    }
    section = {
        "length": 240, "diameter": DIAMETER, "mass": 1.5, "axial_stiffness": 2e7, "bending_stiffness": EI,
        "drag": {"normal": 1.2},
    }  # fmt: skip
    return cable_scene(section, **ENDS, **sea, dimension=2, model="rod", time=(0.2, 0.05), mesh=cells) | more


def test_a_rod_on_cells_longer_than_its_bend(tmp_path: Path) -> None:
    coarse = hybrid.run(laid(30), tmp_path / "coarse.h5")
    [event] = of_kind(coarse, SLACK_BEND)
    assert f"within {BEND:.2g} m" in event.text and "a cell of 8 m" in event.text
    assert f"cells of {0.25 * BEND:.2g} m would do" in event.text
    fine = hybrid.run(laid(400), tmp_path / "fine.h5")
    assert not of_kind(fine, SLACK_BEND)
    bends = [float(x["curvature"][0].max()) for x in (coarse, fine)]
    assert bends[0] < 0.5 * bends[1]  # what the event is about
    s = fine.s[np.argmax(fine["curvature"][0])]
    assert event.s_a <= s <= event.s_b


def test_cells_as_the_text_asks_for_show_the_bend(tmp_path: Path) -> None:
    cells = int(np.ceil(240 / (0.25 * BEND)))
    found, finer = (hybrid.run(laid(n), tmp_path / f"{n}.h5") for n in (cells, 2 * cells))
    assert float(found["curvature"][0].max()) == pytest.approx(float(finer["curvature"][0].max()), rel=0.05)


def test_accuracy_of_curvature_is_a_remedy(tmp_path: Path) -> None:
    scene = {key: value for key, value in laid(30).items() if key != "mesh"}
    assert of_kind(hybrid.run(scene, tmp_path / "plain.h5"), SLACK_BEND)
    assert not of_kind(hybrid.run(scene | {"accuracy": {"curvature": "5%"}}, tmp_path / "asked.h5"), SLACK_BEND)


def test_cells_that_follow_are_looked_at_too(tmp_path: Path) -> None:
    model = {"kind": "adaptive", "curvature_error": 0.1, "rod_cell": 6.0}
    [event] = of_kind(hybrid.run(laid(30, model=model), tmp_path / "follow.h5"), SLACK_BEND)
    assert "`model.rod_cell`" in event.text


def test_it_is_noted_once_and_not_again_after_a_resume(tmp_path: Path) -> None:
    hybrid.run(laid(30), tmp_path / "half.h5")
    assert len(of_kind(hybrid.resume(tmp_path / "half.h5", until=0.4), SLACK_BEND)) == 1


@pytest.mark.parametrize("change", ["taut", "straight", "natural"])
def test_what_is_shown_is_not_noted(change: str, tmp_path: Path) -> None:
    scene = laid(30)
    section = scene["cable"]["sections"][0]
    if change == "taut":  # a suspension whose tension stays above EI/l^2
        scene["ends"] = {"start": {"kind": "pinned", "position": [0, 0, -10]}, "end": ENDS["end"]}
        scene["ends"]["end"] = {"kind": "pinned", "position": [230, 0, -10]}
    elif change == "straight":  # lies on the bed
        section["length"], scene["initial"] = 60, {"kind": "equilibrium"}
        scene["environment"]["fluid"]["current"] = [0, 0, 0]
        scene["ends"] = {"start": "free", "end": {"kind": "pinned", "position": [0, 0, -60]}}
        scene["mesh"] = {"cells": 10}
    else:  # lies on the bed in an arc that it has without stress
        section |= {"length": 60, "intrinsic_curvature": [0.05, 0.0, 0.0], "torsional_stiffness": EI}
        scene["environment"]["fluid"]["current"] = [0, 0, 0]
        clamp = {"kind": "clamped", "position": [0, 0, -60], "tangent": [1, 0, 0], "normal": [0, 0, 1]}
        scene |= {"ends": {"start": clamp, "end": "free"}, "mesh": {"cells": 15}, "dimension": 3}
    result = hybrid.run(scene, tmp_path / "a.h5")
    assert not of_kind(result, SLACK_BEND)
    if change == "natural":  # it is bent, by 0.2 rad a cell, and without tension
        assert result["curvature"][0].max() == pytest.approx(0.05, rel=0.05)


# --- changes of bending stiffness ---

CHANGE = "unresolved change of section"
SOFT, STIFF, HALF, MASS, ACROSS = 2.0, 200.0, 30.0, 0.2, 60.02


def described(first: float = SOFT, second: float = STIFF, **more: Any) -> dict[str, Any]:
    """A taut line of two stiffnesses."""
    sections = [
        {"length": HALF, "mass": MASS, "diameter": 0.007, "bending_stiffness": EI, "axial_stiffness": 4e5}
        for EI in (first, second)
    ]
    return cable_scene(sections, pinned_at(0, 0, 0), pinned_at(ACROSS, 0, 0)) | more


def exact(tension: float) -> float:
    """Curvature, 1/m, of the softer side of the change: M'' = T (M/EI - kappa0), M and M' continuous."""
    kappa0 = MASS * 9.81 / tension
    soft, stiff = (np.sqrt(EI / tension) for EI in (SOFT, STIFF))
    return float(kappa0 * (SOFT * stiff + STIFF * soft) / (soft + stiff) / SOFT)


def graded(shortest: float) -> list[float]:
    """Nodes that are so close, m, at the change, and ever farther apart away from it."""
    steps = np.cumsum(np.minimum(shortest * 1.12 ** np.arange(200), 1.0))
    steps = np.append(steps[steps < HALF - 0.5], HALF)
    return [0.0, *(HALF - steps[-2::-1]).tolist(), HALF, *(HALF + steps).tolist()]


def shown(result: hybrid.Result, first: float = SOFT) -> float:
    name = "curvature" if first == SOFT else "right/curvature"
    at = np.argmin(np.abs(np.asarray(result["s" if first == SOFT else "right/s"]) - HALF))
    return float(np.asarray(result[name])[-1][at])


@pytest.mark.parametrize("first", [SOFT, STIFF])
@pytest.mark.parametrize("model", ["rod", "catenary"])
def test_what_is_not_shown_is_said(model: str, first: float) -> None:
    """On long cells with any model, and of a catenary on any cells; what the text says is the exact curvature."""
    for mesh in ({"cells": 60}, {"nodes": graded(0.01)}):
        what = described(first, SOFT + STIFF - first, model=model, mesh=mesh)
        result = hybrid.static(what)
        true = exact(float(np.asarray(result.tension)[-1].mean()))
        said = [x.text for x in result.events if x.kind == CHANGE]
        right = shown(result, first) == pytest.approx(true, rel=0.1)
        assert right == (model != "catenary" and "nodes" in mesh), (shown(result, first), true)
        assert bool(said) != right
        if said:
            number = float(said[0].split("bends by about ")[1].split()[0])
            assert number == pytest.approx(true, rel=0.1) and "s = 30 m" in said[0]


def test_it_is_said_once_in_a_motion_and_not_of_one_stiffness() -> None:
    heave = {"heave": {"amplitude": 0.05, "period": 4.0}, "ramp": 4.0}
    for second, count in ((STIFF, 1), (SOFT, 0), (1.3 * SOFT, 0)):
        what = described(second=second, model="rod", mesh={"cells": 40}, time={"duration": 2.0, "step": 0.05})
        what["ends"]["start"]["motion"] = heave
        assert sum(x.kind == CHANGE for x in hybrid.run(what).events) == count


# --- tension below 0 from cells that are too long ---


def hanging(cells: int) -> dict[str, Any]:
    """A heavy chain between near ends, whose section changes beside its lowest point."""
    section = {"mass": 30.0, "diameter": 0.1, "axial_stiffness": 1e8, "length": 22.0}
    return cable_scene(
        [section, section | {"length": 18.0, "mass": 24.0}], pinned_at(0, 0, 0), pinned_at(8, 0, -6),
        fluid={"density": 1025}, model="catenary", mesh=cells, dimension=3
    )  # fmt: skip


def negative(result: hybrid.Result) -> list[float]:
    return [x.s_a for x in result.events if x.kind == "unresolved bend" and "between cells the tension" in x.text]


def test_it_is_told_where_it_stands() -> None:
    coarse = hybrid.static(hanging(12))
    T = np.ravel(coarse.tension)
    assert T.min() < -0.01 * T.max() and negative(coarse) == [coarse.s[T.argmin()]]


def test_a_motion_tells_it_once() -> None:
    moving = hybrid.run(hanging(12) | {"time": {"duration": 0.2, "step": 0.02}})
    assert len(negative(moving)) == 1


def test_cells_that_follow_the_bend_have_none() -> None:
    fine = hybrid.static(hanging(200))
    assert np.ravel(fine.tension).min() > 0.0 and not negative(fine)


# --- compression ---

SECTION = {"length": 10.0, "mass": 5.0, "axial_stiffness": 1e7, "bending_stiffness": 2e4}


def column(weight_down: bool) -> dict:
    """A rod that stands on a clamp, or hangs from it, under its own weight of 491 N."""
    way = 1.0 if weight_down else -1.0
    initial = {"kind": "equilibrium", "points": [[0, 0, 0], [0, 0, way * 10.0]]}
    return cable_scene(SECTION, clamped_at([0, 0, 0], [0, 0, way]), "free", initial=initial, model="rod")


def test_a_rod_that_stands_is_in_compression() -> None:
    found = hybrid.static(column(True))
    (text,) = texts_of(found, "compression")
    assert found.tension.min() == pytest.approx(-5.0 * 9.81 * 10.0, rel=0.02)
    (event,) = [x for x in found.events if x.kind == "compression"]
    assert event.s_a == 0.0 and event.s_b == pytest.approx(10.0)
    assert text.startswith("10 m of rod are in compression") and "most at s = 0 m: -4" in text


def test_one_that_hangs_is_not() -> None:
    assert not texts_of(hybrid.static(column(False)), "compression")


@pytest.mark.long
def test_accuracy_of_a_line_without_tension_is_a_part_of_its_compression() -> None:
    """A mast and a pressed beam, at rest and in motion: met, of a tension that is never above zero."""
    moving = {"motion": {"surge": {"amplitude": 0.1, "period": 3}, "ramp": 3}}
    mast = column(True) | {"time": {"duration": 1.0}, "initial": "equilibrium", "model": "adaptive"}
    mast["ends"] = {"start": mast["ends"]["start"] | moving, "end": "free"}
    beam = mast | {"ends": {"start": column(True)["ends"]["start"], "end": {"kind": "clamped", "tangent": [0, 0, 1]}}}
    beam["ends"]["end"] |= {"position": [0, 0, 9.998]} | moving
    for tables, compute in ((mast, hybrid.run), (beam, hybrid.static)):
        found = compute(tables)
        (tension,) = [x for x in verdicts_of(found).accuracy if x.quantity == "tension"]
        largest = float(np.abs(found.tension).max())
        assert found.tension.max() <= 1e-9 * largest
        assert tension.asked == pytest.approx(0.01 * largest, rel=0.05) and tension.verdict == MET


# --- Thresholds of the diagnostics from either side, in the numbers that the manual and theory.md give ---

SECTION_THRESHOLD = {"length": 10.0, "mass": 1.0, "bending_stiffness": 2.0, "axial_stiffness": 1e5}
SCENE = one_line(scene(SECTION_THRESHOLD, pinned(), pinned(9.5, 0, 0), model="rod", mesh={"cells": 10}))
MODEL = build(SCENE, first_resolution(SCENE))


def watch() -> Diagnostics:
    return Diagnostics(MODEL, EventLog())


def said_threshold(found: Diagnostics) -> list[str]:
    return [kind for _, _, _, kind, _ in found.events.waiting()]


def sharp(found: Diagnostics, bend: float, twist: float = 0.0) -> Any:
    """A bend (rad) at node 4 and a twist (rad) at node 6, from one cell to the next."""
    return found.shape(1.0, [bend, 4, twist, 6], MODEL.start)


@pytest.mark.parametrize(("angle", "told"), [(0.98, False), (1.02, True), (1.9, True)])
def test_a_bend_or_a_twist_beyond_one_radian_is_not_resolved(angle: float, told: bool) -> None:
    bent, twisted = watch(), watch()
    assert sharp(bent, angle) is None and sharp(twisted, 0.0, angle) is None
    assert said_threshold(bent) == ["unresolved bend"] * told and said_threshold(twisted) == ["unresolved twist"] * told
    if told:
        assert [s for _, s, *_ in bent.events.waiting()] == [4.0]


def test_it_is_told_again_where_it_is_half_as_much_again() -> None:
    found = watch()
    for angle in (1.1, 1.6, 1.7, 2.5, 2.6):  # told at 1.1, 1.7, 2.6
        sharp(found, angle)
    assert len(said_threshold(found)) == 3


def test_a_twist_beyond_two_radians_ends_the_run() -> None:
    assert sharp(watch(), 0.0, 1.99) is None
    assert sharp(watch(), 0.0, 2.01) == (Outcome.TWISTED_TOO_FAR, 6)


def test_the_compiled_run_asks_at_the_same_angles() -> None:
    clock: Any = SimpleNamespace()
    watch().watch(clock)
    assert clock.bend_limit == clock.twist_limit == 1.0


def finished(rho: float, steps: float, moved: float = 2.0, peaks: tuple[float, float] = (10.0, 20.0)) -> Diagnostics:
    """After a run with so many steps to a period where the motion, by `moved` (m), is fastest."""
    found, turn = watch(), 2.0 * np.pi / steps
    clock = SimpleNamespace(least_peak=peaks[0], largest_peak=peaks[1], moved=moved, rho=rho)
    worst = np.array([[moved * turn**3, 3.0, 0.1, 5.0]])  # what a step leaves, m; t, dt, s
    found.finish(SimpleNamespace(clock=clock, counts=SimpleNamespace(measured=1), worst=worst))  # type: ignore[arg-type]
    return found


@pytest.mark.parametrize(("rho", "few", "enough"), [(1.0, 7.4, 8.0), (0.5, 13.6, 14.5), (0.0, 23.5, 25.0)])
def test_steps_to_a_period_below_which_a_step_is_too_long(rho: float, few: float, enough: float) -> None:
    """theory.md, section 8: 8 with rho_inf = 1, 14 with 0.5, 24 with 0."""
    assert said_threshold(finished(rho, few)) == ["coarse step"] and said_threshold(finished(rho, enough)) == []
    ((t, s, _, _, text),) = finished(rho, few).events.waiting()
    assert (t, s) == (3.0, 5.0) and f"about {few:.2g} steps to a period" in text
    assert said_threshold(finished(rho, few, 1e-7, (20.0, 20.0))) == [], "what Newton's tolerance leaves is no motion"


# --- steps that are watched ---


def test_steps_that_are_watched_go_on_from_a_checkpoint(tmp_path: Path) -> None:
    """What is remembered of steps for the end of the run is in the checkpoint: the same event, whenever it stopped."""
    section = {"length": 30, "mass": 2, "axial_stiffness": 1e6}
    moved = {"position": [0, 0, 0], "motion": {"heave": {"amplitude": 0.3, "period": 2}, "ramp": 2}}
    line = line_between("a", "b", section, model="catenary", mesh=12)
    points = {"a": moved, "b": {"position": [20, 0, 0]}}
    whole = resumed(network_scene(points, {"line": line}, time=(6.0, 0.25), output=0.25), tmp_path, 4.0)
    assert "coarse step" in kinds(whole.lines["line"])


def test_what_a_kernel_writes_into_a_table_it_does_not_read_there() -> None:
    """Tables are read as what never changes (kernels.machine.references): what solve_network writes into those of its lines,

    cv, ca and dt of their tasks, is passed to what is inlined in it."""
    folder = Path(hybrid.kernels.__file__).parent
    inlined = ("network", "junctions", "joined_lines", "bodies", "energies", "accept", "extremes")
    read = {
        name: re.findall(r"job\.task\.(?:cv|ca|dt)\b", next(folder.rglob(f"{name}.py")).read_text()) for name in inlined
    }
    assert not any(read.values()), read


@pytest.mark.parametrize("end", [{"kind": "free"}, pinned_at(1.3, 0.3, 4.5)])
def test_a_rod_that_stands_still_in_compression_has_no_coarse_steps(end: dict[str, Any]) -> None:
    """Its round-off was off by 100 %, because its largest tension was no more than 0."""
    rod = {"length": 5, "mass": 5, "diameter": 0.05, "bending_stiffness": 2e4, "axial_stiffness": 1e6}
    found = hybrid.run(
        cable_scene(rod, clamped_at([0, 0, 0], [0.3, 0.1, 1]), end, model="rod", mesh=10, time=(1.0, 0.01))
    )
    assert "coarse step" not in kinds(found)


def test_a_sprung_clamp_is_resolved_in_a_plane_as_in_space():
    clamp = {"kind": "clamped", "position": [0, 0, 0], "tangent": [1, 0, 0], "bend_stiffness": 200.0}
    section = {"length": 30.0, "mass": 5.0, "diameter": 0.05, "bending_stiffness": 2000.0, "damping": {"mass": 0.5}}
    scene = {
        "cable": {"sections": [section]}, "initial": "equilibrium", "model": "rod", "mesh": {"cells": 20},
        "ends": {"start": clamp, "end": {"kind": "pinned", "position": [20, 0, 0]}},
        "time": {"duration": 0.2, "step": 0.05}, "output": {"every": 0.1},
    }  # fmt: skip
    said = [{e.kind for e in hybrid.run(scene | {"dimension": dimension}).events} for dimension in (2, 3)]
    assert said[0] == said[1]


PLAIN = {"length": 100, "mass": 2.0, "diameter": 0.03, "axial_stiffness": 1e6, "bending_stiffness": 200.0}


def paid_out(rate: float, sections: Any, x: float, **tables: Any) -> set[str]:
    end = pinned_at(x, 0, 0, payout={"rate": rate, "ramp": 1.0})
    scene = cable_scene(
        sections, pinned_at(0, 0, 0), end, model="rod", mesh=40, time=(6.0, 0.05), output=(0.25, 11), **tables
    )
    return {event.kind for event in hybrid.run(scene).events}


def test_a_line_that_is_paid_out_through_a_bar_says_so():
    bar = {"kind": "cylinder", "at": [42, 0, -27.5], "axis": [0, 1, 0], "radius": 0.05, "stiffness": 1e4}
    kinds = paid_out(0.5, PLAIN, 80.0, obstacles={"bar": bar})
    assert {"deep in an obstacle", "unresolved contact", "unresolved bend"} <= kinds


def test_a_change_of_section_of_a_line_at_a_winch_is_told():
    halves = [PLAIN | {"length": 50, "bending_stiffness": x} for x in (2e4, 20.0)]
    assert "unresolved change of section" in paid_out(-0.2, halves, 96.0)


@pytest.mark.parametrize("limited", [0, 1])
def test_a_bend_that_cells_do_not_show_is_noted_at_either_clamp(limited: int) -> None:
    """2.63 m at either clamp, 0.36 m on 200 cells."""
    section = {"length": 50, "mass": 10, "diameter": 0.05, "axial_stiffness": 1e7, "bending_stiffness": 300}
    sections = [section | {"drag": {"normal": 1.2}} for _ in range(2)]
    sections[limited]["min_bend_radius"] = 0.6
    heave = {"heave": {"amplitude": 0.2, "period": 6.0}, "ramp": 6}
    result = hybrid.run(cable_scene(
        sections, clamped_at([0, 0, 0], [1, 0, 0], motion=heave), clamped_at([80, 0, 0], [1, 0, 0], motion=heave),
        model="rod", mesh=20, fluid={"density": 1025}, time=(8.0, 0.05),
        output={"every": 0.5, "errors": True, "points": [20, 30, 50, 70, 80]}
    ))  # fmt: skip
    (found,) = result.verdicts().limits
    assert found.verdict == "not verified" and "unresolved bend" in found.why
