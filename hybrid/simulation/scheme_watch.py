"""What the time scheme does to a motion: energy it creates or loses, periods that are off, unstable rest."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from hybrid.errors import Outcome
from hybrid.kernels.laws.bending_slip import EACH, STIFFENING
from hybrid.kernels.state import books as b
from hybrid.kernels.state.books import Books
from hybrid.kernels.state.report import SOIL
from hybrid.kernels.state.state import Batch, Floats, ends_in, state_in
from hybrid.model.build import Model
from hybrid.outputs.joined_lines import Output
from hybrid.simulation.events import EventLog
from hybrid.solve.stability import is_stable

# Energy that the scheme creates, as a part of what work, fall and start have put in: beyond the first it is
# noted (a healthy run stays below 1 %), at the second the motion is the scheme's own and the run stops.
GAIN_NOTED = 0.05
GAIN_STOPS = 1.0
# The first moments of a run, in which next to nothing has been put in: less than this part of all that is put in by its
# end.  What was created then is held against this part, as hardly anything is a part of nothing.
FIRST_MOMENTS = 0.1
# Energy below this part of tension scale times length is what Newton's tolerance leaves over many steps.
NEWTON_LEAVES = 1e-7
# Numerical dissipation, as a part of the same energy: beyond this the step was too long for the motion.
LOSS_NOTED = 0.5
# A rod is pressed when it carries more than this part of EI/L^2: a quarter of pi^2 is the least that any rod buckles
# under, and what Newton leaves of no tension at all is far below.
PRESSED = 1e-3
# A line whose kinetic energy is below this part of its elastic energy is at rest for the test of stability.
AT_REST = 1e-4
# More bending than this part of the elastic energy is no symmetry that something could break.
BENT = 1e-3
# Inertia above this part of the load is a motion that has begun.
LET_GO = 0.01
# What an oscillation is wrong by after one period, as a part of it, beyond which a step is said to be too long
# (docs/theory.md, 8): 8 steps a period with rho_inf = 1, 14 with 0.5, 24 with 0.
COARSE = 0.35
# Of the length, and of the largest tension: what Newton's tolerance changes them by is no motion.
HARDLY_MOVED = 1e-7
# What a checkpoint holds of it as plain values.
REMEMBERED = ("_gain", "_loss", "_put_in", "_potential", "_alive", "_created", "_rested")
NONE_CREATED = (0.0, 0.0, 0.0, 0.0)

Stop = tuple[Outcome, int] | None


class SchemeWatch:
    """What the time scheme does to the motion of one line."""

    def __init__(self, model: Model, events: EventLog) -> None:
        self._events, self._gain, self._loss = events, GAIN_NOTED, LOSS_NOTED
        self._stiffens = bool(model.line.slip_law.size and model.line.slip_law[:, STIFFENING::EACH].any())
        self._put_in = self._potential = self._alive = 0.0  # J
        self._rested = False
        # most energy beyond what may be (J), put in till then (J), t (s), s (m)
        self._created = [*NONE_CREATED]

    @property
    def rested(self) -> bool:
        """Whether a shape at rest that is not stable has been noted."""
        return self._rested

    def judge(self, model: Model, batch: Batch, values: Mapping[str, Floats], lines: Sequence[Output] = ()) -> Stop:
        """Hold what the time scheme creates or dissipates at outputs (nb,) against all that was put in.

        What touches the bed and obstacles in steps that are too long bounces higher than it fell.  That counts as
        created where contact has given more than it has taken: damping takes, and only soil gives back what it had.
        So does what a stiffness that grows with tension has given: it has no potential.
        lines: what each output is of, where they differ.
        """
        scheme, potential = values["work/scheme"], values["energy/potential"]
        given = values.get("work/contact", 0.0 * scheme)  # by contact
        bounced = np.maximum(given, 0.0) if not model.line.bits & SOIL else 0.0
        grown = np.maximum(values["work/hysteresis"], 0.0) if self._stiffens else 0.0
        gained = scheme + bounced + grown
        alive = sum((values[x] for x in values if x.startswith("energy/")), -potential)
        if batch.t[0] == 0.0:
            self._potential, self._alive = float(potential[0]), float(alive[0])
        put_in = np.abs(batch.work).sum(axis=1) - bounced - grown + np.abs(potential - self._potential) + self._alive
        put_in = np.maximum.accumulate(np.append(self._put_in, put_in))[1:]
        self._put_in = float(put_in[-1])
        floor = NEWTON_LEAVES * model.tension_scale * model.length
        # all that can be worth a word; most batches have none
        noted = (gained > self._gain * put_in + floor) | (-scheme > self._loss * put_in + floor)
        for k in np.flatnonzero(noted & (batch.t > 0.0)).tolist():
            line, v = (lines[k].line, lines[k].batch.v[0]) if lines else (model.line, batch.v[k])
            fastest = int(np.argmax(np.abs(v).sum(axis=1)))
            s = float(line.s[fastest])
            if gained[k] > GAIN_STOPS * put_in[k] + floor:
                return Outcome.GAINS_ENERGY, fastest
            if gained[k] > max(self._gain * put_in[k] + floor, self._created[0]):
                self._created = [float(gained[k]), float(put_in[k]), float(batch.t[k]), s]
            if -scheme[k] > self._loss * put_in[k] + floor:
                text = f"the time scheme has dissipated {-scheme[k]:.3g} J, {_percent(-scheme[k], put_in[k])} of the"
                text += " energy put in: motion is faster than the step; make time.step smaller"
                self._events.event(float(batch.t[k]), s, s, "numerical dissipation", text)
                self._loss *= 1.3
        return None

    def finish(self) -> None:
        """Note the most energy that the scheme has created, where it is much of what was put in, at the end of a run.

        What was put in till then counts as FIRST_MOMENTS of all at least.
        """
        gained, put_in, t, s = self._created
        put_in = max(put_in, FIRST_MOMENTS * self._put_in)
        if gained > 0.0 and gained > self._gain * put_in:
            part = _percent(gained, put_in)
            what = "with stiffness by tension and contact" if self._stiffens else "with contact"
            text = f"the time scheme, {what}, has created {gained:.3g} J, {part} of the energy put in"
            self._events.event(t, s, s, "gains energy", f"{text}: {Outcome.GAINS_ENERGY.remedy}")

    def note_coarse_steps(self, length: float, books: Books) -> None:
        """Note after the last step that steps were too long for the motion of a line of that length (m).

        Of a x cos(w t) a step changes the acceleration by a w^3 dt; periods are too long by (beta - 1/6) (w dt)^2, with
        beta = 1/(1 + rho)^2 of generalized-alpha.
        """
        clock = books.clock
        low, high, moved = float(clock.least_peak), float(clock.largest_peak), float(clock.moved)
        steps, rho, worst = int(books.counts.measured), float(books.clock.rho), books.worst.tolist()
        hardly = moved <= HARDLY_MOVED * length and not high - low > HARDLY_MOVED * high
        if hardly or not steps or not moved > 0.0:
            return
        once, several = worst[0], worst[min(steps, b.WORST) - 1]
        left, t, dt, s = once if once[0] > moved or steps <= b.WORST**2 else several
        turn = (left / moved) ** (1.0 / 3.0)  # w dt
        wrong = 2.0 * np.pi * (1.0 / (1.0 + rho) ** 2 - 1.0 / 6.0) * turn * turn
        if wrong > COARSE:
            text = (
                f"about {2.0 * np.pi / turn:.2g} steps to a period here, where the line moves by {moved:.2g} m: "
                f"an oscillation is off by some {100 * min(wrong, 1.0):.0f} % after a period; "
                f"a time.step of {dt * np.sqrt(0.1 * COARSE / wrong):.1g} s would do"
            )
            self._events.event(t, s, s, "coarse step", text)

    def judge_rest(self, model: Model, batch: Batch, values: Mapping[str, Floats]) -> None:
        """Note a rod at rest, or nearly, whose shape is not stable: some displacement meets a negative stiffness."""
        line = model.line
        rod = line.spin == 1
        if self._rested or not rod.any():
            return
        elastic = sum(values[f"energy/{x}"] for x in ("stretch", "bending", "torsion"))
        kb = (batch.kb if batch.kb.size else line.kb[None])[:, line.element == 1, :2]
        bending = (kb * line.hn[line.element == 1, None]).min(axis=(1, 2), initial=np.inf)
        least = np.where(np.isfinite(bending), PRESSED * bending / model.length, 0.0)  # J
        twisted, lowest_ = values["energy/torsion"] > least, batch.T[:, rod].min(axis=1)
        pressed = (lowest_ * model.length < -least) | twisted
        calm = (values["energy/kinetic"] <= AT_REST * elastic) | ~batch.v.any(axis=(1, 2))
        # what is let go has no velocity yet, but is no longer at rest
        calm &= twisted | (float(line.mass.sum()) * np.abs(batch.vd).max(axis=(1, 2)) <= LET_GO * -lowest_)
        # a line that is bent and whose ends move follows them, and snaps where it must; contact is not judged
        moves = np.abs(batch.v[:, [0, -1]]).max(axis=(1, 2)) > 0.0
        calm &= ~(moves & (values["energy/bending"] > BENT * elastic))
        if "energy/self_contact" in values:
            calm &= values["energy/self_contact"] == 0.0
        for k in np.flatnonzero(pressed & calm):
            ends, state = ends_in(batch, int(k)), state_in(batch, int(k), line)
            if not is_stable(line, model.sea.values, ends, state, model.length, model.tension_scale):
                text = "the rod rests where it would buckle: only its perfect symmetry keeps it there"
                text += "; give it a small bow"
                # a bent one may be on its way, and has no symmetry that is known
                if values["energy/bending"][int(k)] > least[min(int(k), least.size - 1)]:
                    text = "the rod is almost at rest in a shape that is not stable (its stiffness against some "
                    text += "displacement is negative): it is leaving it, or nothing in the scene disturbs it there"
                s = float(line.s[np.argmin(state.T)])
                self._events.event(float(batch.t[k]), s, s, "unstable", text)
                self._rested = True
                return


def _percent(part: float, whole: float) -> str:
    """A part of an energy in words."""
    return f"{100.0 * part / (whole or 1.0):.0f} %"
