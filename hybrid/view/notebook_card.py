"""A result at a glance, as light HTML: title, status, key facts, and a small drawing of shapes and zones.

It costs milliseconds and a few kilobytes.
"""

from __future__ import annotations

from html import escape

from hybrid.store.reader import Result
from hybrid.view.panels import shape
from hybrid.view.style import ALARM, GREY, INK, short
from hybrid.view.summary import attention, facts_of, length_of
from hybrid.view.svg_backend import WIDTH, draw
from hybrid.view.zones import strip

_POINTS = 120  # on a curve
_SHOWN = ("tension", "bend", "slack", "seabed", "errors")  # facts with a line each
_FRAME = "font-family:system-ui,sans-serif;font-size:13px;line-height:1.45;color:#222;background:#fff;padding:10px 12px"
_FRAME += ";border:1px solid #ddd;border-radius:6px;max-width:900px"


def card(result: Result) -> str:
    """The HTML of one result; it holds no script and asks for nothing from outside."""
    facts = facts_of(result)
    first = attention(facts)
    good = result.done
    n, s = len(result.times), result.s
    span = f"t = {short(result.times[0], 6)} … {short(result.times[-1], 6)} s" if n > 1 else ""
    span = "static" if n == 1 and result.status == "complete" else span
    head = (
        f"{n} output{'s' * (n != 1)}"
        + f", {span}" * bool(span)
        + f"; {len(s)} points on {short(length_of(result), 6)} m"
    )
    status = result.status if good else result.status_text.splitlines()[0]
    colour = GREY if good else ALARM
    rows = [(f.title, f.text) for f in facts if f.key in _SHOWN and f.weight != "absent"]
    cells = "".join(
        f'<tr><td style="text-align:left;vertical-align:top;white-space:nowrap;padding:1px 10px 1px 0;color:{GREY};'
        f'border:0;background:#fff">{escape(title)}</td><td style="text-align:left;padding:1px 0;color:{INK};'
        f'border:0;background:#fff">{escape(text)}</td></tr>'
        for title, text in rows
    )
    alarms = [f"{fact.title}: {fact.text.splitlines()[0]}" for fact in first if fact.key != "status"]
    alarm = "".join(f'<div style="color:{ALARM}">{escape(_cut(text))}</div>' for text in alarms[:3])
    alarm += f'<div style="color:{ALARM}">and {len(alarms) - 3} more</div>' if len(alarms) > 3 else ""
    drawing = f'<div style="flex:0 1 {WIDTH:.0f}px;min-width:220px">{picture(result)}</div>' if n else ""
    title = escape(result.title or "(no title)")
    return (
        f'<div style="{_FRAME}"><div style="font-weight:600;font-size:15px">{title}</div>'
        f'<div style="color:{colour}">{escape(_cut(status))}; {escape(head)}</div>{alarm}'
        f'<div style="display:flex;flex-wrap:wrap;gap:14px;margin-top:6px">{drawing}<table style="flex:1 1 280px;'
        f'border-collapse:collapse;font-size:12.5px;margin:0;display:block;border:0">{cells}</table></div></div>'
    )


def _cut(text: str, most: int = 220) -> str:
    return text if len(text) <= most else text[: most - 2].rsplit(" ", 1)[0] + " …"


def picture(result: Result) -> str:
    """SVG: the last shape by zones over earlier ones, seabed and water; below it the zones over time."""
    panels = [shape(result, most=_POINTS)]
    if len(result.times) > 1 and any(result.zones):
        panels.append(strip(result))
    return draw(panels)
