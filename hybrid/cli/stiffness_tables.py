"""What `hybrid static --stiffness` and `--offsets` print."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import numpy as np

import hybrid
from hybrid.errors import Complaint, SceneError

if TYPE_CHECKING:
    from hybrid.cli.console import Console

COUNT = 11  # offsets from one side to the other
NAMES = ("x", "y", "z", "roll", "pitch", "yaw")


def check_holding(asked: Any, stiffness: str | None, offsets: str | None, reach: float | None, heading: float) -> None:
    """SceneError where what is asked cannot be had, before anything is computed."""
    if reach is not None and offsets is None:
        raise SceneError([Complaint("--reach", f"{reach:g}", "a point or body to shift", "--offsets point:NAME")])
    given = {name: at for name, at in (("--stiffness", stiffness), ("--offsets", offsets)) if at is not None}
    if given:
        from hybrid.scene.short_form import network_of
        from hybrid.simulation.lines_stiffness import target_of

        for at in given.values():
            target_of(network_of(asked), at)
    if offsets is not None:
        if reach is None:
            fix = "add --reach 20 (m), the largest offset to either side"
            raise SceneError([Complaint("--offsets", offsets, "how far", fix)])
        if not 0.0 < reach < np.inf:
            raise SceneError([Complaint("--reach", f"{reach:g}", "a length > 0, in m", "--reach 20")])
        if not np.isfinite(heading):
            raise SceneError([Complaint("--heading", f"{heading:g}", "an angle in deg", "--heading 90")])


def show_holding(
    console: Console, asked: Any, stiffness: str | None, offsets: str | None, reach: float | None, heading: float,
) -> None:  # fmt: skip
    """Print the stiffness at a point or body, and the forces on one that is held beside its equilibrium."""
    if stiffness is not None:
        found = hybrid.stiffness(asked, stiffness)
        facts = {
            key: value.tolist() if isinstance(value, np.ndarray) else value for key, value in asdict(found).items()
        }
        console.json("stiffness", **facts)
        units = "N/m" if len(found.matrix) == 3 else "N/m, N/rad, N m/m, N m/rad"
        console.show(lambda: _matrix(f"stiffness at {found.at} ({units})", found.matrix))
        if not np.array_equal(found.matrix, found.lines):
            console.show(lambda: _matrix("of it, by the lines", found.lines))
    if offsets is not None and reach is not None:
        curve = hybrid.offsets(asked, offsets, np.linspace(-reach, reach, COUNT).tolist(), heading)
        console.json(
            "offsets", at=curve.at, heading=curve.heading, distance=curve.distance.tolist(),
            force=curve.force.tolist(), moment=None if curve.moment is None else curve.moment.tolist(),
            restoring=curve.restoring.tolist(), tension={k: v.tolist() for k, v in curve.tension.items()},
        )  # fmt: skip
        console.show(lambda: _curve(curve))


def _matrix(title: str, matrix: Any) -> Any:
    from rich.table import Table

    table = Table(title=title, title_justify="left", box=None, padding=(0, 2), min_width=len(title))
    size, big = len(matrix), np.abs(matrix).max(initial=0.0)
    for name in ("", *NAMES[:size]):
        table.add_column(name, justify="right")
    for name, row in zip(NAMES, matrix, strict=False):
        table.add_row(name, *(f"{x if abs(x) > 1e-9 * big else 0.0:.5g}" for x in row))
    return table


def _curve(curve: Any) -> Any:
    from rich.table import Table

    title = f"{curve.at} held at offsets along {curve.heading:g} deg, without friction"
    table = Table(title=title, title_justify="left", box=None, padding=(0, 2))
    for name in ("offset (m)", "restoring force (N)", "vertical force (N)", "largest tension (N)", "in line"):
        table.add_column(name, justify="right")
    for k, distance in enumerate(curve.distance):
        line = max(curve.tension, key=lambda name: curve.tension[name][k])
        least = 1e-9 * float(np.abs(curve.force).max())
        forces = [f"{x if abs(x) > least else 0.0:.5g}" for x in (curve.restoring[k], curve.force[k, 2])]
        table.add_row(f"{distance:.5g}", *forces, f"{curve.tension[line][k]:.5g}", line)
    return table
