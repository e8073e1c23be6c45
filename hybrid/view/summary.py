"""A result in numbers and plain sentences: warnings, tension, bends, slack, torque, seabed, errors, status.

`facts_of(result)` reads the envelope, which knows every accepted step, and every output and grid point, with both
values where a quantity jumps, whatever a page later draws of them.  A fact has a weight:
"alarm", a limit is broken or a warning was given; "note", worth knowing; "plain"; "absent", with the reason.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np

from hybrid.errors import LIMIT_EVENTS, is_of_the_run
from hybrid.store.capacity import clauses_of, formation_ratio, formation_tension
from hybrid.store.envelope import (
    BROKEN,
    GROUP,
    ITSELF,
    NOT_VERIFIED,
    NOTHING,
    SCALE,
    has_envelope,
    not_verified,
    partner_of,
)
from hybrid.store.reader import Result
from hybrid.store.records import UNKNOWN, not_converged_in
from hybrid.store.verdicts import Doubt, accuracy_text, asked_accuracy, doubt_of, quantity_limits, section_limits
from hybrid.view.curves import Along, Worst, along, held_loop, trapped_loop, worst
from hybrid.view.figure import NEWS, ZERO, prefix, short
from hybrid.view.projections import STILL, free_edges
from hybrid.view.zones import extent_of, warnings_of

HOCKLING = (
    "Criterion: a long rod under tension T and torque M is straight and stable where T > M²/(4 EI) (A. G. Greenhill, "
    "Proc. Inst. Mech. Eng. 34, 1883); friction, plasticity and the structure of the strands are not in it"
)
# What a line may press on, by the quantity in its envelope: key of the fact, and in words.
PRESSED = (("self_contact", "itself", "itself"), ("obstacle_contact", "obstacles", "obstacles"))
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
    """All facts, in the order of importance to a reader: warnings, loads, limits, errors, status.

    Of several lines those of all together: warnings, and how it ended.
    """
    (name, line), *others = result.each_line()
    facts = [*_warnings(result), *_quantities(result)]
    if not others:
        facts += [*(_quantities(line) if name else ()), *facts_of_line(line)]
    return [*facts, _status(result)]


def facts_of_line(line: Result) -> list[Fact]:
    """Loads, limits and errors of a line; none without an output."""
    if not len(line.times):
        return []
    makers: tuple[Callable[[Result], Fact], ...] = (_tension, _bend, _slack, _limits, _hockling, _seabed, _errors)
    facts = [make(line) for make in makers]
    return facts + [_pressed(line, *x) for x in PRESSED if f"{GROUP}/{x[0]}_max" in line]


def attention(facts: list[Fact]) -> list[Fact]:
    """What a reader has to know first: how it ended if not well, limits that are broken, warnings; else nothing."""
    alarms = [fact for fact in facts if fact.weight == "alarm"]
    order = {"status": 0, "warning": 2}
    return sorted(alarms, key=lambda fact: order.get(fact.key, 1))


def amount(value: float, unit: str, digits: int = 4) -> str:
    """A number as engineers write it: "41.34 kN"."""
    factor, name = prefix(unit, abs(value)) if value else (1.0, unit)
    return f"{short(value * factor, digits)} {name}"


def place(result: Result, s: float, over: tuple[float, float] | None = None) -> str:
    """An arc length in words: "at the start", "at the end (s = 250 m)", "at s = 85 m"; over: a range of them, m."""
    if over is not None:
        return f"from s = {short(over[0], 4)} to {short(over[1], 5)} m"
    length = length_of(result)
    if s <= 1e-9 * length:
        return f"at the start (s = {short(s, 4)} m)"
    return f"at the end (s = {short(s, 5)} m)" if s >= (1.0 - 1e-9) * length else f"at s = {short(s, 4)} m"


def length_of(result: Result) -> float:
    """Length of the line, m; its output points may cover only a part of it."""
    last = result.zones[-1] if len(result.times) else []
    return last[-1].s_b if last else float(result.s[-1])


def moment(result: Result, t: float) -> str:
    """When, in words; of a result with one output nothing."""
    return f", t = {short(t, 5)} s" if len(result.times) > 1 else ""


# ---- one function per fact ------------------------------------------------------------------------


def _warnings(result: Result) -> list[Fact]:
    facts = []
    for event, count in warnings_of(result):
        if event.kind in LIMIT_EVENTS.values():
            continue  # facts of their own
        more = f" ({count} times; this is the first)" if count > 1 else ""
        of_run = is_of_the_run(event.kind, event.t)
        at = "" if of_run or len(result.times) < 2 else f"At t = {short(event.t, 5)} s, "
        where = "" if of_run and event.s_a < event.s_b else f"{extent_of(event)}: "  # of all of the line
        text = f"{at}{where}{event.text}{more}"
        weight = "note" if event.kind in NEWS else "alarm"
        values = {"kind": event.kind, "count": count}
        middle = 0.5 * (event.s_a + event.s_b)
        facts.append(Fact("warning", event.kind.capitalize(), text, weight, values, event.t, middle))
    if not any(fact.weight == "alarm" for fact in facts):
        held = [x for one in (result, *result.lines.values()) for x in quantity_limits(one)]
        broken = any(event.kind in LIMIT_EVENTS.values() for event in result.events) or any(x.broken for x in held)
        beside = [*["limits that are broken"] * broken, *["how it ended"] * (not result.done)]
        none = f"None, beside {' and '.join(beside)}." if beside else "None were given."
        facts.insert(0, Fact("warning", "Warnings", none, values={"count": 0}))
    return facts


def _tension(result: Result) -> Fact:
    found = worst(result, "tension")
    doubt = _doubt(result, "tension", found)
    text = f"{amount(found.value, 'N')} {place(result, found.s, found.over)}{moment(result, found.t)}{doubt}."
    values: dict[str, Any] = {"tension": found.value, "headline": f"{amount(found.value, 'N')}{doubt}"}
    for end in ("start", "end"):  # every step is logged there, outputs are farther apart
        if f"steps/end_force_{end}" in result and len(result["steps/t"]):
            force = result[f"steps/end_force_{end}"]
            n = int(force.argmax())
            values[f"end_force_{end}"], when = float(force[n]), float(result["steps/t"][n])
            if force[n] > found.value * (1.0 + 1e-3):
                between = "The" if has_envelope(result) else "Between outputs the"
                text += f" {between} force at the {end} reaches {amount(force[n], 'N')}, at t = {short(when, 5)} s."
    return _with_limit(
        result, "max_tension", Fact("tension", "Largest tension", text, "plain", values, found.t, found.s)
    )


def _with_limit(result: Result, limit: str, fact: Fact) -> Fact:
    """A fact on tension with the limit that it is held against."""
    for x in section_limits(result):
        if x.limit == limit:
            values = fact.values | {"allowed": x.allowed, "broken": x.broken}
            if x.not_verified:
                text = f"{fact.text} Allowed are {amount(x.allowed, 'N')}, {x.not_verified}."
                return fact._replace(text=text, values=values, weight="note")
            if not x.broken:
                text = f"{fact.text} Within the {amount(x.allowed, 'N')} allowed."
                return fact._replace(text=text, values=values)
            side = "above" if limit == "max_tension" else "below"
            here = (x.s, x.t) == (fact.s, fact.t)
            there = "" if here else f": {amount(x.value, 'N')} {place(result, x.s)}{moment(result, x.t)}"
            text = f"{fact.text} That is {side} the {amount(x.allowed, 'N')} allowed{there}."
            return fact._replace(text=text, values=values, weight="alarm", t=x.t, s=x.s)
    return fact


def _doubt(result: Result, name: str, found: Worst) -> str:
    """The estimated error at the output and place nearest to a value, of curvature as a part; "": the file has none."""
    each = along(result, name).of(result, f"errors/total/{name}")
    if each is None or each.ndim != 2:
        return ""
    if not result.s[0] <= found.s * (1.0 + 1e-9) or not found.s * (1.0 - 1e-9) <= result.s[-1]:
        return ""  # output.points leave that place out
    if name in not_converged_in(result.attributes):
        return f" ({UNKNOWN})"
    error = float(each[found.output, found.place])
    part = f"{short(100 * error / found.value, 2)} %" if name == "curvature" else amount(error, result.units[name], 2)
    return f" (± {part})"


def _bend(result: Result) -> Fact:
    title = "Smallest bend radius"
    if "curvature" not in result:
        return Fact("bend", title, "The curvature was not recorded.", "absent")
    found = worst(result, "curvature")
    values: dict[str, Any] = {
        "radius": 1.0 / found.value if found.value > 0.0 else None,
        "allowed": None,
        "ratio": None,
        "headline": "straight",
    }
    place_of: tuple[float | None, float | None]
    if found.value * float(np.ptp(result.s)) < STILL:
        text, place_of = "The cable stays straight, to round-off.", (None, None)
    else:
        kind = _kind_at(result, found)
        stiff = "" if kind == "rod" else ", which does not resist bending"
        inside = f", in a {kind} zone{stiff}" if kind else ""
        text = f"{amount(1.0 / found.value, 'm')} {place(result, found.s)}{moment(result, found.t)}{inside}"
        doubt = _doubt(result, "curvature", found)
        text += f"{doubt}."
        values["headline"] = f"{amount(1.0 / found.value, 'm')}{doubt}"
        place_of = (found.t, found.s)
    limits = [x for x in section_limits(result) if x.limit == "min_bend_radius"]
    if not limits:
        return Fact("bend", title, f"{text} No allowed radius given.", "plain", values, *place_of)
    (limit,) = limits
    allowed, t, s = limit.allowed, limit.t, limit.s
    values |= {"allowed": allowed, "ratio": limit.used, "radius_there": limit.value}
    if limit.broken:
        bends = along(result, "curvature")
        least = bends.of(result, "min_bend_radius")
        shown = 0 if least is None else int((np.nan_to_num(bends.values * least) > 1.0).any(axis=1).sum())
        part = f", at {shown} of {len(result.times)} outputs" if shown else ", between outputs"
        part = part if len(result.times) > 1 else ""
        there = f": {amount(limit.value, 'm')} {place(result, s)}{moment(result, t)}"
        verdict = f"That is below the {amount(allowed, 'm')} allowed{'' if (t, s) == place_of else there}{part}."
        return Fact("bend", title, f"{text} {verdict}", "alarm", values, t, s)
    if limit.used is None:
        verdict = f"Allowed are {amount(allowed, 'm')}, {limit.not_verified}."
        return Fact("bend", title, f"{text} {verdict}", "note", values, t, s)
    verdict = f"Allowed are {amount(allowed, 'm')}: MBR utilisation of {short(100 * limit.used, 3)} %."
    return Fact("bend", title, f"{text} {verdict}", "plain", values, t, s)


def _kind_at(result: Result, found: Worst) -> str:
    """Kind of the zone at a place and time: at a joint that of its side, or the rod where it has but one value."""
    zones = result.zones[found.output]
    kinds = [zone.kind for zone in zones if zone.s_a <= found.s <= zone.s_b]
    if not found.side and "rod" in kinds:
        return "rod"
    return kinds[-1 if found.side > 0 else 0] if kinds else ""


def _compressed(tension: Along, zero: float) -> tuple[float, int]:
    """Of which length, m, the line is compressed at most at an output, and at how many outputs; zero: N, is none."""
    pressed = np.asarray(tension.values) < -zero
    weights = 0.5 * (np.diff(tension.s, prepend=tension.s[0]) + np.diff(tension.s, append=tension.s[-1]))
    return float((pressed @ weights).max()), int(pressed.any(axis=1).sum())


def _slack(result: Result) -> Fact:
    along_line, title = along(result, "tension"), "Lowest tension"
    found, tension = worst(result, "tension", lowest=True), along_line.values
    zero = NOTHING * max(float(np.abs(tension).max()), abs(worst(result, "tension").value))
    length, outputs = _compressed(along_line, zero)
    values: dict[str, Any] = {"tension": found.value, "outputs": outputs, "length": length}
    values["headline"] = f"{amount(found.value, 'N')}{_doubt(result, 'tension', found)}" if found.value else "0 N"
    there, weight = f"{place(result, found.s, found.over)}{moment(result, found.t)}", "plain"
    if outputs:
        part = f"at {outputs} of {len(result.times)} outputs" if len(result.times) > 1 else "at rest"
        text = f"{amount(found.value, 'N')} {there}: the cable is slack or compressed {part}"
        text += f", at most {short(length, 3)} m of it."
        weight = "note"
    elif found.value < -zero:
        text, weight = f"{amount(found.value, 'N')} {there}: the cable is slack or compressed between outputs.", "note"
    elif found.value <= zero:
        text = f"Zero, {there}; nowhere is the cable compressed."
    else:
        covered = has_envelope(result) or float(np.ptp(result.s)) >= 0.999 * length_of(result)
        where = "everywhere" if covered else "at all points that were saved"
        always = " and always" * (len(result.times) > 1)
        text = f"{amount(found.value, 'N')} {there}: the cable is taut {where}{always}."
    return _with_limit(result, "min_tension", Fact("slack", title, text, weight, values, found.t, found.s))


def _limits(result: Result) -> Fact:
    """All limits of the sections in one table."""
    rows = _limit_rows(result)
    if not rows:
        none = (
            "None given: min_bend_radius, max_tension, min_tension, max_contact_force, capacity, code, or max_stress "
            "of the pipe, of a section."
        )
        return Fact("limits", "Limits of the sections", none, "absent")
    return _limits_fact("Limits of the sections", rows, [result])


def limits_of_lines(lines: Mapping[str, Result]) -> list[Fact]:
    """The same of several lines, in one table with what is broken first; empty: none has any."""
    rows = [{"line": name} | row for name, line in lines.items() if len(line.times) for row in _limit_rows(line)]
    rows.sort(key=lambda x: (x["broken"], x["verdict"] == NOT_VERIFIED, x["used"] or 0.0), reverse=True)
    return [_limits_fact("Limits of the lines", rows, [*lines.values()])] * bool(rows)


def _limit_rows(result: Result) -> list[dict[str, Any]]:
    keys = "limit", "value", "allowed", "broken", "s", "t", "verdict", "why", "remedy"
    rows = [x._asdict() for x in section_limits(result)]
    for x in quantity_limits(result):
        if x.limit in ("max_stress", "capacity", "code"):
            used = None if x.verdict == NOT_VERIFIED else x.value / x.allowed
            rows.append({key: getattr(x, key) for key in keys} | {"used": used})
    return rows


def _limits_fact(title: str, rows: list[dict[str, Any]], results: list[Result]) -> Fact:
    """The table in words: how many are broken or not verified, and why."""
    counts = [(sum(x["verdict"] == word for x in rows), word) for word in (BROKEN, NOT_VERIFIED)]
    text = ", ".join(f"{n} of {len(rows)} {word}" for n, word in counts if n) or "All are within"
    every_step = all(has_envelope(x) for x in results)
    text += ", over every accepted step and output." if every_step else ", at the outputs that were saved."
    by = dict.fromkeys(clauses for x in results if (clauses := clauses_of(x)))
    text += f" By {'; '.join(by)}." if by else ""
    why = dict.fromkeys(f"{not_verified(x['why'], x['remedy'])}." for x in rows if x["verdict"] == NOT_VERIFIED)
    return Fact("limits", title, " ".join([text, *(x[:1].upper() + x[1:] for x in why)]), "plain", {"limits": rows})


def _quantities(result: Result) -> list[Fact]:
    """Quantities that the scene gives limits for, each at the output where it is nearest to them."""
    facts = []
    for x in quantity_limits(result):
        known = x.value == x.value
        there = f" {place(result, x.s)}" if x.s is not None else ""
        weight = "alarm" if x.broken else "note" if x.verdict == NOT_VERIFIED else "plain"
        text = f"{x.text}{there}{moment(result, x.t) if known else ''}{x.ending}."
        values = {"value": x.value if known else None, "allowed": x.allowed, "limit": x.limit}
        t = x.t if known else None
        facts.append(Fact("quantity", x.name.replace("_", " ").capitalize(), text, weight, values, t, x.s))
    return facts


def _without_loop(result: Result) -> tuple[np.ndarray, str]:
    """The outputs (nt,) at which the line is without a loop, as its events say, and when loops formed and opened."""
    without, said = np.ones(len(result.times), bool), []
    for event in sorted((x for x in result.events if x.kind in ("loop formed", "loop opened")), key=lambda x: x.t):
        formed = event.kind == "loop formed"
        if formed == bool(without[-1]):
            said.append(f"A loop {'formed' if formed else 'opened'} at t = {short(event.t, 5)} s.")
        without[result.times >= event.t] = not formed
    if said and not without.all():
        said.append("The criterion is of a straight line, and the outputs in between are not judged by it.")
    return without, " ".join(said)


def _not_in_tension(result: Result, tension: Along) -> tuple[bool, str]:
    """Whether the line is compressed at an output, and where the criterion of a line in tension does not hold."""
    length, outputs = _compressed(tension, NOTHING * float(np.abs(tension.values).max()))
    if not outputs:
        return False, ""
    part = f"at {outputs} of {len(result.times)} outputs" if len(result.times) > 1 else "at rest"
    text = f" The cable is compressed {part}, at most {short(length, 3)} m of it: the criterion is of a line in tension"
    return True, f"{text} and does not hold there."


def _hockling(result: Result) -> Fact:
    title = "Loops by torque (hockling)"

    def none(text: str) -> Fact:
        return Fact("hockling", title, text, "absent")

    if "torque" not in result:
        return none("No torque is computed: no part of the cable is a rod, or holds the twist at both ends.")
    found = along(result, "torque")
    torque = np.asarray(found.values, float)
    if not np.abs(torque).max() > ZERO:
        return none("The cable carries no torque.")
    stiffness, tension = found.of(result, "bending_stiffness"), along(result, "tension")
    if stiffness is None:
        return none("Not judged: the file has no bending stiffness to hold the torque against.")
    needed = formation_tension(torque, np.broadcast_to(stiffness, torque.shape))
    ratio = formation_ratio(torque, np.asarray(tension.values), stiffness)
    without, loops = _without_loop(result)
    ratio, loops = np.where(without[:, None], ratio, 0.0), f" {loops}" * bool(loops)
    pressed, pressing = _not_in_tension(result, tension)
    if not ratio.any():
        i, k = divmod(int(np.abs(torque).argmax()), torque.shape[1])
        text = f"The torque, at most {amount(abs(float(torque[i, k])), 'N m', 3)}, "
        small = "needs next to no tension to keep the cable straight." if pressed else "is far too small for loops."
        text += f"{'was judged at no output without a loop.' if not without.any() else small}{pressing}{loops}"
        values = {"torque": abs(float(torque[i, k])), "needed": float(needed.max()), "ratio": 0.0}
        return Fact("hockling", title, f"{text} {HOCKLING}.", "note" if pressed or loops else "plain", values)
    i, k = divmod(int(ratio.argmax()), ratio.shape[1])
    t, s = float(result.times[i]), float(found.s[k])
    fields = {"torque": torque, "needed": needed, "tension": tension.values, "ratio": ratio}
    values = {name: float(x[i, k]) for name, x in fields.items()}
    values["margin"] = 1.0 / values["ratio"]
    doubt = doubt_of(result, "torque", "tension") if values["ratio"] < 1.0 else None
    there = f"{place(result, s)}{moment(result, t)}"
    text = (
        f"Nearest to a loop {there}: a torque of {amount(abs(values['torque']), 'N m', 3)} needs a tension of "
        f"{amount(values['needed'], 'N', 3)}, there is {amount(values['tension'], 'N', 3)}"
    )
    text += f"{_hockling_verdict(values, doubt)}.{pressing}{loops}"
    for more, loop in (
        _trapped(result, found, torque, doubt),
        _while_touching(result, found, torque, np.asarray(tension.values), doubt),
    ):
        text += more
        values |= loop
    weight = "alarm" if values["ratio"] >= 1.0 else "note" if doubt is not None else "plain"
    return Fact("hockling", title, f"{text} {HOCKLING}.", weight, values, t, s)


def _hockling_verdict(values: dict[str, float], doubt: Doubt | None) -> str:
    """Whether a straight line throws a loop, and by which margin it does not."""
    if values["ratio"] >= 1.0:
        if values["tension"] < 0.0:
            return ": it is compressed there, and a straight line in compression is beyond the criterion"
        return ": the criterion is broken, a straight cable would throw a loop"
    return f", {short(values['margin'], 3)} times as much" if doubt is None else f"; the margin is {doubt.text}"


def _trapped(result: Result, found: Along, torque: np.ndarray, doubt: Doubt | None) -> tuple[str, dict[str, float]]:
    """What a loop of the largest torque would be like, in words and numbers."""
    loop = trapped_loop(result, found, torque)
    if loop is None:
        return "", {}
    text = (
        f" A loop of the largest torque would lie on itself until {amount(loop['pop_out_tension'], 'N', 3)} pull "
        f"it open, bent to {amount(loop['pop_out_radius'], 'm', 3)}"
    )
    if (kinks := loop.get("kink_margin", np.inf) < 1.0) or ("kink_margin" in loop and doubt is None):
        text += f", {short(loop['kink_margin'], 3)} of the radius allowed" + (": it kinks first" if kinks else "")
    return f"{text}.", loop


def _while_touching(
    result: Result, found: Along, torque: np.ndarray, tension: np.ndarray, doubt: Doubt | None
) -> tuple[str, dict[str, float]]:
    """By how much a loop of a line that touches itself would be pulled open, in words and numbers."""
    held = held_loop(result, found, torque, tension)
    if held is None:
        return "", {}
    then = moment(result, held["pop_out_time"])
    by = f"{short(held['pop_out_margin'], 3)} times its tension" if doubt is None else "a margin not verified"
    text = f" While the cable touches itself, a loop would be pulled open by {by}{then}, at no other output by less."
    return text, held


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
        text = f"{short(high, 4)} m of the cable lie on it"
    else:
        text = f"Between {short(low, 4)} and {short(high, 4)} m of the cable lie on it"
    for edge in free_edges(result):
        seen = result["touchdown"][:, edge]
        a, b = float(np.nanmin(seen)), float(np.nanmax(seen))
        name = ("begins", "ends")[edge]
        values["touchdown"][("first", "last")[edge]] = [a, b]
        text += f"; contact {name} " + (
            f"at s = {short(a, 4)} m" if b - a < 5e-4 * b else f"at s = {short(a, 4)} to {short(b, 4)} m"
        )
    gone = int((grounded == 0.0).sum())
    if gone:
        text += f"; at {gone} of {len(grounded)} outputs nothing does"
    i = int(force.argmax())
    t = float(result.times[i])
    text += f". It bears at most {amount(float(force[i]), 'N')}{moment(result, t)}."
    values["headline"] = (
        f"{short(high, 4)} m" if high - low <= 1e-9 * high else f"{short(low, 4)} to {short(high, 4)} m"
    )
    return Fact("seabed", title, text, "plain", values, t)


def _pressed(result: Result, name: str, key: str, partner: str) -> Fact:
    """The largest force per length of what the line touches, by its quantity in the envelope."""
    force = np.nan_to_num(result[f"{GROUP}/{name}_max"])
    k = int(force.argmax())
    if not force[k] > 0.0:
        return Fact(key, f"On {partner}", f"The cable never touches {partner}.", "plain", {"force": 0.0})
    s, t = float(result[SCALE][k]), float(result[f"{GROUP}/{name}_t_max"][k])
    named = partner_of(result, name, t)
    partner = partner if named in (None, ITSELF) else named
    text = f"It presses on {partner} with at most {amount(force[k], 'N/m', 3)} {place(result, s)}{moment(result, t)}."
    if key == "obstacles":
        for x in result.contacts():
            text += f" At an output {x.partner} bears at most {amount(x.force, 'N', 3)}{moment(result, x.t_force)}."
    return Fact(key, f"On {partner}", text, "plain", {"force": float(force[k])}, t, s)


def _errors(result: Result) -> Fact:
    title = "Estimated errors"
    found = {k[6:]: float(x) for k, x in result.attributes.items() if k.startswith("error_")}
    if "total_position" not in found:
        text = "Not estimated; `accuracy: 1%` or `output: {errors: true}` in the scene asks for it."
        return Fact("errors", title, text, "absent")
    asked = result.attributes.get("accuracy_asked")
    unknown = not_converged_in(result.attributes)
    sizes = {
        name: f"not known ({amount(found[f'total_{name}'], unit, 2)}, not converged)"
        if name in unknown
        else amount(found[f"total_{name}"], unit, 2)
        for name, unit in (("position", "m"), ("end_force", "N"))
    }
    not_known = {f"{cause}_{name}": None for cause in CAUSES for name in unknown}
    text = f"Position {sizes['position']}, end forces {sizes['end_force']}"
    if "extremes_total_position" in found:
        position, force = (found[f"extremes_total_{x}"] for x in ("position", "end_force"))
        text += f" at an instant; extremes {amount(position, 'm', 2)} and {amount(force, 'N', 2)}"
    text += f"; asked was {asked}" if asked else "."
    each = asked_accuracy(result)
    text += f": {accuracy_text(each)}." if each else ""
    return Fact("errors", title, text, "plain", found | not_known | {"asked": asked})


def _status(result: Result) -> Fact:
    n = len(result.times)
    values = {"status": result.status, "outputs": n, "t": float(result.times[-1]) if n else None}
    if n == 0:
        held = " No output was saved."
    elif n == 1:
        held = f" One output, at t = {short(result.times[0], 6)} s."
    else:
        held = f" {n} outputs, t = {short(result.times[0], 6)} to {short(result.times[-1], 6)} s."
    good = result.done
    text = f"{result.status_text[:1].upper()}{result.status_text[1:].rstrip('.')}.{held}"
    return Fact("status", "How it ended", text, "plain" if good else "alarm", values)
