"""A mooring line whose fairlead is carried by a body on a spring: two programs that step together.

Shows:    `hybrid.Simulation`: a cable stepped from outside, its end set and its pull read at every step, and steps
          taken again until body and cable agree (implicit coupling).
Physics:  a body of 20 t on a vertical spring of 50 kN/m, let go 1 m above its rest, carries the upper end of
          examples/touchdown.yaml; the cable damps it.
Look at:  what the body has lost the cable has gained: together they are a tenth of a per cent of either, and a quarter
          of that with half the step.  Newton's method with the interface stiffness of the cable takes half the tries of
          plain repetition.
Run time: 3 s.
Source:   the trapezoidal rule keeps the energy of a spring and a mass; the rest is docs/api.md.

    python examples/09_coupled_body.py [picture.png]
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

import hybrid

MASS, SPRING, DURATION = 20e3, 50e3, 20.0  # kg, N/m, s
PLACE, UP = np.array([205.0, 0.0, 0.0]), np.array([0.0, 0.0, 1.0])  # m, of the fairlead at rest; -
LIFTED = 1.0  # m, of the body above its rest when it is let go


def main(picture: str | None = None, step: float = 0.02, newton: bool = True) -> tuple[float, float]:
    """Energy (J) that body and spring gain, and the work done on the cable.

    newton: the acceleration of the next try follows from the interface stiffness; else it is the one of the last try.
    """
    tries = 0
    settings = [
        f"time={{duration: {DURATION}, step: {step}}}", "output.every=0.2", "model=catenary",
        "ends.end={kind: pinned, position: [205, 0, 0]}",
    ]  # fmt: skip
    with hybrid.Simulation(hybrid.load_scene(Path(__file__).with_name("touchdown.yaml"), settings)) as cable:
        rest = cable.forces().end[2]  # N, the pull that the spring carries at rest
        z, v, a, history = LIFTED, 0.0, -SPRING * LIFTED / MASS, []
        while cable.t < DURATION - 0.5 * step:
            before, wanted, found, slope = cable.save(), np.inf, a, 0.0
            while abs(found - wanted) > 1e-9:  # m/s2, until the pull and the motion agree
                wanted = found if wanted == np.inf else wanted + (found - wanted) / (1.0 - slope)
                next_v = v + 0.5 * step * (a + wanted)
                next_z = z + 0.5 * step * (v + next_v)
                cable.restore(before)
                cable.set_end("end", PLACE + (next_z - LIFTED) * UP, next_v * UP)
                cable.step()
                found = (cable.forces().end[2] - rest - SPRING * next_z) / MASS
                if newton:  # d found / d wanted
                    slope = -0.25 * step**2 * (cable.stiffness("end")[2, 2] + SPRING) / MASS
                tries += 1
            z, v, a = next_z, next_v, found
            history.append((cable.t, z, cable.forces().end[2]))
        result = cable.result()

    t, places, pulls = np.array(history).T
    body = 0.5 * MASS * v * v + 0.5 * SPRING * (z * z - LIFTED**2) + rest * (z - LIFTED)
    given = float(result.work["end"][-1])
    print(f"the body swings from {places.min():.3f} to {places.max():.3f} m, the pull from {-pulls.max():.0f} to "
          f"{-pulls.min():.0f} N")  # fmt: skip
    print(f"{tries / len(t):.1f} tries of a step {'with the interface stiffness' if newton else 'by plain repetition'}")
    print(f"energy of the body {body:.1f} J, work on the cable {given:.1f} J, together {body + given:.2f} J")
    if picture is not None:
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure

        figure = Figure(figsize=(8, 4), layout="constrained")
        FigureCanvasAgg(figure)
        above, below = figure.subplots(2, 1, sharex=True)
        above.plot(t, places)
        above.set(ylabel="body (m)")
        below.plot(t, -pulls / 1e3)
        below.set(xlabel="t (s)", ylabel="vertical pull (kN)")
        figure.savefig(picture, dpi=120)
    return body, given


if __name__ == "__main__":
    main(newton=False)
    main(sys.argv[1] if len(sys.argv) > 1 else None)
