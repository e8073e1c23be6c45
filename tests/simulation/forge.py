"""Forges checkpoints, and resumes from them in this process; test_resume_releases.py starts it.

    python forge.py GOOD.h5 FOLDER FIRST LAST

prints a line of JSON per forgery: its number, what came of it, and a text.  Memory is limited to 1 GB more than a good
run takes.
"""

from __future__ import annotations

import hashlib
import json
import random
import resource
import sys
import warnings
import zlib
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from bits import differences

import hybrid
from hybrid.store.integrity import MAGIC, pack
from hybrid.store.whole_file import BEFORE, SLOTS, read_checkpoint

MEMORY = 1 << 30  # bytes
BOMB = 1 << 32  # bytes, of zeros in 4 MB


def replaced(file: h5py.File, make: Any) -> None:
    """Both slots are something else: make(file, name, bytes of the good one)."""
    for name in SLOTS:
        data = file[name][()]
        del file[name]
        make(file, name, data)


def bomb(file: h5py.File, name: str, data: np.ndarray) -> None:
    file.create_dataset(name, (BOMB,), "u1", chunks=(BOMB >> 10,), compression="gzip")
    for k in range(16):
        file[name].id.write_direct_chunk((k * (BOMB >> 10),), ZEROS)


def virtual(file: h5py.File, name: str, data: np.ndarray) -> None:
    layout = h5py.VirtualLayout((len(data),), "u1")
    layout[:] = h5py.VirtualSource(sys.argv[1], SLOTS[0], (len(data),))
    file.create_virtual_dataset(name, layout)


def whole_group(file: h5py.File) -> None:
    del file["checkpoint"]
    file["checkpoint"] = h5py.ExternalLink(sys.argv[1], "checkpoint")


TEXT = h5py.string_dtype()
CONTAINERS: list[Any] = [
    lambda f: replaced(f, lambda f, n, d: f.create_dataset(n, data=d.astype(float))),
    lambda f: replaced(f, lambda f, n, d: f.create_dataset(n, data=d.reshape(1, -1))),
    lambda f: replaced(f, lambda f, n, d: f.create_dataset(n, data=np.array(["a" * 100] * 3, TEXT), dtype=TEXT)),
    lambda f: replaced(f, lambda f, n, d: f.create_dataset(n, data=d.tobytes().decode("latin-1").replace("\0", " "))),
    lambda f: replaced(f, lambda f, n, d: f.create_dataset(n, data=h5py.Empty("u1"))),
    lambda f: replaced(f, lambda f, n, d: f.create_dataset(n, data=[f["t"].ref] * 9, dtype=h5py.ref_dtype)),
    lambda f: replaced(f, lambda f, n, d: f.create_dataset(n, (9,), h5py.vlen_dtype(np.uint8))),
    lambda f: replaced(f, lambda f, n, d: f.create_dataset(n, (1 << 44,), "u1", chunks=(65536,))),
    lambda f: replaced(f, lambda f, n, d: f.create_dataset(n, (1 << 20, 1 << 20), "u1", chunks=(64, 64))),
    lambda f: replaced(f, lambda f, n, d: f.create_dataset(n, (len(d),), "u1", external=[(sys.argv[1], 0, len(d))])),
    lambda f: replaced(f, lambda f, n, d: f.create_dataset(n, (100,), "u1", external=[("/dev/zero", 0, 100)])),
    lambda f: replaced(f, virtual),
    lambda f: replaced(f, bomb),
    lambda f: replaced(f, lambda f, n, d: f.create_dataset(n, data=d, compression="gzip")),
    lambda f: replaced(f, lambda f, n, d: f.__setitem__(n, h5py.ExternalLink(sys.argv[1], n))),
    lambda f: replaced(f, lambda f, n, d: f.__setitem__(n, h5py.ExternalLink("/dev/zero", n))),
    lambda f: replaced(f, lambda f, n, d: f.__setitem__(n, h5py.SoftLink("/nowhere"))),
    lambda f: replaced(f, lambda f, n, d: f.__setitem__(n, h5py.SoftLink("/" + n))),
    lambda f: replaced(f, lambda f, n, d: f.create_group(n)),
    lambda f: replaced(f, lambda f, n, d: f.__setitem__(n, np.dtype("f8"))),
    whole_group,
    lambda f: f.__delitem__("checkpoint"),
    lambda f: f.create_dataset(BEFORE, (1 << 44,), "u1", chunks=(65536,)),
    lambda f: f.create_dataset(BEFORE, data=np.zeros(100, "u1")),
    lambda f: f.create_dataset("huge", (1 << 22, 1 << 20), "f8", chunks=(64, 64)),
    lambda f: f.create_dataset("elsewhere", (8,), "u1", external=[("/etc/hostname", 0, 8)]),
]
ZEROS = b""  # a compressed chunk of zeros


def odd(rng: random.Random, x: Any) -> Any:
    """Something else than x, mostly of another type, shape or size."""
    if isinstance(x, np.ndarray) and rng.random() < 0.8:
        flat = x.reshape(-1)
        way = rng.randrange(8)
        if way == 0:
            return x.astype(rng.choice([np.float64, np.int64, np.int32, np.uint8, bool]))
        if way == 1:
            return flat[: rng.randrange(flat.size + 1)]
        if way == 2:
            return np.concatenate([flat, flat, flat[:1]])
        if way == 3:
            return x.reshape(1, *x.shape) if x.ndim < 4 else flat
        if way == 4:
            return np.zeros(rng.choice([(0,), (), (1,), (1, 1), (100_000,), (3, 0)]), x.dtype)
        y = x.copy()
        if y.size:
            wrong = [np.nan, np.inf, -np.inf, 1e308, -1e308, 0.0] if y.dtype.kind == "f" else [-1, 2**31 - 1, 2**62, 7]
            value = rng.choice(wrong) if y.dtype.kind != "b" else True
            y.reshape(-1)[rng.randrange(y.size) if way < 7 else slice(None)] = np.array(value).astype(y.dtype)
        return y
    if isinstance(x, float | int) and rng.random() < 0.5:
        return type(x)(rng.choice([0, -1, 2**31, 2**62, -(2**62)]))
    return rng.choice(
        [None, True, -1, 0, 10**9, 1e300, float("nan"), float("inf"), "", "x" * 100_000, [], {}, [[]] * 50, {"a": {}},
         np.zeros(0), np.zeros((2, 2)), np.zeros(3, int), np.zeros(5, bool), {"@array": ["<f8", [1 << 40], 0]},
         {"@array": ["|O", [1], 0]}, {"@array": ["<f8", [2], -8]}, {"@array": ["<f8", [1 << 62, 4], 0]}]
    )  # fmt: skip


def leaves(x: Any, where: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    """Ways to all that is in a tree, tables and lists as well."""
    inner = x.items() if isinstance(x, dict) else enumerate(x) if isinstance(x, list) else ()
    return [where, *(way for key, y in inner for way in leaves(y, (*where, key)))]


def mutated(rng: random.Random, tree: dict[str, Any]) -> dict[str, Any]:
    """A tree of which some things are other, missing or too many."""

    def copied(x: Any) -> Any:
        return (
            {k: copied(y) for k, y in x.items()} if isinstance(x, dict)
            else [copied(y) for y in x] if isinstance(x, list | tuple) else x
        )  # fmt: skip

    tree = copied(tree)
    for _ in range(rng.choice([1, 1, 1, 3])):
        *way, last = rng.choice(leaves(tree)[1:])
        at: Any = tree
        for key in way:
            at = at[key]
        act = rng.randrange(8)
        if act == 0:
            del at[last]
        elif act == 1 and isinstance(at, dict):
            at["surplus"] = odd(rng, at[last])
        elif act == 1:
            at.append(odd(rng, at[last]))
        else:
            at[last] = odd(rng, at[last])
    return tree


def forged(number: int, good: Path, path: Path) -> None:
    """The file of this number: containers first, then checkpoints whose digest is right, then bits of the bytes."""
    rng = random.Random(number)
    path.write_bytes(good.read_bytes())
    with h5py.File(path, "r+", libver=("v110", "v110")) as file:
        if number < len(CONTAINERS):
            CONTAINERS[number](file)
            return
        point = read_checkpoint(file)._asdict()
        if rng.random() < 0.8:
            data = pack(mutated(rng, point))
        else:
            raw = bytearray(pack(point))
            for _ in range(rng.choice([1, 1, 10])):
                raw[rng.randrange(len(raw))] ^= 1 << rng.randrange(8)
            data = bytes(raw)
            if rng.random() < 0.3:
                data = MAGIC.replace(b"2", rng.choice([b"1", b"3", b"\xff"])) + data[len(MAGIC) :]
            elif rng.random() < 0.7:  # with a digest that is right
                body = data[len(MAGIC) + 16 :]
                data = MAGIC + hashlib.blake2b(body, digest_size=16).digest() + body
        for name in SLOTS:
            file[name].resize(len(data), axis=0)
            file[name][:] = np.frombuffer(data, "u1")


def outcome(path: Path, whole: Path) -> tuple[str, str]:
    """What came of resuming: refused, resumed, other (a run from other numbers), stopped, or a fault."""
    before = path.read_bytes()
    try:
        hybrid.resume(path).close()
    except hybrid.ResultError as error:
        text = str(error)
        if "is not finite at t" in text:  # what was forged has grown, and the recorder refuses it
            return "stopped", text
        if str(path) not in text or "try:" not in text:
            return "fault", f"no file or no remedy: {text}"
        return ("refused", text) if path.read_bytes() == before else ("fault", f"refused and changed: {text}")
    except hybrid.ComputationError as error:
        return "stopped", str(error)
    except Exception as error:
        return "fault", f"{type(error).__name__}: {str(error)[:300]}"
    return ("resumed" if not differences(path, whole) else "other"), ""


def main() -> None:
    global ZEROS
    good, folder, first, last = Path(sys.argv[1]), Path(sys.argv[2]), *map(int, sys.argv[3:5])
    warnings.simplefilter("ignore", RuntimeWarning)  # of numbers near the largest there is
    path, whole = folder / "forged.h5", folder / f"whole{first}.h5"
    whole.write_bytes(good.read_bytes())
    hybrid.resume(whole).close()  # kernels are loaded
    ZEROS = zlib.compress(bytes(BOMB >> 10))
    size = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (size + MEMORY, size + MEMORY))
    for number in range(first, last):
        for left in folder.glob("forged*"):
            left.unlink()
        forged(number, good, path)
        kind, text = outcome(path, whole)
        print(json.dumps({"number": number, "kind": kind, "text": text}), flush=True)


if __name__ == "__main__":
    main()
