"""hybrid on the scene of a deck of several lines, and MoorDyn on the deck: the pull of fairleads, at rest and heaved.

    pip install -e ".[dev,bench]"
    pytest bench/test_bench_moordyn_systems.py -m bench -s

Decks of MoorDyn's own tests come in as one scene, as `hybrid import` makes it; all coupled points and bodies heave alike
by 1 m at 8 s (ramp 16 s).  Both programs have the same segments.  MoorDyn's rest is what it comes to when it
is marched with its fairleads still.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from peers.moordyn_deck import march, options, segments
from peers.moordyn_systems import DECKS

import hybrid
from hybrid.interop.moordyn.deck import Deck, read_deck
from hybrid.interop.moordyn.rows import read_source
from hybrid.interop.moordyn.tables import rotation_of
from hybrid.scene.motion import EndMotion
from hybrid.scene.motion_tables import Motion

pytestmark = pytest.mark.bench
Vector = NDArray[np.float64]
MOTION: dict[str, Any] = {"heave": {"amplitude": 1.0, "period": 8.0}, "ramp": 16.0}
PERIOD, DURATION, EVERY = 8.0, 48.0, 0.1
LAST = round(2 * PERIOD / EVERY)
# Points whose force is compared, segments in those of the deck (ours and MoorDyn's), MoorDyn's step (s), and the time it
# takes to come to rest (s).
CASES: dict[str, tuple[tuple[int, ...], int, float, float]] = {
    "lines": ((4, 5, 6), 2, 2e-3, 100.0),
    "lines_body": ((4, 5, 6), 2, 2e-3, 100.0),
    "duplicated": ((2,), 2, 4e-4, 60.0),
    "hanging": ((1, 2), 1, 4e-4, 60.0),
    "complex_system": ((4,), 1, 1e-4, 40.0),
}
MEAN, PEAK = 0.5, 2.0  # per cent: figures that are asked for


def moved(deck: Deck, name: str) -> bool:
    """Whether a point or body of the scene is one that the program that calls MoorDyn moves."""
    things: dict[int, Any] = deck.bodies if name.startswith("body") else deck.points
    return things[int(name.removeprefix("body").removeprefix("point"))].kind == "coupled"


def ours(path: Path, deck: Deck, points: tuple[int, ...], factor: int) -> tuple[Vector, Vector]:
    """Rest (n,), and pull (n, nt) of points, N."""
    (made,) = hybrid.import_moordyn(path).scenes.values()
    data = made.scene.model_dump(mode="json", exclude_none=True)
    if "cable" in data:
        return of_one_cable(data)
    for line in data["lines"].values():
        if "cells" in line["mesh"]:
            line["mesh"] = {"cells": factor * line["mesh"]["cells"]}
        else:
            s = np.array(line["mesh"]["nodes"])
            line["mesh"] = {
                "nodes": np.interp(np.arange(factor * (s.size - 1) + 1) / factor, np.arange(s.size), s).tolist()
            }
    still = hybrid.static(dict(data))
    rest = np.array([np.linalg.norm(still[f"points/point{k}/force"][-1]) for k in points])
    for name, thing in (data["points"] | data["bodies"]).items():
        if thing["kind"] == "fixed" and moved(deck, name):
            thing["motion"] = MOTION
    data |= {"time": {"duration": DURATION, "step": 0.05}, "output": {"every": EVERY}}
    result = hybrid.run(data)
    return rest, np.array([np.linalg.norm(result[f"points/point{k}/force"], axis=1) for k in points])


def of_one_cable(data: dict[str, Any]) -> tuple[Vector, Vector]:
    """The same of lines that meet at a knot without mass, which come in as one cable between their two other points."""
    still = hybrid.static(dict(data))
    for end in data["ends"].values():
        end["motion"] = MOTION
    result = hybrid.run(data | {"time": {"duration": DURATION, "step": 0.05}, "output": {"every": EVERY}})
    both = "reaction_start", "reaction_end"
    return np.array([np.linalg.norm(still[x][-1]) for x in both]), np.array(
        [np.linalg.norm(result[x], axis=1) for x in both]
    )


def theirs(
    path: Path, deck: Deck, points: tuple[int, ...], factor: int, step: float, settle: float
) -> tuple[Vector, Vector]:
    heave = EndMotion(Motion.model_validate(MOTION), (0.0, 0.0, 0.0))
    bodies = [body for body in deck.bodies.values() if body.kind == "coupled"]
    coupled = [point for point in deck.points.values() if point.kind == "coupled"]

    def motion(still: bool) -> Any:
        def at(t: float) -> Vector:
            up = heave.at_time(0.0 if still else t)[0]
            here = [np.concatenate([np.array(body.place) + up, np.radians(body.angles)]) for body in bodies]
            return np.concatenate([*here, *(np.array(point.place) + up for point in coupled), np.zeros(0)])

        return at

    quiet = {"disableOutput": 1, "disableOutTime": 1, "writeLog": 0}
    text = options(segments(path.read_text(), factor), dtM=step, tScheme="RK4", TmaxIC=30, **quiet)
    rest = march(text, motion(True), settle, EVERY, 10 * step)
    here = np.array([np.linalg.norm(rest.forces[k][-50:].mean(axis=0)) for k in points])
    seen = march(text, motion(False), DURATION, EVERY, 2 * step)
    pull = np.array([np.linalg.norm(seen.forces[k], axis=1) for k in points])
    return here, pull


# A submerged buoy, turned at first, its centre of mass below its origin, on three lines of unequal length.
BUOY = """\
--- LINE TYPES ---
TypeName Diam Mass/m EA BA EI Cd Ca CdAx CaAx
(-) (m) (kg/m) (N) (N-s) (N-m^2) (-) (-) (-) (-)
chain 0.08 30 5.0e7 -0.8 0 1.2 1.0 0.1 0.0
--- BODIES ---
ID Attachment X0 Y0 Z0 r0 p0 y0 Mass CG I Volume CdA Ca
(#) (-) (m) (m) (m) (deg) (deg) (deg) (kg) (m) (kg-m^2) (m^3) (m^2) (-)
1 Free 3 -2 -40 8 -5 12 3.0e4 0.1|0.2|-0.8 2.0e5|3.0e5|2.5e5 60 30|300000 1.0
--- POINTS ---
ID Attachment X Y Z M V CdA Ca
(#) (-) (m) (m) (m) (kg) (m^3) (m^2) (-)
1 Coupled 80 0 -100 0 0 0 0
2 Coupled -50 75 -100 0 0 0 0
3 Coupled -40 -70 -100 0 0 0 0
4 Body1 3 0 -0.5 0 0 0 0
5 Body1 -1.5 2.6 -0.5 0 0 0 0
6 Body1 -1.5 -2.6 -0.5 0 0 0 0
--- LINES ---
ID LineType AttachA AttachB UnstrLen NumSegs Outputs
(#) (-) (-) (-) (m) (-) (-)
1 chain 1 4 98 20 -
2 chain 2 5 104 20 -
3 chain 3 6 100 20 -
--- OPTIONS ---
100 WtrDpth
--- need this line ---
"""


def test_a_free_body_comes_to_rest_as_in_moordyn(tmp_path: Path) -> None:
    """Place, turning and pull on the anchors."""
    moordyn = pytest.importorskip("moordyn")
    path = tmp_path / "buoy.txt"
    path.write_text(BUOY)
    (made,) = hybrid.import_moordyn(path).scenes.values()
    result = hybrid.static(made.scene)
    text = options(BUOY, dtM=1e-3, tScheme="RK4", disableOutput=1, disableOutTime=1, writeLog=0, TmaxIC=120)
    path.write_text(text)
    held = [80.0, 0.0, -100.0, -50.0, 75.0, -100.0, -40.0, -70.0, -100.0]
    place, pulls = np.zeros(6), np.zeros(3)  # means of the last 100 s
    network = moordyn.Create(str(path))
    try:
        assert moordyn.Init(network, held, [0.0] * 9) == 0
        for i in range(4000):
            moordyn.Step(network, held, [0.0] * 9, 0.05 * i, 0.05)
            if i >= 2000:
                place += np.array(moordyn.GetBodyState(moordyn.GetBody(network, 1))[0][:6]) / 2000
                pulls += [np.linalg.norm(moordyn.GetPointForce(moordyn.GetPoint(network, k))) / 2000 for k in (1, 2, 3)]
    finally:
        moordyn.Close(network)
    ours = np.concatenate([result["bodies/body1/position"][-1], result["bodies/body1/rotation"][-1]])
    turned = rotation_of(tuple(np.degrees(place[3:])))
    print(f"\nplace and turning: {ours.round(3)}, MoorDyn {place[:3].round(3)} {np.round(turned, 3)}")
    for k, there in enumerate(pulls, 1):
        here = np.linalg.norm(result[f"points/point{k}/force"][-1])
        print(f"| buoy point {k} | {here:.1f} | {100 * (there / here - 1):+.3f} % |")
        assert abs(there / here - 1) <= 0.005
    assert np.abs(ours[:3] - place[:3]).max() <= 0.02 and np.abs(ours[3:] - turned).max() <= 0.02


# A scene, the points and ends whose pull is compared, and the time it takes MoorDyn to come to rest, s.
BACK: dict[str, tuple[tuple[str, ...], float]] = {
    "lines": (("point4", "point5", "point6"), 20.0),
    "complex_system": (("point1", "point2", "point4"), 20.0),
    "examples/touchdown.yaml": (("start", "end"), 30.0),
}


@pytest.mark.parametrize("name", BACK)
def test_a_scene_written_as_a_deck_pulls_alike_at_rest(name: str, tmp_path: Path) -> None:
    """Of points and of ends of one cable; without a current, which a deck has not."""
    pytest.importorskip("moordyn")
    pulls, settle = BACK[name]
    if name in DECKS:
        (tmp_path / "deck.txt").write_text(DECKS[name])
        (made,) = hybrid.import_moordyn(tmp_path / "deck.txt").scenes.values()
        scene: Any = made.scene
    else:
        scene = hybrid.load_scene(Path(__file__).parents[1] / name)
    result = hybrid.static(scene)
    deck = hybrid.export_moordyn(result, tmp_path / "back.txt")
    ids = dict(
        reversed(word.split(": ")) for word in deck.text.splitlines()[1].removeprefix("point ").split("; point ")
    )
    # Of fixed points MoorDyn tells no force; coupled ones that stay are the same.
    text = options(deck.text.replace("Fixed", "Coupled"), disableOutput=1, disableOutTime=1, writeLog=0, TmaxIC=30)
    rows = deck.text.split("--- POINTS ---\n")[1].split("---")[0].splitlines()[2:]
    held = np.concatenate([np.array(row.split()[2:5], float) for row in rows if row.split()[1] in ("Fixed", "Coupled")])
    rest = march(text, lambda t: held, settle, EVERY, EVERY / 50)
    for pull in pulls:
        ours = result[f"points/{pull}/force" if name in DECKS else f"reaction_{pull}"][-1]
        theirs = rest.forces[int(ids[pull])][-50:].mean(axis=0)
        here, there = np.linalg.norm(ours), np.linalg.norm(theirs)
        print(f"| {name} {pull} | {here:.2f} | {100 * (there / here - 1):+.3f} % |", flush=True)
        assert abs(there / here - 1) <= 0.005


@pytest.mark.parametrize("name", CASES)
def test_a_deck_of_several_lines_and_its_scene_pull_alike(name: str, tmp_path: Path) -> None:
    pytest.importorskip("moordyn")
    points, factor, step, settle = CASES[name]
    path = tmp_path / f"{name}.txt"
    path.write_text(DECKS[name])
    deck = read_deck(read_source(path))
    rest, pull = ours(path, deck, points, factor)
    their_rest, their_pull = theirs(path, deck, points, factor, step, settle)
    for i, k in enumerate(points):
        here, there = pull[i, -LAST:], their_pull[i, -LAST:]
        figures = [
            (rest[i], their_rest[i]),
            (here.mean(), there.mean()),
            (here.max(), there.max()),
            (here.min(), there.min()),
        ]
        words = " | ".join(f"{a:.0f} {100 * (b / a - 1):+.2f} %" for a, b in figures)
        print(f"| {name} point {k} | {words} |", flush=True)
        mean, peak = (abs(b / a - 1) for a, b in figures[1:3])
        assert 100 * mean <= MEAN and 100 * peak <= PEAK
