"""Files that name a scene and what is done with it, such as studies and designs: read, and refused, as scenes are."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Generic, TypeVar

from pydantic import ValidationError

from hybrid.errors import Complaint, SceneError
from hybrid.scene.base import Finding, Table
from hybrid.scene.read import complaint_of, in_order, text_of
from hybrid.scene.schema_messages import explain
from hybrid.scene.yaml_source import Node, Unreadable, from_data, from_text

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
