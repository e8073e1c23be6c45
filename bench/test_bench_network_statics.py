"""Equilibria of random networks of two to six lines: how many are found and stay, refused and why, wrong in silence.

    pytest bench/test_bench_network_statics.py -m bench -s -n 0
    NETWORKS=1000 pytest bench/test_bench_network_statics.py -m bench -s -n 0

The networks are those of `random_scenes.random_network`: buoys, bodies, risers, bridles and lines in a row.  One that is
found is wrong in silence where a node is out of balance, where a rod folds or a catenary is compressed and no event says
so, or where a motion of some swings of the longest line, with the loads and the friction of the scene, goes away from it.
Of each that is refused it is asked whether an equilibrium exists: from other first places of what is free, or from the
equilibrium in still water, or without bending.  REFUSED bounds those for which one is found.
"""

from __future__ import annotations

import copy
import os
import time
from collections import Counter
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
import pytest
from random_scenes import in_the_water, random_network

import hybrid
from hybrid.errors import ComputationError, SceneError

pytestmark = pytest.mark.bench
NETWORKS = int(os.environ.get("NETWORKS", "40"))
# Of the largest tension: the force out of balance; of the longest line: what a motion may go away, and its steps.
BALANCED, STAYS, STEPS = 1e-6, 1e-4, 20
REFUSED, PLACES = 0.02, 6


def flaws_of(found: hybrid.Result, scene: dict[str, Any]) -> tuple[list[str], list[str]]:
    """What is wrong with an equilibrium and not said by an event; and what is said."""
    silent, said = list[str](), list[str]()
    largest = max(float(np.abs(line.tension).max()) for line in found.lines.values())
    left = float(found.attributes["static_residual"])
    if not left <= BALANCED * largest:
        silent.append(f"{left:.2g} N out of balance under {largest:.2g} N")
    for name, line in found.lines.items():
        T, s, kinds = np.ravel(line.tension), np.asarray(line.s), {event.kind for event in line.events}
        bends = [event.s_a for event in line.events if event.kind == "unresolved bend"]
        d = np.diff(line.position[-1], axis=0)
        if (np.einsum("ij,ij->i", d[1:], d[:-1]) < 0.0).any():
            (said if kinds & {"unresolved bend", "kink at joint"} else silent).append(f"{name} folded")
        if T.min() < -0.01 * largest and scene["lines"][name]["model"] == "catenary":
            there = any(abs(x - s[np.argmin(T)]) < 1e-9 for x in bends)
            (said if there or "slack" in kinds else silent).append(f"{name} compressed")
    return silent, said


def leaves(found: hybrid.Result, scene: dict[str, Any]) -> str:
    """How a motion goes away from an equilibrium; "": it stays there."""
    longest = max(sum(x["length"] for x in line["sections"]) for line in scene["lines"].values())
    step = 0.5 * float(np.sqrt(longest / 9.81))
    try:
        run = hybrid.run(scene | {"time": {"duration": STEPS * step, "step": step}, "output": {"every": step}})
    except ComputationError as error:
        return f"the motion stops: {str(error).splitlines()[0]}"
    away = max(float(np.abs(line.position - line.position[0]).max()) for line in run.lines.values())
    return f"the motion goes {away / longest:.1g} of the longest line away" if away > STAYS * longest else ""


def others(scene: dict[str, Any], seed: int) -> Iterator[tuple[str, dict[str, Any]]]:
    """Other ways to an equilibrium of the same network."""
    rng = np.random.default_rng(seed)
    bed = scene["environment"]["seabed"]
    for k in range(PLACES):
        other = copy.deepcopy(scene)
        for free in (*other["points"].values(), *other.get("bodies", {}).values()):
            if "initial_guess" in free:
                guess = np.array(free["initial_guess"]) + rng.uniform(-0.5, 0.5, 3) * abs(bed["z"])
                free["initial_guess"] = in_the_water(guess, bed)
        yield f"other places ({k})", other
    for name in ("still water", "no bending"):
        easy = copy.deepcopy(scene)
        if name == "still water":
            easy["environment"]["fluid"]["current"] = [0.0, 0.0, 0.0]
        else:
            for line in easy["lines"].values():
                line["model"] = {"kind": "catenary", "slack": "warn"}
        try:
            found = hybrid.static(easy)
        except ComputationError:
            continue
        other = copy.deepcopy(scene)
        for key, line in found.lines.items():
            other["lines"][key]["initial"] = {"points": line.position[-1].tolist()}
        for what in ("points", "bodies"):
            for key, free in other.get(what, {}).items():
                if "initial_guess" in free:
                    free["initial_guess"] = in_the_water(found[f"{what}/{key}/position"][-1], bed)
        yield f"from {name}", other


def exists(scene: dict[str, Any], seed: int) -> str:
    """The other way that leads to an equilibrium; "": none does."""
    for name, other in others(scene, seed):
        try:
            hybrid.static(other)
        except (ComputationError, SceneError):  # a shape under the bed is no way to begin
            continue
        return name
    return ""


class Verdict(NamedTuple):
    """What became of a network: "sound", "said", "wrong" or the outcome of a refusal; in words; CPU time (s)."""

    what: str
    text: str
    cpu: float
    way: str = ""  # which other way finds an equilibrium of one that is refused


def verdict(seed: int) -> Verdict:
    kind, scene = random_network(seed)
    begin = time.process_time()
    try:
        found = hybrid.static(scene)
    except (ComputationError, SceneError) as error:
        cpu, said = time.process_time() - begin, str(error).splitlines()
        assert len(said) > 1
        if isinstance(error, SceneError):
            return Verdict("SCENE", f"{seed} ({kind}): refused, {said[0]}", cpu)
        way = exists(scene, seed)
        text = f"{seed} ({kind}): refused, {error.outcome.name}, {error.detail.split(';')[0]}; {way or 'no other way'}"
        return Verdict(error.outcome.name, text, cpu, way)
    cpu = time.process_time() - begin
    silent, said = flaws_of(found, scene)
    away = leaves(found, scene)
    what = "wrong" if silent or away else "said" if said else "sound"
    return Verdict(what, f"{seed} ({kind}): {what}, {', '.join(x for x in (*silent, *said, away) if x)}", cpu)


def test_a_network_is_found_or_refused_with_a_reason(capsys: pytest.CaptureFixture[str]) -> None:
    all_of = [verdict(seed) for seed in range(NETWORKS)]
    count, cpu = Counter(x.what for x in all_of), [x.cpu for x in all_of]
    refused = {name: n for name, n in count.most_common() if name not in ("sound", "said", "wrong")}
    missed = [x for x in all_of if x.way]
    with capsys.disabled():
        print(f"\n{NETWORKS} networks: {count['sound']} found and stay, {count['said']} with a word of their flaw, "
              f"{sum(refused.values())} refused ({', '.join(f'{k} {n}' for k, n in refused.items()) or 'none'}), of "
              f"{len(missed)} of which there is an equilibrium, {count['wrong']} wrong in silence; "
              f"CPU {np.median(cpu):.3f} s in the median, {max(cpu):.1f} s at most")  # fmt: skip
        for x in sorted(all_of):
            if x.what != "sound":
                print("  ", x.text)
    assert not count["wrong"]
    assert len(missed) <= REFUSED * NETWORKS
