"""Steps of a run that are cut, that have become very short, or of which none leads on: what is told, and why."""

from __future__ import annotations

from hybrid.errors import Outcome
from hybrid.kernels.state import books as b
from hybrid.kernels.step.accept import MANY
from hybrid.simulation.events import (
    COLLAPSE,
    CUTS,
    GIVE_UP,
    TOUCH_EACH_OTHER,
    TOUCHES_ITSELF,
    collapse_text,
    count_iterations,
    energy_gains_text,
    note_cut,
    note_iterations,
    note_slack,
)
from hybrid.simulation.failure import Stopped, explanation, first_remedy, touch_text
from hybrid.simulation.parts import Part
from hybrid.simulation.run_of_lines import RunOfLines
from hybrid.solve.joined import LineFailed, NetworkTaken
from hybrid.solve.network_solver import NetworkSolver
from hybrid.solve.run import Tried


class Cuts(Part):
    """Steps that are cut, and those after which there is no other."""

    name, wants = "cuts", b.COLLAPSES | b.STEPS_CUT | b.STEPS_SLACK | b.ITERATIONS_CUT

    def __init__(self, run: RunOfLines, compared: bool) -> None:
        """compared: whether the run is only to be compared with."""
        self._run, self._compared = run, compared

    def after_step(self) -> None:
        """Events of steps that were cut."""
        run = self._run
        loop, clock, flags = run.loop, run.loop.clock, int(run.loop.counts.notices)
        if flags & b.COLLAPSES:
            self._note_collapse()
        if flags & b.STEPS_CUT:
            turned = run.lines[loop.turned_line]
            note_cut(clock, float(clock.most_turn), turned.model.length, turned.events, loop.controlled)
        if flags & b.STEPS_SLACK:
            slack = run.lines[loop.slack_line]
            s = float(slack.model.line.s[int(loop.counts.slack_cell)])
            note_slack(clock, float(slack.books.clock.wave_step), s, slack.events)
        if flags & b.ITERATIONS_CUT:
            note_iterations(clock, loop.counts, run.span[1], run.noted)

    def finish(self, status: str) -> None:
        """How many steps were taken before they had converged, and how many tries contact cost."""
        run, shared = self._run, self._run.contact.shared
        if status == "complete":
            count_iterations(run.loop.clock, run.loop.counts, run.span[1], run.noted)
        if shared is not None and (tries := shared.given_up):
            run.note("steps cut", energy_gains_text(tries))

    @property
    def _touching(self) -> str:
        """What touches now, a line itself or another one, for the text of a failure; empty: nothing."""
        shared = self._run.contact.shared
        pairs = shared.points_between() if shared is not None else []
        if any(a != c for (a, _), (c, _) in pairs):
            return TOUCH_EACH_OTHER
        own = (line.contact for line in self._run.lines)
        return TOUCHES_ITSELF if pairs or any(x is not None and x.touches for x in own) else ""

    def _note_collapse(self) -> None:
        """Steps have become so short that the run may not end: an event; one to be compared with stops."""
        run = self._run
        count, clock = run.loop.counts, run.loop.clock
        number, where = run.loop.last_cut
        line = run.lines[max(number, 0)]
        s = float(line.model.line.s[min(max(where, 0), line.model.line.s.size - 1)]) if number >= 0 else 0.0
        cuts, tiny = {cause: int(getattr(count, name)) for cause, name in CUTS.items()}, int(count.tiny_steps)
        text = collapse_text(tiny, run.last_step, float(clock.longest), cuts, s, self._touching)
        if tiny == MANY:
            line.events.event(run.t, s, s, COLLAPSE, text, value=run.last_step)
        if self._compared and tiny >= GIVE_UP:
            raise LineFailed(line.number, Outcome.COLLAPSED, run.t, s, text)

    def stopped(self, solver: NetworkSolver, taken: NetworkTaken, dt: float) -> LineFailed:
        """Why no step of dt (s) leads on; 0: why there are no accelerations."""
        run = self._run
        if taken.line < 0:
            detail = f"smallest step tried {dt:.3g} s; {taken.iterations} Newton iterations in the last try"
            if dt == 0.0:
                detail = "no accelerations are consistent with the shape and the loads"
            return LineFailed(-1, taken.outcome, run.t, None, detail + self._touching)
        k, tried = taken.line, Tried(taken.outcome, taken.iterations, taken.correction, taken.where)
        line, model, now = run.lines[k], run.model.models[k], run.state.lines[k]
        x = Stopped(
            model, now, run.other.lines[k] if dt else now, run.loop.clock, run.loop.counts, tried, dt,
            float(line.books.clock.wave_step), line.manager is not None, max(solver.joints[k]) < 0,
            touch_text(line.contact, model) or self._touching,
        )  # fmt: skip
        s = float(model.line.s[x.node])
        return LineFailed(k, taken.outcome, run.t, s, explanation(x), first=first_remedy(x))
