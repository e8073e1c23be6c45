"""The text of a scene that several browsers and other editors change: its revisions, its file, and merging."""

from __future__ import annotations

import os
import re
import stat
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import suppress
from difflib import SequenceMatcher
from pathlib import Path

from hybrid.errors import SceneError
from hybrid.scene.read import LARGEST_SCENE, text_of

# Characters of former texts that are remembered, for a browser that comes back after a while.
REMEMBERED = 50_000_000
# Lines beyond which two texts are not compared line by line: it takes a second.
MOST_LINES = 20_000

Stamp = tuple[int, int, int]  # of a file: number, size, time of the last change


class Refused(Exception):
    """Something that was asked is not done; the text says why, and what to try."""


class Document:
    """A text with numbered revisions, and the file it was read from and is written to."""

    def __init__(self, text: str, path: Path | None = None, folder: Path | None = None) -> None:
        """folder: where files that the text names are looked for, and where a new file goes."""
        self.path = path
        self.folder = folder or (path.parent if path else Path.cwd())
        self.revision = 0
        self.newline = "\r\n" if "\r\n" in text else "\n"  # of the file; texts here have \n alone, as browsers do
        self._former: dict[int, str] = {0: unified(text)}
        self.saved: str | None = self.text if path else None  # what the file holds as far as is known
        self._stamp = stamp_of(path)
        self._opened = path.resolve() if path else None  # what it was, if it is a link, when it was asked for

    @property
    def text(self) -> str:
        """The text now."""
        return self._former[self.revision]

    @property
    def changed(self) -> bool:
        """Whether the text is another one than that of the file."""
        return self.text != self.saved

    @property
    def name(self) -> str:
        """Name by which complaints call it, in whose folder other files are looked for."""
        return str(self.path or self.folder / "scene.yaml")

    def edit(self, text: str, base: int) -> str:
        """Take a text that somebody made from revision `base`; changes that others made since then stay.

        Where both changed the same lines the new text counts.
        """
        if len(text.encode()) > LARGEST_SCENE:
            raise Refused(
                f"a scene may have {LARGEST_SCENE / 1e6:g} MB at most; time series go into files of their own"
            )
        text = unified(text)
        if base != self.revision and base in self._former:
            text = merged(self._former[base], text, self.text)
        if text != self.text:
            self._accept(text)
        return self.text

    def save(self, name: str | None = None, force: bool = False) -> None:
        """Write the text to its file; name: of a new one in the folder.

        Refused if somebody else changed the file (not deleted it) since it was read or written last, unless `force`.
        """
        target = self._target(name) if name is not None or self.path is None else self.path
        assert target is not None
        if target != self.path and target.exists() and not force:
            raise Refused(f"{target.name} exists: take another name")
        there = stamp_of(target) is not None  # one that was deleted is written anew
        if target == self.path and there and not force and _content(target) not in (self.saved, self.text):
            raise Refused(f"{target.name} was changed on disk by another program")
        self._check_link(target)
        _write(target, self.text.replace("\n", self.newline))
        self.path, self.saved, self._stamp = target, self.text, stamp_of(target)

    def _check_link(self, target: Path) -> None:
        """Refuse a link to another folder, unless it was opened as what it is."""
        to = target.resolve()
        if to.parent != self.folder.resolve() and not (target == self.path and to == self._opened):
            raise Refused(f"{target.name} is a link to {to}, which is outside {self.folder}: take another name")

    def compare_with_disk(self) -> str:
        """Compare with the file on disk.

        "": as it was; "taken": its new text is the text now; "differs": it has another text, and so has this; "gone":
        it is not there.
        """
        if self.path is None:
            return ""
        stamp = stamp_of(self.path)
        if stamp == self._stamp:
            return ""
        if stamp is None:
            self._stamp = None
            return "gone"
        self._stamp = stamp
        found = unified(text_of(self.path))  # SceneError where it is no text
        if found in (self.saved, self.text):
            self.saved = found
            return ""
        was_changed, self.saved = self.changed, found
        if was_changed:
            return "differs"
        self._accept(found)
        return "taken"

    def reload(self) -> None:
        """Take the text of the file, and leave what was changed here."""
        if self.path is not None:
            try:
                found = unified(text_of(self.path))
            except SceneError as error:
                raise Refused(str(error)) from None
            self.saved, self._stamp = found, stamp_of(self.path)
            if found != self.text:
                self._accept(found)

    def _accept(self, text: str) -> None:
        self.revision += 1
        self._former[self.revision] = text
        kept = sum(map(len, self._former.values()))
        while kept > REMEMBERED and len(self._former) > 2:
            kept -= len(self._former.pop(min(self._former)))

    def _target(self, name: str | None) -> Path:
        """A new file in the folder: a name alone, so that nothing is written elsewhere."""
        name = (name or "").strip()
        if not name:
            raise Refused("a name is needed, such as mooring.yaml")
        if not name.endswith((".yaml", ".yml")):
            name += ".yaml"
        plain = Path(name).name == name and not name.startswith(".") and not set(name) & set('\\/:*?"<>|\0')
        if not plain or not name.isprintable() or len(name) > 200:
            raise Refused(f"{name!r} is no name of a file in {self.folder}: take letters, digits, - and _")
        return self.folder / name


def unified(text: str) -> str:
    """A text with \\n at the end of each line."""
    return text.replace("\r\n", "\n").replace("\r", "\n")


def merged(base: str, mine: str, theirs: str) -> str:
    """What two people made of one text, line by line; where both changed the same lines, mine."""
    if theirs == base or mine == theirs:
        return mine
    if mine == base:
        return theirs
    old, a, b = (text.splitlines(keepends=True) for text in (base, mine, theirs))
    if max(map(len, (old, a, b))) > MOST_LINES:
        return mine
    out: list[str] = []
    at = 0
    for low, high, ours, others in _pieces(old, a, b):
        out += old[at:low]
        out += others if ours == old[low:high] else ours
        at = high
    return "".join(out + old[at:])


def _pieces(old: Sequence[str], a: Sequence[str], b: Sequence[str]) -> Iterator[tuple[int, int, list[str], list[str]]]:
    """Ranges of `old` that a, b or both changed, and what each has there; ranges that overlap are one."""
    edits = [_changes(old, x) for x in (a, b)]
    borders = sorted((low, high) for changes in edits for low, high, _, _ in changes)
    ranges: list[list[int]] = []
    for low, high in borders:
        if ranges and (low < ranges[-1][1] or low == ranges[-1][0]):
            ranges[-1][1] = max(ranges[-1][1], high)
        else:
            ranges.append([low, high])
    for low, high in ranges:
        parts = []
        for changes, new in zip(edits, (a, b), strict=True):
            shift = sum((d - c) - (y - x) for x, y, c, d in changes if y <= low and (x, y) != (low, low))
            grown = sum((d - c) - (y - x) for x, y, c, d in changes if low <= x and y <= high and (y > low or x == low))
            parts.append(list(new[low + shift : high + shift + grown]))
        yield low, high, parts[0], parts[1]


def _changes(old: Sequence[str], new: Sequence[str]) -> list[tuple[int, int, int, int]]:
    found = SequenceMatcher(None, old, new, autojunk=False).get_opcodes()
    return [(i, j, k, m) for tag, i, j, k, m in found if tag != "equal"]


def stamp_of(path: Path | None) -> Stamp | None:
    """What changes when a file does; None: there is none."""
    try:
        found = path.stat() if path is not None else None
    except OSError:
        return None
    return (found.st_ino, found.st_size, found.st_mtime_ns) if found is not None else None


def _content(path: Path) -> str | None:
    """The text of a file; None where there is none that can be read."""
    try:
        return unified(text_of(path))
    except SceneError:
        return None


def _write(target: Path, text: str) -> None:
    """Replace a file at once, with its permissions; a link stays one."""
    target = target.resolve()
    try:
        number, beside = tempfile.mkstemp(prefix=f".{target.name}.", suffix=".new", dir=target.parent)
        try:
            with os.fdopen(number, "w", encoding="utf-8", newline="") as file:
                file.write(text)
            os.chmod(beside, stat.S_IMODE(target.stat().st_mode) if target.exists() else 0o644)
            os.replace(beside, target)
        except BaseException:
            with suppress(OSError):
                os.unlink(beside)
            raise
    except (OSError, UnicodeError) as error:
        raise Refused(f"{target} cannot be written: {error}") from None


# Files that the text of a scene names: motions, loads, depths, RAOs, laws of stretch.

# Files that are watched: of a text with more of them, the first.
MOST_FILES = 50
_NAMED = re.compile(r"""(?<!\w)(?:file|rao)["']?:[ \t]+("[^"\n]+"|'[^'\n]+'|[^\s"'#{\[,}\]][^\n,}\]#]*)""")


def named_files(text: str, folder: Path) -> list[Path]:
    """Paths of the files that keys `file` and `rao` name, also in a text that is no valid scene."""
    return list(dict.fromkeys(_paths(text, folder)))[:MOST_FILES]


def _paths(text: str, folder: Path) -> Iterator[Path]:
    for line in text.splitlines():
        if line.lstrip().startswith("#"):
            continue
        for found in _NAMED.finditer(line):
            name = found[1].strip().strip("\"'")
            if name and "\0" not in name:
                yield folder / name
