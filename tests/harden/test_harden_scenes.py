"""Scenes harmed by chance: each is computed whole, or refused, or stopped with its place; nothing is raised, nothing hangs.

    pytest tests/harden -m bench -s -k two_thousand

prints how two thousand of them end.
"""

from __future__ import annotations

import time
from collections import Counter, defaultdict
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from harden_scenes import all_scenes
from harden_tree import Box, Entry, Row, to_tree, write
from harden_verdict import Verdict, command, judge
from harden_ways import EXPECTED_AT_KEY, Harm, harmed

# Every so many-th scene is asked for its equilibrium alone.
STATIC = 8


def _inside(node: Any) -> Iterator[Any]:
    """An entry or table, and what is in it."""
    yield node
    for each in [node.value] if isinstance(node, Entry) else node.entries if isinstance(node, Box | Row) else ():
        yield from _inside(each)


def off_the_mark(harms: list[Harm], places: dict[int, int], verdict: Verdict) -> bool:
    """Whether a refusal of the only harm points neither at it nor at a table around it."""
    if verdict.outcome != "refused" or len(harms) > 1 or harms[0].way not in EXPECTED_AT_KEY:
        return False
    lines = {places[id(x)] for touched in harms[0].touched for x in _inside(touched) if id(x) in places}
    return not lines & set(verdict.lines)


def judged(seed: int) -> tuple[str, list[Harm], Verdict]:
    """A harmed scene of that number, and what became of it, in the present folder."""
    name, tree, harms = harmed(seed, all_scenes())
    text, places = write(tree)
    scene = Path(f"scene{seed}.yaml")
    scene.write_text(text, encoding="utf-8")
    verdict = judge(scene, seed, static=seed % STATIC == 0)
    if off_the_mark(harms, places, verdict):
        verdict.faults.append(f"points at lines {verdict.lines} and not at the harm")
    for left in Path().glob(f"scene{seed}.*"):
        left.unlink()
    return name, harms, verdict


@pytest.fixture
def warm(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A folder of its own, and the kernels compiled before the clock runs."""
    monkeypatch.chdir(tmp_path)
    for name, model in (
        ("touchdown", "adaptive"),
        ("touchdown", "rod"),
        ("sea", "catenary"),
    ):
        data = all_scenes()[name]
        Path("warm.yaml").write_text(write(to_tree(data | {"model": model}))[0], encoding="utf-8")
        for way in ("run", "static"):
            command(way, "warm.yaml", "-q", seconds=600)


def table(verdicts: list[tuple[str, list[Harm], Verdict]], seconds: float) -> str:
    """How they ended, by cause."""
    rows = [
        f"{len(verdicts)} harmed scenes in {seconds:.0f} s, {sum(bool(v.faults) for _, _, v in verdicts)} with a fault"
    ]
    words = {"ran": "ran to their end", "refused": "refused", "failed": "stopped", "long": "foretold to be long, not run",
             "slow": "steps that the motion asks for, stopped by the clock", "late": "LATE"}  # fmt: skip
    by: dict[str, Counter[str]] = defaultdict(Counter)
    for _, _, verdict in verdicts:
        by[verdict.outcome][verdict.cause] += 1
    for outcome, causes in sorted(by.items(), key=lambda x: list(words).index(x[0])):
        rows.append(f"{sum(causes.values()):6d}  {words[outcome]}")
        if outcome in ("refused", "failed"):
            few = [(cause, n) for cause, n in causes.most_common() if n > 1 or outcome == "failed"]
            rows += [f"        {n:6d}  {cause}" for cause, n in few]
            rest = sum(causes.values()) - sum(n for _, n in few)
            rows += [f"        {rest:6d}  keys that do not exist, and the like"] if rest else []
    slowest = max(verdicts, key=lambda x: x[2].seconds)
    rows.append(f"the longest took {slowest[2].seconds:.1f} s: {slowest[0]}, {'; '.join(h.what for h in slowest[1])}")
    return "\n".join(rows)


def _none_is_bad(seeds: range) -> None:
    begin, verdicts, bad = time.perf_counter(), [], []
    for seed in seeds:
        name, harms, verdict = judged(seed)
        verdicts.append((name, harms, verdict))
        if verdict.faults:
            what = "; ".join(h.what for h in harms)
            bad.append(f"{seed}: {name}, {what}: {verdict.outcome}\n    " + "\n    ".join(verdict.faults[:3]))
    print("\n" + table(verdicts, time.perf_counter() - begin))
    assert not bad, "\n".join(bad)
    ended = Counter(verdict.outcome for _, _, verdict in verdicts)
    assert ended["ran"] and ended["refused"], "the harms do not reach the reader, or nothing comes through"


@pytest.mark.long
def test_the_scenes_are_whole_before_they_are_harmed(warm: None) -> None:
    """What is harmed is accepted, written and read back the same."""
    for k, (name, data) in enumerate(all_scenes().items()):
        Path("whole.yaml").write_text(write(to_tree(data))[0], encoding="utf-8")
        if k % 4 == 0:
            verdict = judge(Path("whole.yaml"), seed=k)
            assert verdict.outcome in ("ran", "failed") and not verdict.faults, (name, verdict)
        else:
            assert command("plan", "whole.yaml").code == 0, name


@pytest.mark.long
def test_harmed_scenes(warm: None) -> None:
    _none_is_bad(range(10_000, 10_040))


@pytest.mark.bench
def test_two_thousand_harmed_scenes(warm: None) -> None:
    _none_is_bad(range(2000))
