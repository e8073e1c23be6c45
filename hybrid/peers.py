"""Other people's cable codes on a scene of ours: one adapter for each, which runs in a process of its own.

    CableDyn   implicit, finite elements
    MoorDyn    explicit, lumped masses

An adapter is a class with `name`, `package`, a ladder of settings and `march`; it goes into PEERS.  What they all can
do is a uniform line between two points that are held or moved as prescribed, in still water, on a level seabed; of
anything else `unfit` says why not.

Symbols: s arc length (m), q position (m), v velocity, a acceleration of an end.
"""

from __future__ import annotations

import hashlib
import importlib.util
import json
import math
import os
import subprocess
import sys
import tempfile
import time as clock
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from importlib.metadata import version
from itertools import pairwise
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from hybrid.model.plan import output_times
from hybrid.scene.ends import Pinned
from hybrid.scene.motion import EndMotion, shortest_period
from hybrid.scene.read import parse_scene, scene_text
from hybrid.scene.schema import Scene

CANNOT = "cannot do"
PATIENCE = 900.0  # s of wall time for one run: what takes longer is no choice
# Depth, m, by which a line without a surface is sunk below that of the other code: more than any end is heaved.
SINK = 50.0
# Over this time, s, the acceleration of an end is taken from its velocity: short against any period, long against
# round-off of a velocity (1e-12 over 1e-4).
GLANCE = 1e-4
Values = dict[str, np.ndarray]


class Failed(Exception):
    """A run of another code that came to no end, and why."""


@dataclass(frozen=True)
class Guest:
    """A run to be made: code, elements, and steps to the shortest period (None: as stability wants)."""

    code: str
    elements: int = 0
    per_period: int | None = None
    cannot: str = ""

    @property
    def model(self) -> str:
        return PEERS[self.code].model

    @property
    def told(self) -> str:
        """Settings, in words."""
        if self.cannot:
            return ""
        steps = f"{self.per_period} steps to a period" if self.per_period else "steps as stability wants"
        return f"{self.elements} elements, {steps}"

    @property
    def name(self) -> str:
        return f"{self.code} {self.told}"

    @property
    def driver(self) -> str:
        """What decides its answer besides the scene: this file, and its version."""
        source = hashlib.sha256(Path(__file__).read_bytes()).hexdigest()
        return source if self.cannot else f"{source} {versions([self])}"

    @property
    def tag(self) -> str:
        """Of the name of what is kept."""
        return f"-{self.code}-{self.elements}-{self.per_period or 0}"


@dataclass(frozen=True)
class Answer:
    """Position (nt, ns, 3) m and force on the cable at both ends (nt, 3) N at the outputs of the scene; cost.

    Of a force with one component (nt, 1) the code tells only how large it is.
    """

    values: Values
    cpu: float  # s, from the input file to the last output, the search for the rest included
    steps: int


class Peer(Protocol):
    """What an adapter has."""

    @property
    def model(self) -> str: ...
    @property
    def package(self) -> str: ...
    @property
    def settings(self) -> Sequence[tuple[int, int | None]]: ...  # elements, steps to a period

    def march(self, line: Line, guest: Guest, times: list[float]) -> Answer: ...


@dataclass(frozen=True)
class Line:
    """The scene in the terms that all of them know, z = 0 at the surface."""

    length: float
    diameter: float
    mass: float
    ea: float
    ei: float
    drag: tuple[float, float]
    added: float
    gravity: float
    density: float
    bed: tuple[float, float, float] | None  # z, stiffness and damping per metre of line
    ends: tuple[EndMotion, EndMotion]
    period: float
    up: float  # m, from the scene's heights to these
    s: np.ndarray

    @property
    def shift(self) -> np.ndarray:
        return np.array([0.0, 0.0, self.up])

    def end(self, k: int, t: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Position, velocity, acceleration (3,) of an end."""
        q, v = self.ends[k].at(t)[:2]
        before, after = max(t - GLANCE, 0.0), t + GLANCE
        a = (self.ends[k].at(after)[1] - self.ends[k].at(before)[1]) / (after - before)
        return q + self.shift, v, a

    def places(self, nodes: np.ndarray) -> np.ndarray:
        """Positions (ns, 3) at the output points, by a spline through nodes (n+1, 3) that are evenly spread."""
        from scipy.interpolate import CubicSpline

        spline = CubicSpline(np.linspace(0.0, self.length, len(nodes)), nodes)
        return np.asarray(spline(self.s)) - self.shift


def unfit(scene: Scene) -> str:
    """Why other codes cannot do a scene; "" if they can."""
    if scene.initial.kind != "equilibrium":
        return f"the cable starts {scene.initial.kind}, not in equilibrium"
    if len(scene.cable.sections) > 1:
        return "the cable has more than one section"
    if scene.cable.attachments:
        return "something is attached to the cable"
    section = scene.cable.sections[0].model_dump(exclude_none=True)
    known = {"length", "mass", "diameter", "axial_stiffness", "bending_stiffness", "torsional_stiffness", "drag"}
    other = sorted(set(section) - known - {"added_mass", "rotary_inertia"})
    if other:
        return f"the section has {', '.join(other)}"
    if "axial_stiffness" not in section or "diameter" not in section:
        return "the cable is inextensible, or has no diameter"
    if isinstance(section.get("bending_stiffness"), tuple) or section.get("added_mass", {}).get("tangential"):
        return "the cable bends differently in two directions, or has added mass along it"
    if not all(isinstance(end, Pinned) for end in (scene.ends.start, scene.ends.end)):
        return "an end is not pinned"
    fluid, bed = scene.environment.fluid, scene.environment.seabed
    if fluid is None:
        return "there is no water"
    if fluid.waves is not None or fluid.flows():
        return "the water moves"
    if bed is not None and (bed.friction is not None or (bed.slope is not None and any(bed.slope))):
        return "the seabed has friction or a slope"
    return ""


def ladder(scene: Scene) -> list[Guest]:
    """Runs of those codes that are installed; of a scene they cannot do one each, that says why."""
    installed = [code for code, peer in PEERS.items() if importlib.util.find_spec(peer.package) is not None]
    reason = unfit(scene)
    if reason:
        return [Guest(code, cannot=reason) for code in installed]
    return [Guest(code, *settings) for code in installed for settings in PEERS[code].settings]


def versions(guests: Sequence[Guest]) -> str:
    """Of the programs in a ladder."""
    names = dict.fromkeys(PEERS[guest.code].package for guest in guests if not guest.cannot)
    return ", ".join(f"{name} {version(name)}" for name in names)


def answer(guest: Guest, scene: Scene) -> Answer:
    """Run it, in a process of its own; Failed if it does not come to an end."""
    with tempfile.TemporaryDirectory() as folder:
        task = {"scene": scene_text(scene), "code": guest.code, "elements": guest.elements}
        Path(folder, "task.json").write_text(json.dumps(task | {"per_period": guest.per_period}), encoding="utf-8")
        command = [sys.executable, "-m", "hybrid.peers", folder]
        try:
            done = subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE, check=False)
        except subprocess.TimeoutExpired:
            raise Failed(f"not done after {PATIENCE:g} s") from None
        if done.returncode:
            last = (done.stderr.strip().splitlines() or [f"it left with code {done.returncode}"])[-1]
            raise Failed(last[:200])
        cost = json.loads(Path(folder, "cost.json").read_text(encoding="utf-8"))
        with np.load(Path(folder, "values.npz")) as file:
            return Answer({name: file[name] for name in file.files}, **cost)


def _here(folder: Path) -> None:
    """The other side of `answer`: do the task of the folder."""
    task = json.loads((folder / "task.json").read_text(encoding="utf-8"))
    scene = parse_scene(task.pop("scene"))
    guest = Guest(**task)
    with _silence():
        found = PEERS[guest.code].march(_line(scene), guest, [0.0, *output_times(scene)])
    if not all(np.isfinite(x).all() for x in found.values.values()):
        raise Failed("its answer is not finite")
    np.savez(folder / "values.npz", **found.values)  # type: ignore[arg-type]
    (folder / "cost.json").write_text(json.dumps({"cpu": found.cpu, "steps": found.steps}), encoding="utf-8")


def _line(scene: Scene) -> Line:
    from hybrid.results.probes import output_points

    section, fluid, bed = scene.cable.sections[0], scene.environment.fluid, scene.environment.seabed
    assert fluid is not None and section.diameter is not None and section.axial_stiffness is not None
    ends = [x for x in (scene.ends.start, scene.ends.end) if isinstance(x, Pinned)]
    top = max(x.position[2] for x in ends)
    up = -fluid.surface if fluid.surface is not None else -top - SINK
    drag = (section.drag.normal, section.drag.tangential) if section.drag else (0.0, 0.0)
    stiff = section.bending_stiffness
    return Line(
        section.length, section.diameter, section.mass, section.axial_stiffness,
        stiff if isinstance(stiff, float) else 0.0, drag, section.added_mass.normal if section.added_mass else 0.0,
        scene.environment.gravity, fluid.density, (bed.z + up, bed.stiffness, bed.damping) if bed else None,
        (EndMotion(ends[0].motion, ends[0].position), EndMotion(ends[1].motion, ends[1].position)),
        min(shortest_period(scene.ends, scene.environment), scene.require_time().duration),
        up, np.asarray(output_points(scene.output.points, section.length)),
    )  # fmt: skip


@contextmanager
def _silence() -> Iterator[None]:
    """Some of them report on the standard output, past Python's own."""
    sys.stdout.flush()
    kept = os.dup(1)
    with open(os.devnull, "w") as hole:
        os.dup2(hole.fileno(), 1)
    try:
        yield
    finally:
        os.dup2(kept, 1)
        os.close(kept)


# --- adapters -----------------------------------------------------------------------------------

# Both read the same kind of file; their drag and added mass have our conventions, their seabed is per area of line
# seen from above.
_DECK = """\
--------------------- Input File ---------------------
a line
--------------------- LINE TYPES ---------------------
{types}
--------------------- POINTS ---------------------
ID Attachment X Y Z M V CdA Ca
(#) (-) (m) (m) (m) (kg) (m^3) (m^2) (-)
{points}
--------------------- LINES ---------------------
{lines}
--------------------- OPTIONS ---------------------
{gravity} g
{density} {rho}
{depth} WtrDpth
{kbot} kBot
{cbot} cBot
{dt} dtM
{options}
--------------------- OUTPUTS ---------------------
{outputs}
--------------------- need this line ---------------------
"""
NO_BED = 1e4  # m below the surface, where there is none


def _deck(line: Line, dt: float, driven: Sequence[int], **words: str) -> str:
    points = []
    for k in (0, 1):
        x, y, z = line.end(k, 0.0)[0]
        points.append(f"{k + 1} {'Coupled' if k in driven else 'Fixed'} {x:.12g} {y:.12g} {z:.12g} 0 0 0 0")
    z, stiffness, damping = line.bed or (-NO_BED, 1.0, 0.0)
    return _DECK.format(
        points="\n".join(points), gravity=line.gravity, density=line.density, depth=-z, dt=dt,
        kbot=stiffness / line.diameter, cbot=damping / line.diameter, **words,
    )  # fmt: skip


def _even(times: list[float], most: float) -> int:
    """Steps of at most so long to the shortest interval between two outputs."""
    return max(1, math.ceil(float(np.diff(times).min()) / most - 1e-9))


class CableDyn:
    """CableDyn: elements with bending, generalized-alpha, its own Newton."""

    model, package = "finite elements", "cabledyn"
    # Steps at which the elements show, and no shorter: on the mooring line of the examples half as many cost it up to
    # the whole answer (25 elements, 40 steps), twice as many gain nothing.
    settings = ((25, 80), (50, 80), (100, 160), (200, 160))

    def march(self, line: Line, guest: Guest, times: list[float]) -> Answer:
        import cabledyn  # type: ignore[import-not-found]

        if line.ends[0].moving and line.ends[1].moving:
            raise Failed("both ends move: it wants the far end of a line that bends to be fixed")
        near = 0 if line.ends[0].moving else 1  # its end A; it counts from there
        per = _even(times, line.period / (guest.per_period or 1))
        steps = 0
        types = "TypeName Diam MassDenInAir EA BA/-zeta EI Cd_n Cd_t Ca_n Ca_t\n"
        types += "(-) (m) (kg/m) (N) (N-s/-) (N-m^2) (-) (-) (-) (-)\n"
        types += (
            f"line {line.diameter} {line.mass} {line.ea} 0 {line.ei} {line.drag[0]} {line.drag[1]} {line.added} 0.0"
        )
        lines = f"ID NodeA NodeB Outputs\n(-) (-) (-) (-)\n1 {near + 1} {2 - near} -\n"
        lines += (
            "--------------------- SECTIONS ---------------------\nLineID LineType Length NumSegs\n(-) (-) (m) (-)\n"
        )
        lines += f"1 line {line.length} {guest.elements}"
        text = _deck(
            line, (times[1] - times[0]) / per, (near,), types=types, lines=lines, rho="rhoW",
            options=f"{times[-1]} TMax", outputs='"FairTen1"',
        )  # fmt: skip

        def look() -> Values:
            nodes = np.asarray(model.line(1).node_positions())
            nodes = nodes if near == 0 else nodes[::-1]
            # It tells the force on a driven end; of a fixed one how large it is.
            pulls = [np.array([model.line(1).anchor_tension()])] * 2
            pulls[near] = np.asarray(model.calc_output())[driven]
            return _seen(line, nodes, pulls)

        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "line.dat"
            path.write_text(text)
            begin = clock.process_time()
            model = cabledyn.CableDyn(path)
        with model:
            q, v, a = model.get_coupled_motion()
            driven = np.asarray(model.host_dofs())
            seen = [look()]
            for t0, t1 in pairwise(times):
                n = max(1, round((t1 - t0) / (times[1] - times[0]) * per))
                dt = (t1 - t0) / n
                for i in range(1, n + 1):
                    q[driven], v[driven], a[driven] = line.end(near, t0 + i * dt)
                    model.step(dt, q, v, a)
                    steps += 1
                seen.append(look())
            cpu = clock.process_time() - begin
        return Answer(_stacked(seen), cpu, steps)


class MoorDyn:
    """MoorDyn (the C++ code): lumped masses, explicit Runge-Kutta, so its step follows from stability."""

    model, package = "lumped masses", "moordyn"
    settings = ((25, None), (50, None), (100, None))
    # RK4 is stable up to 2.8 over the highest frequency, which is 2 c/l of stretch: 1.4 l/c; and 4/l^2 sqrt(EI/m)
    # of bending.  A little less for what the seabed's damper and the drag make of it.  Its own damping (BA) stays
    # zero: a ratio of 0.5 halves the step, and on the mooring line of the examples gains 10 % to 30 % of error.
    STRETCH, BEND = 1.35, 0.65
    PER_HAND = 2  # steps between two hand-overs of the ends' motion; more jerk the ends (1 % of tension at 5 ms)
    RELAXATION = 120.0  # s of simulated time, at most, for the search for the rest

    def march(self, line: Line, guest: Guest, times: list[float]) -> Answer:
        import moordyn  # type: ignore[import-not-found]

        l = line.length / guest.elements
        dt = self.STRETCH * l / math.sqrt(line.ea / line.mass)
        if line.ei:
            dt = min(dt, self.BEND * l * l / math.sqrt(line.ei / line.mass))
        hands = _even(times, self.PER_HAND * dt)
        dt = (times[1] - times[0]) / hands / self.PER_HAND
        types = "TypeName Diam Mass/m EA BA/-zeta EI Cd Ca CdAx CaAx\n"
        types += "(name) (m) (kg/m) (N) (N-s/-) (N-m^2) (-) (-) (-) (-)\n"
        types += (
            f"line {line.diameter} {line.mass} {line.ea} 0 {line.ei} {line.drag[0]} {line.added} {line.drag[1]} 0.0"
        )
        lines = "ID LineType AttachA AttachB UnstrLen NumSegs Outputs\n(#) (name) (#) (#) (m) (-) (-)\n"
        lines += f"1 line 1 2 {line.length} {guest.elements} -"
        options = "0 writeLog\n1 disableOutput\n1 disableOutTime\nRK4 tScheme\n0.0 FrictionCoefficient\n"
        options += f"{self.RELAXATION} TmaxIC"
        text = _deck(line, dt, (0, 1), types=types, lines=lines, rho="rho", options=options, outputs="FairTen1")
        steps = 0
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "line.txt"
            path.write_text(text)
            begin = clock.process_time()
            system = moordyn.Create(str(path))
            try:
                there = np.concatenate([line.end(k, 0.0)[0] for k in (0, 1)])
                if moordyn.Init(system, there.tolist(), [0.0] * there.size):
                    raise Failed("it does not start")
                cable, points = moordyn.GetLine(system, 1), [moordyn.GetPoint(system, k) for k in (1, 2)]

                def look() -> Values:
                    nodes = [moordyn.GetLineNodePos(cable, i) for i in range(guest.elements + 1)]
                    return _seen(line, np.array(nodes), [moordyn.GetPointForce(p) for p in points])

                seen = [look()]
                for t0, t1 in pairwise(times):
                    n = max(1, round((t1 - t0) / (times[1] - times[0]) * hands))
                    hand = (t1 - t0) / n
                    for i in range(n):
                        # It lets an end run on from where it is with the velocity it is given: the mean one.
                        t = t0 + i * hand
                        now, then = (np.concatenate([line.end(k, x)[0] for k in (0, 1)]) for x in (t, t + hand))
                        moordyn.Step(system, now.tolist(), ((then - now) / hand).tolist(), t, hand)
                    steps += n * self.PER_HAND
                    seen.append(look())
                cpu = clock.process_time() - begin
            finally:
                moordyn.Close(system)
        return Answer(_stacked(seen), cpu, steps)


def _seen(line: Line, nodes: np.ndarray, pulls: list[Any]) -> Values:
    """What is compared at one output; pulls: of the line on its two points, so the points pull with the opposite."""
    start, end = (-np.asarray(pull, dtype=float) for pull in pulls)
    return {"position": line.places(np.asarray(nodes)), "reaction_start": start, "reaction_end": end}


def _stacked(seen: list[Values]) -> Values:
    return {name: np.stack([each[name] for each in seen]) for name in seen[0]}


PEERS: Mapping[str, Peer] = {"CableDyn": CableDyn(), "MoorDyn": MoorDyn()}

if __name__ == "__main__":
    _here(Path(sys.argv[1]))
