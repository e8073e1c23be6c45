"""Slow crossings: where and when zones switch, against criteria computed anew from the result.

Every scene passes a criterion's 1 on the way in and its `off` on the way out; see `adapt_scenes`.  What is computed
here is from outputs at every step.  In catenaries it is what the manager weighs; in rods it misses what is between base
nodes.  Times are good to some steps, ratios to 10 %.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from adapt_scenes import (
    CELL,
    CELLS,
    COMES,
    DWELL,
    EI,
    FLOORED,
    GRAVITY,
    LENGTH,
    OFF,
    SCENES,
    bend,
    bending,
    breathing,
    bump,
    changes,
    comes,
    easing,
    goes,
    kink,
    kinking,
    lowering,
    nodding,
    output_at,
    ran,
    rods,
    sagging,
    slack,
    swapped,
    tensions,
    turning,
)
from problems import Scene

import hybrid
from hybrid.kernels.mesh.zone_step import LOOKAHEAD
from hybrid.zones.manager import BUFFER, spread

Floats = np.ndarray
DT = 0.02


def cells_of(node_ratio: Floats) -> Floats:
    """(nt, n) from (nt, n+1)."""
    return np.maximum(node_ratio[:, :-1], node_ratio[:, 1:])


def ratios(result: hybrid.Result, name: str, most: bool = True) -> dict[str, Floats]:
    """Criteria (nt, n) of one of the scenes; at a clump within a rod what is weighed lies between two: least and most."""
    tolerance = {"slack": 1.0, "deep": 0.4, "bend": 0.0444, "point": 0.06, "clamp": 0.015, "edge": 0.016}[name]
    mass = {"point": 0.1, "clamp": 0.2}.get(name, 1.0)
    floor = FLOORED * mass ** (2 / 3)
    node = bend(result, tolerance, floor)
    out = {"slack": slack(result, floor), "point": np.zeros((len(result.times), CELLS))}
    if name == "point":
        middle = CELLS // 2
        rod = np.array([any(a < 5.0 < b for a, b in rods(result, k)) for k in range(len(result.times))])
        node[:, middle] *= rod * (1.0 if most else 0.5)
        out["point"][:, middle - 1 : middle + 1] = (~rod * kink(result, tolerance, middle, floor))[:, None]
    return out | {"bend": cells_of(node)}


def flags_of(stretches: list[tuple[float, float]]) -> Floats:
    """(n,) bool."""
    out = np.zeros(CELLS, bool)
    for a, b in stretches:
        out[round(a / CELL) : round(b / CELL)] = True
    return out


def buffers(result: hybrid.Result, output: int) -> Floats:
    """(n,) m."""
    lam = np.sqrt(EI / np.maximum(tensions(result)[output], FLOORED))
    return BUFFER * np.minimum(lam, np.cbrt(EI / GRAVITY))


# --- on -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["slack", "bend", "point"])
def test_on(name):
    """No earlier than something asks, and no later; there, and no further than the buffer and the shortest zone."""
    result = ran(name)
    first = comes(result)[0]
    k = output_at(result, first.t)
    all_ = ratios(result, name)
    loud = np.max(list(all_.values()), axis=0)
    assert rods(result, 0) == []
    assert (loud[:k] <= 1.0 + 1e-6).all()
    assert first.text.startswith(name), first.text
    at = all_[name][k - 1 : k]  # a step before; a step goes on by some %
    if name == "slack":  # what is weighed is the tension ahead: to the digits in a catenary
        T = tensions(result)[:k].min(axis=1)
        T = np.append(T, 2 * T[-1] - T[-2])  # at the step of the switch, where outputs show the new cells
        weighed = FLOORED / (T[1:] + LOOKAHEAD * DWELL / DT * np.minimum(np.diff(T), 0.0))
        assert (weighed[:-1] <= 1.0 + 1e-6).all() and weighed[-1] > 0.9
    assert at.max() > 0.9 or name == "slack"
    assert all_[name][k - 1].max() == loud[k - 1].max()  # no other was nearer
    hot = np.flatnonzero(at.max(axis=0) > 0.98 * at.max())
    asked = np.zeros(CELLS, bool)
    asked[hot] = True
    near = np.flatnonzero(spread(asked, np.linspace(0, LENGTH, CELLS + 1), buffers(result, k - 1)))
    # a node counts for the cells on both sides, and round-off for one more
    assert (near[0] - 2.01) * CELL <= first.s_a <= (near[0] + 1.01) * CELL
    assert near[-1] * CELL - 0.01 <= first.s_b <= (near[-1] + 3.01) * CELL


# --- off ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["slack", "bend", "point"])
def test_off(name):
    """A rod goes when it has been calm for dwell, and soon after: blending takes a dwell at most, a review an eighth.

    While bending goes the cable moves, and a cell that holds for a moment keeps its neighbours: half a dwell more.
    """
    result = ran(name)
    least, most = (np.max([x / OFF[k] for k, x in ratios(result, name, m).items()], axis=0) for m in (False, True))
    merges = goes(result)
    for e in merges:
        j = slice(round(e.s_a / CELL), round(e.s_b / CELL))
        # while bending goes, which takes a dwell at most, it may be anything below 1 again
        during = (result.times > e.t - DWELL + 1e-9) & (result.times < e.t - 1e-9)
        assert (least[during, j] < 1 / OFF["bend"]).all(), e
        assert (least[during, j] < 1.1).any(), e
    is_rod = np.array([flags_of(rods(result, k)) for k in range(len(result.times))])
    last = [result.times[np.flatnonzero((x * is_rod).max(axis=1) > 1.0)[-1]] for x in (least, most)]
    assert merges[-1].t - last[0] >= DWELL - 2 * DT
    assert merges[-1].t - last[1] <= 2.6 * DWELL + 2 * DT
    assert rods(result, -1) == []


def told(what: Scene) -> hybrid.Result:
    """The run with its criteria as fields: the largest at every step."""
    text = what.model_dump(exclude_none=True)
    text["output"]["criteria"] = True
    return hybrid.run(Scene.model_validate(text))


@pytest.mark.parametrize("name", ["clamp", "edge", "torsion"])
def test_off_as_the_manager_saw_it(name, tmp_path):
    """On when the criterion passes 1; off a dwell after all criteria are below their `off`, and blended out.

    A clamp that nods and comes back, a cable that is laid down and lifted, a clamp that is rolled and rolled back.
    """
    if name == "edge":
        result = told(lowering())
    else:
        text = (nodding() if name == "clamp" else turning(model={})).model_dump(exclude_none=True)
        end, column, height = ("start", "rz", 20.0) if name == "clamp" else ("end", "rx", 720.0)
        file = bump(tmp_path / "motion.csv", column, height, 4.0, 8.0)
        text["ends"][end]["motion"] = {"file": file}
        text["time"]["duration"] = 8.0
        result = told(Scene.model_validate(text))
    came, gone = comes(result), goes(result)
    asked = ("edge", "bend") if name == "edge" else (name,)  # the line beside an edge bends as much
    assert came[0].criterion in asked and all(e.value <= e.threshold for e in gone)
    ratio = result[f"criteria/{came[0].criterion}"].max(axis=1)
    assert came[0].t == pytest.approx(result.times[np.flatnonzero(ratio > 1.0)[0]], abs=2 * DT)
    loud = np.max([result[f"criteria/{k}"] / off for k, off in OFF.items()], axis=0)
    is_rod = np.array([flags_of(rods(result, k)) for k in range(len(result.times))])
    held = np.maximum(loud[:, :-1:2], loud[:, 2::2]) * is_rod  # in the base cells that are rod
    before = result.times < gone[-1].t - DWELL  # while bending goes, ratios may rise again, to twice that
    last = result.times[np.flatnonzero((held.max(axis=1) > 1.0) & before)[-1]]
    assert 2 * DWELL - 4 * DT <= gone[-1].t - last <= 2.6 * DWELL + 2 * DT
    assert rods(result, -1) == []


@pytest.mark.parametrize("name", SCENES)
def test_every_event_says_why(name):
    events = changes(ran(name))
    for e in comes(ran(name)):
        assert (
            e.text == "closes a gap"
            or e.kind == "retry"
            or (e.value > e.threshold == 1.0 and e.text.startswith(e.criterion))
        )
    for e in goes(ran(name)):
        assert e.value < 1.0 and e.threshold == OFF[e.criterion] and e.criterion in e.text
    booked = sum(e.energy for e in events)
    assert np.isfinite(booked) and (booked != 0.0 or not events or name == "slack")  # which is straight


@pytest.mark.parametrize("name", SCENES)
def test_zones_are_what_events_say(name):
    """Zones at every output are those at the start with all splits and merges since."""
    result = ran(name)
    flags = flags_of(rods(result, 0))
    events = changes(result)
    for k, t in enumerate(result.times):
        while events and events[0].t <= t + 1e-9:
            e = events.pop(0)
            a, b = round(e.s_a / CELL), round(e.s_b / CELL)
            assert not (flags[a:b] == (e.kind in COMES)).all(), e
            flags[a:b] = e.kind in COMES
        assert (flags_of(rods(result, k)) == flags).all(), t
    assert not events


# --- what is asked of the whole ---------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["deep", "bend", "point"])
def test_no_further_from_the_rod_than_the_tolerance(name):
    """Against the rod of full length: what leaving bending out costs stays below what the scene allows."""
    allowed = {"deep": 0.4, "bend": 0.0444, "point": 0.06}[name]
    apart = np.linalg.norm(ran(name).position - ran(name, "rod").position, axis=2)
    assert apart.max() < allowed
    assert apart.max() > 1e-4  # and it is a hybrid


@pytest.mark.parametrize("name", ["deep", "bend"])
def test_a_rod_grows_no_further_than_the_motion_asks(name):
    """Rods are never wider than what asks in the fully flexible or the fully stiff cable, with buffer and 3 cells.

    What a switch sets ringing, and the kinks at moment-free joints, must not make the next cells ask.
    """
    wide = [1e9, -1e9]
    for kind in ("rod", "catenary"):
        result = ran(name, kind)
        loud = np.max(list(ratios(result, name).values()), axis=0)
        for k in np.flatnonzero((loud > 1.0).any(axis=1)):
            near = np.flatnonzero(spread(loud[k] > 1.0, np.linspace(0, LENGTH, CELLS + 1), buffers(result, k)))
            wide = [min(wide[0], near[0] * CELL), max(wide[1], (near[-1] + 1) * CELL)]
    result = ran(name)
    ever = [x for k in range(len(result.times)) for x in rods(result, k)]
    assert min(a for a, _ in ever) >= wide[0] - 3.01 * CELL
    assert max(b for _, b in ever) <= wide[1] + 3.01 * CELL


def test_a_stress_wave_is_no_slack():
    """A clump's corner becomes a bend in a taut cable: nothing is near the floor, so nothing but the corner asks."""
    asked = {e.text.split()[0] for e in comes(ran("point"))}
    assert asked <= {"point", "bend", "closes"}, asked
    assert tensions(ran("point", "rod")).min() > 10.0  # the floor is 0.9 N


@pytest.mark.parametrize("name", SCENES)
def test_counted_from_the_other_end(name):
    """The same scene with its ends swapped: the same events at mirrored places, the same tensions."""
    one, other = ran(name), hybrid.run(swapped(SCENES[name]()))
    switches = [changes(x) for x in (one, other)]
    straight = sorted((round(e.t, 6), e.kind, round(e.s_a, 6), round(e.s_b, 6)) for e in switches[0])
    mirrored = sorted((round(e.t, 6), e.kind, round(LENGTH - e.s_b, 6), round(LENGTH - e.s_a, 6)) for e in switches[1])
    assert [x[:2] for x in mirrored] == [x[:2] for x in straight]
    assert [x[2:] for x in mirrored] == [x[2:] for x in straight]
    # in the middles of base cells: at a joint or a clump an output shows the side before it
    assert np.abs(tensions(other)[:, ::-1] - tensions(one)).max() < 1e-6 * np.abs(tensions(one)).max()


def fixed(what: Scene, model: str, nodes: Floats) -> hybrid.Result:
    text = what.model_dump(exclude_none=True)
    return hybrid.run(Scene.model_validate(text | {"model": {"kind": model}, "mesh": {"nodes": nodes.tolist()}}))


def assert_same(one: hybrid.Result, other: hybrid.Result) -> None:
    """Newton stops at 1e-9 of a turn or of the tension; what is left of that after hundreds of steps is damped."""
    assert np.abs(one.position - other.position).max() < 1e-7 * LENGTH
    assert np.abs(one.tension - other.tension).max() < 1e-6 * np.abs(other.tension).max()
    assert np.abs(one["energy/kinetic"] - other["energy/kinetic"]).max() < 1e-6 * other["energy/kinetic"].max()
    assert not changes(one)
    assert not one["work/zones"].any()


BASE = np.linspace(0, LENGTH, CELLS + 1)


def far_from_all() -> Scene:
    """Taut enough for no criterion at the largest tolerance there is."""
    return breathing(9.0, 7.5, {"tolerance": 0.1})


@pytest.mark.parametrize("how", ["always catenary", "tolerant"])
def test_nothing_asks_is_a_catenary(how):
    scene: Callable[..., Scene] = bending if how == "always catenary" else far_from_all
    what = scene(model={"force_catenary": [[0, LENGTH]]}) if how == "always catenary" else scene()
    assert_same(hybrid.run(what), fixed(what, "catenary", BASE))


@pytest.mark.parametrize("how", ["always rod", "intolerant"])
def test_everything_asks_is_a_rod(how):
    what = sagging(model={"force_rod": [[0, LENGTH]]} if how == "always rod" else {"tolerance": 1e-9})
    result = hybrid.run(what)
    assert all(rods(result, k) == [(0.0, LENGTH)] for k in range(len(result.times)))
    assert_same(result, fixed(what, "rod", BASE))


def test_rods_that_come_and_go_have_no_rotary_inertia_of_a_diameter():
    """What a diameter implies is left out, from the beginning: all rod has none either."""
    what = sagging(model={"force_rod": [[0, LENGTH]]}, diameter=0.2)
    assert_same(hybrid.run(what), fixed(sagging(rotary_inertia=0, diameter=0.2), "rod", BASE))
    plan = {x.what: x for x in hybrid.plan(what).contents}
    assert not plan["rotary inertia"].on and "come and go" in plan["rotary inertia"].why


def test_what_the_scene_gives_is_so():
    """force_rod in a cable that asks for nothing, force_catenary where it bends: at every output, to the base cell."""
    result = hybrid.run(bending(model={"force_rod": [[1.0, 2.0]], "force_catenary": [[4.0, 4.6]]}))
    assert comes(result)
    for k in range(len(result.times)):
        flags = flags_of(rods(result, k))
        assert flags[5:10].all() and not flags[20:23].any()


@pytest.mark.parametrize(
    "scene, nearer", [(bending, 0.45), (sagging, 0.45), (kinking, 0.81)], ids=["bend", "deep", "point"]
)
def test_at_rest_nothing_happens(scene, nearer):
    """A cable that hangs still, partly a rod, keeps the zones of its equilibrium."""
    what = scene().model_dump(exclude_none=True)
    del what["ends"]["start"]["motion"], what["ends"]["end"]["motion"]
    x, y, z = what["ends"]["end"]["position"]
    what["ends"]["end"]["position"] = (nearer * x, y, z)
    what["time"]["duration"] = 1.0
    result = hybrid.run(Scene.model_validate(what))
    assert rods(result, 0) not in ([], [(0.0, LENGTH)])
    assert not changes(result)
    assert np.abs(result["work/zones"]).max() < 1e-12
    assert np.abs(result.position - result.position[0]).max() < 1e-6


@pytest.mark.parametrize("period, step", [(1.0, 0.02), (0.6, 0.02), (1.0, 0.05)])
def test_no_catenary_is_ever_slack(period, step):
    """Thrown together in half a second: every cell is a rod before it loses its tension, or the step is repeated so."""
    result = hybrid.run(breathing(5.0, 2.2, {"tolerance": 0.1}, period=period, duration=2 * period, step=step))
    assert comes(result)
    T = tensions(result)
    for k in range(len(result.times)):
        assert (T[k] > 0.0)[~flags_of(rods(result, k))].all(), result.times[k]
    assert T.min() < 0.0  # some rods are pressed: it was no idle question


@pytest.mark.parametrize("normal", [(0, 1, 0), (0, -1, 0), (0, 0.6, 0.8), (0, 0, -1)])
def test_a_rod_may_begin_at_any_clamp(normal):
    """A plane cable goes slack at its clamp: no torque, whichever way the clamp's first director points.

    A rod whose frames are not carried on from the clamp's begins twisted against it: by half a turn, which has no
    direction at all, for one of these.  Before a first step it may be so, with a thousandth of its stiffness: 1 % of the
    bending moment of 5 N m.
    """
    result = hybrid.run(easing(normal))
    assert any(e.s_a == 0.0 for e in comes(result))
    assert np.abs(result.torque).max() < 0.05
    assert np.abs(result.torque).max(axis=(1))[-1] < 1e-6


def test_a_clamp_that_nods_and_a_cable_that_does_not_care():
    """Within a tolerance that allows the bend at the clamp, nothing switches: the catenary is what is asked for."""
    result = hybrid.run(nodding(model={"tolerance": 0.01}))
    assert rods(result, 0) == [] and not comes(result)
