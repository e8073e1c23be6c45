"""Extremes of a run over all accepted steps, on the finest mesh that its zones may have.

The compiled run keeps them on the mesh of the moment (watch.extremes).  Every node of any layout is a node of the
layout that is all rod, so when cells change, the extremes of those that go are folded into those on its nodes: inside
a cell the extremes of its two nodes are interpolated, with the time of the nearer one.  Nodes whose cells stay go on
with theirs (kernels.watch.extremes).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from hybrid.errors import LIMIT_EVENTS
from hybrid.kernels.contact.self_distance import OF_0_6, blank_itself
from hybrid.kernels.state import books as b
from hybrid.kernels.state.books import Books
from hybrid.kernels.state.report import MAY_MEET, MAY_TOUCH, OBSTACLES, PLANAR, SEABED, SELF_CONTACT
from hybrid.kernels.state.state import Floats
from hybrid.kernels.watch.extremes import Watched, fold_extremes, pass_on
from hybrid.model.build import Model, as_begun
from hybrid.model.contents import no_contact
from hybrid.model.payout import whole_scene
from hybrid.model.sections import NEAR, SECTION_LIMITS, attached, limits_along, section_changes
from hybrid.outputs.observed_states import Grid
from hybrid.outputs.quantities import Pipes, StepQuantities
from hybrid.scene.attachments import Modules
from hybrid.scene.schema import LineScene
from hybrid.simulation.lines_contact import SelfWatch
from hybrid.solve.network_steps import no_extremes
from hybrid.store.envelope import BEGIN, END, GROUP, SCALE, Recorded, limits_of
from hybrid.store.format import Field
from hybrid.store.integrity import matched

# Rows of the books: name, unit, what it is, and what a line needs to have it.
QUANTITIES = {
    b.TENSION: ("tension", "N", "tension", ""),
    b.CURVATURE: ("curvature", "1/m", "curvature", ""),
    b.MOMENT: ("bending_moment", "N m", "bending moment of the elastic strain", "rod"),
    b.TORQUE: ("torque", "N m", "torque of the elastic strain", "torsion"),
    b.PRESSURE: ("contact", "N/m", "normal force of the seabed per length", "seabed"),
    b.SELF_PRESSURE: ("self_contact", "N/m", "force per length where the line touches itself", "self_contact"),
    b.OBSTACLE_PRESSURE: ("obstacle_contact", "N/m", "force per length of obstacles across the line", "obstacles"),
    b.DISPLACEMENT: ("displacement", "m", "distance from where the node was at the start", "time"),
    b.WALL_TENSION: ("wall_tension", "N", "tension in the wall", "pipe"),
    b.VON_MISES: ("von_mises", "Pa", "largest von Mises stress in the wall of a pipe", "pipe"),
}

_S_TEXT = (
    "arc lengths of nodes; point loads, changes of section and ends of modules come twice, with the value before and "
    "after them"
)
# What is known of a line that was never near itself: infinite distances.
NEVER_NEAR = blank_itself(np.ones(1)).found


def marked_places(scene: LineScene, model: Model) -> tuple[tuple[float, int], ...]:
    """Arc lengths, m, of point loads, ends of modules and changes of section, with their bits of state.books."""
    edges = [x for modules in attached(scene, Modules) for x in modules.range]
    loads = tuple((float(x), b.LOADED) for x in (*model.attached, *edges))
    return loads + tuple((float(x), b.SEAM) for x in section_changes(scene))


def marks_on(s: Floats, places: Sequence[tuple[float, int]]) -> np.ndarray:
    """Bits (N+1,) of kernels.state.books for nodes s (N+1,) m; those of the ends are left out."""
    marks = np.zeros(s.size, np.int8)
    for x, bit in places:
        marks[np.argmin(np.abs(s - x))] |= bit
    marks[[0, -1]] = 0
    return marks


def marks_of(scene: LineScene, model: Model) -> np.ndarray:
    """The same for the nodes of a model."""
    return marks_on(model.line.s, marked_places(scene, model))


def _rods(model: Model) -> np.ndarray:
    """(N,) whether the cells of a model are rod."""
    return model.line.spin != 0 if model.layout is None else model.layout.rod_cells


def _doubled(nodes: Floats, marked: Floats) -> Floats:
    """Nodes (N+1,) m with those that are marked (K,) m twice."""
    if not marked.size:
        return nodes
    return np.insert(nodes, np.searchsorted(nodes, marked), marked)


def _parts_of(scene: LineScene, model: Model, moves: bool, touches: bool) -> set[str]:
    """What a line has, or may have in a run, that its extremes depend on; arguments are those of `Envelope`."""
    out = {"", *({"rod"} if moves and model.layout is not None else {zone.kind for zone in model.zones})}
    out |= ({"seabed"} if model.line.bits & SEABED else set()) | ({"time"} if moves else set())
    out |= {"obstacles"} if model.line.bits & OBSTACLES else set()
    touching = SELF_CONTACT | (MAY_TOUCH | MAY_MEET if moves else 0)
    out |= {"self_contact"} if touches or model.line.bits & touching else set()
    begun = as_begun(model.line, model.held, scene.dimension)
    return out | ({"torsion"} if "rod" in out or (begun.torsion.size and not begun.bits & PLANAR) else set())


class Envelope:
    """Extremes of one run or equilibrium, lowest and highest with their times, at places s (n,) m.

    Places are nodes; those where a quantity may have two values come twice, the left value first.
    """

    def __init__(self, scene: LineScene, model: Model, moves: bool, touches: bool = False) -> None:
        """moves: whether there are steps; of an equilibrium the nodes are those of its line.

        touches: whether it is one in which lines touch each other.
        """
        layout = model.layout if moves else None
        nodes = model.line.s.copy() if layout is None else layout.finest.nodes
        if moves and model.payout is not None:
            nodes = model.payout.finest
        marked = model.line.s[np.flatnonzero(marks_of(scene, model))]
        self._nodes, self._marked = nodes, marked
        self.s = _doubled(nodes, marked)
        self.start: Floats = np.zeros((nodes.size, 3))  # m, from where displacements count
        self.begin = 0.0  # s
        self.bounds = no_extremes(self.s.size)  # of meshes before that of now
        pipes = Pipes(scene) if moves and any(x.pipe for x in scene.cable.sections) else None
        parts = _parts_of(scene, model, moves, touches) | ({"pipe"} if pipes is not None else set())
        self._rows = {row: what for row, what in QUANTITIES.items() if what[3] in parts}
        side = 3.0 * NEAR * model.length  # beyond which a place is no longer at a change of section
        first, second = (np.flatnonzero(np.diff(self.s) == 0.0) + k for k in (0, 1))
        beside = self.s.copy()
        beside[first] -= side
        beside[second] += side
        whole, begin = whole_scene(scene)
        self._limits = limits_along(whole, beside - begin)
        self._walls = pipes.has_wall(beside) if pipes is not None else np.zeros(0, bool)
        self._stress = np.full(self.s.size, np.nan)
        if pipes is not None:
            self._stress = pipes.largest_allowed(beside, True)
        self._grows = model.payout is not None
        if moves and model.line.bits & (MAY_TOUCH | MAY_MEET) and not model.line.bits & SELF_CONTACT:
            self.bounds[:, b.SELF_PRESSURE] = 0.0  # there is no contact before it is computed
        self.itself = SelfWatch(model, no_contact(scene)) if moves else SelfWatch(model)
        asked = scene.output.quantities if moves else {}
        self.quantities = StepQuantities(scene, asked, pipes)

    # --- what is kept -------------------------------------------------------------------------------

    def count_from(self, model: Model, r: Floats) -> None:
        """Displacements count from the positions r (N+1, 3) m of the nodes of a model."""
        s, at = model.line.s, np.clip(self._nodes, model.line.s[0], model.line.s[-1])
        self.start[:] = Grid(s, model.zones, at, model.attached).nodes @ r

    def start_of(self, nodes: Floats) -> Floats:
        """Positions (N+1, 3) m from which displacements of nodes (N+1,) m count."""
        return self.start[np.searchsorted(self._nodes, nodes)]

    def fold(self, nodes: Floats, extremes: Floats) -> None:
        """Take in the extremes (4, EXTREMES, N+1+K) of a mesh that ends; of no rows, before the first mesh."""
        if extremes.shape[1]:
            self.bounds[:] = self._with(nodes, extremes)

    def pass_on(self, model: Model, books: Books, to_model: Model, to_books: Books) -> None:
        """The run goes on with another mesh: extremes of nodes whose cells stay do, all others are taken in."""
        if self._grows:
            self.fold(model.nodes, books.extremes)
        elif books.extremes.shape[1]:
            old = Watched(model.line.s, _rods(model), books.right, books.extremes)
            new = Watched(to_model.line.s, _rods(to_model), to_books.right, to_books.extremes)
            pass_on(old, new, np.zeros(model.cells + 1, np.int64), self.s, self.bounds)

    def _with(self, nodes: Floats, extremes: Floats) -> Floats:
        """All extremes (4, EXTREMES, n), with those (4, EXTREMES, N+1+K) of the mesh of now."""
        out, places = self.bounds.copy(), _doubled(nodes, self._marked)
        columns = np.arange(places.size) - np.cumsum(second := np.append(False, places[1:] == places[:-1]))
        columns[second] = nodes.size + np.arange(self._marked.size)
        if places.size < self.s.size and not self._grows:
            fold_extremes(places, self.s, columns, extremes, out)
            return out
        now = extremes[:, :, columns]
        first, last = np.searchsorted(self.s, places[0]), np.searchsorted(self.s, places[-1], "right")
        if last - first > places.size:  # cells that follow the curvature, of a line that is paid out
            there = np.ascontiguousarray(out[:, :, first:last])
            fold_extremes(places, self.s[first:last], columns, extremes, there)
            out[:, :, first:last] = there
            return out
        some = out[:, :, first : first + places.size]  # of a line that is paid out there may be more
        for row in self._rows:
            if np.isfinite(now[:, row]).all():  # else no state was computed yet
                for bound, better in ((0, np.less), (1, np.greater)):
                    found = better(now[bound, row], some[bound, row])
                    some[bound, row][found], some[2 + bound, row][found] = (
                        now[bound, row][found],
                        now[2 + bound, row][found],
                    )
        return out

    # --- checkpoints --------------------------------------------------------------------------------

    def checkpoint(self, now: Floats) -> dict[str, Any]:
        """What was kept; now: extremes on the mesh of now."""
        return {
            "begin": self.begin,
            "start": self.start,
            "bounds": self.bounds.copy(),
            "now": now.copy(),
            "itself": self.itself.itself.found.copy(),
        } | ({"quantities": self.quantities.reached.copy()} if self.quantities else {})

    def restore(self, saved: Mapping[str, Any], now: Floats) -> None:
        """Go on as `checkpoint` has written, into `now`.  ValueError: it is that of another line."""
        mine = self.checkpoint(now)
        mine["itself"] = NEVER_NEAR
        older: dict[str, Any] = {"itself": self.itself.itself.found}  # files of before have none
        saved = dict(saved)
        known = saved.get("itself")
        if isinstance(known, np.ndarray) and known.shape == (OF_0_6,):  # nor when contact may end
            saved["itself"] = np.append(known, mine["itself"][OF_0_6:])
        for name in ("bounds", "now"):  # nor wall tension, stress and the force of obstacles
            saved[name] = with_all_rows(saved.get(name))
        self.quantities.restore(saved.get("quantities"))
        older |= {"quantities": self.quantities.reached} if self.quantities else {}
        found = matched(older | saved, mine, "state/envelope")
        self.begin, self.start[:], self.bounds[:] = found["begin"], found["start"], found["bounds"]
        now[:], self.itself.itself.found[:] = found["now"], found["itself"]

    def begin_at(self, t: float, model: Model, r: Floats, note: Callable[..., None]) -> None:
        """Extremes begin at t (s), with nodes at r (N+1, 3) m, and an event says so; note: as Recorder.event.

        Files of 0.6 have none.
        """
        self.begin = t
        self.count_from(model, r)
        text = f"the file has no extremes of the steps before t = {t:.6g} s: the envelope is of those after it"
        note(t, 0.0, model.length, "envelope incomplete", text)

    # --- for the file -------------------------------------------------------------------------------

    def fixed(self) -> list[tuple[Field, np.ndarray]]:
        """Fields of a new file, with values: nodes and limits as they are, extremes not yet known."""
        n, dims, unknown = (self.s.size,), (SCALE,), np.full(self.s.size, np.nan)
        out = [(Field(SCALE, "m", _S_TEXT, n, dims), self.s)]
        for name, values in self._limits.items():
            unit, text, _ = SECTION_LIMITS[name]
            out.append((Field(f"{GROUP}/{name}", unit, f"{text}; NaN: none", n, dims, nan_ok=True), values))
        if np.isfinite(self._stress).any():
            full, of = f"{GROUP}/max_stress", "largest von Mises stress allowed; NaN: none"
            out.append((Field(full, "Pa", of, n, dims, nan_ok=True), self._stress))
        for name, unit, text, _ in self._rows.values():
            for bound, word in (("min", "smallest"), ("max", "largest")):
                full, of = f"{GROUP}/{name}_{bound}", f"{word} {text} at any accepted step"
                out.append((Field(full, unit, of, n, dims, nan_ok=True), unknown))
                when = Field(f"{GROUP}/{name}_t_{bound}", "s", f"time of {name}_{bound}", n, dims, nan_ok=True)
                out.append((when, unknown))
        for name, text in ((BEGIN, "the steps counted begin"), (END, "they end, so far")):
            out.append((Field(name, "s", f"extremes are of all accepted steps: when {text}", nan_ok=True), unknown[0]))
        out += [(field, np.full(field.shape, np.nan)) for field in self.quantities.fields()]
        return out + [(field, unknown[0]) for field in self.itself.fields()]

    def note_broken(
        self, values: Mapping[str, np.ndarray], outputs: Recorded | None, note: Callable[..., None]
    ) -> None:
        """An event for every limit that those values, or the outputs, break; note: as Recorder.event."""
        for x in limits_of(outputs, {field.name: x for field, x in self.fixed()} | dict(values)):
            if x.broken:
                note(x.t, x.s, x.s, LIMIT_EVENTS[x.limit], x.text, value=x.value, threshold=x.allowed)

    def values(self, nodes: Floats, extremes: Floats, t: float) -> dict[str, np.ndarray]:
        """Values of those fields up to time t (s), with the extremes (4, EXTREMES, N+1+K) of the mesh of now."""
        bounds = self._with(nodes, extremes)
        out = {BEGIN: np.array(self.begin), END: np.array(t), **self.itself.values(), **self.quantities.values()}
        for row, (name, *_) in self._rows.items():
            for k, bound in enumerate(("min", "max")):
                x = bounds[k, row]
                if row == b.VON_MISES:
                    x = np.where(self._walls, x, np.inf)
                out[f"{GROUP}/{name}_{bound}"] = np.where(np.isfinite(x), x, np.nan)
                out[f"{GROUP}/{name}_t_{bound}"] = bounds[2 + k, row]
        return out


def with_all_rows(x: Any) -> Any:
    """Extremes of a checkpoint, with unknown ones of pipes and of obstacles where it has none."""
    if not (isinstance(x, np.ndarray) and x.ndim == 3 and x.shape[1] in (b.WALL_TENSION, b.OBSTACLE_PRESSURE)):
        return x
    more = np.full((len(x), b.EXTREMES - x.shape[1], x.shape[2]), np.nan)
    return np.concatenate([x, more], axis=1)
