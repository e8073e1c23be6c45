"""How near lines come to themselves and each other.

There is an event where surfaces meet between which no contact is computed, and the least clearance for the file.
Lines that cross between two shapes are found.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hybrid.kernels.contact.lines_distance import (
    AT,
    HAVE_MET,
    MET,
    MOVED,
    NEAR,
    OTHER,
    ROOM,
    TIME,
    blank_lines_job,
    watch_lines,
)
from hybrid.kernels.contact.self_contact_law import INNER, OUTER
from hybrid.kernels.contact.self_contact_pairs import WINDOW
from hybrid.kernels.contact.self_distance import (
    ENDS,
    HIDES,
    MEETS,
    NEARS,
    NEIGHBOURS,
    PARTS,
    TURNED,
    UNBENT,
    WIDER,
    blank_itself,
    blank_itself_job,
    watch_itself,
)
from hybrid.kernels.machine.binding import Table
from hybrid.kernels.state.books import Clock, Counts
from hybrid.kernels.state.report import MAY_TOUCH, SELF_CONTACT
from hybrid.kernels.state.state import Floats, State, state_for
from hybrid.model.build import Model
from hybrid.model.contents import COST, Touching, joined_ends_of, points_of_ends
from hybrid.model.network import NetworkModel
from hybrid.scene.network import Network
from hybrid.solve.contact import SelfContact, SharedContact, TouchingLine
from hybrid.solve.stepper import NetworkState
from hybrid.store.format import Field

GROUP = "self_distance"
# In the file: where in `found` it stands, unit, meaning.
FIELDS = {
    f"{GROUP}/clearance": ("least", "m", "least clearance between surfaces of the line that are no neighbours"),
    f"{GROUP}/distance": ("least_distance", "m", "distance of the centrelines there"),
    f"{GROUP}/s_a": ("least_s", "m", "arc length where it was"),
    f"{GROUP}/s_b": ("least_other", "m", "arc length of the other place"),
    f"{GROUP}/time": ("least_time", "s", "when it was"),
}


def diameters(model: Model) -> Floats:
    """Outer diameters (N,) m of the cells; 0 where the scene gives none."""
    s = model.line.s
    return np.asarray(model.cable.outer_diameter[model.cable.piece(0.5 * (s[:-1] + s[1:]))])


def least_bending(model: Model) -> Floats:
    """Bending stiffness (N,) N m2 of the sections of the cells, the lower of two; 0 where the scene gives none."""
    s = model.line.s
    return np.asarray(model.cable.B[model.cable.piece(0.5 * (s[:-1] + s[1:])), :2].min(axis=1))


# Diameters and cells, of both ends together, within which held ends are neighbours (contact.self_contact_pairs).
BESIDE, BESIDE_CELLS = WINDOW, NEIGHBOURS + 1
REMEDY = "contact: {self: true} does, of catenaries too"


def meeting_text(
    s: float, other: float, distance: float, width: float, dt: float, why: str, remedy: str = REMEDY
) -> str:
    """Text of the event of a line that comes within `distance`, m, of itself at two arc lengths, m.

    width: m, of the cable; dt: s, the step in which it does, 0: in none; why: no contact is computed; remedy: what
    computes it.
    """
    passing = f" in a step of {dt:.3g} s" if dt > 0.0 else ""
    return (
        f"s = {s:.6g} m and s = {other:.6g} m come within {distance:.3g} m of each other{passing}, less than the "
        f"diameter of {width:.3g} m: nothing keeps it from passing through itself here ({why}); {remedy}"
    )


BEGINS = f"contact of the line with itself is computed from here on, until they are apart; {COST}"
GIVEN_UP = "contact there let no step lead on, and begins again where parts are apart"
HIDDEN_BY_BEND = "a bend between them is sharper than its cells show, and contact is not judged there"


def hidden_text(model: Model, state: State, i: int, j: int, node: int) -> str:
    """Text of the event of a bend at a node that hides how near cells i and j, beside it, are."""
    s, e = model.line.s, state.e
    turn = math.atan2(float(np.linalg.norm(np.cross(e[node - 1], e[node]))), float(e[node - 1] @ e[node]))
    cells = min(float(model.line.h[node - 1]), float(model.line.h[node])) / turn
    cable = model.cable
    natural = float(cable.bending_length(1e-9 * model.tension_scale / model.length)[cable.piece(s[node : node + 1])][0])
    if natural > 0.0:
        cells = min(cells, natural)
    return (
        f"the line turns by {math.degrees(turn):.0f} deg from one cell to the next at s = {s[node]:.6g} m: how near "
        f"s = {s[i]:.6g} m and s = {s[j + 1]:.6g} m beside it are is not known, and contact of the line with itself is "
        f"not judged there; cells of at most {cells:.2g} m there (mesh) would show it"
    )


def touching_text(s: float, other: float, distance: float, width: float) -> str:
    """Text of the event of a line that touches itself, with contact; as `meeting_text`."""
    return (
        f"s = {s:.6g} m and s = {other:.6g} m touch: their centrelines are {distance:.3g} m apart, the diameter is "
        f"{width:.3g} m"
    )


class SelfWatch:
    """Watches one line for as long as a run lasts, in its steps and in states that are handed over.

    A line without a diameter is not watched.
    """

    def __init__(self, model: Model, why: str = "statics compute no contact") -> None:
        """why: no contact is computed, for an event; `renew` before the first step."""
        self.on, self.why = bool(diameters(model).any()), why
        self.asks = False  # whether it is asked when the line comes near itself, so that contact begins
        self.itself = blank_itself(np.ones(1))
        self._touches = False  # whether contact is computed
        self._model = model
        self._job: Table | None = None
        self.running: Table | None = None  # of the steps of a run
        self.is_bent = False

    def renew(self, model: Model) -> None:
        """Go on with the cells of a model; events tell of contact from now on where it is computed."""
        self._model, self._job, self.running, self.is_bent = model, None, None, False
        if not self.on:
            return
        self.itself = blank_itself(diameters(model))._replace(found=self.itself.found)
        self._touches = bool(model.line.bits & SELF_CONTACT)
        self.itself.found.meeting = OUTER - 1.0 if self._touches else 0.0
        self.asks = bool(model.line.bits & MAY_TOUCH) and not self._touches
        ends = self._touches and bool(model.line.bits & MAY_TOUCH)
        self.itself.ahead.asked = 1.0 if self.asks else WIDER if ends else -1.0

    def begins(self, t: float, model: Model, event: Callable[..., None]) -> None:
        """Contact is computed from now on, which an event says."""
        found = self.itself.found
        found.away = 0.0
        s, other, where = float(model.line.s[0]), float(model.line.s[-1]), "parts of the line"
        if math.isfinite(found.distance):
            s, other = sorted((float(found.s), float(found.other_s)))
            where = f"s = {s:.6g} m and s = {other:.6g} m, whose surfaces are {found.clearance:.3g} m apart,"
        event(t, s, other, "contact begins", f"{where} come near each other: {BEGINS}")

    def waits(self) -> None:
        """Contact is not computed again before parts have come apart; where they meet until then, that is told."""
        self.itself.found.waits, self.itself.found.told = 1.0, 0.0

    def report_hidden(self, t: float, state: State, event: Callable[..., None]) -> None:
        """An event for a bend that hides how near parts are."""
        ahead, model = self.itself.ahead, self._model
        i, j, node = int(ahead.hidden_i), int(ahead.hidden_j), int(ahead.sharp)
        s = float(model.line.s[node])
        event(t, s, s, "unresolved bend", hidden_text(model, state, i, j, node))

    def report_meeting(self, t: float, dt: float, event: Callable[..., None]) -> None:
        """The event of a line that meets itself, where contact could not begin, unless it has been told."""
        found = self.itself.found
        if found.clearance < 0.0 and found.told == 0.0:
            found.told = 1.0
            self.report(t, dt, event)

    def report(self, t: float, dt: float, event: Callable[..., None]) -> None:
        """An event for what was found; dt: s, the step in which it was, 0: in none."""
        found = self.itself.found
        distance, width = float(found.distance), float(found.distance - found.clearance)
        s, other = sorted((float(found.s), float(found.other_s)))
        if self._touches:
            text = touching_text(s, other, distance, width)
            event(t, s, other, "line touches itself", text, value=distance, threshold=width)
        else:
            why, remedy = self.why, REMEDY
            if self.asks and found.waits > 0.0:
                why, remedy = GIVEN_UP, "shorter cells"
            elif self.asks and found.hidden == 0.0:
                why, remedy = HIDDEN_BY_BEND, "shorter cells"
            text = meeting_text(s, other, distance, width, dt, why, remedy)
            event(t, s, other, "line meets itself", text, value=distance, threshold=width)

    def report_too_near(self, model: Model, event: Callable[..., None]) -> None:
        """At the end of a run: an event where a line whose contact is computed has come nearer than contact lets it."""
        found, s = self.itself.found, model.line.s
        distance = float(found.least_distance)
        width = distance - float(found.least)
        if not (self.on and self._touches and distance < INNER * width):
            return
        first, last = sorted((float(found.least_s), float(found.least_other)))
        why, remedy = "its cells are too long for contact there", "shorter cells"
        beside = BESIDE * width + BESIDE_CELLS * float(np.diff(s).max())
        if model.ends.values.held.all() and first + float(s[-1]) - last < beside:
            why = "beside ends that are held no contact is computed of one with the other"
            remedy = "ends that stay a diameter apart"
        text = meeting_text(first, last, distance, width, 0.0, why, remedy)
        event(float(found.least_time), first, last, "line meets itself", text, value=distance, threshold=width)

    def fields(self) -> list[Field]:
        """Fields of the file; NaN where the line never came near itself."""
        if not self.on:
            return []
        return [
            Field(name, unit, f"{text}; NaN: it was never near", nan_ok=True)
            for name, (_, unit, text) in FIELDS.items()
        ]

    def values(self) -> dict[str, np.ndarray]:
        """Values of those fields."""
        found = self.itself.found
        near = self.on and math.isfinite(found.least)
        return {x.name: np.array(getattr(found, FIELDS[x.name][0]) if near else np.nan) for x in self.fields()}

    def _bound(self, states: tuple[State, State], clock: Clock, counts: Counts) -> Table:
        """What the kernel gets, of two states in turn."""
        model, job = self._model, Table(blank_itself_job)
        job.bind(line=model.line, ends=model.ends.values, old=states[0], new=states[1])
        job.bind(clock=clock, counts=counts, itself=self.itself)
        return job

    def attach(self, states: tuple[State, State], clock: Clock, counts: Counts) -> dict[str, Any]:
        """What the job of a line is to have so that its steps, between two states in turn, look by themselves.

        clock, counts: of the run (kernels.state.books).
        """
        if not self.on:
            return {"itself": 0}
        self.running = self._bound(states, clock, counts)
        numbers = self.running.numbers
        return {"itself": watch_itself.address(numbers) if self.is_bent else UNBENT, "itself_table": numbers}

    def adopt_cells(self, model: Model) -> None:
        """Go on with a line of other cells, of which steps know."""
        self._model, self._job = model, None

    def bends(self) -> tuple[int, dict[str, Any]]:
        """A line of a run is bent, so that every step looks from now on: bits of the last, and its job."""
        self.is_bent, job = True, self.running
        assert job is not None
        return int(watch_itself(job.numbers)), {"itself": watch_itself.address(job.numbers)}

    def check(self, t: float, state: State, event: Callable[..., None]) -> int:
        """As `judge`, of a state at t (s) from which no step has been made."""
        if not self.on:
            return 0
        if not is_bent(state) and self.itself.ahead.asked != WIDER:
            self.itself.found.told = 0.0
            return 0
        return self.judge(self._search(t, state), t, 0.0, state, event)

    def judge(self, found: int, t: float, dt: float, state: State, event: Callable[..., None]) -> int:
        """Report surfaces that have met in the step of dt (s) to a state at t (s), or a bend that hides it.

        found: bits of the search.  Returns NEARS where the line is so near itself, in place of an event, that its
        contact has to begin, PARTS where it may end.
        """
        told = self.itself.found
        if found & HIDES:
            self.report_hidden(t, state, event)
        if found & NEARS:
            told.told = 0.0 if found & MEETS else told.told
        elif found & MEETS:
            self.report(t, dt, event)
        return found & (NEARS | PARTS)

    def is_near(self, t: float, state: State, step: float) -> bool:
        """Whether a line that may touch itself is near itself at t (s), from which a step (s) is to be made."""
        if not (self.on and self.asks and is_bent(state)):
            return False
        ahead, found = self.itself.ahead, self.itself.found
        ahead.seconds = step
        seen = self._search(t, state)
        ahead.seconds, found.told, found.hidden = 0.0, 0.0, ENDS
        return bool(seen & NEARS)

    def _search(self, t: float, state: State) -> int:
        """MEETS and NEARS of kernels.contact.self_distance."""
        if self._job is None:  # when the line is so bent for the first time that it could come near itself
            self._now, self._before, self._clock = state_for(self._model.line), state_for(self._model.line), Clock()
            self._job = self._bound((self._now, self._before), self._clock, Counts())
        self._now.r[:], self._now.e[:], self._now.v[:], self._before.r[:] = state.r, state.e, state.v, state.r
        self._clock.now = t
        return int(watch_itself(self._job.numbers))


def is_bent(state: State) -> bool:
    """As kernels.contact.self_distance.is_bent, which only kernels can call."""
    c = state.r[-1] - state.r[0]
    along, size = state.e @ c, TURNED * TURNED * (c @ c) * np.einsum("ij,ij->i", state.e, state.e)
    return not bool(((along > 0.0) & (along * along > size)).all())


def deepest_text(contact: SelfContact, model: Model) -> str:
    """Where parts of a line are deepest in each other, of a state that contact has looked at last."""
    p, q = contact.deepest
    s, other = sorted((float(model.line.s[p]), float(model.line.s[q])))
    width = float(0.5 * (contact.contact.width[p] + contact.contact.width[q]))
    return (
        f"the centrelines of s = {s:.6g} m and s = {other:.6g} m are {contact.least_distance:.3g} m apart, less than "
        f"{INNER:g} of the diameter of {width:.3g} m"
    )


PASSED = "lines pass through each other"  # kind of an event
# Parts of a straight way between two shapes, and by how much the Gauss integral of two lines jumps where one passes
# through the other: by 1, and by far less in a part of a way on which none does.
OUTLINE_PARTS, JUMP = 48, 0.5
PLANES = 20  # normals of a plane between two shapes that are tried
FLAT = 1e-9  # volume, over the lengths, of chords that lie in one plane but for round-off, as neighbours do


def shared_of(model: NetworkModel, rubs: bool = False) -> SharedContact | None:
    """Contact of the lines of a model with each other, with friction or without; None: they have none."""
    if (among := model.touching) is None:
        return None
    now = replace(among, joined=joined_now(among.joined, among.points, model, among.lines))
    return SharedContact(now, [strand_in(model.models[k]) for k in among.lines], rubs)


GAVE_WAY = 1 << 32  # added to the number of what was held, and has come loose with several lines


def joined_now(
    joined: NDArray[np.int64], points: NDArray[np.int64], model: NetworkModel, lines: Sequence[int]
) -> NDArray[np.int64]:
    """What ends of lines are joined to, (K, 2) as of Touching: one that has come loose, to nothing else.

    One that has left a point of others is beside these for good: there lines are in each other.
    """
    out = joined.copy()
    for row, at, k in zip(out, points, lines, strict=True):
        for end, joint in enumerate(model.joints[k]):
            if joint >= 0 and row[end] == 0:
                row[end] = GAVE_WAY + joint
            elif joint < 0 and not model.models[k].ends.values.held[end] and (points == at[end]).sum() == 1:
                row[end] = -1 - 2 * k - end
    return out


def strand_in(x: Model) -> TouchingLine:
    """What contact takes of the line of a model."""
    grows = 0.0 if x.payout is None else float(np.diff(x.payout.nodes).max())
    return TouchingLine(x.line, diameters(x), least_bending(x), x.tension_scale, grows)


def gauss_integral(a: Floats, b: Floats) -> float:
    """Gauss integral of two polylines (n, 3) m and (m, 3) m: half the sum of their signed crossings over all views."""
    p, q = a[:-1, None], a[1:, None]
    r, s = b[None, :-1], b[None, 1:]
    pr, ps, qr, qs = (y - x for x, y in ((p, r), (p, s), (q, r), (q, s)))
    normals = [np.cross(x, y) for x, y in ((pr, ps), (ps, qs), (qs, qr), (qr, pr))]
    n = [x / np.maximum(np.linalg.norm(x, axis=-1, keepdims=True), 1e-300) for x in normals]
    angles = [np.arcsin(np.clip(np.einsum("ijk,ijk->ij", n[i], n[(i + 1) % 4]), -1.0, 1.0)) for i in range(4)]
    volume = np.einsum("ijk,ijk->ij", np.cross(s - r, q - p), pr)
    largest = np.prod([np.linalg.norm(x, axis=-1) for x in np.broadcast_arrays(s - r, q - p, pr)], axis=0)
    side = np.where(np.abs(volume) > FLAT * largest, np.sign(volume), 0.0)
    return float((side * sum(angles)).sum() / (4.0 * math.pi))


def jumps(a: Floats, b: Floats) -> float:
    """Largest jump of the Gauss integral of two polylines on their straight ways.

    a (2, n, 3), b (2, m, 3): m, first and last nodes of each.
    """
    parts = np.linspace(0.0, 1.0, OUTLINE_PARTS + 1)
    found = [gauss_integral((1.0 - x) * a[0] + x * a[1], (1.0 - x) * b[0] + x * b[1]) for x in parts]
    return float(np.abs(np.diff(found)).max())


def crossed(touching: Touching, first: NetworkState, last: NetworkState) -> Iterator[tuple[int, int]]:
    """Numbers of lines, two each, of which one passes through the other on the straight way between two shapes."""
    ways = [np.stack(_of_as_many_nodes(first.lines[k].r, last.lines[k].r)) for k in touching.lines]
    lows, highs = (np.array([f(w, axis=(0, 1)) for w in ways]) for f in (np.min, np.max))
    for j, a in enumerate(touching.lines):
        beside = touching.meets[j] & ((lows[j] <= highs) & (lows <= highs[j])).all(axis=1)
        for k in np.flatnonzero(beside[j + 1 :]) + j + 1:
            if may_pass(ways[j], ways[k]) and jumps(ways[j], ways[k]) > JUMP:
                yield a, touching.lines[k]


def may_pass(a: Floats, b: Floats) -> bool:
    """Whether two polylines may pass through each other on their straight ways; a, b: as of `jumps`.

    They cannot where a plane lies between them all the way, or between parts of theirs, by which this goes on.
    """
    if lie_apart(a.reshape(-1, 3), b.reshape(-1, 3)):
        return False
    if a.shape[1] < b.shape[1]:
        a, b = b, a
    middle = a.shape[1] // 2
    return middle < 2 or may_pass(a[:, : middle + 1], b) or may_pass(a[:, middle:], b)


def lie_apart(a: Floats, b: Floats) -> bool:
    """Whether a plane is found between points (n, 3) m and (m, 3) m, which may touch it; by Gilbert's method.

    Its normal is the shortest way known between what lies within those, and is made shorter by what lies farthest
    beyond the plane.
    """
    way, size = a.mean(axis=0) - b.mean(axis=0), float(np.abs(a).max() + np.abs(b).max())
    for _ in range(PLANES):
        beyond = a[(a @ way).argmin()] - b[(b @ way).argmax()]
        length, reach = float(way @ way), float(beyond @ way)
        if length == 0.0:
            return False
        if reach >= -FLAT * size * math.sqrt(length):
            return True
        turn = beyond - way
        way = way + min((length - reach) / float(turn @ turn), 1.0) * turn
    return False


def _of_as_many_nodes(a: Floats, b: Floats) -> list[Floats]:
    """Two shapes of a line, (n, 3) m; where its cells have changed between them at equal parts of their lengths."""
    if a.shape == b.shape:
        return [a, b]
    parts, shapes = np.linspace(0.0, 1.0, max(len(a), len(b))), []
    for r in (a, b):
        s = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(r, axis=0), axis=1)))
        shapes.append(np.column_stack([np.interp(parts * s[-1], s, x) for x in r.T]))
    return shapes


def pair_text(shared: SharedContact, model: NetworkModel) -> str:
    """Which two lines, or a line and itself, are nearest of what was looked at last, and where."""
    a, i, b, j, distance = shared.deepest_pair
    s, other = (float(model.models[k].line.s[n]) for k, n in ((a, i), (b, j)))
    return f"lines {model.names[a]} and {model.names[b]} are {distance:.3g} m apart at s = {s:.4g} and {other:.4g} m"


# --- lines between which no contact is computed -------------------------------------------------------


def watched_pairs(network: Network, model: NetworkModel) -> NDArray[np.int64]:
    """Numbers (n, 2) of lines, in order, that have diameters, and between which no contact is computed."""
    thick, touching = np.array([(diameters(x) > 0.0).all() for x in model.models]), model.touching
    watched = np.triu(thick[:, None] & thick, 1)
    if touching is not None:
        watched[np.ix_(touching.lines, touching.lines)] &= touching.meets == 0
    return np.argwhere(watched)


def _joined_by_place(network: Network, model: NetworkModel, width: float) -> NDArray[np.int64]:
    """As joined_now, but what is held or moved is one thing only where it is one place at first.

    width: m, the largest diameter.
    """
    joined = joined_now(joined_ends_of(network), points_of_ends(network), model, range(len(model.models)))
    held = np.argwhere(joined == 0)
    lines = list(network.lines.values())
    at = np.array([network.first_place((lines[k].start, lines[k].end)[end]) for k, end in held]).reshape(-1, 3)
    first = 1 + int(joined.max(initial=0))
    for row, place in zip(held, at, strict=True):  # the number of the first that is there
        beside = np.linalg.norm(at - place, axis=1) <= OUTER * width
        joined[tuple(row)] = first + int(beside.argmax())
    return joined


Pairs = Collection[tuple[int, int]]


class LinesWatch:
    """What looks after every step whether two of such lines have met, or are near."""

    def __init__(self, network: Network, model: NetworkModel, met: Pairs, clock: Clock, alone: Pairs = ()) -> None:
        """met: lines of which it is known; clock: of the run; alone: lines that may meet, but are let pass."""
        pairs, lines = watched_pairs(network, model), len(model.models)
        may, known = np.zeros((lines, lines), np.int64), np.zeros((lines, lines), np.int64)
        may[np.ix_(model.may_meet, model.may_meet)] = 1
        for each, of, value in ((may, alone, 0), (known, met, MET)):
            for pair in of:
                each[pair] = value
        a, c = pairs.T
        self._pairs = np.column_stack([a, c, known[a, c], may[a, c], np.zeros_like(a)])
        self._room = np.zeros((len(self._pairs), ROOM))
        most = [x.most_cells for x in model.models]
        width, begins = [np.zeros(x) for x in most], np.append(0, np.cumsum(most)[:-1]).astype(np.int64)
        for row, x in zip(width, model.models, strict=True):
            row[: x.cells] = diameters(x)
        widest = max((float(x.max()) for x in width), default=0.0)
        self.joined = _joined_by_place(network, model, widest)
        self._bound: dict[str, Any] = {"joined": self.joined, "begins": begins, "width": np.concatenate(width)}
        self._bound |= {"clock": clock, "pairs": self._pairs, "room": self._room}
        self._bound |= {"moved": np.zeros((len(width), MOVED))}
        self._most, self._jobs = most, (Table(blank_lines_job), Table(blank_lines_job))

    def width_of(self, number: int) -> Floats:
        """Diameters (M,) m of the cells of a line, with room for the most that there may be."""
        begin, width = int(self._bound["begins"][number]), self._bound["width"]
        return np.asarray(width[begin : begin + self._most[number]])

    @property
    def distances(self) -> dict[str, np.ndarray]:
        """Pairs of lines, and how far apart they are, as kernels.mesh.remesh.RemeshJob has them."""
        return {"pairs": self._pairs, "room": self._room}

    @property
    def is_needed(self) -> bool:
        """Whether there is anything that may still meet."""
        return bool((self._pairs[:, HAVE_MET] != MET).any())

    def attach(self, tables: NDArray[np.int64]) -> tuple[np.ndarray, np.ndarray, int]:
        """Tables for both parities and the address of the kernel; tables: (2, L, ..) jobs of the lines."""
        for job, numbers in zip(self._jobs, tables, strict=True):
            job.bind(tables=numbers, **self._bound)
        even, odd = self._jobs
        return even.numbers, odd.numbers, watch_lines.address(even.numbers)

    def begin(self, network: Network) -> set[tuple[int, int]]:
        """Check the start, to which the jobs of even parity lead.

        Returns lines that meet at a point or body and lie in each other there, by a narrow angle: these are not
        reported.
        """
        watch_lines(self._jobs[0].numbers)
        lines = list(network.lines.values())
        ends = [{network.body_of(p) or p for p in (x.start, x.end)} for x in lines]
        return {(a, b) for a, b, *_ in self.met() if any(x is y or x == y for x in ends[a] for y in ends[b])}

    def met(self) -> list[tuple[int, int, float, float, float]]:
        """Lines that have met, two each: numbers, when (s), and at which arc lengths (m)."""
        return [(a, c, *row[[TIME, AT, OTHER]].tolist()) for a, c, row in self._that_have(MET)]

    def near(self) -> list[tuple[int, int, float, float]]:
        """Lines that are near each other, and contact begins, two each: numbers, and at which arc lengths (m)."""
        return [(a, c, *row[[AT, OTHER]].tolist()) for a, c, row in self._that_have(NEAR)]

    def _that_have(self, has: int) -> Iterator[tuple[int, int, Floats]]:
        """Numbers of lines, two each, that have met, or are near, and the row of what is known of that."""
        for k in np.flatnonzero(self._pairs[:, HAVE_MET] == has).tolist():
            a, c = self._pairs[k, :2].tolist()
            yield a, c, self._room[k]
