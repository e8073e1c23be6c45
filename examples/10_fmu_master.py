"""A mooring line as an FMU, moved by a master of ten lines.

Shows:    `hybrid.export_fmu` (on the command line: `hybrid export scene.yaml -o line.fmu`) and FMPy, which runs units
          of FMI 3.0; any other program that does may take its place.
Physics:  the fairlead of examples/touchdown.yaml is moved up and down by 1 m with a period of 8 s.
Look at:  forces come out as of `hybrid.Simulation`, to round-off.
Run time: 3 s.
Source:   FMI 3.0, co-simulation.

    pip install "hybrid-cable[fmu]" fmpy
    python examples/10_fmu_master.py [picture.png]
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import fmpy
import numpy as np
from fmpy.fmi3 import FMU3Slave

import hybrid

STEP, DURATION, HEAVE, PERIOD = 0.1, 20.0, 1.0, 8.0  # s, s, m, s
SETTINGS = [f"time={{duration: {DURATION}, step: {STEP}}}", "model=catenary",
            "ends.end={kind: pinned, position: [205, 0, 0]}"]  # fmt: skip
SCENE = hybrid.load_scene(Path(__file__).with_name("touchdown.yaml"), SETTINGS)


def lifted(t: float) -> tuple[float, float]:
    """Height (m) and velocity (m/s) of the fairlead at t (s); it starts without a jump of the acceleration."""
    rate = np.pi / PERIOD
    c, s = np.cos(rate * t), np.sin(rate * t)
    return HEAVE * s**4, 4.0 * HEAVE * rate * s**3 * c


def by_fmu(unit: Path, unpacked: Path) -> np.ndarray:
    """Vertical pull (N) at the fairlead after every step, from the FMU."""
    fmpy.extract(unit, unpacked)
    description = fmpy.read_model_description(unpacked)
    number = {x.name: x.valueReference for x in description.modelVariables}
    cable = FMU3Slave(
        guid=description.guid, unzipDirectory=unpacked, modelIdentifier=description.coSimulation.modelIdentifier
    )  # fmt: skip
    cable.instantiate()
    cable.enterInitializationMode()
    cable.exitInitializationMode()
    pulls = []
    for k in range(round(DURATION / STEP)):
        inputs = [number["end.position.z"], number["end.velocity.z"]]
        cable.setFloat64(inputs, lifted((k + 1) * STEP))
        cable.doStep(currentCommunicationPoint=k * STEP, communicationStepSize=STEP)
        pulls += cable.getFloat64([number["end.force.z"]])
    cable.terminate()
    cable.freeInstance()
    return np.array(pulls)


def by_simulation() -> np.ndarray:
    """The same from Python."""
    with hybrid.Simulation(SCENE) as cable:
        pulls = []
        for k in range(round(DURATION / STEP)):
            z, v = lifted((k + 1) * STEP)
            cable.set_end("end", [205.0, 0.0, z], [0.0, 0.0, v])
            cable.step()
            pulls.append(cable.forces().end[2])
    return np.array(pulls)


def main(picture: str | None = None) -> float:
    """Largest difference of the pulls, N."""
    with tempfile.TemporaryDirectory() as folder:
        unit = hybrid.export_fmu(SCENE, Path(folder, "line.fmu"))
        pulls = by_fmu(unit, Path(folder, "unpacked"))
    off = float(np.abs(pulls - by_simulation()).max())
    print(f"pull on the fairlead from {-pulls.max():.0f} to {-pulls.min():.0f} N in {len(pulls)} steps")
    print(f"the FMU and hybrid.Simulation differ by {off:.1g} N at most")
    if picture is not None:
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure

        t = STEP * np.arange(1, len(pulls) + 1)
        figure = Figure(figsize=(8, 4), layout="constrained")
        FigureCanvasAgg(figure)
        above, below = figure.subplots(2, 1, sharex=True)
        above.plot(t, [lifted(x)[0] for x in t])
        above.set(ylabel="fairlead (m)")
        below.plot(t, -pulls / 1e3)
        below.set(xlabel="t (s)", ylabel="vertical pull (kN)")
        figure.savefig(picture, dpi=120)
    return off


if __name__ == "__main__":
    main(sys.argv[1] if len(sys.argv) > 1 else None)
