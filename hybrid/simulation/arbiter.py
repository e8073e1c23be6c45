"""`solver: shooting`: a scene computed by the arbiter, recorded like any other run.

The arbiter (hybrid.shooting) shares nothing with the production solver but the
scene; this file only carries its states into a result file.
"""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import numpy as np

from hybrid.errors import ComputationError, Outcome
from hybrid.kernels.state.state import Floats
from hybrid.model.output_points import output_points
from hybrid.model.plan import output_times
from hybrid.model.sections import borne_tension
from hybrid.outputs.probes import PROBES
from hybrid.scene.read import scene_text
from hybrid.scene.schema import Scene
from hybrid.shooting import ShootingState, simulate, static
from hybrid.simulation.failure import write_snapshot
from hybrid.store.format import Field
from hybrid.store.reader import Result, open_result
from hybrid.store.writer import Recorder

RECORDED = ("position", "velocity", "tension", "theta", "phi", "bending_moment", "torque")
_STEP_FIELDS = (
    Field("t", "s", "time at the end of the step"),
    Field("iterations", "", "Newton iterations", dtype="int64"),
    Field("residual", "", "residual of the fitted end, as the arbiter measures it"),
    Field("growth", "", "growth of the homogeneous solutions along the line"),
)


def static_shooting(scene: Scene, output: str | Path | None, overwrite: bool) -> Result:
    """Equilibrium of a scene by literal shooting; ComputationError where it is ill-conditioned."""
    target = _target(output)
    state = static(scene)
    with _recorder(scene, target, overwrite, ()) as recorder:
        if state.rod.any():
            text = "literal shooting finds an equilibrium, stable or not, and a rod may have several"
            recorder.event(0.0, 0.0, scene.length, "stability not judged", text)
        _refuse_stretch(scene, state, None)
        recorder.save(0.0, _values(scene, state), _zones(state))
        recorder.close("complete", f"equilibrium by literal shooting, growth {state.growth:.2g}")
    return open_result(target)


def run_shooting(scene: Scene, output: str | Path | None, overwrite: bool) -> Result:
    """A run by literal shooting; outputs are its states nearest to the output times asked for."""
    step = scene.require_time().step or 0.0  # a scene without one is refused
    target = _target(output)
    due = [0.0, *output_times(scene)]
    with _recorder(scene, target, overwrite, _STEP_FIELDS) as recorder:
        last: list[ShootingState] = []

        def record(state: ShootingState) -> None:
            last[:] = [state]
            _refuse_stretch(scene, state, state.t)
            if state.t > 0.0:
                recorder.log(
                    {"t": state.t, "iterations": state.iterations, "residual": state.residual, "growth": state.growth}
                )
            if due and state.t >= due[0] - 0.5 * step:
                recorder.save(state.t, _values(scene, state), _zones(state))
                due.pop(0)

        try:
            simulate(scene, record)
        except ComputationError as error:
            left = write_snapshot(target, {"scene": scene_text(scene), **vars(last[0])}) if last else None
            raise ComputationError(error.outcome, error.t, error.s, error.detail, left) from None
        recorder.close("complete", "literal shooting")
    return open_result(target)


def _refuse_stretch(scene: Scene, state: ShootingState, t: float | None) -> None:
    """ComputationError where a section is stretched or compressed beyond what it bears."""
    used = np.abs(state.tension) / borne_tension(scene, state.s)
    worst = int(np.argmax(used))
    if used[worst] > 1.0:
        detail = f"{100.0 * used[worst]:.4g} % of max_strain, under {state.tension[worst]:.4g} N"
        raise ComputationError(Outcome.OVERSTRETCHED, t, float(state.s[worst]), detail)


def _target(output: str | Path | None) -> Path | io.BytesIO:
    return Path(output) if output is not None else io.BytesIO()


def _recorder(scene: Scene, target: Path | io.BytesIO, overwrite: bool, steps: tuple[Field, ...]) -> Recorder:
    s = output_points(scene).s
    size = {"s": s.size, "xyz": 3}
    fields = [
        Field(name, p.unit, p.description, tuple(size[x] for x in p.dims), p.dims, p.frame)
        for name, p in ((name, PROBES[name]) for name in RECORDED)
    ]
    return Recorder(
        target, grid_s=s, fields=fields, step_fields=steps, attributes={"title": scene.title, "solver": "shooting"},
        texts={"scene": scene_text(scene)}, overwrite=overwrite,
    )  # fmt: skip


def _values(scene: Scene, state: ShootingState) -> dict[str, Any]:
    s = output_points(scene).s

    def at(x: Floats) -> Floats:
        flat = x.reshape(x.shape[0], -1)
        out = np.column_stack([np.interp(s, state.s, flat[:, k]) for k in range(flat.shape[1])])
        return out.reshape(s.size, *x.shape[1:])

    t, moment = at(state.tangent), at(state.moment)
    t /= np.linalg.norm(t, axis=1)[:, None]
    torque = np.einsum("ij,ij->i", moment, t)
    return {
        "position": at(state.r), "velocity": at(state.v), "tension": at(state.tension),
        "theta": np.arccos(np.clip(t[:, 2], -1, 1)), "phi": np.arctan2(t[:, 1], t[:, 0]),
        "bending_moment": np.linalg.norm(moment - torque[:, None] * t, axis=1), "torque": torque,
    }  # fmt: skip


def _zones(state: ShootingState) -> list[tuple[str, float, float]]:
    """Zones from the kind of each point (a joint stands twice, once for each side)."""
    zones: list[tuple[str, float, float]] = []
    for rod, s in zip(state.rod, state.s, strict=True):
        kind = "rod" if rod else "catenary"
        if zones and zones[-1][0] == kind:
            zones[-1] = (kind, zones[-1][1], float(s))
        else:
            zones.append((kind, float(s), float(s)))
    return zones
