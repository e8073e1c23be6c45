"""What each import that is put off costs: those within functions, and those for type checkers alone.

pytest bench/test_bench_imports.py -m bench -s -n 0
"""

import ast
import importlib.util
import subprocess
import sys
from pathlib import Path
from statistics import median

import pytest

import hybrid

pytestmark = pytest.mark.bench
PACKAGE = Path(hybrid.__file__).parent
RUNS = 3  # of which the median counts
CHEAP = 2.0  # ms, below which an import belongs to the top of its file
TIMED = "import sys, time\n{}\nbegin = time.perf_counter()\n{}\nsys.stdout.write(repr(time.perf_counter() - begin))"


def name_of(file: Path) -> str:
    return ".".join(["hybrid", *file.relative_to(PACKAGE).with_suffix("").parts]).removesuffix(".__init__")


def imported(node: ast.AST) -> list[tuple[str, str]]:
    """Modules that an import statement names, each with a statement that loads as much."""
    if isinstance(node, ast.Import):
        return [(x.name, f"import {x.name}") for x in node.names]
    if not isinstance(node, ast.ImportFrom) or not node.module:
        return []
    inner = [f"{node.module}.{x.name}" for x in node.names]
    files = [x for x in inner if PACKAGE.parent.joinpath(*x.split(".")).with_suffix(".py").is_file()]
    return [(x, f"import {x}") for x in files] or [(node.module, ast.unparse(node))]


def modules() -> dict[str, list[tuple[str, str, str]]]:
    """By file: the modules that it imports, with the statement, each "at once", in a "function" or for "types"."""
    found = {}
    for file in PACKAGE.rglob("*.py"):
        tree = ast.parse(file.read_text(encoding="utf-8"))
        checks = (x for x in ast.walk(tree) if isinstance(x, ast.If) and ast.unparse(x.test) == "TYPE_CHECKING")
        kinds = {inner: "types" for x in checks for inner in ast.walk(x)} | dict.fromkeys(tree.body, "at once")
        nodes = [(x, kinds.get(x, "function")) for x in ast.walk(tree)]
        found[name_of(file)] = [(*one, kind) for node, kind in nodes for one in imported(node)]
    return found


def reached(name: str, graph: dict[str, list[tuple[str, str, str]]]) -> set[str]:
    """Files that the import of one loads, itself among them."""
    seen, todo = set[str](), [name]
    while todo:
        if (here := todo.pop()) not in seen:
            seen.add(here)
            todo += [module for module, _, kind in graph.get(here, []) if kind == "at once"]
    return seen


def milliseconds(before: str, timed: str) -> float:
    """Time that `timed` takes in a new process after `before`."""
    code = TIMED.format(before, timed)
    done = [subprocess.run([sys.executable, "-c", code], capture_output=True, check=True).stdout for _ in range(RUNS)]
    return 1e3 * median(map(float, done))


def test_imports_put_off():
    graph = modules()
    rows = {(x, file, kind) for file, each in graph.items() for x, _, kind in each if kind != "at once"}
    statements = {x: code for each in graph.values() for x, code, kind in each if kind != "at once"}
    have = sorted(x for x in statements if importlib.util.find_spec(x.partition(".")[0]))
    cost = {x: milliseconds("import hybrid", statements[x]) for x in have}
    print(f"\nimport hybrid: {milliseconds('pass', 'import hybrid'):.1f} ms\n    ms  module (imported by, where)")
    for x, file, kind in sorted(rows, key=lambda row: -cost.get(row[0], 0.0)):
        note = ", a circle at the top" if file in reached(x, graph) else ""
        cheap = ", cheap" if not note and kind == "function" and cost.get(x, CHEAP) < CHEAP else ""
        print(f"{cost.get(x, float('nan')):6.1f}  {x} ({file}, {kind}{note}{cheap})")
