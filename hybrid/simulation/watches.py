"""Events where a line may hockle, where the scheme fails a motion, and at knots.

A line may hockle where its torque is enough, for its tension, to throw a loop.  The time scheme fails where it
creates or loses energy, where periods are off, and where rest is unstable.  Lines that leave a sheave have an event,
too.
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from hybrid.errors import Outcome
from hybrid.kernels.laws.bending_law import EACH, STIFFENING
from hybrid.kernels.laws.obstacles import distances
from hybrid.kernels.state import books as b
from hybrid.kernels.state.books import Books
from hybrid.kernels.state.report import AXIS, GROOVE, INERTIA, KIND, PLACE, RATE, RIM, RING, SHEAVE, SOIL, STRAND
from hybrid.kernels.state.state import Batch, Floats, Sea, ends_in, state_in
from hybrid.model.build import Model
from hybrid.outputs.observation import Output
from hybrid.simulation.events import EventLog
from hybrid.solve.stability import TOUCHING, is_stable
from hybrid.store.capacity import formation_ratio, formation_tension, pop_out

# Change of writhe, turns, that is a loop: a small one has nearly 1.
LOOP = 0.75
# Change of writhe, turns, below which no loop is left.
OPEN = 0.5 * LOOP
# An event follows another when the margin is this part of what it was.
WORSE = 1.0 / 3.0


def note_hockling(
    model: Model, t: Floats, values: Mapping[str, Floats], s: Floats, ratio: float, event: Callable[..., None]
) -> float:
    """Write events where 1 over the formation margin is beyond `ratio`; that of the next event.

    t: (nb,) s; values: fields (nb, ...) of the outputs, along s (ns,) m; event: as EventLog.event.
    """
    torque = values.get("torque")
    if torque is None or not torque.any():
        return ratio
    piece = model.cable.piece(s)
    stiffness = model.cable.B[piece, :2].min(axis=1)
    found = formation_ratio(torque, values["tension"], stiffness)
    for k in np.flatnonzero(found.max(axis=1) > ratio):
        here = np.where(_long_enough(torque[k], values["tension"][k], stiffness, s), found[k], 0.0)
        i = int(here.argmax())
        if here[i] <= ratio:
            continue
        M, T, EI = float(torque[k, i]), float(values["tension"][k, i]), float(stiffness[i])
        text = _text(float(s[i]), M, T, EI, float(model.cable.outer_diameter[piece[i]]))
        event(float(t[k]), float(s[i]), float(s[i]), "loop can form", text, value=1.0 / float(here[i]), threshold=1.0)
        ratio = float(here[i]) / WORSE
    return ratio


def _long_enough(torque: Floats, tension: Floats, stiffness: Floats, s: Floats) -> np.ndarray:
    """Which points (ns,) lie in a stretch with too little tension that its torque alone could bend.

    Between pins a straight stretch of length l leaves the line from M^2/(4 EI) = T + pi^2 EI/l^2 on (Greenhill), which
    without tension is one that is longer than 2 pi EI/M.  T is not taken off: in a line that has begun to leave the
    straight line it falls in an ever shorter stretch, by about what that stretch bears, until the loop is there.
    """
    needed = formation_tension(torque, stiffness)
    out = needed > tension
    for first, last in np.flatnonzero(np.diff(np.concatenate([[0], out, [0]]))).reshape(-1, 2):
        length = s[min(last, s.size - 1)] - s[max(first - 1, 0)]
        out[first:last] = needed[first:last].mean() * length**2 > np.pi**2 * stiffness[first:last].max()
    return out


class Loops(NamedTuple):
    """What is remembered of loops from output to output.

    writhe: turns, of the first output, NaN before it; change: turns, by how much that of the next event differs;
    bend: 1/m, largest curvature at an output since a loop formed, 0: there is none.
    """

    writhe: float = np.nan
    change: float = LOOP
    bend: float = 0.0

    @property
    def formed(self) -> bool:
        """Whether a loop has formed since the first output, and not opened."""
        return self.change > LOOP


def note_loops(t: Floats, values: Mapping[str, Floats], s: Floats, known: Loops, event: Callable[..., None]) -> Loops:
    """Write events where the writhe is that of a loop more than at the first output, and where it has come back.

    known: what is remembered, which is returned as it is after these outputs; the rest as of `note_hockling`.
    """
    writhe = values.get("turns/writhe")
    if writhe is None:
        return known
    if not np.isfinite(known.writhe):
        known = known._replace(writhe=float(writhe[0]))
    change = np.abs(writhe - known.writhe)
    if not known.formed and not (change > LOOP).any():  # most batches
        return known
    for k in range(len(writhe)):
        known = _track_loop(t, values, s, k, known, event)
    return known


def _track_loop(
    t: Floats, values: Mapping[str, Floats], s: Floats, k: int, known: Loops, event: Callable[..., None]
) -> Loops:
    """What is remembered of loops after output k, with an event where one has formed or opened."""
    change, bends = float(values["turns/writhe"][k]) - known.writhe, values["curvature"][k]
    i, pull = int(bends.argmax()), float(values["tension"][k].max())
    where, bend = float(s[i]), max(known.bend, float(bends[i]))
    gone = abs(known.writhe) > LOOP and change * known.writhe < 0.0 and abs(change) > LOOP  # one of the first output
    if gone or (known.formed and abs(change) < OPEN):
        text = f"a loop has opened: the writhe has changed by {change:.3g} turns since the first output"
        if not gone:
            text = (
                f"the loop has opened: the writhe is within {abs(change):.2g} turns of that of the first output again"
            )
            text += f"; since it formed the line was bent to a radius of {1.0 / bend:.3g} m at the outputs"
        text += f", and the largest tension along the line is {pull:.4g} N now"
        event(float(t[k]), where, where, "loop opened", text, value=pull)
        return Loops(float(values["turns/writhe"][k]) if gone else known.writhe)
    if abs(change) > known.change:
        hand = "right" if change > 0.0 else "left"
        text = (
            f"the writhe has changed by {change:.3g} turns since the first output, about a {hand}-handed loop for "
            f"each: the line is bent most at s = {where:.6g} m; turns that it takes up no longer twist the line"
        )
        event(float(t[k]), where, where, "loop formed", text, value=change, threshold=known.change)
        return known._replace(change=2.0 * max(known.change, abs(change)), bend=bend)
    return known._replace(bend=bend) if known.formed else known


def _text(s: float, torque: float, tension: float, stiffness: float, diameter: float) -> str:
    needed = torque * torque / (4.0 * stiffness)
    text = (
        f"the torque of {torque:.3g} N m at s = {s:.6g} m needs a tension of M^2/(4 EI) = {needed:.3g} N to keep the "
        f"cable straight, there is {tension:.3g} N: it can throw a loop"
    )
    loop = pop_out(torque, stiffness, diameter) if diameter > 0.0 else None
    if loop is not None:
        text += f", which a pull of {loop.tension:.3g} N opens, bent to {loop.radius:.3g} m then"
    return f"{text}; friction, plasticity and weight on the loop are not in it"


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
# Kinetic energy above this part of the elastic one, or inertia above this part of the load, is a motion that has begun;
# bending energy above it is no symmetry that something could break.
BEGUN = 0.01
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
        hardly = moved <= HARDLY_MOVED * length and not high - low > HARDLY_MOVED * max(high, -low)
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
        least = NEWTON_LEAVES * model.tension_scale * model.length  # J
        twisted, lowest_ = values["energy/torsion"] > least, batch.T[:, rod].min(axis=1)
        pressed = (lowest_ * model.length < -least) | twisted
        calm = (values["energy/kinetic"] <= BEGUN * elastic) | ~batch.v.any(axis=(1, 2))
        # what is let go has no velocity yet, but is no longer at rest
        calm &= twisted | (float(line.mass.sum()) * np.abs(batch.vd).max(axis=(1, 2)) <= BEGUN * -lowest_)
        # a line that is bent and whose ends move follows them, and snaps where it must; contact is not judged
        moves = np.abs(batch.v[:, [0, -1]]).max(axis=(1, 2)) > 0.0
        calm &= ~(moves & (values["energy/bending"] > BEGUN * elastic))
        if "energy/self_contact" in values:
            calm &= values["energy/self_contact"] == 0.0
        for k in np.flatnonzero(pressed & calm):
            ends, state = ends_in(batch, int(k)), state_in(batch, int(k), line)
            if not is_stable(line, model.sea.values, ends, state, model.length, model.tension_scale):
                text = "the rod rests where it would buckle: only its perfect symmetry keeps it there"
                text += "; give it a small bow"
                # a bent one may be on its way, and has no symmetry that is known
                if values["energy/bending"][int(k)] > least:
                    text = "the rod is almost at rest in a shape that is not stable (its stiffness against some "
                    text += "displacement is negative): it is leaving it, or nothing in the scene disturbs it there"
                s = float(line.s[np.argmin(state.T)])
                self._events.event(float(batch.t[k]), s, s, "unstable", text)
                self._rested = True
                return


def _percent(part: float, whole: float) -> str:
    """A part of an energy in words."""
    return f"{100.0 * part / (whole or 1.0):.0f} %"


# The part of its length to which a knot has been drawn together when it is said again; points looked at in a cell.
TIGHTER, POINTS = 0.5, 8


class Knot(NamedTuple):
    """What is known of the knot of a line.

    length: m, of the part that has it, or that touches itself without a knot, NaN: never looked at; crossings: 0: none;
    below: m, between the first and the last node that touch, under which it is looked at again.
    """

    length: float = np.nan
    crossings: float = 0.0
    below: float = np.nan


def note_knot(t: float, s: Floats, r: Floats, touch: Floats, known: Knot, event: Callable[..., None]) -> Knot:
    """Write an event where the knot of a line is drawn together to half of what it was; what is known then.

    t: s, of an output; s (N+1,) m, r (N+1, 3) m, touch (N+1,) N/m, the force of the line on itself: of its nodes;
    event: as EventLog.event.  A line is looked at where what touches is another part of it than before.
    """
    pressed = np.flatnonzero(touch > 0.0)
    if pressed.size < 2:
        return known
    span = float(s[pressed[-1]] - s[pressed[0]])
    same = TIGHTER * known.length < span < known.length / TIGHTER
    if not span < known.below if known.crossings else same:
        return known
    count = crossings_of_knot(r)
    if not count:
        return Knot(span, 0.0, np.nan)
    first, last = core_of_knot(r)
    length = float(s[last] - s[first])
    if not known.crossings:
        return Knot(length, float(count), TIGHTER * length)
    if not length < TIGHTER * known.length:
        return known._replace(below=TIGHTER * span)
    text = (
        f"the knot between s = {s[first]:.4g} m and s = {s[last]:.4g} m, of {count} crossings where it shows fewest, "
        f"has been drawn together to {length:.3g} m of line from {known.length:.3g} m"
    )
    event(t, float(s[first]), float(s[last]), "knot tightens", text, value=length, threshold=TIGHTER * known.length)
    return Knot(length, float(count), TIGHTER * length)


def sheaves_of(sea: Sea) -> list[int]:
    """Numbers of the obstacles that a line is said to leave: sheaves, and what turns."""
    turns = sea.carried[:, [RATE, INERTIA]].any(axis=1) if sea.carried.size else np.zeros(len(sea.obstacles), bool)
    return [int(k) for k in np.flatnonzero((sea.obstacles[:, KIND] == SHEAVE) | turns)]


def note_departures(
    t: float, s: Floats, r: Floats, sea: Sea, names: Sequence[str], lay: Floats, event: Callable[..., None]
) -> Floats:
    """Write an event for every sheave that a line has lain on and is off; when and where it lies on each then.

    t: s, of an output; s (N+1,) m, r (N+1, 3) m: of the nodes; sea: with the obstacles where they are; names: of all of
    them; lay: (n, 2) when (s) and at which arc length (m) the line lay on each of `sheaves_of` last, NaN: it is off.

    On a sheave is a line that touches it between its rims, and off it one of which nothing is between them any more;
    on a roller that turns one that touches it, and off one that is a diameter away.
    """
    x = np.linspace(0.0, 1.0, POINTS, endpoint=False)[:, None]
    at = np.append(((1.0 - x) * s[:-1] + x * s[1:]).T.ravel(), s[-1])
    x = x[:, :, None]
    points = np.append(((1.0 - x) * r[:-1] + x * r[1:]).transpose(1, 0, 2).reshape(-1, 3), r[-1:], axis=0)
    gaps, lay = distances(sea, points), lay.copy()
    for n, k in enumerate(sheaves_of(sea)):
        row, gap = sea.obstacles[k], gaps[k]
        strand, off = row[STRAND], points - row[PLACE : PLACE + 3]
        along = off @ row[AXIS : AXIS + 3]
        near, way = gap < 2.0 * strand, "a diameter or more away"
        if row[KIND] == SHEAVE:
            out = np.sqrt(np.maximum((off * off).sum(axis=1) - along * along, 0.0))
            half, rim = row[GROOVE] + row[RIM], row[RIM] - strand
            near = (np.abs(along) < half) & (out < row[RING] + rim)
            beside = abs(along[gap.argmin()]) > half
            way = "beside its rims" if beside else "farther out than its rims"
        lies = near & (gap < TOUCHING * strand)
        if lies.any():
            lay[n] = t, at[lies].mean()
        elif not near.any() and np.isfinite(lay[n, 0]):
            where = float(at[gap.argmin()])
            text = (
                f"the line leaves {names[k]}, on which it lay last at t = {lay[n, 0]:.4g} s, at s = {lay[n, 1]:.4g} m: "
                f"what is nearest now, s = {where:.4g} m, is {way}"
            )
            event(t, where, where, "line leaves the sheave", text, value=float(gap.min()))
            lay[n] = np.nan
    return lay


# Knots of a line: what is left of it when every bend is drawn straight that nothing holds, and its crossings.
#
# A corner of a polyline may be drawn straight where no other chord passes through the triangle of it and its
# neighbours.
# The ends stay where they are, so a line without a knot becomes one chord (K. Koniaris and M. Muthukumar, 1991).

DIRECTIONS = 500  # in which crossings are counted
ROUNDS = 5  # how often what is left is drawn straight anew
FEWEST = 3  # crossings of a knot
# Part of a chord or triangle by which one that passes beside it counts as passing through.
BESIDE = 1e-9
AWAY = 100.0  # times as far from the middle as they are, to which the ends are led
FLAT = 1e-20  # sine squared of the turn at a corner that is straight already


def _passes(a: Floats, b: Floats, c: Floats, starts: Floats, ends: Floats) -> bool:
    """Whether one of the chords from starts (n, 3) to ends (n, 3) passes through the triangle a, b, c."""
    one, two = b - a, c - a
    normal = np.cross(one, two)
    if not normal @ normal > (FLAT * (one @ one) * (two @ two)):
        return False
    ways = ends - starts
    size = -(ways @ normal)
    crosses = np.abs(size) > 0.0
    off, ways, size = starts[crosses] - a, ways[crosses], size[crosses]
    q = np.cross(off, one)
    u, v = (off * np.cross(ways, two)).sum(axis=1) / size, (ways * q).sum(axis=1) / size
    along = (q @ two) / size
    inside = (u > -BESIDE) & (v > -BESIDE) & (u + v < 1.0 + BESIDE) & (along > -BESIDE) & (along < 1.0 + BESIDE)
    return bool(inside.any())


def _is_held(r: Floats, i: int) -> bool:
    """Whether a chord passes through the triangle of corner i and its neighbours."""
    starts, ends, (a, b, c) = r[:-1], r[1:], r[i - 1 : i + 2]
    low, high = np.minimum(np.minimum(a, b), c), np.maximum(np.maximum(a, b), c)
    near = ((np.minimum(starts, ends) <= high) & (np.maximum(starts, ends) >= low)).all(axis=1)
    near[max(i - 2, 0) : i + 2] = False  # those before and after touch the triangle at its corners only
    return bool(near.any()) and _passes(a, b, c, starts[near], ends[near])


def drawn_straight(r: Floats) -> Floats:
    """The corners (m, 3) that are left of a polyline r (n, 3), m; two of a line without a knot."""
    left = np.asarray(r, float)
    before = len(left) + 1
    while len(left) < before and len(left) > 2:
        before, i = len(left), 1
        while i < len(left) - 1:
            if _is_held(left, i):
                i += 1
            else:
                left = np.delete(left, i, axis=0)
    return left


def _rounded(r: Floats) -> Floats:
    """A polyline r (n, 3) whose corners are cut off between the middles of their chords, where nothing holds them."""
    left = np.empty((2 * len(r) - 1, 3))
    left[::2], left[1::2] = r, 0.5 * (r[1:] + r[:-1])
    i = 2
    while i < len(left) - 1:
        if _is_held(left, i):
            i += 2
        else:
            left, i = np.delete(left, i, axis=0), i + 1
    return left


def crossings(r: Floats) -> int:
    """How often a polyline r (n, 3) crosses itself, as seen from where it does so least."""
    k = np.arange(DIRECTIONS) + 0.5
    z, turn = 1.0 - k / DIRECTIONS, np.pi * (1.0 + 5.0**0.5) * k  # half of a sphere, evenly
    towards = np.column_stack([np.sqrt(1.0 - z * z) * np.cos(turn), np.sqrt(1.0 - z * z) * np.sin(turn), z])
    side = np.cross(towards, np.eye(3)[np.argmin(np.abs(towards), axis=1)])
    x, y = r @ side.T, r @ np.cross(towards, side).T  # (n, directions)
    dx, dy = np.diff(x, axis=0), np.diff(y, axis=0)
    i, j = np.triu_indices(len(dx), 2)
    off_x, off_y = x[j] - x[i], y[j] - y[i]
    size = dx[i] * dy[j] - dy[i] * dx[j]
    with np.errstate(divide="ignore", invalid="ignore"):
        u, v = (off_x * dy[j] - off_y * dx[j]) / size, (off_x * dy[i] - off_y * dx[i]) / size
    return int(((u > 0.0) & (u < 1.0) & (v > 0.0) & (v < 1.0)).sum(axis=0).min())


def _led_away(r: Floats) -> Floats:
    """A line of nodes r (n, 3) m whose ends go straight on, away from its middle, so that none is within the knot."""
    ends = r[[0, -1]]
    out = ends + AWAY * (ends - r.mean(axis=0))
    return np.concatenate([out[:1], r, out[1:]])


def crossings_of_knot(r: Floats) -> int:
    """Crossings of the knot in a line of nodes r (n, 3) m; 0: there is none.

    They are those where the knot is drawn straight so that it shows fewest of what was tried: never less than it has.
    """
    left = drawn_straight(_led_away(r))
    if len(left) <= FEWEST:
        return 0
    found = crossings(left)
    for _ in range(ROUNDS):
        left = drawn_straight(_rounded(left))
        found = min(found, crossings(left))
    return found if found >= FEWEST else 0


def core_of_knot(r: Floats) -> tuple[int, int]:
    """First and last node of the shortest part of a line of nodes r (n, 3) m that still has its knot."""

    def knotted(a: int, b: int) -> bool:
        return len(drawn_straight(r[a : b + 1])) > FEWEST

    last = len(r) - 1
    first = bisect_left(range(1, last), True, key=lambda a: not knotted(a, last))
    return first, bisect_left(range(last), True, first + 1, key=lambda b: knotted(first, b))
