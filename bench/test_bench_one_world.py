"""Whether a cable is a network of one line: each of its scenes as both, every dataset and event.

    pytest bench/test_bench_one_world.py -m bench -n 0 -s                       # all: an hour of one processor
    pytest bench/test_bench_one_world.py -m bench -n 0 -s -k "digests or rest"  # families: see FAMILIES
    HYBRID_ONE_WORLD=winch pytest bench/test_bench_one_world.py -m bench -n 0 -s -k examples

computes scenes of the digests, of the examples and of the pairs of features, in space and with steps that end at outputs,
and compares to 1e-9 of the scale of each dataset (tests/combinations/networks.py).  HYBRID_ONE_WORLD: part of the names
of scenes that are to be computed.  One line a scene, then a summary; a scene that differs beyond what EXCEPTIONS allows
fails.
"""

from __future__ import annotations

import copy
import os
import signal
import sys
import warnings
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
import yaml
from digest_scenes import EXAMPLES, at_rest, moving

import hybrid
from hybrid.errors import ComputationError, HybridError, SceneError

sys.path.insert(0, str(Path(__file__).parents[1]))  # of the tests, where scenes are said in other ways
from tests.combinations.networks import Difference, both, differences, events_differ
from tests.combinations.pairs import FEATURES, pairs, scene_of

pytestmark = pytest.mark.bench
Data = dict[str, Any]
ONLY = os.environ.get("HYBRID_ONE_WORLD", "")
MOST_SECONDS = 90  # of a scene: both of its computations
PARTS = 8  # of the pairs
EVENTS = "events"  # stands for their kinds, as if they were a dataset


class _Exception(NamedTuple):
    """What of a scene may differ, and why."""

    datasets: tuple[str, ...]  # how their names begin
    by: float  # of their scale; infinite: they may be of other sizes
    why: str


ESTIMATED = _Exception(("errors/", EVENTS), np.inf, "figures of a network are estimated otherwise")
# By part of the name of a scene, or of the digests: the first counts.
EXCEPTIONS: dict[str, _Exception] = {
    "steps that follow the motion": ESTIMATED,
    "rest of touchdown, 1%": ESTIMATED,
    "errors of fixed steps": ESTIMATED,
    "rest of table_with_turns": _Exception((EVENTS,), 0.0, "the cable says the same twice"),
    "contact/trefoil": _Exception(("",), 1e-1, "contact begins in mid-motion from accelerations that differ"),
}


class _Late(Exception):
    pass


@contextmanager
def _within(seconds: int) -> Iterator[None]:
    """Stop what takes longer."""

    def ring(*_: Any) -> None:
        raise _Late

    before = signal.signal(signal.SIGALRM, ring)
    signal.alarm(seconds)
    try:
        yield
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)


def _digests() -> dict[str, Data]:
    return {name: data for name, data in moving().items() if "lines" not in data}


def _rest() -> dict[str, Data]:
    return {name: data for name, data in at_rest().items() if "lines" not in data}


def _examples() -> dict[str, Data]:
    """All examples of one cable, of motions the first 150 steps or seconds."""
    found = {}
    for path in sorted(EXAMPLES.rglob("*.yaml")):
        data = yaml.safe_load(path.read_text(encoding="utf-8"))
        if not isinstance(data, dict) or "cable" not in data:
            continue
        for thing in data.get("obstacles", {}).values():
            if "file" in thing:
                thing["file"] = str(path.parent / thing["file"])
        if time := data.get("time"):
            time["duration"] = min(time["duration"], 150 * time["step"] if "step" in time else 5.0)
            data.setdefault("output", {})["every"] = time["duration"] / 10
        found[str(path.relative_to(EXAMPLES).with_suffix(""))] = data
    return found


def _features() -> dict[str, Data]:
    return {name: scene_of(name) for name in FEATURES}


def _pairs(part: int) -> dict[str, Data]:
    return {" + ".join(names): scene_of(*names) for names in [*pairs()][part::PARTS]}


FAMILIES = {
    "digests": _digests, "rest": _rest, "examples": _examples, "features": _features,
    **{f"pairs {k}": partial(_pairs, k) for k in range(PARTS)},
}  # fmt: skip


def _why(name: str, found: Sequence[Difference], events: Sequence[str]) -> str:
    """Why a scene may differ so; empty: it may not."""
    for part, x in EXCEPTIONS.items():
        if part in name:
            known = all(d.by <= x.by and d.name.startswith(x.datasets) for d in found)
            return x.why if known and (not events or EVENTS.startswith(x.datasets)) else ""
    return ""


def _compared(name: str, data: Data, rest: bool) -> tuple[str, str]:
    """How a scene went, in one word, and what is to be said of it."""
    try:
        with _within(MOST_SECONDS):
            cable, network = both(copy.deepcopy(data), rest)
    except _Late:
        return "late", f"more than {MOST_SECONDS} s"
    except (SceneError, ComputationError) as error:
        return _as_cable(data, rest, error)
    with cable, network:
        found, events = differences(cable, network), events_differ(cable, network)
    told = ", ".join(map(str, found[:4])) + (f" and {len(found) - 4} more" if len(found) > 4 else "")
    told += f" | events {', '.join(events)}" if events else ""
    if not told:
        return "same", ""
    if why := _why(name, found, events):
        return "exception", f"{told} ({why})"
    return "differs", told


def _as_cable(data: Data, rest: bool, error: HybridError) -> tuple[str, str]:
    """How a scene went of which one of the two is not computed: neither is, or one alone."""
    text = f"{type(error).__name__}: {' '.join(str(error).split())[:160]}"
    try:
        with _within(MOST_SECONDS):
            (hybrid.static if rest else hybrid.run)(copy.deepcopy(data)).close()
    except _Late:
        return "late", f"more than {MOST_SECONDS} s"
    except (SceneError, ComputationError):
        return "neither", text
    return "differs", f"the cable is computed; {text}"


@pytest.mark.parametrize("family", FAMILIES)
def test_cables_are_networks(family: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(EXAMPLES)  # files that scenes name
    scenes = {name: data for name, data in FAMILIES[family]().items() if ONLY in name}
    went = Counter[str]()
    differ = []
    for name, data in scenes.items():
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            how, told = _compared(name, data, rest=not data.get("time") or family == "rest")
        went[how] += 1
        differ += [name] if how == "differs" else []
        print(f"\n{family:10}{name:56}{how:18}{told}", end="", flush=True)
    print(f"\n{family}: {len(scenes)} scenes: " + ", ".join(f"{n} {how}" for how, n in went.most_common()), flush=True)
    assert not differ, f"{len(differ)} of {len(scenes)} differ: {', '.join(differ)}"
