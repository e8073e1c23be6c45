"""Steps of a run that parts of it change or end: where lines vibrate, break, or steps do not lead on.

Steps show a vibration along the line while it lasts, and are longer once it has died out (docs/errors.md).  Drag and
slack may set it off again in every period of the motion: it has died out where a whole period shows little.

Lines break in mid-motion.  Nothing is stored between a line that turns freely and its point, so no energy goes with it;
what bends between the end of a line and its clamp goes with the clamp, and the twist of catenary zones with the torque
that passed through.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Any

import numpy as np

from hybrid.errors import Outcome
from hybrid.kernels.junctions.bodies import DONE, SPRING, W
from hybrid.kernels.march.energies import Observed, observe
from hybrid.kernels.march.zone_torque import TURN, torsion_energy
from hybrid.kernels.run.network_run import CUT_LINE, SLACK_LINE, TURNED_LINE
from hybrid.kernels.state import books as b
from hybrid.kernels.state.books import Clock
from hybrid.kernels.state.report import FORCE_A
from hybrid.kernels.state.state import NO_TURN, Floats, State, Work
from hybrid.kernels.step.accept import MANY, TINY
from hybrid.model.build import Model
from hybrid.model.nearby import Weakness, after_failure, weaknesses
from hybrid.model.resolution import Resolution, start_vibrations
from hybrid.scene.motion_checks import stationary_from
from hybrid.scene.schema import LineScene
from hybrid.simulation.events import energy_gains_text, slack_remedy
from hybrid.simulation.parts import Accelerations, Part
from hybrid.simulation.run_contact import RunContact
from hybrid.simulation.run_line import FORCE_COLUMNS, RunLine
from hybrid.simulation.run_of_lines import RunOfLines
from hybrid.solve.network_steps import NetworkSteps
from hybrid.solve.stepper import LineFailed, NetworkState, NetworkTaken
from hybrid.store.integrity import matched

# --- vibrations along a line -------------------------------------------------------------------

SEEN = 2.0  # periods of the vibration over which its amplitude is found, and from one look at it to the next
DEGREE = 3  # of the polynomial that stands for what else a force does in this time
FEWEST = 12  # steps; of fewer nothing is known
# It counts as gone below this part of what would be shown at its begin: the errors of what is damped do not show.
GONE = 0.5


class VibrationSteps:
    """Of one run whose steps follow the motion: when a vibration begins steps are short, until it has died out."""

    def __init__(self, scene: LineScene, resolution: Resolution) -> None:
        regular = stationary_from(scene) if resolution.later > resolution.step else None
        shown = [x for x in start_vibrations(scene) if x.force > resolution.still] if regular is not None else []
        self.begins = sorted({x.t for x in shown})  # s
        self.look = np.inf  # s, when to look whether it lasts; infinity: none is there
        self._recurs = (0.0, 0.0) if regular is None else regular  # s: from when on, and after how long, all does
        self._period = shown[0].period if shown else np.inf  # s
        self._still, self._short, self._long = resolution.still, resolution.step, resolution.later
        self._rows = np.zeros((0, 3))  # of steps since the last look: s; N, at start and end
        self._counts_from = 0.0  # s, from when on little has been seen

    def begin(self, now: float) -> None:
        """Steps are short from now (s) on if a vibration begins here."""
        if any(abs(now - t) <= 1e-9 * self._period for t in self.begins):
            self.look, self._rows = now + SEEN * self._period, self._rows[:0]
            self._counts_from = max(now, self._recurs[0])

    def log(self, rows: Floats) -> None:
        """Remember the forces (n, 3) at the ends in steps: s; N, at start and end."""
        if self.look < np.inf:
            self._rows = np.vstack([self._rows, rows])

    def judge(self) -> None:
        """At `look`: longer steps, if a whole period of the motion has shown little of the vibration."""
        if not self.amplitude() <= GONE * self._still:
            self._counts_from = max(self.look, self._recurs[0])
        gone = self.look - self._counts_from >= max(self._recurs[1], SEEN * self._period)
        self.look, self._rows = np.inf if gone else self.look + SEEN * self._period, self._rows[:0]

    def amplitude(self) -> float:
        """Of the larger vibration of the forces at both ends, N, since the last look; infinity: not known."""
        if len(self._rows) < FEWEST:
            return np.inf
        t = (self._rows[:, 0] - self.look) / self._period
        phase = 2.0 * np.pi * t
        smooth = np.polynomial.legendre.legvander(1.0 + 2.0 * t / SEEN, DEGREE)
        fit = np.column_stack([smooth, np.cos(phase), np.sin(phase)])
        found = np.linalg.lstsq(fit, self._rows[:, 1:], rcond=None)[0]
        return float(np.hypot(found[-2], found[-1]).max())

    @property
    def largest(self) -> float:
        """Longest step (s) from here on; infinity: no vibration is shown."""
        if not self.begins:
            return np.inf
        return self._short if self.look < np.inf else self._long

    def checkpoint(self) -> dict[str, Any]:
        """What later steps depend on; look: -1 for none."""
        look = self.look if self.look < np.inf else -1.0
        return {"look": float(look), "from": float(self._counts_from), "rows": self._rows}

    def restore(self, saved: Mapping[str, Any] | None, now: float) -> None:
        """Continue as `checkpoint` has said; None: of a file from before, a vibration may last from now (s) on.

        ValueError: that cannot be.
        """
        if not self.begins:
            return
        span = SEEN * self._period
        if saved is None:
            self._counts_from = max(now, self._recurs[0])
            self.look = now + span if now > self.begins[0] else np.inf
        else:
            found = matched(dict(saved), {"look": 0.0, "from": 0.0, "rows": np.zeros((0, 3))}, "vibration")
            self.look = found["look"] if found["look"] >= 0.0 else np.inf
            self._rows, self._counts_from = found["rows"], found["from"]
            due = self.look == np.inf or now - 1e-9 * span <= self.look <= now + (1.0 + 1e-9) * span
            if not due or self._rows.ndim != 2 or self._rows.shape[1] != 3:
                raise ValueError("a vibration that no run shows")


class VibrationsOfLines(Part):
    """The same of several lines, by name, whose steps are those of the line that asks for the shortest."""

    name, older = "vibrations", MappingProxyType({"vibrations": {}})

    def __init__(self, lines: Mapping[str, VibrationSteps], clock: Clock) -> None:
        """clock: of the run."""
        self._lines, self._clock = lines, clock

    @property
    def stops(self) -> list[float]:
        """When vibrations begin, s."""
        return sorted({t for x in self._lines.values() for t in x.begins})

    @property
    def due(self) -> float:
        """When to look next (s) whether one lasts; infinity: none is there."""
        return min((x.look for x in self._lines.values()), default=np.inf)

    def begin_leg(self) -> None:
        """Steps are short from here on if a vibration begins here, and long again where little of it shows."""
        now = float(self._clock.now)
        for x in self._lines.values():
            if x.look <= now:
                x.judge()
            x.begin(now)
        self._bound()

    def log(self, rows: Floats, cpu: Floats) -> None:
        """Remember the forces at the ends of lines in steps, as of `VibrationSteps`."""
        for k, x in enumerate(self._lines.values()):
            x.log(rows[:, k, FORCE_COLUMNS])

    def _bound(self) -> None:
        if self.stops:
            self._clock.largest = min(x.largest for x in self._lines.values())
            self._clock.next_dt = min(self._clock.next_dt, self._clock.largest)

    def checkpoint(self) -> dict[str, Any]:
        """What later steps depend on, by line."""
        return {"vibrations": {name: x.checkpoint() for name, x in self._lines.items() if x.begins}}

    def restore(self, saved: Mapping[str, Any]) -> None:
        """Continue as `checkpoint` has said, as of `VibrationSteps`."""
        for name, x in self._lines.items():
            x.restore(saved["vibrations"].get(name), float(self._clock.now))
        self._bound()


# --- lines that break, and steps that are cut --------------------------------------------------

SAME_TIME = 1e-6  # of a step: a time so near is now


class Failures(Part):
    """What may break in a run, and what has."""

    name, older = "failures", MappingProxyType({"broken": []})  # a force may be too large after any step

    def __init__(self, run: RunOfLines) -> None:
        self._run = run
        self.all = weaknesses(run.network)
        self.broken: list[int] = []  # numbers in `all`, in the order in which they broke

    @property
    def stops(self) -> list[float]:
        """Times (s) at which something breaks by itself."""
        return [x.time for k, x in enumerate(self.all) if np.isfinite(x.time) and k not in self.broken]

    def attach(self, loop: NetworkSteps) -> None:
        """Steps ask where something may break."""
        if self.all:
            loop.counts.asks |= b.ASK_STEPS

    def after_step(self) -> None:
        """Break what is to break now; the run goes on from there."""
        found, near = False, SAME_TIME * self._run.resolution.one.step
        work = self._run.solver.work  # of the step: what breaks gets another solver, which has no forces yet
        for k, x in enumerate(self.all):
            if k in self.broken:
                continue
            if x.time <= self._run.t + near:
                self._break(k, f"at t = {self._run.t:.6g} s (break_at.time)")
                found = True
            elif np.isfinite(x.tension) and (force := self._force(x, work)) > x.tension:
                limit = f"above break_at.tension, {x.tension:g} N"
                why = f"after the first step in which its force, {force:.6g} N, is {limit}"
                self._break(k, why)
                found = True
        if found:
            self._renew()

    def break_now(self, weakness: Weakness, why: str) -> None:
        """Break now what a program outside lets go."""
        self._run.record_samples()  # of ends as they were until now
        self.all = (*self.all, weakness)
        self._break(len(self.all) - 1, why)
        self._renew()

    def _renew(self) -> None:
        """Accelerations jump, and there is room for the next state."""
        self._run.restart_steps()
        self._run.renew_other()

    def _force(self, x: Weakness, work: Sequence[Work]) -> float:
        """Force of the ends that are left on their point, N."""
        ends = [at for at in x.ends if at not in self._run.model.loose]
        reports = [(work[line].report, FORCE_A + 3 * k) for line, k in ends]
        return float(np.linalg.norm(sum((r[f : f + 3] for r, f in reports), np.zeros(3))))

    def checkpoint(self) -> dict[str, Any]:
        """What broke."""
        return {"broken": [*self.broken]}

    def restore_lines(self, saved: Mapping[str, Any]) -> bool:
        """Be as after what broke in an earlier part of the run.  ValueError: nothing of the kind may break."""
        broken = saved["broken"]
        if not isinstance(broken, list) or len(set(broken)) < len(broken):
            raise ValueError("broken: numbers of what has broken were expected")
        if not all(isinstance(k, int) and 0 <= k < len(self.all) for k in broken):
            raise ValueError("broken: numbers of what may break were expected")
        for k in (k for k in broken if k not in self.broken):
            self._part(k)
        return False  # each has been given a solver

    def restore(self, saved: Mapping[str, Any]) -> None:
        """That alone is broken."""
        self.broken = [*saved["broken"]]

    def _break(self, k: int, why: str) -> None:
        run, x = self._run, self.all[k]
        line, end = x.ends[0]
        run.output_due()
        for l, e in x.ends:
            run.lines[l].let_go(e, run.t, run.model.models[l], run.state.lines[l])
        before, states, energy = run.model.models, run.state.lines, 0.0
        self._part(k)
        for l, e in x.ends:
            old, new = before[l], run.model.models[l]
            if new is not old:
                lost = elastic(new, run.t, run.state.lines[l]) - elastic(old, run.t, states[l])
                run.lines[l].books.work[0, e] += lost
                energy += lost
        text = f"{x.name} {why}; what came loose is free from here on"
        s = float(run.model.models[line].line.s[-end])
        run.noted.event(run.t, s, s, "end released", text, energy=energy)

    def _part(self, k: int) -> None:
        """Take the ends off their point, in a solver of its own."""
        run = self._run
        run.model = after_failure(run.model, self.all[k], run.t)
        self.broken.append(k)
        for line, model in zip(run.lines, run.model.models, strict=True):
            line.use_model(model)
        for l, e in self.all[k].ends:
            if (zones := run.lines[l].zones) is not None:
                zones.release(e, run.model.models[l])
        states = [
            x if x.turn.size == 3 * len(model.line.torsion) else x._replace(turn=NO_TURN)
            for x, model in zip(run.state.lines, run.model.models, strict=True)
        ]
        for point in run.model.unheld:
            run.state.bodies[len(run.model.bodies) + point, W:] = 0.0
        run.state = NetworkState(states, run.state.bodies)
        done = run.solver.body_work[:, DONE:SPRING].copy()
        run.make_solver()
        run.solver.body_work[:, DONE:SPRING] = done


def elastic(model: Model, t: float, state: State) -> float:
    """Energy of bending and torsion, J, at t (s), with that of zones that a torque passes through."""
    cells, energy = model.cells, np.zeros(4)
    observed = Observed(np.zeros((cells + 1, 3)), np.zeros((cells + 1, 3)), energy)
    observe(model.line, model.ends.at_time(t), state.e, state.v, state.a1, state.w, state.T, state.turn, observed)
    line = model.line
    twist = float(torsion_energy(line, state.turn[:, TURN], state.T)) if line.torsion.size else 0.0
    return float(energy[1] + energy[2]) + twist


# --- steps that are cut, that have become very short, or of which none leads on -----------------------

# Steps so short, one after the other, after which a run that is only to be compared with is given up.
GIVE_UP = 10 * MANY
# What cuts steps, by where the tries are counted (Counts), and what to do about it.
CAUSES = {
    "cut_by_gain": ("energy that contact puts in", "shorter cells there"),
    "cut_by_turn": ("cells that turn by more than a step allows", "cells as long as the bend there, or damping"),
    "cut_by_newton": ("Newton's method, which does not converge", "more cells where the cable bends, or damping"),
    "cut_by_error": (
        "the error that a step makes",
        "a larger accuracy or time.tolerance, or damping of what is fast there",
    ),
}
# A step in which waves of tension pass so many cells may itself leave a line slack; and by how much shorter one should
# be that shows whether it does.
MOST_PASSED, SHORTER = 4.0, 16.0


class Cuts(Part):
    """Steps that are cut, and those after which there is no other."""

    name, wants = "cuts", b.COLLAPSES | b.STEPS_CUT | b.STEPS_SLACK | b.ITERATIONS_CUT

    def __init__(self, run: RunOfLines, contact: RunContact, compared: bool) -> None:
        """contact: of its lines; compared: whether the run is only to be compared with."""
        self._run, self._contact, self._compared = run, contact, compared

    def after_step(self) -> None:
        """Events of steps that were cut: of each cause for the first."""
        flags = int(self._run.loop.counts.notices)
        if flags & b.COLLAPSES:
            self._note_collapse()
        if flags & b.STEPS_CUT:
            self._note_turn()
        if flags & b.STEPS_SLACK:
            self._note_slack()
        if flags & b.ITERATIONS_CUT:
            self._note_iterations()

    def finish(self, status: str) -> None:
        """How many steps were taken before they had converged, and how many tries contact cost."""
        run, shared, count = self._run, self._contact.shared, self._run.loop.counts
        short, most = int(count.cut_short), int(count.most_iterations)
        if status == "complete" and short:
            steps = f"{short} of {run.steps} steps were taken after {most} Newton iterations that had not converged"
            run.noted.event(run.t, 0.0, run.span[1], "iterations cut", steps, value=float(short), threshold=float(most))
        if shared is not None and (tries := shared.given_up):
            run.note("steps cut", energy_gains_text(tries))

    def _note_turn(self) -> None:
        """An end turns too far in a fixed step, which was cut."""
        loop, clock = self._run.loop, self._run.loop.clock
        if not loop.controlled:
            line, angle, step = self._run.lines[loop.lines[TURNED_LINE]], float(clock.cut_angle), float(clock.cut_step)
            text = (
                f"an end turns by {angle:.3g} rad in a step of {step:.4g} s: this step and others like it are cut, so "
                f"that it turns by at most {clock.most_turn:g} rad in each and no turn is lost; time.step: "
                f"{0.3 * step / angle:.2g} follows it"
            )
            line.events.event(float(clock.previous), 0.0, line.model.length, "steps cut", text)
        clock.mute_cuts = 1.0

    def _note_slack(self) -> None:
        """A catenary was slack in a step that is too long for its waves, and not in shorter ones."""
        loop, clock = self._run.loop, self._run.loop.clock
        line, taken = self._run.lines[loop.lines[SLACK_LINE]], float(clock.last_dt)
        s = float(line.model.line.s[int(loop.counts.slack_cell)])
        text = (
            f"a catenary loses its tension here in a step of {clock.slack_step:.4g} s, and keeps it in one of "
            f"{taken:.4g} s: the step is too long for waves, which pass a cell in {line.books.clock.wave_step:.2g} s; "
            f"this step and others like it are cut; time.step: {taken:.2g} follows them"
        )
        line.events.event(float(clock.now), s, s, "steps cut", text)
        clock.mute_slack = 1.0

    def _note_iterations(self) -> None:
        """A step was taken in all the Newton iterations that it may take though these had not converged."""
        run, clock = self._run, self._run.loop.clock
        most = int(run.loop.counts.most_iterations)
        left = "though the next would still have" if most > 1 else "which"  # from one alone the next is not known
        text = (
            f"a step was taken after {most} Newton iterations, {left} changed it by {clock.correction:.2g} (relative), "
            f"and so are others like it: most_iterations bounds their cost; steps/correction has what each left out; "
            f"a shorter time.step or more iterations leave less"
        )
        run.noted.event(run.t, 0.0, run.span[1], "iterations cut", text, threshold=float(most))

    @property
    def _touching(self) -> str:
        """What touches now, a line itself or another one, for the text of a failure; empty: nothing."""
        shared = self._contact.shared
        pairs = shared.points_between() if shared is not None else []
        if any(a != c for (a, _), (c, _) in pairs):
            return "; lines touch each other there, and contact: {between: []} leaves that out"
        if pairs or any(x.contact is not None and x.contact.touches for x in self._run.lines):
            return "; the line touches itself there, and contact: {self: false} leaves that out"
        return ""

    def _note_collapse(self) -> None:
        """Steps have become so short that the run may not end: an event; one to be compared with stops."""
        run, count = self._run, self._run.loop.counts
        number, where = int(run.loop.lines[CUT_LINE]), int(count.cut_at)
        line, tiny = run.lines[max(number, 0)], int(count.tiny_steps)
        s = float(line.model.line.s[min(max(where, 0), line.model.line.s.size - 1)]) if number >= 0 else 0.0
        text = (
            f"the last {tiny} steps were shorter than {TINY:g} of the longest, {run.loop.clock.longest:.3g} s; the "
            f"last took {run.last_step:.3g} s"
        )
        cuts = {name: int(getattr(count, name)) for name in CAUSES}
        most = max(cuts, key=lambda name: cuts[name])
        if cuts[most]:
            by = sorted(((n, CAUSES[name][0]) for name, n in cuts.items() if n), key=lambda x: -x[0])
            given = ", ".join(f"{cause} ({n})" for n, cause in by)
            text += f"; tries were cut by {given}, last at s = {s:.6g} m: {CAUSES[most][1]}{self._touching}"
        else:
            text += f"; they grow no faster{self._touching}"
        if tiny == MANY:
            line.events.event(run.t, s, s, "steps collapse", text, value=run.last_step)
        if self._compared and tiny >= GIVE_UP:
            raise LineFailed(line.number, Outcome.COLLAPSED, run.t, s, text)

    def judge_try(self, code: int) -> bool:
        """LineFailed: no step leads on, and nothing was given up."""
        if code == b.FAILED:
            raise self._explained(self._run.loop.tried, float(self._run.loop.clock.tried_dt))
        return False

    def find_accelerations(self, solve: Accelerations) -> Accelerations:
        """LineFailed: there are none."""

        def explained(lengthening: Mapping[int, Floats]) -> NetworkTaken:
            taken = solve(lengthening)
            if taken.outcome != Outcome.OK:
                raise self._explained(taken, 0.0)
            return taken

        return explained

    def _explained(self, taken: NetworkTaken, dt: float) -> LineFailed:
        """Why no step of dt (s) leads on; 0: why there are no accelerations."""
        run, k = self._run, taken.line
        detail = f"smallest step tried {dt:.3g} s; {taken.iterations} Newton iterations in the last try"
        if dt == 0.0:
            detail = "no accelerations are consistent with the shape and the loads"
        if k < 0:
            return LineFailed(-1, taken.outcome, run.t, None, detail + self._touching)
        line, model, count = run.lines[k], run.model.models[k], run.loop.counts
        node = min(max(taken.where, 0), model.line.s.size - 1)
        s, first = float(model.line.s[node]), ""
        if taken.outcome == Outcome.SLACK:
            detail, first = self._slack(k, node, dt)
        detail += self._own_touch(line) or self._touching
        if 0 < count.most_iterations <= count.taken:
            detail += f"; the {int(count.most_iterations)} iterations that a step may take are used up"
            first = "restore() and a shorter step, or more iterations (most_iterations)"
        ends = model.ends.at_time(run.t + dt)
        apart = float(np.linalg.norm(ends.position[1] - ends.position[0]))
        if max(run.solver.joints[k]) < 0 and model.inextensible and apart >= model.length:
            longest = f"the cable does not stretch beyond {model.length:.6g} m"
            detail += f"; the ends are then {apart:.6g} m apart, and {longest}"
        return LineFailed(k, taken.outcome, run.t, s, detail, first=first)

    def _slack(self, k: int, node: int, dt: float) -> tuple[str, str]:
        """Over which steps a catenary was slack, and what to try first: shorter steps, or what carries it."""
        run, clock = self._run, self._run.loop.clock
        line, model, before = run.lines[k], run.model.models[k], (run.other if dt else run.state).lines[k]
        planned, waves = float(clock.until - clock.begin), float(line.books.clock.wave_step)
        tension = before.T[min(node, before.T.size - 1)]
        over = f", tried after longer ones from {planned:.3g} s on," if dt < 0.99 * planned else ""
        text = (
            f"the step of {dt:.3g} s{over} that starts at this time ends with a tension of {tension:.3g} N; "
            f"a wave passes a cell in {waves:.2g} s"
        )
        too_long = run.steps > 0 and planned > MOST_PASSED * waves  # so they did in the steps before
        if too_long:
            step = max(planned / SHORTER, waves)
            first = f"time.step: {step:.2g} from the start, because the steps before may be to blame, not the line"
        else:
            text += ": the steps are short enough, the line is slack"
            first = slack_remedy(model, Outcome.SLACK, float(model.line.s[node]))
        if line.manager is not None:
            text += "; model.force_catenary keeps it from becoming a rod"
        return text, first

    @staticmethod
    def _own_touch(line: RunLine) -> str:
        """What is said of a line that touches itself where a step fails; empty: it does not."""
        if line.contact is None or not line.contact.touches:
            return ""
        p, q = sorted(float(line.model.line.s[k]) for k in line.contact.deepest)
        return (
            f"; contact of the line with itself is computed, s = {p:.6g} m and s = {q:.6g} m touch: "
            f"shorter cells there may help, and contact: {{self: false}} leaves it out"
        )
