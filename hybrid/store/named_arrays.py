"""Named arrays and plain values as bytes, and back, without any trust in the bytes.

A tree is a dict of names to arrays, numbers, texts, None, lists and dicts of these.  As bytes it is a magic word with
the number of the format, a digest of what follows, the length of what follows, the length of the head (8 bytes each,
little endian), the head (the tree as JSON, in which an array is {"@array": [dtype, shape, offset]}) and the arrays, one
after the other.  Nothing in them names a class or a function, and no array is longer than the bytes that are there.
"""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Mapping
from typing import Any

import numpy as np

MAGIC = b"hybrid checkpoint 2\n"
DIGEST = 16  # bytes; it guards against a torn write, not against people
DTYPES = {name: np.dtype(name) for name in ("<f8", "<i8", "<i4", "|i1", "|u1", "|b1")}
MOST_DIMENSIONS = 4
ARRAY = "@array"

Tree = dict[str, Any]


def pack(tree: Mapping[str, Any]) -> bytes:
    """A tree as bytes."""
    arrays = _Arrays()
    head = json.dumps(_plain(tree, arrays)).encode()
    body = b"".join([len(head).to_bytes(8, "little"), head, *arrays.parts])
    body = len(body).to_bytes(8, "little") + body
    return MAGIC + hashlib.blake2b(body, digest_size=DIGEST).digest() + body


class _Arrays:
    """Bytes of arrays one after the other, and their number so far."""

    def __init__(self) -> None:
        self.parts: list[bytes] = []
        self.size = 0

    def add(self, part: bytes) -> int:
        """Where the part begins."""
        at, self.size = self.size, self.size + len(part)
        self.parts.append(part)
        return at


def _plain(x: Any, arrays: _Arrays) -> Any:
    """What JSON can write; the bytes of arrays are added to `arrays`."""
    if isinstance(x, Mapping):
        return {name: _plain(value, arrays) for name, value in x.items()}
    if isinstance(x, list | tuple):
        return [_plain(value, arrays) for value in x]
    if isinstance(x, np.generic):
        return x.item()
    if not isinstance(x, np.ndarray):
        return x
    name = x.dtype.newbyteorder("<").str
    if name not in DTYPES:
        raise TypeError(f"an array of type {x.dtype} cannot be in a checkpoint")
    return {ARRAY: [name, list(x.shape), arrays.add(np.asarray(x, name).tobytes())]}


def unpack(data: bytes) -> Tree:
    """The tree again; what follows it in `data` is not read.  ValueError if the bytes are none, or spoilt."""
    begin = len(MAGIC) + DIGEST
    kind, _, number = data[: len(MAGIC)].rpartition(b" ")
    if kind == MAGIC.rpartition(b" ")[0] and data[: len(MAGIC)] != MAGIC:
        theirs, ours = number.decode("ascii", "replace").strip(), MAGIC.split()[-1].decode()
        raise ValueError(f"it has checkpoint format {theirs}; this program reads format {ours}")
    if not data.startswith(MAGIC):
        raise ValueError("it does not begin as a checkpoint does")
    body = data[begin : begin + 8 + int.from_bytes(data[begin : begin + 8], "little")]
    if hashlib.blake2b(body, digest_size=DIGEST).digest() != data[len(MAGIC) : begin]:
        raise ValueError("its digest is another: it was cut off, or has changed")
    split = 16 + int.from_bytes(body[8:16], "little")
    try:
        found = _with_arrays(json.loads(body[16:split]), memoryview(body)[split:])
    except RecursionError as error:
        raise ValueError(str(error)) from None
    if not isinstance(found, dict):
        raise ValueError("it is no table of names")
    return found


def _with_arrays(x: Any, arrays: memoryview) -> Any:
    """What JSON has read, with its arrays."""
    if isinstance(x, list):
        return [_with_arrays(value, arrays) for value in x]
    if isinstance(x, dict):
        if x.keys() == {ARRAY}:
            return _array(x[ARRAY], arrays)
        return {name: _with_arrays(value, arrays) for name, value in x.items()}
    if isinstance(x, int) and x.bit_length() > 63:
        raise ValueError("a number has more than 64 bits")
    return x


def _array(said: Any, data: memoryview) -> np.ndarray:
    """An array; what is `said` of it: type, shape, where its bytes begin."""
    if not (isinstance(said, list) and len(said) == 3 and isinstance(said[0], str) and isinstance(said[1], list)):
        raise ValueError("an array has no type, shape and place")
    name, shape, at = said
    counts = [*shape, at]
    if name not in DTYPES or len(shape) > MOST_DIMENSIONS or not all(type(x) is int and x >= 0 for x in counts):
        raise ValueError(f"an array of type {name!r:.20} and shape {shape!s:.60} is none")
    end = at + math.prod(shape) * DTYPES[name].itemsize
    if end > len(data) or max(shape, default=0) > len(data):
        raise ValueError(f"an array of shape {shape!s:.60} has more numbers than are there")
    array = np.frombuffer(data[at:end], DTYPES[name]).reshape(shape).copy()
    if name == "|b1":
        array = array.view(np.uint8) != 0  # any other byte than 0 and 1 would be neither true nor false
    return array


def matched(saved: Any, template: Any, where: str = "") -> Any:
    """`saved`, if it has the form of `template`: the same names, types and shapes; ValueError where it has not.

    Numbers must be finite where those of the template are.  None in the template stands for what its owner checks, and
    so does an array of no size.
    """
    if template is None:
        return saved
    if isinstance(template, Mapping):
        if not isinstance(saved, dict) or saved.keys() != template.keys():
            raise _odd(where, "a table of " + ", ".join(template), saved)
        return {name: matched(saved[name], x, f"{where}/{name}" if where else name) for name, x in template.items()}
    if isinstance(template, list | tuple):
        if not isinstance(saved, list) or len(saved) != len(template):
            raise _odd(where, f"a list of {len(template)}", saved)
        return [matched(x, y, f"{where}/{k}") for k, (x, y) in enumerate(zip(saved, template, strict=True))]
    if isinstance(template, np.ndarray):
        good = isinstance(saved, np.ndarray) and saved.dtype == template.dtype
        if not good or (template.size and saved.shape != template.shape):
            raise _odd(where, f"{template.dtype} of shape {template.shape}", saved)
    elif type(saved) is not type(template.item() if isinstance(template, np.generic) else template):
        raise _odd(where, type(template).__name__, saved)
    if isinstance(saved, float | np.ndarray) and not _finite(saved, template):
        raise _odd(where, "finite numbers", saved)
    return saved


def _finite(x: Any, template: Any) -> bool:
    if np.isfinite(x).all():
        return True
    return bool((np.isnan(template).any() or not np.isnan(x).any()) and not np.isfinite(template).all())


def _odd(where: str, expected: str, given: Any) -> ValueError:
    what = f"{given.dtype} of shape {given.shape}" if isinstance(given, np.ndarray) else f"{given!r:.40}"
    return ValueError(f"{where or 'it'}: expected {expected}, found {what}")
