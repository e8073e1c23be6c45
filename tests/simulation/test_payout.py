"""Lines that are paid out and taken in, against exact solutions; kicks, energy, resume, Python, sections on the reel."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import hybrid
import hybrid.model.payout
from hybrid.cli.plan_tables import plan_rows
from hybrid.errors import SceneError
from hybrid.kernels.reel.paid_length import length_at
from hybrid.model.payout import law_of
from hybrid.scene.ends import Payout
from tests.inside import OnlyLine
from tests.scenes import cable_scene, clamped_at, pinned_at

G = 9.81


def hanging(payout: dict[str, Any], duration: float, **more: Any) -> dict[str, Any]:
    """40 m of 2 kg/m that hang from a winch; their lower end is free."""
    return (
        cable_scene({"length": 40.0, "mass": 2.0}, {"kind": "free"}, pinned_at(0, 0, 0, payout=payout),
                    model="catenary", mesh=20, time=(duration, 0.05), output=0.5) | more
    )  # fmt: skip


def sagging(
    model: str = "catenary", EA: float | None = None, EI: float | None = None, rate: float = 0.8, step: float = 0.05,
    duration: float = 20.0, **more: Any,
) -> dict[str, Any]:  # fmt: skip
    """100 m over 80 m; the winch surges by 1 m in 7 s."""
    section: dict[str, Any] = {"length": 100.0, "mass": 5.0, "diameter": 0.05}
    section |= {"axial_stiffness": EA} if EA else {}
    section |= {"bending_stiffness": EI} if EI else {}
    winch = pinned_at(
        80, 0, 0, payout={"rate": rate, "ramp": 4.0}, motion={"surge": {"amplitude": 1.0, "period": 7.0}, "ramp": 7.0}
    )
    return (
        cable_scene(section, pinned_at(0, 0, 0), winch, model=model, mesh=40, time=(duration, step), output=0.5) | more
    )


# --- exact solutions --------------------------------------------------------------------------------


def test_turns_between_held_ends_stay_while_the_line_grows() -> None:
    """Both ends hold the twist, and do not turn: link is what it was at every output, of lines of different cells."""
    up = {"tangent": [0, 0, 1], "normal": [1, 0, 0]}
    scene = hanging({"rate": 2.0, "ramp": 0.2}, 2.0, model="rod", output={"every": 0.1}, mesh={"cells": 16})
    scene["cable"]["sections"] = [{"length": 8.0, "mass": 4.0, "bending_stiffness": 30, "torsional_stiffness": 20}]
    scene["ends"]["start"] = {"kind": "guided", **up, "force": [0, 0, -800]}
    scene["ends"]["end"] |= {"kind": "clamped", "turns": -2, **up}
    result = hybrid.run(scene)
    assert result["payout/length"][-1] > 11.0  # nodes have entered
    assert np.abs(result["turns/link"] - result["turns/link"][0]).max() < 1e-6
    assert np.abs(result["turns/writhe"]).max() < 1e-9  # it hangs straight
    twist = 2.0 * np.pi * 20.0 * result["turns/twist"] / result["payout/length"]
    assert np.abs(result["torque"][:, 0] - twist).max() < 0.02 * np.abs(twist).max()


@pytest.mark.parametrize("clamp", [False, True], ids=["pinned", "clamped"])
@pytest.mark.parametrize("dimension", [None, 3])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_hanging_line_weighs_what_is_out_less_its_inertia(sign: float, dimension: int | None, clamp: bool) -> None:
    """T = w L - m L dc/dt at the winch, to round-off, through nodes that enter and leave, and ride with a clamp."""
    more = {"dimension": dimension} if dimension else {}
    scene = hanging({"rates": [[0, 0], [20, sign * 1.0]]}, 18.0, **more)
    if clamp:
        scene = clamped(scene | {"model": "rod"}, [0.0, 0.0, 1.0])
        scene["cable"]["sections"][0] |= {"bending_stiffness": 20.0, "torsional_stiffness": 20.0}
    result = hybrid.run(scene)
    length = 40.0 + sign * 0.025 * result.t**2
    assert np.abs(result["payout/length"] - length).max() < 1e-12 * 40.0
    force = result["reaction_end"][1:, 2]
    assert np.abs(force / (2.0 * length[1:] * (G - sign * 0.05)) - 1.0).max() < 1e-9
    np.testing.assert_allclose(result["payout/power"], -result["payout/rate"] * result["reaction_end"][:, 2], rtol=1e-9)
    out = result["s"][None] > result["payout/length"][:, None]  # on the reel
    assert not out.any() or np.abs(result["position"][out]).max() < 1e-12


def test_the_layer_that_rides_does_not_matter(monkeypatch: pytest.MonkeyPatch) -> None:
    """A bob on a rod that a clamp pays out, before the first node enters: nodes that ride and nodes that do not."""
    pulls = []
    for nodes in (4, 12):
        monkeypatch.setattr(hybrid.model.payout, "RIDE_BEHIND_CLAMP", nodes)
        scene = clamped(sagging("rod", 2e6, 2e4, 0.8, 0.05, 4.5))
        scene["mesh"] = {"cells": 80}
        scene["ends"]["end"]["payout"] = {"rate": 0.3, "ramp": 3.0}
        pulls.append(np.linalg.norm(hybrid.run(scene)["reaction_end"], axis=1))
    assert np.abs(pulls[1] / pulls[0] - 1.0).max() < 1e-3


def test_a_steady_rate_changes_nothing_but_the_weight() -> None:
    result = hybrid.run(hanging({"rate": 0.5, "begin": 1.0, "ramp": 4.0, "until": 20.0}, 30.0))
    steady = (result.t > 7.0) & (result.t < 20.0)
    weight = 2.0 * G * result["payout/length"]
    assert np.abs(result["reaction_end"][steady, 2] / weight[steady] - 1.0).max() < 1e-9
    assert result["payout/length"][-1] == pytest.approx(40.0 + 0.5 * 19.0, abs=1e-12)
    assert result["payout/rate"][-1] == 0.0


def pendulum(step: float, duration: float, payout: dict[str, Any]) -> dict[str, Any]:
    """A bob of 100 kg on 10 m of a line that weighs next to nothing, let go at 0.3 rad."""
    return cable_scene(
        {"length": 10.0, "mass": 1e-4}, {"kind": "body", "mass": 100.0, "volume": 0.0},
        pinned_at(0, 0, 0, payout=payout), initial={"kind": "straight", "direction": [-np.sin(0.3), 0, np.cos(0.3)]},
        model={"kind": "catenary", "slack": "warn"}, mesh=10, time=(duration, step), output=0.2
    )  # fmt: skip


@pytest.mark.long
def test_a_pendulum_of_variable_length() -> None:
    """L th'' + 2 L' th' + g sin th = 0 over ten swings, paid out and taken in: order 2, 1e-3 at 0.02 s."""
    duration = 80.0
    payout = {"lengths": [[0, 10], [20, 16], [40, 20], [60, 14], [80, 10.5]]}
    law = law_of(Payout(**payout), 10.0)

    def swing(t: float, y: np.ndarray) -> list[float]:
        length, rate, _ = length_at.py_func(law, t)
        return [y[1], -(2.0 * rate * y[1] + G * np.sin(y[0])) / length]

    errors = []
    for step in (0.04, 0.02):
        result = hybrid.run(pendulum(step, duration, payout))
        exact = solve_ivp(swing, (0.0, duration), [0.3, 0.0], rtol=1e-10, atol=1e-12, t_eval=result.t).y
        bob = result["position"][:, 0]
        errors.append(np.abs(np.arctan2(bob[:, 0], -bob[:, 2]) - exact[0]).max())
        assert (np.diff(np.sign(exact[0])) != 0).sum() >= 19  # ten swings
    assert errors[1] < 1e-3
    assert errors[0] > 3.5 * errors[1]


def test_heavier_line_on_the_reel() -> None:
    """What comes off the reel has its own mass; cells that hold both weigh what they hold."""
    reel = [{"length": 3.3, "mass": 2.0}, {"length": 50.0, "mass": 7.0, "diameter": 0.05}]
    result = hybrid.run(hanging({"rates": [[0, 0], [20, 1.0]], "reel": reel}, 18.0))
    length = result["payout/length"]
    mass = 2.0 * np.minimum(length, 43.3) + 7.0 * np.maximum(length - 43.3, 0.0)
    assert np.abs(result["reaction_end"][1:, 2] / (mass * (G - 0.05))[1:] - 1.0).max() < 1e-9
    assert np.abs(result["work/scheme"]).max() < 1e-3 * np.abs(result["work/end"]).max()


def test_softer_line_on_the_reel() -> None:
    """Hanging: pull = w L + damping but for the wave that softer material sends as it comes, 0.4 %; its length at rest.

    A node that enters at the change of section parts a cell of both: what each part lacks is by its own stiffness.
    """
    section = {"length": 40.0, "mass": 2.0, "axial_stiffness": 1e5, "damping": {"mass": 0.3}}
    reel = [section | {"length": 3.3}, section | {"length": 50.0, "axial_stiffness": 5e4}]
    scene = hanging({"rate": 0.5, "ramp": 2.0, "until": 20.0, "reel": reel}, 40.0, output={"every": 0.1})
    scene["cable"] = {"sections": [section]}
    result = hybrid.run(scene)
    length, t = result["payout/length"], result.t
    held = 2.0 * length * (G - 0.3 * result["payout/rate"])
    off = np.abs(result["reaction_end"][:, 2] / held - 1.0)[(t > 4.0) & (t < 19.0)]
    assert 1e-3 < off.max() < 5e-3
    out, stiff = length[-1], 43.3
    stretch = G * (stiff**2 / 1e5 + (out**2 - stiff**2) / 5e4)
    assert result.position[-1, 0, 2] == pytest.approx(-(out + stretch), rel=1e-5)
    assert np.abs(result["work/scheme"]).max() < 3e-5 * np.abs(result["work/end"]).max()


@pytest.mark.parametrize(("EA", "EI"), [(2e6, 8e4), (5e5, 2e4)])
def test_energy_is_balanced_as_another_section_leaves_a_clamp(EA: float, EI: float) -> None:
    """Its stiffness changes in all elements that ride, that at the clamp too, and its compliance in the cells."""
    scene = clamped(sagging("rod", 2e6, 2e4, duration=12.0))
    section = scene["cable"]["sections"][0]
    other = section | {"length": 50.0, "axial_stiffness": EA, "bending_stiffness": EI}
    scene["ends"]["end"]["payout"]["reel"] = [section | {"length": 1.3}, other]
    result = hybrid.run(scene)
    assert np.abs(result["work/scheme"]).max() < 1e-4 * np.abs(result["work/end"]).max()


@pytest.mark.parametrize("clamp", [False, True])
def test_out_and_back_is_where_it_was(clamp: bool) -> None:
    section = {"length": 100.0, "mass": 5.0, "axial_stiffness": 2e6, "damping": {"mass": 3.0}}
    scene = sagging(duration=200.0, step=0.1)
    scene["cable"] = {"sections": [section]}
    del scene["ends"]["end"]["motion"]
    if clamp:
        section["bending_stiffness"], scene["model"] = 2e4, "rod"
        clamped(scene)
    scene["ends"]["end"]["payout"] = {"lengths": [[0, 100], [40, 108], [80, 113], [120, 96], [160, 100]]}
    result = hybrid.run(scene)
    assert np.ptp(result["payout/length"]) > 15.0
    first, last = (x * (result["s"] <= 100.0)[:, None] for x in (result["position"][0], result["position"][-1]))
    assert np.abs(first - last).max() < 1e-6 * 100.0
    pull = np.linalg.norm(result["reaction_end"], axis=1)
    assert abs(pull[-1] / pull[0] - 1.0) < 1e-6


# --- kicks and energy -------------------------------------------------------------------------------


def forces(
    scene: dict[str, Any], skip: int | None = None, last: int | None = None, enough: int | None = None
) -> tuple[np.ndarray, list[int]]:
    """Force at the winch after every step, and the steps after which a node enters or leaves.

    skip: that change is not made; last: steps to compute; enough: changes after which six steps are.
    """
    found, changes = [], []
    with hybrid.Simulation(scene) as sim:
        paying = OnlyLine(sim).paying
        steps = round(scene["time"]["duration"] / scene["time"]["step"]) - 1
        for _ in range(min(steps, last or steps)):
            if skip is not None and len(changes) == skip:
                paying.reel.numbers[4:6] = 1e9, -1e9  # no cell is too long or too short
            count = paying.count
            sim.step()
            if paying.count != count:
                changes.append(len(found))
            found.append(np.linalg.norm(sim.forces().end))
            if len(changes) == enough and len(found) > changes[-1] + 6:
                break
    return np.array(found), changes


@pytest.mark.parametrize("EA", [None, 2e6])
def test_behind_a_clamp_it_sends_no_waves(EA: float | None) -> None:
    """The force at the winch, within two seconds, against a run in which that one cell does not enter.

    It changed by 0.3 % of the mean half a second later, when bending of the new node's neighbours arrived at the clamp.
    """
    scene = clamped(sagging("rod", EA, 2e4, duration=10.0))
    found, changes = forces(scene)
    other, _ = forces(scene, skip=1)
    assert np.abs(other - found)[: changes[1] + 40].max() < 6e-4 * found.mean()


def clamped(scene: dict[str, Any], tangent: list[float] | None = None) -> dict[str, Any]:
    """The same, with a clamp at the winch."""
    scene["ends"]["end"] |= {"kind": "clamped", "tangent": tangent or [1.0, 0.0, 0.5]}
    return scene


def kicks(scene: dict[str, Any]) -> list[float]:
    """The largest change of the force in five steps by each of two cells that enter or leave, of its mean."""
    found, changes = forces(scene, enough=2)
    assert len(changes) == 2
    others = [(forces(scene, skip=k, last=at + 6)[0], at) for k, at in enumerate(changes)]
    return [float(np.abs(other - found[: at + 6])[at:].max() / found.mean()) for other, at in others]


# --- at the start -----------------------------------------------------------------------------------


def exchanged(scene: dict[str, Any]) -> dict[str, Any]:
    """The same line with its ends exchanged: the winch at the start."""
    cable, ends = dict(scene["cable"]), {name: dict(x) for name, x in scene["ends"].items()}
    for end in ends.values():
        end |= {"tangent": [-x for x in end["tangent"]]} if "tangent" in end else {}
    length = sum(x["length"] for x in cable["sections"])
    cable["sections"] = cable["sections"][::-1]
    items = [dict(x) for x in cable.get("attachments", [])]
    for x in items:
        x |= {"at": length - x["at"]} if "at" in x else {"range": [length - s for s in x["range"][::-1]]}
        x |= {"diameters": x["diameters"][::-1]} if "diameters" in x else {}
    cable["attachments"] = items
    return {**scene, "cable": cable, "ends": {"start": ends["end"], "end": ends["start"]}}


def two_sections(payout: dict[str, Any], **more: Any) -> dict[str, Any]:
    """A hanging line of two sections with a clump, and a third section on the reel."""
    reel = [{"length": 3.3, "mass": 3.0}, {"length": 50.0, "mass": 7.0, "diameter": 0.05}]
    scene = hanging(payout | {"reel": reel}, 12.0, **more)
    scene["cable"] = {
        "sections": [{"length": 12.0, "mass": 1.0}, {"length": 28.0, "mass": 3.0, "max_tension": 900.0}],
        "attachments": [{"kind": "clump", "at": 6.0, "mass": 20.0}],
    }
    return scene


@pytest.mark.parametrize(
    "scene",
    [
        two_sections({"rates": [[0, 0], [12, 1.0]]}),
        two_sections({"rates": [[0, 0], [12, -0.5]]}, dimension=3),
        clamped(sagging("rod", 2e6, 2e4, duration=8.0), [1.0, 0.2, 0.5]),
        sagging("rod", None, 2e4, -0.8, duration=8.0),
    ],
)
def test_a_winch_at_the_start_does_as_one_at_the_end(scene: dict[str, Any]) -> None:
    """The line and its mirror image, to round-off: s counts from the start of t = 0, and is negative beyond it."""
    found, mirror = hybrid.run(scene), hybrid.run(exchanged(scene))
    length = float(found["payout/length"][0])
    np.testing.assert_allclose(mirror["s"], length - found["s"][::-1], atol=1e-12 * length)
    tension = np.abs(found["tension"]).max()
    single = found["s"] != 6.0  # where a clump is there are two values
    for name, size in (("position", length), ("tension", tension), ("velocity", 1.0)):
        assert np.abs(mirror[name][:, ::-1] - found[name])[:, single].max() < 1e-8 * size, name
    for name in ("payout/length", "payout/rate", "payout/power", "work/zones"):
        assert np.abs(mirror[name] - found[name]).max() < 1e-8 * (1.0 + np.abs(found[name]).max()), name
    for mine, its in (("reaction_start", "reaction_end"), ("work/start", "work/end")):
        assert np.abs(mirror[mine] - found[its]).max() < 1e-8 * np.abs(found[its]).max(), mine
    for name in ("envelope/tension_max", "envelope/displacement_max", "envelope/max_tension"):
        if name in found:
            np.testing.assert_allclose(mirror[name][::-1], found[name], rtol=1e-8, atol=1e-9, err_msg=name)


# --- resume and Python ------------------------------------------------------------------------------


def test_a_checkpoint_without_the_side_of_the_winch_is_that_of_one_at_the_end() -> None:
    """Files of before winches at the start have ten numbers of a reel."""
    with hybrid.Simulation(hanging({"rate": 0.5, "ramp": 2.0, "longest": 50.0}, 5.0)) as sim:
        sim.advance(2.0)
        line = OnlyLine(sim)
        before, kept = line.paying.reel.numbers.copy(), line.paying.checkpoint()
        line.paying.restore({**kept, "numbers": kept["numbers"][:10]}, line.model)
        assert np.array_equal(line.paying.reel.numbers, before)


def test_a_resume_does_not_pay_out_more_than_the_result_has_points_for(tmp_path: Path) -> None:
    hybrid.run(hanging({"rate": 0.5, "ramp": 2.0}, 5.0), output=tmp_path / "a.h5")
    with pytest.raises(SceneError, match="longest"):
        hybrid.resume(tmp_path / "a.h5", until=10.0)


@pytest.mark.parametrize("side", ["end", "start"])
def test_a_length_set_from_python_is_that_of_the_scene(side: str) -> None:
    """Rates set at every step: the same line as one whose scene gives them, linear in each step."""
    scenes = [hanging({"rates": [[0, 0], [20, 1.0]]}, 10.0, dimension=3), hanging({"longest": 60.0}, 10.0)]
    law, outside = scenes if side == "end" else map(exchanged, scenes)
    given = hybrid.run(law)
    with hybrid.Simulation(outside) as sim:
        while sim.t < 9.99:
            sim.set_payout(0.05 * (sim.t + 0.05))
            sim.step()
        assert sim.length == pytest.approx(40.0 + 0.025 * sim.t**2, abs=1e-9)
        assert getattr(sim.forces(), side)[2] == pytest.approx(-given[f"reaction_{side}"][-1, 2], rel=1e-9)
        result = sim.result()
    np.testing.assert_allclose(result["payout/length"], given["payout/length"], atol=1e-9)


def test_outputs_of_a_length_set_from_python_do_not_know_when_they_are_written() -> None:
    """`save` writes those that wait: outputs within steps, whose length is that of the step, have the same bits."""
    found = []
    for saves in (False, True):
        with hybrid.Simulation(hanging({"longest": 60.0}, 2.0) | {"output": {"every": 0.065}}) as sim:
            while sim.t < 1.99:
                sim.set_payout(0.05 * (sim.t + 0.05))
                sim.step()
                if saves:
                    sim.save()
            found.append(sim.result())
    for name in ("payout/length", "position", "tension"):
        assert found[0][name].tobytes() == found[1][name].tobytes()


def test_wrong_uses_from_python_are_refused_and_harmless() -> None:
    with hybrid.Simulation(hanging({"longest": 60.0}, 5.0)) as sim:
        for bad in (100.0, 1.0, float("nan"), "10", None, True, [40.0]):
            with pytest.raises(ValueError, match="length"):
                sim.set_length(bad)  # type: ignore[arg-type]
        for bad in (float("inf"), "1", None, True):
            with pytest.raises(ValueError, match="rate"):
                sim.set_payout(bad)  # type: ignore[arg-type]
        sim.set_payout(900.0)
        with pytest.raises(ValueError, match="length that is out"):
            sim.step()
        sim.set_payout(0.0)
        sim.step()
        assert sim.forces().end[2] == pytest.approx(-2.0 * 40.0 * G, rel=1e-9)
    with hybrid.Simulation(hanging({"rate": 0.5, "ramp": 2.0}, 5.0)) as sim, pytest.raises(ValueError, match="gives"):
        sim.set_payout(0.1)
    winch = {"winch": {"tension": 600.0, "inertia": 100.0}, "longest": 60.0}
    with hybrid.Simulation(hanging(winch, 5.0)) as sim, pytest.raises(ValueError, match="winch"):
        sim.set_payout(0.1)
    plain = hanging({}, 5.0)
    del plain["ends"]["end"]["payout"]
    with hybrid.Simulation(plain) as sim, pytest.raises(ValueError, match=r"no ends\.end\.payout"):
        sim.set_length(41.0)


# --- refusals ---------------------------------------------------------------------------------------


def refused(scene: dict[str, Any]) -> str:
    with pytest.raises(SceneError) as found:
        hybrid.run(scene)
    return str(found.value)


RATE: dict[str, Any] = {"rate": 0.5, "ramp": 2.0}


@pytest.mark.parametrize(
    ("payout", "where"),
    [
        ({"rate": 0.5}, "payout.ramp"),
        ({"rate": 0.5, "ramp": 4, "until": 3}, "payout.until"),
        ({"rate": 0.5, "ramp": 1, "rates": [[0, 0], [1, 1]]}, "payout.rates"),
        ({"rates": [[0, 1], [5, 1]]}, "payout.rates"),
        ({"rates": [[1, 0], [5, 1]]}, "payout.rates"),
        ({"rates": [[0, 0], [0, 1]]}, "payout.rates"),
        ({"lengths": [[0, 39], [5, 41], [6, 42]]}, "payout.lengths"),
        ({"begin": 4}, "payout.begin"),
        ({"rate": 0.5, "ramp": 1, "longest": 41}, "payout.longest"),
        ({"rate": 5.0, "ramp": 1, "reel": [{"length": 2, "mass": 2}]}, "payout.reel"),
        ({"rate": -20.0, "ramp": 1}, "ends.end.payout"),
        ({"file": "nowhere.csv"}, "payout.file"),
    ],
)
def test_a_length_that_cannot_be_is_refused(payout: dict[str, Any], where: str) -> None:
    assert where in refused(hanging(payout, 6.0))


def test_other_refusals() -> None:
    scene = hanging(RATE, 5.0)
    scene["ends"]["start"] = scene["ends"]["end"] | {"position": [30, 0, 0]}
    assert "ends.start.payout" in refused(scene)
    scene = exchanged(hanging({"rate": 0.5}, 5.0))
    assert "ends.start.payout.ramp" in refused(scene)
    scene = exchanged(hanging({"rate": -20.0, "ramp": 1}, 6.0))
    assert "ends.start.payout" in refused(scene)
    scene = hanging(RATE, 5.0)
    scene["cable"]["attachments"] = [{"kind": "clump", "at": 39.0, "mass": 5.0}]
    assert "cells" in refused(scene)


def test_rates_and_lengths_from_a_file(tmp_path: Path) -> None:
    table = tmp_path / "rates.csv"
    table.write_text("rate,t\n0,0\n0.3,10\n0.6,20\n")
    given = hybrid.run(hanging({"rates": [[0, 0], [10, 0.3], [20, 0.6]]}, 10.0))
    found = hybrid.run(hanging({"file": str(table)}, 10.0))
    assert np.array_equal(given["payout/length"], found["payout/length"])
    assert np.array_equal(given["reaction_end"], found["reaction_end"])
    for text, told in (
        ("", "columns t,rate or t,length"),
        ("t,rates\n0,0\n", "with columns t, rates"),
        ("t,rate\n0,0\n0,1\n", "line 3"),
        ("t,rate\n0,0\n1_0,1\n", "line 3"),  # 10 to Python
        ("t,rate\n0,1\n2,1\n", "line 2"),
        ("t,length\n0,40\n2,41\n", "2 rows"),
        ("t,length\n0,41\n2,41\n4,42\n", "line 2: length = 41"),
        ("t,length\n0,40\n2,30\n# reeled in\n4,-5\n", "line 5: length = -5"),
        ("t,rate\n0,x\n", "line 2"),
    ):
        table.write_text(text)
        message = refused(hanging({"file": str(table)}, 10.0))
        assert "payout.file" in message and "rates.csv" in message and told in message, message
    table.write_text("t,rate\n0,0\n1,1e8\n")  # 20 million cells: nothing of that size is allocated
    assert "at most 1000000 cells" in refused(hanging({"file": str(table)}, 10.0))


# --- the plan ---------------------------------------------------------------------------------------


@pytest.mark.long
def test_the_plan_says_how_long_the_line_will_be() -> None:
    def said(payout: dict[str, Any]) -> str:
        scene = hybrid.validate_scene(hanging(payout, 20.0))
        found = [x for x in plan_rows(scene, hybrid.plan(scene)) if x.startswith("payout")]
        return found[0].split(maxsplit=1)[1]

    assert said({"rate": 0.5, "begin": 2, "ramp": 4}) == "40 to 48 m, at most 0.5 m/s; up to 24 cells"
    assert said({"lengths": [[0, 40], [8, 46], [20, 40]]}).startswith("40 to 40 m through 46")
    assert said({"longest": 60}) == "set from Python: 40 m at t = 0, up to 60 m; up to 30 cells"
    winch = {"tension": 900.0, "inertia": 50}
    assert said({"winch": winch, "longest": 60}).startswith("a winch holds 900 N: 40 m at t = 0, up to 60 m")
    for scene in (clamped(sagging("rod", 2e6, 2e4, 0.0)), sagging("rod", None, 2e4, 0.0)):
        found = hybrid.plan(scene)  # nodes that ride are counted, too
        assert found.payout is not None and found.payout.cells == sum(found.cells) == 40
    plain = hanging({}, 20.0)
    del plain["ends"]["end"]["payout"]
    assert hybrid.plan(plain).payout is None
    more, less = (hybrid.plan(hanging({"rate": x, "ramp": 4}, 100.0)).seconds for x in (2.0, 0.0))
    assert more > 1.1 * less


@pytest.mark.parametrize(
    ("key", "meant"), [("speed", "rate"), ("velocity", "rate"), ("start", "begin"), ("stop", "until")]
)
def test_another_word_for_a_key_of_payout_is_understood(key: str, meant: str) -> None:
    text = refused(hanging({key: 1.0}, 5.0))
    assert f"did you mean {meant}" in text


def test_a_far_end_that_is_let_go_stays_free_when_nodes_enter() -> None:
    """A clamp that has been let go does not come back with the next node."""
    scene = sagging("rod", 2e6, 2e4, duration=7.0)
    scene["ends"]["start"] = clamped_at([0, 0, 0], [1, 0, -0.5], release_at={"time": 2.0})
    result = hybrid.run(scene)
    assert result["payout/length"][-1] > 103.0
    moment = np.linalg.norm(result["moment_start"], axis=1)
    assert moment[result.t < 1.9].min() > 1.0
    assert moment[result.t > 2.1].max() < 1e-9


def test_an_equilibrium_and_a_plan_need_no_step() -> None:
    scene = hanging(RATE, 5.0) | {"time": {"duration": 5.0}}
    assert hybrid.static(scene).tension[-1, -1] == pytest.approx(2.0 * 40.0 * G, rel=1e-6)
    assert hybrid.plan(scene).payout is not None
    with hybrid.Simulation(scene) as sim, pytest.raises(ValueError, match=r"time\.step"):
        sim.step()


def test_the_length_that_is_paid_out_does_not_hang_on_the_duration():
    def lengths(duration):
        rows = [[0, 0], [3, 0.5], [6, 1.0], [10, 1.2]]
        section = {"length": 100, "mass": 4.0, "diameter": 0.03, "axial_stiffness": 1e7}
        end = {"kind": "pinned", "position": [80, 0, 0], "payout": {"rates": rows}}
        ends = {"start": {"kind": "pinned", "position": [0, 0, 0]}, "end": end}
        more = {"model": "catenary", "mesh": {"cells": 20}, "initial": "equilibrium", "output": {"every": 1.0}}
        time = {"duration": duration, "step": 0.05}
        return hybrid.run({"cable": {"sections": [section]}, "ends": ends, "time": time, **more}).payout["length"][:9]

    assert lengths(8.0) == pytest.approx(lengths(12.0), abs=1e-9)


def test_velocity_of_a_line_that_is_paid_out_is_that_of_its_material() -> None:
    section = {"length": 40, "mass": 6, "diameter": 0.06, "axial_stiffness": 5e5, "bending_stiffness": 400}
    weight = {"kind": "body", "mass": 200, "volume": 0.05, "drag_area": 0.3}
    winch = {"rate": 1, "ramp": 1, "begin": 0.1, "longest": 46}
    found = hybrid.run(cable_scene(
        section | {"drag": {"normal": 1.2}}, weight, clamped_at([0, 0, 0], [-0.3, 0, 1], payout=winch), model="rod",
        mesh=20, fluid={"density": 1025}, time=(4.0, 0.04),
        output={"every": 0.08, "points": [float(x) for x in range(0, 41, 2)]}
    ))  # fmt: skip
    rate = (found.position[2:] - found.position[:-2]) / (found.t[2:] - found.t[:-2])[:, None, None]
    assert np.abs(found.velocity[1:-1] - rate)[2:].max() < 0.03  # m/s, of 1.3


@pytest.mark.parametrize("length, at", [(6.7, 2.619), (7.0, 2.736)])
def test_the_equilibrium_of_a_line_with_modules_and_a_winch_at_its_start_is_written(length: float, at: float) -> None:
    section = {"length": length, "mass": 2.0, "diameter": 0.03, "axial_stiffness": 1e5}
    modules = [{"kind": "modules", "range": [at, at + 1.0], "buoyancy": 5.0, "mass": 1.0}]
    winch = {"longest": 2 * length, "winch": {"tension": 30.0, "inertia": 40.0}}
    scene = cable_scene(section, pinned_at(0, 0, 0, payout=winch), pinned_at(0.8 * length, 0, 0), attachments=modules,
                        fluid={"density": 1025}, model="catenary", mesh=11, time=(0.1, 0.02), contact={"self": False})  # fmt: skip
    tension = hybrid.static(scene)["envelope/tension_max"]
    assert tension.size == 14 and np.isfinite(tension).all()


def displacements(trial: bool) -> np.ndarray:
    """Largest displacements of a run from a winch with a clamp; trial: its first step is tried, and taken back."""
    length = 9.401267082947454
    section = {"length": length, "mass": 2.0, "diameter": 0.03, "axial_stiffness": 1e5, "bending_stiffness": 1.0}
    clamp = {
        "kind": "clamped",
        "position": [7.5, 1, 0.31],
        "tangent": [1, 0, 0.3],
        "payout": {"rate": 0.3, "ramp": 0.1},
    }
    scene = cable_scene(
        section, pinned_at(0.1, 0.3, -0.7), clamp, model="rod", mesh=15, time=(0.06, 0.02), contact={"self": False}
    )
    with hybrid.Simulation(scene) as sim:
        if trial:
            saved = sim.save()
            sim.step()
            sim.restore(saved)
        for _ in range(3):
            sim.step()
        return np.asarray(sim.result()["envelope/displacement_max"])


def test_displacements_after_a_step_that_is_taken_back_are_those_without_it() -> None:
    np.testing.assert_array_equal(displacements(True), displacements(False))


def test_velocity_of_the_state_of_a_line_that_is_paid_out_is_that_of_its_material() -> None:
    section = {"length": 40, "mass": 6, "diameter": 0.06, "axial_stiffness": 5e5, "bending_stiffness": 400}
    weight = {"kind": "body", "mass": 200, "volume": 0.05, "drag_area": 0.3}
    clamp = clamped_at([0, 0, 0], [-0.3, 0, 1], payout={"rate": 1, "ramp": 0.5, "longest": 46})
    scene = cable_scene(
        section, weight, clamp, model="rod", mesh=20, fluid={"density": 1025}, time=(1.2, 0.04), output=(0.08, 11)
    )
    with hybrid.Simulation(scene) as simulation:
        while simulation.t < 1.1:
            simulation.step()
        one = simulation.state
        simulation.step()
        two = simulation.state
    places = [np.stack([np.interp(37.0, x.s, x.position[:, i]) for i in range(3)]) for x in (one, two)]
    there = np.stack([np.interp(37.0, one.s, one.velocity[:, i]) for i in range(3)])
    assert np.abs(there - (places[1] - places[0]) / (two.t - one.t)).max() < 0.05  # 1.0 m/s
