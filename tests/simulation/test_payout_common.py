"""What holds of every line that is paid out or taken in: no kicks, energy, the mirror image, resumed bit for bit."""

from __future__ import annotations

from copy import deepcopy
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import test_payout_bending as bending
import test_payout_cells as cells
import test_payout_laws as laws
import test_payout_layers as layers
import test_payout_zones as zones
import test_winch as winch
from bits import resumed
from test_payout import clamped, exchanged, kicks, sagging
from test_system_payout import crane, to_a_buoy

import hybrid
import hybrid.simulation.run_line
from hybrid.errors import SceneError
from hybrid.outputs.probes import Observer
from hybrid.simulation.payout_nodes import NodeChanges
from hybrid.simulation.run_line import observer_of
from tests.inside import calls_of

Tables = dict[str, Any]
MODELS = {
    "catenary": sagging(), "rod": sagging("rod", 2e6, 2e4), "inextensible rod": sagging("rod", None, 2e4),
    "clamp": clamped(sagging("rod", 2e6, 2e4)),
}  # fmt: skip
LAWS = {name: make(0.05) for name, make in laws.SCENES.items()}
HOLDS = {"longest": 130, "winch": {"tension": 2500, "inertia": 300, "damping": 900}}


def with_winch(scene: Tables) -> Tables:
    scene["ends"]["end"]["payout"] = HOLDS
    return scene


def lasting(scene: Tables, duration: float, **more: Any) -> Tables:
    return scene | {"time": scene["time"] | {"duration": duration}} | more


def sprung(name: str) -> Tables:
    """Layers behind a clamp with an angular spring."""
    scene = layers.paid(name)
    scene["ends"]["end"] |= layers.SPRING
    return scene


def of_winch(model: str, duration: float = 20.0, step: float = 0.05) -> Tables:
    scene = winch.sagging("rod" if model == "clamped" else model, duration, step)
    return winch.clamped(scene, [1.0, 0.0, 0.5]) if model == "clamped" else scene


def nearly_in() -> Tables:
    """12 m in cells of 1 m behind a clamp, taken in to 11.03 m, where no cell more may leave, and out again."""
    scene = clamped(sagging("rod", 1e5, 20.0, step=0.025, duration=3.0))
    scene["cable"]["sections"][0] |= {"length": 12.0, "mass": 2.0, "damping": {"mass": 0.5}}
    scene["ends"]["end"] |= {
        "position": [10, 0, 3],
        "payout": {"rates": [[0, 0], [0.5, -0.9], [1.0, -0.9], [1.8, 0.9], [3, 0.5]]},
    }
    return scene | {
        "output": {"every": 0.1},
        "mesh": {"cells": 12},
        "model": {"kind": "adaptive", "curvature_error": 0.03, "hold_time": 0.1},
    }


def of_sections() -> Tables:
    """From a winch at the start, in cells of 100/41 m: 0.7 m of a heavier section, and another one."""
    scene = exchanged(sagging(duration=9.0)) | {"mesh": {"cells": 41}}
    (own,) = scene["cable"]["sections"]
    scene["ends"]["start"]["payout"]["reel"] = [
        own | {"length": 0.7, "mass": 1.5 * own["mass"]},
        own | {"length": 60.0},
    ]
    return scene


def follows() -> Tables:
    model = cells.FOLLOWING | {"force_rod": [[0, 100]], "rod_cell": 0.6}
    return clamped(sagging("rod", 2e6, 2e4) | {"model": model})


# --- kicks ----------------------------------------------------------------------------------------------------


def turned() -> Tables:
    """In space behind a clamp that turns."""
    scene = clamped(sagging("rod", 2e6, 2e4, duration=12.0), [1.0, 0.2, 0.5])
    scene["cable"]["sections"][0]["torsional_stiffness"] = 1.5e4
    scene["ends"]["end"]["motion"] = {"roll": {"amplitude": 10.0, "period": 7.0}, "ramp": 7.0}
    return scene


def short(model: str, EA: float | None, EI: float | None, rate: float, **more: Any) -> Tables:
    return sagging(model, EA, EI, rate, duration=12.0, **more)


def following(EI: float, rate: float, clamp: bool) -> Tables:
    """Of a line taken in with what merges the cells that come near the winch."""
    scene = short("rod", 2e6, EI, rate) | {"model": cells.FOLLOWING | {"force_rod": [[0, 100]]}}
    return clamped(scene) if clamp else scene


MATERIALS = [
    ("catenary", None, None),
    ("catenary", 2e6, None),
    ("rod", 2e6, 2e4),
    ("rod", None, 500),
    ("rod", None, 2e4),
]
BEHIND_CLAMPS = [(2e6, 2e4, 40), (None, 2e4, 40), (None, 500.0, 80)]
# Largest change of the force at the winch within five steps, as a part of its mean, by a node that enters or leaves.
KICKS: dict[str, tuple[Tables, float]] = {
    **{f"{x} {rate}": (short(*x, rate), 1e-3) for x in MATERIALS for rate in (0.8, -0.8)},
    **{f"clamp {EA} {EI} {rate}": (clamped(short("rod", EA, EI, rate, mesh={"cells": n})), 6e-4)
       for EA, EI, n in BEHIND_CLAMPS for rate in (0.8, -0.8)},
    "clamp that turns": (turned(), 1e-3),
    **{f"cells that follow {x}": (following(*x[:3]), x[3])  # every two of stiffness, direction and clamp meet
       for x in ((2e4, 0.8, False, 6e-4), (500.0, 0.8, True, 6e-4), (500.0, -0.8, False, 6e-4), (2e4, -0.8, True, 1e-3))},
    **{f"damped {name}": (layers.damped(lasting(x, 13.5)), 6e-4) for name, x in (
        ("catenary", sagging("catenary", 2e6)), ("rod", MODELS["rod"]), ("clamp", MODELS["clamp"]))},
    **{name: (lasting(x, 14.0), 2e-3) for name, x in LAWS.items()},
    "vortices": (lasting(LAWS["vortices"], 14.0, mesh={"cells": 80}), 2e-3),  # 40 are too few for how it vibrates: 1e-2
    **{f"{name}, clamped: {clamp}": (layers.paid(name, clamp=clamp, duration=14.0), 6e-4)
       for name, clamp in (("layers", True), ("layers", False), ("tension", True), ("table", True))},
}  # fmt: skip


@pytest.mark.long
@pytest.mark.parametrize("name", KICKS)
def test_a_node_that_enters_or_leaves_does_not_kick(name: str) -> None:
    scene, most = KICKS[name]
    assert max(kicks(scene)) < most


# --- energy ---------------------------------------------------------------------------------------------------

# What no work accounts for, as a part of the work at the winch, and how much more there is of it in steps twice as long.
ENERGY: dict[str, tuple[Tables, float, float]] = {
    **{name: (x, 1e-4, 3.0) for name, x in MODELS.items()},
    "table and stiffener": (bending.bent(), 3e-4, 2.5), "cells that follow": (follows(), 5e-5, 3.0),
    **{f"damped {rate}": (layers.damped(layers.rod(rate)), 1e-4, 3.0) for rate in (0.8, -0.8)},
    "damped, a winch": (layers.damped(with_winch(sagging("rod", 2e6, 2e4, duration=8.0))), 5e-4, 3.0),
    **{name: (x, 1e-3, 2.0) for name, x in LAWS.items()},
    **{f"{name} {rate}, clamped: {clamp}": (layers.paid(name, rate, clamp=clamp), 1e-3, 2.0) for name, rate, clamp in (
        ("layers", 0.8, True), ("layers", -0.8, True), ("layers", 0.8, False), ("layers", -0.8, False),
        ("tension", 0.8, True), ("table", -0.8, True), ("damped", 0.8, True), ("locks", 0.8, True))},
    "layers, a spring": (sprung("layers"), 1e-3, 2.0), "layers, a winch": (with_winch(layers.paid()), 1e-3, 2.0),
    "tension by a table": (laws.stretched(laws.TABLE), 3e-4, 2.5), "rope": (laws.stretched(laws.ROPE), 3e-4, 2.5),
    **{f"winch, {model}": (of_winch(model), 1.5e-4, 3.0) for model in ("catenary", "rod", "clamped")},
}  # fmt: skip


@pytest.mark.parametrize("name", ENERGY)
def test_energy_is_balanced(name: str) -> None:
    """What is left falls with the step, through nodes that enter and leave; what slips or is damped loses some."""
    scene, most, order = ENERGY[name]
    steps = (0.04, 0.02) if name == "vortices" else (0.1, 0.05)
    one, two = (hybrid.run(scene | {"time": scene["time"] | {"step": step}}) for step in steps)
    left = [float(np.abs(x["work/scheme"]).max()) for x in (one, two)]
    assert left[1] < most * np.abs(two["work/end"]).max() and left[0] > order * left[1], left
    if name.startswith("damped") and "clamped" not in name and "winch" not in name:
        assert two["work/stiffness_damping"][-1] < -10.0
    if name.startswith(("layers", "table -", "damped 0.8, clamped")) and "winch" not in name:
        assert (np.diff(two["work/hysteresis"]) <= 1e-12).all() and two["work/hysteresis"][-1] < -0.1


# --- said in two ways ---------------------------------------------------------------------------------------------


def never_slipping(rate: float, clamp: bool, **bends: Any) -> Tables:
    """A stiffness of 2e4 N m2, some of it in a layer that never slips unless bends says otherwise."""
    scene = layers.paid(rate=rate, clamp=clamp)
    never = {"bending_stiffness": 2e3, "bending_slip": [{"stiffness": 1.8e4, "moment": 1e9}]}
    scene["cable"]["sections"][0] |= never | bends
    return scene


def without_payout(scene: Tables) -> Tables:
    """The same line, of a fixed length."""
    scene = deepcopy(scene)
    del scene["ends"]["end"]["payout"]
    return scene


BENDS = ("reaction_end", "position", "moment", "energy/bending", "work/end", "work/zones")
STRETCHES = ("reaction_end", "position", "energy/stretch", "work/end")
STIFF, PLAIN = {"axial_stiffness": laws.STIFF}, {"bending_stiffness": 2e4, "bending_slip": []}
RATES = (0.8, -0.8)
# A line, the same line otherwise, and how far it may be off, as a part of the largest value; what is compared.
ALIKE: dict[str, tuple[Tables, list[tuple[Tables, float]], tuple[str, ...]]] = {
    **{f"moments by a table {x}": (bending.paid({"bending_stiffness": bending.EI}, x),
                                   [(bending.paid(bending.SAME, x), 1e-7)], ("curvature", *BENDS)) for x in RATES},
    **{f"tension by a table, or of a rope {x}": (
        laws.stretched(STIFF, x), [(laws.stretched(laws.SAME, x), 1e-7), (laws.stretched(laws.NEAR, x), 2e-5)],
        ("payout/power", *STRETCHES)) for x in RATES},
    **{f"zones, tension by a table {x}": (zones.stretching(STIFF, x), [(zones.stretching(laws.SAME, x), 1e-6)],
                                          ("work/zones", *STRETCHES)) for x in RATES},
    **{f"layers that never slip {x}, clamped: {clamp}": (
        never_slipping(x, clamp, **PLAIN), [(never_slipping(x, clamp), 1e-7)], BENDS)
       for x, clamp in ((0.8, True), (-0.8, True), (0.8, False))},
    **{f"{name}, a rate of zero, clamped: {clamp}": (
        without_payout(scene := layers.paid(name, 0.0, clamp=clamp, duration=2.0)), [(scene, 1e-10)],
        ("position", "reaction_end", "moment", "work/hysteresis"))
       for name in ("layers", "damped") for clamp in (True, False)},
    "damped, a rate of zero": (
        without_payout(scene := layers.damped(sagging("rod", 2e6, 2e4, 0.0, duration=2.0))), [(scene, 1e-12)],
        ("position", "reaction_end", "work/stiffness_damping")),
}  # fmt: skip


@pytest.mark.parametrize("name", ALIKE)
def test_one_line_that_is_said_in_two_ways(name: str) -> None:
    """Forces, places, energies and works, over nodes that enter and leave."""
    scene, others, quantities = ALIKE[name]
    one = hybrid.run(scene)
    assert "zones" not in name or sum(x.kind in zones.CHANGES for x in one.events) >= 2
    for other, most in others:
        two = hybrid.run(other)
        assert "zero" in name or np.abs(np.diff(two["payout/length"])).sum() > 4.0
        for x in quantities:
            assert np.abs(one[x]).max() > 0.0
            assert np.abs(two[x] - one[x]).max() <= most * np.abs(one[x]).max(), x


# --- the mirror image -----------------------------------------------------------------------------------------


def reeled() -> Tables:
    """A rope by a law with another one of the same law on the reel."""
    scene = laws.stretched(laws.ROPE, step=0.1)
    reel = sagging(EA=1.0)["cable"]["sections"][0] | {"mass": 6.0} | laws.ROPE
    del reel["axial_stiffness"]
    scene["ends"]["end"]["payout"]["reel"] = [reel]
    return scene


# Parts of the largest value by which forces and works may differ.
MIRRORED: dict[str, tuple[Tables, float]] = {
    "table and stiffener": (bending.bent(), 1e-7), "damped": (layers.damped(layers.rod(0.8)), 1e-6),
    "torque": (LAWS["torque"], 1e-6), "polyester": (LAWS["polyester"], 1e-6), "reel of rope": (reeled(), 1e-7),
    **{f"{name}, clamped: {clamp}": (layers.paid(name, clamp=clamp), 1e-6) for name, clamp in (
        ("layers", True), ("layers", False), ("tension", True), ("damped", True))},
    **{f"a winch, {model} {dimension}": (of_winch(model, step=0.1) | ({"dimension": dimension} if dimension else {}), 1e-8)
       for model, dimension in (("catenary", None), ("rod", 3), ("clamped", None), ("clamped", 3))},
    "zones that move": (zones.touching(-0.8), 1e-5),
    **{f"cells that follow {rate}": (cells.pinned(rate), 1e-7) for rate in RATES},
}  # fmt: skip


@pytest.mark.parametrize("name", MIRRORED)
def test_the_mirror_image_pays_out_the_same(name: str) -> None:
    scene, most = MIRRORED[name]
    one, other = hybrid.run(scene), hybrid.run(exchanged(scene))
    for mine, its in (("reaction_end", "reaction_start"), ("work/end", "work/start")):
        assert np.abs(other[its] - one[mine]).max() < most * np.abs(one[mine]).max(), mine
    assert np.abs(other.position[:, ::-1] - one.position).max() < 1e-7 * 100.0
    if "moment" in one:
        assert np.abs(other["moment"][:, ::-1] - one["moment"]).max() < 1e-6 * np.abs(one["moment"]).max()
    if "work/hysteresis" in one:
        assert np.abs(other["work/hysteresis"] - one["work/hysteresis"]).max() < 1e-6 * np.ptp(one["work/hysteresis"])
    if name.startswith("a winch"):  # there an iteration takes another right-hand side
        assert np.ptp(one["payout/length"]) > 3.0
        assert other["steps/iterations"].mean() < one["steps/iterations"].mean() + 0.2
    if name == "zones that move":
        assert sum(x.kind in zones.CHANGES for x in one.events) >= 2
        assert [len(x) for x in one.zones] == [len(x) for x in other.zones]


# --- refused --------------------------------------------------------------------------------------------------


def on_the_reel(scene: Tables, **other: Any) -> Tables:
    """A section on the reel that differs from that at the winch; None: without the key."""
    section = scene["cable"]["sections"][0] | other
    scene["ends"]["end"]["payout"]["reel"] = [{key: x for key, x in section.items() if x is not None}]
    return scene


def polyester_by(scene: Tables) -> Tables:
    return on_the_reel(scene, syrope=scene["cable"]["sections"][0]["syrope"] | {"highest_tension": 2500.0})


REEL = "ends.end.payout.reel[0]"
LAYERED = "of the section at the winch"
REFUSED: dict[str, tuple[Tables, tuple[str, ...]]] = {
    "torque": (on_the_reel(laws.twisting(), tension_torque=1e-3), (f"{REEL}.tension_torque",)),
    "vortices": (on_the_reel(laws.shedding(), vortices={"lift": 0.5}), (f"{REEL}.vortices",)),
    "creep": (on_the_reel(laws.creeping(), creep={"per_decade": 5e-3, "loaded": 1.0}), (f"{REEL}.creep",)),
    "polyester": (polyester_by(laws.polyester()), ()),
    "rope": (on_the_reel(laws.stretched(laws.ROPE), **laws.TABLE, dynamic_stiffness=None), (REEL,)),
    "stiffener at the winch": (bending.paid({}) | {"cable": bending.paid({})["cable"] | {
        "attachments": [bending.CONE | {"range": [90, 100]}]}}, ("s = 100 m, and the winch",)),
    "moments": (on_the_reel(bending.paid(bending.TABLE), **bending.SAME), (f"{REEL}.moment_curvature",)),
    "slip": (on_the_reel(layers.paid(), bending_slip=layers.LAYERS[:1]), (LAYERED, f"{REEL}.bending_slip")),
    "tension": (on_the_reel(layers.paid(), stiffness_per_tension=2.0), (LAYERED, f"{REEL}.stiffness_per_tension")),
    "first loading": (on_the_reel(layers.paid("table"), first_loading=False), (LAYERED,)),
    "damped table": (layers.damped(on_the_reel(sagging("catenary"))) | {"cable": {"sections": [
        {"length": 100.0, "mass": 5.0, "tension_strain": [[0, 0], [0.01, 1e4]], "damping": {"stiffness": 0.05}}]}},
        ("damping.stiffness",)),
    "damping": (layers.damped(on_the_reel(sagging("catenary", 2e6))), ("the damping.stiffness of the section at the winch",)),
}  # fmt: skip


@pytest.mark.parametrize("name", REFUSED)
def test_what_differs_at_a_winch_is_refused(name: str) -> None:
    scene, words = REFUSED[name]
    with pytest.raises(SceneError) as refused:
        hybrid.plan(scene)
    assert all(x in str(refused.value) for x in words), refused.value


# --- resumed --------------------------------------------------------------------------------------------------

# Stopped at these times, s.
RESUMED: dict[str, tuple[Tables, tuple[float, ...]]] = {
    "winch at the start": (exchanged(lasting(MODELS["clamp"], 8.0)), (5.0,)),
    # Outputs are looked at together, the last before a stop without those after it: each has the cells it had.
    "torques at a stop": (lasting(LAWS["torque"], 1.5), (1.0,)),
    "damped layers": (sprung("damped"), (5.0,)), "zones by hand": (zones.twisted(zones.BY_HAND), (0.6,)),
    # Cells have just been handed over by the winch, or are merged on their way to it.
    "cells that follow": (zones.touching(0.8, cells.FOLLOWING), (2.0, 4.5)),
    "cells that follow, taken in": (cells.pinned(-0.8), (2.0, 4.5)),
    "cells that follow, before they change": (zones.touching(0.8, cells.FOLLOWING) | {"output": {"every": 0.1}}, (0.1,)),
    "tension at the start": (exchanged(of_winch("catenary", 6.0, 0.1)), (4.0,)),
    "to the shortest and back": (nearly_in(), (0.9,)),
    "sections from the start": (of_sections(), (7.0,)),
    "winch of a load": (winch.lowered(model="adaptive"), (4.0,)),
    "crane": (crane(), (3.0,)), "buoy": (to_a_buoy(-0.8), (5.0,)),
}  # fmt: skip


@pytest.mark.long
@pytest.mark.parametrize("name", RESUMED)
def test_resumed_bit_for_bit(name: str, tmp_path: Path) -> None:
    scene, stops = RESUMED[name]
    held = [
        *scene.get("ends", {}).values(),
        *(y for x in scene.get("lines", {}).values() for y in x.get("connections", {}).values()),
    ]
    for law in (x["payout"] for x in held if "payout" in x):
        law.setdefault("longest", 120.0)
    whole = resumed(scene, tmp_path, *stops)
    for line in whole.lines.values() or [whole]:
        assert "payout/length" not in line or np.ptp(line["payout/length"]) > 0.01


@pytest.mark.parametrize("scene", [nearly_in(), of_sections()], ids=["cells that follow", "from the start"])
def test_the_mesh_of_an_output_has_the_nodes_that_ride_with_the_winch(scene: Tables) -> None:
    """Those of the line that steps have led to then; both ends of its zones are among them."""
    result, stepped = hybrid.run(scene), hybrid.Simulation(scene)
    sizes = set()
    for i, t in enumerate(result.times):
        while stepped.t < t - 1e-9:
            stepped.step()
        mesh, zones = result.mesh[i], result.zones[i]
        np.testing.assert_allclose(mesh.s, stepped._run.lines[0].model.line.s, rtol=0, atol=1e-13)
        assert [zones[0].s_a, zones[-1].s_b] == pytest.approx(mesh.s[[0, -1]], abs=1e-12)
        sizes.add(mesh.s.size)
    assert len(sizes) > 1


def test_a_file_that_does_not_say_which_nodes_ride_goes_on(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As earlier programs wrote it: what follows is the same, and nobody is told of a mesh that it does not have."""
    scene, lacks = nearly_in(), ("mesh/there", "mesh/rides")
    scene["ends"]["end"]["payout"]["longest"] = 13.0
    whole, path = hybrid.run(scene), tmp_path / "part.h5"

    def older(*args: Any, **options: Any) -> Observer:
        observer = observer_of(*args, **options)
        observer.leave_out(lacks)
        return observer

    with monkeypatch.context() as patched:
        patched.setattr(hybrid.simulation.run_line, "observer_of", older)
        hybrid.run(scene | {"time": scene["time"] | {"duration": 1.5}}, path).close()
    found = hybrid.resume(path, until=float(whole.times[-1]))
    assert not {*lacks} & {*found.names}
    np.testing.assert_array_equal(found.position, whole.position)
    with pytest.raises(KeyError, match="earlier program"):
        _ = found.mesh


BACK = {
    "zones that move": zones.touching(), "cells that follow": cells.pinned(0.8), "buoy": to_a_buoy(),
    "winch": winch.vertical(duration=20.0, damping=50.0), "winch in a plane": winch.lowered() | {"dimension": 2},
}  # fmt: skip


@pytest.mark.long
@pytest.mark.parametrize("name", BACK)
def test_a_step_is_taken_back(name: str) -> None:
    """`save` and `restore` over nodes that enter, and over zones or cells that change."""
    with hybrid.Simulation(BACK[name]) as sim:
        sim.advance(4.0)
        saved, forces = sim.save(), []
        for _ in range(2):
            sim.advance(6.0)
            named = {"buoy": "cable", "winch in a plane": "one"}.get(name)
            forces.append(np.concatenate(sim.forces(named)) if named else sim.forces().end.copy())
            sim.restore(saved)
    assert np.array_equal(*forces)


# --- as other lines -------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("model", "like"), [(zones.ADAPTIVE, 40), (cells.FOLLOWING, 320)], ids=["zones", "cells"])
def test_a_winch_that_holds_a_tension_has_the_length_of_rods(model: Any, like: int) -> None:
    lengths = []
    for each, count in ((model, 40), ("rod", like)):
        scene = cells.pinned(0.0, model=each, mesh={"cells": count})
        hold = {"tension": 800.0, "inertia": 300.0, "damping": 50.0, "max_rate": 2.0, "ramp": 4.0}
        scene["ends"]["end"]["payout"] = {"longest": 130.0, "winch": hold}
        lengths.append(hybrid.run(scene)["payout/length"])
    assert np.ptp(lengths[1]) > 3.0
    assert np.abs(lengths[0] - lengths[1]).max() < 0.02


# --- nodes that enter and leave within the steps ----------------------------------------------------------------

STEPPED = {
    **{name: LAWS[name] for name in ("creep", "torque", "polyester", "vortices")},
    "vortices from the start": exchanged(LAWS["vortices"]),
    "layers": layers.paid("layers"),
    "layers, taken in": layers.paid("layers", rate=-0.8),
    "table": layers.paid("table"),
}


@pytest.mark.parametrize("name", STEPPED)
def test_nodes_of_lines_with_laws_change_as_with_another_solver(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    one_by_one = calls_of(monkeypatch, NodeChanges, "change_once")
    found = hybrid.run(STEPPED[name])
    assert not one_by_one
    monkeypatch.setattr(NodeChanges, "may_change", lambda *_: False)
    other = hybrid.run(STEPPED[name])
    assert len(one_by_one) >= 2
    for of in ("position", "tension", "steps/end_force_end", "work/scheme", "work/zones", "envelope/curvature_max"):
        if of in found.names:
            most = (
                1e-10 * np.nanmax(np.abs(other[of]))
                if of.startswith("work")
                else 4.0 * np.spacing(np.nanmax(other[of]))
            )
            np.testing.assert_allclose(found[of], other[of], rtol=0.0, atol=most, err_msg=of)
