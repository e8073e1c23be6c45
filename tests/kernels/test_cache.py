"""Machine code on disk: an edited kernel is compiled anew, wherever it stands; other people's caches are left alone."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
import pytest
from kernel_sizes import ENTRIES, Kernels

import hybrid
from hybrid.kernels.machine.cache import LEVELS, compiler_hash, processor, temporary_folder
from hybrid.kernels.machine.compile import kernel, linked_kernel
from hybrid.kernels.machine.kept_code import KeptCode
from hybrid.kernels.machine.references import caller, linked
from tests.inside import calls_of
from tests.scenes import cable_scene, pinned_at

PACKAGE = Path(hybrid.__file__).parent

# What is edited stands in another file than the kernel that uses it: numba alone would not notice.
VECTOR, TWICE = "    return (A[i, 0], A[i, 1], A[i, 2])\n", "    return (2.0 * A[i, 0], A[i, 1], A[i, 2])\n"

PULLED = """
import numpy as np
from hybrid.kernels.laws.closed_forms import find_force

# A cell of 1 m and 1 N between places 2 m apart: 1 N; and 3 N where vectors are read with twice their x.
places = np.array([[2.0, 0.0, 0.0], [0.5, 0.0, 0.0]])
find_force(np.zeros((1, 3)), np.ones(1), np.ones(1), places, 1e-9, 50, np.zeros(6))
print(places[1, 0])
"""

SCENE = """
import hybrid
from hybrid.kernels.run.newton import in_space
section = {"length": 1.0, "mass": 2.0, "bending_stiffness": 300.0, "torsional_stiffness": 1.0}
scene = hybrid.validate_scene({
    "cable": {"sections": [section]},
    "ends": {"start": {"kind": "clamped", "position": [0, 0, 0], "tangent": [1, 0, 0]}, "end": "free"},
    "initial": "equilibrium", "model": "rod", "mesh": {"cells": 4}, "dimension": 3,
})
hybrid.static(scene)
assert in_space.signatures
print(in_space.compilations)
"""


def answer(folder: Path, script: str, *arguments: str) -> float:
    """What a script prints with the copy of the package in `folder` and the cache beside it; a warning fails it."""
    environment = os.environ | {
        "PYTHONPATH": str(folder),
        "HYBRID_CACHE_DIR": str(folder / "cache"),
        "PYTHONWARNINGS": "error",
        "PYTHONDONTWRITEBYTECODE": "1",
    }
    command = [sys.executable, "-c", script, *arguments]
    done = subprocess.run(command, env=environment, cwd=folder, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return float(done.stdout)


def compiled(folder: Path) -> set[Path]:
    """Machine code of the copy in `folder`."""
    return set((folder / "cache").rglob("*.kernel"))


@pytest.fixture
def copy(tmp_path: Path) -> Path:
    """A folder with a copy of the package to edit."""
    shutil.copytree(PACKAGE, tmp_path / "hybrid", ignore=shutil.ignore_patterns("__pycache__", "compiled"))
    return tmp_path


def edit(folder: Path, file: str, old: str, new: str) -> None:
    path = folder / "hybrid" / file
    text = path.read_text()
    assert text.count(old) == 1, f"{file} holds {text.count(old)} times {old!r}"
    path.write_text(text.replace(old, new))


@pytest.mark.long
def test_a_copy_elsewhere_compiles_nothing_and_an_edit_in_another_file_anew(
    copy: Path, tmp_path_factory: pytest.TempPathFactory
) -> None:
    """Another environment or checkout of the same version, files with another date: the machine code is the same."""
    assert answer(copy, PULLED) == pytest.approx(1.0)
    kept = {x: x.stat().st_mtime_ns for x in compiled(copy)}
    assert kept
    elsewhere = tmp_path_factory.mktemp("elsewhere")
    shutil.copytree(copy / "hybrid", elsewhere / "hybrid", copy_function=shutil.copyfile)
    shutil.move(copy / "cache", elsewhere / "cache")
    assert answer(elsewhere, PULLED) == pytest.approx(1.0)
    moved = {copy / x.relative_to(elsewhere): x.stat().st_mtime_ns for x in compiled(elsewhere)}
    assert moved == kept
    edit(elsewhere, "kernels/algebra/rotations.py", VECTOR, TWICE)
    assert answer(elsewhere, PULLED) == pytest.approx(3.0)
    assert len(compiled(elsewhere)) > len(kept)


@pytest.mark.slow
def test_the_first_scene_from_a_wheel_compiles_nothing(tmp_path: Path) -> None:
    """A wheel with machine code, in an environment of its own, with an empty cache and a compiler that raises an error:

    the suspension has the numbers of code made for this processor.
    """
    if not {f"+{x}" for x in LEVELS[0].features} <= set(processor().features.split(",")):
        pytest.skip("this processor has no AVX2")
    source, root = tmp_path / "source", Path(__file__).parents[2]
    unwanted = shutil.ignore_patterns("__pycache__", "compiled")
    for name in ("hybrid", "examples", "release"):
        shutil.copytree(root / name, source / name, ignore=unwanted)
    for name in ("pyproject.toml", "hatch_build.py", "README.md", "LICENSE"):
        shutil.copy(root / name, source)
    kept = os.environ.get("HYBRID_CACHE_DIR", str(tmp_path / "kept"))  # compiled once for all runs of this test
    build = [sys.executable, str(source / "release" / "build_wheel.py"), "--few", "--cache", kept]
    subprocess.run([*build, "--output", str(tmp_path)], check=True, stdout=subprocess.DEVNULL)
    (wheel,) = tmp_path.glob("*.whl")
    assert wheel.name.split("-")[2] == f"cp{sys.version_info[0]}{sys.version_info[1]}"

    subprocess.run([sys.executable, "-m", "venv", "--without-pip", str(tmp_path / "venv")], check=True)
    python = tmp_path / "venv" / ("Scripts" if os.name == "nt" else "bin") / "python"
    where = [str(python), "-c", "import sysconfig; print(sysconfig.get_path('purelib'))"]
    site = Path(subprocess.run(where, check=True, capture_output=True, text=True).stdout.strip())
    (site / "dependencies.pth").write_text(f"{Path(np.__file__).parents[1]}\n")  # instead of downloads
    install = [sys.executable, "-m", "pip", "--python", str(python), "install", "-q", "--no-deps", str(wheel)]
    subprocess.run(install, check=True)
    scene = root / "examples" / "02_suspension.yaml"
    script = (
        "import sys, hybrid; from hybrid.kernels.machine.kept_code import KeptCode\n"
        "assert hybrid.__file__.startswith(sys.prefix), hybrid.__file__\n"
        "def fail(*_): raise AssertionError('a kernel is compiled')\n"
        "KeptCode._compiled = fail\n"
        "hybrid.run(hybrid.load_scene(sys.argv[1]), sys.argv[2], progress=False).close()\n"
        "assert 'numba' not in sys.modules"
    )
    environment = os.environ | {"HYBRID_CACHE_DIR": str(tmp_path / "empty"), "PYTHONPATH": ""}
    command = [str(python), "-W", "error", "-c", script, str(scene), str(tmp_path / "shipped.h5")]
    subprocess.run(command, env=environment, check=True, cwd=tmp_path)
    ask = [str(python), "-m", "hybrid", "--version"]
    told = subprocess.run(ask, env=environment, check=True, capture_output=True, text=True, cwd=tmp_path).stdout
    assert "machine code: of the package, for x86-64-v3" in told
    assert not list((tmp_path / "empty").rglob("*.kernel"))

    result = hybrid.run(hybrid.load_scene(scene), tmp_path / "own.h5", progress=False)
    with hybrid.open(tmp_path / "shipped.h5") as shipped:
        if "+avx512f" in processor().features:  # native code may sum in another order there
            np.testing.assert_allclose(shipped.tension, result.tension, rtol=1e-6, atol=1e-9)
        else:
            assert shipped.tension.tobytes() == result.tension.tobytes()
            assert shipped.position.tobytes() == result.position.tobytes()


DIGESTS = """
import json, pkgutil
from importlib import import_module
import hybrid.kernels
from hybrid.kernels.machine.compile import Entry
from hybrid.kernels.machine.kept_code import source_digest
rooms = pkgutil.walk_packages(hybrid.kernels.__path__, "hybrid.kernels.")
values = [x for room in rooms for x in vars(import_module(room.name)).values() if isinstance(x, Entry)]
print(json.dumps({f"{x.__module__}.{x.__qualname__}": source_digest(x.py_func) for x in values}))
"""


def digests(folder: Path) -> dict[str, str]:
    """Of the sources of each kernel of the copy in a folder."""
    environment = os.environ | {"PYTHONPATH": str(folder)}
    done = subprocess.run([sys.executable, "-c", DIGESTS], env=environment, cwd=folder, capture_output=True, check=True)
    return dict(json.loads(done.stdout))


@pytest.mark.long
def test_an_edit_means_new_code_of_the_kernels_that_it_reaches_and_of_no_others(copy: Path) -> None:
    """Functions, by the calls in the sources; constants and fields of another file; text changes nothing."""
    before, known = digests(copy), Kernels()
    reached = {x for x, kind in known.kind.items() if kind in ENTRIES}
    assert {f"{module}.{name}" for module, name in reached} == set(before)
    function = "hybrid.kernels.algebra.rotations", "get3"
    reaches = {".".join(x) for x in reached if x == function or function in known.copies(x)}
    assert 10 < len(reaches) < len(before) - 10

    def changed(file: str, old: str, new: str) -> set[str]:
        edit(copy, file, old, new)
        after = digests(copy)
        edit(copy, file, new, old)
        return {x for x in before if before[x] != after[x]}

    anew = changed("kernels/algebra/rotations.py", VECTOR, TWICE)
    assert reaches <= anew and len(anew) < len(before) - 10
    assert not changed("kernels/algebra/rotations.py", VECTOR, f"    # as a tuple\n{VECTOR}")
    assert not changed("kernels/run/network_run.py", '"""Steps of all lines until', '"""Steps of lines until')
    constant = changed("kernels/state/books.py", "FAILED = range(6)", "FAILED = range(50, 56)")
    assert (
        "hybrid.kernels.run.network_run.run_network" in constant
        and "hybrid.kernels.run.newton.in_plane" not in constant
    )
    field = "    itself: int = 0  # address of"
    moved = changed("kernels/step/line_step.py", field, "    another: int = 0\n" + field)
    assert "hybrid.kernels.run.newton.in_plane" in moved and len(moved) < len(before)


@pytest.mark.long
def test_a_second_process_compiles_nothing_for_its_scene() -> None:
    command = [sys.executable, "-c", SCENE]
    misses = [subprocess.run(command, capture_output=True, text=True, check=True).stdout for _ in range(2)]
    assert misses[1] == "0\n"


@pytest.mark.long
def test_own_numba_functions_keep_their_own_cache(tmp_path: Path) -> None:
    """The user's setting of numba's cache folder is the same before and after, and honoured."""
    (tmp_path / "mine.py").write_text("import numba\n@numba.njit(cache=True)\ndef twice(x):\n    return 2.0 * x\n")
    script = (
        "import numba.core.config as config\nbefore = config.CACHE_DIR\n"
        "import hybrid.kernels.march.energies\nassert config.CACHE_DIR == before\n"
        "import mine\nprint(mine.twice(1.5))"
    )
    own, ours = tmp_path / "own", tmp_path / "ours"
    environment = os.environ | {
        "NUMBA_CACHE_DIR": str(own),
        "HYBRID_CACHE_DIR": str(ours),
        "PYTHONPATH": f"{tmp_path}{os.pathsep}{PACKAGE.parent}",
    }
    done = subprocess.run([sys.executable, "-c", script], env=environment, cwd=tmp_path, capture_output=True, text=True)
    assert done.stdout == "3.0\n", done.stderr
    assert [p.name.split(".")[0] for p in own.rglob("*.nbc")] == ["mine"]
    assert not any("mine" in p.name for p in ours.rglob("*.kernel"))


def test_the_cache_folder_is_where_the_user_says(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from hybrid.kernels.machine.cache import cache_folder

    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "xdg"))
    monkeypatch.delenv("HYBRID_CACHE_DIR", raising=False)
    assert cache_folder() == tmp_path / "xdg" / "hybrid-cable" / compiler_hash()
    monkeypatch.setenv("HYBRID_CACHE_DIR", str(tmp_path / "here"))
    assert cache_folder() == tmp_path / "here" / "hybrid-cable" / compiler_hash()


@pytest.mark.skipif(not hasattr(os, "getuid"), reason="temporary folders belong to one user")
def test_a_temporary_cache_is_ours_alone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What is loaded from a cache is executed, and anybody can make a folder among the temporary ones."""
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    name = tmp_path / f"hybrid-cable-{os.getuid()}"
    ask = temporary_folder.__wrapped__
    assert ask() == name and name.stat().st_mode & 0o777 == 0o700
    assert ask() == name, "the next process of this user finds it again"
    name.chmod(0o770)
    other = ask()
    assert other != name and other.parent == tmp_path and other.stat().st_mode & 0o077 == 0
    name.rmdir()
    name.symlink_to(tmp_path)
    assert ask() not in (name, tmp_path)


@linked_kernel(lambda: (0.0,), 0.0)
def one_more(x):
    return x + 1.0


@kernel
def asks_for_more(table):
    return one_more(table[0]) if table[0] > 0.0 else -1.0


call_one = caller(0.0)


@kernel
def asks_by_address(address, table):
    return 2.0 * call_one(address, table)


def test_a_law_that_cannot_be_compiled_ends_what_calls_it_and_nothing_before(monkeypatch: pytest.MonkeyPatch) -> None:
    """Also through kernels that call each other by address; later it is compiled after all."""
    low, high = np.array([-1.0]), np.array([1.0])
    address, compiled = asks_for_more.address(low), linked[one_more.symbol]

    def interrupted() -> int:
        raise KeyboardInterrupt

    monkeypatch.setitem(linked, one_more.symbol, interrupted)
    assert asks_for_more(low) == -1.0
    assert asks_by_address(address, low) == -2.0
    with pytest.raises(KeyboardInterrupt):
        asks_for_more(high)
    with pytest.raises(KeyboardInterrupt):
        asks_by_address(address, high)
    monkeypatch.setitem(linked, one_more.symbol, compiled)
    assert asks_for_more(high) == 2.0
    assert asks_by_address(address, high) == 4.0


def test_laws_that_a_scene_does_not_have_are_not_compiled(monkeypatch: pytest.MonkeyPatch) -> None:
    asked = calls_of(monkeypatch, KeptCode, "taking", lambda code, _: code._name)
    section = {"length": 10, "mass": 1, "axial_stiffness": 1e6, "bending_stiffness": 1}
    ends = pinned_at(0, 0, 0), pinned_at(9, 0, 0)
    hybrid.run(cable_scene(section, *ends, model="rod", mesh=8, time=(0.2, 0.1)), progress=False).close()
    names = {x.removeprefix("hybrid.kernels.") for x in linked if ".laws." in x}
    assert {"laws.obstacles.passes", "laws.seabed.update_soil"} < names
    assert "run.network.begin_line" in asked
    assert not {*asked} & names
