"""How the suite is run (conftest.py): what needs no kernels first, in each process, and nothing is lost."""

from __future__ import annotations

import os
import runpy
from pathlib import Path
from types import SimpleNamespace

import pytest
from compile_kernels import BY_TABLE

from hybrid.kernels.machine.compile import entry
from hybrid.kernels.machine.kept_code import Called, _of_function

CONFTEST = runpy.run_path(str(Path(__file__).parents[1] / "conftest.py"))
TESTS = CONFTEST["TESTS"]


def items(*files: str) -> list[SimpleNamespace]:
    return [SimpleNamespace(path=TESTS / file) for file in files]


@pytest.mark.parametrize("processes", [1, 2, 3])
def test_each_process_begins_with_files_of_few_kernels(processes: int) -> None:
    made = items(*["solve/a.py"] * 9, *["scene/b.py"] * 6, *["test_c.py"] * 3)
    ordered = list(made)
    config = SimpleNamespace(workerinput={"workercount": processes})
    CONFTEST["pytest_collection_modifyitems"](config, ordered)
    assert sorted(map(id, ordered)) == sorted(map(id, made))
    share = len(ordered) // processes
    for k in range(processes):
        first = [item.path.parent.name for item in ordered[k * share : (k + 1) * share]][: 6 // processes]
        assert set(first) == {"scene"}
    assert [x.path.name for x in ordered if x.path.name != "b.py"] == ["test_c.py"] * 3 + ["a.py"] * 9


def test_only_what_calls_many_kernels_waits_for_them(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(os.environ, CONFTEST["COMPILING"], str(tmp_path))
    marker, (few, many) = tmp_path / "plane", items("scene/b.py", "solve/a.py")
    marker.touch()
    waits: list[float] = []

    def sleep(seconds: float) -> None:
        waits.append(seconds)
        marker.unlink()

    monkeypatch.setattr("time.sleep", sleep)
    next(CONFTEST["pytest_runtest_protocol"](few))
    assert not waits
    next(CONFTEST["pytest_runtest_protocol"](many))
    assert len(waits) == 1


def code_of(kernels: str) -> dict[object, int]:
    """Bytes of bytecode of each function that some kernels reach."""
    found: Called = dict.fromkeys(entry(name).py_func for name in kernels.split())
    todo = list(found)
    while todo:
        new = [x for x in _of_function(todo.pop())[1] if x not in found]
        found.update(dict.fromkeys(new))
        todo += new
    return {x: len(x.__code__.co_code) for x in found}


@pytest.mark.long  # imports all kernels
def test_kernels_that_share_laws_are_compiled_in_one_process() -> None:
    """Half of what kernels read was read in both processes when each had the kernels of one dimension."""
    one, other = map(code_of, BY_TABLE.values())
    both = sum(one[x] for x in one.keys() & other.keys())
    assert 0 < both < 0.25 * sum((one | other).values())
