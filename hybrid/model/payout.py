"""A line that is paid out: the nodes that it may have, and its arrays for any length."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from hybrid.kernels.reel import winch as w
from hybrid.kernels.reel.reel import LEAVES
from hybrid.kernels.state.forces import SOIL
from hybrid.kernels.state.state import Floats, Line, slip_size
from hybrid.model.layout import Layout
from hybrid.model.line import WITH_SECTIONS, inertia_of_zones, line_on, made_of
from hybrid.model.line_on_base import LineOnBase
from hybrid.model.material import Material, material
from hybrid.model.mesh import MOST_CELLS, Zone
from hybrid.model.payout_law import extremes, law_of, least_length, lengths_at, refuse
from hybrid.model.sections import bending_stiffness, restrictors_of, stiffeners_of
from hybrid.scene.payout import Payout
from hybrid.scene.schema import AdaptiveModel, LineScene, Section, Spread

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
    winch: w.Winch  # before its brake opens; of zeros where none holds a tension
    layer: Floats  # (m+1,) m, how far before the fairlead the nodes are that ride with it; 0 is the last
    begun: Floats  # (N+1,) m, nodes at t = 0

    def count(self, length: float) -> int:
        """Material nodes of a line of that length, m, that has been paid out monotonically: the last cell is between

        its limits.
        """
        begins = length - self.layer[0]  # of the layer
        n = int(np.searchsorted(self.nodes, begins))
        return n if begins - self.nodes[n - 1] > LEAVES * self.cell(n - 1) else n - 1

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
        return self._line_on(self.along(np.concatenate([self.nodes[:count], length - self.layer])), like, cable)

    def whole_line(self, like: Line, cable: Material) -> Line:
        """The line with all material nodes that there may be; like, cable: as of `line`."""
        return self._line_on(self.along(self.nodes), like, cable)

    def _line_on(self, s: Floats, like: Line, cable: Material) -> Line:
        """The line with nodes s, m; like, cable: as of `line`."""
        middle = 0.5 * (s[:-1] + s[1:])
        ends = [zone.s_b for zone in self.zones]
        rod = np.array([x.kind == "rod" for x in self.zones])
        rods = rod[np.minimum(np.searchsorted(ends, middle), len(ends) - 1)]
        line = line_on(cable, s, rods, like.bits & SOIL)
        flow = np.zeros((s.size if line.slip_law.size else 0, max(slip_size(line), 2)))
        like_it: dict[str, Any] = {"bits": like.bits, "plane": like.plane, "moved": like.moved, "slip_flow": flow}
        return line._replace(footing=self._footing(like, s.size), **like_it)

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
        """(N,) bool, cells that are rod where zones move: those that change, and as many before them as may be taken in

        before others are rod; reach: m, what that is, if it is more than a few cells.
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


def payout_plan(
    scene: LineScene, line: Line, zones: tuple[Zone, ...],
    parts: Callable[[Material, Floats], np.ndarray] | None = None, to_compare: bool = False,
) -> PayoutPlan | None:  # fmt: skip
    """What a scene's line consists of that is paid out; None: its length stays.  SceneError: it cannot be done.

    line: of base cells, where cells follow the curvature; parts: (n,) finest cells of those between nodes (n+1,) m;
    to_compare: whether this is a coarser run than the scene asks for, by which errors are estimated.
    """
    payout = payout_of(scene)
    if payout is None:
        return None
    length, duration = scene.length, scene.time.duration if scene.time is not None else 0.0
    side, where = winch_side(scene), winch_at(scene)
    law = law_of(payout, length, duration, where)
    low, high = extremes(law, length, duration)
    longest = max(high, payout.longest or 0.0)
    if payout.longest is not None and high > payout.longest:
        refuse(f"{where}.longest", f"{payout.longest:g}", f"at least {high:.6g} m, which is paid out", "leave it out")
    sections = _from_far_end(scene, longest)
    s = line.s if side else length - line.s[::-1]
    joint = max((zone.s_a if side else length - zone.s_b for zone in zones), default=0.0)
    at = material(scene).at
    points = [x for x in (at if side else length - at).tolist() if x < length]
    out = scene.cable.sections if side else scene.cable.sections[::-1]
    changes = [x for x in np.cumsum([x.length for x in out]).tolist() if x < length * (1 - 1e-9)]
    sleeves = [x.range[1] if side else length - x.range[0] for x in (*stiffeners_of(scene), *restrictors_of(scene))]
    fixed = max([joint, *points, *changes, *sleeves, _catenary_up_to(scene)])
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
        refuse(where, "payout", expected, "more cells, or a longer cable")
    layer = s[-1] - s[s.size - 1 - ride :]
    shortest = float(s[near + FEWEST_CELLS - 1] + layer[0])
    if low < shortest:
        given, fix = f"a length of {low:.6g} m", "take less in, or take more cells"
        left = f"{fewest} cells must be left behind the {'last' if side else 'first'} joint, load or change of section"
        expected = f"at least {shortest:.6g} m: {left}"
        refuse(where, given, expected, fix)
    h = float(s[-1 - ride] - s[-2 - ride])
    if not (longest - length) / h < MOST_CELLS:
        given, expected = f"{longest:.6g} m of line in cells of {h:.6g} m", f"at most {MOST_CELLS} cells"
        refuse(where, given, expected, "pay less out (the rate is in m/s, the length in m), or take longer cells")
    nodes: list[float] = s[: s.size - ride].tolist()
    for end in np.cumsum([x.length for x in sections[:-1]]).tolist():
        if nodes[-1] * (1 + 1e-9) < end:
            nodes += np.linspace(nodes[-1], end, max(round((end - nodes[-1]) / h), 1) + 1)[1:].tolist()
    while nodes[-3 - ride] < longest:
        nodes.append(nodes[-1] + h)
    winch = winch_of(payout, length)
    winch.least, winch.most = shortest, longest
    far, places = 0.0 if side else length, np.array(nodes)
    cable = _whole_material(scene, places if side else far - places[::-1])
    finest = np.ones(places.size - 1, int)
    if parts is not None:
        finest = parts(cable, places) if side else parts(cable, far - places[::-1])[::-1]
    return PayoutPlan(
        side, far, law, places, finest, length, longest, shortest, zones, cable, _pieces(scene, cable, side, far),
        payout.from_outside, winch, layer, line.s.copy(),
    )  # fmt: skip


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


def winch_of(payout: Payout, length: float) -> w.Winch:
    """Numbers of a winch that holds a tension (kernels.reel.winch), at rest with a length, m, that is out."""
    out, winch = w.Winch(), payout.winch
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
            refuse(where, f"{held:.6g} m", f"at least {more:.6g} m, which leaves the reel", fix)
        return [*out, *payout.reel, payout.reel[-1].model_copy(update={"length": scene.length})]
    return [*out, out[-1].model_copy(update={"length": more + scene.length})]


def longest_out(scene: LineScene) -> float:
    """Longest length, m, that may be out in a scene's motion; of a line that is not paid out its length."""
    payout = payout_of(scene)
    if payout is None or scene.time is None:
        return scene.length
    law = law_of(payout, scene.length, scene.time.duration, winch_at(scene))
    high = extremes(law, scene.length, scene.time.duration)[1]
    return max(high, payout.longest or 0.0)


def whole_scene(scene: LineScene) -> tuple[LineScene, float]:
    """A scene whose cable has also what is on the reel, and the arc length, m, of its start in the scene as it is."""
    if payout_of(scene) is None:
        return scene, 0.0
    sections = _from_far_end(scene, longest_out(scene))
    if winch_side(scene):
        return scene.model_copy(update={"cable": scene.cable.model_copy(update={"sections": tuple(sections)})}), 0.0
    more = sum(x.length for x in sections) - scene.length
    attached = []
    for x in scene.cable.attachments:
        moved = {"range": (x.range[0] + more, x.range[1] + more)} if isinstance(x, Spread) else {"at": x.at + more}
        attached.append(x.model_copy(update=moved))
    changed = {"sections": tuple(sections[::-1]), "attachments": tuple(attached)}
    return scene.model_copy(update={"cable": scene.cable.model_copy(update=changed)}), -more


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
