"""Decks made by MoorDyn's own generator (moordyn.Generator), as they stand beside this file.

python tests/data/moordyn/generate.py            prints them
python tests/data/moordyn/generate.py FOLDER     writes them there: generator_chain.txt, ...
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any


def chain(g: Any) -> Any:
    """One chain; the line of chain.txt."""
    deck, steel = g.Mooring(), g.LineMaterial("chain", 0.05, 20.0, 2.0e8, 0.0, 0.0, 1.2, 1.0, 0.05, 0.0)
    deck.AddLineMaterial(steel)
    anchor = g.Point("FIXED", [0.0, 0.0, -100.0], 0.0, 0.0, 0.0, 0.0)
    fairlead = g.Point("COUPLED", [205.0, 0.0, -2.0], 0.0, 0.0, 0.0, 0.0)
    for point in (anchor, fairlead):
        deck.AddPoint(point)
    deck.AddLine(g.Line(steel, g.LinePoint(anchor), g.LinePoint(fairlead), 250.0, 50))
    for name, value in (("g", 9.81), ("rho", 1025.0), ("WtrDpth", 100.0), ("kBot", 1.0e5), ("cBot", 1.0e4)):
        deck.AddOption(g.Option(name, value))
    return deck


def clump(g: Any) -> Any:
    """Chain, clump and rope."""
    deck = g.Mooring()
    steel = g.LineMaterial("chain", 0.1, 70.0, 3.0e8, 0.0, 0.0, 1.4, 1.0, 0.2, 0.3)
    rope = g.LineMaterial("rope", 0.12, 11.5, 2.0e7, 1.0e5, 0.0, 1.6, 1.0, 0.05, 0.0)
    for material in (steel, rope):
        deck.AddLineMaterial(material)
    anchor = g.Point("FIXED", [0.0, 0.0, -120.0], 0.0, 0.0, 0.0, 0.0)
    weight = g.Point("FREE", [200.0, 0.0, -110.0], 2000.0, 0.25, 0.8, 0.5)
    fairlead = g.Point("COUPLED", [406.0, 0.0, -12.0], 0.0, 0.0, 0.0, 0.0)
    for point in (anchor, weight, fairlead):
        deck.AddPoint(point)
    deck.AddLine(g.Line(steel, g.LinePoint(anchor), g.LinePoint(weight), 220.0, 44))
    deck.AddLine(g.Line(rope, g.LinePoint(weight), g.LinePoint(fairlead), 210.0, 42))
    deck.AddOption(g.Option("WtrDpth", 120.0))
    return deck


def spread(g: Any) -> Any:
    """Three cables that bend, 120 degrees apart.

    The generator of MoorDyn 2.7 makes no bodies (its Body raises NameError), and names rods without their end.
    """
    deck, cable = g.Mooring(), g.LineMaterial("cable", 0.1, 20.0, 1.0e8, -0.5, 1.0e4, 1.2, 1.0, 0.02, 0.0)
    deck.AddLineMaterial(cable)
    for c, s in ((1.0, 0.0), (-0.5, 0.8660254), (-0.5, -0.8660254)):
        anchor = g.Point("FIXED", [100.0 * c, 100.0 * s, -80.0], 0.0, 0.0, 0.0, 0.0)
        lead = g.Point("COUPLED", [10.0 * c, 10.0 * s, -5.0], 0.0, 0.0, 0.0, 0.0)
        for point in (anchor, lead):
            deck.AddPoint(point)
        deck.AddLine(g.Line(cable, g.LinePoint(anchor), g.LinePoint(lead), 130.0, 40))
    deck.AddOption(g.Option("WtrDpth", 80.0))
    return deck


DECKS = {"generator_chain": chain, "generator_clump": clump, "generator_spread": spread}


def made() -> dict[str, str]:
    """The text of every deck, by its name."""
    from moordyn import Generator

    texts = {}
    for name, make in DECKS.items():
        deck = make(Generator)
        # The generator writes its file on the way to a running MoorDyn, which is not wanted here.
        deck._Mooring__write_input_file()
        texts[name] = Path(deck._Mooring__input_file_path).read_text(encoding="utf-8")
    return texts


if __name__ == "__main__":
    for name, text in made().items():
        if len(sys.argv) > 1:
            Path(sys.argv[1], f"{name}.txt").write_text(text, encoding="utf-8")
        else:
            print(f"===== {name}.txt\n{text}")
