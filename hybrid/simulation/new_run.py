"""A new run of a network: its start, or that of a checkpoint, and with it its lines, its parts and its file."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple
from weakref import proxy

import numpy as np

from hybrid.kernels.state.state import state_for
from hybrid.model.network import NetworkModel, NetworkResolution, build_system
from hybrid.model.plan import output_times
from hybrid.model.sections import OutputPoints
from hybrid.scene.network import Network
from hybrid.simulation.floating_watch import FloatingWatch
from hybrid.simulation.line_result import LineResult, Wanted
from hybrid.simulation.lone_planes import LonePlanes
from hybrid.simulation.own_parts import OwnParts, RunPart
from hybrid.simulation.parts import Part, Parts
from hybrid.simulation.progress import RESULT, ProgressReporter, at_once
from hybrid.simulation.restart import LoadChange, kept_resolution
from hybrid.simulation.run import First, Run
from hybrid.simulation.run_checkpoint import kept_changes
from hybrid.simulation.run_contact import RunContact
from hybrid.simulation.run_failures import Cuts, Failures
from hybrid.simulation.run_of_lines import Heard, LoadChanges, ProgressOfRun, WatchedLines, loaded_as, with_loads_of
from hybrid.simulation.run_record import Asked, RunFile, RunRecorder
from hybrid.simulation.run_zones import RunZones
from hybrid.simulation.vibration_steps import VibrationsOfLines, VibrationSteps
from hybrid.simulation.zones_at_rest import Start, managers_for, start_at_rest, zones_as_placed
from hybrid.solve.network_steps import NetworkSteps
from hybrid.solve.stepper import NetworkState
from hybrid.store.format import Target, Text
from hybrid.store.writer import AT_ONCE, WriteMode
from hybrid.zones.criteria import UserCriterion

if TYPE_CHECKING:  # what a run without winches does not load
    from hybrid.simulation.payout import PayingOut
    from hybrid.simulation.run_payout import RunPayout


class Recording(NamedTuple):
    """What there is beside a run: around it, before it and after it.

    mode: how a file is written; source: the result to go on with, from its checkpoint, in place of a start; pending:
    what is to come when it is complete (store.records); notes: events (kind, text) of the whole of the run; begun:
    called behind the first output; planes: whether lines that are joined to nothing are computed in the planes in
    which they lie; start: the first state, if it is known; points: of outputs of lines by name, None: those of
    their scenes; until: s, its end, if it comes before that of the scene; touches: whether contact begins by itself
    where lines come near themselves, else that is only noticed; asked: what the network was made of, by whose names it
    gets its file; parts: of the user's own, of which the run has copies; heard: who hears of a motion, and may end it.
    """

    mode: WriteMode = AT_ONCE
    source: Path | None = None
    pending: str = ""
    notes: Sequence[tuple[str, str]] = ()
    begun: Callable[[Run], None] | None = None
    planes: bool = False
    start: Start | None = None
    points: Mapping[str, OutputPoints] | None = None
    until: float | None = None
    touches: bool = True
    asked: Asked | None = None
    parts: Sequence[RunPart] = ()
    heard: Heard | None = None


ALONE = Recording()


def new_run(
    system: Network, target: Target | None, text: Text, moves: bool,
    resolution: NetworkResolution | None = None, recording: Recording = ALONE,
    criterion: UserCriterion | None = None, changes: Sequence[LoadChange[Network]] = (),
) -> Run:  # fmt: skip
    """A run that stands at its start, or at a checkpoint.

    target: None: the run is only to be compared with; text: the scene as YAML, or what makes it; moves: whether its
    motion is wanted, else its equilibrium under full loads; resolution: how finely, None: as the scene asks for, or the
    checkpoint says; criterion: one more for zones that move (zones.criteria); changes: loads and motions of these
    systems hold from some time on.
    """
    end = (recording.until or system.require_time().duration) if moves else 0.0
    changes = [replace(x, scene=with_loads_of(system, x.scene)) for x in changes if x.t < end]
    if recording.source is None:
        first = _at_start(system, resolution, recording.start, moves, criterion)
    else:
        first = _at_checkpoint(system, recording.source, changes, criterion)
    kept = recording.mode.before is not None and isinstance(target, Path)
    run = Run(first, _steps(first, moves, end), target, criterion, kept)
    run.changes, run.notes, run.begun = changes, recording.notes, recording.begun
    _equip(run, first, system, text, recording)
    run.recorder = run.file.begin() if recording.source is None else run.continue_file(recording.source)
    return run


def _at_start(
    system: Network, resolution: NetworkResolution | None, start: Start | None, moves: bool,
    criterion: UserCriterion | None,
) -> First:  # fmt: skip
    """The equilibrium of a system, or its lines as they are placed, unless its start is known."""
    if start is None:
        start = start_of(system, build_system(system, resolution=resolution), moves, criterion)
    state = NetworkState([x.start for x in start.model.models], start.model.body_places)
    state = (state if start.found is None else start.found.state).copy()
    scenes = system.scenes_of_lines
    return First(system, start.model, state, start.found, start.managers, [*scenes.values()], 0, False)


def _at_checkpoint(
    system: Network, source: Path, changes: Sequence[LoadChange[Network]], criterion: UserCriterion | None
) -> First:
    """Blank states of the lines of a system, which is loaded as where the checkpoint of a result is."""
    model = build_system(system, resolution=kept_resolution(system, source))
    changed = kept_changes(source, len(changes))
    scenes = system.scenes_of_lines
    managers = managers_for(scenes, model, criterion)  # as at the start, whatever loads came later
    if changed:
        system = changes[changed - 1].scene
        model = loaded_as(model, system, 0.0)
    for k, x in managers.items():
        x.load(model.models[k].ends.moments)
    state = NetworkState([state_for(x.line) for x in model.models], np.zeros_like(model.body_places))
    return First(system, model, state, None, managers, [*scenes.values()], changed, True)


def _steps(first: First, moves: bool, end: float) -> NetworkSteps:
    """The steps of a run to its end (s), 0 where nothing moves, with outputs on the way."""
    resolution = first.model.resolution
    one, times = resolution.one, list[float]()
    turn = min(x.turn for x in resolution.lines.values())
    if not moves:
        return NetworkSteps(0.0, [0.0], most_turn=turn)
    times = output_times(first.scenes[0])
    if one.every > 1:  # a run to compare with has as many times fewer
        times = [*times[one.every - 1 : -1 : one.every], times[-1]]
    if end < times[-1]:
        times = [*(t for t in times if t < end), end]
    follow = (one.step, one.shortest) if one.local is not None else (0.0, 0.0)
    return NetworkSteps(first.network.require_time().rho_inf, [0.0, *times], *follow, turn)


def _equip(run: Run, first: First, system: Network, text: Text, recording: Recording) -> None:
    """Give a run its file, its lines and its parts; system: with the loads of its start."""
    me = proxy(run)  # for parts: in a circle a run would wait for the search for garbage
    moves, named = run.moves, dict(zip(first.model.names, first.scenes, strict=True))
    parts: list[Part] = []
    payout: RunPayout | None = None
    if moves and any(x.payout is not None for x in run.model.models):
        from hybrid.simulation.run_payout import RunPayout

        payout = RunPayout(me)
        parts.append(payout)
    run.file = RunFile(me, system, named, text, recording)
    _add_lines(run, first, recording, payout.lines if payout is not None else {})
    contact = RunContact(me, recording.touches, run.target is not None)
    if recording.planes and moves:
        parts.append(LonePlanes(me, run.loop.counts, system.dimension == 2))
    shaken = zip(named.items(), run.resolution.lines.values(), strict=True)
    vibrations = {name: VibrationSteps(scene, x) for (name, scene), x in shaken}
    if moves:
        run.file.quantities.keep_ranges(run.lines)
    if first.managers and moves:
        parts.append(RunZones(me, first.managers, payout))
    if recording.parts and moves:
        called = {} if recording.asked is None else recording.asked.scene.form.names
        parts.append(OwnParts(me, recording.parts, [called.get(name, name) for name in named], payout))
    if recording.heard is not None and moves:
        parts.append(ProgressOfRun(me, recording.heard))
    parts += [
        LoadChanges(me, run.changes, first.changed),
        WatchedLines(me),
        contact,
        Cuts(me, contact, run.target is None),
        Failures(me),
    ]
    parts += [VibrationsOfLines(vibrations, run.loop.clock), run.file.quantities, run.file.rotations]
    run.parts = Parts([*parts, RunRecorder(me), FloatingWatch(me, moves)])


def _add_lines(run: Run, first: First, recording: Recording, paid: Mapping[int, PayingOut]) -> None:
    """Give a run its lines, each with what records it; paid: those that are paid out, by number."""
    points = recording.points or {}
    run.lines = []
    every = zip(run.model.names, first.scenes, run.model.models, run.state.lines, strict=True)
    for k, (name, scene, model, state) in enumerate(every):
        manager = first.managers.get(k)
        record = partial(run.file.line_rows, manager=manager) if run.target is not None else None
        wanted = Wanted(record, points.get(name))
        shown, outputs = run.file.scene_of(scene), len(run.times)
        line = LineResult(k, name, shown, model, run.found, state, outputs, wanted, paid.get(k))
        run.lines.append(line)
        line.manager = manager
    if not first.resumed:
        for line in run.lines:
            line.diagnostics.begin()


def start_of(system: Network, model: NetworkModel, moves: bool, criterion: UserCriterion | None) -> Start:
    """The first state of a system, with its zones; moves: whether a motion begins there, else it is at rest."""
    scenes = system.scenes_of_lines
    if moves and system.starts_as_placed:
        model, managers = zones_as_placed(scenes, model, criterion)
        return Start(model, None, managers)
    with at_once():
        return start_at_rest(system, scenes, model, moves, criterion)


def run_system(
    system: Network, target: Target | None, text: str, reporter: ProgressReporter,
    interrupted: Callable[[], bool], name: str = RESULT, resolution: NetworkResolution | None = None,
    recording: Recording = ALONE, criterion: UserCriterion | None = None,
    changes: Sequence[LoadChange[Network]] = (),
) -> Run:  # fmt: skip
    """Compute the motion of a system into a file with checkpoints, into memory, or (target None) to be compared with.

    name: of the pass; resolution, recording, criterion, changes: as of `new_run`.
    """
    mode = recording.mode._replace(before=recording.mode.before or {})  # it can be resumed
    recording = recording._replace(mode=mode, planes=True, heard=Heard(reporter, interrupted))
    run = new_run(system, target, text, True, resolution, recording, criterion, changes)
    reporter.begin(name, run.resolution.one)
    run.record_motion()
    return run


def static_system(
    system: Network, target: Target | None, text: Text, resolution: NetworkResolution | None = None, pending: str = ""
) -> Run:
    """Compute the equilibrium of a system under full loads; target, resolution, pending: as of `run_system`."""
    run = new_run(system, target, text, False, resolution, Recording(pending=pending))
    run.record_equilibrium()
    return run
