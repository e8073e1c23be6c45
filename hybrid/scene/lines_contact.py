"""Contact of lines of several with each other: which touch, and their friction."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from hybrid.scene.base import NonNegative, Table
from hybrid.scene.points import Name


class LinesContact(Table):
    """Lines that touch each other in a run and at rest: they keep a diameter apart, the mean of theirs.

    Where a scene does not speak of it they touch in runs by given steps, from where they come near each other.
    """

    between: tuple[Annotated[tuple[Name, Name], Field(description="names of two lines")], ...] | None = Field(
        default=None,
        description="pairs of lines that touch each other; absent: all of them; empty: none",
    )
    friction: NonNegative = Field(
        default=0.0, description="coefficient of friction (Coulomb) between lines that touch each other [-]"
    )
