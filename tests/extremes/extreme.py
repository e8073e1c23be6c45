"""What an extreme case is, how it is judged, and how its scene is written down.

A case is a scene, a model and a truth.  It ends in one of three ways that are honest,

    right     within its tolerance of the truth
    warned    not within it, and the result carries an event that calls this very thing into question
    refused   no result: a SceneError or a ComputationError whose text names the real reason

and in one that is not: *wrong*, which no case may be.  `must` says which end is expected, and `cause` what the
event or the error has to say, so that a case that comes to hold where it did not fails as well.  Where round-off or
the luck of a coarse step decides, `must` allows two ends; docs/evidence/extremes.md says which one it was.
"""

from __future__ import annotations

import re
import signal
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np

import hybrid
from hybrid.errors import EVENTS_BY_WEIGHT
from hybrid.store.reader import Result
from tests.scenes import cable_scene

MODELS = ("rod", "catenary", "zones", "adaptive")
LONGEST = 20.0  # s of processor time: a case that takes longer has failed
# Kinds of events that are no doubt about an answer: what the scene asked for, in other words.
NEWS = {"end rotated in", "stability not judged", "zones fixed", "static friction neglected", "undamped"}
DOUBTS = tuple(kind for kind in EVENTS_BY_WEIGHT if kind not in NEWS)

# The truths are those of linear elasticity, however far a line is stretched.
ANY_STRAIN = 1e9

Floats = np.ndarray
Measured = Iterable[tuple[str, float, float]]  # what, error, tolerance
X, Y, Z = np.eye(3)
AXES = {"+x": X, "-x": -X, "+y": Y, "-y": -Y, "+z": Z, "-z": -Z}


@dataclass(frozen=True)
class Case:
    """A scene with a known end: `truth` measures a result, `source` says where the truth and its tolerance are from."""

    family: str
    name: str
    model: str
    scene: dict[str, Any]
    truth: Callable[[Result], Measured]
    source: str
    must: str = "right"
    cause: str = ""

    @property
    def key(self) -> str:
        return f"{self.family} | {self.name} | {self.model}"


@dataclass(frozen=True)
class Verdict:
    """How a case ended: outcome, the figure nearest to its tolerance (or beyond it), and what the program said."""

    outcome: str
    what: str = ""
    error: float = 0.0
    tolerance: float = 1.0
    said: str = ""
    seconds: float = 0.0

    @property
    def ratio(self) -> float:
        return self.error / self.tolerance


class TooLong(Exception):
    """A case took longer than LONGEST."""


@contextmanager
def deadline(seconds: float) -> Iterator[None]:
    """Raise TooLong after so many seconds of processor time."""

    def stop(*_: object) -> None:
        raise TooLong(f"more than {seconds:g} s")

    before = signal.signal(signal.SIGPROF, stop)
    signal.setitimer(signal.ITIMER_PROF, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        signal.signal(signal.SIGPROF, before)


def compute(case: Case) -> Result:
    """The result of a case; HybridError where there is none."""
    scene = hybrid.validate_scene(case.scene)
    return hybrid.run(scene) if "time" in case.scene else hybrid.static(scene)


def judge(case: Case) -> Verdict:
    """Compute a case and compare it with its truth; whatever is no HybridError passes through as what it is."""
    begin = time.perf_counter()

    def verdict(outcome: str, *rest: Any) -> Verdict:
        return Verdict(outcome, *rest, seconds=time.perf_counter() - begin)

    with deadline(LONGEST):
        try:
            result = compute(case)
        except hybrid.SceneError as error:
            return verdict("refused", "", 0.0, 1.0, str(error))
        except hybrid.ComputationError as error:
            if error.snapshot is not None:
                error.snapshot.unlink(missing_ok=True)
            return verdict("refused", "", 0.0, 1.0, str(error))
    said = "; ".join(dict.fromkeys(event.kind for event in result.events if event.kind in DOUBTS))
    if not (np.isfinite(result.position).all() and np.isfinite(result.tension).all()):
        return verdict("wrong", "a number that is not finite", np.inf, 1.0, said)
    figures = [(what, abs(float(error)), float(tolerance)) for what, error, tolerance in case.truth(result)]
    what, error, tolerance = max(figures, key=lambda f: f[1] / f[2] if np.isfinite(f[1]) else np.inf)
    if error <= tolerance:
        return verdict("right", what, error, tolerance, said)
    return verdict("warned" if said else "wrong", what, error, tolerance, said)


def check(case: Case, verdict: Verdict) -> None:
    """A case ends as it must, for the cause it names."""
    told = f"{verdict.outcome}: {verdict.what} {verdict.error:.3g} (tolerance {verdict.tolerance:.3g}); {verdict.said}"
    assert verdict.outcome in case.must.split(" or "), f"{case.key}\n  is {told}"
    if verdict.outcome != "right":
        assert re.search(case.cause, verdict.said), f"{case.key}\n  for the wrong cause: {verdict.said}"


# --- how a scene is written down ------------------------------------------------------------------


def scene(
    section: dict[str, Any],
    start: dict[str, Any],
    end: dict[str, Any],
    model: str,
    cells: int | None,
    gravity: float = 0.0,
    **tables: Any,
) -> dict[str, Any]:
    """The tables of a scene of one section in one of the four models; zones are rod, catenary, rod."""
    environment = {"gravity": gravity} | {k: tables.pop(k) for k in ("fluid", "seabed") if k in tables}
    kind: Any = model
    if model == "zones":
        L, part = section["length"], None if cells is None else max(2, round(0.3 * cells))
        counts = (
            [{}, {}, {}] if part is None else [{"cells": part}, {"cells": max(2, cells - 2 * part)}, {"cells": part}]
        )
        kinds = ("rod", "catenary", "rod")
        zones = [{kind: share * L} | n for kind, share, n in zip(kinds, (0.3, 0.4, 0.3), counts, strict=True)]
        kind = {"kind": "zones", "zones": zones}
    elif cells is not None:
        tables["mesh"] = {"cells": cells} | tables.get("mesh", {})
    if tables.pop("slack", False) and model in ("catenary", "zones"):
        kind = {"kind": model, **(kind if isinstance(kind, dict) else {}), "slack": "warn"}
    tables.setdefault("initial", "equilibrium")
    if "axial_stiffness" in section:
        section = {"max_strain": ANY_STRAIN} | section
    if model == "catenary":
        section = {k: v for k, v in section.items() if k not in ("bending_stiffness", "torsional_stiffness")}
    return cable_scene(section, start, end, environment=environment, model=kind, initial=None) | tables


def pinned(at: Sequence[float] = (0.0, 0.0, 0.0), **more: Any) -> dict[str, Any]:
    return {"kind": "pinned", "position": list(map(float, at)), **more}


def clamped(at: Sequence[float], tangent: Sequence[float], **more: Any) -> dict[str, Any]:
    return {"kind": "clamped", "position": list(map(float, at)), "tangent": list(map(float, tangent)), **more}


def free(force: Sequence[float] | None = None, **more: Any) -> dict[str, Any]:
    return {"kind": "free"} | ({} if force is None else {"force": list(map(float, force))}) | more


def across(direction: Floats) -> Floats:
    """A unit vector at right angles to a direction."""
    other = np.cross(direction, Z if abs(direction[2]) < 0.9 else X)
    return np.asarray(other / np.linalg.norm(other))


def spread(seed: int, count: int, **ranges: Any) -> Iterator[dict[str, Any]]:
    """`count` draws that fill their ranges evenly (a Latin hypercube): (low, high) in decades, or a list to pick from."""
    rng = np.random.default_rng(seed)
    columns: dict[str, list[Any]] = {}
    for name, values in ranges.items():
        places = (rng.permutation(count) + rng.random(count)) / count
        if isinstance(values, tuple):
            low, high = np.log10(values[0]), np.log10(values[1])
            columns[name] = [float(f"{10 ** (low + p * (high - low)):.2g}") for p in places]
        else:
            columns[name] = [values[int(p * len(values))] for p in places]
    for k in range(count):
        yield {name: column[k] for name, column in columns.items()}


Family = Callable[[], Iterator[Case]]


def each(*values: Iterable[Any]) -> Callable[[Callable[..., Iterator[Case]]], Family]:
    """Make a family of what makes the cases of one combination of values."""
    every = [*product(*values)]
    return lambda one: lambda: (case for given in every for case in one(*given))


def drawn(seed: int, count: int, **ranges: Any) -> Callable[[Callable[..., Iterator[Case]]], Family]:
    """Make a family of what makes the cases of one draw of `spread`."""
    return each(spread(seed, count, **ranges))
