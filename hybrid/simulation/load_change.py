"""Other loads and other motions of the ends from some time of a run on, as `hybrid resume` may ask for."""

from __future__ import annotations

from dataclasses import replace

from hybrid.model.build import build
from hybrid.model.plane import in_space, planar
from hybrid.model.release import released_as
from hybrid.model.self_reach import touching
from hybrid.scene.schema import Scene
from hybrid.simulation.plane_monitor import same_plane
from hybrid.simulation.transient import Transient
from hybrid.simulation.zone_switching import on_layout


def change_loads(run: Transient, scene: Scene) -> None:
    """Other loads, and other motions of the ends, from now on; the cable stays what it is and where it is."""
    old, monitor, state = run.model, run.plane_monitor, run.state.copy()
    if run.payout is not None:
        model = run.payout.on(replace(build(scene, run.resolution), layout=old.layout), run.payout.length)
    else:
        model = build(scene, run.resolution, old.mesh)
    if run.switching is not None and run.payout is None:
        model = on_layout(model, run.switching.manager.layout)
    model = released_as(model, old.ends.released, run.t)
    model.line.h[:], model.line.kb[:] = old.line.h, old.line.kb  # what is on its way goes on
    model.ends.go_on_from(old.ends, run.t)
    run.scene, run.changes = scene, run.changes + 1
    if not same_plane(monitor.home, model.plane):
        monitor.home = None
    leaves = bool(monitor.speed) and not same_plane(old.plane, model.plane)
    if old.plane is not None and not leaves:
        model = replace(model, line=planar(model.line, old.plane), plane=old.plane)
    elif leaves:
        model = monitor.leave(replace(model, plane=old.plane), run.run, state)
    else:
        model = replace(model, line=in_space(model.line), plane=None)
    if run.run.contact is not None:
        model = replace(model, line=touching(model.line, scene.contact.friction))
    run.set_model(model, state)
    if run.switching is not None:
        run.switching.manager.load(model.ends.moments)
    text = f"from t = {run.t:.6g} s on other loads act, or the ends move otherwise, as `hybrid resume` was asked to"
    run.events.event(run.t, 0.0, model.length, "loads change", text)
    run.restart()
