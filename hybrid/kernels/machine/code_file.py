"""Machine code of one kernel in a file: a magic word, the number of the format, a header in JSON, the object.

What is read is executed, so nothing else in it is: no pickle, and no byte before the digest of header and object is
right.  The digest finds damage; who may write such a file is a matter of its folder and owner (kernels.machine.cache).
"""

from __future__ import annotations

import hashlib
import json
import os
import stat
import struct
import uuid
from contextlib import suppress
from pathlib import Path
from typing import Any

MAGIC, FORMAT = b"hybrid machine code\n", 2
SUFFIX = ".kernel"
_SIZES = struct.Struct("<II")  # number of the format, bytes of the header
_LONGEST_HEADER = 1 << 20


class Unusable(Exception):
    """Why a file of machine code is not used."""


def digest(*parts: str | bytes) -> str:
    """SHA-256 of parts, none of which runs into the next."""
    made = hashlib.sha256()
    for part in parts:
        data = part.encode() if isinstance(part, str) else part
        made.update(b"%d:" % len(data))
        made.update(data)
    return made.hexdigest()


def write_code(path: Path, header: dict[str, Any], code: bytes) -> None:
    """Write a file, or leave none: it is moved to its name when it is complete.  header: values of JSON."""
    header = header | {"bytes": len(code)}
    text = json.dumps(header | {"sha256": _sum_of(header, code)}).encode()
    new = path.with_name(f"{path.name}.{uuid.uuid4().hex[:16]}")
    try:
        with open(new, "xb", opener=lambda name, flags: os.open(name, flags, 0o644)) as file:  # whatever the umask
            file.write(MAGIC + _SIZES.pack(FORMAT, len(text)) + text + code)
        new.replace(path)
    except OSError:
        with suppress(OSError):
            new.unlink()
        raise


def read_code(path: Path, expected: dict[str, Any], trust: bool) -> tuple[dict[str, Any], bytes] | None:
    """Header and object of a file, or None where there is none; Unusable says what is wrong with it.

    expected: what the header must say.  trust: whoever owns the file and may write to it.
    """
    try:
        with path.open("rb") as file:
            why = None if trust else others_may_write(os.fstat(file.fileno()))
            if why:
                raise Unusable(why)
            data = file.read()
    except FileNotFoundError:
        return None
    except OSError as error:
        raise Unusable(error.strerror or str(error)) from None
    header, code = _parts(data)
    wrong = [name for name, value in expected.items() if header.get(name) != value]
    if wrong:
        raise Unusable(f"is of another {', '.join(wrong)}")
    return header, code


def others_may_write(found: os.stat_result) -> str | None:
    """Why a file or folder is not this user's alone to write; None if it is, or is root's."""
    if not hasattr(os, "getuid"):  # caches of Windows lie in folders of one user
        return None
    if found.st_uid not in (os.getuid(), 0):
        return f"belongs to another user ({found.st_uid})"
    if stat.S_IMODE(found.st_mode) & 0o022:
        return f"can be written by other users (mode {stat.S_IMODE(found.st_mode):o})"
    return None


def _parts(data: bytes) -> tuple[dict[str, Any], bytes]:
    """Header and object of the content of a file, whose digest is right."""
    begin = len(MAGIC) + _SIZES.size
    if len(data) < begin or not data.startswith(MAGIC):
        raise Unusable("is no machine code of hybrid" if data else "is empty")
    form, size = _SIZES.unpack_from(data, len(MAGIC))
    if form != FORMAT:
        raise Unusable(f"has the format {form}, not {FORMAT}")
    if size > _LONGEST_HEADER or begin + size > len(data):
        raise Unusable("is truncated")
    try:
        header = json.loads(data[begin : begin + size])
        found = header.pop("sha256")
    except (ValueError, RecursionError, KeyError, AttributeError, TypeError):
        raise Unusable("is damaged") from None
    code = data[begin + size :]
    if header.get("bytes") != len(code):
        raise Unusable("is truncated")
    if found != _sum_of(header, code):
        raise Unusable("is damaged")
    return header, code


def _sum_of(header: dict[str, Any], code: bytes) -> str:
    return digest(json.dumps(header, sort_keys=True), code)
