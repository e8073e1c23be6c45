"""Problems against published values: power cables and chains of OrcaFlex, 123 equilibria, a helix in closed form."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from power_cables import scene_of, solve_all

import hybrid
from board.answers import Answer, references, timed

Floats = NDArray[np.float64]
STATIC = {"accuracy": {"line_tension": "0.1%", "curvature": "0.2%"}}
CHAIN = {"accuracy": {"line_tension": "0.1%"}}
MOVING = {"accuracy": {"tension": "0.3%", "curvature": "0.5%"}}
TENSION, CURVATURE = "total/tension", "total/curvature"
CURRENTS = ([-1.0, 0.0, 0.0], [0.0, 1.0, 0.0])  # m/s
STIFFER = 22.0  # times, a bed that holds the chain at the level of its anchor
SEGMENT = 10.0  # m, of the references of chains, which their damping is of


def row_of(name: str, number: int | None = None) -> dict[str, Any]:
    """The cable of a problem, in the terms of power_cables.scene_of; number: of several."""
    table = references()
    problem = table["problems"][name]
    row = dict(problem["row"] if number is None else problem["rows"][number])
    return row | (table[row["line"]] if "line" in row else {})


def static_of(row: dict[str, Any], more: dict[str, Any]) -> tuple[hybrid.Result, float]:
    """The equilibrium of a cable, and its CPU time (s)."""
    return timed(lambda: hybrid.static(scene_of(row) | more))


def size(force: Floats) -> Floats:
    return np.asarray(np.linalg.norm(force, axis=-1))


def lazy_wave(name: str) -> list[Answer]:
    """Tension at the top and largest curvature of a lazy wave at rest."""
    found, cpu = static_of(row_of(name), STATIC)
    top, bend = references()["problems"][name]["quantities"]
    values = {top: float(size(found.reaction_start)[-1]) / 1e3, bend: float(np.abs(found.curvature[-1]).max())}
    figures = {
        top: float(found.errors["total/end_force_start"][-1]) / 1e3,
        bend: float(found.errors[CURVATURE][-1].max()),
    }
    return [Answer("hybrid", values, figures, cpu, asked(STATIC))]


def asked(more: dict[str, Any]) -> str:
    """What was asked of ours, in words."""
    return "accuracy " + ", ".join(f"{value} of {name.replace('_', ' ')}" for name, value in more["accuracy"].items())


def span(name: str) -> list[Answer]:
    """Curvature and top tension of the part of a lazy wave that hangs, at rest and in heave; with and without a figure."""
    fixed = {"model": "rod", "mesh": {"cells": 160}}
    return [spanned(name, MOVING, None, asked(MOVING)), spanned(name, fixed, 0.1, "160 cells, steps of 0.1 s")]


def spanned(name: str, more: dict[str, Any], step: float | None, words: str) -> Answer:
    """One run of it; a fixed step (s) has no error figure."""
    heave = references()["problems"][name]["heave"]
    row = row_of(name)
    length = sum(x[1] for x in row["sections"])
    clock = {
        "time": {"duration": heave["duration"]} | ({"step": step} if step else {}),
        "output": {"every": 0.1, "points": [float(x) for x in np.linspace(0.03 * length, 0.97 * length, 401)]},
    }
    scene = scene_of(row) | clock | more
    motion = {"heave": {"amplitude": heave["amplitude"], "period": heave["period"]}, "ramp": heave["ramp"]}
    scene["ends"]["start"]["motion"] = motion
    found, cpu = timed(lambda: hybrid.run(scene, None))
    late = found.t >= heave["duration"] - heave["window"] - 1e-9
    inner = (found.s >= 0.03 * length - 1e-9) & (found.s <= 0.97 * length + 1e-9)
    bend, pull = np.abs(found.curvature[:, inner]), size(found.reaction_start)[late] / 1e3
    numbers = [bend[0].max(), bend[late].max(), pull[:-1].mean(), pull.min(), pull.max()]
    names = list(references()["problems"][name]["quantities"])
    values = dict(zip(names, map(float, numbers), strict=True))
    if step:
        return Answer("hybrid", values, {}, cpu, words)
    wrong, off = found.errors[CURVATURE][:, inner], found.errors["total/end_force_start"][late] / 1e3
    figures = [wrong[0].max(), wrong[late].max(), off.mean(), off[pull.argmin()], off[pull.argmax()]]
    return Answer("hybrid", values, dict(zip(names, map(float, figures), strict=True)), cpu, words)


def touchdown_bending(name: str) -> list[Answer]:
    """Tensions and curvature at the middle of the segments of the reference; as rods on many cells as well."""
    row, names = row_of(name), list(references()["problems"][name]["quantities"])
    _, length, count = row["sections"][0]
    middle = (np.arange(count) + 0.5) * length / count
    given = references()["problems"][name]["quantities"]
    orca = [given[x]["OrcaFlex"] for x in names[:2]]

    def solve(more: dict[str, Any], words: str, finer: bool) -> Answer:
        found, cpu = static_of(row, more)
        there = found.at(t=float(found.t[-1]), s=middle, names=["tension", "curvature", "position"])
        pull, bend = there["tension"][[0, -1]] / 1e3, np.abs(there["curvature"])
        values = dict(zip(names, map(float, [*pull, bend.max()]), strict=True))
        if finer:
            return Answer("hybrid", values, {}, cpu, words, finer=True)
        wrong = float(found.errors[TENSION][-1].max()) / 1e3
        own = dict(zip(names, [wrong, wrong, float(found.errors[CURVATURE][-1].max())], strict=True))
        kept = [lasting(row, there["position"][[0, -1], 2], bend[[0, -1]], x) for x in (orca, pull)]
        note = (
            "A line without friction keeps T + EI κ^2/2 - w z. From the anchor to the top it changes by "
            f"{kept[0]:.3f} kN in the values of OrcaFlex and by {kept[1]:.3f} kN in those of hybrid, whose top is not all wet."
        )
        return Answer("hybrid", values, own, cpu, words, note=note)

    fine = {"model": "rod", "mesh": {"cells": 1920}}
    return [solve(STATIC, asked(STATIC), False), solve(fine, "finer: a rod of 1920 cells", True)]


def lasting(row: dict[str, Any], z: Floats, bend: Floats, pull: Any) -> float:
    """Change (kN) of T + EI kappa^2 / 2 - w z from the last of two places to the first."""
    diameter, mass, _, EI, *_ = row["types"][row["sections"][0][0]]
    kept = np.asarray(pull) + (0.5 * EI * bend**2 - weight(diameter, mass) * z) / 1e3
    return float(kept[0] - kept[1])


def weight(diameter: float, mass: float) -> float:
    """In water, N/m."""
    return 9.80665 * (mass - 1025.0 * 0.25 * math.pi * diameter**2)


def chain_current(name: str) -> list[Answer]:
    """Forces at the ends; CPU time of both directions."""
    row, names = row_of(name), list(references()["problems"][name]["quantities"])

    def solve(words: str, more: dict[str, Any], stiffer: float = 1.0, finer: bool = False) -> Answer:
        values, figures, spent = dict[str, float](), dict[str, float](), 0.0
        bed = row["bed"] | {"stiffness": stiffer * row["bed"]["stiffness"]}
        for k, current in enumerate(CURRENTS):
            found, cpu = static_of(row | {"current": current, "bed": bed}, more)
            for end, quantity in zip(("start", "end"), names[2 * k : 2 * k + 2], strict=True):
                values[quantity] = float(size(found[f"reaction_{end}"])[-1]) / 1e3
                if not finer:
                    figures[quantity] = float(found.errors[f"total/end_force_{end}"][-1]) / 1e3
            spent += cpu
        return Answer("hybrid", values, figures, spent, words, finer=finer)

    diameter, mass, *_ = row["types"]["chain"]
    across, w = [references()["problems"][name]["quantities"][x]["OrcaFlex"] for x in names[2:]], weight(diameter, mass)
    ours, high = solve(asked(CHAIN), CHAIN), solve("", CHAIN, STIFFER)
    sinks = 1e3 * w / row["bed"]["stiffness"] / diameter
    note = (
        f"In the current across, tensions at the ends differ by w h = {50e-3 * w:.1f} kN; those of OrcaFlex by "
        f"{across[0] - across[1]:.1f} kN. The chain sinks by {sinks:.0f} mm into this bed; into one {STIFFER:g} times as "
        f"stiff, by {sinks / STIFFER:.0f} mm, ours are {', '.join(number_of(x) for x in high.values.values())} kN: the level "
        "at which the chain lies makes more than half of the distance."
    )
    fine = solve("finer: 1640 cells", {"mesh": {"cells": 1640}}, finer=True)
    return [replace(ours, note=note), fine]


def number_of(value: float) -> str:
    return f"{value:.1f}"


def first_harmonic(t: Floats, force: Floats, period: float, window: float) -> float:
    """Amplitude of the first harmonic over the last `window` seconds, whole periods of even samples."""
    late = t > t[-1] - window + 1e-9
    turn = np.exp(-2j * np.pi * t[late] / period)
    return float(2.0 * np.abs(np.mean(force[late] * turn)))


def chain_heave(name: str) -> list[Answer]:
    """First harmonics of the top tension of three chains in two heaves, each with a figure that bounds its error.

    An error e(t) changes a harmonic by at most sqrt(2) rms(e).
    """
    return [
        heaved_chains(name, 2.5, 0.025, "cells of 2.5 m, steps of 0.025 s, six runs", False),
        heaved_chains(name, 1.25, 0.0125, "finer: cells of 1.25 m, steps of 0.0125 s", True),
    ]


def heaved_chains(name: str, cell: float, step: float, words: str, finer: bool) -> Answer:
    """On one mesh (cells in m) and step (s); a finer run has no error figure."""
    problem = references()["problems"][name]
    heave, names = problem["heave"], iter(problem["quantities"])
    values, figures, spent = dict[str, float](), dict[str, float](), 0.0
    for number in range(len(problem["rows"])):
        row = row_of(name, number)
        for amplitude in heave["amplitudes"]:
            scene = scene_of(row) | {
                "time": {"duration": heave["duration"], "step": step},
                "mesh": {"cells": round(row["sections"][0][1] / cell)},
                "output": {"every": 0.1, "errors": not finer},
            }
            _, mass, stiffness, *_ = row["types"]["chain"]
            # zeta = 1 of a segment of the references
            scene["cable"]["sections"][0]["damping"] = {"stiffness": SEGMENT * math.sqrt(mass / stiffness)}
            motion = {"heave": {"amplitude": amplitude, "period": heave["period"]}, "ramp": heave["ramp"]}
            scene["ends"]["start"]["motion"] = motion
            found, cpu = timed(lambda scene=scene: hybrid.run(scene, None), 1)
            quantity = next(names)
            force = size(found.reaction_start) / 1e3
            values[quantity] = first_harmonic(found.t, force, heave["period"], heave["window"])
            if not finer:
                late = found.t > found.t[-1] - heave["window"] + 1e-9
                off = found.errors["total/end_force_start"][late] / 1e3
                figures[quantity] = float(np.sqrt(2.0 * np.mean(off**2)))
            spent += cpu
    return Answer("hybrid", values, figures, spent, words, finer=finer)


def power_cables(name: str) -> list[Answer]:
    """The matrix of equilibria as one line."""
    found = solve_all()
    must = [x for x in found.values() if x.admissible]
    good, silent = sum(x.good for x in must), [key for key, x in found.items() if x.silent]
    off = float(np.median([x.off for x in found.values() if x.judged_by_root]))
    wrong = [key for key, x in found.items() if x.admissible and not x.good]
    words = (
        f"{good} of {len(must)} that have an equilibrium within their bounds, median distance {100 * off:.2f} %; "
        f"not within: {', '.join(wrong) or 'none'}; in compression without a word: {', '.join(silent) or 'none'}"
    )
    return [Answer("hybrid", {}, {}, float(np.median([x.answer.cpu for x in found.values()])), words)]


def helix_scene(given: dict[str, Any], cells: int) -> dict[str, Any]:
    """A rod that is clamped as on the helix; it starts on the polyline of ten points to a cell."""
    radius, pitch = given["radius"], math.radians(given["pitch"])
    length = 2.0 * math.pi * radius / math.cos(pitch)

    def place(s: float) -> list[float]:
        turn = s * math.cos(pitch) / radius
        return [radius * math.cos(turn), radius * math.sin(turn), s * math.sin(pitch)]

    tangent = [0.0, math.cos(pitch), math.sin(pitch)]
    turns = given["torque"] / given["torsion"] * length / (2.0 * math.pi)
    section = {
        "length": length, "mass": 1.0, "bending_stiffness": given["bending"], "torsional_stiffness": given["torsion"]
    }  # fmt: skip
    return {
        "environment": {"gravity": 0.0}, "cable": {"sections": [section]}, "model": "rod", "mesh": {"cells": cells},
        "ends": {
            "start": {"kind": "clamped", "position": place(0.0), "tangent": tangent},
            "end": {"kind": "clamped", "position": place(length), "tangent": tangent, "turns": turns},
        },
        "initial": {"kind": "equilibrium", "points": [place(s) for s in np.linspace(0.0, length, 10 * cells + 1)]},
    }  # fmt: skip


def helix(name: str, cells: int = 200) -> list[Answer]:
    """Force along the axis and moment about it at the far end."""
    problem = references()["problems"][name]
    scene = helix_scene(problem, cells)
    found, cpu = timed(lambda: hybrid.static(scene))
    force, moment = found.reaction_end[-1], found.moment_end[-1]
    whole = moment + np.cross(found.position[-1, -1], force)
    values = dict(zip(problem["quantities"], (float(force[2]), float(whole[2])), strict=True))
    return [Answer("hybrid", values, {}, cpu, f"{cells} cells")]
