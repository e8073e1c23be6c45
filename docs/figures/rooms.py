"""Draw the rooms of the package and which way imports run, from the rules in tests/test_house.py.

python docs/figures/rooms.py
"""

from __future__ import annotations

import runpy
from html import escape
from pathlib import Path

ROOT = Path(__file__).parents[2]
PICTURE = ROOT / "docs" / "pictures" / "rooms.svg"

# Floors from the top; in each room's entry its column and what it does.
FLOORS = (
    {"cli": (2.3, "commands, console, tables")},
    {"designs": (1.1, "derivatives, goal seek, design"), "live": (3.2, "page for the browser")},
    {
        "studies": (0.05, "many runs, other programs"),
        "couple": (1.1, "FMU"),
        "modal": (2.15, "modes, response to a sea"),
    },
    {"accuracy": (0.5, "passes, errors, choice of model")},
    {"linear": (1.1, "matrices about an equilibrium")},
    {
        "simulation": (0.5, "one run, stepping, diagnostics"),
        "interop": (2.3, "MoorDyn decks"),
        "view": (3.2, "plots, report, films"),
        "exports": (4.1, "netCDF, CSV, VTK"),
    },
    {"outputs": (0.05, "values on the output grid"), "zones": (0.95, "domain manager")},
    {"solve": (0.05, "statics, stepping in time")},
    {"model": (0.5, "the scene as arrays")},
    {
        "kernels": (0.05, "compiled numerics"),
        "scene": (1.5, "what there is: YAML, checks"),
        "store": (3.65, "HDF5 files"),
    },
    {"statistics": (3.65, "moments, extremes, fatigue")},
    {"errors": (2.3, "errors, outcomes, remedies")},
)
COLUMN, HIGH, WIDE, GAP = 226, 50, 198, 40
WIDTH = 5.1 * COLUMN


def places() -> dict[str, tuple[float, float]]:
    """Centre of every room's box."""
    floors = enumerate(FLOORS)
    return {room: ((x + 0.5) * COLUMN, 40 + k * (HIGH + GAP)) for k, floor in floors for room, (x, _) in floor.items()}


def arrows(allowed: dict[str, tuple[str, ...]]) -> list[tuple[str, str]]:
    """Imports that do not follow from others: the transitive reduction of the rules."""

    def reach(room: str) -> set[str]:
        return {room}.union(*(reach(there) for there in allowed[room] if there != "__init__"))

    return [
        (room, other)
        for room, there in allowed.items()
        for other in there
        if "__init__" not in (room, other)
        and not any(other in reach(between) for between in there if between not in (other, "__init__"))
    ]


def svg() -> str:
    """The picture."""
    allowed = runpy.run_path(str(ROOT / "tests" / "test_house.py"))["ALLOWED"]
    del allowed["__main__"]  # the command, by another name
    at, high = places(), 40 + len(FLOORS) * (HIGH + GAP)
    assert set(at) == set(allowed) - {"__init__"}, "a room has no place in the picture"
    out = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH:.0f} {high - GAP}" font-family="sans-serif">',
        '<defs><marker id="a" viewBox="0 0 8 8" refX="7" refY="4" markerWidth="7" markerHeight="7" orient="auto">',
        '<path d="M0 0L8 4L0 8z" fill="#666"/></marker></defs>',
        f'<rect width="{WIDTH:.0f}" height="{high - GAP}" fill="#fff"/>',
    ]
    for room, other in arrows(allowed):
        (x, y), (u, v) = at[room], at[other]
        assert v > y, f"{room} imports {other}, which stands above it"
        lean = max(-0.4 * WIDE, min(0.4 * WIDE, 0.35 * (u - x)))
        a, b = x + lean, u - lean
        out.append(
            f'<path d="M{a:.0f} {y + HIGH / 2:.0f}C{a:.0f} {y + HIGH:.0f} {b:.0f} {v - HIGH:.0f} {b:.0f} '
            f'{v - HIGH / 2 - 2:.0f}" fill="none" stroke="#888" stroke-width="1.3" marker-end="url(#a)"/>'
        )
    for floor in FLOORS:
        for room, (_, does) in floor.items():
            x, y = at[room]
            out += [
                f'<rect x="{x - WIDE / 2:.0f}" y="{y - HIGH / 2:.0f}" width="{WIDE}" height="{HIGH}" rx="6" '
                'fill="#eef4fb" stroke="#0072b2"/>',
                f'<g text-anchor="middle"><text x="{x:.0f}" y="{y - 5:.0f}" font-size="16" font-weight="bold">'
                f"{room}</text>",
                f'<text x="{x:.0f}" y="{y + 15:.0f}" font-size="13" fill="#333">{escape(does)}</text></g>',
            ]
    return "\n".join([*out, "</svg>", ""])


if __name__ == "__main__":
    PICTURE.write_text(svg(), encoding="utf-8")
