"""From text to `Scene`; all that is wrong with it is reported at once, with line and column."""

from __future__ import annotations

import gc
import re
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import cache
from os import PathLike
from pathlib import Path
from typing import Any, Generic, TypeVar, get_type_hints

import yaml
from pydantic import TypeAdapter, ValidationError

from hybrid.errors import Complaint, SceneError
from hybrid.scene.analysis import usual_model
from hybrid.scene.base import Finding, Place, Renamed, Table, as_written, dotted, places_of_files
from hybrid.scene.checks import contradictions
from hybrid.scene.motion_checks import motion_findings
from hybrid.scene.network import Network
from hybrid.scene.root import Scene, names_lines
from hybrid.scene.schema import CableScene, LineScene, SceneTables
from hybrid.scene.schema_messages import explain
from hybrid.scene.yaml_source import Node, Spot, Unreadable, from_data, from_text, override

# Bytes: a scene is a page or two, which is read in milliseconds, and this in some seconds.
LARGEST_SCENE = 4_000_000


class RenamedKey(FutureWarning):
    """A key or a word of a scene that was renamed; its former name is read, and means what it did."""

    def __init__(
        self, where: str, old: str, new: str, file: str = "", line: int | None = None, column: int | None = None
    ) -> None:
        self.where, self.old, self.new, self.file, self.line, self.column = where, old, new, file, line, column
        place = ":".join(str(x) for x in (file or "scene", line, column) if x is not None)
        super().__init__(f"{place}: {where}: {old} is now called {new}; please rename it")


SceneLike = Scene | str | PathLike[str] | Mapping[str, Any]


def as_scene(scene: SceneLike) -> Scene:
    """The scene given as a `Scene`, as the path of a scene file, or as a dict of its tables.

    SceneError if it is refused; TypeError if it is none of these.
    """
    if isinstance(scene, Scene):
        return scene
    if isinstance(scene, str) and "\n" in scene:
        raise TypeError("a scene is expected, or the path of a scene file; for YAML text: hybrid.parse_scene(text)")
    if isinstance(scene, str | PathLike):
        return _warn_renamed(*read_scene(scene))
    if isinstance(scene, Mapping):
        return _warn_renamed(*_from_data(dict(scene)))
    raise TypeError(
        f"a scene is expected: a hybrid.Scene, the path of a scene file, or a dict; given: {type(scene).__name__}"
    )


def load_scene(path: str | Path, overrides: Sequence[str] = ()) -> Scene:
    """Read a scene file; a `RenamedKey` warning for each key that is called otherwise today.

    overrides: changes such as ``time.step=0.005`` or ``cable.sections[0].mass=2``.  A motion file is
    looked for in the folder of the scene file, and the scene keeps its absolute path.
    SceneError with every complaint if the scene is refused.
    """
    return _warn_renamed(*read_scene(path, overrides))


def read_scene(path: str | PathLike[str], overrides: Sequence[str] = ()) -> tuple[Scene, list[RenamedKey]]:
    """Read a scene file as `load_scene` does; with the notes on renamed keys, instead of warnings."""
    return read_text(text_of(Path(path)), str(path), overrides)


HDF5 = b"\x89HDF\r\n\x1a\n"  # how files of that format begin


def text_of(path: str | Path) -> str:
    """The text of a scene file; SceneError where there is none."""
    try:
        content = b""
        with Path(path).open("rb") as file:
            content = file.read(LARGEST_SCENE + 1)
        if len(content) <= LARGEST_SCENE:
            return content.decode("utf-8-sig")
        given, expected = f"more than {LARGEST_SCENE / 1e6:g} MB", "a scene file of at most that"
        fix = "time series go into a file of their own (motion.file, force.file), and `ratio` grades a mesh"
        complaint = Complaint("scene", given, expected, fix)
    except FileNotFoundError:
        complaint = Complaint("scene", str(path), "a scene file that exists", "check the name and the folder")
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, error.start) + 1
        column = error.start - content.rfind(b"\n", 0, error.start)
        utf16 = content[:2] in (b"\xff\xfe", b"\xfe\xff")
        given = "UTF-16" if utf16 else f"the byte {content[error.start]:#04x}"
        complaint = Complaint("scene", given, "a text file in UTF-8", "save it anew as UTF-8", line, column)
        if content.startswith(HDF5):
            fix = f"`hybrid plot {path}` or `report` shows it, `resume` continues a run; name the scene that it is of"
            complaint = Complaint("scene", "an HDF5 file, as results are", "a scene file (YAML text)", fix)
    except (OSError, ValueError):
        complaint = Complaint("scene", str(path), "a readable text file (UTF-8)", "check what kind of file it is")
    raise SceneError([complaint], str(path))


def parse_scene(text: str, file: str = "", overrides: Sequence[str] = ()) -> Scene:
    """Read a scene from YAML text; `file` is its name in complaints and the folder of motion files."""
    if not isinstance(text, str):
        raise TypeError(f"the text of a scene is a str, not {type(text).__name__}; validate_scene takes Python data")
    return _warn_renamed(*read_text(text, file, overrides))


@contextmanager
def _without_collection() -> Iterator[None]:
    """No search for cycles meanwhile: there are none, and among all values of a long scene it takes half the time."""
    collects = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if collects:
            gc.enable()


def one_line(scene: Scene) -> LineScene:
    """A scene of one cable; SceneError if it is of several lines, which is not what is asked for."""
    if "" not in scene.asked_lines:
        fix = "hybrid.run, static, plan and Simulation take several lines"
        raise SceneError([Complaint("lines", f"{len(scene.lines)} lines", "one cable, with `cable` and `ends`", fix)])
    return scene.asked_scene("")


@_without_collection()
def read_text(text: str, file: str = "", overrides: Sequence[str] = ()) -> tuple[Scene, list[RenamedKey]]:
    """Read a scene as `parse_scene` does; with the notes on renamed keys, instead of warnings."""
    try:
        root, complaints = from_text(text)
    except Unreadable as error:
        raise SceneError([error.complaint], file) from None
    data = root.plain()
    if isinstance(root.value, dict):
        complaints += [c for c in (override(root, each, _schema_of(data)) for each in overrides) if c is not None]
        data = root.plain()
    for table, key, path in places_of_files(data):  # absolute: a scene is used from anywhere
        if path and "\0" not in path:
            table[key] = str((Path(file).parent / path).absolute())
    return _validated(data, root, complaints, file)


def located(error: SceneError, path: str | Path, overrides: Sequence[str] = ()) -> SceneError:
    """The same refusal with line and column of what was found only after reading (cells, steps, motions)."""
    try:
        return located_in(error, text_of(path), str(path), overrides)
    except SceneError:
        return error


def located_in(error: SceneError, text: str, file: str = "", overrides: Sequence[str] = ()) -> SceneError:
    """The same of a scene whose text is at hand."""
    try:
        root, _ = from_text(text)
    except Unreadable:
        return error
    if isinstance(root.value, dict):
        for each in overrides:
            override(root, each, _schema_of(root.plain()))
    complaints, keys = [], {*CableScene.model_fields, *Network.model_fields}
    for complaint in error.complaints:
        at = tuple(int(x) if x.isdigit() else x for x in re.findall(r"\w+", complaint.where))
        place = _find(root, at, False)[2] if at and at[0] in keys else None  # an option has no place in the file
        if complaint.line is None and place is not None:
            complaint = replace(complaint, line=place[0], column=place[1])
        complaints.append(complaint)
    return SceneError(in_order(complaints), error.file or file)


def validate_scene(data: Any) -> Scene:
    """A scene from Python data (nested dicts, lists, numbers); SceneError with every complaint."""
    return _warn_renamed(*_from_data(data))


def _from_data(data: Any) -> tuple[Scene, list[RenamedKey]]:
    try:
        return _validated(data, from_data(data), [], "")
    except RecursionError:  # a table that is deep, or holds itself
        fix = "a scene is a few tables within tables"
        raise SceneError([Complaint("scene", "nested too deeply", "a scene", fix)]) from None


def scene_text(scene: SceneTables | LineScene) -> str:
    """The scene as YAML; `parse_scene` reads it back to an equal scene.  A line is written in the short form."""

    class Dumper(getattr(yaml, "CSafeDumper", yaml.SafeDumper)):  # type: ignore[misc]  # of C where it was built
        pass

    Dumper.add_representer(str, _text_in_yaml)
    tables = CableScene.model_construct(**vars(scene)) if isinstance(scene, LineScene) else scene
    data = tables.model_dump(mode="json", exclude_none=True)
    style: dict[str, Any] = {"default_flow_style": None, "sort_keys": False, "width": 120, "allow_unicode": True}
    return str(yaml.dump(data, Dumper=Dumper, **style))  # tables in lines, vectors in brackets


# What YAML 1.2 reads as a number.
_NUMBER = re.compile(r"[-+]?(\d[\d_]*)?\.?\d*([eE][-+]?\d+)?|0o[0-7]+")


def _text_in_yaml(dumper: Any, text: str) -> Any:
    """A text, in quotes where YAML 1.2 would read a number: PyYAML knows those of 1.1 only (1e5 and 0o7 are others)."""
    return dumper.represent_scalar("tag:yaml.org,2002:str", text, style="'" if _NUMBER.fullmatch(text) else None)


# --- helpers -----------------------------------------------------------------------------------


def _warn_renamed(scene: Any, renamed: list[RenamedKey]) -> Any:
    for each in renamed:
        warnings.warn(each, stacklevel=3)
    return scene


def _renamed(data: Any, scene: Any, path: Place = ()) -> Iterator[tuple[Place, str, str]]:
    """Paths of the keys and words of `data` that were renamed, and both names; `scene` is what was made of them."""
    if isinstance(scene, Table) and isinstance(data, Mapping):
        for key, value in data.items():
            now = scene.former.get(key, key)
            if now != key:
                yield (*path, key), key, now
            field = type(scene).model_fields.get(now)
            for renamed in (x for x in (field.metadata if field else ()) if isinstance(x, Renamed)):
                if isinstance(value, str) and value in renamed.now:
                    yield (*path, key), value, renamed.now[value]
            yield from _renamed(value, getattr(scene, now, None), (*path, key))
    elif isinstance(scene, dict) and isinstance(data, Mapping):
        for key, value in data.items():
            yield from _renamed(value, scene.get(key), (*path, key))
    elif isinstance(scene, tuple) and isinstance(data, list | tuple):
        for i, (entry, made) in enumerate(zip(data, scene, strict=False)):
            yield from _renamed(entry, made, (*path, i))


def _notes(data: Any, scene: SceneTables, root: Node, file: str) -> list[RenamedKey]:
    """A note for each renamed key or word, where it stands first."""
    notes: dict[tuple[str, str], RenamedKey] = {}
    for path, old, now in _renamed(data, scene):
        line, column = _find(root, path, at_key=True)[2] or (None, None)
        notes.setdefault((old, now), RenamedKey(dotted(path), old, now, file, line, column))
    return list(notes.values())


def _validated(data: Any, root: Node, complaints: list[Complaint], file: str) -> tuple[Scene, list[RenamedKey]]:
    scene: Any = None
    found: list[tuple[Finding, bool]] = []
    if isinstance(data, dict | Scene):
        try:
            scene = Scene.model_validate(data)
        except ValidationError as error:
            schema = _schema_of(data)
            found = [each for one in error.errors(include_url=False) for each in explain(schema, one)]
            if schema is CableScene:
                found += [(finding, False) for finding in _of_readable(data)]
    else:
        fix = "begin with tables such as `cable:` and `ends:`"
        found = [(Finding((), "a table with cable, ends, initial and model", fix), False)]
    complaints = complaints + [complaint_of(root, finding, at_key) for finding, at_key in found]
    if complaints or scene is None:
        raise SceneError(in_order(complaints), file)
    return scene, _notes(data, scene.written, root, file)


def _schema_of(data: Any) -> type[SceneTables]:
    """The tables that a scene has in the form in which it is written."""
    return Network if names_lines(data) else CableScene


def _of_readable(data: Any) -> Iterator[Finding]:
    """What is wrong with a cable that cannot be read, with those of its tables that can be."""
    tables = _readable_tables(data)
    yield from contradictions(tables)
    yield from motion_findings(tables)


@cache
def _adapters() -> dict[str, TypeAdapter[Any]]:
    hints = get_type_hints(CableScene, include_extras=True)
    return {name: TypeAdapter(hints[name]) for name in CableScene.model_fields}


def _readable_tables(data: dict[str, Any]) -> dict[str, Any]:
    tables: dict[str, Any] = {}
    for name, field in CableScene.model_fields.items():
        if name in data:
            try:
                tables[name] = _adapters()[name].validate_python(data[name])
            except ValidationError:
                continue
        elif name == "model":
            tables[name] = usual_model(tables.get("cable"))
        elif not field.is_required():
            tables[name] = field.default
    return tables


def complaint_of(root: Node, finding: Finding, at_key: bool) -> Complaint:
    """A finding as a complaint with line and column; at_key: of the key, not of its value."""
    at, node, place, missing = _find(root, finding.at, at_key)
    given = finding.given or ("nothing" if missing else node.show())
    if at_key and not missing:
        given = f"{dotted(at[-1:])}: {given}"
    line, column = place if place is not None else (None, None)
    return Complaint(dotted(at) or "scene", given, finding.expected, finding.fix, line, column)


def _find(root: Node, path: Place, at_key: bool) -> tuple[Place, Node, Spot | None, bool]:
    """Where a path leads: the path as it is written, the value, its place, and whether it is missing.

    The place is that of the key, if the key is what is wrong; of a missing value that of its table.
    """
    node, place, at = root, root.place, list(path)
    for i, part in enumerate(path):
        inside = node.value
        if isinstance(inside, dict) and isinstance(part, str):
            part = at[i] = as_written(inside, part)
        if isinstance(inside, dict) and part in inside and isinstance(part, str):
            key_place = node.key_places.get(part)
            node = inside[part]
            place = key_place if at_key else node.place or key_place
        elif isinstance(inside, list) and isinstance(part, int) and part < len(inside):
            node = inside[part]
            place = node.place
        else:
            # `model: adaptive` has no key `kind`, the word itself is the kind; what else a bare word lacks is missing.
            missing = isinstance(inside, dict | list) or inside is None or (isinstance(inside, str) and part != "kind")
            return tuple(at), node, place, missing
    return tuple(at), node, place, False


def in_order(complaints: Iterable[Complaint]) -> list[Complaint]:
    """Every complaint once, in the order of the file; those without a line last."""
    once = list(dict.fromkeys(complaints))
    return sorted(once, key=lambda c: (c.line is None, c.line or 0, c.column or 0))


# Files that name a scene and what is done with it, such as studies and designs: read, and refused, as scenes are.

T = TypeVar("T", bound=Table)


@dataclass(frozen=True)
class TaskFile(Generic[T]):
    """What a file asks for, and where it stands in it.  file: "" of Python data."""

    asked: T
    root: Node
    file: str

    def refusal(self, findings: Iterable[Finding]) -> SceneError:
        """An error that says what is found, each with its line and column."""
        return SceneError(in_order(complaint_of(self.root, x, False) for x in findings), self.file)


@dataclass(frozen=True)
class Kind(Generic[T]):
    """A kind of such files: its schema, what it is called, what it needs beside a scene, its page in docs.

    files: keys (such as measured.file) that name files, whose paths become absolute; shorthand: what is written for
    short, as it is read.
    """

    schema: type[T]
    name: str
    needs: str
    page: str
    files: Sequence[str] = ("scene",)
    shorthand: Callable[[Any], Any] = lambda data: data

    def read(self, path: str | Path) -> TaskFile[T]:
        """Read a file; paths in it become absolute.  SceneError with every complaint, with line and column."""
        try:
            root, complaints = from_text(text_of(path))
        except Unreadable as error:
            raise SceneError([error.complaint], str(path)) from None
        return self._validated(root.plain(), root, complaints, str(path), Path(path).parent)

    def of_data(self, data: Mapping[str, Any], folder: str | Path = ".") -> TaskFile[T]:
        """The same from Python data; files in it are relative to `folder`."""
        try:
            return self._validated(dict(data), from_data(dict(data)), [], "", Path(folder))
        except RecursionError:  # a table that is deep, or holds itself
            fix = f"a {self.name} is a few tables within tables"
            raise SceneError([Complaint(self.name, "nested too deeply", f"a {self.name}", fix)]) from None

    def _validated(self, data: Any, root: Node, complaints: list[Complaint], file: str, folder: Path) -> TaskFile[T]:
        if isinstance(data, dict) and "scene" not in data and {"cable", "lines"} & set(data):
            expected = f"a {self.name}, which names a scene and {self.needs}"
            fix = f"a file with `scene: scene.yaml`, see docs/{self.page}"
            raise SceneError([Complaint(self.name, "a scene", expected, fix)], file)
        if not isinstance(data, dict):
            fix = f"see docs/{self.page}"
            raise SceneError([Complaint(self.name, "no table", f"a table with scene and {self.needs}", fix)], file)
        try:
            asked = self.schema.model_validate(self.shorthand(data))
        except ValidationError as error:
            found = [each for one in error.errors(include_url=False) for each in explain(self.schema, one)]
            raise SceneError(in_order(complaints + [complaint_of(root, *each) for each in found]), file) from None
        if complaints:
            raise SceneError(in_order(complaints), file)
        for name in self.files:
            asked = _absolute(asked, name.split("."), folder)
        return TaskFile(asked, root, file)


def _absolute(table: Any, path: list[str], folder: Path) -> Any:
    """A table with the name of a file at a path of keys made absolute, where there is one."""
    first, rest = path[0], path[1:]
    value = getattr(table, first)
    if not value:
        return table
    changed = _absolute(value, rest, folder) if rest else str((folder / value).absolute())
    return table.model_copy(update={first: changed})
