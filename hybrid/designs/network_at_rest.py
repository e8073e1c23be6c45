"""An equilibrium of lines, and what its results answer to numbers of the scene.

At an equilibrium R(q; p) = 0, so that  A dq/dp = dR/dp  with the matrix A of the modes (theory.md, 20): one solve for
each number, in place of two equilibria.  dR/dp is the change of the block rows of the same state between two networks.
Lines that meet at free points move with them, and those at bodies turn with these.  A cable is the network of one line.

Of a body that lines pull at with forces f at arms a, and with moments m where they are clamped,

    R = (F + sum f,  M + sum (a x f + m)),

a change of the scene changes its own F and M (weight, water, loads), the arms, and the forces and moments of the same
shapes of the lines.  What lines leave over at their ends comes through the place of the ends (linear.matrices).

Contact of lines with each other has an energy, whose second derivative by the places of the nodes belongs to the
matrix.  Diameters, bending stiffness and lengths change the forces of the same shapes; sample points stay as many as
they are.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import cached_property
from types import MappingProxyType
from typing import NamedTuple

import numpy as np
from scipy import sparse

from hybrid.accuracy.passes import first_at_rest
from hybrid.designs.line_at_rest import (
    LEFT_OUT,
    NO_FRAMES,
    Beside,
    Factors,
    Frames,
    LineAtRest,
    at_rest_alone,
    moment_on_body,
)
from hybrid.designs.numbers_and_results import (
    Wanted,
    at_a_bound,
    number_in,
    number_of,
    parse_wanted,
    step_at_rest,
    with_number,
)
from hybrid.errors import Complaint, ComputationError, Outcome, SceneError
from hybrid.kernels.algebra.block_elimination import SIZE
from hybrid.kernels.junctions.bodies import FRAME, OWN, PIECES, SOFTEST, V
from hybrid.kernels.junctions.joined_lines import TURNS
from hybrid.kernels.state.report import RADIUS, ROLLED
from hybrid.kernels.state.state import Floats
from hybrid.linear.matrices import LinearNetwork, in_last, linear_network, stiffness_by_water
from hybrid.linear.touching import stiffness_between
from hybrid.model.bodies import BodyModel, loads_of
from hybrid.model.build import Model, places_of
from hybrid.model.nearby import nearby, nearby_clamped, same_nodes, seats_know_no_shape, shaped_anew
from hybrid.model.network import NetworkModel, NetworkResolution, bodies_of, with_surfaces
from hybrid.model.sections import merged_sections, tension_scale
from hybrid.scene.base import dotted
from hybrid.scene.bodies import FreeBody, RigidBody
from hybrid.scene.combinations import refuse_use
from hybrid.scene.ends import Fairlead
from hybrid.scene.network import Network
from hybrid.scene.network_checks import contradictions_of
from hybrid.scene.read import scene_text
from hybrid.scene.root import Scene
from hybrid.scene.schema import LineScene
from hybrid.simulation.lines_contact import strand_in
from hybrid.simulation.run import Run, static_network
from hybrid.solve.contact import TouchingLine
from hybrid.solve.lines_at_rest import LinesAtRest
from hybrid.solve.network_solver import NetworkSolver
from hybrid.solve.stepper import NetworkState


class BodiesAtRest:
    """What turns by the moments of its lines, in the equilibrium of a scene."""

    def __init__(self, solver: NetworkSolver, states: NetworkState, model: NetworkModel) -> None:
        """solver: of the lines in their equilibrium, whose numbers of bodies are those there."""
        self._solver, self._states, self._model = solver, states, model
        self.count, self._points = len(solver.bodies), len(solver.net)
        self._numbers = solver.bodies.copy()

    def axes(self, b: int) -> Floats:
        """Axes (3, 3) of a body, as columns."""
        return np.asarray(self._states.bodies[b, FRAME:V].reshape(3, 3))

    def body_at(self, l: int, k: int) -> int:
        """The body at end k of line l; -1: there is none."""
        return max(int(self._solver.joints[l, k]) - self._points, -1)

    def turns(self, l: int) -> list[int]:
        """Ends of line l whose frames turn with a body."""
        return [k for k in (0, 1) if self.body_at(l, k) >= 0 and self._solver.lines[l].seats[k, TURNS] != 0.0]

    def frames(self, l: int, seats: Floats) -> Frames:
        """Frames of the ends of line l that turn with bodies, with seats (2, SEAT) in these."""
        return {k: (self.axes(self.body_at(l, k)) @ seats[k, :TURNS].reshape(3, 3)).ravel() for k in self.turns(l)}

    def arms(self, l: int, fairleads: Floats) -> Floats:
        """(2, 3) m from the origin of the body to each end of line l, inertial, with fairleads (2, 3) on it."""
        bodies = [self.body_at(l, k) for k in (0, 1)]
        return np.stack([self.axes(b) @ x if b >= 0 else np.zeros(3) for b, x in zip(bodies, fairleads, strict=True)])

    def loads_besides_lines(self, model: NetworkModel) -> Floats:
        """(B, 6) N, N m, on the bodies but for their lines, as a model has them where they are.

        ValueError: the model has other members.
        """
        numbers = model.body_numbers(np.inf)
        if numbers.shape != self._numbers.shape or not np.array_equal(numbers[:, PIECES], self._numbers[:, PIECES]):
            raise ValueError("other pieces of members")
        model.update_water(np.inf, self._states.bodies, 0.0, numbers)
        self._solver.bodies[:] = numbers
        try:
            self._solver.evaluate_forces(self._states, 0.0)
            return np.asarray(self._solver.body_work[:, OWN : OWN + 6].copy())
        finally:
            self._solver.bodies[:] = self._numbers

    def pressed(self, lines: Sequence[Beside]) -> Floats:
        """(B, 6) N, N m, of lines that touch bodies on these, of the same shapes, with the numbers of other scenes.

        What bodies carry is brought to where they are in the seas of the lines.
        """
        out = np.zeros((self.count, 6))
        if self._solver.meets:
            both = zip(self._solver.lines, lines, strict=True)
            of = [x._replace(line=at_rest_alone(y.model.line), sea=y.sea) for x, y in both]
            solver = NetworkSolver(of, self._points, self._numbers)
            _, _, wrench, carriers = solver.pressed_bodies(self._states)
            out[carriers] = wrench
        return out

    def stiffness_besides(self, stiffness: sparse.csc_array) -> sparse.csc_array:
        """Stiffness (q, q) of bodies, the last of q, that the matrix of the network leaves out.

        Water around members that is another where they go, and a spring against turns that nothing holds, as Newton's
        method has it.
        """
        size, blocks, x = stiffness.shape[0], list[Floats](), self._solver.lines[0]
        diagonal = np.abs(stiffness.diagonal()[size - 6 * self.count :].reshape(-1, 6))
        for b in range(self.count):
            members = self._model.bodies[b].members if b < len(self._model.bodies) else None
            block = stiffness_by_water(self._solver, self._states, b, members)
            stiffest = float(diagonal[b, 3:].max())
            if (mine := np.flatnonzero(x.rides == b)).size:  # what touches it may roll
                stiffest = max(stiffest, float(diagonal[b, :3].max() * x.sea.obstacles[mine, RADIUS].max() ** 2))
            block[3:, 3:] += SOFTEST * (stiffest or 1.0) * np.eye(3)
            blocks.append(block)
        return sparse.csc_array(in_last(size, blocks))


def with_bodies(model: NetworkModel, network: Network) -> NetworkModel:
    """The model with the bodies of a changed scene, and moments on its points; its lines stay as they are."""
    free = network.free_bodies
    held = [[network.points[x] for x in (line.start, line.end)] for line in network.lines.values()]
    places = [
        [x.place if isinstance(x, Fairlead) and x.body in free else (0.0, 0.0, 0.0) for x in pair] for pair in held
    ]
    moments = tuple(loads_of(network.moments_on(x)) for x in network.rigid)
    return replace(model, bodies=bodies_of(network), fairleads=np.array(places), moments=moments)


# Part of their diameters by which lines are thicker, and thinner, to tell whether they have only begun to touch.
BEGUN = 0.01


# How many times as many sample points tell what their spacing does to derivatives, and by how much more than the change
# these may be off: of hoses over wires, 16 show 0.8 of what is left, 4 a third (tests/designs/test_touching_lines.py).
FINER = {16: 1.5, 4: 4.0}


class ContactAtRest:
    """Of the lines of a solver that touch in states at rest."""

    def __init__(
        self, solver: NetworkSolver, states: NetworkState, names: Sequence[str], lines: Sequence[Beside]
    ) -> None:
        """lines: those of the equilibrium.  SceneError: a line touches itself alone, or something at its very end."""
        if any(x.counts.points for x, of in solver.contacts_at(states) if len(of) == 1) or solver.shared is None:
            raise _refused("contact of a line with itself", "no line touches itself")
        self._solver, self._states, self._shared = solver, states, solver.shared
        self._here = [lines[k] for k in self._shared.lines]
        self._nodes = np.array([x.line.s.size for x in solver.lines])
        begins = np.concatenate([[0], np.cumsum(self._nodes)[:-1]])
        self._node_of = np.concatenate([begins[k] + np.arange(self._nodes[k]) for k in self._shared.lines])
        self._ends = np.concatenate([begins, np.cumsum(self._nodes) - 1])
        self.stiffness = self._stiffness()
        bends = np.concatenate([x.line.element for x in solver.lines])
        self._kinks = not bends[np.unique(self.stiffness.nonzero()[0] // SIZE)].all()
        self.begins = self._begun(names)

    def _stiffness(self) -> sparse.csr_array:
        """(unknowns of all lines) N/m, of contact as it was looked at last."""
        found = stiffness_between(self._shared.contact, self._node_of, SIZE * int(self._nodes.sum()))
        if np.isin(found.nonzero()[0] // SIZE, self._ends).any():
            raise _refused("contact at an end of a line", "what touches does so away from the ends of lines")
        return found

    def finer(self) -> tuple[sparse.csr_array, float] | None:
        """The stiffness with more sample points, and by how much more than what it changes derivatives may be off.

        Between sample points a line lies as in hollows, and does not slide as it would.  None: that is not known, as of
        a line without bending stiffness, whose kink lies as in hollows between its nodes too.
        """
        if self._kinks:
            return None
        for finer, off in FINER.items():
            self._solver.contacts_at(self._states, finer)
            if not self._shared.contact.counts.overflow:
                return self._stiffness(), off
        return None

    def forces(self, lines: Sequence[Beside]) -> Floats:
        """(unknowns of all lines,) N, of the same shapes, on nodes of lines with other numbers."""
        now = [lines[k] for k in self._shared.lines]
        if all(x.model is y.model for x, y in zip(now, self._here, strict=True)):
            return self._pushes()
        self._shared.put([_strand(x) for x in now])
        try:
            return self._pushes()
        finally:
            self._shared.put([_strand(x) for x in self._here])

    def _pushes(self) -> Floats:
        self._solver.contacts_at(self._states)
        out = np.zeros((int(self._nodes.sum()), SIZE))
        out[self._node_of, 1:4] = np.concatenate([*self._shared.forces().values()])
        return out.ravel()

    def _begun(self, names: Sequence[str]) -> list[tuple[str, str]]:
        """Lines that would not touch if they were a little thinner, or would if they were a little thicker."""
        thick, thin = (self._touching(1.0 + part) for part in (BEGUN, -BEGUN))
        self._touching(1.0)
        return [(names[a], names[b]) for a, b in sorted(thick - thin)]

    def _touching(self, wider: float) -> set[tuple[int, int]]:
        strands = [_strand(x) for x in self._here]
        self._shared.put([x._replace(width=wider * x.width) for x in strands])
        self._solver.contacts_at(self._states)
        self._shared.put(strands)
        return {(min(a, b), max(a, b)) for (a, _), (b, _) in self._shared.points_between()}


def _strand(x: Beside) -> TouchingLine:
    """What contact takes of a line, whose tension scale is that of its scene."""
    strand = strand_in(x.model)
    if strand.bending.all():
        return strand
    sections, fastest = merged_sections(x.scene.cable.sections), float(np.linalg.norm(x.sea.current, axis=1).max())
    scale = tension_scale(x.scene, sections, bool(x.model.line.spin.any()), fastest)
    return strand._replace(tension_scale=scale)


def _refused(given: str, expected: str) -> SceneError:
    return SceneError([Complaint("lines", given, f"an equilibrium in which {expected}", "a shape that is apart")])


# Tables of a scene on which every line hangs; numbers of a free body on which none does.
OF_ALL = ("environment", "obstacles", "output")
OF_BODIES = (*OF_ALL, "points", "bodies")
OF_CONTACT = ("self_contact", "energy/self_contact")  # results that contact of lines knows, and none of them alone
OF_BODY = {"mass", "centre", "inertia", "added_mass", "damping", "volume", "centre_of_buoyancy"}
OF_BODY |= {"hydrostatics", "members", "force", "moment"}


# Places of nodes (`Resolution.places`) by line; empty: as the scene asks for.
Places = Mapping[str, tuple[float, ...]]
NO_PLACES: Places = MappingProxyType({})


class _Changed(NamedTuple):
    """A scene with another number: its lines, arms (L, 2, 3) m of their ends at bodies, what acts on these (B, 6)."""

    lines: list[Beside]
    arms: Floats
    own: Floats


class NetworkAtRest:
    """The equilibrium on one mesh, its factors, and the values of results."""

    def __init__(self, scene: Scene, resolution: NetworkResolution, run: Run, wanted: Sequence[Wanted]) -> None:
        """run: the equilibrium on cells of resolution; wanted: results, of lines as the scene names them."""
        assert run.found is not None
        self.scene, self._model, self._names = scene, run.model, run.model.names
        self._scenes = {name: self._scene_of(scene, name) for name in self._names}
        of_lines = zip(self._names, run.model.models, strict=True)
        self.places = {name: places_of(model, self._scenes[name]) for name, model in of_lines}
        placed = {k: replace(x, places=self.places[k], parts=1) for k, x in resolution.lines.items()}
        self._resolution = replace(resolution, lines=placed)
        found = run.found.solver
        joined = [x._replace(line=model.line) for x, model in zip(found.lines, run.model.models, strict=True)]
        solver = NetworkSolver(joined, len(found.net), found.bodies)
        self._free = [[k for k in (0, 1) if x.joints[k] >= 0] for x in solver.lines]
        called = dict(zip(scene.asked_lines, self._names, strict=True))
        own = [[k for k, x in enumerate(wanted) if called[x.line] == name] for name in self._names]
        self._order = [k for of_line in own for k in of_line]
        self._bodies = BodiesAtRest(solver, run.state, run.model)
        self._solver, self._states = solver, run.state
        self.lines = []
        for l, name in enumerate(self._names):
            asked, frames = [wanted[k] for k in own[l]], self._bodies.frames(l, solver.lines[l].seats)
            what = self._scenes[name], run.model.models[l], run.state.lines[l]
            self.lines.append(LineAtRest(*what, asked, self._free[l], frames))
        self.contact = self._contact(run.found, run.state, wanted)
        self._here = self._arms(run.model), self._loads(run.model, [x.here for x in self.lines])
        self.values = self._in_order([x.values() if x.wanted else np.zeros(0) for x in self.lines])

    @property
    def shapes(self) -> dict[str, Floats]:
        """Places (N+1, 3) of the nodes of every line, m."""
        return {name: line.state.r.copy() for name, line in zip(self.scene.asked_lines, self.lines, strict=True)}

    def number(self, key: str) -> float:
        """The value of a key of the scene."""
        return number_of(self.scene, key)

    @cached_property
    def _network(self) -> LinearNetwork:
        return linear_network(self._solver, self._states, self._names, sticks=False, quick=False)

    @cached_property
    def _matrix(self) -> sparse.csc_array:
        """Of all unknowns, with what contact and bodies add to that of the lines."""
        A = sparse.csc_array(self._network.stiffness + self._network.skew)
        if self.contact is not None:
            A = A + self._of_unknowns(self.contact.stiffness)
        return A + self._bodies.stiffness_besides(A) if self._bodies.count else A

    @cached_property
    def _factors(self) -> Factors:
        return Factors(self._matrix)

    @property
    def _first_body(self) -> int:
        """The first of the unknowns that are of bodies."""
        return self._network.size - 6 * self._bodies.count

    def _loads(self, model: NetworkModel, lines: Sequence[Beside]) -> Floats:
        """(B, 6) N, N m, on bodies but for the forces of their lines; ValueError: the model has other members."""
        return self._bodies.loads_besides_lines(model) + self._bodies.pressed(lines)

    def _contact(self, found: LinesAtRest, states: NetworkState, of: Sequence[Wanted]) -> ContactAtRest | None:
        """Contact of lines with each other, if they have any, in states at rest.  SceneError: a result is of it."""
        if found.solver.shared is None and not found.settled:
            return None
        contact = ContactAtRest(found.solver, states, self._names, [x.here for x in self.lines])
        if not contact.stiffness.nnz and not contact.begins:
            return None
        if names := [x.name for x in of if x.name in OF_CONTACT]:
            expected = "a result of lines that do not touch each other in the equilibrium"
            raise SceneError([Complaint("of", names[0], expected, "tension, position, curvature")])
        return contact

    def _of_unknowns(self, of_nodes: sparse.csr_array) -> sparse.csc_array:
        """A matrix of all lines as one of the unknowns."""
        return sparse.csc_array(self._network.place.T @ of_nodes @ self._network.place)

    def off_by_contact(self, keys: Sequence[str], found: Floats) -> Floats:
        """(P, W) by how much derivatives `found` may be off by the spacing of the sample points of contact."""
        if self.contact is None:
            return np.zeros_like(found)
        finer = self.contact.finer()
        if finer is None:
            return np.abs(found)
        kept = self._factors
        self._factors = Factors(self._matrix + self._of_unknowns(finer[0] - self.contact.stiffness))
        try:
            return np.asarray(finer[1] * np.abs(self.by(keys) - found))
        finally:
            self._factors = kept

    def by(self, keys: Sequence[str]) -> Floats:
        """(P, W) derivatives of all results by numbers."""
        if not keys:
            return np.zeros((0, self.values.size))
        numbers = np.array([self.number(key) for key in keys])
        steps = np.array([step_at_rest(self.scene, *x) for x in zip(keys, numbers.tolist(), strict=True)])
        network, rights, shifts, reports = self._network, [], [], []
        every = [x for row in zip(keys, numbers.tolist(), steps.tolist(), strict=True) for x in self._beside(*row)]
        on_bodies = _slope([x.own for x in every], steps)
        pushes = [] if self.contact is None else [self.contact.forces(x.lines) for x in every]
        for l, line in enumerate(self.lines):
            both = [x.lines[l] for x in every]
            left, report = zip(*(line.left(x) for x in both), strict=True)
            shift = self._shift(l, every, steps)
            rights.append(_slope(left, steps) - network.lines[l].stiffness @ shift.reshape(-1, len(keys)))
            for k in (0, 1):
                if (b := self._bodies.body_at(l, k)) >= 0:
                    on_bodies[b, 3:] += np.cross(shift[-k, 1:4], network.lines[l].net[k], axisa=0, axisc=0)
                    if k in self._bodies.turns(l):
                        on_bodies[b, 3:] += _slope([moment_on_body(x, k) for x in report], steps)
                        on_bodies[b, 3:] -= network.lines[l].turned[k] @ shift.reshape(-1, len(keys))
            shifts.append(shift.reshape(-1, len(keys)))
            reports.append([*zip(both, report, strict=True)])
        left_over = np.concatenate(rights)
        if self.contact is not None:
            left_over += _slope(pushes, steps)
        touching, shifted = network.touching.stiffness, np.concatenate(shifts)
        left_over -= touching[: len(shifted), : len(shifted)] @ shifted
        on_bodies.reshape(-1, len(keys))[:] -= touching[len(shifted) :, : len(shifted)] @ shifted
        right = np.asarray(network.place.T @ left_over)
        right[self._first_body :] += on_bodies.reshape(-1, len(keys))
        every_line, blank = zip(self.forward(right, shifts), self.lines, reports, strict=True), np.zeros((len(keys), 0))
        return self._in_order([x + line.by_scene(y, steps) if line.wanted else blank for x, line, y in every_line])

    def forward(self, right: Floats, shifts: Sequence[Floats]) -> list[Floats]:
        """(P, W) of every line by a solve for each number.

        right: (free, P); shifts: (5 (N+1), P) of every line where it is held.
        """
        network, count, out = self._network, right.shape[1], []
        free = self._factors.solve(right)
        q, turned = np.asarray(network.place @ free), free[self._first_body :].reshape(-1, 6, count)[:, 3:]
        for l, (line, shift) in enumerate(zip(self.lines, shifts, strict=True)):
            moved = (q[network.at[l] : network.at[l + 1]] + shift).T.copy().reshape(count, -1, SIZE)
            out.append(line.by_state(moved, self._turns(l, turned)) if line.wanted else np.zeros((count, 0)))
        return out

    def _shift(self, l: int, every: Sequence[_Changed], steps: Floats) -> Floats:
        """(N+1, 5, P) what a line is shifted by with numbers where it is held, and where its place on a body changes.

        every: with more and with less of each number, in turn.
        """
        line, shift = self.lines[l], np.zeros((self._network.lines[l].free.size // SIZE, SIZE, len(steps)))
        for k in (0, 1):
            if self._bodies.body_at(l, k) >= 0:
                shift[-k, 1:4] = _slope([x.arms[l, k] for x in every], steps)
            elif k not in self._free[l] and line.here.ends.held[k]:
                shift[-k, 1:4] = _slope([x.lines[l].ends.position[k] for x in every], steps)
        return shift

    def _turns(self, l: int, turned: Floats) -> Floats | None:
        """(P, 2, 3) rad, turns of the ends of a line, of those (B, 3, P) of bodies; None: no end turns with one."""
        ends = self._bodies.turns(l)
        if not ends:
            return None
        out = np.zeros((turned.shape[2], 2, 3))
        for k in ends:
            out[:, k] = turned[self._bodies.body_at(l, k)].T
        return out

    def _arms(self, model: NetworkModel) -> Floats:
        """(L, 2, 3) m from the origins of bodies to the ends of lines on them."""
        return np.stack([self._bodies.arms(l, x) for l, x in enumerate(model.fairleads)])

    def _in_order(self, of_lines: Sequence[Floats]) -> Floats:
        """(.., W) results in the order in which they are wanted, of those of each line."""
        every = np.concatenate(of_lines, axis=-1)
        out = np.empty_like(every)
        for place, k in enumerate(self._order):
            out[..., k] = every[..., place]
        return out

    def _scene_of(self, network: Network, name: str) -> LineScene:
        """A line with the free points that it carries, and others where they are first, and its named quantities."""
        scene = network.scene_of(name, network.carried(name), network.guesses)
        own = {key: q for key, q in network.output.quantities.items() if q.line in (name, None) and q.other is None}
        if not own:
            return scene
        alone = {key: q.model_copy(update={"line": None}) for key, q in own.items()}
        return replace(scene, output=scene.output.model_copy(update={"quantities": alone}))

    def _key_in(self, key: str) -> str:
        """The key of the network that a key of the scene is."""
        pairs = [(dotted(there), dotted(here)) for there, here in self.scene.form.pairs]
        for there, here in sorted(pairs, key=lambda x: -len(x[1])):
            if re.match(rf"{re.escape(here)}\b", key):
                with suppress(SceneError):
                    number_in(self.scene, there + key.removeprefix(here))
                    return there + key.removeprefix(here)
        return key

    def _beside(self, key: str, number: float, step: float) -> tuple[_Changed, _Changed]:
        """The scene with a number that is more by a step, and less."""
        found = list[_Changed]()
        there = self._key_in(key)
        for d in (step, -step):
            try:
                if number == 0.0:  # what it switches on
                    refuse_use(with_number(self.scene, key, d).written, "derivatives", given=key)
                scene = with_number(self.scene, there, number + d)
                changed = self._changed(scene, key)
            except ValueError:
                raise at_a_bound(key, number) from None
            both = zip(self._names, changed.lines, self.lines, strict=True)
            others = [name for name, x, line in both if not same_places(x.model, line.model)]
            if not found and any(contradictions_of(scene, name) for name in others):
                fix = "a number that others do not have to match, as lengths of zones have to"
                raise SceneError([Complaint("by", key, "a number that may change by itself", fix)])
            found.append(changed)
        return found[0], found[1]

    def _hangs_on(self, network: Network, name: str) -> bool:
        """Whether a line hangs on what a changed scene has changed."""
        if any(getattr(network, x) is not getattr(self.scene, x) for x in OF_ALL):
            return True
        line = network.lines[name]
        if line is not self.scene.lines[name]:
            return True
        changed = {body for body, x in network.bodies.items() if _moves_lines(x, self.scene.bodies[body])}
        if any(getattr(network.bodies[x], "shape", None) is not None for x in changed):
            return True  # it is a surface for all lines
        for point in (line.start, line.end):
            at = network.points[point]
            if at is not self.scene.points[point] or (isinstance(at, Fairlead) and at.body in changed):
                return True
        return False

    def _changed(self, network: Network, key: str) -> _Changed:
        """A changed scene.  How a clamped line is seated may hang on first shapes: then such lines are built anew."""
        anew = [self._hangs_on(network, name) for name in self._names]
        built = None
        if self._bodies.count and any(getattr(network, x) is not getattr(self.scene, x) for x in OF_BODIES):
            built = with_bodies(self._model, network)
        bodies = (self._model if built is None else built).bodies
        clamped = [x for l, (x, new) in enumerate(zip(self._names, anew, strict=True)) if new and self._bodies.turns(l)]
        by_shape = not all(seats_know_no_shape(network, x) for x in clamped)
        shaped = shaped_anew(network, clamped, bodies, self._resolution) if by_shape else {}
        out = []
        for l, (name, line) in enumerate(zip(self._names, self.lines, strict=True)):
            if not anew[l]:
                out.append(line.here)
                continue
            scene, first = self._scene_of(network, name), self._scenes[name]
            seats: Floats | None = None
            if not self._bodies.turns(l):
                model = nearby(line.model, first, scene, self._resolution.lines[name], LEFT_OUT)
            elif by_shape:
                model, seats = shaped[name]
                model = model if same_nodes(model.line.s, line.model.line.s) else None
            else:
                clamped_anew = nearby_clamped(line.model, first, network, name, bodies, self._resolution, LEFT_OUT)
                model, seats = clamped_anew or (None, None)
            if model is None:
                raise _other_cells(key)
            out.append(line.beside(scene, model, NO_FRAMES if seats is None else self._bodies.frames(l, seats)))
        if network.surfaces:
            out = self._on_surfaces(network, out, (self._model if built is None else built).bodies)
        if built is None and all(x is line.here for x, line in zip(out, self.lines, strict=True)):
            return _Changed(out, *self._here)
        whole = self._model if built is None else built
        try:
            return _Changed(out, self._arms(whole), self._loads(whole, out))
        except ValueError:
            raise _other_cells(key) from None

    def _on_surfaces(self, network: Network, lines: Sequence[Beside], bodies: Sequence[BodyModel]) -> list[Beside]:
        """Lines of a changed scene on obstacles as hard as all of it asks for, with bodies that carry some at rest."""
        models = with_surfaces(network, [x.model for x in lines], bodies)
        out = [x._replace(model=model, sea=model.sea.at_time(np.inf)) for x, model in zip(lines, models, strict=True)]
        self._bodies.pressed(out)
        return [
            x if x is line.here and _as_hard(x, new) else new
            for x, new, line in zip(lines, out, self.lines, strict=True)
        ]


def at_rest(asked: Scene, of: Sequence[str], cells: float = 1.0, places: Places = NO_PLACES) -> NetworkAtRest:
    """The equilibrium of one cable or of several lines; of: results.

    cells: their lengths over the usual, 0.5 or more; places: those of an equilibrium whose cells it has.
    SceneError: what has no derivative; ComputationError: there is no equilibrium.
    """
    wanted = [parse_wanted(asked, x, moves=False) for x in of]
    scene, resolution = first_at_rest(asked.without_friction())
    refuse_use(scene.written, "derivatives", given="hybrid sensitivity")
    finely = {k: replace(x, places=places.get(k, ())).of_cells(cells) for k, x in resolution.lines.items()}
    resolution = replace(resolution, lines=finely)
    with scene.form.in_words():
        run = static_network(scene, None, lambda: scene_text(scene), resolution=resolution)
    return NetworkAtRest(scene, resolution, run, wanted)


def same_places(a: Model, b: Model) -> bool:
    """Whether nodes, sections and attachments of two models are at the same arc lengths."""
    pairs = (a.line.s, b.line.s), (a.cable.bounds, b.cable.bounds), (a.cable.at, b.cable.at)
    return all(np.array_equal(x, y) for x, y in pairs)


def _moves_lines(body: RigidBody, of: RigidBody) -> bool:
    """Whether lines at a body hang on what has changed of it."""
    if body is of:
        return False
    fields = type(of).model_fields
    return not isinstance(of, FreeBody) or any(
        getattr(body, x) is not getattr(of, x) for x in fields if x not in OF_BODY
    )


def _as_hard(x: Beside, y: Beside) -> bool:
    """Whether what two lines may touch is the same."""
    same = zip((x.sea.obstacles, x.sea.carried[:, :ROLLED]), (y.sea.obstacles, y.sea.carried[:, :ROLLED]), strict=True)
    return all(np.array_equal(a, b) for a, b in same)


def _other_cells(key: str) -> ComputationError:
    detail = f"{key}: a change of it changes the number of cells; give `mesh: {{cells: ..}}`"
    return ComputationError(Outcome.NOT_CONVERGED, None, None, detail)


def _slope(values: Sequence[Floats], steps: Floats) -> Floats:
    """(.., P) change by numbers of what has values (..) with more and with less of each, in turn."""
    return np.stack([x - y for x, y in zip(values[::2], values[1::2], strict=True)], axis=-1) / (2.0 * steps)
