"""Problems that the benches of other programs state: touchdown, a mooring of three lines, a suspension; and CableDyn on
the power cables of OrcaFlex.

Each program is run by its own module of `peers`, in the settings that its bench found best.
"""

from __future__ import annotations

import math
import tempfile
from collections.abc import Callable
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np
from peers import (
    answer,
    cabledyn_cable,
    exudyn_suspension,
    hybrid_suspension,
    moordyn_cable,
    pyelastica_suspension,
    random_moorings,
    spread_mooring,
    suspension,
)
from peers.hybrid_touchdown import answered, described
from peers.measure import BEST, PEERS, elsewhere

import hybrid
from board.answers import ROUNDS, Answer, references, timed
from board.problems import CURRENTS, SEGMENT, first_harmonic, row_of

AGREED = "two programs"  # of the touchdown
# Program, elements, EI, settings of the touchdown (test_bench_touchdown.py).
TOUCHDOWN = (
    ("CableDyn", 100, 0.0, BEST[False]),
    ("CableDyn", 100, 2e3, BEST[True]),
    ("MoorDyn", 200, 0.0, {"scheme": "RK2", "dt": 3.5e-4, "couple": 1.4e-3, "damping": -0.5}),
    ("Exudyn", 100, 0.0, {"radius": 0.2}),
    ("Exudyn", 100, 2e3, {}),
)
OURS_TOUCHDOWN = ((60, 0.0, 0.25), (100, 2e3, 0.25))  # cells, EI, step
FINEST = 0.00625  # s, of CableDyn in the mooring of three lines
MOORING = (
    ("CableDyn", spread_mooring.cabledyns, 0.1),
    ("CableDyn", spread_mooring.cabledyns, 0.05),
    ("MoorDyn", spread_mooring.moordyns, 4e-3),
)
# Program, module, segments over those of the references, step (s) of the chains in heave.
HEAVED = (("CableDyn", cabledyn_cable, 2, 0.05), ("MoorDyn", moordyn_cable, 1, 1e-3))
OURS_MOORING = ((0.1, False), (0.05, False), (0.05, True))  # step, whether errors are estimated


def rounds_of(compute: Callable[[], Any]) -> tuple[Any, float]:
    """What a peer's module returns, its CPU time last, and the median of that time (s)."""
    runs = [compute() for _ in range(ROUNDS)]
    return runs[-1], median(x[-1] for x in runs)


def named(name: str, values: Any) -> dict[str, float]:
    """Values by the quantities of a problem."""
    return dict(zip(references()["problems"][name]["quantities"], map(float, values), strict=True))


def cabledyn_on(name: str) -> list[Answer]:
    """CableDyn on a power cable of OrcaFlex, on the mesh of its own deck or test."""
    if not cabledyn_cable.available():
        return []
    problem = references()["problems"][name]
    row, heave = row_of(name), problem.get("heave")
    found, cpu = rounds_of(lambda: cabledyn_cable.run(row, heave))
    count = sum(x[2] for x in row["sections"])
    words = f"{count} elements" + (", steps of 0.05 s" if heave else "")
    if heave is None:
        return [Answer("CableDyn", named(name, [found.top[0] / 1e3, found.curvature[0].max()]), {}, cpu, words)]
    length = sum(x[1] for x in row["sections"])
    s = np.concatenate([[0.0], np.cumsum([x[1] / x[2] for x in row["sections"] for _ in range(x[2])])])
    inner = (s >= 0.03 * length) & (s <= 0.97 * length)
    late = found.t >= heave["duration"] - heave["window"] - 1e-9
    bend, pull = found.curvature[:, inner], found.top[late] / 1e3
    values = [bend[0].max(), bend[late].max(), pull[:-1].mean(), pull.min(), pull.max()]
    return [Answer("CableDyn", named(name, values), {}, cpu, words)]


def cabledyn_in_current(name: str) -> list[Answer]:
    """On the mesh of the reference and on four times as many elements."""
    row, found = row_of(name), list[Answer]()
    ((kind, length, count),) = row["sections"]
    for times in (1, 4) if cabledyn_cable.available() else ():
        cut = row | {"sections": [[kind, length, times * count]]}
        runs = [rounds_of(lambda cut=cut, x=x: cabledyn_cable.run(cut | {"current": x})) for x in CURRENTS]
        values = [x / 1e3 for run, _ in runs for x in (run.top[0], run.anchor[0])]
        spent = sum(cpu for _, cpu in runs)
        found.append(Answer("CableDyn", named(name, values), {}, spent, f"{times * count} elements"))
    return found


def heaved_chains(name: str) -> list[Answer]:
    """Six runs of CableDyn and of MoorDyn on segments of the references and on half of them."""
    problem, found = references()["problems"][name], list[Answer]()
    heave = problem["heave"]
    for program, module, times, step in HEAVED:
        if not module.available():
            continue
        values, spent = [], 0.0
        for number, _ in enumerate(problem["rows"]):
            row = row_of(name, number)
            ((kind, length, count),) = row["sections"]
            _, mass, stiffness, *_ = row["types"][kind]
            row |= {"sections": [[kind, length, times * count]], "damping": SEGMENT * math.sqrt(mass * stiffness)}
            for amplitude in heave["amplitudes"]:
                t, force, cpu = module.heaved(row, heave | {"amplitude": amplitude}, step)
                values.append(first_harmonic(t, force / 1e3, heave["period"], heave["window"]))
                spent += cpu
        words = f"segments of {SEGMENT / times:g} m, steps of {step:g} s"
        found.append(Answer(program, named(name, values), {}, spent, words))
    return found


def moorings_at_rest(name: str) -> list[Answer]:
    """Ten networks of hybrid on two meshes and of MoorPy, whose catenaries are the reference; CPU time of all ten."""
    if not spread_mooring.installed("moorpy"):
        return []
    networks = [random_moorings.random_system(seed) for seed in range(random_moorings.COUNT)]
    theirs, found = random_moorings.by_moorpy(networks), list[Answer]()
    for cells in (20, random_moorings.CELLS):
        scenes = [random_moorings.scene_of(x, cells) for x in networks]
        results, cpu = timed(lambda scenes=scenes: [hybrid.static(x) for x in scenes])
        off = []
        for result, other in zip(results, theirs, strict=True):
            right = np.array(other["tensions"])
            off.append(np.abs(random_moorings.tensions_of(result) - right).max(axis=0)[::-1] / right.max())
        found.append(Answer("hybrid", named(name, np.max(off, axis=0)), {}, cpu, f"{cells} cells to a line"))
    return [
        *found,
        Answer("MoorPy", named(name, (0.0, 0.0)), {}, sum(x["cpu"] for x in theirs), "catenaries, the reference"),
    ]


def touchdown(name: str) -> list[Answer]:
    """Whole runs with file and error figure of ours; start and time loop of the peers."""
    agreed = named(name, np.array([answer.MEAN, answer.PEAK, answer.MINIMUM]) / 1e3)
    return [
        Answer(AGREED, agreed),
        *(our_touchdown(name, *how) for how in OURS_TOUCHDOWN),
        *(peers_touchdown(name, run, agreed) for run in TOUCHDOWN if PEERS[run[0]].available()),
    ]


def our_touchdown(name: str, cells: int, EI: float, step: float) -> Answer:
    """Mean, largest and least of the last three periods."""
    scene = described(cells, EI, step, ()) | {"output": {"every": 0.2, "errors": True}}
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "run.h5"
        _, cpu = timed(lambda: hybrid.run(scene, path).close())
        with hybrid.open(path) as result:
            figures = np.array(answered(result).figures()) / 1e3
            late = result.t >= result.t[-1] - 24.0 - 1e-9
            off = result.errors["total/end_force_end"][late] / 1e3
            pull = np.linalg.norm(result.reaction_end[late], axis=1)
    own = named(name, [off.mean(), off[pull.argmax()], off[pull.argmin()]])
    words = f"{'rod, EI 2e3' if EI else 'catenary'}, {cells} cells, steps of {step} s"
    return Answer("hybrid", named(name, figures), own, cpu, words)


def peers_touchdown(name: str, run: Any, agreed: dict[str, float]) -> Answer:
    """Of a peer, in a process of its own: the fastest of three, of a long run one."""
    found = elsewhere(run)
    _, *errors = found["errors"]
    values = [right * (1.0 + off / 100.0) for right, off in zip(agreed.values(), errors, strict=True)]
    return Answer(run[0], named(name, values), {}, found["start"] + found["loop"], f"EI {run[2]:g}, {run[1]} elements")


def mooring(name: str) -> list[Answer]:
    """Pull on the first fairlead; whole runs, ours with file and error figure."""
    figures, found = spread_mooring.figures, list[Answer]()
    for step, errors in OURS_MOORING:
        pull, cpu = timed(lambda step=step, errors=errors: spread_mooring.hybrids(3, step, errors=errors)[0])
        words = f"{spread_mooring.SEGMENTS} cells, steps of {step} s" + (", errors estimated" if errors else "")
        found.append(Answer("hybrid", named(name, figures(pull) / 1e3), {}, cpu, words))
    if spread_mooring.installed("cabledyn"):
        right, spent = spread_mooring.cabledyns(3, FINEST)
        source = references()["problems"][name]["computed"]
        found.insert(0, Answer(source, named(name, figures(right) / 1e3), {}, spent))
    for program, compute, step in MOORING:
        if spread_mooring.installed(program.lower()):
            (pull, _), cpu = rounds_of(lambda compute=compute, step=step: compute(3, step))
            words = f"{spread_mooring.SEGMENTS} segments, steps of {step:g} s"
            found.append(Answer(program, named(name, figures(pull) / 1e3), {}, cpu, words))
    return found


def suspended(name: str) -> list[Answer]:
    """Distance to the rod at rest after 20 s, as a part of its length."""
    found = []
    with tempfile.TemporaryDirectory() as folder:
        for command, sets in hybrid_suspension.OURS[1:]:
            hybrid_suspension.run(Path(folder) / "run.h5", command, sets)
            runs = [hybrid_suspension.run(Path(folder) / "run.h5", command, sets) for _ in range(ROUNDS)]
            words = f"{command.__name__}, {', '.join(sets)}"
            found.append(distant(name, "hybrid", runs, words))
    if exudyn_suspension.available():
        tried = {how: suspension.elsewhere("exudyn_suspension", *how) for how in suspension.EXUDYN}
        close = {how: cpu for how, (cpu, off) in tried.items() if off <= suspension.CLOSE}
        how = min(close or {how: cpu for how, (cpu, _) in tried.items()}, key=lambda how: tried[how][0])
        runs = [suspension.elsewhere("exudyn_suspension", *how) for _ in range(ROUNDS)]
        found.append(distant(name, "Exudyn", runs, f"{how[0]} elements, steps of {how[1]} s"))
    if pyelastica_suspension.available():
        cpu = suspension.elsewhere("pyelastica_suspension", 120, 60.0, suspension.PART)[0]
        words = f"120 elements, softened; time from {suspension.PART} s of 20 s, not run to its rest"
        found.append(Answer("PyElastica", {}, {}, cpu * suspension.DURATION / suspension.PART, words))
    return found


def distant(name: str, program: str, runs: list[tuple[float, float]], words: str) -> Answer:
    """From CPU times (s) and distances (m)."""
    values = named(name, [runs[-1][1] / suspension.LENGTH])
    return Answer(program, values, {}, median(x[0] for x in runs), words)
