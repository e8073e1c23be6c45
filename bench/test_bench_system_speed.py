"""What the time loop of several lines costs: beside MoorDyn and CableDyn, and per cell as lines become many.

    pip install -e ".[dev,bench]"
    pytest bench/test_bench_system_speed.py -m bench -s

A bridle: two legs from the bed to a junction with mass, and a pennant from there to a fairlead that heaves; 3 x 100 cells.
CPU time of the loop alone, medians of three, alternating in one run.  Errors are those of the tension at the fairlead in
the last two periods, in per cent: of a converged run of the same program, and of ours.
"""

from __future__ import annotations

import resource
import subprocess
import sys
import tempfile
import time as clock
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import hybrid

pytestmark = pytest.mark.bench
Vector = NDArray[np.float64]

CELLS, PERIOD, DURATION, HEAVE, RAMP = 100, 8.0, 40.0, 1.0, 16.0
ANCHORS, JUNCTION, FAIRLEAD = (
    [(-60.0, 40.0, -120.0), (-60.0, -40.0, -120.0)],
    (50.8330, 0.0, -104.7824),
    (130.0, 0.0, -20.0),
)
LEG, PENNANT, MASS, VOLUME = 124.0, 116.0, 500.0, 0.2
ROPE = {"mass": 20.0, "diameter": 0.06, "axial_stiffness": 2e7}
TIMES_FASTER = 10.0


def scene(cells: int, step: float) -> dict[str, Any]:
    section = ROPE | {"drag": {"normal": 1.2, "tangential": 0.05}, "added_mass": {"normal": 1.0}}
    heave = {"heave": {"amplitude": HEAVE, "period": PERIOD}, "ramp": RAMP}
    lines = {
        f"leg{k}": {"start": f"anchor{k}", "end": "junction", "sections": [section | {"length": LEG}]} for k in (0, 1)
    }
    lines["pennant"] = {"start": "junction", "end": "fairlead", "sections": [section | {"length": PENNANT}]}
    for line in lines.values():
        line["mesh"] = {"cells": cells}
    points: dict[str, Any] = {f"anchor{k}": {"position": list(ANCHORS[k])} for k in (0, 1)}
    points["junction"] = {"initial_guess": list(JUNCTION), "mass": MASS, "volume": VOLUME}
    points["fairlead"] = {"position": list(FAIRLEAD), "motion": heave}
    return {
        "environment": {"fluid": {"density": 1025}}, "points": points, "lines": lines,
        "time": {"duration": DURATION, "step": step}, "output": {"every": max(step, 0.1), "points": 11},
    }  # fmt: skip


def ours(cells: int, step: float) -> tuple[Vector, float]:
    """Pull at the fairlead (nt,) N every 0.1 s, and CPU time of the loop (s)."""
    found = hybrid.run(scene(cells, step))
    line = found.lines["pennant"]
    return np.linalg.norm(found["points/fairlead/force"], axis=1), float(line["steps/cpu"][-1])


def heaved(t: float) -> float:
    ramp = min(t / RAMP, 1.0)
    return HEAVE * ramp**3 * (10.0 - 15.0 * ramp + 6.0 * ramp**2) * np.sin(2.0 * np.pi * t / PERIOD)


def deck(cells: int, step: float, program: str) -> str:
    """The same for MoorDyn or CableDyn, whose conventions of drag and added mass these are."""
    kind = "Attachment" if program == "MoorDyn" else "Type"
    units = "Diam MassDen EA BA/-zeta EI Cd Ca CdAx CaAx" if program == "MoorDyn" else (
        "Diam MassDenInAir EA BA/-zeta EI Cd_n Cd_t Ca_n Ca_t"
    )  # fmt: skip
    drag = "1.2 1.0 0.05 0.0" if program == "MoorDyn" else "1.2 0.05 1.0 0.0"
    rows = [f"{k + 1} Fixed {x} {y} {z} 0 0 0 0" for k, (x, y, z) in enumerate(ANCHORS)]
    rows += [
        "3 Free {} {} {} {} {} 0 0".format(*JUNCTION, MASS, VOLUME),
        "4 Coupled {} {} {} 0 0 0 0".format(*FAIRLEAD),
    ]
    ends = [(1, 3, LEG), (2, 3, LEG), (3, 4, PENNANT)]
    if program == "MoorDyn":
        lines = ["ID LineType AttachA AttachB UnstrLen NumSegs Outputs", "(-) (-) (-) (-) (m) (-) (-)"]
        lines += [f"{k + 1} rope {a} {b} {length} {cells} -" for k, (a, b, length) in enumerate(ends)]
        options = [f"{step} dtM", "RK2 tScheme", "1 disableOutput", "1 disableOutTime", "0 writeLog", "60 TmaxIC"]
    else:
        lines = [
            "ID NodeA NodeB Outputs",
            "(-) (-) (-) (-)",
            *(f"{k + 1} {b} {a} -" for k, (a, b, _) in enumerate(ends)),
        ]
        lines += ["--- SECTIONS ---", "LineID LineType Length NumSegs", "(-) (-) (m) (-)"]
        lines += [f"{k + 1} rope {length} {cells}" for k, (_, _, length) in enumerate(ends)]
        options = [f"{step} dtM", f"{DURATION} TMax"]
    text = [
        "--- Input File ---", "bridle", "--- LINE TYPES ---", f"TypeName {units}", "(-) (m) (kg/m) (N) (-) (N-m^2) (-) (-) (-) (-)",
        f"rope {ROPE['diameter']} {ROPE['mass']} {ROPE['axial_stiffness']} -0.8 0 {drag}",
        "--- POINTS ---", f"ID {kind} X Y Z M V CdA Ca", "(-) (-) (m) (m) (m) (kg) (m^3) (m^2) (-)", *rows,
        "--- LINES ---", *lines, "--- OPTIONS ---", "9.81 g", "1025 rhoW", "200 WtrDpth", "3e6 kBot", "3e5 cBot", *options,
        *(["--- OUTPUTS ---", '"FairTen3"'] if program == "CableDyn" else []), "--- need this line ---", "",
    ]  # fmt: skip
    return "\n".join(text)


def of_moordyn(cells: int, step: float) -> tuple[Vector, float]:
    import moordyn
    from peers.moordyn_touchdown import silence

    with tempfile.TemporaryDirectory() as folder, silence():
        path = Path(folder) / "deck.txt"
        path.write_text(deck(cells, step, "MoorDyn"))
        network = moordyn.Create(str(path))
        here = np.array(FAIRLEAD)
        assert moordyn.Init(network, here.tolist(), [0.0] * 3) == 0
        point, begin = moordyn.GetPoint(network, 4), clock.process_time()
        pull = [np.linalg.norm(moordyn.GetPointForce(point))]
        couple = 10 * step  # s, in which the fairlead goes straight on: every 0.1 s it would be jerked by 1 kN
        for k in range(round(DURATION / couple)):
            now, then = heaved(couple * k), heaved(couple * (k + 1))
            at = [here[0], here[1], here[2] + now]
            moordyn.Step(network, at, [0.0, 0.0, (then - now) / couple], couple * k, couple)
            if (k + 1) % round(0.1 / couple) == 0:
                pull.append(np.linalg.norm(moordyn.GetPointForce(point)))
        cpu = clock.process_time() - begin
        moordyn.Close(network)
    return np.array(pull), cpu


def of_cabledyn(cells: int, step: float) -> tuple[Vector, float]:
    import cabledyn

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "bridle.dat"
        path.write_text(deck(cells, step, "CableDyn"))
        model = cabledyn.CableDyn(path)
    with model:
        position, velocity, acceleration = model.get_coupled_motion()
        velocity[:], acceleration[:], up = 0.0, 0.0, position.size - 1  # the fairlead is the last point
        pull, begin, d = [float(model.channel("FairTen3"))], clock.process_time(), 1e-4
        for k in range(1, round(DURATION / step) + 1):
            t = k * step
            before, now, after = heaved(t - d), heaved(t), heaved(t + d)
            position[up], velocity[up] = FAIRLEAD[2] + now, (after - before) / (2 * d)
            acceleration[up] = (after - 2 * now + before) / d**2
            model.step(step, position, velocity, acceleration)
            if abs(round(t / 0.1) * 0.1 - t) < 1e-9:
                pull.append(float(model.channel("FairTen3")))
        cpu = clock.process_time() - begin
    return np.array(pull), cpu


def errors(pull: Vector, fine: Vector) -> Vector:
    """Of mean, largest and smallest tension of the last two periods (%), at the outputs of the coarser of both."""
    fine = fine[:: (fine.size - 1) // (pull.size - 1)]
    last = round(2 * PERIOD * (pull.size - 1) / DURATION)
    return np.array([100.0 * (f(pull[-last:]) / f(fine[-last:]) - 1.0) for f in (np.mean, np.max, np.min)])


def test_a_bridle_against_moordyn_and_cabledyn() -> None:
    """Each with a step that leaves it about as far from its own converged run as ours is, and shorter ones than that.

    Through its C interface CableDyn steps free points by a staggered scheme, whose error at the junction falls as the
    square of the step and grows with the cells: 11 % with 0.025 s, 2 % with 0.0125 s, with drag or without.
    """
    pytest.importorskip("moordyn")
    pytest.importorskip("cabledyn")
    ours(10, 0.1)
    converged = {
        "hybrid": ours(3 * CELLS, 0.0125)[0], "CableDyn": of_cabledyn(CELLS, 0.0015625)[0],
        "MoorDyn": of_moordyn(2 * CELLS, 0.0002)[0],
    }  # fmt: skip
    runs = {
        "hybrid, 0.1 s": lambda: ours(CELLS, 0.1), "hybrid, 0.4 s": lambda: ours(CELLS, 0.4),
        "CableDyn, 0.025 s": lambda: of_cabledyn(CELLS, 0.025),
        "CableDyn, 0.00625 s": lambda: of_cabledyn(CELLS, 0.00625),
        "MoorDyn, 0.0004 s": lambda: of_moordyn(CELLS, 0.0004),
    }  # fmt: skip
    cpu: dict[str, list[float]] = {name: [] for name in runs}
    own: dict[str, float] = {}
    print("\nerrors of mean, largest, smallest tension (%)")
    for program, pull in converged.items():
        print(f"{program}, converged, of ours: {errors(pull, converged['hybrid']).round(2)}", flush=True)
    for again in range(3):
        for name, run in runs.items():
            pull, used = run()
            cpu[name].append(used)
            if not again:
                of_own, of_ours = (errors(pull, converged[x]) for x in (name.split(",")[0], "hybrid"))
                own[name] = float(np.abs(of_own).max())
                print(f"{name}: {used:.2f} s; of its own {of_own.round(2)}, of ours {of_ours.round(2)}", flush=True)
    spent = {name: float(np.median(x)) for name, x in cpu.items()}
    for name, x in spent.items():
        mine = spent["hybrid, 0.1 s"], spent["hybrid, 0.4 s"]
        print(f"{name}: loop {x:.3f} s, {x / mine[0]:.1f} and {x / mine[1]:.1f} times those of hybrid")
    nearest = min(spent["CableDyn, 0.00625 s"], spent["MoorDyn, 0.0004 s"])
    assert (
        own["hybrid, 0.4 s"] < min(own["CableDyn, 0.00625 s"], 0.3) and nearest > TIMES_FASTER * spent["hybrid, 0.4 s"]
    )


def test_cost_per_cell_of_a_hundred_lines() -> None:
    """Lines of 50 cells to fairleads that heave alike; the time of the loop per line, against that of one line."""
    rope = ROPE | {"length": 120, "drag": {"normal": 1.2}, "added_mass": {"normal": 1.0}}
    heave = {"heave": {"amplitude": 1, "period": 8}, "ramp": 8}

    def loop(count: int) -> float:
        points = {f"a{k}": {"position": [20.0 * k, 0, -80]} for k in range(count)}
        points |= {f"b{k}": {"position": [20.0 * k, 80, 0], "motion": heave} for k in range(count)}
        lines = {
            f"l{k}": {"start": f"a{k}", "end": f"b{k}", "sections": [rope], "mesh": {"cells": 50}} for k in range(count)
        }
        tables = {"environment": {"fluid": {"density": 1025}}, "points": points, "lines": lines}
        time = {"duration": 20.0, "step": 0.1} if count > 1 else {"duration": 200.0, "step": 0.1}
        found = hybrid.run(tables | {"time": time, "output": {"every": 10.0, "points": 11}})
        used = found.lines["l0"]["steps/cpu"]
        return float(used[-1] - used[0]) / (len(used) - 1) / count

    loop(1)
    each = [(loop(1), loop(100)) for _ in range(3)]
    one, many = np.median(each, axis=0)
    print(
        f"\nper step and line of 50 cells: 1 line {1e6 * one:.0f} us, 100 lines {1e6 * many:.0f} us: {many / one:.2f}"
    )
    assert many < 1.3 * one


def leg(cells: int, model: str) -> dict[str, Any]:
    """A line of 410 m in water."""
    section = {"length": 410.0, "mass": 100.0, "diameter": 0.1, "axial_stiffness": 4e8, "drag": {"normal": 1.6}}
    section |= {"bending_stiffness": 2e4} if model == "rod" else {}
    return {"sections": [section], "mesh": {"cells": cells}, "model": model}


def legs(cells: int, count: int, model: str, every: float, duration: float) -> dict[str, Any]:
    """Lines from anchors on a seabed to fairleads that heave; count 0: the first of them as one cable."""
    bed = {"fluid": {"density": 1025}, "seabed": {"z": -100, "stiffness": 1e4}}
    heave = {"heave": {"amplitude": 1.0, "period": 8.0}, "ramp": 8}
    tables = {"environment": bed, "time": {"duration": duration, "step": 0.1}, "output": {"every": every, "points": 11}}
    if count == 0:
        line = leg(cells, model)
        ends = {"start": {"kind": "pinned", "position": [400, 0, -100]}}
        ends["end"] = {"kind": "pinned", "position": [20, 0, 0], "motion": heave}
        cable = {"cable": {"sections": line.pop("sections")}, "ends": ends, "initial": "equilibrium", "dimension": 3}
        return tables | cable | line
    points: dict[str, Any] = {}
    for k in range(count):
        out = np.array([np.cos(2 * np.pi * k / count), np.sin(2 * np.pi * k / count)])
        points[f"a{k}"] = {"position": [*(400 * out).tolist(), -100.0]}
        points[f"f{k}"] = {"position": [*(20 * out).tolist(), 0.0], "motion": heave}
    lines = {f"l{k}": {"start": f"a{k}", "end": f"f{k}"} | leg(cells, model) for k in range(count)}
    return tables | {"points": points, "lines": lines}


def step_of(data: dict[str, Any]) -> tuple[float, float]:
    """Processor time of a step, s, and of the whole run."""
    begin = clock.process_time()
    with hybrid.run(data) as result:
        used = (result.lines["l0"] if "lines" in data else result)["steps/cpu"]
        return float(used[-1] - used[0]) / (len(used) - 1), clock.process_time() - begin


def test_a_step_of_lines_against_one_of_a_cable() -> None:
    """Lines that are joined to nothing cost what a cable costs, each; one output, at the end."""
    for cells, model in ((20, "catenary"), (100, "catenary"), (100, "rod")):
        each = [[step_of(legs(cells, n, model, 60.0, 60.0))[0] for n in (0, 1, 3)] for _ in range(5)]
        cable, one, three = 1e6 * np.median(each, axis=0)
        print(f"\n{cells} cells, {model}: cable {cable:.1f}, one line {one:.1f}, three lines {three:.1f} us a step")
        assert one < 1.2 * cable


def beside(what: str) -> dict[str, Any]:
    """Ten lines, beside nothing, a drum under one of them (fixed, or a sheave), or contact of one with itself."""
    tables = legs(50, 10, "catenary", 30.0, 30.0)
    if what in ("drum", "sheave"):  # on the bed, 200 m from the middle
        tables["obstacles"] = {"drum": {
            "kind": "sheave", "at": [250, 0, -99.5], "axis": [0, 1, 0], "radius": 1.0, "groove": 0.2, "rim": 0.1,
            "stiffness": 1e4,
        }}  # fmt: skip
        if what == "sheave":
            tables["obstacles"]["drum"]["bearing"] = {"inertia": 100.0, "damping": 10.0}
    elif what == "contact":
        tables["lines"]["l0"]["contact"] = {"self": True}
    return tables


def test_a_sheave_or_contact_of_one_line_slows_no_other() -> None:
    """The loop of ten lines, of which one has it: at most what that line costs is added to those of the others.

    A sheave against the same drum that is fixed, whose distance all lines find as well.
    """
    for what, without in (("sheave", "drum"), ("contact", "nothing")):
        each = [[step_of(beside(x))[0] for x in (without, what)] for _ in range(3)]
        before, found = 1e6 * np.min(each, axis=0)
        print(f"\nten lines of 50 cells, {without}: {before:.0f} us a step; {what}: {found:.0f} us", flush=True)
        assert found < 1.3 * before


def side_by_side(cells: int, count: int, every: float, duration: float) -> dict[str, Any]:
    """As of `legs`, 10 m from each other."""
    tables = legs(cells, 1, "catenary", every, duration)
    (line,), anchor, fairlead = tables["lines"].values(), tables["points"]["a0"], tables["points"]["f0"]
    for k in range(count):
        tables["points"][f"a{k}"] = anchor | {"position": [400.0, 10.0 * k, -100.0]}
        tables["points"][f"f{k}"] = fairlead | {"position": [20.0, 10.0 * k, 0.0]}
        tables["lines"][f"l{k}"] = line | {"start": f"a{k}", "end": f"f{k}"}
    return tables


def report(cells: int, count: int, every: float, duration: float, ring: bool, target: str) -> None:
    """Print what a run of many lines takes, in a process of its own; target: empty: in memory."""
    asked = every, duration
    tables = legs(cells, count, "catenary", *asked) if ring else side_by_side(cells, count, *asked)
    begin = clock.process_time()
    with hybrid.run(tables, *filter(None, [target])) as result:
        used, whole = result.lines["l0"]["steps/cpu"], clock.process_time() - begin
        loop = float(used[-1] - used[0])
    peak, where = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024, "with a file" if target else "in memory"
    print(
        f"{count} x {cells} cells, {'ring' if ring else 'side by side'}, {round(duration / every)} outputs, {where}: "
        f"loop {loop:.2f} s, else {1e3 * (whole - loop) / count:.1f} ms a line, peak {peak:.0f} MB"
    )


@pytest.mark.parametrize("case", [(100, 100, 1.0, 60.0), (20, 300, 1.0, 6.0), (20, 1000, 1.0, 6.0)])
def test_many_lines(case: tuple[int, int, float, float], tmp_path: Path) -> None:
    """Side by side, and legs of a ring, whose bounds overlap; in memory and with a file."""
    for ring in (False, True):
        for target in ("", str(tmp_path / "many.h5")):
            code = f"from test_bench_system_speed import report; report(*{case!r}, {ring!r}, {target!r})"
            done = subprocess.run(
                [sys.executable, "-c", code], cwd=Path(__file__).parent, capture_output=True, text=True
            )
            assert done.returncode == 0, done.stderr[-2000:]
            print(done.stdout, end="")


def stepped_from_outside(one_by_one: bool, joined: bool, steps: int = 1000) -> float:
    """CPU time (s) of a step of three lines of 20 cells, in one call or one by one with their points set each time.

    joined: two legs and a line from a ship to a buoy, whose ship is set; else three legs whose tops are set.
    """
    leg = {"sections": [{"length": 70, "mass": 20, "diameter": 0.05, "axial_stiffness": 2e7, "drag": {"normal": 1.2}}],
           "mesh": {"cells": 20}}  # fmt: skip
    at = [(np.cos(2.1 * k), np.sin(2.1 * k)) for k in range(3)]
    points = {f"foot{k}": {"position": [50 * x, 50 * y, -40]} for k, (x, y) in enumerate(at[: 2 if joined else 3])}
    lines = {f"leg{k}": leg | {"start": f"foot{k}", "end": "buoy" if joined else f"top{k}"} for k in range(len(points))}
    tops = {"ship": (10.0, 0.0, 0.0)} if joined else {f"top{k}": (2 * x, 2 * y, 0.0) for k, (x, y) in enumerate(at)}
    points |= {name: {"position": [float(x) for x in place]} for name, place in tops.items()}
    if joined:
        points["buoy"] = {"initial_guess": [0, 0, -8], "mass": 500, "volume": 1.5, "drag_area": 1}
        lines["tow"] = leg | {"start": "ship", "end": "buoy", "sections": [leg["sections"][0] | {"length": 20}]}
    scene = {"environment": {"fluid": {"density": 1025}}, "points": points, "lines": lines,
             "time": {"duration": 60.0, "step": 0.05}, "output": {"every": 60.0}}  # fmt: skip
    with hybrid.Simulation(scene) as simulation:
        now = simulation.advance(1.0)
        begin = clock.process_time()
        if not one_by_one:
            simulation.advance(now + steps * 0.05)
        for k in range(steps * one_by_one):
            for name, (x, y, z) in tops.items():
                simulation.set_point(name, (float(x), float(y), z), (0.0, 0.0, 0.0))
            simulation.advance(now + (k + 1) * 0.05)
        return (clock.process_time() - begin) / steps


@pytest.mark.parametrize("joined", [False, True])
def test_three_lines_stepped_from_outside(joined: bool) -> None:
    """What a step from outside of three lines costs above one in the compiled loop: at most 15 us are wanted."""
    inside, outside = (min(stepped_from_outside(x, joined) for _ in range(5)) for x in (False, True))
    told = "a ship that is set, a buoy on three lines" if joined else "three legs whose tops are set"
    print(f"{told}: {1e6 * inside:.1f} us a step in one call, {1e6 * (outside - inside):.1f} us more from outside")
