"""The base of every table of a scene: what a number is, what a vector is, how invalid values are refused.

A table refuses on three levels, all of them pydantic errors until `hybrid.scene.read`
turns them into complaints: a value of the wrong form (here), a value out of bounds
(`Field(gt=0)` where the field is written), and values that contradict each other
(`refuse`, with the path of the key concerned).

Units stand in square brackets at the end of a field's description; messages, the
JSON schema and the docs all take them from there.
"""

from __future__ import annotations

import difflib
import inspect
import math
import re
import sys
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, NoReturn, Self, get_args, get_origin

from pydantic import (
    AliasChoices,
    BaseModel,
    ConfigDict,
    Field,
    GetCoreSchemaHandler,
    GetJsonSchemaHandler,
    ValidationError,
    model_validator,
)
from pydantic.fields import ComputedFieldInfo, FieldInfo
from pydantic_core import CoreSchema, PydanticCustomError, core_schema

Place = tuple[str | int, ...]
Invalid = ValidationError  # what is raised where values are no table

# No length, time, mass, force or stiffness of a cable is larger in SI units; products of several such numbers, and
# their squares, are still far from where a double overflows (1e308).
LARGEST_NUMBER = 1e20
# What cannot be negative is nothing or at least this: smaller numbers are slips, and what is divided by them overflows.
SMALLEST_NUMBER = 1e-30
# No mesh and no output needs more; numpy and JSON stop at 2^63.
LARGEST_COUNT = 10**9

# A direction is of order one; outside these bounds its square could under- or overflow.
SHORTEST_DIRECTION, LONGEST_DIRECTION = 1e-9, 1e9

# Below this sine two directions cannot be told apart in the eight digits people write.
PARALLEL = 1e-6


def unit_of(field: FieldInfo | None) -> str:
    """The unit in square brackets at the end of a description; empty if none or dimensionless."""
    text = (field.description or "") if field is not None else ""
    unit = text[text.rindex("[") + 1 : -1] if text.endswith("]") else ""
    return "" if unit == "-" else unit


def _title(name: str, field: FieldInfo | ComputedFieldInfo) -> str:
    """The title of a key in the JSON schema, which editors show: its name and unit."""
    unit = unit_of(field) if isinstance(field, FieldInfo) else ""
    return f"{name} ({unit})" if unit else name


# Keys that were renamed: the names a key had before, by its name of today.
FORMER_NAMES: dict[str, set[str]] = {}


class Table(BaseModel):
    """Base of all tables: frozen, unknown keys refused, numbers finite.

    A key that was renamed keeps its former names, in `validation_alias=AliasChoices(name, former, ...)`.
    """

    model_config = ConfigDict(
        frozen=True,
        extra="forbid",
        allow_inf_nan=False,
        field_title_generator=_title,
        defer_build=True,  # validators are built when a scene is read: 0.1 s of a process that reads none
    )

    former: ClassVar[Mapping[str, str]] = {}  # of each former name, the key of today
    usual: ClassVar[tuple[str, ...]] = ()  # keys that examples show beside those that are required
    instead: ClassVar[Mapping[str, str]] = {}  # of keys that other tables have and this one cannot: what to do
    # Of keys that are no more, the value at which they asked for nothing: results of before 0.7 name every key.
    asked_nothing: ClassVar[Mapping[str, Any]] = {}
    # Of a table and its bases the methods called _check..: each yields groups of findings, of which the first refuses.
    checks: ClassVar[tuple[Callable[[Any], Any], ...]] = ()
    bases_last: ClassVar[bool] = False  # whether the keys of its bases come behind those of a table

    @classmethod
    def without_former(cls, value: Any) -> Any:
        """The keys of a table, without those that are no more where they ask for nothing."""
        if not isinstance(value, Mapping):
            return value
        return {key: x for key, x in value.items() if key not in cls.asked_nothing or x != cls.asked_nothing[key]}

    @classmethod
    def __pydantic_init_subclass__(cls, **kwargs: Any) -> None:
        tables = (base for base in reversed(cls.__mro__) if issubclass(base, Table))
        known = {name: x for base in tables for name, x in vars(base).items()}
        cls.checks = tuple(x for name, x in known.items() if name.startswith("_check"))
        if cls.bases_last:
            order = dict.fromkeys(name for base in cls.__mro__ for name in inspect.get_annotations(base))
            for name in (x for x in order if x in cls.model_fields):
                cls.model_fields[name] = cls.model_fields.pop(name)
        named = {name: field.validation_alias for name, field in cls.model_fields.items()}
        cls.former = {
            str(old): name
            for name, alias in named.items()
            if isinstance(alias, AliasChoices)
            for old in alias.choices
            if old != name
        }
        for old, name in cls.former.items():
            FORMER_NAMES.setdefault(name, set()).add(old)

    @model_validator(mode="after")
    def _judged(self) -> Self:
        for check in self.checks:
            for findings in check(self):
                refuse(findings)
        return self

    if not TYPE_CHECKING:

        def __getattr__(self, name: str) -> Any:
            now = type(self).former.get(name)
            if now is None:
                return super().__getattr__(name)
            warnings.warn(f"{name} is now {now}", DeprecationWarning, stacklevel=2)
            return getattr(self, now)

    @classmethod
    def shown(cls) -> list[str]:
        """Keys of the shortest example: those that are required, and the usual ones."""
        return [name for name, field in cls.model_fields.items() if field.is_required() or name in cls.usual]

    def named_files(self) -> list[str]:
        """Paths of the files that are read, for this table and for those within it."""
        return sorted({path for *_, path in places_of_files(self.model_dump(mode="json"))})

    def __dir__(self) -> list[str]:
        """Without the names that pydantic has deprecated (`copy`, `dict`, `json`, ...) and its class methods."""
        kept = {"model_copy", "model_dump", "model_dump_json"}
        return sorted(n for n in super().__dir__() if n in kept or n.startswith("__") or not hasattr(BaseModel, n))


def places_of_files(data: Any) -> Iterator[tuple[Any, Any, str]]:
    """Where tables name files that are read: a table, its key and the path that it has there."""
    for key, value in data.items() if isinstance(data, dict) else enumerate(data) if isinstance(data, list) else ():
        if key in ("file", "rao") and isinstance(value, str):
            yield data, key, value
        else:
            yield from places_of_files(value)


def as_written(table: Mapping[str, Any], key: str) -> str:
    """How a key of today is spelt in a table that may use a former name of it."""
    former = FORMER_NAMES.get(key, ()) if key not in table else ()
    return next((old for old in former if old in table), key)


@dataclass(frozen=True)
class Words:
    """How messages call a type whose Python annotation is not enough."""

    text: str


@dataclass(frozen=True)
class Finding:
    """A contradiction: the key (relative to the table that found it), what would fit, what to do.

    `given` replaces the value as written where that alone would not tell what is wrong.
    """

    at: Place
    expected: str
    fix: str = ""
    given: str | None = None


Findings = Iterator[Iterable[Finding]]  # groups, of which the first that is not empty refuses


def refuse(findings: Iterable[Finding]) -> None:
    """Raise one pydantic error that carries all `findings`; none, and nothing happens."""
    found = tuple(findings)
    if found:
        text = "; ".join(f"{dotted(f.at)}: expected {f.expected}{'; try: ' + f.fix if f.fix else ''}" for f in found)
        raise PydanticCustomError("findings", "{text}", {"text": text, "findings": found})


def dotted(path: Iterable[str | int]) -> str:
    """``("cable", "sections", 0, "mass")`` -> ``cable.sections[0].mass``."""
    text = ""
    for part in path:
        name = part if isinstance(part, int) or part.isprintable() else repr(part)[1:-1]
        text += f"[{part}]" if isinstance(part, int) else f".{name}" if text else str(name)
    return text


# --- numbers, words, vectors -------------------------------------------------------------------


def unwrap(value: Any) -> Any:
    """Numpy scalars and arrays as plain Python, so that Python users need not convert."""
    return value.tolist() if hasattr(value, "tolist") else value


def _a_number(value: Any) -> float:
    value = unwrap(value)
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise PydanticCustomError("number", "a number is needed")
    if LARGEST_NUMBER < abs(value) < math.inf:
        raise PydanticCustomError("large_number", "the number is too large", {"most": LARGEST_NUMBER})
    return float(value)


def _not_tiny(value: float) -> float:
    if 0.0 < value < SMALLEST_NUMBER:
        raise PydanticCustomError("tiny_number", "the number is too small", {"least": SMALLEST_NUMBER})
    return value


def _a_whole_number(value: Any) -> int:
    value = unwrap(value)
    if isinstance(value, bool) or not isinstance(value, int | float) or value % 1 != 0:  # not of nan and inf either
        raise PydanticCustomError("whole_number", "a whole number is needed")
    if abs(value) > LARGEST_COUNT:
        raise PydanticCustomError("large_number", "the number is too large", {"most": LARGEST_COUNT})
    return int(value)


def numbers(n: int) -> Callable[[Any], Any]:
    def check(value: Any) -> Any:
        value = unwrap(value)
        if not isinstance(value, list | tuple) or len(value) != n:
            raise PydanticCustomError("vector", "{n} numbers are needed", {"n": n})
        return value

    return check


def _a_truth(value: Any) -> Any:
    # pydantic would take "yes", "on" and 1, which YAML 1.2 no longer calls booleans
    if not isinstance(value, bool):
        raise PydanticCustomError("truth", "true or false is needed")
    return value


def _one_line(value: str) -> str:
    value = value.strip()
    if not value.isprintable():
        raise PydanticCustomError("one_line", "one line of printable text is needed")
    return value


def _points_somewhere(value: tuple[float, float, float]) -> tuple[float, float, float]:
    if not SHORTEST_DIRECTION <= math.hypot(*value) <= LONGEST_DIRECTION:
        raise PydanticCustomError("direction", "a direction needs a length that is neither zero nor immense")
    return value


class Reading:
    """What is done to a value before it is read, as by pydantic's BeforeValidator.

    That one inspects the function's signature anew wherever such a value stands, a fifth of the time that it takes to
    build a scene's tables.
    """

    function: Callable[[Any], Any]

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        return core_schema.no_info_before_validator_function(self.function, handler(source))


@dataclass(frozen=True)
class Before(Reading):
    """That it is done by a function."""

    function: Callable[[Any], Any]


@dataclass(frozen=True)
class After:
    """The same, when it has been read."""

    function: Callable[[Any], Any]

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        return core_schema.no_info_after_validator_function(self.function, handler(source))


Text = Annotated[str, Field(strict=True), After(_one_line), Words("one line of text")]
Number = Annotated[float, Before(_a_number), Field(allow_inf_nan=False)]
Positive = Annotated[Number, Field(gt=0), After(_not_tiny)]
NonNegative = Annotated[Number, Field(ge=0), After(_not_tiny)]
Whole = Annotated[int, Before(_a_whole_number)]
Truth = Annotated[bool, Before(_a_truth)]
Vector = Annotated[tuple[Number, Number, Number], Before(numbers(3)), Words("three numbers [x, y, z]")]
Direction = Annotated[
    tuple[Number, Number, Number],
    Before(numbers(3)),
    After(_points_somewhere),
    Words("a direction [x, y, z], not all zero"),
]
Pair = Annotated[tuple[Number, Number], Before(numbers(2)), Words("two numbers")]
PositivePair = Annotated[tuple[Positive, Positive], Before(numbers(2)), Words("two numbers > 0")]
NonNegativePair = Annotated[tuple[NonNegative, NonNegative], Before(numbers(2)), Words("two numbers >= 0")]


def parallel(a: tuple[float, float, float], b: tuple[float, float, float]) -> bool:
    """Whether two directions (or their opposites) are the same line."""
    return math.hypot(*cross(unit(a), unit(b))) < PARALLEL


def cross(a: tuple[float, float, float], b: tuple[float, float, float]) -> tuple[float, float, float]:
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


def unit(a: tuple[float, float, float]) -> tuple[float, float, float]:
    length = math.hypot(*a)
    return (a[0] / length, a[1] / length, a[2] / length)


def xyz(v: Any) -> str:
    """A place or a vector, for people."""
    return f"[{v[0]:.8g}, {v[1]:.8g}, {v[2]:.8g}]"


def turned(angles: tuple[float, float, float], vector: tuple[float, float, float]) -> tuple[float, float, float]:
    """A vector turned by roll, pitch and yaw [deg], in this order, about the inertial axes."""
    (cx, cy, cz), (sx, sy, sz) = ([f(math.radians(a)) for a in angles] for f in (math.cos, math.sin))
    x, y, z = vector
    y, z = cx * y - sx * z, sx * y + cx * z
    x, z = cy * x + sy * z, -sy * x + cy * z
    return cz * x - sz * y, sz * x + cz * y, z


# --- unions: the branch meant is chosen by what was written, so errors speak of that branch only --


def value_or_table(value: Any) -> str:
    """Discriminator of `value | Table` unions."""
    return "<table>" if isinstance(value, Mapping | Table) else "<value>"


def table_or_list(value: Any) -> str:
    """Discriminator of `Table | list of tables` unions."""
    return "<list>" if isinstance(unwrap(value), list | tuple) else "<table>"


def number_or_list(value: Any) -> str:
    """Discriminator of `number | list of numbers` unions."""
    return "<list>" if isinstance(unwrap(value), list | tuple) else "<number>"


def by_kind(value: Any) -> str | None:
    """Discriminator of tables that say their `kind`."""
    kind = value.get("kind") if isinstance(value, Mapping) else getattr(value, "kind", None)
    return f"<{kind}>"


def by_kinds(union: Any) -> dict[str, Any]:
    """The tables of a union, as they are annotated, by their kind."""
    while get_origin(union) is Annotated:
        union = get_args(union)[0]
    return {get_args(_table(arm).model_fields["kind"].annotation)[0]: arm for arm in get_args(union)}


def _table(arm: Any) -> type[Table]:
    return get_args(arm)[0] if get_origin(arm) is Annotated else arm


@dataclass(frozen=True)
class Kinds:
    """Annotation of a union of tables by `kind`: checks it first and takes a bare word as ``{kind: word}``.

    `usual` names what to advise where no kind is given; `implied`: keys that only one kind has, and that kind;
    `gone`: kinds that are no more, and what to do.
    """

    usual: tuple[str, ...]
    implied: tuple[tuple[str, str], ...] = ()
    gone: tuple[tuple[str, str], ...] = ()

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        arms = by_kinds(source)
        descriptions = {kind: _table(arm).model_fields["kind"].description or "" for kind, arm in arms.items()}
        choices = {f"<{kind}>": handler.generate_schema(arm) for kind, arm in arms.items()}
        union = core_schema.tagged_union_schema(choices, by_kind)
        return core_schema.no_info_before_validator_function(partial(self.check, descriptions=descriptions), union)

    def __get_pydantic_json_schema__(self, schema: CoreSchema, handler: GetJsonSchemaHandler) -> dict[str, Any]:
        tables = handler(schema)
        descriptions = []
        for arm in tables.get("oneOf") or tables.get("anyOf") or []:
            # of a table that is described behind what has it: its kind and another key are required anyway
            with suppress(LookupError):
                descriptions.append(handler.resolve_ref_schema(arm))
        for table in descriptions:  # a kind that no other key tells has to be given
            if table["properties"]["kind"]["const"] not in {kind for _, kind in self.implied}:
                table["required"] = ["kind", *(x for x in table.get("required", ()) if x != "kind")]
        bare = [x for x in descriptions if not {*x.get("required", ())} - {"kind"} and "anyOf" not in x]
        alone = [table["properties"]["kind"]["const"] for table in bare]
        if not alone:  # every kind needs more than its name
            return tables
        return {"anyOf": [tables, {"enum": alone, "description": "short for {kind: ...}"}]}

    def check(self, value: Any, descriptions: Mapping[str, str]) -> Any:
        """`descriptions`: of each kind, from the schema."""
        if isinstance(value, Table):
            if getattr(value, "kind", None) not in descriptions:
                self._refuse_table(descriptions, f"a {type(value).__name__}")
            return value
        if isinstance(value, str):
            value = {"kind": value}
        if not isinstance(value, Mapping):
            self._refuse_table(descriptions, None)
        if "kind" not in value:
            implied = [kind for key, kind in self.implied if key in value]
            value = {"kind": implied[0], **value} if implied else value
        kind = value.get("kind")
        expected = f"one of: {', '.join(descriptions)}"
        if kind is None:
            fix = "write kind, not type" if "type" in value else f"add `kind: {self.usual[0]}`, or another of these"
            refuse([Finding(("kind",), expected, fix)])
        elif kind not in list(descriptions):  # it may be a list or a table
            fix = dict(self.gone).get(str(kind)) or nearest(str(kind), descriptions) or "write one of these"
            refuse([Finding(("kind",), expected, fix)])
        return value

    def _refuse_table(self, kinds: Iterable[str], given: str | None) -> NoReturn:
        first = next(iter(kinds))
        refuse([Finding((), f"a table with kind: {' | '.join(kinds)}", f"write {{kind: {first}, ...}}", given)])
        raise AssertionError("unreachable: refuse raises when there is a finding")


@dataclass(frozen=True)
class Renamed(Reading):
    """Annotation of a word that was renamed: its former names are read, with a note of what each is called today."""

    now: Mapping[str, str]

    def function(self, value: Any) -> Any:
        return self.now.get(value, value) if isinstance(value, str) else value


@dataclass(frozen=True)
class PlainNumber(Reading):
    """Annotation of a table for which a bare number may stand: ``2.0`` is ``{key: 2.0}``, for each of the keys."""

    keys: tuple[str, ...]

    def __get_pydantic_json_schema__(self, schema: CoreSchema, handler: GetJsonSchemaHandler) -> dict[str, Any]:
        return {"anyOf": [handler(schema), {"type": "number", "description": f"short for {self._table()}"}]}

    def function(self, value: Any) -> Any:
        value = unwrap(value)
        if not isinstance(value, int | float) or isinstance(value, bool):
            return value
        if len(self.keys) > 1 and not 0.0 <= value <= sys.float_info.max:  # one mistake, one complaint
            refuse([Finding((), f"a finite number >= 0, or a table {self._table()}", "check the number")])
        return dict.fromkeys(self.keys, value)

    def _table(self) -> str:
        return "{" + ", ".join(f"{key}: ..." for key in self.keys) + "}"


# What a word that the schema does not know may have meant: by its spelling, or by descriptions.

# What complaints about a text that is no YAML say.
READABLE = "a text that YAML can read"
WRITE_OUT = "begin anew from an example; every scene is a few tables within tables"
# Of a path of Windows in double quotes, where YAML takes \n and \t for characters.
PATHS = "write the path with /, as in C:/folder/file.csv, or in single quotes"
MOST = 3  # so many of the schema's words are proposed at most


def nearest(word: str, known: Mapping[str, str] | Iterable[str], shown: Mapping[str, str] | None = None) -> str:
    """What `word` may have meant among the words `known`, as a question; empty if nothing is near.

    known: words, or words with their descriptions, which hold symbols and other names (``EI``, ``wind``).
    shown: what to show of a word that is known by its description, such as its unit.
    """
    texts = known if isinstance(known, Mapping) else dict.fromkeys(known, "")
    meant = [name for name, text in texts.items() if speaks_of(text, word)]
    near = difflib.get_close_matches(word.lower(), texts, n=1, cutoff=0.6)
    if near and not meant:
        return f"did you mean {near[0]}?"
    if not meant and len(word) > MOST:
        meant = [name for name, text in texts.items() if _like_a_word_of(text, word)]
    return f"did you mean {' or '.join((shown or {}).get(name, name) for name in meant[:MOST])}?" if meant else ""


def speaks_of(text: str, word: str) -> bool:
    """Whether a description holds a word, or the words of a key."""
    return re.search(rf"\b{re.escape(word.lower().replace('_', ' '))}\b", text.lower()) is not None


def _like_a_word_of(text: str, word: str) -> bool:
    return bool(difflib.get_close_matches(word.lower(), re.findall(r"\w+", text.lower()), n=1, cutoff=0.8))


def did_you_mean(word: str, known: Mapping[str, str] | Iterable[str]) -> str:
    """The fix for a misspelt word: the nearest known one, or all of them."""
    words = list(known)
    return nearest(word, known) or f"known here: {', '.join(words)}"


def decimal_comma(text: str) -> str:
    """The fix for a number with a decimal comma."""
    return f"a decimal comma? write {text.replace(',', '.').strip()}"
