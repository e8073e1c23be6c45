"""Whether histories of forces and moments at ends can be read, and are resolved by the time step."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from hybrid.scene.base import Finding, dotted
from hybrid.scene.end_loads import GivenLoad, Row
from hybrid.scene.ends import Ends


def load_findings(ends: Ends, step: float | None) -> Iterator[Finding]:
    """What is wrong with the histories of loads; step: s, if steps are fixed."""
    for name, end in ends.named().items():
        for load in end.loads:
            found = _unreadable(load)
            if found is not None:
                yield Finding(("ends", name, *load.key[:-1], *found.at), found.expected, found.fix, found.given)
            elif step is not None and load.rows:
                t = _missed(load.rows, step)
                if t is not None:
                    where = dotted(("ends", name, *load.key))
                    expected = f"steps so short that {where} is nearly straight within each; it turns at t = {t:g} s"
                    yield Finding(("time", "step"), expected, "a smaller step, or a smoother history", f"{step:g}")


def _unreadable(load: GivenLoad) -> Finding | None:
    """Why the file of a load cannot be used."""
    if load.load.file is None:
        return None
    from hybrid.scene.motion_file import RecordRefused, read_history

    try:
        read_history(load.load.file)
    except RecordRefused as refused:
        return refused.finding
    return None


def _missed(rows: Sequence[Row], step: float) -> float | None:
    """Time of a row that departs from a line between two steps by a large part of the range of the history."""
    import numpy as np

    from hybrid.scene.motion_file import MISSED

    table = np.array(rows)
    times, values = table[:, 0], table[:, 1:]
    reach = float(np.ptp(values, axis=0).max())
    begin = np.floor(times / step) * step

    def at(t: np.ndarray) -> np.ndarray:
        return np.stack([np.interp(t, times, column) for column in values.T], axis=1)

    part = ((times - begin) / step)[:, None]
    bow = np.abs(values - (1.0 - part) * at(begin) - part * at(begin + step)).max(axis=1)
    bow[times < 0.0] = 0.0
    return float(times[bow.argmax()]) if bow.max() > MISSED * reach else None


def turning_times(ends: Ends) -> list[float]:
    """Times, s, of the rows of all histories: between them the loads are linear."""
    return [row[0] for end in ends.both for load in end.loads for row in load.rows if row[0] > 0.0]
