"""A page about a result: its title and facts above, warnings below; what pages of several lines refuse."""

from __future__ import annotations

from typing import Any

from hybrid.errors import ResultError
from hybrid.store.limits import held_of
from hybrid.store.reader import Result
from hybrid.view.figure import Page
from hybrid.view.style import NEWS, short
from hybrid.view.zones import warnings_of


def page_of(result: Result, facts: list[str], **more: Any) -> Page:
    """A page about a result: title and facts above the panels, warnings below."""
    n, complete = len(result.times), result.status == "complete"
    head = [] if result.done else [result.status_text]
    if n:
        span = f"{n} outputs, t = {short(result.times[0], 5)} … {short(result.times[-1], 5)} s"
        head.append(span if n > 1 else "static" if complete else f"one output, t = {short(result.times[0], 5)} s")
    found = warnings_of(result)
    alarms = [(event, count) for event, count in found if event.kind not in NEWS]
    note = "; ".join(dict.fromkeys(event.text for event, _ in (alarms[:1] or found)))
    if alarms:
        names = ", ".join(event.kind + f" (× {count})" * (count > 1) for event, count in alarms)
        note = f"Warning: {names}; at t = {short(alarms[0][0].t, 4)} s: {note}"
    elif found:
        note = f"Note: {note}"
    broken = [x for x in held_of(result) if x.broken]
    if broken:
        more_of = f" and {len(broken) - 1} more" * (len(broken) > 1)
        note = f"{note or 'Warning'}{';' if note else ':'} {broken[0].text}{broken[0].when}{more_of}"
    texts, alarm = "; ".join(filter(None, [*head, *facts])), (not result.done, bool(alarms or broken))
    empty = "" if n else "no output was saved"
    return Page(
        result.title or "(no title)",
        texts,
        note=note,
        alarm=alarm,
        empty=empty,
        **more,
    )


def refuse_several(result: Result, what: str) -> None:
    """ResultError where something of one line is asked of several."""
    if result.lines:
        name = next(iter(result.lines))
        advice = f"result.lines['{name}'], or --line {name}"
        raise ResultError(f"{what}: of one line, and the result is of {len(result.lines)}\n    try:      {advice}")
