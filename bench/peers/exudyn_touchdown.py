"""The touchdown scene in Exudyn: planar ANCF cable elements, with the sea and the seabed as user functions.

Exudyn has neither a Morison drag nor a seabed for cables.  Both, and the added mass, are one ObjectGenericODE2 on
all nodes, lumped at the nodes, whose forces, mass matrix and Jacobian are arrays over all nodes in numpy; they take
a fifth of the time.  The cable, the integrator and the linear algebra are Exudyn's own.  The elements are the planar
ones, with two thirds of the unknowns of the spatial ones: the scene is planar, the other codes are spatial.
"""

from __future__ import annotations

import contextlib
import importlib.util
import math
import sys
import time
from typing import Any

import numpy as np
from numpy.typing import NDArray

from peers import scene
from peers.answer import Answer

NAME = "Exudyn"
AREA = math.pi / 4 * scene.DIAMETER**2
BLEND = 1e-2
"""Depth of the seabed over which its damper, which acts on the way down only, comes in, m."""
SUBMERGED = (scene.MASS - scene.DENSITY * AREA) * scene.GRAVITY

Vector = NDArray[np.float64]


def available() -> bool:
    """Whether the package is installed."""
    return importlib.util.find_spec("exudyn") is not None


def catenary(s: Vector) -> tuple[Vector, Vector]:
    """Places (n, 2) and tangents (n, 2), which carry the stretch, of the elastic catenary on the bed it has pressed."""
    pressed = SUBMERGED / scene.SEABED_STIFFNESS
    rise, span = scene.FAIRLEAD[2] - scene.ANCHOR[2] + pressed, scene.FAIRLEAD[0] - scene.ANCHOR[0]
    w = SUBMERGED

    def hanging(tension: float, length: Vector | float) -> tuple[Any, Any]:
        x = tension / w * np.arcsinh(w * length / tension) + tension * length / scene.EA
        return x, (np.hypot(tension, w * length) - tension) / w + w * length**2 / (2 * scene.EA)

    def lifted(tension: float) -> float:
        low, high = 0.0, scene.LENGTH
        for _ in range(100):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if hanging(tension, middle)[1] < rise else (low, middle)
        return low

    def reach(tension: float) -> float:
        free = lifted(tension)
        return float(hanging(tension, free)[0] + (scene.LENGTH - free) * (1 + tension / scene.EA))

    low, high = 1.0, 1e6
    for _ in range(200):
        middle = math.sqrt(low * high)
        low, high = (middle, high) if reach(middle) < span else (low, middle)
    tension = low
    grounded = scene.LENGTH - lifted(tension)
    up = np.maximum(s - grounded, 0.0)
    x, z = hanging(tension, up)
    x = x + np.minimum(s, grounded) * (1 + tension / scene.EA)
    pull = np.hypot(tension, w * up)
    tangent = np.stack([np.full_like(s, tension), w * up], axis=1) / pull[:, None] * (1 + pull / scene.EA)[:, None]
    z = z + scene.ANCHOR[2] - pressed * np.minimum(s / 2.0, 1.0)  # two metres of climb to the anchor
    return np.stack([x + scene.ANCHOR[0], z], axis=1), tangent


class Sea:
    """Drag, added mass, lost buoyancy and seabed at the nodes, and their derivatives."""

    def __init__(self, exudyn: Any, reference: Vector, share: Vector) -> None:
        self.exudyn, self.reference, self.share = exudyn, reference, share
        self.normal = 0.5 * scene.DENSITY * scene.DIAMETER * scene.DRAG_NORMAL * share
        self.tangential = 0.5 * scene.DENSITY * math.pi * scene.DIAMETER * scene.DRAG_TANGENTIAL * share
        self.buoyancy = scene.DENSITY * AREA * scene.GRAVITY * share
        self.added = scene.DENSITY * AREA * scene.ADDED_NORMAL * share
        self.added[[0, -1]] = 0.0  # the reaction is to be that of the line, without the end node's own inertia
        nodes = np.arange(share.size)
        # rows and columns of the derivatives of two forces by four coordinates, and of a two by two mass
        rows, columns = np.meshgrid([0, 1], [0, 1, 2, 3], indexing="ij")
        self.triplets = np.empty((8 * share.size, 3))
        self.triplets[:, 0] = (4 * nodes[:, None] + rows.ravel()).ravel()
        self.triplets[:, 1] = (4 * nodes[:, None] + columns.ravel()).ravel()
        rows, columns = np.meshgrid([0, 1], [0, 1], indexing="ij")
        self.masses = np.empty((4 * share.size, 3))
        self.masses[:, 0] = (4 * nodes[:, None] + rows.ravel()).ravel()
        self.masses[:, 1] = (4 * nodes[:, None] + columns.ravel()).ravel()
        self.out = np.zeros((share.size, 4))
        self.whole = np.ones(share.size)

    def frame(self, q: Vector) -> tuple[Vector, Vector, Vector, Vector, Vector]:
        """Height, the two components of the tangent, the stretch, and the wet part of each node's share."""
        place = q.reshape(-1, 4) + self.reference
        stretch = np.hypot(place[:, 2], place[:, 3])
        tx, tz = place[:, 2] / stretch, place[:, 3] / stretch
        z = place[:, 1]
        return z, tx, tz, stretch, self.wet(z)

    def wet(self, z: Vector) -> Vector:
        """The part of each node's share that is under water, from the chords of the elements next to it."""
        if z.max() <= 0:
            return self.whole
        low, high = np.minimum(z[1:], z[:-1]), np.maximum(z[1:], z[:-1])
        part = np.clip(-low / (high - low + 1e-12), 0.0, 1.0)
        return np.concatenate([part[:1], 0.5 * (part[1:] + part[:-1]), part[-1:]])

    def force(self, mbs: Any, t: float, number: int, q: Any, q_t: Any) -> Vector:
        z, tx, tz, _, wet = self.frame(np.asarray(q))
        v = np.asarray(q_t).reshape(-1, 4)
        vx, vz = v[:, 0], v[:, 1]
        along, across = vx * tx + vz * tz, vz * tx - vx * tz
        ft, fn = -self.tangential * wet * np.abs(along) * along, -self.normal * wet * np.abs(across) * across
        depth = -scene.DEPTH - z
        contact = np.clip(depth / BLEND, 0.0, 1.0)
        bed = scene.SEABED_STIFFNESS * np.maximum(depth, 0.0) - scene.SEABED_DAMPING * contact * np.minimum(vz, 0.0)
        bed *= self.share
        self.out[:, 0] = ft * tx - fn * tz
        self.out[:, 1] = ft * tz + fn * tx + bed - self.buoyancy * (1 - wet)
        return self.out.ravel()

    def jacobian(self, mbs: Any, t: float, number: int, q: Any, q_t: Any, by_place: float, by_speed: float) -> Any:
        z, tx, tz, stretch, wet = self.frame(np.asarray(q))
        v = np.asarray(q_t).reshape(-1, 4)
        vx, vz = v[:, 0], v[:, 1]
        along, across = vx * tx + vz * tz, vz * tx - vx * tz
        a, b = self.normal * wet * np.abs(across), self.tangential * wet * np.abs(along)
        depth = -scene.DEPTH - z
        contact = np.clip(depth / BLEND, 0.0, 1.0)
        damping = scene.SEABED_DAMPING * contact * (vz < 0)
        stiffness = np.where(depth > 0, scene.SEABED_STIFFNESS, 0.0)
        stiffness -= np.where((depth > 0) & (depth < BLEND), scene.SEABED_DAMPING / BLEND * np.minimum(vz, 0.0), 0.0)
        value = np.empty((self.share.size, 2, 4))
        value[:, 0, 0] = 2 * by_speed * (a * tz * tz + b * tx * tx)
        value[:, 0, 1] = value[:, 1, 0] = 2 * by_speed * (b - a) * tx * tz
        value[:, 1, 1] = 2 * by_speed * (a * tx * tx + b * tz * tz)
        value[:, 1, 1] += self.share * (by_place * stiffness + by_speed * damping)
        # a turn of the tangent, by its two components
        turn_n, turn_t = 2 * a * along - b * along, a * across - 2 * b * across
        fx, fz = -by_place * (turn_t * tx - turn_n * tz) / stretch, -by_place * (turn_t * tz + turn_n * tx) / stretch
        value[:, 0, 2], value[:, 0, 3] = -fx * tz, fx * tx
        value[:, 1, 2], value[:, 1, 3] = -fz * tz, fz * tx
        self.triplets[:, 2] = value.ravel() + 1e-12
        matrix = self.exudyn.MatrixContainer()
        matrix.SetWithSparseMatrix(self.triplets, 4 * self.share.size, 4 * self.share.size)
        return matrix

    def mass(self, mbs: Any, t: float, number: int, q: Any, q_t: Any) -> Any:
        _, tx, tz, _, wet = self.frame(np.asarray(q))
        m = self.added * wet
        value = np.empty((self.share.size, 2, 2))
        value[:, 0, 0], value[:, 1, 1] = m * tz * tz, m * tx * tx
        value[:, 0, 1] = value[:, 1, 0] = -m * tx * tz
        self.masses[:, 2] = value.ravel() + 1e-12
        matrix = self.exudyn.MatrixContainer()
        matrix.SetWithSparseMatrix(self.masses, 4 * self.share.size, 4 * self.share.size)
        return matrix


def run(
    elements: int,
    EI: float,
    dt: float = 0.1,
    radius: float = 0.4,
    tolerance: float = 1e-3,
    modified: bool = False,
    damping: float = 0.0,
    integration: int = 1,
) -> Answer:
    """March the scene.

    Without bending stiffness the step must not exceed 0.05 s from 150 elements on, or the march blows up.

    `radius` is the spectral radius of the generalized-alpha method, `tolerance` Newton's relative one, `modified`
    asks for Exudyn's modified Newton method, `damping` is the axial damping (N s), `integration` chooses Exudyn's
    quadrature (0 full, 1 reduced, 2 Lobatto and Gauss).
    """
    setattr(sys, "exudynFast", True)  # noqa: B010  Exudyn's own switch: no range checks
    with contextlib.redirect_stdout(None):
        import exudyn
        from exudyn import itemInterface as items

    begin = time.process_time()
    exudyn.config.printToConsole = False
    step = scene.LENGTH / elements
    container = exudyn.SystemContainer()
    mbs = container.AddSystem()
    places, tangents = catenary(np.linspace(0.0, scene.LENGTH, elements + 1))
    reference = np.hstack([places, tangents])
    nodes = [mbs.AddNode(items.NodePoint2DSlope1(referenceCoordinates=list(row))) for row in reference]
    for i in range(elements):
        cable = mbs.AddObject(
            items.ObjectANCFCable2D(
                length=step,
                massPerLength=scene.MASS,
                bendingStiffness=EI,
                axialStiffness=scene.EA,
                axialDamping=damping,
                nodeNumbers=[nodes[i], nodes[i + 1]],
                useReducedOrderIntegration=integration,
                strainIsRelativeToReference=0.0,
            )
        )
        marker = mbs.AddMarker(items.MarkerBodyMass(bodyNumber=cable))
        weight = [0.0, -SUBMERGED / scene.MASS, 0.0]
        mbs.AddLoad(items.LoadMassProportional(markerNumber=marker, loadVector=weight))

    share = np.full(elements + 1, step)
    share[[0, -1]] = 0.5 * step
    sea = Sea(exudyn, reference, share)
    size = 4 * (elements + 1)
    empty = exudyn.MatrixContainer()
    empty.SetWithSparseMatrix(np.array([[0.0, 0.0, 1e-12]]), size, size)
    mbs.AddObject(
        items.ObjectGenericODE2(
            nodeNumbers=nodes,
            massMatrix=empty,
            stiffnessMatrix=empty,
            dampingMatrix=empty,
            forceUserFunction=sea.force,
            massMatrixUserFunction=sea.mass,
            jacobianUserFunction=sea.jacobian,
        )
    )

    moving = False

    def offset(mbs: Any, t: float, number: int, value: float) -> float:
        return scene.heave(t)[0] if moving else 0.0

    def offset_t(mbs: Any, t: float, number: int, value: float) -> float:
        return scene.heave(t)[1] if moving else 0.0

    origin = mbs.AddNode(items.NodePointGround())
    ground = mbs.AddMarker(items.MarkerNodeCoordinate(nodeNumber=origin, coordinate=0))
    sensors = []
    for node, coordinate, driven in ((0, 0, False), (0, 1, False), (elements, 0, False), (elements, 1, True)):
        marker = mbs.AddMarker(items.MarkerNodeCoordinate(nodeNumber=nodes[node], coordinate=coordinate))
        extra = {"offsetUserFunction": offset, "offsetUserFunction_t": offset_t} if driven else {}
        held = mbs.AddObject(items.ObjectConnectorCoordinate(markerNumbers=[ground, marker], **extra))
        if node == elements:
            force = exudyn.OutputVariableType.Force
            sensors.append(
                mbs.AddSensor(items.SensorObject(objectNumber=held, outputVariableType=force, storeInternal=True))
            )
    mbs.Assemble()

    how = exudyn.SimulationSettings()
    how.linearSolver.solverType = exudyn.LinearSolverType.EigenSparse
    how.linearSolver.reuseAnalyzedPattern = True
    how.solution.file.write = False
    how.staticSolver.numberOfLoadSteps = 1
    how.staticSolver.useLoadFactor = False
    how.staticSolver.newton.relativeTolerance = 1e-8
    how.staticSolver.newton.maxIterations = 100
    if not mbs.SolveStatic(how, updateInitialValues=True):
        raise RuntimeError("Exudyn finds no static equilibrium")
    rest = np.asarray(mbs.systemData.GetAECoordinates(configuration=exudyn.ConfigurationType.Initial))[2:]
    cpu_start = time.process_time() - begin

    moving = True
    integrator = how.timeIntegration
    integrator.endTime = scene.DURATION
    integrator.numberOfSteps = round(scene.DURATION / dt)
    integrator.generalizedAlpha.spectralRadius = radius
    integrator.generalizedAlpha.computeInitialAccelerations = False
    integrator.newton.useModifiedNewton = modified
    integrator.newton.relativeTolerance = tolerance
    integrator.minimumStepSize = 1e-4  # Exudyn halves a step that fails; below this it gives up
    how.solution.sensors.writePeriod = min(dt, 0.1)
    begin = time.process_time()
    if not mbs.SolveDynamic(how, solverType=exudyn.DynamicSolverType.GeneralizedAlpha):
        raise RuntimeError("Exudyn stops on the way")
    cpu = time.process_time() - begin

    stored = [np.asarray(mbs.GetSensorStoredData(sensor)) for sensor in sensors]
    times = stored[0][:, 0]
    inertia = 0.5 * step * scene.MASS * np.array([scene.heave(t)[2] for t in times])
    up = stored[1][:, 1]
    up = np.abs(up) - inertia  # of the end node's share of the line; the others do not count it as tension either
    tension = np.hypot(stored[0][:, 1], up)
    tension[0] = math.hypot(*rest)
    settings = f"dt {dt:g} s, spectral radius {radius:g}, Newton {tolerance:g}{' modified' if modified else ''}"
    settings += f", quadrature {integration}" + (f", damping {damping:g}" if damping else "")
    return Answer(times, tension, cpu, cpu_start, settings)
