"""Equilibrium by shooting."""

from __future__ import annotations

from hybrid.scene.root import Scene

from .guess import guesses
from .line import Line, line_of
from .newton import Outcome, Problem, Solved, homotopy, newton
from .state import ShootingState, state_of


def equilibrium(line: Line) -> Solved:
    """Try every start, first straight on, then along a homotopy; the first that converges is the answer.

    A march that drowned in its own growth will not float with another start: it ends the search.
    """
    problem = Problem(line)
    first: Solved | None = None
    for fields in guesses(line):
        for way in (newton, homotopy):
            solved = way(problem, fields)
            if solved.outcome is Outcome.OK:
                return solved
            if solved.drowned:
                return solved.demand(None)
            first = solved if first is None or solved.outcome is Outcome.ILL_CONDITIONED else first
    assert first is not None
    return first.demand(None)


def static(scene: Scene, *, marches: int | None = None) -> ShootingState:
    """Equilibrium of the scene at t = 0 (loads with an `until` are on).

    `marches`: for the figure of growth only: so many marches from the first guess, unchecked.
    Errors: SceneError for what the arbiter cannot do, ArbiterError where literal shooting dies.
    """
    line = line_of(scene)
    if marches is not None:
        return state_of(line, newton(Problem(line), next(guesses(line)), marches=marches), 0.0)
    return state_of(line, equilibrium(line), 0.0)
