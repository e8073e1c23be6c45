"""What a result states before its first output: its grid, its fields, and all that does not grow with it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from hybrid.store.format import Field

# A text, or what makes it when it is asked for: YAML takes a tenth of the equilibrium of some lines.
Text = str | Callable[[], str]


def made(text: Text) -> str:
    """The text itself."""
    return text if isinstance(text, str) else text()


class Header(NamedTuple):
    """What a result states before its first output.

    grid_s: (ns,) output arc lengths, m, unstretched.  fields: what `save` brings.  step_fields: what `log` brings,
    time first.  attributes: more root attributes, `title` among them.  texts: "scene" as YAML, and others.
    fixed: quantities that do not depend on time, with their values; one whose only dimension is its own name becomes a
    dimension scale (the arc lengths of some probes, say).
    """

    grid_s: np.ndarray
    fields: Sequence[Field]
    step_fields: Sequence[Field]
    attributes: Mapping[str, str | float | int]
    texts: Mapping[str, Text] = MappingProxyType({})
    fixed: Sequence[tuple[Field, np.ndarray]] = ()
