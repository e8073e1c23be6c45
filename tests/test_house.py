"""The house rules that a machine can check: which way imports run, who prints, what a bare import loads."""

from __future__ import annotations

import ast
import importlib
import json
import re
import subprocess
import sys
from collections import Counter
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import hybrid

PACKAGE = Path(hybrid.__file__).parent
FILES = sorted(PACKAGE.rglob("*.py"))

# One rule for each room: which other rooms it may import.  docs/architecture.md draws them.
COMPUTING = ("errors", "kernels", "scene", "statistics", "store", "model", "solve", "zones", "outputs")
ALLOWED: dict[str, tuple[str, ...]] = {
    "errors": (),
    "kernels": (),
    "scene": ("errors",),
    "statistics": ("errors",),
    "store": ("errors", "statistics"),
    "model": ("errors", "kernels", "scene"),
    "solve": ("errors", "kernels", "model"),
    "zones": ("errors", "kernels", "scene", "model", "solve", "store"),
    "outputs": ("errors", "kernels", "model", "solve", "store"),
    "simulation": COMPUTING,
    "linear": (*COMPUTING, "simulation"),
    "accuracy": (*COMPUTING, "simulation", "linear"),
    "view": ("errors", "statistics", "store"),
    "exports": ("errors", "store"),
    "interop": ("errors", "scene"),
    "modal": (*COMPUTING, "simulation", "linear", "accuracy"),
    "studies": (*COMPUTING, "simulation", "accuracy", "view"),
    "designs": (*COMPUTING, "simulation", "linear", "accuracy", "modal", "studies"),
    "couple": (*COMPUTING, "simulation", "accuracy", "interop"),
    "live": (*COMPUTING, "simulation", "accuracy", "modal", "view"),
    "cli": (
        *COMPUTING,
        "simulation",
        "accuracy",
        "view",
        "exports",
        "interop",
        "studies",
        "couple",
        "live",
        "linear",
        "modal",
        "designs",
        "__init__",
    ),
    "__init__": (
        *COMPUTING,
        "simulation",
        "accuracy",
        "modal",
        "designs",
        "view",
        "exports",
        "interop",
        "studies",
        "couple",
    ),
    "__main__": ("cli",),
}

# Packages from outside that only these rooms may import.
ONLY = {
    "scipy": ("scene", "statistics", "store", "model", "solve", "zones", "outputs", "simulation", "linear", "accuracy", "modal", "designs", "view", "exports", "studies"),
    "numba": ("kernels",),
    "h5py": ("store", "exports"),
    "matplotlib": ("view",),
    "plotly": ("view",),
    "pydantic": ("scene",),
    "ruamel": ("scene",),
    "yaml": ("scene",),
    "typer": ("cli",),
    "rich": ("cli",),
    "pythonfmu3": ("couple",),
    "openmdao": ("designs",),
    "cosseratbench": ("couple",),
    "zarr": ("store",),
    "xarray": ("store", "scene"),
    "distributed": ("studies",),
    "dask": ("studies",),
    "SALib": ("studies",),
    "simpleeval": ("studies",),
    "rainflow": ("statistics", "exports"),
    "starlette": ("live",),
    "uvicorn": ("live",),
    "websockets": (),
    "filelock": ("kernels", "store"),
}  # fmt: skip


# Rooms of the kernels, each of which imports from those before it alone.
KERNEL_ROOMS = (
    "machine", "state", "algebra", "laws", "march", "step", "contact", "watch", "mesh", "reel", "junctions", "run",
)  # fmt: skip


def room(file: Path) -> str:
    return file.relative_to(PACKAGE).with_suffix("").parts[0]


NAMES = {
    ".".join(["hybrid", *f.relative_to(PACKAGE).with_suffix("").parts]).removesuffix(".__init__"): f for f in FILES
}


@cache
def imports(file: Path, for_types: bool = False) -> list[tuple[str, int]]:
    """Absolute names of all modules a file imports, with their line; for_types: those for type checkers too."""
    nodes = list(ast.walk(ast.parse(file.read_text(encoding="utf-8"))))
    left_out = {
        inner
        for node in nodes
        if isinstance(node, ast.If) and isinstance(node.test, ast.Name) and node.test.id == "TYPE_CHECKING"
        for inner in ast.walk(node)
        if not for_types
    }
    package = ["hybrid", *file.relative_to(PACKAGE).parent.parts]
    found: list[tuple[str, int]] = []
    for node in nodes:
        if node in left_out:
            continue
        if isinstance(node, ast.Import):
            found += [(alias.name, node.lineno) for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            base = package[: len(package) - node.level + 1] if node.level else []
            name = ".".join([*base, *([node.module] if node.module else [])])
            inner = [f"{name}.{alias.name}" for alias in node.names]
            if name == "hybrid":  # rooms may be named here
                found += [(module, node.lineno) for module in inner]
            else:
                found += [(module, node.lineno) for module in (name, *(x for x in inner if x in NAMES))]
    return found


def test_imports_run_one_way() -> None:
    wrong = []
    for file in FILES:
        here = room(file)
        for name, line in imports(file):
            head, _, rest = name.partition(".")
            there = rest.partition(".")[0]
            place = f"{file.relative_to(PACKAGE)}:{line} imports {name}"
            if head == "hybrid":
                there = there if there in ALLOWED else "__init__"
                if there not in (here, *ALLOWED[here]):
                    wrong.append(f"{place}; allowed: {', '.join(ALLOWED[here]) or 'nothing'}")
            elif head in ONLY and here not in ONLY[head]:
                wrong.append(f"{place}; that is for {', '.join(ONLY[head])}")
    assert not wrong, "\n".join(wrong)


def test_imports_of_kernels_run_one_way() -> None:
    kernels = PACKAGE / "kernels"
    assert {x.parent.name for x in kernels.rglob("*.py")} == {"kernels", *KERNEL_ROOMS}
    for file in kernels.rglob("*.py"):
        if file.parent != kernels:
            below = KERNEL_ROOMS[: KERNEL_ROOMS.index(file.parent.name) + 1]
            rooms = {name.split(".")[2] for name, _ in imports(file) if name.startswith("hybrid.kernels.")}
            assert rooms <= set(below), f"{file.relative_to(PACKAGE)} imports from {rooms - set(below)}"


def test_every_room_has_a_rule_and_every_rule_a_room() -> None:
    assert {room(file) for file in FILES} == set(ALLOWED)


def test_no_room_imports_itself_by_way_of_others() -> None:
    for start in ALLOWED:
        seen, todo = set(), list(ALLOWED[start])
        while todo:
            seen.add(here := todo.pop())
            todo += [there for there in ALLOWED[here] if there not in seen]
        assert start not in seen or start in ("cli", "__init__"), start


def in_circles(for_types: bool) -> set[Path]:
    """Files that import themselves by way of others, also within functions; for_types: as of `imports`."""
    graph = {
        name: {there for there, _ in imports(file, for_types) if there in NAMES} - {name, "hybrid"}
        for name, file in NAMES.items()
    }
    while leaves := {name for name, there in graph.items() if not there}:
        graph = {name: there - leaves for name, there in graph.items() if name not in leaves}
    found = set()
    for start in graph:
        seen, todo = set[str](), [*graph[start]]
        while todo:
            if (here := todo.pop()) not in seen:
                seen.add(here)
                todo += graph[here]
        if start in seen:
            found.add(NAMES[start])
    return found


def test_files_do_not_import_each_other_in_a_circle() -> None:
    assert not in_circles(for_types=False)


# Files in circles where annotations count, by room: only less.  A small Protocol or a base class below ends a circle.
CIRCLES: dict[str, int] = {}


def test_files_do_not_name_each_other_in_a_circle() -> None:
    found = Counter(map(room, in_circles(for_types=True)))
    assert not {place: count for place, count in found.items() if count > CIRCLES.get(place, 0)}


def put_off(file: Path) -> set[tuple[str, int]]:
    """What a file imports within functions or for type checkers alone, with the line."""
    lines = file.read_text(encoding="utf-8").splitlines()
    return {(name, line) for name, line in imports(file, for_types=True) if lines[line - 1].startswith(" ")}


@cache
def loaded_by(name: str) -> frozenset[str]:
    """Files of the package that the import of one loads, by name."""
    at_once = {other for other, _ in {*imports(NAMES[name], for_types=True)} - put_off(NAMES[name])}
    first = {other for other in at_once if other in NAMES and other != name}
    return frozenset({name}.union(*map(loaded_by, first)))


def test_no_import_is_put_off_of_what_is_loaded_anyway() -> None:
    """Within a function, or for type checkers alone where the room may be imported: that buys no time."""
    found = []
    for name, file in NAMES.items():
        rooms = {room(file), *ALLOWED[room(file)]} if name != "hybrid" else ()
        for other, line in put_off(file):
            is_file = other in NAMES and NAMES[other].name != "__init__.py"
            if is_file and room(NAMES[other]) in rooms and other in loaded_by(name):
                found.append(f"{name}:{line} {other}")
    assert not found


# Where it is asked whether a scene has one line or several, and what is named after several, outside scene/: only less.
FORKS, FILES_OF_SYSTEMS, CLASSES_OF_SYSTEMS = 0, 0, 0
FORK = re.compile(r"isinstance\([^()]*,[^()]*\b(\w*Scene|Network)\b|\bline_names\b|\b(self|case|left)\.flat\b")


def test_one_line_is_no_other_case_than_several() -> None:
    texts = {file: file.read_text(encoding="utf-8") for file in FILES if room(file) != "scene"}
    assert sum(bool(FORK.search(line)) for text in texts.values() for line in text.splitlines()) <= FORKS
    assert sum(file.name.startswith("system") or "_system" in file.name for file in FILES) <= FILES_OF_SYSTEMS
    classes = (x.name for text in texts.values() for x in ast.walk(ast.parse(text)) if isinstance(x, ast.ClassDef))
    assert sum("System" in name for name in classes) <= CLASSES_OF_SYSTEMS


# Files, those below 100 lines, and those above 700: only less.  What is small joins its subject.
MOST_FILES, SMALL_FILES, LONG_FILES = 300, 1, 0


def test_files_are_as_long_as_a_subject() -> None:
    sizes = [file.read_text(encoding="utf-8").count("\n") for file in FILES if not file.name.startswith("__")]
    say = "a new file takes the place of one: join code to the file of its subject, or join two small files"
    assert len(FILES) <= MOST_FILES, f"{len(FILES)} files, at most {MOST_FILES}; {say}"
    assert sum(size < 100 for size in sizes) <= SMALL_FILES, f"files below 100 lines; {say}"
    assert sum(size > 700 for size in sizes) <= LONG_FILES, "a file above 700 lines: it has two subjects"


# Rules of writing, and in how many places each is broken: only less.
BROKEN = {
    "docstring whose first line is no whole sentence": 0,
    "name from the list of banned words": 0,
    "more than two constants in a line": 0,
    "constructor above 40 lines": 0,
    "function above 60 lines": 6,
    "fmt: skip": 4,
    "first line of a docstring above 15 words": 3572,
    "sentence with more than two relative clauses": 202,
    "constructor that does work": 53,
    "float constant without a comment": 22,
    "two constants in a line": 226,
    "argument, field or class named by a banned word": 628,
}
# The same of the pages of docs/.
LONG_SENTENCES_OF_PAGES = 169
# How a place is mended, where the name of the rule does not say it.
MEND = {
    "first line of a docstring above 15 words": "say what it returns or does; the rest goes below an empty line",
    "sentence with more than two relative clauses": "make two sentences of it",
    "constructor that does work": "loops, files and searches go to a function or class method that calls it",
    "float constant without a comment": "unit and reason behind the number, or in the line above",
    "two constants in a line": "one a line, each with unit and reason",
    "argument, field or class named by a banned word": "the name of what it holds, in words of the field",
}
# Words that do not say what a thing is or does; the second ones only where they are the whole name.
BANNED = {"calm", "follow", "found", "haste", "its", "look", "looks", "loudest", "pace", "patience", "said",
          "settle", "stir", "sure", "take", "takes", "tell", "tells", "told"}  # fmt: skip
BANNED_ALONE = {"at", "go_on", "here", "own", "there", "whole"}
CONSTANTS = re.compile(r"^[A-Z][A-Z0-9_]*(, [A-Z][A-Z0-9_]*){2,} = (?!range\()", re.MULTILINE)
TWO_CONSTANTS = re.compile(r"^_?[A-Z][A-Z0-9_]*, _?[A-Z][A-Z0-9_]* = (?!range\()", re.MULTILINE)
NOTES = re.compile(r"(?:^ *#.*\n)+|  #.*$", re.MULTILINE)  # comments; those in lines of their own are one text
CLAUSE = re.compile(r"(?<=\w[ ,;(])\s*(which|that|who|whose|where|when)\b", re.IGNORECASE)
WORK = re.compile(r"(open|run|solve|find|read|write)(_|$)")


def long_sentences(text: str) -> int:
    """Sentences with more than two relative clauses; lists, rows of tables and paragraphs are texts of their own."""
    parts = re.split(r"(?<=[.?!:])\s+|\n\s*\n|\n\s*(?=[-*|#]|\d+\.)", text)
    return sum(len(CLAUSE.findall(" ".join(part.split()))) > 2 for part in parts)


def does_work(constructor: ast.FunctionDef) -> bool:
    """Whether it loops, opens or tries something, searches, solves or reads, or calls what returns nothing."""
    for node in ast.walk(constructor):
        if isinstance(node, ast.For | ast.While | ast.With | ast.Try):
            return True
        call = node.value if isinstance(node, ast.Expr) else node
        if isinstance(call, ast.Call):
            name = ast.unparse(call.func)
            if WORK.match(name.split(".")[-1]) or (call is not node and not name.endswith("__init__")):
                return True
    return False


def unexplained(text: str, tree: ast.Module) -> int:
    """Float constants of a module without a comment beside or above; zeros, ones and what is computed need none."""
    lines, count = text.splitlines(), 0
    for node in tree.body:
        if not isinstance(node, ast.Assign) or not isinstance(
            node.value, ast.Constant | ast.UnaryOp | ast.BinOp | ast.Tuple
        ):
            continue
        named = re.match(r"_?[A-Z][A-Z0-9_]*$", ast.unparse(node.targets[0]).strip("()").split(",")[0])
        numbers = [x.value for x in ast.walk(node.value) if isinstance(x, ast.Constant) and isinstance(x.value, float)]
        beside = "#" in "".join(lines[node.lineno - 1 : node.end_lineno])
        above = lines[node.lineno - 2].startswith("#") and node.lineno > 1
        count += bool(named) and bool({*numbers} - {0.0, 1.0}) and not beside and not above
    return count


def banned_names(node: ast.AST) -> int:
    """How many arguments of a function, fields of a class, or names of a class are banned."""
    names = [node.name] if isinstance(node, ast.ClassDef) else []
    if isinstance(node, ast.FunctionDef):
        names = [x.arg for x in (*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs)]
    if isinstance(node, ast.ClassDef):
        names += [ast.unparse(x.target) for x in node.body if isinstance(x, ast.AnnAssign)]
    return sum(name.strip("_").lower() in BANNED | {"given", "x"} for name in names)


def broken_rules(text: str) -> Counter[str]:
    """In how many places a file breaks each of the rules of writing."""
    count = Counter({"more than two constants in a line": len(CONSTANTS.findall(text))})
    count["fmt: skip"] = len(re.findall("fmt: (?:skip|off)", text))
    count["two constants in a line"] = len(TWO_CONSTANTS.findall(text))
    notes = [re.sub(r"^ *# ?", "", note, flags=re.MULTILINE) for note in NOTES.findall(text)]
    count["float constant without a comment"] = unexplained(text, tree := ast.parse(text))
    for node in ast.walk(tree):
        count["argument, field or class named by a banned word"] += banned_names(node)
        if isinstance(node, ast.FunctionDef):
            size = (node.end_lineno or 0) - node.lineno + 1
            name = node.name.strip("_")
            banned = name in BANNED | BANNED_ALONE or name.split("_")[0] in BANNED
            count["constructor above 40 lines"] += node.name == "__init__" and size > 40
            count["function above 60 lines"] += size > 60
            count["constructor that does work"] += node.name == "__init__" and does_work(node)
            count["name from the list of banned words"] += banned
        if isinstance(node, ast.Module | ast.FunctionDef | ast.ClassDef) and (doc := ast.get_docstring(node)):
            whole = re.match(r".*[.?!]\s*(\n\n|\n?\Z)", doc)
            count["docstring whose first line is no whole sentence"] += not whole
            count["first line of a docstring above 15 words"] += len(doc.partition("\n")[0].split()) > 15
            notes.append(doc)
    count["sentence with more than two relative clauses"] = sum(map(long_sentences, notes))
    return count


def test_rules_of_writing_are_broken_in_fewer_places() -> None:
    found = {file.relative_to(PACKAGE).as_posix(): broken_rules(file.read_text(encoding="utf-8")) for file in FILES}
    count = sum(found.values(), Counter())
    where = {x: {file: n[x] for file, n in found.items() if n[x]} for x in BROKEN if count[x] > BROKEN[x]}
    mend = "; ".join(f"{x} ({count[x]}, at most {BROKEN[x]}): {MEND.get(x, x)}" for x in where)
    assert not where, f"more than there were: find the file of your change among these; {mend}"
    wrong = 'A, B, C = 1, 2, 3\nD, E, F = range(3)\nclass X:\n    """One\n    sentence."""\n'
    wrong += f'    def take_x(self):\n        """{"Word " * 16}."""\n    def __init__(self, told): self.find()\n'
    wrong += "# A rod that bends where it stands\n# when it is one that moves.\nG, H = 1, 2\nI = 0.5\n"
    assert +broken_rules(wrong) == Counter([*BROKEN][:3] + [*BROKEN][6:]) + Counter([[*BROKEN][-1]])


def test_sentences_of_pages_are_short() -> None:
    pages = {x.name: x.read_text(encoding="utf-8") for x in (PACKAGE.parent / "docs").rglob("*.md")}
    count = {name: long_sentences(re.sub(r"(?ms)^ *```.*?^ *```", "", text)) for name, text in pages.items()}
    worst = sorted(count.items(), key=lambda x: -x[1])[:9]
    assert sum(count.values()) <= LONG_SENTENCES_OF_PAGES, f"{sum(count.values())}: make two sentences of one; {worst}"


def test_only_the_command_line_prints() -> None:
    found = [
        f"{file.relative_to(PACKAGE)}:{node.lineno}"
        for file in FILES
        if room(file) != "cli" and "print(" in (text := file.read_text(encoding="utf-8"))
        for node in ast.walk(ast.parse(text))
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "print"
    ]
    assert not found


# Verbs by which a run asks its parts, at most.
MOST_VERBS = 18


def test_what_one_part_alone_needs_is_no_verb_of_all() -> None:
    trees = {x: ast.parse(x.read_text(encoding="utf-8")) for x in FILES if room(x) == "simulation"}
    classes = [(x.stem, y) for x, tree in trees.items() for y in tree.body if isinstance(y, ast.ClassDef)]
    verbs = {
        y.name: [z.name for z in y.body if isinstance(z, ast.FunctionDef)]
        for file, y in classes
        if (file, y.name) == ("parts", "Part") or "Part" in [getattr(z, "id", "") for z in y.bases]
    }
    of_all = verbs.pop("Part")
    assert 0 < len(of_all) <= MOST_VERBS
    assert not [x for x in of_all if sum(x in own for own in verbs.values()) < 2]


# Arguments of a function, at most; those of a command of the command line are its options.
MOST_ARGUMENTS = 10
# Functions with more, as "file name", and why a record would not do.
MORE_ARGUMENTS: dict[str, str] = {}


def functions(node: ast.AST, in_class: bool = False) -> Iterator[tuple[str, int]]:
    """Names of all functions within a node, of methods too, and how many arguments they have besides `self`."""
    for inner in ast.iter_child_nodes(node):
        if isinstance(inner, ast.FunctionDef | ast.AsyncFunctionDef | ast.Lambda):
            given = [x.arg for x in (*inner.args.posonlyargs, *inner.args.args, *inner.args.kwonlyargs)]
            bound = in_class and given[:1] in (["self"], ["cls"])
            yield getattr(inner, "name", "lambda"), len(given) - bound
        yield from functions(inner, isinstance(inner, ast.ClassDef))


def test_no_function_takes_many_arguments() -> None:
    many = {
        f"{file.relative_to(PACKAGE).as_posix()} {name}"
        for file in FILES
        if room(file) != "cli"
        for name, count in functions(ast.parse(file.read_text(encoding="utf-8")))
        if count > MOST_ARGUMENTS
    }
    assert many == MORE_ARGUMENTS.keys(), "more than ten arguments, or an exception that is none (any longer)"


def test_arguments_are_counted() -> None:
    text = """
class A:
    def many(self, a, b, /, c, *, d): ...
    @staticmethod
    def two(self_, x): ...
    class B:
        async def none(self): ...
def outer(x):
    def inner(a, *rest, b=1, **named): return lambda y, z: y
"""
    counted = [("many", 4), ("two", 2), ("none", 0), ("outer", 1), ("inner", 2), ("lambda", 2)]
    assert list(functions(ast.parse(text))) == counted


def loaded(code: str) -> set[str]:
    """Top-level packages in memory after `code`."""
    script = f"{code}\nimport sys, json\nprint(json.dumps(sorted({{m.partition('.')[0] for m in sys.modules}})))"
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    return set(json.loads(done.stdout.splitlines()[-1]))


def test_a_bare_import_loads_no_heavy_package() -> None:
    assert not loaded("import hybrid") & {"numpy", "numba", "matplotlib", "h5py", "scipy", "pydantic", "rich"}


def test_a_scene_is_read_without_kernels_or_plots() -> None:
    code = "import hybrid; hybrid.parse_scene('cable: {sections: [{length: 1.0, mass: 1.0}]}\\nends: "
    code += "{start: {kind: pinned, position: [0, 0, 0]}, end: free}\\ninitial: equilibrium\\nmodel: catenary')"
    assert not loaded(code) & {"numba", "matplotlib", "h5py"}


def test_a_result_is_read_without_kernels_or_plots() -> None:
    assert not loaded("import hybrid; hybrid.open, hybrid.Result") & {"numba", "matplotlib", "pydantic"}


def test_importing_all_public_names_works() -> None:
    for name in hybrid.__all__:
        assert getattr(hybrid, name) is not None
    assert set(hybrid.__all__) <= set(dir(hybrid))


# Tests that look at a clock: they wait for another process or page, or end what hangs, with limits of many seconds.
# Anything that compares durations is a bench: a busy machine would fail it.
WAITING = {
    "extremes/extreme.py", "harden/harden_verdict.py", "harden/test_harden_files.py", "harden/test_harden_scenes.py",
    "harden/test_harden_yaml.py", "killed_studies.py", "live/test_live_browser.py", "live/viewed.py",
    "simulation/test_resume_bits.py", "simulation/test_resume_rows.py",
    "view/test_report_browser.py",
}  # fmt: skip
CLOCKS = re.compile(r"\b(process_time|perf_counter|monotonic|thread_time)(_ns)?\(|\btime\.time\(")


def test_no_test_of_the_default_run_is_timed() -> None:
    tests = Path(__file__).parent
    found = {x.relative_to(tests).as_posix() for x in tests.rglob("*.py") if CLOCKS.search(x.read_text("utf-8"))}
    assert found - {Path(__file__).name} <= WAITING


def by_index(source: str) -> list[int]:
    """Lines in which a number of a run's clock or counts is read or written by its place."""
    return [
        node.lineno
        for node in ast.walk(ast.parse(source))
        if isinstance(node, ast.Subscript)
        and ast.unparse(node.value).split(".")[-1].strip("_") in ("clock", "count", "counts", "winch", "stage")
        and re.fullmatch(r"(\w+\.)?[A-Z][A-Z0-9_]+", ast.unparse(node.slice))
    ]


def test_numbers_of_a_run_have_names() -> None:
    """`clock.now`, not `clock[NOW]` (kernels.machine.references)."""
    assert by_index("a = job.clock[NOW]\nb = clock.now\nc = self._counts[b.STEPS]") == [1, 3]
    found = {str(file.relative_to(PACKAGE)): by_index(file.read_text(encoding="utf-8")) for file in FILES}
    assert not {name: lines for name, lines in found.items() if lines}


# Constants that moved nothing in any scene of the tests, and of which no test shows the use: it may only fall.
OPEN_CONSTANTS = 0


def test_each_constant_says_what_it_moves() -> None:
    """A numeric constant of accuracy, model or simulation is in the rows of its module in docs/evidence/constants.md."""
    page = (PACKAGE.parent / "docs" / "evidence" / "constants.md").read_text(encoding="utf-8")
    for room in ("accuracy", "model", "simulation"):
        rows = re.findall(
            r"^\| `(\w+)` \| (.*) \|.*\|$", page.partition(f"## `{room}/`")[2].partition("\n## ")[0], re.M
        )
        for file in sorted((PACKAGE / room).glob("*.py")):
            said = {name for module, text in rows if module == file.stem for name in re.findall(r"`(\w+)`", text)}
            module = importlib.import_module(f"hybrid.{room}.{file.stem}")
            assigned = [x for x in ast.parse(file.read_text("utf-8")).body if isinstance(x, ast.Assign)]
            names = {y.id for x in assigned for t in x.targets for y in ast.walk(t) if isinstance(y, ast.Name)}
            values = {x: getattr(module, x) for x in names if x.isupper()}
            numbers = {x for x, v in values.items() if isinstance(v, int | float) and not isinstance(v, bool)}
            assert said == numbers, f"{room}/{file.name}: {said ^ numbers}"
    open_rows = re.findall(r"^\| `\w+` \| (.*) \|.*: open \|$", page, re.M)
    count = sum(row.count("` = ") for row in open_rows)
    assert count <= OPEN_CONSTANTS, f"{count} constants of which nobody has measured what they buy"
