"""Extremes and limits of a result: over every accepted step where the file has its envelope, and over its outputs.

An envelope is of nodes, where a tension is the mean of two cells: an output between nodes, or on one side of a point
load, may lie beyond it.  Limits are held against both.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple, Protocol

import numpy as np

from hybrid.store.stored_result import StoredResult

# Names in the file: the group, its places (m), and the times (s) between which all accepted steps count.
GROUP = "envelope"
SCALE = f"{GROUP}/s"
BEGIN = f"{GROUP}/begin"
END = f"{GROUP}/end"
# What limits are held against.
_HELD = [("min_bend_radius", "curvature", "max"), ("max_tension", "tension", "max"), ("min_tension", "tension", "min")]
_HELD += [("max_contact_force", x, "max") for x in ("contact", "self_contact", "obstacle_contact")]
# Which limits there are of quantities that outputs may have beyond their envelope.
LIMITED: dict[str, tuple[str, ...]] = dict.fromkeys(("contact", "self_contact"), ("max_contact_force",))
LIMITED |= {"curvature": ("min_bend_radius",), "von_mises": ("max_stress",), "tension": ("max_tension", "min_tension")}
# What presses on the line, by the quantity that has its force per length.
PARTNERS = {"contact": "the seabed", "self_contact": "the line itself or another", "obstacle_contact": "an obstacle"}
# Of limits not in N.
UNITS = {"min_bend_radius": "m", "max_contact_force": "N/m", "max_stress": "Pa", "capacity": "%", "code": "%"}
# Of the largest tension: what is below is what the solver's tolerance leaves of a force of zero, as at a free end.
NOTHING = 1e-6
# Part of a line over which an extreme is the same to round-off (NOTHING) from which on its place is that range: as of
# the tension of what lies on a flat bed without friction.
PLATEAU = 0.1
# Verdicts on limits: `verdicts` decides which.
WITHIN = "within"
BROKEN = "broken"
NOT_VERIFIED = "not verified"
# Part of a value by which an output at a node may differ from that of its step: sums in another order.
SAME = 1e-12


class Arrays(Protocol):
    """Arrays by name: a result, or what is about to be written."""

    def __contains__(self, name: object, /) -> bool: ...

    def __getitem__(self, name: str, /) -> np.ndarray: ...


class Recorded(Arrays, Protocol):
    """What is known of a line: a result, or one that is being written; quantities that grow come as rows."""

    def rows_of(self, *names: str) -> Iterator[tuple[np.ndarray, ...]]:
        """Rows (n, ...) of quantities over the outputs, so many at a time."""
        ...


class Extreme(NamedTuple):
    """A value, where (s, m) and when (t, s); side: -1 or 1, before or after a place with two values, else 0.

    over: m, the range about s in which the value is the same to round-off, where that is a part of the line.
    """

    value: float
    s: float
    t: float
    side: int
    over: tuple[float, float] | None = None


class Judged(NamedTuple):
    """How near the cable came to a limit of its sections: where its limit was broken most, or nearly.

    limit: its key in the scene; value, allowed: m, N, N/m; used: part of what is allowed, None for a smallest tension,
    and where it is not verified; s: m; t: s.  verdict: within, broken, or not verified, and then why, and the one thing
    to do; "" before `verdicts` has decided.  partner: of a contact force what presses, "" of other limits.
    """

    limit: str
    value: float
    allowed: float
    used: float | None
    broken: bool
    s: float
    t: float
    verdict: str = ""
    why: str = ""
    remedy: str = ""
    partner: str = ""

    @property
    def margin(self) -> float:
        """What is left of what is allowed: a part of it, of a smallest tension in N; negative where it is broken.

        NaN: not verified.
        """
        if self.verdict == NOT_VERIFIED:
            return np.nan
        return self.value - self.allowed if self.used is None else 1.0 - self.used

    @property
    def text(self) -> str:
        """What was reached, and what is allowed."""
        unit = UNITS.get(self.limit, "N")
        what = {"m": "bend radius", "N": "tension"}.get(unit, f"contact force of {self.partner}")
        most = self.limit.startswith("max")
        if self.verdict == NOT_VERIFIED:
            side = "at most" if most else "at least"
            allowed = f"{self.allowed:.4g} {unit} allowed {side} ({self.limit})"
            return f"{what} of {self.value:.4g} {unit}, {allowed}"
        side = "above" if most else "below"
        if not self.broken:
            side = "within"
        return f"{what} of {self.value:.4g} {unit}, {side} the {self.allowed:.4g} {unit} allowed ({self.limit})"

    @property
    def not_verified(self) -> str:
        """That it is not verified, why, and what to do; "" of what is."""
        return not_verified(self.why, self.remedy) if self.verdict == NOT_VERIFIED else ""

    @property
    def ending(self) -> str:
        """The same behind a text, with what divides them."""
        return f"; {self.not_verified}" if self.verdict == NOT_VERIFIED else ""


def not_verified(why: str, remedy: str) -> str:
    """In words, as everything says it that shows a verdict."""
    return f"{NOT_VERIFIED}: {why}; try: {remedy}"


def has_envelope(result: StoredResult) -> bool:
    """Whether a result has its envelope: files of 0.6 and runs killed early have none."""
    return END in result and bool(np.isfinite(result[END]))


def stored_window(result: StoredResult) -> str:
    """Over which time a result was stored: outputs and steps, and extremes of nodes and steps if that differs."""
    t = result.times
    if not len(t):
        return "no output"
    text = f"t = {t[0]:.9g} to {t[-1]:.9g} s"
    end = float(result[END]) if has_envelope(result) else float(t[-1])
    if abs(end - t[-1]) <= 1e-9 * abs(end):
        return text
    return f"{text}, extremes of all nodes and steps to {end:.9g} s"


def extreme(values: Arrays, name: str, bound: str) -> Extreme | None:
    """The lowest ("min") or highest ("max") value of a quantity of the envelope over all places; None: it has none."""
    full = f"{GROUP}/{name}_{bound}"
    if full not in values or not np.isfinite(values[full]).any():
        return None
    x = values[full]
    k = int(np.nanargmin(x) if bound == "min" else np.nanargmax(x))
    s = values[SCALE]
    other = ~(np.abs(x - x[k]) <= NOTHING * float(np.nanmax(np.abs(x))))
    first, last = (s[np.flatnonzero(part) + shift] for part, shift in ((other[:k], 1), (other[k:], k - 1)))
    over = float(first[-1] if len(first) else s[0]), float(last[0] if len(last) else s[-1])
    wide = over[1] - over[0] > PLATEAU * (s[-1] - s[0])
    side = int(k > 0 and s[k - 1] == s[k]) - int(k + 1 < len(s) and s[k + 1] == s[k])
    when = float(values[f"{GROUP}/{name}_t_{bound}"][k])
    return Extreme(float(x[k]), float(s[k]), when, side, over if wide else None)


def extremes_of_outputs(values: Recorded, name: str) -> dict[str, np.ndarray]:
    """Extremes of a field (t, s) over the outputs, and its limits, by the names and in the form of an envelope."""
    s, right = values["s"], f"right/{name}"
    jumps = values["right/s"] if right in values else np.zeros(0)
    behind = np.searchsorted(s, jumps) + 1
    places = np.insert(s, behind, jumps)
    low, high, first, last = (np.full(places.size, x) for x in (np.inf, -np.inf, np.nan, np.nan))
    for t, x, *more in values.rows_of("t", name, *[right] * bool(jumps.size)):
        if not len(t):
            continue
        x = np.insert(x, behind, more[0], axis=1) if more else x
        for bound, when, sign in ((low, first, 1.0), (high, last, -1.0)):
            row = np.where(np.isfinite(x), sign * x, np.inf).argmin(axis=0)
            found = x[row, np.arange(places.size)]
            better = sign * found < sign * bound
            bound[better], when[better] = found[better], t[row][better]
    out = {SCALE: places}
    for word, bound, when in (("min", low, first), ("max", high, last)):
        out[f"{GROUP}/{name}_{word}"] = np.where(np.isfinite(bound), bound, np.nan)
        out[f"{GROUP}/{name}_t_{word}"] = when
    for limit in LIMITED.get(name, ()):
        if limit in values:
            other = f"right/{limit}"
            beside = values[other] if other in values else values[limit][np.searchsorted(s, jumps)]
            out[f"{GROUP}/{limit}"] = np.insert(values[limit], behind, beside) if jumps.size else values[limit]
    return out


def limits_of(values: Recorded | None, envelope: Arrays) -> list[Judged]:
    """Every limit of bend radius, tension and contact force of sections, at its largest utilisation.

    Over an envelope and the outputs; where an output is a node of the envelope and no more than it, the node.
    """
    found = {x.limit: x for x in judged(envelope)}
    for name in LIMITED:
        if values is not None and name in values and any(limit in values for limit in LIMITED[name]):
            for x in judged(extremes_of_outputs(values, name)):
                known, near = found.get(x.limit), SAME * max(1.0, abs(x.value), abs(x.allowed))
                if known is None or x.margin < known.margin - near:
                    found[x.limit] = x
    return [found[limit] for limit in dict.fromkeys(limit for limit, _, _ in _HELD) if limit in found]


def farthest(result: Recorded, name: str, bound: str) -> Extreme | None:
    """As `extreme`, of the envelope and of the outputs."""
    known, shown = extreme(result, name, bound), extreme(extremes_of_outputs(result, name), name, bound)
    if known is None or shown is None:
        return known or shown
    more = shown.value - known.value if bound == "max" else known.value - shown.value
    return shown if more > SAME * abs(known.value) else known


def judged(values: Arrays) -> list[Judged]:
    """Every limit that the sections have, at the place of the envelope where the cable is worst off.

    A place without a value, on a reel to the end, is not judged; nor is a limit without any place that has one.
    """
    found: dict[str, Judged] = {}
    for limit, name, bound in _HELD:
        full = f"{GROUP}/{name}_{bound}"
        if f"{GROUP}/{limit}" not in values or full not in values:
            continue
        allowed, x, t = values[f"{GROUP}/{limit}"], values[full], values[f"{GROUP}/{name}_t_{bound}"]
        x = np.where(np.isfinite(x), x, np.nan)
        if np.isnan(allowed + x).all():
            continue
        worse = part_used(limit, x, allowed)
        most = NOTHING * float(np.nanmax(np.abs(x))) if limit == "min_tension" else 1.0
        k = int(np.nanargmax(worse))
        value, used = float(x[k]), None if limit == "min_tension" else float(worse[k])
        if limit == "min_bend_radius":
            value = 1.0 / value if value > 0.0 else np.inf
        broken = bool(worse[k] > most)
        partner, known = PARTNERS.get(name, ""), found.get(limit)
        place = float(values[SCALE][k])
        new = Judged(limit, value, float(allowed[k]), used, broken, place, float(t[k]), partner=partner)
        if known is None or new.margin < known.margin:
            found[limit] = new
    return list(found.values())


def part_used(limit: str, x: np.ndarray, allowed: np.ndarray) -> np.ndarray:
    """Part of a limit that extremes x use; of a smallest tension, N, by how much it is below."""
    if limit == "min_tension":
        return np.asarray(allowed - x)
    return np.asarray(x * allowed if limit == "min_bend_radius" else x / allowed)


def with_partner(result: StoredResult, x: Judged) -> Judged:
    """A limit of contact force with the name of what presses, where the result has it."""
    kinds = [name for name, partner in PARTNERS.items() if partner == x.partner]
    named = partner_of(result, kinds[0], x.t) if kinds else None
    return x._replace(partner=named) if named else x


def largest_contact(result: StoredResult) -> tuple[str, Extreme] | None:
    """What presses on the line most, and with what force per length (N/m); None: nothing is known to touch it."""
    each = {name: (farthest if name in result else extreme)(result, name, "max") for name in PARTNERS}
    known = [(name, x) for name, x in each.items() if x is not None and x.value > 0.0]
    if not known:
        return None
    name, most = max(known, key=lambda x: x[1].value)
    return partner_of(result, name, most.t) or PARTNERS[name], most


# What presses on a line by its name: obstacles, other lines, the line itself, and with what force.
#
# Outputs have the forces by partner (outputs.observation), without friction.  The envelope has
# the largest force per length of every step by kind of partner alone; the name is found at the outputs beside it.
# Where contact began by itself, outputs have no such forces, and partners are those that events name.

# Groups of these forces by kind of partner, and the partner's name where a line touches itself.
OBSTACLES = "obstacles"
LINES = "contacts"
ITSELF = "the line itself"
# Kinds of events, of the first contact of two lines and of a line with itself.
TOUCH = "lines touch"
TOUCHES_ITSELF = "line touches itself"


class Pressed(NamedTuple):
    """The largest forces of one partner over the outputs."""

    partner: str  # in words
    group: str  # of its values in the result
    force: float  # N, sum over all places
    t_force: float  # s
    contact: float  # N/m, per length
    t_contact: float  # s

    @property
    def text(self) -> str:
        """In words, but for the partner."""
        return f"at most {self.force:.5g} N in all, {self.contact:.5g} N/m"


def contacts_of(result: StoredResult) -> list[Pressed]:
    """What presses on a line at its outputs, or of all lines which press on each other; the largest force first."""
    found = []
    for group, partner in _groups(result).items():
        force, contact = (np.asarray(result[f"{group}/{key}"]) for key in ("contact_force", "contact"))
        if force.size and force.max() > 0.0:
            j, k, t = int(force.argmax()), int(contact.argmax()), result.times
            found.append(Pressed(partner, group, float(force[j]), float(t[j]), float(contact[k]), float(t[k])))
    return sorted(found, key=lambda x: -x.force)


def partner_of(result: StoredResult, quantity: str, t: float) -> str | None:
    """What presses most on a line about the time t (s), by a quantity of the envelope; None: not known by name."""
    if quantity == "obstacle_contact":
        return _most({x: y for x, y in _groups(result).items() if x.startswith(OBSTACLES)}, result, t)
    if quantity != "self_contact":
        return None
    if result.part_of is None:
        return ITSELF
    whole, name = result.part_of
    mine = [x for x in _groups(whole) if x.startswith(LINES) and name in x.split("/")[1:]]
    found = _most({x: _other(x, name) for x in mine}, whole, t) if mine else _touched(whole, name, t)
    if whole.file is not None:  # in memory they are one
        whole.close()
    return found


def meeting_text(a: str, b: str, s: float, other: float) -> str:
    """The text of the event of two lines that touch, at s (m) of a and other (m) of b."""
    return f"line {a} touches line {b}: at s = {s:.4g} m of {a}, s = {other:.4g} m of {b}"


def _touched(whole: StoredResult, name: str, t: float) -> str:
    """The lines that a line has touched up to the time t (s), in words; itself, where there is none."""
    soon = float(np.diff(whole.times).max(initial=0.0))  # an event is of the end of a step
    texts = [x.text for x in whole.events if x.kind == TOUCH and x.t <= t + soon]
    found = [
        f"line {x}"
        for x in whole.lines
        if any(y.startswith((f"line {name} touches line {x}: ", f"line {x} touches line {name}: ")) for y in texts)
    ]
    if not found or any(x.kind == TOUCHES_ITSELF and x.t <= t + soon for x in whole.lines[name].events):
        found.append(ITSELF)
    return " or ".join(found)


def _most(groups: dict[str, str], result: StoredResult, t: float) -> str | None:
    """Of partners in words, by where their values are, the one that presses most at the outputs about t (s)."""
    if len(groups) == 1:
        return next(iter(groups.values()))
    at = int(np.abs(result.times - t).argmin()) if len(result.times) else 0
    most = {x: np.asarray(result[f"{x}/contact"])[max(at - 1, 0) : at + 2].max(initial=0.0) for x in groups}
    best = max(most, key=lambda x: most[x], default="")
    return groups[best] if best and most[best] > 0.0 else None


def _groups(result: StoredResult) -> dict[str, str]:
    """Partners in words, by where their values are."""
    found = {}
    for full in result.names:
        group, _, key = full.rpartition("/")
        kind, *names = group.split("/")
        if key != "contact":
            continue
        if kind == OBSTACLES:
            found[group] = f"obstacle {names[0]}"
        elif kind == LINES:
            a, b = names
            found[group] = f"lines {a} and {b}" if a != b else f"line {a} and itself"
    return found


def _other(group: str, name: str) -> str:
    """In words, what a line touches by a pair of lines."""
    a, b = group.split("/")[1:]
    other = b if a == name else a
    return ITSELF if other == name else f"line {other}"
