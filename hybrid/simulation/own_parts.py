"""Parts of a run that a user writes: what they may read of it, and what they may ask of it.

class Guard(hybrid.RunPart):
    name = "guard"

    def after_step(self, run):
        if run.tension().max() > 5e3:  # N
            run.stop("the line would part")

hybrid.run(scene, parts=[Guard()])
"""

from __future__ import annotations

import inspect
import math
import re
from collections.abc import Iterable, Mapping, Sequence
from copy import deepcopy
from typing import TYPE_CHECKING, Any

import numpy as np

from hybrid.errors import Outcome, ResultError
from hybrid.kernels.state import books as b
from hybrid.kernels.state.report import FORCE_A
from hybrid.kernels.state.state import Floats
from hybrid.simulation.parts import Part
from hybrid.simulation.run_of_lines import RunOfLines
from hybrid.solve.network_steps import NetworkSteps
from hybrid.solve.stepper import LineFailed
from hybrid.store.integrity import pack

if TYPE_CHECKING:  # what a run without winches does not load
    from hybrid.simulation.payout import PayingOut
    from hybrid.simulation.run_payout import RunPayout

NAME = re.compile(r"[A-Za-z][\w-]{0,26}")  # with "part " before it a kind of events, which has 32 bytes
# Verbs of a part that are called for a run, and how many arguments each has.
VERBS = {"begin": 1, "after_step": 1, "finish": 2}
KEEPS = {"checkpoint": 0, "restore": 1}


class RunPart:
    """A part of a run that is the user's own: subclass it, name it, and give it the verbs that it needs.

    name: of up to 27 letters, digits, `_` and `-`; a checkpoint keeps the part by it.  `hybrid.run`, `resume`, `study`
    and `hybrid.Simulation` take such parts.  Every run of an accuracy (the result, finer ones, those to compare with
    and pre-runs) computes with a fresh copy, so that error figures are of the scene with its parts; an equilibrium has
    none.  What the object that was given knows afterwards is what it knew before: a part tells by `run.note`.

    A part with `after_step` has Python called at every step: 30 us of processor time, where a step of 20 catenary cells
    in a plane takes 5 (`pytest bench/test_bench_parts.py -m bench -s -k own`).  One without it costs nothing.  What a
    verb raises ends the run, with a file of what has been computed.
    """

    name = ""

    def begin(self, run: RunView) -> None:
        """The motion begins: forces are known, nothing has moved.  Of a resumed run it is not called."""

    def after_step(self, run: RunView) -> None:
        """A step has been made, and the next one may still be changed."""

    def finish(self, run: RunView, status: str) -> None:
        """The file is about to be closed; status: complete, interrupted or failed."""

    def checkpoint(self) -> dict[str, Any]:
        """What the part knows: by name arrays, numbers, texts, None, and lists and dicts of these.

        By default all its attributes.  What is left out is not known in a resumed run.
        """
        return dict(vars(self))

    def restore(self, saved: Mapping[str, Any]) -> None:
        """Be as when `checkpoint` gave this; tuples have become lists."""
        vars(self).update(saved)


class RunView:
    """A run as a part of the user's own sees it: what may be read, and what may be asked.

    line: the name of a line as in the scene; it may be left out where there is one.  ValueError: there is no such line.
    Arrays are copies, in SI units and inertial axes.
    """

    def __init__(self, run: RunOfLines, lines: Sequence[str], winches: RunPayout | None, part: str) -> None:
        self._run, self._winches, self._part = run, winches, part
        self._numbers = {name: k for k, name in enumerate(lines)}
        self.may_ask = False  # by a part, between two steps

    # --- what may be read -----------------------------------------------------------------------------

    @property
    def lines(self) -> tuple[str, ...]:
        """Names of the lines; "" of one without a name."""
        return tuple(self._numbers)

    @property
    def t(self) -> float:
        """Time of the state, s."""
        return self._run.t

    @property
    def step(self) -> float:
        """Length of the step that led there, s; 0 at the start, and where loads have jumped."""
        return self._run.last_step

    def s(self, line: str = "") -> Floats:
        """Arc lengths (N+1,) of the nodes, m, without stretch; N cells, which may change."""
        return np.array(self._run.model.models[self._number(line)].line.s)

    def position(self, line: str = "") -> Floats:
        """Places (N+1, 3) of the nodes, m."""
        return np.array(self._run.state.lines[self._number(line)].r)

    def velocity(self, line: str = "") -> Floats:
        """Velocities (N+1, 3) of the nodes, m/s."""
        return np.array(self._run.state.lines[self._number(line)].v)

    def tension(self, line: str = "") -> Floats:
        """Effective tensions (N,) of the cells, N."""
        return np.array(self._run.state.lines[self._number(line)].T)

    def end_forces(self, line: str = "") -> Floats:
        """Forces (2, 3) of a line on what holds its start and its end, N."""
        report = self._run.solver.work[self._number(line)].report
        return np.array(report[FORCE_A : FORCE_A + 6]).reshape(2, 3)

    def length(self, line: str = "") -> float:
        """Unstretched length that is out, m."""
        return float(np.ptp(self._run.model.models[self._number(line)].line.s))

    def payout_rate(self, line: str = "") -> float:
        """Rate at which line is paid out, m/s; negative: taken in; ValueError: the line has no winch."""
        return float(self._paid(self._number(line)).reel.numbers.rate)

    # --- what may be asked, in after_step -------------------------------------------------------------

    def stop_winch(self, line: str = "", *, over: float) -> None:
        """The winch of a line stops, and stays so: its rate goes to zero from now on, without a jump of acceleration.

        over: s, in which it does.  A winch that holds a tension lets that go; line that is paid out from outside
        cannot be any more.  ValueError: the line has no `payout`, has come loose there, or would be longer or shorter
        than can be.
        """
        self._check()
        number = self._number(line)
        paying = self._paid(number)
        if not (math.isfinite(over) and over > 0.0):
            raise ValueError(f"over: expected a time above 0, in s, found {over!r:.60}")
        if paying.ended:
            raise ValueError("the end at the winch has been let go: there is nothing to stop")
        assert self._winches is not None
        self._winches.stop(number, over)

    def limit_step(self, longest: float) -> None:
        """The next step is no longer than `longest` (s), but for the shortest that the scene allows.

        ValueError: steps have a fixed length, which follows no motion.
        """
        self._check()
        loop = self._run.loop
        if not longest > 0.0:
            raise ValueError(f"longest: expected a time above 0, in s, found {longest!r:.60}")
        if not loop.controlled:
            raise ValueError("steps have a fixed length: give time.step an accuracy, and they follow the motion")
        loop.clock.next_dt = min(loop.clock.next_dt, max(float(longest), loop.clock.shortest))

    def stop(self, why: str) -> None:
        """End the run here: ComputationError with the outcome STOPPED, and a file of what has been computed."""
        self._check()
        raise LineFailed(-1, Outcome.STOPPED, self.t, None, f"part {self._part}: {why}")

    def note(self, text: str, line: str | None = None, value: float = math.nan) -> None:
        """An event of the result, of the kind `part NAME`; line: what it is about, None: the whole run."""
        kind = f"part {self._part}"
        if line is None:
            self._run.note(kind, text, value=value)
            return
        here = self._run.lines[self._number(line)]
        s = here.model.line.s
        here.events.event(self.t, float(s[0]), float(s[-1]), kind, text, value=value)

    # --- for these ------------------------------------------------------------------------------------

    def _number(self, line: str) -> int:
        if line in self._numbers:
            return self._numbers[line]
        if line == "" and len(self._numbers) == 1:
            return 0
        known = ", ".join(self._numbers) if [*self._numbers] != [""] else "none, because the only line has no name"
        raise ValueError(f"part {self._part}: line {line!r}: expected one of {known}")

    def _paid(self, number: int) -> PayingOut:
        reels = {} if self._winches is None else self._winches.lines
        if number not in reels:
            raise ValueError(f"part {self._part}: line {self.lines[number]!r} has no payout")
        return reels[number]

    def _check(self) -> None:
        if not self.may_ask:
            raise ValueError(f"part {self._part}: a run can be asked for something in after_step only")


class OwnParts(Part):
    """The parts of a run that are the user's own, each a copy of what was given."""

    name = "own"

    def __init__(
        self, run: RunOfLines, given: Sequence[RunPart], lines: Sequence[str], winches: RunPayout | None
    ) -> None:
        """given: checked (`checked_parts`); lines: their names in the scene."""
        self._run = run
        self._given = {x.name: x.checkpoint() for x in given}  # as the run begins with it
        self._each = [(deepcopy(x), RunView(run, lines, winches, x.name)) for x in given]
        self._stepping = [x for x in self._each if _has(x[0], "after_step")]

    def attach(self, loop: NetworkSteps) -> None:
        """Steps ask where a part has a say after each of them."""
        if self._stepping:
            loop.counts.asks |= b.ASK_STEPS

    def begin(self) -> None:
        """All of them begin."""
        for part, view in self._each:
            self._call(part, view, "begin")

    def after_step(self) -> None:
        """Each in the order in which they were given."""
        for part, view in self._stepping:
            view.may_ask = True
            try:
                self._call(part, view, "after_step")
            finally:
                view.may_ask = False

    def finish(self, status: str) -> None:
        """What they have to say of the run."""
        for part, view in self._each:
            self._call(part, view, "finish", status)
        self._run.gather_events()

    def _call(self, part: RunPart, view: RunView, verb: str, *more: str) -> None:
        try:
            getattr(part, verb)(view, *more)
        except LineFailed:
            raise
        except Exception as error:
            error.add_note(f"raised by {verb} of the part {part.name} at t = {self._run.t:.6g} s")
            raise

    def checkpoint(self) -> dict[str, Any]:
        """What they know, and what they knew before the run, by name."""
        kept = {x.name: {"given": self._given[x.name], "now": x.checkpoint()} for x, _ in self._each}
        return {"parts": kept}

    def restore(self, saved: Mapping[str, Any]) -> None:
        """Go on as then.  ValueError: they are others, or were given other values."""
        kept = saved["parts"]
        if kept.keys() != self._given.keys():
            raise ValueError(f"the parts {', '.join(kept)} were expected")
        for part, _ in self._each:
            if pack({"given": kept[part.name]["given"]}) != pack({"given": self._given[part.name]}):
                raise ValueError(f"part {part.name}: other values than those with which the run began")
            part.restore(kept[part.name]["now"])


# --- what a part must be ------------------------------------------------------------------------------


def checked_parts(parts: Iterable[RunPart]) -> tuple[RunPart, ...]:
    """Parts that a run can have.  TypeError or ValueError: which one cannot be, and why."""
    found = tuple(parts)
    for part in found:
        _check_part(part)
    names = [x.name for x in found]
    if twice := {x for x in names if names.count(x) > 1}:
        raise ValueError(f"parts: the name {', '.join(sorted(twice))} is of two of them: each has a name of its own")
    return found


def _has(part: RunPart, verb: str) -> bool:
    return getattr(type(part), verb) is not getattr(RunPart, verb)


def _check_part(part: Any) -> None:
    """TypeError or ValueError: something is no part of a run."""
    if not isinstance(part, RunPart):
        kind = f"the class {part.__name__}, which is to be called" if isinstance(part, type) else type(part).__name__
        raise TypeError(f"parts: expected objects of subclasses of hybrid.RunPart, found {kind}")
    called = type(part).__name__
    if not isinstance(part.name, str) or not NAME.fullmatch(part.name):
        expected = "up to 27 letters, digits, `_` and `-`, a letter first"
        raise ValueError(f"part {called}: name: expected {expected}, found {part.name!r:.60}")
    if not any(_has(part, verb) for verb in VERBS):
        raise TypeError(f"part {called} does nothing: expected a method {', '.join(VERBS)}")
    for verb, number in (VERBS | KEEPS).items():
        try:
            inspect.signature(getattr(part, verb)).bind(*[None] * number)
        except TypeError as error:
            asked = ", ".join([*inspect.signature(getattr(RunPart, verb)).parameters][1:])
            raise TypeError(f"part {called}: expected {verb}({asked}): {error}") from None
    try:
        pack({"part": part.checkpoint()})
        deepcopy(part)
    except (TypeError, ValueError) as error:
        fix = "give it a checkpoint and a restore of what it knows"
        raise TypeError(f"part {called} cannot be kept in a checkpoint and copied: {error}; {fix}") from None


def require_parts(parts: Iterable[RunPart], names: Iterable[str], source: Any) -> None:
    """ResultError: a result was computed with other parts than those with which it is to go on.

    names: of the parts that its checkpoint keeps.
    """
    given, kept = {x.name for x in parts}, {*names}
    if missing := ", ".join(sorted(kept - given)):
        advice = "hybrid.resume(path, parts=[...]) with the parts that it was run with"
        raise ResultError(f"{source} was computed with the part {missing}\n    try:      {advice}")
    if more := ", ".join(sorted(given - kept)):
        raise ResultError(f"{source} was computed without the part {more}\n    try:      run its scene again")
