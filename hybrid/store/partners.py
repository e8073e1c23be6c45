"""What presses on a line by its name: obstacles, other lines, the line itself, and with what force.

Outputs have the forces by partner (outputs.obstacle_forces, outputs.line_forces), without friction.  The envelope has
the largest force per length of every step by kind of partner alone; the name is found at the outputs beside it.
Where contact began by itself, outputs have no such forces, and partners are those that events name.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from hybrid.store.stored_result import StoredResult

OBSTACLES, LINES, ITSELF = "obstacles", "contacts", "the line itself"
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
    if result.whole is None:
        return ITSELF
    whole, name = result.whole
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
