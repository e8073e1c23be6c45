"""What a joint takes of the curvature of a rod is put back in results: a line with a joint against rods everywhere."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest
from scipy.linalg import solve_banded

import hybrid
from hybrid.outputs.probes import layer_missed, shown_at_clamp
from tests.scenes import cable_scene, clamped_at, pinned_at

LENGTH, JOINT = 100.0, 40.0
EI = 5e4  # N m2


def sag(model: Any, cells: int, turned: bool = False, across: Any = 0.0, up: float = 0.0) -> hybrid.Result:
    """The sag at rest."""
    return hybrid.static(sagging(model, cells, turned, across, up))


def sagging(model: Any, cells: int, turned: bool = False, across: Any = 0.0, up: float = 0.0) -> dict[str, Any]:
    """A sag between two pins at rest, its tension some 9 kN: sqrt(EI/T) is 2.4 m; outputs at nodes and middles.

    turned: counted from the other end; across: m/s, of a current that leads it out of its plane, or as a table by z;
    up: m, height of the other pin, as far away.
    """
    section = {"length": LENGTH, "mass": 20.0, "diameter": 0.05, "axial_stiffness": 1e8, "bending_stiffness": EI,
               "drag": {"normal": 1.2}}  # fmt: skip
    far = float(np.sqrt(96.0**2 - up**2))
    one, two = ({"kind": "pinned", "position": x} for x in ([0, 0, 0], [far, 0, up]))
    if turned:
        one, two = two, one
        if isinstance(model, dict):
            model = {"kind": "zones", "zones": model["zones"][::-1]}
    return cable_scene(
        section, one, two, fluid={"density": 1025, "current": [0, across, 0] if isinstance(across, float) else across},
        model=model, mesh=cells, output={"points": 2 * cells + 1}
    )  # fmt: skip


ZONES = {"kind": "zones", "zones": [{"catenary": JOINT}, {"rod": LENGTH - JOINT}]}


@pytest.mark.parametrize("across", [0.0, 0.5], ids=["plane", "space"])
@pytest.mark.parametrize("cells", [25, 50, 100])
def test_curvature_goes_on_through_a_joint(cells: int, across: float) -> None:
    """Cells of 1.7, 0.8 and 0.4 of sqrt(EI/T): within 1 % of the rod's, of which the joint takes all."""
    rods, zones = sag("rod", cells, across=across), sag(ZONES, cells, across=across)
    near = np.abs(rods.s - JOINT) < 15.0
    assert np.abs(zones.curvature - rods.curvature)[..., near].max() < 0.01 * rods.curvature[..., near].max()
    node = int(np.argmin(np.abs(rods.s - JOINT)))
    assert zones.bending_moment[..., node].max() < 1e-6 * EI * rods.curvature.max()  # it passes none


def test_what_loads_the_joint_alone_is_in_results() -> None:
    """A thin jet across a joint of a slanting line whose neighbours are out of it: they do not know its bend."""
    rest = sag("rod", 25, up=70.0)
    z = float(np.interp(JOINT, rest.s, rest.position[0, :, 2]))
    jet = [{"z": z + x, "velocity": [0, y, 0]} for x, y in ((2, 0), (0.7, 4), (-0.7, 4), (-2, 0))]
    rods, zones = (sag(model, 25, across=jet, up=70.0) for model in ("rod", ZONES))
    node = int(np.argmin(np.abs(rods.s - JOINT)))
    peak, beside = rods.curvature[0, node], rods.curvature[0, node - 2 :: 4][:2]
    assert peak > 1.2 * beside.max()
    assert zones.curvature[0, node] == pytest.approx(peak, rel=0.05)


def test_from_the_other_end_it_is_the_same() -> None:
    one, other = sag(ZONES, 50), sag(ZONES, 50, turned=True)
    np.testing.assert_allclose(other.curvature[..., ::-1], one.curvature, atol=1e-7 * one.curvature.max())


def test_what_is_put_back_is_the_discrete_layer_of_a_hinge() -> None:
    """The moment of a rod is what is computed; with EI f^n of the curvature at the joint it is that of the whole."""
    zones = sag(ZONES, 50)
    h, node = LENGTH / 50, int(np.argmin(np.abs(zones.s - JOINT)))
    curvature, moment, T = (np.ravel(x) for x in (zones.curvature, zones.bending_moment, zones.tension))
    half = 1.0 + 0.5 * h * h * T[node + 1] / EI
    f = half - np.sqrt(half * half - 1.0)
    for n in range(1, 6):
        back = curvature[node + 2 * n] - moment[node + 2 * n] / EI
        assert back == pytest.approx(curvature[node] * f**n, rel=0.01)


@cache
def fine_rods(across: float) -> hybrid.Result:
    return sag("rod", 800, across=across)


def off_fine_rods(found: hybrid.Result, across: float = 0.0) -> float:
    """Largest difference of curvature beside the pins, over the largest curvature, at all output points."""
    fine = fine_rods(across)
    true = np.interp(found.s, fine.s, fine.curvature[0])
    near = np.minimum(found.s, LENGTH - found.s) < 15.0
    return float(np.abs(found.curvature[0] - true)[near].max() / true.max())


@pytest.mark.parametrize("across", [0.0, 0.5], ids=["plane", "space"])
@pytest.mark.parametrize("cells", [12, 25, 50, 100, 400])
def test_curvature_of_a_catenary_fades_at_its_pins(cells: int, across: float) -> None:
    """As that of a fine rod, whose ends bear no moment: within 1 %, at nodes and between them, on cells of 0.1 to 3.5 of

    sqrt(EI/T): between long ones no straight line shows it.
    """
    plain = sag("catenary", cells, across=across)
    assert off_fine_rods(plain, across) < 0.01
    np.testing.assert_array_equal(plain.curvature[..., [0, -1]], 0.0)


def with_mesh(scene: dict[str, Any], **mesh: Any) -> hybrid.Result:
    return hybrid.static(scene | {"mesh": mesh})


@pytest.mark.parametrize("ratio", [0.6, 1.7])
def test_cells_may_be_of_all_lengths(ratio: float) -> None:
    lengths = ratio ** np.arange(6.0)
    nodes = np.concatenate([[0.0], np.cumsum(lengths / lengths.sum() * 10.0), np.arange(12.0, 100.5, 2.0)])
    assert off_fine_rods(with_mesh(sagging("catenary", 100), nodes=[float(x) for x in nodes])) < 0.015


def test_it_goes_on_through_what_does_not_bend_otherwise() -> None:
    """Two sections that differ in drag alone, or a clump that weighs nothing, 2 m from the pin."""
    scene = sagging("catenary", 100)
    (section,) = scene["cable"]["sections"]
    cut = [section | {"length": 2.0, "drag": {"normal": 1.0}}, section | {"length": LENGTH - 2.0}]
    assert off_fine_rods(hybrid.static(scene | {"cable": {"sections": cut}})) < 0.01
    clump = {"sections": [section], "attachments": [{"kind": "clump", "at": 2.0, "mass": 1e-9}]}
    assert off_fine_rods(hybrid.static(scene | {"cable": clump})) < 0.01


def test_it_stays_where_an_end_has_a_moment() -> None:
    """A catenary does not feel it, so it cannot know what a rod would do there."""
    scene = sagging("catenary", 50)
    scene["ends"]["end"] = {"kind": "free", "force": [9000.0, 0.0, 9810.0], "moment": [0.0, 100.0, 0.0]}
    found = hybrid.static(scene)
    assert found.curvature[0, -1] > 0.9 * found.curvature[0, -2] > 0.0
    assert found.curvature[0, 0] == 0.0


@pytest.mark.parametrize("model", ["catenary", ZONES, {"kind": "adaptive"}], ids=["catenary", "zones", "adaptive"])
def test_extremes_of_steps_have_it_too(model: Any) -> None:
    """Of a line that stays at rest extremes over all steps are what outputs show at its nodes."""
    scene = sagging(model, 50, across=0.5)
    scene["time"] = {"duration": 0.2, "step": 0.1}
    scene["output"] |= {"every": 0.1, "points": 51}
    found = hybrid.run(scene)
    low, high = (found["envelope"][f"curvature_{x}"] for x in ("min", "max"))
    shown = found.curvature
    np.testing.assert_allclose(high, shown.max(axis=0), rtol=1e-6, atol=1e-9)
    np.testing.assert_allclose(low, shown.min(axis=0), rtol=1e-6, atol=1e-9)


def test_a_clamp_that_lets_go_leaves_an_end_without_a_moment() -> None:
    """Before, the catenary does not know what the clamp bends; from then on a rod has no curvature there."""
    scene = sagging("catenary", 50, across=0.7)
    (section,) = scene["cable"]["sections"]
    del section["axial_stiffness"]
    section |= {"bending_stiffness": 500.0, "drag": {"normal": 1.2, "tangential": 0.02}}
    scene["ends"]["end"] = clamped_at([0.0, 12.0, -98.5], [0.0, 0.4, -1.0], release_at={"time": 0.5})
    scene |= {"time": {"duration": 1.5, "step": 0.05}}
    scene["output"] |= {"every": 0.25, "points": 51}
    found = hybrid.run(scene)
    assert "end released" in {event.kind for event in found.events}
    held, free = found.curvature[0, -1], found.curvature[3:, -1]
    assert held > 0.5 * found.curvature[0].max()
    np.testing.assert_array_equal(free, 0.0)


# --- What cells miss of the bending of a rod beside its ends, where it fades within less than a few of them ---


@pytest.mark.parametrize("fade", [0.01, 0.3, 3.0, 100.0])
@pytest.mark.parametrize("turns", [0.0, 0.5, 3.0])
def test_a_moment_that_fades_is_found_exactly(fade: float, turns: float) -> None:
    s, at = np.array([0.0, 1.0, 2.3]), np.linspace(0.0, 2.3, 47)
    line, part = np.array([[0.2, -0.1, 0.0], [0.03, 0.0, 0.1]]), np.array([2.0, -1.0, 0.5])

    def moment(x: np.ndarray, size: float = 1.0) -> np.ndarray:
        return line[0] + line[1] * x[:, None] + size * part * np.exp(-x[:, None] / fade)

    straight = np.stack([np.interp(at, s, x) for x in moment(s).T], axis=1)
    exact = moment(at, 1.0 / shown_at_clamp(1.0 / fade, turns) if turns else 1.0)
    off = np.linalg.norm(exact - straight, axis=1)
    np.testing.assert_allclose(layer_missed(s, moment(s), fade, at, turns), off, atol=1e-7 * off.max())


@pytest.mark.parametrize("x", [0.001, 0.03, 0.3, 1.0, 4.0, 30.0])
@pytest.mark.parametrize("turns", [0.5, 4.0])
def test_what_cells_show_of_the_moment_at_a_clamp(x: float, turns: float) -> None:
    """Beside the balance of moments of many cells, of length x fades; all of it on short ones."""
    count = max(8, int(30.0 / x)) if x > 0.01 else 4000
    diagonal = np.full(count, -2.0 - x * x)
    diagonal[0] += 1.0 - 1.0 / turns
    right = np.zeros(count)
    right[0] = -1.0 / turns
    banded = np.array([np.ones(count), diagonal, np.ones(count)])
    if x <= 0.01:  # the last of these cells goes on as exp(-s/fade)
        banded[1, -1] += 1.0 + 0.5 * x * x - x * np.sqrt(1.0 + 0.25 * x * x)
    phi = solve_banded((1, 1), banded, right)
    shown = (1.0 - phi[0]) / (turns * x) * (1.0 + (turns - 0.5) * x)
    assert shown_at_clamp(x, turns) == pytest.approx(shown, rel=1e-6)
    assert shown_at_clamp(x, turns) == pytest.approx(1.0, abs=0.25 * x)


def line(start: dict, EI: float, points: int = 201) -> dict:
    return cable_scene(
        {"length": 64.0, "mass": 1.0, "bending_stiffness": EI}, {"position": [0, 0, 0], **start},
        pinned_at(57.0, 0, 5.0), output={"points": points}
    )  # fmt: skip


def effectivity(result: hybrid.Result, truth: hybrid.Result, name: str) -> float:
    return float(np.max(result.errors[f"total/{name}"]) / np.abs(result[name] - truth[name]).max())


CLAMPED = {"kind": "clamped", "tangent": [0.5, 0, 0.8]}
SOFT = CLAMPED | {"bend_stiffness": 30.0}


@pytest.mark.parametrize(
    "start, EI", [({"kind": "pinned"}, 50.0), (CLAMPED, 1.0), (CLAMPED, 50.0), (CLAMPED, 1e3), (SOFT, 50.0)]
)
def test_curvature_of_an_equilibrium_beside_its_ends(start: dict, EI: float) -> None:
    """80 equal cells, of a tenth to six times sqrt(EI/T): figures were 0.01 to 0.5 of the error."""
    scene = line(start, EI)
    truth = hybrid.static(scene | {"model": "rod", "accuracy": {"curvature": "0.05%"}})
    fixed = {"model": "rod", "mesh": {"cells": 80}, "output": scene["output"] | {"errors": True}}
    result = hybrid.static(scene | fixed)
    for name in ("curvature", "bending_moment"):
        assert 0.7 <= effectivity(result, truth, name) <= 3.0
        assert name not in result.attributes.get("errors_not_converged", "")


def test_curvature_beside_a_load() -> None:
    scene = line({"kind": "pinned"}, 5.0)
    scene["cable"] |= {"attachments": [{"kind": "clump", "at": 20.0, "mass": 20.0, "volume": 0.0}]}
    truth = hybrid.static(scene | {"model": "rod", "accuracy": {"curvature": "0.05%"}})
    fixed = {"model": "rod", "mesh": {"cells": 80}, "output": scene["output"] | {"errors": True}}
    assert 0.7 <= effectivity(hybrid.static(scene | fixed), truth, "curvature") <= 3.0


@pytest.mark.parametrize("first", [True, False])
def test_curvature_between_nodes_of_rods_is_straight_beside_a_short_catenary(first: bool) -> None:
    """sqrt(EI/T) is 2 m, the catenary 4 m: not all of its layer has faded at the joint."""
    zones = [{"catenary": 4, "cells": 2}, {"rod": 96, "cells": 48}]
    section = {"length": 100, "mass": 20.0, "axial_stiffness": 1e7, "bending_stiffness": 4e4}
    found = hybrid.static(cable_scene(section, pinned_at(0, 0, 0), pinned_at(70, 0, 0), output={"points": 101},
                                      model={"kind": "zones", "zones": zones if first else zones[::-1]}))  # fmt: skip
    curvature = found.curvature[0] if first else found.curvature[0][::-1]
    nodes, between = curvature[6::2], curvature[7::2]
    assert between == pytest.approx(0.5 * (nodes[1:] + nodes[:-1]), rel=1e-3)
