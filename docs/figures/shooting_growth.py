"""Where literal shooting dies: its error on a taut rod against L/lambda, lambda = sqrt(EI/T).

    python docs/figures/shooting_growth.py [picture.png]

A rod of unit length under unit tension is clamped with a small slope at s = 0 and guided without
one at s = L: a boundary layer of thickness lambda at the clamp.  The slope has the closed forms

    linear beam     slope(s) = a sinh((L - s)/lambda) / sinh(L/lambda)
    box rule        slope_j  = a sinh((N - j) g) / sinh(N g),   g = ln((1 + z)/(1 - z)),  z = h/(2 lambda)

so that the error splits: against the first it is what a user sees, against the second round-off alone.
The production solver computes the same scenes; its slopes are those of the chords, at the middle of the cells.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from numpy.typing import NDArray

from hybrid.model.network import build_network
from hybrid.scene.root import Scene, in_full
from hybrid.simulation.equilibrium import equilibrium_of

sys.path.insert(0, str(Path(__file__).parents[2] / "bench"))
from arbiter import ArbiterError, static

Array = NDArray[np.float64]
Slopes = tuple[Array, Array]  # s (n,) m and dz/ds (n,)

SLOPE = 1.0e-7  # small enough for the linear beam: what it neglects is SLOPE^2 of the answer
PER_LAMBDA = 20  # cells per lambda: a discretisation error of (h/lambda)^2/12 = 2e-4
CELLS = (200, 20_000)  # never fewer, never more


def scene_of(ratio: float) -> Scene:
    """The rod with L/lambda = ratio."""
    cells = int(np.clip(np.ceil(PER_LAMBDA * ratio), *CELLS))
    section = {"length": 1.0, "mass": 1.0, "bending_stiffness": ratio**-2.0}
    start = {"kind": "clamped", "position": (0, 0, 0), "tangent": (1, 0, SLOPE)}
    end = {"kind": "guided", "tangent": (1, 0, 0), "force": (1, 0, 0)}
    return Scene.model_validate(
        {
            "environment": {"gravity": 0.0},
            "cable": {"sections": [section]},
            "ends": {"start": start, "end": end},
            "initial": {"kind": "straight", "direction": (1, 0, 0)},
            "model": {"kind": "rod"},
            "mesh": {"cells": cells},
        }
    )


def layer(rate: float, left: Array) -> Array:
    """sinh(rate left)/sinh(rate left[0]) without overflow."""
    out: Array = np.exp(rate * (left - left[0])) * np.expm1(-2.0 * rate * left) / np.expm1(-2.0 * rate * left[0])
    return out


def beam(s: Array, ratio: float) -> Array:
    """Slope of the linear beam with tension."""
    return SLOPE * layer(ratio, 1.0 - s)


def box(s: Array, ratio: float) -> Array:
    """Slope of the box rule on equal cells, without round-off."""
    n = len(s) - 1
    z = 0.5 * ratio / n
    return SLOPE * layer(np.log((1.0 + z) / abs(1.0 - z)), np.arange(n, -1.0, -1.0))


# --- solvers: one line each; a refusal is an ArbiterError ----------------------------------------


def shooting(scene: Scene) -> Slopes:
    """The arbiter (bench/arbiter): Newton on the literal march, every check on."""
    state = static(scene)
    return state.s, state.tangent[:, 2]


def one_march(scene: Scene) -> Slopes:
    """One march for this linear problem, GP (13)-(14), taken as it comes.

    (The second: the first, from an unstressed line, finds the tension and nothing grows in it.)
    """
    state = static(scene, marches=2)
    return state.s, state.tangent[:, 2]


def production(scene: Scene) -> Slopes:
    """The elimination along s; the clamp itself stands first."""
    network = in_full(scene)
    model = build_network(network)
    chords, s = equilibrium_of(network, model, 0.0).state.lines[0].e, model.models[0].line.s
    middle, slope = 0.5 * (s[1:] + s[:-1]), chords[:, 2] / np.linalg.norm(chords, axis=1)
    return np.concatenate([[0.0], middle]), np.concatenate([[SLOPE], slope])


SOLVERS: dict[str, Callable[[Scene], Slopes]] = {
    "shooting": shooting,
    "one march": one_march,
    "production": production,
}


# --- the data --------------------------------------------------------------------------------------


def errors_of(solver: str, ratios: Sequence[float], truth: Callable[[Array, float], Array] = beam) -> Array:
    """Largest error of the slope, as a part of the imposed slope, per ratio; NaN where the solver refuses."""
    errors = []
    for ratio in ratios:
        try:
            s, slope = SOLVERS[solver](scene_of(ratio))
        except ArbiterError:
            errors.append(np.nan)
            continue
        with np.errstate(all="ignore"):
            errors.append(float(np.abs(slope - truth(s, ratio)).max() / SLOPE))
    return np.array(errors)


def draw(ratios: Array, file: Path) -> None:
    """The figure, and its numbers on the screen."""
    total = errors_of("shooting", ratios.tolist())
    single = errors_of("one march", ratios.tolist(), box)
    ours = errors_of("production", ratios.tolist())
    print("  L/lambda   one march, round-off   shooting, total   production, total")
    for ratio, march, all_errors, our in zip(ratios, single, total, ours, strict=True):
        said = f"{all_errors:.2e}" if np.isfinite(all_errors) else "refused"
        print(f"{ratio:10.4g}   {march:20.2e}   {said:>15}   {our:17.2e}")

    figure, axis = plt.subplots(figsize=(6.4, 4.2), layout="constrained")
    short = ratios[ratios <= 45.0]
    axis.loglog(short, np.finfo(float).eps * np.exp(short), color="0.6", ls="--", label="eps exp(L/lambda)")
    shown = np.where(np.arange(len(ratios)) <= np.argmax(single > 10.0), single, np.nan)  # noise beyond
    axis.loglog(ratios, shown, "o-", ms=3, color="tab:red", label="one literal march: round-off alone")
    axis.loglog(ratios, total, "s-", ms=3, color="tab:blue", label="shooting, Newton on top: all errors")
    axis.loglog(ratios, ours, "d-", ms=3, color="tab:green", label="production, elimination along s: all errors")
    refused = ratios[np.isnan(total)]
    axis.loglog(refused, np.ones(len(refused)), "x", color="tab:blue", label="shooting refuses")
    axis.set(xlabel="L/lambda, lambda = sqrt(EI/T)", ylabel="largest error of the slope / imposed slope")
    axis.set(xlim=(0.8, 1.3e3), ylim=(1e-17, 1e5))
    axis.grid(True, which="major", color="0.92")
    axis.legend(frameon=False, loc="lower right", fontsize=8)
    figure.savefig(file, dpi=150)


if __name__ == "__main__":
    target = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parents[1] / "pictures" / "shooting_growth.png"
    draw(np.unique(np.concatenate([np.geomspace(1.0, 1000.0, 19), np.arange(15.0, 45.0, 2.5)])), target)
