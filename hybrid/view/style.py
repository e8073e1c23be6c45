"""Colours, sizes of type, names and units of pictures.

Colours are those of Okabe and Ito, which stay apart for colour-blind eyes. A zone kind has
one colour on a whole page; grey is what was earlier; sand and water are pale, behind everything.
"""

from __future__ import annotations

import math
from collections.abc import Iterable

INK, GREY, ALARM = "#222222", "#6E6E6E", "#C00000"
KIND_COLOURS = {
    "rod": "#D55E00",
    "catenary": "#0072B2",
    "corrected": "#009E73",  # of 0.6
}  # kinds that are not named here are drawn in ink
STONE, STONE_EDGE = "#D9D4CF", "#7A726B"
SAND, BED, BODY = "#EEE5D0", "#8C6D31", "#F0E442"
WATER, LEVEL = "#EFF6FA", "#4A90C2"
DOUBT = "#8E63B5"  # of estimated errors
TOUCHDOWN = "#CC79A7"  # where contact begins and ends
END_COLOURS = {"start": "#009E73", "end": "#222222"}
POINT_COLOURS = ("#009E73", "#000000", "#CC79A7", "#E69F00", "#56B4E9", "#7F7F7F")
SMALL, NORMAL = 7.0, 8.0  # type sizes in points, for a page 8 inches wide
ZERO = 1e-12  # SI; below this a force or moment of any real cable is round-off
_NAMES = {"theta": "angle to z", "phi": "azimuth", "bending_moment": "|bending moment|", "shear": "|shear|"}
_NAMES |= {"contact": "contact force"} | {x: f"position {x}" for x in "xyz"}
NEWS = (
    "stability not judged",
    "end rotated in",
    "static friction neglected",
    "bending at clamp neglected",
    "bending at point load neglected",
    "zones fixed",
    "contact begins",
)  # no warnings


def title_of(name: str) -> str:
    return _NAMES.get(name, name.replace("/", " ").replace("_", " "))


def colour_of(kind: str) -> str:
    return KIND_COLOURS.get(kind, INK)


def earlier_grey(k: int, count: int) -> str:
    """The colour of the k-th of so many earlier curves: later ones are darker."""
    level = round(255 * (0.7 - 0.3 * k / max(count - 1, 1)))
    return f"#{level:02X}{level:02X}{level:02X}"


def prefix(unit: str, peak: float) -> tuple[float, str]:
    """Factor and unit that bring the largest value between 1 and 1000 where engineers do so."""
    if unit == "rad":
        return 180.0 / math.pi, "°"
    if unit == "1/m" and ZERO < peak < 0.01:
        return 1e3, "1/km"
    if unit == "m":
        return (1e3, "mm") if ZERO < peak < 0.01 else (1e-3, "km") if peak >= 1e4 else (1.0, "m")
    if unit.replace("/", " ").split(" ")[0] in ("N", "J", "W", "Pa") and peak > ZERO:
        power = min(max(math.floor(math.log10(peak) / 3.0 + 1e-12), -4), 4)
        power += power == -1 and " " in unit  # of "mN m" nobody knows what the first letter is
        return 10.0 ** (-3 * power), ("p", "n", "µ", "m", "", "k", "M", "G", "T")[power + 4] + unit
    return 1.0, unit or "–"


def short(value: float, digits: int) -> str:
    """So many digits, without an exponent where a person would write none."""
    rounded = float(f"{value:.{digits}g}")
    return f"{rounded:.9g}" if 1e-4 <= abs(rounded) < 1e6 or rounded == 0.0 else f"{rounded:g}"


def distinct_texts(values: Iterable[float], digits: int = 3) -> list[str]:
    """Numbers with so many digits, or as many more as it takes until different ones look different."""
    numbers = [float(x) for x in values]
    for n in range(digits, 10):
        texts = [short(x, n) for x in numbers]
        if len(set(texts)) == len(set(numbers)):
            break
    return texts if numbers else []
