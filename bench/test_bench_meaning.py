"""What a bare `accuracy: 2%` costs: beside `{position: 2%, tension: 2%}`, which it stood for until 0.6.

    pytest bench/test_bench_meaning.py -m bench -n 0 -s

Scenes are the examples and those of tests/data/defects that an accuracy can be asked of, without steps and mesh of
their own, with the models that they name, each with both.  CPU time is that of all runs, from the scene to the closed
file, the median of ROUNDS after a first run that loads what is needed.  Errors are figures over what is asked.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from pathlib import Path
from statistics import median
from typing import Any

import pytest
import yaml

import hybrid
from hybrid.errors import HybridError
from hybrid.store.reader import open_result

pytestmark = pytest.mark.bench
ROOT = Path(__file__).parents[1]
MEANINGS = {"named": {"position": "2%", "tension": "2%"}, "bare": "2%"}
ROUNDS, MOST = 3, 2.0  # times the cost of before that a scene may take
# Lines that touch themselves, whose contact takes minutes with either.
LEFT_OUT = ("laying_loop", "plectoneme", "passes_through_itself", "hose_crosses_itself", "line_break_with_contact")


def scenes() -> Iterator[Any]:
    for path in sorted([*(ROOT / "examples").glob("*.yaml"), *(ROOT / "tests/data/defects").glob("*.yaml")]):
        found: dict[str, Any] = yaml.safe_load(path.read_text())
        if "cable" not in found or "time" not in found or "duration" not in found["time"]:
            continue
        if path.stem not in LEFT_OUT:
            yield pytest.param(path, id=path.stem)


def asking(path: Path, accuracy: Any) -> dict[str, Any]:
    found: dict[str, Any] = yaml.safe_load(path.read_text())
    found.pop("mesh", None)
    found.pop("resolution", None)
    found.setdefault("output", {}).pop("errors", None)
    return found | {"time": {"duration": found["time"]["duration"]}, "accuracy": accuracy}


@pytest.mark.parametrize("path", list(scenes()))
def test_a_bare_part_costs_little_more(path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(path.parent)  # files that scenes name lie beside them
    costs = {}
    for name, accuracy in MEANINGS.items():
        spent = []
        try:
            hybrid.run(asking(path, accuracy), tmp_path / "run.h5").close()
            for _ in range(ROUNDS):
                begin = time.process_time()
                result = hybrid.run(asking(path, accuracy), tmp_path / "run.h5")
                result.close()
                spent.append(time.process_time() - begin)
                if spent[0] > 1.0:  # a long run once
                    break
        except HybridError as error:
            print(f"\n{path.stem}: {str(error).splitlines()[0]}")
            return
        costs[name] = median(spent)
        with open_result(tmp_path / "run.h5") as result:
            said = sorted({e.kind for e in result.events} & {"accuracy missed", "error uncertain", "irregular motion"})
            a = result.attributes
            print(
                f"\n{path.stem}, {name}: {costs[name]:.2f} s, {a['cells']} x {len(result['steps/t'])}, "
                f"{a['effort_runs']} runs, {said}\n    {a['accuracy_asked']}; "
                f"{a.get('accuracy_not_asked', '')}",
                end="",
            )
            for event in result.events:
                if event.kind in ("accuracy missed", "model chosen"):
                    print(f"\n    {event.kind}: {event.text[:230]}", end="")
    ratio = costs["bare"] / costs["named"]
    print(f"\n    {path.stem}: {ratio:.2f} times{'  MORE THAN ASKED' if ratio > MOST else ''}")
