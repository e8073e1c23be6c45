"""The checkpoint of a cable in motion: what the next steps depend on, and how they go on from it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from hybrid.kernels.mesh.cell_errors import CURVATURE, QUANTITIES
from hybrid.kernels.state import books as b
from hybrid.kernels.state.report import REPORT_SIZE
from hybrid.kernels.state.state import OPTIONAL_STATE, state_for
from hybrid.kernels.step.sampling import SAME_TIME
from hybrid.kernels.step.step_law import WARY
from hybrid.simulation.old_checkpoints import mesh_tree
from hybrid.simulation.transient import Transient
from hybrid.solve.run import LENGTHS
from hybrid.store.named_arrays import matched

FIRST_WORKS = 11  # works that were booked once
FIRST_REPORT = 34  # numbers that a report had once; later ones have more behind these
SAME_PLACE = 1e-9  # of the length: ends that are so near to where they were have not been moved


def checkpoint(run: Transient) -> dict[str, Any]:
    """What the next steps depend on, between two steps: named arrays and plain values (simulation.restore)."""
    model, clock, count, books = run.model, run.run.clock, run.run.count, run.run.books
    control = {
        "next": float(clock.next_dt), "before": float(clock.error_ratio), "wary": int(count.wary)
    }  # fmt: skip
    parts_: dict[str, Any] = {
        "ends": model.ends, "zoning": run.switching, "correction": run.correction, "payout": run.payout,
    }  # fmt: skip
    return {name: x.checkpoint() if x is not None else None for name, x in parts_.items()} | {
        "t": run.t, "dt": float(clock.last_dt), "rho": float(clock.last_rho), "steps": run.steps,
        "iterations": int(count.iterations),
        "changes": run.changes, "_turned": run.turned, "_slackened": run.slackened, "_beyond": run.beyond,
        "leg": [float(clock.leg_begin), int(count.leg_part)],
        "_stored": float(clock.stored),
        "floor": float(clock.floor), "work": books.work[0].copy(), "power": books.power[0].copy(),
        "report": books.report[:2].copy(), "tension": books.tension[0].copy(),
        "twist": books.twist[0].copy(),
        "last": float(clock.now - clock.previous), "control": control if run.controlled else None,
        "state": run.state._asdict(), "mesh": mesh_tree(model), "plane": model.plane,
        "push": run.plane_monitor.checkpoint(run.run), "home": run.plane_monitor.home,
        "lengths": [float(clock.longest), *(int(getattr(count, name)) for name in LENGTHS)],
        "self_contact": run.run.contact and run.run.contact.checkpoint(run.t),
        "torsion": {name: x.copy() for name, x in run.run.answers.items()},
        "envelope": run.envelope and run.envelope.checkpoint(books.extremes),
    }  # fmt: skip


def restore(run: Transient, saved: Mapping[str, Any]) -> None:
    """Continue as `checkpoint` has written, on a model that was made for it.

    ValueError or ResultError: that cannot be.
    """
    model, monitor, compiled = run.model, run.plane_monitor, run.run
    if saved["push"] is not None and model.plane is not None:
        monitor.speed = model.length / model.time_scale
    if saved.get("home") is not None:  # not in a checkpoint of 0.6
        monitor.home = matched(saved["home"], np.zeros((3, 3)), "home")
        model = replace(model, line=model.line._replace(plane=monitor.home))
    if run.payout is not None:
        model = run.payout.restore(saved["payout"], model)
        if run.paid_zones is not None:
            run.paid_zones.resume(model)
    state = state_for(model.line)
    run.set_model(model, state)
    complete = "report" in saved  # not in a checkpoint of 0.6
    free = dict.fromkeys(("mesh", "plane", "home", "envelope", "payout"))
    template = checkpoint(run) | free | {"report": np.full((2, REPORT_SIZE), np.inf)}
    older = {"report": compiled.books.report[:2], "tension": state.T, "last": 0.0, "_turned": False, "leg": [0.0, 0]}
    if "twist" not in saved:  # not in 0.6: outputs of the next step know of no step before
        older |= {"twist": np.zeros(2), "last": 0.0}
        saved = {name: x for name, x in saved.items() if name != "last"}
    older |= {"lengths": [0.0] + [0] * len(LENGTHS)}  # not in 0.6
    older |= {"envelope": None, "_slackened": False, "self_contact": None, "payout": None, "home": None}
    older |= {"torsion": template["torsion"], "rho": run.rho}  # not in 0.6: found anew
    report = saved.get("report")
    if isinstance(report, np.ndarray) and report.ndim == 2 and FIRST_REPORT <= report.shape[1] < REPORT_SIZE:
        saved = {**saved, "report": np.pad(report, ((0, 0), (0, REPORT_SIZE - report.shape[1])))}
    if isinstance(saved["push"], dict):
        saved = {**saved, "push": {"real": False} | saved["push"]}
    if run.correction is not None and isinstance(saved.get("correction"), dict):
        new = {"sampled": run.correction.corrector.sampled[0], "doubt": run.correction.doubt}
        older |= {"correction": new | saved["correction"]}
        saved = {name: x for name, x in saved.items() if name != "correction"}
    for name in OPTIONAL_STATE:
        if isinstance(saved.get("state"), dict) and name not in saved["state"] and not getattr(state, name).size:
            saved = {**saved, "state": {**saved["state"], name: getattr(state, name)}}
    work = saved.get("work")
    if isinstance(work, np.ndarray) and work.ndim == 1 and FIRST_WORKS <= work.size < b.WORKS:
        saved = {**saved, "work": np.pad(work, (0, b.WORKS - work.size))}
    if isinstance(saved.get("ends"), dict) and "released" not in saved["ends"]:  # not in a checkpoint of 0.6
        saved = {**saved, "ends": {**saved["ends"], "released": model.ends.released.copy()}}
    if isinstance(saved.get("zoning"), dict):
        older |= {"zoning": zoning_of_today(saved["zoning"])}
        saved = {name: x for name, x in saved.items() if name != "zoning"}
    saved = matched(older | dict(saved), template, "state")
    clock, count, books = compiled.clock, compiled.count, compiled.books
    clock.now, clock.previous = saved["t"], saved["t"] - saved["last"]
    clock.last_rho = saved["rho"]
    clock.longest = saved["lengths"][0]
    for name, number in zip(LENGTHS, saved["lengths"][1:], strict=True):
        setattr(count, name, number)
    clock.last_dt, clock.stored, clock.floor = saved["dt"], saved["_stored"], saved["floor"]
    count.steps, count.iterations = saved["steps"], saved["iterations"]
    run.changes, run.beyond = saved["changes"], saved["_beyond"]
    run.turned, run.slackened = saved["_turned"], saved["_slackened"]
    clock.mute_cuts, clock.mute_slack = float(run.turned), float(run.slackened)
    clock.leg_begin, count.leg_part = saved["leg"] if complete else (saved["t"], 0)
    books.work[0], books.power[0], books.report[:2] = saved["work"], saved["power"], saved["report"]
    books.tension[0], books.twist[0] = saved["tension"], saved["twist"]
    for mine, its in ((state, saved["state"]), (compiled.before, saved["state"])):
        for name, x in its.items():
            getattr(mine, name)[:] = x
    model.sea.roll_as(state)
    model.sea.at(run.t)
    apart = model.ends.restore(saved["ends"], run.t)
    if apart > SAME_PLACE * model.length:
        moved = f"an end is {apart:.3g} m from where it was at t = {run.t:.6g} s: has its motion file changed?"
        raise ValueError(moved)
    compiled.move(model.ends.moves())
    if run.payout is not None:
        run.payout.lengthen()
    books.velocity[:] = model.ends.velocity
    ends = model.ends.values  # outputs within the next step lie between these and those at its end
    books.imposed[0] = np.hstack([ends.position, ends.frame, ends.spin, ends.force, ends.moment])
    if saved["control"] is not None:
        _restore_control(run, saved["control"])
    for name, x in compiled.answers.items():
        x[:] = saved["torsion"][name]
    if saved["push"] is not None:
        monitor.restore(saved["push"], compiled)
    if compiled.contact is not None:
        monitor.comes_back = False
        compiled.contact.restore(saved["self_contact"], run.t)
    if run.switching is not None:
        run.switching.restore(saved["zoning"])
    if run.correction is not None:
        run.correction.restore(saved["correction"])
    count.output = np.searchsorted(books.outputs, run.t + SAME_TIME * saved["dt"], side="right")
    _restore_envelope(run, saved["envelope"])
    if not complete:
        run.evaluate_forces()
    count.phase = b.BEGIN_STEP


def zoning_of_today(saved: dict[str, Any]) -> dict[str, Any]:
    """The zones of a checkpoint, of an older version too: that had no cells that follow, or one largest curvature, or

    did not look at velocities, or said nothing of kinks.
    """
    saved = {"following": None} | saved
    following, manager, largest = saved["following"], saved.get("manager"), np.zeros(QUANTITIES)
    if isinstance(following, dict) and isinstance(following.get("peak"), float):
        largest[CURVATURE] = following["peak"]
        saved["following"] = {name: x for name, x in following.items() if name != "peak"}
    following = saved["following"]
    if isinstance(following, dict) and isinstance(following.get("calm"), np.ndarray):
        saved["following"] = {"waves": np.zeros(following["calm"].shape)} | following
    if isinstance(manager, dict):
        saved["manager"] = {"largest": largest, "fastest": 0.0, "kinked": False} | manager
    return saved


def _restore_envelope(run: Transient, saved: Mapping[str, Any] | None) -> None:
    """Extremes up to here; where the checkpoint has none they begin here, and an event says so."""
    envelope, books, nodes = run.envelope, run.run.books, run.model.nodes
    if envelope is None:
        return
    if saved is None:
        envelope.begin_at(run.t, run.model, run.state.r, run.events.event)
    else:
        envelope.restore(saved, books.extremes)
    books.start[:] = envelope.start_of(nodes)


def _restore_control(run: Transient, saved: Mapping[str, Any]) -> None:
    clock, largest = run.run.clock, max(run.resolution.step, run.resolution.later)
    clock.next_dt, clock.error_ratio = saved["next"], saved["before"]
    run.run.count.wary = saved["wary"]
    good = clock.shortest <= saved["next"] <= largest and saved["before"] > 0.0
    if not (good and 0 <= saved["wary"] <= WARY):
        raise ValueError("steps that no controller chooses")
