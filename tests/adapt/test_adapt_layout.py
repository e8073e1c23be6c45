"""Layouts: nodes, cells, base cells and zones say the same, for any flags."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from adapt_cases import cable, layout, on
from hypothesis import given, settings
from hypothesis import strategies as st

from hybrid.model.layout import edges


@st.composite
def layouts(draw):
    n = draw(st.integers(1, 20))
    size = {"min_size": n, "max_size": n}
    h = draw(st.lists(st.floats(0.01, 3.0), **size))
    base = np.concatenate([[0.0], np.cumsum(h)])
    return layout(base, draw(st.lists(st.integers(1, 9), **size)), draw(st.lists(st.booleans(), **size)))


@given(layouts())
@settings(max_examples=100, deadline=None, derandomize=True)
@pytest.mark.long  # 1.4 s
def test_everything_fits(zones):
    n, s = zones.rod.size, zones.nodes
    cells = int(zones.counts.sum())
    assert s.size == cells + 1 and zones.base_of_cell.size == zones.rod_cells.size == cells
    assert (s[zones.first] == zones.base).all()  # base nodes are nodes, to the last bit
    assert (np.diff(s) > 0).all()
    assert (zones.counts == [p if r else 1 for p, r in zip(zones.parts, zones.rod, strict=True)]).all()
    assert zones.first[0] == 0 and zones.first[-1] == cells and zones.first.size == n + 1
    for j in range(n):
        mine = slice(zones.first[j], zones.first[j + 1])
        assert (zones.base_of_cell[mine] == j).all()
        assert (zones.rod_cells[mine] == zones.rod[j]).all()
        H = zones.base[j + 1] - zones.base[j]
        # equal parts; a difference of two numbers of the size of the whole is good to 1e-16 of it
        assert np.abs(np.diff(s[zones.first[j] : zones.first[j + 1] + 1]) - H / zones.counts[j]).max() <= 1e-15 * s[-1]


@given(layouts())
@settings(max_examples=100, deadline=None, derandomize=True)
def test_zones_are_runs(zones):
    rows = zones.zones
    assert rows[0].s_a == zones.base[0] and rows[-1].s_b == zones.base[-1]
    assert all(a.s_b == b.s_a and a.kind != b.kind for a, b in pairwise(rows))
    middle = 0.5 * (zones.base[:-1] + zones.base[1:])
    for zone in rows:
        assert zone.s_a in zones.base and zone.s_b in zones.base
        inside = (middle > zone.s_a) & (middle < zone.s_b)
        assert inside.any() and (zones.rod[inside] == (zone.kind == "rod")).all()
    cuts = edges(zones.rod)
    assert cuts[0] == 0 and cuts[-1] == zones.rod.size and len(cuts) == len(rows) + 1


@given(layouts())
@settings(max_examples=60, deadline=None, derandomize=True)
def test_a_line_on_a_layout(zones):
    """Elements sit where two rod cells meet, and nowhere else; the mass is that of the cable whatever the zones.

    Round-off: a sum of as many terms as there are cells.
    """
    if zones.rod.size < 2:
        return
    what = cable(float(zones.base[-1]))
    line, rod = on(what, zones), zones.rod_cells
    assert (line.spin == rod).all()
    assert (line.element[1:-1] == (rod[:-1] & rod[1:])).all() and not line.element[[0, -1]].any()  # pinned, free
    assert abs(line.mass.sum() / zones.base[-1] - 1) <= 1e-14 * line.mass.size
    assert abs(-line.force[:, 2].sum() / (10.0 * zones.base[-1]) - 1) <= 1e-14 * line.mass.size
    assert (line.kb[line.element == 0] == 0).all()
    bend = line.kb[line.element == 1, 0] * line.hn[line.element == 1]
    assert np.abs(bend / 2.0 - 1).max(initial=0.0) <= 1e-13
