"""Tangents along the steps of a run against differences of runs in the same steps."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import hybrid
from hybrid.designs.in_motion import (
    DIFFERENCES,
    TANGENTS,
    Motion,
    by_differences,
    by_tangents,
    in_motion,
    size_of,
)
from hybrid.designs.numbers_and_results import changed_scene, number_of, parse_wanted
from hybrid.designs.replay import course_of
from hybrid.designs.tangents import NetworkOthers, Unfollowed
from hybrid.kernels.state.report import PLANAR
from tests.designs.test_in_motion import asked_of, heaved, on_the_bed
from tests.inside import calls_of
from tests.scenes import cable_scene, clamped_at, pinned_at

OF = ["max tension@240", "last tension@100", "std position.z@150", "max velocity.z@200", "t=3.31 tension@120"]
SECTION = "cable.sections[0]"


def both(tables: dict[str, Any], of: list[str], keys: list[str]) -> tuple[np.ndarray, ...]:
    """(P, W) derivatives by tangents and by differences, their errors in turn, and results by numbers."""
    asked = asked_of(tables, of, keys)
    found, theirs = by_tangents(*asked), by_differences(*asked)
    np.testing.assert_allclose(found.values, theirs.values, rtol=1e-12)
    floor = np.abs(found.values) / np.array(list(asked[-1].values()))[:, None]
    return found.derivatives, theirs.derivatives, found.errors, theirs.errors, floor


def agree(tables: dict[str, Any], of: list[str], keys: list[str], part: float = 1e-5) -> None:
    """Within both stated errors; what answers less than a thousandth, in parts by parts, is compared with that."""
    ours, theirs, stated, errors, floor = both(tables, of, keys)
    whole = np.maximum(np.abs(theirs), 1e-3 * floor)
    assert (np.abs(ours - theirs) <= part * whole + 2.0 * errors + stated).all(), (ours, theirs, errors, stated)
    assert (errors <= 1e-4 * whole).mean() > 0.7  # else differences would say nothing
    assert (stated <= 1e-4 * np.maximum(np.abs(theirs), 0.1 * floor)).all()
    assert (np.abs(ours - theirs) <= 1e-6 * whole + 2.0 * errors).mean() > 0.7


def in_water(tables: dict[str, Any]) -> dict[str, Any]:
    """In waves and a current across, so that it leaves its plane."""
    waves = {"kind": "regular", "height": 3.0, "period": 8.0, "direction": 40.0}
    tables["environment"]["fluid"] |= {"current": [0.2, 0.3, 0.0], "waves": waves, "surface": 1.0}
    return tables


def twisted() -> dict[str, Any]:
    """A hose that is clamped and twisted, with polar inertia and damping."""
    section = {
        "length": 12.0, "mass": 6.0, "diameter": 0.1, "axial_stiffness": 1e6, "bending_stiffness": 40.0,
        "torsional_stiffness": 40.0, "damping": {"stiffness": 0.01},
    }  # fmt: skip
    moved = {"heave": {"amplitude": 0.4, "period": 2.0}, "ramp": 1.0}
    return cable_scene(
        section, clamped_at([0, 0, 0], [1, 0, -1], normal=[0, 1, 0], turns=0.3),
        clamped_at([8, 1, 1], [1, 0, 1], normal=[0, 1, 0], motion=moved), model="rod", mesh=24, time=(2.0, 0.02),
        output=(0.07, 25)
    )  # fmt: skip


KEYS = [f"{SECTION}.drag.normal", f"{SECTION}.mass", "environment.gravity", "ends.end.motion.heave.amplitude"]


@pytest.mark.long
@pytest.mark.parametrize("model", ["catenary", "rod"])
def test_a_touchdown_that_moves(model: str) -> None:
    agree(on_the_bed(model), OF, KEYS)


@pytest.mark.long
@pytest.mark.parametrize("model", ["catenary", "rod"])
def test_a_line_in_a_plane_is_followed_in_it(model: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """With the same tangents as in space, where it goes by a number that moves its plane."""
    tables, of, found = on_the_bed(model), ["last tension@start", "std position.z@150", "max tension@end"], []
    bits = calls_of(
        monkeypatch, NetworkOthers, "_call_each_step", after=lambda _, x, *__: x._model.models[0].line.bits & PLANAR
    )
    tables["time"]["duration"] = 2.0
    for dimension, beside in ((None, []), (3, []), (None, ["ends.end.position[1]"])):
        scene = hybrid.validate_scene(tables | ({"dimension": dimension} if dimension else {}))
        found.append(in_motion(scene, of, KEYS + beside).derivatives[: len(KEYS)])
    assert [x > 0 for x in bits] == [True, False, False]
    np.testing.assert_allclose(found[0], found[1], rtol=2e-6, atol=1e-6 * np.abs(found[1]).max())
    np.testing.assert_allclose(found[1], found[2], rtol=1e-12)


@pytest.mark.long
def test_zones_that_stay() -> None:
    zones = {"kind": "zones", "zones": [{"catenary": 150.0, "cells": 25}, {"rod": 100.0, "cells": 20}]}
    agree(on_the_bed() | {"model": zones, "mesh": None}, OF, KEYS)


def test_a_line_that_starts_as_it_is_placed() -> None:
    """Free at its end: the tangents of the first shape are those of the places that it is given."""
    section = {"length": 40.0, "mass": 5.0, "axial_stiffness": 1e6, "bending_stiffness": 50.0, "diameter": 0.03}
    tables = cable_scene(
        section, pinned_at(0, 0, 0), {"kind": "free"}, initial={"kind": "straight", "direction": [1, 0, 0.2]},
        model="rod", mesh=20, time=(0.8, 0.02, 0.5)
    )  # fmt: skip
    of = ["last tension@20", "last position.z@20"]
    agree(tables, of, [f"{SECTION}.mass", "environment.gravity"])


def test_a_phase_that_is_nothing() -> None:
    """A part of a degree would be lost in the rounding of places: angles are changed by parts of a radian."""
    tables, key = on_the_bed(), "ends.end.motion.heave.phase"
    agree(tables, ["last tension@end", "std position.z@150"], [key])
    scene = hybrid.validate_scene(tables)
    assert size_of(scene, key, 0.0) == pytest.approx(180.0 / np.pi)


@pytest.mark.long
def test_waves_and_a_current_across() -> None:
    """In steps in which 13 of 15 agree to 1e-6; where Newton stops leaves 1e-6 to 3e-6 of more in steps of 0.05 s."""
    tables = in_water(on_the_bed("rod")) | {"time": {"duration": 4.0, "step": 0.025}}
    agree(tables, OF, [f"{SECTION}.drag.normal", f"{SECTION}.mass", "environment.fluid.waves.height"])


@pytest.mark.long
def test_a_hose_that_is_twisted_and_damped() -> None:
    """Between outputs, too, which are not at the ends of steps."""
    of = ["std position.z@5", "last position.y@7", "last torque@6", "max curvature@6", "last tension@6"]
    keys = [f"{SECTION}.{x}" for x in ("mass", "torsional_stiffness", "bending_stiffness")]
    agree(twisted(), of, [*keys, "ends.start.turns", "ends.end.motion.heave.amplitude"])


@pytest.mark.parametrize("bed", [False, True])
def test_lengths_move_nodes_into_contact_and_past_places(bed: bool) -> None:
    """Differences go by kinks as nodes come down, and go by places: they come nearer to the tangent, the smaller they are.

    150 m is at a node, to one side of which alone a length would be seen.
    """
    tables = on_the_bed()
    if not bed:
        del tables["environment"]["seabed"]
        tables["ends"]["start"]["position"] = [0, 0, 0]
    scene, key = hybrid.validate_scene(tables), f"{SECTION}.length"
    of = ["last tension@end", "last tension@150", "max tension@152", "std position.z@150", "last position.x@151"]
    wanted, course, number = [parse_wanted(scene, x, moves=True) for x in of], course_of(scene), number_of(scene, key)
    ours = by_tangents(scene, wanted, course, {key: number}, {key: number}).derivatives[0]
    off = []
    for part in (1e-4, 1e-6):
        more, less = (
            Motion(changed_scene(scene, key, number * (1.0 + x)), wanted, course).values for x in (part, -part)
        )
        off.append(np.abs((more - less) / (2.0 * part * number) - ours) / np.abs(ours))
    assert (off[1] < 1e-5).all()
    # Differences of runs have what Newton's method leaves, 1e-6 of a tension.
    assert (off[1] < np.maximum(off[0], 1e-6)).all()


def test_what_is_not_followed_is_left_to_differences_and_said() -> None:
    tables, key = on_the_bed(), f"{SECTION}.mass"
    tables["environment"]["seabed"]["friction"] = 0.5
    tables["time"]["duration"] = 1.0
    found = in_motion(hybrid.validate_scene(tables), ["last tension@end"], [key])
    assert found.ways == (f"{DIFFERENCES}: friction of the bed",)
    del tables["environment"]["seabed"]["friction"]
    asked = hybrid.validate_scene(tables)
    assert in_motion(asked, ["last tension@end"], [key]).ways == (TANGENTS,)
    assert hybrid.sensitivity(asked, ["last tension@end"], [key], motion=True)[0].way == TANGENTS


def test_loads_that_change_are_noticed() -> None:
    tables = heaved()
    tables["ends"]["end"]["thrust"] = {"value": [0, 0, -100.0], "until": 5.0}
    scene = hybrid.validate_scene(tables | {"time": {"duration": 6.0, "step": 0.1, "rho_inf": 0.5}})
    assert "loads change" in in_motion(scene, ["last tension@start"], [f"{SECTION}.mass"]).ways[0]


@pytest.mark.long
def test_numbers_that_are_not_followed_are_differenced_beside_those_that_are(monkeypatch: pytest.MonkeyPatch) -> None:
    """As if a place made another line; in the order asked for."""
    plain, tables = NetworkOthers._other, on_the_bed()

    def other(self: NetworkOthers, model: Any, k: int, h: float) -> Any:
        if abs(model.models[0].ends.at_time(0.0).position[1, 1]) > 0.0:
            raise Unfollowed("the number is not followed")
        return plain(self, model, k, h)

    monkeypatch.setattr(NetworkOthers, "_other", other)
    tables["time"]["duration"] = 1.0
    scene, of = hybrid.validate_scene(tables), ["last tension@150"]
    keys = [f"{SECTION}.mass", "ends.end.position[1]", "environment.gravity"]
    found = in_motion(scene, of, keys)
    assert found.ways == (TANGENTS, f"{DIFFERENCES}: the number is not followed", TANGENTS)
    for key, row, errors in zip(keys, found.derivatives, found.errors, strict=True):
        alone = in_motion(scene, of, [key])
        np.testing.assert_array_equal(row, alone.derivatives[0])
        np.testing.assert_array_equal(errors, alone.errors[0])
    assert abs(found.derivatives[1, 0]) < 1e-6 * abs(found.values[0])  # N per m across the line, by symmetry


def test_outputs_of_a_section_that_are_others_are_refused() -> None:
    """Two sections that are alike have no output where they meet, and have one as soon as a number tells them apart."""
    tables = on_the_bed("rod")
    (section,) = tables["cable"]["sections"]
    lengths = 101.7, section["length"] - 101.7
    tables["cable"]["sections"] = [section | {"length": x} for x in lengths]
    tables["time"]["duration"] = 1.0
    with pytest.raises(hybrid.ComputationError, match="outputs of a section are more or fewer"):
        in_motion(hybrid.validate_scene(tables), ["max curvature@sections[1]"], [f"{SECTION}.mass"])
