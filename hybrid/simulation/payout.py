"""A line that is paid out in motion: nodes that enter and leave at its fairlead, and what a checkpoint keeps of it."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from typing import Any

import numpy as np

from hybrid.kernels.machine.binding import Table
from hybrid.kernels.reel.paid_length import length_at
from hybrid.kernels.reel.payout import end_payout, fit_line, lengthen, put_forces_on, remove_forces
from hybrid.kernels.reel.payout_nodes import energy_of, place_reel
from hybrid.kernels.reel.reel import Reel, ReelNumbers, blank_reel, blank_reel_job, losses, tension_held
from hybrid.kernels.state.books import Clock
from hybrid.kernels.state.report import FRICTION, LENGTH_OUT, PAYOUT_RATE, STIFFNESS_DAMPING, TOUCHES
from hybrid.kernels.state.state import Batch, Ends, Floats, Line, Sea, State, copied, slip_size
from hybrid.model.build import Model
from hybrid.model.mesh import Layout, LineOnBase, Zone, on_other_parts
from hybrid.model.payout import FEWEST_CELLS, PayoutPlan, fastest, lengths_at, payout_of
from hybrid.model.sections import SAME_PLACE
from hybrid.outputs.observation import Observation, Output
from hybrid.outputs.probes import Observer
from hybrid.scene.ends import SOURCES
from hybrid.scene.schema import LineScene
from hybrid.store.integrity import matched

# Arrays of a line that its length changes, and that outputs ask for.
VARIES = ("s", "h", "ck", "mass", "force", "kb", "k0", "hn", "rotary", "polar")
VARIES_TOO = ("bend_law", "tension_twist", "wake_law")  # likewise, of lines that have them
# What a checkpoint keeps of a reel.
OF_CELLS = ("lack", "rate", "since", "span")
OF_EARLIER_VERSIONS = 10, 12, 13, 15  # numbers of a reel in checkpoints of those
KEPT = ("numbers", "lack", "rate", "since", "span", "winch", "balance")


class PayingOut:
    """The length of one line in motion."""

    def __init__(self, model: Model) -> None:
        assert model.payout is not None
        self.plan: PayoutPlan = model.payout
        self.law, self.winch = self.plan.law.copy(), self.plan.winch.copy()
        self.count = self.plan.count(self.plan.first)  # material nodes that are out; of base cells, where these are cut
        self.nodes = self.plan.nodes if model.layout is None else self.plan.nodes_of(model.layout)
        self._slips = slip_size(model.line) // 2  # layers that do
        self.reel = self._blank(model.cells - self.rides)
        # Rate, m/s, by which the rods of zones that move have been given at the winch: at the start, or by the last
        # node that has entered or left.
        self.foreseen = fastest(self.law)
        self.layout: Layout | None = None  # of a line whose zones move
        self.ended = False  # whether the end at the winch has been let go
        self.stopped = False  # whether its rate goes to zero for good
        self.table, self._fitting, self._clock = Table(blank_reel_job()), Table(blank_reel_job()), Clock()

    def _blank(self, material: int) -> Reel:
        """Arrays of a line of so many material nodes, none of whose cells lacks anything."""
        plan = self.plan
        given = self.law, plan.pieces, self.winch, plan.layer, self.solves_twice, self.damped, self._slips
        reel = blank_reel(material + self.rides, *given)
        numbers = reel.numbers
        numbers.side, numbers.far = (1.0 if plan.side else -1.0), plan.far
        numbers.spring = plan.cable.springs[plan.side]
        if plan.cable.vortices.size:
            numbers.lift = plan.cable.vortices[-plan.side, 0]
        place_reel(reel, self.nodes, material)
        return reel

    def on(self, model: Model, length: float) -> Model:
        """A model with the nodes of now and a length, m; of a line whose zones move as its layout has them."""
        plan, layout, on_base = self.plan, None, None
        cable = plan.held_as(model.cable)
        if model.layout is None:
            line, zones = plan.line(self.count, length, model.line, cable), plan.zones_of(length)
        else:
            layout = plan.layout(self.count, length, model.layout.rod, model.layout.here)
            (on_base, line), zones = plan.line_on(layout, model.line, cable), layout.zones
        cells = line.h.size
        sea = model.sea if cells == model.cells else model.sea.on(cells)
        return replace(model, line=line, zones=zones, sea=sea, layout=layout, on_base=on_base)

    def end(self, state: State, t: float, model: Model) -> float:
        """The end at the winch is let go at t (s): what is out goes on as it moves (state), and no more comes.

        It returns the energy, J, of that.
        """
        line, ends, sea = model.line, model.ends.at_time(t), model.sea.values
        old = energy(line, ends, state, sea)
        end_payout(self.table.numbers)
        self.winch.tension, self.ended = 0.0, True
        law = np.zeros((1, 8))
        law[0, 0], law[0, 7] = t, self.length
        self._set_law(law)
        self.leave_unbalanced()
        return energy(line, ends, state, sea) - old

    def stop(self, t: float, over: float) -> None:
        """From t (s) on the rate goes to zero over a time (s), for good, and so does a tension that is held.

        It is cubic in time and begins as it is now, with its growth.  ValueError: longer or shorter than can be.
        """
        numbers = self.reel.numbers
        of_winch = float(numbers.length), float(numbers.rate), float(numbers.acceleration)
        L, c, a = of_winch if self.holds_tension else length_at.py_func(self.law, t)
        law = np.zeros((2, 8))
        law[:, 0] = t, t + over
        law[0, 3:] = 0.5 * c / over**3 + 0.25 * a / over**2, -c / over**2 - 2.0 * a / (3.0 * over), 0.5 * a, c, L
        law[1, 7] = self._checked(L + 0.5 * c * over + a * over**2 / 12.0)
        self.winch.tension, self.stopped = 0.0, True
        self._set_law(law)

    def _checked(self, length: float) -> float:
        """A length, m, to which line is to be paid out; ValueError: longer or shorter than can be."""
        plan = self.plan
        if not plan.shortest <= length <= plan.longest * (1.0 + SAME_PLACE):
            between = f"{plan.shortest:.6g} and {plan.longest:.6g} m"
            text = f"the length that is out would be {length:.6g} m, expected between {between} (payout.longest)"
            raise ValueError(text)
        return length

    def _set_law(self, law: Floats) -> None:
        """Rows of a law are t (s) and coefficients of x^6 to x^0, x = time since t; steps and outputs have its address.

        Outputs that wait were made with the law before: they are written down first.
        """
        self.law, self.reel = law, self.reel._replace(law=law)
        self.table.bind(reel=self.reel)

    def asks(self, line: Line) -> bool:
        """Whether iterations of Newton's method need something of the reel: friction is on the material that passes."""
        rubs = line.bits & FRICTION and line.bits & TOUCHES
        return bool(self.holds_tension or self.rides or self.damped or rubs)

    @property
    def length(self) -> float:
        """Length, m, that is out."""
        return float(self.reel.numbers.length)

    @property
    def material(self) -> int:
        """Nodes that are out, but for the fairlead and those that ride with it."""
        return int(self.reel.true.size) - self.rides

    @property
    def rides(self) -> int:
        """Nodes that ride with the fairlead."""
        return self.plan.layer.size - 1

    @property
    def solves_twice(self) -> bool:
        """Whether a winch holds a tension at the start, or at a clamp, until it is stopped.

        An iteration takes another right-hand side: there is room for that as long as the line runs.
        """
        return bool(self.plan.winch.tension) and (not self.plan.side or self.rides > 0)

    @property
    def damped(self) -> bool:
        """Whether the line has damping in proportion to its stiffness."""
        return bool(self.plan.cable.bits & STIFFNESS_DAMPING)

    @property
    def holds_tension(self) -> bool:
        """Whether a winch holds a tension."""
        return bool(self.winch.tension)

    def resistance(self, t: float) -> float:
        """Pull (N) that inertia, losses and tension of a winch balance at t (s)."""
        winch = self.winch
        lost, _ = losses.py_func(winch, winch.rate_now)
        return float(winch.inertia * winch.true_now + lost + tension_held.py_func(winch, t))

    def accelerate(self, more: float) -> None:
        """A winch that holds a tension accelerates by so much more (m/s2)."""
        self.winch.true_now += more
        self.winch.algorithmic_now = self.winch.true_now

    @property
    def fastest(self) -> float:
        """Largest size of the rate, m/s, that is to be expected."""
        if self.holds_tension:
            most = float(self.winch.max_rate)
            return most if np.isfinite(most) else abs(float(self.winch.rate_now))
        return fastest(self.law)

    @contextmanager
    def forces_on(self) -> Iterator[None]:
        """While accelerations are found: the line with what acts on it because its length changes."""
        put_forces_on(self.table.numbers)
        try:
            yield
        finally:
            remove_forces(self.table.numbers)

    @property
    def lengthening(self) -> Floats:
        """(N,) m/s2, second rates of the lengths of cells."""
        out = np.zeros(self.reel.true.size)
        out[self.material - 1] = self.reel.numbers.acceleration  # from the far end on
        return out if self.plan.side else out[::-1]

    def leave_unbalanced(self) -> None:
        """Nothing balances the neighbours of a node that has just entered or left."""
        self.reel.stage.unbalanced, self.reel.numbers.changed = 0.0, -np.inf

    @property
    def due(self) -> bool:
        """Whether a node is to enter or to leave."""
        return bool(self.reel.numbers.due)

    @property
    def at_its_end(self) -> bool:
        """Whether a winch that holds a tension has no more line to pay out, or none to take in."""
        winch = self.winch
        return self.holds_tension and not winch.least <= winch.length_now <= winch.most

    def other_base(self, layout: Layout) -> tuple[Layout, np.ndarray]:
        """The layout with the node that is due more, or less; (n,) which base cells of before its base cells are."""
        plan, source = self.plan, self._came_from(self.enters, layout.rod.size)
        count = source.size - self.rides
        here = on_other_parts(layout, layout.node_flags, source, plan.parts_of(count)) if plan.follows else None
        return plan.layout(count, self.length, layout.rod[source], here), source

    def use_reel(self, reel: Reel, layout: Layout | None) -> None:
        """Go on with a reel of other nodes; layout: of a line whose zones move."""
        self.reel = reel
        self.count = (reel.true.size if layout is None else layout.rod.size) - self.rides
        if layout is not None:
            self.nodes = self.plan.nodes_of(layout)

    @property
    def enters(self) -> bool:
        """Whether the node that is due enters; else one leaves."""
        return bool(self.reel.true[self.material - 1] > self.reel.numbers.longest)

    def _came_from(self, enters: bool, cells: int) -> np.ndarray:
        """Which of so many old base cells those come from of a line that a node enters, or leaves."""
        grows, all_ = cells - self.plan.layer.size, np.arange(cells)
        source = np.insert(all_, grows, grows) if enters else np.delete(all_, grows - 1)
        return source if self.plan.side else cells - 1 - source[::-1]

    @property
    def changing(self) -> np.ndarray:
        """(N,) bool, cells whose length changes because line is paid out."""
        return self._changing_on(self.reel)

    def _changing_on(self, reel: Reel) -> np.ndarray:
        """The same of another reel."""
        found = (np.arange(reel.true.size) >= reel.true.size - self.rides - 1) | (reel.since > -np.inf)
        return found if self.plan.side else found[::-1]

    def _fitting_chords(self, reel: Reel, line: Line, e: Floats, T: Floats, h: Floats, ck: Floats) -> Floats:
        """Chords (nb, N, 3) as long as their cells (nb, N) m are under their tensions T, where lengths change.

        Those within a step are between its ends, where the length that is out need not be; the stretch would be off.
        """
        if line.law.size or line.bits & STIFFNESS_DAMPING:  # whose strain is not that of the tension
            return e
        at, out = np.flatnonzero(self._changing_on(reel)), e.copy()
        size = np.linalg.norm(out[:, at], axis=2)
        more = h[:, at] * (1.0 + ck[:, at] * T[:, at]) / size
        out[:, at] *= np.where(np.abs(more - 1.0) > SAME_PLACE, more, 1.0)[:, :, None]  # at its ends they fit
        return out

    def as_now(self, model: Model) -> Model:
        """A model whose zones move, and whose nodes are where they are now."""
        self.lengthen()
        layout = self.plan.layout(self.count, self.length, model.zoned.rod, model.zoned.here)
        on_base = LineOnBase(self.plan.held_as(model.cable), layout.base)
        return replace(model, layout=layout, on_base=on_base, zones=layout.zones)

    def release(self, cells: np.ndarray) -> None:
        """The reel no longer says how long these cells (k,), counted from the far end, are."""
        reel = self.reel
        reel.since[cells], reel.span[cells] = -np.inf, 1.0
        reel.lack[cells] = reel.rate[cells] = 0.0

    def lengths_now(self, cells: np.ndarray, t: float) -> tuple[Floats, Floats]:
        """What cells (k,), counted from the far end, lack of their length at t (s), and its rate, m/s."""
        reel = self.reel
        x = np.clip((t - reel.since[cells]) / reel.span[cells], 0.0, 1.0)
        lack, rate, span = reel.lack[cells], reel.rate[cells], reel.span[cells]
        value, y = 1.0 - x**3 * (10.0 - 15.0 * x + 6.0 * x * x), x * (1.0 - x) ** 3 * (1.0 + 3.0 * x)
        grows = (1.0 - x) ** 2 * (1.0 + 2.0 * x - 15.0 * x * x)
        return lack * value + span * rate * y, rate * grows - 30.0 * lack / span * x * x * (1.0 - x) ** 2

    def fit(self, model: Model, t: float) -> None:
        """Let the line of a model whose zones have changed have the length of now, at t (s)."""
        if self.plan.follows:
            self._set_cells(model.zoned)
        self._fit(model.line, self.reel, float(self.reel.numbers.length), t)

    def _set_cells(self, layout: Layout) -> None:
        """Go on with other cells far from the winch: what the reel knows of those near it stays."""
        old, self.nodes = self.reel, self.plan.nodes_of(layout)
        self.reel = reel = self._blank(layout.base_of_cell.size - self.rides)
        reel.numbers[:], reel.stage[:], near = old.numbers, old.stage, FEWEST_CELLS + self.plan.layer.size
        for name in OF_CELLS:
            getattr(reel, name)[-near:] = getattr(old, name)[-near:]
        at = slice(-near, None) if self.plan.side else slice(near)  # in the order of the line
        reel.balance[at] = old.balance[at]

    def _fit(self, line: Line, reel: Reel, length: float, t: float) -> None:
        """Let a line have a length, m, at t (s): cells that grow hold the sections that come off the reel."""
        reel.numbers.length, self._clock.now = length, t
        self._fitting.bind(line=line, reel=reel, clock=self._clock)
        fit_line(self._fitting.numbers)

    def observe(
        self, observer: Observer, model: Model, batch: Batch
    ) -> tuple[Observer, Observation, list[tuple[Zone, ...]]]:
        """The outputs of a batch, each of a line as long as it was then, and the zones of all but the first."""
        line = copied(model.line)
        varied, zones = self.varied(line, model, batch)
        there = observer.on_varied(line, model.sea.values, zones[0], varied["s"])
        there.first_energy = observer.first_energy
        e = self._fitting_chords(self.reel, model.line, batch.e, batch.T, varied["h"], varied["ck"])
        return there, there.observation(batch._replace(e=e, h=varied["h"], kb=varied["kb"]), varied), zones[1:]

    def varied(self, line: Line, model: Model, batch: Batch) -> tuple[dict[str, Floats], list[tuple[Zone, ...]]]:
        """Arrays (nb, ...) of the line at each output of a batch that change, and its zones.

        line (written): a copy of that of the model.
        """
        varied = {name: np.empty((batch.t.size, *getattr(line, name).shape)) for name in varying(line)}
        zones = []
        moving = model.zones if model.layout is not None else None
        for k, (then, zones_then) in enumerate(self._lines_of(line, self.reel, batch, moving)):
            zones.append(zones_then)
            for name, x in varied.items():
                x[k] = getattr(then, name)
        if model.layout is not None:  # lengths and stiffness of zones that move
            kept, at = ~self.changing, np.arange(line.s.size)
            own = self.material - 1
            nodes = at < own if self.plan.side else at > line.h.size - own
            h, kb = (batch.h, batch.kb) if batch.h.ndim == 2 else (model.line.h[None], model.line.kb[None])  # of now
            varied["h"][:, kept], varied["kb"][:, nodes] = h[:, kept], kb[:, nodes]
        return varied, zones

    def _lines_of(
        self, line: Line, reel: Reel, batch: Batch, moving: tuple[Zone, ...] | None = None
    ) -> Iterator[tuple[Line, tuple[Zone, ...]]]:
        """The line of each output of a batch, in arrays that the next one overwrites, and its zones.

        line (written), reel: with the cells of the outputs; moving: zones, if they move.
        """
        line.force[:, :2] = 0.0  # but for what rounding leaves of the forces on nodes that ride
        reel = reel._replace(numbers=reel.numbers.copy(), true=reel.true.copy(), stage=np.zeros_like(reel.stage))
        self._fitting.bind(line=line, reel=reel, clock=self._clock)
        if not (self.holds_tension or self.plan.from_outside):  # exactly, where samples interpolate
            known = np.flatnonzero(batch.t >= self.law[0, 0])
            there = lengths_at(self.law, batch.t[known])
            batch.report[known, LENGTH_OUT], batch.report[known, PAYOUT_RATE] = there
        lengths = batch.report[:, LENGTH_OUT].tolist()
        for t, length in zip(batch.t.tolist(), lengths, strict=True):
            reel.numbers.length, self._clock.now = length, t
            fit_line(self._fitting.numbers)
            yield line, self.plan.zones_of(length, moving)

    def outputs_in(self, line: Line, reel: Reel, batch: Batch) -> list[Output]:
        """The outputs of a batch, each with the line as it was then; zones do not move.

        line (written), reel: with the cells of the outputs.  They keep the arrays of `line` and `batch`.
        """
        found = []
        fields: tuple[Any, ...] = tuple(batch)
        of_each = [x.ndim > 0 and len(x) == batch.t.size for x in fields]
        for k, (then, zones) in enumerate(self._lines_of(line, reel, batch)):
            arrays: dict[str, Any] = {name: getattr(then, name).copy() for name in varying(then)}
            own = Batch._make(x[k : k + 1] if each else x for x, each in zip(fields, of_each, strict=True))
            e = self._fitting_chords(reel, line, own.e, own.T, arrays["h"][None], arrays["ck"][None])
            found.append(Output(then._replace(**arrays), zones, own._replace(e=e)))
        return found

    def outputs_of_now(self, line: Line, batch: Batch) -> list[Output]:
        """The same of the line as it is, which keep the arrays of `batch` alone."""
        return self.outputs_in(copied(line), self.reel, batch)

    # --- checkpoints ------------------------------------------------------------------------------

    def checkpoint(self) -> dict[str, Any]:
        """What the next steps depend on."""
        kept = {name: getattr(self.reel, name).copy() for name in KEPT}
        cells = {}
        if self.layout is not None:
            cells["rod"] = self.layout.rod.copy()
            if self.plan.follows:
                cells["here"] = self.layout.node_flags
        ended = {name: True for name in ("ended", "stopped") if getattr(self, name)}
        return {"count": self.count, "law": self.law.copy(), "foreseen": self.foreseen, **ended, **kept, **cells}

    def restore(self, tree: Any, model: Model) -> Model:
        """Go on as `checkpoint` has written: the model as it was then.  ValueError: it is that of another line."""
        template = {"count": 0, "law": np.zeros((0, 8))}
        given = dict(tree)
        cells = {name: given.pop(name) for name in ("rod", "here") if name in given}
        foreseen = given.pop("foreseen", None)
        self.ended, self.stopped = bool(given.pop("ended", False)), bool(given.pop("stopped", False))
        saved = matched({name: given.pop(name) for name in template}, template, "payout")
        count, law = saved["count"], saved["law"]
        if not (law.ndim == 2 and law.shape[1] == 8 and len(law) and (np.diff(law[:, 0]) >= 0.0).all()):
            raise ValueError("a length that no winch gives")
        if (
            not np.searchsorted(self.plan.nodes, self.plan.shortest - self.plan.layer[0] - SAME_PLACE * model.length)
            <= count
            < self.plan.nodes.size - 1
        ):
            raise ValueError(f"{count} nodes, of a line that has {self.plan.nodes.size} at most")
        self.count, self.law = count, law
        # A file of an earlier version has none.
        self.foreseen = matched(foreseen, 0.0, "payout/foreseen") if foreseen is not None else self.fastest
        if model.layout is not None:
            parts = self.plan.parts_of(count)
            known: dict[str, Any] = {"rod": parts > 0}
            known |= {"here": np.zeros(parts.sum() + 1, bool)} if self.plan.follows else {}
            found = matched(cells, known, "payout")
            provisional = float(self.plan.nodes[count] + self.plan.layer[0])
            layout = self.plan.layout(count, provisional, found["rod"], found.get("here"))
            model, self.nodes = replace(model, layout=layout), self.plan.nodes_of(layout)
            self.reel = self._blank(layout.base_of_cell.size - self.rides)
        else:
            self.reel = self._blank(count)
        numbers = np.asarray(given.get("numbers", np.zeros(0)))
        if numbers.size in OF_EARLIER_VERSIONS:
            given["numbers"] = np.concatenate([numbers, self.reel.numbers[numbers.size :]])
        absent = {"winch": self.winch, "balance": self.reel.balance}
        kept = matched(absent | given, {name: getattr(self.reel, name) for name in KEPT}, "payout")
        if not (
            kept["span"].min() > 0.0 and ReelNumbers.of(kept["numbers"]).length > ReelNumbers.of(kept["numbers"]).place
        ):
            raise ValueError("a length that no line has")
        for name, x in kept.items():
            getattr(self.reel, name)[:] = x
        return self.on(model, float(self.reel.numbers.length))

    def law_from_outside(self, begin: float, end: float, asked: tuple[float | None, float] | None) -> Floats | None:
        """How a length set from Python goes where it is asked to, or on at its rate.

        begin, end: of it, s; asked: its length, m, and rate, m/s, at the end; no length: the one to which an even
        change of the rate leads.  None: it is not set from Python.  ValueError: it cannot be so long, or so short.
        """
        if not self.plan.from_outside or self.ended or self.stopped:
            return None
        L, c, _ = length_at.py_func(self.law, begin)
        length, rate = asked or (None, c)
        dt = end - begin
        to = self._checked(L + 0.5 * (c + rate) * dt if length is None else length)
        mean = (to - L) / dt
        law = np.zeros((2, 8))
        law[:, 0] = begin, end
        law[0, 4:] = (c + rate - 2.0 * mean) / dt**2, (3.0 * mean - 2.0 * c - rate) / dt, c, L
        law[1, 6:] = rate, to
        return law

    def use_law(self, law: Floats) -> None:
        """Go by a law of `law_from_outside` from now on."""
        if self.law.shape == law.shape:
            self.law[:] = law
        else:
            self._set_law(law)

    def lengthen(self) -> None:
        """The line as it is at the time of its run."""
        lengthen(self.table.numbers)


def length_asked(scene: LineScene, paying: PayingOut, length: Any, rate: Any, where: str) -> tuple[float | None, float]:
    """Length (m; None: what the rate leads to) and rate (m/s) that are asked of a line; ValueError: they cannot be.

    where: its `payout` stands in the scene.
    """
    payout = payout_of(scene)
    assert payout is not None
    if paying.ended:
        raise ValueError("the end at the winch has been let go: no line comes any more")
    if paying.stopped:
        raise ValueError("the winch has been stopped by a part of the run: its length stays")
    if not payout.from_outside:
        raise ValueError(f"{where} gives the length: leave {', '.join(SOURCES)} out to set it")
    for name, x in (("rate", rate), ("length", 0.0 if length is None else length)):
        if isinstance(x, bool) or not isinstance(x, int | float | np.integer | np.floating) or not np.isfinite(x):
            raise ValueError(f"{name}: expected a finite number, found {x!r:.60}")
    if length is None:
        return None, float(rate)
    plan = paying.plan
    if not plan.shortest <= length <= plan.longest * (1.0 + SAME_PLACE):
        between = f"{plan.shortest:.6g} and {plan.longest:.6g} m"
        raise ValueError(f"length = {length:.9g} m, expected between {between} ({where}.longest)")
    return float(length), float(rate)


def varying(line: Line) -> list[str]:
    """Arrays of a line that its length changes, and that outputs ask for."""
    return [*VARIES, *(name for name in VARIES_TOO if getattr(line, name).size)]


def energy(line: Line, ends: Ends, state: State, sea: Sea) -> float:
    """Kinetic, elastic and potential energy, J, with what contact with the sea has stored."""
    n = line.s.size
    return float(energy_of(line, sea, ends, state, np.zeros((n, 3)), np.zeros((n, 3)), np.zeros(5)))
