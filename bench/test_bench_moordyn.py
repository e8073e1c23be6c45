"""hybrid on the scene of a deck, and MoorDyn on the deck: the pull of the fairlead, at rest and heaved.

    pip install -e ".[dev,bench]"
    pytest bench/test_bench_moordyn.py -m bench -s

The deck is imported as `hybrid import` does; its scene gets a heave of 1 m at 8 s (ramp 16 s), accuracy 0.1 %, and cells
of its own choice.  MoorDyn takes the deck as it stands, with 0.5, 1 and 2 times its segments, its fairlead moved the
same way.  MoorDyn's rest is what it comes to when it is marched with its fairlead still, whatever its own search for it
has found before.  Both are the force on the fairlead, the last half segment's weight included.

What is expected: a first difference of a few per cent where lumped masses land on the bed one by one (the minimum of a
chain that touches down), which goes with more segments; what is left at the finest is within the bounds below.
"""

from __future__ import annotations

import tempfile
from dataclasses import dataclass
from pathlib import Path

import arbiter
import numpy as np
import pytest
from numpy.typing import NDArray
from peers.moordyn_deck import Motion, march, options, segments

import hybrid
from hybrid.interop.moordyn import ImportedDeck
from hybrid.interop.moordyn.deck import read_deck
from hybrid.interop.moordyn.rows import read_source
from hybrid.scene.motion import EndMotion

pytestmark = pytest.mark.bench
DECKS = Path(__file__).parents[1] / "tests" / "data" / "moordyn"
Vector = NDArray[np.float64]

AMPLITUDE, PERIOD, RAMP, DURATION, EVERY = 1.0, 8.0, 16.0, 48.0, 0.1
STILL = 60.0  # s over which MoorDyn comes to rest; the last 10 s are averaged
FACTORS = (0.5, 1.0, 2.0)


@dataclass(frozen=True)
class Case:
    """line: of which the cable is taken; end: that heaves; point: of the deck, there; step: MoorDyn's, at FACTORS[1].

    bounds: of rest, mean, peak, minimum at the finest, per cent.
    """

    line: int
    end: str
    point: int
    step: float
    bounds: tuple[float, float, float, float]


CASES = {
    "chain": Case(1, "end", 2, 1e-3, (0.1, 0.1, 0.6, 1.0)),
    "rope_and_chain": Case(1, "end", 3, 5e-4, (0.2, 0.1, 0.3, 0.3)),
    "generator_chain": Case(1, "end", 2, 1e-3, (0.1, 0.1, 0.6, 1.0)),
    "generator_clump": Case(1, "end", 3, 5e-4, (0.1, 0.1, 0.3, 0.3)),
    "generator_spread": Case(1, "end", 2, 4e-4, (0.2, 0.1, 1.0, 1.0)),
    "free_fall": Case(1, "start", 1, 2.5e-4, (0.1, 0.1, 0.2, 0.2)),
}


def ours(name: str, case: Case) -> tuple[Vector, hybrid.Scene]:
    """Rest, mean, peak, minimum of the pull, N; and the scene."""
    (made,) = hybrid.import_moordyn(DECKS / f"{name}.txt", case.line).scenes.values()
    data = made.scene.model_dump(mode="json", exclude_none=True)
    del data["mesh"]
    rest = hybrid.static(hybrid.validate_scene(data))
    data["ends"][case.end]["motion"] = {"heave": {"amplitude": AMPLITUDE, "period": PERIOD}, "ramp": RAMP}
    scene = hybrid.validate_scene(
        data | {"time": {"duration": DURATION}, "accuracy": "0.1%", "output": {"every": EVERY}}
    )
    pull = np.linalg.norm(hybrid.run(scene)[f"reaction_{case.end}"], axis=1)
    return figures(float(np.linalg.norm(rest[f"reaction_{case.end}"][-1])), pull), scene


def theirs(name: str, case: Case, scene: hybrid.Scene, factor: float) -> Vector:
    path = DECKS / f"{name}.txt"
    points = read_deck(read_source(path)).points
    end = getattr(scene.ends, case.end)
    heave = EndMotion(end.motion, end.position)
    coupled = [points[k] for k in sorted(points) if points[k].kind == "coupled"]

    def motion(still: bool) -> Motion:
        def at(t: float) -> Vector:
            here = [heave.at_time(0.0 if still else t)[0] if p.id == case.point else np.array(p.place) for p in coupled]
            return np.concatenate(here)

        return at

    step = case.step / factor
    quiet = {"disableOutput": 1, "disableOutTime": 1, "writeLog": 0}
    text = options(segments(path.read_text(), factor), dtM=step, tScheme="RK4", TmaxIC=30, **quiet)
    still = march(text, motion(True), STILL, EVERY, 10 * step)
    rest = float(np.linalg.norm(still.forces[case.point][-100:].mean(axis=0)))
    seen = march(text, motion(False), DURATION, EVERY, 2 * step)
    return figures(rest, np.linalg.norm(seen.forces[case.point], axis=1))


def figures(rest: float, pull: Vector) -> Vector:
    """Rest, and mean, peak, minimum over the last two periods."""
    last = pull[-round(2 * PERIOD / EVERY) :]
    return np.array([rest, last.mean(), last.max(), last.min()])


@pytest.mark.parametrize("name", CASES)
def test_a_deck_and_its_scene_pull_alike(name: str) -> None:
    pytest.importorskip("moordyn")
    case = CASES[name]
    here, scene = ours(name, case)
    print(f"\n{name}: pull of the fairlead, N, and MoorDyn against it, %")
    print("| | rest | mean | peak | minimum |\n|---|---|---|---|---|")
    print("| hybrid, 0.1 % | " + " | ".join(f"{x:.0f}" for x in here) + " |")
    for factor in FACTORS:
        there = theirs(name, case, scene, factor)
        off = 100 * (there / here - 1)
        print(f"| MoorDyn, {factor:g} x its segments | " + " | ".join(f"{x:+.2f}" for x in off) + " |", flush=True)
    assert (np.abs(off) <= case.bounds).all(), f"{off} against {case.bounds}"


def test_a_line_that_doubles_back_at_a_rod_is_not_alike() -> None:
    """A limit that is known: rod_end.txt with its line led over the rod and down into end B, at rest.

    MoorDyn's shape stays away from ours, with more segments a little more; hybrid and the arbiter, which share no equation,
    agree.  Bounds: a tenth of MoorDyn's distance for ours; its own two-sided, so that a version that agrees is noticed.
    """
    pytest.importorskip("moordyn")
    text = (DECKS / "rod_end.txt").read_text().replace("R1A", "R1B")
    (made,) = from_text(text).scenes.values()
    data = made.scene.model_dump(mode="json", exclude_none=True) | {"model": "rod", "output": {"points": 61}}
    # What the arbiter does not know, and what does nothing here: the bed and the surface are far off, and all is at rest.
    del data["environment"]["seabed"], data["environment"]["fluid"]["surface"], data["cable"]["sections"][0]["damping"]
    fine = hybrid.static(hybrid.validate_scene(data | {"mesh": {"cells": 400}})).position[-1]
    ours = hybrid.validate_scene(data)
    other = arbiter.at(arbiter.static(ours), hybrid.static(ours).s)["position"]
    between = np.linalg.norm(fine - other, axis=1).max()
    print(f"\nline that doubles back, 62 m: hybrid and the arbiter {between:.3f} m apart")
    for factor, step in ((1.0, 2e-4), (2.0, 1e-4)):
        quiet = {"disableOutput": 1, "disableOutTime": 1, "writeLog": 0}
        deck = options(segments(text, factor), dtM=step, tScheme="RK4", **quiet)
        nodes = march(deck, lambda t: np.zeros(0), 20.0, 1.0, 0.5).nodes[1][:: round(factor)]
        off = np.linalg.norm(nodes - fine, axis=1).max()
        print(f"MoorDyn, {60 * factor:.0f} segments: {off:.3f} m from ours", flush=True)
        assert 1.0 < off < 4.0
    assert between < 0.3


def from_text(text: str) -> ImportedDeck:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "deck.txt")
        path.write_text(text)
        return hybrid.import_moordyn(path)
