"""A tension below 0 that comes from cells longer than a bend is told where it stands."""

from __future__ import annotations

from typing import Any

import numpy as np

import hybrid


def hanging(cells: int) -> dict[str, Any]:
    """A heavy chain between near ends, whose section changes beside its lowest point."""
    section = {"mass": 30.0, "diameter": 0.1, "axial_stiffness": 1e8, "length": 22.0}
    return {
        "environment": {"fluid": {"density": 1025}},
        "cable": {"sections": [section, section | {"length": 18.0, "mass": 24.0}]},
        "ends": {"start": {"kind": "pinned", "position": [0, 0, 0]}, "end": {"kind": "pinned", "position": [8, 0, -6]}},
        "initial": "equilibrium", "model": "catenary", "mesh": {"cells": cells}, "dimension": 3,
    }  # fmt: skip


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
