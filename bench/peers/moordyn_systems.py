"""Decks of several lines from the tests of MoorDyn, as numbers.

From the folder tests/Mooring of MoorDyn, Copyright Matt Hall and contributors, BSD 3-clause licence
(https://github.com/FloatingArrayDesign/MoorDyn): lines.txt, lines_body.txt, local_euler/duplicated.txt,
local_euler/hanging.txt and local_euler/complex_system.txt.
"""

from __future__ import annotations

_TYPES = "--- LINE TYPES ---\nTypeName Diam Mass/m EA BA EI Cd Ca CdAx CaAx\n(-) (m) (kg/m) (N) (N-s) (N-m^2) (-) (-) (-) (-)\n"
_BODIES = (
    "--- BODIES ---\nID Attachment X0 Y0 Z0 r0 p0 y0 Mass CG I Volume CdA Ca\n"
    "(#) (-) (m) (m) (m) (deg) (deg) (deg) (kg) (m) (kg-m^2) (m^3) (m^2) (-)\n"
)
_RODS = (
    "--- ROD TYPES ---\nTypeName Diam Mass/m Cd Ca CdEnd CaEnd\n(-) (m) (kg/m) (-) (-) (-) (-)\n"
    "conn 0.116 25 1.1 1.0 1.1 1.0\n"
    "--- RODS ---\nID RodType Attachment Xa Ya Za Xb Yb Zb NumSegs Outputs\n(#) (-) (-) (m) (m) (m) (m) (m) (m) (-) (-)\n"
)
_POINTS = "--- POINTS ---\nID Attachment X Y Z M V CdA Ca\n(#) (-) (m) (m) (m) (kg) (m^3) (m^2) (-)\n"
_LINES = "--- LINES ---\nID LineType AttachA AttachB UnstrLen NumSegs Outputs\n(#) (-) (-) (-) (m) (-) (-)\n"


def _points(*places: str) -> str:
    return _POINTS + "".join(f"{i} {place} 0 0 0 0\n" for i, place in enumerate(places, 1))


def _lines(*lines: str) -> str:
    return _LINES + "".join(f"{i} {line} -\n" for i, line in enumerate(lines, 1))


def _deck(*parts: str, **options: float) -> str:
    rows = "".join(f"{value} {name}\n" for name, value in options.items())
    return "a deck\n" + "".join(parts) + "--- OPTIONS ---\n" + rows + "--- need this line ---\n"


_ANCHORS = ("Fixed 853.87 0 -320", "Fixed -426.94 739.47 -320", "Fixed -426.94 -739.47 -320")
_HYWIND = _TYPES + "main 0.09 77.7066 384.243e6 -0.8 0 1.6 1.0 0.1 0.0\n"
_THREE = _lines("main 1 4 902.2 20", "main 2 5 902.2 20", "main 3 6 902.2 20")
_CHAIN = _TYPES + "chain 0.252 390 1.674e9 -1.0 0 1.37 1.0 0.64 0.0\n"

DECKS = {
    "lines": _deck(
        _HYWIND, _points(*_ANCHORS, "Vessel 5.2 0 -70", "Vessel -2.6 4.5 -70", "Vessel -2.6 -4.5 -70"), _THREE,
        kBot=3e6, cBot=3e5, WtrDnsty=1025, WtrDpth=320,
    ),
    "lines_body": _deck(
        _HYWIND, _BODIES, "1 Coupled 0 0 -35 0 0 0 0 -35 0 0 0 0\n",
        _points(*_ANCHORS, "Body1 5.2 0 -70", "Body1 -2.6 4.5 -70", "Body1 -2.6 -4.5 -70"), _THREE,
        kBot=3e6, cBot=3e5, WtrDnsty=1025, WtrDpth=320,
    ),
    "duplicated": _deck(
        _CHAIN, _points("Fixed 700 0 -200", "Vessel 0 0 0"), _lines("chain 1 2 760 76", "chain 1 2 760 152"),
        kBot=1e5, cBot=1e4, WtrDnsty=1025, WtrDpth=200,
    ),
    "hanging": _deck(
        _CHAIN, _points("Vessel -350 0 0", "Vessel 350 0 0", "Free 0 0 -140"),
        _lines("chain 1 3 380 76", "chain 2 3 380 152"), kBot=1e5, cBot=1e4, WtrDnsty=1025, WtrDpth=1000,
    ),
    # Its columns are named Can Cat Cdn Cdt; MoorDyn 2 reads them as they are named here.
    "complex_system": _deck(
        _TYPES, "cable 0.116 25 362e6 -1.0 1e2 1.0 0.0 1.1 0.008\n", "bouyancy 0.361 59 362e6 -1.0 1e2 1.0 0.469 2.617 0.345\n",
        "stiffner 0.19 25 362e6 -1.0 38e3 1.0 0.0 1.1 0.008\n", "nylon 0.116 25 5e5 -1.0 0.0 1.0 0.0 2.0 0.1\n",
        _BODIES, "1 Free 452 0 -313 0 0 0 29.5 0 0.098 0.014 0.5|0.5 1.0\n", _RODS,
        "1 conn Free 455.5 0 -313 455.5 0 -313 0 -\n", "2 conn Free 448.5 0 -313 448.5 0 -313 0 -\n",
        "3 conn Free 375 0 -250 375 0 -250 0 -\n", "4 conn Free 290 0 -215 290 0 -215 0 -\n",
        _points("Fixed 600 0 -320", "Fixed 452 0 -320", "Body1 0 0 0", "Coupled 0 0 -63.6"),
        _lines(
            "nylon 2 3 7 7", "cable 1 R1A 147 15", "stiffner R1B 3 3.12 2", "stiffner 3 R2A 3.12 2",
            "cable R2B R3A 107 11", "bouyancy R3B R4A 80 8", "cable R4B 4 340 34",
        ),
        kb=3e6, cb=3e5, WtrDpth=320,
    ),
}  # fmt: skip
