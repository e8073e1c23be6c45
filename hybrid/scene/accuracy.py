"""What accuracy is asked for: a part (`1%`) or a size with its unit (`3 cm`, `50 N`), for named outputs."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Annotated, Any

from pydantic import Field, model_validator

from hybrid.scene.base import After, Before, Finding, Table, Words, refuse
from hybrid.scene.suggestions import decimal_comma

# Units in which a size may be given, what they measure, and how much of the SI unit they are.
UNITS = {
    "%": ("part", 0.01),
    "mm": ("position", 1e-3), "cm": ("position", 1e-2), "m": ("position", 1.0),
    "N": ("tension", 1.0), "kN": ("tension", 1e3), "MN": ("tension", 1e6),
}  # fmt: skip
_AMOUNT = re.compile(r"\s*([0-9]*\.?[0-9]+(?:[eE][-+]?[0-9]+)?)\s*(%|[a-zA-Z]+)\s*")
# Beyond a tenth nothing is computed that deserves the name; below a millionth round-off of long runs begins to show.
ROUGHEST, FINEST = 0.1, 1e-6
# What may be asked as a part of its largest alone.
ALONG = "curvature", "bending_moment", "line_tension"
_EXAMPLES = "a part or a size, such as 1%, 3 cm or 50 N"


def amount(text: str) -> tuple[str, float]:
    """What `text` measures ("part", "position" or "tension") and how much of it, SI."""
    found = _AMOUNT.fullmatch(text)
    if found is None or found[2] not in UNITS:
        refuse([Finding((), _EXAMPLES, _advice(text))])
        raise AssertionError
    what, unit = UNITS[found[2]]
    size = float(found[1]) * unit
    if not size > 0.0:
        refuse([Finding((), f"{_EXAMPLES}, more than zero", "1% is usual")])
    if what == "part" and not FINEST <= size <= ROUGHEST:
        refuse([Finding((), f"between {100 * FINEST:g}% and {100 * ROUGHEST:g}%", "1% is usual")])
    return what, size


def _advice(text: str) -> str:
    """What to write instead."""
    if re.fullmatch(r"\s*[0-9]+,[0-9]+\s*\S+\s*", text):
        return decimal_comma(text)
    return f"a number with a unit: {', '.join(UNITS)}; for two outputs {{position: 3 cm, tension: 50 N}}"


def _is_text(value: Any) -> Any:
    if isinstance(value, str):
        return value
    number = isinstance(value, int | float) and not isinstance(value, bool) and FINEST <= value <= ROUGHEST
    fix = f"write {100 * value:g}%, or a size with its unit" if number else "write 1%, or a size with its unit"
    refuse([Finding((), _EXAMPLES, fix)])
    raise AssertionError


def _checked(text: str) -> str:
    amount(text)
    return text.strip()


Amount = Annotated[str, Before(_is_text), After(_checked), Words(_EXAMPLES)]


class Accuracy(Table):
    """How wrong a result may be; step, mesh and the thresholds of zones follow from it, unless the scene gives them."""

    position: Amount | None = Field(
        default=None, description="of every output point: a part of the length of the cable, or mm, cm, m"
    )
    tension: Amount | None = Field(
        default=None,
        description="of the force at both ends: a part of the largest, or N, kN",
    )

    curvature: Amount | None = Field(
        default=None, description="of every output point: a part of the largest curvature, such as 5%"
    )
    bending_moment: Amount | None = Field(
        default=None, description="of every output point: a part of the largest bending moment, such as 5%"
    )
    line_tension: Amount | None = Field(
        default=None, description="of the tension at every output point: a part of the largest, such as 2%"
    )
    instant: Amount | None = Field(
        default=None,
        description="as `accuracy: 1%`, of every output also where the motion is irregular (jonswap waves, or values "
        "that do not converge); absent: extremes and standard deviations are judged there",
    )

    @model_validator(mode="after")
    def _units_fit(self) -> Accuracy:
        found = []
        for name in ("position", "tension"):
            text = getattr(self, name)
            if text is not None and amount(text)[0] not in ("part", name):
                other = f"{amount(text)[0]}: {text}"
                found.append(Finding((name,), f"a part (%) or a size in {_units(name)}", f"write {other}"))
        for name in ALONG:
            text = getattr(self, name)
            if text is not None and amount(text)[0] != "part":
                found.append(Finding((name,), f"a part (%) of the largest {name.replace('_', ' ')}", "5%"))
        if all(getattr(self, name) is None for name in ("position", "tension", *ALONG)):
            names = f"position, tension, {', '.join(ALONG[:-1])} or {ALONG[-1]}"
            found.append(Finding((), names, "accuracy: 1% stands for the first two"))
        refuse(found)
        return self


def _units(name: str) -> str:
    return ", ".join(unit for unit, (what, _) in UNITS.items() if what == name)


def expand(value: Any) -> Any:
    """`1%` for {position: 1%, tension: 1%}; `3 cm` and `50 N` for one of them; `instant` likewise."""
    if isinstance(value, Mapping):
        instant = value.get("instant")
        if not isinstance(instant, str) or (found := _AMOUNT.fullmatch(instant)) is None or found[2] not in UNITS:
            return value  # the table complains of it
        return {**_each(instant), **value}
    if value is None or isinstance(value, Accuracy):
        return value
    return _each(_is_text(value))


def _each(text: str) -> dict[str, str]:
    """The quantities that an amount stands for."""
    what, _ = amount(text)
    return {"position": text, "tension": text} if what == "part" else {what: text}


AskedAccuracy = Annotated[Accuracy, Before(expand)]
