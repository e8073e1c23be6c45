"""CableDyn and MoorDyn, which read the same kind of file."""

from __future__ import annotations

import math
import tempfile
import time as clock
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path

import numpy as np

from peers.adapters.interface import (
    Line,
    PeerFailed,
    PeerResult,
    PeerRun,
    Values,
    output_values,
    stacked,
    steps_per_output,
)

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


class CableDyn:
    """CableDyn: elements with bending, generalized-alpha, its own Newton."""

    model, package = "finite elements", "cabledyn"
    # Steps at which the elements show, and no shorter: on the mooring line of the examples half as many cost it up to
    # the whole answer (25 elements, 40 steps), twice as many gain nothing.
    settings = ((25, 80), (50, 80), (100, 160), (200, 160))

    def run(self, line: Line, peer_run: PeerRun, times: list[float]) -> PeerResult:
        import cabledyn  # type: ignore[import-not-found]

        if line.ends[0].moving and line.ends[1].moving:
            raise PeerFailed("both ends move: it wants the far end of a line that bends to be fixed")
        near = 0 if line.ends[0].moving else 1  # its end A; it counts from there
        per = steps_per_output(times, line.period / (peer_run.per_period or 1))
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
        lines += f"1 line {line.length} {peer_run.elements}"
        text = _deck(
            line, (times[1] - times[0]) / per, (near,), types=types, lines=lines, rho="rhoW",
            options=f"{times[-1]} TMax", outputs='"FairTen1"',
        )  # fmt: skip

        def sample() -> Values:
            nodes = np.asarray(model.line(1).node_positions())
            nodes = nodes if near == 0 else nodes[::-1]
            # It tells the force on a driven end; of a fixed one how large it is.
            forces = [np.array([model.line(1).anchor_tension()])] * 2
            forces[near] = np.asarray(model.calc_output())[driven]
            return output_values(line, nodes, forces)

        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "line.dat"
            path.write_text(text)
            begin = clock.process_time()
            model = cabledyn.CableDyn(path)
        with model:
            q, v, a = model.get_coupled_motion()
            driven = np.asarray(model.host_dofs())
            samples = [sample()]
            for t0, t1 in pairwise(times):
                n = max(1, round((t1 - t0) / (times[1] - times[0]) * per))
                dt = (t1 - t0) / n
                for i in range(1, n + 1):
                    q[driven], v[driven], a[driven] = line.end(near, t0 + i * dt)
                    model.step(dt, q, v, a)
                    steps += 1
                samples.append(sample())
            cpu = clock.process_time() - begin
        return PeerResult(stacked(samples), cpu, steps)


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

    def deck(self, line: Line, elements: int, dt: float) -> str:
        """Its input file for a line between two driven points, with steps of at most `dt`, s."""
        types = "TypeName Diam Mass/m EA BA/-zeta EI Cd Ca CdAx CaAx\n"
        types += "(name) (m) (kg/m) (N) (N-s/-) (N-m^2) (-) (-) (-) (-)\n"
        types += (
            f"line {line.diameter} {line.mass} {line.ea} 0 {line.ei} {line.drag[0]} {line.added} {line.drag[1]} 0.0"
        )
        lines = "ID LineType AttachA AttachB UnstrLen NumSegs Outputs\n(#) (name) (#) (#) (m) (-) (-)\n"
        lines += f"1 line 1 2 {line.length} {elements} -"
        options = "0 writeLog\n1 disableOutput\n1 disableOutTime\nRK4 tScheme\n0.0 FrictionCoefficient\n"
        options += f"{self.RELAXATION} TmaxIC"
        return _deck(line, dt, (0, 1), types=types, lines=lines, rho="rho", options=options, outputs="FairTen1")

    def run(self, line: Line, peer_run: PeerRun, times: list[float]) -> PeerResult:
        import moordyn  # type: ignore[import-not-found]

        l = line.length / peer_run.elements
        dt = self.STRETCH * l / math.sqrt(line.ea / line.mass)
        if line.ei:
            dt = min(dt, self.BEND * l * l / math.sqrt(line.ei / line.mass))
        hands = steps_per_output(times, self.PER_HAND * dt)
        dt = (times[1] - times[0]) / hands / self.PER_HAND
        text = self.deck(line, peer_run.elements, dt)
        steps = 0
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "line.txt"
            path.write_text(text)
            begin = clock.process_time()
            network = moordyn.Create(str(path))
            try:
                there = np.concatenate([line.end(k, 0.0)[0] for k in (0, 1)])
                if moordyn.Init(network, there.tolist(), [0.0] * there.size):
                    raise PeerFailed("it does not start")
                cable, points = moordyn.GetLine(network, 1), [moordyn.GetPoint(network, k) for k in (1, 2)]

                def sample() -> Values:
                    nodes = [moordyn.GetLineNodePos(cable, i) for i in range(peer_run.elements + 1)]
                    return output_values(line, np.array(nodes), [moordyn.GetPointForce(p) for p in points])

                samples = [sample()]
                for t0, t1 in pairwise(times):
                    n = max(1, round((t1 - t0) / (times[1] - times[0]) * hands))
                    hand = (t1 - t0) / n
                    for i in range(n):
                        # It lets an end run on from where it is with the velocity it is given: the mean one.
                        t = t0 + i * hand
                        now, then = (np.concatenate([line.end(k, x)[0] for k in (0, 1)]) for x in (t, t + hand))
                        moordyn.Step(network, now.tolist(), ((then - now) / hand).tolist(), t, hand)
                    steps += n * self.PER_HAND
                    samples.append(sample())
                cpu = clock.process_time() - begin
            finally:
                moordyn.Close(network)
        return PeerResult(stacked(samples), cpu, steps)
