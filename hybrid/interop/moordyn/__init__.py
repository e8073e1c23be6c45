"""Input files of MoorDyn ("decks"), versions 1 and 2, as scenes: one of all lines, or one for each cable.

docs/import.md lists what becomes of each part; `writer` goes the other way.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from hybrid.errors import Complaint, SceneError
from hybrid.interop.moordyn.all_lines import ImportedScene, scene_of, scene_of_lines
from hybrid.interop.moordyn.deck import Deck, read_deck
from hybrid.interop.moordyn.rows import LEFT_OUT, NOT_NEEDED, TAKEN, Note, Source, in_order, note, read_source
from hybrid.interop.moordyn.tables import Cable, cables
from hybrid.interop.moordyn.writer import WRITTEN, WrittenDeck, deck_of

__all__ = ["ImportedDeck", "ImportedScene", "Note", "WrittenDeck", "export_moordyn", "import_moordyn"]

# Sections of which no row has a place in a scene: why, and what to do.
_NO_PLACE = {
    "failure": ("when a line breaks is not read", "give `break_at` of its point"),
    "control": ("winches that follow a controller", "give `payout` of the end of the line, or set it from outside"),
    "external loads": ("steady forces and dampers on points, rods and bodies", "a force acts on `kind: free` ends"),
}


@dataclass(frozen=True)
class ImportedDeck:
    """The scenes of a deck by name, and what is to be known of all of them."""

    file: str
    scenes: dict[str, ImportedScene]
    notes: tuple[Note, ...]

    def files(self, target: str | Path) -> dict[Path, ImportedScene]:
        """The file of each scene.

        A single scene goes to `target` where that names a YAML file; else scenes go into the folder `target`, as
        DECK.line1.yaml, or DECK.yaml if there is one.  SceneError if several scenes are to go into one file.
        """
        target, stem = Path(target), Path(self.file).stem
        one = len(self.scenes) == 1
        if target.suffix.lower() in (".yaml", ".yml") and not target.is_dir():
            if not one:
                given = f"{target} for {len(self.scenes)} cables: {', '.join(self.scenes)}"
                first = next(iter(self.scenes.values())).lines[0]
                fix = f"name a folder, or leave --separate out, or choose a line: --line {first}"
                raise SceneError(
                    [Complaint("output", given, "a folder: each cable is a scene of its own", fix)], self.file
                )
            return {target: next(iter(self.scenes.values()))}
        return {target / (f"{stem}.yaml" if one else f"{stem}.{name}.yaml"): s for name, s in self.scenes.items()}

    def write(self, target: str | Path, overwrite: bool = False) -> list[Path]:
        """Write the scenes (see `files`); SceneError if a file is there already: people edit scenes by hand."""
        files = self.files(target)
        there = [path for path in files if path.exists()]
        if there and not overwrite:
            fix = "give another place (-o), or --overwrite; what was edited in them is lost then"
            expected = "files that are not there yet: a scene may have been edited by hand"
            raise SceneError([Complaint("output", ", ".join(map(str, there)), expected, fix)], self.file)
        for path, made in files.items():
            try:
                path.parent.mkdir(parents=True, exist_ok=True)
                path.write_text(made.text, encoding="utf-8")
            except OSError as error:
                expected = f"a place that can be written to ({error.strerror})"
                raise SceneError([Complaint("output", str(path), expected, "give another (-o)")], self.file) from None
        return list(files)


def import_moordyn(path: str | Path, line: int | None = None, separate: bool = False) -> ImportedDeck:
    """Read a MoorDyn input file: all its lines as one scene.

    line: only the cable that this line is part of.  separate: each cable as a scene of its own, without those of which
    none can be made.
    SceneError with every complaint, in lines of the deck, if it is refused.
    """
    source = read_source(path)
    deck = read_deck(source)
    found, lost = cables(deck)
    if line is None and not separate and len(found) + len(lost) > 1:
        made = scene_of_lines(deck)
        return ImportedDeck(deck.file, {made.name: made}, in_order([*deck.notes, *_no_place(source, deck)]))
    if line is not None:
        found = _chosen(deck, found, lost, line)
    if not found:
        expected = "a line that a scene can be made of; "
        raise SceneError([Complaint("no scene", n.text, expected + n.why, n.instead, n.line) for n in lost], deck.file)
    scenes: dict[str, ImportedScene] = {}
    complaints = []
    for cable in found:
        try:
            scenes[cable.name] = scene_of(deck, cable)
        except SceneError as error:
            complaints += error.complaints
    if complaints:
        raise SceneError(complaints, deck.file)
    notes = [*deck.notes, *lost, *_no_place(source, deck)]
    return ImportedDeck(deck.file, scenes, in_order(notes))


def _is_written(path: Path) -> bool:
    """Whether a file is empty or a deck of `export_moordyn`, which may be replaced."""
    with path.open("rb") as file:
        return not file.readline(10_000) or file.readline(10_000).startswith(WRITTEN.encode())


def export_moordyn(result: Any, path: str | Path, overwrite: bool = False) -> WrittenDeck:
    """Write a deck of MoorDyn 2 of the scene of a result (`hybrid.static` or `run`), with the cells of the result.

    Free points begin where the result has them at its first output.  `.notes` says what the deck does not have.
    SceneError if the scene has what MoorDyn has not, or if the file is there and `overwrite` is not given, or is no
    deck that was written here.
    """
    made, path = deck_of(result), Path(path)
    try:
        if path.exists() and not (overwrite and _is_written(path)):
            expected = "a deck that hybrid has written, or no file" if overwrite else "a file that is not there yet"
            fix = "another name (-o), or delete the file yourself" if overwrite else "another name (-o)"
            raise SceneError([Complaint("output", str(path), expected, fix)])
        path.write_text(made.text, encoding="utf-8")
    except OSError as error:
        expected = f"a place that can be written to ({error.strerror})"
        raise SceneError([Complaint("output", str(path), expected, "give another (-o)")]) from None
    return made


def _chosen(deck: Deck, found: list[Cable], lost: list[Note], line: int) -> list[Cable]:
    if line not in deck.lines:
        expected = f"a line of the deck: {', '.join(map(str, deck.lines))}"
        raise SceneError([Complaint("line", str(line), expected, "choose one of them")], deck.file)
    chosen = [cable for cable in found if line in cable.ids]
    if not chosen:
        row = deck.lines[line].row
        lost[:] = [n for n in lost if n.line == row.line]
    return chosen


def _no_place(source: Source, deck: Deck) -> list[Note]:
    """Notes of rows that no scene takes up."""
    notes = [note(LEFT_OUT, row, *why) for name, why in _NO_PLACE.items() for row in source.rows(name)]
    for section in source.unknown:
        why = f"the section {section.title} is not known here"
        notes += [note(LEFT_OUT, row, why) for row in section.rows]
    why = "D of an exponent is taken as Fortran does, 1.0D+8 as 1e8; MoorDyn-C stops reading at the D, and takes 1"
    notes += [note(TAKEN, row, why, "write e, as in 1.0e8") for row in source.fortran]
    fix = "correct the deck if the names, or what stands behind, were meant to count"
    notes += [note(TAKEN, row, why, fix) for row, why in source.by_place]
    outputs = [row for row in source.rows("outputs") if row.cells[0].upper() != "END"]
    why = "output channels; hybrid stores the whole cable, and both end forces at every step (steps/end_force_end)"
    notes += [note(NOT_NEEDED, row, why) for row in outputs]
    used = {(kind, id) for line in deck.lines.values() for kind, id, _ in line.ends}
    carried = {p.on for id, p in deck.points.items() if p.kind == "body" and ("point", id) in used}
    carried |= {r.on for id, r in deck.rods.items() if r.kind == "body" and ("rod", id) in used}
    for id, rod in deck.rods.items():
        if ("rod", id) not in used:
            notes.append(note(LEFT_OUT, rod.row, "a rod that holds no line; hybrid computes cables alone"))
    for id, body in deck.bodies.items():
        if id not in carried:
            notes.append(note(LEFT_OUT, body.row, "a body that holds no line; hybrid computes cables alone"))
    for id, point in deck.points.items():
        if ("point", id) not in used:
            notes.append(note(LEFT_OUT, point.row, "a point that holds no line; hybrid computes cables alone"))
    return notes
