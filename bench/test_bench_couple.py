"""One script on MoorDyn's Python package and on hybrid.couple.moordyn: forces on the fairleads, and the CPU time of both.

pip install -e ".[dev,bench]"
pytest bench/test_bench_couple.py -m bench -n 0 -s
"""

from __future__ import annotations

import time
from importlib import import_module
from importlib.metadata import files
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytestmark = pytest.mark.bench
ROOT = Path(__file__).parents[1]
PLACES = [40.0, 0.0, -14.0, -20.0, 34.64, -14.0, -20.0, -34.64, -14.0]
STEP, DURATION, PERIOD, SURGE = 0.1, 60.0, 12.0, 2.0  # s, s, s, m
COMPARED = 24.0  # s, at the end: two periods


def deck(path: Path) -> Path:
    """The deck of three lines as MoorDyn itself reads it: without a factor for a length."""
    text = (ROOT / "tests" / "data" / "moordyn" / "three_lines.txt").read_text(encoding="utf-8")
    text = "\n".join(["three lines of a platform", "", *text.splitlines()[1:]])
    for old, new in (
        ("rhoW", "WtrDnsty"),
        ("gravity", "g\n0.002 dtM\n1000 TmaxIC\n1 dtIC\n1e-5 threshIC"),
        ("3        P6       -0.98", "3        6        766.8"),
    ):
        assert old in text
        text = text.replace(old, new)
    path.write_text(text.replace("20       p", "20       -"), encoding="utf-8")
    return path


def surge(t: float) -> tuple[float, float]:
    """Displacement (m) and velocity (m/s), from rest."""
    w, part = 2.0 * np.pi / PERIOD, min(1.0, t / PERIOD)
    rate = SURGE * w * np.cos(w * t) * part + (SURGE * np.sin(w * t) / PERIOD if part < 1.0 else 0.0)
    return SURGE * np.sin(w * t) * part, rate


def march(program: Any, path: Path) -> tuple[np.ndarray, float]:
    """Forces (nt, 3) N of the lines on the fairleads after each step, and the CPU time (s) of the steps."""
    network = program.Create(str(path))
    program.Init(network, PLACES, [0.0] * 9)
    out = []
    begin = time.process_time()
    for k in range(round(DURATION / STEP)):
        d, v = surge(k * STEP)
        x = [p + d * (i % 3 == 0) for i, p in enumerate(PLACES)]
        forces = program.Step(network, x, [v * (i % 3 == 0) for i in range(9)], k * STEP, STEP)
        out.append(np.linalg.norm(np.reshape(forces, (3, 3)), axis=1))
    spent = time.process_time() - begin
    program.Close(network)
    return np.array(out), spent


def test_one_script_on_both(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("moordyn")
    path = deck(tmp_path / "lines.txt")
    monkeypatch.chdir(tmp_path)  # MoorDyn writes beside the deck
    march(import_module("hybrid.couple.moordyn"), path)  # compiled now
    ours, mine = march(import_module("hybrid.couple.moordyn"), path)
    theirs, spent = march(import_module("moordyn"), path)
    last = round(COMPARED / STEP)
    with capfd.disabled():
        print(f"\n{'line':>6}{'begin':>10}{'mean':>10}{'largest':>10}   per cent off MoorDyn")
        for k in range(3):
            a, b = ours[-last:, k], theirs[-last:, k]
            off = [ours[0, k] / theirs[0, k], a.mean() / b.mean(), a.max() / b.max()]
            print(f"{k + 1:6}" + "".join(f"{100.0 * (x - 1.0):10.3f}" for x in off))
            assert all(abs(x - 1.0) < 0.01 for x in off)
        print(f"CPU: hybrid {mine:.2f} s, MoorDyn {spent:.2f} s with steps of 0.002 s")


def on_a_body(path: Path) -> Path:
    """That deck with its coupled points on one coupled body at (0, 0, -14)."""
    text = deck(path).read_text(encoding="utf-8")
    for k, (x, y) in enumerate(((40, 0), (-20, 34.64), (-20, -34.64)), 4):
        old = next(line for line in text.splitlines() if line.startswith(f"{k}    Coupled"))
        text = text.replace(old, f"{k}  Body1  {x} {y} 0  0 0 0 0")
    rows = [
        "---------------------- BODIES ---", "ID Attachment X0 Y0 Z0 r0 p0 y0 Mass CG* I* Volume CdA* Ca*",
        "(#) (word) (m) (m) (m) (deg) (deg) (deg) (kg) (m) (kg-m^2) (m^3) (m^2) (-)",
        "1 Coupled 0 0 -14 0 0 0 0 0 0 0 0 0",
    ]  # fmt: skip
    mark = "---------------------- POINTS"
    assert mark in text
    path.write_text(text.replace(mark, "\n".join([*rows, mark])), encoding="utf-8")
    return path


def test_moordyns_own_example_script(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """`example/simpledemo.py` as MoorDyn's package installs it, with a deck where it asks for one: only its import differs."""
    pytest.importorskip("moordyn")
    found = [x for x in files("moordyn") or [] if x.name == "simpledemo.py"]
    if not found:
        pytest.skip("this package of MoorDyn has no example")
    script = Path(str(found[0].locate())).read_text(encoding="utf-8")
    assert "import moordyn\n" in script and "<file name>" in script
    monkeypatch.chdir(tmp_path)
    script = script.replace("<file name>", str(on_a_body(tmp_path / "body.txt")))
    forces = []
    for package in ("moordyn", "hybrid.couple.moordyn"):
        names: dict[str, Any] = {}
        exec(script.replace("import moordyn\n", f"import {package} as moordyn\n"), names)
        forces.append(np.array(names["f"]))
    off = np.abs(forces[1] - forces[0])
    size = np.abs(forces[0][:3]).max(), np.abs(forces[0][:3]).max() * 40.0
    print(
        f"forces {off[:3].max() / size[0]:.1e}, moments {off[3:].max() / size[1]:.1e} of the largest force (times 40 m)"
    )
    assert off[:3].max() < 0.01 * size[0]
    assert off[3:].max() < 0.01 * size[1]
