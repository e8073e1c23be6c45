"""Forces between lines that touch each other, at the outputs of a system: which pairs are named, and their values."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from hybrid.kernels.state.state import Batch, Floats
from hybrid.model.network import NetworkModel
from hybrid.outputs.line_forces import KEYS, Lines, pair_fields, pair_forces
from hybrid.solve.shared_contact import SharedContact
from hybrid.store.format import Field


def fields_of_pairs(model: NetworkModel) -> list[Field]:
    """What is recorded of the pairs of lines whose contact is computed, and of these lines with themselves."""
    return pair_fields([(model.names[a], model.names[b]) for a, b in _pairs(model).values()])


def values_of_pairs(model: NetworkModel, shared: SharedContact | None, states: Sequence[Batch]) -> dict[str, Floats]:
    """Values (nb, ...) of those fields, from nb states of all lines; shared: their contact, None: nothing touches."""
    found: dict[str, Floats] = {}
    nb, pairs = len(states[0].t), _pairs(model)
    for a, b in pairs.values():
        at = f"contacts/{model.names[a]}/{model.names[b]}"
        found |= {f"{at}/{key}": np.zeros((nb, 3) if key == "force" else nb) for key in KEYS[a == b :]}
    if shared is None or not pairs:
        return found
    lines, mine = Lines(shared.contact, shared.s), [states[k] for k in shared.lines]
    for output in range(nb):
        touch = np.concatenate([x.touch[output] for x in mine])
        if not touch.any():
            continue
        r = np.concatenate([x.r[output] for x in mine])
        for pair, values in pair_forces(lines, r, touch).items():
            at = "contacts/" + "/".join(model.names[k] for k in pairs[pair])
            for key, value in zip(KEYS, values, strict=True):
                if f"{at}/{key}" in found:
                    found[f"{at}/{key}"][output] = np.asarray(value)
    return found


def _pairs(model: NetworkModel) -> dict[tuple[int, int], tuple[int, int]]:
    """Numbers of two lines, or of one twice, by their places among the lines that touch others, first <= second.

    None, where nobody asks for their contact: which lines will meet is not known when a file is begun.
    """
    if model.touching is None or model.may_meet:
        return {}
    lines = model.touching.lines
    each = zip(*np.nonzero(np.triu(model.touching.meets)), strict=True)
    return {(int(j), int(k)): (lines[j], lines[k]) for j, k in each}
