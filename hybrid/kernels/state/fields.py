"""What a field of a line is: one for every node or cell, and how it follows from what the material has per length.

Each field of `kernels.state.state.Line` says it beside its name; whatever makes, copies or moves lines reads it from there.
"""

from __future__ import annotations

from typing import Any, NamedTuple, get_type_hints

import numpy as np
from numpy.typing import NDArray

# How a field of a cell or of a node follows from what there is per length, x, over the length h of the cells.
MEAN = 0  # of a cell: the mean of x
HALF = 1  # h x/2, of half the cell
ROD = 2  # h x where the cell is of a rod, else 0
SHARED = 3  # of a node: h x/2 of the cells beside it, and what a body there has
POINT = 4  # of a node: of the body there
OWN = 5  # by a rule of its own (kernels.mesh.fill_line)


class Field(NamedTuple):
    """What stands beside the name of a field."""

    of_node: bool
    rule: int = OWN
    columns: int = 0  # 0: one number
    kind: Any = np.float64
    optional: bool = False  # whether a line may have none of it: then the array is empty


def node(rule: int = OWN, columns: int = 0, kind: Any = np.float64, optional: bool = False) -> Field:
    """There is one for every node."""
    return Field(True, rule, columns, kind, optional)


def cell(rule: int = OWN, columns: int = 0, kind: Any = np.float64, optional: bool = False) -> Field:
    """There is one for every cell."""
    return Field(False, rule, columns, kind, optional)


def fields_of(line: type) -> dict[str, Field]:
    """The fields along the line, of a class whose annotations have them."""
    found = {name: getattr(x, "__metadata__", ()) for name, x in get_type_hints(line, include_extras=True).items()}
    return {name: x[0] for name, x in found.items() if x}


def blank(field: Field, cells: int) -> NDArray[Any]:
    """Zeros of a field on so many cells; of one that a line may have none of, none."""
    size = 0 if field.optional else cells + field.of_node
    return np.zeros((size, field.columns) if field.columns else size, field.kind)
