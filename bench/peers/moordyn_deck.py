"""MoorDyn on a deck as it stands, its coupled points moved; what bench/test_bench_moordyn.py compares with."""

from __future__ import annotations

import re
import shutil
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from peers.moordyn_touchdown import silence

Vector = NDArray[np.float64]
# Positions of all coupled points (3 n,) at a time, s.
Motion = Callable[[float], Vector]


@dataclass(frozen=True)
class Seen:
    """Forces on the points by their ID (nt, 3) N and nodes of the lines by theirs (n + 1, 3) m, the last ones."""

    times: Vector
    forces: dict[int, Vector]
    nodes: dict[int, Vector]


def options(text: str, **values: float | str) -> str:
    """A deck with options added, after those it has: the last one counts."""
    head, mark, tail = re.split(r"(?m)^(-+ *(?:SOLVER )?OPTIONS[ -]*\n)", text, maxsplit=1)
    return head + mark + tail.replace("\n---", "".join(f"\n{v} {k}" for k, v in values.items()) + "\n---", 1)


def segments(text: str, factor: float) -> str:
    """A deck whose lines have so many times the segments (rows of LINES of version 2)."""
    head, mark, tail = re.split(r"(?m)^(-+ *LINES[ -]*\n.*\n.*\n)", text, maxsplit=1)
    rows, rest = tail.split("\n---", 1)
    cut = [row.split() for row in rows.splitlines()]
    for cells in cut:
        cells[5] = str(round(int(cells[5]) * factor))
    return head + mark + "\n".join(map(" ".join, cut)) + "\n---" + rest


def march(text: str, motion: Motion, duration: float, every: float, hand: float, beside: Sequence[Path] = ()) -> Seen:
    """March a deck; motion is handed over every `hand` s (a part of `every`), with the mean velocity over it.

    beside: files that the deck reads from its own folder.
    """
    import moordyn

    with tempfile.TemporaryDirectory() as folder, silence():
        path = Path(folder) / "deck.txt"
        path.write_text(text)
        for file in beside:
            shutil.copy(file, folder)
        network = moordyn.Create(str(path))
        try:
            here = motion(0.0)
            assert moordyn.Init(network, here.tolist(), [0.0] * here.size) == 0
            points = range(1, moordyn.GetNumberPoints(network) + 1)

            def look() -> list[Vector]:
                return [np.array(moordyn.GetPointForce(moordyn.GetPoint(network, k))) for k in points]

            looks, n = [look()], round(every / hand)
            for k in range(round(duration / every)):
                for i in range(n):
                    t = k * every + i * every / n
                    now, then = motion(t), motion(t + every / n)
                    moordyn.Step(network, now.tolist(), ((then - now) * n / every).tolist(), t, every / n)
                looks.append(look())
            nodes = {}
            for id in range(1, moordyn.GetNumberLines(network) + 1):
                line = moordyn.GetLine(network, id)
                count = moordyn.GetLineNumberNodes(line)
                nodes[id] = np.array([moordyn.GetLineNodePos(line, i) for i in range(count)])
        finally:
            moordyn.Close(network)
    forces = np.array(looks)
    return Seen(np.arange(len(looks)) * every, {k: forces[:, k - 1] for k in points}, nodes)
