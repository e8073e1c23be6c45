"""What a run writes down: quantities on the fixed output grid, evaluated only when an output is due.

Second order everywhere: positions by cubic Hermite interpolation of the nodes (one-sided
at joints and at point loads, where the tangent may kink), tensions and tangents from the middle of the
cells, moments and curvatures from the nodes, zone by zone.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from copy import copy
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from hybrid.kernels.energies import observe
from hybrid.kernels.forces import SEABED
from hybrid.kernels.report import CONTACT_FORCE, FORCE_A
from hybrid.kernels.seabed import stored
from hybrid.kernels.state import Ends, Floats, Line, Sea, State
from hybrid.model.bending_reference import LEFT
from hybrid.model.mesh import Zone
from hybrid.outputs.output_grid import Grid
from hybrid.outputs.touchdown import Touchdown, contact_pressure, touchdown
from hybrid.solve.bending_corrector import Shift
from hybrid.solve.stepper import POWERS
from hybrid.store.format import Field


def cross(a: Floats, b: Floats) -> Floats:
    """a x b of vectors (..., 3): numpy's own spends ten times as long on finding out that they are that."""
    out = np.empty(np.broadcast(a, b).shape)
    out[..., 0] = a[..., 1] * b[..., 2] - a[..., 2] * b[..., 1]
    out[..., 1] = a[..., 2] * b[..., 0] - a[..., 0] * b[..., 2]
    out[..., 2] = a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]
    return out


class View:
    """One state looked at: everything the probes share is computed once, and only if a probe needs it."""

    def __init__(
        self, line: Line, sea: Sea, zones: Sequence[Zone], ends: Ends, state: State, grid: Grid, report: Floats
    ) -> None:
        self.line, self.sea, self.zones, self.ends = line, sea, zones, ends
        self.computed, self.grid, self.report = state, grid, report
        self.state = state
        self.shift: Shift | None = None
        self._plain: View | None = None  # the view that this one corrects

    def corrected(self, shift: Shift) -> View:
        """The same state with position, tension, curvature and moment corrected; energies and contact stay."""
        other, state = copy(self), self.computed
        for name in ("d", "tension", "tangent", "moment", "torque", "curvature_twist", "shear"):
            other.__dict__.pop(name, None)
        other.shift, other._plain = shift, self
        other.state = state._replace(
            r=state.r + shift.position, v=state.v + shift.velocity, T=state.T + shift.tension,
            e=state.e + np.diff(shift.position, axis=0),
        )  # fmt: skip
        return other

    @cached_property
    def touchdown(self) -> Touchdown:
        return touchdown(self.line, self.sea, self.computed)

    @property
    def stored(self) -> float:
        return float(stored(self.line, self.sea, self.computed.r))

    @property
    def contact(self) -> Floats:
        return contact_pressure(self.line, self.sea, self.computed, self.grid.s)

    @cached_property
    def d(self) -> Floats:
        return np.asarray(self.state.e / np.linalg.norm(self.state.e, axis=1)[:, None])

    @cached_property
    def tension(self) -> Floats:
        """Tension on the grid: of the cells, and at the ends the pull of what holds them."""
        d = self.d
        ends = []
        for k, first, second in ((0, 0, 1), (1, -1, -2)):
            t = 1.5 * d[first] - 0.5 * d[second] if len(d) > 1 else d[first]
            if self.line.element[first] or (
                self.shift is not None and self.shift.clamped[k]
            ):  # a clamp or guide knows the tangent
                t = self.ends.frame[k].reshape(3, 3)[:, 2]
            force = self.reaction(k) if k else -self.reaction(k)
            at_end = self.line.s[first]
            if any(abs(x - at_end) < 1e-9 * self.line.s[-1] for x in self.grid.loads):
                ends.append(self._end_tension(k))
            else:
                ends.append(float(force @ t) / float(np.linalg.norm(t)))
        return np.asarray(self.grid.held @ np.concatenate([ends[:1], self.state.T, ends[1:]]))

    @cached_property
    def tangent(self) -> Floats:
        t = self.grid.cells @ self.d
        size = np.linalg.norm(t, axis=1)
        # in the very middle of a fold the two sides cancel: take the nearest cell's
        middles = 0.5 * (self.line.s[:-1] + self.line.s[1:])
        for g in np.flatnonzero(size < 1e-9):
            t[g] = self.d[int(np.argmin(np.abs(middles - self.grid.s[g])))]
            size[g] = 1.0
        return np.asarray(t / size[:, None])

    @cached_property
    def _observed(self) -> tuple[Floats, Floats, Floats]:
        if self._plain is not None:
            return self._plain._observed
        n, st = self.line.h.size, self.computed
        M, strain, energy = np.zeros((n + 1, 3)), np.zeros((n + 1, 3)), np.zeros(4)
        observe(self.line, self.ends, st.e, st.v, st.a1, st.w, M, strain, energy)
        return M, strain, energy

    @property
    def node_moment(self) -> Floats:
        """(N+1, 3) N m, inertial."""
        return self._observed[0] if self.shift is None else self._observed[0] + self.shift.moment

    @property
    def energy(self) -> Floats:
        """(4,) J: kinetic, bending, torsion, stretch."""
        return self._observed[2]

    @cached_property
    def moment(self) -> Floats:
        return np.asarray(self.grid.sides @ self.node_moment[self.grid.side_nodes])

    @cached_property
    def torque(self) -> Floats:
        return np.einsum("ij,ij->i", self.moment, self.tangent)

    @cached_property
    def _strains(self) -> Floats:
        """Curvature and twist (n sides, 2), 1/m."""
        if self._plain is not None:
            return self._plain._strains
        line, out = self.line, np.zeros((len(self.grid.side_nodes), 2))
        d = self.computed.e / np.linalg.norm(self.computed.e, axis=1)[:, None]
        cosine = np.einsum("ij,ij->i", d[:-1], d[1:])
        sine = np.linalg.norm(cross(d[:-1], d[1:]), axis=1)
        sharp = np.zeros(line.s.size)
        sharp[1:-1] = 2.0 * sine / (np.maximum(1.0 + cosine, 1e-12) * line.hn[1:-1])
        strain = self._observed[1]
        for zone, (a, b, o) in zip(self.grid.parts, self.grid.spans, strict=True):
            side = out[o : o + b - a + 1]
            if zone.kind == "rod":
                k = strain[a : b + 1] / line.hn[a : b + 1, None]
                side[:, 0], side[:, 1] = np.hypot(k[:, 0], k[:, 1]), k[:, 2]
                for node, row, cell in ((a, 0, a), (b, -1, b - 1)):
                    if not line.element[node]:  # a joint or an end without element: strain of the moment that is given
                        side[row] = self._strain_of_moment(node, cell)
            else:
                side[:, 0] = sharp[a : b + 1]
                for row, one, two, x, x1, x2 in (
                    (0, 1, 2, line.s[a], line.s[a + 1], line.s[min(a + 2, b)]),
                    (-1, -2, -3, line.s[b], line.s[b - 1], line.s[max(b - 2, a)]),
                ):
                    if b - a >= 4:
                        p = (x - x1) / (x2 - x1)
                        side[row, 0] = max(0.0, (1 - p) * side[one, 0] + p * side[two, 0])
                    elif b - a >= 2:
                        side[row, 0] = side[one, 0]
        return out

    def _strain_of_moment(self, node: int, cell: int) -> tuple[float, float]:
        """Curvature and twist at a rod's end that carries the given moment (zero at a joint)."""
        line = self.line
        inner = cell + 1 if cell == node else cell
        if not line.element[inner]:
            return 0.0, 0.0
        B = line.kb[inner] * line.hn[inner]
        k0 = line.k0[inner] / line.hn[inner]
        a1, d = self.state.a1[cell], self.d[cell]
        body = np.array(
            [a1 @ self.node_moment[node], cross(d, a1) @ self.node_moment[node], d @ self.node_moment[node]]
        )
        k = k0 + np.divide(body, B, out=np.zeros(3), where=B > 0)
        return float(np.hypot(k[0], k[1])), float(k[2])

    @cached_property
    def curvature_twist(self) -> Floats:
        strains = self._strains
        if self.shift is not None:
            strains = np.column_stack([self._curvature_of_moment(self.shift), strains[:, 1]])
        return np.asarray(self.grid.sides @ strains)

    def _curvature_of_moment(self, shift: Shift) -> Floats:
        """Curvature (n sides,) 1/m of all of the moment, with what was left out; without stiffness, as it is."""
        d, moment = self.computed.e / np.linalg.norm(self.computed.e, axis=1)[:, None], self.node_moment
        t = np.vstack([d[:1], d[1:] + d[:-1], d[-1:]])
        t /= np.maximum(np.linalg.norm(t, axis=1), 1e-12)[:, None]
        bending = np.linalg.norm(moment - np.einsum("ij,ij->i", moment, t)[:, None] * t, axis=1)
        side = self.grid.side_nodes
        EI = shift.stiffness[side]
        return np.divide(bending[side], EI, out=self._strains[:, 0].copy(), where=EI > 0.0)

    @cached_property
    def shear(self) -> Floats:
        Q = np.diff(self.node_moment, axis=0)
        V = cross(self.d, Q) / np.linalg.norm(self.state.e, axis=1)[:, None]
        if self.shift is None:
            V[self.line.spin == 0] = 0.0
        return np.asarray(np.linalg.norm(self.grid.cells @ V, axis=1))

    def bending_moment(self) -> Floats:
        return np.asarray(np.linalg.norm(self.moment - self.torque[:, None] * self.tangent, axis=1))

    def reaction(self, k: int) -> Floats:
        """Force of the support, or of an end body, on the cable at end k; else the force applied there."""
        if self.ends.held[k]:
            force = -self.report[FORCE_A + 3 * k : FORCE_A + 3 * k + 3]
            return force if self.shift is None else force - self.shift.resultants[k]
        first, out = (0, -1.0) if k == 0 else (-1, 1.0)
        if not any(abs(x - self.line.s[first]) < 1e-9 * self.line.s[-1] for x in self.grid.loads):
            return self.ends.force[k].copy()
        return np.asarray(out * self._end_tension(k) * self.d[first])

    def _end_tension(self, k: int) -> float:
        """Tension of the cable at end k, extrapolated from its last cells."""
        first, second = (0, 1) if k == 0 else (-1, -2)
        T, h = self.state.T, self.line.h
        return float(T[first] + (T[first] - T[second]) * h[first] / (h[first] + h[second]) if len(h) > 1 else T[0])


@dataclass(frozen=True)
class Probe:
    """A quantity that can be recorded: unit, description, dimensions, how to get it, and what it `needs`."""

    unit: str
    description: str
    dims: tuple[str, ...]
    value: Callable[[View], object]
    needs: str = ""
    frame: str = ""


_S, _SX, _X, _E, _EX = ("s",), ("s", "xyz"), ("xyz",), ("edge",), ("edge", "xyz")
MAY_BE_NAN = ("touchdown", "touchdown_position")  # of a line that touches nothing
PROBES: dict[str, Probe] = {
    "position": Probe("m", "position of the centreline", _SX, lambda v: v.grid.nodes @ v.state.r, frame="inertial"),
    "velocity": Probe("m/s", "velocity of the centreline", _SX, lambda v: v.grid.nodes @ v.state.v, frame="inertial"),
    "tension": Probe("N", "tension (effective tension in a fluid)", _S, lambda v: v.tension),
    "theta": Probe(
        "rad", "angle of the tangent to the z axis", _S, lambda v: np.arccos(np.clip(v.tangent[:, 2], -1, 1))
    ),
    "phi": Probe(
        "rad", "azimuth of the tangent from the x axis", _S, lambda v: np.arctan2(v.tangent[:, 1], v.tangent[:, 0])
    ),
    "curvature": Probe("1/m", "curvature of the centreline", _S, lambda v: v.curvature_twist[:, 0]),
    "twist": Probe("1/m", "twist of the material frame per length", _S, lambda v: v.curvature_twist[:, 1], "rod"),
    "bending_moment": Probe("N m", "magnitude of the bending moment", _S, lambda v: v.bending_moment(), "rod"),
    "torque": Probe("N m", "torque (moment about the tangent)", _S, lambda v: v.torque, "rod"),
    "shear": Probe("N", "magnitude of the shear force", _S, lambda v: v.shear, "rod"),
    "reaction_start": Probe("N", "force on the cable at its start", _X, lambda v: v.reaction(0), frame="inertial"),
    "reaction_end": Probe("N", "force on the cable at its end", _X, lambda v: v.reaction(1), frame="inertial"),
    "moment_start": Probe(
        "N m", "moment on the cable at its start", _X, lambda v: -v.node_moment[0], "rod", "inertial"
    ),
    "moment_end": Probe(
        "N m", "moment on the cable at its end", _X, lambda v: v.node_moment[-1].copy(), "rod", "inertial"
    ),
    "contact": Probe("N/m", "force of the seabed per length, along its normal", _S, lambda v: v.contact, "seabed"),
    "contact_force": Probe(
        "N", "force of the seabed along its normal", (), lambda v: v.report[CONTACT_FORCE], "seabed"
    ),
    "grounded_length": Probe("m", "length in contact with the seabed", (), lambda v: v.touchdown.grounded, "seabed"),
    "touchdown": Probe(
        "m", "arc lengths of the first and last point in contact; NaN: none", _E, lambda v: v.touchdown.edges, "seabed"
    ),
    "touchdown_position": Probe("m", "where they are", _EX, lambda v: v.touchdown.places, "seabed", frame="inertial"),
    "energy/kinetic": Probe("J", "kinetic energy, with rotary inertia", (), lambda v: v.energy[0]),
    "energy/potential": Probe(
        "J",
        "potential energy of weight and buoyancy, zero at z = 0",
        (),
        lambda v: -np.sum(v.line.force * v.computed.r),
    ),
    "energy/stretch": Probe("J", "energy of stretching", (), lambda v: v.energy[3]),
    "energy/bending": Probe("J", "energy of bending", (), lambda v: v.energy[1], "rod"),
    "energy/contact": Probe("J", "energy stored by the seabed under the cable", (), lambda v: v.stored, "seabed"),
    "energy/torsion": Probe("J", "energy of torsion", (), lambda v: v.energy[2], "rod"),
}

WORK = {
    "start": "work done on the cable at its start",
    "end": "work done on the cable at its end",
    "applied": "work of applied forces and moments",
    "drag": "work of drag",
    "mass_damping": "work of mass-proportional damping",
    "stiffness_damping": "work of stiffness-proportional damping",
    "added_mass": "work of the added mass",
    "waves": "work of the pressure of waves, and of buoyancy at the surface",
    "contact": "work of the damping of the seabed",
    "friction": "work of friction on the seabed",
    "zones": "energy that zones put in or take out when they change",
    "scheme": "energy change that no work accounts for: the time scheme's own (negative: dissipated)",
}


# Probes that a corrected catenary has as a rod has them.
CORRECTED = ("bending_moment", "moment_start", "moment_end", "shear")
# What leaving bending out makes of each quantity, by name: unit, description, dimensions.
MODEL_ERRORS = {
    "position": ("m", "distance", _S),
    "tension": ("N", "change of tension", _S),
    "curvature": ("1/m", "change of curvature", _S),
    "bending_moment": ("N m", "change of the bending moment", _S),
    "end_force_start": ("N", "change of the force that holds the start", ()),
    "end_force_end": ("N", "change of the force that holds the end", ()),
}


def model_errors(plain: View, corrected: View) -> dict[str, object]:
    """MODEL_ERRORS on the output grid: how far what is corrected for bending is from what is not."""
    out: dict[str, object] = {
        "position": np.linalg.norm(plain.grid.nodes @ (corrected.state.r - plain.state.r), axis=1),
        "tension": np.abs(corrected.tension - plain.tension),
        "curvature": np.abs(corrected.curvature_twist[:, 0] - plain.curvature_twist[:, 0]),
        "bending_moment": np.abs(corrected.bending_moment() - plain.bending_moment()),
    }
    for k, name in enumerate(("end_force_start", "end_force_end")):
        out[name] = float(np.linalg.norm(corrected.reaction(k) - plain.reaction(k)))
    return out


class Observer:
    """Fields and values for one run: what its line has, on its output grid."""

    def __init__(
        self,
        line: Line,
        sea: Sea,
        zones: Sequence[Zone],
        s: Floats,
        with_work: bool,
        loads: Sequence[float] = (),
        kinds: set[str] | None = None,
        criteria: Sequence[tuple[str, str]] = (),
        only: Sequence[str] | None = None,
        errors: bool = False,
        corrected: bool = False,
    ) -> None:
        """loads: arc lengths of point loads, m; kinds: of zones that there may be, None: those that there are.

        criteria: name and description of those that are written as well; `values` gets them; only: names of probes,
        None: all.
        errors: whether what leaving bending out makes of the results is written; corrected: whether they are corrected
        for it.  `values` gets the shift for both.
        """
        self.line, self.sea, self.zones, self.grid = line, sea, tuple(zones), Grid(line.s, zones, s, loads)
        self._loads = tuple(loads)
        has = (kinds or {zone.kind for zone in zones}) | ({"seabed"} if line.bits & SEABED else set())
        self._probes = {
            name: p
            for name, p in PROBES.items()
            if (not p.needs or p.needs in has or (corrected and name in CORRECTED)) and (only is None or name in only)
        }
        self._errors, self._corrected = errors, corrected
        self.first_energy: float | None = None  # J, at the first output
        self._with_work = with_work
        size = {"s": s.size, "xyz": 3, "edge": 2}
        fields = [
            Field(name, p.unit, p.description, tuple(size[x] for x in p.dims), p.dims, p.frame, name in MAY_BE_NAN)
            for name, p in self._probes.items()
        ]
        if with_work:
            fields += [Field(f"work/{name}", "J", text) for name, text in WORK.items()]
        self._criteria = [f"criteria/{name}" for name, _ in criteria]
        fields += [
            Field(name, "", f"largest since the last output: {text}", (s.size,), _S)
            for name, (_, text) in zip(self._criteria, criteria, strict=True)
        ]
        if errors:
            left = f", what correction leaves of it ({LEFT:g})" if corrected else ""
            fields += [
                Field(
                    f"errors/model/{name}",
                    unit,
                    f"{text} by bending that is left out{left}",
                    (s.size,) * len(dims),
                    dims,
                )
                for name, (unit, text, dims) in MODEL_ERRORS.items()
            ]
        self.fields = tuple(fields)

    def on(self, line: Line, sea: Sea, zones: Sequence[Zone]) -> Observer:
        """The same fields of a line whose zones have changed."""
        other = copy(self)
        other.line, other.sea, other.zones, other.grid = (
            line,
            sea,
            tuple(zones),
            Grid(line.s, zones, self.grid.s, self._loads),
        )
        return other

    @property
    def zone_rows(self) -> list[tuple[str, float, float]]:
        names = {"catenary": "corrected"} if self._corrected else {}
        return [(names.get(z.kind, z.kind), z.s_a, z.s_b) for z in self.zones]

    def values(
        self,
        ends: Ends,
        state: State,
        report: Floats,
        work: Floats,
        ratios: Callable[[Floats], Floats] | None = None,
        shift: Shift | None = None,
    ) -> dict[str, object]:
        """All fields at one moment; `work` J in the order of POWERS since the start; ratios: criteria at places, m;
        shift: what bending that is left out would change."""
        plain = View(self.line, self.sea, self.zones, ends, state, self.grid, report)
        corrected = plain.corrected(shift) if shift is not None else plain
        view = corrected if self._corrected else plain
        out = {name: p.value(view) for name, p in self._probes.items()}
        if self._errors:
            part = LEFT if self._corrected else 1.0
            found = model_errors(plain, corrected)
            out |= {f"errors/model/{name}": part * np.asarray(x) for name, x in found.items()}
        if self._criteria:
            assert ratios is not None
            out |= dict(zip(self._criteria, ratios(self.grid.s), strict=True))
        if self._with_work:
            energy = float(sum(out[name] for name in out if name.startswith("energy/")))  # type: ignore[misc]
            if self.first_energy is None:
                self.first_energy = energy
            out |= {f"work/{name}": float(x) for name, x in zip(POWERS, work, strict=True)}
            out["work/scheme"] = energy - self.first_energy - float(work.sum())
        return out


def output_points(points: int | Sequence[float], length: float) -> Floats:
    """Output grid (ns,), m: that many points from end to end, or the ones listed."""
    return np.linspace(0.0, length, points) if isinstance(points, int) else np.array(points, float)
