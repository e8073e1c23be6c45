"""Numbers with names in one array: `clock.now` in kernels and in Python, where `clock[0]` would tell nobody what it is."""

from __future__ import annotations

from operator import itemgetter
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import NDArray


class NamedNumbers(np.ndarray[Any, Any]):
    """An array of numbers, (n,), each of which has a name: those that a class annotates, in their order.

    A kernel takes the address of the first (kernels.machine.reference_types), Python all that an array can do.
    """

    _fields: ClassVar[tuple[str, ...]] = ()
    _number: ClassVar[type] = np.float64

    def __init_subclass__(cls, number: type = np.float64) -> None:
        """number: type of all of them."""
        cls._fields, cls._number = tuple(cls.__annotations__), number
        for at, name in enumerate(cls._fields):
            if hasattr(NamedNumbers, name):
                raise TypeError(f"{cls.__name__}.{name} is something else of every array")
            setattr(cls, name, _property(at))

    def __new__(cls, **given: float) -> Self:
        """All 0 but those that are given by name.  TypeError: there is none of that name."""
        made = np.zeros(len(cls._fields), cls._number).view(cls)
        for name, value in given.items():
            if name not in cls._fields:
                raise TypeError(f"{cls.__name__} has no {name}")
            setattr(made, name, value)
        return made

    @classmethod
    def of(cls, numbers: NDArray[Any]) -> Self:
        """The same numbers with names.  ValueError: there are more of them, or fewer."""
        if numbers.shape != (len(cls._fields),) or numbers.dtype != cls._number:
            raise ValueError(
                f"{numbers.dtype} of shape {numbers.shape}, expected {len(cls._fields)} numbers of {cls.__name__}"
            )
        return numbers.view(cls)

    @property
    def plain(self) -> NDArray[Any]:
        """The same numbers as an array like any other."""
        return self.view(np.ndarray)


def _property(at: int) -> property:
    def write(self: NamedNumbers, value: Any) -> None:
        self[at] = value

    return property(itemgetter(at), write)  # a reader in Python would take three times as long
