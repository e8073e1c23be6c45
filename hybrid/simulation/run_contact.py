"""Contact of lines of a run: from when on it is computed of which lines, and until when."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hybrid.errors import Complaint, SceneError
from hybrid.kernels.contact.lines_distance import JOINT
from hybrid.kernels.contact.self_contact_law import OUTER
from hybrid.kernels.state import books as b
from hybrid.kernels.state.report import MAY_TOUCH, SELF_CONTACT, SELF_FRICTION
from hybrid.kernels.state.state import Floats, Line
from hybrid.model.build import Model
from hybrid.model.contents import contact_bits, touching, touching_among, touching_no_more
from hybrid.model.network import NetworkModel
from hybrid.scene.schema import LineScene
from hybrid.simulation.lines_contact import PASSED, LinesWatch, deepest_text, diameters, pair_text, shared_of
from hybrid.simulation.parts import Part
from hybrid.simulation.restart import of_line
from hybrid.simulation.run_of_lines import RunOfLines
from hybrid.simulation.run_start import contact_of, crossings, energy_between, touches_alone
from hybrid.solve.contact import SelfContact, SharedContact
from hybrid.solve.network_solver import NetworkSolver
from hybrid.solve.stepper import JoinedLine, NetworkState
from hybrid.store.envelope import meeting_text

Pair = tuple[int, int]
# Where lines are that are said to be within themselves.
WITHOUT_CONTACT, AT_START = "in the equilibrium without contact", "at the start"
# Kinds of events: contact between lines begins by itself; it is given up because no step leads on with it.
BEGINS, GIVEN_UP = "contact begins", "contact given up"


def refuse_within_itself(
    network: NetworkModel, lines: Sequence[JoinedLine], state: NetworkState, moves: bool, where: str = WITHOUT_CONTACT
) -> None:
    """SceneError: a line for which contact is asked is within itself at the start; where: what that is.

    In an equilibrium without contact so is every start from which a damped motion with contact could lead to another.
    moves: whether a motion begins there, which may begin in contact; an equilibrium alone must be apart.
    """
    if network.touching is not None:
        _refuse_within_others(network, lines, state, moves, where)
    for k, (name, model, x, one) in enumerate(zip(network.names, network.models, lines, state.lines, strict=True)):
        if not touches_alone(network, k):
            continue
        contact = contact_of(model)
        energy = contact.energy_of(x.line, x.ends, one)
        if energy == 0.0 or (moves and math.isfinite(energy)):
            continue
        given = f"self: true, and {where} {deepest_text(contact, model)}"
        expected = "a start in which the line is apart"
        fix = f"lines.{name}.initial: {{points: [...]}}, such as a wide U, a smaller diameter, or leave contact out"
        if where == WITHOUT_CONTACT:
            contact.energy_of(x.line, x.ends, model.start)
            first = deepest_text(contact, model)
            expected = "a first shape in which the line is apart, for a damped motion with contact to lead to rest"
            expected += f"; in this one {first}"
            fix += "; or `hybrid run` from a start that is apart"
        raise SceneError([Complaint(f"lines.{name}.contact", given, expected, fix)])


def _refuse_within_others(
    network: NetworkModel, lines: Sequence[JoinedLine], state: NetworkState, moves: bool, where: str
) -> None:
    """The same of lines that touch each other."""
    energy, shared = energy_between(network, lines, network.body_numbers(0.0), state)
    if energy == 0.0 or (moves and math.isfinite(energy)):
        return
    given = f"and {where}, {pair_text(shared, network)}"
    expected = "a start in which lines are apart"
    if where == WITHOUT_CONTACT:
        expected = "first shapes in which lines are apart, for a damped motion with contact to lead to rest"
    fix = "lines.NAME.initial: {points: [...]} of a line that passes beside the other, or points farther apart"
    raise SceneError([Complaint("contact", given, expected, fix)])


class RunContact(Part):
    """Contact of the lines of a run, with themselves and with each other."""

    name, older = "contact", MappingProxyType({x: [] for x in ("between", "passed", "met", "let_pass")})
    wants = b.IS_BENT | b.MEETS_ITSELF | b.NEARS_ITSELF | b.PARTS_ITSELF | b.HIDES_ITSELF | b.LINES_NEAR

    def __init__(self, run: RunOfLines, lets_touch: bool, watches: bool) -> None:
        """Of a run whose contact is as the scene asks for it.

        lets_touch: whether contact begins by itself where lines come near themselves, else that is only noticed;
        watches: whether lines that pass through each other are told of.
        """
        self._run, self._watches = run, watches
        for line in run.lines:
            line.lets_touch = lets_touch
        self.shared: SharedContact | None = None  # of lines with each other
        self.watch: LinesWatch | None = None  # whether others meet, between which no contact is computed
        self._met: set[Pair] = set()  # lines that have been said to touch
        self._passed: set[Pair] = set()  # and to pass through each other
        self._let_pass: set[Pair] = set()  # of lines that may meet, those between which it is not computed
        self._note_partners()

    # --- solvers --------------------------------------------------------------------------------------

    def _note_partners(self) -> None:
        """Lines know whether they may touch others."""
        among = self._run.model.touching
        for line in self._run.lines:
            line.shares = among is not None and line.number in among.lines

    def fit_lines(self) -> None:
        """Contact of the lines as they are, of each with itself and of all, goes on with what there was."""
        run = self._run
        self._note_meetings()
        own = {line.number: line.contact for line in run.lines if line.shares and line.contact is not None}
        contacts, shared = [line.touch_itself(run.t) for line in run.lines], shared_of(run.model, rubs=True)
        if shared is not None and self.shared is not None and shared.lines == self.shared.lines:
            remeshed = any(line.remeshes for line in run.lines)
            shared.restore(self.shared.checkpoint(run.t), run.t, remeshed=remeshed)
        elif shared is not None and (own or self.shared is not None):
            shared.copy_from(self.shared, own, run.t)
        self.shared, run.touching = shared, (contacts, shared)

    def use_solver(self, model: NetworkModel, solver: NetworkSolver) -> None:
        """Look in the steps of another solver which lines pass through each other."""
        if self.watch is not None:
            self._note_passages()
        self._watch_lines()

    def _watch_lines(self) -> None:
        """Look from now on which lines overlap without contact, beside those that are known to."""
        if not self._watches:
            return
        run = self._run
        self.watch = LinesWatch(run.network, run.model, self._passed, run.loop.clock, self._let_pass)
        if self.watch.is_needed:
            run.loop.watch(*self.watch.attach(run.solver.line_tables))
        else:
            run.loop.watch()  # its tables are of the watch before, which is gone
        for line in run.lines:
            line.watched_by = self.watch

    # --- the start ------------------------------------------------------------------------------------

    def _find_overlaps(self) -> None:
        """Look which lines overlap without contact in the first state, and which the search for it has let cross."""
        run = self._run
        if self.watch is not None and self.watch.is_needed:
            run.solver.join_states(run.state)
            self._passed |= self.watch.begin(run.network)
        for a, c in crossings(run.network, run.model, run.found.state) if run.found is not None else ():
            one, two = run.model.names[a], run.model.names[c]
            text = (
                f"lines {one} and {two} cross on the way from their first shapes to this equilibrium: no contact "
                f"between them is asked for, and none is computed in it; contact: {{between: [[{one}, {two}]]}} keeps "
                "them apart"
            )
            run.recorder.event(0.0, 0.0, 0.0, PASSED, text)

    def begin(self) -> None:
        """Contact begins of lines that are near themselves, or each other, at the start."""
        run = self._run
        if not run.moves:
            self.shared = run.solver.shared  # of the search
            self._watch_lines()
            self._find_overlaps()
            return
        step = run.resolution.one.step
        for line, state in zip(run.lines, run.state.lines, strict=True):
            line.nears_itself = line.envelope.itself.is_near(run.t, state, step)
        begun = self._begin_alone()
        self._find_overlaps()
        if self.watch is not None and self.watch.near() and self._begin_between():
            begun = True
        if begun:
            run.balance()
        self._note_meetings()

    # --- checkpoints ----------------------------------------------------------------------------------

    def checkpoint(self) -> dict[str, Any]:
        """Which lines touch because they have come near, what has been said, and where lines stick."""
        run = self._run
        among = run.model.touching if run.network.contact is None else None
        found: dict[str, Any] = {"between": [list(x) for x in among.pairs] if among is not None else []}
        said = {"passed": self._passed, "met": self._met, "let_pass": self._let_pass}
        found |= {name: sorted(list(x) for x in pairs) for name, pairs in said.items()}
        return found if self.shared is None else found | {"contact": self.shared.checkpoint(run.t)}

    def restore_lines(self, saved: Mapping[str, Any]) -> bool:
        """Lines touch themselves and each other, and know their partners again."""
        near = [x.number for x in self._run.lines if "self_contact" in of_line(saved, x.name) and not x.touches]
        self._let_touch(near)
        among, between = self._run.model.touching, _pairs(saved["between"])
        others = bool(between) and (among is None or between != {*among.pairs})
        if others:
            self._touch_each_other(between)
        self._note_partners()
        return bool(near) or others

    def restore(self, saved: Mapping[str, Any]) -> None:
        """That has been said, and lines stick where they did."""
        self._passed, self._met, self._let_pass = (_pairs(saved[x]) for x in ("passed", "met", "let_pass"))
        if len(self._run.lines) > 1:
            self._watch_lines()  # what has met since has not
        if self.shared is not None:
            self.shared.restore(saved["contact"], self._run.t)

    # --- steps ----------------------------------------------------------------------------------------

    def after_step(self) -> None:
        """Contact begins or ends of lines that have come near themselves or each other, or are apart again."""
        run = self._run
        if any(line.nears_itself for line in run.lines):
            self._begin_alone()
        if run.loop.counts.notices & b.LINES_NEAR:
            self._begin_between()
        if parted := [line.number for line in run.lines if line.parts_itself and not line.shares]:
            self._end_alone(parted)

    def _begin_alone(self) -> bool:
        """Contact is computed from now on of lines that have come near themselves; whether any begins.

        Those within themselves go on without.  Nothing moves; energy that contact has at once is booked as that of a
        change of zones.
        """
        run = self._run
        near = [line for line in run.lines if line.nears_itself]
        begun = []
        for line in near:
            line.has_neared_itself, line.nears_itself, watch = True, False, line.envelope.itself
            if not line.lets_touch:
                watch.on = False
                run.solver.bind_line(line.number, itself=0)
                continue
            x, model = run.solver.lines[line.number], run.model.models[line.number]
            energy = contact_of(model).energy_of(x.line, x.ends, run.state.lines[line.number])
            if math.isfinite(energy):
                begun.append(line.number)
                watch.begins(run.t, model, line.events.event)
                continue
            watch.waits()
            if run.steps:  # what is so at the start is told with the equilibrium
                line.meets_itself(run.t, run.last_step)
        if begun:
            self._let_touch(begun)
            run.go_on_changed(begun, "where contact of the line with itself begins")
        return bool(begun)

    def _end_alone(self, numbers: Sequence[int]) -> None:
        """Contact is computed no longer of lines of these numbers, until they come near themselves again."""
        self._let_touch(numbers, touch=False)
        self._run.go_on_changed(numbers, "where contact of the line with itself ends")

    def _let_touch(self, numbers: Iterable[int], touch: bool = True) -> None:
        """Lines touch themselves, or no longer; the solver has still to follow."""
        run = self._run
        frictions = {k: run.lines[k].scene.contact.friction for k in numbers}
        run.change_lines(
            {k: partial(touching, friction=x) if touch else touching_no_more for k, x in frictions.items()}
        )

    # --- lines with each other ------------------------------------------------------------------------

    def _begin_between(self) -> bool:
        """Contact is computed from now on of lines that have come near each other; whether any begins."""
        pairs = self._lines_near()
        if not pairs:  # they are let pass
            self._note_passages()
            self._watch_lines()
            return False
        now = self._run.model.touching.pairs if self._run.model.touching is not None else []
        self._change_pairs({*now, *pairs}, "where contact of lines with each other begins")
        return True

    def _lines_near(self) -> list[Pair]:
        """Lines, two each, between which contact begins now, after an event; others that are near are let pass.

        These are lines that already are in each other, or in themselves, or are pressed on each other beside what both
        are joined to: legs that leave it by a narrow angle.
        """
        run, begun = self._run, []
        found = self.watch.near() if self.watch is not None else []
        run.gather_events()  # in the order in which they happen
        for a, c, s, other in found:
            if not _may_begin(run, (a, c)):
                self._let_pass.add((a, c))
                continue
            begun.append((a, c))
            one, two = run.model.names[a], run.model.names[c]
            text = (
                f"lines {one} and {two} come near each other, at s = {s:.4g} m of {one} and s = {other:.4g} m of "
                f"{two}: contact between them is computed from here on, and steps take longer; contact: "
                "{between: []} switches it off"
            )
            run.recorder.event(run.t, 0.0, 0.0, BEGINS, text)
        return begun

    def _change_pairs(self, pairs: Iterable[Pair], after: str) -> None:
        """These lines, two each, touch each other from now on, and no others."""
        run = self._run
        numbers = set(run.model.touching.lines) if run.model.touching is not None else set()
        self._touch_each_other(pairs)
        numbers |= set(run.model.touching.lines) if run.model.touching is not None else set()
        run.go_on_changed(sorted(numbers), after)

    def _touch_each_other(self, pairs: Iterable[Pair]) -> None:
        """Models of which these lines touch each other, two each, and no others; the solver has to follow."""
        run = self._run
        before, among = run.model.touching, touching_among(run.network, run.model.scenes, pairs)
        now = among.lines if among is not None else ()

        def change(line: Line, scene: LineScene, touches: bool) -> Line:
            if touches and among is not None:
                return among.bits(line)
            return line._replace(bits=(line.bits & ~(SELF_CONTACT | SELF_FRICTION)) | contact_bits(scene))

        changes = {}
        for k in {*now, *(before.lines if before is not None else ())}:
            changes[k] = partial(change, scene=run.model.scenes[run.model.names[k]], touches=k in now)
        run.change_lines(changes)
        run.model = replace(run.model, touching=among)
        self._note_partners()

    # --- given up -------------------------------------------------------------------------------------

    def judge_try(self, code: int) -> bool:
        """No step leads on: contact that began by itself is computed no longer; whether there was any."""
        return code == b.FAILED and self._gives_up(float(self._run.loop.clock.tried_dt))

    def _gives_up(self, dt: float) -> bool:
        run, numbers = self._run, []
        for line in run.lines:
            contact = line.contact
            if contact is None or not (contact.touches and line.model.line.bits & MAY_TOUCH):
                continue
            s, other, text = _given_up(contact, line.model, dt)
            line.events.event(run.t, s, other, GIVEN_UP, text)
            line.envelope.itself.waits()
            numbers.append(line.number)
        if numbers:
            self._end_alone(numbers)
        return self._gives_up_pairs(dt) or bool(numbers)

    def _gives_up_pairs(self, dt: float) -> bool:
        """The same of lines that touch each other because they have come near: those that touch now are let pass."""
        run, touches = self._run, self._touching_now()
        if not touches:
            return False
        assert run.model.touching is not None and self.shared is not None
        text = (
            f"no step leads on with contact of lines, down to {dt:.3g} s: {pair_text(self.shared, run.model)}; it is "
            "computed no longer, and they pass through each other; shorter cells there would do"
        )
        run.gather_events()
        run.note(GIVEN_UP, text)
        alone = {a for a, c in touches if a == c}
        pairs = run.model.touching.pairs
        passing = {x for x in pairs if x in touches or alone & set(x)}
        self._let_pass |= passing
        self._change_pairs([x for x in pairs if x not in passing], "where contact of lines with each other ends")
        return True

    def _touching_now(self) -> set[Pair]:
        """Lines whose contact began by itself, two each, that touch in the state that was looked at last.

        A line that touches itself beside others stands there twice.
        """
        if self.shared is None or self._run.network.contact is not None:
            return set()
        return {(min(a, c), max(a, c)) for (a, _), (c, _) in self.shared.points_between()}

    # --- what is told ---------------------------------------------------------------------------------

    def log(self, rows: Floats, cpu: Floats) -> None:
        """Tell which lines have met in these steps."""
        self._note_meetings()

    def finish(self, status: str) -> None:
        """Likewise in an equilibrium."""
        self._note_meetings()

    def _note_meetings(self) -> None:
        """An event for every two lines that have met, with contact or without, when they do first."""
        run = self._run
        for a, c, t, s, other in sorted(self.shared.met() if self.shared is not None else (), key=lambda x: x[2]):
            if (a, c) in self._met:
                continue
            self._met.add((a, c))
            text = meeting_text(run.model.names[a], run.model.names[c], s, other)
            run.recorder.event(t, 0.0, 0.0, "lines touch", text)
        self._note_passages()

    def _note_passages(self) -> None:
        """An event for every two lines that have met without contact, when they do first.

        Of lines that lie along each other from what both are joined to there is nothing to tell, as at the start.
        """
        if (watch := self.watch) is None:
            return
        run = self._run
        for a, c, t, s, other in sorted(watch.met(), key=lambda x: x[2]):
            if (a, c) in self._passed:
                continue
            self._passed.add((a, c))
            if _side_by_side(run.model, run.state, watch.joined, (a, c), (s, other)):
                continue
            one, two = run.model.names[a], run.model.names[c]
            text = (
                f"lines {one} and {two} pass through each other: no contact between them is computed, and at "
                f"s = {s:.4g} m of {one} and s = {other:.4g} m of {two} their centrelines are nearer than the mean of "
                f"their diameters; contact: {{between: [[{one}, {two}]]}} keeps them apart"
            )
            run.recorder.event(t, 0.0, 0.0, PASSED, text)


def _pairs(saved: Any) -> set[Pair]:
    """Numbers of lines, two each.  ValueError: that cannot be."""
    if not (isinstance(saved, list) and all(isinstance(x, list) and len(x) == 2 for x in saved)):
        raise ValueError("passed, met, between: pairs of numbers of lines were expected")
    return {(int(a), int(c)) for a, c in saved}


def _may_begin(run: RunOfLines, pair: Pair) -> bool:
    """Whether two lines are in each other nowhere, nor in themselves, nor touch by ends that are joined to the same.

    Ends that are held, or moved, are joined to one thing where they would touch each other.
    """
    among = touching_among(run.network, run.model.scenes, [pair])
    assert among is not None
    model = replace(run.model, touching=among)
    energy, shared = energy_between(model, run.solver.lines, run.solver.bodies.copy(), run.state)
    if not math.isfinite(energy):
        return False
    joined = dict(zip(among.lines, shared.contact.joined.tolist(), strict=True))
    models, r = run.model.models, [x.r for x in run.state.lines]
    wide = OUTER * float(max(diameters(models[k]).max() for k in pair))
    return not any(
        a != c and joined[a][e] == joined[c][f] and (joined[a][e] or math.dist(r[a][-e], r[c][-f]) <= wide)
        for (a, i), (c, j) in shared.points_between()
        for e in _ends_beside(models[a], i)
        for f in _ends_beside(models[c], j)
    )


def _ends_beside(model: Model, node: int) -> list[int]:
    """Which ends of a line, 0 or 1, are near a node."""
    s, reach = model.line.s, JOINT * float(diameters(model).max())
    return [k for k in (0, 1) if abs(float(s[node] - s[-k])) <= reach]


def _side_by_side(
    model: NetworkModel, state: NetworkState, joined: NDArray[np.int64], pair: Pair, where: tuple[float, float]
) -> bool:
    """Whether two lines that met at these arc lengths (m) lay along each other all the way from a common joint.

    They did where both places are as far from it along the lines, and one of the lines is straight up to there, both
    to a diameter.
    """
    (a, c), (s, other) = pair, where
    width = max(float(diameters(model.models[k]).max()) for k in pair)
    for m, k in ((m, k) for m in (0, -1) for k in (0, -1) if joined[a, m] == joined[c, k]):
        ways, bows = [], []
        for line, at, tip in ((a, s, m), (c, other, k)):
            nodes, r = model.models[line].line.s, state.lines[line].r
            place = [np.interp(at, nodes, r[:, j]) for j in range(3)]
            ways.append(abs(at - float(nodes[tip])))
            bows.append(ways[-1] - float(np.linalg.norm(place - r[tip])))
        if max(abs(ways[0] - ways[1]), min(bows)) < width:
            return True
    return False


def _given_up(contact: SelfContact, model: Model, dt: float) -> tuple[float, float, str]:
    """Where, between two arc lengths (m), contact lets no step of dt (s) lead on, and the text of the event."""
    p, q = contact.deepest
    s, other = sorted((float(model.line.s[p]), float(model.line.s[q])))
    nodes = model.line.s[[p, q]]
    cells = float(model.cable.bending_length(1e-9 * model.tension_scale / model.length)[model.cable.piece(nodes)].min())
    if not cells > 0.0:
        cells = 0.5 * float(min(model.line.h[min(p, model.cells - 1)], model.line.h[min(q, model.cells - 1)]))
    where = deepest_text(contact, model) if contact.least_distance < float("inf") else ""
    text = (
        f"no step leads on with contact of the line with itself, down to {dt:.3g} s: {where}; it is not computed until "
        f"these are apart, and they may pass through each other; cells of at most {cells:.2g} m there would do"
    )
    return s, other, text
