"""Derivatives at rest by one transposed solve for each result, against those by a solve for each number."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from hybrid.designs.line_at_rest import Gradients
from hybrid.designs.network_at_rest import NetworkAtRest
from hybrid.designs.sensitivity import at_rest
from hybrid.scene.read import as_scene
from tests.designs.test_body_derivatives import SCENES
from tests.designs.test_derivatives import LINE, SEA, pinned, scene
from tests.designs.test_system_derivatives import BUOY, moored

ON_A_BED = scene(LINE, pinned(0, 0, -100), pinned(205, 0, 0), "rod", 100, SEA)
CLAMP = {"kind": "clamped", "position": [0, 0, 0], "tangent": [1, 0, -1]}
CLAMPED = scene(LINE, CLAMP, pinned(200, 5, 10), "rod", 60, {"fluid": SEA["fluid"]})
SECTION = [f"cable.sections[0].{x}" for x in ("length", "mass", "diameter", "axial_stiffness", "bending_stiffness")]
OF = ["tension@end", "max curvature", "position.z@125", "reaction_start.x"]
CASES: dict[str, tuple[Any, list[str], list[str]]] = {
    "a bed": (ON_A_BED, OF, [*SECTION, "environment.seabed.stiffness", "ends.end.position[0]"]),
    "a clamp": (CLAMPED, [*OF, "reaction_end.z"], [*SECTION, "environment.gravity", "ends.start.position[2]"]),
    "a buoy": (
        moored(BUOY, True), ["east/tension@end", "max hose/curvature", "hose/tension@start", "north/reaction_start.x"],
        ["lines.east.sections[0].length", "points.top.volume", "points.vessel.position[2]"],
    ),
}  # fmt: skip
CASES |= {what: SCENES[what] for what in ("a body", "two bodies", "a point", "members")}


def sides(rest: NetworkAtRest, keys: list[str]) -> tuple[Any, Any, np.ndarray]:
    """What numbers leave over, what they shift, and derivatives by a solve for each."""
    seen: list[Any] = []
    plain: Callable[..., Any] = rest.forward
    rest.forward = lambda *x: seen.append(x) or plain(*x)  # type: ignore[method-assign]
    found = rest.by(keys)
    return *seen[0], found


def by_gradients(rest: NetworkAtRest, right: Any, shifts: Any) -> tuple[list[Any], list[Any]]:
    """(P, W) of each line: gradients along what numbers move, and the sizes of what is added up there."""
    out, moved = [], rest.movements(right, shifts)
    for l, gradients in rest.gradients.items():
        q, turns = moved[l]
        terms = [gradients.by_unknowns[None] * q[:, None]]
        terms += [] if turns is None else [gradients.by_turns[None] * turns[:, None]]
        flat = np.concatenate([x.reshape(*x.shape[:2], -1) for x in terms], axis=2)
        out.append((flat.sum(axis=2), np.abs(flat).max(axis=2)))
    sums, sizes = zip(*out, strict=True)
    return list(sums), list(sizes)


def least(rest: NetworkAtRest, keys: list[str]) -> np.ndarray:
    """(P, W) a thousandth of results by numbers."""
    return 1e-3 * np.abs(rest.values) / np.array([[abs(rest.number(key)) or 1.0] for key in keys])


def _of_all_lines(rest: NetworkAtRest, found: list[np.ndarray]) -> list[np.ndarray]:
    """(P, W) of every line, of those that have results."""
    of = dict(zip(rest.gradients, found, strict=True))
    return [of.get(l, np.zeros((len(found[0]), 0))) for l in range(len(rest.lines))]


@pytest.mark.parametrize("case", CASES)
def test_the_transposed_solve_is_the_forward_one(case: str) -> None:
    """Of the same gradients, to rounding of the solves; what answers less than a thousandth is compared with that."""
    tables, of, keys = CASES[case]
    rest = at_rest(as_scene(tables), of)
    right, shifts, _ = sides(rest, keys)
    forward, sizes = by_gradients(rest, right, shifts)
    forward, sizes = ([rest._in_order(_of_all_lines(rest, x))] for x in (forward, sizes))
    found = rest._in_order(rest.transposed(right, shifts))
    whole = np.maximum(np.maximum(np.abs(forward[0]), sizes[0]), least(rest, keys))
    assert (np.abs(forward[0]) > 1e-11 * whole).any(axis=0).all()
    assert (np.abs(found - forward[0]) <= 1e-11 * whole).all()


@pytest.mark.parametrize("case", CASES)
def test_many_numbers_are_the_same_as_few(case: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Results are differenced along their movement, or by unknowns: the same to what differences leave."""
    tables, of, keys = CASES[case]
    rest = at_rest(as_scene(tables), of)
    few = rest.by(keys)
    monkeypatch.setattr(Gradients, "pay_for", lambda *_: True)
    monkeypatch.setattr(rest, "forward", None)
    off = np.abs(rest.by(keys) - few) / np.maximum(np.abs(few), least(rest, keys))
    assert off.max() < 1e-7, off


def test_the_way_is_chosen_by_the_count(monkeypatch: pytest.MonkeyPatch) -> None:
    """One result at the end of a line depends on the four last nodes, of five unknowns each, but for the last spin."""
    rest = at_rest(as_scene(ON_A_BED), ["tension@end"])
    assert [rest.gradients[0].pay_for(x) for x in (19, 20)] == [False, True]
    keys = 20 * SECTION[1:2]
    few = rest.by(keys[:1])
    monkeypatch.setattr(rest, "forward", None)
    np.testing.assert_allclose(rest.by(keys), np.tile(few, (20, 1)), rtol=1e-7)


def test_a_result_of_the_whole_line_depends_on_all_its_unknowns(monkeypatch: pytest.MonkeyPatch) -> None:
    rest = at_rest(as_scene(ON_A_BED), ["contact_force"])
    assert not rest.gradients[0].pay_for(400)
    few = rest.by(SECTION)
    monkeypatch.setattr(rest, "forward", None)
    monkeypatch.setattr(Gradients, "pay_for", lambda *_: True)
    np.testing.assert_allclose(rest.by(SECTION), few, rtol=1e-6)
