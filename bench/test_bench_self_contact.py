"""Contact of a line with itself: random throws, and what searching and solving cost.

    pytest bench/test_bench_self_contact.py -m bench -s

Processor time of this process; ratios are taken within one run.
"""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np
import pytest

import hybrid
from hybrid.kernels.contact.self_contact import contact_task
from hybrid.kernels.march.energies import Observed, observe
from hybrid.kernels.step.line_step import ACCEPT, ASKED, COUPLE, JUDGE, PREDICT, SAFE_PART
from tests.inside import OnlyLine

pytestmark = pytest.mark.bench
STIFF = 0.1  # N m2
THROWS = 1000


def hairpin(angle: float, gap: float, chord: float) -> np.ndarray:
    """Nodes (N+1, 3) m of a line whose two straight legs cross at an angle (deg), a gap (m) apart, and a bow."""
    a, x = np.radians(angle), np.linspace(-0.5, 0.5, 25)
    first = np.column_stack([x, 0.0 * x, 0.0 * x])
    second = np.column_stack([-x * np.cos(a), -x * np.sin(a), 0.0 * x + gap])
    leave, arrive = (p / np.linalg.norm(p) for p in (first[1] - first[0], second[1] - second[0]))
    u = np.linspace(0.0, 1.0, 60)[1:-1, None]
    way = 3.0 * np.linalg.norm(second[0] - first[-1]) + 1.2
    bow = (2 * u**3 - 3 * u**2 + 1) * first[-1] + (3 * u**2 - 2 * u**3) * second[0]
    bow += way * ((u**3 - 2 * u**2 + u) * leave + (u**3 - u**2) * arrive)
    r = np.vstack([first, bow, second])
    s = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(r, axis=0), axis=1)))
    at = np.linspace(0.0, s[-1], round(s[-1] / chord) + 1)
    return np.column_stack([np.interp(at, s, r[:, k]) for k in range(3)])


def flying(r: np.ndarray, width: float, step: float, duration: float, friction: float, rho: float) -> hybrid.Simulation:
    """A line with nodes at r, m, that nothing holds."""
    s = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(r, axis=0), axis=1)))
    section = {
        "length": float(s[-1]), "mass": 0.4, "diameter": width, "bending_stiffness": STIFF, "axial_stiffness": 2e5,
        "torsional_stiffness": 0.8 * STIFF,
    }  # fmt: skip
    return hybrid.Simulation(hybrid.validate_scene({
        "environment": {"gravity": 1e-15}, "cable": {"sections": [section]},
        "contact": {"self": True, "friction": friction},
        "ends": {"start": {"kind": "free"}, "end": {"kind": "free"}}, "model": "rod", "mesh": {"nodes": s.tolist()},
        "initial": {"kind": "points", "points": r.tolist()}, "dimension": 3,
        "time": {"duration": duration, "step": step, "rho_inf": rho}, "output": {"every": 2.0 * duration, "points": 5},
    }))  # fmt: skip


def energy(line: OnlyLine) -> float:
    """Kinetic, elastic and contact energy, with that of travels, J."""
    x, model, parts = line.state, line.model, np.zeros(5)
    room = np.zeros((x.T.size + 1, 3))
    observe(model.line, model.ends.values, x.e, x.v, x.a1, x.w, x.T, x.turn, Observed(room, room.copy(), parts))
    numbers = line.contact.contact.numbers
    return float(parts.sum() + numbers.energy + numbers.tried)


def ring(chord: float, radius: float = 0.4) -> tuple[np.ndarray, np.ndarray]:
    """Nodes (N+1, 3) m of an open ring in the plane y = 0, and velocities that flatten it to 1 m/s without stretching it.

    What is left of the flattening at the nodes is taken from chord to chord, so that none is stretched.
    """
    turn = np.linspace(0.05, 2.0 * np.pi - 0.05, round(2.0 * np.pi * radius / chord))
    out, along = np.column_stack([np.cos(turn), 0.0 * turn, np.sin(turn)]), np.zeros((turn.size, 3))
    along[:, 0], along[:, 2] = -np.sin(turn), np.cos(turn)
    r = radius * out
    v = 0.5 * (np.cos(2.0 * turn)[:, None] * out - 0.5 * np.sin(2.0 * turn)[:, None] * along)
    d = np.diff(r, axis=0)
    d /= np.linalg.norm(d, axis=1)[:, None]
    change = np.diff(v, axis=0)
    change -= (change * d).sum(axis=1)[:, None] * d
    return r, v[0] + np.vstack([np.zeros(3), np.cumsum(change, axis=0)])


def throw(seed: int) -> dict[str, float]:
    """One throw: an even seed flattens a ring in its plane, an odd one throws legs that cross; every third is smooth."""
    random = np.random.default_rng(seed)
    width, speed = random.uniform(0.01, 0.04), float(np.exp(random.uniform(np.log(2.0), np.log(20.0))))
    steps, friction = random.uniform(1.0, 10.0), 0.0 if seed % 3 == 0 else random.uniform(0.05, 0.8)
    r, v = ring(0.025)
    if seed % 2:
        r = hairpin(random.uniform(15.0, 90.0), 3.0 * width, 0.025)
        v = np.zeros_like(r)
        v[:, 2] = -0.5 - 0.5 * np.tanh(np.linspace(-1.0, 1.0, len(r)) / 0.15)
    step, duration = steps * width / speed, 60.0 * width / speed * max(1.0, 0.5 * steps)
    simulation = flying(r, width, step, duration, friction, 0.9 if seed % 2 else 0.5)
    line = OnlyLine(simulation)
    line.state.v[:] = v * speed
    line.state.v[:] += 0.05 * speed * random.normal(size=3) * [1.0, seed % 2, 1.0]
    line.begin_again()
    mass = line.model.line.mass[:, None]
    momentum, first, most, touched = (mass * line.state.v).sum(axis=0), energy(line), 0.0, False
    contact = line.contact
    while simulation.t < duration * (1.0 - 1e-9):
        simulation.advance(min(simulation.t + step, duration))
        most = max(most, energy(line))
        touched |= contact.contact.counts.points > 0
    touched |= float(line.line.envelope.itself.itself.found.least_distance) < 1.03 * width
    moved = np.abs((mass * line.state.v).sum(axis=0) - momentum).max() / (mass.sum() * speed)
    return {
        "touched": float(touched), "energy": most / first, "momentum": float(moved), "steps": line.steps / (duration / step),
        "space": float(seed % 2), "distance": float(line.line.envelope.itself.itself.found.least_distance) / width,
    }  # fmt: skip


def test_throws() -> None:
    """1000 throws with speeds of 2 to 20 m/s, diameters of 1 to 4 cm, in steps in which a strand could pass 1 to 10 of them.

    No energy above 1.001 of the start at the end of any step, near contact or in free flight.
    The least distance is that of polygons on straight ways within steps: above 0 nothing has passed through.
    """
    found: list[dict[str, float]] = []
    failed: list[tuple[int, str]] = []
    begin = time.process_time()
    for seed in range(THROWS):
        try:
            found.append(throw(seed) | {"seed": float(seed)})
        except hybrid.ComputationError as error:
            failed.append((seed, str(error).splitlines()[0]))
    values = {name: np.array([x[name] for x in found]) for name in found[0]}
    print(f"\n{THROWS} throws in {time.process_time() - begin:.0f} s, {values['touched'].mean():.1%} touched, ", end="")
    print(f"{len(failed)} failed {failed[:5]}")
    for name, chosen in (("space", values["space"] > 0), ("the plane", values["space"] == 0)):
        energy = values["energy"][chosen]
        print(
            f"in {name}: {(energy <= 1.001).sum()} of {energy.size} at most 1.001 of the start, largest {energy.max():.5f}"
        )
    print(f"above: seeds {values['seed'][values['energy'] > 1.001].astype(int).tolist()}")
    steps = values["steps"]
    print(
        f"momentum {values['momentum'].max():.1e}; steps {np.median(steps):.2f} of those asked (median), {steps.mean():.2f} on average"
    )
    touched = values["distance"][values["touched"] > 0.0]
    print(f"least distance {touched.min():.3f} D, 1 % {np.percentile(touched, 1):.3f}, median {np.median(touched):.3f}")
    assert not failed and values["touched"].mean() > 0.8
    assert values["energy"].max() <= 1.001
    assert values["momentum"].max() < 1e-13
    assert touched.min() > 0.0


def hanging(cells: int, span: float) -> hybrid.Simulation:
    """A rod of 5 cm cells between two ends, one of which sways, with contact that it never comes to; span: of length."""
    length = 0.05 * cells
    section = {
        "length": length, "mass": 2.0, "diameter": 0.02, "axial_stiffness": 1e6, "bending_stiffness": 10.0,
        "torsional_stiffness": 8.0,
    }  # fmt: skip
    sway = {"sway": {"amplitude": 1.0, "period": 8.0}, "ramp": 0.5}
    return hybrid.Simulation(hybrid.validate_scene({
        "environment": {"gravity": 9.81}, "cable": {"sections": [section]}, "contact": {"self": True},
        "ends": {"start": {"kind": "pinned", "position": [0, 0, 0]},
                 "end": {"kind": "pinned", "position": [span * length, 0, 0], "motion": sway}},
        "initial": "equilibrium", "model": "rod", "mesh": {"cells": cells}, "dimension": 3,
        "time": {"duration": 40.0, "step": 0.02}, "output": {"every": 1000.0, "points": 5},
    }))  # fmt: skip


def coil(cells: int) -> hybrid.Simulation:
    """A helix of 2.5 cm cells that falls: turns of 1 m diameter, 10 cm apart, of a cable of 2 cm."""
    s = 0.025 * np.arange(cells + 1)
    turn = s / np.hypot(0.5, 0.1 / (2.0 * np.pi))
    r = np.column_stack([0.5 * np.cos(turn), 0.5 * np.sin(turn), 0.1 * turn / (2.0 * np.pi)])
    return flying(r, 0.02, 0.001, 10.0, 0.0, 0.5)


@pytest.mark.parametrize("shape", ["hanging", "slack", "coil"])
def test_search_for_contact_that_is_not_there(shape: str) -> None:
    """What a step spends on it, beside the whole step: the calls that a step makes, repeated at its end.

    The energy balance of the step, which is no search, is told beside it; both together are asked to stay below 5 %.
    """
    print(
        f"\n{shape}: cells, step (us), Newton iterations, search for contact (us), % of the step, of its energy balance"
    )
    for cells in (200, 1000, 5000, 20_000):
        simulation = coil(cells) if shape == "coil" else hanging(cells, 0.8 if shape == "hanging" else 0.2)
        step = simulation.scene.time.step
        simulation.advance(3.0 * step)
        line = OnlyLine(simulation)
        contact, count = line.contact, max(5, 20_000 // cells)
        spent, solves = [], 0
        for _ in range(10):
            simulation.advance(simulation.t + step)
            solves += line.iterations
        each = solves / 10.0
        for _ in range(3):
            before, begin = line.steps, time.process_time()
            simulation.advance(simulation.t + count * step)
            whole = (time.process_time() - begin) / (line.steps - before)
            assert contact.contact.counts.points == 0
            found, balance = 0.0, 0.0
            for what, times in ((PREDICT, 1.0), (COUPLE, each), (SAFE_PART, each), (ACCEPT, 1.0), (JUDGE, 0.0)):
                contact.call[ASKED], begin = what, time.process_time()
                for _ in range(10 * count):
                    contact_task(contact._table)
                balance = (time.process_time() - begin) / (10 * count)  # of the last, which is no search
                found += times * balance
            spent.append((found / whole, whole, found, balance / whole))
        share, whole, found, balance = sorted(spent)[1]
        print(
            f"{cells:6} {1e6 * whole:9.0f} {each:5.2f} {1e6 * found:8.1f} {100.0 * share:6.2f} % {100.0 * balance:6.2f} %"
        )
        assert share + balance < 0.05


def approaching(cells: int) -> hybrid.Simulation:
    """examples/plectoneme.yaml with cells of 1 cm: its torque and speed, as long as the cells make it."""
    scene = hybrid.load_scene(Path(__file__).parents[1] / "examples" / "plectoneme.yaml").model_dump(
        exclude_unset=True, by_alias=True
    )
    length = 0.01 * cells
    scene["cable"]["sections"][0]["length"] = length
    scene["ends"]["end"] |= {"position": [length + 0.002, 0.0, 0.0], "turns": 4.0 * length}
    scene["mesh"] = {"cells": cells}
    return hybrid.Simulation(hybrid.validate_scene(scene))


def test_cost_of_contact() -> None:
    """Two strands wound around each other: CPU time of a Newton iteration, with about 50 nodes in contact.

    At most 1.5 ms with 200 cells; of longer lines at most in proportion to their cells, within what CPU times scatter.
    """
    print("\ncells, nodes in contact, points of contact, iterations of a step, ms of an iteration")
    found = []
    for cells in (200, 400, 800):
        simulation = approaching(cells)
        line, step = OnlyLine(simulation), simulation.scene.time.step
        counts = line.contact.contact.counts
        while counts.nodes < 48:
            simulation.advance(simulation.t + step)
        spent = []
        for _ in range(5):
            solves, steps, begin = 0, line.steps, time.process_time()
            for _ in range(6):
                simulation.advance(simulation.t + step)
                solves += line.iterations
            spent.append((time.process_time() - begin) / solves * 6.0 / (line.steps - steps))
        each = 1e3 * float(np.median(spent))
        found.append(each)
        print(f"{cells:6} {counts.nodes:4} {counts.points:5} {solves / 6.0:6.2f} {each:8.3f}")
    assert found[0] < 1.5
    assert found[1] < 2.2 * found[0] and found[2] < 4.4 * found[0]
