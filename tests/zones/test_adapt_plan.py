"""From ratios to zones: hysteresis, dwell, buffer, shortest zone, and that nothing flickers.

A pure function of what was before: nothing here computes a cable.  Lengths in m, times in s.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from adapt_cases import Rules, cable, layout, on, planned
from hypothesis import example, given, settings
from hypothesis import strategies as st

from hybrid.kernels.mesh.zone_criteria import BEND, CRITERIA
from hybrid.kernels.mesh.zone_plan import OFF, reach, widen
from hybrid.model.mesh import edges
from hybrid.zones.manager import spread, wanted

K = len(CRITERIA)
# Ratio below which a rod becomes catenary (docs/zone_rules.md): a quarter of an error, half of what has no bound.
LETS_GO = {"bend": 0.25, "slack": 0.5, "clamp": 0.25, "point": 0.25, "edge": 0.25, "torsion": 0.25,
           "given": 0.5, "contact": 0.5}  # fmt: skip
ALL = range(K)


def rules(n, buffer=0.0, shortest=0, dwell=1.0):
    return Rules(np.full(n, float(buffer)), shortest, dwell)


def asking(n, loud, criterion=BEND):
    """Ratios of n cells; loud: {cell: ratio}."""
    out = np.zeros((K, n))
    for j, x in loud.items():
        out[criterion, j] = x
    return out


def flags(text):
    return np.array([x == "R" for x in text])


def words(rod):
    return "".join("R" if x else "C" for x in rod)


class Course:
    """Plans one after the other, each from what the one before left."""

    def __init__(self, rod, base=None, rules_=None):
        self.rod = flags(rod)
        n = self.rod.size
        self.base = np.arange(n + 1.0) if base is None else base
        self.rules = rules_ or rules(n)
        self.below = np.full(n, np.inf)

    def at(self, t, ratios):
        self.rod, self.below = planned(ratios, self.rod, self.below, t, self.base, self.rules)
        return words(self.rod)


# --- hysteresis, dwell ------------------------------------------------------------------------------------


@pytest.mark.parametrize("k", ALL, ids=[x.name for x in CRITERIA])
def test_hysteresis(k):
    """At 1 (and not below) a catenary asks; between `off` and 1 nothing changes either way; at `off` a rod is calm."""
    off = LETS_GO[CRITERIA[k].name]
    for ratio, catenary, rod in ((0.0, 0, 0), (off, 0, 0), (off + 1e-9, 0, 1), (1.0, 0, 1), (1.0 + 1e-9, 1, 1)):
        one = asking(1, {0: ratio}, k)
        assert wanted(one, np.array([False]))[0] == catenary, ratio
        assert wanted(one, np.array([True]))[0] == rod, ratio
    assert OFF[k] == off


def test_a_rod_stays_until_it_has_been_calm_for_dwell():
    course = Course("RRRRRR", rules_=rules(6, dwell=1.0))
    loud = asking(6, {j: 0.9 for j in range(6)})
    assert course.at(0.0, loud) == "RRRRRR"
    quiet = asking(6, {0: 0.9})
    for t in (2.0, 2.5, 3.0 - 1e-9):
        assert course.at(t, quiet) == "RRRRRR"
    assert course.at(3.0, quiet) == "RCCCCC"


def test_an_interruption_starts_the_clock_anew():
    course = Course("RRRR", rules_=rules(4, dwell=1.0))
    quiet = np.zeros((K, 4))
    assert course.at(0.0, quiet) == "RRRR"
    assert course.at(0.9, asking(4, {2: 0.9})) == "RRRR"  # cell 2 is not calm
    assert course.at(1.0, quiet) == "CCRC"
    assert course.at(1.9, quiet) == "CCRC"
    assert course.at(2.0, quiet) == "CCCC"


def test_a_new_rod_begins_its_clock_at_once():
    """A cell that asked once and is calm then goes a dwell time after it was first found calm."""
    course = Course("CCCC", rules_=rules(4, dwell=1.0))
    assert course.at(0.0, asking(4, {1: 1.1})) == "CRCC"
    quiet = np.zeros((K, 4))
    assert course.at(0.1, quiet) == course.at(1.09, quiet) == "CRCC"
    assert course.at(1.11, quiet) == "CCCC"


# --- buffer, lengths --------------------------------------------------------------------------------------


@pytest.mark.parametrize("buffer, want", [(0.0, "CCCRCCCC"), (0.5, "CCRRRCCC"), (1.0, "CCRRRCCC"), (1.5, "CRRRRRCC")])
def test_buffer(buffer, want):
    """Every cell nearer than the buffer to one that asks: nearer, not as near (cells of 1 m)."""
    base = np.arange(9.0)
    asks = flags("CCCRCCCC")
    assert words(spread(asks, base, np.full(8, buffer))) == want
    assert words(asks) == "CCCRCCCC"  # what is given does not change
    assert Course("C" * 8, rules_=rules(8, buffer)).at(0.0, asking(8, {3: 2.0})) == want


def test_two_cells_beside_what_asks_on_a_graded_mesh():
    """Whatever the lengths of cells are, and no more of longer ones than two."""
    base = np.array([0.0, 4.0, 8.0, 10.0, 11.0, 11.5, 12.0, 13.0, 15.0, 19.0])
    buffer = np.zeros(9)
    widen(buffer, np.diff(base))
    for j, want in ((4, "CCRRRRRCC"), (1, "RRRRRCCCC"), (8, "CCCCCCRRR")):
        asks = np.zeros(9, bool)
        asks[j] = True
        found = words(spread(asks, base, buffer))
        assert all(f == "R" for f, w in zip(found, want, strict=True) if w == "R"), (j, found)
        assert sum(f == "R" for f in found) <= want.count("R") + 3, (j, found)


def test_buffer_is_that_of_the_cell_that_asks():
    buffer = np.zeros(8)
    buffer[5] = 1.5
    assert words(spread(flags("CRCCCRCC"), np.arange(9.0), buffer)) == "CRCRRRRR"


def test_the_buffer_keeps_what_it_has_grown():
    """A stretch within the buffer of what still holds does not go, however calm it is itself."""
    course = Course("C" * 8, rules_=rules(8, 1.5, dwell=1.0))
    assert course.at(0.0, asking(8, {3: 2.0})) == "CRRRRRCC"
    for t in (1.0, 5.0, 9.0):
        assert course.at(t, asking(8, {3: 0.9})) == "CRRRRRCC"


def test_short_gaps_are_closed():
    course = Course("C" * 9, rules_=rules(9, shortest=3))
    assert course.at(0.0, asking(9, {j: 2.0 for j in (0, 1, 2, 5, 6, 7, 8)})) == "RRRRRRRRR"
    course = Course("C" * 10, rules_=rules(10, shortest=2))
    assert course.at(0.0, asking(10, {j: 2.0 for j in (0, 1, 2, 5, 6, 7)})) == "RRRCCRRRCC"


def test_short_rods_grow_on_both_sides():
    course = Course("C" * 9, rules_=rules(9, shortest=3))
    assert course.at(0.0, asking(9, {4: 2.0})) == "CCCRRRCCC"
    assert Course("C" * 9, rules_=rules(9, shortest=3)).at(0.0, asking(9, {0: 2.0})) == "RRRCCCCCC"
    assert Course("C" * 9, rules_=rules(9, shortest=3)).at(0.0, asking(9, {8: 2.0})) == "CCCCCCRRR"


@pytest.mark.parametrize("n", [30, 50, 60])
def test_two_cells_are_two_cells(n):
    """The shortest zone is two cells: wherever two cells ask, two are rod, however long or short each is."""
    base = np.concatenate([[0.0], np.cumsum(1.1 ** np.arange(n))])
    rule = rules(n, shortest=2)
    for j in range(1, n - 2):
        course = Course("C" * n, base, rule)
        assert course.at(0.0, asking(n, {j: 2.0, j + 1: 2.0})) == "C" * j + "RR" + "C" * (n - j - 2), j


def test_a_rod_shortens_within_itself():
    """A rod that shrinks keeps to cells that are rod: its last ones need no new neighbour that nothing asks for."""
    course = Course("CCCRRRRCCC", rules_=rules(10, shortest=2, dwell=1.0))
    loud = asking(10, {3: 0.9})
    course.at(0.0, loud)
    assert course.at(1.0, loud) == "CCCRRCCCCC"


# --- random courses ---------------------------------------------------------------------------------------


courses = st.tuples(
    st.integers(2, 14),  # cells
    st.booleans(),  # even
    st.sampled_from([0, 1, 2, 3]),  # cells of the shortest zone
    st.sampled_from([0.3, 1.0, 2.0]),  # dwell
    st.floats(0.3, 0.95),  # part of the time that a cell is quiet
    st.sampled_from([0.0, 0.6, 1.2]),  # buffer, at most
    st.integers(0, 10**6),
)


def course_of(what):
    """(base, rules, first rods: none or all, [(t, ratios)]): in every cell one ratio wanders about `off` and 1."""
    n, even, shortest, dwell, quiet, buffer, seed = what
    rng = np.random.default_rng(seed)
    h = np.ones(n) if even else rng.choice([0.5, 1.0, 2.0], n)
    which, level, walk, t = rng.integers(0, K, n), rng.uniform(0, 1.2, n), [], 0.0
    for _ in range(40):
        t += float(rng.choice([0.1, 0.2, 0.35]))
        level = np.clip(level + rng.normal(0, 0.25, n), 0, 1.3)
        ratios = np.zeros((K, n))
        ratios[which, np.arange(n)] = np.where(rng.random(n) < quiet, 0.2 * level, level)
        walk.append((t, ratios))
    return (
        np.concatenate([[0.0], np.cumsum(h)]),
        Rules(buffer * rng.random(n), shortest, dwell),
        np.full(n, seed % 2 > 0),
        walk,
    )


def steps(what):
    """(t, ratios, rod before, rod after, rules, base) of a random course."""
    base, rule, rod, walk = course_of(what)
    course = Course(words(rod), base, rule)
    for t, ratios in walk:
        before = course.rod.copy()
        course.at(t, ratios)
        yield t, ratios, before, course.rod.copy(), rule, base


@given(courses)
@settings(max_examples=40, deadline=None, derandomize=True)
def test_the_same_past_gives_the_same_plan(what):
    """And what goes in is not touched: two courses, the second on copies that are read-only."""
    one = [words(after) for *_, after, _, _ in steps(what)]
    base, rule, rod, walk = course_of(what)
    calm = np.full(rod.size, np.inf)
    two = []
    for t, ratios in walk:
        for x in (base, rule.buffer, ratios, rod, calm):
            x.setflags(write=False)
        rod, calm = planned(ratios, rod, calm, t, base, rule)
        two.append(words(rod))
    assert one == two


@given(courses)
@settings(max_examples=150, deadline=None, derandomize=True)
def test_what_asks_is_rod_and_what_holds_stays(what):
    """Whatever else the rules do: a ratio above 1, and the buffer about it, is rod now; a rod above `off` stays one."""
    for _, ratios, before, after, rule, base in steps(what):
        asks = (ratios > 1.0).any(axis=0)
        assert after[spread(asks, base, rule.buffer)].all()
        assert after[before & (ratios > OFF[:, None]).any(axis=0)].all()


@given(courses)
@settings(max_examples=150, deadline=None, derandomize=True)
def test_no_zone_is_too_short(what):
    """Every rod has the fewest cells, unless the line has fewer; every catenary between two rods, too.

    A catenary at an end of the line may be shorter: it has one joint only, and closing it would keep the last cell of
    every line a rod.
    """
    for _, _, _, after, rule, base in steps(what):
        least = min(rule.shortest, base.size - 1)
        cuts = edges(after)
        for a, b in pairwise(cuts):
            if after[a] or (a > 0 and b < after.size):
                assert b - a >= least, (words(after), a, b)


@given(courses)
@settings(max_examples=150, deadline=None, derandomize=True)
def test_no_catenary_becomes_rod_unless_something_asks(what):
    for _, ratios, before, after, _, _ in steps(what):
        if not (ratios > 1.0).any():
            assert not (after & ~before).any(), (words(before), words(after))


@given(courses)
@example((3, False, 2, 1.0, 0.75, 0.0, 1))  # a rod that shrinks widens into a catenary that has just come
@settings(max_examples=150, deadline=None, derandomize=True)
def test_no_flicker(what):
    """Within a dwell time a cell changes kind twice only when a ratio above 1 asks for the second change."""
    last = None
    for t, ratios, before, after, rule, _ in steps(what):
        last = np.full(before.size, -np.inf) if last is None else last
        changed = before != after
        again = changed & (t - last < rule.dwell * (1 - 1e-12))
        assert not (again & ~after).any()  # no rod goes soon after it came
        assert not again.any() or (ratios > 1.0).any()
        last[changed] = t


@given(courses)
@settings(max_examples=60, deadline=None, derandomize=True)
def test_more_noise_never_means_less_rod(what):
    """Planning is monotone: higher ratios, or more rod before, give at least the same rod, before lengths are mended."""
    base, rule, _, walk = course_of(what)
    rule = rule._replace(shortest=0)
    one, two = (Course("C" * rule.buffer.size, base, rule) for _ in range(2))
    for t, ratios in walk:
        one.at(t, ratios)
        two.at(t, 1.2 * ratios)
        assert not (one.rod & ~two.rod).any()


# --- layouts ---


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


def test_rods_reach_as_far_from_either_end() -> None:
    EI = np.array([9.0, 9.0, 9.0, 2.0, 2.0, 2.0])  # of nodes; the larger one where sections meet
    w, floor, T, cells = np.full(6, 30.0), np.full(6, 1e-3), np.linspace(100.0, 140.0, 5), np.arange(5)
    there, back = np.zeros(5), np.zeros(5)
    reach(T, cells, EI, w, floor, 2.0, 0.1, there)
    reach(T[::-1].copy(), cells, EI[::-1].copy(), w, floor, 2.0, 0.1, back)
    assert np.array_equal(there, back[::-1])
