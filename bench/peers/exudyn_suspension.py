"""The suspension in Exudyn: planar ANCF cable elements, mass-proportional damping by dampers at the nodes."""

from __future__ import annotations

import contextlib
import importlib.util
import sys
import time

import numpy as np

from peers import suspension

AXIAL_STIFFNESS = 100.0  # N: stretches the line by 8e-5 of its length; stiffer ones cost Newton iterations


def available() -> bool:
    """Whether the package is installed."""
    return importlib.util.find_spec("exudyn") is not None


def run(elements: int, dt: float) -> tuple[float, float]:
    """CPU time (s) of its own time loop, and the largest distance (m) to the truth at the end."""
    setattr(sys, "exudynFast", True)  # noqa: B010  Exudyn's own switch: no range checks
    with contextlib.redirect_stdout(None):
        import exudyn
        from exudyn import itemInterface as items

    exudyn.config.printToConsole = False
    container = exudyn.SystemContainer()
    mbs = container.AddSystem()
    s = np.linspace(0.0, suspension.LENGTH, elements + 1)
    step, (tx, tz) = s[1], suspension.TANGENT
    nodes = [mbs.AddNode(items.NodePoint2DSlope1(referenceCoordinates=[tx * x, tz * x, tx, tz])) for x in s]
    for i in range(elements):
        cable = mbs.AddObject(
            items.ObjectANCFCable2D(
                length=step,
                massPerLength=suspension.MASS,
                bendingStiffness=suspension.BENDING_STIFFNESS,
                axialStiffness=AXIAL_STIFFNESS,
                nodeNumbers=[nodes[i], nodes[i + 1]],
                useReducedOrderIntegration=1,
            )
        )
        marker = mbs.AddMarker(items.MarkerBodyMass(bodyNumber=cable))
        pull = [0.0, -suspension.WEIGHT / suspension.MASS, 0.0]
        mbs.AddLoad(items.LoadMassProportional(markerNumber=marker, loadVector=pull))
    origin = mbs.AddNode(items.NodePointGround())
    ground = mbs.AddMarker(items.MarkerNodeCoordinate(nodeNumber=origin, coordinate=0))

    def coordinate(node: int, number: int) -> int:
        return int(mbs.AddMarker(items.MarkerNodeCoordinate(nodeNumber=nodes[node], coordinate=number)))

    for i in range(elements + 1):
        share = step * (0.5 if i in (0, elements) else 1.0) * suspension.MASS * suspension.DAMPING
        for number in (0, 1):
            both = [ground, coordinate(i, number)]
            mbs.AddObject(items.ObjectConnectorCoordinateSpringDamper(markerNumbers=both, stiffness=0, damping=share))
    for number in (0, 1):
        mbs.AddObject(items.ObjectConnectorCoordinate(markerNumbers=[ground, coordinate(0, number)]))
    guide = [coordinate(elements, 3), coordinate(elements, 2)]
    mbs.AddObject(items.ObjectConnectorCoordinate(markerNumbers=guide, factorValue1=tz / tx))
    end = mbs.AddMarker(items.MarkerNodePosition(nodeNumber=nodes[-1]))
    mbs.AddLoad(items.LoadForceVector(markerNumber=end, loadVector=[*suspension.FORCE, 0.0]))
    mbs.Assemble()

    how = exudyn.SimulationSettings()
    how.linearSolver.solverType = exudyn.LinearSolverType.EigenSparse
    how.linearSolver.reuseAnalyzedPattern = True
    how.solution.file.write = False
    how.timeIntegration.endTime = suspension.DURATION
    how.timeIntegration.numberOfSteps = round(suspension.DURATION / dt)
    how.timeIntegration.generalizedAlpha.spectralRadius = 0.4
    how.timeIntegration.newton.relativeTolerance = 1e-5
    how.timeIntegration.newton.useModifiedNewton = True
    begin = time.process_time()
    if not mbs.SolveDynamic(how, solverType=exudyn.DynamicSolverType.GeneralizedAlpha):
        raise RuntimeError("Exudyn stops on the way")
    cpu = time.process_time() - begin
    found = np.array([
        mbs.GetNodeOutput(node, exudyn.OutputVariableType.Position)[:2] for node in nodes
    ])  # fmt: skip
    return cpu, suspension.distance(s, found[:, 0], found[:, 1])
