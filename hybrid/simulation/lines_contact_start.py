"""From when on contact between lines of a system is computed where the scene does not speak of it, and until when."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from hybrid.errors import Complaint, SceneError
from hybrid.kernels.contact.self_contact_law import OUTER
from hybrid.kernels.junctions.lines_distance import JOINT
from hybrid.kernels.laws.obstacles import cells_met, depths_in_obstacles
from hybrid.kernels.state.report import OBSTACLES, SELF_CONTACT, SELF_FRICTION
from hybrid.kernels.state.state import Line, State
from hybrid.model.build import Model
from hybrid.model.lines_contact import touching_among
from hybrid.model.self_reach import contact_bits
from hybrid.scene.schema import LineScene
from hybrid.simulation.lines_contact import PASSED, pair_text
from hybrid.simulation.lines_contact_equilibrium import crossings, energy_between
from hybrid.simulation.run_of_lines import RunOfLines
from hybrid.simulation.self_watch import deepest_text, diameters
from hybrid.solve.self_contact import SelfContact

Pair = tuple[int, int]
BEGINS = "contact begins"


def lines_near(run: RunOfLines) -> list[Pair]:
    """Lines, two each, between which contact begins now, after an event; others that are near are let pass.

    These are lines that already are in each other, or in themselves, or are pressed on each other beside what both are
    joined to: legs that leave it by a narrow angle.
    """
    found = run.watch.near() if run.watch is not None else []
    run.gather_events()  # in the order in which they happen
    begun = []
    for a, b, s, other in found:
        if not _may_begin(run, (a, b)):
            run.let_pass.add((a, b))
            continue
        begun.append((a, b))
        one, two = run.model.names[a], run.model.names[b]
        text = (
            f"lines {one} and {two} come near each other, at s = {s:.4g} m of {one} and s = {other:.4g} m of {two}: "
            "contact between them is computed from here on, and steps take longer; contact: {between: []} switches it "
            "off"
        )
        run.recorder.event(run.t, 0.0, 0.0, BEGINS, text)
    return begun


def _may_begin(run: RunOfLines, pair: Pair) -> bool:
    """Whether two lines are in each other nowhere, nor in themselves, nor touch by ends that are joined to the same.

    Ends that are held, or moved, are joined to one thing where they would touch each other.
    """
    touching = touching_among(run.system, run.model.scenes, [pair])
    assert touching is not None
    model = replace(run.model, touching=touching)
    energy, shared = energy_between(model, run.solver.lines, run.solver.bodies.copy(), run.state)
    if not math.isfinite(energy):
        return False
    joined = dict(zip(touching.lines, touching.joined.tolist(), strict=True))
    models, r = run.model.models, [x.r for x in run.state.lines]
    wide = OUTER * float(max(diameters(models[k]).max() for k in pair))
    return not any(
        a != c and joined[a][e] == joined[c][f] and (joined[a][e] or math.dist(r[a][-e], r[c][-f]) <= wide)
        for (a, i), (c, j) in shared.points_between()
        for e in _ends_beside(models[a], i)
        for f in _ends_beside(models[c], j)
    )


def _ends_beside(model: Model, node: int) -> list[int]:
    """Which ends of a line, 0 or 1, are near a node."""
    s, reach = model.line.s, JOINT * float(diameters(model).max())
    return [k for k in (0, 1) if abs(float(s[node] - s[-k])) <= reach]


def touch_each_other(run: RunOfLines, pairs: Iterable[Pair]) -> None:
    """Give a run models of which these lines touch each other, two each, and no others; its solver has to follow."""
    before, touching = run.model.touching, touching_among(run.system, run.model.scenes, pairs)
    now = touching.lines if touching is not None else ()
    models = [*run.model.models]
    for k in {*now, *(before.lines if before is not None else ())}:
        scene = run.model.scenes[run.model.names[k]]

        def change(line: Line, scene: LineScene = scene, touches: bool = k in now) -> Line:
            if touches and touching is not None:
                return touching.bits(line)
            return line._replace(bits=(line.bits & ~(SELF_CONTACT | SELF_FRICTION)) | contact_bits(scene))

        models[k] = replace(models[k], line=change(models[k].line))
        run.lines[k].follow(models[k])
        if run.zones is not None:
            run.zones.change_line(k, change)
    run.model = replace(run.model, models=tuple(models), touching=touching)


def touching_now(run: RunOfLines) -> set[Pair]:
    """Lines whose contact began by itself, two each, that touch in the state that was looked at last; a line that

    touches itself beside others, twice.
    """
    shared = run.solver.shared
    if shared is None or run.system.contact is not None:
        return set()
    return {(min(a, b), max(a, b)) for (a, _), (b, _) in shared.points_between()}


def given_up_text(run: RunOfLines, dt: float) -> str:
    """Text of the event of contact that lets no step of dt (s) lead on."""
    assert run.solver.shared is not None
    return (
        f"no step leads on with contact of lines, down to {dt:.3g} s: {pair_text(run.solver.shared, run.model)}; it is "
        "computed no longer, and they pass through each other; shorter cells there would do"
    )


def note_crossings(run: RunOfLines) -> None:
    """An event for every two lines that the search for the equilibrium has passed through each other."""
    if run.found is None:
        return
    for a, b in crossings(run.system, run.model, run.found.state):
        one, two = run.model.names[a], run.model.names[b]
        text = (
            f"lines {one} and {two} cross on the way from their first shapes to this equilibrium: no contact between "
            f"them is asked for, and none is computed in it; contact: {{between: [[{one}, {two}]]}} keeps them apart"
        )
        run.recorder.event(0.0, 0.0, 0.0, PASSED, text)


# From when on contact of a line with itself is computed, and until when, where the scene does not ask for it.

# Kind of the event of contact that is given up because no step leads on with it.
GIVEN_UP = "contact given up"


def refuse_start_in_obstacles(model: Model, state: State, key: str = "initial") -> None:
    """SceneError: a line that begins where the scene has it is deep in an obstacle; key: of its start."""
    line, sea = model.line, model.sea.at(0.0)
    if not line.bits & OBSTACLES:
        return
    met = cells_met(sea.carried, line.s) if sea.carried.size else None
    within = depths_in_obstacles(sea, state.r, line.s, met)
    which, node = (int(x) for x in np.unravel_index(np.argmax(within), within.shape))
    if within[which, node] > 1.0:
        given = f"a shape that is in obstacle {model.sea.names[which]} at s = {line.s[node]:.6g} m"
        raise SceneError([Complaint(key, given, "a start outside of obstacles", "move it, or the obstacle")])


def given_up(contact: SelfContact, model: Model, dt: float) -> tuple[float, float, str]:
    """Where, between two arc lengths (m), contact lets no step of dt (s) lead on, and the text of the event."""
    p, q = contact.deepest
    s, other = sorted((float(model.line.s[p]), float(model.line.s[q])))
    nodes = model.line.s[[p, q]]
    cells = float(model.cable.bending_length(1e-9 * model.tension_scale / model.length)[model.cable.piece(nodes)].min())
    if not cells > 0.0:
        cells = 0.5 * float(min(model.line.h[min(p, model.cells - 1)], model.line.h[min(q, model.cells - 1)]))
    where = deepest_text(contact, model) if contact.least_distance < float("inf") else ""
    text = (
        f"no step leads on with contact of the line with itself, down to {dt:.3g} s: {where}; it is not computed until "
        f"these are apart, and they may pass through each other; cells of at most {cells:.2g} m there would do"
    )
    return s, other, text
