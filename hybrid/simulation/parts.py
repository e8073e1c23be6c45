"""Parts of a run: what its loop asks of each of them, and in which order.

A run owns arrays and compiled steps, and knows what else there is to a run by the verbs of `Part` alone.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from math import inf
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np

from hybrid.kernels.run.network import SAMPLE_AXES, SAMPLE_LINES, SAMPLE_V, SAMPLE_W
from hybrid.kernels.state.state import Batch, Floats
from hybrid.model.network import NetworkModel
from hybrid.solve.network_solver import NetworkSolver
from hybrid.solve.network_steps import NetworkSteps
from hybrid.solve.stepper import NetworkTaken

# What is asked of several parts is asked in this order.
ORDER = (
    "loads",  # what acts from some time on is known to all that follows
    "planes",  # a line goes on in space, or in its plane, before anything changes its cells
    "lines",  # what makes going on senseless ends the run before more is changed
    "contact",  # begins and ends on the cells on which lines were seen to be near
    "cuts",  # no step leads on where contact gives nothing up, and their text says what touches now
    "zones",  # before nodes, which enter and leave beside the cells that a line has
    "payout",  # before what breaks: a winch may come to its end in the step that breaks its line
    "failures",  # last of what changes lines: what comes loose does so from all of them as they are
    "own",  # a user's own parts see a step with all that it has changed
    "diagnostics",  # of the first state as all others have left it
    "vibrations",  # bounds the steps to come, whatever has changed
    "quantities",  # from here on parts only look
    "rotations",
    "recorder",  # outputs are kept before a part that looks at them may end the run
    "floating",
    "progress",  # a run that is to be interrupted has been recorded so far
)
# What finds accelerations of lines; it takes second rates (N,) m/s2 of the lengths of cells, by number of the line.
Accelerations = Callable[[Mapping[int, Floats]], NetworkTaken]
EVERY_STEP = 1 << 40  # beside the bits of Counts.notices: of every step that Python has a part in


class Sampled(NamedTuple):
    """Outputs of a network: nb states of its lines and bodies."""

    lines: Sequence[Batch]
    bodies: Floats  # (nb, B, BODY_SAMPLE) of kernels.run.network

    @property
    def t(self) -> Floats:
        """Times (nb,), s; an array of one's own."""
        return self.lines[0].t.copy()

    def frame(self, body: int) -> Floats:
        """Axes (nb, 3, 3) of a body, as columns."""
        return self.bodies[:, body, SAMPLE_AXES:SAMPLE_V].reshape(-1, 3, 3)

    def spin(self, body: int) -> Floats:
        """Its angular velocity (nb, 3) 1/s, inertial."""
        return times(self.frame(body), self.bodies[:, body, SAMPLE_W:SAMPLE_LINES])


def times(frames: Floats, x: Floats) -> Floats:
    """Frames (nb, 3, 3) times vectors (nb, 3), or one (3,): the same bits for each, however many there are."""
    return np.asarray(frames[..., 0] * x[..., :1] + frames[..., 1] * x[..., 1:2] + frames[..., 2] * x[..., 2:])


class Part:
    """A capability of a run, by the verbs that its loop has for all of them; here none does anything."""

    name = ""  # its place in ORDER
    older: Mapping[str, Any] = MappingProxyType({})  # what it keeps that files of earlier programs may lack, as it was
    wants = EVERY_STEP  # the bits of a step (kernels.state.books) of which it must hear

    # --- the start, and other solvers -----------------------------------------------------------------

    def begin(self) -> None:
        """Nothing has moved, and forces are known, and accelerations of a motion.

        Of an equilibrium, which is recorded next, only this, `at_output` and `finish` are asked.
        """

    def find_accelerations(self, solve: Accelerations) -> Accelerations:
        """What finds accelerations where they jump: `solve`, and what the part adds."""
        return solve

    def fit_lines(self) -> None:
        """Another solver is to be made: lines, and what touches, become what they are computed as."""

    def use_solver(self, model: NetworkModel, solver: NetworkSolver) -> None:
        """Another solver makes the steps from now on, of lines as the model has them."""

    def attach(self, loop: NetworkSteps) -> None:
        """Compiled steps are to begin, or to ask for what they do (`Counts.asks`)."""

    # --- steps ----------------------------------------------------------------------------------------

    @property
    def stops(self) -> list[float]:
        """Times (s) at which a step ends."""
        return []

    @property
    def due(self) -> float:
        """When steps are to stop next (s), beside `stops`; infinity: nothing is due."""
        return inf

    def begin_leg(self) -> None:
        """Steps are to go to another stop from here.

        Steps of a fixed length that are asked for from outside go on without.
        """

    def judge_try(self, code: int) -> bool:
        """Whether the try is to be made again, with other lines.  LineFailed: no step leads on.

        code: TRYING, before it, TRIED, after it, or FAILED, where no shorter one is left (kernels.state.books).
        """
        return False

    def note_step(self) -> None:
        """After a step with one of the bits that it wants: books alone, nothing changes."""

    def after_step(self) -> None:
        """Likewise, once all parts have noted the step: lines may change.  LineFailed: the run ends here."""

    def at_pause(self, finished: bool) -> None:
        """About ten times a second between two steps, and at stops; finished: nothing is left to do.

        KeyboardInterrupt: the run ends here.  Steps from outside do not ask.
        """

    # --- what is recorded -----------------------------------------------------------------------------

    def log(self, rows: Floats, cpu: Floats) -> None:
        """Steps have been made: rows (n, L, ..) as of kernels.state.books, and processor times (n,) s."""

    def at_output(self, seen: Sampled) -> None:
        """Outputs have been recorded.  LineFailed: the run ends here."""

    def finish(self, status: str) -> None:
        """What is to be said of the whole run, of which this is the status, before its file is closed."""

    # --- checkpoints: parts go on in the opposite order, as each has found lines as those before it left them ----
    # What a file has of a part is checked by the part alone.

    def checkpoint(self) -> dict[str, Any]:
        """What it keeps between two steps, by names in the checkpoint of the run."""
        return {}

    def restore_lines(self, saved: Mapping[str, Any]) -> bool:
        """Lines of the scene become those of a checkpoint; whether a solver has to follow.

        They come loose, touch, and have the cells, planes and lengths of then.  ValueError, here and below: that
        cannot be.
        """
        return False

    def restore(self, saved: Mapping[str, Any]) -> None:
        """Go on as then, with a solver of the lines of then; in the order of steps."""


def _having(parts: Iterable[Part], verb: str) -> tuple[Callable[..., Any], ...]:
    """The verb of those parts that do something there."""
    return tuple(getattr(x, verb) for x in parts if getattr(type(x), verb) is not getattr(Part, verb))


class Parts:
    """The parts of a run in their order; what a part does not do costs nothing."""

    def __init__(self, parts: Iterable[Part]) -> None:
        self._all = parts = sorted(parts, key=lambda x: ORDER.index(x.name))
        self.attach, self.use_solver = _having(parts, "attach"), _having(parts, "use_solver")
        self.find_accelerations, self.fit_lines = _having(parts, "find_accelerations"), _having(parts, "fit_lines")
        self.begin_leg, self.judge_try = _having(parts, "begin_leg"), _having(parts, "judge_try")
        self.log, self.at_output, self.at_pause = (_having(parts, x) for x in ("log", "at_output", "at_pause"))
        self.note_step, self.after_step = (
            [(x.wants, verb) for x in parts for verb in _having([x], name)] for name in ("note_step", "after_step")
        )

    def __iter__(self) -> Iterator[Part]:
        return iter(self._all)

    def __reversed__(self) -> Iterator[Part]:
        return reversed(self._all)

    @property
    def due(self) -> float:
        """When one is to be asked next (s), between two steps."""
        return min((x.due for x in self._all), default=inf)
