"""One quantity of a result on axes of one's own: over time, along the cable, its extremes, its spectrum; the shape."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from hybrid.errors import ResultError
from hybrid.statistics.moments import welch
from hybrid.store.histories import History, history_of, lies_along
from hybrid.store.reader import Result
from hybrid.view.along import AXES, along, extent
from hybrid.view.figure import ALARM, GREY, POINT_COLOURS, Axis, Band, Item, Line, Panel, prefix, short, title_of
from hybrid.view.panels import energy, profiles, refuse_several, shape
from hybrid.view.zones import zone_map

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def plot_quantity(
    result: Result, quantity: str = "tension", *, at: Any = None, envelope: bool = False, spectrum: bool = False,
    times: tuple[float | None, float | None] | None = None, ax: Axes | None = None,
) -> Axes:  # fmt: skip
    """Draw one quantity, and return the axes.

    quantity: a name of `result.names`, of a group with its slash, such as "work/drag"; end forces are those of every
    step.  at: arc lengths (m) whose histories are drawn; None: of a quantity along the line its last profile within the
    range of all outputs.  envelope: the lowest and highest value along the line, over every accepted step where the
    file has them.  spectrum: of the histories, by Welch's method.  times: from and to, s.
    ax: matplotlib axes to draw on; None: those of a new figure, `ax.figure`.  ResultError: what is not there.
    """
    refuse_several(result, "a quantity")
    if not len(result.times):
        raise ResultError("the result has no output to draw")
    if envelope and (spectrum or at is not None or times is not None):
        raise ResultError("an envelope is of all times and places\n    try:      without at, times and spectrum")
    if envelope:
        panel = _enveloped(result, quantity)
    elif at is None and not spectrum and times is None and _has_profile(result, quantity):
        panel = profiles(result, quantity)
    elif spectrum:
        panel = _spectra(result, quantity, at, times)
    else:
        panel = _histories(result, quantity, at, times)
    return draw_on(panel, ax)


def plot_shape(
    result: Result, *, view: str | None = None, times: list[float] | None = None, ax: Axes | None = None
) -> Axes:
    """Draw the last shape over earlier ones, as `plot` does, and return the axes; view: two of x, y, z."""
    refuse_several(result, "a shape")
    return draw_on(shape(result, view=view, times=times), ax)


def plot_zone_map(result: Result, *, ax: Axes | None = None) -> Axes:
    """Draw the zones along s over time, without the page around them, and return the axes."""
    refuse_several(result, "zones along s")
    return draw_on(zone_map(result), ax)


def plot_energy(result: Result, *, work: bool = False, ax: Axes | None = None) -> Axes:
    """Draw where the energy is, or with `work` where it came from, over time, and return the axes."""
    refuse_several(result, "energies")
    panel = energy(result, "work" if work else "energy")
    if panel is None:
        raise ResultError("the result has no energies over time")
    return draw_on(panel, ax)


def draw_on(panel: Panel, ax: Axes | None) -> Axes:
    """A panel on axes, or on those of a new figure."""
    from hybrid.view.matplotlib_backend import draw_panel, new_axes

    ax = new_axes() if ax is None else ax
    draw_panel(panel, ax, legend=any(getattr(item, "label", "") for item in panel.items))
    return ax


def _has_profile(result: Result, name: str) -> bool:
    return name in AXES or (name in result and result.dims(name)[:2] == ("t", "s"))


def _histories(result: Result, name: str, at: Any, times: Any) -> Panel:
    found = _history(result, name, at, times)
    values, labels = _columns(result, name, found.values, found.s)
    factor, unit = prefix(found.unit, float(np.nanmax(np.abs(values), initial=0.0)))
    items: list[Item] = [
        Line(found.t, values[:, k] * factor, label, POINT_COLOURS[k % len(POINT_COLOURS)], dash="dash" * (k > 5))
        for k, label in enumerate(labels)
    ]
    title = f"{title_of(name)} over time"
    caption = f"{title[:1].upper()}{title[1:]}, {found.basis}."
    return Panel(f"history-{name}", title, Axis("t", "s"), Axis(title_of(name), unit), items, caption=caption)


def _spectra(result: Result, name: str, at: Any, times: Any) -> Panel:
    history = _history(result, name, at, times)
    found = welch(history.t, history.values)
    factor, unit = prefix(history.unit, float(np.max(np.std(history.values, axis=0))))
    density, labels = _columns(result, name, factor**2 * np.asarray(found.S), history.s)
    seen = _seen(found.f, density)
    items: list[Item] = [
        Line(found.f[seen], density[seen, k], label, POINT_COLOURS[k % len(POINT_COLOURS)])
        for k, label in enumerate(labels)
    ]
    up = Axis(f"density of {title_of(name)}", f"({unit})² s" if " " in unit or "/" in unit else f"{unit}² s", 0.0)
    return Panel(f"spectrum-{name}", f"spectrum of {title_of(name)}", Axis("f", "Hz", 0.0), up, items)


def _seen(f: np.ndarray, density: np.ndarray) -> np.ndarray:
    """Frequencies up to twice that above which a thousandth of the variance lies: the rest is an empty axis."""
    total = np.cumsum(np.atleast_2d(density.T), axis=1)
    share = (total / np.maximum(total[:, -1:], 1e-300)).min(axis=0)
    return np.asarray(f <= 2.0 * f[min(int(np.searchsorted(share, 0.999)), len(f) - 1)])


def _enveloped(result: Result, name: str) -> Panel:
    if not _has_profile(result, name):
        if f"steps/{name}" not in result:
            result.dims(name)  # says what a name that is not there may mean
        raise ResultError(f"'{name}' has no value along the line\n    try:      tension, curvature, bending_moment")
    s, low, high, basis = extent(result, name)
    factor, unit = prefix(result.units[name], float(np.abs([low, high]).max()))
    items: list[Item] = [
        Band(s, low * factor, high * factor, colour=GREY, opacity=0.2),
        Line(s, high * factor, "highest", "#B84F04"),
        Line(s, low * factor, "lowest", "#2C72B6"),
    ]
    allowed = along(result, name).of(result, "min_bend_radius") if name == "curvature" else None
    if allowed is not None:
        items.append(Line(*along(result, name).curve(factor / allowed), "allowed", ALARM, 1.6, "dot"))
    title = f"envelope of {title_of(name)}, {basis}"
    return Panel(f"envelope-{name}", title, Axis("s", "m"), Axis(title_of(name), unit), items)


def _history(result: Result, name: str, at: Any, times: Any) -> History:
    """Histories of a quantity; x, y and z are those of the position."""
    if name in result and result.dims(name) == ("t", "s", "xyz"):
        fix = "x, y or z" if name == "position" else "a quantity of one component"
        raise ResultError(f"'{name}' has three components at every place\n    try:      {fix}")
    return history_of(result, name, times, _places(result, name, at))


def _places(result: Result, name: str, at: Any) -> Any:
    """Arc lengths whose histories are drawn: those asked for, else the ends and the middle."""
    if at is not None or not lies_along(result, name):
        return at
    return result.s[[0, len(result.s) // 2, -1]] if len(result.s) > 2 else result.s


def _columns(result: Result, name: str, values: np.ndarray, s: Any) -> tuple[np.ndarray, list[str]]:
    """Histories as columns, with a label each; of three components their axis."""
    values = np.asarray(values, float)
    if values.ndim == 1:
        return values[:, None], [""]
    values = values.reshape(len(values), -1)
    if s is None:
        last = result.dims(name)[-1] if name in result else ""
        return values, list(AXES) if last == "xyz" else [str(k) for k in range(values.shape[1])]
    labels = [f"s = {short(float(x), 5)} m" for x in s]
    for k in np.flatnonzero(np.diff(s) == 0.0):
        labels[k], labels[k + 1] = f"{labels[k]}, before", f"{labels[k + 1]}, after"
    return values, labels
