"""Pairs of what twists a line, each against what it must be."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import hybrid
from tests.combinations.pairs import ADAPTIVE, BASE, CLAMP, END, FAR, START, ZONES, Tables, as_system
from tests.problems import tables_with

# --- turns of an end beside a swivel --------------------------------------------------------------


@pytest.mark.parametrize("model", ["rod", ZONES, ADAPTIVE], ids=["rod", "zones", "moves"])
def test_a_swivel_lets_the_turns_of_an_end_go_back(model: Any) -> None:
    """Whatever the number of turns, also more than cells could hold: the line without them, and no torque at all."""
    swivel: Tables = {"cable.attachments": [{"kind": "swivel", "at": 5.0}], START: CLAMP, END: FAR, "model": model}
    swivel |= {"mesh": None} if model is ZONES else {}
    plain = hybrid.run(tables_with(BASE, swivel))
    held = hybrid.run(tables_with(BASE, swivel | {"cable.attachments": [], END + ".turns": 0.7}))
    assert np.abs(held["torque"]).max() > 1.0
    for turns in (0.7, -5.3, 200.0):
        tables = tables_with(BASE, swivel | {END + ".turns": turns})
        system = as_system(tables)
        assert system is not None
        for found in (hybrid.run(tables), hybrid.run(system).lines["one"]):
            assert np.abs(found.position - plain.position).max() < 1e-9
            assert np.abs(found["torque"]).max() < 1e-9
        what = next(x for x in hybrid.plan(tables).contents if x.what.startswith("twist by"))
        assert not what.on and "swivel at s = 5 m" in what.why and not what.event
