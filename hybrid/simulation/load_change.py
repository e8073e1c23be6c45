"""Other loads and other motions of points and bodies from some time of a run of several lines on."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from hybrid.kernels.junctions.bodies import DONE, SPRING
from hybrid.kernels.state.forces import SELF_CONTACT
from hybrid.model.build import Model
from hybrid.model.failure import unclamped, without_hold
from hybrid.model.network import NetworkModel, build_system
from hybrid.model.self_reach import touching
from hybrid.scene.network_scene import Network
from hybrid.simulation.run_of_lines import RunOfLines
from hybrid.simulation.zone_switching import on_layout

# Tables of a system in which loads and motions stand.
LOADED = ("environment", "points", "bodies")


def with_loads_of(system: Network, other: Network) -> Network:
    """A system with the loads and motions of another one, which has the same lines."""
    return system.model_copy(update={name: getattr(other, name) for name in LOADED})


def loaded_as(
    model: NetworkModel, system: Network, t: float, fit: Callable[[NetworkModel], NetworkModel] | None = None
) -> NetworkModel:
    """The same network from t (s) on with the loads and motions of a system; what is joined or loose stays so.

    fit: gives lines that are paid out the cells of now, in place of those of t = 0.
    """
    other = build_system(system, model.resolution, model)
    other = other if fit is None else fit(other)
    models = tuple(_line_as(*each, system, t) for each in zip(model.names, model.models, other.models, strict=True))
    touching = model.touching
    if touching is not None:
        models = tuple(
            replace(x, line=touching.bits(x.line)) if k in touching.lines else x for k, x in enumerate(models)
        )
    supports = {(line, k): other.models[line].ends for line, k in model.supports}
    return replace(
        model, models=models, bodies=other.bodies, known=other.known, scenes=other.scenes, moments=other.moments,
        supports=supports,
    )  # fmt: skip


def _line_as(name: str, now: Model, later: Model, system: Network, t: float) -> Model:
    """The model of a line with other loads, on its cells of now, with what has come off it."""
    for k in (0, 1):
        if now.ends.released[k]:
            later = without_hold(later, k, t)
        elif later.cable.held_tangent[k] and not now.cable.held_tangent[k]:  # it has broken off
            later = unclamped(later, k)
    if now.layout is not None:
        later = on_layout(later, now.layout)
    line = later.line
    for values in ("h", "kb", "k0", "hn", "element", "spin"):
        getattr(line, values)[:] = getattr(now.line, values)  # what is on its way goes on
    line = line._replace(torsion=now.line.torsion)
    if now.line.bits & SELF_CONTACT:
        line = touching(line, system.lines[name].contact.friction)
    later.sea.values.obstacles[:] = now.sea.values.obstacles  # as stiff as they were
    later.ends.go_on_from(now.ends, t)
    return replace(later, line=line)


def change_loads_of_lines(run: RunOfLines, system: Network) -> None:
    """Other loads, and other motions of points and bodies, from now on; lines stay what they are and where they are."""
    run.ends_of_now()
    for line in run.lines:
        line.write_down()
    run.gather_events()  # in the order in which they happen
    fit = None if run.payout is None else run.payout.fit_models
    run.system, run.model = system, loaded_as(run.model, system, run.t, fit)
    run.loaded = run.t  # loads that end now, or would have ended before, act no more
    run.start_from(run.rest)
    for line, model in zip(run.lines, run.model.models, strict=True):
        line.follow(model)
    if run.zones is not None:
        run.zones.change_loads()
    done = run.solver.body_work[:, DONE:SPRING].copy()
    run.make_solver()
    run.solver.body_work[:, DONE:SPRING] = done
    run.renew_other()
    run.restart_steps()
    others = "other loads act, or points and bodies move otherwise"
    text = f"from t = {run.t:.6g} s on {others}, as `hybrid resume` was asked to"
    run.note("loads change", text)
