"""Error against cost with other programs: they agree with ours, and one that cannot or fails is a row that says so.

pytest bench/test_bench_trade.py -m bench -s
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from peers import adapters, trade
from peers.adapters.interface import PeerFailed, PeerResult, PeerRun

import hybrid
from hybrid.store.tables import FAILED, Row
from hybrid.studies import runs
from hybrid.studies.tradeoff import END_FORCES, force_difference, with_errors

pytestmark = pytest.mark.bench
# A second of a line that hangs in water.
SECTION: dict[str, Any] = {
    "length": 12.0,
    "diameter": 0.03,
    "mass": 2.0,
    "axial_stiffness": 1e5,
    "bending_stiffness": 20.0,
}
WET = {"drag": {"normal": 1.2}, "added_mass": {"normal": 1.0}}
SAG: dict[str, Any] = {
    "title": "a line that sags",
    "environment": {"fluid": {"density": 1025}},
    "cable": {"sections": [SECTION | WET]},
    "ends": {
        "start": {"kind": "pinned", "position": [0, 0, -5]},
        "end": {
            "kind": "pinned", "position": [10, 0, -5], "motion": {"heave": {"amplitude": 0.3, "period": 2.0}, "ramp": 1},
        },
    },
    "initial": "equilibrium",
    "model": "adaptive",
    "time": {"duration": 1.0},
    "output": {"every": 0.1, "points": 25},
}  # fmt: skip
MOVING: dict[str, Any] = {"environment": {"fluid": {"density": 1025, "current": [0.1, 0, 0]}}}
ROUGH: dict[str, Any] = {"models": ["rod"], "accuracies": ["10%"], "reference": "1%"}


def scene(**changes: Any) -> hybrid.Scene:
    return hybrid.validate_scene(SAG | changes)


@pytest.fixture
def only_moordyn(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(adapters.importlib.util, "find_spec", lambda name: object() if name == "moordyn" else None)
    monkeypatch.setattr(adapters, "versions", lambda peer_runs: "moordyn 0" if peer_runs else "")


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({}, ""),
        ({"environment": {}, "cable": {"sections": [SECTION]}}, "no water"),
        (MOVING, "water moves"),
        ({"initial": {"kind": "points", "points": [[0, 0, -5], [5, 0, -9], [10, 0, -5]]}}, "starts points"),
        ({"ends": SAG["ends"] | {"end": "free"}}, "not pinned"),
    ],
)
def test_what_other_programs_cannot_do_is_said(change: dict[str, Any], reason: str) -> None:
    said = adapters.unsupported(scene(**change))
    assert reason in said and bool(said) == bool(reason)


@pytest.mark.parametrize("code", list(adapters.PEERS))
def test_another_program_agrees(code: str) -> None:
    """With the rod at 0.3 %, to 1 % of the length, and in the middle of all outputs 1 % of the pull: what 50 elements can."""
    pytest.importorskip(adapters.PEERS[code].package)
    peer_run = next(each for each in adapters.peer_runs(scene()) if each.code == code and each.elements == 50)
    answer = adapters.compute(peer_run, scene())
    result = hybrid.run(hybrid.validate_scene(runs.scene_data(scene(), "rod", "0.3%")))
    truth = {name: np.array(result[name]) for name in runs.COMPARED}
    found = with_errors(Row(code, "", "", "done"), answer.values, truth, 12.0)
    assert found.position_part is not None and found.position_part < 0.01
    largest = max(np.linalg.norm(truth[x], axis=-1).max() for x in END_FORCES)
    usual = max(np.median(force_difference(answer.values[x], truth[x])) for x in END_FORCES)
    print(f"\n{code}: position {100 * found.position_part:.2g} %, end force {100 * usual / largest:.2g} %")
    assert usual < 0.01 * largest
    assert answer.cpu > 0.0 and answer.steps > 10


def test_installed_programs_stand_beside_ours_and_are_kept(tmp_path: Path) -> None:
    pytest.importorskip("moordyn")
    found = trade.trade(scene(), tmp_path, **ROUGH)
    theirs = [row for row in found.rows if row.code == "MoorDyn"]
    assert len(theirs) == 3 and all(row.position and row.cpu and row.end_force for row in theirs)
    assert "MoorDyn 50 elements" in (tmp_path / "trade.md").read_text() and "| other programs |" in found.markdown()
    again = trade.trade(scene(), tmp_path, **ROUGH)
    assert again.rows == found.rows, "computed once"


@pytest.mark.usefixtures("only_moordyn")
def test_a_program_that_is_not_installed_has_no_row_and_one_that_cannot_has_one(tmp_path: Path) -> None:
    found = trade.trade(scene(**MOVING), tmp_path, **ROUGH)
    (theirs,) = (row for row in found.rows if row.code != "hybrid")
    assert (theirs.code, theirs.status, theirs.cause) == ("MoorDyn", "unsupported", "the water moves")
    assert "MoorDyn" in (tmp_path / "trade.md").read_text()


@pytest.mark.usefixtures("only_moordyn")
def test_a_program_that_fails_is_a_row(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    real = adapters.compute

    def failing(peer_run: PeerRun, scene: hybrid.Scene) -> PeerResult:
        if peer_run.elements != 25:
            raise PeerFailed("diverged")
        return real(replace(peer_run, code="nobody"), scene)

    monkeypatch.setattr(adapters, "compute", failing)
    found = trade.trade(scene(), tmp_path, **ROUGH)
    theirs = [row for row in found.rows if row.code != "hybrid"]
    assert [row.status for row in theirs] == [FAILED] * 3
    assert "nobody" in theirs[0].cause and theirs[1].cause == "diverged"


def test_other_programs_are_of_level_a(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    pytest.importorskip("moordyn")
    monkeypatch.setattr("hybrid.studies.tradeoff.MODELS", ("rod",))
    found = trade.trade_levels(scene(), tmp_path)
    theirs = [row for row in found.rows if row.model.startswith("MoorDyn")]
    assert len(theirs) == 3 and all(row.level == "A" and row.worst and row.cpu for row in theirs)
    assert [row.level for row in found.rows] == sorted(row.level for row in found.rows)
    assert "A MoorDyn 25 elements" in (tmp_path / "levels.md").read_text()
