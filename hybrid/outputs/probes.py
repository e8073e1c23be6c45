"""What a run writes down: quantities on the fixed output grid, of all outputs of a batch at once, with edge errors.

Edge errors are those of curvature in cells at touchdown, and at ends of the line on the seabed.
Every output is estimated by itself.  An end held at another height than the line lies at has the same layers.
There the load on the line jumps within a cell, and what answers it is as short as sqrt(EI/T), sqrt(T/k) or, of a stiff
line, (EI/k)^(1/4).  How far nodes and straight lines between them are off depends on where in its cell the edge lies,
so that runs on other cells, whose nodes lie otherwise beside it, may agree by chance.  The balance across the bed

    (T w')' - (EI w'')'' + q + P(-w, -dw/dt) = 0

is therefore solved anew over some cells about the edge, each cut into parts (kernels.watch.observed_outputs has the
symbols).  Loads q, weight, drag and inertia among them, are those that balance the nodes; beyond these cells the line
stays.  An end stays where it is, with its moment or, where it is clamped, its direction.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from copy import copy
from dataclasses import replace
from itertools import pairwise
from types import MappingProxyType
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hybrid.kernels.laws.axial_law import CREEP
from hybrid.kernels.laws.seabed import planes_under
from hybrid.kernels.march.link import CROSSINGS, LINK, TWIST, WRITHE, holds_twist
from hybrid.kernels.state.report import MAY_MEET, MAY_TOUCH, OBSTACLES, PLANAR, SEABED, SELF_CONTACT
from hybrid.kernels.state.state import Batch, Floats, Line, Sea, remembers
from hybrid.kernels.watch.observed_outputs import (
    SINKING,
    Bed,
    Cuts,
    LineEnd,
    Refined,
    Windows,
    put_largest,
    refine_windows,
)
from hybrid.kernels.watch.observed_outputs import WORK as SCRATCH
from hybrid.model.mesh import Zone
from hybrid.model.sections import SAME_PLACE, OutputPoints
from hybrid.outputs.observation import (
    JoinedGrid,
    JoinedObservation,
    Observation,
    Output,
    Probe,
    obstacle_fields,
    obstacle_force_fields,
    obstacle_force_values,
    obstacle_values,
)
from hybrid.outputs.observed_states import NO_HINGES, Grid, VaryingGrid
from hybrid.outputs.quantities import Quantities
from hybrid.solve.stepper import POWERS
from hybrid.store.format import Field
from hybrid.store.records import RIDES, THERE, node_bits

# --- errors of curvature at edges of contact ---------------------------------------------------

# What datasets of them begin with, and the quantities that they are of.
EDGE_ERRORS, MISSED = "errors/edges/", ("curvature", "bending_moment")

# Cells on either side of that with the edge, over which what it does fades; parts of each.
REACH, PARTS = 6, 6
# Parts of the cell at an end of the line, each so many times as long as that before it: layers begin at the end itself,
# and the cell may be long for them.
END_PARTS, LONGER = 24, 1.2
# An edge is looked at with another one where it has so many cells on either side in that window; in stretches of fewer
# cells it is not.
WITHIN, FEWEST = 4, 4
# Part of the largest tension that counts as the least: in compression catenaries have no shape, and parts of cells of a
# rod would buckle where cells that are long for it do not; of short ones bending alone decides.
TAUT = 1e-6
NO_END = LineEnd(np.zeros(0), np.zeros(0), np.zeros(0))


def edge_errors(view: Observation) -> dict[str, Floats]:
    """Errors (ns, nb) of curvature, 1/m, and bending moment, N m, at output points; none where nothing touches down."""
    out = np.zeros((len(MISSED), len(view.grid.points), view.columns))
    for (cells, k), found in _places(view).items():
        first, output = np.ascontiguousarray(np.transpose(found))
        _add(out, view, first, output, cells, k)
    return dict(zip(MISSED, out, strict=True))


def _add(
    out: Floats, view: Observation, first: NDArray[np.int64], output: NDArray[np.int64], cells: int, k: int
) -> None:
    """Of windows of so many cells; k: the end of the line, 0 or 1, that they reach to, else -1."""
    nodes = first[:, None] + np.arange(cells + 1)
    way, nodes = (-1.0, nodes[:, ::-1]) if k == 1 else (1.0, nodes)  # an end is always at first nodes
    coarse, end = _windows(view, nodes, output, way), None
    bends, cuts = curvature(coarse), cuts_of(cells, k >= 0)
    if k >= 0:
        coarse, end = _line_end(view, coarse, nodes, output, k)
        bends[:, 0] = end.k
    s, fine, settled = refined(coarse, bends, view.sea, end)
    missed = fine - _shown(coarse, bends, end, cuts)
    missed[~settled] = np.abs(bends).max(axis=1)[~settled, None]  # what they are is not known
    missed[:, -PARTS:] = 0.0  # the line was kept there
    if end is None:
        missed[:, :PARTS] = 0.0
    rows = {node: np.flatnonzero(view.grid.of_line_of(node))[[0, -1]] + [0, 1] for node in set(first.tolist())}
    both = np.stack([missed, missed * between(coarse.EI, cuts)])
    points = np.ascontiguousarray(way * view.grid.points)
    put_largest(s, both, points, np.array([rows[node] for node in first.tolist()]), output, out)


def _places(view: Observation) -> dict[tuple[int, int], list[tuple[int, int]]]:
    """First nodes and outputs of windows about all edges and at ends on the bed: within a zone, between loads.

    By how many cells they have and the end of the line that they reach to, -1 if none.
    """
    spans = np.array(view.grid.spans)
    touches, found = view.depth > 0.0, dict[tuple[int, int], list[tuple[int, int]]]()
    seen = np.zeros((2, view.columns, len(spans)), bool)
    for span, (begin, end) in enumerate(spans[:, :2].tolist()):
        cells = min(2 * REACH + 1, end - begin)
        for k, (node, beside, first) in enumerate(((begin, begin + 1, begin), (end, end - 1, end - cells))):
            if cells >= FEWEST and np.isin(node, view.end_nodes):
                on_bed = touches[node] | touches[beside]
                seen[k, :, span] = on_bed
                found.setdefault((cells, k), []).extend((first, j) for j in np.flatnonzero(on_bed).tolist())
    output, cell = np.nonzero((touches[1:] != touches[:-1]).T)
    span_of = np.searchsorted(spans[:, 0], cell, "right") - 1
    begin, end = spans[span_of, :2].T
    cells = np.minimum(2 * REACH + 1, end - begin)
    near = [seen[0, output, span_of] & (cell < begin + cells - WITHIN)]
    near += [seen[1, output, span_of] & (cell >= end - cells + WITHIN)]
    wanted = (cell < end) & (cells >= FEWEST) & ~near[0] & ~near[1]  # beyond the end: between two lines
    first, last = np.minimum(np.maximum(cell - REACH, begin), end - cells), (-1, -1, 0)
    for j, c, span, a, n in np.transpose([output, cell, span_of, first, cells])[wanted].tolist():
        if last[:2] != (j, span) or c >= last[2] + n - WITHIN:
            found.setdefault((n, -1), []).append((a, j))
            last = j, span, a
    return {key: x for key, x in found.items() if x}


def _of(x: Floats, at: NDArray[np.int64], output: NDArray[np.int64]) -> Floats:
    """Values (windows, ...) of an array (n, nb), or (n, 1) of one that all outputs share."""
    return np.asarray(x[at, output[:, None] if x.shape[1] > 1 else 0])


def _windows(view: Observation, nodes: NDArray[np.int64], output: NDArray[np.int64], way: float) -> Windows:
    """way: 1, or -1 where nodes go towards the start of the line."""
    every = slice(None)
    bends = view.stiffness(every)[:, :2].max(axis=1) * view.of_line("hn", every)
    bends = bends * (view.of_line("element", every) != 0)
    T, EI = _of(view.T, np.minimum(nodes[:, 1:], nodes[:, :-1]), output), _of(bends, nodes, output)
    least = TAUT * np.abs(T).max(axis=1)[:, None]
    s = way * _of(view.of_line("s", every), nodes, output)
    return Windows(
        s, -_of(view.depth, nodes, output), _of(view.bed[:, SINKING], nodes, output), np.maximum(T, least), EI
    )


def _line_end(
    view: Observation, x: Windows, nodes: NDArray[np.int64], output: NDArray[np.int64], k: int
) -> tuple[Windows, LineEnd]:
    """Windows that reach to end k of the line, with the stiffness there, and what holds it."""
    EI, first = x.EI.copy(), nodes[:, 0]
    EI[:, 0] = EI[:, 1]
    rod = EI[:, 0] > 0.0
    normal, _ = planes_under(view.sea, view.r[first, :, output])
    d = view.d[np.minimum(first, nodes[:, 1]), :, output]
    across = (normal * np.cross(view.node_moment[first, :, output], d)).sum(axis=1)
    bends = np.where(rod, across / np.where(rod, EI[:, 0], 1.0), _beyond(curvature(x), x.s))
    element, hn = (_of(view.of_line(name, slice(None)), nodes[:, :1], output)[:, 0] for name in ("element", "hn"))
    hinge = np.where(rod, 0.0, view.grid.hinges[k, 0])
    return x._replace(EI=EI), LineEnd(bends, np.where(rod & (element != 0), hn, np.inf), hinge)


def _beyond(k: Floats, s: Floats) -> Floats:
    """Values (windows,) at first nodes that the two beside them lead to."""
    return np.asarray(k[:, 1] - (k[:, 2] - k[:, 1]) * (s[:, 1] - s[:, 0]) / (s[:, 2] - s[:, 1]))


def _shown(x: Windows, k: Floats, end: LineEnd | None, cuts: Cuts) -> Floats:
    """Curvature across the bed at parts of cells, 1/m, as results have it."""
    found = between(k, cuts)
    if end is None:
        return found
    hinged = end.EI > 0.0
    slope = np.sqrt(x.T[:, 0] / np.where(hinged, end.EI, 1.0))[:, None]  # it fades to nothing at such an end
    fades = np.exp(-slope * (between(x.s, cuts) - x.s[:, :1]))
    return np.asarray(found - np.where(hinged, end.k, 0.0)[:, None] * fades)


def cuts_of(cells: int, end: bool) -> Cuts:
    """Each cell in PARTS; end: the first one in END_PARTS, the shortest at the end of the line."""
    cell, part = np.repeat(np.arange(cells), PARTS), np.tile(np.arange(PARTS) / PARTS, cells)
    if end:
        graded = np.expm1(np.arange(END_PARTS) * np.log(LONGER)) / np.expm1(END_PARTS * np.log(LONGER))
        cell, part = np.append(np.zeros(END_PARTS, np.int64), cell[PARTS:]), np.append(graded, part[PARTS:])
    return Cuts(np.append(cell, cells - 1), np.append(part, 1.0))


def curvature(x: Windows) -> Floats:
    """w'' at nodes; at the first and last that of the nodes beside them."""
    h = np.diff(x.s, axis=1)
    k = np.zeros_like(x.w)
    k[:, 1:-1] = np.diff(np.diff(x.w, axis=1) / h, axis=1) / (0.5 * (h[:, 1:] + h[:, :-1]))
    k[:, 0], k[:, -1] = k[:, 1], k[:, -2]
    return k


def between(x: Floats, cuts: Cuts) -> Floats:
    """Values at nodes, and on straight lines between them at the ends of parts of cells."""
    return np.asarray(x[:, cuts.cell] + (x[:, cuts.cell + 1] - x[:, cuts.cell]) * cuts.part)


def refined(x: Windows, k: Floats, sea: Sea, end: LineEnd | None = None) -> tuple[Floats, Floats, NDArray[np.bool_]]:
    """Nodes of parts of cells, m, their curvature, and of which windows (n,) it is known; k: `curvature` of cells.

    end: what first nodes are, if they are ends of the line.
    """
    cuts = cuts_of(x.w.shape[1] - 1, end is not None)
    size = len(k), cuts.cell.size
    out = Refined(np.zeros(size), np.zeros(size), np.zeros(len(k), bool))
    windows, ends = Windows(*map(np.ascontiguousarray, x)), LineEnd(*map(np.ascontiguousarray, end or NO_END))
    bed = Bed(float(sea.stiffness), float(sea.damping), float(sea.onset))
    refine_windows(windows, np.ascontiguousarray(k), ends, bed, cuts, np.zeros((SCRATCH, size[1])), out)
    return out


# What cells miss of the bending of a rod beside its ends, point loads and joints, where a layer is short for them.
#
# Moments go over to those of a hanging line within the layer fade = sqrt(EI/F), as exp(-s/fade).  On cells that are not
# much shorter results go straight from node to node, and at a clamp or a load the moment itself is too small; coarser
# cells show little of that, because their errors do not fall by any order yet.
#
#     symbol   meaning                                                        unit
#     F        force in the cell beside the end                               N
#     fade     sqrt(EI/F), the length over which bending fades                m
#     x        h/fade, length of the cell beside the end                      1
#     M        moments at the three nodes nearest to the end                  N m
#     B        part of M that fades, M = c + d s + B exp(-s/fade)             N m
#     root     by which a fading part falls from node to node on cells h      1

# Lengths of two cells over which bending fades at most: longer, it is a parabola over them but for round-off.
LONGEST = 1e3


def layer_errors(view: Observation, loads: Iterable[int]) -> dict[str, Floats]:
    """Errors (ns,) of curvature, 1/m, and bending moment, N m, of one output; loads: nodes of point loads.

    Only of the two cells beside an end, a joint or a load.
    """
    out, line = dict[str, Floats](), view.line
    if not view.node_moment.size:
        return out
    points, bends = view.grid.points[:, 0], line.element != 0
    moment, T = view.node_moment[..., 0], view.T[:, 0]
    for zone, (first, last, _) in zip(view.grid.parts, view.grid.spans, strict=True):
        if zone.kind != "rod":
            continue
        edges = [first, *(i for i in loads if first < i < last), last]
        for a, b in pairwise(edges):
            if b - a < 6:
                continue
            for node, step in ((a, 1), (b, -1)):
                nodes = node + step * np.arange(3)
                cell, EI = min(node, nodes[1]), line.kb[nodes[1], :2].max() * line.hn[nodes[1]]
                F = float(np.hypot(T[cell], np.linalg.norm(view.shear_of_cells[cell, :, 0])))
                if EI <= 0.0:
                    continue
                s = abs(line.s[nodes] - line.s[node])
                fade = np.sqrt(EI / max(F, EI / (LONGEST * s[2]) ** 2))
                at = step * (points - line.s[node])
                inside = np.flatnonzero((at >= 0.0) & (at < s[2]))
                turns = line.hn[node] / line.h[cell] if node in (0, line.h.size) else 0.5
                missed = layer_missed(s, moment[nodes], fade, at[inside], turns if bends[node] else 0.0)
                for name, scale in (("curvature", EI), ("bending_moment", 1.0)):
                    found = out.setdefault(name, np.zeros(points.size))
                    found[inside] = np.maximum(found[inside], missed / scale)
    return out


def layer_missed(s: Floats, M: Floats, fade: float, at: Floats, turns: float) -> Floats:
    """Distance (n,) N m of straight interpolation from a moment that fades with the distance from an end.

    s: (3,) m, nodes from the end on, 0 the first; M: (3, 3) N m; at: (n,) m; turns: cells that bend as much as what
    holds the direction at the end, as of `shown_at_clamp`, 0: the moment is given there.
    """
    e = np.exp(-s / fade)
    part = s[1] / s[2]
    bend = M[0] * (1.0 - part) + M[2] * part - M[1]  # above node 1 of the line through nodes 0 and 2
    B = bend / ((1.0 - part) + e[2] * part - e[1])
    straight = np.stack([np.interp(at, s, x) for x in M.T], axis=1)
    rest = M - B * e[:, None]  # c + d s
    true = rest[0] + (rest[2] - rest[0]) * (at / s[2])[:, None]
    true = true + B / (shown_at_clamp(s[1] / fade, turns) if turns else 1.0) * np.exp(-at / fade)[:, None]
    return np.linalg.norm(true - straight, axis=1)


def shown_at_clamp(x: float, turns: float = 0.5) -> float:
    """Part of the moment at a clamp under tension that cells of x fades show; 1 on short ones.

    turns: cells that bend as much as the half cell at the clamp and an angular spring there.
    Of the balance of moments of cells of equal length: F h phi_j = M_j+1 - M_j, M_j = EI (phi_j - phi_j-1)/h, at the
    clamp M_0 = EI (phi_1 - alpha)/(turns h); exactly it is -EI alpha/(fade + (turns - 1/2) h).
    """
    root = 1.0 + 0.5 * x * x - x * np.sqrt(1.0 + 0.25 * x * x)
    left = 1.0 / (1.0 + turns * (x * x + 1.0 - root))  # phi_1/alpha
    return float((1.0 - left) / (turns * x) * (1.0 + (turns - 0.5) * x))


# --- what is written down ----------------------------------------------------------------------

_S, _SX, _X, _E, _EX = ("s",), ("s", "xyz"), ("xyz",), ("edge",), ("edge", "xyz")
# Of a line that touches nothing; where a section without torsional stiffness becomes catenary.
MAY_BE_NAN = ("touchdown", "touchdown_position", "turns/twist", "turns/link", "von_mises", "capacity_used", "code_used")
PROBES: dict[str, Probe] = {
    "position": Probe("m", "position of the centreline", _SX, lambda v: v.grid.nodes @ v.r, frame="inertial"),
    "velocity": Probe("m/s", "velocity of the centreline", _SX, lambda v: v.velocity, frame="inertial"),
    "tension": Probe("N", "tension (effective tension in a fluid)", _S, lambda v: v.tension),
    "theta": Probe("rad", "angle of the tangent to the z axis", _S, lambda v: v.theta),
    "phi": Probe("rad", "azimuth of the tangent from the x axis", _S, lambda v: v.phi),
    "curvature": Probe("1/m", "curvature of the centreline", _S, lambda v: v.curvature_twist[:, 0]),
    "twist": Probe("1/m", "twist of the material frame per length", _S, lambda v: v.curvature_twist[:, 1], "rod"),
    "bending_moment": Probe("N m", "magnitude of the bending moment", _S, lambda v: v.bending_moment, "rod"),
    "torque": Probe("N m", "torque (moment about the tangent)", _S, lambda v: v.torque, "rod torsion"),
    "shear": Probe("N", "magnitude of the shear force", _S, lambda v: v.shear, "rod"),
    "reaction_start": Probe("N", "force on the cable at its start", _X, lambda v: v.reaction(0), frame="inertial"),
    "reaction_end": Probe("N", "force on the cable at its end", _X, lambda v: v.reaction(1), frame="inertial"),
    "moment_start": Probe(
        "N m", "moment on the cable at its start", _X, lambda v: -v.end_moment(0), "rod torsion", "inertial"
    ),
    "moment_end": Probe(
        "N m", "moment on the cable at its end", _X, lambda v: v.end_moment(1), "rod torsion", "inertial"
    ),
    "contact": Probe("N/m", "force of the seabed per length, along its normal", _S, lambda v: v.contact, "seabed"),
    "self_contact": Probe(
        "N/m",
        "force per length where the line touches itself or another line, across both strands",
        _S,
        lambda v: v.self_contact,
        "self_contact",
    ),
    "contact_force": Probe("N", "force of the seabed along its normal", (), lambda v: v.contact_force, "seabed"),
    "grounded_length": Probe("m", "length in contact with the seabed", (), lambda v: v.touchdown.grounded, "seabed"),
    "touchdown": Probe(
        "m", "arc lengths of the first and last point in contact; NaN: none", _E, lambda v: v.touchdown.edges, "seabed"
    ),
    "touchdown_position": Probe("m", "where they are", _EX, lambda v: v.touchdown.places, "seabed", frame="inertial"),
    "turns/twist": Probe("", "twist of the material frame from end to end, turns", (), lambda v: v.link[TWIST], "link"),
    "turns/writhe": Probe("", "writhe of the centreline, closed beyond its ends", (), lambda v: v.link[WRITHE], "link"),
    "turns/link": Probe("", "twist and writhe: turns between the ends", (), lambda v: v.link[LINK], "link"),
    "turns/crossings": Probe(
        "", "signed crossings as seen from the side: right-handed loops", (), lambda v: v.link[CROSSINGS], "link"
    ),
    "payout/length": Probe("m", "unstretched length that is out", (), lambda v: v.payout[0], "payout"),
    "payout/rate": Probe("m/s", "rate of that; negative: line is taken in", (), lambda v: v.payout[1], "payout"),
    "payout/power": Probe(
        "W",
        "power of the winch on the line, tension times rate; negative: it brakes",
        (),
        lambda v: v.payout[2],
        "payout",
    ),
    "energy/kinetic": Probe("J", "kinetic energy, with rotary inertia", (), lambda v: v.energies["kinetic"]),
    "energy/potential": Probe(
        "J", "potential energy of weight and buoyancy, zero at z = 0", (), lambda v: v.energies["potential"]
    ),
    "energy/stretch": Probe("J", "energy of stretching", (), lambda v: v.energies["stretch"]),
    "energy/bending": Probe("J", "energy of bending", (), lambda v: v.energies["bending"], "rod"),
    "energy/contact": Probe(
        "J", "energy stored by the seabed and by obstacles", (), lambda v: v.energies["contact"], "seabed obstacles"
    ),
    "energy/self_contact": Probe(
        "J", "energy of contact of the line with itself", (), lambda v: v.energies["self_contact"], "self_contact"
    ),
    "energy/torsion": Probe("J", "energy of torsion", (), lambda v: v.energies["torsion"], "rod torsion"),
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
    "contact": "work of the damping of the seabed and of obstacles, and all of soil that remembers",
    "friction": "work of friction on the seabed, on obstacles, of the line on itself; work of lines that touch it",
    "zones": "energy that zones, and cells at a winch, put in or take out when they change, and of torque where a "
    "catenary bends without it",
    "obstacles": "work done on the cable by obstacles as they move; of what rubs on a surface that turns, too",
    "hysteresis": "work of what layers lose that slip as the line bends (bending_slip), of ropes whose stretch "
    "depends on their highest tension (syrope) or grows with time (creep), of stiffness that tension changes",
    "scheme": "energy change that no work accounts for: the time scheme's own (negative: dissipated)",
}


def works_of(line: Line) -> list[str]:
    """Names in WORK of what a line can have."""
    loses = remembers(line) or line.slip_law.size or line.law[:, CREEP].any()
    absent = {"obstacles": not line.moved.size, "hysteresis": not loses}
    return [name for name in WORK if not absent.get(name)]


# Quantities that may have two values at a point: what a point load, a joint or a change of section makes of them; of
# the first ones errors are known on both sides: of the right one under right_<name>.
SIDED_ERRORS = ("tension", "curvature", "bending_moment")
SIDED = {*SIDED_ERRORS, "theta", "phi", "twist", "torque", "shear", "wall_tension", "von_mises"}
SIDED |= {"capacity_used", "code_used"}


def elevation_field(places: Floats) -> Field:
    """What is recorded of the surface at places (n, 2) m."""
    return Field("elevation", "m", "elevation of the sea above still water", (len(places),), ("gauge",))


def elevation(sea: Sea, places: Floats, now: Floats) -> Floats:
    """Elevation (nb, n) m of the surface above still water at places (n, 2); now: (nb, 4) `Sea.now`."""
    A, w, kx, ky, phase, _ = sea.waves.T
    angle = places[:, :1] * kx + places[:, 1:] * ky + phase
    turned = w * now[:, :1]
    return np.asarray(now[:, 2:3] * (np.cos(turned) @ (A * np.cos(angle)).T + np.sin(turned) @ (A * np.sin(angle)).T))


class Recorded(NamedTuple):
    """What of a line is recorded.

    work: whether works are; only: names of probes, None: all; criteria: name and description of those that are written
    as well, which `values_of` gets; edges: whether what cells miss beside edges of contact is written;
    gauges: places (x, y), m, where the elevation of the sea is; quantities: what the scene asks
    for beside the usual.
    """

    work: bool
    only: Sequence[str] | None = None
    criteria: Sequence[tuple[str, str]] = ()
    edges: bool = False
    gauges: Sequence[tuple[float, float]] = ()
    quantities: Quantities | None = None


class Features(NamedTuple):
    """What a line has along it, or may have in the course of a run.

    loads: arc lengths of point loads, m; changes: those where one section ends and the next begins; hinges: (2 + K, 3)
    as of `Material`; kinds: of zones that there may be, None: those that there are.
    finest: m, all possible nodes, but for those that ride with a winch; None: outputs do not name their nodes.
    rides: how many do at the end, negative: at the start; payout: the same of a line in motion; obstacles: their names.
    """

    loads: Sequence[float] = ()
    changes: Sequence[float] = ()
    hinges: Floats = NO_HINGES
    kinds: set[str] | None = None
    finest: Floats | None = None
    rides: int = 0
    payout: int = 0
    obstacles: Sequence[str] = ()


def _parts_of(line: Line, zones: Sequence[Zone], features: Features, recorded: Recorded) -> set[str]:
    """What a line has, or may have, that probes need."""
    out = {"torsion"} if line.torsion.size and not line.bits & PLANAR else set()
    out |= (features.kinds or {zone.kind for zone in zones}) | ({"seabed"} if line.bits & SEABED else set())
    out |= {"link"} if holds_twist(line) and not line.bits & PLANAR else set()
    out |= {"payout"} if features.payout else set()
    out |= {"obstacles"} if line.bits & OBSTACLES else set()
    return out | ({"self_contact"} if line.bits & (SELF_CONTACT | (MAY_TOUCH | MAY_MEET) * recorded.work) else set())


def _probes_of(parts: set[str], recorded: Recorded) -> dict[str, Probe]:
    """Probes of what a line has and a run records, by name."""
    found = {
        name: p
        for name, p in PROBES.items()
        if (not p.needs or parts.intersection(p.needs.split())) and (recorded.only is None or name in recorded.only)
    }
    return found | (recorded.quantities.probes() if recorded.quantities is not None else {})


class Observer:
    """Fields and values for one run: what its line has, on its output grid."""

    def __init__(
        self,
        line: Line,
        sea: Sea,
        zones: Sequence[Zone],
        points: OutputPoints,
        features: Features,
        recorded: Recorded,
    ) -> None:
        s, jumps = points
        self._finest, self._rides = features.finest, features.rides
        self._hinges = features.hinges.copy()
        self._cuts, self._changes = tuple(sorted({*features.loads, *jumps})), tuple(features.changes)
        near = SAME_PLACE * line.s[-1]
        self._unloaded = tuple(x for x in jumps if all(abs(x - y) > near for y in features.loads))
        self.jumps = np.array(jumps, float)
        self._place(line, sea, zones, s)
        self._touched, self._paid = tuple(features.obstacles), features.payout
        self._obstacles = self._touched if line.moved.size else ()
        self._with_work, self.quantities = recorded.work, recorded.quantities
        self.first_energy: float | None = None  # J, at the first output
        self.gauges = np.array(recorded.gauges, float).reshape(-1, 2)
        self._probes = _probes_of(_parts_of(line, zones, features, recorded), recorded)
        self._edges = tuple(x for x in MISSED if recorded.edges and x in self._probes)
        self._criteria = [f"criteria/{name}" for name, _ in recorded.criteria]
        only = recorded.only
        right = [x for x in self._probes if x in SIDED and (only is None or f"right/{x}" in only)]
        self._right = right if self.jumps.size else []
        fields = self._fields_of_probes()
        fields += self._after_jumps(fields, {name: f"right/{name}" for name in self._right})
        fields += [Field(f"work/{x}", "J", WORK[x]) for x in works_of(line) if recorded.work]
        fields += [
            Field(name, "", f"largest since the last output: {text}", (s.size,), _S)
            for name, (_, text) in zip(self._criteria, recorded.criteria, strict=True)
        ]
        self.fields, self._left_out = (*fields, *self._fields_beside_the_line()), frozenset[str]()

    def leave_out(self, names: Collection[str]) -> None:
        """Leave out fields of these names, which a file does not have."""
        self.fields, self._left_out = tuple(f for f in self.fields if f.name not in names), frozenset(names)

    def _fields_of_probes(self) -> list[Field]:
        sizes = {"s": self.s.size, "xyz": 3, "edge": 2}
        may_be_nan = {*MAY_BE_NAN, *(self.quantities.wanted if self.quantities is not None else ())}
        return [
            Field(name, p.unit, p.description, tuple(sizes[x] for x in p.dims), p.dims, p.frame, name in may_be_nan)
            for name, p in self._probes.items()
        ]

    def _after_jumps(self, fields: Sequence[Field], names: Mapping[str, str]) -> list[Field]:
        """Values just after places where fields jump; names: of these, by that of the field."""
        found = [f for f in fields if f.name in names]
        words = [f"{f.description}, just after the point" for f in found]
        return [
            replace(f, name=names[f.name], shape=self.jumps.shape, dims=("right/s",), description=text)
            for f, text in zip(found, words, strict=True)
        ]

    def _fields_beside_the_line(self) -> list[Field]:
        """Errors beside edges of contact, waves at gauges, obstacles and their forces, and which nodes there are."""
        words = {x: f"error of {x.replace('_', ' ')} by cells beside edges of contact" for x in self._edges}
        fields = [Field(EDGE_ERRORS + x, PROBES[x].unit, words[x], (self.s.size,), _S) for x in self._edges]
        fields += [elevation_field(self.gauges)] if len(self.gauges) else []
        fields += obstacle_fields(self._obstacles) + obstacle_force_fields(self._touched)
        if self._finest is not None:
            text = "which of the nodes mesh/s there are: bit k % 64 of word k // 64"
            fields.append(Field(THERE, "", text, (-(-self._finest.size // 64),), ("word",), dtype="int64"))
            text = "arc lengths of nodes that ride with the winch"
            fields += [Field(RIDES, "m", text, (abs(self._rides),), ("rides",))] if self._rides else []
        return fields

    def on(self, line: Line, sea: Sea, zones: Sequence[Zone], hinges: Floats) -> Observer:
        """The same fields of a line whose zones, or ends, have changed; hinges: as of `Grid`."""
        other = copy(self)
        other._hinges = hinges.copy()
        other._place(line, sea, zones, self.s)
        return other

    def _place(self, line: Line, sea: Sea, zones: Sequence[Zone], s: Floats) -> None:
        self.line, self.sea, self.zones = line, sea, tuple(zones)
        self.s, jumps, (begin, end) = s, self.jumps, line.s[[0, -1]]
        # on the reel: the values of the fairlead
        if s[-1] > end * (1.0 + SAME_PLACE) or s[0] < begin - SAME_PLACE * end:
            s, jumps = np.clip(s, begin, end), np.clip(jumps, begin, end)
        self.grid = Grid(line.s, zones, s, self._cuts, self._changes, kept=self._unloaded, hinges=self._hinges)
        self._after = Grid(line.s, zones, jumps, self._cuts, self._changes, True, self._unloaded, self._hinges)

    def on_varied(
        self, line: Line, sea: Sea, zones: Sequence[Zone], nodes: Floats, points: Floats | None = None
    ) -> Observer:
        """The same fields of a line whose nodes (nb, N+1) m are elsewhere in every output; zones: of the first.

        points: (nb, ns) m, output points of each; None: those of this one.
        """
        other, ends = copy(self), (nodes[:, :1], nodes[:, -1:])
        other.line, other.sea, other.zones = line, sea, tuple(zones)
        at = self.s if points is None else points
        s, jumps = np.clip(at, *ends), np.clip(self.jumps, *ends)  # on the reel: the values of the fairlead
        other.grid = VaryingGrid(nodes, zones, s, self._cuts, self._changes, kept=self._unloaded, hinges=self._hinges)
        other._after = VaryingGrid(nodes, zones, jumps, self._cuts, self._changes, True, self._unloaded, self._hinges)
        return other

    @property
    def names(self) -> tuple[str, ...]:
        """Of all probes."""
        return tuple(self._probes)

    def of(self, names: Sequence[str]) -> Observer:
        """The same of these probes alone."""
        other = copy(self)
        other._probes = {name: self._probes[name] for name in self._probes if name in names}
        other._right, other._edges, other._finest = [], (), None
        other._obstacles = other._touched = ()
        other.gauges = np.zeros((0, 2))
        return other

    def dims(self, name: str) -> tuple[str, ...]:
        """Dimensions of a probe, before or after the points where it jumps."""
        probe = self._probes.get(name.removeprefix("right/").removeprefix(EDGE_ERRORS))
        return probe.dims if probe is not None else ()

    def joined_observation(self, outputs: Sequence[Output]) -> tuple[Observer, JoinedObservation]:
        """Outputs of which each has a line of its own, and what makes values of them; on a line of constant length."""
        within = [x.line.s[[0, -1]] for x in outputs]  # beyond, on the reel: the values of the fairlead
        s, jumps = ([np.clip(x, *ends) for ends in within] for x in (self.s, self.jumps))
        of = list(zip(outputs, s, jumps, strict=True))
        other, grid = copy(self), JoinedGrid(self._grids([(x, at) for x, at, _ in of], False))
        if self._right:
            other._after = JoinedGrid(self._grids([(x, at) for x, _, at in of], True))
        other.line, other.zones, other.grid = outputs[0].line, outputs[0].zones, grid
        return other, JoinedObservation(outputs, self.sea, grid, self._paid)

    def _grids(self, of: Sequence[tuple[Output, Floats]], after: bool) -> list[Grid]:
        """Grids of outputs with lines of their own, and their points (ns,) m; after: as of `Grid`."""
        found: list[Grid] = []
        for x, at in of:
            last = found[-1] if found else None
            if last is not None and last.suits(x.line.s, x.zones):
                found.append(last.moved(x.line.s, at))
            else:
                found.append(
                    Grid(x.line.s, x.zones, at, self._cuts, self._changes, after, self._unloaded, self._hinges)
                )
        return found

    def rows_of(self, zones: Sequence[Zone]) -> list[tuple[str, float, float]]:
        """Zones as they stand in the file."""
        return [(z.kind, z.s_a, z.s_b) for z in zones]

    @property
    def writes_criteria(self) -> bool:
        """Whether criteria are among the fields."""
        return bool(self._criteria)

    def observation(self, batch: Batch, varied: Mapping[str, Floats] = MappingProxyType({})) -> Observation:
        """Outputs as computed, for `values_of`; varied: arrays (nb, ...) of the line, where it is another in each."""
        return Observation(self.line, self.sea, self.grid, batch, varied, self._paid)

    def values_of(self, plain: Observation, ratios: Floats | None = None) -> dict[str, Floats]:
        """All fields of nb outputs, (nb, ...) in the units of the fields, as new arrays.

        plain: as of `look`; ratios: (nb, criteria, ns), if they are written: the largest since the output before.
        """
        batch = plain.batch
        found = {name: p.value(plain) for name, p in self._probes.items()}
        if self._right:
            right = plain.on(self._after)
            found |= {f"right/{name}": self._probes[name].value(right) for name in self._right}
        if self._edges:
            missed = edge_errors(plain)
            found |= {EDGE_ERRORS + name: missed[name] for name in self._edges}
        out = {name: plain.by_output(x, self.dims(name)) for name, x in found.items()}
        if self._criteria:
            if ratios is None:
                raise ValueError("criteria are written, but `ratios` is not given")
            out |= {name: ratios[:, k] for k, name in enumerate(self._criteria)}
        if len(self.gauges):
            out["elevation"] = elevation(self.sea, self.gauges, batch.sea_now)
        out |= obstacle_values(self._obstacles, batch.obstacles) | obstacle_force_values(self._touched, plain)
        if self._finest is not None:
            rides = self._rides
            stay, ride = (slice(-rides), slice(-rides, None)) if rides > 0 else (slice(-rides, None), slice(-rides))
            if isinstance(plain, JoinedObservation):
                each = [x.line.s for x in plain.outputs]
            else:
                each = [plain.line_of(k).s for k in range(batch.t.size if plain.varies else 1)]
            known = {THERE: [node_bits(self._finest, s[stay]) for s in each]}
            known |= {RIDES: [s[ride] for s in each]} if rides else {}
            out |= {name: np.tile(np.stack(x), (batch.t.size // len(each), 1)) for name, x in known.items()}
        if self._with_work:
            energy = sum((out[name] for name in out if name.startswith("energy/")), np.zeros(batch.t.size))
            if self.first_energy is None:
                self.first_energy = float(energy[0])
            out |= {
                f"work/{name}": batch.work[:, k].copy() for k, name in enumerate(POWERS) if name in works_of(self.line)
            }
            out["work/scheme"] = energy - self.first_energy - batch.work.sum(axis=1)
        return {name: x for name, x in out.items() if name not in self._left_out} if self._left_out else out
