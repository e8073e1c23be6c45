"""What a study says of the accuracy that its scenes ask for: the verdict on each case, and which do not meet it."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from hybrid.store.envelope import NOT_VERIFIED
from hybrid.store.study_file import DONE
from hybrid.store.verdicts import MET, MISSED, asked_accuracy

if TYPE_CHECKING:
    import xarray

    from hybrid.store.reader import Result


class Unmet(NamedTuple):
    """Cases of a study that missed the accuracy asked, or of which it is not verified.

    cases: their numbers; worst: the one whose error is largest over what is asked, where none is known the first;
    used: that error over what is asked, NaN: not known; text: why, and what to do; done: how many cases are done.
    """

    verdict: str
    cases: list[int]
    worst: int
    used: float
    text: str
    done: int

    def __str__(self) -> str:
        """In words."""
        times = f" (its error is {self.used:.3g} times what is asked)" if np.isfinite(self.used) else ""
        what = "missed the accuracy asked" if self.verdict == MISSED else "have the accuracy asked not verified"
        return f"{len(self.cases)} of {self.done} cases {what}, case {self.worst} most of all{times}: {self.text}"


def accuracy_of_case(result: Result) -> tuple[str, float]:
    """The verdict on the accuracy that was asked for, with the reason and what to do, and the error over what is asked.

    The worst of all lines.  "", NaN: none was asked.
    """
    found = [(name, line, asked) for name, line in result.each_line() for asked in asked_accuracy(line)]
    if not found:
        return "", np.nan
    used = max(float(line.attributes.get("accuracy_used", np.nan)) for _, line, _ in found)
    for verdict in (MISSED, NOT_VERIFIED):
        for name, line, asked in found:
            if asked.verdict == verdict:
                events = (event.text for event in line.events if event.kind == "accuracy missed")
                why = next(events, "") if verdict == MISSED else f"{asked.why}; try: {asked.remedy}"
                return f"{verdict}: {f'line {name}: ' * bool(name)}{why}", used
    return MET, used


def unmet_accuracy(found: xarray.Dataset) -> list[Unmet]:
    """Which of the cases that are done missed the accuracy asked, and of which it is not verified; empty: none."""
    if "accuracy_verdict" not in found:  # of an earlier release
        return []
    out, done = [], found["status"].values == DONE
    words, used = [str(x) for x in found["accuracy_verdict"].values], found["accuracy_used"].values
    for verdict in (MISSED, NOT_VERIFIED):
        which = np.flatnonzero([x.startswith(verdict) for x in words] & done)
        if which.size:
            k = int(which[np.argmax(np.nan_to_num(used[which], nan=-1.0))])
            text, cases = words[k].removeprefix(f"{verdict}: "), found["case"].values
            worst, each = int(cases[k]), cases[which].tolist()
            out.append(Unmet(verdict, each, worst, float(used[k]), text, int(done.sum())))
    return out
