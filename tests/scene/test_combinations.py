"""Every pair of features that is refused is refused with the reason of the table, where the scene asks for it."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest
import yaml

import hybrid
from hybrid.errors import SceneError
from hybrid.scene import combinations as c
from hybrid.scene.combinations import REFUSALS, Use, refuse_use
from hybrid.scene.network import Network
from hybrid.scene.read import read_text
from hybrid.scene.root import Scene
from tests.problems import tables_with
from tests.scenes import cable_scene, clamped_at, line_between, network_scene

CABLE: dict[str, Any] = cable_scene(
    {"length": 10, "mass": 2, "diameter": 0.03, "axial_stiffness": 1e6, "bending_stiffness": 10,
     "torsional_stiffness": 10},
    clamped_at([0, 0, 0], [1, 0, 0]), clamped_at([8, 0, 0], [1, 0, 0]), gravity=9.81, model="rod", time=(3.0, 0.1)
)  # fmt: skip
LINES: dict[str, Any] = network_scene(
    {"a": {"position": [0, 0, 0]}, "b": {"position": [8, 0, 0]}},
    {"one": line_between("a", "b", CABLE["cable"]["sections"])}, time=(3.0, 0.1)
)  # fmt: skip

SECTION, END, ONE = "cable.sections.0.", "ends.end.", "lines.one."
TORQUE = {SECTION + "tension_torque": 1e-3}
PAID: dict[str, Any] = {END + "payout": {"rate": 0.1, "ramp": 1.0}}
MOVING = {"model": {"kind": "adaptive"}}
TWO = {SECTION + "bending_stiffness": [10, 20], END + "normal": [0, 1, 0]}
_HALF = {key: x for key, x in CABLE["cable"]["sections"][0].items() if key != "bending_stiffness"} | {"length": 5}
TABLE_BESIDE_TWO = {
    "cable.sections": [_HALF | {"bending_stiffness": [10, 20]}, _HALF | {"moment_curvature": [[0, 0], [1, 10]]}],
    END + "normal": [0, 1, 0],
}
LOCKS: dict[str, Any] = TWO | {"cable.attachments": [{"kind": "bend_restrictor", "range": [0, 2], "radius": 2}]}
SLIPS: dict[str, Any] = {SECTION + "bending_slip": [{"stiffness": 20, "moment": 1}]}
ROPE = {SECTION + "dynamic_stiffness": {"constant": 2e6, "relaxation_time": 100}}
SHEDS: dict[str, Any] = {SECTION + "vortices": {}, "environment.fluid": {"density": 1025, "current": [0.3, 0, 0]}}
HIGH_WAVES: dict[str, Any] = {"environment.fluid": {
    "density": 1025, "surface": 5, "waves": {"kind": "stream_function", "height": 1, "period": 5, "ramp": 9}}}  # fmt: skip
OTHER_LINE = {"start": "a", "end": "b", "sections": [{"length": 9.5, "mass": 1, "diameter": 0.02}]}
TWO_LINES = {"lines.two": OTHER_LINE, "contact": {}}

# By the pair: what makes a scene of CABLE, or of LINES, that has both, and what is done with it.
EXAMPLES: dict[tuple[c.Feature, c.Feature], tuple[dict[str, Any], Use]] = {
    (c.TWO_STIFFNESSES, c.MOVING_ZONES): (TWO | MOVING, ""),
    (c.SLIP, c.MOVING_ZONES): (SLIPS | MOVING, ""),
    (c.TORSION, c.PLANE): (TORQUE | {"dimension": 2}, ""),
    (c.ESTIMATED, c.LINES_TOUCH): (TWO_LINES | {"accuracy": "3%"}, ""),
    (c.SETTLED_FRICTION, c.GOES_ITS_WAY): (TWO_LINES | {ONE + "initial": {"friction": "settled"}}, ""),
    (c.OTHER_MOTIONS, c.RESPONSE): (
        {"ends.end": {"kind": "free", "force": {"value": [1, 0, 0], "until": 2}}}, "response"
    ),
    (c.DERIVATIVES, c.SETTLED_FRICTION): ({"initial": {"kind": "equilibrium", "friction": "settled"}}, "derivatives"),
    (c.PAYOUT_AT_START, c.PAYOUT_AT_END): (PAID | {"ends.start.payout": {"rate": 0.1, "ramp": 1.0}}, ""),
    (c.DAMPED_OTHERWISE, c.PAYOUT): (PAID | ROPE | {SECTION + "damping": {"stiffness": 0.01}}, ""),
    (c.VORTICES, c.PLANE): (SHEDS | {"dimension": 2}, ""),
    (c.VORTICES, c.RESPONSE): (SHEDS, "response"),
    (c.FINITE_WAVES, c.RESPONSE): (HIGH_WAVES, "response"),
}  # fmt: skip
# Other examples of pairs whose one reason is that of several features.
OTHERS: tuple[tuple[tuple[c.Feature, c.Feature], dict[str, Any], Use], ...] = (
    ((c.TORSION, c.PLANE), {END + "turns": 2, "dimension": 2}, ""),
    ((c.SLIP, c.MOVING_ZONES), TABLE_BESIDE_TWO | MOVING, ""),
    ((c.SLIP, c.MOVING_ZONES), LOCKS | MOVING, ""),
    ((c.SLIP, c.MOVING_ZONES), {SECTION + "stiffness_per_tension": 0.01} | MOVING, ""),
    ((c.ESTIMATED, c.LINES_TOUCH), TWO_LINES | {"time": {"duration": 3.0}}, ""),
    ((c.ESTIMATED, c.LINES_TOUCH), TWO_LINES | {"output.errors": True}, ""),
)


def _scene(changes: dict[str, Any], several: bool) -> Scene | Network:
    return read_text(yaml.safe_dump(tables_with(LINES if several else CABLE, changes), sort_keys=False))[0]


def _of_several(changes: dict[str, Any]) -> bool:
    return any(key.startswith("lines.") for key in changes)


def _id(x: object) -> str:
    return f"{x[0].name} x {x[1].name}" if isinstance(x, tuple) else ""


def test_every_refusal_has_an_example() -> None:
    pairs = [(x.feature, x.beside) for x in REFUSALS]
    assert len(set(pairs)) == len(pairs)
    assert set(pairs) == set(EXAMPLES)


@pytest.mark.parametrize(("pair", "changes", "use"), [*((k, *x) for k, x in EXAMPLES.items()), *OTHERS], ids=_id)
def test_it_is_refused_with_its_reason_and_remedy(
    pair: tuple[c.Feature, c.Feature], changes: dict[str, Any], use: Use
) -> None:
    """With the reason, what to do and, where the scene alone asks for both, the line of the file."""
    refusal = next(x for x in REFUSALS if (x.feature, x.beside) == pair)
    with pytest.raises(SceneError) as told:
        refuse_use(_scene(changes, _of_several(changes)), use, "asked")
    pattern = re.escape(f"{refusal.expected}, because {refusal.why}").replace(r"\{key\}", r"[\w.\[\]]+")
    mine = [x for x in told.value.complaints if re.fullmatch(pattern, x.expected)]
    assert mine, told.value
    for x in mine:
        assert x.fix and (x.line or use) and (x.value or not use), told.value


def test_nothing_else_refuses_a_combination() -> None:
    """Reasons of the table stand in no other file of the package."""
    root = Path(hybrid.__file__).parent
    reasons = [x.why.partition("{key}")[0].strip(" (,") for x in REFUSALS]
    words = {x for x in reasons if len(x) > 20}
    for path in root.rglob("*.py"):
        if path.name not in ("combinations.py", "plane.py"):  # this one: what does not lie in a plane
            text = path.read_text(encoding="utf-8")
            assert not [x for x in words if f"because {x}" in text], path
