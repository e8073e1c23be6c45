"""A result in numbers and plain sentences: warnings, tension, bends, slack, torque, seabed, errors, status.

`facts_of(result)` reads every output and every grid point, with both values where a quantity jumps, whatever a page
later draws of them.  A fact has a weight:
"alarm", a limit is broken or a warning was given; "note", worth knowing; "plain"; "absent", with the reason.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from hybrid.errors import EVENTS_BY_WEIGHT, weight_of_event
from hybrid.store.reader import Result
from hybrid.store.records import Event
from hybrid.view.along import Along, along
from hybrid.view.projections import STILL, free_edges
from hybrid.view.style import NEWS, ZERO, prefix

# Of the largest tension: what is below is what the solver's tolerance leaves of a force of zero, as at a free end.
NOTHING = 1e-6
# Of the largest tension: a torque that asks for less of it is no torque that throws loops.
PART_OF_TENSION = 1e-4
HOCKLING = (
    "Criterion: a long rod under tension T and torque M is straight and stable where T > M²/(4 EI) (A. G. Greenhill, "
    "Proc. Inst. Mech. Eng. 34, 1883; for cables F. Rosenthal, J. Appl. Mech. 43, 1976)"
)
CAUSES = {"mesh": "mesh", "time": "time step", "model": "model", "total": "together"}


class Fact(NamedTuple):
    """One thing to know: numbers in SI units (None: not defined), where (s, m) and when (t, s), and a sentence."""

    key: str
    title: str
    text: str
    weight: str = "plain"
    values: dict[str, Any] = {}  # noqa: RUF012  never written to
    t: float | None = None
    s: float | None = None


def facts_of(result: Result) -> list[Fact]:
    """All facts, in the order of importance to a reader: warnings, loads, limits, errors, status."""
    facts = [*_warnings(result)]
    if len(result.times):
        makers: tuple[Callable[[Result], Fact], ...] = (_tension, _bend, _slack, _hockling, _seabed, _errors)
        facts += [make(result) for make in makers]
    return [*facts, _status(result)]


def attention(facts: list[Fact]) -> list[Fact]:
    """What a reader has to know first: how it ended if not well, limits that are broken, warnings; else nothing."""
    alarms = [fact for fact in facts if fact.weight == "alarm"]
    order = {"status": 0, "warning": 2}
    return sorted(alarms, key=lambda fact: order.get(fact.key, 1))


def amount(value: float, unit: str, digits: int = 4) -> str:
    """A number as engineers write it: "41.34 kN"."""
    factor, name = prefix(unit, abs(value)) if value else (1.0, unit)
    return f"{short(value * factor, digits)} {name}"


def short(value: float, digits: int) -> str:
    """So many digits, without an exponent where a person would write none."""
    rounded = float(f"{value:.{digits}g}")
    return f"{rounded:.9g}" if 1e-4 <= abs(rounded) < 1e6 or rounded == 0.0 else f"{rounded:g}"


def place(result: Result, s: float) -> str:
    """An arc length in words: "at the start", "at the end (s = 250 m)", "at s = 85 m"."""
    length = length_of(result)
    if s <= 1e-9 * length:
        return f"at the start (s = {s:.4g} m)"
    return f"at the end (s = {s:.5g} m)" if s >= (1.0 - 1e-9) * length else f"at s = {s:.4g} m"


def length_of(result: Result) -> float:
    """Length of the line, m; its output points may cover only a part of it."""
    last = result.zones[-1] if len(result.times) else []
    return last[-1].s_b if last else float(result.s[-1])


def moment(result: Result, t: float) -> str:
    """When, in words; of a result with one output nothing."""
    return f", t = {t:.5g} s" if len(result.times) > 1 else ""


def _at(values: np.ndarray, k: int) -> tuple[int, int]:
    """Output and point of the k-th value of an array (nt, ns)."""
    return divmod(k, values.shape[1])


def rods(result: Result, s: np.ndarray) -> np.ndarray:
    """Where the cable is a rod (nt, len(s)); points on a joint belong to both sides."""
    out = np.zeros((len(result.times), len(s)), bool)
    near = 1e-9 * float(s[-1] - s[0])
    for row, zones in zip(out, result.zones, strict=True):
        for zone in zones:
            if zone.kind == "rod":
                row |= (s >= zone.s_a - near) & (s <= zone.s_b + near)
    return out


# ---- one function per fact ------------------------------------------------------------------------


def warnings_of(result: Result) -> list[tuple[Event, int]]:
    """The first event of every kind that calls an answer into question, the worst kind first, and how many there are.

    News that are no warnings come last.
    """
    kinds: dict[str, list[Event]] = {}
    failed = result.message if result.status == "failed" else ""
    for event in sorted(result.events, key=lambda e: (e.kind in NEWS, weight_of_event(e.kind), e.t)):
        if event.kind in EVENTS_BY_WEIGHT and event.text[:80] not in failed:  # that is reported as how it ended
            kinds.setdefault(event.kind, []).append(event)
    return [(found[0], len(found)) for found in kinds.values()]


def _warnings(result: Result) -> list[Fact]:
    facts = []
    for event, count in warnings_of(result):
        more = f" ({count} times; this is the first)" if count > 1 else ""
        at = f"At t = {event.t:.5g} s, " if len(result.times) > 1 else ""
        where = f"s = {event.s_a:.4g} m: " if event.s_a == event.s_b else f"s = {event.s_a:.4g} to {event.s_b:.4g} m: "
        text = f"{at}{where}{event.text}{more}"
        weight = "note" if event.kind in NEWS else "alarm"
        values = {"kind": event.kind, "count": count}
        middle = 0.5 * (event.s_a + event.s_b)
        facts.append(Fact("warning", event.kind.capitalize(), text, weight, values, event.t, middle))
    if not any(fact.weight == "alarm" for fact in facts):
        none = "None were given." if result.status == "complete" else "None, beside how it ended."
        facts.insert(0, Fact("warning", "Warnings", none, values={"count": 0}))
    return facts


def _tension(result: Result) -> Fact:
    found = along(result, "tension")
    tension = found.values
    i, k = _at(tension, int(tension.argmax()))
    most, t, s = float(tension[i, k]), float(result.times[i]), float(found.s[k])
    text = f"{amount(most, 'N')} {place(result, s)}{moment(result, t)}{_doubt(result, 'tension', i, found, k)}."
    values: dict[str, Any] = {"tension": most}
    for end in ("start", "end"):  # every step is logged there, outputs are farther apart
        if f"steps/end_force_{end}" in result and len(result["steps/t"]):
            force = result[f"steps/end_force_{end}"]
            n = int(force.argmax())
            values[f"end_force_{end}"], when = float(force[n]), float(result["steps/t"][n])
            if force[n] > most * (1.0 + 1e-3):
                text += f" Between outputs the force at the {end} reaches {amount(force[n], 'N')}, at t = {when:.5g} s."
    return Fact("tension", "Largest tension", text, values=values, t=t, s=s)


def _doubt(result: Result, name: str, i: int, found: Along, k: int) -> str:
    """The estimated error at one output and place, where the file has it."""
    error = found.of(result, f"errors/total/{name}")
    if error is None or error.ndim < 2:
        return ""
    return f" (± {amount(float(error[i, k]), result.units[name], 2)})"


def _bend(result: Result) -> Fact:
    title = "Smallest bend radius"
    if "curvature" not in result:
        return Fact("bend", title, "The curvature was not recorded.", "absent")
    found = along(result, "curvature")
    limit, curvature = found.of(result, "min_bend_radius"), found.values
    i, k = _at(curvature, int(curvature.argmax()))
    most, t, s = float(curvature[i, k]), float(result.times[i]), float(found.s[k])
    values: dict[str, Any] = {"radius": 1.0 / most if most > 0.0 else None, "allowed": None, "ratio": None}
    place_of: tuple[float | None, float | None]
    if most * float(np.ptp(result.s)) < STILL:
        text, place_of = "The cable stays straight, to round-off.", (None, None)
    else:
        kind = _kind_at(result, int(i), found, int(k))
        stiff = "" if kind == "rod" else ", which does not resist bending"
        inside = f", in a {kind} zone{stiff}" if kind else ""
        text = f"{amount(1.0 / most, 'm')} {place(result, s)}{moment(result, t)}{inside}"
        text += f"{_doubt_of_radius(result, i, found, k)}."
        place_of = (t, s)
    unknown = _bends_left_out(result)
    text += unknown
    if limit is None:
        weight = "note" if unknown else "plain"
        return Fact("bend", title, f"{text} No allowed radius given.", weight, values, *place_of)
    ratio = curvature * limit  # above 1: too tight; NaN where nothing is allowed or forbidden
    if np.isnan(ratio).all():
        return Fact("bend", title, f"{text} No allowed radius given.", "plain", values, *place_of)
    i, k = _at(ratio, int(np.nanargmax(ratio)))
    worst, allowed = float(ratio[i, k]), float(limit[k])
    values |= {"allowed": allowed, "ratio": worst, "radius_there": 1.0 / max(float(curvature[i, k]), ZERO)}
    t, s = float(result.times[i]), float(found.s[k])
    if worst > 1.0:
        times = int((np.nan_to_num(ratio) > 1.0).any(axis=1).sum())
        part = f", at {times} of {len(result.times)} outputs" if len(result.times) > 1 else ""
        there = f": {amount(values['radius_there'], 'm')} {place(result, s)}{moment(result, t)}"
        verdict = f"That is below the {amount(allowed, 'm')} allowed{'' if (t, s) == place_of else there}{part}."
        return Fact("bend", title, f"{text} {verdict}", "alarm", values, t, s)
    if unknown:
        verdict = f"Allowed are {amount(allowed, 'm')}; whether that holds there is not known."
        return Fact("bend", title, f"{text} {verdict}", "alarm", values, t, s)
    verdict = f"Allowed are {amount(allowed, 'm')}: {short(100 * worst, 3)} % of that bend is used."
    return Fact("bend", title, f"{text} {verdict}", "plain", values, t, s)


def _bends_left_out(result: Result) -> str:
    """Where a bend was left out, so that no radius is known; empty where none was."""
    found = [e for e in result.events if e.kind in ("bending at point load neglected", "bending at clamp neglected")]
    if not found:
        return ""
    where = ", ".join(dict.fromkeys(f"s = {x:.4g} m" for e in found for x in (e.s_a, e.s_b)))
    return f" Not known at {where}, where the bend at a point load or clamp is left out: say force_rod there."


def _kind_at(result: Result, i: int, found: Along, k: int) -> str:
    """Kind of the zone at an output and place: at a joint that of its side, or the rod where it has but one value."""
    s, side = found.s[k], found.side(k)
    kinds = [zone.kind for zone in result.zones[i] if zone.s_a <= s <= zone.s_b]
    if not side and "rod" in kinds:
        return "rod"
    return kinds[-1 if side > 0 else 0] if kinds else ""


def _doubt_of_radius(result: Result, i: int, found: Along, k: int) -> str:
    error = found.of(result, "errors/total/curvature")
    if error is None:
        return ""
    part = float(error[i, k]) / float(found.values[i, k])
    return f" (± {short(100 * part, 2)} %)"


def _slack(result: Result) -> Fact:
    found, title = along(result, "tension"), "Lowest tension"
    tension = found.values
    i, k = _at(tension, int(tension.argmin()))
    least, t, s = float(tension[i, k]), float(result.times[i]), float(found.s[k])
    zero = NOTHING * float(np.abs(tension).max())
    pressed = tension < -zero
    weights = np.gradient(found.s) if len(found.s) > 1 else np.ones(1)
    length, outputs = float((pressed @ weights).max()), int(pressed.any(axis=1).sum())
    values = {"tension": least, "outputs": outputs, "length": length}
    there = f"{place(result, s)}{moment(result, t)}"
    if outputs:
        part = f"at {outputs} of {len(result.times)} outputs" if len(result.times) > 1 else "at rest"
        text = f"{amount(least, 'N')} {there}: the cable is slack or compressed {part}, at most {length:.3g} m of it."
        return Fact("slack", title, text, "note", values, t, s)
    if least <= zero:
        return Fact("slack", title, f"Zero, {there}; nowhere is the cable compressed.", "plain", values, t, s)
    covered = float(np.ptp(result.s)) >= 0.999 * length_of(result)
    where = "everywhere" if covered else "at all points that were saved"
    text = f"{amount(least, 'N')} {there}: the cable is taut {where}{' and always' * (len(result.times) > 1)}."
    return Fact("slack", title, text, "plain", values, t, s)


def _hockling(result: Result) -> Fact:
    title = "Loops by torque (hockling)"

    def none(text: str) -> Fact:
        return Fact("hockling", title, text, "absent")

    if "torque" not in result:
        return none("No torque is computed: no part of the cable is a rod.")
    found = along(result, "torque")
    where = rods(result, found.s)
    if not where.any():
        return none("No torque is computed: no part of the cable was a rod.")
    torque = np.where(where, found.values, 0.0)
    if not np.abs(torque).max() > ZERO:
        return none("The rods of the cable carry no torque.")
    stiffness, tension = found.of(result, "bending_stiffness"), along(result, "tension").values
    if stiffness is None:
        return none("Not judged: the file has no bending stiffness to hold the torque against.")
    needed = np.divide(torque**2, 4.0 * stiffness, out=np.zeros_like(torque), where=stiffness > 0.0)
    scale = NOTHING * float(np.abs(tension).max())
    if float(needed.max()) <= PART_OF_TENSION * float(np.abs(tension).max()):
        i, k = _at(torque, int(np.abs(torque).argmax()))
        text = f"The torque, at most {amount(abs(float(torque[i, k])), 'N m', 3)}, is far too small for loops."
        values = {"torque": abs(float(torque[i, k])), "needed": float(needed.max()), "ratio": 0.0}
        return Fact("hockling", title, f"{text} {HOCKLING}.", "plain", values)
    ratio = np.where(needed > scale, needed / np.maximum(tension, scale), 0.0)
    i, k = _at(ratio, int(ratio.argmax()))
    t, s = float(result.times[i]), float(found.s[k])
    values = {
        "torque": float(torque[i, k]), "needed": float(needed[i, k]), "tension": float(tension[i, k]),
        "ratio": float(ratio[i, k]),
    }  # fmt: skip
    there = f"{place(result, s)}{moment(result, t)}"
    text = (
        f"Nearest to a loop {there}: a torque of {amount(abs(values['torque']), 'N m', 3)} needs a tension of "
        f"{amount(values['needed'], 'N', 3)}, there is {amount(values['tension'], 'N', 3)}"
    )
    verdict = ": the criterion is broken, a straight cable would throw a loop" if values["ratio"] >= 1.0 else ""
    if not verdict:
        verdict = f", {short(1.0 / values['ratio'], 3)} times as much"
    weight = "alarm" if values["ratio"] >= 1.0 else "plain"
    return Fact("hockling", title, f"{text}{verdict}. {HOCKLING}.", weight, values, t, s)


def _seabed(result: Result) -> Fact:
    title = "On the seabed"
    if "seabed" not in result:
        return Fact("seabed", title, "The scene has no seabed.", "absent")
    if "grounded_length" not in result:
        return Fact("seabed", title, "The contact was not recorded.", "absent")
    grounded, force = result["grounded_length"], result["contact_force"]
    low, high = float(grounded.min()), float(grounded.max())
    values: dict[str, Any] = {"grounded": [low, high], "force": float(force.max()), "touchdown": {}}
    if high == 0.0:
        return Fact("seabed", title, "The cable never touches it.", "plain", values)
    if len(grounded) == 1 or high - low <= 1e-9 * high:
        text = f"{high:.4g} m of the cable lie on it"
    else:
        text = f"Between {low:.4g} and {high:.4g} m of the cable lie on it"
    for edge in free_edges(result):
        seen = result["touchdown"][:, edge]
        a, b = float(np.nanmin(seen)), float(np.nanmax(seen))
        name = ("begins", "ends")[edge]
        values["touchdown"][("first", "last")[edge]] = [a, b]
        text += f"; contact {name} " + (f"at s = {a:.4g} m" if b - a < 5e-4 * b else f"at s = {a:.4g} to {b:.4g} m")
    gone = int((grounded == 0.0).sum())
    if gone:
        text += f"; at {gone} of {len(grounded)} outputs nothing does"
    i = int(force.argmax())
    t = float(result.times[i])
    text += f". It bears at most {amount(float(force[i]), 'N')}{moment(result, t)}."
    return Fact("seabed", title, text, "plain", values, t)


def _errors(result: Result) -> Fact:
    title = "Estimated errors"
    found = {k[6:]: float(x) for k, x in result.attributes.items() if k.startswith("error_")}
    if "total_position" not in found:
        text = "Not estimated; `accuracy: 1%` or `output: {errors: true}` in the scene asks for it."
        return Fact("errors", title, text, "absent")
    asked = result.attributes.get("accuracy_asked")
    text = f"Position {amount(found['total_position'], 'm', 2)}, end forces {amount(found['total_end_force'], 'N', 2)}"
    text += f"; asked was {asked}." if asked else "."
    return Fact("errors", title, text, "plain", found | {"asked": asked})


def _status(result: Result) -> Fact:
    n = len(result.times)
    values = {"status": result.status, "outputs": n, "t": float(result.times[-1]) if n else None}
    if n == 0:
        held = " No output was saved."
    elif n == 1:
        held = f" One output, at t = {result.times[0]:.6g} s."
    else:
        held = f" {n} outputs, t = {result.times[0]:.6g} to {result.times[-1]:.6g} s."
    good = result.status == "complete"
    text = f"{result.status_text[:1].upper()}{result.status_text[1:].rstrip('.')}.{held}"
    return Fact("status", "How it ended", text, "plain" if good else "alarm", values)
