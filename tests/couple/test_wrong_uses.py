"""A hundred wrong uses of each interface: an error in words, no crash, and it goes on unchanged."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from math import inf, nan
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import hybrid
from hybrid.couple import moordyn
from tests.scenes import cable_scene, clamped_at, line_between, network_scene

DECK = Path(__file__).parents[1] / "data" / "moordyn" / "three_lines.txt"
PLACES = [40.0, 0.0, -14.0, -20.0, 34.64, -14.0, -20.0, -34.64, -14.0]
STILL = [0.0] * 9
PLACE = PLACES[:3]

NO_TIMES = [None, "x", nan, inf, -inf, -1.0, 0.0, [], [1.0], {}, object(), True, 1e300, b"a", 1 + 2j, np.zeros(3), "1.0",
            (), set(), nan * np.ones(1), np.array("a")]  # fmt: skip
NO_NAMES = ["", "middle", None, 0, 1.5, nan, [], ["line1"], {}, object(), True, b"line1", (), "LINE1", "point99", 1j,
            np.zeros(2), "line1 ", "anchor"]  # fmt: skip
NO_VECTORS = ["abc", nan, [1, 2], [1, 2, 3, 4], [1, nan, 3], [1, 2, "x"], {}, object(), np.zeros((3, 3)), [[1], [2], [3]],
              [None] * 3, [inf, 0, 0], 1.0, [1j, 0, 0], [True, {}, 0], b"abc", [], [[]], np.zeros((1, 3)), "1 2 3"]  # fmt: skip
NO_FRAMES = ["x", nan, np.zeros((3, 3)), -np.eye(3), 2 * np.eye(3), np.full((3, 3), nan), np.eye(2), [1, 2, 3], object(),
             np.diag([1, 1, -1]), {}]  # fmt: skip
NO_ENDS = ["middle", 0, None, 1, "START", [], object(), b"end"]
NO_NUMBERS = ["abc", nan, STILL[:8], [*STILL, 0.0], [nan] * 9, [inf, *STILL[1:]], {}, object(), [[], []], [None] * 9,
              ["x"] * 9, 1.0, [1j] * 9, None, b"abc", [], [{}] * 9, np.zeros((2, 9))]  # fmt: skip
NO_INDICES = [0, -1, 99, 1.0, "1", None, nan, [], [1], {}, object(), b"1", 1j, inf, 10**30, (1,), np.zeros(2), True]


def refused(uses: list[Callable[[], Any]]) -> int:
    for k, use in enumerate(uses):
        with pytest.raises(ValueError, match=r"\w+.*\w+") as caught:
            use()
        assert type(caught.value) is ValueError, f"use {k}: {caught.value!r}"
    return len(uses)


# --- one cable, and several lines ----------------------------------------------------------------


def cable(duration: float = 1.0, cells: int = 10) -> hybrid.Simulation:
    tables: dict[str, Any] = cable_scene(
        {"length": 10, "mass": 1, "axial_stiffness": 1e5, "bending_stiffness": 5}, clamped_at([0, 0, 0], [1, 0, 0]),
        "free", model="rod", mesh=cells, time=(duration, 0.05)
    )  # fmt: skip
    return hybrid.Simulation(tables)


def network(duration: float = 1.0) -> hybrid.Simulation:
    data = next(iter(hybrid.import_moordyn(DECK).scenes.values())).scene.model_dump(exclude_none=True)
    return hybrid.Simulation(data | {"time": {"duration": duration, "step": 0.05}})


def test_several_lines_have_the_verbs_of_one_cable() -> None:
    """`step` does the same of both, up to the duration; an end is a point; what is of one line asks for its name."""
    with network(0.22) as stepped, network(0.22) as advanced:
        assert [stepped.step() for _ in range(5)] == pytest.approx([0.05, 0.1, 0.15, 0.2, 0.22], abs=1e-12)
        assert [advanced.advance(t) for t in (0.05, 0.1, 0.15, 0.2, 0.22)]
        assert np.array_equal(stepped.line("line1").position, advanced.line("line1").position)
        with pytest.raises(ValueError, match="duration"):
            stepped.step()
        for of_one in (lambda: stepped.state, lambda: stepped.length, stepped.frames, stepped.forces):
            with pytest.raises(ValueError, match=r"several lines: name one, as in line\(name\)"):
                of_one()
    with pytest.raises(ValueError, match="is over"):
        stepped.step()
    places = []
    with network(0.1) as lines:
        for verb in (lines.set_point, lines.set_end):
            saved = lines.save()
            verb("point4", [PLACE[0], PLACE[1], PLACE[2] + 0.1])
            lines.step()
            places.append(lines.line("line1").position)
            lines.restore(saved)
    assert np.array_equal(places[0], places[1])


def test_a_point_of_several_lines_is_let_go() -> None:
    """By the program outside as by the scene, at the same time; the free end of one line is then pulled by a force."""
    found = []
    for broken in (False, True):
        with several(broken) as lines:
            lines.advance(0.2)
            if not broken:
                saved = lines.save()
                lines.release("b")
                lines.set_force("b", [3.0, 0.0, 0.0])
                lines.advance(0.3)
                lines.restore(saved)
                lines.release("b")
                with pytest.raises(ValueError, match=r"points\.b is not held: there is nothing to release"):
                    lines.release("b")
                with pytest.raises(ValueError, match=r"points\.b is not held: set_force acts on it"):
                    lines.set_point("b", PLACE)
            lines.advance(0.5)
            found.append(lines.line("one").position)
            assert [x.kind for x in lines.result().events].count("end released") == 1
    assert found[0] == pytest.approx(found[1], abs=1e-9)


def several(broken: bool) -> hybrid.Simulation:
    """Two ropes of their own, one of which comes off a point at 0.2 s if the scene says so."""
    rope = {"length": 3.0, "mass": 0.5, "diameter": 0.02, "axial_stiffness": 1e4, "damping": {"mass": 0.5}}
    points = {"a": [0, 0, 0], "b": [2, 0, 0], "c": [0, 1, 0], "d": [2, 1, 0]}
    tables: dict[str, Any] = network_scene(
        {name: {"position": x} for name, x in points.items()},
        {name: line_between(a, b, rope, mesh=12, model={"kind": "catenary", "slack": "warn"}) for name, a,
         b in (("one", "a", "b"), ("other", "c", "d"))},
        time=(0.5, 0.02)
    )  # fmt: skip
    if broken:
        tables["points"]["b"]["break_at"] = {"time": 0.2}
    return hybrid.Simulation(tables)


def uses_of_a_cable(s: hybrid.Simulation, other: Any) -> Iterator[Callable[[], Any]]:
    for x in NO_ENDS:
        yield lambda x=x: s.set_end(x, PLACE)
        yield lambda x=x: s.set_force(x, PLACE)
        yield lambda x=x: s.release(x)
    for x in NO_VECTORS:
        yield lambda x=x: s.set_end("start", x)
        yield lambda x=x: s.set_end("start", PLACE, x)
        yield lambda x=x: s.set_force("end", x)
        yield lambda x=x: s.set_force("end", [9.0, 0.0, 0.0], x)
    for x in NO_FRAMES:
        yield lambda x=x: s.set_end("start", PLACE, frame=x)
    yield lambda: s.set_end("end", PLACE)
    yield lambda: s.set_force("start", PLACE)
    yield lambda: s.release("end")


def uses_of_a_system(s: hybrid.Simulation, other: Any) -> Iterator[Callable[[], Any]]:
    for x in NO_NAMES:
        yield lambda x=x: s.set_point(x, PLACE)
        yield lambda x=x: s.point(x)
        yield lambda x=x: s.line(x)
        yield lambda x=x: s.forces(x)
    for x in NO_VECTORS:
        yield lambda x=x: s.set_point("point4", x)
        yield lambda x=x: s.set_point("point4", PLACE, x)


def uses_of_both(s: hybrid.Simulation, other: Any) -> Iterator[Callable[[], Any]]:
    """other: what `save` of another Simulation has returned."""
    for x in NO_TIMES:
        yield lambda x=x: s.advance(x)
    for x in [*NO_TIMES, 1, other]:
        yield lambda x=x: s.restore(x)


def places(simulation: hybrid.Simulation) -> Any:
    return next(iter(simulation.result().each_line()))[1].position[-1]


# What makes one, how it is used wrongly, and what is read of it.
BOTH = pytest.mark.parametrize(
    ("made", "uses", "read"),
    [(cable, uses_of_a_cable, lambda s: s.state), (network, uses_of_a_system, lambda s: s.point("point4"))],
    ids=["cable", "network"],
)


@BOTH
def test_wrong_uses_of_a_simulation(made: Any, uses: Any, read: Any) -> None:
    with made() as plain:
        plain.advance(0.5)
        expected = places(plain)
    with made() as asked, made() as other:
        asked.advance(0.1)
        saved = other.save()
        count = refused([*uses(asked, saved), *uses_of_both(asked, saved)])
        assert asked.t == 0.1
        asked.advance(0.5)
        assert np.array_equal(places(asked), expected)
    print(f"{count} wrong uses of Simulation")
    assert count > 100


@BOTH
def test_one_that_is_over_says_so(made: Any, uses: Any, read: Any) -> None:
    with made() as closed:
        saved = closed.save()
    of_cable = (lambda: closed.set_force("end", [0, 0, 1]), lambda: closed.release("start"))
    own = of_cable if made is cable else (lambda: closed.set_point("point4", PLACE),)
    for use in (closed.step, closed.save, lambda: closed.restore(saved), lambda: closed.advance(0.5), *own):
        with pytest.raises(ValueError, match="the simulation is over"):
            use()
    closed.close()


@BOTH
def test_two_threads_are_told_apart(made: Any, uses: Any, read: Any) -> None:
    """A second thread is refused in words, and the first goes on as alone; repeated until both have met."""
    with made(30.0) as busy, made(30.0) as alone:
        found: list[str] = []
        for k in range(1, 60):
            other = threading.Thread(target=busy.advance, args=(0.5 * k,))
            other.start()
            while other.is_alive():
                for use in (busy.save, lambda: read(busy), lambda k=k: busy.advance(0.5 * k)):
                    try:
                        use()
                    except ValueError as error:
                        found.append(str(error))
            other.join()
            assert busy.t == pytest.approx(0.5 * k)
            alone.advance(0.5 * k)
            if any("another thread" in text for text in found):
                break
        assert any("another thread" in text for text in found)
        assert np.array_equal(places(busy), places(alone))


# --- MoorDyn's functions -------------------------------------------------------------------------


def uses_of_moordyn(s: moordyn.MoorDyn) -> Iterator[Callable[[], Any]]:
    for x in NO_NUMBERS:
        yield lambda x=x: moordyn.Step(s, x, STILL, 0.0, 0.1)
        yield lambda x=x: moordyn.Step(s, PLACES, x, 0.0, 0.1)
        yield lambda x=x: moordyn.Init(s, x, STILL)
    for x in NO_TIMES:
        yield lambda x=x: moordyn.Step(s, PLACES, STILL, 0.0, x)
    for x in [None, "x", nan, inf, -inf, [], [1.0], {}, object(), True, b"a", 1j, np.zeros(3)]:
        yield lambda x=x: moordyn.Step(s, PLACES, STILL, x, 0.1)
    for x in NO_INDICES:
        yield lambda x=x: moordyn.GetLine(s, x)
        yield lambda x=x: moordyn.GetPoint(s, x)
        yield lambda x=x: moordyn.GetBody(s, x)
    for x in [-1, 21, 1.0, "1", None, nan, [], {}, object(), True, 10**30, 1j]:
        yield lambda x=x: moordyn.GetLineNodePos(moordyn.GetLine(s, 1), x)
        yield lambda x=x: moordyn.GetLineNodeVel(moordyn.GetLine(s, 1), x)
        yield lambda x=x: moordyn.GetLineNodeTen(moordyn.GetLine(s, 1), x)
        yield lambda x=x: moordyn.GetFASTtens(s, x)
        yield lambda x=x: moordyn.SetDt(s, x)


def started() -> moordyn.MoorDyn:
    made = moordyn.Create(str(DECK))
    moordyn.Init(made, PLACES, STILL)
    return made


def test_wrong_uses_of_moordyns_functions() -> None:
    plain, asked = started(), started()
    expected = moordyn.Step(plain, PLACES, STILL, 0.0, 0.1)
    count = refused(list(uses_of_moordyn(asked)))
    assert moordyn.Step(asked, PLACES, STILL, 0.0, 0.1) == expected
    assert refused([lambda: moordyn.Step(asked, PLACES, STILL, 0.0, 0.1)]) == 1  # the clock goes back
    print(f"{count} wrong uses of MoorDyn's functions")
    assert count > 100
    for each in (plain, asked):
        moordyn.Close(each)
    assert refused([lambda: moordyn.Step(asked, PLACES, STILL, 0.1, 0.1), lambda: moordyn.Close(asked),
                    lambda: moordyn.GetPointPos(moordyn.GetPoint(asked, 4))]) == 3  # fmt: skip
