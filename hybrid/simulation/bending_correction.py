"""What leaving bending out shifts a cable by: follows it along a run, across switches of zones, for the books."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, Protocol

import numpy as np

from hybrid.kernels.state import Batch, Ends, State
from hybrid.kernels.zone_criteria import end_turn
from hybrid.model.bending_reference import full_bending
from hybrid.model.build import Model
from hybrid.solve.bending_corrector import Corrector, Sample, Shift
from hybrid.solve.stepper import Stepper


class Twisted(Protocol):
    """Who knows the torque, N m, of the whole line as far as its rods do not carry it."""

    def torque(self, ends: Ends, state: State) -> float: ...


def corrector_for(model: Model) -> Corrector:
    """What follows the error of a model's line; its lengths must be the true ones."""
    line = model.line
    ki, floor = full_bending(model.cable, line.s, np.diff(line.s), model.tension_scale)
    held = np.array(model.cable.held_tangent)
    kinks = np.zeros(line.s.size, np.int8)
    kinks[[0, -1]] = held
    for s in model.attached:
        kinks[int(np.abs(line.s - s).argmin())] = 1
    return Corrector(line, ki, floor, held, model.length, model.tension_scale, kinks)


class Correction:
    """The error of one run: what is left out now, where it was clipped, and what it makes of every output."""

    def __init__(self, model: Model, twisted: Twisted | None = None) -> None:
        """twisted: what watches the twist of the line, where something else does; None: watched here."""
        self.model, self.corrector = model, corrector_for(model)
        self._twisted = twisted or _TurnOfEnds(model)
        self._samples: list[Sample] = []

    def begin(self, ends: Ends, state: State, at_rest: bool, with_friction: bool = False) -> None:
        """At the start of a run: the error of the equilibrium; a motion that starts from a given shape has none.

        with_friction: whether friction took part in the equilibrium.
        """
        self.corrector.sea = self.model.sea.values
        if at_rest:
            self.corrector.rest(self.model.sea.values, ends, state, self._twisted.torque(ends, state), with_friction)

    def step(self, stepper: Stepper, ends: Ends, state: State, dt: float, before: float, rho: float) -> None:
        """After the step of dt, after one of `before`, that led to `state`, before anything else uses the stepper."""
        self.corrector.step(
            stepper, self.model.sea.values, ends, state, dt, before, rho, self._twisted.torque(ends, state)
        )

    def checkpoint(self) -> dict[str, Any]:
        """The error after the last step."""
        watched = self._twisted if isinstance(self._twisted, _TurnOfEnds) else None
        return {"error": self.corrector.error, "slid": self.corrector.slid, "twist": watched.twist if watched else 0.0}

    def restore(self, saved: Mapping[str, Any]) -> None:
        """Go on as `checkpoint` has said."""
        self.corrector.sea = self.model.sea.values
        self.corrector.error[:], self.corrector.slid[:] = saved["error"], saved["slid"]
        if isinstance(self._twisted, _TurnOfEnds):
            self._twisted.twist = saved["twist"]

    def switch(self, model: Model) -> None:
        """Zones have changed: the error goes on from where it was."""
        self.model = model
        self.corrector = corrector_for(model).taking_over(self.corrector)
        self.corrector.sea = model.sea.values

    @property
    def beyond(self) -> str:
        """What to say where the error is too large for an estimate; empty where it is not."""
        c = self.corrector
        if not c.finite:
            return "the error of leaving bending out could not be estimated here: it begins anew from nothing"
        if c.clipped:
            return (
                f"leaving bending out shifts the cable by more than {c.most:.3g} m here, more than a linear estimate "
                "can know: it is clipped; make this stretch a rod"
            )
        return ""

    def sample(self, part: float = 1.0) -> None:
        """Keep the error at an output that lies the `part` of the last step after its begin."""
        self._samples.append(self.corrector.sample(part))

    @property
    def kept(self) -> int:
        """Number of outputs whose error is kept."""
        return len(self._samples)

    def shift(self, batch: Batch) -> Shift:
        """The errors that are kept, of the outputs of a batch; they are let go."""
        samples, self._samples = self._samples[: batch.t.size], self._samples[batch.t.size :]
        return self.corrector.shift(samples, batch)


class _TurnOfEnds:
    """Torque of a line whose two ends hold its twist, from the turn of one against the other, counted on."""

    def __init__(self, model: Model) -> None:
        cable, line = model.cable, model.line
        of = cable.piece(0.5 * (line.s[:-1] + line.s[1:]))
        stiffness = cable.B[of, 2]
        self.held = all(cable.held_twist) and all(cable.held_tangent) and bool((stiffness > 0.0).all())
        self.compliance = float(np.sum(line.h / stiffness)) if self.held else math.inf
        self.free = float(line.h @ cable.kappa[of, 2])
        self.line, self.all_rod, self.twist = line, bool(line.spin.all()), 0.0

    def torque(self, ends: Ends, state: State) -> float:
        if not self.held or self.all_rod:
            return 0.0
        turn = end_turn(state.e, ends.frame)
        self.twist += (turn - self.twist + math.pi) % (2.0 * math.pi) - math.pi
        return (self.twist - self.free) / self.compliance
