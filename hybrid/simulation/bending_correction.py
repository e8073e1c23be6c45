"""What leaving bending out shifts a cable by: follows it along a run, across switches of zones, for the books."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from hybrid.kernels.state.state import Batch, Ends, Floats, State
from hybrid.kernels.watch.bending_error import COMPLIANCE, FREE_TURN, GIVEN, TURN
from hybrid.model.build import Model
from hybrid.model.material import HALF_WRONG, NO_DOUBT, full_bending
from hybrid.model.mesh import Zone
from hybrid.solve.bending_corrector import Corrector, Shift


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

    def __init__(self, model: Model, torque: Callable[[], float] | None = None) -> None:
        """torque: N m, of the whole line as far as its rods do not carry it; None: it follows from the ends' turn."""
        self.model, self.corrector, self._torque = model, corrector_for(model), torque
        self.doubt = np.array(NO_DOUBT)  # of the output where most of it may be wrong
        if torque is None:
            _follow_ends(model, self.corrector.torque)

    def begin(self, ends: Ends, state: State, at_rest: bool, with_friction: bool = False) -> None:
        """At the start of a run: the error of the equilibrium; a motion that starts from a given shape has none.

        with_friction: whether friction took part in the equilibrium.
        """
        self.corrector.sea = self.model.sea.values
        if at_rest:
            self.set_torque()
            self.corrector.rest(self.model.sea.values, ends, state, with_friction)

    def set_torque(self) -> None:
        """Before steps: the torque as it is known now."""
        if self._torque is not None:
            self.corrector.torque[GIVEN] = self._torque()

    def shift(self, sampled: np.ndarray, batch: Batch) -> Shift:
        """What it makes of the outputs of a batch; keeps where a linear estimate knows least of it."""
        found = self.corrector.shift(sampled, batch)
        far = np.sqrt((found.position**2).sum(axis=1)).max(axis=0)
        wrong = np.where(found.share > HALF_WRONG, np.minimum(found.share, 1.0) * far, 0.0)
        k = int(wrong.argmax())
        if wrong[k] > min(self.doubt[2], 1.0) * self.doubt[3]:
            self.doubt[:] = batch.t[k], found.at[k], found.share[k], far[k]
        return found

    def checkpoint(self) -> dict[str, Any]:
        """The error after the last step."""
        c = self.corrector
        return {
            "error": c.error, "slid": c.arrays.slid, "twist": float(c.torque[TURN]), "sampled": c.sampled[0],
            "doubt": self.doubt,
        }  # fmt: skip

    def restore(self, saved: Mapping[str, Any]) -> None:
        """Go on as `checkpoint` has said."""
        c = self.corrector
        c.sea = self.model.sea.values
        c.error[:], c.arrays.slid[:], c.torque[TURN] = saved["error"], saved["slid"], saved["twist"]
        c.sampled[0], self.doubt[:] = saved["sampled"], saved["doubt"]

    def switch(self, model: Model) -> None:
        """The line has changed: the error goes on from where it was."""
        self.model = model
        self.corrector = corrector_for(model).taking_over(self.corrector)

    def unknown(self, zones: Sequence[Zone]) -> tuple[float, float, str]:
        """In which of these zones (s, m, from and to) the error of the last step is not known, and why.

        What the nearest catenary leaves out moves the rods beside it as well: these leave out nothing.
        """
        c = self.corrector
        bent = [z for z in zones if z.kind == "catenary"] or [*zones]
        if not c.finite:
            text = (
                "the linear estimate of what leaving bending out shifts the line by has no finite solution here: it "
                "begins anew from nothing, and has only what is left out from now on; compare with model: rod"
            )
            return bent[0].s_a, bent[-1].s_b, text
        s = float(c.line.s[max(c.furthest, 0)])
        near = min(bent, key=lambda z: max(z.s_a - s, s - z.s_b))
        text = (
            f"leaving bending out of the catenary from s = {near.s_a:.4g} to {near.s_b:.4g} m shifts the line by more "
            f"than {c.most:.3g} m at s = {s:.4g} m, more than a linear estimate can know: it is clipped; make that "
            "catenary a rod"
        )
        return near.s_a, near.s_b, text


def _follow_ends(model: Model, torque: Floats) -> None:
    """Let the torque of a line whose two ends hold its twist follow from the turn of one against the other."""
    cable, line = model.cable, model.line
    of = cable.piece(0.5 * (line.s[:-1] + line.s[1:]))
    stiffness = cable.B[of, 2]
    held = cable.passes_torque and bool((stiffness > 0.0).all())
    if held and not line.spin.all():
        torque[COMPLIANCE] = np.sum(line.h / stiffness)
        torque[FREE_TURN] = line.h @ cable.kappa[of, 2]
