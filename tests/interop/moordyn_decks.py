"""The decks of tests/data/moordyn, and one small deck that tests change."""

from __future__ import annotations

from pathlib import Path

from hybrid.interop.moordyn import ImportedDeck, ImportedScene, import_moordyn

FOLDER = Path(__file__).parents[1] / "data" / "moordyn"
DECKS = sorted(path.stem for path in FOLDER.glob("*.txt"))


def text_of(name: str) -> str:
    return (FOLDER / f"{name}.txt").read_text(encoding="utf-8")


def imported(name: str, line: int | None = None) -> ImportedDeck:
    return import_moordyn(FOLDER / f"{name}.txt", line, separate=True)


def one_scene(text: str, folder: Path) -> ImportedScene:
    """All lines of a text as one scene; the deck is called deck.txt."""
    (folder / "deck.txt").write_text(text, encoding="utf-8")
    (made,) = import_moordyn(folder / "deck.txt").scenes.values()
    return made


def from_text(text: str, folder: Path) -> ImportedDeck:
    """Import a text, each cable as a scene of its own; the deck is called deck.txt."""
    path = folder / "deck.txt"
    path.write_bytes(text.encode("utf-8", errors="surrogateescape"))
    return import_moordyn(path, separate=True)
