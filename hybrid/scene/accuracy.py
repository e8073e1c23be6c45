"""What accuracy is asked for: a part (`1%`) or a size with its unit (`3 cm`, `50 N`), for named outputs."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Annotated, Any

from pydantic import Field, model_validator

from hybrid.scene.base import After, Before, Finding, Table, Words, decimal_comma, refuse

# Units in which a size may be given, what they measure, and how much of the SI unit they are.
UNITS = {
    "%": ("part", 0.01),
    "mm": ("position", 1e-3), "cm": ("position", 1e-2), "m": ("position", 1.0),
    "N": ("tension", 1.0), "kN": ("tension", 1e3), "MN": ("tension", 1e6),
}  # fmt: skip
_AMOUNT = re.compile(r"\s*([0-9]*\.?[0-9]+(?:[eE][-+]?[0-9]+)?)\s*(%|[a-zA-Z]+)\s*")
# Beyond a tenth nothing is computed that deserves the name; below a millionth round-off of long runs begins to show.
ROUGHEST, FINEST = 0.1, 1e-6
USUAL = "1%"  # of a scene that requests nothing and leaves its steps open
# What may be asked as a part of its largest alone.
ALONG = "curvature", "bending_moment", "line_tension"
# Of curvature and line_tension: that it is not asked, where `all` would ask for it.
NOT_ASKED = "none"
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


def _checked_or_none(text: str) -> str:
    return NOT_ASKED if text.strip() == NOT_ASKED else _checked(text)


Amount = Annotated[str, Before(_is_text), After(_checked), Words(_EXAMPLES)]
AmountOrNone = Annotated[str, Before(_is_text), After(_checked_or_none), Words(f"{_EXAMPLES}, or {NOT_ASKED}")]


class Accuracy(Table):
    """How wrong a result may be; step, mesh and the thresholds of zones follow from it, unless the scene gives them."""

    all: Amount | None = Field(
        default=None,
        description="what `accuracy: 2%` stands for, a part: of how far the line moves, for positions (at rest of its "
        "sag; never finer than half its diameter, never coarser than that part of its length); of the largest tension, "
        "for the tension along the line and the force at both ends; of the largest curvature where `model: rod` (but "
        "in jonswap waves) or pipe.max_stress names bending; what is named beside it takes precedence",
    )
    position: Amount | None = Field(
        default=None, description="of every output point: a part of the length of the cable, or mm, cm, m"
    )
    tension: Amount | None = Field(
        default=None,
        description="of the force at both ends: a part of the largest, or N, kN",
    )

    curvature: AmountOrNone | None = Field(
        default=None,
        description="of every output point: a part of the largest curvature, such as 5%; none: `all` does not ask it",
    )
    bending_moment: Amount | None = Field(
        default=None, description="of every output point: a part of the largest bending moment, such as 5%"
    )
    line_tension: AmountOrNone | None = Field(
        default=None,
        description="of the tension at every output point: a part of the largest, such as 2%; none: `all` does not "
        "ask it",
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
        for name in ("all", *ALONG):
            text = getattr(self, name)
            if text not in (None, NOT_ASKED) and amount(text)[0] != "part":
                what = "of what moves, of tensions" if name == "all" else f"of the largest {name.replace('_', ' ')}"
                found.append(Finding((name,), f"a part (%) {what}", "1%" if name == "all" else "5%"))
        if {getattr(self, name) for name in ("all", "position", "tension", *ALONG)} <= {None, NOT_ASKED}:
            names = f"all, position, tension, {', '.join(ALONG[:-1])} or {ALONG[-1]}"
            found.append(Finding((), names, "accuracy: 1% stands for {all: 1%}"))
        refuse(found)
        return self


def of_length(text: str) -> str | dict[str, str]:
    """`1%` as a part of the length and of the end forces, by name; a size, and what is none, as it is."""
    found = _AMOUNT.fullmatch(text)
    return {"position": text, "tension": text} if found is not None and found[2] == "%" else text


def of_unnamed_model(accuracy: Accuracy, stressed: bool) -> Accuracy:
    """The same, of a line that is rod although its scene does not name a model.

    `all` asks for curvature where that is held against a stress, and else for none.
    """
    if accuracy.all is None or accuracy.curvature is not None:
        return accuracy
    return accuracy.model_copy(update={"curvature": accuracy.all if stressed else NOT_ASKED})


def _units(name: str) -> str:
    return ", ".join(unit for unit, (what, _) in UNITS.items() if what == name)


def expand(value: Any) -> Any:
    """`1%` for {all: 1%}; `3 cm` for a position and `50 N` for a tension; `instant` likewise."""
    if isinstance(value, Mapping):
        instant = value.get("instant")
        if not isinstance(instant, str) or (found := _AMOUNT.fullmatch(instant)) is None or found[2] not in UNITS:
            return value  # the table complains of it
        return {**_each(instant), **value}
    if value is None or isinstance(value, Accuracy):
        return value
    return _each(_is_text(value))


def _each(text: str) -> dict[str, str]:
    """The quantity that an amount stands for."""
    what, _ = amount(text)
    return {"all" if what == "part" else what: text}


AskedAccuracy = Annotated[Accuracy, Before(expand)]
