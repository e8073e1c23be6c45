"""A made-up result for tests of reports: known extremes at known places, and only the tables that are asked for."""

from __future__ import annotations

import io
import json
from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Any

import numpy as np

from hybrid.store.format import Header
from hybrid.store.reader import Result, open_result
from hybrid.store.writer import Field, Recorder

LENGTH, POINTS, DURATION = 100.0, 41, 10.0


def reported(
    *,
    outputs: int = 21,
    title: str = "Made-up mooring",
    rod: bool = True,
    seabed: bool = True,
    energy: bool = True,
    errors: bool = False,
    not_converged: str = "",
    asked: str = "",
    steps: bool = True,
    allowed: float | None = None,
    torque: float = 0.0,
    through: bool = False,
    status: str = "complete",
    message: str = "",
    scene: str = "title: Made-up mooring\n",
    events: Sequence[tuple[float, float, float, str, str]] = (),
    points: int = POINTS,
    dip: float = 0.0,
    span: tuple[float, float] = (0.0, LENGTH),
    extremes: Mapping[str, float] = MappingProxyType({"min_bend_radius": 0.02}),
) -> Result:
    """A line that swings on 0 <= s <= 100 m, 0 <= t <= 10 s.

    Tension 10 kN (1 + s/100 + 0.1 sin(2 pi t / 10)): largest at the end, t = 2.5 s; dip: N taken away in the middle at
    t = 5 s; span: where output points are, m; curvature 0.02 1/m at s = 50 m, t = 2.5 s; rod from 40 to 60 m after half the time, with EI 2000 N m^2
    and a diameter of 0.05 m; through: whether catenaries carry the torque as well; asked: quantities of which
    an accuracy was asked; extremes: errors over all steps, by limit, of a result with errors.
    """
    s = np.linspace(*span, points)
    scalar: dict[str, str] = {"tension": "N", "curvature": "1/m"}
    if rod:
        scalar |= {"bending_moment": "N m", "torque": "N m"}
    if errors:
        scalar |= {"errors/total/tension": "N", "errors/total/position": "m", "errors/total/curvature": "1/m"}
    if seabed:
        scalar["contact"] = "N/m"
    fields = [Field(n, u, "d", (points,), ("s",)) for n, u in scalar.items()]
    fields.append(Field("position", "m", "d", (points, 3), ("s", "xyz"), "inertial"))
    single: dict[str, str] = {}
    if seabed:
        single |= {"grounded_length": "m", "contact_force": "N"}
        fields.append(Field("touchdown", "m", "d", (2,), ("edge",), nan_ok=True))
        fields.append(Field("touchdown_position", "m", "d", (2, 3), ("edge", "xyz"), "inertial", nan_ok=True))
    if energy:
        single |= {"energy/kinetic": "J", "energy/potential": "J", "work/end": "J", "work/scheme": "J"}
    fields += [Field(n, u, "d") for n, u in single.items()]
    fixed: list[tuple[Field, np.ndarray]] = []
    if seabed:
        fixed.append((Field("seabed", "", "d", (4,), ("plane",), "inertial"), np.array([0.0, 0.0, 1.0, -30.0])))
    if allowed is not None:
        limit = np.where(s > 45.0, allowed, np.nan)
        fixed.append((Field("min_bend_radius", "m", "d", (points,), ("s",), nan_ok=True), limit))
    if rod:
        fixed.append((Field("bending_stiffness", "N m^2", "d", (points,), ("s",)), np.full(points, 2000.0)))
        fixed.append((Field("diameter", "m", "d", (points,), ("s",), nan_ok=True), np.full(points, 0.05)))
    attributes: dict[str, Any] = {"title": title, "cells": 40}
    if errors:
        causes = {"mesh": 0.03, "time": 0.01, "model": 0.002, "total": 0.042}
        attributes |= {f"error_{k}_position": x for k, x in causes.items()}
        attributes |= {"errors_not_converged": not_converged} if not_converged else {}
        attributes |= {"accuracy_asked": "5 %", "accuracy_quantities": asked} if asked else {}
        attributes |= {f"error_{k}_end_force": 1e3 * x for k, x in causes.items()}
        attributes["accuracy_extremes"] = json.dumps(dict(extremes))
    log = [
        Field("t", "s", "d"),
        Field("dt", "s", "d"),
        Field("end_force_start", "N", "d"),
        Field("end_force_end", "N", "d"),
    ]
    memory = io.BytesIO()
    recorder = Recorder(
        memory, Header(s, fields, log if steps and outputs > 1 else [], attributes, {"scene": scene}, fixed),
        outputs=outputs,
    )  # fmt: skip
    for t in np.linspace(0.0, DURATION, outputs) if outputs > 1 else np.zeros(outputs):
        wave = np.sin(0.2 * np.pi * t)
        values: dict[str, Any] = {
            "position": np.stack([0.9 * s, 0.0 * s, 30.0 * ((s / 50 - 1) ** 2 - 1) + 2 * wave * s / 100], 1),
            "tension": 1e4 * (1.0 + s / 100.0 + 0.1 * wave) - dip * (abs(t - 5.0) < 1e-9) * (np.abs(s - 50.0) < 1e-9),
            "curvature": 0.02 * np.exp(-((s - 50.0) ** 2) / 50.0) * (0.75 + 0.25 * wave),
            "bending_moment": 40.0 * np.exp(-((s - 50.0) ** 2) / 50.0), "torque": np.full(points, torque),
            "errors/total/tension": np.full(points, 100.0), "errors/total/position": np.full(points, 0.04),
            "errors/total/curvature": np.full(points, 0.001),
            "contact": np.where(s < 20.0 + wave, 150.0, 0.0), "grounded_length": 20.0 + wave,
            "contact_force": 3000.0 + 150.0 * wave, "touchdown": np.array([0.0, 20.0 + wave]),
            "touchdown_position": np.array([[0.0, 0.0, 0.0], [18.0 + 0.9 * wave, 0.0, -10.0]]),
            "energy/kinetic": wave**2, "energy/potential": 5.0 * wave, "work/end": wave**2 + 5.0 * wave,
            "work/scheme": 0.0,
        }  # fmt: skip
        late = rod and (t > 0.5 * DURATION or outputs == 1)
        zones = [("catenary", 0.0, 40.0), ("rod", 40.0, 60.0), ("catenary", 60.0, 100.0)]
        if rod and not through:
            values["torque"] = torque * late * ((s >= 40.0) & (s <= 60.0))
        recorder.save(float(t), {f.name: values[f.name] for f in fields}, zones if late else [("catenary", 0.0, 100.0)])
        if steps and outputs > 1 and t > 0.0:
            pull = float(values["tension"][-1])
            recorder.log({"t": float(t), "dt": 0.01, "end_force_start": pull / 2, "end_force_end": pull * 1.05})
    for t, a, b, kind, text in events:
        recorder.event(t, a, b, kind, text)
    recorder.close(status, message)
    return open_result(memory)
