"""Objects of a run as bytes, and back: what goes on from them goes on bit for bit.

Pickle keeps what is shared shared, which is what "bit for bit" hangs on: a state that two objects hold, a push that
asks whether it has seen an array before.  But pickle runs what it reads.  So only classes of the rooms that compute
are let in, none of which does anything when it is made, and what lies outside a run (the motions of the ends, a
user's criterion) has a name in the bytes and is given back when they are read.
"""

from __future__ import annotations

import hashlib
import importlib
import io
import pickle
from collections.abc import Mapping
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Any

import hybrid
from hybrid.errors import ResultError
from hybrid.kernels.compile import kernel_hash

# Whose classes may be in the bytes.  None of them opens a file or starts anything when it is made.
ROOMS = ("errors", "kernels", "simulation", "adapt", "model", "solve")
NUMPY = {
    ("numpy", "dtype"), ("numpy", "ndarray"),
    *((f"numpy.{core}.multiarray", name) for core in ("core", "_core") for name in ("_reconstruct", "scalar")),
    *((f"numpy.{core}.numeric", "_frombuffer") for core in ("core", "_core")),
}  # fmt: skip

# Rooms that have a part in the numbers of a file.
COMPUTES = ("adapt", "errors", "kernels", "model", "outputs", "scene", "simulation", "solve", "store")
NOTHING: Mapping[str, object] = {}


@cache
def program() -> str:
    """Which program this is, for bytes that only the same one may read: version, and a hash of all that computes."""
    digest, package = hashlib.sha256(kernel_hash().encode()), Path(__file__).parents[1]
    digest.update(f"scipy {version('scipy')} h5py {version('h5py')}".encode())
    for file in sorted(package.rglob("*.py")):
        if file.relative_to(package).with_suffix("").parts[0] in COMPUTES:
            digest.update(file.read_bytes())
    return f"{hybrid.__version__} {digest.hexdigest()[:16]}"


def freeze(thing: Any, outside: Mapping[str, object] = NOTHING) -> bytes:
    """An object as bytes; outside: what is not part of it, by the name under which `thaw` gives it back."""
    names = {id(x): name for name, x in outside.items() if x is not None}
    out = io.BytesIO()

    class Pickler(pickle.Pickler):
        def persistent_id(self, x: Any) -> str | None:
            return names.get(id(x))

    Pickler(out, 5).dump(thing)
    return out.getvalue()


def thaw(data: bytes, outside: Mapping[str, object] = NOTHING) -> Any:
    """The object again.  ResultError if the bytes hold anything that a run does not."""

    class Unpickler(pickle.Unpickler):
        def persistent_load(self, name: Any) -> object:
            return outside[name]

        def find_class(self, module: str, name: str) -> Any:
            room = module.removeprefix("hybrid.").split(".")[0] if module.startswith("hybrid.") else ""
            if (module, name) in NUMPY or (room in ROOMS and name.isidentifier()):
                found = getattr(importlib.import_module(module), name)
                ours = isinstance(found, type) and found.__module__ == module  # not what the room has imported
                if ours or (module, name) in NUMPY:
                    return found
            raise pickle.UnpicklingError(f"{module}.{name} is no part of a run")

    try:
        return Unpickler(io.BytesIO(data)).load()
    except Exception as error:  # damaged bytes make pickle raise almost anything
        advice = f"    detail:   {error}\n    try:      run the scene again"
        raise ResultError(f"the checkpoint cannot be read\n{advice}") from error
