"""A mooring line whose fairlead is carried by a body on a spring: two programs that step together.

Shows:    `hybrid.Simulation`: a cable stepped from outside, its end set and its pull read at every step, and steps taken
          again until body and cable agree (implicit coupling).
Physics:  a body of 20 t on a vertical spring of 50 kN/m, let go 1 m above its rest, carries the upper end of
          examples/touchdown.yaml; the cable damps it.
Look at:  the energy of body and cable together, less what drag and seabed have taken, stays what it was: the last line.
Run time: 1 s.
Source:   the trapezoidal rule keeps the energy of a spring and a mass; the rest is docs/api.md.
"""

from pathlib import Path

import numpy as np

import hybrid

MASS, SPRING, STEP, STEPS = 20e3, 50e3, 0.02, 1000  # kg, N/m, s
PLACE, UP = np.array([205.0, 0.0, 0.0]), np.array([0.0, 0.0, 1.0])  # m, of the fairlead; -
scene = hybrid.load_scene(
    Path(__file__).with_name("touchdown.yaml"),
    [
        f"time={{duration: {STEP * STEPS}, step: {STEP}}}", "output.every=0.2", "model=catenary",
        "ends.end={kind: pinned, position: [205, 0, 0]}",
    ],
)  # fmt: skip

with hybrid.Simulation(scene) as cable:
    rest = cable.forces().end[2]  # N, the pull that the spring carries at rest
    z, v = 1.0, 0.0  # m, m/s
    a = (cable.forces().end[2] - rest - SPRING * z) / MASS
    cable.set_end("end", PLACE)  # the line stands at the rest of the body; it follows from there
    start, history = 0.5 * SPRING * z * z, []
    offset = z  # the fairlead is `offset` below the body's place, so that the line starts from rest
    for _ in range(STEPS):
        before, next_a = cable.save(), a
        for _ in range(20):  # until force and motion agree: the trapezoidal rule of the body, one step of the cable
            next_v = v + 0.5 * STEP * (a + next_a)
            next_z = z + 0.5 * STEP * (v + next_v)
            cable.restore(before)
            cable.set_end("end", PLACE + (next_z - offset) * UP, [0.0, 0.0, next_v])
            cable.step()
            found = (cable.forces().end[2] - rest - SPRING * next_z) / MASS
            next_a, change = found, abs(found - next_a)
            if change < 1e-9:
                break
        z, v, a = next_z, next_v, next_a
        history.append((cable.t, z, 0.5 * MASS * v * v + 0.5 * SPRING * z * z + rest * (z - offset)))
    result = cable.result()

history = np.array(history)
body = history[-1, 2] - start  # J, what body and spring have gained
given = float(result.work["end"][-1])  # J, what it has given to the cable
print(f"the body swings from {history[:, 1].min():.3f} to {history[:, 1].max():.3f} m")
print(f"energy of the body: {body:.1f} J; work on the cable: {given:.1f} J; together {body + given:.2f} J")
