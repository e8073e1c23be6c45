"""Exudyn: planar ANCF cable elements, with the sea and the seabed as user functions.

Exudyn has neither a Morison drag nor a seabed for cables.  Both, and the added mass, are one ObjectGenericODE2 on all
nodes, lumped at the nodes, whose forces, mass matrix and Jacobian are arrays over all nodes.  The cable, the integrator
and the linear algebra are Exudyn's own.  The elements are planar, with two thirds of the unknowns of spatial ones.

Symbols: x along the span, z up, both of a node followed by the two components of its slope dr/ds.
"""

from __future__ import annotations

import contextlib
import math
import sys
import time as clock
from typing import Any

import numpy as np

from peers.adapters.interface import Line, PeerFailed, PeerResult, PeerRun

BLEND = 1e-2  # m of depth of the seabed over which its damper, which acts on the way down only, comes in
OUT_OF_PLANE = 1e-6  # of the length: what leaves the vertical plane of the ends by more is not planar
SPECTRAL_RADIUS = 0.4  # of generalized-alpha: what served best on the mooring line of the examples (bench/peers)
NEWTON = 1e-3  # its relative tolerance; 1e-6 changes the pull by less than the elements do
SMALLEST_STEP = 1e-4  # s: it halves a step that fails, and gives up below this


class Sea:
    """Drag, added mass, lost buoyancy and seabed at the nodes, and their derivatives."""

    def __init__(self, exudyn: Any, line: Line, reference: np.ndarray, share: np.ndarray) -> None:
        self.exudyn, self.reference, self.share = exudyn, reference, share
        area = math.pi / 4 * line.diameter**2
        self.normal = 0.5 * line.density * line.diameter * line.drag[0] * share
        self.tangential = 0.5 * line.density * math.pi * line.diameter * line.drag[1] * share
        self.buoyancy = line.density * area * line.gravity * share
        self.added = line.density * area * line.added * share
        self.added[[0, -1]] = 0.0  # the reaction is to be that of the line, without the end node's own inertia
        self.bed, self.stiffness, self.damping = line.bed or (-math.inf, 0.0, 0.0)
        nodes = np.arange(share.size)
        self.triplets, self.masses = np.empty((8 * share.size, 3)), np.empty((4 * share.size, 3))
        for into, columns in ((self.triplets, 4), (self.masses, 2)):
            rows, cols = np.meshgrid([0, 1], range(columns), indexing="ij")
            into[:, 0] = (4 * nodes[:, None] + rows.ravel()).ravel()
            into[:, 1] = (4 * nodes[:, None] + cols.ravel()).ravel()
        self.out = np.zeros((share.size, 4))

    def frame(self, q: Any) -> tuple[np.ndarray, ...]:
        """Height, the two components of the tangent, the stretch, and the wet part of each node's share."""
        place = np.asarray(q).reshape(-1, 4) + self.reference
        stretch = np.hypot(place[:, 2], place[:, 3])
        z = place[:, 1]
        return z, place[:, 2] / stretch, place[:, 3] / stretch, stretch, self._wet(z)

    def _wet(self, z: np.ndarray) -> np.ndarray:
        if z.max() <= 0:
            return np.ones(z.size)
        low, high = np.minimum(z[1:], z[:-1]), np.maximum(z[1:], z[:-1])
        part = np.clip(-low / (high - low + 1e-12), 0.0, 1.0)
        return np.concatenate([part[:1], 0.5 * (part[1:] + part[:-1]), part[-1:]])

    def force(self, mbs: Any, t: float, number: int, q: Any, q_t: Any) -> np.ndarray:
        z, tx, tz, _, wet = self.frame(q)
        vx, vz = np.asarray(q_t).reshape(-1, 4)[:, :2].T
        along, across = vx * tx + vz * tz, vz * tx - vx * tz
        ft, fn = -self.tangential * wet * np.abs(along) * along, -self.normal * wet * np.abs(across) * across
        depth = self.bed - z
        contact = np.clip(depth / BLEND, 0.0, 1.0)
        bed = self.stiffness * np.maximum(depth, 0.0) - self.damping * contact * np.minimum(vz, 0.0)
        self.out[:, 0] = ft * tx - fn * tz
        self.out[:, 1] = ft * tz + fn * tx + bed * self.share - self.buoyancy * (1 - wet)
        return self.out.ravel()

    def jacobian(self, mbs: Any, t: float, number: int, q: Any, q_t: Any, by_place: float, by_speed: float) -> Any:
        z, tx, tz, stretch, wet = self.frame(q)
        vx, vz = np.asarray(q_t).reshape(-1, 4)[:, :2].T
        along, across = vx * tx + vz * tz, vz * tx - vx * tz
        a, b = self.normal * wet * np.abs(across), self.tangential * wet * np.abs(along)
        depth = self.bed - z
        damping = self.damping * np.clip(depth / BLEND, 0.0, 1.0) * (vz < 0)
        stiffness = np.where(depth > 0, self.stiffness, 0.0)
        stiffness -= np.where((depth > 0) & (depth < BLEND), self.damping / BLEND * np.minimum(vz, 0.0), 0.0)
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
        return self._matrix(self.triplets, value)

    def mass(self, mbs: Any, t: float, number: int, q: Any, q_t: Any) -> Any:
        _, tx, tz, _, wet = self.frame(q)
        m = self.added * wet
        value = np.empty((self.share.size, 2, 2))
        value[:, 0, 0], value[:, 1, 1] = m * tz * tz, m * tx * tx
        value[:, 0, 1] = value[:, 1, 0] = -m * tx * tz
        return self._matrix(self.masses, value)

    def _matrix(self, triplets: np.ndarray, value: np.ndarray) -> Any:
        triplets[:, 2] = value.ravel() + 1e-12  # an entry that is zero would change the pattern
        matrix = self.exudyn.MatrixContainer()
        matrix.SetWithSparseMatrix(triplets, 4 * self.share.size, 4 * self.share.size)
        return matrix


class Exudyn:
    """Exudyn: absolute nodal coordinates, generalized-alpha, sparse Newton."""

    model, package = "planar ANCF elements", "exudyn"
    settings = ((25, 80), (50, 80), (100, 80), (100, 160))

    def run(self, line: Line, peer_run: PeerRun, times: list[float]) -> PeerResult:
        setattr(sys, "exudynFast", True)  # noqa: B010  Exudyn's own switch: no range checks
        with contextlib.redirect_stdout(None):
            import exudyn

        interval = times[1] - times[0]
        if np.ptp(np.diff(times)) > 1e-6 * interval:
            raise PeerFailed("outputs are not evenly spread")
        origin, e = _plane(line, times)
        step = line.length / peer_run.elements
        begin = clock.process_time()
        exudyn.config.printToConsole = False
        container = exudyn.SystemContainer()
        mbs = container.AddSystem()
        nodes = _elements(exudyn, mbs, line, peer_run.elements, origin, e)
        position = exudyn.OutputVariableType.Position
        forces = _held_ends(exudyn, mbs, line, (nodes[0], nodes[-1]), origin, e)
        seen = [
            mbs.AddSensor(_items().SensorNode(nodeNumber=n, outputVariableType=position, storeInternal=True))
            for n in nodes
        ]
        mbs.Assemble()
        steps = max(1, math.ceil(interval * (peer_run.per_period or 1) / line.period - 1e-9)) * (len(times) - 1)
        rest = _solved(exudyn, mbs, times, steps)
        cpu = clock.process_time() - begin

        def stored(sensor: Any) -> np.ndarray:
            rows = np.asarray(mbs.GetSensorStoredData(sensor))
            return np.stack([np.interp(times, rows[:, 0], column) for column in rows[:, 1:].T], axis=1)

        nodes_at = np.stack([stored(sensor)[:, :2] for sensor in seen], axis=1)  # (nt, n+1, 2)
        whole = origin + nodes_at[..., :1] * e
        whole[..., 2] = nodes_at[..., 1]
        values = {"position": np.stack([line.places(x) for x in whole])}
        for k, name in enumerate(("reaction_start", "reaction_end")):
            pull = -np.stack([stored(forces[2 * k + axis])[:, 0] for axis in (0, 1)], axis=1)
            pull[0] = rest[2 * k : 2 * k + 2]  # no force is stored before the first step
            force_on_line = pull[:, :1] * e + pull[:, 1:] * (0.0, 0.0, 1.0)
            # less what moves the end node's share of the line: the peer_codes do not count that either
            values[name] = force_on_line - 0.5 * step * line.mass * np.array([line.end(k, t)[2] for t in times])
        return PeerResult(values, cpu, steps)


def _items() -> Any:
    from exudyn import itemInterface

    return itemInterface


def _elements(exudyn: Any, mbs: Any, line: Line, count: int, origin: np.ndarray, e: np.ndarray) -> list[Any]:
    """The line's elements with their weight and the sea, in the shape in which it hangs; their nodes."""
    items, step, shape = _items(), line.length / count, line.hanging(count)
    places = np.stack([(shape - origin) @ e, shape[:, 2]], axis=1)
    reference = np.hstack([places, np.gradient(places, step, axis=0)])
    nodes = [mbs.AddNode(items.NodePoint2DSlope1(referenceCoordinates=list(row))) for row in reference]
    sunk = line.mass - line.density * math.pi / 4 * line.diameter**2
    for i in range(count):
        cable = mbs.AddObject(
            items.ObjectANCFCable2D(
                length=step, massPerLength=line.mass, bendingStiffness=line.ei, axialStiffness=line.ea,
                nodeNumbers=[nodes[i], nodes[i + 1]], useReducedOrderIntegration=1, strainIsRelativeToReference=0.0,
            )
        )  # fmt: skip
        marker = mbs.AddMarker(items.MarkerBodyMass(bodyNumber=cable))
        weight = [0.0, -sunk / line.mass * line.gravity, 0.0]
        mbs.AddLoad(items.LoadMassProportional(markerNumber=marker, loadVector=weight))
    share = np.full(count + 1, step)
    share[[0, -1]] = 0.5 * step
    sea, size = Sea(exudyn, line, reference, share), 4 * (count + 1)
    empty = exudyn.MatrixContainer()
    empty.SetWithSparseMatrix(np.array([[0.0, 0.0, 1e-12]]), size, size)
    mbs.AddObject(
        items.ObjectGenericODE2(
            nodeNumbers=nodes, massMatrix=empty, stiffnessMatrix=empty, dampingMatrix=empty,
            forceUserFunction=sea.force, massMatrixUserFunction=sea.mass, jacobianUserFunction=sea.jacobian,
        )
    )  # fmt: skip
    return nodes


def _held_ends(
    exudyn: Any, mbs: Any, line: Line, nodes: tuple[Any, Any], origin: np.ndarray, e: np.ndarray
) -> list[Any]:
    """Move both ends as the line says; sensors of the forces, horizontal and vertical, of each."""
    items = _items()

    def flat(k: int, t: float) -> tuple[np.ndarray, np.ndarray]:
        q, v, _ = line.end(k, t)
        return np.array([(q - origin) @ e, q[2]]), np.array([v @ e, v[2]])

    ground = mbs.AddMarker(items.MarkerNodeCoordinate(nodeNumber=mbs.AddNode(items.NodePointGround()), coordinate=0))
    force, forces = exudyn.OutputVariableType.Force, []
    for k, node in enumerate(nodes):
        for axis in (0, 1):
            marker = mbs.AddMarker(items.MarkerNodeCoordinate(nodeNumber=node, coordinate=axis))
            offset, offset_t = _driven(flat, k, axis)
            held = mbs.AddObject(
                items.ObjectConnectorCoordinate(
                    markerNumbers=[ground, marker], offsetUserFunction=offset, offsetUserFunction_t=offset_t
                )
            )
            sensor = items.SensorObject(objectNumber=held, outputVariableType=force, storeInternal=True)
            forces.append(mbs.AddSensor(sensor))
    return forces


def _solved(exudyn: Any, mbs: Any, times: list[float], steps: int) -> np.ndarray:
    """Equilibrium, then the motion; the constraint forces of the equilibrium."""
    how = exudyn.SimulationSettings()
    how.linearSolver.solverType = exudyn.LinearSolverType.EigenSparse
    how.linearSolver.reuseAnalyzedPattern = True
    how.solution.file.write = False
    how.staticSolver.numberOfLoadSteps, how.staticSolver.useLoadFactor = 1, False
    how.staticSolver.newton.relativeTolerance, how.staticSolver.newton.maxIterations = 1e-8, 100
    if not mbs.SolveStatic(how, updateInitialValues=True):
        raise PeerFailed("it finds no static equilibrium")
    rest = np.asarray(mbs.systemData.GetAECoordinates(configuration=exudyn.ConfigurationType.Initial))
    march = how.timeIntegration
    march.endTime, march.numberOfSteps = times[-1], steps
    march.generalizedAlpha.spectralRadius = SPECTRAL_RADIUS
    march.generalizedAlpha.computeInitialAccelerations = False
    march.newton.relativeTolerance, march.minimumStepSize = NEWTON, SMALLEST_STEP
    how.solution.sensors.writePeriod = times[1] - times[0]
    if not mbs.SolveDynamic(how, solverType=exudyn.DynamicSolverType.GeneralizedAlpha):
        raise PeerFailed("it stops on the way")
    return rest


def _plane(line: Line, times: list[float]) -> tuple[np.ndarray, np.ndarray]:
    """A point, and the level direction, of the vertical plane in which the ends move; PeerFailed if they leave it."""
    ends = np.array([[line.end(k, t)[0] for t in times] for k in (0, 1)])
    origin = ends[0, 0] * (1.0, 1.0, 0.0)
    span = (ends[1, 0] - ends[0, 0]) * (1.0, 1.0, 0.0)
    far = float(np.linalg.norm(span))
    e = span / far if far > OUT_OF_PLANE * line.length else np.array([1.0, 0.0, 0.0])
    across = (ends - origin) @ np.array([-e[1], e[0], 0.0])
    if np.abs(across).max() > OUT_OF_PLANE * line.length:
        raise PeerFailed("the ends leave a vertical plane, and its elements are planar")
    return origin, e


def _driven(flat: Any, k: int, axis: int) -> tuple[Any, Any]:
    """Offset of a coordinate of an end from where it was at first, and its rate, as user functions."""
    first = flat(k, 0.0)[0][axis]

    def offset(mbs: Any, t: float, number: int, value: float) -> float:
        return float(flat(k, t)[0][axis] - first)

    def offset_t(mbs: Any, t: float, number: int, value: float) -> float:
        return float(flat(k, t)[1][axis])

    return offset, offset_t
