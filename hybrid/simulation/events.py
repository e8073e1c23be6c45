"""Events of a run on their way to its file, and what is said where bending, tension or stretch make them.

Weight makes bends within less than a cell where a rod carries almost no tension:

    symbol   meaning                                                             unit
    EI       bending stiffness about the weaker axis                             N m2
    w        submerged weight                                                    N/m
    l        (EI/w)^(1/3), over which a cable without tension bends by weight    m

Where the tension is below EI/l^2, bending and weight alone form the line, over l.  A cell that is longer than l and
turns against the next shows no more than the mean of the bend: its curvature is too small, and the length of line that
bends too great.
"""

from __future__ import annotations

import os
import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from hybrid.errors import Outcome
from hybrid.kernels.laws.seabed import planes_under
from hybrid.kernels.state.state import Floats, Line, State
from hybrid.model.build import Model
from hybrid.model.initial_shape import dead_loads, end_laid_anywhere
from hybrid.model.material import LEAST_WEIGHT, Material
from hybrid.outputs.observation import Observation
from hybrid.scene.schema import LineScene
from hybrid.solve.stability import lies_slack


class Sink(Protocol):
    """What events are written to."""

    @property
    def event(self) -> Callable[..., None]: ...


class EventLog:
    """Events in the order in which they happened, until they are written."""

    def __init__(self) -> None:
        self._waiting: list[tuple[tuple[float, float, float, str, str], dict[str, Any]]] = []

    def event(self, t: float, s_a: float, s_b: float, kind: str, text: str, **more: float | str) -> None:
        """Something happened at time t (s) on s_a <= s <= s_b (m); the rest: as of `Recorder.event`."""
        self._waiting.append(((t, s_a, s_b, kind, text), more))

    def waiting(self) -> list[tuple[float, float, float, str, str]]:
        """Those that wait: t (s), s_a, s_b (m), kind, text."""
        return [event for event, _ in self._waiting]

    def write_to(self, sink: Sink, words: Callable[[str], str]) -> None:
        """Write all that wait; words: what makes texts of the scene of those of its network."""
        for (*where, text), more in self._waiting:
            sink.event(*where, words(text), **more)
        self._waiting.clear()


def energy_gains_text(tries: int) -> str:
    """Text of the event of steps that were repeated because contact created energy in them."""
    return (
        f"{tries} tries of steps in contact of lines were repeated with half the length, because the time "
        f"scheme would have created energy in them; a shorter time.step needs fewer"
    )


# rad, from one cell to the next: less is the sag of a line that lies or hangs almost straight.
TURNS = 0.05
# Cells that show the bend, as a part of l; and l over a cell that no note of such a bend is about.
SHOWS, SPANS = 0.25, 1.25


def too_long_for_weight(cable: Material, line: Line) -> tuple[np.ndarray, Floats, Floats]:
    """Nodes (K,) between two cells of a rod of which one is longer than l; there l (K,) m and EI/l^2 (K,) N."""
    rod = (line.spin[:-1] == 1) & (line.spin[1:] == 1) & (line.element[1:-1] == 1)
    between = np.flatnonzero(rod & (line.h[:-1] > 0.0) & (line.h[1:] > 0.0))
    piece = cable.piece(0.5 * (line.s[:-1] + line.s[1:]))
    length = cable.bending_length(LEAST_WEIGHT * cable.mass)[piece]
    EI = cable.weakest_bending[piece]
    l = np.minimum(length[between], length[between + 1])
    longer = (np.maximum(line.h[between], line.h[between + 1]) > l) & (l > 0.0)
    between, l = between[longer], l[longer]
    return between + 1, l, np.minimum(EI[between], EI[between + 1]) / l**2


def turns_by_weight(line: Line, seen: Observation, nodes: np.ndarray, limits: Floats) -> Floats:
    """Turns (K, nb) rad at nodes (K,) beyond the natural bend, 0 where the tension exceeds limits (K,) N."""
    chord = np.linalg.norm(seen.d[nodes] - seen.d[nodes - 1], axis=1)  # 2 sin(x/2) of a turn by x
    turn = 2.0 * np.arcsin(0.5 * chord) - np.linalg.norm(line.k0[nodes, :2], axis=1)[:, None]
    slack = np.minimum(seen.T[nodes - 1], seen.T[nodes]) < limits[:, None]
    return np.where(slack, turn, 0.0)


def weight_text(l: float, s: float, h: float, turn: float, ask: str) -> str:
    """Text of the event at s (m) between cells of h (m) that turn by so much (rad)."""
    return (
        f"weight bends the slack cable within {l:.2g} m at s = {s:g} m, on a cell of {h:.2g} m "
        f"({np.degrees(turn):.0f} deg to the next): curvature and moment are wrong there; cells of {SHOWS * l:.2g} m "
        f"would do ({ask}, or `accuracy: {{curvature: 5%}}`)"
    )


def slack_text_of(model: Model, state: State) -> tuple[float, float, str] | None:
    """From where to where (m) a catenary lies slack on the bed, and what an event says of it; None: nowhere."""
    line, sea = model.line, model.sea.values
    cells = np.flatnonzero(lies_slack(line, sea, state))
    if not cells.size:
        return None
    half = 0.5 * float(np.abs(dead_loads(line)[cells[0] : cells[-1] + 2, 2]).max())
    text = (
        f"{float(line.h[cells].sum()):.4g} m of catenary lie slack on the seabed, which carry nothing, in one of many "
        f"shapes; forces at ends above it do not depend on that, but are known to {half:.3g} N, half the weight of the "
        f"cell that comes down: shorter cells, or `accuracy`, for less"
    )
    return float(line.s[cells[0]]), float(line.s[cells[-1] + 1]), text


def note_laid(scene: LineScene, model: Model, state: State, events: EventLog) -> None:
    """Say which way a free end lies on the bed where nothing in the scene does."""
    end = end_laid_anywhere(scene)
    free, held = (-1, 0) if end == "end" else (0, -1)
    if not end or not planes_under(model.sea.values, state.r[[free]])[1][0] > 0.0:
        return
    x, y = (state.r[free] - state.r[held])[:2]
    text = (
        f"the {end} lies free on the seabed at [{x:.4g}, {y:.4g}] m from the other one: nothing in the scene says "
        f"which way, and any other is as good; initial.direction chooses it"
    )
    events.event(0.0, 0.0, model.length, "laid one way", text)


def slack_remedy(model: Model, outcome: Outcome, s: float | None) -> str:
    """What to write where a catenary is slack at s, m, so that its bending carries it; empty: nothing is known."""
    if outcome != Outcome.SLACK or s is None or model.layout is not None:
        return ""
    cable, line = model.cable, model.line
    node = int(np.clip(np.searchsorted(line.s, s), 1, line.h.size))
    piece = cable.piece(np.array([s]))[0]
    if cable.weakest_bending[piece] > 0.0:
        return "`model: adaptive`, which makes a rod of it where it is slack"
    w, h = abs(float(cable.weight[piece])), float(line.h[node - 1])
    if not w:
        return ""
    least = float(f"{w * (SPANS * h) ** 3:.2g}")
    return (
        f"`model: adaptive`, and the bending_stiffness of the section; where none is known, {least:g} N m^2 makes its "
        f"slack bends as long as a cell of {h:.3g} m and changes forces by up to {w * SPANS * h:.2g} N; cells a tenth "
        f"as long take a thousandth of it, which changes them by up to a tenth"
    )


def kinks_at(joints: NDArray[np.int64], bends: Floats, lengths: Floats) -> Floats:
    """Angles (J, nb), rad, of joints beyond the larger bend on their sides.

    bends: (N+1, nb) 1/m at nodes, 2 tan(x/2) over lengths (N+1, 1 or nb) m for an angle x.
    """
    turn = 2.0 * np.arctan(0.5 * bends[joints] * lengths[joints])
    return np.asarray(turn - np.maximum(bends[joints - 1], bends[joints + 1]) * lengths[joints])


# Where energy is created.
FASTEST = "the fastest point is at this place"


def borne_strain(model: Model) -> Floats:
    """Strain (N,) that each cell bears; infinite where it does not stretch."""
    s = model.line.s
    return np.asarray(model.cable.max_strain[model.cable.piece(0.5 * (s[:-1] + s[1:]))])


def most_stretched(model: Model, state: State) -> int:
    """The cell that is stretched or compressed most, of what it bears."""
    return int(np.argmax(np.abs(np.linalg.norm(state.e, axis=1) / model.line.h - 1.0) / borne_strain(model)))


def stretch_text(model: Model, state: State) -> str:
    """How far the cable is stretched or compressed (a negative strain), and how far it may be."""
    cell = most_stretched(model, state)
    strain, borne = np.linalg.norm(state.e[cell]) / model.line.h[cell] - 1.0, borne_strain(model)[cell]
    text = f"a strain of {100.0 * strain:.3g} % under {state.T[cell]:.4g} N, where max_strain is {100.0 * borne:.3g} %"
    apart, length = float(np.linalg.norm(state.r[-1] - state.r[0])), float(model.line.h.sum())
    if strain < 0.0 or apart <= length:
        return text
    return f"{text}; its ends are {apart:.6g} m apart, and it is {length:.6g} m long: too short for where they are"


def write_snapshot(target: object, content: Mapping[str, Any]) -> Path | None:
    """Write arrays and texts by name; the file, or None when it cannot be written.

    target: the path of the result, beside which the snapshot is put; of anything else (a result in memory) it gets a
    name of its own in the folder for temporary files.  A link in its place is replaced, never followed.
    """
    try:
        if isinstance(target, Path):
            path = target.with_suffix(".snapshot.npz")
            path.unlink(missing_ok=True)
            file = path.open("xb")
        else:
            handle, name = tempfile.mkstemp(".snapshot.npz", "hybrid-")
            path, file = Path(name), os.fdopen(handle, "wb")
        with file:
            np.savez(file, **content)
    except OSError:
        return None
    return path
