"""What the states of a batch of outputs mean, in one call: moments, strains, energies, bends of catenaries."""

from __future__ import annotations

import math
from collections.abc import Mapping
from types import MappingProxyType
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hybrid.kernels.algebra.rotations import cross, dot, get3
from hybrid.kernels.laws.bending_slip import EACH, FROM, KEPT, MOMENT, MOST, STIFF, STIFFENING, STIFFNESS
from hybrid.kernels.laws.cell import chord
from hybrid.kernels.machine.binding import Series
from hybrid.kernels.machine.compile import kernel
from hybrid.kernels.machine.references import reader
from hybrid.kernels.march.energies import Observed, observe
from hybrid.kernels.state.state import (
    ALONG_LINE,
    NO_TURN,
    NODES_OF_LINE,
    Batch,
    Ends,
    Floats,
    Line,
    blank_line,
    no_ends,
)

FOLDED = 1e-12  # 1 + cos(x) of cells that are as good as folded onto each other


class Output(NamedTuple):
    """One output, and what is found of it."""

    line: Line
    ends: Ends
    r: Floats  # (N+1, 3) m
    e: Floats  # (N, 3) m
    v: Floats  # (N+1, 3) m/s
    a1: Floats  # (N, 3)
    w: Floats  # (N,) 1/s
    T: Floats  # (N,) N
    turn: Floats  # (K, 3) as `State.turn`
    moment: Floats  # (N+1, 3) N m, as of kernels.march.energies
    strain: Floats  # (N+1, 3) rad
    energy: Floats  # (5,) J: kinetic, bending, torsion, stretch, potential (of weight and buoyancy)
    bend: Floats  # (N+1,) 1/m, from cell to cell, inside the line; empty: not asked for


def _blank() -> Output:
    nodes, cells = np.zeros((2, 3)), np.zeros((1, 3))
    return Output(
        blank_line(1),
        no_ends(),
        nodes,
        cells,
        nodes,
        cells,
        np.zeros(1),
        np.zeros(1),
        NO_TURN,
        nodes,
        nodes,
        np.zeros(5),
        np.zeros(2),
    )


_read, _series = reader(_blank()), Series(_blank())


@kernel
def observe_outputs(tables):
    """Find moment, strain, energy and bend of all outputs, (nb, size) tables of `Output`."""
    for k in range(tables.shape[0]):
        x = _read(tables[k])
        observe(x.line, x.ends, x.e, x.v, x.a1, x.w, x.T, x.turn, Observed(x.moment, x.strain, x.energy))
        high = 0.0
        for i in range(x.r.shape[0]):
            for j in range(3):
                high += x.line.force[i, j] * x.r[i, j]
        x.energy[4] = -high
        if x.bend.shape[0] > 0:
            before, _, _ = chord(get3(x.e, 0))
            for i in range(1, x.e.shape[0]):
                d, _, _ = chord(get3(x.e, i))
                c = cross(before, d)
                cosine = 1.0 + dot(before, d)
                half = math.sqrt(dot(c, c)) / cosine if cosine > FOLDED else math.sqrt(2.0 / FOLDED)  # tan(x/2)
                x.bend[i] = 2.0 * half / x.line.hn[i]
                before = d


def slipped(line: Line, batch: Batch) -> Floats:
    """`slip_now` (nb, N+1, 4 L) of outputs: their layers bear what they have, as stiff as their tension makes them."""
    n = batch.T.shape[1]
    out = np.full((batch.t.size, *line.slip_now.shape), np.inf)
    elastic = line.slip_law[:, MOMENT::EACH]
    out[:, :, MOST::EACH] = np.where(elastic < 0.0, elastic, np.inf)
    for k in range(KEPT):
        out[:, :, FROM + k :: EACH] = batch.layers[:, :, k::KEPT]
    T = np.maximum(0.5 * (batch.T[:, [0, *range(n)]] + batch.T[:, [*range(n), n - 1]]), 0.0)[:, :, None]
    out[:, :, STIFF::EACH] = line.slip_law[:, STIFFNESS::EACH] + line.slip_law[:, STIFFENING::EACH] * T
    return out


def observed(
    line: Line, batch: Batch, varied: Mapping[str, Floats] = MappingProxyType({})
) -> tuple[Floats, Floats, Floats, Floats]:
    """Moments and strains (nb, N+1, 3) as of kernels.march.energies, energies (nb, 5) J and bends (nb, N+1) 1/m of outputs.

    A line of catenary alone has no moment and no strain, (1, N+1, 3) of zeros; one of rod alone no bends, (nb, 0).
    varied: arrays (nb, ...) of the line by name, where it is another one in every output.
    A bend is 2 tan(x/2) over the length of line around the node, x the angle from cell to cell; zero at the ends.
    """
    nb, n = batch.T.shape
    rods, catenary = bool(line.element.any() or line.spin.any()), not line.spin.all()
    moment, strain = (np.zeros((nb if rods else 1, n + 1, 3)) for _ in range(2))
    energy, bend = np.zeros((nb, 5)), np.zeros((nb, n + 1 if catenary else 0))
    own = {"moment": moment, "strain": strain} if rods else {}
    state = {"r": batch.r, "e": batch.e, "v": batch.v, "a1": batch.a1, "w": batch.w, "T": batch.T}
    if batch.turn.size:
        state["turn"] = batch.turn
    held = Ends(batch.held, batch.position, batch.frame, batch.spin, batch.force, batch.moment)
    of_line = {"line.h": batch.h, "line.kb": batch.kb} if batch.h.size else {}
    if line.slip_law.size:
        varied = {**varied, "slip_now": slipped(line, batch)}
    of_line |= {f"line.{name}": x for name, x in varied.items()}
    there = batch.line(0, line)._replace(**{name: x[0] for name, x in varied.items()})
    first = Output(
        there, Ends(*(x[0] for x in held)),
        **{"turn": NO_TURN} | {name: x[0] for name, x in state.items()}, moment=moment[0], strain=strain[0],
        energy=energy[0], bend=bend[0],
    )  # fmt: skip
    along = (
        state
        | own
        | of_line
        | {"energy": energy, "bend": bend}
        | {f"ends.{name}": x for name, x in held._asdict().items()}
    )
    observe_outputs(_series(first, nb, along))
    return moment, strain, energy, bend


def observed_joined(line: Line, batch: Batch, begin: NDArray[np.int64]) -> tuple[Floats, Floats, Floats, Floats]:
    """The same of nb outputs of other lines, one behind the other: moments, strains (M, 3), energies (nb, 5), bends (M,).

    begin: (nb+1,) nodes before each line; line, batch: arrays along all of them, in `batch` with one row; between two
    lines is a cell that belongs to none.  Without catenary there are no bends, (0,).
    """
    nodes, catenary = int(begin[1]), not line.spin.all()
    moment, strain = np.zeros((begin[-1], 3)), np.zeros((begin[-1], 3))
    energy, bend = np.zeros((begin.size - 1, 5)), np.zeros(begin[-1] if catenary else 0)
    on_nodes = {"r": batch.r[0], "v": batch.v[0], "moment": moment, "strain": strain} | (
        {"bend": bend} if catenary else {}
    )
    on_nodes |= {f"line.{name}": getattr(line, name) for name in NODES_OF_LINE}
    on_cells = {name: getattr(batch, name)[0] for name in ("e", "a1", "w", "T")}
    on_cells |= {f"line.{name}": getattr(line, name) for name in ALONG_LINE if name not in NODES_OF_LINE}
    cut = {name: x[:nodes] for name, x in on_nodes.items()} | {name: x[: nodes - 1] for name, x in on_cells.items()}
    held = Ends(batch.held, batch.position, batch.frame, batch.spin, batch.force, batch.moment)
    own = {name: x for name, x in cut.items() if "." not in name}
    first = Output(
        line._replace(**{name: cut[f"line.{name}"] for name in ALONG_LINE}),
        Ends(*(x[0] for x in held)),
        **{"turn": NO_TURN, "bend": bend} | own,
        energy=energy[0],
    )
    along = {"energy": energy} | {f"ends.{name}": x for name, x in held._asdict().items()}
    tables = _series(first, energy.shape[0], along)
    _series.shift(tables, on_nodes, begin[:-1], np.diff(begin))
    _series.shift(tables, on_cells, begin[:-1], np.diff(begin) - 1)
    observe_outputs(tables)
    return moment, strain, energy, bend
