"""What may be said of a result: a limit is within or broken, an accuracy met or missed, else it is *not verified*.

The only place that decides this: terminal, `stats`, reports, studies, the live view and Python all ask here.  A limit
is within, and an accuracy met, by values that are resolved, whose error is estimated, and from which nothing was
neglected.  What is not verified has its reason, and the one thing to do.

A value beyond its limit breaks it whatever its error: cells that are too long, and bending that is neglected, make
bends too mild.  Only the kink of a joint that counts as a bend makes them too sharp.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from collections.abc import Set as AbstractSet
from functools import partial
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from hybrid.errors import AS_MUCH, EVENTS_BY_WEIGHT, IN_SPACE, KINK_COUNTS, OF_AN_END
from hybrid.store.capacity import bound_of_steps, bound_with_errors, code_of_steps, code_with_errors, shows_ends
from hybrid.store.envelope import (
    BROKEN,
    GROUP,
    LIMITED,
    NOT_VERIFIED,
    WITHIN,
    Judged,
    limits_of,
    not_verified,
    with_partner,
)
from hybrid.store.limits import SHOWS, Held, extreme_errors, held_of, needs_moments
from hybrid.store.records import Event, not_converged_in
from hybrid.store.stored_result import StoredResult

Floats = np.ndarray
MET, MISSED = "met", "missed"
# Quantities that follow from each other.
BENDING = frozenset({"curvature", "bending_moment", "von_mises"})
PULL = frozenset({"tension", "wall_tension", "von_mises", "end_force"})
TORQUE = frozenset({"torque", "von_mises"})
EVERY = frozenset({"position", "tension", "end_force", "curvature"})  # asked, by files that do not say of what
ALL: frozenset[str] = frozenset()
NOTE = "do what its note says"
SHORTER = "a shorter time.step"
KINK_REMEDY = "a border of the zones elsewhere, or model: rod"
SETTLED = "initial: {kind: equilibrium, friction: settled}"
# Kinds of events that make values doubtful: which of them (ALL: every one), and what to do.
Doubtful = Mapping[str, tuple[frozenset[str], str]]
DOUBTS: Doubtful = {
    "gains energy": (ALL, SHORTER),
    "implausible": (ALL, "check the units that the note names"),
    "slack line as rods": (BENDING, "give bending_stiffness"),
    "error uncertain": (ALL, NOTE),
    "several equilibria": (ALL, "initial.points near the equilibrium that is meant"),
    "largest force uncertain": (PULL, "a longer run, or several seeds"),
    "end force between outputs": (PULL, "the output.every of its note"),
    "line meets itself": (ALL, "contact: {self: true}"),
    "lines pass through each other": (ALL, "contact: {between: [[a, b]]}"),
    "bodies overlap": (ALL, "bodies that stay apart"),
    "contact given up": (ALL, "cells as short as its note says"),
    "slack": (BENDING | PULL, "model: rod, or force_rod there"),
    "unstable": (ALL, NOTE),
    "out of plane": (ALL, "dimension: 3"),
    "unresolved twist": (TORQUE, "more mesh.cells"),
    "unresolved bend": (BENDING, "cells as short as its note says"),
    "unresolved slack bend": (BENDING, "cells as short as its note says"),
    "kink at joint": (BENDING, KINK_REMEDY),
    "unresolved change of section": (BENDING, "accuracy: {curvature: 5%}, with model: rod"),
    "deep in the seabed": (ALL, "check seabed.stiffness, in N/m per m"),
    "deep in an obstacle": (ALL, "a larger stiffness of the obstacle, or more cells"),
    "unresolved contact": (ALL, "cells as short as its note says"),
    "numerical dissipation": (ALL, SHORTER),
    "vibrations damped": (ALL, "a time.step that follows them"),
    "snap": (PULL, "give axial_stiffness"),
    "coarse step": (ALL, "the time.step of its note"),
    "iterations cut": (ALL, SHORTER),
    "torque neglected": (TORQUE, "model: rod"),
    "undamped": (PULL, "time.rho_inf: 0.9"),
    "model error not estimated": (ALL, "model: rod"),
    "bending at clamp neglected": (BENDING, "model: rod, or force_rod there"),
    "bending at point load neglected": (BENDING, "model: rod, or force_rod there"),
    "ignored": (BENDING, "model: rod"),
    "envelope incomplete": (ALL, "compute it anew"),
    # of an equilibrium, and of the largest force of a motion that begins there
    "static friction neglected": (PULL, SETTLED),
}
# Of an accuracy alone: nobody estimates a limit by windows.
OF_ACCURACY: Doubtful = {"windows uncertain": (ALL, NOTE)}
ESTIMATE = "`accuracy: 5%`, or `output: {errors: true}`, in the scene"
FINER = "compare with a run of half the time.step and twice the mesh.cells"
RESUME = "hybrid resume"


class Doubt(NamedTuple):
    """Why a value is not verified, and the one thing to do."""

    why: str
    remedy: str

    @property
    def text(self) -> str:
        """In words."""
        return not_verified(self.why, self.remedy)


class Asked(NamedTuple):
    """An accuracy that was asked for: `quantity` in words, the error and the one asked in `unit` (None: not known).

    verdict: met, missed or not verified, then with the reason and what to do.
    """

    quantity: str
    unit: str
    asked: float | None
    error: float | None
    verdict: str
    why: str = ""
    remedy: str = ""
    beside: str = ""  # what is not asked, although its error is large

    @property
    def text(self) -> str:
        """The verdict in words."""
        found = not_verified(self.why, self.remedy) if self.verdict == NOT_VERIFIED else self.verdict
        return f"{found}; {self.beside}" if self.beside else found


class Verdicts(NamedTuple):
    """All that may be said of a result, or of a line of several."""

    limits: list[Judged]  # of sections
    quantities: list[Held]  # of named quantities, and of the stress of pipes
    accuracy: list[Asked]

    @property
    def words(self) -> dict[str, str]:
        """The verdict of each by its name: key of the limit, name and limit of a quantity, what was asked."""
        found = {x.limit: x.verdict for x in self.limits}
        found |= {f"{x.name} {x.limit}": x.verdict for x in self.quantities}
        return found | {f"accuracy of {x.quantity}": x.verdict for x in self.accuracy}


def verdicts_of(result: StoredResult) -> Verdicts:
    """What may be said of a result: of its limits, and of the accuracy that was asked for."""
    return Verdicts(section_limits(result), quantity_limits(result), asked_accuracy(result))


def section_limits(result: StoredResult) -> list[Judged]:
    """Every limit of bend radius and tension of the sections, where it was broken most or nearly, with its verdict."""
    found = [_verified(result, x) for x in map(partial(with_partner, result), limits_of(result, result))]
    named = {x.limit for x in found}
    for name, limits in LIMITED.items():
        for limit in limits if name != "von_mises" else ():
            if limit in result and limit not in named and not np.isnan(result[limit]).all():
                named.add(limit)
                k = int(np.nanargmax(np.isfinite(result[limit])))
                lacking = Judged(limit, np.nan, float(result[limit][k]), None, False, float(result.s[k]), np.nan)
                doubt = unfinished(result) or Doubt(f"the result has no {name} there", f"output.fields with {name}")
                if limit == "max_contact_force":
                    doubt = unfinished(result) or Doubt("no contact is computed", "obstacles, contact or a seabed")
                found.append(lacking._replace(verdict=NOT_VERIFIED, why=doubt.why, remedy=doubt.remedy))
    return found


def quantity_limits(result: StoredResult) -> list[Held]:
    """Every limit of a named quantity and of the stress of pipes, likewise."""
    return [_held(result, x) for x in held_of(result)]


def asked_accuracy(result: StoredResult) -> list[Asked]:
    """The accuracy that was asked for, by quantity; empty where none was.  Files before 1.0 have one for all."""
    each = json.loads(str(result.attributes.get("accuracy_verdicts", "[]")))
    beside = str(result.attributes.get("accuracy_not_asked", ""))
    if each:
        of = [
            _asked(
                result, {x.get("of", x["quantity"])}, x["quantity"], x["unit"], x["asked"], x["error"], "by_chance" in x
            )
            for x in each
        ]
        known = [x for x in of if x.error is not None and x.asked]
        if known and _missed(result) and not any(x.verdict == MISSED for x in of):  # by what only all of it shows
            k = of.index(max(known, key=lambda x: (x.error or 0.0) / (x.asked or 1.0)))
            of[k] = of[k]._replace(verdict=MISSED, why="", remedy="")
        return [*of[:-1], of[-1]._replace(beside=beside)]
    if "accuracy_asked" not in result.attributes:
        return []
    largest = result.attributes.get("error_total_position")
    text, names = (str(result.attributes.get(x, "")) for x in ("accuracy_asked", "accuracy_quantities"))
    return [_asked(result, set(names.split(",")) - {""}, text, "", None, largest)._replace(beside=beside)]


def worst_accuracy(each: Sequence[Asked]) -> Asked:
    """Of what was asked the worst: missed, else not verified, else met."""
    return min(each, key=lambda x: (MISSED, NOT_VERIFIED, MET).index(x.verdict))


def accuracy_text(each: Sequence[Asked]) -> str:
    """The verdicts of all that was asked in words: one for all, or by quantity where they differ."""
    named: dict[str, list[str]] = {}
    for x in each:
        name = x.quantity.replace("end_force_", "force at the ").replace("_", " ")
        named.setdefault(x._replace(beside="").text, []).append(name)
    if len(named) == 1:
        text = next(iter(named))
        return f"{text}; {each[-1].beside}" if each[-1].beside else text
    parts = [f"{', '.join(x[:-1])} and {x[-1]} {text}" if x[1:] else f"{x[0]} {text}" for text, x in named.items()]
    return "; ".join([*parts, *([each[-1].beside] if each[-1].beside else [])])


def doubt_of(result: StoredResult, *names: str, s: Iterable[float] = ()) -> Doubt | None:
    """Why quantities of a result are not verified; None: they are resolved, estimated and not neglected.

    s: m, the only places that count; none: all of them.
    """
    return unfinished(result) or next(_doubts(result, frozenset(names), np.array([*s])), None)


def unfinished(result: StoredResult) -> Doubt | None:
    """That a run has not come to its end."""
    if result.status == "complete":
        return None
    reached = f" (t = {float(result.times[-1]):.5g} s)" if len(result.times) else ""
    return Doubt(f"the run has not come to its end{reached}", RESUME)


def _pending(result: StoredResult) -> Doubt | None:
    """That the errors of a result are still to come."""
    what, _, fix = result.pending.partition("; ")
    return Doubt(what, fix.removesuffix(" makes up for it")) if what else None


# ---- doubts ---------------------------------------------------------------------------------------


def _doubts(
    result: StoredResult, names: frozenset[str], s: Floats, more: Doubtful = MappingProxyType({})
) -> Iterator[Doubt]:
    """What makes quantities doubtful, the worst first: events, errors that are not known; more: kinds beside DOUBTS."""
    kinds, unknown = {**DOUBTS, **more}, not_converged_in(result.attributes)
    rank = {kind: k for k, kind in enumerate(EVENTS_BY_WEIGHT)}
    for event in sorted(result.events, key=lambda e: (rank.get(e.kind, len(rank)), e.t)):
        if event.kind not in kinds or _is_harmless(event) or (unknown and AS_MUCH in event.text):
            continue  # the last: of named quantities alone, below
        if (found := _of_event(result, event, kinds[event.kind], names, s)) is not None:
            yield found
    for name in sorted(names - {"torque", "von_mises", "wall_tension", "contact_force"}):
        if name in unknown:
            yield Doubt(f"the error of {_words(name)} is not known: it does not converge", "shorter steps and cells")
        elif not all(map(partial(_has_error, name), result.lines.values() or [result])):
            why = f"the error of {_words(name)} is not estimated"
            yield _pending(result) or Doubt(why, ESTIMATE)


def _has_error(name: str, line: StoredResult) -> bool:
    """Whether an error of a quantity was estimated of a line."""
    return f"error_total_{name}" in line.attributes or f"errors/total/{name}" in line


def _of_event(
    result: StoredResult, event: Event, kind: tuple[frozenset[str], str], names: frozenset[str], s: Floats
) -> Doubt | None:
    """The doubt that an event of a kind (as in DOUBTS) casts on quantities at places s (n,) m; None: none."""
    which, remedy = kind
    if remedy == SETTLED and "settled" not in event.text:
        remedy = NOTE
    elif remedy == SETTLED and (result.line_name or result.lines):
        remedy = f"lines.{result.line_name or 'NAME'}.{SETTLED}"
    if event.kind == "unresolved bend" and _is_catenary(result, event):
        which = which | PULL  # what a catenary cuts off of a bend is missing in its tension
    if which and not which & names:
        return None
    length = float(result.s[-1] - result.s[0])
    reach = 1e-6 * length
    if s.size and which == BENDING and not ((s >= event.s_a - reach) & (s <= event.s_b + reach)).any():
        return None
    everywhere = event.s_b - event.s_a >= length - reach
    place = f"s = {event.s_a:.5g} m" if event.s_a == event.s_b else f"s = {event.s_a:.5g} to {event.s_b:.5g} m"
    return Doubt(event.kind + ("" if everywhere else f" at {place}"), remedy)


def _is_harmless(event: Event) -> bool:
    """Whether an event of a kind that casts doubts is of one of its cases that do not."""
    if event.kind == "ignored":
        return not event.text.startswith(OF_AN_END)
    return event.kind == "out of plane" and IN_SPACE in event.text


def _is_catenary(result: StoredResult, event: Event) -> bool:
    """Whether a line is a catenary where an event is, and when."""
    if not len(result.times):
        return False
    zones = result.zones[int(np.abs(result.times - event.t).argmin())]
    return any(zone.kind != "rod" for zone in zones if zone.s_a <= event.s_a <= zone.s_b)


def _words(name: str) -> str:
    return {"end_force": "end forces"}.get(name, name.replace("_", " "))


# ---- limits ---------------------------------------------------------------------------------------


def _verified(result: StoredResult, x: Judged) -> Judged:
    """A limit of the sections with its verdict."""
    name = next(name for name, limits in LIMITED.items() if x.limit in limits)
    if x.broken:
        if (doubt := _too_sharp(result, {name}, x.t)) is None:
            return x._replace(verdict=BROKEN)
        return x._replace(verdict=NOT_VERIFIED, broken=False, why=doubt.why, remedy=doubt.remedy, used=None)
    s, allowed = result.both_sides(x.limit) if f"right/{x.limit}" in result else (result.s, result[x.limit])
    held = s[np.isfinite(allowed)]
    # at a clamp or joint of the mesh that no output point shows, limits are those of the envelope
    if f"{GROUP}/{x.limit}" in result:
        held = np.append(held, result[f"{GROUP}/s"][np.isfinite(result[f"{GROUP}/{x.limit}"])])
    if x.limit == "max_contact_force":
        doubt = unfinished(result) or next(_doubts(result, frozenset({"contact_force"}), held), None)
        doubt = doubt or _pressed(result, x)
    else:
        doubt = doubt_of(result, name, s=held) or _reached(result, name, x)
    if doubt is None:
        return x._replace(verdict=WITHIN)
    return x._replace(verdict=NOT_VERIFIED, why=doubt.why, remedy=doubt.remedy, used=None)


def _pressed(result: StoredResult, x: Judged) -> Doubt | None:
    """That the error of a contact force over all steps is not known, or may take it beyond its limit."""
    error = extreme_errors(result).get(x.limit)
    if error is None:
        return Doubt("errors of contact forces are not estimated", FINER)
    return None if x.value / x.allowed + error <= 1.0 else Doubt("with its error it may pass the limit", FINER)


def _too_sharp(result: StoredResult, names: AbstractSet[str], t: float) -> Doubt | None:
    """That a kink of a joint, which is no bend, may be what takes quantities beyond their limit at t (s)."""
    kinks = [event for event in result.events if event.kind == "kink at joint" and KINK_COUNTS in event.text]
    counts = BENDING & names and any(event.t <= t for event in kinks)
    return Doubt("kink at joint", KINK_REMEDY) if counts else None


def _reached(result: StoredResult, name: str, x: Judged) -> Doubt | None:
    """That values are so near to their limit that their errors may take them beyond, at outputs or over all steps."""
    s, errors = result.both_sides(f"errors/total/{name}")
    _, values = result.both_sides(name)
    allowed = _along(result, x.limit, s)
    at = int(np.abs(result.times - x.t).argmin()), int(np.abs(s - x.s).argmin())
    value = 1.0 / x.value if name == "curvature" and x.value > 0.0 else x.value
    least = abs(x.allowed) if x.limit == "min_tension" else 0.0
    there = _shown(result, x.s) and (len(result.times) > 1 or _near(value, values[0], s, x.s, least))
    if not there and len(result.times) == 1:
        return Doubt(f"the error of {_words(name)} at s = {x.s:.5g} m is not estimated", THAT_PLACE)
    here = _size(x, x.allowed, value, errors[at] if there else 0.0)
    if len(result.times) > 1:
        over_steps = extreme_errors(result).get(x.limit)
        if over_steps is None:
            return Doubt(f"the error of {_words(name)} over all steps is not estimated", ESTIMATE)
        here = np.maximum(here, _size(x, x.allowed, value, 0.0) + over_steps)
    most = float(np.nanmax(np.append(_size(x, allowed, values, errors), here)))
    if most <= 1.0:
        return None
    k = np.unravel_index(int(np.nanargmax(_size(x, allowed, values, errors))), values.shape)
    place = f"s = {float(s[k[1]]):.5g} m" if not here >= most else f"s = {x.s:.5g} m"
    return Doubt(f"with its error {_words(name)} may pass the limit at {place}", "a smaller accuracy")


THAT_PLACE = "`output.points` with that place"


def _shown(result: StoredResult, s: float) -> bool:
    """Whether a place, m, is between output points, whose errors are known."""
    near = 1e-9 * abs(float(result.s[-1]))
    return float(result.s[0]) - near <= s <= float(result.s[-1]) + near


def _near(value: float, values: Floats, s: Floats, at: float, least: float = 0.0) -> bool:
    """Whether output points beside a place, m, of an equilibrium have nearly its value: their errors are its own."""
    k = np.searchsorted(s, at)
    beside = values[max(k - 1, 0) : k + 1]
    return bool((np.abs(beside - value) <= SHOWS * max(abs(value), least)).any())


def _size(x: Judged, allowed: Floats | float, values: Floats | float, errors: Floats | float) -> Floats:
    """What of a limit may be used at most, more than 1 where it may be broken."""
    if x.limit == "min_tension":
        return np.asarray(1.0 + np.asarray(allowed) - (np.asarray(values) - errors))
    if x.limit == "min_bend_radius":
        return np.asarray((np.asarray(values) + errors) * allowed)
    return np.asarray((np.asarray(values) + errors) / allowed)


def _held(result: StoredResult, x: Held) -> Held:
    """A limit of a quantity with its verdict."""
    if x.broken:
        if (doubt := _too_sharp(result, _names_of_held(result, x), x.t)) is None:
            return x._replace(verdict=BROKEN)
        return x._replace(verdict=NOT_VERIFIED, broken=False, why=doubt.why, remedy=doubt.remedy)
    doubt = unfinished(result) or _doubt_of_held(result, x)
    if doubt is None:
        return x._replace(verdict=WITHIN)
    return x._replace(verdict=NOT_VERIFIED, why=doubt.why, remedy=doubt.remedy)


def _names_of_held(result: StoredResult, x: Held) -> frozenset[str]:
    """The quantities that a quantity with a limit follows from."""
    name = {"N": "end_force", "deg": "end_force"}.get(x.unit, "position")
    bends = {"curvature"} if x.limit != "code" or needs_moments(result) else set()  # a mooring line goes by tension
    along = {"Pa": {"von_mises", "tension", "curvature"}, "%": {"tension"} | bends}
    return frozenset(along.get(x.unit, {name}))


def _doubt_of_held(result: StoredResult, x: Held) -> Doubt | None:
    """Of a force at an end, an angle of it, or a clearance the error follows from those that are estimated."""
    if np.isnan(x.value):
        return Doubt("it had no value at any time", "check that it can have one, such as a touchdown point")
    clearance = f"{x.name}_at" in result
    if (doubt := next(_doubts(result, _names_of_held(result, x), np.zeros(0)), None)) is not None:
        return doubt
    if x.by_outputs or x.bound is not None:
        most = "not known" if x.bound is None else f"known to be at most {x.bound:.4g} {x.unit} alone"
        remedy = "a shorter output.every" if len(result.times) > 1 else "more output.points, from end to end"
        return Doubt(f"its values between outputs are {most}", remedy)
    if x.unit == "%":
        bound = _part_with_errors(result, x)
        if bound is None:
            return Doubt(f"the error of {x.name} is not estimated", FINER)
        why = f"with the errors of tension and {'moment' if x.limit == 'code' else 'curvature'} it may pass the limit"
        return None if bound <= 1.0 else Doubt(why, "a smaller accuracy")
    errors = extreme_errors(result)
    over_steps = errors.get(x.limit if x.unit == "Pa" else f"{x.name} {x.limit}")
    if over_steps is None and len(result.times) > 1:
        return Doubt(f"the error of {x.name} over all steps is not estimated", FINER if errors else ESTIMATE)
    if x.unit == "Pa":
        return _stress_reached(result, x, over_steps or 0.0)
    at_outputs = _error_of_held(result, x, clearance)
    if over_steps is None and at_outputs is None:
        return Doubt(f"the error of {x.name} is not estimated", FINER)
    error = max(over_steps or 0.0, at_outputs or 0.0)
    left = x.value - x.allowed if x.limit == "smallest" else x.allowed - x.value
    return None if error <= left else Doubt(f"its error may be {error:.2g} {x.unit}", "a smaller accuracy")


def _part_with_errors(result: StoredResult, x: Held) -> float | None:
    """The part of a capacity or code that nothing exceeds, whatever its errors are, at outputs and over all steps."""
    bound = code_with_errors(result) if x.limit == "code" else bound_with_errors(result)
    if bound is None or len(result.times) == 1:
        return bound if shows_ends(result) else None
    errors = extreme_errors(result)
    if x.limit == "code":
        steps = code_of_steps(result, errors)
    elif "tension" in errors and "curvature" in errors:
        steps = bound_of_steps(result, (errors["tension"], errors["curvature"]))
    else:
        steps = None
    return None if steps is None else max(bound, steps)


def _stress_reached(result: StoredResult, x: Held, over_steps: float) -> Doubt | None:
    """That the errors of tension and curvature may take the stress of a pipe beyond its limit.

    over_steps: error of its largest value over all steps, as a part of the limit.
    """
    if "stress_per_tension" not in result:
        return Doubt("the error of the stress is not estimated", FINER)
    s, stress = result.both_sides("von_mises")
    error = np.zeros(stress.shape)
    for name in ("tension", "curvature"):
        error += result.both_sides(f"errors/total/{name}")[1] * _along(result, f"stress_per_{name}", s)
    used = (stress + error) / _along(result, "max_stress", s)
    at = int(np.abs(result.times - x.t).argmin()), int(np.abs(s - (x.s or 0.0)).argmin())
    place = x.s or 0.0
    there = _shown(result, place) and (len(result.times) > 1 or _near(x.value, stress[0], s, place))
    if not there and len(result.times) == 1:
        return Doubt(f"the error of the stress at s = {place:.5g} m is not estimated", THAT_PLACE)
    here = x.value + error[at] if there else 0.0
    if max(float(np.nanmax(used)), here / x.allowed, x.value / x.allowed + over_steps) <= 1.0:
        return None
    return Doubt("with the errors of tension and curvature it may pass the limit", "a smaller accuracy")


def _along(result: StoredResult, name: str, s: Floats) -> Floats:
    """What is constant along the line at the places s (n,) m of quantities, of which one that jumps comes twice."""
    found = result.both_sides(name)[1] if f"right/{name}" in result else np.asarray(result[name])
    return found if found.size == s.size else found[np.searchsorted(result.s, s)]


def _error_of_held(result: StoredResult, x: Held, clearance: bool) -> float | None:
    """The error of a quantity in its unit, by those of positions or end forces; None: it is not known."""
    figures = result.attributes
    force = float(figures.get("error_total_end_force", np.nan))
    if x.unit == "N":
        return force
    if x.unit == "deg":
        sizes = [np.linalg.norm(result[y], axis=1) for y in ("reaction_start", "reaction_end") if y in result]
        least = min((float(y.min()) for y in sizes), default=0.0)
        return float(np.degrees(np.arcsin(force / least))) if force < least else None
    if len(result.times) == 1 and not all(map(shows_ends, [*result.lines.values()] or [result])):
        return None
    if x.unit == "m" and clearance:  # of two lines the errors of both
        both, error = 2.0 if result.lines else 1.0, float(figures["error_total_position"])
        if len(result.times) > 1:
            return both * error
        chords = [_off_chords(line) for line in result.lines.values() or [result] if f"{GROUP}/curvature_max" in line]
        # places that stay, whose errors are 0, are not those that it is about
        return both * (error + max(chords)) if error > 0.0 and chords else None
    return None


def _off_chords(line: StoredResult) -> float:
    """How far a line is off the chords of its mesh, m, at most."""
    bends = line[f"{GROUP}/curvature_max"]
    return float(np.nanmax(np.diff(line[f"{GROUP}/s"]) ** 2 * np.maximum(bends[:-1], bends[1:]), initial=0.0)) / 8.0


# ---- accuracy -------------------------------------------------------------------------------------


def _missed(result: StoredResult) -> bool:
    """Whether a run said that it misses what was asked."""
    return any(event.kind == "accuracy missed" for event in result.events)


def _asked(
    result: StoredResult,
    names: set[str],
    quantity: str,
    unit: str,
    asked: float | None,
    error: float | None,
    chance: bool = False,
) -> Asked:
    """The verdict on an accuracy; names: the quantities that it is of, none: not known, and every doubt counts.

    chance: whether the largest value of the quantity is by chance, so that its error misses nothing.
    """

    def of(verdict: str, why: str = "", remedy: str = "") -> Asked:
        return Asked(quantity, unit, asked, error, verdict, why, remedy)

    if error is None:
        return of(NOT_VERIFIED, *(unfinished(result) or _pending(result) or Doubt("its error is not estimated", NOTE)))
    if error > asked and not chance if asked is not None else _missed(result):
        return of(MISSED)
    of_ends = {x for x in names if x.startswith("end_force")}
    doubted = frozenset(names - of_ends | ({"end_force"} if of_ends else set()) or EVERY)
    doubt = unfinished(result) or next(_doubts(result, doubted, np.zeros(0), OF_ACCURACY), None)
    return of(MET) if doubt is None else of(NOT_VERIFIED, *doubt)
