"""How large the code of a kernel becomes by functions that are inlined: where a compilation takes its time.

    python bench/kernel_sizes.py                     the largest twelve entries
    python bench/kernel_sizes.py run.in_space        and, of each that is named, the functions that are copied most

A size is a number of nodes of Python's syntax tree.  `own` counts each function once, `inlined` as often as @inner
copies it; @kernel and @called functions are not copied, and @linked_kernel are no part of it.  Nothing is compiled.
"""

from __future__ import annotations

import ast
import sys
from collections import Counter
from pathlib import Path

HYBRID = Path(__file__).parents[1] / "hybrid"
ENTRIES = "kernel", "linked_kernel"
KINDS = ("inner", "called", *ENTRIES)
SHOWN, COPIES = 12, 16
Name = tuple[str, str]  # module, function


def kind_of(function: ast.FunctionDef) -> str | None:
    """How a function is compiled, None for one that is not."""
    names = [x.func if isinstance(x, ast.Call) else x for x in function.decorator_list]
    return next((x.id for x in names if isinstance(x, ast.Name) and x.id in KINDS), None)


class Kernels:
    """Compiled functions of the package, their sizes, and which calls which."""

    def __init__(self) -> None:
        self.kind: dict[Name, str] = {}
        self.own: dict[Name, int] = {}
        self.calls: dict[Name, list[Name]] = {}
        self._inlined: dict[Name, int] = {}
        found: dict[Name, tuple[ast.FunctionDef, dict[str, Name]]] = {}
        for file in sorted(HYBRID.glob("kernels/**/*.py")):
            module = ".".join(["hybrid", *file.relative_to(HYBRID).with_suffix("").parts])
            body = ast.parse(file.read_text(encoding="utf-8")).body
            known = {
                x.asname or x.name: (n.module or "", x.name)
                for n in body if isinstance(n, ast.ImportFrom) for x in n.names
            }  # fmt: skip
            for function in body:
                kind = kind_of(function) if isinstance(function, ast.FunctionDef) else None
                if kind and isinstance(function, ast.FunctionDef):
                    name = known[function.name] = module, function.name
                    self.kind[name], found[name] = kind, (function, known)
        for name, (function, known) in found.items():
            nodes = list(ast.walk(function))
            self.own[name] = len(nodes)
            callees = [known.get(n.func.id) for n in nodes if isinstance(n, ast.Call) and isinstance(n.func, ast.Name)]
            self.calls[name] = [x for x in callees if x in self.kind]

    def copies(self, entry: Name) -> Counter[Name]:
        """How often the code of an entry has each function that it needs."""
        found: Counter[Name] = Counter()
        once = {entry}

        def count(calling: Name, times: int) -> None:
            for name in self.calls[calling]:
                if self.kind[name] == "inner":
                    found[name] += times
                    count(name, times)
                elif name not in once and self.kind[name] != "linked_kernel":
                    once.add(name)
                    found[name] += 1
                    count(name, 1)

        count(entry, 1)
        return found

    def inlined(self, name: Name) -> int:
        """Size of a function with all that is inlined into it."""
        if name not in self._inlined:
            parts = [self.inlined(x) for x in self.calls[name] if self.kind[x] == "inner"]
            self._inlined[name] = self.own[name] + sum(parts)
        return self._inlined[name]

    def sizes(self, entry: Name) -> tuple[int, int]:
        """Of an entry with all that it needs: own, inlined."""
        found = self.copies(entry)
        own = self.own[entry]
        return own + sum(self.own[x] for x in found), own + sum(self.own[x] * n for x, n in found.items())


def label(name: Name) -> str:
    return f"{name[0].rsplit('.', 1)[1]}.{name[1]}"


def main(asked: list[str]) -> None:
    kernels = Kernels()
    entries = [x for x, kind in kernels.kind.items() if kind in ENTRIES]
    if unknown := set(asked) - {label(x) for x in entries}:
        raise SystemExit(f"no kernel is called {', '.join(sorted(unknown))}: file.function, as in run.in_space")
    sizes = {x: kernels.sizes(x) for x in entries if not asked or label(x) in asked}
    largest = sorted(sizes, key=lambda x: -sizes[x][1])[: len(asked) or SHOWN]
    print(f"{'kernel':36}{'own':>10}{'inlined':>10}{'times':>8}")
    for name in largest:
        own, inlined = sizes[name]
        print(f"{label(name):36}{own:10}{inlined:10}{inlined / own:8.1f}")
    for name in largest if asked else []:
        copied = {x: (n, kernels.inlined(x)) for x, n in kernels.copies(name).items() if n > 1}
        saved = sorted(copied, key=lambda x: -(copied[x][0] - 1) * copied[x][1])[:COPIES]
        print(f"\n{label(name)}: size that one copy would save, copies, size of each")
        for x in saved:
            n, size = copied[x]
            print(f"{label(x):36}{(n - 1) * size:10}{n:10}{size:8}")


if __name__ == "__main__":
    main(sys.argv[1:])
