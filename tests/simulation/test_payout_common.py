"""What holds of every line that is paid out or taken in: no kicks, energy, the mirror image, resumed bit for bit."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import test_payout_bending as bending
import test_payout_cells as cells
import test_payout_damping as damping
import test_payout_laws as laws
import test_payout_layers as layers
import test_payout_zones as zones
import test_winch as winch
from bits import resumed
from test_payout import clamped, exchanged, kicks, sagging
from test_system_payout import crane, to_a_buoy

import hybrid

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
    **{f"damped {name}": (damping.damped(lasting(x, 13.5)), 6e-4) for name, x in (
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
    **{f"damped {rate}": (damping.damped(damping.rod(rate)), 1e-4, 3.0) for rate in (0.8, -0.8)},
    "damped, a winch": (damping.damped(with_winch(sagging("rod", 2e6, 2e4, duration=8.0))), 5e-4, 3.0),
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
    "table and stiffener": (bending.bent(), 1e-7), "damped": (damping.damped(damping.rod(0.8)), 1e-6),
    "torque": (LAWS["torque"], 1e-6), "polyester": (LAWS["polyester"], 1e-6), "reel of rope": (reeled(), 1e-7),
    **{f"{name}, clamped: {clamp}": (layers.paid(name, clamp=clamp), 1e-6) for name, clamp in (
        ("layers", True), ("layers", False), ("tension", True), ("damped", True))},
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
    "tension at the start": (exchanged(of_winch("catenary", 6.0, 0.1)), (4.0,)),
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


BACK = {
    "zones that move": zones.touching(), "cells that follow": cells.pinned(0.8), "buoy": to_a_buoy(),
    "winch": winch.vertical(duration=20.0, damping=50.0),
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
            forces.append(sim.forces("cable")[1] if name == "buoy" else sim.forces().end.copy())
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
