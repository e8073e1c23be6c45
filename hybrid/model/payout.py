"""A line that is paid out: the nodes that it may have, and its arrays for any length."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from hybrid.errors import SceneError, refuse_value
from hybrid.kernels.reel.reel import LEAVES, Winch
from hybrid.kernels.state.report import SOIL
from hybrid.kernels.state.state import Floats, Line, slip_size
from hybrid.model.line import WITH_SECTIONS, inertia_of_zones, line_on, made_of, torsion_zones
from hybrid.model.material import Material, material
from hybrid.model.mesh import MOST_CELLS, Layout, LineOnBase, Zone
from hybrid.model.sections import SAME_PLACE, bending_stiffness, sleeves
from hybrid.scene.analysis import AdaptiveModel
from hybrid.scene.attachments import Spread
from hybrid.scene.cable import Section
from hybrid.scene.ends import Payout
from hybrid.scene.motion_file import RecordRefused, check_file, read_table
from hybrid.scene.schema import LineScene

# The fewest cells that may be left.
FEWEST_CELLS = 4
MOST_LEVELS = 30  # of halvings, far beyond what cells have
# Nodes that ride with the fairlead behind a clamp, where the line bends most, and of other rods.
RIDE_BEHIND_CLAMP, RIDE = 8, 4
# More of them behind a clamp, where cells are short: so many times sqrt(EI/T), with the weight of the line for T.  In
# the sagging line of docs/evidence/payout.md, 80 cells, the pull is 0.31 % off with half of it, 0.10 % with this.
BENDING_LENGTHS = 10.0


def payout_of(scene: LineScene) -> Payout | None:
    """How a line is paid out at one of its ends, if it is."""
    found: list[Payout | None] = [getattr(end, "payout", None) for end in scene.ends.both]
    return found[0] or found[1]


def winch_side(scene: LineScene) -> int:
    """Which end of a line that is paid out is at the winch: 0, the start, or 1."""
    return int(getattr(scene.ends.start, "payout", None) is None)


def winch_at(scene: LineScene) -> str:
    """Where a scene says how its line is paid out."""
    return f"ends.{('start', 'end')[winch_side(scene)]}.payout"


class PayoutForecast(NamedTuple):
    """What will be out; NaN: that is not known before the run."""

    by: str  # what gives the length; empty: the scene
    first: float  # m, at t = 0
    last: float  # m, at the end
    shortest: float  # m, on the way; where it is not known, as much as there may be
    longest: float  # m, likewise
    rate: float  # m/s, the largest
    cells: int  # of the longest
    mean_cells: float


@dataclass(frozen=True)
class PayoutPlan:
    """What a line that is paid out consists of, whatever is out.

    Places count from its far end towards the winch; `along` makes arc lengths of them.
    """

    side: int  # which end is at the winch
    far: float  # m, arc length of the other end

    law: Floats  # (K, 8) as of kernels.reel.payout.Reel
    nodes: Floats  # (M,) m, nodes that there may be; that of the fairlead is none of them
    parts: np.ndarray  # (M-1,) cells between two of them, where cells follow the curvature and are shortest; else 1
    first: float  # m, length at t = 0
    longest: float  # m, that may be out
    shortest: float  # m, below which nothing can be taken in
    zones: tuple[Zone, ...]  # at t = 0
    cable: Material  # what is out and what is on the reel
    pieces: Floats  # (P, 1 + COLUMNS) as of kernels.reel.reel.Reel
    from_outside: bool  # whether the length is set from Python
    winch: Winch  # before its brake opens; of zeros where none holds a tension
    layer: Floats  # (m+1,) m, how far before the fairlead the nodes are that ride with it; 0 is the last
    begun: Floats  # (N+1,) m, nodes at t = 0

    def count(self, length: float) -> int:
        """Material nodes of a line of that length, m, that has been paid out monotonically.

        Its last cell is between its limits.
        """
        begins = length - self.layer[0]  # of the layer
        n = int(np.searchsorted(self.nodes, begins))
        return n if begins - self.nodes[n - 1] > LEAVES * self.cell(n - 1) else n - 1

    @property
    def most_cells(self) -> int:
        """Cells that there may be, of a line whose zones stay."""
        return int(self.nodes.size) + self.layer.size - 3

    def cells(self, length: float) -> int:
        """Cells of a line of that length, m, with those of nodes that ride with the fairlead."""
        return self.count(length) + self.layer.size - 1

    def cell(self, node: int) -> float:
        """Length, m, of the cell after a material node."""
        return float(self.nodes[node + 1] - self.nodes[node])

    @property
    def holds_tension(self) -> bool:
        """Whether a winch holds a tension."""
        return bool(self.winch.tension > 0.0)

    def forecast(self, duration: float) -> PayoutForecast:
        """What will be out up to a time, s."""
        if self.from_outside or self.holds_tension:
            by = f"a winch holds {self.winch.tension:.6g} N" if self.holds_tension else "set from Python"
            cells = self.cells(self.longest)
            return PayoutForecast(by, self.first, math.nan, self.shortest, self.longest, math.nan, cells, math.nan)
        t = np.linspace(0.0, duration, 2001)
        lengths, rates = lengths_at(self.law, t)
        counts = np.searchsorted(self.nodes, lengths)
        last, rate = float(lengths[-1]), float(np.abs(rates).max())
        low, high = extremes(self.law, self.first, duration)
        return PayoutForecast("", self.first, last, low, high, rate, self.cells(high), float(counts.mean()))

    def along(self, places: Floats) -> Floats:
        """Arc lengths, m, in order, of places in order."""
        return places if self.side else np.asarray(self.far - places[::-1])

    def held_as(self, other: Material) -> Material:
        """The cable, its ends held as those of another one are now."""
        held = {name: getattr(other, name) for name in ("held_tangent", "held_twist")}
        return replace(self.cable, **held)

    def line(self, count: int, length: float, like: Line, cable: Material) -> Line:
        """The line of `count` material nodes and a length, m; like: another one, with the same forces.

        cable: as of `held_as`.
        """
        s, rods = self._cells(count, length)
        line = line_on(cable, s, rods, like.bits & SOIL)
        flow = np.zeros((s.size if line.slip_law.size else 0, max(slip_size(line), 2)))
        like_it: dict[str, Any] = {"bits": like.bits, "plane": like.plane, "moved": like.moved, "slip_flow": flow}
        return line._replace(footing=self._footing(like, s.size), **like_it)

    def torsion(self, count: int, length: float) -> Floats:
        """Zones (K, 5) of that line, if they stay, that a torque passes through, as `Line.torsion`."""
        s, rods = self._cells(count, length)
        return torsion_zones(self.cable, np.diff(s), rods, self.cable.piece(0.5 * (s[:-1] + s[1:])))

    def _cells(self, count: int, length: float) -> tuple[Floats, np.ndarray]:
        """Nodes (N+1,) m of `count` material nodes and a length, m, and which cells (N,) are rod of zones that stay."""
        s = self.along(np.concatenate([self.nodes[:count], length - self.layer]))
        ends, rod = [zone.s_b for zone in self.zones], np.array([x.kind == "rod" for x in self.zones])
        return s, rod[np.minimum(np.searchsorted(ends, 0.5 * (s[:-1] + s[1:])), len(ends) - 1)]

    def layout(self, count: int, length: float, rod: np.ndarray, here: np.ndarray | None = None) -> Layout:
        """The cells of `count` material nodes and a length, m, where zones move; rod, here: as of a Layout."""
        s = self.along(np.concatenate([self.nodes[:count], length - self.layer]))
        return Layout(s, self.parts_of(count), rod, here)

    @property
    def first_layout(self) -> Layout:
        """The cells at t = 0, where zones move: all rod, as short as they may be."""
        parts = self.parts_of(self.count(self.first))
        return Layout(self.begun, parts, np.ones(parts.size, bool))

    @property
    def follows(self) -> bool:
        """Whether cells follow the curvature."""
        return bool((self.parts > 1).any())

    def parts_of(self, count: int) -> np.ndarray:
        """(n,) finest cells of base cells, in the order of the line, with `count` material base nodes out.

        The cells that ride with the winch, the one that grows and FEWEST_CELLS before it are whole; every one before
        these may be halved once more than the next, so that none is merged by more than a level when it is taken in.
        """
        beyond = count - 1 - FEWEST_CELLS - np.arange(count - 1)
        allowed = 2 ** np.clip(beyond, 0, MOST_LEVELS)
        out = np.concatenate([np.minimum(self.parts[: count - 1], allowed), np.ones(self.layer.size, int)])
        return out if self.side else out[::-1]

    @property
    def finest(self) -> Floats:
        """(K,) m, arc lengths of all nodes that there may be in any cells."""
        parts = self.parts if self.side else self.parts[::-1]
        return Layout(self.along(self.nodes), parts, np.ones(parts.size, bool)).nodes

    def nodes_of(self, layout: Layout) -> Floats:
        """(K,) m, `nodes` with those of a layout in place of the base nodes that are out."""
        count, rides = layout.base.size - self.layer.size, self.layer.size - 1
        first, s = layout.first, layout.nodes
        if not self.side:
            first, s = s.size - 1 - first[::-1], self.far - s[::-1]
        out = np.concatenate([s[: s.size - 1 - rides], self.nodes[count:]])
        out[first[:count]] = self.nodes[:count]  # to the last bit
        return out

    def kept_nodes(self, layout: Layout) -> Floats:
        """(N+1,) m, arc lengths by which extremes are kept: those that do not move, and for others the next ones."""
        count, out = layout.base.size - self.layer.size, layout.nodes
        coming = self.along(self.nodes[count : count + self.layer.size])
        if self.side:
            return np.concatenate([out[: -self.layer.size], coming])
        return np.concatenate([coming, out[self.layer.size :]])

    def line_on(self, layout: Layout, like: Line, cable: Material) -> tuple[LineOnBase, Line]:
        """The line on the cells of a layout, and what makes it; like, cable: as of `line`."""
        on_base = LineOnBase(cable, layout.base)
        return on_base, on_base.line(layout, like.bits, like.plane, like.moved)

    def at_winch(self, count: int, reach: float) -> np.ndarray:
        """(N,) bool, cells at the winch that are rod where zones move.

        Those that change, and as many before them as may be taken in before others are rod; reach: m, the length of
        these, if it is more than a few cells.
        """
        cells = count + self.layer.size - 1
        begins = min(count - 1 - FEWEST_CELLS, int(np.searchsorted(self.nodes, self.nodes[count - 1] - reach)))
        out = np.arange(cells) >= max(begins, 0)
        return out if self.side else out[::-1]

    def zones_of(self, length: float, zones: tuple[Zone, ...] | None = None) -> tuple[Zone, ...]:
        """The zones of a line of that length, m; zones: those that it has, if they move."""
        zones = zones or self.zones
        if self.side:
            last = zones[-1]
            return (*zones[:-1], Zone(last.kind, last.s_a, length))
        return (Zone(zones[0].kind, self.far - length, zones[0].s_b), *zones[1:])

    def _footing(self, like: Line, nodes: int) -> Floats:
        """Bodies that press on the seabed; those of the nodes that come are none."""
        out = np.full(nodes, 0.0 if np.isfinite(like.footing).all() else np.nan)
        some = min(nodes, like.footing.size) - 1
        kept = slice(0, some) if self.side else slice(-some, None)
        out[kept] = like.footing[kept]
        return out


Parts = Callable[[Material, Floats], np.ndarray]


def payout_plan(
    scene: LineScene, line: Line, zones: tuple[Zone, ...], parts: Parts | None = None, to_compare: bool = False
) -> PayoutPlan | None:
    """What a scene's line consists of that is paid out; None: its length stays.  SceneError: it cannot be done.

    line: of base cells, where cells follow the curvature; parts: (n,) finest cells of those between nodes (n+1,) m;
    to_compare: whether this is a coarser run than the scene asks for, by which errors are estimated.
    """
    payout = payout_of(scene)
    if payout is None:
        return None
    length, duration = scene.length, scene.time.duration if scene.time is not None else 0.0
    side, where = winch_side(scene), winch_at(scene)
    law = law_of(payout, length, where)
    low, high = extremes(law, length, duration)
    longest = max(high, payout.longest or 0.0)
    if payout.longest is not None and high > payout.longest:
        expected = f"at least {high:.6g} m, which is paid out"
        refuse_value(f"{where}.longest", f"{payout.longest:g}", expected, "leave it out")
    sections = _from_far_end(scene, longest)
    s = line.s if side else length - line.s[::-1]
    fixed = _last_fixed(scene, zones, side)
    near = int(np.searchsorted(s, fixed * (1 + 1e-12)))
    least = -np.inf if payout.from_outside or payout.winch is not None else least_length(law, length)
    ride = riding_nodes(scene, line, s, least - s[min(near + FEWEST_CELLS, s.size - 1)])
    fewest = FEWEST_CELLS + ride
    if near + fewest >= s.size and to_compare:  # with a finer run: fewer nodes ride on longer cells
        ride = max(s.size - 1 - near - FEWEST_CELLS, 0)
        fewest = FEWEST_CELLS + ride
    if near + fewest >= s.size:
        place = fixed if side else length - fixed
        what = "last" if side else "first"
        expected = f"{fewest} cells between the {what} joint, load or change of section, s = {place:g} m, and the winch"
        refuse_value(where, "payout", expected, "more cells, or a longer cable")
    layer = s[-1] - s[s.size - 1 - ride :]
    shortest = float(s[near + FEWEST_CELLS - 1] + layer[0])
    if low < shortest:
        given, fix = f"a length of {low:.6g} m", "take less in, or take more cells"
        left = f"{fewest} cells must be left behind the {'last' if side else 'first'} joint, load or change of section"
        expected = f"at least {shortest:.6g} m: {left}"
        refuse_value(where, given, expected, fix)
    h = float(s[-1 - ride] - s[-2 - ride])
    if not (longest - length) / h < MOST_CELLS:
        given, expected = f"{longest:.6g} m of line in cells of {h:.6g} m", f"at most {MOST_CELLS} cells"
        refuse_value(where, given, expected, "pay less out (the rate is in m/s, the length in m), or take longer cells")
    nodes = _with_cells(s[: s.size - ride].tolist(), sections, longest, h, ride)
    winch = winch_of(payout, length)
    winch.least, winch.most = shortest, longest
    far, places = 0.0 if side else length, np.array(nodes)
    cable = _whole_material(scene, places if side else far - places[::-1])
    finest = np.ones(places.size - 1, int)
    if parts is not None:
        finest = parts(cable, places) if side else parts(cable, far - places[::-1])[::-1]
    pieces, lengths = _pieces(scene, cable, side, far), (length, longest, shortest)
    from_outside, s = payout.from_outside, line.s.copy()
    return PayoutPlan(side, far, law, places, finest, *lengths, zones, cable, pieces, from_outside, winch, layer, s)


def _last_fixed(scene: LineScene, zones: Sequence[Zone], side: int) -> float:
    """The last joint, load or change of section, m from the far end; side: as of `PayoutPlan`."""
    length = scene.length
    joint = max((zone.s_a if side else length - zone.s_b for zone in zones), default=0.0)
    at = material(scene).at
    points = [x for x in (at if side else length - at).tolist() if x < length]
    out = scene.cable.sections if side else scene.cable.sections[::-1]
    changes = [x for x in np.cumsum([x.length for x in out]).tolist() if x < length * (1 - 1e-9)]
    edges = [b if side else length - a for a, b in sleeves(scene)]
    return max([joint, *points, *changes, *edges, _catenary_up_to(scene)])


def _with_cells(nodes: list[float], sections: Sequence[Section], longest: float, h: float, ride: int) -> list[float]:
    """Material nodes and those of cells of about h, m, behind them, as many as the longest line needs.

    ride: how many nodes ride with the fairlead.
    """
    for end in np.cumsum([x.length for x in sections[:-1]]).tolist():
        if nodes[-1] * (1 + 1e-9) < end:
            nodes += np.linspace(nodes[-1], end, max(round((end - nodes[-1]) / h), 1) + 1)[1:].tolist()
    while nodes[-3 - ride] < longest:
        nodes.append(nodes[-1] + h)
    return nodes


def _catenary_up_to(scene: LineScene) -> float:
    """Up to where, m from the far end, a scene whose zones move forces catenaries."""
    wanted = scene.model.force_catenary if isinstance(scene.model, AdaptiveModel) else None
    length = scene.length
    return max([b if winch_side(scene) else length - a for a, b in wanted or ()], default=0.0)


def riding_nodes(scene: LineScene, line: Line, s: Floats, room: float) -> int:
    """Nodes that ride with the fairlead: behind a clamp, and where rods do not stretch.

    s: (N+1,) m, places of the nodes from the far end on; room: m, before the winch, that is free at any length.
    """
    side = winch_side(scene)
    if line.element[-side]:
        weight = float(np.abs(line.force[:, 2]).sum())
        stiff = float(line.kb[-side, 0] * line.hn[-side])
        reach = min(BENDING_LENGTHS * math.sqrt(stiff / weight) if weight > 0.0 else 0.0, room, 0.5 * s[-1])
        return max(RIDE_BEHIND_CLAMP, int(np.searchsorted(s[-1] - s[::-1], reach * (1 + 1e-9), "right")) - 1)
    payout = payout_of(scene)
    stretches = bool(line.ck[-side])
    return 0 if stretches or not line.spin[-side] or (payout is not None and payout.winch is not None) else RIDE


def shorter_behind_clamp(scene: LineScene, cable: Material, base: Floats, share: float, fineness: float) -> Floats:
    """Base nodes (n+1,) m that follow the curvature, with shorter cells behind a clamp from which line is paid out.

    Cells that ride with the winch stay whole.  Behind the clamp the curvature falls by exp(-x/lam) in x,
    lam = sqrt(EI/W), W the weight of the line: interpolated within `share` of its largest by cells of
    sqrt(8 share) lam exp(x/(2 lam)).  The first is half as long as that, and each is twice as long as the one before.
    """
    if payout_of(scene) is None or scene.ends.both[winch_side(scene)].held_tangent is None:
        return base
    weight = float(np.abs(cable.submerged_weight) @ np.diff(cable.bounds))
    EI = float(cable.weakest_bending[-1 if winch_side(scene) else 0])
    cell = 0.5 * math.sqrt(8.0 * share * EI / weight) / fineness if weight > 0.0 else math.inf
    side = base if winch_side(scene) else scene.length - base[::-1]
    more = cell * (2.0 ** np.arange(RIDE_BEHIND_CLAMP) - 1.0)[1:]
    more = more[more < 0.6 * (side[-1] - side[-2])]
    side = np.concatenate([side[:-1], side[-1] - more[::-1], side[-1:]])
    return side if winch_side(scene) else scene.length - side[::-1]


def winch_of(payout: Payout, length: float) -> Winch:
    """Numbers of a winch that holds a tension (kernels.reel.reel), at rest with a length, m, that is out."""
    out, winch = Winch(), payout.winch
    if winch is not None:
        out.tension, out.begin, out.ramp = winch.tension, winch.begin, winch.ramp
        out.inertia, out.damping, out.max_rate = winch.inertia, winch.damping, winch.max_rate or np.inf
        out.length_now = length
    return out


def _from_far_end(scene: LineScene, longest: float) -> list[Section]:
    """The sections that are out and those on the reel, from the far end on."""
    payout, out, more = payout_of(scene), list(scene.cable.sections), longest - scene.length
    assert payout is not None
    out = out if winch_side(scene) else out[::-1]
    if payout.reel is not None:
        held = sum(x.length for x in payout.reel)
        if held < more * (1 - 1e-9):
            fix = "a longer last section"
            where = f"{winch_at(scene)}.reel"
            refuse_value(where, f"{held:.6g} m", f"at least {more:.6g} m, which leaves the reel", fix)
        return [*out, *payout.reel, payout.reel[-1].model_copy(update={"length": scene.length})]
    return [*out, out[-1].model_copy(update={"length": more + scene.length})]


def longest_out(scene: LineScene) -> float:
    """Longest length, m, that may be out in a scene's motion; of a line that is not paid out its length."""
    payout = payout_of(scene)
    if payout is None or scene.time is None:
        return scene.length
    law = law_of(payout, scene.length, winch_at(scene))
    high = extremes(law, scene.length, scene.time.duration)[1]
    return max(high, payout.longest or 0.0)


def whole_scene(scene: LineScene) -> tuple[LineScene, float]:
    """A scene whose cable has also what is on the reel, and the arc length, m, of its start in the scene as it is."""
    if payout_of(scene) is None:
        return scene, 0.0
    sections = _from_far_end(scene, longest_out(scene))
    if winch_side(scene):
        return replace(scene, cable=scene.cable.model_copy(update={"sections": tuple(sections)})), 0.0
    more = sum(x.length for x in sections) - scene.length
    attached = []
    for x in scene.cable.attachments:
        moved = {"range": (x.range[0] + more, x.range[1] + more)} if isinstance(x, Spread) else {"at": x.at + more}
        attached.append(x.model_copy(update=moved))
    changed = {"sections": tuple(sections[::-1]), "attachments": tuple(attached)}
    return replace(scene, cable=scene.cable.model_copy(update=changed)), -more


def cable_of(scene: LineScene, cells: Floats | None = None) -> Material:
    """The cable of a scene; cells: as of `material`.

    Where sections differ in bending stiffness, that at the winch is another one as line is paid out: results do not
    know how the curvature of a rod fades there.
    """
    cable = material(scene, cells)
    if payout_of(scene) is not None and len({bending_stiffness(x) for x in whole_scene(scene)[0].cable.sections}) > 1:
        start, end = cable.hinged
        cable.hinged = (start, False) if winch_side(scene) else (False, end)
    return cable


def _whole_material(scene: LineScene, nodes: Floats) -> Material:
    """The cable with what is on the reel, by the arc lengths of the scene; nodes: m, that there may be."""
    whole, begin = whole_scene(scene)
    cable = material(whole, nodes - begin)
    cable.hinged, cable.around = cable_of(scene).hinged, np.inf
    cable.bounds, cable.at, cable.swivels = (x + begin for x in (cable.bounds, cable.at, cable.swivels))
    return cable


def _pieces(scene: LineScene, cable: Material, side: int, far: float) -> Floats:
    """Where every piece of the material begins, and its row, as of Reel.pieces: with the inertia that cells have."""
    begins = cable.bounds[:-1] if side else far - cable.bounds[1:]
    inertia = inertia_of_zones(cable) if isinstance(scene.model, AdaptiveModel) else WITH_SECTIONS
    return np.ascontiguousarray(np.column_stack([begins, made_of(cable, inertia)])[:: 1 if side else -1])


# How long a line that is paid out is when: the length over time, as polynomials, and what is asked of it.


@contextmanager
def naming_connection(name: str) -> Iterator[None]:
    """What is refused within of how a line is paid out is said of its connection, if it has a name."""
    try:
        yield
    except SceneError as error:
        at = f"lines.{name}.connections." if name else "ends."
        raise SceneError([replace(x, where=re.sub(r"^ends\.", at, x.where)) for x in error.complaints]) from None


def _rows(rows: list[tuple[float, list[float]]]) -> Floats:
    """(K, 8) rows from times and coefficients, highest power first, of any number."""
    out = np.zeros((len(rows), 8))
    for k, (t, c) in enumerate(rows):
        out[k, 0] = t
        out[k, 8 - len(c) :] = c
    return out


def law_of(payout: Payout, length: float, where: str = "payout") -> Floats:
    """The length, m, that is out over time, as polynomials: (K, 8) as of kernels.reel.payout.Reel.

    length: m, at t = 0; where: the key in the scene, for messages.
    """
    if payout.rate is not None:
        return _law_of_rate(payout, length)
    if payout.file is not None:
        payout = payout.model_copy(update=_rows_of(payout.file, length, where))
    if payout.rates is not None:
        return _law_of_rates(np.array(payout.rates, float), length)
    if payout.lengths is not None:
        return _law_of_lengths(np.array(payout.lengths, float), length, where)
    return _rows([(0.0, [length])])


def _rows_of(path: str, length: float, where: str) -> dict[str, Floats]:
    """Rates or lengths over time of a file, by their key in the scene; length: m, at t = 0."""
    name = Path(path).name

    def checked(_: str, header: list[str]) -> list[str]:
        if sorted(header) not in (["rate", "t"], ["length", "t"]):
            given = f"{name} with columns {', '.join(header)[:60]}"
            raise RecordRefused("columns t,rate or t,length", "name the columns in the first line of the file", given)
        return header

    try:
        check_file(path)
        header, table, lines = read_table(path, checked)
    except RecordRefused as refused:
        found = refused.finding
        refuse_value(f"{where}.file", found.given or name, found.expected, found.fix)
    key, rows = ("rates", 2) if "rate" in header else ("lengths", 3)
    t, x = table[:, header.index("t")], table[:, 1 - header.index("t")]
    if len(t) < rows:
        refuse_value(f"{where}.file", f"{name}, {len(t)} rows", f"at least {rows} rows", "sample more finely")
    for k in np.flatnonzero(np.diff(t) <= 0.0)[:1]:
        given = f"{name}, line {lines[k + 1]}: t = {t[k + 1]:.9g} after t = {t[k]:.9g}"
        refuse_value(f"{where}.file", given, "times that increase strictly", "sort the rows and drop duplicates")
    if t[0] != 0.0 or (key == "rates" and x[0] != 0.0):
        expected = "a first row at t = 0" + (" with rate 0, because the line is at rest" if key == "rates" else "")
        refuse_value(f"{where}.file", f"{name}, line {lines[0]}: t = {t[0]:.9g}, {x[0]:.9g}", expected, "add that row")
    if key == "lengths":
        for k in np.flatnonzero(x <= 0.0)[:1]:
            given = f"{name}, line {lines[k]}: length = {x[k]:.9g}"
            refuse_value(f"{where}.file", given, "lengths > 0, in m", "correct it")
        if abs(x[0] - length) > SAME_PLACE * length:
            given, expected = f"{name}, line {lines[0]}: length = {x[0]:.9g}", f"{length:.9g} m, that of the cable"
            refuse_value(f"{where}.file", given, expected, "the same length at t = 0, in m")
    return {key: np.column_stack([t, x])}


def _law_of_rate(payout: Payout, length: float) -> Floats:
    """A rate that grows with the ramp, and ends with it."""
    rate, T, begin = payout.rate or 0.0, payout.ramp or 1.0, payout.begin
    grows = [rate / T**5, -3.0 * rate / T**4, 2.5 * rate / T**3, 0.0, 0.0, 0.0]
    rows = [(0.0, [length]), (begin, [*grows, length]), (begin + T, [rate, length + 0.5 * rate * T])]
    if payout.until is not None:
        out = length + rate * (payout.until - begin - 0.5 * T)
        ends = [-x for x in grows[:-1]]
        rows.append((payout.until, [*ends, rate, out]))
        rows.append((payout.until + T, [out + 0.5 * rate * T]))
    return _rows(rows)


def _law_of_rates(table: Floats, length: float) -> Floats:
    """Rates at times, a cubic spline between them; beyond the last it is constant."""
    from scipy.interpolate import CubicSpline  # slow to import

    t, c = table.T
    spline = CubicSpline(t, c, bc_type="natural")
    way = spline.antiderivative()
    rows = [(float(x), [*a[:-1].tolist(), float(a[-1]) + length]) for x, a in zip(way.x, way.c.T, strict=False)]
    return _rows([*rows, (float(t[-1]), [float(c[-1]), float(way(t[-1])) + length])])


def _law_of_lengths(table: Floats, length: float, where: str) -> Floats:
    """Lengths at times, a spline of fifth degree between them, which begins and ends without rate and acceleration."""
    from scipy.interpolate import PPoly, make_interp_spline

    t, out = table.T
    if abs(out[0] - length) > SAME_PLACE * length:
        given, expected = f"{out[0]:.9g} m at t = 0", f"{length:.9g} m, the length of the cable"
        refuse_value(f"{where}.lengths", given, expected, "the same length")
    rest = [(1, 0.0), (2, 0.0)]
    spline = PPoly.from_spline(make_interp_spline(t, out, k=5, bc_type=(rest, rest)))
    pieces = [(float(x), a.tolist()) for x, y, a in zip(spline.x[:-1], spline.x[1:], spline.c.T, strict=True) if y > x]
    return _rows([*pieces, (float(t[-1]), [float(out[-1])])])


def fastest(law: Floats) -> float:
    """Largest size of the rate, m/s, that a law of length has."""
    last = float(law[-1, 0])
    t = np.unique(np.concatenate([np.linspace(0.0, last + 1.0, 501), law[:, 0], law[:, 0] + 1e-9 * (last + 1.0)]))
    return float(np.abs(lengths_at(law, t)[1]).max())


def lengths_at(law: Floats, t: Floats) -> tuple[Floats, Floats]:
    """Lengths (n,) m that are out at times t (n,) s, and their rates, m/s, just before t where they jump."""
    rows = law[np.maximum(np.searchsorted(law[:, 0], t) - 1, 0)]
    x, value, rate = np.maximum(t - rows[:, 0], 0.0), np.zeros(t.size), np.zeros(t.size)
    for c in rows.T[1:]:
        rate = rate * x + value
        value = value * x + c
    return value, rate


def least_length(law: Floats, length: float) -> float:
    """Shortest length, m, at any time, also beyond the end of a run, so that a resumed run has the same nodes."""
    last = float(law[-1, 0])
    return -np.inf if law[-1, 1:7].min() < 0.0 else extremes(law, length, last)[0]


def extremes(law: Floats, length: float, duration: float) -> tuple[float, float]:
    """Shortest and longest length, m, up to a time, s."""
    t = np.unique(np.concatenate([np.linspace(0.0, duration, 2001), law[(law[:, 0] <= duration), 0]]))
    found, _ = lengths_at(law, t)
    return float(min(found.min(), length)), float(max(found.max(), length))
