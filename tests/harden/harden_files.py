"""Spoilt result files, opened one after the other: a program of its own, because HDF5 may crash on them.

    python harden_files.py GOOD.h5 FOLDER FIRST LAST PLOT_EVERY

prints a line of JSON per variant, before it is opened (its number) and after (what came of it).
"""

from __future__ import annotations

import contextlib
import io
import json
import random
import signal
import sys
import warnings
from pathlib import Path
from typing import Any

import numpy as np

LONGEST = 20.0  # s of processor time, whatever else the machine does: a file that takes longer hangs


class TooLong(BaseException):
    """A file took longer than LONGEST."""


def spoilt(rng: random.Random, good: bytes) -> bytes:
    """A variant of a file: bits and bytes changed, stretches zeroed, swapped or cut out, the end cut off."""
    data, way = bytearray(good), rng.randrange(7)
    if way == 0:
        return bytes(data[: rng.randrange(len(data))])
    if way == 1:
        return bytes(data) + rng.randbytes(rng.randrange(1, 4096))
    for _ in range(rng.choice([1, 1, 3, 20])):
        i, n = rng.randrange(len(data)), rng.choice([1, 4, 8, 64, 512, 4096])
        if way == 2:
            data[i] ^= 1 << rng.randrange(8)
        elif way == 3:
            data[i] = rng.randrange(256)
        elif way == 4:
            data[i : i + n] = bytes(len(data[i : i + n]))
        elif way == 5:
            data[i : i + n] = rng.randbytes(len(data[i : i + n]))
        else:
            j = rng.randrange(len(data))
            part = data[j : j + n]
            data[i : i + len(part)] = part[: len(data) - i]
    return bytes(data)


def contents(path: Path) -> dict[str, Any]:
    """All that a result says."""
    import hybrid

    with hybrid.open(path) as result:
        found: dict[str, Any] = {name: np.array(result[name]) for name in result.names}
        for name in result.names:
            result.describe(name)
        found |= {"scene_text": result.scene_text, "status": result.status, "events": len(result.events)}
        found |= {"zones": [list(map(str, zones)) for zones in result.zones]}
        repr(result)
    return found


def _same(a: Any, b: Any) -> bool:
    if isinstance(a, np.ndarray) and isinstance(b, np.ndarray):
        return a.dtype == b.dtype and a.shape == b.shape and a.tobytes() == b.tobytes()
    return bool(a == b)


def outcome(path: Path, good: dict[str, Any]) -> tuple[str, str]:
    """What came of opening a file: whole, shorter, other (other data, in silence), refused, or a fault."""
    import hybrid

    try:
        found = contents(path)
    except hybrid.ResultError as error:
        return ("refused", "") if "\n    " in str(error) else ("fault", f"no advice: {error}")
    except TooLong:
        return "fault", "hangs"
    except Exception as error:
        return "fault", f"{type(error).__name__}: {str(error)[:200]}"
    if all(name in found and _same(found[name], value) for name, value in good.items()):
        return "whole", ""
    wrong = [name for name, value in good.items() if name not in found or not _same(found[name], value)]
    return "other", ", ".join(wrong[:5])


def plotted(path: Path) -> tuple[str, str]:
    """What came of `hybrid plot`."""
    from hybrid.cli.commands import main

    err = io.StringIO()
    with contextlib.redirect_stderr(err), contextlib.redirect_stdout(io.StringIO()):
        try:
            main(["plot", str(path), "-o", str(path.with_suffix(".png"))])
        except SystemExit as leaving:
            text = err.getvalue()
            bad = "Traceback" in text or "is a bug" in text
            return ("fault", text[-400:]) if bad else ("drawn" if not leaving.code else "refused", "")
        except TooLong:
            return "fault", "hangs"
    return "fault", "no exit code"


def _stop(*_: object) -> None:
    raise TooLong


def main() -> None:
    good_path, folder, first, last, every = Path(sys.argv[1]), Path(sys.argv[2]), *map(int, sys.argv[3:6])
    warnings.simplefilter("error")
    whole, good = good_path.read_bytes(), contents(good_path)
    signal.signal(signal.SIGPROF, _stop)
    path = folder / "variant.h5"
    for number in range(first, last):
        path.write_bytes(spoilt(random.Random(number), whole))
        print(json.dumps({"begins": number}), flush=True)
        signal.setitimer(signal.ITIMER_PROF, LONGEST)
        kind, text = outcome(path, good)
        if every and number % every == 0 and kind != "fault":
            drawn, said = plotted(path)
            if drawn == "fault":
                kind, text = "fault", f"plot: {said}"
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        print(json.dumps({"number": number, "kind": kind, "text": text}), flush=True)


if __name__ == "__main__":
    main()
