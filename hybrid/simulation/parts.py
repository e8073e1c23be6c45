"""Parts of a run: what its loop asks of each of them, and in which order.

A run owns arrays and compiled steps, and knows what else there is to a run by the verbs of `Part` alone.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager
from math import inf
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from hybrid.kernels.run.network import SAMPLE_AXES, SAMPLE_LINES, SAMPLE_V, SAMPLE_W
from hybrid.kernels.state.state import Batch, Floats, Line
from hybrid.model.nearby import Weakness
from hybrid.model.network import NetworkModel
from hybrid.solve.contact import SelfContact, SharedContact
from hybrid.solve.network_solver import NetworkSolver
from hybrid.solve.network_steps import NetworkSteps
from hybrid.solve.stepper import LineFailed, NetworkTaken
from hybrid.zones.manager import Change

# What is asked of several parts is asked in this order.
ORDER = (
    "loads",  # what acts from some time on is known to all that follows
    "planes",  # a line goes on in space, or in its plane, before anything changes its cells
    "lines",  # what makes going on senseless ends the run before more is changed
    "contact",  # begins and ends on the cells on which lines were seen to be near
    "cuts",  # their text says what touches now
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
    is_of_form = False  # whether what it keeps in a checkpoint has the form of what it would keep now
    older: Mapping[str, Any] = MappingProxyType({})  # what it keeps that files of earlier programs may lack, as it was

    @property
    def changed(self) -> Collection[int]:
        """Numbers of lines whose cells it changes."""
        return ()

    @property
    def remeshes(self) -> bool:
        """Whether nodes of lines come and go."""
        return False

    wants = EVERY_STEP  # the bits of a step (kernels.state.books) of which it must hear

    # --- the start: in this order -------------------------------------------------------------------

    def place(self) -> None:
        """The first state is known, and there is no solver yet."""

    def balance(self) -> None:
        """There is a solver, and no accelerations yet."""

    def begin(self) -> None:
        """Accelerations are consistent, and nothing has moved."""

    # --- another solver, and what steps are attached to -----------------------------------------------

    def fit_lines(self) -> None:
        """Another solver is to be made: lines become what they are computed as."""

    def use_solver(self, model: NetworkModel, solver: NetworkSolver) -> None:
        """Another solver makes the steps from now on, of lines as the model has them."""

    def attach(self, loop: NetworkSteps) -> None:
        """Compiled steps are to begin, or to ask for what they do (`Counts.asks`)."""

    def sync(self) -> None:
        """Compiled steps have come back: Python knows what they have changed."""

    def attached_to(self) -> Iterable[object]:
        """Arrays of its own that compiled steps are attached to: while they are the same, steps go on."""
        return ()

    def touching(self, remeshes: bool) -> tuple[list[SelfContact | None], SharedContact | None] | None:
        """What touches in the solver to be made: each line itself, and all; remeshes: cells may have changed."""
        return None

    # --- what other parts ask of all of them ------------------------------------------------------------

    def change_line(self, number: int, change: Callable[[Line], Line]) -> None:
        """A line of the run, by number, is changed so on the same cells."""

    def adopt_cells(self, number: int, line: Line) -> None:
        """Compiled steps have given a line other cells."""

    def switch_zones(self, number: int, change: Change, here: NDArray[np.bool_] | None) -> None:
        """Zones of a line change so before a node leaves, or enters, at its winch; here: where nodes are to be."""

    def let_go(self, ends: Iterable[tuple[int, int]]) -> None:
        """Ends (line, 0 or 1) are to come loose now."""

    def release(self, ends: Iterable[tuple[int, int]]) -> None:
        """They have come loose in the models of the run."""

    def break_now(self, weakness: Weakness, why: str) -> None:
        """A program outside lets ends go; why: for the event.  LineFailed."""

    def change_loads(self) -> None:
        """Other loads act from now on in the models of the run."""

    def fit_models(self, model: NetworkModel) -> NetworkModel:
        """A model on cells of t = 0, with the cells of now."""
        return model

    def contact_before(self) -> Floats | None:
        """Energy (L,) J of contact of each line before the last try; None: it does not know."""
        return None

    def note_forces(self) -> None:
        """Forces have been found anew of the state of now."""

    # --- steps ----------------------------------------------------------------------------------------

    def begin_leg(self) -> None:
        """Steps of a length that follows the motion go to another stop."""

    def prepare(self, end: float) -> None:
        """Before a try that ends at `end` (s), where steps ask."""

    def wants_retry(self) -> bool:
        """After a try, where steps ask: whether it is to be made again, with other lines."""
        return False

    def gives_up(self, dt: float) -> bool:
        """No step of dt (s) leads on: whether one may now, as something is given up."""
        return False

    def explains(self, taken: NetworkTaken, dt: float) -> LineFailed | None:
        """Why no step of dt (s) leads on; dt 0: why there are no accelerations."""
        return None

    def note_step(self) -> None:
        """After a step with one of the bits that it wants: books alone, nothing changes."""

    def after_step(self) -> None:
        """Likewise, once all parts have noted the step: lines may change.  LineFailed: the run ends here."""

    def forces_on(self) -> AbstractContextManager[Mapping[int, Floats]]:
        """While accelerations are found: second rates (N,) m/s2 of the lengths of cells, by line."""
        raise NotImplementedError

    def accelerate_rotors(self, solve: Callable[[], None]) -> None:
        """Accelerations jump: give rotors theirs, before those of lines are solved for.

        solve: solves for accelerations and forces of lines, with rotors as they are; LineFailed where it cannot.
        """

    @property
    def breaks(self) -> list[float]:
        """Times (s) at which a step ends, and what holds lines may change."""
        return []

    @property
    def begins(self) -> list[float]:
        """Times (s) at which a step ends whose length follows the motion."""
        return []

    @property
    def phases(self) -> Sequence[float]:
        """Times (s) still to come from which on other loads and motions hold, and so other stops."""
        return ()

    def begin_phase(self, t: float) -> None:
        """The run has come to one of these times."""

    @property
    def due(self) -> float:
        """When it is to be asked next (s), between two steps."""
        return inf

    def at_due(self) -> None:
        """That time has come."""

    def at_stop(self) -> None:
        """Steps have come to a stop, or are to begin."""

    def at_pause(self, finished: bool) -> None:
        """About ten times a second between two steps, and at stops; finished: nothing is left to do.

        KeyboardInterrupt: the run ends here.  Steps from outside do not ask.
        """

    # --- what is recorded -----------------------------------------------------------------------------

    def at_rest(self) -> None:
        """An equilibrium is to be recorded, whose forces are known: no other verb but `finish` is asked then."""

    def gather(self) -> None:
        """Events are about to be written, in the order in which they happened."""

    def log(self, rows: Floats, cpu: Floats) -> None:
        """Steps have been made: rows (n, L, ..) as of kernels.state.books, and processor times (n,) s."""

    def at_output(self, seen: Sampled) -> None:
        """Outputs have been recorded.  LineFailed: the run ends here."""

    def finish(self, status: str) -> None:
        """What is to be said of the whole run, of which this is the status, before its file is closed."""

    # --- checkpoints: parts go on in the opposite order, as each has found lines as those before it left them ----

    def checkpoint(self) -> dict[str, Any]:
        """What it keeps between two steps, by names in the checkpoint of the run."""
        return {}

    def of_today(self, saved: Mapping[str, Any]) -> dict[str, Any]:
        """Of a checkpoint, what it keeps, with what files of earlier programs do not have."""
        return {name: saved.get(name, x) for name, x in self.older.items()}

    def restore_joints(self, saved: Mapping[str, Any]) -> bool:
        """Lines of the scene come loose, or touch, as in a checkpoint; whether a solver has to follow.

        ValueError, here and below: that cannot be.
        """
        return False

    def restore_cells(self, saved: Mapping[str, Any]) -> bool:
        """Likewise the cells, planes and lengths of lines that are joined as then."""
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
        self.attach, self.sync, self.use_solver = (_having(parts, x) for x in ("attach", "sync", "use_solver"))
        self.prepare, self.begin_leg = _having(parts, "prepare"), _having(parts, "begin_leg")
        self.forces_on, self.log = _having(parts, "forces_on"), _having(parts, "log")
        self.accelerate_rotors = _having(parts, "accelerate_rotors")
        self.at_output, self.at_stop = _having(parts, "at_output"), _having(parts, "at_stop")
        self.note_step, self.after_step = (
            [(x.wants, verb) for x in parts for verb in _having([x], name)] for name in ("note_step", "after_step")
        )
        self.attached_to, self.gather = _having(parts, "attached_to"), _having(parts, "gather")
        self.note_forces, self.at_pause = _having(parts, "note_forces"), _having(parts, "at_pause")
        self.begins = sorted({t for x in parts for t in x.begins})  # s

    def __iter__(self) -> Iterator[Part]:
        return iter(self._all)

    def __reversed__(self) -> Iterator[Part]:
        return reversed(self._all)

    @property
    def due(self) -> float:
        """When one is to be asked next (s), between two steps."""
        return min((x.due for x in self._all), default=inf)
