"""The equilibria of one scene, of any number of lines: for a result, and to compare with one."""

from __future__ import annotations

import time as clock
from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import replace
from typing import TYPE_CHECKING

from hybrid.kernels.state.state import Floats
from hybrid.model.network import NetworkResolution
from hybrid.model.resolution import Resolution, wants_survey
from hybrid.scene.root import Scene
from hybrid.scene.short_form import LINE
from hybrid.simulation.case import Case
from hybrid.simulation.layer_mesh import layered, shown
from hybrid.simulation.mesh_survey import Survey
from hybrid.simulation.network_run import NetworkRun, Recording
from hybrid.simulation.run_sample import Samples
from hybrid.simulation.static_case import StaticCase
from hybrid.store.array_recorder import Target
from hybrid.store.named_arrays import Tree
from hybrid.store.records import ERROR_ESTIMATE

if TYPE_CHECKING:  # its tables take long to make
    pass


class CaseAtRest(Case):
    """The equilibrium of one scene, computed as finely as it takes; that of a cable by its own search."""

    moves = False

    def __init__(self, scene: Scene, cable: StaticCase | None = None) -> None:
        """cable: computes the equilibria of a cable, if there is such a one."""
        super().__init__(scene, None)
        self._own = cable

    @property
    def _cable(self) -> StaticCase:
        """What computes the equilibria of a cable, of the scene as it is now."""
        if self._own is None:
            self._own = StaticCase(self.scene)
        self._own.scene = self.scene
        return self._own

    def record(self, resolution: NetworkResolution, target: Target, before: Tree | None = None) -> Samples:
        """Compute the result into a file, or memory; what is to be compared of it.  before: nobody goes on with it."""
        if self.flat:
            return {LINE: self._cable.record(resolution.one, target)}
        recording = Recording(pending=ERROR_ESTIMATE if self.wants_errors else "")
        return self._move(self._network_run(resolution, target, recording), clock.process_time(), first=True)

    def sample(
        self, resolution: NetworkResolution, points: Mapping[str, Floats] | None = None, until: float | None = None,
        *, model: bool = False,
    ) -> Samples:  # fmt: skip
        """Compute for comparison only; arguments as of `Case`."""
        if not self.flat:
            return super().sample(resolution, points, until, model=model)
        one = resolution.one
        return {LINE: self._cable.sample(replace(one, follow=True) if model else one)}

    def survey(self, resolution: NetworkResolution, coarse: NetworkResolution) -> dict[str, Survey] | None:
        """A coarse equilibrium that shows where cells should be short; None: there is none."""
        if not self.flat:
            return super().survey(resolution, coarse)
        found = self._cable.survey(resolution.one, coarse.one)
        return None if found is None else {LINE: found}

    def beside(
        self, samples: Sequence[Callable[[], Samples]]
    ) -> AbstractContextManager[Sequence[Callable[[], Samples]]]:
        """Equilibria are found one after the other."""
        return nullcontext(samples)

    def layered(self, resolution: NetworkResolution) -> NetworkResolution:
        """As of `Case`."""
        if not self.flat:
            return super().layered(resolution)
        return (
            resolution if wants_survey(self.scene) else NetworkResolution({LINE: layered(self._cable, resolution.one)})
        )

    def shown(self, resolution: NetworkResolution) -> NetworkResolution:
        """As of `Case`."""
        if not self.flat:
            return super().shown(resolution)
        return _of_cable(shown(self._cable, resolution.one))

    def _compute(self, run: NetworkRun, interrupted: Callable[[], bool]) -> None:
        run.record_equilibrium()


def _of_cable(resolution: Resolution) -> NetworkResolution:
    return NetworkResolution({LINE: resolution})
