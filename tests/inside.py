"""The only line of what is stepped from outside, from within: for tests that look where no public name leads."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

import hybrid
from hybrid.kernels.machine.compile import kernel
from hybrid.kernels.state.books import Books
from hybrid.kernels.state.state import State, Work
from hybrid.model.build import Model
from hybrid.simulation.payout import PayingOut
from hybrid.simulation.run_line import RunLine
from hybrid.simulation.run_zones import RunZones
from hybrid.solve.contact import SelfContact


@kernel
def never_due(table):
    """In place of `hybrid.simulation.cell_changes.cells_due`: cells change in Python alone."""
    return 0


def calls_of(
    monkeypatch: pytest.MonkeyPatch, owner: Any, name: str,
    note: Callable[..., Any] = lambda *_: None, after: Callable[..., Any] | None = None,
) -> list[Any]:  # fmt: skip
    """What `note` says of each call of `owner.name` before it is made as ever, or `after` of what it returned."""
    found: list[Any] = []
    goes = getattr(owner, name)

    def noted(*given: Any, **more: Any) -> Any:
        if after is None:
            found.append(note(*given))
        returned = goes(*given, **more)
        if after is not None:
            found.append(after(returned, *given))
        return returned

    monkeypatch.setattr(owner, name, noted)
    return found


class OnlyLine:
    """Model, state, books and parts of the line as they are now."""

    def __init__(self, simulation: hybrid.Simulation) -> None:
        self.run = simulation._run

    @property
    def line(self) -> RunLine:
        """What is recorded of it."""
        (line,) = self.run.lines
        return line

    @property
    def model(self) -> Model:
        """Its model."""
        return self.run.model.models[0]

    @property
    def state(self) -> State:
        """Its state."""
        return self.run.state.lines[0]

    @property
    def work(self) -> Work:
        """What steps leave."""
        return self.run.solver.work[0]

    @property
    def books(self) -> Books:
        """What steps book."""
        return self.line.books

    @property
    def paying(self) -> PayingOut:
        """How long it is."""
        assert self.line.paying is not None
        return self.line.paying

    @property
    def contact(self) -> SelfContact:
        """Contact with itself."""
        assert self.line.contact is not None
        return self.line.contact

    @property
    def zones(self) -> Any:
        """Its zones, if they move."""
        return self.zones_of_all.lines[0]

    @property
    def zones_of_all(self) -> Any:
        """The part of the run that moves them."""
        (part,) = (x for x in self.run.parts if isinstance(x, RunZones))
        return part

    @property
    def iterations(self) -> int:
        """Newton iterations of the last step."""
        return int(self.run.loop.counts.iterations)

    @property
    def steps(self) -> int:
        """Steps so far."""
        return self.run.steps

    def begin_again(self) -> None:
        """Go on with positions and velocities that were written into the state, whose energy nothing has worked for."""
        self.line.write_down()
        self.line.observer.first_energy = None  # as of the next output
        self.run.restart_steps()
