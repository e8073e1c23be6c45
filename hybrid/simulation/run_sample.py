"""What is compared and checked of a run.

Compared is how finely it was computed, its outputs, and where these are.  Checked is, when it is complete, whether
outputs are too far apart for its end forces, and vibrations damped out.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from hybrid.kernels.state.state import Floats
from hybrid.model.build import Model
from hybrid.model.mesh import Zone
from hybrid.model.resolution import (
    OF_VIBRATION,
    Reach,
    Resolution,
    Vibration,
    first_resolution,
    start_vibrations,
    strain_travel,
)
from hybrid.model.sections import OutputPoints
from hybrid.outputs.probes import SIDED_ERRORS
from hybrid.scene.schema import LineScene
from hybrid.simulation.restart import resolution_from, resolution_tree
from hybrid.store.integrity import Tree, matched, pack
from hybrid.store.reader import Result
from hybrid.store.records import Zone as ZoneRow
from hybrid.store.stored_rows import MissingRows, StoredArray, StoredRows, rows_from, rows_path

# Outputs by which runs are compared; those that a run does not have are skipped.
RIGHT = {f"right/{name}": f"right_{name}" for name in SIDED_ERRORS}  # and under which names their errors are reported
COMPARED = ("position", "tension", "curvature", "bending_moment", "reaction_start", "reaction_end", *RIGHT)
# Of reactions, the magnitude is reported, under these names.
END_FORCES = {"reaction_start": "end_force_start", "reaction_end": "end_force_end"}

# Kind of the events that say that errors of neglected bending are not known.
NOT_ESTIMATED = "model error not estimated"

# Output points at which runs are compared: more take time in every run, and hardly show more.  Of these, so many on
# either side of ends and jumps, where errors change most from one point to the next.
MOST_PLACES, BESIDE = 101, 2
ALL = np.zeros(0, int)  # places that stand for all output points
# Outputs of which positions are looked at together.
ROWS = 200

# What cells that follow the curvature count as at fineness 1; and the part of base cells that must have been halved.
OF_FOLLOWING, FEWEST_HALVED = 1000, 0.1

# In memory, in the file of a complete result, or in a file beside that.
Outputs = np.ndarray | StoredArray | StoredRows
Notes = tuple[tuple[str, str], ...]  # events of the whole line, at t = 0: kind and text


@dataclass(frozen=True)
class RunSample:
    """What is compared of a run: how finely it was computed, and its outputs (nt, ...) by name."""

    resolution: Resolution
    values: Mapping[str, Outputs]
    cells: int  # of zones that move: base cells; of cells that follow: by their fineness (`compared_cells`)
    steps: int
    cpu: float  # s
    every: int = 1  # outputs of the result to one of these; the last is there always
    unresolved: bool = False  # whether a bend was sharper than its cells can show
    model_error: Mapping[str, Outputs] = field(default_factory=dict)  # what leaving bending out changes
    notes: Notes = ()  # that the result should carry
    rows: Tree = field(default_factory=dict)  # what store.stored_rows keeps of the outputs; {}: they are in memory
    forces: np.ndarray = field(default_factory=lambda: np.zeros((0, 3)))  # of all steps: s; N, at start and end
    catenary: np.ndarray = field(default_factory=lambda: np.zeros(0))  # (nt,) part of the line, of zones that move
    touches: bool = False  # of a result: whether the line touched itself; of others: whether contact was computed
    # Numbers of the output points at which its values along the line are (`compared_places`); in no checkpoint.
    places: np.ndarray = field(default_factory=lambda: ALL)
    # of a result: errors (nt, ns) by its cells beside edges of contact (outputs.probes), of an equilibrium beside
    # its ends, joints and loads as well (outputs.probes)
    at_edges: Mapping[str, np.ndarray] = field(default_factory=dict)
    # what limits are held against, of all steps (store.limits.extremes_about); {}: the scene has no limits
    extremes: Mapping[str, np.ndarray] = field(default_factory=dict)
    rods: tuple[tuple[float, float], ...] = ()  # m, stretches that were rod at any output; in no checkpoint

    def some(self, name: str, numbers: np.ndarray) -> np.ndarray:
        """The values of an output with these numbers, which increase."""
        begin = numbers[0]
        return np.asarray(self.values[name][begin : numbers[-1] + 1])[numbers - begin]

    @property
    def largest_end_force(self) -> float:
        """The largest force at the ends, N."""
        forces = [np.asarray(self.values[x]) for x in END_FORCES if x in self.values]
        return max((float(np.linalg.norm(x, axis=1).max()) for x in forces), default=0.0)

    def most(self, name: str) -> np.ndarray:
        """The largest values (ns,) of an output over time."""
        return np.asarray(np.asarray(self.values[name]).max(axis=0))

    def largest(self, name: str) -> float:
        """The largest size of an output, on either side of places where it has two."""
        sides = (np.asarray(self.values[x]) for x in (name, f"right/{name}") if x in self.values)
        return max(float(max(x.max(initial=0.0), -x.min(initial=0.0))) for x in sides)

    @cached_property
    def reach(self) -> Reach:
        """How far the line moves."""
        return reach_of(self.values["position"])

    def checkpoint(self) -> Tree:
        """All of it, as named arrays and plain values."""
        kept_fields = [x.name for x in fields(self) if x.name not in ("places", "rods")]
        out = {name: getattr(self, name) for name in kept_fields} | {"resolution": resolution_tree(self.resolution)}
        kept = {} if self.rows else {"values": self.values, "model_error": self.model_error}
        lost = {name: np.zeros(0) for name in self.model_error}  # they are in no file: the runs are computed again
        blank: Tree = {"values": {}, "model_error": lost}
        return out | blank | {x: {name: np.asarray(y) for name, y in found.items()} for x, found in kept.items()}


Samples = dict[str, RunSample]  # of the lines of a run, by name


def compared_places(points: OutputPoints) -> np.ndarray:
    """Numbers of the output points at which runs are compared; ALL, where there are hardly more."""
    count, jumps = points.s.size, np.searchsorted(points.s, points.jumps)
    edges = np.concatenate([[0], jumps, [count - 1]])
    beside = np.unique((edges[:, None] + np.arange(-BESIDE, BESIDE + 1)).clip(0, count - 1))
    if count <= MOST_PLACES + beside.size:
        return ALL
    even = np.linspace(0, count - 1, max(MOST_PLACES - beside.size, 2)).round().astype(int)
    return np.unique(np.concatenate([beside, even]))


def most_at_places(errors: Any, places: np.ndarray) -> np.ndarray:
    """Of errors (n, ns) at all output points those at places: the largest from each up to the next."""
    if not places.size:
        return np.asarray(errors[()])
    rows = range(0, len(errors), ROWS)
    return np.concatenate([np.maximum.reduceat(np.asarray(errors[k : k + ROWS]), places, axis=1) for k in rows])


def is_along(name: str) -> bool:
    """Whether a compared output, or an error of one, has a value at every output point."""
    return not name.startswith("right") and name not in (*END_FORCES, *END_FORCES.values())


def at_all_points(errors: np.ndarray, places: np.ndarray) -> np.ndarray:
    """Errors (n, places) at all output points (n, ns): between two places the larger one of them."""
    points = np.arange(places[-1] + 1)
    after = np.searchsorted(places, points)
    return np.maximum(errors[:, after], errors[:, after - (places[after] != points)])


def reach_of(position: Outputs) -> Reach:
    """How far places (nt, ns, 3) move, m, and lie at first from the straight line between the first and the last."""
    first = np.asarray(position[0:1])
    parts = (np.asarray(position[k : k + ROWS]) - first for k in range(0, position.shape[0], ROWS))
    moved = max(float(np.linalg.norm(x, axis=-1).max()) for x in parts)
    apart, along = first[0] - first[0, 0], first[0, -1] - first[0, 0]
    part = np.clip(apart @ along / max(float(along @ along), 1e-300), 0.0, 1.0)
    return Reach(moved, float(np.linalg.norm(apart - part[:, None] * along, axis=1).max()))


def compared_cells(model: Model, fineness: float = 0.0, cells: float = np.inf) -> int:
    """Cells by which meshes of one scene are compared.

    Of zones that move, their base cells; of a line that is paid out, those at the start.
    fineness: of cells that follow the curvature, 0: they do not.  All that sets their lengths goes with it, and their
    number with the steps as well, over which contact edges go: it counts as `OF_FOLLOWING` at fineness 1.  cells: how
    many there are in most outputs; where nearly all are base cells, which stay, a finer run is
    no finer, and counts as one.
    """
    if model.payout is not None and not fineness:
        return int(model.payout.begun.size) - 1
    if model.layout is None:
        return model.cells
    base = int(model.layout.rod.size)
    if not fineness:
        return base
    return max(1, round(OF_FOLLOWING * fineness)) if cells > base + max(FEWEST_HALVED * base, 1.0) else 1


def usual_cells(nodes: np.ndarray) -> float:
    """The median number of cells of outputs, from the words of `store.records.node_bits` (nt, words)."""
    bits = np.unpackbits(np.ascontiguousarray(nodes, "<i8").view(np.uint8), axis=1)
    return float(np.median(bits.sum(axis=1))) - 1.0


def rods_of(zones: Sequence[Sequence[Zone | ZoneRow]]) -> tuple[tuple[float, float], ...]:
    """Stretches (m) of a line that are rod at any output; zones: of the outputs."""
    return tuple(sorted({(zone.s_a, zone.s_b) for each in zones for zone in each if zone.kind == "rod"}))


def catenary_share(zones: Sequence[Zone | ZoneRow]) -> float:
    """Part of a line that is catenary."""
    return float(sum(zone.s_b - zone.s_a for zone in zones if zone.kind == "catenary") / zones[-1].s_b)


def every_of(count: int, step: int) -> np.ndarray:
    """Numbers of every `step`-th of `count` outputs, and of the last."""
    found = np.arange(0, count + step - 1, step)
    found[-1:] = count - 1
    return found


# --- from a checkpoint --------------------------------------------------------------------------


def rows_key(resolution: Resolution, name: str = "") -> str:
    """What tells files of outputs apart (store.stored_rows); name: of the line, if there are several."""
    return hashlib.blake2b(pack(resolution_tree(resolution)) + name.encode(), digest_size=4).hexdigest()


def restored_sample(
    tree: Any, scene: LineScene, shape: tuple[int, int, int], result: Path | None = None, name: str = ""
) -> RunSample:
    """A sample from a checkpoint; shape: number of outputs of the result, of its output points, and of its jumps.

    result: the file that the checkpoint is in; name: as of `rows_key`.  ResultError or ValueError: it is none of this
    scene; MissingRows: its outputs are not beside it.
    """
    blank = RunSample(first_resolution(scene), {}, 1, 1, 0.0).checkpoint()
    free = dict.fromkeys(("resolution", "values", "model_error", "at_edges", "extremes", "notes", "rows"))
    older = {"rows": {}, "catenary": np.zeros(0), "touches": False}  # not in 0.6
    older |= {"at_edges": {}, "extremes": {}}  # not in 1.0
    tree = {name: x for name, x in tree.items() if name not in ("bound", "doubt")}  # of 1.0
    saved = matched(older | tree, blank | free, "run")
    if saved["forces"].ndim != 2 or saved["forces"].shape[1] != 3 or not np.isfinite(saved["forces"]).all():
        raise ValueError("forces of steps that no run has")
    if not (saved["catenary"].ndim == 1 and (abs(saved["catenary"] - 0.5) <= 0.5).all()):
        raise ValueError("a part of a line that no run has")
    resolution = resolution_from(saved["resolution"], scene)
    if not all(isinstance(x, np.ndarray) and x.ndim == 1 and np.isfinite(x).all() for x in saved["extremes"].values()):
        raise ValueError("extremes that no run has")
    if saved["rows"] and saved["model_error"]:
        raise MissingRows("what leaving bending out changes")
    if saved["rows"] and result is not None:
        saved["values"] = rows_from(saved["rows"], rows_path(result, rows_key(resolution, name)))
    if min(saved["cells"], saved["steps"], saved["every"]) < 1:
        raise ValueError("a run without cells, steps or outputs")
    shape = (every_of(shape[0], saved["every"]).size, *shape[1:])
    outputs = {x: restored_outputs(saved[x], shape) for x in ("values", "model_error", "at_edges")}
    return RunSample(**saved | outputs | {"resolution": resolution, "notes": restored_notes(saved["notes"])})


def restored_notes(tree: Any) -> Notes:
    """Events from a checkpoint."""
    return tuple((kind, text) for kind, text in matched(tree, [["", ""]] * len(tree), "notes"))


def restored_outputs(tree: Any, shape: tuple[int, int, int]) -> dict[str, np.ndarray]:
    """Outputs by name from a checkpoint; shape: as of `restored_sample`.  ResultError: they are of another shape."""
    (count, ns, jumps), points, template = shape, {"position": (3,)}, {}
    right = {*RIGHT, *RIGHT.values()}
    for name, value in tree.items():
        along = (count, jumps if name in right else ns)
        full = (count, 3) if name in END_FORCES else (count,) if name in END_FORCES.values() else along
        scalar = name == "position" and len(getattr(value, "shape", ())) == 2  # of an error, its size
        expected = *full, *(() if scalar else points.get(name, ()))
        if isinstance(value, StoredRows):
            if value.shape != expected:
                raise ValueError(f"{name}: shape {value.shape}, expected {expected}")
        else:
            template[name] = np.zeros(expected)
    if not set(tree) <= {*COMPARED, *END_FORCES.values(), *right}:
        raise ValueError(f"outputs that are not compared: {', '.join(tree)}")
    return dict(tree) | matched({name: tree[name] for name in template}, template, "outputs")


# Worth a word: so many times the estimated error, and this part of the largest end force.
TIMES_THE_ERROR, PART = 2.0, 0.02
# Outputs after a change of zones within which a shake is laid to it.
SOON = 2.0
# Steps to a period that show a vibration.
STEPS_PER_VIBRATION = 12
# Energy lost to the scheme that is worth a word, as a part of the largest kinetic energy, and of tension scale times
# length: below, it is what Newton's tolerance leaves.
NOTHING_LOST = 1e-6
# The same as a part of all work done: what the books miss when steps are long.
IN_BOOKS = 0.01


def undersampled_end_forces(
    times: Floats, result: RunSample, errors: Mapping[str, float], changes: Sequence[float]
) -> list[tuple[str, str]]:
    """Events (kind, text): where an end force leaves the curve through its outputs by more than its error, N.

    times: (nt,) s, of the outputs; changes: s, when zones have changed.
    """
    out: list[tuple[str, str]] = []
    t, largest = result.forces[:, 0], float(result.forces[:, 1:].max(initial=0.0))
    for name, off in beyond_outputs(times, result).items():
        if name not in errors:
            continue
        i, error, end = int(off.argmax()), errors[name], name.removeprefix("end_force_")
        if off[i] > max(TIMES_THE_ERROR * error, PART * largest):
            every = float(np.median(np.diff(times)))
            text = (
                f"between outputs the force at the {end} leaves the curve through them by up to {off[i]:.3g} N, at "
                f"t = {t[i]:.4g} s; the error figure ({error:.2g} N) is by what all steps of the runs differ; "
                f"output.every: {every / 10:.2g} shows it"
            )
            shaken = [x for x in changes if 0.0 <= t[i] - x <= SOON * every]
            if shaken:
                text += f"; zones that change (t = {shaken[-1]:.4g} s) may have shaken it: model: rod has none"
            out.append(("end force between outputs", text))
    return out


def beyond_outputs(times: Floats, result: RunSample) -> dict[str, Floats]:
    """By how much end forces of all steps (n,) N leave the curves through their outputs, at times (nt,) s, by name."""
    found: dict[str, Floats] = {}
    t = result.forces[:, 0]
    if len(times) < 4 or len(t) <= len(times):
        return found
    inside = (t >= times[1]) & (t <= times[-2])  # at the first and last output the curve has one side only
    for force, (raw, name) in zip(result.forces[:, 1:].T, END_FORCES.items(), strict=True):
        if raw in result.values:
            outputs = np.linalg.norm(np.asarray(result.values[raw]), axis=1)
            found[name] = np.where(inside, np.abs(force - cubic_spline(times, outputs, t)), 0.0)
    return found


def cubic_spline(x: Floats, y: Floats, at: Floats) -> Floats:
    """The cubic spline through four or more points (not-a-knot: its first two pieces are one, and its last two)."""
    h, slope = np.diff(x), np.diff(y) / np.diff(x)
    # below, diagonal, above, right-hand side of the second derivatives at the inner points
    a, b, c, d = h[:-1].copy(), 2.0 * (h[:-1] + h[1:]), h[1:].copy(), 6.0 * np.diff(slope)
    b[0] += h[0] * (1.0 + h[0] / h[1])
    c[0] -= h[0] * h[0] / h[1]
    b[-1] += h[-1] * (1.0 + h[-1] / h[-2])
    a[-1] -= h[-1] * h[-1] / h[-2]
    lower, diagonal, upper, m = (v.tolist() for v in (a, b, c, d))
    for i in range(1, len(m)):
        w = lower[i] / diagonal[i - 1]
        diagonal[i] -= w * upper[i - 1]
        m[i] -= w * m[i - 1]
    m[-1] /= diagonal[-1]
    for i in range(len(m) - 2, -1, -1):
        m[i] = (m[i] - upper[i] * m[i + 1]) / diagonal[i]
    first = m[0] + (m[0] - m[1]) * h[0] / h[1]
    last = m[-1] + (m[-1] - m[-2]) * h[-1] / h[-2]
    M = np.array([first, *m, last])
    k = np.clip(np.searchsorted(x, at, side="right") - 1, 0, len(h) - 1)
    p, l = at - x[k], h[k]
    return np.asarray(
        y[k] + p * (slope[k] - l * (2.0 * M[k] + M[k + 1]) / 6.0 + p * (0.5 * M[k] + p * (M[k + 1] - M[k]) / (6.0 * l)))
    )


def jolts(scene: LineScene) -> list[Vibration]:
    """Where the slope of a load's history jumps, and the vibration along the line that starts there.

    A jump a (N/s) at one end of a bar that is held at the other makes a triangle of a L/c about the slow answer, of
    period 4 L/c; L/c is the time in which strain runs along it.  None in a line that does not stretch.
    """
    travel = strain_travel(scene.cable)
    if travel is None:
        return []
    found = []
    for load in (load for end in scene.ends.both for load in end.loads if load.what == "force"):
        rows = np.array(load.rows)
        if len(rows) < 2:
            continue
        times, values = rows[:, 0], rows[:, 1:]
        slopes = np.diff(values, axis=0) / np.diff(times)[:, None]
        jump = np.diff(np.vstack([np.zeros(3), slopes, np.zeros(3)]), axis=0)
        sizes = np.linalg.norm(values, axis=1)
        along = np.abs((jump * values).sum(axis=1)) / np.where(
            sizes > 0.0, sizes, 1.0
        )  # lines lie along what pulls them
        both = zip(times, along, strict=True)
        found += [Vibration(float(t), float(a) * travel, 4.0 * travel) for t, a in both if t > 0.0]
    return found


def damped_jolts(scene: LineScene, result: RunSample, error: float, allowed: float | None) -> list[tuple[str, str]]:
    """The events that say so where steps damp a vibration that a jump in the slope of a load, or a ramp, starts.

    error: N, figure of the forces at the ends, which does not see it, as all runs damp it; allowed: N, None: not asked.
    """
    worth = error if allowed is None else max(allowed - error, 0.0)
    of_ramps = worth if allowed is None else max(worth, OF_VIBRATION * allowed)
    out = []
    for found, least, begins, cure in (
        (jolts(scene), worth, "the slope of a force given at an end jumps", "a smoother history"),
        (start_vibrations(scene), of_ramps, "the ramp or move of an end begins or ends", "a longer ramp or move"),
    ):
        worst = max((x for x in found if not _is_shown(x, result.forces[:, 0])), key=lambda x: x.force, default=None)
        if worst is None or not worst.force > least:
            continue
        text = (
            f"{begins} at t = {worst.t:.4g} s: a vibration along the line of {worst.force:.2g} N and a period of "
            f"{worst.period:.2g} s starts, which steps damp out, and the error figure of forces ({error:.2g} N) "
            f"does not see it; time.step: {worst.period / STEPS_PER_VIBRATION:.2g} shows it, or {cure} has none"
        )
        out.append(("error uncertain", text))
    return out


def _is_shown(found: Vibration, steps: Floats) -> bool:
    """Whether the steps (s, when they end) after a vibration has begun follow it, or the run is over before."""
    t, period = found.t, found.period
    near = (steps >= t - 1e-9 * period) & (steps <= t + 2.0 * period)
    return bool(t >= steps[-1] or np.count_nonzero(near) > 2.0 * STEPS_PER_VIBRATION)


def damped_vibrations(result: Result) -> tuple[tuple[str, str], ...]:
    """Events (kind, text): where the time scheme has dissipated more energy than the cable ever stored by straining."""
    names = [x for x in ("energy/stretch", "energy/bending", "energy/torsion") if x in result]
    strained = sum(np.array(result[x]) for x in names)
    lost = -float(np.min(result["work/scheme"]))
    peak = float(np.ptp(strained)) if np.ndim(strained) else 0.0
    books = IN_BOOKS * sum(float(np.abs(result.work[x]).max()) for x in result.work if x != "scheme")
    least = NOTHING_LOST * float(result.attributes["tension_scale"]) * float(result.attributes["length"])
    if not lost > max(peak, NOTHING_LOST * float(np.max(result.energy["kinetic"])), least, books):
        return ()
    text = (
        f"steps follow the motion in metres: vibrations of less are damped out ({lost:.2g} J, where at most "
        f"{peak:.2g} J are stored by strain), and with them their moments and reactions, which the error figure "
        f"does not see; for those give a time.step that follows them"
    )
    return (("vibrations damped", text),)
