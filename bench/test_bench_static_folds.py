"""Equilibria of 300 random cables: how many are sound, found with a word, refused with a reason, or wrong in silence.

    pytest bench/test_bench_static_folds.py -m bench -s -n 0

A cable of 0.9 to 3 times the distance of its ends, in one scene of five up to 30 times, hangs in air or water, in a plane
or in space, over a level or sloping bed or none, with or without clumps, floats and a current, as rod, catenary, fixed
zones or zones that follow.  Wrong in silence is a fold of more than a right angle from one cell to the next away from
point loads, a kink of more than a radian at a joint of zones, or a catenary in compression, of which no event tells;
wrong whatever is said is a fold on which a rod stands.
"""

from __future__ import annotations

import time
from collections import Counter
from typing import Any

import numpy as np
import pytest

import hybrid
from hybrid.errors import ComputationError, SceneError
from hybrid.kernels.state.state import State
from hybrid.model.build import Model
from hybrid.simulation.diagnostics import Diagnostics

pytestmark = pytest.mark.bench
SCENES, KINK, COMPRESSED = 300, 1.0, 0.01


def cable(seed: int) -> dict[str, Any]:
    """A cable of 2 to 200 m, of 20 to 120 cells, with a bending stiffness from next to nothing to w l^3/30."""
    rng = np.random.default_rng(seed)
    apart = float(10 ** rng.uniform(0.3, 2.0))
    longer = rng.uniform(0.9, 3.0) if rng.random() < 0.8 else 10 ** rng.uniform(0.5, 1.5)
    length = apart * float(longer)
    flat, steep = bool(rng.random() < 0.4), float(rng.uniform(-1.5, 1.5))
    heading = 0.0 if flat else float(rng.uniform(0, 2 * np.pi))
    across, up = apart * np.cos(steep), apart * np.sin(steep)
    end = [float(across * np.cos(heading)), float(across * np.sin(heading)), float(up)]
    diameter, model = float(10 ** rng.uniform(-2, -1)), str(rng.choice(["catenary", "rod", "zones", "adaptive"]))
    mass = 1500.0 * float(rng.uniform(1, 4)) * np.pi / 4.0 * diameter**2
    EI = mass * 9.81 * length**3 * float(10 ** rng.uniform(-7.0, -1.5))
    section: dict[str, Any] = {"length": length, "mass": mass, "diameter": diameter}
    if rng.random() < 0.8:
        section["axial_stiffness"] = mass * 9.81 * length * float(10 ** rng.uniform(1.5, 5.0))
    if model != "catenary":
        section["bending_stiffness"] = EI
    environment: dict[str, Any] = {}
    if rng.random() < 0.5:
        current = [float(rng.choice([0.0, 0.5])), 0.0, 0.0]
        environment["fluid"] = {"density": 1025, "surface": 100.0, "current": current}
        section["drag"] = {"normal": 1.2}
    if rng.random() < 0.4:
        slope = [float(x) for x in rng.uniform(-0.1, 0.1, 2)] if rng.random() < 0.5 else [0.0, 0.0]
        low = min(0.0, up - slope[0] * end[0] - slope[1] * end[1])
        environment["seabed"] = {"z": float(low - rng.uniform(0.0, 0.6) * length), "stiffness": 3e3, "slope": slope}
        if rng.random() < 0.3:
            environment["seabed"]["friction"] = 0.4
    loads: list[dict[str, Any]] = []
    for _ in range(int(rng.choice([0, 0, 0, 1, 2]))):
        heavy = float(mass * length * rng.uniform(0.05, 0.5))
        load: dict[str, Any] = {"kind": "clump", "at": float(length * rng.uniform(0.1, 0.9)), "mass": heavy}
        if "fluid" in environment and rng.random() < 0.5:
            load = load | {"kind": "float", "mass": 0.1 * heavy, "volume": float(heavy / 1025)}
        loads.append(load)
    tables: dict[str, Any] = {
        "environment": environment,
        "cable": {"sections": [section]} | ({"attachments": loads} if loads else {}),
        "ends": {
            "start": {"kind": "pinned", "position": [0.0, 0.0, 0.0]},
            "end": {"kind": "pinned", "position": end},
        },
        "initial": "equilibrium",
        "mesh": {"cells": int(rng.integers(20, 121))},
        "model": model,
    }
    if model == "zones":
        part = float(rng.uniform(0.1, 0.9)) * length
        first = bool(rng.random() < 0.5)
        zones = [{"rod" if first else "catenary": part}, {"catenary" if first else "rod": length - part}]
        tables["model"] = {"kind": "zones", "zones": zones}
    return tables


def flaws_of(found: hybrid.Result, model: Model, state: State) -> tuple[list[str], list[str]]:
    """What is wrong with an equilibrium and not said by an event; and what is said."""
    line, e, T = model.line, state.e, state.T
    kinds = {event.kind for event in found.events}
    d = e / np.linalg.norm(e, axis=1)[:, None]
    turn = np.arctan2(np.linalg.norm(np.cross(d[:-1], d[1:]), axis=1), np.einsum("ij,ij->i", d[:-1], d[1:]))
    turn[np.isin(line.s[1:-1], model.attached)] = 0.0
    joint = line.spin[1:] != line.spin[:-1]
    silent, said = [], []

    def note(text: str, *names: str) -> None:
        (said if kinds & set(names) else silent).append(text)

    bends = np.where(joint, 0.0, turn)
    k = int(np.argmax(bends))
    if bends[k] > 0.5 * np.pi:
        text = f"fold of {np.degrees(turn[k]):.0f} deg at s = {line.s[k + 1]:.3g} m between {T[k]:.3g} and {T[k + 1]:.3g} N"
        note(text, "unresolved bend")
        if line.spin[k] and min(T[k], T[k + 1]) < -np.linalg.norm(line.force[k + 1]):
            silent.append(f"{text}, a rod stands on it")
    k = int(np.argmax(np.where(joint, turn, 0.0)))
    if joint[k] and turn[k] > KINK:
        note(f"kink of {np.degrees(turn[k]):.0f} deg at the joint s = {line.s[k + 1]:.3g} m", "kink at joint")
    low = T[line.spin == 0].min(initial=np.inf)
    if low < -COMPRESSED * np.abs(T).max():
        note(f"compression of {low:.3g} N in a catenary, of {T.max():.3g} N", "slack")
    return silent, said


def test_no_equilibrium_of_a_cable_is_folded_in_silence(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    seen = list[tuple[Model, State]]()
    judge = Diagnostics.note_at_rest

    def keep(self: Diagnostics, pushed: bool, slack: int, state: State) -> None:
        seen.append((self._model, state))
        judge(self, pushed, slack, state)

    monkeypatch.setattr(Diagnostics, "note_at_rest", keep)
    count, silent, refused, cpu = Counter[str](), list[str](), Counter[str](), list[float]()
    noted = list[str]()
    for seed in range(SCENES):
        tables, begin = cable(seed), time.process_time()
        try:
            wrong, said = flaws_of(hybrid.static(tables), *seen[-1])
        except (ComputationError, SceneError) as error:
            why = error.outcome.name if isinstance(error, ComputationError) else "SCENE"
            count["refused"] += 1
            refused[why] += 1
            noted.append(f"{seed}: refused, {str(error).splitlines()[0]}")
            assert len(str(error).splitlines()) > 1
            continue
        finally:
            cpu.append(time.process_time() - begin)
        count["silent" if wrong else "said" if said else "sound"] += 1
        kind = tables["model"] if isinstance(tables["model"], str) else "zones"
        silent += [f"{seed} ({kind}): {text}" for text in wrong]
        noted += [f"{seed} ({kind}): said, {text}" for text in said]
    with capsys.disabled():
        print(f"\n{SCENES} cables: {count['sound']} found and sound, {count['said']} found with a word of their flaw, "
              f"{count['refused']} refused ({', '.join(f'{k} {n}' for k, n in refused.most_common())}), "
              f"{count['silent']} wrong in silence; CPU {np.median(cpu):.3f} s in the median, {max(cpu):.1f} s at most")  # fmt: skip
        for text in (*silent, *noted):
            print("  ", text)
    assert not silent
